//! Data that all shapes are computed from: times, forces and positions of a record at a fit.

use crate::{Candidate, Fitted, Subject};
use base::error::Result;
use models::effects::AMPLITUDE;

/// Times, forces and positions, one value per row of the record.
pub(super) struct SearchSetting {
    pub time_s: Vec<f64>,
    /// Force (N) that acts until each row. At the row of a force step it is still the previous force.
    pub acting_force_n: Vec<f64>,
    /// Fitted position, in m.
    pub position_m: Vec<f64>,
    /// Response (m) to a changed force: the square of the force with its sign, scaled to the largest size of the force.
    pub position_of_squares_m: Vec<f64>,
    /// Number of cycles since the record's start, including the elapsed fraction of the present one.
    pub phase: Vec<f64>,
    /// Sign of the last force step and time (s) since it; zeros before the first step.
    pub since_step: Vec<(f64, f64)>,
    /// Rows that are fitted, in order.
    pub rows: Vec<usize>,
    pub interval_s: f64,
    pub hold_s: f64,
    pub cycle_s: f64,
    pub reference_noise_m: f64,
}

impl SearchSetting {
    /// Collects the data of a subject at the fit of a candidate.
    ///
    /// # Errors
    /// Errors of evaluating the candidate.
    pub fn new(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<Self> {
        let record = &subject.experiment().record;
        let scales = subject.experiment().scales();
        let n_rows = record.n_rows();
        let acting_force_n = (0..n_rows).map(|row| record.acting_force_n(row)).collect();
        Ok(Self {
            time_s: record.time_s.clone(),
            acting_force_n,
            position_m: fitted.position_m.clone(),
            position_of_squares_m: position_of_squares_m(subject, candidate, fitted)?,
            phase: phases(&record.time_s, &record.cycle, scales.cycle_s),
            since_step: since_steps(&record.time_s, &record.force_n, &record.force_step_rows()),
            rows: (0..n_rows).filter(|row| subject.fitted_m[*row].is_some()).collect(),
            interval_s: scales.sample_interval_s,
            hold_s: scales.hold_s,
            cycle_s: scales.cycle_s,
            reference_noise_m: subject.reference_noise_m(),
        })
    }

    /// First and last fitted time, in s.
    pub fn span_s(&self) -> (f64, f64) {
        let at = |row: Option<&usize>| row.map_or(0.0, |row| self.time_s[*row]);
        (at(self.rows.first()), at(self.rows.last()))
    }

    /// Returns a column with the values of a function of the row.
    pub fn column(&self, of_row: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..self.time_s.len()).map(of_row).collect()
    }

    /// Largest size (m) of the fitted positions.
    pub fn largest_position_m(&self) -> f64 {
        self.rows.iter().map(|row| self.position_m[*row].abs()).fold(0.0, f64::max)
    }
}

fn position_of_squares_m(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<Vec<f64>> {
    let mut experiment = subject.experiment().clone();
    let force_n = &mut experiment.record.force_n;
    let largest_n = force_n.iter().fold(f64::MIN_POSITIVE, |a, force| a.max(force.abs()));
    force_n.iter_mut().for_each(|force| *force *= force.abs() / largest_n);
    let acting = subject.problem().with_experiment(experiment, subject.specification().clone(), subject.library())?;
    let acting = Subject::with_compliance(&acting, subject.library(), subject.compliance().clone())?;
    // Large displacements are learnt for the record's own force, so this first-order shape omits them.
    let mut theta = fitted.theta.clone();
    for (free, theta) in candidate.free.iter().zip(&mut theta).filter(|(free, _)| free.name == AMPLITUDE) {
        *theta = free.coordinate.theta(0.0);
    }
    acting.trajectory_m(candidate, &theta)
}

fn phases(time_s: &[f64], cycle: &[u32], cycle_s: f64) -> Vec<f64> {
    let starts: Vec<usize> = (0..cycle.len()).filter(|row| *row == 0 || cycle[*row] != cycle[row - 1]).collect();
    let mut phase = vec![0.0; cycle.len()];
    for (number, start) in starts.iter().enumerate() {
        let end = starts.get(number + 1).copied();
        let length_s = end.map_or(cycle_s, |end| time_s[end] - time_s[*start]).max(f64::MIN_POSITIVE);
        for row in *start..end.unwrap_or(cycle.len()) {
            phase[row] = number as f64 + (time_s[row] - time_s[*start]) / length_s;
        }
    }
    phase
}

fn since_steps(time_s: &[f64], force_n: &[f64], step_rows: &[usize]) -> Vec<(f64, f64)> {
    let sign = |row: usize| (force_n[row] - if row == 0 { 0.0 } else { force_n[row - 1] }).signum();
    let since = |row: usize| {
        // At the step's own row the position still belongs to the previous hold.
        let last = step_rows.partition_point(|step| *step < row).checked_sub(1).map(|place| &step_rows[place]);
        last.map_or((0.0, 0.0), |step| (sign(*step), time_s[row] - time_s[*step]))
    };
    (0..time_s.len()).map(since).collect()
}
