//! Surrogate of an external program for one record. It predicts trajectories for parameters near the best fit, with an error that is small relative to the noise.

mod nearest;

use std::sync::Arc;

use super::outside::{ExternalModel, TrainedBox};
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

/// Half widths of the parameter boxes in which a surrogate is trained, in standard deviations of a parameter's logarithm. They are tried in turn. Added effects move
/// parameters by several standard deviations, or by twenty if the base model fits badly. If the surrogate's polynomials are not accurate enough in a box, the next
/// smaller box is tried.
const WIDTHS: [f64; 4] = [32.0, 16.0, 10.0, 6.0];
/// Base of the rounding of parameter boxes: their half widths are rounded up to powers of this base. Similar fits thus have equal boxes and use the same cached
/// predictions.
const WIDTH_STEP: f64 = std::f64::consts::SQRT_2;
/// Unit to which the middle of a parameter box is rounded, as a fraction of the box's half width.
const CENTRE_SHARE: f64 = 0.25;
/// Smallest half width of a parameter box around the best fit, in standard deviations of the prior.
const NARROWEST: f64 = 0.05;
/// Probability of a normal distribution beyond one standard deviation, on one side.
const ONE_SD: f64 = 0.1587;
/// Largest allowed error of the surrogate, divided by the noise, if the model's residuals exceed the noise.
const LARGEST_BESIDE_MISFIT: f64 = 0.2;
/// Largest error of the surrogate, divided by the noise, with which the surrogate is used. A larger error is refused.
const LARGEST_ERROR: f64 = 0.5;
/// Assumed noise, as a fraction of the range of positions, if the noise is unknown.
const UNKNOWN_NOISE: f64 = 1e-3;

/// Trained surrogate of an external program for one record.
pub struct ExternalSurrogate {
    /// Stepper that computes trajectories in place of the program.
    pub stepper: SharedStepper,
    /// Range of each parameter in which the surrogate was trained.
    pub trained: Vec<TrainedRange>,
    /// Largest error at test points outside the training set, divided by the noise.
    pub over_noise: f64,
}

/// Learns a surrogate of the program for parameters that fit the fitted cycles. Set `with_load` if effects can change the commanded force.
///
/// # Errors
/// [`Error::Numerical`] with the server's message, or if the surrogate's error exceeds half of the noise.
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
    // All models of an experiment use the same parameter box, so that the models are comparable.
    let (boxes, allowed): (Vec<Vec<TrainedRange>>, f64) = match (outside.trained_box(), &free[..]) {
        (Some(TrainedBox { trained, allowed }), _) => {
            (vec![ranges.iter().zip(trained).map(|(range, kept)| within(range, kept)).collect()], *allowed)
        }
        (None, []) => (vec![ranges.clone()], EXTERNAL_TOLERANCE),
        (None, _) => {
            monitor.stage(&format!("fitting {} to the data", outside.title()));
            let found = fit_to_data(problem, outside, &template, &free, noise_m, &WIDTHS)?;
            let boxes = found.reaches.iter().map(|reaches| box_about(problem, &ranges, &free, &found.ln, reaches));
            // A misfit allows a larger error, and thus a wider box. A narrow box would cut off the posterior, which is worse than an error that is small relative to
            // the misfit.
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
                "the surrogate of {}, learnt from {} predictions, misses test predictions by {over_noise:.2} of the noise; at most {LARGEST_ERROR} is allowed",
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
    outside.store_trained_box(TrainedBox { trained: trained.clone(), allowed });
    Ok(ExternalSurrogate { stepper, trained, over_noise })
}

/// Range of a parameter in a model: the experiment's common range `kept`, or the model's range if either range is a single value.
fn within(trained_range: &TrainedRange, kept: &TrainedRange) -> TrainedRange {
    if trained_range.lower == trained_range.upper || kept.lower == kept.upper {
        trained_range.clone()
    } else {
        kept.clone()
    }
}

/// Box around the best fit `ln` (logarithms of the free parameters). It extends down and up by `reaches`, but at least by [`NARROWEST`] standard deviations of the
/// prior.
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

/// Range from `ln − below` to `ln + above` in the logarithm, cut at the ends of `range` and slightly widened by rounding.
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
