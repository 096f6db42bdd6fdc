//! Recovery of walkers that did not join the others, by moving them to other positions.

use super::draws::Draws;
use super::starts::{draw, reach};
use super::state::EnsembleRecord;
use super::stuck_walkers::{SuspicionReason, SuspiciousWalker, find_suspicious_walkers};
use crate::LogDensity;
use crate::diagnostics::ranks::Sorted;
use crate::optimum::{Modes, Optimum, maximise};
use base::Result;
use rayon::prelude::*;

/// Numbers of walkers that [`reseed_stranded_walkers`] found and moved.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Recovery {
    /// Number of walkers that did not join the others. Such a walker is at no mode, or at a mode with negligible mass.
    pub n_stranded: u64,
    /// Number of walkers that were moved to positions among the others.
    pub reseeded: u64,
    /// Number of walkers that do not move although they are at a mode with mass.
    pub stuck: u64,
    /// `true` if the search found an unknown mode with mass, at which no walker started.
    pub new_heavy_mode: bool,
}

impl Recovery {
    /// Returns `true` if the draws so far must be discarded.
    pub fn invalidates_draws(&self) -> bool {
        self.n_stranded > 0 || self.new_heavy_mode
    }
}

/// Fraction of the total Laplace mass below which a mode is negligible.
const NEGLIGIBLE_SHARE: f64 = 1e-4;
/// Fraction of the total Laplace mass above which a newly found mode makes all walkers start again.
const HEAVY_SHARE: f64 = 4e-3;

/// Finds walkers that may have failed to join the others, climbs from their positions to maxima, and moves the walkers whose mode has negligible
/// mass.
///
/// A walker stays if its climb ends in a mode with mass and one of two conditions holds. Either the walker's log density is typical of that mode, or the
/// mode is not the heaviest. With `is_read_only`, no walker is moved.
pub(super) fn reseed_stranded_walkers(
    density: &dyn LogDensity,
    draws: &Draws,
    modes: &mut Modes,
    lanes: &mut [EnsembleRecord],
    is_read_only: bool,
) -> Result<Recovery> {
    let suspects = find_suspicious_walkers(draws);
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
        let pair = optimum.as_ref().and_then(|optimum| modes.nearest(&optimum.location));
        let belongs = pair.is_some_and(|(idx, mode)| {
            let within = suspect.mean_log_density > mode.log_density - reach(draws.dimension);
            weights[idx] >= NEGLIGIBLE_SHARE && (within || idx > 0)
        });
        if belongs {
            recovery.stuck += u64::from(suspect.reason == SuspicionReason::Stuck);
            continue;
        }
        recovery.n_stranded += 1;
        if !is_read_only && !recovery.new_heavy_mode {
            reseed(density, modes, &mut lanes[suspect.ensemble], suspect, &suspects, floor)?;
            recovery.reseeded += 1;
        }
    }
    Ok(recovery)
}

/// Adds the optima that converged to the modes. Returns the locations of the optima that are new modes.
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

/// Returns the log density that 95 % of the walkers exceed.
fn floor(lanes: &[EnsembleRecord]) -> f64 {
    let values: Vec<f64> = lanes
        .iter()
        .flat_map(|lane| (0..lane.ensemble.n_walkers()).map(|walker| lane.ensemble.log_density(walker)))
        .collect();
    Sorted::new(&values).quantile(0.05)
}

/// Moves a suspicious walker to a draw from the modes' Laplace approximations whose log density is at least `floor`. If no such draw is found, the
/// walker moves to the position of a walker of its ensemble that is not suspicious.
fn reseed(
    density: &dyn LogDensity,
    modes: &Modes,
    lane: &mut EnsembleRecord,
    suspect: &SuspiciousWalker,
    suspects: &[SuspiciousWalker],
    floor: f64,
) -> Result<()> {
    for _ in 0..20 {
        let stream = lane.ensemble.stream(suspect.walker);
        let u = stream.unit();
        let Some(mode) = modes.at_cumulative_weight(u) else { break };
        let (point, value) = draw(density, mode, stream)?;
        if value >= floor {
            lane.ensemble.set_walker(suspect.walker, &point, value);
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
    lane.ensemble.set_walker(suspect.walker, &point, value);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ensemble::draws::{DrawRecord, join};
    use crate::ensemble::moves::Stretch;
    use crate::ensemble::random::RandomStream;
    use crate::ensemble::walkers::{Ensemble, Kernel};
    use crate::optimum::find_modes;
    use crate::test_densities::TwoBumps;

    const N_WALKERS: usize = 16;
    const N_STEPS: usize = 300;

    /// Runs four ensembles for 300 stretch moves in the first mode of a target. In each ensemble, `n_elsewhere` walkers start at `elsewhere`.
    fn run(target: &TwoBumps, n_elsewhere: usize, elsewhere: [f64; 2]) -> (Vec<EnsembleRecord>, Draws) {
        let mut stream = RandomStream::new(21, 0);
        let lanes: Vec<EnsembleRecord> = (0..4)
            .map(|number| {
                let mut ensemble = Ensemble::new(3, number, 2, &[0.0; 2 * N_WALKERS], &[0.0; N_WALKERS]);
                for walker in 0..N_WALKERS {
                    let near = [stream.normal(), stream.normal()];
                    let point = if walker < n_elsewhere { elsewhere } else { near };
                    let mut value = [0.0];
                    target.log_density(&point, &mut value);
                    ensemble.set_walker(walker, &point, value[0]);
                }
                let mut record = DrawRecord::new(0, 1, N_STEPS, 2, N_WALKERS);
                for _ in 0..N_STEPS {
                    ensemble.step(target, &Kernel { local: &Stretch::default(), jumps: None }).unwrap();
                    record.keep(&ensemble, None);
                }
                EnsembleRecord { ensemble, record }
            })
            .collect();
        let draws = join(&lanes.iter().map(|lane| &lane.record).collect::<Vec<_>>(), 2, N_WALKERS);
        (lanes, draws)
    }

    /// Checks that walkers on a spike of width 10⁻⁵ and mass 10⁻⁷, which they do not leave by themselves, are moved to the other mode.
    #[test]
    fn walkers_on_a_mode_without_mass_are_reseeded() {
        let target = TwoBumps::new(1.0 - 1e-7, 30.0, 1e-5);
        let (mut lanes, draws) = run(&target, 1, [30.0, 0.0]);
        let mut modes = find_modes(&target, &[vec![0.1, 0.1]]).unwrap();
        assert!((0..4).all(|e| lanes[e].ensemble.position(0)[0] > 29.0), "the walkers must be held for this test");
        let looked = reseed_stranded_walkers(&target, &draws, &mut modes.clone(), &mut lanes, true).unwrap();
        assert_eq!((looked.n_stranded, looked.reseeded), (4, 0));
        let recovery = reseed_stranded_walkers(&target, &draws, &mut modes, &mut lanes, false).unwrap();
        assert_eq!((recovery.n_stranded, recovery.reseeded, recovery.new_heavy_mode), (4, 4, false));
        assert!(lanes.iter().all(|lane| lane.ensemble.position(0)[0].abs() < 6.0));
    }

    /// Checks that walkers at a second mode with mass are never moved. If that mode was unknown, all walkers start again.
    #[test]
    fn walkers_on_a_mode_with_mass_are_not() {
        let target = TwoBumps::new(0.8, 60.0, 1.0);
        for known in [true, false] {
            let (mut lanes, draws) = run(&target, 3, [60.0, 0.0]);
            let starts = if known { vec![vec![0.1, 0.1], vec![59.0, 0.0]] } else { vec![vec![0.1, 0.1]] };
            let mut modes = find_modes(&target, &starts).unwrap();
            let before: Vec<f64> = lanes.iter().map(|lane| lane.ensemble.position(0)[0]).collect();
            let recovery = reseed_stranded_walkers(&target, &draws, &mut modes, &mut lanes, false).unwrap();
            assert_eq!((recovery.n_stranded, recovery.reseeded), (0, 0));
            assert_eq!(recovery.new_heavy_mode, !known);
            assert_eq!(lanes.iter().map(|lane| lane.ensemble.position(0)[0]).collect::<Vec<_>>(), before);
        }
    }
}
