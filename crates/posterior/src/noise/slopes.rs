//! Derivatives of the log likelihood: along a direction of the predicted positions, and by a noise parameter.
//!
//! Both derivatives are fourth-order finite differences, because the filter computes no derivatives. The steps are small relative to the scale on which the likelihood
//! changes. For white noise, the derivative along a direction is exact except for rounding, because the log likelihood is quadratic in the positions.

use super::NoiseLikelihood;

/// Step along a direction of the positions: largest displacement of a row, in standard deviations of the white noise.
const POSITION_STEP: f64 = 1e-2;
/// Step in a noise parameter for finite differences, relative to the parameter's value.
const PARAMETER_STEP: f64 = 1e-3;
/// Smallest value to which the step in a parameter is relative. It replaces smaller values, because a parameter may be 0 at the end of its support.
const SMALLEST_SCALE: f64 = 0.1;

/// Derivative f′(0) of a function from its values at ±h and ±2h.
fn central(f: impl Fn(f64) -> f64, h: f64) -> f64 {
    (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}

/// Derivative f′(0) of a function from its values at 0, h, …, 4h, by differences from f(0).
fn forward(f: impl Fn(f64) -> f64, h: f64) -> f64 {
    let at_zero = f(0.0);
    let rise = |n: f64| f(n * h) - at_zero;
    (48.0 * rise(1.0) - 36.0 * rise(2.0) + 16.0 * rise(3.0) - 3.0 * rise(4.0)) / (12.0 * h)
}

impl NoiseLikelihood {
    /// Derivative of [`NoiseLikelihood::ln_likelihood`] along a direction of the predicted positions. Both slices are in m, with one entry per row of the record.
    pub fn slope_along(&self, position_m: &[f64], direction_m: &[f64], parameters: &[f64]) -> f64 {
        let largest_m = self.observed_rows().map(|row| direction_m[row].abs()).fold(0.0, f64::max);
        if largest_m == 0.0 {
            return 0.0;
        }
        let moved = |step: f64| {
            let position_m: Vec<f64> = position_m.iter().zip(direction_m).map(|(x, d)| x + step * d).collect();
            self.ln_likelihood(&position_m, parameters)
        };
        // Every noise model has white noise, and its standard deviation in µm is the first parameter.
        central(moved, POSITION_STEP * 1e-6 * parameters[0] / largest_m)
    }

    /// Derivative of the log likelihood by the noise parameter `index`, per unit of the parameter. It is one-sided at an end of the parameter's support.
    pub fn slope_in(&self, position_m: &[f64], parameters: &[f64], index: usize) -> f64 {
        let support = self.model.parameters()[index].support;
        let value = parameters[index];
        let moved = |step: f64| {
            let mut parameters = parameters.to_vec();
            parameters[index] = value + step;
            self.ln_likelihood(position_m, &parameters)
        };
        let step = PARAMETER_STEP * value.abs().max(SMALLEST_SCALE);
        if value - support.lower < 2.0 * step {
            forward(moved, step)
        } else if support.upper - value < 2.0 * step {
            -forward(|step| moved(-step), step)
        } else {
            central(moved, step)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::NoiseModel;
    use super::*;
    use base::error::InputPlace;

    /// Under white noise of standard deviation σ, the derivatives have closed forms for n residuals r: Σ r dx/σ² along a direction dx, and −n/σ + Σ r²/σ³ by σ.
    #[test]
    fn slopes_under_white_noise_are_the_closed_forms() {
        let time_s: Vec<f64> = (0..60).map(|i| 0.05 * f64::from(i)).collect();
        let observed_m: Vec<Option<f64>> = (0..60).map(|i| (i % 7 != 3).then_some(1e-5 * f64::from(i).sin())).collect();
        let likelihood = NoiseLikelihood::new(NoiseModel::default(), &time_s, &[1; 60], &observed_m);
        let position_m: Vec<f64> = time_s.iter().map(|t| 8e-6 * (21.0 * t).sin()).collect();
        let direction_m: Vec<f64> = time_s.iter().map(|t| 1e-6 * t.exp()).collect();
        let sd_um = 3.0;
        let residuals_m = |row: usize| observed_m[row].map(|y| (y - position_m[row], direction_m[row]));
        let rows: Vec<(f64, f64)> = (0..60).filter_map(residuals_m).collect();
        let along = rows.iter().map(|(r, d)| r * d).sum::<f64>() / (1e-6_f64 * sd_um).powi(2);
        let squares = rows.iter().map(|(r, _)| (1e6 * r).powi(2)).sum::<f64>();
        let in_sd = -(rows.len() as f64) / sd_um + squares / sd_um.powi(3);
        let value = likelihood.slope_along(&position_m, &direction_m, &[sd_um]);
        assert!((value / along - 1.0).abs() < 1e-9, "{value} {along}");
        let slope = likelihood.slope_in(&position_m, &[sd_um], 0);
        assert!((slope / in_sd - 1.0).abs() < 1e-8, "{slope} {in_sd}");
        assert_eq!(likelihood.slope_along(&position_m, &[0.0; 60], &[sd_um]), 0.0);
    }

    /// With all noise terms, the derivatives agree with finite differences of other steps. At an end of a parameter's support, the derivatives are one-sided from
    /// inside.
    #[test]
    fn slopes_under_all_noises_are_differences() {
        let names = ["white", "ou", "gain", "student"].map(String::from);
        let model = NoiseModel::named(&names, &InputPlace::default()).expect("sound");
        let time_s: Vec<f64> = (0..80).map(|i| 0.05 * f64::from(i)).collect();
        let cycle: Vec<u32> = (0..80).map(|i| 1 + i / 40).collect();
        let observed_m: Vec<Option<f64>> = (0..80).map(|i| Some(1e-5 * f64::from(i).cos())).collect();
        let likelihood = NoiseLikelihood::new(model, &time_s, &cycle, &observed_m);
        let position_m: Vec<f64> = time_s.iter().map(|t| 9e-6 * (20.0 * t).cos()).collect();
        let direction_m: Vec<f64> = time_s.iter().map(|t| 1e-6 * (1.0 + t)).collect();
        let parameters = [3.0, 2.0, 0.7, 0.05, 4.0, 5.0];
        let along = |step: f64| {
            let moved: Vec<f64> = position_m.iter().zip(&direction_m).map(|(x, d)| x + step * d).collect();
            likelihood.ln_likelihood(&moved, &parameters)
        };
        let difference = (along(1e-4) - along(-1e-4)) / 2e-4;
        let value = likelihood.slope_along(&position_m, &direction_m, &parameters);
        assert!((value / difference - 1.0).abs() < 1e-6, "{value} {difference}");
        for index in 0..parameters.len() {
            let at = |step: f64| {
                let mut moved = parameters;
                moved[index] *= 1.0 + step;
                likelihood.ln_likelihood(&position_m, &moved)
            };
            let difference = (at(1e-5) - at(-1e-5)) / (2e-5 * parameters[index]);
            let slope = likelihood.slope_in(&position_m, &parameters, index);
            assert!((slope - difference).abs() < 1e-5 * (1.0 + slope.abs()), "{index}: {slope} {difference}");
        }
        let at_end = |sd: f64| likelihood.slope_in(&position_m, &[3.0, 2.0, 0.7, 0.05, sd, 5.0], 4);
        let (at, near) = (at_end(0.0), at_end(1e-3));
        assert!(at.is_finite() && (at - near).abs() < 1e-2, "{at} {near}");
    }
}
