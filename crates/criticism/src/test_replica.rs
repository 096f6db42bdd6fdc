//! The embedded replica as a subject, for tests.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::OnceLock;

use super::{Candidate, Fitted, Search, Subject};
use crate::NoiseValues;
use models::effects::{EFFECTS, Library};
use posterior::monitor::SilentMonitor;
use posterior::problem::Problem;
use posterior::replica::embedded;
use posterior::study::ModelSpecification;

/// Returns the replica with every effect that keeps the displacement field, prepared once. The reduced models of other effects take longer to train than all tests that
/// would use them.
pub fn replica() -> &'static Subject {
    static SUBJECT: OnceLock<Subject> = OnceLock::new();
    SUBJECT.get_or_init(|| {
        let quick = EFFECTS.iter().filter(|effect| effect.field().is_none()).map(|effect| effect.slug());
        replica_with(&Library::only(&quick.collect::<Vec<_>>()))
    })
}

/// Returns the replica with a selection of effects.
pub fn replica_with(library: &Library) -> Subject {
    let (experiment, _) = embedded().expect("embedded");
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("sound");
    Subject::new(&problem, library, None, &SilentMonitor).expect("sound")
}

/// White noise of 4 µm with hardly any other term.
pub const WHITE: NoiseValues = NoiseValues::new([4.0, 1e-2, 1.0, 1e-5, 1e-2]);

/// Returns the base model of the replica and its fit.
pub fn base_fit() -> (Candidate, Fitted) {
    let base = replica().base();
    let fitted = replica().fit(&base, &[], Search::Wide).expect("fits");
    (base, fitted)
}

/// Returns a subject with the replica's protocol and simulated positions: those of a candidate at the coordinates `theta`, with noise.
pub fn simulated(candidate: &Candidate, theta: &[f64], noise: &NoiseValues, seed: u64) -> Subject {
    simulated_in(replica(), candidate, theta, noise, seed)
}

/// Returns a subject with simulated positions as [`simulated`] does, but with the effects of `subject`.
pub fn simulated_in(
    subject: &Subject,
    candidate: &Candidate,
    theta: &[f64],
    noise: &NoiseValues,
    seed: u64,
) -> Subject {
    let record = &subject.experiment().record;
    let position_m = subject.trajectory_m(candidate, theta).expect("a model");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise_m = subject.noise().simulate_m(&record.time_s, &record.cycle, &position_m, noise, &mut rng);
    let noisy: Vec<f64> = position_m.iter().zip(&noise_m).map(|(x, e)| x + e).collect();
    subject.with_positions(&noisy)
}
