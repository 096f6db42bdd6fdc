//! Residual sum of squares of many parameter points at once, with one point in each vector lane. This is the innermost loop of
//! sampling.

mod inner_products;
mod table;

use pulp::{Arch, Simd, WithSimd};

use table::ProductTable;

/// Number of points in one pass. It is a multiple of every register width, so that one code path serves all points.
const LANES: usize = 16;

/// Largest difference of steps that count as equal, as a fraction of the record's length. Decimal times such as 0.05 i are not
/// equally spaced in binary, and every distinct step length costs an exponential.
const EQUAL_STEP_TOLERANCE: f64 = 1e-13;

/// Record prepared for Σ (yᵢ − xᵢ)² over the compared rows, with yᵢ the measured and xᵢ the predicted position. The law is one
/// Kelvin–Voigt body in series with a dashpot.
#[derive(Debug, Clone)]
pub struct ResidualSumOfSquares {
    /// Distinct step lengths in s.
    step_s: Vec<f64>,
    holds: Vec<Hold>,
    /// Impulse ∫F dt up to each row, in N·s.
    impulse_n_s: Vec<f64>,
    /// Observed position of each row in m; NaN for rows that are not compared.
    observed_m: Vec<f64>,
    n_observed: usize,
    /// Table that replaces the sums over rows in a range of rates; `None` without such a table.
    table: Option<ProductTable>,
}

/// Number of the latest distinct step lengths that are searched for an equal one. A record with more distinct lengths has hardly
/// any equal steps.
const N_SEARCHED: usize = 64;

/// Consecutive rows at the ends of equal steps under one constant force.
#[derive(Debug, Clone)]
struct Hold {
    step: usize,
    force_n: f64,
    rows: std::ops::Range<usize>,
}

/// Parameters of the law for a batch of parameter points, with one entry for each point.
#[derive(Debug, Clone, Copy)]
pub struct CreepLanes<'a> {
    /// Displacement of the Kelvin–Voigt body per force, in m/N.
    pub retarded_m_per_n: &'a [f64],
    /// Rate of the Kelvin–Voigt body, which is 1 divided by its retardation time, in 1/s.
    pub rate_per_s: &'a [f64],
    /// Velocity of the dashpot per force, in m/(N·s).
    pub flow_m_per_n_s: &'a [f64],
}

impl ResidualSumOfSquares {
    /// Prepares a record of times (s), commanded forces (N) and measured positions (m), with one entry for each row. A position
    /// is `None` if the row is not compared. Rows after the last compared one are dropped.
    pub fn new(time_s: &[f64], force_n: &[f64], observed_m: &[Option<f64>]) -> Self {
        let n_rows = observed_m.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
        let tolerance_s = EQUAL_STEP_TOLERANCE * time_s.last().map_or(0.0, |t| t.abs());
        let (mut step_s, mut holds, mut impulse_n_s) =
            (Vec::<f64>::new(), Vec::<Hold>::new(), vec![0.0; n_rows.max(1)]);
        for row in 1..n_rows {
            let (length_s, force) = (time_s[row] - time_s[row - 1], force_n[row - 1]);
            impulse_n_s[row] = impulse_n_s[row - 1] + force * length_s;
            let from = step_s.len().saturating_sub(N_SEARCHED);
            let known = step_s[from..].iter().position(|s| (s - length_s).abs() <= tolerance_s);
            let step = known.map(|position| from + position).unwrap_or_else(|| {
                step_s.push(length_s);
                step_s.len() - 1
            });
            match holds.last_mut() {
                Some(hold) if hold.step == step && hold.force_n == force => hold.rows.end = row + 1,
                _ => holds.push(Hold { step, force_n: force, rows: row..row + 1 }),
            }
        }
        let observed_m: Vec<f64> = observed_m[..n_rows].iter().map(|y| y.unwrap_or(f64::NAN)).collect();
        let n_observed = observed_m.iter().filter(|y| !y.is_nan()).count();
        Self { step_s, holds, impulse_n_s, observed_m, n_observed, table: None }
    }

    /// Adds a table for rates whose logarithm ln(rate·s) is in `ln_rates`. Within this range, the cost of a point does not depend on the
    /// number of rows. No table is added if it would be less accurate than the sum over rows.
    pub fn tabulated(mut self, ln_rates: (f64, f64)) -> Self {
        self.table = ProductTable::new(&self, ln_rates);
        self
    }

    /// Number of compared positions.
    pub fn n_observed(&self) -> usize {
        self.n_observed
    }

    /// Writes the residual sum of squares (m²) of every point to `sum_m2`, from the table or from a pass over the rows.
    pub fn evaluate(&self, lanes: CreepLanes, sum_m2: &mut [f64]) {
        let Some(table) = &self.table else { return self.sum_rows(lanes, sum_m2) };
        table.evaluate(lanes, sum_m2);
        let left: Vec<usize> = (0..sum_m2.len()).filter(|i| sum_m2[*i].is_nan()).collect();
        if left.is_empty() {
            return;
        }
        let of_left = |values: &[f64]| left.iter().map(|i| values[*i]).collect::<Vec<f64>>();
        let (retarded, rate, flow) =
            (of_left(lanes.retarded_m_per_n), of_left(lanes.rate_per_s), of_left(lanes.flow_m_per_n_s));
        let lanes = CreepLanes { retarded_m_per_n: &retarded, rate_per_s: &rate, flow_m_per_n_s: &flow };
        let mut sums = vec![0.0; left.len()];
        self.sum_rows(lanes, &mut sums);
        left.into_iter().zip(sums).for_each(|(i, sum)| sum_m2[i] = sum);
    }

    /// Writes the residual sum of squares (m²) of every point to `sum_m2`, from a pass over all rows.
    pub fn sum_rows(&self, lanes: CreepLanes, sum_m2: &mut [f64]) {
        let mut scratch = Scratch::new(self.step_s.len());
        for (index, chunk) in sum_m2.chunks_mut(LANES).enumerate() {
            scratch.load(&self.step_s, lanes, index * LANES, chunk.len());
            Arch::new().dispatch(SumPass { record: self, scratch: &mut scratch });
            chunk.copy_from_slice(&scratch.sum[..chunk.len()]);
        }
    }

    /// Contribution (m²) of the first row to the sum. The predicted position is 0 there by definition.
    fn first_row_m2(&self) -> f64 {
        self.observed_m.first().filter(|y| !y.is_nan()).map_or(0.0, |y| y * y)
    }
}

type Lanes = [f64; LANES];

/// Parameters and sums of the parameter points in one pass. Unused lanes repeat the last point.
struct Scratch {
    decay: Vec<Lanes>,
    retarded: Lanes,
    flow: Lanes,
    sum: Lanes,
}

impl Scratch {
    fn new(n_steps: usize) -> Self {
        Self { decay: vec![[0.0; LANES]; n_steps], retarded: [0.0; LANES], flow: [0.0; LANES], sum: [0.0; LANES] }
    }

    fn load(&mut self, step_s: &[f64], lanes: CreepLanes, start: usize, count: usize) {
        for lane in 0..LANES {
            let point = start + lane.min(count - 1);
            self.retarded[lane] = lanes.retarded_m_per_n[point];
            self.flow[lane] = lanes.flow_m_per_n_s[point];
        }
        for (decay, step) in self.decay.iter_mut().zip(step_s) {
            for (decay, rate) in decay.iter_mut().zip(&lanes.rate_per_s[start..start + count]) {
                *decay = (-step * rate).exp();
            }
            let last = decay[count - 1];
            decay[count..].fill(last);
        }
    }
}

struct SumPass<'a> {
    record: &'a ResidualSumOfSquares,
    scratch: &'a mut Scratch,
}

impl WithSimd for SumPass<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Scratch { decay, retarded, flow, sum } = self.scratch;
        let (retarded, _) = S::as_simd_f64s(&retarded[..]);
        let (flow, _) = S::as_simd_f64s(&flow[..]);
        let (sum, _) = S::as_mut_simd_f64s(&mut sum[..]);
        let first = simd.splat_f64s(self.record.first_row_m2());
        let one = simd.splat_f64s(1.0);
        // Two registers in each iteration hide the latency of the recursion.
        for pair in (0..sum.len()).step_by(2) {
            let mut state = [simd.splat_f64s(0.0); 2];
            let mut total = [first; 2];
            for hold in &self.record.holds {
                let (a, _) = S::as_simd_f64s(&decay[hold.step][..]);
                let a = [a[pair], a[pair + 1]];
                let force = simd.splat_f64s(hold.force_n);
                // A closure would be compiled as a separate function without vector instructions.
                let mut gain = [one; 2];
                for k in 0..2 {
                    gain[k] = simd.mul_f64s(simd.mul_f64s(retarded[pair + k], force), simd.sub_f64s(one, a[k]));
                }
                let rows =
                    self.record.observed_m[hold.rows.clone()].iter().zip(&self.record.impulse_n_s[hold.rows.clone()]);
                for (&observed, &impulse) in rows {
                    for k in 0..2 {
                        state[k] = simd.mul_add_e_f64s(state[k], a[k], gain[k]);
                    }
                    if !observed.is_nan() {
                        let (observed, impulse) = (simd.splat_f64s(observed), simd.splat_f64s(impulse));
                        for k in 0..2 {
                            let model = simd.mul_add_e_f64s(flow[pair + k], impulse, state[k]);
                            let residual = simd.sub_f64s(observed, model);
                            total[k] = simd.mul_add_e_f64s(residual, residual, total[k]);
                        }
                    }
                }
            }
            sum[pair] = total[0];
            sum[pair + 1] = total[1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::convolve_m;
    use laws::rheology::CreepCompliance;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Checks irregular steps, missing positions and batch sizes that do not fill the lanes. Results equal the plain recursion
    /// and do not depend on the batch.
    #[test]
    fn equals_the_plain_recursion_for_any_batch() {
        let n = 137;
        let time_s: Vec<f64> =
            (0..n).map(|i| 0.05 * i as f64 + if i > 60 { 0.02 * (i % 3) as f64 } else { 0.0 }).collect();
        let force_n: Vec<f64> = (0..n).map(|i| if (i / 20) % 2 == 0 { 4.6e-6 } else { -4.6e-6 }).collect();
        let observed: Vec<Option<f64>> =
            (0..n).map(|i| (i % 7 != 3 && i < 120).then(|| 1e-4 * (i as f64 * 0.1).sin())).collect();
        let record = ResidualSumOfSquares::new(&time_s, &force_n, &observed);
        let points: Vec<[f64; 3]> =
            (0..37).map(|i| [3.0 + 0.1 * i as f64, 1.0 + 0.05 * i as f64, 40.0 + i as f64]).collect();
        let column = |f: fn(&[f64; 3]) -> f64| points.iter().map(f).collect::<Vec<f64>>();
        let (a, r, f) = (column(|p| 549.0 / p[0]), column(|p| p[0] / p[1]), column(|p| 549.0 / p[2]));
        let lanes = CreepLanes { retarded_m_per_n: &a, rate_per_s: &r, flow_m_per_n_s: &f };
        let mut sums = vec![0.0; points.len()];
        record.evaluate(lanes, &mut sums);
        for (i, p) in points.iter().enumerate() {
            let x = convolve_m(549.0, &CreepCompliance::lethersich(p), &time_s, &force_n);
            let plain: f64 = x.iter().zip(&observed).filter_map(|(x, y)| y.map(|y| (y - x).powi(2))).sum();
            assert!((sums[i] / plain - 1.0).abs() < 1e-11, "{} against {plain}", sums[i]);
            let mut alone = [0.0];
            let one = CreepLanes { retarded_m_per_n: &a[i..=i], rate_per_s: &r[i..=i], flow_m_per_n_s: &f[i..=i] };
            record.evaluate(one, &mut alone);
            assert_eq!(alone[0].to_bits(), sums[i].to_bits());
        }
    }

    /// Returns a record of `n` rows under an alternating force, with noise of 4 µm and missing positions. Its times are equally
    /// spaced unless `irregular`.
    fn noisy_record(n: usize, irregular: bool) -> ResidualSumOfSquares {
        let step_s = 40.0 / n as f64;
        let jitter = |i: usize| if irregular { 0.3 * step_s * ((i * 7919) % 13) as f64 / 13.0 } else { 0.0 };
        let time_s: Vec<f64> = (0..n).map(|i| step_s * i as f64 + jitter(i)).collect();
        let force_n: Vec<f64> =
            time_s.iter().map(|t| if ((t / 5.0) as u32).is_multiple_of(2) { 4.6e-6 } else { -4.6e-6 }).collect();
        let x = convolve_m(549.0, &CreepCompliance::lethersich(&TRUTH), &time_s, &force_n);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut noise = || -> f64 { rng.sample(StandardNormal) };
        let observed: Vec<Option<f64>> =
            x.iter().enumerate().map(|(i, x)| (i % 11 != 4).then_some(x + NOISE_M * noise())).collect();
        ResidualSumOfSquares::new(&time_s, &force_n, &observed)
    }

    /// Parameters E (Pa), c₁ and c₂ (Pa s) of the simulated records.
    const TRUTH: [f64; 3] = [3.527, 1.402, 47.37];
    const NOISE_M: f64 = 4e-6;

    /// Returns pairs of sums of squares from the table and from the rows, and the number of points outside the table. Each
    /// parameter of a point is exp(size·u) times the truth, with u between −1 and 1.
    fn sums_around_the_truth(record: &ResidualSumOfSquares, size: f64, n_points: usize) -> (Vec<(f64, f64)>, usize) {
        let golden = [0.618_033_988_75, 0.754_877_666_25, 0.569_840_290_99];
        let of = |i: usize, d: usize| TRUTH[d] * (size * (2.0 * (golden[d] * (i + 1) as f64).fract() - 1.0)).exp();
        let column = |f: &dyn Fn(usize) -> f64| (0..n_points).map(f).collect::<Vec<f64>>();
        let a = column(&|i| 549.0 / of(i, 0));
        let r = column(&|i| of(i, 0) / of(i, 1));
        let f = column(&|i| 549.0 / of(i, 2));
        let lanes = CreepLanes { retarded_m_per_n: &a, rate_per_s: &r, flow_m_per_n_s: &f };
        let (mut by_table, mut by_rows, mut untouched) =
            (vec![0.0; n_points], vec![0.0; n_points], vec![0.0; n_points]);
        record.evaluate(lanes, &mut by_table);
        record.sum_rows(lanes, &mut by_rows);
        record.table.as_ref().expect("a table").evaluate(lanes, &mut untouched);
        let n_left = untouched.iter().filter(|sum| sum.is_nan()).count();
        (by_table.into_iter().zip(by_rows).collect(), n_left)
    }

    /// Checks the table at points that were not used for building it, from inside the posterior to e⁶ times beyond the priors.
    /// Sums of squares agree to 1e-8. Inside the posterior, log likelihoods agree to 1e-6 nats with 300 and with 200,000 rows.
    /// The table covers most of the points.
    #[test]
    fn the_table_is_as_good_as_the_rows() {
        for (n, irregular) in [(300, false), (301, true), (200_000, false)] {
            let record = noisy_record(n, irregular).tabulated((-9.0, 11.0));
            assert!(record.table.is_some(), "{n} rows");
            let near = 6.0 / (n as f64).sqrt() * 0.01;
            for (size, most_left) in [(near, 0), (0.3, 0), (2.0, 20), (6.0, 200)] {
                let (sums, n_left) = sums_around_the_truth(&record, size, 500);
                assert!(n_left <= most_left, "{n} rows, size {size}: {n_left}");
                for (ours, exact) in sums {
                    assert!((ours / exact - 1.0).abs() < 1e-8, "{n} rows, size {size}: {ours} against {exact}");
                    let nats = 0.5 * (ours - exact).abs() / (NOISE_M * NOISE_M);
                    assert!(size > near || nats < 1e-6, "{n} rows: {nats} nats");
                }
            }
        }
    }

    /// Checks that a record without motion is summed over its rows, and that an invalid range gives no table.
    #[test]
    fn a_record_without_motion_is_summed() {
        let observed = [Some(1e-6); 12];
        let time_s: Vec<f64> = (0..12).map(f64::from).collect();
        let record = ResidualSumOfSquares::new(&time_s, &[0.0; 12], &observed).tabulated((-3.0, 3.0));
        let (one, mut sum) = ([1.0], [0.0]);
        record.evaluate(CreepLanes { retarded_m_per_n: &one, rate_per_s: &one, flow_m_per_n_s: &one }, &mut sum);
        assert!((sum[0] / 12e-12 - 1.0).abs() < 1e-12);
        assert!(noisy_record(300, false).tabulated((f64::NAN, 1.0)).table.is_none());
    }

    /// Checks a record of ten thousand steps with different lengths against the plain recursion.
    #[test]
    fn irregular_records_equal_the_plain_recursion() {
        let record = noisy_record(10_000, true);
        let (sums, _) = sums_around_the_truth(&record.clone().tabulated((-2.0, 4.0)), 0.1, 16);
        assert!(sums.iter().all(|(ours, exact)| (ours / exact - 1.0).abs() < 1e-9));
    }
}
