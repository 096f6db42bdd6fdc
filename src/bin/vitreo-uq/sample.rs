//! `sample`: computes the posterior of the parameters from a measurement, and checks it with full finite elements.

use std::process::ExitCode;

use vitreo_uq::base::error::Result;
use vitreo_uq::jobs::sample::{self, SampleDocument, SampleRequest};
use vitreo_uq::jobs::target::TargetKind;

use crate::options::SampleArguments;
use crate::session::{RESULTS, Session};
use crate::text;

pub fn run(arguments: &SampleArguments) -> Result<ExitCode> {
    let session = Session::begin(&arguments.common)?;
    let sampler = session.sampler(&arguments.walkers);
    let request = SampleRequest { sampler, resume: arguments.resume };
    let target =
        session.open_first(&arguments.model, &arguments.others, &[TargetKind::Joint, TargetKind::Oscillation])?;
    let outcome = sample::run(&target, &request, &session.terminal)?;
    let (words, label) = match &outcome.document.body {
        SampleDocument::Creep(summary) => (text::posterior(summary), RESULTS),
        SampleDocument::Oscillation(summary) => (crate::sweep::posterior_words(summary), RESULTS),
        SampleDocument::Joint(summary) => (crate::joint::words(summary), "Results and figure"),
    };
    session.end(&outcome, &words, label, &arguments.page)
}
