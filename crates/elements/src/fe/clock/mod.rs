//! Common parts of all time steppers: step lengths and the coefficients of the methods.

mod steps;
mod tableau;

pub(crate) use steps::{Grading, StepRule, fit_step_to_stop, share_of_gap};
pub use tableau::Scheme;
pub use tableau::{FOURTH, Tableau};

/// Fraction of the record's length below which the difference of two times counts as zero.
pub const CLOCK_ROUNDING: f64 = 1e-13;
