//! Starting positions of walkers: draws from the modes' Laplace approximations, in proportion to the modes' masses.

use super::random::RandomStream;
use crate::LogDensity;
use crate::optimum::{Mode, Modes};
use base::{Error, Result};

/// Factor that multiplies the standard deviations of the Laplace approximation in the draw of a start. Starts with too wide a spread delay the
/// convergence of R̂ to 1.
const SPREAD: f64 = 1.2;
/// Largest number of attempts to draw a walker's start. If all fail, the walker starts at its mode.
const ATTEMPTS: usize = 60;

/// Assigns a mode to each walker, in proportion to the modes' `weights`. Entry `[e][w]` of the result is the index of the mode for walker w of
/// ensemble e.
///
/// The assignment is systematic, and the ensemble changes fastest. The number of walkers per mode deviates from proportionality to `weights` by less
/// than one, in total and in each ensemble. Successive walkers go to different halves of an ensemble, so a mode with two walkers occurs in both
/// halves.
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

/// Draws the start of a walker from a mode's Laplace approximation, and returns it with its log density. The draw is repeated while its log density is
/// far below that of typical points of the mode.
///
/// # Errors
/// [`Error::Numerical`] if the log density is NaN or +∞, or −∞ even at the mode.
pub(super) fn draw(density: &dyn LogDensity, mode: &Mode, stream: &mut RandomStream) -> Result<(Vec<f64>, f64)> {
    let floor = mode.log_density - reach(mode.location.len());
    let mut spread = SPREAD;
    for attempt in 1..=ATTEMPTS {
        let point = mode.draw(spread, stream);
        let value = evaluate_one(density, &point, floor)?;
        if value > floor {
            return Ok((point, value));
        }
        if attempt % 15 == 0 {
            // The approximation is too wide in some direction, so the next draws are closer to the mode.
            spread *= 0.3;
        }
    }
    let value = evaluate_one(density, &mode.location, f64::NEG_INFINITY)?;
    if value.is_finite() {
        return Ok((mode.location.clone(), value));
    }
    Err(Error::numerical(
        format!("the log density is {value} at a mode where it was finite before"),
        "report this fault of the model: its log density is not reproducible",
    ))
}

/// Returns the largest plausible difference between the log density at a mode's peak and at a walker of that mode. The difference is d/2, as for a
/// Gaussian in d dimensions, plus a wide margin.
pub(super) fn reach(dimension: usize) -> f64 {
    0.5 * dimension as f64 + 4.0 * (dimension as f64).sqrt() + 20.0
}

/// Evaluates the log density at one point. A value below `floor` may be coarse.
fn evaluate_one(density: &dyn LogDensity, point: &[f64], floor: f64) -> Result<f64> {
    let mut value = [0.0];
    density.log_density_above(point, &[floor], &mut value);
    crate::check_log_densities(point.len(), point, &value)?;
    Ok(value[0])
}

/// Checks that there is a mode from which walkers can start.
///
/// # Errors
/// [`Error::Numerical`] if no start led to a mode.
pub(super) fn require(modes: &Modes, n_starts: usize) -> Result<()> {
    if !modes.is_empty() {
        return Ok(());
    }
    Err(Error::numerical(
        format!("none of the {n_starts} starts leads to a maximum of the log density"),
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
