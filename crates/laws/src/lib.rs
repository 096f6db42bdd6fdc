//! Viscoelastic laws with their retardation spectra, and the equations of a model from the commanded force to the recorded
//! position.

pub mod rheology;
pub mod stages;
