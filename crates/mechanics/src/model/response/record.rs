//! The record's rows and commands, prepared once for all points.

use std::collections::HashMap;
use std::ops::Range;

use super::numbers::Real;
use super::system::Levels;

/// Steps whose lengths differ by less than this fraction of the record's length count as equal: decimal times such as 0.05 i are
/// not equally spaced in binary, and exponentials are dear.
const EQUAL_STEP_TOLERANCE: f64 = 1e-13;

/// How many distinct steps are looked through for an equal one: a record with more has no equal ones worth looking for.
const N_SEARCHED: usize = 64;

/// Most commands, zero included, that are few.
const MOST_FEW_LEVELS: usize = 12;

/// Rows and commands; times are from the first row.
#[derive(Debug, Clone)]
pub(super) struct Record {
    pub n_rows: usize,
    /// Time of every row in s.
    pub time_s: Vec<f64>,
    /// Distinct step lengths in s.
    pub step_s: Vec<f64>,
    pub holds: Vec<Hold>,
    pub switches: Vec<Switch>,
    /// Distinct commands in N; the first, zero, acts before the record.
    pub command_n: Vec<f64>,
    /// Lengths closer than this are equal, in s.
    pub tolerance_s: f64,
}

/// Consecutive rows that are reached by equal steps under an equal command.
#[derive(Debug, Clone)]
pub(super) struct Hold {
    /// Index of the step's length.
    pub step: usize,
    /// Command in N.
    pub force_n: f64,
    /// The rows at the steps' ends.
    pub rows: Range<usize>,
}

/// A change of the command.
#[derive(Debug, Clone, Copy)]
pub(super) struct Switch {
    /// The row from which on it is commanded.
    pub row: usize,
    pub time_s: f64,
    pub before_n: f64,
    pub after_n: f64,
    /// Index of the command after it.
    pub command: usize,
    /// |change| over the largest force.
    pub relative_size: f64,
}

impl Record {
    /// The first `n_rows` rows.
    pub fn new(time_s: &[f64], force_n: &[f64], n_rows: usize) -> Self {
        let n_rows = n_rows.min(time_s.len()).min(force_n.len());
        let (time_s, force_n) = (&time_s[..n_rows], &force_n[..n_rows]);
        let start_s = time_s.first().copied().unwrap_or(0.0);
        let time_s: Vec<f64> = time_s.iter().map(|t| t - start_s).collect();
        let tolerance_s = EQUAL_STEP_TOLERANCE * time_s.last().map_or(0.0, |last| last.abs() + start_s.abs());
        let (mut step_s, mut holds, mut switches) = (Vec::new(), Vec::<Hold>::new(), Vec::new());
        let largest_n = force_n.iter().fold(0.0_f64, |largest, force| force.abs().max(largest));
        let (mut command_n, mut known) = (vec![0.0], HashMap::from([(0.0_f64.to_bits(), 0)]));
        let mut before_n = 0.0;
        for row in 1..n_rows {
            let after_n = force_n[row - 1];
            let step = slot(&mut step_s, time_s[row] - time_s[row - 1], tolerance_s);
            let switched = after_n != before_n;
            if switched {
                let command = *known.entry((after_n + 0.0).to_bits()).or_insert_with(|| {
                    command_n.push(after_n);
                    command_n.len() - 1
                });
                let relative_size = (after_n - before_n).abs() / largest_n;
                let time_s = time_s[row - 1];
                switches.push(Switch { row: row - 1, time_s, before_n, after_n, command, relative_size });
            }
            match holds.last_mut() {
                Some(hold) if hold.step == step && !switched => hold.rows.end = row + 1,
                _ => holds.push(Hold { step, force_n: after_n, rows: row..row + 1 }),
            }
            before_n = after_n;
        }
        Self { n_rows, time_s, step_s, holds, switches, command_n, tolerance_s }
    }

    pub fn levels(&self) -> Levels {
        if self.command_n.len() > MOST_FEW_LEVELS { Levels::Many } else { Levels::Few }
    }
}

/// The index of a length among the known ones, to which it is added where it is new.
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
