//! `compare --laws`: fits several base laws to one record and compares their evidence and their errors on the last cycle.

use std::path::Path;

use base::error::{Error, Result};
use base::files::{self, to_json};
use criticism::evidence::evidence;
use criticism::predicted::distance_from_prediction;
use criticism::{Fitted, Search, Subject};
use documents::laws::{LawComparison, LawRow, LawStatus};
use figures::svg::figure_files;
use laws::rheology::BaseLaw;
use models::effects::Library;
use posterior::misfit::NOISE_FACTOR;
use posterior::monitor::Monitor;
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;
use posterior::study::{LAWS_NAME, ModelSpecification, WithProvenance};
use record::Experiment;

use crate::outcome::Outcome;
use crate::target::{ModelRequest, Target};

/// Largest number of positions that laws are fitted to. A law with two springpots takes a second for a hundred thousand trajectories of so many rows.
const MOST_ROWS: usize = 400;
/// Smallest difference of log evidences, in nats, that distinguishes two laws: a Bayes factor of 20 (Kass and Raftery, *JASA* 90, 773, 1995, "strong").
const DECISIVE_NATS: f64 = 3.0;
/// Prior of all laws if none is given. A prior of one law's parameters would give that law an advantage.
const WIDE_PRIOR: &str = "generic";

/// Settings of the comparison that the caller chooses.
pub struct LawsRequest {
    /// Names or files of the laws. An empty list selects all laws that have a name.
    pub laws: Vec<String>,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// Compares base laws on a creep or relaxation record by their evidence, or by their errors if none explains the record, and writes the comparison into the record's study. The laws have no effects. All have the same priors of the noise,
/// and wide priors of their parameters unless the target names a prior.
///
/// # Errors
/// [`Error::Input`] for other targets, an unknown law or a prior that a law cannot use; [`Error::Numerical`] if no law can be fitted.
pub fn run(target: &Target, request: &LawsRequest, monitor: &dyn Monitor) -> Result<Outcome<LawComparison>> {
    let target = target.creep()?;
    target.check(monitor)?;
    let names: Vec<String> = match request.laws.as_slice() {
        [] => BaseLaw::names().map(String::from).collect(),
        given => given.to_vec(),
    };
    let of_law = |name: &String| Ok((name.clone(), specification(name, &target.request)?));
    let specifications: Vec<(String, ModelSpecification)> = names.iter().map(of_law).collect::<Result<_>>()?;
    let first = specifications[0].1.clone();
    let problem = Problem::new(target.experiment.clone(), first, target.request.mesh.as_ref(), monitor)?;
    let subjects = subjects(&problem, specifications, monitor)?;
    let subject = &subjects[0].1;
    let (n_fitted, experiment) = (subject.n_fitted(), subject.experiment().clone());
    let noise_um = noise_um(&target.experiment);
    let mut rows = rows_by_error(&subjects, monitor)?;
    let is_explained = rows.first().and_then(|row| self::is_explained(row, noise_um));
    if is_explained != Some(false) {
        let mut by_evidence = rows_of(&subjects, monitor, |name, subject| with_evidence(name, subject, request.seed))?;
        rank(&mut by_evidence);
        // Evidence that prefers a law which does not predict is that of its noise terms.
        if by_evidence.first().and_then(|row| self::is_explained(row, noise_um)) != Some(false) {
            rows = by_evidence;
        }
    }
    let sentence = sentence(&rows, noise_um);
    let body = LawComparison {
        experiment: experiment.specimen_id.clone(),
        fitted_cycles: experiment.calibration_cycles.clone(),
        heldout_cycles: experiment.heldout_cycles.clone(),
        n_fitted,
        noise_um,
        is_explained,
        laws: rows,
        sentence,
    };
    monitor.stage("writing results and figures");
    let study = target.make_study()?;
    let quantities = target.experiment.quantities();
    let provenance = study.provenance("laws", 1, request.seed).with_quantities(quantities);
    let document = WithProvenance { provenance, body };
    let [svg, png, pdf] =
        figure_files(study.dir(), "laws", &figures::laws::laws(&document.body).translated(quantities))?;
    let path = study.dir().join(LAWS_NAME);
    let json = (path.clone(), to_json(&path, &document)?);
    let all: [(&Path, &[u8]); 4] = [&svg, &png, &pdf, &json].map(|(path, bytes)| (path.as_path(), bytes.as_slice()));
    files::write_together(&all)?;
    let has_page = !study.revisions()?.is_empty();
    let is_sound = is_explained == Some(true);
    Ok(Outcome { is_sound, document, written: svg.0, study: has_page.then_some(study) })
}

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
    let of_law = |name: &str| Ok((name.to_string(), specification(name, &ModelRequest::default())?));
    let specifications = BaseLaw::names().map(of_law).collect::<Result<_>>()?;
    let subjects = subjects(problem, specifications, monitor)?;
    let rows = rows_by_error(&subjects, monitor)?;
    let explaining = rows.iter().filter(|row| is_explained(row, Some(noise_um)) == Some(true));
    // The study's own law comes first: its prior is then the fault.
    let of_study = problem.model.base().name();
    let order = |row: &&LawRow| (row.law != of_study, BaseLaw::named(&row.law).map(|law| law.parameters().len()));
    let simplest = explaining.min_by_key(order);
    Ok(simplest.map(|row| ExplainingLaw {
        law: row.law.clone(),
        sentence: explains(row, noise_um),
        error_um: error_um(row).unwrap_or(f64::INFINITY),
    }))
}

/// Model of a base law without effects.
fn specification(law: &str, request: &ModelRequest) -> Result<ModelSpecification> {
    let prior = request.prior.as_deref().unwrap_or(WIDE_PRIOR);
    ModelSpecification::default().with_options(Some(law), &[], &request.noise, Some(prior), &request.set)
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

/// Rows of fitted laws, the closest first. They are fitted without slow noise and gains, which would absorb misfits.
fn rows_by_error(subjects: &[(String, Subject)], monitor: &dyn Monitor) -> Result<Vec<LawRow>> {
    let mut rows =
        rows_of(subjects, monitor, |name, subject| Ok(fitted(name, &subject.clone().with_specified_noise())?.0))?;
    rank_by_error(&mut rows);
    Ok(rows)
}

/// Rows of all laws. A law that cannot be fitted has the reason in its row.
fn rows_of(
    subjects: &[(String, Subject)],
    monitor: &dyn Monitor,
    row: impl Fn(&str, &Subject) -> Result<LawRow>,
) -> Result<Vec<LawRow>> {
    let of_law = |(place, (name, subject)): (usize, &(String, Subject))| {
        monitor.stage(&format!("law {} of {}: {name}", place + 1, subjects.len()));
        monitor.progress(place, subjects.len());
        match row(name, subject) {
            Err(Error::Numerical { what, .. }) => Ok(not_compared(name, what)),
            other => other,
        }
    };
    subjects.iter().enumerate().map(of_law).collect()
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

fn not_compared(name: &str, why: String) -> LawRow {
    LawRow {
        law: name.into(),
        status: LawStatus::NotCompared,
        reason: Some(why),
        evidence_difference_nats: None,
        evidence_standard_error_nats: None,
        rmse_fitted_um: None,
        rmse_heldout_um: None,
        heldout_over_expected: None,
        parameters: Vec::new(),
    }
}

/// Sorts the laws by falling evidence, makes the evidences relative to the largest, and sets the status of each law.
fn rank(rows: &mut [LawRow]) {
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

/// Root mean square residual (µm) on the scored cycle; on the fitted rows if no cycle is held out.
fn error_um(row: &LawRow) -> Option<f64> {
    row.rmse_heldout_um.or(row.rmse_fitted_um)
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

/// Sorts laws by their errors, and names the closest one. The evidence of laws that do not explain a record compares the noise terms that absorb the misfits.
fn rank_by_error(rows: &mut [LawRow]) {
    let error = |row: &LawRow| error_um(row).unwrap_or(f64::INFINITY);
    rows.sort_by(|a, b| error(a).total_cmp(&error(b)));
    let fitted = rows.iter_mut().filter(|row| row.rmse_fitted_um.is_some());
    fitted
        .enumerate()
        .for_each(|(place, row)| row.status = if place == 0 { LawStatus::Closest } else { LawStatus::FartherOff });
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
    let ratio = error_um(row).unwrap_or(f64::NAN) / noise_um;
    let expected = match row.heldout_over_expected {
        Some(expected) if ratio > NOISE_FACTOR => {
            format!(", and with the uncertainty of its parameters {expected:.2} times")
        }
        _ => String::new(),
    };
    format!("{} explains the record: its error on {} is {ratio:.2} times the noise{expected}.", row.law, scored(row))
}

fn sentence(rows: &[LawRow], noise_um: Option<f64>) -> String {
    let with = |status: LawStatus| rows.iter().filter(move |row| row.status == status);
    if let (Some(best), Some(noise_um)) = (with(LawStatus::Closest).next(), noise_um) {
        let ratio = error_um(best).unwrap_or(f64::NAN) / noise_um;
        if is_explained(best, Some(noise_um)) == Some(true) {
            let explains = explains(best, noise_um);
            return format!(
                "{explains} The laws are ranked by this error, since the law with the largest evidence does not predict."
            );
        }
        let times = |ratio: f64| format!("{ratio:.digits$} times the noise", digits = if ratio < 10.0 { 1 } else { 0 });
        let fitted = best
            .rmse_heldout_um
            .and(best.rmse_fitted_um)
            .map_or(String::new(), |fitted_um| format!(", and on the fitted rows {}", times(fitted_um / noise_um)));
        return format!(
            "No law explains the record. {} is the closest: its error on {} is {}{fitted}. The laws are ranked by this error, since the evidence of laws that do not fit says little.",
            best.law,
            scored(best),
            times(ratio)
        );
    }
    let Some(best) = with(LawStatus::Likeliest).next() else {
        return "No law could be compared.".into();
    };
    let near: Vec<&str> = with(LawStatus::Indistinguishable).map(|row| row.law.as_str()).collect();
    let next = with(LawStatus::LessLikely).next().and_then(|row| row.evidence_difference_nats);
    let mut text = match (near.as_slice(), next) {
        ([], None) => format!("{} is the only law that was compared.", best.law),
        ([], Some(next)) => format!("{} is the likeliest law, by {:.1} nats.", best.law, -next),
        (near, _) => format!("The record cannot distinguish {} from {}.", best.law, near.join(", ")),
    };
    text += &match (error_um(best), noise_um) {
        (Some(error_um), Some(noise_um)) => {
            format!(" The error of {} on {} is {:.2} times the noise.", best.law, scored(best), error_um / noise_um)
        }
        _ => " The noise is unknown, so it is open whether any law explains the record.".into(),
    };
    // A law without evidence may be the best one.
    let is_better =
        |row: &&LawRow| row.rmse_fitted_um.zip(best.rmse_fitted_um).is_some_and(|(other, best)| other < best);
    let better: Vec<&str> = with(LawStatus::NotCompared).filter(is_better).map(|row| row.law.as_str()).collect();
    if !better.is_empty() {
        text += &format!(" The evidence of {} could not be computed, and the fit is closer.", better.join(", "));
    }
    text
}

#[cfg(test)]
mod tests {
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
