//! Moves: how a walker proposes where to go, given the walkers of the other half of its ensemble.
//!
//! The split-ensemble scheme (Goodman & Weare 2010, doi:10.2140/camcos.2010.5.65; Foreman-Mackey et al. 2013,
//! doi:10.1086/670067) stands in [`super::Ensemble`]; a move only fills in proposals and their correction factors.

mod differential_evolution;
mod independence;
mod mixture;
mod snooker;
mod stretch;

pub use differential_evolution::DifferentialEvolution;
pub use independence::Independence;
pub use mixture::Mixture;
pub use snooker::Snooker;
pub use stretch::Stretch;

use super::random::RandomStream;

/// Points in the layout of [`crate::LogDensity`]: coordinate d of point i at `coordinates[d * n + i]`.
#[derive(Debug, Clone, Copy)]
pub struct Points<'a> {
    /// The coordinates.
    pub coordinates: &'a [f64],
    /// Number of points.
    pub n: usize,
    /// Coordinates of a point.
    pub dimension: usize,
}

/// A proposal for every walker of one half.
///
/// A move leaves any target invariant when, with π the target, a proposal y from x given the complement is accepted with
/// probability min(1, exp(log_factor)·π(y)/π(x)).
pub trait Move: Send + Sync {
    /// Name with its constants; part of what a checkpoint must agree with.
    fn name(&self) -> String;

    /// Fills `proposals` (layout of [`Points`], as many as `moving`) and `log_factors`.
    ///
    /// `own` holds one random stream a moving walker, `shared` is the ensemble's for choices that all walkers make
    /// together. The complement has at least four points and must not be changed by what is drawn from `own`.
    fn propose(
        &self,
        moving: Points,
        complement: Points,
        shared: &mut RandomStream,
        own: &mut [RandomStream],
        proposals: &mut [f64],
        log_factors: &mut [f64],
    );
}

/// The default: mostly differential evolution, whose autocorrelation time on the creep posterior of the base model was the
/// shortest of the ensemble's moves, with some snooker, which takes steps of other directions and lengths. (With jumps into a
/// fixed approximation, the default of a run, the choice matters little there.)
pub fn default_move() -> Mixture {
    Mixture::new(vec![
        (0.8, Box::new(DifferentialEvolution::default()) as Box<dyn Move>),
        (0.2, Box::new(Snooker::default())),
    ])
}
