//! What a command works on: an experiment or a study, its study directory and its model.

use vitreo_uq::error::{Error, Place, Result};
use vitreo_uq::experiment::{Experiment, ExperimentFiles};
use vitreo_uq::study::{ModelSpecification, Study};
use vitreo_uq::workflow::Monitor;
use vitreo_uq::workflow::mechanics::MeshFile;
use vitreo_uq::workflow::problem::Problem;
use vitreo_uq::workflow::replica;

use crate::options::{Common, Model};

/// An opened study with its experiment and the model to use.
pub struct Target {
    /// The study.
    pub study: Study,
    /// Its experiment.
    pub experiment: Experiment,
    /// The model that the options, or else the study's last revision, name.
    pub specification: ModelSpecification,
}

impl Target {
    /// Opens or creates the study of what the user named, and prints what the reader noticed.
    pub fn open(common: &Common, model: &Model, monitor: &dyn Monitor) -> Result<Self> {
        let opened = match &common.target {
            Some(path) if Study::is_study(path) => {
                if common.out.is_some() {
                    return Err(Error::input(
                        Place::option("--out"),
                        format!("{} is a study already", path.display()),
                        "leave --out away, or give the experiment instead of the study",
                    ));
                }
                let study = Study::open(path)?;
                let (experiment, files) = study.read_experiment()?;
                (study, experiment, files)
            }
            path => {
                let (experiment, files) = match path {
                    Some(path) => Experiment::read(path)?,
                    None => replica::embedded()?,
                };
                let dir = common.out.clone().unwrap_or_else(|| Study::default_dir(&experiment.specimen_id));
                (Study::open_or_create(&dir, &files, common.force)?, experiment, files)
            }
        };
        let (study, experiment, files) = opened;
        print_notes(&files, monitor);
        let specification = specification(&study, model)?;
        Ok(Self { study, experiment, specification })
    }

    /// Joins experiment, model and mechanics.
    pub fn problem(&self, model: &Model, monitor: &dyn Monitor) -> Result<Problem> {
        let mesh = model.mesh.clone().map(|path| MeshFile { path, metres_per_unit: model.mesh_unit });
        Problem::new(self.experiment.clone(), self.specification.clone(), mesh.as_ref(), monitor)
    }
}

fn print_notes(files: &ExperimentFiles, monitor: &dyn Monitor) {
    files.notes.iter().for_each(|note| monitor.warn(&note.to_string()));
}

/// The model that the options name; without any, that of the named or last revision; without one, the default.
fn specification(study: &Study, model: &Model) -> Result<ModelSpecification> {
    let given = model.base.is_some()
        || !model.with.is_empty()
        || !model.noise.is_empty()
        || model.prior.is_some()
        || !model.set.is_empty();
    let revision = match &model.from {
        Some(name) => Some(name.clone()),
        None => study.revisions()?.pop(),
    };
    match revision {
        Some(name) if !given => ModelSpecification::read(&study.revision_dir(&name)?.join("model.toml")),
        _ => ModelSpecification::from_options(
            model.base.as_deref(),
            &model.with,
            &model.noise,
            model.prior.as_deref(),
            &model.set,
        ),
    }
}
