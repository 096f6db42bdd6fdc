//! Tables that a browser uploads, and the questions of `init` about them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files;
use vitreo_uq::documents::init::InitSummary;
use vitreo_uq::jobs::init::{self, InitRequest};
use vitreo_uq::record::table::Question;

use super::home::WorkbenchFolder;

/// Maximum length in bytes of a file extension. The name of a stored table omits a longer one.
const LONGEST_ENDING: usize = 10;

/// Description of a table that the user gives on the page.
#[derive(Debug, Clone, Default, Deserialize)]
pub struct Described {
    /// Name of the upload, as returned by [`store_upload`].
    pub upload: String,
    /// Original name of the table.
    pub file: String,
    /// Answers, by the texts of their questions.
    #[serde(default)]
    pub answers: BTreeMap<String, String>,
    /// Known noise standard deviation of the tracker, in µm.
    pub noise_um: Option<f64>,
    /// Species and region of the eye, which are keys for groups.
    #[serde(default)]
    pub groups: [Option<String>; 2],
}

/// Question about a table that the page asks the user.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct OpenQuestion {
    text: String,
    choices: Vec<String>,
    proposal: Option<String>,
}

/// Result of describing a table.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum DescribeOutcome {
    /// Further information is needed.
    Questions {
        /// Open questions.
        questions: Vec<OpenQuestion>,
    },
    /// The experiment is written.
    Written {
        /// Its name among the items.
        item: String,
        /// Description of the table as read.
        summary: Box<InitSummary>,
    },
}

/// Keeps an uploaded table, whatever its name. Returns the name of the upload.
pub fn store_upload(home: &WorkbenchFolder, name: &str, number: u64, bytes: &[u8]) -> Result<String> {
    let upload = format!("upload-{number}");
    let folder = home.own().join(&upload);
    files::create_folders(&folder, "make the folder writable")?;
    files::write_atomically(&folder.join(stored(name)), bytes)?;
    Ok(upload)
}

/// File name of a kept table: letters, digits, dots and hyphens, with the original extension.
fn stored(name: &str) -> String {
    let name = Path::new(name);
    let stem = files::safe_name(&name.file_stem().unwrap_or_default().to_string_lossy());
    let ending = name.extension().map(|ending| files::safe_name(&ending.to_string_lossy()));
    match ending.filter(|ending| ending.len() <= LONGEST_ENDING) {
        Some(ending) => format!("{stem}.{ending}"),
        None => stem,
    }
}

/// Removes the uploads of earlier workbenches.
pub fn remove_old_uploads(home: &WorkbenchFolder) {
    for (name, _) in files::entries(&home.own(), "").unwrap_or_default() {
        if name.to_string_lossy().starts_with("upload-") {
            let _ = files::remove_all(&home.own().join(name));
        }
    }
}

/// Writes the experiment of a table, or returns open questions. Nothing is written until every question has an answer.
pub fn describe(home: &WorkbenchFolder, described: &Described) -> Result<DescribeOutcome> {
    let file = find_upload(home, described)?;
    written(home, &file, described).map_err(|error| with_original_name(error, &file))
}

/// Writes the experiment of a kept table, or returns open questions.
fn written(home: &WorkbenchFolder, file: &Path, described: &Described) -> Result<DescribeOutcome> {
    let request = |out: PathBuf| InitRequest {
        file: file.to_path_buf(),
        out: Some(out),
        noise_um: described.noise_um,
        groups: described.groups.clone(),
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
    let tried = init::run(&request(trial.path().join("trial")), &mut answer);
    if !questions.is_empty() {
        return Ok(DescribeOutcome::Questions { questions });
    }
    tried?;
    let item = home.new_experiment(&described.file);
    let out = home.dir().join(&item);
    let (mut summary, _) = init::run(&request(out), &mut |question| known(question))?;
    summary.directory.clone_from(&item);
    Ok(DescribeOutcome::Written { item, summary: Box::new(summary) })
}

/// Replaces the path of a kept table in an error by the table's original name.
fn with_original_name(error: Error, file: &Path) -> Error {
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

/// Path of the kept table of an upload.
fn find_upload(home: &WorkbenchFolder, described: &Described) -> Result<PathBuf> {
    let is_number = |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_digit());
    let is_upload = described.upload.strip_prefix("upload-").is_some_and(is_number);
    let path = home.own().join(&described.upload).join(stored(&described.file));
    if is_upload && files::is_file(&path) {
        return Ok(path);
    }
    Err(Error::input(InputPlace::file(&described.file), "the workbench has no such table", "drop it on the page again"))
}
