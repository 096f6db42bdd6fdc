//! What a command on a target leads to, and the one way in which it is written.

use std::path::{Path, PathBuf};

use base::error::Result;
use base::files::write_json_atomically;
use posterior::study::{RevisionWriter, Study, WithProvenance};
use serde::Serialize;

/// What a command led to.
pub struct Outcome<D> {
    /// The document for people and scripts.
    pub document: WithProvenance<D>,
    /// Whether it can be trusted as it stands.
    pub is_sound: bool,
    /// The directory or file that was written.
    pub written: PathBuf,
    /// The study that was changed, whose page is to be written anew; `None` where there is no page.
    pub study: Option<Study>,
}

impl<D> Outcome<D> {
    /// Name of the directory or file that was written: that of the revision, where one was.
    pub fn name(&self) -> String {
        self.written.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }
}

/// Writes a document and the files beside it into a directory of a study, whole or not at all. Returns the directory.
///
/// # Errors
/// [`base::Error::File`] where the operating system refuses, and those of `files`.
pub fn publish<D: Serialize>(
    writer: RevisionWriter,
    name: &str,
    document: &WithProvenance<D>,
    files: impl FnOnce(&Path) -> Result<()>,
) -> Result<PathBuf> {
    write_json_atomically(&writer.path().join(name), document)?;
    files(writer.path())?;
    writer.commit()
}
