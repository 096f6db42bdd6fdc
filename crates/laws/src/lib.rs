//! Viscoelastic laws with their retardation spectra, and the equations of a model's stages.

pub mod rheology;
pub mod stages;
