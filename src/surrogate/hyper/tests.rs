//! The surrogate against full finite elements at parameters that it was not trained with.

use super::*;
use crate::effects::Stages;
use crate::fe::Stiffness;
use crate::fe::nonlinear::{NonlinearModel, NonlinearRun, Options, YIELD_SMOOTHING};
use crate::mesh::{Mesh, QuarterBall};

const FORCE_N: f64 = 4.6e-6;
const REFERENCE_STRESS_PA: f64 = 4.84;
const PORCINE: [f64; 3] = [3.527, 1.402, 47.370];

const FAMILIES: [NonlinearFamily; 3] = [
    NonlinearFamily::StrainStiffening,
    NonlinearFamily::ShearThinning { reference_stress_pa: REFERENCE_STRESS_PA },
    NonlinearFamily::YieldStress { smoothing: YIELD_SMOOTHING },
];

/// One standard deviation of the porcine prior either way, a factor of 3.5, and the nonlinear parameter's whole range.
fn ranges(family: NonlinearFamily) -> Vec<TrainedRange> {
    let range = |name: &str, lower, upper| TrainedRange { name: name.into(), lower, upper };
    let factor = 1.25_f64.exp();
    let around = |name: &str, median: f64| range(name, median / factor, median * factor);
    let last = match family {
        NonlinearFamily::StrainStiffening => range("coefficient", 0.0, 1.0),
        NonlinearFamily::ShearThinning { .. } => range("index", 0.4, 1.0),
        NonlinearFamily::YieldStress { .. } => range("stress_pa", 0.0, REFERENCE_STRESS_PA),
    };
    vec![around("young_modulus_pa", 1.8), around("viscosity_1_pa_s", 1.3), around("viscosity_2_pa_s", 30.0), last]
}

/// Rows and commands of the porcine replica: eight holds of 5 s, 20 rows a second.
fn record() -> (Vec<f64>, Vec<f64>) {
    let force = |i: usize| if (i / 100_usize).is_multiple_of(2) { FORCE_N } else { -FORCE_N };
    ((0..800).map(|i| 0.05 * i as f64).collect(), (0..800).map(force).collect())
}

fn mesh() -> Mesh {
    let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 1, n_layers: 4 };
    ball.mesh().expect("the sizes are good")
}

fn trained(mesh: &Mesh, stiffness: &Stiffness, family: NonlinearFamily, verification_runs: u32) -> HyperReduced {
    let (time_s, force_n) = record();
    let training = HyperTraining {
        law: BaseLaw::Lethersich,
        family,
        ranges: &ranges(family),
        poisson_ratio: 0.48,
        time_s: &time_s,
        force_n: &force_n,
        n_modes: 6,
        cubature_tolerance: 3e-4,
        most_points: 48,
        training_runs: 16,
        verification_runs,
    };
    train(mesh, stiffness, &training).expect("training succeeds")
}

fn largest_distance(found: &[f64], exact: &[f64]) -> f64 {
    let amplitude = exact.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    found.iter().zip(exact).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / amplitude
}

/// Few modes and points, and errors below a thousandth of the amplitude at parameters outside the training set, by training's own comparison.
#[test]
fn a_few_modes_and_points_are_right_to_a_thousandth() {
    let mesh = mesh();
    let stiffness = Stiffness::new(&mesh).unwrap();
    for family in FAMILIES {
        let reduced = trained(&mesh, &stiffness, family, 4);
        assert!(reduced.n_modes == 6 && reduced.weights_m3.len() <= 48, "{family:?}: {}", reduced.weights_m3.len());
        assert!(reduced.weights_m3.iter().all(|w| *w > 0.0) && reduced.cubature_residual < 4e-4);
        assert!(reduced.singular_values[6] < 0.01, "{family:?}: {:?}", &reduced.singular_values[..8]);
        let error = reduced.max_relative_error;
        assert!(error < 1e-3 && error > 1e-6, "{family:?}: {error:e}");
    }
}

/// A record and a load that the surrogate was not trained on: rests, a smaller force, and every effect of the load, at the reference parameters.
#[test]
fn other_records_and_loads_are_right() {
    let mesh = mesh();
    let stiffness = Stiffness::new(&mesh).unwrap();
    let full = NonlinearModel::new(&mesh, &stiffness, 0.48).unwrap();
    let time_s: Vec<f64> = (0..16).map(|i| 2.0 + 0.4 * f64::from(i)).collect();
    let force_n: Vec<f64> = (0..16).map(|i| [1.0, -0.8, 0.0, 0.5][i / 4] * FORCE_N).collect();
    let mut load = Stages::of_law(Vec::new()).load;
    load.delay_s = 0.013.into();
    load.positive_factor = 1.05.into();
    load.offset_n = (0.03 * FORCE_N).into();
    load.lag_time_s = 0.1.into();
    load.gradient_per_m = 200.0.into();
    let (family, value) = (FAMILIES[1], 0.6);
    let model = HyperModel::new(trained(&mesh, &stiffness, family, 0)).unwrap();
    let nonlinearity = Nonlinearity::ShearThinning { index: value, reference_stress_pa: REFERENCE_STRESS_PA };
    let what = NonlinearRun {
        law: BaseLaw::Lethersich,
        parameters: &PORCINE,
        nonlinearity,
        load: &load,
        time_s: &time_s,
        force_n: &force_n,
    };
    let exact = full.run(&what, &[], Options::default()).unwrap().displacement_m;
    let parameters = PORCINE.map(Dual::constant);
    let run = HyperRun {
        parameters: &parameters,
        nonlinearity: family.at(value.into()),
        load: &load,
        time_s: &time_s,
        force_n: &force_n,
    };
    let error = largest_distance(&model.run(&run).unwrap(), &exact);
    assert!(error < 1e-3, "{error:e}");
}

/// Derivatives in the direction of every parameter and of everything in the load, against central differences.
#[test]
fn sensitivities_are_finite_differences() {
    let mesh = mesh();
    let stiffness = Stiffness::new(&mesh).unwrap();
    let (time_s, force_n) = (record().0[..180].to_vec(), record().1[..180].to_vec());
    for (family, value) in FAMILIES.into_iter().zip([0.4, 0.6, 1.0]) {
        let model = HyperModel::new(trained(&mesh, &stiffness, family, 0)).unwrap();
        for which in 0..9 {
            let with = |by: Dual| {
                let share = |i: usize| if i == which { by } else { Dual::ZERO };
                let parameters: [Dual; 3] = std::array::from_fn(|i| (share(i) + 1.0) * PORCINE[i]);
                let mut load = Stages::of_law(Vec::new()).load;
                load.delay_s = share(4) * 0.1 + 0.012;
                load.offset_n = (share(5) + 0.1) * FORCE_N;
                load.lag_time_s = share(6) * 0.1 + 0.07;
                load.gradient_per_m = share(7) * 100.0 + 50.0;
                load.negative_factor = share(8) + 0.9;
                let nonlinearity = family.at((share(3) + 1.0) * value);
                (parameters, load, nonlinearity)
            };
            let at = |by: f64| {
                let (parameters, load, nonlinearity) = with(by.into());
                let what =
                    HyperRun { parameters: &parameters, nonlinearity, load: &load, time_s: &time_s, force_n: &force_n };
                model.run(&what).unwrap()
            };
            let (parameters, load, nonlinearity) = with(Dual::variable(0.0));
            let what =
                HyperRun { parameters: &parameters, nonlinearity, load: &load, time_s: &time_s, force_n: &force_n };
            let found = model.run_dual(&what).unwrap();
            let (up, down, middle) = (at(3e-5), at(-3e-5), at(0.0));
            let differences: Vec<f64> = up.iter().zip(&down).map(|(u, d)| (u - d) / 6e-5).collect();
            let derivatives: Vec<f64> = found.iter().map(|x| x.derivative).collect();
            let error = largest_distance(&derivatives, &differences);
            assert!(error < 4e-5, "{family:?} {which}: {error:e}");
            let values: Vec<f64> = found.iter().map(|x| x.value).collect();
            assert!(largest_distance(&values, &middle) < 1e-6, "{family:?} {which}");
        }
    }
}

#[test]
fn a_surrogate_survives_the_disk_and_refuses_what_it_was_not_trained_for() {
    let mesh = mesh();
    let stiffness = Stiffness::new(&mesh).unwrap();
    let one = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| trained(&mesh, &stiffness, FAMILIES[2], 0))
    };
    let reduced = one(1);
    assert_eq!(reduced, one(2), "the same bytes for any number of threads");
    let text = serde_json::to_string(&reduced).unwrap();
    assert_eq!(serde_json::from_str::<HyperReduced>(&text).unwrap(), reduced);
    let model = HyperModel::new(reduced.clone()).unwrap();
    let (time_s, force_n) = record();
    let load = Stages::of_law(Vec::new()).load;
    let asked = |modulus_pa: f64, nonlinearity: Nonlinearity<Dual>| {
        let parameters = [modulus_pa, PORCINE[1], PORCINE[2]].map(Dual::constant);
        let what = HyperRun { parameters: &parameters, nonlinearity, load: &load, time_s: &time_s, force_n: &force_n };
        model.run(&what)
    };
    assert!(asked(PORCINE[0], FAMILIES[2].at(1.0.into())).is_ok());
    assert!(matches!(asked(100.0, FAMILIES[2].at(1.0.into())), Err(Error::OutsideTrainedRange { .. })));
    assert!(matches!(asked(PORCINE[0], FAMILIES[2].at(5.0.into())), Err(Error::OutsideTrainedRange { .. })));
    assert!(asked(PORCINE[0], FAMILIES[0].at(0.5.into())).unwrap_err().to_string().contains("train a surrogate"));
    let damaged = HyperReduced { strains: Vec::new(), ..reduced };
    assert!(HyperModel::new(damaged).unwrap_err().to_string().contains("build it again"));
}
