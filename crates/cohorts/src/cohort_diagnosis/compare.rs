//! Sizes of an effect in groups of records, and their ratios between groups.
//!
//! A size law is a distribution of the effect's sizes over specimens: median, spread, side of the null, and fraction of specimens with the effect. All
//! size laws of a grid are equally probable a priori, so their posterior probabilities are proportional to their likelihoods. Each group has its own
//! median and its own fraction of specimens with the effect. The spread and the side of the null are common to all groups.
//!
//! Groups are compared by the mean size over all specimens, in which specimens without the effect count as 0. The comparison therefore needs no decision
//! which specimens have the effect.

use super::law::{FINE, LikelihoodRatios, Nodes, Sides, SizeLawGrid};
use crate::contrast::{CERTAINTY, SIGN_CERTAINTY};
use documents::groups::RatioVerdict;

/// Width, in the logarithm of the size, of the cells on which the distributions of mean sizes are computed.
const CELL: f64 = 0.02;

/// 5 %, 50 % and 95 % quantile of a quantity.
pub type Quantiles = [f64; 3];

/// Posterior of an effect's sizes in the records of a group.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupSizes {
    /// Median size of the specimens with the effect.
    pub median: Quantiles,
    /// Standard deviation of the logarithm of the size between the specimens with the effect.
    pub log_sd: Quantiles,
    /// Fraction of specimens with the effect.
    pub share: Quantiles,
    /// Mean size over all specimens of the group. Specimens without the effect count as 0.
    pub mean: Quantiles,
    /// Probabilities that the effect's sizes are above its null, below its null, or on either side of its null.
    pub sides: [f64; 3],
    /// Gain in log likelihood of the group (nats) by the effect, under the size law that fits the group best.
    pub gain_nats: f64,
}

/// Posterior of the ratio between two groups' mean sizes.
#[derive(Debug, Clone, PartialEq)]
pub struct Ratio {
    /// Mean size of the effect in the first group, divided by the mean size in the second group.
    pub ratio: Quantiles,
    /// Three probabilities: the first group's mean is larger, larger by more than the margin, and smaller by more than the margin.
    pub probabilities: [f64; 3],
}

impl Ratio {
    /// Verdict on the ratio: different, equivalent or undecided, given the margin.
    pub fn verdict(&self) -> RatioVerdict {
        let [_, beyond, below] = self.probabilities;
        if beyond >= CERTAINTY {
            RatioVerdict::Greater
        } else if below >= CERTAINTY {
            RatioVerdict::Less
        } else if beyond + below <= 1.0 - CERTAINTY {
            RatioVerdict::Equivalent
        } else {
            RatioVerdict::Undecided
        }
    }

    /// Returns `true` if a difference between the groups is declared: by its sign, or by a ratio outside the margin.
    pub fn is_declared(&self) -> bool {
        let [greater, ..] = self.probabilities;
        greater.max(1.0 - greater) >= SIGN_CERTAINTY
            || matches!(self.verdict(), RatioVerdict::Greater | RatioVerdict::Less)
    }
}

/// Comparison of an effect's sizes between groups of records.
pub struct GroupComparison {
    /// Sizes in each group, in the order of the input.
    pub groups: Vec<GroupSizes>,
    /// Ratio of the mean sizes for each pair of groups, with the indices of the two groups. The first index is smaller than the second.
    pub ratios: Vec<([usize; 2], Ratio)>,
}

/// Fine grid of size laws for a claimed effect, from the likelihoods of the effect's size in all records. `None` if no record has information on the size.
pub fn fine_laws(likelihoods: &[super::likelihood::SizeLikelihood]) -> Option<SizeLawGrid> {
    SizeLawGrid::new(likelihoods, FINE)
}

/// Posterior weights of the size laws for the records of a group, divided by the largest weight. Also returns the gain in log likelihood (nats) under the
/// law with the largest weight.
fn weights(laws: &SizeLawGrid, nodes: &[&Nodes]) -> (Vec<f64>, f64) {
    let ratios: Vec<LikelihoodRatios> = nodes.iter().map(|nodes| laws.ratios(nodes)).collect();
    let lns = laws.ln_likelihoods(&ratios.iter().collect::<Vec<_>>());
    let largest = lns.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (lns.into_iter().map(|ln| (ln - largest).exp()).collect(), largest.max(0.0))
}

/// Posterior of an effect's sizes in one group, from the records of this group alone.
pub fn group_sizes(laws: &SizeLawGrid, nodes: &[&Nodes]) -> GroupSizes {
    let (weights, gain_nats) = weights(laws, nodes);
    summarised(laws, &weights, gain_nats)
}

fn summarised(laws: &SizeLawGrid, weights: &[f64], gain_nats: f64) -> GroupSizes {
    let all: Vec<super::law::SizeLaw> = laws.all().collect();
    let quantiles = |of: &dyn Fn(&super::law::SizeLaw) -> f64| {
        let mut values: Vec<(f64, f64)> = all.iter().zip(weights).map(|(law, weight)| (of(law), *weight)).collect();
        values.sort_by(|a, b| a.0.total_cmp(&b.0));
        weighted_quantiles(&values)
    };
    let whole: f64 = weights.iter().sum();
    let of_side = |side: Sides| -> f64 {
        all.iter().zip(weights).filter(|(law, _)| law.sides == side).map(|(_, weight)| weight).sum::<f64>() / whole
    };
    GroupSizes {
        median: in_cells(&all, weights, laws.step()).map(f64::exp),
        log_sd: quantiles(&|law| law.log_sd),
        share: quantiles(&|law| law.share),
        mean: quantiles(&|law| law.mean_size()),
        sides: [Sides::Above, Sides::Below, Sides::Both].map(of_side),
        gain_nats,
    }
}

/// 5 %, 50 % and 95 % quantiles of the logarithm of the median size. Each median of the grid stands for all sizes that are nearer to it than to the others: a posterior that is
/// narrower than the grid would otherwise have an interval without width.
fn in_cells(laws: &[super::law::SizeLaw], weights: &[f64], step: f64) -> Quantiles {
    let mut cells: Vec<(f64, f64)> = Vec::new();
    for (law, weight) in laws.iter().zip(weights) {
        match cells.iter_mut().find(|(middle, _)| *middle == law.ln_median) {
            Some((_, sum)) => *sum += weight,
            None => cells.push((law.ln_median, *weight)),
        }
    }
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = weights.iter().sum();
    [0.05, 0.5, 0.95].map(|probability| {
        let mut left = probability * whole;
        for (middle, weight) in cells.iter().filter(|(_, weight)| *weight > 0.0) {
            if left <= *weight {
                return middle + step * (left / weight - 0.5);
            }
            left -= weight;
        }
        f64::NAN
    })
}

/// 5 %, 50 % and 95 % quantiles of pairs (value, weight) in ascending order of value.
fn weighted_quantiles(values: &[(f64, f64)]) -> Quantiles {
    let whole: f64 = values.iter().map(|(_, weight)| weight).sum();
    [0.05, 0.5, 0.95].map(|probability| {
        let mut below = 0.0;
        let at = values.iter().find(|(_, weight)| {
            below += weight;
            below >= probability * whole
        });
        at.or(values.last()).map_or(f64::NAN, |(value, _)| *value)
    })
}

/// Compares an effect's sizes between groups of records. Each group lists the likelihood ratios of all sizes for each of its records.
pub fn compare_groups(laws: &SizeLawGrid, groups: &[Vec<&Nodes>], margin: f64) -> GroupComparison {
    let of: Vec<(Vec<f64>, f64)> = groups.iter().map(|nodes| weights(laws, nodes)).collect();
    let all: Vec<super::law::SizeLaw> = laws.all().collect();
    // A block holds all laws with the same side and spread, because these are common to the groups.
    let mut blocks: Vec<((Sides, f64), Vec<usize>)> = Vec::new();
    for (place, law) in all.iter().enumerate() {
        let key = (law.sides, law.log_sd);
        match blocks.iter_mut().find(|(block, _)| *block == key) {
            Some((_, places)) => places.push(place),
            None => blocks.push((key, vec![place])),
        }
    }
    let evidence = |group: usize, places: &[usize]| places.iter().map(|place| of[group].0[*place]).sum::<f64>();
    let mut together: Vec<f64> =
        blocks.iter().map(|(_, places)| (0..groups.len()).map(|group| evidence(group, places)).product()).collect();
    // In double precision, the joint weights of all blocks can underflow to zero. All blocks then get equal weight.
    if together.iter().all(|weight| *weight <= 0.0) {
        together.fill(1.0);
    }
    // Posterior weights of the laws for one group, given the spread and side that all groups have in common.
    let shared = |group: usize| -> Vec<f64> {
        let mut weights = vec![0.0; all.len()];
        for ((_, places), together) in blocks.iter().zip(&together) {
            let value = evidence(group, places);
            if value > 0.0 {
                places.iter().for_each(|place| weights[*place] = together * of[group].0[*place] / value);
            }
        }
        weights
    };
    let sizes = |group: usize| summarised(laws, &shared(group), of[group].1);
    let (low, high) = all
        .iter()
        .map(|law| law.mean_size().ln())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |ends, x| (ends.0.min(x), ends.1.max(x)));
    let n_cells = ((high - low) / CELL).ceil() as usize + 1;
    let cell = |law: &super::law::SizeLaw| (((law.mean_size().ln() - low) / CELL).round() as usize).min(n_cells - 1);
    let histogram = |group: usize, places: &[usize]| -> Vec<f64> {
        let mut cells = vec![0.0; n_cells];
        places.iter().for_each(|place| cells[cell(&all[*place])] += of[group].0[*place]);
        cells
    };
    let ratio = |a: usize, b: usize| -> Ratio {
        let mut differences = vec![0.0; 2 * n_cells - 1];
        for ((_, places), together) in blocks.iter().zip(&together) {
            let both = evidence(a, places) * evidence(b, places);
            if *together <= 0.0 || both <= 0.0 {
                continue;
            }
            let (entry, other) = (histogram(a, places), histogram(b, places));
            for (i, x) in entry.iter().enumerate().filter(|(_, x)| **x > 0.0) {
                for (j, y) in other.iter().enumerate() {
                    differences[n_cells - 1 + i - j] += together / both * x * y;
                }
            }
        }
        let at = |place: usize| CELL * (place as f64 - (n_cells - 1) as f64);
        let values: Vec<(f64, f64)> = differences.iter().enumerate().map(|(k, weight)| (at(k), *weight)).collect();
        let whole: f64 = differences.iter().sum();
        // Half of the middle cell's probability counts to either side.
        let above = |bar: f64| -> f64 {
            let weight = |(x, weight): &(f64, f64)| {
                if (x - bar).abs() < 0.5 * CELL {
                    0.5 * weight
                } else if *x > bar {
                    *weight
                } else {
                    0.0
                }
            };
            values.iter().map(weight).sum::<f64>() / whole
        };
        let bar = (1.0 + margin).ln();
        Ratio {
            ratio: weighted_quantiles(&values).map(f64::exp),
            probabilities: [above(0.0), above(bar), 1.0 - above(-bar)],
        }
    };
    let pairs = (0..groups.len()).flat_map(|a| (a + 1..groups.len()).map(move |b| [a, b]));
    GroupComparison {
        groups: (0..groups.len()).map(sizes).collect(),
        ratios: pairs.map(|[a, b]| ([a, b], ratio(a, b))).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::law::SizeLaw;
    use super::*;

    /// All weight on one median of the grid gives the cell around it, and equal weights on three give the quantiles of a uniform density over the three cells.
    #[test]
    fn a_median_of_the_grid_stands_for_its_cell() {
        let law = |ln_median: f64| SizeLaw { ln_median, log_sd: 0.05, sides: Sides::Above, share: 1.0 };
        let laws = [law(0.0), law(0.1), law(0.2), law(0.1)];
        let close = |found: Quantiles, expected: Quantiles| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
        };
        close(in_cells(&laws, &[0.0, 2.0, 0.0, 3.0], 0.1), [0.055, 0.1, 0.145]);
        close(in_cells(&laws, &[2.0, 1.0, 2.0, 1.0], 0.1), [-0.035, 0.1, 0.235]);
    }
}
