//! Least squares with non-negative weights: the weights x ≥ 0 that minimise |Ax − b|, by the active-set method of C. Lawson and R. Hanson
//! (Solving Least Squares Problems, ch. 23).
//!
//! In empirical cubature (C. Farhat, T. Chapman, P. Avery, Int. J. Numer. Meth. Engng 102 (2015) 1077, doi:10.1002/nme.4820), each column
//! of A has the contributions of one integration point, and b has the sums over all points. The search stops as soon as the residual is
//! small, because an earlier stop gives fewer points.

use nalgebra::{DMatrix, DVector};

/// Slope of a column, relative to the product of its size and that of the right-hand side, that is rounding.
const ROUNDING: f64 = 1e-15;
/// Largest number of selections per column. Rounding could exchange columns for ever.
const MOST_STEPS: usize = 3;

/// Selected columns of a matrix, with their weights.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// Indices of the selected columns, ascending, with their positive weights.
    pub weights: Vec<(usize, f64)>,
    /// Residual |Ax − b|/|b| of the weights x, for the matrix A and the right-hand side b.
    pub residual: f64,
}

/// Selects columns of a matrix A until the residual |Ax − b| of their weights x is at most `tolerance` |b|, or until `most` columns are in
/// use. `columns` holds A column by column, each of the length of b.
pub fn choose(columns: &[f64], b: &[f64], tolerance: f64, most: usize) -> Selection {
    let n_rows = b.len();
    let b = DVector::from_column_slice(b);
    let column = |j: usize| &columns[j * n_rows..(j + 1) * n_rows];
    let norm = b.norm();
    let mut active: Vec<usize> = Vec::new();
    let mut x: Vec<f64> = Vec::new();
    let mut rest = b.clone();
    // `refused` holds columns that were removed directly after their selection because of rounding. They are not tried again until the
    // selection changes.
    let mut refused: Vec<usize> = Vec::new();
    let sizes: Vec<f64> = columns.chunks_exact(n_rows).map(|a| a.iter().map(|a| a * a).sum::<f64>().sqrt()).collect();
    let mut n_left = MOST_STEPS * sizes.len();
    while rest.norm() > tolerance * norm && active.len() < most && n_left > 0 {
        n_left -= 1;
        let best = columns
            .chunks_exact(n_rows)
            .enumerate()
            .map(|(j, a)| (j, a.iter().zip(rest.iter()).map(|(a, r)| a * r).sum::<f64>()))
            .filter(|(j, slope)| *slope > ROUNDING * sizes[*j] * norm && !active.contains(j) && !refused.contains(j))
            .fold(None, |best: Option<(usize, f64)>, (j, slope)| match best {
                Some((_, most)) if most >= slope => best,
                _ => Some((j, slope)),
            });
        let Some((entering, _)) = best else { break };
        active.push(entering);
        x.push(0.0);
        loop {
            let chosen = DMatrix::from_fn(n_rows, active.len(), |i, k| column(active[k])[i]);
            let Some(solution) = least_squares(&chosen, &b) else {
                active.pop();
                x.pop();
                refused.push(entering);
                break;
            };
            if solution.iter().all(|s| *s > 0.0) {
                x = solution;
                refused.clear();
                break;
            }
            // The step towards the solution is the longest step that keeps all weights non-negative. Columns whose weights vanish are
            // removed.
            let share =
                x.iter().zip(&solution).filter(|(_, s)| **s <= 0.0).map(|(x, s)| x / (x - s)).fold(1.0, f64::min);
            x.iter_mut().zip(&solution).for_each(|(x, s)| *x += share * (s - *x));
            let leaves: Vec<bool> = x.iter().zip(&solution).map(|(x, s)| *s <= 0.0 && *x <= 1e-14 * s.abs()).collect();
            if leaves.last() == Some(&true) && leaves.iter().filter(|l| **l).count() == 1 && share == 0.0 {
                refused.push(entering);
            }
            let mut keep = leaves.iter().map(|leaves| !leaves);
            active.retain(|_| keep.next().unwrap_or(true));
            let mut keep = leaves.iter().map(|leaves| !leaves);
            x.retain(|_| keep.next().unwrap_or(true));
            if active.is_empty() {
                break;
            }
        }
        rest.copy_from(&b);
        for (j, x) in active.iter().zip(&x) {
            rest.iter_mut().zip(column(*j)).for_each(|(r, a)| *r -= x * a);
        }
    }
    let mut weights: Vec<(usize, f64)> = active.into_iter().zip(x).collect();
    weights.sort_by_key(|(j, _)| *j);
    Selection { weights, residual: rest.norm() / norm }
}

/// Returns the least-squares solution by a QR decomposition; `None` if a column depends linearly on the others.
fn least_squares(a: &DMatrix<f64>, b: &DVector<f64>) -> Option<Vec<f64>> {
    if a.ncols() > a.nrows() {
        return None;
    }
    let qr = a.clone().qr();
    let mut projected = b.clone();
    qr.q_tr_mul(&mut projected);
    let r = qr.unpack_r();
    let largest = (0..r.ncols()).map(|i| r[(i, i)].abs()).fold(0.0, f64::max);
    if (0..r.ncols()).any(|i| r[(i, i)].abs() <= 1e-12 * largest) {
        return None;
    }
    let solution = r.solve_upper_triangular(&projected.rows(0, a.ncols()).into_owned())?;
    Some(solution.iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn residual(columns: &[f64], b: &[f64], weights: &[(usize, f64)]) -> Vec<f64> {
        let mut rest = b.to_vec();
        for (j, x) in weights {
            rest.iter_mut().zip(&columns[j * b.len()..]).for_each(|(r, a)| *r -= x * a);
        }
        rest
    }

    /// Checks the optimality conditions of Karush, Kuhn and Tucker. The slope of the squared residual is zero for selected columns, and no
    /// other column would reduce the residual.
    #[test]
    fn the_least_residual_without_negative_weights_is_found() {
        let (n_rows, n) = (7, 40);
        for seed in 0..10 {
            let columns: Vec<f64> = (0..n_rows * n).map(|k| (1.3 * f64::from(k) + f64::from(seed)).sin()).collect();
            let b: Vec<f64> = (0..n_rows).map(|k| (2.9 * f64::from(k * k) + f64::from(seed)).cos() - 0.4).collect();
            let found = choose(&columns[..7 * 12], &b, 0.0, 12);
            let rest = residual(&columns, &b, &found.weights);
            for (j, column) in columns[..7 * 12].chunks_exact(7).enumerate() {
                let slope: f64 = column.iter().zip(&rest).map(|(a, r)| a * r).sum();
                let in_use = found.weights.iter().any(|(k, _)| *k == j);
                assert!(slope < 1e-12 && (!in_use || slope > -1e-12), "{seed} {j} {slope}");
            }
            assert!(found.weights.iter().all(|(_, x)| *x > 0.0));
        }
    }

    /// Checks the theorem of Gauss and Tchakaloff, by which at most 8 of 400 points reproduce the moments up to degree 7.
    #[test]
    fn moments_need_no_more_points_than_there_are_moments() {
        let points: Vec<f64> = (0..400).map(|i| -1.0 + (f64::from(i) + 0.5) / 200.0).collect();
        let columns: Vec<f64> = points.iter().flat_map(|x| (0..8).map(move |k| x.powi(k) / 400.0)).collect();
        let b: Vec<f64> = (0..8).map(|k| columns.chunks_exact(8).map(|c| c[k]).sum()).collect();
        let found = choose(&columns, &b, 1e-12, 100);
        assert!(found.weights.len() <= 8 && found.residual <= 1e-12, "{found:?}");
        let early = choose(&columns, &b, 0.05, 100);
        assert!(early.weights.len() < found.weights.len() && early.residual <= 0.05, "{early:?}");
    }
}
