//! Diagnosis of a record: the search, its rivals and residual tests, and the document.

use super::bootstrap::simulated;
use super::class::fit_rivals;
use super::derivatives::columns_m;
use super::document::Report;
use super::outside::{self, OutsideNull, OutsideRequest, OutsideStructure, largest_outside_gain};
use super::own_errors::own_errors;
use super::predicted::{error_over_predicted_noise, error_over_white_noise};
use super::refit::Refitted;
pub use super::request::DiagnosisRequest;
use super::residual_structure::{
    UnexplainedResidual, event_in_any_cycle, is_gain_of_a_cycle, measure_misfit, remaining_pattern,
    with_structure_outside_law,
};
use super::search::{SearchResult, SearchStep, search};
use super::verdict::{Evidence, Residual, ResidualTest, Verdict, decide_verdict};
use super::{Search, Subject, outliers};
use documents::diagnosis::{Diagnosis, VerdictKind};
use documents::errors::ModelErrors;
use rayon::prelude::*;

use base::error::{Error, Result};
use posterior::monitor::{Counter, Monitor};

/// Result of a diagnosis, with the models that it rests on.
pub struct DiagnosisResult {
    /// Document of the diagnosis.
    pub diagnosis: Diagnosis,
    /// Result of the search, which uses the positions without outliers.
    pub found: SearchResult,
    /// Summary of the unexplained residual, with the data of its figure; `None` if nothing is unexplained or the request is not in full.
    pub leftover: Option<UnexplainedResidual>,
    /// The subject without outliers.
    pub subject: Subject,
}

const N_OUTSIDE_SIMULATIONS: usize = 199;
/// Smallest size of an unexplained residual that is shown, as a part of the predictive noise. Below it, the learnt noise has taken the residual.
const VISIBLE_SHARE: f64 = 0.05;
/// Largest number of simulated data sets that confirm a finding. The largest gain in each must stay below the gain of the finding. The sets are made in batches of
/// `CONFIRMING_BATCH`, and at least `FEWEST_CONFIRMING` are made. The batches stop early if the finding is out of their reach.
const N_CONFIRMING: usize = 195;
const CONFIRMING_BATCH: usize = 13;
const FEWEST_CONFIRMING: usize = 39;
const OUT_OF_REACH: f64 = 2.0;
const CONFIRMING_STREAMS: u64 = 0xc0f1;

/// Diagnoses a record: excludes outliers, searches for missing effects, computes evidence, decides the verdict and writes the document.
///
/// # Errors
/// Errors of fitting the base model.
pub fn diagnose(subject: &Subject, request: &DiagnosisRequest, monitor: &dyn Monitor) -> Result<DiagnosisResult> {
    let base = subject.base();
    let first = subject.fit(&base, &[], Search::Wide)?;
    let outlier_rows = outliers::find_outliers(subject, &first);
    let whole = subject;
    let subject = if outlier_rows.is_empty() { whole.clone() } else { whole.without_rows(&outlier_rows) };
    let found = search(&subject, request, monitor)?;
    monitor.stage("testing for structure outside the library");
    let GatheredEvidence { evidence, models, unexplained, equivalent } = gather(&subject, request, &found, monitor)?;
    let mut verdict = decide_verdict(&evidence, &request.criteria);
    if let Some(place) = verdict.proposal.filter(|_| verdict.kind == VerdictKind::Unexplained)
        && !is_improved(whole, request, &found.base, models[place])?
    {
        let residual = residual(&subject, &found.base, &unexplained, false)?;
        verdict = Verdict {
            proposal: None,
            effects: Vec::new(),
            equivalent: Vec::new(),
            residual: Some(residual),
            ..verdict
        };
    }
    let Some(Residual::Record { misfit: left, over_predicted, .. }) = verdict.residual else {
        return Err(Error::numerical("the residual was not tested", "examine another revision with `--from`"));
    };
    let is_nothing = verdict.kind == VerdictKind::None;
    let mut report = Report {
        subject: &subject,
        request,
        found: &found,
        verdict: &verdict,
        model: verdict.proposal.map(|place| models[place]),
        unexplained: &unexplained,
        left: &left,
        pattern: if is_nothing { remaining_pattern(&subject, &found.base)? } else { None },
        over_predicted: over_predicted.filter(|factor| *factor > request.criteria.claim_factor),
        leftover: None,
        event: None,
        equivalent: &equivalent,
        every_position: whole,
    };
    if request.in_full {
        monitor.stage("testing all cycles for events");
        let model = report.model.unwrap_or(&found.base);
        let outside = outside_request(request);
        if report.remains() {
            let leftover = UnexplainedResidual::of(&subject, model, &unexplained, (&request.criteria, &outside))?;
            let entry = &leftover.entry;
            report.leftover = (entry.size_um >= VISIBLE_SHARE * entry.predictive_noise_um).then_some(leftover);
        }
        report.event = event_in_any_cycle(&subject, model, &unexplained, (&request.criteria, &outside))?;
    }
    let diagnosis = report.document(outlier_rows, monitor)?;
    let leftover = report.leftover;
    Ok(DiagnosisResult { diagnosis, found, leftover, subject })
}

/// True if a model's error on the last held-out cycle, or on the fitted cycles if none is held out, is smaller than that of the base.
fn is_improved(whole: &Subject, request: &DiagnosisRequest, base: &Refitted, model: &Refitted) -> Result<bool> {
    let base = request.base_errors.map_or_else(|| own_errors(whole, base), Ok)?;
    let model = own_errors(whole, model)?;
    let [before, after] =
        [base, model].map(|errors: ModelErrors| errors.rmse_heldout_um.unwrap_or(errors.rmse_fitted_um));
    Ok(after < before)
}

fn outside_request(request: &DiagnosisRequest) -> OutsideRequest {
    OutsideRequest { n_simulations: N_OUTSIDE_SIMULATIONS, seed: request.seed }
}

/// Evidence of a record, with the models and the structure that it rests on.
struct GatheredEvidence<'a> {
    evidence: Evidence,
    /// Fitted model of each proposal.
    models: Vec<&'a Refitted>,
    /// Structure outside the library that remains beside the accepted model.
    unexplained: Vec<OutsideStructure>,
    /// Models of the rivals that are equivalent to the claim.
    equivalent: Vec<Refitted>,
}

/// Gathers the evidence of a record: tests residuals until a model is accepted, then finds the rivals of a claim.
fn gather<'a>(
    subject: &Subject,
    request: &DiagnosisRequest,
    found: &'a SearchResult,
    monitor: &dyn Monitor,
) -> Result<GatheredEvidence<'a>> {
    let criteria = &request.criteria;
    let steps: Vec<&SearchStep> = found.largest.iter().chain(found.leading(criteria)).collect();
    let proposals = steps.iter().map(|step| step.addition.clone().into()).collect();
    let mut evidence = Evidence { proposals, ..Evidence::default() };
    let mut unexplained = Vec::new();
    while let Some(proposal) = evidence.next_test(criteria) {
        let step = proposal.map(|place| steps[place]);
        let (structure, replaces_effects) = structure_beside(subject, request, &found.base, step, monitor)?;
        let model = step.filter(|_| !replaces_effects).map_or(&found.base, |step| &step.refitted);
        let test = ResidualTest {
            structure: structure.iter().map(OutsideStructure::evidence).collect(),
            replaces_effects,
            residual: Some(residual(subject, model, &structure, step.is_some() && !replaces_effects)?),
        };
        unexplained = structure;
        match proposal {
            Some(place) => evidence.proposals[place].test = Some(test),
            None => evidence.base = Some(test),
        }
    }
    if evidence.is_replaced_by_law(criteria)
        && let (Some(leading), Some(proposal)) = (found.leading(criteria), evidence.proposals.last_mut())
    {
        proposal.alone = Some(residual(subject, &leading.refitted, &[], true)?);
    }
    let mut equivalent = Vec::new();
    if let Some(claim) = evidence.claim(criteria) {
        for (rival, model) in fit_rivals(subject, criteria, found, &steps[claim].refitted)? {
            equivalent.extend(criteria.is_equivalent(&rival).then_some(model));
            evidence.rivals.push(rival);
        }
    }
    Ok(GatheredEvidence {
        evidence,
        models: steps.iter().map(|step| &step.refitted).collect(),
        unexplained,
        equivalent,
    })
}

/// Residual of a model after removal of structure that belongs to no law, with the number of positions that it covers. A claim also has its error on the last held-out cycle
/// divided by the predictive noise. A base whose recordings cannot show slow noise has this error divided by white noise.
fn residual(subject: &Subject, model: &Refitted, structure: &[OutsideStructure], is_claim: bool) -> Result<Residual> {
    let n = |positions: &[Option<f64>]| positions.iter().flatten().count();
    let n_positions = if n(&subject.scored_m) > 0 { n(&subject.scored_m) } else { n(&subject.fitted_m) };
    let without_shape = with_structure_outside_law(model, structure);
    let over_predicted = match is_claim {
        true => error_over_predicted_noise(subject, without_shape),
        false if subject.can_show_slow_noise() => None,
        false => error_over_white_noise(subject, without_shape),
    };
    Ok(Residual::Record { misfit: measure_misfit(subject, model, structure)?, n_positions, over_predicted })
}

/// Finds structure outside the library in the residual of a step's model, or of the base if there is no step. The flag is true if the structure lies in the base's
/// residual and explains more than the step's effects.
fn structure_beside(
    subject: &Subject,
    request: &DiagnosisRequest,
    base: &Refitted,
    step: Option<&SearchStep>,
    monitor: &dyn Monitor,
) -> Result<(Vec<OutsideStructure>, bool)> {
    let criteria = &request.criteria;
    let significant = |model: &Refitted| -> Result<Vec<OutsideStructure>> {
        let mut list = outside::search(subject, &model.candidate, &model.fitted, &outside_request(request))?;
        list.retain(|outside_structure| {
            criteria.is_significant(&outside_structure.evidence()) && !is_gain_of_a_cycle(subject, outside_structure)
        });
        Ok(list)
    };
    let Some(SearchStep { addition, refitted }) = step else {
        // Structure that resembles an unclaimed effect of the library is at most suggestive.
        let mut list = significant(base)?;
        list.retain(|outside_structure| !criteria.resembles_effect(&outside_structure.evidence(), |_| true));
        return Ok((confirmed(subject, base, list, request, monitor)?, false));
    };
    // Structure that resembles an effect of the step can neither add to the step nor replace it.
    let is_own = |slug: &str| addition.effects.iter().any(|effect| effect == slug);
    let is_other =
        |outside_structure: &OutsideStructure| !criteria.resembles_effect(&outside_structure.evidence(), is_own);
    let mut beside = significant(refitted)?;
    beside.retain(|outside_structure| criteria.adds_to_claim(&outside_structure.evidence(), addition));
    let has_beside = !beside.is_empty();
    let mut instead = significant(base)?;
    instead.retain(|outside_structure| {
        criteria.replaces_claim(&outside_structure.evidence(), addition, has_beside) && is_other(outside_structure)
    });
    let instead = confirmed(subject, base, instead, request, monitor)?;
    if !instead.is_empty() {
        return Ok((instead, true));
    }
    beside.retain(is_other);
    Ok((confirmed(subject, refitted, beside, request, monitor)?, false))
}

/// Keeps structure that does not appear by chance in data simulated from the model and its noise. The simulated data are searched in the same way, with the noise
/// estimated anew, because correlated noise resembles many structures. The model is linearised about its fit, from which the simulated data differ by noise only: a trajectory
/// can take milliseconds, and every data set needs thousands.
fn confirmed(
    subject: &Subject,
    model: &Refitted,
    mut list: Vec<OutsideStructure>,
    request: &DiagnosisRequest,
    monitor: &dyn Monitor,
) -> Result<Vec<OutsideStructure>> {
    let Some(gain) = list.first().map(|first| first.penalised_gain_nats) else { return Ok(list) };
    let null = OutsideNull::of(subject, &model.candidate, &model.fitted, &outside_request(request))?;
    let counter = Counter::new(monitor, N_CONFIRMING);
    let columns_m = columns_m(subject, &model.candidate, &model.fitted.theta)?;
    let linearised = subject.clone().linearised((&model.fitted.theta, &model.fitted.position_m), columns_m);
    let gain_of = |number: usize| -> Result<f64> {
        let data = simulated(&linearised, model, request.seed ^ CONFIRMING_STREAMS, number);
        let start = (model.fitted.theta.clone(), model.fitted.noise);
        let fitted = data.fit(&model.candidate, &[start], Search::Local)?;
        let simulated = largest_outside_gain(&data, &model.candidate, &fitted, &null)?.0;
        counter.add_one();
        Ok(simulated)
    };
    let (mut largest, mut n_made) = (request.criteria.least_structure_nats, 0);
    while n_made < N_CONFIRMING && (n_made < FEWEST_CONFIRMING || gain <= OUT_OF_REACH * largest) {
        let batch = (n_made..n_made + CONFIRMING_BATCH).into_par_iter().map(gain_of).collect::<Result<Vec<f64>>>()?;
        largest = batch.into_iter().fold(largest, f64::max);
        n_made += CONFIRMING_BATCH;
        // The first data set that reaches the gain ends the confirmation: further data sets would not change the result.
        if largest >= gain {
            return Ok(Vec::new());
        }
    }
    let p = 1.0 / (1 + n_made) as f64;
    for outside in &mut list {
        outside.p_familywise = outside.p_familywise.max(p);
    }
    Ok(list)
}

#[cfg(test)]
#[path = "diagnose_tests.rs"]
mod tests;
