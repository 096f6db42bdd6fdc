//! What an experiment cannot tell from a claim.

use super::Subject;
use super::refit::Refitted;
use super::search::{Found, replacements};
use super::separation::{SEPARATED_SIGMA, distance};
use base::error::{Error, Result};

/// Models whose rank is within so many nats of the claim are within reach of the data.
const REACH_NATS: f64 = 6.0;

/// An effect that stands for one of the claim as well as it does itself, and the model in which it does.
pub(super) struct Equivalent {
    pub slug: &'static str,
    pub model: Refitted,
}

/// Effects within reach of the data that this experiment does not separate from one of the claim.
pub(super) fn class_of(subject: &Subject, found: &Found, claimed: &Refitted) -> Result<Vec<Equivalent>> {
    let rank = |model: &Refitted| model.gain_over(&found.base, subject).rank;
    let best = rank(claimed);
    let mut class: Vec<Equivalent> = Vec::new();
    for (slug, model) in replacements(subject, found, claimed) {
        if class.iter().any(|own| own.slug == slug) || best - rank(&model) > REACH_NATS {
            continue;
        }
        // A model that cannot come near the claim at all stands apart from it.
        let apart = match distance(subject, &model.candidate, (&claimed.candidate, &claimed.fitted)) {
            Err(Error::Numerical { .. }) => f64::INFINITY,
            other => other?,
        };
        if apart < SEPARATED_SIGMA {
            class.push(Equivalent { slug, model });
        }
    }
    Ok(class)
}
