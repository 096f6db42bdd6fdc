//! Kinds of noise in challenges.

use serde::{Deserialize, Serialize};

use super::protocol::WHITE_M;
use criticism::NoiseValues;
use record::Record;
use sampling::ensemble::RandomStream;

base::named_enum! {
    /// Kind of noise in a challenge's data. The experiment may state the size of the noise (`noise_um`). The diagnosis must estimate everything else.
    #[derive(Serialize, Deserialize)]
    #[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
    #[serde(rename_all = "kebab-case")]
    pub enum NoiseKind {
        /// White noise with a standard deviation of 4 µm.
        White = "white",
        /// White noise of 4 µm, and slow noise: an Ornstein–Uhlenbeck process of 4 µm with a correlation time of 0.5 to 2 s.
        Ou = "ou",
        /// White noise of 4 µm, and a scale of the position that varies between cycles by 1 %.
        Gain = "gain",
        /// White noise of 4 µm, and outliers: 1 % of the rows deviate by 10 to 20 standard deviations.
        Outliers = "outliers",
        /// Slow noise only, of 3 to 6 µm with a correlation time of 0.1 to 10 s. It is an Ornstein–Uhlenbeck process (at equal intervals: autoregressive of order one).
        OuAlone = "ou-alone",
        /// Slow noise as in `OuAlone`, and outliers: 1 % of the rows deviate by 10 to 20 of its standard deviations.
        OuOutliers = "ou-outliers",
        /// White noise of 4 µm, and lost positions in a tenth of the rows. Half of them are lost singly, half in bursts of 0.25 to 1 s.
        Lost = "lost",
    }
    /// Name of the kind in options and JSON.
    pub fn name
}

/// Random errors and lost positions of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// Error of the position at every row, in m.
    pub error_m: Vec<f64>,
    /// True for each row whose position is lost.
    pub is_lost: Vec<bool>,
    /// Standard deviation of one position's error (m) that an experiment states. It excludes outliers and varying scales. If there is white noise, it also
    /// excludes the slow noise.
    pub stated_sd_m: f64,
}

impl Noise {
    /// Returns the measured positions for a noise-free trajectory (m); `None` where the position is lost.
    pub fn measured_m(&self, position_m: &[f64]) -> Vec<Option<f64>> {
        let rows = position_m.iter().zip(&self.error_m).zip(&self.is_lost);
        rows.map(|((position, error), is_lost)| (!is_lost).then_some(position + error)).collect()
    }

    /// Root mean square error (m) over the rows for which `is_asked_for` is true and that have a position; `None` if there are no such rows.
    pub fn rms_m(&self, is_asked_for: impl Fn(usize) -> bool) -> Option<f64> {
        let asked = (0..self.error_m.len()).filter(|row| !self.is_lost[*row] && is_asked_for(*row));
        let squares: Vec<f64> = asked.map(|row| self.error_m[row].powi(2)).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
}

const PROCESS_M: f64 = 4e-6;
const PROCESS_TIME_S: [f64; 2] = [0.5, 2.0];
const ALONE_M: [f64; 2] = [3e-6, 6e-6];
const ALONE_TIME_S: [f64; 2] = [0.1, 10.0];
const GAIN_SD: f64 = 0.01;
const OUTLIER_SHARE: f64 = 0.01;
const OUTLIER_SIZE: [f64; 2] = [10.0, 20.0];
const LOST_SHARE: f64 = 0.1;
/// Number of rows of the shortest and of the longest burst of lost positions.
const BURST_ROWS: [usize; 2] = [5, 20];
/// Value that stands for an absent noise term: negligible, but with a finite logarithm.
const NOTHING: f64 = 1e-6;

impl NoiseKind {
    /// Kinds of noise that are used by default.
    pub const USUAL: [Self; 4] = [Self::White, Self::Ou, Self::Gain, Self::Outliers];

    /// True if this kind includes white noise.
    fn has_white(self) -> bool {
        !matches!(self, Self::OuAlone | Self::OuOutliers)
    }

    /// Parameters of the noise model with which signals are measured: standard deviations of white and slow noise (µm), correlation time (s), and standard
    /// deviations of the cycles' gains and offsets. Randomly drawn parameters are at the middle of their ranges. Outliers and lost rows do not contribute.
    pub(super) fn parameters(self) -> NoiseValues {
        let middle = |[from, to]: [f64; 2]| (from * to).sqrt();
        let (process_um, time_s) = match self {
            Self::Ou => (1e6 * PROCESS_M, middle(PROCESS_TIME_S)),
            Self::OuAlone | Self::OuOutliers => (1e6 * middle(ALONE_M), middle(ALONE_TIME_S)),
            _ => (NOTHING, middle(PROCESS_TIME_S)),
        };
        let white_um = if self.has_white() { 1e6 * WHITE_M } else { NOTHING };
        let gain_sd = if self == Self::Gain { GAIN_SD } else { NOTHING };
        NoiseValues::new([white_um, process_um, time_s, gain_sd, NOTHING])
    }

    /// Draws random noise for a noise-free trajectory `position_m` (m), one value for each row of `record`.
    pub fn draw(self, record: &Record, position_m: &[f64], stream: &mut RandomStream) -> Noise {
        let white_m = if self.has_white() { WHITE_M } else { 0.0 };
        let mut error_m: Vec<f64> =
            position_m.iter().map(|_| if white_m > 0.0 { white_m * stream.normal() } else { 0.0 }).collect();
        let (mut stated_sd_m, mut is_lost) = (WHITE_M, vec![false; position_m.len()]);
        match self {
            Self::White => {}
            Self::Ou => {
                let correlation_s = log_uniform(PROCESS_TIME_S, stream);
                add_process(&mut error_m, &record.time_s, PROCESS_M, correlation_s, stream);
            }
            Self::Gain => {
                let gains: Vec<f64> = (0..record.n_cycles()).map(|_| GAIN_SD * stream.normal()).collect();
                for ((error, position), cycle) in error_m.iter_mut().zip(position_m).zip(&record.cycle) {
                    *error += position * gains.get(*cycle as usize - 1).copied().unwrap_or(0.0);
                }
            }
            Self::Outliers => add_outliers(&mut error_m, WHITE_M, stream),
            Self::OuAlone | Self::OuOutliers => {
                let correlation_s = log_uniform(ALONE_TIME_S, stream);
                stated_sd_m = log_uniform(ALONE_M, stream);
                add_process(&mut error_m, &record.time_s, stated_sd_m, correlation_s, stream);
                if self == Self::OuOutliers {
                    add_outliers(&mut error_m, stated_sd_m, stream);
                }
            }
            Self::Lost => is_lost = lost_rows(position_m.len(), stream),
        }
        Noise { error_m, is_lost, stated_sd_m }
    }
}

fn log_uniform([from, to]: [f64; 2], stream: &mut RandomStream) -> f64 {
    from * (to / from).powf(stream.unit())
}

fn add_process(error_m: &mut [f64], time_s: &[f64], sd_m: f64, correlation_s: f64, stream: &mut RandomStream) {
    let mut state_m = sd_m * stream.normal();
    for (row, error) in error_m.iter_mut().enumerate() {
        if row > 0 {
            let decay = (-(time_s[row] - time_s[row - 1]) / correlation_s).exp();
            state_m = decay * state_m + sd_m * (1.0 - decay * decay).sqrt() * stream.normal();
        }
        *error += state_m;
    }
}

fn add_outliers(error_m: &mut [f64], sd_m: f64, stream: &mut RandomStream) {
    for error in error_m {
        if stream.unit() < OUTLIER_SHARE {
            let size = OUTLIER_SIZE[0] + (OUTLIER_SIZE[1] - OUTLIER_SIZE[0]) * stream.unit();
            *error += sd_m * size * if stream.unit() < 0.5 { -1.0 } else { 1.0 };
        }
    }
}

/// Marks a tenth of the rows as lost: first single rows, then bursts.
fn lost_rows(n_rows: usize, stream: &mut RandomStream) -> Vec<bool> {
    let wanted = (LOST_SHARE * n_rows as f64).round() as usize;
    let (mut is_lost, mut n_lost) = (vec![false; n_rows], 0);
    while n_lost < wanted {
        let is_burst = n_lost >= wanted / 2;
        let length = if is_burst { BURST_ROWS[0] + stream.below(BURST_ROWS[1] - BURST_ROWS[0] + 1) } else { 1 };
        let first = stream.below(n_rows);
        for lost in is_lost.iter_mut().skip(first).take(length).filter(|lost| !**lost) {
            if n_lost < wanted {
                (*lost, n_lost) = (true, n_lost + 1);
            }
        }
    }
    is_lost
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::challenge::Protocol;

    /// The mean squares of 40 records with 800 rows agree with their definitions. The mean square of the slow noise varies most: by about 0.07 of its value,
    /// for correlation times up to 2 s and records of 40 s. Limits of five times this variation fail once in 10⁶.
    #[test]
    fn mean_squares_are_those_of_the_definitions() {
        let record = Protocol::Paper.record();
        let position_m = vec![500e-6; record.n_rows()];
        for (kind, expected_um2) in [
            (NoiseKind::White, 16.0),
            (NoiseKind::Ou, 32.0),
            (NoiseKind::Gain, 41.0),
            (NoiseKind::Outliers, 53.3),
            (NoiseKind::Lost, 16.0),
        ] {
            let mut sum_um2 = 0.0;
            for stream in 0..40 {
                let noise = kind.draw(&record, &position_m, &mut RandomStream::new(5, stream));
                sum_um2 += (1e6 * noise.rms_m(|_| true).expect("rows")).powi(2);
                assert_eq!(noise.stated_sd_m, WHITE_M);
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
            let noise = NoiseKind::Outliers.draw(&record, &position_m, &mut RandomStream::new(6, stream));
            n_far += noise.error_m.iter().filter(|error| error.abs() > 6.0 * WHITE_M).count();
        }
        // The expected number of outliers is 200 of 20 000 rows, with a standard deviation of 14. Limits of five standard deviations fail once in 10⁶.
        assert!((130..=270).contains(&n_far), "{n_far}");
    }

    /// Differences between neighbouring and distant rows agree with the slow noise's size and correlation time. The stated noise equals the drawn size. With
    /// 100 processes each mean varies by less than 0.05, so limits of five times that value fail once in 10⁶.
    #[test]
    fn slow_noise_has_the_size_that_is_stated_and_times_over_two_decades() {
        let record = Protocol::Paper.record();
        let position_m = vec![0.0; record.n_rows()];
        let (mut relative, mut n_far, mut times_s) = (0.0, 0, Vec::new());
        for stream in 0..100 {
            let draw = |kind: NoiseKind| kind.draw(&record, &position_m, &mut RandomStream::new(8, stream));
            let (slow, with_outliers) = (draw(NoiseKind::OuAlone), draw(NoiseKind::OuOutliers));
            assert!((3e-6..=6e-6).contains(&slow.stated_sd_m) && slow.stated_sd_m == with_outliers.stated_sd_m);
            relative += (slow.rms_m(|_| true).expect("rows") / slow.stated_sd_m).powi(2) / 100.0;
            // The outliers are the only difference from the slow noise without outliers.
            let moved: Vec<f64> = slow.error_m.iter().zip(&with_outliers.error_m).map(|(a, b)| (b - a).abs()).collect();
            let far: Vec<&f64> = moved.iter().filter(|moved| **moved > 0.0).collect();
            assert!(far.iter().all(|moved| (9.99..20.01).contains(&(*moved / slow.stated_sd_m))));
            n_far += far.len();
            let neighbours = slow.error_m.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>() / 799.0;
            let decay = 1.0 - 0.5 * neighbours / slow.stated_sd_m.powi(2);
            times_s.push(-0.05 / decay.ln());
        }
        assert!((relative - 1.0).abs() < 0.25, "{relative}");
        // The expected number of outliers is 800, with a standard deviation of 28.
        assert!((660..=940).contains(&n_far), "{n_far}");
        let (mut shortest, mut longest) = (f64::INFINITY, 0.0_f64);
        times_s.iter().for_each(|time| (shortest, longest) = (shortest.min(*time), longest.max(*time)));
        assert!(shortest < 0.2 && longest > 5.0, "{shortest} {longest}");
        let short = times_s.iter().filter(|time| **time < 1.0).count();
        // Half of the 100 correlation times are below a second. Five standard deviations of their number are 25.
        assert!((25..=75).contains(&short), "{short}");
    }

    #[test]
    fn a_tenth_of_the_rows_is_lost_alone_and_in_bursts() {
        let record = Protocol::Levels.record();
        let position_m = vec![1e-4; record.n_rows()];
        for stream in 0..20 {
            let noise = NoiseKind::Lost.draw(&record, &position_m, &mut RandomStream::new(7, stream));
            let measured_m = noise.measured_m(&position_m);
            let runs: Vec<usize> = measured_m.split(Option::is_some).map(<[_]>::len).filter(|n| *n > 0).collect();
            assert_eq!(runs.iter().sum::<usize>(), 80);
            assert!(runs.iter().any(|n| *n >= 5) && runs.iter().filter(|n| **n == 1).count() >= 10, "{runs:?}");
        }
    }
}
