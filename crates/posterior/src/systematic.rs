//! Test of a fit's residuals for patterns that does not depend on the noise level.
//!
//! The test uses two statistics of the fitted rows' whitened residuals ([`whiteness`](super::whiteness)). They are the number of runs of one sign, and the
//! autocorrelation up to lag 10. Neither depends on the noise level. The test compares them with their values in simulated noise, from which the columns of the fitted
//! parameters are removed, too.

use nalgebra::DVector;
use rayon::prelude::*;
use sampling::ensemble::RandomStream;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::patterns::orthonormal;
use super::whiteness::{N_LAGS, autocorrelation, ljung_box, runs_score};

/// False-alarm probability: fraction of records of pure noise whose residuals are called systematic.
const FALSE_ALARM: f64 = 0.001;
/// Number of simulated records. With this number, the smallest possible p value is half of [`FALSE_ALARM`].
const N_SIMULATIONS: usize = 3_999;
/// Largest number of residuals for which records are simulated. For more residuals, the fitted parameters have a negligible influence, and closed forms replace the
/// simulation.
const MOST_SIMULATED: usize = 5_000;
/// Smallest number of residuals minus number of parameters for which the test is possible. It is twice the largest lag.
const LEAST_DEGREES: usize = 2 * N_LAGS;
/// Seed of the simulated records. It is fixed, because the records are part of the method.
const SEED: u64 = 0x5157;

/// Result of the test for patterns in the residuals of one record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SystematicTest {
    /// Probability that pure noise deviates from whiteness as much as the residuals, in at least one of the two statistics.
    pub p: f64,
    /// Autocorrelation of the residuals at lag 1.
    pub first_autocorrelation: f64,
    /// Standard score of the number of runs; negative if there are few long runs.
    pub runs_score: f64,
}

impl SystematicTest {
    /// Tests whitened residuals (dimensionless, one per fitted row in order of time). `columns` holds the whitened derivatives of the prediction by each fitted
    /// parameter. Returns `None` if there are too few residuals or if one is not finite.
    pub fn of(residuals: &[f64], columns: &[Vec<f64>]) -> Option<Self> {
        let n = residuals.len();
        let basis = orthonormal(columns);
        let is_finite = residuals.iter().all(|r| r.is_finite()) && residuals.iter().any(|r| *r != 0.0);
        if n < basis.len() + LEAST_DEGREES || !is_finite {
            return None;
        }
        let values = statistics(residuals);
        let each = if n > MOST_SIMULATED { in_closed_form(values) } else { by_simulation(values, n, &basis) };
        Some(Self {
            p: (2.0 * each[0].min(each[1])).min(1.0),
            first_autocorrelation: autocorrelation(residuals)[0],
            runs_score: runs_score(residuals),
        })
    }

    /// Returns true if chance explains the pattern in the residuals with a probability of at most 0.001.
    pub fn is_systematic(&self) -> bool {
        self.p <= FALSE_ALARM
    }
}

/// Returns the Ljung–Box statistic, and the negative standard score of the number of runs. Both are large for a misfit. The score is negative for many short runs,
/// which do not indicate a misfit.
fn statistics(residuals: &[f64]) -> [f64; 2] {
    [ljung_box(residuals), -runs_score(residuals)]
}

fn in_closed_form([correlated, few_runs]: [f64; 2]) -> [f64; 2] {
    let of_lags = ChiSquared::new(N_LAGS as f64).map_or(1.0, |chi| chi.sf(2.0 * correlated));
    [of_lags, Normal::standard().sf(few_runs)]
}

fn by_simulation(values: [f64; 2], n: usize, basis: &[DVector<f64>]) -> [f64; 2] {
    let simulated = |number: usize| {
        let mut stream = RandomStream::new(SEED, number as u64);
        let mut noise = DVector::from_fn(n, |_, _| stream.normal());
        for direction in basis {
            let along = direction.dot(&noise);
            noise.axpy(-along, direction, 1.0);
        }
        statistics(noise.as_slice())
    };
    let all: Vec<[f64; 2]> = (0..N_SIMULATIONS).into_par_iter().map(simulated).collect();
    [0, 1].map(|k| {
        let at_least = all.iter().filter(|other| other[k] >= values[k]).count();
        (1 + at_least) as f64 / (1 + N_SIMULATIONS) as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn white(n: usize, stream: u64) -> Vec<f64> {
        let mut stream = RandomStream::new(91, stream);
        (0..n).map(|_| stream.normal()).collect()
    }

    /// Residuals of a least-squares fit of five smooth columns to `data`, and these columns.
    fn residuals(data: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let n = data.len();
        let column =
            |k: usize| (0..n).map(|row| (k as f64 * std::f64::consts::PI * row as f64 / n as f64).cos()).collect();
        let columns: Vec<Vec<f64>> = (0..5).map(column).collect();
        let mut left = DVector::from_column_slice(data);
        for direction in orthonormal(&columns) {
            let along = direction.dot(&left);
            left.axpy(-along, &direction, 1.0);
        }
        (left.as_slice().to_vec(), columns)
    }

    /// The false-alarm rate is 0.001. By chance, more than 5 of 300 records are called systematic with a probability of 1e-6 (Poisson distribution with mean 0.3).
    #[test]
    fn residuals_of_white_noise_are_not_systematic() {
        for n in [40, 200] {
            let is_alarm = |seed: &u64| {
                let (left, columns) = residuals(&white(n, *seed));
                SystematicTest::of(&left, &columns).expect("enough rows").is_systematic()
            };
            let alarms = (0..300_u64).into_par_iter().filter(is_alarm).count();
            assert!(alarms <= 5, "{alarms} of 300 records of {n} rows");
        }
        let long = SystematicTest::of(&white(MOST_SIMULATED + 1, 3), &[]).expect("enough rows");
        assert!(!long.is_systematic(), "{long:?}");
    }

    /// A wave as large as the noise is found at any noise level, both with simulated records and with closed forms.
    #[test]
    fn a_pattern_is_found_whatever_the_level() {
        for (n, level) in [(200, 1e-9), (200, 1.0), (200, 1e6), (8_000, 1.0)] {
            let wave = |(row, noise): (usize, f64)| level * (noise + 1.4 * (0.2 * row as f64).sin());
            let data: Vec<f64> = white(n, 5).into_iter().enumerate().map(wave).collect();
            let (left, columns) = residuals(&data);
            let test = SystematicTest::of(&left, &columns).expect("enough rows");
            assert!(test.is_systematic() && test.first_autocorrelation > 0.3, "{n} {level}: {test:?}");
        }
    }

    #[test]
    fn too_few_residuals_are_not_tested() {
        assert_eq!(SystematicTest::of(&white(19, 1), &[]), None);
        assert_eq!(SystematicTest::of(&[0.0; 100], &[]), None);
        assert_eq!(SystematicTest::of(&[f64::NAN; 100], &[]), None);
        assert!(SystematicTest::of(&white(20, 1), &[]).is_some());
    }
}
