//! Comparison of base laws on a record over time.

use base::error::{Error, Result};
use criticism::evidence::evidence;
use criticism::predicted::distance_from_prediction;
use criticism::{Fitted, Search, Subject};
use documents::laws::{LawComparison, LawRow, LawStatus};
use models::effects::Library;
use posterior::misfit::NOISE_FACTOR;
use posterior::monitor::Monitor;
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;
use posterior::study::ModelSpecification;
use record::Experiment;

use super::ranking::{
    DOES_NOT_PREDICT, SAYS_LITTLE, all_laws, first, not_compared, ranked, rows_of, sentence_by_evidence, simplest,
};
use crate::target::CreepTarget;

/// Largest number of positions that laws are fitted to. A law with two springpots takes a second for a hundred thousand trajectories of so many rows.
const MOST_ROWS: usize = 400;

/// Compares laws on a creep or relaxation record.
///
/// # Errors
/// Errors of preparing the laws' models.
pub(super) fn compare(
    target: &CreepTarget,
    specifications: Vec<(String, ModelSpecification)>,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<LawComparison> {
    let first = specifications[0].1.clone();
    let problem = Problem::new(target.experiment.clone(), first, target.request.mesh.as_ref(), monitor)?;
    let subjects = subjects(&problem, specifications, monitor)?;
    let subject = &subjects[0].1;
    let experiment = subject.experiment();
    let noise_um = noise_um(&target.experiment);
    let by_evidence = |_: &[LawRow]| rows_of(&subjects, monitor, |name, subject| with_evidence(name, subject, seed));
    let (laws, is_explained) =
        ranked(rows_by_error(&subjects, monitor)?, by_evidence, |row| is_explained(row, noise_um))?;
    Ok(LawComparison {
        experiment: experiment.specimen_id.clone(),
        fitted_cycles: experiment.calibration_cycles.clone(),
        heldout_cycles: experiment.heldout_cycles.clone(),
        frequencies: None,
        n_fitted: subject.n_fitted(),
        noise_um,
        is_explained,
        sentence: sentence(&laws, noise_um),
        laws,
    })
}

/// Least ratio of the error that a study leaves to that of a law that explains the record.
const LESS: f64 = 1.1;

/// Base law that explains a record without an effect.
pub struct ExplainingLaw {
    /// Name of the law.
    pub law: String,
    /// Sentence on its error, which begins with its name.
    pub sentence: String,
    /// Its error on the scored cycle, or on the fitted ones if none is scored, in µm.
    pub error_um: f64,
}

/// Finds a named base law that explains a record without an effect, where a model that leaves errors of `left_um` does not: the problem's own law, or else the one with the
/// fewest parameters. All have wide priors.
///
/// # Errors
/// Errors of preparing the laws' models.
pub fn find_explaining_law(problem: &Problem, left_um: f64, monitor: &dyn Monitor) -> Result<Option<ExplainingLaw>> {
    let Some(noise_um) = noise_um(&problem.experiment) else { return Ok(None) };
    if left_um <= NOISE_FACTOR * noise_um || problem.outside_forward().is_some() {
        return Ok(None);
    }
    let subjects = subjects(problem, all_laws()?, monitor)?;
    let rows = rows_by_error(&subjects, monitor)?;
    // A law whose error is that of the study explains nothing more, whatever the uncertainty of its parameters allows.
    let is_better = |row: &LawRow| row.ranking_error().is_some_and(|error_um| LESS * error_um < left_um);
    let explaining = rows.iter().filter(|row| is_explained(row, Some(noise_um)) == Some(true) && is_better(row));
    // The study's own law comes first: its prior is then the fault.
    Ok(simplest(explaining, problem.model.base().name()).map(|row| ExplainingLaw {
        law: row.law.clone(),
        sentence: explains(row, noise_um),
        error_um: row.ranking_error().unwrap_or(f64::INFINITY),
    }))
}

/// Models of laws on the record and the mechanics of a problem, each with the name of its law.
fn subjects(
    problem: &Problem,
    specifications: Vec<(String, ModelSpecification)>,
    monitor: &dyn Monitor,
) -> Result<Vec<(String, Subject)>> {
    let library = Library::default();
    let mut subjects: Vec<(String, Subject)> = Vec::new();
    let mut compliance = None;
    for (name, specification) in specifications {
        let problem = problem.with_model(specification, &library)?;
        // The geometry of the experiment is that of all laws.
        let known = match &compliance {
            Some(known) => known,
            None => compliance.insert(PreparedModel::unverified(&problem, None, monitor)?.compliance),
        };
        let subject = Subject::with_compliance(&problem, &library, known.clone())?;
        subjects.push((name, subject.thinned(MOST_ROWS)?.unwrap_or(subject)));
    }
    Ok(subjects)
}

/// Rows of laws that are fitted without slow noise and gains, which would absorb misfits.
fn rows_by_error(subjects: &[(String, Subject)], monitor: &dyn Monitor) -> Result<Vec<LawRow>> {
    rows_of(subjects, monitor, |name, subject| Ok(fitted(name, &subject.clone().with_specified_noise())?.0))
}

/// Fits a law, and returns its row without evidence, and the fit.
///
/// # Errors
/// [`Error::Numerical`] if the law cannot be fitted.
fn fitted(name: &str, subject: &Subject) -> Result<(LawRow, Fitted)> {
    let fitted = subject.fit(&subject.base(), &[], Search::Wide)?;
    let in_um = |positions_m: &[Option<f64>]| Some(1e6 * fitted.rmse_m(positions_m)?);
    let row = LawRow {
        rmse_fitted_um: in_um(&subject.fitted_m),
        rmse_heldout_um: in_um(&subject.scored_m),
        heldout_over_expected: distance_from_prediction(subject, (&subject.base(), &fitted)),
        reason: None,
        ..not_compared(name, String::new())
    };
    Ok((row, fitted))
}

/// Fits a law and computes its evidence. A law whose evidence cannot be computed keeps its errors.
///
/// # Errors
/// [`Error::Numerical`] if the law cannot be fitted.
fn with_evidence(name: &str, subject: &Subject, seed: u64) -> Result<LawRow> {
    let (mut row, fitted) = fitted(name, subject)?;
    match evidence(subject, &subject.base(), &fitted, seed) {
        Ok(found) => {
            row.status = LawStatus::LessLikely;
            row.evidence_difference_nats = Some(found.ln_evidence);
            row.evidence_standard_error_nats = Some(found.standard_error);
            row.parameters = found.parameters;
        }
        Err(Error::Numerical { what, .. }) => row.reason = Some(what),
        Err(other) => return Err(other),
    }
    Ok(row)
}

/// True if the fitted rows show only noise, and the scored rows only noise and uncertain parameters. `None` if the noise is unknown.
fn is_explained(row: &LawRow, noise_um: Option<f64>) -> Option<bool> {
    let over_noise = |error_um: f64| noise_um.map(|noise_um| error_um / noise_um);
    // Parameters whose uncertainty is unknown explain nothing.
    let heldout = row.heldout_over_expected.or(row.rmse_heldout_um.and_then(over_noise)).unwrap_or(0.0);
    Some(heldout.max(over_noise(row.rmse_fitted_um?)?) <= NOISE_FACTOR)
}

/// Noise (µm) of all rows, as in other commands: rows that are farther apart give another estimate.
fn noise_um(experiment: &Experiment) -> Option<f64> {
    experiment.reference_noise().map(|reference| 1e6 * reference.sd_m)
}

/// Rows on which the error of a law is computed.
fn scored(row: &LawRow) -> &'static str {
    if row.rmse_heldout_um.is_some() {
        "the last cycle, which no fit has seen,"
    } else {
        "the fitted rows, since no cycle is held out,"
    }
}

/// Sentence on a law that explains the record.
fn explains(row: &LawRow, noise_um: f64) -> String {
    let ratio = row.ranking_error().unwrap_or(f64::NAN) / noise_um;
    let expected = match row.heldout_over_expected {
        Some(expected) if ratio > NOISE_FACTOR => {
            format!(", and with the uncertainty of its parameters {expected:.2} times")
        }
        _ => String::new(),
    };
    format!("{} explains the record: its error on {} is {ratio:.2} times the noise{expected}.", row.law, scored(row))
}

fn sentence(rows: &[LawRow], noise_um: Option<f64>) -> String {
    if let (Some(best), Some(noise_um)) = (first(rows, LawStatus::Closest), noise_um) {
        let ratio = best.ranking_error().unwrap_or(f64::NAN) / noise_um;
        if is_explained(best, Some(noise_um)) == Some(true) {
            let explains = explains(best, noise_um);
            return format!("{explains} {DOES_NOT_PREDICT}");
        }
        let times = |ratio: f64| format!("{ratio:.digits$} times the noise", digits = if ratio < 10.0 { 1 } else { 0 });
        let fitted = best
            .rmse_heldout_um
            .and(best.rmse_fitted_um)
            .map_or(String::new(), |fitted_um| format!(", and on the fitted rows {}", times(fitted_um / noise_um)));
        return format!(
            "No law explains the record. {} is the closest: its error on {} is {}{fitted}. {SAYS_LITTLE}",
            best.law,
            scored(best),
            times(ratio)
        );
    }
    sentence_by_evidence(rows, |best| match (best.ranking_error(), noise_um) {
        (Some(error_um), Some(noise_um)) => {
            format!(" The error of {} on {} is {:.2} times the noise.", best.law, scored(best), error_um / noise_um)
        }
        _ => " The noise is unknown, so it is open whether any law explains the record.".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::ranking::{rank, rank_by_error};
    use super::*;

    fn row(law: &str, evidence: f64, error: f64) -> LawRow {
        LawRow {
            evidence_difference_nats: Some(evidence),
            evidence_standard_error_nats: Some(error),
            rmse_fitted_um: Some(4.0),
            rmse_heldout_um: Some(4.0),
            reason: None,
            ..not_compared(law, String::new())
        }
    }

    #[test]
    fn laws_are_told_apart_by_their_evidence_and_its_error() {
        let mut rows =
            vec![row("a", 90.0, 0.1), not_compared("b", "no fit".into()), row("c", 100.0, 0.1), row("d", 99.0, 0.1)];
        rank(&mut rows);
        let found: Vec<_> =
            rows.iter().map(|row| (row.law.as_str(), row.status, row.evidence_difference_nats)).collect();
        assert_eq!(
            found,
            [
                ("c", LawStatus::Likeliest, Some(0.0)),
                ("d", LawStatus::Indistinguishable, Some(-1.0)),
                ("a", LawStatus::LessLikely, Some(-10.0)),
                ("b", LawStatus::NotCompared, None),
            ]
        );
        assert_eq!(
            sentence(&rows, Some(4.0)),
            "The record cannot distinguish c from d. The error of c on the last cycle, which no fit has seen, is 1.00 times the noise."
        );
        assert_eq!(
            [Some(4.0), Some(1.0), None].map(|noise_um| is_explained(&rows[0], noise_um)),
            [Some(true), Some(false), None]
        );
        // Parameters that are known badly explain an error beyond the noise, but not one beyond their uncertainty.
        for (expected, is_so) in [(Some(1.1), true), (Some(1.6), false), (None, false)] {
            let row = LawRow { rmse_heldout_um: Some(9.0), heldout_over_expected: expected, ..rows[0].clone() };
            assert_eq!(is_explained(&row, Some(4.0)), Some(is_so));
        }
        let mut rows = vec![row("a", 0.0, 3.0), row("b", -7.0, 3.0)];
        rank(&mut rows);
        assert_eq!(rows[1].status, LawStatus::Indistinguishable);
        let mut rows = vec![row("a", 0.0, 0.1), row("b", -7.0, 0.1)];
        rank(&mut rows);
        assert!(sentence(&rows, None).starts_with("a is the likeliest law, by 7.0 nats. The noise is unknown"));
    }

    /// The evidence of laws that leave more than the noise compares noise terms. Errors then rank the laws.
    #[test]
    fn laws_that_do_not_explain_a_record_are_ranked_by_their_errors() {
        let mut rows = vec![row("c", 100.0, 0.1), not_compared("b", "no fit".into()), row("a", 90.0, 0.1)];
        rows[2].rmse_heldout_um = Some(2.0);
        rank_by_error(&mut rows);
        let found: Vec<_> = rows.iter().map(|row| (row.law.as_str(), row.status)).collect();
        assert_eq!(found, [("a", LawStatus::Closest), ("c", LawStatus::FartherOff), ("b", LawStatus::NotCompared)]);
        let text = sentence(&rows, Some(0.5));
        assert!(
            text.starts_with("No law explains the record. a is the closest") && text.contains("is 4.0 times"),
            "{text}"
        );
    }
}
