//! First revision of a study, `m0`: samples its posterior and writes its files.

use std::path::PathBuf;
use std::time::Instant;

use super::artefacts;
use base::error::{Error, InputPlace, Result, Setting};
use models::effects::Library;
use posterior::monitor::Monitor;
use posterior::prepared::KeptSurrogate;
use posterior::prior::PriorSet;
use posterior::problem::Problem;
use posterior::sample::{self, SampleRequest, SampleResult};
use posterior::study::{ModelSpecification, Study};
use record::Experiment;
use sampling::SamplerOptions;

/// File with the state of an interrupted run.
const STATE: &str = "sampler.state";
/// Name of a study's first revision.
pub const FIRST_REVISION: &str = "m0";

/// Samples the posterior and writes it as the study's first revision, completely or not at all. Returns the result and the revision's directory.
///
/// # Errors
/// The errors of [`sample::run`] and of writing.
pub fn make_first_revision(
    study: &Study,
    problem: &Problem,
    options: SamplerOptions,
    resume: bool,
    monitor: &dyn Monitor,
) -> Result<(SampleResult, PathBuf)> {
    let revision = study.begin_revision(FIRST_REVISION)?;
    let unfinished = study.checkpoint_dir(FIRST_REVISION)?;
    // The model of an interrupted run, so that no other command takes another model in its place.
    if !(resume && unfinished.join("model.toml").is_file()) {
        artefacts::write_model(&unfinished, &problem.specification, &problem.priors)?;
    }
    let checkpoint = unfinished.join(STATE);
    let seed = options.seed;
    let request = SampleRequest {
        options,
        kept_surrogate: kept_surrogate(study, monitor),
        checkpoint: Some(&checkpoint),
        resume,
    };
    let mut result = sample::run(problem, &request, monitor)?;
    monitor.stage("writing results and figures");
    let clock = Instant::now();
    let header = |kind: &str| artefacts::with_inputs(study.provenance(kind, 1, seed), problem);
    artefacts::write(revision.path(), &result, &header)?;
    result.timing_s.push(("results and figures", clock.elapsed().as_secs_f64()));
    artefacts::write_timing(revision.path(), &result.timing_s, header("timing"))?;
    let written = revision.commit()?;
    study.discard_checkpoint(FIRST_REVISION)?;
    Ok((result, written))
}

/// Selects the cycles to which a revision is fitted: the calibration cycles for `m0` and for `None`. Later revisions are fitted to all cycles except the
/// last held-out cycle, as in `extend`.
pub fn with_fitted_cycles_of(experiment: Experiment, revision: Option<&str>) -> Experiment {
    if revision.is_none_or(|name| name == FIRST_REVISION) { experiment } else { experiment.for_comparison() }
}

/// Surrogate that an earlier run stored in the study; `None` if it is missing or unreadable. The caller must compare its hash with that of the model
/// before using it.
pub fn kept_surrogate(study: &Study, monitor: &dyn Monitor) -> Option<KeptSurrogate> {
    KeptSurrogate::read(&study.revision_dir(FIRST_REVISION).ok()?, monitor)
}

/// Directory with the state of an interrupted run; `None` without a state, which a run that failed before its sampling leaves.
fn unfinished_dir(study: &Study) -> Result<Option<PathBuf>> {
    Ok(study.unfinished_dir(FIRST_REVISION)?.filter(|dir| dir.join(STATE).is_file()))
}

/// Refuses to make the first revision of a study with another model than that of an interrupted run, which would be lost.
///
/// # Errors
/// [`Error::Input`] if an interrupted run has another model or an unknown one.
pub fn refuse_unfinished(study: &Study, specification: &ModelSpecification) -> Result<()> {
    let Some(dir) = unfinished_dir(study)? else { return Ok(()) };
    let unfinished = ModelSpecification::of_revision(&dir, &Library::default()).ok();
    if let Some(unfinished) = &unfinished
        && same_model(unfinished, specification)?
    {
        return Ok(());
    }
    let model = match &unfinished {
        Some(unfinished) if unfinished.effects.is_empty() => format!(" of the law {}", unfinished.summary().base),
        Some(unfinished) => format!(" with {}", unfinished.effects.join(", ")),
        None => String::new(),
    };
    Err(Error::input(
        InputPlace::file(study.dir()).at_key(FIRST_REVISION),
        format!("the study has no finished revision: a run{model} was interrupted"),
        format!(
            "finish that run by `sample` with its options and `{}`, or delete {} to begin with another model",
            Setting::Resume,
            dir.display()
        ),
    ))
}

/// Warning that a study with a first revision also has an interrupted run, which would replace it; `None` without one.
///
/// # Errors
/// Errors of [`Study::unfinished_dir`].
pub fn unfinished_warning(study: &Study) -> Result<Option<String>> {
    let dir = unfinished_dir(study)?;
    Ok(dir.map(|_| {
        format!(
            "a run that would replace {FIRST_REVISION} was interrupted; the present {FIRST_REVISION} is used. Finish that run by `sample` with its options and `{}`",
            Setting::Resume
        )
    }))
}

/// Refuses to overwrite the study's first revision `m0` by a revision of another model, unless `force` is set.
///
/// # Errors
/// [`Error::Input`] if `m0` has another model and `force` is not set.
pub fn refuse_other_model(study: &Study, specification: &ModelSpecification, force: bool) -> Result<()> {
    let Ok(dir) = study.revision_dir(FIRST_REVISION) else { return Ok(()) };
    let path = dir.join("model.toml");
    if force || same_model(&ModelSpecification::of_revision(&dir, &Library::default())?, specification)? {
        return Ok(());
    }
    Err(Error::input(
        InputPlace::file(path),
        "the study's m0 has another model, and `sample` writes only m0",
        format!(
            "choose another directory with `{}`, replace m0 with `{}`, or add effects with `extend`",
            Setting::Out,
            Setting::Force
        ),
    ))
}

/// Returns `true` if two models are equal. Their priors are compared by content, not by name.
fn same_model(ours: &ModelSpecification, other: &ModelSpecification) -> Result<bool> {
    let unnamed = |model: &ModelSpecification| ModelSpecification { prior: String::new(), ..model.clone() };
    let same_prior = || Ok(PriorSet::text_named(&ours.prior)?.1 == PriorSet::text_named(&other.prior)?.1);
    if unnamed(ours) == unnamed(other) { same_prior() } else { Ok(false) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use posterior::replica;

    /// An interrupted run leaves its model beside the sampler's state. Other commands continue with this model only.
    #[test]
    fn an_interrupted_run_of_another_model_is_not_replaced() {
        let place = tempfile::tempdir().expect("a directory");
        let (_, files) = replica::embedded().expect("the replica");
        let study = Study::open_or_create(&place.path().join("study"), &files, false).expect("a study");
        let base = ModelSpecification::default();
        assert!(
            refuse_unfinished(&study, &base).is_ok() && unfinished_warning(&study).is_ok_and(|text| text.is_none())
        );
        let with_slip = base.clone().with_options(None, &["interface-slip".into()], &[], None, &[]).expect("a model");
        let dir = study.checkpoint_dir(FIRST_REVISION).expect("a directory");
        with_slip.write(&dir.join("model.toml")).expect("a file");
        // A run that failed before its sampling has no state to be lost.
        assert!(refuse_unfinished(&study, &base).is_ok());
        std::fs::write(dir.join(STATE), "state").expect("a file");
        let refusal = refuse_unfinished(&study, &base).expect_err("a refusal").to_string();
        assert!(refusal.contains("a run with interface-slip was interrupted"), "{refusal}");
        assert!(refuse_unfinished(&study, &with_slip).is_ok());
        assert!(unfinished_warning(&study).is_ok_and(|text| text.is_some_and(|text| text.contains("m0 is used"))));
        // A run of an earlier version leaves the state without its model.
        std::fs::remove_file(dir.join("model.toml")).expect("a file");
        assert!(refuse_unfinished(&study, &base).is_err());
        study.discard_checkpoint(FIRST_REVISION).expect("a directory");
        assert!(refuse_unfinished(&study, &base).is_ok());
    }
}
