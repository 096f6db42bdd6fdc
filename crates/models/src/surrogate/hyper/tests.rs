//! Tests that compare the surrogate with the full-order model at parameters, laws, records and loads that were not used for
//! training.

use super::*;
use crate::model::Response;
use elements::fe::Stiffness;
use elements::fe::meridional::NonlinearBall;
use elements::fe::nonlinear::{self, Discretisation, NonlinearOptions};
use elements::fe::spatial::{GelAndRobot, PhysicalProperties};
use elements::mesh::{Mesh, QuarterBall};
use laws::rheology::BaseLaw;
use laws::stages::{ReducedField, SharedStepper, YIELD_SMOOTHING};
use std::sync::OnceLock;

const FORCE_N: f64 = 4.6e-6;
const REFERENCE_STRESS_PA: f64 = 4.84;
/// Values of E (Pa), c₁ and c₂ (Pa s), then of the additional parameters of Burgers' law and of the two-element law.
const PORCINE: [f64; 5] = [3.527, 1.402, 47.370, 20.0, 2.5];
const FAMILIES: [NonlinearFamily; 3] =
    [NonlinearFamily::StrainStiffening, NonlinearFamily::ShearThinning, NonlinearFamily::YieldStress];
/// Parameter of each nonlinear family, in the middle of its prior.
const MIDDLE: [f64; 3] = [0.3, 0.6, 1.5];
const BALL: QuarterBall = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 1, n_layers: 4 };

fn surroundings() -> GelAndRobot<'static> {
    static PARTS: OnceLock<(Mesh, Stiffness)> = OnceLock::new();
    let (mesh, stiffness) = PARTS.get_or_init(|| {
        let mesh = BALL.mesh().expect("the sizes are good");
        let stiffness = Stiffness::new(&mesh).expect("the mesh is good");
        (mesh, stiffness)
    });
    let sizes = PhysicalProperties {
        gel_density_kg_m3: 1000.0,
        robot_mass_kg: 0.65e-6,
        robot_radius_m: BALL.robot_radius_m,
        outer_radius_m: BALL.outer_radius_m,
        ball: Some(BALL),
    };
    GelAndRobot { mesh, stiffness, poisson_ratio: 0.48, sizes }
}

/// Returns the full-order model with which surrogates are compared: much finer than that of the training.
fn full() -> &'static NonlinearBall {
    static GEL: OnceLock<NonlinearBall> = OnceLock::new();
    GEL.get_or_init(|| NonlinearBall::new(BALL.robot_radius_m, BALL.outer_radius_m, 0.48).expect("a gel"))
}

fn compliance_per_m() -> f64 {
    full().share() * full().unit_compliance_per_m()
}

/// Positions (m) of the full-order model at every row.
fn exact_m(stages: &Stages, time_s: &[f64], force_n: &[f64]) -> Vec<f64> {
    let record = (time_s, Force::from(force_n));
    let run = nonlinear::run_stages(full(), stages, record, &[], NonlinearOptions::default(), compliance_per_m());
    run.expect("a balance").displacement_m
}

fn trained(family: NonlinearFamily, verification_runs: u32) -> HyperModel {
    let settings = HyperSettings { verification_runs, ..HyperSettings::of(family) };
    build(&surroundings(), family, &settings, &|| ()).expect("training succeeds")
}

/// Returns the surrogate of a family, which all tests share.
fn model_of(which: usize) -> HyperModel {
    static MODELS: [OnceLock<HyperModel>; 3] = [const { OnceLock::new() }; 3];
    MODELS[which].get_or_init(|| trained(FAMILIES[which], 4)).clone()
}

fn nonlinearity(which: usize, value: Dual) -> Nonlinearity<Dual> {
    match FAMILIES[which] {
        NonlinearFamily::StrainStiffening => Nonlinearity::StrainStiffening { coefficient: value },
        NonlinearFamily::ShearThinning => {
            Nonlinearity::ShearThinning { index: value, reference_stress_pa: REFERENCE_STRESS_PA.into() }
        }
        NonlinearFamily::YieldStress => Nonlinearity::YieldStress { stress_pa: value, smoothing: YIELD_SMOOTHING },
    }
}

fn stages(which: usize, base: BaseLaw, parameters: &[Dual], value: Dual) -> Stages {
    let mut stages = Stages::of_law(base.elements(&parameters[..base.parameters().len()]));
    stages.spatial = Some(Spatial::Nonlinear(nonlinearity(which, value)));
    stages.spread = Some(ReducedField::Stepped(SharedStepper(Arc::new(model_of(which)))));
    stages
}

/// Returns times (s) and commands (N) as in the porcine replica, with holds of 5 s and 20 rows per second.
fn record(n_rows: usize) -> (Vec<f64>, Vec<f64>) {
    let force = |i: usize| if (i / 100_usize).is_multiple_of(2) { FORCE_N } else { -FORCE_N };
    ((0..n_rows).map(|i| 0.05 * i as f64).collect(), (0..n_rows).map(force).collect())
}

fn largest_distance(found: &[f64], exact: &[f64]) -> f64 {
    let amplitude = exact.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    found.iter().zip(exact).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / amplitude
}

/// Checks that the verification error is below a thousandth of the amplitude at parameters outside the training set.
#[test]
fn a_few_modes_and_points_are_right_to_a_thousandth() {
    for (which, family) in FAMILIES.into_iter().enumerate() {
        let model = model_of(which);
        let reduced = model.reduced();
        println!("{family:?}: {} points, error {:.1e}", model.n_points(), reduced.max_relative_error);
        assert!(model.n_points() <= 64, "{family:?}: {}", model.n_points());
        // The error is already reached with fewer points than the cubature's tolerance requires.
        assert!(reduced.weights_m3.iter().all(|w| *w > 0.0) && reduced.cubature_residual < 1e-3, "{family:?}");
        assert!(reduced.singular_values[N_MODES] < 0.02, "{family:?}: {:?}", &reduced.singular_values[..8]);
        let error = reduced.max_relative_error;
        assert!(error < 1e-3 && error > 1e-6, "{family:?}: {error:e}");
    }
}

/// Checks every base law with a record and a load that were not used for training. The record has rests and smaller forces, and
/// the load has every load effect.
#[test]
#[ignore = "thorough"]
fn other_laws_records_and_loads_are_right() {
    let time_s: Vec<f64> = (0..16).map(|i| 2.0 + 0.4 * f64::from(i)).collect();
    let force_n: Vec<f64> = (0..16).map(|i| [1.0, -0.8, 0.0, 0.5][i / 4] * FORCE_N).collect();
    let response = Response::new(&time_s, &force_n, time_s.len());
    for (which, base) in [(0, BaseLaw::Burgers), (1, BaseLaw::Lethersich), (2, BaseLaw::TwoElement)] {
        let mut stages = stages(which, base, &PORCINE.map(Dual::constant), MIDDLE[which].into());
        stages.load.delay_s = 0.013.into();
        stages.load.positive_factor = 1.05.into();
        stages.load.offset_n = (0.03 * FORCE_N).into();
        stages.load.lag_time_s = 0.1.into();
        stages.load.gradient_per_m = 200.0.into();
        stages.observation.velocity_m_per_s = 1e-6.into();
        let exact = exact_m(&stages, &time_s, &force_n);
        let found = response.trajectory_m(&stages, compliance_per_m()).unwrap();
        let error = largest_distance(&found, &exact);
        stages.spatial = None;
        stages.spread = None;
        let linear = largest_distance(&response.trajectory_m(&stages, compliance_per_m()).unwrap(), &exact);
        println!("{:?} on {}: error {error:.1e}, excess {linear:.1e}", FAMILIES[which], base.name());
        assert!(error < 1e-3 && linear > 20.0 * error, "{which}: {error:e} of {linear:e}");
    }
}

/// Checks a fiftieth of the middle parameter. There the excess over the linear law is small, and the error must be small relative to this
/// excess.
#[test]
fn small_effects_are_right_beside_themselves() {
    let (time_s, force_n) = record(120);
    let rows = (0..time_s.len()).step_by(5);
    let (time_s, force_n): (Vec<f64>, Vec<f64>) = rows.map(|row| (time_s[row], force_n[row])).unzip();
    for (which, null) in [(0, 0.0), (1, 1.0), (2, 0.0)] {
        let value = null + 0.02 * (MIDDLE[which] - null);
        let at = |value: f64| stages(which, BaseLaw::Lethersich, &PORCINE.map(Dual::constant), value.into());
        let [exact, linear] = [value, null].map(|value| exact_m(&at(value), &time_s, &force_n));
        let excess: Vec<f64> = exact.iter().zip(&linear).map(|(x, l)| x - l).collect();
        let found = model_of(which).excess_m(&at(value), compliance_per_m(), &time_s, (&force_n).into()).unwrap();
        let error = largest_distance(&found, &excess);
        println!(
            "{:?}: excess {:.1e} of the amplitude, error {error:.1e} of the excess",
            FAMILIES[which],
            largest_distance(&exact, &linear)
        );
        assert!(error < 0.04, "{which}: {error:e}");
    }
}

/// Checks that the excess over the linear law is proportional to the parameter if the law is nearly linear. Errors of modes and steps then
/// vanish with the parameter.
#[test]
fn the_excess_vanishes_with_the_nonlinearity() {
    let (time_s, force_n) = record(220);
    for (which, null) in [(0, 0.0), (1, 1.0), (2, 0.0)] {
        let away = |share: f64| null + share * (MIDDLE[which] - null);
        let excess = |share: f64| {
            let stages = stages(which, BaseLaw::Lethersich, &PORCINE.map(Dual::constant), away(share).into());
            model_of(which).excess_m(&stages, compliance_per_m(), &time_s, (&force_n).into()).unwrap()
        };
        let largest = |x: &[f64]| x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        // At the null the excess is the rounding error of displacements of a millimetre.
        assert!(largest(&excess(0.0)) < 1e-13, "{which}: {:e}", largest(&excess(0.0)));
        let (near, nearer) = (excess(1e-5), excess(5e-6));
        let twice: Vec<f64> = nearer.iter().map(|x| 2.0 * x).collect();
        assert!(largest(&near) > 1e-10 && largest_distance(&near, &twice) < 1e-3, "{which}");
    }
}

/// Compares derivatives by every parameter, including those of the load, with central differences.
#[test]
fn sensitivities_are_finite_differences() {
    let (time_s, force_n) = record(180);
    let response = Response::new(&time_s, &force_n, time_s.len());
    for (which, value) in MIDDLE.into_iter().enumerate() {
        for direction in 0..9 {
            let with = |by: Dual| {
                let share = |i: usize| if i == direction { by } else { Dual::ZERO };
                let parameters: [Dual; 3] = std::array::from_fn(|i| (share(i) + 1.0) * PORCINE[i]);
                let mut stages = stages(which, BaseLaw::Lethersich, &parameters, (share(3) + 1.0) * value);
                stages.load.delay_s = share(4) * 0.1 + 0.012;
                stages.load.offset_n = (share(5) + 0.1) * FORCE_N;
                stages.load.lag_time_s = share(6) * 0.1 + 0.07;
                stages.load.gradient_per_m = share(7) * 100.0 + 50.0;
                stages.load.negative_factor = share(8) + 0.9;
                stages
            };
            let at = |by: f64| response.trajectory_m(&with(by.into()), compliance_per_m()).unwrap();
            let moving = with(Dual::variable(0.0));
            let found = response.derivative_m(&moving, compliance_per_m().into()).unwrap();
            let (up, down, middle) = (at(3e-5), at(-3e-5), at(0.0));
            let differences: Vec<f64> = up.iter().zip(&down).map(|(u, d)| (u - d) / 6e-5).collect();
            let derivatives: Vec<f64> = found.iter().map(|x| x.derivative).collect();
            let error = largest_distance(&derivatives, &differences);
            assert!(error < 4e-5, "{which} {direction}: {error:e}");
            let values: Vec<f64> = found.iter().map(|x| x.value).collect();
            assert!(largest_distance(&values, &middle) < 1e-6, "{which} {direction}");
        }
    }
}

/// Checks that eight parameter points at once have the bits of eight single points. A point without position must not affect the
/// others.
#[test]
#[ignore = "thorough"]
fn a_batch_gives_every_point_its_own_bits() {
    let (time_s, force_n) = record(120);
    let response = Response::new(&time_s, &force_n, time_s.len());
    let of_point = |i: usize| {
        let parameters = PORCINE.map(|p| Dual::constant(p * (1.0 + 0.1 * i as f64)));
        let mut stages = stages(i % 3, BaseLaw::Lethersich, &parameters, MIDDLE[i % 3].into());
        if i == 4 {
            stages.load.gradient_per_m = 1e5.into();
        }
        stages
    };
    let points: Vec<Stages> = (0..7).map(of_point).collect();
    let mut lanes = Vec::new();
    let is_valid = response.trajectories_m(&points, &[compliance_per_m(); 7], &mut lanes);
    assert_eq!(is_valid, [true, true, true, true, false, true, true, false]);
    for (lane, point) in points.iter().enumerate().filter(|(lane, _)| *lane != 4) {
        let alone = response.trajectory_m(point, compliance_per_m()).unwrap();
        assert!(alone.iter().zip(&lanes).all(|(x, row)| x.to_bits() == row.0[lane].to_bits()), "{lane}");
    }
    let refused = response.trajectory_m(&points[4], compliance_per_m()).unwrap_err().to_string();
    assert!(refused.contains("balance is not found"), "{refused}");
}

#[test]
fn a_surrogate_survives_the_disk_and_refuses_other_laws() {
    let one = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| trained(FAMILIES[2], 0))
    };
    let model = one(1);
    assert_eq!(model, one(2), "the same bytes for any number of threads");
    let text = serde_json::to_string(&model).unwrap();
    assert_eq!(serde_json::from_str::<HyperModel>(&text).unwrap(), model);
    let (time_s, force_n) = record(8);
    let other = stages(0, BaseLaw::Lethersich, &PORCINE.map(Dual::constant), 0.3.into());
    let message = model.excess_m(&other, 500.0, &time_s, (&force_n).into()).unwrap_err().to_string();
    assert!(message.contains("YieldStress") && message.contains("build the surrogate"), "{message}");
    let at_null = stages(2, BaseLaw::Lethersich, &PORCINE.map(Dual::constant), Dual::variable(0.0));
    let message = model.excess_dual_m(&at_null, 500.0, &time_s, (&force_n).into()).unwrap_err().to_string();
    assert!(message.contains("finite difference"), "{message}");
    let damaged = HyperReducedData { strains: Vec::new(), ..model.reduced().clone() };
    assert!(HyperModel::try_from(damaged.clone()).unwrap_err().to_string().contains("build it again"));
    let text = serde_json::to_string(&damaged).unwrap();
    assert!(serde_json::from_str::<HyperModel>(&text).is_err_and(|error| error.to_string().contains("build it again")));
}
