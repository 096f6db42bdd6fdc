//! Whether the force switched where the rows say.

use super::{Looked, found, um};
use documents::check::Contradiction;
use record::Line;

/// Positions before a switch that are drawn out to it, after as many that are drawn out to the row before.
const BEFORE: usize = 4;
/// Rows among which they are looked for: some positions are lost.
const WITHIN: usize = 8;
/// Steps that are needed.
const STEPS: usize = 2;
/// Excess of the motion in its standard errors and in noise.
const ERRORS: f64 = 5.0;
const NOISES: f64 = 2.0;

/// What a row's position exceeds the line through the four before it by; `None` where too many are lost.
fn excess_m(looked: &Looked<'_>, row: usize) -> Option<f64> {
    let record = looked.record;
    let before = (row.saturating_sub(WITHIN)..row).rev();
    let known = before.filter_map(|row| Some((record.time_s[row], record.position_m[row]?)));
    let points: Vec<(f64, f64)> = known.take(BEFORE).collect();
    if points.len() < BEFORE {
        return None;
    }
    Some(Line::through(points.iter().copied()).excess((record.time_s[row], record.position_m[row]?)))
}

/// Positions that have moved already at the row in which a switch is stated: a row's position is the limit from the left.
pub(super) fn between_rows(looked: &Looked<'_>) -> Option<Contradiction> {
    let record = looked.record;
    let excesses: Vec<f64> = record
        .force_step_rows()
        .into_iter()
        .filter(|row| *row > WITHIN)
        .filter_map(|row| {
            let is_held = (row - WITHIN - 1..row).all(|before| record.force_n[before] == record.force_n[row - 1]);
            let sign = (record.force_n[row] - record.force_n[row - 1]).signum();
            // What the position before exceeds its own line by is curvature, which the force has no part in.
            let before = (row - WITHIN..row).rev().find(|before| record.position_m[*before].is_some())?;
            is_held.then_some(sign * (excess_m(looked, row)? - excess_m(looked, before)?))
        })
        .collect();
    if excesses.len() < STEPS {
        return None;
    }
    let mut sorted = excesses.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    // The median is not moved by an outlier or by a single switch that came in time.
    let middle_m = sorted[(sorted.len() - 1) / 2];
    let noise_m = looked.noise_m;
    // The excess of a line through four, less that of the row before, weighs six positions by 1, −2, ½, ½, ½ and −½: √6 standard deviations of one; the median of n of them, 1.25/√n of that.
    let error_m = 1.25 * 6.0_f64.sqrt() * noise_m / (excesses.len() as f64).sqrt();
    if middle_m <= (ERRORS * error_m).max(NOISES * noise_m) || middle_m <= 1e-3 * looked.range_m {
        return None;
    }
    let text = format!(
        "at {} steps of the force the position has moved by about {} µm already in the row where the step is stated: the force switched between two rows",
        excesses.len(),
        um(middle_m)
    );
    let advice = "give every switch a row of its own, at its time, with the new force and an empty position";
    Some(found("switch_between_rows", true, text, advice))
}
