//! The commanded force between the rows at which it is given.

/// Share of the force's range above which a change is a step (formats §1).
const STEP_FRACTION: f64 = 0.2;

/// What the force does between rows (formats §1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ForceRule {
    /// Row i's force holds on [tᵢ, tᵢ₊₁).
    #[default]
    Hold,
    /// It goes in a straight line to the next row's; before the first row it is zero.
    Linear,
}

impl ForceRule {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Hold, Self::Linear];

    /// As it is written in `experiment.toml`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Linear => "linear",
        }
    }
}

/// A commanded force against time: its values at the rows and what it does between them. Slices of numbers become one that holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Force<'a> {
    /// Force at every row, in N.
    pub at_rows_n: &'a [f64],
    /// What it does between them.
    pub rule: ForceRule,
}

/// The same, kept.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct KeptForce {
    /// Force at every row, in N.
    pub at_rows_n: Vec<f64>,
    /// What it does between them.
    pub rule: ForceRule,
}

impl KeptForce {
    /// For whoever computes with it.
    pub fn get(&self) -> Force<'_> {
        Force { at_rows_n: &self.at_rows_n, rule: self.rule }
    }
}

impl From<Force<'_>> for KeptForce {
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
    /// The first `n` rows of it.
    pub fn first(self, n: usize) -> Self {
        Self { at_rows_n: &self.at_rows_n[..n.min(self.at_rows_n.len())], ..self }
    }

    /// Whether it changes between rows.
    pub fn is_linear(self) -> bool {
        self.rule == ForceRule::Linear
    }

    /// By how much it rises a second from a row on, in N/s; 0 after the last. `time_s` are the rows' times in s.
    pub fn slope_n_per_s(self, time_s: &[f64], row: usize) -> f64 {
        match (self.rule, self.at_rows_n.get(row + 1), time_s.get(row + 1)) {
            (ForceRule::Linear, Some(next_n), Some(next_s)) => (next_n - self.at_rows_n[row]) / (next_s - time_s[row]),
            _ => 0.0,
        }
    }

    /// Whether the force between a row and the next pushes forward; where the line crosses zero, the longer part of it.
    pub fn is_positive(self, row: usize) -> bool {
        let here_n = self.at_rows_n[row];
        match (self.rule, self.at_rows_n.get(row + 1)) {
            (ForceRule::Linear, Some(next_n)) => here_n + next_n > 0.0,
            _ => here_n > 0.0,
        }
    }

    /// Largest less smallest force in N; the force's size where it is constant.
    pub fn range_n(self) -> f64 {
        let largest = self.at_rows_n.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let smallest = self.at_rows_n.iter().copied().fold(f64::INFINITY, f64::min);
        if largest > smallest { largest - smallest } else { self.at_rows_n.first().map_or(0.0, |force| force.abs()) }
    }

    /// Indices of the rows at which a force step begins: the force differs from the row before by more than 20 % of the force's range (formats §1). Before the first
    /// row the force is zero, so row 0 may be one.
    pub fn step_rows(self) -> Vec<usize> {
        let threshold_n = STEP_FRACTION * self.range_n();
        let before = std::iter::once(&0.0).chain(self.at_rows_n);
        let steps = before.zip(self.at_rows_n).enumerate();
        steps.filter(|(_, (before, after))| (*after - *before).abs() > threshold_n).map(|(row, _)| row).collect()
    }

    /// The force at a time, in N: from the right where it jumps; zero before the first row.
    pub fn at_n(self, time_s: &[f64], at_s: f64) -> f64 {
        let Some(row) = time_s.partition_point(|&row_s| row_s <= at_s).checked_sub(1) else { return 0.0 };
        let slope = self.slope_n_per_s(time_s, row);
        self.at_rows_n[row] + if slope == 0.0 { 0.0 } else { slope * (at_s - time_s[row]) }
    }

    /// Its integral between a row and the next, in N·s; 0 after the last.
    pub fn impulse_n_s(self, time_s: &[f64], row: usize) -> f64 {
        let Some(next_s) = time_s.get(row + 1) else { return 0.0 };
        let mean_n = match (self.rule, self.at_rows_n.get(row + 1)) {
            (ForceRule::Linear, Some(next_n)) => 0.5 * (self.at_rows_n[row] + next_n),
            _ => self.at_rows_n[row],
        };
        mean_n * (next_s - time_s[row])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
