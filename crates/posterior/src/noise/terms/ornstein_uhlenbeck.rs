//! A stationary Ornstein–Uhlenbeck process.

use super::{Equations, NoiseTerm};
use crate::noise::NoiseScales;
use crate::noise::scales::Scales;
use base::distribution::Distribution;
use base::parameter::{OU_SD, OU_TIME, ParameterSpec};

pub(super) struct OrnsteinUhlenbeck;

impl NoiseTerm for OrnsteinUhlenbeck {
    fn name(&self) -> &'static str {
        "ou"
    }

    fn parameters(&self) -> &'static [ParameterSpec] {
        &[OU_SD, OU_TIME]
    }

    fn default_prior(&self, parameter: &ParameterSpec, scales: &NoiseScales) -> Option<(Distribution, &'static str)> {
        let NoiseScales { noise_sd_um, sample_interval_s, cycle_s } = *scales;
        if *parameter == OU_SD {
            let distribution = Distribution::LogNormal { median: 0.5 * noise_sd_um, log_sd: 1.0 };
            return Some((distribution, "chosen: about half the white noise, within a factor of seven (95 %)"));
        }
        // A process that forgets within two rows is white noise by another name, and the two would trade places.
        let lower = 2.0 * sample_interval_s;
        let distribution = Distribution::LogUniform { lower, upper: cycle_s.max(10.0 * lower) };
        Some((distribution, "chosen: from two sample intervals, below which it is white noise, to a cycle"))
    }

    fn equations(&self) -> Equations {
        Equations { process: true, ..Equations::default() }
    }

    fn write(&self, values: &[f64], scales: &mut Scales) {
        scales.ou = scales.ratio(1e-6 * values[0]);
        scales.ou_time_s = values[1];
    }
}
