//! `diagnose` for an oscillation: finds the effect that the law lacks.
//!
//! Every effect that changes only the law is fitted. A claimed effect must meet three conditions:
//! - Few searches in simulated data without an effect reach the gain of the claimed effect.
//! - The held-out frequencies do not contradict the effect.
//! - The remaining residuals are consistent with noise, by the test that `sample` uses.

use rayon::prelude::*;

use super::job::{REPEATS_DIFFER, SEVERAL_GELS, misfit, model_summary, no_fit};
use super::noise_like::{ResidualPValues, test_residuals};
use super::problem::{SweepFit, SweepProblem};
use base::error::Result;
use criticism::criteria::Criteria;
use criticism::verdict::{Addition, Evidence, Residual, ResidualTest, Rival, Verdict, decide_verdict};
use documents::diagnosis::VerdictKind;
use documents::oscillation::{OscillationCandidate, OscillationDiagnosis, OscillationEstimate};
use figures::number::format_significant;
use models::effects::{Effect, Library, Stage};
use posterior::monitor::{Counter, Monitor, refuse_if_stopped};
use posterior::study::ModelSpecification;
use sampling::ensemble::RandomStream;

/// Number of simulated data sets without an effect. Each is searched for the effect with the largest gain.
const N_SEARCHES: usize = 199;
/// Number of the random stream of the first simulation. Other uses of the seed have other stream numbers.
const STREAM: u64 = 1 << 41;
/// Number of starting points, for a fit with an effect, that are drawn from the prior.
const N_WIDE_STARTS: usize = 24;
/// Number of starting points, for a fit with an effect, that take the law's parameters from the fit without the effect. The effect's parameters are drawn
/// from its prior.
const N_STARTS: usize = 6;

const CRITERIA: Criteria = Criteria::SWEEP;

/// Candidate effect with the best fit of the law that is extended by the effect.
struct CandidateFit {
    effect: &'static dyn Effect,
    problem: SweepProblem,
    fit: SweepFit,
}

/// Diagnoses an oscillation.
///
/// # Errors
/// The errors of fitting.
pub fn run(
    problem: &SweepProblem,
    seed: u64,
    library: &Library,
    monitor: &dyn Monitor,
) -> Result<OscillationDiagnosis> {
    monitor.stage("fitting every effect that changes the law");
    let base = problem.fit(seed, &[])?.ok_or_else(no_fit)?;
    let mut tried: Vec<CandidateFit> = Vec::new();
    for effect in library.effects().iter().filter(|effect| effect.stage() == Stage::Mechanics) {
        let Some(with) = extended(problem, *effect, library) else { continue };
        let fit = fit_near_base(problem, &base, &with, seed)?;
        tried.extend(fit.map(|fit| CandidateFit { effect: *effect, problem: with, fit }));
    }
    tried.sort_by(|a, b| b.fit.ln_likelihood.total_cmp(&a.fit.ln_likelihood));
    monitor.stage("simulated searches without any effect");
    let chance = searches(problem, &base, &tried, seed, monitor)?;
    let has_heldout = problem.sweep.rows.iter().any(|row| row.is_heldout);
    let candidates: Vec<OscillationCandidate> =
        tried.iter().map(|tried| candidate(tried, &base, &chance, has_heldout)).collect();
    monitor.stage("testing the residuals");
    let left = test_residuals(problem, &base, seed)?.ok_or_else(no_fit)?;
    let mut evidence = evidence(&candidates, &left);
    let best = evidence.next_test(&CRITERIA).flatten();
    let left_with = match best {
        Some(best) => test_residuals(&tried[best].problem, &tried[best].fit, seed)?,
        None => None,
    };
    if let Some(best) = best {
        evidence.proposals[best].test = Some(test(left_with.as_ref()));
        evidence.rivals = rivals(&candidates, best);
    }
    let verdict = decide_verdict(&evidence, &CRITERIA);
    let predicted = problem.predict(&base.values).ok_or_else(no_fit)?;
    let with = best.map(|best| &tried[best]).zip(left_with);
    let extended = with.and_then(|(tried, left)| {
        let predicted = tried.problem.predict(&tried.fit.values)?;
        Some(misfit(&tried.problem, &predicted, &tried.fit, &left))
    });
    Ok(OscillationDiagnosis {
        experiment: problem.sweep.specimen_id.clone(),
        model: model_summary(problem),
        verdict: verdict.document(sentence(&verdict, &candidates, &left)),
        base: misfit(problem, &predicted, &base, &left),
        extended,
        candidates,
        searches: chance.len(),
    })
}

/// Returns the problem with the effect added to the model. `None` if the effect cannot be added, or if an oscillation cannot show it.
fn extended(problem: &SweepProblem, effect: &dyn Effect, library: &Library) -> Option<SweepProblem> {
    let slug = effect.slug().to_string();
    if problem.specification.effects.contains(&slug) {
        return None;
    }
    let mut specification: ModelSpecification = problem.specification.clone();
    specification.effects.push(slug);
    SweepProblem::new(problem.sweep.clone(), specification, library).ok()
}

/// Best fit with an effect. Among fits of nearly equal posterior density, the fit nearest to the fit without the effect is chosen. The law's parameters
/// then stay comparable even if two retarding bodies of the law can exchange their roles.
fn fit_near_base(problem: &SweepProblem, base: &SweepFit, with: &SweepProblem, seed: u64) -> Result<Option<SweepFit>> {
    let starts = [with.starts(seed, N_WIDE_STARTS), starts_from_base(problem, base, with, seed)].concat();
    let mut fits = with.maxima(&starts)?;
    let highest = fits.first().map_or(f64::NAN, |fit| fit.ln_posterior);
    fits.retain(|fit| fit.ln_posterior > highest - CRITERIA.equivalent_nats);
    let law = problem.model.base().parameters();
    let distance = |fit: &SweepFit| -> f64 {
        let of = |sweep_problem: &SweepProblem, point: &[f64], name: &str| {
            sweep_problem.priors.names().position(|other| other == name).map(|place| point[place])
        };
        let apart = |name: &str| Some(of(problem, &base.point, name)? - of(with, &fit.point, name)?);
        law.iter().filter_map(|spec| apart(spec.name)).map(|apart| apart * apart).sum()
    };
    Ok(fits.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b))))
}

/// Starting points for a fit with an effect. The coordinates of the law and the noise are those of `fit`; the effect's parameters are drawn from its
/// prior.
fn starts_from_base(base: &SweepProblem, fit: &SweepFit, with: &SweepProblem, seed: u64) -> Vec<Vec<f64>> {
    let of_base = |name: &str| base.priors.names().position(|label| label == name).map(|place| fit.point[place]);
    let join = |start: Vec<f64>| {
        let named = with.priors.names().zip(start);
        named.map(|(name, value)| of_base(name).unwrap_or(value)).collect()
    };
    with.starts(seed, N_STARTS).into_iter().map(join).collect()
}

/// Largest gain in log likelihood (nats) over all effects, for each simulated data set. The data are simulated from the fit without an effect. The fit of
/// each effect to the simulated data starts from its fit to the measurement.
fn searches(
    problem: &SweepProblem,
    base: &SweepFit,
    tried: &[CandidateFit],
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>> {
    let Some(predicted) = problem.predict(&base.values) else { return Ok(Vec::new()) };
    let counter = Counter::new(monitor, N_SEARCHES);
    let search = |k: usize| -> Result<Option<f64>> {
        refuse_if_stopped(monitor, "nothing was written")?;
        let mut stream = RandomStream::new(seed, STREAM + k as u64);
        let rows = problem.simulate_rows(&predicted, &base.values, &mut stream);
        let without = problem.with_rows(rows.clone()).fit_from(std::slice::from_ref(&base.point))?;
        let mut largest = 0.0_f64;
        for tried in tried {
            let starts =
                [vec![tried.fit.point.clone()], starts_from_base(problem, base, &tried.problem, seed)].concat();
            let with = tried.problem.with_rows(rows.clone()).fit_from(&starts)?;
            if let Some((with, without)) = with.as_ref().zip(without.as_ref()) {
                largest = largest.max(with.ln_likelihood - without.ln_likelihood);
            }
        }
        counter.add_one();
        Ok(without.map(|_| largest))
    };
    let found: Vec<Option<f64>> = (0..N_SEARCHES).into_par_iter().map(search).collect::<Result<_>>()?;
    Ok(found.into_iter().flatten().collect())
}

fn candidate(tried: &CandidateFit, base: &SweepFit, chance: &[f64], has_heldout: bool) -> OscillationCandidate {
    let gain_nats = tried.fit.ln_likelihood - base.ln_likelihood;
    let n_larger = chance.iter().filter(|gain| **gain >= gain_nats).count();
    let estimate = |name: &'static str| {
        let place = tried.problem.priors.names().position(|label| label == name)?;
        let (z, sd) = (tried.fit.point[place], tried.fit.sd[place]);
        let at = |z: f64| tried.problem.priors.priors()[place].distribution.from_unconstrained(z);
        Some(OscillationEstimate { name: name.into(), value: at(z), lower: at(z - sd), upper: at(z + sd) })
    };
    OscillationCandidate {
        effect: tried.effect.slug().into(),
        gain_nats,
        heldout_gain_nats: has_heldout.then_some(tried.fit.ln_heldout - base.ln_heldout),
        p_familywise: (1 + n_larger) as f64 / (1 + chance.len()) as f64,
        parameters: tried.effect.parameters().iter().filter_map(|parameter| estimate(parameter.spec.name)).collect(),
    }
}

/// Evidence for the verdict: the candidates, and the residual test of the law without an effect.
fn evidence(candidates: &[OscillationCandidate], left: &ResidualPValues) -> Evidence {
    let addition = |oscillation_candidate: &OscillationCandidate| {
        Addition::of_gains(
            &oscillation_candidate.effect,
            oscillation_candidate.gain_nats,
            [None, oscillation_candidate.heldout_gain_nats],
            oscillation_candidate.p_familywise,
        )
    };
    let proposals = candidates.iter().map(|candidate| addition(candidate).into()).collect();
    Evidence { proposals, base: Some(test(Some(left))), rivals: Vec::new() }
}

fn test(left: Option<&ResidualPValues>) -> ResidualTest {
    let residual = Some(Residual::Sweep(left.map_or(f64::NAN, ResidualPValues::p)));
    ResidualTest { residual, ..ResidualTest::default() }
}

/// Effects other than the best, each with its deficit in log likelihood (nats). The deficit is the larger of two: on the fitted and on the held-out
/// frequencies.
fn rivals(candidates: &[OscillationCandidate], best: usize) -> Vec<Rival> {
    let heldout = |oscillation_candidate: &OscillationCandidate| oscillation_candidate.heldout_gain_nats.unwrap_or(0.0);
    let best = &candidates[best];
    let rival = |oscillation_candidate: &OscillationCandidate| Rival {
        effect: oscillation_candidate.effect.clone(),
        deficit_nats: (best.gain_nats - oscillation_candidate.gain_nats)
            .max(heldout(best) - heldout(oscillation_candidate)),
        separation_sigma: None,
        lead_p: None,
    };
    candidates.iter().filter(|candidate| candidate.effect != best.effect).map(rival).collect()
}

fn sentence(verdict: &Verdict, candidates: &[OscillationCandidate], left: &ResidualPValues) -> String {
    let Some(Residual::Sweep(p)) = verdict.residual else { return String::new() };
    if let (VerdictKind::Unexplained, Some(frequency_hz)) = (verdict.kind, left.outlying_hz) {
        return format!(
            "No linear law explains the row at {} Hz together with the other rows (p = {p:.3}): measure it again, or remove it from the table, and repeat the diagnosis.",
            format_significant(frequency_hz, 4)
        );
    }
    if verdict.kind == VerdictKind::Unexplained && left.repeats_differ() {
        return format!("No law explains that {REPEATS_DIFFER} (p = {p:.3}): {SEVERAL_GELS}.");
    }
    match (verdict.kind, verdict.proposal.map(|place| &candidates[place])) {
        (VerdictKind::Missing, Some(oscillation_candidate)) => {
            let others = match &verdict.equivalent[..] {
                [] => String::new(),
                equivalent => format!("; these frequencies cannot distinguish it from {}", equivalent.join(" or ")),
            };
            format!(
                "{} is missing: it gains {:.1} nats, which {} of simulated searches reach by chance, and the residuals are noise (p = {p:.2}){others}.",
                oscillation_candidate.effect,
                oscillation_candidate.gain_nats,
                share(oscillation_candidate.p_familywise)
            )
        }
        (_, Some(candidate)) => format!(
            "The law is wrong, and no effect of the library corrects it: {} gains most ({:.1} nats), but its residuals are not noise (p = {p:.3}).",
            candidate.effect, candidate.gain_nats
        ),
        (VerdictKind::Unexplained, None) => {
            format!("The law is wrong (p = {p:.3}), and no effect of the library improves it.")
        }
        (_, None) => {
            format!(
                "Nothing is missing: the residuals are noise (p = {p:.2}), and no effect gains more than by chance."
            )
        }
    }
}

fn share(p: f64) -> String {
    format!("{:.1} %", 100.0 * p)
}
