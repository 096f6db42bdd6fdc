//! Affine-invariant ensemble sampler that reports when its result cannot be trusted.
//!
//! It runs several independent ensembles of walkers. Order of events (see [`sample`]):
//! 1. The optimiser finds modes and their Laplace masses from several starts ([`crate::optimum`]).
//! 2. Walkers are drawn from the modes' Laplace approximations, slightly over-dispersed, in proportion to mass.
//! 3. Burn-in: walkers left behind are found and reseeded, except if their own mode has mass ([`stuck_walkers`]).
//! 4. A *freeze* fits the approximation for jumps and discards all draws so far. From then on only the fixed kernel
//!    moves walkers.
//! 5. Convergence is judged at growing intervals. A walker left behind causes a new burn-in and a new freeze.
//!
//! All decisions depend on step counts, never on clocks or threads. Equal seeds therefore give equal bytes
//! for any number of threads and after any interruption.

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
pub use walkers::{Ensemble, EnsembleState, JumpCount, Kernel};
