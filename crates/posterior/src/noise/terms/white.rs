//! Independent errors of one size; in every model.

use super::{Equations, NoiseTerm};
use crate::noise::NoiseScales;
use crate::noise::scales::Scales;
use base::distribution::Distribution;
use base::parameter::{NOISE_SD, ParameterSpec};

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

    fn write(&self, values: &[f64], scales: &mut Scales) {
        scales.noise_sd_m = 1e-6 * values[0];
    }
}
