//! Mixture of several proposals, each for a different region of the posterior.
//!
//! One map cannot straighten two modes at once, because their ridges are curved differently. The draws are therefore also split by their nearest
//! mode. A group with enough draws gets its own map and mixture. A group with too few draws keeps its mode's Laplace approximation, so that no known
//! mode is lost. The better of the two descriptions, one proposal or several, has the larger Σ w ln q, with w the draws' weights and q the proposal
//! density. Up to a constant, this sum is the negative Kullback–Leibler divergence.

use super::proposal::Proposal;
use super::weighted::effective_size;
use crate::ensemble::RandomStream;
use crate::optimum::{Mode, Modes};
use crate::t_mixture::TMixture;

/// Smallest effective number of draws per coordinate for fitting a proposal to a mode's draws.
const DRAWS_PER_COORDINATE: f64 = 8.0;
/// Smallest weight of a proposal in a mixture, before the weights are normalised.
const SMALLEST_SHARE: f64 = 0.02;

/// Mixture of proposals with weights.
#[derive(Debug, Clone)]
pub struct ProposalMixture {
    /// Proposals, each after its weight. The weights add up to one.
    parts: Vec<(f64, Proposal)>,
}

impl ProposalMixture {
    /// Returns a mixture of a single proposal.
    pub fn one(proposal: Proposal) -> Self {
        Self { parts: vec![(1.0, proposal)] }
    }

    /// Returns a mixture of the modes' Laplace approximations; `None` if no curvature is usable. Each has a minimum weight, because the Laplace
    /// approximation is a poor estimate of a ridge's mass.
    pub fn of_modes(modes: &Modes, dimension: usize) -> Option<Self> {
        let part = |(mode, share): (&Mode, f64)| Some((share.max(SMALLEST_SHARE), touching(mode, dimension)?));
        let parts: Vec<(f64, Proposal)> = modes.iter().zip(modes.weights()).filter_map(part).collect();
        (!parts.is_empty()).then(|| Self::of(parts))
    }

    /// Makes a mixture and scales the weights so that they add up to one.
    fn of(mut parts: Vec<(f64, Proposal)>) -> Self {
        let total: f64 = parts.iter().map(|(share, _)| share).sum();
        parts.iter_mut().for_each(|(share, _)| *share /= total);
        Self { parts }
    }

    /// Fits one proposal, or one per mode if that fits better, to weighted points. The weights add up to one. `None` if neither can be fitted, for
    /// example because the points lie in a plane.
    pub fn fitted(points: &[Vec<f64>], weights: &[f64], modes: &Modes, stream: &mut RandomStream) -> Option<Self> {
        let one = Proposal::fitted(points, weights, stream);
        Self::best_of_single_or_split(one, points, weights, modes, stream)
    }

    /// Returns the single proposal `one`, or a mixture with one proposal per mode if the mixture fits the weighted points better.
    pub fn best_of_single_or_split(
        one: Option<Proposal>,
        points: &[Vec<f64>],
        weights: &[f64],
        modes: &Modes,
        stream: &mut RandomStream,
    ) -> Option<Self> {
        let one = one.map(Self::one);
        let several = Self::one_per_mode(points, weights, modes, stream);
        let described = |charts: &Self| -> f64 {
            let used = points.iter().zip(weights).filter(|(_, weight)| **weight > 0.0);
            used.map(|(point, weight)| weight * charts.ln_density(point)).sum()
        };
        match (one, several) {
            (Some(one), Some(several)) => Some(if described(&several) > described(&one) { several } else { one }),
            (one, several) => one.or(several),
        }
    }

    /// Fits one proposal per mode. `None` if there is only one mode, or no mode has enough draws.
    fn one_per_mode(points: &[Vec<f64>], weights: &[f64], modes: &Modes, stream: &mut RandomStream) -> Option<Self> {
        let dimension = points.first()?.len();
        if modes.len() < 2 {
            return None;
        }
        let mut members: Vec<(Vec<Vec<f64>>, Vec<f64>)> = vec![Default::default(); modes.len()];
        for (point, weight) in points.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
            let (own_points, own_weights) = &mut members[modes.nearest(point)?.0];
            own_points.push(point.clone());
            own_weights.push(*weight);
        }
        let mut parts = Vec::new();
        let mut n_fitted = 0;
        for (mode, (points, mut weights)) in modes.iter().zip(members) {
            let share: f64 = weights.iter().sum();
            weights.iter_mut().for_each(|weight| *weight /= share.max(f64::MIN_POSITIVE));
            let is_known = share > 0.0 && effective_size(&weights) >= DRAWS_PER_COORDINATE * dimension as f64;
            let fitted = is_known.then(|| Proposal::fitted(&points, &weights, stream)).flatten();
            n_fitted += usize::from(fitted.is_some());
            if let Some(proposal) = fitted.or_else(|| touching(mode, dimension)) {
                parts.push((share.max(SMALLEST_SHARE), proposal));
            }
        }
        (n_fitted > 0).then(|| Self::of(parts))
    }

    /// Returns the mixture with one more, wide proposal of weight `share`. This proposal has the mean of the weighted points, and their standard
    /// deviations multiplied by `stretch`.
    pub fn with_background(&self, points: &[Vec<f64>], weights: &[f64], share: f64, stretch: f64) -> Self {
        if let [(_, only)] = &self.parts[..] {
            return Self::one(only.with_background(points, weights, share, stretch));
        }
        let Some(whole) = TMixture::from_moments(points, weights) else { return self.clone() };
        let dimension = points.first().map_or(0, Vec::len);
        let background = Proposal::plain(whole.stretched(stretch), dimension);
        let mut parts: Vec<(f64, Proposal)> =
            self.parts.iter().map(|(part, proposal)| ((1.0 - share) * part, proposal.clone())).collect();
        parts.push((share, background));
        Self { parts }
    }

    /// Draws n points from the mixture.
    pub fn draw(&self, n: usize, dimension: usize, stream: &mut RandomStream) -> Vec<Vec<f64>> {
        if let [(_, only)] = &self.parts[..] {
            return only.draw(n, dimension, stream);
        }
        let mut one = |_| {
            let mut left = stream.unit();
            let chosen = self.parts.iter().find(|(share, _)| {
                left -= share;
                left < 0.0
            });
            let proposal = chosen.or(self.parts.last()).map(|(_, proposal)| proposal);
            proposal.map_or(Vec::new(), |proposal| proposal.draw(1, dimension, stream).swap_remove(0))
        };
        (0..n).map(&mut one).collect()
    }

    /// Normalised log density of the mixture at a point.
    pub fn ln_density(&self, x: &[f64]) -> f64 {
        if let [(_, only)] = &self.parts[..] {
            return only.ln_density(x);
        }
        let terms: Vec<f64> = self.parts.iter().map(|(share, proposal)| share.ln() + proposal.ln_density(x)).collect();
        let top = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if top == f64::NEG_INFINITY { top } else { top + terms.iter().map(|term| (term - top).exp()).sum::<f64>().ln() }
    }
}

/// Returns the proposal from a mode's Laplace approximation; `None` if the mode's curvature is unusable.
fn touching(mode: &Mode, dimension: usize) -> Option<Proposal> {
    Some(Proposal::plain(TMixture::from_modes(&Modes::from_mode(mode), dimension)?, dimension))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::Optimum;

    /// Returns draws from two ridges that are 16 apart and curved in opposite directions: x₀ = ±8 + u and x₁ = ±1.5 u² + 0.3 v, with standard normals
    /// u and v.
    fn bent(n: usize, seed: u64) -> Vec<Vec<f64>> {
        let mut stream = RandomStream::new(seed, 0);
        let mut one = |k: usize| {
            let (u, v, sign) = (stream.normal(), stream.normal(), if k.is_multiple_of(4) { -1.0 } else { 1.0 });
            vec![8.0 * sign + u, 1.5 * sign * u * u + 0.3 * v]
        };
        (0..n).map(&mut one).collect()
    }

    fn modes(locations: &[[f64; 2]]) -> Modes {
        let mut modes = Modes::default();
        for location in locations {
            let (location, precision) = (location.to_vec(), vec![1.0, 0.0, 0.0, 11.0]);
            modes.add(&Optimum { location, log_density: 0.0, precision, converged: true });
        }
        modes
    }

    /// Checks that one proposal per ridge describes independent draws better than a single map for both, by at least half a nat. The weights agree
    /// with the ridges: 4,000 draws in proportions of 1 to 3 have a standard error of 0.007 in a weight. The comparison with another 4,000 draws adds
    /// an equal error. The tolerance is six times the combined error.
    #[test]
    fn a_part_for_each_answer_describes_two_bent_ridges() {
        let (points, others) = (bent(4_000, 1), bent(4_000, 2));
        let weights = vec![1.0 / 4_000.0; 4_000];
        let both = modes(&[[-8.0, 0.0], [8.0, 0.0]]);
        let mut stream = RandomStream::new(3, 0);
        let charts = ProposalMixture::fitted(&points, &weights, &both, &mut stream).expect("spread");
        let one = Proposal::fitted(&points, &weights, &mut stream).expect("spread");
        assert_eq!(charts.parts.len(), 2);
        let mean = |of: &dyn Fn(&[f64]) -> f64| others.iter().map(|x| of(x)).sum::<f64>() / 4_000.0;
        let (several, single) = (mean(&|x| charts.ln_density(x)), mean(&|x| one.ln_density(x)));
        assert!(several > single + 0.5, "{several} {single}");
        let drawn = charts.draw(4_000, 2, &mut stream);
        let share = drawn.iter().filter(|x| x[0] < 0.0).count() as f64 / 4_000.0;
        assert!((share - 0.25).abs() < 0.06, "{share}");
    }

    /// Checks that the mixture also draws from a mode without weighted points. A single mode gives a single proposal.
    #[test]
    fn no_mode_is_lost() {
        let points = bent(4_000, 4);
        let weights = vec![1.0 / 4_000.0; 4_000];
        let three = modes(&[[-8.0, 0.0], [8.0, 0.0], [60.0, 0.0]]);
        let mut stream = RandomStream::new(5, 0);
        let charts = ProposalMixture::fitted(&points, &weights, &three, &mut stream).expect("spread");
        let drawn = charts.draw(4_000, 2, &mut stream);
        // The expected number is 80. Fewer than 30 occur with a probability of 10⁻⁹.
        assert!(drawn.iter().filter(|x| x[0] > 40.0).count() >= 30);
        let alone = ProposalMixture::fitted(&points, &weights, &modes(&[[8.0, 0.0]]), &mut stream).expect("spread");
        assert_eq!(alone.parts.len(), 1);
    }

    /// Checks that the densities with and without a wide proposal are normalised: for draws from the density with the wide proposal, the mean ratio
    /// of the two densities is 1.
    #[test]
    fn densities_are_those_of_the_draws() {
        let points = bent(4_000, 6);
        let weights = vec![1.0 / 4_000.0; 4_000];
        let both = modes(&[[-8.0, 0.0], [8.0, 0.0]]);
        let mut stream = RandomStream::new(7, 0);
        let charts = ProposalMixture::fitted(&points, &weights, &both, &mut stream).expect("spread");
        let wide = charts.with_background(&points, &weights, 0.1, 1.5);
        let drawn = wide.draw(20_000, 2, &mut stream);
        let ratios: Vec<f64> = drawn.iter().map(|x| (charts.ln_density(x) - wide.ln_density(x)).exp()).collect();
        let mean = ratios.iter().sum::<f64>() / 20_000.0;
        // The ratio is at most 1/0.9. For 20,000 draws, six standard errors of its mean are therefore below 0.02.
        assert!((mean - 1.0).abs() < 0.02 && ratios.iter().all(|ratio| *ratio < 1.12), "{mean}");
    }
}
