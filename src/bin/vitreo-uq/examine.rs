//! What `compare`, `diagnose` and `ladder` look at: a study with its revisions, the first of which is made where there is none.

use std::time::Instant;

use serde::Serialize;
use vitreo_uq::base::error::{Error, Place, Result};
use vitreo_uq::criticism::Subject;
use vitreo_uq::jobs::artefacts;
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::reduced::Reduced;
use vitreo_uq::posterior::study::{Provenance, RevisionWriter, Study};
use vitreo_uq::sampling::SamplerOptions;

use crate::options::{Common, Model};
use crate::report::PageArguments;
use crate::target::Target;
use crate::terminal::Terminal;
use vitreo_uq::jobs::first_revision::{kept_surrogate, make_first_revision};
use vitreo_uq::posterior::sample::refuse_nothing_to_sample;

/// A study with a revision, ready to be examined.
pub struct Examined {
    /// Its study.
    pub study: Study,
    /// Its name.
    pub revision: String,
    /// Its model joined with the whole experiment.
    pub problem: Problem,
}

impl Examined {
    /// Opens the revision that the options name; given an experiment, makes the study and its m0 first.
    pub fn open(common: &Common, model: &Model, options: SamplerOptions, terminal: &Terminal) -> Result<Self> {
        let target = Target::open(common, model, terminal)?;
        target.check(terminal)?;
        let there = match target.existing_study() {
            Some(study) => study.revisions()?,
            None => Vec::new(),
        };
        if !there.is_empty() {
            refuse_changes(model)?;
        }
        let problem = target.problem(model, terminal)?;
        refuse_nothing_to_sample(&problem)?;
        options.validate(problem.priors.priors().len())?;
        let study = target.make_study()?;
        if there.is_empty() {
            terminal.stage("m0, the first model, on the calibration cycles");
            make_first_revision(&study, &problem, options, false, terminal)?;
        }
        let revision = model.from.clone().or_else(|| there.last().cloned()).unwrap_or_else(|| "m0".into());
        Ok(Self { study, revision, problem })
    }

    /// The experiment, split into fitted and scored cycles, for the fits of its own model.
    pub fn subject(&self, terminal: &Terminal) -> Result<Subject> {
        let compliance =
            Reduced::unverified(&self.problem, kept_surrogate(&self.study, terminal), terminal)?.compliance;
        Subject::with_compliance(&self.problem, &Library::default(), compliance)
    }

    /// The same for the fits of every effect, one of which may ask for a wider surrogate.
    pub fn subject_for_effects(&self, terminal: &Terminal) -> Result<Subject> {
        Subject::new(&self.problem, &Library::default(), kept_surrogate(&self.study, terminal), terminal)
    }

    /// The header of a document about it.
    pub fn provenance(&self, kind: &str, seed: u64) -> Provenance {
        artefacts::with_inputs(self.study.provenance(kind, 1, seed), &self.problem)
    }
}

/// How a command began, for its end.
pub struct Begun<'a> {
    /// When.
    pub at: Instant,
    /// Its options.
    pub common: &'a Common,
    pub page: &'a PageArguments,
    pub terminal: &'a Terminal,
}

impl Begun<'_> {
    /// Makes visible what the command wrote beside the revision, shows it, says where it is, and writes the study's page anew.
    pub fn end(&self, study: &Study, writer: RevisionWriter, document: &impl Serialize, words: &str) -> Result<()> {
        let written = writer.commit()?;
        self.terminal.finish();
        crate::output::show(self.common.json.as_deref(), document, words)?;
        crate::output::say_where(self.common.quiet, &written, self.at);
        crate::report::refresh(study, self.page, self.common.quiet);
        Ok(())
    }
}

/// Revisions are what they are: options that name another model would be silently without effect.
fn refuse_changes(model: &Model) -> Result<()> {
    match model.changing_option() {
        Some(option) => Err(Error::input(
            Place::default().at_key(option),
            "the study has revisions, which are taken as they are",
            "leave the option away, choose a revision with `--from`, or make the next one with `vitreo-uq extend --with EFFECT`",
        )),
        None => Ok(()),
    }
}
