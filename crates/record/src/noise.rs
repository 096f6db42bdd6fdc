//! Noise standard deviation that residuals are compared with: known for the tracker, or estimated from rests or short lags (formats §4).

use super::Experiment;
use super::line::MotionLine;
use super::record::Record;
use super::robust::median;

/// Noise that residuals are compared with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceNoise {
    /// Standard deviation of one position, in m.
    pub sd_m: f64,
    /// Source of the value.
    pub origin: NoiseOrigin,
}

/// Source of a [`ReferenceNoise`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseOrigin {
    /// Given as `measurement.noise_um`.
    Known,
    /// Standard deviation of positions at rest: before the first force, and about a straight line late in long rests.
    ///
    /// This estimate is preferred because it includes slow noise up to the length of a window. Recovery that is still curved increases it.
    Rest {
        /// Number of positions used.
        n_positions: usize,
        /// Number of windows that contain them.
        n_windows: usize,
        /// Short-lag estimate for comparison, in m. A much smaller value means that the noise is correlated in time.
        short_lag_sd_m: Option<f64>,
    },
    /// Scaled median absolute deviation of positions from a polynomial through their neighbours. The polynomial is a line, late in each hold, unless a higher
    /// order leaves clearly smaller deviations.
    ///
    /// The estimate assumes independent Gaussian errors. Noise with correlations r₁, r₂ at one and two samples is multiplied by √(1 − 4r₁/3 + r₂/3), so smooth
    /// noise is underestimated. Curvature of the true motion increases the estimate.
    ShortLag {
        /// Number of deviations used.
        n_differences: usize,
    },
}

pub use super::robust::SD_PER_MAD;
/// Fraction of each hold after which the motion is assumed to be smooth.
const EARLY_FRACTION: f64 = 0.5;
/// Fraction of a rest after which the bead is assumed to be at rest.
pub const RECOVERY_FRACTION: f64 = 0.75;
/// Neighbours farther apart than this multiple of the median interval are separated by a gap.
const GAP_INTERVALS: f64 = 2.5;
/// Number of neighbours that define the line from which a position deviates.
const LINE: usize = 2;
/// Largest number of neighbours that define a polynomial from which a position deviates.
const MOST_ORDER: usize = 5;
/// Deviations count as noise only if more than this fraction of neighbouring ones have opposite signs.
const TURNS: f64 = 0.5;
/// Deviations count as noise only if their standard deviation exceeds this fraction of the positions' range.
const NOISELESS: f64 = 1e-7;
/// Largest ratio of the longest to the shortest interval within one window of rows.
const UNEVEN: f64 = 4.0;
/// Standard error, times √n, of a scaled median absolute deviation of n correlated deviations. An order is rejected if it exceeds the next by `ORDER_ERRORS` of
/// these errors.
const MAD_ERROR: f64 = 1.65;
const ORDER_ERRORS: f64 = 3.0;
/// Limits for the step between written positions: smallest number of unequal neighbours, largest divisor of their smallest gap, and tolerance as a fraction of
/// the step. For positions without a step, 8 gaps pass one of 1,000 trials with probability 1000 (2·10⁻³)⁷.
const FEWEST_GAPS: usize = 8;
const WIDEST_GAP: u32 = 1_000;
const DIVISIBLE: f64 = 1e-3;
/// Standard deviations beyond which a position at rest is an outlier; probability 2·10⁻⁹ for normal errors.
const FAR_SDS: f64 = 6.0;
/// Number of passes that leave outliers out.
const PASSES: usize = 6;
/// Limits beyond which a position is an outlier: in standard deviations, and in distances between the neighbouring rows.
const OUTLIER_SDS: f64 = 20.0;
const OUTLIER_FLOWS: f64 = 3.0;
/// Number of rows before and after an outlier in which the force must be steady, and its largest change as a fraction of its range.
const AROUND: usize = 3;
const STEADY: f64 = 0.05;
pub const MIN_DIFFERENCES: usize = 8;
pub const MIN_PER_WINDOW: usize = 8;
pub const MIN_REST_POSITIONS: usize = 20;
/// Forces below this fraction of the range count as zero.
pub const NO_FORCE_FRACTION: f64 = 0.01;

impl Experiment {
    /// Returns the noise that residuals are compared with: `noise_um` if it is given, else the estimate from rests, else the estimate from short lags. `None`
    /// if the record has too few positions.
    pub fn reference_noise(&self) -> Option<ReferenceNoise> {
        match self.noise_sd_m {
            Some(sd_m) => Some(ReferenceNoise { sd_m, origin: NoiseOrigin::Known }),
            None => estimate(&self.record),
        }
    }
}

impl std::fmt::Display for ReferenceNoise {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sd_um = self.sd_m * 1e6;
        match self.origin {
            NoiseOrigin::Known => write!(f, "noise {sd_um:.4} µm, given in the experiment"),
            NoiseOrigin::Rest { n_positions, n_windows, .. } => {
                write!(f, "noise {sd_um:.4} µm, estimated from {n_positions} positions in {n_windows} rests")
            }
            NoiseOrigin::ShortLag { n_differences } => {
                write!(f, "noise {sd_um:.4} µm, estimated from {n_differences} differences of neighbouring positions")
            }
        }
    }
}

fn estimate(record: &Record) -> Option<ReferenceNoise> {
    // Rounded positions of a smooth motion may lie on lines to the last digit. They still have rounding errors.
    let rounding_sd_m = written_step_m(record).map_or(0.0, |step_m| step_m / 12_f64.sqrt());
    let short_lag = short_lag(record).map(|(sd_m, n_differences)| (sd_m.max(rounding_sd_m), n_differences));
    let rest = rest_residuals(record);
    if rest.n_positions >= MIN_REST_POSITIONS && rest.sum_of_squares > 0.0 {
        let sd_m = (rest.sum_of_squares / rest.degrees_of_freedom as f64).sqrt().max(rounding_sd_m);
        let short_lag_sd_m = short_lag.map(|(sd_m, _)| sd_m);
        let origin = NoiseOrigin::Rest { n_positions: rest.n_positions, n_windows: rest.n_windows, short_lag_sd_m };
        return Some(ReferenceNoise { sd_m, origin });
    }
    let (sd_m, n_differences) = short_lag?;
    Some(ReferenceNoise { sd_m, origin: NoiseOrigin::ShortLag { n_differences } })
}

/// Noise (m) from neighbouring positions and the number of deviations used: late in each hold, or in all rows if these are too few.
fn short_lag(record: &Record) -> Option<(f64, usize)> {
    let ends = record.position_m.iter().flatten();
    let [low_m, high_m] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(*x), high.max(*x)]);
    [EARLY_FRACTION, 0.0].into_iter().find_map(|fraction| {
        let found = |order: usize| {
            let deviations = match order {
                LINE if fraction == EARLY_FRACTION => second_differences(record),
                _ => local_deviations(record, order, fraction),
            };
            let sd_m = SD_PER_MAD * median(deviations.iter().map(|deviation| deviation.abs()).collect())?;
            let n_turns = deviations.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
            // Deviations of independent errors change sign in more than 7 of 10 pairs; those of a smooth motion do so rarely.
            let is_noise = n_turns as f64 > TURNS * deviations.len() as f64 && sd_m > NOISELESS * (high_m - low_m);
            (deviations.len() >= MIN_DIFFERENCES && sd_m > 0.0).then_some((sd_m, deviations.len(), is_noise))
        };
        let line = found(LINE)?;
        let mut best = line;
        for order in LINE + 1..=MOST_ORDER {
            let Some(next) = found(order) else { break };
            // The next order removes the curvature that contributes to this one.
            if best.0 <= next.0 * (1.0 + ORDER_ERRORS * MAD_ERROR / (next.1 as f64).sqrt()) {
                break;
            }
            best = next;
        }
        // A motion that is smooth to the last digit has no detectable noise.
        let (sd_m, n_deviations, _) = if best.2 { best } else { line };
        Some((sd_m, n_deviations))
    })
}

/// Step (m) between written positions: the largest number that divides all differences; `None` without such a step.
fn written_step_m(record: &Record) -> Option<f64> {
    let mut sorted: Vec<f64> = record.position_m.iter().flatten().copied().collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let (first, last) = (*sorted.first()?, *sorted.last()?);
    // Equal positions differ by rounding if another zero was subtracted.
    let rounding = 4.0 * f64::EPSILON * first.abs().max(last.abs()).max(last - first);
    let gaps: Vec<f64> = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > rounding).collect();
    let smallest = gaps.iter().copied().reduce(f64::min)?;
    if gaps.len() < FEWEST_GAPS {
        return None;
    }
    let is_step = |step: f64| {
        gaps.iter().all(|gap| {
            let steps = gap / step;
            (steps - steps.round()).abs() < DIVISIBLE
        })
    };
    // The smallest gap may be several steps wide.
    let steps = (1..=WIDEST_GAP).map(|parts| smallest / f64::from(parts));
    // For smaller steps, rounding would make every number a multiple.
    let step = steps.take_while(|step| rounding < DIVISIBLE * step).find(|step| is_step(*step))?;
    // The mean over the whole range has the smallest rounding error.
    let n_steps: f64 = gaps.iter().map(|gap| (gap / step).round()).sum();
    Some(gaps.iter().sum::<f64>() / n_steps)
}

/// Row ranges between force steps.
pub fn holds(record: &Record) -> Vec<std::ops::Range<usize>> {
    record.force().holds()
}

/// Rows of a hold that have a position and lie later than `fraction` of the hold.
pub fn late_rows(record: &Record, hold: &std::ops::Range<usize>, fraction: f64) -> Vec<usize> {
    let (start_s, end_s) = (record.time_s[hold.start], record.time_s[hold.end - 1]);
    let late = |row: &usize| record.time_s[*row] >= start_s + fraction * (end_s - start_s);
    hold.clone().filter(|row| record.position_m[*row].is_some() && late(row)).collect()
}

fn points(record: &Record, rows: &[usize]) -> Vec<(f64, f64)> {
    rows.iter().filter_map(|row| Some((record.time_s[*row], record.position_m[*row]?))).collect()
}

/// Deviation of each position from the line through its neighbours, late in each hold, scaled to the standard deviation of one position.
pub fn second_differences(record: &Record) -> Vec<f64> {
    let longest_s = GAP_INTERVALS * record.median_interval_s().unwrap_or(0.0);
    let mut differences = Vec::new();
    for hold in holds(record) {
        let points = points(record, &late_rows(record, &hold, EARLY_FRACTION));
        for triple in points.windows(3) {
            let [(t0, x0), (t1, x1), (t2, x2)] = [triple[0], triple[1], triple[2]];
            if t1 - t0 <= longest_s && t2 - t1 <= longest_s {
                let weight = (t1 - t0) / (t2 - t0);
                let deviation = x1 - (1.0 - weight) * x0 - weight * x2;
                differences.push(deviation / (1.0 + (1.0 - weight).powi(2) + weight.powi(2)).sqrt());
            }
        }
    }
    differences
}

/// Deviation of each position from a polynomial through its `order` neighbours, as a divided difference scaled to the standard deviation of one position. The
/// row spacing may vary slowly.
fn local_deviations(record: &Record, order: usize, fraction: f64) -> Vec<f64> {
    let mut deviations = Vec::new();
    for hold in holds(record) {
        let points = points(record, &late_rows(record, &hold, fraction));
        for window in points.windows(order + 1) {
            let intervals_s = || window.windows(2).map(|pair| pair[1].0 - pair[0].0);
            let (shortest_s, longest_s) =
                (intervals_s().fold(f64::INFINITY, f64::min), intervals_s().fold(0.0, f64::max));
            if longest_s > UNEVEN * shortest_s {
                continue;
            }
            let weight = |k: usize| -> f64 {
                let others = window.iter().enumerate().filter(|(j, _)| *j != k);
                others.map(|(_, (other_s, _))| (window[k].0 - other_s) / longest_s).product::<f64>().recip()
            };
            let weights: Vec<f64> = (0..=order).map(weight).collect();
            let length = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
            // Subtracting the first position avoids cancellation: products of large positions would swamp small noise.
            let first_m = window[0].1;
            deviations.push(window.iter().zip(&weights).map(|((_, x), w)| (x - first_m) * w).sum::<f64>() / length);
        }
    }
    deviations
}

/// A position far from its neighbouring rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Row, from 0.
    pub row: usize,
    /// Distance from the line through the neighbouring rows, in m.
    pub distance_m: f64,
}

/// Returns single positions that lie many standard deviations from their neighbouring rows and farther than the motion explains.
pub fn outliers(record: &Record) -> Vec<Outlier> {
    let Some((sd_m, _)) = short_lag(record) else { return Vec::new() };
    let rows: Vec<usize> = (0..record.n_rows()).filter(|row| record.position_m[*row].is_some()).collect();
    let at = |place: usize| (record.time_s[rows[place]], record.position_m[rows[place]].unwrap_or(0.0));
    // Distance from the line through two other rows. At an end of the record the line is extrapolated.
    let distance = |place: usize, a: usize, b: usize| {
        let ((t, x), (ta, xa), (tb, xb)) = (at(place), at(a), at(b));
        let weight = (t - ta) / (tb - ta);
        (x - xa - weight * (xb - xa), (xb - xa).abs(), 1.0 + weight.abs() + (1.0 - weight).abs())
    };
    let n = rows.len();
    let far = |place: usize| {
        let (a, b) = match place {
            _ if n < 5 => return None,
            0 => (1, 2),
            _ if place + 1 == n => (n - 2, n - 3),
            _ => (place - 1, place + 1),
        };
        let (distance_m, flow_m, scale) = distance(place, a, b);
        let is_far = distance_m.abs() > (OUTLIER_SDS * scale * sd_m).max(OUTLIER_FLOWS * flow_m);
        is_far.then_some(Outlier { row: rows[place], distance_m })
    };
    // At a force step the motion turns abruptly.
    let least_n = STEADY * record.force_range_n();
    let is_steady = |outlier: &Outlier| {
        let around = outlier.row.saturating_sub(AROUND)..(outlier.row + AROUND).min(record.n_rows());
        let force_n = &record.force_n[around];
        let ends =
            force_n.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(*x), high.max(*x)]);
        outlier.row >= AROUND && ends[1] - ends[0] <= least_n
    };
    (0..n).filter_map(far).filter(is_steady).collect()
}

#[derive(Default)]
struct RestResiduals {
    sum_of_squares: f64,
    degrees_of_freedom: usize,
    n_positions: usize,
    n_windows: usize,
}

fn rest_residuals(record: &Record) -> RestResiduals {
    let no_force_n = NO_FORCE_FRACTION * record.force_range_n();
    let mut rest = RestResiduals::default();
    let mut loaded = false;
    for hold in holds(record) {
        let force_n = &record.force_n[hold.clone()];
        if force_n.iter().any(|force_n| force_n.abs() > no_force_n) {
            loaded = true;
            continue;
        }
        // Nothing moves before the first force, so the whole rest counts there.
        let points = points(record, &late_rows(record, &hold, if loaded { RECOVERY_FRACTION } else { 0.0 }));
        if points.len() >= MIN_PER_WINDOW {
            let (squares, n_kept) = squares_about_line(&points);
            rest.sum_of_squares += squares;
            rest.degrees_of_freedom += n_kept - 2;
            rest.n_positions += n_kept;
            rest.n_windows += 1;
        }
    }
    rest
}

/// Sum of squared residuals about the least-squares line, and the number of points. Outliers do not count.
fn squares_about_line(points: &[(f64, f64)]) -> (f64, usize) {
    let mut kept = points.to_vec();
    for _ in 0..PASSES {
        let line = MotionLine::through(kept.iter().copied());
        let sd = SD_PER_MAD * median(kept.iter().map(|point| line.excess(*point).abs()).collect()).unwrap_or(0.0);
        let near: Vec<(f64, f64)> =
            kept.iter().copied().filter(|point| line.excess(*point).abs() <= FAR_SDS * sd).collect();
        if near.len() == kept.len() || 2 * near.len() < points.len() || near.len() < 3 {
            break;
        }
        kept = near;
    }
    let line = MotionLine::through(kept.iter().copied());
    (kept.iter().map(|point| line.excess(*point).powi(2)).sum(), kept.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    const NOISE_M: f64 = 4e-6;

    /// Response to a constant force with the porcine time scales (physics §2), amplitude 0.7 mm, flow rate 0.05 mm/s.
    fn creep_m(t_s: f64) -> f64 {
        if t_s <= 0.0 { 0.0 } else { 0.7e-3 * (1.0 - (-t_s / 0.4).exp()) + 0.05e-3 * t_s }
    }

    /// Holds of (duration, force), sampled at 20 Hz with jitter and lost positions: superposed creep plus white noise.
    fn noisy(holds: &[(f64, f64)], seed: u64) -> Record {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let noise = Normal::new(0.0, NOISE_M).unwrap();
        let mut record = Record::default();
        let mut steps: Vec<(f64, f64)> = vec![];
        let (mut start_s, mut before) = (0.0, 0.0);
        for &(duration_s, force) in holds {
            steps.push((start_s, force - before));
            for i in 0..(duration_s * 20.0) as usize {
                let jitter_s = if i == 0 { 0.0 } else { 0.01 * ((i * 7919) % 11) as f64 / 11.0 };
                let t_s = start_s + i as f64 * 0.05 + jitter_s;
                let x_m: f64 = steps.iter().map(|(at_s, rise)| rise * creep_m(t_s - at_s)).sum();
                record.time_s.push(t_s);
                record.force_n.push(force);
                record.position_m.push((i % 17 != 3).then(|| x_m + noise.sample(&mut rng)));
                record.cycle.push(1);
            }
            (start_s, before) = (start_s + duration_s, force);
        }
        record
    }

    /// Four cycles give 400 late differences. Their MAD has a standard error near 6 % (correlated triples), and the creep's curvature adds a few per cent. ±30
    /// % is five standard errors, so false failures are below 1e-6.
    #[test]
    fn short_lags_find_the_noise_under_creep() {
        let found = estimate(&noisy(&[(5.0, 1.0), (5.0, -1.0)].repeat(4), 11)).unwrap();
        assert!(matches!(found.origin, NoiseOrigin::ShortLag { n_differences } if n_differences > 250), "{found:?}");
        assert!((found.sd_m / NOISE_M - 1.0).abs() < 0.3, "{found}");
    }

    /// About 190 positions before the force have a standard error of 5 %, so ±26 % fails falsely below 1e-6.
    #[test]
    fn a_rest_before_the_first_force_finds_the_noise() {
        let found = estimate(&noisy(&[(10.0, 0.0), (5.0, 1.0), (5.0, -1.0)], 12)).unwrap();
        assert!(matches!(found.origin, NoiseOrigin::Rest { n_windows: 1, .. }), "{found:?}");
        assert!((found.sd_m / NOISE_M - 1.0).abs() < 0.26, "{found}");
    }

    /// The last quarters of three rests of 20 s have 280 positions and a standard error of 4.3 %.
    #[test]
    fn late_rests_find_the_noise_after_recovery() {
        let found = estimate(&noisy(&[(5.0, 1.0), (20.0, 0.0)].repeat(3), 13)).unwrap();
        assert!(matches!(found.origin, NoiseOrigin::Rest { n_windows: 3, .. }), "{found:?}");
        assert!((found.sd_m / NOISE_M - 1.0).abs() < 0.25, "{found}");
    }

    /// Positions of a motion without noise are rounded to 0.1 µm, from a zero that is no multiple: the noise is the rounding error. Positions with more digits
    /// than the noise, or with all digits, give an unchanged estimate.
    #[test]
    fn rounding_is_noise() {
        let smooth = |written: &dyn Fn(f64) -> f64| {
            let mut record = noisy(&[(5.0, 1.0), (5.0, -1.0)].repeat(2), 15);
            for (t_s, position) in record.time_s.iter().zip(&mut record.position_m) {
                *position = Some(written(1e-4 * t_s));
            }
            record
        };
        let to_a_tenth = |x: f64| (1e7 * x).round() / 1e7 + 0.123_456_789e-3;
        let record = smooth(&to_a_tenth);
        let step_m = written_step_m(&record).expect("a step");
        assert!((step_m / 1e-7 - 1.0).abs() < 1e-9, "{step_m:e}");
        let found = estimate(&record).expect("an estimate");
        assert!(found.sd_m >= 1e-7 / 12_f64.sqrt() && found.sd_m < 1.5e-7, "{found}");
        assert_eq!(written_step_m(&smooth(&|x| x.sqrt())), None);
        let mut fine = noisy(&[(5.0, 1.0), (5.0, -1.0)].repeat(4), 11);
        let before = estimate(&fine).expect("an estimate");
        fine.position_m.iter_mut().flatten().for_each(|x| *x = (1e10 * *x).round() / 1e10);
        let after = estimate(&fine).expect("an estimate");
        assert!((after.sd_m / before.sd_m - 1.0).abs() < 1e-2, "{before} {after}");
    }

    /// Steps are found over 12 decades of scale, from a zero that is no multiple of the step. Examples are 13 µm pixels, and 0.1 nm digits of a travel of 1 µm.
    #[test]
    fn the_step_between_positions_is_found_at_any_scale() {
        let creep = noisy(&[(5.0, 1.0), (5.0, -1.0)].repeat(2), 16);
        for decade in -6..=6 {
            let scale = 10_f64.powi(decade);
            for step in [13e-6, 1e-7, 0.7e-6] {
                let mut record = creep.clone();
                let written = |x: f64| scale * (step * (x / step).round() + 0.123_456_789e-3);
                record.position_m.iter_mut().flatten().for_each(|x| *x = written(*x));
                let found = written_step_m(&record).map(|found| found / scale / step);
                assert!(found.is_some_and(|ratio| (ratio - 1.0).abs() < 1e-6), "{decade} {step}: {found:?}");
                // Positions without rounding have no step.
                record.position_m.iter_mut().flatten().for_each(|x| *x = scale * (x.abs() / scale).sqrt());
                assert_eq!(written_step_m(&record), None, "{decade} {step}");
            }
        }
    }

    /// A power law at 200 rows evenly spaced in log time, with noise of 0.5 % of its travel. The standard error is near 9 %, so ±50 % fails falsely below 1e-6.
    #[test]
    fn rows_spaced_in_log_time_show_the_noise() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(17);
        let (sd_m, mut record) = (1e-6, Record::default());
        let noise = Normal::new(0.0, sd_m).unwrap();
        for row in 0..200 {
            let t_s = 0.05 * 1.048_f64.powi(row);
            record.time_s.push(t_s);
            record.force_n.push(1.0);
            record.position_m.push(Some(20e-6 * t_s.powf(0.35) + noise.sample(&mut rng)));
            record.cycle.push(1);
        }
        let found = estimate(&record).expect("an estimate");
        assert!((found.sd_m / sd_m - 1.0).abs() < 0.5, "{found}");
    }

    /// Two outliers of 100 standard deviations, one at rest and one in the last row. The estimate stays the same, and both are found.
    #[test]
    fn outliers_do_not_inflate_the_noise_and_are_named() {
        let clean = noisy(&[(10.0, 0.0), (5.0, 1.0), (5.0, -1.0)], 12);
        let mut record = clean.clone();
        let last = record.n_rows() - 1;
        for row in [60, last] {
            record.position_m[row] = record.position_m[row].map(|x| x + 100.0 * NOISE_M);
        }
        let (before, after) = (estimate(&clean).unwrap(), estimate(&record).unwrap());
        assert!((after.sd_m / before.sd_m - 1.0).abs() < 0.02, "{before} {after}");
        assert_eq!(outliers(&record).iter().map(|outlier| outlier.row).collect::<Vec<_>>(), [60, last]);
        assert!(outliers(&clean).is_empty());
    }

    #[test]
    fn too_few_positions_give_nothing() {
        let mut record = noisy(&[(1.0, 1.0)], 14);
        record.position_m.iter_mut().skip(5).for_each(|position| *position = None);
        assert_eq!(estimate(&record), None);
    }

    #[test]
    fn a_line_has_no_residuals_and_a_zigzag_its_own() {
        let line: Vec<(f64, f64)> = (0..9).map(|i| (f64::from(i), 3.0 - 0.5 * f64::from(i))).collect();
        assert!(squares_about_line(&line).0 < 1e-25);
        // The points x = 1, −1, −1, 1 at t = 0..3 have zero slope and zero mean.
        assert_eq!(squares_about_line(&[(0.0, 1.0), (1.0, -1.0), (2.0, -1.0), (3.0, 1.0)]), (4.0, 4));
    }
}
