//! Ranking of the library's effects by their scores at the calibrated base.
//!
//! The score of effect k is z_k = g_kᵀPr/‖Pg_k‖, averaged over draws of the base model's parameters. Here g_k is the effect's whitened signature at the null, r the
//! whitened residual and P the projection of [`Tangent`]. The score is one-sided if the effect has one sign. If a parameter is unidentified at the null, the largest
//! score over a grid counts. To first order, some effects equal a change of the law's parameters. The signature of such an effect is the residual of the base's best fit to the
//! effect at a finite size ([`models::effects::Effect::signature_size`]). A ranking orders the refits and explains them. It excludes no effect, because a large effect may lie
//! far from its tangent.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::candidate::Coordinate;
use super::derivatives::column_m;
pub use super::score::Score;
use super::separation::{RivalTruth, fit_rival};
use super::{Candidate, Fitted, Subject, Tangent};
use base::error::Result;
use sampling::ensemble::RandomStream;

/// Number of posterior draws of the base model over which scores are averaged.
const N_DRAWS: usize = 64;
/// Prior quantiles for parameters that are unidentified at the null.
const GRID: [f64; 7] = [0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95];
/// Absolute cosine of two visible signatures above which two effects count as twins (of nearly the same shape).
const TWIN_COSINE: f64 = 0.99;
/// Visible fraction below which a signature comes from rounding and curvature, so that its direction is meaningless.
const LEAST_VISIBLE: f64 = 1e-6;
/// Number of simulations from which the quantile of the largest score is estimated.
const N_LARGEST: usize = 4_000;

/// Scores of candidates that each add effects to the base, in the candidates' order.
///
/// # Errors
/// [`base::Error::Numerical`] if the base has no derivatives.
pub fn scores(
    subject: &Subject,
    base: &Candidate,
    fitted: &Fitted,
    candidates: &[&Candidate],
    seed: u64,
) -> Result<Vec<Score>> {
    let centre = Tangent::new(subject, base, fitted)?;
    let finite: Vec<Option<Finite>> =
        candidates.par_iter().map(|candidate| Finite::new(subject, base, fitted, candidate)).collect::<Result<_>>()?;
    let at_fit = signatures(subject, base, fitted, candidates, &finite)?;
    let draws: Vec<Fitted> =
        (0..N_DRAWS).filter_map(|number| drawn(subject, base, fitted, &centre, seed, number)).collect();
    let z_of_draw = |draw: &Fitted| -> Result<Vec<Vec<f64>>> {
        let tangent = Tangent::new(subject, base, draw)?;
        let residual = tangent.projected_residual();
        let signatures = signatures(subject, base, draw, candidates, &finite)?;
        let z = |columns: &Vec<Vec<f64>>| {
            tangent.visible(columns).iter().map(|g| safe_ratio(g.dot(&residual), g.norm())).collect()
        };
        Ok(signatures.iter().map(z).collect())
    };
    let found: Vec<Result<Vec<Vec<f64>>>> = draws.par_iter().map(z_of_draw).collect();
    let found: Vec<Vec<Vec<f64>>> = found.into_iter().collect::<Result<_>>()?;
    let score = |(number, columns): (usize, &Vec<Vec<f64>>)| {
        let finite = finite[number].as_ref();
        let whole = centre.whiten(finite.map_or(columns, |finite| &finite.whole_m));
        let visible = centre.visible(columns);
        let residual = centre.projected_residual();
        let one_sign = sign_of_support(base, candidates[number]);
        if columns.is_empty() {
            return Score::nothing(one_sign.is_some());
        }
        let mean = |point: usize| match found.len() {
            0 => safe_ratio(visible[point].dot(&residual), visible[point].norm()),
            n => found.iter().map(|draw| draw[number][point]).sum::<f64>() / n as f64,
        };
        let oriented = |z: f64| one_sign.map_or(z, |sign| sign * z);
        let height = |z: f64| if one_sign.is_some() { oriented(z) } else { z.abs() };
        let fraction = |point: usize| safe_ratio(visible[point].norm_squared(), whole[point].norm_squared());
        let best = (0..columns.len()).max_by(|&a, &b| height(mean(a)).total_cmp(&height(mean(b)))).unwrap_or(0);
        let (z, free) = (mean(best), first_free(base, candidates[number]));
        let unit = free.map_or(1.0, |free| free.coordinate.unit(free.null.unwrap_or(0.0)));
        let norm = visible[best].norm();
        // The response of an effect with a finite signature grows with the square of its size. The coordinate may already be this square.
        let is_squared = free.is_some_and(|free| matches!(free.coordinate, Coordinate::Square { .. }));
        let expected = match finite {
            Some(finite) if !is_squared => {
                finite.step * safe_ratio(oriented(z).max(0.0), norm * finite.step.abs()).sqrt()
            }
            _ => safe_ratio(z, norm),
        };
        let visible_fraction = (0..columns.len()).map(fraction).fold(0.0, f64::max);
        Score {
            z: oriented(z),
            expected_parameter: expected_parameter(free, expected),
            visible_fraction,
            signature_per_unit: norm / unit,
            direction: (fraction(best) > LEAST_VISIBLE).then(|| visible[best].normalize()),
            is_one_sided: one_sign.is_some(),
        }
    };
    Ok(at_fit.iter().enumerate().map(score).collect())
}

impl Score {
    fn nothing(is_one_sided: bool) -> Self {
        Self {
            z: 0.0,
            expected_parameter: f64::NAN,
            visible_fraction: 0.0,
            signature_per_unit: 0.0,
            direction: None,
            is_one_sided,
        }
    }
}

/// Value of the first parameter at a step of its coordinate from the null.
fn expected_parameter(free: Option<&super::Free>, step: f64) -> f64 {
    free.map_or(step, |free| match free.null {
        Some(null) => free.value(null + step),
        None => step * free.coordinate.unit(0.0),
    })
}

fn safe_ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 0.0 }
}

/// First free parameter of a candidate that the base lacks.
fn first_free<'a>(base: &Candidate, candidate: &'a Candidate) -> Option<&'a super::Free> {
    candidate.free.iter().find(|free| base.free.iter().all(|known| known.name != free.name))
}

/// Sign (+1 or −1) of the first parameter that a candidate adds to the base; `None` if it may have both signs.
fn sign_of_support(base: &Candidate, candidate: &Candidate) -> Option<f64> {
    let free = first_free(base, candidate)?;
    let null = free.null?;
    free.is_one_sided().then(|| if free.ends[0] == null { 1.0 } else { -1.0 })
}

/// Unit vectors of a candidate's visible whitened signatures at a base's fit, one per grid point, and the sign of the effect's support.
pub(super) fn directions(
    subject: &Subject,
    (base, fitted): (&Candidate, &Fitted),
    candidate: &Candidate,
    tangent: &Tangent,
) -> Result<(Vec<DVector<f64>>, Option<f64>)> {
    let finite = Finite::new(subject, base, fitted, candidate)?;
    let columns = signatures(subject, base, fitted, &[candidate], &[finite])?.swap_remove(0);
    let whole = tangent.whiten(&columns);
    let seen = whole.into_iter().map(|white| (white.norm(), tangent.project(white)));
    let seen = seen.filter(|(whole, left)| left.norm() > LEAST_VISIBLE * whole).map(|(_, left)| left.normalize());
    Ok((seen.collect(), sign_of_support(base, candidate)))
}

/// Signature of an effect whose small response the base's parameters cannot absorb. The response is a column times an amplitude, which is a power of the effect's size.
pub(super) struct Signature {
    /// Columns in m per unit of amplitude, one value per row of the record. There is one column per grid point of the parameters unidentified at the null. Columns of
    /// effects with one sign point along their support.
    pub columns_m: Vec<Vec<f64>>,
    /// Name of the parameter that measures the effect's size.
    pub parameter: &'static str,
    /// Unit of the size: the amplitude is (size/unit)^power, with the size counted from the null in the parameter's unit.
    pub unit: f64,
    /// Power: 1, or 2 for an effect whose response begins with the square of its size.
    pub power: f64,
    /// Largest size below and above the null, in this order; 0 on a side outside the support.
    pub reach: [f64; 2],
    /// Value of the parameter at the null.
    pub null: f64,
    /// True if sizes count downwards from the null, because the support lies below it.
    pub is_downwards: bool,
}

/// Signature of the effect that a candidate adds to a base at its fit; `None` if its size is fixed.
///
/// # Errors
/// [`base::Error::Numerical`] if the candidate's model has no solution there.
pub(super) fn signature(
    subject: &Subject,
    (base, fitted): (&Candidate, &Fitted),
    candidate: &Candidate,
) -> Result<Option<Signature>> {
    let Some(free) = first_free(base, candidate) else { return Ok(None) };
    let Some(null) = free.null else { return Ok(None) };
    let finite = Finite::new(subject, base, fitted, candidate)?;
    let is_squared = matches!(free.coordinate, Coordinate::Square { .. });
    let value = |theta: f64| free.value(theta);
    let at_null = value(null);
    // The response of an effect with a finite signature grows with the square of the step, unless the coordinate is a square.
    let (unit, power) = match &finite {
        Some(finite) if !is_squared => ((value(null + finite.step.abs().sqrt()) - at_null).abs(), 2.0),
        _ => ((value(null + 1.0) - at_null).abs(), if is_squared { 2.0 } else { 1.0 }),
    };
    let mut columns_m = signatures(subject, base, fitted, &[candidate], &[finite])?.swap_remove(0);
    let mut reach = [at_null - value(free.ends[0]), value(free.ends[1]) - at_null].map(|size| size.max(0.0));
    let is_downwards = sign_of_support(base, candidate) == Some(-1.0);
    if is_downwards {
        columns_m.iter_mut().flatten().for_each(|x| *x = -*x);
        reach = [0.0, reach[0]];
    } else if power > 1.0 {
        reach[0] = 0.0;
    }
    Ok(Some(Signature { columns_m, parameter: free.name, unit, power, reach, null: at_null, is_downwards }))
}

/// Derivatives of the position with respect to each candidate's first new parameter at the null: one column per grid point. Candidates with a finite signature have its
/// columns instead.
fn signatures(
    subject: &Subject,
    base: &Candidate,
    fitted: &Fitted,
    candidates: &[&Candidate],
    finite: &[Option<Finite>],
) -> Result<Vec<Vec<Vec<f64>>>> {
    let of = |(candidate, finite): (&&Candidate, &Option<Finite>)| -> Result<Vec<Vec<f64>>> {
        if let Some(finite) = finite {
            return Ok(finite.left_m.clone());
        }
        let Some((place, points)) = points_at_null(base, fitted, candidate) else { return Ok(Vec::new()) };
        // At the null the candidate's position is the base's, whatever the values of unidentified parameters.
        // A model that has no solution on either side of the null has no signature.
        let columns = points.iter().map(|theta| column_m(subject, candidate, theta, place, &fitted.position_m));
        Ok(columns.collect::<Result<_>>().unwrap_or_default())
    };
    candidates.iter().zip(finite).map(of).collect()
}

/// Index of a candidate's first new parameter, and the candidate's points at the null: one per grid point of its unidentified parameters.
fn points_at_null(base: &Candidate, fitted: &Fitted, candidate: &Candidate) -> Option<(usize, Vec<Vec<f64>>)> {
    let first = first_free(base, candidate)?;
    let place = candidate.free.iter().position(|free| free.name == first.name)?;
    let start = candidate.embed(base, &fitted.theta);
    // Parameters of the base stay at their fit.
    let is_new = |free: &super::Free| base.free.iter().all(|known| known.name != free.name);
    let unidentified: Vec<usize> = (0..candidate.free.len())
        .filter(|k| candidate.free[*k].is_unidentified_at_null() && is_new(&candidate.free[*k]))
        .collect();
    let grid: &[f64] = if unidentified.is_empty() { &GRID[..1] } else { &GRID };
    let at = |probability: &f64| {
        let mut theta = start.clone();
        unidentified.iter().for_each(|k| theta[*k] = candidate.free[*k].quantile(*probability));
        theta
    };
    Some((place, grid.iter().map(at).collect()))
}

/// Response to an effect of finite size, per unit of its first parameter's coordinate. There is one column per grid point of the parameters unidentified at the null.
struct Finite {
    /// Size of the effect, as a step of its parameter's coordinate from the null.
    step: f64,
    /// Response relative to the base's fit (m per unit of the coordinate).
    whole_m: Vec<Vec<f64>>,
    /// Residual of the base model's best fit to the response (m per unit of the coordinate).
    left_m: Vec<Vec<f64>>,
}

impl Finite {
    /// Response to a finite size of the effect that `candidate` adds; `None` for effects that are visible at small sizes.
    fn new(subject: &Subject, base: &Candidate, fitted: &Fitted, candidate: &Candidate) -> Result<Option<Self>> {
        let is_new = |slug: &str| base.effects.iter().all(|effect| effect != slug);
        let added = candidate.model.effects().iter().find(|effect| is_new(effect.slug()));
        let Some(size) = added.and_then(|effect| effect.signature_size(candidate.model.scales())) else {
            return Ok(None);
        };
        let Some((place, points)) = points_at_null(base, fitted, candidate) else { return Ok(None) };
        let free = &candidate.free[place];
        let step = free.coordinate.theta(size) - free.null.unwrap_or(0.0);
        let mut finite = Self { step, whole_m: Vec::new(), left_m: Vec::new() };
        for mut theta in points {
            theta[place] += step;
            // An effect whose model has no solution at this size has no response.
            let Ok(position_m) = subject.trajectory_m(candidate, &theta) else { continue };
            let truth = RivalTruth { candidate, theta: &theta, noise: fitted.noise, position_m: &position_m };
            let nearest_m = subject.trajectory_m(base, &fit_rival(subject, base, &truth)?.theta)?;
            let per_unit = |other: &[f64]| position_m.iter().zip(other).map(|(a, b)| (a - b) / step).collect();
            finite.whole_m.push(per_unit(&fitted.position_m));
            finite.left_m.push(per_unit(&nearest_m));
        }
        Ok(Some(finite))
    }
}

/// Draws the base model's parameters around its fit.
fn drawn(
    subject: &Subject,
    base: &Candidate,
    fitted: &Fitted,
    tangent: &Tangent,
    seed: u64,
    number: usize,
) -> Option<Fitted> {
    let mut stream = RandomStream::new(seed, number as u64);
    let standard = DVector::from_fn(base.dimension(), |_, _| stream.normal());
    let step = tangent.coordinates_of(&standard)?;
    let theta: Vec<f64> = fitted
        .theta
        .iter()
        .zip(&step)
        .enumerate()
        .map(|(k, (theta, step))| (theta + step).clamp(base.ends(k)[0], base.ends(k)[1]))
        .collect();
    let position_m = subject.trajectory_m(base, &theta).ok()?;
    Some(Fitted { theta, position_m, ..fitted.clone() })
}

/// Signed cosines of the visible signatures of effects i (row) and j (column). An invisible effect has the cosine 0 with all others and 1 with itself.
pub fn cosines(scores: &[Score]) -> DMatrix<f64> {
    DMatrix::from_fn(scores.len(), scores.len(), |i, j| match (&scores[i].direction, &scores[j].direction) {
        (Some(a), Some(b)) => a.dot(b),
        _ => f64::from(u8::from(i == j)),
    })
}

/// For each effect, indices of the effects with nearly the same shape.
pub fn twins(cosines: &DMatrix<f64>) -> Vec<Vec<usize>> {
    let n = cosines.nrows();
    (0..n).map(|i| (0..n).filter(|j| *j != i && cosines[(i, *j)].abs() > TWIN_COSINE).collect()).collect()
}

/// 95 % quantile of the largest score in experiments without any effect, simulated from N(0, C) with the matrix C of [`cosines`].
pub fn largest_score_threshold(scores: &[Score], cosines: &DMatrix<f64>, seed: u64) -> f64 {
    let eigen = cosines.clone().symmetric_eigen();
    let root = &eigen.eigenvectors * DMatrix::from_diagonal(&eigen.eigenvalues.map(|value| value.max(0.0).sqrt()));
    let largest = |number: usize| {
        let mut stream = RandomStream::new(seed, number as u64);
        let z = &root * DVector::from_fn(scores.len(), |_, _| stream.normal());
        let height = |(score, z): (&Score, &f64)| if score.is_one_sided { *z } else { z.abs() };
        scores.iter().zip(z.iter()).map(height).fold(0.0, f64::max)
    };
    let mut sample: Vec<f64> = (0..N_LARGEST).map(largest).collect();
    sample.sort_by(f64::total_cmp);
    sample[N_LARGEST * 95 / 100]
}

/// Joint squared score of two effects, zᵀC⁻¹z with their scores z and the matrix C of their cosines. It is twice the first-order gain (nats) of the pair.
pub fn pair_score(a: &Score, b: &Score) -> f64 {
    let cosine = match (&a.direction, &b.direction) {
        (Some(x), Some(y)) => x.dot(y),
        _ => 0.0,
    };
    let rest = 1.0 - cosine * cosine;
    if rest < 1e-4 {
        return a.z.powi(2).max(b.z.powi(2));
    }
    (a.z * a.z + b.z * b.z - 2.0 * cosine * a.z * b.z) / rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Search;
    use crate::derivatives::columns_m;
    use crate::separation::tests::{NOISE, TWO_LEVELS, at, subject_with};
    use crate::test_replica::{WHITE, base_fit, replica, simulated};
    use models::effects::Library;

    /// On 120 correct models the z of a drift has mean 0 ± 0.091 and a variance of χ²₁₁₉/119. Correct code violates each bound with a probability below 1e-6. A drift of
    /// six standard errors has a z of −6 with a tolerance of five.
    #[test]
    fn scores_are_standard_where_nothing_is_missing_and_expect_what_is() {
        let (base, fitted) = base_fit();
        let drift = replica().extended(&["tracking-drift"]).expect("addable");
        let score = |velocity_m_per_s: f64, seed: u64| {
            let mut theta = drift.embed(&base, &fitted.theta);
            let place = drift.free.iter().position(|free| free.null.is_some()).expect("the drift");
            theta[place] = drift.free[place].coordinate.theta(velocity_m_per_s);
            let data = simulated(&drift, &theta, &WHITE, seed);
            let fitted = data.fit(&base, &[(fitted.theta.clone(), WHITE)], Search::Local).expect("fits");
            let fitted = Fitted { noise: WHITE, ..fitted };
            scores(&data, &base, &fitted, &[&drift], seed).expect("derivatives").swap_remove(0)
        };
        let z: Vec<f64> = (0..120_u64).into_par_iter().map(|seed| score(0.0, 300 + seed).z).collect();
        let mean = z.iter().sum::<f64>() / 120.0;
        let variance = z.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / 119.0;
        assert!(mean.abs() < 0.46 && (0.45..1.8).contains(&variance), "{mean} {variance}");
        let velocity = 6.0 / score(0.0, 300).signature_per_unit;
        let found = score(-velocity, 7);
        assert!((found.z + 6.0).abs() < 5.0, "{}", found.z);
        // The signature is computed at each fit; the fits differ by about a per cent.
        assert!((found.expected_parameter / -velocity / (found.z.abs() / 6.0) - 1.0).abs() < 0.05);
    }

    /// Parameters of the base stay at their fit, even if they are unidentified without an effect. A bias therefore has one signature and no grid.
    #[test]
    fn a_grid_is_of_what_is_new() {
        let subject = subject_with(&TWO_LEVELS, &Library::default(), &["second-retardation"]);
        let base = subject.base();
        let theta: Vec<f64> = base.free.iter().map(|free| free.quantile(0.7)).collect();
        let position_m = subject.trajectory_m(&base, &theta).expect("a model");
        let fitted = Fitted { theta, noise: NOISE, position_m, objective: 0.0, ln_likelihood: 0.0 };
        let bias = subject.extended(&["force-bias"]).expect("addable");
        let of_bias = signatures(&subject, &base, &fitted, &[&bias], &[None]).expect("derivatives").remove(0);
        let place = bias.free.iter().position(|free| free.name.starts_with("force-bias")).expect("its size");
        let start = bias.embed(&base, &fitted.theta);
        let expected = columns_m(&subject, &bias, &start).expect("derivatives").swap_remove(place);
        let size = expected.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        // Differences over steps of 10⁻⁴ lose four digits of the positions.
        assert!(of_bias.len() == 1 && of_bias[0].iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-8 * size));
        let second = subject_with(&TWO_LEVELS, &Library::default(), &[]);
        let (base, fitted) = at(&second, &[], &[]);
        let added = second.extended(&["second-retardation"]).expect("addable");
        assert_eq!(signatures(&second, &base, &fitted, &[&added], &[None]).expect("derivatives")[0].len(), GRID.len());
    }

    /// Effects that are twins at one force level have parallel signatures. The threshold of two independent scores equals the textbook value.
    #[test]
    fn cosines_name_twins_and_thresholds_are_those_of_normals() {
        let (base, fitted) = base_fit();
        let models: Vec<Candidate> = ["force-bias", "force-asymmetry", "tracking-drift"]
            .iter()
            .map(|slug| replica().extended(&[slug]).expect("addable"))
            .collect();
        let found = scores(replica(), &base, &fitted, &models.iter().collect::<Vec<_>>(), 1).expect("derivatives");
        assert_eq!(twins(&cosines(&found)), [vec![1], vec![0], vec![]]);
        let independent = DMatrix::identity(2, 2);
        // 1 − (1 − 0.05)^½ on two sides gives 2.236; the quantile of 4,000 draws is within 0.1 at five standard deviations.
        let threshold = largest_score_threshold(&found[1..], &independent, 1);
        assert!((threshold - 2.236).abs() < 0.1, "{threshold}");
    }

    #[test]
    fn a_pair_of_orthogonal_scores_adds_up() {
        let score = |z: f64, direction: [f64; 2]| Score {
            z,
            expected_parameter: 0.0,
            visible_fraction: 1.0,
            signature_per_unit: 1.0,
            direction: Some(DVector::from_row_slice(&direction)),
            is_one_sided: false,
        };
        let (a, b) = (score(3.0, [1.0, 0.0]), score(4.0, [0.0, 1.0]));
        assert_eq!(pair_score(&a, &b), 25.0);
        assert_eq!(pair_score(&a, &score(4.0, [1.0, 0.0])), 16.0);
        // r = (1, 7) is measured along (1, 0) and (0.6, 0.8): both directions span the plane, so the pair explains all of ‖r‖².
        let oblique = score(0.6 + 5.6, [0.6, 0.8]);
        assert!((pair_score(&score(1.0, [1.0, 0.0]), &oblique) - 50.0).abs() < 1e-12);
    }
}
