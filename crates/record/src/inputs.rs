//! The files of an experiment, whichever kind of measurement they hold.

use std::path::{Path, PathBuf};

use super::frame::Settled;
use super::notes::Note;
use super::table::UnreadColumn;
use base::error::Result;
use base::files::{self, Content};
use base::toml_input::Table;

/// Word of `kind` that says that a table is an oscillation.
pub const OSCILLATION: &str = "oscillation";
/// The other kinds of `kind`.
const CREEP: &str = "creep";

/// The files of an experiment exactly as they were read, and what the reader noticed.
#[derive(Debug, Clone, PartialEq)]
pub struct ExperimentFiles {
    /// File name of the TOML, `experiment.toml` as a rule.
    pub toml_name: String,
    /// Its bytes, unchanged.
    pub toml_bytes: Vec<u8>,
    /// Path of the CSV relative to the TOML, as it stands in `measurement.file`.
    pub csv_name: String,
    /// Its bytes, unchanged.
    pub csv_bytes: Vec<u8>,
    /// Path and bytes of the force's own log, where there is one and it is another file.
    pub log_file: Option<(String, Vec<u8>)>,
    /// What a person should know about how the data were understood.
    pub notes: Vec<Note>,
    /// How the description was taken.
    pub understood: Understood,
}

/// How a description was taken, for whoever holds it against the rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Understood {
    /// Whether `force` in `[measurement]` says what the force does between rows.
    pub force_rule_given: bool,
    /// What was done to the coordinates.
    pub settled: Settled,
    /// Positions that `left_out_s` leaves out.
    pub n_left_out: usize,
    /// Columns that are not read although they follow the position.
    pub unread: Vec<UnreadColumn>,
}

/// What a directory of measurements is, for messages.
const WHAT: &str = "an experiment";

/// Path and bytes of the TOML of an experiment that is named by its directory or by the TOML itself.
pub(super) fn read_toml(path: &Path) -> Result<(PathBuf, Vec<u8>)> {
    let remedy = "give a directory that holds experiment.toml, or the path of the TOML file";
    if !path.is_dir() {
        return Ok((path.to_path_buf(), files::read(path, Content::Settings, remedy)?));
    }
    let name = "experiment.toml";
    Ok((path.join(name), files::read_inside(path, name, WHAT, Content::Settings, remedy)?))
}

/// Bytes of a table that the TOML names; it lies in the TOML's directory, and no link leads out of that.
pub(super) fn read_table(toml_path: &Path, name: &str, remedy: &str) -> Result<Vec<u8>> {
    files::read_inside(files::folder_of(toml_path), name, WHAT, Content::Table, remedy)
}

/// What `kind` says, under `[measurement]` or by itself; a creep where it is left out.
pub(super) fn is_oscillation(root: Table<'_>, measurement: Table<'_>) -> Result<bool> {
    let mut found = false;
    for table in [root, measurement] {
        match table.text("kind")?.as_deref() {
            None | Some(CREEP) => {}
            Some(OSCILLATION) => found = true,
            Some(other) => {
                let remedy = format!("write \"{CREEP}\" or \"{OSCILLATION}\"");
                return Err(table.refuse("kind", format!("unknown kind `{other}`"), remedy));
            }
        }
    }
    Ok(found)
}

/// A table's path must stay inside the TOML's directory, because a study copies the files side by side.
pub(super) fn plain_path(table: Table<'_>, example: &str) -> Result<String> {
    let name = table.required_text("file", &format!("file = \"{example}\""))?;
    let inside = Path::new(&name).components().all(|part| matches!(part, std::path::Component::Normal(_)));
    if inside && !name.contains(char::is_control) {
        return Ok(name);
    }
    Err(table.refuse(
        "file",
        format!("`{name}` is not a plain path below the directory of the TOML"),
        format!("put the table beside experiment.toml and give its name, such as `file = \"{example}\"`"),
    ))
}
