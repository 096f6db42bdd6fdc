//! A gain and an offset for each cycle.

use super::{Equations, NoiseTerm};
use crate::noise::NoiseScales;
use crate::noise::scales::Scales;
use base::distribution::Distribution;
use base::parameter::{GAIN_SD, OFFSET_SD, ParameterSpec};

pub(super) struct Gain;

impl NoiseTerm for Gain {
    fn name(&self) -> &'static str {
        "gain"
    }

    fn parameters(&self) -> &'static [ParameterSpec] {
        &[GAIN_SD, OFFSET_SD]
    }

    fn default_prior(&self, parameter: &ParameterSpec, scales: &NoiseScales) -> Option<(Distribution, &'static str)> {
        Some(if *parameter == GAIN_SD {
            (Distribution::HalfNormal { sd: 0.03 }, "chosen: cycles alike to a few per cent")
        } else {
            (Distribution::HalfNormal { sd: scales.noise_sd_um }, "chosen: at most about the white noise")
        })
    }

    fn equations(&self) -> Equations {
        Equations { cycles: true, ..Equations::default() }
    }

    fn write(&self, values: &[f64], scales: &mut Scales) {
        scales.gain_per_m2 = scales.ratio(values[0]);
        scales.offset = scales.ratio(1e-6 * values[1]);
    }
}
