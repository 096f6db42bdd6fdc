//! Diagnostics of a set of draws: R̂, effective sample sizes, Monte Carlo errors, autocorrelation times.
//!
//! There are two modules, for independent chains and for ensembles of walkers. Both use the autocovariance and the truncation rule of
//! [`autocovariance`]:
//! - [`convergence`]: for independent chains, by the published definitions (Vehtari, Gelman, Simpson, Carpenter, Bürkner 2021, "Rank-normalization,
//!   folding, and localization", doi:10.1214/20-BA1221) and as ArviZ computes them.
//! - [`ensembles`]: for several ensembles of walkers. The ensembles are independent, but the walkers of one ensemble are *not*. Correlation in time
//!   is therefore computed from the average over an ensemble's walkers at each step. Each chain of R̂ is one half of an ensemble.

pub mod autocovariance;
pub mod chains;
pub mod convergence;
pub mod ensembles;
pub mod ranks;

pub use chains::Chains;
pub use convergence::{ess_bulk, ess_mean, ess_tail, mcse_mean, rhat};
pub use ensembles::{DrawColumn, ParameterDiagnostics, diagnose};
