//! Noise term with independent errors of equal variance. It is in every model.

use super::{Equations, NoiseTerm};
use crate::noise::NoiseScales;
use crate::noise::learnt_term::{LearningPrior, LearntParameter, LearntTerm, NoiseKnowledge, RowShare};
use crate::noise::scales::FilterScales;
use base::distribution::Distribution;
use base::parameter::{NOISE_SD, ParameterSpec};
use figures::number::format_significant;

pub(super) struct White;

impl NoiseTerm for White {
    fn name(&self) -> &'static str {
        "white"
    }

    fn parameters(&self) -> &'static [ParameterSpec] {
        &[NOISE_SD]
    }

    fn default_prior(&self, _parameter: &ParameterSpec, _scales: &NoiseScales) -> Option<(Distribution, &'static str)> {
        None
    }

    fn equations(&self) -> Equations {
        Equations::default()
    }

    fn learning(&'static self) -> Option<&'static dyn LearntTerm> {
        Some(self)
    }

    fn write(&self, values: &[f64], scales: &mut FilterScales) {
        scales.noise_sd_m = 1e-6 * values[0];
    }
}

/// Prior standard deviation of the logarithm of the white noise, around the logarithm of the reference noise. It allows for an uncertain reference noise, so that the
/// prior does not dominate the data.
const LOG_SD: f64 = 0.5;

impl LearntTerm for White {
    fn learnt(&self, scales: &NoiseScales, _: &[Distribution], _: NoiseKnowledge) -> Vec<LearntParameter> {
        let ln_um = scales.noise_sd_um.ln();
        vec![LearntParameter {
            spec: NOISE_SD,
            prior: LearningPrior::NormalLog { mean: ln_um, sd: LOG_SD },
            ln_ends: [ln_um - 4.0, ln_um + 8.0],
            ln_white: ln_um,
            of_row: RowShare::Sd,
        }]
    }

    fn starts(&self, scales: &NoiseScales, _: &[Distribution]) -> Vec<Vec<f64>> {
        vec![vec![scales.noise_sd_um.ln()]]
    }

    fn words(&self, values: &[f64]) -> String {
        format!("white noise of {} µm", format_significant(values[0], 3))
    }

    fn sds_um(&self, values: &[f64], _: f64) -> Vec<f64> {
        vec![values[0]]
    }
}
