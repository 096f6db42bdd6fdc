//! A point's noise parameters in the form that the filter takes.

use super::NoiseModel;
use base::parameter::ParameterSpec;

/// Ratios of variances above this are refused: their products would leave the range of numbers.
const LARGEST_RATIO: f64 = 1e100;

/// Parameters in SI, variances over the white noise's. Terms that the model lacks have variance 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scales {
    /// Standard deviation (of a t: scale) of the white noise in m.
    pub noise_sd_m: f64,
    /// Stationary variance of the Ornstein–Uhlenbeck process over that of the white noise.
    pub ou: f64,
    /// Its correlation time in s.
    pub ou_time_s: f64,
    /// Variance of the gain over that of the white noise, in 1/m².
    pub gain_per_m2: f64,
    /// Variance of the offset over that of the white noise.
    pub offset: f64,
    /// Degrees of freedom; infinite for normal errors.
    pub dof: f64,
}

impl Scales {
    /// Stands in for a point outside the support, whose result is thrown away.
    pub const UNIT: Self =
        Self { noise_sd_m: 1.0, ou: 0.0, ou_time_s: 1.0, gain_per_m2: 0.0, offset: 0.0, dof: f64::INFINITY };

    /// From parameters in the model's order and units; `None` outside their support.
    pub fn new(model: NoiseModel, parameters: &[f64]) -> Option<Self> {
        let (mut scales, mut left) = (Self::UNIT, parameters);
        for term in model.terms() {
            let (own, others) = left.split_at_checked(term.parameters().len())?;
            let is_inside = |(spec, value): (&ParameterSpec, &f64)| value.is_finite() && spec.support.contains(*value);
            if !term.parameters().iter().zip(own).all(is_inside) {
                return None;
            }
            term.write(own, &mut scales);
            left = others;
        }
        let small = |ratio: f64| ratio <= LARGEST_RATIO;
        let inside = scales.noise_sd_m > 0.0;
        (inside && small(scales.ou) && small(scales.gain_per_m2) && small(scales.offset)).then_some(scales)
    }

    /// The variance of a standard deviation in m (or of a number, in 1/m²) over the white noise's.
    pub fn ratio(&self, sd: f64) -> f64 {
        (sd / self.noise_sd_m).powi(2)
    }

    /// Variance of a standardised error: 1, or ν/(ν − 2) for a t, which is infinite at ν = 2.
    pub fn variance_factor(&self) -> f64 {
        if self.dof.is_finite() { self.dof / (self.dof - 2.0) } else { 1.0 }
    }

    /// Decay exp(−Δt/τ) of the process over a step, and the variance 1 − exp(−2Δt/τ), times the stationary one, that it gains.
    pub fn step(&self, step_s: f64) -> (f64, f64) {
        // From exp − 1, which keeps the digits of short steps.
        let change = (-step_s / self.ou_time_s).exp_m1();
        (1.0 + change, -change * (2.0 + change) * self.ou)
    }
}
