//! Writer of a revision, which makes its files visible in one step.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::WithProvenance;
use super::atomic::{Lock, replace_directory, restore, sync_tree};
use base::error::Result;
use base::files::{FileKind, TemporaryDirectory, entries, forbid_links, remove_all, write_json_atomically};

/// Writer of a revision or simulation in a hidden directory of the study. Dropping the writer discards the files.
///
/// The writer holds the study's lock, so that only one program at a time writes to a study.
#[derive(Debug)]
pub struct RevisionWriter {
    building: TemporaryDirectory,
    target: PathBuf,
    _lock: Lock,
}

impl RevisionWriter {
    pub fn begin(study_dir: &Path, name: &str) -> Result<Self> {
        forbid_links(study_dir, super::WHAT);
        let lock = Lock::acquire(study_dir)?;
        let target = study_dir.join(name);
        restore(&target)?;
        remove_leftovers(study_dir)?;
        let building = TemporaryDirectory::new(study_dir, name)?;
        Ok(Self { building, target, _lock: lock })
    }

    /// Hidden directory in which the revision's files are written.
    pub fn path(&self) -> &Path {
        self.building.path()
    }

    /// Writes the document `name` and calls `files` to write further files into the hidden directory. Then makes the revision visible, completely or not at all.
    /// Returns the revision's directory.
    ///
    /// # Errors
    /// [`base::error::Error::File`] if the operating system refuses, and errors of `files`.
    pub fn publish<D: Serialize>(
        self,
        name: &str,
        document: &WithProvenance<D>,
        files: impl FnOnce(&Path) -> Result<()>,
    ) -> Result<PathBuf> {
        write_json_atomically(&self.path().join(name), document)?;
        files(self.path())?;
        self.commit()
    }

    /// Makes the revision visible under its name. An earlier revision of this name is replaced in one step.
    ///
    /// # Errors
    /// [`base::error::Error::File`] if the operating system refuses. An earlier revision is then unchanged.
    pub fn commit(self) -> Result<PathBuf> {
        sync_tree(self.building.path())?;
        replace_directory(self.building, &self.target)?;
        Ok(self.target)
    }
}

/// Removes leftovers of killed programs; the lock ensures that none of these programs is still running.
fn remove_leftovers(study_dir: &Path) -> Result<()> {
    for (name, kind) in entries(study_dir, "check that the study is readable")? {
        let text = name.to_string_lossy();
        if text.starts_with('.') && text.contains(".partial-") && kind == FileKind::Folder {
            remove_all(&study_dir.join(&name))?;
        }
    }
    Ok(())
}
