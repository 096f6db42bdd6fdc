//! Posterior for comparing samplers: (ln E, ln c₁, ln c₂, ln σ) of the base model and one creep cycle.
//!
//! It is plain scalar code and shares only the trait with the library, so it is an independent reference.
#![allow(dead_code, reason = "each test file uses a part")]

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use vitreo_uq::sampling::LogDensity;
use vitreo_uq::sampling::ensemble::RandomStream;

const N_SAMPLES: usize = 200;
const N_HALF: usize = 100;
const INTERVAL_S: f64 = 0.05;
const FORCE_N: f64 = 4.6e-6;
const COMPLIANCE_PER_M: f64 = 549.178;
const REFERENCE: [f64; 4] = [3.527, 1.402, 47.370, 5.0];
const PRIOR_SD: f64 = 1.3;

/// Log density up to a constant, with log-normal priors around the reference.
pub struct CreepPosterior {
    /// Positions in µm.
    data_um: Vec<f64>,
    /// Factor on σ in the likelihood: 1, or a deliberate mistake.
    pub sigma_factor: f64,
}

/// Exact moments.
pub struct Exact {
    pub mean: [f64; 4],
    pub sd: [f64; 4],
}

/// Position in µm at sample k: compliance times ∫J dF with F = +4.6 µN, and −4.6 µN from 5 s on.
fn trajectory(theta: &[f64], mut each: impl FnMut(usize, f64)) {
    let (e, c1, c2) = (theta[0].exp(), theta[1].exp(), theta[2].exp());
    let amplitude = 1e6 * COMPLIANCE_PER_M * FORCE_N;
    let (elastic, flow) = (amplitude / e, amplitude * INTERVAL_S / c2);
    let decay = (-INTERVAL_S * e / c1).exp();
    // x = elastic·(1 − decay^k) + flow·k since the first switch, minus twice the same since the second.
    let (mut first, mut second) = (1.0, 1.0);
    for k in 0..N_HALF {
        each(k, elastic * (1.0 - first) + flow * k as f64);
        first *= decay;
    }
    for k in 0..N_SAMPLES - N_HALF {
        let before = elastic * (1.0 - first) + flow * (k + N_HALF) as f64;
        each(k + N_HALF, before - 2.0 * (elastic * (1.0 - second) + flow * k as f64));
        first *= decay;
        second *= decay;
    }
}

impl CreepPosterior {
    /// Data simulated at parameters θ.
    pub fn simulated(theta: &[f64], stream: &mut RandomStream) -> Self {
        let mut data_um = vec![0.0; N_SAMPLES];
        let sigma_um = theta[3].exp();
        trajectory(theta, |k, x| data_um[k] = x + sigma_um * stream.normal());
        Self { data_um, sigma_factor: 1.0 }
    }

    /// Data simulated at the reference.
    pub fn reference(seed: u64) -> Self {
        Self::simulated(&REFERENCE.map(f64::ln), &mut RandomStream::new(seed, 0))
    }

    pub fn truth(&self) -> [f64; 4] {
        REFERENCE.map(f64::ln)
    }

    pub fn draw_prior(&self, stream: &mut RandomStream) -> Vec<f64> {
        draw_prior(stream)
    }

    pub fn at(&self, theta: &[f64]) -> f64 {
        let mut sum_of_squares = 0.0;
        trajectory(theta, |k, x| sum_of_squares += (self.data_um[k] - x) * (self.data_um[k] - x));
        let sigma_um = theta[3].exp() * self.sigma_factor;
        let prior: f64 = theta.iter().zip(REFERENCE).map(|(t, r)| ((t - r.ln()) / PRIOR_SD).powi(2)).sum();
        -0.5 * sum_of_squares / (sigma_um * sigma_um) - N_SAMPLES as f64 * theta[3] - 0.5 * prior
    }

    /// Moments by a tensor rule on a grid adapted to the mode. Trapezoids of a smooth, decaying function
    /// converge faster than any power, and the finer of two grids must agree with the coarser.
    pub fn exact(&self) -> Exact {
        let modes = vitreo_uq::sampling::optimum::find_modes(self, &[self.truth().to_vec()]).unwrap();
        let mode = modes.iter().next().unwrap().clone();
        let (coarse, fine) = (self.moments(&mode, 0.7), self.moments(&mode, 0.5));
        for d in 0..4 {
            assert!((coarse.mean[d] - fine.mean[d]).abs() < 1e-4 * fine.sd[d], "quadrature of the mean");
            assert!((coarse.sd[d] / fine.sd[d] - 1.0).abs() < 1e-4, "quadrature of the standard deviation");
        }
        fine
    }

    fn moments(&self, mode: &vitreo_uq::sampling::optimum::Mode, spacing: f64) -> Exact {
        let precision = nalgebra::Matrix4::from_row_slice(&mode.precision);
        let spread = precision.cholesky().unwrap().l().transpose().try_inverse().unwrap();
        let half = (7.0 / spacing) as i32;
        let axis: Vec<f64> = (-half..=half).map(|k| f64::from(k) * spacing).collect();
        let (mut total, mut first, mut second) = (0.0, nalgebra::Vector4::zeros(), nalgebra::Vector4::zeros());
        for &a in &axis {
            for &b in &axis {
                for &c in &axis {
                    for &d in &axis {
                        let z = nalgebra::Vector4::new(a, b, c, d);
                        if z.norm_squared() > 49.0 {
                            continue;
                        }
                        let away = spread * z;
                        let theta: Vec<f64> = mode.location.iter().zip(away.iter()).map(|(m, s)| m + s).collect();
                        let weight = (self.at(&theta) - mode.log_density).exp();
                        total += weight;
                        first += weight * away;
                        second += weight * away.component_mul(&away);
                    }
                }
            }
        }
        let (first, second) = (first / total, second / total);
        Exact {
            mean: std::array::from_fn(|d| mode.location[d] + first[d]),
            sd: std::array::from_fn(|d| (second[d] - first[d] * first[d]).sqrt()),
        }
    }
}

/// A draw of (ln E, ln c₁, ln c₂, ln σ) from the prior.
pub fn draw_prior(stream: &mut RandomStream) -> Vec<f64> {
    REFERENCE.iter().map(|r| r.ln() + PRIOR_SD * stream.normal()).collect()
}

impl LogDensity for CreepPosterior {
    fn dimension(&self) -> usize {
        4
    }

    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        for (i, value) in log_density.iter_mut().enumerate() {
            *value = self.at(&[points[i], points[n + i], points[2 * n + i], points[3 * n + i]]);
        }
    }
}

/// f(0) … f(n − 1) over all cores. It uses plain threads, because every run has its own pool, and pools must not wait for pools.
pub fn over_cores<T: Send>(n: u64, f: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let next = AtomicU64::new(0);
    let results = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    if k >= n {
                        return;
                    }
                    let result = f(k);
                    results.lock().unwrap().push((k, result));
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap();
    results.sort_by_key(|(k, _)| *k);
    results.into_iter().map(|(_, result)| result).collect()
}
