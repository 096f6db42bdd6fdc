//! Variance between specimens, and detection of specimens that are far from their group.

use statrs::distribution::{ContinuousCDF, StudentsT};

use sampling::diagnostics::ranks::median;

/// Approximate probability that at least one specimen is marked in a cohort without outlying specimens. A mark only leads to a remark.
const FALSE_ALARM: f64 = 0.1;
/// Degrees of freedom per specimen, where one specimen of each group does not count. The ratio of a deviation to the median absolute deviation has the
/// tails of a Student-t distribution with these degrees of freedom. The value comes from simulations; it approaches 0.37 for many specimens.
const DEGREES: f64 = 0.3;
/// Median absolute deviation of a normal distribution, in standard deviations.
const NORMAL_MAD: f64 = 0.674_489_750_196_081_7;
/// Smallest number of specimens from which the spread is estimated well enough to mark outlying specimens.
const FEWEST: usize = 6;

/// Unbiased sample variance.
pub fn variance(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)
}

/// Returns `true` for each specimen that is far from the median of its group. Deviations are divided by the median absolute deviation of all groups
/// together. Rows of `values` are specimens, and columns are parameters. In groups of fewer than three specimens, none is marked.
///
/// The method is the modified z-score of Iglewicz & Hoaglin (1993, How to Detect and Handle Outliers). One threshold applies to all specimens and
/// parameters together.
pub fn outlying(values: &[Vec<f64>], group_of: &[usize]) -> Vec<bool> {
    let n = values.len();
    let p = values.first().map_or(0, Vec::len);
    let is_counted = |s: usize| group_of.iter().filter(|group| **group == group_of[s]).count() >= 3;
    let counted: Vec<usize> = (0..n).filter(|s| is_counted(*s)).collect();
    let mut is_outlying = vec![false; n];
    if counted.len() < FEWEST {
        return is_outlying;
    }
    let tail = FALSE_ALARM / (2 * p * counted.len()) as f64;
    let mut groups: Vec<usize> = counted.iter().map(|s| group_of[*s]).collect();
    groups.sort_unstable();
    groups.dedup();
    let degrees = DEGREES * (counted.len() - groups.len()) as f64;
    let Ok(student) = StudentsT::new(0.0, 1.0, degrees) else { return is_outlying };
    let most = student.inverse_cdf(1.0 - tail);
    for k in 0..p {
        let column: Vec<f64> = values.iter().map(|row| row[k]).collect();
        let deviation = |s: usize| {
            let entry: Vec<f64> = (0..n).filter(|o| group_of[*o] == group_of[s]).map(|o| column[o]).collect();
            (column[s] - median(&entry)).abs()
        };
        let deviations: Vec<f64> = counted.iter().map(|s| deviation(*s)).collect();
        let bar = most * median(&deviations) / NORMAL_MAD;
        for (s, deviation) in counted.iter().zip(&deviations) {
            is_outlying[*s] |= *deviation > bar;
        }
    }
    is_outlying
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_far_specimen_is_found() {
        let values: Vec<Vec<f64>> =
            [0.1, -0.2, 0.05, -9.0, 0.15, 2.0, 2.1, 1.8, 5.0].iter().map(|x| vec![*x]).collect();
        let group_of = [0, 0, 0, 0, 0, 1, 1, 1, 2];
        let expected = [false, false, false, true, false, false, false, false, false];
        assert_eq!(outlying(&values, &group_of), expected);
        assert!((variance(&[1.0, 2.0, 3.0, 4.0]) - 5.0 / 3.0).abs() < 1e-15);
    }

    /// Simulates 1,000 normal cohorts with three groups of seven specimens and three parameters. About 100 of them give a false alarm by design. At a rate
    /// of 10 %, more than 148 false alarms have a probability below 1e-6. At a rate below 2 %, which a far too high threshold causes, fewer than 30 false
    /// alarms have a probability of 0.99.
    #[test]
    fn cohorts_without_outlying_specimens_have_few() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let group_of: Vec<usize> = (0..21).map(|s| s / 7).collect();
        let mut n_false = 0;
        for _ in 0..1_000 {
            let values: Vec<Vec<f64>> =
                (0..21).map(|_| (0..3).map(|_| StandardNormal.sample(&mut rng)).collect()).collect();
            n_false += usize::from(outlying(&values, &group_of).contains(&true));
        }
        assert!((30..=148).contains(&n_false), "{n_false}");
    }
}
