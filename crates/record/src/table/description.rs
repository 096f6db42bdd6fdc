//! How a table of another maker is written: what `[measurement]` says of it beside its name (formats §1).

use super::spelling::{Spelt, split_unit, unit};
use super::text::{Decimal, Delimiter, Encoding};
use base::error::Result;
use base::toml_input::Table;
use base::units::Dimension;

/// A column, by its name or by its number from 1.
#[derive(Debug, Clone, PartialEq)]
pub enum ColumnName {
    /// As it stands in the header.
    Named(String),
    /// Counted from 1.
    Number(usize),
}

/// How times are written.
#[derive(Debug, Clone, PartialEq)]
pub enum TimeFormat {
    /// Numbers in a unit.
    Unit(Spelt),
    /// `hh:mm:ss`, counted from the first row; past midnight it goes on.
    Clock,
    /// ISO 8601, counted from the first row.
    Iso,
}

/// Where the position stands.
#[derive(Debug, Clone, PartialEq)]
pub enum PositionColumns {
    /// In one column, along the force.
    Along(ColumnName),
    /// In two, x and y.
    Plane([ColumnName; 2]),
}

impl PositionColumns {
    /// The columns, x first.
    pub fn all(&self) -> &[ColumnName] {
        match self {
            Self::Along(column) => std::slice::from_ref(column),
            Self::Plane(columns) => columns,
        }
    }
}

/// How the text of a table is laid out.
#[derive(Debug, Clone, PartialEq)]
pub struct TableLayout {
    /// Between cells.
    pub delimiter: Delimiter,
    /// Before decimals.
    pub decimal: Decimal,
    /// Letters as bytes; `None`: as the bytes show.
    pub encoding: Option<Encoding>,
    /// The sign that makes a line a comment; `None`: `#`, `%` and `//`.
    pub comment: Option<String>,
    /// Line of the header, from 1; `None` where there is none.
    pub header_line: Option<usize>,
    /// Line of the first row, from 1.
    pub first_row_line: usize,
}

/// A table of force and position against time.
#[derive(Debug, Clone, PartialEq)]
pub struct TableDescription {
    /// Lines, cells and letters.
    pub layout: TableLayout,
    /// Times.
    pub time: (ColumnName, TimeFormat),
    /// Forces, or currents that make them; `None` in a table whose force is logged in another.
    pub force: Option<(ColumnName, Spelt)>,
    /// Positions; `None` in a log of the force.
    pub position: Option<(PositionColumns, Spelt)>,
    /// Cycles; found from the force where there is no such column.
    pub cycle: Option<ColumnName>,
}

/// Keys of `[measurement]` and `[actuation]` that describe a table of another form than the program's own.
pub(crate) const KEYS: [&str; 8] =
    ["columns", "units", "delimiter", "decimal", "encoding", "comment", "header_line", "first_row_line"];

const EXAMPLE: &str = "position = \"x [µm]\"";

impl TableDescription {
    /// What `[measurement]` says; `None` where it has no `[measurement.columns]`: then the table is one of the program's own form. `is_driven_elsewhere` where
    /// `[actuation]` has the force.
    pub fn read(measurement: Table<'_>, is_driven_elsewhere: bool) -> Result<Option<Self>> {
        let Some(columns) = measurement.table("columns")? else {
            return match KEYS.iter().find(|key| measurement.has(key)) {
                None => Ok(None),
                Some(key) => Err(measurement.refuse(
                    key,
                    "this describes a table whose columns are not described",
                    "add [measurement.columns] with `time`, `force` and `position`, or let `vitreo-uq init FILE` write it",
                )),
            };
        };
        columns.only(&["time", "force", "position", "position_x", "position_y", "cycle"])?;
        let units = Units::read(measurement, &["time", "force", "position"])?;
        if is_driven_elsewhere && columns.has("force") {
            let remedy = "remove one of them";
            return Err(columns.refuse("force", "the force stands here and in [actuation]", remedy));
        }
        let force = if is_driven_elsewhere { None } else { Some(units.column(columns, "force", Dimension::Force)?) };
        let position = position_columns(columns)?;
        let position = Some((position.clone(), units.of("position", Dimension::Length, &position.all()[0])?));
        let cycle = if columns.has("cycle") { Some(column(columns, "cycle")?) } else { None };
        Ok(Some(Self { force, position, cycle, ..Self::of_times(measurement, columns, &units)? }))
    }

    /// What `[actuation]` says of its log.
    pub(crate) fn read_log(actuation: Table<'_>) -> Result<Self> {
        let columns = actuation.required_table("columns")?;
        columns.only(&["time", "force", "current"])?;
        let units = Units::read(actuation, &["time", "force", "current"])?;
        let force = if columns.has("current") {
            if columns.has("force") {
                return Err(columns.refuse("force", "the log has a force and a current", "name one of them"));
            }
            units.column(columns, "current", Dimension::Current)?
        } else {
            units.column(columns, "force", Dimension::Force)?
        };
        Ok(Self { force: Some(force), ..Self::of_times(actuation, columns, &units)? })
    }

    /// The layout and the times alone.
    fn of_times(measurement: Table<'_>, columns: Table<'_>, units: &Units<'_>) -> Result<Self> {
        let time = column(columns, "time")?;
        let format = match units.text("time")?.as_deref() {
            Some("clock") => TimeFormat::Clock,
            Some("iso") => TimeFormat::Iso,
            _ => TimeFormat::Unit(units.of("time", Dimension::Time, &time)?),
        };
        let layout = TableLayout::read(measurement)?;
        Ok(Self { layout, force: None, position: None, time: (time, format), cycle: None })
    }

    /// Whether positions are x and y.
    pub fn is_plane(&self) -> bool {
        matches!(self.position, Some((PositionColumns::Plane(_), _)))
    }
}

impl TableLayout {
    /// What the keys beside the columns say.
    pub fn read(measurement: Table<'_>) -> Result<Self> {
        let delimiter = one_of(measurement, "delimiter", &Delimiter::ALL, Delimiter::name)?.unwrap_or(Delimiter::Comma);
        let decimal = one_of(measurement, "decimal", &Decimal::ALL, Decimal::name)?.unwrap_or(Decimal::Point);
        if delimiter == Delimiter::Comma && decimal == Decimal::Comma {
            let remedy = "one of `delimiter` and `decimal` must be another sign";
            return Err(measurement.refuse("decimal", "commas stand between cells and before decimals", remedy));
        }
        let header_line = line(measurement, "header_line")?;
        let first_row_line = line(measurement, "first_row_line")?;
        let header_line = if header_line.is_none() && first_row_line.is_none() { Some(1) } else { header_line };
        let layout = Self {
            delimiter,
            decimal,
            encoding: one_of(measurement, "encoding", &Encoding::ALL, Encoding::name)?,
            comment: measurement.text("comment")?,
            header_line,
            first_row_line: first_row_line.unwrap_or(header_line.map_or(1, |line| line + 1)),
        };
        if layout.header_line.is_some_and(|header| header >= layout.first_row_line) {
            let remedy = "the header stands above the first row";
            return Err(measurement.refuse("header_line", "the header stands below the first row", remedy));
        }
        Ok(layout)
    }
}

/// One of a few words.
pub(crate) fn one_of<T: Copy>(
    table: Table<'_>,
    key: &str,
    all: &[T],
    name: fn(T) -> &'static str,
) -> Result<Option<T>> {
    let Some(text) = table.text(key)? else { return Ok(None) };
    match all.iter().find(|one| name(**one) == text) {
        Some(one) => Ok(Some(*one)),
        None => {
            let names: Vec<String> = all.iter().map(|one| format!("\"{}\"", name(*one))).collect();
            Err(table.refuse(key, format!("unknown {key} `{text}`"), format!("write one of {}", names.join(", "))))
        }
    }
}

fn line(table: Table<'_>, key: &str) -> Result<Option<usize>> {
    let Some(number) = table.number(key)? else { return Ok(None) };
    if number >= 1.0 && number.fract() == 0.0 && number < 1e9 {
        return Ok(Some(number as usize));
    }
    Err(table.refuse(key, format!("{number} is no line of a file"), format!("count lines from 1, as in `{key} = 1`")))
}

pub(crate) fn column(columns: Table<'_>, key: &str) -> Result<ColumnName> {
    if !columns.has(key) {
        return Err(columns.missing(key, &EXAMPLE.replace("position", key)));
    }
    if columns.is_number(key) {
        return line(columns, key).map(|number| ColumnName::Number(number.unwrap_or(1)));
    }
    columns.required_text(key, EXAMPLE).map(ColumnName::Named)
}

fn position_columns(columns: Table<'_>) -> Result<PositionColumns> {
    let is_plane = columns.has("position_x") || columns.has("position_y");
    if !is_plane {
        return column(columns, "position").map(PositionColumns::Along);
    }
    if columns.has("position") {
        let remedy = "keep `position`, or `position_x` with `position_y`";
        return Err(columns.refuse("position", "the position is named twice", remedy));
    }
    Ok(PositionColumns::Plane([column(columns, "position_x")?, column(columns, "position_y")?]))
}

/// `[measurement.units]`; a column whose name ends in its unit needs none there.
pub(crate) struct Units<'a> {
    measurement: Table<'a>,
    table: Option<Table<'a>>,
}

impl<'a> Units<'a> {
    pub fn read(measurement: Table<'a>, keys: &[&str]) -> Result<Self> {
        let table = measurement.table("units")?;
        table.map_or(Ok(()), |table| table.only(keys))?;
        Ok(Self { measurement, table })
    }

    /// A column with its unit.
    fn column(&self, columns: Table<'_>, key: &str, dimension: Dimension) -> Result<(ColumnName, Spelt)> {
        let name = column(columns, key)?;
        let unit = self.of(key, dimension, &name)?;
        Ok((name, unit))
    }

    fn text(&self, key: &str) -> Result<Option<String>> {
        self.table.map_or(Ok(None), |table| table.text(key))
    }

    pub fn of(&self, key: &str, dimension: Dimension, column: &ColumnName) -> Result<Spelt> {
        let Some((table, text)) = self.table.zip(self.text(key)?) else {
            let by_name = match column {
                ColumnName::Named(name) => split_unit(name).1,
                ColumnName::Number(_) => None,
            };
            let example = match dimension {
                Dimension::Time => "time = \"s\"",
                Dimension::Force => "force = \"uN\"",
                Dimension::Length => "position = \"um\"",
                Dimension::Current => "current = \"A\"",
                Dimension::Frequency => "frequency = \"Hz\"",
                Dimension::Pressure => "storage = \"Pa\"",
                Dimension::Angle => "phase = \"deg\"",
                Dimension::Ratio => "strain = \"%\"",
            };
            return by_name.filter(|unit| unit.dimension == dimension).ok_or_else(|| match self.table {
                Some(table) => table.missing(key, example),
                None => self.measurement.missing("units", &format!("units = {{ {example} }}")),
            });
        };
        unit(&text).filter(|unit| unit.dimension == dimension).ok_or_else(|| {
            let known = dimension.accepted_suffixes().replace('_', "");
            let others = match dimension {
                Dimension::Time => ", min, h, clock (hh:mm:ss), iso",
                Dimension::Frequency => ", rad/s",
                Dimension::Pressure => ", kPa, MPa",
                Dimension::Angle => ", deg",
                _ => "",
            };
            table.refuse(key, format!("`{text}` is no unit of this"), format!("write one of {known}{others}"))
        })
    }
}
