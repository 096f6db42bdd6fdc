//! Derivatives of a candidate's position with respect to its coordinates. They are exact for the parameters of a function of a state, and otherwise finite differences.

use super::candidate::Coordinate;
use super::{Candidate, Subject};
use base::error::{Error, Result};
use base::number::Dual;
use models::effects::EffectParameter;
use models::model::{Lanes, N_LANES};

/// Step of a finite difference, in units of the search coordinate.
const DIFFERENCE: f64 = 1e-4;

/// Returns the derivatives of a candidate's position (m per unit of the coordinate): one column per coordinate, one value per row of the record.
pub fn columns_m(subject: &Subject, candidate: &Candidate, theta: &[f64]) -> Result<Vec<Vec<f64>>> {
    let none = || {
        Error::numerical(
            format!("the model with {} has no derivatives at its fit", candidate.effects.join(", ")),
            "fix one of the model's parameters",
        )
    };
    derivatives_m(subject, candidate, theta, None).ok_or_else(none)
}

/// Returns the derivative of the position with respect to one coordinate (m per unit, one value per row). `known_m` is the position (m) at the point `theta`.
pub(super) fn column_m(
    subject: &Subject,
    candidate: &Candidate,
    theta: &[f64],
    coordinate: usize,
    known_m: &[f64],
) -> Result<Vec<f64>> {
    let step = difference_step(candidate, theta, coordinate);
    difference_m(subject, candidate, (theta, known_m), (coordinate, step))
        .or_else(|_| difference_m(subject, candidate, (theta, known_m), (coordinate, -step)))
}

/// Step of a finite difference, negative if a positive step would leave the range of the search. The callers reverse the step if the model has no solution there. An example
/// is a force gradient that pulls the robot away.
fn difference_step(candidate: &Candidate, theta: &[f64], coordinate: usize) -> f64 {
    let [_, upper] = candidate.ends(coordinate);
    if theta[coordinate] + DIFFERENCE > upper { -DIFFERENCE } else { DIFFERENCE }
}

/// Difference quotient (m per unit of the coordinate) over one step from a point whose position (m) is known.
fn difference_m(
    subject: &Subject,
    candidate: &Candidate,
    (theta, known_m): (&[f64], &[f64]),
    (coordinate, step): (usize, f64),
) -> Result<Vec<f64>> {
    let mut moved = theta.to_vec();
    moved[coordinate] += step;
    let moved_m = subject.trajectory_m(candidate, &moved)?;
    Ok(moved_m.iter().zip(known_m).map(|(moved, known)| (moved - known) / step).collect())
}

/// Derivatives of the position (m per unit of the coordinate) at the point `theta`, one column per coordinate; `None` if the model has none there. `known_m` is the position
/// (m) at that point, if known.
pub(super) fn derivatives_m(
    subject: &Subject,
    candidate: &Candidate,
    theta: &[f64],
    known_m: Option<&[f64]>,
) -> Option<Vec<Vec<f64>>> {
    if let Some(columns) = subject.constant_derivatives_m(candidate) {
        return Some(columns);
    }
    let exact = by_function_m(subject, candidate, theta).unwrap_or_default();
    let is_exact = |k: &usize| exact.iter().any(|(place, _)| place == k);
    let moved: Vec<usize> = (0..candidate.free.len()).filter(|k| !is_exact(k)).collect();
    let step = |k: usize| difference_step(candidate, theta, k);
    let moved_point = |k: &usize| {
        let mut moved = theta.to_vec();
        moved[*k] += step(*k);
        moved
    };
    // The position is computed along with the moved points. This takes extra time only if trajectories are computed one by one.
    let centre = (known_m.is_none() && !moved.is_empty()).then(|| theta.to_vec());
    let points: Vec<Vec<f64>> = centre.into_iter().chain(moved.iter().map(moved_point)).collect();
    let mut position_m = known_m.map(<[f64]>::to_vec);
    let mut columns = vec![Vec::new(); candidate.free.len()];
    exact.into_iter().for_each(|(place, column)| columns[place] = column);
    let mut coordinates = moved.into_iter();
    for chunk in points.chunks(N_LANES) {
        let (lanes, is_valid) = subject.trajectories_m(candidate, chunk);
        for (lane, is_valid) in is_valid.iter().enumerate().take(chunk.len()) {
            let Some(position_m) = &position_m else {
                position_m = Some(lanes.iter().map(|row| row.0[lane]).collect()).filter(|_| *is_valid);
                position_m.as_ref()?;
                continue;
            };
            let coordinate = coordinates.next()?;
            columns[coordinate] = if *is_valid {
                let inverse = 1.0 / step(coordinate);
                let difference = |(row, x): (&Lanes, &f64)| (row.0[lane] - x) * inverse;
                lanes.iter().zip(position_m).map(difference).collect()
            } else {
                let back = (coordinate, -step(coordinate));
                difference_m(subject, candidate, (theta, position_m), back).ok()?
            };
        }
    }
    columns.extend(candidate.columns.iter().cloned());
    Some(columns)
}

/// Exact derivatives with respect to the parameters of a function of a state (such as position or velocity): the index of each coordinate and its column (m per unit of the
/// coordinate).
fn by_function_m(subject: &Subject, candidate: &Candidate, theta: &[f64]) -> Result<Vec<(usize, Vec<f64>)>> {
    let Some(effect) = candidate.model.effects().iter().find(|effect| effect.depends_on_state()) else {
        return Ok(Vec::new());
    };
    let parameters: Vec<Dual> = candidate.parameters(theta).into_iter().map(Dual::constant).collect();
    let mut stages = candidate.model.stages(&parameters)?;
    let compliance_per_m = subject.compliance().resolve(&mut stages)?.value;
    let columns = subject.response().by_function_m(&stages, compliance_per_m)?;
    let column = |(parameter, mut column): (&EffectParameter, Vec<f64>)| {
        let place = candidate.free.iter().position(|free| free.name == parameter.spec.name)?;
        let coordinate = candidate.free[place].coordinate;
        if matches!(coordinate, Coordinate::Square { .. }) {
            return None;
        }
        let unit = coordinate.unit(theta[place]);
        column.iter_mut().for_each(|x| *x *= unit);
        Some((place, column))
    };
    Ok(effect.parameters().iter().zip(columns).filter_map(column).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Search;
    use crate::test_replica::{WHITE, base_fit, replica, simulated};

    /// Fits of the linearised model to simulated positions are those of the model, also beside a further column. The parameters move by half a per cent, so the second order is
    /// 10⁻⁵ of 300 µm, below a thousandth of the noise: over 600 rows at most 0.03 nats. A column of 20 µm gains more than 50 nats.
    #[test]
    fn a_linearised_model_is_fitted_like_the_model() {
        let (base, fitted) = base_fit();
        let step_m: Vec<f64> = (0..fitted.position_m.len()).map(|row| if row < 300 { 0.0 } else { 2e-5 }).collect();
        let with_step = base.with_columns(vec![step_m.clone()]);
        for seed in 0..3 {
            let data = simulated(&base, &fitted.theta, &WHITE, 500 + seed);
            let shifted: Vec<f64> =
                data.observed_m().iter().zip(&step_m).map(|(y, by)| y.unwrap_or(0.0) + by).collect();
            let data = data.with_positions(&shifted);
            let linearised = data.clone().linearised(
                (&fitted.theta, &fitted.position_m),
                columns_m(&data, &base, &fitted.theta).expect("derivatives"),
            );
            let objectives = [&data, &linearised].map(|subject| {
                [&base, &with_step].map(|candidate| {
                    let start = (candidate.embed(&base, &fitted.theta), fitted.noise);
                    subject.fit(candidate, &[start], Search::Local).expect("a fit").objective
                })
            });
            let [[exact, exact_with], [linear, linear_with]] = objectives;
            assert!(exact_with - exact > 50.0, "{objectives:?}");
            assert!((exact - linear).abs() < 0.05 && (exact_with - linear_with).abs() < 0.05, "{objectives:?}");
        }
    }

    /// Near the largest force gradient for which the model has a solution, the derivative is the difference quotient of a backward step.
    #[test]
    fn where_a_model_ends_the_other_side_serves() {
        let (base, fitted) = base_fit();
        let candidate = replica().extended(&["force-gradient"]).expect("addable");
        let start = candidate.embed(&base, &fitted.theta);
        let place = candidate.free.iter().position(|free| free.effect.is_some()).expect("a parameter of the effect");
        let at = |x: f64| {
            let mut theta = start.clone();
            theta[place] = x;
            theta
        };
        let is_model = |x: f64| replica().trajectory_m(&candidate, &at(x)).is_ok();
        // A force gradient so large that it pulls the robot away.
        let none = (0..20).map(|k| start[place] + 0.1 * 2.0_f64.powi(k)).find(|x| !is_model(*x));
        let (mut inside, mut outside) = (start[place], none.expect("an end of the models"));
        for _ in 0..60 {
            let middle = 0.5 * (inside + outside);
            if is_model(middle) { inside = middle } else { outside = middle }
        }
        let last = inside - 0.3 * DIFFERENCE;
        assert!(!is_model(last + DIFFERENCE), "the model ends within the first difference step");
        let columns = columns_m(replica(), &candidate, &at(last)).expect("derivatives");
        let known_m = replica().trajectory_m(&candidate, &at(last)).expect("a model");
        let alone = column_m(replica(), &candidate, &at(last), place, &known_m).expect("a derivative");
        let before_m = replica().trajectory_m(&candidate, &at(last - DIFFERENCE)).expect("a model");
        let difference: Vec<f64> = known_m.iter().zip(&before_m).map(|(x, before)| (x - before) / DIFFERENCE).collect();
        let largest = |column: &[f64]| column.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        for column in [&columns[place], &alone] {
            let apart: Vec<f64> = column.iter().zip(&difference).map(|(a, b)| a - b).collect();
            assert!(largest(&apart) < 1e-9 * largest(&difference), "{} {}", largest(&apart), largest(&difference));
        }
    }
}
