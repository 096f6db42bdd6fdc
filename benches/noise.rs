//! Measures the noise models on a record of 800 rows, with one point or eight points per pass.
//!
//! Limits: with all noise terms at most 20 µs per point; with white noise at most 0.3 ns per row and point, in passes of eight points.

use std::hint::black_box;

use criterion::{Criterion, Throughput};
use vitreo_uq::base::error::InputPlace;
use vitreo_uq::posterior::noise::{LANES, NoiseLikelihood, NoiseModel};

const N_ROWS: usize = 800;

fn models() -> [(&'static str, NoiseModel, Vec<f64>); 4] {
    let model = |names: &[&str], parameters: &[f64]| {
        let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
        let model = NoiseModel::named(&names, &InputPlace::default()).expect("names of terms");
        (model, parameters.to_vec())
    };
    [
        ("white", model(&["white"], &[4.0])),
        ("white, ou", model(&["white", "ou"], &[4.0, 3.0, 0.7])),
        ("white, ou, gain", model(&["white", "ou", "gain"], &[4.0, 3.0, 0.7, 0.03, 4.0])),
        ("white, ou, gain, student", model(&["white", "ou", "gain", "student"], &[4.0, 3.0, 0.7, 0.03, 4.0, 6.0])),
    ]
    .map(|(name, (model, parameters))| (name, model, parameters))
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let cycle: Vec<u32> = (0..N_ROWS).map(|i| 1 + (i / 200) as u32).collect();
    let position_m: Vec<f64> = (0..N_ROWS).map(|i| 7e-4 * (0.05 * i as f64).sin()).collect();
    let even_s: Vec<f64> = (0..N_ROWS).map(|i| 0.05 * i as f64).collect();
    let uneven_s: Vec<f64> = (0..N_ROWS).map(|i| 0.05 * i as f64 + 0.01 * (1.7 * i as f64).sin()).collect();
    for (sampling, time_s) in [("even", &even_s), ("uneven", &uneven_s)] {
        let mut group = criterion.benchmark_group(format!("noise, 800 samples, {sampling}"));
        for (name, model, parameters) in models() {
            let noise_m = |i: usize| 1e-6 * (4.0 * (2.3 * i as f64).sin() + (0.3 * i as f64).cos());
            let observed_m: Vec<Option<f64>> = (0..N_ROWS).map(|i| Some(position_m[i] + noise_m(i))).collect();
            let likelihood = NoiseLikelihood::new(model, time_s, &cycle, &observed_m);
            group.throughput(Throughput::Elements(1));
            group.bench_function(format!("{name}: one point"), |bencher| {
                bencher.iter(|| likelihood.ln_likelihood(black_box(&position_m), black_box(&parameters)));
            });
            let lanes_m: Vec<[f64; LANES]> = position_m.iter().map(|x| [*x; LANES]).collect();
            let lanes: Vec<[f64; LANES]> = parameters.iter().map(|value| [*value; LANES]).collect();
            let mut out = [0.0; LANES];
            group.throughput(Throughput::Elements(LANES as u64));
            group.bench_function(format!("{name}: eight points"), |bencher| {
                bencher.iter(|| likelihood.ln_likelihood_lanes(black_box(&lanes_m), black_box(&lanes), &mut out));
            });
        }
        group.finish();
    }
    criterion.final_summary();
}
