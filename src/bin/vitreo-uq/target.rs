//! What a command works on: an experiment or a study, its study directory and its model.

use std::path::PathBuf;

use vitreo_uq::base::error::{Error, Place, Result, Setting};
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::mechanics::MeshFile;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::study::{ModelSpecification, Provenance, Study};
use vitreo_uq::posterior::{check, replica};
use vitreo_uq::record::{Experiment, ExperimentFiles, Understood};

use crate::options::{Common, Model};

/// An experiment, the study that it belongs to or will belong to, and the model.
///
/// A new study is made by [`Target::make_study`] only, after everything that can be refused has been looked at.
pub struct Target {
    place: StudyPlace,
    /// The experiment.
    pub experiment: Experiment,
    /// How its description was taken.
    understood: Understood,
    /// The model that the options, or else the study's last revision, name.
    pub specification: ModelSpecification,
}

/// Where the study is, or will be.
enum StudyPlace {
    There(Study),
    New { dir: PathBuf, files: Box<ExperimentFiles>, force: bool },
}

impl Target {
    /// Reads what the user named, without writing anything, and prints what the reader noticed.
    pub fn open(common: &Common, model: &Model, monitor: &dyn Monitor) -> Result<Self> {
        Self::open_at(common, model, None, monitor)
    }

    /// The same; the model is that of the revision `default_revision`, where the options name none.
    pub fn open_at(
        common: &Common,
        model: &Model,
        default_revision: Option<&str>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        let (place, experiment, understood) = match &common.target {
            Some(path) if Study::is_study(path) => {
                if common.out.is_some() {
                    return Err(Error::input(
                        Place::setting(Setting::Out),
                        format!("{} is a study already", path.display()),
                        "leave --out away, or give the experiment instead of the study",
                    ));
                }
                let study = Study::open(path)?;
                let (experiment, files) = study.read_experiment()?;
                print_notes(&files, monitor);
                (StudyPlace::There(study), experiment, files.understood)
            }
            path => {
                if let Some(dir) = path.as_ref().filter(|dir| dir.join("model.toml").is_file()) {
                    return Err(Error::input(
                        Place::file(dir.as_path()),
                        "this is a revision of a study",
                        "give the study, and the revision with `--from`",
                    ));
                }
                let (experiment, files) = match path {
                    Some(path) => Experiment::read(path)?,
                    None => replica::embedded()?,
                };
                print_notes(&files, monitor);
                let dir = common.out.clone().unwrap_or_else(|| Study::default_dir(&experiment.specimen_id));
                let understood = files.understood.clone();
                (place_of(dir, files, common.force)?, experiment, understood)
            }
        };
        let specification = specification(place.study(), model, default_revision)?;
        Ok(Self { place, experiment, understood, specification })
    }

    /// Refuses a record that certainly contradicts its description, and says what may: before anything is fitted to it.
    pub fn check(&self, monitor: &dyn Monitor) -> Result<()> {
        check::refuse_certain(&self.experiment, &self.understood, monitor)
    }

    /// The study, if it is there already.
    pub fn existing_study(&self) -> Option<&Study> {
        self.place.study()
    }

    /// The header of a document, whether or not there is a study.
    pub fn provenance(&self, kind: &str, seed: u64) -> Result<Provenance> {
        match &self.place {
            StudyPlace::There(study) => Ok(study.provenance(kind, 1, seed)),
            StudyPlace::New { files, .. } => Ok(Provenance::new(kind, 1, seed, Study::hashes_of(files)?)),
        }
    }

    /// The study; it is made now if it is not there.
    pub fn make_study(&self) -> Result<Study> {
        match &self.place {
            StudyPlace::There(study) => Ok(study.clone()),
            StudyPlace::New { dir, files, force } => Study::open_or_create(dir, files, *force),
        }
    }

    /// Joins experiment, model and mechanics.
    pub fn problem(&self, model: &Model, monitor: &dyn Monitor) -> Result<Problem> {
        let mesh = model.mesh.clone().map(|path| MeshFile { path, metres_per_unit: model.mesh_unit });
        Problem::new(self.experiment.clone(), self.specification.clone(), mesh.as_ref(), monitor)
    }
}

impl StudyPlace {
    fn study(&self) -> Option<&Study> {
        match self {
            Self::There(study) => Some(study),
            Self::New { .. } => None,
        }
    }
}

/// A study of the same input that is there is continued; one of another input is refused unless it is to be replaced.
fn place_of(dir: PathBuf, files: ExperimentFiles, force: bool) -> Result<StudyPlace> {
    if Study::is_study(&dir) {
        match Study::open_or_create(&dir, &files, false) {
            Ok(study) => return Ok(StudyPlace::There(study)),
            Err(refusal) if !force => return Err(refusal),
            Err(_) => {}
        }
    }
    Study::check_place(&dir)?;
    Ok(StudyPlace::New { dir, files: Box::new(files), force })
}

fn print_notes(files: &ExperimentFiles, monitor: &dyn Monitor) {
    files.notes.iter().for_each(|note| monitor.warn(&note.to_string()));
}

/// The model of the named or last revision, or the default, with what the options change of it.
fn specification(study: Option<&Study>, model: &Model, default_revision: Option<&str>) -> Result<ModelSpecification> {
    let revision = match (&model.from, study) {
        (Some(name), Some(study)) => Some((study, name.clone())),
        (Some(name), None) => {
            return Err(Error::input(
                Place::setting(Setting::Revision),
                format!("there is no study yet, and so no revision {name}"),
                "leave --from away, or give the study that an earlier command made",
            ));
        }
        (None, Some(study)) => {
            let revisions = study.revisions()?;
            let is_wanted = |name: &&String| default_revision.is_none_or(|wanted| wanted == name.as_str());
            revisions.iter().rfind(is_wanted).map(|name| (study, name.clone()))
        }
        (None, None) => None,
    };
    let start = match revision {
        Some((study, name)) => ModelSpecification::of_revision(&study.revision_dir(&name)?, &Library::default())?,
        None => ModelSpecification::default(),
    };
    start.with_options(model.law().as_deref(), &model.with, &model.noise, model.prior.as_deref(), &model.set)
}
