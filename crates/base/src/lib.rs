//! Errors, files, units, parameters and distributions: the basis of every other crate.

pub mod distribution;
pub mod elementary;
pub mod error;
pub mod files;
pub mod number;
pub mod parameter;
pub mod toml_input;
pub mod units;

pub use error::{Error, Result};
