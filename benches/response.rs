//! Measures the response of the reduced model with each kind of effect: trajectories of eight points at once, 800 regular rows of 0.05 s, ±4.6 µN in holds of 5
//! s.
//!
//! Limit: with any single effect at most ten times the time of the base model's likelihood, which is 0.17 µs per point here. Times are for eight points, and
//! the throughput counts points.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use vitreo_uq::base::number::Dual;
use vitreo_uq::laws::rheology::{BaseLaw, Element};
use vitreo_uq::models::effects::Stages;
use vitreo_uq::models::model::{N_LANES, Response};

const N_ROWS: usize = 800;
const COMPLIANCE_PER_M: f64 = 549.0;

fn number(value: f64) -> Dual {
    Dual::constant(value)
}

/// Returns Kelvin–Voigt body `index` (0 to 40) with 1/41 of the elastic compliance. Retardation times increase with the index from 0.5 ms to 50,000 s.
fn body(index: i32) -> Element {
    let modulus_pa = 41.0 * 3.5;
    Element::kelvin_voigt(number(modulus_pa), number(modulus_pa * 5e-4 * 10.0_f64.powf(0.2 * f64::from(index))))
}

type Case = (&'static str, fn(&mut Stages, f64));

/// Measured cases: name, and function that adds an effect to the stages of a model. The function's size argument is near 1 and differs between points.
const CASES: [Case; 10] = [
    ("base", |_, _| {}),
    ("delay", |stages, size| stages.load.delay_s = number(0.063 * size)),
    ("bias", |stages, size| stages.load.offset_n = number(2e-7 * size)),
    ("lag", |stages, size| stages.load.lag_time_s = number(0.05 * size)),
    ("gradient", |stages, size| stages.load.gradient_per_m = number(80.0 * size)),
    ("softening", |stages, size| stages.softening_rate_per_s = number(0.01 * size)),
    ("drift", |stages, size| stages.observation.velocity_m_per_s = number(1e-6 * size)),
    ("one more mode", |stages, size| stages.law.push(Element::kelvin_voigt(number(8.0), number(20.0 * size)))),
    ("41 modes", |stages, _| {
        stages.law.remove(0);
        stages.law.extend((0..41).map(body));
    }),
    ("gradient and lag", |stages, size| {
        stages.load.gradient_per_m = number(80.0 * size);
        stages.load.lag_time_s = number(0.05 * size);
    }),
];

fn trajectories(criterion: &mut Criterion) {
    let time_s: Vec<f64> = (0..N_ROWS).map(|row| 0.05 * row as f64).collect();
    let force_n: Vec<f64> = (0..N_ROWS).map(|row| if (row / 100) % 2 == 0 { 4.6e-6 } else { -4.6e-6 }).collect();
    let response = Response::new(&time_s, &force_n, N_ROWS);
    let mut group = criterion.benchmark_group("response");
    group.throughput(Throughput::Elements(N_LANES as u64));
    for (name, add) in CASES {
        let points: Vec<Stages> = (0..N_LANES)
            .map(|lane| {
                let size = 1.0 + 0.07 * lane as f64;
                let law = [3.527 * size, 1.402, 47.37 * size].map(number);
                let mut stages = Stages::of_law(BaseLaw::Lethersich.elements(&law));
                add(&mut stages, size);
                stages
            })
            .collect();
        let mut positions = Vec::new();
        let sound = response.trajectories_m(&points, &[COMPLIANCE_PER_M; N_LANES], &mut positions);
        assert_eq!(sound, [true; N_LANES], "{name}");
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                response.trajectories_m(black_box(&points), &[COMPLIANCE_PER_M; N_LANES], black_box(&mut positions))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, trajectories);
criterion_main!(benches);
