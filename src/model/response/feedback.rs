//! The robot's position where the force depends on it: F = F_in (1 + g x).
//!
//! While F_in is constant and the gel does not soften, the few modes of a law form a linear system with constant coefficients: steps are exact, by
//! a matrix exponential a level and distinct step ([`super::transition`]). Otherwise [`super::collocation`] is used, on steps that
//! are graded after switches.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::collocation::{self, CollocationStep};
use super::numbers::{N_LANES, Number, Real};
use super::record::{Record, slot};
use super::system::System;
use super::transition::{LARGEST_STATE, Transition};
use crate::effects::LARGEST_FEEDBACK;
use crate::number::PointScalar;

/// Equal steps under one command.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    /// Index of a step's length.
    pub length: usize,
    /// Command in N; zero before the first switch.
    pub force_n: f64,
    /// The rows at the steps' ends; empty for a single step that ends between rows.
    pub rows: Range<usize>,
}

impl Piece {
    #[inline(always)]
    fn n_steps(&self) -> usize {
        self.rows.len().max(1)
    }

    /// The row at the end of a step, if there is one.
    #[inline(always)]
    fn end_row(&self, step: usize) -> Option<usize> {
        if step < self.rows.len() { Some(self.rows.start + step) } else { None }
    }
}

/// All parts in order, and their distinct lengths in s.
pub(super) struct Pieces<N> {
    pub pieces: Vec<Piece>,
    pub length_s: Vec<N>,
    tolerance_s: f64,
    /// Whether a part may not be longer than the time since the last switch.
    graded: bool,
    /// That time at the end of the last part, in s.
    age_s: f64,
}

/// The first graded step after a switch, as a fraction of the part that it begins.
const SHORTEST_GRADED: f64 = 1.0 / (1u64 << 20) as f64;

impl<N: Real> Pieces<N> {
    /// `delay_s` cuts rows where commands come to act; with a `None` they act at rows.
    fn new(record: &Record, delay_s: Option<N>, graded: bool) -> Self {
        let mut pieces = Self {
            pieces: Vec::with_capacity(record.n_rows),
            length_s: Vec::new(),
            tolerance_s: record.tolerance_s,
            graded,
            age_s: 0.0,
        };
        let delay_s = delay_s.unwrap_or(N::constant(0.0));
        let mut switches = record.switches.iter().peekable();
        let mut force_n = 0.0;
        for hold in &record.holds {
            // Not the difference of the rows' times: equal steps are to have equal bits.
            let step_s = record.step_s[hold.step];
            let hold_end_s = record.time_s[hold.rows.end - 1];
            for row in hold.rows.clone() {
                let mut whole = !graded || pieces.age_s >= step_s;
                let mut begin_s = N::constant(0.0);
                let end_time_s = record.time_s[row];
                while let Some(switch) = switches.next_if(|switch| switch.time_s + delay_s.value() < end_time_s) {
                    let at_s = N::constant(switch.time_s - record.time_s[row - 1]) + delay_s;
                    pieces.push(at_s - begin_s, force_n, None);
                    pieces.age_s = 0.0;
                    (begin_s, force_n) = (at_s, switch.after_n);
                    whole = false;
                }
                pieces.push(N::constant(step_s) - begin_s, force_n, Some(row));
                let undisturbed = switches.peek().is_none_or(|next| next.time_s + delay_s.value() >= hold_end_s);
                if whole && undisturbed {
                    pieces.repeat_until(hold.rows.end, step_s);
                    break;
                }
            }
        }
        pieces
    }

    /// Repeats the last part, a whole step, up to the row before `end`.
    fn repeat_until(&mut self, end: usize, step_s: f64) {
        if let Some(last) = self.pieces.last_mut() {
            self.age_s += step_s * (end - last.rows.end) as f64;
            last.rows.end = end;
        }
    }

    /// Adds a part, cut where it is graded.
    fn push(&mut self, length_s: N, force_n: f64, end_row: Option<usize>) {
        let whole_s = length_s.value();
        // A length of zero may still carry a derivative, or end at a row.
        if end_row.is_none() && length_s.is_close(N::constant(0.0), 0.0) {
            return;
        }
        let mut begin_s = 0.0;
        if self.graded && whole_s > self.tolerance_s {
            loop {
                let next_s = self.age_s.max(SHORTEST_GRADED * whole_s) + begin_s;
                if next_s > whole_s * (1.0 - 1e-9) {
                    break;
                }
                self.part(length_s * ((next_s - begin_s) / whole_s), force_n, None);
                self.age_s += next_s - begin_s;
                begin_s = next_s;
            }
        }
        let left = if whole_s > 0.0 { (whole_s - begin_s) / whole_s } else { 1.0 };
        self.part(length_s * left, force_n, end_row);
        self.age_s += whole_s - begin_s;
    }

    fn part(&mut self, length_s: N, force_n: f64, end_row: Option<usize>) {
        // Graded parts are short: what is equal is a matter of their own length.
        let tolerance_s = self.tolerance_s.min(1e-9 * length_s.value().abs());
        let rows = end_row.map_or(0..0, |row| row..row + 1);
        if let Some(last) = self.pieces.last_mut()
            && self.length_s[last.length].is_close(length_s, tolerance_s)
        {
            let same_hold = last.force_n == force_n && !last.rows.is_empty() && last.rows.end == rows.start;
            if same_hold {
                last.rows.end = rows.end;
            } else {
                let length = last.length;
                self.pieces.push(Piece { length, force_n, rows });
            }
            return;
        }
        let length = slot(&mut self.length_s, length_s, tolerance_s);
        self.pieces.push(Piece { length, force_n, rows });
    }
}

/// Position (m) of the robot at every row.
pub(super) fn run<S: Number>(record: &Record, system: &System<S>, position_m: &mut [S]) {
    let shape = system.shape;
    let exact =
        !shape.lagging && !shape.softening && system.oscillating.is_empty() && system.modes.len() <= LARGEST_STATE;
    // Only a single point is delayed here: the parts are its own.
    let delay_s = shape.delayed.then(|| system.delay_s.lane(0));
    let pieces = Pieces::new(record, delay_s, !exact);
    if exact {
        let (transitions, order) = Transition::all(system, &pieces);
        Arch::new().dispatch(ExactRun { system, pieces: &pieces.pieces, transitions: &transitions, order, position_m });
    } else {
        let steps: Vec<CollocationStep<S>> =
            pieces.length_s.iter().map(|&length_s| CollocationStep::new(system, length_s)).collect();
        Arch::new().dispatch(CollocationRun { system, pieces: &pieces.pieces, steps: &steps, position_m });
    }
}

/// Which points' |g x| stay below the limit at every row. What is not a number passes here, and is found at the last row.
pub(super) fn are_small<S: Number>(system: &System<S>, position_m: &[S]) -> [bool; N_LANES] {
    Arch::new().dispatch(LargestFeedback { system, position_m }).map(|largest| largest < LARGEST_FEEDBACK)
}

struct LargestFeedback<'a, S> {
    system: &'a System<S>,
    position_m: &'a [S],
}

impl<S: Number> WithSimd for LargestFeedback<'_, S> {
    type Output = [f64; N_LANES];

    #[inline(always)]
    fn with_simd<V: Simd>(self, _simd: V) -> [f64; N_LANES] {
        let mut largest = [0.0; N_LANES];
        for &position in self.position_m {
            let strength = self.system.gradient * position;
            for lane in 0..S::N_POINTS {
                let size = strength.lane(lane).value().abs();
                largest[lane] = if size > largest[lane] { size } else { largest[lane] };
            }
        }
        largest
    }
}

struct ExactRun<'a, S> {
    system: &'a System<S>,
    pieces: &'a [Piece],
    transitions: &'a [Transition<S>],
    /// Index of each piece's transition.
    order: Vec<usize>,
    position_m: &'a mut [S],
}

impl<S: Number> WithSimd for ExactRun<'_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<V: Simd>(self, _simd: V) {
        match self.system.modes.len() {
            1 => exact_rows::<S, 1>(self),
            2 => exact_rows::<S, 2>(self),
            3 => exact_rows::<S, 3>(self),
            _ => exact_rows::<S, LARGEST_STATE>(self),
        }
    }
}

/// Steps with `B` modes.
#[inline(always)]
fn exact_rows<S: Number, const B: usize>(run: ExactRun<S>) {
    let mut state = [S::constant(0.0); B];
    for (piece, &index) in run.pieces.iter().zip(&run.order) {
        let transition = &run.transitions[index];
        for step in 0..piece.n_steps() {
            let mut next = [S::constant(0.0); B];
            for i in 0..B {
                let mut sum = transition.matrix[i][B];
                for j in 0..B {
                    sum = transition.matrix[i][j].mul_add(state[j], sum);
                }
                next[i] = sum;
            }
            state = next;
            if let Some(row) = piece.end_row(step) {
                let mut sum = transition.offset;
                for y in state {
                    sum = y.mul_add(transition.output, sum);
                }
                run.position_m[row] = sum;
            }
        }
    }
}

struct CollocationRun<'a, S> {
    system: &'a System<S>,
    pieces: &'a [Piece],
    steps: &'a [CollocationStep<S>],
    position_m: &'a mut [S],
}

impl<S: Number> WithSimd for CollocationRun<'_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<V: Simd>(self, _simd: V) {
        let system = self.system;
        let mut state = collocation::State::new(system);
        for piece in self.pieces {
            let level_n = system.scaled_n(piece.force_n) + system.offset_n;
            if system.shape.lagging {
                state.deficit_n = state.deficit_n + state.level_n - level_n;
            }
            state.level_n = level_n;
            for step in 0..piece.n_steps() {
                collocation::advance(system, &self.steps[piece.length], &mut state);
                if let Some(row) = piece.end_row(step) {
                    self.position_m[row] = collocation::position_m(system, &state);
                }
            }
        }
    }
}
