//! Likelihood of many columns of residuals under eight sets of noise parameters at once. One pass serves all columns, because the filter's covariance takes most of the
//! time and does not depend on the residuals.

use pulp::{Arch, Simd, WithSimd};

use super::NoiseLikelihood;
use super::filter::{Covariance, Mean, PriorVariances};
use super::lanes::{LANES, Product, Products, Register};
use super::likelihood::FilterStep;
use super::scales::FilterScales;

impl NoiseLikelihood {
    /// Log likelihood, in nats, of each column of residuals for each lane of `parameters[parameter][lane]`. Residuals (observed minus predicted position, m) have one
    /// value per row of the record. All columns have the predicted positions `position_m`, which gains multiply. Only the Gaussian terms are used. The result is −∞ for
    /// parameters outside their support.
    pub fn ln_likelihoods_of(
        &self,
        residuals_m: &[&[f64]],
        position_m: &[f64],
        parameters: &[[f64; LANES]],
    ) -> Vec<[f64; LANES]> {
        let scales = self.scales(parameters);
        let inside = scales.map(|scales| scales.unwrap_or(FilterScales::UNIT));
        let mut quadratic_m2 = vec![[0.0; LANES]; residuals_m.len()];
        let mut variance = Products::ONE;
        Arch::new().dispatch(ResidualPass {
            record: self,
            residuals_m,
            position_m,
            scales: &inside,
            quadratic_m2: &mut quadratic_m2,
            variance: &mut variance,
        });
        let n = self.n_observed() as f64;
        let of_lane = |quadratic_m2: &[f64; LANES], lane: usize| match &scales[lane] {
            Some(FilterScales { noise_sd_m, .. }) => {
                -n * (noise_sd_m.ln() + 0.5 * std::f64::consts::TAU.ln())
                    - 0.5 * variance.ln(lane)
                    - 0.5 * quadratic_m2[lane] / (noise_sd_m * noise_sd_m)
            }
            None => f64::NEG_INFINITY,
        };
        quadratic_m2.iter().map(|quadratic_m2| std::array::from_fn(|lane| of_lane(quadratic_m2, lane))).collect()
    }
}

/// One pass of the filter over the record, for all columns of residuals and all lanes.
struct ResidualPass<'a> {
    record: &'a NoiseLikelihood,
    residuals_m: &'a [&'a [f64]],
    position_m: &'a [f64],
    scales: &'a [FilterScales; LANES],
    quadratic_m2: &'a mut [[f64; LANES]],
    variance: &'a mut Products<LANES>,
}

impl WithSimd for ResidualPass<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (mut ou, mut ou_time_s, mut gain, mut offset) = ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for (lane, scales) in self.scales.iter().enumerate() {
            (ou[lane], ou_time_s[lane]) = (scales.ou, scales.ou_time_s);
            (gain[lane], offset[lane]) = (scales.gain_per_m2, scales.offset);
        }
        let mut steps = vec![FilterStep::<LANES>::NONE; self.record.rows.step_s.len()];
        let zero = Register::splat(simd, 0.0);
        for register in 0..LANES / S::F64_LANES {
            for (step, length_s) in steps.iter_mut().zip(&self.record.rows.step_s) {
                step.fill(simd, register, *length_s, &ou, &ou_time_s);
            }
            let prior = PriorVariances {
                gain: Register::load(simd, &gain, register),
                offset: Register::load(simd, &offset, register),
            };
            let mut covariance = Covariance::<S, true, true>::zero(simd);
            let mut variance = Product::one(simd);
            let mut means = vec![(Mean::<S, true, true>::zero(simd), zero); self.residuals_m.len()];
            for row in &self.record.rows.rows {
                let step = &steps[row.step];
                let decay = Register::load(simd, &step.decay, register);
                covariance.advance(decay, Register::load(simd, &step.gained, register));
                if row.new_cycle {
                    covariance.renew(prior);
                }
                let x = Register::splat(simd, self.position_m[row.index]);
                let gain = covariance.observe(x);
                variance.grow(gain.excess);
                for ((mean, quadratic), residual_m) in means.iter_mut().zip(self.residuals_m) {
                    mean.advance(decay);
                    if row.new_cycle {
                        mean.renew();
                    }
                    let innovation = mean.innovation(Register::splat(simd, residual_m[row.index]), x);
                    let scaled = innovation * gain.precision;
                    *quadratic = innovation.mul_add(scaled, *quadratic);
                    mean.correct(&gain, scaled);
                }
            }
            for ((_, quadratic), out) in means.iter().zip(self.quadratic_m2.iter_mut()) {
                quadratic.store(out, register);
            }
            variance.store(self.variance, register);
        }
    }
}
