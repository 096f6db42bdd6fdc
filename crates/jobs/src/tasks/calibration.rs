//! Simulation-based calibration as tasks. Each task simulates and samples a few records of one experiment.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::list::{List, Task, Work, not_json};
use super::sample::{Sampling, read as read_measurement};
use base::error::{Error, Place, Result, Setting};
use base::files::{create_folders, write_json_atomically};
use cohorts::cohort::Measurement;
use documents::calibration::Calibration;
use figures::calibration::rank_histograms;
use figures::svg::write_figure;
use posterior::monitor::{Monitor, Silent};
use posterior::study::{Provenance, WithProvenance, sha256_hex};
use validation::calibration::{Bench, FEWEST, Replicate, Subject, check, judged};

/// Name of the document in the folder of gathered results.
pub const DOCUMENT: &str = "calibration.json";
/// Name of the folder of figures beside the document.
pub const FIGURES: &str = "figures";
/// Name of the figure, without extension.
const STEM: &str = "calibration";
/// Largest number of simulated records. The standard error of a proportion is then about 1/300.
const MOST: usize = 100_000;

/// Arguments of a task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Arguments {
    sampling: Sampling,
    /// Name of the experiment.
    name: String,
    /// SHA-256 of the experiment's files.
    inputs_sha256: String,
    /// SHA-256 of the experiment's files, model, priors and sampler settings.
    content_sha256: String,
    /// Number of the task's first record.
    first: usize,
    /// Number of records of the task.
    count: usize,
}

/// Returns the tasks of a calibration with `count` records, `block` records per task.
///
/// # Errors
/// [`Error::Input`] if the experiment's inference cannot be calibrated, or if `count` is too small or too large.
pub fn work(own: &Measurement, sampling: &Sampling, count: usize, block: usize) -> Result<Vec<Work>> {
    if !(FEWEST..=MOST).contains(&count) {
        let remedy = format!("give {FEWEST} to {MOST}; a few hundred reveal relevant errors");
        return Err(Error::input(Place::setting(Setting::Count), format!("{count} simulated records"), remedy));
    }
    let (name, content_sha256) = (own.name(), content(own, sampling)?);
    let parts = (0..count).step_by(block.max(1)).map(|first| {
        let arguments = Arguments {
            sampling: sampling.clone(),
            name: name.clone(),
            inputs_sha256: own.inputs_sha256.clone(),
            content_sha256: content_sha256.clone(),
            first,
            count: block.max(1).min(count - first),
        };
        Work { arguments: json!(arguments), paths: vec![own.path.display().to_string()] }
    });
    Ok(parts.collect())
}

/// SHA-256 of all inputs that the records depend on, except their numbers.
fn content(own: &Measurement, sampling: &Sampling) -> Result<String> {
    let priors = check(&own.experiment, &own.specification, &sampling.options())?;
    let Sampling { n_walkers, max_steps, seed, .. } = sampling;
    let model = format!("{:?} {n_walkers} {max_steps} {seed}", own.specification);
    Ok(sha256_hex(format!("{}\n{model}\n{priors}", own.inputs_sha256).as_bytes()))
}

/// State that the tasks of one worker share: an experiment that is meshed and trained once.
#[derive(Default)]
pub(super) struct Simulator {
    bench: Option<(String, Bench)>,
}

impl Simulator {
    /// Simulates and samples a task's records. Returns JSON lines, the subject first.
    ///
    /// # Errors
    /// [`Error::Input`] if the experiment has changed since the list was made; otherwise the errors of the simulation.
    pub fn run(&mut self, task: &Task, monitor: &dyn Monitor) -> Result<Vec<u8>> {
        let arguments: Arguments = task.understood()?;
        let Arguments { sampling, content_sha256, first, count, .. } = &arguments;
        let known = self.bench.take().filter(|(known, _)| known == content_sha256);
        let bench = match known {
            Some((_, bench)) => bench,
            None => prepared(task, &arguments, monitor)?,
        };
        let (_, bench) = self.bench.insert((content_sha256.clone(), bench));
        let replicates = bench.replicates(*first..first + count, &sampling.options(), monitor)?;
        let (subject, mut body) = (bench.subject(), Vec::new());
        line(&mut body, &subject)?;
        replicates.iter().try_for_each(|own| line(&mut body, own))?;
        // Values that change when read back would falsify the counts.
        match read(&body) {
            Some(back) if back.subject == subject && back.replicates == replicates => Ok(body),
            _ => Err(Error::numerical(
                format!("the records from {first} on contain numbers that JSON cannot represent"),
                "report this with the command that was run",
            )),
        }
    }
}

fn prepared(task: &Task, arguments: &Arguments, monitor: &dyn Monitor) -> Result<Bench> {
    let Some(path) = task.paths.first() else {
        let found = format!("task {} has no path", task.task);
        return Err(Error::input(Place::default(), found, format!("make the list again with `{}`", Setting::Force)));
    };
    let own = read_measurement(Path::new(path), &arguments.sampling, &Silent)?;
    if content(&own, &arguments.sampling)? != arguments.content_sha256 {
        return Err(Error::input(
            Place::file(&own.path),
            "this experiment, its model or its priors have changed since the list was made",
            format!("make the list again with the same command and `{}`", Setting::Force),
        ));
    }
    Bench::new(own.experiment, own.specification, monitor)
}

fn line(body: &mut Vec<u8>, content: &impl Serialize) -> Result<()> {
    serde_json::to_writer(&mut *body, content).map_err(|error| not_json(&error))?;
    body.push(b'\n');
    Ok(())
}

/// Content of a result.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Part {
    subject: Subject,
    replicates: Vec<Replicate>,
}

/// Reads the records of a result.
pub(super) fn read(body: &[u8]) -> Option<Part> {
    let mut lines = body.strip_suffix(b"\n")?.split(|byte| *byte == b'\n');
    let subject: Subject = serde_json::from_slice(lines.next()?).ok()?;
    let replicates = lines.map(|line| serde_json::from_slice(line).ok()).collect::<Option<Vec<Replicate>>>()?;
    let n_parameters = subject.parameters.len();
    let is_whole = |own: &Replicate| {
        own.ranked.as_ref().is_none_or(|own| own.ranks.len() == n_parameters + 1 && own.z.len() == n_parameters)
    };
    replicates.iter().all(is_whole).then_some(Part { subject, replicates })
}

/// Document of all available parts; `None` if there are none.
pub(super) fn joined(parts: Vec<Part>) -> Option<Calibration> {
    let subject = parts.first()?.subject.clone();
    let replicates: Vec<Replicate> = parts.into_iter().flat_map(|part| part.replicates).collect();
    Some(judged(&subject, &replicates))
}

/// Writes the document and its figure.
///
/// # Errors
/// [`Error::File`] if the file system refuses.
pub fn write(list: &List, found: &Calibration, out: &Path) -> Result<()> {
    let Arguments { name, inputs_sha256, .. } = list.task(0)?.understood()?;
    let provenance = Provenance::new("calibration", 1, list.seed(), BTreeMap::from([(name, inputs_sha256)]));
    let figures = out.join(FIGURES);
    create_folders(&figures, "choose a writable directory")?;
    write_json_atomically(&out.join(DOCUMENT), &WithProvenance { provenance, body: found })?;
    write_figure(&figures, STEM, &rank_histograms(found))
}
