//! `ladder`: compares all revisions of a study on the same cycles.

use std::process::ExitCode;

use vitreo_uq::base::error::Result;
use vitreo_uq::documents::ladder::{LadderParameter, LadderRow, LadderSummary, Shift};
use vitreo_uq::figures::labels::{effects_with, model_title, parameter_label};
use vitreo_uq::figures::number::format_ranges;
use vitreo_uq::jobs::ladder::{self, LadderRequest};

use crate::options::LadderArguments;
use crate::session::Session;
use crate::text::{column_width, significant, warning_text};

/// Width of the longest bar, in characters.
const BAR_WIDTH: usize = 32;
/// Minimum and maximum width of the column of labels, in characters.
const LABEL_WIDTH: [usize; 2] = [34, 72];

pub fn run(arguments: &LadderArguments) -> Result<ExitCode> {
    let session = Session::begin(&arguments.common)?;
    let options = session.sampler(&arguments.walkers);
    let target = session.open(&arguments.model, &[], &[])?;
    let request = LadderRequest { up_to: arguments.model.from.clone(), options, refit: arguments.common.force };
    let outcome = ladder::run(&target, &request, &session.terminal)?;
    session.end(&outcome, &words(&outcome.document.body), "Figure", &arguments.page)
}

fn words(summary: &LadderSummary) -> String {
    let mut lines = vec![heading(summary), summary.trust.to_string(), String::new()];
    lines.extend(bars(summary));
    lines.push(String::new());
    lines.extend(table(summary));
    if !summary.shifts.is_empty() {
        lines.push(String::new());
        lines.extend(shifts(summary));
    }
    lines.push(String::new());
    lines.push(summary.sentence.clone());
    if let [only] = &summary.revisions[..] {
        let name = &only.revision;
        lines.push(format!(
            "Next: `vitreo-uq diagnose` finds the effect that {name} lacks, `vitreo-uq extend --with EFFECT` adds it, `vitreo-uq effects` lists all."
        ));
    }
    for (revision, warning) in summary.warnings() {
        lines.push(String::new());
        lines.push(format!("{revision}: {}", warning_text(warning)));
    }
    lines.join("\n") + "\n"
}

fn heading(summary: &LadderSummary) -> String {
    let scored = if summary.heldout_cycles.is_empty() {
        "no cycle is held out".to_string()
    } else {
        format!("scored on cycle {} only", format_ranges(&summary.heldout_cycles))
    };
    format!(
        "{}: every revision fitted to cycles {}, {scored}.",
        summary.experiment,
        format_ranges(&summary.fitted_cycles)
    )
}

/// Label of a revision: the model for the first revision, the added effects for the others.
fn label(rung: &LadderRow) -> String {
    match &rung.from {
        None => model_title(&rung.model),
        Some(_) => effects_with(&rung.added, &rung.equivalents).trim_start().into(),
    }
}

/// Lines with a bar for the error of each revision. The last line has a bar for the noise.
fn bars(summary: &LadderSummary) -> Vec<String> {
    let error_um = |rung: &LadderRow| rung.rmse_heldout_um.unwrap_or(rung.rmse_fitted_um);
    let noise = summary.noise_um.map(|noise| (String::new(), format!("noise, {}", summary.noise_origin), noise));
    let rows = summary.revisions.iter().map(|rung| (rung.revision.clone(), label(rung), error_um(rung)));
    let rows: Vec<(String, String, f64)> = rows.chain(noise).collect();
    let largest = rows.iter().map(|row| row.2).fold(f64::MIN_POSITIVE, f64::max);
    let which = if summary.heldout_cycles.is_empty() { "fitted cycles" } else { "last held-out cycle" };
    let [least, most] = LABEL_WIDTH;
    let width = rows.iter().map(|row| row.1.chars().count()).max().unwrap_or(0).clamp(least, most);
    let mut lines = vec![format!("  Error on the {which} (µm)")];
    lines.extend(rows.iter().map(|(revision, label, error_um)| {
        let label: String = label.chars().take(width).collect();
        format!("  {revision:<4}{label:<width$}  {} {}", bar(error_um / largest), significant(*error_um))
    }));
    lines
}

/// Bar whose length is the given fraction of the longest bar, drawn in eighths of a character.
fn bar(fraction: f64) -> String {
    const EIGHTHS: [&str; 8] = ["", "▏", "▎", "▍", "▌", "▋", "▊", "▉"];
    let eighths = (8.0 * BAR_WIDTH as f64 * fraction.clamp(0.0, 1.0)).round() as usize;
    let bar = "█".repeat(eighths / 8) + EIGHTHS[eighths % 8];
    if bar.is_empty() { EIGHTHS[1].into() } else { bar }
}

fn table(summary: &LadderSummary) -> Vec<String> {
    let mut lines = vec![format!(
        "  {:<9}{:>9}{:>10}{:>16}{:>13}{:>15}{:>18}",
        "revision", "fitted", "held out", "log score", "90 % band", "learnt noise", "surrogate – full"
    )];
    let value = |value: Option<f64>| value.map_or("–".into(), significant);
    lines.extend(summary.revisions.iter().map(|rung| {
        let score = match (rung.heldout_log_score_nats, rung.heldout_log_score_mcse_nats) {
            (Some(score), Some(error)) => format!("{score:.1} ± {error:.1}"),
            _ => "–".into(),
        };
        let coverage = rung.coverage_90.map_or("–".into(), |coverage| format!("{:.0} %", 100.0 * coverage));
        let distance = rung.surrogate_vs_fe_max_um.map_or("–".into(), |distance| format!("{distance:.0e}"));
        let mark = if rung.converged { "" } else { "  NOT CONVERGED" };
        format!(
            "  {:<9}{:>9}{:>10}{score:>16}{coverage:>13}{:>15}{distance:>18}{mark}",
            rung.revision,
            significant(rung.rmse_fitted_um),
            value(rung.rmse_heldout_um),
            significant(rung.learnt_noise_um)
        )
    }));
    let runs = summary.revisions.iter().map(|rung| rung.fe_runs).sum::<Option<usize>>();
    let by = match (summary.revisions.first(), runs) {
        (Some(rung), Some(runs)) => rung.model.full_runs(runs),
        _ => "the creep law (this instrument needs no finite elements)".into(),
    };
    lines.push(format!("  Errors in µm, log score in nats; predicted by {by}."));
    lines
}

fn shifts(summary: &LadderSummary) -> Vec<String> {
    let name = |rung: Option<&LadderRow>| rung.map_or(String::new(), |rung| rung.revision.clone());
    let (before, after) = (name(summary.revisions.first()), name(summary.revisions.last()));
    let width = column_width(summary.shifts.iter().map(|shift| shift.name.as_str()));
    let mut lines = vec![
        format!(
            "  The effects missing in {before} had shifted the law's parameters (median, 90 % interval; both fitted to cycles {}):",
            format_ranges(&summary.fitted_cycles)
        ),
        format!("  {:<width$}{before:>26}{after:>26}{:>10}{:>12}", "parameter", "shift", "in sd"),
    ];
    let interval =
        |p: &LadderParameter| format!("{} [{}, {}]", significant(p.median), significant(p.q05), significant(p.q95));
    lines.extend(summary.shifts.iter().map(|shift: &Shift| {
        let (before, after) = (interval(&shift.before), interval(&shift.after));
        let axis = parameter_label(&shift.name).axis();
        let percent = format!("{:+.1} %", 100.0 * shift.relative);
        format!("  {axis:<width$}{before:>26}{after:>26}{percent:>10}{:>+12.1}", shift.in_sd_before)
    }));
    lines.push(format!("  Shift: of {before} away from {after}; in sd: in posterior standard deviations of {before}."));
    lines
}
