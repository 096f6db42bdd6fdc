//! `predict` and `plan`: robots in a gel whose parameters a study or a comparison of groups has taught.

pub mod foresight;
mod gel_source;
pub mod plan;
pub mod predict;
mod rivals;

pub use gel_source::{GelPlace, is_groups};
