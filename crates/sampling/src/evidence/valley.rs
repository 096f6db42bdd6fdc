//! Search for a valley between two modes in the posterior density of one quantity.
//!
//! The density of the weighted draws is smoothed with a normal kernel. The kernel has the usual width for a single mode (Silverman 1986, eq. 3.31).
//! This width is too large for two modes, so a valley that remains is real. Each mode needs a minimum fraction of the draws. The valley must also be
//! deeper than the sampling error explains.

use super::WeightedDraws;

/// Smallest accepted ratio of the lower peak's density to the density in the valley.
const LEAST_DEPTH: f64 = 2.0;
/// Smallest accepted difference between the density at the lower peak and in the valley, in standard errors of this difference.
const LEAST_ERRORS: f64 = 4.0;
/// Smallest fraction of the draws that each mode must have.
const LEAST_SHARE: f64 = 0.05;
const N_NODES: usize = 160;
/// Largest distance from a draw at which its kernel is evaluated, in kernel widths.
const REACH: f64 = 4.0;
/// Difference between the upper and lower quartile of a standard normal distribution.
const QUARTILES_APART: f64 = 1.349;

/// Finds the deepest valley in the density of a quantity, which is a function `of` of the draws. Returns the quantity's value at the bottom of the
/// valley; `None` if there is only one mode.
pub fn find_density_valley(draws: &WeightedDraws, of: impl Fn(&[f64]) -> f64) -> Option<f64> {
    let [low, lower, upper, high] = draws.quantiles(&of, &[0.001, 0.25, 0.75, 0.999]).try_into().ok()?;
    let mean = draws.mean(&of);
    let sd = draws.mean(|point| (of(point) - mean).powi(2)).sqrt();
    let spread = sd.min((upper - lower) / QUARTILES_APART);
    let n_effective = draws.effective_size();
    let width = 0.9 * spread * n_effective.powf(-0.2);
    if !(width > 0.0 && width.is_finite() && high > low) {
        return None;
    }
    let step = (high - low) / (N_NODES - 1) as f64;
    let node = |k: usize| low + step * k as f64;
    let mut density = vec![0.0; N_NODES];
    for (point, weight) in draws.points.iter().zip(&draws.weights).filter(|(_, weight)| **weight > 0.0) {
        let value = of(point);
        let place = |x: f64| ((x - low) / step).clamp(0.0, (N_NODES - 1) as f64);
        let nodes = place(value - REACH * width).floor() as usize..=place(value + REACH * width).ceil() as usize;
        for k in nodes {
            density[k] += weight * (-0.5 * ((node(k) - value) / width).powi(2)).exp();
        }
    }
    // Each kernel integrates to one. Its square integrates to 1/(2 √π width). This integral, divided by the effective number of draws, is the
    // variance of the smoothed density per unit density.
    density.iter_mut().for_each(|value| *value /= width * std::f64::consts::TAU.sqrt());
    let unit_variance = 1.0 / (2.0 * std::f64::consts::PI.sqrt() * width * n_effective);
    let highest = |nodes: &[f64]| nodes.iter().copied().fold(0.0, f64::max);
    let peak = |k: usize| highest(&density[..k]).min(highest(&density[k + 1..]));
    let depth = |k: usize| peak(k) / density[k].max(f64::MIN_POSITIVE);
    let share = |k: usize| draws.mean(|point| f64::from(u8::from(of(point) < node(k))));
    let is_shared = |k: &usize| (LEAST_SHARE..=1.0 - LEAST_SHARE).contains(&share(*k));
    let deepest = (1..N_NODES - 1).filter(is_shared).max_by(|a, b| depth(*a).total_cmp(&depth(*b)))?;
    let error = (unit_variance * (peak(deepest) + density[deepest])).sqrt();
    let is_valley = depth(deepest) >= LEAST_DEPTH && peak(deepest) - density[deepest] >= LEAST_ERRORS * error;
    is_valley.then(|| node(deepest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ensemble::RandomStream;

    fn draws(n: usize, seed: u64, of: impl Fn(&mut RandomStream) -> f64) -> WeightedDraws {
        let mut stream = RandomStream::new(seed, 0);
        WeightedDraws::new((0..n).map(|_| vec![of(&mut stream)]).collect(), &vec![0.0; n])
    }

    /// Checks that the valley between two normals at a distance of six standard deviations is found. The second has a fifth of the draws. With 1,000
    /// draws, its peak is seven standard errors above the valley (four are required). The standard error of the fraction is 0.013 (five standard
    /// errors are allowed).
    #[test]
    fn two_bumps_have_a_valley_between_them() {
        let two = |stream: &mut RandomStream| stream.normal() + if stream.unit() < 0.2 { 6.0 } else { 0.0 };
        for seed in 0..20 {
            let draws = draws(1_000, seed, two);
            let bottom = find_density_valley(&draws, |x| x[0]).expect("two answers");
            let share = draws.mean(|x| f64::from(u8::from(x[0] > bottom)));
            assert!((1.5..5.0).contains(&bottom) && (share - 0.2).abs() < 0.065, "{bottom} {share}");
        }
    }

    /// Checks that a single mode has no valley, whether it is normal, uniform or has a long tail. The test uses 200 draws of each distribution, 100
    /// times.
    #[test]
    fn one_bump_has_no_valley() {
        for seed in 0..100 {
            assert_eq!(find_density_valley(&draws(200, seed, RandomStream::normal), |x| x[0]), None);
            assert_eq!(find_density_valley(&draws(200, seed, RandomStream::unit), |x| x[0]), None);
            assert_eq!(find_density_valley(&draws(200, seed, |stream| -stream.unit().ln()), |x| x[0]), None);
        }
    }

    #[test]
    fn a_share_that_is_not_worth_a_word_and_no_spread_at_all_are_no_answers() {
        let rare = |stream: &mut RandomStream| stream.normal() + if stream.unit() < 0.01 { 9.0 } else { 0.0 };
        assert_eq!(find_density_valley(&draws(2_000, 3, rare), |x| x[0]), None);
        assert_eq!(find_density_valley(&draws(200, 3, |_| 1.0), |x| x[0]), None);
    }
}
