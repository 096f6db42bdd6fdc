//! Files of a comparison of groups in `<out>/<keys>/`, written completely or not at all. The draws of single experiments are in `<out>/experiments/`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::cohort::{Key, Measurement};
use super::figures;
use super::job::Comparison;
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{Content, read_if_there, write_atomically};
use documents::groups::GroupsSummary;
use posterior::study::{Provenance, RevisionWriter, WithProvenance};

/// Name of the folder with the draws of single experiments.
pub const EXPERIMENTS: &str = "experiments";
/// File name of the comparison's document.
const DOCUMENT: &str = "groups.json";

/// Name of the folder for a comparison of groups that `keys` define, such as `species-region`.
pub fn folder_name(keys: &[Key]) -> String {
    keys.iter().map(|key| key.name()).collect::<Vec<&str>>().join("-")
}

/// Makes the header of a document of the given kind, with the hash of each experiment.
pub fn provenance_of(kind: &str, measurements: &[Measurement], seed: u64) -> Provenance {
    let inputs: BTreeMap<String, String> = measurements
        .iter()
        .map(|measurement| (measurement.path.display().to_string(), measurement.inputs_sha256.clone()))
        .collect();
    Provenance::new(kind, 1, seed, inputs)
}

/// Refuses an output folder that holds a comparison of other experiments, or another document.
///
/// # Errors
/// [`Error::Input`] unless `force` is set.
pub fn check_place(out: &Path, keys: &[Key], provenance: &Provenance, force: bool) -> Result<()> {
    let found = "this is a comparison of other experiments";
    let remedy = format!(
        "choose another directory with `{}`, or replace the comparison with `{}` (experiments that were sampled are kept and used)",
        Setting::Out,
        Setting::Force
    );
    refuse_other(out.join(folder_name(keys)).join(DOCUMENT), provenance, force, (found, &remedy))
}

/// Refuses to replace the document `file` if it is about other experiments. The caller gives the error's texts `found` and `remedy`.
///
/// # Errors
/// [`Error::Input`] unless `force` is set.
pub(super) fn refuse_other(
    file: PathBuf,
    provenance: &Provenance,
    force: bool,
    (found, remedy): (&str, &str),
) -> Result<()> {
    if force || is_free(&file, provenance) { Ok(()) } else { Err(Error::input(InputPlace::file(file), found, remedy)) }
}

/// Returns `true` if the document does not exist, or if its experiments have the hashes in `provenance`. Paths of experiments may have changed.
fn is_free(file: &Path, provenance: &Provenance) -> bool {
    let Some(bytes) = read_if_there(file, Content::Document) else { return true };
    let before: Option<Provenance> = serde_json::from_slice(&bytes).ok();
    let hashes = |provenance: &Provenance| {
        let mut all: Vec<String> = provenance.inputs_sha256.values().cloned().collect();
        all.sort();
        all
    };
    before.is_some_and(|before| hashes(&before) == hashes(provenance))
}

/// Writes all files of the comparison, and returns their folder.
///
/// # Errors
/// [`Error::File`] if the file system refuses, and errors of the figures.
pub fn write(
    out: &Path,
    keys: &[Key],
    found: &Comparison,
    summary: &GroupsSummary,
    provenance: Provenance,
) -> Result<PathBuf> {
    let document = WithProvenance { provenance, body: summary };
    RevisionWriter::begin(out, &folder_name(keys))?.publish(DOCUMENT, &document, |dir| {
        write_atomically(&dir.join("groups.csv"), &groups_csv(summary)?)?;
        write_atomically(&dir.join("contrasts.csv"), &contrasts_csv(summary)?)?;
        write_atomically(&dir.join("specimens.csv"), &specimens_csv(summary)?)?;
        write_atomically(&dir.join("new-specimens.csv"), &new_specimens_csv(found)?)?;
        figures::write_netcdf(&dir.join("population.nc"), found)?;
        figures::write(&dir.join("figures"), found, summary)
    })
}

/// Makes a CSV table from a header and rows of texts.
pub(super) fn table<'a>(
    header: impl Iterator<Item = &'a str>,
    rows: impl Iterator<Item = Vec<String>>,
) -> Result<Vec<u8>> {
    let refused = |error: csv::Error| Error::numerical(format!("a table cannot be written: {error}"), "use the JSON");
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(header).map_err(refused)?;
    for row in rows {
        writer.write_record(row).map_err(refused)?;
    }
    writer.into_inner().map_err(|error| Error::numerical(format!("a table cannot be written: {error}"), "use the JSON"))
}

/// Largest number of draws of a group in the table of new specimens.
const MOST_NEW_SPECIMENS: usize = 4_000;

/// Table of new specimens, two for each draw of the population: the name of the group, the number of the pair, then the parameters in the units of their names.
fn new_specimens_csv(found: &Comparison) -> Result<Vec<u8>> {
    let header = ["group", "draw"].into_iter().chain(found.parameters.iter().copied());
    let p = found.parameters.len();
    let rows = found.groups.iter().flat_map(|group| {
        let every = (group.new_specimen.len() / p).div_ceil(MOST_NEW_SPECIMENS).max(1);
        let pairs = group.new_specimen.chunks_exact(p).zip(group.other_specimen.chunks_exact(p));
        pairs.step_by(every).enumerate().flat_map(move |(number, (one, other))| {
            [one, other].map(|specimen| {
                let values = specimen.iter().zip(&found.scales).map(|(x, scale)| scale.value(*x).to_string());
                [group.name.clone(), number.to_string()].into_iter().chain(values).collect()
            })
        })
    });
    table(header, rows)
}

fn groups_csv(summary: &GroupsSummary) -> Result<Vec<u8>> {
    const HEADER: &str = "group,specimens,experiments,parameter,median,q05,q95,between_specimen_log_sd,new_specimen_q05,new_specimen_q95,pooling";
    let rows = summary.groups.iter().flat_map(|group| {
        group.parameters.iter().map(|parameter| {
            let [lower, upper] = parameter.new_specimen_90;
            let mut row = vec![
                group.name.clone(),
                group.specimens.to_string(),
                group.experiments.to_string(),
                parameter.name.clone(),
            ];
            row.extend(
                [parameter.median, parameter.q05, parameter.q95, parameter.between_specimen_log_sd, lower, upper]
                    .map(|x| x.to_string()),
            );
            row.push(parameter.pooling.map_or_else(String::new, |x| x.to_string()));
            row
        })
    });
    table(HEADER.split(','), rows)
}

fn contrasts_csv(summary: &GroupsSummary) -> Result<Vec<u8>> {
    const HEADER: &str = "parameter,a,b,ratio_median,q05,q95,probability_greater,probability_beyond_margin,probability_below_margin,is_declared,more_specimens_per_group";
    let rows = summary.contrasts.iter().map(|contrast| {
        let numbers = [
            contrast.ratio_median,
            contrast.q05,
            contrast.q95,
            contrast.probability_greater,
            contrast.probability_beyond_margin,
            contrast.probability_below_margin,
        ];
        let mut row = vec![contrast.parameter.clone(), contrast.a.clone(), contrast.b.clone()];
        row.extend(numbers.map(|x| x.to_string()));
        row.push(contrast.is_declared.to_string());
        row.push(contrast.more.and_then(|plan| plan.specimens_per_group).map_or_else(String::new, |n| n.to_string()));
        row
    });
    table(HEADER.split(','), rows)
}

fn specimens_csv(summary: &GroupsSummary) -> Result<Vec<u8>> {
    const HEADER: &str =
        "specimen,group,parameter,alone_median,alone_q05,alone_q95,pooled_median,pooled_q05,pooled_q95,is_outlying";
    let rows = summary.specimens.iter().flat_map(|specimen| {
        specimen.parameters.iter().map(|parameter| {
            let numbers = [parameter.alone, parameter.pooled].map(|[q05, median, q95]| [median, q05, q95]).concat();
            let mut row = vec![specimen.name.clone(), specimen.group.clone(), parameter.name.clone()];
            row.extend(numbers.iter().map(f64::to_string));
            row.push(specimen.is_outlying.to_string());
            row
        })
    });
    table(HEADER.split(','), rows)
}
