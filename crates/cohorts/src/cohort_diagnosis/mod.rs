//! Diagnosis of a cohort: finds the effect that the models of all its specimens lack.
//!
//! If each record shows an effect at only two standard deviations, twenty records together prove or refute it. [`criticism::sketch`] reads each record
//! once. It computes first-order scores of each effect in the record, and in records simulated without effects. The simulated scores show which scores
//! arise by chance. The search uses only these scores; fits of the claimed effect use the records again:
//!
//! 1. [`likelihood`]: likelihood of an effect's size in one record
//! 2. [`law`]: common distribution of an effect's sizes (size law)
//! 3. [`scan`]: likelihood ratios of one effect in all records of the cohort
//! 4. [`judge`]: gains in log likelihood by all effects, and their p-values from simulated cohorts
//! 5. [`class`]: rivals of the claimed effect
//! 6. [`refit`]: fits of the claimed effect to each record
//! 7. [`compare`]: sizes of the claimed effect in groups
//! 8. [`job`]: the complete diagnosis

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
