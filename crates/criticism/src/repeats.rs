//! Rows at the same time in successive cycles, after the same force step: what differs between them is not what a model misses in every cycle.

use posterior::check::quick_fit;
use posterior::noise::ShownNoise;
use record::Record;
use record::noise::rest_sd_m;
use record::robust::{SD_PER_MAD, median};

/// Rows of two cycles are at the same time in them to this fraction of the sample interval.
const SAME_TIME_INTERVALS: f64 = 0.1;
/// Force steps are equal to this fraction of the force's range.
const EQUAL_STEP_FRACTION: f64 = 0.05;
/// Fewest rows in which cycles are compared.
pub(super) const FEWEST_PER_PAIR: usize = 20;

/// Noise beside white noise that is known may be this many times as large as what the record shows of it: two or three cycles show a gain that badly.
const SHOWN_FACTOR: f64 = 2.0;
/// Cycles are alike to a few per cent, however large the white noise is.
const LARGEST_UNSHOWN_GAIN: f64 = 0.03;
/// Robust standard deviations beyond which a difference is taken for an outlier's.
const FAR: f64 = 5.0;

/// What noise is allowed beside white noise of this size (m): as much as that, or as much as the record shows. A gain is as large as the white noise where it
/// makes an error of that size of the record's whole travel.
pub(super) fn shown_noise(record: &Record, white_m: f64) -> ShownNoise {
    let [slow_m, gain, offset_m] = between_cycles(record, white_m).map(|own| SHOWN_FACTOR * own);
    let (low_m, high_m) = record
        .position_m
        .iter()
        .flatten()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (x.min(low), x.max(high)));
    let rest_m2 = rest_sd_m(record).map_or(0.0, |rest_m| rest_m.powi(2) - white_m.powi(2));
    let slow_m = slow_m.max(SHOWN_FACTOR * rest_m2.max(0.0).sqrt());
    ShownNoise {
        slow_sd_um: 1e6 * slow_m.max(white_m),
        gain_sd: gain.max((white_m / (high_m - low_m)).min(LARGEST_UNSHOWN_GAIN)),
        offset_sd_um: 1e6 * offset_m.max(white_m),
    }
}

/// Noise beside white noise as successive cycles show it: slow noise (m), gains, offsets (m). What a quick fit of the record leaves is compared at the same
/// time in successive cycles: in three and more by second differences, so that a gel that changes evenly from cycle to cycle is not taken for noise.
fn between_cycles(record: &Record, white_m: f64) -> [f64; 3] {
    const NOTHING: [f64; 3] = [0.0; 3];
    let (Some(fit), Some(same)) = (quick_fit(record, record.force_rule), Same::of(record)) else { return NOTHING };
    let cycles = cycles(record);
    let weights: &[f64] = if cycles.len() > 2 { &[1.0, -2.0, 1.0] } else { &[1.0, -1.0] };
    let norm: f64 = weights.iter().map(|weight| weight * weight).sum();
    let (mut squares_m2, mut n_squares) = (0.0, 0);
    let mut of_groups = Vec::new();
    for group in cycles.windows(weights.len()) {
        let (mut motion_m, mut difference_m) = (Vec::new(), Vec::new());
        for row in &group[0] {
            let rows = group.iter().map(|cycle| same.in_cycle(cycle, row).map(|phase| phase.row));
            let Some(rows) = rows.collect::<Option<Vec<usize>>>() else { continue };
            let parts = rows.iter().map(|row| Some((*fit.motion_m.get(*row)?, record.position_m[*row]?)));
            let Some(parts) = parts.collect::<Option<Vec<(f64, f64)>>>() else { continue };
            motion_m.push(parts.iter().map(|(motion, _)| motion).sum::<f64>() / parts.len() as f64);
            difference_m
                .push(parts.iter().zip(weights).map(|((motion, x), weight)| weight * (x - motion)).sum::<f64>());
        }
        if difference_m.len() < FEWEST_PER_PAIR {
            continue;
        }
        let left_m = about_line(&motion_m, &difference_m).1;
        let far_m = FAR * SD_PER_MAD * median(left_m.iter().map(|m| m.abs()).collect()).unwrap_or(0.0);
        let (motion_m, difference_m): (Vec<f64>, Vec<f64>) = motion_m
            .into_iter()
            .zip(difference_m)
            .zip(&left_m)
            .filter(|(_, left)| left.abs() <= far_m)
            .map(|(own, _)| own)
            .unzip();
        let ((slope, _), left_m) = about_line(&motion_m, &difference_m);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        squares_m2 += left_m.iter().map(|m| m * m).sum::<f64>() / norm;
        n_squares += left_m.len() - 2;
        of_groups.push([slope.powi(2) / norm, (mean(&difference_m) - slope * mean(&motion_m)).powi(2) / norm]);
    }
    if of_groups.is_empty() {
        return NOTHING;
    }
    let mean = |k: usize| of_groups.iter().map(|group| group[k]).sum::<f64>() / of_groups.len() as f64;
    let slow_m2 = squares_m2 / n_squares as f64 - white_m.powi(2);
    [slow_m2.max(0.0), mean(0), mean(1)].map(f64::sqrt)
}

/// What counts as the same time and as the same force.
pub(super) struct Same {
    time_s: f64,
    force_n: f64,
}

impl Same {
    pub(super) fn of(record: &Record) -> Option<Self> {
        let time_s = SAME_TIME_INTERVALS * record.median_interval_s()?;
        Some(Self { time_s, force_n: EQUAL_STEP_FRACTION * record.force_range_n() })
    }

    /// The row of a cycle at the time at which a row of another is in its own, if the last force step was the same.
    pub(super) fn in_cycle<'a>(&self, cycle: &'a [Phase], row: &Phase) -> Option<&'a Phase> {
        let at = cycle.partition_point(|other| other.after_s < row.after_s - self.time_s);
        let is_same = |other: &&Phase| {
            other.after_s <= row.after_s + self.time_s
                && (row.from_n - other.from_n).abs() <= self.force_n
                && (row.to_n - other.to_n).abs() <= self.force_n
        };
        cycle.get(at).filter(is_same)
    }
}

/// A row of a cycle: its time in it, and the forces before and after the last force step.
pub(super) struct Phase {
    pub(super) row: usize,
    after_s: f64,
    from_n: f64,
    to_n: f64,
}

pub(super) fn cycles(record: &Record) -> Vec<Vec<Phase>> {
    let steps = record.force_step_rows();
    (1..=record.n_cycles()).map(|cycle| phases(record, &steps, cycle)).collect()
}

/// Of the rows of a cycle, with the rows of all force steps.
fn phases(record: &Record, steps: &[usize], cycle: u32) -> Vec<Phase> {
    let first = record.cycle.partition_point(|other| *other < cycle);
    let end = record.cycle.partition_point(|other| *other <= cycle);
    let phase = |row: usize| {
        // A position is the limit from the left: that of the step's own row still belongs to what was before.
        let step = steps.partition_point(|step| *step < row).checked_sub(1).map(|place| steps[place]);
        let before = |step: usize| step.checked_sub(1).map_or(0.0, |before| record.force_n[before]);
        let (from_n, to_n) = step.map_or((0.0, 0.0), |step| (before(step), record.force_n[step]));
        Phase { row, after_s: record.time_s[row] - record.time_s[first], from_n, to_n }
    };
    (first..end).map(phase).collect()
}

/// Slope of the least-squares line of y over x with the sum of squares of x about its mean, and what the line leaves.
pub(super) fn about_line(x: &[f64], y: &[f64]) -> ((f64, f64), Vec<f64>) {
    let n = x.len() as f64;
    let (mean_x, mean_y) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let weight = x.iter().map(|x| (x - mean_x).powi(2)).sum::<f64>().max(f64::MIN_POSITIVE);
    let slope = x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>() / weight;
    ((slope, weight), x.iter().zip(y).map(|(x, y)| y - mean_y - slope * (x - mean_x)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NoiseValues;
    use crate::test_subjects::{Protocol, noise_of, subject, truth_of};

    const WHITE_M: f64 = 4e-6;
    const N_RECORDS: u64 = 16;

    /// What records of the paper's protocol show, with noise of these parameters and each cycle's motion multiplied by a number; the middle of sixteen records.
    fn shown(noise: [f64; 5], of_cycle: impl Fn(u32) -> f64) -> ShownNoise {
        let subject = subject(Protocol::Paper);
        let truth_m = truth_of(&subject, &[], &[]);
        let of = |seed: u64| {
            let noise_m = noise_of(&subject, &truth_m, &NoiseValues::new(noise), 700 + seed);
            let mut record = subject.experiment().record.clone();
            for (row, position_m) in record.position_m.iter_mut().enumerate() {
                *position_m = Some(of_cycle(record.cycle[row]) * truth_m[row] + noise_m[row]);
            }
            shown_noise(&record, WHITE_M)
        };
        let all: Vec<ShownNoise> = (0..N_RECORDS).map(of).collect();
        let middle = |part: fn(&ShownNoise) -> f64| median(all.iter().map(part).collect()).expect("records");
        ShownNoise {
            slow_sd_um: middle(|own| own.slow_sd_um),
            gain_sd: middle(|own| own.gain_sd),
            offset_sd_um: middle(|own| own.offset_sd_um),
        }
    }

    /// Sizes are those of the white noise where cycles repeat each other, or change evenly; larger ones are shown by cycles that do not.
    #[test]
    fn cycles_show_what_differs_between_them() {
        let white = [4.0, 1e-6, 1.0, 1e-9, 1e-6];
        let alike = shown(white, |_| 1.0);
        assert_eq!(alike.slow_sd_um, 4.0);
        assert!(alike.gain_sd < 0.01 && alike.offset_sd_um < 5.0, "{alike:?}");
        // A gel that yields three per cent more in every cycle.
        let evenly = shown(white, |cycle| 1.0 + 0.03 * f64::from(cycle));
        assert!(evenly.slow_sd_um < 5.0 && evenly.gain_sd < 0.01, "{evenly:?}");
        let slow = shown([4.0, 12.0, 1.0, 1e-9, 1e-6], |_| 1.0);
        assert!((12.0..30.0).contains(&slow.slow_sd_um), "{slow:?}");
        let gains = shown([4.0, 1e-6, 1.0, 0.04, 1e-6], |_| 1.0);
        assert!((0.03..0.12).contains(&gains.gain_sd), "{gains:?}");
        assert!(gains.slow_sd_um < 6.0, "{gains:?}");
    }
}
