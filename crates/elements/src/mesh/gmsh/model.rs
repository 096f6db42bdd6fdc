//! Builds the quarter model from the sections of a file: volume elements and node sets. Also checks
//! the geometry.

use std::collections::{HashMap, HashSet};

use super::orientation::{Orientation, orientation, turn};
use super::sections::{ElementBlock, RawMesh, nodes_per_element};
use super::{GmshMesh, GmshWarning};
use crate::mesh::{ElementKind, Mesh};
use base::error::{Error, Result};

/// Names of the physical groups that a mesh must define.
const SURFACES: [&str; 4] = ["robot", "outer", "symmetry_y", "symmetry_z"];
/// Largest distance of a node from its symmetry plane, relative to the mesh's extent.
const PLANE_TOLERANCE: f64 = 1e-6;
/// Largest distance along x from the origin to the robot's middle that causes no warning, relative
/// to the robot's extent.
const CENTRE_TOLERANCE: f64 = 0.01;
/// Index of a node that belongs to no volume element.
const UNUSED: u32 = u32::MAX;

/// Function that builds an error about the mesh file. Its arguments are the fault found and the
/// remedy.
pub(super) type Refuse<'a> = dyn Fn(String, String) -> Error + 'a;
/// Node indices of the three corners of a triangle, sorted.
type Face = [u32; 3];

/// Builds the quarter model from the content of an MSH file and checks it. `metres_per_unit` is the
/// length of the file's unit in m.
pub(super) fn build(raw: RawMesh, refuse: &Refuse<'_>, metres_per_unit: f64) -> Result<GmshMesh> {
    let mut warnings = Vec::new();
    let (element_kind, mut connectivity, tags) = volume_elements(&raw.blocks, refuse)?;
    if element_kind == ElementKind::Tetrahedron4 {
        warnings.push(GmshWarning::LinearTetrahedra { n_elements: tags.len() });
    }
    let n_turned = orient(&mut connectivity, element_kind.n_nodes(), &tags, &raw.nodes, refuse)?;
    if n_turned > 0 {
        warnings.push(GmshWarning::InvertedElements { n_elements: n_turned });
    }
    let named = |k: usize| surface(&raw, SURFACES[k], refuse);
    let surfaces = [named(0)?, named(1)?, named(2)?, named(3)?];
    check_boundary(&connectivity, element_kind.n_nodes(), &surfaces, &raw.nodes, refuse)?;

    let (new_index, node_coordinates_m) = compact(&raw.nodes, &mut connectivity, metres_per_unit);
    let n_unused = raw.nodes.len() - node_coordinates_m.len();
    if n_unused > 0 {
        warnings.push(GmshWarning::UnusedNodes { n_nodes: n_unused });
    }
    let set = |k: usize| node_set(SURFACES[k], &surfaces[k], &new_index, refuse);
    let mesh = Mesh {
        node_coordinates_m,
        element_kind,
        connectivity,
        robot_nodes: set(0)?,
        outer_nodes: set(1)?,
        symmetry_y_nodes: set(2)?,
        symmetry_z_nodes: set(3)?,
    };
    check_geometry(&mesh, metres_per_unit, refuse)?;
    warnings.extend(off_centre(&mesh));
    Ok(GmshMesh { mesh, warnings })
}

/// Returns, for all volume elements: their type, their node indices in the order of VTK, and their
/// tags.
fn volume_elements(blocks: &[ElementBlock], refuse: &Refuse<'_>) -> Result<(ElementKind, Vec<u32>, Vec<u64>)> {
    let mut found = None;
    let (mut connectivity, mut tags) = (Vec::new(), Vec::new());
    for block in blocks.iter().filter(|block| block.dimension == 3 && !block.tags.is_empty()) {
        let kind = match block.kind {
            4 => ElementKind::Tetrahedron4,
            11 => ElementKind::Tetrahedron10,
            other => {
                return Err(refuse(
                    format!(
                        "volume {} has elements of Gmsh type {other}; tetrahedra of 4 or 10 nodes are needed",
                        block.entity
                    ),
                    "mesh with tetrahedra: `gmsh -3 -order 2 -format msh41`, without recombination".to_owned(),
                ));
            }
        };
        if *found.get_or_insert(kind) != kind {
            return Err(refuse(
                "volume elements of 4 and of 10 nodes are mixed".to_owned(),
                "use one order for the whole mesh: `gmsh -3 -order 2 -format msh41`".to_owned(),
            ));
        }
        tags.extend_from_slice(&block.tags);
        for nodes in block.nodes.chunks_exact(kind.n_nodes()) {
            let start = connectivity.len();
            connectivity.extend_from_slice(nodes);
            if kind == ElementKind::Tetrahedron10 {
                // Gmsh and VTK number the edges 2–3 and 1–3 in opposite order.
                connectivity.swap(start + 8, start + 9);
            }
        }
    }
    match found {
        Some(kind) => Ok((kind, connectivity, tags)),
        None => Err(refuse(
            "there are no volume elements".to_owned(),
            "mesh in three dimensions (`gmsh -3`); if there are physical groups, Gmsh saves only these, so add \
             `Physical Volume(\"gel\") = {…};`"
                .to_owned(),
        )),
    }
}

/// Renumbers inverted elements and returns their number. Fails for degenerate elements.
fn orient(
    connectivity: &mut [u32],
    n_nodes: usize,
    tags: &[u64],
    points: &[[f64; 3]],
    refuse: &Refuse<'_>,
) -> Result<usize> {
    let mut n_turned = 0;
    let mut element_points = Vec::with_capacity(n_nodes);
    for (nodes, tag) in connectivity.chunks_exact_mut(n_nodes).zip(tags) {
        element_points.clear();
        element_points.extend(nodes.iter().map(|&node| points[node as usize]));
        match orientation(&element_points) {
            Orientation::Positive => {}
            Orientation::Negative => {
                turn(nodes);
                n_turned += 1;
            }
            Orientation::Degenerate => {
                return Err(refuse(
                    format!("element {tag} is flat or folded over itself (its Jacobian changes sign)"),
                    "let Gmsh repair curved elements (Mesh.HighOrderOptimize = 2) or mesh finer near the robot"
                        .to_owned(),
                ));
            }
        }
    }
    Ok(n_turned)
}

/// One named surface of the mesh.
struct Surface {
    nodes: Vec<u32>,
    faces: Vec<Face>,
}

/// Finds the triangles of the physical group `name`.
fn surface(raw: &RawMesh, name: &str, refuse: &Refuse<'_>) -> Result<Surface> {
    let define = || {
        format!(
            "define it in the geometry as `Physical Surface(\"{name}\") = {{…}};` with the numbers of its surfaces (Gmsh: \
             Modules > Geometry > Physical groups > Add > Surface) and mesh again"
        )
    };
    let Some(&(dimension, tag)) = raw.groups.get(name) else {
        return Err(refuse(format!("the physical group `{name}` is missing"), define()));
    };
    if dimension != 2 {
        return Err(refuse(format!("the physical group `{name}` has dimension {dimension}, not 2"), define()));
    }
    let mut surface = Surface { nodes: Vec::new(), faces: Vec::new() };
    let holds = |block: &&ElementBlock| {
        block.dimension == 2
            && raw.entity_groups.get(&(2, block.entity)).is_some_and(|groups| groups.contains(&tag.saturating_abs()))
    };
    for block in raw.blocks.iter().filter(holds) {
        if !matches!(block.kind, 2 | 9) {
            return Err(refuse(
                format!("surface {} of `{name}` has elements of Gmsh type {}, not triangles", block.entity, block.kind),
                "mesh without recombination into quadrangles".to_owned(),
            ));
        }
        surface.nodes.extend_from_slice(&block.nodes);
        let n_nodes = nodes_per_element(block.kind).unwrap_or(3);
        surface.faces.extend(block.nodes.chunks_exact(n_nodes).map(|nodes| sorted([nodes[0], nodes[1], nodes[2]])));
    }
    if surface.faces.is_empty() {
        return Err(refuse(format!("the physical group `{name}` holds no triangles"), define()));
    }
    Ok(surface)
}

fn sorted(mut face: Face) -> Face {
    face.sort_unstable();
    face
}

/// Checks that every face of the volume's boundary is in a group. A face in no group would be free
/// of traction. Checks also that every group lies on the boundary.
fn check_boundary(
    connectivity: &[u32],
    n_nodes: usize,
    surfaces: &[Surface; 4],
    points: &[[f64; 3]],
    refuse: &Refuse<'_>,
) -> Result<()> {
    let mut n_elements_of: HashMap<Face, u32> = HashMap::new();
    for nodes in connectivity.chunks_exact(n_nodes) {
        for [a, b, c] in [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]] {
            *n_elements_of.entry(sorted([nodes[a], nodes[b], nodes[c]])).or_default() += 1;
        }
    }
    let mut named = HashSet::new();
    for (name, surface) in SURFACES.iter().zip(surfaces) {
        for face in &surface.faces {
            if n_elements_of.get(face) != Some(&1) {
                return Err(refuse(
                    format!(
                        "a triangle of `{name}` near {:?} is not on the boundary of the volume mesh",
                        points[face[0] as usize]
                    ),
                    format!("put only outer surfaces of the gel into `{name}`, and mesh nothing inside the robot"),
                ));
            }
            if !named.insert(*face) {
                return Err(refuse(
                    format!("a triangle near {:?} is in `{name}` and in another group", points[face[0] as usize]),
                    "give every surface to one of `robot`, `outer`, `symmetry_y`, `symmetry_z`".to_owned(),
                ));
            }
        }
    }
    let unnamed = n_elements_of.iter().filter(|&(face, &n)| n == 1 && !named.contains(face)).map(|(face, _)| face);
    let n_unnamed = unnamed.clone().count();
    match unnamed.min() {
        None => Ok(()),
        Some(face) => Err(refuse(
            format!(
                "{n_unnamed} faces of the boundary are in none of the four groups, one of them near {:?}",
                points[face[0] as usize]
            ),
            "give every outer surface of the gel to one of `robot`, `outer`, `symmetry_y`, `symmetry_z`".to_owned(),
        )),
    }
}

/// Drops nodes that belong to no element and renumbers `connectivity`. Returns the new index of
/// each old node, and the kept coordinates in m.
fn compact(nodes: &[[f64; 3]], connectivity: &mut [u32], metres_per_unit: f64) -> (Vec<u32>, Vec<[f64; 3]>) {
    let mut new_index = vec![UNUSED; nodes.len()];
    for &node in connectivity.iter() {
        new_index[node as usize] = 0;
    }
    let mut kept = Vec::new();
    for (index, point) in new_index.iter_mut().zip(nodes) {
        if *index != UNUSED {
            *index = kept.len() as u32;
            kept.push(point.map(|coordinate| coordinate * metres_per_unit));
        }
    }
    for node in connectivity.iter_mut() {
        *node = new_index[*node as usize];
    }
    (new_index, kept)
}

/// Nodes of a surface in the new numbering, sorted.
fn node_set(name: &str, surface: &Surface, new_index: &[u32], refuse: &Refuse<'_>) -> Result<Vec<u32>> {
    let mut set: Vec<u32> = surface.nodes.iter().map(|&node| new_index[node as usize]).collect();
    set.sort_unstable();
    set.dedup();
    if set.last() == Some(&UNUSED) {
        return Err(refuse(
            format!("triangles of `{name}` have nodes that no volume element has"),
            "set one order for the whole mesh: `gmsh -3 -order 2 -format msh41`".to_owned(),
        ));
    }
    Ok(set)
}

/// Checks that symmetry nodes lie on their planes, and that the mesh is on the positive side of
/// both. Also checks that the robot does not touch the outer surface.
fn check_geometry(mesh: &Mesh, metres_per_unit: f64, refuse: &Refuse<'_>) -> Result<()> {
    let extent = mesh.node_coordinates_m.iter().flatten().fold(0.0_f64, |extent, c| extent.max(c.abs()));
    let tolerance = PLANE_TOLERANCE * extent;
    let in_file_units = |node: u32| mesh.node_coordinates_m[node as usize].map(|c| c / metres_per_unit);
    for (name, axis, plane, nodes) in
        [("symmetry_y", 1, "y = 0", &mesh.symmetry_y_nodes), ("symmetry_z", 2, "z = 0", &mesh.symmetry_z_nodes)]
    {
        if let Some(&node) = nodes.iter().find(|&&n| mesh.node_coordinates_m[n as usize][axis].abs() > tolerance) {
            return Err(refuse(
                format!("a node of `{name}` is at {:?}, off its plane {plane}", in_file_units(node)),
                format!("put only the flat surfaces on {plane} into `{name}`, with the robot's centre at the origin"),
            ));
        }
        let below = (0_u32..).zip(&mesh.node_coordinates_m).find(|(_, point)| point[axis] < -tolerance);
        if let Some((node, _)) = below {
            return Err(refuse(
                format!("a node is at {:?}, behind the symmetry plane {plane}", in_file_units(node)),
                "mesh the quarter with y ≥ 0 and z ≥ 0".to_owned(),
            ));
        }
    }
    match mesh.robot_nodes.iter().find(|node| mesh.outer_nodes.binary_search(node).is_ok()) {
        None => Ok(()),
        Some(&node) => Err(refuse(
            format!("the node at {:?} is on `robot` and on `outer`", in_file_units(node)),
            "keep the robot's surface away from the outer one".to_owned(),
        )),
    }
}

/// Returns a warning if the robot's extent along x is not centred at the origin.
fn off_centre(mesh: &Mesh) -> Option<GmshWarning> {
    let (least, largest) = mesh
        .robot_nodes
        .iter()
        .map(|&node| mesh.node_coordinates_m[node as usize][0])
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, largest), x| (least.min(x), largest.max(x)));
    let centre_x_m = 0.5 * (least + largest);
    (centre_x_m.abs() > CENTRE_TOLERANCE * (largest - least)).then_some(GmshWarning::RobotOffCentre { centre_x_m })
}
