//! Panels: sets of columns that describe a model's bias by time since the last force step, by cycle, by force and by other quantities.
//!
//! A column has one value per row of the record, at most 1 in size: its amplitude is the bias in metres where the value is 1. Columns along a motion have its sign, since
//! a bias that changes sign with the force cancels in a plain mean.

use super::rows::{ByCycle, Column, Columns, TestRows};
use record::Record;

/// A test of a comparison: columns that are tested together.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Stable name of the test.
    pub place: &'static str,
    /// Description of the columns, for figures.
    pub title: &'static str,
    /// True if positive biases point along the last force change instead of along the axis.
    pub is_along_force: bool,
    /// Columns of the test, with their labels and phrases.
    pub columns: Vec<Column>,
    /// Columns of the cycles, if the panel has one column per cycle.
    pub by_cycle: Option<ByCycle>,
}

impl Panel {
    /// Returns the values of the columns.
    pub fn values(&self) -> Columns {
        match &self.by_cycle {
            Some(by_cycle) => Columns { dense: Vec::new(), by_cycle: Some(by_cycle.clone()) },
            None => {
                let dense = self.columns.iter().map(|column| column.values.clone()).collect();
                Columns { dense, by_cycle: None }
            }
        }
    }
}

/// A test that is meaningless in an experiment, with the reason.
#[derive(Debug, Clone, PartialEq)]
pub struct OmittedTest {
    /// Stable name of the test.
    pub place: &'static str,
    /// Reason why the test is omitted.
    pub reason: &'static str,
}

const MOST_LAG_BINS: usize = 8;
const MOST_HARMONICS: usize = 6;
/// Largest difference of forces that belong to one level, as a fraction of the largest force; smaller forces count as none.
const LEVEL_TOLERANCE: f64 = 0.05;
const MOST_LEVELS: usize = 6;
/// Relative difference of cycle lengths above which the cycles have no common period.
const PERIOD_TOLERANCE: f64 = 0.02;

/// Name of a test with its panel, or with the reason why there is none.
type TestPanel = (&'static str, Result<Panel, &'static str>);

fn panel(place: &'static str, title: &'static str, is_along_force: bool, columns: Vec<Column>) -> TestPanel {
    let is_empty = columns.is_empty();
    let panel = Panel { place, title, is_along_force, columns, by_cycle: None };
    (place, if is_empty { Err("too few fitted positions for this test") } else { Ok(panel) })
}

/// Returns every panel that is meaningful in the experiment, and the omitted tests.
pub fn panels(rows: &TestRows) -> (Vec<Panel>, Vec<OmittedTest>) {
    let looks: [TestPanel; 12] = [
        input_correlation(rows),
        time_since_step(rows),
        cycle(rows),
        force_sign(rows),
        force_level(rows),
        position(rows),
        velocity(rows),
        loading(rows),
        superposition(rows),
        reversal(rows),
        trend(rows),
        harmonics(rows),
    ];
    let (mut panels, mut left_out) = (Vec::new(), Vec::new());
    for (place, look) in looks {
        match look {
            Ok(panel) => panels.push(panel),
            Err(reason) => left_out.push(OmittedTest { place, reason }),
        }
    }
    (panels, left_out)
}

const NO_STEPS: &str = "the force never steps";

fn seconds(value: f64) -> String {
    figures::number::format_significant(value, 2)
}

fn lag_column(ends: &[f64], k: usize, values: Vec<f64>) -> Column {
    let (from, to) = (if k == 0 { 0.0 } else { ends[k - 1] }, ends[k]);
    Column { label: seconds(to), phrase: lag_phrase([from, to]), lag_s: Some([from, to]), values }
}

/// Phrase for a range of times after a force step: "within 0.3 s after each force step", or its start and end.
pub fn lag_phrase([from, to]: [f64; 2]) -> String {
    match from {
        0.0 => format!("within {} s after each force step", seconds(to)),
        _ => format!("{} to {} s after each force step", seconds(from), seconds(to)),
    }
}

fn lag_bin(ends: &[f64], lag_s: f64) -> Option<usize> {
    let place = ends.partition_point(|end| *end < lag_s);
    (lag_s > 0.0 && place < ends.len()).then_some(place)
}

/// Tests the bias in the direction of every force change, large or small, by the time after it.
fn input_correlation(rows: &TestRows) -> TestPanel {
    let record = rows.record;
    let ends = rows.lag_ends_s(MOST_LAG_BINS);
    let changes: Vec<(f64, f64)> = (0..rows.n())
        .map(|row| (record.time_s[row], record.force_n[row] - record.previous_force_n(row)))
        .filter(|change| change.1 != 0.0)
        .collect();
    if ends.is_empty() || changes.is_empty() {
        return ("input_correlation", Err(NO_STEPS));
    }
    let columns = summed_by_lag(&record.time_s, &changes, &ends);
    let columns = columns.into_iter().enumerate().map(|(k, values)| lag_column(&ends, k, values)).collect();
    panel("input_correlation", "lag behind force changes (s)", true, rows.kept(columns))
}

/// Returns, for each bin of lags, the sum of earlier changes at each time in `time_s`. A change (time in s, size) counts if it precedes that time by a lag in the bin. Both ends
/// of a bin move with the times, so that every change enters and leaves each bin once.
fn summed_by_lag(time_s: &[f64], changes: &[(f64, f64)], ends: &[f64]) -> Vec<Vec<f64>> {
    let sums: Vec<f64> = std::iter::once(0.0)
        .chain(changes.iter().scan(0.0, |sum, change| {
            *sum += change.1;
            Some(*sum)
        }))
        .collect();
    let of_bin = |k: usize| {
        // A lag belongs to a bin, as in `lag_bin`, if it is above the previous bin's end and at most its own end.
        let (mut first, mut end) = (0, 0);
        let at = |time_s: &f64| {
            while first < changes.len() && time_s - changes[first].0 > ends[k] {
                first += 1;
            }
            let is_past = |lag_s: f64| if k == 0 { lag_s > 0.0 } else { lag_s > ends[k - 1] };
            while end < changes.len() && is_past(time_s - changes[end].0) {
                end += 1;
            }
            sums[end.max(first)] - sums[first]
        };
        time_s.iter().map(at).collect()
    };
    (0..ends.len()).map(of_bin).collect()
}

fn time_since_step(rows: &TestRows) -> TestPanel {
    let ends = rows.lag_ends_s(MOST_LAG_BINS);
    if ends.is_empty() {
        return ("time_since_step", Err(NO_STEPS));
    }
    let value = |k: usize, row: usize| match rows.since_step[row] {
        Some((lag_s, size)) if lag_bin(&ends, lag_s) == Some(k) => size.signum(),
        _ => 0.0,
    };
    let columns =
        (0..ends.len()).map(|k| lag_column(&ends, k, (0..rows.n()).map(|row| value(k, row)).collect())).collect();
    panel("time_since_step", "time since the last force step (s)", true, rows.kept(columns))
}

fn cycle(rows: &TestRows) -> TestPanel {
    let (cycles, by_cycle) = rows.by_cycle();
    if cycles.len() < 2 {
        return ("cycle", Err("only one cycle is fitted"));
    }
    let with_column = cycles.iter().zip(&by_cycle.has_column).filter(|(_, has_column)| **has_column);
    let named = |(cycle, _): (&u32, &bool)| {
        let (label, phrase) = (cycle.to_string(), format!("in cycle {cycle}"));
        Column { label, phrase, lag_s: None, values: Vec::new() }
    };
    let (place, look) = panel("cycle", "cycle", false, with_column.map(named).collect());
    (place, look.map(|panel| Panel { by_cycle: Some(by_cycle), ..panel }))
}

/// Sign of the force at a row: −1, 0 or 1.
fn sign_of_force(rows: &TestRows, row: usize) -> f64 {
    let force = rows.acting_n[row];
    if force.abs() < LEVEL_TOLERANCE * rows.largest_n { 0.0 } else { force.signum() }
}

fn has_sign(rows: &TestRows, sign: f64) -> bool {
    rows.fitted_rows().any(|row| sign_of_force(rows, row) == sign)
}

fn force_sign(rows: &TestRows) -> TestPanel {
    let named =
        [(1.0, "+", "while the force is positive"), (0.0, "0", "at rest"), (-1.0, "−", "while the force is negative")];
    let there: Vec<_> = named.into_iter().filter(|(sign, ..)| has_sign(rows, *sign)).collect();
    if there.len() < 2 {
        return ("force_sign", Err("the force has one sign and never rests"));
    }
    let of = |(sign, label, phrase): &(f64, &str, &str)| {
        rows.column((*label).into(), (*phrase).into(), |row| f64::from(u8::from(sign_of_force(rows, row) == *sign)))
    };
    panel("force_sign", "sign of the force", false, rows.kept(there.iter().map(of).collect()))
}

/// Lower and upper ends of the groups of force levels, as fractions of the largest force. Forces below [`LEVEL_TOLERANCE`] are left out.
fn levels(rows: &TestRows) -> Vec<[f64; 2]> {
    let mut sizes: Vec<f64> = rows
        .fitted_rows()
        .map(|row| rows.acting_n[row].abs() / rows.largest_n)
        .filter(|size| *size >= LEVEL_TOLERANCE)
        .collect();
    sizes.sort_by(f64::total_cmp);
    let mut levels: Vec<[f64; 2]> = Vec::new();
    for size in sizes {
        match levels.last_mut() {
            Some(level) if size - level[1] < LEVEL_TOLERANCE => level[1] = size,
            _ => levels.push([size, size]),
        }
    }
    let is_continuous = levels.len() > MOST_LEVELS || levels.iter().any(|[low, high]| high - low > 0.3);
    if is_continuous {
        let ends = |k: u32| [0.2 * f64::from(k) + if k == 0 { LEVEL_TOLERANCE } else { 1e-9 }, 0.2 * f64::from(k + 1)];
        return (0..5).map(ends).collect();
    }
    levels
}

const ONE_LEVEL: &str = "the force has one level";

fn force_level(rows: &TestRows) -> TestPanel {
    let levels = levels(rows);
    if levels.len() < 2 {
        return ("force_level", Err(ONE_LEVEL));
    }
    let of = |[low, high]: &[f64; 2]| {
        let percent = format!("{:.0} %", 50.0 * (low + high));
        let phrase = format!("along the force where it is {percent} of the largest");
        rows.column(percent, phrase, |row| {
            let size = rows.acting_n[row].abs() / rows.largest_n;
            if size >= *low && size <= *high { sign_of_force(rows, row) } else { 0.0 }
        })
    };
    panel("force_level", "force over the largest", true, rows.kept(levels.iter().map(of).collect()))
}

fn position(rows: &TestRows) -> TestPanel {
    let say = |low: f64, high: f64| {
        let [low, middle, high] =
            [low, 0.5 * (low + high), high].map(|x| figures::number::format_significant(1e6 * x, 3));
        (middle, format!("where the bead is between {low} and {high} µm"))
    };
    panel("position", "position (µm)", false, rows.quantile_bins(rows.position_m, say))
}

fn velocity(rows: &TestRows) -> TestPanel {
    let time_s = &rows.record.time_s;
    let speed = |row: usize| if row == 0 { 0.0 } else { rows.moved_m[row] / (time_s[row] - time_s[row - 1]) };
    let speeds: Vec<f64> = (0..rows.n()).map(speed).collect();
    let say = |low: f64, high: f64| {
        let [low, middle, high] =
            [low, 0.5 * (low + high), high].map(|v| figures::number::format_significant(1e6 * v, 2));
        (middle, format!("where the bead moves at {low} to {high} µm/s"))
    };
    panel("velocity", "velocity (µm/s)", false, rows.quantile_bins(&speeds, say))
}

fn loading(rows: &TestRows) -> TestPanel {
    let is_loading = |row: usize| rows.moved_m[row] * rows.position_m[row] > 0.0;
    let of = |(loads, label, phrase): (bool, &str, &str)| {
        rows.column(label.into(), phrase.into(), |row| {
            if is_loading(row) == loads { rows.moved_m[row].signum() } else { 0.0 }
        })
    };
    let both = [
        (true, "loading", "along the motion while the bead moves away from rest"),
        (false, "recovery", "along the motion while the bead comes back"),
    ];
    panel("loading", "loading or recovery", true, rows.kept(both.map(of).into()))
}

/// Tests whether the response is proportional to the force.
fn superposition(rows: &TestRows) -> TestPanel {
    let ends = rows.lag_ends_s(2);
    if levels(rows).len() < 2 || ends.len() < 2 {
        return ("superposition", Err(ONE_LEVEL));
    }
    let mut columns = vec![rows.column(
        "scale".into(),
        "in proportion to force times position: the response does not scale with the force".into(),
        |row| rows.position_m[row] * rows.acting_n[row].abs(),
    )];
    for (k, (label, when)) in [("early", "soon after"), ("late", "long after")].into_iter().enumerate() {
        let phrase = format!("{when} large force steps, beyond the bias after small ones");
        columns.push(rows.column(label.into(), phrase, |row| match rows.since_step[row] {
            Some((lag_s, size)) if lag_bin(&ends, lag_s) == Some(k) => size * size.abs(),
            _ => 0.0,
        }));
    }
    panel("superposition", "scaling with the force", true, rows.kept(columns))
}

/// Tests the part of the bias that does not change sign with the force.
fn reversal(rows: &TestRows) -> TestPanel {
    if !(has_sign(rows, 1.0) && has_sign(rows, -1.0)) {
        return ("reversal", Err("the force has one sign"));
    }
    let ends = rows.lag_ends_s(4);
    let column = |k: usize| {
        let is_in = |row: usize| {
            let bin = rows.since_step[row].and_then(|(lag_s, _)| lag_bin(&ends, lag_s));
            bin == Some(k) && sign_of_force(rows, row) != 0.0
        };
        let values = (0..rows.n()).map(|row| f64::from(u8::from(is_in(row)))).collect();
        let column = lag_column(&ends, k, values);
        Column { phrase: format!("{}, in one direction for either sign of the force", column.phrase), ..column }
    };
    panel("reversal", "even part: time since the step (s)", false, rows.kept((0..ends.len()).map(column).collect()))
}

fn trend(rows: &TestRows) -> TestPanel {
    let times: Vec<f64> = rows.fitted_rows().map(|row| rows.record.time_s[row]).collect();
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return ("trend", Err("no position is fitted"));
    };
    let middle = 0.5 * (first + last);
    let unit = |row: usize| (rows.record.time_s[row] - middle) / (last - middle);
    let columns = vec![
        rows.column("drift".into(), "as a drift from the record's middle to its ends".into(), unit),
        rows.column("curve".into(), "as a slow curve over the record".into(), |row| unit(row).powi(2) - 1.0 / 3.0),
        rows.column("growth".into(), "as a response that changes from cycle to cycle".into(), |row| {
            unit(row) * rows.position_m[row]
        }),
    ];
    panel("trend", "trend over cycles", false, rows.kept(columns))
}

/// Start and end time (s) of every cycle; a cycle lasts until the next begins.
fn spans_s(record: &Record) -> Vec<[f64; 2]> {
    let starts: Vec<f64> = (0..record.n_rows())
        .filter(|row| *row == 0 || record.cycle[*row] != record.cycle[row - 1])
        .map(|row| record.time_s[row])
        .collect();
    let interval_s = record.median_interval_s().unwrap_or(0.0);
    let end_s = record.time_s.last().map_or(0.0, |last| last + interval_s);
    let ends = starts.iter().skip(1).copied().chain([end_s]);
    starts.iter().zip(ends).map(|(start, end)| [*start, end]).collect()
}

fn harmonics(rows: &TestRows) -> TestPanel {
    let spans = spans_s(rows.record);
    let lengths: Vec<f64> = spans.iter().map(|[start, end]| end - start).collect();
    let mean_s = lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
    if lengths.len() < 2 || lengths.iter().any(|length| (length / mean_s - 1.0).abs() > PERIOD_TOLERANCE) {
        return ("harmonics", Err("the force has no period"));
    }
    let most = ((mean_s / (4.0 * rows.interval_s)) as usize).clamp(1, MOST_HARMONICS);
    let phase = |row: usize| {
        let time_s = rows.record.time_s[row];
        let place = spans.partition_point(|[start, _]| *start <= time_s).max(1) - 1;
        std::f64::consts::TAU * (time_s - spans[place][0]) / mean_s
    };
    let mut columns = Vec::new();
    for k in 1..=most {
        let hertz = figures::number::format_significant(k as f64 / mean_s, 2);
        let phrase = format!("at {hertz} Hz, harmonic {k} of the force");
        columns.push(rows.column(k.to_string(), phrase.clone(), |row| (k as f64 * phase(row)).cos()));
        columns.push(rows.column(k.to_string(), phrase, |row| (k as f64 * phase(row)).sin()));
    }
    panel("harmonics", "harmonic of the force: amplitude", false, rows.kept(columns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sampling::ensemble::RandomStream;

    /// The result equals the sum over all pairs of a time and a change. The times are uneven, and two of three have a change.
    #[test]
    fn sums_by_lag_are_those_over_all_pairs() {
        let mut stream = RandomStream::new(9, 1);
        let mut now_s = 0.0;
        let time_s: Vec<f64> = (0..400)
            .map(|_| {
                now_s += 0.2 * stream.unit();
                now_s
            })
            .collect();
        let changes: Vec<(f64, f64)> =
            time_s.iter().enumerate().filter(|(row, _)| row % 3 != 1).map(|(_, t)| (*t, stream.normal())).collect();
        let ends = [0.1, 0.35, 1.0, 4.0];
        let sums = summed_by_lag(&time_s, &changes, &ends);
        for (row, t) in time_s.iter().enumerate() {
            let mut exact = [0.0; 4];
            for (at_s, change) in &changes {
                if let Some(bin) = lag_bin(&ends, t - at_s) {
                    exact[bin] += change;
                }
            }
            for (k, exact) in exact.iter().enumerate() {
                assert!((sums[k][row] - exact).abs() < 1e-12, "{} {exact}", sums[k][row]);
            }
        }
    }

    /// A record has 20,000 rows in 2,000 cycles. All tests together keep some dozens of numbers per row, for any number of cycles. One column over all rows for each
    /// cycle would need 2,000 numbers per row.
    #[test]
    fn columns_of_many_cycles_are_one_number_a_row() {
        let n = 20_000;
        let record = Record {
            time_s: (0..n).map(|row| 0.2 * row as f64).collect(),
            force_n: (0..n).map(|row: usize| if row % 10 < 5 { 4.6e-6 } else { -4.6e-6 }).collect(),
            position_m: vec![Some(0.0); n],
            cycle: (0..n).map(|row| 1 + (row / 10) as u32).collect(),
            ..Record::default()
        };
        let position_m: Vec<f64> = (0..n).map(|row| 1e-4 * (0.6 * row as f64).sin()).collect();
        let is_fitted = record.cycle.iter().map(|cycle| *cycle < 2_000 && *cycle != 7).collect();
        let (panels, _) = panels(&TestRows::new(&record, &position_m, is_fitted));
        let cycles = panels.iter().find(|panel| panel.place == "cycle").expect("many cycles");
        assert_eq!(cycles.columns.len(), 1_998);
        let kept: usize = panels.iter().map(|panel| panel.values().dense.iter().map(Vec::len).sum::<usize>()).sum();
        assert!(kept < 80 * n, "{kept}");
        let by_cycle = cycles.values().by_cycle.expect("a column a cycle");
        assert_eq!((by_cycle.place[59], by_cycle.place[60], by_cycle.place[70]), (Some(5), None, Some(6)));
    }
}
