//! Experiments of a cohort as tasks. Each task samples a few of them separately, as `groups` does before it compares them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::list::{Task, TaskInput, not_json};
use base::error::{Error, InputPlace, Result, Setting};
use cohorts::apparatus::{compliance, first_equal_apparatus};
use cohorts::cohort::{self, Measurement};
use cohorts::interim::Specimen;
use models::model::Compliance;
use posterior::monitor::{Monitor, SilentMonitor};
use posterior::study::ModelSpecification;
use sampling::SamplerOptions;

/// Sampling options of `groups`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sampling {
    /// `--base`.
    pub base: Option<String>,
    /// `--with`.
    pub with: Vec<String>,
    /// `--noise`.
    pub noise: Vec<String>,
    /// `--prior`.
    pub prior: Option<String>,
    /// `--set`.
    pub set: Vec<String>,
    /// `--chains`.
    pub n_walkers: usize,
    /// `--steps`.
    pub max_steps: u64,
    /// `--seed`.
    pub seed: u64,
}

impl Sampling {
    /// Applies these options to a model.
    ///
    /// # Errors
    /// As [`ModelSpecification::with_options`].
    pub fn model(&self, model_specification: ModelSpecification) -> Result<ModelSpecification> {
        model_specification.with_options(
            self.base.as_deref(),
            &self.with,
            &self.noise,
            self.prior.as_deref(),
            &self.set,
        )
    }

    /// The sampler's settings.
    pub(super) fn options(&self) -> SamplerOptions {
        let Self { n_walkers, max_steps, seed, .. } = *self;
        SamplerOptions { n_walkers, max_steps, seed, threads: 1, ..SamplerOptions::default() }
    }
}

/// Arguments of a task.
#[derive(Serialize, Deserialize)]
struct SampleTask {
    sampling: Sampling,
    experiments: Vec<Sampled>,
}

/// One experiment, identified by its content.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Sampled {
    name: String,
    /// SHA-256 of the experiment's files, model and priors.
    content_sha256: String,
    /// SHA-256 of the files of the experiment that represents the same apparatus.
    apparatus_sha256: String,
}

/// File of `groups`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct KeptFile {
    /// Name in the folder of experiments.
    pub name: String,
    /// Content of the file.
    pub text: String,
}

/// Returns the tasks of a cohort, `block` experiments each.
///
/// # Errors
/// [`Error::Input`] if an experiment and its model are incompatible.
pub fn work(measurements: &[Measurement], sampling: &Sampling, block: usize) -> Result<Vec<TaskInput>> {
    let first = first_equal_apparatus(measurements);
    let one = |(measurement, first): (&Measurement, &usize)| -> Result<(Sampled, [String; 2])> {
        let stands_for_its = &measurements[*first];
        let path = |measurement: &Measurement| measurement.path.display().to_string();
        Ok((sampled(measurement, stands_for_its, sampling)?, [path(measurement), path(stands_for_its)]))
    };
    let all = measurements.iter().zip(&first).map(one).collect::<Result<Vec<_>>>()?;
    let work = all.chunks(block.max(1)).map(|part| {
        let experiments = part.iter().map(|(sampled, _)| sampled.clone()).collect();
        TaskInput {
            arguments: json!(SampleTask { sampling: sampling.clone(), experiments }),
            paths: part.iter().flat_map(|(_, paths)| paths.clone()).collect(),
        }
    });
    Ok(work.collect())
}

fn sampled(measurement: &Measurement, stands_for_its: &Measurement, sampling: &Sampling) -> Result<Sampled> {
    // The apparatus identifies the compliance, so making a list needs no solution.
    let specimen = Specimen::new(measurement, Compliance::fixed(1.0)).map_err(|error| measurement.with_name(error))?;
    Ok(Sampled {
        name: measurement.name(),
        content_sha256: specimen.built_from(&measurement.inputs_sha256, &sampling.options()),
        apparatus_sha256: stands_for_its.inputs_sha256.clone(),
    })
}

/// State that the tasks of one worker share: the compliance of each apparatus, computed once.
#[derive(Default)]
pub(super) struct SamplingState {
    compliances: BTreeMap<PathBuf, (String, Compliance)>,
}

impl SamplingState {
    /// Samples a task's experiments.
    ///
    /// # Errors
    /// [`Error::Input`] if an experiment has changed since the list was made; otherwise the errors of the sampler.
    pub fn run(&mut self, task: &Task, monitor: &dyn Monitor) -> Result<Vec<u8>> {
        let SampleTask { sampling, experiments } = task.arguments_as()?;
        let (pairs, rest) = task.paths.as_chunks::<2>();
        if pairs.len() != experiments.len() || !rest.is_empty() {
            let found = format!("task {} does not have two paths per experiment", task.task);
            return Err(Error::input(
                InputPlace::default(),
                found,
                format!("make the list again with `{}`", Setting::Force),
            ));
        }
        let mut files = Vec::new();
        for (wanted, [label, stands_for_its]) in experiments.iter().zip(pairs) {
            let measurement = read(Path::new(label), &sampling, &SilentMonitor)?;
            let (found, compliance) = self.compliance(Path::new(stands_for_its), &sampling)?;
            let specimen = Specimen::new(&measurement, compliance).map_err(|error| measurement.with_name(error))?;
            let now =
                Specimen::new(&measurement, Compliance::fixed(1.0)).map_err(|error| measurement.with_name(error))?;
            if now.built_from(&measurement.inputs_sha256, &sampling.options()) != wanted.content_sha256
                || found != wanted.apparatus_sha256
            {
                return Err(Error::input(
                    InputPlace::file(&measurement.path),
                    "this experiment, its model or its priors have changed since the list was made",
                    format!(
                        "make the list again with the same command and `{}`: results of unchanged inputs are reused",
                        Setting::Force
                    ),
                ));
            }
            let (name, bytes) = specimen
                .interim_file(&measurement, &sampling.options(), monitor.stop())
                .map_err(|error| measurement.with_name(error))?;
            files.push(KeptFile { name, text: String::from_utf8_lossy(&bytes).into_owned() });
        }
        serde_json::to_vec(&files).map_err(|error| not_json(&error))
    }

    /// Compliance of an experiment's apparatus, with the hash of the experiment's files.
    fn compliance(&mut self, path: &Path, sampling: &Sampling) -> Result<(String, Compliance)> {
        if let Some(known) = self.compliances.get(path) {
            return Ok(known.clone());
        }
        let measurement = read(path, sampling, &SilentMonitor)?;
        let found = (
            measurement.inputs_sha256.clone(),
            compliance(&measurement, &SilentMonitor).map_err(|error| measurement.with_name(error))?,
        );
        self.compliances.insert(path.to_path_buf(), found.clone());
        Ok(found)
    }
}

/// Reads one experiment in its present state, with its model.
///
/// # Errors
/// As [`cohort::read`]; [`Error::Input`] unless there is exactly one.
pub fn read(path: &Path, sampling: &Sampling, monitor: &dyn Monitor) -> Result<Measurement> {
    let paths = [path.to_path_buf()];
    let mut found = cohort::read(&paths, &[], &|model_specification| sampling.model(model_specification), monitor)?;
    match (found.pop(), found.is_empty()) {
        (Some(measurement), true) => Ok(measurement),
        _ => Err(Error::input(
            InputPlace::file(path),
            "this is not a single experiment",
            format!(
                "give one experiment, or make the list of tasks again with the same command and `{}`",
                Setting::Force
            ),
        )),
    }
}

/// Reads the files of a result; `None` if a name is not a plain file name.
pub(super) fn files_of(body: &[u8]) -> Option<Vec<KeptFile>> {
    let files: Vec<KeptFile> = serde_json::from_slice(body).ok()?;
    let is_plain = |kept_file: &KeptFile| {
        Path::new(&kept_file.name).file_name().is_some_and(|name| name == kept_file.name.as_str())
    };
    files.iter().all(is_plain).then_some(files)
}
