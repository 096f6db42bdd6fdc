//! Species and regions: how groups of specimens differ, and how sure that is.

pub mod alone;
pub mod apparatus;
pub mod artefacts;
pub mod cohort;
pub mod contrast;
#[cfg(test)]
mod coverage_tests;
pub mod design;
pub mod figures;
pub mod hierarchy;
#[cfg(test)]
mod hierarchy_tests;
pub mod interim;
pub mod job;
pub mod learnt;
pub mod missing;
pub mod plan;
pub mod predict;
pub mod published;
pub mod scale;
pub mod spread;
pub mod summary;
pub mod wording;

pub use design::{Design, Labels};
