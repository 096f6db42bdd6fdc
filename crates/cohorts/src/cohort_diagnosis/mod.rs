//! Diagnosis of a cohort: the effect that its specimens lack together.
//!
//! One record may show an effect at two standard deviations; twenty records prove or refute it. [`criticism::sketch`] reads every record once. It gives first-order scores
//! of each effect, and the scores that arise by chance. All further steps use these few numbers:
//!
//! 1. [`likelihood`]: likelihood of an effect's size in one record
//! 2. [`law`]: common law of sizes
//! 3. [`scan`]: one effect over the cohort
//! 4. [`judge`]: gains, and p by simulated cohorts
//! 5. [`class`]: rivals of the claim
//! 6. [`refit`]: the claim fitted to every record
//! 7. [`compare`]: sizes of the claim in groups
//! 8. [`job`]: the whole diagnosis

pub mod apparatus;
pub mod artefacts;
pub mod class;
#[cfg(test)]
mod cohort_tests;
pub mod compare;
pub mod job;
pub mod judge;
pub mod law;
pub mod likelihood;
pub mod refit;
pub mod scan;
mod wording;
