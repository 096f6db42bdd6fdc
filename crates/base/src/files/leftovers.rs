//! Leftovers of killed programs: hidden names that contain the process number. The next program that uses the folder removes them.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use super::enclosed;
use super::folder::FileKind;

/// Mark in the hidden name of everything that is being written.
const MARK: &str = ".partial-";
/// Age above which leftovers are removed on a file system without locks, where another machine may still be working.
const OLD: Duration = Duration::from_secs(24 * 3600);

/// Folders that were swept. Each is swept once.
static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Prefix of the hidden name under which this process writes `name`.
pub(super) fn prefix(name: &str) -> String {
    let process = std::process::id();
    if name.is_empty() { format!("{MARK}{process}-") } else { format!(".{name}{MARK}{process}-") }
}

/// Locks a file that is being written. The lock ends with the process. Other machines and containers see it, whereas the process number means
/// nothing to them. A failure on a file system without locks is ignored.
pub(super) fn mark_alive(file: &File) {
    let _ = file.try_lock();
}

/// Removes the leftovers of dead processes from a folder. Failures are ignored, because leftovers are harmless.
pub fn remove_stale_files(folder: &Path) {
    let full = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    if !SWEPT.lock().unwrap_or_else(PoisonError::into_inner).insert(full) {
        return;
    }
    let Ok(held) = enclosed::folder(folder) else { return };
    for (name, kind) in held.entries().unwrap_or_default() {
        if process_of(&name.to_string_lossy()).is_some_and(|process| !is_alive(process))
            && matches!(kind, FileKind::File | FileKind::Folder)
            && held.read(&name).is_ok_and(|file| is_given_up(&file))
        {
            let _ = held.remove_all(&name);
        }
    }
}

/// Number of the process that writes under a hidden name.
fn process_of(name: &str) -> Option<u32> {
    let (_, rest) = name.strip_prefix('.').and_then(|_| name.split_once(MARK))?;
    rest.split_once('-')?.0.parse().ok()
}

/// Returns `true` if no process holds the lock of [`mark_alive`].
fn is_given_up(file: &File) -> bool {
    match file.try_lock() {
        Ok(()) => true,
        Err(TryLockError::WouldBlock) => false,
        Err(TryLockError::Error(_)) => {
            let modified = file.metadata().and_then(|metadata| metadata.modified()).ok();
            modified.and_then(|then| then.elapsed().ok()).is_some_and(|age| age > OLD)
        }
    }
}

#[cfg(any(target_os = "linux", target_vendor = "apple"))]
fn is_alive(process: u32) -> bool {
    use rustix::process::{Pid, test_kill_process};
    let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) else { return false };
    // The call is refused for another user's process, which then is alive.
    !matches!(test_kill_process(pid), Err(rustix::io::Errno::SRCH))
}

#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
fn is_alive(process: u32) -> bool {
    process == std::process::id()
}
