//! `extend`: adds an effect to a study's model as the next revision. The models before and after the extension are fitted to all cycles except the last,
//! and compared by their errors on the last cycle (formats §4).

use std::path::{Path, PathBuf};

use base::error::{Error, InputPlace, Result, Setting};
use cohorts::cohort::{self, Measurement};
use documents::errors::ModelErrors;
use documents::extension::{EquivalentEffects, ExtensionMode, ExtensionSummary};
use documents::posterior::PosteriorSummary;
use documents::trust::{Trust, TrustLevel};
use figures::number::format_significant;
use models::effects::Library;
use posterior::modes::draws_for_modes;
use posterior::monitor::Monitor;
use posterior::prepared::KeptSurrogate;
use posterior::problem::Problem;
use posterior::sample::{self, SampleRequest, SampleResult, refuse_nothing_to_sample};
use posterior::study::{Assignments, EXTENSION_NAME, ModelSpecification, Provenance, Study, WithProvenance};
use sampling::SamplerOptions;
use sampling::diagnostics::DrawColumn;
use sampling::evidence::{WeightedDraws, find_density_valley, to_normal_coordinate};
use serde::Serialize;

use crate::first_revision::{FIRST_REVISION, kept_surrogate, make_first_revision, refuse_unfinished};
use crate::last_cycle::{LastCycleFit, errors};
use crate::outcome::Outcome;
use crate::target::{CohortTarget, CreepTarget, Target, TargetRequest, unsupported_target};
use crate::{artefacts, equivalents, pages};

/// Default directory for the studies of a cohort, with one subdirectory per record.
const COHORT_OUT: &str = "vitreo-uq-out/cohort-studies";

/// Settings of `extend` that the caller chooses.
pub struct ExtendRequest {
    /// Names (slugs) of the effects to add.
    pub effects: Vec<String>,
    /// Parameters to fix or free, as `name=value` or `name=free`. Each setting applies to both models, before and after the extension, if they have the
    /// parameter.
    pub set: Vec<String>,
    /// Settings of the sampler.
    pub sampler: SamplerOptions,
    /// `true` also writes the page of every study of a cohort. Unused for other targets.
    pub pages: bool,
}

/// Result of `extend` for a creep record or a cohort.
#[derive(Serialize)]
#[serde(untagged)]
pub enum ExtendDocument {
    /// Extension of a creep record.
    Creep(Box<ExtensionSummary>),
    /// Extensions of the records of a cohort.
    Cohort {
        /// Result for each record. It is also stored in the study of the record.
        records: Vec<ExtendedRecord>,
    },
}

/// Result of `extend` for one record of a cohort.
#[derive(Serialize)]
pub struct ExtendedRecord {
    /// Name of the record's directory.
    pub name: String,
    /// Name of the revision that has the effects.
    pub revision: String,
    /// Summary of the extension; `None` if the revision existed before this run.
    pub extension: Option<ExtensionSummary>,
}

/// Adds effects to the revision that the target names, or to its last revision, and writes the result as the next revision. A cohort is extended record by
/// record.
///
/// # Errors
/// [`Error::Input`] if effects or values are refused, for an oscillation and for several records of one specimen; otherwise the errors of sampling and
/// writing.
pub fn run(target: &Target, request: &ExtendRequest, monitor: &dyn Monitor) -> Result<Outcome<ExtendDocument>> {
    match target {
        Target::Creep(creep) => {
            let Outcome { document, is_sound, written, study } = of_creep(creep, request, monitor)?;
            let WithProvenance { provenance, body } = document;
            let document = WithProvenance { provenance, body: ExtendDocument::Creep(Box::new(body)) };
            Ok(Outcome { document, is_sound, written, study })
        }
        Target::Cohort(cohort) => of_cohort(cohort, request, monitor),
        Target::Oscillation(_) | Target::Joint(_) => Err(unsupported_target()),
    }
}

fn of_creep(target: &CreepTarget, request: &ExtendRequest, monitor: &dyn Monitor) -> Result<Outcome<ExtensionSummary>> {
    let (options, library) = (request.sampler.clone(), Library::default());
    target.check(monitor)?;
    if let (Some(_), Some(study)) = (target.request.law(), target.existing_study())
        && !study.revisions()?.is_empty()
    {
        return Err(Error::input(
            InputPlace::setting(Setting::Base),
            "the study has a base law already",
            format!(
                "leave out {} (or {}), or make a study of another law with `sample {} … {} DIR`",
                Setting::Base,
                Setting::Forward,
                Setting::Base,
                Setting::Out
            ),
        ));
    }
    let specification = add_effects(&target.specification, &request.effects, &library)?;
    let values = specification.values_from_options(&request.set, &library)?;
    let before = target.problem(monitor)?;
    let (from, revision, earlier) = match target.existing_study() {
        Some(study) => revisions(study, target.request.from.as_deref())?,
        None => (FIRST_REVISION.into(), "m1".into(), 0),
    };
    let request =
        ExtensionRequest { from: &from, revision: &revision, effects: &request.effects, values, earlier, options };
    // All checks are made here, before anything is sampled or written.
    let mut pair = prepare_comparison(&before, &request, &library)?;
    for problem in [&before, &pair.base, &pair.after] {
        refuse_nothing_to_sample(problem)?;
        request.options.validate(problem.priors.priors().len())?;
    }
    let study = target.make_study()?;
    if study.revisions()?.is_empty() {
        refuse_unfinished(&study, &before.specification)?;
        monitor.stage("m0, the model to extend, on the calibration cycles");
        make_first_revision(&study, &before, request.options.clone(), false, monitor)?;
    }
    pair.kept_surrogate = kept_surrogate(&study, monitor);
    if pair.is_before_as_stored {
        let fitted = LastCycleFit::of(&study, &before, &from)?;
        pair.posterior_before = Some(fitted.posterior(&request.options, false, monitor)?);
    }
    let writer = study.begin_revision(&revision)?;
    let Extension { mut summary, problem, mut after } = refit(pair, &request, monitor)?;
    summary.equivalents = equivalents::extension_equivalents(&study, &from, &revision, request.effects)?;
    if let Some(warning) = equivalents::law_depends_on_effect(&summary.equivalents, &summary.parameters) {
        after.summary.warnings.push(warning);
        after.summary.trust = posterior::trust::trust(&after.summary.warnings);
        summary.warnings.clone_from(&after.summary.warnings);
        // A comparison that is not valid stays untrusted.
        if summary.trust.is_sound() {
            summary.trust.clone_from(&after.summary.trust);
        }
    }
    let of_equivalents = summary.equivalents.iter().filter(|equivalent| equivalent.revision == revision);
    let sentences: Vec<String> = of_equivalents.filter_map(EquivalentEffects::sentence).collect();
    sentences.iter().for_each(|sentence| summary.sentence += &format!(" {sentence}"));
    monitor.stage("writing results and figures");
    let header = |kind: &str| artefacts::with_inputs(study.provenance(kind, 1, request.options.seed), &problem);
    let document = WithProvenance { provenance: header("extension"), body: summary };
    let written = writer.publish(EXTENSION_NAME, &document, |dir| {
        artefacts::write(dir, &after, &header)?;
        artefacts::write_timing(dir, &after.timing_s, header("timing"))
    })?;
    Ok(Outcome { is_sound: document.body.is_sound(), document, written, study: Some(study) })
}

/// Returns the name of the revision to extend, the name of the revision to make, and the number of earlier extensions.
fn revisions(study: &Study, from: Option<&str>) -> Result<(String, String, usize)> {
    let there = study.revisions()?;
    let last = there.last().cloned().unwrap_or_else(|| FIRST_REVISION.into());
    let number = last[1..].parse::<u32>().unwrap_or(0);
    Ok((from.map_or(last, String::from), format!("m{}", number + 1), there.len().saturating_sub(1)))
}

fn of_cohort(cohort: &CohortTarget, request: &ExtendRequest, monitor: &dyn Monitor) -> Result<Outcome<ExtendDocument>> {
    let measurements = cohort::read(&cohort.request.paths, &[], &Ok, monitor)?;
    let out = cohort.out(COHORT_OUT);
    let places = study_directories(&measurements, out)?;
    let (mut records, mut is_sound) = (Vec::new(), true);
    for (number, (measurement, place)) in measurements.iter().zip(&places).enumerate() {
        let name = measurement.name();
        monitor.stage(&format!("{name} ({} of {})", number + 1, measurements.len()));
        if let Some(revision) = find_revision_with_effects(place, &request.effects)? {
            records.push(ExtendedRecord { name, revision, extension: None });
            continue;
        }
        let path = if Study::is_study(place) { place } else { &measurement.path };
        let study_out = (!Study::is_study(path)).then(|| place.clone());
        let one = TargetRequest { paths: vec![path.clone()], out: study_out, ..cohort.request.clone() };
        let outcome = CreepTarget::open(one, None, monitor)
            .and_then(|target| of_creep(&target, request, monitor))
            .map_err(|error| measurement.with_name(error))?;
        if let (true, Some(study)) = (request.pages, &outcome.study)
            && let Err(error) = pages::write(study.dir(), None)
        {
            monitor.warn(&format!("no report: {error}"));
        }
        is_sound &= outcome.is_sound;
        let extension = outcome.document.body;
        records.push(ExtendedRecord { name, revision: extension.revision.clone(), extension: Some(extension) });
    }
    let hashes =
        measurements.iter().map(|measurement| (measurement.name(), measurement.inputs_sha256.clone())).collect();
    let provenance = Provenance::new("cohort-extension", 1, request.sampler.seed, hashes);
    let document = WithProvenance { provenance, body: ExtendDocument::Cohort { records } };
    Ok(Outcome { document, is_sound, written: out.to_path_buf(), study: None })
}

/// Study directory of each record: the given study itself, or a subdirectory of `out` with the record's name.
fn study_directories(measurements: &[Measurement], out: &Path) -> Result<Vec<PathBuf>> {
    let place = |measurement: &Measurement| {
        if Study::is_study(&measurement.path) { measurement.path.clone() } else { out.join(measurement.name()) }
    };
    let places: Vec<PathBuf> = measurements.iter().map(place).collect();
    match (0..places.len()).find(|k| places[..*k].contains(&places[*k])) {
        Some(second) => Err(Error::input(
            InputPlace::file(&measurements[second].path),
            format!("another record's directory is also called {}", measurements[second].name()),
            format!("give the directories different names, or extend one record by itself with `{}`", Setting::Out),
        )),
        None => Ok(places),
    }
}

/// Name of the study's last revision if its model already has all the effects; otherwise `None`.
fn find_revision_with_effects(place: &Path, effects: &[String]) -> Result<Option<String>> {
    if !Study::is_study(place) {
        return Ok(None);
    }
    let study = Study::open(place)?;
    let Some(last) = study.revisions()?.pop() else { return Ok(None) };
    let model = ModelSpecification::of_revision(&study.revision_dir(&last)?, &Library::default())?;
    Ok(effects.iter().all(|slug| model.effects.contains(slug)).then_some(last))
}

/// Options for extending a model and comparing the extended model with the model before.
pub struct ExtensionRequest<'a> {
    /// Name of the revision that is extended.
    pub from: &'a str,
    /// Name of the revision that is made.
    pub revision: &'a str,
    /// Names (slugs) of the effects to add.
    pub effects: &'a [String],
    /// Parameters to fix at a value or to free. Each setting applies to both models, before and after the extension, if they have the parameter.
    pub values: Assignments,
    /// Number of earlier extensions that were scored on the last cycle.
    pub earlier: usize,
    /// Settings of the sampler.
    pub options: SamplerOptions,
}

impl Default for ExtensionRequest<'_> {
    /// Options for an extension from m0 to m1 without any effects.
    fn default() -> Self {
        let (values, options) = (Assignments::new(), SamplerOptions::default());
        Self { from: "m0", revision: "m1", effects: &[], values, earlier: 0, options }
    }
}

/// Extended model with its posterior, and the comparison with the model before the extension.
pub struct Extension {
    /// Document of the result, for people and scripts.
    pub summary: ExtensionSummary,
    /// Extended model with the experiment, of which all cycles except the last are fitted.
    pub problem: Problem,
    /// Posterior of the model after the extension.
    pub after: SampleResult,
}

/// Adds effects to a model specification.
///
/// # Errors
/// [`Error::Input`] if the model already has one of the effects, or the library does not have it.
pub fn add_effects(
    specification: &ModelSpecification,
    effects: &[String],
    library: &Library,
) -> Result<ModelSpecification> {
    let refuse =
        |found: String, remedy: String| Err(Error::input(InputPlace::setting(Setting::Effects), found, remedy));
    let mut model = specification.clone();
    if effects.is_empty() {
        return refuse(
            "no effect is named".into(),
            format!("name one or more effects, as in `{} clock-offset`", Setting::Effects),
        );
    }
    for (index, slug) in effects.iter().enumerate() {
        if effects[..index].contains(slug) {
            return refuse(format!("`{slug}` is named twice"), "name it once".into());
        }
        if library.get(slug).is_none() {
            let slugs = library.effects().iter().map(|effect| effect.slug());
            let near = base::units::nearest_name(slug, slugs);
            let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
            return refuse(
                format!("`{slug}` is not available"),
                format!("{hint}`vitreo-uq effects` lists the available effects"),
            );
        }
        if model.effects.contains(slug) {
            let remedy = format!("leave this effect out, or extend an earlier revision with `{}`", Setting::Revision);
            return refuse(format!("the model has `{slug}` already"), remedy);
        }
        model.effects.push(slug.clone());
    }
    Ok(model)
}

/// Models before and after an extension, each with the experiment. Both are fitted and scored on the same cycles.
pub struct ModelPair {
    /// Model before the extension.
    pub base: Problem,
    /// Model after the extension.
    pub after: Problem,
    /// `true` if the model before the extension equals that of the stored revision: the request fixes or frees none of its parameters.
    pub is_before_as_stored: bool,
    /// Stored posterior of the model before the extension, fitted to all cycles except the last; `None` if none is stored.
    pub posterior_before: Option<PosteriorSummary>,
    /// Surrogate that an earlier run stored, and that may be usable for both models.
    pub kept_surrogate: Option<KeptSurrogate>,
}

/// Prepares the models before and after an extension for their comparison. `before` is the model to extend, joined with the entire experiment.
///
/// # Errors
/// As [`add_effects`]; [`Error::Input`] for effects that cannot be combined.
pub fn prepare_comparison(before: &Problem, request: &ExtensionRequest, library: &Library) -> Result<ModelPair> {
    let mut specification = before.specification.clone();
    let parameter_specs = before.parameters();
    let mut of_both = request.values.clone();
    of_both.retain(|name, _| parameter_specs.iter().any(|spec| spec.name == name));
    specification.set(&of_both);
    let mut larger = add_effects(&specification, request.effects, library)?;
    larger.set(&request.values);
    let experiment = before.experiment.for_comparison();
    Ok(ModelPair {
        is_before_as_stored: of_both.is_empty(),
        base: before.with_experiment(experiment.clone(), specification, library)?,
        after: before.with_experiment(experiment, larger, library)?,
        posterior_before: None,
        kept_surrogate: None,
    })
}

/// Samples the models before and after an extension on equal cycles, and compares their errors on the last cycle.
///
/// # Errors
/// As [`sample::run`].
pub fn refit(pair: ModelPair, request: &ExtensionRequest, monitor: &dyn Monitor) -> Result<Extension> {
    let (problem, kept) = (pair.after, pair.kept_surrogate);
    let sampled = |problem: &Problem, kept_surrogate| {
        let request =
            SampleRequest { options: request.options.clone(), kept_surrogate, checkpoint: None, resume: false };
        sample::run(problem, &request, monitor)
    };
    let (base, kept) = match pair.posterior_before {
        Some(base) => (base, kept),
        None => {
            monitor.stage(&format!("the model of {}, refitted on the same cycles", request.from));
            let base = sampled(&pair.base, kept)?;
            let kept = base.model.to_keep()?;
            (base.summary, kept)
        }
    };
    monitor.stage(&format!("the model with {}", request.effects.join(", ")));
    let after = sampled(&problem, kept)?;
    let mut summary = summarise_extension(&problem, request, &base, &after.summary);
    summary.answers = split_modes(&problem, request.effects, &after.columns);
    summary.sentence.push_str(&modes_in_words(&summary.answers));
    Ok(Extension { summary, problem, after })
}

fn summarise_extension(
    problem: &Problem,
    request: &ExtensionRequest,
    base: &PosteriorSummary,
    after: &PosteriorSummary,
) -> ExtensionSummary {
    let (before, now) = (errors(base), errors(after));
    ExtensionSummary {
        experiment: problem.experiment.specimen_id.clone(),
        revision: request.revision.into(),
        from: request.from.into(),
        effects: request.effects.to_vec(),
        model: after.model.clone(),
        fitted_cycles: problem.experiment.calibration_cycles.clone(),
        heldout_cycles: problem.experiment.heldout_cycles.clone(),
        noise_um: after.heldout.noise_um,
        before,
        after: now,
        parameters: after.parameters.clone(),
        converged: base.converged && after.converged,
        answers: Vec::new(),
        equivalents: Vec::new(),
        trust: trust(base, after),
        sentence: sentence(&request.effects.join(" and "), before, now, &Scoring::of(problem, request, after)),
        warnings: after.warnings.clone(),
    }
}

/// Level of trust in the extended model. It is untrusted if the draws of the model before have not converged.
fn trust(base: &PosteriorSummary, after: &PosteriorSummary) -> Trust {
    if base.converged || !after.trust.is_sound() {
        return after.trust.clone();
    }
    let reason =
        "the draws of the model before the extension have not converged, so the comparison is not valid".into();
    Trust { level: TrustLevel::Untrusted, reason }
}

/// Finds the first parameter of the added effects whose posterior has two modes. Returns both modes, or an empty list. The search uses the coordinate in
/// which the parameter's prior is standard normal.
fn split_modes(problem: &Problem, effects: &[String], columns: &[DrawColumn]) -> Vec<ExtensionMode> {
    let is_added = |name: &str| {
        effects.iter().any(|slug| name.strip_prefix(slug.as_str()).is_some_and(|rest| rest.starts_with('.')))
    };
    for (prior, column) in problem.priors.priors().iter().zip(columns).filter(|(prior, _)| is_added(&prior.name)) {
        let natural: Vec<f64> = draws_for_modes(column.values.len()).map(|draw| column.values[draw]).collect();
        let points: Vec<Vec<f64>> =
            natural.iter().map(|x| vec![to_normal_coordinate(&prior.distribution, *x), *x]).collect();
        let draws = WeightedDraws::new(points, &vec![0.0; natural.len()]);
        let Some(bottom) = find_density_valley(&draws, |point| point[0]) else { continue };
        let side = |is_on: &dyn Fn(f64) -> bool| {
            let part = draws.restricted_to(|point| is_on(point[0]));
            let quantiles = part.quantiles(|point| point[1], &[0.05, 0.95]);
            ExtensionMode {
                parameter: prior.name.clone(),
                probability: draws.mean(|point| f64::from(u8::from(is_on(point[0])))),
                mean: part.mean(|point| point[1]),
                q05: quantiles[0],
                q95: quantiles[1],
            }
        };
        let mut sides = vec![side(&|u| u < bottom), side(&|u| u >= bottom)];
        sides.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        return sides;
    }
    Vec::new()
}

fn modes_in_words(answers: &[ExtensionMode]) -> String {
    let digits = |value: f64| format_significant(value, 3);
    let of = |answer: &ExtensionMode| {
        let ExtensionMode { parameter, probability, mean, q05, q95 } = answer;
        format!(
            "{parameter} = {} ({} to {} at 90 %) with probability {probability:.2}",
            digits(*mean),
            digits(*q05),
            digits(*q95)
        )
    };
    let each: Vec<String> = answers.iter().map(of).collect();
    if each.is_empty() { String::new() } else { format!(" The posterior has two modes: {}.", each.join(", or ")) }
}

/// Noise and counts that decide whether a change of the held-out error is significant.
struct Scoring {
    noise_um: Option<f64>,
    n_scored: usize,
    /// Number of earlier extensions that were scored on this cycle.
    earlier: usize,
}

impl Scoring {
    fn of(problem: &Problem, request: &ExtensionRequest, after: &PosteriorSummary) -> Self {
        let scored = problem.positions_of(&problem.experiment.heldout_cycles);
        let n_scored = scored.iter().flatten().count();
        Self { noise_um: after.heldout.noise_um, n_scored, earlier: request.earlier }
    }
}

/// Smallest change of an error that counts as significant, in standard errors. A root mean square over n positions has a relative standard error of
/// 1/√(2n).
const CHANGE_IN_ERRORS: f64 = 2.0;

/// Sentence that tells how the extension changes the held-out error.
fn sentence(effects: &str, before: ModelErrors, after: ModelErrors, scoring: &Scoring) -> String {
    let noise = scoring.noise_um.map_or(String::new(), |noise| format!(" (noise {noise:.3} µm)"));
    let (Some(was), Some(is)) = (before.rmse_heldout_um, after.rmse_heldout_um) else {
        return format!(
            "With {effects} the error on the fitted cycles goes from {:.3} to {:.3} µm{noise}. No cycle is held out, so the change is at most suggestive.",
            before.rmse_fitted_um, after.rmse_fitted_um
        );
    };
    let uncertain_um = CHANGE_IN_ERRORS * was.min(is) / (2.0 * scoring.n_scored.max(1) as f64).sqrt();
    let verb = if (was - is).abs() < uncertain_um {
        "does not change by more than its uncertainty"
    } else if is < was {
        "falls"
    } else {
        "rises"
    };
    let times = match scoring.earlier {
        0 => "This cycle scores an extension of the study for the first time.".to_string(),
        n => format!(
            "The same cycle has already scored {n} earlier revision{} of this study.",
            if n == 1 { "" } else { "s" }
        ),
    };
    format!(
        "With {effects} the error on the last held-out cycle {verb}: {was:.3} µm before, {is:.3} µm after{noise}. {times}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_claim_what_was_scored() {
        let misfit = |fitted, heldout| ModelErrors { rmse_fitted_um: fitted, rmse_heldout_um: heldout };
        let say = |was: f64, is: f64, earlier: usize| {
            let scoring = Scoring { noise_um: Some(4.0), n_scored: 200, earlier };
            sentence("x", misfit(9.0, Some(was)), misfit(4.0, Some(is)), &scoring)
        };
        let scored = say(10.0, 4.1, 0);
        assert!(scored.contains("falls: 10.000 µm before, 4.100 µm after (noise 4.000 µm)"), "{scored}");
        assert!(
            scored.contains("for the first time")
                && say(10.0, 4.1, 2).contains("has already scored 2 earlier revisions")
        );
        assert!(say(4.0, 10.0, 0).contains("rises"));
        // For an error of 4 µm over 200 positions, two standard errors are 0.4 µm.
        assert!(say(4.3, 4.0, 0).contains("does not change") && say(4.5, 4.0, 0).contains("falls"));
        let scoring = Scoring { noise_um: None, n_scored: 0, earlier: 0 };
        assert!(sentence("x", misfit(9.0, None), misfit(4.0, None), &scoring).contains("at most suggestive"));
    }

    /// Draws in two clusters give two modes with their probabilities, also for a positive parameter. Draws in one cluster give no separate modes.
    #[test]
    fn two_heaps_of_draws_are_two_answers() {
        let (experiment, _) = posterior::replica::embedded().expect("embedded");
        let effects = ["instantaneous-elasticity".to_string()];
        let specification = ModelSpecification { effects: effects.to_vec(), ..ModelSpecification::default() };
        let problem = Problem::new(experiment, specification, None, &posterior::monitor::SilentMonitor).expect("sound");
        let place =
            problem.priors.names().position(|name| name.starts_with("instantaneous-elasticity.")).expect("sampled");
        let prior = problem.priors.priors()[place].distribution;
        let columns = |heap: &dyn Fn(usize) -> f64| -> Vec<DrawColumn> {
            let of = |d: usize| {
                let value = |k: usize| {
                    let spread = ((k as f64 * 0.618).fract() - 0.5) * 0.06;
                    prior.quantile(if d == place { heap(k) + spread } else { 0.5 + spread })
                };
                DrawColumn { n_ensembles: 1, n_steps: 400, n_walkers: 10, values: (0..4_000).map(value).collect() }
            };
            (0..problem.priors.priors().len()).map(of).collect()
        };
        let two = split_modes(&problem, &effects, &columns(&|k| if k % 10 < 3 { 0.9 } else { 0.1 }));
        assert_eq!(two.len(), 2);
        // For 2,000 draws, the standard error of a probability is 0.01. The tolerance is five standard errors.
        assert!((two[0].probability - 0.7).abs() < 0.05 && two[0].q95 < two[1].q05, "{two:?}");
        assert!(modes_in_words(&two).contains(", or instantaneous-elasticity."), "{}", modes_in_words(&two));
        assert!(split_modes(&problem, &effects, &columns(&|_| 0.4)).is_empty());
        assert_eq!(modes_in_words(&[]), "");
    }

    #[test]
    fn an_effect_is_added_once() {
        let (specification, library) = (ModelSpecification::default(), Library::default());
        let slug = [library.effects()[0].slug().to_string()];
        let model = add_effects(&specification, &slug, &library).expect("it is in the library");
        assert_eq!(model.effects, slug);
        for (model, slugs) in [(&model, &slug[..]), (&specification, &["nonsense".to_string()]), (&specification, &[])]
        {
            assert!(matches!(add_effects(model, slugs, &library), Err(Error::Input { .. })), "{slugs:?}");
        }
    }
}
