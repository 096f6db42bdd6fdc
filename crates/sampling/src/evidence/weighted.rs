//! Draws from a posterior with weights.

use crate::ensemble::RandomStream;

/// Draws from a posterior, with weights that add up to one.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedDraws {
    /// Points, each a vector of coordinates.
    pub points: Vec<Vec<f64>>,
    /// Weight of each point; the weights add up to one.
    pub weights: Vec<f64>,
}

impl WeightedDraws {
    /// Makes weighted draws from logarithms of unnormalised weights. All weights are equal if no logarithm is finite.
    pub fn new(points: Vec<Vec<f64>>, ln_weights: &[f64]) -> Self {
        Self { weights: normalised(ln_weights), points }
    }

    /// Effective number of draws: the number of equally weighted draws that would give a mean of equal accuracy. It is 1/Σw² for weights w.
    pub fn effective_size(&self) -> f64 {
        effective_size(&self.weights)
    }

    /// Weighted mean of a function of the draws.
    pub fn mean(&self, of: impl Fn(&[f64]) -> f64) -> f64 {
        self.points.iter().zip(&self.weights).map(|(point, weight)| weight * of(point)).sum()
    }

    /// Quantiles of a function `of` of the draws, one for each of `probabilities`. The weighted distribution function has a step at each draw. It is
    /// replaced by lines through the midpoints of the steps and then inverted.
    pub fn quantiles(&self, of: impl Fn(&[f64]) -> f64, probabilities: &[f64]) -> Vec<f64> {
        let with_weight = self.points.iter().zip(&self.weights).filter(|(_, weight)| **weight > 0.0);
        let mut steps: Vec<(f64, f64)> = with_weight.map(|(point, weight)| (of(point), *weight)).collect();
        steps.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut below = 0.0;
        let knots: Vec<(f64, f64)> = steps
            .into_iter()
            .map(|(value, weight)| {
                below += weight;
                (value, below - 0.5 * weight)
            })
            .collect();
        probabilities.iter().map(|probability| interpolated(&knots, *probability)).collect()
    }

    /// Returns the draws with weight 0 where a condition fails, and with the other weights normalised. If the condition holds for no draw with a
    /// positive weight, the draws are unchanged.
    pub fn restricted_to(&self, is_in: impl Fn(&[f64]) -> bool) -> Self {
        let mut part = self.clone();
        let zip = self.points.iter().zip(&mut part.weights);
        zip.for_each(|(point, weight)| *weight *= f64::from(u8::from(is_in(point))));
        let total: f64 = part.weights.iter().sum();
        if total == 0.0 {
            return self.clone();
        }
        part.weights.iter_mut().for_each(|weight| *weight /= total);
        part
    }
}

/// Interpolates the value at a probability between knots (value, probability) in ascending order. Beyond the first and last knot it is constant.
fn interpolated(knots: &[(f64, f64)], probability: f64) -> f64 {
    let after = knots.partition_point(|(_, p)| *p < probability);
    match (after.checked_sub(1).map(|i| knots[i]), knots.get(after)) {
        (Some((x0, p0)), Some(&(x1, p1))) => x0 + (x1 - x0) * (probability - p0) / (p1 - p0),
        (Some((x, _)), None) | (None, Some(&(x, _))) => x,
        (None, None) => f64::NAN,
    }
}

/// Returns normalised weights, given the logarithms of unnormalised weights. The result adds up to one.
pub(super) fn normalised(ln_weights: &[f64]) -> Vec<f64> {
    let top = ln_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if top == f64::NEG_INFINITY {
        return vec![1.0 / ln_weights.len() as f64; ln_weights.len()];
    }
    let weights: Vec<f64> = ln_weights.iter().map(|w| (w - top).exp()).collect();
    let total: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / total).collect()
}

/// Effective number of draws, 1/Σw², for weights w that add up to one.
pub(super) fn effective_size(weights: &[f64]) -> f64 {
    1.0 / weights.iter().map(|weight| weight * weight).sum::<f64>()
}

/// Returns n indices by systematic resampling. The number of times that an index occurs differs from n times its weight by less than one.
pub(super) fn resampled_indices(weights: &[f64], n: usize, stream: &mut RandomStream) -> Vec<usize> {
    let offset = stream.unit();
    let (mut index, mut below) = (0, weights.first().copied().unwrap_or(0.0));
    let pick = |slot: usize| {
        let at = (slot as f64 + offset) / n as f64;
        while below < at && index + 1 < weights.len() {
            index += 1;
            below += weights[index];
        }
        index
    };
    (0..n).map(pick).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks quantiles of a grid of draws whose weights e⁻ˣ represent an exponential distribution. Its quantile at the probability p is −ln(1 − p).
    #[test]
    fn quantiles_are_those_of_the_weighted_distribution() {
        let points: Vec<Vec<f64>> = (0..40_000).map(|i| vec![(f64::from(i) + 0.5) / 2_000.0]).collect();
        let ln_weights: Vec<f64> = points.iter().map(|x| 700.0 - x[0]).collect();
        let draws = WeightedDraws::new(points, &ln_weights);
        let found = draws.quantiles(|x| x[0], &[0.05, 0.5, 0.95]);
        for (found, p) in found.into_iter().zip([0.05_f64, 0.5, 0.95]) {
            assert!((found + (1.0 - p).ln()).abs() < 1e-5, "{found}");
        }
        assert!((draws.mean(|x| x[0]) - 1.0).abs() < 1e-5);
        // For the weights e⁻ˣ on a grid of step h, (Σw)²/Σw² = (1/h)²/(1/2h) = 2/h.
        assert!((draws.effective_size() / 4_000.0 - 1.0).abs() < 1e-4);
    }

    #[test]
    fn resampling_follows_the_weights_to_within_one() {
        let weights = [0.1, 0.0, 0.45, 0.45];
        let mut stream = RandomStream::new(3, 0);
        for _ in 0..50 {
            let picked = resampled_indices(&weights, 10, &mut stream);
            let count = |i: usize| picked.iter().filter(|p| **p == i).count();
            assert!(count(0) == 1 && count(1) == 0 && (4..=5).contains(&count(2)) && picked.len() == 10);
        }
    }

    #[test]
    fn logarithms_far_from_zero_and_no_mass_at_all_give_weights() {
        assert_eq!(normalised(&[-1e5, -1e5]), [0.5, 0.5]);
        assert_eq!(normalised(&[f64::NEG_INFINITY; 4]), [0.25; 4]);
        assert_eq!(normalised(&[0.0, f64::NEG_INFINITY]), [1.0, 0.0]);
    }
}
