//! Exact steps under a force that grows with the position: matrix exponentials.
//!
//! With β = g C J₀ F_in and F = F_in/(1 − β), the modes obey Yᵢ' = κᵢ F (1 + g Σ Y) − ρᵢ Yᵢ, and the position is (C J₀ F_in + Σ Y)/(1 − β).

use std::collections::HashMap;

use pulp::{Arch, Simd, WithSimd};

use super::numbers::{N_LANES, Number, gather};
use super::schedule::Schedule;
use super::system::{LARGEST_STATE, System};
use crate::number::{PointScalar, Scalar};

type Matrix<N> = [[N; LARGEST_STATE + 1]; LARGEST_STATE + 1];

/// Y ← matrix (Y, 1) under one level over one length; x = offset + output Σ Y.
pub(super) struct Transition<S> {
    pub matrix: Matrix<S>,
    pub offset: S,
    pub output: S,
}

impl<S: Number> Transition<S> {
    /// Those of all parts, and the index of each part's.
    pub fn all(system: &System<S>, schedule: &Schedule<S>) -> (Vec<Self>, Vec<usize>) {
        let (mut transitions, mut known) = (Vec::new(), HashMap::new());
        let order = schedule.pieces.iter().map(|piece| {
            *known.entry((piece.length, piece.level)).or_insert_with(|| {
                transitions.push(Self::new(
                    system,
                    schedule.levels[piece.level].force_n,
                    schedule.length_s[piece.length],
                ));
                transitions.len() - 1
            })
        });
        let order = order.collect();
        (transitions, order)
    }

    fn new(system: &System<S>, level_n: S, length_s: S) -> Self {
        let n = system.modes.len();
        let jump_m = system.instantaneous * level_n;
        let output = S::constant(1.0) / (S::constant(1.0) - system.gradient * jump_m);
        let acting_n = level_n * output;
        let mut generator = [[S::constant(0.0); LARGEST_STATE + 1]; LARGEST_STATE + 1];
        for (i, mode) in system.modes.iter().enumerate() {
            let drive = mode.gain * acting_n * length_s;
            generator[i][..n].fill(drive * system.gradient);
            generator[i][n] = drive;
            generator[i][i] = generator[i][i] - mode.rate * length_s;
        }
        Self { matrix: exponential(generator, n + 1), offset: jump_m * output, output }
    }
}

/// Norm up to which the series is used; its first term left out is below 1e-15 of the norm.
const SERIES_NORM: f64 = 0.5;
const N_TERMS: u32 = 13;
/// Norms above 2⁶⁰ are not those of a model.
const MOST_SQUARINGS: f64 = 60.0;

/// eᴬ of the leading n × n block, by its series and squaring; every point is scaled and squared as its own norm asks.
fn exponential<S: Number>(mut matrix: Matrix<S>, n: usize) -> Matrix<S> {
    let mut n_squarings = [0; N_LANES];
    for (lane, n_squarings) in n_squarings.iter_mut().enumerate().take(S::N_POINTS) {
        let size = |x: &S| x.lane(lane).value().abs();
        let norm = matrix[..n].iter().map(|row| row[..n].iter().map(size).sum()).fold(0.0, f64::max);
        if norm > SERIES_NORM {
            *n_squarings = (norm / SERIES_NORM).log2().ceil().min(MOST_SQUARINGS) as i32;
        }
    }
    let scale = gather::<S>(|lane| S::Lane::constant(0.5_f64.powi(n_squarings[lane])));
    for entry in matrix[..n].iter_mut().flat_map(|row| &mut row[..n]) {
        *entry = *entry * scale;
    }
    let mut result = identity(n);
    Arch::new().dispatch(SeriesAndSquares { matrix: &matrix, result: &mut result, n, n_squarings });
    result
}

/// 1 + A (1 + A/2 (1 + A/3 (…))), squared as often as each point asks for.
struct SeriesAndSquares<'a, S> {
    matrix: &'a Matrix<S>,
    result: &'a mut Matrix<S>,
    n: usize,
    n_squarings: [i32; N_LANES],
}

impl<S: Number> WithSimd for SeriesAndSquares<'_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<V: Simd>(self, _simd: V) {
        let Self { matrix, result, n, n_squarings } = self;
        for k in (1..=N_TERMS).rev() {
            *result = product(matrix, result, n, 1.0 / f64::from(k));
            for i in 0..n {
                result[i][i] += S::constant(1.0);
            }
        }
        let mut most = 0;
        for wanted in n_squarings {
            most = if wanted > most { wanted } else { most };
        }
        for round in 0..most {
            let squared = product(result, result, n, 1.0);
            for i in 0..n {
                for j in 0..n {
                    for lane in 0..S::N_POINTS {
                        if round < n_squarings[lane] {
                            result[i][j].set_lane(lane, squared[i][j].lane(lane));
                        }
                    }
                }
            }
        }
    }
}

fn identity<N: Number>(n: usize) -> Matrix<N> {
    let mut result = [[N::constant(0.0); LARGEST_STATE + 1]; LARGEST_STATE + 1];
    for (i, row) in result.iter_mut().enumerate().take(n) {
        row[i] = N::constant(1.0);
    }
    result
}

/// factor · A B.
#[inline(always)]
fn product<N: Number>(a: &Matrix<N>, b: &Matrix<N>, n: usize, factor: f64) -> Matrix<N> {
    let mut result = [[N::constant(0.0); LARGEST_STATE + 1]; LARGEST_STATE + 1];
    for i in 0..n {
        for k in 0..n {
            let scaled = a[i][k] * factor;
            for j in 0..n {
                result[i][j] = scaled.mul_add(b[k][j], result[i][j]);
            }
        }
    }
    result
}
