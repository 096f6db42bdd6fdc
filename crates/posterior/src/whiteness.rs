//! Tests of whitened residuals for whiteness: runs of one sign, and autocorrelation.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Number of lags at which autocorrelations are computed.
pub const N_LAGS: usize = 10;

/// Autocorrelation of the residuals around zero, at lags 1 to [`N_LAGS`].
pub fn autocorrelation(residuals: &[f64]) -> Vec<f64> {
    let square: f64 = residuals.iter().map(|r| r * r).sum();
    let at = |lag: usize| residuals.iter().zip(residuals.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
    (1..=N_LAGS).map(|lag| if square > 0.0 { at(lag) / square } else { 0.0 }).collect()
}

/// Half the Ljung–Box statistic (1978) over [`N_LAGS`] lags, which is a gain of the log likelihood in nats.
pub fn ljung_box(residuals: &[f64]) -> f64 {
    let n = residuals.len() as f64;
    let of_lag = |(rho, lag): (&f64, usize)| if n > lag as f64 { rho * rho / (n - lag as f64) } else { 0.0 };
    0.5 * n * (n + 2.0) * autocorrelation(residuals).iter().zip(1..).map(of_lag).sum::<f64>()
}

/// Standard score of the number of runs of one sign (Wald and Wolfowitz, 1940); negative for few long runs.
pub fn runs_score(residuals: &[f64]) -> f64 {
    let signs: Vec<bool> = residuals.iter().map(|r| *r >= 0.0).collect();
    let n = signs.len() as f64;
    let positive = signs.iter().filter(|sign| **sign).count() as f64;
    let both = 2.0 * positive * (n - positive);
    let n_runs = 1.0 + signs.windows(2).filter(|pair| pair[0] != pair[1]).count() as f64;
    let mean = both / n + 1.0;
    let variance = both * (both - n) / (n * n * (n - 1.0));
    if variance > 0.0 { (n_runs - mean) / variance.sqrt() } else { 0.0 }
}

/// Half the square of [`runs_score`], which is a gain of the log likelihood in nats.
pub fn runs(residuals: &[f64]) -> f64 {
    0.5 * runs_score(residuals).powi(2)
}

/// Half width of the interval that contains an autocorrelation of `n` white residuals with a probability of 95 %.
pub fn white_limit(n: usize) -> f64 {
    ChiSquared::new(1.0).map_or(1.96, |chi| chi.inverse_cdf(0.95).sqrt()) / (n.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sampling::ensemble::RandomStream;

    /// About 5 % of 1000 white records exceed the 95 % point of χ². The limit is six standard errors of this fraction, so the test fails by chance with a probability
    /// of about 1e-8.
    #[test]
    fn white_residuals_are_called_white_as_often_as_they_should() {
        let limits = [10.0, 1.0].map(|degrees| ChiSquared::new(degrees).expect("positive").inverse_cdf(0.95));
        let mut exceeded = [0_usize; 2];
        for record in 0..1000 {
            let mut stream = RandomStream::new(5, record);
            let white: Vec<f64> = (0..600).map(|_| stream.normal()).collect();
            exceeded[0] += usize::from(2.0 * ljung_box(&white) > limits[0]);
            exceeded[1] += usize::from(2.0 * runs(&white) > limits[1]);
        }
        let error = 6.0 * (0.05 * 0.95 * 1000.0_f64).sqrt();
        assert!(exceeded.iter().all(|n| (*n as f64 - 50.0).abs() < error), "{exceeded:?}");
    }

    #[test]
    fn alternating_and_constant_residuals_are_not_white() {
        let alternating: Vec<f64> = (0..100).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        // The exact values are ρ₁ = −99/100 and ρ₂ = 98/100.
        assert!((autocorrelation(&alternating)[0] + 0.99).abs() < 1e-12);
        assert!((autocorrelation(&alternating)[1] - 0.98).abs() < 1e-12);
        assert!(runs_score(&alternating) > 9.0, "as many runs as there can be");
        let blocks: Vec<f64> = (0..100).map(|i| if i < 50 { 1.0 } else { -1.0 }).collect();
        assert!(runs_score(&blocks) < -9.0, "two runs");
    }
}
