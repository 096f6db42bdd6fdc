//! Finds and reads the experiments of a cohort, with their labels.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::design::Labels;
use base::error::{Error, InputPlace, Result, Setting};
use base::sha256::{Hash, hex};
use models::effects::Library;
use posterior::monitor::{Monitor, WarningCollector};
use posterior::study::{ModelSpecification, Study};
use record::{Experiment, ExperimentFiles};

base::named_enum! {
    /// Property of specimens by which groups are defined.
    pub enum Key {
        /// Species, the key `[specimen] species` of `experiment.toml`.
        Species = "species",
        /// Region of the eye, the key `[specimen] region` of `experiment.toml`.
        Region = "region",
    }
    /// Name of the key in `experiment.toml` and on the command line.
    pub fn name
}

impl Key {
    /// Finds the key called `name`; `None` if no key has this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|key| key.name() == name)
    }

    fn level(self, experiment: &Experiment) -> Option<&str> {
        let text = match self {
            Self::Species => &experiment.species,
            Self::Region => &experiment.region,
        };
        text.as_deref().map(str::trim).filter(|text| !text.is_empty())
    }
}

/// One experiment of a cohort.
#[derive(Debug, Clone)]
pub struct Measurement {
    /// Path of the experiment or study.
    pub path: PathBuf,
    /// Experiment: the record with its description.
    pub experiment: Experiment,
    /// SHA-256 of the experiment's files.
    pub inputs_sha256: String,
    /// Model of the study's last revision or the default model, changed by the caller's options.
    pub specification: ModelSpecification,
}

impl Measurement {
    /// Name in messages and tables: the name of the directory.
    pub fn name(&self) -> String {
        name_of(&self.path)
    }

    /// Adds the experiment's name to an error, and the option by which the experiment can be left out.
    pub fn with_name(&self, error: Error) -> Error {
        let name = self.name();
        let or_leave_out = |remedy: String| format!("{remedy}; or leave it out: {} {name}", Setting::LeaveOut);
        match error {
            Error::Input { place, found, remedy } => {
                Error::input(place, format!("{name}: {found}"), or_leave_out(remedy))
            }
            Error::Numerical { what, remedy } => Error::numerical(format!("{name}: {what}"), or_leave_out(remedy)),
            other => other,
        }
    }

    /// Returns `true` if `name` is the experiment's path, the name of its directory or the id of its specimen.
    fn is_called(&self, name: &str) -> bool {
        is_path_called(&self.path, name) || self.experiment.specimen_id == name
    }

    /// Labels of the experiment: the specimen (id and species), and the level of each key, such as `bovine` for the species.
    fn labels(&self, keys: &[Key]) -> Result<Labels> {
        let level = |key: &Key| {
            key.level(&self.experiment).map(String::from).ok_or_else(|| {
                Error::input(
                    InputPlace::file(&self.path).at_key(format!("specimen.{}", key.name())),
                    format!("the experiment has no {}", key.name()),
                    format!(
                        "add `{} = \"…\"` to [specimen], group by another key ({}), or leave it out ({} {})",
                        key.name(),
                        Setting::By,
                        Setting::LeaveOut,
                        self.name()
                    ),
                )
            })
        };
        let id = &self.experiment.specimen_id;
        let specimen = match &self.experiment.species {
            Some(species) => format!("{species}/{id}"),
            None => id.clone(),
        };
        Ok(Labels { specimen, levels: keys.iter().map(level).collect::<Result<_>>()? })
    }
}

/// Labels of all experiments: the specimen, and the level of each key, such as `bovine` for the species. One id in two species means two specimens.
///
/// # Errors
/// [`Error::Input`] if a key is missing in an experiment.
pub fn labels(measurements: &[Measurement], keys: &[Key]) -> Result<Vec<Labels>> {
    let mut labels = measurements.iter().map(|measurement| measurement.labels(keys)).collect::<Result<Vec<_>>>()?;
    let mut ids: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for (measurement, label) in measurements.iter().zip(&labels) {
        ids.entry(&measurement.experiment.specimen_id).or_default().insert(label.specimen.clone());
    }
    for (measurement, label) in measurements.iter().zip(&mut labels) {
        if ids[measurement.experiment.specimen_id.as_str()].len() == 1 {
            label.specimen.clone_from(&measurement.experiment.specimen_id);
        }
    }
    Ok(labels)
}

fn name_of(path: &Path) -> String {
    let named =
        if path.extension().is_some_and(|extension| extension == "toml") { base::files::folder_of(path) } else { path };
    let full = named.canonicalize().unwrap_or_else(|_| named.to_path_buf());
    full.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

fn is_path_called(path: &Path, name: &str) -> bool {
    let same = |a: &Path, b: &Path| matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b);
    name_of(path) == name || same(path, Path::new(name))
}

/// Reads all experiments and studies in these paths and their subdirectories.
///
/// `model` changes the model of each study's last revision, or the default model for an experiment. `leave_out` excludes experiments by path, directory
/// name or specimen.
///
/// # Errors
/// [`Error::Input`] if a path contains no experiment, a name in `leave_out` matches nothing, an experiment occurs twice, or one cannot be read. For an
/// unreadable experiment, the remedy of the reader's error is extended by the option to leave the experiment out.
pub fn read(
    paths: &[PathBuf],
    leave_out: &[String],
    model: &dyn Fn(ModelSpecification) -> Result<ModelSpecification>,
    monitor: &dyn Monitor,
) -> Result<Vec<Measurement>> {
    let mut places = Vec::new();
    for path in paths {
        let before = places.len();
        find(path, &mut places)?;
        if places.len() == before {
            return Err(Error::input(
                InputPlace::file(path),
                "no experiment was found here",
                "give directories that are experiments (with experiment.toml) or studies, or that hold such directories",
            ));
        }
    }
    let mut used = vec![false; leave_out.len()];
    let mut is_left_out = |is_called: &dyn Fn(&str) -> bool| {
        let mut any = false;
        for (name, used) in leave_out.iter().zip(&mut used) {
            let called = is_called(name);
            *used |= called;
            any |= called;
        }
        any
    };
    let mut measurements: Vec<Measurement> = Vec::new();
    let mut broken: Vec<(PathBuf, Error)> = Vec::new();
    let mut notes = Notes::default();
    for path in places {
        if is_left_out(&|name| is_path_called(&path, name)) {
            continue;
        }
        let collected = WarningCollector::new(monitor);
        let found = measurement(&path, model, &collected);
        notes.add(&path, collected.take());
        match found {
            Ok(entry) if is_left_out(&|name| entry.is_called(name)) => {}
            Ok(item) => measurements.push(item),
            Err(error) => broken.push((path, error)),
        }
    }
    notes.lines().iter().for_each(|line| monitor.warn(line));
    if let Some(index) = used.iter().position(|used| !used) {
        return Err(Error::input(
            InputPlace::setting(Setting::LeaveOut),
            format!("no experiment is called `{}`", leave_out[index]),
            "give an experiment's directory or its name, or a specimen's id",
        ));
    }
    refuse_broken(broken)?;
    refuse_twice(&measurements)?;
    Ok(measurements)
}

/// Largest number of experiments that a note lists by name.
const MOST_NAMED: usize = 3;

/// Notes that arise when experiments are read. Each note occurs once, with the names of the experiments to which it applies.
#[derive(Default)]
struct Notes {
    texts: Vec<String>,
    places: BTreeMap<String, Vec<String>>,
}

impl Notes {
    fn add(&mut self, path: &Path, notes: Vec<String>) {
        for note in notes {
            let names = self.places.entry(note.clone()).or_insert_with(|| {
                self.texts.push(note);
                Vec::new()
            });
            names.push(name_of(path));
        }
    }

    fn lines(&self) -> Vec<String> {
        let line = |text: &String| {
            let names = &self.places[text];
            let (named, rest) = names.split_at(names.len().min(MOST_NAMED));
            let rest = if rest.is_empty() { String::new() } else { format!(" and {} others", rest.len()) };
            format!("{}{rest}: {text}", named.join(", "))
        };
        self.texts.iter().map(line).collect()
    }
}

/// Finds the experiments and studies in a path and its subdirectories, in the order of their names. The content of an experiment or study is not
/// searched.
fn find(path: &Path, places: &mut Vec<PathBuf>) -> Result<()> {
    if path.is_file() || Study::is_study(path) || path.join("experiment.toml").is_file() {
        places.push(path.to_path_buf());
        return Ok(());
    }
    let refused = |source| Error::at_path("read", path, source, "give directories that exist and can be read");
    let mut below: Vec<PathBuf> = Vec::new();
    for entry in std::fs::read_dir(path).map_err(refused)? {
        let entry = entry.map_err(refused)?;
        if entry.path().is_dir() && !entry.file_name().to_string_lossy().starts_with('.') {
            // Links are refused, because they can form a loop or lead to an unrelated folder.
            if entry.file_type().map_err(refused)?.is_symlink() {
                return Err(Error::input(
                    InputPlace::file(entry.path()),
                    "this is a symbolic link; links inside a directory of experiments are not followed",
                    "name the directory that the link points to among the experiments, or remove the link",
                ));
            }
            below.push(entry.path());
        }
    }
    below.sort();
    below.iter().try_for_each(|path| find(path, places))
}

fn measurement(
    path: &Path,
    model: &dyn Fn(ModelSpecification) -> Result<ModelSpecification>,
    monitor: &dyn Monitor,
) -> Result<Measurement> {
    let ((experiment, files), specification) = if Study::is_study(path) {
        let study = Study::open(path)?;
        let specification = match study.revisions()?.last() {
            Some(last) => ModelSpecification::of_revision(&study.revision_dir(last)?, &Library::default())?,
            None => ModelSpecification::default(),
        };
        (study.read_experiment()?, specification)
    } else {
        (Experiment::read(path)?, ModelSpecification::default())
    };
    files.notes.iter().for_each(|note| monitor.warn(&note.to_string()));
    posterior::check::refuse_contradictions(&experiment, &files.interpretation, monitor)?;
    Ok(Measurement {
        path: path.to_path_buf(),
        experiment,
        inputs_sha256: hash_of(&files),
        specification: model(specification)?,
    })
}

fn hash_of(files: &ExperimentFiles) -> String {
    let mut hash = Hash::new();
    let log = files.log_file.iter().map(|(_, bytes)| bytes);
    for bytes in [&files.toml_bytes, &files.csv_bytes].into_iter().chain(log) {
        hash.update(bytes.len().to_le_bytes());
        hash.update(bytes);
    }
    hex(&hash.finalize())
}

/// Returns an error if some experiments could not be read: the error of the first such experiment, with the names of the others.
fn refuse_broken(mut broken: Vec<(PathBuf, Error)>) -> Result<()> {
    if broken.is_empty() {
        return Ok(());
    }
    let names: Vec<String> = broken.iter().map(|(path, _)| name_of(path)).collect();
    let options: Vec<String> = names.iter().map(|name| format!("{} {name}", Setting::LeaveOut)).collect();
    let more = match &names[1..] {
        [] => String::new(),
        others => format!(" (and {} more cannot be used: {})", others.len(), others.join(", ")),
    };
    let mend = |remedy: String| format!("{remedy}; or leave it out: {}", options.join(" "));
    Err(match broken.remove(0).1 {
        Error::Input { place, found, remedy } => Error::input(place, format!("{found}{more}"), mend(remedy)),
        Error::File { action, path, source, remedy } => Error::at_path(action, path, source, mend(remedy)),
        other => other,
    })
}

/// Refuses rows that occur twice, also under two specimens, because they would count as two measurements that agree.
fn refuse_twice(measurements: &[Measurement]) -> Result<()> {
    for (index, entry) in measurements.iter().enumerate() {
        if let Some(other) =
            measurements[..index].iter().find(|other| other.experiment.record == entry.experiment.record)
        {
            return Err(Error::input(
                InputPlace::file(&entry.path),
                format!("this is the same measurement as {}", other.path.display()),
                "give each measurement once",
            ));
        }
    }
    Ok(())
}
