//! A learnt function tabulated over the states that a record visits.

use super::distil::NORMAL_90;
use super::function::Function;
use super::pairs::{Pair, StateKind, state_range};
use criticism::Subject;
use documents::learned::{LearnedFunction, LearnedPoint, QuantityAtReference};

/// Number of states at which the function is tabulated.
const N_POINTS: usize = 61;
/// Largest extrapolation of the table beyond the states of fitted rows, as a fraction of their range. The table never goes beyond the states of the record.
const BEYOND: f64 = 0.15;

/// Number of quantiles of the fitted states among which the reference is chosen.
const N_QUANTILES: usize = 21;
/// Largest fraction of states at which a formula may lie outside the function's 90 % band.
const MOST_OUTSIDE: f64 = 0.3;

/// Returns whether a formula's factors lie outside the function's 90 % band at more states than chance allows.
pub fn is_outside_band(factors: &[f64], points: &[LearnedPoint]) -> bool {
    let is_inside = |(factor, point): &(&f64, &LearnedPoint)| (point.q05..=point.q95).contains(*factor);
    let n_inside = factors.iter().zip(points).filter(is_inside).count();
    ((factors.len() - n_inside) as f64) > MOST_OUTSIDE * factors.len() as f64
}

/// States of the fitted rows.
fn of_fitted_rows(subject: &Subject, visited: &[f64]) -> impl Iterator<Item = f64> {
    visited.iter().zip(&subject.fitted_m).filter(|(_, y)| y.is_some()).map(|(s, _)| *s)
}

/// Smallest and largest state of the fitted rows.
fn seen(subject: &Subject, visited: &[f64]) -> [f64; 2] {
    let fitted = of_fitted_rows(subject, visited);
    fitted.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], s| [low.min(s), high.max(s)])
}

/// Fraction of the held-out rows whose state lies outside the range of the fitted rows; 0 if no row is held out.
pub fn share_beyond(subject: &Subject, visited: &[f64]) -> f64 {
    let [low, high] = seen(subject, visited);
    let margin = 0.02 * (high - low);
    let scored = visited.iter().zip(&subject.scored_m).filter(|(_, y)| y.is_some()).map(|(s, _)| *s);
    let (n, n_beyond) = scored.fold((0_usize, 0_usize), |(n, beyond), s| {
        (n + 1, beyond + usize::from(!(low - margin..=high + margin).contains(&s)))
    });
    if n == 0 { 0.0 } else { n_beyond as f64 / n as f64 }
}

/// Tabulates a function with its band over the states that the record visits; `None` if no row is fitted.
pub fn tabulate_function(subject: &Subject, function: &Function, pair: &Pair) -> Option<LearnedFunction> {
    let StateKind::Function { state, visited, .. } = &pair.kind else { return None };
    let reference_state = function.best_known(&quantiles_of(subject, visited))?;
    let quantiles = |[mean, sd]: [f64; 2]| [0.0, -NORMAL_90, NORMAL_90].map(|z| (mean + z * sd).exp());
    let point = |(state, ln_factor): (&f64, &[f64; 2])| {
        let [factor, q05, q95] = quantiles(*ln_factor);
        LearnedPoint { state: *state, factor, q05, q95 }
    };
    let states = states_of(subject, visited);
    let at_reference = function.ln_quantity(reference_state).map(|values| {
        let [value, q05, q95] = quantiles(values);
        QuantityAtReference { value, q05, q95 }
    });
    Some(LearnedFunction {
        state_unit: state.unit().into(),
        visited: seen(subject, visited),
        reference_state,
        at_reference,
        points: states.iter().zip(&function.curve(&states, reference_state)).map(point).collect(),
    })
}

/// Quantiles of the fitted rows' states, from which the reference state (factor 1) is chosen.
fn quantiles_of(subject: &Subject, visited: &[f64]) -> Vec<f64> {
    let mut states: Vec<f64> = of_fitted_rows(subject, visited).collect();
    states.sort_by(f64::total_cmp);
    let Some(last) = states.len().checked_sub(1) else { return states };
    let mut quantiles: Vec<f64> = (0..N_QUANTILES).map(|k| states[k * last / (N_QUANTILES - 1)]).collect();
    quantiles.dedup();
    quantiles
}

/// States at which a function is tabulated: the range of the fitted rows, slightly extended.
fn states_of(subject: &Subject, visited: &[f64]) -> Vec<f64> {
    let all = state_range(visited);
    let [low, high] = seen(subject, visited);
    let seen = [low.min(0.0), high.max(0.0)];
    let more = BEYOND * (seen[1] - seen[0]);
    let (low, high) = (all[0].max(seen[0] - more), all[1].min(seen[1] + more));
    (0..N_POINTS).map(|k| low + (high - low) * k as f64 / (N_POINTS - 1) as f64).collect()
}
