//! Inference of the description of a table, with a reason for each choice.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use super::asked::{Ask, Question, TableSettings};
use super::blocks::{Header, TableBlock};
use super::description::{BlankForce, ColumnName, PositionColumns, TableDescription, TableLayout, TimeFormat};
use super::read::read_described;
use super::roles::{ColumnMatch, KnownColumns, Role, unknown_unit};
use super::several::{ask_table, chosen_tables, describe_left_out, describe_tables, tables_of};
use super::spelling::{
    ParsedUnit, clock_s, counted, hours_minutes_s, is_date_time, is_hours_minutes, split_unit, unit,
};
use super::steps::{StepClock, is_of_step};
use super::text::{Decimal, Delimiter, Encoding, Thousands, cells, comment_sign, decode_detected, is_blank_or_comment};
use crate::control::{
    Control, answers_after_jumps, creeps_under_held_force, has_only_jumps, holds, holds_as_written, is_steadier,
    opposes,
};
use crate::force::{has_noisy_levels, ramps_between_holds};
use crate::frame::{Direction, Frame, Zero, is_zeroed_by_first_row, moves_against_force, offset_at_rest, rest_m};
use crate::lost::repeated_outliers;
use crate::noise::written_step_m;
use crate::robust::{SD_PER_MAD, median};
use crate::times::TimeRules;
use crate::trajectory::{Trajectory, is_lost};
use base::error::{Error, InputPlace, Result, Setting};
use base::units::Dimension;

/// Lower-case names of columns that name a tracker's tracks; `id` may follow.
const TRACKS: [&str; 5] = ["track", "particle", "trajectory", "bead", "spottrack"];
/// Lower-case names of columns that name specimens, of which a table holds one after the other; `id` or `name` may follow.
const SPECIMENS: [&str; 8] = ["specimen", "sample", "robot", "roi", "well", "gel", "eye", "replicate"];
/// Least number of rows of a specimen. A column with fewer counts something else.
const FEWEST_OF_SPECIMEN: usize = 10;
/// Largest number of tracks that are distinguished in a table.
const MOST_TRACKS: usize = 1_000;
/// Least numbers of cells from which a sign counts as a thousands separator. At least `FEWEST_GROUPED` numbers must contain the sign, and at least
/// `FEWEST_SMALL` numbers below 1,000 must lack it. If the sign were a decimal sign, about ten of a hundred numbers would have only one or two
/// decimals.
const FEWEST_GROUPED: usize = 8;
const FEWEST_SMALL: usize = 2;
/// Largest jump of the position from one table to the next within one recording. It is a fraction of the position's range in the earlier table.
const GOES_ON: f64 = 0.1;
/// Longest pause of the clock between two tables of one recording, as a multiple of the intervals between rows beside it.
const LONGEST_PAUSE: f64 = 3.0;
/// Longest time of a jump, as a fraction of the mean interval between rows.
const AT_ONCE: f64 = 0.01;
/// Largest distance of a position from 0 at which it counts as 0, as a fraction of the positions' range.
const NEAR_ZERO: f64 = 0.02;

/// Inferred description of a table, with the reasons for it and properties of its rows.
#[derive(Debug, Clone)]
pub struct TableProposal {
    /// Inferred description of the table.
    pub description: TableDescription,
    /// Inferred rules for the zero and direction of positions.
    pub frame: Frame,
    /// True if the force is constant in every hold, apart from a sensor's noise.
    pub has_noisy_levels: bool,
    /// Why the force is linear between rows, if it has sampled ramps between its holds.
    pub ramps: Option<String>,
    /// Why each force has acted until its row, if a clock of steps shows that.
    pub until_row: Option<String>,
    /// Quantity that the experiment most likely commanded.
    pub control: Control,
    /// True if the position as written stays near one value while the force drifts by more, which shows a relaxation if the position has a zero of its own, as a strain has.
    pub holds_as_written: bool,
    /// True if the position stays near one value in nearly all rows, while the force varies far more.
    pub is_steadier: bool,
    /// True if the force holds near a value other than 0 for a good part of the time; also for noisy levels, and for positions in two or three dimensions.
    pub force_holds: bool,
    /// True if the position does so.
    pub position_holds: bool,
    /// True if the force is constant to the last digit except for a few jumps.
    pub force_jumps: bool,
    /// True if the body goes on moving while the force holds near its largest value.
    pub creeps: bool,
    /// Names of all columns; empty without a header.
    pub columns: Vec<String>,
    /// Reasons for the description, each a sentence for the user.
    pub reasons: Vec<String>,
    /// Number of rows.
    pub n_rows: usize,
    /// Number of rows without a position.
    pub n_lost: usize,
    /// Duration of the record, in s.
    pub duration_s: f64,
    /// True if a commanded position jumps and acts from its row on, as the force shows.
    pub acts_from_row: bool,
    /// True if the measured force is not 0 before a commanded position first changes: its sensor has an offset.
    pub has_force_offset: bool,
    /// True if the position changes by at least half of its range from the first row to the second.
    pub jumps_at_once: bool,
    /// True if the force of one of the first two rows is more than a third of the largest one.
    pub starts_loaded: bool,
    /// Time of the first row, in s.
    pub first_time_s: f64,
    /// Time (s) of the first row, if a force acts in it; otherwise `None`.
    pub loaded_from_s: Option<f64>,
    /// Smallest and largest force, in N.
    pub force_n: [f64; 2],
    /// Smallest and largest position, relative to the zero, in m.
    pub position_m: [f64; 2],
    /// Smallest and largest position as written in the table, in m.
    written_position_m: [f64; 2],
    /// First position as written in the table, in m.
    pub first_written_m: Option<f64>,
    /// True if force and position as written have opposite signs in nearly all rows.
    pub has_opposite_signs: bool,
    /// Time (s) at which the load of the first row began, counted as [`Self::first_time_s`] is; `None` if neither the table nor the user says so.
    pub load_began_s: Option<f64>,
    /// Time (s) of the table's clock that counts as 0: the first time, if it is below 0.
    pub clock_zero_s: f64,
    /// True if the body moves in the first interval as after other switches of the force, so that the load began with the first row.
    pub starts_fresh: bool,
    /// First position as written, divided by the motion that the first force causes in the time of the first row, as other switches of the force show it. `None` if no
    /// switch shows it.
    pub first_answer: Option<f64>,
}

impl TableProposal {
    /// Returns whether the body has moved before the first row: its first position is far from 0, but within the travel of the record. Positions in the coordinates of a
    /// camera are farther from 0.
    pub fn starts_displaced(&self) -> bool {
        let range_m = self.written_position_m[1] - self.written_position_m[0];
        let is_displaced = |first_m: f64| first_m.abs() > NEAR_ZERO * range_m && first_m.abs() < range_m;
        !self.description.time_rules.spreads_ties && self.first_written_m.is_some_and(is_displaced)
    }

    /// Largest absolute position as written in the table, in m.
    pub fn farthest_written_m(&self) -> f64 {
        farthest(&self.written_position_m)
    }

    /// Mean interval between rows, in s.
    pub fn interval_s(&self) -> f64 {
        self.duration_s / self.n_rows.saturating_sub(1).max(1) as f64
    }

    /// Returns whether the first position is not 0, compared with the farthest one.
    pub fn starts_away(&self) -> bool {
        self.first_written_m.is_some_and(|first_m| first_m.abs() > NEAR_ZERO * self.farthest_written_m())
    }

    /// Returns whether the first position is already within a tenth of the farthest one, as in the hold of a relaxation that begins with the record.
    pub fn starts_at_hold(&self) -> bool {
        let farthest_m = self.farthest_written_m();
        self.first_written_m.is_some_and(|first_m| first_m.abs() > 0.9 * farthest_m && farthest_m > 0.0)
    }

    /// Returns whether the positions span the range from 0 to the farthest one, so that they count from 0.
    pub fn returns_to_zero(&self) -> bool {
        let [low_m, high_m] = self.written_position_m;
        low_m.abs().min(high_m.abs()) <= NEAR_ZERO * (high_m - low_m)
    }

    /// Returns whether the positions are stretches, of which 1 is the unstrained length: they begin near 1 and change by more than a hundredth.
    pub fn is_stretch(&self) -> bool {
        let range_m = self.written_position_m[1] - self.written_position_m[0];
        range_m > 0.01 && self.first_written_m.is_some_and(|first_m| (0.8..1.2).contains(&first_m))
    }

    /// Multiplies forces and positions by a factor each, by other units: the sizes of a specimen make stresses (1 Pa as 1 N) and strains (1 as 1 m) of them.
    pub fn rescale(&mut self, [of_force, of_position]: [f64; 2]) {
        let times = |parsed: &mut ParsedUnit, factor: f64, si: &str| {
            if let Some(scaled) = unit(&format!("{:e} {si}", parsed.to_si(1.0) * factor)) {
                *parsed = scaled;
            }
        };
        if let Some((_, unit)) = &mut self.description.force {
            times(unit, of_force, "N");
        }
        if let Some((_, unit)) = &mut self.description.position {
            times(unit, of_position, "m");
        }
        self.force_n = self.force_n.map(|force_n| force_n * of_force);
        self.position_m = self.position_m.map(|position_m| position_m * of_position);
        self.written_position_m = self.written_position_m.map(|position_m| position_m * of_position);
        self.first_written_m = self.first_written_m.map(|position_m| position_m * of_position);
    }

    /// Turns stretches into strains, which are relative to the length in the first row.
    pub fn read_as_stretches(&mut self) {
        let first = self.first_written_m.filter(|first| *first != 0.0).unwrap_or(1.0);
        if first != 1.0 {
            self.rescale([1.0, 1.0 / first]);
        }
        self.count_from_first_row();
    }

    /// Replaces the inferred rules for zero and direction: positions count from that of the first row.
    fn count_from_first_row(&mut self) {
        let first_m = self.first_written_m.unwrap_or(0.0);
        self.frame = Frame { zero: Zero::First, direction: Direction::Forward };
        self.position_m = self.written_position_m.map(|position_m| position_m - first_m);
        self.reasons.retain(|reason| !["zero =", "direction ="].iter().any(|key| reason.contains(key)));
    }

    /// Replaces a fitted zero by that of the instrument, if the first strain is not 0: the load began before the first row, which shows the gel's instantaneous answer.
    pub fn keep_zero_of_instrument(&mut self) {
        let [low, high] = self.written_position_m;
        let first_m = self.first_written_m.unwrap_or(0.0);
        // A strain that changes little beside its first value goes on from an earlier test.
        if self.frame.zero != Zero::Fit || first_m == 0.0 || first_m.abs() > MOST_ANSWER * (high - low) {
            return;
        }
        self.frame.zero = Zero::AsWritten;
        self.position_m = if self.frame.direction == Direction::Backward { [-high, -low] } else { [low, high] };
        self.reasons.retain(|reason| !reason.contains("zero = \"fit\""));
        self.reasons.push(
            "strains count from the instrument's zero, so that the strain of the first row is the gel's instantaneous answer; if the instrument was not zeroed before the load, write zero = \"fit\"".into(),
        );
    }

    /// Drops what the forces of the table say of a commanded force.
    pub fn read_as_measured_force(&mut self) {
        (self.ramps, self.until_row, self.description.acts_until_row) = (None, None, false);
    }

    /// Replaces a fitted zero for a commanded position, which has no noise: positions count from those before the force acts, or from the first row. The zero of a relaxation
    /// is fitted if its force has an offset.
    pub fn count_commanded_positions(&mut self) {
        if self.has_force_offset {
            let direction = self.frame.direction;
            self.count_from_first_row();
            self.frame = Frame { zero: Zero::Fit, direction };
            if direction == Direction::Backward {
                self.position_m = [-self.position_m[1], -self.position_m[0]];
            }
            return;
        }
        if self.frame.zero != Zero::Fit {
            return;
        }
        self.frame.zero = if self.loaded_from_s.is_some() { Zero::First } else { Zero::Rest };
        self.reasons.retain(|reason| !reason.contains("zero = \"fit\""));
        self.reasons.push(match self.frame.zero {
            Zero::First => "the commanded position counts from the first row (zero = \"first\")".into(),
            _ => "the commanded position counts from that before the force acts (zero = \"rest\")".into(),
        });
    }

    /// Replaces the inferred rules for zero and direction: positions count as written in the table.
    pub fn keep_written_positions(&mut self) {
        (self.frame, self.position_m) = (Frame::default(), self.written_position_m);
        self.reasons.retain(|reason| !["zero =", "direction ="].iter().any(|key| reason.contains(key)));
    }
}

/// Infers the description of a table. Errors name `file`. If the table does not determine a choice, `ask` asks the user.
///
/// # Errors
/// [`Error::Input`] if there is no block of numbers, if a column, a unit or the table stays ambiguous, or if the table cannot be read with the
/// description. The error names the option that helps.
pub fn propose(file: &Path, bytes: &[u8], given: &TableSettings, ask: Ask<'_>) -> Result<TableProposal> {
    let text = &*decode_detected(bytes);
    let lines: Vec<&str> = text.lines().collect();
    let all = tables_of(file, &lines)?;
    let mut reasons = Vec::new();
    let mut tables = chosen_tables(file, &lines, &all, given, ask)?;
    if given.tables.is_none() && tables.len() > 1 {
        // Times and positions decide whether several tables form one recording.
        let described = DescribedFile { file, bytes, text, lines: &lines, given, tables: &tables };
        let description = described.description(&mut Vec::new(), ask)?;
        if let Some(why) = described.separation(&description)? {
            tables = vec![ask_table(file, &lines, &all, why, ask)?];
        }
    }
    reasons.push(describe_layout(&tables, &lines));
    reasons.extend(describe_left_out(&lines, &tables));
    if !given.takes_each_table {
        reasons.extend(describe_tables(&all, &tables));
    }
    let described = DescribedFile { file, bytes, text, lines: &lines, given, tables: &tables };
    let mut description = described.description(&mut reasons, ask)?;
    let mut trajectory = described.completed(&mut description, &mut reasons)?;
    if let Some((column, unit)) = &description.force {
        refuse_marks_of_missing_forces(file, &trajectory, (column, unit))?;
    }
    let idle = idle_rows(&trajectory).filter(|_| description.force.is_some());
    if let Some(Idle { n_rows, began_s, why }) = idle {
        let line = trajectory.lines[n_rows];
        description.layout.first_row_line = line;
        description.layout.row_lines.retain(|[_, last]| *last >= line);
        if let Some([first, _]) = description.layout.row_lines.first_mut() {
            *first = line;
        }
        trajectory = described.completed(&mut description, &mut Vec::new())?;
        reasons.push(format!(
            "{why} at {began_s} s (load_start_s), and the rows before line {line} are left out (first_row_line)"
        ));
    }
    reasons.extend(describe_far_last_row(&trajectory));
    let mut steps = described.clock_of_steps(&description, &trajectory);
    let takes_step = given.columns[0].is_none() && !given.force_is_elsewhere;
    if let Some(clock) = steps.as_ref().filter(|clock| clock.is_single() && takes_step) {
        let (time, single) = (described.column_name(clock.at), TimeFormat::Unit(clock.unit.clone()));
        if time != description.time.0 {
            reasons.push(format!("the times are those of {}, which counts from the start of the step", spoken(&time)));
            description.time = (time, single);
            trajectory = described.completed(&mut description, &mut Vec::new())?;
            steps = described.clock_of_steps(&description, &trajectory);
        }
    }
    let has_noisy_levels = has_noisy_levels(&trajectory.force_n);
    if has_noisy_levels {
        reasons.push(
            "the force varies about fixed levels like the signal of a sensor, so each hold gets its median (force = \"levels\")".into(),
        );
    }
    let ramps = reason_of_ramps(&trajectory);
    let is_creep = Control::likely(&trajectory.time_s, &trajectory.force_n, &trajectory.position_m) == Control::Force;
    let until_row = steps
        .as_ref()
        .filter(|clock| ramps.is_none() && is_creep && clock.acts_until_rows(&trajectory.time_s, &trajectory.force_n))
        .map(|clock| {
            let name = spoken(&described.column_name(clock.at));
            format!("{name} shows that each step starts with the last row of the step before: each force has acted until its row (force_acts = \"until-row\")")
        });
    if until_row.is_some() {
        description.acts_until_row = true;
        trajectory = described.completed(&mut description, &mut Vec::new())?;
    }
    let ends = |values: &mut dyn Iterator<Item = f64>| {
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    };
    let written_position_m = ends(&mut trajectory.position_m.iter().flatten().copied());
    let first_written_m = trajectory.position_m.first().copied().flatten();
    let has_opposite_signs = opposes(&trajectory.force_n, &trajectory.position_m, 0.0);
    let first_answer = first_answer(&trajectory);
    let range_m = written_position_m[1] - written_position_m[0];
    let first_change_m = match trajectory.position_m[..] {
        [Some(first_m), Some(second_m), ..] => (second_m - first_m).abs(),
        _ => 0.0,
    };
    let jumps_at_once = first_change_m > 0.0 && first_change_m >= 0.5 * range_m;
    let holds_as_written = holds_as_written(&trajectory.force_n, &trajectory.position_m);
    let is_steadier = is_steadier(&trajectory.force_n, &trajectory.position_m);
    let has_force_offset = has_force_offset(&trajectory);
    let frame = match idle {
        Some(_) => Frame::default(),
        None => frame(&trajectory, description.force.is_some(), &mut reasons),
    };
    if let Some(projection) = frame.apply(file, &mut trajectory)?.projection {
        reasons.push(format!(
            "positions are {projection}; across this line they vary by {:.3} µm (root mean square)",
            1e6 * projection.across_rms_m
        ));
    }
    // A force at levels is commanded, and so is any force that moves a body in two or three dimensions.
    let is_along = matches!(description.position, Some((PositionColumns::Along(_), _)));
    let control = match is_along && !has_noisy_levels && description.force.is_some() {
        true => Control::likely(&trajectory.time_s, &trajectory.force_n, &trajectory.position_m),
        false => Control::Force,
    };
    let ramps = ramps.filter(|_| description.force.is_some());
    let largest_n = trajectory.force_n.iter().fold(0.0_f64, |most, force| most.max(force.abs()));
    let mut proposal = TableProposal {
        columns: named_columns(tables[0]),
        acts_from_row: control == Control::Position && answers_after_jumps(&trajectory.force_n, &trajectory.position_m),
        has_force_offset,
        starts_loaded: trajectory.force_n.iter().take(2).any(|force| 3.0 * force.abs() > largest_n),
        jumps_at_once,
        first_time_s: trajectory.time_s.first().copied().unwrap_or(0.0),
        reasons,
        n_rows: trajectory.time_s.len(),
        n_lost: trajectory.position_m.iter().filter(|x| x.is_none()).count(),
        loaded_from_s: trajectory.time_s.first().copied().filter(|_| trajectory.first_force_n() != 0.0),
        duration_s: trajectory.time_s.last().zip(trajectory.time_s.first()).map_or(0.0, |(last, first)| last - first),
        force_n: ends(&mut trajectory.force_n.iter().copied()),
        position_m: ends(&mut trajectory.position_m.iter().flatten().copied()),
        written_position_m,
        first_written_m,
        has_opposite_signs,
        load_began_s: idle.map(|idle| idle.began_s),
        clock_zero_s: trajectory.clock_zero_s.min(0.0),
        starts_fresh: starts_fresh(&trajectory),
        first_answer,
        description,
        frame,
        force_holds: !is_along || has_noisy_levels || holds(&trajectory.time_s, &trajectory.force_n),
        force_jumps: has_only_jumps(&trajectory.force_n),
        creeps: creeps_under_held_force(&trajectory.force_n, &trajectory.position_m),
        position_holds: {
            let rows = trajectory.time_s.iter().zip(&trajectory.position_m);
            let (time_s, position_m): (Vec<f64>, Vec<f64>) = rows.filter_map(|(time, x)| Some((*time, (*x)?))).unzip();
            !is_along || holds(&time_s, &position_m)
        },
        has_noisy_levels,
        ramps,
        until_row,
        control,
        holds_as_written,
        is_steadier,
    };
    let is_begun = match control {
        Control::Force => proposal.loaded_from_s.is_some(),
        Control::Position => proposal.starts_at_hold(),
    };
    if let Some(clock) = steps.filter(|_| is_begun && idle.is_none()) {
        proposal.load_began_s = Some(clock.first_start_s()).filter(|start_s| *start_s < proposal.first_time_s);
    }
    Ok(proposal)
}

/// Words in the name of a column whose times are times of day.
const OF_DAY: [&str; 4] = ["clock", "time of day", "uhrzeit", "heure"];
/// Words in the name of a column whose times are minutes and seconds.
const OF_MINUTES: [&str; 2] = ["min:s", "m:ss"];

/// Format of the times of a clock, by the name and the first cell of their column. Two parts are hours and minutes, or minutes and seconds.
///
/// # Errors
/// [`Error::Input`] if the two parts can be both.
fn clock_format(name: &str, cell: &str) -> Result<TimeFormat> {
    let lower = name.to_lowercase();
    let says = |words: &[&str]| words.iter().any(|word| lower.contains(word));
    let has_hours = says(&["h:mm"]);
    let is_elapsed = says(&["elapsed"]) || says(&OF_MINUTES) && !has_hours;
    let of_parts = if is_elapsed { TimeFormat::Elapsed } else { TimeFormat::Clock };
    let unit_s = split_unit(name).1.filter(|unit| unit.dimension == Dimension::Time).map(|unit| unit.to_si(1.0));
    match hours_minutes_s(cell) {
        // A day's recording seldom begins at midnight.
        None if clock_s(cell) == Some(0.0) => Ok(TimeFormat::Elapsed),
        None => Ok(of_parts),
        Some(_) if has_hours && !says(&["h:mm:ss"]) || unit_s == Some(3600.0) => Ok(TimeFormat::HoursMinutes),
        Some(_) if is_elapsed || has_hours => Ok(of_parts),
        Some(_) if unit_s.is_some() => Ok(TimeFormat::Elapsed),
        Some(_) if says(&OF_DAY) => Ok(TimeFormat::HoursMinutes),
        // No day has so many hours.
        Some(time_s) if time_s >= 86_400.0 => Ok(TimeFormat::Elapsed),
        Some(_) => Err(Error::input(
            InputPlace::setting(Setting::TimeUnit),
            format!("`{cell}` in `{name}` may be hours and minutes, or minutes and seconds"),
            format!("say which: `{0} hh:mm` or `{0} mm:ss`", Setting::TimeUnit),
        )),
    }
}

/// Returns the names of a table's columns. Columns at the end with neither a name nor a cell are omitted.
fn named_columns(table: &TableBlock) -> Vec<String> {
    let mut names = table.header.names.clone();
    while names.len() + table.n_empty > table.layout.n_cells && names.last().is_some_and(String::is_empty) {
        names.pop();
    }
    names
}

/// Returns the names of the tracks in a table, in order; empty without a track column. Errors name `file`.
///
/// # Errors
/// [`Error::Input`] if there is no block of numbers, or if the given column does not exist.
pub fn tracks(file: &Path, bytes: &[u8], given: &TableSettings) -> Result<Vec<String>> {
    let text = &*decode_detected(bytes);
    let lines: Vec<&str> = text.lines().collect();
    let all = tables_of(file, &lines)?;
    let tables = [&all[0]];
    let described = DescribedFile { file, bytes, text, lines: &lines, given, tables: &tables };
    let seen = described.known_columns();
    let column = described.track_column(&seen, &[])?;
    Ok(column.map_or(Vec::new(), |at| described.tracks(at).into_iter().map(|(track, _)| track).collect()))
}

/// File with the user's settings for it, and the tables that are read from it.
struct DescribedFile<'a> {
    file: &'a Path,
    bytes: &'a [u8],
    text: &'a str,
    lines: &'a [&'a str],
    given: &'a TableSettings,
    tables: &'a [&'a TableBlock],
}

impl DescribedFile<'_> {
    fn header(&self) -> &Header {
        &self.tables[0].header
    }

    fn known_columns(&self) -> KnownColumns<'_> {
        let TableBlock { layout, n_empty, .. } = self.tables[0];
        let n_filled = layout.n_cells - n_empty.min(&layout.n_cells);
        KnownColumns { file: self.file, given: self.given, header: self.header(), n_cells: layout.n_cells, n_filled }
    }

    /// Iterates over the rows that are read, each as its cells. Blank lines and comments are skipped.
    fn rows(&self) -> impl Iterator<Item = Vec<Cow<'_, str>>> {
        let lines = self.tables.iter().flat_map(|table| &self.lines[table.layout.first..table.end]);
        lines.filter(|line| !is_blank_or_comment(line, None)).map(|line| cells(line, self.tables[0].layout.delimiter))
    }

    /// Infers the columns, units and layout, and adds the reasons to `reasons`.
    fn description(&self, reasons: &mut Vec<String>, ask: Ask<'_>) -> Result<TableDescription> {
        let Self { file, bytes, lines, given, tables, .. } = *self;
        let (header, layout) = (self.header(), &tables[0].layout);
        let seen = self.known_columns();
        let mut columns: [Option<usize>; 4] = [None; 4];
        let mut other_axes: Vec<usize> = Vec::new();
        let is_here = |role: &Role| *role != Role::Force || !given.force_is_elsewhere;
        for role in Role::ALL.into_iter().filter(is_here) {
            let taken: Vec<usize> = columns.into_iter().flatten().chain(other_axes.iter().copied()).collect();
            match seen.column(role, &taken, ask)? {
                ColumnMatch::Missing => {}
                ColumnMatch::Single(at) => columns[role as usize] = Some(at),
                ColumnMatch::Axes(axes) => {
                    (columns[role as usize], other_axes) = (axes.first().copied(), axes[1..].to_vec());
                }
            }
        }
        let first_row = cells(lines[layout.first], layout.delimiter);
        let is_inferred = given.columns[Role::Cycle as usize].is_none();
        if let Some(at) = columns[Role::Cycle as usize].filter(|_| is_inferred) {
            let cell = first_row.get(at).map_or("", |cell| cell.as_ref());
            let is_constant = || self.rows().all(|row| row.get(at).is_none_or(|other| other == cell));
            let why = match layout.decimal.number(cell) {
                None if !cell.is_empty() => Some("in the first row, which is no number of a cycle"),
                Some(_) if is_constant() => Some("in every row, and tells no cycles apart"),
                _ => None,
            };
            if let Some(why) = why {
                columns[Role::Cycle as usize] = None;
                reasons.push(format!("`{}` is `{cell}` {why}: it is not read", header.names[at]));
            }
        }
        let taken: Vec<usize> = columns.into_iter().flatten().chain(other_axes.iter().copied()).collect();
        let cell =
            |role: Role| columns[role as usize].and_then(|at| first_row.get(at)).map_or("", |cell| cell.as_ref());
        let own_unit = |role: Role| columns[role as usize].and_then(|at| header.units.get(at).cloned().flatten());
        let called = |role: Role| columns[role as usize].and_then(|at| header.names.get(at)).map_or("", String::as_str);
        let has_form = |role: Role| {
            let cell = cell(role);
            role == Role::Time && (clock_s(cell).is_some() || is_hours_minutes(cell) || is_date_time(cell))
        };
        let mut said = given.units.clone();
        let mut missing: Vec<Role> = [Role::Time, Role::Force, Role::Position]
            .into_iter()
            .filter(is_here)
            .filter(|role| said[*role as usize].is_none() && own_unit(*role).is_none() && !has_form(*role))
            .collect();
        missing.retain(|role| {
            said[*role as usize] = role.ask_unit(ask);
            said[*role as usize].is_none()
        });
        if let Some(first) = missing.first() {
            let names: Vec<&str> = missing.iter().map(|role| role.name()).collect();
            let unknown: Vec<(Role, &str)> =
                missing.iter().filter_map(|role| Some((*role, unknown_unit(called(*role))?.1))).collect();
            if let Some((role, text)) = unknown.first().filter(|(_, text)| !text.is_empty()) {
                return Err(Error::input(
                    InputPlace::file(file).at_key(called(*role)),
                    format!("`{text}` is no known unit of {}", role.name()),
                    format!("give its size in a known unit, as in `{}`", role.multiple_option()),
                ));
            }
            let counts: Vec<&str> = missing.iter().filter_map(|role| Some(counted(called(*role))?.1)).collect();
            let of_counts = counts.first().map_or(String::new(), |what| format!(" if one {what} is that long"));
            // A stress or a strain in place of force and position has units of its own.
            let of_stress = ["stress", "strain"].iter().any(|word| {
                [Role::Force, Role::Position].into_iter().any(|role| called(role).to_lowercase().contains(word))
            });
            let option = |role: &Role| match role {
                Role::Force if of_stress => format!("{} kPa", role.unit_setting()),
                Role::Position if of_stress => format!("{} %", role.unit_setting()),
                _ => role.unit_option(called(*role)),
            };
            let options = missing.iter().map(option).collect::<Vec<String>>().join(" ");
            return Err(Error::input(
                InputPlace::setting(first.unit_setting()),
                format!("{}: the table does not give the unit of {}", file.display(), names.join(" and ")),
                format!("give the unit, as in `{options}`{of_counts}"),
            ));
        }
        let told = |role: Role| said[role as usize].as_deref();
        let unit_of = |role: Role| -> Result<ParsedUnit> {
            let found = told(role).map_or_else(|| own_unit(role), unit);
            found.filter(|unit| Some(unit.dimension) == role.dimension()).ok_or_else(|| {
                let stated = told(role).map(String::from).or_else(|| Some(own_unit(role)?.name)).unwrap_or_default();
                let found = format!("`{stated}` is not a unit of {}", role.name());
                let is_of_stress = |role: Role| {
                    let dimension = told(role).and_then(unit).map(|unit| unit.dimension);
                    matches!(dimension, Some(Dimension::Pressure | Dimension::Ratio))
                };
                let is_current = role == Role::Force && own_unit(role).is_some_and(|unit| unit.dimension == Dimension::Current);
                let remedy = if is_current {
                    format!("a current becomes a force by its calibration in [actuation]: give a copy of the file with `{}`", Setting::ForceFile)
                } else if [Role::Force, Role::Position].into_iter().any(is_of_stress) {
                    format!(
                        "for stress and strain give both units and, unless their names say so, both columns: `{} F {} L {} kPa {} %`",
                        Setting::ForceColumn, Setting::PositionColumn, Role::Force.unit_setting(), Role::Position.unit_setting()
                    )
                } else {
                    format!("give the unit, as in `{}`", role.unit_option(called(role)))
                };
                Error::input(InputPlace::setting(role.unit_setting()), found, remedy)
            })
        };
        let time_format = match told(Role::Time).and_then(TimeFormat::named) {
            Some(format) => format,
            None if told(Role::Time).is_none() && is_date_time(cell(Role::Time)) => TimeFormat::Date(None),
            None if told(Role::Time).is_none() && clock_s(cell(Role::Time)).is_some() => {
                clock_format(called(Role::Time), cell(Role::Time))?
            }
            None if told(Role::Time).is_none() && is_hours_minutes(cell(Role::Time)) => TimeFormat::HoursMinutes,
            None => TimeFormat::Unit(unit_of(Role::Time)?),
        };
        for role in [Role::Time, Role::Force, Role::Position] {
            if let Some((said, written)) = told(role).zip(own_unit(role))
                && unit(said).is_none_or(|said| said.to_si(1.0) != written.to_si(1.0))
            {
                reasons.push(format!(
                    "the {} is read in {said}, as `{}` says, although the table says {}",
                    role.name(),
                    role.unit_setting(),
                    written.name
                ));
            }
        }
        let name_at = |at: usize| self.column_name(at);
        let name = |role: Role| columns[role as usize].map(name_at);
        let wanted = |role: Role| name(role).unwrap_or(ColumnName::Number(1));
        let unit_at = |at: usize| header.units.get(at).and_then(Option::as_ref);
        let first_axis = columns[Role::Position as usize];
        if let Some((at, first, other)) = other_axes.iter().find_map(|at| {
            let (first, other) = (unit_at(first_axis?)?, unit_at(*at)?);
            (first.to_si(1.0) != other.to_si(1.0)).then_some((*at, first, other))
        }) {
            return Err(Error::input(
                InputPlace::file(self.file),
                format!("`{}` is in {}, but the first coordinate is in {}", header.names[at], other.name, first.name),
                "convert the coordinates to one unit, or read only those of one unit",
            ));
        }
        let position = if other_axes.is_empty() {
            PositionColumns::Along(wanted(Role::Position))
        } else {
            let axes = std::iter::once(wanted(Role::Position)).chain(other_axes.iter().map(|at| name_at(*at)));
            PositionColumns::Axes(axes.collect())
        };
        let track = self.track(&seen, &taken, ask)?.map(|(at, track)| (name_at(at), track));
        if let Some((column, track)) = &track {
            reasons.push(format!("the rows of track `{track}` are read, selected by the column {}", spoken(column)));
        }
        let force_at = columns[Role::Force as usize];
        let thousands = self.thousands(&taken, reasons)?;
        let written = written(bytes, lines, tables[0]);
        let decimal = match thousands {
            Some(Thousands::Point) => Decimal::Comma,
            Some(Thousands::Comma) => Decimal::Point,
            None => written.decimal,
        };
        Ok(TableDescription {
            layout: TableLayout {
                thousands,
                decimal,
                row_lines: if tables.len() > 1 || self.is_followed() || tables[0].marker.is_some() {
                    tables.iter().flat_map(|table| table.ranges()).collect()
                } else {
                    Vec::new()
                },
                ..written
            },
            time: (wanted(Role::Time), time_format),
            force: match given.force_is_elsewhere {
                true => None,
                false => Some((wanted(Role::Force), unit_of(Role::Force)?)),
            },
            position: Some((position, unit_of(Role::Position)?)),
            cycle: name(Role::Cycle),
            track,
            blank_force: self.blank_force(force_at, reasons, ask)?,
            lost: Vec::new(),
            time_rules: TimeRules {
                joins_restarts: one_word(Setting::TimeRestarts, given.time_restarts.as_deref(), "join")?,
                spreads_ties: one_word(Setting::TimeTies, given.time_ties.as_deref(), "spread")?,
            },
            acts_until_row: false,
        })
    }

    /// Name of the column with the index `at`, or its number. Names in several lines of a preamble, or in a line that lacks the first name, do not find their columns.
    fn column_name(&self, at: usize) -> ColumnName {
        let header = self.header();
        match header.names.get(at).filter(|_| header.line.is_some() && !header.lacks_first_name) {
            Some(name) if header.names.iter().filter(|other| *other == name).count() == 1 && !name.is_empty() => {
                ColumnName::Named(name.clone())
            }
            _ => ColumnName::Number(at + 1),
        }
    }

    /// Clock of steps beside the times of a trajectory, or these times themselves; `None` without one.
    fn clock_of_steps(&self, description: &TableDescription, trajectory: &Trajectory) -> Option<StepClock> {
        let (header, layout) = (self.header(), &description.layout);
        let at = header.names.iter().position(|name| is_of_step(name))?;
        let own = match &description.time {
            (name, TimeFormat::Unit(unit)) if *name == self.column_name(at) => Some(unit),
            _ => header.units.get(at)?.as_ref().filter(|unit| unit.dimension == Dimension::Time),
        };
        let unit = own?.clone();
        let since_s = trajectory.lines.iter().map(|line| {
            let row = cells(self.lines[line - 1], layout.delimiter);
            layout.number(row.get(at)?).map(|number| unit.to_si(number))
        });
        let since_s = since_s.collect::<Option<Vec<f64>>>()?;
        StepClock::new((at, unit), &trajectory.time_s, &since_s)
    }

    /// True if lines other than blank lines and comments follow the last row that is read.
    fn is_followed(&self) -> bool {
        let end = self.tables.last().map_or(0, |table| table.end);
        self.lines[end..].iter().any(|line| !is_blank_or_comment(line, None))
    }

    /// Returns the index of the column that names a tracker's tracks: the column that the user gives, otherwise a column with a known name. `None`
    /// without such a column.
    fn track_column(&self, seen: &KnownColumns<'_>, taken: &[usize]) -> Result<Option<usize>> {
        if let Some(column) = &self.given.track[0] {
            return seen.told(Setting::TrackColumn, column).map(Some);
        }
        let stem = |name: &String| -> String {
            let plain: String = name.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
            ["id", "name"].iter().find_map(|end| plain.strip_suffix(end)).unwrap_or(&plain).into()
        };
        let find = |all: &[&str], is_one: &dyn Fn(usize) -> bool| {
            let mut names = self.header().names.iter().enumerate();
            let found = names.find(|(at, name)| all.contains(&stem(name).as_str()) && is_one(*at));
            found.map(|(at, _)| at).filter(|at| !taken.contains(at))
        };
        Ok(find(&TRACKS, &|_| true).or_else(|| find(&SPECIMENS, &|at| self.holds_specimens(at))))
    }

    /// True if a column has a few values, each in many rows that follow each other.
    fn holds_specimens(&self, at: usize) -> bool {
        let values: Vec<String> = self.rows().filter_map(|row| Some(row.get(at)?.to_string())).collect();
        let blocks: Vec<&[String]> = values.chunk_by(|a, b| a == b).collect();
        let distinct: BTreeSet<&String> = blocks.iter().map(|block| &block[0]).collect();
        distinct.len() == blocks.len() && blocks.iter().all(|block| block.len() >= FEWEST_OF_SPECIMEN)
    }

    /// Returns the names of the tracks in a column, each with its number of rows.
    fn tracks(&self, at: usize) -> Vec<(String, usize)> {
        let mut tracks: Vec<(String, usize)> = Vec::new();
        for row in self.rows() {
            let Some(cell) = row.get(at) else { continue };
            match tracks.iter().position(|(track, _)| track == cell) {
                Some(place) => tracks[place].1 += 1,
                None if tracks.len() < MOST_TRACKS => tracks.push((cell.to_string(), 1)),
                None => {}
            }
        }
        tracks
    }

    /// Returns the index of the track column and the name of the track that is read; `None` unless the rows belong to several tracks.
    fn track(&self, seen: &KnownColumns<'_>, taken: &[usize], ask: Ask<'_>) -> Result<Option<(usize, String)>> {
        let Some(at) = self.track_column(seen, taken)? else { return Ok(None) };
        if let Some(track) = &self.given.track[1] {
            return Ok(Some((at, track.clone())));
        }
        let tracks = self.tracks(at);
        if tracks.len() < 2 {
            return Ok(None);
        }
        let list: Vec<String> = tracks.iter().map(|(track, count)| format!("{track} ({count} rows)")).collect();
        let question = Question {
            text: format!("which track ({})", list.join(", ")),
            choices: tracks.iter().map(|(track, _)| track.clone()).collect(),
            also: Vec::new(),
            proposal: None,
        };
        match ask(&question) {
            Some(track) => Ok(Some((at, track))),
            None => Err(Error::input(
                InputPlace::setting(Setting::Track),
                format!("the rows belong to several tracks: {}", list.join(", ")),
                format!(
                    "choose one with `{0} \"{1}\"`, or create an experiment for each with `{0} all`",
                    Setting::Track,
                    tracks[0].0
                ),
            )),
        }
    }

    /// Returns the rule for blank force cells; `None` if no force cell is blank or the user gives no answer.
    fn blank_force(&self, force: Option<usize>, reasons: &mut Vec<String>, ask: Ask<'_>) -> Result<Option<BlankForce>> {
        let setting = Setting::BlankForce;
        let named = |word: &str| BlankForce::ALL.into_iter().find(|blank| blank.name() == word);
        let is_blank = |row: &Vec<Cow<'_, str>>| force.and_then(|at| row.get(at)).is_some_and(|cell| is_lost(cell));
        let n_blank = self.rows().filter(is_blank).count();
        if let Some(word) = &self.given.blank_force {
            let blank = named(word).ok_or_else(|| {
                Error::input(
                    InputPlace::setting(setting),
                    format!("`{word}` is not a known meaning of a blank force"),
                    "give `above`, `zero` or `left-out`",
                )
            })?;
            if blank == BlankForce::LeftOut && n_blank > 0 {
                reasons.push(format!("{n_blank} rows have no measured force"));
            }
            return Ok(Some(blank));
        }
        if n_blank == 0 {
            return Ok(None);
        }
        let question = Question {
            text: "force of rows with a blank force cell (above: force of the row above; zero: no force; left-out: not measured)".into(),
            choices: BlankForce::ALL.map(|blank| blank.name().to_string()).to_vec(),
            also: Vec::new(),
            proposal: None,
        };
        Ok(ask(&question).and_then(|word| named(&word)))
    }

    /// Returns the thousands separator if it could also be a decimal sign; otherwise `None`. All numbers with the sign must have groups of three
    /// digits, and several smaller numbers must lack the sign. A comma in a quoted cell between commas needs one smaller number only.
    fn thousands(&self, taken: &[usize], reasons: &mut Vec<String>) -> Result<Option<Thousands>> {
        let setting = Setting::Thousands;
        match self.given.thousands.as_deref() {
            None => {}
            Some("none") => return Ok(None),
            Some(word) => {
                return Thousands::ALL.into_iter().find(|sign| sign.name() == word).map(Some).ok_or_else(|| {
                    let remedy = format!("give `{setting} .`, `{setting} ,` or `{setting} none`");
                    Error::input(InputPlace::setting(setting), format!("`{word}` is not a thousands separator"), remedy)
                });
            }
        }
        let layout = &self.tables[0].layout;
        let has_comma =
            |row: Vec<Cow<'_, str>>| taken.iter().filter_map(|at| row.get(*at)).any(|cell| cell.contains(','));
        let is_quoted = layout.delimiter == Delimiter::Comma && self.rows().any(has_comma);
        let sign = match layout.decimal {
            Decimal::Point if !is_quoted => Thousands::Point,
            _ => Thousands::Comma,
        };
        let mut columns: BTreeMap<usize, SignCounts> = BTreeMap::new();
        for row in self.rows() {
            for (at, cell) in row.iter().enumerate().filter(|(_, cell)| !is_lost(cell)) {
                let is_number = |text: &str| text.parse::<f64>().is_ok();
                let plain = if sign == Thousands::Point { cell.replace(',', ".") } else { cell.to_string() };
                let digits = plain.trim_start_matches(['+', '-']).split('.').next().map_or(0, str::len);
                let has_sign = cell.contains(sign.name());
                let is_taken = taken.contains(&at);
                if has_sign
                    && sign.removed(cell).is_none()
                    && (is_taken || is_number(&cell.replacen(sign.name(), ".", 1)))
                {
                    return Ok(None);
                }
                if !is_taken {
                    continue;
                }
                let column = columns.entry(at).or_default();
                if has_sign {
                    column.n_grouped += 1;
                    column.ends_in_zero |= cell.ends_with('0');
                    column.is_repeated |= cell.matches(sign.name()).count() > 1;
                } else if plain.parse() == Ok(0.0) {
                    column.n_zero += 1;
                } else if is_number(&plain) {
                    *(if digits <= 3 { &mut column.n_small } else { &mut column.n_large }) += 1;
                }
            }
        }
        let fewest = if is_quoted { [1, 1] } else { [FEWEST_GROUPED, FEWEST_SMALL] };
        if !columns.values().any(|column| column.shows_thousands(fewest)) {
            return Ok(None);
        }
        let n_grouped: usize = columns.values().map(|column| column.n_grouped).sum();
        let n_small: usize = columns.values().map(|column| column.n_small).sum();
        let sign_name = sign.name();
        reasons.push(format!(
            "`{sign_name}` is read as thousands separator: all {n_grouped} numbers with it end in groups of three digits, and {n_small} smaller numbers lack it (thousands = \"{sign_name}\"); use `{setting} none` if it is the decimal sign"
        ));
        Ok(Some(sign))
    }

    /// Returns why several tables are not one recording; `None` if they are. In one recording, each table's clock continues that of the previous table without a
    /// pause, or its position starts near the end of the previous table.
    fn separation(&self, description: &TableDescription) -> Result<Option<&'static str>> {
        let joined = with_times(description, TimeRules { joins_restarts: true, spreads_ties: true });
        let Trajectory { time_s, position_m, lines, ordered, .. } = read_described(self.file, self.text, &joined)?;
        let rows_of = |table: &TableBlock| {
            let [first, last] = table.lines();
            lines.partition_point(|line| *line < first)..lines.partition_point(|line| *line <= last)
        };
        for pair in self.tables.windows(2) {
            let [before, after] = [pair[0], pair[1]].map(rows_of);
            let restarts = ordered.restart_rows.contains(&after.start);
            let interval_s = |row: usize| Some(time_s.get(row)? - time_s.get(row.checked_sub(1)?)?);
            let usual_s =
                [before.end.saturating_sub(1), after.start + 1].into_iter().filter_map(interval_s).fold(0.0, f64::max);
            if !restarts && interval_s(after.start).is_some_and(|pause_s| pause_s <= LONGEST_PAUSE * usual_s) {
                continue;
            }
            let known = |rows: Range<usize>| position_m[rows].iter().flatten().copied();
            let range_m = known(before.clone()).fold(f64::NEG_INFINITY, f64::max)
                - known(before.clone()).fold(f64::INFINITY, f64::min);
            let jump_m = known(before).last().zip(known(after).next()).map(|(last, first)| (first - last).abs());
            if jump_m.is_none_or(|jump_m| jump_m > GOES_ON * range_m) {
                return Ok(Some(match restarts {
                    true => "each starts anew, so they are not one recording",
                    false => "the position jumps between them after a pause, so they may not be one recording",
                }));
            }
        }
        Ok(None)
    }

    /// An error about a clock that restarts, with the column that changes exactly where it does: it may name specimens.
    fn with_specimens(&self, error: Error, joined: &Trajectory) -> Error {
        let restarts = &joined.ordered.restart_rows;
        let Error::Input { place, found, remedy } = error else { return error };
        let delimiter = self.tables[0].layout.delimiter;
        let rows: Vec<Vec<Cow<'_, str>>> =
            joined.lines.iter().map(|line| cells(self.lines[line - 1], delimiter)).collect();
        let changes = |at: usize| -> Vec<usize> {
            (1..rows.len()).filter(|row| rows[*row].get(at) != rows[row - 1].get(at)).collect()
        };
        let names = &self.header().names;
        let column = (0..names.len()).find(|at| !restarts.is_empty() && changes(*at) == *restarts);
        match column {
            Some(at) => Error::input(
                place,
                format!("{found}, where the column `{}` changes", names[at]),
                format!(
                    "if its values are specimens, read one with `{column} \"{name}\" {track} {value}` or all with `{column} \"{name}\" {track} all`; if one recording went on, use `{restarts} join`",
                    column = Setting::TrackColumn,
                    name = names[at],
                    track = Setting::Track,
                    value = rows[0].get(at).map_or("NAME", AsRef::as_ref),
                    restarts = Setting::TimeRestarts,
                ),
            ),
            None => Error::input(place, found, remedy),
        }
    }

    /// Reads the rows, and completes the description with properties of the rows: a clock that restarts or is coarse, values for lost positions, and
    /// a constant coordinate.
    fn completed(&self, description: &mut TableDescription, reasons: &mut Vec<String>) -> Result<Trajectory> {
        let read = |description: &TableDescription| {
            let trajectory = read_described(self.file, self.text, description)?;
            let is_relaxation = || {
                Control::likely(&trajectory.time_s, &trajectory.force_n, &trajectory.position_m) == Control::Position
            };
            if description.blank_force != Some(BlankForce::LeftOut) || !is_relaxation() {
                return Ok(trajectory);
            }
            // The commanded positions of rows without a measured force count.
            let whole = TableDescription { blank_force: Some(BlankForce::Lost), ..description.clone() };
            let mut trajectory = read_described(self.file, self.text, &whole)?;
            bridge_lost(&mut trajectory.force_n, &trajectory.time_s);
            Ok(trajectory)
        };
        let told = description.time_rules;
        let lenient = with_times(description, TimeRules { joins_restarts: true, spreads_ties: true });
        if let Ok(trajectory) = read(&lenient) {
            let restarts = &trajectory.ordered.restart_rows;
            // If the clock restarts only at the first rows of cycles or tables, the rows belong to one recording.
            let cycle_begins = |row: usize| trajectory.cycle.as_ref().is_some_and(|cycle| cycle[row] > cycle[row - 1]);
            let table_begins = |row: usize| self.tables.iter().any(|table| table.lines()[0] == trajectory.lines[row]);
            if !restarts.is_empty()
                && !told.joins_restarts
                && restarts.iter().all(|row| cycle_begins(*row) || table_begins(*row))
            {
                description.time_rules.joins_restarts = true;
                reasons.push(format!(
                    "the clock restarts {} times and is assumed to continue from the previous row (time_restarts = \"join\")",
                    restarts.len()
                ));
            }
            let n_copies = trajectory.ordered.n_copies;
            if n_copies > 0 && !told.spreads_ties {
                return Err(Error::input(
                    InputPlace::file(self.file),
                    format!("time, force and position are repeated in {n_copies} rows"),
                    format!("remove the repeated rows; if the clock is coarse, use `{} spread`", Setting::TimeTies),
                ));
            }
            let is_coarse = trajectory.ordered.is_coarse();
            if is_coarse && description.track.is_none() && !told.spreads_ties {
                description.time_rules.spreads_ties = true;
                reasons.push(format!(
                    "{} rows have the previous row's time because the clock is coarse: they are spread evenly over its steps (time_ties = \"spread\")",
                    trajectory.ordered.n_ties
                ));
            }
        }
        let mut trajectory = read(description).map_err(|error| match read(&lenient) {
            Ok(joined) => self.with_specimens(error, &joined),
            Err(_) => error,
        })?;
        if let Some((PositionColumns::Axes(axes), _)) = &mut description.position
            && axes.len() == 3
        {
            let is_constant = |positions: &[Option<f64>]| {
                let mut known = positions.iter().flatten();
                known.next().is_none_or(|first| known.all(|x| x == first))
            };
            if is_constant(&trajectory.others_m[1]) {
                axes.pop();
                trajectory = read(description)?;
            }
        }
        let unit_m = trajectory.position_unit_m;
        let coordinates = || std::iter::once(&trajectory.position_m).chain(&trajectory.others_m);
        let mut lost: Vec<f64> = coordinates().flat_map(|positions| repeated_outliers(positions)).collect();
        lost.sort_unstable_by(f64::total_cmp);
        lost.dedup();
        if lost.is_empty() {
            return Ok(trajectory);
        }
        for value_m in &lost {
            let count = coordinates().map(|positions| positions.iter().filter(|x| **x == Some(*value_m)).count()).max();
            let (count, value) = (count.unwrap_or(0), as_written(*value_m, unit_m));
            reasons.push(format!(
                "{count} positions are exactly {value}, far from the rows around them: they are treated as lost (lost = [{value:?}])"
            ));
        }
        description.lost = lost.iter().map(|value_m| as_written(*value_m, unit_m)).collect();
        read(description)
    }
}

/// Numbers of a column that show whether a sign separates thousands or decimals.
#[derive(Default)]
struct SignCounts {
    /// Numbers with the sign; whether one of them ends in 0, and whether one has the sign twice.
    n_grouped: usize,
    ends_in_zero: bool,
    is_repeated: bool,
    /// Numbers without the sign: those too small for it, zeros, and large ones.
    n_small: usize,
    n_zero: usize,
    n_large: usize,
}

impl SignCounts {
    /// True if the sign separates thousands: it stands twice in a number, or the small numbers lack it. In a column of decimals, all numbers may have three of them.
    fn shows_thousands(&self, [fewest_grouped, fewest_small]: [usize; 2]) -> bool {
        // A program that writes 1.5 as `1.500` writes 0 as `0.000`.
        let n_small = self.n_small + if self.ends_in_zero { self.n_zero } else { 0 };
        self.is_repeated || self.n_grouped >= fewest_grouped && n_small >= fewest_small && self.n_large == 0
    }
}

/// Least size of a force of nines that may mean a missing value.
const LEAST_MARK: f64 = 999.0;
/// Least ratio of such a force to the largest other force, and the largest part of the rows that have it.
const MARK_TO_OTHERS: f64 = 20.0;
const MOST_MARKED: f64 = 0.2;

/// Refuses forces such as −9999 that mean a missing value: they are far beyond all others, in few rows.
///
/// # Errors
/// [`Error::Input`] for such forces, at the first of them.
fn refuse_marks_of_missing_forces(
    file: &Path,
    trajectory: &Trajectory,
    (column, unit): (&ColumnName, &ParsedUnit),
) -> Result<()> {
    let written = || trajectory.force_n.iter().map(|force_n| force_n / unit.to_si(1.0));
    let has_only_nines = |size: f64| ((size + 1.0).log10() - (size + 1.0).log10().round()).abs() < 1e-9;
    let is_mark = |value: f64| value.abs() >= LEAST_MARK && has_only_nines(value.abs());
    let Some(first) = written().position(is_mark) else { return Ok(()) };
    let mark = written().nth(first).unwrap_or(f64::NAN);
    let n_marked = written().filter(|value| is_mark(*value)).count();
    let largest = written().filter(|value| !is_mark(*value)).fold(0.0, |most: f64, value| most.max(value.abs()));
    let is_many = n_marked as f64 > MOST_MARKED * trajectory.force_n.len() as f64;
    if largest == 0.0 || is_many || mark.abs() < MARK_TO_OTHERS * largest {
        return Ok(());
    }
    Err(Error::input(
        InputPlace::file(file).at_line(trajectory.lines[first]).at_key(column.to_string()),
        format!(
            "the force is {mark} in {n_marked} rows and at most {largest} in the others, so that it means a missing value"
        ),
        format!(
            "leave these cells empty; for a commanded force, `{}` then says which force acted in them",
            Setting::BlankForce
        ),
    ))
}

/// Smallest ratio of the interval before the last row to all others at which the row may be a line of another kind. Logarithmic clocks have smaller ones.
const FAR: f64 = 10.0;
/// Smallest number of rows before such a row.
const FEWEST_BEFORE: usize = 10;

/// Sentence about a last row that is farther from the row before than the whole record before it is long; `None` for other rows.
fn describe_far_last_row(trajectory: &Trajectory) -> Option<String> {
    let Trajectory { time_s, lines, .. } = trajectory;
    let [before @ .., last_s] = &time_s[..] else { return None };
    let (first_s, before_s) = (before.first()?, before.last()?);
    let gap_s = last_s - before_s;
    let longest_s = before.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    let is_far = before.len() >= FEWEST_BEFORE && gap_s > before_s - first_s && gap_s > FAR * longest_s;
    is_far.then(|| {
        format!(
            "the last row, line {}, is {} s after the row before, longer than the record before it: delete the row if it is no sample",
            lines[time_s.len() - 1],
            six_digits(gap_s)
        )
    })
}

/// Reason for which a force is linear between rows: it has sampled ramps, and holds in most other rows. `None` without such ramps.
fn reason_of_ramps(trajectory: &Trajectory) -> Option<String> {
    let Trajectory { time_s, force_n, lines, .. } = trajectory;
    let (first, mut jumps) = ramps_between_holds(force_n)?;
    let least_s = AT_ONCE * (time_s.last()? - time_s.first()?) / time_s.len() as f64;
    jumps.retain(|row| time_s[*row] - time_s[row - 1] > least_s);
    let of_jumps = jumps.first().map_or(String::new(), |first| {
        format!(
            "; it also jumps, first in line {} ({} in all): give each jump a row just before its time, with the old force and an empty position, because it takes the whole interval otherwise",
            lines[*first],
            jumps.len()
        )
    });
    let [from, to] = [lines[first.start], lines[first.end - 1]];
    Some(format!(
        "the force changes in every row from line {from} to line {to}, as a sampled ramp does: it is linear between rows (force = \"linear\"){of_jumps}"
    ))
}

/// Replaces lost values (NaN) by the line between the known values before and after them, or by the nearest known one.
fn bridge_lost(values: &mut [f64], time_s: &[f64]) {
    let known: Vec<usize> = (0..values.len()).filter(|row| !values[*row].is_nan()).collect();
    for row in 0..values.len() {
        let next = known.partition_point(|other| *other < row);
        values[row] = match (next.checked_sub(1).map(|before| known[before]), known.get(next)) {
            (_, Some(after)) if *after == row => values[row],
            (Some(before), Some(after)) => {
                let share = (time_s[row] - time_s[before]) / (time_s[*after] - time_s[before]);
                values[before] + share * (values[*after] - values[before])
            }
            (Some(near), None) | (None, Some(&near)) => values[near],
            (None, None) => 0.0,
        };
    }
}

/// Converts a position (m) to the unit of its column, and rounds it to the value in the file.
fn as_written(value_m: f64, unit_m: f64) -> f64 {
    let value = value_m / unit_m;
    let rounded = (1e6 * value).round() / 1e6;
    // Adding 0.0 avoids a negative zero.
    if (rounded - value).abs() <= 1e-9 * value.abs() { rounded + 0.0 } else { value }
}

fn with_times(description: &TableDescription, time_rules: TimeRules) -> TableDescription {
    TableDescription { time_rules, ..description.clone() }
}

/// True if the user gives a setting whose only allowed value is `word`. Another value is an error.
fn one_word(setting: Setting, given: Option<&str>, word: &str) -> Result<bool> {
    match given {
        None => Ok(false),
        Some(given) if given == word => Ok(true),
        Some(other) => Err(Error::input(
            InputPlace::setting(setting),
            format!("unknown `{other}`"),
            format!("give `{setting} {word}`"),
        )),
    }
}

fn spoken(column: &ColumnName) -> String {
    match column {
        ColumnName::Named(name) => format!("`{name}`"),
        ColumnName::Number(number) => number.to_string(),
    }
}

/// Layout of a table, with the names and units of its columns.
#[derive(Debug, Clone)]
pub struct InspectedTable {
    /// Layout of the table.
    pub layout: TableLayout,
    /// Names of the columns; empty without a header, and of a column without values.
    pub columns: Vec<String>,
    /// Unit of each column; `None` if the table does not give it.
    pub units: Vec<Option<ParsedUnit>>,
    /// Sentence that describes the layout of the table for the user.
    pub said: String,
    /// Lines above the table that are rows of no table.
    pub preamble: Vec<(usize, String)>,
}

/// Finds the layout and header of the first table in a file. Errors name `file`.
///
/// # Errors
/// [`Error::Input`] if there is no block of numbers.
pub fn inspect_table(file: &Path, bytes: &[u8]) -> Result<InspectedTable> {
    Ok(inspect_tables(file, bytes)?.swap_remove(0))
}

/// Finds the layout and header of every table in a file. Errors name `file`.
///
/// # Errors
/// [`Error::Input`] if there is no block of numbers.
pub fn inspect_tables(file: &Path, bytes: &[u8]) -> Result<Vec<InspectedTable>> {
    let text = &*decode_detected(bytes);
    let lines: Vec<&str> = text.lines().collect();
    let all = tables_of(file, &lines)?;
    let inspected = |table: &TableBlock| {
        let said = describe_layout(&[table], &lines);
        let Header { mut names, mut units, .. } = table.header.clone();
        let filled = filled_columns(&lines, table);
        names.resize(names.len().max(filled.len()), String::new());
        units.resize(names.len(), None);
        // A column without a number describes nothing.
        for at in (0..names.len()).filter(|at| filled.get(*at) == Some(&false)) {
            (names[at], units[at]) = (String::new(), None);
        }
        let mut layout = written(bytes, &lines, table);
        let is_followed = || lines[table.end..].iter().any(|line| !is_blank_or_comment(line, None));
        if all.len() > 1 || table.marker.is_some() || is_followed() {
            layout.row_lines = table.ranges();
        }
        let is_row = |line: usize| all.iter().any(|table| (table.lines()[0]..=table.lines()[1]).contains(&line));
        let above = lines.iter().enumerate().take(table.lines()[0] - 1).filter(|(place, _)| !is_row(place + 1));
        let preamble = above.map(|(place, line)| (place + 1, line.to_string())).collect();
        InspectedTable { layout, columns: names, units, said, preamble }
    };
    Ok(all.iter().map(inspected).collect())
}

/// For each column of a table, whether it has a cell that is not lost.
fn filled_columns(lines: &[&str], table: &TableBlock) -> Vec<bool> {
    let mut filled = vec![false; table.layout.n_cells];
    let rows = lines[table.layout.first..table.end].iter().filter(|line| !is_blank_or_comment(line, None));
    for row in rows {
        for (cell, is_filled) in cells(row, table.layout.delimiter).iter().zip(&mut filled) {
            *is_filled |= !is_lost(cell);
        }
    }
    filled
}

/// Asks the user for the number, from 1, of the table to read. Errors name `file`.
///
/// # Errors
/// [`Error::Input`] with the list of tables if nobody answers.
pub fn choose_table(file: &Path, bytes: &[u8], ask: Ask<'_>) -> Result<usize> {
    let text = &*decode_detected(bytes);
    let lines: Vec<&str> = text.lines().collect();
    let all = tables_of(file, &lines)?;
    let chosen = ask_table(file, &lines, &all, "they hold different tests", ask)?.lines();
    Ok(all.iter().position(|table| table.lines() == chosen).map_or(1, |place| place + 1))
}

/// Returns the layout of a table for its description. All lines from the table's first row on are included.
fn written(bytes: &[u8], lines: &[&str], table: &TableBlock) -> TableLayout {
    TableLayout {
        delimiter: table.layout.delimiter,
        decimal: table.layout.decimal,
        encoding: Some(Encoding::of(bytes)),
        comment: lines.iter().find_map(|line| comment_sign(line, None)).map(String::from),
        header_line: table.header.line.filter(|_| !table.header.lacks_first_name).map(|index| index + 1),
        first_row_line: table.layout.first + 1,
        row_lines: Vec::new(),
        thousands: None,
    }
}

fn describe_layout(tables: &[&TableBlock], lines: &[&str]) -> String {
    let TableBlock { layout, header, .. } = tables[0];
    let between = match layout.delimiter {
        Delimiter::Comma => "commas",
        Delimiter::Semicolon => "semicolons",
        Delimiter::Tab => "tabs",
        Delimiter::Spaces => "blanks",
    };
    let decimals = if layout.decimal == Decimal::Comma { ", decimal commas" } else { "" };
    let named = match header.line {
        Some(index) => format!("names in line {}", index + 1),
        None => "no header".into(),
    };
    let skipped = lines[..layout.first].iter().filter(|line| !line.trim().is_empty()).count();
    let above = if skipped > usize::from(header.line.is_some()) {
        format!(", {skipped} lines above the first row")
    } else {
        String::new()
    };
    format!("{} columns separated by {between}{decimals}, {named}{above}", layout.n_cells)
}

/// Smallest number of positions from which their step is inferred.
const FEWEST_FOR_STEP: usize = 50;
/// Smallest step of written positions, as a fraction of their range, at which a zero of one row is too coarse.
const COARSE_STEP: f64 = 2e-3;

/// Step (m) of written positions, if it is coarse.
fn coarse_step_m(position_m: &[Option<f64>], range_m: f64) -> Option<f64> {
    let has_enough = position_m.iter().flatten().count() >= FEWEST_FOR_STEP;
    written_step_m(position_m).filter(|step_m| has_enough && *step_m > COARSE_STEP * range_m)
}

/// Noise (m) of neighbouring positions, from their second differences.
fn short_lag_noise_m(position_m: &[Option<f64>]) -> f64 {
    let known: Vec<f64> = position_m.iter().flatten().copied().collect();
    let sizes = known.windows(3).map(|triple| (triple[0] - 2.0 * triple[1] + triple[2]).abs()).collect();
    SD_PER_MAD * median(sizes).unwrap_or(0.0) / 6_f64.sqrt()
}

/// Largest relative difference of the interval after a switch from the time of the first row.
const SAME_INTERVAL: f64 = 0.2;
/// Least motion that shows an answer, in standard deviations of the noise; and that after a row of zeros.
const SHOWS: f64 = 8.0;
const SHOWS_BESIDE_ZERO: f64 = 3.0;

/// First position divided by the motion that the first force causes in the time of the first row (s of the table's clock). Other switches of at least half the first force show it; a
/// row's position is that before its switch. Without one, the next interval does, if it is as long and has the same force.
fn first_answer(trajectory: &Trajectory) -> Option<f64> {
    let Trajectory { time_s, force_n, position_m, clock_zero_s, .. } = trajectory;
    let (first_n, first_m) = (*force_n.first()?, (*position_m.first()?)?);
    let first_s = time_s[0] + clock_zero_s;
    let of_switch = |row: usize| {
        let switch_n = force_n[row] - force_n[row - 1];
        let interval_s = time_s.get(row + 1)? - time_s[row];
        let is_alike = switch_n.abs() >= 0.5 * first_n.abs() && (interval_s / first_s - 1.0).abs() < SAME_INTERVAL;
        is_alike.then_some(((*position_m.get(row + 1)?)? - position_m[row]?) / switch_n)
    };
    let next_m = || {
        let [t0, t1, ..] = time_s[..] else { return None };
        let is_alike = force_n.get(1) == Some(&first_n) && ((t1 - t0) / first_s - 1.0).abs() < SAME_INTERVAL;
        is_alike.then_some((*position_m.get(1)?)? - first_m)
    };
    let switches = (1..force_n.len()).filter_map(of_switch).collect();
    let expected_m = median(switches).map(|motion| first_n * motion).or_else(next_m)?;
    (expected_m.abs() > SHOWS * short_lag_noise_m(position_m)).then(|| first_m / expected_m)
}

/// Range of the first motion, divided by those after other switches, in which the load began with the first row.
const FRESH: [f64; 2] = [0.6, 1.6];

/// True if the body moves in the first interval, in proportion to the force, as after other switches of at least half the first force.
fn starts_fresh(trajectory: &Trajectory) -> bool {
    let Trajectory { time_s, force_n, position_m, .. } = trajectory;
    let velocity =
        |row: usize| Some((position_m.get(row + 1).copied()?? - position_m[row]?) / (time_s[row + 1] - time_s[row]));
    let Some(&first_n) = force_n.first() else { return false };
    let of_switch = |row: usize| {
        let switch_n = force_n[row] - force_n[row - 1];
        // The motion before the switch goes on.
        (switch_n.abs() >= 0.5 * first_n.abs()).then_some((velocity(row)? - velocity(row - 1)?) / switch_n)
    };
    let expected = median((1..force_n.len()).filter_map(of_switch).collect());
    let ratio = velocity(0).zip(expected).map(|(first, expected)| first / (first_n * expected));
    ratio.is_some_and(|ratio| (FRESH[0]..FRESH[1]).contains(&ratio))
}

/// Largest relative difference of the forces of a hold that follows the first row.
const HELD: f64 = 0.01;

/// Range of the first mean velocity, divided by the next, in which the first motion counts as one of the same load.
const AS_NEXT: [f64; 2] = [0.5, 3.0];

/// Rows before a load or a step that began between two rows.
#[derive(Clone, Copy)]
struct Idle {
    /// Number of these rows.
    n_rows: usize,
    /// Time at which the load or the step began, in s of the table's clock.
    began_s: f64,
    /// Reason in words, as the start of a sentence.
    why: &'static str,
}

/// Rows that only show the state before a load or a step whose begin no row shows.
fn idle_rows(trajectory: &Trajectory) -> Option<Idle> {
    let Trajectory { time_s, force_n, position_m, others_m, .. } = trajectory;
    if !others_m.is_empty() {
        return None;
    }
    match Control::likely(time_s, force_n, position_m) {
        Control::Force => idle_first_row(trajectory).or_else(|| rows_before_trigger(trajectory, Control::Force)),
        Control::Position => rows_before_trigger(trajectory, Control::Position),
    }
}

/// The first row, if no force acts in it and the body has moved in the second row: as far as under the force of that row, which holds, or farther after a row of zeros.
fn idle_first_row(trajectory: &Trajectory) -> Option<Idle> {
    let Trajectory { time_s, force_n, position_m, clock_zero_s, .. } = trajectory;
    let [t0, t1, t2, ..] = time_s[..] else { return None };
    let [f0, f1, ..] = force_n[..] else { return None };
    let [Some(x0), Some(x1), Some(x2), ..] = position_m[..] else { return None };
    // Later switches show how rows and switches belong together. A much faster first motion is an answer at once, to a load that began before the second row: a row of zeros
    // at time 0 is its begin.
    let holds = f0 == 0.0 && f1 != 0.0 && force_n[1..].iter().all(|f| (f / f1 - 1.0).abs() < HELD);
    let rate = (x1 - x0) / (t1 - t0) / ((x2 - x1) / (t2 - t1));
    // A row of zeros is no measurement, and has no noise.
    let shows = if x0 == 0.0 { SHOWS_BESIDE_ZERO } else { SHOWS };
    let has_moved = (x1 - x0).abs() > shows * short_lag_noise_m(position_m)
        && ((AS_NEXT[0]..AS_NEXT[1]).contains(&rate) || t0 == 0.0 && x0 == 0.0 && rate.abs() >= AS_NEXT[1]);
    let is_plain = *clock_zero_s == 0.0 && x0.abs() <= NEAR_ZERO * farthest(position_m.iter().flatten());
    (holds && has_moved && is_plain).then_some(Idle {
        n_rows: 1,
        began_s: t0,
        why: "no force acts in the first row, and the body has moved in the second: the force of the second row is taken to begin",
    })
}

/// Smallest ratio of the interval of a jump to the next interval at which rows between them are missing.
const MISSING: f64 = 3.0;

/// Smallest ratio of the intervals at the end of a hold to those at its begin at which the rows grow sparser, as those of a logarithmic clock do.
const GROWS: f64 = 2.0;
/// Number of intervals at the start of a hold.
const FIRST_INTERVALS: usize = 5;

/// The rows before time 0 of the clock, if the commanded quantity jumps from 0 to its hold between two rows on either side of that time, and rows are missing there. A row at
/// time 0 itself belongs to them if the later rows grow sparser. Otherwise the missing rows may be those of a ramp.
fn rows_before_trigger(trajectory: &Trajectory, control: Control) -> Option<Idle> {
    let Trajectory { time_s, force_n, position_m, clock_zero_s, .. } = trajectory;
    let n_rows =
        time_s.iter().position(|time| time + clock_zero_s > 0.0).filter(|n| (1..time_s.len() - 1).contains(n))?;
    let intervals_s: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let of_hold_s = &intervals_s[n_rows..];
    let middle_s = |of: &[f64]| median(of.to_vec()).unwrap_or(f64::NAN);
    let first_s = middle_s(&of_hold_s[..of_hold_s.len().min(FIRST_INTERVALS)]);
    let grows = middle_s(&of_hold_s[3 * of_hold_s.len() / 4..]) > GROWS * first_s;
    let is_missing =
        intervals_s[n_rows - 1] > MISSING * of_hold_s[0] && (time_s[n_rows - 1] + clock_zero_s < 0.0 || grows);
    let known: Option<Vec<f64>> = position_m.iter().copied().collect();
    let known = known?;
    let is_idle = |values: &[f64]| farthest(&values[..n_rows]) <= NEAR_ZERO * farthest(values);
    let commanded = if control == Control::Force { force_n } else { &known };
    let jumps = commanded[n_rows].abs() > 0.5 * farthest(commanded);
    let least_m = (SHOWS * short_lag_noise_m(position_m)).max(NEAR_ZERO * farthest(&known));
    let is_idle_before = is_idle(force_n)
        && match control {
            // The body has not moved before, up to its noise, and has moved in the first row of the load, which therefore began before it.
            Control::Force => farthest(&known[..n_rows]) <= least_m && known[n_rows].abs() > least_m,
            Control::Position => is_idle(&known),
        };
    (is_missing && jumps && is_idle_before).then_some(Idle {
        n_rows,
        began_s: 0.0,
        why: match control {
            Control::Force => "the clock shows 0 before the first row of the load, and rows are missing there: the load is taken to begin",
            Control::Position => "the clock shows 0 before the first row of the hold, and rows are missing there: the position is taken to jump",
        },
    })
}

/// Whether the force of a relaxation is not 0 before its position first changes.
fn has_force_offset(trajectory: &Trajectory) -> bool {
    let known: Option<Vec<f64>> = trajectory.position_m.iter().copied().collect();
    let force_n: Vec<Option<f64>> =
        trajectory.force_n.iter().map(|force| Some(*force).filter(|force| force.is_finite())).collect();
    known.is_some_and(|position_m| offset_at_rest(&position_m, &force_n).is_some())
}

/// Largest absolute value.
fn farthest<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().fold(0.0, |most: f64, x| most.max(x.abs()))
}

/// Largest first strain, in ranges of the strain, that is an answer to the load of the record.
const MOST_ANSWER: f64 = 10.0;

/// A number with six significant digits.
fn six_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let scale = 10f64.powi(5 - value.abs().log10().floor() as i32);
    format!("{}", (value * scale).round() / scale)
}

/// Infers the rules for the zero and direction of positions, and adds the reasons to `reasons`.
fn frame(trajectory: &Trajectory, has_force: bool, reasons: &mut Vec<String>) -> Frame {
    let Trajectory { time_s, force_n, position_m, others_m, .. } = trajectory;
    let coordinates: Vec<&[Option<f64>]> = std::iter::once(position_m).chain(others_m).map(Vec::as_slice).collect();
    let range_m = |positions: &[Option<f64>]| {
        let known = || positions.iter().flatten().copied();
        known().fold(f64::NEG_INFINITY, f64::max) - known().fold(f64::INFINITY, f64::min)
    };
    let range_m = coordinates.iter().map(|positions| range_m(positions)).fold(0.0, f64::max);
    let is_far = |place: &[f64]| place.iter().any(|x| x.abs() > NEAR_ZERO * range_m);
    let written = |place: &[f64]| {
        let shown: Vec<String> = place.iter().map(|m| six_digits(as_written(*m, trajectory.position_unit_m))).collect();
        format!("{} in the table", shown.join(" and "))
    };
    let rest: Option<Vec<f64>> =
        coordinates.iter().map(|positions| rest_m(force_n, positions).filter(|_| has_force)).collect();
    let first: Option<Vec<f64>> = coordinates.iter().map(|positions| positions.first().copied().flatten()).collect();
    // A commanded position has no noise, and its zero is known.
    let is_measured = has_force && Control::likely(time_s, force_n, position_m) == Control::Force;
    let coarse_m = coarse_step_m(position_m, range_m).filter(|_| is_measured);
    let zero = match (rest, first) {
        (Some(rest), _) if is_far(&rest) => {
            reasons.push(format!(
                "the position is {} before the force acts, not 0; the zero is fitted with the model (zero = \"fit\"), because the noise of few rows would shift all positions",
                written(&rest)
            ));
            Zero::Fit
        }
        (None, Some(first)) if is_far(&first) => {
            reasons.push(format!(
                "the first position is {}, not 0; the zero is fitted with the model (zero = \"fit\"), because the noise of one row would shift all positions",
                written(&first)
            ));
            Zero::Fit
        }
        (None, Some(first)) if first == [0.0] && coarse_m.is_some() => {
            reasons.push(format!(
                "positions have steps of {:.3} µm, so the first position of 0 is known to a step only; the zero is fitted with the model (zero = \"fit\")",
                1e6 * coarse_m.unwrap_or(0.0)
            ));
            Zero::Fit
        }
        (None, Some(_)) if is_measured && is_zeroed_by_first_row(position_m, short_lag_noise_m(position_m)) => {
            reasons.push(
                "the first position is exactly 0 although positions are noisy, so that row was probably subtracted from all others; the zero is fitted with the model (zero = \"fit\")".into(),
            );
            Zero::Fit
        }
        _ => Zero::AsWritten,
    };
    if !others_m.is_empty() {
        return Frame { zero, direction: Direction::Fit };
    }
    let opposes_first =
        || position_m.first().copied().flatten().is_some_and(|zero_m| opposes(force_n, position_m, zero_m));
    if has_force && (moves_against_force(force_n, position_m) || !is_measured && opposes_first()) {
        reasons.push("the position grows against the force, so its sign is reversed (direction = \"-\")".into());
        return Frame { zero, direction: Direction::Backward };
    }
    Frame { zero, direction: Direction::Forward }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_told_is_asked_for() {
        let refused = |text: &str| {
            propose(Path::new("t.csv"), text.as_bytes(), &TableSettings::default(), &mut |_| None)
                .unwrap_err()
                .to_string()
        };
        let rows = "0,1,0\n1,1,2\n2,1,3\n";
        assert!(refused(rows).contains("`time`"));
        assert!(refused(&format!("t,F,x\n{rows}")).contains("unit_time s unit_force uN unit_position um"));
        assert!(refused(&format!("t [s],F [V],x [um]\n{rows}")).contains("`force`"));
        let two = refused("t [s],F [uN],position a [um],position b [um]\n0,1,0,0\n1,1,2,2\n");
        assert!(two.contains("several columns may be the position"), "{two}");
        let counts = refused("frame,F [uN],x (px)\n0,1,0\n1,1,2\n");
        assert!(counts.contains("unit_time \"0.05 s\" unit_position \"0.65 um\"` if one frame"), "{counts}");
        let current = refused("t [s],coil [A],x [um]\n0,1,0\n1,1,2\n");
        assert!(current.contains("[actuation]"), "{current}");
        assert!(refused("nothing\nhere\n").contains("no two columns"));
    }

    #[test]
    fn an_unknown_unit_is_named_with_its_column() {
        let text = |unit: &str| format!("t [s],Load ({unit}),x [um]\n0,1,0\n1,1,2\n2,1,3\n");
        let read = |unit: &str, given: &TableSettings| {
            propose(Path::new("t.csv"), text(unit).as_bytes(), given, &mut |_| None).map_err(|error| error.to_string())
        };
        let refused = read("ozf", &TableSettings::default()).unwrap_err();
        for words in ["`Load (ozf)`", "`ozf` is no known unit of force", "unit_force \"9.81 mN\""] {
            assert!(refused.contains(words), "{refused}");
        }
        let given = |unit: &str| TableSettings { units: [None, Some(unit.into()), None], ..TableSettings::default() };
        assert!((read("ozf", &given("278 mN")).unwrap().force_n[1] - 0.278).abs() < 1e-12);
        let other = read("mN", &given("uN")).unwrap();
        assert!(
            other.force_n[1] < 2e-6 && other.reasons.iter().any(|reason| reason.contains("although the table says mN"))
        );
        assert!(read("mN", &given("1 mN")).unwrap().reasons.iter().all(|reason| !reason.contains("although")));
        assert!((read("dyn", &TableSettings::default()).unwrap().force_n[1] - 1e-5).abs() < 1e-18);
    }

    /// Means below a table are named and not read. A word within the rows is refused. Many rows that begin with a name are rows.
    #[test]
    fn means_below_a_table_are_named() {
        let read = |text: &str| {
            propose(Path::new("t.csv"), text.as_bytes(), &TableSettings::default(), &mut |_| None)
                .map_err(|error| error.to_string())
        };
        let rows = "t [s],F [uN],x [um]\n0,1,0\n1,1,2\n2,1,3\n3,1,4\n";
        let summary = "Mean,1,2.2\nSD,0,1.7\n";
        for text in
            [format!("{rows}{summary}"), format!("{rows}\n,,\n{summary}"), format!("{rows}{summary}End of data\n")]
        {
            let found = read(&text).unwrap();
            assert_eq!((found.n_rows, found.position_m), (4, [0.0, 4e-6]), "{text}");
            assert!(found.reasons.iter().any(|reason| reason.contains("(`Mean`), line ")), "{:?}", found.reasons);
        }
        let within = read(&format!("{rows}paused,1,4\n4,1,5\n5,1,6\n")).unwrap_err();
        assert!(within.contains("line 6") && within.contains("begin it with `#` or delete it"), "{within}");
        let specimens: String = (0..30).map(|k| format!("{},{k},1,{k}\n", if k < 15 { "1" } else { "A" })).collect();
        let many = read(&format!("label,t [s],F [uN],x [um]\n{specimens}")).unwrap();
        assert_eq!(many.n_rows, 30);
    }

    #[test]
    fn questions_that_are_answered_take_the_place_of_options() {
        let text = "when,a [um],b [um],pull\n0,5,0,1\n1,6,2,1\n2,7,3,1\n";
        let mut asked = Vec::new();
        let mut answer = |question: &Question| {
            asked.push(question.text.clone());
            Some(match question.text.as_str() {
                "column of the time" => "when".to_string(),
                "column of the force" => "4".to_string(),
                "column of the position" => "b [um]".to_string(),
                _ => question.proposal.clone()?,
            })
        };
        let proposal = propose(Path::new("t.csv"), text.as_bytes(), &TableSettings::default(), &mut answer).unwrap();
        assert_eq!(asked.len(), 5, "{asked:?}");
        assert_eq!(
            proposal.description.position.unwrap().0,
            PositionColumns::Along(ColumnName::Named("b [um]".into()))
        );
        assert_eq!(proposal.description.force.unwrap().1.name, "uN");
        assert_eq!(proposal.position_m, [0.0, 3e-6]);
    }

    /// Checks that tables are joined where the clock goes on or the position does, and that the question names the reason otherwise. The fourth case has the columns of
    /// the second table in another order.
    #[test]
    fn tables_of_one_recording_are_joined() {
        let header = "t [s],F [uN],x [um]\n";
        let first = "0,0,0\n1,0,0\n2,0,1\n";
        let joined = |header_2: &str, second: &str, tables: Option<&str>| {
            let text = format!("{header}{first}\n{header_2}{second}");
            let given = TableSettings { tables: tables.map(String::from), ..TableSettings::default() };
            propose(Path::new("t.csv"), text.as_bytes(), &given, &mut |_| None)
                .map(|proposal| proposal.n_rows)
                .map_err(|error| error.to_string())
        };
        assert_eq!(joined(header, "3,5,40\n4,5,50\n5,5,55\n", None), Ok(6));
        assert!(joined(header, "300,5,40\n301,5,50\n302,5,55\n", None).unwrap_err().contains("after a pause"));
        assert!(joined(header, "0,5,40\n1,5,50\n2,5,55\n", None).unwrap_err().contains("starts anew"));
        let other = "t [s],x [um],F [uN]\n";
        for header_2 in [other, "t [s],F [mN],x [um]\n"] {
            let refused = joined(header_2, "3,40,5\n4,50,5\n5,55,5\n", Some("all")).unwrap_err();
            assert!(refused.contains("tables 1 and 2 cannot be joined"), "{refused}");
        }
        assert_eq!(joined(other, "3,40,5\n4,50,5\n5,55,5\n", Some("2")), Ok(3));
        assert_eq!(joined(header, "0,5,40\n1,5,50\n2,5,55\n", Some("all")), Ok(6));
    }

    /// Checks that a comment column without cells, as LabVIEW writes it, is ignored. Counts of camera pixels and frames are converted with given
    /// sizes.
    #[test]
    fn remarks_are_no_column_and_counts_have_sizes() {
        let given = TableSettings {
            units: ["0.05 s", "uN", "0.65 um"].map(|unit| Some(unit.into())),
            ..TableSettings::default()
        };
        let text = "X_Value\tForce\tx_px\tComment\n0\t1\t0\n1\t1\t2\n2\t1\t4\n";
        let proposal = propose(Path::new("t.lvm"), text.as_bytes(), &given, &mut |_| None).unwrap();
        assert_eq!(proposal.columns, ["X_Value", "Force", "x_px"]);
        assert!((proposal.duration_s - 0.1).abs() < 1e-12 && (proposal.position_m[1] - 2.6e-6).abs() < 1e-15);
        assert_eq!(proposal.description.position.unwrap().1.name, "0.65 um");
    }

    #[test]
    fn x_with_a_y_beside_it_is_a_plane() {
        let plane = |header: &str| {
            let text = format!("{header}\n0,1,0,0\n1,1,3,4\n2,1,6,8\n");
            propose(Path::new("t.csv"), text.as_bytes(), &TableSettings::default(), &mut |_| None).unwrap()
        };
        for header in
            ["t_s,F_uN,x (um),y (um)", "t_s,F_uN,position_x_um,position_y_um", "t_s,F_uN,Pos X [um],Pos Y [um]"]
        {
            let proposal = plane(header);
            assert_eq!(proposal.description.n_axes(), 2, "{header}");
            assert!((proposal.position_m[1] - 10e-6).abs() < 1e-12, "{header}: {:?}", proposal.position_m);
        }
        assert_eq!(plane("t_s,F_uN,x (um),y (mm)").description.n_axes(), 1);
        let of_force = b"t_s,Fx (uN),Fy (uN),x (um),y (um)\n0,1,0,0,0\n1,1,1,3,4\n2,1,1,6,8\n";
        let read = |given: &TableSettings| propose(Path::new("t.csv"), of_force, given, &mut |_| None);
        let refused = read(&TableSettings::default()).unwrap_err().to_string();
        assert!(refused.contains("`Fx (uN)` is one component of a force"), "{refused}");
        let columns = [None, Some("Fx (uN)".into()), None, None];
        assert!(read(&TableSettings { columns, ..TableSettings::default() }).is_ok());
        let text = "t_s,F_uN,x (um),y (um)\n0,1,0,500.25\n1,1,3,504\n2,1,6,508\n";
        let far = propose(Path::new("t.csv"), text.as_bytes(), &TableSettings::default(), &mut |_| None).unwrap();
        assert!(far.reasons.iter().any(|reason| reason.contains("is 0 and 500.25 in the table")), "{:?}", far.reasons);
    }

    fn proposed(text: &str, given: &TableSettings) -> std::result::Result<TableProposal, String> {
        propose(Path::new("t.csv"), text.as_bytes(), given, &mut |_| None).map_err(|error| error.to_string())
    }

    /// Names that line breaks divide, a word between rows, and a row behind a comment sign.
    #[test]
    fn names_and_rows_are_found_again_by_the_description() {
        let given = TableSettings::default();
        let rows = "0,1,0\n1,1,2\n2,1,3\n3,1,4\n";
        let broken = proposed(&format!("\"t\n[s]\",\"F\n[uN]\",\"x\n[um]\"\n{rows}"), &given).unwrap();
        assert_eq!(broken.description.time.0, ColumnName::Named("t [s]".into()));
        assert_eq!((broken.n_rows, broken.position_m), (4, [0.0, 4e-6]));
        let marked = proposed(&format!("t [s],F [uN],x [um]\n-1,0,0\neoh\n{rows}#4,1,5\n"), &given).unwrap();
        assert_eq!((marked.n_rows, marked.duration_s), (5, 4.0));
        assert_eq!(marked.description.layout.row_lines, [[2, 2], [4, 7]]);
        for words in ["line 3 (`eoh`)", "1 rows begin with `#` and are left out as comments, the first in line 8"] {
            assert!(marked.reasons.iter().any(|reason| reason.contains(words)), "{:?}", marked.reasons);
        }
        let none = proposed("bead,t [s],F [uN],x [um]\n#3,0,1,0\n#3,1,1,2\n#3,2,1,3\n", &given).unwrap_err();
        assert!(none.contains("every row begins with the sign of a comment"), "{none}");
        // A line that lacks the first name gives numbers, as the names do not find their columns.
        let shifted = proposed("t [s]\tF [uN]\tx [um]\n\t0\t1\t0\n\t1\t1\t2\n\t2\t1\t3\n", &given).unwrap();
        assert_eq!(shifted.description.time.0, ColumnName::Number(2));
        assert_eq!((shifted.description.layout.header_line, shifted.position_m), (None, [0.0, 3e-6]));
    }

    #[test]
    fn a_constant_column_of_cycles_is_not_read() {
        let text = |cycles: [&str; 3]| {
            let [a, b, c] = cycles;
            format!("t [s],F [uN],x [um],C_1_Cycles[]\n0,1,0,{a}\n1,1,2,{b}\n2,1,3,{c}\n")
        };
        let given = TableSettings::default();
        for cell in ["0.0", "1"] {
            let found = proposed(&text([cell; 3]), &given).unwrap();
            let said = format!("`C_1_Cycles[]` is `{cell}` in every row");
            assert!(found.reasons.iter().any(|reason| reason.starts_with(&said)), "{:?}", found.reasons);
            assert_eq!(found.description.cycle, None);
        }
        let read = proposed(&text(["1.0", "1.0", "2.0"]), &given).unwrap();
        assert_eq!(read.description.cycle, Some(ColumnName::Named("C_1_Cycles[]".into())));
        let refused = proposed(&text(["0", "1", "2"]), &given).unwrap_err();
        assert!(refused.contains("`0` is not a cycle number"), "{refused}");
        let columns = [None, None, None, Some("none".into())];
        let without = proposed(&text(["0", "1", "2"]), &TableSettings { columns, ..given }).unwrap();
        assert_eq!(without.description.cycle, None);
    }

    #[test]
    fn too_few_columns_are_told_how_to_be_named() {
        let refused = |text: &str, given: &TableSettings| proposed(text, given).unwrap_err();
        let given = TableSettings::default();
        let timed = TableSettings { columns: [Some("1".into()), None, None, None], ..given.clone() };
        for (text, given) in [("0.1,30\n0.2,20\n0.3,15\n", &given), ("0.1,30,\n0.2,20,\n0.3,15,\n", &timed)] {
            let refused = refused(text, given);
            assert!(refused.contains("2 columns without names") && refused.contains("`G(t) [Pa]`"), "{refused}");
        }
        let force = refused("t [s],F [uN]\n0,1\n1,1\n2,1\n", &given);
        for words in ["no column is the position", "add a column of the position", "`G(t) [Pa]`"] {
            assert!(force.contains(words), "{force}");
        }
        assert!(refused("t [s],x [um]\n0,1\n1,1\n2,1\n", &given).contains("`force_file`"));
        // A question remains where a column is left.
        assert!(refused("t [s],F [uN],A\n0,1,1\n1,1,1\n2,1,1\n", &given).contains("select it with `position NAME`"));
    }

    #[test]
    fn a_last_row_far_behind_the_record_is_named() {
        let rows = |times: &[f64]| -> String {
            times.iter().fold("t [s],F [uN],x [um]\n".into(), |text, t| text + &format!("{t},1,{}\n", t.sqrt()))
        };
        let even: Vec<f64> = (0..20).map(f64::from).collect();
        let far = |last_s: f64| [even.clone(), vec![last_s]].concat();
        let logarithmic: Vec<f64> = (0..20).map(|row| 3_f64.powi(row)).collect();
        let paused: Vec<f64> = (0..20).map(|row| if row < 10 { 0.0 } else { 200.0 } + f64::from(row)).collect();
        for (times, line) in [(far(820.0), Some(22)), (far(30.0), None), (logarithmic, None), (paused, None)] {
            let found = proposed(&rows(&times), &TableSettings::default()).unwrap();
            let said = found.reasons.iter().find(|reason| reason.contains("the last row"));
            assert_eq!(said.is_some(), line.is_some(), "{said:?}");
            if let (Some(said), Some(line)) = (said, line) {
                assert!(said.contains(&format!("line {line}, is 801 s after")), "{said}");
            }
        }
    }
}
