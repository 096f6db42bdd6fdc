//! Approximation of bᵀ(A + τH)⁻¹b by a short sum Σ c/(1 + τσ) for drainage areas τ. A is the
//! storage matrix, H the diffusion matrix and b the load. The sum is the Galerkin projection on
//! pressures at a few τ (a rational Krylov space).
//!
//! The sum agrees with the exact function in value and slope at these τ and lies below it
//! elsewhere. The c are positive. The σ > 0 are distinct. Both depend smoothly on A.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::{Mat, Par};
use nalgebra::DMatrix;

use super::drained::{DrainedModel, Pressure, add_scaled, dot};
use base::error::{Error, Result};

/// Smallest part of a direction outside the span of the earlier directions, relative to the
/// direction, in the norm of the storage matrix. A direction with a smaller part is omitted. It
/// would add only the square of this part to the result, and much of that would be the rounding
/// error of the skeleton's solutions.
const LEAST_NEW_PART: f64 = 1e-5;

/// A vector of pressures, with its products with the storage matrix (`stored`) and the diffusion
/// matrix (`diffused`).
#[derive(Debug, Clone)]
pub(super) struct Direction {
    pub values: Vec<f64>,
    pub stored: Vec<f64>,
    pub diffused: Vec<f64>,
}

impl Direction {
    /// Builds a direction from the pressures that solve a body's equations.
    pub fn of(body: &DrainedModel, pressure: Pressure) -> Self {
        let mut diffused = vec![0.0; pressure.values.len()];
        body.model.pressures.add_product(0.0, 1.0, &pressure.values, &mut diffused);
        Self { values: pressure.values, stored: pressure.stored, diffused }
    }

    fn add(&mut self, factor: f64, other: &Self) {
        add_scaled(factor, &other.values, &mut self.values);
        add_scaled(factor, &other.stored, &mut self.stored);
        add_scaled(factor, &other.diffused, &mut self.diffused);
    }

    fn scale(&mut self, factor: f64) {
        [&mut self.values, &mut self.stored, &mut self.diffused].into_iter().flatten().for_each(|x| *x *= factor);
    }
}

/// A sum Σ βₖ²/(1 + τσₖ) of drainage terms with rising rates σₖ at the drainage area τ. Its vectors
/// are orthonormal in the storage matrix and orthogonal in the diffusion matrix.
#[derive(Debug, Clone)]
pub(super) struct Terms {
    /// Drainage rates σ of the terms, in 1/m².
    pub rates_per_m2: Vec<f64>,
    /// Components β of the load along the vectors.
    pub shares: Vec<f64>,
    pub vectors: Vec<Direction>,
}

impl Terms {
    /// Projects the pressures' equations on the span of `directions`. A direction that depends
    /// linearly on earlier directions is omitted.
    pub(super) fn galerkin(directions: &[Direction], load: &[f64]) -> Result<Self> {
        let mut basis: Vec<Direction> = Vec::with_capacity(directions.len());
        for direction in directions {
            let mut next = direction.clone();
            let whole = dot(&next.values, &next.stored).sqrt();
            // Orthogonalising twice suffices.
            for _ in 0..2 {
                for earlier in &basis {
                    let share = dot(&earlier.values, &next.stored);
                    next.add(-share, earlier);
                }
            }
            let new = dot(&next.values, &next.stored).max(0.0).sqrt();
            if new > LEAST_NEW_PART * whole {
                next.scale(new.recip());
                basis.push(next);
            }
        }
        let n = basis.len();
        let projected = DMatrix::from_fn(n, n, |i, j| {
            0.5 * (dot(&basis[i].values, &basis[j].diffused) + dot(&basis[j].values, &basis[i].diffused))
        });
        let eigen = projected.symmetric_eigen();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let vectors: Vec<Direction> = order
            .iter()
            .map(|&k| {
                let mut vector = basis[0].clone();
                vector.scale(eigen.eigenvectors[(0, k)]);
                (1..n).for_each(|i| vector.add(eigen.eigenvectors[(i, k)], &basis[i]));
                vector
            })
            .collect();
        let rates_per_m2: Vec<f64> = order.iter().map(|&k| eigen.eigenvalues[k]).collect();
        if !rates_per_m2.iter().all(|rate| *rate > 0.0) {
            return Err(Error::numerical(
                format!("the drainage rates of the pores are {rates_per_m2:?} 1/m²; all must be positive"),
                "check the mesh for flat elements",
            ));
        }
        Ok(Self { rates_per_m2, shares: vectors.iter().map(|v| dot(&v.values, load)).collect(), vectors })
    }

    /// Value of the sum of the terms at a drainage area (m²).
    pub(super) fn at(&self, area_m2: f64) -> f64 {
        self.shares.iter().zip(&self.rates_per_m2).map(|(b, rate)| b * b / (1.0 + area_m2 * rate)).sum()
    }

    /// Residual of the projected pressures p at a drainage area τ: load − (A + τH) p, with the
    /// storage matrix A and the diffusion matrix H.
    pub(super) fn residual(&self, area_m2: f64, load: &[f64]) -> Vec<f64> {
        let mut residual = load.to_vec();
        for ((share, rate), vector) in self.shares.iter().zip(&self.rates_per_m2).zip(&self.vectors) {
            let factor = -share / (1.0 + area_m2 * rate);
            add_scaled(factor, &vector.stored, &mut residual);
            add_scaled(factor * area_m2, &vector.diffused, &mut residual);
        }
        residual
    }
}

/// Replaces the lower triangle of a symmetric matrix by its Cholesky factor. Uses one thread.
pub(super) fn dense_cholesky(matrix: &mut Mat<f64>) -> Result<()> {
    use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
    let n = matrix.nrows();
    let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default()));
    let factorised = cholesky_in_place(
        matrix.as_mut(),
        LltRegularization::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    );
    factorised.map(|_| ()).map_err(|e| {
        Error::numerical(
            format!("a matrix of {n} pressures is not positive definite ({e:?})"),
            "check the mesh for flat elements, and the drained Poisson ratio, which must lie below the undrained one",
        )
    })
}
