//! Command-line program: parses arguments, runs a command, and returns its exit code.
#![deny(clippy::print_stderr, clippy::print_stdout)]

mod calibration_words;
mod challenge;
mod challenge_words;
mod check;
mod child;
mod cohort;
mod compare;
mod corner;
mod corner_data;
mod design;
mod diagnose;
mod effects;
mod extend;
mod fit;
mod gather;
mod groups;
mod guard;
mod http;
mod init;
mod interrupt;
mod joint;
mod ladder;
mod laws;
mod learn;
mod options;
mod output;
mod plan;
mod predict;
mod questions;
mod report;
mod sample;
mod serve;
mod session;
mod settings;
mod shapes;
mod shapes_words;
mod shell;
mod simulate;
mod sweep;
mod tasks;
mod terminal;
mod text;
mod workbench;

use std::path::{Component, Path};
use std::process::ExitCode;

use clap::parser::ValueSource;
use clap::{ArgMatches, CommandFactory, Parser, Subcommand};

use options::{
    CompareArguments, CornerArguments, DiagnoseArguments, ExtendArguments, LadderArguments, LearnArguments,
    ModelArguments, SampleArguments, SimulateArguments,
};
use vitreo_uq::Error;
use vitreo_uq::base::error::{InputPlace, rename_settings};
use vitreo_uq::base::files::forbid_links_in_user_folder;
use vitreo_uq::jobs::tasks::commands::{CommandLine, OUT};

/// Options that name the output of a command.
const OUTPUT_OPTIONS: [&str; 3] = ["cache", "json", "out"];

/// Bayesian uncertainty quantification for creep experiments in soft gels.
#[derive(Parser)]
#[command(name = "vitreo-uq", version, about, propagate_version = true)]
struct Program {
    /// Command to run
    #[command(subcommand)]
    command: Command,
}

/// Command of the program, with its arguments.
#[derive(Subcommand)]
enum Command {
    /// Convert a table of numbers in any layout to an experiment
    Init(Box<init::InitArguments>),
    /// Show how a record was read, draw it, and list contradictions with its description
    Check(check::CheckArguments),
    /// Estimate the posterior from a measurement, and check it with full finite elements
    Sample(SampleArguments),
    /// Compute the paper's point estimate by nonlinear least squares, with standard errors
    Fit(ModelArguments),
    /// Run full finite elements: a trajectory in the experiment's format, and fields for ParaView
    Simulate(SimulateArguments),
    /// Draw a corner plot of one or several posteriors
    Corner(CornerArguments),
    /// List the physical effects of the library, and their detectability in this experiment
    Effects(ModelArguments),
    /// Test the residuals for misfits: where does the model fail?
    Compare(CompareArguments),
    /// Find missing physical effects: refit every candidate effect and test it on the last held-out cycle, for one record or a cohort
    Diagnose(DiagnoseArguments),
    /// Learn a correction of the law from data: which quantity depends on which state, and its formula
    Learn(LearnArguments),
    /// Add an effect to a study: create the next revision, and compare the errors before and after
    Extend(ExtendArguments),
    /// Compare all revisions of a study on the same cycles, and show how the error falls
    Ladder(LadderArguments),
    /// Predict robots in this gel: positions with bands, quantities of interest with probabilities, and what the uncertainty comes from
    Predict(predict::PredictArguments),
    /// Plan the force that brings a robot to a target with a given probability
    Plan(plan::PlanArguments),
    /// Design the protocol of the next record: one that tells equivalent effects apart, or makes the parameters better known
    Design(design::DesignArguments),
    /// Write a study as one self-contained HTML page
    Report(report::ReportArguments),
    /// Start a local web page: drop a table on it, see where the model fails, add missing effects, watch the error fall
    Workbench(workbench::WorkbenchArguments),
    /// Serve the trajectory and posterior to other programs (PyMC, emcee, …) by the UM-Bridge protocol
    Serve(serve::ServeArguments),
    /// Make data with a sealed hidden effect, open the seal, or play many such challenges
    Challenge(challenge::ChallengeArguments),
    /// Compare species or regions: how groups of specimens differ, with uncertainty
    Groups(groups::GroupsArguments),
    /// List independent commands for many machines, and run them here, by HyperQueue or by Slurm
    Tasks(tasks::TasksArguments),
    /// Join the results of a list of tasks, byte for byte as on one machine, and name missing ones
    Gather(gather::GatherArguments),
    /// Repeat the paper's study of robot shapes with posterior uncertainty
    Shapes(shapes::ShapesArguments),
    /// Print the shell completions of this program
    Completions(shell::CompletionsArguments),
    /// Write manual pages of the program and of every command
    Man(shell::ManArguments),
}

fn main() -> ExitCode {
    rename_settings("command line", settings::option);
    // A command that a workbench starts follows no symbolic links in the workbench's folder.
    if let Some(folder) = std::env::var_os(workbench::FOLDER_VARIABLE) {
        forbid_links_in_user_folder(Path::new(&folder), "a workbench's folder");
    }
    let program = Program::parse();
    let how_to_go_on = resume_advice(&program.command);
    interrupt::watch(how_to_go_on);
    let outcome = match &program.command {
        Command::Init(arguments) => init::run(arguments),
        Command::Check(arguments) => check::run(arguments),
        Command::Sample(arguments) => sample::run(arguments),
        Command::Fit(arguments) => fit::run(arguments),
        Command::Simulate(arguments) => simulate::run(arguments),
        Command::Corner(arguments) => corner::run(arguments),
        Command::Effects(arguments) => effects::run(arguments),
        Command::Compare(arguments) => compare::run(arguments),
        Command::Diagnose(arguments) => diagnose::run(arguments),
        Command::Learn(arguments) => learn::run(arguments),
        Command::Extend(arguments) => extend::run(arguments),
        Command::Ladder(arguments) => ladder::run(arguments),
        Command::Predict(arguments) => predict::run(arguments),
        Command::Plan(arguments) => plan::run(arguments),
        Command::Design(arguments) => design::run(arguments),
        Command::Report(arguments) => report::run(arguments),
        Command::Workbench(arguments) => workbench::run(arguments),
        Command::Serve(arguments) => serve::run(arguments),
        Command::Groups(arguments) => groups::run(arguments),
        Command::Tasks(arguments) => tasks::run(arguments, check_task_command),
        Command::Gather(arguments) => gather::run(arguments),
        Command::Shapes(arguments) => shapes::run(arguments),
        Command::Challenge(arguments) => challenge::run(arguments),
        Command::Completions(arguments) => shell::completions(arguments, Program::command()),
        Command::Man(arguments) => shell::man(arguments, Program::command()),
    };
    match outcome {
        Ok(code) if !interrupt::is_signalled() => code,
        // Work without signal checks may end just after a signal arrives. The exit code then still reports the signal.
        Ok(_) | Err(Error::Interrupted { .. }) => {
            interrupt::block_while_ending();
            interrupt::print_message(&interrupt::stop_message(how_to_go_on));
            ExitCode::from(interrupt::exit_code())
        }
        Err(error) => {
            interrupt::block_while_ending();
            interrupt::print_message(&format!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

/// Refuses a line of a list that is not a command of this program, or whose command never ends.
fn check_task_command(file: &Path, line: &CommandLine) -> vitreo_uq::Result<()> {
    let refuse =
        |found: String, remedy: &str| Err(Error::input(InputPlace::file(file).at_line(line.number), found, remedy));
    let words = || ["vitreo-uq"].into_iter().chain(line.words.iter().map(String::as_str));
    let astray =
        Program::command().try_get_matches_from(words()).ok().and_then(|found| find_output_outside_task(&found));
    match Program::try_parse_from(words()).map(|program| program.command) {
        Ok(Command::Tasks(_) | Command::Gather(_)) => {
            refuse("a list cannot contain lists".into(), "replace this line by the commands of the other list")
        }
        Ok(Command::Serve(_) | Command::Workbench(_)) => {
            refuse("this command does not end by itself".into(), "remove the line")
        }
        Ok(_) => match astray {
            Some(path) => refuse(
                format!("`{path}` is not below `{OUT}`, the only place that a task may write to"),
                "write every result of the command below `{out}`, without `..`",
            ),
            None => Ok(()),
        },
        Err(error) => {
            let text = error.to_string();
            let first = text.lines().next().unwrap_or_default();
            let found = first.strip_prefix("error: ").unwrap_or(first).to_string();
            refuse(found, "write a command that `vitreo-uq --help` lists")
        }
    }
}

/// First output path of a command line that is not below the task's directory.
fn find_output_outside_task(found: &ArgMatches) -> Option<String> {
    if let Some((_, inner)) = found.subcommand() {
        return find_output_outside_task(inner);
    }
    let given =
        |id: &&str| found.try_contains_id(id).is_ok() && found.value_source(id) == Some(ValueSource::CommandLine);
    let values = OUTPUT_OPTIONS.into_iter().filter(given).filter_map(|id| found.get_raw(id)).flatten();
    let is_below =
        |path: &Path| path.starts_with(OUT) && path.components().all(|part| matches!(part, Component::Normal(_)));
    let mut astray = values.filter(|value| *value != "-" && !is_below(Path::new(value)));
    astray.next().map(|value| value.to_string_lossy().into_owned())
}

/// Advice after a signal has stopped the command.
fn resume_advice(command: &Command) -> &'static str {
    match command {
        Command::Sample(arguments) if arguments.others.is_empty() => {
            "run the same command with `--resume`, which continues from the sampler's last saved state, if there is one"
        }
        Command::Serve(_) => "run the same command again: clients find the same models",
        Command::Workbench(_) => "run the same command again: finished results are on disk",
        Command::Groups(_) => "run the same command again: finished experiments are not sampled again",
        Command::Tasks(_) => "run the same command again: finished tasks are not run again",
        Command::Challenge(_) => "run the same command again: trajectories in the cache are not computed again",
        _ => "run the same command again",
    }
}
