//! Robust statistics, which a few wrong values hardly change.

/// Ratio of the standard deviation of a normal distribution to its median absolute deviation.
pub const SD_PER_MAD: f64 = 1.482_602_218_505_602;

/// Median of finite values; `None` without values.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let (n, middle) = (values.len(), values.len() / 2);
    let (before, upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let lower = if n % 2 == 1 { *upper } else { before.iter().copied().max_by(f64::total_cmp)? };
    Some(0.5 * (lower + *upper))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_of_even_and_odd_counts() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median(vec![]), None);
    }
}
