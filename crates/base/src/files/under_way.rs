//! What this program is writing at the moment, so that it can end at any moment and leave nothing half-written.
//!
//! Two things are kept: the hidden names under which files and directories are being written, which the end of the program removes; and a gate
//! that steps which belong together hold open, so that the end of the program comes before or after them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError, RwLock, RwLockReadGuard};
use std::time::{Duration, Instant};

static HIDDEN_PATHS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
static GATE: RwLock<()> = RwLock::new(());
/// Time between two looks at the gate.
const LOOK: Duration = Duration::from_millis(2);
/// A thread may still write into a directory that is being removed: so many tries.
const MOST_TRIES: usize = 5;

/// A hidden path that is being written; [`stop_writing`] removes it.
#[derive(Debug)]
pub(crate) struct UnderWay(PathBuf);

impl UnderWay {
    /// Creates something at a hidden path; no stop comes between its creation and its being known.
    pub fn begin<T>(
        create: impl FnOnce() -> std::io::Result<T>,
        path_of: impl FnOnce(&T) -> PathBuf,
    ) -> std::io::Result<(T, Self)> {
        let _uninterrupted = together();
        let created = create()?;
        let path = path_of(&created);
        hidden_paths().insert(path.clone());
        Ok((created, Self(path)))
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        hidden_paths().remove(&self.0);
    }
}

fn hidden_paths() -> std::sync::MutexGuard<'static, BTreeSet<PathBuf>> {
    HIDDEN_PATHS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// As long as the result lives, [`stop_writing`] waits: for steps that leave files as they should be only when all are done. They must be quick.
pub fn together() -> RwLockReadGuard<'static, ()> {
    GATE.read().unwrap_or_else(PoisonError::into_inner)
}

/// To be called right before the program ends while threads may be writing: waits for steps that belong together, at most for so long, lets no
/// further ones begin, and removes what is half-written. Nothing can be written afterwards: whoever tries waits for ever.
pub fn stop_writing(patience: Duration) {
    let began = Instant::now();
    loop {
        match GATE.try_write() {
            Ok(closed) => {
                std::mem::forget(closed);
                break;
            }
            // A rename is one step of the operating system's, whole even now.
            Err(_) if began.elapsed() >= patience => break,
            Err(_) => std::thread::sleep(LOOK),
        }
    }
    let paths: Vec<PathBuf> = hidden_paths().iter().cloned().collect();
    paths.iter().for_each(|path| remove(path));
}

/// Removes a file or a directory with all that it holds, as far as the operating system lets.
fn remove(path: &Path) {
    for _ in 0..MOST_TRIES {
        let removed = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
        if removed.is_ok() || !path.exists() {
            return;
        }
    }
}
