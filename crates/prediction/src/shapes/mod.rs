//! The paper's study of robot shapes: resistance of a sphere, an ellipsoid and a cylinder that move along or across their axis.

pub mod artefacts;
pub mod bodies;
pub mod claims;
mod figures;
pub mod job;
pub mod large;
pub mod predictors;
pub mod summary;
