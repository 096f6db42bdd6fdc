//! Plausible sizes of slow noise, gains and offsets beside white noise of known size.
//!
//! They are as large as the white noise, or larger if the record itself shows larger ones: in the scatter of rests, or in the differences between successive cycles.
//! A model's misfit recurs in every cycle, so it does not enter these differences.

use posterior::check::quick_fit;
use posterior::noise::NoiseBounds;
use record::noise::rest_sd_m;
use record::robust::{SD_PER_MAD, median};
use record::{Control, Record};

use crate::matched_cycles::{FEWEST_MATCHED_ROWS, MatchTolerance, Phase, about_line, phases_of_cycles};

/// Ratio of a bound to the noise that the record shows. Two or three cycles determine the size of gains only within such a factor.
const SHOWN_FACTOR: f64 = 2.0;
/// Largest bound of the gain if the record shows no gains. Cycles are alike within a few per cent, however large the white noise is.
const LARGEST_UNSHOWN_GAIN: f64 = 0.03;
/// Distance from the line, in robust standard deviations, beyond which a difference is an outlier.
const FAR: f64 = 5.0;

/// Sizes of the noise between cycles.
#[derive(Default)]
struct CycleNoise {
    slow_m: f64,
    gain: f64,
    offset_m: f64,
}

/// Bounds of the noise beside white noise with the standard deviation `white_m` (m).
pub(super) fn noise_bounds(record: &Record, control: Control, white_m: f64) -> NoiseBounds {
    let shown = shown_by_cycles(record, control, white_m).unwrap_or_default();
    let positions = || record.position_m.iter().flatten().copied();
    let range_m = positions().fold(f64::NEG_INFINITY, f64::max) - positions().fold(f64::INFINITY, f64::min);
    let rest_m2 = rest_sd_m(record).map_or(0.0, |rest_m| (rest_m.powi(2) - white_m.powi(2)).max(0.0));
    // A gain of this size makes errors as large as the white noise over the whole travel.
    let unshown_gain = (white_m / range_m).min(LARGEST_UNSHOWN_GAIN);
    NoiseBounds {
        slow_sd_um: 1e6 * white_m.max(SHOWN_FACTOR * shown.slow_m.max(rest_m2.sqrt())),
        gain_sd: unshown_gain.max(SHOWN_FACTOR * shown.gain),
        offset_sd_um: 1e6 * white_m.max(SHOWN_FACTOR * shown.offset_m),
    }
}

/// Noise that matching rows of successive cycles show, beside white noise; `None` if too few rows match. From three cycles on, second differences exclude even changes
/// of a gel from cycle to cycle.
fn shown_by_cycles(record: &Record, control: Control, white_m: f64) -> Option<CycleNoise> {
    let same = MatchTolerance::of(record)?;
    let motion_m = match control {
        Control::Force => quick_fit(record, record.force_rule).map(|fit| fit.motion_m),
        Control::Position => None,
    };
    let residual_m = |row: usize| {
        let motion_m = motion_m.as_ref().map_or(Some(0.0), |motion_m| motion_m.get(row).copied());
        Some(record.position_m[row]? - motion_m?)
    };
    let cycles = phases_of_cycles(record);
    let weights: &[f64] = if cycles.len() > 2 { &[1.0, -2.0, 1.0] } else { &[1.0, -1.0] };
    let norm: f64 = weights.iter().map(|weight| weight * weight).sum();
    let (mut slow_m2, mut gain_squares, mut offset_m2, mut n_groups) = (0.0, 0.0, 0.0, 0.0);
    for group in cycles.windows(weights.len()) {
        // Mean position and weighted difference of the residuals at matching rows.
        let difference = |row: &Phase| {
            let rows: Option<Vec<usize>> = group.iter().map(|cycle| Some(same.find(cycle, row)?.row)).collect();
            let (mut mean_m, mut difference_m) = (0.0, 0.0);
            for (row, weight) in rows?.into_iter().zip(weights) {
                mean_m += record.position_m[row]? / weights.len() as f64;
                difference_m += weight * residual_m(row)?;
            }
            Some((mean_m, difference_m))
        };
        let all: (Vec<f64>, Vec<f64>) = group[0].iter().filter_map(difference).unzip();
        let Some((mean_m, difference_m)) = without_outliers(all) else { continue };
        let ((slope, _), left_m) = about_line(&mean_m, &difference_m);
        let n = difference_m.len() as f64;
        let intercept_m = (difference_m.iter().sum::<f64>() - slope * mean_m.iter().sum::<f64>()) / n;
        slow_m2 += left_m.iter().map(|m| m * m).sum::<f64>() / (norm * (n - 2.0));
        gain_squares += slope.powi(2) / norm;
        offset_m2 += intercept_m.powi(2) / norm;
        n_groups += 1.0;
    }
    (n_groups > 0.0).then(|| CycleNoise {
        slow_m: (slow_m2 / n_groups - white_m.powi(2)).max(0.0).sqrt(),
        gain: (gain_squares / n_groups).sqrt(),
        offset_m: (offset_m2 / n_groups).sqrt(),
    })
}

/// Removes differences far from the line of differences over positions; `None` if too few are left.
fn without_outliers((x, y): (Vec<f64>, Vec<f64>)) -> Option<(Vec<f64>, Vec<f64>)> {
    if x.len() < FEWEST_MATCHED_ROWS {
        return None;
    }
    let left = about_line(&x, &y).1;
    let far = FAR * SD_PER_MAD * median(left.iter().map(|left| left.abs()).collect())?;
    let kept: (Vec<f64>, Vec<f64>) =
        x.into_iter().zip(y).zip(left).filter(|(_, left)| left.abs() <= far).map(|(pair, _)| pair).unzip();
    (kept.0.len() >= FEWEST_MATCHED_ROWS).then_some(kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NoiseValues;
    use crate::test_subjects::{Protocol, noise_of, subject, truth_of};

    const WHITE_M: f64 = 4e-6;
    const N_RECORDS: u64 = 16;

    /// Medians of the bounds of sixteen records of the paper's protocol, with noise of these parameters. `gain_of` multiplies the motion of each cycle.
    fn median_bounds(noise: [f64; 5], gain_of: impl Fn(u32) -> f64) -> NoiseBounds {
        let subject = subject(Protocol::Paper);
        let truth_m = truth_of(&subject, &[], &[]);
        let of = |seed: u64| {
            let noise_m = noise_of(&subject, &truth_m, &NoiseValues::new(noise), 700 + seed);
            let mut record = subject.experiment().record.clone();
            for (row, position_m) in record.position_m.iter_mut().enumerate() {
                *position_m = Some(gain_of(record.cycle[row]) * truth_m[row] + noise_m[row]);
            }
            noise_bounds(&record, Control::Force, WHITE_M)
        };
        let all: Vec<NoiseBounds> = (0..N_RECORDS).map(of).collect();
        let middle = |part: fn(&NoiseBounds) -> f64| median(all.iter().map(part).collect()).expect("records");
        NoiseBounds {
            slow_sd_um: middle(|bounds| bounds.slow_sd_um),
            gain_sd: middle(|bounds| bounds.gain_sd),
            offset_sd_um: middle(|bounds| bounds.offset_sd_um),
        }
    }

    /// Bounds are as large as the white noise if cycles repeat each other or change evenly. Larger slow noise and gains increase them.
    #[test]
    fn bounds_grow_with_noise_between_cycles_only() {
        let white = [4.0, 1e-6, 1.0, 1e-9, 1e-6];
        let alike = median_bounds(white, |_| 1.0);
        assert_eq!(alike.slow_sd_um, 4.0);
        assert!(alike.gain_sd < 0.01 && alike.offset_sd_um < 5.0, "{alike:?}");
        // The gel yields three per cent more in every cycle.
        let evenly = median_bounds(white, |cycle| 1.0 + 0.03 * f64::from(cycle));
        assert!(evenly.slow_sd_um < 5.0 && evenly.gain_sd < 0.01, "{evenly:?}");
        let slow = median_bounds([4.0, 12.0, 1.0, 1e-9, 1e-6], |_| 1.0);
        assert!((12.0..30.0).contains(&slow.slow_sd_um), "{slow:?}");
        let gains = median_bounds([4.0, 1e-6, 1.0, 0.04, 1e-6], |_| 1.0);
        assert!((0.03..0.12).contains(&gains.gain_sd), "{gains:?}");
        assert!(gains.slow_sd_um < 6.0, "{gains:?}");
    }
}
