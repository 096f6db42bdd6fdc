//! Commanded force as a function of time, given by its values at the rows and a rule between the rows.

use super::robust::{SD_PER_MAD, median};
use std::ops::Range;

/// Fraction of the force's range above which a change of the force counts as a step (formats §1).
const STEP_FRACTION: f64 = 0.2;

base::named_enum! {
    /// Rule for the force between two rows (formats §1).
    #[derive(Default)]
    pub enum ForceRule {
        /// The force of row i acts from its time tᵢ until just before tᵢ₊₁.
        #[default]
        Hold = "hold",
        /// The force varies linearly from row to row. Before the first row it is zero.
        Linear = "linear",
    }
    /// Name of the rule in `experiment.toml`.
    pub fn name
}

/// Commanded force over time, borrowed: its values at the rows, and the rule between the rows. A slice of numbers converts to a force with the rule
/// [`ForceRule::Hold`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Force<'a> {
    /// Force at every row, in N.
    pub at_rows_n: &'a [f64],
    /// Rule for the force between rows.
    pub rule: ForceRule,
}

/// Commanded force over time that owns its values, unlike [`Force`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OwnedForce {
    /// Force at every row, in N.
    pub at_rows_n: Vec<f64>,
    /// Rule for the force between rows.
    pub rule: ForceRule,
}

impl OwnedForce {
    /// Borrows the force as a [`Force`].
    pub fn get(&self) -> Force<'_> {
        Force { at_rows_n: &self.at_rows_n, rule: self.rule }
    }
}

impl From<Force<'_>> for OwnedForce {
    fn from(force: Force<'_>) -> Self {
        Self { at_rows_n: force.at_rows_n.to_vec(), rule: force.rule }
    }
}

impl<'a, T: AsRef<[f64]> + ?Sized> From<&'a T> for Force<'a> {
    fn from(at_rows_n: &'a T) -> Self {
        Self { at_rows_n: at_rows_n.as_ref(), rule: ForceRule::Hold }
    }
}

impl<'a> Force<'a> {
    /// Returns the force at the first `n` rows.
    pub fn first(self, n: usize) -> Self {
        Self { at_rows_n: &self.at_rows_n[..n.min(self.at_rows_n.len())], ..self }
    }

    /// True if the force varies linearly between rows.
    pub fn is_linear(self) -> bool {
        self.rule == ForceRule::Linear
    }

    /// Slope of the force from `row` to the next row, in N/s; 0 after the last row. `time_s` holds the time of every row, in s.
    pub fn slope_n_per_s(self, time_s: &[f64], row: usize) -> f64 {
        match (self.rule, self.at_rows_n.get(row + 1), time_s.get(row + 1)) {
            (ForceRule::Linear, Some(next_n), Some(next_s)) => (next_n - self.at_rows_n[row]) / (next_s - time_s[row]),
            _ => 0.0,
        }
    }

    /// True if the mean force between `row` and the next row is positive. If a linear force crosses zero in between, the sign of the longer part
    /// decides.
    pub fn is_positive(self, row: usize) -> bool {
        let here_n = self.at_rows_n[row];
        match (self.rule, self.at_rows_n.get(row + 1)) {
            (ForceRule::Linear, Some(next_n)) => here_n + next_n > 0.0,
            _ => here_n > 0.0,
        }
    }

    /// Largest minus smallest force, in N; the absolute force if the force is constant.
    pub fn range_n(self) -> f64 {
        let largest = self.at_rows_n.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let smallest = self.at_rows_n.iter().copied().fold(f64::INFINITY, f64::min);
        if largest > smallest { largest - smallest } else { self.at_rows_n.first().map_or(0.0, |force| force.abs()) }
    }

    /// Indices of the rows at which a force step begins (formats §1). A step changes the force by more than 20 % of the force's range. Row 0 may be a step,
    /// because the force before the first row is zero.
    pub fn step_rows(self) -> Vec<usize> {
        let threshold_n = STEP_FRACTION * self.range_n();
        let before = std::iter::once(&0.0).chain(self.at_rows_n);
        let steps = before.zip(self.at_rows_n).enumerate();
        steps.filter(|(_, (before, after))| (*after - *before).abs() > threshold_n).map(|(row, _)| row).collect()
    }

    /// True if the force changes at `row`. The rows with a change define the whole force.
    pub fn changes_at(self, row: usize) -> bool {
        let force_n = self.at_rows_n;
        row == 0
            || force_n[row] != force_n[row - 1]
            || (self.is_linear() && force_n.get(row + 1).is_some_and(|next| *next != force_n[row]))
    }

    /// Row ranges of the holds, each from one force step to the next. The first range begins at row 0.
    pub fn holds(self) -> Vec<std::ops::Range<usize>> {
        let mut starts = self.step_rows();
        if starts.first() != Some(&0) {
            starts.insert(0, 0);
        }
        let ends = starts.iter().skip(1).copied().chain([self.at_rows_n.len()]);
        starts.iter().zip(ends).map(|(start, end)| *start..end).collect()
    }

    /// Force in N at the time `at_s` (s): at a jump the value after the jump, and before the first row 0. `time_s` holds the time of every row, in s.
    pub fn at_n(self, time_s: &[f64], at_s: f64) -> f64 {
        let Some(row) = time_s.partition_point(|&row_s| row_s <= at_s).checked_sub(1) else { return 0.0 };
        let slope = self.slope_n_per_s(time_s, row);
        self.at_rows_n[row] + if slope == 0.0 { 0.0 } else { slope * (at_s - time_s[row]) }
    }

    /// Time integral of the force from `row` to the next row, in N·s; 0 after the last row. `time_s` holds the time of every row, in s.
    pub fn impulse_n_s(self, time_s: &[f64], row: usize) -> f64 {
        let Some(next_s) = time_s.get(row + 1) else { return 0.0 };
        let mean_n = match (self.rule, self.at_rows_n.get(row + 1)) {
            (ForceRule::Linear, Some(next_n)) => 0.5 * (self.at_rows_n[row] + next_n),
            _ => self.at_rows_n[row],
        };
        mean_n * (next_s - time_s[row])
    }
}

/// Smallest number of rows of a hold whose level is determined.
const LEVEL_ROWS: usize = 3;
/// Fraction of rows at which the force must change to count as noisy.
const CHANGES: f64 = 0.5;
/// Largest noise standard deviation of the force about the level of a hold, as a fraction of the force's range.
const NOISE_SHARE: f64 = 0.05;
/// Largest distance of a row's force from the level of its hold, in noise standard deviations.
const FARTHEST: f64 = 6.0;
/// Largest difference between the medians of a hold's two halves, in standard errors. A level whose distance from 0 is at most this number of
/// standard errors is set to 0.
const ERRORS: f64 = 4.0;

/// Returns the force (N) without the sensor's noise: at each row the median of the row's hold. A median that equals 0 within its error becomes 0. The
/// result is `None` if the force is not constant within its holds, apart from noise.
pub(super) fn levels(force_n: &[f64]) -> Option<Vec<f64>> {
    let force = Force::from(&force_n);
    let n_changes = force_n.windows(2).filter(|pair| pair[0] != pair[1]).count();
    if (n_changes as f64) < CHANGES * force_n.len() as f64 {
        return None;
    }
    let mut made = Vec::with_capacity(force_n.len());
    for rows in force.holds() {
        let hold = &force_n[rows];
        let level = median(hold.to_vec())?;
        let sd = SD_PER_MAD * median(hold.iter().map(|force| (force - level).abs()).collect())?;
        // The noise is estimated from differences between neighbouring rows, because slow changes hardly affect them.
        let steps = hold.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        let short_sd = SD_PER_MAD / std::f64::consts::SQRT_2 * median(steps)?;
        let farthest = hold.iter().map(|force| (force - level).abs()).fold(0.0, f64::max);
        // The standard error of a median is 1.25 times that of a mean.
        let error = |n: usize| 1.25 * short_sd / (n as f64).sqrt();
        let (first, second) = hold.split_at(hold.len() / 2);
        let apart = (median(first.to_vec())? - median(second.to_vec())?).abs();
        let is_level = hold.len() >= LEVEL_ROWS
            && sd <= NOISE_SHARE * force.range_n()
            && farthest <= FARTHEST * sd
            && apart <= ERRORS * error(first.len()) * std::f64::consts::SQRT_2;
        if !is_level {
            return None;
        }
        let level = if level.abs() <= ERRORS * error(hold.len()) { 0.0 } else { level };
        made.extend(std::iter::repeat_n(level, hold.len()));
    }
    Some(made)
}

/// Least number of successive changes in one direction that are a sampled ramp and no steps, and the least part of the force's range that they cover.
const RAMP_CHANGES: usize = 4;
const RAMP_PART: f64 = 0.1;
/// Largest part of a ramp in one row: a larger one is a step with a drift.
const JUMP_PART: f64 = 0.5;

/// The rows from the start to the end of each sampled ramp of the force (N): it rises or falls in every row.
pub fn sampled_ramps(force_n: &[f64]) -> Vec<Range<usize>> {
    let [low, high] = force_n
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], force| [low.min(*force), high.max(*force)]);
    let changes: Vec<f64> = force_n.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut first = 0;
    let runs = changes.chunk_by(|a, b| a * b > 0.0).map(|run| {
        first += run.len();
        first - run.len()..first + 1
    });
    let is_ramp = |rows: &Range<usize>| {
        let total_n = (force_n[rows.end - 1] - force_n[rows.start]).abs();
        let largest_n = changes[rows.start..rows.end - 1].iter().fold(0.0_f64, |most, change| most.max(change.abs()));
        rows.len() > RAMP_CHANGES && total_n >= RAMP_PART * (high - low) && largest_n <= JUMP_PART * total_n
    };
    runs.filter(is_ramp).collect()
}

/// Largest part of the rows in which a force with sampled ramps changes, and in which it jumps beside them. One that changes or jumps more often is measured, or has a row for each switch.
const MOST_CHANGES: f64 = 0.5;
const MOST_JUMPS: f64 = 0.05;

/// Rows of the first sampled ramp of a force (N) that holds in most rows, and the rows in which it jumps. `None` without such a ramp, and for the noise of a sensor.
pub fn ramps_between_holds(force_n: &[f64]) -> Option<(Range<usize>, Vec<usize>)> {
    let ramps = sampled_ramps(force_n);
    let first = ramps.first()?.clone();
    let is_in_ramp = |row: usize| ramps.iter().any(|ramp| ramp.contains(&row) && row > ramp.start);
    let changed: Vec<usize> = (1..force_n.len()).filter(|row| force_n[*row] != force_n[row - 1]).collect();
    let jumps: Vec<usize> = changed.iter().copied().filter(|row| !is_in_ramp(*row)).collect();
    let is_at_most = |count: usize, part: f64| (count as f64) < part * force_n.len() as f64;
    let holds = is_at_most(changed.len(), MOST_CHANGES) && (jumps.is_empty() || is_at_most(jumps.len(), MOST_JUMPS));
    (holds && !has_noisy_levels(force_n)).then_some((first, jumps))
}

/// True if the force (N) is constant in every hold, apart from a sensor's noise.
pub fn has_noisy_levels(force_n: &[f64]) -> bool {
    levels(force_n).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_noisy_force_has_levels_and_a_curve_or_a_clean_one_has_none() {
        let noise = |row: usize| 0.05 * (2.0 * (row as f64 * 0.754_877_666).fract() - 1.0);
        let steps: Vec<f64> = (0..300).map(|row| if row / 50 % 2 == 0 { 4.6 } else { 0.0 }).collect();
        let noisy: Vec<f64> = steps.iter().enumerate().map(|(row, force)| force + noise(row)).collect();
        let found = levels(&noisy).expect("levels");
        assert!(
            found
                .iter()
                .zip(&steps)
                .all(|(found, force)| (found - force).abs() < 0.02 && (*force > 0.0 || *found == 0.0))
        );
        let sine: Vec<f64> = (0..300).map(|row| (row as f64 * 0.1).sin() + noise(row)).collect();
        let ramps: Vec<f64> = noisy.iter().enumerate().map(|(row, force)| force + 0.01 * (row % 50) as f64).collect();
        for other in [sine, ramps, steps] {
            assert_eq!(levels(&other), None);
        }
    }

    #[test]
    fn a_ramp_rises_or_falls_in_every_row() {
        let rows = |force_n: &[f64]| -> Vec<(usize, usize)> {
            sampled_ramps(force_n).into_iter().map(|ramp| (ramp.start, ramp.end)).collect()
        };
        assert_eq!(rows(&[0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 4.0, 4.0, 0.0]), [(1, 6)]);
        assert_eq!(rows(&[4.0, 4.0, 3.0, 2.0, 1.0, 0.0, 1.0, 2.0, 3.0, 4.0]), [(1, 6), (5, 10)]);
        // Steps, three steps of one row each, and a drift that is small beside a step.
        for steps in [
            &[0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0][..],
            &[0.0, 1.0, 2.0, 3.0, 3.0],
            &[0.0, 9.0, 9.1, 9.2, 9.3, 9.4, 9.5],
        ] {
            assert_eq!(rows(steps), []);
        }
    }

    #[test]
    fn rows_at_which_a_force_changes_are_needed() {
        let force_n = [1.0, 1.0, 1.0, 3.0, 3.0];
        let needed = |rule| -> Vec<usize> {
            (0..5).filter(|row| Force { at_rows_n: &force_n, rule }.changes_at(*row)).collect()
        };
        assert_eq!((needed(ForceRule::Hold), needed(ForceRule::Linear)), (vec![0, 3], vec![0, 2, 3]));
        assert_eq!(Force::from(&force_n).holds(), [0..3, 3..5]);
        assert_eq!(Force::from(&[0.0, 0.0, 2.0]).holds(), [0..2, 2..3]);
    }

    #[test]
    fn a_line_between_rows_has_its_slope_value_and_impulse() {
        let (time_s, at_rows_n) = ([0.0, 2.0, 3.0], [1.0, 5.0, -1.0]);
        let held = Force::from(&at_rows_n);
        let linear = Force { rule: ForceRule::Linear, ..held };
        assert_eq!([0, 1, 2].map(|row| linear.slope_n_per_s(&time_s, row)), [2.0, -6.0, 0.0]);
        assert_eq!([0, 1, 2].map(|row| held.slope_n_per_s(&time_s, row)), [0.0; 3]);
        assert_eq!([-1.0, 0.0, 1.0, 2.5, 9.0].map(|t| linear.at_n(&time_s, t)), [0.0, 1.0, 3.0, 2.0, -1.0]);
        assert_eq!([-1.0, 0.0, 1.0, 2.5, 9.0].map(|t| held.at_n(&time_s, t)), [0.0, 1.0, 1.0, 5.0, -1.0]);
        assert_eq!([0, 1, 2].map(|row| linear.impulse_n_s(&time_s, row)), [6.0, 2.0, 0.0]);
        assert_eq!([0, 1, 2].map(|row| held.impulse_n_s(&time_s, row)), [2.0, 5.0, 0.0]);
    }
}
