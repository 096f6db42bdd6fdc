//! The program: arguments in, exit code out.

mod challenge;
mod challenge_words;
mod compare;
mod corner;
mod corner_data;
mod diagnose;
mod effects;
mod examine;
mod extend;
mod fit;
mod groups;
mod ladder;
mod options;
mod output;
mod sample;
mod shapes;
mod shapes_words;
mod simulate;
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
        Command::Fit(arguments) => fit::run(arguments),
        Command::Simulate(arguments) => simulate::run(arguments),
        Command::Corner(arguments) => corner::run(arguments),
        Command::Effects(arguments) => effects::run(arguments),
        Command::Compare(arguments) => compare::run(arguments),
        Command::Diagnose(arguments) => diagnose::run(arguments),
        Command::Extend(arguments) => extend::run(arguments),
        Command::Ladder(arguments) => ladder::run(arguments),
        Command::Groups(arguments) => groups::run(arguments),
        Command::Shapes(arguments) => shapes::run(arguments),
        Command::Challenge(arguments) => challenge::run(arguments),
    };
    match outcome {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
