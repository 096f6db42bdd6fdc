//! Affine-invariant ensemble sampling that says when it cannot be trusted.
//!
//! Several independent ensembles of walkers. Order of events, see [`sample`]:
//! 1. optima are found from several starts with their Laplace masses ([`crate::optimum`]);
//! 2. walkers are drawn from the modes' Laplace approximations, slightly over-dispersed, in proportion to mass;
//! 3. burn-in: walkers left behind are found and reseeded, except where their own mode carries mass ([`left_behind`]);
//! 4. a *freeze* fits the approximation that jumps are drawn from, discards every draw so far, and from then on nothing but the
//!    fixed kernel moves walkers;
//! 5. at growing intervals convergence is judged; a walker found left behind means a new burn-in and a new freeze.
//!
//! Everything that decides falls on step counts, never on clocks or threads, so that the same seed gives the same bytes
//! with any number of threads, and after any interruption.

mod batches;
mod draws;
pub mod left_behind;
pub mod moves;
mod options;
mod random;
mod recover;
mod run;
mod starts;
mod state;
mod verdict;
mod walkers;

pub use draws::Draws;
pub use moves::Move;
pub use options::{Batches, Checkpointing, Demands, Phase, Progress, RunControl, SamplerOptions};
pub use random::RandomStream;
pub use run::{SampleOutcome, sample};
pub use walkers::{Ensemble, EnsembleState, JumpCount, Kernel};
