//! Records that contradict their description in one way each, and records that do not. The simulator shares nothing with the models.
//!
//! A bead in a gel is a delayed spring and a dashpot, stepped exactly between switches at arbitrary times. Then the faults of tracker, clock and laboratory are applied.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vitreo_uq::record::{Experiment, ExperimentFiles};

/// Kinds of faults, by the names that `check` uses.
pub const KINDS: [&str; 13] = [
    "force_between_rows",
    "against_force",
    "zero_off",
    "leaves_its_container",
    "size_of_the_answer",
    "noise_above_motion",
    "time_unit",
    "few_rows_in_a_retardation_time",
    "drift_at_rest",
    "clipped_positions",
    "repeated_positions",
    "switch_between_rows",
    "zero_is_a_row",
];

/// Number of effects that a record may have without contradicting its description.
const HIDDEN: usize = 12;

/// Deviations of a load from its log, and of a gel from its law.
#[derive(Default)]
struct Beside {
    /// Time in s by which a force acts before its row, and its lag.
    early_s: f64,
    lag_s: f64,
    /// Instantaneous displacement per force, in µm/µN.
    jump: f64,
    /// Fraction by which backward forces are smaller, and a constant force in µN.
    asymmetry: f64,
    bias_un: f64,
}

struct Bead {
    /// Displacement per force of the delayed part in µm/µN, its time in s, and the flow in µm/(µN s).
    retarded: f64,
    time_s: f64,
    flow: f64,
}

impl Bead {
    fn drawn(rng: &mut impl Rng) -> Self {
        let spread = |rng: &mut dyn FnMut() -> f64, low: f64, high: f64| low * (high / low).powf(rng());
        let mut unit = || rng.random::<f64>();
        Self {
            retarded: spread(&mut unit, 15.0, 120.0),
            time_s: spread(&mut unit, 0.2, 1.2),
            flow: spread(&mut unit, 0.5, 6.0),
        }
    }
}

struct Row {
    time_s: f64,
    force_un: f64,
    position_um: Option<f64>,
}

/// A drive: force in µN at any time, with its switching times.
enum Drive {
    /// Pulls of one length in alternating directions, after a rest.
    Square { size_un: f64, half_s: f64, rest_s: f64 },
    /// A sampled curve.
    Sine { size_un: f64, period_s: f64 },
}

impl Drive {
    fn at(&self, t: f64) -> f64 {
        match self {
            Self::Square { size_un, half_s, rest_s } => {
                if t < rest_s - 1e-9 {
                    return 0.0;
                }
                let half = ((t - rest_s) / half_s + 1e-9).floor() as i64;
                if half % 2 == 0 { *size_un } else { -size_un }
            }
            Self::Sine { size_un, period_s } => size_un * (std::f64::consts::TAU * t / period_s).sin(),
        }
    }
}

/// Standard normal number by the Box–Muller method.
fn normal(rng: &mut impl Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// Positions of the bead at the rows' times, by steps of a fiftieth of a row.
fn motion(bead: &Bead, drive: &Drive, times: &[f64], beside: &Beside) -> Vec<f64> {
    let Beside { early_s, lag_s, jump, asymmetry, bias_un } = *beside;
    let (mut u, mut w, mut felt, mut positions) = (0.0_f64, 0.0_f64, 0.0_f64, Vec::new());
    for (row, t) in times.iter().enumerate() {
        positions.push(u + w + jump * felt);
        let Some(next) = times.get(row + 1) else { break };
        const STEPS: usize = 50;
        let dt = (next - t) / STEPS as f64;
        for k in 0..STEPS {
            let commanded = drive.at(t + (k as f64 + 0.5) * dt + early_s);
            let force = if commanded < 0.0 { commanded * (1.0 - asymmetry) } else { commanded } + bias_un;
            felt = if lag_s > 0.0 { force + (felt - force) * (-dt / lag_s).exp() } else { force };
            let goal = bead.retarded * felt;
            u = goal + (u - goal) * (-dt / bead.time_s).exp();
            w += bead.flow * felt * dt;
        }
    }
    positions
}

/// A record with the fault `wrong`, if any. The same seed gives the same record.
///
/// # Panics
/// If the library refuses the written files.
pub fn record(wrong: Option<&str>, seed: u64) -> (Experiment, ExperimentFiles) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let rng = &mut rng;
    let is = |kind: &str| wrong == Some(kind);
    let between = |rng: &mut ChaCha8Rng, low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let bead = Bead::drawn(rng);
    let mut interval_s = bead.time_s / between(rng, 3.0, 20.0);
    if is("few_rows_in_a_retardation_time") {
        interval_s = bead.time_s * between(rng, 1.5, 5.0);
    }
    let n_half = rng.random_range(40..120_usize);
    let n_halves = 2 * rng.random_range(2..5_usize);
    let n_rest = if is("drift_at_rest") { rng.random_range(15..60) } else { rng.random_range(0..3_usize) * 12 };
    let size_un = between(rng, 2.0, 8.0);
    let is_curve = is("force_between_rows") || (wrong.is_none() && rng.random_bool(0.2));
    let drive = if is_curve {
        Drive::Sine { size_un, period_s: interval_s * between(rng, 12.0, 60.0) }
    } else {
        let half_s = n_half as f64 * interval_s;
        Drive::Square { size_un, half_s, rest_s: n_rest as f64 * interval_s }
    };
    let n_rows = n_rest + n_half * n_halves;
    let times: Vec<f64> = (0..n_rows).map(|row| row as f64 * interval_s).collect();
    let hidden = if wrong.is_none() { rng.random_range(0..2 * HIDDEN) } else { HIDDEN };
    let mut beside = Beside::default();
    match hidden {
        0 => beside.lag_s = between(rng, 0.5, 2.0) * interval_s,
        8 => beside.jump = bead.retarded * between(rng, 0.03, 0.3),
        9 => beside.asymmetry = between(rng, 0.02, 0.1),
        // A constant force also moves the bead at rest, which is a drift that the check finds.
        10 if n_rest == 0 => beside.bias_un = size_un * between(rng, -0.05, 0.05),
        _ => {}
    }
    if is("switch_between_rows") {
        beside.early_s = between(rng, 0.3, 0.9) * interval_s;
    }
    let mut positions = motion(&bead, &drive, &times, &beside);
    let size_um = positions.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    let end_um = 0.85 * positions.iter().copied().fold(0.0, f64::max);
    // A missing feature must be visible in the complete record.
    let seen_um = if is("few_rows_in_a_retardation_time") { bead.retarded * size_un } else { size_um };
    // Some correct records are simulated without noise.
    let is_exact = wrong.is_none() && rng.random_bool(0.05);
    let noise_um = if is_exact { 0.0 } else { 1.0 }
        * seen_um
        * between(rng, 0.003, if is("switch_between_rows") { 0.006 } else { 0.02 });
    // Imperfections that laws and laboratories may have.
    let (part, period) = (between(rng, 0.02, 0.08), n_half as f64);
    for (row, x) in positions.iter_mut().enumerate() {
        let share = row as f64 / n_rows as f64;
        *x += match hidden {
            1 => part * size_um * share,
            2 => -part * size_um * share * share,
            3 => part * *x * (share * n_halves as f64 / 2.0).floor(),
            4 => part * *x * *x / size_um,
            5 => -part * *x * (*x / size_um).powi(2),
            6 => part * size_um * ((std::f64::consts::TAU * row as f64 / period).sin()) * share,
            7 => part * *x * (1.0 - (-share * 3.0).exp()),
            _ => 0.0,
        };
    }
    let colour = rng.random_range(0..3_u8);
    let mut slow = 0.0;
    let decay = (-1.0 / between(rng, 3.0, 40.0)).exp();
    for x in &mut positions {
        slow = decay * slow + (1.0 - decay * decay).sqrt() * normal(rng);
        *x += noise_um * normal(rng) + if colour == 1 { noise_um * slow } else { 0.0 };
        if colour == 2 && rng.random_bool(0.03) {
            *x += 10.0 * noise_um * normal(rng);
        }
    }
    let repeats = rng.random_range(2..4_usize);
    let offset_um =
        size_um * 0.2 * (2500.0_f64 / 20.0).powf(rng.random()) * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    let drift_um = noise_um * between(rng, 10.0, 50.0);
    let mut written = positions.clone();
    for (row, x) in written.iter_mut().enumerate() {
        *x = match wrong {
            Some("against_force") => -*x,
            Some("zero_off") => *x + offset_um,
            Some("leaves_its_container") => 1e3 * *x,
            Some("noise_above_motion") => 1e-3 * *x,
            Some("zero_is_a_row") => *x - positions[0],
            Some("clipped_positions") => x.min(end_um),
            Some("repeated_positions") => positions[row - row % repeats],
            Some("drift_at_rest") => *x + drift_um * row.min(n_rest) as f64 / n_rest as f64,
            _ => *x,
        };
    }
    let lost = if rng.random_bool(0.3) { 0.05 } else { 0.0 };
    let rows: Vec<Row> = times
        .iter()
        .zip(&written)
        .map(|(t, x)| {
            let is_seen = !rng.random_bool(lost) || is("zero_is_a_row") && *t == 0.0;
            Row { time_s: *t, force_un: drive.at(*t), position_um: is_seen.then_some(*x) }
        })
        .collect();
    let per_second = match wrong {
        Some("time_unit") if rng.random_bool(0.5) => 1e3,
        Some("time_unit") => 1e-3,
        _ => 1.0,
    };
    let per_un = if is("size_of_the_answer") { 1e-7 } else { 1.0 };
    let states_noise = is("noise_above_motion") || is("zero_is_a_row") || !is_exact && rng.random_bool(0.5);
    let rule = if is_curve && wrong.is_none() { "force = \"linear\"\n" } else { "" };
    let noise = if states_noise { format!("noise_um = {noise_um:.6}\n") } else { String::new() };
    let toml = format!(
        "[specimen]\nid = \"{}-{seed}\"\n[robot]\nshape = \"sphere\"\ndiameter_mm = 0.55\ndensity_kg_m3 = 7500\n[vitreous]\ndiameter_mm = 20.0\npoisson_ratio = 0.48\ndensity_kg_m3 = 1000\n[measurement]\nfile = \"t.csv\"\nsource = \"simulated\"\n{rule}{noise}",
        wrong.unwrap_or("sound")
    );
    let mut csv = String::from("time_s,force_uN,position_um\n");
    for Row { time_s, force_un, position_um } in rows {
        let position = position_um.map_or(String::new(), |x| format!("{x:.6}"));
        csv += &format!("{:.9},{:.12},{position}\n", per_second * time_s, per_un * force_un);
    }
    Experiment::from_texts("experiment.toml", toml, "t.csv", csv).expect("a record that can be read")
}
