//! A directory that is being filled under a hidden name.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::{Kind, UnderWay, kind, leftovers, refuse_link, refused, sweep, together};
use crate::error::{Error, Result};

/// A directory that removes itself unless it is moved away, however the program ends; readable like any other.
#[derive(Debug)]
pub struct TemporaryDirectory {
    directory: TempDir,
    /// Holds the lock that says that its process is at work.
    _alive: Option<File>,
    _under_way: UnderWay,
}

impl TemporaryDirectory {
    /// A new directory in `parent`, on its way to be `name`.
    pub fn new(parent: &Path, name: &str) -> Result<Self> {
        sweep(parent);
        let mut builder = tempfile::Builder::new();
        let prefix = leftovers::prefix(name);
        builder.prefix(&prefix);
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
        let create = || builder.tempdir_in(parent);
        let (directory, under_way) = UnderWay::begin(create, |directory| directory.path().to_path_buf())
            .map_err(refused("create a directory in", parent))?;
        let alive = File::open(directory.path()).ok();
        alive.iter().for_each(leftovers::mark_alive);
        Ok(Self { directory, _alive: alive, _under_way: under_way })
    }

    /// Where it stands.
    pub fn path(&self) -> &Path {
        self.directory.path()
    }

    /// Leaves alone what stands under the hidden name, if anything does.
    pub fn keep(self) -> PathBuf {
        self.directory.keep()
    }

    /// Moves it to where nothing is, in one step; or moves what it holds into an empty directory, `last` at the end: without that name the
    /// directory counts as unfinished. An empty directory is filled rather than exchanged, because it may be someone's working directory.
    pub fn move_to(self, target: &Path, last: &str, remedy: &str) -> Result<()> {
        let refused = |action, source| Error::at_path(action, target, source, remedy);
        let _uninterrupted = together();
        if kind(target) != Some(Kind::Folder) {
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
