//! Worker: runs tasks one after another in one process, so that they share meshes and surrogates.

use std::io::{BufRead, Write};

use super::commands::RefuseLine;
use super::list::List;
use super::sample::SamplingState;
use super::{calibration, challenge, commands, models, result};
use base::error::{Error, Result};
use documents::tasks::TaskKind;
use posterior::monitor::{Monitor, StoppableMonitor};
use validation::challenge::Bench;

/// Outcome of a request to run a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TaskOutcome {
    /// The task was run and its result was written.
    Now,
    /// The result existed already, so the task was not run.
    Before,
}

/// Worker for the tasks of one list.
pub struct Worker<'a> {
    list: &'a List,
    bench: Option<Bench>,
    laboratory: SamplingState,
    simulator: calibration::CalibrationState,
    refuse_line: RefuseLine<'a>,
    monitor: &'a dyn Monitor,
}

impl<'a> Worker<'a> {
    /// Makes a worker, which prepares meshes and surrogates when a task first needs them. The worker runs no command that `refuse_line` refuses.
    pub fn new(list: &'a List, refuse_line: RefuseLine<'a>, monitor: &'a dyn Monitor) -> Self {
        let (laboratory, simulator) = (SamplingState::default(), calibration::CalibrationState::default());
        Self { list, bench: None, laboratory, simulator, refuse_line, monitor }
    }

    /// Runs the task with this number, unless its result exists already.
    ///
    /// # Errors
    /// The errors of the task, and [`Error::File`] if its result cannot be written. No partial result remains.
    pub fn run(&mut self, number: usize) -> Result<TaskOutcome> {
        let task = self.list.task(number)?;
        if result::read(self.list, &task).is_ok() {
            return Ok(TaskOutcome::Before);
        }
        let quiet = StoppableMonitor(self.monitor.stop());
        let body = match self.list.head().kind {
            TaskKind::Challenge => {
                let bench = match self.bench.take() {
                    Some(bench) => bench,
                    None => Bench::new(self.monitor)?,
                };
                challenge::run(&task, self.bench.insert(bench), &quiet)?
            }
            TaskKind::Sample => self.laboratory.run(&task, &quiet)?,
            TaskKind::Calibration => self.simulator.run(&task, self.monitor)?,
            TaskKind::Models => models::run(&task, self.monitor)?,
            TaskKind::Commands => commands::run(&task, self.refuse_line, &quiet)?,
        };
        result::write(self.list, &task, &body)?;
        Ok(TaskOutcome::Now)
    }
}

/// Answer of a worker to a task number. [`serve`] writes the answers, and `local` reads them.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum WorkerAnswer {
    /// The task was run and its result was written.
    Done,
    /// The result existed already, so the task was not run.
    Before,
    /// The task failed with this message. Another attempt may succeed.
    Failed(String),
    /// The task's input is not acceptable, for the reason in this message.
    Refused(String),
}

/// Runs the tasks whose numbers arrive in `numbers`, one per line. Writes one line to `answers` for each task. Returns when `numbers` ends.
///
/// # Errors
/// [`Error::Interrupted`] when stopped; [`Error::File`] if the answers cannot be written.
pub fn serve(
    list: &List,
    refuse_line: RefuseLine<'_>,
    numbers: impl BufRead,
    mut answers: impl Write,
    monitor: &dyn Monitor,
) -> Result<()> {
    let mut worker = Worker::new(list, refuse_line, monitor);
    for line in numbers.lines() {
        let Some(number) = line.ok().and_then(|line| line.trim().parse().ok()) else { return Ok(()) };
        let answer = match worker.run(number) {
            Ok(TaskOutcome::Now) => WorkerAnswer::Done,
            Ok(TaskOutcome::Before) => WorkerAnswer::Before,
            Err(error @ Error::Interrupted { .. }) => return Err(error),
            Err(error @ Error::Input { .. }) => WorkerAnswer::Refused(error.to_string()),
            Err(error) => WorkerAnswer::Failed(error.to_string()),
        };
        let text = serde_json::to_string(&answer).map_err(|error| super::list::not_json(&error))?;
        let told = writeln!(answers, "{text}").and_then(|()| answers.flush());
        told.map_err(|source| Error::at_path("answer", "standard output", source, "run the list again"))?;
    }
    Ok(())
}
