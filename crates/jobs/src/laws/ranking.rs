//! Order of compared laws, and what both kinds of record say of it.

use base::error::{Error, Result};
use documents::laws::{LawRow, LawStatus};
use laws::rheology::BaseLaw;
use posterior::monitor::Monitor;
use posterior::study::ModelSpecification;

use crate::target::ModelRequest;

/// Smallest difference of log evidences, in nats, that distinguishes two laws: a Bayes factor of 20 (Kass and Raftery, *JASA* 90, 773, 1995, "strong").
const DECISIVE_NATS: f64 = 3.0;
/// Prior of all laws if none is given. A prior of one law's parameters would give that law an advantage.
const WIDE_PRIOR: &str = "generic";
/// End of a sentence on laws that are ranked by their errors although one of them explains the record.
pub(super) const DOES_NOT_PREDICT: &str =
    "The laws are ranked by this error, since the law with the largest evidence does not predict.";
/// End of a sentence on laws of which none explains the record.
pub(super) const SAYS_LITTLE: &str =
    "The laws are ranked by this error, since the evidence of laws that do not fit says little.";

/// Model of a base law without effects.
pub(super) fn specification(law: &str, request: &ModelRequest) -> Result<ModelSpecification> {
    let prior = request.prior.as_deref().unwrap_or(WIDE_PRIOR);
    ModelSpecification::default().with_options(Some(law), &[], &request.noise, Some(prior), &request.set)
}

/// Models of all named laws without effects, with wide priors.
///
/// # Errors
/// As [`specification`].
pub(super) fn all_laws() -> Result<Vec<(String, ModelSpecification)>> {
    BaseLaw::names().map(|name| Ok((name.to_string(), specification(name, &ModelRequest::default())?))).collect()
}

/// Rows of all laws. A law that cannot be fitted has the reason in its row.
pub(super) fn rows_of<S>(
    subjects: &[(String, S)],
    monitor: &dyn Monitor,
    row: impl Fn(&str, &S) -> Result<LawRow>,
) -> Result<Vec<LawRow>> {
    let of_law = |(place, (name, subject)): (usize, &(String, S))| {
        monitor.stage(&format!("law {} of {}: {name}", place + 1, subjects.len()));
        monitor.progress(place, subjects.len());
        match row(name, subject) {
            Err(Error::Numerical { what, .. }) => Ok(not_compared(name, what)),
            other => other,
        }
    };
    subjects.iter().enumerate().map(of_law).collect()
}

pub(super) fn not_compared(name: &str, why: String) -> LawRow {
    LawRow {
        law: name.into(),
        status: LawStatus::NotCompared,
        reason: Some(why),
        evidence_difference_nats: None,
        evidence_standard_error_nats: None,
        rmse_fitted_um: None,
        rmse_heldout_um: None,
        heldout_over_expected: None,
        misfit: None,
        parameters: Vec::new(),
    }
}

/// Laws in the order of their errors (`rows`), or of their evidence where that names a law which predicts, with the answer whether the best law explains the record.
///
/// # Errors
/// Those of `by_evidence`, which is called only if a law may explain the record.
pub(super) fn ranked(
    mut rows: Vec<LawRow>,
    by_evidence: impl FnOnce(&[LawRow]) -> Result<Vec<LawRow>>,
    is_explained: impl Fn(&LawRow) -> Option<bool>,
) -> Result<(Vec<LawRow>, Option<bool>)> {
    rank_by_error(&mut rows);
    let of_best = |rows: &[LawRow]| rows.first().and_then(&is_explained);
    let explained = of_best(&rows);
    if explained != Some(false) {
        let mut by_evidence = by_evidence(&rows)?;
        rank(&mut by_evidence);
        // Evidence that prefers a law which does not predict is that of its noise terms.
        if of_best(&by_evidence) != Some(false) {
            rows = by_evidence;
        }
    }
    Ok((rows, explained))
}

/// Explaining law with the fewest parameters, unless the law of the study explains the record, too.
pub(super) fn simplest<'a>(explaining: impl Iterator<Item = &'a LawRow>, of_study: &str) -> Option<&'a LawRow> {
    explaining.min_by_key(|row| (row.law != of_study, BaseLaw::named(&row.law).map(|law| law.parameters().len())))
}

/// Sorts the laws by falling evidence, makes the evidences relative to the largest, and sets the status of each law.
pub(super) fn rank(rows: &mut [LawRow]) {
    let known = |row: &LawRow| row.evidence_difference_nats.unwrap_or(f64::NEG_INFINITY);
    rows.sort_by(|a, b| known(b).total_cmp(&known(a)));
    let best = rows.first().map_or(0.0, known);
    let best_error = rows.first().and_then(|row| row.evidence_standard_error_nats).unwrap_or(0.0);
    for (place, row) in rows.iter_mut().enumerate() {
        let (Some(difference), Some(error)) = (&mut row.evidence_difference_nats, row.evidence_standard_error_nats)
        else {
            continue;
        };
        *difference -= best;
        let is_near = -*difference <= DECISIVE_NATS.max(2.0 * best_error.hypot(error));
        row.status = match (place, is_near) {
            (0, _) => LawStatus::Likeliest,
            (_, true) => LawStatus::Indistinguishable,
            (_, false) => LawStatus::LessLikely,
        };
    }
}

/// Sorts laws by their errors, and names the closest one. The evidence of laws that do not explain a record compares the noise terms that absorb the misfits.
pub(super) fn rank_by_error(rows: &mut [LawRow]) {
    let error = |row: &LawRow| row.ranking_error().unwrap_or(f64::INFINITY);
    rows.sort_by(|a, b| error(a).total_cmp(&error(b)));
    let fitted = rows.iter_mut().filter(|row| row.errors()[0].is_some());
    fitted
        .enumerate()
        .for_each(|(place, row)| row.status = if place == 0 { LawStatus::Closest } else { LawStatus::FartherOff });
}

/// First law with a status.
pub(super) fn first(rows: &[LawRow], status: LawStatus) -> Option<&LawRow> {
    rows.iter().find(|row| row.status == status)
}

/// Sentences on laws that are ranked by their evidence. `of_best` is the sentence on the error of the likeliest law.
pub(super) fn sentence_by_evidence(rows: &[LawRow], of_best: impl Fn(&LawRow) -> String) -> String {
    let Some(best) = first(rows, LawStatus::Likeliest) else {
        return "No law could be compared.".into();
    };
    let with = |status: LawStatus| rows.iter().filter(move |row| row.status == status);
    let near: Vec<&str> = with(LawStatus::Indistinguishable).map(|row| row.law.as_str()).collect();
    let next = first(rows, LawStatus::LessLikely).and_then(|row| row.evidence_difference_nats);
    let mut text = match (near.as_slice(), next) {
        ([], None) => format!("{} is the only law that was compared.", best.law),
        ([], Some(next)) => format!("{} is the likeliest law, by {:.1} nats.", best.law, -next),
        (near, _) => format!("The record cannot distinguish {} from {}.", best.law, near.join(", ")),
    };
    text += &of_best(best);
    // A law without evidence may be the best one.
    let fitted = |row: &LawRow| row.errors()[0];
    let is_better = |row: &&LawRow| fitted(row).zip(fitted(best)).is_some_and(|(other, best)| other < best);
    let better: Vec<&str> = with(LawStatus::NotCompared).filter(is_better).map(|row| row.law.as_str()).collect();
    if !better.is_empty() {
        text += &format!(" The evidence of {} could not be computed, and the fit is closer.", better.join(", "));
    }
    text
}
