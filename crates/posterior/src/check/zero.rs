//! Checks of the zero of the positions, and of the rest before the force acts.

use super::quick_fit::median;
use super::{CheckContext, found, um};
use documents::check::Contradiction;
use figures::number::format_significant;
use record::MotionLine;
use record::frame::{is_zeroed_by_first_row, offset_at_rest};

/// Number of positions at the record's start that the check of the zero uses.
const FIRST: usize = 5;
/// Smallest start position that is reported as a wrong zero, in noise standard deviations.
const NOISES: f64 = 6.0;
/// Smallest start position that is reported as a wrong zero, as a fraction of the positions' range.
const SHARE: f64 = 0.03;
/// Replacement of [`NOISES`] for a record without a position before the force acts.
const NOISES_WITHOUT_START: f64 = 12.0;
/// Replacement of [`SHARE`] for a record without a position before the force acts.
const SHARE_WITHOUT_START: f64 = 0.15;
/// Largest relative difference between the two estimates of the start position at which they agree.
const AGREE: f64 = 0.5;
/// Smallest number of rows at rest (before any force acts) that can show a drift.
const REST_ROWS: usize = 8;
/// Smallest drift at rest that is reported, in noise standard deviations.
const DRIFT_NOISES: f64 = 4.0;
/// Smallest drift at rest that is reported, as a fraction of the positions' range.
const DRIFT_SHARE: f64 = 0.02;
/// Smallest slope of a drift at rest that is reported, in standard errors of the slope.
const DRIFT_ERRORS: f64 = 8.0;

/// Finds a record that does not start at zero although no force has acted, as in camera coordinates.
pub(super) fn off(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let record = looked.record;
    if looked.experiment.fits_position_offset {
        return None;
    }
    // A record whose first position was measured after the load has moved by then.
    if record.force_n.first() != Some(&0.0) && record.position_m.first() == Some(&None) {
        return None;
    }
    let fit = looked.fit.as_ref()?;
    let first: Vec<(usize, f64)> =
        (0..fit.motion_m.len()).filter_map(|row| Some((row, record.position_m[row]?))).take(FIRST).collect();
    // The fitted motion is subtracted, because the force may act from the first row on.
    let shifted_m = median(first.iter().map(|(row, x)| x - fit.motion_m[*row]).collect())?;
    let n_rest = record.force_n.iter().take_while(|force| **force == 0.0).count();
    let rest = median(record.position_m.iter().take(n_rest.max(1)).flatten().copied().collect());
    let (start_m, noises, share) = match rest {
        Some(rest_m) => (rest_m, NOISES, SHARE),
        None => (shifted_m, NOISES_WITHOUT_START, SHARE_WITHOUT_START),
    };
    // An outlier at the start, or a bad fit right after it, affects only one of the two estimates.
    let agree = start_m * shifted_m > 0.0 && (start_m - shifted_m).abs() < AGREE * start_m.abs().max(shifted_m.abs());
    let off_m = if agree { start_m.abs().min(shifted_m.abs()) } else { 0.0 };
    if off_m <= (noises * looked.noise_m).max(share * looked.range_m) {
        return None;
    }
    let text = format!(
        "positions start at {} µm, before the force has moved anything; they range over {} µm with {} µm of noise",
        um(start_m),
        um(looked.range_m),
        um(looked.noise_m)
    );
    let advice = "write `zero = \"fit\"` in [measurement], or the position itself";
    Some(found("zero_off", true, text, advice))
}

/// Finds a relaxation whose measured force is not 0 before the commanded position changes.
pub(super) fn off_at_rest(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let record = looked.record;
    let offset_m =
        offset_at_rest(&record.force_n, &record.position_m).filter(|_| !looked.experiment.fits_position_offset)?;
    let text = format!("the position is {} µm before the force first changes, not 0", um(offset_m));
    let advice = "write `zero = \"fit\"` in [measurement]";
    Some(found("zero_off", true, text, advice))
}

/// Least number of rows before the first switch of the force, and least motion that their force would cause, in noise standard deviations.
const ROWS_BEFORE: usize = 5;
const MOVES_NOISES: f64 = 10.0;
/// Largest part of this motion at which the body stands still, and largest difference of the last positions from the first, in noise standard deviations.
const STILL: f64 = 0.1;
const MOVED_NOISES: f64 = 4.0;

/// Finds a force before its first switch that does not move the body, although the same force moves it after the switch: the force has an offset.
pub(super) fn force_off_at_rest(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let record = looked.record;
    let first_n = record.force_n.first().copied().filter(|force_n| *force_n != 0.0)?;
    let steps = record.force_step_rows();
    let step = steps.iter().copied().find(|row| *row > 0).filter(|row| *row >= ROWS_BEFORE)?;
    let next_s =
        steps.iter().find(|row| **row > step).map(|row| record.time_s[*row]).or(record.time_s.last().copied())?;
    let at_s = record.time_s[step];
    let window_s = (at_s - record.time_s[0]).min(next_s - at_s);
    // Motion (m) from one time to another, by a line through the rows between.
    let moved_m = |[from_s, to_s]: [f64; 2]| {
        let rows = record.time_s.iter().zip(&record.position_m);
        let between = rows.filter(|(time, _)| (from_s..=to_s).contains(*time));
        let points: Vec<(f64, f64)> = between.filter_map(|(time, x)| Some((*time, (*x)?))).collect();
        let line = || MotionLine::through(points.iter().copied());
        (points.len() >= ROWS_BEFORE).then(|| line().slope_per_s * (to_s - from_s))
    };
    let [before_m, after_m] = [[at_s - window_s, at_s], [at_s, at_s + window_s]].map(moved_m);
    let expected_m = after_m? * first_n / (record.force_n[step] - first_n);
    let still_m = STILL * expected_m.abs();
    // A body that the force has moved since the first row may have come to rest. A row without a position stands for a load that began before the record.
    let first_m = record.position_m.first().copied().flatten()?;
    let last_m = median(record.position_m[step - ROWS_BEFORE..step].iter().flatten().copied().collect())?;
    let has_moved = (last_m - first_m).abs() > still_m.max(MOVED_NOISES * looked.noise_m);
    if expected_m.abs() < MOVES_NOISES * looked.noise_m || before_m?.abs() > still_m || has_moved {
        return None;
    }
    let text = format!(
        "a force of {} µN is recorded before the first switch, and the body stands still, although the next force moves it as if this one would move it by {} µm: the force has an offset or began long before, or the gel yields only above it",
        um(first_n),
        um(expected_m)
    );
    let advice =
        "subtract an offset from all forces of the table; of a force that acts, state when it began (`load_start_s`)";
    Some(found("force_off", false, text, advice))
}

/// Finds positions that were measured from the first row's position, whose noise then shifts all positions. The symptom is a first position of exactly 0, although the
/// noise is many times the resolution of the positions.
pub(super) fn is_a_row(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let noise_m = looked.noise_m;
    if looked.experiment.fits_position_offset || !is_zeroed_by_first_row(&looked.record.position_m, noise_m) {
        return None;
    }
    let text = format!(
        "the first position is exactly 0, and the noise is {} µm. If that row was subtracted from all others, they carry its noise, which shifts fitted \
         parameters by many standard errors",
        um(noise_m)
    );
    Some(found(
        "zero_is_a_row",
        false,
        text,
        "write `zero = \"fit\"` in [measurement], unless the zero is known by other means",
    ))
}

/// Finds a body that moves before any force acts.
pub(super) fn drifts_at_rest(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let record = looked.record;
    let n_rest = record.force_n.iter().take_while(|force| **force == 0.0).count();
    let rest: Vec<(f64, f64)> =
        (0..n_rest).filter_map(|row| Some((record.time_s[row], record.position_m[row]?))).collect();
    if rest.len() < REST_ROWS {
        return None;
    }
    let line = MotionLine::through(rest.iter().copied());
    let left: f64 = rest.iter().map(|point| line.excess(*point).powi(2)).sum();
    let (slope, error) = (line.slope_per_s, (left / (rest.len() as f64 - 2.0) / line.spread_s2).sqrt());
    let drift_m = slope * (rest[rest.len() - 1].0 - rest[0].0);
    if drift_m.abs() <= (DRIFT_NOISES * looked.noise_m).max(DRIFT_SHARE * looked.range_m)
        || slope.abs() <= DRIFT_ERRORS * error
    {
        return None;
    }
    let text = format!("the position drifts by {} µm at rest, before any force acts", um(drift_m));
    Some(found(
        "drift_at_rest",
        false,
        text,
        "look for a drift of the stage or the camera, or a force that is not switched off; `--with tracking-drift` or `--with force-bias` may describe it",
    ))
}

/// Time after a switch during which the elastic motion is measured, in median intervals.
const ROWS_AFTER: f64 = 5.0;
/// Largest distance of a row from the end of the time [`ROWS_AFTER`], as a fraction of this time, at which its position is used.
const NEAR: f64 = 0.3;
/// Smallest expected motion after the first row for which a start under load is checked, in noise standard deviations.
const SHOWS_NOISES: f64 = 10.0;
/// Largest ratio of measured to expected motion after the first row that counts as a start under load.
const SLOWER: f64 = 0.3;
/// Smallest change of force at another switch, as a fraction of the first row's force, that is used for comparison.
const ALIKE: f64 = 0.3;

/// Smallest part of the rise of a tip's force that the first row has where the approach is missing, and the least rise of an approach, divided by the largest force.
const PRESSED: f64 = 0.5;
const APPROACHES: f64 = 0.1;

/// Finds the record of a tip that is pressed in from its first row on: neither the zero of its depth nor the start of its load can be seen.
pub(super) fn approach_missing(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let force_n = &looked.record.force_n;
    let largest_n = force_n.iter().fold(0.0_f64, |most, force| most.max(force.abs()));
    let until_largest = &force_n[..=force_n.iter().position(|force| force.abs() == largest_n)?];
    let lowest_n = until_largest.iter().fold(largest_n, |least, force| least.min(force.abs()));
    let rise_n = largest_n - lowest_n;
    if rise_n > APPROACHES * largest_n && force_n[0].abs() - lowest_n < PRESSED * rise_n {
        return None;
    }
    let text = "the tip presses from the first row on: the approach is missing. The depth before that row is fitted, and the load counts from that row".to_string();
    let advice = "export the approach together with the hold; moduli may be far off without it";
    Some(found("approach_missing", false, text, advice))
}

/// Finds a record that begins while a load already acts. Its first rows creep slowly, whereas the same force makes a fast motion at other switches.
pub(super) fn starts_under_load(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let record = looked.record;
    let first_n = *record.force_n.first()?;
    if first_n.abs() < ALIKE * record.force_range_n() {
        return None;
    }
    let after_s = ROWS_AFTER * record.median_interval_s()?;
    // Motion (m) within `after_s` after a row, minus the motion within an equal time before it.
    let motion_m = |row: usize| {
        let at = |row: usize| record.position_m.get(row).copied().flatten();
        let near = |wanted_s: f64| {
            let after = record.time_s.partition_point(|time_s| *time_s < wanted_s);
            let rows = [after.checked_sub(1), Some(after)].into_iter().flatten().filter(|row| at(*row).is_some());
            let distance_s = |row: &usize| (record.time_s[*row] - wanted_s).abs();
            rows.min_by(|a, b| distance_s(a).total_cmp(&distance_s(b))).filter(|row| distance_s(row) < NEAR * after_s)
        };
        let (here_s, here_m) = (record.time_s[row], at(row)?);
        let before_m = if row == 0 { 0.0 } else { here_m - at(near(here_s - after_s)?)? };
        Some(at(near(here_s + after_s)?)? - here_m - before_m)
    };
    let switched_n = |row: usize| record.force_n[row] - record.previous_force_n(row);
    let steps = record.force_step_rows();
    let alike = steps.iter().filter(|row| **row > 0 && switched_n(**row).abs() > ALIKE * first_n.abs());
    let others: Vec<f64> = alike.filter_map(|row| Some(motion_m(*row)? / switched_n(*row))).collect();
    let other_m_per_n = record::robust::median(others)?;
    let expected_m = other_m_per_n * first_n;
    let found_m = motion_m(0)?;
    if expected_m.abs() < (SHOWS_NOISES * looked.noise_m).max(1e-3 * looked.range_m) || found_m / expected_m > SLOWER {
        return None;
    }
    let text = format!(
        "the record starts under load: {} µN act from the first row on, and the body moves by {} µm in the first {} s, whereas other switches move it by {} µm",
        um(first_n),
        um(found_m),
        format_significant(after_s, 2),
        um(expected_m)
    );
    let advice = "state when the first force began, in s of the table's time: `load_start_s = -3.0` in [measurement] if that was 3 s before time 0; or begin the table before the load";
    Some(found("starts_under_load", true, text, advice))
}
