//! Work for many machines: a list of independent tasks, their results by content, and the join that gives what one machine gives.
//!
//! ```text
//! DIR/
//!   tasks.json     the list's head: kind, program, hash of the lines
//!   tasks.jsonl    one task a line: id, command, result, arguments
//!   results/       one file a task, named after its id, written whole or not at all
//!   gathered/      what `gather` made of them
//! ```
//! A task's id is the hash of what it computes: input by content, arguments, and the program by its sources. So a result is known to be of this task, this input
//! and this program, wherever and however often it was computed; what is not is named and computed again. Tasks may be killed, run twice, and run in any order.

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
