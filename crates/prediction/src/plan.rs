//! Force plans: the smallest constant force, or the fastest stepwise force with a rest at the target, that succeeds with a given probability.
//!
//! Half of the draws serve the search. Draws of the other half are checked by full finite elements, so that the promised probability meets a frequency that
//! the search has not seen.

use base::error::{Error, InputPlace, Result};
use documents::prediction::ForceStep;
use nalgebra::{DMatrix, DVector};
use posterior::monitor::Monitor;
use posterior::prepared::KeptSurrogate;
use record::Record;

use crate::ensemble::{Draws, Ensemble, Gel};
use crate::force_history::ForceHistory;
use crate::quantity::time_to_reach_s;
use crate::scenario::Scenario;

/// Largest number of draws that the search uses.
const MOST_PLANNED: usize = 2_000;
/// Number of other draws that full finite elements check, and their number if a run takes seconds or more.
const CHECKED: [usize; 2] = [128, 8];
/// Number of halvings of the interval of the force. The force is then known to 10⁻⁹ of its limit.
const HALVINGS: usize = 30;
/// Number of changes of the force during the rest at the target.
const REST_STEPS: usize = 12;
/// Number of equal steps into which a limited slew rate divides a change of the force.
const SLEW_STEPS: usize = 10;
/// Number of sweeps over the changes of the force in the least-squares search.
const SWEEPS: usize = 2_000;

/// Target of a plan, and the limits of the apparatus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Distance to reach, in m; negative against the positive force.
    pub reach_m: f64,
    /// Time within which it is reached, in s.
    pub within_s: f64,
    /// Requested probability of success.
    pub probability: f64,
    /// Largest absolute force, in N.
    pub largest_force_n: f64,
    /// Largest change of the force per time, in N/s; `None` for no limit.
    pub slew_n_per_s: Option<f64>,
    /// Largest principal strain of the gel; `None` for no limit.
    pub largest_strain: Option<f64>,
    /// Rest at the target; `None` for none.
    pub rest: Option<Rest>,
}

/// Rest at the target after the time of arrival.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rest {
    /// Largest distance from the target, in m.
    pub within_m: f64,
    /// Duration of the rest, in s.
    pub for_s: f64,
}

/// Planned force with its probabilities.
pub struct PlannedForce {
    /// Scenario under the planned force, with the draws of the search.
    pub ensemble: Ensemble,
    /// Changes of the force.
    pub steps: Vec<ForceStep>,
    /// True if the requested probability is reached.
    pub is_feasible: bool,
    /// Probability of success over the draws of the search.
    pub promised: f64,
    /// Share of success over other draws, by full finite elements.
    pub checked: f64,
    /// Number of full-order runs of the check.
    pub full_runs: usize,
    /// Limit that binds; empty if none does.
    pub limit: &'static str,
}

impl Target {
    /// Duration of a plan, in s.
    pub fn duration_s(&self) -> f64 {
        self.within_s + self.rest.map_or(0.0, |rest| rest.for_s)
    }

    /// True if a trajectory reaches the target in time, rests there and stays below the largest strain.
    fn is_met(&self, record: &Record, position_m: &[f64], strain_per_m: f64) -> bool {
        let arrives = time_to_reach_s(record, position_m, self.reach_m) <= self.within_s * (1.0 + 1e-9);
        let rests = self.rest.is_none_or(|rest| {
            let rows = record.time_s.iter().zip(position_m).filter(|(time_s, _)| **time_s >= self.within_s);
            rows.into_iter().all(|(_, x)| (x - self.reach_m).abs() <= rest.within_m)
        });
        // The rest replaces the first passage: a robot that stops just before the target within the tolerance has arrived.
        (if self.rest.is_some() { rests } else { arrives }) && self.strain_is_met(position_m, strain_per_m)
    }

    fn strain_is_met(&self, position_m: &[f64], strain_per_m: f64) -> bool {
        let largest = strain_per_m * position_m.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        self.largest_strain.is_none_or(|limit| largest <= limit)
    }

    /// Time that a full change of the force takes, in s.
    fn ramp_s(&self) -> f64 {
        self.slew_n_per_s.map_or(0.0, |slew| 2.0 * self.largest_force_n / slew)
    }
}

/// Plans the force of a scenario.
///
/// # Errors
/// Errors of the models; [`Error::Input`] if a rest is asked of a model that is not linear.
pub fn plan(
    gel: &Gel<'_>,
    scenario: &Scenario,
    target: &Target,
    kept: Option<KeptSurrogate>,
    monitor: &dyn Monitor,
) -> Result<PlannedForce> {
    let [planned, unused] = halves(&gel.draws);
    let planned = Gel { draws: planned.thinned(MOST_PLANNED), ..*gel };
    let sign = target.reach_m.signum();
    let constant = |force_n: f64| stepped(&[[0.0, sign * force_n]], target.ramp_s());
    let record =
        ForceHistory::Steps(constant(target.largest_force_n)).record(target.duration_s(), &[target.within_s])?;
    let ensemble = Ensemble::new(&planned, scenario, record, kept, monitor)?;
    monitor.stage("searching for the force");
    let is_linear = ensemble.is_linear()?;
    let steps = match target.rest {
        None => constant(smallest_force_n(&ensemble, target, is_linear, &constant)?),
        Some(_) if is_linear => force_with_rest(&ensemble, target)?,
        Some(_) => {
            return Err(Error::input(
                InputPlace::default().at_key("rest"),
                "a rest at the target is planned for models whose position is proportional to the force, and this model's is not",
                "plan without a rest, or use a revision without the nonlinear effect",
            ));
        }
    };
    let record = ForceHistory::Steps(steps.clone()).record(target.duration_s(), &[target.within_s])?;
    let ensemble = ensemble.with_record(record.clone());
    let all = ensemble.trajectories_m(0..ensemble.parameters.len())?;
    let share = |met: usize, n: usize| met as f64 / n.max(1) as f64;
    let strain_per_m = ensemble.strain_per_m;
    let met = all.iter().filter(|x| target.is_met(&record, x, strain_per_m)).count();
    let promised = share(met, all.len());
    let is_feasible = promised >= target.probability;
    let arrived = Target { largest_strain: None, ..*target };
    let without_strain = share(all.iter().filter(|x| arrived.is_met(&record, x, strain_per_m)).count(), all.len());
    let largest_n = steps.iter().fold(0.0_f64, |most, [_, n]| most.max(n.abs()));
    let limit = match () {
        () if is_feasible => "",
        () if without_strain >= target.probability => "strain",
        () if largest_n >= target.largest_force_n * (1.0 - 1e-6) && target.rest.is_none() => "force",
        () if target.rest.is_some() => "uncertainty of the gel",
        () => "force",
    };
    monitor.stage("checking unused draws by full finite elements");
    let other = ensemble.with_draws(&unused.thinned(CHECKED[usize::from(ensemble.is_slow())]), 1);
    let full_m = other.full_trajectories_m(&(0..other.parameters.len()).collect::<Vec<usize>>())?;
    let met = full_m.iter().filter(|x| target.is_met(&record, x, strain_per_m)).count();
    Ok(PlannedForce {
        steps: steps.iter().map(|[time_s, n]| ForceStep { time_s: *time_s, force_un: 1e6 * n }).collect(),
        is_feasible,
        promised,
        checked: share(met, full_m.len()),
        full_runs: full_m.len(),
        limit,
        ensemble,
    })
}

/// Draws with even and odd numbers.
fn halves(draws: &Draws) -> [Draws; 2] {
    [0, 1].map(|first| Draws {
        source: draws.source.clone(),
        names: draws.names.clone(),
        values: draws.values.iter().skip(first).step_by(2).cloned().collect(),
    })
}

/// Changes of the force, each spread over `ramp_s` in equal steps if this is not 0.
fn stepped(changes: &[[f64; 2]], ramp_s: f64) -> Vec<[f64; 2]> {
    if ramp_s == 0.0 {
        return changes.to_vec();
    }
    let mut before_n = 0.0;
    let mut steps = Vec::new();
    for [time_s, force_n] in changes {
        for k in 1..=SLEW_STEPS {
            let share = k as f64 / SLEW_STEPS as f64;
            steps.push([time_s + ramp_s * (share - 0.5 / SLEW_STEPS as f64), before_n + share * (force_n - before_n)]);
        }
        before_n = *force_n;
    }
    steps
}

/// Smallest constant force (N) with the requested probability of arrival; the largest force if none has it.
fn smallest_force_n(
    ensemble: &Ensemble,
    target: &Target,
    is_linear: bool,
    constant: &dyn Fn(f64) -> Vec<[f64; 2]>,
) -> Result<f64> {
    let all = 0..ensemble.parameters.len();
    let record = ensemble.record();
    let at_limit = ensemble.trajectories_m(all.clone())?;
    let share = |force_n: f64| -> Result<f64> {
        let part = force_n / target.largest_force_n;
        let times: Vec<f64> = if is_linear {
            at_limit.iter().map(|x| time_to_reach_s(record, x, target.reach_m / part)).collect()
        } else {
            let history = ForceHistory::Steps(constant(force_n));
            let under_force = ensemble.with_record(history.record(target.duration_s(), &[target.within_s])?);
            under_force
                .trajectories_m(all.clone())?
                .iter()
                .map(|x| time_to_reach_s(record, x, target.reach_m))
                .collect()
        };
        Ok(times.iter().filter(|time_s| **time_s <= target.within_s).count() as f64 / times.len().max(1) as f64)
    };
    if share(target.largest_force_n)? < target.probability {
        return Ok(target.largest_force_n);
    }
    let [mut fails_n, mut succeeds_n] = [0.0, target.largest_force_n];
    for _ in 0..HALVINGS {
        let middle_n = 0.5 * (fails_n + succeeds_n);
        if share(middle_n)? >= target.probability {
            succeeds_n = middle_n;
        } else {
            fails_n = middle_n;
        }
    }
    Ok(succeeds_n)
}

/// Fastest stepwise force: the largest force until the mean arrives, then steps that keep the mean at the target in the sense of least squares.
fn force_with_rest(ensemble: &Ensemble, target: &Target) -> Result<Vec<[f64; 2]>> {
    let record = ensemble.record();
    let mean_m = mean(&ensemble.trajectories_m(0..ensemble.parameters.len())?);
    // Response of the mean to a step to the largest force, against the time since the step.
    let response_m = |since_s: f64| if since_s <= 0.0 { 0.0 } else { interpolated(&record.time_s, &mean_m, since_s) };
    let arrival_s = time_to_reach_s(record, &mean_m, target.reach_m);
    if arrival_s > target.within_s {
        return Ok(stepped(&[[0.0, target.reach_m.signum() * target.largest_force_n]], target.ramp_s()));
    }
    let (ramp_s, end_s) = (target.ramp_s(), target.duration_s());
    let begin_s = (arrival_s - ramp_s).max(0.0);
    // The changes follow each other ever more slowly, as the creep of the gel does.
    let change_s = |k: usize| begin_s + (end_s - begin_s) * (k as f64 / REST_STEPS as f64).powi(2);
    let mut changes_s: Vec<f64> = vec![0.0];
    for k in 0..REST_STEPS {
        let time_s = change_s(k);
        if time_s - changes_s[changes_s.len() - 1] >= ramp_s.max(1e-3 * end_s) {
            changes_s.push(time_s);
        }
    }
    let rows: Vec<f64> = record.time_s.iter().copied().filter(|time_s| *time_s >= arrival_s.max(1e-9)).collect();
    let matrix = DMatrix::from_fn(rows.len(), changes_s.len(), |row, k| {
        // The force of interval k acts from its change until the next.
        let until = changes_s.get(k + 1).map_or(0.0, |next_s| response_m(rows[row] - next_s));
        response_m(rows[row] - changes_s[k]) - until
    });
    let wanted = DVector::from_element(rows.len(), target.reach_m);
    let sign = target.reach_m.signum();
    let parts = bounded_least_squares(&matrix, &wanted, changes_s.len());
    let changes: Vec<[f64; 2]> =
        changes_s.iter().zip(&parts).map(|(time_s, part)| [*time_s, sign * part * target.largest_force_n]).collect();
    Ok(stepped(&changes, ramp_s))
}

/// Mean trajectory.
fn mean(trajectories_m: &[Vec<f64>]) -> Vec<f64> {
    let n = trajectories_m.len().max(1) as f64;
    let n_rows = trajectories_m.first().map_or(0, Vec::len);
    (0..n_rows).map(|row| trajectories_m.iter().map(|x| x[row]).sum::<f64>() / n).collect()
}

/// Value at a time between rows, by a straight line; the last value beyond the rows.
fn interpolated(time_s: &[f64], values: &[f64], at_s: f64) -> f64 {
    let next = time_s.partition_point(|time| *time < at_s);
    match (next.checked_sub(1), values.get(next)) {
        (Some(before), Some(value)) => {
            let share = (at_s - time_s[before]) / (time_s[next] - time_s[before]);
            values[before] + share * (value - values[before])
        }
        (None, Some(value)) => *value,
        _ => values[values.len() - 1],
    }
}

/// Minimises |A x − b|² over x between −1 and 1, by descent in one coordinate after the other. The first coordinate begins at 1.
fn bounded_least_squares(matrix: &DMatrix<f64>, wanted: &DVector<f64>, n: usize) -> Vec<f64> {
    let mut x = DVector::zeros(n);
    x[0] = 1.0;
    let mut residual = matrix * &x - wanted;
    let square: Vec<f64> = (0..n).map(|k| matrix.column(k).norm_squared()).collect();
    for _ in 0..SWEEPS {
        for k in 0..n {
            if square[k] > 0.0 {
                let old: f64 = x[k];
                x[k] = (old - matrix.column(k).dot(&residual) / square[k]).clamp(-1.0, 1.0);
                residual.axpy(x[k] - old, &matrix.column(k), 1.0);
            }
        }
    }
    x.iter().copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounded_least_squares_finds_the_constrained_minimum() {
        // Unconstrained minimum (2, 0.5): the first coordinate stays at its bound, and the second compensates.
        let matrix = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, 1.0]);
        let x = bounded_least_squares(&matrix, &DVector::from_vec(vec![2.5, 0.5]), 2);
        assert!((x[0] - 1.0).abs() < 1e-12 && (x[1] - 1.0).abs() < 1e-9, "{x:?}");
    }

    #[test]
    fn a_limited_slew_rate_divides_changes_into_small_steps() {
        let steps = stepped(&[[0.0, 1.0], [5.0, -1.0]], 2.0);
        assert_eq!(steps.len(), 2 * SLEW_STEPS);
        let fastest = steps
            .windows(2)
            .map(|pair| ((pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0])).abs())
            .fold(0.0, f64::max);
        assert!(fastest <= 1.0 + 1e-9, "{fastest}");
        assert_eq!(steps[steps.len() - 1][1], -1.0);
    }
}
