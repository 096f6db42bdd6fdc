//! Fits of the noise parameters at a given position.

use std::cell::OnceCell;

use base::parameter::GAIN_SD;
use models::model::N_LANES;
pub use posterior::noise::NoiseValues;
use posterior::noise::{
    LearningPrior, NoiseKnowledge, NoiseLearning, NoiseLikelihood, NoiseModel, NoiseScales, RowShare, SharedPosition,
};
use sampling::ensemble::RandomStream;

/// Logarithms of the noise's parameters.
pub(super) type LogNoise = NoiseValues;

/// Priors of the noise parameters, and the ends of their search.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NoisePrior {
    learning: NoiseLearning,
    /// Marks parameters of noise terms that the model lacks; such a parameter stays at its lower end.
    is_absent: Vec<bool>,
}

/// Smallest relative standard deviation of the gain in scores of future cycles: a few cycles cannot show that the gain is smaller. It enters neither the reported noise
/// nor the noise with which errors are compared.
pub(super) const GAIN_FLOOR: f64 = 0.01;

impl NoisePrior {
    /// Makes the priors of the command `sample`, with these exceptions. The standard deviation of white errors is close to the reference noise (given or estimated). If the noise is
    /// estimated, the slow process has a wider prior, because the estimate does not show it. Bounds, if there are any, limit slow noise, gains and offsets.
    pub fn new(model: NoiseModel, scales: &NoiseScales, known: NoiseKnowledge) -> Self {
        let learning = model.learning(scales, known);
        Self { is_absent: vec![false; learning.parameters.len()], learning }
    }

    /// Returns the prior for a model whose noise has only the terms of these names.
    pub fn only(self, terms: &[String]) -> Self {
        let known = self.learning.terms.iter();
        // Every model has white errors.
        let is_absent = known.map(|name| *name != self.learning.terms[0] && !terms.iter().any(|term| term == name));
        Self { is_absent: is_absent.collect(), ..self }
    }

    /// Returns the log prior density, up to a constant. For the standard deviations of white and slow noise and the correlation time, it is a density of logarithms. For the
    /// standard deviations of gain and offset, which may vanish, it is a density of values.
    pub fn ln_density(&self, noise: &LogNoise) -> f64 {
        let parts = self.learning.parameters.iter().zip(noise.iter());
        parts
            .filter_map(|(parameter, ln)| parameter.prior.ln_density(*ln))
            .reduce(|sum, part| sum + part)
            .unwrap_or(0.0)
    }

    /// Adds the Jacobian to `ln_density`: priors of values become densities of logarithms.
    fn with_jacobian(&self, ln_density: f64, noise: &LogNoise) -> f64 {
        let parts = self.learning.parameters.iter().zip(noise.iter());
        let of_values = parts.filter(|(parameter, _)| matches!(parameter.prior, LearningPrior::OfValue(_)));
        of_values.fold(ln_density, |sum, (_, ln)| sum + ln)
    }

    fn ends(&self, index: usize) -> [f64; 2] {
        let [lower, upper] = self.learning.parameters[index].ln_ends;
        [lower, if self.is_absent[index] { lower } else { upper }]
    }

    /// Returns the parameters that describe the scatter from row to row: the index of each, and whether it is a standard deviation.
    pub fn of_rows(&self) -> Vec<(usize, bool)> {
        let all = self.learning.parameters.iter().enumerate();
        all.filter(|(_, learnt_parameter)| learnt_parameter.of_row != RowShare::Nothing)
            .map(|(k, learnt_parameter)| (k, learnt_parameter.of_row == RowShare::Sd))
            .collect()
    }

    /// Clamps noise parameters to the ends of the search.
    pub fn clamped(&self, mut noise: LogNoise) -> LogNoise {
        for (index, value) in noise.iter_mut().enumerate() {
            let [lower, upper] = self.ends(index);
            *value = value.clamp(lower, upper);
        }
        noise
    }

    /// Returns nearly pure white noise of the size of the reference noise (given or estimated). It weights all rows equally.
    pub fn white(&self) -> LogNoise {
        self.clamped(self.learning.parameters.iter().map(|parameter| parameter.ln_white).collect())
    }
}

/// Returns the noise of future cycles: the standard deviation of the gain is at least [`GAIN_FLOOR`].
pub(super) fn of_future(model: NoiseModel, mut noise: NoiseValues) -> NoiseValues {
    if let Some(place) = model.place(&GAIN_SD) {
        noise[place] = noise[place].max(GAIN_FLOOR);
    }
    noise
}

/// Converts logarithms into noise parameters in their units.
pub(super) fn natural(noise: &LogNoise) -> NoiseValues {
    noise.map(f64::exp)
}

/// Log posterior of the noise at a position, for several noises at once.
pub(super) struct Objective<'a> {
    likelihood: &'a NoiseLikelihood,
    prior: &'a NoisePrior,
    position_m: Vec<SharedPosition>,
}

impl<'a> Objective<'a> {
    pub fn new(likelihood: &'a NoiseLikelihood, prior: &'a NoisePrior, position_m: &[f64]) -> Self {
        Self { likelihood, prior, position_m: shared(position_m) }
    }

    pub fn evaluate(&self, points: &[LogNoise]) -> Vec<f64> {
        evaluate_at(self.likelihood, self.prior, &self.position_m, points)
    }
}

fn shared(position_m: &[f64]) -> Vec<SharedPosition> {
    position_m.iter().copied().map(SharedPosition).collect()
}

/// Log posterior of the noise at each point. One pass over the rows evaluates up to sixteen points in hardly more time than eight; a chunk of at most eight takes less.
fn evaluate_at(
    likelihood: &NoiseLikelihood,
    prior: &NoisePrior,
    position_m: &[SharedPosition],
    points: &[LogNoise],
) -> Vec<f64> {
    let mut values = Vec::with_capacity(points.len());
    for chunk in points.chunks(2 * N_LANES) {
        let mut out = [0.0; 2 * N_LANES];
        match out.first_chunk_mut::<N_LANES>() {
            Some(few) if chunk.len() <= N_LANES => likelihood.ln_likelihood_shared(position_m, &lanes(chunk), few),
            _ => likelihood.ln_likelihood_shared(position_m, &lanes(chunk), &mut out),
        }
        values.extend(chunk.iter().zip(out).map(|(noise, value)| with_prior(prior, noise, value)));
    }
    values
}

/// Number of groups of starts in a wide search, one per correlation time of the process. The search climbs from the best start of each group.
const N_GROUPS: usize = 3;
const MOST_ROUNDS: usize = 40;
/// Gain (nats) of a round below which the steps become narrower. The search ends when their width is below `NARROWEST`.
const LEAST_GAIN: f64 = 2e-3;
const NARROWEST: f64 = 0.03;
/// Width of the first steps around the noise of another fit, in the logarithm of each parameter.
const SETTLING_WIDTH: f64 = 0.1;

/// Maximises the log posterior of the noise from `from`, and from additional starts if `widely`. Returns the best noise and its log posterior.
pub(super) fn fit(
    likelihood: &NoiseLikelihood,
    prior: &NoisePrior,
    position_m: &[f64],
    from: &LogNoise,
    widely: bool,
) -> (LogNoise, f64) {
    let objective = Objective::new(likelihood, prior, position_m);
    let from = prior.clamped(*from);
    let evaluate = |points: &[LogNoise]| objective.evaluate(points);
    if !widely {
        return climb(&evaluate, prior, &[from], SETTLING_WIDTH);
    }
    let starts: Vec<LogNoise> = prior.learning.starts.iter().map(|start| prior.clamped(*start)).collect();
    // The best starts may lie below different maxima, and a climb along a ridge may stop early. So one start per correlation time of the process is climbed, and the best
    // result is climbed once more.
    let map = starts.chunks(starts.len().div_ceil(N_GROUPS)).map(|starts| climb(&evaluate, prior, starts, 0.3));
    let better = |best: (LogNoise, f64), top: (LogNoise, f64)| if top.1 > best.1 { top } else { best };
    let best = map.fold(climb(&evaluate, prior, &[from], 0.3), better);
    climb(&evaluate, prior, &[best.0], 0.6)
}

/// Fits the noise to each of several residuals (observed less predicted, m, one per row), starting from the noise of another fit. All residuals belong to one position
/// (m), which the noise's gain multiplies. A result is `None` if the first round hardly gains, so that the noise may be kept. That round evaluates the neighbours for all
/// residuals at once.
pub(super) fn settle(
    likelihood: &NoiseLikelihood,
    prior: &NoisePrior,
    position_m: &[f64],
    residuals_m: &[&[f64]],
    from: &LogNoise,
) -> Vec<Option<LogNoise>> {
    let from = prior.clamped(*from);
    let objectives = |residuals_m: &[&[f64]], points: &[LogNoise]| {
        let mut values: Vec<Vec<f64>> = vec![Vec::with_capacity(points.len()); residuals_m.len()];
        for chunk in points.chunks(N_LANES) {
            let found = likelihood.ln_likelihoods_of(residuals_m, position_m, &lanes(chunk));
            for (values, found) in values.iter_mut().zip(found) {
                values.extend(chunk.iter().zip(found).map(|(noise, value)| with_prior(prior, noise, value)));
            }
        }
        values
    };
    let mut points = vec![from];
    points.extend(neighbours(prior, &from, &from.map(|_| SETTLING_WIDTH)));
    let first = objectives(residuals_m, &points);
    let shared_m = shared(position_m);
    let climb = |(residual_m, values): (&&[f64], Vec<f64>)| {
        // Most climbs end after their first trials, which need no separate likelihood.
        let once_cell = OnceCell::new();
        let record = || likelihood.with_observed(&sums(residual_m, position_m));
        let evaluate = |points: &[LogNoise]| {
            if points.len() <= N_LANES {
                return objectives(&[residual_m], points).concat();
            }
            evaluate_at(once_cell.get_or_init(record), prior, &shared_m, points)
        };
        let here =
            Climber { objective: &evaluate, prior, here: from, value: values[0], widths: from.map(|_| SETTLING_WIDTH) };
        let mut climber = here;
        let mut gain = climber.step(&points[1..], &values[1..]);
        let mut has_moved = false;
        for _ in 1..MOST_ROUNDS {
            if gain.is_none_or(|gain| gain <= LEAST_GAIN) {
                break;
            }
            has_moved = true;
            gain = climber.round();
        }
        has_moved.then_some(climber.here)
    };
    residuals_m.iter().zip(first).map(climb).collect()
}

/// Observed positions (m): residuals plus the position.
fn sums(residual_m: &[f64], position_m: &[f64]) -> Vec<Option<f64>> {
    residual_m.iter().zip(position_m).map(|(residual_m, position_m)| Some(residual_m + position_m)).collect()
}

/// Noise parameters in their units, one lane per point; the last point fills the remaining lanes.
fn lanes<const W: usize>(points: &[LogNoise]) -> Vec<[f64; W]> {
    let value = |index: usize, lane: usize| points[lane.min(points.len() - 1)][index].exp();
    (0..points[0].len()).map(|index| std::array::from_fn(|lane| value(index, lane))).collect()
}

fn with_prior(prior: &NoisePrior, noise: &LogNoise, ln_likelihood: f64) -> f64 {
    let total = ln_likelihood + prior.ln_density(noise);
    if total.is_nan() { f64::NEG_INFINITY } else { total }
}

/// Both neighbours of a point along every coordinate, at the distances `widths`.
fn neighbours(prior: &NoisePrior, here: &LogNoise, widths: &LogNoise) -> Vec<LogNoise> {
    let mut points = Vec::with_capacity(2 * here.len());
    for index in 0..here.len() {
        for sign in [1.0, -1.0] {
            let mut point = *here;
            point[index] += sign * widths[index];
            points.push(prior.clamped(point));
        }
    }
    points
}

/// Step along each coordinate to the maximum of the parabola through a point and its two neighbours.
fn parabola_steps(value: f64, around: &[f64], widths: &LogNoise) -> LogNoise {
    NoiseValues::from_fn(widths.len(), |index| {
        let (up, down) = (around[2 * index], around[2 * index + 1]);
        let curvature = up + down - 2.0 * value;
        let width = widths[index];
        if curvature < -1e-9 {
            (0.5 * width * (down - up) / curvature).clamp(-4.0 * width, 4.0 * width)
        } else if up > value + 1e-9 || down > value + 1e-9 {
            2.0 * width * (up - down).signum()
        } else {
            0.0
        }
    })
}

/// Number of sweeps of a random walk before the first draw, and between two draws (`SWEEPS_BETWEEN`).
const SETTLING_SWEEPS: usize = 60;
const SWEEPS_BETWEEN: usize = 12;
/// Range of the random walks' step widths, which are uniform in logarithm: some parameters are known to a hundredth, others hardly.
const WALK: [f64; 2] = [0.04, 2.0];

/// Draws noise parameters from their posterior at a position. Random walks start from a fit and move one coordinate at a time.
pub(super) fn draws(
    likelihood: &NoiseLikelihood,
    prior: &NoisePrior,
    position_m: &[f64],
    from: &LogNoise,
    n: usize,
    stream: &mut RandomStream,
) -> Vec<LogNoise> {
    let objective = Objective::new(likelihood, prior, position_m);
    // Gain and offset have priors of their values, so walks in their logarithms need a Jacobian.
    let density = |points: &[LogNoise]| -> Vec<f64> {
        let values = objective.evaluate(points);
        values.iter().zip(points).map(|(value, point)| prior.with_jacobian(*value, point)).collect()
    };
    let mut walkers = vec![prior.clamped(*from); N_LANES];
    let mut values = density(&walkers);
    let mut drawn = Vec::with_capacity(n + N_LANES);
    let mut sweep = 0;
    while drawn.len() < n {
        for index in 0..from.len() {
            let mut moved = |walker: &LogNoise| {
                let mut moved = *walker;
                moved[index] += WALK[0] * (WALK[1] / WALK[0]).powf(stream.unit()) * stream.normal();
                moved
            };
            let trials: Vec<LogNoise> = walkers.iter().map(&mut moved).collect();
            let tried = density(&trials);
            for (place, trial) in trials.into_iter().enumerate() {
                let is_inside = prior.clamped(trial) == trial;
                if stream.unit().ln() < tried[place] - values[place] && is_inside {
                    (walkers[place], values[place]) = (trial, tried[place]);
                }
            }
        }
        sweep += 1;
        if sweep > SETTLING_SWEEPS && sweep % SWEEPS_BETWEEN == 0 {
            drawn.extend(&walkers);
        }
    }
    drawn.truncate(n);
    drawn
}

/// Maximises any function of the noise parameters from the best of some starts; `width` is the width of the first steps.
pub(super) fn climb(
    objective: &dyn Fn(&[LogNoise]) -> Vec<f64>,
    prior: &NoisePrior,
    starts: &[LogNoise],
    width: f64,
) -> (LogNoise, f64) {
    let mut climber = Climber::new(objective, prior, starts, width);
    for _ in 0..MOST_ROUNDS {
        let Some(gain) = climber.round() else { break };
        if gain <= LEAST_GAIN && climber.widths.iter().all(|width| *width <= NARROWEST) {
            break;
        }
    }
    (climber.here, climber.value)
}

/// State of a climb. Each round evaluates both neighbours along every coordinate, then steps along the parabolas through them; widths adapt.
struct Climber<'a> {
    objective: &'a dyn Fn(&[LogNoise]) -> Vec<f64>,
    prior: &'a NoisePrior,
    here: LogNoise,
    value: f64,
    widths: LogNoise,
}

impl<'a> Climber<'a> {
    fn new(
        objective: &'a dyn Fn(&[LogNoise]) -> Vec<f64>,
        prior: &'a NoisePrior,
        starts: &[LogNoise],
        width: f64,
    ) -> Self {
        let values = objective(starts);
        let best = (0..starts.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
        Self { objective, prior, here: starts[best], value: values[best], widths: starts[best].map(|_| width) }
    }

    /// Makes one round and returns its gain.
    fn round(&mut self) -> Option<f64> {
        let points = neighbours(self.prior, &self.here, &self.widths);
        let around = (self.objective)(&points);
        self.step(&points, &around)
    }

    /// Makes one round with known objective values `around` of the neighbours `points`, and returns its gain.
    fn step(&mut self, points: &[LogNoise], around: &[f64]) -> Option<f64> {
        let Self { objective, prior, here, value, .. } = *self;
        let step = parabola_steps(value, around, &self.widths);
        let mut trials: Vec<LogNoise> = [0.25, 0.5, 1.0, 1.5]
            .iter()
            .map(|length| prior.clamped(NoiseValues::from_fn(here.len(), |index| here[index] + length * step[index])))
            .collect();
        // The largest single-coordinate step alone: along ridges the joint step may overshoot.
        let largest = (0..here.len())
            .max_by(|&a, &b| (around[2 * a].max(around[2 * a + 1])).total_cmp(&around[2 * b].max(around[2 * b + 1])));
        if let Some(index) = largest {
            let mut alone = here;
            alone[index] += step[index];
            trials.push(prior.clamped(alone));
        }
        let tried = objective(&trials);
        let all = points.iter().zip(around).chain(trials.iter().zip(&tried));
        let (best, best_value) = all.max_by(|a, b| a.1.total_cmp(b.1))?;
        let gain = best_value - value;
        for (index, width) in self.widths.iter_mut().enumerate() {
            let moved = (best[index] - here[index]).abs();
            *width = if gain > LEAST_GAIN { moved.clamp(0.4 * *width, 2.0 * *width) } else { 0.4 * *width };
            *width = width.clamp(0.5 * NARROWEST, 1.0);
        }
        if gain > 0.0 {
            (self.here, self.value) = (*best, *best_value);
        }
        Some(gain)
    }
}

#[cfg(test)]
#[path = "noise_fit_tests.rs"]
mod tests;
