//! `learn` over several records: a law learnt from half of them, confirmed on the others.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use vitreo_uq::base::error::Result;
use vitreo_uq::cohorts::learnt;
use vitreo_uq::documents::learned_cohort::{CohortPair, ConfirmedOn, LearnedCohort, LearnedCohortKind};
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::study::{ModelSpecification, WithProvenance};

use crate::options::{self, LearnArguments};
use crate::terminal::Terminal;
use crate::text::significant;

/// Where it goes when no directory is named.
const DEFAULT_OUT: &str = "vitreo-uq-out/cohort";
/// Pairs that are shown.
const N_SHOWN: usize = 6;

pub fn run(arguments: &LearnArguments) -> Result<ExitCode> {
    let began = Instant::now();
    let (common, model) = (&arguments.common, &arguments.model);
    let of_one = [
        ("--from", model.from.is_some()),
        ("--mesh", model.mesh.is_some()),
        ("--first-cycles", arguments.first_cycles.is_some()),
    ];
    crate::cohort::refuse_what_is_of_one_record(&of_one, "learn from")?;
    options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    let terminal = Terminal::new(common.quiet);
    let paths: Vec<PathBuf> = common.target.iter().chain(&arguments.others).cloned().collect();
    let with_options = |own: ModelSpecification| {
        own.with_options(model.base.as_deref(), &model.with, &model.noise, model.prior.as_deref(), &model.set)
    };
    let measurements = vitreo_uq::cohorts::cohort::read(&paths, &[], &with_options, &terminal)?;
    let out = common.out.as_deref().unwrap_or(Path::new(DEFAULT_OUT));
    let provenance = learnt::provenance(&measurements, common.seed);
    learnt::check_place(out, &provenance, common.force)?;
    let outcome = learnt::run(&measurements, arguments.monotone, &terminal)?;
    terminal.stage("writing results");
    let written = learnt::write(out, &outcome, provenance.clone())?;
    terminal.finish();
    let document = WithProvenance { provenance, body: &outcome.learned };
    crate::output::show(common.json.as_deref(), &document, &words(&outcome.learned, &written))?;
    crate::output::say_where(common.quiet, &written, began);
    Ok(ExitCode::SUCCESS)
}

fn words(learned: &LearnedCohort, written: &Path) -> String {
    let mut lines = vec![
        learned.verdict.sentence.clone(),
        String::new(),
        format!("  {:<28}{:<20}{:>11}{:>11}", "quantity", "state", "evidence", "held-out"),
    ];
    lines.extend(learned.pairs.iter().take(N_SHOWN).map(pair));
    lines.push("  (gains in nats over all records that were learnt from)".into());
    if let Some(formula) = &learned.formula {
        lines.push(String::new());
        let units = formula.parameters.iter().zip(&formula.units);
        let names: Vec<String> = units.map(|(name, unit)| format!("{name} ({unit})")).collect();
        lines.push(format!(
            "  {:<28}{:>11}{:>13}{:>11}   {}",
            "confirmed on",
            "gain",
            "error before",
            "after",
            names.join(", ")
        ));
        lines.extend(learned.confirmed_on.iter().map(record));
        lines.push("  (gains in nats and errors in µm on the last cycle, which no fit has seen)".into());
    }
    if learned.verdict.kind == LearnedCohortKind::Confirmed
        && let Some(formula) = &learned.formula
    {
        lines.push(String::new());
        let file = written.join(&formula.file);
        lines.push(format!("Add it to every record with `vitreo-uq extend DIR… --with {}`.", file.display()));
    }
    lines.join("\n") + "\n"
}

fn pair(own: &CohortPair) -> String {
    let state = own.state.replace('_', " ");
    format!("  {:<28}{state:<20}{:>11.1}{:>11.1}", own.quantity, own.evidence_nats, own.heldout_gain_nats)
}

fn record(own: &ConfirmedOn) -> String {
    let values: Vec<String> = own.values.iter().map(|value| significant(*value)).collect();
    format!(
        "  {:<28}{:>11.1}{:>13}{:>11}   {}",
        own.experiment,
        own.last_cycle_gain_nats,
        significant(own.rmse_before_um),
        significant(own.rmse_after_um),
        values.join(", ")
    )
}
