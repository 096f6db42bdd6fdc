//! The quick part of the search: linear scores of thousands of shapes at once, and the best that chance makes of each family.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::setting::Setting;
use super::shape::Shape;
use crate::critique::Tangent;
use crate::inference::ensemble::RandomStream;

/// What a shape would gain, by its linear score.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scored {
    pub family: usize,
    pub shape: Shape,
    /// ½‖Qᵀr‖², in nats.
    pub gain_nats: f64,
    /// Independent visible columns.
    pub degrees: usize,
}

/// Scores of all shapes, and for each family the best gain of any in residuals of pure noise, one a simulation.
pub(super) struct Screened {
    pub scores: Vec<Scored>,
    pub maxima: Vec<Vec<f64>>,
}

/// Shapes that are whitened together.
const CHUNK: usize = 48;
/// Part of a whitened column that the model must leave: less is curvature and rounding.
const LEAST_VISIBLE: f64 = 1e-3;

/// Scores every shape of every family against the residuals of a tangent and against `n_simulations` residuals of white numbers.
pub(super) fn screen(
    tangent: &Tangent,
    setting: &Setting,
    families: &[Vec<Shape>],
    n_simulations: usize,
    seed: u64,
) -> Screened {
    let listed: Vec<(usize, Shape)> = families
        .iter()
        .enumerate()
        .flat_map(|(family, shapes)| shapes.iter().map(move |shape| (family, *shape)))
        .collect();
    let residuals = residuals(tangent, n_simulations, seed);
    let chunks = listed.par_chunks(CHUNK).map(|chunk| score_chunk(tangent, setting, chunk, &residuals));
    let chunks: Vec<_> = chunks.collect();
    let mut screened = Screened { scores: Vec::new(), maxima: vec![vec![0.0; n_simulations]; families.len()] };
    for (scores, maxima) in chunks {
        screened.scores.extend(scores);
        for (family, of_chunk) in maxima {
            let all = screened.maxima[family].iter_mut();
            all.zip(of_chunk).for_each(|(largest, gain)| *largest = largest.max(gain));
        }
    }
    screened
}

/// Own residuals, then simulated ones. The shapes' bases lie in the range of P, so that white numbers need no projection.
fn residuals(tangent: &Tangent, n_simulations: usize, seed: u64) -> DMatrix<f64> {
    let mut residuals = DMatrix::zeros(tangent.n_rows(), 1 + n_simulations);
    residuals.set_column(0, tangent.residual());
    for simulation in 0..n_simulations {
        let mut stream = RandomStream::new(seed, simulation as u64);
        residuals.column_mut(1 + simulation).iter_mut().for_each(|value| *value = stream.normal());
    }
    residuals
}

fn score_chunk(
    tangent: &Tangent,
    setting: &Setting,
    chunk: &[(usize, Shape)],
    residuals: &DMatrix<f64>,
) -> (Vec<Scored>, Vec<(usize, Vec<f64>)>) {
    let columns: Vec<Vec<Vec<f64>>> = chunk.iter().map(|(_, shape)| shape.columns_m(setting)).collect();
    let flat: Vec<Vec<f64>> = columns.iter().flatten().cloned().collect();
    let mut white = tangent.whiten(&flat).into_iter();
    let bases: Vec<Vec<DVector<f64>>> =
        columns.iter().map(|of_shape| basis(tangent, white.by_ref().take(of_shape.len()).collect()).0).collect();
    let all: Vec<DVector<f64>> = bases.iter().flatten().cloned().collect();
    if all.is_empty() {
        return (Vec::new(), Vec::new());
    }
    // By a product of matrices: transposed in place it would be done number by number.
    let along = DMatrix::from_columns(&all).transpose() * residuals;
    let (mut scores, mut maxima): (Vec<Scored>, Vec<(usize, Vec<f64>)>) = (Vec::new(), Vec::new());
    let mut from = 0;
    for ((family, shape), basis) in chunk.iter().zip(&bases) {
        let rows = along.rows(from, basis.len());
        from += basis.len();
        let gain = |simulation: usize| 0.5 * rows.column(simulation).norm_squared();
        scores.push(Scored { family: *family, shape: *shape, gain_nats: gain(0), degrees: basis.len() });
        if maxima.last().is_none_or(|(last, _)| last != family) {
            maxima.push((*family, vec![0.0; residuals.ncols() - 1]));
        }
        if let Some((_, largest)) = maxima.last_mut() {
            largest.iter_mut().enumerate().for_each(|(k, largest)| *largest = largest.max(gain(k + 1)));
        }
    }
    (scores, maxima)
}

/// Orthonormal basis of what the model leaves of whitened columns, and which of them add to it.
pub(super) fn basis(tangent: &Tangent, white: Vec<DVector<f64>>) -> (Vec<DVector<f64>>, Vec<usize>) {
    let (mut basis, mut kept): (Vec<DVector<f64>>, Vec<usize>) = (Vec::new(), Vec::new());
    for (place, column) in white.into_iter().enumerate() {
        let whole = column.norm();
        let mut left = tangent.project(column);
        // Twice is enough for orthogonality to rounding.
        for _ in 0..2 {
            for direction in &basis {
                let along = direction.dot(&left);
                left.axpy(-along, direction, 1.0);
            }
        }
        let norm = left.norm();
        if norm > LEAST_VISIBLE * whole {
            basis.push(left / norm);
            kept.push(place);
        }
    }
    (basis, kept)
}
