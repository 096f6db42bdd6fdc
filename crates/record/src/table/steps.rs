//! Clock that counts from the start of each step of a test. Rheometers write it beside the clock of the whole test, and the first row of a step one interval after its start.

use super::spelling::ParsedUnit;

/// Names of such a clock, in lower case.
const OF_STEP: [&str; 6] = ["t_seg", "interval time", "segment time", "step time", "action time", "time (action)"];
/// Largest fraction of the rows in which a step starts. A column that holds the interval between rows starts anew in every row.
const MOST_STARTS: f64 = 1.0 / 3.0;
/// Fraction of the shorter of the two intervals before a row by which the start of its step must have moved, so that the row is the first one of another step.
const MOVES: f64 = 0.5;
/// Start of a step that counts as 0, divided by the record's duration.
const ROUNDING: f64 = 1e-9;

/// True if a column's name is that of a clock of steps.
pub(super) fn is_of_step(name: &str) -> bool {
    let name = name.to_lowercase();
    OF_STEP.iter().any(|word| name.starts_with(word))
}

/// A clock of steps beside that of the whole test.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StepClock {
    /// Index of its column.
    pub at: usize,
    pub unit: ParsedUnit,
    /// Start of each row's step on the clock of the whole test, in s.
    starts_s: Vec<f64>,
    /// Rows with which a further step begins.
    first_rows: Vec<usize>,
}

impl StepClock {
    /// The clock of a column whose rows are `since_s` after the starts of their steps, at the times `time_s` of the whole test (s). `None` if the two do not belong together.
    pub fn new((at, unit): (usize, ParsedUnit), time_s: &[f64], since_s: &[f64]) -> Option<Self> {
        let (first_s, last_s) = (time_s.first()?, time_s.last()?);
        let rounding_s = ROUNDING * (last_s - first_s);
        let start = |(time_s, since_s): (&f64, &f64)| {
            let start_s = time_s - since_s;
            if start_s.abs() < rounding_s { 0.0 } else { start_s }
        };
        let starts_s: Vec<f64> = time_s.iter().zip(since_s).map(start).collect();
        let (mut first_rows, mut of_step) = (Vec::new(), 0);
        for row in 1..time_s.len() {
            let interval_s = |row: usize| time_s[row] - time_s[row - 1];
            let least_s = MOVES * if row > 1 { interval_s(row).min(interval_s(row - 1)) } else { interval_s(row) };
            if (starts_s[row] - starts_s[of_step]).abs() <= least_s {
                continue;
            }
            // The step of this row starts before the row before it: the column is no clock of steps.
            if starts_s[row] < time_s[row - 1] - least_s {
                return None;
            }
            first_rows.push(row);
            of_step = row;
        }
        let is_clock = since_s.iter().all(|since_s| *since_s >= 0.0)
            && first_rows.len() as f64 <= MOST_STARTS * time_s.len() as f64;
        is_clock.then_some(Self { at, unit, starts_s, first_rows })
    }

    /// True if all rows belong to one step.
    pub fn is_single(&self) -> bool {
        self.first_rows.is_empty()
    }

    /// Start of the first row's step, in s.
    pub fn first_start_s(&self) -> f64 {
        self.starts_s[0]
    }

    /// True if every step with another force starts at the row before its first one, so that each force has acted until its row.
    pub fn acts_until_rows(&self, time_s: &[f64], force_n: &[f64]) -> bool {
        let mut changes = self.first_rows.iter().filter(|row| force_n[**row] != force_n[**row - 1]).peekable();
        let is_at_row_before = |row: &usize| {
            let start_s = self.starts_s[*row];
            (start_s - time_s[row - 1]).abs() < time_s[*row] - start_s
        };
        changes.peek().is_some() && changes.all(is_at_row_before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::unit;

    fn clock(time_s: &[f64], since_s: &[f64]) -> Option<StepClock> {
        StepClock::new((1, unit("s").expect("a unit")), time_s, since_s)
    }

    #[test]
    fn a_force_acts_since_the_start_of_its_step() {
        let time_s = [1.0, 2.0, 3.0, 4.0, 5.0, 15.0, 25.0, 35.0];
        // Ten seconds between rows follow one second: the clock does not fall.
        let sparser = clock(&time_s, &[1.0, 2.0, 3.0, 4.0, 5.0, 10.0, 20.0, 30.0]).expect("a clock");
        let force_n = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
        assert!(sparser.acts_until_rows(&time_s, &force_n) && !sparser.acts_until_rows(&time_s, &[1.0; 8]));
        assert!(!sparser.is_single() && sparser.first_start_s() == 0.0);
        // The first row of a step is at its start.
        let at_start = clock(&time_s, &[0.0, 1.0, 2.0, 3.0, 4.0, 0.0, 10.0, 20.0]).expect("a clock");
        assert!(!at_start.acts_until_rows(&time_s, &force_n) && at_start.first_start_s() == 1.0);
        // A single step of a longer test, by times of two digits.
        let late_s: Vec<f64> = (0..40).map(|row| (61200.4 + 3.7 * f64::from(row)).round() / 100.0).collect();
        let since_s: Vec<f64> = (0..40).map(|row| (0.4 + 3.7 * f64::from(row)).round() / 100.0).collect();
        assert!(clock(&late_s, &since_s).is_some_and(|clock| clock.is_single()));
    }

    #[test]
    fn other_columns_are_no_clocks_of_steps() {
        let time_s: Vec<f64> = (0..20).map(f64::from).collect();
        for other in [|_: f64| 1.0, |t: f64| 0.5 * t, |t: f64| -t, |t: f64| 19.0 - t] {
            let since_s: Vec<f64> = time_s.iter().map(|t| other(*t)).collect();
            assert_eq!(clock(&time_s, &since_s), None, "{since_s:?}");
        }
    }
}
