//! `gather`: the results of a list of tasks joined.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use vitreo_uq::base::error::Result;
use vitreo_uq::documents::calibration::CalibrationKind;
use vitreo_uq::documents::tasks::{Gathered, TaskKind};
use vitreo_uq::jobs::tasks::gather::{self, CALIBRATION, CHALLENGE, COMMANDS};
use vitreo_uq::jobs::tasks::list::List;
use vitreo_uq::posterior::cache::cache_directory;
use vitreo_uq::posterior::study::{Provenance, WithProvenance};

use crate::calibration_words::words_of_calibration;
use crate::challenge_words::words_of_plays;
use crate::options::use_threads;
use crate::terminal::Terminal;

/// Arguments of `gather`.
#[derive(Args)]
pub struct GatherArguments {
    /// Directory that `tasks KIND --out DIR` made
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Where what was gathered goes [default: DIR/gathered]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write what was there and what is missing as one JSON document to a file, or alone to standard output with `-`
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Threads; 0 for as many as there are cores
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// No progress on standard error
    #[arg(long)]
    quiet: bool,
}

/// Missing results that are named; the document has all.
const MOST_NAMED: usize = 20;

pub fn run(arguments: &GatherArguments) -> Result<ExitCode> {
    use_threads(arguments.threads)?;
    crate::output::check(arguments.json.as_deref())?;
    let list = List::open(&arguments.dir)?.of_program(vitreo_uq::PROGRAM)?;
    let out = arguments.out.clone().unwrap_or_else(|| arguments.dir.join("gathered"));
    let terminal = Terminal::new(arguments.quiet);
    let outcome = gather::gather(&list, &out, &terminal)?;
    terminal.finish();
    let gathered = &outcome.gathered;
    let mut words = outcome.plays.as_ref().map_or_else(String::new, |plays| words_of_plays(&plays.tally));
    words += &outcome.calibration.as_ref().map_or_else(String::new, words_of_calibration);
    words += &words_of_results(gathered, &out);
    if let (Some(now), Some(cache)) = (outcome.n_adopted, cache_directory()) {
        let before = gathered.results - now;
        let _ = writeln!(words, "{now} models were put into {}; {before} were there.", cache.display());
    }
    let provenance = Provenance::new("gathered", 1, list.seed(), BTreeMap::new());
    crate::output::show(arguments.json.as_deref(), &WithProvenance { provenance, body: gathered }, &words)?;
    let is_sound = outcome.calibration.is_none_or(|found| found.verdict.kind != CalibrationKind::Miscalibrated);
    Ok(ExitCode::from(u8::from(!(gathered.is_whole() && is_sound))))
}

fn words_of_results(gathered: &Gathered, out: &Path) -> String {
    let Gathered { kind, tasks, results, missing, foreign, .. } = gathered;
    let mut text = format!("{results} of {tasks} results are there.\n");
    for own in missing.iter().take(MOST_NAMED) {
        let _ = writeln!(text, "Task {} is missing: {} is {}.", own.task, own.file, own.fault.words());
    }
    if missing.len() > MOST_NAMED {
        let _ = writeln!(text, "… and {} more.", missing.len() - MOST_NAMED);
    }
    match foreign.as_slice() {
        [] => {}
        [first, others @ ..] => {
            let more = if others.is_empty() { String::new() } else { format!(" and {} more", others.len()) };
            let _ = writeln!(text, "Not of this list, and left alone: {first}{more}.");
        }
    }
    let _ = match kind {
        TaskKind::Challenge if *results > 0 => writeln!(text, "Joined:  {}", out.join(CHALLENGE).display()),
        TaskKind::Calibration if *results > 0 => writeln!(text, "Joined:  {}", out.join(CALIBRATION).display()),
        TaskKind::Commands if *results > 0 => {
            writeln!(text, "Joined:  {}, and the files of each in a folder beside it", out.join(COMMANDS).display())
        }
        TaskKind::Sample if *results > 0 => {
            writeln!(text, "Joined for:  vitreo-uq groups … --out {}   (with the options of the list)", out.display())
        }
        _ => Ok(()),
    };
    if !missing.is_empty() {
        text += "What is missing is run by the same command as before: vitreo-uq tasks run, or the script for the engine.\n";
    }
    text
}
