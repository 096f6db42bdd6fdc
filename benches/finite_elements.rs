//! Measures finite elements: assembly, analysis and factorisation of about 10,000 and 60,000 unknowns, a solve, and trajectories of 64 laws.
//!
//! Limits for assembly and factorisation on two cores: 0.5 s for 10,000 unknowns, and 5 s for 60,000.

use std::hint::black_box;
use std::time::Duration;

use criterion::Criterion;
use vitreo_uq::elements::fe::time::{FullOrderModel, TimeScheme};
use vitreo_uq::elements::fe::{Assembly, Stiffness};
use vitreo_uq::elements::mesh::{Mesh, QuarterBall};
use vitreo_uq::laws::rheology::CreepCompliance;

const POISSON_RATIO: f64 = 0.48;

fn mesh(n_per_edge: usize, n_layers: usize) -> Mesh {
    let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge, n_layers };
    ball.mesh().expect("the radii are in order")
}

fn factorisation(criterion: &mut Criterion, n_per_edge: usize, n_layers: usize) {
    let mesh = mesh(n_per_edge, n_layers);
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    let factor = stiffness.factor(POISSON_RATIO).expect("positive definite");
    let mut group = criterion.benchmark_group(format!("{} unknowns", stiffness.n_unknowns()));
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    group.bench_function("assembly", |bencher| bencher.iter(|| Assembly::new(black_box(&mesh))));
    group
        .bench_function("assembly, ordering and analysis", |bencher| bencher.iter(|| Stiffness::new(black_box(&mesh))));
    group.bench_function("factorisation", |bencher| bencher.iter(|| stiffness.factor(black_box(POISSON_RATIO))));
    group.bench_function("assembly to factor", |bencher| {
        bencher.iter(|| Stiffness::new(black_box(&mesh)).and_then(|s| s.factor(POISSON_RATIO).map(|f| f.n_unknowns())));
    });
    group.bench_function("solve", |bencher| bencher.iter(|| factor.unit_response()));
    group.finish();
}

/// Measures the work of the held-out check: one solve for the load of four cycles, then one trajectory for each of 64 draws.
fn trajectories(criterion: &mut Criterion) {
    let mesh = mesh(3, 12);
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    let model = FullOrderModel::new(&stiffness, POISSON_RATIO).expect("positive definite");
    let time_s: Vec<f64> = (0..800).map(|row| 0.05 * f64::from(row)).collect();
    let force_n: Vec<f64> = (0..800).map(|row| if row / 100 % 2 == 0 { 4.6e-6 } else { -4.6e-6 }).collect();
    let mut group = criterion.benchmark_group("64 draws, 800 samples");
    group.sample_size(10);
    group.bench_function(format!("{} unknowns", stiffness.n_unknowns()), |bencher| {
        bencher.iter(|| {
            let load = model.solve_load(&time_s, &force_n);
            let run = |draw: u32| {
                let law = CreepCompliance::lethersich(&[3.5 + 0.01 * f64::from(draw), 1.4, 47.0]);
                model.trajectory(&load, &law, TimeScheme::Exponential)
            };
            (0..64).map(run).map(|x| x.len()).sum::<usize>()
        });
    });
    group.finish();
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    factorisation(&mut criterion, 3, 8);
    factorisation(&mut criterion, 5, 17);
    trajectories(&mut criterion);
    criterion.final_summary();
}
