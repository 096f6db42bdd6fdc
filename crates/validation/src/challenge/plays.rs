//! Plays many challenges: makes their data, diagnoses each and counts the results.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::full_order::trajectories_m;
use super::play::{HiddenKind, NamedSize, Play};
use super::tally::{Tally, tally};
use super::truth::joined;
use super::{
    ApparatusError, Bench, DisturbanceKind, HiddenPhysics, Noise, NoiseKind, Protocol, Strength, Truth, TruthRequest,
    hideable_effects,
};
use base::error::{Error, InputPlace, Result, Setting};
use criticism::Subject;
use criticism::diagnose::{DiagnosisRequest, diagnose};
use documents::diagnosis::{Diagnosis, VerdictKind};
use models::effects::Library;
use posterior::check::refuse_contradictions;
use posterior::monitor::{Monitor, SilentMonitor, refuse_if_stopped};
use posterior::study::{Provenance, WithProvenance};
use record::Interpretation;
use sampling::ensemble::RandomStream;

/// Function that diagnoses a subject (a record with its base model), given a seed.
pub type Diagnose<'a> = dyn Fn(&Subject, u64) -> Result<Diagnosis> + Sync + 'a;

/// Diagnoses a subject as `challenge run` does. Parts of the diagnosis that the verdict does not need are omitted.
///
/// # Errors
/// Errors of [`diagnose`].
pub fn diagnose_briefly(subject: &Subject, seed: u64) -> Result<Diagnosis> {
    let request = DiagnosisRequest { seed, in_full: false, ..DiagnosisRequest::default() };
    Ok(diagnose(subject, &request, &SilentMonitor)?.diagnosis)
}

/// Request for a run of challenges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlaysRequest {
    /// Number of challenges to play.
    pub count: usize,
    /// Number of the first challenge, from 0. A run can be split into parts, because a challenge depends only on its number and the request.
    pub first: usize,
    /// Signals of the hidden effects, in noise standard deviations; successive challenges use them in turn.
    pub signals_sigma: Vec<f64>,
    /// Sort of all challenges; `None` for a mixture of sorts.
    pub only: Option<HiddenKind>,
    /// Slugs of the effects that may be hidden; empty for the whole library.
    pub effects: Vec<String>,
    /// Protocols; successive challenges use them in turn.
    pub protocols: Vec<Protocol>,
    /// Kinds of noise; successive challenges use them in turn.
    pub noises: Vec<NoiseKind>,
    /// True if the experiments state their noise. Otherwise each diagnosis estimates it.
    pub is_noise_given: bool,
    /// Seed of the truths and the noise.
    pub seed: u64,
}

impl Default for PlaysRequest {
    fn default() -> Self {
        Self {
            count: 100,
            first: 0,
            signals_sigma: vec![5.0, 10.0, 20.0, 40.0],
            only: None,
            effects: Vec::new(),
            protocols: Protocol::ALL.to_vec(),
            noises: NoiseKind::USUAL.to_vec(),
            is_noise_given: true,
            seed: 1,
        }
    }
}

/// Sorts of ten successive challenges in a run with a mixture of sorts.
const MIXTURE: [HiddenKind; 10] = [
    HiddenKind::Single,
    HiddenKind::None,
    HiddenKind::Single,
    HiddenKind::Outside,
    HiddenKind::Single,
    HiddenKind::Pair,
    HiddenKind::None,
    HiddenKind::Single,
    HiddenKind::Apparatus,
    HiddenKind::Pair,
];
/// Numbers of the first random streams. Truths start at 0, noise at `NOISE_STREAMS`, and the laws of challenges without hidden effects at `CONTROL_STREAMS`.
const NOISE_STREAMS: u64 = 1 << 32;
const CONTROL_STREAMS: u64 = 1 << 33;
/// Number of different laws, for each protocol, of challenges without hidden effects. Several challenges share each law, so that its trajectory is computed
/// once.
const CONTROL_LAWS: usize = 40;
/// Smallest signal of each effect in a pair, because each must be detectable beside the other.
const LEAST_PAIR_SIGMA: f64 = 10.0;
/// Golden ratio minus 1. The fractional parts of its multiples are evenly distributed. Successive challenges use them to choose among effects evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Results of a run of challenges: counts, and every challenge with its diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Plays {
    /// Counted results of the challenges.
    #[serde(flatten)]
    pub tally: Tally,
    /// Every challenge with the result of its diagnosis.
    pub plays: Vec<Play>,
}

impl Plays {
    /// Counts the results of challenges, which may come from several parts of a run.
    pub fn of(plays: Vec<Play>) -> Self {
        Self { tally: tally(&plays), plays }
    }

    /// Returns the JSON document of a run. `seed` is the seed of the run.
    pub fn document(&self, seed: u64) -> WithProvenance<&Self> {
        WithProvenance { provenance: Provenance::new("challenge", 1, seed, BTreeMap::new()), body: self }
    }
}

/// Plays challenges: draws truths, makes their data and diagnoses each. The function `diagnose` gets a separate seed for every challenge.
///
/// # Errors
/// [`Error::Input`] for an impossible request; errors of drawing and of the full-order model. If a diagnosis fails, its challenge counts as failed.
pub fn run(
    bench: &Bench,
    request: &PlaysRequest,
    cache: Option<&Path>,
    diagnose: &Diagnose<'_>,
    monitor: &dyn Monitor,
) -> Result<Plays> {
    check(bench.library(), request)?;
    monitor.stage(&format!("drawing {} truths and setting their signals", request.count));
    let drawn: Vec<(HiddenKind, Truth)> = (request.first..request.first + request.count)
        .into_par_iter()
        .map(|number| {
            let sort = request.only.unwrap_or(MIXTURE[number % MIXTURE.len()]);
            Ok((sort, draw(bench, request, sort, number)?))
        })
        .collect::<Result<_>>()?;
    let truths: Vec<Truth> = drawn.iter().map(|(_, truth)| truth.clone()).collect();
    let trajectories_m = trajectories_m(bench, &truths, cache, monitor)?;
    monitor.stage(&format!("diagnosing {} challenges", request.count));
    let done = AtomicUsize::new(0);
    let every = (request.count / 20).max(1);
    let plays = drawn
        .into_par_iter()
        .zip(trajectories_m)
        .enumerate()
        .map(|(number, ((sort, truth), position_m))| {
            refuse_if_stopped(monitor, "only the trajectories in the cache are kept")?;
            let case = PlayCase { number: request.first + number, sort, truth, position_m };
            let play = play(bench, request, case, diagnose)?;
            let n_done = 1 + done.fetch_add(1, Ordering::Relaxed);
            if n_done.is_multiple_of(every) {
                monitor.stage(&format!("diagnosed {n_done} of {} challenges", request.count));
            }
            Ok(play)
        })
        .collect::<Result<Vec<Play>>>()?;
    Ok(Plays::of(plays))
}

/// Checks a request before anything is computed.
///
/// # Errors
/// [`Error::Input`] with the option that is wrong and the remedy.
pub fn check(library: &Library, request: &PlaysRequest) -> Result<()> {
    let refuse =
        |setting: Setting, found: String, remedy: &str| Err(Error::input(InputPlace::setting(setting), found, remedy));
    if request.count == 0 {
        return refuse(Setting::Count, "0 challenges are requested".into(), "give a positive number");
    }
    let is_signal = |sigma: &f64| sigma.is_finite() && (0.5..=1e3).contains(sigma);
    if request.signals_sigma.is_empty() || !request.signals_sigma.iter().all(is_signal) {
        return refuse(Setting::Signal, format!("{:?}", request.signals_sigma), "give numbers from 0.5 to 1000");
    }
    if let Some(unknown) = request.effects.iter().find(|slug| library.get(slug).is_none()) {
        return refuse(
            Setting::HiddenEffect,
            format!("there is no effect `{unknown}`"),
            "give effects listed by `vitreo-uq effects`",
        );
    }
    if request.effects.len() == 1 && request.only == Some(HiddenKind::Pair) {
        return refuse(Setting::HiddenEffect, "a pair needs two effects".into(), "give at least two effects");
    }
    if request.protocols.is_empty() || request.noises.is_empty() {
        return refuse(
            Setting::Protocol,
            "no protocol or no noise is given".into(),
            "give at least one of each, or remove the options",
        );
    }
    Ok(())
}

/// Draws the truth of challenge `number`. If the signal of an effect is out of reach, the next effect is tried.
fn draw(bench: &Bench, request: &PlaysRequest, sort: HiddenKind, number: usize) -> Result<Truth> {
    let (protocols, noises, signals) = (&request.protocols, &request.noises, &request.signals_sigma);
    // In a mixture, the challenges of each sort are numbered separately.
    let place = if request.only.is_some() {
        number
    } else {
        let of_sort = |upto: usize| (0..upto).filter(|k| MIXTURE[k % MIXTURE.len()] == sort).count();
        of_sort(MIXTURE.len()) * (number / MIXTURE.len()) + of_sort(number % MIXTURE.len())
    };
    let protocol = protocols[place % protocols.len()];
    let noise = noises[place / protocols.len() % noises.len()];
    let signal_sigma = signals[place / (protocols.len() * noises.len()) % signals.len()];
    let is_noise_given = request.is_noise_given;
    let order = |hidden: HiddenPhysics, signal_sigma: f64| TruthRequest {
        hidden,
        protocol,
        noise,
        is_noise_given,
        strength: Strength::Sigma(signal_sigma),
    };
    let stream_number = match sort {
        // Challenges with different noises share these laws.
        HiddenKind::None => CONTROL_STREAMS + (place / (protocols.len() * noises.len()) % CONTROL_LAWS) as u64,
        HiddenKind::Apparatus => CONTROL_STREAMS + (place / protocols.len() % CONTROL_LAWS) as u64,
        _ => number as u64,
    };
    let mut stream = RandomStream::new(request.seed, stream_number);
    let spread = |n: usize| ((place as f64 * GOLDEN).fract() * n as f64) as usize;
    let mut refusal = None;
    for attempt in 0..32 {
        let order = match sort {
            HiddenKind::None => order(HiddenPhysics::Nothing, signal_sigma),
            HiddenKind::Apparatus => {
                let errors = ApparatusError::ALL;
                order(HiddenPhysics::Apparatus(errors[place / protocols.len() % errors.len()]), signal_sigma)
            }
            HiddenKind::Outside => {
                let kinds: Vec<DisturbanceKind> =
                    DisturbanceKind::drawn().filter(|kind| kind.suits(protocol)).collect();
                order(HiddenPhysics::Outside(kinds[(spread(kinds.len()) + attempt) % kinds.len()]), signal_sigma)
            }
            HiddenKind::Single => {
                let slugs = slugs(bench, request);
                order(
                    HiddenPhysics::Effects(vec![slugs[(spread(slugs.len()) + attempt) % slugs.len()].clone()]),
                    signal_sigma,
                )
            }
            HiddenKind::Pair => {
                let slugs = slugs(bench, request);
                let (a, b) = stream.distinct_pair(slugs.len());
                order(
                    HiddenPhysics::Effects(vec![slugs[a].clone(), slugs[b].clone()]),
                    signal_sigma.max(LEAST_PAIR_SIGMA),
                )
            }
        };
        match bench.draw(&order, &mut stream) {
            Ok(truth) => return Ok(truth),
            Err(error @ Error::Input { .. }) => refusal = Some(error),
            Err(error) => return Err(error),
        }
    }
    Err(refusal.unwrap_or_else(|| Error::numerical("no truth could be drawn", "request other effects or signals")))
}

/// Slugs of the effects to choose from: the requested ones, otherwise all that can be hidden.
fn slugs(bench: &Bench, request: &PlaysRequest) -> Vec<String> {
    if request.effects.is_empty() { hideable_effects(bench.library()) } else { request.effects.clone() }
}

/// Truth and noise-free positions (m) of a challenge.
struct PlayCase {
    number: usize,
    sort: HiddenKind,
    truth: Truth,
    position_m: Vec<f64>,
}

fn play(bench: &Bench, request: &PlaysRequest, case: PlayCase, diagnose: &Diagnose<'_>) -> Result<Play> {
    let PlayCase { number, sort, truth, position_m } = case;
    let record = truth.protocol.record();
    let mut stream = RandomStream::new(request.seed, NOISE_STREAMS + number as u64);
    let noise = truth.noise.draw(&record, &position_m, &mut stream);
    let stated_sd_m = truth.is_noise_given.then_some(noise.stated_sd_m);
    let subject = bench.subject_measured(truth.protocol, &noise.measured_m(&position_m), stated_sd_m)?;
    let seed = u64::from(stream.word()) << 32 | u64::from(stream.word());
    // The command `diagnose` also checks the record before it fits. If it refuses a sound record, the challenge has failed.
    let looked = refuse_contradictions(subject.experiment(), &Interpretation::default(), &SilentMonitor);
    let play = match looked.and_then(|()| diagnose(&subject, seed)) {
        Ok(diagnosis) => judge(number, sort, truth, &diagnosis, Some(&noise)),
        Err(error) => failed(number, sort, truth, &error),
    };
    Ok(Play { seed, ..play })
}

fn failed(number: usize, sort: HiddenKind, truth: Truth, error: &Error) -> Play {
    Play {
        number,
        sort,
        label: truth.label(),
        truth,
        said: "failed".into(),
        class: Vec::new(),
        unexplained: Vec::new(),
        first: None,
        gains: Vec::new(),
        sentence: String::new(),
        seed: 0,
        size_covered: None,
        sizes: Vec::new(),
        yardstick_um: None,
        rmse_heldout_um: None,
        true_noise_um: None,
        heldout_over_true_noise: None,
        heldout_over_predictive_noise: None,
        failure: Some(error.to_string()),
    }
}

/// Compares a diagnosis with the truth, and with the drawn noise if it is known.
pub fn judge(number: usize, sort: HiddenKind, truth: Truth, diagnosis: &Diagnosis, noise: Option<&Noise>) -> Play {
    let verdict = &diagnosis.verdict;
    let said = match verdict.kind {
        VerdictKind::Missing => joined(verdict.effects.iter().map(String::as_str)),
        VerdictKind::None => "none".into(),
        VerdictKind::Unexplained => "unexplained".into(),
    };
    let mut class: Vec<String> = Vec::new();
    if verdict.kind == VerdictKind::Missing {
        class = verdict.effects.iter().chain(&verdict.equivalent).cloned().collect();
        class.sort_unstable();
        class.dedup();
    }
    let mut gains: Vec<(String, f64, Option<f64>)> = diagnosis
        .candidates
        .iter()
        .filter_map(|entry| {
            entry.refit.as_ref().map(|refit| (entry.effect.clone(), refit.gain_nats, refit.last_cycle_gain_nats))
        })
        .collect();
    gains.sort_by(|a, b| b.1.total_cmp(&a.1));
    let named = verdict.effects.first().filter(|_| verdict.kind == VerdictKind::Missing).cloned();
    let first = named.or_else(|| gains.first().map(|(slug, ..)| slug.clone()));
    let (rmse_heldout_um, predictive_noise_um) = match &diagnosis.extended {
        Some(errors) => (errors.rmse_heldout_um, errors.predictive_noise_um),
        None => (diagnosis.base.rmse_heldout_um, None),
    };
    let true_noise_um = noise.and_then(|noise| true_noise_um(&truth, diagnosis, noise));
    let error_over = |noise_um: Option<f64>| Some(rmse_heldout_um? / noise_um?);
    Play {
        number,
        sort,
        label: truth.label(),
        size_covered: size_covered(&truth, diagnosis),
        sizes: named_sizes(&truth, diagnosis),
        truth,
        said,
        class,
        unexplained: diagnosis.unexplained.iter().map(|entry| entry.kind.clone()).collect(),
        first,
        gains,
        sentence: verdict.sentence.clone(),
        seed: 0,
        yardstick_um: diagnosis.base.noise_um,
        rmse_heldout_um,
        true_noise_um,
        heldout_over_true_noise: error_over(true_noise_um),
        heldout_over_predictive_noise: error_over(predictive_noise_um),
        failure: None,
    }
}

/// Root mean square (µm) of the drawn noise over the rows of the scored cycle. The diagnosis reports its error on this cycle.
fn true_noise_um(truth: &Truth, diagnosis: &Diagnosis, noise: &Noise) -> Option<f64> {
    let cycle = truth.protocol.record().cycle;
    let is_scored = |row: usize| cycle.get(row).is_some_and(|cycle| diagnosis.heldout_cycles.contains(cycle));
    noise.rms_m(is_scored).map(|rms_m| 1e6 * rms_m)
}

/// True and estimated sizes of the hidden effects that the diagnosis claims.
fn named_sizes(truth: &Truth, diagnosis: &Diagnosis) -> Vec<NamedSize> {
    let verdict = &diagnosis.verdict;
    let is_named = |slug: &String| verdict.kind == VerdictKind::Missing && verdict.effects.contains(slug);
    let named = truth.effects.iter().filter(|effect| is_named(&effect.slug)).filter_map(|effect| {
        let size = effect.parameters.first()?;
        let entry = diagnosis.candidates.iter().find(|entry| entry.effect == effect.slug)?;
        let found = entry.refit.as_ref()?.parameters.iter().find(|parameter| parameter.name == size.name)?;
        Some(NamedSize { name: size.name.clone(), value: size.value, mean: found.mean, q05: found.q05, q95: found.q95 })
    });
    named.collect()
}

/// True if the 90 % interval of the hidden effect's size contains the true size; `None` unless exactly one effect is hidden and it is claimed.
fn size_covered(truth: &Truth, diagnosis: &Diagnosis) -> Option<bool> {
    let ([effect], [named]) = (truth.effects.as_slice(), diagnosis.verdict.effects.as_slice()) else { return None };
    if effect.slug != *named {
        return None;
    }
    named_sizes(truth, diagnosis).first().map(|size| (size.q05..=size.q95).contains(&size.value))
}

#[cfg(test)]
#[path = "plays_tests.rs"]
mod tests;
