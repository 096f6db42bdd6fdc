//! Measures how often 90 % intervals contain the true value. Truths are drawn from the priors. Each record is fitted and its evidence computed as in
//! `diagnose`.
//!
//! A correctly computed posterior covers draws from its own prior at the stated rate, for any model (Cook, Gelman & Rubin 2006, doi:10.1198/106186006X136976).
//! The surrogate therefore simulates the data: the count tests the computation, not the model. Sizes are uniform in the quantiles of the prior that the
//! record's own diagnosis uses. Truths whose signal is below a minimum are drawn again, because a diagnosis only claims detectable effects.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::bench::FromPriors;
use super::{Bench, NamedValue, NoiseKind, Protocol};
use base::error::{Error, InputPlace, Result, Setting};
use criticism::evidence::{EvidenceMethod, evidence};
use criticism::refit::Refitted;
use criticism::{Search, Subject};
use posterior::monitor::{Counter, Monitor};
use sampling::ensemble::RandomStream;

/// Request for a count of how often 90 % intervals contain the true value.
#[derive(Debug, Clone, PartialEq)]
pub struct CoverageRequest {
    /// Number of records to simulate.
    pub count: usize,
    /// Number of the first record, from 0. A count can be split into parts, because a record depends only on its number and the seed.
    pub first: usize,
    /// Slugs of the effects; successive records use them in turn.
    pub effects: Vec<String>,
    /// Smallest signal of a truth, in noise standard deviations.
    pub least_sigma: f64,
    /// Seed of the truths, the noise and the intervals.
    pub seed: u64,
}

/// The 90 % interval of one record's effect, with its true value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Number of the record, from 0.
    pub number: usize,
    /// Slug of the effect in this record.
    pub effect: String,
    /// Protocol of the record.
    pub protocol: Protocol,
    /// Kind of noise in the record.
    pub noise: NoiseKind,
    /// True law: E (Pa), c₁ and c₂ (Pa s).
    pub law: [f64; 3],
    /// True parameters of the effect. The coverage refers to the first one.
    pub truth: Vec<NamedValue>,
    /// Signal of the effect, in noise standard deviations.
    pub signal_sigma: f64,
    /// 5 % and 95 % quantiles of the first parameter's posterior; `None` if the computation failed.
    pub interval: Option<[f64; 2]>,
    /// True if the true value lies in the interval; `None` without an interval.
    pub is_covered: Option<bool>,
    /// Number of modes of the posterior.
    pub n_answers: usize,
    /// Pareto k̂ of the importance weights; `None` if sequential Monte Carlo was used.
    pub pareto_k: Option<f64>,
    /// Method that computed the posterior.
    pub method: Option<String>,
    /// Reason why there is no interval; `None` if there is one.
    pub failure: Option<String>,
}

/// Coverage of the intervals of one effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectCoverage {
    /// Slug of the effect.
    pub effect: String,
    /// Number of records for which an interval was computed.
    pub counted: usize,
    /// Number of these intervals that contain the true value.
    pub covered: usize,
    /// Number of records with an interval whose posterior has several modes.
    pub with_several_answers: usize,
    /// Number of records for which no interval was computed.
    pub failed: usize,
}

/// Result of a count of how often intervals contain the true value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// Fraction of all intervals that contain the true value.
    pub share: f64,
    /// Number of records for which an interval was computed.
    pub counted: usize,
    /// Results for each effect.
    pub effects: Vec<EffectCoverage>,
    /// Interval of every record. Records whose computation failed are included.
    pub intervals: Vec<Interval>,
}

/// Number of draws after which the minimum signal of an effect counts as out of reach.
const MOST_DRAWS: usize = 400;
/// Number of the first random stream that generates noise. Streams with smaller numbers generate truths.
const NOISE_STREAMS: u64 = 1 << 32;
/// Kinds of noise that the fitted noise model describes correctly.
const NOISES: [NoiseKind; 3] = [NoiseKind::White, NoiseKind::Ou, NoiseKind::Gain];

/// Counts how often the intervals of a request contain the true value.
///
/// # Errors
/// [`Error::Input`] for effects that are not in the library or never reach the minimum signal; errors of the base model's fit.
pub fn count(bench: &Bench, request: &CoverageRequest, monitor: &dyn Monitor) -> Result<Coverage> {
    if request.count == 0 || request.effects.is_empty() {
        return Err(Error::input(
            InputPlace::setting(Setting::Count),
            "no records or no effects are requested",
            "give a positive number of records, and at least one effect",
        ));
    }
    monitor.stage(&format!("counting intervals of {} records", request.count));
    let counter = Counter::new(monitor, request.count);
    let one = |number: usize| {
        let interval = interval(bench, request, number)?;
        counter.add_one();
        Ok(interval)
    };
    let intervals: Vec<Interval> =
        (request.first..request.first + request.count).into_par_iter().map(one).collect::<Result<_>>()?;
    let of_effect = |slug: &String| {
        let entry: Vec<&Interval> = intervals.iter().filter(|interval| &interval.effect == slug).collect();
        let counted: Vec<&&Interval> = entry.iter().filter(|interval| interval.is_covered.is_some()).collect();
        EffectCoverage {
            effect: slug.clone(),
            counted: counted.len(),
            covered: counted.iter().filter(|interval| interval.is_covered == Some(true)).count(),
            with_several_answers: counted.iter().filter(|interval| interval.n_answers > 1).count(),
            failed: entry.len() - counted.len(),
        }
    };
    let effects: Vec<EffectCoverage> = request.effects.iter().map(of_effect).collect();
    let counted: usize = effects.iter().map(|effect| effect.counted).sum();
    let covered: usize = effects.iter().map(|effect| effect.covered).sum();
    Ok(Coverage { share: covered as f64 / counted.max(1) as f64, counted, effects, intervals })
}

fn interval(bench: &Bench, request: &CoverageRequest, number: usize) -> Result<Interval> {
    let slug = &request.effects[number % request.effects.len()];
    let place = number / request.effects.len();
    let protocol = Protocol::ALL[place % Protocol::ALL.len()];
    let noise = NOISES[place / Protocol::ALL.len() % NOISES.len()];
    let mut stream = RandomStream::new(request.seed, number as u64);
    let drawn = drawn(bench, slug, (protocol, noise), request.least_sigma, &mut stream)?;
    let FromPriors { law, parameters, signal_sigma, position_m } = drawn;
    let mut noise_stream = RandomStream::new(request.seed, NOISE_STREAMS + number as u64);
    let drawn = noise.draw(&protocol.record(), &position_m, &mut noise_stream);
    let subject = bench.subject_measured(protocol, &drawn.measured_m(&position_m), Some(drawn.stated_sd_m))?;
    let found = posterior_of(&subject, slug, request.seed);
    let mut made = Interval {
        number,
        effect: slug.clone(),
        protocol,
        noise,
        law,
        truth: parameters,
        signal_sigma,
        interval: None,
        is_covered: None,
        n_answers: 0,
        pareto_k: None,
        method: None,
        failure: None,
    };
    match found {
        Err(error) => made.failure = Some(error.to_string()),
        Ok(found) => {
            let first = &made.truth[0];
            if let Some(parameter) = found.parameters.iter().find(|parameter| parameter.name == first.name) {
                made.interval = Some([parameter.q05, parameter.q95]);
                made.is_covered = Some((parameter.q05..=parameter.q95).contains(&first.value));
            }
            made.n_answers = found.modes.len().max(1);
            made.pareto_k = found.pareto_k;
            let name = match found.method {
                EvidenceMethod::ImportanceSampling => "importance sampling",
                EvidenceMethod::SequentialMonteCarlo => "sequential Monte Carlo",
            };
            made.method = Some(name.into());
        }
    }
    Ok(made)
}

/// Draws from the effect's priors until the signal reaches the minimum.
fn drawn(
    bench: &Bench,
    slug: &str,
    (protocol, noise): (Protocol, NoiseKind),
    least_sigma: f64,
    stream: &mut RandomStream,
) -> Result<FromPriors> {
    for _ in 0..MOST_DRAWS {
        let drawn = bench.draw_from_priors(slug, protocol, noise, stream)?;
        if let Some(drawn) = drawn.filter(|drawn| drawn.signal_sigma >= least_sigma) {
            return Ok(drawn);
        }
    }
    Err(Error::input(
        InputPlace::setting(Setting::HiddenEffect),
        format!("none of {MOST_DRAWS} draws of {slug} reaches a signal of {least_sigma} standard deviations"),
        "give another effect",
    ))
}

/// Computes the posterior of the model with the effect `slug`, from fits as in a diagnosis.
fn posterior_of(subject: &Subject, slug: &str, seed: u64) -> Result<criticism::evidence::ModelEvidence> {
    let base = Refitted::new(subject, subject.base(), &[], Search::Wide)?;
    let with = Refitted::new(subject, subject.extended(&[slug])?, &[&base], Search::Wide)?;
    evidence(subject, &with.candidate, &with.fitted, seed)
}
