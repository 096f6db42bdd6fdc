//! Univariate prior distributions of a parameter x, and their densities in an unconstrained coordinate z.
//!
//! The sampler moves in z. For a parameter that is only bounded below by 0, z is ln x. For an unbounded parameter, z is x itself. For two
//! bounds, z is a logit of the place of x (or of ln x) between the bounds.
//! `ln_pdf_unconstrained` is the log-density of z and includes the Jacobian.

use std::f64::consts::PI;

use rand::{Rng, RngExt};
use statrs::function::beta::{beta_reg, ln_beta};
use statrs::function::erf::{erf, erf_inv, erfc, erfc_inv};

use crate::elementary;

/// Prior distribution of a parameter x. All numbers except shapes and `log_sd` are in the parameter's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distribution {
    /// Log-normal distribution: ln x is normal; median > 0, log_sd > 0.
    LogNormal {
        /// Median of the parameter x.
        median: f64,
        /// Standard deviation of ln x.
        log_sd: f64,
    },
    /// Normal distribution; sd > 0.
    Normal {
        /// Mean of the parameter.
        mean: f64,
        /// Standard deviation of the parameter.
        sd: f64,
    },
    /// Distribution of the absolute value of a normal variable with mean 0; sd > 0.
    HalfNormal {
        /// Standard deviation of the normal variable whose absolute value is the parameter.
        sd: f64,
    },
    /// Uniform distribution; lower < upper.
    Uniform {
        /// Lower bound of the parameter.
        lower: f64,
        /// Upper bound of the parameter.
        upper: f64,
    },
    /// Log-uniform distribution: ln x is uniform; 0 < lower < upper.
    LogUniform {
        /// Lower bound of the parameter.
        lower: f64,
        /// Upper bound of the parameter.
        upper: f64,
    },
    /// Beta distribution, scaled to [lower, upper]; alpha > 0, beta > 0, lower < upper.
    Beta {
        /// First shape parameter α of the beta distribution.
        alpha: f64,
        /// Second shape parameter β of the beta distribution.
        beta: f64,
        /// Lower bound of the parameter.
        lower: f64,
        /// Upper bound of the parameter.
        upper: f64,
    },
}

use Distribution::{Beta, HalfNormal, LogNormal, LogUniform, Normal, Uniform};

/// Standard normal distribution function Φ(t).
fn normal_cdf(t: f64) -> f64 {
    0.5 * erfc(-t * std::f64::consts::FRAC_1_SQRT_2)
}

/// Standard normal quantile Φ⁻¹(p) for 0 < p < 1.
fn normal_quantile(p: f64) -> f64 {
    -std::f64::consts::SQRT_2 * erfc_inv(2.0 * p)
}

/// Returns ln(1 + eᵗ) without overflow.
fn softplus(t: f64) -> f64 {
    t.max(0.0) + (-t.abs()).exp().ln_1p()
}

/// Returns 1/(1 + e⁻ᵗ) without overflow.
fn logistic(t: f64) -> f64 {
    if t >= 0.0 { 1.0 / (1.0 + (-t).exp()) } else { t.exp() / (1.0 + t.exp()) }
}

/// Returns ln(sd √(2π)), the negative logarithm of a normal density's maximum.
fn normal_log_scale(sd: f64) -> f64 {
    sd.ln() + 0.5 * (2.0 * PI).ln()
}

impl Distribution {
    /// Log-normal distribution of a parameter with this mean > 0 and standard deviation > 0.
    pub fn log_normal_from_moments(mean: f64, sd: f64) -> Self {
        let log_variance = (sd / mean).powi(2).ln_1p();
        LogNormal { median: mean * (-0.5 * log_variance).exp(), log_sd: log_variance.sqrt() }
    }

    /// Lower and upper bound of the parameter; −∞ or +∞ if the parameter is unbounded on that side.
    pub fn support(&self) -> (f64, f64) {
        match *self {
            Normal { .. } => (f64::NEG_INFINITY, f64::INFINITY),
            LogNormal { .. } | HalfNormal { .. } => (0.0, f64::INFINITY),
            Uniform { lower, upper } | LogUniform { lower, upper } | Beta { lower, upper, .. } => (lower, upper),
        }
    }

    /// Log-density at x; −∞ outside the support.
    pub fn ln_pdf(&self, x: f64) -> f64 {
        let (lower, upper) = self.support();
        if x.is_nan() || x < lower || x > upper {
            return f64::NEG_INFINITY;
        }
        match *self {
            Normal { mean, sd } => -0.5 * ((x - mean) / sd).powi(2) - normal_log_scale(sd),
            LogNormal { .. } if x == 0.0 => f64::NEG_INFINITY,
            LogNormal { median, log_sd } => {
                -0.5 * ((x / median).ln() / log_sd).powi(2) - normal_log_scale(log_sd) - x.ln()
            }
            HalfNormal { sd } => 2_f64.ln() - 0.5 * (x / sd).powi(2) - normal_log_scale(sd),
            Uniform { lower, upper } => -(upper - lower).ln(),
            LogUniform { lower, upper } => -x.ln() - (upper / lower).ln().ln(),
            Beta { alpha, beta, lower, upper } => {
                let width = upper - lower;
                // For a shape parameter of 1, 0·ln 0 counts as 0, because the density at this end of the support is finite.
                let power = |exponent: f64, base: f64| if exponent == 0.0 { 0.0 } else { exponent * base.ln() };
                power(alpha - 1.0, (x - lower) / width) + power(beta - 1.0, (upper - x) / width)
                    - ln_beta(alpha, beta)
                    - width.ln()
            }
        }
    }

    /// Derivative of [`Distribution::ln_pdf`] with respect to x. It is 0 outside the support, where the log-density is constant at −∞.
    pub fn ln_pdf_slope(&self, x: f64) -> f64 {
        if self.ln_pdf(x) == f64::NEG_INFINITY {
            return 0.0;
        }
        match *self {
            Normal { mean, sd } => (mean - x) / (sd * sd),
            LogNormal { median, log_sd } => -((x / median).ln() / (log_sd * log_sd) + 1.0) / x,
            HalfNormal { sd } => -x / (sd * sd),
            Uniform { .. } => 0.0,
            LogUniform { .. } => -1.0 / x,
            Beta { alpha, beta, lower, upper } => {
                // For a shape parameter of 1, 0/0 counts as 0, because this factor of the density is constant.
                let power = |exponent: f64, base: f64| if exponent == 0.0 { 0.0 } else { exponent / base };
                power(alpha - 1.0, x - lower) - power(beta - 1.0, upper - x)
            }
        }
    }

    /// Probability that the parameter is at most x.
    pub fn cdf(&self, x: f64) -> f64 {
        let (lower, upper) = self.support();
        if x <= lower {
            return 0.0;
        }
        if x >= upper {
            return 1.0;
        }
        match *self {
            Normal { mean, sd } => normal_cdf((x - mean) / sd),
            LogNormal { median, log_sd } => normal_cdf((x / median).ln() / log_sd),
            HalfNormal { sd } => erf(x / sd * std::f64::consts::FRAC_1_SQRT_2),
            Uniform { lower, upper } => (x - lower) / (upper - lower),
            LogUniform { lower, upper } => (x / lower).ln() / (upper / lower).ln(),
            Beta { alpha, beta, lower, upper } => {
                beta_reg(alpha, beta, ((x - lower) / (upper - lower)).clamp(0.0, 1.0))
            }
        }
    }

    /// Quantile of the parameter for the probability `p`. For p ≤ 0 it is the lower end of the support, and for p ≥ 1 the upper end.
    pub fn quantile(&self, p: f64) -> f64 {
        let (low, high) = self.support();
        if p <= 0.0 {
            return low;
        }
        if p >= 1.0 {
            return high;
        }
        match *self {
            Normal { mean, sd } => mean + sd * normal_quantile(p),
            LogNormal { median, log_sd } => median * (log_sd * normal_quantile(p)).exp(),
            HalfNormal { sd } => sd * std::f64::consts::SQRT_2 * erf_inv(p),
            Uniform { lower, upper } => (lower + p * (upper - lower)).clamp(lower, upper),
            LogUniform { lower, upper } => (lower * (p * (upper / lower).ln()).exp()).clamp(lower, upper),
            Beta { .. } => self.bisect(p),
        }
    }

    /// Computes the quantile by bisection on [`Distribution::cdf`], to full floating-point precision.
    fn bisect(&self, p: f64) -> f64 {
        let (mut low, mut high) = self.support();
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                return middle;
            }
            if self.cdf(middle) < p { low = middle } else { high = middle }
        }
    }

    /// Draws one value: the quantile of a uniform random number from `rng`.
    pub fn draw(&self, rng: &mut (impl Rng + ?Sized)) -> f64 {
        // The 53 random bits select one of 2⁵³ cells of (0, 1). The midpoint of a cell is never 0 or 1.
        let cell = rng.random::<u64>() >> 11;
        self.quantile((cell as f64 + 0.5) / (1_u64 << 53) as f64)
    }

    /// Unconstrained coordinate z of the parameter value x. It is ±∞ at an end of the support and NaN outside.
    pub fn to_unconstrained(&self, x: f64) -> f64 {
        match *self {
            Normal { .. } => x,
            LogNormal { .. } | HalfNormal { .. } => x.ln(),
            Uniform { lower, upper } | Beta { lower, upper, .. } => ((x - lower) / (upper - x)).ln(),
            LogUniform { lower, upper } => ((x / lower).ln() / (upper / x).ln()).ln(),
        }
    }

    /// Parameter value x at the unconstrained coordinate z. It lies inside the support or, for extreme z, at an end.
    pub fn from_unconstrained(&self, z: f64) -> f64 {
        match *self {
            Normal { .. } => z,
            LogNormal { .. } | HalfNormal { .. } => z.exp(),
            Uniform { lower, upper } | Beta { lower, upper, .. } => {
                // Computing from the nearer end keeps the significant digits of values close to an end.
                let width = upper - lower;
                if z < 0.0 { lower + width * logistic(z) } else { upper - width * logistic(-z) }
            }
            LogUniform { lower, upper } => (lower * (logistic(z) * (upper / lower).ln()).exp()).clamp(lower, upper),
        }
    }

    /// Fills `x[i]` with the parameter value at the coordinate `z[i]`. The slices have equal length. Exponentials use vector instructions.
    pub fn fill_from_unconstrained(&self, z: &[f64], x: &mut [f64]) {
        match *self {
            LogNormal { .. } | HalfNormal { .. } => {
                x.copy_from_slice(z);
                elementary::exp_all(x);
            }
            _ => x.iter_mut().zip(z).for_each(|(x, z)| *x = self.from_unconstrained(*z)),
        }
    }

    /// Log-density of the unconstrained coordinate at the value z. It includes the Jacobian ln|dx/dz| of the parameter x.
    pub fn ln_pdf_unconstrained(&self, z: f64) -> f64 {
        let mut out = [0.0];
        self.unconstrained().add_ln_pdf(&[z], &mut out);
        out[0]
    }

    /// Returns the density of z with precomputed constants, for loops that evaluate it many times.
    pub fn unconstrained(&self) -> UnconstrainedDensity {
        let gaussian = |mean: f64, sd: f64| UnconstrainedDensity::Gaussian {
            constant: -normal_log_scale(sd),
            mean,
            half_precision: 0.5 / (sd * sd),
        };
        let logistic =
            |alpha: f64, beta: f64| UnconstrainedDensity::Logistic { constant: -ln_beta(alpha, beta), alpha, beta };
        match *self {
            Normal { mean, sd } => gaussian(mean, sd),
            LogNormal { median, log_sd } => gaussian(median.ln(), log_sd),
            HalfNormal { sd } => UnconstrainedDensity::HalfNormal {
                constant: 2_f64.ln() - normal_log_scale(sd),
                half_precision: 0.5 / (sd * sd),
            },
            Uniform { .. } | LogUniform { .. } => logistic(1.0, 1.0),
            Beta { alpha, beta, .. } => logistic(alpha, beta),
        }
    }

    /// Adds the log-density at each coordinate `z[i]` to `out[i]`; see [`UnconstrainedDensity::add_ln_pdf`].
    pub fn add_ln_pdf_unconstrained(&self, z: &[f64], out: &mut [f64]) {
        self.unconstrained().add_ln_pdf(z, out);
    }
}

/// Probability density of a parameter's unconstrained coordinate z, with precomputed constants. It includes the Jacobian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum UnconstrainedDensity {
    /// ln density = constant − half_precision (z − mean)², for normal and log-normal priors.
    Gaussian {
        /// Constant term −ln(sd √(2π)), with sd the standard deviation of the coordinate z.
        constant: f64,
        /// Mean of the coordinate z.
        mean: f64,
        /// 1/(2 sd²), where sd is the standard deviation of z.
        half_precision: f64,
    },
    /// ln density = constant + z − half_precision e²ᶻ, for half-normal priors.
    HalfNormal {
        /// Constant term ln 2 − ln(sd √(2π)), with sd the standard deviation of the normal variable whose absolute value is the parameter.
        constant: f64,
        /// 1/(2 sd²), with sd the standard deviation of the normal variable whose absolute value is the parameter.
        half_precision: f64,
    },
    /// ln density = constant + α ln u + β ln(1 − u), where u = 1/(1 + e⁻ᶻ) has the distribution Beta(α, β).
    Logistic {
        /// Constant term −ln B(α, β), with B the beta function.
        constant: f64,
        /// First shape parameter α of the beta distribution.
        alpha: f64,
        /// Second shape parameter β of the beta distribution.
        beta: f64,
    },
}

impl UnconstrainedDensity {
    /// Adds the log-density at each `z[i]` to `out[i]`. The slices have equal length. The value for a point does not depend on the other points.
    pub fn add_ln_pdf(&self, z: &[f64], out: &mut [f64]) {
        match *self {
            Self::Gaussian { constant, mean, half_precision } => {
                for (out, z) in out.iter_mut().zip(z) {
                    let deviation = z - mean;
                    *out += constant - half_precision * (deviation * deviation);
                }
            }
            Self::HalfNormal { constant, half_precision } => {
                for (out, z) in out.iter_mut().zip(z) {
                    *out += constant + z - half_precision * (2.0 * z).exp();
                }
            }
            Self::Logistic { constant, alpha, beta } => {
                for (out, z) in out.iter_mut().zip(z) {
                    *out += constant - alpha * softplus(-z) - beta * softplus(*z);
                }
            }
        }
    }
}

impl std::fmt::Display for Distribution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let g = |x: f64| {
            let rounded = format!("{x:.3e}").parse::<f64>().unwrap_or(x);
            if x == 0.0 || (1e-3..1e6).contains(&x.abs()) { format!("{rounded}") } else { format!("{rounded:e}") }
        };
        match *self {
            LogNormal { median, log_sd } => write!(f, "log-normal, median {}, log sd {}", g(median), g(log_sd)),
            Normal { mean, sd } => write!(f, "normal, mean {}, sd {}", g(mean), g(sd)),
            HalfNormal { sd } => write!(f, "half-normal, sd {}", g(sd)),
            Uniform { lower, upper } => write!(f, "uniform from {} to {}", g(lower), g(upper)),
            LogUniform { lower, upper } => write!(f, "log-uniform from {} to {}", g(lower), g(upper)),
            Beta { alpha, beta, lower, upper } => {
                write!(f, "beta({}, {}) from {} to {}", g(alpha), g(beta), g(lower), g(upper))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use statrs::distribution::{self as reference, Continuous, ContinuousCDF};

    fn examples() -> Vec<Distribution> {
        vec![
            LogNormal { median: 1.8, log_sd: 1.25 },
            Normal { mean: -0.4, sd: 2.5 },
            HalfNormal { sd: 0.7 },
            Uniform { lower: -1.0, upper: 3.0 },
            LogUniform { lower: 0.01, upper: 50.0 },
            Beta { alpha: 2.5, beta: 1.2, lower: 0.3, upper: 1.0 },
            Beta { alpha: 1.0, beta: 4.0, lower: 0.0, upper: 1.0 },
        ]
    }

    #[test]
    fn the_slope_of_the_log_density_is_its_difference() {
        for distribution in examples() {
            for p in [0.03, 0.4, 0.9] {
                let x = distribution.quantile(p);
                // Densities may change quickly near an end of the support. The step h is therefore a small fraction of the quantile range around p.
                let h = 1e-4 * (distribution.quantile(p + 0.02) - distribution.quantile(p - 0.02));
                let difference = (distribution.ln_pdf(x + h) - distribution.ln_pdf(x - h)) / (2.0 * h);
                let slope = distribution.ln_pdf_slope(x);
                assert!(
                    (slope - difference).abs() < 1e-6 * (1.0 + slope.abs()),
                    "{distribution}: {slope} {difference}"
                );
            }
        }
        assert_eq!(HalfNormal { sd: 0.7 }.ln_pdf_slope(-1.0), 0.0);
    }

    /// Integrates `f` from `lower` to `upper` by the composite Simpson rule.
    fn integral(f: impl Fn(f64) -> f64, lower: f64, upper: f64) -> f64 {
        let n = 40_000;
        let h = (upper - lower) / f64::from(n);
        (0..=n)
            .map(|i| {
                let weight = if i == 0 || i == n { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
                weight * f(lower + f64::from(i) * h)
            })
            .sum::<f64>()
            * h
            / 3.0
    }

    #[test]
    fn densities_integrate_to_one_in_the_sampler_coordinate() {
        for distribution in examples() {
            let total = integral(|z| distribution.ln_pdf_unconstrained(z).exp(), -60.0, 60.0);
            assert!((total - 1.0).abs() < 1e-9, "{distribution:?}: {total}");
        }
    }

    #[test]
    fn both_densities_differ_by_the_jacobian() {
        for distribution in examples() {
            for z in [-2.0, -0.3, 0.0, 0.9, 1.7] {
                let h = 1e-5;
                let slope =
                    (distribution.from_unconstrained(z + h) - distribution.from_unconstrained(z - h)) / (2.0 * h);
                let natural = distribution.ln_pdf(distribution.from_unconstrained(z)) + slope.ln();
                let unconstrained = distribution.ln_pdf_unconstrained(z);
                assert!(
                    (natural - unconstrained).abs() < 1e-7,
                    "{distribution:?} at z = {z}: {natural} {unconstrained}"
                );
            }
        }
    }

    #[test]
    fn the_cdf_is_the_integral_of_the_density() {
        for distribution in examples() {
            for p in [0.03, 0.4, 0.8] {
                let x = distribution.quantile(p);
                let z = distribution.to_unconstrained(x);
                let mass = integral(|z| distribution.ln_pdf_unconstrained(z).exp(), -60.0, z);
                assert!((mass - distribution.cdf(x)).abs() < 1e-9, "{distribution:?}: {mass} {}", distribution.cdf(x));
            }
        }
    }

    #[test]
    fn densities_and_cdfs_agree_with_statrs() {
        let log_normal = reference::LogNormal::new(1.8_f64.ln(), 1.25).unwrap();
        let normal = reference::Normal::new(-0.4, 2.5).unwrap();
        let beta = reference::Beta::new(2.5, 1.2).unwrap();
        let uniform = reference::Uniform::new(-1.0, 3.0).unwrap();
        for x in [0.05, 0.31, 0.5, 0.77, 0.99] {
            let pairs = [
                (examples()[0].ln_pdf(x), log_normal.ln_pdf(x)),
                (examples()[0].cdf(x), log_normal.cdf(x)),
                (examples()[1].ln_pdf(x), normal.ln_pdf(x)),
                (examples()[1].cdf(x), normal.cdf(x)),
                (examples()[3].ln_pdf(x), uniform.ln_pdf(x)),
                (examples()[3].cdf(x), uniform.cdf(x)),
                (examples()[5].ln_pdf(0.3 + 0.7 * x), beta.ln_pdf(x) - 0.7_f64.ln()),
                (examples()[5].cdf(0.3 + 0.7 * x), beta.cdf(x)),
            ];
            for (ours, theirs) in pairs {
                assert!((ours - theirs).abs() < 1e-10, "at {x}: {ours} {theirs}");
            }
        }
    }

    #[test]
    fn quantile_inverts_the_cdf_deep_into_the_tails() {
        for distribution in examples() {
            for p in [1e-9, 1e-4, 0.1, 0.5, 0.9, 1.0 - 1e-4] {
                let back = distribution.cdf(distribution.quantile(p));
                assert!((back - p).abs() <= 1e-9 * p + 1e-15, "{distribution:?}: {p} became {back}");
            }
        }
    }

    #[test]
    fn coordinates_invert_each_other_and_stay_in_the_support() {
        for distribution in examples() {
            let (lower, upper) = distribution.support();
            for z in [-30.0, -5.0, 0.0, 0.4, 5.0] {
                let x = distribution.from_unconstrained(z);
                assert!(x >= lower && x <= upper);
                if z > -20.0 {
                    assert!((distribution.to_unconstrained(x) - z).abs() < 1e-9, "{distribution:?} at {z}");
                }
            }
            for z in [-1e3, 1e3] {
                let x = distribution.from_unconstrained(z);
                assert!(x >= lower && x <= upper && !distribution.ln_pdf_unconstrained(z).is_nan());
            }
        }
    }

    #[test]
    fn outside_the_support_the_density_is_zero() {
        for distribution in examples() {
            let (lower, upper) = distribution.support();
            for x in [lower - 0.1, upper + 0.1].into_iter().filter(|x| x.is_finite()) {
                assert_eq!(distribution.ln_pdf(x), f64::NEG_INFINITY);
                assert_eq!(distribution.cdf(x), if x < lower { 0.0 } else { 1.0 });
            }
            assert_eq!(distribution.ln_pdf(f64::NAN), f64::NEG_INFINITY);
        }
        assert_eq!(examples()[0].ln_pdf(0.0), f64::NEG_INFINITY);
    }

    /// Kolmogorov–Smirnov test on 4,000 draws with the threshold D < 2.75/√n. A correct distribution fails with probability 2·exp(−2·2.75²) = 5e-7.
    #[test]
    fn draws_follow_the_cdf() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(20);
        for distribution in examples() {
            let n = 4000;
            let mut p: Vec<f64> = (0..n).map(|_| distribution.cdf(distribution.draw(&mut rng))).collect();
            p.sort_by(f64::total_cmp);
            let distance =
                p.iter().enumerate().map(|(i, p)| (p - (i as f64 + 0.5) / f64::from(n)).abs()).fold(0.0, f64::max);
            assert!(distance < 2.75 / f64::from(n).sqrt(), "{distribution:?}: {distance}");
        }
    }

    #[test]
    fn a_batch_gives_the_bits_of_single_points() {
        let z: Vec<f64> = (0..37).map(|i| 0.3 * f64::from(i) - 5.0).collect();
        for distribution in examples() {
            let mut batch = vec![0.0; z.len()];
            distribution.add_ln_pdf_unconstrained(&z, &mut batch);
            let single: Vec<u64> = z.iter().map(|z| distribution.ln_pdf_unconstrained(*z).to_bits()).collect();
            assert_eq!(batch.iter().map(|value| value.to_bits()).collect::<Vec<_>>(), single);
        }
    }

    #[test]
    fn moments_are_matched() {
        let distribution = Distribution::log_normal_from_moments(1.66, 0.96);
        let density = |z: f64| distribution.ln_pdf_unconstrained(z).exp();
        let mean = integral(|z| z.exp() * density(z), -40.0, 40.0);
        let square = integral(|z| (2.0 * z).exp() * density(z), -40.0, 40.0);
        assert!((mean - 1.66).abs() < 1e-9 && ((square - mean * mean).sqrt() - 0.96).abs() < 1e-9);
    }
}
