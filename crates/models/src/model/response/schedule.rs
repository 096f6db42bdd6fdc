//! Time steps for forces that depend on the position. A step ends at the next row or where a command begins to act. Steps after a
//! switch of the command are short and then grow.
//!
//! The tests check positions to 1e-8 of their amplitude, against exact solutions and against much finer steps. Their forces are
//! constant between switches, change at every row by up to their own size, or vary smoothly.

use std::collections::HashMap;
use std::ops::Range;

use super::grading::{N_SIZES, SIZE_RATIO};
use super::numbers::{N_LANES, Number, Real, gather};
use super::prepared_record::{PreparedLine, PreparedRows, slot};
use super::system::System;

/// Largest step after a switch, divided by the time since the switch, for each class of switches by size.
const SHARE_OF_AGE: [f64; N_SIZES] = [0.5, 1.0, 1.0];
/// Limits that replace [`SHARE_OF_AGE`] behind a lag. A lag changes the force itself and needs smaller steps.
const SHARE_OF_AGE_BEHIND_LAG: [f64; N_SIZES] = [0.25, 0.5, 1.0];

/// Largest number of times that the step between two rows is halved.
const MOST_HALVINGS: usize = 60;

/// Consecutive equal time steps under one level of the force.
#[derive(Debug, Clone)]
pub(super) struct SchedulePiece {
    /// Index of the step length in [`Schedule::length_s`].
    pub length: usize,
    /// Index of the force in [`Schedule::levels`].
    pub level: usize,
    /// Rows at the ends of the steps; empty for a single step that ends between rows.
    pub rows: Range<usize>,
}

impl SchedulePiece {
    #[inline(always)]
    pub fn n_steps(&self) -> usize {
        self.rows.len().max(1)
    }

    /// Row at the end of a step; `None` if the step ends between rows.
    #[inline(always)]
    pub fn end_row(&self, step: usize) -> Option<usize> {
        if step < self.rows.len() { Some(self.rows.start + step) } else { None }
    }
}

/// Time steps of all parameter points, in the order of time.
pub(super) struct Schedule<S> {
    pub pieces: Vec<SchedulePiece>,
    /// Distinct step lengths of all parameter points, in s.
    pub length_s: Vec<S>,
    /// Distinct levels of the force before the lag.
    pub levels: Vec<Level<S>>,
    /// `true` if levels change linearly while they act.
    pub is_linear: bool,
}

/// Force before the lag, as a straight line in time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Level<S> {
    /// Force in N at the time `from_s`, offset included.
    pub force_n: S,
    /// Rate of the force, in N/s.
    pub slope_n_per_s: S,
    /// Time in s at which the force begins to act; unused if the force is constant.
    pub from_s: S,
}

impl<S: Number> Schedule<S> {
    pub fn new(record: &PreparedRows, system: &System<S>) -> Self {
        let level = |line: &PreparedLine| {
            let (force_n, slope_n_per_s) = system.scaled(*line, line.from_s);
            let from_s = system.load.action_time_s(line.from_s);
            Level { force_n: force_n + system.load.start_n(), slope_n_per_s, from_s }
        };
        let of_command: Vec<Level<S>> = record.commands.iter().map(level).collect();
        let is_linear = record.is_linear;
        let of_lane = |lane: usize| {
            let delay_s = system.shape.delayed.then(|| system.load.delay_s.lane(lane));
            let longest_s = system.gradings[lane].longest_s();
            let share_of_age = if system.shape.lagging { SHARE_OF_AGE_BEHIND_LAG } else { SHARE_OF_AGE };
            Parts::new(record, delay_s, longest_s, share_of_age)
        };
        let [first, others @ ..] = &system.gradings;
        let are_alike = !system.shape.delayed && others.iter().all(|other| other == first);
        if are_alike || S::N_POINTS == 1 {
            let Parts { pieces, length_s, .. } = of_lane(0);
            let length_s = length_s.into_iter().map(|length_s| gather::<S>(|_| length_s)).collect();
            return Self { pieces, length_s, levels: of_command, is_linear };
        }
        let parts: Vec<Parts<S::Lane>> = (0..S::N_POINTS).map(of_lane).collect();
        ScheduleJoint::new(record, &parts).schedule(&parts, &of_command, is_linear)
    }
}

/// Index of a step length or of a level for each parameter point.
type Indices = [u32; N_LANES];

/// Common pieces (runs of equal time steps) of several parameter points. If a point has fewer pieces between two rows than another point,
/// it waits in steps of length 0.
struct ScheduleJoint {
    pieces: Vec<SchedulePiece>,
    lengths: Distinct,
    levels: Distinct,
}

/// Distinct combinations of the parameter points' indices, in the order in which they were added.
#[derive(Default)]
struct Distinct {
    list: Vec<Indices>,
    known: HashMap<Indices, usize>,
}

impl Distinct {
    fn index(&mut self, indices: Indices) -> usize {
        *self.known.entry(indices).or_insert_with(|| {
            self.list.push(indices);
            self.list.len() - 1
        })
    }

    fn gathered<S: Number>(&self, of_lane: impl Fn(usize, usize) -> S::Lane) -> Vec<S> {
        self.list.iter().map(|indices| gather::<S>(|lane| of_lane(lane, indices[lane] as usize))).collect()
    }

    fn levels<S: Number>(&self, of_command: &[Level<S>]) -> Vec<Level<S>> {
        let level = |indices: &Indices| {
            let gathered =
                |of: fn(&Level<S>) -> S| gather::<S>(|lane| of(&of_command[indices[lane] as usize]).lane(lane));
            Level {
                force_n: gathered(|level| level.force_n),
                slope_n_per_s: gathered(|level| level.slope_n_per_s),
                from_s: gathered(|level| level.from_s),
            }
        };
        self.list.iter().map(level).collect()
    }
}

/// Place of one parameter point in its list of pieces, while the lists of all points are joined.
#[derive(Clone, Copy)]
struct Cursor {
    piece: usize,
    /// Number of pieces before the piece that ends at the next row.
    n_before: usize,
    /// Number of rows in the piece that ends at the next row, from that row on.
    n_rows: usize,
}

impl ScheduleJoint {
    fn new<N>(record: &PreparedRows, parts: &[Parts<N>]) -> Self {
        let mut joint = Self { pieces: Vec::new(), lengths: Distinct::default(), levels: Distinct::default() };
        let mut cursors = [Cursor { piece: 0, n_before: 0, n_rows: 0 }; N_LANES];
        let mut row = 1;
        while row < record.n_rows {
            for (cursor, parts) in cursors.iter_mut().zip(parts) {
                let ahead = &parts.pieces[cursor.piece..];
                cursor.n_before = ahead.iter().take_while(|piece| piece.rows.is_empty()).count();
                cursor.n_rows = ahead.get(cursor.n_before).map_or(1, |piece| piece.rows.end - row);
            }
            let entry = &cursors[..parts.len()];
            let n_before = entry.iter().map(|cursor| cursor.n_before).max().unwrap_or(0);
            let n_rows = entry.iter().map(|cursor| cursor.n_rows).min().unwrap_or(1);
            for place in 0..=n_before {
                let (mut lengths, mut levels) = ([0; N_LANES], [0; N_LANES]);
                for (lane, (cursor, parts)) in cursors.iter().zip(parts).enumerate() {
                    let waits = n_before - cursor.n_before;
                    if place >= waits {
                        let piece = &parts.pieces[cursor.piece + place - waits];
                        (lengths[lane], levels[lane]) = (piece.length as u32, piece.level as u32);
                    } else if let Some(before) =
                        cursor.piece.checked_sub(usize::from(!parts.is_within(cursor.piece, row)))
                    {
                        levels[lane] = parts.pieces[before].level as u32;
                    }
                }
                let rows = if place == n_before { row..row + n_rows } else { 0..0 };
                let (length, level) = (joint.lengths.index(lengths), joint.levels.index(levels));
                joint.pieces.push(SchedulePiece { length, level, rows });
            }
            row += n_rows;
            for (cursor, parts) in cursors.iter_mut().zip(parts) {
                cursor.piece += cursor.n_before;
                if parts.pieces.get(cursor.piece).is_some_and(|piece| piece.rows.end <= row) {
                    cursor.piece += 1;
                }
            }
        }
        joint
    }

    fn schedule<S: Number>(self, parts: &[Parts<S::Lane>], of_command: &[Level<S>], is_linear: bool) -> Schedule<S> {
        Schedule {
            length_s: self.lengths.gathered(|lane, index| parts[lane].length_s[index]),
            levels: self.levels.levels(of_command),
            pieces: self.pieces,
            is_linear,
        }
    }
}

/// Schedule of one parameter point, with its pieces in the order of time. `length_s` has the distinct step lengths in s, and the first of
/// them is 0.
struct Parts<N> {
    pieces: Vec<SchedulePiece>,
    length_s: Vec<N>,
    /// Distinct lengths in s before they are halved.
    whole_s: Vec<N>,
    /// Indices in `length_s` of each whole length after 0, 1, 2, … halvings.
    halved: Vec<[u32; MOST_HALVINGS + 1]>,
    tolerance_s: f64,
    /// Longest step in s just after a switch, for each class of switches.
    longest_s: [f64; N_SIZES],
    /// Largest length of a later step, divided by the time since the switch, for each class.
    share_of_age: [f64; N_SIZES],
    /// Time in s since the last switch, for each class.
    age_s: [f64; N_SIZES],
}

impl<N> Parts<N> {
    /// Returns `true` if the piece starts before the row and has steps that end at rows.
    fn is_within(&self, piece: usize, row: usize) -> bool {
        self.pieces.get(piece).is_some_and(|piece| !piece.rows.is_empty() && piece.rows.start < row)
    }
}

impl<N: Real> Parts<N> {
    /// Returns the schedule of one parameter point. A command begins to act `delay_s` after its row, and the step between rows is cut
    /// there. With `None`, commands act at rows.
    fn new(record: &PreparedRows, delay_s: Option<N>, longest_s: [f64; N_SIZES], share_of_age: [f64; N_SIZES]) -> Self {
        let mut age_s = [f64::INFINITY; N_SIZES];
        // A force that acts from the start, such as an offset, may have any size. It counts as a switch of the largest class.
        age_s[0] = 0.0;
        let mut parts = Self {
            pieces: Vec::with_capacity(record.n_rows),
            length_s: vec![N::constant(0.0)],
            whole_s: Vec::new(),
            halved: Vec::new(),
            tolerance_s: record.tolerance_s,
            longest_s,
            share_of_age,
            age_s,
        };
        let delay_s = delay_s.unwrap_or(N::constant(0.0));
        let mut switches = record.switches.iter().peekable();
        let mut command = 0;
        for hold in &record.holds {
            // Equal steps share this length. Differences of the rows' times would have different bits.
            let step_s = record.step_s[hold.step];
            let hold_end_s = record.time_s[hold.rows.end - 1];
            for row in hold.rows.clone() {
                let mut is_whole = parts.longest_step_s() >= step_s * (1.0 - ROUNDING);
                let mut begin_s = N::constant(0.0);
                let end_time_s = record.time_s[row];
                while let Some(switch) = switches.next_if(|switch| switch.time_s + delay_s.value() < end_time_s) {
                    let at_s = N::constant(switch.time_s - record.time_s[row - 1]) + delay_s;
                    parts.push(at_s - begin_s, command, None);
                    parts.age_s[class(switch.relative_size)] = 0.0;
                    (begin_s, command) = (at_s, switch.command);
                    is_whole = false;
                }
                parts.push(N::constant(step_s) - begin_s, command, Some(row));
                let undisturbed = switches.peek().is_none_or(|next| next.time_s + delay_s.value() >= hold_end_s);
                if is_whole && undisturbed {
                    parts.repeat_until(hold.rows.end, step_s);
                    break;
                }
            }
        }
        parts
    }

    /// Longest step in s that all earlier switches allow.
    fn longest_step_s(&self) -> f64 {
        let mut longest_s = f64::INFINITY;
        for class in 0..N_SIZES {
            longest_s = longest_s.min(self.longest_s[class].max(self.share_of_age[class] * self.age_s[class]));
        }
        longest_s
    }

    fn pass(&mut self, time_s: f64) {
        self.age_s.iter_mut().for_each(|age_s| *age_s += time_s);
    }

    /// Extends the last piece, a whole step between rows, up to the row before `end`.
    fn repeat_until(&mut self, end: usize, step_s: f64) {
        if let Some(last) = self.pieces.last_mut() {
            let n_rows = end - last.rows.end;
            last.rows.end = end;
            self.pass(step_s * n_rows as f64);
        }
    }

    /// Adds an interval under one level. The interval is cut into halves, quarters and so on until the steps are short enough, so that few
    /// lengths are distinct.
    fn push(&mut self, length_s: N, level: usize, end_row: Option<usize>) {
        // A length of zero may still carry a derivative, or end at a row.
        if end_row.is_none() && length_s.is_close(N::constant(0.0), 0.0) {
            return;
        }
        let tolerance_s = self.tolerance_s.min(1e-9 * length_s.value().abs());
        let whole = slot(&mut self.whole_s, length_s, tolerance_s);
        if whole == self.halved.len() {
            self.halved.push([UNKNOWN; MOST_HALVINGS + 1]);
        }
        let whole_s = length_s.value();
        let (mut left, mut share, mut n_halvings) = (1.0, 1.0, 0);
        while left > 0.0 {
            let longest_s = self.longest_step_s() * (1.0 + ROUNDING);
            // The next step is the longest allowed step that fits into the remaining interval, which is always a sum of halves, quarters
            // and so on.
            while n_halvings > 0 && 2.0 * share <= left && 2.0 * share * whole_s <= longest_s {
                (share, n_halvings) = (2.0 * share, n_halvings - 1);
            }
            while share > left || (share * whole_s > longest_s && n_halvings < MOST_HALVINGS) {
                (share, n_halvings) = (0.5 * share, n_halvings + 1);
            }
            left -= share;
            let length = self.length(whole, n_halvings, share);
            self.part(length, level, end_row.filter(|_| left == 0.0));
            self.pass(share * whole_s);
        }
    }

    /// Returns the index in `length_s` of a whole length after n = `n_halvings` halvings. `share` is the remaining fraction 2⁻ⁿ of the
    /// length.
    fn length(&mut self, whole: usize, n_halvings: usize, share: f64) -> usize {
        if self.halved[whole][n_halvings] == UNKNOWN {
            self.halved[whole][n_halvings] = self.length_s.len() as u32;
            self.length_s.push(self.whole_s[whole] * share);
        }
        self.halved[whole][n_halvings] as usize
    }

    fn part(&mut self, length: usize, level: usize, end_row: Option<usize>) {
        let rows = end_row.map_or(0..0, |row| row..row + 1);
        if let Some(last) = self.pieces.last_mut()
            && (last.length, last.level) == (length, level)
            && !last.rows.is_empty()
            && last.rows.end == rows.start
        {
            last.rows.end = rows.end;
            return;
        }
        self.pieces.push(SchedulePiece { length, level, rows });
    }
}

const UNKNOWN: u32 = u32::MAX;
/// Relative rounding error allowed for the times since a switch, which are sums of step lengths.
const ROUNDING: f64 = 1e-9;

/// Class of a switch by its size divided by the largest force. Class 0 has the largest switches.
fn class(relative_size: f64) -> usize {
    let mut class = 0;
    while class + 1 < N_SIZES && relative_size * SIZE_RATIO.powi(class as i32 + 1) <= 1.0 {
        class += 1;
    }
    class
}

#[cfg(test)]
#[path = "schedule_tests.rs"]
mod tests;
