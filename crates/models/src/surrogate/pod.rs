//! Proper orthogonal decomposition of displacement fields in the energy inner product ⟨u, v⟩ = uᵀ K̂ v, with K̂ a stiffness
//! matrix.

use faer::sparse::SparseColMatRef;
use nalgebra::DMatrix;

use base::error::{Error, Result};
use elements::fe::factorisation::add_symmetric_product;

/// Norm of the remainder of a normalised snapshot after orthogonalisation, below which the remainder adds no basis vector. Larger
/// remainders may still be rounding errors. They are kept, so that the singular values show the level of rounding.
const ROUNDING: f64 = f64::EPSILON;
/// Largest number of iterations of the singular value decomposition for each row of the matrix. Two or three for each row are
/// usual.
const MOST_ROTATIONS: usize = 100;

/// Energy-orthonormal modes of a set of snapshots, in the order of decreasing singular values.
#[derive(Debug, Clone)]
pub struct Pod {
    /// Modes, each with one entry for each unknown of a snapshot.
    pub modes: Vec<Vec<f64>>,
    /// Singular values of the normalised snapshots, including those of dropped modes.
    pub singular_values: Vec<f64>,
}

/// Energy inner product uᵀ K̂ v of fields u and v. The content is the upper triangle of the stiffness matrix K̂.
#[derive(Clone, Copy)]
pub struct EnergyProduct<'a>(pub SparseColMatRef<'a, u32, f64>);

impl EnergyProduct<'_> {
    /// Returns the product K̂ u of the stiffness matrix and a field u.
    pub fn apply(&self, u: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; u.len()];
        add_symmetric_product(self.0, u, &mut product);
        product
    }

    /// Returns the energy norm √(uᵀ K̂ u) of a field u, with K̂ the stiffness matrix.
    pub fn norm(&self, u: &[f64]) -> f64 {
        dot(u, &self.apply(u)).max(0.0).sqrt()
    }
}

/// Returns the scalar product Σ uᵢ vᵢ of two vectors.
pub(super) fn dot(u: &[f64], v: &[f64]) -> f64 {
    u.iter().zip(v).map(|(a, b)| a * b).sum()
}

fn subtract(u: &mut [f64], scale: f64, v: &[f64]) {
    for (a, b) in u.iter_mut().zip(v) {
        *a -= scale * b;
    }
}

impl Pod {
    /// Decomposes snapshots and keeps the modes whose singular values exceed `tolerance` times the largest. Each snapshot is
    /// scaled to unit energy, so that small and large responses have equal weight. Zero snapshots are skipped.
    ///
    /// Snapshots are orthonormalised first, and the small triangular factor is decomposed. Singular values are then accurate down to
    /// rounding. A decomposition of the correlation matrix would lose singular values below the square root of rounding.
    pub fn new(snapshots: &[Vec<f64>], energy: EnergyProduct, tolerance: f64) -> Result<Self> {
        let (basis, triangle) = orthonormalise(snapshots, energy);
        let n = basis.len();
        if n == 0 {
            return Err(Error::numerical("every snapshot is zero", "check that the record applies a force"));
        }
        // One thread decomposes matrices of every size, so that the bits do not depend on the number of threads.
        let factor = DMatrix::from_fn(n, triangle.len(), |i, j| triangle[j].get(i).copied().unwrap_or(0.0));
        let svd = factor.try_svd(true, false, f64::EPSILON, MOST_ROTATIONS * n);
        let Some((left, values)) = svd.and_then(|svd| Some((svd.u?, svd.singular_values))) else {
            return Err(Error::numerical("the snapshots cannot be decomposed", "check the record for infinite values"));
        };
        let singular_values: Vec<f64> = values.iter().copied().collect();
        let kept = singular_values.iter().take_while(|s| **s > tolerance * singular_values[0]).count();
        let mode = |k: usize| {
            let mut mode = vec![0.0; basis[0].len()];
            for (i, q) in basis.iter().enumerate() {
                subtract(&mut mode, -left[(i, k)], q);
            }
            mode
        };
        Ok(Self { modes: (0..kept).map(mode).collect(), singular_values })
    }
}

/// Returns an energy-orthonormal basis of the snapshots, and the coordinates of each normalised snapshot in it, by repeated
/// Gram–Schmidt orthogonalisation.
fn orthonormalise(snapshots: &[Vec<f64>], energy: EnergyProduct) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let (mut basis, mut images): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    let mut triangle = Vec::new();
    for snapshot in snapshots {
        let norm = energy.norm(snapshot);
        if norm == 0.0 {
            continue;
        }
        let mut rest: Vec<f64> = snapshot.iter().map(|u| u / norm).collect();
        let mut coordinates = vec![0.0; basis.len()];
        for _ in 0..2 {
            for ((q, image), c) in basis.iter().zip(&images).zip(&mut coordinates) {
                let share = dot(image, &rest);
                subtract(&mut rest, share, q);
                *c += share;
            }
        }
        let image = energy.apply(&rest);
        let height = dot(&rest, &image).max(0.0).sqrt();
        coordinates.push(height);
        if height > ROUNDING {
            basis.push(rest.iter().map(|u| u / height).collect());
            images.push(image.iter().map(|u| u / height).collect());
        }
        triangle.push(coordinates);
    }
    let n = basis.len();
    for coordinates in &mut triangle {
        coordinates.truncate(n);
    }
    (basis, triangle)
}
