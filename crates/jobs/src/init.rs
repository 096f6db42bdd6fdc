//! The job of `init`: a table of another maker becomes an experiment that the program reads.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::init_creep::RheometerCreep;
use super::init_sweep::described;
use base::error::{Error, Place, Result, Setting};
use base::files::{self, Content, write_together};
use base::toml_input::{UNKNOWN, quoted};
use documents::init::{InitColumn, InitSummary};
use posterior::study::sha256_hex;
use record::table::{
    Ask, ColumnName, Given, PositionColumns, Proposal, Question, TableDescription, TimeFormat, look, propose,
};
use record::{Direction, Sweep, Zero, sweep_columns};

/// What a caller says.
#[derive(Debug, Clone, Default)]
pub struct InitRequest {
    /// The table.
    pub file: PathBuf,
    /// Directory to write; the table's name without its ending where none is given.
    pub out: Option<PathBuf>,
    /// What is known of its columns.
    pub given: Given,
    /// Specimen identifier.
    pub id: Option<String>,
    /// Its species and the region of its eye.
    pub groups: [Option<String>; 2],
    /// Diameter of a spherical robot in mm, its density in kg/m³, the vitreous's diameter in mm and Poisson ratio.
    pub sizes: [Option<f64>; 4],
    /// Noise of the tracker in µm.
    pub noise_um: Option<f64>,
    /// Write over an experiment that is there.
    pub replace: bool,
}

/// Looks at the table, asks for what it cannot know, and writes the experiment beside a copy of the table. Gives what was understood, and the table's hash.
///
/// # Errors
/// Those of [`propose`]; [`Error::Input`] where an experiment is there already; [`Error::File`] when the operating system refuses.
pub fn run(request: &InitRequest, ask: Ask<'_>) -> Result<(InitSummary, String)> {
    let bytes = files::read(&request.file, Content::Table, "give a table that can be read")?;
    let name = file_name(&request.file)?;
    let out = request.out.clone().unwrap_or_else(|| PathBuf::from(Path::new(&name).file_stem().unwrap_or_default()));
    let toml_path = out.join("experiment.toml");
    if toml_path.exists() && !request.replace {
        return Err(Error::input(
            Place::file(&toml_path),
            "an experiment is there already",
            format!("give another directory with `{}`, or `{}` to write over it", Setting::Out, Setting::Replace),
        ));
    }
    if let Some(summary) = oscillation(request, &name, &bytes, &out)? {
        return Ok((summary, sha256_hex(&bytes)));
    }
    let looked = look(&request.file, &bytes).ok();
    let creep = looked.and_then(|looked| RheometerCreep::of(&looked, &request.given, request.sizes[3]));
    let given = creep.as_ref().map_or(&request.given, |creep| &creep.given);
    let mut proposal = propose(&request.file, &bytes, given, ask)?;
    if let Some(creep) = &creep {
        proposal.reasons.push(creep.reason());
        proposal.reasons.extend(sizes_are_idle(request));
    }
    let mut request = request.clone();
    let mut unknown = Vec::new();
    if creep.is_none() {
        for (size, (key, what)) in request.sizes.iter_mut().zip(SIZES) {
            *size = size.or_else(|| asked_size(what, ask));
            unknown.extend(size.is_none().then(|| key.to_string()));
        }
    }
    let toml = experiment_toml(&request, &name, &proposal, creep.as_ref());
    write(&out, &name, &bytes, &toml)?;
    let summary = InitSummary {
        directory: out.display().to_string(),
        file: name,
        columns: columns(&proposal),
        others: others(&proposal),
        reasons: proposal.reasons,
        rows: proposal.n_rows,
        rows_without_position: proposal.n_lost,
        unknown,
    };
    Ok((summary, sha256_hex(&bytes)))
}

/// The experiment and a copy of its table, both or neither.
fn write(out: &Path, name: &str, bytes: &[u8], toml: &str) -> Result<()> {
    std::fs::create_dir_all(out)
        .map_err(|error| Error::at_path("create", out, error, "give a directory that can be written to"))?;
    write_together(&[(&out.join(name), bytes), (&out.join("experiment.toml"), toml.as_bytes())])
}

/// Writes the description of a rheometer's oscillation; `None` where the table is none, or where the user says that it is a record in time.
fn oscillation(request: &InitRequest, name: &str, bytes: &[u8], out: &Path) -> Result<Option<InitSummary>> {
    let given = &request.given;
    if given.columns.iter().chain(&given.plane).any(Option::is_some) {
        return Ok(None);
    }
    let Ok(looked) = look(&request.file, bytes) else { return Ok(None) };
    let Some(columns) = sweep_columns(&looked) else { return Ok(None) };
    let (toml, mut summary) = described(name, request.id.as_deref(), request.sizes[3], &looked, &columns)?;
    summary.reasons.extend(sizes_are_idle(request));
    write(out, name, bytes, &toml)?;
    let (sweep, _) = Sweep::read(out)?;
    Ok(Some(InitSummary {
        directory: out.display().to_string(),
        rows: sweep.rows.len() + sweep.n_incomplete,
        ..summary
    }))
}

/// Said where sizes are given that a rheometer does not have.
fn sizes_are_idle(request: &InitRequest) -> Option<String> {
    let is_given = request.sizes[..3].iter().any(Option::is_some);
    is_given.then(|| "the sizes of robot and vitreous are not used: a rheometer has none of them".into())
}

/// Keys of [`InitRequest::sizes`], and what they are.
const SIZES: [(&str, &str); 4] = [
    ("robot.diameter_mm", "diameter of the robot, a sphere, in mm"),
    ("robot.density_kg_m3", "density of the robot in kg/m³"),
    ("vitreous.diameter_mm", "diameter of the vitreous in mm"),
    ("vitreous.poisson_ratio", "Poisson ratio of the vitreous (0.48 to 0.499 for a gel that is nearly incompressible)"),
];
/// Answers that are no numbers before a question is given up.
const TRIES: usize = 3;

fn asked_size(what: &str, ask: Ask<'_>) -> Option<f64> {
    let mut text = what.to_string();
    for _ in 0..TRIES {
        let answer = ask(&Question { text, choices: Vec::new(), proposal: Some(UNKNOWN.into()) })?;
        if answer == UNKNOWN {
            return None;
        }
        match answer.replace(',', ".").parse::<f64>() {
            Ok(size) if size.is_finite() => return Some(size),
            _ => text = format!("`{answer}` is no number; {what}"),
        }
    }
    None
}

fn file_name(file: &Path) -> Result<String> {
    let name = file.file_name().and_then(|name| name.to_str()).filter(|name| !name.contains(char::is_control));
    name.map(String::from).ok_or_else(|| {
        Error::input(
            Place::file(file),
            "this is no plain name of a file",
            "rename the table to letters, digits and dots",
        )
    })
}

fn name_of(column: &ColumnName) -> String {
    match column {
        ColumnName::Named(name) => name.clone(),
        ColumnName::Number(number) => format!("column {number}"),
    }
}

fn time_unit(format: &TimeFormat) -> String {
    match format {
        TimeFormat::Unit(unit) => unit.name.clone(),
        TimeFormat::Clock => "clock".into(),
        TimeFormat::Iso => "iso".into(),
    }
}

fn columns(proposal: &Proposal) -> Vec<InitColumn> {
    let TableDescription { time, force, position, cycle, .. } = &proposal.description;
    let column = |role: &str, name: &ColumnName, unit: String, range| InitColumn {
        role: role.into(),
        name: name_of(name),
        unit,
        range,
    };
    let micro = |range: [f64; 2]| Some(range.map(|x| 1e6 * x));
    let mut columns = vec![column("time", &time.0, time_unit(&time.1), Some([0.0, proposal.duration_s]))];
    columns
        .extend(force.as_ref().map(|(name, unit)| column("force", name, unit.name.clone(), micro(proposal.force_n))));
    match position {
        Some((PositionColumns::Along(name), unit)) => {
            columns.push(column("position", name, unit.name.clone(), micro(proposal.position_m)));
        }
        Some((PositionColumns::Plane([x, y]), unit)) => {
            columns.push(column("position_x", x, unit.name.clone(), None));
            columns.push(column("position_y", y, unit.name.clone(), None));
        }
        None => {}
    }
    columns.extend(cycle.as_ref().map(|cycle| column("cycle", cycle, String::new(), None)));
    columns
}

fn others(proposal: &Proposal) -> Vec<String> {
    let TableDescription { time, force, position, cycle, .. } = &proposal.description;
    let positions = position.iter().flat_map(|(columns, _)| columns.all());
    let force = force.iter().map(|(name, _)| name);
    let used: Vec<&ColumnName> = std::iter::once(&time.0).chain(force).chain(positions).chain(cycle).collect();
    let is_used = |(at, name): &(usize, &String)| {
        used.iter().any(|column| match column {
            ColumnName::Named(own) => own == *name,
            ColumnName::Number(number) => *number == at + 1,
        })
    };
    let free = proposal.columns.iter().enumerate().filter(|column| !is_used(column));
    free.map(|(at, name)| if name.is_empty() { format!("column {}", at + 1) } else { name.clone() }).collect()
}

fn column_name(column: &ColumnName) -> String {
    match column {
        ColumnName::Named(name) => quoted(name),
        ColumnName::Number(number) => number.to_string(),
    }
}

/// `experiment.toml`, with a comment a line.
fn experiment_toml(request: &InitRequest, file: &str, proposal: &Proposal, creep: Option<&RheometerCreep>) -> String {
    let table = &proposal.description;
    let layout = &table.layout;
    let stem = Path::new(file).file_stem().map_or("specimen".into(), |stem| stem.to_string_lossy().into_owned());
    let [diameter, density, vitreous, poisson] =
        request.sizes.map(|size| size.map_or_else(|| quoted(UNKNOWN), |size| format!("{size:?}")));
    let mut lines = String::from("# What was measured. Lines with \"?\" need a number before this can be read.\n");
    // A key after the head of a table stands in its own line.
    let mut line = |key: &str, value: String, comment: &str| {
        let (head, key) = key.rsplit_once('\n').map_or(("", key), |(head, key)| (head, key));
        let end = if head.is_empty() { "" } else { "\n" };
        let _ = writeln!(lines, "{head}{end}{:<36} # {comment}", format!("{key} = {value}"));
    };
    line(
        "\n[specimen]\nid",
        quoted(request.id.as_deref().unwrap_or(&stem)),
        "its name; repeats of one specimen share it",
    );
    let [species, region] = &request.groups;
    match species {
        Some(species) => line("species", quoted(species), "groups are formed by it"),
        None => line("# species", quoted("porcine"), "free text; groups are formed by it"),
    }
    match region {
        Some(region) => line("region", quoted(region), "groups are formed by it"),
        None => line("# region", quoted("central"), "free text; groups are formed by it"),
    }
    if let Some(RheometerCreep { compliance, .. }) = creep {
        let value = format!("{compliance:?}");
        line("\n[instrument]\ncompliance_per_m", value, "2 + 2ν: shear strain over shear stress of a law in E");
    } else {
        line("\n[robot]\nshape", quoted("sphere"), "or \"ellipsoid\", \"cylinder\" with `length_mm` and `orientation`");
        line("diameter_mm", diameter, "of the moving body");
        line("density_kg_m3", density, "of the moving body");
        line("\n[vitreous]\ndiameter_mm", vitreous, "of the gel around it, whose outer surface is fixed");
        line("poisson_ratio", poisson, "0.48 to 0.499 for a gel that is nearly incompressible");
        line("density_kg_m3", "1000.0".into(), "of water, if nothing better is known");
    }
    line("\n[measurement]\nfile", quoted(file), "the table as it was");
    line("source", quoted("not stated"), "where it comes from; synthetic or measured");
    match request.noise_um {
        Some(noise_um) => line("noise_um", format!("{noise_um:?}"), "known noise of the tracker"),
        None => line("# noise_um", "4.0".into(), "known noise of the tracker, if it is known"),
    }
    line("# calibration_cycles", "[1]".into(), "cycles that are fitted; the others are held out");
    line("delimiter", quoted(layout.delimiter.name()), "between cells");
    line("decimal", quoted(layout.decimal.name()), "before decimals");
    if let Some(encoding) = layout.encoding {
        line("encoding", quoted(encoding.name()), "of the letters: utf-8, utf-16-le, utf-16-be or latin-1");
    }
    match &layout.comment {
        Some(sign) => line("comment", quoted(sign), "lines that begin with it are not read"),
        None => line("# comment", quoted("#"), "lines that begin with it are not read; left out: #, % and //"),
    }
    if let Some(header) = layout.header_line {
        line("header_line", header.to_string(), "line of the columns' names");
    }
    line("first_row_line", layout.first_row_line.to_string(), "line of the first row");
    match proposal.frame.zero {
        Zero::AsWritten => line("# zero", quoted("first"), "which position is 0: \"first\", \"rest\" or a number"),
        Zero::First => line("zero", quoted("first"), "the first position is 0"),
        Zero::Rest => line("zero", quoted("rest"), "the position before the force acts is 0"),
        Zero::Fit => line("zero", quoted("fit"), "which position is 0 is fitted; or \"rest\", \"first\" or a number"),
        Zero::Value(value) => line("zero", format!("{value:?}"), "this position is 0"),
    }
    match proposal.frame.direction {
        Direction::Forward => line("direction", quoted("+"), "\"-\" where the position grows against the force"),
        Direction::Backward => line("direction", quoted("-"), "the position grows against the force"),
        Direction::Fit => line("direction", quoted("fit"), "the line of motion of x and y, or its degrees from x to y"),
        Direction::Degrees(degrees) => line("direction", format!("{degrees:?}"), "degrees from x to y"),
    }
    line("# force", quoted("hold"), "\"hold\" until the next row, or \"linear\" between rows");
    line("\n[measurement.columns]\ntime", column_name(&table.time.0), "name in the header, or number from 1");
    if let Some((force, _)) = &table.force {
        line("force", column_name(force), "the commanded force");
    }
    match table.position.as_ref().map(|(columns, _)| columns) {
        Some(PositionColumns::Along(position)) => line("position", column_name(position), "along the force"),
        Some(PositionColumns::Plane([x, y])) => {
            line("position_x", column_name(x), "projected on the line that `direction` names");
            line("position_y", column_name(y), "with it");
        }
        None => {}
    }
    if let Some(cycle) = &table.cycle {
        line("cycle", column_name(cycle), "left out, cycles are found from the force");
    }
    line(
        "\n[measurement.units]\ntime",
        quoted(&time_unit(&table.time.1)),
        "s, ms, min, h, \"clock\" (hh:mm:ss) or \"iso\"",
    );
    if let Some((_, unit)) = &table.force {
        let units = if creep.is_some() { "a pascal stands for a newton" } else { "N, mN, uN, nN or pN" };
        line("force", quoted(&unit.name), units);
    }
    if let Some((_, unit)) = &table.position {
        let units = match creep {
            Some(_) => "a strain of 1 stands for a metre",
            None => "m, mm, um or nm, or so many of one: \"0.65 um\" a pixel",
        };
        line("position", quoted(&unit.name), units);
    }
    lines
}
