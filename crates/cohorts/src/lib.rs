//! Comparison of species and regions by groups of specimens, and diagnosis of a cohort's missing effect.
//!
//! Comparison of groups: [`cohort::read`] reads experiments and studies with their labels. [`apparatus`] solves one finite-element problem for each apparatus, which
//! suffices for quasi-static linear laws. [`interim`] samples every experiment alone and keeps its draws by hash. [`job::run`] samples the population. A pilot run shows
//! which experiments have too few draws; their likelihoods then replace the draws. [`hierarchy`] treats an experiment only as draws or as a density.
//!
//! Diagnosis of a cohort ([`missing`]): `criticism::sketch` turns a record into scores, cosines and simulated scores. A common law of sizes joins the records. Gains are
//! tested against simulated cohorts. All steps after the sketch work without the records, except the refits of a claim.

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
