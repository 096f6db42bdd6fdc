//! `sample`: from a measurement to a posterior that full finite elements have checked.

use std::process::ExitCode;
use std::time::Instant;

use vitreo_uq::base::error::{Error, Place, Result};
use vitreo_uq::base::files::{Content, read_if_there};
use vitreo_uq::jobs::artefacts;
use vitreo_uq::jobs::first_revision::{FIRST_REVISION, make_first_revision, refuse_other_model};
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::sample::refuse_nothing_to_sample;
use vitreo_uq::posterior::study::{POSTERIOR_NAME, Provenance, Study, WithProvenance};

use crate::options::SampleArguments;
use crate::target::Target;
use crate::terminal::Terminal;
use crate::{options, text};

pub fn run(arguments: &SampleArguments) -> Result<ExitCode> {
    if !arguments.others.is_empty() {
        return crate::joint::sample(arguments);
    }
    if crate::sweep::is_one(arguments.common.target.as_ref()) {
        return crate::sweep::sample(arguments);
    }
    let began = Instant::now();
    let common = &arguments.common;
    let threads = options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    let options = options::sampler(arguments.chains, arguments.steps, common.seed, threads);
    let terminal = Terminal::new(common.quiet);
    let target = Target::open_at(common, &arguments.model, Some(FIRST_REVISION), &terminal)?;
    target.check(&terminal)?;
    if let Some(study) = target.existing_study() {
        refuse_other_model(study, &target.specification, common.force)?;
    }
    let problem = target.problem(&arguments.model, &terminal)?;
    if let Some(study) = target.existing_study() {
        refuse_other_mesh(study, &problem, common.force)?;
    }
    refuse_nothing_to_sample(&problem)?;
    options.validate(problem.priors.priors().len())?;
    let study = &target.make_study()?;
    if study.revision_dir(FIRST_REVISION).is_ok() {
        terminal.warn(&format!("the study's {FIRST_REVISION} is replaced when this run ends"));
    }
    let (result, written) = make_first_revision(study, &problem, options, arguments.resume, &terminal)?;
    terminal.finish();
    let sound = result.summary.is_sound();
    let provenance = artefacts::with_inputs(study.provenance("posterior", 1, common.seed), &problem);
    let document = WithProvenance::<_> { provenance, body: &result.summary };
    let words = text::posterior(&result.summary);
    crate::output::show(common.json.as_deref(), &document, &words)?;
    crate::output::say_where(common.quiet, &written, began);
    crate::report::refresh(study, &arguments.page, common.quiet);
    Ok(ExitCode::from(u8::from(!sound)))
}

/// A revision on another mesh is not overwritten unless that is asked for.
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
        Place::file(path),
        "the study's m0 is on another mesh",
        "choose another directory with `--out`, or replace m0 with `--force`",
    ))
}
