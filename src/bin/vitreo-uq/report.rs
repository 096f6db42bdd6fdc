//! `report`: writes a study, or the results of `groups`, `shapes` or `challenge run`, as one HTML page.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files::{self, Content};
use vitreo_uq::figures::page::{self, Origin};
use vitreo_uq::jobs::pages;
use vitreo_uq::posterior::study::{PAGE_NAME, Provenance, Study, WithProvenance};
use vitreo_uq::validation::challenge::plays::Plays;

use crate::challenge_words::plays_page;

/// Arguments of `report`.
#[derive(Args)]
pub struct ReportArguments {
    /// Study, directory that `groups` or `shapes` wrote, or document of `challenge run`
    #[arg(value_name = "STUDY")]
    pub study: PathBuf,
    /// Path of the page [default: report.html in the study or directory, or beside the document]
    #[arg(long, value_name = "FILE.html")]
    pub out: Option<PathBuf>,
    /// Do not print the path of the page
    #[arg(long)]
    pub quiet: bool,
}

/// Option of commands that change a study: whether they update its page.
#[derive(Args)]
pub struct PageArguments {
    /// Do not write the study's report.html
    #[arg(long)]
    pub no_report: bool,
}

pub fn run(arguments: &ReportArguments) -> Result<ExitCode> {
    let page = match arguments.study.is_file() {
        true => of_plays(&arguments.study, arguments.out.as_deref())?,
        false => pages::write(&arguments.study, arguments.out.as_deref())?,
    };
    if !arguments.quiet {
        crate::interrupt::print_message(&format!("Report: {}", page.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes the HTML page for a document of `challenge run`. Returns the path of the page.
fn of_plays(document: &Path, out: Option<&Path>) -> Result<PathBuf> {
    let bytes =
        files::read(document, Content::Document, "give a study, or the file that `challenge run --json FILE` wrote")?;
    let plays: WithProvenance<Plays> = serde_json::from_slice(&bytes).map_err(|error| {
        let remedy = "give a study, or the file that `challenge run --json FILE` wrote";
        Error::input(
            InputPlace::file(document).at_line(error.line()),
            format!("this is not a document of `challenge run`: {error}"),
            remedy,
        )
    })?;
    let Provenance { version, seed, inputs_sha256, .. } = plays.provenance;
    let html = page::plays(&plays_page(&plays.body.tally), &Origin { version, seed, inputs_sha256 });
    let place = out.map_or_else(|| document.with_file_name(PAGE_NAME), Path::to_path_buf);
    files::write_atomically(&place, html.as_bytes())?;
    Ok(place)
}

/// Updates the HTML page of a study that has changed. The results are already on disk, so a failure only causes a message.
pub fn update_page(study: &Study, arguments: &PageArguments, quiet: bool) {
    if arguments.no_report {
        return;
    }
    match pages::write(study.dir(), None) {
        Ok(page) if quiet => drop(page),
        Ok(page) => crate::interrupt::print_message(&format!("Report: {}", page.display())),
        Err(error) => crate::interrupt::print_message(&format!("no report: {error}")),
    }
}
