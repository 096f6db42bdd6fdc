//! Changes of the protocol that would tell apart what an experiment cannot.
//!
//! Candidates come from the user's own protocol ([`changes`]). In each, the noise-free data of every model at its fitted size are computed by the reduced
//! model and fitted by the others ([`super::separation`]); the protocol that leaves them farthest apart is confirmed by refits of simulated, noisy repeats.

mod change;
mod degeneracies;

pub use change::{Change, changes};
pub use degeneracies::{Degeneracy, exact_degeneracies};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::separation::{SEPARATED_SIGMA, Truth, closest};
use super::{Candidate, Fitted, Search, Subject};
use crate::NoiseValues;
use base::error::{Error, Result};
use record::{Experiment, Record};

/// Lead in nats with which a model rejects another in a simulated repeat.
const REJECTED_NATS: f64 = 4.0;

/// What to change.
#[derive(Debug, Clone)]
pub struct Advice {
    /// The best change that was tried.
    pub change: Change,
    /// Slugs of the two models that stand closest in it.
    pub closest: [String; 2],
    /// Distance in σ of the closest models in the experiment at hand.
    pub separation_now: f64,
    /// The same in the changed protocol.
    pub separation: f64,
    /// Simulated repeats in which every wrong model was rejected by more than 4 nats.
    pub n_right: usize,
    /// Simulated repeats; the first model and the one closest to it take turns as the truth.
    pub n_repeats: usize,
    /// In plain words.
    pub sentence: String,
}

impl Advice {
    /// Whether the changed protocol is expected to separate the models.
    pub fn separates(&self) -> bool {
        self.separation >= SEPARATED_SIGMA
    }
}

/// Models of the mean with their fits, none with columns, the leading one first.
pub type Members<'a> = [(&'a Candidate, &'a Fitted)];

/// The change of the protocol that best tells the first of several models from the others, all at their fitted sizes and with the first's noise, confirmed by
/// `n_repeats` simulated repeats with streams of `seed`. `None` with fewer than two models or where no change can be made.
///
/// # Errors
/// [`Error::Numerical`] where a model has free columns, which belong to one record, or cannot be fitted to another's data.
pub fn advise(subject: &Subject, members: &Members, n_repeats: usize, seed: u64) -> Result<Option<Advice>> {
    // Changes press and pull, and an indenter's law holds while the contact grows.
    if members.len() < 2 || subject.experiment().scales().depth_exponent.is_some() {
        return Ok(None);
    }
    if let Some((candidate, _)) = members.iter().find(|(candidate, _)| !candidate.columns.is_empty()) {
        return Err(Error::numerical(
            format!("the columns added to the model with {} belong to this record alone", candidate.effects.join(", ")),
            "compare models without columns",
        ));
    }
    let now = separation(subject, members)?;
    let tried = changes(&subject.experiment().record, subject.experiment().scales().hold_s);
    let judged = tried.into_par_iter().map(|change| {
        let changed = changed(subject, &change.record)?;
        let separation = separation(&changed, members)?;
        Ok::<_, Error>((change, changed, separation))
    });
    // A model at its fitted size may have no trajectory under another protocol, as a force gradient under longer holds: such a change is none.
    let judged: Vec<Result<(Change, Subject, Separation)>> = judged.collect();
    let is_possible = |tried: &Result<_>| !matches!(tried, Err(Error::Numerical { .. }));
    let judged: Vec<(Change, Subject, Separation)> = judged.into_iter().filter(is_possible).collect::<Result<_>>()?;
    let n_tried = judged.len();
    let best = judged.into_iter().reduce(|a, b| if b.2.distance > a.2.distance { b } else { a });
    let Some((change, changed, then)) = best else { return Ok(None) };
    let n_right = n_right(&changed, members, then.other, (n_repeats, seed))?;
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
            "{instruction}: {a} and {b} would then stand {then:.1} σ apart instead of {now:.1} (right in {n_right} of {n_repeats} simulated repeats)."
        )
    } else {
        let mut letters = instruction.chars();
        let small: String = letters.next().into_iter().flat_map(char::to_lowercase).chain(letters).collect();
        format!(
            "None of {n_tried} changes of the protocol would tell {a} from {b} at this size. The best is to {small}, which leaves them {then:.1} σ apart instead of {now:.1} (right in {n_right} of {n_repeats} simulated repeats)."
        )
    }
}

/// The subject of a changed protocol: same apparatus and noise, same cycles fitted and scored.
fn changed(subject: &Subject, record: &Record) -> Result<Subject> {
    let range_m = subject.experiment().scales().position_range_m;
    // Places for positions, over the range of the measured ones, by which priors of effects are scaled.
    let places = (0..record.n_rows()).map(|row| Some(range_m * row as f64 / record.n_rows() as f64)).collect();
    let experiment = Experiment {
        record: Record { position_m: places, ..record.clone() },
        noise_sd_m: Some(subject.yardstick_m()),
        ..subject.experiment().clone()
    };
    let problem = subject.problem().with(experiment, subject.specification().clone(), subject.library())?;
    Subject::with_compliance(&problem, subject.library(), subject.compliance().clone())
}

/// The smallest distance of the first of several models from another, either being the truth.
struct Separation {
    distance: f64,
    /// Place of the closest other.
    other: usize,
}

fn separation(subject: &Subject, members: &Members) -> Result<Separation> {
    let noise = members[0].1.noise;
    let positions = members.iter().map(|(candidate, fitted)| subject.trajectory_m(candidate, &fitted.theta));
    let positions: Vec<Vec<f64>> = positions.collect::<Result<_>>()?;
    let between = |truth: usize, other: usize| {
        let (candidate, fitted) = members[truth];
        let truth = Truth { candidate, theta: &fitted.theta, noise, position_m: &positions[truth] };
        Ok::<f64, Error>(closest(subject, members[other].0, &truth)?.distance)
    };
    let mut smallest = Separation { distance: f64::INFINITY, other: 1 };
    for other in 1..members.len() {
        let distance = between(0, other)?.min(between(other, 0)?);
        if distance < smallest.distance {
            smallest = Separation { distance, other };
        }
    }
    Ok(smallest)
}

/// In how many simulated repeats the truth, the first model or the `other` in turn, beats every other model by enough, noise estimated anew for each.
fn n_right(subject: &Subject, members: &Members, other: usize, (n_repeats, seed): (usize, u64)) -> Result<usize> {
    let truths = [starts(subject, members, 0)?, starts(subject, members, other)?];
    let is_right = |repeat: usize| is_right(subject, members, &truths[repeat % 2], (seed, repeat));
    let right: Result<Vec<bool>> = (0..n_repeats).into_par_iter().map(is_right).collect();
    Ok(right?.into_iter().filter(|right| *right).count())
}

/// Whether a truth beats every other model by enough in one repeat.
fn is_right(subject: &Subject, members: &Members, truth: &Repeated, (seed, repeat): (u64, usize)) -> Result<bool> {
    let noise = members[0].1.noise;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(repeat as u64);
    let data = subject.with_positions(&truth.with_noise(subject, noise, &mut random));
    let objective = |place: usize| -> Result<f64> {
        let also = [(truth.thetas[place].clone(), noise)];
        Ok(data.fit(members[place].0, &also, Search::Local)?.objective)
    };
    let own = objective(truth.place)?;
    for place in (0..members.len()).filter(|place| *place != truth.place) {
        if own - objective(place)? <= REJECTED_NATS {
            return Ok(false);
        }
    }
    Ok(true)
}

/// A truth of simulated repeats.
struct Repeated {
    place: usize,
    position_m: Vec<f64>,
    /// Where each model comes closest to it.
    thetas: Vec<Vec<f64>>,
}

impl Repeated {
    /// Positions with noise, of one draw.
    fn with_noise(&self, subject: &Subject, noise: NoiseValues, random: &mut ChaCha8Rng) -> Vec<f64> {
        let record = &subject.experiment().record;
        let recordings = subject.problem().recordings();
        let drawn_m = subject.noise().simulate_m(&record.time_s, &recordings, &self.position_m, &noise, random);
        self.position_m.iter().zip(drawn_m).map(|(x, noise)| x + noise).collect()
    }
}

fn starts(subject: &Subject, members: &Members, place: usize) -> Result<Repeated> {
    let (candidate, fitted) = members[place];
    let position_m = subject.trajectory_m(candidate, &fitted.theta)?;
    let truth = Truth { candidate, theta: &fitted.theta, noise: members[0].1.noise, position_m: &position_m };
    let theta = |at: usize| {
        if at == place { Ok(fitted.theta.clone()) } else { Ok(closest(subject, members[at].0, &truth)?.theta) }
    };
    let thetas = (0..members.len()).map(theta).collect::<Result<_>>()?;
    Ok(Repeated { place, position_m, thetas })
}

#[cfg(test)]
mod tests;
