//! Moves that propose new positions for one half of the walkers, given the walkers of the other half.
//!
//! [`super::Ensemble`] implements the split-ensemble scheme (Goodman & Weare 2010, doi:10.2140/camcos.2010.5.65; Foreman-Mackey et al. 2013,
//! doi:10.1086/670067). A move only computes proposals and their correction factors; the ensemble accepts or rejects them.

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

/// Points of several walkers in the layout of [`crate::LogDensity`]: coordinate d of point i is at `coordinates[d * n + i]`.
#[derive(Debug, Clone, Copy)]
pub struct WalkerPoints<'a> {
    /// Coordinates, `dimension * n` values.
    pub coordinates: &'a [f64],
    /// Number of points.
    pub n: usize,
    /// Number of coordinates of each point.
    pub dimension: usize,
}

/// Half-step of the ensemble: what a move reads, and what it fills.
pub struct HalfStep<'a> {
    /// Walkers that move.
    pub moving: WalkerPoints<'a>,
    /// The other half of the walkers, with at least four points.
    pub complement: WalkerPoints<'a>,
    /// The ensemble's stream, for choices that all walkers share.
    pub shared: &'a mut RandomStream,
    /// One stream for each moving walker.
    pub random_streams: &'a mut [RandomStream],
    /// Proposals, with the layout and size of `moving`.
    pub proposals: &'a mut [f64],
    /// Logarithms of the correction factors.
    pub log_factors: &'a mut [f64],
}

/// Rule that proposes a new position for each walker of one half of the ensemble.
///
/// The ensemble accepts the move of a walker from x to a proposal y with probability min(1, exp(log_factor)·π(y)/π(x)), with π the target density.
/// Under this rule a move must leave any π invariant, with the walkers of the other half held fixed.
pub trait Move: Send + Sync {
    /// Name of the move with all its constants. A run continues from a checkpoint only if the names agree.
    fn name(&self) -> String;

    /// Proposes a new position for each moving walker, and fills `proposals` and `log_factors`.
    fn propose(&self, step: HalfStep);
}

/// Returns the default move: 80 % differential evolution, and 20 % snooker moves for steps of other directions and lengths. On the creep posterior of
/// the base model, differential evolution had the shortest autocorrelation time of all moves tried.
pub fn default_move() -> Mixture {
    Mixture::new(vec![
        (0.8, Box::new(DifferentialEvolution::default()) as Box<dyn Move>),
        (0.2, Box::new(Snooker::default())),
    ])
}
