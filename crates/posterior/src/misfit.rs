//! Test for residuals that exceed the noise. The commands `sample` and `diagnose` share this test (docs/diagnosis.md).
//!
//! Slow noise and a misfit look alike in one cycle. Two properties distinguish them.
//!
//! *Size*, if the noise is given. Slow noise as large as the tracker's noise σ may be added to it. Let V be the mean square residual of n rows. Its slow part V − σ²
//! scatters like that of ν = n/(1 + 2Σρ²) independent values, where ρ is the slow part's autocorrelation at each lag. V is too large if √V > 1.5 σ and ν(V − σ²)/σ²
//! lies beyond the 99.9 % point of χ² with ν degrees of freedom. For white errors the limit is 1.5 σ itself.
//!
//! *Return*, for given or unknown noise. Noise differs in every cycle; a misfit recurs. An offset and a slope are removed from the residuals of each cycle, and a
//! multiple of the position if the noise has a gain. Let aₖ꜀ be the k-th of K Fourier coefficients of cycle c, for C cycles with the same command. The test uses
//!
//!   γₖ = |Σ꜀ aₖ꜀|² / (C Σ꜀ |aₖ꜀|²),   S = −(C − 1) Σₖ ln(1 − γₖ)
//!
//! The phases of stationary noise are independent between cycles. γₖ is therefore Beta(1, C − 1) distributed, and S is Gamma(K, 1) distributed. If S exceeds its 99.99
//! % point, the residuals recur. They are a misfit if their root mean square also exceeds 1.5 times the noise. This noise is given, or estimated from the part of the
//! residuals that does not recur. The test needs neither the size nor the correlation time of slow noise. The removal of offset and slope makes harmonics of very slow
//! noise depend on each other. S then exceeds its point in up to 1.5 of a thousand records of pure noise.
//!
//! *Size in the held-out cycles*, for given or unknown noise. Pure noise is as large in the held-out cycles as in the fitted cycles. The test compares the mean squares
//! V of both, each with its number ν of independent values. A ratio V_held-out / V_fitted above 1.5² and above the 99.9 % point of F(ν_held-out, ν_fitted) is a misfit
//! that the fitted cycles do not show. V_fitted is corrected for the fitted parameters and is at least the square of the noise.
//!
//! *Gain and offset.* If the noise has a gain and an offset, both are removed from every recording ([`super::recordings`]) before its size is tested. They are removed
//! from held-out recordings only if the model declares them, or if they are no larger than those of at least two fitted recordings. An F test compares the mean squares
//! of the removed parts, with two degrees of freedom for each recording. A held-out cycle in a recording with fitted rows has the gain and the offset of those rows.
//! Nothing is removed if the gains are no noise ([`ImplausibleGains`]): cycles of one protocol are alike within a few per cent, and noise does not grow steadily.
//!
//! γₖ is the squared inter-trial coherence of evoked responses (Jervis et al., *IEEE Trans. Biomed. Eng.* 30, 43, 1983, doi:10.1109/TBME.1983.325165).

use std::ops::Range;

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor, Gamma, StudentsT};

use figures::number::format_significant;
use record::Record;

use super::recordings::recordings;

/// Ratio to the known noise above which residuals or a learnt noise contain a misfit (formats §4).
pub const NOISE_FACTOR: f64 = 1.5;
/// False-alarm probability: fraction of records of pure noise whose residuals are called too large.
pub const FALSE_ALARM: f64 = 0.001;
/// Joint probability of the held-out cycles below which they lie outside the 99.9 % band.
pub const OUTSIDE_BAND: f64 = 0.001;
/// Largest p value at which residuals count as recurring. About one in a thousand records of pure noise has a smaller p value, because the harmonics of slow noise
/// depend on each other. This holds for any correlation time.
const RETURN_P: f64 = 1e-4;
/// Factor on the number of independent values in the comparison of fitted and held-out cycles. The factor is below 1, because autocorrelations that are estimated from
/// few values are too small. For four cycles of ten seconds and slow noise with a correlation time of one cycle, five of a thousand records then show a misfit.
const SHARE_OF_NUMBERS: f64 = 0.5;
/// Largest number of harmonics of the cycle that the test for recurrence uses.
const MOST_HARMONICS: usize = 8;
/// Smallest number of rows of a cycle per harmonic that the test for recurrence uses.
const ROWS_PER_HARMONIC: usize = 6;
/// Largest force difference between two cycles with the same command, as a fraction of the force range.
const SAME_FORCE: f64 = 0.05;
/// Largest fraction of rows at which the forces of two cycles with the same command may differ by more than [`SAME_FORCE`].
const OTHER_ROWS: f64 = 0.03;
/// Largest relative difference of the durations of two cycles with the same command.
const SAME_DURATION: f64 = 0.05;
/// Largest gain of a recording, relative to 1, that can be noise.
const LARGEST_GAIN: f64 = 0.3;
/// Least part of the residual that a large gain makes, divided by the rest. Slow noise of a recording with little motion stays below it.
const DOMINANT: f64 = 3.0;
/// Number of standard errors by which a gain exceeds [`LARGEST_GAIN`] before it counts as larger.
const GAIN_MARGIN: f64 = 4.0;
/// Smallest number of recordings that show whether gains change steadily.
const FEWEST_GAINS: usize = 4;
/// Smallest norm of a column's remainder, as a fraction of its norm, after the previous columns are projected out. A smaller remainder counts as a rounding error.
const LEAST_NEW: f64 = 1e-6;

/// Input of the misfit test: a model's residuals in a record.
pub struct Residuals<'a> {
    /// Record with the times, cycles and forces.
    pub record: &'a Record,
    /// Residual (m) in the fitted cycles; one entry per row.
    pub fitted_m: &'a [Option<f64>],
    /// Residual (m) in the held-out cycles; one entry per row.
    pub heldout_m: &'a [Option<f64>],
    /// The model's position (m) at every row.
    pub position_m: &'a [f64],
    /// Directions in which the parameters can move the model's position: one column per direction, with one value (m) per row. Residuals that are combinations of these
    /// columns are no misfit, even if they recur.
    pub absorbed_m: &'a [Vec<f64>],
    /// Knowledge about a gain and an offset of each recording.
    pub gains: GainKnowledge,
}

/// Knowledge about a gain and an offset of each recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GainKnowledge {
    /// The noise of the model has neither a gain nor an offset.
    None,
    /// The model has the noise term `gain`, so every recording has a gain and an offset.
    Declared,
    /// A search learns a gain and an offset with every model. They are removed from held-out recordings only if they are no larger than in fitted recordings.
    Learnt,
}

/// Gains of the recordings that are no noise. They are not removed from the residuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ImplausibleGains {
    /// A gain differs from 1 by this much, which is more than 0.3.
    Large(f64),
    /// The gains change by this much from one recording to the next, on a straight line. Independent gains follow a line so closely with a probability below 0.001.
    Steady(f64),
}

impl ImplausibleGains {
    /// Phrase for a sentence about a misfit.
    pub fn words(&self) -> String {
        let percent = |gain: f64| format_significant(100.0 * gain.abs(), 2);
        match *self {
            Self::Large(gain) => {
                format!(
                    "the residual of a recording is up to {} % of the model itself, which noise cannot cause",
                    percent(gain)
                )
            }
            Self::Steady(change) => format!(
                "the measured values {} by {} % from one recording to the next, which noise cannot cause",
                if change > 0.0 { "grow steadily" } else { "shrink steadily" },
                percent(change)
            ),
        }
    }
}

/// Root mean square residual of some cycles, with the result of its comparison with the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidualSize {
    /// Root mean square residual in m, after removal of each recording's gain and offset if the noise has them.
    pub rms_m: f64,
    /// True if the root mean square is too large for noise.
    pub is_too_large: bool,
}

/// Result of the misfit test: the residuals of fitted and held-out cycles, compared with the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// Residual of the fitted cycles.
    pub fitted: ResidualSize,
    /// Residual of the held-out cycles; `None` without held-out cycles.
    pub heldout: Option<ResidualSize>,
    /// Noise standard deviation (m) with which the residuals are compared.
    pub noise_m: f64,
    /// True if the noise was given with the experiment.
    pub is_known: bool,
    /// Root mean square (m) of the part of the residuals that recurs in every cycle; `None` if chance explains it.
    pub returning_m: Option<f64>,
    /// Gains that would have been removed, but are no noise.
    pub implausible_gains: Option<ImplausibleGains>,
    /// Number of independent values to which the slow part of the fitted residuals is equivalent. [`Misfit::is_learnt_too_large`] uses it. It is 0 if the size of a
    /// learnt noise is not tested.
    pub learnt_degrees: f64,
}

impl Misfit {
    /// Compares residuals with a noise standard deviation (m), which is known or estimated. An estimate from rests or short lags contains no slow noise. Returns `None`
    /// if no position is fitted.
    pub fn of(remainder: &Residuals, noise_m: f64, is_known: bool) -> Option<Self> {
        Self::beside(remainder, noise_m, is_known, true)
    }

    /// Compares residuals with the noise `noise_m`. If `is_measured` is false, the noise was taken from the residuals themselves, so its size alone sets no limit.
    fn beside(remainder: &Residuals, noise_m: f64, is_known: bool, is_measured: bool) -> Option<Self> {
        let (has_gain, implausible_gains) = remainder.judge_gains();
        let returning = RecurringPart::of(remainder);
        let fitted = Series::of(remainder, remainder.fitted_m, has_gain)?;
        let heldout = Series::of(remainder, remainder.heldout_m, has_gain && remainder.shows_gains());
        // The removal of the parameters' columns distributes a misfit of the held-out cycles over all cycles. A recurring misfit must therefore also be present in the
        // fitted cycles.
        let most_m2 = NOISE_FACTOR * NOISE_FACTOR * fitted.mean_square_m2;
        let comes_again = returning
            .as_ref()
            .is_some_and(|recurring_part| recurring_part.p < RETURN_P && recurring_part.returning_m2 <= most_m2);
        // Only recurrence distinguishes a misfit from slow noise of unknown size.
        let noise_m = match &returning {
            Some(part) if !is_known => noise_m.max(part.noise_m2.min(fitted.mean_square_m2).sqrt()),
            _ => noise_m,
        };
        let has_bound = is_known || is_measured && returning.is_none();
        let judged = |series: &Series, is_beyond: bool| ResidualSize {
            rms_m: series.mean_square_m2.sqrt(),
            is_too_large: series.mean_square_m2.sqrt() > NOISE_FACTOR * noise_m
                && (comes_again
                    || is_beyond
                    || implausible_gains.is_some()
                    || has_bound && is_beyond_slow_noise(series.mean_square_m2, noise_m, series.degrees(noise_m))),
        };
        let beyond_fitted = |series: &Series| series.is_beyond(&fitted, remainder.absorbed_m.len(), noise_m);
        Some(Self {
            fitted: judged(&fitted, false),
            heldout: heldout.as_ref().map(|series| judged(series, beyond_fitted(series))),
            noise_m,
            is_known,
            implausible_gains,
            returning_m: returning
                .filter(|_| comes_again)
                .map(|recurring_part| recurring_part.returning_m2.max(0.0).sqrt()),
            learnt_degrees: if has_bound { fitted.degrees(noise_m) } else { 0.0 },
        })
    }

    /// Compares the held-out residuals with the fitted ones, for unknown noise; `None` if no position is fitted.
    pub fn relative_to_fitted(remainder: &Residuals) -> Option<Self> {
        let fitted = Series::of(remainder, remainder.fitted_m, remainder.judge_gains().0)?;
        Self::beside(remainder, fitted.corrected_m2(remainder.absorbed_m.len()).sqrt(), false, false)
    }

    /// Returns true if the residuals of the fitted or the held-out cycles are too large for noise.
    pub fn is_too_large(&self) -> bool {
        self.fitted.is_too_large || self.heldout.is_some_and(|heldout| heldout.is_too_large)
    }

    /// Returns true if a learnt noise standard deviation (m) is so large that it contains a misfit.
    pub fn is_learnt_too_large(&self, learnt_m: f64) -> bool {
        let is_beyond = || is_beyond_slow_noise(learnt_m * learnt_m, self.noise_m, self.learnt_degrees);
        learnt_m > NOISE_FACTOR * self.noise_m
            && (self.returning_m.is_some() || self.learnt_degrees > 0.0 && is_beyond())
    }
}

/// Orthonormal directions in which posterior draws differ most from their mean. `draws_m` holds each draw's position (m) at every row, and `mean_m` the mean position.
/// Returns at most `n` directions with one value per row, and fewer if the draws span fewer directions.
pub fn directions_of_spread(draws_m: &[Vec<f64>], mean_m: &[f64], n: usize) -> Vec<Vec<f64>> {
    let mut left: Vec<Vec<f64>> =
        draws_m.iter().map(|draw_m| draw_m.iter().zip(mean_m).map(|(x, mean)| x - mean).collect()).collect();
    let mut directions: Vec<Vec<f64>> = Vec::with_capacity(n);
    let mut largest = 0.0_f64;
    for _ in 0..n.min(left.len()) {
        let squares: Vec<f64> = left.iter().map(|values| dot(values, values)).collect();
        let Some(farthest) = (0..left.len()).max_by(|a, b| squares[*a].total_cmp(&squares[*b])) else { break };
        largest = largest.max(squares[farthest]);
        if squares[farthest] <= LEAST_NEW * LEAST_NEW * largest {
            break;
        }
        let norm = squares[farthest].sqrt();
        let direction: Vec<f64> = left[farthest].iter().map(|value| value / norm).collect();
        for values in &mut left {
            let along = dot(values, &direction);
            subtract(values, &direction, along);
        }
        directions.push(direction);
    }
    directions
}

/// Returns true if noise has so large a mean square with a probability below 0.001. The noise is the sum of the known noise and of slow noise of equal size, with
/// `degrees` independent values.
fn is_beyond_slow_noise(mean_square_m2: f64, noise_m: f64, degrees: f64) -> bool {
    let slow = mean_square_m2 / (noise_m * noise_m) - 1.0;
    slow > 0.0 && ChiSquared::new(degrees.max(1.0)).is_ok_and(|chi| chi.sf(degrees.max(1.0) * slow) < FALSE_ALARM)
}

/// Residuals (m) of a recording's fitted or held-out rows, in order of time.
struct Recording {
    left_m: Vec<f64>,
    /// Residuals after removal of a gain and an offset. They equal `left_m` if fitted rows of the same recording determine gain and offset.
    without_gain_m: Vec<f64>,
    /// True if a gain and an offset of this recording were removed.
    has_own_gain: bool,
}

impl Recording {
    /// Mean square (m²) of the removed part of the residuals.
    fn removed_mean_square_m2(&self) -> f64 {
        let taken = self.left_m.iter().zip(&self.without_gain_m).map(|(all, left)| (all - left).powi(2));
        taken.sum::<f64>() / self.left_m.len().max(1) as f64
    }
}

impl Residuals<'_> {
    /// Recordings with at least one residual in `rows` (m, one entry per row of the record).
    fn recordings(&self, rows: &[Option<f64>]) -> Vec<Recording> {
        let numbers = recordings(self.record);
        let of_rows = |range: Range<usize>| {
            let has_fitted = range.clone().any(|row| self.fitted_m[row].is_some());
            let there: Vec<usize> = range.filter(|row| rows[*row].is_some()).collect();
            let left_m: Vec<f64> = there.iter().filter_map(|row| rows[*row]).collect();
            let has_own_gain = !has_fitted || there.iter().any(|row| self.fitted_m[*row].is_some());
            let mut without_gain_m = left_m.clone();
            if has_own_gain {
                let position_m: Vec<f64> = there.iter().map(|row| self.position_m[*row]).collect();
                project_out(&mut without_gain_m, vec![vec![1.0; there.len()], position_m]);
            }
            (!there.is_empty()).then_some(Recording { left_m, without_gain_m, has_own_gain })
        };
        numbers.chunk_by(|a, b| a == b).scan(0, next_range).filter_map(of_rows).collect()
    }

    /// Returns whether the recordings have gains that can be noise, and otherwise the gains that cannot.
    fn judge_gains(&self) -> (bool, Option<ImplausibleGains>) {
        if self.gains == GainKnowledge::None {
            return (false, None);
        }
        let numbers = recordings(self.record);
        let of_recording = |range: Range<usize>| {
            let with_residual = |row: usize| Some((self.position_m[row], self.fitted_m[row].or(self.heldout_m[row])?));
            let pairs: Vec<(f64, f64)> = range.filter_map(with_residual).collect();
            RecordingGain::of(&pairs)
        };
        let gains: Vec<RecordingGain> =
            numbers.chunk_by(|a, b| a == b).scan(0, next_range).filter_map(of_recording).collect();
        let is_large = |found: &&RecordingGain| {
            found.gain.abs() > LARGEST_GAIN + GAIN_MARGIN * found.error && found.over_rest > DOMINANT
        };
        let large = gains.iter().filter(is_large).map(|found| found.gain.abs()).reduce(f64::max);
        let large = large.map(ImplausibleGains::Large);
        let implausible = large.or_else(|| steady_change(&gains).map(ImplausibleGains::Steady));
        (implausible.is_none(), implausible)
    }

    /// Returns true if a gain and an offset may be removed from held-out recordings. This is allowed if the model declares them, or if they are no larger than in the
    /// fitted recordings.
    fn shows_gains(&self) -> bool {
        if self.gains != GainKnowledge::Learnt {
            return self.gains == GainKnowledge::Declared;
        }
        let removed_mean_square_m2 = |rows: &[Option<f64>]| -> Vec<f64> {
            self.recordings(rows)
                .iter()
                .filter(|recording| recording.has_own_gain)
                .map(Recording::removed_mean_square_m2)
                .collect()
        };
        let (fitted, heldout) = (removed_mean_square_m2(self.fitted_m), removed_mean_square_m2(self.heldout_m));
        if heldout.is_empty() || fitted.len() < 2 {
            return false;
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        // The law absorbs the mean gain and offset of the fitted recordings. The degrees of freedom are therefore counted with one recording fewer.
        let (of_heldout, of_fitted) = (2.0 * heldout.len() as f64, 2.0 * (fitted.len() - 1) as f64);
        let ratio = mean(&heldout) / (mean(&fitted) * fitted.len() as f64 / (fitted.len() - 1) as f64);
        FisherSnedecor::new(of_heldout, of_fitted).is_ok_and(|f| !ratio.is_finite() || f.sf(ratio) >= FALSE_ALARM)
    }
}

/// Residuals (m) of the fitted or the held-out cycles, in order of time, with their mean square.
struct Series {
    left_m: Vec<f64>,
    mean_square_m2: f64,
}

impl Series {
    /// Collects the residuals in `rows` (m, one entry per row of the record). `gives_up_gains` removes a gain and an offset from each recording. Returns `None` if
    /// there is no residual.
    fn of(remainder: &Residuals, rows: &[Option<f64>], gives_up_gains: bool) -> Option<Self> {
        let of = |recording: Recording| if gives_up_gains { recording.without_gain_m } else { recording.left_m };
        let left_m: Vec<f64> = remainder.recordings(rows).into_iter().flat_map(of).collect();
        let n = left_m.len();
        let mean_square_m2 = left_m.iter().map(|left| left * left).sum::<f64>() / n.max(1) as f64;
        (n > 0).then_some(Self { left_m, mean_square_m2 })
    }

    /// Sum of squares divided by n − `n_parameters`, in m². Here n is the number of residuals.
    fn corrected_m2(&self, n_parameters: usize) -> f64 {
        let n = self.left_m.len();
        self.mean_square_m2 * n as f64 / n.saturating_sub(n_parameters).max(1) as f64
    }

    /// Returns true if the mean square is too large compared with the mean square of the fitted cycles. The ratio of the two then exceeds 1.5², and equal noise in both
    /// has so large a ratio with a probability below 0.001.
    fn is_beyond(&self, fitted: &Self, n_parameters: usize, noise_m: f64) -> bool {
        let expected_m2 = fitted.corrected_m2(n_parameters).max(noise_m * noise_m);
        let ratio = self.mean_square_m2 / expected_m2;
        let of_fitted = (fitted.degrees_of_square() - n_parameters as f64).max(1.0);
        ratio > NOISE_FACTOR * NOISE_FACTOR
            && FisherSnedecor::new(self.degrees_of_square().max(1.0), of_fitted)
                .is_ok_and(|f| f.sf(ratio) < FALSE_ALARM)
    }

    /// Degrees of freedom of the mean square: the number of independent values, reduced if a few outliers dominate. The mean square of n values with kurtosis κ
    /// scatters as much as the mean square of 2n/(κ − 1) normal values.
    fn degrees_of_square(&self) -> f64 {
        let n = self.left_m.len().max(1) as f64;
        let fourth_m4 = self.left_m.iter().map(|left| left.powi(4)).sum::<f64>() / n;
        let kurtosis = fourth_m4 / self.mean_square_m2.powi(2);
        let share = if kurtosis.is_finite() { (2.0 / (kurtosis - 1.0).max(f64::MIN_POSITIVE)).min(1.0) } else { 1.0 };
        SHARE_OF_NUMBERS * share * self.degrees(0.0)
    }

    /// Number of independent values to which the slow part of the n residuals is equivalent: n/(1 + 2Σρ²), where ρ is the autocorrelation of the slow part. The sum
    /// ends at the first lag whose autocorrelation is below its standard error 1/√n. Long lags are sampled, and each represents its neighbours.
    fn degrees(&self, noise_m: f64) -> f64 {
        let n = self.left_m.len();
        let slow_m2 = self.mean_square_m2 - noise_m * noise_m;
        if slow_m2 <= 0.0 {
            return n as f64;
        }
        let (mut sum, mut lag) = (0.0, 1);
        while 2 * lag < n {
            let product: f64 = self.left_m.iter().zip(&self.left_m[lag..]).map(|(a, b)| a * b).sum();
            let correlation = product / n as f64 / self.mean_square_m2;
            if correlation < 1.0 / (n as f64).sqrt() {
                break;
            }
            let step = 1 + lag / 16;
            sum += step as f64 * (correlation * self.mean_square_m2 / slow_m2).min(1.0).powi(2);
            lag += step;
        }
        n as f64 / (1.0 + 2.0 * sum)
    }
}

/// Gain of a recording: slope of its residuals (m) over its positions (m).
struct RecordingGain {
    gain: f64,
    /// Standard error of the gain, for white residuals.
    error: f64,
    /// Root mean square of the part of the residuals that the gain makes, divided by that of the rest.
    over_rest: f64,
}

impl RecordingGain {
    /// Least-squares gain of pairs of position and residual. `None` if the positions do not determine it.
    fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        let n = pairs.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
        let (mean_x, mean_left) = (mean(|pair| pair.0), mean(|pair| pair.1));
        let sum =
            |of: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|(x, left)| of(x - mean_x, left - mean_left)).sum::<f64>();
        let square = sum(&|x, _| x * x);
        let gain = sum(&|x, left| x * left) / square;
        let rest = sum(&|x, left| (left - gain * x).powi(2));
        let error = (rest / (n - 2.0) / square).sqrt();
        let is_determined = pairs.len() > 2 && gain.is_finite() && error.is_finite();
        is_determined.then(|| Self { gain, error, over_rest: gain.abs() * (square / rest).sqrt() })
    }
}

/// Change of the gain from one recording to the next, if the gains lie closer to a straight line than independent gains do, and one of them makes most of its recording's residual.
fn steady_change(gains: &[RecordingGain]) -> Option<f64> {
    let n = gains.len();
    if n < FEWEST_GAINS || !gains.iter().any(|found| found.over_rest > 1.0) {
        return None;
    }
    let numbered: Vec<(f64, f64)> =
        gains.iter().enumerate().map(|(number, found)| (number as f64, found.gain)).collect();
    let RecordingGain { gain: slope, error, .. } = RecordingGain::of(&numbered)?;
    let score = (slope / error).abs();
    (score > 0.0 && 2.0 * StudentsT::new(0.0, 1.0, n as f64 - 2.0).ok()?.sf(score) < FALSE_ALARM).then_some(slope)
}

/// Part of the residuals that recurs in every cycle of the same command.
struct RecurringPart {
    /// Probability that pure noise recurs in every cycle as strongly as the residuals.
    p: f64,
    /// Mean square of the recurring part, in m².
    returning_m2: f64,
    /// Mean square of the part of the residuals that does not recur, in m².
    noise_m2: f64,
}

impl RecurringPart {
    /// Estimates the recurring part from all residuals; `None` if fewer than two cycles with the same command have enough rows.
    fn of(remainder: &Residuals) -> Option<Self> {
        let record = remainder.record;
        let mut left_m: Vec<Option<f64>> =
            remainder.fitted_m.iter().zip(remainder.heldout_m).map(|(fitted, heldout)| fitted.or(*heldout)).collect();
        absorb(&mut left_m, remainder.absorbed_m);
        let cycles = same_command(record, &left_m);
        let fewest = cycles.iter().map(|cycle| cycle.rows.len()).min()?;
        let n_harmonics = (fewest / ROWS_PER_HARMONIC).min(MOST_HARMONICS);
        if cycles.len() < 2 || n_harmonics == 0 {
            return None;
        }
        let mut coefficients = Vec::with_capacity(cycles.len());
        let (mut squares_m2, mut n_rows) = (0.0, 0);
        for cycle in &cycles {
            let mut of_cycle: Vec<f64> = cycle.rows.iter().filter_map(|row| left_m[*row]).collect();
            let mut nuisance = vec![vec![1.0; cycle.rows.len()], cycle.phase.clone()];
            if remainder.gains != GainKnowledge::None {
                nuisance.push(cycle.rows.iter().map(|row| remainder.position_m[*row]).collect());
            }
            project_out(&mut of_cycle, nuisance);
            squares_m2 += of_cycle.iter().map(|left| left * left).sum::<f64>();
            n_rows += of_cycle.len();
            coefficients.push(fourier(&of_cycle, &cycle.phase, n_harmonics));
        }
        let n_cycles = cycles.len() as f64;
        let (mut statistic, mut returning_m2) = (0.0, 0.0);
        for k in 0..n_harmonics {
            let sum = coefficients
                .iter()
                .fold([0.0; 2], |sum, coefficient| [sum[0] + coefficient[k][0], sum[1] + coefficient[k][1]]);
            let of_sum = sum[0].powi(2) + sum[1].powi(2);
            let each: f64 =
                coefficients.iter().map(|coefficient| coefficient[k][0].powi(2) + coefficient[k][1].powi(2)).sum();
            if each > 0.0 {
                let coherence = (of_sum / (n_cycles * each)).min(1.0 - f64::EPSILON);
                statistic -= (n_cycles - 1.0) * (-coherence).ln_1p();
            }
            // The added term is half the inner product of two cycles' coefficients, averaged over all pairs of different cycles. Its mean is 0 for pure noise.
            returning_m2 += 0.5 * (of_sum - each) / (n_cycles * (n_cycles - 1.0));
        }
        let p = Gamma::new(n_harmonics as f64, 1.0).ok()?.sf(statistic);
        let noise_m2 = (squares_m2 / n_rows.max(1) as f64 - returning_m2.max(0.0)).max(0.0);
        Some(Self { p, returning_m2, noise_m2 })
    }
}

/// Range of rows of each cycle of a record, in order of time.
fn cycles_of(record: &Record) -> impl Iterator<Item = Range<usize>> {
    record.cycle.chunk_by(|a, b| a == b).scan(0, next_range)
}

/// Index range of the next chunk. `start` is the beginning of this range and is moved to its end.
#[expect(clippy::unnecessary_wraps, reason = "`scan` expects an `Option`")]
fn next_range(start: &mut usize, chunk: &[u32]) -> Option<Range<usize>> {
    let range = *start..*start + chunk.len();
    *start = range.end;
    Some(range)
}

/// Rows of a cycle that have a residual, and the phase of each: the time since the cycle began, divided by the cycle's duration.
struct Cycle {
    rows: Vec<usize>,
    phase: Vec<f64>,
}

/// Finds the largest set of cycles that have the same commanded force and enough residuals.
fn same_command(record: &Record, left_m: &[Option<f64>]) -> Vec<Cycle> {
    let interval_s = record.median_interval_s().unwrap_or(0.0);
    let duration_s = |rows: &Range<usize>| record.time_s[rows.end - 1] - record.time_s[rows.start] + interval_s;
    let mut groups: Vec<Vec<Range<usize>>> = Vec::new();
    for rows in cycles_of(record) {
        let alike = |group: &&mut Vec<Range<usize>>| {
            let (own_s, other_s) = (duration_s(&rows), duration_s(&group[0]));
            (own_s - other_s).abs() <= SAME_DURATION * other_s && has_same_force(record, &rows, &group[0])
        };
        match groups.iter_mut().find(alike) {
            Some(group) => group.push(rows),
            None => groups.push(vec![rows]),
        }
    }
    let with_positions = |rows: Range<usize>| {
        let (start_s, whole_s) = (record.time_s[rows.start], duration_s(&rows));
        let rows: Vec<usize> = rows.filter(|row| left_m[*row].is_some()).collect();
        let phase = rows.iter().map(|row| (record.time_s[*row] - start_s) / whole_s).collect();
        Cycle { rows, phase }
    };
    let groups = groups.into_iter().map(|group| {
        let cycles = group.into_iter().map(with_positions);
        cycles.filter(|cycle| cycle.rows.len() >= ROWS_PER_HARMONIC).collect::<Vec<Cycle>>()
    });
    groups.fold(Vec::new(), |most, group| if group.len() > most.len() { group } else { most })
}

fn has_same_force(record: &Record, rows: &Range<usize>, other: &Range<usize>) -> bool {
    let tolerance_n = SAME_FORCE * record.force_range_n();
    let times_s = &record.time_s[other.clone()];
    let differs = |row: &usize| {
        let at_s = times_s[0] + record.time_s[*row] - record.time_s[rows.start];
        let place = times_s.partition_point(|t| *t <= at_s + 1e-9 * at_s.abs()).max(1) - 1;
        (record.force_n[other.start + place] - record.force_n[*row]).abs() > tolerance_n
    };
    rows.clone().filter(differs).count() as f64 <= OTHER_ROWS * rows.len() as f64
}

/// Subtracts from `values` the least-squares combination of the columns that fits them best.
pub(super) fn project_out(values: &mut [f64], columns: Vec<Vec<f64>>) {
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(columns.len());
    for mut column in columns {
        let whole = dot(&column, &column);
        // Two passes make the columns orthogonal up to rounding errors.
        for _ in 0..2 {
            for values in &basis {
                let along = dot(values, &column);
                subtract(&mut column, values, along);
            }
        }
        let left = dot(&column, &column);
        if left > LEAST_NEW * LEAST_NEW * whole {
            column.iter_mut().for_each(|value| *value /= left.sqrt());
            let along = dot(&column, values);
            subtract(values, &column, along);
            basis.push(column);
        }
    }
}

/// Removes the part of the residuals that the model's parameters can absorb, by least squares over all rows with a residual.
fn absorb(left_m: &mut [Option<f64>], columns_m: &[Vec<f64>]) {
    let rows: Vec<usize> = (0..left_m.len()).filter(|row| left_m[*row].is_some()).collect();
    let mut values: Vec<f64> = left_m.iter().flatten().copied().collect();
    project_out(&mut values, columns_m.iter().map(|column| rows.iter().map(|row| column[*row]).collect()).collect());
    rows.iter().zip(values).for_each(|(row, value)| left_m[*row] = Some(value));
}

/// Cosine and sine amplitude of each harmonic, by joint least squares. `phase` is 0 at the cycle's beginning and 1 at its end.
fn fourier(values: &[f64], phase: &[f64], n_harmonics: usize) -> Vec<[f64; 2]> {
    let angle = |k: usize, phase: &f64| std::f64::consts::TAU * (k + 1) as f64 * phase;
    let n = 2 * n_harmonics;
    let columns: Vec<Vec<f64>> = (0..n)
        .map(|j| phase.iter().map(|p| if j % 2 == 0 { angle(j / 2, p).cos() } else { angle(j / 2, p).sin() }).collect())
        .collect();
    let half = 0.5 * values.len() as f64;
    let normal = nalgebra::DMatrix::from_fn(n, n, |i, j| {
        // Gaps leave some combinations of harmonics poorly determined. The added diagonal keeps their amplitudes near zero.
        dot(&columns[i], &columns[j]) / half + if i == j { 0.01 } else { 0.0 }
    });
    let slope = nalgebra::DVector::from_fn(n, |i, _| dot(&columns[i], values) / half);
    let amplitudes = normal.cholesky().map_or(slope.clone(), |factor| factor.solve(&slope));
    (0..n_harmonics).map(|k| [amplitudes[2 * k], amplitudes[2 * k + 1]]).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn subtract(values: &mut [f64], column: &[f64], times: f64) {
    values.iter_mut().zip(column).for_each(|(value, column)| *value -= times * column);
}

#[cfg(test)]
#[path = "misfit_tests.rs"]
mod tests;
