//! Tasks of a simulation-based calibration. Each task simulates a few records of one experiment and samples their posteriors.

use std::collections::BTreeMap;
use std::path::Path;

use base::sha256::sha256_hex;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::list::{List, Task, TaskInput, not_json};
use super::sample::{Sampling, read as read_measurement};
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{create_folders, write_json_atomically};
use cohorts::cohort::Measurement;
use documents::calibration::Calibration;
use figures::calibration::rank_histograms;
use figures::svg::write_figure;
use posterior::monitor::{Monitor, SilentMonitor};
use posterior::study::{Provenance, WithProvenance};
use validation::calibration::{Bench, CalibrationSubject, FEWEST, Replicate, check, judge};

/// File name of the calibration document, in the folder of gathered results.
pub const DOCUMENT: &str = "calibration.json";
/// Name of the folder for figures, beside the document.
pub const FIGURES: &str = "figures";
/// File name of the figure, without extension.
const STEM: &str = "calibration";
/// Largest number of simulated records. The standard error of a proportion is then about 1/300.
const MOST: usize = 100_000;

/// Arguments of a calibration task, as the list of tasks stores them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct CalibrationTask {
    sampling: Sampling,
    /// Name of the experiment that is calibrated.
    name: String,
    /// SHA-256 of the experiment's files.
    inputs_sha256: String,
    /// SHA-256 of the experiment's files, model, priors and sampler settings.
    content_sha256: String,
    /// Number of the task's first simulated record.
    first: usize,
    /// Number of records that the task simulates.
    count: usize,
}

/// Makes the tasks of a calibration with `count` simulated records. Each task simulates `block` records.
///
/// # Errors
/// [`Error::Input`] if the experiment's inference cannot be calibrated, or if `count` is too small or too large.
pub fn work(measurement: &Measurement, sampling: &Sampling, count: usize, block: usize) -> Result<Vec<TaskInput>> {
    if !(FEWEST..=MOST).contains(&count) {
        let remedy = format!("give {FEWEST} to {MOST}; a few hundred reveal relevant errors");
        return Err(Error::input(InputPlace::setting(Setting::Count), format!("{count} simulated records"), remedy));
    }
    let (name, content_sha256) = (measurement.name(), content(measurement, sampling)?);
    let parts = (0..count).step_by(block.max(1)).map(|first| {
        let arguments = CalibrationTask {
            sampling: sampling.clone(),
            name: name.clone(),
            inputs_sha256: measurement.inputs_sha256.clone(),
            content_sha256: content_sha256.clone(),
            first,
            count: block.max(1).min(count - first),
        };
        TaskInput { arguments: json!(arguments), paths: vec![measurement.path.display().to_string()] }
    });
    Ok(parts.collect())
}

/// Returns the SHA-256 of the inputs that the tasks of one calibration share: the experiment's files, the model, its priors and the sampler's
/// settings. It does not depend on the simulated records that a task makes.
fn content(measurement: &Measurement, sampling: &Sampling) -> Result<String> {
    let priors = check(&measurement.experiment, &measurement.specification, &sampling.options())?;
    let Sampling { n_walkers, max_steps, seed, .. } = sampling;
    let model = format!("{:?} {n_walkers} {max_steps} {seed}", measurement.specification);
    Ok(sha256_hex(format!("{}\n{model}\n{priors}", measurement.inputs_sha256).as_bytes()))
}

/// Prepared experiment that all tasks of one worker share: its mesh and its surrogate are made only once.
#[derive(Default)]
pub(super) struct CalibrationState {
    bench: Option<(String, Bench)>,
}

impl CalibrationState {
    /// Simulates the records of a task and samples their posteriors. Returns the content of the result file, a sequence of JSON lines. The first
    /// line describes the calibrated experiment.
    ///
    /// # Errors
    /// [`Error::Input`] if the experiment has changed since the list was made; otherwise the errors of the simulation.
    pub fn run(&mut self, task: &Task, monitor: &dyn Monitor) -> Result<Vec<u8>> {
        let arguments: CalibrationTask = task.arguments_as()?;
        let CalibrationTask { sampling, content_sha256, first, count, .. } = &arguments;
        let known = self.bench.take().filter(|(known, _)| known == content_sha256);
        let bench = match known {
            Some((_, bench)) => bench,
            None => prepared(task, &arguments, monitor)?,
        };
        let (_, bench) = self.bench.insert((content_sha256.clone(), bench));
        let replicates = bench.replicates(*first..first + count, &sampling.options(), monitor)?;
        let (subject, mut body) = (bench.subject(), Vec::new());
        line(&mut body, &subject)?;
        replicates.iter().try_for_each(|replicate| line(&mut body, replicate))?;
        // Values that change when their JSON text is read back would falsify the calibration.
        match read(&body) {
            Some(back) if back.subject == subject && back.replicates == replicates => Ok(body),
            _ => Err(Error::numerical(
                format!("the records from {first} on contain numbers that JSON cannot represent"),
                "report this with the command that was run",
            )),
        }
    }
}

fn prepared(task: &Task, arguments: &CalibrationTask, monitor: &dyn Monitor) -> Result<Bench> {
    let measurement = read_measurement(task.path()?, &arguments.sampling, &SilentMonitor)?;
    if content(&measurement, &arguments.sampling)? != arguments.content_sha256 {
        return Err(Error::input(
            InputPlace::file(&measurement.path),
            "this experiment, its model or its priors have changed since the list was made",
            format!("make the list again with the same command and `{}`", Setting::Force),
        ));
    }
    Bench::new(measurement.experiment, measurement.specification, monitor)
}

fn line(body: &mut Vec<u8>, content: &impl Serialize) -> Result<()> {
    serde_json::to_writer(&mut *body, content).map_err(|error| not_json(&error))?;
    body.push(b'\n');
    Ok(())
}

/// Result of one calibration task: the calibrated experiment, and its simulated records with their ranks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CalibrationPart {
    subject: CalibrationSubject,
    replicates: Vec<Replicate>,
}

/// Reads the simulated records from the content of a task's result file; `None` if the content is invalid.
pub(super) fn read(body: &[u8]) -> Option<CalibrationPart> {
    let mut lines = body.strip_suffix(b"\n")?.split(|byte| *byte == b'\n');
    let subject: CalibrationSubject = serde_json::from_slice(lines.next()?).ok()?;
    let replicates = lines.map(|line| serde_json::from_slice(line).ok()).collect::<Option<Vec<Replicate>>>()?;
    let n_parameters = subject.parameters.len();
    let is_whole = |replicate: &Replicate| {
        replicate
            .ranked
            .as_ref()
            .is_none_or(|ranked| ranked.ranks.len() == n_parameters + 1 && ranked.z.len() == n_parameters)
    };
    replicates.iter().all(is_whole).then_some(CalibrationPart { subject, replicates })
}

/// Makes the calibration document from the results of all available tasks; `None` if there are none.
pub(super) fn joined(parts: Vec<CalibrationPart>) -> Option<Calibration> {
    let subject = parts.first()?.subject.clone();
    let replicates: Vec<Replicate> = parts.into_iter().flat_map(|part| part.replicates).collect();
    Some(judge(&subject, &replicates))
}

/// Writes the document and its figure into the folder `out`.
///
/// # Errors
/// [`Error::File`] if the file system refuses.
pub fn write(list: &List, found: &Calibration, out: &Path) -> Result<()> {
    let CalibrationTask { name, inputs_sha256, .. } = list.task(0)?.arguments_as()?;
    let provenance = Provenance::new("calibration", 1, list.seed(), BTreeMap::from([(name, inputs_sha256)]));
    let figures = out.join(FIGURES);
    create_folders(&figures, "choose a writable directory")?;
    write_json_atomically(&out.join(DOCUMENT), &WithProvenance { provenance, body: found })?;
    write_figure(&figures, STEM, &rank_histograms(found))
}
