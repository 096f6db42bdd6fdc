//! What a command works on, opened once: a creep record, an oscillation, several records of one specimen, or a cohort.

use std::path::{Path, PathBuf};

use base::error::{Error, Place, Result, Setting};
use cohorts::cohort::{self, Measurement};
use criticism::Subject;
use documents::errors::ModelErrors;
use models::effects::Library;
use posterior::mechanics::MeshFile;
use posterior::monitor::Monitor;
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;
use posterior::sample::refuse_nothing_to_sample;
use posterior::study::{ModelSpecification, Provenance, Study, WithProvenance};
use posterior::{check, replica};
use record::{Experiment, ExperimentFiles, Sweep, Understood};
use sampling::SamplerOptions;
use serde::Serialize;

use crate::artefacts;
use crate::first_revision::{FIRST_REVISION, kept_surrogate, make_first_revision};
use crate::last_cycle::{self, LastCycle};
use crate::outcome::Outcome;
use crate::sweep::problem::{DEFAULT_PRIOR, SweepProblem};

/// What the user names: records, a place, and a model.
#[derive(Clone, Default)]
pub struct TargetRequest {
    /// Experiments, studies, or a directory of them; none for the embedded replica.
    pub paths: Vec<PathBuf>,
    /// Directory of the results; `None` for the default.
    pub out: Option<PathBuf>,
    /// Whether results of another input or model are replaced.
    pub force: bool,
    /// What the options change of the model.
    pub model: ModelRequest,
}

/// Changes of the model that a study or the default has.
#[derive(Clone, Default)]
pub struct ModelRequest {
    /// Base law: a name or a file.
    pub base: Option<String>,
    /// Address of another program's model, which stands in place of a base law.
    pub forward: Option<String>,
    /// Effects: slugs or files.
    pub with: Vec<String>,
    /// Noise terms.
    pub noise: Vec<String>,
    /// Prior: a name or a file.
    pub prior: Option<String>,
    /// Parameters to fix or to free, as `name=value` or `name=free`.
    pub set: Vec<String>,
    /// Revision whose model is changed; `None` for the last.
    pub from: Option<String>,
    /// An imported mesh.
    pub mesh: Option<MeshFile>,
}

impl ModelRequest {
    /// The base law or what stands in its place.
    pub fn law(&self) -> Option<&str> {
        self.forward.as_deref().or(self.base.as_deref())
    }

    /// The model with these changes.
    ///
    /// # Errors
    /// As [`ModelSpecification::with_options`].
    pub fn applied_to(&self, model: ModelSpecification) -> Result<ModelSpecification> {
        model.with_options(self.law(), &self.with, &self.noise, self.prior.as_deref(), &self.set)
    }

    /// The first option given that says what the model is, and not which revision or mesh is meant.
    fn changing_setting(&self) -> Option<Setting> {
        first_given(&[
            (Setting::Base, self.base.is_some()),
            (Setting::Forward, self.forward.is_some()),
            (Setting::Effects, !self.with.is_empty()),
            (Setting::Noise, !self.noise.is_empty()),
            (Setting::Prior, self.prior.is_some()),
            (Setting::Fixed, !self.set.is_empty()),
        ])
    }
}

/// Sorts of targets. A command names those that it takes beside a creep record, which every command takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// One creep record or its study.
    Creep,
    /// One oscillation of a rheometer or its study.
    Oscillation,
    /// Several records of one specimen.
    Joint,
    /// Several specimens, or a directory of them.
    Cohort,
}

impl Kind {
    /// The sort that paths are, for a command that takes some sorts: the first of them that fits, else a creep record.
    pub fn of(paths: &[PathBuf], taken: &[Self]) -> Self {
        let is_folder = |path: &PathBuf| {
            path.is_dir()
                && !Study::is_study(path)
                && !["experiment.toml", "model.toml"].iter().any(|name| path.join(name).is_file())
        };
        let fits = |kind: &Self| match kind {
            Self::Creep => true,
            Self::Oscillation => paths.first().is_some_and(|path| Sweep::is_one(path)),
            Self::Joint => paths.len() > 1,
            Self::Cohort => paths.len() > 1 || paths.first().is_some_and(is_folder),
        };
        taken.iter().copied().find(fits).unwrap_or(Self::Creep)
    }
}

/// What a command works on. Opening it writes nothing.
pub enum Target {
    /// One creep record or its study.
    Creep(Box<CreepTarget>),
    /// One oscillation of a rheometer or its study.
    Oscillation(Box<SweepTarget>),
    /// Several records of one specimen.
    Joint(JointTarget),
    /// Several specimens.
    Cohort(CohortTarget),
}

impl Target {
    /// Reads what the user named, and reports what the reader noticed. The model is that of `default_revision`, where the options name no other.
    ///
    /// # Errors
    /// Those of reading, and [`Error::Input`] where a place or a model is refused.
    pub fn open(
        request: TargetRequest,
        taken: &[Kind],
        default_revision: Option<&str>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        Ok(match Kind::of(&request.paths, taken) {
            Kind::Creep => Self::Creep(Box::new(CreepTarget::open(request, default_revision, monitor)?)),
            Kind::Oscillation => Self::Oscillation(Box::new(SweepTarget::open(request)?)),
            Kind::Joint => Self::Joint(JointTarget::open(request)?),
            Kind::Cohort => Self::Cohort(CohortTarget { request }),
        })
    }

    /// The creep record.
    ///
    /// # Errors
    /// [`Error::Input`] for every other target.
    pub fn creep(&self) -> Result<&CreepTarget> {
        match self {
            Self::Creep(creep) => Ok(creep),
            _ => Err(not_taken()),
        }
    }
}

/// The refusal of a target that a command does not take.
pub(crate) fn not_taken() -> Error {
    Error::input(Place::default(), "this command takes one creep record", "give one experiment or study")
}

/// The first of some options that is given.
fn first_given(options: &[(Setting, bool)]) -> Option<Setting> {
    options.iter().find(|(_, is_given)| *is_given).map(|(option, _)| *option)
}

/// A creep record, the study that it belongs to or will belong to, and the model.
///
/// A new study is made by [`CreepTarget::make_study`] only, after everything that can be refused has been refused.
pub struct CreepTarget {
    place: StudyPlace,
    /// The experiment.
    pub experiment: Experiment,
    /// How its description was understood.
    understood: Understood,
    /// The model that the options, or else the study's last revision, name.
    pub specification: ModelSpecification,
    /// What the options change of the model.
    pub request: ModelRequest,
    /// Whether results of another input or model are replaced.
    pub force: bool,
}

/// Where the study is, or will be.
enum StudyPlace {
    There(Study),
    New { dir: PathBuf, files: Box<ExperimentFiles>, force: bool },
}

impl CreepTarget {
    /// Reads what the user named, without writing anything.
    ///
    /// # Errors
    /// As [`Target::open`].
    pub fn open(request: TargetRequest, default_revision: Option<&str>, monitor: &dyn Monitor) -> Result<Self> {
        let TargetRequest { paths, out, force, model } = request;
        let (place, experiment, understood) = match paths.first() {
            Some(path) if Study::is_study(path) => {
                refuse_out_of_study(path, out.as_deref())?;
                let study = Study::open(path)?;
                let (experiment, files) = study.read_experiment()?;
                report_notes(&files, monitor);
                (StudyPlace::There(study), experiment, files.understood)
            }
            path => {
                if let Some(dir) = path.filter(|dir| dir.join("model.toml").is_file()) {
                    return Err(Error::input(
                        Place::file(dir.as_path()),
                        "this is a revision of a study",
                        format!("give the study, and the revision with `{}`", Setting::Revision),
                    ));
                }
                let (experiment, files) = match path {
                    Some(path) => Experiment::read(path)?,
                    None => replica::embedded()?,
                };
                report_notes(&files, monitor);
                let dir = out.unwrap_or_else(|| Study::default_dir(&experiment.specimen_id));
                let understood = files.understood.clone();
                (place_of(dir, files, force)?, experiment, understood)
            }
        };
        let specification = specification(place.study(), &model, default_revision)?;
        Ok(Self { place, experiment, understood, specification, request: model, force })
    }

    /// Refuses a record that certainly contradicts its description, and reports possible contradictions: before anything is fitted to it.
    ///
    /// # Errors
    /// As [`check::refuse_certain`].
    pub fn check(&self, monitor: &dyn Monitor) -> Result<()> {
        check::refuse_certain(&self.experiment, &self.understood, monitor)
    }

    /// The study, if there is one already.
    pub fn existing_study(&self) -> Option<&Study> {
        self.place.study()
    }

    /// The header of a document, whether or not there is a study.
    ///
    /// # Errors
    /// As [`Study::hashes_of`].
    pub fn provenance(&self, kind: &str, seed: u64) -> Result<Provenance> {
        match &self.place {
            StudyPlace::There(study) => Ok(study.provenance(kind, 1, seed)),
            StudyPlace::New { files, .. } => Ok(Provenance::new(kind, 1, seed, Study::hashes_of(files)?)),
        }
    }

    /// The study; it is made now if it is not there.
    ///
    /// # Errors
    /// As [`Study::open_or_create`].
    pub fn make_study(&self) -> Result<Study> {
        match &self.place {
            StudyPlace::There(study) => Ok(study.clone()),
            StudyPlace::New { dir, files, force } => Study::open_or_create(dir, files, *force),
        }
    }

    /// Joins experiment, model and mechanics.
    ///
    /// # Errors
    /// As [`Problem::new`].
    pub fn problem(&self, monitor: &dyn Monitor) -> Result<Problem> {
        Problem::new(self.experiment.clone(), self.specification.clone(), self.request.mesh.as_ref(), monitor)
    }

    /// The revision that the options name, or the last; where the study has none, its m0 is made first.
    ///
    /// # Errors
    /// [`Error::Input`] where options would change a revision that is there; otherwise as [`make_first_revision`].
    pub fn revision(&self, options: SamplerOptions, monitor: &dyn Monitor) -> Result<Revision> {
        self.check(monitor)?;
        let there = match self.existing_study() {
            Some(study) => study.revisions()?,
            None => Vec::new(),
        };
        if let (false, Some(option)) = (there.is_empty(), self.request.changing_setting()) {
            return Err(Error::input(
                Place::setting(option),
                "the study has revisions, which are taken as they are",
                format!(
                    "leave the option away, choose a revision with `{}`, or make the next one with `vitreo-uq extend {} EFFECT`",
                    Setting::Revision,
                    Setting::Effects
                ),
            ));
        }
        let problem = self.problem(monitor)?;
        refuse_nothing_to_sample(&problem)?;
        options.validate(problem.priors.priors().len())?;
        let study = self.make_study()?;
        if there.is_empty() {
            monitor.stage("m0, the first model, on the calibration cycles");
            make_first_revision(&study, &problem, options, false, monitor)?;
        }
        let name = self.request.from.clone().or_else(|| there.last().cloned());
        Ok(Revision { study, name: name.unwrap_or_else(|| FIRST_REVISION.into()), problem })
    }
}

/// A revision of a study, ready to be criticised.
pub struct Revision {
    /// Its study.
    pub study: Study,
    /// Its name.
    pub name: String,
    /// Its model joined with the whole experiment.
    pub problem: Problem,
}

impl Revision {
    /// The experiment, split into fitted and scored cycles, for the fits of the revision's own model.
    ///
    /// # Errors
    /// As [`Subject::with_compliance`].
    pub fn subject(&self, monitor: &dyn Monitor) -> Result<Subject> {
        let kept = kept_surrogate(&self.study, monitor);
        let compliance = PreparedModel::unverified(&self.problem, kept, monitor)?.compliance;
        Subject::with_compliance(&self.problem, &Library::default(), compliance)
    }

    /// The experiment, split into fitted and scored cycles, for the fits of every effect: the surrogate may be wider.
    ///
    /// # Errors
    /// As [`Subject::new`].
    pub fn subject_for_effects(&self, monitor: &dyn Monitor) -> Result<Subject> {
        Subject::new(&self.problem, &Library::default(), kept_surrogate(&self.study, monitor), monitor)
    }

    /// Errors of its posterior given all cycles but the last.
    ///
    /// # Errors
    /// As [`LastCycle::posterior`].
    pub fn errors(&self, options: &SamplerOptions, monitor: &dyn Monitor) -> Result<ModelErrors> {
        let fitted = LastCycle::of(&self.study, &self.problem, &self.name)?;
        Ok(last_cycle::errors(&fitted.posterior(options, false, monitor)?))
    }

    /// The header of a document about the revision.
    pub fn provenance(&self, kind: &str, seed: u64) -> Provenance {
        artefacts::with_inputs(self.study.provenance(kind, 1, seed), &self.problem)
    }

    /// Adds a document of a kind, and the files beside it, to the revision: whole or not at all.
    ///
    /// # Errors
    /// [`Error::File`] where the operating system refuses, and those of `files`.
    pub fn amend<D: Serialize>(
        self,
        kind: &str,
        seed: u64,
        body: D,
        files: impl FnOnce(&Path) -> Result<()>,
    ) -> Result<Outcome<D>> {
        let document = WithProvenance { provenance: self.provenance(kind, seed), body };
        let writer = self.study.amend_revision(&self.name)?;
        let written = writer.publish(&format!("{kind}.json"), &document, files)?;
        Ok(Outcome { document, is_sound: true, written, study: Some(self.study) })
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

fn refuse_out_of_study(study: &Path, out: Option<&Path>) -> Result<()> {
    match out {
        Some(_) => Err(Error::input(
            Place::setting(Setting::Out),
            format!("{} is a study already", study.display()),
            format!("leave {} away, or give the experiment instead of the study", Setting::Out),
        )),
        None => Ok(()),
    }
}

fn report_notes(files: &ExperimentFiles, monitor: &dyn Monitor) {
    files.notes.iter().for_each(|note| monitor.warn(&note.to_string()));
}

/// The model of the named or last revision, or the default, with what the options change of it.
fn specification(
    study: Option<&Study>,
    model: &ModelRequest,
    default_revision: Option<&str>,
) -> Result<ModelSpecification> {
    let revision = match (&model.from, study) {
        (Some(name), Some(study)) => Some((study, name.clone())),
        (Some(name), None) => {
            return Err(Error::input(
                Place::setting(Setting::Revision),
                format!("there is no study yet, and so no revision {name}"),
                format!("leave {} away, or give the study that an earlier command made", Setting::Revision),
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
    model.applied_to(start)
}

/// An oscillation and its study, or where that will be.
pub struct SweepTarget {
    sweep: Sweep,
    files: ExperimentFiles,
    dir: PathBuf,
    model: ModelRequest,
    /// Whether results of another input or model are replaced.
    pub force: bool,
}

impl SweepTarget {
    fn open(request: TargetRequest) -> Result<Self> {
        let TargetRequest { paths, out, force, model } = request;
        let path = paths.first().map_or(Path::new("."), PathBuf::as_path);
        let (sweep, files) = Sweep::read(path)?;
        let dir = if Study::is_study(path) {
            refuse_out_of_study(path, out.as_deref())?;
            path.to_path_buf()
        } else {
            out.unwrap_or_else(|| Study::default_dir(&sweep.specimen_id))
        };
        if !Study::is_study(&dir) {
            Study::check_place(&dir)?;
        }
        Ok(Self { sweep, files, dir, model, force })
    }

    /// The model of the study's posterior, if it has one of this oscillation.
    fn specification(&self) -> Result<ModelSpecification> {
        if !Study::is_study(&self.dir) {
            return Ok(of_several());
        }
        let study = Study::open(&self.dir)?;
        let is_same = *study.inputs_sha256() == Study::hashes_of(&self.files)?;
        match study.revision_dir(FIRST_REVISION).ok().filter(|_| is_same) {
            Some(dir) => ModelSpecification::of_revision(&dir, &Library::default()),
            None => Ok(of_several()),
        }
    }

    /// Joins the oscillation and its model.
    ///
    /// # Errors
    /// [`Error::Input`] for options that an oscillation does not have; otherwise as [`SweepProblem::new`].
    pub fn problem(&self) -> Result<SweepProblem> {
        let ModelRequest { mesh, from, .. } = &self.model;
        if let Some(option) = first_given(&[(Setting::Mesh, mesh.is_some()), (Setting::Revision, from.is_some())]) {
            let found = "an oscillation has neither finite elements nor later revisions";
            return Err(Error::input(Place::setting(option), found, format!("leave {option} away")));
        }
        let specification = self.model.applied_to(self.specification()?)?;
        SweepProblem::new(self.sweep.clone(), specification, &Library::default())
    }

    /// The study; it is made now if it is not there.
    ///
    /// # Errors
    /// As [`Study::open_or_create`].
    pub fn make_study(&self) -> Result<Study> {
        Study::open_or_create(&self.dir, &self.files, self.force)
    }
}

/// The default model of oscillations and of several records: its prior holds for every instrument.
fn of_several() -> ModelSpecification {
    ModelSpecification { prior: DEFAULT_PRIOR.into(), ..ModelSpecification::default() }
}

/// Several records of one specimen, and the law that they share.
pub struct JointTarget {
    /// The records, in the order in which the user named them.
    pub records: Vec<Record>,
    /// The model: a law with white noise.
    pub specification: ModelSpecification,
    /// Directory of the results; `None` for the default.
    pub out: Option<PathBuf>,
}

/// A record of a specimen, with its files.
pub enum Record {
    /// Positions in time.
    Creep(Box<Experiment>, ExperimentFiles),
    /// Moduli against frequency.
    Oscillation(Box<Sweep>, ExperimentFiles),
}

impl Record {
    /// Its specimen.
    pub fn specimen_id(&self) -> &str {
        match self {
            Self::Creep(experiment, _) => &experiment.specimen_id,
            Self::Oscillation(sweep, _) => &sweep.specimen_id,
        }
    }

    /// Its files.
    pub fn files(&self) -> &ExperimentFiles {
        match self {
            Self::Creep(_, files) | Self::Oscillation(_, files) => files,
        }
    }
}

impl JointTarget {
    fn open(request: TargetRequest) -> Result<Self> {
        let TargetRequest { paths, out, model, .. } = request;
        refuse_options_of_one(&[
            (Setting::Effects, !model.with.is_empty()),
            (Setting::Noise, !model.noise.is_empty()),
            (Setting::Mesh, model.mesh.is_some()),
            (Setting::Revision, model.from.is_some()),
        ])?;
        let specification = model.applied_to(of_several())?;
        let record = |path: &PathBuf| -> Result<Record> {
            if Sweep::is_one(path) {
                let (sweep, files) = Sweep::read(path)?;
                return Ok(Record::Oscillation(Box::new(sweep), files));
            }
            let (experiment, files) = Experiment::read(path)?;
            Ok(Record::Creep(Box::new(experiment), files))
        };
        Ok(Self { records: paths.iter().map(record).collect::<Result<_>>()?, specification, out })
    }
}

/// Refuses options, each with whether it is given, that records of one law do not share.
pub(crate) fn refuse_options_of_one(options: &[(Setting, bool)]) -> Result<()> {
    match first_given(options) {
        Some(option) => Err(Error::input(
            Place::setting(option),
            "several records share the law alone, with white noise each",
            format!("leave {option} away, or sample one record"),
        )),
        None => Ok(()),
    }
}

/// Several specimens: directories, and what is common to all.
pub struct CohortTarget {
    /// What the user named.
    pub request: TargetRequest,
}

impl CohortTarget {
    /// Reads every record, but for those to leave out, with what the options change of each record's model.
    ///
    /// # Errors
    /// As [`cohort::read`].
    pub fn measurements(&self, leave_out: &[String], monitor: &dyn Monitor) -> Result<Vec<Measurement>> {
        let TargetRequest { paths, model, .. } = &self.request;
        cohort::read(paths, leave_out, &|own| model.applied_to(own), monitor)
    }

    /// Directory of the results.
    pub fn out<'a>(&'a self, default: &'a str) -> &'a Path {
        self.request.out.as_deref().unwrap_or(Path::new(default))
    }

    /// Refuses options that only one record can have: those of the model, and `more`, each with whether it is given; `command` takes them for one record.
    ///
    /// # Errors
    /// [`Error::Input`] for the first that is given.
    pub fn refuse_options_of_one(&self, more: &[(Setting, bool)], command: &str) -> Result<()> {
        let model = &self.request.model;
        let of_model = [(Setting::Revision, model.from.is_some()), (Setting::Mesh, model.mesh.is_some())];
        match first_given(&of_model).or_else(|| first_given(more)) {
            Some(option) => {
                let remedy = format!("leave {option} away, or {command} one record");
                Err(Error::input(Place::setting(option), "of several records each has its own", remedy))
            }
            None => Ok(()),
        }
    }
}
