//! Sorting once for quantiles, ranks and normal scores.

use statrs::distribution::{ContinuousCDF, Normal};

/// Order of a set of values.
pub struct Sorted {
    /// Values ascending, each with its place in the original order.
    entries: Vec<(f64, u32)>,
}

impl Sorted {
    /// Sorts values; at most 2³² − 1 of them. NaN sorts last.
    pub fn new(values: &[f64]) -> Self {
        let mut entries: Vec<(f64, u32)> = values.iter().zip(0u32..).map(|(&value, idx)| (value, idx)).collect();
        entries.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        Self { entries }
    }

    /// Quantile by linear interpolation between order statistics (Hyndman–Fan type 7). NaN when empty.
    pub fn quantile(&self, probability: f64) -> f64 {
        let Some(last) = self.entries.len().checked_sub(1) else { return f64::NAN };
        let position = probability.clamp(0.0, 1.0) * last as f64;
        let below = position as usize;
        let (low, high) = (self.entries[below].0, self.entries[(below + 1).min(last)].0);
        low + (position - below as f64) * (high - low)
    }

    /// Normal scores Φ⁻¹((r − 3/8)/(n + 1/4)) of the ranks r (Blom 1958), ties sharing their mean rank, in the original
    /// order of the values.
    pub fn normal_scores(&self) -> Vec<f64> {
        scores(&self.entries)
    }

    /// Normal scores of |value − centre|, without sorting again: the values left and right of the centre are sorted
    /// already and only need merging.
    pub fn folded_normal_scores(&self, centre: f64) -> Vec<f64> {
        let split = self.entries.partition_point(|entry| entry.0 < centre);
        let (left, right) = self.entries.split_at(split);
        let mut left = left.iter().rev().map(|&(value, idx)| (centre - value, idx)).peekable();
        let mut right = right.iter().map(|&(value, idx)| (value - centre, idx)).peekable();
        let mut merged = Vec::with_capacity(self.entries.len());
        loop {
            let next = match (left.peek(), right.peek()) {
                (Some(a), Some(b)) if a.0 <= b.0 => left.next(),
                (_, Some(_)) => right.next(),
                (Some(_), None) => left.next(),
                (None, None) => break,
            };
            merged.extend(next);
        }
        scores(&merged)
    }
}

fn scores(entries: &[(f64, u32)]) -> Vec<f64> {
    let n = entries.len();
    let normal = Normal::standard();
    let score = |mean_rank: f64| normal.inverse_cdf((mean_rank - 0.375) / (n as f64 + 0.25));
    let mut out = vec![0.0; n];
    let mut start = 0;
    while start < n {
        let mut end = start + 1;
        while end < n && entries[end].0 == entries[start].0 {
            end += 1;
        }
        // Ranks start … end − 1 count from one: their mean is (start + 1 + end)/2.
        let value = score((start + 1 + end) as f64 / 2.0);
        entries[start..end].iter().for_each(|&(_, idx)| out[idx as usize] = value);
        start = end;
    }
    out
}

/// Median of a set of values; NaN when empty.
pub fn median(values: &[f64]) -> f64 {
    Sorted::new(values).quantile(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_share_their_mean_rank() {
        let scores = Sorted::new(&[5.0, 1.0, 5.0]).normal_scores();
        assert_eq!(scores[0], scores[2]);
        let expected = Normal::standard().inverse_cdf((2.5 - 0.375) / 3.25);
        assert!((scores[0] - expected).abs() < 1e-15);
    }

    #[test]
    fn folding_equals_sorting_the_folded_values() {
        let values: Vec<f64> = (0..201).map(|i| ((i * 7919) % 1009) as f64 / 13.0).collect();
        let centre = median(&values);
        let folded: Vec<f64> = values.iter().map(|v| (v - centre).abs()).collect();
        let direct = Sorted::new(&folded).normal_scores();
        assert_eq!(Sorted::new(&values).folded_normal_scores(centre), direct);
    }

    #[test]
    fn quantiles_interpolate() {
        let sorted = Sorted::new(&[4.0, 1.0, 3.0, 2.0]);
        assert_eq!(sorted.quantile(0.0), 1.0);
        assert_eq!(sorted.quantile(0.5), 2.5);
        assert_eq!(sorted.quantile(1.0), 4.0);
        assert!(Sorted::new(&[]).quantile(0.5).is_nan());
    }
}
