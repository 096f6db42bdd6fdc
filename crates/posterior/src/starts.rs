//! Starts of the search for a posterior's modes.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::collections::BTreeMap;

use super::fit::best_beside;
use super::fitted_rows::FittedRows;
use super::prepared::PreparedModel;
use super::problem::Problem;
use base::distribution::Distribution;
use base::error::Result;
use base::parameter::ParameterSpec;
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
/// Number of starts if an effect makes the law nonlinear.
const N_STARTS_OF_NONLINEAR: usize = 12;
/// Number of rows by which such starts are compared.
const ROWS_OF_COMPARISON: usize = 1000;
/// Number of the random stream that draws the starts. The sampler uses other streams.
const START_STREAM: u64 = u64::MAX / 2;

/// Returns the starts of the search, in the sampler's coordinates. They are drawn from the priors.
///
/// For a nonlinear law only the effect's parameters are drawn. Climbs from anywhere in the priors would train the trajectories of laws far from the record, which takes
/// minutes. Least squares moves the other parameters to their best values beside those of the effect. If the effect has one parameter, only the values that fit better than
/// their neighbours are starts.
///
/// # Errors
/// [`base::Error::Numerical`] when a log density is +∞.
pub fn starts(model: &PreparedModel, seed: u64) -> Result<Vec<Vec<f64>>> {
    let problem = &model.problem;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(START_STREAM);
    let from: Vec<Distribution> = problem.priors.names().filter_map(|name| problem.starts_of(name)).collect();
    let mut draw = || -> Vec<f64> { from.iter().map(|distribution| distribution.draw(&mut rng)).collect() };
    let Linear { of_effects, best } = best_without_nonlinear_effects(model, seed)?;
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
        natural
    };
    let mut naturals: Vec<Vec<f64>> = (0..n_starts).map(start).collect();
    if let [name] = &of_effects[..]
        && !best.is_empty()
    {
        naturals = better_than_neighbours(model, name, naturals);
    }
    let unconstrained = |natural| problem.priors.to_unconstrained(&problem.priors.ordered(natural));
    Ok(naturals.into_iter().map(unconstrained).collect())
}

/// Moves the other parameters of each start to their best values beside the parameter `name`, and keeps the starts that fit at least as well as those with the next smaller
/// and the next larger value of this parameter.
fn better_than_neighbours(model: &PreparedModel, name: &str, mut naturals: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let (problem, priors) = (&model.problem, &model.problem.priors);
    let specs = problem.model.parameters();
    let drawn = priors.names().position(|own| own == name);
    let held = specs.iter().position(|spec| spec.name == name);
    let (Some(drawn), Some(held)) = (drawn, held) else { return naturals };
    naturals.sort_by(|a, b| a[drawn].total_cmp(&b[drawn]));
    let rows = FittedRows::new(problem).thinned(ROWS_OF_COMPARISON);
    let moved = |natural: &Vec<f64>| {
        let value = |spec: &ParameterSpec| {
            let sampled = priors.names().zip(natural).find(|(name, _)| *name == spec.name).map(|(_, value)| *value);
            sampled.or_else(|| problem.specification.fixed.get(spec.name).copied()).unwrap_or(f64::NAN)
        };
        let start: Vec<f64> = specs.iter().map(value).collect();
        let (parameters, squares) = best_beside(model, &BTreeMap::from([(held, natural[drawn])]), &start, &rows)?;
        let of_name = |name: &str| specs.iter().position(|spec| spec.name == name).map(|j| parameters[j]);
        let values = priors.names().zip(natural).map(|(name, value)| of_name(name).unwrap_or(*value));
        Some((values.collect(), squares))
    };
    let found: Vec<(Vec<f64>, f64)> = naturals.par_iter().filter_map(moved).collect();
    if found.is_empty() {
        return naturals;
    }
    let squares = |k: usize| found.get(k).map_or(f64::INFINITY, |(_, squares)| *squares);
    let is_lowest = |k: &usize| squares(*k) <= squares(k.wrapping_sub(1)) && squares(*k) <= squares(k + 1);
    (0..found.len()).filter(is_lowest).map(|k| found[k].0.clone()).collect()
}

/// Best model without nonlinear effects; empty if the model has no such effects, or no maximum without them.
#[derive(Default)]
struct Linear {
    /// Names of the sampled parameters of the nonlinear effects.
    of_effects: Vec<&'static str>,
    /// Name and best value of every other parameter.
    best: Vec<(String, f64)>,
}

fn best_without_nonlinear_effects(model: &PreparedModel, seed: u64) -> Result<Linear> {
    let Some((of_effects, linear)) = without_nonlinear_effects(&model.problem) else { return Ok(Linear::default()) };
    let linear = model.for_problem(linear);
    let modes = find_modes(&linear.posterior(), &starts(&linear, seed)?)?;
    let priors = &linear.problem.priors;
    let best = modes.iter().next().map(|mode| priors.from_unconstrained(&mode.location));
    Ok(Linear { of_effects, best: priors.names().map(String::from).zip(best.into_iter().flatten()).collect() })
}

/// Names of the sampled parameters of nonlinear effects, and the problem with these fixed at the values without the effect; `None` without such parameters.
fn without_nonlinear_effects(problem: &Problem) -> Option<(Vec<&'static str>, Problem)> {
    let scales = problem.model.scales();
    let is_sampled = |name: &str| problem.priors.get(name).is_some();
    let of_effect = |effect: &&'static dyn Effect| {
        effect.parameters().iter().filter(|parameter| is_sampled(parameter.spec.name)).map(|parameter| {
            let null = (parameter.null)(scales);
            (parameter.spec.name, null.unwrap_or_else(|| problem.range_of(parameter.spec.name, 0.5).lower))
        })
    };
    let nonlinear = problem.model.effects().iter().filter(|effect| effect.is_nonlinear());
    let fixed: Vec<(&'static str, f64)> = nonlinear.flat_map(of_effect).collect();
    let names: Vec<&'static str> = fixed.iter().map(|(name, _)| *name).collect();
    let mut linear = problem.clone();
    linear.priors = problem.priors.without(&names);
    linear.specification.fixed.extend(fixed.iter().map(|(name, value)| (name.to_string(), *value)));
    (!names.is_empty()).then_some((names, linear))
}
