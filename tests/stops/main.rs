//! What is left when a command is stopped or killed, and how it goes on.

mod interrupts;
#[path = "../program/mod.rs"]
mod program;
mod resume;
mod study_survives_kill;
