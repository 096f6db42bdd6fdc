//! `report`: a study, or what `groups` or `shapes` wrote, as one page for a browser.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use vitreo_uq::error::Result;
use vitreo_uq::study::Study;
use vitreo_uq::workflow::pages;

/// Arguments of `report`.
#[derive(Args)]
pub struct ReportArguments {
    /// The study, or the directory that `groups` or `shapes` wrote
    #[arg(value_name = "STUDY")]
    pub study: PathBuf,
    /// The page [default: report.html in the study or directory]
    #[arg(long, value_name = "FILE.html")]
    pub out: Option<PathBuf>,
    /// Do not say where the page went
    #[arg(long)]
    pub quiet: bool,
}

/// Whether a command that changes a study writes its page anew.
#[derive(Args)]
pub struct PageArguments {
    /// Do not write the study's report.html
    #[arg(long)]
    pub no_report: bool,
}

pub fn run(arguments: &ReportArguments) -> Result<ExitCode> {
    let page = pages::write(&arguments.study, arguments.out.as_deref())?;
    if !arguments.quiet {
        crate::interrupt::say(&format!("Report: {}", page.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes the page of a study that has just been changed. The results are there already, so that a page that cannot be written is said and no more.
pub fn refresh(study: &Study, arguments: &PageArguments, quiet: bool) {
    if arguments.no_report {
        return;
    }
    match pages::write(study.dir(), None) {
        Ok(page) if quiet => drop(page),
        Ok(page) => crate::interrupt::say(&format!("Report: {}", page.display())),
        Err(error) => crate::interrupt::say(&format!("no report: {error}")),
    }
}
