//! Diagnosis and challenges.

#[path = "../density_ratio/mod.rs"]
mod density_ratio;

mod challenge;
mod evidence;
mod large;
mod outside;
mod thresholds;
