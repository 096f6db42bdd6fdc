//! Gradient and Hessian by central differences, with all points in one batch.

use crate::LogDensity;
use crate::check_log_densities;
use base::Result;
use nalgebra::{DMatrix, DVector};

/// Log density at a point with its gradient and Hessian matrix.
pub(super) struct Derivatives {
    pub gradient: DVector<f64>,
    pub hessian: DMatrix<f64>,
}

/// Evaluates the log densities of points, one vector of coordinates per point. NaN is replaced by −∞, because a long trial step may overflow. Values
/// below `floor` may be coarse.
pub(super) fn evaluate(density: &dyn LogDensity, points: &[DVector<f64>], floor: f64) -> Result<Vec<f64>> {
    let (n, dimension) = (points.len(), density.dimension());
    if n == 0 {
        return Ok(Vec::new());
    }
    let coordinates: Vec<f64> = (0..dimension).flat_map(|d| points.iter().map(move |point| point[d])).collect();
    let mut values = vec![0.0; n];
    density.log_density_above(&coordinates, &vec![floor; n], &mut values);
    values.iter_mut().filter(|value| value.is_nan()).for_each(|value| *value = f64::NEG_INFINITY);
    check_log_densities(dimension, &coordinates, &values)?;
    Ok(values)
}

/// Computes gradient and Hessian at `centre` by central differences with the given steps. The steps are halved until all points of the stencil lie in
/// the support. `None` if twelve halvings do not suffice.
///
/// Mixed derivatives use the two corners (+,+) and (−,−). For d dimensions the stencil has d + d² points besides the centre.
pub(super) fn differentiate(
    density: &dyn LogDensity,
    centre: &DVector<f64>,
    value: f64,
    steps: &mut DVector<f64>,
) -> Result<Option<Derivatives>> {
    for _ in 0..12 {
        let values = evaluate(density, &stencil_points(centre, steps), f64::NEG_INFINITY)?;
        if values.iter().all(|v| v.is_finite()) {
            return Ok(Some(derivatives(value, steps, &values)));
        }
        *steps *= 0.5;
    }
    Ok(None)
}

fn stencil_points(centre: &DVector<f64>, steps: &DVector<f64>) -> Vec<DVector<f64>> {
    let dimension = centre.len();
    let mut points = Vec::with_capacity(dimension * (dimension + 1));
    let mut push = |axes: &[usize]| {
        for sign in [1.0, -1.0] {
            let mut point = centre.clone();
            axes.iter().for_each(|&d| point[d] += sign * steps[d]);
            points.push(point);
        }
    };
    (0..dimension).for_each(|i| push(&[i]));
    (0..dimension).for_each(|i| (0..i).for_each(|j| push(&[i, j])));
    points
}

fn derivatives(value: f64, steps: &DVector<f64>, values: &[f64]) -> Derivatives {
    let dimension = steps.len();
    let mut gradient = DVector::zeros(dimension);
    let mut hessian = DMatrix::zeros(dimension, dimension);
    for i in 0..dimension {
        let (plus, minus) = (values[2 * i] - value, values[2 * i + 1] - value);
        gradient[i] = (plus - minus) / (2.0 * steps[i]);
        hessian[(i, i)] = (plus + minus) / (steps[i] * steps[i]);
    }
    let mut corner = 2 * dimension;
    for i in 0..dimension {
        for j in 0..i {
            // f(++) + f(−−) − 2f = hᵢ²Hᵢᵢ + hⱼ²Hⱼⱼ + 2hᵢhⱼHᵢⱼ, with the steps h and the Hessian H.
            let sum = (values[corner] - value) + (values[corner + 1] - value);
            let diagonal = steps[i] * steps[i] * hessian[(i, i)] + steps[j] * steps[j] * hessian[(j, j)];
            hessian[(i, j)] = (sum - diagonal) / (2.0 * steps[i] * steps[j]);
            hessian[(j, i)] = hessian[(i, j)];
            corner += 2;
        }
    }
    Derivatives { gradient, hessian }
}
