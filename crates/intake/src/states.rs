//! Columns that say in which state, or of which specimen, the rows of an oscillation were measured.

use std::path::Path;

use super::stress::{STRAIN, called};
use base::error::{Error, InputPlace, Result};
use figures::number::format_significant;
use record::SweepColumn;
use record::table::{InspectedTable, bracketed, cells, decode_detected};

/// Words that name specimens, and words that may stand beside them.
const SPECIMENS: [&str; 27] = [
    "specimen",
    "sample",
    "samples",
    "robot",
    "roi",
    "well",
    "gel",
    "eye",
    "batch",
    "lot",
    "charge",
    "probe",
    "muster",
    "échantillon",
    "éprouvette",
    "muestra",
    "campione",
    "amostra",
    "donor",
    "patient",
    "animal",
    "subject",
    "condition",
    "treatment",
    "group",
    "formulation",
    "composition",
];
const BESIDE_SPECIMENS: [&str; 8] = ["id", "name", "no", "nr", "number", "label", "code", "type"];
/// Words of settings that are written as one number for all rows of a sweep.
const SETTINGS: [&str; 10] = [
    "concentration",
    "konzentration",
    "concentración",
    "concentrazione",
    "concentração",
    "conc",
    "ph",
    "dose",
    "day",
    "crosslinker",
];
/// Beginnings of words of temperatures.
const TEMPERATURE: [&str; 3] = ["temp", "température", "温度"];
/// Words of times that begin like a temperature.
const TIMES: [&str; 3] = ["temps", "tempo", "temporal"];
/// Units of a temperature whose name is a letter.
const DEGREES: [&str; 6] = ["°c", "degc", "k", "c", "°f", "℃"];
/// Words in the name of a frequency that is shifted to the temperature of a master curve.
const SHIFTED: [&str; 5] = ["reduced", "shifted", "reduziert", "réduite", "ridotta"];
/// Largest drift of a temperature between two rows of a sweep, in its unit.
const DRIFT: f64 = 1.0;
/// Largest relative change of a strain between two rows of a sweep.
const STRAIN_CHANGE: f64 = 0.3;
/// Smallest number of frequencies of a sweep.
const FEWEST_FREQUENCIES: usize = 3;
/// Two frequencies are equal if their relative difference is below this value.
const SAME_FREQUENCY: f64 = 1e-3;
/// Largest number of states in a message.
const MOST_SHOWN: usize = 4;

/// Kind of a column that says in which state the rows were measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StateKind {
    /// Name of a specimen, or a setting: equal texts are one state.
    Label,
    /// Temperature, which is measured and drifts.
    Temperature,
    /// Strain, which one sweep may vary with the frequency.
    Strain,
}

impl StateKind {
    /// Kind of a column by its name; `None` for other columns.
    fn of(name: &str) -> Option<Self> {
        let stem = bracketed(name).map_or(name, |(stem, _)| stem).to_lowercase();
        let words: Vec<&str> = stem.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty()).collect();
        let has = |list: &[&str]| words.iter().any(|word| list.contains(word));
        let is_specimen =
            has(&SPECIMENS) && words.iter().all(|word| SPECIMENS.contains(word) || BESIDE_SPECIMENS.contains(word));
        let is_degrees = |text: &str| DEGREES.contains(&text.trim().to_lowercase().as_str());
        let is_letter = words == ["t"] && bracketed(name).is_some_and(|(_, text)| is_degrees(text));
        match () {
            () if is_specimen || has(&SETTINGS) => Some(Self::Label),
            () if words.iter().any(|word| TIMES.contains(word)) => None,
            () if is_letter || TEMPERATURE.iter().any(|start| words.iter().any(|word| word.starts_with(start))) => {
                Some(Self::Temperature)
            }
            () if called(name, &STRAIN, &["rate", "stress"]) => Some(Self::Strain),
            () => None,
        }
    }

    /// Largest difference of two numbers of one state.
    fn tolerance(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Strain => STRAIN_CHANGE * a.abs().max(b.abs()),
            _ => DRIFT,
        }
    }
}

/// Rows of one state: its name or number, their lines and frequencies.
#[derive(Debug, Clone, PartialEq)]
struct State {
    name: String,
    value: f64,
    lines: [usize; 2],
    frequencies: Vec<f64>,
}

impl State {
    /// True if the rows have the frequencies of a sweep.
    fn is_sweep(&self) -> bool {
        let mut sorted = self.frequencies.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.dedup_by(|a, b| (*a - *b).abs() <= SAME_FREQUENCY * b.abs());
        sorted.len() >= FEWEST_FREQUENCIES
    }

    /// True if another state has frequencies between those of this one.
    fn overlaps(&self, other: &Self) -> bool {
        let range = |state: &Self| {
            let ends = |fold: fn(f64, f64) -> f64, start: f64| state.frequencies.iter().copied().fold(start, fold);
            [ends(f64::min, f64::INFINITY), ends(f64::max, f64::NEG_INFINITY)]
        };
        let ([low, high], [lowest, highest]) = (range(self), range(other));
        low.max(lowest) < high.min(highest)
    }
}

/// Lines of the table with a frequency, each with the frequency and the text of a column. A blank cell has the text of the cell above it.
fn rows(bytes: &[u8], looked: &InspectedTable, frequency: usize, column: usize) -> Vec<(usize, f64, String)> {
    let layout = &looked.layout;
    let (text, mut above, mut rows) = (decode_detected(bytes), String::new(), Vec::new());
    for (line, text) in (1..).zip(text.lines()).filter(|(line, _)| layout.table_of(*line).is_some()) {
        let cells = cells(text, layout.delimiter);
        let Some(frequency) = cells.get(frequency).and_then(|cell| layout.number(cell)).filter(|f| *f != 0.0) else {
            continue;
        };
        if let Some(cell) = cells.get(column).map(|cell| cell.trim()).filter(|cell| !cell.is_empty()) {
            above = cell.to_string();
        }
        rows.push((line, frequency, above.clone()));
    }
    rows
}

/// States of a column with the rows of a sweep each.
fn states(kind: StateKind, looked: &InspectedTable, rows: &[(usize, f64, String)]) -> Vec<State> {
    let mut states: Vec<State> = Vec::new();
    // Number of the row above, which a drift changes from row to row.
    let mut last = f64::NAN;
    for (line, frequency, text) in rows {
        let value = looked.layout.number(text).unwrap_or(f64::NAN);
        let goes_on = (value - last).abs() <= kind.tolerance(value, last);
        last = value;
        let same = match kind {
            StateKind::Label => states.iter_mut().find(|state| state.name == *text),
            _ if value.is_nan() => continue,
            _ => states.last_mut().filter(|_| goes_on),
        };
        match same {
            Some(state) => {
                let n = state.frequencies.len() as f64;
                state.value += (value - state.value) / (n + 1.0);
                state.lines[1] = *line;
                state.frequencies.push(*frequency);
            }
            None => {
                states.push(State { name: text.clone(), value, lines: [*line; 2], frequencies: vec![*frequency] });
            }
        }
    }
    states.retain(State::is_sweep);
    states
}

/// Refuses a table with sweeps of several specimens, concentrations, temperatures or strains, as another column says.
///
/// # Errors
/// [`Error::Input`] with the states and their lines.
pub(super) fn refuse_labelled_states(
    place: &Path,
    bytes: &[u8],
    looked: &InspectedTable,
    columns: &[(SweepColumn, usize)],
) -> Result<()> {
    let Some((_, frequency)) = columns.first() else { return Ok(()) };
    let name = &looked.columns[*frequency];
    let is_shifted = called(name, &SHIFTED, &[]) || ["aT", "a_T"].iter().any(|symbol| name.contains(symbol));
    let others = (0..looked.columns.len()).filter(|other| columns.iter().all(|(_, used)| used != other));
    for column in others {
        let name = &looked.columns[column];
        let Some(kind) = StateKind::of(name).filter(|kind| *kind != StateKind::Temperature || !is_shifted) else {
            continue;
        };
        let states = states(kind, looked, &rows(bytes, looked, *frequency, column));
        let differ = |a: &State, b: &State| match kind {
            StateKind::Label => true,
            _ => (a.value - b.value).abs() > kind.tolerance(a.value, b.value),
        };
        // One sweep may have a strain for its low and one for its high frequencies.
        let is_apart = |a: &State, b: &State| differ(a, b) && (kind != StateKind::Strain || a.overlaps(b));
        let has_several = states.iter().enumerate().any(|(at, a)| states[..at].iter().any(|b| is_apart(a, b)));
        if has_several {
            let shown = states.iter().take(MOST_SHOWN).map(|state| {
                let value =
                    if kind == StateKind::Label { state.name.clone() } else { format_significant(state.value, 3) };
                format!("{value} in lines {} to {}", state.lines[0], state.lines[1])
            });
            let more = if states.len() > MOST_SHOWN { ", …" } else { "" };
            return Err(Error::input(
                InputPlace::file(place).at_key(name.as_str()),
                format!(
                    "these are several sweeps, of different values of this column: {}{more}",
                    shown.collect::<Vec<_>>().join(", ")
                ),
                "give a table with the rows of one of them",
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::table::{TableSettings, inspect_table};

    /// Text of the refusal of a table with the column `name`, whose cell in each of `n_rows` rows is that of a function of the row's number. The frequencies run through their
    /// range twice, on different grids.
    fn refusal(name: &str, n_rows: i32, cell: impl Fn(i32) -> String) -> Option<String> {
        let frequency =
            |row: i32| if row < n_rows / 2 { 1.3_f64.powi(row) } else { 1.1 * 1.3_f64.powi(row - n_rows / 2) };
        let rows: Vec<String> = (0..n_rows).map(|row| format!("{},{:.4},100,20", cell(row), frequency(row))).collect();
        of_text(&format!("{name},Frequency (Hz),G' (Pa),G'' (Pa)\n{}\n", rows.join("\n")))
    }

    fn of_text(text: &str) -> Option<String> {
        let looked = inspect_table("a.csv".as_ref(), text.as_bytes()).expect("a table");
        let columns = record::sweep_columns(&looked, &TableSettings::default()).expect("columns").expect("a sweep");
        refuse_labelled_states("a.csv".as_ref(), text.as_bytes(), &looked, &columns)
            .err()
            .map(|error| error.to_string())
    }

    #[test]
    fn states_of_several_sweeps_are_refused() {
        for (name, first, second) in [
            ("Sample", "A", "B"),
            ("Specimen ID", "1", "2"),
            ("Batch", "x", "y"),
            ("Concentration (mg/ml)", "5", "10"),
            ("Temperature (°C)", "25.02", "37.1"),
            ("T [°C]", "25", "37"),
            ("Temperatur [K]", "298.2", "310.1"),
            ("Strain (%)", "0.1", "1"),
        ] {
            let refused = refusal(name, 20, |row| if row < 10 { first } else { second }.into()).expect(name);
            assert!(refused.contains("lines 2 to 11") && refused.contains("lines 12 to 21"), "{name}: {refused}");
            assert_eq!(refusal(name, 20, |_| first.into()), None, "{name}");
        }
        // Merged cells of a workbook.
        let merged = |row: i32| match row {
            0 => "A".into(),
            10 => "B".into(),
            _ => String::new(),
        };
        assert!(refusal("Sample", 20, merged).is_some());
        // Specimens in turn.
        assert!(refusal("Sample", 20, |row| if row % 2 == 0 { "A" } else { "B" }.into()).is_some());
    }

    #[test]
    fn one_state_may_drift() {
        let drifts = |per_row: f64| move |row: i32| format!("{:.2}", 25.0 + per_row * f64::from(row));
        assert_eq!(refusal("Temperature (°C)", 20, drifts(0.03)), None);
        assert_eq!(refusal("Temperature (°C)", 20, drifts(-0.5)), None);
        let noisy = |row: i32| format!("{:.2}", 25.0 + if row % 2 == 0 { 0.3 } else { -0.3 });
        assert_eq!(refusal("Temperature (°C)", 20, noisy), None);
        // Numbers of rows, other columns, and a repeat.
        for name in ["Sample", "Point", "Sample time (s)", "Temps [min]", "Tempo (min)"] {
            assert_eq!(refusal(name, 20, |row| row.to_string()), None, "{name}");
        }
        assert_eq!(refusal("Repeat", 20, |row| (row / 10).to_string()), None);
        assert_eq!(refusal("Strain (%)", 20, |row| format!("{:.3}", 1.2_f64.powi(row))), None);
    }

    /// A sweep may lower its strain at high frequencies, and a master curve consists of several temperatures.
    #[test]
    fn a_sweep_may_have_several_strains_or_shifted_temperatures() {
        let table = |names: &str, first: &str, second: &str| {
            let row = |row: i32| {
                let value = if row < 10 { first } else { second };
                format!("{value},{:.4},100,20\n", 1.3_f64.powi(row))
            };
            format!("{names},G' (Pa),G'' (Pa)\n{}", (0..20).map(row).collect::<String>())
        };
        assert_eq!(of_text(&table("Strain (%),Frequency (Hz)", "10", "1")), None);
        assert!(of_text(&table("Temperature (°C),Frequency (Hz)", "25", "37")).is_some());
        let text = table("Temperature (°C),Reduced frequency (Hz)", "25", "37");
        let looked = inspect_table("a.csv".as_ref(), text.as_bytes()).expect("a table");
        let given = TableSettings { frequency: Some("2".into()), ..TableSettings::default() };
        let columns = record::sweep_columns(&looked, &given).expect("columns").expect("a sweep");
        assert!(refuse_labelled_states("a.csv".as_ref(), text.as_bytes(), &looked, &columns).is_ok());
    }
}
