//! Size law: the common distribution of an effect's sizes in a cohort. It consists of the fraction of specimens with the effect and the distribution of
//! their sizes. It also says on which side of the null (the value at which the effect vanishes) the sizes lie.
//!
//! A specimen has the effect with probability π, the fraction of specimens with the effect (share). The sizes of the effect are log-normal, with median m
//! and standard deviation s of the logarithm. The sizes are above the effect's null, below it, or on either side with equal probability. Let r_i be the
//! likelihood of specimen i, averaged over this distribution and divided by the specimen's likelihood without the effect. The log likelihood ratio of a
//! size law is then
//!
//! ```text
//! ln L(m, s, side, π) − ln L(none) = Σ_i ln(1 − π + π r_i(m, s, side))
//! ```
//!
//! Sizes form a logarithmic grid. The likelihood is averaged over the cell around each node of the grid, so that a narrow peak between two nodes is not
//! missed.

use super::likelihood::{Side, SizeLikelihood};
use statrs::function::erf::erf;

/// Smallest and largest median size on the grid, given by the response of a specimen in standard deviations of the noise. At the smallest median size, the
/// most informative specimen responds with the first value. At the largest, half of the specimens respond with at least the second value.
const SIGMA_RANGE: [f64; 2] = [0.3, 30.0];
/// Largest range of the grid of median sizes, in the natural logarithm of the size.
const LONGEST_RANGE: f64 = 12.0;
/// Largest distance of a size from the median size, in standard deviations of the size's logarithm. Sizes beyond this distance are left out.
const REACH_SD: f64 = 2.5;
/// Number of specimens whose likelihood factors are multiplied before a logarithm is taken, which saves time.
const FACTORS_PER_LOGARITHM: usize = 4;

/// Side of the effect's null (where the effect vanishes) on which the sizes lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// Sizes above the effect's null, the parameter value at which the effect vanishes.
    Above,
    /// Sizes below the effect's null, the parameter value at which the effect vanishes.
    Below,
    /// Sizes on either side of the effect's null, with equal probability.
    Both,
}

/// Grid of size laws, which describe an effect's sizes over specimens: medians, spreads, sides of the null and fractions of specimens with the effect.
#[derive(Debug, Clone, PartialEq)]
pub struct SizeLawGrid {
    /// Distance between neighbouring nodes of the size grid, in the logarithm of the size.
    step: f64,
    /// Logarithm of the size at the first node.
    first: f64,
    n_nodes: usize,
    n_medians: usize,
    /// Number of nodes of the size grid below the first median size.
    margin: usize,
    /// Standard deviations of the size's logarithm, each with the weights of the nodes around the median.
    spreads: Vec<(f64, Vec<f64>)>,
    sides: Vec<Sides>,
    shares: Vec<f64>,
}

/// Resolution of a grid of size laws, which are distributions of an effect's sizes over specimens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fineness {
    /// Distance between neighbouring median sizes, in the logarithm of the size.
    pub step: f64,
    /// Standard deviations of the size's logarithm between specimens with the effect.
    pub spreads: &'static [f64],
    /// Fractions of specimens with the effect.
    pub shares: &'static [f64],
}

/// Coarse grid of possible distributions of an effect's sizes over specimens (size laws). The search uses it, because the search is repeated for many
/// simulated records.
pub const COARSE: Fineness =
    Fineness { step: 0.35, spreads: &[0.1, 0.5, 1.0], shares: &[0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0] };
/// Fine grid of possible distributions of an effect's sizes over specimens (size laws). It gives the sizes of an effect that is claimed.
pub const FINE: Fineness = Fineness {
    step: 0.1,
    spreads: &[0.05, 0.2, 0.4, 0.6, 0.8, 1.0],
    shares: &[
        0.02, 0.06, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.94,
        0.97, 1.0,
    ],
};

/// Size law: the distribution of an effect's sizes over the specimens of a cohort.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeLaw {
    /// Logarithm of the median size.
    pub ln_median: f64,
    /// Standard deviation of the size's logarithm between specimens with the effect.
    pub log_sd: f64,
    /// Side of the effect's null (where the effect vanishes) on which the sizes lie.
    pub sides: Sides,
    /// Fraction of specimens with the effect.
    pub share: f64,
}

impl SizeLaw {
    /// Mean size of the effect over all specimens, in which specimens without the effect count as 0.
    pub fn mean_size(&self) -> f64 {
        self.share * (self.ln_median + 0.5 * self.log_sd * self.log_sd).exp()
    }
}

/// Position in a grid of size laws (distributions of an effect's sizes): joint index of median, spread and side, then index of the fraction of specimens
/// with the effect.
pub type Place = (usize, usize);

/// Likelihood ratios of one specimen with and without the effect, one for each combination of median size, spread and side of the null.
pub type LikelihoodRatios = Vec<f64>;

/// Likelihood ratios of one specimen with and without the effect, one for each node of the size grid and each side of the null.
#[derive(Debug, Clone, PartialEq)]
pub struct Nodes {
    below: Vec<f64>,
    above: Vec<f64>,
}

impl SizeLawGrid {
    /// Distance between neighbouring median sizes, in the logarithm of the size.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Makes a grid of size laws for all sizes that the specimens can show; `None` if no specimen has information on the effect.
    pub fn new(likelihoods: &[SizeLikelihood], fineness: Fineness) -> Option<Self> {
        let told: Vec<&SizeLikelihood> = likelihoods.iter().filter(|likelihood| likelihood.norm > 0.0).collect();
        let mut lowest: Vec<f64> =
            told.iter().map(|size_likelihood| size_likelihood.size_at(SIGMA_RANGE[0]).ln()).collect();
        let mut highest: Vec<f64> =
            told.iter().map(|size_likelihood| size_likelihood.size_at(SIGMA_RANGE[1]).ln()).collect();
        lowest.sort_by(f64::total_cmp);
        highest.sort_by(f64::total_cmp);
        // Fitted sizes can be outside the range of the first-order likelihoods.
        let fitted = told
            .iter()
            .filter(|size_likelihood| size_likelihood.z.abs() > SIGMA_RANGE[1])
            .map(|size_likelihood| size_likelihood.size_at(size_likelihood.z.abs()).ln());
        let highest = fitted.fold(*highest.get(highest.len() / 2)?, f64::max);
        let range = (highest - lowest.first()?).clamp(fineness.step, LONGEST_RANGE);
        let n_medians = (range / fineness.step).ceil() as usize + 1;
        let step = fineness.step;
        let widest = fineness.spreads.iter().copied().fold(0.0, f64::max);
        let margin = (REACH_SD * widest / step).ceil() as usize;
        let has = |side: usize| told.iter().any(|size_likelihood| size_likelihood.reach[side] > 0.0);
        let sides = match (has(0), has(1)) {
            (true, true) => vec![Sides::Above, Sides::Below, Sides::Both],
            (true, false) => vec![Sides::Below],
            _ => vec![Sides::Above],
        };
        let first = highest - step * (n_medians - 1) as f64 - step * margin as f64;
        let spreads = fineness.spreads.iter().map(|sd| (*sd, weights(*sd, step))).collect();
        let n_nodes = n_medians + 2 * margin;
        Some(Self { step, first, n_nodes, n_medians, margin, spreads, sides, shares: fineness.shares.to_vec() })
    }

    /// Number of combinations of median, spread and side.
    fn n_laws(&self) -> usize {
        self.sides.len() * self.spreads.len() * self.n_medians
    }

    fn node(&self, place: usize) -> f64 {
        self.first + self.step * place as f64
    }

    /// Computes the likelihood ratios of a specimen at each node of the size grid.
    pub fn nodes(&self, likelihood: &SizeLikelihood) -> Nodes {
        let of = |side: Side| -> Vec<f64> {
            let is_out = match side {
                Side::Below => likelihood.reach[0] <= 0.0,
                Side::Above => likelihood.reach[1] <= 0.0,
            };
            if is_out {
                return vec![0.0; self.n_nodes];
            }
            let cell = |place: usize| [-0.5, 0.5].map(|half| (self.node(place) + half * self.step).exp());
            (0..self.n_nodes).map(|place| likelihood.ln_mean(side, cell(place)).exp()).collect()
        };
        Nodes { below: of(Side::Below), above: of(Side::Above) }
    }

    /// Computes the likelihood ratios of a specimen under each combination of median, spread and side.
    pub fn ratios(&self, nodes: &Nodes) -> LikelihoodRatios {
        let mut ratios = Vec::with_capacity(self.n_laws());
        let averaged = |of: &[f64], weights: &[f64], median: usize| -> f64 {
            let from = self.margin + median - weights.len() / 2;
            of[from..from + weights.len()].iter().zip(weights).map(|(x, weight)| x * weight).sum()
        };
        for sides in &self.sides {
            for (_, weights) in &self.spreads {
                for median in 0..self.n_medians {
                    ratios.push(match sides {
                        Sides::Above => averaged(&nodes.above, weights, median),
                        Sides::Below => averaged(&nodes.below, weights, median),
                        Sides::Both => {
                            0.5 * (averaged(&nodes.above, weights, median) + averaged(&nodes.below, weights, median))
                        }
                    });
                }
            }
        }
        ratios
    }

    /// Returns the size law (distribution of the effect's sizes) at a position of the grid.
    pub fn law(&self, (law, share): Place) -> SizeLaw {
        let (median, rest) = (law % self.n_medians, law / self.n_medians);
        let (spread, sides) = (rest % self.spreads.len(), rest / self.spreads.len());
        SizeLaw {
            ln_median: self.node(self.margin + median),
            log_sd: self.spreads[spread].0,
            sides: self.sides[sides],
            share: self.shares[share],
        }
    }

    /// Finds the size law with the largest gain in log likelihood over all specimens. Returns this gain (nats, at least 0) and the law's position in the
    /// grid.
    pub fn best(&self, specimens: &[&LikelihoodRatios]) -> (f64, Place) {
        let mut best = (0.0, (0, 0));
        for law in 0..self.n_laws() {
            // The gain is a concave function of the fraction of specimens with the effect, and is 0 at fraction 0. If the slope at 0 is not positive, the
            // gain is nowhere positive.
            let slope: f64 = specimens.iter().map(|ratios| ratios[law] - 1.0).sum();
            // A slope of NaN is skipped as well.
            if slope.is_nan() || slope <= 0.0 {
                continue;
            }
            for (place, share) in self.shares.iter().enumerate() {
                let gain = gain(specimens, law, *share);
                if gain > best.0 {
                    best = (gain, (law, place));
                }
            }
        }
        best
    }

    /// Gain in log likelihood (nats) of one specimen under a size law (distribution of the effect's sizes). It is negative if the specimen contradicts the
    /// law.
    pub fn gain(&self, ratios: &LikelihoodRatios, (law, share): Place) -> f64 {
        let share = self.shares[share];
        (1.0 - share + share * ratios[law]).ln()
    }

    /// Log likelihood ratio between each size law of the grid and no effect. The index of the fraction of specimens with the effect changes fastest.
    pub fn ln_likelihoods(&self, specimens: &[&LikelihoodRatios]) -> Vec<f64> {
        let of_law = |law: usize| self.shares.iter().map(move |share| gain(specimens, law, *share));
        (0..self.n_laws()).flat_map(of_law).collect()
    }

    /// All laws of the grid, in the order of [`Self::ln_likelihoods`].
    pub fn all(&self) -> impl Iterator<Item = SizeLaw> + '_ {
        (0..self.n_laws()).flat_map(move |law| (0..self.shares.len()).map(move |share| self.law((law, share))))
    }

    /// Probability that a specimen has the effect, given a size law. Also returns the possible signed sizes, with their probabilities in a specimen with
    /// the effect.
    pub fn specimen_posterior(&self, nodes: &Nodes, place: Place) -> (f64, Vec<(f64, f64)>) {
        let law = self.law(place);
        let (median, rest) = (place.0 % self.n_medians, place.0 / self.n_medians);
        let weights = &self.spreads[rest % self.spreads.len()].1;
        let from = self.margin + median - weights.len() / 2;
        let mut sizes = Vec::new();
        for (sign, of, part) in [
            (1.0, &nodes.above, matches!(law.sides, Sides::Above | Sides::Both)),
            (-1.0, &nodes.below, matches!(law.sides, Sides::Below | Sides::Both)),
        ] {
            if part {
                let half = if law.sides == Sides::Both { 0.5 } else { 1.0 };
                let map = weights
                    .iter()
                    .enumerate()
                    .map(|(k, weight)| (sign * self.node(from + k).exp(), half * weight * of[from + k]));
                sizes.extend(map);
            }
        }
        let ratio: f64 = sizes.iter().map(|(_, weight)| weight).sum();
        let has = law.share * ratio / (1.0 - law.share + law.share * ratio);
        if ratio > 0.0 {
            sizes.iter_mut().for_each(|(_, weight)| *weight /= ratio);
        }
        (has, sizes)
    }
}

/// Mean of likelihood ratios over the grid points of an effect's parameters that are unidentified at its null. All grid points are equally probable in
/// each specimen.
pub fn averaged(points: &[Nodes]) -> Nodes {
    let n = points.len().max(1) as f64;
    let mean = |of: &dyn Fn(&Nodes) -> &Vec<f64>| -> Vec<f64> {
        let len = points.first().map_or(0, |first| of(first).len());
        (0..len).map(|node| points.iter().map(|point| of(point)[node]).sum::<f64>() / n).collect()
    };
    Nodes { below: mean(&|nodes| &nodes.below), above: mean(&|nodes| &nodes.above) }
}

/// Weights of the nodes around a median size, from a normal distribution of the size's logarithm with standard deviation `sd`. Nodes are `step` apart.
fn weights(sd: f64, step: f64) -> Vec<f64> {
    let reach = (REACH_SD * sd / step).ceil() as i64;
    let below = |x: f64| 0.5 * (1.0 + erf(x / (sd * std::f64::consts::SQRT_2)));
    let weight = |k: i64| below((k as f64 + 0.5) * step) - below((k as f64 - 0.5) * step);
    let all: Vec<f64> = (-reach..=reach).map(weight).collect();
    let sum: f64 = all.iter().sum();
    all.into_iter().map(|weight| weight / sum).collect()
}

/// Gain in log likelihood (nats) of a size law: the sum Σ ln(1 − π + π r) over specimens. Here r is a specimen's likelihood ratio, and π is `share`.
fn gain(specimens: &[&LikelihoodRatios], law: usize, share: f64) -> f64 {
    let factor = |ratios: &&LikelihoodRatios| 1.0 - share + share * ratios[law];
    specimens.chunks(FACTORS_PER_LOGARITHM).map(|few| few.iter().map(factor).product::<f64>().ln()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sampling::ensemble::RandomStream;

    fn told(z: f64, norm: f64, reach: [f64; 2]) -> SizeLikelihood {
        SizeLikelihood { height: 0.5 * z * z, z, norm, unit: 1.0, power: 1.0, reach }
    }

    /// Compares the gain of size laws with likelihoods that are averaged over 40,000 sizes of the log-normal distribution.
    #[test]
    fn a_law_weighs_as_quadrature_does() {
        let specimens: Vec<SizeLikelihood> =
            [(2.1, 1.0), (-0.4, 0.5), (3.0, 2.0), (0.2, 0.1)].map(|(z, n)| told(z, n, [1e9; 2])).to_vec();
        let laws = SizeLawGrid::new(&specimens, FINE).expect("they show something");
        let ratios: Vec<LikelihoodRatios> =
            specimens.iter().map(|specimen| laws.ratios(&laws.nodes(specimen))).collect();
        let lns = laws.ln_likelihoods(&ratios.iter().collect::<Vec<_>>());
        let mut n_compared = 0;
        for (index, law) in laws.all().enumerate().filter(|(index, _)| index % 977 == 5) {
            if law.log_sd < 0.2 {
                continue;
            }
            n_compared += 1;
            let of = |size_likelihood: &SizeLikelihood| {
                let n = 40_000;
                let (mut sum, mut whole) = (0.0, 0.0);
                for k in 0..n {
                    let t = REACH_SD * (2.0 * (k as f64 + 0.5) / f64::from(n) - 1.0);
                    let size = (law.ln_median + t * law.log_sd).exp();
                    let at = |x: f64| {
                        (size_likelihood.norm * x * size_likelihood.z - 0.5 * (size_likelihood.norm * x).powi(2)).exp()
                    };
                    let likelihood = match law.sides {
                        Sides::Above => at(size),
                        Sides::Below => at(-size),
                        Sides::Both => 0.5 * (at(size) + at(-size)),
                    };
                    let weight = (-0.5 * t * t).exp();
                    sum += weight * likelihood;
                    whole += weight;
                }
                (1.0 - law.share + law.share * sum / whole).ln()
            };
            let exact: f64 = specimens.iter().map(of).sum();
            // Cells are 0.1 wide in the logarithm of the size. The truncated distribution of sizes may end inside a cell in which a specimen's likelihood
            // is large. The error is about 0.01 per specimen.
            assert!((lns[index] - exact).abs() < 0.05 + 0.02 * exact.abs(), "{law:?}: {} {exact}", lns[index]);
        }
        assert!(n_compared > 10, "{n_compared}");
        let (gain, place) = laws.best(&ratios.iter().collect::<Vec<_>>());
        let largest = lns.iter().copied().fold(0.0, f64::max);
        assert!((gain - largest).abs() < 1e-9 && gain > 3.0);
        let sum: f64 = ratios.iter().map(|ratios| laws.gain(ratios, place)).sum();
        assert!((sum - gain).abs() < 1e-9);
    }

    /// Fits the size law to simulated cohorts of 40 specimens. Half of the specimens have the effect, with a response of 4 standard deviations and one
    /// sign. Over ten cohorts, the best fraction is right within 0.16 and the median within 20 %. No cohort without the effect gains 8 nats (χ² with one
    /// degree of freedom, for about fifty laws: below 1e-5 per cohort).
    #[test]
    fn shares_and_medians_are_found() {
        let mut stream = RandomStream::new(5, 0);
        for cohort in 0..10 {
            let z: Vec<f64> =
                (0..40).map(|k| if k % 2 == 0 { 4.0 + stream.normal() } else { stream.normal() }).collect();
            let best = |z: &[f64], reach: [f64; 2]| {
                let specimens: Vec<SizeLikelihood> = z.iter().map(|z| told(*z, 2.0, reach)).collect();
                let laws = SizeLawGrid::new(&specimens, FINE).expect("they show something");
                let ratios: Vec<LikelihoodRatios> =
                    specimens.iter().map(|specimen| laws.ratios(&laws.nodes(specimen))).collect();
                let (gain, place) = laws.best(&ratios.iter().collect::<Vec<_>>());
                (gain, laws.law(place))
            };
            for reach in [[0.0, 1e9], [1e9, 1e9]] {
                let (gain, law) = best(&z, reach);
                assert!(gain > 50.0 && (law.share - 0.5).abs() < 0.16, "{cohort}: {gain} {law:?}");
                assert!((law.ln_median - 2.0_f64.ln()).abs() < 0.2 && law.sides == Sides::Above, "{cohort}: {law:?}");
            }
            let nothing: Vec<f64> = (0..40).map(|_| stream.normal()).collect();
            assert!(best(&nothing, [1e9; 2]).0 < 8.0);
        }
    }

    /// The probability that a specimen has the effect follows Bayes' rule: π r/(1 − π + π r), with the prior probability π and the likelihood ratio r. The
    /// mean of its possible sizes is between its most likely size and the law's median.
    #[test]
    fn specimens_are_drawn_to_the_law() {
        let specimens = [told(6.0, 1.0, [0.0, 1e9]), told(0.0, 1.0, [0.0, 1e9])];
        let laws = SizeLawGrid::new(&specimens, FINE).expect("they show something");
        let index = laws
            .all()
            .position(|law| (law.ln_median - 4.0_f64.ln()).abs() < 0.06 && law.log_sd == 0.4 && law.share == 0.5);
        let index = index.expect("on the grid");
        let place = (index / laws.shares.len(), index % laws.shares.len());
        let nodes = laws.nodes(&specimens[0]);
        let (has, sizes) = laws.specimen_posterior(&nodes, place);
        let ratio = laws.ratios(&nodes)[place.0];
        assert!((has - ratio / (1.0 + ratio)).abs() < 1e-12 && has > 0.999);
        let mean: f64 = sizes.iter().map(|(size, weight)| size * weight).sum();
        assert!((4.0..6.2).contains(&mean), "{mean}");
        let (has_not, _) = laws.specimen_posterior(&laws.nodes(&specimens[1]), place);
        assert!(has_not < 0.05, "{has_not}");
    }
}
