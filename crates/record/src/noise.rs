//! The yardstick of a misfit: the tracker's known noise, or what rest and short lags show of it (formats §4).

use super::Experiment;
use super::line::Line;
use super::record::{Record, median};

/// Noise against which a misfit is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseYardstick {
    /// Standard deviation of one position, in m.
    pub sd_m: f64,
    /// How it was obtained.
    pub origin: NoiseOrigin,
}

/// How a [`NoiseYardstick`] was obtained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseOrigin {
    /// `measurement.noise_um`.
    Known,
    /// Scatter of positions at rest: before the first force, and late in long rests about a straight line.
    ///
    /// Sees slow noise as long as a window, so it is preferred. Recovery that is still curved raises it.
    Rest {
        /// Positions used.
        n_positions: usize,
        /// Windows they stand in.
        n_windows: usize,
        /// The short-lag estimate beside it, in m; much smaller means that the noise is correlated in time.
        short_lag_sd_m: Option<f64>,
    },
    /// Scaled median absolute deviation of second differences of neighbouring positions, late in each hold.
    ///
    /// Assumes independent Gaussian errors: noise with correlation r₁, r₂ at one and two samples is multiplied by
    /// √(1 − 4r₁/3 + r₂/3), hence understated when it is smooth. Curvature of the true motion raises it.
    ShortLag {
        /// Second differences used.
        n_differences: usize,
    },
}

/// Ratio of a Gaussian's standard deviation to its median absolute deviation.
pub const SD_PER_MAD: f64 = 1.482_602_218_505_602;
/// The part of each hold after which the motion is taken as smooth.
const EARLY_FRACTION: f64 = 0.5;
/// The part of a rest after which it is taken as rest.
pub const RECOVERY_FRACTION: f64 = 0.75;
/// Neighbours farther apart than this many median intervals are separated by a gap.
const GAP_INTERVALS: f64 = 2.5;
pub const MIN_DIFFERENCES: usize = 8;
pub const MIN_PER_WINDOW: usize = 8;
pub const MIN_REST_POSITIONS: usize = 20;
/// Force below this fraction of the range counts as none.
pub const NO_FORCE_FRACTION: f64 = 0.01;

impl Experiment {
    /// The noise that a misfit is measured against: `noise_um` if it is given, else the estimate from rest records,
    /// else from short lags; `None` if the record has too few positions for any.
    pub fn noise_yardstick(&self) -> Option<NoiseYardstick> {
        match self.noise_sd_m {
            Some(sd_m) => Some(NoiseYardstick { sd_m, origin: NoiseOrigin::Known }),
            None => estimate(&self.record),
        }
    }
}

impl std::fmt::Display for NoiseYardstick {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sd_um = self.sd_m * 1e6;
        match self.origin {
            NoiseOrigin::Known => write!(f, "noise {sd_um:.4} µm, given with the experiment"),
            NoiseOrigin::Rest { n_positions, n_windows, .. } => {
                write!(f, "noise {sd_um:.4} µm, estimated from {n_positions} positions in {n_windows} rests")
            }
            NoiseOrigin::ShortLag { n_differences } => {
                write!(f, "noise {sd_um:.4} µm, estimated from {n_differences} differences of neighbouring positions")
            }
        }
    }
}

fn estimate(record: &Record) -> Option<NoiseYardstick> {
    let differences = second_differences(record);
    let n_differences = differences.len();
    // Rounded positions of a smooth motion may lie on lines to the last digit: their errors are those of the rounding all the same.
    let rounding_sd_m = written_step_m(record).map_or(0.0, |step_m| step_m / 12_f64.sqrt());
    let short_lag_sd_m = (n_differences >= MIN_DIFFERENCES)
        .then(|| median(differences.iter().map(|difference| difference.abs()).collect()))
        .flatten()
        .map(|mad| SD_PER_MAD * mad)
        .filter(|sd_m| *sd_m > 0.0)
        .map(|sd_m| sd_m.max(rounding_sd_m));
    let rest = rest_residuals(record);
    if rest.n_positions >= MIN_REST_POSITIONS && rest.sum_of_squares > 0.0 {
        let sd_m = (rest.sum_of_squares / rest.degrees_of_freedom as f64).sqrt().max(rounding_sd_m);
        let origin = NoiseOrigin::Rest { n_positions: rest.n_positions, n_windows: rest.n_windows, short_lag_sd_m };
        return Some(NoiseYardstick { sd_m, origin });
    }
    short_lag_sd_m.map(|sd_m| NoiseYardstick { sd_m, origin: NoiseOrigin::ShortLag { n_differences } })
}

/// The last decimal (m) with which positions are written: the largest power of ten of which all their differences are multiples; `None` where there is none.
fn written_step_m(record: &Record) -> Option<f64> {
    let mut positions = record.position_m.iter().flatten();
    let first = *positions.next()?;
    // Down to 10⁻¹⁴ m: there a millimetre's own rounding begins.
    (3..=14).map(|decimals| 10_f64.powi(-decimals)).find(|step_m| {
        positions.clone().all(|x| {
            let steps = (x - first) / step_m;
            (steps - steps.round()).abs() < 1e-3
        })
    })
}

/// Row ranges between force steps.
pub fn holds(record: &Record) -> Vec<std::ops::Range<usize>> {
    let mut starts: Vec<usize> = record.force_step_rows();
    if starts.first() != Some(&0) {
        starts.insert(0, 0);
    }
    let ends = starts.iter().skip(1).copied().chain([record.n_rows()]);
    starts.iter().zip(ends).map(|(start, end)| *start..end).collect()
}

/// Rows of a hold that hold a position, later than `fraction` of it.
pub fn late_rows(record: &Record, hold: &std::ops::Range<usize>, fraction: f64) -> Vec<usize> {
    let (start_s, end_s) = (record.time_s[hold.start], record.time_s[hold.end - 1]);
    let late = |row: &usize| record.time_s[*row] >= start_s + fraction * (end_s - start_s);
    hold.clone().filter(|row| record.position_m[*row].is_some() && late(row)).collect()
}

fn points(record: &Record, rows: &[usize]) -> Vec<(f64, f64)> {
    rows.iter().filter_map(|row| Some((record.time_s[*row], record.position_m[*row]?))).collect()
}

/// Deviation of each position from the line through its neighbours, scaled to the sd of one position.
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
        // Nothing moves before the first force, so there the whole rest counts.
        let points = points(record, &late_rows(record, &hold, if loaded { RECOVERY_FRACTION } else { 0.0 }));
        if points.len() >= MIN_PER_WINDOW {
            rest.sum_of_squares += squares_about_line(&points);
            rest.degrees_of_freedom += points.len() - 2;
            rest.n_positions += points.len();
            rest.n_windows += 1;
        }
    }
    rest
}

/// Sum of squared residuals about the least-squares line.
fn squares_about_line(points: &[(f64, f64)]) -> f64 {
    let line = Line::through(points.iter().copied());
    points.iter().map(|point| line.excess(*point).powi(2)).sum()
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

    /// Holds of (duration, force), 20 Hz with jitter and lost positions, superposed creep plus white noise.
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

    /// 4 cycles leave 400 late differences; their MAD has a standard error near 6 % (correlated triples), curvature of
    /// the creep adds a few per cent. ±30 % is then five standard errors: false failures below 1e-6.
    #[test]
    fn short_lags_find_the_noise_under_creep() {
        let found = estimate(&noisy(&[(5.0, 1.0), (5.0, -1.0)].repeat(4), 11)).unwrap();
        assert!(matches!(found.origin, NoiseOrigin::ShortLag { n_differences } if n_differences > 250), "{found:?}");
        assert!((found.sd_m / NOISE_M - 1.0).abs() < 0.3, "{found}");
    }

    /// About 190 positions before the force: standard error 5 %, so ±26 % fails falsely below 1e-6.
    #[test]
    fn a_rest_before_the_first_force_finds_the_noise() {
        let found = estimate(&noisy(&[(10.0, 0.0), (5.0, 1.0), (5.0, -1.0)], 12)).unwrap();
        assert!(matches!(found.origin, NoiseOrigin::Rest { n_windows: 1, .. }), "{found:?}");
        assert!((found.sd_m / NOISE_M - 1.0).abs() < 0.26, "{found}");
    }

    /// Last quarters of three rests of 20 s, 280 positions: standard error 4.3 %.
    #[test]
    fn late_rests_find_the_noise_after_recovery() {
        let found = estimate(&noisy(&[(5.0, 1.0), (20.0, 0.0)].repeat(3), 13)).unwrap();
        assert!(matches!(found.origin, NoiseOrigin::Rest { n_windows: 3, .. }), "{found:?}");
        assert!((found.sd_m / NOISE_M - 1.0).abs() < 0.25, "{found}");
    }

    /// A motion without noise whose positions are written to 0.1 µm, from a zero that is none of them: the rounding's deviation is the noise. Where positions
    /// are written to more digits than the noise, or to all, nothing changes.
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
        assert_eq!(written_step_m(&record), Some(1e-7));
        let found = estimate(&record).expect("an estimate");
        assert!(found.sd_m >= 1e-7 / 12_f64.sqrt() && found.sd_m < 1.5e-7, "{found}");
        assert_eq!(written_step_m(&smooth(&|x| x.sqrt())), None);
        let mut fine = noisy(&[(5.0, 1.0), (5.0, -1.0)].repeat(4), 11);
        let before = estimate(&fine).expect("an estimate");
        fine.position_m.iter_mut().flatten().for_each(|x| *x = (1e10 * *x).round() / 1e10);
        let after = estimate(&fine).expect("an estimate");
        assert!((after.sd_m / before.sd_m - 1.0).abs() < 1e-2, "{before} {after}");
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
        assert!(squares_about_line(&line) < 1e-25);
        // x = 1, −1, −1, 1 at t = 0..3 has no slope and no mean.
        assert_eq!(squares_about_line(&[(0.0, 1.0), (1.0, -1.0), (2.0, -1.0), (3.0, 1.0)]), 4.0);
    }
}
