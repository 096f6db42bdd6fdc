//! The jobs that the commands run, each from a checked experiment to results that can be written.

pub mod advice;
pub mod artefacts;
pub mod extend;
pub mod fit;
pub mod heldout;
pub mod ladder;
pub mod log_score;
pub mod mechanics;
mod mesh_check;
mod mixture;
mod model_priors;
pub mod problem;
pub mod reduced;
pub mod replica;
pub mod sample;
pub mod simulate;
pub mod simulation_files;
pub mod summary;
pub mod visibility;

use std::sync::atomic::AtomicBool;

use crate::inference::ensemble::Progress;

/// Who watches a job: the terminal, or nobody.
pub trait Monitor: Sync {
    /// A stage begins.
    fn stage(&self, text: &str);
    /// How far the sampler is; called a few times a second.
    fn sampling(&self, progress: &Progress);
    /// Something that the user should know now.
    fn warn(&self, text: &str);
    /// Set to true from anywhere to stop the job at the next safe place.
    fn stop(&self) -> Option<&AtomicBool>;
}

/// Nobody watches: for tests and for callers without a terminal.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Monitor for Silent {
    fn stage(&self, _text: &str) {}
    fn sampling(&self, _progress: &Progress) {}
    fn warn(&self, _text: &str) {}
    fn stop(&self) -> Option<&AtomicBool> {
        None
    }
}
