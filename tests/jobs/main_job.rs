//! The main job on the embedded replica, whose data come from a finer mesh, a finer time step and another integrator.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use vitreo_uq::base::number::Dual;
use vitreo_uq::elements::fe::oldroyd::{Discretisation, FiniteGel, FiniteInput, FiniteLaw};
use vitreo_uq::laws::rheology::BaseLaw;
use vitreo_uq::models::effects::Stages;
use vitreo_uq::models::model::Compliance;
use vitreo_uq::posterior::full_check;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::prepared::PreparedModel;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica;
use vitreo_uq::posterior::sample::{SampleRequest, SampleResult, run};
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::sampling::SamplerOptions;

fn main_job() -> (Problem, SampleResult) {
    let (experiment, _) = replica::embedded().unwrap();
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).unwrap();
    let request = SampleRequest {
        options: SamplerOptions { seed: 1, ..SamplerOptions::default() },
        kept_surrogate: None,
        checkpoint: None,
        resume: false,
    };
    let result = run(&problem, &request, &SilentMonitor).unwrap();
    (problem, result)
}

/// Squared Mahalanobis distance of Table I from the posterior of (ln E, ln c₁, ln c₂).
fn distance_from_table_1(result: &SampleResult) -> f64 {
    let columns: Vec<Vec<f64>> =
        result.columns[..3].iter().map(|c| c.values.iter().map(|v| v.ln()).collect()).collect();
    let n = columns[0].len() as f64;
    let mean = Vector3::from_fn(|i, _| columns[i].iter().sum::<f64>() / n);
    let covariance = Matrix3::from_fn(|i, j| {
        columns[i].iter().zip(&columns[j]).map(|(a, b)| (a - mean[i]) * (b - mean[j])).sum::<f64>() / n
    });
    let offset = Vector3::from_fn(|i, _| replica::TABLE_I[i].ln()) - mean;
    (offset.transpose() * covariance.try_inverse().unwrap() * offset)[0]
}

/// The data are fixed, so the test is deterministic. With other data the 99 % region would miss Table I once in a hundred.
#[test]
fn replica_gives_table_1_back_and_predicts_what_it_has_not_seen() {
    let (problem, result) = main_job();
    let summary = &result.summary;
    assert!(summary.converged, "{:?}", summary.warnings);
    assert!(summary.is_sound(), "{:?}", summary.warnings);
    let limit = ChiSquared::new(3.0).unwrap().inverse_cdf(0.99);
    assert!(distance_from_table_1(&result) < limit, "{} ≥ {limit}", distance_from_table_1(&result));

    let heldout = &summary.heldout;
    assert_eq!(heldout.cycles, [2, 3, 4]);
    assert!(heldout.fe_runs >= Some(64));
    let within = |value: Option<f64>, range: Option<[f64; 2]>| {
        let (value, [lower, upper]) = (value.unwrap(), range.unwrap());
        assert!(lower < upper && (lower..=upper).contains(&value), "{value} outside [{lower}, {upper}]");
    };
    within(heldout.coverage_50, heldout.coverage_50_expected);
    within(heldout.coverage_90, heldout.coverage_90_expected);
    assert!(heldout.joint_p.unwrap() > 0.001);
    // 600 positions of 4 µm noise: the RMSE's standard error is 2.9 %, and six of them are allowed.
    assert!((heldout.rmse_um.unwrap() / 4.0 - 1.0).abs() < 0.18, "{heldout:?}");
    // The expected score of a correct Gaussian prediction is σ/√π.
    assert!((heldout.crps_um.unwrap() / (4.0 / std::f64::consts::PI.sqrt()) - 1.0).abs() < 0.2, "{heldout:?}");

    // The reduced model is exact and reports this.
    assert_eq!(summary.surrogate.modes, Some(1));
    assert!(summary.surrogate.max_relative_error.unwrap() < 1e-10);
    assert!(heldout.surrogate_vs_fe_max_um.unwrap() < 1e-6);
    assert!(heldout.pareto_k.unwrap() < 0.7);
    // The mesh is not exact: two meshes differ by less than a tenth of the noise, but by more than rounding.
    let mesh_um = summary.error_budget_um.fe_discretisation.unwrap();
    assert!(mesh_um > 1e-3 && mesh_um < 0.4, "{mesh_um}");
    for parameter in &summary.parameters {
        assert!(parameter.rhat < 1.01 && parameter.ess_bulk > 1000.0 && parameter.ess_tail > 1000.0, "{parameter:?}");
        assert!(parameter.surrogate_bias_sd.unwrap().abs() < 1e-3, "{parameter:?}");
    }
    // Strains of order one (physics §6), far beyond the linear range, are reported.
    assert!(summary.largest_strain.unwrap() > 0.5 && summary.largest_strain.unwrap() < 5.0);
    let kinds: Vec<String> = summary.warnings.iter().map(|w| format!("{:?}", w.kind)).collect();
    assert_eq!(kinds, ["LargeStrain", "LargeDisplacement"]);
    // The data have small strains. An independent program gives the deviation by large ones: 27 µm at the end of the first pull.
    let large = summary.large_displacement.as_ref().unwrap();
    assert!((large.farthest_radii - 3.5).abs() < 0.1, "{large:?}");
    assert!((large.deviation_most_um.unwrap() - 27.0).abs() < 1.0, "{large:?}");
    assert_eq!(problem.experiment.heldout_cycles, [2, 3, 4]);
}

/// A drift of 3 µm/s that the base model lacks is added to the data. The fit may hide it in its noise and parameters, but the output
/// must not call the result sound.
#[test]
fn a_missing_effect_is_not_called_sound() {
    let (mut experiment, _) = replica::embedded().unwrap();
    for (position, time_s) in experiment.record.position_m.iter_mut().zip(&experiment.record.time_s) {
        *position = position.map(|x| x + 3e-6 * time_s);
    }
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).unwrap();
    let request =
        SampleRequest { options: SamplerOptions::default(), kept_surrogate: None, checkpoint: None, resume: false };
    let summary = run(&problem, &request, &SilentMonitor).unwrap().summary;
    assert!(summary.converged && !summary.is_sound(), "{:?}", summary.warnings);
    assert!(summary.heldout.joint_p.unwrap() < 0.001);
}

/// Positions in a wrong unit, 10⁴ times too small: the optimum lies outside the prior's mass. The run ends with a message, not a panic.
#[test]
fn a_posterior_at_the_end_of_the_prior_s_range_is_not_called_sound() {
    let (mut experiment, _) = replica::embedded().unwrap();
    experiment.record.position_m.iter_mut().for_each(|position| *position = position.map(|x| 1e-4 * x));
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).unwrap();
    let request = SampleRequest {
        options: SamplerOptions { max_steps: 4_000, ..SamplerOptions::default() },
        kept_surrogate: None,
        checkpoint: None,
        resume: false,
    };
    let summary = run(&problem, &request, &SilentMonitor).unwrap().summary;
    assert!(!summary.is_sound(), "{:?}", summary.warnings);
    assert!(summary.at_edge_of_range.iter().any(|name| name == "young_modulus_pa"), "{:?}", summary.at_edge_of_range);
}

/// A surrogate with a known error of 0.02 % in the compliance. The full finite-element check must find 0.02 % of the amplitude, and the
/// importance weights must move E, c₁ and c₂ back towards their true values.
#[test]
fn a_wrong_surrogate_is_measured_by_the_full_model() {
    const ERROR: f64 = 2e-4;
    let (experiment, _) = replica::embedded().unwrap();
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).unwrap();
    let prepared = PreparedModel::new(&problem, None, &SilentMonitor).unwrap();
    // Draws of a posterior of about the right width, around Table I.
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let draws: Vec<Vec<f64>> = (0..128)
        .map(|_| {
            vec![3.527 * (1.0 + 5e-4 * normal()), 1.402 * (1.0 + 2e-3 * normal()), 47.37 * (1.0 + 2e-3 * normal()), 4.0]
        })
        .collect();
    let exact = full_check::check(&prepared, &draws).unwrap();
    assert!(exact.surrogate_vs_full_max_m.unwrap() < 1e-12);
    assert_eq!(exact.pareto_k, Some(0.0));
    let compliance = Compliance::fixed(prepared.compliance.experiment_per_m() * (1.0 + ERROR));
    let prepared = PreparedModel::given(&problem, compliance, prepared.trained.clone());
    let wrong = full_check::check(&prepared, &draws).unwrap();
    let amplitude_m = wrong.trajectories_m.iter().flatten().fold(0.0_f64, |a, x| a.max(x.abs()));
    let ratio = wrong.surrogate_vs_full_max_m.unwrap() / (ERROR * amplitude_m);
    assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
    // The wrong, too compliant model favours stiffer draws; the weights favour softer ones.
    let weights = wrong.weights.unwrap();
    let shift: f64 = weights.iter().zip(&draws).map(|(w, draw)| (w - 1.0 / 128.0) * draw[0]).sum();
    assert!(shift < -0.1 * 5e-4 * 3.527, "{shift}");
    assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12 && wrong.pareto_k.unwrap() != 0.0);
    // Error of the mesh: two meshes against the exact solution. The finer one is ten times closer to it.
    let found = exact.discretisation_m.unwrap() / amplitude_m;
    assert!((found / 6.1e-5 - 1.0).abs() < 0.05, "{found}");
}

/// Data from the gel as an Oldroyd-B fluid on a finer mesh and finer steps, with 4 µm of noise. The fitted cycle gives biased E, c₁ and c₂, and the posterior states the bias. An independent program
/// found E = 3.497 and c₂ = 44.2 for 3.527 and 47.37 in one such cycle. The stated shifts are first order and use the estimated law, not the gel's: a quarter of them and four standard deviations of the posterior are allowed;
/// normal errors exceed that once in 5,000.
#[test]
#[ignore = "thorough"]
fn what_large_displacements_cost_is_said() {
    let (mut experiment, _) = replica::embedded().unwrap();
    let law = FiniteLaw::new(&BaseLaw::Lethersich.elements(&replica::TABLE_I.map(Dual::constant)), 0.0).unwrap();
    let gel = FiniteGel::around_sphere(0.275e-3, 10e-3, Discretisation::default()).unwrap();
    let load = Stages::of_law(Vec::new()).load;
    let record = &experiment.record;
    let n_rows = record.cycle.iter().filter(|cycle| **cycle == 1).count();
    let what =
        FiniteInput { law: &law, load: &load, time_s: &record.time_s[..n_rows], force: record.force().first(n_rows) };
    let deviation_m = gel.run(&what).unwrap().deviation_m;
    for (position, deviation_m) in experiment.record.position_m.iter_mut().zip(&deviation_m) {
        *position = position.map(|x| x + deviation_m);
    }
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).unwrap();
    let request =
        SampleRequest { options: SamplerOptions::default(), kept_surrogate: None, checkpoint: None, resume: false };
    let summary = run(&problem, &request, &SilentMonitor).unwrap().summary;
    let large = summary.large_displacement.as_ref().unwrap();
    for ((parameter, shift), exact) in summary.parameters.iter().zip(&large.shifts).zip(replica::TABLE_I) {
        assert_eq!(parameter.name, shift.name);
        let away = parameter.mean - exact;
        let said = shift.relative * parameter.mean;
        println!("{}: {:.4}, away {away:.4}, said {said:.4}, sd {:.4}", parameter.name, parameter.mean, parameter.sd);
        assert!((away - said).abs() < 0.25 * said.abs() + 4.0 * parameter.sd, "{shift:?} {parameter:?}");
    }
    // c₂ is off by far more than its error, so the stated shift is no accident.
    assert!(large.shifts[2].relative * summary.parameters[2].mean < -10.0 * summary.parameters[2].sd, "{large:?}");
}

/// A fixed parameter, and laws for which one cycle leaves some parameters open: shifts are stated only for free, determined parameters. They are below a tenth, the bound on the effect of large
/// displacements here.
#[test]
#[ignore = "thorough"]
fn shifts_are_of_parameters_that_are_free_and_known() {
    let held = BTreeMap::from([("viscosity_1_pa_s".to_owned(), replica::TABLE_I[1])]);
    let lethersich = ModelSpecification { fixed: held, ..ModelSpecification::default() };
    let of = |base: BaseLaw| ModelSpecification { base, ..ModelSpecification::default() };
    for specification in [lethersich, of(BaseLaw::Burgers), of(BaseLaw::TwoElement)] {
        let (experiment, _) = replica::embedded().unwrap();
        let is_plain = specification.base == BaseLaw::Lethersich;
        let problem = Problem::new(experiment, specification, None, &SilentMonitor).unwrap();
        let request =
            SampleRequest { options: SamplerOptions::default(), kept_surrogate: None, checkpoint: None, resume: false };
        let summary = run(&problem, &request, &SilentMonitor).unwrap().summary;
        let large = summary.large_displacement.as_ref().unwrap();
        println!("{large:?}");
        // The data allow a fast second body, which makes the gel's initial response less elastic: 23 µm.
        assert!((large.deviation_most_um.unwrap() - 27.0).abs() < 5.0, "{large:?}");
        for shift in &large.shifts {
            let parameter = summary.parameters.iter().find(|parameter| parameter.name == shift.name).unwrap();
            assert!(parameter.sd < 0.1 * parameter.mean && shift.relative.abs() < 0.15, "{shift:?} {parameter:?}");
        }
        if is_plain {
            let names: Vec<&str> = large.shifts.iter().map(|shift| shift.name.as_str()).collect();
            assert_eq!(names, ["young_modulus_pa", "viscosity_2_pa_s"]);
            assert!(large.shifts[1].standard_deviations < -10.0, "{large:?}");
        }
    }
}
