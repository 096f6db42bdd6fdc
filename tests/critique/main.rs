//! Diagnosis and challenges.

mod challenge;
mod evidence;
mod large;
mod outside;
mod thresholds;
