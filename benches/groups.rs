//! Measures sweeps of the population's sampler, for 200 specimens in four groups with three parameters. The specimens are given by draws or by likelihoods.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use vitreo_uq::cohorts::hierarchy::{
    ExperimentDensity, ExperimentMember, HierarchyOptions, InterimDraws, sample_population,
};
use vitreo_uq::cohorts::{Design, Labels};
use vitreo_uq::posterior::monitor::SilentMonitor;

const N_SPECIMENS: usize = 200;
const N_DRAWS: usize = 1_000;
const N_SWEEPS: usize = 200;

/// A normal likelihood. It is very cheap, so the benchmark measures the sampler itself.
struct Normal {
    archive: Vec<Vec<f64>>,
    centre: [f64; 3],
}

impl ExperimentDensity for Normal {
    fn ln_density(&self, point: &[f64]) -> f64 {
        point.iter().zip(&self.centre).map(|(x, c)| -50.0 * (x - c).powi(2)).sum()
    }
    fn archive(&self) -> &[Vec<f64>] {
        &self.archive
    }
}

/// Returns `n` points that fill a small box around a centre evenly.
fn scattered(centre: [f64; 3], n: usize) -> Vec<Vec<f64>> {
    let ratios = [0.819_172_513, 0.671_043_607, 0.549_700_478];
    let coordinate = |i: usize, k: usize| centre[k] + 0.2 * ((i as f64 * ratios[k]).fract() - 0.5);
    (0..n).map(|i| (0..3).map(|k| coordinate(i, k)).collect()).collect()
}

fn sweeps(criterion: &mut Criterion) {
    let labels: Vec<Labels> = (0..N_SPECIMENS)
        .map(|i| Labels { specimen: format!("{i:03}"), levels: vec![format!("group {}", i % 4)] })
        .collect();
    let design = Design::new(&labels);
    let centres: Vec<[f64; 3]> = scattered([1.0, 0.0, 4.0], N_SPECIMENS).iter().map(|p| [p[0], p[1], p[2]]).collect();
    let draws: Vec<InterimDraws> = centres
        .iter()
        .map(|centre| InterimDraws::new(scattered(*centre, N_DRAWS).concat(), vec![0.0; N_DRAWS]))
        .collect();
    let densities: Vec<Normal> =
        centres.iter().map(|centre| Normal { archive: scattered(*centre, 64), centre: *centre }).collect();
    let options = HierarchyOptions {
        overall_mean: vec![0.0; 3],
        overall_sd: vec![1.25; 3],
        level_scale: 1.0,
        scales: [0.3, 0.5, 0.3],
        student_dof: None,
        n_chains: 1,
        n_sweeps: [20, N_SWEEPS],
        max_sweeps: N_SWEEPS,
        keep_every: N_SWEEPS,
        seed: 1,
    };
    let mut group = criterion.benchmark_group("population, 200 specimens");
    group.throughput(Throughput::Elements(N_SWEEPS as u64));
    let mut run = |name: &str, members: Vec<ExperimentMember>| {
        group.bench_function(name, |bencher| {
            bencher.iter(|| sample_population(&design, &members, &options, &SilentMonitor).expect("sound"));
        });
    };
    run("sweeps over draws", draws.iter().map(ExperimentMember::Draws).collect());
    run("sweeps over likelihoods", densities.iter().map(|density| ExperimentMember::Exact(density)).collect());
    group.finish();
}

criterion_group!(benches, sweeps);
criterion_main!(benches);
