//! Quantiles of a specimen's parameters from its own experiments, without pooling. They include the scatter between repeats.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::hierarchy::InterimDraws;
use figures::density::{quantile_of_sorted, sorted};

/// Number of simulated values of a specimen's coordinate.
const N_DRAWS: usize = 4_000;
/// Number of the random stream of the simulated values. The population and its predictions use other streams.
const STREAM: u64 = 1 << 40;

/// Computes the 5 %, 50 % and 95 % quantiles of a specimen's coordinate `k`, from the draws of its experiments. Each draw has `p` coordinates.
///
/// An experiment differs from its specimen by the scatter of repeats; `within` holds draws of the variance W of this scatter. A simulated value of the
/// specimen is the mean of one draw from each of its n experiments, plus a normal number of variance W/n. If the cohort has no repeats, `within` is empty,
/// and the draws of the single experiment are used directly.
pub fn unpooled_quantiles(experiments: &[&InterimDraws], within: &[f64], k: usize, p: usize, seed: u64) -> [f64; 3] {
    let of_values = |values: &[f64]| {
        let ascending = sorted(values);
        [0.05, 0.5, 0.95].map(|probability| quantile_of_sorted(&ascending, probability))
    };
    if let ([only], []) = (experiments, within) {
        return of_values(&only.coordinates.iter().skip(k).step_by(p).copied().collect::<Vec<f64>>());
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(STREAM);
    let n = experiments.len() as f64;
    let simulated = |index: usize| {
        let sum: f64 =
            experiments.iter().map(|experiment| experiment.get(rng.random_range(0..experiment.len()))[k]).sum();
        let variance = within.get(index * within.len() / N_DRAWS).copied().unwrap_or(0.0);
        let noise: f64 = StandardNormal.sample(&mut rng);
        sum / n + (variance / n).sqrt() * noise
    };
    of_values(&(0..N_DRAWS).map(simulated).collect::<Vec<f64>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each of 400 specimens has 3 repeats, which are known to 0.001 and scatter by 0.1. The 90 % intervals must contain the true value of 335 to 385
    /// specimens, which correct intervals do with a probability above 1 − 1e-4. Intervals without the scatter would contain the true value of only 1 in 60
    /// specimens.
    #[test]
    fn intervals_hold_as_many_specimens_as_they_say() {
        const SCATTER: f64 = 0.1;
        let mut rng = ChaCha8Rng::seed_from_u64(17);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut rng) };
        let mut n_inside = 0;
        for seed in 0..400 {
            let truth = normal();
            let experiments: Vec<InterimDraws> = (0..3)
                .map(|_| {
                    let centre = truth + SCATTER * normal() + 1e-3 * normal();
                    let draws: Vec<f64> = (0..200).map(|_| centre + 1e-3 * normal()).collect();
                    InterimDraws::new(draws, vec![0.0; 200])
                })
                .collect();
            let of: Vec<&InterimDraws> = experiments.iter().collect();
            let [q05, median, q95] = unpooled_quantiles(&of, &[SCATTER * SCATTER; 50], 0, 1, seed);
            assert!(q05 < median && median < q95);
            n_inside += usize::from(q05 < truth && truth < q95);
        }
        assert!((335..=385).contains(&n_inside), "{n_inside}");
    }

    #[test]
    fn without_repeats_they_are_the_experiment_s_own() {
        let draws = InterimDraws::new((0..101).map(f64::from).collect(), vec![0.0; 101]);
        assert_eq!(unpooled_quantiles(&[&draws], &[], 0, 1, 3), [5.0, 50.0, 95.0]);
    }
}
