//! How a table of another maker is written: what `[measurement]` says of it beside its name (formats §1).

use super::spelling::{Spelt, unit};
use super::text::{Decimal, Delimiter};
use crate::error::Result;
use crate::toml_input::Table;
use crate::units::Dimension;

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

/// Which position counts as 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Zero {
    /// The one that the table has for 0.
    AsWritten,
    /// The first.
    First,
    /// The median of those before the force first acts.
    Rest,
    /// None is known: it is fitted.
    Fit,
    /// This one, in the column's unit.
    Value(f64),
}

/// A table of force and position against time.
#[derive(Debug, Clone, PartialEq)]
pub struct TableDescription {
    /// Between cells.
    pub delimiter: Delimiter,
    /// Before decimals.
    pub decimal: Decimal,
    /// Line of the header, from 1; `None` where there is none.
    pub header_line: Option<usize>,
    /// Line of the first row, from 1.
    pub first_row_line: usize,
    /// Times.
    pub time: (ColumnName, TimeFormat),
    /// Forces.
    pub force: (ColumnName, Spelt),
    /// Positions.
    pub position: (ColumnName, Spelt),
    /// Cycles; found from the force where there is no such column.
    pub cycle: Option<ColumnName>,
    /// Which position is 0.
    pub zero: Zero,
    /// Whether positions grow against the force's direction.
    pub is_reversed: bool,
}

/// Keys of `[measurement]` that describe a table.
pub(in crate::experiment) const KEYS: [&str; 7] =
    ["columns", "delimiter", "decimal", "header_line", "first_row_line", "zero", "direction"];

const EXAMPLE: &str = "position = \"x [µm]\"";

impl TableDescription {
    /// What `[measurement]` says; `None` where it has no `[measurement.columns]`: then the table is one of the program's own form.
    pub(in crate::experiment) fn read(measurement: Table<'_>) -> Result<Option<Self>> {
        let Some(columns) = measurement.table("columns")? else {
            // An offset that is fitted describes the measurement, not the table.
            let is_of_table = |key: &&&str| measurement.has(key) && !(**key == "zero" && fits_offset(measurement));
            return match KEYS.iter().find(is_of_table) {
                None => Ok(None),
                Some(key) => Err(measurement.refuse(
                    key,
                    "this describes a table whose columns are not described",
                    "add [measurement.columns] with `time`, `force` and `position`, or let `vitreo-uq init FILE` write it",
                )),
            };
        };
        columns.only(&["time", "time_unit", "force", "force_unit", "position", "position_unit", "cycle"])?;
        let delimiter = one_of(measurement, "delimiter", &Delimiter::ALL, Delimiter::name)?.unwrap_or(Delimiter::Comma);
        let decimal = one_of(measurement, "decimal", &Decimal::ALL, Decimal::name)?.unwrap_or(Decimal::Point);
        if delimiter == Delimiter::Comma && decimal == Decimal::Comma {
            let remedy = "one of `delimiter` and `decimal` must be another sign";
            return Err(measurement.refuse("decimal", "commas stand between cells and before decimals", remedy));
        }
        let header_line = line(measurement, "header_line")?;
        let first_row_line = line(measurement, "first_row_line")?;
        let header_line = if header_line.is_none() && first_row_line.is_none() { Some(1) } else { header_line };
        let force = (column(columns, "force")?, dimensioned(columns, "force_unit", Dimension::Force)?);
        let position = (column(columns, "position")?, dimensioned(columns, "position_unit", Dimension::Length)?);
        let format = match columns.required_text("time_unit", "time_unit = \"s\"")?.as_str() {
            "clock" => TimeFormat::Clock,
            "iso" => TimeFormat::Iso,
            _ => TimeFormat::Unit(dimensioned(columns, "time_unit", Dimension::Time)?),
        };
        let description = Self {
            delimiter,
            decimal,
            header_line,
            first_row_line: first_row_line.unwrap_or(header_line.map_or(1, |line| line + 1)),
            time: (column(columns, "time")?, format),
            force,
            position,
            cycle: if columns.has("cycle") { Some(column(columns, "cycle")?) } else { None },
            zero: zero(measurement)?,
            is_reversed: one_of(measurement, "direction", &[false, true], |reversed| if reversed { "-" } else { "+" })?
                .unwrap_or(false),
        };
        if description.header_line.is_some_and(|header| header >= description.first_row_line) {
            let remedy = "the header stands above the first row";
            return Err(measurement.refuse("header_line", "the header stands below the first row", remedy));
        }
        Ok(Some(description))
    }
}

/// One of a few words.
pub(in crate::experiment) fn one_of<T: Copy>(
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

fn column(columns: Table<'_>, key: &str) -> Result<ColumnName> {
    if !columns.has(key) {
        return Err(columns.missing(key, &EXAMPLE.replace("position", key)));
    }
    if columns.is_number(key) {
        return line(columns, key).map(|number| ColumnName::Number(number.unwrap_or(1)));
    }
    columns.required_text(key, EXAMPLE).map(ColumnName::Named)
}

fn dimensioned(columns: Table<'_>, key: &str, dimension: Dimension) -> Result<Spelt> {
    let example = match dimension {
        Dimension::Time => "time_unit = \"s\"",
        Dimension::Force => "force_unit = \"uN\"",
        Dimension::Length => "position_unit = \"um\"",
    };
    let text = columns.required_text(key, example)?;
    unit(&text).filter(|unit| unit.dimension == dimension).ok_or_else(|| {
        let known = dimension.accepted_suffixes().replace('_', "");
        let others = if dimension == Dimension::Time { ", min, h, clock (hh:mm:ss), iso" } else { "" };
        columns.refuse(key, format!("`{text}` is no unit of this"), format!("write one of {known}{others}"))
    })
}

/// Whether where the position is 0 is to be fitted.
pub(in crate::experiment) fn fits_offset(measurement: Table<'_>) -> bool {
    measurement.text("zero").is_ok_and(|zero| zero.as_deref() == Some("fit"))
}

fn zero(measurement: Table<'_>) -> Result<Zero> {
    if !measurement.has("zero") {
        return Ok(Zero::AsWritten);
    }
    if measurement.is_number("zero") {
        return Ok(measurement.number("zero")?.map_or(Zero::AsWritten, Zero::Value));
    }
    match measurement.required_text("zero", "zero = \"first\"")?.as_str() {
        "first" => Ok(Zero::First),
        "rest" => Ok(Zero::Rest),
        "fit" => Ok(Zero::Fit),
        other => Err(measurement.refuse(
            "zero",
            format!("unknown zero `{other}`"),
            "write \"first\", \"rest\" (the positions before the force acts), \"fit\" or the position itself",
        )),
    }
}
