//! Species and regions: how groups of specimens differ, and how sure that is.

pub mod design;
pub mod hierarchy;
#[cfg(test)]
mod hierarchy_tests;

pub use design::{Design, Labels};
