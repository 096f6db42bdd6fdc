//! Patch test: distorted and curved elements must represent every linear displacement field
//! exactly.

use std::path::Path;

use elements::fe::Assembly;
use elements::fe::assembly::unit_moduli;
use elements::fe::factorisation::add_symmetric_product;
use elements::mesh::gmsh::read_gmsh;
use elements::mesh::{ElementKind, HEXAHEDRON27_REFERENCE_NODES, Mesh};
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const POISSON_RATIOS: [f64; 3] = [0.0, 0.3, 0.499];

/// Makes a freely floating body of a mesh. A mesh must have a robot and an outer surface; here they
/// are nodes that belong to no element.
fn free_body(mut mesh: Mesh) -> Mesh {
    let n_nodes = mesh.n_nodes() as u32;
    mesh.node_coordinates_m.extend([[0.0; 3]; 2]);
    (mesh.robot_nodes, mesh.outer_nodes) = (vec![n_nodes], vec![n_nodes + 1]);
    (mesh.symmetry_y_nodes, mesh.symmetry_z_nodes) = (Vec::new(), Vec::new());
    mesh
}

/// The cube {0, 1}³ of 3 × 3 × 3 hexahedra with 27 nodes. Every node is moved at random by up to a
/// sixth of the distance between nodes. Nodes on the boundary stay on it. Edges and faces are thus
/// curved, and the volume is still 1.
fn distorted_cube() -> (Mesh, Vec<usize>) {
    const N: usize = 3;
    let per_axis = 2 * N + 1;
    let spacing = 1.0 / (2 * N) as f64;
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let (mut node_coordinates_m, mut interior) = (Vec::new(), Vec::new());
    for node in 0..per_axis.pow(3) {
        let grid = [node % per_axis, node / per_axis % per_axis, node / per_axis.pow(2)];
        if grid.iter().all(|&g| g > 0 && g < 2 * N) {
            interior.push(node);
        }
        node_coordinates_m.push(grid.map(|g| {
            let shift: f64 = rng.random_range(-1.0..1.0) / 6.0;
            (g as f64 + if g == 0 || g == 2 * N { 0.0 } else { shift }) * spacing
        }));
    }
    let mut connectivity = Vec::new();
    for element in 0..N.pow(3) {
        let corner = [element % N, element / N % N, element / N.pow(2)].map(|e| 2 * e);
        connectivity.extend(HEXAHEDRON27_REFERENCE_NODES.iter().map(|reference| {
            let [i, j, k] = std::array::from_fn(|d| corner[d] + (reference[d] + 1.0) as usize);
            (i + per_axis * (j + per_axis * k)) as u32
        }));
    }
    let mesh = Mesh {
        node_coordinates_m,
        element_kind: ElementKind::Hexahedron27,
        connectivity,
        robot_nodes: Vec::new(),
        outer_nodes: Vec::new(),
        symmetry_y_nodes: Vec::new(),
        symmetry_z_nodes: Vec::new(),
    };
    (free_body(mesh), interior)
}

/// Reads a mesh from Gmsh, removes its supports and scales it to a unit outer radius. Also returns
/// its interior nodes.
fn gmsh_body(name: &str) -> (Mesh, Vec<usize>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/gmsh").join(name);
    let mesh = read_gmsh(path, 0.1).expect("a mesh of the tests").mesh;
    let mut on_boundary = vec![false; mesh.n_nodes()];
    for nodes in [&mesh.robot_nodes, &mesh.outer_nodes, &mesh.symmetry_y_nodes, &mesh.symmetry_z_nodes] {
        nodes.iter().for_each(|&node| on_boundary[node as usize] = true);
    }
    let interior = (0..mesh.n_nodes()).filter(|&node| !on_boundary[node]).collect();
    (free_body(mesh), interior)
}

/// Volume of tetrahedra with straight edges, computed from their corners.
fn straight_volume(mesh: &Mesh) -> f64 {
    let volume = |nodes: &[u32]| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| Vector3::from(mesh.node_coordinates_m[nodes[k] as usize]));
        Matrix3::from_columns(&[b - a, c - a, d - a]).determinant() / 6.0
    };
    mesh.elements().map(volume).sum()
}

/// Displacement gradients of the tests: three diagonal ones, three with shear and rotation, one
/// full.
fn gradients() -> Vec<Matrix3<f64>> {
    let mut gradients: Vec<Matrix3<f64>> =
        (0..3).map(|i| Matrix3::from_fn(|r, c| f64::from(u8::from(r == i && c == i)))).collect();
    gradients
        .extend([(0, 1), (2, 1), (0, 2)].map(|(i, j)| Matrix3::from_fn(|r, c| f64::from(u8::from((r, c) == (i, j))))));
    gradients.push(Matrix3::new(0.3, -1.2, 0.5, 0.8, -0.7, 0.1, -0.4, 0.9, 1.1));
    gradients
}

/// Nodal forces of the field u = G x, and its strain energy ½ uᵀ K̂ u.
fn forces_and_energy(
    assembly: &Assembly,
    mesh: &Mesh,
    gradient: Matrix3<f64>,
    poisson_ratio: f64,
) -> (Vec<[f64; 3]>, f64) {
    let n = assembly.unknowns.count();
    let mut u = vec![0.0; n];
    for (node, &x) in mesh.node_coordinates_m.iter().enumerate().take(mesh.n_nodes() - 2) {
        // No nodes are tied, so that every unknown belongs to one node. Adding a value to zero
        // therefore sets it.
        assembly.unknowns.add_nodal_force(node, (gradient * Vector3::from(x)).into(), &mut u);
    }
    let mut force = vec![0.0; n];
    add_symmetric_product(assembly.unit_stiffness(poisson_ratio).as_ref(), &u, &mut force);
    let energy = 0.5 * u.iter().zip(&force).map(|(u, f)| u * f).sum::<f64>();
    (assembly.unknowns.nodal_displacement(&force), energy)
}

/// Energy density ½ (2μ̂ dev ε : dev ε + κ̂ (tr ε)²), per Pa of Young's modulus.
fn energy_density(gradient: Matrix3<f64>, poisson_ratio: f64) -> f64 {
    let strain = (gradient + gradient.transpose()) * 0.5;
    let deviator = strain - Matrix3::identity() * (strain.trace() / 3.0);
    let [two_mu, kappa] = unit_moduli(poisson_ratio);
    0.5 * (two_mu * deviator.norm_squared() + kappa * strain.trace().powi(2))
}

/// Checks that forces at interior nodes are negligible relative to forces at the boundary, and that
/// the energy has its closed form. `volume_m3` is given if it is known.
fn assert_patch(name: &str, mesh: &Mesh, interior: &[usize], volume_m3: Option<f64>) {
    assert!(interior.len() > 5, "{name} has an interior");
    let assembly = Assembly::new(mesh).expect("no element is inverted");
    let mut volume_m3 = volume_m3;
    for poisson_ratio in POISSON_RATIOS {
        for gradient in gradients() {
            let (forces, energy) = forces_and_energy(&assembly, mesh, gradient, poisson_ratio);
            let norm = |f: &[f64; 3]| Vector3::from(*f).norm();
            let largest = forces.iter().map(norm).fold(0.0, f64::max);
            let inside = interior.iter().map(|&node| norm(&forces[node])).fold(0.0, f64::max);
            // Rounding errors are proportional to the larger modulus, also for isochoric fields.
            let [two_mu, kappa] = unit_moduli(poisson_ratio);
            assert!(
                inside < 1e-12 * (1.0 + kappa / two_mu) * largest,
                "{name}, ν = {poisson_ratio}, {gradient}: {inside:e} of {largest:e}"
            );
            let density = energy_density(gradient, poisson_ratio);
            let volume = *volume_m3.get_or_insert(energy / density);
            assert!((energy / (density * volume) - 1.0).abs() < 1e-11, "{name}, ν = {poisson_ratio}: {energy:e}");
        }
        let spin = Matrix3::new(0.0, -1.0, 0.4, 1.0, 0.0, -0.3, -0.4, 0.3, 0.0);
        let (_, energy) = forces_and_energy(&assembly, mesh, spin, poisson_ratio);
        let scale = energy_density(Matrix3::identity(), poisson_ratio);
        assert!(energy.abs() < 1e-12 * scale, "{name}: a rotation costs {energy:e}");
    }
}

#[test]
fn distorted_hexahedra() {
    let (mesh, interior) = distorted_cube();
    assert_patch("27-node hexahedra", &mesh, &interior, Some(1.0));
}

#[test]
fn curved_quadratic_tetrahedra() {
    let (mut mesh, interior) = gmsh_body("quarter_sphere_tet10.msh");
    // The volume of curved elements is not known independently. The first field determines it, and
    // all other fields must agree.
    assert_patch("curved 10-node tetrahedra", &mesh, &interior, None);
    const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];
    let elements: Vec<Vec<u32>> = mesh.elements().map(<[u32]>::to_vec).collect();
    for nodes in elements {
        for (edge, [a, b]) in EDGES.into_iter().enumerate() {
            let [a, b] = [a, b].map(|k| Vector3::from(mesh.node_coordinates_m[nodes[k] as usize]));
            mesh.node_coordinates_m[nodes[4 + edge] as usize] = ((a + b) * 0.5).into();
        }
    }
    let volume_m3 = straight_volume(&mesh);
    assert_patch("straight 10-node tetrahedra", &mesh, &interior, Some(volume_m3));
}

#[test]
fn linear_tetrahedra() {
    let (mesh, interior) = gmsh_body("quarter_sphere_tet4.msh");
    let volume_m3 = straight_volume(&mesh);
    assert_patch("4-node tetrahedra", &mesh, &interior, Some(volume_m3));
}
