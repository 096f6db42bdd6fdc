//! Table that gives the residual sum of squares at a cost independent of the number of rows.
//!
//! The trajectory is x = A u(r) + B g. A is the compliance of a Kelvin–Voigt body, r its rate and u(r) its unit response. B is
//! the fluidity of a dashpot, and g the impulse ∫F dt. The sum of squares depends on the rows only through inner products of
//! u(r), g and the positions y. These are functions of the rate alone and are tabulated once over its range (reduced-order
//! quadrature in time: Canizares et al. 2013, doi:10.1103/PhysRevD.87.124005).
//!
//! To avoid cancellation, all values are relative to the least-squares trajectory A₀ u(r₀) + B₀ g, whose residuals are e. The
//! function k = (u(r) − u(r₀))/(ln r − ln r₀) is smooth. With a = A − A₀, b = B − B₀ and c = A (ln r − ln r₀),
//!
//!   Σ (y − x)² = Σ (e − a u(r₀) − b g − c k)²
//!
//! is a quadratic form whose terms are small near the posterior. The sum is taken over the rows if the terms are much larger than
//! their sum, or if the rate is outside the table.

use pulp::{Arch, Simd, WithSimd};

use super::inner_products::{InnerProducts, Reference};
use super::{CreepLanes, ResidualSumOfSquares};
use base::elementary;

/// Width of one interval of the table in ln r, with r the rate. The inner products are analytic for |Im ln r| < π/2, which is 25 times the
/// half width. Each further coefficient is therefore fifty times smaller.
const PIECE: f64 = 0.125;
/// Number of polynomial coefficients in one interval.
const N_COEFFICIENTS: usize = 8;
/// Number of tabulated functions: the inner products of the scaled response difference k with the residual, k, the reference response and
/// the impulse.
const N_FUNCTIONS: usize = 4;
/// Largest distance of the table's ends from the reference rate, as a difference of the rates' logarithms.
const LONGEST_REACH: f64 = 24.0;
/// Number of rates at which the table is checked against the sums over the rows. These rates are not nodes of the table.
const N_CHECKED: usize = 48;
/// Largest accepted error at the checked rates, relative to the terms of the sum of squares. At the largest cancellation it is
/// 1e-8 of a sum of squares.
const CHECK_TOLERANCE: f64 = 1e-12;
/// Largest ratio of the sum of squares' terms to the sum for which the table is used. An error of 1e-12 of the terms is then 1e-8 of the
/// sum. At larger ratios the sum is taken over the rows.
const LARGEST_CANCELLATION: f64 = 1e4;
/// Number of rates in each round of the search for the least-squares trajectory.
const N_SEARCHED: usize = 64;
/// Number of rounds of the search for the least-squares trajectory.
const N_ROUNDS: usize = 5;
/// Factor by which each later round of the search narrows the range of rates.
const FINER: f64 = 16.0;

/// Polynomial coefficients in an interval's coordinate on [−1, 1]. The row is the power, lowest first, and the column is the
/// tabulated function.
type CoefficientTable = [[f64; N_FUNCTIONS]; N_COEFFICIENTS];

/// Tabulated inner products over a range of rates.
#[derive(Debug, Clone)]
pub(super) struct ProductTable {
    retarded_m_per_n: f64,
    flow_m_per_n_s: f64,
    ln_rate: f64,
    /// Number of intervals below the reference rate.
    n_before: usize,
    pieces: Vec<CoefficientTable>,
    products: Constants,
}

/// Inner products over the compared rows that do not depend on the rate. The factors are the reference trajectory's residuals e, its unit
/// response u₀ and the impulse g = ∫F dt.
#[derive(Debug, Clone, Copy, Default)]
struct Constants {
    /// Inner product e² of the residuals. The other fields are e u₀, e g, u₀², u₀ g and g², in this order.
    residual_2: f64,
    residual_response: f64,
    residual_impulse: f64,
    response_2: f64,
    response_impulse: f64,
    impulse_2: f64,
}

impl ProductTable {
    /// Tabulates a record over a range of ln r, with r the rate. `None` if the record has no least-squares trajectory, or if the table
    /// fails its check.
    pub fn new(record: &ResidualSumOfSquares, ln_rates: (f64, f64)) -> Option<Self> {
        let (lower, upper) = ln_rates;
        if !(lower.is_finite() && upper.is_finite() && lower <= upper) {
            return None;
        }
        let ln_rate = best_ln_rate(record, lower, upper)?;
        let profile = Profile::of_rates(record, &[ln_rate]).pop()?;
        let (retarded, flow) = (profile.retarded_m_per_n, profile.flow_m_per_n_s);
        let (reference, products) = reference(record, ln_rate, retarded, flow);
        let n_pieces = |reach: f64| (reach.clamp(0.0, LONGEST_REACH) / PIECE).ceil() as usize + 1;
        let (n_before, n_after) = (n_pieces(ln_rate - lower), n_pieces(upper - ln_rate));
        let mut table = Self {
            retarded_m_per_n: retarded,
            flow_m_per_n_s: flow,
            ln_rate,
            n_before,
            pieces: Vec::with_capacity(n_before + n_after),
            products,
        };
        table.fill(record, &reference, n_before + n_after);
        table.holds(record, &reference).then_some(table)
    }

    fn centre(&self, piece: usize) -> f64 {
        self.ln_rate + PIECE * (piece as f64 - self.n_before as f64 + 0.5)
    }

    /// Fills the coefficients by interpolation at the Chebyshev nodes of each interval. The reference rate, where the scaled response
    /// difference is 0/0, is an end of an interval and not a node.
    fn fill(&mut self, record: &ResidualSumOfSquares, reference: &Reference, n_pieces: usize) {
        let nodes: [f64; N_COEFFICIENTS] =
            std::array::from_fn(|j| (std::f64::consts::PI * (j as f64 + 0.5) / N_COEFFICIENTS as f64).cos());
        let away = |piece: usize, node: f64| self.centre(piece) + 0.5 * PIECE * node;
        let ln_rates: Vec<f64> = (0..n_pieces).flat_map(|piece| nodes.map(|node| away(piece, node))).collect();
        let values = self.products_with_k(record, reference, &ln_rates);
        for values in values.chunks_exact(N_COEFFICIENTS) {
            let mut piece = CoefficientTable::default();
            for function in 0..N_FUNCTIONS {
                let of_nodes = std::array::from_fn(|j| values[j][function]);
                let monomials = polynomial(&nodes, of_nodes);
                piece.iter_mut().zip(monomials).for_each(|(row, value)| row[function] = value);
            }
            self.pieces.push(piece);
        }
    }

    /// Returns, for each rate, the inner products of the scaled response difference k with the residual, k, the reference response and the
    /// impulse, summed over the rows. k is the response difference divided by the difference of ln rate.
    fn products_with_k(&self, record: &ResidualSumOfSquares, reference: &Reference, ln_rates: &[f64]) -> Vec<[f64; 4]> {
        let rates: Vec<f64> = ln_rates.iter().map(|x| x.exp()).collect();
        let of_rate = |(products, ln_rate): (InnerProducts, &f64)| {
            let inverse = 1.0 / (ln_rate - self.ln_rate);
            let InnerProducts { residual, square, reference, impulse } = products;
            [residual * inverse, square * inverse * inverse, reference * inverse, impulse * inverse]
        };
        record.inner_products(&rates, reference).into_iter().zip(ln_rates).map(of_rate).collect()
    }

    /// Returns `true` if the table agrees with sums over the rows at rates that are spread over its range and are not nodes.
    fn holds(&self, record: &ResidualSumOfSquares, reference: &Reference) -> bool {
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let (first, width) = (self.centre(0) - 0.5 * PIECE, PIECE * self.pieces.len() as f64);
        // Half of the rates cover the whole range, half are around the reference rate.
        let ln_rate = |k: usize| {
            let fraction = ((k as f64 + 0.5) * golden).fract();
            if k.is_multiple_of(2) { first + width * fraction } else { self.ln_rate + 4.0 * PIECE * (fraction - 0.5) }
        };
        let ln_rates: Vec<f64> = (0..N_CHECKED).map(ln_rate).filter(|x| (x - self.ln_rate).abs() > 1e-3).collect();
        let exact = self.products_with_k(record, reference, &ln_rates);
        let p = &self.products;
        // This compliance combines the reference compliance and the compliance that would explain the residuals.
        let retarded = (self.retarded_m_per_n.powi(2) + p.residual_2 / p.response_2).sqrt();
        ln_rates.iter().zip(exact).all(|(ln_rate, exact)| {
            let Some(found) = self.at(*ln_rate) else { return true };
            // Errors are compared with the terms of the quadratic form. For example, the error of c² k² is compared with e² + c²
            // k².
            let c = retarded * (ln_rate - self.ln_rate);
            let k = (exact[1] + p.residual_2 / (c * c)).sqrt();
            let scales = [p.residual_2.sqrt() * k, k * k, p.response_2.sqrt() * k, p.impulse_2.sqrt() * k];
            found.iter().zip(exact).zip(scales).all(|((a, b), scale)| (a - b).abs() <= CHECK_TOLERANCE * scale)
        })
    }

    /// Returns the tabulated inner products at one rate; `None` outside the table.
    #[inline(always)]
    fn at(&self, ln_rate: f64) -> Option<[f64; N_FUNCTIONS]> {
        let position = (ln_rate - self.ln_rate) * (1.0 / PIECE) + self.n_before as f64;
        if !(position >= 0.0 && position < self.pieces.len() as f64) {
            return None;
        }
        let index = position as usize;
        let t = 2.0 * (position - index as f64) - 1.0;
        let piece = &self.pieces[index];
        let mut sums = piece[N_COEFFICIENTS - 1];
        for coefficients in piece[..N_COEFFICIENTS - 1].iter().rev() {
            for function in 0..N_FUNCTIONS {
                sums[function] = sums[function].mul_add(t, coefficients[function]);
            }
        }
        Some(sums)
    }

    /// Writes the residual sum of squares (m²) of every point, or NaN if the sum must be taken over the rows.
    pub fn evaluate(&self, lanes: CreepLanes, sum_m2: &mut [f64]) {
        sum_m2.copy_from_slice(lanes.rate_per_s);
        elementary::ln_all(sum_m2);
        Arch::new().dispatch(Evaluation { table: self, lanes, sum_m2 });
    }

    #[inline(always)]
    fn sum_m2(&self, retarded: f64, flow: f64, ln_rate: f64) -> f64 {
        let Some([residual_k, k_2, response_k, impulse_k]) = self.at(ln_rate) else { return f64::NAN };
        let p = &self.products;
        let (a, b) = (retarded - self.retarded_m_per_n, flow - self.flow_m_per_n_s);
        let c = retarded * (ln_rate - self.ln_rate);
        let squares = [p.residual_2, a * a * p.response_2, b * b * p.impulse_2, c * c * k_2];
        let with_residual = a * p.residual_response + b * p.residual_impulse + c * residual_k;
        let mixed = a * b * p.response_impulse + a * c * response_k + b * c * impulse_k;
        let total = (squares[0] + squares[1]) + (squares[2] + squares[3]);
        let sum = total + 2.0 * (mixed - with_residual);
        if total <= LARGEST_CANCELLATION * sum { sum } else { f64::NAN }
    }
}

struct Evaluation<'a> {
    table: &'a ProductTable,
    lanes: CreepLanes<'a>,
    sum_m2: &'a mut [f64],
}

impl WithSimd for Evaluation<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { table, lanes, sum_m2 } = self;
        for ((value, retarded), flow) in sum_m2.iter_mut().zip(lanes.retarded_m_per_n).zip(lanes.flow_m_per_n_s) {
            *value = table.sum_m2(*retarded, *flow, *value);
        }
    }
}

/// Returns the coefficients of 1, t, t², … of the polynomial through `values` at `nodes`. It expands Newton's divided
/// differences.
fn polynomial(nodes: &[f64; N_COEFFICIENTS], mut values: [f64; N_COEFFICIENTS]) -> [f64; N_COEFFICIENTS] {
    for order in 1..N_COEFFICIENTS {
        for j in (order..N_COEFFICIENTS).rev() {
            values[j] = (values[j] - values[j - 1]) / (nodes[j] - nodes[j - order]);
        }
    }
    let mut monomials = [0.0; N_COEFFICIENTS];
    for j in (0..N_COEFFICIENTS).rev() {
        for power in (1..N_COEFFICIENTS).rev() {
            monomials[power] = monomials[power - 1] - nodes[j] * monomials[power];
        }
        monomials[0] = values[j] - nodes[j] * monomials[0];
    }
    monomials
}

/// Least-squares trajectory of the record at a given rate.
struct Profile {
    retarded_m_per_n: f64,
    flow_m_per_n_s: f64,
    /// Decrease of the sum of squares by the least-squares trajectory, in m².
    explained_m2: f64,
}

impl Profile {
    fn of_rates(record: &ResidualSumOfSquares, ln_rates: &[f64]) -> Vec<Self> {
        let rates: Vec<f64> = ln_rates.iter().map(|x| x.exp()).collect();
        let n_rows = record.observed_m.len();
        let position_m: Vec<f64> = record.observed_m.iter().map(|y| if y.is_nan() { 0.0 } else { *y }).collect();
        let nothing = Reference { response_n: vec![0.0; n_rows], residual_m: position_m };
        let pairs = || record.observed_m.iter().zip(&record.impulse_n_s).filter(|(y, _)| !y.is_nan());
        let impulse_2: f64 = pairs().map(|(_, g)| g * g).sum();
        let impulse_position: f64 = pairs().map(|(y, g)| y * g).sum();
        let of_rate = |products: InnerProducts| {
            let InnerProducts { residual: position, square, impulse, .. } = products;
            let determinant = square * impulse_2 - impulse * impulse;
            let (retarded_m_per_n, flow_m_per_n_s) = if determinant > 1e-10 * square * impulse_2 {
                (
                    (position * impulse_2 - impulse_position * impulse) / determinant,
                    (impulse_position * square - position * impulse) / determinant,
                )
            } else if square > 0.0 {
                (position / square, 0.0)
            } else {
                (0.0, 0.0)
            };
            let explained_m2 = retarded_m_per_n * position + flow_m_per_n_s * impulse_position;
            Self { retarded_m_per_n, flow_m_per_n_s, explained_m2 }
        };
        record.inner_products(&rates, &nothing).into_iter().map(of_rate).collect()
    }
}

/// Returns the logarithm of the rate (1/s) of the least-squares trajectory, by a search in rounds that narrow the range. `None` if no
/// trajectory is finite.
fn best_ln_rate(record: &ResidualSumOfSquares, lower: f64, upper: f64) -> Option<f64> {
    let (mut first, mut width) = (lower, upper - lower);
    let mut best = None;
    for _ in 0..N_ROUNDS {
        let ln_rate = |i: usize| first + width * (i as f64 + 0.5) / N_SEARCHED as f64;
        let ln_rates: Vec<f64> = (0..N_SEARCHED).map(ln_rate).collect();
        let profiles = Profile::of_rates(record, &ln_rates);
        let explained = |i: &usize| profiles[*i].explained_m2;
        let place = (0..N_SEARCHED)
            .filter(|i| explained(i).is_finite())
            .max_by(|i, j| explained(i).total_cmp(&explained(j)))?;
        let found = ln_rates[place];
        best = Some(found);
        width /= FINER;
        first = found - 0.5 * width;
    }
    best
}

/// Returns the reference trajectory's unit response and residuals, and the inner products that do not depend on the rate.
fn reference(record: &ResidualSumOfSquares, ln_rate: f64, retarded: f64, flow: f64) -> (Reference, Constants) {
    let response_n = record.response_n(ln_rate.exp());
    let mut products = Constants::default();
    let rows = record.observed_m.iter().zip(&response_n).zip(&record.impulse_n_s);
    let residual_m = rows
        .map(|((y, u), g)| {
            if y.is_nan() {
                return 0.0;
            }
            let e = y - retarded * u - flow * g;
            products.residual_2 += e * e;
            products.residual_response += e * u;
            products.residual_impulse += e * g;
            products.response_2 += u * u;
            products.response_impulse += u * g;
            products.impulse_2 += g * g;
            e
        })
        .collect();
    (Reference { response_n, residual_m }, products)
}
