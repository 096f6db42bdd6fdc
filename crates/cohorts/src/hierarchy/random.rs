//! Random vectors and matrices that the Gibbs sampler draws.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rand::Rng;
use rand_distr::{Distribution, Gamma, StandardNormal};

use base::error::{Error, Result, Setting};

/// Computes the Cholesky factor of a matrix.
///
/// # Errors
///
/// [`Error::Numerical`] if the matrix is not positive definite.
pub fn factor(matrix: DMatrix<f64>) -> Result<Cholesky<f64, Dyn>> {
    Cholesky::new(matrix).ok_or_else(|| {
        Error::numerical(
            "a covariance of the hierarchy is not positive definite",
            format!(
                "look for an experiment whose parameters are poorly determined, or leave it out ({})",
                Setting::LeaveOut
            ),
        )
    })
}

pub(super) fn normals(n: usize, rng: &mut impl Rng) -> DVector<f64> {
    DVector::from_fn(n, |_, _| StandardNormal.sample(rng))
}

/// Draws a vector x from the normal distribution with density proportional to exp(−½ xᵀPx + hᵀx), where P is `precision` and h is `information`.
pub(super) fn normal_of_information(
    precision: DMatrix<f64>,
    information: DVector<f64>,
    rng: &mut impl Rng,
) -> Result<DVector<f64>> {
    let factor = factor(precision)?;
    let mean = factor.solve(&information);
    let mut noise = normals(information.len(), rng);
    factor.l_dirty().tr_solve_lower_triangular_mut(&mut noise);
    Ok(mean + noise)
}

/// Draws a number from the gamma distribution with the given shape and rate.
pub(super) fn gamma(shape: f64, rate: f64, rng: &mut impl Rng) -> f64 {
    Gamma::new(shape, 1.0 / rate).map_or(f64::NAN, |gamma| gamma.sample(rng))
}

/// Draws a precision matrix from a Wishart distribution, whose scale matrix is the inverse of `scatter` (Bartlett's decomposition). The inverse of the
/// draw has the inverse-Wishart distribution with scale matrix `scatter`.
pub(super) fn wishart_of_scatter(degrees: f64, scatter: DMatrix<f64>, rng: &mut impl Rng) -> Result<DMatrix<f64>> {
    let p = scatter.nrows();
    let factor = factor(scatter)?;
    let mut bartlett = DMatrix::zeros(p, p);
    for row in 0..p {
        bartlett[(row, row)] = gamma(0.5 * (degrees - row as f64), 0.5, rng).sqrt();
        for column in 0..row {
            bartlett[(row, column)] = StandardNormal.sample(rng);
        }
    }
    // With scatter = L Lᵀ, its inverse is L⁻ᵀ L⁻¹. The draw is therefore (L⁻ᵀ B)(L⁻ᵀ B)ᵀ, where B is Bartlett's triangular matrix.
    factor.l_dirty().tr_solve_lower_triangular_mut(&mut bartlett);
    Ok(&bartlett * bartlett.transpose())
}
