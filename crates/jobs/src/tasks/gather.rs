//! Joins the results of a list's tasks into the files that a single machine would write.

use std::collections::BTreeSet;
use std::path::Path;

use rayon::prelude::*;

use super::list::{List, Task};
use super::{calibration, challenge, commands, models, result, sample};
use base::error::Result;
use base::files::{Content, create_folders, read_if_there, stream_atomically, write_atomically};
use cohorts::artefacts::EXPERIMENTS;
use documents::calibration::Calibration;
use documents::tasks::{Fault, Gathered, MissingResult, TaskKind};
use posterior::monitor::{Counter, Monitor, refuse_if_stopped};
use validation::challenge::play::Play;
use validation::challenge::plays::Plays;

pub use super::calibration::{DOCUMENT as CALIBRATION, FIGURES};
pub use super::commands::TABLE as COMMANDS;

/// File name of the document of challenges, in the folder of gathered results.
pub const CHALLENGE: &str = "challenge.json";

const WRITABLE: &str = "choose a writable directory";

/// Outcome of gathering results.
#[derive(Debug, Clone, PartialEq)]
pub struct GatherOutcome {
    /// Numbers of available and missing results.
    pub gathered: Gathered,
    /// Outcomes of all available challenges, in order. `None` for other kinds of tasks, or if no outcome is available.
    pub plays: Option<Plays>,
    /// Simulation-based calibration, computed from the available results. `None` for other kinds of tasks, or if no result is available.
    pub calibration: Option<Calibration>,
    /// Number of models that were added to the cache; `None` for other kinds of tasks.
    pub n_adopted: Option<usize>,
}

/// Reads every available result, writes the joined files into the folder `out`, and lists missing results. The files depend on the kind of tasks:
/// - challenges: the document of `challenge run`
/// - sampling of a cohort: the files of `groups`
/// - calibration: its document and figure
/// - commands: the files of each command, and a table
/// - reduced models: files in the cache instead of `out`
///
/// # Errors
/// [`base::Error::File`] if the file system refuses, [`base::Error::Interrupted`] when stopped.
pub fn gather(list: &List, out: &Path, monitor: &dyn Monitor) -> Result<GatherOutcome> {
    base::files::forbid_links(out, "the gathered results");
    monitor.stage(&format!("reading the results of {} tasks", list.n_tasks()));
    let found = match list.head().kind {
        TaskKind::Challenge => {
            let parts = over_tasks(list, monitor, |_, body| Ok(challenge::read(&body)))?;
            let faults = faults(&parts);
            let plays: Vec<Play> = parts.into_iter().filter_map(|part| part.ok()).flatten().collect();
            let plays = Some(plays).filter(|plays| !plays.is_empty()).map(Plays::of);
            GatheredParts { plays, ..GatheredParts::of(faults) }
        }
        TaskKind::Sample => {
            let folder = out.join(EXPERIMENTS);
            create_folders(&folder, WRITABLE)?;
            let parts = over_tasks(list, monitor, |_, body| keep(&folder, &body))?;
            GatheredParts::of(faults(&parts))
        }
        TaskKind::Calibration => {
            let parts = over_tasks(list, monitor, |_, body| Ok(calibration::read(&body)))?;
            let faults = faults(&parts);
            let calibration = calibration::joined(parts.into_iter().filter_map(|part| part.ok()).collect());
            GatheredParts { calibration, ..GatheredParts::of(faults) }
        }
        TaskKind::Models => {
            let parts = over_tasks(list, monitor, |_, body| models::adopt(&body))?;
            let n_adopted = parts.iter().filter(|part| matches!(part, Ok(true))).count();
            GatheredParts { n_adopted: Some(n_adopted), ..GatheredParts::of(faults(&parts)) }
        }
        TaskKind::Commands => {
            let folder = |task: &Task| out.join(commands::folder_name(task, list.n_tasks()));
            let parts = over_tasks(list, monitor, |task, body| commands::keep(&folder(task), &body))?;
            let codes: Vec<Option<i32>> = parts.iter().map(|part| part.as_ref().ok().copied()).collect();
            create_folders(out, WRITABLE)?;
            write_atomically(&out.join(COMMANDS), &commands::table(list, &codes)?)?;
            GatheredParts::of(faults(&parts))
        }
    };
    monitor.stage("writing the gathered results");
    if let Some(plays) = &found.plays {
        create_folders(out, WRITABLE)?;
        let document = plays.document(list.seed());
        // The JSON text is streamed into the file, so that it need not fit into memory.
        stream_atomically(&out.join(CHALLENGE), |file| {
            serde_json::to_writer_pretty(&mut *file, &document)?;
            file.write_all(b"\n")
        })?;
    }
    if let Some(found) = &found.calibration {
        calibration::write(list, found, out)?;
    }
    let gathered = Gathered {
        kind: list.head().kind,
        program: list.head().program.clone(),
        tasks: list.n_tasks(),
        results: list.n_tasks() - found.faults.len(),
        missing: found.faults,
        foreign: foreign(list)?,
    };
    let GatheredParts { plays, calibration, n_adopted, .. } = found;
    Ok(GatherOutcome { gathered, plays, calibration, n_adopted })
}

/// Finds the tasks without a valid result among the tasks whose numbers are in the range `numbers`.
///
/// # Errors
/// [`base::Error::Input`] if the list is damaged, [`base::Error::Interrupted`] when stopped.
pub fn missing(list: &List, numbers: std::ops::Range<usize>, monitor: &dyn Monitor) -> Result<Vec<usize>> {
    let is_missing = |number: usize| {
        refuse_if_stopped(monitor, "results are kept")?;
        let task = list.task(number)?;
        Ok(result::read(list, &task).is_err().then_some(number))
    };
    let found = numbers.into_par_iter().map(is_missing).collect::<Result<Vec<_>>>()?;
    Ok(found.into_iter().flatten().collect())
}

struct GatheredParts {
    faults: Vec<MissingResult>,
    plays: Option<Plays>,
    calibration: Option<Calibration>,
    n_adopted: Option<usize>,
}

impl GatheredParts {
    fn of(faults: Vec<MissingResult>) -> Self {
        Self { faults, plays: None, calibration: None, n_adopted: None }
    }
}

/// Calls `use_body` with the body of each task's result, and returns the values in the order of the tasks. A result for which `use_body` returns `None`
/// counts as damaged.
fn over_tasks<T: Send>(
    list: &List,
    monitor: &dyn Monitor,
    use_body: impl Fn(&Task, Vec<u8>) -> Result<Option<T>> + Sync,
) -> Result<Vec<std::result::Result<T, MissingResult>>> {
    let counter = Counter::new(monitor, list.n_tasks());
    let one = |number: usize| {
        refuse_if_stopped(monitor, "results are kept")?;
        let task = list.task(number)?;
        let found = match result::read(list, &task) {
            Ok(body) => use_body(&task, body)?.ok_or(Fault::Damaged),
            Err(fault) => Err(fault),
        };
        counter.add_one();
        Ok(found.map_err(|fault| MissingResult { task: number, file: task.result, fault }))
    };
    (0..list.n_tasks()).into_par_iter().map(one).collect()
}

fn faults<T>(parts: &[std::result::Result<T, MissingResult>]) -> Vec<MissingResult> {
    parts.iter().filter_map(|part| part.as_ref().err()).cloned().collect()
}

/// Writes the files of a sampling task's result into the folder from which `groups` reads them. An existing identical file is not rewritten.
fn keep(folder: &Path, body: &[u8]) -> Result<Option<()>> {
    let Some(files) = sample::files_of(body) else { return Ok(None) };
    for file in files {
        let path = folder.join(&file.name);
        if read_if_there(&path, Content::Document).is_none_or(|there| there != file.text.as_bytes()) {
            write_atomically(&path, file.text.as_bytes())?;
        }
    }
    Ok(Some(()))
}

/// Names of result files that belong to no task of the list. They may come from an earlier list or another program.
fn foreign(list: &List) -> Result<Vec<String>> {
    let names = (0..list.n_tasks()).map(|number| Ok(list.task(number)?.result)).collect::<Result<BTreeSet<_>>>()?;
    Ok(list.result_names()?.into_iter().filter(|name| !names.contains(name)).collect())
}

#[cfg(test)]
#[path = "gather_tests.rs"]
mod tests;
