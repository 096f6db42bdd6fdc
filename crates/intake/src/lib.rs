//! Makes an experiment that the program can read from a table of any origin, for the command `init`.

use std::path::{Path, PathBuf};

mod device;
mod force_log;
mod numbers;
mod preamble;
mod refusals;
mod request;
pub mod source;
mod specimens;
mod start;
mod states;
mod stress;
mod sweep;
mod toml;

use self::device::{Device, cross_section_m2, specimen_length_m};
use self::force_log::ForceLog;
use self::numbers::has_numbers;
use self::preamble::Preamble;
use self::refusals::{
    refuse_amplitudes, refuse_changed_columns, refuse_changed_numbers, refuse_contradictory_frequencies, refuse_flow,
    refuse_flow_curve, refuse_gap_of_rheometer, refuse_one_column_for_two, refuse_other_extension,
    refuse_other_modulus, refuse_ratio, refuse_relaxation_of_tip, refuse_several_columns, refuse_sheared_specimen,
    refuse_without_frequency, refuse_without_moduli, refuse_without_motion,
};
pub use self::request::InitRequest;
use self::source::TableSource;
use self::specimens::{SpecimenNames, specimen_names};
use self::start::{Start, has_absolute_strain, is_stretch, opposes};
use self::states::refuse_labelled_states;
use self::stress::{StressStrain, says_relaxation, strain_of_specimen, stress_of_specimen};
use self::sweep::{describe_sweep, refuse_relative_moduli, remarks, with_told_units};
use self::toml::{AXES, experiment_toml};
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, write_together};
use base::sha256::sha256_hex;
use base::units::Dimension;
use documents::init::{InitColumn, InitSummary};
use record::table::{
    Ask, ColumnName, InspectedTable, PositionColumns, TableDescription, TableProposal, TableSettings, choose_table,
    inspect_tables, propose, tracks,
};
use record::{Control, Direction, OscillationRecord, sweep_columns};

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
    if source.has_stored_numbers {
        request.known_columns.thousands.get_or_insert_with(|| "none".into());
    }
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
    request.refuse_impossible_sizes()?;
    // A file without a table of numbers is refused below.
    let tables = inspect_tables(place, bytes).unwrap_or_default();
    let named = TableSettings::default();
    let has_oscillation = tables.iter().any(|table| matches!(sweep_columns(table, &named), Ok(Some(_))));
    if request.known_columns.tables.is_none() && tables.len() > 1 && has_oscillation {
        request.known_columns.tables = Some(choose_table(place, bytes, ask)?.to_string());
    }
    let looked = chosen_table(tables, request.known_columns.tables.as_deref());
    if let Some(looked) = &looked
        && let Some(summary) = oscillation(&request, looked, source, out)?
    {
        return Ok(summary);
    }
    if let Some(looked) = &looked {
        refuse_amplitudes(place, bytes, &request.known_columns, looked)?;
    }
    let creep = match &looked {
        Some(looked) => StressStrain::of(looked, &request.known_columns, request.sizes[2])?,
        None => None,
    };
    if creep.is_none()
        && let Some(looked) = &looked
    {
        refuse_ratio(place, &request.known_columns, looked)?;
        refuse_without_frequency(place, &request.known_columns, looked)?;
        refuse_without_moduli(place, &request.known_columns, looked)?;
        refuse_flow_curve(place, &request.known_columns, looked)?;
    }
    let specimen = looked.as_ref().filter(|_| creep.is_none()).and_then(|looked| {
        let preamble = Preamble(&looked.preamble);
        Some((looked, specimen_length_m(&request, preamble)?, cross_section_m2(&request, preamble)))
    });
    let strain =
        specimen.as_ref().and_then(|(looked, length_m, _)| strain_of_specimen(&request, looked, 1e3 * length_m.value));
    let stress = specimen
        .filter(|_| strain.is_none())
        .and_then(|(looked, _, area_m2)| stress_of_specimen(&request, looked, area_m2?.value));
    // A strain beside a position is read if the user names it.
    let has_length =
        |looked: &InspectedTable| looked.units.iter().flatten().any(|unit| unit.dimension == Dimension::Length);
    let is_beside = request.known_columns.columns[2].is_none() && looked.as_ref().is_some_and(has_length);
    let read = strain.as_ref().filter(|_| !is_beside).or(stress.as_ref());
    let given = creep.as_ref().map(|creep| &creep.given).or(read);
    let mut proposal = propose(place, bytes, given.unwrap_or(&request.known_columns), ask)?;
    if read.is_some() {
        proposal.reasons.retain(|reason| !reason.contains("although the table says"));
        proposal.reasons.push(match stress.is_some() {
            true => "the force is the stress times the cross-section of the specimen".into(),
            false => "the position is the strain times the length of the specimen".into(),
        });
    } else if let Some(strain) = &strain {
        // An error would be one of questions that are already answered for the extension.
        if let Ok(strain) = propose(place, bytes, strain, &mut |_| None) {
            refuse_other_extension(place, &proposal, &strain)?;
        }
    }
    proposal.load_began_s = request.load_began_s(&proposal)?.or(proposal.load_began_s);
    refuse_changed_numbers(place, &request.known_columns, &proposal)?;
    let mut device = match creep {
        Some(mut creep) => {
            if let Some(looked) = looked.as_ref().filter(|_| request.specimen.iter().any(Option::is_some)) {
                creep.take_for_tension(looked, "sizes of a specimen between grips or plates are given");
            }
            creep.refuse_unlikely_plain(proposal.first_written_m, proposal.farthest_written_m())?;
            if !is_stretch(&proposal, Some(&creep)) {
                proposal.reasons.extend(creep.plain_remark());
            }
            if creep.constant.is_none() {
                refuse_flow(place, &proposal)?;
            }
            if let Some(looked) = &looked {
                refuse_other_modulus(place, &creep, looked, request.control.is_some())?;
            }
            if request.specimen.iter().all(Option::is_none) || creep.compliance != 1.0 {
                proposal.reasons.extend(unused_sizes_remark(&request));
            }
            Device::StressStrain(Box::new(creep))
        }
        None => {
            let preamble = Preamble(looked.as_ref().map_or(&[], |looked| &looked.preamble));
            refuse_gap_of_rheometer(place, &request.known_columns, &proposal)?;
            let device = Device::of(&request, preamble, &mut proposal, ask);
            refuse_sheared_specimen(place, &device, &proposal)?;
            device
        }
    };
    let constant = device.stress_strain().and_then(|creep| creep.constant);
    let is_held_strain = device.stress_strain().is_some()
        && (proposal.holds_as_written || proposal.is_steadier && looked.as_ref().is_some_and(says_relaxation));
    // A relaxation of a tip has no model.
    let holds_tip = device.is_tip() && proposal.creeps;
    let likely = if is_held_strain {
        Control::Position
    } else if holds_tip {
        Control::Force
    } else {
        proposal.control
    };
    let control = request.control.or(constant).unwrap_or(likely);
    if control == Control::Position || constant.is_some() || device.is_tip() {
        proposal.read_as_measured_force();
    }
    let rules = [&proposal.ramps, &proposal.until_row].into_iter().flatten().cloned().collect::<Vec<_>>();
    proposal.reasons.extend(rules);
    let is_assumed = request.control.is_none() && constant.is_none() && control == Control::Force;
    if is_assumed && device.stress_strain().is_some() && proposal.is_steadier {
        proposal.reasons.push(format!(
            "the strain stays near one value, while the stress varies more: if the strain was commanded, give `{} relaxation`",
            Setting::Kind
        ));
    }
    refuse_without_motion(place, &proposal, device.stress_strain())?;
    if device.is_tip() && control == Control::Position {
        return Err(refuse_relaxation_of_tip(place));
    }
    if device.is_tip() && request.load_start.is_some() {
        let (found, remedy) =
            ("a tip loads the gel from its contact on", "leave the option out, and export the approach with the hold");
        return Err(Error::input(InputPlace::setting(Setting::LoadStart), found, remedy));
    }
    let start = Start::of(place, &proposal, &device, control)?;
    if is_stretch(&proposal, device.stress_strain()) {
        proposal.reasons.push(
            "the strain begins near 1 and changes, so that it is read as a stretch: the first row counts as unstrained"
                .into(),
        );
        proposal.read_as_stretches();
        if let (Device::StressStrain(creep), Some(looked)) = (&mut device, &looked) {
            creep.take_for_tension(looked, "a stretch is one of tension");
        }
    } else if has_absolute_strain(device.stress_strain(), control)
        || start.is_under_way
        || control == Control::Position && start.load_start_s.is_some()
    {
        proposal.keep_written_positions();
        if control == Control::Position && device.stress_strain().is_some() && opposes(&proposal) {
            proposal.frame.direction = Direction::Backward;
            proposal.position_m = [-proposal.position_m[1], -proposal.position_m[0]];
            let text = "stress and strain have opposite signs, so that the strain counts with the other sign (direction = \"-\")";
            proposal.reasons.push(text.into());
        }
        if device.stress_strain().is_none() {
            let left_out = match start.left_out_s {
                Some(_) => ", and the force of this row is left out (left_out_s)",
                None => "",
            };
            proposal.reasons.push(format!(
                "the position of the first row is already that of the hold: positions count as in the table{left_out}"
            ));
        }
    }
    let is_of_instrument = device.stress_strain().is_some_and(|own| !own.is_of_specimen);
    if control == Control::Force && is_of_instrument && start.load_start_s.is_some() {
        proposal.keep_zero_of_instrument();
    }
    if control == Control::Position {
        proposal.count_commanded_positions();
        let [commanded, measured] = match device.stress_strain() {
            Some(_) => ["strain", "stress"],
            None => ["position", "force"],
        };
        if proposal.has_force_offset {
            proposal.reasons.push(format!(
                "the {measured} is not 0 before the {commanded} changes: its zero is fitted with the model (zero = \"fit\"), and the {commanded} counts from the first row"
            ));
        }
        if proposal.acts_from_row {
            proposal.reasons.push(format!(
                "the {commanded} jumps, and the {measured} answers in the row after each jump: each {commanded} acts from its row on (command = \"hold\")"
            ));
        } else if proposal.jumps_at_once && proposal.first_time_s == 0.0 && device.stress_strain().is_some() {
            let text = "the strain rises between the first two rows, and is read as a ramp; if it jumped, give each jump a row just before its time and one just after it, with the strain and an empty stress";
            proposal.reasons.push(text.into());
        }
    }
    proposal.reasons.extend(start.reason.map(String::from));
    let creep = device.stress_strain();
    let mut toml = experiment_toml(&request, source, &proposal, &device, control, &start);
    let is_unheld = match control {
        Control::Force => !proposal.force_holds,
        Control::Position => !proposal.position_holds,
    };
    match (creep, control) {
        (Some(creep), _) => proposal.reasons.push(creep.reason(control, is_unheld)),
        (None, Control::Position) => {
            let seen = if is_unheld { "the position moves" } else { "the position holds or moves at a constant rate" };
            proposal.reasons.push(format!(
                "{seen} and the force follows: a relaxation, whose position is commanded and whose force is measured"
            ));
        }
        (None, Control::Force) if is_unheld && proposal.description.force.is_some() => {
            proposal.reasons.push(
                "the force holds at no value for long, but is taken for the commanded quantity; if the position is commanded, use kind = \"relaxation\"".into(),
            );
        }
        (None, Control::Force) => {}
    }
    let mut unknown = device.unknown();
    if let Some(log) = log {
        toml += &log.toml();
        proposal.reasons.push(log.reason());
        unknown.extend(log.is_current().then(|| "actuation.calibration".to_string()));
    }
    let log_file = log.map(|log| (out.join(&log.source.name), log.source.bytes.as_slice()));
    write(out, (name, bytes), &toml, log_file)?;
    Ok(InitSummary {
        experiments: Vec::new(),
        directory: out.display().to_string(),
        file: name.clone(),
        columns: columns(&proposal, creep),
        others: others(&proposal),
        reasons: proposal.reasons,
        rows: proposal.n_rows,
        rows_without_position: proposal.n_lost,
        unknown,
    })
}

/// Value of the table setting that joins all tables of a file.
const ALL_TABLES: &str = "all";
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
    let tables = inspect_tables(&source.place, &source.bytes)?;
    let SpecimenNames { names, said } = specimen_names(&tables, &source.stem());
    let parts = (1..).zip(names).map(|(number, name): (usize, String)| {
        let id = Some(request.id.clone().unwrap_or(name));
        let known_columns =
            TableSettings { tables: Some(number.to_string()), takes_each_table: true, ..request.known_columns.clone() };
        let of_table = InitRequest { id, known_columns, ..request.clone() };
        (format!("table {number}"), one(&of_table, source, log, &out.join(number.to_string()), ask))
    });
    let mut summary = of_parts(out, parts)?
        .ok_or_else(|| Error::input(InputPlace::file(&source.place), "the file has no table", "give another file"))?;
    if tables.len() > 1 {
        let shown = summary.experiments.first().and_then(|first| Path::new(first).file_name());
        let shown = shown.map_or(String::new(), |number| number.to_string_lossy().into_owned());
        let of_tables = format!(
            "each of the {} tables is an experiment; rows and columns are those of table {shown}",
            tables.len()
        );
        let of_specimens = request.id.is_none().then_some(said);
        summary.reasons.splice(..0, std::iter::once(of_tables).chain(of_specimens));
    }
    Ok(summary)
}

/// Experiments of the parts of a file, each with its name. Parts that cannot be read are named with the reason, unless none can. `None` without parts.
fn of_parts(out: &Path, parts: impl Iterator<Item = (String, Result<InitSummary>)>) -> Result<Option<InitSummary>> {
    let (mut made, mut experiments, mut refused) = (None, Vec::new(), Vec::new());
    let mut first_refusal = None;
    for (name, part) in parts {
        match part {
            Ok(summary) => {
                experiments.push(summary.directory.clone());
                made.get_or_insert(summary);
            }
            Err(error @ Error::Input { .. }) => {
                refused.push(format!("{name} is left out: {error}"));
                first_refusal.get_or_insert(error);
            }
            Err(error) => return Err(error),
        }
    }
    match (made, first_refusal) {
        (Some(mut first), _) => {
            first.reasons.extend(refused);
            Ok(Some(InitSummary { directory: out.display().to_string(), experiments, ..first }))
        }
        (None, Some(error)) => Err(error),
        (None, None) => Ok(None),
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
    let stem = source.stem();
    let tracks = tracks(&source.place, &source.bytes, &request.known_columns)?;
    let parts = tracks.into_iter().map(|track| {
        // A track's name may contain any character, but a directory's name may not.
        let safe: String = track.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let name = format!("track {track}");
        let given = TableSettings {
            track: [request.known_columns.track[0].clone(), Some(track)],
            ..request.known_columns.clone()
        };
        let id = Some(format!("{}-{safe}", request.id.as_deref().unwrap_or(&stem)));
        let of_track = InitRequest { id, known_columns: given, ..request.clone() };
        (name, one(&of_track, source, log, &out.join(&safe), ask))
    });
    of_parts(out, parts)?.ok_or_else(|| {
        let remedy = format!("name the column of tracks with `{}`", Setting::TrackColumn);
        Error::input(InputPlace::file(&source.place), "the table has no column of tracks", remedy)
    })
}

/// Writes the experiment with a copy of its table, and of the log of its force. If one of the files cannot be written, no other is written either.
fn write(out: &Path, (name, bytes): (&str, &[u8]), toml: &str, log: Option<(PathBuf, &[u8])>) -> Result<()> {
    files::create_folders(out, "give a writable directory")?;
    let (table, description) = (out.join(name), out.join("experiment.toml"));
    let mut all: Vec<(&Path, &[u8])> = vec![(&table, bytes), (&description, toml.as_bytes())];
    all.extend(log.as_ref().map(|(path, bytes)| (path.as_path(), *bytes)));
    write_together(&all)
}

/// The table in a file, or the first of those that the user has chosen, with the lines of all of them: tables that are joined have equal columns.
fn chosen_table(mut tables: Vec<InspectedTable>, chosen: Option<&str>) -> Option<InspectedTable> {
    let numbers: Vec<usize> = match chosen {
        None => vec![1],
        Some(ALL_TABLES) => (1..=tables.len()).collect(),
        Some(list) => list.split(',').map(|number| number.trim().parse().ok()).collect::<Option<_>>()?,
    };
    let row_lines =
        numbers.iter().map(|number| tables.get(number.checked_sub(1)?).map(|table| table.layout.row_lines.clone()));
    let row_lines = row_lines.collect::<Option<Vec<_>>>()?.concat();
    let mut first = tables.swap_remove(*numbers.first()? - 1);
    first.layout.row_lines = row_lines;
    Some(first)
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
    let Some(columns) = sweep_columns(looked, given)? else { return Ok(None) };
    let is_told = given.frequency.is_some() || given.moduli.is_some();
    // Exports hold the columns of all kinds of tests, those of the others with zeros.
    if !is_told
        && !columns.first().is_some_and(|(_, frequency)| has_numbers(&source.bytes, looked, *frequency))
        && StressStrain::of(looked, given, request.sizes[2])?.is_some()
    {
        return Ok(None);
    }
    let moduli = columns.iter().filter(|(column, _)| column.dimension() == Dimension::Pressure);
    refuse_relative_moduli(&source.place, looked, given, moduli.map(|(_, place)| *place))?;
    let looked = &with_told_units(looked, given, &columns)?;
    refuse_changed_columns(&source.place, looked, &columns)?;
    let (toml, mut summary) = describe_sweep(source, request.id.as_deref(), request.sizes[2], looked, &columns)?;
    summary.reasons.extend(unused_sizes_remark(request));
    if given.moduli.is_none() {
        refuse_several_columns(&source.place, looked)?;
    }
    if given.frequency.is_none() {
        refuse_contradictory_frequencies(&source.place, &source.bytes, looked, &columns)?;
    }
    refuse_labelled_states(&source.place, &source.bytes, looked, &columns)?;
    let is_new = files::kind(out).is_none();
    write(out, (&source.name, &source.bytes), &toml, None)?;
    let sweep = match OscillationRecord::read(out) {
        Ok((sweep, _)) => sweep,
        // A description that cannot be read would be in the way of the next one.
        Err(error) => {
            if is_new {
                let _ = files::remove_all(out);
            }
            return Err(error);
        }
    };
    summary.reasons.extend(remarks(&sweep));
    Ok(Some(InitSummary {
        directory: out.display().to_string(),
        rows: sweep.rows.len() + sweep.n_incomplete + sweep.n_zero,
        ..summary
    }))
}

/// Remark that given sizes are ignored, because stress and strain do not depend on them. `None` if no sizes were given.
fn unused_sizes_remark(request: &InitRequest) -> Option<String> {
    let sizes = request.sizes[..2].iter().chain(&request.tip).chain(&request.specimen);
    let is_given = sizes.chain([&request.robot_density_kg_m3]).any(Option::is_some);
    is_given.then(|| "the sizes of the body are ignored: stress and strain do not depend on them".into())
}

fn columns(proposal: &TableProposal, stress_strain: Option<&StressStrain>) -> Vec<InitColumn> {
    let TableDescription { time, force, position, cycle, .. } = &proposal.description;
    let column = |role: &str, name: &ColumnName, unit: String, range| InitColumn {
        role: role.into(),
        name: name.to_string(),
        unit,
        range,
    };
    // A draft has no positions yet.
    let micro = |range: [f64; 2]| Some(range.map(|x| 1e6 * x)).filter(|_| range[0].is_finite());
    let mut columns = vec![column(
        "time",
        &time.0,
        time.1.name().into(),
        Some([0.0, proposal.duration_s].map(|s| s + proposal.first_time_s)),
    )];
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
