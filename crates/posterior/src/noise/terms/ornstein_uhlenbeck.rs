//! Noise term with a stationary Ornstein–Uhlenbeck process.

use super::{Equations, NoiseTerm};
use crate::noise::NoiseScales;
use crate::noise::learnt_term::{
    DrawRow, LearningPrior, LearntParameter, LearntTerm, NoiseBounds, NoiseKnowledge, RowShare,
};
use crate::noise::scales::FilterScales;
use base::distribution::Distribution;
use base::parameter::{ParameterSpec, SLOW_NOISE_SD, SLOW_NOISE_TIME};
use figures::number::format_significant;
use sampling::ensemble::RandomStream;

pub(super) struct OrnsteinUhlenbeck;

impl NoiseTerm for OrnsteinUhlenbeck {
    fn name(&self) -> &'static str {
        "ou"
    }

    fn parameters(&self) -> &'static [ParameterSpec] {
        &[SLOW_NOISE_SD, SLOW_NOISE_TIME]
    }

    fn default_prior(&self, parameter: &ParameterSpec, scales: &NoiseScales) -> Option<(Distribution, &'static str)> {
        let NoiseScales { noise_sd_um, sample_interval_s, cycle_s } = *scales;
        if *parameter == SLOW_NOISE_SD {
            let distribution = Distribution::LogNormal { median: 0.5 * noise_sd_um, log_sd: 1.0 };
            return Some((distribution, "chosen: about half the white noise, within a factor of seven (95 %)"));
        }
        // A process that decays within two rows is equivalent to white noise. The two terms could then exchange their roles.
        let lower = 2.0 * sample_interval_s;
        let distribution = Distribution::LogUniform { lower, upper: cycle_s.max(10.0 * lower) };
        Some((distribution, "chosen: from two sample intervals, below which it is white noise, to a cycle"))
    }

    fn equations(&self) -> Equations {
        Equations { process: true, ..Equations::default() }
    }

    fn learning(&'static self) -> Option<&'static dyn LearntTerm> {
        Some(self)
    }

    fn write(&self, values: &[f64], scales: &mut FilterScales) {
        scales.ou = scales.ratio(1e-6 * values[0]);
        scales.ou_time_s = values[1];
    }
}

/// Prior standard deviation of the logarithm of the slow noise's size, if the reference noise is estimated from short lags. The value is large, because short lags
/// hardly show slow noise. Slow noise with a correlation time of ten sample intervals is four times the estimate. With a correlation time of ten seconds, it is twenty
/// times the estimate.
const LOG_SD_OF_ESTIMATE: f64 = 2.5;

fn ln_time_s(priors: &[Distribution]) -> [f64; 2] {
    let (shortest_s, longest_s) = priors[1].support();
    [shortest_s.ln(), longest_s.ln()]
}

impl LearntTerm for OrnsteinUhlenbeck {
    fn learnt(&self, scales: &NoiseScales, priors: &[Distribution], known: NoiseKnowledge) -> Vec<LearntParameter> {
        let ln_white_um = scales.noise_sd_um.ln();
        let [shortest, longest] = ln_time_s(priors);
        let prior = match (known, priors[0]) {
            (NoiseKnowledge::Bounded(bounds), _) => NoiseBounds::prior(bounds.slow_sd_um),
            (NoiseKnowledge::Estimated, Distribution::LogNormal { median, .. }) => {
                LearningPrior::OfLog(Distribution::LogNormal { median, log_sd: LOG_SD_OF_ESTIMATE })
            }
            (_, other) => LearningPrior::OfLog(other),
        };
        let sd = LearntParameter {
            spec: SLOW_NOISE_SD,
            prior,
            ln_ends: [ln_white_um - 7.0, ln_white_um + 9.0],
            ln_white: ln_white_um - 3.0,
            of_row: RowShare::Sd,
        };
        let time = LearntParameter {
            spec: SLOW_NOISE_TIME,
            prior: LearningPrior::Flat,
            ln_ends: [shortest, longest],
            ln_white: 0.5 * (shortest + longest),
            of_row: RowShare::Shape,
        };
        vec![sd, time]
    }

    /// Starts at three correlation times, each with a small and a large standard deviation.
    fn starts(&self, scales: &NoiseScales, priors: &[Distribution]) -> Vec<Vec<f64>> {
        let ln_white_um = scales.noise_sd_um.ln();
        let [shortest, longest] = ln_time_s(priors);
        let of_length = |share: f64| {
            let time = shortest + share * (longest - shortest);
            [-1.0, 0.5].map(|size| vec![ln_white_um + size, time])
        };
        [0.15, 0.5, 0.85].into_iter().flat_map(of_length).collect()
    }

    fn words(&self, values: &[f64]) -> String {
        format!(
            "slow noise of {} µm with a correlation time of {} s",
            format_significant(values[0], 3),
            format_significant(values[1], 2)
        )
    }

    fn sds_um(&self, values: &[f64], _: f64) -> Vec<f64> {
        vec![values[0]]
    }

    fn drawn(&self, values: &[f64], stream: &mut RandomStream) -> Box<DrawRow> {
        let (sd_um, time_s) = (values[0], values[1]);
        let mut process = sd_um * stream.normal();
        Box::new(move |step_s, _, stream| {
            if let Some(step_s) = step_s {
                let decay = (-step_s / time_s).exp();
                process = decay * process + sd_um * (1.0 - decay * decay).sqrt() * stream.normal();
            }
            [process, 0.0]
        })
    }
}
