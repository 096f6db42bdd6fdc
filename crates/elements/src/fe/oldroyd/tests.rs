//! Tests of large displacements against closed forms, a value from an independent program, and
//! finer meshes and steps.

use super::*;
use base::number::Dual;
use laws::rheology::{BaseLaw, CreepCompliance};
use laws::stages::Stages;
use record::ForceRule;

pub(super) const RADIUS_M: f64 = 0.275e-3;
pub(super) const OUTER_M: f64 = 10e-3;
pub(super) const FORCE_N: f64 = 4.6e-6;
pub(super) const LAW: [f64; 3] = [3.527, 1.402, 47.370];
pub(super) const HOLD_S: f64 = 5.0;
pub(super) const ROWS_A_HOLD: usize = 20;

pub(super) fn coarse() -> Discretisation {
    Discretisation { order: 4, n_angles: 4, steps_per_doubling: 3, ..Discretisation::default() }
}

/// Times (s) and forces of holds in alternating directions, with a row at the start of each hold.
/// The forces are `share` times the reference force.
pub(super) fn record(share: f64, n_holds: usize) -> (Vec<f64>, Vec<f64>) {
    let rows = 0..=ROWS_A_HOLD * n_holds;
    let time_s = rows.clone().map(|row| HOLD_S * row as f64 / ROWS_A_HOLD as f64).collect();
    let sign = |row: usize| if (row / ROWS_A_HOLD).is_multiple_of(2) { 1.0 } else { -1.0 };
    (time_s, rows.map(|row| share * FORCE_N * sign(row)).collect())
}

fn run(fineness: Discretisation, mobility: f64, time_s: &[f64], force: Force) -> Result<FiniteResult> {
    run_law(BaseLaw::Lethersich, &LAW, fineness, mobility, time_s, force)
}

fn run_law(
    law: BaseLaw,
    parameters: &[f64],
    fineness: Discretisation,
    mobility: f64,
    time_s: &[f64],
    force: Force,
) -> Result<FiniteResult> {
    let elements = law.elements(&parameters.iter().copied().map(Dual::constant).collect::<Vec<Dual>>());
    let law = FiniteLaw::new(&elements, mobility).expect("no springpot");
    let load = Stages::of_law(Vec::new()).load;
    FiniteGel::around_sphere(RADIUS_M, OUTER_M, fineness)?.run(&FiniteInput { law: &law, load: &load, time_s, force })
}

pub(super) fn holds(fineness: Discretisation, mobility: f64, share: f64, n_holds: usize) -> FiniteResult {
    let (time_s, force_n) = record(share, n_holds);
    run(fineness, mobility, &time_s, Force::from(&force_n)).expect("the mesh carries it")
}

pub(super) fn farthest_apart_um(a: &FiniteResult, b: &FiniteResult) -> f64 {
    a.deviation_m.iter().zip(&b.deviation_m).fold(0.0, |most, (a, b)| most.max(1e6 * (a - b).abs()))
}

/// Stiffness (m) per shear modulus of a sphere in a concentric sphere (physics §4.2 at ν = ½).
fn stiffness_m() -> f64 {
    let l = RADIUS_M / OUTER_M;
    let wall = (1.0 - l.powi(5)) / (1.0 - 9.0 / 4.0 * l + 5.0 / 2.0 * l.powi(3) - 9.0 / 4.0 * l.powi(5) + l.powi(6));
    6.0 * std::f64::consts::PI * RADIUS_M * wall
}

#[test]
fn the_stiffness_is_stokes_drag() {
    for (fineness, bound) in [(coarse(), 1e-4), (Discretisation::default(), 1e-5)] {
        let found = FiniteGel::around_sphere(RADIUS_M, OUTER_M, fineness).expect("a mesh").stiffness_m();
        assert!((found / stiffness_m() - 1.0).abs() < bound, "{fineness:?}: {found} {}", stiffness_m());
    }
}

/// Checks the position at a hundredth of the force. It must be ∫J dF divided by the stiffness, to
/// 10⁻⁴ of the amplitude, for holds and for a piecewise linear force.
#[test]
#[ignore = "thorough"]
fn small_displacements_are_the_linear_models() {
    let j = CreepCompliance::lethersich(&LAW);
    let (time_s, force_n) = record(0.01, 2);
    let fine_steps = Discretisation { steps_per_doubling: 8, ..coarse() };
    let found = run(fine_steps, 0.0, &time_s, Force::from(&force_n)).expect("a run");
    let sinks = |t: f64| if t > HOLD_S { 2.0 * j.at(t - HOLD_S) } else { 0.0 };
    let exact_m = |t: f64| 0.01 * FORCE_N * (j.at(t) - sinks(t)) * 3.0 / stiffness_m();
    let check = |found: &FiniteResult, exact_m: &dyn Fn(f64) -> f64| {
        let amplitude_m = found.displacement_m.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        for (t, x) in time_s.iter().zip(&found.displacement_m) {
            assert!((x - exact_m(*t)).abs() < 1e-4 * amplitude_m, "{t} s: {x} {}", exact_m(*t));
        }
    };
    check(&found, &exact_m);
    // The force rises linearly from 0. The integral is therefore its slope times ∫₀ᵗ J(t') dt'.
    let slope = 0.01 * FORCE_N / HOLD_S;
    let line_n: Vec<f64> = time_s.iter().map(|t| slope * t).collect();
    let force = Force { at_rows_n: &line_n, rule: ForceRule::Linear };
    let [e, c1, c2] = LAW;
    let integral = |t: f64| t / e - c1 / (e * e) * -(-e * t / c1).exp_m1() + 0.5 * t * t / c2;
    check(&run(fine_steps, 0.0, &time_s, force).expect("a run"), &|t| slope * integral(t) * 3.0 / stiffness_m());
}

/// Checks that a small deviation varies with the third power of the force. The gel does not
/// distinguish the force's directions, so that the response is odd in the force.
#[test]
fn the_deviation_goes_with_the_third_power() {
    let deviation = |share: f64| holds(coarse(), 0.0, share, 1).deviation_m;
    let (small, large) = (deviation(0.05), deviation(0.1));
    let power = (large[ROWS_A_HOLD] / small[ROWS_A_HOLD]).log2();
    assert!((power - 3.0).abs() < 0.05, "{power}");
    for (there, back) in large.iter().zip(deviation(-0.1)) {
        assert!((there + back).abs() < 1e-6 * RADIUS_M, "{there} {back}");
    }
}

/// Checks the paper's first pull, of 3.6 radii, and the way back. An independent program that
/// solves the equations found a deviation of 27 µm (2.8 %) at the end of the first pull.
#[test]
#[ignore = "thorough"]
fn the_papers_pull_goes_27_um_farther() {
    let found = holds(Discretisation::default(), 0.0, 1.0, 2);
    let end_um = 1e6 * found.deviation_m[ROWS_A_HOLD];
    println!("{end_um:.3} µm at {:.1} µm; det F {:?}; {:?}", 1e6 * found.farthest_m, found.volume_ratios, found.cost);
    assert!((end_um - 27.0).abs() < 0.3, "{end_um}");
    assert!((found.farthest_m / RADIUS_M - 3.63).abs() < 0.01);
    let finer = Discretisation { order: 6, n_angles: 8, ..Discretisation::default() };
    let halved = Discretisation { steps_per_doubling: 12, ..Discretisation::default() };
    for (other, bound_um) in [(finer, 0.02), (halved, 0.1), (Discretisation::ESTIMATE, 0.3)] {
        let apart_um = farthest_apart_um(&found, &holds(other, 0.0, 1.0, 2));
        println!("{other:?}: {apart_um:.4} µm");
        assert!(apart_um < bound_um, "{other:?}: {apart_um}");
    }
}

/// Checks the paper's whole protocol of four cycles. A mesh with twice the unknowns and half the
/// steps must change the result by at most 0.1 µm.
#[test]
#[ignore = "campaigns/long-tests"]
fn the_papers_protocol_has_converged() {
    let found = holds(Discretisation::default(), 0.0, 1.0, 8);
    println!("det F {:?}", found.volume_ratios);
    let finer = Discretisation { order: 7, n_angles: 8, ..Discretisation::default() };
    let halved = Discretisation { steps_per_doubling: 12, ..Discretisation::default() };
    for (other, bound_um) in [(finer, 0.1), (halved, 0.1), (Discretisation::ESTIMATE, 0.3)] {
        let other_result = holds(other, 0.0, 1.0, 8);
        let apart_um = farthest_apart_um(&found, &other_result);
        println!("{other:?}: {apart_um:.3} µm, det F {:?}", other_result.volume_ratios);
        assert!(apart_um < bound_um, "{other:?}: {apart_um}");
    }
}

/// Checks that a mobility changes the response only to large strains. As it tends to 0, the
/// response becomes that of Oldroyd-B. At 0.1 the difference far exceeds any error.
#[test]
fn a_mobility_changes_large_strains_alone() {
    let [none, next_to_none, some] = [0.0, 1e-6, 0.1].map(|mobility| holds(coarse(), mobility, 1.0, 1));
    assert!(farthest_apart_um(&none, &next_to_none) < 0.01);
    assert!(farthest_apart_um(&none, &some) > 40.0);
    let [none, some] = [0.0, 0.1].map(|mobility| holds(coarse(), mobility, 0.01, 1));
    assert!(farthest_apart_um(&none, &some) < 1e-3);
}

/// Checks a spring in series, which responds instantly, so that the body jumps with the force. The
/// position minus the deviation must be the closed form's, on two meshes. A stiff spring must
/// change nothing.
#[test]
#[ignore = "thorough"]
fn a_spring_in_series_jumps_and_a_stiff_one_is_none() {
    let (time_s, force_n) = record(1.0, 2);
    let burgers = |spring_pa: f64, fineness: Discretisation| {
        let law = [&LAW[..], &[spring_pa]].concat();
        run_law(BaseLaw::Burgers, &law, fineness, 0.0, &time_s, Force::from(&force_n)).expect("a run")
    };
    let apart_um = farthest_apart_um(&holds(coarse(), 0.0, 1.0, 2), &burgers(1000.0, coarse()));
    assert!(apart_um < 0.5, "{apart_um}");
    let found = burgers(20.0, coarse());
    let creep = BaseLaw::Burgers.creep_compliance(&[LAW[0], LAW[1], LAW[2], 20.0]).expect("exponentials");
    let held = |t: f64| if t > 0.0 { creep.at(t) } else { 0.0 };
    for (k, t) in time_s.iter().enumerate() {
        let linear_m = FORCE_N * (held(*t) - 2.0 * held(t - HOLD_S)) * 3.0 / stiffness_m();
        let apart_m = found.displacement_m[k] - found.deviation_m[k] - linear_m;
        assert!(apart_m.abs() < 1e-3 * found.farthest_m, "{t} s: {apart_m}");
    }
    let apart_um = farthest_apart_um(&found, &burgers(20.0, Discretisation { order: 5, n_angles: 6, ..coarse() }));
    println!("{apart_um:.3} µm, {:.1} µm", 1e6 * found.farthest_m);
    assert!(apart_um < 0.5, "{apart_um}");
}

/// Checks that a pull too long for any mesh ends with an error that states the distance reached.
/// The rows before must equal those of a record that ends there.
#[test]
fn what_goes_too_far_is_refused() {
    let (time_s, force_n) = record(4.0, 1);
    let error = run(coarse(), 0.0, &time_s, Force::from(&force_n)).expect_err("14 radii").to_string();
    assert!(error.contains("of its radii") && error.contains("what to do"), "{error}");
    let gel = FiniteGel::around_sphere(RADIUS_M, OUTER_M, coarse()).expect("a mesh");
    let law = FiniteLaw::new(&BaseLaw::Lethersich.elements(&LAW.map(Dual::constant)), 0.0).expect("no springpot");
    let load = Stages::of_law(Vec::new()).load;
    let what = FiniteInput { law: &law, load: &load, time_s: &time_s, force: Force::from(&force_n) };
    let (found, stopped) = gel.run_until_failure(&what).expect("a load that is run");
    let n = found.displacement_m.len();
    assert_eq!(stopped.map(|error| error.to_string()), Some(error));
    assert!(n > 1 && n < time_s.len() && found.deviation_m.len() == n, "{n}");
    let shorter = FiniteInput { time_s: &time_s[..n], force: Force::from(&force_n[..n]), ..what };
    let whole = gel.run(&shorter).expect("a mesh that follows");
    let apart_m = (found.displacement_m[n - 1] - whole.displacement_m[n - 1]).abs();
    assert!(apart_m < 1e-3 * whole.farthest_m, "{apart_m} of {}", whole.farthest_m);
    let outside = FiniteGel::around_sphere(OUTER_M, RADIUS_M, coarse()).err().expect("refused").to_string();
    assert!(outside.contains("no mesh fits between") && outside.contains(&format!("{RADIUS_M} m")), "{outside}");
}
