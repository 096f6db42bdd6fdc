//! Oscillations of a rheometer: infers a law from moduli over frequency, and finds effects that the law lacks.
//!
//! [`problem`] joins data, law and priors into a log-density. [`noise_like`] tests a fit's residuals, and [`job`] samples.
//! [`diagnose`] compares the law with laws that have one more effect. [`artefacts`] writes a revision.
//! [`joint`] samples a law that several records of one specimen share. G*(ω) = E*(ω)/(2 + 2ν), where E* is the law's complex modulus (physics §2).
//! No finite elements or reduced model are needed.

pub mod artefacts;
pub mod diagnose;
pub mod job;
pub mod joint;
pub mod noise_like;
pub mod problem;

#[cfg(test)]
mod tests;
