//! How fast the ensemble is beside a log density that costs next to nothing: log densities and effective draws per second.
//!
//! `cargo run --release --example sampler_speed -- [threads] [steps]`

use std::sync::Arc;
use std::time::Instant;
use vitreo_uq::inference::LogDensity;
use vitreo_uq::inference::ensemble::moves::{DifferentialEvolution, Move, Snooker, Stretch, default_move};
use vitreo_uq::inference::{SamplerOptions, sample};

/// Four-dimensional Gaussian with precision tridiagonal (2, −0.95): neighbours correlate by 0.75.
struct Gaussian;

impl LogDensity for Gaussian {
    fn dimension(&self) -> usize {
        4
    }

    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        let (a, rest) = points.split_at(n);
        let (b, rest) = rest.split_at(n);
        let (c, d) = rest.split_at(n);
        for (i, value) in log_density.iter_mut().enumerate() {
            let squares = a[i] * a[i] + b[i] * b[i] + c[i] * c[i] + d[i] * d[i];
            *value = -squares + 0.95 * (a[i] * b[i] + b[i] * c[i] + c[i] * d[i]);
        }
    }
}

fn main() -> vitreo_uq::Result<()> {
    let mut arguments = std::env::args().skip(1).map(|text| text.parse::<u64>().unwrap_or(1));
    let threads = arguments.next().unwrap_or(1) as usize;
    let max_steps = arguments.next().unwrap_or(5_000);
    let kernels: [(Arc<dyn Move>, f64); 5] = [
        (Arc::new(default_move()), SamplerOptions::default().jump_fraction),
        (Arc::new(default_move()), 0.0),
        (Arc::new(Stretch::default()), 0.0),
        (Arc::new(DifferentialEvolution::default()), 0.0),
        (Arc::new(Snooker::default()), 0.0),
    ];
    for (kernel, jump_fraction) in kernels {
        let name = kernel.name();
        let options = SamplerOptions {
            threads,
            max_steps,
            kernel,
            jump_fraction,
            stop_when_converged: false,
            ..SamplerOptions::default()
        };
        let began = Instant::now();
        let outcome = sample(&Gaussian, &[vec![0.1; 4]], &options, &Default::default())?;
        let seconds = began.elapsed().as_secs_f64();
        let ess = outcome.parameters.iter().map(|p| p.ess_bulk).fold(f64::INFINITY, f64::min);
        println!(
            "{:.1e} log densities/s, {:.0} ESS/s, τ {:.1}, acceptance {:.2}, jumps {jump_fraction}, {name}",
            outcome.likelihood_evaluations as f64 / seconds,
            ess / seconds,
            outcome.autocorrelation_time,
            outcome.acceptance,
        );
    }
    Ok(())
}
