//! `diagnose` over several records: what these specimens lack together.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use vitreo_uq::base::error::{Error, Place, Result};
use vitreo_uq::cohorts::cohort::{self, Key, Measurement};
use vitreo_uq::cohorts::missing::artefacts;
use vitreo_uq::cohorts::missing::job::{self, CohortRequest};
use vitreo_uq::documents::cohort::{CohortDiagnosis, CohortEffect, CohortSizes, SidesName};
use vitreo_uq::documents::diagnosis::{Status, VerdictKind};
use vitreo_uq::figures::labels::of_parameter;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::study::{ModelSpecification, Study, WithProvenance};
use vitreo_uq::record::Sweep;

use crate::options::{self, DiagnoseArguments};
use crate::terminal::Terminal;
use crate::text::significant;

/// Where the diagnosis of a cohort goes when no directory is named.
const DEFAULT_OUT: &str = "vitreo-uq-out/cohort";
/// Fewest simulated records of each: fewer show no tail.
const FEWEST_SIMULATIONS: usize = 19;
/// Effects that are listed though they gain next to nothing.
const LEAST_LISTED_NATS: f64 = 0.05;

/// Whether several records are meant: more than one path, or a directory that is no record itself.
pub fn is_cohort(target: Option<&PathBuf>, others: &[PathBuf]) -> bool {
    let is_folder = |path: &PathBuf| {
        path.is_dir()
            && !Study::is_study(path)
            && !["experiment.toml", "model.toml"].iter().any(|name| path.join(name).is_file())
    };
    !others.is_empty() || target.is_some_and(is_folder)
}

pub fn diagnose(arguments: &DiagnoseArguments) -> Result<ExitCode> {
    let began = Instant::now();
    let common = &arguments.common;
    let of_one = [("--from", arguments.model.from.is_some()), ("--mesh", arguments.model.mesh.is_some())];
    refuse_what_is_of_one_record(&of_one, "diagnose")?;
    options::check_simulations(arguments.simulations, FEWEST_SIMULATIONS)?;
    if !(arguments.margin >= 0.0 && arguments.margin.is_finite()) {
        let found = format!("a margin of {}", arguments.margin);
        return Err(Error::input(Place::default().at_key("--margin"), found, "give a fraction such as 0.2, for 20 %"));
    }
    options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    let terminal = Terminal::new(common.quiet);
    let paths: Vec<PathBuf> = common.target.iter().chain(&arguments.others).cloned().collect();
    if let Some(path) = paths.iter().find(|path| Sweep::is_one(path)) {
        let remedy = "give records in time; diagnose an oscillation by itself";
        return Err(Error::input(Place::file(path), "an oscillation shows the law alone", remedy));
    }
    let model = |own: ModelSpecification| {
        let model = &arguments.model;
        own.with_options(model.law().as_deref(), &model.with, &model.noise, model.prior.as_deref(), &model.set)
    };
    let measurements = cohort::read(&paths, &arguments.leave_out, &model, &terminal)?;
    let keys = keys(&arguments.by, &measurements)?;
    let out = common.out.as_deref().unwrap_or(Path::new(DEFAULT_OUT));
    let provenance = artefacts::provenance(&measurements, common.seed);
    artefacts::check_place(out, &provenance, common.force)?;
    let request =
        CohortRequest { keys, margin: arguments.margin, n_simulations: arguments.simulations, seed: common.seed };
    let diagnosis = job::run(&measurements, &request, &terminal)?;
    terminal.stage("writing results and figures");
    let written = artefacts::write(out, &diagnosis, provenance.clone())?;
    terminal.finish();
    let document = WithProvenance { provenance, body: &diagnosis };
    crate::output::show(common.json.as_deref(), &document, &words(&diagnosis))?;
    crate::output::say_where(common.quiet, &written, began);
    Ok(ExitCode::SUCCESS)
}

/// Refuses options, each with whether it is given, that only one record can have; `instead` is the command for one.
pub fn refuse_what_is_of_one_record(options: &[(&'static str, bool)], instead: &str) -> Result<()> {
    match options.iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => {
            let remedy = format!("leave {option} away, or {instead} one record");
            Err(Error::input(Place::default().at_key(*option), "of several records each has its own", remedy))
        }
        None => Ok(()),
    }
}

/// What groups are formed by: what the user names; else species, where every record says its own and there are two at least.
fn keys(names: &[String], measurements: &[Measurement]) -> Result<Vec<Key>> {
    if names.is_empty() {
        let mut species: Vec<Option<&str>> =
            measurements.iter().map(|own| own.experiment.species.as_deref().map(str::trim)).collect();
        species.sort_unstable();
        species.dedup();
        let is_grouped = species.len() > 1 && species.iter().all(|own| own.is_some_and(|own| !own.is_empty()));
        return Ok(if is_grouped { vec![Key::Species] } else { Vec::new() });
    }
    crate::groups::keys(names)
}

fn words(diagnosis: &CohortDiagnosis) -> String {
    let mut lines = vec![
        format!("{} records: {}", diagnosis.specimens.len(), diagnosis.verdict.sentence),
        String::new(),
        format!(
            "  {:<26}{:>9}{:>10}{:>9}{:>8}   {:<34}{}",
            "effect", "gain", "held-out", "p", "share", "size", "standing"
        ),
    ];
    let mut effects: Vec<&CohortEffect> = diagnosis.effects.iter().collect();
    effects.sort_by(|a, b| b.gain_nats.total_cmp(&a.gain_nats));
    let (listed, rest): (Vec<&CohortEffect>, Vec<&CohortEffect>) =
        effects.into_iter().partition(|own| own.gain_nats > LEAST_LISTED_NATS || own.status == Status::Claimed);
    lines.extend(listed.into_iter().map(row));
    let nothing: Vec<&str> = rest.iter().filter(|own| own.refused.is_none()).map(|own| own.effect.as_str()).collect();
    if !nothing.is_empty() {
        lines.push(format!("  no law of sizes gains anything: {}", nothing.join(", ")));
    }
    lines.push("  (gains in nats over all records under the common law that fits best; p for the whole search)".into());
    lines.extend(groups(diagnosis));
    if let Some(extended) = diagnosis.extended
        && let (Some(before), Some(after)) = (diagnosis.base.rmse_heldout_um, extended.rmse_heldout_um)
    {
        lines.push(format!(
            "Error on the last cycles of all records: {} µm, with the effect as the cohort predicts it {} µm.",
            significant(before),
            significant(after)
        ));
    }
    lines.extend(diagnosis.remarks.iter().map(|remark| format!("Note: {remark}.")));
    if diagnosis.verdict.kind == VerdictKind::Missing {
        let effects = diagnosis.verdict.effects.join(",");
        lines.push(String::new());
        lines.push(format!("Add it to every record with `vitreo-uq extend DIR… --with {effects}`."));
    }
    lines.join("\n") + "\n"
}

fn row(effect: &CohortEffect) -> String {
    let heldout = effect.heldout_gain_nats.map_or("–".into(), |gain| format!("{gain:.1}"));
    let share = effect.law.as_ref().map_or("–".into(), |law| format!("{:.0} %", 100.0 * law.share));
    let size = match (&effect.law, &effect.parameter) {
        (Some(law), Some(parameter)) => size(law, parameter),
        _ => "–".into(),
    };
    let standing = match (effect.status, &effect.refused) {
        (_, Some(reason)) => format!("not here: {reason}"),
        (Status::Claimed, _) => "CLAIMED".into(),
        (Status::Equivalent, _) => "equivalent".into(),
        (Status::Suggestive, _) => "suggestive".into(),
        _ => String::new(),
    };
    format!(
        "  {:<26}{:>9.1}{heldout:>10}{:>9.4}{share:>8}   {size:<34}{standing}",
        effect.effect, effect.gain_nats, effect.p_familywise
    )
    .trim_end()
    .to_string()
}

fn size(law: &CohortSizes, parameter: &str) -> String {
    let label = of_parameter(parameter);
    let symbol = label.symbol.rsplit(' ').next().unwrap_or_default().to_string();
    let sign = match law.sides {
        SidesName::Above => "",
        SidesName::Below => "−",
        SidesName::Either => "±",
    };
    let unit = if label.unit == "–" { String::new() } else { format!(" {}", label.unit) };
    format!("{symbol} {sign}{}{unit} ×/÷ {:.1}", significant(law.median), law.between_specimen_log_sd.exp())
}

/// Sizes in groups, how they differ, and the law before and after.
fn groups(diagnosis: &CohortDiagnosis) -> Vec<String> {
    let mut lines = Vec::new();
    if diagnosis.groups.is_empty() {
        return lines;
    }
    lines.push(String::new());
    for group in &diagnosis.groups {
        let [median, q05, q95] = [group.median, group.q05, group.q95].map(significant);
        let percent = |share: f64| format!("{:.0}", 100.0 * share);
        lines.push(format!(
            "  {} ({} records): {} {median} ({q05} to {q95}), in {} % ({} to {}) of them",
            group.name,
            group.records,
            of_parameter(&group.parameter).axis(),
            percent(group.share),
            percent(group.share_q05),
            percent(group.share_q95)
        ));
    }
    lines.extend(diagnosis.contrasts.iter().map(|own| {
        let mark = if own.is_declared { "*" } else { " " };
        format!("{mark} {}.", own.sentence)
    }));
    for law in &diagnosis.law {
        lines.push(format!(
            "  {}: {} {} without it, {} with it",
            law.group,
            of_parameter(&law.parameter).axis(),
            significant(law.before),
            significant(law.after)
        ));
    }
    lines
}
