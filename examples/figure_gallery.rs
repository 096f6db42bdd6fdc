//! Draws every figure of the toolkit from made-up data: `cargo run --example figure_gallery -- DIR`.

use std::path::{Path, PathBuf};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use vitreo_uq::Result;
use vitreo_uq::figures::corner::{CornerOptions, ParameterColumn, Posterior, PriorCurve, corner};
use vitreo_uq::figures::density::Support;
use vitreo_uq::figures::palette::series;
use vitreo_uq::figures::predictive::{Band, CycleKind, CycleSpan, PredictiveData, predictive};
use vitreo_uq::figures::singular_values::{Family, singular_values};
use vitreo_uq::figures::svg::write_figure;
use vitreo_uq::figures::trace::{EnsembleTrace, ParameterTrace, trace};

fn main() -> Result<()> {
    let dir = std::env::args_os().nth(1).map_or_else(std::env::temp_dir, PathBuf::from);
    let rng = &mut ChaCha8Rng::seed_from_u64(3);
    let porcine =
        Protocol { n_cycles: 4, half_cycle_s: 5.0, interval_s: 0.05, force_un: 4.6, noise_um: 4.0, n_calibration: 1 };
    write_predictive(&dir, "predictive_porcine", &porcine, "porcine-01: predicted and measured position", rng)?;
    let slow = Protocol {
        n_cycles: 10,
        half_cycle_s: 100.0,
        interval_s: 5.0,
        force_un: 1e-6,
        noise_um: 0.05,
        n_calibration: 3,
    };
    let long_name = "a specimen in slow cycles whose name is much longer than any figure is wide, so that it must be cut somewhere before the edge";
    write_predictive(&dir, "predictive_slow", &slow, long_name, rng)?;
    write_trace(&dir, rng)?;
    write_singular_values(&dir)?;
    write_corner_of_two(&dir, rng)?;
    write_corner_of_many(&dir, 8, rng)?;
    write_corner_of_many(&dir, 2, rng)?;
    println!("figures in {}", dir.display());
    Ok(())
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

struct Protocol {
    n_cycles: usize,
    half_cycle_s: f64,
    interval_s: f64,
    force_un: f64,
    noise_um: f64,
    n_calibration: usize,
}

/// Draws the response to an alternating force, with the time scales of physics §2 scaled to the half cycle.
fn write_predictive(dir: &Path, stem: &str, protocol: &Protocol, title: &str, rng: &mut ChaCha8Rng) -> Result<()> {
    let n = (2.0 * protocol.n_cycles as f64 * protocol.half_cycle_s / protocol.interval_s) as usize;
    let time_s: Vec<f64> = (0..n).map(|i| i as f64 * protocol.interval_s).collect();
    let sign = |t: f64| if ((t / protocol.half_cycle_s) as usize).is_multiple_of(2) { 1.0 } else { -1.0 };
    let (mut elastic, mut viscous) = (0.0, 0.0);
    let amplitude = if protocol.noise_um > 1.0 { 700.0 } else { 1.0 };
    let (mut median_um, mut position_um) = (Vec::new(), Vec::new());
    for (i, t) in time_s.iter().enumerate() {
        let middle: f64 = elastic + viscous;
        median_um.push(middle);
        position_um.push((i % 53 != 40).then(|| middle + protocol.noise_um * normal(rng)));
        elastic += protocol.interval_s / (0.12 * protocol.half_cycle_s) * (amplitude * sign(*t) - elastic);
        viscous += amplitude * 0.4 * sign(*t) * protocol.interval_s / protocol.half_cycle_s;
    }
    let shifted = |sds: f64| median_um.iter().map(|m| m + sds * protocol.noise_um).collect::<Vec<f64>>();
    let limits = [-0.6745, 0.6745, -1.6449, 1.6449].map(shifted);
    let cycle_s = 2.0 * protocol.half_cycle_s;
    let kind = |i: usize| if i < protocol.n_calibration { CycleKind::Calibration } else { CycleKind::HeldOut };
    let span = |i: usize| CycleSpan {
        cycle: i as i64 + 1,
        start_s: i as f64 * cycle_s,
        end_s: (i + 1) as f64 * cycle_s,
        kind: kind(i),
    };
    let cycles: Vec<CycleSpan> = (0..protocol.n_cycles).map(span).collect();
    let force_un: Vec<f64> = time_s.iter().map(|t| protocol.force_un * sign(*t)).collect();
    let figure = predictive(&PredictiveData {
        title,
        time_s: &time_s,
        position_um: &position_um,
        force_un: &force_un,
        median_um: &median_um,
        band_50_um: Band { lower: &limits[0], upper: &limits[1] },
        band_90_um: Band { lower: &limits[2], upper: &limits[3] },
        cycles: &cycles,
        noise: Some((protocol.noise_um, "known")),
    })?;
    write_figure(dir, stem, &figure)
}

/// Draws traces of autoregressive walkers with a known autocorrelation.
fn write_trace(dir: &Path, rng: &mut ChaCha8Rng) -> Result<()> {
    const MEMORY: f64 = 0.9;
    let (n_ensembles, n_steps) = (4, 2_000);
    let run = |centre: f64, sd: f64, rng: &mut ChaCha8Rng| {
        let mut state = 4.0;
        let step = |_| {
            state = MEMORY * state + (1.0 - MEMORY * MEMORY).sqrt() * normal(rng);
            centre + 0.3 * sd * state
        };
        (0..n_steps).map(step).collect::<Vec<f64>>()
    };
    let autocorrelation: Vec<f64> = (0..200).map(|lag| MEMORY.powi(lag)).collect();
    let names = [("E (Pa)", 3.527, 0.11), ("c₁ (Pa·s)", 1.402, 0.04), ("c₂ (Pa·s)", 47.37, 1.6), ("σ (µm)", 4.0, 0.2)];
    let means: Vec<Vec<Vec<f64>>> =
        names.iter().map(|(_, centre, sd)| (0..n_ensembles).map(|_| run(*centre, *sd, rng)).collect()).collect();
    let shifted = |values: &Vec<f64>, by: f64| values.iter().map(|v| v + by).collect::<Vec<f64>>();
    let bands: Vec<Vec<[Vec<f64>; 2]>> = names
        .iter()
        .zip(&means)
        .map(|((_, _, sd), runs)| runs.iter().map(|run| [shifted(run, -1.6 * sd), shifted(run, 1.6 * sd)]).collect())
        .collect();
    let parameters: Vec<ParameterTrace> = (0..names.len())
        .map(|p| ParameterTrace {
            label: names[p].0,
            ensembles: (0..n_ensembles)
                .map(|e| EnsembleTrace {
                    mean: &means[p][e],
                    lower: &bands[p][e][0],
                    upper: &bands[p][e][1],
                    walkers: vec![],
                })
                .collect(),
            autocorrelation: vec![&autocorrelation; n_ensembles],
            autocorrelation_time_steps: Some((1.0 + MEMORY) / (1.0 - MEMORY)),
        })
        .collect();
    write_figure(dir, "trace", &trace(&parameters, 120, "porcine-01: four ensembles of 32 walkers")?)
}

fn write_singular_values(dir: &Path) -> Result<()> {
    let base = [12.0, 3e-15, 2e-15, 1e-15, 8e-16, 5e-16, 4e-16];
    let poisson = [31.0, 0.8, 4e-3, 5e-14, 2e-15, 2e-15, 1e-15, 7e-16];
    let slow: Vec<f64> = (0..20).map(|k| (-0.9 * f64::from(k)).exp()).collect();
    let families = [
        Family { label: "base model", singular_values: &base, n_chosen: 1 },
        Family { label: "Poisson ratio", singular_values: &poisson, n_chosen: 3 },
        Family { label: "slip", singular_values: &slow, n_chosen: 15 },
    ];
    write_figure(
        dir,
        "singular_values",
        &singular_values(&families, 1e-6, "POD of the snapshots in the energy inner product")?,
    )
}

fn column<'a>(name: &'a str, symbol: &'a str, unit: &'a str, draws: &'a [f64]) -> ParameterColumn<'a> {
    ParameterColumn { name, symbol, unit, draws, support: Support::default(), prior: None, reference: None }
}

fn write_corner_of_two(dir: &Path, rng: &mut ChaCha8Rng) -> Result<()> {
    let mut draw = |shift: f64, n: usize| {
        let mut columns = vec![Vec::new(); 4];
        for _ in 0..n {
            let (a, b, c, d) = (normal(rng), normal(rng), normal(rng), normal(rng));
            columns[0].push(3.527 + 0.11 * (a + shift));
            columns[1].push(1.402 + 0.05 * (0.8 * a + 0.6 * b));
            columns[2].push(47.37 + 1.9 * (0.5 * a - 0.86 * c + 0.6 * shift));
            columns[3].push((0.02 * d).abs());
        }
        columns
    };
    let (first, second) = (draw(0.0, 8_000), draw(1.8, 8_000));
    let prior_x: Vec<f64> = (0..400).map(|i| 1.0 + 0.02 * f64::from(i)).collect();
    let prior_density: Vec<f64> =
        prior_x.iter().map(|x| (-0.5 * ((x.ln() - 1.2) / 0.15).powi(2)).exp() / (x * 0.15 * 2.5066)).collect();
    let mut base = vec![
        column("E", "E", "Pa", &first[0]),
        column("c1", "c₁", "Pa·s", &first[1]),
        column("c2", "c₂", "Pa·s", &first[2]),
    ];
    base[0].prior = Some(PriorCurve { x: &prior_x, density: &prior_density });
    base[0].reference = Some(3.527);
    base[1].reference = Some(1.402);
    base[2].reference = Some(93.1);
    let mut extended = vec![
        column("E", "E", "Pa", &second[0]),
        column("c1", "c₁", "Pa·s", &second[1]),
        column("c2", "c₂", "Pa·s", &second[2]),
        column("actuator-lag.time_s", "actuator-lag: time", "s", &second[3]),
    ];
    extended[3].support = Support { lower: 0.0, upper: f64::INFINITY };
    let posteriors = [
        Posterior { label: "m0: base model", colour: series(0), parameters: base.clone() },
        Posterior { label: "m1: base model with actuator lag", colour: series(1), parameters: extended },
    ];
    let options = CornerOptions {
        title: "porcine-01: two revisions",
        reference_label: "published value",
        ..CornerOptions::default()
    };
    write_figure(dir, "corner_two", &corner(&posteriors, &options)?)?;
    let one = [Posterior { label: "porcine-01", colour: series(0), parameters: base }];
    write_figure(dir, "corner_one", &corner(&one, &options)?)
}

fn write_corner_of_many(dir: &Path, n: usize, rng: &mut ChaCha8Rng) -> Result<()> {
    let names = ["E", "c₁", "c₂", "σ", "interface-slip: compliance", "τ OU", "sd of gain", "α"];
    let units = ["Pa", "Pa·s", "Pa·s", "µm", "m/(Pa·s)", "s", "–", "–"];
    let scales = [3.5, 1.4, 47.0, 4e-3, 2.2e-7, 123_456.0, 0.02, 0.9];
    let mut draws = vec![Vec::new(); n];
    for _ in 0..5_000 {
        let common = normal(rng);
        for (i, column) in draws.iter_mut().enumerate() {
            column.push(scales[i] * (1.0 + 0.03 * (0.9 * common + 0.7 * normal(rng))));
        }
    }
    let parameters = (0..n).map(|i| column(names[i], names[i], units[i], &draws[i])).collect();
    let posterior =
        Posterior { label: "a specimen with quite a long name, longer than the legend", colour: series(2), parameters };
    write_figure(dir, &format!("corner_{n}_parameters"), &corner(&[posterior], &CornerOptions::default())?)
}
