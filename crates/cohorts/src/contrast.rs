//! Ratios of a parameter between groups: their size, probability and practical relevance.

use super::design::Design;
use super::hierarchy::PopulationDraw;
use super::scale::SizeScale;
use documents::groups::RatioVerdict;
use figures::density::{quantile_of_sorted, sorted};

/// Smallest posterior probability with which a ratio counts as outside the margin, or inside it.
pub const CERTAINTY: f64 = 0.95;
/// Smallest posterior probability that all stated signs of differences are correct together. With this value, a sign is stated in fewer than 5 of 100
/// cohorts whose groups are equal.
pub const SIGN_CERTAINTY: f64 = 0.997;

/// Posterior of the ratio between the typical specimens of two groups.
#[derive(Debug, Clone, PartialEq)]
pub struct Contrast {
    /// Index of the compared parameter.
    pub parameter: usize,
    /// Indices of the two groups. The ratio is the value in the first group divided by the value in the second.
    pub groups: [usize; 2],
    /// Logarithm of the ratio, one value per draw.
    pub log_ratio: Vec<f64>,
    /// `true` if the sign of the logarithm is stated as a result. All stated signs of a comparison are correct together with a probability of at least
    /// [`SIGN_CERTAINTY`].
    pub is_declared: bool,
}

impl Contrast {
    /// Posterior probability that the ratio is larger than `ratio`.
    pub fn probability_above(&self, ratio: f64) -> f64 {
        let bar = ratio.ln();
        self.log_ratio.iter().filter(|x| **x > bar).count() as f64 / self.log_ratio.len() as f64
    }

    /// Quantiles of the ratio at these probabilities.
    pub fn ratio_quantiles<const N: usize>(&self, probabilities: [f64; N]) -> [f64; N] {
        let ascending = sorted(&self.log_ratio);
        probabilities.map(|probability| quantile_of_sorted(&ascending, probability).exp())
    }

    /// Verdict on the ratio: different, equivalent or undecided, given the margin.
    pub fn verdict(&self, margin: f64) -> RatioVerdict {
        let greater = self.probability_above(1.0 + margin);
        let less = 1.0 - self.probability_above(1.0 / (1.0 + margin));
        if greater >= CERTAINTY {
            RatioVerdict::Greater
        } else if less >= CERTAINTY {
            RatioVerdict::Less
        } else if 1.0 - greater - less >= CERTAINTY {
            RatioVerdict::Equivalent
        } else {
            RatioVerdict::Undecided
        }
    }
}

/// Ratios between every pair of groups, for each parameter. `is_declared` marks the ratios whose sign can be stated.
///
/// A sign is stated if it and all more probable signs are correct together in at least a fraction [`SIGN_CERTAINTY`] of the draws.
pub fn contrasts(design: &Design, draws: &[&PopulationDraw], scales: &[SizeScale]) -> Vec<Contrast> {
    let (n_groups, n_parameters) = (design.groups.len(), scales.len());
    let mut all = Vec::new();
    for (parameter, scale) in scales.iter().enumerate() {
        for a in 0..n_groups {
            for b in a + 1..n_groups {
                let at = |draw: &PopulationDraw, group: usize| {
                    scale.ln_value(draw.group_mean[group * n_parameters + parameter])
                };
                let log_ratio = draws.iter().map(|draw| at(draw, a) - at(draw, b)).collect();
                all.push(Contrast { parameter, groups: [a, b], log_ratio, is_declared: false });
            }
        }
    }
    declare(&mut all, draws.len());
    all
}

fn declare(contrasts: &mut [Contrast], n_draws: usize) {
    let is_positive: Vec<bool> = contrasts.iter().map(|contrast| contrast.probability_above(1.0) > 0.5).collect();
    let probability = |index: usize| {
        let above = contrasts[index].probability_above(1.0);
        above.max(1.0 - above)
    };
    let mut order: Vec<(usize, f64)> = (0..contrasts.len()).map(|index| (index, probability(index))).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut is_right = vec![true; n_draws];
    for (index, _) in order {
        for (right, x) in is_right.iter_mut().zip(&contrasts[index].log_ratio) {
            *right &= (*x > 0.0) == is_positive[index];
        }
        if (is_right.iter().filter(|right| **right).count() as f64) < SIGN_CERTAINTY * n_draws as f64 {
            break;
        }
        contrasts[index].is_declared = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contrast(log_ratio: Vec<f64>) -> Contrast {
        Contrast { parameter: 0, groups: [0, 1], log_ratio, is_declared: false }
    }

    /// Two signs of 99.8 % each that are wrong in different draws are correct together with 99.6 %. Only one of them is stated.
    #[test]
    fn statements_are_made_as_long_as_they_are_true_together() {
        const N: usize = 10_000;
        let with_wrong = |wrong: std::ops::Range<usize>| {
            contrast((0..N).map(|i| if wrong.contains(&i) { -1.0 } else { 1.0 }).collect())
        };
        let declared = |mut list: Vec<Contrast>| {
            declare(&mut list, N);
            list.iter().filter(|contrast| contrast.is_declared).count()
        };
        assert_eq!(declared(vec![with_wrong(0..20), with_wrong(20..40)]), 1);
        assert_eq!(declared(vec![with_wrong(0..20), with_wrong(0..20)]), 2);
        assert_eq!(declared(vec![with_wrong(0..40)]), 0);
        let negative = |entry: Contrast| contrast(entry.log_ratio.iter().map(|x| -x).collect());
        assert_eq!(declared(vec![with_wrong(0..15), negative(with_wrong(0..15))]), 2);
    }

    #[test]
    fn verdicts_look_at_the_margin() {
        let at = |ratio: f64| contrast((0..100).map(|i| f64::ln(ratio) + 1e-3 * f64::from(i - 50)).collect());
        assert_eq!(at(2.0).verdict(0.2), RatioVerdict::Greater);
        assert_eq!(at(0.5).verdict(0.2), RatioVerdict::Less);
        assert_eq!(at(1.0).verdict(0.2), RatioVerdict::Equivalent);
        assert_eq!(at(1.2).verdict(0.2), RatioVerdict::Undecided);
        let [q05, median, q95] = at(2.0).ratio_quantiles([0.05, 0.5, 0.95]);
        assert!(q05 < median && median < q95 && (median - 2.0).abs() < 2e-3);
    }
}
