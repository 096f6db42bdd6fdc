//! Kalman filter for one set of noise parameters, row by row. It gives marginal standard deviations and simulated noise.

use pulp::Scalar;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::NoiseModel;
use super::filter::{Covariance, Gain, Mean, PriorVariances};
use super::lanes::Register;
use super::rows::{NoiseRow, NoiseRows};
use super::scales::FilterScales;

pub type Number = Register<Scalar>;

pub(super) fn number(value: f64) -> Number {
    Register::splat(Scalar, value)
}

/// Kalman filter for one set of noise parameters, row by row. Terms that the model lacks have variance 0.
pub(super) struct RowFilter {
    /// For each distinct time step: decay of the process, and the variance that it gains, divided by the variance of the white noise.
    steps: Vec<(f64, f64)>,
    prior: PriorVariances<Scalar>,
    covariance: Covariance<Scalar, true, true>,
}

impl RowFilter {
    pub fn new(scales: &FilterScales, step_s: &[f64]) -> Self {
        let steps = step_s.iter().map(|step_s| scales.step(*step_s)).collect();
        let prior = PriorVariances { gain: number(scales.gain_per_m2), offset: number(scales.offset) };
        Self { steps, prior, covariance: Covariance::zero(Scalar) }
    }

    /// Advances the filter to a row and observes a position there. Returns the decay of the process since the previous row, and the filter's gain.
    pub fn observe(&mut self, row: &NoiseRow, position_m: f64) -> (Number, Gain<Scalar>) {
        let (decay, gained) = self.steps[row.step];
        self.covariance.advance(number(decay), number(gained));
        if row.new_cycle {
            self.covariance.renew(self.prior);
        }
        (number(decay), self.covariance.observe(number(position_m)))
    }
}

/// Advances the mean of the state to a row. Gain and offset become 0 at the beginning of a cycle.
pub(super) fn advance(mean: &mut Mean<Scalar, true, true>, row: &NoiseRow, decay: Number) {
    mean.advance(decay);
    if row.new_cycle {
        mean.renew();
    }
}

impl NoiseModel {
    /// Marginal standard deviation (m) of the noise at every row of a record. Times are in s, predicted positions in m, and every row counts as observed.
    ///
    /// With `student`, the standard deviation follows from the filter, for ν degrees of freedom. The variance of its mean is (ν + 1)/(ν + 3) times the variance in a
    /// Gaussian filter, and the prediction's variance is multiplied by ν/(ν − 2). The result is infinite at ν = 2 and NaN for parameters outside their support.
    pub fn marginal_sd_m(self, time_s: &[f64], cycle: &[u32], position_m: &[f64], parameters: &[f64]) -> Vec<f64> {
        let Some(scales) = self.scales(parameters) else {
            return vec![f64::NAN; position_m.len()];
        };
        let prior = |x: f64| scales.ou + scales.gain_per_m2 * x * x + scales.offset;
        if !self.equations().heavy_tails {
            return position_m.iter().map(|x| scales.noise_sd_m * (1.0 + prior(*x)).sqrt()).collect();
        }
        let rows = all_rows(time_s, cycle);
        let mut walk = RowFilter::new(&scales, &rows.step_s);
        let learnt = (scales.dof + 1.0) / (scales.dof + 3.0);
        let sd_m = |row: &NoiseRow| {
            let x = position_m[row.index];
            let left = walk.observe(row, x).1.excess.number();
            let variance = learnt * (prior(x) - left).max(0.0) + scales.variance_factor() * (1.0 + left);
            scales.noise_sd_m * variance.sqrt()
        };
        rows.rows.iter().map(sd_m).collect()
    }

    /// Draws the noise (observed minus predicted position, in m) at every row of a record once. It has the density of [`NoiseLikelihood`](super::NoiseLikelihood) with
    /// an observation at every row. The result is NaN for parameters outside their support.
    ///
    /// Each row is drawn from the one-step prediction of the likelihood's filter. For the Gaussian terms this is equivalent to a draw of each term.
    pub fn simulate_m(
        self,
        time_s: &[f64],
        cycle: &[u32],
        position_m: &[f64],
        parameters: &[f64],
        rng: &mut (impl Rng + ?Sized),
    ) -> Vec<f64> {
        let Some(scales) = self.scales(parameters) else {
            return vec![f64::NAN; position_m.len()];
        };
        if self == Self::default() {
            // White noise needs no filter. The filter would draw the same values.
            let draw_m = |_: &f64| scales.noise_sd_m * rng.sample::<f64, _>(StandardNormal);
            return position_m.iter().map(draw_m).collect();
        }
        let rows = all_rows(time_s, cycle);
        let mut walk = RowFilter::new(&scales, &rows.step_s);
        let mut mean = Mean::<Scalar, true, true>::zero(Scalar);
        let heavy_tails = self.equations().heavy_tails;
        let mut draw_m = |row: &NoiseRow| {
            let x = position_m[row.index];
            let (decay, gain) = walk.observe(row, x);
            advance(&mut mean, row, decay);
            let predicted_m = -mean.innovation(number(0.0), number(x)).number();
            let (standard, weight) = if heavy_tails {
                let t = student_t(scales.dof, rng);
                (t, (scales.dof + 1.0) / (scales.dof + t * t))
            } else {
                (rng.sample(StandardNormal), 1.0)
            };
            let precision = gain.precision.number();
            let innovation_m = scales.noise_sd_m * standard / precision.sqrt();
            mean.correct(&gain, number(weight * innovation_m * precision));
            predicted_m + innovation_m
        };
        rows.rows.iter().map(&mut draw_m).collect()
    }
}

fn all_rows(time_s: &[f64], cycle: &[u32]) -> NoiseRows {
    NoiseRows::new(time_s, cycle, &(0..time_s.len()).collect::<Vec<_>>())
}

/// Draws from Student's t by the polar method (Bailey, *Math. Comp.* 62, 779, 1994, doi:10.2307/2153537).
fn student_t(dof: f64, rng: &mut (impl Rng + ?Sized)) -> f64 {
    // The level lies in (0, 1], so that its logarithm is finite.
    let radius_level = 1.0 - rng.random::<f64>();
    let angle = 2.0 * std::f64::consts::PI * rng.random::<f64>();
    (dof * (-2.0 / dof * radius_level.ln()).exp_m1()).sqrt() * angle.cos()
}

#[cfg(test)]
#[path = "paths_tests.rs"]
mod tests;
