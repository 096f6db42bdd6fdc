//! Noise estimated from the record itself: from rests, neighbouring positions and successive cycles.

use super::{CycleSpread, NoiseEstimateSd};
use crate::matched_cycles::{FEWEST_MATCHED_ROWS, MatchTolerance, Phase, about_line, phases_of_cycles};
use record::Record;
use record::noise::{
    MIN_DIFFERENCES, MIN_PER_WINDOW, MIN_REST_POSITIONS, NO_FORCE_FRACTION, RECOVERY_FRACTION, SD_PER_MAD, holds,
    late_rows, second_differences,
};

/// Relative standard error, times √n, of a standard deviation from the median absolute deviation of n second differences of neighbouring positions. It is 1.167 for
/// independent differences (Rousseeuw & Croux, *JASA* 88, 1273, 1993), times √(1 + 2(⅔² + ⅙²)), since neighbouring differences overlap.
const MAD_ERROR: f64 = 1.63;

/// Noise from the scatter about straight lines while no force acts: before the first force, and late in rests; `None` if there are too few positions.
pub(super) fn at_rest(record: &Record) -> Option<NoiseEstimateSd> {
    let no_force_n = NO_FORCE_FRACTION * record.force_range_n();
    let (mut series, mut n_positions, mut n_windows, mut is_loaded) = (Vec::new(), 0, 0, false);
    for hold in holds(record) {
        if record.force_n[hold.clone()].iter().any(|force_n| force_n.abs() > no_force_n) {
            is_loaded = true;
            continue;
        }
        let rows = late_rows(record, &hold, if is_loaded { RECOVERY_FRACTION } else { 0.0 });
        if rows.len() < MIN_PER_WINDOW {
            continue;
        }
        let time_s: Vec<f64> = rows.iter().map(|row| record.time_s[*row]).collect();
        let position_m: Vec<f64> = rows.iter().filter_map(|row| record.position_m[*row]).collect();
        n_positions += rows.len();
        n_windows += 1;
        series.push(about_line(&time_s, &position_m).1);
    }
    (n_positions >= MIN_REST_POSITIONS).then(|| spread_of(&series, n_positions - 2 * n_windows)).flatten()
}

/// Noise from neighbouring positions: the scatter of their second differences late in holds. `None` if there are too few differences.
pub(super) fn of_neighbours(record: &Record) -> Option<NoiseEstimateSd> {
    let mut sizes: Vec<f64> = second_differences(record).iter().map(|difference| difference.abs()).collect();
    if sizes.len() < MIN_DIFFERENCES {
        return None;
    }
    sizes.sort_by(f64::total_cmp);
    let sd_m = SD_PER_MAD * 0.5 * (sizes[(sizes.len() - 1) / 2] + sizes[sizes.len() / 2]);
    (sd_m > 0.0).then(|| NoiseEstimateSd { sd_m, standard_error_m: sd_m * MAD_ERROR / (sizes.len() as f64).sqrt() })
}

/// Noise from successive cycles: the scatter of the differences between a fit's residuals at equal times in both cycles. `fitted_m` are the fit's positions (m). A row counts
/// only if its last force step was equal in both cycles, because the true motions differ after different steps. The record's first step, which starts without force, often
/// differs from all later ones.
pub(super) fn of_cycles(record: &Record, fitted_m: &[f64]) -> Option<CycleSpread> {
    let same = MatchTolerance::of(record)?;
    let cycles = phases_of_cycles(record);
    let pairs = cycles.windows(2).filter_map(|pair| Pair::new(record, fitted_m, [&pair[0], &pair[1]], &same));
    let pairs: Vec<Pair> = pairs.collect();
    let n_pairs = pairs.len();
    if n_pairs == 0 {
        return None;
    }
    let n: usize = pairs.iter().map(|pair| pair.difference_m.len()).sum();
    let within: Vec<Vec<f64>> = pairs.iter().map(|pair| pair.left_m.clone()).collect();
    let within = spread_of(&within, n - 2 * n_pairs)?;
    let squares: f64 = pairs.iter().flat_map(|pair| &pair.difference_m).map(|d| d * d).sum();
    let whole_m2 = squares / n as f64;
    // The difference of two positions has √2 times the standard deviation of one. Each pair of cycles has one gain and one offset.
    let between_m2 = (whole_m2 - within.sd_m.powi(2)).max(0.0);
    let error_m4 = (2.0 * within.sd_m * within.standard_error_m).powi(2) + 2.0 * between_m2.powi(2) / n_pairs as f64;
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let whole_m = whole_m2.sqrt();
    let whole = NoiseEstimateSd { sd_m: half * whole_m, standard_error_m: half * error_m4.sqrt() / (2.0 * whole_m) };
    let within_one = NoiseEstimateSd { sd_m: half * within.sd_m, standard_error_m: half * within.standard_error_m };
    let stretch = slowness(&pairs.iter().map(|pair| pair.left_m.clone()).collect::<Vec<_>>()).1;
    let mean = |of: &dyn Fn(&Pair) -> f64| pairs.iter().map(of).sum::<f64>() / n_pairs as f64;
    let by_chance = stretch * mean(&|pair| within.sd_m.powi(2) / pair.gain_weight_m2);
    let gain_squared = mean(&|pair| pair.gain_change.powi(2));
    let gain_sd = (0.5 * (gain_squared - by_chance)).max(0.0).sqrt();
    // The sum of n squares of equal variance has the relative error √(2/n).
    let gain_standard_error =
        if gain_sd > 0.0 { 0.5 * gain_squared * (2.0 / n_pairs as f64).sqrt() / (2.0 * gain_sd) } else { 0.0 };
    let gain_score = gain_squared / by_chance;
    let shift_by_chance = stretch * mean(&|pair| within.sd_m.powi(2) / pair.difference_m.len() as f64);
    let offset_score = mean(&|pair| pair.shift_m.powi(2)) / shift_by_chance;
    Some(CycleSpread { whole, within: within_one, gain_sd, gain_standard_error, gain_score, offset_score, n_pairs })
}

/// Comparison of a cycle with the next one.
struct Pair {
    difference_m: Vec<f64>,
    /// Differences after removal of a change of gain and of offset.
    left_m: Vec<f64>,
    gain_change: f64,
    /// Mean of the differences: the shift between the cycles.
    shift_m: f64,
    /// Sum of squares of the positions about their mean, which weights the change of gain.
    gain_weight_m2: f64,
}

impl Pair {
    fn new(record: &Record, fitted_m: &[f64], [phases, next]: [&[Phase]; 2], same: &MatchTolerance) -> Option<Self> {
        let (mut difference_m, mut position_m) = (Vec::new(), Vec::new());
        for row in phases {
            if let (Some(other), Some(one_m)) = (same.find(next, row), record.position_m[row.row])
                && let Some(other_m) = record.position_m[other.row]
            {
                difference_m.push((other_m - fitted_m[other.row]) - (one_m - fitted_m[row.row]));
                position_m.push(0.5 * (fitted_m[row.row] + fitted_m[other.row]));
            }
        }
        if difference_m.len() < FEWEST_MATCHED_ROWS {
            return None;
        }
        let shift_m = difference_m.iter().sum::<f64>() / difference_m.len() as f64;
        let ((gain_change, gain_weight_m2), left_m) = about_line(&position_m, &difference_m);
        Some(Self { difference_m, left_m, gain_change, shift_m, gain_weight_m2 })
    }
}

/// Standard deviation of `series` about 0, with `degrees` degrees of freedom. Its standard error accounts for the correlation of the series.
fn spread_of(series: &[Vec<f64>], degrees: usize) -> Option<NoiseEstimateSd> {
    let squares: f64 = series.iter().flatten().map(|value| value * value).sum();
    if degrees == 0 || squares <= 0.0 {
        return None;
    }
    let sd_m = (squares / degrees as f64).sqrt();
    Some(NoiseEstimateSd { sd_m, standard_error_m: sd_m * (slowness(series).0 / (2.0 * degrees as f64)).sqrt() })
}

/// Factors by which correlation increases the variance of a mean square (1 + 2 Σ ρ²) and of a mean (1 + 2 Σ ρ). The sums over lags end at the first lag whose correlation
/// ρ is within its own scatter.
fn slowness(series: &[Vec<f64>]) -> (f64, f64) {
    let longest = series.iter().map(Vec::len).max().unwrap_or(0) / 3;
    let n: usize = series.iter().map(Vec::len).sum();
    let product = |lag: usize| -> f64 {
        series.iter().flat_map(|one| one.iter().zip(one.iter().skip(lag))).map(|(a, b)| a * b).sum()
    };
    let squares = product(0).max(f64::MIN_POSITIVE);
    let (mut of_square, mut of_mean) = (1.0, 1.0);
    for lag in 1..=longest {
        let correlation = product(lag) / squares;
        if correlation < 1.0 / (n as f64).sqrt() {
            break;
        }
        of_square += 2.0 * correlation * correlation;
        of_mean += 2.0 * correlation;
    }
    (of_square, of_mean)
}
