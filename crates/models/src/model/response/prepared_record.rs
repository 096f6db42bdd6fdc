//! Rows and commands of a record, prepared once for all parameter points.

use std::collections::HashMap;
use std::ops::Range;

use super::numbers::Real;
use record::Force;

/// Largest difference of steps that count as equal, as a fraction of the record's length. Decimal times such as 0.05 i are not
/// equally spaced in binary, and every distinct step costs an exponential.
const EQUAL_STEP_TOLERANCE: f64 = 1e-13;

/// Number of the latest distinct step lengths that are searched for an equal one. A record with more distinct lengths has hardly
/// any equal steps.
const N_SEARCHED: usize = 64;

/// Rows and commands of a record. Times are measured from the first row.
#[derive(Debug, Clone)]
pub(super) struct PreparedRows {
    pub n_rows: usize,
    /// Time of every row in s.
    pub time_s: Vec<f64>,
    /// Distinct step lengths in s.
    pub step_s: Vec<f64>,
    pub holds: Vec<Hold>,
    pub switches: Vec<Switch>,
    /// Distinct commands. The first command is the zero command before the record.
    pub commands: Vec<PreparedLine>,
    /// `true` if commands change linearly between rows.
    pub is_linear: bool,
    /// Largest size of a command, in N.
    pub largest_n: f64,
    /// Largest difference in s of step lengths that count as equal.
    pub tolerance_s: f64,
}

/// Hold: consecutive rows at the ends of equal steps under one command.
#[derive(Debug, Clone)]
pub(super) struct Hold {
    /// Index of the step length in `step_s`.
    pub step: usize,
    /// Command during the hold. It acts from the row before the hold's first row.
    pub line: PreparedLine,
    /// Rows at the ends of the hold's steps.
    pub rows: Range<usize>,
}

/// Command as a straight line in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PreparedLine {
    /// Start time in s; any time if the command is constant.
    pub from_s: f64,
    /// Command at the start time, in N.
    pub force_n: f64,
    /// Rate of the command, in N/s.
    pub slope_n_per_s: f64,
    /// `true` if the command is positive.
    pub is_positive: bool,
}

impl PreparedLine {
    const ZERO: Self = Self { from_s: 0.0, force_n: 0.0, slope_n_per_s: 0.0, is_positive: false };

    /// Returns the command in N at a time in s.
    pub fn at_n(self, time_s: f64) -> f64 {
        self.force_n + self.slope_n_per_s * (time_s - self.from_s)
    }
}

/// Change of the command at a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Switch {
    /// First row at which the changed command acts.
    pub row: usize,
    pub time_s: f64,
    pub before: PreparedLine,
    pub after: PreparedLine,
    /// Index of the command after the change.
    pub command: usize,
    /// Size of the change, divided by the largest command. It is the command's jump plus the change of its slope times the next step's
    /// length.
    pub relative_size: f64,
}

impl PreparedRows {
    /// Prepares the first `n_rows` rows of a record.
    pub fn new(time_s: &[f64], force: Force<'_>, n_rows: usize) -> Self {
        let n_rows = n_rows.min(time_s.len()).min(force.at_rows_n.len());
        let (time_s, force) = (&time_s[..n_rows], force.first(n_rows));
        let start_s = time_s.first().copied().unwrap_or(0.0);
        let time_s: Vec<f64> = time_s.iter().map(|t| t - start_s).collect();
        let tolerance_s = EQUAL_STEP_TOLERANCE * time_s.last().map_or(0.0, |last| last.abs() + start_s.abs());
        let (mut step_s, mut holds, mut switches) = (Vec::new(), Vec::<Hold>::new(), Vec::new());
        let largest_n = force.at_rows_n.iter().fold(0.0_f64, |largest, force| force.abs().max(largest));
        let (mut commands, mut known) = (vec![PreparedLine::ZERO], HashMap::from([((0.0_f64.to_bits(), 0), 0)]));
        let is_linear = force.is_linear();
        let mut before = PreparedLine::ZERO;
        for row in 1..n_rows {
            let length_s = time_s[row] - time_s[row - 1];
            let step = slot(&mut step_s, length_s, tolerance_s);
            let line = PreparedLine {
                from_s: if is_linear { time_s[row - 1] } else { 0.0 },
                force_n: force.at_rows_n[row - 1],
                slope_n_per_s: force.slope_n_per_s(&time_s, row - 1),
                is_positive: force.is_positive(row - 1),
            };
            let switched = is_linear || line.force_n != before.force_n;
            if switched {
                // Straight lines that begin at different times are different commands.
                let key = ((line.force_n + 0.0).to_bits(), if is_linear { row } else { 0 });
                let command = *known.entry(key).or_insert_with(|| {
                    commands.push(line);
                    commands.len() - 1
                });
                let jump_n = line.force_n - before.at_n(time_s[row - 1]);
                let bend_n = (line.slope_n_per_s - before.slope_n_per_s) * length_s;
                let relative_size = (jump_n.abs() + bend_n.abs()) / largest_n;
                let time_s = time_s[row - 1];
                switches.push(Switch { row: row - 1, time_s, before, after: line, command, relative_size });
            }
            match holds.last_mut() {
                Some(hold) if hold.step == step && !switched => hold.rows.end = row + 1,
                _ => holds.push(Hold { step, line, rows: row..row + 1 }),
            }
            before = line;
        }
        Self { n_rows, time_s, step_s, holds, switches, commands, is_linear, largest_n, tolerance_s }
    }
}

/// Returns the index in `known_s` of a length equal within the tolerance. A new length is appended.
pub(super) fn slot<N: Real>(known_s: &mut Vec<N>, length_s: N, tolerance_s: f64) -> usize {
    let from = known_s.len().saturating_sub(N_SEARCHED);
    match known_s[from..].iter().position(|known| known.is_close(length_s, tolerance_s)) {
        Some(position) => from + position,
        None => {
            known_s.push(length_s);
            known_s.len() - 1
        }
    }
}
