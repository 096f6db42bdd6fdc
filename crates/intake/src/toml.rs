//! Text of `experiment.toml` for a record over time.

use std::fmt::Write as _;

use super::device::Device;
use super::request::InitRequest;
use super::source::TableSource;
use super::start::Start;
use base::quantities::Quantities;
use base::toml_input::quoted;
use record::table::{ColumnName, PositionColumns, TableProposal};
use record::{Control, Direction, RELAXATION, Zero};

/// Keys of the position's coordinates in `experiment.toml`.
pub(super) const AXES: [&str; 3] = ["position_x", "position_y", "position_z"];

fn column_name(column: &ColumnName) -> String {
    match column {
        ColumnName::Named(name) => quoted(name),
        ColumnName::Number(number) => number.to_string(),
    }
}

/// Adds a line with a comment to the text of an `experiment.toml`. TOML assigns a key to the nearest table header above it. A `key` that begins a new table
/// therefore contains the header and a line break.
pub(super) fn add_line(lines: &mut String, key: &str, value: String, comment: &str) {
    let (head, key) = key.rsplit_once('\n').unwrap_or(("", key));
    let end = if head.is_empty() { "" } else { "\n" };
    let _ = writeln!(lines, "{head}{end}{:<36} # {comment}", format!("{key} = {value}"));
}

/// Makes the text of `experiment.toml`, with a comment on each line.
pub(super) fn experiment_toml(
    request: &InitRequest,
    source: &TableSource,
    proposal: &TableProposal,
    device: &Device,
    control: Control,
    start: &Start,
) -> String {
    let table = &proposal.description;
    let layout = &table.layout;
    let stem = source.stem();
    let creep = device.stress_strain();
    let mut lines = String::from(
        "# Description of the experiment. Replace each \"?\" by a number: the program needs all of them to read the file.\n",
    );
    let mut line = |key: &str, value, comment: &str| add_line(&mut lines, key, value, comment);
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
    device.write(request, proposal, &mut line);
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
    if table.acts_until_row {
        line("force_acts", quoted("until-row"), "each force has acted since the row before");
    }
    if let Some(blank) = table.blank_force {
        line(
            "blank_force",
            quoted(blank.name()),
            "of a row without one: that of the row \"above\", \"zero\", or \"left-out\" if it was not measured",
        );
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
        Zero::Fit if control == Control::Position => {
            line("zero", quoted("fit"), "positions count from the first row, and the offset of the force is fitted")
        }
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
        Control::Force if proposal.ramps.is_some() => {
            line("force", quoted("linear"), "between rows, as sampled ramps are; or \"hold\" until the next row");
        }
        Control::Force if device.is_tip() && !proposal.force_jumps => {
            line("force", quoted("linear"), "measured at every row; or \"hold\" until the next row");
        }
        Control::Force if table.force.is_none() => {}
        Control::Force => line("# force", quoted("hold"), "\"hold\" until the next row, or \"linear\" between rows"),
        Control::Position if proposal.acts_from_row => {
            line("command", quoted("hold"), "each position acts from its row on; or \"linear\" between rows");
        }
        Control::Position => {
            line("command", quoted("linear"), "between rows; \"hold\" until the next row, or \"levels\" of a sensor");
        }
    }
    match start.load_start_s {
        Some(start_s) => {
            line("load_start_s", format!("{start_s:?}"), "time at which the force of the first row began");
        }
        None if device.is_tip() => {}
        None => {
            line("# load_start_s", "-3.0".into(), "time at which the force of the first row began, if before that row")
        }
    }
    if let Some(interval_s) = start.left_out_s {
        line("left_out_s", format!("[{interval_s:?}]"), "the first row, in the middle of the step");
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
        "s, ms, min, h, \"clock\" or \"elapsed\" (hh:mm:ss), \"hh:mm\", or dates: \"iso\", \"day-first\", \"month-first\"",
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
