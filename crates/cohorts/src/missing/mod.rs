//! What specimens lack together: the diagnosis of a cohort.
//!
//! One record may show an effect at two standard deviations; twenty of them prove it or refute it. Every record is read once ([`criticism::sketch`]): what it
//! says of each effect to first order, and what it would say by chance. Everything else is done with these few numbers:
//! [`likelihood`] → [`law`] (a common law of sizes) → [`scan`] (one effect over the cohort) → [`judge`] (gains, and p by simulated cohorts) → [`class`] (what looks alike) → [`refit`] (the
//! claim fitted to every record) → [`compare`] (its sizes in groups) → [`job`].

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
