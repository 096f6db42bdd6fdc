//! Kinematics and forces against closed forms: homogeneous deformations, rotations, the energy.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::*;
use crate::fe::nonlinear::point::Tensor;
use crate::fe::nonlinear::points::IntegrationPoints;
use crate::mesh::QuarterBall;

const POISSON_RATIO: f64 = 0.48;

/// A ball's gel set free of robot, walls and symmetry; the two last nodes, of no element, stand for robot and wall.
fn body() -> (Mesh, Stiffness) {
    let ball = QuarterBall { robot_radius_m: 0.3, outer_radius_m: 1.0, n_per_edge: 1, n_layers: 2 };
    let mut mesh = ball.mesh().unwrap();
    let n = mesh.n_nodes() as u32;
    mesh.node_coordinates_m.extend([[9.0, 0.0, 0.0], [-9.0, 0.0, 0.0]]);
    (mesh.robot_nodes, mesh.outer_nodes) = (vec![n], vec![n + 1]);
    mesh.symmetry_y_nodes.clear();
    mesh.symmetry_z_nodes.clear();
    let stiffness = Stiffness::new(&mesh).unwrap();
    (mesh, stiffness)
}

fn points(mesh: &Mesh, stiffness: &Stiffness) -> IntegrationPoints {
    IntegrationPoints::new(mesh, &stiffness.assembly.unknowns, POISSON_RATIO).unwrap()
}

fn homogeneous(mesh: &Mesh, stiffness: &Stiffness, gradient: Matrix3<f64>) -> Vec<f64> {
    let unknowns = &stiffness.assembly.unknowns;
    let mut field = vec![0.0; unknowns.count()];
    for (node, place) in mesh.node_coordinates_m.iter().enumerate().take(mesh.n_nodes() - 2) {
        // Every unknown belongs to one node, so that adding places the value.
        unknowns.add_nodal_force(node, (gradient * Vector3::from(*place)).into(), &mut field);
    }
    field
}

/// Uniaxial stretch, simple shear and a general gradient: strain and stress in closed form at every point, and the work of the forces is the volume times P : δF.
#[test]
fn homogeneous_deformations_have_the_closed_form() {
    let (mesh, stiffness) = body();
    let points = points(&mesh, &stiffness);
    let volume: f64 = points.volumes_m3().iter().sum();
    let [mu, kappa] = [1.0 / (2.0 * (1.0 + POISSON_RATIO)), 1.0 / (3.0 * (1.0 - 2.0 * POISSON_RATIO))];
    let (stretch, shear) = (1.6_f64, 0.8);
    // P by hand. Stretch λ along x: E = diag(½(λ² − 1), 0, 0), deviator (⅔, −⅓, −⅓) of it, p = κ ln λ. Shear γ: E_xy = ½γ, E_yy = ½γ², p = 0.
    let e = 0.5 * (stretch * stretch - 1.0);
    let p = kappa * stretch.ln();
    let of_stretch = Matrix3::from_diagonal(&Vector3::new(
        stretch * 2.0 * mu * e * 2.0 / 3.0 + p / stretch,
        -2.0 * mu * e / 3.0 + p,
        -2.0 * mu * e / 3.0 + p,
    ));
    let (a, b) = (mu * shear, mu * shear * shear);
    // dev S = [[-b/3, a, 0], [a, 2b/3, 0], [0, 0, -b/3]], P = (I + γ e_x e_y) dev S.
    let of_shear =
        Matrix3::new(-b / 3.0 + shear * a, a + shear * 2.0 * b / 3.0, 0.0, a, 2.0 * b / 3.0, 0.0, 0.0, 0.0, -b / 3.0);
    for (gradient, nominal) in [
        (Matrix3::from_diagonal(&Vector3::new(stretch - 1.0, 0.0, 0.0)), of_stretch),
        (Matrix3::new(0.0, shear, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), of_shear),
    ] {
        let (deformation, strains) = Deformation::new(&points, &homogeneous(&mesh, &stiffness, gradient)).unwrap();
        let forces = deformation.forces(&points, &strains);
        for i in 0..9 {
            let mut direction = Matrix3::zeros();
            direction[i] = 1.0;
            let moved = homogeneous(&mesh, &stiffness, direction);
            let work: f64 = forces.iter().zip(&moved).map(|(f, u)| f * u).sum();
            let exact = volume * nominal[i];
            assert!((work - exact).abs() < 1e-11 * volume * kappa, "{i}: {work} {exact}");
        }
    }
}

/// A rigid rotation by any angle strains nothing, and a rotation on top of a deformation leaves its strains as they are.
#[test]
fn rotations_do_not_strain() {
    let (mesh, stiffness) = body();
    let points = points(&mesh, &stiffness);
    let strains_of = |f: Matrix3<f64>| {
        let field = homogeneous(&mesh, &stiffness, f - Matrix3::identity());
        Deformation::new(&points, &field).unwrap().1
    };
    let stretched = Matrix3::new(1.3, 0.2, -0.1, 0.0, 0.9, 0.3, 0.1, 0.0, 1.1);
    let before = strains_of(stretched);
    for turn in [Vector3::new(0.4, 0.0, 0.0), Vector3::new(1.0, -2.0, 0.5)] {
        let rotation = *Rotation3::new(turn).matrix();
        assert!(strains_of(rotation).iter().flatten().all(|e| e.abs() < 1e-12));
        let after = strains_of(rotation * stretched);
        assert!(before.iter().flatten().zip(after.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}

/// Forces of the elastic stress are the gradient of the energy ∫ μ̂ dev E : dev E + ½κ̂ (Π ln det F)², here of an uneven field.
#[test]
fn forces_are_the_gradient_of_the_energy() {
    let (mesh, stiffness) = body();
    let points = points(&mesh, &stiffness);
    let moduli = points.unit_moduli();
    let n = stiffness.assembly.unknowns.count();
    let even = homogeneous(&mesh, &stiffness, Matrix3::new(0.2, 0.3, 0.0, -0.1, -0.2, 0.1, 0.0, 0.2, 0.1));
    let field: Vec<f64> = even.iter().enumerate().map(|(i, u)| u + 0.01 * (1.3 * i as f64).sin()).collect();
    let direction: Vec<f64> = (0..n).map(|i| (0.9 * i as f64).cos()).collect();
    let energy = |h: f64| -> f64 {
        let moved: Vec<f64> = field.iter().zip(&direction).map(|(u, d)| u + h * d).collect();
        let (_, strains) = Deformation::new(&points, &moved).unwrap();
        let density = |e: &Tensor<f64>| -> f64 { e.iter().zip(&moduli).map(|(e, m)| 0.5 * m * e * e).sum() };
        strains.iter().zip(points.volumes_m3()).map(|(e, volume)| volume * density(e)).sum()
    };
    let (deformation, strains) = Deformation::new(&points, &field).unwrap();
    let forces = deformation.forces(&points, &strains);
    let exact: f64 = forces.iter().zip(&direction).map(|(f, d)| f * d).sum();
    let h = 1e-5;
    let found = (energy(h) - energy(-h)) / (2.0 * h);
    assert!((found / exact - 1.0).abs() < 1e-7, "{found} {exact}");
}
