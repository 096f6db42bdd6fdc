//! Target: the input of a command, which is opened once. It is a creep record, an oscillation, several records of one specimen, or a cohort.

use std::path::{Path, PathBuf};

use base::error::{Error, InputPlace, Result, Setting};
use base::quantities::Quantities;
use cohorts::cohort::{self, Measurement};
use criticism::Subject;
use documents::posterior::PosteriorSummary;
use models::effects::Library;
use posterior::mechanics::MeshFile;
use posterior::monitor::Monitor;
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;
use posterior::sample::refuse_nothing_to_sample;
use posterior::study::{ModelSpecification, Provenance, Study, WithProvenance};
use posterior::{check, replica};
use record::{Experiment, ExperimentFiles, Interpretation, OscillationRecord};
use sampling::SamplerOptions;
use serde::Serialize;

use crate::artefacts;
use crate::first_revision::{
    FIRST_REVISION, kept_surrogate, make_first_revision, refuse_unfinished, unfinished_warning,
};
use crate::last_cycle::LastCycleFit;
use crate::outcome::Outcome;
use crate::sweep::problem::{DEFAULT_PRIOR, SweepProblem};

/// Names and options from which a [`Target`] is opened: records, output directory and model.
#[derive(Clone, Default)]
pub struct TargetRequest {
    /// Paths of experiments or studies, or of a directory that contains them. An empty list selects the embedded replica.
    pub paths: Vec<PathBuf>,
    /// Directory of the results; `None` for the default.
    pub out: Option<PathBuf>,
    /// `true` allows to replace results of another input or model.
    pub replace_existing: bool,
    /// Options that change the model.
    pub model: ModelRequest,
}

/// Options that change the model of the study, or the default model if there is no study.
#[derive(Clone, Default)]
pub struct ModelRequest {
    /// Base law: its name or a file.
    pub base: Option<String>,
    /// Address of an external model that replaces the base law.
    pub forward: Option<String>,
    /// Effects to add: names (slugs) or files.
    pub with: Vec<String>,
    /// Terms of the noise model.
    pub noise: Vec<String>,
    /// Prior: its name or a file.
    pub prior: Option<String>,
    /// Parameters to fix or to free, as `name=value` or `name=free`.
    pub set: Vec<String>,
    /// Name of the revision whose model is changed; `None` for the last.
    pub from: Option<String>,
    /// Mesh that is imported from a file.
    pub mesh: Option<MeshFile>,
}

impl ModelRequest {
    /// Base law, or the address of the external model that replaces it; `None` if neither is given.
    pub fn law(&self) -> Option<&str> {
        self.forward.as_deref().or(self.base.as_deref())
    }

    /// Applies the options to a model.
    ///
    /// # Errors
    /// As [`ModelSpecification::with_options`].
    pub fn applied_to(&self, model: ModelSpecification) -> Result<ModelSpecification> {
        model.with_options(self.law(), &self.with, &self.noise, self.prior.as_deref(), &self.set)
    }

    /// First option given by the user that changes the model itself. Options that select the revision or the mesh do not count.
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

/// Kind of target, which is the input of a command. Every command accepts a creep record, and some commands accept other kinds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TargetKind {
    /// One creep record, or a study of it.
    Creep,
    /// One oscillation of a rheometer, or a study of it.
    Oscillation,
    /// Several records of one specimen.
    Joint,
    /// Several specimens, or a directory that contains them.
    Cohort,
}

impl TargetKind {
    /// Determines the kind of target that the paths name. `taken` lists the kinds that the command accepts; the first kind that fits the paths is
    /// returned. If no kind fits, the result is `Creep`.
    pub fn of(paths: &[PathBuf], taken: &[Self]) -> Self {
        let is_folder = |path: &PathBuf| {
            path.is_dir()
                && !Study::is_study(path)
                && !["experiment.toml", "model.toml"].iter().any(|name| path.join(name).is_file())
        };
        let fits = |kind: &Self| match kind {
            Self::Creep => true,
            Self::Oscillation => paths.first().is_some_and(|path| OscillationRecord::is_described_in(path)),
            Self::Joint => paths.len() > 1,
            Self::Cohort => paths.len() > 1 || paths.first().is_some_and(is_folder),
        };
        taken.iter().copied().find(fits).unwrap_or(Self::Creep)
    }
}

/// Opened input of a command. Opening it writes nothing.
pub enum Target {
    /// One creep record, or a study of it.
    Creep(Box<CreepTarget>),
    /// One oscillation of a rheometer, or a study of it.
    Oscillation(Box<SweepTarget>),
    /// Several records of one specimen.
    Joint(JointTarget),
    /// Several specimens.
    Cohort(CohortTarget),
}

impl Target {
    /// Reads the target, and reports the reader's notes to `monitor`. The model is that of the revision `default_revision`, unless the options name
    /// another revision.
    ///
    /// # Errors
    /// The errors of reading; [`Error::Input`] if the output directory or the model is refused.
    pub fn open(
        request: TargetRequest,
        taken: &[TargetKind],
        default_revision: Option<&str>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        Ok(match TargetKind::of(&request.paths, taken) {
            TargetKind::Creep => Self::Creep(Box::new(CreepTarget::open(request, default_revision, monitor)?)),
            TargetKind::Oscillation => Self::Oscillation(Box::new(SweepTarget::open(request)?)),
            TargetKind::Joint => Self::Joint(JointTarget::open(request)?),
            TargetKind::Cohort => Self::Cohort(CohortTarget { request }),
        })
    }

    /// Returns the creep record of this target.
    ///
    /// # Errors
    /// [`Error::Input`] for every other target.
    pub fn creep(&self) -> Result<&CreepTarget> {
        match self {
            Self::Creep(creep) => Ok(creep),
            _ => Err(unsupported_target()),
        }
    }
}

/// Makes the error for a kind of target that the command does not accept.
pub(crate) fn unsupported_target() -> Error {
    Error::input(InputPlace::default(), "this command takes one creep record", "give one experiment or study")
}

/// Returns the first setting whose flag is `true`, which means that the user gave it.
fn first_given(options: &[(Setting, bool)]) -> Option<Setting> {
    options.iter().find(|(_, is_given)| *is_given).map(|(option, _)| *option)
}

/// Creep record with the model and the study. The study need not exist yet.
///
/// Only [`CreepTarget::make_study`] makes a new study, after all checks have passed.
pub struct CreepTarget {
    place: StudyPlace,
    /// Experiment: the record with its description.
    pub experiment: Experiment,
    /// Interpretation of the experiment's description by its reader.
    understood: Interpretation,
    /// Model of the study's last revision or the default model, changed by the options.
    pub specification: ModelSpecification,
    /// Options that change the model.
    pub request: ModelRequest,
    /// `true` allows to replace results of another input or model.
    pub force: bool,
}

/// Study that exists, or directory in which it will be made.
enum StudyPlace {
    There(Study),
    New { dir: PathBuf, files: Box<ExperimentFiles>, force: bool },
}

impl CreepTarget {
    /// Reads a creep record and its study. Writes nothing.
    ///
    /// # Errors
    /// As [`Target::open`].
    pub fn open(request: TargetRequest, default_revision: Option<&str>, monitor: &dyn Monitor) -> Result<Self> {
        let TargetRequest { paths, out, replace_existing: force, model } = request;
        let (place, experiment, understood) = match paths.first() {
            Some(path) if Study::is_study(path) => {
                refuse_out_of_study(path, out.as_deref())?;
                let study = Study::open(path)?;
                let (experiment, files) = study.read_experiment()?;
                report_notes(&experiment, &files, monitor);
                (StudyPlace::There(study), experiment, files.interpretation)
            }
            path => {
                if let Some(dir) = path.filter(|dir| dir.join("model.toml").is_file()) {
                    return Err(Error::input(
                        InputPlace::file(dir.as_path()),
                        "this is a revision of a study",
                        format!("give the study, and the revision with `{}`", Setting::Revision),
                    ));
                }
                let (experiment, files) = match path {
                    Some(path) => Experiment::read(path)?,
                    None => replica::embedded()?,
                };
                report_notes(&experiment, &files, monitor);
                let dir = out.unwrap_or_else(|| Study::default_dir(&experiment.specimen_id));
                let understood = files.interpretation.clone();
                (place_of(dir, files, force)?, experiment, understood)
            }
        };
        let specification = specification(place.study(), &model, default_revision, &experiment)?;
        Ok(Self { place, experiment, understood, specification, request: model, force })
    }

    /// Compares the record with its description, before any fit. Refuses certain contradictions, and reports possible contradictions to `monitor`.
    ///
    /// # Errors
    /// As [`check::refuse_contradictions`].
    pub fn check(&self, monitor: &dyn Monitor) -> Result<()> {
        check::refuse_contradictions(&self.experiment, &self.understood, monitor)
    }

    /// Returns the study; `None` if it does not exist yet.
    pub fn existing_study(&self) -> Option<&Study> {
        self.place.study()
    }

    /// Makes the header of a document about this record. The study need not exist.
    ///
    /// # Errors
    /// As [`Study::hashes_of`].
    pub fn provenance(&self, kind: &str, seed: u64) -> Result<Provenance> {
        match &self.place {
            StudyPlace::There(study) => Ok(study.provenance(kind, 1, seed)),
            StudyPlace::New { files, .. } => Ok(Provenance::new(kind, 1, seed, Study::hashes_of(files)?)),
        }
    }

    /// Returns the study and creates it if it does not exist.
    ///
    /// # Errors
    /// As [`Study::open_or_create`].
    pub fn make_study(&self) -> Result<Study> {
        match &self.place {
            StudyPlace::There(study) => Ok(study.clone()),
            StudyPlace::New { dir, files, force } => Study::open_or_create(dir, files, *force),
        }
    }

    /// Joins the experiment with its model, mesh and matrices.
    ///
    /// # Errors
    /// As [`Problem::new`].
    pub fn problem(&self, monitor: &dyn Monitor) -> Result<Problem> {
        Problem::new(self.experiment.clone(), self.specification.clone(), self.request.mesh.as_ref(), monitor)
    }

    /// Returns the revision that the options name, or the last. If the study has no revision, `m0` is made first.
    ///
    /// # Errors
    /// [`Error::Input`] if options would change an existing revision, or if a first revision of another model is unfinished; otherwise as [`make_first_revision`].
    pub fn revision(&self, options: SamplerOptions, monitor: &dyn Monitor) -> Result<Revision> {
        self.check(monitor)?;
        let there = match self.existing_study() {
            Some(study) => study.revisions()?,
            None => Vec::new(),
        };
        if let (false, Some(option)) = (there.is_empty(), self.request.changing_setting()) {
            return Err(Error::input(
                InputPlace::setting(option),
                "the study has revisions, and this option would change them",
                format!(
                    "leave out the option, choose a revision with `{}`, or make the next revision with `vitreo-uq extend {} EFFECT`",
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
            refuse_unfinished(&study, &problem.specification)?;
            monitor.stage("m0, the first model, on the calibration cycles");
            make_first_revision(&study, &problem, options, false, monitor)?;
        }
        if let Some(text) = unfinished_warning(&study)? {
            monitor.warn(&text);
        }
        let name = self.request.from.clone().or_else(|| there.last().cloned());
        Ok(Revision { study, name: name.unwrap_or_else(|| FIRST_REVISION.into()), problem })
    }
}

/// Revision of a study, ready for tests and comparisons.
pub struct Revision {
    /// Study to which the revision belongs.
    pub study: Study,
    /// Name of the revision.
    pub name: String,
    /// Model of the revision with the entire experiment.
    pub problem: Problem,
}

impl Revision {
    /// Splits the experiment into fitted and scored cycles, for fits of the revision's own model.
    ///
    /// # Errors
    /// As [`Subject::with_compliance`].
    pub fn subject(&self, monitor: &dyn Monitor) -> Result<Subject> {
        let kept = kept_surrogate(&self.study, monitor);
        let compliance = PreparedModel::unverified(&self.problem, kept, monitor)?.compliance;
        Subject::with_compliance(&self.problem, &Library::default(), compliance)
    }

    /// Splits the experiment into fitted and scored cycles, for fits of the model with each effect. Its surrogate may cover wider parameter ranges than
    /// the revision's surrogate.
    ///
    /// # Errors
    /// As [`Subject::new`].
    pub fn subject_for_effects(&self, monitor: &dyn Monitor) -> Result<Subject> {
        Subject::new(&self.problem, &Library::default(), kept_surrogate(&self.study, monitor), monitor)
    }

    /// Posterior of the revision's model fitted to all cycles except the last.
    ///
    /// # Errors
    /// As [`LastCycleFit::posterior`].
    pub fn last_cycle_posterior(&self, options: &SamplerOptions, monitor: &dyn Monitor) -> Result<PosteriorSummary> {
        LastCycleFit::of(&self.study, &self.problem, &self.name)?.posterior(options, false, monitor)
    }

    /// Makes the header of a document about the revision.
    pub fn provenance(&self, kind: &str, seed: u64) -> Provenance {
        artefacts::with_inputs(self.study.provenance(kind, 1, seed), &self.problem)
    }

    /// Adds a document and the files that `files` writes to the revision, completely or not at all.
    ///
    /// # Errors
    /// [`Error::File`] if the operating system refuses, and the errors of `files`.
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

/// Opens the study in `dir`, or selects `dir` for a new study. Refuses an existing study of other experiment files, unless `force` is set.
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
            InputPlace::setting(Setting::Out),
            format!("{} is already a study", study.display()),
            format!("leave out {}, or give the experiment instead of the study", Setting::Out),
        )),
        None => Ok(()),
    }
}

pub(crate) fn report_notes(experiment: &Experiment, files: &ExperimentFiles, monitor: &dyn Monitor) {
    for note in &files.notes {
        let text = note.to_string();
        match experiment.quantities() {
            Some(quantities) => monitor.warn(&quantities.translate(&text)),
            None => monitor.warn(&text),
        }
    }
}

/// Model of the named revision, the last revision or the default, changed by the options.
pub(crate) fn specification(
    study: Option<&Study>,
    model: &ModelRequest,
    default_revision: Option<&str>,
    experiment: &Experiment,
) -> Result<ModelSpecification> {
    let revision = match (&model.from, study) {
        (Some(name), Some(study)) => Some((study, name.clone())),
        (Some(name), None) => {
            return Err(Error::input(
                InputPlace::setting(Setting::Revision),
                format!("there is no study yet, so there is no revision {name}"),
                format!("leave out {}, or give the study that an earlier command made", Setting::Revision),
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
        // A prior of porcine vitreous means nothing for a table of stress and strain.
        None if experiment.quantities().is_some_and(|quantities| quantities != Quantities::Relaxation) => {
            default_specification()
        }
        None => ModelSpecification::default(),
    };
    model.applied_to(start)
}

/// Oscillation with its study. The study need not exist yet.
pub struct SweepTarget {
    /// The moduli.
    pub sweep: OscillationRecord,
    files: ExperimentFiles,
    dir: PathBuf,
    /// Options that change the model.
    pub request: ModelRequest,
    /// `true` allows to replace results of another input or model.
    pub force: bool,
}

impl SweepTarget {
    fn open(request: TargetRequest) -> Result<Self> {
        let TargetRequest { paths, out, replace_existing: force, model } = request;
        let path = paths.first().map_or(Path::new("."), PathBuf::as_path);
        let (sweep, files) = OscillationRecord::read(path)?;
        let dir = if Study::is_study(path) {
            refuse_out_of_study(path, out.as_deref())?;
            path.to_path_buf()
        } else {
            out.unwrap_or_else(|| Study::default_dir(&sweep.specimen_id))
        };
        if !Study::is_study(&dir) {
            Study::check_place(&dir)?;
        }
        Ok(Self { sweep, files, dir, request: model, force })
    }

    /// Model of the study's posterior if the study is of this oscillation; otherwise the default model.
    fn specification(&self) -> Result<ModelSpecification> {
        if !Study::is_study(&self.dir) {
            return Ok(default_specification());
        }
        let study = Study::open(&self.dir)?;
        let is_same = *study.inputs_sha256() == Study::hashes_of(&self.files)?;
        match study.revision_dir(FIRST_REVISION).ok().filter(|_| is_same) {
            Some(dir) => ModelSpecification::of_revision(&dir, &Library::default()),
            None => Ok(default_specification()),
        }
    }

    /// Refuses a mesh and a revision.
    ///
    /// # Errors
    /// [`Error::Input`] for these options.
    pub fn refuse_foreign_options(&self) -> Result<()> {
        let ModelRequest { mesh, from, .. } = &self.request;
        match first_given(&[(Setting::Mesh, mesh.is_some()), (Setting::Revision, from.is_some())]) {
            None => Ok(()),
            Some(option) => {
                let found = "an oscillation has neither finite elements nor later revisions";
                Err(Error::input(InputPlace::setting(option), found, format!("leave out {option}")))
            }
        }
    }

    /// Joins the oscillation with its model and priors.
    ///
    /// # Errors
    /// [`Error::Input`] for options that do not apply to an oscillation; otherwise as [`SweepProblem::new`].
    pub fn problem(&self) -> Result<SweepProblem> {
        self.refuse_foreign_options()?;
        let specification = self.request.applied_to(self.specification()?)?;
        SweepProblem::new(self.sweep.clone(), specification, &Library::default())
    }

    /// Returns the study and creates it if it does not exist.
    ///
    /// # Errors
    /// As [`Study::open_or_create`].
    pub fn make_study(&self) -> Result<Study> {
        Study::open_or_create(&self.dir, &self.files, self.force)
    }
}

/// Default model for oscillations and for several records. Its prior is wide enough for every instrument.
fn default_specification() -> ModelSpecification {
    ModelSpecification { prior: DEFAULT_PRIOR.into(), ..ModelSpecification::default() }
}

/// Several records of one specimen, whose law is inferred jointly.
pub struct JointTarget {
    /// Records in the order of the command line.
    pub records: Vec<TargetRecord>,
    /// Model of all records: a law with white noise.
    pub specification: ModelSpecification,
    /// Directory of the results; `None` for the default.
    pub out: Option<PathBuf>,
}

/// One record of a specimen, with its files.
pub enum TargetRecord {
    /// Creep record: positions over time.
    Creep(Box<Experiment>, ExperimentFiles),
    /// Oscillation: moduli over frequency.
    Oscillation(Box<OscillationRecord>, ExperimentFiles),
}

impl TargetRecord {
    /// Specimen identifier.
    pub fn specimen_id(&self) -> &str {
        match self {
            Self::Creep(experiment, _) => &experiment.specimen_id,
            Self::Oscillation(sweep, _) => &sweep.specimen_id,
        }
    }

    fn has_rows_of(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Creep(one, _), Self::Creep(other, _)) => one.record == other.record,
            (Self::Oscillation(one, _), Self::Oscillation(other, _)) => one.rows == other.rows,
            _ => false,
        }
    }

    /// Files of the record.
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
        let specification = model.applied_to(default_specification())?;
        let record = |path: &PathBuf| -> Result<TargetRecord> {
            if OscillationRecord::is_described_in(path) {
                let (sweep, files) = OscillationRecord::read(path)?;
                return Ok(TargetRecord::Oscillation(Box::new(sweep), files));
            }
            let (experiment, files) = Experiment::read(path)?;
            Ok(TargetRecord::Creep(Box::new(experiment), files))
        };
        let mut records: Vec<TargetRecord> = Vec::new();
        for path in &paths {
            let next = record(path)?;
            if records.iter().any(|earlier| earlier.has_rows_of(&next)) {
                return Err(repeated_rows(path));
            }
            records.push(next);
        }
        Ok(Self { records, specification, out })
    }
}

/// Refuses options that apply only to a single record. Each entry is a setting, with a flag that is `true` if the user gave the setting.
pub(crate) fn refuse_options_of_one(options: &[(Setting, bool)]) -> Result<()> {
    match first_given(options) {
        Some(option) => Err(Error::input(
            InputPlace::setting(option),
            "several records share only the law, each with its own white noise",
            format!("leave out {option}, or sample one record"),
        )),
        None => Ok(()),
    }
}

/// Makes the error for a record whose rows an earlier record of the same inference has.
pub(crate) fn repeated_rows(path: &Path) -> Error {
    Error::input(
        InputPlace::file(path),
        "an earlier record has the same rows, and rows that count twice would feign information",
        "give every record once",
    )
}

/// Several specimens, named by paths. The options apply to all of them.
pub struct CohortTarget {
    /// Paths and options of the user.
    pub request: TargetRequest,
}

impl CohortTarget {
    /// Reads every record except those in `leave_out`. The options change the model of each record.
    ///
    /// # Errors
    /// As [`cohort::read`].
    pub fn measurements(&self, leave_out: &[String], monitor: &dyn Monitor) -> Result<Vec<Measurement>> {
        let TargetRequest { paths, model, .. } = &self.request;
        cohort::read(paths, leave_out, &|model_specification| model.applied_to(model_specification), monitor)
    }

    /// Directory of the results: the one that the user gave, or `default`.
    pub fn out<'a>(&'a self, default: &'a str) -> &'a Path {
        self.request.out.as_deref().unwrap_or(Path::new(default))
    }

    /// Refuses options that apply only to a single record: those of the model, and the settings in `more`. A flag in `more` is `true` if the user gave the
    /// setting. `command` is the verb in the error's remedy.
    ///
    /// # Errors
    /// [`Error::Input`] for the first setting that was given.
    pub fn refuse_options_of_one(&self, more: &[(Setting, bool)], command: &str) -> Result<()> {
        let model = &self.request.model;
        let of_model = [(Setting::Revision, model.from.is_some()), (Setting::Mesh, model.mesh.is_some())];
        match first_given(&of_model).or_else(|| first_given(more)) {
            Some(option) => {
                let remedy = format!("leave out {option}, or {command} one record");
                Err(Error::input(InputPlace::setting(option), "this option applies to one record only", remedy))
            }
            None => Ok(()),
        }
    }
}
