//! Ensembles, evidence and noise against known densities.

#[path = "../density_ratio/mod.rs"]
mod density_ratio;

mod creep_posterior;
mod diagnostics;
mod ensemble_truth;
mod evidence;
mod move_harness;
mod noise_calibration;
mod sampler_runs;
mod simulation_based_calibration;
