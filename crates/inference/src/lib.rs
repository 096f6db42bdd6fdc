//! Bayesian inference for vitreo-uq: priors, likelihoods, noise, ensembles, evidence, diagnostics.

pub mod inference;

use vitreo_uq_mechanics::{
    Error, Result, distribution, effects, elementary, error, experiment, files, model, number, parameter, rheology,
    toml_input, units,
};
