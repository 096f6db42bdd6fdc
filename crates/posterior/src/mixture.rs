//! Predictive distribution of a position as a mixture of Gaussians, with its quantiles and score.

use statrs::distribution::{Continuous, ContinuousCDF, Normal};

/// Largest number of cyclic distances between the indices of two components. The mean distance of components in the score is averaged over pairs at these index
/// distances.
const PAIR_DISTANCES: usize = 8;

/// Predictive distribution of one position: a mixture of Gaussians with equal weights, one or several per draw.
pub(super) struct Mixture {
    pub mean_m: Vec<f64>,
    pub sd_m: Vec<f64>,
}

impl Mixture {
    pub fn mean(&self) -> f64 {
        self.mean_m.iter().sum::<f64>() / self.mean_m.len() as f64
    }

    pub fn sd(&self) -> f64 {
        let (n, mean) = (self.mean_m.len() as f64, self.mean());
        let squares = self.mean_m.iter().zip(&self.sd_m).map(|(m, s)| (m - mean).powi(2) + s * s);
        (squares.sum::<f64>() / n).sqrt()
    }

    /// Distribution function and density (1/m) at `x` (m).
    fn cdf_pdf(&self, x: f64) -> (f64, f64) {
        let standard = Normal::standard();
        let n = self.mean_m.len() as f64;
        let (mut cdf, mut pdf) = (0.0, 0.0);
        for (m, s) in self.mean_m.iter().zip(&self.sd_m) {
            let t = (x - m) / s;
            cdf += standard.cdf(t);
            pdf += standard.pdf(t) / s;
        }
        (cdf / n, pdf / n)
    }

    /// Quantile (m) by Newton's method. Bisection keeps the iterates inside a bracket.
    pub fn quantile(&self, probability: f64) -> f64 {
        let (mean, sd) = (self.mean(), self.sd());
        let (mut lower, mut upper) = (mean - 40.0 * sd, mean + 40.0 * sd);
        let mut x = mean + sd * Normal::standard().inverse_cdf(probability);
        for _ in 0..60 {
            let (cdf, pdf) = self.cdf_pdf(x);
            if cdf < probability {
                lower = x
            } else {
                upper = x
            }
            let newton = x - (cdf - probability) / pdf;
            // The error after this step is of the order of the square of the step.
            if (newton - x).abs() <= 1e-5 * sd {
                return newton;
            }
            let next = if newton > lower && newton < upper { newton } else { 0.5 * (lower + upper) };
            x = next;
        }
        x
    }

    /// Continuous ranked probability score (m) of an observation (m) (Grimit et al. 2006, doi:10.1256/qj.05.235).
    ///
    /// The mean distance between two components is averaged over pairs at a few cyclic distances instead of over all n² pairs. If there are few components, all pairs
    /// are used.
    pub fn crps(&self, observed: f64) -> f64 {
        let standard = Normal::standard();
        let spread = |mean: f64, sd: f64| {
            let t = mean / sd;
            2.0 * sd * standard.pdf(t) + mean * (2.0 * standard.cdf(t) - 1.0)
        };
        let n = self.mean_m.len();
        let components = self.mean_m.iter().zip(&self.sd_m);
        let to_observed: f64 = components.clone().map(|(m, s)| spread(observed - m, *s)).sum();
        let with_itself: f64 = components.clone().map(|(_, s)| spread(0.0, s * std::f64::consts::SQRT_2)).sum();
        let distances = pair_distances(n);
        let n_distances = distances.len();
        let with_others: f64 = distances
            .into_iter()
            .flat_map(|distance| (0..n).map(move |i| (i, (i + distance) % n)))
            .map(|(i, j)| spread(self.mean_m[i] - self.mean_m[j], self.sd_m[i].hypot(self.sd_m[j])))
            .sum();
        let others = if n_distances == 0 { 0.0 } else { with_others / (n * n_distances) as f64 };
        let equal = 1.0 / n as f64;
        to_observed * equal - 0.5 * (equal * equal * with_itself + (1.0 - equal) * others)
    }
}

/// Cyclic distances between the indices of paired components. With few components, all distances are used. Otherwise the golden ratio selects some distances, so that
/// neighbours, which belong to one draw, are not over-represented.
fn pair_distances(n: usize) -> Vec<usize> {
    if n <= PAIR_DISTANCES + 1 {
        return (1..n).collect();
    }
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    (1..=PAIR_DISTANCES).map(|k| 1 + ((k as f64 * golden).fract() * (n - 1) as f64) as usize).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the score from selected pairs with the exact score from all pairs. The draws are far apart and have eight components each, as for a Student-t
    /// distribution.
    #[test]
    fn pairs_are_not_of_one_draw() {
        let n = 1024;
        let mean_m: Vec<f64> = (0..n).map(|i| ((i / 8 * 37) % 128) as f64).collect();
        let mixture = Mixture { sd_m: (0..n).map(|i| 1.0 + (i % 8) as f64).collect(), mean_m };
        let spread = |mean: f64, sd: f64| {
            let (t, standard) = (mean / sd, Normal::standard());
            2.0 * sd * standard.pdf(t) + mean * (2.0 * standard.cdf(t) - 1.0)
        };
        let pair =
            |i: usize, j: usize| spread(mixture.mean_m[i] - mixture.mean_m[j], mixture.sd_m[i].hypot(mixture.sd_m[j]));
        let all: f64 = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).map(|(i, j)| pair(i, j)).sum();
        let to_observed: f64 = (0..n).map(|i| spread(40.0 - mixture.mean_m[i], mixture.sd_m[i])).sum();
        let exact = to_observed / n as f64 - 0.5 * all / (n * n) as f64;
        assert!((mixture.crps(40.0) / exact - 1.0).abs() < 0.05, "{} {exact}", mixture.crps(40.0));
    }

    /// A mixture of one component is a Gaussian with known quantiles and score. The continuous ranked probability score of an observation y is y(2Φ(y)−1) + 2φ(y) −
    /// 1/√π for the standard normal.
    #[test]
    fn one_component_has_the_gaussian_closed_forms() {
        let mixture = Mixture { mean_m: vec![2.0], sd_m: vec![3.0] };
        for (p, z) in [(0.05, -1.644_853_626_951_472_2), (0.25, -0.674_489_750_196_081_7), (0.5, 0.0)] {
            assert!((mixture.quantile(p) - (2.0 + 3.0 * z)).abs() < 1e-7);
        }
        let y = 0.7_f64;
        let standard = Normal::standard();
        let exact = y * (2.0 * standard.cdf(y) - 1.0) + 2.0 * standard.pdf(y) - 1.0 / std::f64::consts::PI.sqrt();
        assert!((mixture.crps(2.0 + 3.0 * y) / 3.0 - exact).abs() < 1e-12);
    }

    /// Compares the continuous ranked probability score of a two-component mixture with its integral ∫ (F(x) − 1{x ≥ y})² dx, where F is the distribution function and
    /// y the observation.
    #[test]
    fn mixture_score_equals_its_integral() {
        let mixture = Mixture { mean_m: vec![-1.0, 2.0], sd_m: vec![0.5, 1.5] };
        let (y, h) = (0.4, 1e-3);
        let integral: f64 = (-20_000..20_000)
            .map(|i| (f64::from(i) + 0.5) * h)
            .map(|x| (mixture.cdf_pdf(x).0 - f64::from(u8::from(x >= y))).powi(2) * h)
            .sum();
        assert!((mixture.crps(y) - integral).abs() < 1e-4, "{} {integral}", mixture.crps(y));
        assert!((mixture.cdf_pdf(mixture.quantile(0.3)).0 - 0.3).abs() < 1e-9);
    }
}
