//! Reader of a foreign table according to its description.

use std::borrow::Cow;
use std::path::Path;

use super::description::{BlankForce, ColumnName, TableDescription, TableLayout, TimeFormat};
use super::spelling::{DateOrder, clock_s, date_time_s, hours_minutes_s};
use super::text::{Decimal, Encoding, cells, header_cells, is_blank_or_comment, whole_lines};
use crate::control::Control;
use crate::times::{TimeRows, order_times};
use crate::trajectory::{CYCLE, FORCE, POSITION, TIME, TableRow, Trajectory, is_lost};
use base::error::{Error, InputPlace, Result, Setting};
use base::files::refuse_long_lines;

/// Seconds in a day. A clock that falls back by more than half a day has passed midnight.
const DAY_S: f64 = 86_400.0;

/// Index and name of the column of each quantity in a foreign table.
struct Columns {
    time: (usize, String),
    force: Option<(usize, String)>,
    /// Columns of the position, or of x, y and z.
    positions: Vec<(usize, String)>,
    cycle: Option<(usize, String)>,
    track: Option<(usize, String)>,
}

/// Column names of a table, by which columns are found.
pub struct ColumnNames<'a> {
    file: &'a Path,
    /// Line number and cells of the header; `None` without a header.
    header: Option<(usize, Vec<Cow<'a, str>>)>,
}

impl<'a> ColumnNames<'a> {
    /// Reads the column names from the text of a table. Errors name `file`.
    pub fn new(file: &'a Path, text: &'a str, layout: &TableLayout) -> Self {
        let header = layout.header_line.map(|number| {
            let mut lines = text.lines().skip(number - 1);
            let above: Vec<&str> = lines.by_ref().take(layout.first_row_line.saturating_sub(number)).collect();
            let n_cells = cells(lines.next().unwrap_or_default(), layout.delimiter).len();
            let comment = layout.comment.as_deref();
            let names = match whole_lines(&above, layout.delimiter).into_iter().next() {
                Some((_, Cow::Owned(line))) => {
                    let names = header_cells(&line, layout.delimiter, comment, n_cells);
                    names.into_iter().map(|name| Cow::Owned(name.into_owned())).collect()
                }
                Some((_, Cow::Borrowed(line))) => header_cells(line, layout.delimiter, comment, n_cells),
                None => Vec::new(),
            };
            (number, names)
        });
        Self { file, header }
    }

    /// Names of all columns; empty without a header.
    pub fn all(&self) -> &[Cow<'a, str>] {
        self.header.as_ref().map_or(&[], |(_, cells)| cells)
    }

    /// Returns the index of a column, from 0, and its name for messages.
    ///
    /// # Errors
    /// [`Error::Input`] if no column has the name.
    pub fn place(&self, name: &ColumnName) -> Result<(usize, String)> {
        match (name, &self.header) {
            (ColumnName::Number(number), _) => Ok((*number - 1, format!("column {number}"))),
            (ColumnName::Named(name), Some((line, cells))) => {
                let at = cells.iter().position(|cell| cell == name).ok_or_else(|| {
                    Error::input(
                        InputPlace::file(self.file).at_line(*line).at_key(name.as_str()),
                        format!("the header lacks this column; it has {}", quoted(cells)),
                        "correct the name in [measurement.columns], or give the column's number",
                    )
                })?;
                Ok((at, name.clone()))
            }
            (ColumnName::Named(name), None) => Err(Error::input(
                InputPlace::file(self.file).at_key(name.as_str()),
                "the column is given by name, but the table has no header",
                "give the column's number in [measurement.columns], or `header_line`",
            )),
        }
    }
}

impl Columns {
    fn new(file: &Path, text: &str, description: &TableDescription) -> Result<Self> {
        let names = ColumnNames::new(file, text, &description.layout);
        let place_of = |name: &ColumnName| names.place(name);
        let positions = description.position.iter().flat_map(|(columns, _)| columns.all());
        Ok(Self {
            time: place_of(&description.time.0)?,
            force: description.force.as_ref().map(|(name, _)| place_of(name)).transpose()?,
            positions: positions.map(place_of).collect::<Result<_>>()?,
            cycle: description.cycle.as_ref().map(place_of).transpose()?,
            track: description.track.as_ref().map(|(name, _)| place_of(name)).transpose()?,
        })
    }
}

fn quoted(cells: &[Cow<'_, str>]) -> String {
    let names: Vec<String> = cells.iter().map(|cell| format!("`{cell}`")).collect();
    names.join(", ")
}

/// Decodes the bytes of a table with the given encoding; for `None` the encoding is detected from the bytes. Errors name `file`.
pub fn decode_table<'a>(file: &Path, bytes: &'a [u8], encoding: Option<Encoding>) -> Result<Cow<'a, str>> {
    let encoding = encoding.unwrap_or_else(|| Encoding::of(bytes));
    encoding.text(bytes).ok_or_else(|| {
        let found = format!("the table is not valid {}", encoding.name());
        Error::input(InputPlace::file(file), found, "correct `encoding`, or remove it so that it is detected")
    })
}

/// Parses a table according to its description. The positions in the result are in the table's coordinates. Errors name `file`.
pub(crate) fn read_described(file: &Path, text: &str, description: &TableDescription) -> Result<Trajectory> {
    refuse_long_lines(file, text.as_bytes())?;
    let columns = Columns::new(file, text, description)?;
    let name_of = |column: Option<&(usize, String)>| column.map_or("", |(_, name)| name.as_str()).to_string();
    let mut trajectory = Trajectory::empty(
        columns.cycle.is_some(),
        &name_of(columns.force.as_ref()),
        &name_of(columns.positions.first()),
    );
    trajectory.position_unit_m = description.position.as_ref().map_or(1.0, |(_, unit)| unit.to_si(1.0));
    trajectory.others_m = vec![Vec::new(); columns.positions.len().saturating_sub(1)];
    let layout = &description.layout;
    let comment = layout.comment.as_deref();
    let mut clock = Clock::default();
    // Index of the first row of each table.
    let mut starts: Vec<usize> = Vec::new();
    let mut table = None;
    for (index, line) in text.lines().enumerate().skip(layout.first_row_line - 1) {
        let Some(of_line) = layout.table_of(index + 1) else { continue };
        if is_blank_or_comment(line, comment) {
            continue;
        }
        let place = || InputPlace::file(file).at_line(index + 1);
        let cells = cells(line, layout.delimiter);
        let cell = |(at, name): &(usize, String)| match cells.get(*at) {
            Some(cell) => Ok(cell.as_ref()),
            None => Err(Error::input(
                place().at_key(name.as_str()),
                format!("the row has only {} cells", cells.len()),
                "write every cell of the row; leave the position empty if tracking was lost",
            )),
        };
        if let Some((column, (_, track))) = columns.track.as_ref().zip(description.track.as_ref())
            && cell(column)? != track
        {
            continue;
        }
        // Below the end of one of several samples side by side.
        let mut described = std::iter::once(&columns.time).chain(&columns.force).chain(&columns.positions);
        if described.all(|(at, _)| cells.get(*at).is_some_and(|cell| cell.trim().is_empty())) {
            continue;
        }
        let at = |quantity: usize| {
            let column = match quantity {
                FORCE => columns.force.as_ref(),
                POSITION => columns.positions.first(),
                CYCLE => columns.cycle.as_ref(),
                _ => None,
            };
            place().at_key(column.unwrap_or(&columns.time).1.as_str())
        };
        let time_s = clock.seconds(cell(&columns.time)?, &description.time.1, layout, &|| at(TIME))?;
        let number = |cell: &str, at: &dyn Fn() -> InputPlace, remedy: &dyn Fn() -> String| {
            layout.number(cell).ok_or_else(|| Error::input(at(), not_a_number(cell, layout), remedy()))
        };
        let lacks_position = columns.positions.iter().any(|(at, _)| cells.get(*at).is_some_and(|cell| is_lost(cell)));
        let force_n = match columns.force.as_ref().zip(description.force.as_ref()) {
            Some((column, (_, unit))) => {
                let text = cell(column)?;
                match (is_lost(text), description.blank_force, trajectory.force_n.last()) {
                    (true, Some(BlankForce::LeftOut), _) => continue,
                    // The row tells nothing.
                    (true, Some(BlankForce::Lost), _) if lacks_position => continue,
                    (true, Some(BlankForce::Lost), _) => f64::NAN,
                    (true, Some(BlankForce::Zero), _) => 0.0,
                    (true, Some(BlankForce::Above), Some(above_n)) => *above_n,
                    (true, Some(BlankForce::Above), None) => {
                        let remedy = "give the force of the first row; blank force cells below it then mean this force";
                        return Err(Error::input(at(FORCE), "the first row has no force", remedy));
                    }
                    (true, None, _) => return Err(blank_force(at(FORCE))),
                    (false, ..) => {
                        unit.to_si(number(text, &|| at(FORCE), &|| "correct the commanded force of this row".into())?)
                    }
                }
            }
            None => 0.0,
        };
        let coordinate = |column: &(usize, String)| {
            let text = cell(column)?;
            let Some((_, unit)) = description.position.as_ref().filter(|_| !is_lost(text)) else { return Ok(None) };
            let value = number(text, &|| place().at_key(column.1.as_str()), &|| {
                "correct the position, or leave the cell empty if tracking was lost".into()
            })?;
            Ok((!description.lost.contains(&value)).then(|| unit.to_si(value)))
        };
        let coordinates: Vec<Option<f64>> = columns.positions.iter().map(coordinate).collect::<Result<_>>()?;
        // A row that lacks a coordinate has no position.
        let is_whole = coordinates.iter().all(Option::is_some);
        for (others_m, coordinate) in trajectory.others_m.iter_mut().zip(coordinates.iter().skip(1)) {
            others_m.push(coordinate.filter(|_| is_whole));
        }
        let position_m = coordinates.first().copied().flatten().filter(|_| is_whole);
        let cycle = columns.cycle.as_ref().map(cell).transpose()?;
        let cycle = cycle.map(|text| layout.number(text).map_or(text.into(), |number| Cow::Owned(number.to_string())));
        // A row without a force may have been left out before.
        if table != Some(of_line) {
            (table, _) = (Some(of_line), starts.push(trajectory.time_s.len()));
        }
        trajectory.note_line(file, index + 1)?;
        trajectory.add(TableRow { time_s, force_n, position_m, cycle: cycle.as_deref() }, &at)?;
    }
    if let (Some((_, track)), true) = (&description.track, trajectory.time_s.is_empty()) {
        let remedy = "give one of the table's tracks";
        return Err(Error::input(
            InputPlace::file(file).at_key("track"),
            format!("no row belongs to track `{track}`"),
            remedy,
        ));
    }
    trajectory.check_length(file, layout.first_row_line)?;
    let place = |row: usize| InputPlace::file(file).at_line(trajectory.lines[row]).at_key(columns.time.1.as_str());
    let is_force_measured = description.blank_force == Some(BlankForce::Lost)
        || Control::likely(&trajectory.time_s, &trajectory.force_n, &trajectory.position_m) == Control::Position;
    let rows = TimeRows {
        is_force_measured,
        time_s: &mut trajectory.time_s,
        force_n: &mut trajectory.force_n,
        position_m: &trajectory.position_m,
        acts_until_row: description.acts_until_row,
    };
    trajectory.ordered = order_times(&place, description.time_rules, &starts, rows)?;
    if description.acts_until_row {
        trajectory.act_until_rows();
    }
    trajectory.clock_zero_s = clock.first_s.unwrap_or(0.0);
    Ok(trajectory)
}

fn not_a_number(cell: &str, layout: &TableLayout) -> String {
    let thousands =
        layout.thousands.map_or(String::new(), |sign| format!(" and the thousands separator `{}`", sign.name()));
    let mut text = format!("`{cell}` is not a number with the decimal sign `{}`{thousands}", layout.decimal.name());
    // A sign between groups of three digits may separate thousands.
    let sign = if layout.decimal == Decimal::Comma { '.' } else { ',' };
    let n_digits = |group: &str| group.bytes().take_while(u8::is_ascii_digit).count();
    let mut groups = cell.trim().trim_start_matches(['-', '+']).split(sign);
    let begins = groups.next().is_some_and(|group| (1..=3).contains(&group.len()) && n_digits(group) == group.len());
    let later: Vec<&str> = groups.collect();
    let is_grouped = begins && !later.is_empty() && later.iter().all(|group| n_digits(group) == 3);
    if layout.thousands.is_none() && is_grouped {
        text += &format!(" (if `{sign}` separates thousands, use `{} {sign}`)", Setting::Thousands);
    }
    text
}

fn blank_force(place: InputPlace) -> Error {
    let option = Setting::BlankForce;
    Error::input(
        place,
        "the force cell is blank",
        format!(
            "give its meaning: `{option} above` (in [measurement]: blank_force = \"above\") if the log only contains changes, `{option} zero` if no force acted, `{option} left-out` if it was not measured"
        ),
    )
}

/// Converter of a table's time cells to seconds since the first row.
#[derive(Default)]
struct Clock {
    first_s: Option<f64>,
    last_s: f64,
    days: f64,
    /// Orders of day, month and year with which all dates so far can be read. Each order comes with the time (s) of the first row. `None` unless
    /// the times are dates without a given order.
    orders: Option<Vec<(DateOrder, f64)>>,
}

impl Clock {
    fn seconds(
        &mut self,
        cell: &str,
        format: &TimeFormat,
        layout: &TableLayout,
        place: &dyn Fn() -> InputPlace,
    ) -> Result<f64> {
        let refuse = |what: &str| {
            let remedy = match cell.contains(|c: char| c.is_ascii_digit()) {
                true => "correct the time, or the unit of `time`".into(),
                false => {
                    let comment = layout.comment.as_deref().unwrap_or("#");
                    format!("write the time; if the line is no row, begin it with `{comment}` or delete it")
                }
            };
            Error::input(place(), format!("`{cell}` is {what}"), remedy)
        };
        let since = match format {
            TimeFormat::Unit(unit) => {
                let number = layout.number(cell).ok_or_else(|| refuse("not a number"))?;
                let time_s = unit.to_si(number);
                // If the clock starts before zero, times are shifted so that it starts at 0. A later start stays as recorded.
                let first_s = *self.first_s.get_or_insert(time_s.min(0.0));
                return Ok(time_s - first_s);
            }
            TimeFormat::Clock | TimeFormat::Elapsed | TimeFormat::HoursMinutes => {
                let (time_s, example) = match format {
                    TimeFormat::HoursMinutes => (hours_minutes_s(cell), "10:15"),
                    _ => (clock_s(cell), "10:15:00.25"),
                };
                let time_s = time_s.ok_or_else(|| refuse(&format!("not a time of day such as {example}")))?;
                if time_s < self.last_s - 0.5 * DAY_S {
                    self.days += 1.0;
                }
                self.last_s = time_s;
                if *format == TimeFormat::Elapsed {
                    self.first_s = Some(0.0);
                }
                time_s + DAY_S * self.days
            }
            TimeFormat::Date(Some(order)) => {
                date_time_s(cell, *order).ok_or_else(|| refuse("not a date of this order with a time"))?
            }
            TimeFormat::Date(None) => return self.dated(cell, place),
        };
        Ok(since - *self.first_s.get_or_insert(since))
    }

    /// Returns the seconds since the first row, for a date without a given order of day, month and year. All orders that are still possible must
    /// give equal seconds.
    fn dated(&mut self, cell: &str, place: &dyn Fn() -> InputPlace) -> Result<f64> {
        let refuse = |what: &str, remedy: String| Err(Error::input(place(), format!("`{cell}` {what}"), remedy));
        let read = |order| Some((order, date_time_s(cell, order)?));
        let now: Vec<(DateOrder, f64)> = DateOrder::ALL.into_iter().filter_map(read).collect();
        let firsts = self.orders.get_or_insert_with(|| now.clone());
        firsts.retain(|(order, _)| now.iter().any(|(other, _)| other == order));
        let elapsed_s: Vec<f64> = firsts
            .iter()
            .filter_map(|(order, first_s)| Some(now.iter().find(|(other, _)| other == order)?.1 - first_s))
            .collect();
        match elapsed_s.as_slice() {
            [] => refuse(
                "is not a date with a time such as 2026-11-22T10:15:00.25Z or 22.11.2026 10:15:00",
                "correct the time, or the unit of `time`".into(),
            ),
            [first, others @ ..] if others.iter().any(|other| other != first) => refuse(
                "may begin with the day or with the month, and the resulting times differ",
                format!("give the order with `{0} day-first` or `{0} month-first`", Setting::TimeUnit),
            ),
            [elapsed_s, ..] => {
                // If all orders give equal seconds since the first row, their first times differ only by whole days. Any of them may stand for the
                // first row.
                self.first_s = firsts.first().map(|(_, first_s)| *first_s);
                Ok(*elapsed_s)
            }
        }
    }
}
