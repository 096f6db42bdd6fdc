//! Measures the posterior and its sampler: one batch of points, a hundred steps of an ensemble, and whole runs on one and two threads.
//!
//! Limits: at least 5·10⁶ log densities and 150,000 effective samples per second on one thread, and 1.7 times as many on two. The table at the end gives the
//! rates by wall time and by CPU time, because other programs may slow the machine.

mod creep;

use std::hint::black_box;
use std::time::Instant;

use creep::Creep;
use criterion::{BatchSize, Criterion, Throughput};
use vitreo_uq::sampling::ensemble::moves::default_move;
use vitreo_uq::sampling::ensemble::{Ensemble, Kernel};
use vitreo_uq::sampling::{LogDensity, SamplerOptions, sample};

fn batches(criterion: &mut Criterion, creep: &Creep) {
    let posterior = creep.posterior();
    let mut group = criterion.benchmark_group("log_density");
    for n in [16, 32] {
        let points = creep.batch(n);
        let mut values = vec![0.0; n];
        group.throughput(Throughput::Elements(n as u64));
        group.bench_function(format!("batch of {n}"), |bencher| {
            bencher.iter(|| posterior.log_density(black_box(&points), black_box(&mut values)));
        });
    }
    group.finish();
}

fn step(criterion: &mut Criterion, creep: &Creep) {
    let posterior = creep.posterior();
    let n = 32;
    let points = creep.batch(n);
    let mut values = vec![0.0; n];
    posterior.log_density(&points, &mut values);
    let ensemble = Ensemble::new(1, 0, 4, &points, &values);
    let kernel = default_move();
    let kernel = Kernel { local: &kernel, jumps: None };
    let mut group = criterion.benchmark_group("ensemble");
    group.throughput(Throughput::Elements(100 * n as u64));
    group.bench_function("100 steps of 32 walkers, local moves", |bencher| {
        bencher.iter_batched_ref(
            || ensemble.clone(),
            |ensemble| (0..100).try_for_each(|_| ensemble.step(&posterior, &kernel)),
            BatchSize::SmallInput,
        );
    });
    group.finish();
}

/// Setting of a timed run.
struct Setting {
    /// Name of the setting in the table.
    name: &'static str,
    max_steps: u64,
    store_every: Option<u64>,
}

/// Settings of the timed runs. The diagnostics of a draw (ranks, quantiles, autocovariances) take four times as long as its computation, so the share of kept
/// draws matters. Both limits apply to the first setting.
const SETTINGS: [Setting; 3] = [
    Setting { name: "every eighth draw kept", max_steps: 40_000, store_every: Some(8) },
    Setting { name: "draws thinned as by default", max_steps: 100_000, store_every: None },
    Setting { name: "every draw kept and diagnosed", max_steps: 5_000, store_every: Some(1) },
];
const N_RUNS: u64 = 4;

/// CPU time of the process in s; NaN if the system does not report it.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The CPU times are fields 14 and 15, counted from the bracket that closes the program's name. A tick is 10 ms on Linux.
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks: Vec<f64> = after_name.split_whitespace().skip(11).take(2).filter_map(|t| t.parse().ok()).collect();
    if ticks.len() == 2 { 0.01 * (ticks[0] + ticks[1]) } else { f64::NAN }
}

/// Times one setting, and prints its line of the table.
fn report(creep: &Creep, setting: &Setting, threads: usize) {
    let posterior = creep.posterior();
    let (mut evaluations, mut ess, mut wall, mut cpu) = (0.0, 0.0, f64::INFINITY, f64::INFINITY);
    for seed in 1..=N_RUNS {
        let options = SamplerOptions {
            seed,
            threads,
            max_steps: setting.max_steps,
            store_every: setting.store_every,
            stop_when_converged: false,
            ..SamplerOptions::default()
        };
        let (began, cpu_began) = (Instant::now(), cpu_s());
        let outcome = sample(&posterior, &creep.starts(16), &options, &Default::default()).expect("a sound posterior");
        // All runs do equal work, so the fastest run is the least disturbed one.
        (wall, cpu) = (wall.min(began.elapsed().as_secs_f64()), cpu.min(cpu_s() - cpu_began));
        evaluations = outcome.likelihood_evaluations as f64;
        ess = outcome.parameters.iter().map(|p| p.ess_bulk).fold(f64::INFINITY, f64::min);
    }
    println!(
        "{}, {} steps, {threads} thread(s): wall {wall:.3} s, CPU {cpu:.2} s, {:.2e} log-densities/s, {:.2e} ESS/s by wall; {:.2e}, {:.2e} by CPU",
        setting.name,
        setting.max_steps,
        evaluations / wall,
        ess / wall,
        evaluations / cpu,
        ess / cpu
    );
}

fn main() {
    let creep = Creep::new(1);
    let mut criterion = Criterion::default().configure_from_args();
    batches(&mut criterion, &creep);
    step(&mut criterion, &creep);
    criterion.final_summary();
    for setting in &SETTINGS {
        report(&creep, setting, 1);
        report(&creep, setting, 2);
    }
}
