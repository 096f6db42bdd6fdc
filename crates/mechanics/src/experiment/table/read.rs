//! Reads a described table.

use std::borrow::Cow;
use std::path::Path;

use super::description::{ColumnName, TableDescription, TimeFormat, Zero};
use super::spelling::{clock_s, iso_s};
use super::text::{cells, header_cells, is_aside};
use crate::error::{Error, Place, Result};
use crate::experiment::record::median;
use crate::experiment::trajectory::{CYCLE, Row, Trajectory, is_lost};
use crate::files::refuse_long_lines;

/// A day; a clock that runs back by more than half of one has passed midnight.
const DAY_S: f64 = 86_400.0;

/// Where each quantity stands in a row.
struct Columns {
    names: [String; 3],
    at: [usize; 3],
    cycle: Option<(usize, String)>,
}

impl Columns {
    fn new(file: &Path, text: &str, description: &TableDescription) -> Result<Self> {
        let header: Option<(usize, Vec<Cow<'_, str>>)> = description.header_line.map(|number| {
            let line = text.lines().nth(number - 1).unwrap_or_default();
            (number, header_cells(line, description.delimiter))
        });
        let place_of = |name: &ColumnName| match (name, &header) {
            (ColumnName::Number(number), _) => Ok((*number - 1, format!("column {number}"))),
            (ColumnName::Named(name), Some((line, cells))) => {
                let at = cells.iter().position(|cell| cell == name).ok_or_else(|| {
                    Error::input(
                        Place::file(file).at_line(*line).at_key(name.as_str()),
                        format!("the header has no such column; it has {}", quoted(cells)),
                        "correct the name in [measurement.columns], or give the column's number",
                    )
                })?;
                Ok((at, name.clone()))
            }
            (ColumnName::Named(name), None) => Err(Error::input(
                Place::file(file).at_key(name.as_str()),
                "a column is named, and the table has no header",
                "give the column's number in [measurement.columns], or `header_line`",
            )),
        };
        let columns = [&description.time.0, &description.force.0, &description.position.0].map(place_of);
        let [time, force, position] = columns;
        let (time, force, position) = (time?, force?, position?);
        Ok(Self {
            at: [time.0, force.0, position.0],
            names: [time.1, force.1, position.1],
            cycle: description.cycle.as_ref().map(place_of).transpose()?,
        })
    }
}

fn quoted(cells: &[Cow<'_, str>]) -> String {
    let names: Vec<String> = cells.iter().map(|cell| format!("`{cell}`")).collect();
    names.join(", ")
}

/// Parses a described table; `file` is only named in errors.
pub(in crate::experiment) fn read_described(
    file: &Path,
    text: &str,
    description: &TableDescription,
) -> Result<Trajectory> {
    refuse_long_lines(file, text.as_bytes())?;
    let columns = Columns::new(file, text, description)?;
    let mut trajectory = Trajectory::empty(columns.cycle.is_some(), &columns.names[1], &columns.names[2]);
    let mut clock = Clock::default();
    let rows = text.lines().enumerate().skip(description.first_row_line - 1);
    for (index, line) in rows.filter(|(_, line)| !is_aside(line)) {
        let place = || Place::file(file).at_line(index + 1);
        let cells = cells(line, description.delimiter);
        let cell = |at: usize, name: &str| match cells.get(at) {
            Some(cell) => Ok(cell.as_ref()),
            None => Err(Error::input(
                place().at_key(name),
                format!("the row ends after {} cells", cells.len()),
                "give every row all of its cells; leave the position empty where tracking was lost",
            )),
        };
        let [time, force, position] = [0, 1, 2].map(|k| cell(columns.at[k], &columns.names[k]));
        let (time, force, position) = (time?, force?, position?);
        let at = |k: usize| match &columns.cycle {
            Some((_, name)) if k == CYCLE => place().at_key(name.as_str()),
            _ => place().at_key(columns.names[k.min(2)].as_str()),
        };
        let time_s = clock.seconds(time, &description.time.1, description, &|| at(0))?;
        let number = |cell: &str, k: usize, remedy: &str| {
            description.decimal.number(cell).ok_or_else(|| {
                Error::input(
                    at(k),
                    format!("`{cell}` is not a number with `{}` before its decimals", description.decimal.name()),
                    remedy,
                )
            })
        };
        let force_n = description.force.1.to_si(number(
            force,
            1,
            "give the force that was commanded in this row; 0 if none was",
        )?);
        let position_m = if is_lost(position) {
            None
        } else {
            let remedy = "correct the position, or leave the cell empty where tracking was lost";
            Some(description.position.1.to_si(number(position, 2, remedy)?))
        };
        let cycle = columns.cycle.as_ref().map(|(index, name)| cell(*index, name)).transpose()?;
        trajectory.note_line(file, index + 1)?;
        trajectory.add(Row { time_s, force_n, position_m, cycle }, &at)?;
    }
    trajectory.check_length(file, description.first_row_line)?;
    settle_zero(file, &mut trajectory, description)?;
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
    fn seconds(
        &mut self,
        cell: &str,
        format: &TimeFormat,
        description: &TableDescription,
        place: &dyn Fn() -> Place,
    ) -> Result<f64> {
        let refuse = |what: &str| {
            Error::input(
                place(),
                format!("`{cell}` is {what}"),
                "correct the time, or `time_unit` in [measurement.columns]",
            )
        };
        let since = match format {
            TimeFormat::Unit(unit) => {
                let number = description.decimal.number(cell).ok_or_else(|| refuse("not a number"))?;
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

/// Median position (m) before the force first acts, as written; `None` where it acts from the first row on.
pub(super) fn rest_m(trajectory: &Trajectory) -> Option<f64> {
    let n_rest = trajectory.force_n.iter().take_while(|force| **force == 0.0).count();
    // The first row of the force still shows what was before it.
    let rest = trajectory.position_m.iter().take(n_rest + 1).copied().flatten().collect();
    median(rest).filter(|_| n_rest > 0)
}

/// Positions, as written so far, from where they are 0, in the force's direction.
pub(super) fn settle_zero(file: &Path, trajectory: &mut Trajectory, description: &TableDescription) -> Result<()> {
    let refuse = |found: &str, remedy: &str| {
        Err(Error::input(Place::file(file).at_line(description.first_row_line).at_key("zero"), found, remedy))
    };
    let zero_m = match description.zero {
        Zero::AsWritten | Zero::Fit => 0.0,
        Zero::Value(value) => description.position.1.to_si(value),
        Zero::First => match trajectory.position_m.first().copied().flatten() {
            Some(first_m) => first_m,
            None => return refuse("the first row has no position", "write `zero = \"rest\"` or the position itself"),
        },
        Zero::Rest => match rest_m(trajectory) {
            Some(rest_m) => rest_m,
            None => {
                let remedy = "write `zero = \"first\"` or the position itself";
                return refuse("there is no row before the force acts", remedy);
            }
        },
    };
    let sign = if description.is_reversed { -1.0 } else { 1.0 };
    trajectory.position_m.iter_mut().flatten().for_each(|x| *x = sign * (*x - zero_m));
    Ok(())
}
