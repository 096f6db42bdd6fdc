//! Writing so that a reader sees the old state or the new one, and a kill leaves one of them.

use std::fs::{self, File, TryLockError};
use std::path::Path;

use base::error::{Error, Place, Result, Setting};
use base::files::{TemporaryDirectory, folder_of, refused, sync_directory, together};

/// Flushes every file and directory below `path` to the disk.
pub(super) fn sync_tree(path: &Path) -> Result<()> {
    for entry in fs::read_dir(path).map_err(refused("read", path))? {
        let entry = entry.map_err(refused("read", path))?;
        let child = entry.path();
        if entry.file_type().map_err(refused("read", &child))?.is_dir() {
            sync_tree(&child)?;
        } else {
            File::open(&child).and_then(|file| file.sync_all()).map_err(refused("write", &child))?;
        }
    }
    sync_directory(path)
}

/// Removes a directory with all it holds, if it is there.
pub(super) fn remove_tree(path: &Path) -> Result<()> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(refused("remove", path)(error)),
        _ => Ok(()),
    }
}

/// Moves a finished directory to `target`; what was there is exchanged in one step and then removed.
///
/// Where the system cannot exchange, the old directory is first renamed to `.<name>.replaced`, which [`restore`]
/// brings back should the program be killed before the second renaming.
pub(super) fn replace_directory(finished: TemporaryDirectory, target: &Path) -> Result<()> {
    let uninterrupted = together();
    if !target.exists() {
        fs::rename(finished.path(), target).map_err(refused("create", target))?;
        let _ = finished.keep();
    } else if exchange(finished.path(), target).is_err() {
        let aside = aside_of(target);
        remove_tree(&aside)?;
        fs::rename(target, &aside).map_err(refused("replace", target))?;
        fs::rename(finished.path(), target).map_err(refused("replace", target))?;
        let _ = finished.keep();
        remove_tree(&aside)?;
    }
    drop(uninterrupted);
    // After an exchange the temporary name holds what was replaced, and dropping it removes that.
    sync_directory(folder_of(target))
}

/// Copies what a directory holds into one that is there.
pub(super) fn copy_tree(from: &Path, to: &Path) -> Result<()> {
    for entry in fs::read_dir(from).map_err(refused("read", from))? {
        let entry = entry.map_err(refused("read", from))?;
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        if source.is_dir() {
            fs::create_dir_all(&target).map_err(refused("create", &target))?;
            copy_tree(&source, &target)?;
        } else if source.is_file() {
            fs::copy(&source, &target).map_err(refused("copy", &source))?;
        } else {
            return Err(Error::input(Place::file(source), "this is no regular file", "remove it from the study"));
        }
    }
    Ok(())
}

fn aside_of(target: &Path) -> std::path::PathBuf {
    let name = target.file_name().map_or("".into(), |name| name.to_string_lossy());
    target.with_file_name(format!(".{name}.replaced"))
}

/// Undoes a replacement that was killed between its two renamings, or finishes one killed after them.
pub(super) fn restore(target: &Path) -> Result<()> {
    let aside = aside_of(target);
    if aside.is_dir() && !target.exists() {
        return fs::rename(&aside, target).map_err(refused("restore", target));
    }
    remove_tree(&aside)
}

#[cfg(any(target_os = "linux", target_vendor = "apple"))]
fn exchange(a: &Path, b: &Path) -> std::io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    Ok(renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE)?)
}

#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
fn exchange(_: &Path, _: &Path) -> std::io::Result<()> {
    Err(std::io::ErrorKind::Unsupported.into())
}

/// Held while a program writes to a study; the operating system releases it when the program ends, however it ends.
#[derive(Debug)]
pub(super) struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the study's lock.
    pub(super) fn acquire(dir: &Path) -> Result<Self> {
        let path = dir.join(".lock");
        // Opening a pipe would wait for somebody to read from it.
        if path.exists() && !path.is_file() {
            return Err(Error::input(Place::file(path), "this is not the file that the study keeps here", "remove it"));
        }
        let file = File::create(&path).map_err(refused("create", &path))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(Error::input(
                Place::file(dir),
                "another program is writing to this study",
                format!("wait until it has finished, or choose another directory with `{}`", Setting::Out),
            )),
            // Some network file systems have no locks; a revision is still written whole or not at all there.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Self { _file: file }),
        }
    }
}
