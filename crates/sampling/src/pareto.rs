//! Tail shape k̂ of importance weights, which tells whether an estimate with these weights is reliable.

/// Largest range of the logarithms of weights that count as equal. Log likelihoods have rounding errors of this size.
const EQUAL_LN_WEIGHTS: f64 = 1e-4;

/// Returns the tail shape k̂ of importance weights, given the weights' logarithms (Vehtari, Simpson, Gelman, Yao, Gabry 2024, "Pareto smoothed
/// importance sampling", JMLR 25:72). The fit follows Zhang and Stephens 2009, doi:10.1198/tech.2009.08017.
///
/// Importance sampling is reliable if k̂ is below 0.7. The result is 0 if the logarithms differ by less than 1e-4, because the tail's shape is then due
/// to rounding errors. The result is infinite if the tail has fewer than five weights.
pub fn pareto_k(ln_weights: &[f64]) -> f64 {
    let n = ln_weights.len() as f64;
    let mut sorted = ln_weights.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (Some(&smallest), Some(&largest)) = (sorted.first(), sorted.last()) else { return f64::INFINITY };
    if largest - smallest < EQUAL_LN_WEIGHTS {
        return 0.0;
    }
    let n_tail = (0.2 * n).min(3.0 * n.sqrt()).ceil() as usize;
    let Some(cutoff) = sorted.len().checked_sub(n_tail + 1).map(|i| sorted[i] - largest) else { return f64::INFINITY };
    let excesses: Vec<f64> =
        sorted.iter().map(|w| w - largest).filter(|w| *w > cutoff).map(|w| w.exp() - cutoff.exp()).collect();
    if excesses.len() < 5 { f64::INFINITY } else { generalised_pareto_shape(&excesses) }
}

/// Returns the shape of a generalised Pareto distribution that is fitted to positive excesses in ascending order. The quasi-Bayesian estimate has a
/// weak prior at 0.5.
fn generalised_pareto_shape(ascending: &[f64]) -> f64 {
    const PRIOR_SCALE: f64 = 3.0;
    const PRIOR_WEIGHT: f64 = 10.0;
    let n = ascending.len() as f64;
    let n_grid = 30 + n.sqrt() as usize;
    let quartile = ascending[((n / 4.0 + 0.5) as usize).max(1) - 1];
    let largest = ascending[ascending.len() - 1];
    let shape = |b: f64| ascending.iter().map(|x| (-b * x).ln_1p()).sum::<f64>() / n;
    let grid: Vec<f64> = (1..=n_grid)
        .map(|i| (1.0 - (n_grid as f64 / (i as f64 - 0.5)).sqrt()) / (PRIOR_SCALE * quartile) + 1.0 / largest)
        .collect();
    let ln_likelihood: Vec<f64> = grid
        .iter()
        .map(|&b| {
            let k = shape(b);
            n * ((-b / k).ln() - k - 1.0)
        })
        .collect();
    let top = ln_likelihood.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = ln_likelihood.iter().map(|l| (l - top).exp()).collect();
    let total: f64 = weights.iter().sum();
    let b = grid.iter().zip(&weights).map(|(b, w)| b * w).sum::<f64>() / total;
    (n * shape(b) + 0.5 * PRIOR_WEIGHT) / (n + PRIOR_WEIGHT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Pareto};

    #[test]
    fn equal_weights_have_no_tail_and_few_weights_no_estimate() {
        assert_eq!(pareto_k(&[-3.0; 100]), 0.0);
        assert_eq!(pareto_k(&[1.0, 2.0, 3.0]), f64::INFINITY);
    }

    /// Tests weights whose logarithms have a range slightly smaller and slightly larger than [`EQUAL_LN_WEIGHTS`].
    #[test]
    fn weights_equal_up_to_rounding_have_no_tail() {
        let within = |range: f64| -> Vec<f64> { (0..100).map(|i| -700.0 + range * f64::from(i) / 99.0).collect() };
        assert_eq!(pareto_k(&within(0.9e-4)), 0.0);
        assert_ne!(pareto_k(&within(1.1e-4)), 0.0);
    }

    /// k̂ equals the result of `arviz.psislw` 0.23.4 for heavy, light and bounded tails, with few and many weights.
    #[test]
    fn shapes_are_those_of_arviz() {
        let pareto =
            |n: u32, k: f64| -> Vec<f64> { (1..=n).map(|i| -k * ((f64::from(i) - 0.5) / f64::from(n)).ln()).collect() };
        let golden = |i: u32| (f64::from(i) * 0.618_033_988_749_894_9) % 1.0;
        let sine = |n: u32, scale: f64| -> Vec<f64> { (1..=n).map(|i| scale * f64::from(i).sin()).collect() };
        let cases = [
            (pareto(50, 0.7), 0.540_828_212_163_428_6),
            (pareto(200, 0.3), 0.349_036_971_473_985_9),
            (pareto(600, 1.2), 1.080_632_043_653_352),
            ((1..=300).map(|i| 0.5 * (6.0 * golden(i) - 3.0).powi(2)).collect(), -0.293_826_427_654_561_85),
            (sine(80, 2.0), -0.712_040_519_562_677_1),
            ((1..=400).map(|i| -golden(i)).collect(), -0.684_443_013_166_308_2),
            (sine(100, 1e-3), -0.838_424_840_578_327_3),
        ];
        for (ln_weights, expected) in cases {
            let found = pareto_k(&ln_weights);
            assert!((found - expected).abs() < 1e-6, "{found} against {expected} of {} weights", ln_weights.len());
        }
    }

    /// Checks k̂ of weights with a Pareto tail of index α, for which the true shape is k = 1/α. The tail of 200,000 weights contains about 1,340
    /// weights. The standard deviation of k̂ is then (1 + k)/√1340 ≈ 0.04. The tolerance of ±0.2 is five standard deviations (false failure below
    /// 1e-6 for each α).
    #[test]
    fn pareto_tails_are_recognised() {
        for (seed, alpha) in [(1, 5.0), (2, 2.0), (3, 1.0)] {
            let tail = Pareto::new(1.0, alpha).expect("positive");
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            let ln_weights: Vec<f64> = (0..200_000).map(|_| f64::ln(tail.sample(&mut rng))).collect();
            let k = pareto_k(&ln_weights);
            assert!((k - 1.0 / alpha).abs() < 0.2, "{k} against {}", 1.0 / alpha);
        }
    }
}
