//! `extend`: adds effects to a study as its next revision, and compares the errors before and after.

use std::path::Path;
use std::process::ExitCode;

use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::documents::errors::ModelErrors;
use vitreo_uq::documents::extension::{EquivalentEffects, ExtensionSummary};
use vitreo_uq::figures::labels::model_title_with;
use vitreo_uq::figures::number::format_ranges;
use vitreo_uq::jobs::extend::{self, ExtendDocument, ExtendRequest, ExtendedRecord};
use vitreo_uq::jobs::target::TargetKind;
use vitreo_uq::posterior::study::named_effects;

use crate::options::{ExtendArguments, ModelOptions};
use crate::session::{RESULTS, Session};
use crate::text::{parameter_table, significant, warning_text};

pub fn run(arguments: &ExtendArguments) -> Result<ExitCode> {
    let session = Session::begin(&arguments.common)?;
    let taken = [TargetKind::Cohort];
    let is_cohort = session.kind(&arguments.others, &taken) == TargetKind::Cohort;
    if is_cohort && arguments.common.output.json.is_some() {
        let found = "`--json` writes one document, but each record of a cohort has a separate document";
        return Err(Error::input(InputPlace::default().at_key("--json"), found, "omit --json, or extend one record"));
    }
    let request = ExtendRequest {
        effects: named_effects(&arguments.model.with)?,
        set: arguments.model.set.clone(),
        sampler: session.sampler(&arguments.walkers),
        pages: !arguments.page.no_report,
    };
    // The options for effects and values apply to the new revision only. All other options also apply to the revision that is extended.
    let model = ModelOptions { with: Vec::new(), set: Vec::new(), ..arguments.model.clone() };
    let target = session.open(&model, &arguments.others, &taken)?;
    let outcome = extend::run(&target, &request, &session.terminal)?;
    let words = match &outcome.document.body {
        ExtendDocument::Creep(summary) => words(summary),
        ExtendDocument::Cohort { records } => cohort_words(&request.effects, records, &outcome.written),
    };
    session.end(&outcome, &words, RESULTS, &arguments.page)
}

fn words(summary: &ExtensionSummary) -> String {
    let verdict = if summary.converged { "converged" } else { "NOT CONVERGED" };
    let heldout = if summary.heldout_cycles.is_empty() {
        "no cycle held out".to_string()
    } else {
        format!("scored on cycle {}", format_ranges(&summary.heldout_cycles))
    };
    let title = model_title_with(&summary.model, &summary.equivalents);
    let mut lines = vec![
        format!("{}: {title} ({}): {verdict}", summary.experiment, summary.revision),
        summary.trust.to_string(),
        format!("Both models fitted to cycles {}, {heldout}.", format_ranges(&summary.fitted_cycles)),
        String::new(),
        parameter_table(&summary.parameters),
        String::new(),
        format!("  {:<24}{:>18}{:>20}", "error (µm)", "fitted cycles", "last held-out cycle"),
        row(&format!("before ({})", summary.from), summary.before),
        row(&format!("after ({})", summary.revision), summary.after),
    ];
    lines.extend(
        summary.noise_um.map(|noise| format!("  {:<24}{:>18}{:>20}", "noise", significant(noise), significant(noise))),
    );
    lines.push(String::new());
    lines.push(summary.sentence.clone());
    lines.extend(summary.equivalents.iter().filter(|equivalent| !equivalent.refits.is_empty()).flat_map(equivalents));
    for warning in &summary.warnings {
        lines.push(String::new());
        lines.push(warning_text(warning));
    }
    lines.join("\n") + "\n"
}

/// Lines of a table of parameters. For each equivalent effect, the table has the parameters of the model refitted with this effect.
fn equivalents(equivalent_effects: &EquivalentEffects) -> Vec<String> {
    let heading = format!(
        "  {} ({})",
        equivalent_effects.effects.join(" + "),
        equivalent_effects.alternative().unwrap_or_default()
    );
    let width = equivalent_effects.refits.iter().flat_map(|refit| refit.parameters.iter().map(|p| refit.label(p)));
    let width = width.map(|label| label.chars().count() + 2).max();
    let width = width.unwrap_or(0).max(24);
    let mut lines = vec![
        String::new(),
        heading,
        format!("  {:<width$}{:>11}{:>11}{:>11}{:>20}", "each alone", "mean", "5 %", "95 %", "held-out error (µm)"),
    ];
    for refit in &equivalent_effects.refits {
        let error = refit.rmse_heldout_um.map_or("–".into(), significant);
        lines.extend(refit.parameters.iter().map(|p| {
            let [mean, q05, q95] = [p.mean, p.q05, p.q95].map(significant);
            format!("  {:<width$}{mean:>11}{q05:>11}{q95:>11}{error:>20}", refit.label(p))
        }));
    }
    lines
}

fn row(label: &str, misfit: ModelErrors) -> String {
    let heldout = misfit.rmse_heldout_um.map_or("–".into(), significant);
    format!("  {label:<24}{:>18}{heldout:>20}", significant(misfit.rmse_fitted_um))
}

fn cohort_words(effects: &[String], records: &[ExtendedRecord], out: &Path) -> String {
    let mut lines = vec![
        format!("{} added to {} records", effects.join(", "), records.len()),
        format!("  {:<28}{:<5}{:>12}{:>12}   {}", "record", "", "before (µm)", "after (µm)", "sizes"),
    ];
    lines.extend(records.iter().map(|record| match &record.extension {
        Some(summary) => cohort_row(&record.name, summary),
        None => format!("  {:<28}{} already has the effect", record.name, record.revision),
    }));
    lines.push("  (errors on the last held-out cycle)".into());
    lines.push(format!("Next: `vitreo-uq groups {}` compares groups with the new model.", crate::child::in_shell(out)));
    lines.join("\n") + "\n"
}

fn cohort_row(name: &str, summary: &ExtensionSummary) -> String {
    let number = |value: Option<f64>| value.map_or("–".into(), significant);
    let of_effects = summary.parameters.iter().filter(|parameter| parameter.name.contains('.'));
    let sizes: Vec<String> = of_effects
        .map(|parameter_summary| format!("{} {}", parameter_summary.name, significant(parameter_summary.median)))
        .collect();
    let mark = if summary.is_sound() { "" } else { "  NOT SOUND" };
    format!(
        "  {name:<28}{:<5}{:>12}{:>12}   {}{mark}",
        summary.revision,
        number(summary.before.rmse_heldout_um),
        number(summary.after.rmse_heldout_um),
        sizes.join(", ")
    )
}
