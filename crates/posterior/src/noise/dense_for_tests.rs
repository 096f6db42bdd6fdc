//! Dense Gaussian algebra as a reference for tests of the noise, with records and parameter points that these tests share.

use nalgebra::{DMatrix, DVector};

use super::NoiseModel;
use base::error::InputPlace;

/// Record with predicted and observed positions, for tests of the noise.
pub struct TestRecord {
    pub time_s: Vec<f64>,
    pub cycle: Vec<u32>,
    pub position_m: Vec<f64>,
    pub observed_m: Vec<Option<f64>>,
}

impl TestRecord {
    /// Creates a record with irregular times, a gap, lost positions, and cycles of unequal length. One cycle has no observations.
    pub fn irregular(n_rows: usize) -> Self {
        let mut time_s = vec![0.0_f64];
        for i in 1..n_rows {
            let step_s = [0.05, 0.05, 0.013, 0.05, 0.21][i % 5] + if i == n_rows / 2 { 7.3 } else { 0.0 };
            time_s.push(time_s[i - 1] + step_s);
        }
        let ends = [n_rows / 5, n_rows / 4, n_rows / 4 + 3, 3 * n_rows / 4];
        let cycle: Vec<u32> = (0..n_rows).map(|i| 1 + ends.iter().filter(|end| i >= **end).count() as u32).collect();
        let position_m: Vec<f64> = time_s.iter().map(|t: &f64| 6e-4 * (0.9 * t).sin() + 3e-5 * t).collect();
        let noise_m = |i: usize| 1e-6 * (5.0 * (12.9 * i as f64).sin() + 4.0 * (0.2 * i as f64).cos());
        let observed_m = (0..n_rows)
            .map(|i| (i % 7 != 3 && cycle[i] != 3).then(|| position_m[i] + noise_m(i) * f64::from(cycle[i])))
            .collect();
        Self { time_s, cycle, position_m, observed_m }
    }

    /// Indices of the observed rows.
    pub fn observed_rows(&self) -> Vec<usize> {
        (0..self.time_s.len()).filter(|row| self.observed_m[*row].is_some()).collect()
    }

    /// Observed position minus model position in m at every row; 0 without an observation.
    pub fn residual_m(&self) -> Vec<f64> {
        self.observed_m.iter().zip(&self.position_m).map(|(y, x)| y.map_or(0.0, |y| y - x)).collect()
    }
}

pub fn model(names: &[&str]) -> NoiseModel {
    let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
    NoiseModel::named(&names, &InputPlace::default()).expect("names of terms")
}

/// Parameter values of a model in its order, selected from a point with the parameters of all terms.
pub fn parameters(model: NoiseModel, point: [f64; 6]) -> Vec<f64> {
    let names = ["noise_sd_um", "ou_sd_um", "ou_time_s", "gain_sd", "offset_sd_um", "student_dof"];
    let value = |name: &str| point[names.iter().position(|n| *n == name).expect("a known name")];
    model.parameters().iter().map(|spec| value(spec.name)).collect()
}

/// Every noise model without Student-t errors.
pub fn gaussian_models() -> [NoiseModel; 4] {
    [model(&["white"]), model(&["white", "ou"]), model(&["white", "gain"]), model(&["gain", "ou", "white"])]
}

/// Parameter points: white noise (µm), slow noise (µm) and its correlation time (s), gain, offset (µm), and degrees of freedom. The terms are of similar or very
/// different size. Processes are slow or fast relative to the time steps, gains are far above the noise, and some terms vanish.
pub const POINTS: [[f64; 6]; 7] = [
    [4.0, 3.0, 0.5, 0.03, 5.0, 6.0],
    [4.0, 1e-3, 0.02, 1e-6, 1e-3, 2.3],
    [0.3, 3.0, 40.0, 0.03, 8.0, 30.0],
    [4.0, 100.0, 1e4, 0.3, 300.0, 4.0],
    [2.0, 5.0, 1e-6, 0.01, 0.0, 8.0],
    [2.0, 0.0, 1.0, 0.0, 3.0, 8.0],
    [50.0, 1.0, 1e6, 1e-3, 1.0, 100.0],
];

/// Covariance matrix (m²) of the positions at the rows `rows`, from the definitions of the Gaussian terms.
pub fn covariance_m2(model: NoiseModel, record: &TestRecord, rows: &[usize], parameters: &[f64]) -> DMatrix<f64> {
    let value = |name: &str| model.parameters().iter().position(|spec| spec.name == name).map(|i| parameters[i]);
    let um = |name: &str| 1e-6 * value(name).unwrap_or(0.0);
    DMatrix::from_fn(rows.len(), rows.len(), |a, b| {
        let (i, j) = (rows[a], rows[b]);
        let mut covariance = if i == j { um("noise_sd_um").powi(2) } else { 0.0 };
        if let Some(time_s) = value("ou_time_s") {
            covariance += um("ou_sd_um").powi(2) * (-(record.time_s[i] - record.time_s[j]).abs() / time_s).exp();
        }
        if record.cycle[i] == record.cycle[j] {
            let gain = value("gain_sd").unwrap_or(0.0);
            covariance += gain * gain * record.position_m[i] * record.position_m[j] + um("offset_sd_um").powi(2);
        }
        covariance
    })
}

/// Log density of residuals under a normal distribution with this covariance, and their squared Mahalanobis distance.
pub fn ln_density(covariance_m2: &DMatrix<f64>, residual_m: &[f64]) -> (f64, f64) {
    let cholesky = covariance_m2.clone().cholesky().expect("positive definite");
    let white = cholesky.l().solve_lower_triangular(&DVector::from_column_slice(residual_m)).expect("regular");
    let ln_det: f64 = 2.0 * cholesky.l().diagonal().iter().map(|l| l.ln()).sum::<f64>();
    let distance2 = white.norm_squared();
    (-0.5 * (distance2 + ln_det + residual_m.len() as f64 * (2.0 * std::f64::consts::PI).ln()), distance2)
}
