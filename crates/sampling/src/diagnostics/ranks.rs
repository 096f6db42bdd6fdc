//! Quantiles, ranks and normal scores of a set of values. All of them use one sort of the values.

use statrs::distribution::{ContinuousCDF, Normal};

/// Set of values in ascending order, from which quantiles and normal scores follow without a new sort.
pub struct Sorted {
    /// Values in ascending order, each with its index in the original set.
    entries: Vec<(f64, u32)>,
}

impl Sorted {
    /// Sorts at most 2³² − 1 values. NaN sorts last, or first if its sign is negative.
    pub fn new(values: &[f64]) -> Self {
        if let Some(entries) = sorted_by_place(values) {
            return Self { entries };
        }
        let keyed = values.iter().zip(0u32..).map(|(&value, idx)| (ordered_bits(value), idx)).collect();
        let entries = radix_sorted(keyed).into_iter().map(|(_, idx)| (values[idx as usize], idx)).collect();
        Self { entries }
    }

    /// Quantile of the values at a probability, with linear interpolation between order statistics (Hyndman–Fan type 7). NaN if there are no values.
    pub fn quantile(&self, probability: f64) -> f64 {
        let Some(last) = self.entries.len().checked_sub(1) else { return f64::NAN };
        let position = probability.clamp(0.0, 1.0) * last as f64;
        let below = position as usize;
        let (low, high) = (self.entries[below].0, self.entries[(below + 1).min(last)].0);
        low + (position - below as f64) * (high - low)
    }

    /// Normal score of each value's rank, in the original order of the values. Equal values share their mean rank. `blom` must be for the same number of
    /// values.
    pub fn normal_scores(&self, blom: &BlomScores) -> Vec<f64> {
        scores(&self.entries, blom)
    }

    /// Normal scores of the distances |value − centre|, in the original order of the values. The values on either side of the centre are already
    /// sorted, so merging them replaces a new sort.
    pub fn folded_normal_scores(&self, centre: f64, blom: &BlomScores) -> Vec<f64> {
        let split = self.entries.partition_point(|entry| entry.0 < centre);
        let (left, right) = self.entries.split_at(split);
        let (mut below, mut above) = (left.len(), 0);
        let mut merged = Vec::with_capacity(self.entries.len());
        while below > 0 && above < right.len() {
            let (lower, upper) = (left[below - 1], right[above]);
            let (left_distance, right_distance) = (centre - lower.0, upper.0 - centre);
            let is_left = left_distance <= right_distance;
            merged.push(if is_left { (left_distance, lower.1) } else { (right_distance, upper.1) });
            below -= usize::from(is_left);
            above += usize::from(!is_left);
        }
        merged.extend(left[..below].iter().rev().map(|&(value, idx)| (centre - value, idx)));
        merged.extend(right[above..].iter().map(|&(value, idx)| (value - centre, idx)));
        scores(&merged, blom)
    }
}

/// Normal scores Φ⁻¹((r − 3/8)/(n + 1/4)) of all ranks r of n values, with Φ the standard normal distribution function (Blom 1958). One table serves
/// all parameters, because they have equally many draws.
pub struct BlomScores {
    scores: Vec<f64>,
}

impl BlomScores {
    /// Computes the normal scores of the ranks 1 … n.
    pub fn new(n: usize) -> Self {
        let mut scores = vec![0.0; n];
        for k in 0..n / 2 {
            scores[k] = score(n, k as f64 + 1.0);
            scores[n - 1 - k] = -scores[k];
        }
        Self { scores }
    }
}

fn score(n: usize, mean_rank: f64) -> f64 {
    Normal::standard().inverse_cdf((mean_rank - 0.375) / (n as f64 + 0.25))
}

/// Returns the normal scores of sorted entries, in the original order of the values.
fn scores(entries: &[(f64, u32)], blom: &BlomScores) -> Vec<f64> {
    let n = entries.len();
    let mut out = vec![0.0; n];
    let mut start = 0;
    while start < n {
        let mut end = start + 1;
        while end < n && entries[end].0 == entries[start].0 {
            end += 1;
        }
        // The entries have ranks start + 1 … end and share their mean rank. It is an integer only for an odd number of entries.
        let value = if (end - start) % 2 == 1 {
            blom.scores[(start + end - 1) / 2]
        } else {
            score(n, (start + 1 + end) as f64 / 2.0)
        };
        entries[start..end].iter().for_each(|&(_, idx)| out[idx as usize] = value);
        start = end;
    }
    out
}

/// Sorts values by a radix sort on 2³² equal cells between the smallest and the largest value, and by value within a cell. `None` if there are fewer
/// than 2,048 values, if a value is not finite, or if all are equal.
fn sorted_by_place(values: &[f64]) -> Option<Vec<(f64, u32)>> {
    const DIGIT_BITS: usize = 11;
    const N_BUCKETS: usize = 1 << DIGIT_BITS;
    const N_DIGITS: usize = 3;
    let (lowest, highest) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    let scale = f64::from(u32::MAX) / (highest - lowest);
    // The sum is not finite if any value is NaN. Multiplying differences of neighbouring values by the scale keeps their order.
    if values.len() < N_BUCKETS || !scale.is_normal() || !values.iter().sum::<f64>().is_finite() {
        return None;
    }
    let mut ends = [[0_u32; N_BUCKETS]; N_DIGITS];
    let digit = |cell: u32, k: usize| (cell >> (DIGIT_BITS * k)) as usize % N_BUCKETS;
    let mut cells: Vec<(u32, u32)> = Vec::with_capacity(values.len());
    for (value, idx) in values.iter().zip(0_u32..) {
        let cell = ((value - lowest) * scale) as u32;
        (0..N_DIGITS).for_each(|k| ends[k][digit(cell, k)] += 1);
        cells.push((cell, idx));
    }
    let mut sorted = cells.clone();
    for (k, ends) in ends.iter_mut().enumerate() {
        let mut begin = 0;
        for end in ends.iter_mut() {
            (*end, begin) = (begin, begin + *end);
        }
        for &entry in &cells {
            let place = &mut ends[digit(entry.0, k)];
            sorted[*place as usize] = entry;
            *place += 1;
        }
        std::mem::swap(&mut cells, &mut sorted);
    }
    let mut entries: Vec<(f64, u32)> = cells.iter().map(|(_, idx)| (values[*idx as usize], *idx)).collect();
    let mut start = 0;
    for run in cells.chunk_by(|a, b| a.0 == b.0) {
        if run.len() > 1 {
            entries[start..start + run.len()].sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        start += run.len();
    }
    Some(entries)
}

/// Maps a floating-point number to an integer so that the order is kept. −0 comes before +0.
fn ordered_bits(value: f64) -> u64 {
    let bits = value.to_bits();
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}

/// Sorts entries by their first component with a stable radix sort from the least significant digit. Digits that are equal in all entries are
/// skipped.
fn radix_sorted(mut entries: Vec<(u64, u32)>) -> Vec<(u64, u32)> {
    const DIGIT_BITS: u32 = 11;
    const N_BUCKETS: usize = 1 << DIGIT_BITS;
    if entries.len() < N_BUCKETS {
        entries.sort_by_key(|entry| entry.0);
        return entries;
    }
    let mut sorted = entries.clone();
    for shift in (0..u64::BITS).step_by(DIGIT_BITS as usize) {
        let digit = |key: u64| (key >> shift) as usize % N_BUCKETS;
        let mut ends = [0_usize; N_BUCKETS];
        entries.iter().for_each(|entry| ends[digit(entry.0)] += 1);
        if ends.contains(&entries.len()) {
            continue;
        }
        let mut begin = 0;
        for end in &mut ends {
            (*end, begin) = (begin, begin + *end);
        }
        for &entry in &entries {
            let place = &mut ends[digit(entry.0)];
            sorted[*place] = entry;
            *place += 1;
        }
        std::mem::swap(&mut entries, &mut sorted);
    }
    entries
}

/// Median of the values; NaN if there are none.
pub fn median(values: &[f64]) -> f64 {
    Sorted::new(values).quantile(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_share_their_mean_rank() {
        let scores = Sorted::new(&[5.0, 1.0, 5.0]).normal_scores(&BlomScores::new(3));
        assert_eq!(scores[0], scores[2]);
        let expected = Normal::standard().inverse_cdf((2.5 - 0.375) / 3.25);
        assert!((scores[0] - expected).abs() < 1e-15);
    }

    #[test]
    fn folding_equals_sorting_the_folded_values() {
        let values: Vec<f64> = (0..201).map(|i| ((i * 7919) % 1009) as f64 / 13.0).collect();
        let centre = median(&values);
        let folded: Vec<f64> = values.iter().map(|v| (v - centre).abs()).collect();
        let blom = BlomScores::new(201);
        let direct = Sorted::new(&folded).normal_scores(&blom);
        assert_eq!(Sorted::new(&values).folded_normal_scores(centre, &blom), direct);
    }

    #[test]
    fn many_values_are_sorted_as_few_are() {
        let values: Vec<f64> = (0..5_000_i64).map(|i| ((i * 7919) % 4999 - 2500) as f64 * 0.37e-3).collect();
        let mut expected = values.clone();
        expected.sort_by(f64::total_cmp);
        let sorted = Sorted::new(&values);
        assert!(sorted.entries.iter().zip(&expected).all(|(a, b)| a.0 == *b));
        assert!(sorted.entries.iter().all(|&(value, idx)| values[idx as usize] == value));
    }

    /// Checks that values are sorted even if one distant value puts all others into a few cells. Equal values keep their order.
    #[test]
    fn outliers_do_not_spoil_the_order() {
        let mut values: Vec<f64> = (0..6_000_i64).map(|i| ((i * 7919) % 2999 - 1500) as f64 * 0.37e-3).collect();
        values[17] = 1e9;
        let sorted = Sorted::new(&values);
        let mut expected: Vec<(f64, u32)> = values.iter().copied().zip(0..).collect();
        expected.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert_eq!(sorted.entries, expected);
        values[18] = f64::NAN;
        assert!(Sorted::new(&values).entries.last().is_some_and(|(value, _)| value.is_nan()));
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
