//! Priors of a model's parameters, read from the prior file. A parameter without a table in this file has a default from its law, effect or noise, which may depend on
//! the experiment.

use crate::noise::{NoiseModel, NoiseScales};
use crate::prior::{Prior, PriorSet};
use base::distribution::Distribution;
use base::error::Result;
use base::parameter::{NOISE_SD, ParameterSpec, RELATIVE_NOISE};
use laws::rheology::BaseLaw;
use models::effects::{Effect, Library, NUISANCES, Stage};
use models::model::Model;

/// Built-in prior for any gel, and the logarithmic standard deviation of its numbers.
const GENERIC_PRIOR: &str = "generic";
const GENERIC_LOG_SD: f64 = 3.5;
/// Orders of springpots beside that prior.
const GENERIC_ORDERS: (f64, f64) = (0.005, 0.995);

/// Reads the priors of all parameters of a model. `name_or_file` names a built-in prior or a prior file.
pub(super) fn read_priors(name_or_file: &str, model: &Model, noise: NoiseModel, library: &Library) -> Result<PriorSet> {
    let scales = model.scales();
    let of_noise = |spec: &ParameterSpec, median_of: &dyn Fn(&str) -> f64| {
        let noise_scales = NoiseScales {
            noise_sd_um: median_of(NOISE_SD.name),
            sample_interval_s: scales.sample_interval_s,
            cycle_s: scales.cycle_s,
        };
        noise.default_priors(&noise_scales).into_iter().find(|prior| prior.name == spec.name)
    };
    read_priors_with(name_or_file, model, &noise.parameters(), &of_noise, library)
}

/// Function that returns the default prior of a noise parameter. Its second argument returns the prior median of an earlier parameter, by name.
pub(crate) type ErrorPrior<'a> = &'a dyn Fn(&ParameterSpec, &dyn Fn(&str) -> f64) -> Option<Prior>;

/// Reads the priors of all parameters of a model, with the parameters `of_errors` of its measurement errors. These need not belong to a [`NoiseModel`].
pub fn read_priors_with(
    name_or_file: &str,
    model: &Model,
    of_errors: &[ParameterSpec],
    prior_of_error: ErrorPrior<'_>,
    library: &Library,
) -> Result<PriorSet> {
    let scales = model.scales();
    let wanted: Vec<ParameterSpec> = model.parameters().iter().chain(of_errors).copied().collect();
    let of_laws = BaseLaw::NAMED.into_iter().flat_map(BaseLaw::parameters).map(|p| p.name);
    let of_effects =
        library.effects().iter().chain(NUISANCES).flat_map(|effect| effect.parameters()).map(|p| p.spec.name);
    let of_noises = NoiseModel::known_parameters().map(|p| p.name);
    let known = of_laws.chain(of_effects).chain(of_noises).chain([RELATIVE_NOISE.name]);
    let is_wanted = |name: &&str| wanted.iter().any(|spec| spec.name == *name);
    let mut others: Vec<&str> = known.filter(|name| !is_wanted(name)).collect();
    others.sort_unstable();
    others.dedup();
    let default = |spec: &ParameterSpec, before: &[Prior]| {
        let all = model.nuisances().iter().chain(model.effects());
        let effect_parameter = all.flat_map(|effect| effect.parameters()).find(|p| p.spec == *spec);
        if let Some(parameter) = effect_parameter {
            return Some(Prior {
                name: spec.name.into(),
                distribution: (parameter.prior)(scales),
                unit: spec.unit.into(),
                source: parameter.prior_source.into(),
            });
        }
        let median_of = |name: &str| {
            let prior = before.iter().find(|prior| prior.name == name);
            prior.map_or(1.0, |prior| prior.distribution.quantile(0.5))
        };
        let law = model.base().default_prior(spec.name, &median_of);
        if let Some((mut distribution, mut source)) = law {
            // Beside a prior for any gel, the default priors of a law are as wide as that prior.
            match (&mut distribution, name_or_file) {
                (Distribution::LogNormal { log_sd, .. }, GENERIC_PRIOR) => {
                    *log_sd = GENERIC_LOG_SD;
                    source = "chosen: as wide as the generic prior, a factor of 33 for one standard deviation";
                }
                (Distribution::Uniform { lower, upper }, GENERIC_PRIOR) => {
                    (*lower, *upper) = GENERIC_ORDERS;
                    source = "chosen: all orders but those of a spring (0) and of a dashpot (1)";
                }
                _ => {}
            }
            let (name, unit, source) = (spec.name.into(), spec.unit.into(), source.into());
            return Some(Prior { name, distribution, unit, source });
        }
        prior_of_error(spec, &median_of)
    };
    let priors = PriorSet::read_for(name_or_file, &wanted, &others, &default)?;
    // An effect of the mechanics may act on only one of several equal elements of the law. The elements are then not interchangeable.
    let is_of_law = |effect: &&dyn Effect| effect.stage() == Stage::Mechanics;
    let changes_law = model.effects().iter().any(is_of_law);
    Ok(if changes_law { priors } else { priors.with_order(model.base().interchangeable_parts()) })
}

#[cfg(test)]
#[path = "model_priors_tests.rs"]
mod tests;
