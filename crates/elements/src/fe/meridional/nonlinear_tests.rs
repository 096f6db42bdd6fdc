use super::*;
use crate::fe::Stiffness;
use crate::fe::nonlinear::{NonlinearModel, NonlinearOptions, run_stages};
use crate::mesh::QuarterBall;
use base::number::Dual;
use laws::rheology::BaseLaw;
use laws::stages::{Nonlinearity, Spatial, Stages, YIELD_SMOOTHING};
use record::Force;

const RADIUS_M: f64 = 0.275e-3;
const OUTER_RADIUS_M: f64 = 10e-3;
const FORCE_N: f64 = 4.6e-6;
/// Force per area of a great circle, divided by 4, in Pa.
const REFERENCE_STRESS_PA: f64 = 4.84;

fn laws() -> [Nonlinearity<f64>; 3] {
    [
        Nonlinearity::StrainStiffening { coefficient: 2.5 },
        Nonlinearity::ShearThinning { index: 0.6, reference_stress_pa: REFERENCE_STRESS_PA },
        Nonlinearity::YieldStress { stress_pa: 0.3 * REFERENCE_STRESS_PA, smoothing: YIELD_SMOOTHING },
    ]
}

fn stages(law: Nonlinearity<f64>) -> Stages {
    let elements = BaseLaw::Lethersich.elements(&[3.527, 1.402, 47.370].map(Dual::constant));
    Stages { spatial: Some(Spatial::Nonlinear(law.constant())), ..Stages::of_law(elements) }
}

fn record() -> (Vec<f64>, Vec<f64>) {
    let time_s: Vec<f64> = (0..=40).map(|row| 0.25 * row as f64).collect();
    let force_n = time_s.iter().map(|t| if *t < 5.0 { FORCE_N } else { -FORCE_N }).collect();
    (time_s, force_n)
}

/// Positions (m) at every row.
fn positions_m(on: &dyn Discretisation, law: Nonlinearity<f64>, compliance_per_m: Option<f64>) -> Vec<f64> {
    let (time_s, force_n) = record();
    let compliance_per_m = compliance_per_m.unwrap_or_else(|| on.share() * on.unit_compliance_per_m());
    let record = (time_s.as_slice(), Force::from(&force_n));
    let run = run_stages(on, &stages(law), record, &[], NonlinearOptions::default(), compliance_per_m);
    run.expect("a balance").displacement_m
}

fn largest_distance(some: &[f64], others: &[f64]) -> f64 {
    let largest = others.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    some.iter().zip(others).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs())) / largest
}

/// Compares the elements with much finer ones, for every nonlinear law.
#[test]
fn finer_elements_give_the_same_motion() {
    let ball = NonlinearBall::new(RADIUS_M, OUTER_RADIUS_M, 0.48).expect("a gel");
    let finer = NonlinearBall::refined(RADIUS_M, OUTER_RADIUS_M, 0.48, 10, 1.35).expect("a gel");
    for law in laws() {
        let (found, exact) = (positions_m(&ball, law, None), positions_m(&finer, law, None));
        let error = largest_distance(&found, &exact);
        println!("{law:?} {error:.2e} {} {}", ball.n_unknowns(), ball.n_points());
        assert!(error < 1e-4, "{law:?}: {error:.2e}");
    }
}

/// Compares with the three-dimensional elements, which share neither mesh nor unknowns: the motion
/// beyond the linear law on the same three-dimensional mesh. Their own error falls with the mesh.
#[test]
fn three_dimensional_elements_approach_the_half_meridian() {
    let ball = NonlinearBall::new(RADIUS_M, OUTER_RADIUS_M, 0.48).expect("a gel");
    let distances = [(1, 4), (2, 8)].map(|(n_per_edge, n_layers)| {
        let quarter = QuarterBall { robot_radius_m: RADIUS_M, outer_radius_m: OUTER_RADIUS_M, n_per_edge, n_layers };
        let mesh = quarter.mesh().expect("the sizes are good");
        let stiffness = Stiffness::new(&mesh).expect("a mesh");
        let model = NonlinearModel::new(&mesh, &stiffness, 0.48).expect("positive definite");
        let compliance_per_m = model.share() * model.unit_compliance_per_m();
        laws().map(|law| {
            let (found, solid) = (positions_m(&ball, law, Some(compliance_per_m)), positions_m(&model, law, None));
            largest_distance(&found, &solid)
        })
    });
    println!("{distances:?}");
    let [coarse, fine] = distances;
    assert!(coarse.iter().zip(fine).all(|(coarse, fine)| fine < 0.5 * coarse && fine < 2e-3), "{distances:?}");
}

/// Around a sphere in a nearly incompressible gel, two hundred times larger, the displacements are
/// those of Stokes' closed form for an infinite medium, on both sides. The walls change them by 1 %.
#[test]
fn displacements_are_found_anywhere() {
    let ball = NonlinearBall::new(RADIUS_M, 200.0 * RADIUS_M, 0.499).expect("a gel");
    let mut field = vec![0.0; ball.n_unknowns()];
    field[ball.robot()] = 1.0;
    ball.solve_unit_stiffness(&mut field);
    let robot = field[ball.robot()];
    let points_m = [[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [200.0, 0.0, 0.0], [-1.5, 2.0, 1.0], [1.5, 2.0, 1.0]]
        .map(|point| point.map(|x: f64| x * RADIUS_M));
    let found = ball.displacements_at(&field, &points_m);
    for (point, expected) in [(0, 1.0), (1, 1.0), (2, 0.0)] {
        assert!((found[point][0] / robot - expected).abs() < 1e-6, "{found:?}");
        assert!(found[point][1].abs() + found[point][2].abs() < 1e-6 * robot, "{found:?}");
    }
    for k in [3, 4] {
        let [x, y, z] = points_m[k].map(|x| x / RADIUS_M);
        let r = (x * x + y * y + z * z).sqrt();
        // Stokes: u = 3/4 (e/r + x x/r³) + 1/4 (e/r³ − 3 x x/r⁵), for unit motion of the sphere.
        let (first, second) = (0.75 / r + 0.25 / r.powi(3), 0.75 / r.powi(3) - 0.75 / r.powi(5));
        let exact = [first + second * x * x, second * x * y, second * x * z];
        for (u, exact) in found[k].iter().zip(exact) {
            assert!((u / robot - exact).abs() < 0.02, "{found:?} {exact:?}");
        }
    }
}
