//! Normal equations of columns, among them one for each cycle, at a cost linear in the cycles.
//!
//! Whitened columns of cycles overlap through the process alone, which links each cycle to the next by one number s. So the amplitudes a of cycles are
//! eliminated from the last to the first: given s, what is best in a cycle and all later ones is a quadratic in s, ½ K s² − s G with one G a column. On the
//! way back the amplitudes follow from s, and so do their variances.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use posterior::noise::CycleProducts;

/// What is added to the normal equations of columns of unit length: directions that the model or other columns hold already get no amplitude.
const RIDGE: f64 = 1e-7;

/// Inner products under one noise; the residuals' are last.
pub(super) struct Normal {
    /// Of columns and residuals.
    pub products: DMatrix<f64>,
    /// Of cycles' columns; empty where there are none.
    pub cycles: Vec<CycleProducts>,
    /// Whether a cycle has a column.
    pub has_column: Vec<bool>,
    /// 1/sd and distance to the mean over sd of the first columns' priors.
    pub priors: Vec<(f64, f64)>,
}

/// Amplitudes with their covariance.
pub(super) struct Solved {
    /// Of the columns.
    pub amplitudes: DVector<f64>,
    /// Of cycles' columns, those of cycles without one 0.
    pub of_cycles: Vec<f64>,
    /// Squared norm of what is left of the whitened residuals.
    pub left: f64,
    covariance: DMatrix<f64>,
    steps: Vec<Option<Elimination>>,
    /// The process that leaves each cycle for a unit of its column, and of the process that came in.
    links: Vec<[f64; 2]>,
}

/// A cycle's amplitude beside the columns' ones.
pub(super) struct InCycle {
    /// How it follows those, with the sign turned.
    following: DVector<f64>,
    /// Its variance where those have none.
    own_variance: f64,
}

/// A cycle's amplitude a = (b − c s)/h given the columns' sizes and the process s that comes in.
struct Elimination {
    h: f64,
    c: f64,
    /// b of each column and, last, of the residuals.
    b: DVector<f64>,
}

impl Normal {
    /// Solves for all amplitudes; `None` for numbers that are not finite.
    pub fn solve(&self) -> Option<Solved> {
        let n = self.products.nrows() - 1;
        let steps = self.eliminate();
        let mut reduced = self.products.clone();
        for step in steps.iter().flatten() {
            reduced -= (&step.b * step.b.transpose()) / step.h;
        }
        let mut normal = reduced.view((0, 0), (n, n)).into_owned();
        let mut slope: DVector<f64> = reduced.view((0, n), (n, 1)).column(0).into_owned();
        // The ridge is of the columns' own lengths, before anything is eliminated.
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
        Some(Solved { amplitudes, of_cycles, left, covariance, steps, links })
    }

    /// From the last cycle to the first; `None` for a cycle without a column.
    fn eliminate(&self) -> Vec<Option<Elimination>> {
        let n = self.products.nrows();
        let (mut k, mut g) = (0.0, DVector::zeros(n));
        // Squared norm of what later cycles see of a unit of process: a column's length has it, too.
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

    /// Amplitudes of cycles where columns and residuals have these sizes.
    fn amplitudes_of_cycles(&self, steps: &[Option<Elimination>], sizes: &DVector<f64>) -> Vec<f64> {
        let mut s = 0.0;
        let of_cycle = |(cycle, step): (&CycleProducts, &Option<Elimination>)| {
            let a = step.as_ref().map_or(0.0, |step| (step.b.dot(sizes) - step.c * s) / step.h);
            s = cycle.left * a + cycle.kept * s;
            a
        };
        self.cycles.iter().zip(steps).map(of_cycle).collect()
    }

    /// Squared norm of what residuals less columns of these sizes, and less those of cycles, leave.
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

impl Solved {
    /// Weighted sum of the columns' amplitudes with its standard error.
    pub fn weighted(&self, weights: &DVector<f64>) -> (f64, f64) {
        (weights.dot(&self.amplitudes), weights.dot(&(&self.covariance * weights)).max(0.0).sqrt())
    }

    /// How the amplitudes of all cycles hang on those of the columns.
    pub fn in_cycles(&self) -> Vec<InCycle> {
        let n = self.amplitudes.len();
        let (mut s, mut variance) = (DVector::zeros(n), 0.0);
        let of_cycle = |(step, [left, kept]): (&Option<Elimination>, &[f64; 2])| {
            let in_cycle = match step {
                Some(step) => {
                    let share = step.c / step.h;
                    let own_variance = 1.0 / step.h + share * share * variance;
                    variance = (kept - left * share).powi(2) * variance + left * left / step.h;
                    InCycle { following: step.b.rows(0, n) / step.h - &s * share, own_variance }
                }
                None => {
                    variance *= kept * kept;
                    InCycle { following: DVector::zeros(n), own_variance: 0.0 }
                }
            };
            s = *left * &in_cycle.following + *kept * &s;
            in_cycle
        };
        self.steps.iter().zip(&self.links).map(of_cycle).collect()
    }

    /// As [`Solved::weighted`], with the amplitude of cycle `number` added.
    pub fn weighted_in_cycle(&self, weights: &DVector<f64>, number: usize, in_cycle: &InCycle) -> (f64, f64) {
        let net = weights - &in_cycle.following;
        let variance = net.dot(&(&self.covariance * &net)) + in_cycle.own_variance;
        (weights.dot(&self.amplitudes) + self.of_cycles[number], variance.max(0.0).sqrt())
    }
}

#[cfg(test)]
#[path = "normal_tests.rs"]
mod tests;
