//! Common parts of all time stepping: lengths of steps, coefficients of methods.

mod steps;
mod tableau;

pub(crate) use steps::{Grading, StepRule, fit_step_to_stop, share_of_gap};
pub use tableau::Scheme;
pub use tableau::{FOURTH, Tableau};

/// Times that differ by less than this share of the record's length count as equal.
pub const CLOCK_ROUNDING: f64 = 1e-13;
