//! What a killed program leaves behind: hidden names that carry its process, removed by the next program that looks into the folder.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use super::enclosed;
use super::folder::Kind;

/// What stands in the name of everything that is being written.
const MARK: &str = ".partial-";
/// Where a file system has no locks, another machine may be at work: its leftovers are told by their age.
const OLD: Duration = Duration::from_secs(24 * 3600);

/// Folders that were looked into: once each is enough.
static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Beginning of the hidden name under which this process writes `name`.
pub(super) fn prefix(name: &str) -> String {
    let process = std::process::id();
    if name.is_empty() { format!("{MARK}{process}-") } else { format!(".{name}{MARK}{process}-") }
}

/// Locks what is being written: the lock ends with the process, however that ends, and other machines and containers, to which its number means
/// nothing, see it too. Some file systems have no locks; then nothing is lost but that.
pub(super) fn mark_alive(file: &File) {
    let _ = file.try_lock();
}

/// Removes what dead processes have left in a folder. What cannot be removed stays: it is in nobody's way.
pub fn sweep(folder: &Path) {
    let full = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    if !SWEPT.lock().unwrap_or_else(PoisonError::into_inner).insert(full) {
        return;
    }
    let Ok(held) = enclosed::folder(folder) else { return };
    for (name, kind) in held.entries().unwrap_or_default() {
        if process_of(&name.to_string_lossy()).is_some_and(|process| !is_alive(process))
            && matches!(kind, Kind::File | Kind::Folder)
            && held.read(&name).is_ok_and(|file| is_given_up(&file))
        {
            let _ = held.remove_all(&name);
        }
    }
}

/// The process that writes under a hidden name.
fn process_of(name: &str) -> Option<u32> {
    let (_, rest) = name.strip_prefix('.').and_then(|_| name.split_once(MARK))?;
    rest.split_once('-')?.0.parse().ok()
}

/// Whether nobody holds the lock of [`mark_alive`].
fn is_given_up(file: &File) -> bool {
    match file.try_lock() {
        Ok(()) => true,
        Err(TryLockError::WouldBlock) => false,
        Err(TryLockError::Error(_)) => {
            let modified = file.metadata().and_then(|own| own.modified()).ok();
            modified.and_then(|then| then.elapsed().ok()).is_some_and(|age| age > OLD)
        }
    }
}

#[cfg(any(target_os = "linux", target_vendor = "apple"))]
fn is_alive(process: u32) -> bool {
    use rustix::process::{Pid, test_kill_process};
    let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) else { return false };
    // Refused for another user's process, which is alive then.
    !matches!(test_kill_process(pid), Err(rustix::io::Errno::SRCH))
}

#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
fn is_alive(process: u32) -> bool {
    process == std::process::id()
}
