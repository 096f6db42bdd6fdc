//! Surrogate of an external program in one record: its trajectories in the region of the data, accurate to a share of the noise.

mod nearest;

use std::sync::Arc;

use super::outside::{ExternalModel, LearnedBox};
use super::problem::{Problem, TAIL_MASS};
use crate::monitor::{Counter, Monitor};
use base::error::{Error, Result, Setting};
use laws::stages::SharedStepper;
use models::model::TrainedRange;
use models::surrogate::trajectory::{
    Clock, EXTERNAL_MAX_POINTS, EXTERNAL_TOLERANCE, ExternalStepper, ExternalSurface, ExternalTraining,
};
use nearest::fit_to_data;
use record::Force;

/// Half widths of the box, in standard deviations of a parameter's logarithm. Added effects move parameters by several standard deviations, and by twenty if the base
/// model misses the data by far. If polynomials are not accurate enough in a box, the next smaller one is tried.
const WIDTHS: [f64; 4] = [32.0, 16.0, 10.0, 6.0];
/// Base to whose powers half widths are rounded up, and share of the width to which middles are rounded. Similar fits thus use the same predictions.
const WIDTH_STEP: f64 = std::f64::consts::SQRT_2;
const CENTRE_SHARE: f64 = 0.25;
/// Smallest half width, in standard deviations of the prior.
const NARROWEST: f64 = 0.05;
/// Probability of a normal distribution beyond one standard deviation, on one side.
const ONE_SD: f64 = 0.1587;
/// Largest allowed error over the noise if the model misses the data by more than the noise.
const LARGEST_BESIDE_MISFIT: f64 = 0.2;
/// Largest error over the noise at which conclusions are possible.
const LARGEST_ERROR: f64 = 0.5;
/// Assumed noise relative to the range of positions, if the noise is unknown.
const UNKNOWN_NOISE: f64 = 1e-3;

/// The learnt surrogate.
pub struct ExternalSurrogate {
    /// Stepper that replaces the program.
    pub stepper: SharedStepper,
    /// Box in which the surrogate was learnt.
    pub trained: Vec<TrainedRange>,
    /// Largest error at test points outside the training set, over the noise.
    pub over_noise: f64,
}

/// Learns the program in the region of the fitted cycles. `with_load` is set if the force can differ from the commanded one.
///
/// # Errors
/// [`Error::Numerical`] with the server's message, or if the polynomials' error exceeds half of the noise.
pub fn learn_external(
    problem: &Problem,
    outside: &ExternalModel,
    with_load: bool,
    monitor: &dyn Monitor,
) -> Result<ExternalSurrogate> {
    let record = &problem.experiment.record;
    let specs = problem.model.base().parameters();
    let ranges: Vec<TrainedRange> = specs.iter().map(|spec| problem.range_of(spec.name, TAIL_MASS)).collect();
    let free: Vec<usize> = (0..ranges.len()).filter(|k| ranges[*k].lower < ranges[*k].upper).collect();
    let template: Vec<f64> = ranges.iter().map(|range| range.lower).collect();
    let yardstick = problem.experiment.reference_noise().map(|yardstick| yardstick.sd_m);
    let noise_m = yardstick.unwrap_or(UNKNOWN_NOISE * problem.experiment.scales().position_range_m);
    // A box that serves one model of the experiment serves all its models.
    let (boxes, allowed): (Vec<Vec<TrainedRange>>, f64) = match (outside.learnt_in(), &free[..]) {
        (Some(LearnedBox { trained, allowed }), _) => {
            (vec![ranges.iter().zip(trained).map(|(range, kept)| within(range, kept)).collect()], *allowed)
        }
        (None, []) => (vec![ranges.clone()], EXTERNAL_TOLERANCE),
        (None, _) => {
            monitor.stage(&format!("fitting {} to the data", outside.title()));
            let found = fit_to_data(problem, outside, &template, &free, noise_m, &WIDTHS)?;
            let boxes = found.reaches.iter().map(|reaches| box_about(problem, &ranges, &free, &found.ln, reaches));
            // A narrow box would cut off the posterior. That is worse than an error that is small relative to the model's misfit.
            let allowed = (EXTERNAL_TOLERANCE * found.over_noise).clamp(EXTERNAL_TOLERANCE, LARGEST_BESIDE_MISFIT);
            (boxes.collect(), allowed)
        }
    };
    let (time_s, force) = (&record.time_s[..], record.force());
    let clock = if with_load { Clock::finer(time_s, force) } else { Clock::of_rows(time_s) };
    let ask = |parameters: &[f64], force_n: &[f64]| {
        outside.position_m(parameters, &clock.time_s, Force { at_rows_n: force_n, ..force })
    };
    let mut best: Option<(ExternalSurface, Vec<TrainedRange>)> = None;
    for trained in boxes {
        let ends: Vec<(f64, f64)> = trained.iter().map(|range| (range.lower, range.upper)).collect();
        monitor.stage(&format!("learning {}", outside.title()));
        let counter = Counter::new(monitor, EXTERNAL_MAX_POINTS);
        let lesson = ExternalTraining { ends: &ends, clock: &clock, time_s, force, noise_m, with_load };
        let surface = ExternalSurface::learn(&lesson, &ask, &|| counter.add_one())?;
        let is_better = best.as_ref().is_none_or(|(other, _)| surface.certified() < other.certified());
        let is_done = surface.certified() <= allowed || free.is_empty();
        if is_better {
            best = Some((surface, trained));
        }
        if is_done {
            break;
        }
    }
    let Some((surface, trained)) = best else {
        return Err(Error::numerical(
            "no surrogate of the external program was learnt",
            "give a prior for every parameter",
        ));
    };
    let over_noise = surface.certified();
    if over_noise.is_nan() || over_noise > LARGEST_ERROR {
        return Err(Error::numerical(
            format!(
                "the surrogate of {}, learnt from {} predictions, misses others by {over_noise:.2} of the noise; conclusions need at most {LARGEST_ERROR}",
                outside.title(),
                surface.n_points()
            ),
            format!(
                "narrow the prior ({}), fix parameters that the data do not determine ({}), or make the model smoother",
                Setting::Prior,
                Setting::Fixed
            ),
        ));
    }
    if over_noise > allowed {
        monitor.warn(&format!(
            "the surrogate of {} misses test predictions by up to {over_noise:.2} of the noise, more than {allowed:.2}: narrow the prior, or fix a parameter, for a better one",
            outside.title()
        ));
    }
    let ends: Vec<(f64, f64)> = trained.iter().map(|range| (range.lower, range.upper)).collect();
    let lesson = ExternalTraining { ends: &ends, clock: &clock, time_s, force, noise_m, with_load };
    let stepper = SharedStepper(Arc::new(ExternalStepper::new(surface, &lesson)));
    outside.keep_ground(LearnedBox { trained: trained.clone(), allowed });
    Ok(ExternalSurrogate { stepper, trained, over_noise })
}

/// Range of a parameter in a model: its own fixed value, or the box's range.
fn within(trained_range: &TrainedRange, kept: &TrainedRange) -> TrainedRange {
    if trained_range.lower == trained_range.upper || kept.lower == kept.upper {
        trained_range.clone()
    } else {
        kept.clone()
    }
}

/// Box that extends down and up by `reaches` from the best fit.
fn box_about(
    problem: &Problem,
    ranges: &[TrainedRange],
    free: &[usize],
    ln: &[f64],
    reaches: &[[f64; 2]],
) -> Vec<TrainedRange> {
    let mut trained = ranges.to_vec();
    for ((k, ln), reach) in free.iter().zip(ln).zip(reaches) {
        let of_prior = problem.range_of(&ranges[*k].name, ONE_SD);
        let prior_sd = 0.5 * (of_prior.upper / of_prior.lower).ln();
        trained[*k] = about(&ranges[*k], *ln, reach.map(|reach| reach.max(NARROWEST * prior_sd)));
    }
    trained
}

/// Part of a range from `below` a logarithm to `above` it, slightly widened by rounding.
fn about(range: &TrainedRange, ln: f64, [below, above]: [f64; 2]) -> TrainedRange {
    let (lower, upper) = (range.lower.ln(), range.upper.ln());
    let (first, last) = ((ln - below).max(lower), (ln + above).min(upper));
    let half = 0.5 * (last - first);
    if half.is_nan() || half >= 0.5 * (upper - lower) {
        return range.clone();
    }
    let half = WIDTH_STEP.powf(half.log(WIDTH_STEP).ceil());
    let step = CENTRE_SHARE * half;
    let middle = (0.5 * (first + last) / step).round() * step;
    let inside = |end: f64, prior: f64, is_beyond: bool| if is_beyond { prior } else { end.exp() };
    TrainedRange {
        name: range.name.clone(),
        lower: inside(middle - half, range.lower, middle - half <= lower),
        upper: inside(middle + half, range.upper, middle + half >= upper),
    }
}
