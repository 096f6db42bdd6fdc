//! Tests of the import of meshes written by Gmsh, complete and damaged.

use std::collections::HashSet;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use base::Error;
use elements::mesh::gmsh::{GmshMesh, GmshWarning, read_gmsh};
use elements::mesh::{ElementKind, Mesh};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const ROBOT_RADIUS_M: f64 = 0.275e-3;
const OUTER_RADIUS_M: f64 = 10e-3;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/gmsh").join(name)
}

fn read(name: &str) -> GmshMesh {
    read_gmsh(data(name), 1e-3).unwrap()
}

fn text(name: &str) -> String {
    std::fs::read_to_string(data(name)).unwrap()
}

/// Writes `content` to a file and reads it as a mesh.
fn read_content(content: impl AsRef<[u8]>) -> base::Result<GmshMesh> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.msh");
    std::fs::write(&path, content).unwrap();
    read_gmsh(&path, 1e-3)
}

/// Checks that `content` is refused with a message that contains every text in `parts`.
fn assert_refused(content: impl AsRef<[u8]>, parts: &[&str]) {
    let error = read_content(content).expect_err("the mesh must be refused");
    assert!(matches!(error, Error::Input { .. }), "{error}");
    let message = error.to_string();
    for part in parts.iter().chain(&["mesh.msh", "what to do"]) {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

/// Replaces `from`, which must occur exactly once, by `to`.
fn replaced(text: &str, from: &str, to: &str) -> String {
    assert_eq!(text.matches(from).count(), 1, "`{from}` stands once");
    text.replace(from, to)
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn determinant(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// Volume of the mesh, computed from the elements' corners alone. Checks that every element's
/// volume is positive.
fn corner_volume(mesh: &Mesh) -> f64 {
    let mut total = 0.0;
    for nodes in mesh.elements() {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| mesh.node_coordinates_m[nodes[k] as usize]);
        let volume = determinant(sub(b, a), sub(c, a), sub(d, a)) / 6.0;
        assert!(volume > 0.0);
        total += volume;
    }
    total
}

fn radius(point: [f64; 3]) -> f64 {
    point.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// Checks that every node set contains exactly the nodes on its surface.
fn assert_node_sets(mesh: &Mesh) {
    let at = |test: &dyn Fn([f64; 3]) -> bool| -> Vec<u32> {
        (0..mesh.n_nodes() as u32).filter(|&node| test(mesh.node_coordinates_m[node as usize])).collect()
    };
    assert_eq!(mesh.robot_nodes, at(&|p| (radius(p) / ROBOT_RADIUS_M - 1.0).abs() < 1e-5));
    assert_eq!(mesh.outer_nodes, at(&|p| (radius(p) / OUTER_RADIUS_M - 1.0).abs() < 1e-5));
    assert_eq!(mesh.symmetry_y_nodes, at(&|p| p[1].abs() < 1e-10));
    assert_eq!(mesh.symmetry_z_nodes, at(&|p| p[2].abs() < 1e-10));
}

#[test]
fn quadratic_tetrahedra_come_with_their_surfaces() {
    let GmshMesh { mesh, warnings } = read("quarter_sphere_tet10.msh");
    assert_eq!((mesh.element_kind, mesh.n_nodes(), mesh.n_elements()), (ElementKind::Tetrahedron10, 1439, 749));
    assert_eq!(warnings, []);
    assert_node_sets(&mesh);
    let used: HashSet<u32> = mesh.connectivity.iter().copied().collect();
    assert_eq!(used.len(), mesh.n_nodes());
}

#[test]
fn edge_nodes_stand_between_the_corners_that_vtk_names() {
    let mesh = read("quarter_sphere_tet10.msh").mesh;
    for nodes in mesh.elements() {
        let point = |k: usize| mesh.node_coordinates_m[nodes[k] as usize];
        for (edge, [i, j]) in [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]].into_iter().enumerate() {
            let middle = std::array::from_fn(|axis| 0.5 * (point(i)[axis] + point(j)[axis]));
            let length = radius(sub(point(i), point(j)));
            // The node of a curved edge is off its chord by far less than half of the edge's
            // length. If nodes were exchanged, the distance would be about half of it.
            assert!(radius(sub(point(4 + edge), middle)) < 0.2 * length, "edge {edge} of {nodes:?}");
        }
    }
}

#[test]
fn text_and_binary_files_of_one_mesh_are_the_same_mesh() {
    assert_eq!(read("quarter_sphere_tet10.msh"), read("quarter_sphere_tet10_binary.msh"));
}

#[test]
fn linear_tetrahedra_are_accepted_with_a_warning_about_locking() {
    let GmshMesh { mesh, warnings } = read("quarter_sphere_tet4.msh");
    assert_eq!((mesh.element_kind, mesh.n_nodes(), mesh.n_elements()), (ElementKind::Tetrahedron4, 282, 930));
    assert_eq!(warnings, [GmshWarning::LinearTetrahedra { n_elements: 930 }]);
    let (text, advice) = (warnings[0].message(), warnings[0].advice());
    assert!(text.contains("18 %") && text.contains("lock") && advice.contains("-order 2"), "{text} {advice}");
    assert_node_sets(&mesh);
    // Flat facets cut off parts of the ball. The volume is therefore smaller than the ball's, by at
    // most a tenth.
    let volume = PI / 3.0 * (OUTER_RADIUS_M.powi(3) - ROBOT_RADIUS_M.powi(3));
    assert!((0.9..1.0).contains(&(corner_volume(&mesh) / volume)));
}

#[test]
fn the_unit_of_length_scales_the_mesh() {
    let in_mm = read("quarter_sphere_tet4.msh").mesh;
    let as_metres = read_gmsh(data("quarter_sphere_tet4.msh"), 1.0).unwrap().mesh;
    assert_eq!(in_mm.connectivity, as_metres.connectivity);
    for (a, b) in in_mm.node_coordinates_m.iter().zip(&as_metres.node_coordinates_m) {
        assert!(a.iter().zip(b).all(|(a, b)| *a == b * 1e-3));
    }
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let message = read_gmsh(data("quarter_sphere_tet4.msh"), wrong).unwrap_err().to_string();
        assert!(message.contains("metres_per_unit"), "{message}");
    }
}

#[test]
fn a_missing_group_is_named_with_the_way_to_define_it() {
    for name in ["robot", "outer", "symmetry_y", "symmetry_z"] {
        let without = replaced(&text("quarter_sphere_tet4.msh"), &format!("\"{name}\""), "\"other\"");
        assert_refused(
            without,
            &[&format!("`{name}` is missing"), &format!("Physical Surface(\"{name}\") = "), "Physical groups"],
        );
    }
}

#[test]
fn a_group_of_the_wrong_dimension_or_without_triangles_is_refused() {
    let mesh = text("quarter_sphere_tet4.msh");
    assert_refused(replaced(&mesh, "2 1 \"robot\"", "3 1 \"robot\""), &["`robot` has dimension 3"]);
    assert_refused(replaced(&mesh, "2 1 \"robot\"", "2 77 \"robot\""), &["`robot` holds no triangles"]);
}

#[test]
fn swapped_groups_are_caught_by_their_planes() {
    let mesh = text("quarter_sphere_tet4.msh");
    let swapped = mesh.replace("\"symmetry_y\"", "\"?\"").replace("\"symmetry_z\"", "\"symmetry_y\"");
    assert_refused(swapped.replace("\"?\"", "\"symmetry_z\""), &["off its plane y = 0"]);
}

#[test]
fn an_unnamed_part_of_the_boundary_is_refused() {
    let mesh = text("quarter_sphere_tet10.msh");
    let message = read_content(without_one_triangle(&mesh)).unwrap_err().to_string();
    assert!(message.contains("1 faces of the boundary are in none of the four groups"), "{message}");
}

/// Returns the file without its first surface triangle.
fn without_one_triangle(mesh: &str) -> String {
    let mut lines: Vec<String> = mesh.lines().map(str::to_owned).collect();
    let start = lines.iter().position(|line| line == "$Elements").unwrap();
    let lower = |line: &str, k: usize| -> String {
        let mut numbers: Vec<u64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        numbers[k] -= 1;
        numbers.iter().map(|number| format!("{number} ")).collect()
    };
    lines[start + 1] = lower(&lines[start + 1], 1);
    lines[start + 2] = lower(&lines[start + 2], 3);
    lines.remove(start + 3);
    lines.join("\n")
}

#[test]
fn a_surface_in_two_groups_is_refused() {
    let mesh = text("quarter_sphere_tet4.msh");
    let start = mesh.lines().position(|line| line == "$Entities").unwrap();
    let counts: Vec<usize> =
        mesh.lines().nth(start + 1).unwrap().split_whitespace().map(|word| word.parse().unwrap()).collect();
    // The line consists of tag, six bounds, number of physical tags, and tags. The first surface
    // gets the tags of `robot` and `outer`.
    let doubled = with_line(&mesh, start + 2 + counts[0] + counts[1], |words| {
        words.splice(7..9, ["2", "1", "2"]);
    });
    assert_refused(doubled, &["and in another group", "give every surface to one of"]);
}

/// File with one tetrahedron that has one face on each surface. `robot` lists the nodes of the
/// robot's face.
fn one_tetrahedron(robot: &str) -> String {
    format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n4\n2 1 \"robot\"\n2 2 \"outer\"\n2 3 \"symmetry_y\"\n\
         2 4 \"symmetry_z\"\n$EndPhysicalNames\n$Entities\n0 0 4 1\n1 0 0 0 1 1 1 1 1 0\n2 0 0 0 1 1 1 1 2 0\n\
         3 0 0 0 1 1 1 1 -3 0\n4 0 0 0 1 1 1 1 4 0\n1 0 0 0 1 1 1 0 0\n$EndEntities\n$Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n\
         1 0 0\n0 1 0\n0 0 1\n$EndNodes\n$Elements\n5 5 1 5\n2 1 2 1\n1 {robot}\n2 2 2 1\n2 2 3 4\n2 3 2 1\n3 1 2 4\n2 4 2 1\n4 1 2 3\n\
         3 1 4 1\n5 1 2 3 4\n$EndElements\n"
    )
}

#[test]
fn a_robot_that_touches_the_outer_surface_is_refused() {
    assert_refused(one_tetrahedron("1 3 4"), &["on `robot` and on `outer`"]);
}

#[test]
fn nodes_that_do_not_exist_are_refused_with_their_element() {
    let mesh = one_tetrahedron("1 3 9");
    let line = mesh.lines().position(|line| line == "1 1 3 9").unwrap() + 1;
    assert_refused(&mesh, &["element 1 names node 9", &format!("line {line}")]);
}

/// Line of the first volume element. It is the first element of the last block.
fn first_volume_element(mesh: &str) -> usize {
    let block = mesh.lines().position(|line| line.starts_with("3 1 11 ") || line.starts_with("3 1 4 ")).unwrap();
    block + 1
}

/// Returns `mesh` after `change` has been applied to the words of line `line`.
fn with_line(mesh: &str, line: usize, change: impl Fn(&mut Vec<&str>)) -> String {
    let mut lines: Vec<String> = mesh.lines().map(str::to_owned).collect();
    let mut words: Vec<&str> = mesh.lines().nth(line).unwrap().split_whitespace().collect();
    change(&mut words);
    lines[line] = words.join(" ");
    lines.join("\n")
}

#[test]
fn inside_out_elements_are_turned_and_said() {
    let mesh = text("quarter_sphere_tet10.msh");
    let original = read("quarter_sphere_tet10.msh").mesh;
    // The first element is mirrored. Corners 0 and 1 are exchanged and, in the order of Gmsh, the
    // edge nodes 5 and 6, and 7 and 9.
    let mirrored = with_line(&mesh, first_volume_element(&mesh), |words| {
        words.swap(1, 2);
        words.swap(1 + 5, 1 + 6);
        words.swap(1 + 7, 1 + 9);
    });
    let GmshMesh { mesh, warnings } = read_content(mirrored).unwrap();
    assert_eq!(warnings, [GmshWarning::InvertedElements { n_elements: 1 }]);
    assert_eq!(mesh, original);
}

#[test]
fn a_folded_element_is_named() {
    let mesh = text("quarter_sphere_tet10.msh");
    let line = first_volume_element(&mesh);
    let tag = mesh.lines().nth(line).unwrap().split(' ').next().unwrap();
    // The exchange of two edge nodes folds the element.
    let folded = with_line(&mesh, line, |words| words.swap(1 + 4, 1 + 9));
    assert_refused(folded, &[&format!("element {tag} is flat or folded"), "HighOrderOptimize"]);
}

#[test]
fn other_elements_are_refused() {
    let mesh = text("quarter_sphere_tet4.msh");
    let volume_block = mesh.lines().nth(first_volume_element(&mesh) - 1).unwrap();
    // Pyramids need five nodes per line, so that the following lines are wrong, too. The test
    // checks only the position of the error in the type's line.
    let unknown = replaced(&mesh, volume_block, &volume_block.replace("3 1 4 ", "3 1 92 "));
    let line = first_volume_element(&mesh);
    assert_refused(unknown, &["Gmsh type 92", &format!("line {line}"), "-order 2"]);
    let plane_only: String = mesh.replace(volume_block, &volume_block.replace("3 1 4 ", "2 99 3 "));
    assert_refused(plane_only, &["no volume elements", "Physical Volume"]);
}

#[test]
fn mixed_volume_elements_are_refused() {
    // The files are written by hand: a brick beside a tetrahedron, and tetrahedra of both orders.
    let mixed = |second: &str| {
        let nodes: String = (1..=14).map(|k| format!("{k}\n")).collect();
        let points: String = (1..=14).map(|k| format!("{k} {} {}\n", k * k % 7, k % 3)).collect();
        format!(
            "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 1\n1 0 0 0 1 1 1 0 0\n$EndEntities\n$Nodes\n1 14 1 14\n3 1 0 14\n\
             {nodes}{points}$EndNodes\n$Elements\n2 2 1 2\n3 1 4 1\n1 1 2 3 4\n{second}\n$EndElements\n"
        )
    };
    assert_refused(mixed("3 1 5 1\n2 1 2 3 4 5 6 7 8"), &["Gmsh type 5", "without recombination"]);
    assert_refused(mixed("3 1 11 1\n2 5 6 7 8 9 10 11 12 13 14"), &["of 4 and of 10 nodes are mixed"]);
}

#[test]
fn unused_nodes_are_dropped_and_said() {
    let mesh = text("quarter_sphere_tet4.msh");
    let mut lines: Vec<String> = mesh.lines().map(str::to_owned).collect();
    let start = lines.iter().position(|line| line == "$Nodes").unwrap();
    let counts: Vec<u64> = lines[start + 1].split(' ').map(|word| word.parse().unwrap()).collect();
    lines[start + 1] = format!("{} {} 1 9999", counts[0] + 1, counts[1] + 1);
    // The additional node is the first in the file, so that every index shifts.
    for (k, line) in ["0 77 0 1", "9999", "0 0 0"].into_iter().enumerate() {
        lines.insert(start + 2 + k, line.to_owned());
    }
    let GmshMesh { mesh, warnings } = read_content(lines.join("\n")).unwrap();
    assert!(warnings.contains(&GmshWarning::UnusedNodes { n_nodes: 1 }), "{warnings:?}");
    assert_eq!(mesh, read("quarter_sphere_tet4.msh").mesh);
}

#[test]
fn text_errors_name_the_line_and_binary_errors_the_byte() {
    let mesh = text("quarter_sphere_tet4.msh");
    let line = mesh.lines().position(|line| line == "$Nodes").unwrap() + 4;
    let wrong = with_line(&mesh, line, |words| words[0] = "0.5x");
    assert_refused(wrong, &[&format!("line {}", line + 1), "0.5x"]);
    let mut binary = std::fs::read(data("quarter_sphere_tet10_binary.msh")).unwrap();
    binary.truncate(60_000);
    assert_refused(&binary, &["at byte offset", "save it again"]);
}

#[test]
fn other_versions_and_other_files_are_refused_with_the_way_out() {
    assert_refused("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n", &["version 2.2", "-format msh41", "line 2"]);
    assert_refused("$MeshFormat\n4.1 1 8\n\u{0}\u{0}\u{0}\u{1}\n$EndMeshFormat\n", &["most significant byte first"]);
    assert_refused("", &["`$MeshFormat` is missing"]);
    assert_refused("time_s,force_uN\n0,4.6\n", &["line 1", "time_s"]);
    let message = read_gmsh(data("absent.msh"), 1e-3).unwrap_err().to_string();
    assert!(message.contains("cannot read") && message.contains("absent.msh"), "{message}");
}

#[test]
fn an_off_centre_robot_is_said() {
    // The whole mesh is shifted by half a radius along x.
    let mesh = text("quarter_sphere_tet4.msh");
    let (mut within, mut shifted) = (false, Vec::new());
    for line in mesh.lines() {
        within = (within || line == "$Nodes") && line != "$EndNodes";
        let words: Vec<&str> = line.split_whitespace().collect();
        if within && words.len() == 3 {
            let x: f64 = words[0].parse().unwrap();
            shifted.push(format!("{} {} {}", x + 0.1375, words[1], words[2]));
        } else {
            shifted.push(line.to_owned());
        }
    }
    let warnings = read_content(shifted.join("\n")).unwrap().warnings;
    let centre = warnings.iter().find_map(|warning| match warning {
        GmshWarning::RobotOffCentre { centre_x_m } => Some(*centre_x_m),
        _ => None,
    });
    assert!(centre.is_some_and(|centre| (centre - 0.1375e-3).abs() < 1e-6), "{warnings:?}");
}

/// Damages the content of a mesh file at random.
fn damage(original: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = original.to_vec();
    match rng.random_range(0..4) {
        0 => bytes.truncate(rng.random_range(0..bytes.len())),
        1 => {
            // Random bytes are changed, mostly in the head, which holds counts and dimensions.
            for _ in 0..rng.random_range(1..8) {
                let end = if rng.random_bool(0.5) { bytes.len().min(4000) } else { bytes.len() };
                let at = rng.random_range(0..end);
                bytes[at] = rng.random();
            }
        }
        2 => {
            // Digits replace digits. A text file then stays well formed, but may have a wrong
            // count.
            for _ in 0..rng.random_range(1..8) {
                let at = rng.random_range(0..bytes.len());
                if let Some(digit) = bytes[at..].iter_mut().find(|byte| byte.is_ascii_digit()) {
                    *digit = b'0' + rng.random_range(0..10_u8);
                }
            }
        }
        _ => {
            let start = rng.random_range(0..bytes.len());
            let end = (start + rng.random_range(1..400)).min(bytes.len());
            bytes.drain(start..end);
        }
    }
    bytes
}

#[test]
#[ignore = "thorough"]
fn damaged_files_never_panic_and_never_give_an_invalid_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.msh");
    let mut rng = ChaCha8Rng::seed_from_u64(20_130_703);
    let mut n_refused = 0;
    for name in ["quarter_sphere_tet4.msh", "quarter_sphere_tet10.msh", "quarter_sphere_tet10_binary.msh"] {
        let original = std::fs::read(data(name)).unwrap();
        for _ in 0..400 {
            std::fs::write(&path, damage(&original, &mut rng)).unwrap();
            match read_gmsh(&path, 1e-3) {
                // A mesh may stay valid if only a coordinate or an unread number is damaged.
                Ok(GmshMesh { mesh, .. }) => {
                    assert!(mesh.connectivity.iter().all(|&node| (node as usize) < mesh.n_nodes()));
                    assert!(mesh.node_coordinates_m.iter().flatten().all(|c| c.is_finite()));
                    corner_volume(&mesh);
                }
                Err(Error::Input { remedy, .. }) => {
                    assert!(!remedy.is_empty());
                    n_refused += 1;
                }
                Err(other) => panic!("{other}"),
            }
        }
    }
    // Half of the 1,200 files are cut off, and each cut must be detected.
    assert!(n_refused >= 600, "{n_refused} refused");
}

#[test]
fn the_surface_of_the_robot_is_a_quarter_sphere() {
    // The area of the facets between corners, from the node sets, is a quarter of 4πR² minus the
    // error of flat facets.
    let mesh = read("quarter_sphere_tet10.msh").mesh;
    let robot: HashSet<u32> = mesh.robot_nodes.iter().copied().collect();
    let mut area = 0.0;
    for nodes in mesh.elements() {
        for [i, j, k] in [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]] {
            let corners = [i, j, k].map(|k: usize| nodes[k]);
            if corners.iter().all(|node| robot.contains(node)) {
                let [a, b, c] = corners.map(|node| mesh.node_coordinates_m[node as usize]);
                let (u, v) = (sub(b, a), sub(c, a));
                let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
                area += 0.5 * radius(normal);
            }
        }
    }
    let exact = PI * ROBOT_RADIUS_M.powi(2);
    assert!((0.85..1.0).contains(&(area / exact)), "{}", area / exact);
}
