//! `init`: converts a table of numbers to an experiment.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use vitreo_uq::base::error::Result;
use vitreo_uq::documents::init::{InitColumn, InitSummary};
use vitreo_uq::intake::{self, InitRequest};
use vitreo_uq::posterior::study::{Provenance, WithProvenance};
use vitreo_uq::record::Control;
use vitreo_uq::record::table::{TableSettings, unit as spelt};

use crate::questions;
use crate::text::significant;

/// Arguments of `init`.
#[derive(Args)]
pub struct InitArguments {
    /// Table of force and position against time: text, a workbook (.xlsx, .ods), or a file of HDF5, MATLAB, NumPy or TrackMate (docs/instruments.md)
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Directory to write [default: the table's name without its extension]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Column of the time, by name or number
    #[arg(long, value_name = "COLUMN")]
    time: Option<String>,
    /// Column of the force
    #[arg(long, value_name = "COLUMN")]
    force: Option<String>,
    /// File that contains the force or the coil current over time, if the table does not; both files use one clock
    #[arg(long, value_name = "FILE", conflicts_with = "force")]
    force_file: Option<PathBuf>,
    /// Column of the position along the force
    #[arg(long, value_name = "COLUMN")]
    position: Option<String>,
    /// Column of the x coordinate, if the position is not in one column; needs `--y`
    #[arg(long, value_name = "COLUMN")]
    x: Option<String>,
    /// Column of the y coordinate
    #[arg(long, value_name = "COLUMN")]
    y: Option<String>,
    /// Column of the z coordinate
    #[arg(long, value_name = "COLUMN")]
    z: Option<String>,
    /// Column of the frequency, in a table of an oscillation
    #[arg(long, value_name = "COLUMN", conflicts_with_all = ["time", "force", "position"])]
    frequency: Option<String>,
    /// Columns of storage and loss modulus, or of a modulus and the phase or the loss tangent
    #[arg(long, value_name = "COLUMN", num_args = 2, conflicts_with_all = ["time", "force", "position", "x", "y", "z", "cycle"])]
    moduli: Option<Vec<String>>,
    /// Tables to read from a file with several tables: numbers such as 1 or 1,2 (joined in time), all, or each (one experiment of each table)
    #[arg(long, value_name = "LIST")]
    table: Option<String>,
    /// Track to read from a table of several tracks, or all for one experiment per track
    #[arg(long, value_name = "TRACK")]
    track: Option<String>,
    /// Column with the number or name of the track, in a table of several tracks
    #[arg(long, value_name = "COLUMN")]
    track_column: Option<String>,
    /// Begin of the load, if earlier rows are missing: first (with the first row), or a time in s of the table's clock
    #[arg(long, value_name = "TIME", allow_negative_numbers = true)]
    load_start: Option<String>,
    /// Force of rows with an empty force: above (the force of the row above), zero, or left-out (not measured)
    #[arg(long, value_name = "MEANING")]
    blank_force: Option<String>,
    /// Thousands separator: `.`, `,` or none
    #[arg(long, value_name = "SIGN")]
    thousands: Option<String>,
    /// Treatment of times that start again. join: continue from the time of the row before
    #[arg(long, value_name = "join")]
    time_restarts: Option<String>,
    /// Treatment of equal times of a coarse clock. spread: distribute them evenly
    #[arg(long, value_name = "spread")]
    time_ties: Option<String>,
    /// Column with the number of the cycle
    #[arg(long, value_name = "COLUMN")]
    cycle: Option<String>,
    /// Unit of the time: s, ms, min, h, clock or elapsed (hh:mm:ss), hh:mm, mm:ss, iso, day-first or month-first (dates), or a multiple such as "0.05 s" per frame
    #[arg(long, value_name = "UNIT")]
    unit_time: Option<String>,
    /// Unit of the force: N, mN, uN, nN or pN; of a stress: Pa, kPa and others
    #[arg(long, value_name = "UNIT")]
    unit_force: Option<String>,
    /// Unit of the frequency of an oscillation: Hz or rad/s
    #[arg(long, value_name = "UNIT")]
    unit_frequency: Option<String>,
    /// Unit of the moduli of an oscillation, such as Pa or kPa
    #[arg(long, value_name = "UNIT")]
    unit_moduli: Option<String>,
    /// Unit of the position: m, mm, um or nm, or a multiple such as "0.65 um" per pixel; of a strain: % or 1
    #[arg(long, value_name = "UNIT")]
    unit_position: Option<String>,
    /// Name of the specimen [default: the table's name]
    #[arg(long, value_name = "ID")]
    id: Option<String>,
    /// Species of the specimen, a key for groups
    #[arg(long, value_name = "TEXT")]
    species: Option<String>,
    /// Region of the eye, a key for groups
    #[arg(long, value_name = "TEXT")]
    region: Option<String>,
    /// Diameter of the spherical bead or robot, in mm
    #[arg(long, value_name = "MM")]
    robot_diameter_mm: Option<f64>,
    /// Density of the bead or robot in kg/m³, used only for inertia
    #[arg(long, value_name = "KG/M3")]
    robot_density_kg_m3: Option<f64>,
    /// Diameter of the vitreous in mm
    #[arg(long, value_name = "MM")]
    vitreous_diameter_mm: Option<f64>,
    /// Poisson ratio of the vitreous
    #[arg(long, value_name = "RATIO", allow_negative_numbers = true)]
    poisson_ratio: Option<f64>,
    /// Radius in µm of a spherical tip that is pressed into the gel, in place of a bead
    #[arg(long, value_name = "UM", conflicts_with_all = ["robot_diameter_mm", "specimen_length_mm", "specimen_area_mm2"])]
    tip_radius_um: Option<f64>,
    /// Stiffness in N/m of the spring that carries the tip, if the position is not the tip's own
    #[arg(long, value_name = "N/M", conflicts_with_all = ["robot_diameter_mm", "specimen_length_mm", "specimen_area_mm2"])]
    cantilever_n_per_m: Option<f64>,
    /// Length in mm of a specimen that is stretched or compressed between grips or plates, in place of a bead
    #[arg(long, value_name = "MM", conflicts_with = "robot_diameter_mm")]
    specimen_length_mm: Option<f64>,
    /// Cross-section of the specimen in mm²
    #[arg(long, value_name = "MM²", conflicts_with = "robot_diameter_mm")]
    specimen_area_mm2: Option<f64>,
    /// Quantity that was commanded: the force in a creep test, or the position in a relaxation [default: the one that holds]
    #[arg(long, value_enum)]
    kind: Option<RecordKind>,
    /// Known noise standard deviation of the measured quantity: of a position in µm, a force in µN, a strain in % or a stress in Pa
    #[arg(long, value_name = "NUMBER")]
    noise_um: Option<f64>,
    /// Write the result as one JSON document to a file, or with `-` to standard output in place of the text
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Replace an existing experiment
    #[arg(long)]
    replace: bool,
    /// Do not print the next command on standard error
    #[arg(long)]
    quiet: bool,
}

/// Kind of a record over time.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum RecordKind {
    /// The force is commanded, and the position is measured
    Creep,
    /// The position is commanded, and the force is measured
    Relaxation,
}

pub fn run(arguments: &InitArguments) -> Result<ExitCode> {
    crate::output::check(arguments.json.as_deref())?;
    let given = TableSettings {
        columns: [&arguments.time, &arguments.force, &arguments.position, &arguments.cycle].map(Clone::clone),
        axes: [&arguments.x, &arguments.y, &arguments.z].map(Clone::clone),
        units: [&arguments.unit_time, &arguments.unit_force, &arguments.unit_position].map(Clone::clone),
        sweep_units: [&arguments.unit_frequency, &arguments.unit_moduli].map(Clone::clone),
        frequency: arguments.frequency.clone(),
        moduli: arguments.moduli.clone().and_then(|moduli| <[String; 2]>::try_from(moduli).ok()),
        tables: arguments.table.clone(),
        track: [arguments.track_column.clone(), arguments.track.clone()],
        blank_force: arguments.blank_force.clone(),
        thousands: arguments.thousands.clone(),
        time_restarts: arguments.time_restarts.clone(),
        time_ties: arguments.time_ties.clone(),
        ..TableSettings::default()
    };
    let request = InitRequest {
        file: arguments.file.clone(),
        out: arguments.out.clone(),
        known_columns: given,
        id: arguments.id.clone(),
        groups: [arguments.species.clone(), arguments.region.clone()],
        sizes: [arguments.robot_diameter_mm, arguments.vitreous_diameter_mm, arguments.poisson_ratio],
        tip: [arguments.tip_radius_um, arguments.cantilever_n_per_m],
        specimen: [arguments.specimen_length_mm, arguments.specimen_area_mm2],
        robot_density_kg_m3: arguments.robot_density_kg_m3,
        noise: arguments.noise_um,
        control: arguments.kind.map(|kind| match kind {
            RecordKind::Creep => Control::Force,
            RecordKind::Relaxation => Control::Position,
        }),
        load_start: arguments.load_start.clone(),
        force_file: arguments.force_file.clone(),
        replace: arguments.replace,
    };
    let may_ask = questions::can_ask_questions(arguments.quiet, arguments.json.as_deref());
    let (summary, sha256) =
        if may_ask { intake::run(&request, &mut questions::ask)? } else { intake::run(&request, &mut |_| None)? };
    let provenance = Provenance::new("init", 1, 0, BTreeMap::from([(summary.file.clone(), sha256)]));
    crate::output::show(arguments.json.as_deref(), &WithProvenance { provenance, body: &summary }, &words(&summary))?;
    if !arguments.quiet {
        crate::interrupt::print_message(&next(&summary));
    }
    Ok(ExitCode::SUCCESS)
}

fn words(summary: &InitSummary) -> String {
    let mut lines = vec![format!("{}: {} rows", summary.file, summary.rows)];
    lines.extend(summary.reasons.iter().map(|reason| format!("  {reason}")));
    lines.push(String::new());
    lines.extend(summary.columns.iter().map(column));
    let is_record = summary.columns.iter().any(|column| column.role == "time");
    if is_record && summary.columns.iter().all(|column| column.role != "cycle") {
        lines.push("  cycle      found from the repetition of the force".into());
    }
    if !summary.others.is_empty() {
        lines.push(format!("  unused     {}", summary.others.join(", ")));
    }
    if summary.rows_without_position > 0 {
        lines.push(format!("{} rows without a position are not compared.", summary.rows_without_position));
    }
    lines.join("\n") + "\n"
}

fn column(column: &InitColumn) -> String {
    let InitColumn { role, name, unit, range } = column;
    // The JSON document uses SI and micro-units, while the text uses the units of the table.
    let in_document = if role == "time" { 1.0 } else { 1e-6 };
    // A counted unit, such as "0.65 um" per pixel, is shown in its basic unit.
    let seen_in = unit.split_once(' ').map_or(unit.as_str(), |(_, of)| of);
    let (per, shown) = match spelt(seen_in) {
        Some(parsed_unit) => (in_document / parsed_unit.to_si(1.0), seen_in),
        None => (1.0, "s"),
    };
    let range = range.map_or(String::new(), |[low, high]| {
        // Adding 0.0 removes the sign of a negative zero.
        format!(": {} to {} {shown}", significant(low * per + 0.0), significant(high * per + 0.0))
    });
    let is_said = range.is_empty() && !unit.is_empty();
    let written = if is_said { format!(" ({unit})") } else { String::new() };
    format!("  {role:<10} `{name}`{written}{range}")
}

fn next(summary: &InitSummary) -> String {
    let toml = format!("{}/experiment.toml", summary.directory);
    let directory = crate::child::in_shell(summary.directory.as_ref());
    if !summary.experiments.is_empty() {
        let n = summary.experiments.len();
        return format!(
            "Wrote {n} experiments under {0}. Next: vitreo-uq sample {directory}/* if they are tests of one specimen, or vitreo-uq groups {directory}/* for several specimens",
            summary.directory
        );
    }
    let (command, first) = match summary.rows_without_position == summary.rows {
        true => ("design", " Give the noise (`noise_um`) in it."),
        false => ("sample", ""),
    };
    if summary.is_complete() {
        return format!("Wrote {toml}.{first} Next: vitreo-uq {command} {directory}");
    }
    format!(
        "Wrote {toml}. Fill in its lines with \"?\": {}.{first} Then run: vitreo-uq {command} {directory}",
        summary.unknown.join(", ")
    )
}
