//! `init` for a force that another file contains, such as the current of a coil or the log of a stage.

use std::path::Path;

use super::source::TableSource;
use base::error::{Error, InputPlace, Result, Setting};
use base::toml_input::{UNKNOWN, quoted};
use base::units::Dimension;
use record::ramps_between_holds;
use record::table::{InspectedTable, cells, clock_word, decode_detected, inspect_table, is_blank_or_comment};

/// Words of a column with the times at which forces end.
const ENDS: [&str; 7] = ["end", "until", "stop", "ende", "endzeit", "bis", "fin"];
/// Parts of the name of a column with the durations of forces.
const DURATIONS: [&str; 3] = ["duration", "dauer", "durée"];

/// File with the force, and its columns of time and force.
pub(super) struct ForceLog {
    /// The file as text.
    pub source: TableSource,
    table: InspectedTable,
    time: LogColumn,
    force: LogColumn,
    is_current: bool,
    /// True if each row has the time at which its force ends.
    has_ends: bool,
    /// True if the force has sampled ramps, so that it is linear between rows.
    is_linear: bool,
}

/// Column of a log.
struct LogColumn {
    /// Number of the column, from 1.
    number: usize,
    /// Unit, or format of the times of a clock, as `experiment.toml` names it.
    unit: String,
}

impl ForceLog {
    /// Reads the first table of a file and finds its columns by their units: the only time, and the only force or current. A clock has no unit.
    ///
    /// # Errors
    /// [`Error::Input`] for durations, and unless one column alone has a unit of time and one alone a unit of force or current.
    pub fn read(file: &Path) -> Result<Self> {
        let source = TableSource::read(file)?;
        let table = inspect_table(&source.place, &source.bytes)?;
        let only = |what: &str, wanted: &[Dimension], example: &str| {
            let units = table.units.iter().enumerate();
            let mut found = units.filter_map(|(place, unit)| {
                let unit = unit.clone().filter(|unit| wanted.contains(&unit.dimension))?;
                Some(LogColumn { number: place + 1, unit: unit.name })
            });
            match (found.next(), found.next()) {
                (Some(column), None) => Ok(column),
                (first, _) => Err(Error::input(
                    InputPlace::file(&source.place),
                    format!("{} column has a unit of {what}", if first.is_none() { "no" } else { "more than one" }),
                    format!(
                        "give the file of `{}` one column of {what}, named with its unit as in `{example}`",
                        Setting::ForceFile
                    ),
                )),
            }
        };
        let text = decode_detected(&source.bytes);
        let lines = text.lines().skip(table.layout.first_row_line - 1).filter(|line| !is_blank_or_comment(line, None));
        let rows: Vec<Vec<_>> = lines.map(|line| cells(line, table.layout.delimiter)).collect();
        let has_unit = table.units.iter().flatten().any(|unit| unit.dimension == Dimension::Time);
        let mut first_cells = rows.first().into_iter().flatten().enumerate().filter(|_| !has_unit);
        let clock =
            first_cells.find_map(|(place, cell)| Some(LogColumn { number: place + 1, unit: clock_word(cell)?.into() }));
        let time = match clock {
            Some(clock) => clock,
            None => only("time", &[Dimension::Time], "time [s]")?,
        };
        let force = only("force or current", &[Dimension::Force, Dimension::Current], "force [uN]")?;
        let name = table.columns[time.number - 1].to_lowercase();
        if DURATIONS.iter().any(|word| name.contains(word)) {
            return Err(Error::input(
                InputPlace::file(&source.place),
                format!("`{name}` holds durations, and the log needs times"),
                "add them up, and give the time at which each force begins",
            ));
        }
        let forces = rows.iter().filter_map(|row| table.layout.number(row.get(force.number - 1)?));
        let forces: Vec<f64> = forces.collect();
        let has_ends = name.split(|c: char| !c.is_alphabetic()).any(|word| ENDS.contains(&word));
        let is_linear = !has_ends && ramps_between_holds(&forces).is_some();
        let unit = table.units[force.number - 1].as_ref();
        let is_current = unit.is_some_and(|unit| unit.dimension == Dimension::Current);
        Ok(Self { table, time, force, is_current, has_ends, is_linear, source })
    }

    /// Sentence on how the log is read.
    pub fn reason(&self) -> String {
        let how = match (self.has_ends, self.is_linear) {
            (true, _) => "each row has the time at which its force ends (force_acts = \"until-row\")",
            (false, true) => "it has sampled ramps, and is linear between rows (force = \"linear\")",
            (false, false) => "each force holds until the next row (force = \"hold\")",
        };
        format!("the force comes from {} ([actuation]): {how}", self.source.name)
    }

    /// True if the log holds a current, whose conversion to a force must be given.
    pub fn is_current(&self) -> bool {
        self.is_current
    }

    /// Text of `[actuation]` in `experiment.toml`.
    pub fn toml(&self) -> String {
        let layout = &self.table.layout;
        let mut lines = vec![
            "\n[actuation]".to_string(),
            format!("file = {}", quoted(&self.source.name)),
            format!(
                "{:<36} # between the log's rows: \"hold\" until the next one, or \"linear\"",
                format!("force = \"{}\"", if self.is_linear { "linear" } else { "hold" })
            ),
            format!("delimiter = {}", quoted(layout.delimiter.name())),
            format!("decimal = {}", quoted(layout.decimal.name())),
        ];
        if self.is_current() {
            lines.push(format!(
                "calibration = {}                    # [a, b]: force in N = a + b × current in A",
                quoted(UNKNOWN)
            ));
        }
        if self.has_ends {
            lines.push("force_acts = \"until-row\"            # each force has acted since the row before".into());
        }
        lines.extend(layout.encoding.map(|encoding| format!("encoding = {}", quoted(encoding.name()))));
        lines.extend(layout.header_line.map(|line| format!("header_line = {line}")));
        lines.push(format!("first_row_line = {}", layout.first_row_line));
        let key = if self.is_current() { "current" } else { "force" };
        lines.push(format!("\n[actuation.columns]\ntime = {}\n{key} = {}", self.time.number, self.force.number));
        let [time, force] = [&self.time, &self.force].map(|column| quoted(&column.unit));
        lines.push(format!("\n[actuation.units]\ntime = {time}\n{key} = {force}\n"));
        lines.join("\n")
    }
}
