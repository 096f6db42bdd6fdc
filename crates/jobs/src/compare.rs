//! `compare`: tests the residuals of a revision for misfits.

use base::error::Result;
use criticism::compare::{self, figures};
use documents::comparison::Comparison;
use posterior::monitor::Monitor;
use sampling::SamplerOptions;

use crate::last_cycle;
use crate::outcome::Outcome;
use crate::target::Target;

/// Settings of `compare` that the caller chooses.
pub struct CompareRequest {
    /// Number of simulated records that serve to correct the p-values for the number of tests. `None` selects the default number.
    pub simulations: Option<usize>,
    /// Sampler settings for posteriors that the study still lacks. The comparison's simulations use the seed of these settings.
    pub sampler: SamplerOptions,
}

/// Tests the residuals of a revision against the noise, and writes the result into the revision.
///
/// # Errors
/// [`base::Error::Input`] for any target except a creep record; otherwise the errors of fitting and writing.
pub fn run(target: &Target, request: &CompareRequest, monitor: &dyn Monitor) -> Result<Outcome<Comparison>> {
    let seed = request.sampler.seed;
    let revision = target.creep()?.revision(request.sampler.clone(), monitor)?;
    let errors = last_cycle::errors(&revision.last_cycle_posterior(&request.sampler, monitor)?);
    monitor.stage("testing the residuals for misfits");
    let subject = revision.subject(monitor)?;
    let simulations = request.simulations.unwrap_or_else(|| compare::default_simulations(subject.n_fitted()));
    let found = compare::compare_model(&subject, &subject.base(), Some(errors), simulations, seed)?;
    monitor.stage("writing results and figures");
    revision.amend("comparison", seed, found.comparison.clone(), |dir| figures::write(&dir.join("figures"), &found))
}
