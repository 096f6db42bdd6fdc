//! Joint probabilities of a measurement's statistics in closed form. They replace thousands of simulations, which would take minutes, for long records with independent
//! normal errors.
//!
//! For one draw, rows are independent. The distribution function of the largest deviation is thus a product over rows. The mean square and the coverage are sums over
//! thousands of rows, whose moments are known. The resulting probabilities are averaged over draws.

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

use super::full_check::FullCheck;
use super::mixture::Mixture;

/// Number of rows at which slowly varying probabilities are evaluated. Multiples of the golden ratio spread these rows over the record, so that they do not follow a
/// period of the protocol.
const N_EVALUATED: usize = 4096;
/// Probability below the expected range of a coverage, and also above it.
const TAIL: f64 = 0.005;

/// Held-out rows to score, with the predictions of all draws.
pub(super) struct Predicted<'a> {
    pub check: &'a FullCheck,
    /// Index in the record of each scored row.
    pub rows: &'a [usize],
    /// Mean and standard deviation (m) of the prediction at each scored row.
    pub centre: &'a [(f64, f64)],
    /// Predictive quantiles (m) of every row of the record.
    pub bands_m: &'a [[f64; 5]],
}

/// Probabilities of statistics at least as large as the observed ones, and expected ranges of the coverages.
#[derive(Debug, Clone, Copy)]
pub(super) struct JointScore {
    /// Probability of a largest standardised deviation at least as large as the observed one.
    pub p_largest: f64,
    /// Probability of a mean square at least as large as the observed one.
    pub p_square: f64,
    /// Ranges that hold 99 % of the coverages of the 50 % and the 90 % band.
    pub coverage: [[f64; 2]; 2],
}

/// Probabilities of the statistics, and moments of the coverages, for one draw.
struct DrawStatistics {
    p_largest: f64,
    p_square: f64,
    /// Mean and standard deviation of the coverage of the 50 % and of the 90 % band.
    coverage: [(f64, f64); 2],
}

/// Scores the observed statistics: the largest standardised deviation of all rows (`largest`), and the mean square of the standardised deviations (`square`).
pub(super) fn joint(predicted: &Predicted, largest: f64, square: f64) -> JointScore {
    let n_draws = predicted.check.trajectories_m.len();
    let draws: Vec<DrawStatistics> =
        (0..n_draws).into_par_iter().map(|draw| of_draw(predicted, draw, largest, square)).collect();
    let mean = |of: fn(&DrawStatistics) -> f64| draws.iter().map(of).sum::<f64>() / n_draws as f64;
    let range = |band: usize| {
        let coverage = Mixture {
            mean_m: draws.iter().map(|draw| draw.coverage[band].0).collect(),
            sd_m: draws.iter().map(|draw| draw.coverage[band].1).collect(),
        };
        [coverage.quantile(TAIL), coverage.quantile(1.0 - TAIL)]
    };
    JointScore { p_largest: mean(|d| d.p_largest), p_square: mean(|d| d.p_square), coverage: [range(0), range(1)] }
}

fn of_draw(predicted: &Predicted, draw: usize, largest: f64, square: f64) -> DrawStatistics {
    let Predicted { check, rows, centre, bands_m } = predicted;
    let (x, sd) = (&check.trajectories_m[draw], &check.noise.sd_m[draw]);
    let n = rows.len() as f64;
    // First three cumulants of the sum of squared deviations Σ (δ + r ε)² over the rows, where ε is standard normal. δ is the draw's position minus the mean
    // prediction, and r is the draw's noise. Both are in standard deviations of the prediction.
    let mut cumulants = [0.0; 3];
    for (row, (mean, spread)) in rows.iter().zip(centre.iter()) {
        let inverse = 1.0 / spread;
        let (delta, r) = ((x[*row] - mean) * inverse, sd[*row] * inverse);
        let (delta2, r2) = (delta * delta, r * r);
        cumulants[0] += delta2 + r2;
        cumulants[1] += r2 * (2.0 * r2 + 4.0 * delta2);
        cumulants[2] += r2 * r2 * (8.0 * r2 + 24.0 * delta2);
    }
    let standard = Normal::standard();
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let n_asked = N_EVALUATED.min(rows.len());
    let asked = |i: usize| {
        if n_asked == rows.len() { i } else { (((i as f64 + 0.5) * golden).fract() * n) as usize }
    };
    let (mut ln_below, mut inside, mut variance) = (0.0, [0.0; 2], [0.0; 2]);
    for k in (0..n_asked).map(asked) {
        let row = rows[k];
        let (mean, spread) = centre[k];
        let upper = standard.sf((mean + largest * spread - x[row]) / sd[row]);
        let lower = standard.cdf((mean - largest * spread - x[row]) / sd[row]);
        ln_below += (-(upper + lower)).ln_1p();
        let [lower_90, lower_50, _, upper_50, upper_90] =
            bands_m[row].map(|limit| standard.cdf((limit - x[row]) / sd[row]));
        for (band, probability) in [upper_50 - lower_50, upper_90 - lower_90].into_iter().enumerate() {
            inside[band] += probability;
            variance[band] += probability * (1.0 - probability);
        }
    }
    let asked_share = 1.0 / n_asked as f64;
    DrawStatistics {
        p_largest: -(ln_below * n * asked_share).exp_m1(),
        p_square: exceeds(n * square, cumulants),
        coverage: std::array::from_fn(|band| (inside[band] * asked_share, (variance[band] * asked_share / n).sqrt())),
    }
}

/// Probability that a sum of squares with the given first three cumulants exceeds `value`. A shifted gamma distribution with these cumulants approximates the sum
/// (Pearson 1959). The cube-root transformation of Wilson and Hilferty makes this distribution nearly normal.
fn exceeds(value: f64, [first, second, third]: [f64; 3]) -> f64 {
    let shape = 4.0 * second.powi(3) / (third * third);
    let scale = third / (2.0 * second);
    let gamma = (value - first) / scale + shape;
    if gamma <= 0.0 {
        return 1.0;
    }
    let spread = 1.0 / (9.0 * shape);
    Normal::standard().sf(((gamma / shape).cbrt() - (1.0 - spread)) / spread.sqrt())
}
