//! Turns tables that a browser uploads into experiments, and passes the questions of `init` to the page.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files;
use vitreo_uq::documents::init::InitSummary;
use vitreo_uq::intake::source::TableSource;
use vitreo_uq::intake::{self, InitRequest};
use vitreo_uq::record::table::{InspectedTable, Question, TableSettings, cells, decode_detected, inspect_table};

use super::home::WorkbenchFolder;
use super::project;

/// Maximum length in bytes of a file's extension. A stored table with a longer extension is stored without it.
const LONGEST_ENDING: usize = 10;

/// Description of an uploaded table that the user gives on the page.
#[derive(Debug, Clone, Default, Deserialize)]
pub struct Described {
    /// Name of the upload, as returned by [`store_upload`].
    pub upload: String,
    /// Original file name of the table.
    pub file: String,
    /// Answers to questions; the key is the text of the question.
    #[serde(default)]
    pub answers: BTreeMap<String, String>,
    /// Known noise standard deviation of the position, in µm; `None` if it is not given.
    pub noise_um: Option<f64>,
    /// Species, and region of the eye; both can define groups.
    #[serde(default)]
    pub groups: [Option<String>; 2],
    /// Columns of time, force, position and cycle that the user has chosen, by numbers from 1.
    #[serde(default)]
    pub columns: [Option<String>; 4],
}

/// Question about a table that the user must answer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct OpenQuestion {
    text: String,
    choices: Vec<String>,
    proposal: Option<String>,
}

/// First rows of a table, in columns.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub struct TablePreview {
    /// Names of the columns; numbers from 1 for a table without names.
    names: Vec<String>,
    rows: Vec<Vec<String>>,
    /// Sentence that describes the table's layout.
    said: String,
}

/// Number of rows that are shown above the questions.
const PREVIEW_ROWS: usize = 5;

/// Reads the first rows of the first table in a file, for the eyes of the user.
fn preview(file: &Path) -> Option<TablePreview> {
    let bytes = TableSource::read(file).ok()?.bytes;
    let InspectedTable { layout, columns, said, .. } = inspect_table(file, &bytes).ok()?;
    let split = |line: &str| -> Vec<String> {
        cells(line, layout.delimiter).into_iter().map(std::borrow::Cow::into_owned).collect()
    };
    let text = decode_detected(&bytes);
    let rows: Vec<_> = text.lines().skip(layout.first_row_line - 1).take(PREVIEW_ROWS).map(split).collect();
    let n_columns = rows.iter().map(Vec::len).max()?.max(columns.len());
    let name = |number: usize| columns.get(number - 1).cloned().unwrap_or_else(|| number.to_string());
    Some(TablePreview { names: (1..=n_columns).map(name).collect(), rows, said })
}

/// Result of [`describe`].
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum DescribeOutcome {
    /// The user must answer questions first.
    Questions {
        /// Questions without an answer so far.
        questions: Vec<OpenQuestion>,
        /// First rows of the table; `None` if the file has no block of numbers.
        preview: Option<TablePreview>,
    },
    /// The experiment has been written.
    Written {
        /// Name of the new item.
        item: String,
        /// Description of how the table was read.
        summary: Box<InitSummary>,
    },
}

/// Stores an uploaded table under a safe name. Returns this name.
pub fn store_upload(home: &WorkbenchFolder, name: &str, number: u64, bytes: &[u8]) -> Result<String> {
    let upload = format!("upload-{number}");
    let folder = home.own().join(&upload);
    files::create_folders(&folder, "make the folder writable")?;
    files::write_atomically(&folder.join(stored(name)), bytes)?;
    Ok(upload)
}

/// File name under which a table is stored: letters, digits, dots and hyphens, with the original extension.
fn stored(name: &str) -> String {
    let name = Path::new(name);
    let stem = files::safe_name(&name.file_stem().unwrap_or_default().to_string_lossy());
    let ending = name.extension().map(|ending| files::safe_name(&ending.to_string_lossy()));
    match ending.filter(|ending| ending.len() <= LONGEST_ENDING) {
        Some(ending) => format!("{stem}.{ending}"),
        None => stem,
    }
}

/// Removes the tables that were uploaded to earlier workbenches.
pub fn remove_old_uploads(home: &WorkbenchFolder) {
    for (name, _) in files::entries(&home.own(), "").unwrap_or_default() {
        if name.to_string_lossy().starts_with("upload-") {
            let _ = files::remove_all(&home.own().join(name));
        }
    }
}

/// Writes the experiment of an uploaded table, or returns the questions that are still open. Nothing is written before every question has an answer.
pub fn describe(home: &WorkbenchFolder, described: &Described) -> Result<DescribeOutcome> {
    let file = find_upload(home, described)?;
    written(home, &file, described).map_err(|error| with_original_name(error, &file))
}

/// Writes the experiment of the stored table `file`, or returns the questions that are still open.
fn written(home: &WorkbenchFolder, file: &Path, described: &Described) -> Result<DescribeOutcome> {
    let request = |out: PathBuf| InitRequest {
        file: file.to_path_buf(),
        out: Some(out),
        noise: described.noise_um,
        groups: described.groups.clone(),
        known_columns: TableSettings { columns: described.columns.clone(), ..TableSettings::default() },
        ..InitRequest::default()
    };
    let mut questions: Vec<OpenQuestion> = Vec::new();
    let known = |question: &Question| {
        let answer = described.answers.get(&question.text).map(|answer| answer.trim().to_string());
        answer.filter(|answer| !answer.is_empty())
    };
    let mut answer = |question: &Question| {
        let known = known(question);
        if known.is_none() && questions.iter().all(|asked| asked.text != question.text) {
            let Question { text, choices, proposal, .. } = question.clone();
            questions.push(OpenQuestion { text, choices, proposal: proposal.filter(|proposal| proposal != "?") });
        }
        known
    };
    files::refuse_link(&home.own())?;
    let trial = tempfile::tempdir_in(home.own())
        .map_err(|error| Error::at_path("create", home.own(), error, "make the folder writable"))?;
    let tried = intake::run(&request(trial.path().join("trial")), &mut answer);
    if !questions.is_empty() {
        return Ok(DescribeOutcome::Questions { questions, preview: preview(file) });
    }
    tried?;
    let item = home.new_experiment(&described.file);
    let out = home.dir().join(&item);
    let (mut summary, _) = intake::run(&request(out), &mut |question| known(question))?;
    summary.directory.clone_from(&item);
    project::separate(home, &item)?;
    let _ = files::remove_all(file.parent().unwrap_or(file));
    Ok(DescribeOutcome::Written { item, summary: Box::new(summary) })
}

/// Removes the folder of the stored table from the path in an error.
fn with_original_name(error: Error, file: &Path) -> Error {
    match error {
        Error::Input { mut place, found, remedy } => {
            place.file = place.file.map(|path| match path.strip_prefix(file.parent().unwrap_or(file)) {
                Ok(name) => name.into(),
                Err(_) => path,
            });
            Error::Input { place, found, remedy }
        }
        other => other,
    }
}

/// Path of the stored table of an upload.
fn find_upload(home: &WorkbenchFolder, described: &Described) -> Result<PathBuf> {
    let is_number = |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_digit());
    let is_upload = described.upload.strip_prefix("upload-").is_some_and(is_number);
    let path = home.own().join(&described.upload).join(stored(&described.file));
    if is_upload && files::is_file(&path) {
        return Ok(path);
    }
    Err(Error::input(InputPlace::file(&described.file), "the workbench has no such table", "drop it on the page again"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_that_the_user_chooses_are_read() {
        let place = tempfile::tempdir().unwrap();
        let home = WorkbenchFolder::of(place.path()).unwrap().0;
        let rows: Vec<String> = (0..40).map(|row| format!("{};{};{};{}", row, row % 7, 3 * row, row / 20)).collect();
        let table = format!("t (s);A (µm);F (µN);B (µm)\n{}\n", rows.join("\n"));
        let upload = store_upload(&home, "x.csv", 1, table.as_bytes()).unwrap();
        let mut described = Described { upload, file: "x.csv".into(), ..Described::default() };
        let DescribeOutcome::Questions { questions, preview } = describe(&home, &described).unwrap() else { panic!() };
        let preview = preview.unwrap();
        assert_eq!((preview.names[2].as_str(), preview.rows[1].join(" ")), ("F (µN)", "1 1 3 0".to_string()));
        let is_asked = |questions: &[OpenQuestion]| questions.iter().any(|own| own.text.contains("position"));
        assert!(is_asked(&questions), "two columns may be the position: {questions:?}");
        described.columns[2] = Some("4".into());
        let DescribeOutcome::Questions { questions, .. } = describe(&home, &described).unwrap() else { panic!() };
        assert!(!is_asked(&questions) && !questions.is_empty(), "{questions:?}");
    }
}
