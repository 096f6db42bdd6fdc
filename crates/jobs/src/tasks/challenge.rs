//! Tasks of `challenge run`. Each task plays a few challenges: it simulates a record with a hidden effect or none, diagnoses the record and judges the
//! result.

use serde_json::json;

use super::list::{Task, TaskInput, not_json};
use base::error::{Error, Result};
use models::effects::Library;
use posterior::cache::cache_directory;
use posterior::monitor::Monitor;
use validation::challenge::Bench;
use validation::challenge::play::Play;
use validation::challenge::plays::{self, PlaysRequest};

/// Makes the tasks of a `challenge run`. Each task plays `block` challenges.
///
/// # Errors
/// [`Error::Input`] for a request that cannot be met.
pub fn work(request: &PlaysRequest, block: usize) -> Result<Vec<TaskInput>> {
    plays::check(&Library::default(), request)?;
    let end = request.first + request.count;
    let parts = (request.first..end).step_by(block.max(1)).map(|first| {
        let part = PlaysRequest { first, count: block.max(1).min(end - first), ..request.clone() };
        TaskInput { arguments: json!(part), paths: Vec::new() }
    });
    Ok(parts.collect())
}

/// Plays the challenges of a task: simulates, diagnoses and judges each. Returns the body of the result file.
///
/// # Errors
/// As [`plays::run`].
pub fn run(task: &Task, bench: &Bench, monitor: &dyn Monitor) -> Result<Vec<u8>> {
    let request: PlaysRequest = task.arguments_as()?;
    let cache = cache_directory().map(|place| place.join("challenge"));
    let played = plays::run(bench, &request, cache.as_deref(), &plays::diagnose_briefly, monitor)?.plays;
    let body = serde_json::to_vec(&played).map_err(|error| not_json(&error))?;
    // Values that change when their JSON text is read back would make the joined result differ from the result of a single machine.
    match read(&body) {
        Some(back) if back == played => Ok(body),
        _ => Err(Error::numerical(
            format!("the results from challenge {} on contain numbers that JSON cannot represent", request.first),
            "report this with the command that was run",
        )),
    }
}

/// Reads the outcomes of played challenges from the body of a result file; `None` if the body is invalid.
pub fn read(body: &[u8]) -> Option<Vec<Play>> {
    serde_json::from_slice(body).ok()
}
