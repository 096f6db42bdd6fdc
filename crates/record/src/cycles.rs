//! Search for cycles in the force's repetition, for records without a `cycle` column.
//!
//! Force steps are changes above 20 % of the force's range. They divide the record into *holds*. A cycle is the shortest sequence of holds that
//! repeats in level, direction and duration. If the levels drift too much, only direction and duration must repeat. If the holds do not repeat, the
//! force is compared with itself at increasing lags instead. Examples are a sine, a slow ramp up and down, and changes so close to 20 % that only
//! some of them count as steps.

use super::notes::Note;
use super::record::Record;
use super::robust::median;

/// Largest difference of the levels of two holds that count as equal, as a fraction of the force's range. Larger changes are force steps.
const LEVEL_TOLERANCE: f64 = 0.2;
/// Largest difference of the durations of two holds that count as equal, as a fraction of the longer duration. The row spacing at both ends of the
/// holds is added to it.
const DURATION_TOLERANCE: f64 = 0.15;
/// Largest force of a hold that counts as a rest, as a fraction of the force's range.
const REST_TOLERANCE: f64 = 0.05;
/// Number of points in time at which a force without repeating holds is compared with itself.
const LAG_GRID: usize = 2000;
/// Largest mean squared difference of the force from itself at a lag at which it repeats, as a fraction of twice its variance.
const LAG_TOLERANCE: f64 = 0.05;

/// Cycle numbers of a record's rows, with a description of the repetition.
pub(super) struct DetectedCycles {
    /// Cycle number of each row, counted from 1.
    pub cycle: Vec<u32>,
    period_s: Option<f64>,
    text: String,
}

impl DetectedCycles {
    /// Returns the note to the user on the cycles that were found.
    pub(super) fn note(&self) -> Note {
        let n_cycles = self.cycle.last().copied().unwrap_or(1);
        Note::CyclesFound { n_cycles, period_s: self.period_s, text: self.text.clone() }
    }
}

/// Stretch of the record between two force steps, with its level and duration.
struct Hold {
    first_row: usize,
    duration_s: f64,
    level_n: f64,
    /// Sign of the force step at which the hold begins; 0 if it begins without a step.
    direction: i8,
    /// Uncertainty of the duration due to the row spacing at both ends, in s.
    open_s: f64,
}

/// Repetition of holds: from index `first` on, every `length` consecutive holds form one cycle.
struct Repetition {
    first: usize,
    length: usize,
    levels_agree: bool,
}

/// Finds the cycles of a record from its force. Existing cycle numbers are ignored.
pub(super) fn find_cycles(record: &Record) -> DetectedCycles {
    let holds = holds_of(record);
    if let Some(repetition) = find_repetition(&holds, record.force_range_n()) {
        return from_repetition(record, &holds, &repetition);
    }
    if let Some(period_s) = repeating_lag_s(record) {
        return from_period(record, period_s);
    }
    let text = format!(
        "there is no `cycle` column and the force does not repeat ({} steps): the whole record is one cycle",
        holds.len().saturating_sub(1)
    );
    DetectedCycles { cycle: vec![1; record.n_rows()], period_s: None, text }
}

fn holds_of(record: &Record) -> Vec<Hold> {
    let n_rows = record.n_rows();
    let step_rows = record.force_step_rows();
    let rise = |row: usize| record.force_n[row] - if row == 0 { 0.0 } else { record.force_n[row - 1] };
    let mut starts = vec![0];
    for &row in step_rows.iter().filter(|row| **row > 0) {
        // A step that a sampled ramp spreads over neighbouring rows counts as one step.
        let continues = row >= 2 && step_rows.binary_search(&(row - 1)).is_ok() && rise(row) * rise(row - 1) > 0.0;
        // A step in the last row begins a hold that the record does not contain.
        if !continues && row + 1 < n_rows {
            starts.push(row);
        }
    }
    let end_s = |row: usize| record.time_s.get(row).copied().unwrap_or(record.time_s[n_rows - 1]);
    let rest_n = REST_TOLERANCE * record.force_range_n();
    let before_s =
        |row: usize| if row == 0 || row >= n_rows { 0.0 } else { record.time_s[row] - record.time_s[row - 1] };
    starts
        .iter()
        .enumerate()
        .map(|(i, &first_row)| {
            let end_row = starts.get(i + 1).copied().unwrap_or(n_rows);
            let step_n = rise(first_row);
            let is_step = i > 0 || step_n.abs() > rest_n;
            Hold {
                first_row,
                duration_s: end_s(end_row) - record.time_s[first_row],
                level_n: median(record.force_n[first_row..end_row].to_vec()).unwrap_or(0.0),
                direction: if is_step { step_n.signum() as i8 } else { 0 },
                open_s: before_s(first_row) + before_s(end_row),
            }
        })
        .collect()
}

/// Finds the shortest repetition of holds; `None` if they do not repeat. Repetitions with equal levels are preferred. A rest at the beginning or end
/// of the record may be excluded.
fn find_repetition(holds: &[Hold], range_n: f64) -> Option<Repetition> {
    let is_rest = |hold: &Hold| hold.level_n.abs() <= REST_TOLERANCE * range_n;
    let n_lead = usize::from(holds.first().is_some_and(is_rest));
    let n_tail = usize::from(holds.last().is_some_and(is_rest));
    for levels_agree in [true, false] {
        for length in 2..=holds.len().div_ceil(2) {
            // Spans with complete cycles are tried first, then spans without the first rest, then spans without the last rest.
            let mut spans: Vec<(usize, usize)> = Vec::new();
            for tail in 0..=n_tail {
                for lead in 0..=n_lead {
                    spans.push((lead, holds.len().saturating_sub(tail)));
                }
            }
            spans.sort_by_key(|(first, end)| {
                let whole = end.saturating_sub(*first) % length == 0;
                (!whole, holds.len() - end, n_lead - first.min(&n_lead))
            });
            let found = spans.into_iter().find(|(first, end)| {
                first < end
                    && end - first + 1 >= 2 * length
                    && repeats(&holds[*first..*end], length, levels_agree, range_n)
            });
            if let Some((first, _)) = found {
                return Some(Repetition { first, length, levels_agree });
            }
        }
    }
    None
}

/// True if every hold agrees with the hold `length` places later. The last hold may have any duration, because a record may end early or end with a long rest.
fn repeats(holds: &[Hold], length: usize, levels_agree: bool, range_n: f64) -> bool {
    let pairs = || holds.iter().zip(&holds[length..]);
    let both_ways = [-1, 1].iter().all(|way| holds.iter().any(|hold| hold.direction == *way));
    both_ways
        && pairs().enumerate().all(|(i, (a, b))| {
            let last = i + length + 1 == holds.len();
            let tolerance_s = DURATION_TOLERANCE * a.duration_s.max(b.duration_s) + a.open_s + b.open_s;
            let same_duration = last || (a.duration_s - b.duration_s).abs() <= tolerance_s;
            // The first hold may start from rest, while the equivalent later holds start from the previous level. Their directions may therefore differ.
            let same_direction = i == 0 || a.direction == b.direction;
            let same_level = !levels_agree || (a.level_n - b.level_n).abs() <= LEVEL_TOLERANCE * range_n;
            same_duration && same_direction && same_level
        })
}

fn from_repetition(record: &Record, holds: &[Hold], repetition: &Repetition) -> DetectedCycles {
    let n_hold_groups = (holds.len() - repetition.first).div_ceil(repetition.length);
    let mut starts: Vec<usize> =
        (0..n_hold_groups).map(|group| holds[repetition.first + group * repetition.length].first_row).collect();
    // If a single rest remains after the last complete cycle, the rest belongs to that cycle.
    let n_left = (holds.len() - repetition.first) % repetition.length;
    let last_is_rest =
        n_left == 1 && holds.last().is_some_and(|hold| hold.level_n.abs() <= REST_TOLERANCE * record.force_range_n());
    if last_is_rest {
        starts.pop();
    }
    let n_cycles = starts.len();
    let cycle = number_rows(record, &starts);
    let start_times_s: Vec<f64> = starts.iter().map(|row| record.time_s[*row]).collect();
    let period_s = median(start_times_s.windows(2).map(|pair| pair[1] - pair[0]).collect());
    let mut text = format!(
        "there is no `cycle` column; the force has {n_cycles} cycles of {:.4} s ({} holds each), starting at t = {}",
        period_s.unwrap_or(0.0),
        repetition.length,
        listed(&start_times_s)
    );
    if repetition.first > 0 {
        text += "; the rest before the first cycle belongs to cycle 1";
    }
    if !repetition.levels_agree {
        text += "; the force levels differ between cycles by more than 20 % of the force's range, but directions and durations repeat";
    }
    if n_left > 0 && !last_is_rest {
        text += "; the last cycle is incomplete";
    }
    DetectedCycles { cycle, period_s, text }
}

fn listed(times_s: &[f64]) -> String {
    let shown: Vec<String> = times_s.iter().take(12).map(|time_s| format!("{time_s:.4}")).collect();
    format!("{}{} s", shown.join(", "), if times_s.len() > shown.len() { ", …" } else { "" })
}

/// Numbers the rows by cycle, given the first row of each cycle. Rows before the first cycle belong to cycle 1.
fn number_rows(record: &Record, starts: &[usize]) -> Vec<u32> {
    let mut cycle = vec![1; record.n_rows()];
    let ends = starts.iter().skip(2).copied().chain([record.n_rows()]);
    for ((start, end), number) in starts.iter().skip(1).zip(ends).zip(2..) {
        cycle[*start..end].fill(number);
    }
    cycle
}

/// Returns the shortest lag (s) at which the force approximately repeats; `None` if there is none. This search follows if the holds do not repeat.
fn repeating_lag_s(record: &Record) -> Option<f64> {
    let (start_s, end_s) = (*record.time_s.first()?, *record.time_s.last()?);
    let spacing_s = (end_s - start_s) / LAG_GRID as f64;
    let (mut row, range_n) = (0, record.force_range_n());
    let force: Vec<f64> = (0..LAG_GRID)
        .map(|i| {
            let time_s = start_s + i as f64 * spacing_s;
            while row + 1 < record.n_rows() && record.time_s[row + 1] <= time_s {
                row += 1;
            }
            record.force_n[row] / range_n
        })
        .collect();
    let difference = |lag: usize| {
        let squares: f64 = force.iter().zip(&force[lag..]).map(|(a, b)| (a - b) * (a - b)).sum();
        squares / (LAG_GRID - lag) as f64
    };
    let mean = force.iter().sum::<f64>() / LAG_GRID as f64;
    let twice_variance = 2.0 * force.iter().map(|f| (f - mean) * (f - mean)).sum::<f64>() / LAG_GRID as f64;
    let differences: Vec<f64> = (0..=LAG_GRID / 2).map(|lag| difference(lag) / twice_variance).collect();
    // The lag is at the first sufficiently deep minimum of the difference. The search starts at the first lag at which the force is uncorrelated with itself.
    let unlike = differences.iter().position(|difference| *difference > 0.5)?;
    let enter = unlike + differences[unlike..].iter().position(|difference| *difference < LAG_TOLERANCE)?;
    let valley = &differences[enter..];
    let width = valley.iter().position(|difference| *difference >= LAG_TOLERANCE).unwrap_or(valley.len());
    let lowest = (0..width).min_by(|a, b| valley[*a].total_cmp(&valley[*b]))?;
    Some((enter + lowest) as f64 * spacing_s)
}

/// Divides the record into cycles of length `period_s`. A cycle begins at the force step nearest to its expected start, if there is a step nearby.
fn from_period(record: &Record, period_s: f64) -> DetectedCycles {
    let step_rows = record.force_step_rows();
    let mut starts = vec![0];
    let mut due_s = record.time_s[0] + period_s;
    // Up to a tenth of a period that remains at the end is not a cycle of its own.
    let last_s = record.time_s[record.n_rows() - 1];
    // A period is at least one step of the lag grid, so there are at most `LAG_GRID` cycles. The bound also ends the loop if a period is lost in
    // rounding.
    for _ in 0..LAG_GRID {
        if due_s + 0.1 * period_s >= last_s {
            break;
        }
        let distance_s = |row: &usize| (record.time_s[*row] - due_s).abs();
        // Steps are sorted by time, so the nearest step is the one before or the one after the expected start.
        let after = step_rows.partition_point(|row| record.time_s[*row] < due_s);
        let around = step_rows[after.saturating_sub(1)..step_rows.len().min(after + 1)].iter().copied();
        let near_step = around.min_by(|a, b| distance_s(a).total_cmp(&distance_s(b)));
        let nearest = record.time_s.partition_point(|time_s| *time_s < due_s);
        let nearest = if distance_s(&(nearest - 1)) < distance_s(&nearest) { nearest - 1 } else { nearest };
        match near_step.filter(|row| distance_s(row) < 0.05 * period_s) {
            Some(row) => {
                starts.push(row);
                due_s = record.time_s[row] + period_s;
            }
            None => {
                starts.push(nearest);
                due_s += period_s;
            }
        }
    }
    // Several cycles inside a gap between rows would begin at one row. Only one of them remains.
    starts.dedup();
    let cycle = number_rows(record, &starts);
    let text = format!(
        "there is no `cycle` column; the force repeats every {period_s:.4} s (found by autocorrelation), which makes {} cycles",
        starts.len()
    );
    DetectedCycles { cycle, period_s: Some(period_s), text }
}

#[cfg(test)]
#[path = "cycles_tests.rs"]
mod tests;
