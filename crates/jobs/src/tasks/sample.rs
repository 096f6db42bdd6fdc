//! Tasks that sample the experiments of a cohort. Each task samples a few experiments separately, as `groups` does before it compares them.

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

/// Options of `groups` that determine the model and the sampler.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sampling {
    /// Base law (`--base`).
    pub base: Option<String>,
    /// Effects (`--with`).
    pub with: Vec<String>,
    /// Noise terms (`--noise`).
    pub noise: Vec<String>,
    /// Prior (`--prior`).
    pub prior: Option<String>,
    /// Parameters that are fixed or freed (`--set`).
    pub set: Vec<String>,
    /// Number of walkers (`--chains`).
    pub n_walkers: usize,
    /// Largest number of steps (`--steps`).
    pub max_steps: u64,
    /// Seed (`--seed`).
    pub seed: u64,
}

impl Sampling {
    /// Applies the model options to a model.
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

    /// Sampler settings from the sampler options.
    pub(super) fn options(&self) -> SamplerOptions {
        let Self { n_walkers, max_steps, seed, .. } = *self;
        SamplerOptions { n_walkers, max_steps, seed, threads: 1, ..SamplerOptions::default() }
    }
}

/// Arguments of a sampling task, as the list of tasks stores them.
#[derive(Serialize, Deserialize)]
struct SampleTask {
    sampling: Sampling,
    experiments: Vec<Sampled>,
}

/// One experiment of a task, identified by its content.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Sampled {
    name: String,
    /// SHA-256 of the experiment's files, model and priors.
    content_sha256: String,
    /// SHA-256 of the files of the first experiment with an equal apparatus. The compliance of this first experiment is used.
    apparatus_sha256: String,
}

/// File with the draws of one experiment, as `groups` stores it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct KeptFile {
    /// File name in the folder of experiments.
    pub name: String,
    /// Content of the file.
    pub text: String,
}

/// Makes the tasks that sample a cohort. Each task samples `block` experiments.
///
/// # Errors
/// [`Error::Input`] if an experiment and its model are incompatible.
pub fn work(measurements: &[Measurement], sampling: &Sampling, block: usize) -> Result<Vec<TaskInput>> {
    let first = first_equal_apparatus(measurements);
    let one = |(measurement, first): (&Measurement, &usize)| -> Result<(Sampled, [String; 2])> {
        let same_apparatus = &measurements[*first];
        let path = |measurement: &Measurement| measurement.path.display().to_string();
        let (name, content_sha256) = (measurement.name(), content_sha256(measurement, sampling)?);
        let sampled = Sampled { name, content_sha256, apparatus_sha256: same_apparatus.inputs_sha256.clone() };
        Ok((sampled, [path(measurement), path(same_apparatus)]))
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

fn content_sha256(measurement: &Measurement, sampling: &Sampling) -> Result<String> {
    // A list identifies the compliance by the apparatus, so making a list needs no finite-element solution. The compliance 1 is a placeholder.
    let specimen = Specimen::new(measurement, Compliance::fixed(1.0)).map_err(|error| measurement.with_name(error))?;
    Ok(specimen.built_from(&measurement.inputs_sha256, &sampling.options()))
}

/// Error of an experiment that differs from that of the list.
pub(super) fn has_changed(measurement: &Measurement) -> Error {
    Error::input(
        InputPlace::file(&measurement.path),
        "this experiment, its model or its priors have changed since the list was made",
        format!(
            "make the list again with the same command and `{}`: results of unchanged inputs are reused",
            Setting::Force
        ),
    )
}

/// Compliance of each apparatus, computed once and shared by the tasks of one worker.
#[derive(Default)]
pub(super) struct SamplingState {
    compliances: BTreeMap<PathBuf, (String, Compliance)>,
}

impl SamplingState {
    /// Samples the experiments of a task. Returns the body of the result file: the files that `groups` keeps for these experiments.
    ///
    /// # Errors
    /// [`Error::Input`] if an experiment has changed since the list was made; otherwise the errors of the sampler.
    pub fn run(&mut self, task: &Task, monitor: &dyn Monitor) -> Result<Vec<u8>> {
        let SampleTask { sampling, experiments } = task.arguments_as()?;
        let (pairs, rest) = task.paths.as_chunks::<2>();
        if pairs.len() != experiments.len() || !rest.is_empty() {
            return Err(task.refusal("does not have two paths per experiment"));
        }
        let mut files = Vec::new();
        for (wanted, [label, same_apparatus]) in experiments.iter().zip(pairs) {
            let measurement = read(Path::new(label), &sampling, &SilentMonitor)?;
            let (found, compliance) = self.compliance(Path::new(same_apparatus), &sampling)?;
            let specimen = Specimen::new(&measurement, compliance).map_err(|error| measurement.with_name(error))?;
            if content_sha256(&measurement, &sampling)? != wanted.content_sha256 || found != wanted.apparatus_sha256 {
                return Err(has_changed(&measurement));
            }
            let (name, bytes) = specimen
                .interim_file(&measurement, &sampling.options(), monitor.stop())
                .map_err(|error| measurement.with_name(error))?;
            files.push(KeptFile { name, text: String::from_utf8_lossy(&bytes).into_owned() });
        }
        serde_json::to_vec(&files).map_err(|error| not_json(&error))
    }

    /// Returns the SHA-256 of the files of the experiment at `path`, and the compliance of its apparatus.
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

/// Reads the experiment at a path in its present state, with its model.
///
/// # Errors
/// As [`cohort::read`]; [`Error::Input`] unless there is exactly one experiment.
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

/// Reads the stored draws, one file per experiment, from a result's body. `None` if the body is invalid or a name is not a plain file name.
pub(super) fn files_of(body: &[u8]) -> Option<Vec<KeptFile>> {
    let files: Vec<KeptFile> = serde_json::from_slice(body).ok()?;
    let is_plain = |kept_file: &KeptFile| {
        Path::new(&kept_file.name).file_name().is_some_and(|name| name == kept_file.name.as_str())
    };
    files.iter().all(is_plain).then_some(files)
}
