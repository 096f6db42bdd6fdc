//! `fit`: computes the paper's point estimate by nonlinear least squares.

use base::error::Result;
use base::files::write_json_atomically;
use documents::fit::FitSummary;
use posterior::fit;
use posterior::monitor::Monitor;
use posterior::study::{FIT_NAME, WithProvenance};

use crate::artefacts;
use crate::first_revision::kept_surrogate;
use crate::outcome::Outcome;
use crate::target::Target;

/// Fits the model of a creep record, and writes the estimate into the record's study. The fit uses no random numbers; `seed` only appears in the
/// document.
///
/// # Errors
/// [`base::Error::Input`] for any target except a creep record; otherwise as [`fit::run`].
pub fn run(target: &Target, seed: u64, monitor: &dyn Monitor) -> Result<Outcome<FitSummary>> {
    let target = target.creep()?;
    target.check(monitor)?;
    let problem = target.problem(monitor)?;
    let kept = target.existing_study().and_then(|study| kept_surrogate(study, monitor));
    let summary = fit::run(&problem, kept, monitor)?.summary;
    let study = target.make_study()?;
    let provenance = artefacts::with_inputs(study.provenance("fit", 1, seed), &problem);
    let document = WithProvenance { provenance, body: summary };
    let written = study.dir().join(FIT_NAME);
    write_json_atomically(&written, &document)?;
    Ok(Outcome { is_sound: document.body.is_sound(), document, written, study: None })
}
