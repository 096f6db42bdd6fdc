//! Affine-invariant ensemble sampler that reports when its result cannot be trusted.
//!
//! Several independent ensembles of walkers sample a log density. [`sample`] works in this order:
//! 1. The optimiser climbs from several starting points. It finds modes and their masses in the Laplace approximation ([`crate::optimum`]).
//! 2. Walkers are drawn from the modes' Laplace approximations, in proportion to mass and with slightly larger standard deviations.
//! 3. During the burn-in, the sampler finds walkers that did not join the others and moves them. Walkers at a mode with mass stay
//!    ([`stuck_walkers`]).
//! 4. The *freeze* ends the burn-in. It fits the approximation of the posterior from which jumps are drawn, and discards all draws so far. From then
//!    on only fixed moves act on the walkers.
//! 5. Convergence is checked at growing intervals. If a walker has not joined the others, a new burn-in and a new freeze follow.
//!
//! All decisions depend on step counts, never on clocks or threads. Equal seeds therefore give equal bytes for any number of threads and after any
//! interruption.

mod batches;
mod draws;
pub mod moves;
mod options;
mod random;
mod recover;
mod run;
mod starts;
mod state;
pub mod stuck_walkers;
mod verdict;
mod walkers;

pub use draws::Draws;
pub use moves::Move;
pub use options::{Batches, Checkpointing, ConvergenceCriteria, Phase, Progress, RunControl, SamplerOptions};
pub use random::RandomStream;
pub use run::{SampleOutcome, sample};
pub use walkers::{Ensemble, EnsembleState, Kernel};
