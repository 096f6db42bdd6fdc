//! Implementation of the commands. Each command turns checked input into a document and files.
//!
//! A command on a study has one source file. [`artefacts`] writes the files of a posterior, and [`pages`] the page of a study. [`sweep`] contains the commands
//! for a rheometer's oscillation, and [`tasks`] lists of tasks for many machines. [`bridge`] contains the models that `serve` offers through UM-Bridge.

pub mod artefacts;
pub mod bridge;
pub mod compare;
pub mod convergence;
pub mod design;
pub mod diagnose;
pub mod equivalents;
mod exchange;
pub mod extend;
pub mod first_revision;
pub mod fit;
pub mod ladder;
pub mod last_cycle;
pub mod laws;
pub mod learn;
pub mod outcome;
pub mod pages;
pub mod prediction;
pub mod sample;
#[cfg(feature = "schemas")]
pub mod schemas;
pub mod simulate;
pub mod simulation_files;
pub mod sweep;
pub mod target;
pub mod tasks;
pub mod visibility;
