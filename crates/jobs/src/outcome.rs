//! What a command on a target leads to.

use std::path::PathBuf;

use posterior::study::{Study, WithProvenance};

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
