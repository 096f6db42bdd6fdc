//! Compares all revisions of a study under equal conditions. Each revision is fitted to all cycles except the last, and the full finite elements score
//! the last cycle (formats §4).
//!
//! Revisions made by `extend` are fitted in this way, so their stored posteriors are used. Other revisions are fitted again, unless an earlier command
//! stored this fit. An example is m0, which `sample` fits to the calibration cycles only.

use base::error::{Error, InputPlace, Result};
use base::files::{self, Content};
use documents::extension::{EquivalentEffects, ExtensionSummary};
use documents::ladder::{LadderParameter, LadderRow, LadderSummary, Shift};
use documents::posterior::PosteriorSummary;
use documents::trust::Trust;
use figures::svg::figure_files;
use laws::rheology::BaseLaw;
use posterior::monitor::Monitor;
use posterior::problem::Problem;
use posterior::sample;
use posterior::study::{EXTENSION_NAME, LADDER_NAME, POSTERIOR_NAME, Provenance, Study, WithProvenance};
use posterior::trust::trust;
use sampling::SamplerOptions;

use crate::equivalents;
use crate::last_cycle::{LastCycleFit, errors, read_document};
use crate::outcome::Outcome;
use crate::target::Target;

/// Settings of the comparison that the caller chooses.
pub struct LadderRequest {
    /// Name of the last revision to compare; `None` compares all.
    pub up_to: Option<String>,
    /// Sampler settings for revisions that must be fitted.
    pub options: SamplerOptions,
    /// `true` repeats the fits that earlier commands made only for this comparison. A revision's own posterior is used unchanged if it was fitted to the
    /// compared cycles.
    pub refit: bool,
}

/// Compares the revisions of a creep record's study, and writes the comparison into the study.
///
/// # Errors
/// [`Error::Input`] for any target except a creep record; otherwise the errors of sampling and writing.
pub fn run(target: &Target, request: &LadderRequest, monitor: &dyn Monitor) -> Result<Outcome<LadderSummary>> {
    let seed = request.options.seed;
    let crate::target::Revision { study, problem, .. } = target.creep()?.revision(request.options.clone(), monitor)?;
    let summary = compare_revisions(&study, &problem, request, monitor)?;
    monitor.stage("writing results and figures");
    let quantities = problem.experiment.quantities();
    let provenance = provenance(&study, &summary, seed)?.with_quantities(quantities);
    let document = WithProvenance { provenance, body: summary };
    let [svg, png, pdf] =
        figure_files(study.dir(), "ladder", &figures::ladder::ladder(&document.body)?.translated(quantities))?;
    let json = study.dir().join(LADDER_NAME);
    let json = (json.clone(), files::to_json(&json, &document)?);
    files::write_together(&[&svg, &png, &pdf, &json].map(|(path, bytes)| (path.as_path(), bytes.as_slice())))?;
    Ok(Outcome { is_sound: document.body.is_sound(), document, written: svg.0, study: Some(study) })
}

/// Header of the comparison's document. It names the models and posteriors of the revisions as inputs.
fn provenance(study: &Study, summary: &LadderSummary, seed: u64) -> Result<Provenance> {
    let mut provenance = study.provenance("ladder", 1, seed);
    for rung in &summary.revisions {
        let dir = study.revision_dir(&rung.revision)?;
        for name in ["model.toml", POSTERIOR_NAME] {
            let bytes =
                files::read(&dir.join(name), Content::Document, "check that the study is complete and readable")?;
            provenance = provenance.with_input(format!("{}/{name}", rung.revision), &bytes);
        }
    }
    Ok(provenance)
}

/// Compares the revisions of a study.
///
/// `first` is any model of the study, joined with the entire experiment. All revisions use its mesh and matrices.
///
/// # Errors
/// [`Error::Input`] if the study has no revision, or if one uses another mesh; otherwise as [`sample::run`].
fn compare_revisions(
    study: &Study,
    first: &Problem,
    request: &LadderRequest,
    monitor: &dyn Monitor,
) -> Result<LadderSummary> {
    let mut names = study.revisions()?;
    if let Some(last) = request.up_to.as_deref() {
        study.revision_dir(last)?;
        let end = names.iter().position(|name| name == last).map_or(names.len(), |place| place + 1);
        names.truncate(end);
    }
    let revisions: Vec<LastCycleFit> =
        names.iter().map(|name| LastCycleFit::of(study, first, name)).collect::<Result<_>>()?;
    // All options are checked before the first fit.
    for revision in &revisions {
        request.options.validate(revision.problem.priors.priors().len())?;
    }
    let mut rungs = Vec::with_capacity(revisions.len());
    for revision in &revisions {
        let posterior = revision.posterior(&request.options, request.refit, monitor)?;
        let extension = read_document::<ExtensionSummary>(&study.revision_dir(&revision.name)?.join(EXTENSION_NAME));
        rungs.push(rung(&revision.name, extension.map(|with_provenance| with_provenance.body.from), posterior));
    }
    let effects_of: Vec<(String, Vec<String>)> =
        rungs.iter().map(|rung| (rung.revision.clone(), rung.effects.clone())).collect();
    for rung in &mut rungs {
        rung.added = added(rung, &effects_of);
        rung.equivalents = equivalents::revision_equivalents(study, &rung.revision)?;
    }
    summarise(&revisions, rungs)
}

fn rung(revision: &str, from: Option<String>, posterior: PosteriorSummary) -> LadderRow {
    let errors = errors(&posterior);
    let PosteriorSummary { model, parameters, heldout, error_budget_um, converged, warnings, .. } = posterior;
    LadderRow {
        revision: revision.into(),
        effects: model.effects.clone(),
        from,
        added: Vec::new(),
        equivalents: Vec::new(),
        model,
        rmse_fitted_um: errors.rmse_fitted_um,
        rmse_heldout_um: errors.rmse_heldout_um,
        heldout_log_score_nats: heldout.log_score_nats,
        heldout_log_score_mcse_nats: heldout.log_score_mcse_nats,
        parameters: parameters.into_iter().map(LadderParameter::from).collect(),
        learnt_noise_um: error_budget_um.noise,
        coverage_50: heldout.coverage_50,
        coverage_90: heldout.coverage_90,
        joint_p: heldout.joint_p,
        fe_runs: heldout.fe_runs,
        surrogate_vs_fe_max_um: heldout.surrogate_vs_fe_max_um,
        converged,
        warnings,
    }
}

/// Effects that a revision adds to the revision that it extends; all its effects if it extends none.
fn added(rung: &LadderRow, effects_of: &[(String, Vec<String>)]) -> Vec<String> {
    let of = |name: &String| effects_of.iter().find(|(revision, _)| revision == name).map(|(_, effects)| effects);
    let before = rung.from.as_ref().and_then(of);
    let is_new = |slug: &&String| before.is_none_or(|effects| !effects.contains(slug));
    rung.effects.iter().filter(is_new).cloned().collect()
}

fn summarise(revisions: &[LastCycleFit], rungs: Vec<LadderRow>) -> Result<LadderSummary> {
    let Some(LastCycleFit { problem, .. }) = revisions.first() else {
        return Err(Error::input(
            InputPlace::default(),
            "this study has no revision",
            "run `vitreo-uq sample` on this study first",
        ));
    };
    let experiment = &problem.experiment;
    let yardstick = experiment.reference_noise();
    let noise_um = yardstick.map(|yardstick| 1e6 * yardstick.sd_m);
    let n_scored = problem.positions_of(&experiment.heldout_cycles).iter().flatten().count();
    let mut summary = LadderSummary {
        experiment: experiment.specimen_id.clone(),
        fitted_cycles: experiment.calibration_cycles.clone(),
        heldout_cycles: experiment.heldout_cycles.clone(),
        noise_um,
        noise_origin: yardstick.map_or("unknown", |yardstick| sample::noise_origin_text(yardstick.origin)).into(),
        shifts: shifts(problem.model.base(), &rungs),
        sentence: sentence(&rungs, noise_um, n_scored),
        trust: Trust::default(),
        revisions: rungs,
    };
    let of_last = summary.revisions.last().into_iter().flat_map(|rung| &rung.warnings);
    summary.trust = trust(summary.warnings().map(|(_, warning)| warning).chain(of_last));
    let of_last = summary.revisions.last().into_iter().flat_map(|rung| &rung.equivalents);
    let sentences: Vec<String> = of_last.filter_map(EquivalentEffects::sentence).collect();
    sentences.iter().for_each(|sentence| summary.sentence += &format!(" {sentence}"));
    Ok(summary)
}

/// Changes of the law's parameters from the first to the last revision. Only parameters that both revisions sample are listed.
fn shifts(law: BaseLaw, rungs: &[LadderRow]) -> Vec<Shift> {
    let [first, .., last] = rungs else { return Vec::new() };
    let find = |rung: &LadderRow, name: &str| rung.parameters.iter().find(|p| p.name == name).cloned();
    let shift = |name: &str| {
        let (before, after) = (find(first, name)?, find(last, name)?);
        let relative = before.median / after.median - 1.0;
        let in_sd_before = (before.median - after.median) / before.sd;
        Some(Shift { name: name.into(), before, after, relative, in_sd_before })
    };
    law.parameters().iter().filter_map(|spec| shift(spec.name)).collect()
}

/// Number of standard errors within which an error counts as equal to the noise. A root mean square over n positions has a relative standard error of
/// 1/√(2n).
const NOISE_FLOOR_IN_ERRORS: f64 = 3.0;

/// Sentence on the change of the held-out error from the first to the last revision.
fn sentence(rungs: &[LadderRow], noise_um: Option<f64>, n_scored: usize) -> String {
    let [first, .., last] = rungs else {
        return "The study has one revision, so there is nothing to compare.".into();
    };
    let added: Vec<&str> =
        last.effects.iter().filter(|slug| !first.effects.contains(slug)).map(String::as_str).collect();
    let with = if added.is_empty() { last.revision.clone() } else { added.join(" and ") };
    let (Some(was), Some(is)) = (first.rmse_heldout_um, last.rmse_heldout_um) else {
        return format!(
            "With {with} the error on the fitted cycles goes from {:.3} to {:.3} µm. No cycle is held out, so the change is at most suggestive.",
            first.rmse_fitted_um, last.rmse_fitted_um
        );
    };
    let uncertain = 1.0 / (2.0 * n_scored.max(1) as f64).sqrt();
    let verb = match was - is {
        change if change.abs() < 2.0 * uncertain * was.min(is) => "stays within its uncertainty",
        change if change > 0.0 => "falls",
        _ => "rises",
    };
    let floor = noise_um.map_or(String::new(), |noise| {
        let place = if is < noise * (1.0 + NOISE_FLOOR_IN_ERRORS * uncertain) {
            ", the noise"
        } else {
            ", still above the noise"
        };
        format!("{place} ({noise:.3} µm)")
    });
    let score = match (first.heldout_log_score_nats, last.heldout_log_score_nats) {
        (Some(before), Some(after)) => format!(" Its log score changes by {:+.1} nats.", after - before),
        _ => String::new(),
    };
    format!("With {with} the error on the last held-out cycle {verb}: from {was:.3} to {is:.3} µm{floor}.{score}")
}

#[cfg(test)]
#[path = "ladder_tests.rs"]
pub(crate) mod tests;
