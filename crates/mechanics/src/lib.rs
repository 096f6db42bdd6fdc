//! The mechanics of vitreo-uq: what was measured, laws and effects, finite elements, and what stands for them.
//!
//! Modules stand in the order in which data flow; each uses only those before it.
//!
//! - [`error`]: one error type, with file, line and remedy
//! - [`files`]: all reading and writing of files
//! - [`units`]: unit suffixes
//! - [`parameter`]: what a parameter is
//! - [`elementary`]: exponentials and logarithms of many numbers at once
//! - [`number`]: dual numbers, and what kernels compute with
//! - [`distribution`]: distributions of priors
//! - [`toml_input`]: TOML whose every value knows its line
//! - [`experiment`]: what was measured: apparatus, force, positions, cycles
//! - [`rheology`]: laws of springs, dashpots and springpots, as spectra
//! - [`stages`]: what a model computes from command to camera, as numbers
//! - [`mesh`]: meshes of the gel
//! - [`fe`]: full finite elements
//! - [`effects`]: physical effects, one file each
//! - [`model`]: law, effects and apparatus: parameters to trajectory
//! - [`surrogate`]: what stands for a full model, certified

pub mod distribution;
pub mod effects;
pub mod elementary;
pub mod error;
pub mod experiment;
pub mod fe;
pub mod files;
pub mod mesh;
pub mod model;
pub mod number;
pub mod parameter;
pub mod rheology;
pub mod stages;
pub mod surrogate;
pub mod toml_input;
pub mod units;

pub use error::{Error, Result};
