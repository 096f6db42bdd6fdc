//! Positions and fields at rows, or at given times after a force change, interpolated between the
//! ends of steps.

use super::TransientSystem;

/// Receiver of the steps of a run, in order.
pub(super) trait Recorder {
    /// Receives a step from `from` to `to`.
    fn record(&mut self, from: &OutputState, to: &OutputState, system: &dyn TransientSystem);
}

/// Unknowns and their rates at the end of a step.
#[derive(Debug, Clone)]
pub(super) struct OutputState {
    pub time_s: f64,
    pub unknowns: Vec<f64>,
    pub rates_per_s: Vec<f64>,
}

/// Positions and fields at the rows that the run has passed so far.
pub(super) struct Output<'a> {
    pub time_s: &'a [f64],
    pub rows_of_fields: &'a [usize],
    pub rounding_s: f64,
    pub row: usize,
    pub position_m: Vec<f64>,
    pub fields: Vec<Vec<f64>>,
}

/// Weights of a cubic Hermite interpolation at `time_s`: of value and rate at the step's start,
/// then of value and rate at its end.
fn cubic_weights(from_s: f64, to_s: f64, time_s: f64) -> [f64; 4] {
    let step_s = to_s - from_s;
    let x = if step_s > 0.0 { ((time_s - from_s) / step_s).min(1.0) } else { 1.0 };
    let (x2, x3) = (x * x, x * x * x);
    [2.0 * x3 - 3.0 * x2 + 1.0, (x3 - 2.0 * x2 + x) * step_s, 3.0 * x2 - 2.0 * x3, (x3 - x2) * step_s]
}

impl Recorder for Output<'_> {
    /// Computes the rows up to the end of a step by cubic Hermite interpolation.
    fn record(&mut self, from: &OutputState, to: &OutputState, system: &dyn TransientSystem) {
        let ends = [&from.unknowns, &from.rates_per_s, &to.unknowns, &to.rates_per_s];
        let mut at_ends = None;
        while let Some(&row_s) = self.time_s.get(self.row).filter(|&&t| t <= to.time_s + self.rounding_s) {
            let weights = cubic_weights(from.time_s, to.time_s, row_s);
            let positions: &[f64; 4] = at_ends.get_or_insert_with(|| ends.map(|end| system.position_m(end)));
            self.position_m.push(weights.iter().zip(positions).map(|(w, p)| w * p).sum());
            if self.rows_of_fields.contains(&self.row) {
                let value = |k: usize| weights.iter().zip(ends).map(|(w, end)| w * end[k]).sum();
                self.fields.push((0..to.unknowns.len()).map(value).collect());
            }
            self.row += 1;
        }
    }
}

/// Term of a sum of fields: a factor times the field at one time after a unit force change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldTerm {
    /// Time since the force change, in s.
    pub age_s: f64,
    /// Index of the sum to which the term belongs.
    pub sum: usize,
    /// Factor by which the field is multiplied.
    pub factor: f64,
}

/// Response of a system to one force change: its position at any time, and sums of its fields.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitResponse {
    /// Time since the force change (s), position (m) and its rate (m/s), at the end of every step.
    moments: Vec<[f64; 3]>,
    /// Sums of displacement fields: values of all unknowns, one vector per sum.
    pub fields: Vec<Vec<f64>>,
}

impl UnitResponse {
    /// Position (m) at a time after the force change (s), up to the end of the last step.
    pub fn position_m(&self, age_s: f64) -> f64 {
        let after = self.moments.partition_point(|[t, ..]| *t < age_s).clamp(1, self.moments.len() - 1);
        let ([from_s, x, v], [to_s, y, w]) = (self.moments[after - 1], self.moments[after]);
        let weights = cubic_weights(from_s, to_s, age_s);
        weights.iter().zip([x, v, y, w]).map(|(weight, value)| weight * value).sum()
    }
}

/// Recorder that builds a [`UnitResponse`].
pub(super) struct ResponseRecorder<'a> {
    /// Terms of the sums that later steps will contribute, in ascending age.
    terms: std::iter::Peekable<std::slice::Iter<'a, FieldTerm>>,
    pub(super) response: UnitResponse,
}

impl<'a> ResponseRecorder<'a> {
    /// Prepares a recorder for terms in ascending order of age. The largest index of a sum among
    /// the terms gives the number of sums.
    pub(super) fn new(terms: &'a [FieldTerm], n_unknowns: usize) -> Self {
        let n_sums = terms.iter().map(|term| term.sum + 1).max().unwrap_or(0);
        let response = UnitResponse { moments: Vec::new(), fields: vec![vec![0.0; n_unknowns]; n_sums] };
        Self { terms: terms.iter().peekable(), response }
    }
}

impl Recorder for ResponseRecorder<'_> {
    fn record(&mut self, from: &OutputState, to: &OutputState, system: &dyn TransientSystem) {
        let moment =
            |at: &OutputState| [at.time_s, system.position_m(&at.unknowns), system.position_m(&at.rates_per_s)];
        if self.response.moments.is_empty() {
            self.response.moments.push(moment(from));
        }
        self.response.moments.push(moment(to));
        while let Some(term) = self.terms.next_if(|term| term.age_s <= to.time_s) {
            let weights = cubic_weights(from.time_s, to.time_s, term.age_s).map(|weight| term.factor * weight);
            let sum = self.response.fields[term.sum].iter_mut().enumerate();
            sum.for_each(|(k, value)| {
                *value += weights[0] * from.unknowns[k]
                    + weights[1] * from.rates_per_s[k]
                    + weights[2] * to.unknowns[k]
                    + weights[3] * to.rates_per_s[k];
            });
        }
    }
}
