//! `diagnose`: finds the effect that the model lacks.

use base::error::{Error, InputPlace, Result};
use base::files::write_json_atomically;
use cohorts::artefacts::provenance_of;
use cohorts::cohort::{Key, Measurement};
use cohorts::cohort_diagnosis::artefacts as cohort_artefacts;
use cohorts::cohort_diagnosis::job::{self as cohort_job, CohortRequest};
use criticism::criteria::Criteria;
use criticism::diagnose::{DiagnosisRequest, diagnose};
use criticism::fingerprints::fingerprints;
use documents::cohort::CohortDiagnosis;
use documents::diagnosis::{Diagnosis, VerdictKind};
use documents::oscillation::OscillationDiagnosis;
use figures::diagnosis as figure;
use figures::fingerprints::{fingerprints as fingerprints_figure, write_fingerprints};
use figures::number::format_significant;
use figures::svg::{Svg, remove_figure, write_figure};
use learning::preview_learning;
use models::effects::Library;
use posterior::misfit::NOISE_FACTOR;
use posterior::monitor::Monitor;
use posterior::study::{DIAGNOSIS_NAME, FINGERPRINTS_NAME, WithProvenance};
use sampling::SamplerOptions;
use serde::Serialize;

use crate::artefacts::with_prior;
use crate::last_cycle;
use crate::laws::creep::{ExplainingLaw, find_explaining_law};
use crate::laws::oscillation;
use crate::outcome::Outcome;
use crate::sweep;
use crate::target::{CohortTarget, CreepTarget, SweepTarget, Target, unsupported_target};

/// File name, without extension, of the figure that shows the unexplained residual.
pub const DISCREPANCY_FIGURE: &str = "discrepancy";
/// Default directory of a cohort's results.
pub const COHORT_OUT: &str = "vitreo-uq-out/cohort";

/// Sentence on a study whose own law explains the record with a wide prior only.
const PRIOR_EXCLUDES: &str = "This study's prior excludes its parameters: check the units of force and position first, then repeat with `--prior generic`.";

/// Settings of `diagnose` that the caller chooses.
pub struct DiagnoseRequest {
    /// Smallest change of a predicted position, in noise standard deviations, with which an effect can be claimed as missing.
    pub smallest: f64,
    /// Largest number of searches in simulated data. For a cohort, `simulations` is the number of simulated records per record.
    pub simulations: usize,
    /// Sampler settings for posteriors that the study still lacks. The diagnosis uses the seed of these settings.
    pub sampler: SamplerOptions,
    /// Keys that define the groups of a cohort. An empty list selects the key species, if the cohort has several species. Unused for other targets.
    pub keys: Vec<Key>,
    /// Margin for comparing effect sizes in a cohort's groups. A ratio within 1 + margin of 1 counts as no practical difference.
    pub margin: f64,
    /// Records or specimens to leave out of a cohort.
    pub leave_out: Vec<String>,
}

/// Diagnosis of a creep record, an oscillation or a cohort.
#[derive(Serialize)]
#[serde(untagged)]
pub enum DiagnoseDocument {
    /// Diagnosis of a creep record.
    Creep(Box<Diagnosis>),
    /// Diagnosis of an oscillation.
    Oscillation(OscillationDiagnosis),
    /// Diagnosis of a cohort.
    Cohort(CohortDiagnosis),
}

/// Diagnoses a target. The diagnosis is written into the revision, the oscillation's study or the cohort's directory.
///
/// # Errors
/// [`Error::Input`] for several records of one specimen; otherwise the errors of fitting and writing.
pub fn run(target: &Target, request: &DiagnoseRequest, monitor: &dyn Monitor) -> Result<Outcome<DiagnoseDocument>> {
    match target {
        Target::Creep(creep) => of_creep(creep, request, monitor),
        Target::Oscillation(sweep) => of_oscillation(sweep, request, monitor),
        Target::Cohort(cohort) => of_cohort(cohort, request, monitor),
        Target::Joint(_) => Err(unsupported_target()),
    }
}

fn of_creep(
    creep: &CreepTarget,
    request: &DiagnoseRequest,
    monitor: &dyn Monitor,
) -> Result<Outcome<DiagnoseDocument>> {
    let seed = request.sampler.seed;
    let revision = creep.revision(request.sampler.clone(), monitor)?;
    let posterior = revision.last_cycle_posterior(&request.sampler, monitor)?;
    let base_errors = Some(last_cycle::errors(&posterior));
    let default = DiagnosisRequest::default();
    let criteria = Criteria { smallest_change: request.smallest, ..default.criteria };
    let of_search = DiagnosisRequest { criteria, n_simulations: request.simulations, seed, base_errors, ..default };
    let mut found = diagnose(&revision.subject_for_effects(monitor)?, &of_search, monitor)?;
    let is_unexplained = found.diagnosis.verdict.kind == VerdictKind::Unexplained;
    let left_um = left_um(&found.diagnosis);
    let law = find_explaining_law(&revision.problem, left_um, monitor)?;
    // A law in place of a claimed effect has to leave clearly less than the claim does.
    match law.filter(|law| is_unexplained || NOISE_FACTOR * law.error_um < left_um) {
        Some(ExplainingLaw { law, sentence, .. }) => {
            let verdict = &mut found.diagnosis.verdict;
            // Laws are compared with wide priors, so the study's own law can explain what its prior excludes.
            let is_of_study = law == revision.problem.model.base().name();
            let fixed: Vec<&str> = revision.problem.specification.fixed.keys().map(String::as_str).collect();
            let own = match fixed.is_empty() {
                true => format!("With a wide prior, {sentence} {PRIOR_EXCLUDES}"),
                false => format!("With free parameters, {sentence} This study fixes {}.", fixed.join(", ")),
            };
            let said = &verdict.sentence;
            let of_claim = format!("{said} The model with it still leaves {} µm", format_significant(left_um, 3));
            verdict.sentence = match (is_unexplained, is_of_study) {
                (true, true) => format!("{own} {said}"),
                (true, false) => format!("The base law {sentence} {said}"),
                (false, true) => format!("{of_claim}. {own}"),
                (false, false) => {
                    format!("{of_claim}, and the base law {sentence} The law rather than an effect may be wrong.")
                }
            };
            verdict.base_law = Some(law);
        }
        None if is_unexplained => {
            // Neither an effect nor a law explains the residuals, so a learned correction of the law is tried.
            found.diagnosis.remarks.extend(preview_learning(&found.subject, &found.found.base, monitor)?);
        }
        None => {}
    }
    // The search ends where the prior does, so that it says nothing about a posterior beyond.
    if !posterior.at_edge_of_range.is_empty() {
        let at_edge = format!(
            "posterior of {} without an effect lies at the end of the range that the prior allows: check the units of force and position first, then repeat with `--prior generic`.",
            posterior.at_edge_of_range.join(", ")
        );
        let Diagnosis { verdict, remarks, .. } = &mut found.diagnosis;
        match verdict.kind {
            VerdictKind::None => {
                verdict.kind = VerdictKind::Unexplained;
                verdict.sentence = format!("The {at_edge} The search for effects does not reach that far.");
            }
            _ => remarks.push(format!("the {at_edge}")),
        }
    }
    monitor.stage("writing results and figures");
    let body = DiagnoseDocument::Creep(Box::new(found.diagnosis.clone()));
    revision.amend("diagnosis", seed, body, |dir| {
        let (figures, id) = (dir.join("figures"), &found.diagnosis.experiment);
        let quantities = found.subject.experiment().quantities();
        let write = |stem: &str, svg: Svg| write_figure(&figures, stem, &svg.translated(quantities));
        write("diagnosis", figure::diagnosis(&found.diagnosis)?)?;
        let of_effects = fingerprints(&found.subject, &found.found);
        write_fingerprints(&dir.join(FINGERPRINTS_NAME), &of_effects)?;
        if !of_effects.effects.is_empty() {
            write("fingerprints", fingerprints_figure(&of_effects, id)?)?;
        }
        match &found.leftover {
            Some(leftover) => write(DISCREPANCY_FIGURE, leftover.figure(id)?),
            None => remove_figure(&figures, DISCREPANCY_FIGURE),
        }
    })
}

/// Largest error (µm) in the fitted and the scored cycles that the verdict's model leaves: the model with the claimed effects, or the base model. 0 if nothing is missing.
fn left_um(diagnosis: &Diagnosis) -> f64 {
    let (base, extended) = (&diagnosis.base, &diagnosis.extended);
    let [fitted_um, heldout_um] = match (diagnosis.verdict.kind, extended) {
        (VerdictKind::None, _) => return 0.0,
        (VerdictKind::Missing, Some(extended)) => [Some(extended.rmse_fitted_um), extended.rmse_heldout_um],
        _ => [Some(base.rmse_fitted_um), base.rmse_heldout_um],
    };
    fitted_um.into_iter().chain(heldout_um).fold(0.0, f64::max)
}

fn of_oscillation(
    target: &SweepTarget,
    request: &DiagnoseRequest,
    monitor: &dyn Monitor,
) -> Result<Outcome<DiagnoseDocument>> {
    let seed = request.sampler.seed;
    let problem = target.problem()?;
    let study = target.make_study()?;
    let mut found = sweep::diagnose::run(&problem, seed, &Library::default(), monitor)?;
    if found.verdict.kind == VerdictKind::Unexplained
        && let left = found.extended.as_ref().unwrap_or(&found.base)
        && let Some((law, sentence)) = oscillation::find_explaining_law(&problem, left, seed, monitor)?
    {
        found.verdict.sentence = format!("{} The base law {sentence}", found.verdict.sentence);
        found.verdict.base_law = Some(law);
    }
    let provenance = with_prior(study.provenance("oscillation-diagnosis", 1, seed), &problem.priors);
    let document = WithProvenance { provenance, body: DiagnoseDocument::Oscillation(found) };
    let written = study.dir().join(DIAGNOSIS_NAME);
    write_json_atomically(&written, &document)?;
    Ok(Outcome { document, is_sound: true, written, study: None })
}

fn of_cohort(
    cohort: &CohortTarget,
    request: &DiagnoseRequest,
    monitor: &dyn Monitor,
) -> Result<Outcome<DiagnoseDocument>> {
    cohort.refuse_options_of_one(&[], "diagnose")?;
    if let Some(path) = cohort.request.paths.iter().find(|path| record::OscillationRecord::is_described_in(path)) {
        let remedy = "give records over time, and diagnose the oscillation by itself";
        return Err(Error::input(
            InputPlace::file(path),
            "an oscillation has no cycles and shows only the law, so it cannot join a cohort",
            remedy,
        ));
    }
    let measurements = cohort.measurements(&request.leave_out, monitor)?;
    let keys = if request.keys.is_empty() { default_keys(&measurements) } else { request.keys.clone() };
    let (out, seed) = (cohort.out(COHORT_OUT), request.sampler.seed);
    let provenance = provenance_of("cohort-diagnosis", &measurements, seed);
    cohort_artefacts::check_place(out, &provenance, cohort.request.replace_existing)?;
    let of_cohort = CohortRequest { keys, margin: request.margin, n_simulations: request.simulations, seed };
    let diagnosis = cohort_job::run(&measurements, &of_cohort, monitor)?;
    monitor.stage("writing results and figures");
    let written = cohort_artefacts::write(out, &diagnosis, provenance.clone())?;
    let document = WithProvenance { provenance, body: DiagnoseDocument::Cohort(diagnosis) };
    Ok(Outcome { document, is_sound: true, written, study: None })
}

/// Default keys of a cohort: species if every record names one and there are at least two species; otherwise none.
fn default_keys(measurements: &[Measurement]) -> Vec<Key> {
    let mut species: Vec<Option<&str>> =
        measurements.iter().map(|measurement| measurement.experiment.species.as_deref().map(str::trim)).collect();
    species.sort_unstable();
    species.dedup();
    let is_grouped =
        species.len() > 1 && species.iter().all(|group_name| group_name.is_some_and(|name| !name.is_empty()));
    if is_grouped { vec![Key::Species] } else { Vec::new() }
}
