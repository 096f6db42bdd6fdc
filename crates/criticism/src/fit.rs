//! The best-fit parameters and noise of a candidate.
//!
//! The objective is the log likelihood of the fitted positions, noise included, plus the log priors of the law's parameters and of the noise. Parameters of effects have
//! ends but no prior in the objective. A model that contains another model therefore never fits worse, and its gain is a likelihood ratio.
//!
//! The search alternates between the mean and the noise. The mean takes Gauss–Newton steps on whitened residuals, with finite-difference derivatives and several damped
//! steps tried at once. Few rounds are needed, since the Fisher information of a Gaussian model has no cross terms between mean and noise. If trajectories are slow,
//! Broyden's rule updates the derivatives after each step. They are computed anew if the steps gain less than predicted, and before a search ends.

use super::candidate::{Coordinate, Free};
use super::derivatives::derivatives_m;
use super::elsewhere::Elsewhere;
use super::noise_fit::{self, LogNoise, NoisePrior};
use super::steps::{Steps, damped_steps, normal_equations};
use super::{Candidate, Subject};
use crate::NoiseValues;
use base::error::{Error, Result};
use models::model::{Lanes, N_LANES};
use posterior::noise::NoiseScales;

/// Fraction of the predicted gain of a step. If the actual gain exceeds it, no further steps are tried.
pub(super) const SUFFICIENT_GAIN_RATIO: f64 = 0.3;
/// Number of steps tried with Broyden's derivatives before the derivatives are computed anew.
const N_BY_GUESS: usize = 2;
/// Largest squared distance of two climbs that are at one optimum: the sum over fitted rows of the squared difference of their positions, in units of the noise. The second
/// climb then ends, unless its objective is higher by more than [`HIGHER_NATS`].
const SAME_PLACE: f64 = 0.1;
const HIGHER_NATS: f64 = 0.01;
/// Starting sizes, besides the null, of effects whose response begins with the square of their size.
const FULL_SIZES: [f64; 2] = [1.0, 0.5];
/// Values of [`Search::least_gains`] for laws with a quantity that depends on a state. A formula that fits badly would otherwise take hundreds of steps that gain a
/// hundredth of a nat each.
const LEAST_GAINS_OF_STATE_LAWS: [f64; 2] = [2e-2, 5e-2];
const MOST_STEPS: usize = 60;
const MOST_ROUNDS: usize = 12;

/// Thoroughness of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Search {
    /// Many starts, with white noise and with the noise of other fits; for measured data.
    Wide,
    /// The best of a few starts around other fits, for data simulated without the effect.
    Local,
}

impl Search {
    /// Returns two least gains (nats). The mean has converged if a step gains less than the first. Mean and noise have converged if a round gains less than the second.
    /// Steps whose trajectories are computed one by one need a larger gain.
    fn least_gains(self, is_slow: bool) -> [f64; 2] {
        match (self, is_slow) {
            (Self::Wide, false) => [1e-4, 3e-3],
            (Self::Wide, true) => [1e-3, 3e-3],
            (Self::Local, _) => [3e-3, 2e-2],
        }
    }
}

/// Best fit of a candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// Coordinates: free parameters, then amplitudes of columns.
    pub theta: Vec<f64>,
    /// Noise parameters in their units.
    pub noise: NoiseValues,
    /// Position (m) at every row of the record.
    pub position_m: Vec<f64>,
    /// Log likelihood of the fitted positions plus log priors of law and noise, in nats, up to constants that all candidates share.
    pub objective: f64,
    /// Log likelihood of the fitted positions, in nats; it is a density of positions in m.
    pub ln_likelihood: f64,
}

impl Fitted {
    /// Root mean square residual (m) of the given positions; `None` if there are none.
    pub fn rmse_m(&self, positions_m: &[Option<f64>]) -> Option<f64> {
        let squares: Vec<f64> =
            positions_m.iter().zip(&self.position_m).filter_map(|(y, x)| Some((y.as_ref()? - x).powi(2))).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
}

/// A point of a climb: parameters, noise, and the objective there.
#[derive(Clone)]
struct FitPoint {
    theta: Vec<f64>,
    position_m: Vec<f64>,
    log_noise: LogNoise,
    objective: f64,
    /// Derivatives of the position (m per unit of the coordinate) at `theta`, if known. They do not depend on the noise.
    columns_m: Option<Vec<Vec<f64>>>,
    /// True if Broyden's rule gave the derivatives.
    is_guessed: bool,
}

impl FitPoint {
    /// Moves to a better point. Broyden's rule updates the derivatives with respect to the first `n_guessed` coordinates, by the smallest change that agrees with the
    /// move. If none of these coordinates moved, the derivatives are dropped.
    fn move_to(&mut self, theta: &[f64], position_m: Vec<f64>, objective: f64, n_guessed: usize) {
        let moved: Vec<f64> = theta.iter().zip(&self.theta).map(|(new, old)| new - old).collect();
        let squared: f64 = moved[..n_guessed].iter().map(|step| step * step).sum();
        self.columns_m = self.columns_m.take().filter(|_| squared > 0.0).map(|mut columns| {
            let missed_m: Vec<f64> = (0..position_m.len())
                .map(|row| {
                    let foreseen: f64 = columns.iter().zip(&moved).map(|(column, step)| column[row] * step).sum();
                    position_m[row] - self.position_m[row] - foreseen
                })
                .collect();
            for (column, step) in columns.iter_mut().zip(&moved[..n_guessed]) {
                column.iter_mut().zip(&missed_m).for_each(|(x, missed)| *x += missed * step / squared);
            }
            columns
        });
        self.is_guessed = self.columns_m.is_some();
        self.theta.clear();
        self.theta.extend_from_slice(theta);
        self.position_m = position_m;
        self.objective = objective;
    }

    fn drop_broyden_derivatives(&mut self) {
        if self.is_guessed {
            (self.columns_m, self.is_guessed) = (None, false);
        }
    }
}

impl Subject {
    /// Fits a candidate from the search's own starts and from `also`: coordinates and noise of other fits.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the candidate's model has no solution at any start.
    pub fn fit(&self, candidate: &Candidate, also: &[(Vec<f64>, NoiseValues)], search: Search) -> Result<Fitted> {
        self.fit_beside(candidate, also, search, None)
    }

    /// A candidate at the middle of its priors, with white noise of the known size. No position is used.
    ///
    /// # Errors
    /// As [`Subject::trajectory_m`].
    pub fn at_prior(&self, candidate: &Candidate) -> Result<Fitted> {
        let middle = |free: &Free| free.clamped(free.prior.unwrap_or_else(|| free.as_normal()).0);
        let theta: Vec<f64> = candidate.free.iter().map(middle).collect();
        let position_m = self.trajectory_m(candidate, &theta)?;
        let noise = noise_fit::natural(&self.noise_prior().white());
        let ln_likelihood = self.fitted.ln_likelihood(&position_m, &noise);
        Ok(Fitted { theta, noise, position_m, objective: ln_likelihood, ln_likelihood })
    }

    /// Fits a candidate to this record and, to second order, to other records of the specimen. The objective then includes the log likelihood of the others.
    ///
    /// # Errors
    /// As [`Subject::fit`].
    pub(super) fn fit_beside(
        &self,
        candidate: &Candidate,
        also: &[(Vec<f64>, NoiseValues)],
        search: Search,
        elsewhere: Option<&Elsewhere>,
    ) -> Result<Fitted> {
        let climber = Climber { subject: self, candidate, noise_prior: self.noise_prior(), search, elsewhere };
        let mut ended: Vec<FitPoint> = Vec::new();
        for start in climber.starts(also) {
            let point = climber.climb(start, &ended);
            ended.push(point);
        }
        // Of several equal objectives, the first wins.
        let best = ended.into_iter().reduce(|best, other| if other.objective > best.objective { other } else { best });
        best.map(|point| self.fitted_at(point)).ok_or_else(|| no_start(candidate))
    }

    fn fitted_at(&self, point: FitPoint) -> Fitted {
        let noise = noise_fit::natural(&point.log_noise);
        let ln_likelihood = self.fitted.ln_likelihood(&point.position_m, &noise);
        Fitted { theta: point.theta, noise, position_m: point.position_m, objective: point.objective, ln_likelihood }
    }

    pub(super) fn noise_prior(&self) -> NoisePrior {
        let scales = self.experiment().scales();
        let scales = NoiseScales {
            noise_sd_um: 1e6 * self.reference_noise_m(),
            sample_interval_s: scales.sample_interval_s,
            cycle_s: scales.cycle_s,
        };
        let all = NoisePrior::new(self.noise(), &scales, self.noise_knowledge());
        match self.own_noise() {
            Some(terms) => all.only(terms),
            None => all,
        }
    }
}

fn no_start(candidate: &Candidate) -> Error {
    Error::numerical(
        format!("the model with {} has no prediction at any start of its fit", candidate.effects.join(", ")),
        "check the priors of its parameters",
    )
}

/// Settings of the fit of one candidate.
struct Climber<'a> {
    subject: &'a Subject,
    candidate: &'a Candidate,
    noise_prior: NoisePrior,
    search: Search,
    /// Log likelihood of other records.
    elsewhere: Option<&'a Elsewhere>,
}

impl Climber<'_> {
    /// Log prior density at coordinates plus the log likelihood of other records.
    fn ln_known(&self, theta: &[f64]) -> f64 {
        self.candidate.ln_prior(theta) + self.elsewhere.map_or(0.0, |elsewhere| elsewhere.ln_likelihood(theta))
    }

    /// Positions (m, one lane per point) and objectives of one to eight points under one noise. The objective is −∞ if the model has no solution or the point is outside
    /// the ends of the search.
    fn objectives(&self, points: &[Vec<f64>], log_noise: &LogNoise) -> (Vec<Lanes>, [f64; N_LANES]) {
        let (lanes, is_valid) = self.subject.trajectories_m(self.candidate, points);
        let noise = noise_fit::natural(log_noise);
        let mut out = [0.0; N_LANES];
        let noise: Vec<[f64; N_LANES]> = noise.iter().map(|value| [*value; N_LANES]).collect();
        self.subject.fitted.ln_likelihood_lanes(&lanes, &noise, &mut out);
        let of_noise = self.noise_prior.ln_density(log_noise);
        for (lane, value) in out.iter_mut().enumerate() {
            *value = match points.get(lane) {
                Some(theta) if is_valid[lane] && value.is_finite() => *value + self.ln_known(theta) + of_noise,
                _ => f64::NEG_INFINITY,
            };
        }
        (lanes, out)
    }

    /// Returns the best few of many starts. Each start is judged by its objective under its own noise.
    fn starts(&self, also: &[(Vec<f64>, NoiseValues)]) -> Vec<FitPoint> {
        let white = self.noise_prior.white();
        let mut seeds: Vec<(Vec<f64>, LogNoise)> = Vec::new();
        for (theta, noise) in also {
            let log_noise = self.noise_prior.clamped(noise.map(f64::ln));
            for embedded in self.over_grid(theta) {
                seeds.push((embedded, log_noise));
            }
        }
        let far: Vec<(Vec<f64>, LogNoise)> =
            also.iter().flat_map(|(theta, _)| self.at_full_size(theta)).map(|theta| (theta, white)).collect();
        let far = self.points(&far);
        let mut points = self.points(&seeds);
        if self.search == Search::Local && !points.is_empty() {
            return best_of(points, 2).into_iter().chain(far).collect();
        }
        // Starts from the priors, all with white noise.
        let mut wide: Vec<(Vec<f64>, LogNoise)> =
            self.quantile_starts().into_iter().map(|theta| (theta, white)).collect();
        for (theta, _) in also {
            wide.extend(self.away_from(theta).into_iter().map(|theta| (theta, white)));
        }
        let wide = best_of(self.points(&wide), 4);
        points = best_of(points, 4);
        points.extend(wide);
        points.extend(far);
        points
    }

    /// Returns starts for effects whose response at small size differs from that at full size. They begin at sizes to which the law can adapt, even if the objective is
    /// much worse at first.
    fn at_full_size(&self, theta: &[f64]) -> Vec<Vec<f64>> {
        let mut list = Vec::new();
        for (k, free) in self.candidate.free.iter().enumerate() {
            if matches!(free.coordinate, Coordinate::Square { .. }) && free.null == Some(theta[k]) {
                list.extend(FULL_SIZES.iter().map(|size| {
                    let mut start = theta.to_vec();
                    start[k] = free.clamped(free.coordinate.theta(*size));
                    start
                }));
            }
        }
        list
    }

    fn points(&self, seeds: &[(Vec<f64>, LogNoise)]) -> Vec<FitPoint> {
        let mut points = Vec::new();
        for alike in seeds.chunk_by(|(_, a), (_, b)| a == b).flat_map(|alike| alike.chunks(N_LANES)) {
            let theta: Vec<Vec<f64>> = alike.iter().map(|(theta, _)| theta.clone()).collect();
            let (lanes, values) = self.objectives(&theta, &alike[0].1);
            for (lane, theta) in theta.into_iter().enumerate().filter(|(lane, _)| values[*lane].is_finite()) {
                points.push(FitPoint {
                    theta,
                    position_m: lanes.iter().map(|row| row.0[lane]).collect(),
                    log_noise: alike[0].1,
                    objective: values[lane],
                    columns_m: None,
                    is_guessed: false,
                });
            }
        }
        points
    }

    /// Returns copies of `theta` in which parameters unidentified at the null take a grid of prior quantiles.
    fn over_grid(&self, theta: &[f64]) -> Vec<Vec<f64>> {
        let mut list = vec![theta.to_vec()];
        let grid: &[f64] =
            if self.search == Search::Wide { &[0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95] } else { &[0.15, 0.5, 0.85] };
        for (k, free) in self.candidate.free.iter().enumerate() {
            // If the other fit already has the effect, the parameter keeps the fitted value.
            let is_off = free.effect.is_some_and(|effect| self.is_off(effect, theta));
            if free.is_unidentified_at_null() && is_off {
                let on_grid = |start: &Vec<f64>| -> Vec<Vec<f64>> {
                    let at = |p: &f64| {
                        let mut moved = start.clone();
                        moved[k] = free.quantile(*p);
                        moved
                    };
                    grid.iter().map(at).collect()
                };
                list = list.iter().flat_map(on_grid).collect();
            }
        }
        // At the null, these grid points describe one model: a small step away from the null separates them.
        for start in &mut list {
            for (k, free) in self.candidate.free.iter().enumerate() {
                if let (Some(null), Some(effect)) = (free.null, free.effect)
                    && start[k] == null
                    && list_has_grid(self.candidate, effect)
                {
                    start[k] = free.clamped(null + if null + 0.02 > free.ends[1] { -0.02 } else { 0.02 });
                }
            }
        }
        if list.first().is_none_or(|first| first != theta) {
            list.push(theta.to_vec());
        }
        list
    }

    fn is_off(&self, effect: usize, theta: &[f64]) -> bool {
        let of_effect = self.candidate.free.iter().zip(theta).filter(|(free, _)| free.effect == Some(effect));
        of_effect.into_iter().any(|(free, theta)| free.null == Some(*theta))
    }

    /// Returns starts with effects well away from their nulls and all other coordinates as in `theta`.
    fn away_from(&self, theta: &[f64]) -> Vec<Vec<f64>> {
        let mut list = Vec::new();
        let levels: [f64; 6] = [0.1, 0.3, 0.6, 0.8, 0.93, 0.99];
        for (level, number) in levels.iter().zip(0_u32..) {
            for shift in 0..4_u32 {
                let mut start = theta.to_vec();
                let mut dimension = 0;
                for (k, free) in self.candidate.free.iter().enumerate() {
                    let is_off = free.effect.is_some_and(|effect| self.is_off(effect, theta));
                    if is_off {
                        let scrambled = f64::from(sobol_burley::sample(4 * number + shift, dimension, 7));
                        start[k] = free.quantile(if shift == 0 { *level } else { 0.02 + 0.96 * scrambled });
                        dimension += 1;
                    }
                }
                if start != theta {
                    list.push(start);
                }
            }
        }
        list
    }

    /// Returns starts at Sobol points of the priors, as coordinates.
    fn quantile_starts(&self) -> Vec<Vec<f64>> {
        let n_columns = self.candidate.columns.len();
        let start = |number: u32| {
            let quantile = |(free, dimension): (&super::Free, u32)| {
                let inside = 0.05 + 0.9 * f64::from(sobol_burley::sample(number, dimension, 5));
                free.quantile(if number == 0 { 0.5 } else { inside })
            };
            let mut start: Vec<f64> = self.candidate.free.iter().zip(0_u32..).map(quantile).collect();
            start.extend(std::iter::repeat_n(0.0, n_columns));
            start
        };
        (0..32).map(start).collect()
    }

    /// Alternates between mean and noise until both converge or the point reaches another climb's optimum.
    fn climb(&self, mut point: FitPoint, ended: &[FitPoint]) -> FitPoint {
        for round in 0..MOST_ROUNDS {
            let before = point.objective;
            point = self.climb_mean(point);
            if ended.iter().any(|other| self.is_at(&point, other)) {
                break;
            }
            point = self.climb_noise(point, self.search == Search::Wide && round == 0);
            if round > 0 && point.objective - before < self.least_gains()[1] {
                break;
            }
        }
        point
    }

    fn least_gains(&self) -> [f64; 2] {
        if self.search == Search::Local && self.candidate.is_slow() && !self.candidate.model.is_nonlinear() {
            return LEAST_GAINS_OF_STATE_LAWS;
        }
        self.search.least_gains(self.candidate.is_slow())
    }

    fn is_at(&self, point: &FitPoint, other: &FitPoint) -> bool {
        let fitted = self.subject.fitted_m.iter().zip(point.position_m.iter().zip(&other.position_m));
        let squares: f64 = fitted.filter(|(y, _)| y.is_some()).map(|(_, (a, b))| (a - b).powi(2)).sum();
        let is_near = squares < SAME_PLACE * self.subject.reference_noise_m().powi(2);
        is_near && point.objective < other.objective + HIGHER_NATS
    }

    fn climb_noise(&self, point: FitPoint, widely: bool) -> FitPoint {
        let (log_noise, value) =
            noise_fit::fit(&self.subject.fitted, &self.noise_prior, &point.position_m, &point.log_noise, widely);
        let objective = value + self.ln_known(&point.theta);
        if objective > point.objective { FitPoint { log_noise, objective, ..point } } else { point }
    }

    fn climb_mean(&self, mut point: FitPoint) -> FitPoint {
        let [least_gain, _] = self.least_gains();
        let n_guessed = if self.candidate.model.is_nonlinear() { self.candidate.free.len() } else { 0 };
        let mut resting = 0;
        for _ in 0..MOST_STEPS {
            let Some(steps) = self.steps(&mut point).filter(|steps| steps.promised > least_gain) else {
                if point.is_guessed {
                    point.drop_broyden_derivatives();
                    continue;
                }
                break;
            };
            let (before, was_guessed) = (point.objective, point.is_guessed);
            // A step with a tiny predicted gain is tried once.
            let n_turns = match (steps.promised < HIGHER_NATS, was_guessed) {
                (true, _) => 1,
                (false, true) => N_BY_GUESS,
                (false, false) => steps.trials.len(),
            };
            for tried in steps.in_turn(self.candidate).take(n_turns) {
                let so_far = point.objective - before;
                let (lanes, values) = self.objectives(tried, &point.log_noise);
                let best = (0..tried.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
                if values[best] > point.objective {
                    let position_m = lanes.iter().map(|row| row.0[best]).collect();
                    point.move_to(&tried[best], position_m, values[best], n_guessed);
                } else if so_far > 0.0 {
                    break;
                }
                if point.objective - before > SUFFICIENT_GAIN_RATIO * steps.promised {
                    break;
                }
            }
            let gain = point.objective - before;
            if was_guessed && gain < SUFFICIENT_GAIN_RATIO * steps.promised {
                point.drop_broyden_derivatives();
                continue;
            }
            resting = if gain < least_gain { resting + 1 } else { 0 };
            if gain <= 0.0 || resting == 2 {
                break;
            }
        }
        // The noise changes next: Broyden's derivatives are dropped.
        point.drop_broyden_derivatives();
        point
    }

    fn steps(&self, point: &mut FitPoint) -> Option<Steps> {
        let (subject, candidate) = (self.subject, self.candidate);
        if point.columns_m.is_none() {
            let known_m = Some(&point.position_m[..]);
            point.columns_m = derivatives_m(subject, candidate, &point.theta, known_m);
        }
        let mut columns = point.columns_m.clone()?;
        let residual_m =
            subject.fitted_m.iter().zip(&point.position_m).map(|(y, x)| y.map_or(0.0, |y| y - x)).collect();
        columns.push(residual_m);
        let white = subject.fitted.whiten(&columns, &point.position_m, &noise_fit::natural(&point.log_noise));
        let (mut normal, mut slope) = normal_equations(&white);
        for (k, free) in candidate.free.iter().enumerate() {
            if let Some((mean, sd)) = free.prior {
                normal[(k, k)] += 1.0 / (sd * sd);
                slope[k] += (mean - point.theta[k]) / (sd * sd);
            }
        }
        if let Some(elsewhere) = self.elsewhere {
            elsewhere.add_to(&point.theta, &mut normal, &mut slope);
        }
        damped_steps(candidate, &point.theta, &normal, &slope)
    }
}

fn list_has_grid(candidate: &Candidate, effect: usize) -> bool {
    candidate.free.iter().any(|free| free.effect == Some(effect) && free.is_unidentified_at_null())
}

fn best_of(mut points: Vec<FitPoint>, n: usize) -> Vec<FitPoint> {
    points.sort_by(|a, b| b.objective.total_cmp(&a.objective));
    points.truncate(n);
    points
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
