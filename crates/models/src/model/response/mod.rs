//! Reduced model that computes trajectories in closed form from a model's stages: command → load → mechanics → observation (physics §5).
//!
//! The code is generic over plain numbers, numbers with a derivative, and eight parameter points at once. [`system`] converts stages into
//! rates and gains of modes. [`linear`] computes the position under a force that does not depend on the position. [`feedback`] computes the
//! position under a force that does, in time steps that [`schedule`] chooses. [`state_law`] adds the effect of a quantity that depends on a
//! state.

// Loops use the indices of the formulas. Iterator closures would be compiled separately, without the kernels' vector
// instructions.
#![allow(clippy::needless_range_loop)]

mod collocation;
#[cfg(test)]
mod derivative_tests;
mod feedback;
mod grading;
mod linear;
#[cfg(test)]
mod lines_tests;
mod moments;
mod numbers;
mod prepared_record;
mod schedule;
mod state_law;
#[cfg(test)]
mod state_law_tests;
mod system;
#[cfg(test)]
mod tests;

pub use numbers::{Lanes, N_LANES};

use base::error::Result;
use base::number::{Dual, PointScalar, Scalar};
use laws::rheology::TimeWindow;
use laws::stages::{Observation, ReducedField, Stages};
use numbers::{Number, Real, gather};
use prepared_record::PreparedRows;
use record::{Force, OwnedForce};
use system::{PointNumbers, System};

/// Record prepared for the evaluation of models: rows, commanded force and distinct step lengths.
#[derive(Debug, Clone)]
pub struct Response {
    record: PreparedRows,
    window: TimeWindow,
    time_s: Vec<f64>,
    force: OwnedForce,
}

impl Response {
    /// Prepares the first `n_rows` rows of a record from the times (s, strictly increasing) and the commanded force.
    pub fn new<'f>(time_s: &[f64], force: impl Into<Force<'f>>, n_rows: usize) -> Self {
        // The force after the last row does not affect the rows.
        let force = force.into().first(n_rows);
        let record = PreparedRows::new(time_s, force, n_rows);
        let shortest_s = record.step_s.iter().copied().fold(f64::INFINITY, f64::min);
        // A record without steps does not evaluate the law, so any window is suitable.
        let window = match record.time_s.last() {
            Some(&longest_s) if !record.step_s.is_empty() => TimeWindow { shortest_s, longest_s },
            _ => TimeWindow { shortest_s: 1.0, longest_s: 1.0 },
        };
        let (time_s, force) = (time_s[..record.n_rows].to_vec(), force.first(record.n_rows).into());
        Self { record, window, time_s, force }
    }

    /// Converts stages into the numbers that the kernels need. They include the excess of a nonlinear law's position over that of the
    /// linear law.
    fn lowered<T: Real>(&self, stages: &Stages, compliance_per_m: T) -> Result<PointNumbers<T>> {
        let mut point = PointNumbers::new(stages, compliance_per_m, self.window, &self.record)?;
        if let Some(ReducedField::Stepped(stepped)) = &stages.spread {
            let excess_m = T::excess_m(&*stepped.0, stages, compliance_per_m, &self.time_s, self.force.get())?;
            point.excess_m = Some(excess_m);
        }
        if let Some(law) = &stages.state_law {
            point.excess_m = Some(state_law::excess_m(self, stages, law, compliance_per_m)?);
        }
        Ok(point)
    }

    /// Recorded position (m) at every row, as the limit from the left. `compliance_per_m` is the displacement per force at unit creep compliance.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] if the law has no retardation spectrum, if a force gradient makes the position diverge, or if a
    /// position is not finite.
    pub fn trajectory_m(&self, stages: &Stages, compliance_per_m: f64) -> Result<Vec<f64>> {
        let point = self.lowered(stages, compliance_per_m)?;
        let mut position_m = Vec::new();
        let sound = self.run::<f64>(&[&point], &mut position_m)[0];
        if sound { Ok(position_m) } else { Err(stages.load.of::<f64>().divergence_error()) }
    }

    /// Recorded position (m) at every row, with its derivative along the direction of the derivatives in `stages` and
    /// `compliance_per_m`.
    ///
    /// # Errors
    /// Errors of [`Self::trajectory_m`]. [`base::Error::Numerical`] for a derivative with respect to the lag time if the lag is
    /// 0.
    pub fn derivative_m(&self, stages: &Stages, compliance_per_m: Dual) -> Result<Vec<Dual>> {
        stages.load.check_derivative()?;
        let point = self.lowered(stages, compliance_per_m)?;
        let mut position_m = Vec::new();
        let sound = self.run::<Dual>(&[&point], &mut position_m)[0];
        if sound { Ok(position_m) } else { Err(stages.load.of::<f64>().divergence_error()) }
    }

    /// Derivatives of the recorded position by each parameter of the state-dependent function, indexed by parameter and then by
    /// row. The unit is m per unit of the parameter. Empty without such a function.
    ///
    /// # Errors
    /// Errors of [`Self::trajectory_m`].
    pub fn by_function_m(&self, stages: &Stages, compliance_per_m: f64) -> Result<Vec<Vec<f64>>> {
        let Some(law) = &stages.state_law else { return Ok(Vec::new()) };
        let mut point = PointNumbers::<Dual>::new(stages, Dual::constant(compliance_per_m), self.window, &self.record)?;
        let (excess_m, slopes) = state_law::excess_and_slopes_m(self, stages, law, compliance_per_m)?;
        if !(point.shape.is_depth || point.shape.observed) {
            return Ok(slopes);
        }
        let mut position_m = Vec::new();
        let recorded = |slope: Vec<f64>| {
            let both = excess_m.iter().zip(slope);
            point.excess_m = Some(both.map(|(value, derivative)| Dual { value: *value, derivative }).collect());
            self.run::<Dual>(&[&point], &mut position_m);
            position_m.iter().map(|x| x.derivative).collect()
        };
        Ok(slopes.into_iter().map(recorded).collect())
    }

    /// Writes the recorded positions (m) of one to eight parameter points to `position_m`, which has one entry for each row and one lane
    /// for each point. It returns `true` for each point that has a position. A point's bits equal those of [`Self::trajectory_m`] and do
    /// not depend on the other points. Lanes without a point, or whose point has no position, are undefined.
    pub fn trajectories_m(
        &self,
        stages: &[Stages],
        compliance_per_m: &[f64],
        position_m: &mut Vec<Lanes>,
    ) -> [bool; N_LANES] {
        let points: Vec<Option<PointNumbers<f64>>> = stages
            .iter()
            .zip(compliance_per_m)
            .take(N_LANES)
            .map(|(stages, &compliance)| self.lowered(stages, compliance).ok())
            .collect();
        let mut sound = [false; N_LANES];
        let mut waiting: Vec<usize> = (0..points.len()).filter(|&lane| points[lane].is_some()).collect();
        let mut scratch = Vec::new();
        while let Some(shape) = waiting.first().and_then(|&lane| points[lane].as_ref()).map(|point| point.shape) {
            let alike = |lane: &usize| points[*lane].as_ref().is_some_and(|point| point.shape == shape);
            let (group, others): (Vec<usize>, Vec<usize>) = waiting.into_iter().partition(alike);
            waiting = others;
            let members: Vec<&PointNumbers<f64>> = group.iter().filter_map(|&lane| points[lane].as_ref()).collect();
            if group.len() == points.len() {
                return self.run::<Lanes>(&members, position_m);
            } else {
                let of_group = self.run::<Lanes>(&members, &mut scratch);
                position_m.resize(self.record.n_rows, Lanes::constant(0.0));
                for (member, &lane) in group.iter().enumerate() {
                    sound[lane] = of_group[member];
                    for (lanes, row) in position_m.iter_mut().zip(&scratch) {
                        lanes.0[lane] = row.0[member];
                    }
                }
            }
        }
        sound
    }

    /// Computes parameter points of one [`system::SystemShape`]. It returns `true` for each point that has a position.
    fn run<S: Number>(&self, points: &[&PointNumbers<S::Lane>], position_m: &mut Vec<S>) -> [bool; N_LANES] {
        let system = System::<S>::gather(points);
        position_m.resize(self.record.n_rows, S::constant(0.0));
        if let Some(first) = position_m.first_mut() {
            *first = S::constant(0.0);
        }
        let mut sound = [true; N_LANES];
        sound[points.len()..].fill(false);
        if system.shape.feedback {
            feedback::run(&self.record, &system, position_m);
            let held = feedback::are_held(&system, position_m);
            for (sound, held) in sound.iter_mut().zip(held) {
                *sound &= held;
            }
        } else {
            linear::run(&self.record, &system, position_m);
            if system.shape.softening {
                soften(&self.record, &system, position_m);
            }
        }
        for (lane, point) in points.iter().enumerate() {
            for (position, excess) in position_m.iter_mut().zip(point.excess_m.iter().flatten()) {
                position.set_lane(lane, position.lane(lane) + *excess);
            }
        }
        if system.shape.is_depth {
            for position in position_m.iter_mut() {
                *position = depth(*position, &system.observation);
            }
        }
        if system.shape.observed {
            observe(&self.record, &system, position_m);
        }
        // A value that is not finite stays so in all later rows, so checking the last row is enough.
        if let Some(last) = position_m.last() {
            for (lane, sound) in sound.iter_mut().enumerate().take(points.len()) {
                *sound &= last.lane(lane).value().is_finite();
            }
        }
        sound
    }
}

/// Multiplies the position at every row by e^{rt}, with r the softening rate.
fn soften<S: Number>(record: &PreparedRows, system: &System<S>, position_m: &mut [S]) {
    let growths: Vec<S> = record.step_s.iter().map(|&step_s| (system.softening_rate * step_s).exp()).collect();
    let mut factor = S::constant(1.0);
    for hold in &record.holds {
        for position in &mut position_m[hold.rows.clone()] {
            factor = factor * growths[hold.step];
            *position = *position * factor;
        }
    }
}

/// Returns the indenter's depth of every parameter point, from the linear response of the point.
fn depth<S: Number>(linear: S, observation: &Observation<S>) -> S {
    gather(|lane| Observation::depth_m(observation.depth_exponent.lane(lane), linear.lane(lane)))
}

/// Converts the robot's positions into recorded positions.
fn observe<S: Number>(record: &PreparedRows, system: &System<S>, position_m: &mut [S]) {
    for (position, &time_s) in position_m.iter_mut().zip(&record.time_s) {
        *position = system.observation.without_approaches_m(*position, time_s);
    }
    for approach in &system.observation.approaches {
        let decays: Vec<S> = record.step_s.iter().map(|&step_s| approach.remaining_after(step_s)).collect();
        let mut left = S::constant(1.0);
        for hold in &record.holds {
            for position in &mut position_m[hold.rows.clone()] {
                left = left * decays[hold.step];
                *position += approach.drift_m(left);
            }
        }
    }
}
