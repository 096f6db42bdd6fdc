//! Test for residuals that exceed the noise: one rule, which `sample` and `diagnose` share (docs/diagnosis.md).
//!
//! Slow noise and a misfit look alike in one cycle. Two properties distinguish them.
//!
//! *Size*, if the noise is given. The tracker's noise σ may come with slow noise of the same size. Let V be the mean square residual. Its slow part V − σ² is worth ν
//! independent numbers: ν = n/(1 + 2Σρ²), with autocorrelation ρ over n rows. V is too large if √V > 1.5 σ and ν(V − σ²)/σ² lies beyond the 99.9 % point of χ² with ν
//! degrees of freedom. For white errors the limit is 1.5 σ itself.
//!
//! *Return*, for given or unknown noise. Noise differs in every cycle; a misfit recurs. Let aₖ꜀ be the k-th Fourier coefficient of cycle c of C cycles with the same
//! command. An offset and a slope are removed from each cycle first, and a multiple of the position if the noise has a gain. The phases of stationary noise are independent
//! between cycles, so with
//!
//!   γₖ = |Σ꜀ aₖ꜀|² / (C Σ꜀ |aₖ꜀|²),   S = −(C − 1) Σₖ ln(1 − γₖ)
//!
//! γₖ is Beta(1, C − 1) and S is Gamma(K, 1) distributed. Beyond the 99.99 % point of S, the residuals recur. That is a misfit if the total residual then exceeds 1.5 times
//! the noise, which is given or estimated from the part that does not recur. The size and the time of the slow noise do not enter. The removed terms make harmonics of very
//! slow noise depend on each other: up to 1.5 of a thousand records of pure noise lie beyond that point.
//!
//! *Size in the held-out cycles*, for given or unknown noise. Noise is as large there as in the fitted cycles. The mean squares V of ν independent numbers in both are
//! compared. V_held-out / V_fitted above 1.5² and beyond the 99.9 % point of F(ν, ν) is a misfit that the fitted cycles do not show. V_fitted is corrected for the fitted
//! parameters and is at least the square of the noise.
//!
//! *Gain and offset.* If the noise has them, they are removed from every recording ([`super::recordings`]) before its size is judged. Held-out cycles lose theirs only if
//! the model declares them, or if fitted recordings show them. For this, F compares the mean squares of two or more fitted recordings and of the held-out ones, two numbers
//! each. A held-out cycle in a recording with fitted rows has the gain and the offset of those rows.
//!
//! γₖ is the squared inter-trial coherence of evoked responses (Jervis et al., *IEEE Trans. Biomed. Eng.* 30, 43, 1983, doi:10.1109/TBME.1983.325165).

use std::ops::Range;

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor, Gamma};

use record::Record;

use super::recordings::recordings;

/// Multiple of the known noise above which residuals or learnt noise are not noise (formats §4).
pub const NOISE_FACTOR: f64 = 1.5;
/// Share of records of pure noise whose residuals are called too large.
pub const FALSE_ALARM: f64 = 0.001;
/// Joint probability of the held-out cycles below which they lie outside the 99.9 % band.
pub const OUTSIDE_BAND: f64 = 0.001;
/// p below which residuals recur. For noise of any time, one of a thousand records falls below it, because harmonics depend on each other.
const RETURN_P: f64 = 1e-4;
/// Share of a record's independent numbers that counts when its cycles are compared, because autocorrelations from few numbers are too small. For slow noise with a time
/// of ten seconds (one cycle of four), the conditions together then find a misfit in five of a thousand records.
const SHARE_OF_NUMBERS: f64 = 0.5;
/// Largest number of harmonics of the cycle, and rows that each harmonic needs.
const MOST_HARMONICS: usize = 8;
const ROWS_PER_HARMONIC: usize = 6;
/// Largest force difference between two cycles with the same command, as a share of the range, and largest share of rows that may exceed it.
const SAME_FORCE: f64 = 0.05;
const OTHER_ROWS: f64 = 0.03;
/// Largest relative difference of the durations of two equal cycles.
const SAME_DURATION: f64 = 0.05;
/// Remaining share of a column below which it counts as a combination of the columns before it.
const LEAST_NEW: f64 = 1e-6;

/// Residuals of a model in a record.
pub struct Residuals<'a> {
    /// Times, cycles and forces.
    pub record: &'a Record,
    /// Residual (m) in the fitted cycles; one entry per row.
    pub fitted_m: &'a [Option<f64>],
    /// Residual (m) in the held-out cycles; one entry per row.
    pub heldout_m: &'a [Option<f64>],
    /// The model's position (m) at every row.
    pub position_m: &'a [f64],
    /// Columns (m) along which the parameters can move the model's position. A residual that recurs along them is no misfit.
    pub absorbed_m: &'a [Vec<f64>],
    /// Knowledge about a gain and an offset of each recording.
    pub gains: GainKnowledge,
}

/// Knowledge about a gain and an offset of each recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GainKnowledge {
    /// The noise has none.
    None,
    /// The model declares them.
    Declared,
    /// They are learnt with every model, and fitted recordings must show them.
    Learnt,
}

/// Root mean square residual, compared with the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidualSize {
    /// Root mean square residual in m. If the noise has a gain and an offset for each cycle, they are removed.
    pub rms_m: f64,
    /// True if it exceeds the limit of the noise.
    pub is_too_large: bool,
}

/// Residuals, compared with the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// Residual of the fitted cycles.
    pub fitted: ResidualSize,
    /// Residual of the held-out cycles; `None` without held-out cycles.
    pub heldout: Option<ResidualSize>,
    /// Noise (m) that the residuals are compared with.
    pub noise_m: f64,
    /// True if the noise was given with the experiment.
    pub is_known: bool,
    /// Part of the residuals (m) that recurs in every cycle, if it exceeds chance.
    pub returning_m: Option<f64>,
    /// Number of independent slow values that the fitted rows are worth, for the test of a learnt noise; 0 if its size is not tested.
    pub learnt_degrees: f64,
}

impl Misfit {
    /// Compares residuals with a known noise (m), or with a noise estimated from rests or short lags, in which slow noise does not show. `None` if no position is fitted.
    pub fn of(remainder: &Residuals, noise_m: f64, is_known: bool) -> Option<Self> {
        Self::beside(remainder, noise_m, is_known, true)
    }

    /// Compares residuals with the noise. If the noise is not `is_measured`, its size alone sets no limit.
    fn beside(remainder: &Residuals, noise_m: f64, is_known: bool, is_measured: bool) -> Option<Self> {
        let returning = RecurringPart::of(remainder);
        let has_gain = remainder.gains != GainKnowledge::None;
        let fitted = Series::of(remainder, remainder.fitted_m, has_gain)?;
        let heldout = Series::of(remainder, remainder.heldout_m, has_gain && remainder.shows_gains());
        // The parameters' columns spread a misfit of the held-out cycles over all cycles. A recurring misfit must also be in the fitted ones.
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
                    || has_bound && is_beyond_slow_noise(series.mean_square_m2, noise_m, series.degrees(noise_m))),
        };
        let beyond_fitted = |series: &Series| series.is_beyond(&fitted, remainder.absorbed_m.len(), noise_m);
        Some(Self {
            fitted: judged(&fitted, false),
            heldout: heldout.as_ref().map(|series| judged(series, beyond_fitted(series))),
            noise_m,
            is_known,
            returning_m: returning
                .filter(|_| comes_again)
                .map(|recurring_part| recurring_part.returning_m2.max(0.0).sqrt()),
            learnt_degrees: if has_bound { fitted.degrees(noise_m) } else { 0.0 },
        })
    }

    /// Compares the held-out residuals with the fitted ones, for unknown noise; `None` if no position is fitted.
    pub fn relative_to_fitted(remainder: &Residuals) -> Option<Self> {
        let fitted = Series::of(remainder, remainder.fitted_m, remainder.gains != GainKnowledge::None)?;
        Self::beside(remainder, fitted.corrected_m2(remainder.absorbed_m.len()).sqrt(), false, false)
    }

    /// Returns true if the residuals exceed the limit of the noise.
    pub fn is_too_large(&self) -> bool {
        self.fitted.is_too_large || self.heldout.is_some_and(|heldout| heldout.is_too_large)
    }

    /// Returns true if a learnt noise (m) contains more than noise.
    pub fn is_learnt_too_large(&self, learnt_m: f64) -> bool {
        let is_beyond = || is_beyond_slow_noise(learnt_m * learnt_m, self.noise_m, self.learnt_degrees);
        learnt_m > NOISE_FACTOR * self.noise_m
            && (self.returning_m.is_some() || self.learnt_degrees > 0.0 && is_beyond())
    }

    /// Largest excessive residual, in m; 0 if none is excessive.
    pub fn largest_m(&self) -> f64 {
        let sizes = [Some(self.fitted), self.heldout];
        sizes.iter().flatten().filter(|size| size.is_too_large).map(|size| size.rms_m).fold(0.0, f64::max)
    }
}

/// Directions (m) in which posterior draws spread most around their mean. There are as many as model parameters, or fewer if the draws have fewer.
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

/// Returns true if slow noise of the known noise's size, added to it, gives so large a mean square at most once in a thousand times.
fn is_beyond_slow_noise(mean_square_m2: f64, noise_m: f64, degrees: f64) -> bool {
    let slow = mean_square_m2 / (noise_m * noise_m) - 1.0;
    slow > 0.0 && ChiSquared::new(degrees.max(1.0)).is_ok_and(|chi| chi.sf(degrees.max(1.0) * slow) < FALSE_ALARM)
}

/// Residuals of some rows of a recording, in order of time.
struct Recording {
    left_m: Vec<f64>,
    /// Residuals without a gain and an offset. They are unchanged if fitted rows of the same recording determine gain and offset.
    without_gain_m: Vec<f64>,
    /// True if a gain and an offset were removed.
    has_own_gain: bool,
}

impl Recording {
    /// Mean square (m²) of the removed gain and offset.
    fn taken_m2(&self) -> f64 {
        let taken = self.left_m.iter().zip(&self.without_gain_m).map(|(all, left)| (all - left).powi(2));
        taken.sum::<f64>() / self.left_m.len().max(1) as f64
    }
}

impl Residuals<'_> {
    /// Recordings that contain some of the rows.
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
                take_out(&mut without_gain_m, vec![vec![1.0; there.len()], position_m]);
            }
            (!there.is_empty()).then_some(Recording { left_m, without_gain_m, has_own_gain })
        };
        numbers.chunk_by(|a, b| a == b).scan(0, next_range).filter_map(of_rows).collect()
    }

    /// Returns true if held-out recordings may have a separate gain and offset: if the model declares them, or if they are as large as in fitted recordings.
    fn shows_gains(&self) -> bool {
        if self.gains != GainKnowledge::Learnt {
            return self.gains == GainKnowledge::Declared;
        }
        let taken_m2 = |rows: &[Option<f64>]| -> Vec<f64> {
            self.recordings(rows).iter().filter(|recording| recording.has_own_gain).map(Recording::taken_m2).collect()
        };
        let (fitted, heldout) = (taken_m2(self.fitted_m), taken_m2(self.heldout_m));
        if heldout.is_empty() || fitted.len() < 2 {
            return false;
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        // The law absorbs the common part of all gains and offsets.
        let (of_heldout, of_fitted) = (2.0 * heldout.len() as f64, 2.0 * (fitted.len() - 1) as f64);
        let ratio = mean(&heldout) / (mean(&fitted) * fitted.len() as f64 / (fitted.len() - 1) as f64);
        FisherSnedecor::new(of_heldout, of_fitted).is_ok_and(|f| !ratio.is_finite() || f.sf(ratio) >= FALSE_ALARM)
    }
}

/// Residuals of some cycles, in order of time.
struct Series {
    left_m: Vec<f64>,
    mean_square_m2: f64,
}

impl Series {
    /// Collects residuals. `gives_up_gains` removes a gain and an offset from each recording.
    fn of(remainder: &Residuals, rows: &[Option<f64>], gives_up_gains: bool) -> Option<Self> {
        let of = |recording: Recording| if gives_up_gains { recording.without_gain_m } else { recording.left_m };
        let left_m: Vec<f64> = remainder.recordings(rows).into_iter().flat_map(of).collect();
        let n = left_m.len();
        let mean_square_m2 = left_m.iter().map(|left| left * left).sum::<f64>() / n.max(1) as f64;
        (n > 0).then_some(Self { left_m, mean_square_m2 })
    }

    /// Mean square (m²), corrected for the fitted parameters.
    fn corrected_m2(&self, n_parameters: usize) -> f64 {
        let n = self.left_m.len();
        self.mean_square_m2 * n as f64 / n.saturating_sub(n_parameters).max(1) as f64
    }

    /// Returns true if noise as large as in the fitted cycles gives so large a mean square at most once in a thousand times.
    fn is_beyond(&self, fitted: &Self, n_parameters: usize, noise_m: f64) -> bool {
        let expected_m2 = fitted.corrected_m2(n_parameters).max(noise_m * noise_m);
        let ratio = self.mean_square_m2 / expected_m2;
        let of_fitted = (fitted.degrees_of_square() - n_parameters as f64).max(1.0);
        ratio > NOISE_FACTOR * NOISE_FACTOR
            && FisherSnedecor::new(self.degrees_of_square().max(1.0), of_fitted)
                .is_ok_and(|f| f.sf(ratio) < FALSE_ALARM)
    }

    /// Degrees of freedom of the mean square: the number of independent values, reduced if a few outliers dominate. The mean square of n values with kurtosis κ scatters as
    /// much as that of 2n/(κ − 1) normal values.
    fn degrees_of_square(&self) -> f64 {
        let n = self.left_m.len().max(1) as f64;
        let fourth_m4 = self.left_m.iter().map(|left| left.powi(4)).sum::<f64>() / n;
        let kurtosis = fourth_m4 / self.mean_square_m2.powi(2);
        let share = if kurtosis.is_finite() { (2.0 / (kurtosis - 1.0).max(f64::MIN_POSITIVE)).min(1.0) } else { 1.0 };
        SHARE_OF_NUMBERS * share * self.degrees(0.0)
    }

    /// Number of independent values that the slow part is worth: n/(1 + 2Σρ²), over lags up to the first whose correlation is within its scatter. A far lag represents its
    /// neighbours.
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

/// Part of the residuals that recurs in every cycle of the same command.
struct RecurringPart {
    /// Share of experiments in which pure noise recurs as well.
    p: f64,
    /// Mean squares of the recurring part and of the other part, in m².
    returning_m2: f64,
    noise_m2: f64,
}

impl RecurringPart {
    /// Estimates the recurring part; `None` if no two cycles of the same command have enough rows.
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
            take_out(&mut of_cycle, nuisance);
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
            // This is the mean over pairs of different cycles of half the squared amplitude.
            returning_m2 += 0.5 * (of_sum - each) / (n_cycles * (n_cycles - 1.0));
        }
        let p = Gamma::new(n_harmonics as f64, 1.0).ok()?.sf(statistic);
        let noise_m2 = (squares_m2 / n_rows.max(1) as f64 - returning_m2.max(0.0)).max(0.0);
        Some(Self { p, returning_m2, noise_m2 })
    }
}

/// Rows of each cycle of a record, in order.
fn cycles_of(record: &Record) -> impl Iterator<Item = Range<usize>> {
    record.cycle.chunk_by(|a, b| a == b).scan(0, next_range)
}

/// Range of the next chunk.
#[expect(clippy::unnecessary_wraps, reason = "`scan` expects an `Option`")]
fn next_range(start: &mut usize, chunk: &[u32]) -> Option<Range<usize>> {
    let range = *start..*start + chunk.len();
    *start = range.end;
    Some(range)
}

/// Rows of a cycle with a position, and their phase: the elapsed share of the cycle.
struct Cycle {
    rows: Vec<usize>,
    phase: Vec<f64>,
}

/// Largest set of cycles with the same command.
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

/// Removes columns from values by least squares.
fn take_out(values: &mut [f64], columns: Vec<Vec<f64>>) {
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(columns.len());
    for mut column in columns {
        let whole = dot(&column, &column);
        // Two passes give orthogonality to rounding.
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

/// Removes the part of the residuals that the model's parameters can absorb, over all rows with a position.
fn absorb(left_m: &mut [Option<f64>], columns_m: &[Vec<f64>]) {
    let rows: Vec<usize> = (0..left_m.len()).filter(|row| left_m[*row].is_some()).collect();
    let mut values: Vec<f64> = left_m.iter().flatten().copied().collect();
    take_out(&mut values, columns_m.iter().map(|column| rows.iter().map(|row| column[*row]).collect()).collect());
    rows.iter().zip(values).for_each(|(row, value)| left_m[*row] = Some(value));
}

/// Cosine and sine amplitudes of each harmonic, by joint least squares.
fn fourier(values: &[f64], phase: &[f64], n_harmonics: usize) -> Vec<[f64; 2]> {
    let angle = |k: usize, phase: &f64| std::f64::consts::TAU * (k + 1) as f64 * phase;
    let n = 2 * n_harmonics;
    let columns: Vec<Vec<f64>> = (0..n)
        .map(|j| phase.iter().map(|p| if j % 2 == 0 { angle(j / 2, p).cos() } else { angle(j / 2, p).sin() }).collect())
        .collect();
    let half = 0.5 * values.len() as f64;
    let normal = nalgebra::DMatrix::from_fn(n, n, |i, j| {
        // Gaps leave some combinations poorly determined; the added diagonal keeps them near zero.
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
