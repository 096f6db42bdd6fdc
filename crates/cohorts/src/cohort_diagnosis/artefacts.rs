//! Files of a cohort's diagnosis, written completely or not at all.

use std::path::{Path, PathBuf};

use crate::artefacts::{refuse_other, table};
use base::error::{Error, Result, Setting};
use base::files::{write_atomically, write_json_atomically};
use documents::cohort::CohortDiagnosis;
use figures::cohort::cohort;
use figures::svg::write_figure;
use posterior::study::{Provenance, RevisionWriter, WithProvenance};

/// Name of the diagnosis's folder, inside the output directory.
const FOLDER: &str = "diagnosis";
/// File name of the document in this folder.
const DOCUMENT: &str = "cohort-diagnosis.json";
/// File name of the table that lists the gain in log likelihood of each record by each effect.
const TABLE: &str = "gains.csv";
/// File name of the figure, without extension.
const FIGURE: &str = "cohort";

/// Refuses an output folder with a diagnosis of other records.
///
/// # Errors
/// [`Error::Input`] unless `force` is set.
pub fn check_place(out: &Path, provenance: &Provenance, force: bool) -> Result<()> {
    let (found, remedy) = (
        "this is a diagnosis of other records",
        format!("choose another directory with `{}`, or replace the diagnosis with `{}`", Setting::Out, Setting::Force),
    );
    refuse_other(out.join(FOLDER).join(DOCUMENT), provenance, force, (found, &remedy))
}

/// Writes all files of the diagnosis, and returns their folder.
///
/// # Errors
/// [`Error::File`] if the file system refuses, and errors of the figures.
pub fn write(out: &Path, diagnosis: &CohortDiagnosis, provenance: Provenance) -> Result<PathBuf> {
    let make = |dir: &Path| {
        let remedy = format!("choose a writable place with `{}`", Setting::Out);
        std::fs::create_dir_all(dir).map_err(|source| Error::at_path("create", dir, source, remedy))
    };
    make(out)?;
    let writer = RevisionWriter::begin(out, FOLDER)?;
    let dir = writer.path();
    write_json_atomically(&dir.join(DOCUMENT), &WithProvenance { provenance, body: diagnosis })?;
    write_atomically(&dir.join(TABLE), &gains_csv(diagnosis)?)?;
    let figures = dir.join("figures");
    make(&figures)?;
    write_figure(&figures, FIGURE, &cohort(diagnosis)?)?;
    writer.commit()
}

/// Makes the CSV table of gains in log likelihood, with one row for each record and effect.
fn gains_csv(diagnosis: &CohortDiagnosis) -> Result<Vec<u8>> {
    let rows = diagnosis.specimens.iter().flat_map(|specimen| {
        specimen.gains.iter().map(|gain| {
            let group = specimen.group.clone().unwrap_or_default();
            let [gain_nats, own_gain_nats] = [gain.gain_nats, gain.own_gain_nats].map(|x| x.to_string());
            vec![specimen.id.clone(), specimen.experiment.clone(), group, gain.effect.clone(), gain_nats, own_gain_nats]
        })
    });
    table("specimen,experiment,group,effect,gain_nats,own_gain_nats".split(','), rows)
}
