//! Noise term with a gain and an offset for each cycle.

use super::{Equations, NoiseTerm};
use crate::noise::NoiseScales;
use crate::noise::learnt_term::{
    DrawRow, LearningPrior, LearntParameter, LearntTerm, NoiseBounds, NoiseKnowledge, RowShare,
};
use crate::noise::scales::FilterScales;
use base::distribution::Distribution;
use base::parameter::{GAIN_SD, OFFSET_SD, ParameterSpec};
use figures::number::format_significant;
use sampling::ensemble::RandomStream;

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
            (Distribution::HalfNormal { sd: 0.03 }, "chosen: cycles agree to a few per cent")
        } else {
            (Distribution::HalfNormal { sd: scales.noise_sd_um }, "chosen: hardly larger than the white noise")
        })
    }

    fn equations(&self) -> Equations {
        Equations { cycles: true, ..Equations::default() }
    }

    fn learning(&'static self) -> Option<&'static dyn LearntTerm> {
        Some(self)
    }

    fn write(&self, values: &[f64], scales: &mut FilterScales) {
        scales.gain_per_m2 = scales.ratio(values[0]);
        scales.offset = scales.ratio(1e-6 * values[1]);
    }
}

impl LearntTerm for Gain {
    fn learnt(&self, scales: &NoiseScales, priors: &[Distribution], known: NoiseKnowledge) -> Vec<LearntParameter> {
        let ln_white_um = scales.noise_sd_um.ln();
        let [gain_prior, offset_prior] = match known {
            NoiseKnowledge::Bounded(bounds) => [bounds.gain_sd, bounds.offset_sd_um].map(NoiseBounds::prior),
            _ => [priors[0], priors[1]].map(LearningPrior::OfValue),
        };
        let gain = LearntParameter {
            spec: GAIN_SD,
            prior: gain_prior,
            ln_ends: [1e-5_f64.ln(), 0.5_f64.ln()],
            ln_white: 1e-4_f64.ln(),
            of_row: RowShare::Nothing,
        };
        let offset = LearntParameter {
            spec: OFFSET_SD,
            prior: offset_prior,
            ln_ends: [ln_white_um - 7.0, ln_white_um + 7.0],
            ln_white: ln_white_um - 4.0,
            of_row: RowShare::Nothing,
        };
        vec![gain, offset]
    }

    fn starts(&self, scales: &NoiseScales, _: &[Distribution]) -> Vec<Vec<f64>> {
        let ln_white_um = scales.noise_sd_um.ln();
        [(0.004_f64, -1.5), (0.02, -3.0), (0.000_5, 0.0)]
            .map(|(gain, offset)| vec![gain.ln(), ln_white_um + offset])
            .to_vec()
    }

    fn words(&self, values: &[f64]) -> String {
        format!(
            "a gain of {:.2} % and an offset of {} µm per cycle",
            100.0 * values[0],
            format_significant(values[1], 2)
        )
    }

    fn sds_um(&self, values: &[f64], position_um: f64) -> Vec<f64> {
        vec![values[0] * position_um, values[1]]
    }

    fn drawn(&self, values: &[f64], _: &mut RandomStream) -> Box<DrawRow> {
        let (gain_sd, offset_um) = (values[0], values[1]);
        let (mut gain, mut offset) = (0.0, 0.0);
        Box::new(move |_, begins_cycle, stream| {
            if begins_cycle {
                (gain, offset) = (gain_sd * stream.normal(), offset_um * stream.normal());
            }
            [offset, gain]
        })
    }
}
