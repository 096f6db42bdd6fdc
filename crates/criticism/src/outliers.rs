//! Isolated errors of the tracker. They are excluded before any comparison, so that all models use one set of rows and likelihoods stay comparable.
//!
//! A large residual does not prove an outlier. If the model lacks an effect, residuals are large, and just after a force step they are sharp. So each row is
//! compared with its neighbours and with other force steps. A row is an outlier if, in the residual of a fit,
//!
//! 1. it departs in one direction from both the rows before and those after it, unlike a slip, a slope or a kink;
//! 2. it belongs to a run of at most three rows with a jump on either side, unlike a bump, which rises and falls gradually;
//! 3. hardly any other force step shows a proportional departure at that time after it, unlike a missing effect, which repeats.
//!
//! All three rules compare rows with others a few samples away. Gains and offsets of cycles, drift and slow noise hardly affect such differences, so none needs to be
//! removed first. Thresholds are multiples of the scatter of such differences, not of the misfit.

use std::ops::Range;

use super::{Candidate, Fitted, Search, Subject};
use base::error::Result;
use record::Record;
use record::noise::SD_PER_MAD;
use record::robust::median;

/// Number of rows before and after a row with which the row is compared. The medians of both sides are used: two bad rows among five do not affect a median.
const N_NEIGHBOURS: usize = 5;
/// Least number of neighbours on one side. If one side has fewer, as at the record's ends, only the other side counts. The departure from that side is then multiplied by
/// `ONE_SIDE`.
const FEWEST_NEIGHBOURS: usize = 2;
const ONE_SIDE: f64 = 2.0 / 3.0;
/// Largest distance of neighbours, in sample intervals.
const REACH_INTERVALS: f64 = 10.0;
/// Least departure of an outlier, in robust standard deviations of the departures of all rows.
const THRESHOLD: f64 = 5.0;
/// Least jump between an outlier and the next rows, in robust standard deviations of the departures of all rows.
const EDGE: f64 = 3.5;
/// Largest difference at which departures after two force steps count as equal, in robust standard deviations of the departures of all rows.
const SAME: f64 = 4.0;
/// Relative difference up to which departures after two force steps count as equal.
const SAME_FRACTION: f64 = 0.33;
const LONGEST_BURST: usize = 3;
/// Largest ratio of the heights of two force steps that are compared. Steps with larger ratios are compared only if there are no others.
const LARGEST_RATIO: f64 = 1.25;
/// Number of force steps above which only every second, third, … step is compared. So many steps still show a departure that occurs after a third of all steps, and the
/// cost stays linear in the number of steps.
const MOST_COMPARED: usize = 512;
/// Number of rows that are not judged after a force step without comparable steps.
const UNJUDGED_ROWS: usize = 10;
/// Largest difference at which the times after two force steps count as equal, in sample intervals.
const SAME_TIME_INTERVALS: f64 = 0.1;
/// Least standard deviation of departures, as a fraction of the known or estimated noise: positions rounded to pixels may not differ at all.
const LEAST_SCALE: f64 = 0.25;

/// Returns an experiment without its outliers, the fit of a model to it, and the excluded rows.
///
/// # Errors
/// Errors of fitting the model.
pub fn exclude_outliers(subject: &Subject, candidate: &Candidate) -> Result<(Subject, Fitted, Vec<usize>)> {
    let first = subject.fit(candidate, &[], Search::Wide)?;
    let rows = find_outliers(subject, &first);
    if rows.is_empty() {
        return Ok((subject.clone(), first, rows));
    }
    let subject = subject.without_rows(&rows);
    let fitted = subject.fit(candidate, &[(first.theta, first.noise)], Search::Wide)?;
    Ok((subject, fitted, rows))
}

/// Returns the rows of outliers (from 0, in order) among the fitted and the scored positions. The residuals are those of a fit, such as the base model's.
pub fn find_outliers(subject: &Subject, fitted: &Fitted) -> Vec<usize> {
    let residual_m: Vec<Option<f64>> = subject
        .observed_m()
        .into_iter()
        .zip(&fitted.position_m)
        .map(|(observed, position)| Some(observed? - position))
        .collect();
    rows_of(&subject.experiment().record, &residual_m, LEAST_SCALE * subject.reference_noise_m())
}

/// Rows of outliers among residuals (m, one per row of the record). The standard deviation of departures is at least `least_scale_m`.
fn rows_of(record: &Record, residual_m: &[Option<f64>], least_scale_m: f64) -> Vec<usize> {
    let Some(interval_s) = record.median_interval_s() else { return Vec::new() };
    let rows: Vec<usize> = (0..residual_m.len()).filter(|row| residual_m[*row].is_some()).collect();
    let time_s: Vec<f64> = rows.iter().map(|row| record.time_s[*row]).collect();
    let residual_m: Vec<f64> = residual_m.iter().flatten().copied().collect();
    let departures: Vec<Option<Departure>> =
        (0..rows.len()).map(|place| departure(&time_s, &residual_m, place, REACH_INTERVALS * interval_s)).collect();
    let sizes: Vec<f64> = departures.iter().flatten().map(|departure| departure.from_both_m.abs()).collect();
    let scale_m = (SD_PER_MAD * median(sizes).unwrap_or(0.0)).max(least_scale_m);
    let stands_out = |place: &usize| {
        departures[*place].as_ref().is_some_and(|departure| departure.one_sided_m > THRESHOLD * scale_m)
    };
    let suspects: Vec<usize> = (0..rows.len()).filter(stands_out).collect();
    let steps = Steps::new(record, &time_s, interval_s);
    let is_outlier = |place: &usize| !steps.may_belong_to_step(&departures, *place, scale_m);
    bursts(&suspects)
        .into_iter()
        .filter(|burst| has_sharp_edges(&residual_m, burst, EDGE * scale_m))
        .flatten()
        .filter(is_outlier)
        .map(|place| rows[place])
        .collect()
}

/// Departure of a position from its neighbours in time.
struct Departure {
    /// Position minus the mean of two medians, in m: those of the rows before and after it. If one side has too few rows, only the other median counts.
    from_both_m: f64,
    /// Size of the departure in m: the distance to the nearer median of the two sides, or 0 if the position lies between them. With one median only, it is the distance to that
    /// median times `ONE_SIDE`.
    one_sided_m: f64,
}

/// Returns the departure of the position with the index `place`; `None` if both sides have too few neighbours.
fn departure(time_s: &[f64], residual_m: &[f64], place: usize, reach_s: f64) -> Option<Departure> {
    let is_near = |other: &usize| (time_s[*other] - time_s[place]).abs() <= reach_s;
    let of_side = |side: Vec<usize>| -> Option<f64> {
        let near: Vec<f64> = side.into_iter().filter(is_near).map(|other| residual_m[other]).collect();
        if near.len() < FEWEST_NEIGHBOURS { None } else { median(near).map(|middle_m| residual_m[place] - middle_m) }
    };
    let before_m = of_side((place.saturating_sub(N_NEIGHBOURS)..place).collect());
    let after_m = of_side((place + 1..residual_m.len().min(place + 1 + N_NEIGHBOURS)).collect());
    let (Some(before_m), Some(after_m)) = (before_m, after_m) else {
        return before_m.or(after_m).map(|m| Departure { from_both_m: m, one_sided_m: ONE_SIDE * m.abs() });
    };
    let standing_out_m = if before_m * after_m > 0.0 { before_m.abs().min(after_m.abs()) } else { 0.0 };
    Some(Departure { from_both_m: 0.5 * (before_m + after_m), one_sided_m: standing_out_m })
}

/// Groups indices of positions into runs of successive indices, and drops runs longer than [`LONGEST_BURST`].
fn bursts(places: &[usize]) -> Vec<Range<usize>> {
    let runs = places.chunk_by(|a, b| a + 1 == *b).map(|run| run[0]..run[0] + run.len());
    runs.filter(|run| run.len() <= LONGEST_BURST).collect()
}

/// Returns whether a burst's first and last rows jump away from the rows next to it, if such rows exist.
fn has_sharp_edges(residual_m: &[f64], burst: &Range<usize>, least_m: f64) -> bool {
    let jump_m = |inside: usize, outside: Option<usize>| {
        let outside = outside.and_then(|outside| residual_m.get(outside));
        outside.map_or(f64::INFINITY, |outside| (residual_m[inside] - outside).abs())
    };
    jump_m(burst.start, burst.start.checked_sub(1)) > least_m && jump_m(burst.end - 1, Some(burst.end)) > least_m
}

/// A force step and the positions up to the next step.
struct OutlierStep {
    start_s: f64,
    end_s: f64,
    height_n: f64,
    /// Indices of the observed positions.
    places: Range<usize>,
}

/// The force steps of a record and its observed positions.
struct Steps<'a> {
    steps: Vec<OutlierStep>,
    time_s: &'a [f64],
    interval_s: f64,
}

impl<'a> Steps<'a> {
    fn new(record: &Record, time_s: &'a [f64], interval_s: f64) -> Self {
        let step_rows = record.force_step_rows();
        let step = |(number, row): (usize, &usize)| {
            let start_s = record.time_s[*row];
            let end_s = step_rows.get(number + 1).map_or(f64::INFINITY, |next| record.time_s[*next]);
            let before_n = row.checked_sub(1).map_or(0.0, |before| record.force_n[before]);
            // A position is the limit from the left: at the step's own row it still belongs to the previous hold.
            let of_step = |time_s: &f64, bound_s: f64| *time_s <= bound_s;
            let places = time_s.partition_point(|t| of_step(t, start_s))..time_s.partition_point(|t| of_step(t, end_s));
            OutlierStep { start_s, end_s, height_n: record.force_n[*row] - before_n, places }
        };
        let steps = step_rows.iter().enumerate().map(step).collect();
        Self { steps, time_s, interval_s }
    }

    /// Returns whether a position's departure may belong to its force step. This is so if more than a third of the other force steps show it, or if the position follows
    /// a step without comparable steps.
    fn may_belong_to_step(&self, departures: &[Option<Departure>], place: usize, scale_m: f64) -> bool {
        // Steps are ordered in time.
        let step_place = self.steps.partition_point(|step| step.places.end <= place);
        if self.steps.get(step_place).is_none_or(|step| !step.places.contains(&place)) {
            return false;
        }
        let step = &self.steps[step_place];
        let after_s = self.time_s[place] - step.start_s;
        let seen_m = departures[place].as_ref().map_or(0.0, |departure| departure.from_both_m);
        let every = self.steps.len().div_ceil(MOST_COMPARED).max(1);
        let mut others: Vec<(f64, Vec<f64>)> = (step_place % every..self.steps.len())
            .step_by(every)
            .filter(|other| *other != step_place)
            .map(|other| (step.height_n / self.steps[other].height_n, self.departures_at(departures, other, after_s)))
            .filter(|(_, there)| !there.is_empty())
            .collect();
        if others.iter().any(|(ratio, _)| ratio.abs() <= LARGEST_RATIO) {
            others.retain(|(ratio, _)| ratio.abs() <= LARGEST_RATIO);
        }
        if others.is_empty() {
            return place - step.places.start < UNJUDGED_ROWS;
        }
        let is_same = |(ratio, there): &&(f64, Vec<f64>)| {
            let expected = || there.iter().map(|there| ratio * there);
            let (lowest, highest) =
                (expected().fold(f64::INFINITY, f64::min), expected().fold(f64::NEG_INFINITY, f64::max));
            let tolerance_m = (SAME * ratio.abs().max(1.0) * scale_m).max(SAME_FRACTION * seen_m.abs());
            seen_m >= lowest - tolerance_m && seen_m <= highest + tolerance_m
        };
        // If only one other step shows the departure, that may be another outlier.
        3 * others.iter().filter(is_same).count() > others.len()
    }

    /// Returns the departures of positions at the time `after_s` (s) after a step: of the position at that time, or of the two positions around it. Empty if there are none.
    fn departures_at(&self, departures: &[Option<Departure>], step: usize, after_s: f64) -> Vec<f64> {
        let step = &self.steps[step];
        let at_s = step.start_s + after_s;
        let same_s = SAME_TIME_INTERVALS * self.interval_s;
        if at_s > step.end_s + same_s {
            return Vec::new();
        }
        let next = self.time_s.partition_point(|t| *t < at_s - same_s);
        let near = |place: &usize| {
            step.places.contains(place) && (self.time_s[*place] - at_s).abs() <= REACH_INTERVALS * self.interval_s
        };
        let is_exact = self.time_s.get(next).is_some_and(|t| *t <= at_s + same_s);
        let around = if is_exact { next..next + 1 } else { next.saturating_sub(1)..next + 1 };
        let at = |place: usize| Some(departures.get(place)?.as_ref()?.from_both_m);
        around.filter(near).filter_map(at).collect()
    }
}

#[cfg(test)]
#[path = "outliers_tests.rs"]
mod tests;
