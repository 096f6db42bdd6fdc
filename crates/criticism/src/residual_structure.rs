//! Summary of the residual that no effect of the library explains: its size, the quantity that it depends on, its contribution to predictions, and its shape.
//!
//! A structure with a shape of its own (a slip, a vibration, backlash) is part of the mean. In addition, or in place of a free curve, the mean contains a Gaussian
//! process along the axis that explains most of the residual ([`super::outside::Discrepancy`]). Both are orthogonal to the tangent space of the model's parameters, which
//! therefore keep their meaning. It is unknown whether, when and with which sign such a structure recurs. So it does not shift predictions. Their variance s² grows by
//! the structure's mean square, s² → s² + ⟨m² + v⟩, with its mean m and variance v in the fitted rows.

use super::criteria::Criteria;
use super::derivatives::columns_m;
use super::outside::{
    Axis, Discrepancy, OutsideKind, OutsideRequest, OutsideStructure, discrepancies, events_over_all_cycles,
};
use super::own_errors::own_fit;
use super::predicted::predictive_noise_um;
use super::refit::Refitted;
use super::{Candidate, Fitted, Subject};
use base::error::{Error, Result, Setting};
use documents::diagnosis::DiscrepancyEntry;
use figures::discrepancy::{DiscrepancyPanel, discrepancy};
use figures::number::format_decimals;
use figures::number::format_significant;
use figures::svg::Svg;
use posterior::misfit::{GainKnowledge, Misfit, Residuals};
use posterior::patterns::{Pattern, TestedFit};

/// Largest distance of a gain change from a cycle's start, as a fraction of the cycle's length, at which the change counts as one between cycles. Positions near zero do not
/// show the exact time.
const CYCLE_EDGE: f64 = 0.05;

/// Misfit of a model: its residual compared with the noise. Structure that no constitutive law can cause, such as a slip of the tracked point, is subtracted first.
///
/// # Errors
/// [`base::Error::Numerical`] if the model has no derivatives at its fit.
pub fn measure_misfit(subject: &Subject, model: &Refitted, unexplained: &[OutsideStructure]) -> Result<Misfit> {
    let (candidate, fitted) = with_structure_outside_law(model, unexplained);
    let left = |positions_m: &[Option<f64>]| -> Vec<Option<f64>> {
        positions_m.iter().zip(&fitted.position_m).map(|(y, x)| y.map(|y| y - x)).collect()
    };
    let remainder = Residuals {
        record: &subject.experiment().record,
        fitted_m: &left(&subject.fitted_m),
        heldout_m: &left(&subject.scored_m),
        position_m: &fitted.position_m,
        absorbed_m: &columns_m(subject, candidate, &fitted.theta)?,
        gains: if subject.declares_gains() { GainKnowledge::Declared } else { GainKnowledge::Learnt },
    };
    let misfit = if subject.is_noise_unknown() {
        Misfit::relative_to_fitted(&remainder)
    } else {
        Misfit::of(&remainder, subject.reference_noise_m(), subject.is_noise_known())
    };
    misfit.ok_or_else(|| Error::numerical("no position is fitted", "fit a cycle that has positions"))
}

/// Pattern in a model's residual beside noise of the terms that the study specifies, as `sample` tests it; `None` if that noise explains the residual.
///
/// # Errors
/// Errors of [`own_fit`] and [`columns_m`].
pub fn remaining_pattern(subject: &Subject, model: &Refitted) -> Result<Option<Pattern>> {
    let (subject, fitted) = own_fit(subject, model)?;
    let fit = TestedFit {
        record: &subject.experiment().record,
        position_m: &fitted.position_m,
        measured_m: [&subject.fitted_m, &subject.scored_m],
        columns_m: &columns_m(&subject, &model.candidate, &fitted.theta)?,
        declared: subject.problem().noise,
        noise: (subject.all.model(), &fitted.noise),
    };
    Ok(fit.clearest_pattern())
}

/// Returns the candidate and fit that contain the leading residual structure, if no constitutive law can cause it. Otherwise returns the model's own candidate and fit.
pub(super) fn with_structure_outside_law<'a>(
    model: &'a Refitted,
    unexplained: &'a [OutsideStructure],
) -> (&'a Candidate, &'a Fitted) {
    with_shape(model, unexplained.first().filter(|outside| outside.kind.is_apart_from_law()))
}

/// Residual that no effect explains, with the data of its figure.
pub struct UnexplainedResidual {
    /// Entry in the document of `diagnose`.
    pub entry: DiscrepancyEntry,
    panels: Vec<DiscrepancyPanel>,
}

impl UnexplainedResidual {
    /// Summarises the structure found in a model's residual. `unexplained` lists it with the leading structure first, and is empty if only the size of the residual reveals
    /// the misfit.
    ///
    /// # Errors
    /// Errors of [`discrepancies`].
    pub fn of(
        subject: &Subject,
        model: &Refitted,
        unexplained: &[OutsideStructure],
        (criteria, request): (&Criteria, &OutsideRequest),
    ) -> Result<Self> {
        let leading = unexplained.first();
        let curve = leading.and_then(|outside| outside.kind.axis_of_curve());
        let shape = leading.filter(|_| curve.is_none());
        let (candidate, fitted) = with_shape(model, shape);
        let processes = discrepancies(subject, candidate, fitted, request)?;
        let process = match (curve, shape) {
            (Some(axis), _) => processes.into_iter().find(|process| process.axis == axis),
            (None, Some(_)) => {
                processes.into_iter().next().filter(|process| process.p_familywise <= criteria.largest_process_p)
            }
            (None, None) => processes.into_iter().next(),
        };
        let rows: Vec<usize> = (0..subject.fitted_m.len()).filter(|row| subject.fitted_m[*row].is_some()).collect();
        let mean_square =
            |of_row: &dyn Fn(usize) -> f64| rows.iter().map(|row| of_row(*row)).sum::<f64>() / rows.len().max(1) as f64;
        let mean_m = |row: usize| {
            shape.map_or(0.0, |shape| shape.discrepancy_m[row])
                + process.as_ref().map_or(0.0, |discrepancy| discrepancy.mean_m[row])
        };
        let variance_m2 = |row: usize| process.as_ref().map_or(0.0, |discrepancy| discrepancy.sd_m[row].powi(2));
        let size_m2 = mean_square(&|row| mean_m(row).powi(2));
        let predicted =
            if subject.scored_m.iter().any(Option::is_some) { &subject.scored_m } else { &subject.fitted_m };
        let beside = process.as_ref().map_or(fitted, |discrepancy| &discrepancy.fitted);
        let noise_um = predictive_noise_um(subject, candidate, beside, predicted).ok_or_else(|| {
            Error::numerical(
                "the model has no derivatives at its fit",
                format!("diagnose another revision with `{}`", Setting::Revision),
            )
        })?;
        let widened_um = (noise_um.powi(2) + 1e12 * (size_m2 + mean_square(&variance_m2))).sqrt();
        let axis = match (shape, &process) {
            (Some(shape), _) => axis_of_shape(shape.kind),
            (None, Some(item)) => item.axis.name(),
            (None, None) => Axis::AbsoluteTime.name(),
        };
        let entry = DiscrepancyEntry {
            axis: axis.into(),
            sentence: sentence(subject, leading, process.as_ref(), &rows),
            size_um: 1e6 * size_m2.sqrt(),
            p_familywise: leading.map_or_else(
                || process.as_ref().map_or(1.0, |current| current.p_familywise),
                |outside| outside.p_familywise,
            ),
            predictive_noise_um: noise_um,
            predictive_noise_with_discrepancy_um: widened_um,
        };
        let of_shape = shape.map(|shape| panel_of_shape(subject, shape, &rows));
        let of_process = process.as_ref().map(|discrepancy| panel_of_process(discrepancy, &rows));
        Ok(Self { entry, panels: of_shape.into_iter().chain(of_process).collect() })
    }

    /// Draws the figure of the unexplained residual.
    ///
    /// # Errors
    /// Errors of [`discrepancy`].
    pub fn figure(&self, experiment: &str) -> Result<Svg> {
        let DiscrepancyEntry { predictive_noise_um: from, predictive_noise_with_discrepancy_um: to, .. } = self.entry;
        let widened = format!(
            "The standard deviation of predictions is widened from {} to {} µm.",
            format_significant(from, 3),
            format_significant(to, 3)
        );
        discrepancy(
            &self.panels,
            &format!("{experiment}: residual that no effect explains"),
            &[&self.entry.sentence, " ", &widened].concat(),
        )
    }
}

/// Returns the leading significant event (such as a slip or a change of gain) in any cycle, including the scored one. The model contains the leading structure found in the
/// fitted cycles. If there is such structure, the event must lie in the scored cycle, because in the fitted cycles it could be that structure in another shape.
///
/// # Errors
/// Errors of [`events_over_all_cycles`].
pub(super) fn event_in_any_cycle(
    subject: &Subject,
    model: &Refitted,
    unexplained: &[OutsideStructure],
    (criteria, request): (&Criteria, &OutsideRequest),
) -> Result<Option<OutsideStructure>> {
    let (candidate, fitted) = with_shape(model, unexplained.first());
    let found = events_over_all_cycles(subject, candidate, fitted, request)?;
    let is_new = |event: &OutsideStructure| unexplained.is_empty() || scored_cycle_of(subject, event).is_some();
    let is_wanted = |event: &OutsideStructure| {
        criteria.is_significant(&event.evidence()) && is_new(event) && !is_gain_of_a_cycle(subject, event)
    };
    Ok(found.into_iter().find(is_wanted))
}

/// Returns whether an event is a change of gain at the start of a cycle. The noise model already allows such a change in every cycle.
pub(super) fn is_gain_of_a_cycle(subject: &Subject, event: &OutsideStructure) -> bool {
    let (record, scales) = (&subject.experiment().record, subject.experiment().scales());
    let begins = |row: &usize| *row == 0 || record.cycle[*row] != record.cycle[*row - 1];
    let is_near = |row: usize| {
        event.event_time_s.is_some_and(|time_s| (time_s - record.time_s[row]).abs() < CYCLE_EDGE * scales.cycle_s)
    };
    event.kind == OutsideKind::GainChange && (0..record.n_rows()).filter(begins).any(is_near)
}

/// Returns the scored cycle if an event lies in it, otherwise `None`.
fn scored_cycle_of(subject: &Subject, event: &OutsideStructure) -> Option<u32> {
    let experiment = subject.experiment();
    let row = experiment.record.time_s.partition_point(|time_s| *time_s < event.event_time_s.unwrap_or(f64::INFINITY));
    experiment.record.cycle.get(row).copied().filter(|cycle| experiment.heldout_cycles.contains(cycle))
}

/// Returns the remark of a diagnosis about an event, such as a slip or a change of gain.
pub(super) fn event_remark(subject: &Subject, event: &OutsideStructure) -> String {
    match scored_cycle_of(subject, event) {
        Some(cycle) => format!(
            "held-out cycle {cycle} contains an event that no fit has seen; it affects the errors and gains there: {}",
            event.sentence
        ),
        None => format!("an event appears once the held-out cycle is included: {}", event.sentence),
    }
}

/// Returns the candidate and fit that contain the structure `shape`, or those of the model alone if `shape` is `None`.
fn with_shape<'a>(model: &'a Refitted, shape: Option<&'a OutsideStructure>) -> (&'a Candidate, &'a Fitted) {
    shape.map_or((&model.candidate, &model.fitted), |shape| (&shape.candidate, &shape.fitted))
}

fn axis_of_shape(kind: OutsideKind) -> &'static str {
    match kind {
        OutsideKind::Backlash | OutsideKind::Nonlinearity => "position",
        _ => Axis::AbsoluteTime.name(),
    }
}

fn sentence(
    subject: &Subject,
    leading: Option<&OutsideStructure>,
    process: Option<&Discrepancy>,
    rows: &[usize],
) -> String {
    let peak = process.and_then(|discrepancy| Some((discrepancy, peak(subject, discrepancy, rows)?)));
    match (leading, peak) {
        (Some(outside), Some((_, (by, at)))) if outside.kind.axis_of_curve().is_some() => {
            format!("{} It is largest, {by}, {at}.", outside.sentence)
        }
        (Some(outside), Some((entry, (by, at)))) => {
            format!(
                "{} In addition, {} µm {}, at most {by}, {at}.",
                outside.sentence,
                format_significant(entry.size_um, 3),
                follow(entry.axis)
            )
        }
        (Some(outside), None) => outside.sentence.clone(),
        (None, Some((item, (by, at)))) => {
            format!("{} µm {}, at most {by}, {at}.", format_significant(item.size_um, 3), follow(item.axis))
        }
        (None, None) => String::new(),
    }
}

fn follow(axis: Axis) -> &'static str {
    match axis {
        Axis::Phase => "repeat with the cycle",
        Axis::TimeSinceStep => "follow the time since the force step and change sign with it",
        Axis::AbsoluteTime => "change slowly with time",
        Axis::Force => "follow the force at once",
    }
}

/// Largest value of a process, and where it occurs, in words.
fn peak(subject: &Subject, process: &Discrepancy, rows: &[usize]) -> Option<(String, String)> {
    let row = rows.iter().copied().max_by(|a, b| process.mean_m[*a].abs().total_cmp(&process.mean_m[*b].abs()))?;
    let (record, at) = (&subject.experiment().record, process.coordinate[row]);
    let mean_um = 1e6 * process.sign[row] * process.mean_m[row];
    let sd_um = 1e6 * process.sd_m[row];
    let decimals = if sd_um > 0.0 { (1.0 - sd_um.log10().floor()).clamp(0.0, 6.0) as usize } else { 1 };
    let by = format!("{} ± {} µm", format_decimals(mean_um, decimals), format_decimals(sd_um, decimals));
    let place = match process.axis {
        Axis::Phase => {
            format!("{} s into the cycle", format_significant(at * subject.experiment().scales().cycle_s, 3))
        }
        Axis::TimeSinceStep => format!("{} s after the step", format_significant(at, 3)),
        Axis::AbsoluteTime => format!("at {} s (cycle {})", format_significant(at, 3), record.cycle[row]),
        Axis::Force => format!("at {} µN", format_significant(1e6 * at, 3)),
    };
    Some((by, place))
}

fn panel_of_process(process: &Discrepancy, rows: &[usize]) -> DiscrepancyPanel {
    let (axis_label, factor) = match process.axis {
        Axis::Phase => ("part of the cycle (–)", 1.0),
        Axis::TimeSinceStep => ("time since the force step (s); positions along the step", 1.0),
        Axis::AbsoluteTime => ("time (s)", 1.0),
        Axis::Force => ("force (µN)", 1e6),
    };
    let of = |value: &dyn Fn(usize) -> f64| rows.iter().map(|row| value(*row)).collect();
    let signed_um = |row: usize, value_m: f64| 1e6 * process.sign[row] * value_m;
    DiscrepancyPanel {
        legend_text: "unexplained, 90 % band".into(),
        axis_label: axis_label.into(),
        is_logarithmic: process.axis == Axis::TimeSinceStep,
        coordinate: of(&|row| factor * process.coordinate[row]),
        mean_um: of(&|row| signed_um(row, process.mean_m[row])),
        sd_um: of(&|row| 1e6 * process.sd_m[row]),
        residual_um: of(&|row| process.residual_m[row].map_or(f64::NAN, |left_m| signed_um(row, left_m))),
    }
}

fn panel_of_shape(subject: &Subject, shape: &OutsideStructure, rows: &[usize]) -> DiscrepancyPanel {
    let record = &subject.experiment().record;
    let of = |value: &dyn Fn(usize) -> f64| rows.iter().map(|row| value(*row)).collect();
    // Position of the model without the structure. The model's parameters have absorbed their part of the structure.
    let model_m = |row: usize| shape.fitted.position_m[row] - shape.discrepancy_m[row];
    let left_um = |row: usize| subject.fitted_m[row].map_or(f64::NAN, |y| 1e6 * (y - model_m(row)));
    let since_cycle_s = |row: usize| {
        let first = record.cycle.partition_point(|cycle| *cycle < record.cycle[row]);
        record.time_s[row] - record.time_s[first]
    };
    let (axis_label, coordinate) = match (shape.kind, shape.period_s) {
        (OutsideKind::Vibration, Some(period_s)) => (
            format!("time within a period of {} s (s)", format_significant(period_s, 3)),
            of(&|row| record.time_s[row].rem_euclid(period_s)),
        ),
        (OutsideKind::Backlash, _) => ("time since the start of the cycle (s)".into(), of(&since_cycle_s)),
        (OutsideKind::Nonlinearity, _) => ("position (µm)".into(), of(&|row| 1e6 * model_m(row))),
        _ => ("time (s)".into(), of(&|row| record.time_s[row])),
    };
    DiscrepancyPanel {
        legend_text: format!(
            "{}, without the part that the model's parameters absorb",
            shape.kind.name().replace('-', " ")
        ),
        axis_label,
        is_logarithmic: false,
        coordinate,
        mean_um: of(&|row| 1e6 * shape.discrepancy_m[row]),
        sd_um: vec![0.0; rows.len()],
        residual_um: of(&left_um),
    }
}
