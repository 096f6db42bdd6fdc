//! `extend` over several records: each gets the same effects, in a study of its own.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;
use vitreo_uq::posterior::study::ModelSpecification;

use vitreo_uq::base::error::{Error, Place, Result};
use vitreo_uq::cohorts::cohort::{self, Measurement};
use vitreo_uq::documents::extension::ExtensionSummary;
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::study::{Study, named_effects};

use crate::extend::{self, Extended};
use crate::options::{self, Common, ExtendArguments};
use crate::terminal::Terminal;
use crate::text::significant;

/// Where studies go when no directory is named: one folder a record.
const DEFAULT_OUT: &str = "vitreo-uq-out/cohort-studies";

pub fn run(arguments: &ExtendArguments) -> Result<ExitCode> {
    let common = &arguments.common;
    if !crate::cohort::is_cohort(common.target.as_ref(), &arguments.others) {
        return extend::run(arguments);
    }
    let began = Instant::now();
    if common.json.is_some() {
        let found = "every record has a document of its own, in its study";
        return Err(Error::input(Place::default().at_key("--json"), found, "leave --json away, or extend one record"));
    }
    let threads = options::use_threads(common.threads)?;
    let terminal = Terminal::new(common.quiet);
    let effects = named_effects(&arguments.model.with)?;
    let paths: Vec<PathBuf> = common.target.iter().chain(&arguments.others).cloned().collect();
    let measurements = cohort::read(&paths, &[], &Ok, &terminal)?;
    let out = common.out.as_deref().unwrap_or(Path::new(DEFAULT_OUT));
    let places = places(&measurements, out)?;
    let (mut lines, mut is_sound) = (Vec::new(), true);
    for (number, (own, place)) in measurements.iter().zip(&places).enumerate() {
        terminal.stage(&format!("{} ({} of {})", own.name(), number + 1, measurements.len()));
        if let Some(revision) = revision_with(place, &effects)? {
            lines.push(format!("  {:<28}{revision} has it already", own.name()));
            continue;
        }
        let target = if Study::is_study(place) { place } else { &own.path };
        let study_out = (!Study::is_study(target)).then(|| place.clone());
        let one = Common { target: Some(target.clone()), out: study_out, json: None, ..common.clone() };
        let Extended { study, writer, document } =
            extend::extended(&one, arguments, threads, &terminal).map_err(|error| own.named(error))?;
        writer.commit()?;
        crate::report::refresh(&study, &arguments.page, true);
        is_sound &= document.body.is_sound();
        lines.push(row(&own.name(), &document.body));
    }
    terminal.finish();
    crate::output::show(None, &(), &words(&effects, lines, out))?;
    crate::output::say_where(common.quiet, out, began);
    Ok(ExitCode::from(u8::from(!is_sound)))
}

/// The study of every record: itself, or a folder of its name.
fn places(measurements: &[Measurement], out: &Path) -> Result<Vec<PathBuf>> {
    let place = |own: &Measurement| if Study::is_study(&own.path) { own.path.clone() } else { out.join(own.name()) };
    let places: Vec<PathBuf> = measurements.iter().map(place).collect();
    match (0..places.len()).find(|k| places[..*k].contains(&places[*k])) {
        Some(second) => Err(Error::input(
            Place::file(&measurements[second].path),
            format!("another record's directory is called {}, too", measurements[second].name()),
            "give them different names, or extend one of them by itself with `--out`",
        )),
        None => Ok(places),
    }
}

/// The last revision of a study, if it has the effects already: what an earlier run of the same command made.
fn revision_with(place: &Path, effects: &[String]) -> Result<Option<String>> {
    if !Study::is_study(place) {
        return Ok(None);
    }
    let study = Study::open(place)?;
    let Some(last) = study.revisions()?.pop() else { return Ok(None) };
    let model = ModelSpecification::of_revision(&study.revision_dir(&last)?, &Library::default())?;
    Ok(effects.iter().all(|slug| model.effects.contains(slug)).then_some(last))
}

fn row(name: &str, summary: &ExtensionSummary) -> String {
    let number = |value: Option<f64>| value.map_or("–".into(), significant);
    let of_effects = summary.parameters.iter().filter(|own| own.name.contains('.'));
    let sizes: Vec<String> = of_effects.map(|own| format!("{} {}", own.name, significant(own.median))).collect();
    let mark = if summary.is_sound() { "" } else { "  NOT SOUND" };
    format!(
        "  {name:<28}{:<5}{:>12}{:>12}   {}{mark}",
        summary.revision,
        number(summary.before.rmse_heldout_um),
        number(summary.after.rmse_heldout_um),
        sizes.join(", ")
    )
}

fn words(effects: &[String], lines: Vec<String>, out: &Path) -> String {
    let mut all = vec![
        format!("{} added to {} records", effects.join(", "), lines.len()),
        format!("  {:<28}{:<5}{:>12}{:>12}   {}", "record", "", "before (µm)", "after (µm)", "sizes"),
    ];
    all.extend(lines);
    all.push("  (errors on the last cycle, which no fit has seen)".into());
    all.push(format!("What differs between groups then: `vitreo-uq groups {}`.", out.display()));
    all.join("\n") + "\n"
}
