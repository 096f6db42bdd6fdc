//! Species and regions: how groups of specimens differ, and what a cohort of specimens lacks.
//!
//! Groups: [`cohort::read`] reads experiments and studies with their labels; [`apparatus`] solves one finite-element problem
//! for each apparatus, since quasi-static linear laws need no more of it; [`interim`] samples every experiment alone and keeps
//! its draws by hash; [`job::run`] samples the population. A pilot run shows which experiments have too few draws; their
//! likelihoods then take the place of the draws. [`hierarchy`] knows an experiment as draws or as a density, and nothing else.
//!
//! A cohort's missing effect ([`missing`]): `criticism::sketch` turns a record into scores, cosines and simulated scores; a
//! common law of sizes joins them; gains are judged against simulated cohorts. Everything after the sketch works without the
//! records, except the refits of a claim.

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
