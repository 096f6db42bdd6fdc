//! Normal equations for the amplitudes of columns. Each cycle may have a column of its own; the cost is linear in the number of cycles.
//!
//! Whitened columns of different cycles overlap only through the noise process, of which one number s passes from each cycle to the next. So the cycles' amplitudes a are
//! eliminated from the last to the first. For a given s at a cycle's start, the optimum over this and all later cycles is ½ K s² − s G. K is a number. G has one entry
//! per column and one for the residuals. The amplitudes and their variances then follow from s, from the first cycle to the last.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use posterior::noise::CycleProducts;

/// Ridge that is added to the diagonal of the normal equations, relative to the squared lengths of the columns. A linear combination of columns that vanishes thus gets no
/// amplitude.
const RIDGE: f64 = 1e-7;

/// Inner products of columns and residuals, whitened by one set of noise parameters.
pub(super) struct Normal {
    /// Inner products of the columns; the last row and column belong to the residuals.
    pub products: DMatrix<f64>,
    /// Inner products of each cycle's own column; empty if cycles have no columns.
    pub cycles: Vec<CycleProducts>,
    /// Marks the cycles that have a column.
    pub has_column: Vec<bool>,
    /// Prior of each of the first columns: 1/sd, and (mean − fit)/sd, with the prior's mean and standard deviation sd.
    pub priors: Vec<(f64, f64)>,
}

/// Best amplitudes of all columns, with their covariance.
pub(super) struct NormalSolution {
    /// Amplitudes of the columns.
    pub amplitudes: DVector<f64>,
    /// Amplitude of each cycle's own column; 0 for cycles without one.
    pub of_cycles: Vec<f64>,
    /// Squared norm of the remaining whitened residuals.
    pub left: f64,
    covariance: DMatrix<f64>,
    steps: Vec<Option<Elimination>>,
    /// Value of the noise process at the end of each cycle: per unit of the cycle's amplitude, and per unit of the process at the cycle's start.
    links: Vec<[f64; 2]>,
}

/// Dependence of the amplitude of a cycle's column on the amplitudes of the other columns.
pub(super) struct CycleAmplitude {
    /// Derivative of the cycle's amplitude with respect to the columns' amplitudes, with the opposite sign.
    following: DVector<f64>,
    /// Variance of the cycle's amplitude if the columns' amplitudes are fixed.
    own_variance: f64,
}

/// Result of eliminating a cycle's amplitude, a = (b·x − c s)/h. Here x are the columns' amplitudes with the opposite sign, followed by 1 for the residuals. The value of
/// the noise process at the cycle's start is s.
struct Elimination {
    h: f64,
    c: f64,
    /// Coefficients of the columns' amplitudes, one per column and, last, one for the residuals.
    b: DVector<f64>,
}

impl Normal {
    /// Solves for all amplitudes; `None` if a number is not finite.
    pub fn solve(&self) -> Option<NormalSolution> {
        let n = self.products.nrows() - 1;
        let steps = self.eliminate();
        let mut reduced = self.products.clone();
        for step in steps.iter().flatten() {
            reduced -= (&step.b * step.b.transpose()) / step.h;
        }
        let mut normal = reduced.view((0, 0), (n, n)).into_owned();
        let mut slope: DVector<f64> = reduced.view((0, n), (n, 1)).column(0).into_owned();
        // The ridge is relative to the columns' own lengths, before any elimination.
        let mut length2: DVector<f64> = self.products.diagonal().rows(0, n).into_owned();
        for (k, (inverse_sd, pull)) in self.priors.iter().enumerate() {
            normal[(k, k)] += inverse_sd * inverse_sd;
            length2[k] += inverse_sd * inverse_sd;
            slope[k] += inverse_sd * pull;
        }
        let scale = length2.map(|length2| length2.max(f64::MIN_POSITIVE).sqrt().recip());
        let scaled =
            DMatrix::from_fn(n, n, |i, j| normal[(i, j)] * scale[i] * scale[j] + if i == j { RIDGE } else { 0.0 });
        let factor: Cholesky<f64, Dyn> = scaled.cholesky()?;
        let amplitudes = factor.solve(&slope.component_mul(&scale)).component_mul(&scale);
        let inverse = factor.inverse();
        let covariance = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
        let mut sizes = -amplitudes.clone();
        sizes = sizes.push(1.0);
        let of_cycles: Vec<f64> = self.amplitudes_of_cycles(&steps, &sizes);
        let left = self.left(&sizes, &of_cycles);
        let links = self.cycles.iter().map(|cycle| [cycle.left, cycle.kept]).collect();
        Some(NormalSolution { amplitudes, of_cycles, left, covariance, steps, links })
    }

    /// Eliminates the amplitudes of the cycles' columns, from the last cycle to the first; `None` for a cycle without a column.
    fn eliminate(&self) -> Vec<Option<Elimination>> {
        let n = self.products.nrows();
        let (mut k, mut g) = (0.0, DVector::zeros(n));
        // Squared norm of the whitened noise process over all later cycles, if it enters them with the value 1. The length of a cycle's column includes this norm.
        let mut seen_later = 0.0;
        let mut steps = Vec::with_capacity(self.cycles.len());
        for (cycle, has_column) in self.cycles.iter().zip(&self.has_column).rev() {
            let CycleProducts { left, kept, .. } = *cycle;
            let (unit_with, past_with) =
                (DVector::from_column_slice(&cycle.unit_with), DVector::from_column_slice(&cycle.past_with));
            let past = past_with + kept * &g;
            let k_past = cycle.past + k * kept * kept;
            let step = has_column.then(|| {
                let length2 = cycle.unit + seen_later * left * left;
                let h = cycle.unit + k * left * left + RIDGE * length2.max(f64::MIN_POSITIVE);
                Elimination { h, c: cycle.both + k * left * kept, b: unit_with + left * &g }
            });
            (k, g) = match &step {
                Some(step) => (k_past - step.c * step.c / step.h, past - &step.b * (step.c / step.h)),
                None => (k_past, past),
            };
            seen_later = cycle.past + seen_later * kept * kept;
            steps.push(step);
        }
        steps.reverse();
        steps
    }

    /// Amplitudes of the cycles' columns. `sizes` has the amplitudes of the other columns with the opposite sign, followed by 1 for the residuals.
    fn amplitudes_of_cycles(&self, steps: &[Option<Elimination>], sizes: &DVector<f64>) -> Vec<f64> {
        let mut s = 0.0;
        let of_cycle = |(cycle, step): (&CycleProducts, &Option<Elimination>)| {
            let a = step.as_ref().map_or(0.0, |step| (step.b.dot(sizes) - step.c * s) / step.h);
            s = cycle.left * a + cycle.kept * s;
            a
        };
        self.cycles.iter().zip(steps).map(of_cycle).collect()
    }

    /// Squared norm of the residuals after subtraction of the columns and the cycles' columns with these amplitudes.
    fn left(&self, sizes: &DVector<f64>, of_cycles: &[f64]) -> f64 {
        let mut left = sizes.dot(&(&self.products * sizes));
        let mut s = 0.0;
        for (cycle, a) in self.cycles.iter().zip(of_cycles) {
            let dot = |with: &[f64]| with.iter().zip(sizes.iter()).map(|(w, size)| w * size).sum::<f64>();
            left += a * a * cycle.unit + 2.0 * a * s * cycle.both + s * s * cycle.past
                - 2.0 * (a * dot(&cycle.unit_with) + s * dot(&cycle.past_with));
            s = cycle.left * a + cycle.kept * s;
        }
        left
    }
}

impl NormalSolution {
    /// Weighted sum of the columns' amplitudes with its standard error.
    pub fn weighted(&self, weights: &DVector<f64>) -> (f64, f64) {
        (weights.dot(&self.amplitudes), weights.dot(&(&self.covariance * weights)).max(0.0).sqrt())
    }

    /// Returns, for every cycle, the dependence of its column's amplitude on the amplitudes of the other columns.
    pub fn in_cycles(&self) -> Vec<CycleAmplitude> {
        let n = self.amplitudes.len();
        let (mut s, mut variance) = (DVector::zeros(n), 0.0);
        let of_cycle = |(step, [left, kept]): (&Option<Elimination>, &[f64; 2])| {
            let in_cycle = match step {
                Some(step) => {
                    let share = step.c / step.h;
                    let own_variance = 1.0 / step.h + share * share * variance;
                    variance = (kept - left * share).powi(2) * variance + left * left / step.h;
                    CycleAmplitude { following: step.b.rows(0, n) / step.h - &s * share, own_variance }
                }
                None => {
                    variance *= kept * kept;
                    CycleAmplitude { following: DVector::zeros(n), own_variance: 0.0 }
                }
            };
            s = *left * &in_cycle.following + *kept * &s;
            in_cycle
        };
        self.steps.iter().zip(&self.links).map(of_cycle).collect()
    }

    /// Returns the weighted sum of [`Self::weighted`] plus the amplitude of cycle `number`, with its standard error.
    pub fn weighted_in_cycle(&self, weights: &DVector<f64>, number: usize, in_cycle: &CycleAmplitude) -> (f64, f64) {
        let net = weights - &in_cycle.following;
        let variance = net.dot(&(&self.covariance * &net)) + in_cycle.own_variance;
        (weights.dot(&self.amplitudes) + self.of_cycles[number], variance.max(0.0).sqrt())
    }
}

#[cfg(test)]
#[path = "normal_tests.rs"]
mod tests;
