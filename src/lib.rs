//! Bayesian uncertainty quantification for creep experiments in soft gels.
//!
//! # Quick start
//!
//! ```
//! use vitreo_uq::posterior::study::ModelSpecification;
//! use vitreo_uq::posterior::problem::Problem;
//! use vitreo_uq::posterior::monitor::SilentMonitor;
//! use vitreo_uq::posterior::{fit, replica};
//!
//! // `Experiment::read("my-experiment".as_ref())` reads your own.
//! let (experiment, _) = replica::embedded()?;
//! let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor)?;
//! let fit = fit::run(&problem, None, &SilentMonitor)?.summary;
//! for parameter in &fit.parameters {
//!     println!("{} = {:.3}", parameter.name, parameter.value);
//! }
//! // The residual is the replica's noise of 4 µm.
//! assert!(fit.converged && (3.5..4.5).contains(&fit.rmse_um));
//! # Ok::<(), vitreo_uq::Error>(())
//! ```
//!
//! [`posterior::sample`] samples the posterior, [`criticism`] finds misfits and missing effects, [`jobs::extend`] adds effects.
//!
//! | to add your own | see |
//! |---|---|
//! | law | `examples/custom_law.rs` |
//! | effect | `examples/custom_effect.rs` |
//! | effect that changes the displacement field | `examples/custom_field_effect.rs` |
//! | forward model, under the ensemble sampler alone | `examples/custom_forward_model.rs` |
//!
//! # Map
//!
//! Every crate uses only crates that this list names before it.
//!
//! - [`base`]: errors, files, units, parameters, distributions
//! - [`containers`]: workbooks, array files and tracker files as text
//! - [`record`]: experiments and tables of measurements
//! - [`laws`]: viscoelastic laws, and the stages of a model
//! - [`elements`]: meshes and full finite elements
//! - [`models`]: physical effects, full and reduced models
//! - [`sampling`]: ensembles, diagnostics, evidence, optimisation; independent of gels
//! - [`documents`]: plain types of all written documents
//! - [`figures`]: drawings and pages; reads documents
//! - [`posterior`]: priors, noise, likelihood, the prepared model, its posterior
//! - [`criticism`]: misfits of a model, and missing effects
//! - [`learning`]: functions that a law lacks, learnt from records
//! - [`cohorts`]: groups of specimens, and effects that a cohort lacks
//! - [`validation`]: challenges, calibration
//! - [`prediction`]: robots under uncertainty, sensitivity, force plans, shapes
//! - [`intake`]: descriptions of tables of measurements, for `init`
//! - [`jobs`]: the function behind every command

pub use base;
pub use cohorts;
pub use containers;
pub use criticism;
pub use documents;
pub use elements;
pub use figures;
pub use intake;
pub use jobs;
pub use laws;
pub use learning;
pub use models;
pub use posterior;
pub use prediction;
pub use record;
pub use sampling;
pub use validation;

pub use base::{Error, Result};

/// Version of the program, with a hash of its sources. The program runs and joins only task lists that contain an equal text.
pub const PROGRAM: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("VITREO_UQ_PROGRAM"));
