//! Tracks the files that this program is writing, so it can end at any moment and leave nothing half-written.
//!
//! It keeps the hidden paths of files and directories that are being written; the end of the program removes them. Steps that belong together
//! hold a gate open. The end of the program has to close this gate, so it comes before or after them.

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

/// Hidden path that is being written; [`stop_writing`] removes it.
#[derive(Debug)]
pub(crate) struct HiddenPath(PathBuf);

impl HiddenPath {
    /// Creates a file or directory at a hidden path and registers the path. [`stop_writing`] cannot come between these two steps.
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

/// Makes [`stop_writing`] wait as long as the result lives. It is for quick steps that leave files consistent only when all are done.
pub fn hold_gate() -> RwLockReadGuard<'static, ()> {
    GATE.read().unwrap_or_else(PoisonError::into_inner)
}

/// Stops all writing; to be called right before the program ends. It waits at most `patience` for steps that belong together, lets no
/// further ones begin, and removes half-written paths. Any later attempt to write waits forever.
pub fn stop_writing(patience: Duration) {
    let began = Instant::now();
    loop {
        match GATE.try_write() {
            Ok(closed) => {
                std::mem::forget(closed);
                break;
            }
            // A rename is a single step of the operating system and stays whole even now.
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
