//! Subjects and data shared by the tests of this crate.

use criticism::{NoiseValues, Subject};
use models::effects::Library;
use posterior::monitor::SilentMonitor;
use posterior::problem::Problem;
use posterior::replica::{TABLE_I, embedded};
use posterior::study::ModelSpecification;
use rand::SeedableRng;
use record::Apparatus;
use sampling::ensemble::RandomStream;

/// Protocols used by tests.
#[derive(Debug, Clone, Copy)]
pub enum Protocol {
    /// The replica's protocol: four cycles of 5 s at +4.6 µN and 5 s at −4.6 µN, 20 rows a second.
    Paper,
    /// Five cycles of three force levels with rests between them, after an initial rest of 1 s.
    Levels,
}

impl Protocol {
    /// Returns a subject with the paper's force in many short cycles of `rows_each` rows, 0.2 s apart. The last cycle is held out.
    pub fn many_cycles(n_cycles: usize, rows_each: usize) -> Subject {
        let (mut experiment, _) = embedded().expect("embedded");
        experiment.apparatus = Apparatus::Instrument { compliance_per_m: 549.178, is_stress_strain: false };
        let n_rows = n_cycles * rows_each;
        let record = &mut experiment.record;
        record.time_s = (0..n_rows).map(|row| 0.2 * row as f64).collect();
        record.force_n =
            (0..n_rows).map(|row| if row % rows_each < rows_each / 2 { 4.6e-6 } else { -4.6e-6 }).collect();
        record.cycle = (0..n_rows).map(|row| 1 + (row / rows_each) as u32).collect();
        record.position_m = (0..n_rows).map(|row| Some(1e-4 * (0.6 * row as f64).sin())).collect();
        experiment.calibration_cycles = (1..n_cycles as u32).collect();
        experiment.heldout_cycles = vec![n_cycles as u32];
        let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("sound");
        Subject::new(&problem, &Library::default(), None, &SilentMonitor).expect("sound")
    }
}

/// Returns a subject on an instrument with the replica's stiffness. An instrument needs no finite elements.
pub fn subject(protocol: Protocol) -> Subject {
    let (mut experiment, _) = embedded().expect("embedded");
    experiment.apparatus = Apparatus::Instrument { compliance_per_m: 549.178, is_stress_strain: false };
    if let Protocol::Levels = protocol {
        let record = &mut experiment.record;
        let levels = [0.5, 0.0, -1.0, 0.0, 1.0, 0.0].map(|level| level * 4.6e-6);
        let n_rows = 1000;
        record.time_s = (0..n_rows).map(|row| 0.05 * row as f64).collect();
        record.force_n =
            (0..n_rows).map(|row: usize| row.checked_sub(20).map_or(0.0, |row| levels[row % 196 / 33])).collect();
        record.cycle = (0..n_rows).map(|row: usize| 1 + (row.saturating_sub(20) / 196) as u32).collect();
        record.position_m = vec![Some(0.0); n_rows];
        experiment.calibration_cycles = vec![1];
        experiment.heldout_cycles = vec![2, 3, 4, 5];
        experiment.noise_sd_m = Some(4e-6);
        // Default priors scale with the range of positions.
        let problem =
            Problem::new(experiment.clone(), ModelSpecification::default(), None, &SilentMonitor).expect("sound");
        let subject = Subject::new(&problem, &Library::default(), None, &SilentMonitor).expect("sound");
        experiment.record.position_m = truth_of(&subject, &[], &[]).into_iter().map(Some).collect();
    }
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("sound");
    Subject::new(&problem, &Library::default(), None, &SilentMonitor).expect("sound")
}

/// Positions (m) of the law with the parameters of the paper's Table I. `sizes` are the effects' parameters, in the order of the model's parameters.
pub fn truth_of(subject: &Subject, effects: &[&str], sizes: &[f64]) -> Vec<f64> {
    let candidate = subject.extended(effects).expect("a model");
    let values: Vec<f64> = TABLE_I.iter().chain(sizes).copied().collect();
    let theta: Vec<f64> = candidate.free.iter().map(|free| free.coordinate.theta(values[free.index])).collect();
    subject.trajectory_m(&candidate, &theta).expect("a model")
}

/// Random parameters of an effect, uniform over the quantiles of their priors.
pub fn random_sizes(subject: &Subject, effect: &str, seed: u64) -> Vec<f64> {
    let candidate = subject.extended(&[effect]).expect("a model");
    let mut stream = RandomStream::new(4711, seed);
    let of_effect = candidate.free.iter().filter(|free| free.effect.is_some());
    of_effect.map(|free| free.coordinate.value(free.quantile(0.02 + 0.96 * stream.unit()))).collect()
}

/// Simulated noise (m) around positions (m). `noise` has white and slow standard deviation (µm), correlation time (s), gain, and offset (µm).
pub fn noise_of(subject: &Subject, position_m: &[f64], noise: &NoiseValues, seed: u64) -> Vec<f64> {
    let record = &subject.experiment().record;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    subject.noise().simulate_m(&record.time_s, &record.cycle, position_m, noise, &mut rng)
}
