//! Positions and fields at rows, between the ends of steps.

use super::TransientSystem;

/// Unknowns and their rates at one time.
#[derive(Debug, Clone)]
pub(super) struct State {
    pub time_s: f64,
    pub unknowns: Vec<f64>,
    pub rates_per_s: Vec<f64>,
}

/// Rows that have been passed.
pub(super) struct Output<'a> {
    pub time_s: &'a [f64],
    pub rows_of_fields: &'a [usize],
    pub rounding_s: f64,
    pub row: usize,
    pub position_m: Vec<f64>,
    pub fields: Vec<Vec<f64>>,
}

impl Output<'_> {
    /// Gives the rows up to the end of a step, by the cubic of values and rates at its ends.
    pub(super) fn until(&mut self, from: &State, to: &State, system: &dyn TransientSystem) {
        let step_s = to.time_s - from.time_s;
        let ends = [&from.unknowns, &from.rates_per_s, &to.unknowns, &to.rates_per_s];
        let mut at_ends = None;
        while let Some(&row_s) = self.time_s.get(self.row).filter(|&&t| t <= to.time_s + self.rounding_s) {
            let x = if step_s > 0.0 { ((row_s - from.time_s) / step_s).min(1.0) } else { 1.0 };
            let (x2, x3) = (x * x, x * x * x);
            let weights =
                [2.0 * x3 - 3.0 * x2 + 1.0, (x3 - 2.0 * x2 + x) * step_s, 3.0 * x2 - 2.0 * x3, (x3 - x2) * step_s];
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
