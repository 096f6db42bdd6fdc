//! Records on an instrument, as subjects for tests of this crate and of crates that depend on it.

use criticism::{Candidate, Fitted, NoiseValues, Subject};
use models::effects::Library;
use posterior::monitor::SilentMonitor;
use posterior::problem::Problem;
use posterior::study::ModelSpecification;
use record::{Apparatus, Experiment, Record};

/// White noise of 4 µm, a process of 2 µm with a correlation time of 0.8 s, gains of 0.5 % and offsets of 1 µm.
pub const NOISE: NoiseValues = NoiseValues::new([4.0, 2.0, 0.8, 0.005, 1.0]);
const INTERVAL_S: f64 = 0.1;

/// Returns a record on an instrument. Each cycle is a list of forces in µN, held for 5 s each.
pub fn record(cycles: &[&[f64]]) -> Record {
    let mut record = Record::default();
    for (cycle, force_un) in
        cycles.iter().enumerate().flat_map(|(cycle, forces)| forces.iter().map(move |f| (cycle, f)))
    {
        for _ in 0..50 {
            let row = record.time_s.len();
            record.time_s.push(INTERVAL_S * row as f64);
            record.force_n.push(1e-6 * force_un);
            record.position_m.push(Some(1e-6 * (row % 800) as f64));
            record.cycle.push(cycle as u32 + 1);
        }
    }
    record
}

/// Returns a subject with these cycles and a library; the base has the given effects. The last cycle is scored.
pub fn subject_with(cycles: &[&[f64]], library: &Library, effects: &[&str]) -> Subject {
    let last = cycles.len() as u32;
    let experiment = Experiment {
        specimen_id: "instrument".into(),
        species: None,
        region: None,
        apparatus: Apparatus::Instrument { compliance_per_m: 549.0, is_stress_strain: false },
        record: record(cycles),
        calibration_cycles: (1..last).collect(),
        heldout_cycles: vec![last],
        noise_sd_m: Some(4e-6),
        fits_position_offset: false,
        source: "synthetic".into(),
        control: record::Control::Force,
        largest_strain: None,
    };
    let effects = effects.iter().map(|slug| slug.to_string()).collect();
    let specification = ModelSpecification { effects, ..ModelSpecification::default() };
    let problem = Problem::new(experiment, specification, None, &SilentMonitor).expect("a sound experiment");
    Subject::new(&problem, library, None, &SilentMonitor).expect("a sound problem")
}

/// The paper's protocol: one force level.
pub const ONE_LEVEL: [&[f64]; 4] = [&[4.6, -4.6]; 4];
pub const TWO_LEVELS: [&[f64]; 4] = [&[4.6, -4.6], &[2.3, -2.3], &[4.6, -4.6], &[2.3, -2.3]];

/// Returns a model with given values of the effects' parameters; the law's parameters are at the middle of their priors.
pub fn at(subject: &Subject, effects: &[&str], values: &[f64]) -> (Candidate, Fitted) {
    let candidate = subject.extended(effects).expect("effects of the library");
    let mut theta: Vec<f64> = candidate.free.iter().map(|free| free.quantile(0.5)).collect();
    let n_law = theta.len() - values.len();
    for (k, value) in values.iter().enumerate() {
        theta[n_law + k] = candidate.free[n_law + k].coordinate.theta(*value);
    }
    let position_m = subject.trajectory_m(&candidate, &theta).expect("a model");
    (candidate, Fitted { theta, noise: NOISE, position_m, objective: 0.0, ln_likelihood: 0.0 })
}
