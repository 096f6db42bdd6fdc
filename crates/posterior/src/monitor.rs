//! Who watches a job, and how it is stopped.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use base::error::{Error, Result};
use sampling::ensemble::Progress;

/// Who watches a job: the terminal, or nobody.
pub trait Monitor: Sync {
    /// A stage begins.
    fn stage(&self, text: &str);
    /// How far the sampler is; called a few times a second.
    fn sampling(&self, progress: &Progress);
    /// So many pieces of the stage's work are done, of so many at most; called from any thread.
    fn progress(&self, done: usize, most: usize);
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
    fn progress(&self, _done: usize, _most: usize) {}
    fn warn(&self, _text: &str) {}
    fn stop(&self) -> Option<&AtomicBool> {
        None
    }
}

/// Where the number of threads stands if no option gives it.
pub const THREADS_VARIABLE: &str = "RAYON_NUM_THREADS";

/// Ends a job that was asked to stop; `kept` says what stays of it.
pub fn refuse_if_stopped(monitor: &dyn Monitor, kept: &str) -> Result<()> {
    if monitor.stop().is_some_and(|stop| stop.load(Ordering::Relaxed)) {
        return Err(Error::Interrupted { kept: kept.into() });
    }
    Ok(())
}

/// Nobody watches one piece of many, but it can be stopped.
pub struct Stoppable<'a>(pub Option<&'a AtomicBool>);

impl Monitor for Stoppable<'_> {
    fn stage(&self, _text: &str) {}
    fn sampling(&self, _progress: &Progress) {}
    fn progress(&self, _done: usize, _most: usize) {}
    fn warn(&self, _text: &str) {}
    fn stop(&self) -> Option<&AtomicBool> {
        self.0
    }
}

/// Passes warnings on and says nothing else: for work beside a stage that somebody watches.
pub struct Warnings<'a>(pub &'a dyn Monitor);

impl Monitor for Warnings<'_> {
    fn stage(&self, _text: &str) {}
    fn sampling(&self, _progress: &Progress) {}
    fn progress(&self, _done: usize, _most: usize) {}
    fn warn(&self, text: &str) {
        self.0.warn(text);
    }
    fn stop(&self) -> Option<&AtomicBool> {
        self.0.stop()
    }
}

/// Collects warnings in their order, and says nothing else.
pub struct Collected<'a> {
    monitor: &'a dyn Monitor,
    warnings: Mutex<Vec<String>>,
}

impl<'a> Collected<'a> {
    /// For work that `monitor` can stop.
    pub fn new(monitor: &'a dyn Monitor) -> Self {
        Self { monitor, warnings: Mutex::default() }
    }

    /// What has been warned of since the last time.
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut self.warnings.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Monitor for Collected<'_> {
    fn stage(&self, _text: &str) {}
    fn sampling(&self, _progress: &Progress) {}
    fn progress(&self, _done: usize, _most: usize) {}
    fn warn(&self, text: &str) {
        self.warnings.lock().unwrap_or_else(PoisonError::into_inner).push(text.into());
    }
    fn stop(&self) -> Option<&AtomicBool> {
        self.monitor.stop()
    }
}

/// Counts the pieces of a stage's work, whichever thread does them, for who watches.
pub struct Counter<'a> {
    monitor: &'a dyn Monitor,
    done: AtomicUsize,
    most: usize,
}

impl<'a> Counter<'a> {
    /// Nothing done yet of `most` pieces.
    pub fn new(monitor: &'a dyn Monitor, most: usize) -> Self {
        Self { monitor, done: AtomicUsize::new(0), most }
    }

    /// A piece is done.
    pub fn add_one(&self) {
        let done = 1 + self.done.fetch_add(1, Ordering::Relaxed);
        self.monitor.progress(done.min(self.most), self.most);
    }
}
