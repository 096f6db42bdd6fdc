//! Physical effects, and the full and the reduced model of an experiment.

pub mod effects;
pub mod model;
pub mod surrogate;

/// Hash of the code of all mechanics; reduced models that were made by other code are not used.
pub const SOURCE_HASH: &str = env!("VITREO_UQ_MECHANICS");
