//! Result of a command: document, soundness and written files.

use std::path::PathBuf;

use posterior::study::{Study, WithProvenance};

/// Result of a command on a target, with the document `D`.
pub struct Outcome<D> {
    /// Document for people and scripts, with its provenance.
    pub document: WithProvenance<D>,
    /// `true` if the result is trustworthy.
    pub is_sound: bool,
    /// Directory or file that the command wrote.
    pub written: PathBuf,
    /// Study that the command changed, so that its page must be written again. `None` if the study has no page.
    pub study: Option<Study>,
}

impl<D> Outcome<D> {
    /// Name of the directory or file that the command wrote. For a new revision, the revision's name.
    pub fn name(&self) -> String {
        self.written.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }
}
