//! `init`: makes an experiment that the program can read from a table of any origin.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::init_force_log::ForceLog;
use super::init_indenter::StatedTip;
use super::init_source::TableSource;
use super::init_stress::StressStrain;
use super::init_sweep::describe_sweep;
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, write_together};
use base::quantities::Quantities;
use base::sha256::sha256_hex;
use base::toml_input::{UNKNOWN, quoted};
use documents::init::{InitColumn, InitSummary};
use record::table::{
    Ask, ColumnName, InspectedTable, PositionColumns, Question, TableDescription, TableProposal, TableSettings,
    choose_table, inspect_tables, propose, tracks,
};
use record::{Control, Direction, OscillationRecord, RELAXATION, STRESS_STRAIN, Zero, sweep_columns};

/// Settings of `init` that the caller chooses.
#[derive(Debug, Clone, Default)]
pub struct InitRequest {
    /// Path of the table.
    pub file: PathBuf,
    /// Directory of the new experiment. By default it has the table's name without its extension.
    pub out: Option<PathBuf>,
    /// Properties of the table's columns that the caller knows.
    pub known_columns: TableSettings,
    /// Specimen identifier.
    pub id: Option<String>,
    /// Species of the specimen and region of the eye, in this order. Cohorts form groups by them.
    pub groups: [Option<String>; 2],
    /// Diameter of a spherical robot (mm), diameter of the vitreous (mm) and Poisson's ratio.
    pub sizes: [Option<f64>; 3],
    /// Density of the robot in kg/m³.
    pub robot_density_kg_m3: Option<f64>,
    /// Noise standard deviation of the measured quantity: of a position in µm, a force in µN, a strain in % or a stress in Pa.
    pub noise: Option<f64>,
    /// Quantity that the experiment commands: the force or the position. `None` to infer it from the table.
    pub control: Option<Control>,
    /// File that contains the force, if the table does not.
    pub force_file: Option<PathBuf>,
    /// True if an existing experiment may be overwritten.
    pub replace: bool,
}

/// Reads the table, asks the user for missing information, and writes the experiment with a copy of the table. Returns the interpretation of the table
/// and the table's hash.
///
/// # Errors
/// The errors of [`TableSource::read`] and [`propose`]; [`Error::Input`] if an experiment exists already; [`Error::File`] if the operating system refuses.
pub fn run(request: &InitRequest, ask: Ask<'_>) -> Result<(InitSummary, String)> {
    let source = TableSource::read(&request.file)?;
    let log = request.force_file.as_deref().map(ForceLog::read).transpose()?;
    if log.as_ref().is_some_and(|log| log.source.name == source.name) {
        let remedy = "give one of the two files another name";
        return Err(Error::input(InputPlace::setting(Setting::ForceFile), "the two files have the same name", remedy));
    }
    let log = log.as_ref();
    let mut request = request.clone();
    request.known_columns.force_is_elsewhere = log.is_some();
    let request = &request;
    let out = request.out.clone().unwrap_or_else(|| source.stem().into());
    let mut summary = if request.known_columns.track[1].as_deref() == Some(ALL_TRACKS) {
        cohort(request, &source, log, &out, ask)?
    } else if request.known_columns.tables.as_deref() == Some(EACH_TABLE) {
        each_table(request, &source, log, &out, ask)?
    } else {
        one(request, &source, log, &out, ask)?
    };
    summary.reasons.splice(..0, source.notes.iter().cloned());
    Ok((summary, sha256_hex(&source.bytes)))
}

/// Writes one experiment, whose force comes from the log if there is one.
fn one(
    request: &InitRequest,
    source: &TableSource,
    log: Option<&ForceLog>,
    out: &Path,
    ask: Ask<'_>,
) -> Result<InitSummary> {
    let TableSource { place, name, bytes, .. } = source;
    let toml_path = out.join("experiment.toml");
    if files::kind(&toml_path).is_some() && !request.replace {
        return Err(Error::input(
            InputPlace::file(&toml_path),
            "there is already an experiment here",
            format!("give another directory with `{}`, or overwrite it with `{}`", Setting::Out, Setting::Replace),
        ));
    }
    let mut request = request.clone();
    refuse_one_column_for_two(&request.known_columns)?;
    // A file without a table of numbers is refused below.
    let tables = inspect_tables(place, bytes).unwrap_or_default();
    let has_oscillation = tables.iter().any(|table| sweep_columns(table).is_some());
    if request.known_columns.tables.is_none() && tables.len() > 1 && has_oscillation {
        request.known_columns.tables = Some(choose_table(place, bytes, ask)?.to_string());
    }
    let looked = chosen_table(tables, request.known_columns.tables.as_deref());
    if let Some(looked) = &looked
        && let Some(summary) = oscillation(&request, looked, source, out)?
    {
        return Ok(summary);
    }
    let mut creep = match &looked {
        Some(looked) => StressStrain::of(looked, &request.known_columns, request.sizes[2])?,
        None => None,
    };
    let given = creep.as_ref().map_or(&request.known_columns, |creep| &creep.given);
    let mut proposal = propose(place, bytes, given, ask)?;
    if let Some(creep) = &creep {
        creep.refuse_large_plain(proposal.position_m.iter().fold(0.0, |most, strain| strain.abs().max(most)))?;
    }
    if creep.is_some() {
        proposal.reasons.extend(unused_sizes_remark(&request));
    }
    let mut unknown = Vec::new();
    // A given size of the robot says that no tip was pressed into the gel.
    let tip = (creep.is_none() && request.sizes[0].is_none())
        .then(|| StatedTip::of(bytes, proposal.description.layout.first_row_line))
        .flatten();
    if let Some(tip) = &tip {
        proposal.reasons.push(format!(
            "line {} states the radius of a tip, so a spherical tip is pressed into the gel ([indenter])",
            tip.radius_m.line
        ));
    }
    if creep.is_none() && tip.is_none() {
        for (size, asked) in request.sizes.iter_mut().zip(&SIZES) {
            *size = size.or_else(|| prompt_size(asked, ask));
            unknown.extend(size.is_none().then(|| asked.key.to_string()));
        }
    }
    let constant = creep.as_ref().and_then(|creep| creep.constant);
    let control = request.control.or(constant).unwrap_or(proposal.control);
    if is_stretch(&proposal, creep.as_ref()) {
        proposal.reasons.push(
            "the strain begins near 1 and changes, so that it is read as a stretch: the first row counts as unstrained"
                .into(),
        );
        proposal.count_from_first_row();
        if let (Some(creep), Some(looked)) = (&mut creep, &looked) {
            creep.take_stretch_for_tension(looked);
        }
    } else if has_absolute_strain(creep.as_ref(), control) || answers_at_once(&proposal, creep.as_ref(), control) {
        proposal.keep_written_positions();
    }
    if load_start_s(&proposal, (creep.as_ref(), tip.as_ref()), control).is_some() {
        let text = match &creep {
            Some(_) if answers_at_once(&proposal, creep.as_ref(), control) => {
                "the strain of the first row, at time 0, is not 0, and a stress acts: the step is assumed to have begun just before it (load_start_s), so that this strain is the gel's instantaneous answer; \
                 if the instrument's zero was off, remove that line and write zero = \"fit\""
            }
            Some(_) => "the step began at 0, before the first row (load_start_s = 0)",
            None => {
                "a force acts in the first row, which is after time 0, and the body has moved before: the force is assumed to act since time 0 (load_start_s = 0); correct that line if it began at another time"
            }
        };
        proposal.reasons.push(text.into());
    }
    let mut toml = experiment_toml(&request, source, &proposal, (creep.as_ref(), tip.as_ref()), control);
    match (&creep, control) {
        (Some(creep), _) => proposal.reasons.push(creep.reason(control, proposal.nothing_holds)),
        (None, Control::Position) => {
            let seen = if proposal.nothing_holds { "the position moves" } else { "the position holds" };
            proposal.reasons.push(format!(
                "{seen} and the force follows: a relaxation, whose position is commanded and whose force is measured"
            ));
        }
        (None, Control::Force) if proposal.nothing_holds && proposal.description.force.is_some() => {
            proposal.reasons.push(
                "force and position both change all the time, and the force is taken for the commanded quantity; if the position is commanded, use kind = \"relaxation\"".into(),
            );
        }
        (None, Control::Force) => {}
    }
    if let Some(log) = log {
        toml += &log.toml();
        proposal.reasons.push(format!("the force comes from {} ([actuation])", log.source.name));
        unknown.extend(log.is_current().then(|| "actuation.calibration".to_string()));
    }
    let log_file = log.map(|log| (out.join(&log.source.name), log.source.bytes.as_slice()));
    write(out, (name, bytes), &toml, log_file)?;
    Ok(InitSummary {
        experiments: Vec::new(),
        directory: out.display().to_string(),
        file: name.clone(),
        columns: columns(&proposal, creep.as_ref()),
        others: others(&proposal),
        reasons: proposal.reasons,
        rows: proposal.n_rows,
        rows_without_position: proposal.n_lost,
        unknown,
    })
}

/// Refuses the same column for two quantities.
fn refuse_one_column_for_two(given: &TableSettings) -> Result<()> {
    let named: Vec<&String> = given.columns[..3].iter().flatten().collect();
    let twice = named.iter().enumerate().find(|(place, name)| named[..*place].contains(name));
    twice.map_or(Ok(()), |(_, name)| {
        Err(Error::input(
            InputPlace::default().at_key(name.as_str()),
            "this column is given for two quantities",
            "give time, force and position a column each",
        ))
    })
}

/// Value of the table setting that makes one experiment of each table of a file.
const EACH_TABLE: &str = "each";

/// Writes one experiment for each table of a file that holds several tests. Each has its own directory inside `out`. Tables that cannot be read are named with the reason.
fn each_table(
    request: &InitRequest,
    source: &TableSource,
    log: Option<&ForceLog>,
    out: &Path,
    ask: Ask<'_>,
) -> Result<InitSummary> {
    let (mut made, mut experiments, mut refused) = (None, Vec::new(), Vec::new());
    let mut first_refusal = None;
    for number in 1..=inspect_tables(&source.place, &source.bytes)?.len() {
        // Tests of one specimen share its name.
        let id = Some(request.id.clone().unwrap_or_else(|| source.stem()));
        let known_columns = TableSettings { tables: Some(number.to_string()), ..request.known_columns.clone() };
        let of_table = InitRequest { id, known_columns, ..request.clone() };
        match one(&of_table, source, log, &out.join(number.to_string()), ask) {
            Ok(summary) => {
                experiments.push(summary.directory.clone());
                made.get_or_insert(summary);
            }
            Err(error @ Error::Input { .. }) => {
                refused.push(format!("table {number} is left out: {error}"));
                first_refusal.get_or_insert(error);
            }
            Err(error) => return Err(error),
        }
    }
    match (made, first_refusal) {
        (Some(mut first), _) => {
            first.reasons.extend(refused);
            Ok(InitSummary { directory: out.display().to_string(), experiments, ..first })
        }
        (None, Some(error)) => Err(error),
        (None, None) => {
            Err(Error::input(InputPlace::file(&source.place), "the file has no table", "give another file"))
        }
    }
}

/// Value of the track setting that selects all tracks of a table.
const ALL_TRACKS: &str = "all";

/// Writes one experiment for each track (trajectory of one bead) in the table. Each experiment has its own directory inside `out`.
fn cohort(
    request: &InitRequest,
    source: &TableSource,
    log: Option<&ForceLog>,
    out: &Path,
    ask: Ask<'_>,
) -> Result<InitSummary> {
    let mut made = None;
    let mut experiments = Vec::new();
    let stem = source.stem();
    for track in tracks(&source.place, &source.bytes, &request.known_columns)? {
        // A track's name may contain any character, but a directory's name may not.
        let safe: String = track.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let given = TableSettings {
            track: [request.known_columns.track[0].clone(), Some(track)],
            ..request.known_columns.clone()
        };
        let id = Some(format!("{}-{safe}", request.id.as_deref().unwrap_or(&stem)));
        let of_track = InitRequest { id, known_columns: given, ..request.clone() };
        let summary = one(&of_track, source, log, &out.join(&safe), ask)?;
        experiments.push(summary.directory.clone());
        made.get_or_insert(summary);
    }
    let first = made.ok_or_else(|| {
        let remedy = format!("name the column of tracks with `{}`", Setting::TrackColumn);
        Error::input(InputPlace::file(&source.place), "the table has no column of tracks", remedy)
    })?;
    Ok(InitSummary { directory: out.display().to_string(), experiments, ..first })
}

/// Writes the experiment with a copy of its table, and of the log of its force. If one of the files cannot be written, no other is written either.
fn write(out: &Path, (name, bytes): (&str, &[u8]), toml: &str, log: Option<(PathBuf, &[u8])>) -> Result<()> {
    files::create_folders(out, "give a writable directory")?;
    let (table, description) = (out.join(name), out.join("experiment.toml"));
    let mut all: Vec<(&Path, &[u8])> = vec![(&table, bytes), (&description, toml.as_bytes())];
    all.extend(log.as_ref().map(|(path, bytes)| (path.as_path(), *bytes)));
    write_together(&all)
}

/// The only one of the tables in a file, or the one that the user has chosen. `None` if several tables are to be joined.
fn chosen_table(mut tables: Vec<InspectedTable>, chosen: Option<&str>) -> Option<InspectedTable> {
    let number = match chosen {
        None => 1,
        Some(number) => number.parse().ok()?,
    };
    (1..=tables.len()).contains(&number).then(|| tables.swap_remove(number - 1))
}

/// Writes an experiment for a rheometer's oscillation. `None` if the table is of another kind, or if the user names columns of a record over time.
fn oscillation(
    request: &InitRequest,
    looked: &InspectedTable,
    source: &TableSource,
    out: &Path,
) -> Result<Option<InitSummary>> {
    let given = &request.known_columns;
    if given.columns.iter().chain(&given.axes).any(Option::is_some) {
        return Ok(None);
    }
    let Some(columns) = sweep_columns(looked) else { return Ok(None) };
    let (toml, mut summary) = describe_sweep(source, request.id.as_deref(), request.sizes[2], looked, &columns)?;
    summary.reasons.extend(unused_sizes_remark(request));
    write(out, (&source.name, &source.bytes), &toml, None)?;
    let (sweep, _) = OscillationRecord::read(out)?;
    Ok(Some(InitSummary {
        directory: out.display().to_string(),
        rows: sweep.rows.len() + sweep.n_incomplete,
        ..summary
    }))
}

/// Remark that the given sizes of robot and vitreous are ignored, because a rheometer has neither. `None` if no sizes were given.
fn unused_sizes_remark(request: &InitRequest) -> Option<String> {
    let is_given = request.sizes[..2].iter().chain([&request.robot_density_kg_m3]).any(Option::is_some);
    is_given.then(|| "the sizes of robot and vitreous are ignored: a rheometer has neither".into())
}

/// Size that the user is asked for: key in the file, description and allowed values.
struct PromptedSize {
    key: &'static str,
    what: &'static str,
    allowed: fn(f64) -> bool,
    allowed_in_words: &'static str,
}

/// Sizes that the user may be asked for, in the order of [`InitRequest::sizes`].
const SIZES: [PromptedSize; 3] = [
    PromptedSize {
        key: "robot.diameter_mm",
        what: "diameter of the robot, a sphere, in mm",
        allowed: |x| x > 0.0,
        allowed_in_words: "a diameter is above 0",
    },
    PromptedSize {
        key: "vitreous.diameter_mm",
        what: "diameter of the vitreous in mm",
        allowed: |x| x > 0.0,
        allowed_in_words: "a diameter is above 0",
    },
    PromptedSize {
        key: "vitreous.poisson_ratio",
        what: "Poisson ratio of the vitreous (0.48 to 0.499 for a gel that is nearly incompressible)",
        allowed: |x| x > -1.0 && x < 0.5,
        allowed_in_words: "a Poisson ratio lies between −1 and 0.5, both excluded",
    },
];

/// Asks the user for a size until the answer is an allowed value. `None` if the user does not know the value or cannot be asked.
fn prompt_size(size: &PromptedSize, ask: Ask<'_>) -> Option<f64> {
    let mut text = size.what.to_string();
    loop {
        let question = Question { text, choices: Vec::new(), also: Vec::new(), proposal: Some(UNKNOWN.into()) };
        let answer = ask(&question)?;
        if answer == UNKNOWN {
            return None;
        }
        text = match answer.replace(',', ".").parse::<f64>() {
            Ok(value) if value.is_finite() && (size.allowed)(value) => return Some(value),
            Ok(_) => format!("`{answer}`: {}; {}", size.allowed_in_words, size.what),
            Err(_) => format!("`{answer}` is not a number; {}", size.what),
        };
        // A program may give the same wrong answer forever. The loop ends when a wrong answer is repeated.
        if text == question.text {
            return None;
        }
    }
}

fn name_of(column: &ColumnName) -> String {
    match column {
        ColumnName::Named(name) => name.clone(),
        ColumnName::Number(number) => format!("column {number}"),
    }
}

/// Keys of the position's coordinates in `experiment.toml`.
const AXES: [&str; 3] = ["position_x", "position_y", "position_z"];

fn columns(proposal: &TableProposal, stress_strain: Option<&StressStrain>) -> Vec<InitColumn> {
    let TableDescription { time, force, position, cycle, .. } = &proposal.description;
    let column = |role: &str, name: &ColumnName, unit: String, range| InitColumn {
        role: role.into(),
        name: name_of(name),
        unit,
        range,
    };
    let micro = |range: [f64; 2]| Some(range.map(|x| 1e6 * x));
    let mut columns = vec![column("time", &time.0, time.1.name().into(), Some([0.0, proposal.duration_s]))];
    columns
        .extend(force.as_ref().map(|(name, unit)| column("force", name, unit.name.clone(), micro(proposal.force_n))));
    match position {
        Some((PositionColumns::Along(name), unit)) => {
            columns.push(column("position", name, unit.name.clone(), micro(proposal.position_m)));
        }
        Some((PositionColumns::Axes(axes), unit)) => {
            columns.extend(AXES.iter().zip(axes).map(|(key, axis)| column(key, axis, unit.name.clone(), None)));
        }
        None => {}
    }
    if let Some(StressStrain { constant, .. }) = stress_strain {
        let without = constant.map(|control| if control == Control::Force { "force" } else { "position" });
        columns.retain(|column| Some(column.role.as_str()) != without);
        for column in &mut columns {
            let called = match column.role.as_str() {
                "force" => ("stress", "Pa"),
                "position" => ("strain", "%"),
                _ => continue,
            };
            (column.role, column.unit) = (called.0.into(), called.1.into());
        }
    }
    columns.extend(cycle.as_ref().map(|cycle| column("cycle", cycle, String::new(), None)));
    columns
}

fn others(proposal: &TableProposal) -> Vec<String> {
    let TableDescription { time, force, position, cycle, track, .. } = &proposal.description;
    let positions = position.iter().flat_map(|(columns, _)| columns.all());
    let [force, track] = [force.iter().map(|(name, _)| name).next(), track.iter().map(|(name, _)| name).next()];
    let used: Vec<&ColumnName> =
        std::iter::once(&time.0).chain(force).chain(positions).chain(cycle).chain(track).collect();
    let is_used = |(at, name): &(usize, &String)| {
        used.iter().any(|column| match column {
            ColumnName::Named(label) => label == *name,
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

/// Returns true if strains keep the zero and the sign of the table. A commanded strain does, because a record may begin in the middle of a hold, and so does a
/// published compliance or modulus.
fn has_absolute_strain(stress_strain: Option<&StressStrain>, control: Control) -> bool {
    stress_strain.is_some_and(|own| control == Control::Position || own.constant.is_some())
}

/// Largest time of the first loaded row at which a rheometer's load still counts as begun at time 0, divided by the record's duration.
const FIRST_ROW: f64 = 0.01;

/// Time from a rheometer's step to the first row at time 0, divided by the record's duration, where that row shows the strain after the step.
const JUST_BEFORE: f64 = 1e-9;

/// True if the user's units say that the columns are stress and strain, and the strains are stretches.
fn is_stretch(proposal: &TableProposal, stress_strain: Option<&StressStrain>) -> bool {
    stress_strain.is_some_and(|own| own.is_told) && proposal.is_stretch()
}

/// True for a creep of stress and strain if a stress acts in the first row, at time 0, and the strain has already jumped. Stretches count from the first row.
fn answers_at_once(proposal: &TableProposal, stress_strain: Option<&StressStrain>, control: Control) -> bool {
    stress_strain.is_some()
        && control == Control::Force
        && !is_stretch(proposal, stress_strain)
        && proposal.loaded_from_s == Some(0.0)
        && proposal.starts_displaced()
}

/// Least time of the first row, in intervals between rows, at which a bead's record counts as begun after its load. Clocks may count from 0 or from 1.
const LATE_INTERVALS: f64 = 1.5;
/// Least such time if the first position is the motion that the load causes in it. The two are equal if their ratio is in this range.
const FIRST_INTERVAL: f64 = 0.5;
const AS_LOADED: [f64; 2] = [0.6, 1.6];
/// Largest such time, divided by the record's duration. Later first rows are times of another clock.
const LATEST: f64 = 0.1;

/// Time at which the load of the first row begins, in s of the table's clock: 0 if the first loaded row follows soon after time 0, otherwise `None`.
fn load_start_s(
    proposal: &TableProposal,
    (creep, tip): (Option<&StressStrain>, Option<&StatedTip>),
    control: Control,
) -> Option<f64> {
    // A tip is pressed from its own contact on, and a prescribed position has no load.
    if tip.is_some() || creep.is_none() && control == Control::Position {
        return None;
    }
    // Times of a published compliance or modulus count from the step.
    if creep.is_some_and(|creep| creep.constant.is_some())
        && proposal.loaded_from_s.is_some_and(|first_s| first_s > 0.0)
    {
        return Some(0.0);
    }
    let first_s = proposal.loaded_from_s?;
    if answers_at_once(proposal, creep, control) {
        return Some(-JUST_BEFORE * proposal.duration_s);
    }
    let begins_late = match creep {
        Some(_) => first_s > 0.0 && first_s <= FIRST_ROW * proposal.duration_s,
        None => {
            let interval_s = proposal.duration_s / proposal.n_rows.saturating_sub(1).max(1) as f64;
            let is_as_loaded = proposal.first_answer.is_some_and(|ratio| (AS_LOADED[0]..AS_LOADED[1]).contains(&ratio));
            let least = if is_as_loaded { FIRST_INTERVAL } else { LATE_INTERVALS };
            first_s > least * interval_s
                && first_s <= LATEST * proposal.duration_s
                && (is_as_loaded || proposal.starts_displaced())
        }
    };
    begins_late.then_some(0.0)
}

/// True if the column of the position is named as a depth of indentation, from which the instrument has subtracted the deflection of the spring.
fn positions_are_depths(table: &TableDescription) -> bool {
    let is_depth = |column: &ColumnName| name_of(column).to_lowercase().contains("indentation");
    table.position.as_ref().is_some_and(|(columns, _)| columns.all().iter().any(is_depth))
}

/// Makes the text of `experiment.toml`, with a comment on each line.
fn experiment_toml(
    request: &InitRequest,
    source: &TableSource,
    proposal: &TableProposal,
    (creep, tip): (Option<&StressStrain>, Option<&StatedTip>),
    control: Control,
) -> String {
    let table = &proposal.description;
    let layout = &table.layout;
    let stem = source.stem();
    let [diameter, vitreous, poisson] =
        request.sizes.map(|size| size.map_or_else(|| quoted(UNKNOWN), |size| format!("{size:?}")));
    let mut lines = String::from(
        "# Description of the experiment. Replace each \"?\" by a number: the program needs all of them to read the file.\n",
    );
    // TOML assigns a key to the nearest table header above it. A `key` that begins a new table therefore contains the header and a line break.
    let mut line = |key: &str, value: String, comment: &str| {
        let (head, key) = key.rsplit_once('\n').map_or(("", key), |(head, key)| (head, key));
        let end = if head.is_empty() { "" } else { "\n" };
        let _ = writeln!(lines, "{head}{end}{:<36} # {comment}", format!("{key} = {value}"));
    };
    line(
        "\n[specimen]\nid",
        quoted(request.id.as_deref().unwrap_or(&stem)),
        "name of the specimen; repeats of one specimen share it",
    );
    let [species, region] = &request.groups;
    match species {
        Some(species) => line("species", quoted(species), "cohorts can be grouped by species"),
        None => line("# species", quoted("porcine"), "free text; cohorts can be grouped by species"),
    }
    match region {
        Some(region) => line("region", quoted(region), "cohorts can be grouped by region"),
        None => line("# region", quoted("central"), "free text; cohorts can be grouped by region"),
    }
    if let Some(StressStrain { compliance, .. }) = creep {
        let value = format!("{compliance:?}");
        line("\n[instrument]\ncompliance_per_m", value, "2 + 2ν: Young's modulus over shear modulus; 1 for tension");
        line("measures", quoted(STRESS_STRAIN), "1 Pa is entered as 1 N, and a strain of 1 as 1 m");
    } else if let Some(StatedTip { radius_m, stiffness_n_per_m }) = tip {
        line("\n[indenter]\nexponent", "1.5".into(), "1.5 for a sphere, 2 for a cone or pyramid, 1 for a flat punch");
        let radius_um = format!("{:?}", 1e6 * radius_m.value);
        line("tip_radius_um", radius_um, &format!("from line {} of the table", radius_m.line));
        let poisson = request.sizes[2].map_or("0.5".into(), |ratio| format!("{ratio:?}"));
        line("poisson_ratio", poisson, "of the gel; 0.5 if it keeps its volume");
        if let Some(stiffness) = stiffness_n_per_m {
            let is_depth = positions_are_depths(table);
            let key = if is_depth { "# cantilever_n_per_m" } else { "cantilever_n_per_m" };
            let why = if is_depth { "; the table gives the depth, which the spring does not change" } else { "" };
            line(key, format!("{:?}", stiffness.value), &format!("from line {} of the table{why}", stiffness.line));
        }
    } else {
        line("\n[robot]\nshape", quoted("sphere"), "or \"ellipsoid\", \"cylinder\" with `length_mm` and `orientation`");
        line("diameter_mm", diameter, "of the moving body");
        match request.robot_density_kg_m3 {
            Some(density) => line("density_kg_m3", format!("{density:?}"), "of the moving body; used only for inertia"),
            None => line("# density_kg_m3", "7500.0".into(), "of the moving body; used only for inertia"),
        }
        line("\n[vitreous]\ndiameter_mm", vitreous, "of the gel around the robot; the gel's outer surface is fixed");
        line("poisson_ratio", poisson, "0.48 to 0.499 for a gel that is nearly incompressible");
        line("density_kg_m3", "1000.0".into(), "density of water, as a default");
    }
    line("\n[measurement]\nfile", quoted(&source.name), "copy of the table, as text");
    line("source", quoted(&source.origin), "origin of the table; synthetic or measured");
    if control == Control::Position {
        line("kind", quoted(RELAXATION), "the position is commanded, and the force is measured");
    }
    let constant = creep.and_then(|creep| creep.constant);
    if let Some(of) = constant {
        let what = if of == Control::Force { "stress in every row, in Pa" } else { "strain in every row" };
        line("constant", "1.0".into(), what);
    }
    let quantities = Quantities::of(control == Control::Position, creep.is_some());
    let noise_key = &*quantities.map_or("noise_um".into(), |quantities| quantities.key("noise_um"));
    match request.noise {
        Some(noise) => line(noise_key, format!("{noise:?}"), "known noise of the measured quantity"),
        None => line(&format!("# {noise_key}"), "4.0".into(), "noise of the measured quantity, if it is known"),
    }
    line("# calibration_cycles", "[1]".into(), "cycles that are fitted; the others are held out");
    line("delimiter", quoted(layout.delimiter.name()), "between cells");
    line("decimal", quoted(layout.decimal.name()), "before decimals");
    if let Some(encoding) = layout.encoding {
        line("encoding", quoted(encoding.name()), "of the text: utf-8, utf-16-le, utf-16-be or latin-1");
    }
    match &layout.comment {
        Some(sign) => line("comment", quoted(sign), "lines that begin with this sign are skipped"),
        None => line("# comment", quoted("#"), "lines that begin with this sign are skipped; default: #, % and //"),
    }
    if let Some(header) = layout.header_line {
        line("header_line", header.to_string(), "line of the columns' names");
    }
    if layout.row_lines.is_empty() {
        line("first_row_line", layout.first_row_line.to_string(), "line of the first row");
    } else {
        let lines = format!("{:?}", layout.row_lines);
        line("row_lines", lines, "first and last line of each table, in order of reading");
    }
    if let Some(sign) = layout.thousands {
        line("thousands", quoted(sign.name()), "sign between thousands");
    }
    if table.time_rules.joins_restarts {
        line("time_restarts", quoted("join"), "a restarted clock continues from the row before");
    }
    if table.time_rules.spreads_ties {
        line("time_ties", quoted("spread"), "equal times of a coarse clock are spread evenly");
    }
    if let Some(blank) = table.blank_force {
        line("blank_force", quoted(blank.name()), "value of a blank force: that of the row \"above\", or \"zero\"");
    }
    if !table.lost.is_empty() {
        line("lost", format!("{:?}", table.lost), "position values that mean lost tracking, in the column's unit");
    }
    if let Some((_, track)) = &table.track {
        line("track", quoted(track), "only the rows of this track are read");
    }
    match proposal.frame.zero {
        Zero::AsWritten => {
            line("# zero", quoted("first"), "position that counts as 0: \"first\", \"rest\" or a number")
        }
        Zero::First => line("zero", quoted("first"), "the first position counts as 0"),
        Zero::Rest => line("zero", quoted("rest"), "the position before the force acts counts as 0"),
        Zero::Fit => {
            line("zero", quoted("fit"), "the position that counts as 0 is fitted; or \"rest\", \"first\" or a number")
        }
        Zero::Value(value) => line("zero", format!("{value:?}"), "this position counts as 0"),
    }
    match proposal.frame.direction {
        Direction::Forward => line("direction", quoted("+"), "\"-\" if the position grows against the force"),
        Direction::Backward => line("direction", quoted("-"), "the position grows against the force"),
        Direction::Fit => line(
            "direction",
            quoted("fit"),
            "the direction of motion is fitted; or give its angle from x to y in degrees",
        ),
        Direction::Degrees(degrees) => line("direction", format!("{degrees:?}"), "degrees from x to y"),
    }
    match control {
        Control::Force if proposal.has_noisy_levels => {
            line("force", quoted("levels"), "from a sensor: each hold takes its median; or \"hold\", \"linear\"");
        }
        Control::Force if tip.is_some() => line("force", quoted("linear"), "measured at every row"),
        Control::Force if table.force.is_none() => {}
        Control::Force => line("# force", quoted("hold"), "\"hold\" until the next row, or \"linear\" between rows"),
        Control::Position => {
            line("command", quoted("linear"), "between rows; \"hold\" until the next row, or \"levels\" of a sensor");
        }
    }
    match load_start_s(proposal, (creep, tip), control) {
        Some(start_s) => {
            line("load_start_s", format!("{start_s:?}"), "time at which the force of the first row began");
        }
        None => {
            line("# load_start_s", "-3.0".into(), "time at which the force of the first row began, if before that row")
        }
    }
    line("\n[measurement.columns]\ntime", column_name(&table.time.0), "name in the header, or number from 1");
    if let Some((force, _)) = table.force.as_ref().filter(|_| constant != Some(Control::Force)) {
        line(
            "force",
            column_name(force),
            if control == Control::Force { "the commanded force" } else { "the measured force" },
        );
    }
    let positions = table.position.as_ref().filter(|_| constant != Some(Control::Position));
    match positions.map(|(columns, _)| columns) {
        Some(PositionColumns::Along(position)) => line("position", column_name(position), "along the force"),
        Some(PositionColumns::Axes(axes)) => {
            for (key, axis) in AXES.iter().zip(axes) {
                line(key, column_name(axis), "projected on the line given by `direction`");
            }
        }
        None => {}
    }
    if let Some(cycle) = &table.cycle {
        line("cycle", column_name(cycle), "without this column, cycles are found from the force");
    }
    if let Some((track, _)) = &table.track {
        line("track", column_name(track), "number or name of each row's track");
    }
    line(
        "\n[measurement.units]\ntime",
        quoted(table.time.1.name()),
        "s, ms, min, h, \"clock\" (hh:mm:ss), or dates: \"iso\", \"day-first\", \"month-first\"",
    );
    if let Some((_, unit)) = table.force.as_ref().filter(|_| constant != Some(Control::Force)) {
        let units = if creep.is_some() { "1 Pa is entered as 1 N" } else { "N, mN, uN, nN or pN" };
        line("force", quoted(&unit.name), units);
    }
    if let Some((_, unit)) = positions {
        let units = match creep {
            Some(_) => "a strain of 1 is entered as 1 m",
            None => "m, mm, um or nm, or a multiple of one: \"0.65 um\" for a pixel",
        };
        line("position", quoted(&unit.name), units);
    }
    lines
}
