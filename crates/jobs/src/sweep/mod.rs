//! Oscillations of a rheometer: the posterior of a law from moduli against frequency, and what the law lacks.
//!
//! [`problem`] joins data, law and priors into a log-density; [`noise_like`] asks whether what a fit leaves is noise; [`job`] samples; [`diagnose`] compares with laws that have an effect more;
//! [`artefacts`] writes a revision; [`joint`] samples a law that several records of one specimen share. G*(ω) = E*(ω)/(2 + 2ν) with the complex modulus of the law (physics §2), so neither finite elements nor a reduced model is needed.

pub mod artefacts;
pub mod diagnose;
pub mod job;
pub mod joint;
pub mod noise_like;
pub mod problem;

#[cfg(test)]
mod tests;
