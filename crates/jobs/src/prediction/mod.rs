//! `predict` and `plan`: robots in a gel whose parameters come from a study, a comparison of groups or a prior.

pub mod foresight;
mod gel_source;
pub mod plan;
pub mod predict;
mod rivals;

pub use gel_source::{GelPlace, draws_of_revision, is_groups, study_warnings};
