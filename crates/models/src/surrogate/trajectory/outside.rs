//! Surrogate of an external program for one record. It fits a few time modes, whose amplitudes are polynomials in the logarithms
//! of the program's parameters.
//!
//! Errors are measured at points that were not used for training, in units of the noise standard deviation. Factors of the force
//! and an offset enter to first order, by derivatives that are trained over the box. Delays and lags are applied to the
//! trajectory itself (`clocked`).

use rayon::prelude::*;

use super::chart::{Surface, Trained};
use super::clocked::Clock;
use super::polynomial::Basis;
use base::error::{Error, Result, Setting};
use base::number::{Dual, PointScalar};
use laws::stages::{FieldStepper, LoadParameter, LoadUnit, Spatial, Stages};
use record::{Force, OwnedForce};

/// Largest accepted error of the surrogate (time modes and polynomials) at any row, in units of the noise standard deviation.
pub const EXTERNAL_TOLERANCE: f64 = 0.03;
/// Degrees of the polynomials, tried in this order as far as [`EXTERNAL_MAX_POINTS`] permits.
const DEGREES: [usize; 8] = [2, 3, 4, 6, 8, 10, 14, 20];
/// Largest number of training points of a box, without its check points.
pub const EXTERNAL_MAX_POINTS: usize = 700;
/// Largest error, in units of the noise standard deviation, that training may be expected to reach at the highest degree. If the
/// extrapolated error is larger, training ends early, because such a surface would support no conclusion.
const MAX_EXPECTED_ERROR: f64 = 0.5;
/// Lowest degree at which training may end early.
const LEAST_TRIED: usize = 6;
/// Number of points that check a box.
const N_CHECKS: u32 = 24;
/// Change of the load in the finite differences of its derivatives: of a factor of the force, or of the force's offset divided by the
/// largest force.
const LOAD_STEP: f64 = 0.05;
/// Change of the load at which the error of its first-order term is measured: of a factor of the force, or of the force's offset divided
/// by the largest force.
const USUAL_SIZE: f64 = 0.1;

/// Function that returns the position (m) at the clock's times, from the parameters and from the force (N) at these times.
pub type ExternalModelFn<'a> = dyn Fn(&[f64], &[f64]) -> Result<Vec<f64>> + Sync + 'a;

/// Ranges of parameters, and the record, for which a surrogate of an external program is trained.
pub struct ExternalTraining<'a> {
    /// Smallest and largest value of every parameter; equal values if the parameter is fixed.
    pub ends: &'a [(f64, f64)],
    /// Times at which the external program computes positions.
    pub clock: &'a Clock,
    /// Times of the rows, in s.
    pub time_s: &'a [f64],
    /// Commanded force.
    pub force: Force<'a>,
    /// Noise standard deviation (m), which is the unit of errors.
    pub noise_m: f64,
    /// `true` if the acting force may differ from the commanded one.
    pub with_load: bool,
}

/// Trained surrogate of an external program for one record.
#[derive(Debug, Clone)]
pub struct ExternalSurface {
    /// Logarithms of the smallest and largest value of every parameter.
    ln_ends: Vec<(f64, f64)>,
    bases: [Basis; 1],
    surface: Surface,
    /// Surface restricted to the times of the rows.
    at_rows: Surface,
    /// Changes of the position (m) for a unit of the factor of positive forces, of the factor of negative forces and of the offset (N), in
    /// this order. Empty if the force acts as commanded.
    by_load: Vec<Surface>,
    n_points: usize,
}

impl ExternalSurface {
    /// Trains on an increasing number of points until errors at the check points are below [`EXTERNAL_TOLERANCE`], or until no more points
    /// are allowed. `ask` runs the external program. `piece_done` is called after each of its responses, from any thread.
    ///
    /// # Errors
    /// Errors of `ask`, the external program. [`Error::Numerical`] if there are more parameters than the polynomials support.
    pub fn learn(
        lesson: &ExternalTraining<'_>,
        ask: &ExternalModelFn<'_>,
        piece_done: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let ExternalTraining { ends, clock, time_s, force, noise_m, with_load } = *lesson;
        let ln_ends: Vec<(f64, f64)> = ends.iter().map(|(lower, upper)| (lower.ln(), upper.ln())).collect();
        let free: Vec<usize> = (0..ends.len()).filter(|k| ends[*k].0 < ends[*k].1).collect();
        let at = |point: &[f64]| -> Vec<f64> {
            let mut values: Vec<f64> = ends.iter().map(|(lower, _)| *lower).collect();
            for (x, k) in point.iter().zip(&free) {
                let (lower, upper) = ln_ends[*k];
                values[*k] = (0.5 * (lower + upper) + 0.5 * (upper - lower) * x).exp();
            }
            values
        };
        let commanded_n = clock.commanded_n(time_s, force);
        let answers = |points: &[Vec<f64>], force_n: &[f64]| -> Result<Vec<Vec<f64>>> {
            let answer = |point: &Vec<f64>| {
                let found = ask(&at(point), force_n);
                piece_done();
                found
            };
            points.par_iter().map(answer).collect()
        };
        let mut asked: [Vec<Vec<f64>>; 2] = [Vec::new(), Vec::new()];
        let mut best: Option<(Basis, Surface)> = None;
        let is_affordable =
            |degree: &usize| *degree == DEGREES[0] || Basis::n_points(free.len(), *degree) <= EXTERNAL_MAX_POINTS;
        let degrees: Vec<usize> = DEGREES.into_iter().filter(is_affordable).collect();
        let mut before: Option<(usize, f64)> = None;
        for &degree in &degrees {
            let Some(basis) = Basis::new(free.len(), degree, N_CHECKS) else { continue };
            for (known, points) in asked.iter_mut().zip([&basis.checks, &basis.design]) {
                known.extend(answers(&points[known.len()..], &commanded_n)?);
            }
            let runs: Vec<Trained> = asked.iter().flatten().map(|x| (x.clone(), noise_m)).collect();
            let surface = surface(&basis, &runs);
            let is_better = best.as_ref().is_none_or(|(_, other)| surface.certified < other.certified);
            let is_done = surface.certified <= EXTERNAL_TOLERANCE;
            // The error at the highest degree is extrapolated from the decrease between the last two degrees.
            let is_hopeless = before.is_some_and(|(other, error)| {
                let left = (degrees[degrees.len() - 1] - degree) as f64 / (degree - other) as f64;
                degree >= LEAST_TRIED && surface.certified * (surface.certified / error).powf(left) > MAX_EXPECTED_ERROR
            });
            before = Some((degree, surface.certified));
            if is_better {
                best = Some((basis, surface));
            }
            if is_done || is_hopeless || free.is_empty() {
                break;
            }
        }
        let Some((basis, entry)) = best else {
            return Err(Error::numerical(
                format!("no polynomials of {} parameters can be fitted", free.len()),
                format!("fix some of them at values ({})", Setting::Fixed),
            ));
        };
        let n_points = asked[0].len() + asked[1].len();
        let mut by_load = Vec::new();
        if with_load {
            let largest_n = commanded_n.iter().fold(0.0_f64, |most, force_n| most.max(force_n.abs()));
            for number in LoadParameter::of_size() {
                let unit = if number.unit == LoadUnit::Force { largest_n } else { 1.0 };
                let (size, usual) = (LOAD_STEP * unit, USUAL_SIZE * unit);
                let load = number.alone(size).of::<f64>();
                let force_n: Vec<f64> = commanded_n.iter().map(|f| load.entering_n(*f, *f > 0.0)).collect();
                let points = [&basis.checks[..], &basis.design[..]].concat();
                let bare = asked[0].iter().chain(&asked[1][..basis.design.len()]);
                let slope = |(moved, bare): (Vec<f64>, &Vec<f64>)| -> Trained {
                    (moved.iter().zip(bare).map(|(to, from)| (to - from) / size).collect(), noise_m / usual)
                };
                let runs: Vec<Trained> = answers(&points, &force_n)?.into_iter().zip(bare).map(slope).collect();
                by_load.push(surface(&basis, &runs));
            }
        }
        let at_rows = entry.at(&clock.rows);
        Ok(Self { ln_ends, bases: [basis], surface: entry, at_rows, by_load, n_points })
    }

    /// Largest error at points that were not used for training, in units of the noise standard deviation.
    pub fn certified(&self) -> f64 {
        self.by_load.iter().fold(self.surface.certified, |worst, surface| worst.max(surface.certified))
    }

    /// Number of points at which the external program computed trajectories.
    pub fn n_points(&self) -> usize {
        self.n_points
    }
}

fn surface(basis: &Basis, runs: &[Trained]) -> Surface {
    Surface::new(std::slice::from_ref(basis), 0, EXTERNAL_TOLERANCE, &runs.iter().collect::<Vec<_>>())
}

/// Stepper that evaluates the trained surrogate of an external program.
#[derive(Debug)]
pub struct ExternalStepper {
    learnt: ExternalSurface,
    clock: Clock,
    time_s: Vec<f64>,
    force: OwnedForce,
}

impl ExternalStepper {
    /// Returns a stepper for the record of the training.
    pub fn new(learnt: ExternalSurface, lesson: &ExternalTraining<'_>) -> Self {
        let ExternalTraining { clock, time_s, force, .. } = *lesson;
        Self { learnt, clock: clock.clone(), time_s: time_s.to_vec(), force: force.into() }
    }

    fn position_m<N: PointScalar>(&self, stages: &Stages, time_s: &[f64], force: Force<'_>) -> Result<Vec<N>> {
        let n_rows = time_s.len();
        let is_own = self.time_s.get(..n_rows) == Some(time_s)
            && self.force.get().first(force.at_rows_n.len()) == force
            && !stages.load.depends_on_position();
        let (Some(Spatial::External(parameters)), true) = (&stages.spatial, is_own) else {
            return Err(Error::numerical(
                "the surrogate of the other program was trained for another record or force",
                "train it for this record and force",
            ));
        };
        let ExternalSurface { ln_ends, bases, surface, at_rows, by_load, .. } = &self.learnt;
        let mut place = Vec::with_capacity(parameters.len());
        for (value, (lower, upper)) in parameters.iter().zip(ln_ends) {
            let ln = value.ln();
            // Callers may pass an end of the range as a value, whose logarithm is rounded.
            let slack = 1e-12 * (1.0 + lower.abs().max(upper.abs()));
            if !(lower - slack..=upper + slack).contains(&ln.value) {
                return Err(Error::numerical(
                    format!(
                        "the parameter value {} is outside the box in which the surrogate of the other program was trained",
                        value.value
                    ),
                    format!("stay between {} and {}", lower.exp(), upper.exp()),
                ));
            }
            if lower < upper {
                place.push(N::from_dual((ln * 2.0 - Dual::constant(lower + upper)) * (1.0 / (upper - lower))));
            }
        }
        let one = N::constant(1.0);
        if stages.load.is_commanded() {
            return Ok(at_rows.excess_m(bases, &place, one, n_rows));
        }
        if by_load.is_empty() {
            return Err(Error::numerical(
                "the surrogate of the other program was trained for the commanded force only",
                "remove the effects that change the force, such as `force-bias`, from the model",
            ));
        }
        let n = self.clock.n_points(n_rows);
        let changes = |is_delayed: bool| {
            let numbers =
                LoadParameter::of_size().zip(by_load).filter(move |(number, _)| number.is_delayed == is_delayed);
            let by = numbers.map(|(number, surface)| (number.of(&stages.load), surface));
            by.filter(|(by, _)| !by.is_constant(0.0))
                .map(|(by, surface)| surface.excess_m(bases, &place, N::from_dual(by), n))
        };
        let add = |x: &mut Vec<N>, change: Vec<N>| x.iter_mut().zip(change).for_each(|(x, change)| *x += change);
        let mut x = surface.excess_m(bases, &place, one, n);
        changes(true).for_each(|change| add(&mut x, change));
        let mut x = self.clock.delayed_and_lagged(x, &stages.load, true);
        // A force that acts from the record's start is not delayed.
        changes(false).for_each(|change| add(&mut x, self.clock.delayed_and_lagged(change, &stages.load, false)));
        Ok(self.clock.rows[..n_rows].iter().map(|row| x[*row]).collect())
    }
}

impl FieldStepper for ExternalStepper {
    fn excess_m(&self, stages: &Stages, _compliance_per_m: f64, time_s: &[f64], force: Force<'_>) -> Result<Vec<f64>> {
        self.position_m(stages, time_s, force)
    }

    fn excess_dual_m(&self, stages: &Stages, _: f64, time_s: &[f64], force: Force<'_>) -> Result<Vec<Dual>> {
        self.position_m(stages, time_s, force)
    }
}
