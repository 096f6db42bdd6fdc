//! Changes of the protocol that would separate models that an experiment cannot distinguish.
//!
//! Changed protocols come from the user's own protocol ([`record::protocol_change`]). For each changed protocol, the reduced model computes the noise-free data of every model at its fitted
//! size. The other models are fitted to these data ([`super::separation`]). Refits of simulated, noisy repetitions confirm the protocol with the largest separation.

mod degeneracies;
pub mod design;
mod family;
mod farthest;
mod sought;

pub use degeneracies::{Degeneracy, exact_degeneracies};
pub use family::{DesignLimits, DesignedDrive, ForceDirections};
pub use sought::{Sought, SoughtEffect};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use self::farthest::{ANY, UnderProtocol, farthest};
use super::separation::SEPARATED_SIGMA;
use super::{Candidate, Fitted, Search, Subject};
use crate::NoiseValues;
use base::error::{Error, Result};
use record::protocol_change::{Change, changes};
use record::{Experiment, Record};

/// Lead (nats) at which a model rejects another in a simulated repetition.
pub const REJECTED_NATS: f64 = 4.0;

/// Advice on a change of the protocol.
#[derive(Debug, Clone)]
pub struct Advice {
    /// Change that separates the models best among all tried changes.
    pub change: Change,
    /// Slugs of the two closest models under the changed protocol.
    pub closest: [String; 2],
    /// Distance (σ) of the closest models in the current experiment.
    pub separation_now: f64,
    /// Distance (σ) of the closest models under the changed protocol.
    pub separation: f64,
    /// Number of simulated repetitions in which every wrong model was rejected by more than 4 nats.
    pub n_right: usize,
    /// Number of simulated repetitions. The first model and the one closest to it alternate as the truth.
    pub n_repeats: usize,
    /// The advice, as a sentence.
    pub sentence: String,
}

impl Advice {
    /// Returns whether the changed protocol is expected to separate the models.
    pub fn separates(&self) -> bool {
        self.separation >= SEPARATED_SIGMA
    }
}

/// Models of the mean position with their fits, the leading model first. No model has columns of free amplitude.
pub type Members<'a> = [(&'a Candidate, &'a Fitted)];

/// Finds the change of the protocol that best separates the first model from the others, at their fitted sizes and with the first model's noise. The change is confirmed
/// by `n_repeats` simulated repetitions with random streams of `seed`. `None` if there are fewer than two models or no change can be made.
///
/// # Errors
/// [`Error::Numerical`] if a model has free columns, which belong to one record, or cannot be fitted to another's data.
pub fn find_best_change(subject: &Subject, members: &Members, n_repeats: usize, seed: u64) -> Result<Option<Advice>> {
    // The changed protocols press and pull, but an indenter's law is valid only while the contact grows.
    if members.len() < 2 || subject.experiment().scales().depth_exponent.is_some() {
        return Ok(None);
    }
    if let Some((candidate, _)) = members.iter().find(|(candidate, _)| !candidate.columns.is_empty()) {
        return Err(Error::numerical(
            format!(
                "the columns added to the model with {} are valid for this record only",
                candidate.effects.join(", ")
            ),
            "compare models without columns",
        ));
    }
    let now = UnderProtocol::new(subject.clone(), members);
    let pairs = now.pairs();
    let now = now.separation()?;
    let tried = changes(&subject.experiment().record, subject.experiment().scales().hold_s);
    let under = |change: Change| {
        let changed = changed(subject, &change.record)?;
        Ok((change, UnderProtocol::new(changed, members)))
    };
    let tried: Vec<(Change, UnderProtocol)> = tried.into_iter().map(under).collect::<Result<_>>()?;
    let n_tried = tried.len();
    // A model at its fitted size may have no trajectory under another protocol, such as a force gradient under longer holds. Such changes are skipped.
    let best = farthest(tried, &pairs, ANY, |(_, models), pair| Ok(models.closest_point(pair)?.distance))?;
    let Some((then, (change, models))) = best.into_iter().next() else { return Ok(None) };
    let n_right = n_right(&models, then.other, (n_repeats, seed))?;
    let name = |place: usize| members[place].0.effects.join(" + ");
    let mut advice = Advice {
        change,
        closest: [name(0), name(then.other)],
        separation_now: now.distance,
        separation: then.distance,
        n_right,
        n_repeats,
        sentence: String::new(),
    };
    advice.sentence = sentence(&advice, n_tried);
    Ok(Some(advice))
}

fn sentence(advice: &Advice, n_tried: usize) -> String {
    let Advice { separation_now: now, separation: then, n_right, n_repeats, .. } = advice;
    let [a, b] = &advice.closest;
    let instruction = &advice.change.instruction;
    if advice.separates() {
        format!(
            "{instruction}: the distance of {a} and {b} would then be {then:.1} σ instead of {now:.1} (the true model is recognised in {n_right} of {n_repeats} simulated repeats)."
        )
    } else {
        let mut letters = instruction.chars();
        let small: String = letters.next().into_iter().flat_map(char::to_lowercase).chain(letters).collect();
        format!(
            "None of {n_tried} changes of the protocol would separate {a} from {b} at this size. The best is to {small}, with a distance of {then:.1} σ instead of {now:.1} (the true model is recognised in {n_right} of {n_repeats} simulated repeats)."
        )
    }
}

/// Returns the subject of a changed protocol. Apparatus, noise, and the choice of fitted and scored cycles are those of `subject`.
fn changed(subject: &Subject, record: &Record) -> Result<Subject> {
    let Experiment { calibration_cycles, heldout_cycles, .. } = subject.experiment();
    under_protocol(subject, record, calibration_cycles, heldout_cycles)
}

/// Returns the subject of a protocol with the given fitted and scored cycles. Apparatus and noise are those of `subject`.
fn under_protocol(subject: &Subject, record: &Record, fitted: &[u32], scored: &[u32]) -> Result<Subject> {
    let range_m = subject.experiment().scales().position_range_m;
    // Placeholder positions cover the measured range, which scales priors of effects.
    let places = (0..record.n_rows()).map(|row| Some(range_m * row as f64 / record.n_rows() as f64)).collect();
    let experiment = Experiment {
        record: Record { position_m: places, ..record.clone() },
        noise_sd_m: Some(subject.reference_noise_m()),
        calibration_cycles: fitted.to_vec(),
        heldout_cycles: scored.to_vec(),
        ..subject.experiment().clone()
    };
    let problem = subject.problem().with_experiment(experiment, subject.specification().clone(), subject.library())?;
    Subject::with_compliance(&problem, subject.library(), subject.compliance().clone())
}

/// Counts the simulated repetitions in which the truth leads every other model by more than [`REJECTED_NATS`]. The truth is alternately the first model and `other`;
/// noise is estimated anew for each fit.
fn n_right(models: &UnderProtocol, other: usize, (n_repeats, seed): (usize, u64)) -> Result<usize> {
    let truths = [starts(models, 0)?, starts(models, other)?];
    let is_right = |repeat: usize| is_right(models, &truths[repeat % 2], (seed, repeat));
    let right: Result<Vec<bool>> = (0..n_repeats).into_par_iter().map(is_right).collect();
    Ok(right?.into_iter().filter(|right| *right).count())
}

/// Returns whether a truth leads every other model by more than [`REJECTED_NATS`] in one repetition.
fn is_right(models: &UnderProtocol, truth: &RepeatTruth, (seed, repeat): (u64, usize)) -> Result<bool> {
    let (subject, members) = (&models.subject, models.members);
    let noise = members[0].1.noise;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(repeat as u64);
    let data = subject.with_positions(&truth.with_noise(subject, noise, &mut random));
    let objective = |place: usize| -> Result<f64> {
        let also = [(truth.thetas[place].clone(), noise)];
        Ok(data.fit(members[place].0, &also, Search::Local)?.objective)
    };
    let value = objective(truth.place)?;
    let mut others: Vec<usize> = (0..members.len()).filter(|place| *place != truth.place).collect();
    // One model that is not rejected decides, so those that take long come last.
    others.sort_by_key(|place| members[*place].0.is_slow());
    for place in others {
        if value - objective(place)? <= REJECTED_NATS {
            return Ok(false);
        }
    }
    Ok(true)
}

/// A model that is the truth of simulated repetitions.
struct RepeatTruth {
    place: usize,
    position_m: Vec<f64>,
    /// Coordinates of each model at its point closest to the truth.
    thetas: Vec<Vec<f64>>,
}

impl RepeatTruth {
    /// Returns positions (m) of the truth with one draw of noise.
    fn with_noise(&self, subject: &Subject, noise: NoiseValues, random: &mut ChaCha8Rng) -> Vec<f64> {
        let record = &subject.experiment().record;
        let recordings = subject.problem().recordings();
        let drawn_m = subject.noise().simulate_m(&record.time_s, &recordings, &self.position_m, &noise, random);
        self.position_m.iter().zip(drawn_m).map(|(x, noise)| x + noise).collect()
    }
}

fn starts(models: &UnderProtocol, place: usize) -> Result<RepeatTruth> {
    let members = models.members;
    let theta = |at: usize| {
        if at == place { Ok(members[place].1.theta.clone()) } else { Ok(models.closest_point([place, at])?.theta) }
    };
    let thetas = (0..members.len()).into_par_iter().map(theta).collect::<Result<_>>()?;
    Ok(RepeatTruth { place, position_m: models.position_m(place)?.to_vec(), thetas })
}

#[cfg(test)]
mod change_tests;
#[cfg(test)]
mod tests;
