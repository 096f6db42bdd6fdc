//! Chebyshev polynomials of several coordinates up to a total degree, fitted by least squares.

use base::number::Scalar;
use nalgebra::DMatrix;
use std::f64::consts::PI;

/// Ratio of the number of design points to the number of polynomials.
const OVERSAMPLING: f64 = 1.6;
/// Seed of the scrambled Sobol sequence of the design points. It is fixed, so that equal settings always give the same points.
const DESIGN_SEED: u32 = 17;
/// Seed of the scrambled Sobol sequence of the check points.
const CHECK_SEED: u32 = 29;

/// Polynomials on [−1, 1]ᵈ with design points, and with the matrix that fits the polynomials to values at these points.
#[derive(Debug, Clone)]
pub(super) struct Basis {
    /// Degrees of each polynomial (outer) in every coordinate (inner).
    degrees: Vec<Vec<usize>>,
    degree: usize,
    /// Design points, whose values determine a fit.
    pub design: Vec<Vec<f64>>,
    /// Check points of a fit, inside the box and near its faces.
    pub checks: Vec<Vec<f64>>,
    /// Matrix that converts values at the design points (columns) into coefficients of the polynomials (rows).
    pub fit: DMatrix<f64>,
}

impl Basis {
    /// Returns the polynomials up to a total degree. `None` if the design points do not determine the coefficients, which occurs for no
    /// tested number of coordinates.
    pub fn new(n_coordinates: usize, degree: usize, n_checks: u32) -> Option<Self> {
        Self::weighted(&vec![1.0; n_coordinates], degree as f64, OVERSAMPLING, n_checks)
    }

    /// Number of design points for polynomials up to a total degree.
    pub fn n_points(n_coordinates: usize, degree: usize) -> usize {
        let n_polynomials = (1..=n_coordinates).fold(1.0, |product, k| product * (degree + k) as f64 / k as f64);
        (OVERSAMPLING * n_polynomials.round()).ceil() as usize
    }

    /// Returns the polynomials up to a weighted total degree. `weights` has the weight of a degree in each coordinate. `oversampling` is
    /// the ratio of the numbers of design points and polynomials.
    pub fn weighted(weights: &[f64], degree: f64, oversampling: f64, n_checks: u32) -> Option<Self> {
        let n_coordinates = weights.len();
        let mut degrees = vec![Vec::new()];
        for weight in weights {
            let extended = |exponents: &Vec<usize>| -> Vec<Vec<usize>> {
                let used: f64 = exponents.iter().zip(weights).map(|(degree, weight)| *degree as f64 * weight).sum();
                let left = ((degree - used) / weight).floor() as usize;
                (0..=left).map(|next| [exponents.as_slice(), &[next]].concat()).collect()
            };
            degrees = degrees.iter().flat_map(extended).collect();
        }
        let n_points = (oversampling * degrees.len() as f64).ceil() as u32;
        let uniform = |index: u32, d: usize, seed: u32| f64::from(sobol_burley::sample(index, d as u32, seed));
        let towards_faces = |index: u32, seed: u32| -> Vec<f64> {
            (0..n_coordinates).map(|d| (PI * uniform(index, d, seed)).cos()).collect()
        };
        let evenly = |index: u32, seed: u32| -> Vec<f64> {
            (0..n_coordinates).map(|d| 2.0 * uniform(index, d, seed) - 1.0).collect()
        };
        let design: Vec<Vec<f64>> = (0..n_points).map(|index| towards_faces(index, DESIGN_SEED)).collect();
        let check = |index: u32| {
            if index.is_multiple_of(2) { evenly(index, CHECK_SEED) } else { towards_faces(index, CHECK_SEED) }
        };
        let checks = (0..n_checks).map(check).collect();
        let degree = degree.floor() as usize;
        let mut basis = Self { degrees, degree, design, checks, fit: DMatrix::zeros(0, 0) };
        let rows: Vec<Vec<f64>> = basis.design.iter().map(|point| basis.values(point)).collect();
        let matrix = DMatrix::from_fn(rows.len(), basis.degrees.len(), |i, j| rows[i][j]);
        let normal = matrix.tr_mul(&matrix);
        basis.fit = normal.cholesky()?.solve(&matrix.transpose());
        Some(basis)
    }

    pub fn n_polynomials(&self) -> usize {
        self.degrees.len()
    }

    /// Returns the values of all polynomials at a point.
    pub fn values<N: Scalar>(&self, point: &[N]) -> Vec<N> {
        let one = N::constant(1.0);
        let mut of_one = Vec::with_capacity(point.len() * (self.degree + 1));
        for x in point {
            let (mut before, mut now) = (one, *x);
            of_one.push(one);
            for _ in 1..=self.degree {
                of_one.push(now);
                let next = *x * now * 2.0 - before;
                (before, now) = (now, next);
            }
        }
        let n = self.degree + 1;
        self.degrees
            .iter()
            .map(|degrees| {
                degrees.iter().enumerate().fold(one, |product, (d, degree)| product * of_one[d * n + degree])
            })
            .collect()
    }

    /// Returns, for each coordinate, the sum of `squares` (squared coefficients) over the polynomials of a high degree in this coordinate.
    /// A high degree is the highest degree or one less.
    pub fn tails(&self, squares: &[f64]) -> Vec<f64> {
        let n_coordinates = self.degrees.first().map_or(0, Vec::len);
        let tail = |d: usize| -> f64 {
            let is_high = |degrees: &[usize]| degrees[d] + 1 >= self.degree;
            self.degrees.iter().zip(squares).filter(|(degrees, _)| is_high(degrees)).map(|(_, square)| square).sum()
        };
        (0..n_coordinates).map(tail).collect()
    }
}
