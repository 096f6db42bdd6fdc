//! Removal of incomplete files that killed processes left behind. The hidden name of such a file contains the process number. The next
//! process of this program that uses the folder removes the file.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use super::enclosed;
use super::folder::FileKind;

/// Text in the hidden name of every file or directory that is being written.
const MARK: &str = ".partial-";
/// Age above which leftovers are removed on a file system without locks. Younger leftovers may belong to a program on another machine.
const OLD: Duration = Duration::from_secs(24 * 3600);

/// Folders whose leftovers this process has already removed. Each folder is cleaned once.
static CLEANED_FOLDERS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Prefix of the hidden name under which this process writes the file `name`.
pub(super) fn prefix(name: &str) -> String {
    let process = std::process::id();
    if name.is_empty() { format!("{MARK}{process}-") } else { format!(".{name}{MARK}{process}-") }
}

/// Locks a file that is being written. The lock ends with the process. Other machines and containers cannot check a process number, but
/// they see the lock. A failure on a file system without locks is ignored.
pub(super) fn mark_alive(file: &File) {
    let _ = file.try_lock();
}

/// Removes incomplete files and directories of ended processes from a folder. Failures are ignored, because leftovers are harmless.
pub fn remove_stale_files(folder: &Path) {
    let full = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    if !CLEANED_FOLDERS.lock().unwrap_or_else(PoisonError::into_inner).insert(full) {
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

/// Reads the process number from the hidden name of an incomplete file; `None` for all other names.
fn process_of(name: &str) -> Option<u32> {
    let (_, rest) = name.strip_prefix('.').and_then(|_| name.split_once(MARK))?;
    rest.split_once('-')?.0.parse().ok()
}

/// Returns `true` if no process holds the lock of [`mark_alive`], or if the file system has no locks and the file is older than [`OLD`].
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
    // The system refuses the test for a process of another user. That process is alive.
    !matches!(test_kill_process(pid), Err(rustix::io::Errno::SRCH))
}

#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
fn is_alive(process: u32) -> bool {
    process == std::process::id()
}
