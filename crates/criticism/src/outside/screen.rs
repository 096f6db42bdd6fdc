//! Screening: linear scores of thousands of shapes at once, and each family's best score in simulated noise.

use std::ops::Range;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::setting::SearchSetting;
use super::shape::StructureShape;
use crate::Tangent;
use posterior::noise::dot;
use sampling::ensemble::RandomStream;

/// A shape with its linear score.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scored {
    pub family: usize,
    pub shape: StructureShape,
    /// First-order gain, in nats: half the squared norm of the residual's projection onto the shape's columns, after the model has absorbed its part of them.
    pub gain_nats: f64,
    /// Number of independent columns that the model cannot absorb.
    pub degrees: usize,
}

/// Scores of all shapes. For each family, `maxima` has the best gain (nats) in each simulated residual of pure noise.
pub(super) struct Screened {
    pub scores: Vec<Scored>,
    pub maxima: Vec<Vec<f64>>,
}

/// Number of shapes whitened together. It is smaller (`LOCAL_CHUNK`) for shapes that are 0 in most rows, since a chunk covers the rows of all its shapes.
const CHUNK: usize = 48;
const LOCAL_CHUNK: usize = 16;
/// Least fraction of a whitened column that the model must not absorb. A smaller remainder comes from curvature and rounding.
const LEAST_VISIBLE: f64 = 1e-3;

/// Scores every shape of every family against the residuals of a tangent and against `n_simulations` residuals of white noise.
pub(super) fn screen(
    tangent: &Tangent,
    setting: &SearchSetting,
    families: &[Vec<StructureShape>],
    n_simulations: usize,
    seed: u64,
) -> Screened {
    let listed = families
        .iter()
        .enumerate()
        .flat_map(|(family, shapes)| shapes.iter().map(move |shape| (family, *shape, shape.rows(setting))));
    let listed: Vec<Listed> = listed.collect();
    let beside = beside(tangent, n_simulations, seed);
    let scored: Vec<_> =
        chunks(&listed, setting).into_par_iter().map(|chunk| score_chunk(tangent, setting, chunk, &beside)).collect();
    let mut screened = Screened { scores: Vec::new(), maxima: vec![vec![0.0; n_simulations]; families.len()] };
    for (scores, maxima) in scored {
        screened.scores.extend(scores);
        for (family, of_chunk) in maxima {
            let all = screened.maxima[family].iter_mut();
            all.zip(of_chunk).for_each(|(largest, gain)| *largest = largest.max(gain));
        }
    }
    screened
}

/// A shape with the index of its family and the rows in which it differs from 0.
type Listed = (usize, StructureShape, Range<usize>);

/// Groups successive shapes that are scored together. Shapes that are 0 in most rows are grouped with neighbours in time.
fn chunks<'a>(listed: &'a [Listed], setting: &SearchSetting) -> Vec<&'a [Listed]> {
    let is_whole = |shape: &Listed| shape.2.len() == setting.time_s.len();
    let are_near = |a: &Listed, b: &Listed| is_whole(a) == is_whole(b) && (is_whole(a) || a.2.start <= b.2.start);
    let size = |run: &[Listed]| if run.first().is_some_and(is_whole) { CHUNK } else { LOCAL_CHUNK };
    listed.chunk_by(are_near).flat_map(|run| run.chunks(size(run))).collect()
}

/// Factors that all shapes share: the projected measured and simulated residuals, and the basis of the directions that the model absorbs.
struct ScreenFactors {
    columns: DMatrix<f64>,
    n_residuals: usize,
}

fn beside(tangent: &Tangent, n_simulations: usize, seed: u64) -> ScreenFactors {
    let absorbed = tangent.absorbed();
    let mut residuals = DMatrix::zeros(tangent.n_rows(), 1 + n_simulations);
    residuals.set_column(0, tangent.residual());
    for simulation in 0..n_simulations {
        let mut stream = RandomStream::new(seed, simulation as u64);
        residuals.column_mut(1 + simulation).iter_mut().for_each(|value| *value = stream.normal());
    }
    let inside = absorbed.tr_mul(&residuals);
    residuals.gemm(-1.0, absorbed, &inside, 1.0);
    let n_residuals = residuals.ncols();
    let mut columns = residuals.resize_horizontally(n_residuals + absorbed.ncols(), 0.0);
    columns.columns_mut(n_residuals, absorbed.ncols()).copy_from(absorbed);
    ScreenFactors { columns, n_residuals }
}

fn score_chunk(
    tangent: &Tangent,
    setting: &SearchSetting,
    chunk: &[Listed],
    beside: &ScreenFactors,
) -> (Vec<Scored>, Vec<(usize, Vec<f64>)>) {
    let rows = chunk.iter().map(|(_, _, rows)| rows.clone()).reduce(|a, b| a.start.min(b.start)..a.end.max(b.end));
    let rows = rows.unwrap_or(0..0);
    let columns: Vec<Vec<Vec<f64>>> =
        chunk.iter().map(|(_, shape, _)| shape.columns_in_m(setting, rows.clone())).collect();
    let flat: Vec<Vec<f64>> = columns.iter().flatten().cloned().collect();
    let (first, white) = tangent.whiten_from(&flat, rows.start);
    let n_rows = white.first().map_or(0, Vec::len);
    if n_rows == 0 {
        return (Vec::new(), Vec::new());
    }
    let by_row = DMatrix::from_fn(white.len(), n_rows, |column, row| white[column][row]);
    // A matrix product transposes fast; an explicit transposition would copy the numbers one by one.
    let along = &by_row * beside.columns.rows(first, n_rows);
    let (residuals, absorbed) = along.columns_range_pair(0..beside.n_residuals, beside.n_residuals..);
    let (mut scores, mut maxima): (Vec<Scored>, Vec<(usize, Vec<f64>)>) = (Vec::new(), Vec::new());
    let mut from = 0;
    for ((family, shape, _), of_shape) in chunk.iter().zip(&columns) {
        let n = of_shape.len();
        let factor = Factor::new(&white[from..from + n], &absorbed.rows(from, n).clone_owned());
        let gains = factor.gains(&residuals.rows(from, n).clone_owned());
        from += n;
        scores.push(Scored { family: *family, shape: *shape, gain_nats: gains[0], degrees: factor.kept.len() });
        if maxima.last().is_none_or(|(last, _)| last != family) {
            maxima.push((*family, vec![0.0; beside.n_residuals - 1]));
        }
        if let Some((_, largest)) = maxima.last_mut() {
            largest.iter_mut().zip(&gains[1..]).for_each(|(largest, gain)| *largest = largest.max(*gain));
        }
    }
    (scores, maxima)
}

/// Returns the indices of the columns (m) whose whitened part the model cannot absorb and that are independent of earlier ones.
pub(super) fn kept(tangent: &Tangent, columns_m: &[Vec<f64>]) -> Vec<usize> {
    let white = tangent.whiten(columns_m);
    let absorbed = DMatrix::from_fn(white.len(), tangent.absorbed().ncols(), |column, k| {
        white[column].dot(&tangent.absorbed().column(k))
    });
    let white: Vec<Vec<f64>> = white.into_iter().map(|column| column.data.into()).collect();
    Factor::new(&white, &absorbed).kept
}

/// Cholesky factor of the inner products of a shape's whitened columns, without the part that the model absorbs. Columns that the model or earlier columns absorb are left out.
struct Factor {
    /// Rows of the factor, one per column that is kept.
    rows: Vec<Vec<f64>>,
    kept: Vec<usize>,
}

impl Factor {
    /// Factorises the inner products of whitened columns. `absorbed` has, for each column, a row of its products with the basis of the directions that the model absorbs.
    fn new(white: &[Vec<f64>], absorbed: &DMatrix<f64>) -> Self {
        let (mut rows, mut kept): (Vec<Vec<f64>>, Vec<usize>) = (Vec::new(), Vec::new());
        for (k, column) in white.iter().enumerate() {
            let product = |other: usize| dot(column, &white[other]) - absorbed.row(k).dot(&absorbed.row(other));
            let mut row: Vec<f64> = Vec::with_capacity(kept.len() + 1);
            for (place, other) in kept.iter().enumerate() {
                let before: f64 = row.iter().zip(&rows[place]).map(|(a, b)| a * b).sum();
                row.push((product(*other) - before) / rows[place][place]);
            }
            let left = product(k) - row.iter().map(|x| x * x).sum::<f64>();
            if left > LEAST_VISIBLE.powi(2) * dot(column, column) {
                row.push(left.sqrt());
                rows.push(row);
                kept.push(k);
            }
        }
        Self { rows, kept }
    }

    /// Returns the first-order gain (nats) of the shape for each residual. `products` has the inner products of residuals (columns) with the shape's columns (rows).
    fn gains(&self, products: &DMatrix<f64>) -> Vec<f64> {
        let gain = |column: usize| {
            let mut along: Vec<f64> = Vec::with_capacity(self.kept.len());
            for (row, place) in self.rows.iter().zip(&self.kept) {
                let before: f64 = row.iter().zip(&along).map(|(a, b)| a * b).sum();
                along.push((products[(*place, column)] - before) / row[along.len()]);
            }
            0.5 * along.iter().map(|x| x * x).sum::<f64>()
        };
        (0..products.ncols()).map(gain).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::NoiseValues;
    use nalgebra::DVector;

    use super::*;
    use crate::Fitted;
    use crate::outside::shape::families;
    use crate::test_replica::{base_fit, replica};

    /// Score by Gram–Schmidt over all rows, applied twice, and the number of remaining columns.
    fn by_projection(tangent: &Tangent, columns_m: &[Vec<f64>], residual: &DVector<f64>) -> (f64, usize) {
        let mut basis: Vec<DVector<f64>> = Vec::new();
        for white in tangent.whiten(columns_m) {
            let whole = white.norm();
            let mut left = tangent.project(white);
            for _ in 0..2 {
                for direction in &basis {
                    left -= direction * direction.dot(&left);
                }
            }
            let norm = left.norm();
            if norm > LEAST_VISIBLE * whole {
                basis.push(left / norm);
            }
        }
        (basis.iter().map(|direction| 0.5 * direction.dot(residual).powi(2)).sum(), basis.len())
    }

    /// Scores every shape of every family on the replica under all noise terms. Gains equal those of projections over all rows, to 10⁻⁸ of the residuals' size. So do the
    /// largest gains of simulated residuals.
    #[test]
    fn scores_are_those_of_projections_over_all_rows() {
        let (candidate, fitted) = base_fit();
        for noise in [NoiseValues::new([4.0, 3.0, 0.7, 0.012, 2.0]), NoiseValues::new([4.0, 2.0, 40.0, 0.02, 1.0])] {
            let fitted = Fitted { noise, ..fitted.clone() };
            let setting = SearchSetting::new(replica(), &candidate, &fitted).expect("evaluates");
            let tangent = Tangent::new(replica(), &candidate, &fitted).expect("derivatives");
            let families = families(&setting);
            let screened = screen(&tangent, &setting, &families, 2, 5);
            let n_shapes: usize = families.iter().map(Vec::len).sum();
            assert_eq!(screened.scores.len(), n_shapes);
            let mut simulated = vec![DVector::zeros(tangent.n_rows()); 2];
            for (number, residual) in simulated.iter_mut().enumerate() {
                let mut stream = RandomStream::new(5, number as u64);
                residual.iter_mut().for_each(|value| *value = stream.normal());
            }
            let scale = tangent.residual().norm_squared();
            let mut maxima = vec![[0.0_f64; 2]; families.len()];
            let (mut n_local, mut n_bells) = (0, 0);
            for score in &screened.scores {
                let columns = score.shape.columns_m(&setting);
                let (gain, degrees) = by_projection(&tangent, &columns, tangent.residual());
                let name = format!("{:?}", score.shape);
                assert_eq!(score.degrees, degrees, "{name}");
                assert!((score.gain_nats - gain).abs() < 1e-8 * scale, "{name}: {} {gain}", score.gain_nats);
                for (largest, residual) in maxima[score.family].iter_mut().zip(&simulated) {
                    *largest = largest.max(by_projection(&tangent, &columns, residual).0);
                }
                n_bells += usize::from(matches!(score.shape, StructureShape::Bump { .. }));
                n_local += usize::from(2 * score.shape.rows(&setting).len() < setting.time_s.len());
            }
            assert!(n_bells > 500 && 2 * n_local > n_bells, "{n_bells} {n_local}");
            for (found, exact) in screened.maxima.iter().zip(&maxima) {
                assert!(found.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-8 * scale), "{found:?} {exact:?}");
            }
        }
    }
}
