//! Formats the results of `sample` and `diagnose` for an oscillation as text, and runs `check` for such a record.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use vitreo_uq::base::error::Result;
use vitreo_uq::documents::check::{CheckSummary, Contradiction, RecordReading};
use vitreo_uq::documents::diagnosis::VerdictKind;
use vitreo_uq::documents::oscillation::{
    OscillationCandidate, OscillationDiagnosis, OscillationMisfit, OscillationSummary,
};
use vitreo_uq::figures::labels::{model_title, parameter_label};
use vitreo_uq::figures::svg::write_figure;
use vitreo_uq::jobs::sweep::artefacts;
use vitreo_uq::posterior::study::{Provenance, Study, WithProvenance};
use vitreo_uq::record::{OscillationRecord, SweepForm, SweepRow};

use crate::text::{check_text, parameter_table, significant, warning_text};

fn errors_words(misfit: &OscillationMisfit) -> String {
    let percent = |share: f64| format!("{} %", significant(100.0 * share));
    let origin = if misfit.errors_known { "given in the table" } else { "learnt" };
    let mut text = format!(
        "Fitted frequencies: residuals of G′ and G″ are {} of |G*| (errors {}, {origin}).",
        percent(misfit.relative_fitted),
        percent(misfit.error_relative)
    );
    if let (Some(relative), Some(over)) = (misfit.relative_heldout, misfit.heldout_over_error) {
        text += &format!(
            "\nHeld-out frequencies: residuals are {}, {} × their errors.",
            percent(relative),
            significant(over)
        );
    }
    text + &format!(
        "\nProbability of residuals this large from noise alone: {}.",
        if misfit.p < 0.01 { "below 0.01".into() } else { format!("{:.2}", misfit.p) }
    )
}

/// Text of an oscillation's posterior.
pub fn posterior_words(summary: &OscillationSummary) -> String {
    let verdict = if summary.converged { "converged" } else { "NOT CONVERGED" };
    let frequencies = &summary.frequencies;
    let mut lines = vec![
        format!(
            "{}: {} model, {} frequencies from {} to {} Hz, Poisson ratio {}: {verdict}",
            summary.experiment,
            model_title(&summary.model),
            frequencies.fitted + frequencies.heldout,
            significant(frequencies.lowest_hz),
            significant(frequencies.highest_hz),
            summary.poisson_ratio
        ),
        String::new(),
        parameter_table(&summary.parameters),
        String::new(),
        errors_words(&summary.misfit),
    ];
    for warning in &summary.warnings {
        lines.push(String::new());
        lines.push(warning_text(warning));
    }
    lines.join("\n") + "\n"
}

/// Text of an oscillation's diagnosis.
pub fn diagnosis_words(found: &OscillationDiagnosis) -> String {
    let mut lines = vec![
        format!("{}: {} model", found.experiment, model_title(&found.model)),
        String::new(),
        found.verdict.sentence.clone(),
        String::new(),
        errors_words(&found.base),
    ];
    if let Some(extended) = &found.extended {
        lines.push(format!("With {}:", found.verdict.effects.join(" and ")));
        lines.push(errors_words(extended));
    }
    lines.push(String::new());
    lines.push(format!("  {:<26}{:>12}{:>12}{:>9}   {}", "effect", "gain (nats)", "held-out", "p", "size"));
    lines.extend(found.candidates.iter().map(row));
    lines.push(String::new());
    lines.push("Other effects need a record over time: an oscillation can only show effects of the law.".into());
    match (&found.verdict.base_law, found.verdict.kind) {
        (Some(law), _) => lines.push(format!("Next:  vitreo-uq sample EXPERIMENT --base {law} --out STUDY")),
        (None, VerdictKind::Unexplained) => {
            lines.push(
                "No base law explains the record either; `vitreo-uq compare EXPERIMENT --laws` ranks them.".into(),
            );
        }
        (None, _) => {}
    }
    lines.join("\n") + "\n"
}

fn row(candidate: &OscillationCandidate) -> String {
    let heldout = candidate.heldout_gain_nats.map_or("–".into(), |gain| format!("{gain:.1}"));
    let sizes: Vec<String> = candidate
        .parameters
        .iter()
        .map(|oscillation_estimate| {
            let label = parameter_label(&oscillation_estimate.name);
            let name = label.symbol.rsplit(' ').next().unwrap_or_default().to_string();
            let range =
                format!("{} to {}", significant(oscillation_estimate.lower), significant(oscillation_estimate.upper));
            let unit = if label.unit == "–" { String::new() } else { format!(" {}", label.unit) };
            format!("{name} = {} ({range}){unit}", significant(oscillation_estimate.value))
        })
        .collect();
    let gain = format!("{:.1}", candidate.gain_nats);
    format!("  {:<26}{gain:>12}{heldout:>12}{:>9.3}   {}", candidate.effect, candidate.p_familywise, sizes.join(", "))
}

/// Runs `check` for an oscillation: describes how the record was read, and draws its moduli.
pub fn check(path: &Path, out: &Path, json: Option<&Path>, quiet: bool) -> Result<ExitCode> {
    let (sweep, files) = OscillationRecord::read(path)?;
    let dir = out.parent().filter(|dir| !dir.as_os_str().is_empty()).map_or(PathBuf::from("."), PathBuf::from);
    let stem = out.file_name().map_or("record".into(), |name| name.to_string_lossy().into_owned());
    write_figure(&dir, &stem, &artefacts::raw_figure(&sweep)?)?;
    let summary = understood(&sweep);
    let provenance = Provenance::new("check", 1, 0, Study::hashes_of(&files)?);
    crate::output::show(json, &WithProvenance { provenance, body: &summary }, &check_text(&summary))?;
    if !quiet {
        crate::interrupt::print_message(&format!("Figure: {}.svg, .png and .pdf", out.display()));
    }
    Ok(ExitCode::SUCCESS)
}

fn understood(sweep: &OscillationRecord) -> CheckSummary {
    let n_heldout = sweep.rows.iter().filter(|row| row.is_heldout).count();
    let [lowest_hz, highest_hz] = sweep.range_hz().map(significant);
    let moduli: Vec<[f64; 2]> = sweep.rows.iter().map(|row| sweep.form.moduli(row.pair)).collect();
    let range = |k: usize| {
        let ends = moduli
            .iter()
            .map(|pair| pair[k])
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        ends.map(significant)
    };
    let [[low, high], [lowest, highest]] = [range(0), range(1)];
    let form = match sweep.form {
        SweepForm::StorageAndLoss => "storage and loss modulus",
        SweepForm::ModulusAndPhase => "modulus and phase",
    };
    let errors =
        if sweep.has_errors() { "with their errors" } else { "without errors, so one relative error is estimated" };
    let sentences = vec![
        format!("{}: an oscillation, {form}, {errors}.", sweep.specimen_id),
        format!(
            "{} frequencies from {lowest_hz} to {highest_hz} Hz; {} rows without a number and {} rows of zeros are ignored.",
            sweep.rows.len(),
            sweep.n_incomplete,
            sweep.n_zero
        ),
        format!("G′ from {low} to {high} Pa, G″ from {lowest} to {highest} Pa."),
        format!("Poisson ratio {}: G = E/{}.", sweep.poisson_ratio, significant(2.0 + 2.0 * sweep.poisson_ratio)),
        format!("{} frequencies are fitted, {n_heldout} are held out.", sweep.rows.len() - n_heldout),
    ];
    let understood = RecordReading { rows: sweep.rows.len(), positions: sweep.rows.len(), cycles: 1, sentences };
    let contradictions = negative_moduli(sweep).into_iter().collect();
    CheckSummary { experiment: sweep.specimen_id.clone(), understood, contradictions }
}

/// Moduli that no passive material has.
fn negative_moduli(sweep: &OscillationRecord) -> Option<Contradiction> {
    let is_negative = |row: &&SweepRow| sweep.form.moduli(row.pair).iter().any(|modulus| *modulus < 0.0);
    let found: Vec<f64> = sweep.rows.iter().filter(is_negative).map(|row| row.frequency_hz).collect();
    let [first_hz, last_hz] = [found.first()?, found.last()?].map(|hz| significant(*hz));
    let between =
        if found.len() == 1 { format!("at {first_hz} Hz") } else { format!("between {first_hz} and {last_hz} Hz") };
    Some(Contradiction {
        kind: "negative-modulus".into(),
        certain: false,
        text: format!("a modulus is negative at {} of {} frequencies, {between}: no passive gel has such a modulus", found.len(), sweep.rows.len()),
        advice: "the inertia of the instrument or noise is likely: delete these rows, and the rows next to them that bend towards them".into(),
    })
}
