//! Distance between two models in an experiment.
//!
//! One model, the truth, gives noise-free data; another model is fitted to them. The residual norm ‖L⁻¹(f_truth − f_other)‖, with L Lᵀ the covariance of
//! the noise at the truth, is the distance in σ. In data with that noise, the truth's expected lead in log likelihood is half the squared distance. An experiment separates
//! two effects if their distance is at least [`SEPARATED_SIGMA`].
//!
//! The priors of the law are centred at the truth's parameters, as if the truth were a fit of data. So a model is at distance 0 from itself. For an effect of small size
//! ε with signature g, the distance is ‖Pg‖ε to first order, with the projection P of [`super::Tangent`].

use nalgebra::{DMatrix, DVector};

use super::derivatives::columns_m;
use super::fit::SUFFICIENT_GAIN_RATIO;
use super::steps::{Steps, damped_steps, normal_equations};
use super::{Candidate, Fitted, Subject};
use crate::NoiseValues;
use base::error::{Error, Result};
use models::model::N_LANES;

/// Distance in σ from which two effects count as separated.
pub const SEPARATED_SIGMA: f64 = 4.0;

/// Starting steps from an effect's null, in units of its search coordinate.
const SIZES: [f64; 8] = [0.003, 0.01, 0.03, 0.1, 0.3, 0.7, 1.5, 3.0];
/// Prior quantiles at which fits start, for parameters that are unidentified at the null.
const GRID: [f64; 7] = [0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95];
/// Number of starts followed to the end, besides the null.
const N_FOLLOWED: usize = 3;
const MOST_STEPS: usize = 30;
/// Relative decrease of a squared distance below which its fit has converged.
const LEAST_PART: f64 = 1e-3;
/// Squared distance below which a fit counts as perfect.
const NOTHING: f64 = 1e-6;

/// Returns the distance (σ) of the best fit of `other` from noise-free data of the truth at its fit, in units of the truth's noise.
///
/// # Errors
/// [`Error::Numerical`] if the other model cannot be evaluated at any start.
pub fn distance(subject: &Subject, other: &Candidate, truth: (&Candidate, &Fitted)) -> Result<f64> {
    let (candidate, fitted) = truth;
    let truth = RivalTruth { candidate, theta: &fitted.theta, noise: fitted.noise, position_m: &fitted.position_m };
    Ok(fit_rival(subject, other, &truth)?.distance)
}

/// The truth of a rival fit: a model at a point, with its noise.
#[derive(Clone, Copy)]
pub struct RivalTruth<'a> {
    pub candidate: &'a Candidate,
    /// Coordinates of the model.
    pub theta: &'a [f64],
    /// Noise parameters in their units.
    pub noise: NoiseValues,
    /// Position (m) at every row of the record.
    pub position_m: &'a [f64],
}

/// The point of a model that is closest to a truth.
#[derive(Debug, Clone)]
pub struct RivalPoint {
    /// Distance (σ) from the truth.
    pub distance: f64,
    pub theta: Vec<f64>,
}

/// Fits a model to the noise-free data of a truth, and returns the model's closest point.
pub fn fit_rival(subject: &Subject, other: &Candidate, truth: &RivalTruth) -> Result<RivalPoint> {
    RivalFit::new(subject, other, truth).best(None)
}

/// A rival fit: one model is fitted to the noise-free data of another model (the truth), or compared with them.
pub(super) struct RivalFit<'a> {
    subject: &'a Subject,
    other: &'a Candidate,
    truth: RivalTruth<'a>,
    /// Mean and standard deviation of the prior of each coordinate; `None` if it has none.
    priors: Vec<Option<(f64, f64)>>,
}

/// A point of a rival fit, with its squared distance (σ²).
#[derive(Clone)]
struct Point {
    theta: Vec<f64>,
    squared: f64,
}

/// Coordinates that may move to absorb changes at a point, with their linear algebra.
struct AbsorbingCoordinates {
    /// Indices of the coordinates that may move.
    active: Vec<usize>,
    /// Whitened derivatives of the position with respect to the active coordinates.
    columns: Vec<Vec<f64>>,
    /// Inverse of the matrix of inner products of `columns`, with the prior precisions added.
    inverse: DMatrix<f64>,
}

impl AbsorbingCoordinates {
    fn slope(&self, white: &[f64]) -> DVector<f64> {
        let dot = |column: &Vec<f64>| column.iter().zip(white).map(|(a, b)| a * b).sum::<f64>();
        DVector::from_iterator(self.columns.len(), self.columns.iter().map(dot))
    }

    /// Residual that is left of a whitened residual, and the remaining fraction of its square.
    fn left(&self, white: &[f64]) -> (DVector<f64>, f64) {
        let step = &self.inverse * self.slope(white);
        let mut left = DVector::from_column_slice(white);
        for (column, step) in self.columns.iter().zip(step.iter()) {
            left.iter_mut().zip(column).for_each(|(left, value)| *left -= step * value);
        }
        let whole = white.iter().map(|w| w * w).sum::<f64>();
        let fraction = if whole > 0.0 { left.norm_squared() / whole } else { 0.0 };
        (left, fraction)
    }
}

/// First-order distance of a point from the truth.
#[derive(Debug, Clone)]
pub(super) struct FirstOrderResidual {
    /// Squared distance in σ², after the absorbing coordinates have moved.
    pub squared: f64,
    /// Squared distance in σ², before the absorbing coordinates move.
    pub whole: f64,
    /// Point after the absorbing coordinates have moved.
    pub theta: Vec<f64>,
}

impl FirstOrderResidual {
    /// Returns the fraction of the squared distance that is not absorbed.
    pub fn fraction(&self) -> f64 {
        if self.whole > 0.0 { (self.squared / self.whole).max(0.0) } else { 0.0 }
    }
}

impl<'a> RivalFit<'a> {
    pub fn new(subject: &'a Subject, other: &'a Candidate, truth: &RivalTruth<'a>) -> Self {
        let of_truth = |name: &str| truth.candidate.free.iter().position(|free| free.name == name);
        let prior = |free: &super::Free| {
            free.prior.map(|(mean, sd)| (of_truth(free.name).map_or(mean, |place| truth.theta[place]), sd))
        };
        let priors = other.free.iter().map(prior).collect();
        Self { subject, other, truth: *truth, priors }
    }

    /// Returns the rival fit without any prior.
    pub fn without_priors(self) -> Self {
        Self { priors: vec![None; self.other.free.len()], ..self }
    }

    /// Returns the whitened residual of a point after absorption, to first order, and the remaining fraction of its square. The absorbing coordinates are those of the law, and of
    /// effects that are away from their nulls at the point `null`.
    pub fn left(&self, null: &[f64], point: &[f64]) -> Option<(DVector<f64>, f64)> {
        let absorbing = self.absorbing(null)?;
        let white = self.differences(&[point.to_vec()]).swap_remove(0)?;
        Some(absorbing.left(&white))
    }

    /// Distance (σ) of the other model after absorption, to first order around a point with these positions (m) and derivatives ([`columns_m`]).
    pub fn first_order(&self, theta: &[f64], position_m: &[f64], columns_m: &[Vec<f64>]) -> Option<f64> {
        let difference_m = self.truth.position_m.iter().zip(position_m).map(|(truth_m, x)| truth_m - x).collect();
        let white = self.whiten(&[difference_m]).swap_remove(0);
        Some(self.absorbing_by(theta, columns_m)?.left(&white).0.norm())
    }

    /// Finds the best fit, from a known point for other data, the nulls of effects, and several sizes and grid points. The last are left out if a point is known and trajectories
    /// are computed one by one, which takes long.
    pub fn best(&self, known: Option<&[f64]>) -> Result<RivalPoint> {
        let null = &self.other.embed(self.truth.candidate, self.truth.theta)[..];
        let mut starts: Vec<Vec<f64>> = known.into_iter().chain([null]).map(<[f64]>::to_vec).collect();
        if known.is_none() || !self.other.is_slow() {
            starts.extend(self.promising(null));
        }
        let mut best: Option<Point> = None;
        for start in starts {
            let Some(point) = self.descend(start) else { continue };
            if best.as_ref().is_none_or(|best| point.squared < best.squared) {
                best = Some(point);
            }
            if best.as_ref().is_some_and(|best| best.squared < NOTHING) {
                break;
            }
        }
        let best = best.ok_or_else(|| {
            Error::numerical(
                format!("the model with {} cannot be fitted to another model", self.other.effects.join(", ")),
                "check the priors of its parameters",
            )
        })?;
        Ok(RivalPoint { distance: best.squared.sqrt(), theta: best.theta })
    }

    /// Whitened differences (the truth's positions less the model's) of up to eight points; `None` if the model has no solution.
    pub fn differences(&self, points: &[Vec<f64>]) -> Vec<Option<Vec<f64>>> {
        let (lanes, is_valid) = self.subject.trajectories_m(self.other, points);
        let valid: Vec<usize> = (0..points.len()).filter(|lane| is_valid[*lane]).collect();
        let column = |lane: &usize| -> Vec<f64> {
            lanes.iter().zip(self.truth.position_m).map(|(row, truth_m)| truth_m - row.0[*lane]).collect()
        };
        let columns: Vec<Vec<f64>> = valid.iter().map(column).collect();
        let mut white = vec![None; points.len()];
        for (lane, column) in valid.iter().zip(self.whiten(&columns)) {
            white[*lane] = Some(column).filter(|column| column.iter().all(|value| value.is_finite()));
        }
        white
    }

    pub fn whiten(&self, columns_m: &[Vec<f64>]) -> Vec<Vec<f64>> {
        self.subject.fitted.whiten(columns_m, self.truth.position_m, &self.truth.noise)
    }

    /// Contribution of the priors to the squared distance.
    fn of_priors(&self, theta: &[f64]) -> f64 {
        let pairs = self.priors.iter().zip(theta);
        pairs.filter_map(|(prior, theta)| prior.map(|(mean, sd)| ((theta - mean) / sd).powi(2))).sum()
    }

    fn squared(&self, theta: &[f64], white: Option<&Vec<f64>>) -> f64 {
        let of = |white: &Vec<f64>| white.iter().map(|w| w * w).sum::<f64>() + self.of_priors(theta);
        white.map_or(f64::INFINITY, of)
    }

    /// Gauss–Newton descent with several dampings tried at once; `None` if the model has no solution. If trajectories are computed one by one, derivatives are computed anew only
    /// where a step gained less than promised, and at the end.
    fn descend(&self, start: Vec<f64>) -> Option<Point> {
        let mut white = self.differences(std::slice::from_ref(&start)).swap_remove(0)?;
        let mut point = Point { squared: self.squared(&start, Some(&white)), theta: start };
        let mut kept = None;
        for _ in 0..MOST_STEPS {
            if point.squared < NOTHING {
                break;
            }
            let is_new = kept.is_none();
            let known = kept.take().or_else(|| self.columns(&point.theta));
            let Some(mut columns) = known else { break };
            columns.push(white.clone());
            let steps = self.steps(&point.theta, &columns);
            columns.pop();
            let steps = steps.filter(|steps| 2.0 * steps.promised >= LEAST_PART * point.squared);
            let step = steps.and_then(|steps| Some((steps.promised, self.step(&point, &steps)?)));
            let Some((promised, (next, left))) = step else {
                if is_new {
                    break;
                }
                continue;
            };
            let taken = point.squared - next.squared;
            (point, white) = (next, left);
            if taken < LEAST_PART * point.squared && is_new {
                break;
            }
            kept = (self.other.is_slow() && taken > promised).then_some(columns);
        }
        Some(point)
    }

    /// The best of the steps from a point, with its whitened residual; `None` if none gains.
    fn step(&self, from: &Point, steps: &Steps) -> Option<(Point, Vec<f64>)> {
        let mut best: Option<(Point, Vec<f64>)> = None;
        for chunk in steps.in_turn(self.other) {
            let before = best.as_ref().map_or(from.squared, |(point, _)| point.squared);
            for (theta, white) in chunk.iter().zip(self.differences(chunk)) {
                let squared = self.squared(theta, white.as_ref());
                if squared < best.as_ref().map_or(from.squared, |(point, _)| point.squared) {
                    best = Some((Point { theta: theta.clone(), squared }, white?));
                }
            }
            let least = best.as_ref().map_or(from.squared, |(point, _)| point.squared);
            let is_past = before < from.squared && least >= before;
            if is_past || from.squared - least > SUFFICIENT_GAIN_RATIO * 2.0 * steps.promised {
                break;
            }
        }
        best
    }

    fn columns(&self, theta: &[f64]) -> Option<Vec<Vec<f64>>> {
        Some(self.whiten(&columns_m(self.subject, self.other, theta).ok()?))
    }

    /// Steps by whitened derivatives, followed by the whitened residual.
    fn steps(&self, theta: &[f64], white: &[Vec<f64>]) -> Option<Steps> {
        let (mut normal, mut slope) = normal_equations(white);
        for (k, prior) in self.priors.iter().enumerate() {
            if let Some((mean, sd)) = prior {
                normal[(k, k)] += 1.0 / (sd * sd);
                slope[k] += (mean - theta[k]) / (sd * sd);
            }
        }
        damped_steps(self.other, theta, &normal, &slope)
    }

    /// Returns the best few starts to first order. Each start has one effect away from its null, and the other coordinates where they absorb most of that effect.
    fn promising(&self, null: &[f64]) -> Vec<Vec<f64>> {
        let starts = away_from_null(self.other, null);
        let mut ranked: Vec<FirstOrderResidual> = self.seen(null, &starts).into_iter().flatten().collect();
        ranked.sort_by(|a, b| a.squared.total_cmp(&b.squared));
        ranked.truncate(N_FOLLOWED);
        ranked.into_iter().map(|seen| seen.theta).collect()
    }

    /// Linear algebra of the coordinates of the law and of effects away from their null.
    fn absorbing(&self, theta: &[f64]) -> Option<AbsorbingCoordinates> {
        self.absorbing_by(theta, &columns_m(self.subject, self.other, theta).ok()?)
    }

    fn absorbing_by(&self, theta: &[f64], columns_m: &[Vec<f64>]) -> Option<AbsorbingCoordinates> {
        let is_on =
            |k: usize| self.other.free.get(k).is_none_or(|f| f.effect.is_none_or(|e| !is_off(self.other, e, theta)));
        let active: Vec<usize> = (0..self.other.dimension()).filter(|k| is_on(*k)).collect();
        let mut columns = self.whiten(&active.iter().map(|k| columns_m[*k].clone()).collect::<Vec<_>>());
        columns.push(Vec::new());
        let (mut normal, _) = normal_equations(&columns);
        columns.pop();
        for (i, k) in active.iter().enumerate() {
            normal[(i, i)] += self.priors.get(*k).copied().flatten().map_or(0.0, |(_, sd)| 1.0 / (sd * sd));
        }
        Some(AbsorbingCoordinates { active, columns, inverse: normal.try_inverse()? })
    }

    /// First-order distances of points from the truth; `None` if the model has no solution. The law absorbs its part first, and so do effects that are away from their nulls at
    /// `null`.
    pub fn seen(&self, null: &[f64], points: &[Vec<f64>]) -> Vec<Option<FirstOrderResidual>> {
        let absorbing = if points.is_empty() { None } else { self.absorbing(null) };
        let Some(absorbing) = absorbing else { return vec![None; points.len()] };
        let differences = points.chunks(N_LANES).flat_map(|chunk| self.differences(chunk));
        points.iter().zip(differences).map(|(point, white)| Some(self.absorbed(&absorbing, point, &white?))).collect()
    }

    fn absorbed(&self, absorbing: &AbsorbingCoordinates, start: &[f64], white: &[f64]) -> FirstOrderResidual {
        let slope = absorbing.slope(white);
        let step = &absorbing.inverse * &slope;
        let mut theta = start.to_vec();
        for (k, step) in absorbing.active.iter().zip(step.iter()) {
            let [lower, upper] = self.other.ends(*k);
            theta[*k] = (theta[*k] + step).clamp(lower, upper);
        }
        let whole = white.iter().map(|w| w * w).sum::<f64>();
        FirstOrderResidual { squared: whole - slope.dot(&step), whole, theta }
    }
}

/// Returns whether an effect of a candidate is at its null.
pub(super) fn is_off(candidate: &Candidate, effect: usize, theta: &[f64]) -> bool {
    candidate.free.iter().zip(theta).any(|(free, theta)| free.effect == Some(effect) && free.null == Some(*theta))
}

/// Points in which one effect that is at its null in `null` takes several sizes on both sides, and grid points of its unidentified parameters.
fn away_from_null(candidate: &Candidate, null: &[f64]) -> Vec<Vec<f64>> {
    let mut starts = Vec::new();
    for (k, free) in candidate.free.iter().enumerate() {
        let Some(effect) = free.effect.filter(|effect| is_off(candidate, *effect, null)) else { continue };
        if free.null != Some(null[k]) {
            continue;
        }
        for of_grid in over_grid(candidate, effect, null) {
            let mut sizes: Vec<f64> =
                SIZES.iter().flat_map(|size| [-size, *size]).map(|size| free.clamped(null[k] + size)).collect();
            sizes.sort_by(f64::total_cmp);
            sizes.dedup();
            for size in sizes.into_iter().filter(|size| *size != null[k]) {
                let mut start = of_grid.clone();
                start[k] = size;
                starts.push(start);
            }
        }
    }
    starts
}

/// Copies of `theta` in which the parameters that are unidentified at an effect's null take quantiles of their priors. Returns `theta` alone if there are no such parameters.
pub(super) fn over_grid(candidate: &Candidate, effect: usize, theta: &[f64]) -> Vec<Vec<f64>> {
    let unidentified: Vec<usize> = (0..candidate.free.len())
        .filter(|k| candidate.free[*k].effect == Some(effect) && candidate.free[*k].is_unidentified_at_null())
        .collect();
    if unidentified.is_empty() {
        return vec![theta.to_vec()];
    }
    let at = |probability: &f64| {
        let mut moved = theta.to_vec();
        unidentified.iter().for_each(|k| moved[*k] = candidate.free[*k].quantile(*probability));
        moved
    };
    GRID.iter().map(at).collect()
}

#[cfg(test)]
#[path = "separation_tests.rs"]
pub(super) mod tests;
