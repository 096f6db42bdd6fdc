//! Reader for the sections of an MSH 4.1 file. It returns plain lists without interpretation.

use std::collections::{HashMap, HashSet};

use super::scanner::Scanner;
use base::error::Result;

/// Content of an MSH file. Node tags are replaced by indices into `nodes`.
#[derive(Default)]
pub(super) struct RawMesh {
    /// (dimension, tag) of each physical group, by the group's name.
    pub groups: HashMap<String, (i32, i32)>,
    /// Physical tags of each geometric entity, by (dimension, entity tag).
    pub entity_groups: HashMap<(i32, i32), Vec<i32>>,
    /// Coordinates of every node in the file's unit.
    pub nodes: Vec<[f64; 3]>,
    pub blocks: Vec<ElementBlock>,
}

/// Elements of one type on one geometric entity of the file.
pub(super) struct ElementBlock {
    pub dimension: i32,
    pub entity: i32,
    /// Number by which Gmsh identifies the element type.
    pub kind: i32,
    pub tags: Vec<u64>,
    /// `nodes_per_element(kind)` node indices per element, in the order of Gmsh.
    pub nodes: Vec<u32>,
}

/// Number of nodes of an element of Gmsh's type `kind`. `None` for types above second order.
pub(super) fn nodes_per_element(kind: i32) -> Option<usize> {
    Some(match kind {
        15 => 1,
        1 => 2,
        2 | 8 => 3,
        3 | 4 => 4,
        5 | 16 => 8,
        6 | 9 => 6,
        7 => 5,
        10 => 9,
        11 => 10,
        12 => 27,
        13 => 18,
        14 => 14,
        17 => 20,
        18 => 15,
        19 => 13,
        _ => return None,
    })
}

/// Reads the sections that the import needs and skips the others.
pub(super) fn read_sections(scanner: &mut Scanner<'_>) -> Result<RawMesh> {
    let mut raw = RawMesh::default();
    let mut node_index = HashMap::new();
    let mut seen = HashSet::new();
    while let Some(name) = scanner.section()? {
        if !seen.insert(name) && matches!(name, "MeshFormat" | "Entities" | "Nodes" | "Elements") {
            return Err(scanner.damaged(format!("section `${name}` appears twice")));
        }
        if seen.len() == 1 && name != "MeshFormat" && name != "Comments" {
            return Err(scanner.damaged(format!("section `${name}` comes before `$MeshFormat`")));
        }
        match name {
            "MeshFormat" => read_format(scanner)?,
            "PhysicalNames" => read_physical_names(scanner, &mut raw)?,
            "Entities" => read_entities(scanner, &mut raw)?,
            "Nodes" => node_index = read_nodes(scanner, &mut raw)?,
            "Elements" => read_elements(scanner, &mut raw, &node_index)?,
            "PartitionedEntities" => {
                return Err(scanner.error(
                    "the mesh is partitioned",
                    "remove the partitions in Gmsh (Mesh > Unpartition) and save the mesh again",
                ));
            }
            _ => {
                scanner.skip_section(name)?;
                continue;
            }
        }
        scanner.end_of_section(name)?;
    }
    for name in ["MeshFormat", "Entities", "Nodes", "Elements"] {
        if !seen.contains(name) {
            return Err(scanner.file_error(
                format!("section `${name}` is missing"),
                "use a complete Gmsh 4.1 mesh, as written by `gmsh -3 -order 2 -format msh41`",
            ));
        }
    }
    Ok(raw)
}

fn read_format(scanner: &mut Scanner<'_>) -> Result<()> {
    let version: f64 = scanner.text_number("the format's version")?;
    if version != 4.1 {
        return Err(scanner.error(
            format!("the mesh has format version {version:.1}; only 4.1 is supported"),
            "save it with `gmsh -3 -format msh41`, or set Mesh.MshFileVersion = 4.1",
        ));
    }
    let is_binary: u8 = scanner.text_number("the file type (0 text, 1 binary)")?;
    let data_size: u8 = scanner.text_number("the size of an unsigned number")?;
    if is_binary > 1 || data_size != 8 {
        return Err(scanner.damaged(format!("file type {is_binary}, data size {data_size}; expected 0 or 1, size 8")));
    }
    if is_binary == 1 {
        scanner.end_of_line();
        scanner.binary = true;
        scanner.byte_order()?;
    }
    Ok(())
}

fn read_physical_names(scanner: &mut Scanner<'_>, raw: &mut RawMesh) -> Result<()> {
    // This section is text even in binary files.
    let count: u32 = scanner.text_number("the number of physical names")?;
    for _ in 0..count {
        let dimension = scanner.text_number("a physical group's dimension")?;
        let tag = scanner.text_number("a physical group's tag")?;
        let name = scanner.quoted("a physical group's name")?;
        if let Some((other, _)) = raw.groups.insert(name.clone(), (dimension, tag)) {
            return Err(scanner.error(
                format!("physical name `{name}` is used twice, in dimensions {other} and {dimension}"),
                "give every physical group its own name",
            ));
        }
    }
    Ok(())
}

fn read_entities(scanner: &mut Scanner<'_>, raw: &mut RawMesh) -> Result<()> {
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = scanner.count("a number of geometric entities", 36)?;
    }
    for (dimension, count) in (0..).zip(counts) {
        for _ in 0..count {
            let tag = scanner.int("an entity's tag")?;
            for _ in 0..if dimension == 0 { 3 } else { 6 } {
                scanner.double("an entity's bounds")?;
            }
            let n_groups = scanner.count("a number of physical tags", 4)?;
            let mut groups = Vec::with_capacity(n_groups);
            for _ in 0..n_groups {
                // A negative tag names the group whose orientation is opposite to the entity's.
                groups.push(scanner.int("a physical tag")?.saturating_abs());
            }
            if dimension > 0 {
                for _ in 0..scanner.count("a number of bounding entities", 4)? {
                    scanner.int("a bounding entity")?;
                }
            }
            raw.entity_groups.insert((dimension, tag), groups);
        }
    }
    Ok(())
}

fn read_nodes(scanner: &mut Scanner<'_>, raw: &mut RawMesh) -> Result<HashMap<u64, u32>> {
    let n_blocks = scanner.count("the number of node blocks", 20)?;
    let n_nodes = scanner.count("the number of nodes", 32)?;
    if u32::try_from(n_nodes).is_err() {
        return Err(scanner.error(format!("{n_nodes} nodes are too many"), "make a coarser mesh"));
    }
    scanner.size("the smallest node tag")?;
    scanner.size("the largest node tag")?;
    let mut index = HashMap::with_capacity(n_nodes);
    raw.nodes.reserve(n_nodes);
    for _ in 0..n_blocks {
        let dimension = scanner.int("a node block's dimension")?;
        scanner.int("a node block's entity")?;
        let is_parametric = scanner.int("the flag for parametric nodes")?;
        let n_parameters = match (is_parametric, dimension) {
            (0, 0..=3) => 0,
            (1, 0..=3) => dimension,
            _ => {
                return Err(scanner.damaged(format!(
                    "a node block has the dimension {dimension} and the parametric flag {is_parametric}"
                )));
            }
        };
        let n_in_block = scanner.count("a node block's size", 32)?;
        for _ in 0..n_in_block {
            let tag = scanner.size("a node's tag")?;
            let next = index.len() as u32;
            if index.insert(tag, next).is_some() || index.len() > n_nodes {
                return Err(
                    scanner.damaged(format!("node {tag} appears twice, or the file has more nodes than declared"))
                );
            }
        }
        for _ in 0..n_in_block {
            let mut point = [0.0; 3];
            for coordinate in &mut point {
                *coordinate = scanner.double("a node's coordinate")?;
            }
            for _ in 0..n_parameters {
                scanner.double("a node's parameter")?;
            }
            raw.nodes.push(point);
        }
    }
    if raw.nodes.len() == n_nodes {
        Ok(index)
    } else {
        Err(scanner.damaged(format!("{} nodes found, but {n_nodes} declared", raw.nodes.len())))
    }
}

fn read_elements(scanner: &mut Scanner<'_>, raw: &mut RawMesh, node_index: &HashMap<u64, u32>) -> Result<()> {
    let n_blocks = scanner.count("the number of element blocks", 20)?;
    let n_elements = scanner.count("the number of elements", 16)?;
    scanner.size("the smallest element tag")?;
    scanner.size("the largest element tag")?;
    let mut n_read = 0;
    for _ in 0..n_blocks {
        let block = read_element_block(scanner, node_index)?;
        n_read += block.tags.len();
        raw.blocks.push(block);
    }
    if n_read == n_elements {
        Ok(())
    } else {
        Err(scanner.damaged(format!("{n_read} elements found, but {n_elements} declared")))
    }
}

fn read_element_block(scanner: &mut Scanner<'_>, node_index: &HashMap<u64, u32>) -> Result<ElementBlock> {
    let dimension = scanner.int("an element block's dimension")?;
    let entity = scanner.int("an element block's entity")?;
    let kind = scanner.int("an element type")?;
    let Some(n_nodes) = nodes_per_element(kind) else {
        return Err(scanner.error(
            format!("elements of Gmsh type {kind} are not supported"),
            "mesh with tetrahedra of second order: `gmsh -3 -order 2 -format msh41`",
        ));
    };
    let n_in_block = scanner.count("an element block's size", 8 * (n_nodes + 1))?;
    let mut tags = Vec::with_capacity(n_in_block);
    let mut nodes = Vec::new();
    for _ in 0..n_in_block {
        let tag = scanner.size("an element's tag")?;
        tags.push(tag);
        for _ in 0..n_nodes {
            let node = scanner.size("an element's node")?;
            match node_index.get(&node) {
                Some(&idx) => nodes.push(idx),
                None => return Err(scanner.damaged(format!("element {tag} names node {node}, which does not exist"))),
            }
        }
    }
    Ok(ElementBlock { dimension, entity, kind, tags, nodes })
}
