//! Looks at a table and says how it is written, and why it thinks so.

use std::borrow::Cow;
use std::path::Path;

use super::description::{ColumnName, PositionColumns, TableDescription, TableLayout, TimeFormat};
use super::read::read_described;
use super::spelling::{Spelt, clock_s, counted, iso_s, split_unit, unit};
use super::text::{Decimal, Delimiter, Encoding, cells, comment_sign, header_cells, is_aside, table_text};
use crate::frame::{Direction, Frame, Zero, is_clearly_against, rest_m};
use crate::trajectory::{Trajectory, is_lost};
use base::error::{Error, Place, Result, Setting};
use base::units::Dimension;

/// Lines that are looked at for the layout.
const LOOKED_AT: usize = 5_000;
/// Letters of a cell in a line of units.
const LONGEST_UNIT: usize = 8;
/// Names of columns of remarks.
const REMARKS: [&str; 6] = ["", "comment", "comments", "note", "notes", "remarks"];
/// Share of the positions' range by which a record that starts at 0 may miss it.
const NEAR_ZERO: f64 = 0.02;

/// What the user says of a table; whatever is missing is found.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Given {
    /// Columns of time, force, position and cycle, by name or number.
    pub columns: [Option<String>; 4],
    /// Columns of x and y, where the position is not in one column.
    pub plane: [Option<String>; 2],
    /// Units of time, force and position.
    pub units: [Option<String>; 3],
}

/// What a table does not say, for whoever can.
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    /// What is asked for, without a question mark.
    pub text: String,
    /// What may be answered; empty where anything may.
    pub choices: Vec<String>,
    /// What is proposed.
    pub proposal: Option<String>,
}

/// Gives the answer to a question, or `None` where nobody is there.
pub type Ask<'a> = &'a mut dyn FnMut(&Question) -> Option<String>;

/// A description, and what speaks for it.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// The description.
    pub description: TableDescription,
    /// Where positions are zero and which way they grow.
    pub frame: Frame,
    /// Names of all columns, empty where there is no header.
    pub columns: Vec<String>,
    /// In words, one sentence each.
    pub reasons: Vec<String>,
    /// Number of rows.
    pub n_rows: usize,
    /// Rows without a position.
    pub n_lost: usize,
    /// Length of the record, in s.
    pub duration_s: f64,
    /// Smallest and largest force, in N.
    pub force_n: [f64; 2],
    /// Smallest and largest position from where it is 0, in m.
    pub position_m: [f64; 2],
}

/// What a column is for; in the order of [`Given::columns`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    Time,
    Force,
    Position,
    Cycle,
}

impl Role {
    const ALL: [Self; 4] = [Self::Time, Self::Force, Self::Position, Self::Cycle];

    fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Force => "force",
            Self::Position => "position",
            Self::Cycle => "cycle",
        }
    }

    /// The setting that says which column it is.
    fn column_setting(self) -> Setting {
        match self {
            Self::Time => Setting::TimeColumn,
            Self::Force => Setting::ForceColumn,
            Self::Position => Setting::PositionColumn,
            Self::Cycle => Setting::CycleColumn,
        }
    }

    /// The setting that says its unit; a cycle has none.
    fn unit_setting(self) -> Setting {
        match self {
            Self::Time => Setting::TimeUnit,
            Self::Force => Setting::ForceUnit,
            Self::Position | Self::Cycle => Setting::PositionUnit,
        }
    }

    /// An example of the setting that says its unit, of a column of that name.
    fn unit_option(self, column: &str) -> String {
        let unit = match (self, counted(column)) {
            (Self::Time, None) => "s",
            (Self::Time, Some(_)) => "\"0.05 s\"",
            (Self::Force, _) => "uN",
            (Self::Position | Self::Cycle, None) => "um",
            (Self::Position | Self::Cycle, Some(_)) => "\"0.65 um\"",
        };
        format!("{} {unit}", self.unit_setting())
    }

    fn unit_question(self) -> Question {
        let (choices, proposal) = match self {
            Self::Time => ("s ms us min h", "s"),
            Self::Force => ("N mN uN nN pN", "uN"),
            Self::Position | Self::Cycle => ("m mm um nm", "um"),
        };
        Question {
            text: format!("unit of the {}", self.name()),
            choices: choices.split(' ').map(String::from).collect(),
            proposal: Some(proposal.into()),
        }
    }

    fn dimension(self) -> Option<Dimension> {
        match self {
            Self::Time => Some(Dimension::Time),
            Self::Force => Some(Dimension::Force),
            Self::Position => Some(Dimension::Length),
            Self::Cycle => None,
        }
    }

    /// Names that are this and nothing else, and parts of names that suggest it.
    fn words(self) -> (&'static [&'static str], &'static [&'static str]) {
        match self {
            Self::Time => (
                &["t", "time", "zeit", "temps", "timestamp", "elapsed", "xvalue"],
                &["time", "zeit", "elapsed", "frame"],
            ),
            Self::Force => (&["f", "force", "kraft", "fx", "load"], &["force", "kraft"]),
            Self::Position => (
                &["x", "position", "pos", "displacement", "weg"],
                &["position", "displac", "auslenk", "posx", "xpos", "xcoord"],
            ),
            Self::Cycle => (&["cycle", "zyklus", "cyc"], &["cycle", "zyklus"]),
        }
    }
}

/// The rows of a table, and between what its cells stand.
struct Layout {
    delimiter: Delimiter,
    decimal: Decimal,
    /// Index of the first row's line.
    first: usize,
    n_cells: usize,
}

fn is_value(cell: &str, decimal: Decimal) -> bool {
    decimal.number(cell).is_some() || clock_s(cell).is_some() || iso_s(cell).is_some()
}

/// The layout in which most cells of one block of lines are numbers or times.
fn layout(lines: &[&str]) -> Option<Layout> {
    let mut best: Option<(i64, Layout)> = None;
    for delimiter in Delimiter::ALL {
        for decimal in Decimal::ALL {
            if (delimiter, decimal) == (Delimiter::Comma, Decimal::Comma) {
                continue;
            }
            let mut run: Option<(i64, Layout)> = None;
            let mut finish = |run: &mut Option<(i64, Layout)>| {
                if let Some((score, layout)) = run.take()
                    && best.as_ref().is_none_or(|(most, _)| score > *most)
                {
                    best = Some((score, layout));
                }
            };
            for (index, line) in lines.iter().enumerate().filter(|(_, line)| !is_aside(line, None)) {
                let cells = cells(line, delimiter);
                let n_values = cells.iter().filter(|cell| is_value(cell, decimal)).count() as i64;
                let n_others = cells.iter().filter(|cell| !is_value(cell, decimal) && !is_lost(cell)).count() as i64;
                if n_values < 2 || n_values < n_others {
                    finish(&mut run);
                    continue;
                }
                if run.as_ref().is_some_and(|(_, layout)| layout.n_cells != cells.len()) {
                    finish(&mut run);
                }
                let fresh = Layout { delimiter, decimal, first: index, n_cells: cells.len() };
                run.get_or_insert((0, fresh)).0 += n_values - n_others;
            }
            finish(&mut run);
        }
    }
    best.map(|(_, layout)| layout)
}

/// The header's line, its names and the units beneath them.
#[derive(Default)]
struct Header {
    line: Option<usize>,
    names: Vec<String>,
    units: Vec<Option<Spelt>>,
    /// Columns whose unit is none of ours: a temperature, a voltage.
    foreign: Vec<usize>,
}

/// A line's cells as names, if it has as many as the rows have and two of them are words.
fn names_in(line: &str, layout: &Layout) -> Option<Vec<String>> {
    let mut found: Vec<String> =
        header_cells(line, layout.delimiter, None, layout.n_cells).into_iter().map(Cow::into_owned).collect();
    // A column of remarks may have a name and no cells.
    while found.len() > layout.n_cells
        && found.last().is_some_and(|last| REMARKS.contains(&last.to_lowercase().as_str()))
    {
        found.pop();
    }
    let n_words = found.iter().filter(|cell| !cell.is_empty() && !is_value(cell, layout.decimal)).count();
    (found.len() == layout.n_cells && n_words >= 2).then_some(found)
}

fn header(lines: &[&str], layout: &Layout) -> Header {
    let above: Vec<usize> = (0..layout.first).rev().filter(|index| !lines[*index].trim().is_empty()).take(2).collect();
    let names = |place: usize| above.get(place).and_then(|index| Some((*index, names_in(lines[*index], layout)?)));
    let Some((line, nearest)) = names(0) else { return Header::default() };
    let units: Vec<Option<Spelt>> = nearest.iter().map(|cell| unit(cell)).collect();
    // A line of units may have some that are none of ours, such as °C.
    if let Some((line, names)) = names(1)
        && units.iter().flatten().count() >= 2
        && nearest.iter().all(|cell| cell.chars().count() <= LONGEST_UNIT)
    {
        let is_foreign = |at: &usize| units[*at].is_none() && nearest[*at].chars().any(char::is_alphabetic);
        let foreign = (0..units.len()).filter(is_foreign).collect();
        return Header { line: Some(line), names, units, foreign };
    }
    let units = nearest.iter().map(|name| split_unit(name).1).collect();
    Header { line: Some(line), names: nearest, units, foreign: Vec::new() }
}

/// How well a column fits a role; `None` where its unit speaks against it.
fn fit(role: Role, name: &str, unit: Option<&Spelt>) -> Option<u32> {
    let stem = counted(name).map_or_else(|| split_unit(name).0, |(stem, _)| stem);
    let plain: String = stem.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
    let (exact, parts) = role.words();
    let by_name = match plain.as_str() {
        plain if exact.contains(&plain) => 4,
        plain if parts.iter().any(|part| plain.contains(part)) => 2,
        _ => 0,
    };
    let by_unit = match (role.dimension(), unit) {
        (Some(wanted), Some(unit)) if unit.dimension == wanted => 1,
        (_, Some(_)) => return None,
        _ => 0,
    };
    // A unit alone says what is measured, not what of.
    Some(by_name + by_unit)
}

/// Finds how a table is written; `file` is only named in errors. What cannot be told is asked for.
///
/// # Errors
/// [`Error::Input`] where no block of numbers is found, where a column or a unit cannot be told, and what reading the table so refuses; with the option that helps.
pub fn propose(file: &Path, bytes: &[u8], given: &Given, ask: Ask<'_>) -> Result<Proposal> {
    let text = &*table_text(bytes);
    let lines: Vec<&str> = text.lines().take(LOOKED_AT).collect();
    let (layout, header) = layout_and_header(file, &lines)?;
    let mut reasons = vec![said_of(&layout, &header, &lines)];
    let seen = Seen { file, given, header: &header, layout: &layout };
    let mut columns: [Option<usize>; 4] = [None; 4];
    let mut y_column = None;
    for role in Role::ALL {
        let taken: Vec<usize> = columns.into_iter().chain([y_column]).flatten().collect();
        match seen.column(role, &taken, ask)? {
            Found::Nowhere => {}
            Found::Alone(at) => columns[role as usize] = Some(at),
            Found::Plane([x, y]) => (columns[role as usize], y_column) = (Some(x), Some(y)),
        }
    }
    let first_row = cells(lines[layout.first], layout.delimiter);
    let cell = |role: Role| columns[role as usize].and_then(|at| first_row.get(at)).map_or("", |cell| cell.as_ref());
    let own_unit = |role: Role| columns[role as usize].and_then(|at| header.units.get(at).cloned().flatten());
    let mut said = given.units.clone();
    let has_form = |role: Role| {
        let cell = cell(role);
        role == Role::Time && (clock_s(cell).is_some() || iso_s(cell).is_some())
    };
    let called = |role: Role| columns[role as usize].and_then(|at| header.names.get(at)).map_or("", String::as_str);
    let mut missing: Vec<Role> = [Role::Time, Role::Force, Role::Position]
        .into_iter()
        .filter(|role| said[*role as usize].is_none() && own_unit(*role).is_none() && !has_form(*role))
        .collect();
    missing.retain(|role| {
        said[*role as usize] = ask(&role.unit_question());
        said[*role as usize].is_none()
    });
    if let Some(first) = missing.first() {
        let names: Vec<&str> = missing.iter().map(|role| role.name()).collect();
        let options: Vec<String> = missing.iter().map(|role| role.unit_option(called(*role))).collect();
        let counts: Vec<&str> = missing.iter().filter_map(|role| Some(counted(called(*role))?.1)).collect();
        let of_counts = counts.first().map_or(String::new(), |what| format!(" where a {what} is as long as that"));
        return Err(Error::input(
            Place::setting(first.unit_setting()),
            format!("{}: the table does not say the unit of {}", file.display(), names.join(" and ")),
            format!("say it, as in `{}`{of_counts}", options.join(" ")),
        ));
    }
    let told = |role: Role| said[role as usize].as_deref();
    let unit_of = |role: Role| -> Result<Spelt> {
        let found = told(role).map_or_else(|| own_unit(role), unit);
        found.filter(|unit| Some(unit.dimension) == role.dimension()).ok_or_else(|| {
            let found = format!("`{}` is no unit of a {}", told(role).unwrap_or_default(), role.name());
            let remedy = format!("say it, as in `{}`", role.unit_option(called(role)));
            Error::input(Place::setting(role.unit_setting()), found, remedy)
        })
    };
    let time_format = match told(Role::Time) {
        Some("clock") => TimeFormat::Clock,
        Some("iso") => TimeFormat::Iso,
        None if iso_s(cell(Role::Time)).is_some() => TimeFormat::Iso,
        None if clock_s(cell(Role::Time)).is_some() => TimeFormat::Clock,
        _ => TimeFormat::Unit(unit_of(Role::Time)?),
    };
    let name_at = |at: usize| match header.names.get(at) {
        Some(name) if header.names.iter().filter(|other| *other == name).count() == 1 && !name.is_empty() => {
            ColumnName::Named(name.clone())
        }
        _ => ColumnName::Number(at + 1),
    };
    let name = |role: Role| columns[role as usize].map(name_at);
    let wanted = |role: Role| name(role).unwrap_or(ColumnName::Number(1));
    let position = match y_column {
        None => PositionColumns::Along(wanted(Role::Position)),
        Some(y) => PositionColumns::Plane([wanted(Role::Position), name_at(y)]),
    };
    let description = TableDescription {
        layout: written(bytes, &lines, &layout, &header),
        time: (wanted(Role::Time), time_format),
        force: Some((wanted(Role::Force), unit_of(Role::Force)?)),
        position: Some((position, unit_of(Role::Position)?)),
        cycle: name(Role::Cycle),
    };
    let mut trajectory = read_described(file, text, &description)?;
    let frame = frame(&trajectory, &mut reasons);
    if let Some(projection) = frame.settle(file, &mut trajectory)?.projection {
        reasons.push(format!(
            "x and y are projected on the line of motion, at {:.1}° from x; across it they scatter by {:.3} µm (root mean square)",
            projection.degrees,
            1e6 * projection.across_rms_m
        ));
    }
    let ends = |values: &mut dyn Iterator<Item = f64>| {
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    };
    Ok(Proposal {
        columns: header.names,
        reasons,
        n_rows: trajectory.time_s.len(),
        n_lost: trajectory.position_m.iter().filter(|x| x.is_none()).count(),
        duration_s: trajectory.time_s.last().zip(trajectory.time_s.first()).map_or(0.0, |(last, first)| last - first),
        force_n: ends(&mut trajectory.force_n.iter().copied()),
        position_m: ends(&mut trajectory.position_m.iter().flatten().copied()),
        description,
        frame,
    })
}

fn layout_and_header(file: &Path, lines: &[&str]) -> Result<(Layout, Header)> {
    let layout = layout(lines).ok_or_else(|| {
        Error::input(
            Place::file(file),
            "no two columns of numbers are found",
            "export the table as text: one sample a line, cells between commas, semicolons, tabulators or blanks",
        )
    })?;
    let header = header(lines, &layout);
    Ok((layout, header))
}

/// A table's layout and what its columns are called.
#[derive(Debug, Clone)]
pub struct Looked {
    /// The layout.
    pub layout: TableLayout,
    /// Names of the columns; empty where there is no header.
    pub columns: Vec<String>,
    /// Their units, where they are said.
    pub units: Vec<Option<Spelt>>,
    /// The layout in words.
    pub said: String,
}

/// Finds a table's layout and header; `file` is only named in errors.
///
/// # Errors
/// [`Error::Input`] where no block of numbers is found.
pub fn look(file: &Path, bytes: &[u8]) -> Result<Looked> {
    let text = &*table_text(bytes);
    let lines: Vec<&str> = text.lines().take(LOOKED_AT).collect();
    let (layout, header) = layout_and_header(file, &lines)?;
    let said = said_of(&layout, &header, &lines);
    Ok(Looked { layout: written(bytes, &lines, &layout, &header), columns: header.names, units: header.units, said })
}

/// The layout as it is described.
fn written(bytes: &[u8], lines: &[&str], layout: &Layout, header: &Header) -> TableLayout {
    TableLayout {
        delimiter: layout.delimiter,
        decimal: layout.decimal,
        encoding: Some(Encoding::of(bytes)),
        comment: lines.iter().find_map(|line| comment_sign(line, None)).map(String::from),
        header_line: header.line.map(|index| index + 1),
        first_row_line: layout.first + 1,
    }
}

fn said_of(layout: &Layout, header: &Header, lines: &[&str]) -> String {
    let between = match layout.delimiter {
        Delimiter::Comma => "commas",
        Delimiter::Semicolon => "semicolons",
        Delimiter::Tab => "tabulators",
        Delimiter::Spaces => "blanks",
    };
    let decimals = if layout.decimal == Decimal::Comma { ", decimal commas" } else { "" };
    let named = match header.line {
        Some(index) => format!("names in line {}", index + 1),
        None => "no names".into(),
    };
    let skipped = lines[..layout.first].iter().filter(|line| !line.trim().is_empty()).count();
    let above = if skipped > usize::from(header.line.is_some()) {
        format!(", {skipped} lines above the first row")
    } else {
        String::new()
    };
    format!("{} columns between {between}{decimals}, {named}{above}", layout.n_cells)
}

/// Where a quantity stands.
enum Found {
    Nowhere,
    Alone(usize),
    Plane([usize; 2]),
}

/// What is known of a table's columns.
struct Seen<'a> {
    file: &'a Path,
    given: &'a Given,
    header: &'a Header,
    layout: &'a Layout,
}

impl Seen<'_> {
    fn listed(&self) -> String {
        if self.header.names.is_empty() {
            return format!("columns are counted from 1 to {}", self.layout.n_cells);
        }
        let names: Vec<String> = self.header.names.iter().map(|name| format!("`{name}`")).collect();
        format!("the columns are {}", names.join(", "))
    }

    fn at(&self, told: &str) -> Option<usize> {
        let by_name = self.header.names.iter().position(|name| name == told);
        let numbers = 1..=self.layout.n_cells;
        by_name.or_else(|| told.parse::<usize>().ok().filter(|n| numbers.contains(n)).map(|n| n - 1))
    }

    fn told(&self, setting: Setting, told: &str) -> Result<usize> {
        self.at(told).ok_or_else(|| {
            let remedy = format!("{}; give a name or a number", self.listed());
            Error::input(Place::setting(setting), format!("there is no column `{told}`"), remedy)
        })
    }

    /// x and y as they are given.
    fn given_plane(&self) -> Result<Option<[usize; 2]>> {
        let [x, y, position] = [Setting::XColumn, Setting::YColumn, Setting::PositionColumn];
        let one_way = format!("give `{x}` and `{y}`, or `{position}` alone");
        match (&self.given.plane, &self.given.columns[Role::Position as usize]) {
            ([None, None], _) => Ok(None),
            ([Some(x), Some(y)], None) => Ok(Some([self.told(Setting::XColumn, x)?, self.told(Setting::YColumn, y)?])),
            ([x, _], None) => {
                let missing = if x.is_none() { Setting::XColumn } else { Setting::YColumn };
                let found = "one coordinate is given without the other";
                Err(Error::input(Place::setting(missing), found, one_way))
            }
            (_, Some(_)) => {
                let found = "the position is given beside x and y";
                Err(Error::input(Place::setting(Setting::PositionColumn), found, one_way))
            }
        }
    }

    /// The column that is called as this one with y for an x, with the same unit.
    fn partner(&self, at: usize, taken: &[usize]) -> Option<usize> {
        let (names, units) = (&self.header.names, &self.header.units);
        let name = names.get(at)?;
        let turned = name.char_indices().filter_map(|(place, letter)| {
            let y = match letter {
                'x' => "y",
                'X' => "Y",
                _ => return None,
            };
            Some(format!("{}{y}{}", &name[..place], &name[place + 1..]))
        });
        let free = |other: &usize| *other != at && !taken.contains(other) && !self.header.foreign.contains(other);
        turned
            .filter_map(|turned| names.iter().position(|other| *other == turned))
            .find(|other| free(other) && units.get(*other) == units.get(at))
    }

    /// Where a role's column is: where it is said, where it fits best, or where the answer to a question says.
    fn column(&self, role: Role, taken: &[usize], ask: Ask<'_>) -> Result<Found> {
        if role == Role::Position
            && let Some(plane) = self.given_plane()?
        {
            return Ok(Found::Plane(plane));
        }
        let setting = role.column_setting();
        if let Some(told) = &self.given.columns[role as usize] {
            return self.told(setting, told).map(Found::Alone);
        }
        let header = self.header;
        let free = (0..header.names.len()).filter(|at| !taken.contains(at) && !header.foreign.contains(at));
        let mut fits: Vec<(u32, usize)> =
            free.filter_map(|at| Some((fit(role, &header.names[at], header.units[at].as_ref())?, at))).collect();
        fits.retain(|(fit, _)| *fit > u32::from(role == Role::Cycle));
        fits.sort_by_key(|(fit, at)| (std::cmp::Reverse(*fit), *at));
        let best: Vec<usize> = fits.iter().filter(|(fit, _)| *fit == fits[0].0).map(|(_, at)| *at).collect();
        if role == Role::Position {
            let plane = best.iter().find_map(|at| Some([*at, self.partner(*at, taken)?]));
            if let Some(plane) = plane.filter(|plane| best.iter().all(|at| plane.contains(at))) {
                return Ok(Found::Plane(plane));
            }
        }
        let found = match best.as_slice() {
            [] if role == Role::Cycle => return Ok(Found::Nowhere),
            [at] => return Ok(Found::Alone(*at)),
            [] => format!("{}: no column is called as a {} is", self.file.display(), role.name()),
            _ => format!("{}: several columns may be the {}", self.file.display(), role.name()),
        };
        // A header may say which columns are left; without one every number may be meant.
        let left = (0..self.layout.n_cells).filter(|at| !taken.contains(at));
        let called = |at: usize| header.names.get(at).filter(|name| !name.is_empty()).cloned();
        let choices: Vec<String> = left.map(|at| called(at).unwrap_or_else(|| (at + 1).to_string())).collect();
        let proposal = best.first().and_then(|at| called(*at)).or_else(|| choices.first().cloned());
        let question = Question { text: format!("column of the {}", role.name()), choices, proposal };
        match ask(&question).map(|told| self.told(setting, &told)) {
            Some(at) => at.map(Found::Alone),
            None => {
                let is_current =
                    |unit: &Option<Spelt>| unit.as_ref().is_some_and(|unit| unit.dimension == Dimension::Current);
                let of_current = if role == Role::Force && header.units.iter().any(is_current) {
                    "; a coil's current becomes a force in [actuation], which docs/experiment.md describes"
                } else {
                    ""
                };
                let remedy =
                    format!("say which it is with `{setting} NAME` or its number; {}{of_current}", self.listed());
                Err(Error::input(Place::setting(setting), found, remedy))
            }
        }
    }
}

/// Where the position is 0 and which way it grows, with the reasons.
fn frame(trajectory: &Trajectory, reasons: &mut Vec<String>) -> Frame {
    let Trajectory { force_n, position_m, y_m, .. } = trajectory;
    let coordinates: Vec<&[Option<f64>]> =
        [Some(position_m), y_m.as_ref()].into_iter().flatten().map(Vec::as_slice).collect();
    let range_m = |positions: &[Option<f64>]| {
        let known = || positions.iter().flatten().copied();
        known().fold(f64::NEG_INFINITY, f64::max) - known().fold(f64::INFINITY, f64::min)
    };
    let range_m = coordinates.iter().map(|positions| range_m(positions)).fold(0.0, f64::max);
    let is_far = |place: &[f64]| place.iter().any(|x| x.abs() > NEAR_ZERO * range_m);
    let written = |place: &[f64]| {
        let um: Vec<String> = place.iter().map(|m| format!("{:.3}", 1e6 * m)).collect();
        format!("{} µm", um.join(" and "))
    };
    let rest: Option<Vec<f64>> = coordinates.iter().map(|positions| rest_m(force_n, positions)).collect();
    let first: Option<Vec<f64>> = coordinates.iter().map(|positions| positions.first().copied().flatten()).collect();
    let zero = match (rest, first) {
        (Some(rest), _) if is_far(&rest) => {
            reasons.push(format!(
                "the position is {} before the force acts; what counts as 0 is fitted with the rest, for a few rows would leave their noise in it (zero = \"fit\")",
                written(&rest)
            ));
            Zero::Fit
        }
        (None, Some(first)) if is_far(&first) => {
            reasons.push(format!(
                "the first position is {}; what counts as 0 is fitted with the rest, for one row would leave its noise in it (zero = \"fit\")",
                written(&first)
            ));
            Zero::Fit
        }
        _ => Zero::AsWritten,
    };
    if y_m.is_some() {
        return Frame { zero, direction: Direction::Fit };
    }
    if is_clearly_against(force_n, position_m) {
        reasons.push("the position grows against the force, so that its sign is turned (direction = \"-\")".into());
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
            propose(Path::new("t.csv"), text.as_bytes(), &Given::default(), &mut |_| None).unwrap_err().to_string()
        };
        let rows = "0,1,0\n1,1,2\n2,1,3\n";
        assert!(refused(rows).contains("`time`"));
        assert!(refused(&format!("t,F,x\n{rows}")).contains("unit_time s unit_force uN unit_position um"));
        assert!(refused(&format!("t [s],F [V],x [um]\n{rows}")).contains("`force`"));
        let two = refused("t [s],F [uN],position a [um],position b [um]\n0,1,0,0\n1,1,2,2\n");
        assert!(two.contains("several columns may be the position"), "{two}");
        let counts = refused("frame,F [uN],x (px)\n0,1,0\n1,1,2\n");
        assert!(counts.contains("unit_time \"0.05 s\" unit_position \"0.65 um\"` where a frame"), "{counts}");
        let current = refused("t [s],coil [A],x [um]\n0,1,0\n1,1,2\n");
        assert!(current.contains("[actuation]"), "{current}");
        assert!(refused("nothing\nhere\n").contains("no two columns"));
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
        let proposal = propose(Path::new("t.csv"), text.as_bytes(), &Given::default(), &mut answer).unwrap();
        assert_eq!(asked.len(), 5, "{asked:?}");
        assert_eq!(
            proposal.description.position.unwrap().0,
            PositionColumns::Along(ColumnName::Named("b [um]".into()))
        );
        assert_eq!(proposal.description.force.unwrap().1.name, "uN");
        assert_eq!(proposal.position_m, [0.0, 3e-6]);
    }

    /// A column of remarks without cells, as LabVIEW writes it, and a camera's counts whose sizes are said.
    #[test]
    fn remarks_are_no_column_and_counts_have_sizes() {
        let given = Given { units: ["0.05 s", "uN", "0.65 um"].map(|unit| Some(unit.into())), ..Given::default() };
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
            propose(Path::new("t.csv"), text.as_bytes(), &Given::default(), &mut |_| None).unwrap()
        };
        for header in
            ["t_s,F_uN,x (um),y (um)", "t_s,F_uN,position_x_um,position_y_um", "t_s,F_uN,Pos X [um],Pos Y [um]"]
        {
            let proposal = plane(header);
            assert!(proposal.description.is_plane(), "{header}");
            assert!((proposal.position_m[1] - 10e-6).abs() < 1e-12, "{header}: {:?}", proposal.position_m);
        }
        assert!(!plane("t_s,F_uN,x (um),y (mm)").description.is_plane());
    }
}
