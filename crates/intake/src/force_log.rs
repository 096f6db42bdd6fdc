//! `init` for a force that another file contains, such as the current of a coil or the log of a stage.

use std::path::Path;

use super::source::TableSource;
use base::error::{Error, InputPlace, Result, Setting};
use base::toml_input::{UNKNOWN, quoted};
use base::units::Dimension;
use record::table::{InspectedTable, ParsedUnit, inspect_table};

/// File with the force, and its columns of time and force.
pub(super) struct ForceLog {
    /// The file as text.
    pub source: TableSource,
    table: InspectedTable,
    time: LogColumn,
    force: LogColumn,
}

/// Column of a log.
struct LogColumn {
    /// Number of the column, from 1.
    number: usize,
    unit: ParsedUnit,
}

impl ForceLog {
    /// Reads the first table of a file and finds its columns by their units: the only time, and the only force or current.
    ///
    /// # Errors
    /// [`Error::Input`] unless exactly one column has a unit of time and one a unit of force or current.
    pub fn read(file: &Path) -> Result<Self> {
        let source = TableSource::read(file)?;
        let table = inspect_table(&source.place, &source.bytes)?;
        let only = |what: &str, wanted: &[Dimension], example: &str| {
            let units = table.units.iter().enumerate();
            let mut found = units.filter_map(|(place, unit)| {
                let unit = unit.clone().filter(|unit| wanted.contains(&unit.dimension))?;
                Some(LogColumn { number: place + 1, unit })
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
        let time = only("time", &[Dimension::Time], "time [s]")?;
        let force = only("force or current", &[Dimension::Force, Dimension::Current], "force [uN]")?;
        Ok(Self { table, time, force, source })
    }

    /// True if the log holds a current, whose conversion to a force must be given.
    pub fn is_current(&self) -> bool {
        self.force.unit.dimension == Dimension::Current
    }

    /// Text of `[actuation]` in `experiment.toml`.
    pub fn toml(&self) -> String {
        let layout = &self.table.layout;
        let mut lines = vec![
            "\n[actuation]".to_string(),
            format!("file = {}", quoted(&self.source.name)),
            "force = \"hold\"                       # until the log's next row; or \"linear\"".into(),
            format!("delimiter = {}", quoted(layout.delimiter.name())),
            format!("decimal = {}", quoted(layout.decimal.name())),
        ];
        if self.is_current() {
            lines.push(format!(
                "calibration = {}                    # [a, b]: force in N = a + b × current in A",
                quoted(UNKNOWN)
            ));
        }
        lines.extend(layout.encoding.map(|encoding| format!("encoding = {}", quoted(encoding.name()))));
        lines.extend(layout.header_line.map(|line| format!("header_line = {line}")));
        lines.push(format!("first_row_line = {}", layout.first_row_line));
        let key = if self.is_current() { "current" } else { "force" };
        lines.push(format!("\n[actuation.columns]\ntime = {}\n{key} = {}", self.time.number, self.force.number));
        let [time, force] = [&self.time, &self.force].map(|column| quoted(&column.unit.name));
        lines.push(format!("\n[actuation.units]\ntime = {time}\n{key} = {force}\n"));
        lines.join("\n")
    }
}
