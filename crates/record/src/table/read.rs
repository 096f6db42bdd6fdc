//! Reads a described table.

use std::borrow::Cow;
use std::path::Path;

use super::description::{ColumnName, PositionColumns, TableDescription, TableLayout, TimeFormat};
use super::spelling::{clock_s, iso_s};
use super::text::{Decimal, Encoding, cells, header_cells, is_aside};
use crate::trajectory::{Row, Trajectory, is_lost};
use base::error::{Error, Place, Result};
use base::files::refuse_long_lines;

/// A day; a clock that runs back by more than half of one has passed midnight.
const DAY_S: f64 = 86_400.0;

/// Where each quantity stands in a row.
struct Columns {
    time: (usize, String),
    force: Option<(usize, String)>,
    position: Option<(usize, String)>,
    y: Option<(usize, String)>,
    cycle: Option<(usize, String)>,
}

/// The columns of a table by their names, where it has a header.
pub struct ColumnNames<'a> {
    file: &'a Path,
    /// The header's line and its cells.
    header: Option<(usize, Vec<Cow<'a, str>>)>,
}

impl<'a> ColumnNames<'a> {
    /// Those of a text; `file` is only named in errors.
    pub fn new(file: &'a Path, text: &'a str, layout: &TableLayout) -> Self {
        let header = layout.header_line.map(|number| {
            let mut lines = text.lines().skip(number - 1);
            let line = lines.next().unwrap_or_default();
            let row = lines.nth((layout.first_row_line - number).saturating_sub(1)).unwrap_or_default();
            let n_cells = cells(row, layout.delimiter).len();
            (number, header_cells(line, layout.delimiter, layout.comment.as_deref(), n_cells))
        });
        Self { file, header }
    }

    /// The names, empty where there is no header.
    pub fn all(&self) -> &[Cow<'a, str>] {
        self.header.as_ref().map_or(&[], |(_, cells)| cells)
    }

    /// Place of a column from 0, and what messages call it.
    ///
    /// # Errors
    /// [`Error::Input`] where no column has the name.
    pub fn place(&self, name: &ColumnName) -> Result<(usize, String)> {
        match (name, &self.header) {
            (ColumnName::Number(number), _) => Ok((*number - 1, format!("column {number}"))),
            (ColumnName::Named(name), Some((line, cells))) => {
                let at = cells.iter().position(|cell| cell == name).ok_or_else(|| {
                    Error::input(
                        Place::file(self.file).at_line(*line).at_key(name.as_str()),
                        format!("the header has no such column; it has {}", quoted(cells)),
                        "correct the name in [measurement.columns], or give the column's number",
                    )
                })?;
                Ok((at, name.clone()))
            }
            (ColumnName::Named(name), None) => Err(Error::input(
                Place::file(self.file).at_key(name.as_str()),
                "a column is named, and the table has no header",
                "give the column's number in [measurement.columns], or `header_line`",
            )),
        }
    }
}

impl Columns {
    fn new(file: &Path, text: &str, description: &TableDescription) -> Result<Self> {
        let names = ColumnNames::new(file, text, &description.layout);
        let place_of = |name: &ColumnName| names.place(name);
        let (x, y) = match description.position.as_ref().map(|(columns, _)| columns) {
            Some(PositionColumns::Along(column)) => (Some(column), None),
            Some(PositionColumns::Plane([x, y])) => (Some(x), Some(y)),
            None => (None, None),
        };
        Ok(Self {
            time: place_of(&description.time.0)?,
            force: description.force.as_ref().map(|(name, _)| place_of(name)).transpose()?,
            position: x.map(place_of).transpose()?,
            y: y.map(place_of).transpose()?,
            cycle: description.cycle.as_ref().map(place_of).transpose()?,
        })
    }
}

fn quoted(cells: &[Cow<'_, str>]) -> String {
    let names: Vec<String> = cells.iter().map(|cell| format!("`{cell}`")).collect();
    names.join(", ")
}

/// The text of a table, in its encoding or in the one that its bytes show.
pub fn text_in<'a>(file: &Path, bytes: &'a [u8], encoding: Option<Encoding>) -> Result<Cow<'a, str>> {
    let encoding = encoding.unwrap_or_else(|| Encoding::of(bytes));
    encoding.text(bytes).ok_or_else(|| {
        let found = format!("the table is not written in {}", encoding.name());
        Error::input(Place::file(file), found, "correct `encoding`, or leave it out so that it is found")
    })
}

/// Parses a described table, positions as they are written; `file` is only named in errors.
pub(crate) fn read_described(file: &Path, text: &str, description: &TableDescription) -> Result<Trajectory> {
    refuse_long_lines(file, text.as_bytes())?;
    let columns = Columns::new(file, text, description)?;
    let name_of = |column: &Option<(usize, String)>| column.as_ref().map_or("", |(_, name)| name.as_str()).to_string();
    let mut trajectory =
        Trajectory::empty(columns.cycle.is_some(), &name_of(&columns.force), &name_of(&columns.position));
    trajectory.position_unit_m = description.position.as_ref().map_or(1.0, |(_, unit)| unit.to_si(1.0));
    let mut y_m = columns.y.is_some().then(Vec::new);
    let layout = &description.layout;
    let comment = layout.comment.as_deref();
    let mut clock = Clock::default();
    let rows = text.lines().enumerate().skip(layout.first_row_line - 1);
    for (index, line) in rows.filter(|(_, line)| !is_aside(line, comment)) {
        let place = || Place::file(file).at_line(index + 1);
        let cells = cells(line, layout.delimiter);
        let cell = |at: usize, name: &str| match cells.get(at) {
            Some(cell) => Ok(cell.as_ref()),
            None => Err(Error::input(
                place().at_key(name),
                format!("the row ends after {} cells", cells.len()),
                "give every row all of its cells; leave the position empty where tracking was lost",
            )),
        };
        let quantities = [None, columns.force.as_ref(), columns.position.as_ref(), columns.cycle.as_ref()];
        let at = |k: usize| {
            let (_, name) = quantities.get(k).copied().flatten().unwrap_or(&columns.time);
            place().at_key(name.as_str())
        };
        let time = cell(columns.time.0, &columns.time.1)?;
        let time_s = clock.seconds(time, &description.time.1, layout.decimal, &|| at(0))?;
        let number = |cell: &str, at: &dyn Fn() -> Place, remedy: &str| {
            layout.decimal.number(cell).ok_or_else(|| {
                Error::input(
                    at(),
                    format!("`{cell}` is not a number with `{}` before its decimals", layout.decimal.name()),
                    remedy,
                )
            })
        };
        let force_n = match columns.force.as_ref().zip(description.force.as_ref()) {
            Some(((index, name), (_, unit))) => {
                let remedy = "give the force that was commanded in this row; 0 if none was";
                unit.to_si(number(cell(*index, name)?, &|| at(1), remedy)?)
            }
            None => 0.0,
        };
        let coordinate = |cell: &str, at: &dyn Fn() -> Place| match &description.position {
            Some((_, unit)) if !is_lost(cell) => {
                let remedy = "correct the position, or leave the cell empty where tracking was lost";
                Ok(Some(unit.to_si(number(cell, at, remedy)?)))
            }
            _ => Ok(None),
        };
        let mut position_m = match &columns.position {
            Some((index, name)) => coordinate(cell(*index, name)?, &|| at(2))?,
            None => None,
        };
        if let (Some((index, name)), Some(y_m)) = (&columns.y, &mut y_m) {
            let y = coordinate(cell(*index, name)?, &|| place().at_key(name.as_str()))?;
            // A point that misses one coordinate is lost.
            position_m = y.and(position_m);
            y_m.push(position_m.and(y));
        }
        let cycle = columns.cycle.as_ref().map(|(index, name)| cell(*index, name)).transpose()?;
        trajectory.note_line(file, index + 1)?;
        trajectory.add(Row { time_s, force_n, position_m, cycle }, &at)?;
    }
    trajectory.check_length(file, layout.first_row_line)?;
    trajectory.y_m = y_m;
    trajectory.clock_zero_s = clock.first_s.unwrap_or(0.0);
    Ok(trajectory)
}

/// Times that are counted from the first row.
#[derive(Default)]
struct Clock {
    first_s: Option<f64>,
    last_s: f64,
    days: f64,
}

impl Clock {
    fn seconds(&mut self, cell: &str, format: &TimeFormat, decimal: Decimal, place: &dyn Fn() -> Place) -> Result<f64> {
        let refuse = |what: &str| {
            Error::input(place(), format!("`{cell}` is {what}"), "correct the time, or `time` in [measurement.units]")
        };
        let since = match format {
            TimeFormat::Unit(unit) => {
                let number = decimal.number(cell).ok_or_else(|| refuse("not a number"))?;
                let time_s = unit.to_si(number);
                // A clock that starts before zero is shifted; one that starts later is a record's own affair.
                let first_s = *self.first_s.get_or_insert(time_s.min(0.0));
                return Ok(time_s - first_s);
            }
            TimeFormat::Clock => {
                let time_s = clock_s(cell).ok_or_else(|| refuse("no time of day such as 10:15:00.25"))?;
                if time_s < self.last_s - 0.5 * DAY_S {
                    self.days += 1.0;
                }
                self.last_s = time_s;
                time_s + DAY_S * self.days
            }
            TimeFormat::Iso => iso_s(cell).ok_or_else(|| refuse("no ISO time such as 2026-11-22T10:15:00.25Z"))?,
        };
        Ok(since - *self.first_s.get_or_insert(since))
    }
}
