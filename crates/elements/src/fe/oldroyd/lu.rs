//! LU factors with partial pivoting, dense and sparse. One thread is used, so that results are
//! equal to the bit for any number of threads.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::perm::PermRef;
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{Argsort, Pair, SparseColMat, SymbolicSparseColMat};
use faer::{Conj, Mat, MatMut, Par};

use base::error::{Error, Result};

/// LU factors of a dense matrix.
pub(super) struct DenseLu {
    factors: Mat<f64>,
    rows: [Vec<u32>; 2],
}

impl DenseLu {
    pub fn new(mut matrix: Mat<f64>) -> Self {
        let n = matrix.nrows();
        let mut rows = [vec![0_u32; n], vec![0_u32; n]];
        let scratch = factor::lu_in_place_scratch::<u32, f64>(n, n, Par::Seq, Default::default());
        let [forward, backward] = &mut rows;
        factor::lu_in_place(
            matrix.as_mut(),
            forward,
            backward,
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        );
        Self { factors: matrix, rows }
    }

    /// Solves for one right-hand side and stores the solution in its place. Plain loops are faster
    /// here than block operations.
    pub(super) fn solve_one(&self, right: &mut [f64]) {
        let moved: Vec<f64> = self.rows[0].iter().map(|row| right[*row as usize]).collect();
        right.copy_from_slice(&moved);
        let n = right.len();
        for k in 0..n {
            let (value, below) = (right[k], &self.factors.col_as_slice(k)[k + 1..]);
            right[k + 1..].iter_mut().zip(below).for_each(|(x, factor)| *x -= factor * value);
        }
        for k in (0..n).rev() {
            let column = self.factors.col_as_slice(k);
            let value = right[k] / column[k];
            right[k] = value;
            right[..k].iter_mut().zip(column).for_each(|(x, factor)| *x -= factor * value);
        }
    }

    /// Solves for every column of `right` and stores the solutions in their place.
    pub(super) fn solve(&self, right: MatMut<'_, f64>) {
        let (n, n_right) = (self.factors.nrows(), right.ncols());
        let scratch = solve::solve_in_place_scratch::<u32, f64>(n, n_right, Par::Seq);
        solve::solve_in_place(
            self.factors.as_ref(),
            self.factors.as_ref(),
            PermRef::new_checked(&self.rows[0], &self.rows[1], n),
            right,
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
    }
}

/// Positions of the entries of a square sparse matrix. Entries at equal positions are summed.
pub(super) struct Pattern {
    symbolic: SymbolicSparseColMat<u32>,
    order: Argsort<u32>,
}

impl Pattern {
    /// Builds the pattern of an `n` × `n` matrix from the row and the column of each entry.
    pub fn new(n: usize, places: impl Iterator<Item = [usize; 2]>) -> Result<Self> {
        let places: Vec<Pair<u32, u32>> = places.map(|[row, column]| Pair::new(row as u32, column as u32)).collect();
        let made = SymbolicSparseColMat::try_new_from_indices(n, n, &places);
        let (symbolic, order) = made.map_err(|error| singular(n, &format!("{error:?}")))?;
        Ok(Self { symbolic, order })
    }
}

fn singular(n: usize, why: &str) -> Error {
    let remedy = "use a smaller force, a stiffer gel or a finer mesh";
    Error::numerical(format!("the gel's matrix of {n} unknowns cannot be factorised: {why}"), remedy)
}

/// LU factors of a sparse matrix.
pub(super) struct SparseLu {
    symbolic: Arc<SymbolicLu<u32>>,
    numeric: NumericLu<u32, f64>,
}

impl SparseLu {
    /// Factorises the matrix with these entries, in the order of `pattern`. `like`, a factor of a
    /// matrix with equal pattern, provides the elimination order.
    pub fn new(pattern: &Pattern, entries: &[f64], like: Option<&Self>) -> Result<Self> {
        let n = pattern.symbolic.ncols();
        let matrix = SparseColMat::new_from_argsort(pattern.symbolic.clone(), &pattern.order, entries);
        let matrix = matrix.map_err(|error| singular(n, &format!("{error:?}")))?;
        let symbolic = match like {
            Some(like) => like.symbolic.clone(),
            None => {
                let symbolic = factorize_symbolic_lu(matrix.symbolic(), Default::default());
                Arc::new(symbolic.map_err(|error| singular(n, &format!("{error:?}")))?)
            }
        };
        let scratch = symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default());
        let mut numeric = NumericLu::new();
        let factors = symbolic.factorize_numeric_lu(
            &mut numeric,
            matrix.as_ref(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        );
        factors.map_err(|error| singular(n, &format!("{error:?}")))?;
        Ok(Self { symbolic, numeric })
    }

    /// Solves for one right-hand side and stores the solution in its place.
    pub(super) fn solve(&self, right: &mut [f64]) {
        let n = right.len();
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq);
        LuRef::new_unchecked(&self.symbolic, &self.numeric).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(right, n, 1),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
    }
}
