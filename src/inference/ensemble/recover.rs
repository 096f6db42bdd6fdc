//! What is done about walkers that may have been left behind.

use super::draws::Draws;
use super::left_behind::{Reason, Suspect, suspects};
use super::starts::{draw, reach};
use super::state::Lane;
use crate::Result;
use crate::inference::LogDensity;
use crate::inference::diagnostics::ranks::Sorted;
use crate::inference::optimum::{Modes, Optimum, maximise};
use rayon::prelude::*;

/// What was found, and done.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Recovery {
    /// Walkers left behind: their own mode, if any, carries no mass to speak of.
    pub left_behind: u64,
    /// Those that were put back among the others.
    pub reseeded: u64,
    /// Walkers that do not move although they are where mass is.
    pub stuck: u64,
    /// A mode with mass was found that no walker began from.
    pub new_heavy_mode: bool,
}

impl Recovery {
    /// Whether draws up to here are to be discarded.
    pub fn disturbed(&self) -> bool {
        self.left_behind > 0 || self.new_heavy_mode
    }
}

/// Share of the total Laplace mass below which a mode is nothing.
const NEGLIGIBLE_SHARE: f64 = 1e-4;
/// Share from which a mode found late makes all walkers begin again.
const HEAVY_SHARE: f64 = 4e-3;

/// Finds suspects, climbs from where they are, and reseeds those whose own mode carries no mass.
///
/// A walker stays where it is when its climb ends in a mode with mass and it is within that mode's reach, or the mode is another than
/// the heaviest. With `only_look`, none is moved.
pub(super) fn recover(
    density: &dyn LogDensity,
    draws: &Draws,
    modes: &mut Modes,
    lanes: &mut [Lane],
    only_look: bool,
) -> Result<Recovery> {
    let suspects = suspects(draws);
    let optima = suspects
        .par_iter()
        .map(|suspect| maximise(density, &lanes[suspect.ensemble].ensemble.position(suspect.walker)))
        .collect::<Result<Vec<_>>>()?;
    let found_late = add_new(modes, optima.iter().flatten());
    let weights = modes.weights();
    let weight_of = |location: &Vec<f64>| modes.nearest(location).map_or(0.0, |(idx, _)| weights[idx]);
    let mut recovery = Recovery {
        new_heavy_mode: found_late.iter().any(|location| weight_of(location) > HEAVY_SHARE),
        ..Recovery::default()
    };
    let floor = floor(lanes);
    for (suspect, optimum) in suspects.iter().zip(&optima) {
        let own = optimum.as_ref().and_then(|optimum| modes.nearest(&optimum.location));
        let belongs = own.is_some_and(|(idx, mode)| {
            let within = suspect.mean_log_density > mode.log_density - reach(draws.dimension);
            weights[idx] >= NEGLIGIBLE_SHARE && (within || idx > 0)
        });
        if belongs {
            recovery.stuck += u64::from(suspect.reason == Reason::Stuck);
            continue;
        }
        recovery.left_behind += 1;
        if !only_look && !recovery.new_heavy_mode {
            reseed(density, modes, &mut lanes[suspect.ensemble], suspect, &suspects, floor)?;
            recovery.reseeded += 1;
        }
    }
    Ok(recovery)
}

/// Adds those optima that are proper and in none of the known modes; returns where they are.
fn add_new<'a>(modes: &mut Modes, optima: impl Iterator<Item = &'a Optimum>) -> Vec<Vec<f64>> {
    let mut found = Vec::new();
    for optimum in optima.filter(|optimum| optimum.converged) {
        let n_known = modes.len();
        modes.add(optimum);
        if modes.len() > n_known {
            found.push(optimum.location.clone());
        }
    }
    found
}

/// Log density that all but one in twenty of the walkers exceed.
fn floor(lanes: &[Lane]) -> f64 {
    let values: Vec<f64> = lanes
        .iter()
        .flat_map(|lane| (0..lane.ensemble.n_walkers()).map(|walker| lane.ensemble.log_density(walker)))
        .collect();
    Sorted::new(&values).quantile(0.05)
}

/// Puts a walker among the others: a draw from the Laplace approximations if one is as good as they are, otherwise
/// where a healthy walker of its ensemble is.
fn reseed(
    density: &dyn LogDensity,
    modes: &Modes,
    lane: &mut Lane,
    suspect: &Suspect,
    suspects: &[Suspect],
    floor: f64,
) -> Result<()> {
    for _ in 0..20 {
        let stream = lane.ensemble.stream(suspect.walker);
        let u = stream.unit();
        let Some(mode) = modes.at_share(u) else { break };
        let (point, value) = draw(density, mode, stream)?;
        if value >= floor {
            lane.ensemble.place(suspect.walker, &point, value);
            return Ok(());
        }
    }
    let is_healthy = |walker: &usize| !suspects.iter().any(|s| (s.ensemble, s.walker) == (suspect.ensemble, *walker));
    let healthy: Vec<usize> = (0..lane.ensemble.n_walkers()).filter(is_healthy).collect();
    if healthy.is_empty() {
        return Ok(());
    }
    let model = healthy[lane.ensemble.stream(suspect.walker).below(healthy.len())];
    let (point, value) = (lane.ensemble.position(model), lane.ensemble.log_density(model));
    lane.ensemble.place(suspect.walker, &point, value);
    Ok(())
}
