//! Whitening by the filter, marginal standard deviations, and simulated noise.

use pulp::Scalar;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::filter::{Covariance, Gain, Mean, PriorVariances};
use super::lanes::Register;
use super::rows::{Row, Rows};
use super::scales::Scales;
use super::{NoiseLikelihood, NoiseModel};

type Number = Register<Scalar>;

fn number(value: f64) -> Number {
    Register::splat(Scalar, value)
}

/// The filter of one point, row by row; terms that the model lacks have variance 0.
struct Walk<'a> {
    scales: &'a Scales,
    step_s: &'a [f64],
    prior: PriorVariances<Scalar>,
    covariance: Covariance<Scalar, true, true>,
}

impl<'a> Walk<'a> {
    fn new(scales: &'a Scales, step_s: &'a [f64]) -> Self {
        let prior = PriorVariances { gain: number(scales.gain_per_m2), offset: number(scales.offset) };
        Self { scales, step_s, prior, covariance: Covariance::zero(Scalar) }
    }

    /// Decay of the process up to a row, and the row's gain.
    fn observe(&mut self, row: &Row, position_m: f64) -> (Number, Gain<Scalar>) {
        let (decay, gained) = self.scales.step(self.step_s[row.step]);
        self.covariance.advance(number(decay), number(gained));
        if row.new_cycle {
            self.covariance.renew(self.prior);
        }
        (number(decay), self.covariance.observe(number(position_m)))
    }
}

/// Takes a mean to a row.
fn advance(mean: &mut Mean<Scalar, true, true>, row: &Row, decay: Number) {
    mean.advance(decay);
    if row.new_cycle {
        mean.renew();
    }
}

impl NoiseLikelihood {
    /// L⁻¹ times each column, where L Lᵀ is the covariance of the observed positions at a point: so ‖whiten(r)‖² is the Mahalanobis distance of
    /// residuals r. A column has one entry a row of the record, its result one an observed row, in order.
    ///
    /// L is that of the Gaussian terms; with `student` it is multiplied by √(ν/(ν − 2)). All NaN for parameters outside their support.
    pub fn whiten(&self, columns: &[Vec<f64>], position_m: &[f64], parameters: &[f64]) -> Vec<Vec<f64>> {
        let Some(scales) = Scales::new(self.model, parameters) else {
            return vec![vec![f64::NAN; self.n_observed()]; columns.len()];
        };
        let inverse_sd_per_m = 1.0 / (scales.noise_sd_m * scales.variance_factor().sqrt());
        let mut walk = Walk::new(&scales, &self.rows.step_s);
        let mut means = vec![Mean::<Scalar, true, true>::zero(Scalar); columns.len()];
        let mut white = vec![Vec::with_capacity(self.n_observed()); columns.len()];
        for row in &self.rows.rows {
            let x = position_m[row.index];
            let (decay, gain) = walk.observe(row, x);
            for ((column, mean), white) in columns.iter().zip(&mut means).zip(&mut white) {
                advance(mean, row, decay);
                let innovation = mean.innovation(number(column[row.index]), number(x));
                mean.correct(&gain, innovation * gain.precision);
                white.push(innovation.number() * gain.precision.number().sqrt() * inverse_sd_per_m);
            }
        }
        white
    }
}

impl NoiseModel {
    /// Standard deviation in m of the noise at every row of a record that is observed at every row: times in s, cycles, positions in m.
    ///
    /// With `student` it follows from the filter: the score-driven mean has (ν + 1)/(ν + 3) of the variance that the Gaussian filter's mean has, and
    /// what is left to predict has ν/(ν − 2) of it. Infinite at ν = 2, NaN for parameters outside their support.
    pub fn marginal_sd_m(self, time_s: &[f64], cycle: &[u32], position_m: &[f64], parameters: &[f64]) -> Vec<f64> {
        let Some(scales) = Scales::new(self, parameters) else {
            return vec![f64::NAN; position_m.len()];
        };
        let prior = |x: f64| scales.ou + scales.gain_per_m2 * x * x + scales.offset;
        if !self.student {
            return position_m.iter().map(|x| scales.noise_sd_m * (1.0 + prior(*x)).sqrt()).collect();
        }
        let rows = all_rows(time_s, cycle);
        let mut walk = Walk::new(&scales, &rows.step_s);
        let learnt = (scales.dof + 1.0) / (scales.dof + 3.0);
        let sd_m = |row: &Row| {
            let x = position_m[row.index];
            let left = walk.observe(row, x).1.excess.number();
            let variance = learnt * (prior(x) - left).max(0.0) + scales.variance_factor() * (1.0 + left);
            scales.noise_sd_m * variance.sqrt()
        };
        rows.rows.iter().map(sd_m).collect()
    }

    /// One draw of the noise, observed less position in m, at every row of a record, from the density that [`NoiseLikelihood`] gives the record
    /// when it is observed at every row. NaN for parameters outside their support.
    ///
    /// Drawn prediction by prediction through the likelihood's own filter, which for the Gaussian terms is the same as drawing each term.
    pub fn simulate_m(
        self,
        time_s: &[f64],
        cycle: &[u32],
        position_m: &[f64],
        parameters: &[f64],
        rng: &mut (impl Rng + ?Sized),
    ) -> Vec<f64> {
        let Some(scales) = Scales::new(self, parameters) else {
            return vec![f64::NAN; position_m.len()];
        };
        let rows = all_rows(time_s, cycle);
        let mut walk = Walk::new(&scales, &rows.step_s);
        let mut mean = Mean::<Scalar, true, true>::zero(Scalar);
        let mut draw_m = |row: &Row| {
            let x = position_m[row.index];
            let (decay, gain) = walk.observe(row, x);
            advance(&mut mean, row, decay);
            let predicted_m = -mean.innovation(number(0.0), number(x)).number();
            let (standard, weight) = if self.student {
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

fn all_rows(time_s: &[f64], cycle: &[u32]) -> Rows {
    Rows::new(time_s, cycle, &(0..time_s.len()).collect::<Vec<_>>())
}

/// A draw of Student's t by the polar method (Bailey, *Math. Comp.* 62, 779, 1994, doi:10.2307/2153537).
fn student_t(dof: f64, rng: &mut (impl Rng + ?Sized)) -> f64 {
    // In (0, 1], so that the logarithm is finite.
    let radius_level = 1.0 - rng.random::<f64>();
    let angle = 2.0 * std::f64::consts::PI * rng.random::<f64>();
    (dof * (-2.0 / dof * radius_level.ln()).exp_m1()).sqrt() * angle.cos()
}

#[cfg(test)]
#[path = "paths_tests.rs"]
mod tests;
