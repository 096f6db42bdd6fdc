//! Result of a command on a target.

use std::path::PathBuf;

use posterior::study::{Study, WithProvenance};

/// Result of a command.
pub struct Outcome<D> {
    /// Document for people and scripts.
    pub document: WithProvenance<D>,
    /// `true` if the result can be trusted.
    pub is_sound: bool,
    /// Directory or file that was written.
    pub written: PathBuf,
    /// Changed study whose page must be written again; `None` if there is no page.
    pub study: Option<Study>,
}

impl<D> Outcome<D> {
    /// Name of the written directory or file; for a new revision, the revision's name.
    pub fn name(&self) -> String {
        self.written.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }
}
