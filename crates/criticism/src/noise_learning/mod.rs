//! What the noise is, learnt three ways that see different things; where they disagree, that is a finding.
//!
//! | from | how | does not see |
//! |---|---|---|
//! | rest records | scatter about a line where no force acts | noise slower than a rest; gain |
//! | short-lag differences | second differences late in holds | slow noise, gain, offset |
//! | cycle-to-cycle differences | differences of what a fit leaves, after equal force steps of successive cycles | what every cycle repeats |
//! | restricted maximum likelihood | white, process, gain and offset, with what the law's parameters can absorb integrated out | nothing, but takes the model's misfit for noise |
//!
//! Reference for the last: Patterson & Thompson, *Biometrika* 58, 545 (1971), doi:10.1093/biomet/58.3.545.

mod records;
mod restricted;

use super::{Candidate, Fitted, Subject};
use crate::NoiseValues;
use base::error::Result;
use base::parameter::{OFFSET_SD, OU_SD};
use documents::diagnosis::NoiseEstimate;
use posterior::noise::NoiseModel;
use record::Record;

/// A standard deviation and its standard error, both in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Standard deviation of one position.
    pub sd_m: f64,
    /// Standard error of it.
    pub standard_error_m: f64,
}

/// What differences between successive cycles show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CycleSpread {
    /// Of one position, gains and offsets of cycles included.
    pub whole: Spread,
    /// Of one position, without what a gain and an offset of each cycle explain.
    pub within: Spread,
    /// Standard deviation of a cycle's gain; 0 where no change of it shows.
    pub gain_sd: f64,
    /// Standard error of it, as far as that many cycles tell.
    pub gain_standard_error: f64,
    /// Mean square of the changes of gain over what the noise makes by chance.
    pub gain_score: f64,
    /// The same of the shifts of cycles against each other.
    pub offset_score: f64,
    /// Pairs of successive cycles.
    pub n_pairs: usize,
}

/// What the restricted likelihood shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestrictedSpread {
    /// Of what differs from row to row: white errors and the process together.
    pub row: Spread,
    /// The terms of the noise.
    pub model: NoiseModel,
    /// Their parameters in their units, in the order of the model.
    pub noise: NoiseValues,
}

/// The noise, learnt three ways.
#[derive(Debug, Clone, PartialEq)]
pub struct LearntNoise {
    /// From rest records, where there are any.
    pub rest: Option<Spread>,
    /// From neighbouring positions late in holds.
    pub neighbours: Option<Spread>,
    /// From successive cycles.
    pub cycles: Option<CycleSpread>,
    /// By restricted maximum likelihood.
    pub restricted: RestrictedSpread,
    /// Root mean square of what the fit leaves, in m.
    pub left_m: f64,
}

/// Two ways disagree where they differ by this many standard errors and by this fraction.
const LEAST_ERRORS: f64 = 3.5;
const LEAST_FRACTION: f64 = 0.2;
/// What a fit leaves is more than noise from this ratio on.
const LEAST_MISFIT_RATIO: f64 = 1.5;

/// Learns the noise of the fitted cycles: from the records, and at a fit of a candidate.
///
/// # Errors
/// [`base::Error::Numerical`] where the candidate has no derivatives at its fit.
pub fn learn(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<LearntNoise> {
    let record = Record { position_m: subject.fitted_m.clone(), ..subject.experiment().record.clone() };
    Ok(LearntNoise {
        rest: records::at_rest(&record),
        neighbours: records::of_neighbours(&record),
        cycles: records::of_cycles(&record, &fitted.position_m),
        restricted: restricted::learn(subject, candidate, fitted)?,
        left_m: fitted.rmse_m(&subject.fitted_m).unwrap_or(0.0),
    })
}

impl LearntNoise {
    /// One statement a way, for the document and the terminal.
    pub fn estimates(&self) -> Vec<NoiseEstimate> {
        let entry = |from: &str, spread: Option<Spread>, text: String| NoiseEstimate {
            from: from.into(),
            sd_um: spread.map(|spread| 1e6 * spread.sd_m),
            standard_error_um: spread.map(|spread| 1e6 * spread.standard_error_m),
            text,
        };
        let at_rest = self.rest.map_or_else(
            || "Rest records: this experiment has none that are long enough.".into(),
            |rest| {
                format!(
                    "Rest records: {} about a line where no force acts; a change of gain does not show there.",
                    um(rest)
                )
            },
        );
        let by_neighbours = self.neighbours.map_or_else(
            || "Short-lag differences: too few positions late in holds.".into(),
            |neighbours| {
                format!(
                    "Short-lag differences: {} from neighbouring positions late in holds; slow noise and gain do not show there.",
                    um(neighbours)
                )
            },
        );
        let by_cycles = self.cycles.map_or_else(
            || "Cycle-to-cycle differences: too few cycles with the same force.".into(),
            |cycles| {
                let pairs = if cycles.n_pairs == 1 { "one pair".into() } else { format!("{} pairs", cycles.n_pairs) };
                let gain = if cycles.gain_sd > 0.0 {
                    let [sd, error] = [cycles.gain_sd, cycles.gain_standard_error].map(|part| 100.0 * part);
                    format!("; the gain changes by {sd:.2} ± {error:.2} % from cycle to cycle")
                } else {
                    String::new()
                };
                format!(
                    "Cycle-to-cycle differences: {} from {pairs} of successive cycles, {} once a gain and an offset are taken out of each{gain}; what all cycles repeat does not show there.",
                    um(cycles.whole),
                    um(cycles.within)
                )
            },
        );
        let [of_rows, of_cycles] = self.restricted.model.words(&self.restricted.noise).map(|words| words.join(", "));
        let by_likelihood = format!(
            "Restricted maximum likelihood: {} from row to row ({of_rows}), {of_cycles}; what the model misses counts as noise there.",
            um(self.restricted.row),
        );
        vec![
            entry("rest records", self.rest, at_rest),
            entry("short-lag differences", self.neighbours, by_neighbours),
            entry("cycle-to-cycle differences", self.cycles.map(|cycles| cycles.whole), by_cycles),
            entry("restricted maximum likelihood", Some(self.restricted.row), by_likelihood),
        ]
    }

    /// Where two ways disagree beyond their errors, one sentence each.
    pub fn disagreements(&self) -> Vec<String> {
        let mut found = Vec::new();
        if let (Some(rest), Some(neighbours)) = (self.rest, self.neighbours)
            && exceeds(rest, neighbours)
        {
            found.push(format!(
                "At rest positions scatter by {}, neighbouring ones by {}: the noise is slow, or something still moves at rest.",
                short_um(rest.sd_m),
                short_um(neighbours.sd_m)
            ));
        }
        // What is seen of single rows, by the way that sees most of it.
        let Some(known) = self.rest.or(self.neighbours) else { return found };
        if let (Some(cycles), Some(neighbours)) = (self.cycles, self.neighbours)
            && (cycles.has_gain() || exceeds(cycles.whole_by_chance(), neighbours))
        {
            found.push(cycles.against(neighbours, self.restricted));
        }
        let ratio = self.left_m / known.sd_m;
        if ratio > LEAST_MISFIT_RATIO && self.left_m - known.sd_m > LEAST_ERRORS * known.standard_error_m {
            let by_cycles = self.cycles.is_some_and(|cycles| self.left_m < 1.3 * cycles.whole.sd_m);
            let why = if by_cycles {
                "about as much as successive cycles differ, so that most of it is not the same in every cycle"
            } else {
                "the model misses something, or the noise is slow"
            };
            let seen = if self.rest.is_some() { "rests show" } else { "neighbouring positions show" };
            found.push(format!(
                "What the fit leaves ({}) is {} what {seen}: {why}.",
                short_um(self.left_m),
                times(ratio)
            ));
        }
        found
    }
}

/// A change of gain shows from this score and this share of the scatter on: one pair reaches it by chance once in 2,000, more pairs less often.
const LEAST_GAIN_SCORE: f64 = 12.0;
const LEAST_GAIN_SHARE: f64 = 0.1;

impl CycleSpread {
    fn has_gain(&self) -> bool {
        self.gain_score > LEAST_GAIN_SCORE && self.whole.sd_m > (1.0 + LEAST_GAIN_SHARE) * self.within.sd_m
    }

    /// With the error that it has where no gain changes, which is what a test of that asks for.
    fn whole_by_chance(&self) -> Spread {
        Spread { standard_error_m: self.within.standard_error_m, ..self.whole }
    }

    /// A shift of whole cycles shows, and the likelihood does not take it for slow noise.
    fn has_offset(&self, restricted: RestrictedSpread) -> bool {
        let [process_um, offset_um] =
            [OU_SD, OFFSET_SD].map(|parameter| restricted.model.value(&restricted.noise, &parameter));
        self.offset_score > LEAST_GAIN_SCORE && offset_um > process_um
    }

    fn against(&self, neighbours: Spread, restricted: RestrictedSpread) -> String {
        let excess_m2 = self.whole.sd_m.powi(2) - neighbours.sd_m.powi(2);
        let by_gain_m2 = self.whole.sd_m.powi(2) - self.within.sd_m.powi(2);
        let why = if by_gain_m2 > 0.5 * excess_m2 && self.has_gain() {
            format!("about {:.1} % change of gain from cycle to cycle", 100.0 * self.gain_sd)
        } else if by_gain_m2 > 0.5 * excess_m2 && self.has_offset(restricted) {
            "cycles are shifted against each other".into()
        } else {
            "the noise is slow, or something changes from cycle to cycle".into()
        };
        let (one, other) = (short_um(neighbours.sd_m), short_um(self.whole.sd_m));
        format!("Neighbouring positions scatter by {one}, but cycles differ by {other}: {why}.")
    }
}

fn exceeds(larger: Spread, smaller: Spread) -> bool {
    let error_m = larger.standard_error_m.hypot(smaller.standard_error_m);
    larger.sd_m - smaller.sd_m > (LEAST_ERRORS * error_m).max(LEAST_FRACTION * smaller.sd_m)
}

/// Value and standard error, the latter with two digits.
fn um(spread: Spread) -> String {
    let error_um = 1e6 * spread.standard_error_m;
    let decimals =
        if error_um > 0.0 && error_um.is_finite() { (1.0 - error_um.log10().floor()).clamp(0.0, 6.0) } else { 2.0 };
    format!("{:.*} ± {error_um:.*} µm", decimals as usize, 1e6 * spread.sd_m, decimals as usize)
}

fn short_um(sd_m: f64) -> String {
    let sd_um = 1e6 * sd_m;
    if sd_um < 1.0 {
        format!("{sd_um:.3} µm")
    } else if sd_um < 20.0 {
        format!("{sd_um:.1} µm")
    } else {
        format!("{sd_um:.0} µm")
    }
}

fn times(ratio: f64) -> String {
    const WORDS: [&str; 9] = ["twice", "three", "four", "five", "six", "seven", "eight", "nine", "ten"];
    match ratio.round() as usize {
        2 if ratio > 1.8 => WORDS[0].into(),
        n @ 3..=10 => format!("{} times", WORDS[n - 2]),
        n if n > 10 => format!("{n} times"),
        _ => format!("{ratio:.1} times"),
    }
}

#[cfg(test)]
mod tests;
