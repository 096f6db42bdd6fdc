//! Bayesian uncertainty quantification for creep experiments in soft gels.
//!
//! # Quick start
//!
//! ```
//! use vitreo_uq::study::ModelSpecification;
//! use vitreo_uq::workflow::problem::Problem;
//! use vitreo_uq::workflow::{Silent, fit, replica};
//!
//! // `Experiment::read("my-experiment".as_ref())` reads your own.
//! let (experiment, _) = replica::embedded()?;
//! let problem = Problem::new(experiment, ModelSpecification::default(), None, &Silent)?;
//! let fit = fit::run(&problem, None, &Silent)?.summary;
//! for parameter in &fit.parameters {
//!     println!("{} = {:.3}", parameter.name, parameter.value);
//! }
//! // What is left is the replica's noise of 4 µm.
//! assert!(fit.converged && (3.5..4.5).contains(&fit.rmse_um));
//! # Ok::<(), vitreo_uq::Error>(())
//! ```
//!
//! [`workflow::sample`] samples the posterior, [`critique`] says where the model fails and what it lacks, [`workflow::extend`] adds it.
//!
//! | to bring your own | see |
//! |---|---|
//! | law | `examples/custom_law.rs` |
//! | effect | `examples/custom_effect.rs` |
//! | effect that changes the displacement field | `examples/custom_field_effect.rs` |
//! | forward model, under the ensemble sampler alone | `examples/custom_forward_model.rs` |
//!
//! # Map
//!
//! Modules stand in the order in which data flow; each uses only those before it.
//!
//! - [`error`]: one error type, with file, line and remedy
//! - [`files`]: all reading and writing of files
//! - [`units`]: unit suffixes
//! - [`parameter`]: what a parameter is
//! - `elementary`: exponentials and logarithms of many numbers at once
//! - [`number`]: dual numbers, and what kernels compute with
//! - [`distribution`]: distributions of priors
//! - `toml_input`: TOML whose every value knows its line
//! - [`experiment`]: what was measured: apparatus, force, positions, cycles
//! - [`rheology`]: laws of springs, dashpots and springpots, as spectra
//! - [`stages`]: what a model computes from command to camera, as numbers
//! - [`mesh`]: meshes of the gel
//! - [`fe`]: full finite elements
//! - [`effects`]: physical effects, one file each
//! - [`model`]: law, effects and apparatus: parameters to trajectory
//! - [`surrogate`]: what stands for a full model, certified
//! - [`inference`]: priors, likelihood, noise, ensembles, evidence
//! - [`documents`]: what commands write: plain types
//! - [`report`]: figures, CSV, NetCDF
//! - [`page`]: pages for a browser
//! - [`study`]: what is kept on disk
//! - [`workflow`]: the jobs of `sample`, `fit`, `simulate`, `effects`, `extend`, `ladder`, `report`
//! - [`sweep`]: oscillations of a rheometer
//! - [`critique`]: where a model fails and what it lacks; challenges
//! - [`learn`]: which quantity depends on which state, as the data have it
//! - [`shapes`]: the study of robot shapes
//! - [`groups`]: species and regions compared
//! - [`tasks`]: lists of tasks for many machines, and their results joined
//! - [`schemas`]: JSON Schemas of the documents

pub mod critique;
pub mod groups;
pub mod learn;
pub mod schemas;
pub mod shapes;
pub mod study;
pub mod sweep;
pub mod tasks;
pub mod workflow;

pub use vitreo_uq_figures::{documents, page, report};
pub use vitreo_uq_inference::inference;
use vitreo_uq_mechanics::toml_input;
pub use vitreo_uq_mechanics::{
    Error, Result, distribution, effects, error, experiment, fe, files, mesh, model, number, parameter, rheology,
    stages, surrogate, units,
};
