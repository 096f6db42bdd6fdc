//! The program: arguments in, exit code out.
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
mod learn;
mod options;
mod output;
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
    CompareArguments, CornerArguments, DiagnoseArguments, EffectsArguments, ExtendArguments, FitArguments,
    LadderArguments, LearnArguments, SampleArguments, SimulateArguments,
};
use vitreo_uq::Error;
use vitreo_uq::base::error::{Place, rename_settings};
use vitreo_uq::base::files::enclose_folder;
use vitreo_uq::jobs::tasks::commands::{Line, OUT};

/// Options that name what a command writes.
const WRITTEN: [&str; 3] = ["cache", "json", "out"];

/// Bayesian uncertainty quantification for creep experiments in soft gels.
#[derive(Parser)]
#[command(name = "vitreo-uq", version, about, propagate_version = true)]
struct Program {
    /// What to do.
    #[command(subcommand)]
    command: Command,
}

/// One variant a command.
#[derive(Subcommand)]
enum Command {
    /// From a table of numbers, however it is written, to an experiment
    Init(Box<init::InitArguments>),
    /// What was understood of a record, the record drawn, and what contradicts its description
    Check(check::CheckArguments),
    /// From a measurement to a posterior that full finite elements have checked
    Sample(SampleArguments),
    /// The paper's point estimate by nonlinear least squares, with standard errors
    Fit(FitArguments),
    /// A full finite-element run: trajectory in the experiment's format, fields for ParaView
    Simulate(SimulateArguments),
    /// Corner plot of one or several posteriors
    Corner(CornerArguments),
    /// The library of physical effects, and what this experiment can see of each
    Effects(EffectsArguments),
    /// Model against measurement: where it fails
    Compare(CompareArguments),
    /// Which physical effect is missing: every effect refitted, the claim judged on a cycle that no fit has seen; of several records, what they lack together
    Diagnose(DiagnoseArguments),
    /// The law that nobody wrote down: which quantity depends on which state, as the data have it, and the formula for it
    Learn(LearnArguments),
    /// The next revision of a study: an effect added, refitted, with the error before and after
    Extend(ExtendArguments),
    /// All revisions of a study on the same footing: how the error fell
    Ladder(LadderArguments),
    /// A study as one page for a browser: offline, in one file
    Report(report::ReportArguments),
    /// A local page: drop a table on it, see where the model fails, add what is missing, watch the error fall
    Workbench(workbench::WorkbenchArguments),
    /// Trajectory and posterior for other programs (PyMC, emcee, …), by the protocol of UM-Bridge
    Serve(serve::ServeArguments),
    /// Data with a sealed hidden effect: make some, open the seal, play many
    Challenge(challenge::ChallengeArguments),
    /// Species or regions compared: how groups of specimens differ, and how sure that is
    Groups(groups::GroupsArguments),
    /// Independent commands for many machines: written as a list, run here, by HyperQueue or by Slurm
    Tasks(tasks::TasksArguments),
    /// The results of a list of tasks joined: the same bytes as on one machine, and what is missing by name
    Gather(gather::GatherArguments),
    /// The paper's study of robot shapes, with posterior uncertainty: which claims hold, and the longest robot that still moves far enough
    Shapes(shapes::ShapesArguments),
    /// What a shell completes of this program, on standard output
    Completions(shell::CompletionsArguments),
    /// Manual pages of the program and of every command
    Man(shell::ManArguments),
}

fn main() -> ExitCode {
    rename_settings("command line", settings::option);
    // What a workbench starts keeps to the workbench's rule for its folder.
    if let Some(folder) = std::env::var_os(workbench::FOLDER_VARIABLE) {
        enclose_folder(Path::new(&folder), "a workbench's folder");
    }
    let program = Program::parse();
    let how_to_go_on = how_to_go_on(&program.command);
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
        Command::Report(arguments) => report::run(arguments),
        Command::Workbench(arguments) => workbench::run(arguments),
        Command::Serve(arguments) => serve::run(arguments),
        Command::Groups(arguments) => groups::run(arguments),
        Command::Tasks(arguments) => tasks::run(arguments, refuse_as_task),
        Command::Gather(arguments) => gather::run(arguments),
        Command::Shapes(arguments) => shapes::run(arguments),
        Command::Challenge(arguments) => challenge::run(arguments),
        Command::Completions(arguments) => shell::completions(arguments, Program::command()),
        Command::Man(arguments) => shell::man(arguments, Program::command()),
    };
    match outcome {
        Ok(code) if !interrupt::has_come() => code,
        // Work that hears no signal may come to its end in the moment that it is given: who sent the signal has to know that it came.
        Ok(_) | Err(Error::Interrupted { .. }) => {
            interrupt::wait_for_an_end_under_way();
            interrupt::say(&interrupt::last_word(how_to_go_on));
            ExitCode::from(interrupt::exit_code())
        }
        Err(error) => {
            interrupt::wait_for_an_end_under_way();
            interrupt::say(&format!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

/// Refuses a line of a list that is no command of this program, or none that ends by itself.
fn refuse_as_task(file: &Path, line: &Line) -> vitreo_uq::Result<()> {
    let refuse = |found: String, remedy: &str| Err(Error::input(Place::file(file).at_line(line.number), found, remedy));
    let words = || ["vitreo-uq"].into_iter().chain(line.words.iter().map(String::as_str));
    let astray = Program::command().try_get_matches_from(words()).ok().and_then(|found| written_astray(&found));
    match Program::try_parse_from(words()).map(|program| program.command) {
        Ok(Command::Tasks(_) | Command::Gather(_)) => refuse("a list of lists".into(), "write the commands themselves"),
        Ok(Command::Serve(_) | Command::Workbench(_)) => {
            refuse("this command does not end by itself".into(), "leave it out")
        }
        Ok(_) => match astray {
            Some(path) => refuse(
                format!("`{path}` is not below `{OUT}`, and a task writes nowhere else"),
                "let every result of the command go below `{out}`, without `..`",
            ),
            None => Ok(()),
        },
        Err(error) => {
            let text = error.to_string();
            let first = text.lines().next().unwrap_or_default();
            let found = first.strip_prefix("error: ").unwrap_or(first).to_string();
            refuse(found, "write a command of this program, as `vitreo-uq --help` lists them")
        }
    }
}

/// A place that options tell a command to write to, and that is not below the directory of its task.
fn written_astray(found: &ArgMatches) -> Option<String> {
    if let Some((_, inner)) = found.subcommand() {
        return written_astray(inner);
    }
    let given =
        |id: &&str| found.try_contains_id(id).is_ok() && found.value_source(id) == Some(ValueSource::CommandLine);
    let values = WRITTEN.into_iter().filter(given).filter_map(|id| found.get_raw(id)).flatten();
    let is_below =
        |path: &Path| path.starts_with(OUT) && path.components().all(|part| matches!(part, Component::Normal(_)));
    let mut astray = values.filter(|value| *value != "-" && !is_below(Path::new(value)));
    astray.next().map(|value| value.to_string_lossy().into_owned())
}

/// What a stopped command leaves to do.
fn how_to_go_on(command: &Command) -> &'static str {
    match command {
        Command::Sample(_) => {
            "run the same command with `--resume`, which goes on from the sampler's last saved state, if there is one"
        }
        Command::Serve(_) => "run the same command again: clients find the models as they were",
        Command::Workbench(_) => "run the same command again: what was finished is on disk",
        Command::Groups(_) => "run the same command again: experiments that were sampled are not sampled again",
        Command::Tasks(_) => "run the same command again: tasks whose results are there are not run again",
        Command::Challenge(_) => "run the same command again: trajectories in the cache are not computed again",
        _ => "run the same command again",
    }
}
