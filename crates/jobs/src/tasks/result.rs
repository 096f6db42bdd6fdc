//! Result file of one task. The first line, called the head, identifies the task. The body with the computed results follows.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::list::{List, Task, not_json};
use base::error::Result;
use base::files::{Content, read_if_there, write_atomically};
use base::sha256::sha256_hex;
use documents::tasks::Fault;

/// First line of a result file. It identifies the task and the program.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    schema: String,
    id: String,
    program: String,
    input_sha256: String,
    body_bytes: usize,
    body_sha256: String,
}

const SCHEMA: &str = "vitreo-uq/task-result/1";

/// Makes the content of a result file from its body, the computed results of the task.
///
/// # Errors
/// [`base::Error::Numerical`] if the head cannot be written as JSON.
pub fn bytes(program: &str, task: &Task, body: &[u8]) -> Result<Vec<u8>> {
    let head = Head {
        schema: SCHEMA.into(),
        id: task.id.clone(),
        program: program.into(),
        input_sha256: task.input_sha256(),
        body_bytes: body.len(),
        body_sha256: sha256_hex(body),
    };
    let mut bytes = serde_json::to_vec(&head).map_err(|error| not_json(&error))?;
    bytes.push(b'\n');
    bytes.extend_from_slice(body);
    Ok(bytes)
}

/// Writes the result file of a task completely or not at all.
///
/// # Errors
/// [`base::Error::File`] if the file system refuses, for example because the disk is full. An earlier result then stays unchanged.
pub fn write(list: &List, task: &Task, body: &[u8]) -> Result<()> {
    write_atomically(&list.result_path(task), &bytes(&list.head().program, task, body)?)
}

/// Reads the body of a task's result file, which holds the computed results.
///
/// # Errors
/// The [`Fault`] of a missing or invalid result. It is not a [`base::Error`], because missing results are expected.
pub fn read(list: &List, task: &Task) -> std::result::Result<Vec<u8>, Fault> {
    read_file(&list.result_path(task), task, &list.head().program)
}

fn read_file(path: &Path, task: &Task, program: &str) -> std::result::Result<Vec<u8>, Fault> {
    let Some(mut bytes) = read_if_there(path, Content::Table) else {
        return Err(if path.symlink_metadata().is_ok() { Fault::Truncated } else { Fault::Absent });
    };
    let Some(end) = bytes.iter().position(|byte| *byte == b'\n') else { return Err(Fault::Truncated) };
    let head: Head = match serde_json::from_slice(&bytes[..end]) {
        Ok(head) => head,
        Err(_) => return Err(Fault::Damaged),
    };
    if head.schema != SCHEMA || head.program != program {
        return Err(Fault::OtherProgram);
    }
    if head.id != task.id || head.input_sha256 != task.input_sha256() {
        return Err(Fault::OtherTask);
    }
    let body = bytes.split_off(end + 1);
    if body.len() < head.body_bytes {
        return Err(Fault::Truncated);
    }
    if body.len() > head.body_bytes || sha256_hex(&body) != head.body_sha256 {
        return Err(Fault::Damaged);
    }
    Ok(body)
}
