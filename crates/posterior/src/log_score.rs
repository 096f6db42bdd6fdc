//! Log score of held-out cycles: the log predictive density of their positions, given the fitted cycles.

use rayon::prelude::*;

use super::problem::Problem;

/// A log predictive density with the Monte Carlo error of its average over draws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogScore {
    /// Log predictive density ln p(held-out positions | fitted positions), in nats for positions in µm.
    pub nats: f64,
    /// Standard error of `nats` due to the finite number of draws.
    pub standard_error_nats: f64,
}

/// Logarithm of the number of µm per m. Positions are scored in µm, so that a density per position is of order one.
const LN_UM_PER_M: f64 = 13.815_510_557_964_274;

/// Logarithm of the average of p(held-out | fitted, draw) over the posterior draws. It includes the correlation of the noise with the fitted cycles. `None` if no
/// position is held out.
///
/// `trajectories_m` holds each draw's predicted position (m) at every row, and `noise` each draw's noise parameters.
pub fn log_score(problem: &Problem, trajectories_m: &[Vec<f64>], noise: &[Vec<f64>]) -> Option<LogScore> {
    let experiment = &problem.experiment;
    let past = problem.noise_likelihood(&experiment.calibration_cycles);
    let all = problem.noise_likelihood(&[&experiment.calibration_cycles[..], &experiment.heldout_cycles].concat());
    let n_scored = all.n_observed() - past.n_observed();
    if n_scored == 0 || trajectories_m.is_empty() {
        return None;
    }
    let of_draw = |(x, values): (&Vec<f64>, &Vec<f64>)| all.ln_likelihood(x, values) - past.ln_likelihood(x, values);
    let ln_densities: Vec<f64> = trajectories_m.par_iter().zip(noise).map(of_draw).collect();
    let top = ln_densities.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let densities: Vec<f64> = ln_densities.iter().map(|ln| (ln - top).exp()).collect();
    let n = densities.len() as f64;
    let mean = densities.iter().sum::<f64>() / n;
    let variance = densities.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    Some(LogScore {
        nats: top + mean.ln() - n_scored as f64 * LN_UM_PER_M,
        standard_error_nats: (variance / n).sqrt() / mean,
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::monitor::SilentMonitor;
    use crate::replica;
    use crate::study::ModelSpecification;

    /// Log density of `y` under a normal distribution with mean 0 and this covariance, by dense algebra.
    fn ln_normal(y: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
        let cholesky = covariance.clone().cholesky().expect("positive definite");
        let ln_det = 2.0 * cholesky.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        -0.5 * (y.dot(&cholesky.solve(y)) + ln_det + y.len() as f64 * (2.0 * std::f64::consts::PI).ln())
    }

    /// Compares the score of two draws with the conditional normal density by dense algebra in µm. The draws have Ornstein–Uhlenbeck noise, so the last cycle is
    /// correlated with the cycle before it.
    #[test]
    fn scores_are_those_of_the_conditional_normal() {
        let (experiment, _) = replica::embedded().expect("embedded");
        let specification =
            ModelSpecification { noise: vec!["white".into(), "ou".into()], ..ModelSpecification::default() };
        let problem = Problem::new(experiment.for_comparison(), specification, None, &SilentMonitor).expect("sound");
        let record = &problem.experiment.record.clone();
        let last = problem.experiment.heldout_cycles.clone();
        let observed: Vec<usize> = (0..record.n_rows()).filter(|i| record.position_m[*i].is_some()).collect();
        // The trajectory of each draw is the measurement minus a given residual.
        let miss_um = |draw: f64, i: usize| 3.0 * (0.7 * i as f64 + draw).sin() + draw;
        let trajectory = |draw: f64| -> Vec<f64> {
            (0..record.n_rows()).map(|i| record.position_m[i].unwrap_or(0.0) - 1e-6 * miss_um(draw, i)).collect()
        };
        let names: Vec<&str> = problem.noise.parameters().iter().map(|spec| spec.name).collect();
        assert_eq!(names, ["noise_sd_um", "ou_sd_um", "ou_time_s"]);
        let noise = [vec![2.0, 3.0, 1.5], vec![3.0, 1.0, 0.4]];
        let densities: Vec<f64> = noise
            .iter()
            .zip([0.3, 0.5])
            .map(|(values, draw)| {
                let of_rows = |rows: &[usize]| {
                    let y = DVector::from_fn(rows.len(), |k, _| miss_um(draw, rows[k]));
                    let covariance = DMatrix::from_fn(rows.len(), rows.len(), |a, b| {
                        let lag_s = (record.time_s[rows[a]] - record.time_s[rows[b]]).abs();
                        let white = if a == b { values[0] * values[0] } else { 0.0 };
                        white + values[1] * values[1] * (-lag_s / values[2]).exp()
                    });
                    ln_normal(&y, &covariance)
                };
                let past: Vec<usize> = observed.iter().copied().filter(|i| !last.contains(&record.cycle[*i])).collect();
                of_rows(&observed) - of_rows(&past)
            })
            .collect();
        let top = densities[0].max(densities[1]);
        let expected = top + (0.5 * densities.iter().map(|d| (d - top).exp()).sum::<f64>()).ln();
        let found = log_score(&problem, &[trajectory(0.3), trajectory(0.5)], &noise).expect("a cycle is held out");
        assert!((found.nats - expected).abs() < 1e-6 * expected.abs(), "{found:?} {expected}");
        assert!(found.standard_error_nats > 0.0);
        let mut none = problem;
        none.experiment.heldout_cycles.clear();
        assert_eq!(log_score(&none, &[trajectory(0.3)], &noise[..1]), None);
    }
}
