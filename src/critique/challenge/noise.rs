//! The noises of challenges.

use serde::{Deserialize, Serialize};

use super::protocol::WHITE_M;
use crate::experiment::Record;
use crate::inference::ensemble::RandomStream;

/// What noise a challenge has. All have 4 µm of white noise, which is the `noise_um` of the experiment; the rest is for the diagnosis to find out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, schemars::JsonSchema, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NoiseKind {
    /// White alone.
    White,
    /// With an Ornstein–Uhlenbeck process of 4 µm and 0.5 to 2 s.
    Ou,
    /// With gains of cycles that scatter by 1 %.
    Gain,
    /// With 1 % of rows off by 10 to 20 standard deviations.
    Outliers,
}

const PROCESS_M: f64 = 4e-6;
const PROCESS_TIME_S: [f64; 2] = [0.5, 2.0];
const GAIN_SD: f64 = 0.01;
const OUTLIER_SHARE: f64 = 0.01;
const OUTLIER_SIZE: [f64; 2] = [10.0, 20.0];
/// A term of the noise that is not there: small, but with a logarithm.
const NOTHING: f64 = 1e-6;

impl NoiseKind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::White, Self::Ou, Self::Gain, Self::Outliers];

    /// Name in options and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::White => "white",
            Self::Ou => "ou",
            Self::Gain => "gain",
            Self::Outliers => "outliers",
        }
    }

    /// The noise model's parameters (σ and σ_ou in µm, τ in s, s_g, s_o in µm) under which signals are measured; outliers carry none.
    pub(super) fn parameters(self) -> [f64; 5] {
        let process_um = if self == Self::Ou { 1e6 * PROCESS_M } else { NOTHING };
        let gain_sd = if self == Self::Gain { GAIN_SD } else { NOTHING };
        [1e6 * WHITE_M, process_um, (PROCESS_TIME_S[0] * PROCESS_TIME_S[1]).sqrt(), gain_sd, NOTHING]
    }

    /// One draw (m, one value a row) around a trajectory (m).
    pub fn draw(self, record: &Record, position_m: &[f64], stream: &mut RandomStream) -> Vec<f64> {
        let mut noise_m: Vec<f64> = position_m.iter().map(|_| WHITE_M * stream.normal()).collect();
        match self {
            Self::White => {}
            Self::Ou => add_process(&mut noise_m, &record.time_s, stream),
            Self::Gain => {
                let gains: Vec<f64> = (0..record.n_cycles()).map(|_| GAIN_SD * stream.normal()).collect();
                for ((noise, position), cycle) in noise_m.iter_mut().zip(position_m).zip(&record.cycle) {
                    *noise += position * gains.get(*cycle as usize - 1).copied().unwrap_or(0.0);
                }
            }
            Self::Outliers => {
                for noise in &mut noise_m {
                    if stream.unit() < OUTLIER_SHARE {
                        let size = OUTLIER_SIZE[0] + (OUTLIER_SIZE[1] - OUTLIER_SIZE[0]) * stream.unit();
                        *noise += WHITE_M * size * if stream.unit() < 0.5 { -1.0 } else { 1.0 };
                    }
                }
            }
        }
        noise_m
    }
}

fn add_process(noise_m: &mut [f64], time_s: &[f64], stream: &mut RandomStream) {
    let [shortest_s, longest_s] = PROCESS_TIME_S;
    let correlation_s = shortest_s * (longest_s / shortest_s).powf(stream.unit());
    let mut state_m = PROCESS_M * stream.normal();
    for (row, noise) in noise_m.iter_mut().enumerate() {
        if row > 0 {
            let decay = (-(time_s[row] - time_s[row - 1]) / correlation_s).exp();
            state_m = decay * state_m + PROCESS_M * (1.0 - decay * decay).sqrt() * stream.normal();
        }
        *noise += state_m;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::critique::challenge::Protocol;

    /// Mean squares of 40 records of 800 rows. The process's has the largest scatter, some 0.07 of its value with 2 τ = 4 s of 40 s records: bounds at
    /// five times that are failed once in 10⁶.
    #[test]
    fn mean_squares_are_those_of_the_definitions() {
        let record = Protocol::Paper.record();
        let position_m = vec![500e-6; record.n_rows()];
        for (kind, expected_um2) in
            [(NoiseKind::White, 16.0), (NoiseKind::Ou, 32.0), (NoiseKind::Gain, 41.0), (NoiseKind::Outliers, 53.3)]
        {
            let mut sum_um2 = 0.0;
            for stream in 0..40 {
                let noise_m = kind.draw(&record, &position_m, &mut RandomStream::new(5, stream));
                sum_um2 += noise_m.iter().map(|noise| (1e6 * noise).powi(2)).sum::<f64>() / noise_m.len() as f64;
            }
            let found_um2 = sum_um2 / 40.0;
            assert!((found_um2 / expected_um2 - 1.0).abs() < 0.35, "{kind:?}: {found_um2}");
        }
    }

    #[test]
    fn outliers_are_one_row_in_a_hundred() {
        let record = Protocol::Paper.record();
        let position_m = vec![0.0; record.n_rows()];
        let mut n_far = 0;
        for stream in 0..25 {
            let noise_m = NoiseKind::Outliers.draw(&record, &position_m, &mut RandomStream::new(6, stream));
            n_far += noise_m.iter().filter(|noise| noise.abs() > 6.0 * WHITE_M).count();
        }
        // 200 expected of 20 000 with a standard deviation of 14: five of them are passed once in 10⁶.
        assert!((130..=270).contains(&n_far), "{n_far}");
    }
}
