//! Effects that a protocol cannot distinguish, found before any fit of data.

use nalgebra::DVector;
use rayon::prelude::*;

use crate::NoiseValues;
use crate::noise_fit::natural;
use crate::separation::{RivalFit, RivalTruth};
use crate::{Candidate, Subject};
use base::error::{Error, Result};

/// Absolute cosine above which two signatures are equal to first order.
const SAME_COSINE: f64 = 1.0 - 1e-6;
/// Distance (σ) below which two models are equal.
const SAME_SIGMA: f64 = 0.1;
/// Fraction of a signature's squared norm that the law leaves unabsorbed, below which the signature is invisible.
const LEAST_VISIBLE: f64 = 1e-7;
/// Step from the null, in search coordinates, at which signatures are computed.
const SIGNATURE_STEP: f64 = 0.02;
/// Step from the null at which two effects are compared, in search coordinates.
const COMPARED_STEP: f64 = 0.3;

/// Effects that a protocol cannot distinguish at any size, or a single effect that the law's parameters absorb.
#[derive(Debug, Clone, PartialEq)]
pub struct Degeneracy {
    /// Slugs of the effects.
    pub effects: Vec<String>,
    /// Sentence on the finding.
    pub sentence: String,
}

/// An effect added to the base, with the base's parameters at the middle of their priors.
struct Added {
    slug: &'static str,
    candidate: Candidate,
    null: Vec<f64>,
    /// Index of the effect's size among the coordinates, and the sign of its step.
    place: usize,
    sign: f64,
    /// Whitened signature of the effect without the part that the law absorbs; `None` if the law absorbs all of it.
    visible: Option<DVector<f64>>,
}

impl Added {
    fn at(&self, step: f64) -> Vec<f64> {
        let mut theta = self.null.clone();
        theta[self.place] = self.candidate.free[self.place].clamped(theta[self.place] + self.sign * step);
        theta
    }
}

/// Finds effects that a subject's protocol cannot distinguish, at the middle of the law's priors. The noise is white, of the known or estimated size; no prior contributes.
///
/// Degenerate effects fulfil two numerical conditions. Their signatures are parallel once the law has absorbed its part. Their models fit each other's noise-free data to
/// a tenth of a standard deviation, in both directions.
///
/// # Errors
/// [`Error::Numerical`] if the base has no solution at the middle of its priors.
pub fn exact_degeneracies(subject: &Subject) -> Result<Vec<Degeneracy>> {
    let base = subject.base();
    let middle: Vec<f64> = base.free.iter().map(|free| free.null.unwrap_or_else(|| free.quantile(0.5))).collect();
    let position_m = subject.trajectory_m(&base, &middle)?;
    let noise = natural(&subject.noise_prior().white());
    let truth = RivalTruth { candidate: &base, theta: &middle, noise, position_m: &position_m };
    let made = subject.library().effects().par_iter().map(|effect| match subject.extended(&[effect.slug()]) {
        Ok(candidate) => Ok(added(subject, effect.slug(), candidate, &truth)),
        Err(Error::Input { .. }) => Ok(None),
        Err(other) => Err(other),
    });
    let effects: Vec<Added> = made.collect::<Result<Vec<_>>>()?.into_iter().flatten().collect();
    let mut list = Vec::new();
    for hidden in effects.iter().filter(|added| added.visible.is_none()) {
        if fits_data_of(subject, &base, hidden, noise) {
            list.push(Degeneracy {
                effects: vec![hidden.slug.into()],
                sentence: format!("this protocol does not show {}: it only changes the law's parameters", hidden.slug),
            });
        }
    }
    list.extend(classes(subject, &effects, noise));
    Ok(list)
}

/// Groups of effects that the protocol cannot distinguish: every effect of a group equals at least one other effect of it.
fn classes(subject: &Subject, effects: &[Added], noise: NoiseValues) -> Vec<Degeneracy> {
    let pairs: Vec<(usize, usize)> =
        (0..effects.len()).flat_map(|i| (i + 1..effects.len()).map(move |j| (i, j))).collect();
    let is_same = |(i, j): &(usize, usize)| {
        let (a, b) = (&effects[*i], &effects[*j]);
        let (Some(of_a), Some(of_b)) = (&a.visible, &b.visible) else { return false };
        of_a.dot(of_b).abs() > SAME_COSINE * of_a.norm() * of_b.norm()
            && fits_data_of(subject, &b.candidate, a, noise)
            && fits_data_of(subject, &a.candidate, b, noise)
    };
    let same: Vec<(usize, usize)> = pairs.into_par_iter().filter(is_same).collect();
    let mut class: Vec<usize> = (0..effects.len()).collect();
    for (i, j) in same {
        let (into, from) = (class[i], class[j]);
        class.iter_mut().filter(|c| **c == from).for_each(|c| *c = into);
    }
    let members = |c: usize| -> Vec<String> {
        (0..effects.len()).filter(|i| class[*i] == c).map(|i| effects[i].slug.to_string()).collect()
    };
    let groups = (0..effects.len()).map(members).filter(|group| group.len() > 1);
    let named = |effects: Vec<String>| Degeneracy {
        sentence: format!("this protocol cannot distinguish {} at any size", effects.join(" and ")),
        effects,
    };
    groups.map(named).collect()
}

fn added(subject: &Subject, slug: &'static str, candidate: Candidate, base: &RivalTruth) -> Option<Added> {
    let last = candidate.effects.len().checked_sub(1)?;
    let place = candidate.free.iter().position(|free| free.effect == Some(last) && free.null.is_some())?;
    let null = candidate.embed(base.candidate, base.theta);
    let free = &candidate.free[place];
    let sign = if null[place] + COMPARED_STEP > free.ends[1] { -1.0 } else { 1.0 };
    let mut made = Added { slug, null, place, sign, visible: None, candidate };
    made.visible = {
        let imitation = RivalFit::new(subject, &made.candidate, base).without_priors();
        let (left, fraction) = imitation.left(&made.null, &made.at(SIGNATURE_STEP))?;
        (fraction > LEAST_VISIBLE).then_some(left)
    };
    Some(made)
}

/// Returns whether a model fits the noise-free data of an effect, up to [`SAME_SIGMA`].
fn fits_data_of(subject: &Subject, other: &Candidate, truth: &Added, noise: NoiseValues) -> bool {
    let theta = truth.at(COMPARED_STEP);
    let Ok(position_m) = subject.trajectory_m(&truth.candidate, &theta) else { return false };
    let truth = RivalTruth { candidate: &truth.candidate, theta: &theta, noise, position_m: &position_m };
    RivalFit::new(subject, other, &truth).without_priors().best(None).is_ok_and(|closest| closest.distance < SAME_SIGMA)
}
