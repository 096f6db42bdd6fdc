//! Reading of an experiment's files, for a creep record or an oscillation.

use std::path::{Path, PathBuf};

use super::frame::AppliedFrame;
use super::notes::Note;
use super::table::UnreadColumn;
use base::error::{Error, InputPlace, Result};
use base::files::{self, Content};
use base::toml_input::TomlTable;

/// Value of the key `kind` for an oscillation.
pub const OSCILLATION: &str = "oscillation";
/// Value of the key `kind` for creep and every other record of force and position, which is the default.
const CREEP: &str = "creep";
/// Value of `kind` for a record with a commanded position and a measured force.
pub const RELAXATION: &str = "relaxation";

/// Files of an experiment as unchanged bytes, with the notes and the interpretation of the program that read them.
#[derive(Debug, Clone, PartialEq)]
pub struct ExperimentFiles {
    /// File name of the TOML, usually `experiment.toml`.
    pub toml_name: String,
    /// Unchanged bytes of the TOML file.
    pub toml_bytes: Vec<u8>,
    /// Path of the CSV file relative to the TOML file's directory, as in `measurement.file`.
    pub csv_name: String,
    /// Unchanged bytes of the CSV file.
    pub csv_bytes: Vec<u8>,
    /// Path and bytes of the separate force log; `None` without a log, or if the log is in the CSV.
    pub log_file: Option<(String, Vec<u8>)>,
    /// Notes to the user on the data and on how they were read.
    pub notes: Vec<Note>,
    /// Choices that the reader made from the description in the TOML file.
    pub interpretation: Interpretation,
}

/// Choices that the reader made from an experiment's description. Checks compare them with the rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Interpretation {
    /// True if `force` in `[measurement]` or `[actuation]` gives the rule for the force between rows.
    pub force_rule_given: bool,
    /// Conversion of the table's coordinates to positions along the force.
    pub settled: AppliedFrame,
    /// Number of positions excluded by the key `left_out_s`.
    pub n_left_out: usize,
    /// Columns that no key names, but whose values are correlated with the position.
    pub unread: Vec<UnreadColumn>,
}

/// Description of a directory with an experiment, for messages.
const WHAT: &str = "an experiment";

/// Returns the path and bytes of an experiment's TOML file. `path` is the experiment's directory or the TOML file itself.
pub(super) fn read_toml(path: &Path) -> Result<(PathBuf, Vec<u8>)> {
    let remedy = "give a directory that holds experiment.toml, or the path of the TOML file";
    if path.is_file() && path.extension().is_none_or(|extension| extension != "toml") {
        let remedy = "make an experiment of a table with `init`, or give a directory that holds experiment.toml";
        return Err(Error::input(InputPlace::file(path), "this file is no description of an experiment", remedy));
    }
    if path.join("joint.json").is_file() {
        let found = "this directory has the joint posterior of several records";
        let remedy = "give the experiment or the study of one of the records; `design STUDY --after EXPERIMENT` joins them for a design";
        return Err(Error::input(InputPlace::file(path), found, remedy));
    }
    if !path.is_dir() {
        return Ok((path.to_path_buf(), files::read(path, Content::Settings, remedy)?));
    }
    let name = "experiment.toml";
    Ok((path.join(name), files::read_inside(path, name, WHAT, Content::Settings, remedy)?))
}

/// Reads the bytes of a table that the TOML file names. After symbolic links are resolved, the table must lie in the TOML file's directory.
pub(super) fn read_table(toml_path: &Path, name: &str, remedy: &str) -> Result<Vec<u8>> {
    files::read_inside(files::folder_of(toml_path), name, WHAT, Content::Table, remedy)
}

/// Kind of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum MeasurementKind {
    /// Commanded force and measured position over time.
    #[default]
    Creep,
    /// Commanded position and measured force over time.
    Relaxation,
    /// Moduli over frequency.
    Oscillation,
}

/// Kind by the key `kind`, under `[measurement]` or at top level. The default is `creep`.
pub(super) fn measurement_kind(root: TomlTable<'_>, measurement: TomlTable<'_>) -> Result<MeasurementKind> {
    let mut found = MeasurementKind::default();
    for table in [root, measurement] {
        match table.text("kind")?.as_deref() {
            None | Some(CREEP) => {}
            Some(RELAXATION) => found = MeasurementKind::Relaxation,
            Some(OSCILLATION) => found = MeasurementKind::Oscillation,
            Some(other) => {
                let remedy = format!("write \"{CREEP}\", \"{RELAXATION}\" or \"{OSCILLATION}\"");
                return Err(table.refuse("kind", format!("unknown kind `{other}`"), remedy));
            }
        }
    }
    Ok(found)
}

/// Reads the path of a table, and checks that it stays inside the TOML file's directory, because a study copies both files into one directory.
pub(super) fn plain_path(table: TomlTable<'_>, example: &str) -> Result<String> {
    let name = table.required_text("file", &format!("file = \"{example}\""))?;
    let inside = Path::new(&name).components().all(|part| matches!(part, std::path::Component::Normal(_)));
    if inside && !name.contains(char::is_control) {
        return Ok(name);
    }
    Err(table.refuse(
        "file",
        format!("`{name}` is not a plain path inside the TOML's directory"),
        format!("put the table beside experiment.toml and give its name, such as `file = \"{example}\"`"),
    ))
}
