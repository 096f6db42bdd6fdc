//! Evidence of real candidates: the methods against each other, and the posterior against the ensemble sampler's.

use std::sync::OnceLock;

use crate::density_ratio::{SavageDickey, savage_dickey};

use vitreo_uq::criticism::evidence::{CandidatePosterior, EvidenceMethod, evidence};
use vitreo_uq::criticism::{Candidate, Fitted, Search, Subject};
use vitreo_uq::laws::rheology::{BaseLaw, Network};
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica::embedded;
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::Apparatus;
use vitreo_uq::sampling::diagnostics::ensembles::ess;
use vitreo_uq::sampling::ensemble::{RandomStream, RunControl};
use vitreo_uq::sampling::evidence::PriorCoordinates;
use vitreo_uq::sampling::evidence::importance::{self, ImportanceOptions};
use vitreo_uq::sampling::{SamplerOptions, sample};

/// The added drift (m/s) is about three posterior standard deviations, so draws still reach the null.
const DRIFT_M_PER_S: f64 = 1.5e-7;

/// The embedded replica with a small drift.
fn subject() -> &'static Subject {
    static SUBJECT: OnceLock<Subject> = OnceLock::new();
    SUBJECT.get_or_init(|| {
        let (mut experiment, _) = embedded().expect("embedded");
        let record = &mut experiment.record;
        for (position, time_s) in record.position_m.iter_mut().zip(&record.time_s) {
            *position = position.map(|x| x + DRIFT_M_PER_S * time_s);
        }
        let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("sound");
        Subject::new(&problem, &Library::default(), None, &SilentMonitor).expect("sound")
    })
}

fn base_fit() -> &'static (Candidate, Fitted) {
    static FIT: OnceLock<(Candidate, Fitted)> = OnceLock::new();
    FIT.get_or_init(|| {
        let base = subject().base();
        let fitted = subject().fit(&base, &[], Search::Wide).expect("fits");
        (base, fitted)
    })
}

fn extended_fit(slug: &str) -> (Candidate, Fitted) {
    let (base, fitted) = base_fit();
    let candidate = subject().extended(&[slug]).expect("can be added");
    let start = candidate.embed(base, &fitted.theta);
    let with = subject().fit(&candidate, &[(start, fitted.noise)], Search::Wide).expect("fits");
    (candidate, with)
}

type Value = (f64, f64);

fn by(method: EvidenceMethod, (candidate, fit): &(Candidate, Fitted)) -> Value {
    let posterior = CandidatePosterior::new(subject(), candidate).expect("sound");
    let modes = posterior.modes(candidate, fit).expect("finite");
    let found = match method {
        EvidenceMethod::ImportanceSampling => posterior.by_importance(&modes, 3),
        EvidenceMethod::SequentialMonteCarlo => posterior.by_tempering(&modes, 3),
    }
    .expect("can be sampled");
    (found.ln_evidence, found.standard_error)
}

/// Bayes factor of a candidate over the base from the posterior density at the null of the additional parameter.
fn at_null((candidate, fit): &(Candidate, Fitted)) -> SavageDickey {
    let base = &base_fit().0;
    let added =
        candidate.free.iter().find(|free| base.free.iter().all(|known| known.name != free.name)).expect("added");
    let null = added.coordinate.value(added.null.expect("has a null"));
    let posterior = CandidatePosterior::new(subject(), candidate).expect("sound");
    let modes = posterior.modes(candidate, fit).expect("finite");
    let estimate = posterior.by_importance(&modes, 4).expect("can be sampled");
    let d = posterior.priors().names().position(|name| name == added.name).expect("sampled");
    let density = posterior.density();
    let seen = PriorCoordinates::new(&density, posterior.priors().distributions());
    savage_dickey(
        &estimate.draws,
        |point| seen.natural(d, point[d]),
        null,
        &posterior.priors().priors()[d].distribution,
    )
}

/// Asserts that two values agree within 4 of their joint errors. Correct errors fail falsely once in 16,000.
fn assert_agree(a: Value, b: Value) {
    assert!((a.0 - b.0).abs() < 4.0 * a.1.hypot(b.1), "{a:?} {b:?}");
}

/// The Bayes factor of a drift by importance sampling of both models, and by the density ratio at the null of one.
#[test]
fn bayes_factors_agree_by_importance_and_by_the_density_at_the_null() {
    let base = by(EvidenceMethod::ImportanceSampling, base_fit());
    let with = extended_fit("tracking-drift");
    let found = by(EvidenceMethod::ImportanceSampling, &with);
    let ratio = at_null(&with);
    let SavageDickey::Ratio { ln_bayes_factor, standard_error } = ratio else { panic!("{ratio:?}") };
    assert_agree((found.0 - base.0, found.1.hypot(base.1)), (ln_bayes_factor, standard_error));
    assert!(found.1 < 0.1 && standard_error < 0.3, "{found:?} {standard_error}");
}

/// Two springpots in parallel: a fit with exchanged parameters gives the same evidence, and in the draws each name stays with one springpot.
#[test]
fn exchanged_parts_have_one_evidence() {
    let (mut experiment, _) = embedded().expect("embedded");
    experiment.apparatus = Apparatus::Instrument { compliance_per_m: 549.178, is_stress_strain: false };
    let text = "parallel = [{ springpot = \"fast\" }, { springpot = \"slow\" }]";
    let base = BaseLaw::Network(Network::from_text("law.toml".as_ref(), text).expect("a network"));
    let specification = ModelSpecification { base, ..ModelSpecification::default() };
    let problem = Problem::new(experiment, specification, None, &SilentMonitor).expect("sound");
    let data = Subject::new(&problem, &Library::default(), None, &SilentMonitor).expect("sound");
    let candidate = data.base();
    let truth = candidate.free.iter().zip([2.0, 0.8, 3.0, 0.2]);
    let theta: Vec<f64> = truth.map(|(free, value)| free.coordinate.theta(value)).collect();
    let mut stream = RandomStream::new(7, 0);
    let truth_m = data.trajectory_m(&candidate, &theta).expect("a model");
    let data = data.with_positions(&truth_m.iter().map(|x| x + 4e-6 * stream.normal()).collect::<Vec<_>>());
    let fit = data.fit(&candidate, &[], Search::Wide).expect("fits");
    let exchanged = Fitted { theta: [2, 3, 0, 1].map(|k| fit.theta[k]).to_vec(), ..fit.clone() };
    let [one, other] = [fit, exchanged].map(|fit| evidence(&data, &candidate, &fit, 3).expect("can be sampled"));
    assert!((one.ln_evidence - other.ln_evidence).abs() < 1e-6, "{} {}", one.ln_evidence, other.ln_evidence);
    let [fast, slow] = ["fast_order", "slow_order"]
        .map(|name| one.parameters.iter().find(|parameter| parameter.name == name).expect("sampled"));
    assert!((0.75..0.85).contains(&fast.q05) && (0.15..0.25).contains(&slow.q95), "{fast:?} {slow:?}");
}

/// A drift, whose null lies inside the support, and a spring in series, whose null is an end of it: all methods of evidence, and the three of the Bayes factor.
#[test]
#[ignore = "campaigns/long-tests"]
fn bayes_factors_agree_however_they_are_computed() {
    use EvidenceMethod::{ImportanceSampling, SequentialMonteCarlo};
    let base = [ImportanceSampling, SequentialMonteCarlo].map(|method| by(method, base_fit()));
    assert_agree(base[0], base[1]);
    for slug in ["tracking-drift", "instantaneous-elasticity"] {
        let with = extended_fit(slug);
        let found = [ImportanceSampling, SequentialMonteCarlo].map(|method| by(method, &with));
        let ratio = at_null(&with);
        assert_agree(found[0], found[1]);
        let SavageDickey::Ratio { ln_bayes_factor, standard_error } = ratio else { panic!("{ratio:?}") };
        for (base, with) in base.iter().zip(found) {
            assert_agree((with.0 - base.0, with.1.hypot(base.1)), (ln_bayes_factor, standard_error));
        }
        assert!(found[0].1 < 0.1 && found[1].1 < 0.2 && standard_error < 0.3, "{slug}");
    }
}

/// A retardation beside another one is unidentified in two places: its time at zero amplitude, and both amplitudes at equal times. The latter is a
/// narrow ridge, which draws around the maximum miss. The stated error covers the estimate of a longer run, whose own error is well
/// below a nat: 3 of both together fail falsely once in 370 if they are correct; the seed is fixed. Both runs have the same starts,
/// so the test concerns the ridge alone.
#[test]
#[ignore = "campaigns/long-tests"]
fn the_evidence_of_a_second_retardation_holds_its_error() {
    let (candidate, fit) = extended_fit("second-retardation");
    let posterior = CandidatePosterior::new(subject(), &candidate).expect("sound");
    let modes = posterior.modes(&candidate, &fit).expect("finite");
    let density = posterior.density();
    let seen = PriorCoordinates::new(&density, posterior.priors().distributions());
    let many = ImportanceOptions { n_adapting: 4_000, n_rounds: 8, n_draws: 20_000, n_attempts: 1, seed: 11 };
    let long = importance::evidence(&seen, &modes, &many).expect("has a mode");
    assert!(long.standard_error < 0.5, "{}", long.standard_error);
    let found = evidence(subject(), &candidate, &fit, 3).expect("can be sampled");
    let error = found.standard_error.hypot(long.standard_error);
    assert!(
        (found.ln_evidence - long.ln_evidence).abs() < 3.0 * error && error < 1.5,
        "{found:?} {}",
        long.ln_evidence
    );
}

/// That ridge is among the starts of a second retardation's sampling.
#[test]
fn the_ridge_of_two_alike_retardations_is_a_start() {
    let (candidate, fit) = extended_fit("second-retardation");
    let posterior = CandidatePosterior::new(subject(), &candidate).expect("sound");
    let is_on_ridge = |at: &[f64]| {
        let natural = |name: &str| at[posterior.priors().names().position(|known| known == name).expect("sampled")];
        let own_s = natural("viscosity_1_pa_s") / natural("young_modulus_pa");
        natural("second-retardation.compliance_ratio") > 0.3
            && (natural("second-retardation.time_s") / own_s - 1.0).abs() < 0.01
    };
    assert!(posterior.starts(&candidate, &fit).ridges.iter().any(|at| is_on_ridge(at)));
}

/// Fractions of the ensemble sampler's draws outside the weighted quantiles: 5 % on each side, within 4 errors. The errors are the sampler's, whose walkers are slow in
/// these posteriors (a fraction may have an error of 0.015), and 0.007 of a thousand effective draws here. If the sampler's estimate of its error
/// is correct, 4 of them fail falsely once in 16,000. A second retardation is unsuitable for this test: the sampler's walkers stay in the parts of its posterior
/// in which they started, and the sampler reports this.
#[test]
#[ignore = "campaigns/long-tests"]
fn intervals_are_those_of_the_ensemble_sampler() {
    let (candidate, fit) = extended_fit("tracking-drift");
    let found = evidence(subject(), &candidate, &fit, 7).expect("can be sampled");
    let posterior = CandidatePosterior::new(subject(), &candidate).expect("sound");
    let priors = posterior.priors().priors();
    let options =
        SamplerOptions { seed: 2, max_steps: 10_000, stop_when_converged: false, ..SamplerOptions::default() };
    let starts: Vec<Vec<f64>> =
        posterior.starts(&candidate, &fit).climbs.iter().map(|x| posterior.priors().to_unconstrained(x)).collect();
    let outcome = sample(&posterior.density(), &starts, &options, &RunControl::default()).expect("can be sampled");
    for parameter in &found.parameters {
        let d = priors.iter().position(|prior| prior.name == parameter.name).expect("sampled");
        let column = outcome.draws.column(d);
        let assert_share = |is_outside: &dyn Fn(f64) -> bool| {
            let outside: Vec<f64> = column
                .values
                .iter()
                .map(|z| f64::from(u8::from(is_outside(priors[d].distribution.from_unconstrained(*z)))))
                .collect();
            let share = outside.iter().sum::<f64>() / outside.len() as f64;
            let error = (share * (1.0 - share) / ess(&column, &outside)).sqrt().hypot(0.007);
            assert!((share - 0.05).abs() < 4.0 * error && error < 0.03, "{parameter:?}: {share} ± {error}");
        };
        assert_share(&|x| x < parameter.q05);
        assert_share(&|x| x > parameter.q95);
    }
}

#[test]
fn the_same_seed_gives_the_same_numbers_and_what_has_no_evidence_is_refused() {
    let subject = subject();
    let (base, base_fit) = base_fit();
    let (candidate, fit) = extended_fit("softening");
    let first = evidence(subject, &candidate, &fit, 1).expect("can be sampled");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let again = pool.install(|| evidence(subject, &candidate, &fit, 1)).expect("can be sampled");
    assert_eq!(first, again);
    let names: Vec<&str> = first.parameters.iter().map(|parameter| parameter.name.as_str()).collect();
    assert_eq!(names, ["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s", "softening.rate_per_s"]);
    assert!(first.parameters.iter().all(|p| p.q05 < p.mean && p.mean < p.q95));
    let free_column = base.with_columns(vec![vec![1e-6; subject.fitted_m.len()]]);
    let refused = evidence(subject, &free_column, base_fit, 1).expect_err("columns have no prior");
    assert!(refused.to_string().contains("no prior"), "{refused}");
}

/// Outliers that a subject leaves out do not count. The evidence is that of fewer positions.
#[test]
fn rows_that_are_left_out_do_not_count() {
    let subject = subject();
    let left: Vec<usize> =
        (5..subject.fitted_m.len()).step_by(50).filter(|row| subject.fitted_m[*row].is_some()).collect();
    let fewer = subject.without_rows(&left);
    let candidate = fewer.base();
    let posterior = CandidatePosterior::new(&fewer, &candidate).expect("sound");
    assert_eq!(posterior.density().n_observed() + left.len(), subject.n_fitted());
}
