//! Models with equivalent effects: effects that the diagnosis of a record cannot distinguish from those of a revision.

use base::error::Result;
use models::effects::Library;
use posterior::monitor::Monitor;
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;
use posterior::sample::{SampleRequest, sample};
use posterior::study::Study;
use prediction::ensemble::Draws;
use sampling::SamplerOptions;

use crate::equivalents::revision_equivalents;
use crate::first_revision::kept_surrogate;

/// Number of posterior draws of a model with an equivalent effect.
const N_DRAWS: usize = 1_000;

/// Model of a revision in which an equivalent effect replaces the claimed ones, with draws of its posterior.
pub struct Rival {
    /// Name of the equivalent effect.
    pub effect: String,
    /// The model.
    pub problem: Problem,
    /// Draws of its posterior.
    pub draws: Draws,
}

/// Samples the models with the equivalents of a revision's effects, fitted to all cycles but the last held-out one.
///
/// # Errors
/// Errors of the models and of the sampler.
pub fn rivals(
    study: &Study,
    revision: &str,
    problem: &Problem,
    options: &SamplerOptions,
    monitor: &dyn Monitor,
) -> Result<Vec<Rival>> {
    let mut list = Vec::new();
    for class in revision_equivalents(study, revision)? {
        for effect in &class.rivals {
            let mut specification = problem.specification.clone();
            specification.effects.retain(|slug| !class.effects.contains(slug));
            specification.effects.push(effect.clone());
            let of_removed = |name: &String| class.effects.iter().any(|slug| name.starts_with(&format!("{slug}.")));
            specification.fixed.retain(|name, _| !of_removed(name));
            specification.freed.retain(|name| !of_removed(name));
            monitor.stage(&format!("sampling the model with {effect}, which this record cannot distinguish"));
            let problem =
                problem.with_experiment(problem.experiment.for_comparison(), specification, &Library::default())?;
            let prepared = PreparedModel::unverified(&problem, kept_surrogate(study, monitor), monitor)?;
            let posterior = prepared.posterior();
            let request =
                SampleRequest { options: options.clone(), kept_surrogate: None, checkpoint: None, resume: false };
            let outcome = sample(&prepared, &posterior, &request, monitor)?;
            let draws = Draws {
                source: format!("{} with {effect}", problem.experiment.specimen_id),
                names: problem.parameters().iter().map(|spec| spec.name.to_string()).collect(),
                values: outcome.draws.subsample(N_DRAWS).iter().map(|point| posterior.natural(point)).collect(),
                other_specimens: Vec::new(),
            };
            list.push(Rival { effect: effect.clone(), draws, problem: problem.clone() });
        }
    }
    Ok(list)
}
