//! Compares groups of specimens, such as species and regions, and diagnoses the missing effect of a cohort.
//!
//! Comparison of groups: [`cohort::read`] reads experiments and studies with their labels. [`apparatus`] solves one finite-element problem for each
//! apparatus, which suffices for quasi-static linear laws. [`interim`] samples each experiment alone and stores the draws under the hash of their inputs.
//! [`job::run`] samples the population. A pilot run shows which experiments have too few draws; their exact likelihoods are used instead. [`hierarchy`]
//! represents each experiment by draws or by its likelihood.
//!
//! Diagnosis of a cohort ([`cohort_diagnosis`]): `criticism::sketch` converts each record to scores of the effects, cosines between their signatures, and
//! scores of simulated records. The sizes of an effect in all records have a common distribution. Gains are tested against simulated cohorts. After the
//! conversion to scores, only fits of single effects need the records.

pub mod alone;
pub mod apparatus;
pub mod artefacts;
pub mod cohort;
pub mod cohort_diagnosis;
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
pub mod plan;
pub mod predict;
pub mod published;
pub mod scale;
pub mod spread;
pub mod summary;
pub mod wording;

pub use design::{Design, Labels};
