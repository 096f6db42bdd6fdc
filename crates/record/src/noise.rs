//! Noise standard deviation with which residuals are compared (formats §4). It is given by the user, or estimated from rests or from neighbouring
//! rows.

use super::Experiment;
use super::line::MotionLine;
use super::record::Record;
use super::robust::median;

/// Noise standard deviation with which residuals are compared, and its source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceNoise {
    /// Standard deviation of a single position's error, in m.
    pub sd_m: f64,
    /// Source of the standard deviation.
    pub origin: NoiseOrigin,
}

/// Source of the noise standard deviation in a [`ReferenceNoise`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseOrigin {
    /// Given by the user as `measurement.noise_um`.
    Known,
    /// Estimated from positions at rest: before the first force, and late in long rests, where residuals from a straight line count.
    ///
    /// This estimate is preferred because it includes slow noise with correlation times up to the length of a rest. If the bead's recovery is still
    /// curved, the estimate is too large.
    Rest {
        /// Number of positions used.
        n_positions: usize,
        /// Number of rests that contain these positions.
        n_windows: usize,
        /// Noise standard deviation estimated from neighbouring rows, for comparison, in m. If it is much smaller than the estimate from rests, the
        /// noise is correlated in time.
        short_lag_sd_m: Option<f64>,
    },
    /// Estimated from neighbouring rows: the scaled median absolute deviation of positions from polynomials through their neighbours. Only rows late
    /// in each hold count, if there are enough. The polynomial is a line, unless a higher order gives clearly smaller deviations.
    ///
    /// The estimate assumes independent Gaussian errors. If the errors have correlations r₁, r₂ at one and two samples, the estimate is multiplied by √(1 −
    /// 4r₁/3 + r₂/3). Smooth noise is therefore underestimated. Curvature of the true motion increases the estimate.
    ShortLag {
        /// Number of deviations whose median is used.
        n_differences: usize,
    },
}

pub use super::robust::SD_PER_MAD;
/// Fraction of a hold's duration after which the motion is assumed to be smooth.
const EARLY_FRACTION: f64 = 0.5;
/// Fraction of a rest's duration after which the bead is assumed to be at rest.
pub const RECOVERY_FRACTION: f64 = 0.75;
/// Multiple of the median interval between rows above which an interval counts as a gap.
const GAP_INTERVALS: f64 = 2.5;
/// Number of neighbours that define a line, from which a position's deviation is measured.
const LINE: usize = 2;
/// Largest number of neighbours that define a polynomial, from which a position's deviation is measured.
const MOST_ORDER: usize = 5;
/// Fraction of neighbouring deviations that must have opposite signs for the deviations to count as noise.
const TURNS: f64 = 0.5;
/// Fraction of the positions' range that the standard deviation of deviations must exceed to count as noise.
const NOISELESS: f64 = 1e-7;
/// Largest ratio of the longest to the shortest interval between the rows of one polynomial.
const UNEVEN: f64 = 4.0;
/// Relative standard error of a scaled median absolute deviation of n correlated deviations, multiplied by √n. A polynomial order is rejected if its
/// deviation exceeds that of the next order by `ORDER_ERRORS` standard errors.
const MAD_ERROR: f64 = 1.65;
const ORDER_ERRORS: f64 = 3.0;
/// Criteria for the digital step between written positions. At least `FEWEST_GAPS` gaps must lie between unequal positions in ascending order. Trial
/// steps are the smallest gap divided by integers up to `WIDEST_GAP`. All gaps must be multiples of the step, within the fraction `DIVISIBLE` of a
/// step. For positions without a step, 8 gaps pass one of 1,000 trials with probability 1000 (2·10⁻³)⁷.
const FEWEST_GAPS: usize = 8;
const WIDEST_GAP: u32 = 1_000;
const DIVISIBLE: f64 = 1e-3;
/// Number of standard deviations beyond which a position at rest is an outlier. For normal errors the probability is 2·10⁻⁹.
const FAR_SDS: f64 = 6.0;
/// Number of passes that exclude outliers at rest.
const PASSES: usize = 6;
/// Factors for the distance at which a position is an outlier. The distance must exceed `OUTLIER_SDS` standard deviations, and `OUTLIER_FLOWS` times
/// the distance between the neighbouring rows.
const OUTLIER_SDS: f64 = 20.0;
const OUTLIER_FLOWS: f64 = 3.0;
/// Conditions for a steady force around an outlier. Over `AROUND` rows before and after it, the force changes by at most the fraction `STEADY` of its
/// range.
const AROUND: usize = 3;
const STEADY: f64 = 0.05;
pub const MIN_DIFFERENCES: usize = 8;
pub const MIN_PER_WINDOW: usize = 8;
pub const MIN_REST_POSITIONS: usize = 20;
/// Forces below this fraction of the force's range count as zero.
pub const NO_FORCE_FRACTION: f64 = 0.01;

impl Experiment {
    /// Returns the noise standard deviation with which residuals are compared, and its source. It is `noise_um` if given, otherwise the estimate from
    /// rests, otherwise the estimate from neighbouring rows. `None` if the record has too few positions.
    pub fn reference_noise(&self) -> Option<ReferenceNoise> {
        match self.noise_sd_m {
            Some(sd_m) => Some(ReferenceNoise { sd_m, origin: NoiseOrigin::Known }),
            None => estimate_noise(&self.record),
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

/// Estimates the noise of single positions from the record itself: from rests, or else from neighbouring positions. `None` if there are too few.
pub fn estimate_noise(record: &Record) -> Option<ReferenceNoise> {
    // Rounded positions of a smooth motion may lie exactly on lines. Their rounding errors still count as noise.
    let rounding_sd_m = rounding_sd_m(&record.position_m);
    let short_lag = short_lag(record).map(|(sd_m, n_differences)| (sd_m.max(rounding_sd_m), n_differences));
    let rest = rest_residuals(record);
    if let Some(sd_m) = rest.sd_m() {
        let sd_m = sd_m.max(rounding_sd_m);
        let short_lag_sd_m = short_lag.map(|(sd_m, _)| sd_m);
        let origin = NoiseOrigin::Rest { n_positions: rest.n_positions, n_windows: rest.n_windows, short_lag_sd_m };
        return Some(ReferenceNoise { sd_m, origin });
    }
    let (sd_m, n_differences) = short_lag?;
    Some(ReferenceNoise { sd_m, origin: NoiseOrigin::ShortLag { n_differences } })
}

/// Estimates the noise from neighbouring rows. Returns the noise standard deviation (m) and the number of deviations used. Only rows late in each
/// hold count, unless they are too few.
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
            // Deviations of independent errors change sign in more than 7 of 10 neighbouring pairs. Deviations of a smooth motion rarely do.
            let is_noise = n_turns as f64 > TURNS * deviations.len() as f64 && sd_m > NOISELESS * (high_m - low_m);
            (deviations.len() >= MIN_DIFFERENCES && sd_m > 0.0).then_some((sd_m, deviations.len(), is_noise))
        };
        let line = found(LINE)?;
        let mut best = line;
        for order in LINE + 1..=MOST_ORDER {
            let Some(next) = found(order) else { break };
            // A higher order is chosen only if its deviations are clearly smaller, because the deviations of this order then still contain curvature
            // of the motion.
            if best.0 <= next.0 * (1.0 + ORDER_ERRORS * MAD_ERROR / (next.1 as f64).sqrt()) {
                break;
            }
            best = next;
        }
        // If the motion is smooth to the last digit, the best order's deviations are no noise, and the line's deviations are used.
        let (sd_m, n_deviations, _) = if best.2 { best } else { line };
        Some((sd_m, n_deviations))
    })
}

/// Standard deviation (m) of the rounding of written positions; 0 if they have no digital step.
pub fn rounding_sd_m(position_m: &[Option<f64>]) -> f64 {
    written_step_m(position_m).map_or(0.0, |step_m| step_m / 12_f64.sqrt())
}

/// Returns the digital step (m) between written positions: the largest number that divides all their differences. `None` without such a step.
pub(crate) fn written_step_m(position_m: &[Option<f64>]) -> Option<f64> {
    let mut sorted: Vec<f64> = position_m.iter().flatten().copied().collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let (first, last) = (*sorted.first()?, *sorted.last()?);
    // Positions that were equal in the file may differ by rounding, because a zero was subtracted.
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
    // The smallest gap between positions may be several steps wide.
    let steps = (1..=WIDEST_GAP).map(|parts| smallest / f64::from(parts));
    // Trial steps end where rounding errors make every number a multiple of the step.
    let step = steps.take_while(|step| rounding < DIVISIBLE * step).find(|step| is_step(*step))?;
    // The mean over the whole range has the smallest rounding error.
    let n_steps: f64 = gaps.iter().map(|gap| (gap / step).round()).sum();
    Some(gaps.iter().sum::<f64>() / n_steps)
}

/// Row ranges of the record's holds, each from one force step to the next.
pub fn holds(record: &Record) -> Vec<std::ops::Range<usize>> {
    record.force().holds()
}

/// Indices of the rows of a hold that have a position and come after the fraction `fraction` of the hold's duration.
pub fn late_rows(record: &Record, hold: &std::ops::Range<usize>, fraction: f64) -> Vec<usize> {
    let (start_s, end_s) = (record.time_s[hold.start], record.time_s[hold.end - 1]);
    let late = |row: &usize| record.time_s[*row] >= start_s + fraction * (end_s - start_s);
    hold.clone().filter(|row| record.position_m[*row].is_some() && late(row)).collect()
}

fn points(record: &Record, rows: &[usize]) -> Vec<(f64, f64)> {
    rows.iter().filter_map(|row| Some((record.time_s[*row], record.position_m[*row]?))).collect()
}

/// Deviations (m) of positions from the line through their two neighbours, late in each hold. They are scaled to the standard deviation of one
/// position.
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

/// Deviations (m) of positions from the polynomial through their `order` neighbours. They are divided differences, scaled to the standard deviation
/// of one position. Only rows after the fraction `fraction` of each hold count. The row spacing may vary slowly.
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

/// Position that is far from the positions in its neighbouring rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Index of the row, from 0.
    pub row: usize,
    /// Signed distance of the position from the line through the neighbouring rows, in m.
    pub distance_m: f64,
}

/// Returns positions that are many noise standard deviations from their neighbouring rows, and farther than the motion explains: single positions, and two in succession
/// on the same side.
pub fn outliers(record: &Record) -> Vec<Outlier> {
    let Some((sd_m, _)) = short_lag(record) else { return Vec::new() };
    let rows: Vec<usize> = (0..record.n_rows()).filter(|row| record.position_m[*row].is_some()).collect();
    let at = |place: usize| (record.time_s[rows[place]], record.position_m[rows[place]].unwrap_or(0.0));
    // This function returns the distance from the line through rows `a` and `b`, which is extrapolated at an end of the record.
    let distance = |place: usize, a: usize, b: usize| {
        let ((t, x), (ta, xa), (tb, xb)) = (at(place), at(a), at(b));
        let weight = (t - ta) / (tb - ta);
        (x - xa - weight * (xb - xa), (xb - xa).abs(), 1.0 + weight.abs() + (1.0 - weight).abs())
    };
    let n = rows.len();
    let beyond = |place: usize, (a, b): (usize, usize)| {
        let (distance_m, flow_m, scale) = distance(place, a, b);
        let is_far = distance_m.abs() > (OUTLIER_SDS * scale * sd_m).max(OUTLIER_FLOWS * flow_m);
        is_far.then_some(Outlier { row: rows[place], distance_m })
    };
    let far = |place: usize| {
        let around = match place {
            _ if n < 5 => return None,
            0 => (1, 2),
            _ if place + 1 == n => (n - 2, n - 3),
            _ => (place - 1, place + 1),
        };
        beyond(place, around)
    };
    let far_pair = |place: usize| {
        let around = (place.checked_sub(1)?, Some(place + 2).filter(|next| *next < n && n >= 6)?);
        let (one, other) = (beyond(place, around)?, beyond(place + 1, around)?);
        (one.distance_m * other.distance_m > 0.0).then_some([one, other])
    };
    // Rows near a force step do not count, because the velocity jumps there.
    let least_n = STEADY * record.force_range_n();
    let is_steady = |outlier: &Outlier| {
        let around = outlier.row.saturating_sub(AROUND)..(outlier.row + AROUND).min(record.n_rows());
        let force_n = &record.force_n[around];
        let ends =
            force_n.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(*x), high.max(*x)]);
        outlier.row >= AROUND && ends[1] - ends[0] <= least_n
    };
    let mut found: Vec<Outlier> = (0..n).filter_map(far).chain((0..n).filter_map(far_pair).flatten()).collect();
    found.retain(is_steady);
    found.sort_by_key(|outlier| outlier.row);
    found.dedup_by_key(|outlier| outlier.row);
    found
}

#[derive(Default)]
struct RestResiduals {
    sum_of_squares: f64,
    degrees_of_freedom: usize,
    n_positions: usize,
    n_windows: usize,
}

impl RestResiduals {
    fn sd_m(&self) -> Option<f64> {
        let is_enough = self.n_positions >= MIN_REST_POSITIONS && self.sum_of_squares > 0.0;
        is_enough.then(|| (self.sum_of_squares / self.degrees_of_freedom as f64).sqrt())
    }
}

/// Standard deviation (m) of positions at rest about straight lines; `None` if there are too few positions.
pub fn rest_sd_m(record: &Record) -> Option<f64> {
    rest_residuals(record).sd_m()
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
        // The bead does not move before the first force, so all rows of that rest count.
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

/// Returns the sum of squared residuals about the least-squares line without outliers, and the number of points that are not outliers. Each point is
/// a time and a position.
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

    /// Returns the displacement (m) under a constant force after the time `t_s`, with the time scales of a porcine gel (physics §2), an amplitude of
    /// 0.7 mm and a flow rate of 0.05 mm/s.
    fn creep_m(t_s: f64) -> f64 {
        if t_s <= 0.0 { 0.0 } else { 0.7e-3 * (1.0 - (-t_s / 0.4).exp()) + 0.05e-3 * t_s }
    }

    /// Returns a record of holds given by duration and force, sampled at 20 Hz at irregular times with lost positions. The positions are superposed
    /// creep plus white noise.
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

    /// Checks the estimate from neighbouring rows. Four cycles give 400 deviations late in their holds. The median absolute deviation has a standard
    /// error near 6 %, because three neighbouring deviations are correlated. The creep's curvature adds a few per cent. Limits of ±30 % are five
    /// standard errors, so false failures are below 1e-6.
    #[test]
    fn short_lags_find_the_noise_under_creep() {
        let found = estimate_noise(&noisy(&[(5.0, 1.0), (5.0, -1.0)].repeat(4), 11)).unwrap();
        assert!(matches!(found.origin, NoiseOrigin::ShortLag { n_differences } if n_differences > 250), "{found:?}");
        assert!((found.sd_m / NOISE_M - 1.0).abs() < 0.3, "{found}");
    }

    /// Checks the estimate from the rest before the force. About 190 positions give a standard error of 5 %. Limits of ±26 % fail falsely with a
    /// probability below 1e-6.
    #[test]
    fn a_rest_before_the_first_force_finds_the_noise() {
        let found = estimate_noise(&noisy(&[(10.0, 0.0), (5.0, 1.0), (5.0, -1.0)], 12)).unwrap();
        assert!(matches!(found.origin, NoiseOrigin::Rest { n_windows: 1, .. }), "{found:?}");
        assert!((found.sd_m / NOISE_M - 1.0).abs() < 0.26, "{found}");
    }

    /// Checks the estimate from rests between loads. The last quarters of three rests of 20 s have 280 positions and give a standard error of 4.3 %.
    #[test]
    fn late_rests_find_the_noise_after_recovery() {
        let found = estimate_noise(&noisy(&[(5.0, 1.0), (20.0, 0.0)].repeat(3), 13)).unwrap();
        assert!(matches!(found.origin, NoiseOrigin::Rest { n_windows: 3, .. }), "{found:?}");
        assert!((found.sd_m / NOISE_M - 1.0).abs() < 0.25, "{found}");
    }

    /// Checks that the estimate for a motion without noise is the rounding error. Positions are rounded to 0.1 µm, and the zero is no multiple of
    /// this step. Positions with digits finer than the noise, or with all digits, must give an unchanged estimate.
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
        let step_m = written_step_m(&record.position_m).expect("a step");
        assert!((step_m / 1e-7 - 1.0).abs() < 1e-9, "{step_m:e}");
        let found = estimate_noise(&record).expect("an estimate");
        assert!(found.sd_m >= 1e-7 / 12_f64.sqrt() && found.sd_m < 1.5e-7, "{found}");
        assert_eq!(written_step_m(&smooth(&|x| x.sqrt()).position_m), None);
        let mut fine = noisy(&[(5.0, 1.0), (5.0, -1.0)].repeat(4), 11);
        let before = estimate_noise(&fine).expect("an estimate");
        fine.position_m.iter_mut().flatten().for_each(|x| *x = (1e10 * *x).round() / 1e10);
        let after = estimate_noise(&fine).expect("an estimate");
        assert!((after.sd_m / before.sd_m - 1.0).abs() < 1e-2, "{before} {after}");
    }

    /// Checks that digital steps are found over 12 decades of scale. The zero is no multiple of the step. Examples are pixels of 13 µm, and digits of
    /// 0.1 nm in a motion of 1 µm.
    #[test]
    fn the_step_between_positions_is_found_at_any_scale() {
        let creep = noisy(&[(5.0, 1.0), (5.0, -1.0)].repeat(2), 16);
        for decade in -6..=6 {
            let scale = 10_f64.powi(decade);
            for step in [13e-6, 1e-7, 0.7e-6] {
                let mut record = creep.clone();
                let written = |x: f64| scale * (step * (x / step).round() + 0.123_456_789e-3);
                record.position_m.iter_mut().flatten().for_each(|x| *x = written(*x));
                let found = written_step_m(&record.position_m).map(|found| found / scale / step);
                assert!(found.is_some_and(|ratio| (ratio - 1.0).abs() < 1e-6), "{decade} {step}: {found:?}");
                // Positions that are not rounded have no digital step.
                record.position_m.iter_mut().flatten().for_each(|x| *x = scale * (x.abs() / scale).sqrt());
                assert_eq!(written_step_m(&record.position_m), None, "{decade} {step}");
            }
        }
    }

    /// Checks the noise estimate for a power-law creep with 200 rows evenly spaced in log time. The noise is 0.5 % of the motion's range. The
    /// standard error is near 9 %, so limits of ±50 % fail falsely with a probability below 1e-6.
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
        let found = estimate_noise(&record).expect("an estimate");
        assert!((found.sd_m / sd_m - 1.0).abs() < 0.5, "{found}");
    }

    /// Checks that two outliers of 100 standard deviations, one at rest and one in the last row, are found and do not change the estimate.
    #[test]
    fn outliers_do_not_inflate_the_noise_and_are_named() {
        let clean = noisy(&[(10.0, 0.0), (5.0, 1.0), (5.0, -1.0)], 12);
        let mut record = clean.clone();
        let last = record.n_rows() - 1;
        for row in [60, last] {
            record.position_m[row] = record.position_m[row].map(|x| x + 100.0 * NOISE_M);
        }
        let (before, after) = (estimate_noise(&clean).unwrap(), estimate_noise(&record).unwrap());
        assert!((after.sd_m / before.sd_m - 1.0).abs() < 0.02, "{before} {after}");
        assert_eq!(outliers(&record).iter().map(|outlier| outlier.row).collect::<Vec<_>>(), [60, last]);
        assert!(outliers(&clean).is_empty());
        // Two successive positions on the same side are named together.
        let mut pair = clean.clone();
        for row in [30, 31] {
            pair.position_m[row] = pair.position_m[row].map(|x| x + 200e-6);
        }
        assert_eq!(outliers(&pair).iter().map(|outlier| outlier.row).collect::<Vec<_>>(), [30, 31]);
    }

    #[test]
    fn too_few_positions_give_nothing() {
        let mut record = noisy(&[(1.0, 1.0)], 14);
        record.position_m.iter_mut().skip(5).for_each(|position| *position = None);
        assert_eq!(estimate_noise(&record), None);
    }

    #[test]
    fn a_line_has_no_residuals_and_a_zigzag_its_own() {
        let line: Vec<(f64, f64)> = (0..9).map(|i| (f64::from(i), 3.0 - 0.5 * f64::from(i))).collect();
        assert!(squares_about_line(&line).0 < 1e-25);
        // The points x = 1, −1, −1, 1 at t = 0..3 have zero slope and zero mean.
        assert_eq!(squares_about_line(&[(0.0, 1.0), (1.0, -1.0), (2.0, -1.0), (3.0, 1.0)]), (4.0, 4));
    }
}
