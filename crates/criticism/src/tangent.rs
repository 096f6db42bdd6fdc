//! Linear algebra around a fit: whitened residuals, the part of a change that the model's parameters absorb, and the part that they do not.

use nalgebra::{DMatrix, DVector};

use super::derivatives::columns_m;
use super::{Candidate, Fitted, Subject};
use base::error::{Error, Result};
use posterior::noise::Whitening;

/// Whitened residuals of the fitted rows and the tangent space of a model at a fit.
///
/// L⁻¹ whitens the noise of the positions y, and f are the model's positions. Then r = L⁻¹(y − f), A = L⁻¹∂f/∂θ with one more row per prior, and P = I − AA⁺.
pub struct Tangent {
    whitening: Whitening,
    /// Orthonormal basis of the whitened derivatives: one row per whitened row, prior rows last; one column per free coordinate.
    absorbed: DMatrix<f64>,
    /// Triangular factor of the QR decomposition of the whitened derivatives, whose columns are first divided by `norms`. Both convert products with `absorbed` into coordinates.
    triangle: DMatrix<f64>,
    norms: Vec<f64>,
    /// Whitened residuals, prior rows last.
    residual: DVector<f64>,
}

impl Tangent {
    /// Tangent space at a fit, over the fitted rows.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] if the model has no derivatives.
    pub fn new(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<Self> {
        let (likelihood, observed_m) = (&subject.fitted, &subject.fitted_m);
        let columns = columns_m(subject, candidate, &fitted.theta)?;
        let residual_m: Vec<f64> =
            observed_m.iter().zip(&fitted.position_m).map(|(y, x)| y.map_or(0.0, |y| y - x)).collect();
        let prior_rows: Vec<(usize, f64, f64)> = candidate
            .free
            .iter()
            .enumerate()
            .filter_map(|(k, free)| free.prior.map(|(mean, sd)| (k, 1.0 / sd, (mean - fitted.theta[k]) / sd)))
            .collect();
        let whitening = likelihood.whitening(&fitted.position_m, &fitted.noise).ok_or_else(|| {
            Error::numerical("the noise's parameters are outside their support", "check the noise of the fit")
        })?;
        let white = whitening.whiten(&columns);
        let (n, n_columns) = (likelihood.n_observed(), columns.len());
        let jacobian = DMatrix::from_fn(n + prior_rows.len(), n_columns, |i, j| match i.checked_sub(n) {
            None => white[j][i],
            Some(row) => {
                if prior_rows[row].0 == j {
                    prior_rows[row].1
                } else {
                    0.0
                }
            }
        });
        let norms: Vec<f64> = jacobian.column_iter().map(|column| column.norm().max(f64::MIN_POSITIVE)).collect();
        let scaled = DMatrix::from_fn(jacobian.nrows(), n_columns, |i, j| jacobian[(i, j)] / norms[j]);
        let (absorbed, triangle) =
            if n_columns == 0 { (DMatrix::zeros(n, 0), DMatrix::zeros(0, 0)) } else { scaled.qr().unpack() };
        let mut residual = DVector::zeros(n + prior_rows.len());
        let white_residual = whitening.whiten(&[residual_m]);
        residual.iter_mut().zip(&white_residual[0]).for_each(|(r, w)| *r = *w);
        prior_rows.iter().enumerate().for_each(|(row, (_, _, value))| residual[n + row] = *value);
        Ok(Self { whitening, absorbed, triangle, norms, residual })
    }

    /// Number of rows of the whitened residuals and derivatives, prior rows included.
    pub fn n_rows(&self) -> usize {
        self.residual.len()
    }

    /// Whitened residuals r, prior rows last.
    pub fn residual(&self) -> &DVector<f64> {
        &self.residual
    }

    /// Whitened residuals without the part that the model's parameters absorb.
    pub fn projected_residual(&self) -> DVector<f64> {
        self.project(self.residual.clone())
    }

    /// Whitens columns (m, one value per row of the record) by the noise of the fit; prior rows are 0.
    pub fn whiten(&self, columns_m: &[Vec<f64>]) -> Vec<DVector<f64>> {
        let white = self.whitening.whiten(columns_m);
        let padded = |column: &Vec<f64>| {
            let mut padded = DVector::zeros(self.residual.len());
            padded.iter_mut().zip(column).for_each(|(p, w)| *p = *w);
            padded
        };
        white.iter().map(padded).collect()
    }

    /// Whitens columns (m) that begin at a row of the record and are 0 before, like [`Whitening::whiten_from`].
    pub fn whiten_from(&self, columns_m: &[Vec<f64>], first_row: usize) -> (usize, Vec<Vec<f64>>) {
        self.whitening.whiten_from(columns_m, first_row)
    }

    /// Orthonormal basis of the changes that the model's parameters absorb: prior rows last, one column per free coordinate.
    pub fn absorbed(&self) -> &DMatrix<f64> {
        &self.absorbed
    }

    /// Returns a whitened vector without the part that the model's parameters absorb.
    pub fn project(&self, whitened: DVector<f64>) -> DVector<f64> {
        let inside = self.absorbed.tr_mul(&whitened);
        whitened - &self.absorbed * inside
    }

    /// Returns whitened columns without the part that the model's parameters absorb. The columns are in m, with one value per row of the record.
    pub fn visible(&self, columns_m: &[Vec<f64>]) -> Vec<DVector<f64>> {
        self.whiten(columns_m).into_iter().map(|white| self.project(white)).collect()
    }

    /// Returns the change of the candidate's coordinates that absorbs a whitened vector as far as possible.
    pub fn absorbing_step(&self, whitened: &DVector<f64>) -> Option<Vec<f64>> {
        let solved = self.triangle.solve_upper_triangular(&self.absorbed.tr_mul(whitened))?;
        Some(solved.iter().zip(&self.norms).map(|(x, norm)| x / norm).collect())
    }

    /// Log determinant of the precision matrix of the candidate's coordinates.
    pub fn ln_det_precision(&self) -> f64 {
        let diagonal = self.triangle.diagonal();
        2.0 * (diagonal.iter().map(|r| r.abs().ln()).sum::<f64>()
            + self.norms.iter().map(|norm| norm.ln()).sum::<f64>())
    }

    /// Covariance of the candidate's coordinates; `None` if data and priors do not determine them.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let n = self.norms.len();
        let inverse = self.triangle.solve_upper_triangular(&DMatrix::identity(n, n))?;
        let scaled = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] / self.norms[i]);
        Some(&scaled * scaled.transpose())
    }

    /// Standard deviation of each of the candidate's coordinates; infinite if nothing determines it.
    pub fn standard_deviations(&self) -> Vec<f64> {
        let n = self.norms.len();
        let row = |k: usize| {
            self.triangle.tr_solve_upper_triangular(&DVector::from_fn(n, |i, _| f64::from(u8::from(i == k))))
        };
        (0..n).map(|k| row(k).map_or(f64::INFINITY, |row| row.norm() / self.norms[k])).collect()
    }

    /// Variance (m²) of the position at every row of the record due to uncertain coordinates, from the candidate's derivatives there.
    ///
    /// # Errors
    /// Errors of [`Tangent::new`].
    pub fn position_variance_m2(&self, subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<Vec<f64>> {
        let factor = self.position_factor_m(subject, candidate, fitted)?;
        Ok(factor.iter().map(DVector::norm_squared).collect())
    }

    /// Vector (m) of every row of the record, such that the covariance of two rows' positions due to uncertain coordinates is the product of their vectors. Infinite without a
    /// covariance of the coordinates.
    ///
    /// # Errors
    /// Errors of [`Tangent::new`].
    pub fn position_factor_m(
        &self,
        subject: &Subject,
        candidate: &Candidate,
        fitted: &Fitted,
    ) -> Result<Vec<DVector<f64>>> {
        let columns = columns_m(subject, candidate, &fitted.theta)?;
        let of_row = |row: usize| {
            let slopes = DVector::from_fn(columns.len(), |k, _| columns[k][row] / self.norms[k]);
            let solved = self.triangle.tr_solve_upper_triangular(&slopes);
            solved.unwrap_or_else(|| DVector::from_element(columns.len(), f64::INFINITY))
        };
        Ok((0..fitted.position_m.len()).map(of_row).collect())
    }

    /// Converts independent standard normal numbers into a deviation of the candidate's coordinates from the fit, with mean 0 and the covariance of the coordinates.
    pub fn coordinates_of(&self, standard: &DVector<f64>) -> Option<Vec<f64>> {
        let solved = self.triangle.solve_upper_triangular(standard)?;
        Some(solved.iter().zip(&self.norms).map(|(x, norm)| x / norm).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NoiseValues;
    use crate::test_replica::{base_fit, replica};

    /// The tangent agrees with dense algebra, which uses the full covariance of the noise and normal equations with prior rows.
    #[test]
    fn projection_and_steps_are_those_of_dense_algebra() {
        let (base, fitted) = base_fit();
        let noise = NoiseValues::new([4.0, 3.0, 0.7, 0.012, 2.0]);
        let left_out: Vec<usize> = (0..replica().fitted_m.len()).filter(|row| row % 4 != 0).collect();
        let subject = replica().without_rows(&left_out);
        let fitted = Fitted { noise, ..fitted };
        let tangent = Tangent::new(&subject, &base, &fitted).expect("derivatives");
        let record = &subject.experiment().record;
        let rows: Vec<usize> = (0..record.n_rows()).filter(|row| subject.fitted_m[*row].is_some()).collect();
        let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            let (a, b) = (rows[i], rows[j]);
            let white = if a == b { 4e-6_f64.powi(2) } else { 0.0 };
            let process = 3e-6_f64.powi(2) * (-(record.time_s[a] - record.time_s[b]).abs() / 0.7).exp();
            let same = f64::from(u8::from(record.cycle[a] == record.cycle[b]));
            white + process + same * (0.012_f64.powi(2) * fitted.position_m[a] * fitted.position_m[b] + 4e-12)
        });
        let inverse = covariance.cholesky().expect("positive definite").inverse();
        let columns = columns_m(&subject, &base, &fitted.theta).expect("derivatives");
        let jacobian = DMatrix::from_fn(rows.len(), columns.len(), |i, k| columns[k][rows[i]]);
        let prior_precision: Vec<f64> =
            base.free.iter().map(|free| free.prior.map_or(0.0, |(_, sd)| 1.0 / (sd * sd))).collect();
        let precision = jacobian.transpose() * &inverse * &jacobian
            + DMatrix::from_diagonal(&DVector::from_vec(prior_precision.clone()));
        // A curve of which the law absorbs about half.
        let other: Vec<f64> = record.time_s.iter().map(|t| 1e-6 * (t + 3.0 * (0.9 * t).sin())).collect();
        let g = DVector::from_fn(rows.len(), |i, _| other[rows[i]]);
        let gg = g.dot(&(&inverse * &g));
        let ag = jacobian.transpose() * &inverse * &g;
        let step = precision.clone().cholesky().expect("positive definite").solve(&ag);
        let left = gg - ag.dot(&step);
        let visible = &tangent.visible(std::slice::from_ref(&other))[0];
        assert!((visible.norm_squared() / left - 1.0).abs() < 1e-8, "{} {left}", visible.norm_squared());
        assert!((tangent.project(visible.clone()) - visible).norm() < 1e-10 * visible.norm());
        let white = &tangent.whiten(std::slice::from_ref(&other))[0];
        let found = tangent.absorbing_step(white).expect("full rank");
        for (found, exact) in found.iter().zip(step.iter()) {
            assert!((found / exact - 1.0).abs() < 1e-8, "{found} {exact}");
        }
        let ln_det = precision.clone().determinant().ln();
        assert!((tangent.ln_det_precision() - ln_det).abs() < 1e-8 * ln_det.abs());
        let inverse_precision = precision.try_inverse().expect("full rank");
        for (k, sd) in tangent.standard_deviations().into_iter().enumerate() {
            assert!((sd / inverse_precision[(k, k)].sqrt() - 1.0).abs() < 1e-8);
        }
    }
}
