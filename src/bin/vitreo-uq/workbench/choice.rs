//! Writes the user's choice of rows into the description of an experiment: fitted cycles, held-out cycles, and time ranges to exclude.

use std::path::Path;

use serde::Deserialize;

use super::home::DESCRIPTION;
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files::{self, Content};
use vitreo_uq::record::Experiment;

/// Choice of rows that the page sends.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct RowChoice {
    /// Name of the item whose experiment is changed.
    pub item: String,
    /// Numbers of the fitted cycles.
    pub fitted: Vec<u32>,
    /// Numbers of the held-out cycles.
    pub heldout: Vec<u32>,
    /// Time ranges (start and end in s) whose positions are excluded.
    pub left_out_s: Vec<[f64; 2]>,
}

/// Writes a choice into the description in the folder `dir`. First checks that the experiment can be read with the changed description.
pub fn apply_choice(dir: &Path, choice: &RowChoice) -> Result<()> {
    let text = read_description(dir)?;
    let list = |numbers: &[u32]| format!("{numbers:?}");
    let intervals: Vec<String> = choice.left_out_s.iter().map(|[from, to]| format!("[{from:?}, {to:?}]")).collect();
    let keys = [
        ("calibration_cycles", Some(list(&choice.fitted))),
        ("heldout_cycles", Some(list(&choice.heldout))),
        ("left_out_s", (!intervals.is_empty()).then(|| format!("[{}]", intervals.join(", ")))),
    ];
    let changed = with_keys(&text, "measurement", &keys).ok_or_else(|| {
        let place = InputPlace::file(dir.join(DESCRIPTION)).at_key("measurement");
        let found = "this page cannot change the layout of its lines";
        Error::input(place, found, "change the description in an editor")
    })?;
    replace_description(dir, &changed)
}

/// Text of the description in the folder `dir`.
pub fn read_description(dir: &Path) -> Result<String> {
    let path = dir.join(DESCRIPTION);
    let remedy = "restore the description";
    String::from_utf8(files::read(&path, Content::Settings, remedy)?)
        .map_err(|_| Error::input(InputPlace::file(&path), "this is not text", remedy))
}

/// Writes another description into the folder `dir`, if the experiment can be read with it.
pub fn replace_description(dir: &Path, changed: &str) -> Result<()> {
    let path = dir.join(DESCRIPTION);
    // The experiment is read with the changed description in a temporary file beside the original. Only then is the original replaced.
    let trial = tempfile::Builder::new().prefix(".trial-").suffix(".toml").tempfile_in(dir);
    let trial = trial.map_err(|error| Error::at_path("write", dir, error, "make the folder writable"))?;
    std::fs::write(trial.path(), changed)
        .map_err(|error| Error::at_path("write", trial.path(), error, "make the folder writable"))?;
    Experiment::read(trial.path()).map_err(|error| match error {
        Error::Input { mut place, found, remedy } => {
            if place.file.as_deref() == Some(trial.path()) {
                place.file = Some(path.clone());
            }
            Error::Input { place, found, remedy }
        }
        other => other,
    })?;
    files::write_atomically(&path, changed.as_bytes())
}

/// Returns the text of a description in which keys of a table, such as `[measurement]`, are set, or removed if their value is `None`. Returns `None` if any other value would
/// change.
pub fn with_keys(text: &str, table: &str, keys: &[(&str, Option<String>)]) -> Option<String> {
    let mut lines: Vec<String> = text.lines().map(String::from).collect();
    let is_head = |line: &String| line.split('#').next().is_some_and(|line| line.trim() == format!("[{table}]"));
    let head = lines.iter().position(is_head)?;
    for (key, value) in keys {
        let end = lines[head + 1..].iter().position(|line| line.trim_start().starts_with('['));
        let end = end.map_or(lines.len(), |place| head + 1 + place);
        let is_key = |line: &String| line.split_once('=').is_some_and(|(name, _)| name.trim() == *key);
        let there = lines[head + 1..end].iter().position(is_key).map(|place| head + 1 + place);
        match (there, value) {
            (Some(place), Some(value)) => lines[place] = format!("{key} = {value}"),
            (Some(place), None) => drop(lines.remove(place)),
            (None, Some(value)) => lines.insert(head + 1, format!("{key} = {value}")),
            (None, None) => {}
        }
    }
    let changed = lines.join("\n") + "\n";
    let without = |text: &str| -> Option<toml::Table> {
        let mut whole: toml::Table = toml::from_str(text).ok()?;
        let changed = whole.get_mut(table)?.as_table_mut()?;
        keys.iter().for_each(|(key, _)| drop(changed.remove(*key)));
        Some(whole)
    };
    (without(text)? == without(&changed)?).then_some(changed)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[specimen]\nid = \"eye\"\n[measurement] # how\nfile = \"t.csv\"\nheldout_cycles = [2] # the last\n[measurement.columns]\ntime = 1\n";

    #[test]
    fn keys_are_set_and_all_else_stays() {
        let keys = [("heldout_cycles", Some("[3]".to_string())), ("left_out_s", Some("[[1.0, 2.0]]".to_string()))];
        let changed = with_keys(TEXT, "measurement", &keys).unwrap();
        assert_eq!(
            changed,
            "[specimen]\nid = \"eye\"\n[measurement] # how\nleft_out_s = [[1.0, 2.0]]\nfile = \"t.csv\"\nheldout_cycles = [3]\n[measurement.columns]\ntime = 1\n"
        );
        let back = with_keys(&changed, "measurement", &[("left_out_s", None), ("heldout_cycles", None)]).unwrap();
        assert!(!back.contains("left_out_s") && !back.contains("heldout") && back.contains("t.csv"));
    }

    #[test]
    fn what_cannot_be_changed_line_by_line_is_left_alone() {
        let spread = TEXT.replace("[2] # the last", "[\n2,\n3]");
        let keys = [("heldout_cycles", Some("[4]".to_string()))];
        assert_eq!(with_keys(&spread, "measurement", &keys), None);
        assert_eq!(with_keys("measurement = { file = \"t.csv\" }\n", "measurement", &keys), None);
    }
}
