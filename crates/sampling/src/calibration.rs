//! Simulation-based calibration: ranks of true values among posterior draws (Talts et al. 2018, arXiv:1804.06788).
//!
//! The caller draws parameters from the prior, simulates data with them, and samples the posterior of these data. If prior, simulation and sampler are
//! consistent, the rank of any true value among n independent draws is uniform on 0 … n. This module evaluates the ranks.

use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF, Normal};

use super::ensemble::Draws;

/// Selects `n` nearly independent draws and returns their indices `[ensemble, kept step, walker]`. The result is shorter if fewer draws were kept.
///
/// In a stationary ensemble, different walkers at one step are independent. All draws of the last step are therefore used first. If they are too few,
/// further steps are used; the steps are as far apart as possible.
pub fn independent_draw_indices(draws: &Draws, n: usize) -> Vec<[usize; 3]> {
    let n_of_step = draws.n_ensembles * draws.n_walkers;
    let n_steps = n.div_ceil(n_of_step.max(1)).min(draws.n_steps);
    let step = |k: usize| draws.n_steps - 1 - k * draws.n_steps / n_steps;
    let of_step = |k: usize| {
        let (step, n_walkers) = (step(k), draws.n_walkers);
        (0..draws.n_ensembles).flat_map(move |e| (0..n_walkers).map(move |w| [e, step, w]))
    };
    (0..n_steps).flat_map(of_step).take(n).collect()
}

/// Number of draws that are below a value.
pub fn rank(value: f64, draws: impl IntoIterator<Item = f64>) -> usize {
    draws.into_iter().filter(|draw| *draw < value).count()
}

/// Ranks of the true values of one quantity among posterior draws, over many simulated data sets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ranks {
    /// Rank of the true value in each simulated data set, from 0 to `n_draws`.
    pub ranks: Vec<usize>,
    /// Number of posterior draws with which each true value is compared.
    pub n_draws: usize,
}

impl Ranks {
    /// Histogram of the ranks with `n_bins` bins. The bins are equally wide if `n_bins` divides `n_draws` + 1.
    pub fn counts(&self, n_bins: usize) -> Vec<usize> {
        let mut counts = vec![0; n_bins];
        self.ranks.iter().for_each(|rank| counts[rank.min(&self.n_draws) * n_bins / (self.n_draws + 1)] += 1);
        counts
    }

    /// Returns the ranks rescaled to (−½, ½): u = (r + ½)/(n + 1) − ½ for a rank r among n draws. For uniform ranks, u has mean 0 and variance 1/12,
    /// up to terms of order 1/n².
    fn offsets(&self) -> impl Iterator<Item = f64> {
        let scale = 1.0 / (self.n_draws as f64 + 1.0);
        self.ranks.iter().map(move |rank| scale * (*rank as f64 + 0.5) - 0.5)
    }

    /// Standardised mean rank, which is standard normal for uniform ranks. It is negative if the posteriors are too high, and positive if the
    /// posteriors are too low.
    pub fn location_score(&self) -> f64 {
        let n = self.ranks.len() as f64;
        self.offsets().sum::<f64>() / n / (1.0 / 12.0 / n).sqrt()
    }

    /// Standardised mean squared distance of the ranks from the middle, which is standard normal for uniform ranks. It is positive if the posteriors
    /// are too narrow, and negative if the posteriors are too wide.
    ///
    /// The standardisation uses that u² has mean 1/12 and variance 1/180 for a uniform u on (−½, ½).
    pub fn dispersion_score(&self) -> f64 {
        let n = self.ranks.len() as f64;
        (self.offsets().map(|u| u * u).sum::<f64>() / n - 1.0 / 12.0) / (1.0 / 180.0 / n).sqrt()
    }

    /// Number of true values inside the central posterior interval of probability `share`. The ends of the interval are ranks, so their resolution is
    /// one draw.
    pub fn n_inside(&self, share: f64) -> usize {
        let left_out = 0.5 * (1.0 - share) * (self.n_draws as f64 + 1.0);
        let lowest = (left_out + 1e-9).floor() as usize;
        self.ranks.iter().filter(|rank| (lowest..=self.n_draws - lowest).contains(*rank)).count()
    }
}

/// Returns the χ² statistic of a histogram whose bins have equal expected counts. For uniform ranks, its degrees of freedom are the number of bins
/// minus one.
pub fn chi_square(counts: &[usize]) -> f64 {
    let expected = counts.iter().sum::<usize>() as f64 / counts.len() as f64;
    counts.iter().map(|count| (*count as f64 - expected).powi(2) / expected).sum()
}

/// Probability that χ² exceeds `chi_square` for a histogram with `n_bins` bins; 1 for a single bin.
pub fn p_of_chi_square(chi_square: f64, n_bins: usize) -> f64 {
    ChiSquared::new(n_bins as f64 - 1.0).map_or(1.0, |distribution| distribution.sf(chi_square))
}

/// Probability that a standard normal number has a larger absolute value than `score`.
pub fn p_of_score(score: f64) -> f64 {
    2.0 * Normal::standard().sf(score.abs())
}

/// Returns the p-values of several tests, corrected for the number of tests by Holm's step-down method (1979). The order of the tests is kept. If all
/// null hypotheses are true, any corrected p is below a level with at most the probability of that level. The tests may depend on each other.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let mut corrected = vec![1.0; p.len()];
    let mut largest = 0.0_f64;
    for (place, index) in order.into_iter().enumerate() {
        largest = largest.max(((p.len() - place) as f64 * p[index]).min(1.0));
        corrected[index] = largest;
    }
    corrected
}

/// Returns the central interval of a binomial count with `n` trials. The probability beyond each end is at most (1 − `level`)/2.
pub fn count_interval(n: usize, probability: f64, level: f64) -> [usize; 2] {
    let Ok(binomial) = Binomial::new(probability, n as u64) else { return [0, n] };
    let tail = 0.5 * (1.0 - level);
    [binomial.inverse_cdf(tail), binomial.inverse_cdf(1.0 - tail)].map(|count| (count as usize).min(n))
}

/// Returns Clopper and Pearson's confidence interval (1934) of a binomial probability, for `count` successes in `n` trials.
pub fn probability_interval(count: usize, n: usize, level: f64) -> [f64; 2] {
    let tail = 0.5 * (1.0 - level);
    let at_least = |probability: f64| match (count, Binomial::new(probability, n as u64)) {
        (0, _) | (_, Err(_)) => 1.0,
        (count, Ok(binomial)) => binomial.sf(count as u64 - 1),
    };
    let at_most =
        |probability: f64| Binomial::new(probability, n as u64).map_or(1.0, |binomial| binomial.cdf(count as u64));
    let lower = if count == 0 { 0.0 } else { bisect(|probability| at_least(probability) < tail) };
    let upper = if count >= n { 1.0 } else { bisect(|probability| at_most(probability) > tail) };
    [lower, upper]
}

/// Finds the point of [0, 1] up to which a condition holds, by bisection. The condition holds at 0.
fn bisect(holds: impl Fn(f64) -> bool) -> f64 {
    let (mut lower, mut upper) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (lower + upper);
        *(if holds(middle) { &mut lower } else { &mut upper }) = middle;
    }
    0.5 * (lower + upper)
}

#[cfg(test)]
mod tests {
    use super::super::ensemble::RandomStream;
    use super::*;

    fn draws(n_steps: usize) -> Draws {
        let n = 4 * n_steps * 8;
        let (positions, log_density) = (vec![0.0; n], vec![0.0; n]);
        Draws { n_ensembles: 4, n_steps, n_walkers: 8, dimension: 1, store_every: 1, positions, log_density }
    }

    #[test]
    fn draws_are_of_the_last_step_or_of_steps_far_apart() {
        let places = independent_draw_indices(&draws(100), 31);
        assert!(places.len() == 31 && places.iter().all(|[_, step, _]| *step == 99));
        let places = independent_draw_indices(&draws(100), 99);
        let mut steps: Vec<usize> = places.iter().map(|[_, step, _]| *step).collect();
        steps.dedup();
        assert_eq!((places.len(), steps), (99, vec![99, 74, 49, 24]));
        let mut distinct = places.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), 99);
        assert_eq!(independent_draw_indices(&draws(2), 99).len(), 64);
        assert!(independent_draw_indices(&draws(0), 99).is_empty());
    }

    /// Compares corrections and intervals with known results. Holm's correction of four p-values is computed by hand. Clopper and Pearson's 95 %
    /// interval of 8 successes in 10 trials is from tables (0.4439 to 0.9748).
    #[test]
    fn corrections_and_intervals_are_those_of_tables() {
        let found = holm(&[0.01, 0.04, 0.03, 0.005]);
        for (found, wanted) in found.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((found - wanted).abs() < 1e-12, "{found}");
        }
        let found = probability_interval(8, 10, 0.95);
        assert!((found[0] - 0.4439).abs() < 5e-5 && (found[1] - 0.9748).abs() < 5e-5, "{found:?}");
        assert_eq!(probability_interval(0, 10, 0.9)[0], 0.0);
        assert_eq!(probability_interval(10, 10, 0.9)[1], 1.0);
        let [lower, upper] = count_interval(100, 0.1, 0.99);
        let binomial = Binomial::new(0.1, 100).unwrap();
        assert!(binomial.cdf(upper as u64) >= 0.995 && binomial.cdf(upper as u64 - 1) < 0.995, "{upper}");
        assert!(binomial.cdf(lower as u64) >= 0.005 && binomial.cdf(lower as u64 - 1) < 0.005, "{lower}");
        assert!((p_of_chi_square(16.919, 10) - 0.05).abs() < 1e-4 && (p_of_score(-1.959_964) - 0.05).abs() < 1e-6);
    }

    /// Checks ranks of which each of 100 possible values occurs once. 20 bins then hold equally many ranks, and the intervals of 50 % and 90 % hold
    /// exactly these fractions.
    #[test]
    fn shares_of_uniform_ranks_are_exact() {
        let ranks = Ranks { ranks: (0..100).collect(), n_draws: 99 };
        assert_eq!(ranks.counts(20), vec![5; 20]);
        assert_eq!((ranks.n_inside(0.5), ranks.n_inside(0.9)), (50, 90));
        assert!(
            ranks.location_score().abs() < 1e-9
                && ranks.dispersion_score().abs() < 0.01
                && chi_square(&ranks.counts(20)) == 0.0
        );
    }

    /// Computes scores of 2,000 replicates for a correct posterior, and for posteriors that are too high, too narrow or too wide by known factors.
    /// The scores of the correct posterior exceed 5.2 with a probability of 1 in 5·10⁶. The expected scores of the wrong posteriors exceed 20.
    #[test]
    fn scores_say_what_is_wrong() {
        let normal = Normal::standard();
        let ranks = |shift: f64, width: f64| {
            let mut stream = RandomStream::new(3, 0);
            let of = |z: f64| ((100.0 * normal.cdf((z - shift) / width)) as usize).min(99);
            Ranks { ranks: (0..2_000).map(|_| of(stream.normal())).collect(), n_draws: 99 }
        };
        let right = ranks(0.0, 1.0);
        assert!(right.location_score().abs() < 5.2 && right.dispersion_score().abs() < 5.2);
        assert!(p_of_chi_square(chi_square(&right.counts(20)), 20) > 1e-7);
        assert!(ranks(1.0, 1.0).location_score() < -20.0 && ranks(-1.0, 1.0).location_score() > 20.0);
        assert!(ranks(0.0, 0.5).dispersion_score() > 20.0 && ranks(0.0, 2.0).dispersion_score() < -20.0);
    }
}
