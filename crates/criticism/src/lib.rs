//! Criticism of a model: where it fails, which effect it lacks, and how much the error falls when that effect is added.
//!
//! All functions work on a [`Subject`]: one experiment whose last cycle is scored and whose other cycles are fitted (formats §4). The noise consists of white errors, an
//! Ornstein–Uhlenbeck process, and a gain and an offset for each cycle. Every fit of a model estimates the noise anew. A [`Candidate`] is a model of the mean position: a
//! law with effects. It may also have columns of free amplitude, for structure that is no effect. [`Subject::fit`] finds a candidate's best parameters and noise.
//! [`Tangent`] has the linear algebra around such a fit.

mod bayes_factors;
pub mod bootstrap;
mod box_probability;
mod candidate;
mod class;
pub mod compare;
#[cfg(test)]
mod controls_tests;
pub mod criteria;
pub mod derivatives;
pub mod detectable;
pub mod diagnose;
mod document;
mod elsewhere;
pub mod evidence;
pub mod fingerprints;
mod fit;
pub mod future;
pub mod joint_fit;
mod large;
mod matched_cycles;
mod noise_bounds;
mod noise_fit;
pub mod noise_learning;
pub mod outliers;
pub mod outside;
pub mod own_errors;
pub mod predicted;
pub mod protocol;
pub mod rank;
pub mod refit;
mod request;
pub mod residual_structure;
mod score;
pub mod screen;
pub mod search;
pub mod separation;
pub mod sketch;
mod steps;
pub mod subject;
mod tangent;
#[cfg(test)]
mod test_protocols;
#[cfg(test)]
mod test_replica;
#[cfg(test)]
pub(crate) mod test_subjects;
pub mod verdict;

// Shared tests import this crate as `criticism`, as other crates do.
#[cfg(test)]
extern crate self as criticism;

pub use candidate::{Candidate, Coordinate, Free};
pub use fit::{Fitted, Search};
pub use noise_fit::NoiseValues;
pub use subject::Subject;
pub use tangent::Tangent;
