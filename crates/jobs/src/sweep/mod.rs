//! Oscillations of a rheometer: infers a law from moduli at several frequencies, and finds effects that the law lacks.
//!
//! [`problem`] makes a log-density from data, law and priors. [`job`] samples the posterior. [`noise_like`] tests whether the residuals of a fit are
//! noise. [`diagnose`] compares the law with laws that have one more effect. [`joint`] samples a law that several records of one specimen share.
//! [`artefacts`] writes a revision.
//!
//! The complex shear modulus is G*(ω) = E*(ω)/(2 + 2ν), where E* is the law's complex Young's modulus and ν Poisson's ratio (physics §2). No finite
//! elements or reduced model are needed.

pub mod artefacts;
pub mod diagnose;
pub mod job;
pub mod joint;
pub mod noise_like;
pub mod problem;
mod spectrum;

#[cfg(test)]
mod tests;
