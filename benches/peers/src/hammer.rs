//! Runs the sampler hammer-and-sample on the posterior of [`Creep`], with a scalar log density written for this sampler.

use std::time::Instant;

use hammer_and_sample::{MinChainLen, Model, Serial, Stretch, sample};
use rand::SeedableRng;
use rand_pcg::Pcg64;

use super::creep::{COMPLIANCE_PER_M, Creep};
use super::{Chain, DIMENSION, Failure, N_WALKERS, log_normals};

/// Scalar form of the posterior. Because rows are equidistant, it needs one recursion per row and one exponential per point.
struct Posterior<'a> {
    creep: &'a Creep,
    priors: Vec<(f64, f64)>,
}

impl Model for Posterior<'_> {
    type Params = [f64; DIMENSION];

    fn log_prob(&self, point: &[f64; DIMENSION]) -> f64 {
        let [young_pa, viscosity_1, viscosity_2, noise_um] = point.map(f64::exp);
        let noise_m = 1e-6 * noise_um;
        let (step_s, n) = (0.05, self.creep.position_m.len());
        let decay = (-step_s * young_pa / viscosity_1).exp();
        let gain = COMPLIANCE_PER_M / young_pa * (1.0 - decay);
        let flow = COMPLIANCE_PER_M / viscosity_2 * step_s;
        let (mut retarded, mut flown, mut sum) = (0.0, 0.0, 0.0);
        for (force, position) in self.creep.force_n.iter().zip(&self.creep.position_m) {
            let residual: f64 = position - retarded - flown;
            sum += residual * residual;
            retarded = decay * retarded + gain * force;
            flown += flow * force;
        }
        let prior: f64 = point.iter().zip(&self.priors).map(|(z, (median, sd))| ((z - median.ln()) / sd).powi(2)).sum();
        -0.5 * (sum / (noise_m * noise_m) + prior) - n as f64 * noise_m.ln()
    }
}

/// Checks the scalar log density against the library's values, then runs the stretch move for `n_steps` steps of every walker.
pub fn run(
    creep: &Creep,
    starts: &[[f64; DIMENSION]],
    log_densities: &[f64],
    n_steps: usize,
) -> Result<Chain, Failure> {
    let posterior = Posterior { creep, priors: log_normals(creep)? };
    let offset = log_densities[0] - posterior.log_prob(&starts[0]);
    for (start, expected) in starts.iter().zip(log_densities) {
        let found = posterior.log_prob(start) + offset;
        if (found - expected).abs() > 1e-8 * expected.abs() {
            return Err(format!("not the same posterior: {found} against {expected}").into());
        }
    }
    let walkers = starts.iter().zip(0..).map(|(start, seed)| (*start, Pcg64::seed_from_u64(seed)));
    let began = Instant::now();
    let (chain, _) = sample(&posterior, &Stretch::default(), walkers, MinChainLen(n_steps * N_WALKERS), Serial);
    let wall_s = began.elapsed().as_secs_f64();
    let n_evaluations = chain.len() as f64;
    Ok(Chain { name: "hammer-and-sample".into(), wall_s, n_evaluations, values: chain.into_iter().flatten().collect() })
}
