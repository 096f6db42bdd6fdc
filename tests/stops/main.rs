//! Files after a command is stopped or killed, and its continuation.

mod interrupts;
#[path = "../program/mod.rs"]
mod program;
mod resume;
mod study_survives_kill;
