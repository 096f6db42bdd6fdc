//! `sample`: samples the posterior of a record, or the joint posterior of several records.

use std::collections::BTreeMap;

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{Content, read_if_there, write_json_atomically};
use documents::joint::JointSummary;
use documents::oscillation::OscillationSummary;
use documents::posterior::{ModelSummary, PosteriorSummary, Warning, WarningKind};
use figures::svg::write_figure;
use models::effects::Library;
use posterior::check;
use posterior::fit;
use posterior::likelihood::ReducedPosterior;
use posterior::monitor::{Monitor, StoppableMonitor};
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;
use posterior::sample::refuse_nothing_to_sample;
use posterior::study::{POSTERIOR_NAME, Provenance, Study, WithProvenance};
use record::Control;
use sampling::SamplerOptions;
use serde::Serialize;

use crate::artefacts;
use crate::first_revision::{FIRST_REVISION, make_first_revision, refuse_other_model};
use crate::outcome::Outcome;
use crate::sweep::joint::{Joint, JointMember};
use crate::sweep::problem::SweepProblem;
use crate::sweep::{self, job};
use crate::target::{
    CreepTarget, JointTarget, SweepTarget, Target, TargetRecord, refuse_options_of_one, unsupported_target,
};

/// File name, without extension, of the document and the figure of a joint posterior.
const JOINT: &str = "joint";

/// Settings of `sample` that the caller chooses.
pub struct SampleRequest {
    /// Settings of the sampler.
    pub sampler: SamplerOptions,
    /// `true` continues an interrupted run from its checkpoint. Only for a single creep record.
    pub resume: bool,
}

/// Posterior of a creep record, an oscillation or several records.
#[derive(Serialize)]
#[serde(untagged)]
pub enum SampleDocument {
    /// Posterior of a creep record.
    Creep(Box<PosteriorSummary>),
    /// Posterior of an oscillation.
    Oscillation(Box<OscillationSummary>),
    /// Posterior of several records of one specimen.
    Joint(Box<JointSummary>),
}

/// Samples the posterior of a target. For a single record, the result becomes the study's `m0`. For several records, it is written into their output
/// directory.
///
/// # Errors
/// [`Error::Input`] for a cohort, or if an existing `m0` has another model or mesh; otherwise the errors of sampling and writing.
pub fn run(target: &Target, request: &SampleRequest, monitor: &dyn Monitor) -> Result<Outcome<SampleDocument>> {
    match target {
        Target::Creep(creep) => of_creep(creep, request, monitor),
        Target::Oscillation(sweep) => of_oscillation(sweep, request, monitor),
        Target::Joint(joint) => of_several(joint, request, monitor),
        Target::Cohort(_) => Err(unsupported_target()),
    }
}

fn of_creep(target: &CreepTarget, request: &SampleRequest, monitor: &dyn Monitor) -> Result<Outcome<SampleDocument>> {
    target.check(monitor)?;
    if let Some(study) = target.existing_study() {
        refuse_other_model(study, &target.specification, target.force)?;
    }
    let problem = target.problem(monitor)?;
    if let Some(study) = target.existing_study() {
        refuse_other_mesh(study, &problem, target.force)?;
    }
    refuse_nothing_to_sample(&problem)?;
    request.sampler.validate(problem.priors.priors().len())?;
    let study = target.make_study()?;
    if study.revision_dir(FIRST_REVISION).is_ok() {
        monitor.warn(&format!("the study's {FIRST_REVISION} will be replaced at the end of this run"));
    }
    let (result, written) = make_first_revision(&study, &problem, request.sampler.clone(), request.resume, monitor)?;
    let is_sound = result.summary.is_sound();
    let provenance = artefacts::with_inputs(study.provenance("posterior", 1, request.sampler.seed), &problem);
    let document = WithProvenance { provenance, body: SampleDocument::Creep(Box::new(result.summary)) };
    Ok(Outcome { document, is_sound, written, study: Some(study) })
}

/// Refuses to overwrite the study's first revision if it uses another mesh, unless `force` is set.
fn refuse_other_mesh(study: &Study, problem: &Problem, force: bool) -> Result<()> {
    let Ok(dir) = study.revision_dir(FIRST_REVISION) else { return Ok(()) };
    let path = dir.join(POSTERIOR_NAME);
    let Some(bytes) = read_if_there(&path, Content::Document) else { return Ok(()) };
    let before: Option<Provenance> = serde_json::from_slice(&bytes).ok();
    let mesh_of = |provenance: &Provenance| provenance.inputs_sha256.get(artefacts::MESH_INPUT).cloned();
    let now = mesh_of(&artefacts::with_inputs(study.provenance("posterior", 1, 0), problem));
    if force || before.is_none_or(|before| mesh_of(&before) == now) {
        return Ok(());
    }
    Err(Error::input(
        InputPlace::file(path),
        "the study's m0 uses another mesh",
        format!("choose another directory with `{}`, or replace m0 with `{}`", Setting::Out, Setting::Force),
    ))
}

fn of_oscillation(
    target: &SweepTarget,
    request: &SampleRequest,
    monitor: &dyn Monitor,
) -> Result<Outcome<SampleDocument>> {
    let options = &request.sampler;
    let problem = target.problem()?;
    if problem.priors.priors().is_empty() {
        let found = "every parameter is fixed, so there is nothing to infer";
        return Err(Error::input(InputPlace::setting(Setting::Fixed), found, "leave at least one parameter free"));
    }
    options.validate(problem.priors.priors().len())?;
    let study = target.make_study()?;
    refuse_other_model(&study, &problem.specification, target.force)?;
    let revision = study.begin_revision(FIRST_REVISION)?;
    let result = job::run(&problem, options, monitor)?;
    monitor.stage("writing results and figures");
    let header = |kind: &str| artefacts::with_prior(study.provenance(kind, 1, options.seed), &problem.priors);
    sweep::artefacts::write(revision.path(), &problem, &result, &header)?;
    let written = revision.commit()?;
    let is_sound = result.summary.is_sound();
    let body = SampleDocument::Oscillation(Box::new(result.summary));
    let document = WithProvenance { provenance: header("oscillation"), body };
    Ok(Outcome { document, is_sound, written, study: None })
}

/// One record of a joint posterior, joined with the law and ready for evaluating the record's log-density.
enum PreparedRecord {
    Creep(Box<PreparedModel>),
    Oscillation(Box<SweepProblem>),
}

impl PreparedRecord {
    fn of(record: &TargetRecord, target: &JointTarget, monitor: &dyn Monitor) -> Result<Self> {
        let specification = target.specification.clone();
        Ok(match record {
            TargetRecord::Creep(experiment, files) => {
                check::refuse_contradictions(experiment, &files.interpretation, monitor)?;
                let problem = Problem::new((**experiment).clone(), specification, None, monitor)?;
                Self::Creep(Box::new(PreparedModel::new(&problem, None, monitor)?))
            }
            TargetRecord::Oscillation(sweep, _) => {
                let problem = SweepProblem::new((**sweep).clone(), specification, &Library::default())?;
                Self::Oscillation(Box::new(problem))
            }
        })
    }

    fn density(&self) -> Option<ReducedPosterior<'_>> {
        match self {
            Self::Creep(creep) => Some(creep.posterior()),
            Self::Oscillation(_) => None,
        }
    }

    /// Warnings about the law's best fit to this record alone, held-out rows included. Parameters that the record alone does not determine are left out: the other records may
    /// determine them. A record that cannot be fitted alone has no warnings.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when stopped.
    fn warnings_alone(&self, seed: u64, monitor: &dyn Monitor) -> Result<Vec<Warning>> {
        use WarningKind::{ImpossiblePositions, LargeStrain, MisfitAboveNoise, ResidualPattern, SystematicResidual};
        let found = match self {
            Self::Creep(creep) => {
                fit::run(&creep.problem, None, &StoppableMonitor(monitor.stop())).map(|found| found.summary.warnings)
            }
            Self::Oscillation(problem) => job::misfit_alone(problem, seed).map(|found| found.into_iter().collect()),
        };
        let of_data = |warning: &Warning| {
            matches!(
                warning.kind,
                ImpossiblePositions | LargeStrain | MisfitAboveNoise | ResidualPattern | SystematicResidual
            )
        };
        match found {
            Ok(all) => Ok(all.into_iter().filter(of_data).collect()),
            Err(stopped @ Error::Interrupted { .. }) => Err(stopped),
            Err(_) => Ok(Vec::new()),
        }
    }

    fn member<'a>(&'a self, density: Option<&'a ReducedPosterior<'a>>) -> Option<JointMember<'a>> {
        match self {
            Self::Creep(creep) => density.map(|density| JointMember {
                id: creep.problem.experiment.specimen_id.clone(),
                kind: match creep.problem.experiment.control {
                    Control::Force => "creep",
                    Control::Position => "relaxation",
                },
                quantities: creep.problem.experiment.quantities(),
                noise_um: creep.problem.experiment.reference_noise().map(|noise| 1e6 * noise.sd_m),
                density,
                priors: &creep.problem.priors,
            }),
            Self::Oscillation(problem) => Some(JointMember {
                id: problem.sweep.specimen_id.clone(),
                kind: "oscillation",
                quantities: None,
                noise_um: None,
                density: &**problem,
                priors: &problem.priors,
            }),
        }
    }
}

fn of_several(target: &JointTarget, request: &SampleRequest, monitor: &dyn Monitor) -> Result<Outcome<SampleDocument>> {
    refuse_options_of_one(&[(Setting::Resume, request.resume)])?;
    let options = &request.sampler;
    let records: Vec<PreparedRecord> =
        target.records.iter().map(|record| PreparedRecord::of(record, target, monitor)).collect::<Result<_>>()?;
    let mut header = Provenance::new(JOINT, 1, options.seed, BTreeMap::new());
    for (number, record) in target.records.iter().enumerate() {
        for (name, hash) in Study::hashes_of(record.files())? {
            header.inputs_sha256.insert(format!("record {}: {name}", number + 1), hash);
        }
    }
    let densities: Vec<_> = records.iter().map(PreparedRecord::density).collect();
    let pairs = records.iter().zip(&densities);
    let members: Vec<JointMember<'_>> = pairs.filter_map(|(record, density)| record.member(density.as_ref())).collect();
    let joint = Joint::new(members, target.specification.base.parameters())?;
    options.validate(joint.priors.priors().len())?;
    let id = target.records.first().map_or("", TargetRecord::specimen_id);
    let dir = target.out.clone().unwrap_or_else(|| Study::default_dir(&format!("{id}-{JOINT}")));
    let written = dir.join(format!("{JOINT}.json"));
    if !written.is_file() {
        Study::check_place(&dir)?;
    }
    let summary = ModelSummary { noise: vec!["own".into()], ..target.specification.summary() };
    let mut result = joint.run(summary, options, monitor)?;
    monitor.stage("testing the law in each record alone");
    for (number, (record, member)) in records.iter().zip(&joint.members).enumerate() {
        let of_record = record.warnings_alone(options.seed, monitor)?.into_iter().map(|warning| {
            let translated =
                |text: String| member.quantities.map_or(text.clone(), |own| own.translate(&text).into_owned());
            let text = translated(format!("record {} alone: {}", number + 1, warning.text));
            Warning { text, advice: translated(warning.advice), ..warning }
        });
        result.summary.warnings.extend(of_record);
    }
    monitor.stage("writing results and figures");
    std::fs::create_dir_all(&dir).map_err(|error| {
        Error::at_path("create", &dir, error, format!("choose a writable place with `{}`", Setting::Out))
    })?;
    write_figure(&dir, JOINT, &sweep::artefacts::joint_figure(id, &joint.priors, &result)?)?;
    let provenance = artefacts::with_prior(header, &joint.priors);
    let is_sound = result.summary.is_sound();
    let document = WithProvenance { provenance, body: SampleDocument::Joint(Box::new(result.summary)) };
    write_json_atomically(&written, &document)?;
    Ok(Outcome { document, is_sound, written: dir, study: None })
}
