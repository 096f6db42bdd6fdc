//! Work for many machines: a list of independent tasks, their results, and the join that yields the files of a single machine.
//!
//! ```text
//! DIR/
//!   tasks.json     the list's head: kind, program, hash of the lines
//!   tasks.jsonl    one task per line: id, command, result, arguments
//!   results/       one file per task, named after its id, written whole or not at all
//!   gathered/      joined results, written by `gather`
//! ```
//! A task's id is the hash of its inputs' content, its arguments and the program's sources. A result therefore identifies its task, input and program,
//! independent of machine and attempt. Results that do not match are listed and computed again. Tasks may be killed, run twice, and run in any order.

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
