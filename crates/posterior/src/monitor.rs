//! Monitors of a job: they receive its progress and warnings, and can stop it.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use base::error::{Error, Result};
use sampling::ensemble::Progress;

/// Receiver of a job's progress and warnings, such as the terminal. By default, reports are ignored and nothing stops the job.
pub trait Monitor: Sync {
    /// Announces the beginning of a stage of the job, such as "sampling the posterior".
    fn stage(&self, _text: &str) {}
    /// Reports the progress of the sampler, a few times a second.
    fn sampling(&self, _progress: &Progress) {}
    /// Reports that `done` of at most `most` units of the stage's work are finished. Any thread may call this function.
    fn progress(&self, _done: usize, _most: usize) {}
    /// Receives a warning for the user.
    fn warn(&self, _text: &str) {}
    /// Flag that stops the job at the next safe point when it is set to true; `None` if the job cannot be stopped.
    fn stop(&self) -> Option<&AtomicBool> {
        None
    }
}

/// Monitor that ignores everything, for tests and callers without a terminal.
#[derive(Debug, Clone, Copy, Default)]
pub struct SilentMonitor;

impl Monitor for SilentMonitor {}

/// Environment variable with the number of threads, used if no option gives it.
pub const THREADS_VARIABLE: &str = "RAYON_NUM_THREADS";

/// Returns [`Error::Interrupted`] if the user has stopped the job. `kept` describes the results that remain.
pub fn refuse_if_stopped(monitor: &dyn Monitor, kept: &str) -> Result<()> {
    if monitor.stop().is_some_and(|stop| stop.load(Ordering::Relaxed)) {
        return Err(Error::Interrupted { kept: kept.into() });
    }
    Ok(())
}

/// Monitor that ignores all reports, but passes on the flag that stops the job. It serves one of many parallel tasks.
pub struct StoppableMonitor<'a>(pub Option<&'a AtomicBool>);

impl Monitor for StoppableMonitor<'_> {
    fn stop(&self) -> Option<&AtomicBool> {
        self.0
    }
}

/// Monitor that passes on warnings and ignores progress. It serves work inside a stage that is already announced.
pub struct WarningMonitor<'a>(pub &'a dyn Monitor);

impl Monitor for WarningMonitor<'_> {
    fn warn(&self, text: &str) {
        self.0.warn(text);
    }
    fn stop(&self) -> Option<&AtomicBool> {
        self.0.stop()
    }
}

/// Monitor that collects warnings in their order and ignores progress.
pub struct WarningCollector<'a> {
    monitor: &'a dyn Monitor,
    warnings: Mutex<Vec<String>>,
}

impl<'a> WarningCollector<'a> {
    /// Creates a collector for work that `monitor` can stop.
    pub fn new(monitor: &'a dyn Monitor) -> Self {
        Self { monitor, warnings: Mutex::default() }
    }

    /// Removes and returns the warnings since the last call.
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut self.warnings.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Monitor for WarningCollector<'_> {
    fn warn(&self, text: &str) {
        self.warnings.lock().unwrap_or_else(PoisonError::into_inner).push(text.into());
    }
    fn stop(&self) -> Option<&AtomicBool> {
        self.monitor.stop()
    }
}

/// Counter of the finished units of a stage's work in all threads. It reports to a monitor.
pub struct Counter<'a> {
    monitor: &'a dyn Monitor,
    done: AtomicUsize,
    most: usize,
}

impl<'a> Counter<'a> {
    /// Creates a counter that starts at 0 of `most` units.
    pub fn new(monitor: &'a dyn Monitor, most: usize) -> Self {
        Self { monitor, done: AtomicUsize::new(0), most }
    }

    /// Counts one finished unit and reports the progress.
    pub fn add_one(&self) {
        let done = 1 + self.done.fetch_add(1, Ordering::Relaxed);
        self.monitor.progress(done.min(self.most), self.most);
    }
}
