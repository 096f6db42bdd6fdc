//! Where walkers begin: draws from the modes' Laplace approximations, in proportion to their masses.

use super::random::RandomStream;
use crate::LogDensity;
use crate::optimum::{Mode, Modes};
use base::{Error, Result};

/// Standard deviations of the Laplace approximation are stretched by this: R̂ is to start from above.
const SPREAD: f64 = 1.2;
/// Draws before a walker is given up on and put next to its mode.
const ATTEMPTS: usize = 60;

/// Mode of each walker: `allocation(weights, m, n)[e][w]`.
///
/// Systematic, with ensembles as the fastest index: any mode's share is right to one walker over all ensembles and to
/// one walker in each of them. Neighbours go to different halves, so that either half sees every mode with two walkers.
pub(super) fn allocation(weights: &[f64], n_ensembles: usize, n_walkers: usize) -> Vec<Vec<usize>> {
    let mut modes = vec![vec![0; n_walkers]; n_ensembles];
    let n_slots = (n_ensembles * n_walkers) as f64;
    let (mut mode, mut cumulated) = (0, weights.first().copied().unwrap_or(1.0));
    for slot in 0..n_ensembles * n_walkers {
        while (slot as f64 + 0.5) / n_slots > cumulated && mode + 1 < weights.len() {
            mode += 1;
            cumulated += weights[mode];
        }
        let k = slot / n_ensembles;
        modes[slot % n_ensembles][(k % 2) * (n_walkers / 2) + k / 2] = mode;
    }
    modes
}

/// Draws a walker from a mode's Laplace approximation, again while it lands far below what the mode's bulk would have.
///
/// # Errors
/// [`Error::Numerical`] when the log density is NaN or +∞, or −∞ even on the mode.
pub(super) fn draw(density: &dyn LogDensity, mode: &Mode, stream: &mut RandomStream) -> Result<(Vec<f64>, f64)> {
    let reach = reach(mode.location.len());
    let mut spread = SPREAD;
    for attempt in 1..=ATTEMPTS {
        let point = mode.draw(spread, stream);
        let value = evaluate_one(density, &point)?;
        if value > mode.log_density - reach {
            return Ok((point, value));
        }
        if attempt % 15 == 0 {
            // The approximation is too wide in some direction: closer to the mode there must be room.
            spread *= 0.3;
        }
    }
    let value = evaluate_one(density, &mode.location)?;
    if value.is_finite() {
        return Ok((mode.location.clone(), value));
    }
    Err(Error::numerical(
        format!("the log density is {value} at a mode found before"),
        "the log density does not repeat itself: report this fault of the model",
    ))
}

/// How far below its mode's peak a walker of a unimodal bulk may be: a Gaussian's d/2 and a wide margin.
pub(super) fn reach(dimension: usize) -> f64 {
    0.5 * dimension as f64 + 4.0 * (dimension as f64).sqrt() + 20.0
}

/// Log density of one point.
pub(super) fn evaluate_one(density: &dyn LogDensity, point: &[f64]) -> Result<f64> {
    let mut value = [0.0];
    density.log_density(point, &mut value);
    crate::check_log_densities(point.len(), point, &value)?;
    Ok(value[0])
}

/// The modes that walkers can begin from.
///
/// # Errors
/// [`Error::Numerical`] when no start led anywhere.
pub(super) fn require(modes: &Modes, n_starts: usize) -> Result<()> {
    if !modes.is_empty() {
        return Ok(());
    }
    Err(Error::numerical(
        format!("none of {n_starts} starts has a finite log density that can be climbed"),
        "give starts inside the prior's support, and check the data's units",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn allocation_is_proportional_and_even() {
        let modes = allocation(&[0.7, 0.295, 0.005], 4, 32);
        let count = |row: &[usize], mode: usize| row.iter().filter(|&&m| m == mode).count();
        let total: usize = modes.iter().map(|row| count(row, 0)).sum();
        assert_eq!(total, 90);
        assert_eq!(modes.iter().map(|row| count(row, 2)).sum::<usize>(), 1);
        for row in &modes {
            assert!((22..=23).contains(&count(row, 0)));
            assert!(count(&row[..16], 0).abs_diff(count(&row[16..], 0)) <= 1);
        }
    }
}
