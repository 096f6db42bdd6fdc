//! Noise term that replaces normal errors by Student-t errors.

use super::{Equations, NoiseTerm};
use crate::noise::NoiseScales;
use crate::noise::scales::FilterScales;
use base::distribution::Distribution;
use base::parameter::{ParameterSpec, STUDENT_DOF};

pub(super) struct Student;

impl NoiseTerm for Student {
    fn name(&self) -> &'static str {
        "student"
    }

    fn parameters(&self) -> &'static [ParameterSpec] {
        &[STUDENT_DOF]
    }

    fn default_prior(&self, _parameter: &ParameterSpec, _scales: &NoiseScales) -> Option<(Distribution, &'static str)> {
        let distribution = Distribution::LogUniform { lower: 2.1, upper: 100.0 };
        Some((distribution, "chosen: from tails with almost infinite variance to tails that are almost normal"))
    }

    fn equations(&self) -> Equations {
        Equations { heavy_tails: true, ..Equations::default() }
    }

    fn write(&self, values: &[f64], scales: &mut FilterScales) {
        scales.dof = values[0];
    }
}
