//! Priors of a model's parameters: the prior file's, else what the law, the effect or the noise proposes for the experiment.

use crate::effects::{Library, NUISANCES};
use crate::error::Result;
use crate::inference::noise::{NoiseModel, NoiseScales};
use crate::inference::prior::{Prior, PriorSet};
use crate::model::Model;
use crate::parameter::{NOISE_SD, ParameterSpec, RELATIVE_NOISE};
use crate::rheology::BaseLaw;

/// Priors of all parameters of a model by a prior's name or file.
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

/// The default prior of a parameter of the errors, by the medians of the priors before it.
pub(crate) type ErrorPrior<'a> = &'a dyn Fn(&ParameterSpec, &dyn Fn(&str) -> f64) -> Option<Prior>;

/// The same with errors of another kind than a record's.
pub(crate) fn read_priors_with(
    name_or_file: &str,
    model: &Model,
    of_errors: &[ParameterSpec],
    prior_of_error: ErrorPrior<'_>,
    library: &Library,
) -> Result<PriorSet> {
    let scales = model.scales();
    // What is declared with a law is not the prior file's to change, whatever it is called.
    let n_declared = model.base().outside().map_or(0, |law| law.parameters().len());
    let wanted: Vec<ParameterSpec> = model.parameters()[n_declared..].iter().chain(of_errors).copied().collect();
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
        let own = all.flat_map(|effect| effect.parameters()).find(|p| p.spec == *spec);
        if let Some(parameter) = own {
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
        if let Some((distribution, source)) = law {
            let (name, unit, source) = (spec.name.into(), spec.unit.into(), source.into());
            return Some(Prior { name, distribution, unit, source });
        }
        prior_of_error(spec, &median_of)
    };
    let rest = PriorSet::read_for(name_or_file, &wanted, &others, &default)?;
    let declared: Vec<Prior> = model.parameters()[..n_declared].iter().filter_map(|spec| default(spec, &[])).collect();
    if declared.is_empty() {
        return Ok(rest);
    }
    let names: Vec<&str> = rest.names().collect();
    Ok(rest.without(&names).with(&declared).with(rest.priors()))
}

#[cfg(test)]
#[path = "model_priors_tests.rs"]
mod tests;
