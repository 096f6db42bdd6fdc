//! Errors, files, units, parameters and distributions, which every other crate uses.

pub mod distribution;
pub mod elementary;
pub mod error;
pub mod files;
pub mod number;
pub mod parameter;
pub mod quantities;
pub mod sha256;
pub mod toml_input;
pub mod units;

pub use error::{Error, Result};
