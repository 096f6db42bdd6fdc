//! `tasks`: lists independent commands for many machines, and runs them.

use std::fmt::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use clap::{Args, Subcommand, ValueEnum};
use vitreo_uq::base::error::{Error, InputPlace, Result, Setting};
use vitreo_uq::cohorts::cohort;
use vitreo_uq::documents::tasks::TaskKind;
use vitreo_uq::jobs::tasks::commands::CommandLine;
use vitreo_uq::jobs::tasks::list::{List, ListOutcome, TaskInput, absolute};
use vitreo_uq::jobs::tasks::submit::{self, Engine, Resources};
use vitreo_uq::jobs::tasks::worker::{TaskOutcome, Worker, serve};
use vitreo_uq::jobs::tasks::{calibration, challenge, commands, gather, local, models, sample};
use vitreo_uq::posterior::monitor::{Monitor, StoppableMonitor};

use crate::challenge::PlaysArguments;
use crate::child;
use crate::child::in_shell;
use crate::groups::{CohortArguments, ModelArguments, SamplingArguments};
use crate::options::use_threads;
use crate::terminal::Terminal;

/// Arguments of `tasks`.
#[derive(Args)]
pub struct TasksArguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// List tasks that sample every experiment of a cohort on its own, as `groups` does before its comparison
    Sample(SampleTasks),
    /// List tasks that play the challenges of `challenge run`
    Challenge(ChallengeTasks),
    /// List tasks that test the calibration of posteriors: simulate records from the prior by full finite elements, sample each, and rank the true values
    Calibration(CalibrationTasks),
    /// List tasks that train the surrogates that experiments need, each once; `gather` adds them to the cache
    Models(ModelsTasks),
    /// List any commands of this program, one per line of a text file; files that they write below `{out}` are kept
    Commands(CommandsTasks),
    /// Run the unfinished tasks of a list, or write the script that hands them to an engine
    Run(RunTasks),
}

#[derive(Args)]
struct SampleTasks {
    #[command(flatten)]
    cohort: CohortArguments,
    #[command(flatten)]
    list: ListArguments,
}

#[derive(Args)]
struct ChallengeTasks {
    #[command(flatten)]
    plays: PlaysArguments,
    #[command(flatten)]
    list: ListArguments,
}

#[derive(Args)]
struct CalibrationTasks {
    /// Experiment, or study (the model of its last revision is used)
    #[arg(value_name = "EXPERIMENT|STUDY")]
    target: PathBuf,
    /// Number of simulated records
    #[arg(long, value_name = "N", default_value_t = 200)]
    count: usize,
    #[command(flatten)]
    sampling: SamplingArguments,
    #[command(flatten)]
    list: ListArguments,
}

#[derive(Args)]
struct ModelsTasks {
    /// Experiments, studies (the model of their last revision is used), or directories that contain them
    #[arg(value_name = "DIR", required = true)]
    paths: Vec<PathBuf>,
    /// Also list the models of every effect that changes the displacement field, which `diagnose` needs
    #[arg(long)]
    every_effect: bool,
    #[command(flatten)]
    model: ModelArguments,
    #[command(flatten)]
    list: PlaceArguments,
}

#[derive(Args)]
struct CommandsTasks {
    /// Text file with one command per line, split into words as in a shell; `{out}` is replaced by the command's own directory
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    list: PlaceArguments,
}

/// Options of task lists whose number of items per task the user can choose.
#[derive(Args)]
struct ListArguments {
    /// Number of experiments, challenges or simulated records per task
    #[arg(long, value_name = "N", default_value_t = 1)]
    block: usize,
    #[command(flatten)]
    place: PlaceArguments,
}

/// Options of every task list: its directory, replacement and output.
#[derive(Args)]
struct PlaceArguments {
    /// Directory of the list and its results; on a cluster, one that all machines can read
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace a list of other tasks; existing results are kept, and used for equal tasks
    #[arg(long)]
    force: bool,
    /// Write the list's head as one JSON document to a file, or with `-` to standard output in place of the text
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Do not show progress on standard error
    #[arg(long)]
    quiet: bool,
}

#[derive(Args)]
struct RunTasks {
    /// Directory that `tasks KIND --out DIR` created
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Run one task (by number, from 0) in this process
    #[arg(long, value_name = "N", conflicts_with_all = ["part", "engine", "jobs", "serve"])]
    task: Option<usize>,
    /// Run one part of the list, counted from 0: `3/100`
    #[arg(long, value_name = "I/N", conflicts_with = "serve")]
    part: Option<String>,
    /// Engine that starts the workers: local runs them immediately; for hq and slurm the command writes a script to submit
    #[arg(long, value_name = "ENGINE", value_enum, default_value = "local")]
    engine: EngineName,
    /// Engine local only: number of worker processes [default: as many as there are cores]
    #[arg(long, value_name = "J")]
    jobs: Option<usize>,
    /// Threads of each worker; 0 for as many as there are cores [default: 1, and 0 with `--task`]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Engines hq and slurm only: number of parts that the list is split into [default: one per task, at most 1000]
    #[arg(long, value_name = "N", conflicts_with = "part")]
    parts: Option<usize>,
    /// Engines hq and slurm only: cores of a part, each with its own worker
    #[arg(long, value_name = "N", default_value_t = 1)]
    cores: usize,
    /// Engines hq and slurm only: time limit of a part, in minutes
    #[arg(long, value_name = "MINUTES", default_value_t = 240)]
    minutes: u64,
    /// Engines hq and slurm only: memory of a part, in MiB
    #[arg(long, value_name = "MIB", default_value_t = 2_000)]
    memory_mib: u64,
    /// Run the tasks whose numbers arrive on standard input
    #[arg(long, hide = true)]
    serve: bool,
    /// Do not show progress on standard error
    #[arg(long)]
    quiet: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum EngineName {
    /// Run worker processes on this machine
    Local,
    /// Write a script for HyperQueue
    Hq,
    /// Write a script for Slurm's job arrays
    Slurm,
}

/// Maximum number of failed tasks that are printed. `gather --json` lists all.
const MAX_PRINTED_FAILURES: usize = 10;

/// Makes a list of tasks, or runs the tasks of a list. `refuse_line` returns an error for command lines that no task may run.
pub fn run(arguments: &TasksArguments, refuse_line: impl Fn(&Path, &CommandLine) -> Result<()>) -> Result<ExitCode> {
    match &arguments.action {
        Action::Sample(arguments) => {
            let terminal = begin(&arguments.list)?;
            let sampling = arguments.cohort.sampling();
            let work = sample::work(&arguments.cohort.read(&terminal)?, &sampling, arguments.list.block)?;
            make(&arguments.list.place, TaskKind::Sample, sampling.seed, work, &terminal)
        }
        Action::Challenge(arguments) => {
            let terminal = begin(&arguments.list)?;
            let request = arguments.plays.request()?;
            let work = challenge::work(&request, arguments.list.block)?;
            make(&arguments.list.place, TaskKind::Challenge, request.seed, work, &terminal)
        }
        Action::Calibration(arguments) => {
            let terminal = begin(&arguments.list)?;
            let sampling = arguments.sampling.sampling();
            let measurement = sample::read(&arguments.target, &sampling, &terminal)?;
            let work = calibration::work(&measurement, &sampling, arguments.count, arguments.list.block)?;
            make(&arguments.list.place, TaskKind::Calibration, sampling.seed, work, &terminal)
        }
        Action::Models(arguments) => {
            let terminal = begin_at(&arguments.list)?;
            let sampling = arguments.model.sampling();
            let measurements = cohort::read(
                &arguments.paths,
                &[],
                &|model_specification| sampling.model(model_specification),
                &terminal,
            )?;
            let (work, n_without) = models::work(&measurements, &sampling, arguments.every_effect, &terminal)?;
            if n_without > 0 {
                terminal.warn(&format!("{n_without} of {} experiments need no model", measurements.len()));
            }
            make(&arguments.list, TaskKind::Models, sampling.seed, work, &terminal)
        }
        Action::Commands(arguments) => {
            let terminal = begin_at(&arguments.list)?;
            let lines = commands::read(&arguments.file)?;
            lines.iter().try_for_each(|line| refuse_line(&arguments.file, line))?;
            make(&arguments.list, TaskKind::Commands, 0, commands::work(&lines)?, &terminal)
        }
        Action::Run(arguments) => run_tasks(arguments, &refuse_line),
    }
}

fn begin(arguments: &ListArguments) -> Result<Terminal> {
    if arguments.block == 0 {
        return Err(Error::input(
            InputPlace::default().at_key("--block"),
            "0 items per task",
            "give a positive number",
        ));
    }
    begin_at(&arguments.place)
}

fn begin_at(arguments: &PlaceArguments) -> Result<Terminal> {
    crate::output::check(arguments.json.as_deref())?;
    Ok(Terminal::new(arguments.quiet))
}

fn make(
    arguments: &PlaceArguments,
    kind: TaskKind,
    seed: u64,
    work: Vec<TaskInput>,
    terminal: &Terminal,
) -> Result<ExitCode> {
    let (list, making) = List::make(&arguments.out, kind, vitreo_uq::PROGRAM, seed, work, arguments.force)?;
    terminal.finish();
    let (n, dir) = (list.n_tasks(), in_shell(&arguments.out));
    let how = match making {
        ListOutcome::Made => "is in",
        ListOutcome::WasThere => "exists already in",
        ListOutcome::Replaced => "replaces another list in",
    };
    let words = format!(
        "A list of {n} tasks {how} {dir}.\n\
         Here:          vitreo-uq tasks run {dir}\n\
         On a cluster:  vitreo-uq tasks run {dir} --engine slurm   (or hq), and submit the script\n\
         Afterwards:    vitreo-uq gather {dir}\n"
    );
    crate::output::show(arguments.json.as_deref(), list.document(), &words)?;
    Ok(ExitCode::SUCCESS)
}

fn run_tasks(arguments: &RunTasks, refuse_line: &dyn Fn(&Path, &CommandLine) -> Result<()>) -> Result<ExitCode> {
    let list = List::open(&absolute(&arguments.dir)?)?.check_program(vitreo_uq::PROGRAM)?;
    // The list may come from another person, so its commands are checked again before they run.
    let file = list.dir().join("tasks.jsonl");
    let refuse_line = |line: &CommandLine| refuse_line(&file, line);
    match arguments.engine {
        EngineName::Hq => return submit(arguments, &list, Engine::HyperQueue),
        EngineName::Slurm => return submit(arguments, &list, Engine::Slurm),
        EngineName::Local => {}
    }
    if arguments.serve {
        enter_list_directory(&list)?;
        use_threads(arguments.threads.unwrap_or(1))?;
        let monitor = StoppableMonitor(Some(crate::interrupt::flag()));
        serve(&list, &refuse_line, std::io::stdin().lock(), std::io::stdout().lock(), &monitor)?;
        return Ok(ExitCode::SUCCESS);
    }
    let terminal = Terminal::new(arguments.quiet);
    if let Some(number) = arguments.task {
        enter_list_directory(&list)?;
        use_threads(arguments.threads.unwrap_or(0))?;
        let ran = Worker::new(&list, &refuse_line, &terminal).run(number)?;
        terminal.finish();
        let words = match ran {
            TaskOutcome::Now => format!("Task {number} is done.\n"),
            TaskOutcome::Before => format!("Task {number} already has its result.\n"),
        };
        crate::output::print(&words)?;
        return Ok(ExitCode::SUCCESS);
    }
    run_here(arguments, &list, &terminal)
}

/// Changes to the directory in which the list was made, because relative paths in its commands start there. Lists of challenges contain no paths.
fn enter_list_directory(list: &List) -> Result<()> {
    let directory = Path::new(&list.head().directory);
    if list.head().kind == TaskKind::Challenge {
        return Ok(());
    }
    std::env::set_current_dir(directory).map_err(|source| {
        Error::at_path(
            "go to",
            directory,
            source,
            "run the list on a machine that has this directory, or make the list again here with `--force`",
        )
    })
}

/// Runs the tasks of a list with worker processes on this machine.
fn run_here(arguments: &RunTasks, list: &List, terminal: &Terminal) -> Result<ExitCode> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = match arguments.jobs {
        Some(0) => {
            return Err(Error::input(InputPlace::default().at_key("--jobs"), "no workers", "give a positive number"));
        }
        jobs => jobs.unwrap_or(cores),
    };
    let range = part(arguments, list)?;
    use_threads(0)?;
    terminal.stage("looking for existing results");
    let n_asked_for = range.len();
    let missing = gather::missing(list, range, &StoppableMonitor(terminal.stop()))?;
    let n_before = n_asked_for - missing.len();
    let program = this_program()?;
    let threads = arguments.threads.unwrap_or(1).to_string();
    let words = child::words(
        &["tasks", "run"],
        &[("serve", None), ("quiet", None), ("threads", Some(threads))],
        &[child::absolute(list.dir())?],
    );
    let worker = || {
        let mut command = Command::new(&program);
        command.args(&words);
        // The workers get a process group of their own. Ctrl-C then reaches only this process, which ends them.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command
    };
    terminal.stage(&format!("running {} tasks in {} workers", missing.len(), jobs.min(missing.len())));
    let outcome = local::run(&missing, jobs, &worker, terminal)?;
    terminal.finish();
    crate::output::print(&summary(&outcome, n_before, list.dir()))?;
    Ok(ExitCode::from(u8::from(!(outcome.failed.is_empty() && outcome.left.is_empty()))))
}

/// Returns the range of tasks in the part that the user requests; all tasks by default.
fn part(arguments: &RunTasks, list: &List) -> Result<Range<usize>> {
    let Some(text) = &arguments.part else { return Ok(0..list.n_tasks()) };
    let numbers = text.split_once('/').and_then(|(part, parts)| Some((part.parse().ok()?, parts.parse().ok()?)));
    match numbers {
        Some((part, parts)) if parts <= 1_000_000 => submit::tasks_of_part(list.n_tasks(), part, parts),
        _ => {
            let remedy = "give the part's number, from 0, and the number of parts: `3/100`";
            Err(Error::input(InputPlace::setting(Setting::Part), format!("`{text}`"), remedy))
        }
    }
}

fn this_program() -> Result<PathBuf> {
    std::env::current_exe()
        .map_err(|source| Error::at_path("find", "the program itself", source, "run the program by its absolute path"))
}

fn summary(outcome: &local::LocalOutcome, n_before: usize, dir: &Path) -> String {
    let n = |count: usize| if count == 1 { "1 task".to_string() } else { format!("{count} tasks") };
    let mut text = format!("{} finished; {} had results before.\n", n(outcome.done), n(n_before + outcome.before));
    if outcome.worker_deaths > 0 {
        let _ = writeln!(text, "Workers died {} times; their tasks were repeated.", outcome.worker_deaths);
    }
    for (task, why) in outcome.failed.iter().take(MAX_PRINTED_FAILURES) {
        let _ = writeln!(text, "Task {task} failed: {why}");
    }
    if outcome.failed.len() > MAX_PRINTED_FAILURES {
        let _ = writeln!(text, "… and {} more.", outcome.failed.len() - MAX_PRINTED_FAILURES);
    }
    if let Some(first) = outcome.left.first() {
        let _ = writeln!(
            text,
            "{} (from {first} on) were not finished, because too many tasks failed in a row. Last failure: {}",
            n(outcome.left.len()),
            outcome.last_failure.as_deref().unwrap_or("no reason was given")
        );
    }
    let next = if outcome.failed.is_empty() && outcome.left.is_empty() {
        format!("Next:  vitreo-uq gather {}\n", in_shell(dir))
    } else {
        "Repair the failures and run the same command again: it runs only unfinished tasks.\n".into()
    };
    text + &next
}

/// Writes the script by which an engine (HyperQueue or Slurm) runs the tasks.
fn submit(arguments: &RunTasks, list: &List, engine: Engine) -> Result<ExitCode> {
    if let Some(option) = [("--part", arguments.part.is_some()), ("--jobs", arguments.jobs.is_some())]
        .iter()
        .find_map(|(option, is_given)| is_given.then_some(*option))
    {
        return Err(Error::input(
            InputPlace::default().at_key(option),
            "this option is only for workers on this machine",
            "omit it; `--parts` and `--cores` set how an engine divides the list",
        ));
    }
    let RunTasks { cores, minutes, memory_mib, .. } = *arguments;
    let parts = submit::n_parts(list.n_tasks(), arguments.parts)?;
    let resources = Resources { cores, minutes, memory_mib };
    let path = submit::write(list, &this_program()?, engine, resources, parts)?;
    let how = match engine {
        Engine::HyperQueue => in_shell(&path),
        Engine::Slurm => format!("sbatch {}", in_shell(&path)),
    };
    crate::output::print(&format!(
        "{parts} parts of {} tasks, each with {cores} cores, {memory_mib} MiB and at most {minutes} minutes.\n\
         Submit:      {how}\nAfterwards:  vitreo-uq gather {}\n",
        list.n_tasks(),
        in_shell(list.dir())
    ))?;
    Ok(ExitCode::SUCCESS)
}
