//! Which effect is missing: the search, what stands beside its claim, and the words for it.

use super::bootstrap::simulated;
use super::class::class_of;
use super::document::Report;
use super::leftover::{Leftover, event_in_any_cycle, is_gain_of_a_cycle, misfit};
use super::outside::{self, Outside, OutsideNull, OutsideRequest, outside_gain};
use super::refit::Refitted;
pub use super::request::DiagnosisRequest;
use super::search::{Effort, Found, LARGER_NATS, search};
use super::{Search, Subject, outliers};
use documents::diagnosis::Diagnosis;
use rayon::prelude::*;

use base::error::Result;
use posterior::misfit::Misfit;
use posterior::monitor::{Counter, Monitor};

/// What was found, with the models behind it.
pub struct Outcome {
    /// The document.
    pub diagnosis: Diagnosis,
    /// The search, on the positions without outliers.
    pub found: Found,
    /// Structure outside the library, the leading one first, with its fit.
    pub unexplained: Vec<Outside>,
    /// The same taken together, with its picture; `None` where nothing is unexplained, or nobody asked.
    pub leftover: Option<Leftover>,
    /// The subject without outliers.
    pub subject: Subject,
}

/// p and gain (nats, less what chance gives) that structure outside the library needs.
const LARGEST_OUTSIDE_P: f64 = 0.02;
const LEAST_OUTSIDE_NATS: f64 = 5.5;
const N_OUTSIDE_SIMULATIONS: usize = 199;
/// Simulated data sets by which a finding is confirmed: none of them may show as much. They are made so many at a time, three times at least, and no more
/// where the finding is out of their reach.
const N_CONFIRMING: usize = 195;
const CONFIRMING_BATCH: usize = 13;
const FEWEST_CONFIRMING: usize = 39;
const OUT_OF_REACH: f64 = 2.0;
const CONFIRMING_STREAMS: u64 = 0xc0f1;
/// What the best effect of the library gains by chance, in nats; each further one is asked for more.
const CHANCE_NATS: f64 = 1.5;
/// Lead (nats) that structure needs to take the place of a claim that leaves nothing.
const LEAST_LEAD_NATS: f64 = 4.0;
/// Cosine above which structure outside the library looks like one of its effects.
const TWIN_COSINE: f64 = 0.95;
/// What is left beside a claim counts when it gains this share of the claim's gain.
const LEAST_OUTSIDE_SHARE: f64 = 0.1;

/// Diagnoses.
///
/// # Errors
/// Whatever fitting the base model refuses.
pub fn diagnose(subject: &Subject, request: &DiagnosisRequest, monitor: &dyn Monitor) -> Result<Outcome> {
    let base = subject.base();
    let first = subject.fit(&base, &[], Search::Wide)?;
    let outlier_rows = outliers::find(subject, &first);
    let subject = if outlier_rows.is_empty() { subject.clone() } else { subject.without_rows(&outlier_rows) };
    let DiagnosisRequest { n_simulations, in_full, seed, .. } = *request;
    let effort = Effort { n_simulations, in_full, seed };
    let mut found = search(&subject, &request.bars, &effort, monitor)?;
    monitor.stage("looking for structure outside the library");
    let (unexplained, left) = judged(&subject, request, &mut found, monitor)?;
    let class = match &found.claimed {
        Some(claimed) if !left.is_too_large() => class_of(&subject, &found, claimed)?,
        _ => Vec::new(),
    };
    let (mut leftover, mut event) = (None, None);
    let mut report = Report {
        subject: &subject,
        request,
        found: &found,
        unexplained: &unexplained,
        left: &left,
        leftover: None,
        event: None,
        class: &class,
    };
    if in_full {
        monitor.stage("looking for events in all cycles");
        let model = found.claimed.as_ref().unwrap_or(&found.base);
        let outside = OutsideRequest { n_simulations: N_OUTSIDE_SIMULATIONS, seed };
        if report.remains() {
            leftover = Some(Leftover::of(&subject, model, &unexplained, &outside)?);
        }
        event = event_in_any_cycle(&subject, model, &unexplained, &outside, is_significant)?;
    }
    (report.leftover, report.event) = (leftover.as_ref(), event.as_ref());
    let diagnosis = report.document(outlier_rows, monitor)?;
    Ok(Outcome { diagnosis, found, unexplained, leftover, subject })
}

/// Whether structure outside the library is more than chance.
fn is_significant(outside: &Outside) -> bool {
    outside.p_familywise <= LARGEST_OUTSIDE_P && outside.penalised_gain_nats >= LEAST_OUTSIDE_NATS
}

/// Structure that is not of the library, and what the best model leaves. Where that is more than the noise allows, the law is still wrong: one effect may
/// be said to help, and none is added for the sake of what is left. The same goes for an effect that structure of
/// the law takes the place of.
fn judged(
    subject: &Subject,
    request: &DiagnosisRequest,
    found: &mut Found,
    monitor: &dyn Monitor,
) -> Result<(Vec<Outside>, Misfit)> {
    let mut structure = unexplained(subject, request, found, monitor)?;
    let left_by = |found: &Found, structure: &[Outside]| {
        misfit(subject, found.claimed.as_ref().unwrap_or(&found.base), structure)
    };
    let mut left = left_by(found, &structure)?;
    let is_larger = found.claimed.as_ref().is_some_and(|claimed| found.added(claimed).len() > 1);
    if left.is_too_large() && is_larger {
        found.claimed = found.first_claimed().cloned();
        structure = unexplained(subject, request, found, monitor)?;
        left = left_by(found, &structure)?;
    }
    let is_of_law = structure.first().is_some_and(|first| !first.kind.is_apart_from_law());
    if let (None, Some(first), true) = (&found.claimed, found.first_claimed().cloned(), is_of_law) {
        let left_by_it = misfit(subject, &first, &[])?;
        if left_by_it.is_too_large() {
            (found.claimed, left) = (Some(first), left_by_it);
        }
    }
    Ok((structure, left))
}

/// Structure that is not of the library. Withdraws a claim that such structure explains better.
fn unexplained(
    subject: &Subject,
    request: &DiagnosisRequest,
    found: &mut Found,
    monitor: &dyn Monitor,
) -> Result<Vec<Outside>> {
    let search = OutsideRequest { n_simulations: N_OUTSIDE_SIMULATIONS, seed: request.seed };
    let look = |model: &Refitted| -> Result<Vec<Outside>> {
        let mut list = outside::search(subject, &model.candidate, &model.fitted, &search)?;
        list.retain(|outside| is_significant(outside) && !is_gain_of_a_cycle(subject, outside));
        Ok(list)
    };
    let Some(claimed) = &found.claimed else {
        // What looks like an effect of the library, and was not claimed as one, is at most suggestive.
        let mut list = look(&found.base)?;
        list.retain(|outside| outside.twins.iter().all(|(_, cosine)| *cosine <= TWIN_COSINE));
        return confirmed(subject, &found.base, list, &search, monitor);
    };
    let effects = found.added(claimed);
    // What looks like a claimed effect (backlash is a delay on a square wave) is not beside it.
    let is_other = |outside: &Outside| {
        let stands_for = |(slug, cosine): &(String, f64)| *cosine > TWIN_COSINE && effects.contains(&slug.as_str());
        !outside.twins.iter().any(stands_for)
    };
    let gain = claimed.fitted.objective - found.base.fitted.objective;
    let mut left = look(claimed)?;
    left.retain(|outside| outside.penalised_gain_nats >= LEAST_OUTSIDE_SHARE * gain);
    // One structure alone may explain the misfit better than all that is claimed.
    let chance = CHANCE_NATS + LARGER_NATS * effects.len().saturating_sub(1) as f64;
    let lead = if left.is_empty() { LEAST_LEAD_NATS + LEAST_OUTSIDE_SHARE * gain } else { 0.0 };
    let mut alone = look(&found.base)?;
    alone.retain(|outside| outside.penalised_gain_nats > gain - chance + lead);
    left.retain(is_other);
    alone.retain(is_other);
    let alone = confirmed(subject, &found.base, alone, &search, monitor)?;
    if alone.is_empty() {
        return confirmed(subject, claimed, left, &search, monitor);
    }
    found.claimed = None;
    Ok(alone)
}

/// Structure that data simulated from the model and its noise, searched alike with the noise estimated anew, do not show by chance: correlated noise
/// looks like many things.
fn confirmed(
    subject: &Subject,
    model: &Refitted,
    mut list: Vec<Outside>,
    request: &OutsideRequest,
    monitor: &dyn Monitor,
) -> Result<Vec<Outside>> {
    let Some(gain) = list.first().map(|first| first.penalised_gain_nats) else { return Ok(list) };
    let null = OutsideNull::of(subject, &model.candidate, &model.fitted, request)?;
    let counter = Counter::new(monitor, N_CONFIRMING);
    let gain_of = |number: usize| -> Result<f64> {
        let data = simulated(subject, model, request.seed ^ CONFIRMING_STREAMS, number);
        let start = (model.fitted.theta.clone(), model.fitted.noise);
        let fitted = data.fit(&model.candidate, &[start], Search::Local)?;
        let simulated = outside_gain(&data, &model.candidate, &fitted, &null)?.0;
        counter.add_one();
        Ok(simulated)
    };
    let (mut largest, mut n_made) = (LEAST_OUTSIDE_NATS, 0);
    while n_made < N_CONFIRMING && (n_made < FEWEST_CONFIRMING || gain <= OUT_OF_REACH * largest) {
        let batch = (n_made..n_made + CONFIRMING_BATCH).into_par_iter().map(gain_of);
        largest = batch.collect::<Result<Vec<f64>>>()?.into_iter().fold(largest, f64::max);
        n_made += CONFIRMING_BATCH;
        // The first that reaches it ends the search: the rest would change nothing.
        if largest >= gain {
            return Ok(Vec::new());
        }
    }
    let p = 1.0 / (1 + n_made) as f64;
    list.iter_mut().for_each(|outside| outside.p_familywise = outside.p_familywise.max(p));
    Ok(list)
}

#[cfg(test)]
#[path = "diagnose_tests.rs"]
mod tests;
