//! Registers the files that this program is writing, so that no incomplete file remains if the program ends.
//!
//! The register lists the hidden paths of files and directories that are being written. [`stop_writing`] removes them when the program
//! ends. Steps that belong together hold a gate ([`hold_gate`]). [`stop_writing`] must close the gate first, so it never interrupts such
//! steps.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError, RwLock, RwLockReadGuard};
use std::time::{Duration, Instant};

static HIDDEN_PATHS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
static GATE: RwLock<()> = RwLock::new(());
/// Time between two attempts of [`stop_writing`] to close the gate.
const LOOK: Duration = Duration::from_millis(2);
/// Number of attempts to remove a directory into which a thread may still write.
const MOST_TRIES: usize = 5;

/// Registered hidden path of a file or directory that is being written. [`stop_writing`] removes this file or directory.
#[derive(Debug)]
pub(crate) struct HiddenPath(PathBuf);

impl HiddenPath {
    /// Makes a file or directory at a hidden path by `create`, and registers the path that `path_of` returns. [`stop_writing`] cannot run
    /// between these two actions.
    pub fn begin<T>(
        create: impl FnOnce() -> std::io::Result<T>,
        path_of: impl FnOnce(&T) -> PathBuf,
    ) -> std::io::Result<(T, Self)> {
        let _uninterrupted = hold_gate();
        let created = create()?;
        let path = path_of(&created);
        hidden_paths().insert(path.clone());
        Ok((created, Self(path)))
    }
}

impl Drop for HiddenPath {
    fn drop(&mut self) {
        hidden_paths().remove(&self.0);
    }
}

fn hidden_paths() -> std::sync::MutexGuard<'static, BTreeSet<PathBuf>> {
    HIDDEN_PATHS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes [`stop_writing`] wait until the returned guard is dropped. Hold the guard during quick steps that leave files consistent only
/// together.
pub fn hold_gate() -> RwLockReadGuard<'static, ()> {
    GATE.read().unwrap_or_else(PoisonError::into_inner)
}

/// Stops all writing. Call this function right before the program ends. It waits at most `patience` for steps that hold the gate
/// ([`hold_gate`]), and lets no further steps begin. It then removes incomplete files. A later attempt to write waits forever.
pub fn stop_writing(patience: Duration) {
    let began = Instant::now();
    loop {
        match GATE.try_write() {
            Ok(closed) => {
                std::mem::forget(closed);
                break;
            }
            // The time limit has passed. A rename is a single step of the operating system, so it stays complete even now.
            Err(_) if began.elapsed() >= patience => break,
            Err(_) => std::thread::sleep(LOOK),
        }
    }
    let paths: Vec<PathBuf> = hidden_paths().iter().cloned().collect();
    paths.iter().for_each(|path| remove(path));
}

/// Removes a file or a directory with its content, as far as the operating system allows.
fn remove(path: &Path) {
    for _ in 0..MOST_TRIES {
        let removed = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
        if removed.is_ok() || !path.exists() {
            return;
        }
    }
}
