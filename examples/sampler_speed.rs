//! How fast the ensemble is: log densities and effective draws per second on a cheap and on a correlated target.
//!
//! `cargo run --release --example sampler_speed [threads] [steps]`

use std::sync::Arc;
use std::time::Instant;
use vitreo_uq::inference::LogDensity;
use vitreo_uq::inference::ensemble::moves::{DifferentialEvolution, Mixture, Move, Snooker, Stretch};
use vitreo_uq::inference::{SamplerOptions, sample};

/// Gaussian with precision tridiagonal (2, −0.95 · correlated).
struct Gaussian {
    off_diagonal: f64,
}

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
            *value = -squares + self.off_diagonal * (a[i] * b[i] + b[i] * c[i] + c[i] * d[i]);
        }
    }
}

fn main() -> vitreo_uq::Result<()> {
    let mut arguments = std::env::args().skip(1).map(|text| text.parse::<u64>().unwrap_or(1));
    let threads = arguments.next().unwrap_or(1) as usize;
    let max_steps = arguments.next().unwrap_or(20_000);
    let de = |scale, spread, jump_probability| -> Box<dyn Move> {
        Box::new(DifferentialEvolution { scale, spread, jump_probability })
    };
    let jump_fraction = std::env::var("JUMPS").map_or(0.8, |text| text.parse().unwrap_or(0.8));
    let store_every = std::env::var("STORE").ok().and_then(|text| text.parse().ok());
    let kernels: Vec<Arc<dyn Move>> = vec![
        SamplerOptions::default().kernel,
        Arc::new(Stretch::default()),
        Arc::new(DifferentialEvolution::default()),
        Arc::new(Snooker::default()),
        de(1.0, 0.0, 0.0).into(),
        de(1.0, 0.3, 0.0).into(),
        de(1.0, 0.8, 0.0).into(),
        de(0.8, 0.3, 0.05).into(),
        de(1.2, 0.3, 0.05).into(),
        de(1.0, 0.3, 0.05).into(),
        Arc::new(Mixture::new(vec![(0.5, de(1.0, 0.3, 0.05)), (0.5, Box::new(Snooker::default()))])),
        Arc::new(Mixture::new(vec![(0.7, de(1.0, 0.3, 0.05)), (0.3, Box::new(Snooker { scale: 1.2 }))])),
        Arc::new(Mixture::new(vec![(0.7, de(1.0, 0.3, 0.05)), (0.3, Box::new(Snooker { scale: 2.2 }))])),
    ];
    let kernels = if std::env::var_os("ONLY_DEFAULT").is_some() { kernels[..1].to_vec() } else { kernels };
    for (target, off_diagonal) in [("independent", 0.0), ("correlated", 0.95)] {
        for kernel in &kernels {
            let options = SamplerOptions {
                threads,
                max_steps,
                stop_when_converged: false,
                kernel: Arc::clone(kernel),
                jump_fraction,
                store_every,
                ..SamplerOptions::default()
            };
            let began = Instant::now();
            let outcome = sample(&Gaussian { off_diagonal }, &[vec![0.1; 4]], &options, &Default::default())?;
            let seconds = began.elapsed().as_secs_f64();
            let ess = outcome.parameters.iter().map(|p| p.ess_bulk).fold(f64::INFINITY, f64::min);
            println!(
                "{target}: {:.2e} log densities/s, {:.0} ESS/s, τ {:.1}, acceptance {:.2}, {}",
                outcome.likelihood_evaluations as f64 / seconds,
                ess / seconds,
                outcome.autocorrelation_time,
                outcome.acceptance,
                kernel.name()
            );
        }
    }
    Ok(())
}
