//! Atomic writing of directories: a reader sees either the old or the new state, even after a program was killed.

use std::fs::{File, TryLockError};
use std::path::Path;

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{
    FileKind, TemporaryDirectory, copy, create_folders, entries, exchange, file_error, folder_of, hold_gate, is_folder,
    kind, open_lock, refuse_link, remove_all, rename, sync_directory,
};

const UNREADABLE: &str = "check that the study is complete and readable";
const UNWRITABLE: &str = "check that the study is writable and the disk has room";

/// Flushes every file and directory below `path` to the disk.
pub(super) fn sync_tree(path: &Path) -> Result<()> {
    for (name, kind) in entries(path, UNREADABLE)? {
        let child = path.join(name);
        if kind == FileKind::Folder {
            sync_tree(&child)?;
        } else {
            File::open(&child).and_then(|file| file.sync_all()).map_err(file_error("write", &child))?;
        }
    }
    sync_directory(path)
}

/// Moves a finished directory to `target`. If a directory exists at `target`, the two are exchanged in one step, and the old directory is removed.
///
/// If the system cannot exchange directories, the old directory is first renamed to `.<name>.replaced`. If the program is killed before the second renaming,
/// [`restore`] renames it back.
pub(super) fn replace_directory(finished: TemporaryDirectory, target: &Path) -> Result<()> {
    let uninterrupted = hold_gate();
    if kind(target).is_none() {
        rename(finished.path(), target)?;
        let _ = finished.keep();
    } else if exchange(finished.path(), target).is_err() {
        let aside = aside_of(target);
        remove_all(&aside)?;
        rename(target, &aside)?;
        rename(finished.path(), target)?;
        let _ = finished.keep();
        remove_all(&aside)?;
    }
    drop(uninterrupted);
    // After an exchange, the temporary name belongs to the old directory. Dropping the temporary directory removes it.
    sync_directory(folder_of(target))
}

/// Copies all files and subdirectories of `from` into the existing directory `to`. Links are not copied.
pub(super) fn copy_tree(from: &Path, to: &Path) -> Result<()> {
    for (name, kind) in entries(from, UNREADABLE)? {
        let (source, target) = (from.join(&name), to.join(&name));
        match kind {
            FileKind::Folder => {
                create_folders(&target, UNWRITABLE)?;
                copy_tree(&source, &target)?;
            }
            FileKind::File => copy(&source, &target)?,
            FileKind::Link | FileKind::Other => {
                refuse_link(&source)?;
                return Err(Error::input(
                    InputPlace::file(source),
                    "this is not a regular file",
                    "remove it from the study",
                ));
            }
        }
    }
    Ok(())
}

fn aside_of(target: &Path) -> std::path::PathBuf {
    let name = target.file_name().map_or("".into(), |name| name.to_string_lossy());
    target.with_file_name(format!(".{name}.replaced"))
}

/// Repairs a directory replacement that a killed program left unfinished. A replacement that stopped between the two renamings is undone. A replacement that stopped
/// after them is finished.
pub(super) fn restore(target: &Path) -> Result<()> {
    let aside = aside_of(target);
    if is_folder(&aside) && kind(target).is_none() {
        return rename(&aside, target);
    }
    remove_all(&aside)
}

/// Lock that a program holds while it writes to a study. The operating system releases it whenever the program ends.
#[derive(Debug)]
pub(super) struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the lock of the study in `dir`, or fails if another program holds it.
    pub(super) fn acquire(dir: &Path) -> Result<Self> {
        let path = dir.join(".lock");
        let file = open_lock(&path)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(Error::input(
                InputPlace::file(dir),
                "another program is writing to this study",
                format!("wait until it has finished, or choose another directory with `{}`", Setting::Out),
            )),
            // Some network file systems have no locks. A revision is still written completely or not at all.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Self { _file: file }),
        }
    }
}
