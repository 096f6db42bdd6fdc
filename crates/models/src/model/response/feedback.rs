//! Robot's position under a position-dependent force F_in e^{gx}, with F_in the force at x = 0, x the position and g the gradient.
//! [`super::schedule`] chooses time steps that are short after switches of the command, and [`super::collocation`] takes them.

use pulp::{Arch, Simd, WithSimd};

use super::collocation::{self, CollocationStep};
use super::numbers::{N_LANES, Number};
use super::prepared_record::PreparedRows;
use super::schedule::Schedule;
use super::system::System;
use base::number::PointScalar;
use laws::stages::MAX_GRADIENT_EXPONENT;

/// Computes the position (m) of the robot at every row.
pub fn run<S: Number>(record: &PreparedRows, system: &System<S>, position_m: &mut [S]) {
    let schedule = Schedule::new(record, system);
    let steps: Vec<CollocationStep<S>> =
        schedule.length_s.iter().map(|&length_s| CollocationStep::new(system, length_s, record.is_linear)).collect();
    Arch::new().dispatch(CollocationRun { system, schedule: &schedule, steps: &steps, position_m });
}

/// Returns, for each parameter point, `true` if the exponent g x (gradient times position) stays below [`MAX_GRADIENT_EXPONENT`] in size at
/// every row. NaN counts as `true` here, because another check finds it at the last row.
pub(super) fn are_held<S: Number>(system: &System<S>, position_m: &[S]) -> [bool; N_LANES] {
    Arch::new().dispatch(LargestExponent { system, position_m }).map(|largest| largest < MAX_GRADIENT_EXPONENT)
}

struct LargestExponent<'a, S> {
    system: &'a System<S>,
    position_m: &'a [S],
}

impl<S: Number> WithSimd for LargestExponent<'_, S> {
    type Output = [f64; N_LANES];

    #[inline(always)]
    fn with_simd<V: Simd>(self, _simd: V) -> [f64; N_LANES] {
        let mut largest = [0.0; N_LANES];
        for &position in self.position_m {
            let exponent = self.system.load.gradient_per_m * position;
            for lane in 0..S::N_POINTS {
                let size = exponent.lane(lane).value().abs();
                largest[lane] = if size > largest[lane] { size } else { largest[lane] };
            }
        }
        largest
    }
}

struct CollocationRun<'a, S> {
    system: &'a System<S>,
    schedule: &'a Schedule<S>,
    steps: &'a [CollocationStep<S>],
    position_m: &'a mut [S],
}

impl<S: Number> WithSimd for CollocationRun<'_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<V: Simd>(self, _simd: V) {
        let system = self.system;
        let mut state = collocation::CollocationState::new(system);
        let late_s = system.late_s();
        for piece in &self.schedule.pieces {
            let level = &self.schedule.levels[piece.level];
            let mut level_n = level.force_n;
            if self.schedule.is_linear {
                // Behind a lag, a linearly changing force follows the command with a delay of the lag time.
                level_n += level.slope_n_per_s * (state.now_s - level.from_s - late_s);
                state.slope_n_per_s = level.slope_n_per_s;
            }
            if system.shape.lagging {
                // The difference of the levels is computed first, so that a constant level causes no rounding error.
                state.deficit_n += state.level_n - level_n;
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
