//! Autocovariance by fast Fourier transform, and the integrated autocorrelation time that follows from it.

use super::chains::Chains;

/// Returns the autocovariance of a series of n values at lags 0 … n − 1. The sum at every lag is divided by n, which gives the biased but positive
/// definite estimate.
pub fn autocovariance(series: &[f64]) -> Vec<f64> {
    with_twiddles(series, &Twiddles::new(padded_length(series.len())))
}

/// Returns the length to which a series of `n` values is padded with zeros, a power of two. At a length of at least 2n, circular correlation equals
/// linear correlation.
fn padded_length(n: usize) -> usize {
    (2 * n).next_power_of_two()
}

fn with_twiddles(series: &[f64], twiddles: &Twiddles) -> Vec<f64> {
    let n = series.len();
    if n == 0 {
        return Vec::new();
    }
    let mean = series.iter().sum::<f64>() / n as f64;
    let length = padded_length(n);
    let mut re = vec![0.0; length];
    let mut im = vec![0.0; length];
    for (padded, value) in re.iter_mut().zip(series) {
        *padded = value - mean;
    }
    twiddles.transform(&mut re, &mut im);
    for (a, b) in re.iter_mut().zip(im.iter_mut()) {
        *a = *a * *a + *b * *b;
        *b = 0.0;
    }
    // The power spectrum is an even function, so a forward transform equals the inverse transform up to a factor.
    twiddles.transform(&mut re, &mut im);
    re.truncate(n);
    let scale = 1.0 / (length as f64 * n as f64);
    re.iter_mut().for_each(|value| *value *= scale);
    re
}

/// Roots of unity for a radix-2 Fourier transform.
struct Twiddles {
    cos: Vec<f64>,
    sin: Vec<f64>,
}

impl Twiddles {
    fn new(length: usize) -> Self {
        let angle = |k: usize| -2.0 * std::f64::consts::PI * k as f64 / length as f64;
        let half = length / 2;
        Self { cos: (0..half).map(|k| angle(k).cos()).collect(), sin: (0..half).map(|k| angle(k).sin()).collect() }
    }

    /// Computes the forward Fourier transform of complex numbers in place. Their number is a power of two.
    fn transform(&self, re: &mut [f64], im: &mut [f64]) {
        let length = re.len();
        let shift = usize::BITS - length.trailing_zeros();
        for i in 0..length {
            let j = if length > 1 { i.reverse_bits() >> shift } else { 0 };
            if i < j {
                re.swap(i, j);
                im.swap(i, j);
            }
        }
        let mut span = 1;
        while span < length {
            let stride = length / (2 * span);
            for start in (0..length).step_by(2 * span) {
                for k in 0..span {
                    let (c, s) = (self.cos[k * stride], self.sin[k * stride]);
                    let (i, j) = (start + k, start + k + span);
                    let (tr, ti) = (re[j] * c - im[j] * s, re[j] * s + im[j] * c);
                    (re[j], im[j]) = (re[i] - tr, im[i] - ti);
                    (re[i], im[i]) = (re[i] + tr, im[i] + ti);
                }
            }
            span *= 2;
        }
    }
}

/// Integrated autocorrelation time and variance of a quantity, from [`integrate`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Integrated {
    /// Integrated autocorrelation time 1 + 2 Σ ρ_t in draws, with ρ_t the autocorrelation at lag t ≥ 1.
    pub time: f64,
    /// Estimated variance of the quantity, within and between chains. Autocorrelations are relative to it.
    pub variance: f64,
}

/// Computes the integrated autocorrelation time of a quantity from several chains. It pools their autocovariances and sums Geyer's initial monotone
/// positive sequence (Geyer 1992; Vehtari et al. 2021, §3.2).
///
/// `None` if there are fewer than four draws per chain, a value is not finite or the values do not vary.
pub fn integrate(chains: &Chains) -> Option<Integrated> {
    let (n_chains, n_draws) = (chains.n_chains(), chains.n_draws());
    if n_chains == 0 || n_draws < 4 || !chains.varies() {
        return None;
    }
    let n = n_draws as f64;
    let mut pooled = vec![0.0; n_draws];
    let mut means = Vec::with_capacity(n_chains);
    let twiddles = Twiddles::new(padded_length(n_draws));
    for chain in chains.iter() {
        means.push(chain.iter().sum::<f64>() / n);
        for (sum, value) in pooled.iter_mut().zip(with_twiddles(chain, &twiddles)) {
            *sum += value / n_chains as f64;
        }
    }
    let within = pooled[0] * n / (n - 1.0);
    let between = if n_chains > 1 { sample_variance(&means) } else { 0.0 };
    let variance = pooled[0] + between;
    let rho = |lag: usize| if lag == 0 { 1.0 } else { 1.0 - (within - pooled[lag]) / variance };
    let time = sum_initial_monotone(rho, n_draws).max(1.0 / ((n_chains * n_draws) as f64).log10());
    time.is_finite().then_some(Integrated { time, variance })
}

/// Returns the integrated autocorrelation time −1 + 2 Σ P_k from pairs P_k = ρ_{2k} + ρ_{2k+1} of autocorrelations ρ at successive lags. The sum ends
/// before the first pair that is not positive, and each pair is limited to the previous pair. The even term after the last pair is added once if it
/// is positive, which improves the estimate for antithetic chains.
fn sum_initial_monotone(rho: impl Fn(usize) -> f64, n_draws: usize) -> f64 {
    let mut sum = 0.0;
    let mut previous = f64::INFINITY;
    let mut lag = 0;
    loop {
        let (even, odd) = (rho(lag), rho(lag + 1));
        let pair = even + odd;
        // The last lags of a series never form a full pair, so they count as a pair that is not positive.
        if lag > 0 && (pair <= 0.0 || lag + 4 >= n_draws) {
            return -1.0 + 2.0 * sum + even.max(0.0);
        }
        previous = pair.min(previous);
        sum += previous;
        if pair <= 0.0 {
            return -1.0 + 2.0 * sum;
        }
        lag += 2;
    }
}

/// Unbiased sample variance; 0 for fewer than two values.
pub(super) fn sample_variance(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return 0.0;
    }
    let n = values.len() as f64;
    let mean = sum(values) / n;
    sum_of(values, |v| (v - mean) * (v - mean)) / (n - 1.0)
}

/// Sum of the values.
pub(super) fn sum(values: &[f64]) -> f64 {
    sum_of(values, |v| v)
}

/// Sum of f(value) over the values. Eight independent partial sums let the compiler use vector instructions.
#[inline(always)]
fn sum_of(values: &[f64], f: impl Fn(f64) -> f64) -> f64 {
    let mut sums = [0.0; 8];
    let chunks = values.chunks_exact(sums.len());
    let rest: f64 = chunks.remainder().iter().map(|v| f(*v)).sum();
    for chunk in chunks {
        sums.iter_mut().zip(chunk).for_each(|(sum, v)| *sum += f(*v));
    }
    let [a, b, c, d, e, g, h, i] = sums;
    ((a + e) + (b + g)) + ((c + h) + (d + i)) + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_direct_sum() {
        let series: Vec<f64> = (0..37).map(|i| ((i * i * 7919) % 101) as f64).collect();
        let n = series.len();
        let mean = series.iter().sum::<f64>() / n as f64;
        for (lag, value) in autocovariance(&series).into_iter().enumerate() {
            let direct: f64 =
                (0..n - lag).map(|i| (series[i] - mean) * (series[i + lag] - mean)).sum::<f64>() / n as f64;
            assert!((value - direct).abs() < 1e-9, "lag {lag}: {value} against {direct}");
        }
    }

    #[test]
    fn short_series() {
        assert!(autocovariance(&[]).is_empty());
        assert_eq!(autocovariance(&[3.0]), vec![0.0]);
    }

    #[test]
    fn a_constant_has_no_autocorrelation_time() {
        assert_eq!(integrate(&Chains::new(vec![vec![2.0; 50]])), None);
    }
}
