//! Convergence diagnostics of independent chains, by the definitions of Vehtari et al. 2021 (doi:10.1214/20-BA1221).

use super::autocovariance::{integrate, sample_variance};
use super::chains::Chains;
use super::ranks::{Sorted, median};

/// Rank-normalised split R̂: the larger of the R̂ of the normal scores and the R̂ of the folded scores (Vehtari et al. 2021, eqs. 1–4 and §3.1). NaN
/// for fewer than four draws or two chains.
pub fn rhat(chains: &Chains) -> f64 {
    if chains.n_chains() < 2 || chains.n_draws() < 4 || !chains.varies() {
        return f64::NAN;
    }
    let split = chains.split();
    let centre = median(&split.flat());
    let folded = split.map(|value| (value - centre).abs());
    plain_rhat(&split.rank_normalised()).max(plain_rhat(&folded.rank_normalised()))
}

fn plain_rhat(chains: &Chains) -> f64 {
    let n = chains.n_draws() as f64;
    let means: Vec<f64> = chains.iter().map(|chain| chain.iter().sum::<f64>() / n).collect();
    let within = chains.iter().map(sample_variance).sum::<f64>() / chains.n_chains() as f64;
    ((n - 1.0) / n + sample_variance(&means) / within).sqrt()
}

/// Effective number of draws for the location of the distribution (bulk), from the split, rank-normalised chains. NaN if undefined.
pub fn ess_bulk(chains: &Chains) -> f64 {
    if chains.n_draws() < 4 { f64::NAN } else { ess(&chains.split().rank_normalised()) }
}

/// Smaller of the effective numbers of draws for the 5 % and the 95 % quantile. NaN if undefined.
pub fn ess_tail(chains: &Chains) -> f64 {
    if chains.n_draws() < 4 {
        return f64::NAN;
    }
    let flat = chains.flat();
    let sorted = Sorted::new(&flat);
    let at = |probability: f64| {
        let quantile = sorted.quantile(probability);
        ess(&chains.split().map(|value| f64::from(value <= quantile)))
    };
    at(0.05).min(at(0.95))
}

/// Effective number of draws for the mean. NaN if undefined.
pub fn ess_mean(chains: &Chains) -> f64 {
    if chains.n_draws() < 4 { f64::NAN } else { ess(&chains.split()) }
}

/// Monte Carlo standard error of the mean, in the unit of the draws.
pub fn mcse_mean(chains: &Chains) -> f64 {
    (sample_variance(&chains.flat()) / ess_mean(chains)).sqrt()
}

/// Integrated autocorrelation time: number of draws divided by [`ess_mean`].
pub fn autocorrelation_time(chains: &Chains) -> f64 {
    (chains.n_chains() * chains.n_draws()) as f64 / ess_mean(chains)
}

fn ess(chains: &Chains) -> f64 {
    let n = (chains.n_chains() * chains.n_draws()) as f64;
    if chains.iter().flatten().any(|value| !value.is_finite()) {
        return f64::NAN;
    }
    // Constant values are not correlated, so every draw counts fully.
    if !chains.varies() {
        return n;
    }
    integrate(chains).map_or(f64::NAN, |integrated| n / integrated.time)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Returns first-order autoregressive chains with coefficient φ and unit variance. Their autocorrelation time is exactly τ = (1 + φ)/(1 − φ).
    fn ar1(phi: f64, n_chains: usize, n_draws: usize, seed: u64) -> Chains {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { rng.sample(rand_distr::StandardNormal) };
        let chain = |normal: &mut dyn FnMut() -> f64| {
            let mut x = normal();
            (0..n_draws)
                .map(|_| {
                    x = phi * x + (1.0 - phi * phi).sqrt() * normal();
                    x
                })
                .collect::<Vec<f64>>()
        };
        Chains::new((0..n_chains).map(|_| chain(&mut normal)).collect())
    }

    /// Compares estimated autocorrelation times with the exact τ of autoregressive chains. For n = 400,000 draws at φ = 0.9 and a window of 2.5 τ,
    /// Sokal's formula gives a relative error of about √(2·(2·2.5τ)/n) = 2.2 %. The tolerance is six times this error.
    #[test]
    fn known_autocorrelation_time_is_recovered() {
        for (phi, tolerance) in [(0.9_f64, 0.13), (0.0, 0.06), (-0.6, 0.10)] {
            let exact = (1.0 + phi) / (1.0 - phi);
            let time = autocorrelation_time(&ar1(phi, 4, 100_000, 11));
            assert!((time / exact - 1.0).abs() < tolerance, "phi {phi}: {time} against {exact}");
        }
    }

    #[test]
    fn shifted_chain_is_seen_by_rhat_and_not_without_the_shift() {
        let chains = ar1(0.5, 4, 2_000, 3);
        assert!(rhat(&chains) < 1.01);
        let mut shifted: Vec<Vec<f64>> = chains.iter().map(<[f64]>::to_vec).collect();
        shifted[2].iter_mut().for_each(|x| *x += 1.0);
        assert!(rhat(&Chains::new(shifted)) > 1.05);
    }

    #[test]
    fn scale_difference_is_seen_by_the_folded_part() {
        let mut chains: Vec<Vec<f64>> = ar1(0.0, 4, 2_000, 5).iter().map(<[f64]>::to_vec).collect();
        chains[0].iter_mut().for_each(|x| *x *= 3.0);
        assert!(rhat(&Chains::new(chains)) > 1.05);
    }

    #[test]
    fn undefined_cases_are_nan() {
        assert!(rhat(&Chains::new(vec![vec![1.0, 2.0, 3.0, 4.0]])).is_nan());
        assert!(ess_bulk(&Chains::new(vec![vec![1.0, 2.0, 3.0]; 2])).is_nan());
        assert!(ess_mean(&Chains::new(vec![vec![1.0, f64::NAN, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]; 2])).is_nan());
    }
}
