//! Fit of a simple law, which takes milliseconds and serves to check a record against its description. The law has a retarded motion, a flow and an offset. It is
//! linear in all parameters except one rate.
//!
//! The fit estimates no parameter for later use. It shows the size and direction of the motion, and the influence of the force between rows.

use nalgebra::{Matrix3, Vector3};

use record::noise::SD_PER_MAD;
use record::{Force, ForceRule, Record};

/// Largest number of rows in the fit. More rows would not help to check the description.
const MOST_ROWS: usize = 20_000;
/// Number of rates that are tried, from a third of the record's length to three per row.
const N_RATES: usize = 24;
/// Largest residual, in robust standard deviations, of a position that the second pass of the fit uses.
const FAR: f64 = 4.0;

/// Result of the quick fit of a simple law (retarded motion, flow and offset) to a record.
#[derive(Debug, Clone, PartialEq)]
pub struct QuickFit {
    /// Fitted motion at every row of the fit, in m, without the offset.
    pub motion_m: Vec<f64>,
    /// Fitted constant offset of the positions, in m.
    pub offset_m: f64,
    /// Rate of the retarded motion, in 1/s.
    pub rate_per_s: f64,
    /// Largest retarded displacement, in m.
    pub retarded_m: f64,
    /// Robust standard deviation of the residuals, in m.
    pub left_sd_m: f64,
    /// Fraction of the positions' variance that the law explains.
    pub explained: f64,
    /// Retarded displacement per force (m/N), and flow per impulse (m/(N·s)).
    pub compliance: [f64; 2],
}

/// Retarded force (N) and impulse of the force (N·s) just before the time of every row. Multiplied by compliances, they give the retarded motion and the flow.
fn parts(record: &Record, rule: ForceRule, rate_per_s: f64, n_rows: usize) -> Vec<[f64; 2]> {
    let force = Force { at_rows_n: &record.force_n, rule };
    let (mut retarded, mut flow) = (0.0, 0.0);
    let mut parts = Vec::with_capacity(n_rows);
    for row in 0..n_rows {
        parts.push([retarded, flow]);
        let Some(next_s) = record.time_s.get(row + 1) else { break };
        let dt_s = next_s - record.time_s[row];
        let slope = force.slope_n_per_s(&record.time_s, row);
        let (from_n, to_n) = (record.force_n[row], record.force_n[row] + slope * dt_s);
        // This solves u' = r (F − u) exactly for the retarded force u. The force F is linear between rows, and r is the rate.
        let lag_n = slope / rate_per_s;
        retarded = to_n - lag_n + (retarded - from_n + lag_n) * (-rate_per_s * dt_s).exp();
        flow += force.impulse_n_s(&record.time_s, row);
    }
    parts
}

/// Median of the values; `None` without values. For an even number of values, the result is the larger of the two middle values.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Number of rows that the quick fit uses, from the start of the record.
pub fn n_quick_rows(record: &Record) -> usize {
    record.n_rows().min(MOST_ROWS)
}

/// Fits the simple law under a force rule; `None` if there are too few positions or no motion.
pub fn quick_fit(record: &Record, rule: ForceRule) -> Option<QuickFit> {
    let n_rows = n_quick_rows(record);
    let rows: Vec<(usize, f64)> = (0..n_rows).filter_map(|row| Some((row, record.position_m[row]?))).collect();
    let duration_s = record.time_s[n_rows - 1] - record.time_s[0];
    let interval_s = record.median_interval_s()?;
    if rows.len() < 8 || duration_s <= 0.0 {
        return None;
    }
    let mean_m = rows.iter().map(|(_, x)| x).sum::<f64>() / rows.len() as f64;
    let variance = rows.iter().map(|(_, x)| (x - mean_m).powi(2)).sum::<f64>() / rows.len() as f64;
    if variance == 0.0 {
        return None;
    }
    let (slowest, fastest) = (3.0 / duration_s, 3.0 / interval_s);
    let rate = |k: usize| slowest * f64::powf(fastest / slowest, k as f64 / (N_RATES - 1) as f64);
    let fits = (0..N_RATES).filter_map(|k| fit_at(record, rule, rate(k), &rows, n_rows, variance));
    fits.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, fit)| fit)
}

/// Fits the law at one rate. Also returns the sum of squared residuals (m²), in which large residuals are limited to [`FAR`] standard deviations.
fn fit_at(
    record: &Record,
    rule: ForceRule,
    rate_per_s: f64,
    rows: &[(usize, f64)],
    n_rows: usize,
    variance: f64,
) -> Option<(f64, QuickFit)> {
    let parts = parts(record, rule, rate_per_s, n_rows);
    let size = |k: usize| parts.iter().map(|part| part[k].abs()).fold(0.0, f64::max);
    let sizes = [size(0), size(1)];
    if sizes.contains(&0.0) {
        return None;
    }
    let column = |row: usize| Vector3::new(parts[row][0] / sizes[0], parts[row][1] / sizes[1], 1.0);
    let solve = |kept: &dyn Fn(usize, f64) -> bool| {
        let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (row, x) in rows.iter().filter(|(row, x)| kept(*row, *x)) {
            let c = column(*row);
            matrix += c * c.transpose();
            right += c * *x;
        }
        matrix += Matrix3::identity() * (1e-10 * matrix.trace());
        matrix.cholesky().map(|cholesky| cholesky.solve(&right))
    };
    let all = solve(&|_, _| true)?;
    let left = |weights: &Vector3<f64>, row: usize, x: f64| x - column(row).dot(weights);
    let spread = |weights: &Vector3<f64>| {
        median(rows.iter().map(|(row, x)| left(weights, *row, *x).abs()).collect()).map(|mad| SD_PER_MAD * mad)
    };
    let first_sd = spread(&all)?;
    let weights = solve(&|row, x| left(&all, row, x).abs() <= FAR * first_sd).unwrap_or(all);
    let left_sd_m = spread(&weights)?;
    let cut = FAR * left_sd_m;
    let squares: f64 = rows.iter().map(|(row, x)| left(&weights, *row, *x).abs().min(cut).powi(2)).sum();
    let motion_m = (0..n_rows).map(|row| column(row).dot(&weights) - weights[2]).collect();
    let fit = QuickFit {
        motion_m,
        offset_m: weights[2],
        rate_per_s,
        retarded_m: weights[0].abs(),
        left_sd_m,
        explained: 1.0 - squares / rows.len() as f64 / variance,
        compliance: [weights[0] / sizes[0], weights[1] / sizes[1]],
    };
    Some((squares, fit))
}

impl QuickFit {
    /// Mean absolute residual in m. Unlike the robust standard deviation, it also increases if only a few rows fit badly.
    pub fn mean_residual_m(&self, record: &Record) -> f64 {
        let left = self.motion_m.iter().zip(&record.position_m);
        let left: Vec<f64> = left.filter_map(|(motion, x)| Some(((*x)? - motion - self.offset_m).abs())).collect();
        left.iter().sum::<f64>() / left.len().max(1) as f64
    }
}

/// Root mean square difference (m) between the fitted law's motions under the two force rules.
pub fn distance_between_rules_m(record: &Record, fit: &QuickFit) -> f64 {
    let n_rows = fit.motion_m.len();
    let [held, linear] = ForceRule::ALL.map(|rule| parts(record, rule, fit.rate_per_s, n_rows));
    let apart = held.iter().zip(&linear).map(|(a, b)| {
        let difference = [0, 1].map(|k| fit.compliance[k] * (a[k] - b[k]));
        (difference[0] + difference[1]).powi(2)
    });
    (apart.sum::<f64>() / n_rows as f64).sqrt()
}

/// Force (N) by which a smooth curve exceeds the straight lines between rows, and the motion (m) that this excess causes in the fitted law. Both are root mean squares
/// over the rows.
pub fn curve_beyond_lines(record: &Record, fit: &QuickFit) -> [f64; 2] {
    let n_rows = fit.motion_m.len();
    let force = record.force();
    let bend = |row: usize| {
        if row == 0 || row + 1 >= n_rows {
            return 0.0;
        }
        let slopes = [row - 1, row].map(|row| force.slope_n_per_s(&record.time_s, row));
        let length_s = 0.5 * (record.time_s[row + 1] - record.time_s[row - 1]);
        // A curve f exceeds its chord of length h by −f″h²/12 on average.
        -(slopes[1] - slopes[0]) * length_s / 12.0
    };
    let bends: Vec<f64> = (0..n_rows).map(bend).collect();
    // A row counts only if the force bends in the same direction at both neighbouring rows. This excludes corners and the noise of a force sensor.
    let smooth = |row: usize| {
        let three = &bends[row.saturating_sub(1)..(row + 2).min(n_rows)];
        let is_curve = three.iter().all(|bend| bend * three[0] > 0.0);
        if is_curve {
            three.iter().copied().reduce(|a, b| if a.abs() < b.abs() { a } else { b }).unwrap_or(0.0)
        } else {
            0.0
        }
    };
    let beyond_n: Vec<f64> = (0..n_rows).map(smooth).collect();
    let beyond = Record {
        time_s: record.time_s[..n_rows].to_vec(),
        force_n: beyond_n.clone(),
        force_rule: ForceRule::Linear,
        ..Record::default()
    };
    let moved = parts(&beyond, ForceRule::Linear, fit.rate_per_s, n_rows);
    let moved_m = moved.iter().map(|part| fit.compliance[0] * part[0] + fit.compliance[1] * part[1]);
    let rms = |squares: f64| (squares / n_rows as f64).sqrt();
    [rms(beyond_n.iter().map(|x| x * x).sum()), rms(moved_m.map(|x| x * x).sum())]
}
