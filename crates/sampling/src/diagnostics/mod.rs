//! Diagnostics of a set of draws: R̂, effective sample sizes, Monte Carlo errors, autocorrelation times.
//!
//! Two modules share one autocovariance and one truncation rule ([`autocovariance`]):
//! - [`convergence`]: independent chains, the textbook definitions (Vehtari, Gelman, Simpson, Carpenter, Bürkner 2021,
//!   "Rank-normalization, folding, and localization", doi:10.1214/20-BA1221), as ArviZ computes them;
//! - [`ensembles`]: ensembles are independent chains, but walkers of one ensemble are *not*. The series for correlation in time is
//!   therefore the per-step average over an ensemble's walkers, and each chain of R̂ is an ensemble.

pub mod autocovariance;
pub mod chains;
pub mod convergence;
pub mod ensembles;
pub mod ranks;

pub use chains::Chains;
pub use convergence::{ess_bulk, ess_mean, ess_tail, mcse_mean, rhat};
pub use ensembles::{DrawColumn, ParameterDiagnostics, diagnose};
