//! Starts of the search for a posterior's modes.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::prepared::PreparedModel;
use super::problem::Problem;
use base::distribution::Distribution;
use base::error::Result;
use laws::rheology::BaseLaw;
use models::effects::Effect;
use sampling::optimum::find_modes;

/// Number of starts if the model is the Lethersich law alone.
const N_STARTS: usize = 16;
/// Number of starts for all other models. Similar elements of a model can exchange their roles, which gives several modes. Only few of the starts may lead to the
/// highest mode.
const N_STARTS_OF_LARGER: usize = 96;
/// Number of starts if the law is Lethersich's and the model has effects of the displacement field. No elements exchange their roles then, and each climb takes seconds.
const N_STARTS_OF_FIELD: usize = 24;
/// Number of starts if an effect makes the law nonlinear. They differ in the effect's parameters only.
const N_STARTS_OF_NONLINEAR: usize = 12;
/// Number of the random stream that draws the starts. The sampler uses other streams.
const START_STREAM: u64 = u64::MAX / 2;

/// Returns the starts of the search, in the sampler's coordinates. They are drawn from the priors.
///
/// For a nonlinear law only the effect's parameters are drawn, and the others have their best values without the effect. Climbs from anywhere in the priors would train
/// the trajectories of laws far from the record, which takes minutes.
///
/// # Errors
/// [`base::Error::Numerical`] when a log density is +∞.
pub fn starts(model: &PreparedModel, seed: u64) -> Result<Vec<Vec<f64>>> {
    let problem = &model.problem;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(START_STREAM);
    let from: Vec<Distribution> = problem.priors.names().filter_map(|name| problem.starts_of(name)).collect();
    let mut draw = || -> Vec<f64> { from.iter().map(|distribution| distribution.draw(&mut rng)).collect() };
    let best = best_without_nonlinear_effects(model, seed)?;
    let effects = problem.model.effects();
    let n_starts = match problem.model.base() {
        _ if !best.is_empty() => N_STARTS_OF_NONLINEAR,
        BaseLaw::Lethersich if problem.model.is_law_alone() => N_STARTS,
        BaseLaw::Lethersich if effects.iter().all(|effect| effect.changes_field()) => N_STARTS_OF_FIELD,
        _ => N_STARTS_OF_LARGER,
    };
    let start = |_| {
        let mut natural = draw();
        for (value, name) in natural.iter_mut().zip(problem.priors.names()) {
            if let Some((_, at_best)) = best.iter().find(|(known, _)| known == name) {
                *value = *at_best;
            }
        }
        problem.priors.to_unconstrained(&problem.priors.ordered(natural))
    };
    Ok((0..n_starts).map(start).collect())
}

/// Best value of every parameter in the model without its nonlinear effects, by name; empty if the model has no such effects, or no maximum without them.
fn best_without_nonlinear_effects(model: &PreparedModel, seed: u64) -> Result<Vec<(String, f64)>> {
    let Some(linear) = without_nonlinear_effects(&model.problem) else { return Ok(Vec::new()) };
    let linear = model.for_problem(linear);
    let modes = find_modes(&linear.posterior(), &starts(&linear, seed)?)?;
    let priors = &linear.problem.priors;
    let best = modes.iter().next().map(|mode| priors.from_unconstrained(&mode.location));
    Ok(priors.names().map(String::from).zip(best.into_iter().flatten()).collect())
}

/// The problem with the parameters of its nonlinear effects fixed at the values without the effect; `None` if they cannot be.
fn without_nonlinear_effects(problem: &Problem) -> Option<Problem> {
    let scales = problem.model.scales();
    let is_sampled = |name: &str| problem.priors.get(name).is_some();
    let of_effect = |effect: &&'static dyn Effect| {
        effect.parameters().iter().filter(|parameter| is_sampled(parameter.spec.name)).map(|parameter| {
            let null = (parameter.null)(scales);
            (parameter.spec.name, null.unwrap_or_else(|| problem.range_of(parameter.spec.name, 0.5).lower))
        })
    };
    let nonlinear = problem.model.effects().iter().filter(|effect| effect.is_nonlinear());
    let fixed: Vec<(&str, f64)> = nonlinear.flat_map(of_effect).collect();
    let names: Vec<&str> = fixed.iter().map(|(name, _)| *name).collect();
    let mut linear = problem.clone();
    linear.priors = problem.priors.without(&names);
    linear.specification.fixed.extend(fixed.iter().map(|(name, value)| (name.to_string(), *value)));
    (!names.is_empty()).then_some(linear)
}
