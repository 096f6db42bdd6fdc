//! Samples a custom forward model with the ensemble sampler: `cargo run --release --example custom_forward_model`.
//!
//! A cup cools. Its excess temperature a e^{−t/τ} is measured with errors of 0.5 K. The sampler is independent of gels: it accepts any [`LogDensity`] over
//! unbounded coordinates, here ln a and ln τ with flat priors. A quadrature over both parameters is printed for comparison.

use vitreo_uq::Result;
use vitreo_uq::sampling::ensemble::RunControl;
use vitreo_uq::sampling::{LogDensity, SamplerOptions, sample};

const TIME_MIN: [f64; 8] = [0.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0];
const EXCESS_K: [f64; 8] = [60.4, 46.3, 36.8, 27.7, 22.5, 13.0, 8.6, 2.4];
const ERROR_K: f64 = 0.5;

struct Cooling;

impl Cooling {
    fn at(&self, ln_a: f64, ln_tau: f64) -> f64 {
        let model = |time: f64| ln_a.exp() * (-time / ln_tau.exp()).exp();
        let squares = TIME_MIN.iter().zip(EXCESS_K).map(|(time, excess)| ((excess - model(*time)) / ERROR_K).powi(2));
        -0.5 * squares.sum::<f64>()
    }
}

impl LogDensity for Cooling {
    fn dimension(&self) -> usize {
        2
    }
    /// Writes the log density of n points. Coordinate d of point i is at index d n + i.
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        for (i, value) in log_density.iter_mut().enumerate() {
            *value = self.at(points[i], points[n + i]);
        }
    }
}

/// Mean and standard deviation of ln τ by sums over a fine grid.
fn by_quadrature() -> (f64, f64) {
    let n = 400;
    let place = |middle: f64, half: f64, i: usize| middle + half * (2.0 * (i as f64 + 0.5) / n as f64 - 1.0);
    let (mut sums, half) = ([0.0; 3], 0.12);
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let (ln_a, ln_tau) = (place(60.4_f64.ln(), half, i), place(20.0_f64.ln(), half, j));
        let weight = Cooling.at(ln_a, ln_tau).exp();
        sums.iter_mut().zip([1.0, ln_tau, ln_tau * ln_tau]).for_each(|(sum, power)| *sum += weight * power);
    }
    let mean = sums[1] / sums[0];
    (mean, (sums[2] / sums[0] - mean * mean).sqrt())
}

fn main() -> Result<()> {
    let outcome = sample(&Cooling, &[vec![4.0, 3.0]], &SamplerOptions::default(), &RunControl::default())?;
    let [_, tau] = &outcome.parameters[..] else { unreachable!("two coordinates") };
    let (mean, sd) = by_quadrature();
    println!(
        "sampled: ln τ = {:.4} ± {:.4}, R-hat {:.4}, converged: {}",
        tau.mean, tau.sd, tau.rhat, outcome.converged
    );
    println!("by quadrature: ln τ = {mean:.4} ± {sd:.4}");
    Ok(())
}
