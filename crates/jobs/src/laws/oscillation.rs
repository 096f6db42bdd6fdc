//! Comparison of base laws on an oscillation.

use base::error::{Error, Result};
use criticism::evidence::summary;
use documents::laws::{LawComparison, LawRow, LawStatus};
use documents::oscillation::OscillationMisfit;
use models::effects::Library;
use posterior::monitor::Monitor;
use posterior::study::ModelSpecification;
use record::OscillationRecord;
use sampling::evidence::{Estimate, PriorCoordinates, estimate};
use sampling::optimum::find_modes;

use super::ranking::{
    DOES_NOT_PREDICT, SAYS_LITTLE, all_laws, first, not_compared, ranked, rows_of, sentence_by_evidence, simplest,
};
use crate::sweep::job::{REPEATS_DIFFER, SEVERAL_GELS, frequencies, misfit, no_fit};
use crate::sweep::noise_like::{LEAST_P, test_residuals};
use crate::sweep::problem::SweepProblem;

/// Number of climbs, from points of the prior, to the modes of a law's posterior.
const N_CLIMBS: usize = 48;

/// Compares laws on an oscillation.
///
/// # Errors
/// As [`SweepProblem::new`], and those of fitting.
pub(super) fn compare(
    sweep: &OscillationRecord,
    specifications: Vec<(String, ModelSpecification)>,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<LawComparison> {
    let problems = problems(sweep, specifications)?;
    let by_error = rows_of(&problems, monitor, |name, problem| fitted(name, problem, seed))?;
    let by_evidence = |rows: &[LawRow]| {
        rows_of(&problems, monitor, |name, problem| {
            let row = rows.iter().find(|row| row.law == name).filter(|row| row.misfit.is_some());
            row.map_or(Ok(not_compared(name, "the law cannot be fitted".into())), |row| {
                with_evidence(row, problem, seed)
            })
        })
    };
    let (laws, is_explained) = ranked(by_error, by_evidence, is_explained)?;
    let frequencies = frequencies(&problems[0].1);
    Ok(LawComparison {
        experiment: sweep.specimen_id.clone(),
        fitted_cycles: Vec::new(),
        heldout_cycles: Vec::new(),
        n_fitted: frequencies.fitted,
        frequencies: Some(frequencies),
        noise_um: None,
        is_explained,
        sentence: sentence(&laws),
        laws,
    })
}

/// Finds the named base law with the fewest parameters that explains an oscillation and leaves less than `left`, the misfit of the best model so far. Returns its name and a sentence
/// that begins with it.
///
/// # Errors
/// Those of fitting.
pub fn find_explaining_law(
    problem: &SweepProblem,
    left: &OscillationMisfit,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Option<(String, String)>> {
    let problems = problems(&problem.sweep, all_laws()?)?;
    let rows = rows_of(&problems, monitor, |name, problem| fitted(name, problem, seed))?;
    let is_closer = |row: &&LawRow| row.misfit.as_ref().is_some_and(|own| own.relative_fitted < left.relative_fitted);
    let explaining = rows.iter().filter(|row| is_explained(row) == Some(true)).filter(is_closer);
    let simplest = simplest(explaining, problem.model.base().name());
    Ok(simplest.and_then(|row| Some((row.law.clone(), explains(&row.law, row.misfit.as_ref()?)))))
}

fn problems(
    sweep: &OscillationRecord,
    specifications: Vec<(String, ModelSpecification)>,
) -> Result<Vec<(String, SweepProblem)>> {
    let library = Library::default();
    let of_law = |(name, specification)| Ok((name, SweepProblem::new(sweep.clone(), specification, &library)?));
    specifications.into_iter().map(of_law).collect()
}

/// Fits a law and tests its residuals.
///
/// # Errors
/// [`Error::Numerical`] if the law cannot be fitted.
fn fitted(name: &str, problem: &SweepProblem, seed: u64) -> Result<LawRow> {
    let fit = problem.fit(seed, &[])?.ok_or_else(no_fit)?;
    let left = test_residuals(problem, &fit, seed)?.ok_or_else(no_fit)?;
    let predicted = problem.predict(&fit.values).ok_or_else(no_fit)?;
    let misfit = misfit(problem, &predicted, &fit, &left);
    Ok(LawRow { misfit: Some(misfit), reason: None, ..not_compared(name, String::new()) })
}

/// Adds the evidence of a law to its row. A law whose evidence cannot be computed keeps its errors.
fn with_evidence(row: &LawRow, problem: &SweepProblem, seed: u64) -> Result<LawRow> {
    let seen = PriorCoordinates::new(problem, problem.priors.distributions());
    let mut row = LawRow { status: LawStatus::NotCompared, ..row.clone() };
    match evidence(problem, &seen, seed) {
        Ok(found) => {
            row.status = LawStatus::LessLikely;
            row.evidence_difference_nats = Some(found.ln_evidence);
            row.evidence_standard_error_nats = Some(found.standard_error);
            let of_law = |name: &str| problem.model.parameters().iter().any(|spec| spec.name == name);
            let sampled = problem.priors.names().enumerate().filter(|(_, name)| of_law(name));
            row.parameters =
                sampled.map(|(d, name)| summary(&found.draws, name, |point| seen.natural(d, point[d]))).collect();
        }
        Err(Error::Numerical { what, .. }) => row.reason = Some(what),
        Err(other) => return Err(other),
    }
    Ok(row)
}

fn evidence(problem: &SweepProblem, seen: &PriorCoordinates, seed: u64) -> Result<Estimate> {
    let natural = |start: &Vec<f64>| -> Vec<f64> {
        let priors = problem.priors.distributions().zip(start).enumerate();
        priors.map(|(d, (prior, z))| seen.from_natural(d, prior.from_unconstrained(*z))).collect()
    };
    let climbs: Vec<Vec<f64>> = problem.starts(seed, N_CLIMBS).iter().map(natural).collect();
    estimate(seen, &find_modes(seen, &climbs)?, seed)
}

/// True if the residuals of a law are consistent with measurement errors. `None` without a fit.
fn is_explained(row: &LawRow) -> Option<bool> {
    row.misfit.as_ref().map(|misfit| misfit.p >= LEAST_P)
}

/// Error of a law, with the rows that it stands for.
fn error_words(misfit: &OscillationMisfit) -> String {
    let (share, rows) = match misfit.relative_heldout {
        Some(share) => (share, "the held-out frequencies"),
        None => (misfit.relative_fitted, "the fitted frequencies, since none is held out,"),
    };
    format!("on {rows} is {:.2} % of |G*|", 100.0 * share)
}

/// Sentence on a law whose residuals are noise.
fn explains(law: &str, misfit: &OscillationMisfit) -> String {
    format!(
        "{law} explains the record: its error {}, and its residuals are noise (p = {:.2}).",
        error_words(misfit),
        misfit.p
    )
}

fn sentence(rows: &[LawRow]) -> String {
    if let Some((best, misfit)) = first(rows, LawStatus::Closest).and_then(|row| Some((row, row.misfit.as_ref()?))) {
        if misfit.p >= LEAST_P {
            return format!("{} {DOES_NOT_PREDICT}", explains(&best.law, misfit));
        }
        if misfit.repeats_differ {
            return format!("No law explains that {REPEATS_DIFFER} (p = {:.3}): {SEVERAL_GELS}.", misfit.p);
        }
        return format!(
            "No law explains the record. {} is the closest: its error {}, and its residuals are not noise (p = {:.3}). {SAYS_LITTLE}",
            best.law,
            error_words(misfit),
            misfit.p
        );
    }
    sentence_by_evidence(rows, |best| match &best.misfit {
        Some(misfit) => {
            format!(
                " The error of {} {}, and its residuals are noise (p = {:.2}).",
                best.law,
                error_words(misfit),
                misfit.p
            )
        }
        None => String::new(),
    })
}
