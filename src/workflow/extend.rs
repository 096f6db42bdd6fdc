//! The next revision of a study: an effect added, both models refitted on all cycles but the last, the last one scored (contracts §4).

use serde::{Deserialize, Serialize};

use super::Monitor;
use super::problem::Problem;
use super::sample::{self, SampleRequest, SampleResult};
use super::summary::{ModelSummary, ParameterSummary, PosteriorSummary, Warning};
use crate::effects::Library;
use crate::error::{Error, Place, Result};
use crate::inference::SamplerOptions;
use crate::study::ModelSpecification;

/// Body of `vitreo-uq/extension/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExtensionSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The revision that was written.
    pub revision: String,
    /// The revision that was extended.
    pub from: String,
    /// The effects that were added.
    pub effects: Vec<String>,
    /// The whole model.
    pub model: ModelSummary,
    /// Cycles that both models were fitted to.
    pub fitted_cycles: Vec<u32>,
    /// Cycles that both models are scored on.
    pub heldout_cycles: Vec<u32>,
    /// The noise that misfits are measured against, in µm.
    pub noise_um: Option<f64>,
    /// The model without the added effects.
    pub before: Misfit,
    /// The model with them.
    pub after: Misfit,
    /// Posterior of the extended model's parameters.
    pub parameters: Vec<ParameterSummary>,
    /// Whether both posteriors have converged.
    pub converged: bool,
    /// What the figures say.
    pub sentence: String,
    /// What the user should know of the extended model.
    pub warnings: Vec<Warning>,
}

/// Root mean square distance of the posterior mean from the positions, by full finite elements, in µm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Misfit {
    /// On the fitted cycles.
    pub rmse_fitted_um: f64,
    /// On the cycle that was held out; `None` if there is none.
    pub rmse_heldout_um: Option<f64>,
}

impl ExtensionSummary {
    /// Whether the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        self.converged && !self.warnings.iter().any(|warning| warning.kind.is_fatal())
    }
}

/// What a caller decides.
pub struct ExtensionRequest<'a> {
    /// Name of the revision to extend.
    pub from: &'a str,
    /// Name of the revision to make.
    pub revision: &'a str,
    /// Slugs to add.
    pub effects: &'a [String],
    /// The sampler's settings.
    pub options: SamplerOptions,
}

/// What the job led to.
pub struct Extension {
    /// The document for people and scripts.
    pub summary: ExtensionSummary,
    /// The extended model, joined with the experiment as it was fitted here.
    pub problem: Problem,
    /// Its posterior.
    pub after: SampleResult,
}

/// The specification with effects added.
///
/// # Errors
/// [`Error::Input`] when one of them is there already or is not in the library.
pub fn extended(
    specification: &ModelSpecification,
    effects: &[String],
    library: &Library,
) -> Result<ModelSpecification> {
    let refuse = |found: String, remedy: String| Err(Error::input(Place::option("--with"), found, remedy));
    let mut model = specification.clone();
    if effects.is_empty() {
        return refuse("no effect is named".into(), "name one or more, as in `--with clock-offset`".into());
    }
    for slug in effects {
        if library.get(slug).is_none() {
            let slugs = library.effects().iter().map(|effect| effect.slug());
            let near = crate::units::nearest_name(slug, slugs);
            let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
            return refuse(format!("there is no effect `{slug}`"), format!("{hint}`vitreo-uq effects` lists them"));
        }
        if model.effects.contains(slug) {
            let remedy = "leave it out, or extend an earlier revision with `--from`";
            return refuse(format!("the model has `{slug}` already"), remedy.into());
        }
        model.effects.push(slug.clone());
    }
    Ok(model)
}

/// Samples the model of `before` and the extended one on the same cycles.
///
/// `before` is the model to extend, of the whole experiment; which cycles are fitted and scored is decided here.
///
/// # Errors
/// As [`extended`], [`sample::run`].
pub fn run(
    before: &Problem,
    request: &ExtensionRequest,
    library: &Library,
    monitor: &dyn Monitor,
) -> Result<Extension> {
    let specification = extended(&before.specification, request.effects, library)?;
    let before = before.for_comparison(library)?;
    // What cannot stand together is refused here, before anything is computed.
    let problem = before.with_model(specification, library)?;
    let sampled = |problem: &Problem, kept_surrogate| {
        let request =
            SampleRequest { options: request.options.clone(), kept_surrogate, checkpoint: None, resume: false };
        sample::run(problem, &request, monitor)
    };
    monitor.stage(&format!("the model of {}, refitted on the same cycles", request.from));
    let base = sampled(&before, None)?;
    let kept = base.reduced.to_keep(&before)?;
    monitor.stage(&format!("the model with {}", request.effects.join(", ")));
    let after = sampled(&problem, kept)?;
    let summary = summarise(&problem, request, &base.summary, &after.summary);
    Ok(Extension { summary, problem, after })
}

fn summarise(
    problem: &Problem,
    request: &ExtensionRequest,
    base: &PosteriorSummary,
    after: &PosteriorSummary,
) -> ExtensionSummary {
    let misfit = |summary: &PosteriorSummary| Misfit {
        rmse_fitted_um: summary.heldout.rmse_fitted_um,
        rmse_heldout_um: summary.heldout.rmse_um,
    };
    let (before, now) = (misfit(base), misfit(after));
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
        sentence: sentence(&request.effects.join(" and "), before, now, after.heldout.noise_um),
        warnings: after.warnings.clone(),
    }
}

/// What the figures say, and no more.
fn sentence(effects: &str, before: Misfit, after: Misfit, noise_um: Option<f64>) -> String {
    let noise = noise_um.map_or(String::new(), |noise| format!(" (noise {noise:.3} µm)"));
    match (before.rmse_heldout_um, after.rmse_heldout_um) {
        (Some(was), Some(is)) => {
            let verb = if is < was { "falls" } else { "does not fall" };
            format!(
                "With {effects} the error on the held-out cycle {verb}: {was:.3} µm before, {is:.3} µm after{noise}. One cycle was scored, once."
            )
        }
        _ => format!(
            "With {effects} the error on the fitted cycles goes from {:.3} to {:.3} µm{noise}. No cycle is held out, so this is suggestive at most.",
            before.rmse_fitted_um, after.rmse_fitted_um
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_claim_what_was_scored() {
        let misfit = |fitted, heldout| Misfit { rmse_fitted_um: fitted, rmse_heldout_um: heldout };
        let scored = sentence("x", misfit(9.0, Some(10.0)), misfit(4.0, Some(4.1)), Some(4.0));
        assert!(scored.contains("falls: 10.000 µm before, 4.100 µm after (noise 4.000 µm)"), "{scored}");
        let worse = sentence("x", misfit(9.0, Some(4.0)), misfit(4.0, Some(4.1)), None);
        assert!(worse.contains("does not fall"), "{worse}");
        assert!(sentence("x", misfit(9.0, None), misfit(4.0, None), None).contains("suggestive"));
    }

    #[test]
    fn an_effect_is_added_once() {
        let (specification, library) = (ModelSpecification::default(), Library::default());
        let slug = [library.effects()[0].slug().to_string()];
        let model = extended(&specification, &slug, &library).expect("it is in the library");
        assert_eq!(model.effects, slug);
        for (model, slugs) in [(&model, &slug[..]), (&specification, &["nonsense".to_string()]), (&specification, &[])]
        {
            assert!(matches!(extended(model, slugs, &library), Err(Error::Input { .. })), "{slugs:?}");
        }
    }
}
