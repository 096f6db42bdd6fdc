//! Rows of a record: times, forces and positions, and quantities derived from them.

use super::force::{Force, ForceRule};
use super::robust::median;
use base::sha256::{Hash, hex};

/// Record of force and position over time, row by row in SI units. The vectors with one value per row have equal lengths.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Record {
    /// Times in s, strictly increasing.
    pub time_s: Vec<f64>,
    /// Commanded force at each row, in N.
    pub force_n: Vec<f64>,
    /// Position at each row in m, just before a change of the force at this row; `None` if tracking was lost.
    pub position_m: Vec<Option<f64>>,
    /// Cycle of each row, counted from 1.
    pub cycle: Vec<u32>,
    /// Rule for the force between rows.
    pub force_rule: ForceRule,
    /// Rows that only mark a change of the force, in ascending order. They have no sampled position.
    pub force_rows: Vec<usize>,
}

impl Record {
    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.time_s.len()
    }

    /// SHA-256 hash of all rows.
    pub fn sha256(&self) -> String {
        let mut hash = Hash::new();
        let positions = self.position_m.iter().map(|position| position.unwrap_or(f64::NAN));
        for value in self.time_s.iter().chain(&self.force_n).copied().chain(positions) {
            hash.update(value.to_le_bytes());
        }
        self.cycle.iter().for_each(|cycle| hash.update(cycle.to_le_bytes()));
        if self.force_rule != ForceRule::Hold {
            hash.update(self.force_rule.name());
        }
        hex(&hash.finalize())
    }

    /// Returns the record with further rows without positions, at which the force is that of the record.
    pub fn with_times(&self, also_s: &[f64]) -> Self {
        let mut time_s: Vec<f64> = self.time_s.iter().chain(also_s).copied().collect();
        time_s.sort_by(f64::total_cmp);
        time_s.dedup();
        let row_of = |time: &f64| self.time_s.partition_point(|row_s| row_s <= time).saturating_sub(1);
        let at_row = |time: &f64| {
            let row = row_of(time);
            if self.force_rule == ForceRule::Hold { self.force_n[row] } else { self.force().at_n(&self.time_s, *time) }
        };
        let position = |time: &f64| self.position_m[row_of(time)].filter(|_| self.time_s[row_of(time)] == *time);
        Self {
            force_n: time_s.iter().map(at_row).collect(),
            position_m: time_s.iter().map(position).collect(),
            cycle: time_s.iter().map(|time| self.cycle[row_of(time)]).collect(),
            force_rule: self.force_rule,
            force_rows: Vec::new(),
            time_s,
        }
    }

    /// Returns a record of the rows that `is_kept` marks.
    pub fn of_rows(&self, is_kept: &[bool]) -> Self {
        let rows: Vec<usize> = (0..self.n_rows()).filter(|row| is_kept[*row]).collect();
        let is_of_force = |row: &usize| self.force_rows.binary_search(row).is_ok();
        Self {
            time_s: rows.iter().map(|row| self.time_s[*row]).collect(),
            force_n: rows.iter().map(|row| self.force_n[*row]).collect(),
            position_m: rows.iter().map(|row| self.position_m[*row]).collect(),
            cycle: rows.iter().map(|row| self.cycle[*row]).collect(),
            force_rule: self.force_rule,
            force_rows: (0..rows.len()).filter(|place| is_of_force(&rows[*place])).collect(),
        }
    }

    /// Returns the commanded force over time.
    pub fn force(&self) -> Force<'_> {
        Force { at_rows_n: &self.force_n, rule: self.force_rule }
    }

    /// Commanded force just before `row`, in N: the previous row's force, or 0 before the first row.
    pub fn previous_force_n(&self, row: usize) -> f64 {
        row.checked_sub(1).map_or(0.0, |before| self.force_n[before])
    }

    /// Commanded force (N) that acts when the position at `row` is measured, just before the force changes at this row. It is 0 at the first row.
    pub fn acting_force_n(&self, row: usize) -> f64 {
        if row > 0 && self.force().is_linear() { self.force_n[row] } else { self.previous_force_n(row) }
    }

    /// Number of cycles; 0 for an empty record.
    pub fn n_cycles(&self) -> u32 {
        self.cycle.last().copied().unwrap_or(0)
    }

    /// Returns a function that tests whether a cycle number is in `cycles`. The cost of a test does not depend on the number of cycles, because
    /// records may have a hundred thousand.
    pub fn cycle_filter(&self, cycles: &[u32]) -> impl Fn(u32) -> bool + use<> {
        let mut is_wanted = vec![false; self.largest_cycle() + 1];
        for cycle in cycles {
            if let Some(wanted) = is_wanted.get_mut(*cycle as usize) {
                *wanted = true;
            }
        }
        move |cycle| is_wanted.get(cycle as usize).copied().unwrap_or(false)
    }

    /// Number of positions in each cycle. The index is the cycle number; index 0 is unused and holds 0.
    pub fn n_positions(&self) -> Vec<usize> {
        let mut counts = vec![0; self.largest_cycle() + 1];
        for (cycle, _) in self.cycle.iter().zip(&self.position_m).filter(|(_, position)| position.is_some()) {
            counts[*cycle as usize] += 1;
        }
        counts
    }

    /// Largest cycle number, which equals the number of cycles because cycles count from 1 without gaps.
    fn largest_cycle(&self) -> usize {
        self.cycle.iter().copied().max().unwrap_or(0) as usize
    }

    /// Largest minus smallest force in N; the absolute force if it never changes.
    pub fn force_range_n(&self) -> f64 {
        self.force().range_n()
    }

    /// Indices of the rows at which a force step begins (formats §1).
    pub fn force_step_rows(&self) -> Vec<usize> {
        self.force().step_rows()
    }

    /// Returns the record with additional rows where a linearly varying force crosses zero, and the line number of each row. Additional rows have no
    /// position. `lines` holds the line number of each existing row. An additional row gets the line number of the row before it.
    pub(super) fn with_force_rows(self, lines: Vec<usize>) -> (Self, Vec<usize>) {
        let crossing_s = |row: usize| {
            let (from_n, to_n) = (self.force_n[row], *self.force_n.get(row + 1)?);
            let share = from_n / (from_n - to_n);
            let at_s = self.time_s[row] + share * (self.time_s[row + 1] - self.time_s[row]);
            (from_n * to_n < 0.0 && self.time_s[row] < at_s && at_s < self.time_s[row + 1]).then_some(at_s)
        };
        if !self.force().is_linear() || (0..self.n_rows()).all(|row| crossing_s(row).is_none()) {
            return (self, lines);
        }
        let (mut made, mut lines_made) = (Self { force_rule: self.force_rule, ..Self::default() }, Vec::new());
        for (row, &line) in lines.iter().enumerate() {
            let crossing = crossing_s(row).map(|at_s| (at_s, 0.0, None, true));
            let entry = (self.time_s[row], self.force_n[row], self.position_m[row]);
            let is_added = self.force_rows.binary_search(&row).is_ok();
            for (time_s, force_n, position_m, is_added) in
                std::iter::once((entry.0, entry.1, entry.2, is_added)).chain(crossing)
            {
                if is_added {
                    made.force_rows.push(made.time_s.len());
                }
                made.time_s.push(time_s);
                made.force_n.push(force_n);
                made.position_m.push(position_m);
                made.cycle.push(self.cycle[row]);
                lines_made.push(line);
            }
        }
        (made, lines_made)
    }

    /// Number of sampled rows, including rows with a lost position.
    pub fn n_samples(&self) -> usize {
        self.n_rows() - self.force_rows.len()
    }

    /// Median time between successive samples in s; `None` for fewer than two samples.
    pub fn median_interval_s(&self) -> Option<f64> {
        let mut left_out = self.force_rows.iter().copied().peekable();
        let is_sample = |row: &usize| left_out.next_if_eq(row).is_none();
        let sampled_s: Vec<f64> = (0..self.n_rows()).filter(is_sample).map(|row| self.time_s[row]).collect();
        median(sampled_s.windows(2).map(|pair| pair[1] - pair[0]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(force_n: &[f64]) -> Record {
        Record {
            time_s: (0..force_n.len()).map(|i| i as f64).collect(),
            force_n: force_n.to_vec(),
            position_m: (0..force_n.len()).map(|i| (i % 3 != 2).then_some(i as f64)).collect(),
            cycle: (0..force_n.len()).map(|i| 1 + (i / 4) as u32).collect(),
            ..Record::default()
        }
    }

    #[test]
    fn steps_are_changes_above_a_fifth_of_the_range() {
        // The force's range is 10. A change of 2.0 is exactly a fifth of the range and not a step, but a change of 2.1 is a step.
        let steps = record(&[0.0, 2.0, 0.0, 2.1, 10.0, 9.0, 0.0, 0.0]).force_step_rows();
        assert_eq!(steps, [3, 4, 6]);
    }

    #[test]
    fn a_constant_pull_is_one_step_at_the_start() {
        assert_eq!(record(&[-3.0, -3.0, -3.0]).force_step_rows(), [0]);
        assert_eq!(record(&[0.0, 0.0]).force_step_rows(), [0_usize; 0]);
    }

    #[test]
    fn lost_positions_are_not_counted() {
        let record = record(&[0.0; 10]);
        assert_eq!(record.n_positions(), [0, 3, 3, 1]);
        assert_eq!(record.n_cycles(), 3);
    }

    #[test]
    fn a_line_through_zero_gets_a_row_there() {
        let linear = Record { force_rule: ForceRule::Linear, ..record(&[1.0, -3.0, 0.0, 2.0, -2.0]) };
        let (made, lines) = linear.with_force_rows(vec![2, 3, 4, 5, 6]);
        assert_eq!(made.time_s, [0.0, 0.25, 1.0, 2.0, 3.0, 3.5, 4.0]);
        assert_eq!(made.force_n, [1.0, 0.0, -3.0, 0.0, 2.0, 0.0, -2.0]);
        assert_eq!((lines, made.force_rows), (vec![2, 2, 3, 4, 5, 5, 6], vec![1, 5]));
        assert_eq!(made.position_m, [Some(0.0), None, Some(1.0), None, Some(3.0), None, Some(4.0)]);
    }

    #[test]
    fn what_acts_at_a_row_is_the_limit_from_the_left() {
        let held = record(&[1.0, -3.0, 2.0]);
        let linear = Record { force_rule: ForceRule::Linear, ..held.clone() };
        assert_eq!([0, 1, 2].map(|row| held.acting_force_n(row)), [0.0, 1.0, -3.0]);
        assert_eq!([0, 1, 2].map(|row| linear.acting_force_n(row)), [0.0, -3.0, 2.0]);
        assert_eq!([0, 1, 2].map(|row| linear.previous_force_n(row)), [0.0, 1.0, -3.0]);
    }

    #[test]
    fn rows_of_the_force_alone_are_no_samples() {
        let record = Record { force_rows: vec![1, 3], ..record(&[0.0; 5]) };
        assert_eq!((record.n_samples(), record.median_interval_s()), (3, Some(2.0)));
    }
}
