//! Exact steps under a force that grows with the position: matrix exponentials.
//!
//! With β = g C J₀ F_in and F = F_in/(1 − β), the modes obey Yᵢ' = κᵢ F (1 + g Σ Y) − ρᵢ Yᵢ, and the position is (C J₀ F_in + Σ Y)/(1 − β).

use std::collections::HashMap;

use super::feedback::Pieces;
use super::numbers::{Number, Real};
use super::system::System;
use crate::number::Scalar;

/// Most modes that are stepped exactly: beyond, the matrix costs more than a scheme.
pub(super) const LARGEST_STATE: usize = 4;

type Matrix<N> = [[N; LARGEST_STATE + 1]; LARGEST_STATE + 1];

/// Y ← matrix (Y, 1) under one level over one length; x = offset + output Σ Y.
pub(super) struct Transition<S> {
    pub matrix: Matrix<S>,
    pub offset: S,
    pub output: S,
}

impl<S: Number> Transition<S> {
    /// Those of all parts, and the index of each part's.
    pub fn all(system: &System<S>, pieces: &Pieces<S::Lane>) -> (Vec<Self>, Vec<usize>) {
        let (mut transitions, mut known) = (Vec::new(), HashMap::new());
        let order = pieces.pieces.iter().map(|piece| {
            *known.entry((piece.length, piece.force_n.to_bits())).or_insert_with(|| {
                transitions.push(Self::new(system, piece.force_n, pieces.length_s[piece.length]));
                transitions.len() - 1
            })
        });
        let order = order.collect();
        (transitions, order)
    }

    fn new(system: &System<S>, force_n: f64, length_s: S::Lane) -> Self {
        let zero = S::constant(0.0);
        let n = system.modes.len();
        let mut transition =
            Self { matrix: [[zero; LARGEST_STATE + 1]; LARGEST_STATE + 1], offset: zero, output: zero };
        let level_n = system.scaled_n(force_n) + system.offset_n;
        for lane in 0..S::N_POINTS {
            let (level_n, gradient) = (level_n.lane(lane), system.gradient.lane(lane));
            let jump_m = system.instantaneous.lane(lane) * level_n;
            let output = S::Lane::constant(1.0) / (S::Lane::constant(1.0) - gradient * jump_m);
            let acting_n = level_n * output;
            let mut generator = [[S::Lane::constant(0.0); LARGEST_STATE + 1]; LARGEST_STATE + 1];
            for (row, mode) in generator.iter_mut().zip(&system.modes) {
                let drive = mode.gain.lane(lane) * acting_n * length_s;
                row[..n].fill(drive * gradient);
                row[n] = drive;
            }
            for (i, mode) in system.modes.iter().enumerate() {
                generator[i][i] = generator[i][i] - mode.rate.lane(lane) * length_s;
            }
            let of_lane = exponential(&generator, n + 1);
            for (target, row) in transition.matrix.iter_mut().zip(&of_lane) {
                for (target, &entry) in target.iter_mut().zip(row) {
                    target.set_lane(lane, entry);
                }
            }
            transition.offset.set_lane(lane, jump_m * output);
            transition.output.set_lane(lane, output);
        }
        transition
    }
}

/// Norm up to which the series is used; its first term left out is below 1e-17.
const SERIES_NORM: f64 = 0.5;
const N_TERMS: u32 = 13;
/// Norms above 2⁶⁰ are not those of a model.
const MOST_SQUARINGS: u32 = 60;

/// eᴬ of the leading n × n block, by its series and squaring.
fn exponential<N: Real>(matrix: &Matrix<N>, n: usize) -> Matrix<N> {
    let norm = matrix[..n].iter().map(|row| row[..n].iter().map(|x| x.value().abs()).sum()).fold(0.0, f64::max);
    let n_squarings = if norm > SERIES_NORM { (norm / SERIES_NORM).log2().ceil() } else { 0.0 };
    // A norm that is not finite makes this 0 or the most there are; the result is not finite either.
    let n_squarings = (n_squarings as u32).min(MOST_SQUARINGS);
    let scale = 0.5_f64.powi(n_squarings as i32);
    let mut result = identity(n);
    for k in (1..=N_TERMS).rev() {
        result = product(matrix, &result, n, scale / f64::from(k));
        for (i, row) in result.iter_mut().enumerate().take(n) {
            row[i] += N::constant(1.0);
        }
    }
    for _ in 0..n_squarings {
        result = product(&result, &result, n, 1.0);
    }
    result
}

fn identity<N: Real>(n: usize) -> Matrix<N> {
    let mut result = [[N::constant(0.0); LARGEST_STATE + 1]; LARGEST_STATE + 1];
    for (i, row) in result.iter_mut().enumerate().take(n) {
        row[i] = N::constant(1.0);
    }
    result
}

/// factor · A B.
fn product<N: Real>(a: &Matrix<N>, b: &Matrix<N>, n: usize, factor: f64) -> Matrix<N> {
    let mut result = [[N::constant(0.0); LARGEST_STATE + 1]; LARGEST_STATE + 1];
    for i in 0..n {
        for k in 0..n {
            let scaled = a[i][k] * factor;
            for j in 0..n {
                result[i][j] += scaled * b[k][j];
            }
        }
    }
    result
}
