//! The functions behind the commands, each from a checked input to a document and files.

pub mod artefacts;
pub mod bridge;
pub mod convergence;
mod exchange;
pub mod extend;
pub mod first_revision;
pub mod init;
mod init_creep;
mod init_sweep;
pub mod ladder;
pub mod pages;
#[cfg(feature = "schemas")]
pub mod schemas;
pub mod simulate;
pub mod simulation_files;
pub mod sweep;
pub mod tasks;
pub mod visibility;
