//! Noise estimated by several methods, each of which misses a different part of the noise. A disagreement between methods is a finding.
//!
//! | source | method | misses |
//! |---|---|---|
//! | rest records | scatter about a line without force | noise slower than a rest; gain |
//! | short-lag differences | second differences late in holds | slow noise, gain, offset |
//! | cycle-to-cycle differences | differences of a fit's residuals after equal force steps of successive cycles | errors repeated in every cycle |
//! | restricted maximum likelihood | white, process, gain and offset; the law's parameters are integrated out | nothing, but counts the model's misfit as noise |
//!
//! Reference for restricted maximum likelihood: Patterson & Thompson, *Biometrika* 58, 545 (1971), doi:10.1093/biomet/58.3.545.

mod records;
mod restricted;

use super::{Candidate, Fitted, Subject};
use crate::NoiseValues;
use base::error::Result;
use base::parameter::{OFFSET_SD, SLOW_NOISE_SD};
use documents::diagnosis::NoiseEstimate;
use posterior::noise::NoiseModel;
use record::Record;

/// A standard deviation and its standard error, both in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseEstimateSd {
    /// Standard deviation of one position's error, in m.
    pub sd_m: f64,
    /// Standard error of `sd_m`.
    pub standard_error_m: f64,
}

/// Noise estimate from the differences between successive cycles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CycleSpread {
    /// Standard deviation of one position, gains and offsets of cycles included.
    pub whole: NoiseEstimateSd,
    /// Standard deviation of one position after removal of each cycle's gain and offset.
    pub within: NoiseEstimateSd,
    /// Standard deviation of a cycle's gain; 0 if no change is detected.
    pub gain_sd: f64,
    /// Standard error of `gain_sd`, limited by the number of cycles.
    pub gain_standard_error: f64,
    /// Mean square of the changes of gain between cycles, divided by its value by chance.
    pub gain_score: f64,
    /// Mean square of the shifts between cycles, divided by its value by chance.
    pub offset_score: f64,
    /// Number of pairs of successive cycles that are compared.
    pub n_pairs: usize,
}

/// Noise estimate from the restricted likelihood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestrictedSpread {
    /// Standard deviation from row to row: white errors and the process together.
    pub row: NoiseEstimateSd,
    /// Noise terms of the estimate.
    pub model: NoiseModel,
    /// Noise parameters in their units, in the order of the model.
    pub noise: NoiseValues,
}

/// Noise estimates by all methods.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseEstimates {
    /// Estimate from rest records; `None` if there are none.
    pub rest: Option<NoiseEstimateSd>,
    /// Estimate from neighbouring positions late in holds; `None` if there are too few.
    pub neighbours: Option<NoiseEstimateSd>,
    /// Estimate from successive cycles; `None` if they cannot be compared.
    pub cycles: Option<CycleSpread>,
    /// Estimate by restricted maximum likelihood.
    pub restricted: RestrictedSpread,
    /// Root mean square residual of the fit, in m, at the fitted rows.
    pub left_m: f64,
}

/// Least difference of two estimates, in standard errors, at which they disagree. The difference must also exceed the fraction `LEAST_FRACTION` of the smaller estimate.
const LEAST_ERRORS: f64 = 3.5;
const LEAST_FRACTION: f64 = 0.2;
/// Ratio of a fit's residual to the noise above which the residual is a misfit.
const LEAST_MISFIT_RATIO: f64 = 1.5;

/// Learns the noise of the fitted cycles from the record and from a fit of a candidate.
///
/// # Errors
/// [`base::Error::Numerical`] if the candidate has no derivatives at its fit.
pub fn learn(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<NoiseEstimates> {
    let record = Record { position_m: subject.fitted_m.clone(), ..subject.experiment().record.clone() };
    Ok(NoiseEstimates {
        rest: records::at_rest(&record),
        neighbours: records::of_neighbours(&record),
        cycles: records::of_cycles(&record, &fitted.position_m),
        restricted: restricted::learn(subject, candidate, fitted)?,
        left_m: fitted.rmse_m(&subject.fitted_m).unwrap_or(0.0),
    })
}

impl NoiseEstimates {
    /// Returns one statement per method, for the document and the terminal.
    pub fn estimates(&self) -> Vec<NoiseEstimate> {
        let entry = |from: &str, spread: Option<NoiseEstimateSd>, text: String| NoiseEstimate {
            from: from.into(),
            sd_um: spread.map(|spread| 1e6 * spread.sd_m),
            standard_error_um: spread.map(|spread| 1e6 * spread.standard_error_m),
            text,
        };
        let at_rest = self.rest.map_or_else(
            || "Rest records: this experiment has none of sufficient length.".into(),
            |rest| {
                format!("Rest records: {} about a line without force; this does not include changes of gain.", um(rest))
            },
        );
        let by_neighbours = self.neighbours.map_or_else(
            || "Short-lag differences: too few positions late in holds.".into(),
            |neighbours| {
                format!(
                    "Short-lag differences: {} from neighbouring positions late in holds; this does not include slow noise or changes of gain.",
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
                    "Cycle-to-cycle differences: {} from {pairs} of successive cycles, {} after removal of each cycle's gain and offset{gain}; errors that recur in every cycle are not included.",
                    um(cycles.whole),
                    um(cycles.within)
                )
            },
        );
        let [of_rows, of_cycles] = self.restricted.model.describe(&self.restricted.noise).map(|words| words.join(", "));
        let by_likelihood = format!(
            "Restricted maximum likelihood: {} from row to row ({of_rows}), {of_cycles}; this includes the model's misfit.",
            um(self.restricted.row),
        );
        vec![
            entry("rest records", self.rest, at_rest),
            entry("short-lag differences", self.neighbours, by_neighbours),
            entry("cycle-to-cycle differences", self.cycles.map(|cycles| cycles.whole), by_cycles),
            entry("restricted maximum likelihood", Some(self.restricted.row), by_likelihood),
        ]
    }

    /// Returns one sentence for every disagreement that exceeds the errors.
    pub fn disagreements(&self) -> Vec<String> {
        let mut found = Vec::new();
        if let (Some(rest), Some(neighbours)) = (self.rest, self.neighbours)
            && exceeds(rest, neighbours)
        {
            found.push(format!(
                "At rest, positions scatter by {}, but neighbouring positions by {}: the noise is slow, or the bead still moves at rest.",
                short_um(rest.sd_m),
                short_um(neighbours.sd_m)
            ));
        }
        // Noise of single rows, from rests if possible, else from neighbours.
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
                "about the difference between successive cycles, so most of it does not recur in every cycle"
            } else {
                "the model has a misfit, or the noise is slow"
            };
            let seen = if self.rest.is_some() { "of rests" } else { "of neighbouring positions" };
            found.push(format!(
                "The fit's residual ({}) is {} the noise {seen}: {why}.",
                short_um(self.left_m),
                times(ratio)
            ));
        }
        found
    }
}

/// Least score at which a change of gain counts as detected. It must also increase the scatter by the fraction `LEAST_GAIN_SHARE`. By chance, one pair of cycles reaches
/// the score once in 2,000; more pairs reach it less often.
const LEAST_GAIN_SCORE: f64 = 12.0;
const LEAST_GAIN_SHARE: f64 = 0.1;

impl CycleSpread {
    fn has_gain(&self) -> bool {
        self.gain_score > LEAST_GAIN_SCORE && self.whole.sd_m > (1.0 + LEAST_GAIN_SHARE) * self.within.sd_m
    }

    /// Standard deviation of one position, gains and offsets included. Its error assumes that the gain is constant, because it serves to test whether the gain changes.
    fn whole_by_chance(&self) -> NoiseEstimateSd {
        NoiseEstimateSd { standard_error_m: self.within.standard_error_m, ..self.whole }
    }

    /// Returns whether a shift of whole cycles is detected and the likelihood does not attribute it to slow noise.
    fn has_offset(&self, restricted: RestrictedSpread) -> bool {
        let [process_um, offset_um] =
            [SLOW_NOISE_SD, OFFSET_SD].map(|parameter| restricted.model.value(&restricted.noise, &parameter));
        self.offset_score > LEAST_GAIN_SCORE && offset_um > process_um
    }

    fn against(&self, neighbours: NoiseEstimateSd, restricted: RestrictedSpread) -> String {
        let excess_m2 = self.whole.sd_m.powi(2) - neighbours.sd_m.powi(2);
        let by_gain_m2 = self.whole.sd_m.powi(2) - self.within.sd_m.powi(2);
        let why = if by_gain_m2 > 0.5 * excess_m2 && self.has_gain() {
            format!("about {:.1} % change of gain from cycle to cycle", 100.0 * self.gain_sd)
        } else if by_gain_m2 > 0.5 * excess_m2 && self.has_offset(restricted) {
            "cycles are shifted against each other".into()
        } else {
            "the noise is slow, or the cycles differ".into()
        };
        let (one, other) = (short_um(neighbours.sd_m), short_um(self.whole.sd_m));
        format!("Neighbouring positions scatter by {one}, but cycles differ by {other}: {why}.")
    }
}

fn exceeds(larger: NoiseEstimateSd, smaller: NoiseEstimateSd) -> bool {
    let error_m = larger.standard_error_m.hypot(smaller.standard_error_m);
    larger.sd_m - smaller.sd_m > (LEAST_ERRORS * error_m).max(LEAST_FRACTION * smaller.sd_m)
}

/// Writes a value with its standard error; the error has two digits.
fn um(spread: NoiseEstimateSd) -> String {
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
