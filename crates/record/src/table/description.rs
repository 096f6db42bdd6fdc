//! Description of a foreign table: the keys of `[measurement]` other than the file name (formats §1).

use super::spelling::{DateOrder, ParsedUnit, split_unit, unit};
use super::text::{Decimal, Delimiter, Encoding, Thousands};
use crate::control::Control;
use crate::times::TimeRules;
use base::error::Result;
use base::toml_input::TomlTable;
use base::units::Dimension;

/// Reference to a column of a table, by its name or by its number from 1.
#[derive(Debug, Clone, PartialEq)]
pub enum ColumnName {
    /// Name of the column in the header.
    Named(String),
    /// Number of the column, counted from 1.
    Number(usize),
}

impl std::fmt::Display for ColumnName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Named(name) => f.write_str(name),
            Self::Number(number) => write!(f, "column {number}"),
        }
    }
}

/// Format of the times in a table.
#[derive(Debug, Clone, PartialEq)]
pub enum TimeFormat {
    /// Numbers in the given unit.
    Unit(ParsedUnit),
    /// Times of day `hh:mm:ss`, which count from the first row and continue past midnight.
    Clock,
    /// Elapsed times `mm:ss` or `hh:mm:ss`, which count from 0.
    Elapsed,
    /// Times of day `hh:mm`, which count as `Clock`.
    HoursMinutes,
    /// Dates with a time, which count from the first row, in the given order of day, month and year. `None` if the dates themselves must show the
    /// order.
    Date(Option<DateOrder>),
}

impl TimeFormat {
    /// Returns the format for one of the words `clock`, `elapsed`, `mm:ss`, `hh:mm`, `iso`, `day-first` and `month-first`; `None` for another word.
    pub fn named(word: &str) -> Option<Self> {
        Some(match word {
            "clock" => Self::Clock,
            "elapsed" | "mm:ss" => Self::Elapsed,
            "hh:mm" => Self::HoursMinutes,
            "iso" => Self::Date(None),
            "day-first" => Self::Date(Some(DateOrder::Day)),
            "month-first" => Self::Date(Some(DateOrder::Month)),
            _ => return None,
        })
    }

    /// True for times of day: their first row is no event of the test.
    pub fn is_of_day(&self) -> bool {
        matches!(self, Self::Clock | Self::HoursMinutes | Self::Date(_))
    }

    /// Word for the format in `experiment.toml`: the name of the unit, `clock`, `elapsed`, `hh:mm`, `iso`, `day-first` or `month-first`.
    pub fn name(&self) -> &str {
        match self {
            Self::Unit(unit) => &unit.name,
            Self::Clock => "clock",
            Self::Elapsed => "elapsed",
            Self::HoursMinutes => "hh:mm",
            Self::Date(None | Some(DateOrder::Year)) => "iso",
            Self::Date(Some(DateOrder::Day)) => "day-first",
            Self::Date(Some(DateOrder::Month)) => "month-first",
        }
    }
}

/// Rule for the force of a row whose force cell is blank.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BlankForce {
    /// The force of the row above applies, because the log only contains changes.
    Above,
    /// The force is zero.
    Zero,
    /// The row is left out, because its force was not measured.
    LeftOut,
    /// The force of a relaxation was not measured in this row, whose commanded position counts. The force is NaN.
    Lost,
}

impl BlankForce {
    /// The rules for blank force cells that can be chosen.
    pub const ALL: [Self; 3] = [Self::Above, Self::Zero, Self::LeftOut];

    /// Name of the rule in `experiment.toml`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Above => "above",
            Self::Zero => "zero",
            Self::LeftOut | Self::Lost => "left-out",
        }
    }
}

/// Columns that contain the position or its coordinates.
#[derive(Debug, Clone, PartialEq)]
pub enum PositionColumns {
    /// A single column with the position along the force.
    Along(ColumnName),
    /// Two or three columns with the coordinates x, y and z.
    Axes(Vec<ColumnName>),
}

impl PositionColumns {
    /// All position columns, in the order x, y, z.
    pub fn all(&self) -> &[ColumnName] {
        match self {
            Self::Along(column) => std::slice::from_ref(column),
            Self::Axes(columns) => columns,
        }
    }
}

/// Layout of a table's text: delimiter, decimal sign, encoding, and first and last lines.
#[derive(Debug, Clone, PartialEq)]
pub struct TableLayout {
    /// Delimiter between the cells of a line.
    pub delimiter: Delimiter,
    /// Decimal sign of the numbers.
    pub decimal: Decimal,
    /// Character encoding; `None` if it is detected from the bytes.
    pub encoding: Option<Encoding>,
    /// Characters that begin a comment line; `None` for the default `#`, `%` and `//`.
    pub comment: Option<String>,
    /// Line of the header, from 1; `None` without a header.
    pub header_line: Option<usize>,
    /// Line of the first row, from 1.
    pub first_row_line: usize,
    /// First and last line of each table that is read, from 1, in ascending order. If empty, all lines from the first row on are read.
    pub row_lines: Vec<[usize; 2]>,
    /// Thousands separator, if numbers contain one that could be confused with a decimal sign.
    pub thousands: Option<Thousands>,
}

/// Description of a table of force and position over time.
#[derive(Debug, Clone, PartialEq)]
pub struct TableDescription {
    /// Layout of lines and cells, and the encoding.
    pub layout: TableLayout,
    /// Column and format of the times.
    pub time: (ColumnName, TimeFormat),
    /// Column and unit of the force, or of the current that produces it; `None` if another table contains the force.
    pub force: Option<(ColumnName, ParsedUnit)>,
    /// Columns and unit of positions; `None` for a force log.
    pub position: Option<(PositionColumns, ParsedUnit)>,
    /// Column of cycles; `None` if cycles are found from the force.
    pub cycle: Option<ColumnName>,
    /// Column that names a tracker's tracks (moving bodies), and the name of the track that is read; `None` if all rows are read.
    pub track: Option<(ColumnName, String)>,
    /// Rule for blank force cells; `None` if they are errors.
    pub blank_force: Option<BlankForce>,
    /// Values in the position column, in its unit, that mark lost tracking.
    pub lost: Vec<f64>,
    /// Rules for times that do not ascend.
    pub time_rules: TimeRules,
    /// True if each force has acted until its row, from the row before on.
    pub acts_until_row: bool,
}

/// Keys of `[measurement]` and `[actuation]` that describe a foreign table.
pub(crate) const KEYS: [&str; 16] = [
    // The first ten keys apply to every kind of table.
    "columns",
    "units",
    "delimiter",
    "decimal",
    "encoding",
    "comment",
    "header_line",
    "first_row_line",
    "thousands",
    "row_lines",
    "track",
    "blank_force",
    "lost",
    "time_restarts",
    "time_ties",
    "force_acts",
];

/// Keys of `[measurement]` that describe a rheometer's table of moduli.
pub(crate) const SWEEP_KEYS: &[&str] = KEYS.split_at(10).0;

const EXAMPLE: &str = "position = \"x [µm]\"";

impl TableDescription {
    /// Reads the description of a foreign table from `[measurement]`. The result is `None` without `[measurement.columns]`, because the table then
    /// has the program's own format. `is_driven_elsewhere` is true if `[actuation]` gives the force. `constant` is the
    /// quantity that has one value in all rows and therefore no column.
    pub fn read(
        measurement: TomlTable<'_>,
        is_driven_elsewhere: bool,
        constant: Option<Control>,
    ) -> Result<Option<Self>> {
        let Some(columns) = measurement.table("columns")? else {
            return match KEYS.iter().find(|key| measurement.has(key)) {
                None => Ok(None),
                Some(key) => Err(measurement.refuse(
                    key,
                    "this key describes a table, but [measurement.columns] is missing",
                    "add [measurement.columns] with `time`, `force` and `position`, or create it with `vitreo-uq init FILE`",
                )),
            };
        };
        columns.only(&["time", "force", "position", "position_x", "position_y", "position_z", "cycle", "track"])?;
        let units = Units::read(measurement, &["time", "force", "position"])?;
        if is_driven_elsewhere && columns.has("force") {
            let remedy = "remove `force` from [measurement.columns], or remove the table [actuation]";
            return Err(columns.refuse("force", "both this table and [actuation] contain the force", remedy));
        }
        if is_driven_elsewhere && measurement.has("force_acts") {
            let remedy = "write the key in [actuation], which contains the force";
            return Err(measurement.refuse("force_acts", "this table has no force", remedy));
        }
        let has_force = !is_driven_elsewhere && constant != Some(Control::Force);
        let force = if !has_force { None } else { Some(units.column(columns, "force", Dimension::Force)?) };
        let position = if constant == Some(Control::Position) {
            None
        } else {
            let position = position_columns(columns)?;
            Some((position.clone(), units.of("position", Dimension::Length, &position.all()[0])?))
        };
        let cycle = if columns.has("cycle") { Some(column(columns, "cycle")?) } else { None };
        let lost = measurement.numbers("lost")?.unwrap_or_default();
        Ok(Some(Self { force, position, cycle, lost, ..Self::of_times(measurement, columns, &units)? }))
    }

    /// Reads the description of a force log from `[actuation]`.
    pub(crate) fn read_log(actuation: TomlTable<'_>) -> Result<Self> {
        let columns = actuation.required_table("columns")?;
        columns.only(&["time", "force", "current"])?;
        let units = Units::read(actuation, &["time", "force", "current"])?;
        let force = if columns.has("current") {
            if columns.has("force") {
                return Err(columns.refuse("force", "the log has both a force and a current", "keep only one column"));
            }
            units.column(columns, "current", Dimension::Current)?
        } else {
            units.column(columns, "force", Dimension::Force)?
        };
        Ok(Self { force: Some(force), ..Self::of_times(actuation, columns, &units)? })
    }

    /// Reads a description with only the layout, the rules for rows and the time column.
    fn of_times(measurement: TomlTable<'_>, columns: TomlTable<'_>, units: &Units<'_>) -> Result<Self> {
        let time = column(columns, "time")?;
        let format = match units.text("time")?.as_deref().and_then(TimeFormat::named) {
            Some(format) => format,
            None => TimeFormat::Unit(units.of("time", Dimension::Time, &time)?),
        };
        Ok(Self {
            layout: TableLayout::read(measurement)?,
            force: None,
            position: None,
            time: (time, format),
            cycle: None,
            track: track(measurement, columns)?,
            blank_force: read_choice(measurement, "blank_force", &BlankForce::ALL, BlankForce::name)?,
            lost: Vec::new(),
            time_rules: TimeRules {
                joins_restarts: read_choice(measurement, "time_restarts", &["join"], |word| word)?.is_some(),
                spreads_ties: read_choice(measurement, "time_ties", &["spread"], |word| word)?.is_some(),
            },
            acts_until_row: read_choice(measurement, "force_acts", &["until-row"], |word| word)?.is_some(),
        })
    }

    /// Number of position columns: 1 for a position along the force, or 2 or 3 for coordinates.
    pub fn n_axes(&self) -> usize {
        self.position.as_ref().map_or(1, |(columns, _)| columns.all().len())
    }
}

fn track(measurement: TomlTable<'_>, columns: TomlTable<'_>) -> Result<Option<(ColumnName, String)>> {
    match (columns.has("track"), measurement.has("track")) {
        (false, false) => Ok(None),
        (true, false) => Err(measurement.missing("track", "track = \"0\"")),
        (false, true) => Err(columns.missing("track", "track = \"TRACK_ID\"")),
        (true, true) => Ok(Some((column(columns, "track")?, measurement.required_text("track", "track = \"0\"")?))),
    }
}

impl TableLayout {
    /// Reads the keys of the layout from `[measurement]`.
    pub fn read(measurement: TomlTable<'_>) -> Result<Self> {
        let delimiter =
            read_choice(measurement, "delimiter", &Delimiter::ALL, Delimiter::name)?.unwrap_or(Delimiter::Comma);
        let decimal = read_choice(measurement, "decimal", &Decimal::ALL, Decimal::name)?.unwrap_or(Decimal::Point);
        let header_line = line(measurement, "header_line")?;
        let row_lines = row_lines(measurement)?;
        let first_row_line = match row_lines.first() {
            Some([first, _]) if measurement.has("first_row_line") => {
                let remedy = format!("remove this key; `row_lines` already begins with line {first}");
                return Err(measurement.refuse("first_row_line", "`row_lines` also gives the first row", remedy));
            }
            Some([first, _]) => Some(*first),
            None => line(measurement, "first_row_line")?,
        };
        let header_line = if header_line.is_none() && first_row_line.is_none() { Some(1) } else { header_line };
        let layout = Self {
            delimiter,
            decimal,
            encoding: read_choice(measurement, "encoding", &Encoding::ALL, Encoding::name)?,
            comment: measurement.text("comment")?,
            header_line,
            first_row_line: first_row_line.unwrap_or(header_line.map_or(1, |line| line + 1)),
            row_lines,
            thousands: read_choice(measurement, "thousands", &Thousands::ALL, Thousands::name)?,
        };
        if layout.thousands.is_some_and(|thousands| thousands.name() == decimal.name()) {
            let remedy = "change `thousands` or `decimal`";
            return Err(measurement.refuse("thousands", "this sign is also the decimal sign", remedy));
        }
        if layout.header_line.is_some_and(|header| header >= layout.first_row_line) {
            let remedy = "give a header line above the first row";
            return Err(measurement.refuse("header_line", "the header is not above the first row", remedy));
        }
        Ok(layout)
    }

    /// Returns the number in a cell, read with the decimal sign and thousands separator of the layout; `None` if the cell is not a number.
    pub fn number(&self, cell: &str) -> Option<f64> {
        match self.thousands {
            Some(thousands) => self.decimal.number(&thousands.removed(cell)?),
            None => self.decimal.number(cell),
        }
    }

    /// Returns the index, from 0, of the table that contains the line with the number `line`, from 1; `None` if the line is not read.
    pub fn table_of(&self, line: usize) -> Option<usize> {
        if self.row_lines.is_empty() {
            return (line >= self.first_row_line).then_some(0);
        }
        let table = self.row_lines.partition_point(|[first, _]| *first <= line).checked_sub(1)?;
        (line <= self.row_lines[table][1]).then_some(table)
    }
}

/// Reads the key `row_lines`: first and last line of each table, in ascending order.
fn row_lines(measurement: TomlTable<'_>) -> Result<Vec<[usize; 2]>> {
    let key = "row_lines";
    let Some(pairs) = measurement.intervals(key)? else { return Ok(Vec::new()) };
    let are_lines = pairs.iter().flatten().all(|line| *line >= 1.0 && line.fract() == 0.0 && *line < 1e9);
    let ascend = pairs.windows(2).all(|two| two[0][1] < two[1][0]);
    if !are_lines || !ascend || pairs.is_empty() {
        let remedy = "give first and last lines, counted from 1 and in ascending order, as in `row_lines = [[4, 103], [108, 207]]`";
        return Err(measurement.refuse(key, "the value is not a list of pairs of lines in ascending order", remedy));
    }
    Ok(pairs.into_iter().map(|pair| pair.map(|line| line as usize)).collect())
}

/// Reads a key whose value must be one of several words, and returns the choice that the word names; `None` without the key.
pub(crate) fn read_choice<T: Copy>(
    table: TomlTable<'_>,
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

fn line(table: TomlTable<'_>, key: &str) -> Result<Option<usize>> {
    let Some(number) = table.number(key)? else { return Ok(None) };
    if number >= 1.0 && number.fract() == 0.0 && number < 1e9 {
        return Ok(Some(number as usize));
    }
    Err(table.refuse(key, format!("{number} is not a line number"), format!("count lines from 1, as in `{key} = 1`")))
}

pub(crate) fn column(columns: TomlTable<'_>, key: &str) -> Result<ColumnName> {
    if !columns.has(key) {
        return Err(columns.missing(key, &EXAMPLE.replace("position", key)));
    }
    if columns.is_number(key) {
        return line(columns, key).map(|number| ColumnName::Number(number.unwrap_or(1)));
    }
    columns.required_text(key, EXAMPLE).map(ColumnName::Named)
}

fn position_columns(columns: TomlTable<'_>) -> Result<PositionColumns> {
    let has_axes = ["position_x", "position_y", "position_z"].iter().any(|key| columns.has(key));
    if !has_axes {
        return column(columns, "position").map(PositionColumns::Along);
    }
    if columns.has("position") {
        let remedy = "keep either `position`, or `position_x` and `position_y` (and `position_z`)";
        return Err(columns.refuse("position", "the position is given twice", remedy));
    }
    let mut axes = vec![column(columns, "position_x")?, column(columns, "position_y")?];
    if columns.has("position_z") {
        axes.push(column(columns, "position_z")?);
    }
    Ok(PositionColumns::Axes(axes))
}

/// Units of columns from `[measurement.units]`. A column whose name ends in its unit needs no entry.
pub(crate) struct Units<'a> {
    measurement: TomlTable<'a>,
    table: Option<TomlTable<'a>>,
}

impl<'a> Units<'a> {
    pub fn read(measurement: TomlTable<'a>, keys: &[&str]) -> Result<Self> {
        let table = measurement.table("units")?;
        table.map_or(Ok(()), |table| table.only(keys))?;
        Ok(Self { measurement, table })
    }

    /// Returns the column that the key `key` of `[measurement.columns]` names, with its unit.
    fn column(&self, columns: TomlTable<'_>, key: &str, dimension: Dimension) -> Result<(ColumnName, ParsedUnit)> {
        let name = column(columns, key)?;
        let unit = self.of(key, dimension, &name)?;
        Ok((name, unit))
    }

    fn text(&self, key: &str) -> Result<Option<String>> {
        self.table.map_or(Ok(None), |table| table.text(key))
    }

    /// Unit of a ratio, which is a plain number unless the description or the column's name states a unit such as `%`.
    pub fn of_ratio(&self, key: &str, column: &ColumnName) -> Result<ParsedUnit> {
        let stated = self.text(key)?;
        let is_named = matches!(column, ColumnName::Named(name) if split_unit(name).1.is_some());
        match stated.as_deref() {
            Some("1" | "-") => Ok(ParsedUnit::one()),
            None if !is_named => Ok(ParsedUnit::one()),
            _ => self.of(key, Dimension::Ratio, column),
        }
    }

    pub fn of(&self, key: &str, dimension: Dimension, column: &ColumnName) -> Result<ParsedUnit> {
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
                Dimension::Time => {
                    ", min, h, clock or elapsed (hh:mm:ss), hh:mm, iso, day-first or month-first (dates)"
                }
                Dimension::Frequency => ", rad/s, 1/min",
                Dimension::Pressure => ", kPa, MPa",
                Dimension::Angle => ", deg",
                Dimension::Ratio => "1, %",
                _ => "",
            };
            table.refuse(
                key,
                format!("`{text}` is not a unit of this quantity"),
                format!("write one of {known}{others}"),
            )
        })
    }
}
