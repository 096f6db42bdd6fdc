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

/// Rule that proposes a new position for each walker of one half of the ensemble.
///
/// The ensemble accepts the move of a walker from x to a proposal y with probability min(1, exp(log_factor)·π(y)/π(x)), with π the target density.
/// Under this rule a move must leave any π invariant, with the walkers of the other half held fixed.
pub trait Move: Send + Sync {
    /// Name of the move with all its constants. A run continues from a checkpoint only if the names agree.
    fn name(&self) -> String;

    /// Proposes a new position for each walker in `moving`, and fills `proposals` and the logarithms `log_factors` of the correction factors.
    /// `proposals` has the layout and size of `moving`.
    ///
    /// `complement` is the other half of the walkers, with at least four points; a move must not change it. `random_streams` holds one stream for
    /// each moving walker. `shared` is the ensemble's stream, for choices that all walkers share.
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

/// Returns the default move: 80 % differential evolution, and 20 % snooker moves for steps of other directions and lengths. On the creep posterior of
/// the base model, differential evolution had the shortest autocorrelation time of all moves tried.
pub fn default_move() -> Mixture {
    Mixture::new(vec![
        (0.8, Box::new(DifferentialEvolution::default()) as Box<dyn Move>),
        (0.2, Box::new(Snooker::default())),
    ])
}
