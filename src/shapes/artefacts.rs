//! The files of a study of shapes: `<study>/shapes/`, written whole or not at all.

use std::path::PathBuf;

use super::figures::shapes_figure;
use super::job::ShapesResult;
use super::summary::ShapesSummary;
use crate::error::Result;
use crate::files::write_json_atomically;
use crate::report::svg::write_figure;
use crate::study::{Provenance, RevisionWriter, Study, WithProvenance};

/// The folder, beside the revisions.
const FOLDER: &str = "shapes";

/// Writes the document and its figure. Returns their folder.
///
/// # Errors
/// [`crate::Error::File`] where the file system refuses.
pub fn write(study: &Study, found: &ShapesResult, summary: &ShapesSummary, provenance: Provenance) -> Result<PathBuf> {
    let writer = RevisionWriter::begin(study.dir(), FOLDER)?;
    write_json_atomically(&writer.path().join("shapes.json"), &WithProvenance { provenance, body: summary })?;
    write_figure(writer.path(), FOLDER, &shapes_figure(found, summary)?)?;
    writer.commit()
}
