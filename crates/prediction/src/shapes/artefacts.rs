//! Writes all files of a shape study to `<study>/shapes/`, or none of them if an error occurs.

use std::path::PathBuf;

use super::figures::shapes_figure;
use super::job::ShapesResult;
use base::error::Result;
use documents::shapes::ShapesSummary;
use elements::mesh::vtu::{PointData, write_vtu};
use figures::svg::write_figure;
use posterior::study::{Provenance, RevisionWriter, Study, WithProvenance};

/// Name of the folder in the study's directory.
const FOLDER: &str = "shapes";

/// Writes the document and its figure. For each equal-volume body it also writes the gel's mesh and displacement, for ParaView. Returns the folder.
///
/// # Errors
/// [`base::Error::File`] if a file cannot be written.
pub fn write(study: &Study, found: &ShapesResult, summary: &ShapesSummary, provenance: Provenance) -> Result<PathBuf> {
    let document = WithProvenance { provenance, body: summary };
    RevisionWriter::begin(study.dir(), FOLDER)?.publish("shapes.json", &document, |dir| {
        write_figure(dir, FOLDER, &shapes_figure(found, summary)?)?;
        for body_field in &found.fields {
            let displacement = PointData {
                name: "displacement_per_displacement_of_robot",
                components: 3,
                values: body_field.displacement.as_flattened(),
            };
            let name = body_field.body.label().replace(", ", "_");
            write_vtu(dir.join(format!("{name}.vtu")), &body_field.mesh, &[displacement])?;
        }
        Ok(())
    })
}
