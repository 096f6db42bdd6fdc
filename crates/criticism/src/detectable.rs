//! The smallest size of each effect that an experiment can show, and the effects that it cannot show.
//!
//! Noise-free data are simulated with an effect of some size. The effect is visible if the distance of the base model's best fit from these data reaches the threshold of
//! detection ([`super::separation`]). The tested sizes lie in the range of the prior. Both signs and all grid points of unidentified parameters are tried, and the most
//! visible of them counts.

use rayon::prelude::*;

use super::separation::{FirstOrderResidual, RivalFit, RivalTruth, fit_rival, over_grid};
use super::{Candidate, Fitted, Subject};
use base::error::{Error, Result};

/// Prior probability beyond either end of the range of tested sizes.
pub(super) const RANGE_TAIL: f64 = 0.005;
/// Number of sizes tested to first order, each half of the previous one.
const N_HALVINGS: i32 = 16;
/// Number of halvings of the largest size after which an effect's signature counts as its signature at the null.
const SMALL: usize = 5;
/// Largest number of search directions (each a sign and a grid point) whose smallest visible sizes are computed by refits.
const MOST_WAYS: usize = 3;
const MOST_REFITS: usize = 12;
/// Relative accuracy of the smallest size: its distance exceeds the threshold by at most this fraction.
const TOLERANCE: f64 = 0.01;
/// Limit of a blind spot's largest distance, in standard deviations of the noise. An effect without a visible size is a blind spot if its largest distance is below this limit,
/// or if its visible fraction is below `BLIND_FRACTION`.
const BLIND_SIGMA: f64 = 1.0;
const BLIND_FRACTION: f64 = 1e-3;

/// Detectability of an effect in an experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Detectability {
    /// Slug of the effect.
    pub effect: String,
    /// Smallest visible value of the effect's first parameter, in its unit; `None` if no value in the prior's range is visible.
    pub smallest: Option<f64>,
    /// Distance (σ) of the base model's best fit from data with the largest size in the prior's range.
    pub largest_distance: f64,
    /// Fraction of the effect's whitened signature, in squared norm, that the base model cannot absorb at small sizes. It is the largest over signs and grid points.
    pub visible_fraction: f64,
}

impl Detectability {
    /// Returns whether the experiment hardly shows the effect at any size.
    pub fn is_blind_spot(&self) -> bool {
        // An effect that is visible at some size is no blind spot, even if small sizes leave no residual.
        self.smallest.is_none() && (self.largest_distance < BLIND_SIGMA || self.visible_fraction < BLIND_FRACTION)
    }
}

/// Returns the detectability of every effect that can be added to the base model, in the order of the library. `base` is the base model at its fit, `threshold_sigma` the
/// distance (σ) from which an effect is visible.
///
/// # Errors
/// Errors of building a model with an effect, except for effects that cannot be added.
pub fn find_smallest_detectable(
    subject: &Subject,
    base: (&Candidate, &Fitted),
    threshold_sigma: f64,
) -> Result<Vec<Detectability>> {
    let names = base.0.effects.get(subject.specification().effects.len()..).unwrap_or(&[]);
    let of = |effect: &&'static dyn models::effects::Effect| -> Result<Option<Detectability>> {
        let slugs: Vec<&str> = names.iter().map(String::as_str).chain([effect.slug()]).collect();
        match subject.extended(&slugs) {
            // Effects that cannot be computed at any size are left out, like effects that cannot be added.
            Ok(extended) => match of_effect(subject, base, &extended, threshold_sigma) {
                Err(Error::Numerical { .. }) => Ok(None),
                other => other,
            },
            Err(Error::Input { .. }) => Ok(None),
            Err(other) => Err(other),
        }
    };
    let list: Result<Vec<Option<Detectability>>> = subject.library().effects().par_iter().map(of).collect();
    Ok(list?.into_iter().flatten().collect())
}

/// A direction in which an effect grows: a sign and a grid point of its unidentified parameters. Its sizes are tested from the largest to the smallest.
struct SearchDirection {
    /// Coordinates of the candidate at the null of the effect.
    null: Vec<f64>,
    /// Largest step of the size's coordinate from the null, with its sign.
    end: f64,
    /// First-order residual of each size, the largest size first; `None` if the model has no solution there.
    seen: Vec<Option<FirstOrderResidual>>,
}

impl SearchDirection {
    fn step(&self, halvings: usize) -> f64 {
        self.end * 0.5_f64.powi(halvings as i32)
    }

    /// Largest step at which the model has a solution, and its first-order distance (σ).
    fn largest(&self) -> Option<(f64, f64)> {
        let place = self.seen.iter().position(Option::is_some)?;
        Some((self.step(place), self.seen[place].as_ref()?.squared.max(0.0).sqrt()))
    }

    /// Size of the step at which the first-order distance crosses a threshold (σ); `None` if no size reaches it.
    fn crossing(&self, threshold: f64) -> Option<f64> {
        let of = |seen: &Option<FirstOrderResidual>| seen.as_ref().map(|seen| seen.squared.max(0.0).sqrt());
        let place = (0..self.seen.len()).rev().find(|k| of(&self.seen[*k]).is_some_and(|d| d >= threshold))?;
        let above = of(&self.seen[place])?;
        Some(self.step(place).abs() * (threshold / above).max(0.5))
    }
}

/// Detectability of the last effect of a candidate; `None` if the effect's size is fixed.
fn of_effect(
    subject: &Subject,
    base: (&Candidate, &Fitted),
    extended: &Candidate,
    threshold: f64,
) -> Result<Option<Detectability>> {
    let Some(last) = extended.effects.len().checked_sub(1) else { return Ok(None) };
    let is_size = |free: &super::Free| free.effect == Some(last) && free.null.is_some();
    // An effect whose size is fixed is skipped.
    let Some(place) = extended.free.iter().position(is_size) else { return Ok(None) };
    let mut ways = ways(subject, base, extended, last, place);
    let refit = |way: &SearchDirection, step: f64| of_step(subject, base, extended, (way, place, step));
    let largest = |way: &SearchDirection| way.largest().map_or(0.0, |(_, distance)| distance);
    ways.sort_by(|a, b| largest(b).total_cmp(&largest(a)));
    let mut found = Detectability {
        effect: extended.effects[last].clone(),
        smallest: None,
        largest_distance: 0.0,
        visible_fraction: ways
            .iter()
            .flat_map(|way| way.seen.iter().skip(SMALL).flatten())
            .map(FirstOrderResidual::fraction)
            .fold(0.0, f64::max),
    };
    let Some((end, _)) = ways.first().and_then(SearchDirection::largest) else { return Ok(Some(found)) };
    found.largest_distance = refit(&ways[0], end)?;
    if found.largest_distance < threshold {
        return Ok(Some(found));
    }
    // The direction with the largest distance is tried last, so that its largest size is used if no other direction is visible.
    let guess = |way: &SearchDirection| way.crossing(threshold).unwrap_or(f64::INFINITY);
    let mut order: Vec<usize> = (0..ways.len()).filter(|k| guess(&ways[*k]).is_finite()).collect();
    order.sort_by(|a, b| guess(&ways[*a]).total_cmp(&guess(&ways[*b])));
    order.truncate(MOST_WAYS);
    for k in order.into_iter().chain([0]) {
        let way = &ways[k];
        if let Some(step) = smallest_step(way, guess(way), threshold, &refit)? {
            found.smallest = Some(extended.free[place].value(way.null[place] + step));
            break;
        }
    }
    Ok(Some(found))
}

fn ways(
    subject: &Subject,
    base: (&Candidate, &Fitted),
    extended: &Candidate,
    effect: usize,
    place: usize,
) -> Vec<SearchDirection> {
    let (candidate, fitted) = base;
    let null = extended.embed(candidate, &fitted.theta);
    let truth = RivalTruth { candidate, theta: &fitted.theta, noise: fitted.noise, position_m: &fitted.position_m };
    let imitation = RivalFit::new(subject, extended, &truth);
    let free = &extended.free[place];
    let mut ways = Vec::new();
    for null in over_grid(extended, effect, &null) {
        for probability in [RANGE_TAIL, 1.0 - RANGE_TAIL] {
            let end = free.quantile(probability) - null[place];
            // A one-sided prior has one end slightly beyond the null: that direction is skipped.
            let is_outward = (end > 0.0) == (probability > 0.5);
            if end != 0.0 && is_outward {
                let at = |halvings: i32| {
                    let mut theta = null.clone();
                    theta[place] += end * 0.5_f64.powi(halvings);
                    theta
                };
                let points: Vec<Vec<f64>> = (0..N_HALVINGS).map(at).collect();
                ways.push(SearchDirection { seen: imitation.seen(&null, &points), null: null.clone(), end });
            }
        }
    }
    ways
}

/// Distance (σ) of the base's best fit from data with the effect at a step from its null; 0 if the model has no solution there.
fn of_step(
    subject: &Subject,
    base: (&Candidate, &Fitted),
    extended: &Candidate,
    (way, place, step): (&SearchDirection, usize, f64),
) -> Result<f64> {
    let mut theta = way.null.clone();
    theta[place] += step;
    let Ok(position_m) = subject.trajectory_m(extended, &theta) else { return Ok(0.0) };
    let truth = RivalTruth { candidate: extended, theta: &theta, noise: base.1.noise, position_m: &position_m };
    Ok(fit_rival(subject, base.0, &truth)?.distance)
}

/// Finds the smallest signed step in a direction whose distance reaches the threshold, by secants inside a bracket.
fn smallest_step(
    way: &SearchDirection,
    guess: f64,
    threshold: f64,
    distance: &impl Fn(&SearchDirection, f64) -> Result<f64>,
) -> Result<Option<f64>> {
    let Some((end, _)) = way.largest() else { return Ok(None) };
    let (mut below, mut above) = (0.0, None);
    let mut size = guess.min(end.abs());
    for _ in 0..MOST_REFITS {
        let found = distance(way, size.copysign(end))?;
        if found >= threshold {
            above = Some(size);
            if found <= (1.0 + TOLERANCE) * threshold {
                break;
            }
        } else if size >= end.abs() {
            return Ok(None);
        } else {
            below = size;
        }
        let upper: f64 = above.unwrap_or(end.abs());
        let aimed = size * (1.0 + 0.5 * TOLERANCE) * threshold / found.max(1e-3 * threshold);
        // If the secant leaves the bracket, the bracket's middle is used, or its end if no upper size is known.
        let inside = aimed > below && aimed < upper;
        size = if inside {
            aimed
        } else if above.is_some() {
            0.5 * (below + upper)
        } else {
            upper
        };
    }
    Ok(above.map(|size| size.copysign(end)))
}

#[cfg(test)]
#[path = "detectable_tests.rs"]
mod tests;
