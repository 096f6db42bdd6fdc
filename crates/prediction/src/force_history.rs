//! Commanded force of a scenario, and the rows at which a trajectory is predicted.

use std::path::Path;

use base::error::{Error, InputPlace, Result};
use base::files::{self, Content};
use base::toml_input::TomlTable;
use record::table::{Decimal, Delimiter, cells, decode_detected};
use record::{ForceRule, Record};

/// Number of evenly spaced rows of a prediction, besides the changes of the force.
const N_ROWS: usize = 400;
/// Number of rows in one period of a sine. The straight lines between rows then deviate by less than 10⁻⁵ of the amplitude.
const ROWS_A_PERIOD: f64 = 720.0;
/// Number of rows up to which a sine of many periods has as many in each. Together with the rows after changes, all draws of a prediction have room for them.
const ROWS_OF_SINE: f64 = 1_600.0;
/// Smallest number of rows in one period of a longer sine. The straight lines between rows then deviate by less than 10⁻³ of the amplitude.
const FEWEST_ROWS_A_PERIOD: f64 = 80.0;
/// Number of rows per decade of the time since a change of the force, as long as there are few changes. Creep is smooth in the logarithm of this time.
const ROWS_A_DECADE: usize = 40;
/// Number of decades of the time since a change that have rows of their own.
const DECADES: usize = 6;
/// Largest number of rows after all changes together.
const MOST_ROWS_AFTER_CHANGES: usize = 4_000;
/// Largest number of rows of a prediction.
const MOST_ROWS: usize = 20_000;
/// Largest absolute force in N, far above any microrobot's.
const LARGEST_N: f64 = 1e3;
const UN_PER_N: f64 = 1e6;
/// Headers of a table of the force. `plan` writes the second one for a given magnetic moment; the gradient is not read.
const HEADERS: [&str; 2] = ["time_s,force_un", "time_s,force_un,gradient_t_per_m"];
/// Characters that may separate the cells of such a table.
const DELIMITERS: [Delimiter; 3] = [Delimiter::Comma, Delimiter::Semicolon, Delimiter::Tab];
/// Example of a force in a scenario, for errors.
const EXAMPLE: &str = "force = { steps_un = [[0, 20], [5, 0]] }";

/// Commanded force over time.
#[derive(Debug, Clone, PartialEq)]
pub enum ForceHistory {
    /// Values in N, each from its time (s) until the next.
    Steps(Vec<[f64; 2]>),
    /// Constant rate in N/s from time 0.
    Ramp {
        /// Change of the force per time, in N/s.
        rate_n_per_s: f64,
    },
    /// Sine from time 0.
    Sine {
        /// Amplitude in N.
        amplitude_n: f64,
        /// Frequency in Hz.
        frequency_hz: f64,
    },
}

impl ForceHistory {
    /// Reads `force = { … }` of a scenario. Names of files are relative to `folder`.
    ///
    /// # Errors
    /// [`Error::Input`] with the place if the force is described wrongly or in two ways.
    pub fn read(table: TomlTable<'_>, folder: &Path) -> Result<Self> {
        table.only(&["file", "steps_un", "ramp_un_per_s", "sine_un", "frequency_hz"])?;
        let kinds = ["file", "steps_un", "ramp_un_per_s", "sine_un"];
        let given: Vec<&str> = kinds.into_iter().filter(|kind| table.has(kind)).collect();
        let [kind] = given[..] else {
            let found = format!("the force is described in {} ways, by {}", given.len(), given.join(" and "));
            return Err(table.refuse_whole(found, format!("describe it in one way, as in `{EXAMPLE}`")));
        };
        if kind != "sine_un" && table.has("frequency_hz") {
            return Err(table.refuse("frequency_hz", "only a sine has a frequency", "remove it, or give `sine_un`"));
        }
        match kind {
            "file" => Self::from_file(&folder.join(table.required_text("file", "file = \"force.csv\"")?)),
            "steps_un" => {
                let steps = table.pairs("steps_un")?.unwrap_or_default();
                let steps: Vec<[f64; 2]> = steps.iter().map(|[time_s, un]| [*time_s, un / UN_PER_N]).collect();
                if let Some(fault) = fault(&steps) {
                    let remedy = "write pairs of time in s and force in µN in the order of time, as in `steps_un = [[0, 20], [5, 0]]`";
                    return Err(table.refuse("steps_un", fault, remedy));
                }
                Ok(Self::Steps(steps))
            }
            "ramp_un_per_s" => {
                let rate = table.required_number(kind, "ramp_un_per_s = 2")?;
                let largest = LARGEST_N * UN_PER_N;
                Ok(Self::Ramp { rate_n_per_s: table.require_range(kind, rate, [-largest, largest])? / UN_PER_N })
            }
            _ => Ok(Self::Sine {
                amplitude_n: {
                    let largest = LARGEST_N * UN_PER_N;
                    let amplitude = table.required_number(kind, "sine_un = 20")?;
                    table.require_range(kind, amplitude, [-largest, largest])? / UN_PER_N
                },
                frequency_hz: table.required_within("frequency_hz", "frequency_hz = 0.5", [1e-6, 1e4])?,
            }),
        }
    }

    /// Reads a table of time in s and force in µN with the header `time_s,force_un`. Each value holds until the next row. Semicolons or tabs may separate the cells;
    /// numbers may then have decimal commas.
    ///
    /// # Errors
    /// [`Error::Input`] with the line if a row has other cells than the header, a cell is not a number or the times do not ascend.
    pub fn from_file(path: &Path) -> Result<Self> {
        let bytes = files::read(path, Content::Table, "check the path of the force's table")?;
        let text = decode_detected(&bytes);
        let refuse = |line: usize, found: String, remedy: &str| {
            Err(Error::input(InputPlace::file(path).at_line(line), found, remedy))
        };
        let remedy = "write the header `time_s,force_un`, then one row for each change of the force (µN), in the order of time (s)";
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
        let header = lines.next().map_or("", |(_, line)| line.trim());
        let is_header =
            |delimiter: &Delimiter| HEADERS.contains(&cells(header, *delimiter).join(",").replace("uN", "un").as_str());
        let Some(delimiter) = DELIMITERS.into_iter().find(is_header) else {
            return refuse(1, format!("the header is `{header}`"), remedy);
        };
        let n_cells = cells(header, delimiter).len();
        let rows: Vec<(usize, &str)> = lines.collect();
        let has_commas = delimiter != Delimiter::Comma && rows.iter().any(|(_, line)| line.contains(','));
        let decimal = if has_commas { Decimal::Comma } else { Decimal::Point };
        let mut steps: Vec<[f64; 2]> = Vec::new();
        for (index, line) in rows {
            let mut row = cells(line, delimiter);
            // Spreadsheets write delimiters behind the last cell.
            while row.len() > n_cells && row.last().is_some_and(|cell| cell.trim().is_empty()) {
                row.pop();
            }
            if row.len() != n_cells {
                let found = format!("`{}` has {} cells, and the header has {n_cells}", line.trim(), row.len());
                let remedy = "give every row the cells of the header, with decimal points; for decimal commas, separate the cells by `;`";
                return refuse(index + 1, found, remedy);
            }
            let (Some(time_s), Some(un)) = (decimal.number(&row[0]), decimal.number(&row[1])) else {
                return refuse(index + 1, format!("`{}` is not a time and a force", line.trim()), remedy);
            };
            steps.push([time_s, un / UN_PER_N]);
            if let Some(fault) = fault(&steps) {
                return refuse(index + 1, fault, remedy);
            }
        }
        if steps.is_empty() { refuse(2, "the table has no rows".into(), remedy) } else { Ok(Self::Steps(steps)) }
    }

    /// Time of the last value, in s; 0 for a ramp or sine.
    pub fn last_change_s(&self) -> f64 {
        match self {
            Self::Steps(values) => values.last().map_or(0.0, |[time_s, _]| *time_s),
            Self::Ramp { .. } | Self::Sine { .. } => 0.0,
        }
    }

    /// Record of this force until `duration_s`, without measured positions. Its rows are evenly spaced; the changes of the force and the times
    /// `also_s` are rows, too.
    ///
    /// # Errors
    /// [`Error::Input`] if the force changes too often.
    pub fn record(&self, duration_s: f64, also_s: &[f64]) -> Result<Record> {
        let n_even = match self {
            Self::Sine { frequency_hz, .. } => {
                let periods = frequency_hz * duration_s;
                let least = FEWEST_ROWS_A_PERIOD * periods;
                N_ROWS.max((ROWS_A_PERIOD * periods).min(least.max(ROWS_OF_SINE)).ceil() as usize)
            }
            _ => N_ROWS,
        };
        let changes_s: Vec<f64> = match self {
            Self::Steps(values) => values.iter().map(|[time_s, _]| *time_s).collect(),
            Self::Ramp { .. } | Self::Sine { .. } => Vec::new(),
        };
        if n_even + changes_s.len() > MOST_ROWS {
            return Err(Error::input(
                InputPlace::default().at_key("force"),
                format!("the prediction would need {} times", n_even + changes_s.len()),
                format!("shorten it, or lower the frequency: the limit is {MOST_ROWS} times"),
            ));
        }
        let even = (0..=n_even).map(|row| duration_s * row as f64 / n_even as f64);
        let after_changes = rows_after_changes(&changes_s, duration_s);
        Ok(self
            .record_at(even.chain(changes_s).chain(after_changes).chain(also_s.iter().copied()).collect(), duration_s))
    }

    /// Rows at given times (s) between 0 and the duration (s). A force that changes in steps needs a row at each change.
    pub fn record_at(&self, mut time_s: Vec<f64>, duration_s: f64) -> Record {
        time_s.retain(|time| (0.0..=duration_s).contains(time));
        time_s.sort_by(f64::total_cmp);
        let closest_s = 1e-12 * duration_s;
        time_s.dedup_by(|later, earlier| *later - *earlier < closest_s);
        let force_n = time_s.iter().map(|time_s| self.at_n(*time_s + 0.5 * closest_s)).collect();
        let (n, force_rule) =
            (time_s.len(), if let Self::Steps(_) = self { ForceRule::Hold } else { ForceRule::Linear });
        Record { time_s, force_n, position_m: vec![None; n], cycle: vec![1; n], force_rule, force_rows: Vec::new() }
    }

    /// Largest deviation of the straight lines between the rows of a sine from the sine itself, as a fraction of its amplitude; 0 for a record of steps and for ramps.
    pub fn line_error(&self, record: &Record) -> f64 {
        match self {
            Self::Sine { frequency_hz, .. } if record.force_rule == ForceRule::Linear => {
                let longest_s = record.time_s.windows(2).fold(0.0_f64, |most, pair| most.max(pair[1] - pair[0]));
                (std::f64::consts::TAU * frequency_hz * longest_s).powi(2) / 8.0
            }
            _ => 0.0,
        }
    }

    /// Force (N) at a time (s).
    fn at_n(&self, time_s: f64) -> f64 {
        match self {
            Self::Steps(values) => values.iter().rev().find(|[from_s, _]| *from_s <= time_s).map_or(0.0, |[_, n]| *n),
            Self::Ramp { rate_n_per_s } => rate_n_per_s * time_s,
            Self::Sine { amplitude_n, frequency_hz } => {
                amplitude_n * (2.0 * std::f64::consts::PI * frequency_hz * time_s).sin()
            }
        }
    }
}

/// Times (s) at equal distances in the logarithm of the time since each change, or since time 0, until the next change.
fn rows_after_changes(changes_s: &[f64], duration_s: f64) -> Vec<f64> {
    let mut begins: Vec<f64> = std::iter::once(0.0).chain(changes_s.iter().copied()).collect();
    begins.dedup();
    let a_decade = ROWS_A_DECADE.min(MOST_ROWS_AFTER_CHANGES / DECADES / begins.len());
    if a_decade == 0 {
        return Vec::new();
    }
    let mut list = Vec::new();
    for (k, begin_s) in begins.iter().enumerate() {
        let length_s = begins.get(k + 1).map_or(duration_s, |next| next.min(duration_s)) - begin_s;
        let share = |row: usize| 10_f64.powf(-(row as f64) / a_decade as f64);
        list.extend((1..DECADES * a_decade).map(|row| begin_s + length_s * share(row)));
    }
    list
}

/// Fault of a list of times and forces, in words; `None` if there is none.
fn fault(steps: &[[f64; 2]]) -> Option<String> {
    if steps.is_empty() {
        return Some("the list is empty".into());
    }
    if let Some([time_s, _]) = steps.iter().find(|[time_s, n]| !(time_s.is_finite() && n.is_finite() && *time_s >= 0.0))
    {
        return Some(format!("the time {time_s} s is negative, or a value is not finite"));
    }
    if let Some([_, n]) = steps.iter().find(|[_, n]| n.abs() > LARGEST_N) {
        return Some(format!("a force of {:e} µN is beyond any actuator", UN_PER_N * n));
    }
    let pair = steps.windows(2).find(|pair| pair[0][0] >= pair[1][0])?;
    Some(format!("the time {} s follows {} s", pair[1][0], pair[0][0]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::toml_input::TomlInput;

    fn read(text: &str) -> Result<ForceHistory> {
        let document = TomlInput::parse(Path::new("scenario.toml"), text).expect("TOML");
        ForceHistory::read(document.root().required_table("force").expect("a force"), Path::new("."))
    }

    #[test]
    fn steps_ramp_and_sine_give_the_written_force() {
        let steps = read("force = { steps_un = [[0, 20], [5, -10]] }").expect("steps");
        let record = steps.record(8.0, &[6.789]).expect("a record");
        assert!(record.time_s.contains(&6.789) && record.time_s.contains(&5.0));
        for (time_s, force_n) in record.time_s.iter().zip(&record.force_n) {
            let expected = if *time_s < 5.0 { 20e-6 } else { -10e-6 };
            assert!((force_n - expected).abs() < 1e-18, "{time_s} s: {force_n} N");
        }
        let ramp = read("force = { ramp_un_per_s = 2 }").expect("a ramp").record(10.0, &[]).expect("a record");
        assert!((ramp.force_n.last().expect("rows") - 20e-6).abs() < 1e-13 && ramp.force_rule == ForceRule::Linear);
        let sine =
            read("force = { sine_un = 3, frequency_hz = 2 }").expect("a sine").record(20.0, &[]).expect("a record");
        assert!(sine.n_rows() as f64 >= FEWEST_ROWS_A_PERIOD * 40.0);
        let largest = sine.force_n.iter().fold(0.0_f64, |most, force| most.max(force.abs()));
        assert!((largest - 3e-6).abs() < 1e-9, "{largest}");
    }

    /// Closed form of the creep compliance 0.3 + 0.7 (1 − exp(−t/τ)): of one period the error is below 10⁻⁵ of the amplitude, of forty it is below the stated one.
    #[test]
    fn a_sine_moves_a_linear_law_as_its_closed_form_does() {
        let tau_s = 0.2_f64;
        let error = |force: &ForceHistory, frequency_hz: f64, duration_s: f64| {
            let record = force.record(duration_s, &[]).expect("a record");
            let omega = std::f64::consts::TAU * frequency_hz;
            let exact = |t: f64| {
                let phase = omega * t;
                let decay = omega * tau_s * (-t / tau_s).exp();
                let delayed = (phase.sin() - omega * tau_s * phase.cos() + decay) / (1.0 + (omega * tau_s).powi(2));
                0.3 * phase.sin() + 0.7 * delayed
            };
            let (mut delayed, mut most) = (0.0, 0.0_f64);
            for row in 1..record.n_rows() {
                let [before, after] = [row - 1, row].map(|row| record.force_n[row] / 3e-6);
                let interval_s = record.time_s[row] - record.time_s[row - 1];
                let lag = (after - before) / interval_s * tau_s;
                // Exact under a force that is linear between the rows.
                delayed = after - lag + (delayed - before + lag) * (-interval_s / tau_s).exp();
                most = most.max((0.3 * after + 0.7 * delayed - exact(record.time_s[row])).abs());
            }
            (most, force.line_error(&record))
        };
        let sine = read("force = { sine_un = 3, frequency_hz = 2 }").expect("a sine");
        let (found, stated) = error(&sine, 2.0, 0.5);
        assert!(found < 1e-5 && found < stated && stated < 1e-5, "{found} {stated}");
        let (found, stated) = error(&sine, 2.0, 20.0);
        assert!(found < stated && (1e-4..1e-3).contains(&stated), "{found} {stated}");
        let steps = ForceHistory::Steps(vec![[0.0, 1e-6]]).record(5.0, &[]).expect("a record");
        assert_eq!(sine.line_error(&steps), 0.0);
    }

    #[test]
    fn wrong_forces_are_refused_with_their_key() {
        let refusal = |text: &str| read(text).expect_err("a refusal").to_string();
        assert!(refusal("force = { steps_un = [[5, 1], [0, 2]] }").contains("0 s follows 5 s"));
        assert!(refusal("force = { steps_un = [] }").contains("empty"));
        assert!(refusal("force = { steps_un = [[0, 1]], sine_un = 3 }").contains("steps_un and sine_un"));
        assert!(refusal("force = { sine_un = 3 }").contains("frequency_hz"));
        assert!(refusal("force = { step_un = [[0, 1]] }").contains("steps_un"));
    }

    #[test]
    fn a_file_of_the_force_is_read_or_refused_with_its_line() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("force.csv");
        std::fs::write(&path, "time_s,force_uN\n0,20\n5,0\n").expect("a file");
        assert_eq!(
            ForceHistory::from_file(&path).expect("a force"),
            ForceHistory::Steps(vec![[0.0, 2e-5], [5.0, 0.0]])
        );
        std::fs::write(&path, "time_s,force_un\n0,20\nx,0\n").expect("a file");
        assert!(ForceHistory::from_file(&path).expect_err("a refusal").to_string().contains("line 3"));
    }

    /// Decimal commas are read between semicolons. Between commas they would be cells of their own: `0,5,4,6` is neither 0 s and 5 µN nor 0.5 s and 4.6 µN.
    #[test]
    fn decimal_commas_are_read_or_refused() {
        let dir = tempfile::tempdir().expect("a directory");
        let read = |text: &str| {
            let path = dir.path().join("force.csv");
            std::fs::write(&path, text).expect("a file");
            ForceHistory::from_file(&path)
        };
        let refusal = |text: &str| read(text).expect_err("a refusal").to_string();
        let found = refusal("time_s,force_un\n0,0\n0,5,4,6\n");
        assert!(found.contains("line 3") && found.contains("`0,5,4,6` has 4 cells, and the header has 2"), "{found}");
        assert!(found.contains("decimal commas"), "{found}");
        assert!(refusal("time_s,force_un,gradient_t_per_m\n0,5\n").contains("has 2 cells, and the header has 3"));
        let expected = ForceHistory::Steps(vec![[0.5, 4.6 / UN_PER_N], [2.0, 0.0]]);
        assert_eq!(read("time_s;force_un\n0,5;4,6\n2;0\n").expect("a force"), expected);
        assert_eq!(read("time_s;force_un\n0.5;4.6\n2;0\n").expect("a force"), expected);
        assert_eq!(read("time_s\tforce_un\n0.5\t4.6\n2\t0\n").expect("a force"), expected);
        // One table has one decimal sign.
        assert!(refusal("time_s;force_un\n0.5;4,6\n").contains("line 2"));
    }
}
