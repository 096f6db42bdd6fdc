//! Reader of `trajectory.csv`, a table in the program's own format: a header with units, then rows. Every error names its line.

use std::path::Path;

use super::times::TimeChanges;
use base::error::{Error, InputPlace, Result};
use base::files::refuse_long_lines;
use base::units::{Dimension, UNITS, Unit, nearest_name};

/// Rows of a table in SI units, before zero, direction and cycles are determined.
#[derive(Debug)]
pub(super) struct Trajectory {
    pub time_s: Vec<f64>,
    pub force_n: Vec<f64>,
    /// Position as written, in m. If the table has several coordinates, it is the coordinate x.
    pub position_m: Vec<Option<f64>>,
    /// Coordinates y, or y and z, as written, in m, with one list for each coordinate. Empty for a single position column.
    pub others_m: Vec<Vec<Option<f64>>>,
    /// Metres per unit of the position column.
    pub position_unit_m: f64,
    /// Time on the table's own clock at the record's time 0, in s.
    pub clock_zero_s: f64,
    /// Cycle of each row; `None` if the file has no `cycle` column.
    pub cycle: Option<Vec<u32>>,
    /// Line number of each row in the file, from 1.
    pub lines: Vec<usize>,
    /// Name of the force column in the header; empty if another table contains the force.
    pub force_column: String,
    pub position_column: String,
    /// Changes that were made to the times so that they ascend.
    pub ordered: TimeChanges,
    /// Force before the first row, in N, if each force acts until its row.
    pub force_before_n: Option<f64>,
}

/// One row of a table in SI units, with the text of its cycle cell.
pub(super) struct TableRow<'a> {
    pub time_s: f64,
    pub force_n: f64,
    pub position_m: Option<f64>,
    pub cycle: Option<&'a str>,
}

/// Quantity that a column contains.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Column {
    Quantity(usize, Unit),
    Cycle,
}

/// Name, dimension and example column of each quantity, for messages. The indices are [`TIME`], [`FORCE`] and [`POSITION`].
const QUANTITIES: [(&str, Dimension, &str); 3] = [
    ("time", Dimension::Time, "time_s"),
    ("force", Dimension::Force, "force_uN"),
    ("position", Dimension::Length, "position_um"),
];
pub(super) const TIME: usize = 0;
pub(super) const FORCE: usize = 1;
pub(super) const POSITION: usize = 2;
/// Index of the cycle, which follows the quantities, in places for errors.
pub(super) const CYCLE: usize = 3;

/// Largest number of rows of a record. The reader needs about a hundred bytes of memory for each row.
const MOST_ROWS: usize = 20_000_000;

/// Words that mean a lost position, in addition to an empty cell.
const LOST: [&str; 10] = ["nan", "na", "null", "n/a", "#n/a", "none", "missing", "-", "--", "---"];

/// True if a cell means a lost position.
pub(super) fn is_lost(cell: &str) -> bool {
    // Rheoplus writes `******` for what was not measured.
    cell.bytes().all(|byte| byte == b'*') || LOST.iter().any(|lost| cell.eq_ignore_ascii_case(lost))
}

/// Header of the table: all column names, column index and unit of each quantity, and column index of the cycle.
struct Header {
    names: Vec<String>,
    time: (usize, Unit),
    /// Column index and unit of the force; `None` if another file contains the force.
    force: Option<(usize, Unit)>,
    position: (usize, Unit),
    cycle: Option<usize>,
}

/// Parses the text of `trajectory.csv`. Errors name `file`. `is_driven_elsewhere` is true if another file contains the force. A force that is measured
/// (`is_force_measured`), because the position is commanded, may be blank: it is then NaN.
pub(super) fn read_trajectory(
    file: &Path,
    text: &str,
    is_driven_elsewhere: bool,
    is_force_measured: bool,
) -> Result<Trajectory> {
    refuse_long_lines(file, text.as_bytes())?;
    let mut rows = TableRows::new(file, text);
    let Some(header_line) = rows.next_row()? else {
        return Err(Error::input(InputPlace::file(file).at_line(1), "the file has no header", HEADER_REMEDY));
    };
    let names: Vec<String> = rows.record.iter().map(str::to_string).collect();
    let header = Header::parse(&InputPlace::file(file).at_line(header_line), &names, is_driven_elsewhere)?;
    let force_column = header.force.map_or("", |(index, _)| header.names[index].as_str());
    let mut trajectory = Trajectory::empty(header.cycle.is_some(), force_column, &header.names[header.position.0]);
    trajectory.position_unit_m = header.position.1.to_si(1.0);
    while let Some(line) = rows.next_row()? {
        trajectory.note_line(file, line)?;
        trajectory.push(&header, &|| InputPlace::file(file).at_line(line), &rows.record, is_force_measured)?;
    }
    trajectory.check_length(file, header_line + trajectory.time_s.len())?;
    Ok(trajectory)
}

const HEADER_REMEDY: &str =
    "write the header `time_s,force_uN,position_um,cycle` (other units are allowed; `cycle` is optional)";

/// Reader of a CSV's rows that also gives their line numbers. Blank lines are skipped.
struct TableRows<'a> {
    file: &'a Path,
    text: &'a [u8],
    reader: csv::Reader<&'a [u8]>,
    record: csv::StringRecord,
    counted_bytes: usize,
    line: usize,
}

impl<'a> TableRows<'a> {
    fn new(file: &'a Path, text: &'a str) -> Self {
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        Self { file, text: text.as_bytes(), reader, record: csv::StringRecord::new(), counted_bytes: 0, line: 1 }
    }

    /// Reads the next row into `record` and returns the row's line number; `None` at the end of the table.
    fn next_row(&mut self) -> Result<Option<usize>> {
        let start = usize::try_from(self.reader.position().byte()).unwrap_or(usize::MAX);
        let more = self.reader.read_record(&mut self.record).map_err(|error| {
            Error::input(
                InputPlace::file(self.file).at_line(self.line),
                format!("the row is not readable as CSV: {error}"),
                "separate the cells by commas, write one sample on each line and remove stray quotation marks",
            )
        })?;
        if !more {
            return Ok(None);
        }
        Ok(Some(self.line_of_row_from(start)))
    }

    /// Returns the line number of the row that the reader began to read at byte `start`. Blank lines before the row are counted.
    fn line_of_row_from(&mut self, start: usize) -> usize {
        let mut end = start.min(self.text.len());
        while self.text.get(end).is_some_and(|byte| matches!(byte, b'\n' | b'\r')) {
            end += 1;
        }
        self.line += self.text[self.counted_bytes.min(end)..end].iter().filter(|byte| **byte == b'\n').count();
        self.counted_bytes = end;
        self.line
    }
}

impl Header {
    fn parse(place: &InputPlace, cells: &[String], is_driven_elsewhere: bool) -> Result<Self> {
        if let [only] = cells
            && (only.contains(';') || only.contains('\t'))
        {
            return Err(Error::input(
                place.clone().at_key(only.as_str()),
                "the columns are separated by semicolons or tabs",
                "separate the columns by commas and write decimals with a point",
            ));
        }
        let mut quantities: [Option<(usize, Unit)>; 3] = [None; 3];
        let mut cycle = None;
        for (index, name) in cells.iter().enumerate() {
            let place = place.clone().at_key(name.as_str());
            match Column::parse(&place, name)? {
                Column::Cycle if cycle.is_some() => return Err(duplicate(place, "cycle")),
                Column::Cycle => cycle = Some(index),
                Column::Quantity(which, unit) => match quantities[which] {
                    Some((earlier, _)) => return Err(duplicate(place, &cells[earlier])),
                    None => quantities[which] = Some((index, unit)),
                },
            }
        }
        let require = |which: usize| {
            quantities[which].ok_or_else(|| {
                let (quantity, dimension, example) = QUANTITIES[which];
                Error::input(
                    place.clone().at_key(example),
                    format!("the column for {quantity} is missing"),
                    format!(
                        "add a column such as `{example}`; its name is `{quantity}` followed by one of {}",
                        dimension.accepted_suffixes()
                    ),
                )
            })
        };
        if let (true, Some((index, _))) = (is_driven_elsewhere, quantities[FORCE]) {
            return Err(Error::input(
                place.clone().at_key(cells[index].as_str()),
                "both this column and the log in [actuation] contain the force",
                "remove this column, or the table [actuation]",
            ));
        }
        let force = if is_driven_elsewhere { None } else { Some(require(FORCE)?) };
        Ok(Self { names: cells.to_vec(), time: require(TIME)?, force, position: require(POSITION)?, cycle })
    }
}

fn duplicate(place: InputPlace, earlier: &str) -> Error {
    Error::input(
        place,
        format!("two columns contain this quantity; the other is `{earlier}`"),
        "keep one column for each of time, force, position and cycle",
    )
}

impl Column {
    fn parse(place: &InputPlace, name: &str) -> Result<Self> {
        if name == "cycle" {
            return Ok(Self::Cycle);
        }
        let (stem, suffix) = name.rsplit_once('_').unwrap_or((name, ""));
        if let Some(which) = QUANTITIES.iter().position(|(quantity, _, _)| *quantity == stem) {
            let (quantity, dimension, _) = QUANTITIES[which];
            return Unit::find(dimension, suffix).map(|unit| Self::Quantity(which, unit)).ok_or_else(|| {
                let found = if suffix.is_empty() { "no unit".into() } else { format!("unknown unit `_{suffix}`") };
                Error::input(
                    place.clone(),
                    format!("{found} for the column {quantity}"),
                    format!("end the name with one of {} (case matters)", dimension.accepted_suffixes()),
                )
            });
        }
        let known: Vec<String> = QUANTITIES
            .iter()
            .flat_map(|(quantity, dimension, _)| {
                UNITS
                    .iter()
                    .filter(|unit| unit.dimension == *dimension)
                    .map(move |unit| format!("{quantity}_{}", unit.suffix))
            })
            .chain(["cycle".to_string()])
            .collect();
        let remedy = match nearest_name(name, known.iter().map(String::as_str)) {
            Some(near) => format!("did you mean `{near}`? Otherwise remove the column"),
            None => format!("remove the column, or {HEADER_REMEDY}"),
        };
        Err(Error::input(place.clone(), "unknown column", remedy))
    }
}

impl Trajectory {
    /// Adds a row of the CSV. `place` returns the row's place for errors; it is called only for an error, because files have millions of rows.
    fn push(
        &mut self,
        header: &Header,
        place: &dyn Fn() -> InputPlace,
        cells: &csv::StringRecord,
        is_force_measured: bool,
    ) -> Result<()> {
        if cells.len() != header.names.len() {
            return Err(Error::input(
                place(),
                format!("the row has {} cells, but the header has {}", cells.len(), header.names.len()),
                "write one cell for each column, leave the position empty if tracking was lost, and use a decimal point",
            ));
        }
        let at = |index: usize| place().at_key(header.names[index].as_str());
        let cell = |(index, unit): (usize, Unit)| (&cells[index], unit, move || at(index));
        let (text, unit, place_of_time) = cell(header.time);
        let time_s = unit.to_si(finite(&place_of_time, text, "correct the time or remove the row")?);
        self.check_time(&place_of_time, time_s)?;
        let force_n = match header.force.map(cell) {
            Some((text, ..)) if is_force_measured && is_lost(text) => f64::NAN,
            Some((text, unit, place_of_force)) => {
                let remedy = "give the force commanded in this row; use `vitreo-uq init` for tables in which blank forces have a meaning";
                unit.to_si(finite(&place_of_force, text, remedy)?)
            }
            None => 0.0,
        };
        let (text, unit, place_of_position) = cell(header.position);
        let position_m = if is_lost(text) {
            None
        } else {
            let remedy = "correct the position, or leave the cell empty if tracking was lost";
            Some(unit.to_si(finite(&place_of_position, text, remedy)?))
        };
        let cycle = header.cycle.map(|index| &cells[index]);
        self.add(TableRow { time_s, force_n, position_m, cycle }, &|which| match which {
            CYCLE => at(header.cycle.unwrap_or(0)),
            TIME => at(header.time.0),
            FORCE => at(header.force.unwrap_or(header.time).0),
            _ => at(header.position.0),
        })
    }

    /// Returns an empty trajectory with the names of its force and position columns.
    pub(super) fn empty(has_cycles: bool, force_column: &str, position_column: &str) -> Self {
        Self {
            time_s: Vec::new(),
            force_n: Vec::new(),
            position_m: Vec::new(),
            others_m: Vec::new(),
            ordered: TimeChanges::default(),
            force_before_n: None,
            position_unit_m: 1.0,
            clock_zero_s: 0.0,
            cycle: has_cycles.then(Vec::new),
            lines: Vec::new(),
            force_column: force_column.into(),
            position_column: position_column.into(),
        }
    }

    /// Adds a row in SI units. `place` returns the place of a quantity for errors, given its index or [`CYCLE`].
    pub(super) fn add(&mut self, row: TableRow<'_>, place: &dyn Fn(usize) -> InputPlace) -> Result<()> {
        let TableRow { time_s, force_n, position_m, cycle } = row;
        // A computed zero, such as a sine of π, has a rounding error.
        let time_s = if self.time_s.is_empty() && time_s.abs() < TIMES_S[0] { 0.0 } else { time_s };
        plausible(&|| place(TIME), time_s, TIMES_S, "s")?;
        let force_n = if force_n.abs() < FORCES_N[0] { 0.0 } else { force_n };
        if !force_n.is_nan() {
            plausible(&|| place(FORCE), force_n, FORCES_N, "N")?;
        }
        if let Some(position_m) = position_m {
            plausible(&|| place(POSITION), position_m, POSITIONS_M, "m")?;
        }
        self.time_s.push(time_s);
        self.force_n.push(force_n);
        self.position_m.push(position_m);
        if let (Some(text), Some(cycles)) = (cycle, &mut self.cycle) {
            cycles.push(next_cycle(&|| place(CYCLE), text, cycles.last().copied())?);
        }
        Ok(())
    }

    /// Returns a trajectory without rows that has the columns, unit and clock of `self`.
    pub(super) fn without_rows(&self) -> Self {
        let mut emptied = Self::empty(self.cycle.is_some(), &self.force_column, &self.position_column);
        (emptied.position_unit_m, emptied.clock_zero_s) = (self.position_unit_m, self.clock_zero_s);
        emptied.others_m = vec![Vec::new(); self.others_m.len()];
        emptied
    }

    /// Adds a copy of row `row` of the trajectory `other`, with the time `time_s` and the force `force_n`. If `is_sample` is false, the row only
    /// marks a change of the force and has no position.
    pub(super) fn push_from(&mut self, other: &Self, row: usize, time_s: f64, force_n: f64, is_sample: bool) {
        let kept = |position: Option<f64>| position.filter(|_| is_sample);
        self.time_s.push(time_s);
        self.force_n.push(force_n);
        self.position_m.push(kept(other.position_m[row]));
        for (coordinate, theirs) in self.others_m.iter_mut().zip(&other.others_m) {
            coordinate.push(kept(theirs[row]));
        }
        if let Some((cycles, theirs)) = self.cycle.as_mut().zip(other.cycle.as_ref()) {
            cycles.push(theirs[row]);
        }
        self.lines.push(other.lines[row]);
    }

    /// Force of the first row as written, in N.
    pub(super) fn first_force_n(&self) -> f64 {
        self.force_before_n.unwrap_or(self.force_n[0])
    }

    /// Gives each row the force of the next one, which has acted since the row. The last force goes on.
    pub(super) fn act_until_rows(&mut self) {
        self.force_before_n = self.force_n.first().copied();
        let n_rows = self.force_n.len();
        self.force_n.copy_within(1.min(n_rows).., 0);
    }

    /// Inserts a row without a position before the first row, for a record that started under load. The first row's force acts from the time
    /// `start_s` (s) on, which becomes time 0.
    pub(super) fn start_under_load(&mut self, place: &InputPlace, start_s: f64) -> Result<()> {
        let first_s = self.time_s.first().copied().unwrap_or(0.0);
        if start_s >= first_s || (first_s - start_s).abs() > TIMES_S[1] {
            return Err(Error::input(
                place.clone(),
                format!("the first row is at {first_s} s, but its force is said to begin at {start_s} s"),
                "give a time before the first row, in s of the table's clock, such as -3.0",
            ));
        }
        self.time_s.insert(0, start_s);
        self.time_s.iter_mut().for_each(|time_s| *time_s -= start_s);
        self.force_n.insert(0, self.first_force_n());
        self.position_m.insert(0, None);
        self.others_m.iter_mut().for_each(|coordinate| coordinate.insert(0, None));
        self.lines.insert(0, self.lines[0]);
        if let Some(cycle) = &mut self.cycle {
            cycle.insert(0, cycle[0]);
        }
        self.clock_zero_s += start_s;
        Ok(())
    }

    /// Stores the line number of the row that is added next.
    pub(super) fn note_line(&mut self, file: &Path, line: usize) -> Result<()> {
        if self.lines.len() == MOST_ROWS {
            return Err(Error::input(
                InputPlace::file(file).at_line(line),
                format!("this row exceeds the limit of {MOST_ROWS} rows in a record"),
                "keep every k-th row, or split the record",
            ));
        }
        self.lines.push(line);
        Ok(())
    }

    /// Checks that a record has at least two rows. `line` is the line number of the first row.
    pub(super) fn check_length(&self, file: &Path, line: usize) -> Result<()> {
        if self.time_s.len() >= 2 {
            return Ok(());
        }
        Err(Error::input(
            InputPlace::file(file).at_line(line),
            format!("the table has {} rows below the header", self.time_s.len()),
            "give one row for each sample, at least two",
        ))
    }

    fn check_time(&self, place: &dyn Fn() -> InputPlace, time_s: f64) -> Result<()> {
        match self.time_s.last() {
            None if time_s < 0.0 => Err(Error::input(
                place(),
                format!("the record starts at {time_s} s, before t = 0"),
                "shift the times so that the record starts at t = 0, with position 0",
            )),
            Some(before) if time_s <= *before => Err(Error::input(
                place(),
                format!("time is not increasing: {time_s} s follows {before} s"),
                "sort the rows by time; if times repeat or restart, describe the table with `vitreo-uq init`",
            )),
            _ => Ok(()),
        }
    }
}

fn finite(place: &dyn Fn() -> InputPlace, text: &str, remedy: &str) -> Result<f64> {
    let found = match text.parse::<f64>() {
        Ok(number) if number.is_finite() => return Ok(number),
        Ok(_) => format!("`{text}` is not a finite number"),
        Err(_) if text.is_empty() => "the cell is empty".to_string(),
        Err(_) => format!("`{text}` is not a number"),
    };
    Err(Error::input(place(), found, remedy))
}

/// Allowed absolute values of times, forces and positions in SI units. A smaller force, or first time, counts as 0. Other larger or smaller values have wrong units, and would later exceed the range of
/// floating-point numbers. A modulus over time is read in place of a position.
const TIMES_S: [f64; 2] = [1e-12, 1e12];
const FORCES_N: [f64; 2] = [1e-24, 1e12];
const POSITIONS_M: [f64; 2] = [0.0, 1e12];

fn plausible(place: &dyn Fn() -> InputPlace, value: f64, [smallest, largest]: [f64; 2], unit: &str) -> Result<()> {
    if value == 0.0 || (smallest..=largest).contains(&value.abs()) {
        return Ok(());
    }
    Err(Error::input(
        place(),
        format!("{value:e} {unit} is outside the range of possible experiments"),
        "check the number and the unit at the end of the column's name",
    ))
}

/// Parses the cycle number of a row, and checks that cycles are counted from 1 without gaps. `before` is the previous row's cycle.
fn next_cycle(place: &dyn Fn() -> InputPlace, text: &str, before: Option<u32>) -> Result<u32> {
    // Programs that know only one kind of number write `1.0`.
    let is_cycle = |number: &f64| *number >= 1.0 && number.fract() == 0.0 && *number <= f64::from(u32::MAX);
    let cycle = text.parse::<f64>().ok().filter(is_cycle).map(|number| number as u32).ok_or_else(|| {
        Error::input(
            place(),
            format!("`{text}` is not a cycle number"),
            "number the cycles 1, 2, 3, …, or remove the `cycle` column; the force then determines the cycles",
        )
    })?;
    let allowed = before.map_or(cycle == 1, |before| cycle == before || cycle - 1 == before);
    if allowed {
        return Ok(cycle);
    }
    let Some(before) = before else {
        return Err(Error::input(
            place(),
            format!("the first row belongs to cycle {cycle}"),
            "begin the table with cycle 1, because earlier cycles load the gel, too; if they are lost and the gel had recovered, number the cycles 1, 2, 3, … and set `zero = \"fit\"`",
        ));
    };
    Err(Error::input(
        place(),
        format!("cycle {cycle} follows cycle {before}"),
        "number the cycles 1, 2, 3, … in the order of time, or remove the `cycle` column; the force then determines the cycles",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Trajectory> {
        read_trajectory(Path::new("t.csv"), text, false, false)
    }

    #[test]
    fn a_force_that_is_measured_may_be_blank() {
        let text = "time_s,force_uN,position_um\n0,1,0\n1,,2\n2,nan,2\n3,4,2\n";
        assert!(read(text).is_err());
        let trajectory = read_trajectory(Path::new("t.csv"), text, false, true).unwrap();
        assert!(trajectory.force_n[1].is_nan() && trajectory.force_n[2].is_nan());
        assert_eq!(trajectory.position_m, [Some(0.0), Some(2e-6), Some(2e-6), Some(2e-6)]);
    }

    #[test]
    fn units_and_column_order_are_free() {
        let trajectory = read("position_nm,cycle,force_pN,time_ms\n1500,1,2,0\n,1,-2e3,500\nnan,2,0,1000.5\n").unwrap();
        assert_eq!(trajectory.time_s, [0.0, 0.5, 1.0005]);
        assert_eq!(trajectory.force_n, [2e-12, -2e-9, 0.0]);
        assert_eq!(trajectory.position_m, [Some(1.5e-6), None, None]);
        assert_eq!(trajectory.cycle, Some(vec![1, 1, 2]));
        assert_eq!(trajectory.position_column, "position_nm");
    }

    #[test]
    fn cycles_are_whole_numbers_in_any_notation() {
        let cycles = |cells: [&str; 2]| {
            let text = format!("time_s,force_N,position_m,cycle\n0,1,0,{}\n1,1,0,{}\n", cells[0], cells[1]);
            read(&text).map(|trajectory| trajectory.cycle)
        };
        for cells in [["1", "2"], ["1.0", "2.000"], ["1E0", "2e0"]] {
            assert_eq!(cycles(cells).unwrap(), Some(vec![1, 2]), "{cells:?}");
        }
        for wrong in ["1.5", "0.0", "-1", "nan", "1e300", "one"] {
            let error = cycles(["1", wrong]).unwrap_err().to_string();
            assert!(error.contains(&format!("`{wrong}` is not a cycle number")), "{error}");
        }
    }

    #[test]
    fn lines_count_blank_lines_and_windows_endings() {
        let trajectory = read("time_s,force_N,position_m\r\n\r\n0,1,0\r\n\r\n\r\n1,1,0\r\n2,1,0").unwrap();
        assert_eq!(trajectory.lines, [3, 6, 7]);
    }

    #[test]
    fn quoted_headers_and_spaces_are_read() {
        let trajectory = read("\"time_s\",\"force_uN\", position_um \n0, 4.6, 0\n1, 4.6, 2\n").unwrap();
        assert_eq!(trajectory.force_n, [4.6e-6, 4.6e-6]);
        assert_eq!(trajectory.cycle, None);
    }
}
