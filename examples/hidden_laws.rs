//! Simulates records of gels in which one quantity depends on a state. It has its own stepper and shares only the paper's numbers with the library.
//!
//! `hidden_laws DIRECTORY COUNT SEED [none]` writes COUNT experiments, each with its `truth.json`. With `none`, no quantity depends on a state. The classical
//! Runge–Kutta method integrates the law in steps of a millisecond, with the commanded force.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Displacement per force at unit creep compliance for the paper's sphere and ball, in 1/m: 1/(1.820902396 mm).
const COMPLIANCE_PER_M: f64 = 1.0 / 1.820_902_396e-3;
const STEP_S: f64 = 1e-3;
const ROW_S: f64 = 0.05;
const CYCLE_S: f64 = 10.0;
const N_CYCLES: usize = 4;
const LAW: [f64; 3] = [3.527, 1.402, 47.37];

/// SplitMix64 random number generator.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
    fn one_of<T: Copy>(&mut self, list: &[T]) -> T {
        list[(self.unit() * list.len() as f64) as usize]
    }
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (2.0 * std::f64::consts::PI * self.unit()).cos()
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Drive {
    Steps,
    Levels,
    Sine,
    Ramps,
}

/// Force at a time, in N.
fn force_n(drive: Drive, largest_n: f64, time_s: f64) -> f64 {
    let phase = (time_s / CYCLE_S).fract();
    let triangle = 1.0 - (4.0 * (phase - 0.25).rem_euclid(1.0) - 2.0).abs();
    largest_n
        * match drive {
            Drive::Steps => {
                if phase < 0.5 {
                    1.0
                } else {
                    -1.0
                }
            }
            Drive::Levels => [1.0, -0.5, 0.5, -1.0][(4.0 * phase) as usize % 4],
            Drive::Sine => (2.0 * std::f64::consts::PI * phase).sin(),
            Drive::Ramps => -triangle,
        }
}

/// Logarithm of the factor at u, the state divided by its largest size.
type Shape = dyn Fn(f64) -> f64;

fn shape(name: &str, random: &mut Random) -> Box<Shape> {
    let (a, b, c) = (random.unit(), random.unit(), random.unit());
    let even = random.unit() < 0.5;
    let of = move |u: f64| if even { u.abs() } else { u };
    match name {
        "line" => Box::new(of),
        "square" => Box::new(|u| u * u),
        "saturation" => Box::new(move |u| u.signum() * (1.0 - (-u.abs() / (0.1 + 0.3 * a)).exp())),
        "kink" => Box::new(move |u| (u.abs() - (0.2 + 0.4 * a)).max(0.0)),
        "bump" => Box::new(move |u| {
            let (centre, width) = (0.3 + 0.4 * a, 0.15 + 0.2 * b);
            (-((u.abs() - centre) / width).powi(2)).exp() - (-(centre / width).powi(2)).exp()
        }),
        "two-state" => Box::new(move |u| {
            let (centre, width) = (0.3 + 0.4 * a, 0.05 + 0.1 * b);
            0.5 * (((u.abs() - centre) / width).tanh() + (centre / width).tanh())
        }),
        _ => Box::new(move |u| {
            let wave = |k: f64, phase: f64| (k * 3.1 * u + 6.3 * phase).sin() - (6.3 * phase).sin();
            u + 0.5 * (a - 0.5) * wave(1.0, b) + 0.3 * (c - 0.5) * wave(2.0, a)
        }),
    }
}

struct Hidden<'a> {
    /// Size of the factor's logarithm.
    strength: f64,
    shape: &'a Shape,
    /// Largest size of the state without the dependence.
    size: f64,
}

/// Returns the position (m) and the state at every row.
fn run(
    law: [f64; 3],
    drive: Drive,
    largest_n: f64,
    hidden: Option<&Hidden<'_>>,
    state: &str,
    quantity: &str,
) -> (Vec<f64>, Vec<f64>) {
    let n_rows = (N_CYCLES as f64 * CYCLE_S / ROW_S) as usize;
    let n_steps = (ROW_S / STEP_S).round() as usize;
    // Displacements of the law's two parts, divided by the compliance (N/Pa). Then the path length and the largest excursion of the robot (m).
    let mut y = [0.0_f64; 2];
    let (mut path, mut largest, mut step_at) = (0.0_f64, 0.0_f64, 0.0);
    let mut before_n = force_n(drive, largest_n, 0.0);
    let (mut positions, mut states) = (Vec::new(), Vec::new());
    let c = COMPLIANCE_PER_M;
    let threshold = 0.2 * 2.0 * largest_n;
    for row in 0..n_rows {
        let value = |y: &[f64; 2], path: f64, largest: f64, t: f64, f: f64, v: f64, since: f64| match state {
            "position" => c * (y[0] + y[1]),
            "path" => path,
            "time" => t,
            "time_since_step" => since,
            "velocity" => v,
            "force" => f,
            "largest_excursion" => largest,
            _ => c * if quantity == "viscosity_2_pa_s" { y[1] } else { y[0] },
        };
        let factor = |s: f64| hidden.map_or(1.0, |hidden| (hidden.strength * (hidden.shape)(s / hidden.size)).exp());
        // Rates of the two displacements at time `t`. If the state is the velocity, an iteration finds it.
        let rates = |y: &[f64; 2], path: f64, largest: f64, t: f64, since: f64| -> [f64; 2] {
            let f = force_n(drive, largest_n, t);
            let mut v = 0.0;
            let mut out = [0.0; 2];
            for _ in 0..if state == "velocity" { 60 } else { 1 } {
                let hidden_factor = factor(value(y, path, largest, t, f, v, since));
                let times = |name: &str| if quantity == name { hidden_factor } else { 1.0 };
                let s = f * times("force");
                out = [
                    (s - law[0] * times("young_modulus_pa") * y[0]) / (law[1] * times("viscosity_1_pa_s")),
                    s / (law[2] * times("viscosity_2_pa_s")),
                ];
                v = 0.5 * v + 0.5 * c * (out[0] + out[1]);
            }
            out
        };
        let t = row as f64 * ROW_S;
        let v = {
            let r = rates(&y, path, largest, (t - 1e-9).max(0.0), t - step_at);
            c * (r[0] + r[1])
        };
        positions.push(c * (y[0] + y[1]));
        states.push(value(&y, path, largest, t, force_n(drive, largest_n, (t - 1e-9).max(0.0)), v, t - step_at));
        for step in 0..n_steps {
            // Both times lie slightly inside the step, so that the force is the force of this step.
            let (from, to) = (t + step as f64 * STEP_S + 1e-9, t + (step + 1) as f64 * STEP_S - 1e-9);
            let now_n = force_n(drive, largest_n, from);
            if matches!(drive, Drive::Steps | Drive::Levels) && (now_n - before_n).abs() > threshold {
                step_at = from;
            }
            before_n = now_n;
            let add = |y: &[f64; 2], k: &[f64; 2], h: f64| [y[0] + h * k[0], y[1] + h * k[1]];
            let (middle, h) = (0.5 * (from + to), STEP_S);
            let moved = |y2: &[f64; 2]| (c * (y2[0] + y2[1]) - c * (y[0] + y[1])).abs();
            let at = |y2: &[f64; 2]| (c * (y2[0] + y2[1])).abs().max(largest);
            let k1 = rates(&y, path, largest, from, from - step_at);
            let y2 = add(&y, &k1, 0.5 * h);
            let k2 = rates(&y2, path + moved(&y2), at(&y2), middle, middle - step_at);
            let y3 = add(&y, &k2, 0.5 * h);
            let k3 = rates(&y3, path + moved(&y3), at(&y3), middle, middle - step_at);
            let y4 = add(&y, &k3, h);
            let k4 = rates(&y4, path + moved(&y4), at(&y4), to, to - step_at);
            let next = [0, 1].map(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
            path += moved(&next);
            largest = at(&next);
            y = next;
        }
    }
    (positions, states)
}

/// Correlation time of slow noise in s, and standard deviation of the cycles' gains.
const SLOW_S: f64 = 1.0;
const GAIN_SD: f64 = 0.01;

/// Norm of residuals under the record's kind of noise, in standard deviations. `left_m` holds the residuals and `positions_m` the positions, in m. Slow noise
/// and gains hide more of the residuals than white noise of the stated size.
fn under_own_noise(noise: &str, left_m: &[f64], positions_m: &[f64], sigma_m: f64) -> f64 {
    let squares = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>() / (sigma_m * sigma_m);
    match noise {
        "ou" => {
            let keep = (-ROW_S / SLOW_S).exp();
            // Mean and variance of the process in units of σ, given the rows before.
            let (mut mean, mut variance, mut sum) = (0.0, 1.0, 0.0);
            for left in left_m.iter().map(|left| left / sigma_m) {
                let total = variance + 1.0;
                sum += (left - mean) * (left - mean) / total;
                mean = keep * (mean + variance / total * (left - mean));
                variance = keep * keep * variance / total + 1.0 - keep * keep;
            }
            sum.sqrt()
        }
        "gain" => {
            let per_cycle = (CYCLE_S / ROW_S) as usize;
            let of_cycle = |(left, x): (&[f64], &[f64])| {
                let dot = left.iter().zip(x).map(|(a, b)| a * b).sum::<f64>() / (sigma_m * sigma_m);
                squares(left) - dot * dot / (squares(x) + GAIN_SD.powi(-2))
            };
            left_m.chunks(per_cycle).zip(positions_m.chunks(per_cycle)).map(of_cycle).sum::<f64>().sqrt()
        }
        _ => squares(left_m).sqrt(),
    }
}

/// Residuals (m) of the best fit of a law without a hidden dependence, by the Gauss–Newton method with finite differences.
fn left_by_base(drive: Drive, largest_n: f64, positions: &[f64]) -> Vec<f64> {
    let mut log = LAW.map(f64::ln);
    let at = |log: &[f64; 3]| run(log.map(f64::exp), drive, largest_n, None, "position", "force").0;
    let mut residual = Vec::new();
    for _ in 0..6 {
        let here = at(&log);
        residual = positions.iter().zip(&here).map(|(x, y)| x - y).collect();
        let columns: Vec<Vec<f64>> = (0..3)
            .map(|k| {
                let mut moved = log;
                moved[k] += 1e-4;
                at(&moved).iter().zip(&here).map(|(a, b)| (a - b) / 1e-4).collect()
            })
            .collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let mut m = [[0.0; 4]; 3];
        for i in 0..3 {
            (0..3).for_each(|j| m[i][j] = dot(&columns[i], &columns[j]));
            m[i][3] = dot(&columns[i], &residual);
        }
        for i in 0..3 {
            for j in i + 1..3 {
                let factor = m[j][i] / m[i][i];
                (i..4).for_each(|k| m[j][k] -= factor * m[i][k]);
            }
        }
        let mut step = [0.0; 3];
        for i in (0..3).rev() {
            step[i] = (m[i][3] - (i + 1..3).map(|j| m[i][j] * step[j]).sum::<f64>()) / m[i][i];
            log[i] += step[i].clamp(-0.5, 0.5);
        }
    }
    residual
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, directory, count, seed, rest @ ..] = &arguments[..] else {
        eprintln!("usage: hidden_laws DIRECTORY COUNT SEED [none]");
        std::process::exit(2);
    };
    let (count, seed): (usize, u64) = (count.parse().expect("a count"), seed.parse().expect("a seed"));
    let nothing = rest.first().is_some_and(|word| word == "none");
    let quantities = ["force", "young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s"];
    let states = ["position", "path", "time", "time_since_step", "velocity", "force", "largest_excursion", "strain"];
    let shapes = ["line", "square", "saturation", "kink", "bump", "two-state", "wave"];
    let (mut made, mut number) = (0, 0);
    while made < count {
        number += 1;
        let random = &mut Random(seed.wrapping_mul(1_000_003).wrapping_add(number));
        let drive =
            random.one_of(&[Drive::Steps, Drive::Steps, Drive::Levels, Drive::Levels, Drive::Sine, Drive::Ramps]);
        let noise = random.one_of(&["white", "ou", "gain", "outliers"]);
        let (quantity, state) = (random.one_of(&quantities), random.one_of(&states));
        let name = random.one_of(&shapes);
        let shape = shape(name, random);
        let sigma_m = random.between(2e-6, 6e-6);
        let target = random.between(10.0, 80.0);
        let sign = random.one_of(&[-1.0, 1.0]);
        let largest_n = 4.6e-6 * random.between(0.3, 1.0);
        if quantity == "force" && state == "strain"
            || state == "time_since_step" && matches!(drive, Drive::Sine | Drive::Ramps)
        {
            continue;
        }
        let (mut positions, mut states_at) = run(LAW, drive, largest_n, None, state, quantity);
        let size = states_at.iter().fold(0.0_f64, |size, s| size.max(s.abs()));
        let (mut strength, mut seen_sigma) = (0.0, 0.0);
        if !nothing {
            // The strength is adjusted until the residuals of the base's best fit have the requested signal.
            let (mut low, mut high) = (0.0, 0.05);
            let mut found = None;
            for _ in 0..12 {
                let trial = if found.is_some() { 0.5 * (low + high) } else { high };
                let hidden = Hidden { strength: sign * trial, shape: &*shape, size };
                let (x, s) = run(LAW, drive, largest_n, Some(&hidden), state, quantity);
                let left_m = left_by_base(drive, largest_n, &x);
                let z = under_own_noise("white", &left_m, &x, sigma_m);
                let is_sound = x.iter().all(|x| x.abs() < 2e-3);
                if !is_sound || z > target * 1.1 {
                    high = trial;
                    found = found.or(Some(()));
                    low = low.min(high);
                } else if z < target * 0.9 {
                    low = trial;
                    if found.is_none() {
                        high = 2.0 * trial;
                    }
                } else {
                    strength = sign * trial;
                    seen_sigma = under_own_noise(noise, &left_m, &x, sigma_m);
                    (positions, states_at) = (x, s);
                    break;
                }
                if trial > 3.0 {
                    break;
                }
            }
            if strength == 0.0 {
                continue;
            }
        }
        let place = Path::new(directory).join(format!("law-{made:03}"));
        fs::create_dir_all(&place).expect("a directory");
        let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
        let mut slow = sigma_m * random.normal();
        let keep = (-ROW_S / SLOW_S).exp();
        let mut gain = 0.0;
        let (mut squares, mut n_last) = (0.0, 0);
        let per_cycle = (CYCLE_S / ROW_S) as usize;
        for (row, x) in positions.iter().enumerate() {
            let cycle = row / per_cycle;
            if row % per_cycle == 0 {
                gain = GAIN_SD * random.normal();
            }
            slow = keep * slow + (1.0 - keep * keep).sqrt() * sigma_m * random.normal();
            let mut error = sigma_m * random.normal();
            match noise {
                "ou" => error += slow,
                "gain" => error += gain * x,
                "outliers" if random.unit() < 0.01 => error += 15.0 * sigma_m * random.normal().signum(),
                _ => {}
            }
            if row == 0 {
                error = 0.0;
            }
            if cycle + 1 == N_CYCLES && error.abs() < 8.0 * sigma_m {
                squares += error * error;
                n_last += 1;
            }
            let t = row as f64 * ROW_S;
            writeln!(
                csv,
                "{t:.3},{:.9},{:.5},{}",
                1e6 * force_n(drive, largest_n, t + 1e-9),
                1e6 * (x + error),
                cycle + 1
            )
            .expect("a text");
        }
        fs::write(place.join("trajectory.csv"), csv).expect("a file");
        let rule = if matches!(drive, Drive::Sine | Drive::Ramps) { "linear" } else { "hold" };
        let toml = format!(
            "[specimen]\nid = \"law-{made:03}\"\n[robot]\nshape = \"sphere\"\ndiameter_mm = 0.55\ndensity_kg_m3 = 7500\n[vitreous]\ndiameter_mm = 20.0\npoisson_ratio = 0.48\ndensity_kg_m3 = 1000\n[measurement]\nfile = \"trajectory.csv\"\nforce = \"{rule}\"\nnoise_um = {:.3}\nsource = \"synthetic\"\n",
            1e6 * sigma_m
        );
        fs::write(place.join("experiment.toml"), toml).expect("a file");
        let row = |row: usize| format!("[{:e}, {:e}]", states_at[row], (strength * shape(states_at[row] / size)).exp());
        let rows: Vec<String> = (0..positions.len()).step_by(5).map(row).collect();
        let (q, s) = if nothing { ("none", "none") } else { (quantity, state) };
        let truth = format!(
            "{{\"quantity\":\"{q}\",\"state\":\"{s}\",\"shape\":\"{name}\",\"noise\":\"{noise}\",\"drive\":\"{rule}\",\"signal_sigma\":{target:.1},\"seen_sigma\":{seen_sigma:.1},\"true_noise_um\":{:.4},\"factors\":[{}]}}\n",
            1e6 * (squares / f64::from(n_last)).sqrt(),
            rows.join(",")
        );
        fs::write(place.join("truth.json"), truth).expect("a file");
        made += 1;
    }
}
