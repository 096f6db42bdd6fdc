//! Distributes work over many machines: makes a list of independent tasks, runs them, and joins their results into the files that a single machine would
//! write.
//!
//! ```text
//! DIR/
//!   tasks.json     head of the list: kind, program, hash of the lines
//!   tasks.jsonl    one task per line: id, command, result, arguments
//!   results/       one file per task, named after its id, written completely or not at all
//!   gathered/      joined results, written by `gather`
//! ```
//! A task's id is the hash of its inputs' content, its arguments and the program's sources. A result file therefore identifies its task, its input and the
//! program. Its content does not depend on the machine or the number of attempts. Results that do not match their task are listed and computed again.
//! Tasks may be killed, run twice, and run in any order.

pub mod calibration;
pub mod challenge;
pub mod commands;
pub mod gather;
pub mod list;
pub mod local;
pub mod models;
pub mod result;
pub mod sample;
pub mod submit;
pub mod worker;
