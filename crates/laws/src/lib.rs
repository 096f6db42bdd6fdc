//! Viscoelastic laws as retardation spectra, and the stages of a model as numbers.

pub mod rheology;
pub mod stages;
