//! Writes a list of challenges with a valid result for each, repeated from a few plays, to measure the cost of gathering.
//!
//! `cargo run --release --example many_results -- DIR COUNT PLAYS.json`; `challenge run --json PLAYS.json` writes the plays.

use std::path::PathBuf;

use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files::{Content, file_error, read};
use vitreo_uq::documents::tasks::TaskKind;
use vitreo_uq::jobs::tasks::list::List;
use vitreo_uq::jobs::tasks::{challenge, result};
use vitreo_uq::posterior::study::WithProvenance;
use vitreo_uq::validation::challenge::play::Play;
use vitreo_uq::validation::challenge::plays::{Plays, PlaysRequest};

fn main() -> Result<()> {
    let usage = || Error::input(InputPlace::default(), "wrong arguments", "give DIR COUNT PLAYS.json");
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [dir, count, plays] = arguments.as_slice() else { return Err(usage()) };
    let (dir, plays) = (PathBuf::from(dir), PathBuf::from(plays));
    let count: usize = count.parse().map_err(|_| usage())?;
    let bytes = read(&plays, Content::Document, "give the file of `challenge run --json`")?;
    let played: WithProvenance<Plays> = serde_json::from_slice(&bytes).map_err(|error| {
        Error::input(InputPlace::file(&plays).at_line(error.line()), error.to_string(), "give plays")
    })?;
    let played = played.body.plays;
    let request = PlaysRequest { count, ..PlaysRequest::default() };
    let (list, _) =
        List::make(&dir, TaskKind::Challenge, vitreo_uq::PROGRAM, request.seed, challenge::work(&request, 1)?, false)?;
    for number in 0..count {
        let task = list.task(number)?;
        let play = Play { number, ..played[number % played.len()].clone() };
        let body = serde_json::to_vec(&[play]).map_err(|error| Error::numerical(error.to_string(), "report this"))?;
        // Files are not flushed one by one as in a worker, because only reading is measured.
        let path = list.result_path(&task);
        std::fs::write(&path, result::bytes(vitreo_uq::PROGRAM, &task, &body)?).map_err(file_error("write", &path))?;
    }
    println!("{count} results in {}", dir.display());
    Ok(())
}
