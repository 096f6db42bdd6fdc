//! `learn`: infers a constitutive correction, a formula that is added to the law. It learns from one record, or from half of a cohort's records. The
//! other half then confirms the correction.

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{remove_if_there, write_atomically};
use cohorts::artefacts::provenance_of;
use cohorts::learnt;
use criticism::Subject;
use documents::learned::Learned;
use documents::learned_cohort::LearnedCohort;
use figures::learned as figure;
use figures::svg::{remove_figure, write_figure};
use learning::{FILE_NAME, Request, learn};
use posterior::monitor::Monitor;
use posterior::study::WithProvenance;
use sampling::SamplerOptions;
use serde::Serialize;

use crate::diagnose::COHORT_OUT;
use crate::last_cycle;
use crate::outcome::Outcome;
use crate::target::{CohortTarget, CreepTarget, Target, unsupported_target};

/// File name, without extension, of the figure that shows the learned correction.
const FIGURE: &str = "learned";

/// Settings of `learn` that the caller chooses.
pub struct LearnRequest {
    /// Largest number of searches in simulated data. They show how large a gain in log likelihood chance alone can cause.
    pub simulations: usize,
    /// Number of first cycles from which the correction is learned; all later cycles are scored. With `None`, only the last held-out cycle is scored.
    pub first_cycles: Option<u32>,
    /// `true` restricts the correction to monotone functions of the state.
    pub is_monotone: bool,
    /// Sampler settings for posteriors that the study still lacks. Learning uses the seed of these settings.
    pub sampler: SamplerOptions,
}

/// Correction learned from a creep record or a cohort.
#[derive(Serialize)]
#[serde(untagged)]
pub enum LearnDocument {
    /// Correction from a creep record.
    Creep(Box<Learned>),
    /// Correction from half of a cohort's records, confirmed on the other half.
    Cohort(Box<LearnedCohort>),
}

/// Learns a correction of the law. It is written into the revision or the cohort's directory.
///
/// # Errors
/// [`Error::Input`] for an oscillation and for several records of one specimen; otherwise the errors of fitting and writing.
pub fn run(target: &Target, request: &LearnRequest, monitor: &dyn Monitor) -> Result<Outcome<LearnDocument>> {
    match target {
        Target::Creep(creep) => of_creep(creep, request, monitor),
        Target::Cohort(cohort) => of_cohort(cohort, request, monitor),
        Target::Oscillation(_) | Target::Joint(_) => Err(unsupported_target()),
    }
}

fn of_creep(creep: &CreepTarget, request: &LearnRequest, monitor: &dyn Monitor) -> Result<Outcome<LearnDocument>> {
    let seed = request.sampler.seed;
    let revision = creep.revision(request.sampler.clone(), monitor)?;
    let base_errors = match request.first_cycles {
        None => Some(last_cycle::errors(&revision.last_cycle_posterior(&request.sampler, monitor)?)),
        Some(_) => None,
    };
    let subject = of_first_cycles(revision.subject_for_effects(monitor)?, request.first_cycles)?;
    let quantities = subject.experiment().quantities();
    let of_search = Request { n_simulations: request.simulations, seed, is_monotone: request.is_monotone, base_errors };
    let found = learn(&subject, &of_search, monitor)?;
    monitor.stage("writing results and figures");
    let body = LearnDocument::Creep(Box::new(found.learned.clone()));
    revision.amend("learned", seed, body, |dir| {
        let (file, figures) = (dir.join(FILE_NAME), dir.join("figures"));
        match &found.file {
            Some(text) => write_atomically(&file, text.as_bytes())?,
            None => remove_if_there(&file)?,
        }
        match found.learned.function {
            Some(_) => write_figure(&figures, FIGURE, &figure::learned(&found.learned)?.translated(quantities)),
            None => remove_figure(&figures, FIGURE),
        }
    })
}

/// Makes the subject fit the cycles up to number `first` and score all later cycles. Returns the subject unchanged if `first` is `None`.
fn of_first_cycles(subject: Subject, first: Option<u32>) -> Result<Subject> {
    let Some(first) = first else { return Ok(subject) };
    let experiment = subject.experiment();
    let mut cycles = [&experiment.calibration_cycles[..], &experiment.heldout_cycles].concat();
    cycles.sort_unstable();
    let (fitted, scored): (Vec<u32>, Vec<u32>) = cycles.into_iter().partition(|cycle| *cycle <= first);
    if fitted.is_empty() || scored.is_empty() {
        let remedy = "give a number that leaves at least one cycle on each side";
        return Err(Error::input(
            InputPlace::setting(Setting::FirstCycles),
            format!("{first} leaves no cycle to fit or no cycle to score"),
            remedy,
        ));
    }
    subject.with_cycles(&fitted, &scored)
}

fn of_cohort(cohort: &CohortTarget, request: &LearnRequest, monitor: &dyn Monitor) -> Result<Outcome<LearnDocument>> {
    cohort.refuse_options_of_one(&[(Setting::FirstCycles, request.first_cycles.is_some())], "learn from")?;
    let measurements = cohort.measurements(&[], monitor)?;
    let out = cohort.out(COHORT_OUT);
    let provenance = provenance_of("learned-cohort", &measurements, request.sampler.seed);
    learnt::check_place(out, &provenance, cohort.request.replace_existing)?;
    let found = learnt::run(&measurements, request.is_monotone, monitor)?;
    monitor.stage("writing results");
    let written = learnt::write(out, &found, provenance.clone())?;
    let document = WithProvenance { provenance, body: LearnDocument::Cohort(Box::new(found.learned)) };
    Ok(Outcome { document, is_sound: true, written, study: None })
}
