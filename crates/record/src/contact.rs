//! Reduction of an indenter's record to the rows with growing contact, and subtraction of the force before contact (physics §5.1).
//!
//! The law of Lee and Radok, depth^p ∝ ∫J dF for a tip of exponent p, requires a growing contact. Before contact no load acts on the gel; while the
//! depth decreases, another law holds. The record therefore starts at the last row at which the tip is still free, and ends at the largest depth
//! before the depth decreases.

use std::ops::Range;
use std::path::Path;

use super::indenter::Indenter;
use super::line::MotionLine;
use super::noise::SD_PER_MAD;
use super::notes::Note;
use super::robust::median;
use super::trajectory::Trajectory;
use base::error::{Error, InputPlace, Result};

/// Fraction of the largest force above which the tip is certainly in contact. In earlier rows the tip may be free.
const CERTAIN_CONTACT_FRACTION: f64 = 0.05;
/// Fraction of the rows before the certain contact from which the force on a free tip is estimated. In the rest of these rows the tip may already
/// touch.
const FREE_PART: f64 = 0.8;
/// Smallest number of rows from which the force on a free tip is estimated.
const MIN_FREE_ROWS: usize = 16;
/// Largest drift of the force on a free tip, as a fraction of the force at which contact is certain. If the force grows by more, the tip presses from
/// the first row on.
const FREE_DRIFT: f64 = 0.3;
/// Fraction of the largest force below which positions are not compared with the model, because another law holds at the onset of contact.
const TOUCHING: f64 = 0.02;
/// Multiple of the force's noise standard deviation below which positions are not compared with the model.
const TOUCHING_SD: f64 = 10.0;
/// The tip counts as touching if the mean force of `N_MEAN` neighbouring rows exceeds the force on a free tip by more than `FREE_SD` standard errors.
const N_MEAN: usize = 5;
const FREE_SD: f64 = 3.0;
/// The record ends at the largest depth after which the depth decreases. A decrease is a depth below the maximum by the fraction `FALL` of the
/// depth's range, and by `FALL_SD` standard deviations of its noise, in `N_FALLING` consecutive rows.
const FALL: f64 = 0.01;
const FALL_SD: f64 = 6.0;
const N_FALLING: usize = 5;
/// Number of rows whose mean depth shows the end of a noisy growth.
const N_LEVEL: usize = 9;

/// Force on a tip that does not touch the gel.
struct FreeForce {
    /// Force at the row where contact begins, in N.
    force_n: f64,
    /// Error of `force_n` in N: its difference from the mean force in the last quarter of the rows from which it is estimated.
    error_n: f64,
    /// Standard deviation of the force's noise, in N.
    sd_n: f64,
    /// Index of the last row at which the tip is free.
    last_row: usize,
}

/// Reduces a trajectory to the rows with a growing contact, and returns a note on them. The force on the free tip is subtracted from the forces, and
/// positions count from the start of the reduced record.
///
/// # Errors
/// [`Error::Input`] if the tip is not pressed in, if the position does not follow the force, or if too few rows remain.
pub(super) fn trim_to_contact(file: &Path, trajectory: &mut Trajectory, indenter: &Indenter) -> Result<Note> {
    let refuse = |row: usize, key: &str, found: String, remedy: &str| {
        let line = trajectory.lines.get(row).copied().unwrap_or(1);
        Err(Error::input(InputPlace::file(file).at_line(line).at_key(key), found, remedy))
    };
    let n_rows = trajectory.time_s.len();
    let free = free_force(&trajectory.time_s, &trajectory.force_n);
    let start = free.as_ref().map_or(0, |free| free.last_row);
    let free_n = free.as_ref().map_or(0.0, |free| free.force_n);
    let pressing_n: Vec<f64> = trajectory.force_n.iter().map(|force| force - free_n).collect();
    let (largest_n, most_pulling_n) =
        pressing_n.iter().fold((0.0_f64, 0.0_f64), |(most, least), force| (most.max(*force), least.max(-force)));
    if largest_n <= 0.0 || (free.is_none() && most_pulling_n > 2.0 * largest_n) {
        return refuse(
            0,
            &trajectory.force_column,
            "no force presses the tip into the gel".into(),
            "change the force's sign so that it grows when the tip is pressed in",
        );
    }
    let deflection_m = |row: usize| indenter.cantilever_n_per_m.map_or(0.0, |stiffness| pressing_n[row] / stiffness);
    let tip_m: Vec<Option<f64>> =
        (0..n_rows).map(|row| trajectory.position_m[row].map(|x| x - deflection_m(row))).collect();
    let touching_n = (TOUCHING * largest_n).max(TOUCHING_SD * free.as_ref().map_or(0.0, |free| free.sd_n));
    let peak = (start..n_rows).max_by(|a, b| pressing_n[*a].total_cmp(&pressing_n[*b])).unwrap_or(start);
    let compared = (start..peak).rev().find(|row| pressing_n[*row] < touching_n).map_or(start, |row| row + 1);
    let Some(origin_m) = tip_m[start..].iter().flatten().next().copied() else {
        return refuse(
            start,
            &trajectory.position_column,
            "no position remains after contact begins".into(),
            LOST_REMEDY,
        );
    };
    let at_peak_m = tip_m[..=peak].iter().rev().flatten().next().copied().unwrap_or(origin_m);
    let moved_um = 1e6 * (at_peak_m - origin_m);
    let deflection_um = 1e6 * deflection_m(peak);
    let recorded_um = moved_um + deflection_um;
    if let Some(stiffness) = indenter.cantilever_n_per_m.filter(|_| moved_um < 0.0 && recorded_um > 0.0) {
        let found = format!(
            "the position grows by {recorded_um:.4} µm with the force, less than the deflection of {deflection_um:.4} µm of a spring of {stiffness} N/m"
        );
        let remedy = "correct `cantilever_n_per_m`, or leave it out if the column is the position of the tip itself";
        return refuse(peak, &trajectory.position_column, found, remedy);
    }
    if at_peak_m < origin_m {
        return refuse(
            peak,
            &trajectory.position_column,
            format!("the position falls by {:.4} µm while the force grows", -recorded_um),
            "write `direction = \"-\"` in [measurement] if the column is a height that falls as the tip goes in (this needs [measurement.columns]), or give the depth",
        );
    }
    let end = end_of_growth(&tip_m, compared);
    let kept = start..end;
    let n_compared = tip_m[compared.min(end)..end].iter().flatten().count();
    if n_compared < 2 * MIN_FREE_ROWS {
        return refuse(
            start,
            &trajectory.position_column,
            format!(
                "only {n_compared} positions lie between the start of the contact and its largest depth, too few for a fit"
            ),
            "give the approach and the hold of one indentation; rows before contact and rows with falling depth are not used",
        );
    }
    let note = Note::Contact {
        from_s: trajectory.time_s[start],
        to_s: trajectory.time_s[end - 1],
        compared_from_s: trajectory.time_s[compared],
        n_before: start,
        n_after: n_rows - end,
        free_n: free.as_ref().map(|free| [free.force_n, free.error_n]),
    };
    trajectory.force_n = pressing_n;
    trajectory.position_m =
        tip_m.iter().enumerate().map(|(row, x)| x.map(|x| x - origin_m).filter(|_| row >= compared)).collect();
    keep(trajectory, kept);
    Ok(note)
}

const LOST_REMEDY: &str = "give the positions of the tip while it is pressed in";

/// Estimates the force on a free tip as a straight line through the rows before contact, because optical levers drift. The result holds the line's
/// value at the last row with a free tip. It is `None` if the record begins in contact; the forces are then used unchanged.
fn free_force(time_s: &[f64], force_n: &[f64]) -> Option<FreeForce> {
    let first_n = median(force_n.iter().take(MIN_FREE_ROWS).copied().collect())?;
    let largest_n = force_n.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sure = force_n.iter().position(|force| force - first_n > CERTAIN_CONTACT_FRACTION * (largest_n - first_n))?;
    let n_free = (FREE_PART * sure as f64) as usize;
    if n_free < MIN_FREE_ROWS {
        return None;
    }
    let steps = force_n[..n_free].windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let sd_n = SD_PER_MAD / 2.0_f64.sqrt() * median(steps)?;
    let line = MotionLine::through(time_s.iter().copied().zip(force_n.iter().copied()).take(n_free));
    let drift_n = line.slope_per_s.abs() * (time_s[sure] - time_s[0]);
    if drift_n > FREE_DRIFT * CERTAIN_CONTACT_FRACTION * (largest_n - first_n) {
        return None;
    }
    let mean_error_n = sd_n / (N_MEAN as f64).sqrt();
    // The last row at which the tip is free is searched backwards from the first row with certain contact.
    let is_free = |row: &usize| {
        let window = row.saturating_sub(N_MEAN / 2)..(row + N_MEAN / 2 + 1).min(force_n.len());
        let excess_n = window.clone().map(|row| force_n[row] - line.at(time_s[row])).sum::<f64>() / window.len() as f64;
        excess_n <= FREE_SD * mean_error_n
    };
    let last_row = (n_free - 1..sure).rev().find(is_free).unwrap_or(n_free - 1);
    let late = &force_n[n_free - n_free / 4..n_free];
    let late_n = late.iter().sum::<f64>() / late.len() as f64;
    let at_contact_n = line.at(time_s[last_row]);
    Some(FreeForce { force_n: at_contact_n, error_n: (at_contact_n - late_n).abs(), sd_n, last_row })
}

/// Returns the index of the row after the largest depth that precedes a decrease of the depth. The search starts at row `from`.
fn end_of_growth(tip_m: &[Option<f64>], from: usize) -> usize {
    let depths: Vec<(usize, f64)> =
        tip_m.iter().enumerate().skip(from).filter_map(|(row, x)| Some((row, (*x)?))).collect();
    let (lowest_m, highest_m) =
        depths.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (_, x)| (low.min(*x), high.max(*x)));
    // Second differences leave the noise of a smooth growth.
    let bends = depths.windows(3).map(|three| (three[0].1 - 2.0 * three[1].1 + three[2].1).abs()).collect();
    let sd_m = SD_PER_MAD / 6.0_f64.sqrt() * median(bends).unwrap_or(0.0);
    let fall_m = (FALL * (highest_m - lowest_m)).max(FALL_SD * sd_m);
    let (mut deepest, mut deepest_m, mut n_falling) = (from, f64::NEG_INFINITY, 0);
    for (place, &(row, x)) in depths.iter().enumerate() {
        if x >= deepest_m {
            (deepest, deepest_m) = (row, x);
        }
        n_falling = if x < deepest_m - fall_m { n_falling + 1 } else { 0 };
        if n_falling == N_FALLING {
            return end_of_level(&depths[..=place - N_FALLING], sd_m).max(deepest + 1);
        }
    }
    tip_m.len()
}

/// Returns the index of the row after the last one in whose neighbourhood the mean depth is the largest within its error. `depths` are row indices with depths (m) before a
/// decrease, with noise of standard deviation `sd_m`: the largest single depth may stand anywhere in a hold.
fn end_of_level(depths: &[(usize, f64)], sd_m: f64) -> usize {
    let n = N_LEVEL.min(depths.len());
    let mean_m = |window: &[(usize, f64)]| window.iter().map(|(_, x)| x).sum::<f64>() / n as f64;
    let means_m: Vec<f64> = depths.windows(n).map(mean_m).collect();
    let largest_m = means_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let error_m = FREE_SD * sd_m / (n as f64).sqrt();
    let last = means_m.iter().rposition(|mean| *mean >= largest_m - error_m).unwrap_or(0);
    depths[last + n / 2].0 + 1
}

fn keep(trajectory: &mut Trajectory, rows: Range<usize>) {
    fn only<T: Clone>(values: &mut Vec<T>, rows: &Range<usize>) {
        *values = values[rows.clone()].to_vec();
    }
    only(&mut trajectory.time_s, &rows);
    only(&mut trajectory.force_n, &rows);
    only(&mut trajectory.position_m, &rows);
    only(&mut trajectory.lines, &rows);
    if let Some(cycle) = &mut trajectory.cycle {
        only(cycle, &rows);
    }
}

#[cfg(test)]
#[path = "contact_tests.rs"]
mod tests;
