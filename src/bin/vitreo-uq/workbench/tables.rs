//! Tables that a browser sends, and what `init` has to ask of them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use vitreo_uq::base::error::{Error, Place, Result};
use vitreo_uq::base::files;
use vitreo_uq::documents::init::InitSummary;
use vitreo_uq::jobs::init::{self, InitRequest};
use vitreo_uq::record::table::Question;

use super::home::Home;

/// What a page knows of a table.
#[derive(Debug, Clone, Default, Deserialize)]
pub struct Described {
    /// What the upload was called when it came.
    pub upload: String,
    /// The table's own name.
    pub file: String,
    /// Answers by the texts of their questions.
    #[serde(default)]
    pub answers: BTreeMap<String, String>,
    /// Known noise of the tracker in µm.
    pub noise_um: Option<f64>,
    /// Species and region of the eye, by which groups are formed.
    #[serde(default)]
    pub groups: [Option<String>; 2],
}

/// A question for the page.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Asked {
    text: String,
    choices: Vec<String>,
    proposal: Option<String>,
}

/// What became of a table.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Answered {
    /// More has to be known.
    Questions {
        /// What.
        questions: Vec<Asked>,
    },
    /// The experiment is written.
    Written {
        /// Its name among the items.
        item: String,
        /// What was understood.
        summary: Box<InitSummary>,
    },
}

/// Keeps a table that came; gives the name under which it is asked for.
pub fn keep(home: &Home, name: &str, number: u64, bytes: &[u8]) -> Result<String> {
    let is_plain = !name.is_empty()
        && name.len() <= 200
        && !name.starts_with('.')
        && !name.contains(|c: char| c.is_control() || matches!(c, '/' | '\\'));
    if !is_plain {
        let remedy = "rename the table to letters, digits and dots";
        return Err(Error::input(Place::file(name), "this is no plain name of a file", remedy));
    }
    let upload = format!("upload-{number}");
    let folder = home.own().join(&upload);
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::at_path("create", &folder, error, "make the folder writable"))?;
    files::write_atomically(&folder.join(name), bytes)?;
    Ok(upload)
}

/// Removes what earlier workbenches kept.
pub fn forget(home: &Home) {
    let Ok(entries) = std::fs::read_dir(home.own()) else { return };
    for entry in entries.flatten().filter(|entry| entry.file_name().to_string_lossy().starts_with("upload-")) {
        let _ = std::fs::remove_dir_all(entry.path());
    }
}

/// Writes the experiment of a table, or says what has to be known first: nothing is written before every question has an answer.
pub fn describe(home: &Home, described: &Described) -> Result<Answered> {
    let file = kept(home, described)?;
    written(home, &file, described).map_err(|error| named_alone(error, &file))
}

/// The same of a table that is here.
fn written(home: &Home, file: &Path, described: &Described) -> Result<Answered> {
    let request = |out: PathBuf| InitRequest {
        file: file.to_path_buf(),
        out: Some(out),
        noise_um: described.noise_um,
        groups: described.groups.clone(),
        ..InitRequest::default()
    };
    let mut questions: Vec<Asked> = Vec::new();
    let known = |question: &Question| {
        let answer = described.answers.get(&question.text).map(|answer| answer.trim().to_string());
        answer.filter(|answer| !answer.is_empty())
    };
    let mut answer = |question: &Question| {
        let known = known(question);
        if known.is_none() && questions.iter().all(|asked| asked.text != question.text) {
            let Question { text, choices, proposal, .. } = question.clone();
            questions.push(Asked { text, choices, proposal: proposal.filter(|proposal| proposal != "?") });
        }
        known
    };
    let trial = tempfile::tempdir_in(home.own())
        .map_err(|error| Error::at_path("create", home.own(), error, "make the folder writable"))?;
    let tried = init::run(&request(trial.path().join("trial")), &mut answer);
    if !questions.is_empty() {
        return Ok(Answered::Questions { questions });
    }
    tried?;
    let item = home.new_experiment(&described.file);
    let out = home.dir().join(&item);
    let (mut summary, _) = init::run(&request(out), &mut |question| known(question))?;
    summary.directory.clone_from(&item);
    Ok(Answered::Written { item, summary: Box::new(summary) })
}

/// An error with the table's own name: where the workbench keeps it is nobody's concern.
fn named_alone(error: Error, file: &Path) -> Error {
    match error {
        Error::Input { mut place, found, remedy } => {
            if let (true, Some(name)) = (place.file.as_deref() == Some(file), file.file_name()) {
                place.file = Some(name.into());
            }
            Error::Input { place, found, remedy }
        }
        other => other,
    }
}

/// The table of an upload.
fn kept(home: &Home, described: &Described) -> Result<PathBuf> {
    let is_number = |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_digit());
    let is_upload = described.upload.strip_prefix("upload-").is_some_and(is_number);
    let is_plain =
        !described.file.is_empty() && !described.file.contains(['/', '\\']) && !described.file.starts_with('.');
    let path = home.own().join(&described.upload).join(&described.file);
    if is_upload && is_plain && path.is_file() {
        return Ok(path);
    }
    Err(Error::input(Place::file(&described.file), "this table is not here any more", "drop it on the page again"))
}
