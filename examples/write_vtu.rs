//! Writes meshes of every element kind with fields on their nodes, for ParaView: `cargo run --example write_vtu -- FOLDER`.

use std::path::PathBuf;

use vitreo_uq::elements::mesh::gmsh::read_gmsh;
use vitreo_uq::elements::mesh::hexahedron27_nodes::HEXAHEDRON27_REFERENCE_NODES;
use vitreo_uq::elements::mesh::vtu::{PointData, TimeStep, write_pvd, write_vtu};
use vitreo_uq::elements::mesh::{ElementKind, Mesh};

/// A single brick of 2 × 4 × 6 m.
fn brick() -> Mesh {
    Mesh {
        node_coordinates_m: HEXAHEDRON27_REFERENCE_NODES.map(|[xi, eta, zeta]| [xi, 2.0 * eta, 3.0 * zeta]).to_vec(),
        element_kind: ElementKind::Hexahedron27,
        connectivity: (0..27).collect(),
        robot_nodes: vec![],
        outer_nodes: vec![],
        symmetry_y_nodes: vec![],
        symmetry_z_nodes: vec![],
    }
}

fn main() -> vitreo_uq::Result<()> {
    let folder = std::env::args_os().nth(1).map_or_else(std::env::temp_dir, PathBuf::from);
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/gmsh/quarter_sphere_");
    let meshes = [
        ("tetrahedron4.vtu", read_gmsh(format!("{data}tet4.msh"), 1e-3)?.mesh),
        ("tetrahedron10.vtu", read_gmsh(format!("{data}tet10_binary.msh"), 1e-3)?.mesh),
        ("hexahedron27.vtu", brick()),
    ];
    for (file, mesh) in &meshes {
        let nodes = &mesh.node_coordinates_m;
        // The field (x, xy, x²y²z²), which a 27-node brick represents exactly.
        let vector: Vec<f64> = nodes.iter().flat_map(|&[x, y, z]| [x, x * y, x * x * y * y * z * z]).collect();
        let distance_m: Vec<f64> = nodes.iter().map(|[x, y, z]| (x * x + y * y + z * z).sqrt()).collect();
        let fields = [
            PointData { name: "polynomials", components: 3, values: &vector },
            PointData { name: "distance_m", components: 1, values: &distance_m },
        ];
        write_vtu(folder.join(file), mesh, &fields)?;
        println!("{file}: {} nodes, {} elements", mesh.n_nodes(), mesh.n_elements());
    }
    let steps = [TimeStep { time_s: 0.0, file: meshes[0].0 }, TimeStep { time_s: 0.5, file: meshes[1].0 }];
    write_pvd(folder.join("series.pvd"), &steps)
}
