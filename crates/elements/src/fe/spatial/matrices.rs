//! Symmetric sparse matrices on [`DegreesOfFreedom`], and their Cholesky factors.

use faer::sparse::linalg::cholesky::SymbolicCholesky;
use faer::sparse::{SparseColMat, SparseColMatRef, Triplet};
use nalgebra::DMatrix;

use super::DegreesOfFreedom;
use crate::fe::factorisation::{add_symmetric_product, analysed, factorised, solve_in_place};
use base::error::{Error, Result};

/// A symmetric sparse matrix, stored as its upper triangle.
#[derive(Debug, Clone)]
pub struct SymmetricMatrix(SparseColMat<u32, f64>);

impl SymmetricMatrix {
    /// Sums element matrices. Each element gives its nodes and its matrix, with rows and columns
    /// ordered node by node, three components each.
    ///
    /// # Errors
    /// [`Error::Numerical`] if there are too many entries to number.
    pub fn assemble<'a>(
        freedoms: &DegreesOfFreedom,
        elements: impl Iterator<Item = (&'a [u32], DMatrix<f64>)>,
    ) -> Result<Self> {
        let mut triplets = Vec::new();
        for (nodes, matrix) in elements {
            let components: Vec<&[(u32, f64)]> =
                nodes.iter().flat_map(|&node| (0..3).map(move |i| freedoms.of(node, i))).collect();
            for (row, of_row) in components.iter().enumerate() {
                for (column, of_column) in components.iter().enumerate() {
                    let value = matrix[(row, column)];
                    if value == 0.0 {
                        continue;
                    }
                    for (i, a) in of_row.iter() {
                        for (j, b) in of_column.iter().filter(|(j, _)| i <= j) {
                            triplets.push(Triplet::new(*i, *j, a * b * value));
                        }
                    }
                }
            }
        }
        Self::from_triplets(freedoms.count(), &triplets)
    }

    /// Builds an `n` × `n` matrix from entries of its upper triangle. Entries at equal positions
    /// are summed.
    ///
    /// # Errors
    /// Those of [`Self::assemble`].
    pub fn from_triplets(n: usize, triplets: &[Triplet<u32, u32, f64>]) -> Result<Self> {
        SparseColMat::try_new_from_triplets(n, n, triplets).map(Self).map_err(|e| {
            Error::numerical(format!("a matrix of {n} unknowns cannot be built: {e:?}"), "use a coarser mesh")
        })
    }

    /// Returns the weighted sum of matrices with `n` rows.
    ///
    /// # Errors
    /// Those of [`Self::assemble`].
    pub fn sum(n: usize, matrices: &[&Self], weights: &[f64]) -> Result<Self> {
        let of_matrix = |(matrix, weight): (&&Self, &f64)| {
            let weight = *weight;
            triplets_of(matrix.upper())
                .map(move |entry| Triplet { val: weight * entry.val, ..entry })
                .collect::<Vec<_>>()
        };
        let triplets: Vec<_> = matrices.iter().zip(weights).filter(|(_, w)| **w != 0.0).flat_map(of_matrix).collect();
        Self::from_triplets(n, &triplets)
    }

    /// Upper triangle of the matrix, in compressed columns.
    pub fn upper(&self) -> SparseColMatRef<'_, u32, f64> {
        self.0.as_ref()
    }

    /// Adds the matrix times `x` to `result`.
    pub fn add_product(&self, x: &[f64], result: &mut [f64]) {
        add_symmetric_product(self.upper(), x, result);
    }

    /// Returns the matrix times `x`.
    pub fn product(&self, x: &[f64]) -> Vec<f64> {
        let mut result = vec![0.0; x.len()];
        self.add_product(x, &mut result);
        result
    }
}

/// Iterates over the entries of an upper triangle.
pub(super) fn triplets_of(upper: SparseColMatRef<'_, u32, f64>) -> impl Iterator<Item = Triplet<u32, u32, f64>> + '_ {
    (0..upper.ncols()).flat_map(move |column| {
        let range = upper.col_ptr()[column] as usize..upper.col_ptr()[column + 1] as usize;
        upper.row_idx()[range.clone()]
            .iter()
            .zip(&upper.val()[range])
            .map(move |(&row, &value)| Triplet::new(row, column as u32, value))
    })
}

/// Solver for weighted sums of given matrices. All sums share a sparsity pattern and a symbolic
/// factor.
#[derive(Debug)]
pub struct SymmetricSolver {
    /// Matrix of zeros with the common sparsity pattern.
    pattern: SparseColMat<u32, f64>,
    /// Position, in the common pattern, of each entry of each matrix.
    places: Vec<Vec<u32>>,
    symbolic: SymbolicCholesky<u32>,
}

impl SymmetricSolver {
    /// Computes the symbolic factor for sums of matrices of equal size. `order` is the elimination
    /// order of the unknowns.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the factor is too large.
    pub fn new(matrices: &[&SymmetricMatrix], order: &[usize]) -> Result<Self> {
        let n = order.len();
        let zeros: Vec<_> = matrices
            .iter()
            .flat_map(|matrix| triplets_of(matrix.upper()))
            .map(|entry| Triplet { val: 0.0, ..entry })
            .collect();
        let pattern = SymmetricMatrix::from_triplets(n, &zeros)?.0;
        let place = |entry: Triplet<u32, u32, f64>| {
            let column = entry.col as usize;
            let first = pattern.col_ptr()[column] as usize;
            let rows = &pattern.row_idx()[first..pattern.col_ptr()[column + 1] as usize];
            // The search succeeds, because the pattern was built from these entries.
            (first + rows.partition_point(|row| *row < entry.row)) as u32
        };
        let places = matrices.iter().map(|matrix| triplets_of(matrix.upper()).map(place).collect()).collect();
        let symbolic = analysed(pattern.symbolic(), order)?;
        Ok(Self { pattern, places, symbolic })
    }

    /// Cholesky factor of the weighted sum of the matrices, which are in the order given to
    /// [`Self::new`].
    ///
    /// # Errors
    /// [`Error::Numerical`] if the sum is not positive definite.
    pub fn factor(&self, matrices: &[&SymmetricMatrix], weights: &[f64]) -> Result<SymmetricFactor<'_>> {
        let mut sum = self.pattern.clone();
        for ((matrix, places), weight) in matrices.iter().zip(&self.places).zip(weights) {
            let target = sum.val_mut();
            for (value, &place) in matrix.upper().val().iter().zip(places) {
                target[place as usize] += weight * value;
            }
        }
        let values = factorised(&self.symbolic, sum.as_ref()).ok_or_else(|| {
            Error::numerical(
                format!("the matrices with the weights {weights:?} are not positive definite"),
                "check the mesh's symmetry planes and the effect's parameters",
            )
        })?;
        Ok(SymmetricFactor { symbolic: &self.symbolic, values })
    }
}

/// Cholesky factor of a weighted sum of symmetric matrices.
pub struct SymmetricFactor<'a> {
    symbolic: &'a SymbolicCholesky<u32>,
    values: Vec<f64>,
}

impl SymmetricFactor<'_> {
    /// Solves for a right-hand side and stores the solution in its place.
    pub fn solve_in_place(&self, right_hand_side: &mut [f64]) {
        solve_in_place(self.symbolic, &self.values, right_hand_side);
    }
}
