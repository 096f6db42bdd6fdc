//! Checks of the force between rows, and of the sign of the response to the force.

use super::quick_fit::{curve_beyond_lines, distance_between_rules_m};
use super::{CheckContext, found, um};
use documents::check::Contradiction;
use record::{ForceRule, has_noisy_levels, is_work_negative, sampled_ramps};

/// Smallest fraction of rows at which a force must change to count as continuous instead of switched.
const MOST: f64 = 0.5;
/// Largest change of a force, as a fraction of its range, that counts as no change.
const NOTHING: f64 = 1e-6;
/// Largest difference between the positions under a held and under a linearly interpolated force that is ignored, as a fraction of the noise standard deviation.
const MATTERS: f64 = 1.0 / 3.0;
/// Smallest fraction of the fitted motion's work that must be against the force, so that the response counts as opposite to the force.
const CLEARLY: f64 = 0.5;
/// Smallest fraction of the positions' variance that the fitted motion must explain, so that the direction of the response is judged.
const EXPLAINED: f64 = 0.3;

/// Finds a force that changes in most of the rows, or has sampled ramps, if the description does not state whether it holds or changes linearly between rows.
/// The first is an error, the second a warning, if the choice biases a fitted parameter by its standard error.
pub(super) fn between_rows(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let record = looked.record;
    if looked.understood.force_rule_given || record.force_rule != ForceRule::Hold {
        return None;
    }
    let least_n = NOTHING * record.force_range_n();
    let n_changes = record.force_n.windows(2).filter(|pair| (pair[1] - pair[0]).abs() > least_n).count();
    let is_mostly = n_changes as f64 >= MOST * record.n_rows() as f64;
    if !is_mostly && sampled_ramps(&record.force_n).is_empty() {
        return None;
    }
    let fit = looked.fit.as_ref()?;
    let apart_m = distance_between_rules_m(record, fit);
    let n_positions = record.position_m[..fit.motion_m.len()].iter().flatten().count();
    let matters = if is_mostly { MATTERS } else { 1.0 / (n_positions as f64).sqrt() };
    if apart_m <= matters * looked.noise_m.min(fit.left_sd_m.max(0.1 * looked.noise_m)) {
        return None;
    }
    let text = format!(
        "the force changes at {n_changes} of {} rows, and the description does not say whether it holds between them or is linear. The choice moves the \
         positions by {} µm (root mean square); the noise is {} µm",
        record.n_rows(),
        um(apart_m),
        um(looked.noise_m)
    );
    let advice = if has_noisy_levels(&record.force_n) {
        "write `force = \"levels\"` in [measurement]: the force scatters around the levels between which it was switched, like a sensor's signal"
    } else {
        "write `force = \"linear\"` in [measurement] if the force is a sampled curve, and add a row just before each jump, with the old force and an empty position; write \
         `force = \"hold\"` if it was switched at every row"
    };
    Some(found("force_between_rows", is_mostly, text, advice))
}

/// Finds a curved force that straight lines between rows approximate badly. The check reports a shift of the positions that biases a fitted parameter by its standard
/// error. This shift is smaller than the noise of one position, because it is common to all positions.
pub(super) fn curved(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let (record, fit) = (looked.record, looked.fit.as_ref()?);
    if record.force_rule != ForceRule::Linear || looked.noise_m == 0.0 {
        return None;
    }
    let [beyond_n, moved_m] = curve_beyond_lines(record, fit);
    let n_positions = record.position_m[..fit.motion_m.len()].iter().flatten().count();
    if moved_m * (n_positions as f64).sqrt() <= looked.noise_m {
        return None;
    }
    let text = format!(
        "the force curves between its rows: straight lines differ from the curve by {} µN and move the positions by {} µm (both root mean squares). This is \
         enough to bias a fit by its own standard error",
        um(beyond_n),
        um(moved_m)
    );
    Some(found(
        "curve_between_rows",
        false,
        text,
        "give the force in more rows than the positions, in a separate log in [actuation]",
    ))
}

/// Finds a motion in the direction opposite to the force. This is impossible, because a passive body can only take up work.
pub(super) fn against(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let fit = looked.fit.as_ref().filter(|fit| fit.explained > EXPLAINED)?;
    let motion_m: Vec<Option<f64>> = fit.motion_m.iter().copied().map(Some).collect();
    if !is_work_negative(&looked.record.force_n, &motion_m, CLEARLY) {
        return None;
    }
    let text = "the position moves against the force, so the body would give work instead of taking it up".to_string();
    let advice = if looked.understood.settled.is_reversed {
        "remove `direction = \"-\"` in [measurement], which reversed the sign, or write `direction = \"fit\"`"
    } else {
        "write `direction = \"-\"` in [measurement], or `direction = \"fit\"`"
    };
    Some(found("against_force", true, text, advice))
}
