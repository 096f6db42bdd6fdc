//! Rows of a record from which panels are made, and columns over these rows.

use crate::recordings::recordings;
use record::Record;

/// Least number of fitted rows in which a column must differ from 0; columns with fewer such rows are dropped.
const FEWEST_ROWS: usize = 3;
const N_QUANTILE_BINS: usize = 5;

/// A column, with its name and the phrase for where it applies.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Short name for figures and tables.
    pub label: String,
    /// Phrase for where the column applies, for the end of a sentence, such as "in cycle 2".
    pub phrase: String,
    /// Start and end (s) of the column's range of times after a force step; `None` if it has no such range.
    pub lag_s: Option<[f64; 2]>,
    /// One value per row of the record; empty for a cycle's column, whose values are in [`ByCycle`].
    pub values: Vec<f64>,
}

/// One column per cycle, 1 in the cycle's rows and 0 elsewhere. It is stored as one number per row for any number of cycles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ByCycle {
    /// For each row, the index of its cycle among the cycles with a fitted row. `None` for rows of other cycles, and of cycles without a column.
    pub place: Vec<Option<usize>>,
    /// For each cycle with a fitted row, whether it has a column.
    pub has_column: Vec<bool>,
}

/// Columns that are added to a model.
#[derive(Debug, Clone, Default)]
pub struct Columns {
    /// Columns with one value per row of the record.
    pub dense: Vec<Vec<f64>>,
    /// Additional columns, one for each cycle.
    pub by_cycle: Option<ByCycle>,
}

impl Columns {
    /// Returns the columns of `self` and `other` together. At most one of them may have columns of cycles.
    pub fn and(&self, other: &Self) -> Self {
        let dense = self.dense.iter().chain(&other.dense).cloned().collect();
        Self { dense, by_cycle: self.by_cycle.clone().or_else(|| other.by_cycle.clone()) }
    }
}

/// Rows of a record, with the forces, times and predicted positions from which panels are made.
pub struct TestRows<'a> {
    pub(super) record: &'a Record,
    /// Position (m) predicted by the model, one value per row.
    pub(super) position_m: &'a [f64],
    is_fitted: Vec<bool>,
    /// Force (N) that acts until each row.
    pub(super) acting_n: Vec<f64>,
    pub(super) largest_n: f64,
    /// Time (s) since the last force step before each row, and the step's size as a fraction of the largest; `None` before the first step.
    pub(super) since_step: Vec<Option<(f64, f64)>>,
    /// Change of the model's position (m) from the previous row to each row.
    pub(super) moved_m: Vec<f64>,
    pub(super) interval_s: f64,
}

impl<'a> TestRows<'a> {
    /// Prepares the rows of a record; `position_m` is the model's position (m) at every row, and `is_fitted` marks the rows that count.
    pub fn new(record: &'a Record, position_m: &'a [f64], is_fitted: Vec<bool>) -> Self {
        let n = record.n_rows();
        let acting_n: Vec<f64> = (0..n).map(|row| record.acting_force_n(row)).collect();
        let moved_m = (0..n).map(|i| if i == 0 { 0.0 } else { position_m[i] - position_m[i - 1] }).collect();
        let largest_n = record.force_n.iter().fold(0.0_f64, |largest, force| largest.max(force.abs()));
        let steps: Vec<(usize, f64)> = record
            .force_step_rows()
            .into_iter()
            .map(|row| (row, record.force_n[row] - record.previous_force_n(row)))
            .collect();
        let largest_step = steps.iter().fold(f64::MIN_POSITIVE, |largest, step| largest.max(step.1.abs()));
        let last_before = |row: usize| {
            let place = steps.partition_point(|(at, _)| *at < row).checked_sub(1)?;
            let (at, change) = steps[place];
            Some((record.time_s[row] - record.time_s[at], change / largest_step))
        };
        let since_step = (0..n).map(last_before).collect();
        let interval_s = record.median_interval_s().unwrap_or(1.0);
        Self { record, position_m, is_fitted, acting_n, largest_n, since_step, moved_m, interval_s }
    }

    pub(super) fn n(&self) -> usize {
        self.record.n_rows()
    }

    /// Returns for each row whether it is fitted.
    pub fn is_fitted(&self) -> &[bool] {
        &self.is_fitted
    }

    /// Time (s) since the last force step before each row; `None` before the first step.
    pub fn time_since_step_s(&self) -> Vec<Option<f64>> {
        self.since_step.iter().map(|step| step.map(|(time_s, _)| time_s)).collect()
    }

    /// Returns the ends (s) of at most `most` bins of the time since the last force step, equally spaced in logarithm. The first bin begins at 0.
    pub fn lag_ends_s(&self, most: usize) -> Vec<f64> {
        let longest = self.since_step.iter().flatten().fold(0.0_f64, |longest, step| longest.max(step.0));
        let first = self.interval_s;
        if longest <= 2.0 * first {
            return if longest > 0.0 { vec![longest] } else { Vec::new() };
        }
        let n = ((longest / first).log2().round() as usize).clamp(2, most);
        // The ends are slightly larger, so that times at multiples of the interval fall into their bins in spite of rounding.
        (1..=n).map(|k| first * (longest / first).powf(k as f64 / n as f64) * (1.0 + 1e-6)).collect()
    }

    pub(super) fn column(&self, label: String, phrase: String, values: impl Fn(usize) -> f64) -> Column {
        Column { label, phrase, lag_s: None, values: (0..self.n()).map(values).collect() }
    }

    pub(super) fn fitted_rows(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.n()).filter(|row| self.is_fitted[*row])
    }

    /// Returns the first fitted cycle of every recording that has fitted rows, and the columns of these recordings. A recording with too few fitted rows has no column.
    pub(super) fn by_cycle(&self) -> (Vec<u32>, ByCycle) {
        let recordings = recordings(self.record);
        let (mut fitted_recordings, mut cycles, mut counts) =
            (Vec::<u32>::new(), Vec::<u32>::new(), Vec::<usize>::new());
        for row in self.fitted_rows() {
            if fitted_recordings.last() != Some(&recordings[row]) {
                fitted_recordings.push(recordings[row]);
                cycles.push(self.record.cycle[row]);
                counts.push(0);
            }
            if let Some(count) = counts.last_mut() {
                *count += 1;
            }
        }
        let has_column: Vec<bool> = counts.iter().map(|count| *count >= FEWEST_ROWS).collect();
        let mut next = 0;
        let place_of = |recording: &u32| {
            while next < fitted_recordings.len() && fitted_recordings[next] < *recording {
                next += 1;
            }
            (fitted_recordings.get(next) == Some(recording) && has_column[next]).then_some(next)
        };
        let place = recordings.iter().map(place_of).collect();
        (cycles, ByCycle { place, has_column })
    }

    /// Keeps the columns that differ from 0 in enough fitted rows, scaled so that their largest size in these rows is 1.
    pub(super) fn kept(&self, columns: Vec<Column>) -> Vec<Column> {
        let scaled = |mut column: Column| {
            let largest = self.fitted_rows().fold(0.0_f64, |largest, row| largest.max(column.values[row].abs()));
            let n = self.fitted_rows().filter(|row| column.values[*row].abs() > 1e-3 * largest).count();
            column.values.iter_mut().for_each(|value| *value /= largest);
            (largest > 0.0 && n >= FEWEST_ROWS).then_some(column)
        };
        columns.into_iter().filter_map(scaled).collect()
    }

    /// Returns one column per bin of the values `of`: 1 in the bin and 0 elsewhere. The bins have equal numbers of fitted rows. `say` returns the label and the phrase of a bin.
    pub(super) fn quantile_bins(&self, of: &[f64], say: impl Fn(f64, f64) -> (String, String)) -> Vec<Column> {
        let mut sorted: Vec<f64> = self.fitted_rows().map(|row| of[row]).collect();
        sorted.sort_by(f64::total_cmp);
        if sorted.is_empty() {
            return Vec::new();
        }
        let ends: Vec<f64> = (0..=N_QUANTILE_BINS).map(|k| sorted[(sorted.len() - 1) * k / N_QUANTILE_BINS]).collect();
        let bin = |k: usize| {
            let (low, high) = (ends[k], ends[k + 1]);
            let is_last = k + 1 == N_QUANTILE_BINS;
            let (label, phrase) = say(low, high);
            self.column(label, phrase, |row| {
                f64::from(u8::from(of[row] >= low && (of[row] < high || (is_last && of[row] == high))))
            })
        };
        self.kept((0..N_QUANTILE_BINS).map(bin).collect())
    }
}
