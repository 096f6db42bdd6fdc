//! Bayesian uncertainty quantification for creep experiments in soft gels.
//!
//! Data flow in one direction; a module uses only those above it in this list:
//! [`error`] and [`units`] → [`experiment`] (what was measured) → [`mesh`] → [`fe`] (full-order model)
//! → [`rheology`] (creep laws) → [`model`] (law + apparatus → trajectory) → [`surrogate`] (reduced model)
//! → [`inference`] (priors, likelihood, sampler, diagnostics) → [`study`] (what is kept on disk)
//! → [`report`] (figures and exchange formats) → [`workflow`] (the jobs) → [`critique`] (where a model fails, what it lacks).

pub mod distribution;
mod document;
pub mod effects;
mod elementary;
pub mod error;
pub mod experiment;
pub mod files;
pub mod groups;
pub mod shapes;

pub mod critique;
pub mod fe;
pub mod inference;
pub mod mesh;
pub mod model;
pub mod number;
pub mod parameter;
pub mod report;
pub mod rheology;
pub mod schemas;
pub mod study;
pub mod surrogate;
pub mod units;
pub mod workflow;

pub use error::{Error, Result};
