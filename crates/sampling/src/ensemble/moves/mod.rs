//! Moves propose new positions of walkers, given the walkers of the other half of the ensemble.
//!
//! [`super::Ensemble`] implements the split-ensemble scheme (Goodman & Weare 2010, doi:10.2140/camcos.2010.5.65; Foreman-Mackey et al. 2013,
//! doi:10.1086/670067). A move only computes proposals and their correction factors.

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
pub struct WalkerPoints<'a> {
    /// The coordinates.
    pub coordinates: &'a [f64],
    /// Number of points.
    pub n: usize,
    /// Coordinates of a point.
    pub dimension: usize,
}

/// A proposal for every walker of one half.
///
/// A move leaves any target π invariant under this acceptance rule: accept a proposal y from x, given the complement, with
/// probability min(1, exp(log_factor)·π(y)/π(x)).
pub trait Move: Send + Sync {
    /// Name with all constants. A checkpoint must agree with it.
    fn name(&self) -> String;

    /// Fills `proposals` (layout of [`KernelPoints`], as many as `moving`) and `log_factors`.
    ///
    /// `own` holds one random stream per moving walker. `shared` is the ensemble's stream, for choices that all walkers
    /// share. The complement has at least four points. Draws from `own` must not change it.
    fn propose(
        &self,
        moving: WalkerPoints,
        complement: WalkerPoints,
        shared: &mut RandomStream,
        random_streams: &mut [RandomStream],
        proposals: &mut [f64],
        log_factors: &mut [f64],
    );
}

/// The default move: mostly differential evolution, with some snooker for steps in other directions and of other lengths. Differential evolution
/// had the shortest autocorrelation time of the ensemble's moves on the creep posterior of the base model. (A run also jumps into a
/// fixed approximation by default, which makes this choice less important.)
pub fn default_move() -> Mixture {
    Mixture::new(vec![
        (0.8, Box::new(DifferentialEvolution::default()) as Box<dyn Move>),
        (0.2, Box::new(Snooker::default())),
    ])
}
