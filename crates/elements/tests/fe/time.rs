//! Tests of full-order time stepping against ∫J dF (physics §4.5). Results must be equal to the bit
//! for any number of threads.

use elements::fe::Stiffness;
use elements::fe::exact::SphereInContainer;
use elements::fe::time::{FullOrderModel, TimeScheme};
use elements::mesh::{Mesh, QuarterBall};
use laws::rheology::{CreepCompliance, RetardedMode};

const ROBOT_RADIUS_M: f64 = 0.275e-3;
const OUTER_RADIUS_M: f64 = 10e-3;
const POISSON_RATIO: f64 = 0.48;

fn mesh(n_per_edge: usize, n_layers: usize) -> Mesh {
    let ball = QuarterBall { robot_radius_m: ROBOT_RADIUS_M, outer_radius_m: OUTER_RADIUS_M, n_per_edge, n_layers };
    ball.mesh().expect("the radii are in order")
}

fn lethersich() -> CreepCompliance {
    CreepCompliance::lethersich(&[3.527, 1.402, 47.370])
}

/// A law of a spring, two Kelvin–Voigt bodies whose retardation times differ by a factor of a
/// hundred, and a dashpot.
fn rich_law() -> CreepCompliance {
    CreepCompliance {
        instantaneous_per_pa: 0.05,
        retarded: vec![
            RetardedMode { compliance_per_pa: 0.2835, time_s: 0.03 },
            RetardedMode { compliance_per_pa: 0.1, time_s: 3.0 },
        ],
        fluidity_per_pa_s: 0.0211,
    }
}

/// Irregular times (s), with a gap and rows 1 ms apart, and forces (N). The forces contain
/// switches, a ramp of small steps, zero holds, and a return to an earlier value.
fn irregular_load() -> (Vec<f64>, Vec<f64>) {
    let (mut time_s, mut force_n, mut t) = (Vec::new(), Vec::new(), 0.0);
    for row in 0..160_u32 {
        time_s.push(t);
        t += match row {
            70 => 2.5,
            _ if row % 13 == 5 => 0.001,
            _ => 0.02 + 0.015 * f64::from(row % 4),
        };
        force_n.push(match row {
            0..25 => 4.6e-6,
            25..40 => 0.0,
            40..75 => -4.6e-6,
            75..100 => 1e-7 * f64::from(row - 75),
            100..120 => 4.6e-6,
            120..121 => -9e-6,
            _ => 0.0,
        });
    }
    (time_s, force_n)
}

/// Superposition of force steps Σ ΔFₖ J(t − tₖ). It is the limit from the left, so that a force
/// step counts only after its own row.
fn superposition(compliance_per_m: f64, law: &CreepCompliance, time_s: &[f64], force_n: &[f64]) -> Vec<f64> {
    let position = |row: usize| -> f64 {
        let step =
            |k: usize| (force_n[k] - if k == 0 { 0.0 } else { force_n[k - 1] }) * law.at(time_s[row] - time_s[k]);
        (0..row).map(step).sum::<f64>() * compliance_per_m
    };
    (0..time_s.len()).map(position).collect()
}

/// Largest difference of two lists, divided by the largest value of `exact`.
pub fn distance(found: &[f64], exact: &[f64]) -> f64 {
    assert_eq!(found.len(), exact.len());
    let amplitude = exact.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    found.iter().zip(exact).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / amplitude
}

#[test]
fn exponential_steps_are_the_superposition_to_rounding() {
    let stiffness = Stiffness::new(&mesh(2, 6)).expect("a sound mesh");
    let model = FullOrderModel::new(&stiffness, POISSON_RATIO).expect("positive definite");
    let (time_s, force_n) = irregular_load();
    let load = model.solve_load(&time_s, &force_n);
    let exact_compliance_per_m =
        1.0 / SphereInContainer::new(POISSON_RATIO, ROBOT_RADIUS_M, OUTER_RADIUS_M).stiffness_n_per_m(1.0);
    let mesh_error = (model.compliance_per_m() / exact_compliance_per_m - 1.0).abs();
    assert!(mesh_error < 5e-4, "{mesh_error:e}");
    for law in [lethersich(), rich_law()] {
        let found = model.trajectory(&load, &law, TimeScheme::Exponential);
        let in_time = distance(&found, &superposition(model.compliance_per_m(), &law, &time_s, &force_n));
        assert!(in_time < 1e-12, "{in_time:e}");
        let in_all = distance(&found, &superposition(exact_compliance_per_m, &law, &time_s, &force_n));
        assert!(
            in_all < 1.01 * mesh_error && in_all > 0.5 * mesh_error,
            "{in_all:e} with a mesh error of {mesh_error:e}"
        );
    }
}

/// Checks that every unknown follows the superposition u(x, t) = U(x) q(t), like the robot's.
#[test]
fn fields_follow_the_superposition_too() {
    let stiffness = Stiffness::new(&mesh(1, 4)).expect("a sound mesh");
    let model = FullOrderModel::new(&stiffness, POISSON_RATIO).expect("positive definite");
    let (time_s, force_n) = irregular_load();
    let load = model.solve_load(&time_s, &force_n);
    let unit = stiffness.factor(POISSON_RATIO).expect("positive definite").unit_response();
    // q(t) in N/Pa on the quarter model is the superposition with a compliance of ¼.
    let q = superposition(0.25, &rich_law(), &time_s, &force_n);
    let rows = [1, 39, 76, 99, 121, 159];
    for (&row, field) in rows.iter().zip(model.fields(&load, &rich_law(), &rows)) {
        let exact: Vec<f64> = unit.iter().map(|u| u * q[row]).collect();
        assert!(distance(&field, &exact) < 1e-11, "row {row}: {:e}", distance(&field, &exact));
    }
}

/// Checks that the midpoint rule with n equal steps per hold converges to the exponential result at
/// second order.
#[test]
fn midpoint_rule_converges_at_second_order_to_the_exponential_result() {
    let stiffness = Stiffness::new(&mesh(1, 4)).expect("a sound mesh");
    let model = FullOrderModel::new(&stiffness, POISSON_RATIO).expect("positive definite");
    let error = |steps_per_second: u32| {
        let n = 4 * steps_per_second;
        let time_s: Vec<f64> = (0..=n).map(|row| f64::from(row) / f64::from(steps_per_second)).collect();
        let force = |row: u32| [4.6e-6, 0.0, -4.6e-6, 2e-6][(row / steps_per_second).min(3) as usize];
        let force_n: Vec<f64> = (0..=n).map(force).collect();
        let load = model.solve_load(&time_s, &force_n);
        let run = |scheme| model.trajectory(&load, &lethersich(), scheme);
        distance(&run(TimeScheme::Midpoint), &run(TimeScheme::Exponential))
    };
    let errors = [20, 40, 80, 160].map(error);
    for pair in errors.windows(2) {
        let slope = (pair[0] / pair[1]).log2();
        assert!((slope - 2.0).abs() < 0.1, "{slope}: {errors:?}");
    }
    assert!(errors[3] < 1e-5, "{errors:?}");
}

/// Checks all operations from the mesh to the trajectory. They run in pools of one and of two
/// threads, twice each, and must give equal bits.
#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let (time_s, force_n) = irregular_load();
    let run = |threads: usize| -> Vec<u64> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had");
        pool.install(|| {
            let stiffness = Stiffness::new(&mesh(3, 6)).expect("a sound mesh");
            let model = FullOrderModel::new(&stiffness, POISSON_RATIO).expect("positive definite");
            let load = model.solve_load(&time_s, &force_n);
            let trajectory = model.trajectory(&load, &rich_law(), TimeScheme::Exponential);
            let field = model.fields(&load, &rich_law(), &[99]);
            trajectory.iter().chain(field.iter().flatten()).map(|x| x.to_bits()).collect()
        })
    };
    let one = run(1);
    for threads in [1, 2, 2] {
        assert!(run(threads) == one, "{threads} threads");
    }
}
