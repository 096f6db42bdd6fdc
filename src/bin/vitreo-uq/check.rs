//! `check`: describes how a record was read, draws it, and lists contradictions between the data and their description.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use vitreo_uq::base::error::Result;
use vitreo_uq::figures::record::{RawRecord, raw_record};
use vitreo_uq::figures::svg::write_figure;
use vitreo_uq::posterior::study::{Provenance, Study, WithProvenance};
use vitreo_uq::posterior::{check, replica};
use vitreo_uq::record::{Experiment, ExperimentFiles, OscillationRecord};

use crate::text::check_text;

/// Exit code if the data certainly contradict their description.
const WRONG: u8 = 2;

/// Arguments of `check`.
#[derive(Args)]
pub struct CheckArguments {
    /// Experiment (a directory with experiment.toml, or that file) or study [default: the embedded porcine replica]
    #[arg(value_name = "EXPERIMENT|STUDY")]
    target: Option<PathBuf>,
    /// File name of the figure without extension; FILE.svg, FILE.png and FILE.pdf are written
    #[arg(long, value_name = "FILE", default_value = "record")]
    out: PathBuf,
    /// Write the result as one JSON document to a file, or with `-` to standard output in place of the text
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Do not print the path of the figure
    #[arg(long)]
    quiet: bool,
}

pub fn run(arguments: &CheckArguments) -> Result<ExitCode> {
    crate::output::check(arguments.json.as_deref())?;
    if let Some(path) = arguments.target.as_ref().filter(|path| OscillationRecord::is_described_in(path)) {
        return crate::sweep::check(path, &arguments.out, arguments.json.as_deref(), arguments.quiet);
    }
    let (experiment, files) = match &arguments.target {
        Some(path) if Study::is_study(path) => Study::open(path)?.read_experiment()?,
        Some(path) => Experiment::read(path)?,
        None => replica::embedded()?,
    };
    let summary = check::summary(&experiment, &files);
    draw(arguments, &experiment, &files)?;
    let provenance = Provenance::new("check", 1, 0, Study::hashes_of(&files)?).with_quantities(experiment.quantities());
    crate::output::show(
        arguments.json.as_deref(),
        &WithProvenance { provenance, body: &summary },
        &check_text(&summary),
    )?;
    if !arguments.quiet {
        crate::interrupt::print_message(&format!("Figure: {}.svg, .png and .pdf", arguments.out.display()));
    }
    Ok(ExitCode::from(if summary.is_sound() { 0 } else { WRONG }))
}

fn draw(arguments: &CheckArguments, experiment: &Experiment, files: &ExperimentFiles) -> Result<()> {
    let record = &experiment.record;
    let settled = &files.interpretation.settled;
    let mut text = Vec::new();
    if let Some(projection) = &settled.projection {
        text.push(format!("Positions are {projection}."));
    }
    if settled.zero_m.iter().any(|zero| *zero != 0.0) {
        let zeros: Vec<String> = settled.zero_m.iter().map(|zero| format!("{:.3}", 1e6 * zero)).collect();
        text.push(format!("{} µm are subtracted.", zeros.join(", ")));
    }
    if settled.is_reversed {
        text.push("The sign of the positions is reversed.".into());
    }
    // Rows that only mark a change of the force have no lateral position. A record with such rows is drawn without lateral positions.
    let across_m = settled.projection.as_ref().map_or(&[][..], |projection| &projection.across_m);
    let across_m = if across_m.len() == record.n_rows() { across_m } else { &[] };
    let raw = RawRecord {
        time_s: &record.time_s,
        force_n: &record.force_n,
        is_linear: record.force().is_linear(),
        position_m: &record.position_m,
        lateral_m: across_m,
        cycle: &record.cycle,
    };
    let svg = raw_record(&raw, &experiment.specimen_id, &text.join(" ").replace('-', "−"))?;
    let dir =
        arguments.out.parent().filter(|dir| !dir.as_os_str().is_empty()).map_or(PathBuf::from("."), PathBuf::from);
    let stem = arguments.out.file_name().map_or("record".into(), |name| name.to_string_lossy().into_owned());
    write_figure(&dir, &stem, &svg.translated(experiment.quantities()))
}
