//! `diagnose`: finds missing physical effects.

use std::path::Path;
use std::process::ExitCode;

use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::documents::diagnosis::{CHANCE_P, CandidateEntry, Diagnosis, Status, VerdictKind, group_by_reason};
use vitreo_uq::figures::labels::effect_size;
use vitreo_uq::figures::number::format_ranges;
use vitreo_uq::jobs::diagnose::{self, DISCREPANCY_FIGURE, DiagnoseDocument, DiagnoseRequest};
use vitreo_uq::jobs::target::TargetKind;

use crate::options::{self, DiagnoseArguments};
use crate::session::{RESULTS, Session};
use crate::text::{outliers_left_out, significant};

/// Smallest number of simulated records. The first round of the search requires p < 0.05, and each further round half of the previous limit.
const FEWEST_SIMULATIONS: usize = 99;
/// Smallest number of simulated records for each record of a cohort. Fewer do not resolve the tail of the distribution of simulated gains.
const FEWEST_SIMULATIONS_OF_EACH: usize = 19;
/// Minimum and maximum number of candidate effects in the brief table. Effects that the verdict names and their equivalents are always in it.
const MIN_ROWS: usize = 3;
const MAX_ROWS: usize = 8;

pub fn run(arguments: &DiagnoseArguments) -> Result<ExitCode> {
    let session = Session::begin(&arguments.common)?;
    let taken = [TargetKind::Cohort, TargetKind::Oscillation];
    let request = request(arguments, session.kind(&arguments.others, &taken), &session)?;
    let target = session.open(&arguments.model, &arguments.others, &taken)?;
    let outcome = diagnose::run(&target, &request, &session.terminal)?;
    let (words, label) = match &outcome.document.body {
        DiagnoseDocument::Creep(diagnosis) => {
            let study = outcome.written.parent().unwrap_or(&outcome.written);
            let details = if arguments.verbose { Details::All } else { Details::Brief };
            (words(diagnosis, &outcome.name(), study, details), RESULTS)
        }
        DiagnoseDocument::Oscillation(diagnosis) => (crate::sweep::diagnosis_words(diagnosis), "Result"),
        DiagnoseDocument::Cohort(diagnosis) => (crate::cohort::words(diagnosis), RESULTS),
    };
    session.end(&outcome, &words, label, &arguments.page)
}

fn request(arguments: &DiagnoseArguments, kind: TargetKind, session: &Session) -> Result<DiagnoseRequest> {
    let DiagnoseArguments { smallest, simulations, margin, .. } = *arguments;
    let mut keys = Vec::new();
    match kind {
        TargetKind::Cohort => {
            options::check_simulations(simulations, FEWEST_SIMULATIONS_OF_EACH)?;
            if !(margin >= 0.0 && margin.is_finite()) {
                let found = format!("a margin of {margin}");
                return Err(Error::input(
                    InputPlace::default().at_key("--margin"),
                    found,
                    "give a fraction such as 0.2, for 20 %",
                ));
            }
            keys = crate::groups::keys(&arguments.by)?;
        }
        TargetKind::Creep => {
            if !(smallest.is_finite() && smallest >= 0.0) {
                let remedy = "give a number of noise standard deviations, as in `--smallest 0.25`";
                return Err(Error::input(
                    InputPlace::default().at_key("--smallest"),
                    format!("{smallest} is not a valid size"),
                    remedy,
                ));
            }
            options::check_simulations(simulations, FEWEST_SIMULATIONS)?;
        }
        TargetKind::Oscillation | TargetKind::Joint => {}
    }
    let (sampler, leave_out) = (session.default_sampler(), arguments.leave_out.clone());
    Ok(DiagnoseRequest { smallest, simulations, sampler, keys, margin, leave_out })
}

/// Amount of text that `diagnose` prints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Details {
    /// The verdict, the candidate effects that matter, and the next command.
    Brief,
    All,
}

fn words(diagnosis: &Diagnosis, revision: &str, study: &Path, details: Details) -> String {
    let scored = if diagnosis.heldout_cycles.is_empty() {
        "none held out".to_string()
    } else {
        format!("scored on {}", format_ranges(&diagnosis.heldout_cycles))
    };
    let mut lines = vec![
        format!("{} ({revision}): {}", diagnosis.experiment, diagnosis.verdict.sentence),
        format!("(every model fitted to cycles {}, {scored})", format_ranges(&diagnosis.fitted_cycles)),
        String::new(),
    ];
    lines.extend(candidate_lines(diagnosis, details));
    lines.push(String::new());
    lines.extend(unexplained(diagnosis));
    if details == Details::All {
        lines.extend(noise_lines(diagnosis));
    }
    if !diagnosis.separating_protocol.is_empty() {
        lines.push(format!("To distinguish the equivalent effects: {}", diagnosis.separating_protocol));
    }
    lines.extend(outliers_left_out(diagnosis.outlier_rows.len()));
    if details == Details::All {
        lines.extend(detectability_lines(diagnosis));
        lines.extend(diagnosis.remarks.iter().map(|remark| format!("Note: {}.", remark.trim_end_matches('.'))));
    }
    lines.extend(next_lines(diagnosis, study));
    lines.join("\n") + "\n"
}

/// Lines of the table of candidate effects, in order of decreasing gain.
fn candidate_lines(diagnosis: &Diagnosis, details: Details) -> Vec<String> {
    let mut lines = vec![format!(
        "  {:<26}{:>8}{:>11}{:>11}{:>10}{:>9}{:>10}   {}",
        "effect", "score z", "gain", "held-out", "expected", "p", "ln Bayes", "status"
    )];
    let mut candidates: Vec<&CandidateEntry> = diagnosis.candidates.iter().collect();
    candidates.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    let fitted: Vec<&CandidateEntry> =
        candidates.iter().filter(|candidate| candidate.refused.is_none()).copied().collect();
    let shown: Vec<&CandidateEntry> = fitted
        .iter()
        .enumerate()
        .filter(|(rank, candidate)| details == Details::All || is_shown(*rank, candidate, &diagnosis.verdict.effects))
        .map(|(_, candidate)| *candidate)
        .collect();
    lines.extend(shown.iter().map(|candidate| row(diagnosis, candidate)));
    let n_others = fitted.len() - shown.len();
    if n_others > 0 {
        lines.push(format!("  {n_others} other effects; `--verbose` lists them."));
    }
    let error = diagnosis.base.rmse_heldout_um.map_or(String::new(), |um| {
        format!(
            " expected: error in µm on cycle {} ({} without an effect);",
            format_ranges(&diagnosis.heldout_cycles),
            significant(um)
        )
    });
    lines.push(format!("  (gains in nats over the model without the effect;{error} p: chance that a search without any effect gains as much)"));
    lines.extend(diagnosis.gains_without_error().map(|sentence| format!("  {sentence}")));
    if details == Details::All {
        let reasons = group_by_reason(
            candidates.iter().map(|candidate| (candidate.effect.as_str(), candidate.refused.as_deref())),
        );
        lines.extend(
            reasons.iter().map(|(reason, effects)| format!("  not applicable: {}: {reason}", effects.join(", "))),
        );
    }
    if let Some(pair) = diagnosis.pairs.first() {
        lines.push(format!("  best pair of effects: {}, gain {:.1} nats", pair.effects.join(" + "), pair.gain_nats));
    }
    lines
}

/// Returns whether the brief table contains a candidate with this rank by gain. `named` are the effects that the verdict names.
fn is_shown(rank: usize, candidate: &CandidateEntry, named: &[String]) -> bool {
    let is_named = candidate.status == Status::Equivalent || named.contains(&candidate.effect);
    let gains_beyond_chance =
        candidate.status != Status::Invisible && candidate.refit.is_some() && candidate.p_familywise <= CHANCE_P;
    is_named || rank < MIN_ROWS || (rank < MAX_ROWS && gains_beyond_chance)
}

fn noise_lines(diagnosis: &Diagnosis) -> Vec<String> {
    let mut lines = vec!["Noise of a single position".to_string()];
    lines.extend(diagnosis.noise.iter().map(|noise| format!("  {}", noise.text)));
    lines
}

fn detectability_lines(diagnosis: &Diagnosis) -> Vec<String> {
    let mut lines = Vec::new();
    if !diagnosis.blind_spots.is_empty() {
        lines.push(format!("Effects that this experiment cannot detect: {}.", diagnosis.blind_spots.join(", ")));
    }
    let smallest: Vec<String> = diagnosis
        .smallest_detectable
        .iter()
        .filter_map(|entry| Some(format!("{} {}", entry.effect, effect_size(&entry.effect, entry.parameter?))))
        .collect();
    if !smallest.is_empty() {
        lines.push(format!("Smallest detectable sizes: {}.", smallest.join(", ")));
    }
    lines
}

/// Lines with the next commands: the law that explains the record or the claimed effects; other laws if neither does.
fn next_lines(diagnosis: &Diagnosis, study: &Path) -> Vec<String> {
    let study = crate::child::in_shell(study);
    let is_unexplained = diagnosis.verdict.kind == VerdictKind::Unexplained;
    let mut commands = Vec::new();
    if let Some(law) = &diagnosis.verdict.base_law {
        commands.push(format!("sample EXPERIMENT --base {law} --prior generic --out STUDY"));
    }
    if !diagnosis.verdict.effects.is_empty() {
        let remark = if is_unexplained { "    (it explains part of the misfit)" } else { "" };
        commands.push(format!("extend {study} --with {}{remark}", diagnosis.verdict.effects.join(",")));
    }
    if diagnosis.verdict.kind == VerdictKind::Missing && !diagnosis.verdict.equivalent.is_empty() {
        commands.push(format!("design {study}    (a protocol that tells the equivalent effects apart)"));
    }
    if is_unexplained && diagnosis.verdict.base_law.is_none() {
        commands.push(format!("compare {study} --laws    (other base laws, each with its misfit)"));
    }
    let start = |place: usize| if place == 0 { "\nNext:" } else { "     " };
    commands.iter().enumerate().map(|(place, command)| format!("{}  vitreo-uq {command}", start(place))).collect()
}

/// Lines on the misfit that no effect explains: its size, and how much it widens predictions.
fn unexplained(diagnosis: &Diagnosis) -> Vec<String> {
    let mut lines = Vec::new();
    let Some(discrepancy) = &diagnosis.discrepancy else { return lines };
    lines.push(format!(
        "The unexplained residual is {} µm (root mean square). It widens the standard deviation of predictions from {} to {} µm. See figures/{DISCREPANCY_FIGURE}.png.",
        significant(discrepancy.size_um),
        significant(discrepancy.predictive_noise_um),
        significant(discrepancy.predictive_noise_with_discrepancy_um)
    ));
    lines.extend(diagnosis.unexplained.iter().skip(1).map(|entry| format!("Also: {}", entry.sentence)));
    lines.push(String::new());
    lines
}

fn gain(candidate: &CandidateEntry) -> f64 {
    candidate.refit.as_ref().map_or(f64::NEG_INFINITY, |refit| refit.gain_nats)
}

fn row(diagnosis: &Diagnosis, candidate: &CandidateEntry) -> String {
    let number = |value: Option<f64>| value.map_or("–".into(), |value| format!("{value:.1}"));
    let refit = candidate.refit.as_ref();
    let standing = if candidate.status == Status::Claimed { "CLAIMED" } else { diagnosis.status_words(candidate) };
    let ln_bayes = match refit.and_then(|refit| refit.log_bayes_factor_at_most) {
        Some(bound) => format!("< {bound:.0}"),
        None => number(refit.and_then(|refit| refit.log_bayes_factor)),
    };
    let p = refit.map_or("–".into(), |_| format!("{:.3}", candidate.p_familywise));
    format!(
        "  {:<26}{:>8}{:>11}{:>11}{:>10}{p:>9}{:>10}   {standing}",
        candidate.effect,
        number(refit.map(|_| candidate.z)),
        number(refit.map(|refit| refit.gain_nats)),
        number(refit.and_then(|refit| refit.heldout_gain_nats)),
        refit.and_then(|refit| refit.rmse_heldout_um).map_or("–".into(), significant),
        ln_bayes,
    )
    .trim_end()
    .to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that the brief table lists every effect that the verdict names, at any rank. Another effect needs a high rank, or a gain that chance does
    /// not explain.
    #[test]
    fn the_brief_table_has_every_named_effect() {
        let candidate = |status: &str, p: f64| -> CandidateEntry {
            let refit = serde_json::json!({ "gain_nats": 9.0, "heldout_gain_nats": null, "rmse_heldout_um": null, "largest_change": 1.0, "log_bayes_factor": null, "parameters": [] });
            serde_json::from_value(serde_json::json!({ "effect": "softening", "status": status, "z": 0.0, "p_familywise": p, "visible_fraction": 1.0,
                "expected_parameter": null, "refit": refit, "twins": [] }))
            .unwrap()
        };
        let named = ["softening".to_string()];
        assert!(is_shown(15, &candidate("claimed", 1.0), &named));
        assert!(is_shown(15, &candidate("equivalent", 1.0), &[]));
        assert!(!is_shown(15, &candidate("unsupported", 0.01), &[]));
        assert!(is_shown(MAX_ROWS - 1, &candidate("unsupported", 0.01), &[]));
        assert!(!is_shown(MAX_ROWS - 1, &candidate("unsupported", 0.5), &[]));
        assert!(is_shown(MIN_ROWS - 1, &candidate("unsupported", 0.5), &[]));
    }
}
