//! Rivals of a claim: models in which another effect replaces one effect of the claim.

use super::Subject;
use super::criteria::Criteria;
use super::refit::Refitted;
use super::search::{SearchResult, replacements};
use super::separation::distance;
use super::verdict::Rival;
use base::error::{Error, Result};

/// Fits the rivals of a claim and returns them with their models. A rival's deficit (nats) is the claim's rank less its own rank. A rival with a small enough deficit also
/// gets its distance from the claim, in standard deviations of the noise.
pub(super) fn fit_rivals(
    subject: &Subject,
    criteria: &Criteria,
    found: &SearchResult,
    claimed: &Refitted,
) -> Result<Vec<(Rival, Refitted)>> {
    let rank = |model: &Refitted| model.gain_over(&found.base, subject).rank;
    let best = rank(claimed);
    let mut rivals: Vec<(Rival, Refitted)> = Vec::new();
    for (slug, model) in replacements(subject, found, claimed) {
        // A rival that replaces several effects of the claim is listed once.
        if rivals.iter().any(|(rival, _)| rival.effect == slug && criteria.is_equivalent(rival)) {
            continue;
        }
        let deficit_nats = best - rank(&model);
        let mut rival = Rival { effect: slug.into(), deficit_nats, separation_sigma: None, lead_p: None };
        if criteria.is_equivalent(&rival) {
            // If the rival's model cannot be fitted to the claim at all, its distance is infinite.
            let apart = match distance(subject, &model.candidate, (&claimed.candidate, &claimed.fitted)) {
                Err(Error::Numerical { .. }) => f64::INFINITY,
                other => other?,
            };
            rival.separation_sigma = Some(apart);
        }
        rivals.push((rival, model));
    }
    Ok(rivals)
}
