//! The study directory: revisions, provenance, atomic writes (formats §3).
//!
//! ```text
//! vitreo-uq-out/porcine-01/
//!   experiment.toml trajectory.csv   the inputs, copied byte for byte
//!   inputs.sha256                    hashes of the inputs, in the format of `sha256sum --check`
//!   m0/ m1/ …                        revisions, each written completely or not at all
//!   fit.json                         the last point estimate
//!   ladder.json ladder.svg ladder.png  comparison of all revisions
//!   report.html                      report of all results for a browser
//!   simulation/                      the last simulation, written completely or not at all
//!   .m0.checkpoint/                  state from which an interrupted run of m0 resumes
//! ```
//! Hidden entries with `.partial-` or `.replaced` in their names are leftovers of a killed program. The next program that opens the study removes them.

mod atomic;
pub mod effect_file;
mod model_specification;
mod provenance;
mod revision;

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use base::sha256::sha256_hex;

pub use model_specification::{Assignments, ModelSpecification, PRIOR_COPY, named_effects};
pub use provenance::{Kept, ORIGINAL, Provenance, WithProvenance};
pub use revision::RevisionWriter;

use atomic::{Lock, replace_directory, sync_tree};
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, Content, FileKind, TemporaryDirectory};
use record::{Experiment, ExperimentFiles};

const TOML_NAME: &str = "experiment.toml";
const HASHES_NAME: &str = "inputs.sha256";
/// Name of the directory with a study's last simulation.
pub const SIMULATION_NAME: &str = "simulation";
/// File name of a study's last point estimate.
pub const FIT_NAME: &str = "fit.json";
/// File name of a study's comparison of its revisions. Its figures are `ladder.svg` and `ladder.png` beside it.
pub const LADDER_NAME: &str = "ladder.json";
/// Name of a comparison of laws, the result of `compare --laws`.
pub const LAWS_NAME: &str = "laws.json";
/// File name of a study's corner plot of several posteriors, if one was requested; `corner.png` is beside it.
pub const CORNER_NAME: &str = "corner.svg";
/// File name of a study's report for a browser.
pub const PAGE_NAME: &str = "report.html";
/// File name of a revision's posterior.
pub const POSTERIOR_NAME: &str = "posterior.json";
/// File name of a revision's table of predicted positions at every row.
pub const PREDICTIONS_NAME: &str = "predictions.csv";
/// File name of a revision's findings, which are the misfits that tests have found.
pub const FINDINGS_NAME: &str = "comparison.json";
/// File name of a revision's learnt law, written by `learn`; its figure is in `figures/learned`.
pub const LEARNED_NAME: &str = "learned.json";
/// File name of a revision's table of residuals and of changes of the fitted curve by a refit with each effect (µm). `diagnose` writes this table.
pub const FINGERPRINTS_NAME: &str = "fingerprints.csv";
/// File name of the diagnosis of a revision, or of the study of an oscillation.
pub const DIAGNOSIS_NAME: &str = "diagnosis.json";
/// File name of the summary of a revision's extension from an earlier revision. `extend` writes this summary.
pub const EXTENSION_NAME: &str = "extension.json";
fn out_remedy() -> String {
    format!("choose a writable place with `{}`", Setting::Out)
}
const INCOMPLETE_REMEDY: &str = "check that the study is complete and readable";
const WHAT: &str = "a study";
/// Parent directory of a study if the user names no directory.
const DEFAULT_PARENT: &str = "vitreo-uq-out";

/// A study directory whose input files match their stored hashes.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    dir: PathBuf,
    inputs_sha256: BTreeMap<String, String>,
}

impl Study {
    /// Default directory of a study: `vitreo-uq-out/<specimen id>/`, with the id made safe as a file name.
    pub fn default_dir(specimen_id: &str) -> PathBuf {
        Path::new(DEFAULT_PARENT).join(files::safe_name(specimen_id))
    }

    /// Returns true if a path is a study directory, which contains a file of hashes, and not an experiment. If the file of hashes is a link or a directory, the path
    /// counts as a study, too, but opening it is refused.
    pub fn is_study(path: &Path) -> bool {
        path.join(HASHES_NAME).symlink_metadata().is_ok()
    }

    /// Creates the study of an experiment, or continues an existing study of the same input.
    ///
    /// If `force` is set, a study of another input is replaced in one atomic step.
    ///
    /// # Errors
    /// [`Error::Input`] if the directory holds other files, or if another program is writing to it. The error also occurs if the directory holds a study of another
    /// input and `force` is not set. [`Error::File`] if the operating system refuses.
    pub fn open_or_create(dir: &Path, files: &ExperimentFiles, force: bool) -> Result<Self> {
        let inputs_sha256 = hashes_of(files)?;
        let study = || Self { dir: dir.to_path_buf(), inputs_sha256: inputs_sha256.clone() };
        if Self::is_study(dir) {
            files::forbid_links(dir, WHAT);
            files::remove_stale_files(dir);
            if read_hashes(dir)? == inputs_sha256 {
                check_copies(dir, &inputs_sha256)?;
                return Ok(study());
            }
            if !force {
                return Err(Error::input(
                    InputPlace::file(dir.join(HASHES_NAME)),
                    "this directory holds a study of another input",
                    format!(
                        "choose another directory with `{}`, or replace the study and all its revisions with `{}`",
                        Setting::Out,
                        Setting::Force
                    ),
                ));
            }
            let lock = Lock::acquire(dir)?;
            create(dir, files, &inputs_sha256, true)?;
            drop(lock);
            return Ok(study());
        }
        Self::check_place(dir)?;
        let created = create(dir, files, &inputs_sha256, false);
        files::forbid_links(dir, WHAT);
        match created {
            Ok(()) => Ok(study()),
            // Another program created the same study in the meantime.
            Err(_) if Self::is_study(dir) && read_hashes(dir)? == inputs_sha256 => Ok(study()),
            Err(error) => Err(error),
        }
    }

    /// Checks that a directory is suitable for a study: it is a study, absent, or empty.
    ///
    /// # Errors
    /// [`Error::Input`] if it holds other files, [`Error::File`] if it cannot be read.
    pub fn check_place(dir: &Path) -> Result<()> {
        if Self::is_study(dir) || is_absent_or_empty(dir)? {
            return Ok(());
        }
        Err(Error::input(
            InputPlace::file(dir),
            "this is not a study, and it is not empty",
            format!(
                "choose a new or empty directory with `{}`; `{}` only replaces studies",
                Setting::Out,
                Setting::Force
            ),
        ))
    }

    /// Opens an existing study.
    ///
    /// # Errors
    /// [`Error::Input`] if the directory is no study, or if its inputs have changed since its creation.
    pub fn open(dir: &Path) -> Result<Self> {
        if !Self::is_study(dir) {
            return Err(Error::input(
                InputPlace::file(dir),
                format!("this is not a study: it holds no {HASHES_NAME}"),
                "give the directory that an earlier command made, or an experiment",
            ));
        }
        files::forbid_links(dir, WHAT);
        files::remove_stale_files(dir);
        let inputs_sha256 = read_hashes(dir)?;
        check_copies(dir, &inputs_sha256)?;
        Ok(Self { dir: dir.to_path_buf(), inputs_sha256 })
    }

    /// Directory of the study.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// SHA-256 of each input of an experiment, in hexadecimal, by the file name that it has in a study.
    ///
    /// # Errors
    /// [`Error::Input`] if the experiment's files have names that are reserved in a study.
    pub fn hashes_of(files: &ExperimentFiles) -> Result<BTreeMap<String, String>> {
        hashes_of(files)
    }

    /// SHA-256 of each input, in hexadecimal, by file name.
    pub fn inputs_sha256(&self) -> &BTreeMap<String, String> {
        &self.inputs_sha256
    }

    /// Reads the study's copy of the experiment.
    ///
    /// # Errors
    /// Errors of [`Experiment::read`].
    pub fn read_experiment(&self) -> Result<(Experiment, ExperimentFiles)> {
        Experiment::read(&self.dir.join(TOML_NAME))
    }

    /// Header of a JSON document of this study, with the schema `vitreo-uq/<kind>/<number>`.
    pub fn provenance(&self, kind: &str, number: u32, seed: u64) -> Provenance {
        Provenance::new(kind, number, seed, self.inputs_sha256.clone())
    }

    /// Names of the finished revisions, in the order of their numbers.
    ///
    /// # Errors
    /// [`Error::File`] if the directory cannot be read.
    pub fn revisions(&self) -> Result<Vec<String>> {
        let mut numbers = Vec::new();
        for (name, kind) in files::entries(&self.dir, INCOMPLETE_REMEDY)? {
            let Some(number) = name.to_str().and_then(revision_number) else { continue };
            match kind {
                FileKind::Folder => numbers.push(number),
                _ => files::refuse_link(&self.dir.join(&name))?,
            }
        }
        numbers.sort_unstable();
        Ok(numbers.into_iter().map(|number| format!("m{number}")).collect())
    }

    /// Directory of a finished revision.
    ///
    /// # Errors
    /// [`Error::Input`] if no revision has this name.
    pub fn revision_dir(&self, name: &str) -> Result<PathBuf> {
        let dir = self.dir.join(name);
        if revision_number(name).is_some() {
            files::refuse_link(&dir)?;
            if files::is_folder(&dir) {
                return Ok(dir);
            }
        }
        let known = self.revisions()?.join(", ");
        let remedy = if known.is_empty() {
            "run `vitreo-uq sample` on this study first".to_string()
        } else {
            format!("use one of: {known}")
        };
        Err(Error::input(InputPlace::file(&self.dir).at_key(name), "this study has no such revision", remedy))
    }

    /// Begins to write the revision `name`: `m0`, `m1`, …. The revision becomes visible with [`RevisionWriter::commit`].
    ///
    /// # Errors
    /// [`Error::Input`] if the name is not a revision's or another program is writing to the study.
    pub fn begin_revision(&self, name: &str) -> Result<RevisionWriter> {
        RevisionWriter::begin(&self.dir, self.checked(name)?)
    }

    /// Begins to change a finished revision. [`RevisionWriter::path`] contains copies of its files, and [`RevisionWriter::commit`] replaces the revision in one step.
    ///
    /// # Errors
    /// [`Error::Input`] if no revision has this name or another program is writing to the study, [`Error::File`] if it cannot be copied.
    pub fn amend_revision(&self, name: &str) -> Result<RevisionWriter> {
        let writer = self.begin_revision(name)?;
        atomic::copy_tree(&self.revision_dir(name)?, writer.path())?;
        Ok(writer)
    }

    /// Begins to write the directory [`SIMULATION_NAME`]. It becomes visible with [`RevisionWriter::commit`], which replaces an earlier simulation.
    ///
    /// # Errors
    /// [`Error::Input`] if another program is writing to the study.
    pub fn begin_simulation(&self) -> Result<RevisionWriter> {
        RevisionWriter::begin(&self.dir, SIMULATION_NAME)
    }

    /// Directory of a revision's checkpoint, from which an interrupted run can resume. It is created if absent, survives a kill, and stays until
    /// [`Study::discard_checkpoint`].
    ///
    /// # Errors
    /// [`Error::Input`] if the name is not a revision's, [`Error::File`] if the directory cannot be created.
    pub fn checkpoint_dir(&self, name: &str) -> Result<PathBuf> {
        let dir = self.checkpoint_path(name)?;
        files::create_folders(&dir, "make the study directory writable")?;
        Ok(dir)
    }

    /// Directory of the checkpoint that an interrupted run of a revision has left; `None` without one.
    ///
    /// # Errors
    /// [`Error::Input`] if the name is not a revision's.
    pub fn unfinished_dir(&self, name: &str) -> Result<Option<PathBuf>> {
        Ok(Some(self.checkpoint_path(name)?).filter(|dir| files::is_folder(dir)))
    }

    /// Removes a revision's checkpoint, if there is one.
    ///
    /// # Errors
    /// [`Error::Input`] if the name is not a revision's, [`Error::File`] if it cannot be removed.
    pub fn discard_checkpoint(&self, name: &str) -> Result<()> {
        files::remove_all(&self.checkpoint_path(name)?)
    }

    fn checkpoint_path(&self, name: &str) -> Result<PathBuf> {
        Ok(self.dir.join(format!(".{}.checkpoint", self.checked(name)?)))
    }

    fn checked<'a>(&self, name: &'a str) -> Result<&'a str> {
        if revision_number(name).is_some() {
            return Ok(name);
        }
        Err(Error::input(
            InputPlace::file(&self.dir).at_key(name),
            "this is not the name of a revision",
            "use a name such as m0, m1, m2",
        ))
    }
}

/// Number of a revision from its name `m<number>`, without leading zeros; `None` for any other name.
fn revision_number(name: &str) -> Option<u32> {
    let number = name.strip_prefix('m')?.parse::<u32>().ok()?;
    (name == format!("m{number}")).then_some(number)
}

/// Name and bytes of the experiment's table, then of its force log, if the experiment has a log.
fn tables(files: &ExperimentFiles) -> impl Iterator<Item = (&str, &[u8])> {
    let log = files.log_file.as_ref().map(|(name, bytes)| (name.as_str(), bytes.as_slice()));
    std::iter::once((files.csv_name.as_str(), files.csv_bytes.as_slice())).chain(log)
}

fn hashes_of(files: &ExperimentFiles) -> Result<BTreeMap<String, String>> {
    for (name, _) in tables(files) {
        let first = Path::new(name).components().next();
        let first = first.map_or(String::new(), |part| part.as_os_str().to_string_lossy().into_owned());
        let names = [
            TOML_NAME,
            HASHES_NAME,
            SIMULATION_NAME,
            FIT_NAME,
            LADDER_NAME,
            LAWS_NAME,
            PAGE_NAME,
            "ladder.svg",
            "ladder.png",
            "corner.svg",
            "corner.png",
        ];
        let taken = names.contains(&first.as_str());
        if taken || first.starts_with('.') || revision_number(&first).is_some() {
            return Err(Error::input(
                InputPlace::file(&files.toml_name).at_key("file"),
                format!("`{name}` is a reserved name in a study"),
                "rename the table, for example to trajectory.csv, and change `file` in [measurement] or [actuation]",
            ));
        }
    }
    let mut hashes = BTreeMap::from([(TOML_NAME.to_string(), sha256_hex(&files.toml_bytes))]);
    hashes.extend(tables(files).map(|(name, bytes)| (name.to_string(), sha256_hex(bytes))));
    Ok(hashes)
}

/// Builds the study in a hidden directory and moves it to its place in one step; `replace` allows an existing study there.
fn create(dir: &Path, files: &ExperimentFiles, hashes: &BTreeMap<String, String>, replace: bool) -> Result<()> {
    let refused = |action, path: &Path, source| Error::at_path(action, path, source, out_remedy());
    // This resolves a symbolic link, and turns `.` into a full path, which has a name.
    let dir = &dir.canonicalize().unwrap_or_else(|_| dir.to_path_buf());
    let parent = base::files::folder_of(dir);
    std::fs::create_dir_all(parent).map_err(|source| refused("create", parent, source))?;
    let name = dir.file_name().map_or("study".into(), |name| name.to_string_lossy());
    let is_empty_directory = !replace && dir.is_dir();
    let building = TemporaryDirectory::new(if is_empty_directory { dir } else { parent }, &name)?;
    write_inputs(building.path(), files, hashes)?;
    sync_tree(building.path())?;
    if replace {
        return replace_directory(building, dir);
    }
    building.move_to(dir, HASHES_NAME, &out_remedy())
}

fn write_inputs(folder: &Path, files: &ExperimentFiles, hashes: &BTreeMap<String, String>) -> Result<()> {
    let refused = |action, path: &Path, source| Error::at_path(action, path, source, out_remedy());
    let write = |name: &str, bytes: &[u8]| -> Result<()> {
        let path = folder.join(name);
        let parent = base::files::folder_of(&path);
        std::fs::create_dir_all(parent).map_err(|source| refused("create", parent, source))?;
        std::fs::write(&path, bytes).map_err(|source| refused("write", &path, source))
    };
    write(TOML_NAME, &files.toml_bytes)?;
    for (name, bytes) in tables(files) {
        write(name, bytes)?;
    }
    let lines: String = hashes.iter().map(|(name, hash)| format!("{hash}  {name}\n")).collect();
    write(HASHES_NAME, lines.as_bytes())
}

fn read_hashes(dir: &Path) -> Result<BTreeMap<String, String>> {
    let path = dir.join(HASHES_NAME);
    let bytes = files::read(&path, Content::Settings, INCOMPLETE_REMEDY)?;
    let text = base::toml_input::text_of(&path, &bytes)?;
    let mut hashes = BTreeMap::new();
    for (index, line) in text.lines().enumerate() {
        let (hash, name) = line.split_once("  ").ok_or_else(|| {
            Error::input(
                InputPlace::file(&path).at_line(index + 1),
                "this is not a hash, two spaces and a file name",
                format!(
                    "the study's list of hashes is damaged: create the study again with `{}` or in another place",
                    Setting::Force
                ),
            )
        })?;
        let is_plain = Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
        if !is_plain {
            return Err(Error::input(
                InputPlace::file(&path).at_line(index + 1),
                format!("`{name}` is not a path inside the study"),
                "the study's list of hashes was changed: create the study again in another place",
            ));
        }
        hashes.insert(name.to_string(), hash.to_string());
    }
    Ok(hashes)
}

fn check_copies(dir: &Path, hashes: &BTreeMap<String, String>) -> Result<()> {
    for (name, hash) in hashes {
        let path = dir.join(name);
        let bytes = files::read(&path, Content::Table, INCOMPLETE_REMEDY)?;
        if sha256_hex(&bytes) != *hash {
            return Err(Error::input(
                InputPlace::file(&path),
                "this copy has been changed since the study was created",
                format!(
                    "restore it from the original, or make a new study of the changed input with `{}`",
                    Setting::Out
                ),
            ));
        }
    }
    Ok(())
}

fn is_absent_or_empty(dir: &Path) -> Result<bool> {
    match std::fs::read_dir(dir) {
        Ok(mut entries) => Ok(entries.next().is_none()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(true),
        Err(error) => {
            Err(Error::at_path("use", dir, error, format!("choose another directory with `{}`", Setting::Out)))
        }
    }
}

#[cfg(test)]
mod tests;
