//! `diagnose`: which physical effect is missing.

use std::process::ExitCode;
use std::time::Instant;

use vitreo_uq::base::error::{Error, Place, Result};
use vitreo_uq::base::files::write_json_atomically;
use vitreo_uq::criticism::diagnose::{DiagnosisRequest, diagnose};
use vitreo_uq::criticism::fingerprints::fingerprints;
use vitreo_uq::criticism::learn::first_look;
use vitreo_uq::criticism::search::Bars;
use vitreo_uq::documents::diagnosis::{CandidateEntry, Diagnosis, Status, VerdictKind, by_reason};
use vitreo_uq::figures::diagnosis as figure;
use vitreo_uq::figures::fingerprints::{fingerprints as fingerprints_figure, write_fingerprints};
use vitreo_uq::figures::number::listed;
use vitreo_uq::figures::svg::{remove_figure, write_figure};
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::study::{DIAGNOSIS_NAME, FINGERPRINTS_NAME, WithProvenance};

use crate::examine::{Begun, Examined};
use crate::options::{self, DiagnoseArguments};
use crate::terminal::Terminal;
use crate::text::{outliers_left_out, significant};

/// p < 0.05 is asked for in the first round, and half of it in each further one.
const FEWEST_SIMULATIONS: usize = 99;
/// The figure of what is unexplained.
const DISCREPANCY: &str = "discrepancy";

pub fn run(arguments: &DiagnoseArguments) -> Result<ExitCode> {
    if crate::cohort::is_cohort(arguments.common.target.as_ref(), &arguments.others) {
        return crate::cohort::diagnose(arguments);
    }
    if crate::sweep::is_one(arguments.common.target.as_ref()) {
        return crate::sweep::diagnose(arguments);
    }
    let at = Instant::now();
    let common = &arguments.common;
    let threads = options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    let request = request(arguments)?;
    let terminal = Terminal::new(common.quiet);
    let begun = Begun { at, common, page: &arguments.page, terminal: &terminal };
    let sampler = options::default_sampler(common.seed, threads);
    let examined = Examined::open(common, &arguments.model, sampler, &terminal)?;
    let mut outcome = diagnose(&examined.subject_for_effects(&terminal)?, &request, &terminal)?;
    if outcome.diagnosis.verdict.kind == VerdictKind::Unexplained {
        // What no effect explains may be a law that no one wrote down.
        outcome.diagnosis.remarks.extend(first_look(&outcome.subject, &outcome.found.base, &terminal)?);
    }
    let diagnosis = &outcome.diagnosis;
    terminal.stage("writing results and figures");
    let document = WithProvenance { provenance: examined.provenance("diagnosis", common.seed), body: diagnosis };
    let writer = examined.study.amend_revision(&examined.revision)?;
    write_json_atomically(&writer.path().join(DIAGNOSIS_NAME), &document)?;
    let figures = writer.path().join("figures");
    write_figure(&figures, "diagnosis", &figure::diagnosis(diagnosis)?)?;
    let of_effects = fingerprints(&outcome.subject, &outcome.found);
    write_fingerprints(&writer.path().join(FINGERPRINTS_NAME), &of_effects)?;
    if !of_effects.effects.is_empty() {
        write_figure(&figures, "fingerprints", &fingerprints_figure(&of_effects, &diagnosis.experiment)?)?;
    }
    match &outcome.leftover {
        Some(leftover) => write_figure(&figures, DISCREPANCY, &leftover.figure(&diagnosis.experiment)?)?,
        None => remove_figure(&figures, DISCREPANCY)?,
    }
    begun.end(&examined.study, writer, &document, &words(diagnosis, &examined.revision))?;
    Ok(ExitCode::SUCCESS)
}

fn request(arguments: &DiagnoseArguments) -> Result<DiagnosisRequest> {
    let default = DiagnosisRequest::default();
    let (smallest, simulations) = (arguments.smallest, arguments.simulations);
    if !(smallest.is_finite() && smallest >= 0.0) {
        let remedy = "give a number of noise standard deviations, as in `--smallest 0.25`";
        return Err(Error::input(Place::default().at_key("--smallest"), format!("{smallest} is no size"), remedy));
    }
    options::check_simulations(simulations, FEWEST_SIMULATIONS)?;
    let bars = Bars { smallest_change: smallest, ..default.bars };
    Ok(DiagnosisRequest { bars, n_simulations: simulations, seed: arguments.common.seed, ..default })
}

fn words(diagnosis: &Diagnosis, revision: &str) -> String {
    let scored = if diagnosis.heldout_cycles.is_empty() {
        "none held out".to_string()
    } else {
        format!("scored on {}", listed(&diagnosis.heldout_cycles))
    };
    let mut lines = vec![
        format!("{} ({revision}): {}", diagnosis.experiment, diagnosis.verdict.sentence),
        format!("(every model fitted to cycles {}, {scored})", listed(&diagnosis.fitted_cycles)),
        String::new(),
        format!(
            "  {:<26}{:>8}{:>11}{:>11}{:>9}{:>10}   {}",
            "effect", "score z", "gain", "held-out", "p", "ln Bayes", "standing"
        ),
    ];
    let mut candidates: Vec<&CandidateEntry> = diagnosis.candidates.iter().collect();
    candidates.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    lines.extend(candidates.iter().filter(|own| own.refused.is_none()).map(|candidate| row(diagnosis, candidate)));
    lines.push("  (gains in nats over the model without the effect; p for the whole search)".into());
    let reasons = by_reason(candidates.iter().map(|own| (own.effect.as_str(), own.refused.as_deref())));
    lines.extend(reasons.iter().map(|(reason, effects)| format!("  not here: {}: {reason}", effects.join(", "))));
    if let Some(pair) = diagnosis.pairs.first() {
        lines.push(format!("  best pair: {} with {:.1} nats", pair.effects.join(" + "), pair.gain_nats));
    }
    lines.push(String::new());
    lines.extend(unexplained(diagnosis));
    lines.push("Noise of one position".into());
    lines.extend(diagnosis.noise.iter().map(|noise| format!("  {}", noise.text)));
    if !diagnosis.separating_protocol.is_empty() {
        lines.push(format!("To tell them apart: {}", diagnosis.separating_protocol));
    }
    lines.extend(outliers_left_out(diagnosis.outlier_rows.len()));
    if !diagnosis.blind_spots.is_empty() {
        lines.push(format!("Blind spots, which this experiment cannot show: {}.", diagnosis.blind_spots.join(", ")));
    }
    let smallest: Vec<String> = diagnosis
        .smallest_detectable
        .iter()
        .filter_map(|entry| Some(format!("{} {}", entry.effect, significant(entry.parameter?))))
        .collect();
    if !smallest.is_empty() {
        lines.push(format!("Smallest sizes that would have been seen: {}.", smallest.join(", ")));
    }
    lines.extend(diagnosis.remarks.iter().map(|remark| format!("Note: {}.", remark.trim_end_matches('.'))));
    if diagnosis.verdict.effects.is_empty() {
        return lines.join("\n") + "\n";
    }
    lines.push(String::new());
    let command = format!("`vitreo-uq extend STUDY --with {}`", diagnosis.verdict.effects.join(","));
    lines.push(match diagnosis.verdict.kind {
        VerdictKind::Missing => format!("Add it with {command}."),
        _ => format!("It helps and is not enough; {command} shows what it leaves."),
    });
    lines.join("\n") + "\n"
}

/// How large what the verdict calls unexplained is, and what it adds to predictions.
fn unexplained(diagnosis: &Diagnosis) -> Vec<String> {
    let mut lines = Vec::new();
    let Some(discrepancy) = &diagnosis.discrepancy else { return lines };
    lines.push(format!(
        "What is unexplained is {} µm (root mean square): predictions are widened from a standard deviation of {} to {} µm. See figures/{DISCREPANCY}.png.",
        significant(discrepancy.size_um),
        significant(discrepancy.predictive_noise_um),
        significant(discrepancy.predictive_noise_with_discrepancy_um)
    ));
    lines.extend(
        diagnosis.unexplained.iter().skip(1).map(|entry| format!("It also looks like this: {}", entry.sentence)),
    );
    lines.push(String::new());
    lines
}

fn gain(candidate: &CandidateEntry) -> f64 {
    candidate.refit.as_ref().map_or(f64::NEG_INFINITY, |refit| refit.gain_nats)
}

fn row(diagnosis: &Diagnosis, candidate: &CandidateEntry) -> String {
    let number = |value: Option<f64>| value.map_or("–".into(), |value| format!("{value:.1}"));
    let refit = candidate.refit.as_ref();
    let standing = if candidate.status == Status::Claimed { "CLAIMED" } else { diagnosis.standing(candidate) };
    let ln_bayes = match refit.and_then(|refit| refit.log_bayes_factor_at_most) {
        Some(bound) => format!("< {bound:.0}"),
        None => number(refit.and_then(|refit| refit.log_bayes_factor)),
    };
    let p = refit.map_or("–".into(), |_| format!("{:.3}", candidate.p_familywise));
    format!(
        "  {:<26}{:>8}{:>11}{:>11}{p:>9}{:>10}   {standing}",
        candidate.effect,
        number(refit.map(|_| candidate.z)),
        number(refit.map(|refit| refit.gain_nats)),
        number(refit.and_then(|refit| refit.heldout_gain_nats)),
        ln_bayes,
    )
    .trim_end()
    .to_string()
}
