//! Recovery of every effect from data by full finite elements on a finer mesh and finer steps than the fitted model's. Posteriors cover the
//! truth as often as stated, and the held-out error falls to the noise when the effect is added.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use vitreo_uq::elements::fe::Stiffness;
use vitreo_uq::elements::fe::stepping::Resolution;
use vitreo_uq::elements::fe::time::FullOrderModel;
use vitreo_uq::jobs::extend::{ExtensionRequest, prepare_comparison, refit};
use vitreo_uq::models::effects::{EFFECTS, Effect, Library};
use vitreo_uq::models::model::{Forward, FullOrderForward};
use vitreo_uq::posterior::mechanics::{MODEL_LEVEL, robot_mesh};
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::prepared::PreparedModel;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica::{TABLE_I, embedded};
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::{Apparatus, Experiment};
use vitreo_uq::sampling::ensemble::RunControl;
use vitreo_uq::sampling::{SamplerOptions, sample};

const NOISE_SD_M: f64 = 4e-6;
/// Prior of the law, from which truths are drawn: near Table I, so positions resemble an experiment's.
const PRIOR: &str = r#"
young_modulus_pa = { distribution = "log_normal", median = 3.527, log_sd = 0.3, unit = "Pa", source = "this test" }
viscosity_1_pa_s = { distribution = "log_normal", median = 1.402, log_sd = 0.3, unit = "Pa s", source = "this test" }
viscosity_2_pa_s = { distribution = "log_normal", median = 47.37, log_sd = 0.3, unit = "Pa s", source = "this test" }
noise_sd_um = { distribution = "log_normal", median = 4.0, log_sd = 1.5, unit = "um", source = "this test" }
"#;

/// The finer full-order model that makes the data.
fn finer_stiffness(experiment: &Experiment) -> Stiffness {
    let Apparatus::Robot { robot, vitreous } = &experiment.apparatus else { panic!("the replica has a robot") };
    Stiffness::new(&robot_mesh(robot, vitreous, MODEL_LEVEL + 1).expect("a sphere")).expect("a good mesh")
}

/// Effects that keep the displacement field's shape or change only the Poisson ratio. Runs of the others take a minute each. Their own tests compare them with closed
/// forms and with their reduced models.
fn by_factor() -> impl Iterator<Item = &'static dyn Effect> {
    EFFECTS.iter().copied().filter(|effect| effect.field().is_none())
}

fn problem_of(base: &Problem, effect: &dyn Effect) -> Problem {
    let specification = ModelSpecification { effects: vec![effect.slug().into()], ..base.specification.clone() };
    base.with_model(specification, &Library::default()).expect("an effect alone is a model")
}

/// Positions (m) by the finer model; `None` if the effect has no model.
fn finer_run(problem: &Problem, stiffness: &Stiffness, parameters: &[f64]) -> Option<Vec<f64>> {
    let (record, poisson_ratio) = (&problem.experiment.record, problem.model.scales().poisson_ratio.expect("a robot"));
    let at_ratio = FullOrderModel::new(stiffness, poisson_ratio).expect("positive definite");
    let full = FullOrderForward::new(&problem.model, stiffness, at_ratio, &record.time_s, &record.force_n);
    let finer = Resolution { steps_per_doubling: 2 * Resolution::default().steps_per_doubling };
    full.with_resolution(finer).trajectory_m(parameters).ok()
}

fn noisy(experiment: &Experiment, position_m: &[f64], rng: &mut ChaCha8Rng) -> Experiment {
    let mut made = experiment.clone();
    let noise = |x: &f64| -> f64 {
        let standard: f64 = StandardNormal.sample(rng);
        x + NOISE_SD_M * standard
    };
    made.record.position_m = position_m.iter().map(noise).map(Some).collect();
    made
}

/// Truth drawn from a model's priors until the effect has a model, with its positions (m).
fn truth_of(problem: &Problem, stiffness: &Stiffness, rng: &mut ChaCha8Rng) -> (Vec<f64>, Vec<f64>) {
    loop {
        let mut truth = problem.priors.draw(rng);
        truth.truncate(problem.model.parameters().len());
        if let Some(position_m) = finer_run(problem, stiffness, &truth) {
            return (truth, position_m);
        }
    }
}

/// Quantile of a sample.
fn quantile(sorted: &[f64], probability: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * probability).round() as usize]
}

/// Returns for each parameter of the effect if the central 50 % and 90 % intervals contain it.
fn covered(
    base: &Problem,
    effect: &dyn Effect,
    stiffness: &Stiffness,
    prepared: &PreparedModel,
    seed: u64,
) -> Vec<[bool; 2]> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let problem = problem_of(base, effect);
    let (truth, position_m) = truth_of(&problem, stiffness, &mut rng);
    let made = noisy(&base.experiment, &position_m, &mut rng);
    // The priors keep the scales of the replica, from which the truth was drawn.
    let problem = Problem { experiment: made.for_comparison(), ..problem };
    let prepared = prepared.for_problem(problem);
    let (problem, posterior) = (&prepared.problem, prepared.posterior());
    let starts: Vec<Vec<f64>> =
        (0..96).map(|_| problem.priors.to_unconstrained(&problem.priors.draw(&mut rng))).collect();
    let options = SamplerOptions { seed, threads: 1, max_steps: 8_000, ..SamplerOptions::default() };
    let outcome = sample(&posterior, &starts, &options, &RunControl::default()).expect("sampling succeeds");
    if !outcome.converged {
        println!("{} {seed}: not converged", effect.slug());
    }
    let of_effect = TABLE_I.len()..problem.model.parameters().len();
    of_effect
        .map(|d| {
            let mut draws = outcome.draws.column(d).values;
            draws.iter_mut().for_each(|z| *z = problem.priors.priors()[d].distribution.from_unconstrained(*z));
            draws.sort_by(f64::total_cmp);
            let inside = |tail: f64| (quantile(&draws, tail)..=quantile(&draws, 1.0 - tail)).contains(&truth[d]);
            [inside(0.25), inside(0.05)]
        })
        .collect()
}

/// 20 replicates per effect: 90 % intervals cover each parameter at least 13 times. All intervals together cover as stated, at 50 % and 90 %, within five standard deviations of a binomial count (false
/// failures below 2e-6). A correct interval covers fewer than 13 of 20 with a probability of 6e-5, for each of twelve parameters.
#[test]
#[ignore = "campaigns/long-tests"]
fn posteriors_cover_many_truths_as_often_as_they_say() {
    let (n_replicates, fewest_covered) = (20, 13);
    let (experiment, _) = embedded().expect("embedded");
    let stiffness = finer_stiffness(&experiment);
    let directory = tempfile::tempdir().expect("a temporary directory");
    let file = directory.path().join("prior.toml");
    std::fs::write(&file, PRIOR).expect("writable");
    let specification = ModelSpecification { prior: file.display().to_string(), ..ModelSpecification::default() };
    let base = Problem::new(experiment, specification, None, &SilentMonitor).expect("sound");
    let mut totals = [0_usize; 3];
    for (number, effect) in (0_u64..).zip(by_factor()) {
        let problem = problem_of(&base, effect);
        let problem = Problem { experiment: problem.experiment.for_comparison(), ..problem };
        let prepared = PreparedModel::new(&problem, None, &SilentMonitor).expect("training succeeds");
        let seeds = (0..n_replicates).map(|k| 1000 * number + k).collect::<Vec<u64>>();
        let found: Vec<Vec<[bool; 2]>> =
            seeds.par_iter().map(|seed| covered(&base, effect, &stiffness, &prepared, *seed)).collect();
        for (index, parameter) in effect.parameters().iter().enumerate() {
            let count = |which: usize| found.iter().filter(|replicate| replicate[index][which]).count();
            let (half, nine_tenths) = (count(0), count(1));
            let error = prepared.max_relative_error.expect("there are finite elements");
            println!(
                "{:<42} covered {half:>2} at 50 %, {nine_tenths:>2} at 90 % of {n_replicates}; reduced against full {error:.0e}",
                parameter.spec.name
            );
            assert!(nine_tenths >= fewest_covered, "{}: {nine_tenths}", parameter.spec.name);
            totals = [totals[0] + half, totals[1] + nine_tenths, totals[2] + n_replicates as usize];
        }
    }
    let [half, nine_tenths, all] = totals;
    println!("all: {half} at 50 %, {nine_tenths} at 90 % of {all}");
    for (count, probability) in [(half, 0.5), (nine_tenths, 0.9)] {
        let (mean, sd) = (probability * all as f64, (probability * (1.0 - probability) * all as f64).sqrt());
        assert!((count as f64 - mean).abs() < 5.0 * sd, "{count} of {all} at {probability}");
    }
}

/// Data with an effect that the base model lacks: the base misses the held-out cycle, and the extended model's error is the noise.
/// 200 positions have a root mean square noise within 25 % of 4 µm, except once in 10⁶. Soundness includes a joint check at 0.1 % per
/// effect: one failure in a hundred for other seeds than these.
fn assert_error_falls(is_asked: fn(&dyn Effect) -> bool) {
    let (experiment, _) = embedded().expect("embedded");
    let stiffness = finer_stiffness(&experiment);
    let base = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("sound");
    for (number, effect) in (0_u64..).zip(by_factor()).filter(|(_, effect)| is_asked(*effect)) {
        let problem = problem_of(&base, effect);
        // A value well inside the prior, away from the null.
        let value = |p: &vitreo_uq::models::effects::EffectParameter| {
            let (low, high) =
                ((p.prior)(problem.model.scales()).quantile(0.2), (p.prior)(problem.model.scales()).quantile(0.8));
            let null = (p.null)(problem.model.scales());
            if null.is_some_and(|null| (null - high).abs() < (null - low).abs()) { low } else { high }
        };
        let truth: Vec<f64> = TABLE_I.into_iter().chain(effect.parameters().iter().map(value)).collect();
        let position_m = finer_run(&problem, &stiffness, &truth).expect("a model");
        let mut rng = ChaCha8Rng::seed_from_u64(70 + number);
        let made = noisy(&base.experiment, &position_m, &mut rng);
        let library = Library::default();
        let lacking = base.with_experiment(made, ModelSpecification::default(), &library).expect("the base is a model");
        let effects = [effect.slug().to_string()];
        let request = ExtensionRequest { effects: &effects, ..ExtensionRequest::default() };
        let pair = prepare_comparison(&lacking, &request, &library).expect("an effect alone is a model");
        let summary = refit(pair, &request, &SilentMonitor).expect("extending succeeds").summary;
        let (before, after) =
            (summary.before.rmse_heldout_um.expect("scored"), summary.after.rmse_heldout_um.expect("scored"));
        println!("{:<26} held-out error {before:.2} → {after:.2} µm (noise 4)", effect.slug());
        assert!(after < 5.0, "{}: {after}", effect.slug());
        assert!(summary.is_sound(), "{}: {:?}", effect.slug(), summary.warnings);
        // In a single-site creep test the Poisson ratio only rescales E, c₁ and c₂ (physics §5).
        let hides_in_the_law = effect.changes_field();
        assert!(hides_in_the_law || before > 1.5 * 4.0, "{}: {before}", effect.slug());
    }
}

/// A softening gel. tests/commands/effects_extend.rs tests the command with a drift.
#[test]
#[ignore = "thorough"]
fn extending_by_the_right_effect_brings_the_heldout_error_to_the_noise() {
    assert_error_falls(|effect| effect.slug() == "softening");
}

#[test]
#[ignore = "campaigns/long-tests"]
fn extending_by_any_right_effect_brings_the_heldout_error_to_the_noise() {
    assert_error_falls(|_| true);
}
