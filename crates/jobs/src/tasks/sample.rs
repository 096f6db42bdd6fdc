//! A cohort's experiments as tasks: each samples a few on their own, as `groups` does before it compares them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::list::{Task, Work, not_json};
use base::error::{Error, Place, Result, Setting};
use cohorts::apparatus::{compliance, first_alike};
use cohorts::cohort::{self, Measurement};
use cohorts::interim::Specimen;
use models::model::Compliance;
use posterior::monitor::{Monitor, Silent};
use posterior::study::ModelSpecification;
use sampling::SamplerOptions;

/// What experiments are sampled with: the options of `groups`.
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
    /// A model with these options.
    ///
    /// # Errors
    /// As [`ModelSpecification::with_options`].
    pub fn model(&self, own: ModelSpecification) -> Result<ModelSpecification> {
        own.with_options(self.base.as_deref(), &self.with, &self.noise, self.prior.as_deref(), &self.set)
    }

    /// The sampler's settings.
    pub(super) fn options(&self) -> SamplerOptions {
        let Self { n_walkers, max_steps, seed, .. } = *self;
        SamplerOptions { n_walkers, max_steps, seed, threads: 1, ..SamplerOptions::default() }
    }
}

/// What a task computes.
#[derive(Serialize, Deserialize)]
struct Arguments {
    sampling: Sampling,
    experiments: Vec<Sampled>,
}

/// One experiment, by content.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Sampled {
    name: String,
    /// Of its files, its model and its priors.
    content_sha256: String,
    /// Of the files of the experiment whose apparatus stands for its own.
    apparatus_sha256: String,
}

/// A file as `groups` keeps it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct KeptFile {
    /// Name in the folder of experiments.
    pub name: String,
    /// Content.
    pub text: String,
}

/// The tasks of a cohort, `block` experiments each.
///
/// # Errors
/// [`Error::Input`] where an experiment and its model do not go together.
pub fn work(measurements: &[Measurement], sampling: &Sampling, block: usize) -> Result<Vec<Work>> {
    let first = first_alike(measurements);
    let one = |(own, first): (&Measurement, &usize)| -> Result<(Sampled, [String; 2])> {
        let stands_for_its = &measurements[*first];
        let path = |own: &Measurement| own.path.display().to_string();
        Ok((sampled(own, stands_for_its, sampling)?, [path(own), path(stands_for_its)]))
    };
    let all = measurements.iter().zip(&first).map(one).collect::<Result<Vec<_>>>()?;
    let work = all.chunks(block.max(1)).map(|part| {
        let experiments = part.iter().map(|(own, _)| own.clone()).collect();
        Work {
            arguments: json!(Arguments { sampling: sampling.clone(), experiments }),
            paths: part.iter().flat_map(|(_, paths)| paths.clone()).collect(),
        }
    });
    Ok(work.collect())
}

fn sampled(own: &Measurement, stands_for_its: &Measurement, sampling: &Sampling) -> Result<Sampled> {
    // Nothing is solved for a list: which compliance it will be is known by the apparatus.
    let specimen = Specimen::new(own, Compliance::given(1.0)).map_err(|error| own.named(error))?;
    Ok(Sampled {
        name: own.name(),
        content_sha256: specimen.built_from(&own.inputs_sha256, &sampling.options()),
        apparatus_sha256: stands_for_its.inputs_sha256.clone(),
    })
}

/// What one worker's tasks share: an apparatus is solved for once.
#[derive(Default)]
pub(super) struct Laboratory {
    compliances: BTreeMap<PathBuf, (String, Compliance)>,
}

impl Laboratory {
    /// Samples a task's experiments.
    ///
    /// # Errors
    /// [`Error::Input`] where an experiment has changed since the list was made, and whatever the sampler refuses.
    pub fn run(&mut self, task: &Task, monitor: &dyn Monitor) -> Result<Vec<u8>> {
        let Arguments { sampling, experiments } = task.understood()?;
        let (pairs, rest) = task.paths.as_chunks::<2>();
        if pairs.len() != experiments.len() || !rest.is_empty() {
            let found = format!("task {} has not two paths for each experiment", task.task);
            return Err(Error::input(
                Place::default(),
                found,
                format!("make the list again with `{}`", Setting::Force),
            ));
        }
        let mut files = Vec::new();
        for (wanted, [own, stands_for_its]) in experiments.iter().zip(pairs) {
            let own = read(Path::new(own), &sampling, &Silent)?;
            let (found, compliance) = self.compliance(Path::new(stands_for_its), &sampling)?;
            let specimen = Specimen::new(&own, compliance).map_err(|error| own.named(error))?;
            let now = Specimen::new(&own, Compliance::given(1.0)).map_err(|error| own.named(error))?;
            if now.built_from(&own.inputs_sha256, &sampling.options()) != wanted.content_sha256
                || found != wanted.apparatus_sha256
            {
                return Err(Error::input(
                    Place::file(&own.path),
                    "this experiment, its model or its priors have changed since the list was made",
                    format!(
                        "make the list again with the same command and `{}`: results of what did not change are used",
                        Setting::Force
                    ),
                ));
            }
            let (name, bytes) =
                specimen.interim_file(&own, &sampling.options(), monitor.stop()).map_err(|error| own.named(error))?;
            files.push(KeptFile { name, text: String::from_utf8_lossy(&bytes).into_owned() });
        }
        serde_json::to_vec(&files).map_err(|error| not_json(&error))
    }

    /// The compliance of an experiment's apparatus, with the hash of the experiment's files.
    fn compliance(&mut self, path: &Path, sampling: &Sampling) -> Result<(String, Compliance)> {
        if let Some(known) = self.compliances.get(path) {
            return Ok(known.clone());
        }
        let own = read(path, sampling, &Silent)?;
        let found = (own.inputs_sha256.clone(), compliance(&own, &Silent).map_err(|error| own.named(error))?);
        self.compliances.insert(path.to_path_buf(), found.clone());
        Ok(found)
    }
}

/// One experiment as it is now, with its model.
///
/// # Errors
/// As [`cohort::read`]; [`Error::Input`] where there is not one.
pub fn read(path: &Path, sampling: &Sampling, monitor: &dyn Monitor) -> Result<Measurement> {
    let paths = [path.to_path_buf()];
    let mut found = cohort::read(&paths, &[], &|own| sampling.model(own), monitor)?;
    match (found.pop(), found.is_empty()) {
        (Some(own), true) => Ok(own),
        _ => Err(Error::input(
            Place::file(path),
            "this is not one experiment",
            format!(
                "give one experiment; a list of tasks is made again with the same command and `{}`",
                Setting::Force
            ),
        )),
    }
}

/// The files of a result; each is a plain name with a text.
pub(super) fn files_of(body: &[u8]) -> Option<Vec<KeptFile>> {
    let files: Vec<KeptFile> = serde_json::from_slice(body).ok()?;
    let is_plain = |own: &KeptFile| Path::new(&own.name).file_name().is_some_and(|name| name == own.name.as_str());
    files.iter().all(is_plain).then_some(files)
}
