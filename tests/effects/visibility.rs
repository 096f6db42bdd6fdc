//! Detectability of effects against generalised least squares with dense matrices: covariances from the terms' definitions,
//! signatures by finite differences, the base absorbed by its normal equations.

use nalgebra::{DMatrix, DVector};
use vitreo_uq::base::distribution::Distribution;
use vitreo_uq::documents::effects::EffectsSummary;
use vitreo_uq::jobs::visibility;
use vitreo_uq::models::effects::Library;
use vitreo_uq::models::model::{Forward, SurrogateForward};
use vitreo_uq::posterior::fit;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::prepared::{KeptSurrogate, PreparedModel};
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica::embedded;
use vitreo_uq::posterior::study::ModelSpecification;

/// Priors narrow enough to count beside the data. The replica alone gives the parameters to about a per cent.
const PRIORS: &str = r#"
[young_modulus_pa]
distribution = "log_normal"
median = 3.5
log_sd = 0.01
unit = "Pa"
source = "a test"

[viscosity_1_pa_s]
distribution = "log_normal"
median = 1.4
log_sd = 0.02
unit = "Pa s"
source = "a test"

[viscosity_2_pa_s]
distribution = "log_normal"
median = 47.0
log_sd = 0.02
unit = "Pa s"
source = "a test"

[noise_sd_um]
distribution = "log_normal"
median = 5.0
log_sd = 1.0
unit = "um"
source = "a test"
"#;
const LOG_SD: [f64; 3] = [0.01, 0.02, 0.02];
/// Reference noise. It differs from the data's noise (4 µm), the residuals of the fit and the prior's median.
const NOISE_SD_M: f64 = 3e-6;
/// Tested quantiles of a free parameter's prior.
const GRID: [f64; 9] = [0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.98];
const AGREEMENT: f64 = 1e-7;

/// Deliberate mistakes in the reference, to show that the comparison would detect them.
#[derive(Clone, Copy, PartialEq)]
enum Variant {
    Right,
    NoPrior,
    PriorOfLogarithm,
    NothingAbsorbed,
    LeastOverGrid,
}

/// The calibrated base with dense matrices.
struct Reference {
    parameters: Vec<f64>,
    kept: Option<KeptSurrogate>,
    /// Factor of the covariance. Solving with it applies L⁻¹.
    factor: DMatrix<f64>,
    /// Whitened columns of the base.
    columns: DMatrix<f64>,
}

impl Reference {
    fn new(problem: &Problem, kept: Option<KeptSurrogate>) -> Self {
        let calibrated = fit::run(problem, kept, &SilentMonitor).expect("the fit succeeds");
        let kept = calibrated.model.to_keep().expect("hashable");
        let forward = calibrated.model.forward();
        let parameters = calibrated.model_parameters.clone();
        let position_m = forward.trajectory_m(&parameters).expect("inside the range");
        let factor = covariance_m2(problem, &position_m).cholesky().expect("positive definite").unpack();
        let column = |index: usize| {
            let step = 1e-4 * parameters[index];
            whitened(&factor, &central(&forward, &parameters, index, step))
        };
        let columns = DMatrix::from_columns(&(0..3).map(column).collect::<Vec<_>>());
        Self { parameters, kept, factor, columns }
    }

    /// Visible fraction and standard error of a signature (m per unit).
    fn seen(&self, signature_m: &[f64], variant: Variant) -> (f64, f64) {
        let (a, g) = (&self.columns, whitened(&self.factor, signature_m));
        let mut normal = a.transpose() * a;
        for (d, log_sd) in LOG_SD.into_iter().enumerate() {
            normal[(d, d)] += match variant {
                Variant::NoPrior => 0.0,
                Variant::PriorOfLogarithm => log_sd.powi(-2),
                _ => (log_sd * self.parameters[d]).powi(-2),
            };
        }
        let along = a.transpose() * &g;
        let absorbed = along.dot(&normal.cholesky().expect("positive definite").solve(&along));
        let left = g.norm_squared() - if variant == Variant::NothingAbsorbed { 0.0 } else { absorbed };
        let whole: f64 = signature_m.iter().map(|x| (x / NOISE_SD_M).powi(2)).sum();
        (left / whole, 1.0 / left.sqrt())
    }

    /// Visible fraction and standard error of an effect.
    fn effect(&self, problem: &Problem, slug: &str, variant: Variant) -> (f64, f64) {
        let mut specification = problem.specification.clone();
        specification.effects.push(slug.into());
        let extended = problem.with_model(specification, &Library::default()).expect("a model");
        let prepared =
            PreparedModel::unverified(&extended, self.kept.clone(), &SilentMonitor).expect("the surrogate is there");
        let forward = SurrogateForward { trained: &[], ..prepared.forward() };
        let at = |of_effect: &[f64]| [&self.parameters[..], of_effect].concat();
        let shares: Vec<(f64, f64)> = match slug {
            "tracking-drift" => vec![central(&forward, &at(&[0.0]), 3, 1e-6)],
            "force-asymmetry" => vec![central(&forward, &at(&[0.0]), 3, 1e-3)],
            _ => {
                // The trajectory is linear in the compliance, which may not be negative.
                let times = extended.priors.get("second-retardation.time_s").expect("a prior").distribution;
                let one_sided = |probability: &f64| {
                    let time_s = times.quantile(*probability);
                    let run = |ratio: f64| forward.trajectory_m(&at(&[ratio, time_s])).expect("a model");
                    difference(&run(0.01), &run(0.0), 0.01)
                };
                GRID.iter().map(one_sided).collect()
            }
        }
        .iter()
        .map(|signature_m| self.seen(signature_m, variant))
        .collect();
        let by_share = |a: &&(f64, f64), b: &&(f64, f64)| a.0.total_cmp(&b.0);
        let found = match variant {
            Variant::LeastOverGrid => shares.iter().min_by(by_share),
            _ => shares.iter().max_by(by_share),
        };
        *found.expect("there is a signature")
    }
}

fn difference(there_m: &[f64], here_m: &[f64], step: f64) -> Vec<f64> {
    there_m.iter().zip(here_m).map(|(there, here)| (there - here) / step).collect()
}

fn central(forward: &SurrogateForward, parameters: &[f64], index: usize, step: f64) -> Vec<f64> {
    let run = |sign: f64| {
        let mut stepped = parameters.to_vec();
        stepped[index] += sign * step;
        forward.trajectory_m(&stepped).expect("a model")
    };
    difference(&run(1.0), &run(-1.0), 2.0 * step)
}

/// Covariance (m²) of all rows from the definition of each noise term. Terms other than white noise are at their priors' medians.
fn covariance_m2(problem: &Problem, position_m: &[f64]) -> DMatrix<f64> {
    let record = &problem.experiment.record;
    let median = |name: &str| problem.priors.get(name).map_or(0.0, |prior| prior.distribution.quantile(0.5));
    let (ou_m2, offset_m2) = ((1e-6 * median("ou_sd_um")).powi(2), (1e-6 * median("offset_sd_um")).powi(2));
    let (ou_time_s, gain_2) = (median("ou_time_s"), median("gain_sd").powi(2));
    DMatrix::from_fn(record.n_rows(), record.n_rows(), |i, j| {
        let mut covariance_m2 = if i == j { NOISE_SD_M * NOISE_SD_M } else { 0.0 };
        if ou_m2 > 0.0 {
            covariance_m2 += ou_m2 * (-(record.time_s[i] - record.time_s[j]).abs() / ou_time_s).exp();
        }
        if record.cycle[i] == record.cycle[j] {
            covariance_m2 += gain_2 * position_m[i] * position_m[j] + offset_m2;
        }
        covariance_m2
    })
}

fn whitened(factor: &DMatrix<f64>, column_m: &[f64]) -> DVector<f64> {
    factor.solve_lower_triangular(&DVector::from_column_slice(column_m)).expect("regular")
}

/// The replica with another noise, and a prior from a file in a temporary folder.
fn problem(prior: &str) -> Problem {
    let (mut experiment, _) = embedded().expect("embedded");
    experiment.noise_sd_m = Some(NOISE_SD_M);
    let specification = ModelSpecification { prior: prior.into(), ..ModelSpecification::default() };
    Problem::new(experiment, specification, None, &SilentMonitor).expect("sound")
}

fn found_in(summary: &EffectsSummary, slug: &str) -> (f64, f64) {
    let entry = summary.effects.iter().find(|entry| entry.slug == slug).expect("in the library");
    (entry.visible_fraction.expect("it can be added"), entry.standard_error.expect("visible"))
}

/// Largest relative difference of fraction and error.
fn distance(found: (f64, f64), expected: (f64, f64)) -> f64 {
    (found.0 / expected.0 - 1.0).abs().max((found.1 / expected.1 - 1.0).abs())
}

#[test]
#[ignore = "thorough"]
fn visible_shares_and_errors_are_those_of_generalised_least_squares() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("narrow.toml");
    std::fs::write(&file, PRIORS).expect("writable");
    let white = problem(file.to_str().expect("plain"));
    let noise = ["white", "ou", "gain"].map(String::from).to_vec();
    let specification = ModelSpecification { noise, ..white.specification.clone() };
    let correlated = white.with_model(specification, &Library::default()).expect("a model");
    for (prior, log_sd) in white.priors.priors().iter().zip(LOG_SD) {
        assert!(matches!(prior.distribution, Distribution::LogNormal { log_sd: found, .. } if found == log_sd));
    }
    let mut kept = None;
    for problem in [&white, &correlated] {
        let reference = Reference::new(problem, kept.take());
        kept = reference.kept.clone();
        let summary = visibility::run(problem, &Library::default(), kept.clone(), &SilentMonitor).expect("it runs");
        assert!((summary.noise_um / 3.0 - 1.0).abs() < 1e-12, "{}", summary.noise_um);
        let slugs = ["tracking-drift", "force-asymmetry", "second-retardation"];
        let farthest = |variant: Variant| {
            let of_effect = |slug: &&str| distance(found_in(&summary, slug), reference.effect(problem, slug, variant));
            slugs.iter().map(of_effect).fold(0.0, f64::max)
        };
        for slug in slugs {
            let (found, expected) = (found_in(&summary, slug), reference.effect(problem, slug, Variant::Right));
            println!("{slug:<20} {:?} {found:?} against {expected:?}", problem.noise.names());
            assert!(distance(found, expected) < AGREEMENT, "{slug}: {found:?} against {expected:?}");
        }
        // The deliberate mistakes exceed the tolerance by far.
        for variant in [Variant::NoPrior, Variant::PriorOfLogarithm, Variant::NothingAbsorbed, Variant::LeastOverGrid] {
            assert!(farthest(variant) > 1e-3, "{}", farthest(variant));
        }
    }
}

/// Before any fit of the effect, the library states the movement by large displacements at the record's amplitude. It is 27 µm for the replica's bead, which goes 3.5 radii in its first pull, over a noise of 4 µm.
#[test]
#[ignore = "thorough"]
fn what_large_displacements_would_move_is_said() {
    let (experiment, _) = embedded().expect("the replica");
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("a problem");
    let summary = visibility::run(&problem, &Library::default(), None, &SilentMonitor).expect("it runs");
    let entry = summary.effects.iter().find(|entry| entry.slug == "large-displacement").expect("in the library");
    println!("{}", entry.summary);
    let number = |before: &str, after: &str| -> f64 {
        let from = entry.summary.find(before).expect(before) + before.len();
        let length = entry.summary[from..].find(after).expect(after);
        entry.summary[from..from + length].parse().expect("a number")
    };
    assert!((number(": at ", " radii") - 3.5).abs() < 0.15, "{}", entry.summary);
    assert!((number("up to ", " µm here") - 27.0).abs() < 1.5, "{}", entry.summary);
    assert!((number("here, ", " × the noise") - 27.0 / 4.0).abs() < 0.5, "{}", entry.summary);
}
