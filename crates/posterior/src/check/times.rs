//! Checks of the time unit and of the sampling density.

use super::{CheckContext, found, um};
use documents::check::Contradiction;
use figures::number::format_significant;
use record::Apparatus;

/// Shortest and longest sampling interval (s) of a camera that tracks a robot.
const CAMERA_S: [f64; 2] = [5e-4, 8.0];
/// Shortest and longest sampling interval (s) of an instrument other than a camera.
const INSTRUMENT_S: [f64; 2] = [1e-7, 3600.0];
/// Smallest number of rows per retardation time that causes no warning.
const ROWS: f64 = 1.5;
/// Smallest retarded motion for which the number of rows is checked, in noise standard deviations.
const NOISES: f64 = 6.0;

/// Finds a median sampling interval that the instrument cannot have.
pub(super) fn units(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let interval_s = looked.record.median_interval_s()?;
    let [shortest_s, longest_s] = match looked.experiment.apparatus {
        Apparatus::Robot { .. } => CAMERA_S,
        Apparatus::Instrument { .. } | Apparatus::Indenter(_) => INSTRUMENT_S,
    };
    if (shortest_s..=longest_s).contains(&interval_s) {
        return None;
    }
    let text = format!("rows are {} s apart, which is unusual for this apparatus", format_significant(interval_s, 3));
    Some(found("time_unit", false, text, "check the unit of the time: seconds and milliseconds may be confused"))
}

/// Finds a retarded motion that ends within too few rows to determine its viscosity.
pub(super) fn few_rows(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let fit = looked.fit.as_ref()?;
    let interval_s = looked.record.median_interval_s()?;
    let rows = 1.0 / (fit.rate_per_s * interval_s);
    if rows >= ROWS || fit.retarded_m < NOISES * looked.noise_m.max(fit.left_sd_m) {
        return None;
    }
    let text = format!(
        "the elastic motion ends within about {} rows ({} s), so its viscosity is poorly determined",
        format_significant(rows, 2),
        format_significant(1.0 / fit.rate_per_s, 2)
    );
    Some(found("few_rows_in_a_retardation_time", false, text, "sample faster right after every switch of the force"))
}

/// Smallest ratio of an interval without rows to the neighbouring intervals at which it counts as a gap.
const GAP: f64 = 10.0;
/// Smallest length of a gap, in median intervals. This limit is necessary because rows may be dense after a switch.
const LONG: f64 = 3.0;
/// Largest number of gaps that a message lists.
const LISTED: usize = 4;
/// Smallest jump of the position over a gap that is reported, in noise standard deviations.
const JUMP_NOISES: f64 = 6.0;

/// Finds gaps without rows, in which the program assumes that the force of the last row acts.
pub(super) fn gaps(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let record = looked.record;
    let median_s = record.median_interval_s()?;
    let interval_s = |row: usize| record.time_s[row + 1] - record.time_s[row];
    let n_intervals = record.n_rows().saturating_sub(1);
    // A row without a position only gives the force, so it does not end a gap.
    let is_sample = |row: usize| record.position_m[row].is_some();
    let is_gap = |row: usize| {
        if !is_sample(row) || !is_sample(row + 1) {
            return false;
        }
        let around = [row.checked_sub(1), Some(row + 1).filter(|next| *next < n_intervals)];
        let longest_s = around.into_iter().flatten().map(interval_s).fold(0.0, f64::max);
        longest_s > 0.0 && interval_s(row) > GAP * longest_s && interval_s(row) > LONG * median_s
    };
    let gaps: Vec<usize> = (0..n_intervals).filter(|row| is_gap(*row)).collect();
    let said = gaps.iter().take(LISTED).map(|&row| {
        let jump_m = record.position_m[row].zip(record.position_m[row + 1]).map_or(0.0, |(a, b)| b - a);
        let jump = if jump_m.abs() > JUMP_NOISES * looked.noise_m {
            format!(", over which the position jumps by {} µm", um(jump_m))
        } else {
            String::new()
        };
        format!(
            "from {} to {} s ({} sampling intervals; {} µN is assumed to act){jump}",
            format_significant(record.time_s[row], 4),
            format_significant(record.time_s[row + 1], 4),
            format_significant(interval_s(row) / median_s, 3),
            format_significant(1e6 * record.force_n[row], 3)
        )
    });
    let said: Vec<String> = said.collect();
    let more = gaps.len().saturating_sub(LISTED);
    let more = if more > 0 { format!(", and {more} more") } else { String::new() };
    (!gaps.is_empty()).then(|| {
        let text = format!("the record has no rows {}{more}", said.join("; "));
        let advice = "add rows with the force during the gap and an empty position; if the force is unknown, make a separate experiment of each part";
        found("gap", false, text, advice)
    })
}
