//! Exact elimination, before time stepping, of unknowns that occur in only one of the two matrices.
//!
//! The unknowns in one matrix only (index e) bear no load and obey one law. They therefore follow
//! the unknowns in both matrices (index k): z_e = −K_ee⁻¹K_ek z_k for any law, with K the sum of
//! both matrices. Only the unknowns k move independently. They are on the robot's surface for a
//! slipping gel, on the outer surface for a yielding wall, and on the edge of a pocket. If the gel
//! has mass, all its unknowns remain.

use faer::Mat;
use faer::sparse::Triplet;

use super::matrices::triplets_of;
use super::{DegreesOfFreedom, SpatialSystem, SymmetricMatrix, SymmetricSolver};
use base::error::Result;

/// Number of right-hand sides that are solved at once.
const BLOCK: usize = 64;
/// Largest fraction of kept unknowns for which elimination pays.
const MOST_KEPT: f64 = 0.25;

/// The matrices between the unknowns that occur in both matrices, and the data to recover the
/// eliminated unknowns.
pub(super) struct Condensed<'a> {
    whole: &'a SpatialSystem,
    /// Matrices between the kept unknowns.
    pub(super) system: SpatialSystem,
    kept: Vec<usize>,
    eliminated: Vec<usize>,
    /// Sum of both matrices, restricted to the eliminated unknowns.
    between: SymmetricMatrix,
    solver: SymmetricSolver,
}

impl<'a> Condensed<'a> {
    /// Eliminates the unknowns that occur in only one matrix. Returns `None` if more than a quarter
    /// of the unknowns would remain.
    ///
    /// # Errors
    /// Those of [`SymmetricSolver::factor`].
    pub(super) fn of(whole: &'a SpatialSystem) -> Result<Option<Self>> {
        let n = whole.n_unknowns();
        let both = [&whole.gel, &whole.second];
        let known = both.map(|matrix| {
            let mut known = vec![false; n];
            for entry in triplets_of(matrix.upper()).filter(|entry| entry.val != 0.0) {
                (known[entry.row as usize], known[entry.col as usize]) = (true, true);
            }
            known
        });
        // The robot's unknown, which is the last, is always kept.
        let is_kept = |k: &usize| (known[0][*k] && known[1][*k]) || *k + 1 == n;
        let (kept, eliminated): (Vec<usize>, Vec<usize>) = (0..n).partition(is_kept);
        if kept.len() as f64 > MOST_KEPT * n as f64 {
            return Ok(None);
        }
        let mut place = vec![0_u32; n];
        for list in [&kept, &eliminated] {
            list.iter().zip(0_u32..).for_each(|(unknown, number)| place[*unknown] = number);
        }
        let is_kept: Vec<bool> = (0..n).map(|k| is_kept(&k)).collect();
        // Entries of each matrix between kept unknowns, and from kept to eliminated ones.
        let mut condensed = both.map(|_| Mat::<f64>::zeros(kept.len(), kept.len()));
        let mut couplings: [Vec<(usize, usize, f64)>; 2] = [Vec::new(), Vec::new()];
        let mut between = Vec::new();
        for ((matrix, condensed), couplings) in both.iter().zip(&mut condensed).zip(&mut couplings) {
            for Triplet { row, col, val } in triplets_of(matrix.upper()) {
                let (i, j) = (place[row as usize], place[col as usize]);
                match (is_kept[row as usize], is_kept[col as usize]) {
                    (true, true) => {
                        condensed[(i as usize, j as usize)] += val;
                        if i != j {
                            condensed[(j as usize, i as usize)] += val;
                        }
                    }
                    (true, false) => couplings.push((i as usize, j as usize, val)),
                    (false, true) => couplings.push((j as usize, i as usize, val)),
                    (false, false) => between.push(Triplet::new(i, j, val)),
                }
            }
        }
        let between = SymmetricMatrix::from_triplets(eliminated.len(), &between)?;
        let order: Vec<usize> =
            whole.order.iter().filter(|unknown| !is_kept[**unknown]).map(|unknown| place[*unknown] as usize).collect();
        let solver = SymmetricSolver::new(&[&between], &order)?;
        let factor = solver.factor(&[&between], &[1.0])?;
        let n_eliminated = eliminated.len();
        for first in (0..kept.len()).step_by(BLOCK) {
            let columns = first..kept.len().min(first + BLOCK);
            let mut block = vec![0.0; n_eliminated * columns.len()];
            for (k, e, value) in couplings.iter().flatten().filter(|(k, ..)| columns.contains(k)) {
                block[(k - first) * n_eliminated + e] += value;
            }
            factor.solve_in_place(&mut block);
            for (condensed, couplings) in condensed.iter_mut().zip(&couplings) {
                for (column, solved) in columns.clone().zip(block.chunks_exact(n_eliminated)) {
                    let column = condensed.col_as_slice_mut(column);
                    couplings.iter().for_each(|(k, e, value)| column[*k] -= value * solved[*e]);
                }
            }
        }
        drop(factor);
        let [gel, second] = condensed.map(|matrix| {
            // The matrix is symmetric up to rounding. The mean makes it exactly symmetric.
            let entry = |i: usize, j: usize| 0.5 * (matrix[(i, j)] + matrix[(j, i)]);
            let upper = (0..matrix.ncols()).flat_map(|j| (0..=j).map(move |i| (i, j)));
            let upper: Vec<_> = upper.map(|(i, j)| Triplet::new(i as u32, j as u32, entry(i, j))).collect();
            SymmetricMatrix::from_triplets(matrix.ncols(), &upper)
        });
        let freedoms = DegreesOfFreedom::without_nodes(kept.len(), whole.freedoms.share());
        let system = SpatialSystem::of_unknowns(freedoms, gel?, second?, (0..kept.len()).collect())?;
        Ok(Some(Self { whole, system, kept, eliminated, between, solver }))
    }

    /// Recovers all unknowns from the kept ones, one vector after the other.
    ///
    /// # Errors
    /// Those of [`SymmetricSolver::factor`].
    pub(super) fn expanded(&self, kept: Vec<Vec<f64>>) -> Result<Vec<Vec<f64>>> {
        if kept.is_empty() {
            return Ok(kept);
        }
        let factor = self.solver.factor(&[&self.between], &[1.0])?;
        let expand = |values: Vec<f64>| {
            let mut all = vec![0.0; self.whole.n_unknowns()];
            self.kept.iter().zip(values).for_each(|(unknown, value)| all[*unknown] = value);
            let mut forces = self.whole.gel.product(&all);
            self.whole.second.add_product(&all, &mut forces);
            let mut follow: Vec<f64> = self.eliminated.iter().map(|unknown| -forces[*unknown]).collect();
            factor.solve_in_place(&mut follow);
            self.eliminated.iter().zip(follow).for_each(|(unknown, value)| all[*unknown] = value);
            all
        };
        Ok(kept.into_iter().map(expand).collect())
    }
}
