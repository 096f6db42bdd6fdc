//! Compares the samplers emcee, hammer-and-sample and vitreo-uq on one posterior, with one thread each. `vitreo_uq::sampling::diagnostics` computes the
//! effective sample sizes of all three.
//!
//! `peers prepare DIR` writes the record, and the start points with their log densities. `peers compare DIR` reads the chains of emcee, runs the other two
//! samplers and prints the table. `compare.sh` runs all steps.

#[path = "../../creep/mod.rs"]
mod creep;
mod hammer;

use std::io::Write;
use std::path::Path;
use std::time::Instant;

use creep::{COMPLIANCE_PER_M, Creep};
use vitreo_uq::sampling::diagnostics::{DrawColumn, diagnose};
use vitreo_uq::sampling::diagnostics::ranks::BlomScores;
use vitreo_uq::posterior::prior::Distribution;
use vitreo_uq::sampling::{LogDensity, SamplerOptions, sample};

const N_WALKERS: usize = 32;
const N_STEPS: usize = 5_000;
/// Number of first steps that are discarded, for samplers that do not determine their burn-in.
const N_BURN_IN: usize = 500;
const DIMENSION: usize = 4;

type Failure = Box<dyn std::error::Error>;

/// Result of one sampler's run, burn-in included. Coordinate d of walker w at step s is at `values[(s * n_walkers + w) * 4 + d]`.
struct Chain {
    name: String,
    wall_s: f64,
    n_evaluations: f64,
    values: Vec<f64>,
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let creep = Creep::new(1);
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["prepare", folder] => prepare(&creep, Path::new(folder)),
        ["compare", folder] => compare(&creep, Path::new(folder)),
        _ => Err("use: peers prepare DIR, or peers compare DIR".into()),
    }
}

/// Returns the start points of all walkers: a ball of 1 % around the reference, so small that no walker stays far from the posterior.
fn starts(creep: &Creep) -> Vec<[f64; DIMENSION]> {
    let batch = creep.batch(N_WALKERS);
    (0..N_WALKERS).map(|w| std::array::from_fn(|d| batch[d * N_WALKERS + w])).collect()
}

fn log_densities(creep: &Creep) -> Vec<f64> {
    let mut values = vec![0.0; N_WALKERS];
    creep.posterior().log_density(&creep.batch(N_WALKERS), &mut values);
    values
}

/// Returns median and `log_sd` of each parameter's log-normal prior.
fn log_normals(creep: &Creep) -> Result<Vec<(f64, f64)>, Failure> {
    let pair = |distribution| match distribution {
        Distribution::LogNormal { median, log_sd } => Ok((median, log_sd)),
        _ => Err("the peers know log-normal priors only".into()),
    };
    creep.priors.priors().iter().map(|prior| pair(prior.distribution)).collect()
}

fn prepare(creep: &Creep, folder: &Path) -> Result<(), Failure> {
    let mut record = std::fs::File::create(folder.join("record.csv"))?;
    writeln!(record, "time_s,force_n,position_m")?;
    for ((t, f), x) in creep.time_s.iter().zip(&creep.force_n).zip(&creep.position_m) {
        writeln!(record, "{t:e},{f:e},{x:e}")?;
    }
    let mut priors = std::fs::File::create(folder.join("priors.csv"))?;
    writeln!(priors, "median,log_sd")?;
    for (median, log_sd) in log_normals(creep)? {
        writeln!(priors, "{median:e},{log_sd:e}")?;
    }
    let mut points = std::fs::File::create(folder.join("starts.csv"))?;
    writeln!(points, "ln_e,ln_c1,ln_c2,ln_sigma,log_density")?;
    for (point, value) in starts(creep).iter().zip(log_densities(creep)) {
        writeln!(points, "{:e},{:e},{:e},{:e},{value:e}", point[0], point[1], point[2], point[3])?;
    }
    std::fs::write(
        folder.join("constants.csv"),
        format!("compliance_per_m,n_steps\n{COMPLIANCE_PER_M:e},{N_STEPS}\n"),
    )?;
    Ok(())
}

fn compare(creep: &Creep, folder: &Path) -> Result<(), Failure> {
    println!("| sampler | wall s | log-densities/s | bulk ESS/s | sd of ln E |\n|---|---|---|---|---|");
    for name in ["emcee-stretch", "emcee-de-snooker"] {
        print_row(&read_chain(folder, name)?);
    }
    print_row(&hammer::run(creep, &starts(creep), &log_densities(creep), N_STEPS)?);
    ours(creep)
}

/// Reads the chain that the Python program wrote: `NAME.csv` with wall time and number of evaluations, `NAME.f64` with the values.
fn read_chain(folder: &Path, name: &str) -> Result<Chain, Failure> {
    let text = std::fs::read_to_string(folder.join(format!("{name}.csv")))?;
    let numbers: Vec<f64> =
        text.lines().nth(1).unwrap_or_default().split(',').map(str::parse).collect::<Result<_, _>>()?;
    let [wall_s, n_evaluations] = numbers[..] else { return Err(format!("{name}.csv needs two numbers").into()) };
    let bytes = std::fs::read(folder.join(format!("{name}.f64")))?;
    let values = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    Ok(Chain { name: name.into(), wall_s, n_evaluations, values })
}

fn print_row(chain: &Chain) {
    let kept = &chain.values[N_BURN_IN * N_WALKERS * DIMENSION..];
    let column = |d: usize| DrawColumn {
        n_ensembles: 1,
        n_steps: kept.len() / (N_WALKERS * DIMENSION),
        n_walkers: N_WALKERS,
        values: kept.iter().skip(d).step_by(DIMENSION).copied().collect(),
    };
    let blom = BlomScores::new(kept.len() / DIMENSION);
    let found: Vec<_> = (0..DIMENSION).map(|d| diagnose(&column(d), &blom)).collect();
    let ess = found.iter().map(|p| p.ess_bulk).fold(f64::INFINITY, f64::min);
    print_numbers(&chain.name, chain.wall_s, chain.n_evaluations, ess, found[0].sd);
}

fn print_numbers(name: &str, wall_s: f64, n_evaluations: f64, ess: f64, sd: f64) {
    println!("| {name} | {wall_s:.3} | {:.2e} | {:.0} | {sd:.3e} |", n_evaluations / wall_s, ess / wall_s);
}

/// Runs this program's sampler: four ensembles from start points spread over the prior. The time includes the search for the mode, the burn-in and the
/// diagnostics.
fn ours(creep: &Creep) -> Result<(), Failure> {
    let posterior = creep.posterior();
    for (name, max_steps, store_every) in
        [("vitreo-uq", N_STEPS as u64, Some(1)), ("vitreo-uq, draws thinned", 100_000, None)]
    {
        let options = SamplerOptions {
            n_walkers: N_WALKERS,
            max_steps,
            store_every,
            threads: 1,
            stop_when_converged: false,
            ..SamplerOptions::default()
        };
        let began = Instant::now();
        let outcome = sample(&posterior, &creep.starts(16), &options, &Default::default())?;
        let wall_s = began.elapsed().as_secs_f64();
        let ess = outcome.parameters.iter().map(|p| p.ess_bulk).fold(f64::INFINITY, f64::min);
        print_numbers(name, wall_s, outcome.likelihood_evaluations as f64, ess, outcome.parameters[0].sd);
    }
    Ok(())
}
