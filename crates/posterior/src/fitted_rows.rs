//! Rows at which a least-squares fit computes the trajectory: all rows up to the last fitted position, or a selection of them. The selection does not change the
//! trajectory at the selected rows.

use crate::problem::Problem;
use base::error::Result;
use models::model::Response;
use record::OwnedForce;
use sampling::least_squares::{Fit, LeastSquaresProblem, Tolerances, fit};

/// Largest number of positions in the search from all starts. For a longer record, the search uses a selection of the positions, and the best minima are refined with
/// all of them.
pub(super) const MOST_SEARCHED: usize = 20_000;
/// Largest number of minima that are refined with all positions.
const MOST_FINISHED: usize = 3;
/// Relative difference of objectives below which two searches have found the same minimum.
pub(super) const SAME_MINIMUM: f64 = 1e-6;

/// Times and forces of the rows that a fit uses, and the fitted positions.
pub(super) struct FittedRows {
    time_s: Vec<f64>,
    force: OwnedForce,
    /// Row index among the selected rows, and measured value (m), of each fitted position.
    pub observed: Vec<(usize, f64)>,
}

impl FittedRows {
    /// Selects all rows up to the last fitted position. Later rows do not influence a fitted position.
    pub fn new(problem: &Problem) -> Self {
        let record = &problem.experiment.record;
        let positions = problem.positions_of(&problem.experiment.calibration_cycles);
        let observed: Vec<(usize, f64)> =
            positions.iter().enumerate().filter_map(|(row, y)| y.map(|y| (row, y))).collect();
        let n_rows = observed.last().map_or(0, |(row, _)| row + 1);
        Self { time_s: record.time_s[..n_rows].to_vec(), force: record.force().first(n_rows).into(), observed }
    }

    /// Thins the rows to about `most` evenly chosen positions. Rows at which the force changes are kept, so that the trajectory at the remaining rows does not change.
    pub fn thinned(&self, most: usize) -> Self {
        let every = self.observed.len().div_ceil(most).max(1);
        let mut chosen = self.observed.iter().step_by(every).peekable();
        let OwnedForce { at_rows_n, rule } = &self.force;
        let empty = OwnedForce { at_rows_n: Vec::new(), rule: *rule };
        let mut thinned = Self { time_s: Vec::new(), force: empty, observed: Vec::new() };
        for (row, (&time_s, &force_n)) in self.time_s.iter().zip(at_rows_n).enumerate() {
            let fitted = chosen.next_if(|(chosen, _)| *chosen == row);
            if let Some((_, position_m)) = fitted {
                thinned.observed.push((thinned.time_s.len(), *position_m));
            }
            if fitted.is_some() || self.force.get().changes_at(row) {
                thinned.time_s.push(time_s);
                thinned.force.at_rows_n.push(force_n);
            }
        }
        thinned
    }

    /// Response operator for the selected rows, as input of the reduced model.
    pub fn response(&self) -> Response {
        Response::new(&self.time_s, self.force.get(), self.time_s.len())
    }
}

/// Refines searches that used a selection of the positions. From the best minima, the search continues with all positions. The other searches keep their results, with
/// objectives multiplied by `more`, the ratio of all positions to the selected ones.
pub(super) fn refine_minima(all: &dyn LeastSquaresProblem, found: &[Fit], more: f64) -> Result<Vec<Fit>> {
    let mut order: Vec<&Fit> = found.iter().collect();
    order.sort_by(|a, b| a.objective.total_cmp(&b.objective));
    let mut minima: Vec<&Fit> = Vec::new();
    for search in order {
        if minima.len() < MOST_FINISHED && !minima.iter().any(|minimum| is_same_minimum(minimum, search)) {
            minima.push(search);
        }
    }
    let finish = |minimum: &&Fit| fit(all, &minimum.theta, &Tolerances::default());
    let ends: Vec<Fit> = minima.iter().map(finish).collect::<Result<_>>()?;
    let end = |search: &Fit| match minima.iter().position(|minimum| is_same_minimum(minimum, search)) {
        Some(index) => Fit { iterations: search.iterations + ends[index].iterations, ..ends[index].clone() },
        None => Fit { objective: more * search.objective, ..search.clone() },
    };
    // The residuals are dropped, because they are as long as the record and nothing uses them.
    Ok(found.iter().map(|search| Fit { residuals: Vec::new(), ..end(search) }).collect())
}

pub(super) fn is_same_minimum(a: &Fit, b: &Fit) -> bool {
    (a.objective - b.objective).abs() <= SAME_MINIMUM * a.objective.min(b.objective)
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::number::Dual;
    use laws::rheology::Element;
    use models::effects::Stages;
    use record::ForceRule;

    /// Thins 3000 rows at irregular times with a switched force to one of 40 positions. Checks that the remaining positions and the trajectory at their rows do not
    /// change.
    #[test]
    fn few_rows_show_the_same_motion() {
        let n = 3000;
        let time_s: Vec<f64> = (0..n).map(|i| 0.01 * i as f64 + 0.004 * ((i * 7) % 5) as f64 / 5.0).collect();
        let force_n: Vec<f64> = (0..n).map(|i| 4.6e-6 * f64::from([1, 1, -1, 0][(i / 311) % 4])).collect();
        let observed = (0..n).filter(|i| i % 3 != 1).map(|i| (i, i as f64)).collect();
        let all = FittedRows { time_s, force: OwnedForce { at_rows_n: force_n, rule: ForceRule::Hold }, observed };
        let few = all.thinned(50);
        assert_eq!(few.observed.len(), 50);
        assert!(few.time_s.len() <= 50 + 11);
        let number = |value: f64| Dual::constant(value);
        let stages = Stages::of_law(vec![
            Element::kelvin_voigt(number(3.5), number(1.4)),
            Element::Dashpot { viscosity_pa_s: number(47.0) },
        ]);
        let at = |rows: &FittedRows| {
            let x = rows.response().trajectory_m(&stages, 549.0).expect("sound");
            rows.observed.iter().map(|(row, y)| (x[*row], *y)).collect::<Vec<_>>()
        };
        let every: Vec<(f64, f64)> = at(&all).into_iter().step_by(40).collect();
        for ((few_m, few_y), (all_m, all_y)) in at(&few).into_iter().zip(every) {
            assert_eq!(few_y, all_y);
            assert!((few_m - all_m).abs() < 1e-15, "{few_m} {all_m}");
        }
    }
}
