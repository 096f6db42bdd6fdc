//! Tasks that play challenges. Each task plays a few cases of a `challenge run`.

use serde_json::json;

use super::list::{Task, TaskInput, not_json};
use base::error::{Error, Result};
use models::effects::Library;
use posterior::cache::cache_directory;
use posterior::monitor::Monitor;
use validation::challenge::Bench;
use validation::challenge::play::Play;
use validation::challenge::plays::{self, PlaysRequest};

/// Makes the tasks of a run. Each plays `block` cases.
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

/// Plays the cases of a task and returns the result's body.
///
/// # Errors
/// As [`plays::run`].
pub fn run(task: &Task, bench: &Bench, monitor: &dyn Monitor) -> Result<Vec<u8>> {
    let request: PlaysRequest = task.arguments_as()?;
    let cache = cache_directory().map(|place| place.join("challenge"));
    let played = plays::run(bench, &request, cache.as_deref(), &plays::diagnose_briefly, monitor)?.plays;
    let body = serde_json::to_vec(&played).map_err(|error| not_json(&error))?;
    // Values that change when they are read back would make the result differ from that of a single machine.
    match read(&body) {
        Some(back) if back == played => Ok(body),
        _ => Err(Error::numerical(
            format!("the plays from {} on contain numbers that JSON cannot represent", request.first),
            "report this with the command that was run",
        )),
    }
}

/// Reads the plays from a result's body; `None` if it is invalid.
pub fn read(body: &[u8]) -> Option<Vec<Play>> {
    serde_json::from_slice(body).ok()
}
