//! Temporary directory that is filled under a hidden name and then moved to its final place.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::{FileKind, HiddenPath, file_error, hold_gate, kind, leftovers, refuse_link, remove_stale_files};
use crate::error::{Error, Result};

/// Hidden directory that is removed however the program ends, unless it was moved to its target. It has the permissions of a normal new directory.
#[derive(Debug)]
pub struct TemporaryDirectory {
    directory: TempDir,
    /// File that holds the lock by which other programs see that this process is alive.
    _alive: Option<File>,
    _under_way: HiddenPath,
}

impl TemporaryDirectory {
    /// Creates a new hidden directory in `parent`. Its final name will be `name`.
    pub fn new(parent: &Path, name: &str) -> Result<Self> {
        remove_stale_files(parent);
        let mut builder = tempfile::Builder::new();
        let prefix = leftovers::prefix(name);
        builder.prefix(&prefix);
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
        let create = || builder.tempdir_in(parent);
        let (directory, under_way) = HiddenPath::begin(create, |directory| directory.path().to_path_buf())
            .map_err(file_error("create a directory in", parent))?;
        let alive = File::open(directory.path()).ok();
        alive.iter().for_each(leftovers::mark_alive);
        Ok(Self { directory, _alive: alive, _under_way: under_way })
    }

    /// Path of the hidden directory.
    pub fn path(&self) -> &Path {
        self.directory.path()
    }

    /// Keeps the directory, so that it is not removed, and returns its hidden path.
    pub fn keep(self) -> PathBuf {
        self.directory.keep()
    }

    /// Moves the directory to `target`, in one step if nothing exists there. An existing directory at `target` stays, because it may be
    /// someone's working directory. The entries are then moved into it one by one, and the entry `last` comes last. Readers treat a
    /// directory without this entry as unfinished.
    pub fn move_to(self, target: &Path, last: &str, remedy: &str) -> Result<()> {
        let refused = |action, source| Error::at_path(action, target, source, remedy);
        let _uninterrupted = hold_gate();
        if kind(target) != Some(FileKind::Folder) {
            refuse_link(target)?;
            fs::rename(self.path(), target).map_err(|source| refused("create", source))?;
            let _ = self.keep();
            return super::sync_directory(super::folder_of(target));
        }
        let mut names: Vec<_> = super::entries(self.path(), remedy)?.into_iter().map(|(name, _)| name).collect();
        names.sort_by_key(|name| name == last);
        for name in names {
            fs::rename(self.path().join(&name), target.join(&name)).map_err(|source| refused("write", source))?;
        }
        super::sync_directory(target)
    }
}
