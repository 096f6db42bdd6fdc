//! Begins and ends a command: sets up threads, terminal and target from the arguments, and prints or writes the result.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use serde::Serialize;
use vitreo_uq::base::error::Result;
use vitreo_uq::jobs::first_revision::FIRST_REVISION;
use vitreo_uq::jobs::outcome::Outcome;
use vitreo_uq::jobs::target::{ModelRequest, Target, TargetKind, TargetRequest};
use vitreo_uq::posterior::mechanics::MeshFile;
use vitreo_uq::sampling::SamplerOptions;

use crate::options::{self, Common, ModelOptions, Walkers};
use crate::report::PageArguments;
use crate::terminal::Terminal;

/// One run of a command, with its common arguments.
pub struct Session<'a> {
    began: Instant,
    common: &'a Common,
    /// Number of threads in use.
    pub threads: usize,
    /// Display of progress and warnings.
    pub terminal: Terminal,
}

impl<'a> Session<'a> {
    /// Begins a command: checks that the JSON document can be written, and sets the number of threads.
    pub fn begin(common: &'a Common) -> Result<Self> {
        let began = Instant::now();
        let threads = options::use_threads(common.output.threads)?;
        crate::output::check(common.output.json.as_deref())?;
        Ok(Self { began, common, threads, terminal: Terminal::new(common.output.quiet) })
    }

    /// Sampler settings of a command that has no options for chains and steps.
    pub fn default_sampler(&self) -> SamplerOptions {
        options::default_sampler(self.common.output.seed, self.threads)
    }

    /// Opens the target of the command. `taken` lists the kinds of targets that the command accepts in addition to a creep record.
    pub fn open(&self, model: &ModelOptions, others: &[PathBuf], taken: &[TargetKind]) -> Result<Target> {
        Target::open(target_request(self.common, model, others), taken, None, &self.terminal)
    }

    /// Opens the target of `sample`, which creates the first revision (m0) anew with this model.
    pub fn open_first(&self, model: &ModelOptions, others: &[PathBuf], taken: &[TargetKind]) -> Result<Target> {
        Target::open(target_request(self.common, model, others), taken, Some(FIRST_REVISION), &self.terminal)
    }

    /// Sampler settings of a command that has options for chains and steps.
    pub fn sampler(&self, walkers: &Walkers) -> SamplerOptions {
        options::sampler(walkers.chains, walkers.steps, self.common.output.seed, self.threads)
    }

    /// Returns the kind of the target, such as a creep record or an oscillation. `taken` lists the kinds that the command accepts in addition to a creep
    /// record.
    pub fn kind(&self, others: &[PathBuf], taken: &[TargetKind]) -> TargetKind {
        TargetKind::of(&paths(self.common, others), taken)
    }

    /// Prints the result and its path, and updates the HTML page of the study.
    pub fn end<D: Serialize>(
        &self,
        outcome: &Outcome<D>,
        words: &str,
        label: &str,
        page: &PageArguments,
    ) -> Result<ExitCode> {
        self.show(&outcome.document, words)?;
        self.say(&format!("{label}: {} ({:.1} s)", outcome.written.display(), self.began.elapsed().as_secs_f64()));
        if let Some(study) = &outcome.study {
            crate::report::update_page(study, page, self.common.output.quiet);
        }
        Ok(ExitCode::from(u8::from(!outcome.is_sound)))
    }

    /// Ends the progress display. Then prints the text, and prints or writes the document.
    pub fn show(&self, document: &impl Serialize, words: &str) -> Result<()> {
        self.terminal.finish();
        crate::output::show(self.common.output.json.as_deref(), document, words)
    }

    /// Prints a message on standard error, unless `--quiet` is given.
    pub fn say(&self, text: &str) {
        if !self.common.output.quiet {
            crate::interrupt::print_message(text);
        }
    }
}

/// Words that are printed before the path of a revision's directory.
pub const RESULTS: &str = "Results and figures";

/// Returns the request for the target that the command-line arguments describe.
pub fn target_request(common: &Common, model: &ModelOptions, others: &[PathBuf]) -> TargetRequest {
    TargetRequest {
        paths: paths(common, others),
        out: common.out.clone(),
        replace_existing: common.force,
        model: model_request(model),
    }
}

fn paths(common: &Common, others: &[PathBuf]) -> Vec<PathBuf> {
    common.target.iter().chain(others).cloned().collect()
}

fn model_request(model: &ModelOptions) -> ModelRequest {
    let ModelOptions { base, with, noise, prior, set, from, mesh, mesh_unit, .. } = model.clone();
    ModelRequest {
        forward: model.forward.as_ref().and_then(|_| model.law()),
        mesh: mesh.map(|path| MeshFile { path, metres_per_unit: mesh_unit }),
        base,
        with,
        noise,
        prior,
        set,
        from,
    }
}
