//! Whitening of columns, and inner products of whitened columns without storing them.
//!
//! All columns have the same covariance and therefore the same Kalman gains. The filter computes the gains of a block of rows once. It then advances the means of all
//! columns through the block, eight columns at a time.
//!
//! Each cycle has a column, which is 1 in the cycle's rows and 0 elsewhere. The whitened column is 0 before the cycle. After the cycle, it depends only on the filter's
//! mean of the process at the cycle's end. [`CycleProducts`] therefore holds inner products over the cycle's rows only. They belong to the cycle's column and to the
//! response to a unit of process at the beginning of the cycle. [`CycleProducts`] also holds the process that remains of both at the cycle's end.

use std::ops::Range;

use nalgebra::DMatrix;
use pulp::{Arch, Scalar, Simd, WithSimd};

use super::NoiseLikelihood;
use super::filter::{GainNumbers, Mean};
use super::lanes::{LANES, Product, Products as Determinant, Register};
use super::paths::{RowFilter, advance, number};
use super::rows::NoiseRow;
use super::scales::FilterScales;

/// Number of rows that are whitened together. Their columns fit into the processor's nearest cache.
const BLOCK: usize = 256;
/// Number of rows between two checks whether a column that has ended still influences the filter.
const SHORT_BLOCK: usize = 64;

/// Kalman gain at one observed row, with the quantities that whiten a column there.
#[derive(Clone, Copy)]
struct RowGain {
    row: NoiseRow,
    /// Predicted position of the row in m.
    x: f64,
    decay: f64,
    gain: GainNumbers,
    /// Square root of σ²/S, where S is the predictive variance of the position and σ² the variance of the white noise.
    root_precision: f64,
    /// Part of the predictive variance S that is not white noise, divided by the white variance σ²: S/σ² − 1.
    excess: f64,
}

impl RowGain {
    fn of(walk: &mut RowFilter, row: &NoiseRow, position_m: &[f64]) -> Self {
        let x = position_m[row.index];
        let (decay, gain) = walk.observe(row, x);
        let numbers = gain.numbers();
        let root_precision = numbers.precision.sqrt();
        Self { row: *row, x, decay: decay.number(), gain: numbers, root_precision, excess: gain.excess.number() }
    }
}

/// A block of successive rows with the whitened columns.
struct WhiteningBlock<'a> {
    rows: &'a [RowGain],
    /// Whitened values of each column, one per row of the block.
    white: &'a [[f64; BLOCK]],
}

impl WhiteningBlock<'_> {
    fn column(&self, column: usize) -> &[f64] {
        &self.white[column][..self.rows.len()]
    }
}

/// Inner products of whitened columns.
#[derive(Debug, Clone)]
pub struct WhiteProducts {
    /// Matrix of inner products for each set of columns. Its rows and columns belong to the columns that all sets share, then to the columns of this set alone.
    pub sets: Vec<DMatrix<f64>>,
    /// Products of the set in [`ProductRequest::with_cycles`], one entry per cycle with an observed row.
    pub cycles: Vec<CycleProducts>,
    /// Constant −½ ln det(2πΣ) of the log density, in nats. Σ is the covariance of the observed positions.
    pub ln_constant: f64,
}

/// Inner products over the rows of one cycle. Here e is the cycle's whitened column, and p is the whitened response to a unit of process at the beginning of the cycle.
#[derive(Debug, Clone)]
pub struct CycleProducts {
    /// Inner product of the cycle's column e with itself.
    pub unit: f64,
    /// Inner product of the cycle's column e with the response p to the process.
    pub both: f64,
    /// Inner product of the response p to the process with itself.
    pub past: f64,
    /// Inner product of each column of the set with the cycle's column e.
    pub unit_with: Vec<f64>,
    /// Inner product of each column of the set with the response p to the process.
    pub past_with: Vec<f64>,
    /// Process at the cycle's end that remains of the cycle's column.
    pub left: f64,
    /// Fraction of the process at the beginning of the cycle that remains at the cycle's end.
    pub kept: f64,
}

impl CycleProducts {
    /// Reorders the set's columns: entry i of the result is entry `order[i]` of these products.
    pub fn ordered(self, order: &[usize]) -> Self {
        let ordered = |with: &[f64]| order.iter().map(|k| with[*k]).collect();
        Self { unit_with: ordered(&self.unit_with), past_with: ordered(&self.past_with), ..self }
    }
}

/// Request for inner products of columns. The columns form sets, which share the first columns.
pub struct ProductRequest<'a> {
    /// All columns, with one value per row of the record. Columns that all sets share come first.
    pub columns: &'a [&'a [f64]],
    /// Number of columns that all sets share.
    pub n_common: usize,
    /// Index range of the columns that belong to each set alone.
    pub own: &'a [Range<usize>],
    /// Index in `own` of a set that also has a column for each cycle; `None` without such a set.
    pub with_cycles: Option<usize>,
}

impl NoiseLikelihood {
    /// Whitens columns: returns L⁻¹ times each column, where L Lᵀ is the covariance of the observed positions. Thus ‖whiten(r)‖² is the squared Mahalanobis distance of
    /// residuals r. A column has one entry per row of the record. Its result has one entry per observed row.
    ///
    /// L contains the Gaussian terms only. With `student` it is multiplied by √(ν/(ν − 2)). All values are NaN for parameters outside their support.
    pub fn whiten(&self, columns: &[Vec<f64>], position_m: &[f64], parameters: &[f64]) -> Vec<Vec<f64>> {
        match self.whitening(position_m, parameters) {
            Some(whitening) => whitening.whiten(columns),
            None => vec![vec![f64::NAN; self.n_observed()]; columns.len()],
        }
    }

    /// Prepares L⁻¹ for these parameters and any number of columns; `None` for parameters outside their support.
    pub fn whitening(&self, position_m: &[f64], parameters: &[f64]) -> Option<Whitening> {
        let scales = self.model.scales(parameters)?;
        let mut walk = RowFilter::new(&scales, &self.rows.step_s);
        let rows: Vec<RowGain> = self.rows.rows.iter().map(|row| RowGain::of(&mut walk, row, position_m)).collect();
        let largest_m = rows.iter().fold(0.0, |largest: f64, row| largest.max(row.x.abs()));
        Some(Whitening { rows, inverse_sd: inverse_sd(&scales), largest_m })
    }

    /// Inner products of whitened columns, in one pass and without storing the columns; `None` for parameters outside their support.
    pub fn white_products(
        &self,
        asked: &ProductRequest,
        position_m: &[f64],
        parameters: &[f64],
    ) -> Option<WhiteProducts> {
        let scales = self.model.scales(parameters)?;
        let n = asked.columns.len();
        let mut sums = vec![0.0; n * n];
        let members = |set: &Range<usize>| (0..asked.n_common).chain(set.clone());
        let of_cycles: Vec<usize> = asked.with_cycles.map_or(Vec::new(), |set| members(&asked.own[set]).collect());
        let mut cycles = Cycles::new(&scales, of_cycles);
        let ln_det = self.each_block(&scales, asked.columns, position_m, |block| {
            Arch::new().dispatch(Gram { block, asked, sums: &mut sums });
            if asked.with_cycles.is_some() {
                cycles.take(block);
            }
        });
        let set = |range: &Range<usize>| {
            let members: Vec<usize> = members(range).collect();
            let product = |i: usize, j: usize| sums[members[i].max(members[j]) * n + members[i].min(members[j])];
            DMatrix::from_fn(members.len(), members.len(), product)
        };
        let ln_unit = self.n_observed() as f64 * (scales.noise_sd_m.ln() + 0.5 * std::f64::consts::TAU.ln());
        Some(WhiteProducts {
            sets: asked.own.iter().map(set).collect(),
            cycles: cycles.done,
            ln_constant: -ln_unit - 0.5 * ln_det,
        })
    }

    /// Whitens columns block by block and calls `visit` for each block. Returns Σ ln(S/σ²) over the observed rows. Here S is the predictive variance of a position and
    /// σ² the white variance. The sum is the log determinant of the covariance minus the log determinant for white noise alone.
    fn each_block(
        &self,
        scales: &FilterScales,
        columns: &[&[f64]],
        position_m: &[f64],
        mut visit: impl FnMut(&WhiteningBlock),
    ) -> f64 {
        let mut walk = RowFilter::new(scales, &self.rows.step_s);
        let mut determinant = Product::one(Scalar);
        let mut means = vec![[[0.0; LANES]; 3]; columns.len().div_ceil(LANES)];
        let mut white = vec![[0.0; BLOCK]; columns.len()];
        let mut gains = Vec::with_capacity(BLOCK);
        for rows in self.rows.rows.chunks(BLOCK) {
            gains.clear();
            for row in rows {
                let gain = RowGain::of(&mut walk, row, position_m);
                determinant.grow(number(gain.excess));
                gains.push(gain);
            }
            let inverse_sd = inverse_sd(scales);
            sweep(&gains, columns, 0, (&mut white, &mut means), inverse_sd);
            visit(&WhiteningBlock { rows: &gains, white: &white });
        }
        let mut product = Determinant::<1>::ONE;
        determinant.store(&mut product, 0);
        product.ln(0)
    }
}

/// The matrix L⁻¹ of one parameter point, stored as the filter's state at every observed row.
pub struct Whitening {
    rows: Vec<RowGain>,
    inverse_sd: f64,
    /// Largest absolute position (m).
    largest_m: f64,
}

/// Remainder of a column in the filter, as a fraction of the column's size, below which it counts as 0.
const FORGOTTEN: f64 = 1e-14;

impl Whitening {
    /// Returns L⁻¹ times each column, as [`NoiseLikelihood::whiten`] does.
    pub fn whiten(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        self.whiten_from(columns, 0).1
    }

    /// Whitens columns that begin at `first_row` of the record and are 0 before that row and after their end. The first result is the index, among the observed rows,
    /// of the first row at which the whitened columns can differ from 0. The whitened values start there and end where they are 0 to rounding.
    pub fn whiten_from(&self, columns: &[Vec<f64>], first_row: usize) -> (usize, Vec<Vec<f64>>) {
        let slices: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let end_row = first_row + slices.iter().map(|column| column.len()).max().unwrap_or(0);
        let first = self.rows.partition_point(|row| row.row.index < first_row);
        let sizes = slices.iter().flat_map(|column| column.iter()).fold(0.0, |largest: f64, x| largest.max(x.abs()));
        let mut whitened = vec![Vec::new(); columns.len()];
        let mut means = vec![[[0.0; LANES]; 3]; columns.len().div_ceil(LANES)];
        let mut white = vec![[0.0; BLOCK]; columns.len()];
        for rows in self.rows[first..].chunks(SHORT_BLOCK) {
            sweep(rows, &slices, first_row, (&mut white, &mut means), self.inverse_sd);
            whitened.iter_mut().zip(&white).for_each(|(all, block)| all.extend_from_slice(&block[..rows.len()]));
            let is_past = rows.last().is_some_and(|last| last.row.index + 1 >= end_row);
            let remembered = |[process, gain, offset]: &[[f64; LANES]; 3]| {
                let lane = |k: usize| process[k].abs() + self.largest_m * gain[k].abs() + offset[k].abs();
                (0..LANES).map(lane).fold(0.0, f64::max)
            };
            if is_past && means.iter().all(|mean| remembered(mean) <= FORGOTTEN * sizes) {
                break;
            }
        }
        (first, whitened)
    }
}

/// Whitens columns at successive observed rows, eight columns at a time. The columns begin at row `first_row` of the record.
fn sweep(
    rows: &[RowGain],
    columns: &[&[f64]],
    first_row: usize,
    (white, means): (&mut [[f64; BLOCK]], &mut [[[f64; LANES]; 3]]),
    inverse_sd: f64,
) {
    for ((columns, white), means) in columns.chunks(LANES).zip(white.chunks_mut(LANES)).zip(means) {
        Arch::new().dispatch(WhiteningSweep { rows, columns, first_row, white, means, inverse_sd });
    }
}

/// Inverse of the white noise's standard deviation, in 1/m.
fn inverse_sd(scales: &FilterScales) -> f64 {
    1.0 / (scales.noise_sd_m * scales.variance_factor().sqrt())
}

/// Whitening of up to eight columns in one block, with one column per lane.
struct WhiteningSweep<'a> {
    rows: &'a [RowGain],
    columns: &'a [&'a [f64]],
    /// Row of the record at which the columns begin.
    first_row: usize,
    white: &'a mut [[f64; BLOCK]],
    means: &'a mut [[f64; LANES]; 3],
    inverse_sd: f64,
}

impl WithSimd for WhiteningSweep<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let inverse_sd = Register::splat(simd, self.inverse_sd);
        let mut lanes = [0.0; LANES];
        for register in 0..LANES / S::F64_LANES {
            let first = register * S::F64_LANES;
            if first >= self.columns.len() {
                break;
            }
            let mut mean = Mean::<S, true, true>::load(simd, self.means, register);
            for (place, row) in self.rows.iter().enumerate() {
                for (lane, column) in self.columns.iter().enumerate() {
                    lanes[lane] = column.get(row.row.index - self.first_row).copied().unwrap_or(0.0);
                }
                mean.advance(Register::splat(simd, row.decay));
                if row.row.new_cycle {
                    mean.renew();
                }
                let gain = row.gain.splat(simd);
                let innovation = mean.innovation(Register::load(simd, &lanes, register), Register::splat(simd, row.x));
                mean.correct(&gain, innovation * gain.precision);
                let white = innovation * Register::splat(simd, row.root_precision) * inverse_sd;
                let mut whitened = [0.0; LANES];
                white.store(&mut whitened, register);
                for (lane, column) in self.white.iter_mut().enumerate().skip(first).take(S::F64_LANES) {
                    column[place] = whitened[lane];
                }
            }
            mean.store(self.means, register);
        }
    }
}

/// Addition of a block's inner products to `sums`. The product of columns i and j ≤ i is at index i n + j, with n columns.
struct Gram<'a> {
    block: &'a WhiteningBlock<'a>,
    asked: &'a ProductRequest<'a>,
    sums: &'a mut [f64],
}

impl WithSimd for Gram<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let ProductRequest { columns, n_common, own: ranges, .. } = *self.asked;
        let (n, length) = (columns.len(), self.block.rows.len());
        let white = self.block.white;
        for i in 0..n_common {
            for j in 0..=i {
                self.sums[i * n + j] += dot(&white[i][..length], &white[j][..length]);
            }
        }
        for set in ranges {
            for i in set.start..set.end {
                for j in 0..n_common {
                    self.sums[i * n + j] += dot(&white[i][..length], &white[j][..length]);
                }
                for j in set.start..=i {
                    self.sums[i * n + j] += dot(&white[i][..length], &white[j][..length]);
                }
            }
        }
    }
}

/// Inner product of two slices of equal length. It uses eight parallel sums, for which the compiler can use vector registers of any width without changing the result.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let mut sum = 0.0;
    for lane in sums {
        sum += lane;
    }
    for (a, b) in a_rest.iter().zip(b_rest) {
        sum += a * b;
    }
    sum
}

/// State of the cycles' columns (1 in a cycle's rows, 0 elsewhere) during the pass through the rows.
struct Cycles {
    /// Indices of the columns with which the cycles' columns are multiplied.
    members: Vec<usize>,
    inverse_sd: f64,
    unit: Mean<Scalar, true, true>,
    past: Mean<Scalar, true, true>,
    done: Vec<CycleProducts>,
    white: [Vec<f64>; 2],
}

impl Cycles {
    fn new(scales: &FilterScales, members: Vec<usize>) -> Self {
        let mean = Mean::zero(Scalar);
        let white = [Vec::with_capacity(BLOCK), Vec::with_capacity(BLOCK)];
        Self { members, inverse_sd: inverse_sd(scales), unit: mean, past: mean, done: Vec::new(), white }
    }

    fn take(&mut self, block: &WhiteningBlock) {
        let mut first = 0;
        while first < block.rows.len() {
            let begins = |row: &RowGain| row.row.new_cycle;
            let more = block.rows[first + 1..].iter().position(begins);
            let end = more.map_or(block.rows.len(), |more| first + 1 + more);
            if block.rows[first].row.new_cycle {
                self.unit = Mean::zero(Scalar);
                self.past = Mean::of_process(number(1.0));
                let zeros = vec![0.0; self.members.len()];
                let (unit_with, past_with) = (zeros.clone(), zeros);
                let (unit, both, past, left, kept) = (0.0, 0.0, 0.0, 0.0, 0.0);
                self.done.push(CycleProducts { unit, both, past, unit_with, past_with, left, kept });
            }
            self.rows(block, first..end);
            first = end;
        }
    }

    /// Adds the rows `rows` of a block, which belong to the current cycle, to this cycle's products.
    fn rows(&mut self, block: &WhiteningBlock, rows: Range<usize>) {
        let Some(cycle) = self.done.last_mut() else { return };
        let [unit, past] = &mut self.white;
        unit.clear();
        past.clear();
        for row in &block.rows[rows.clone()] {
            let gain = row.gain.splat(Scalar);
            for (mean, value, white) in [(&mut self.unit, 1.0, &mut *unit), (&mut self.past, 0.0, &mut *past)] {
                advance(mean, &row.row, number(row.decay));
                let innovation = mean.innovation(number(value), number(row.x));
                mean.correct(&gain, innovation * gain.precision);
                white.push(innovation.number() * row.root_precision * self.inverse_sd);
            }
        }
        cycle.unit += dot(unit, unit);
        cycle.both += dot(unit, past);
        cycle.past += dot(past, past);
        for (k, member) in self.members.iter().enumerate() {
            let column = &block.column(*member)[rows.clone()];
            cycle.unit_with[k] += dot(unit, column);
            cycle.past_with[k] += dot(past, column);
        }
        (cycle.left, cycle.kept) = (self.unit.process().number(), self.past.process().number());
    }
}

#[cfg(test)]
#[path = "whitening_tests.rs"]
mod tests;
