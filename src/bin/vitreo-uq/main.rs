//! The program: arguments in, exit code out.

mod options;
mod output;
mod sample;
mod target;
mod terminal;
mod text;

use std::process::ExitCode;

use clap::Parser;

use options::{Command, Program};

fn main() -> ExitCode {
    let program = Program::parse();
    let outcome = match &program.command {
        Command::Sample(arguments) => sample::run(arguments),
    };
    match outcome {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
