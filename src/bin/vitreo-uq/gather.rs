//! `gather`: joins the results of a list of tasks.

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

use crate::calibration_words::format_calibration;
use crate::challenge_words::format_plays;
use crate::options::use_threads;
use crate::terminal::Terminal;

/// Arguments of `gather`.
#[derive(Args)]
pub struct GatherArguments {
    /// Directory that `tasks KIND --out DIR` created
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Directory for the joined results [default: DIR/gathered]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the found and missing results as one JSON document to a file, or with `-` to standard output in place of the text
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Number of threads; 0 for as many as there are cores
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Do not show progress on standard error
    #[arg(long)]
    quiet: bool,
}

/// Maximum number of missing results that are printed. The JSON document contains all of them.
const MAX_PRINTED_MISSING: usize = 20;

pub fn run(arguments: &GatherArguments) -> Result<ExitCode> {
    use_threads(arguments.threads)?;
    crate::output::check(arguments.json.as_deref())?;
    let list = List::open(&arguments.dir)?.check_program(vitreo_uq::PROGRAM)?;
    let out = arguments.out.clone().unwrap_or_else(|| arguments.dir.join("gathered"));
    let terminal = Terminal::new(arguments.quiet);
    let outcome = gather::gather(&list, &out, &terminal)?;
    terminal.finish();
    let gathered = &outcome.gathered;
    let mut words = outcome.plays.as_ref().map_or_else(String::new, |plays| format_plays(&plays.tally));
    words += &outcome.calibration.as_ref().map_or_else(String::new, format_calibration);
    words += &words_of_results(gathered, &out);
    if let (Some(now), Some(cache)) = (outcome.n_adopted, cache_directory()) {
        let before = gathered.results - now;
        let _ = writeln!(words, "{now} models were added to {}; {before} were already there.", cache.display());
    }
    let provenance = Provenance::new("gathered", 1, list.seed(), BTreeMap::new());
    crate::output::show(arguments.json.as_deref(), &WithProvenance { provenance, body: gathered }, &words)?;
    let is_sound = outcome.calibration.is_none_or(|found| found.verdict.kind != CalibrationKind::Miscalibrated);
    Ok(ExitCode::from(u8::from(!(gathered.is_whole() && is_sound))))
}

fn words_of_results(gathered: &Gathered, out: &Path) -> String {
    let Gathered { kind, tasks, results, missing, foreign, .. } = gathered;
    let mut text = format!("{results} of {tasks} results exist.\n");
    for missing_result in missing.iter().take(MAX_PRINTED_MISSING) {
        let _ = writeln!(
            text,
            "Task {} has no result: {} is {}.",
            missing_result.task,
            missing_result.file,
            missing_result.fault.words()
        );
    }
    if missing.len() > MAX_PRINTED_MISSING {
        let _ = writeln!(text, "… and {} more.", missing.len() - MAX_PRINTED_MISSING);
    }
    match foreign.as_slice() {
        [] => {}
        [first, others @ ..] => {
            let more = if others.is_empty() { String::new() } else { format!(" and {} more", others.len()) };
            let _ = writeln!(text, "Ignored, because it belongs to another list: {first}{more}.");
        }
    }
    let _ = match kind {
        TaskKind::Challenge if *results > 0 => writeln!(text, "Joined:  {}", out.join(CHALLENGE).display()),
        TaskKind::Calibration if *results > 0 => writeln!(text, "Joined:  {}", out.join(CALIBRATION).display()),
        TaskKind::Commands if *results > 0 => {
            writeln!(text, "Joined:  {}, with a folder of files for each command", out.join(COMMANDS).display())
        }
        TaskKind::Sample if *results > 0 => {
            writeln!(text, "Joined for:  vitreo-uq groups … --out {}   (with the options of the list)", out.display())
        }
        _ => Ok(()),
    };
    if !missing.is_empty() {
        text += "To compute the missing results, run `vitreo-uq tasks run` again, or submit its script to the cluster again.\n";
    }
    text
}
