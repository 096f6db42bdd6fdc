//! Starting points for computing an evidence: the fit, other maxima of nearly equal height, and ridges beside them.

use rayon::prelude::*;

use super::CandidatePosterior;
use crate::{Candidate, Fitted, Search};
use posterior::prior::Prior;

/// Prior quantile at which a climb starts if the fit is at an end of the support.
const START_QUANTILE: f64 = 0.05;
/// Prior probability beyond a fitted value. Below this limit, the value counts as lying at the end of the support.
const FARTHEST_TAIL: f64 = 1e-6;
/// Number of design points in the effects' parameters. They are a Sobol sequence over the priors with the seed `START_SEED`; the design is part of the method.
const EFFECT_STARTS: u32 = 12;
const START_SEED: u32 = 11;
/// Distance (nats) below the best maximum at which another maximum, however wide, has negligible weight.
const TOP_REACH_NATS: f64 = 20.0;
/// Largest distance of two maxima that count as one, in each search coordinate; their heights must also differ by less than `SAME_TOP_NATS`.
const SAME_TOP: f64 = 0.03;
const SAME_TOP_NATS: f64 = 0.1;
const MOST_TOPS: usize = 6;
/// Distance (nats) below the best maximum at which a point of a ridge has negligible weight. A ridge is at most a few times as wide as a maximum.
const RIDGE_REACH_NATS: f64 = 8.0;

/// Keeps the local maxima of a profile along one coordinate, and their neighbours. Climbs from other points would lead to the same maxima.
fn near_local_tops(mut profile: Vec<Fitted>, coordinate: impl Fn(&Fitted) -> f64) -> Vec<Fitted> {
    profile.sort_by(|a, b| coordinate(a).total_cmp(&coordinate(b)));
    let height = |place: usize| profile[place].objective;
    let n = profile.len();
    let is_top = |place: usize| {
        (place == 0 || height(place - 1) <= height(place)) && (place + 1 == n || height(place + 1) <= height(place))
    };
    let is_near: Vec<bool> =
        (0..n).map(|place| (place.saturating_sub(1)..=(place + 1).min(n - 1)).any(is_top)).collect();
    profile.into_iter().zip(is_near).filter_map(|(point, is_near)| is_near.then_some(point)).collect()
}

/// Moves a value into the prior if the prior probability beyond it is below `tail`: fits may end at the ends of supports, where gradients vanish.
fn moved_inside(prior: &Prior, value: f64, tail: f64) -> f64 {
    let below = prior.distribution.cdf(value);
    if below < tail {
        prior.distribution.quantile(START_QUANTILE)
    } else if below > 1.0 - tail {
        prior.distribution.quantile(1.0 - START_QUANTILE)
    } else {
        value
    }
}

/// Starting points for the proposal distribution of an evidence, in natural values of the parameters.
pub struct Starts {
    /// Points from which climbs lead to maxima.
    pub climbs: Vec<Vec<f64>>,
    /// Points on ridges that are high enough to have weight. At each, one parameter of an effect is held and all others are fitted. A narrow ridge may lead so far from a
    /// maximum that draws around the maximum miss it. An example is two retardations with equal times, which share an amplitude.
    pub ridges: Vec<Vec<f64>>,
}

impl CandidatePosterior<'_> {
    /// Returns the fit, a point next to it, maxima reached from elsewhere in the priors of the effects' parameters, and ridges on the way.
    pub fn starts(&self, candidate: &Candidate, fitted: &Fitted) -> Starts {
        let (tops, ridges) = self.tops_and_ridges(candidate, fitted);
        let inside = |point: &Fitted| self.start(candidate, point, FARTHEST_TAIL);
        let mut climbs = vec![inside(fitted), self.start(candidate, fitted, START_QUANTILE)];
        climbs.extend(tops.iter().map(inside));
        Starts { climbs, ridges: ridges.iter().map(inside).collect() }
    }

    /// Makes a start from a fit. The start lies outside the prior's tails at the ends of the support, and interchangeable elements are in order.
    fn start(&self, candidate: &Candidate, point: &Fitted, tail: f64) -> Vec<f64> {
        let mut natural = candidate.parameters(&point.theta);
        natural.extend(point.noise.iter());
        let names: Vec<&str> = self.problem.parameters().iter().map(|spec| spec.name).collect();
        let value = |name: &str| names.iter().position(|known| *known == name).map_or(f64::NAN, |place| natural[place]);
        let inside = |prior: &Prior| moved_inside(prior, value(&prior.name), tail);
        self.priors().ordered(self.priors().priors().iter().map(inside).collect())
    }

    /// Finds ridges, and maxima of the fit's objective that are high enough to have weight. The search starts from a design in the effects' parameters. At each design point the
    /// law and the noise are fitted first. Then all but one of the effects' parameters are also fitted, and finally all.
    fn tops_and_ridges(&self, candidate: &Candidate, fitted: &Fitted) -> (Vec<Fitted>, Vec<Fitted>) {
        let of_effects: Vec<usize> =
            (0..candidate.free.len()).filter(|k| candidate.free[*k].effect.is_some()).collect();
        if of_effects.is_empty() {
            return (Vec::new(), Vec::new());
        }
        let on_profile = |number: u32| -> Option<Fitted> {
            let mut at_design = fitted.clone();
            for (dimension, k) in (0..).zip(&of_effects) {
                let p = 0.02 + 0.96 * f64::from(sobol_burley::sample(number, dimension, START_SEED));
                at_design.theta[*k] = candidate.free[*k].quantile(p);
            }
            self.fitted_with_held(candidate, &at_design, &of_effects)
        };
        let mut profile: Vec<Fitted> = (0..EFFECT_STARTS).into_par_iter().filter_map(on_profile).collect();
        if let (true, [only]) = (self.problem.model.is_nonlinear(), &of_effects[..]) {
            profile = near_local_tops(profile, |point| point.theta[*only]);
        }
        let mut passed = Vec::new();
        if of_effects.len() > 1 {
            let with_one_held = |(number, point): (usize, Fitted)| {
                self.fitted_with_held(candidate, &point, &[of_effects[number % of_effects.len()]])
            };
            passed = profile.into_par_iter().enumerate().filter_map(with_one_held).collect();
            profile = passed.clone();
        }
        let top = |start: Fitted| self.fitted_with_held(candidate, &start, &[]);
        let tops: Vec<Fitted> = profile.into_par_iter().filter_map(top).collect();
        let best = tops.iter().fold(fitted.objective, |best, top| best.max(top.objective));
        let tops = distinct(tops, std::slice::from_ref(fitted), best - TOP_REACH_NATS);
        passed.retain(|point| point.objective < best - SAME_TOP_NATS);
        let ridges = distinct(passed, &tops, best - RIDGE_REACH_NATS);
        (tops, ridges)
    }

    /// Fits a candidate from a point with the coordinates `held` fixed; `None` if there is no fit.
    fn fitted_with_held(&self, candidate: &Candidate, from: &Fitted, held: &[usize]) -> Option<Fitted> {
        let free: Vec<usize> = (0..candidate.free.len()).filter(|k| !held.contains(k)).collect();
        let of_rest =
            candidate.held(&from.theta, |parameter| held.iter().any(|k| candidate.free[*k].index == parameter.index));
        let start: Vec<f64> = free.iter().map(|k| from.theta[*k]).collect();
        let found = self.subject.fit(&of_rest, &[(start, from.noise)], Search::Local).ok()?;
        let mut theta = from.theta.clone();
        free.iter().zip(&found.theta).for_each(|(k, x)| theta[*k] = *x);
        Some(Fitted { theta, ..found })
    }
}

/// Returns the points whose objective is at least `lowest` and that differ from each other and from the known ones, the highest first.
fn distinct(mut points: Vec<Fitted>, known: &[Fitted], lowest: f64) -> Vec<Fitted> {
    points.sort_by(|a, b| b.objective.total_cmp(&a.objective));
    let is_same = |a: &Fitted, b: &Fitted| {
        a.theta.iter().zip(&b.theta).all(|(a, b)| (a - b).abs() < SAME_TOP)
            && (a.objective - b.objective).abs() < SAME_TOP_NATS
    };
    let mut distinct: Vec<Fitted> = Vec::new();
    for point in points.into_iter().filter(|point| point.objective > lowest) {
        if !known.iter().chain(&distinct).any(|other| is_same(other, &point)) {
            distinct.push(point);
        }
    }
    distinct.truncate(MOST_TOPS);
    distinct
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NoiseValues;

    #[test]
    fn climbs_start_at_the_tops_of_a_profile_and_beside_them() {
        let kept = |heights: &[f64]| -> Vec<f64> {
            let point = |(place, objective): (usize, &f64)| Fitted {
                theta: vec![place as f64],
                noise: NoiseValues::new([1.0; 5]),
                position_m: Vec::new(),
                objective: *objective,
                ln_likelihood: *objective,
            };
            // The order of the profile does not matter.
            let profile: Vec<Fitted> = heights.iter().enumerate().map(point).rev().collect();
            near_local_tops(profile, |point| point.theta[0]).iter().map(|point| point.theta[0]).collect()
        };
        assert_eq!(kept(&[0.0, 1.0, 2.0, 5.0, 3.0, 2.0, 1.0]), [2.0, 3.0, 4.0]);
        assert_eq!(kept(&[9.0, 1.0, 0.0, 0.5, 0.0, -1.0, -2.0, 4.0]), [0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 7.0]);
        assert_eq!(kept(&[1.0]), [0.0]);
        assert!(kept(&[]).is_empty());
    }
}
