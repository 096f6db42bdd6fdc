//! What the force does between rows, and whether the answer goes with it.

use super::quick_fit::{curve_beyond_lines, distance_between_rules_m};
use super::{Looked, found, um};
use documents::check::Contradiction;
use record::{ForceRule, has_noisy_levels, is_against};

/// Share of the rows at which a force changes that is not switched.
const MOST: f64 = 0.5;
/// Share of the force's range below which it does not change.
const NOTHING: f64 = 1e-6;
/// Share of the noise that the choice may move the positions by.
const MATTERS: f64 = 1.0 / 3.0;
/// Share of its size that a fitted motion's work must have against the force, and of the variance that the motion must explain.
const CLEARLY: f64 = 0.5;
const EXPLAINED: f64 = 0.3;

/// A force that changes in most rows, where nothing says whether it holds between them.
pub(super) fn between_rows(looked: &Looked<'_>) -> Option<Contradiction> {
    let record = looked.record;
    if looked.understood.force_rule_given || record.force_rule != ForceRule::Hold {
        return None;
    }
    let least_n = NOTHING * record.force_range_n();
    let n_changes = record.force_n.windows(2).filter(|pair| (pair[1] - pair[0]).abs() > least_n).count();
    if (n_changes as f64) < MOST * record.n_rows() as f64 {
        return None;
    }
    let fit = looked.fit.as_ref()?;
    let apart_m = distance_between_rules_m(record, fit);
    if apart_m <= MATTERS * looked.noise_m.min(fit.left_sd_m.max(0.1 * looked.noise_m)) {
        return None;
    }
    let text = format!(
        "the force changes at {n_changes} of {} rows; whether it holds between them or goes in lines moves the positions by {} µm (root mean square), at {} µm of noise",
        record.n_rows(),
        um(apart_m),
        um(looked.noise_m)
    );
    let advice = if has_noisy_levels(&record.force_n) {
        "write `force = \"levels\"` in [measurement]: the force scatters about levels between which it was switched, as a sensor shows it"
    } else {
        "write `force = \"linear\"` in [measurement] if the force is a sampled curve, `force = \"hold\"` if it was switched at every row"
    };
    Some(found("force_between_rows", true, text, advice))
}

/// Lines that lie so far inside a curve that a fitted parameter may be off by its own standard error: what all positions share counts more than one's noise.
pub(super) fn curved(looked: &Looked<'_>) -> Option<Contradiction> {
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
        "the force bends between its rows: lines lie inside the curve by {} µN, which moves the positions by {} µm (both root mean squares), enough to bias a fit by its own standard error",
        um(beyond_n),
        um(moved_m)
    );
    Some(found(
        "curve_between_rows",
        false,
        text,
        "give the force in more rows than the positions, by a log of its own in [actuation]",
    ))
}

/// An answer that goes against the force: a passive body takes work up.
pub(super) fn against(looked: &Looked<'_>) -> Option<Contradiction> {
    let fit = looked.fit.as_ref().filter(|fit| fit.explained > EXPLAINED)?;
    let motion_m: Vec<Option<f64>> = fit.motion_m.iter().copied().map(Some).collect();
    if !is_against(&looked.record.force_n, &motion_m, CLEARLY) {
        return None;
    }
    let text = "the position goes against the force: it would give work instead of taking it up".to_string();
    let advice = if looked.understood.settled.is_reversed {
        "remove `direction = \"-\"` in [measurement], which turned the sign, or write `direction = \"fit\"`"
    } else {
        "write `direction = \"-\"` in [measurement], or `direction = \"fit\"`"
    };
    Some(found("against_force", true, text, advice))
}
