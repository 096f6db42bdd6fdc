//! Densities with exactly known properties, for tests of the sampler.

use super::LogDensity;

fn each_point(dimension: usize, points: &[f64], out: &mut [f64], f: impl Fn(&dyn Fn(usize) -> f64) -> f64) {
    let n = out.len();
    assert_eq!(points.len(), n * dimension);
    for (i, value) in out.iter_mut().enumerate() {
        *value = f(&|d| points[d * n + i]);
    }
}

/// Correlated Gaussian whose coordinate d has the mean d + 1. In coordinates scaled by 10^d, the precision matrix is tridiagonal, with 2 on the
/// diagonal and −0.95 beside it.
pub struct Correlated {
    dimension: usize,
}

impl Correlated {
    pub fn new(dimension: usize) -> Self {
        Self { dimension }
    }

    pub fn mean(&self) -> Vec<f64> {
        (0..self.dimension).map(|d| d as f64 + 1.0).collect()
    }

    fn scale(d: usize) -> f64 {
        10.0_f64.powi(d as i32 - 2)
    }

    pub fn precision(&self) -> Vec<f64> {
        let n = self.dimension;
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 => 2.0,
            1 => -0.95,
            _ => 0.0,
        };
        (0..n * n).map(|k| entry(k / n, k % n) / (Self::scale(k / n) * Self::scale(k % n))).collect()
    }
}

impl LogDensity for Correlated {
    fn dimension(&self) -> usize {
        self.dimension
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = self.dimension;
        each_point(n, points, log_density, |x| {
            let u = |d: usize| (x(d) - d as f64 - 1.0) / Self::scale(d);
            let diagonal: f64 = (0..n).map(|d| 2.0 * u(d) * u(d)).sum();
            let off: f64 = (1..n).map(|d| -0.95 * u(d) * u(d - 1)).sum();
            -0.5 * diagonal - off
        });
    }
}

/// Curved density: x₀ ~ N(0, 1), and x₁ given x₀ ~ N(bend·x₀², 1).
pub struct Banana {
    pub bend: f64,
}

impl LogDensity for Banana {
    fn dimension(&self) -> usize {
        2
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        each_point(2, points, log_density, |x| -0.5 * (x(0).powi(2) + (x(1) - self.bend * x(0).powi(2)).powi(2)));
    }
}

/// Two normalised Gaussian peaks in two dimensions, at (0, 0) and (gap, 0). The second is `ratio` times as wide as the first.
pub struct TwoBumps {
    first_weight: f64,
    gap: f64,
    ratio: f64,
}

impl TwoBumps {
    pub fn new(first_weight: f64, gap: f64, ratio: f64) -> Self {
        Self { first_weight, gap, ratio }
    }
}

impl LogDensity for TwoBumps {
    fn dimension(&self) -> usize {
        2
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let tau = std::f64::consts::TAU;
        each_point(2, points, log_density, |x| {
            let first = self.first_weight.ln() - tau.ln() - 0.5 * (x(0).powi(2) + x(1).powi(2));
            let r2 = ((x(0) - self.gap).powi(2) + x(1).powi(2)) / self.ratio.powi(2);
            let second = (1.0 - self.first_weight).ln() - tau.ln() - 2.0 * self.ratio.ln() - 0.5 * r2;
            let top = first.max(second);
            top + ((first - top).exp() + (second - top).exp()).ln()
        });
    }
}
