//! The functions behind the commands, each from a checked input to a document and files.
//!
//! One file is one command. [`artefacts`] writes a posterior's files, [`pages`] the
//! study's page. [`sweep`] holds the jobs on a rheometer's oscillation, [`tasks`] lists of tasks for many machines, and
//! [`bridge`] the models that `serve` offers by UM-Bridge.

pub mod artefacts;
pub mod bridge;
pub mod compare;
pub mod convergence;
pub mod diagnose;
pub mod equivalents;
mod exchange;
pub mod extend;
pub mod first_revision;
pub mod fit;
pub mod init;
mod init_creep;
mod init_sweep;
pub mod ladder;
pub mod last_cycle;
pub mod learn;
pub mod outcome;
pub mod pages;
pub mod sample;
#[cfg(feature = "schemas")]
pub mod schemas;
pub mod simulate;
pub mod simulation_files;
pub mod sweep;
pub mod target;
pub mod tasks;
pub mod visibility;
