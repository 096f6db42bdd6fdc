//! Variance-based sensitivity indices for correlated inputs.
//!
//! The inputs have a Gaussian copula: normal scores with the correlations of the draws' ranks, and the draws' own marginal distributions. First-order and
//! total indices are those of Kucherenko, Tarantola & Annoni (2012), Comput. Phys. Commun. 183:937, which equal Sobol's for independent inputs. Shapley effects
//! (Owen 2014, SIAM/ASA J. Uncertain. Quantif. 2:245) divide the variance among the inputs, so that the shares add up to 1 whatever the correlations: the inputs become
//! known in random order, and the effect of an input is the mean variance that vanishes when its turn comes (Song, Nelson & Staum 2016, ibid. 4:1060).

use base::error::{Error, Result};
use figures::density::quantile_of_sorted;
use models::model::N_LANES;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

/// Largest number of times that a point without a value is drawn again.
const MOST_REDRAWS: usize = 40;

/// Marginal distribution of an input.
#[derive(Debug, Clone, PartialEq)]
pub enum Marginal {
    /// Distribution of draws, in ascending order.
    Draws(Vec<f64>),
    /// Uniform distribution between two values.
    Uniform([f64; 2]),
}

/// Uncertain inputs with their correlations.
#[derive(Debug, Clone)]
pub struct Inputs {
    names: Vec<String>,
    marginals: Vec<Marginal>,
    correlation: DMatrix<f64>,
}

/// First-order index, total index and Shapley effect of one quantity to one input, with standard errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Index {
    /// First-order index and its standard error.
    pub first_order: [f64; 2],
    /// Total index and its standard error.
    pub total: [f64; 2],
    /// Shapley effect and its standard error.
    pub shapley: [f64; 2],
}

impl Inputs {
    /// Inputs with the joint distribution of draws. `values` holds one list per draw. Inputs that do not vary are left out; the returned indices tell which
    /// columns remain.
    pub fn of_draws(names: &[String], values: &[Vec<f64>]) -> (Self, Vec<usize>) {
        let column = |k: usize| values.iter().map(|draw| draw[k]).collect::<Vec<f64>>();
        let varies = |k: &usize| values.iter().any(|draw| draw[*k] != values[0][*k]);
        let kept: Vec<usize> = (0..names.len()).filter(varies).collect();
        let scores: Vec<Vec<f64>> = kept.iter().map(|k| normal_scores(&column(*k))).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let correlation = DMatrix::from_fn(kept.len(), kept.len(), |i, j| {
            dot(&scores[i], &scores[j]) / (dot(&scores[i], &scores[i]) * dot(&scores[j], &scores[j])).sqrt()
        });
        let sorted = |k: &usize| {
            let mut ascending = column(*k);
            ascending.sort_by(f64::total_cmp);
            Marginal::Draws(ascending)
        };
        let marginals = kept.iter().map(sorted).collect();
        (Self { names: kept.iter().map(|k| names[*k].clone()).collect(), marginals, correlation }, kept)
    }

    /// Adds an input that is independent of all others.
    pub fn push_independent(&mut self, name: &str, marginal: Marginal) {
        let n = self.names.len();
        self.names.push(name.into());
        self.marginals.push(marginal);
        self.correlation = self.correlation.clone().insert_row(n, 0.0).insert_column(n, 0.0);
        self.correlation[(n, n)] = 1.0;
    }

    /// Names of the inputs.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Values of the inputs at normal scores.
    fn values(&self, scores: &[f64]) -> Vec<f64> {
        let normal = Normal::standard();
        let value = |(score, marginal): (&f64, &Marginal)| {
            let probability = normal.cdf(*score);
            match marginal {
                Marginal::Draws(ascending) => quantile_of_sorted(ascending, probability),
                Marginal::Uniform([lower, upper]) => lower + (upper - lower) * probability,
            }
        };
        scores.iter().zip(&self.marginals).map(value).collect()
    }
}

/// Normal scores of the ranks of values.
fn normal_scores(values: &[f64]) -> Vec<f64> {
    let normal = Normal::standard();
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut scores = vec![0.0; values.len()];
    for (rank, index) in order.into_iter().enumerate() {
        scores[index] = normal.inverse_cdf((rank as f64 + 0.5) / values.len() as f64);
    }
    scores
}

/// Computes the indices of every quantity to every input from `n` pairs of points for each index. `quantities` returns the values of all quantities at each of several
/// points, which are the inputs' values. The result is indexed by quantity, then by input.
///
/// Values that are not finite are missing. The indices then hold for the inputs among points at which all quantities have values: points without them are drawn again,
/// given the inputs that keep their values. A point that is never drawn with values takes those of the point with which it shares these inputs.
///
/// # Errors
/// [`Error::Numerical`] if the correlations are singular, or if hardly any point has values; errors of `quantities`.
pub fn indices(
    inputs: &Inputs,
    n: usize,
    seed: u64,
    quantities: impl Fn(&[Vec<f64>]) -> Result<Vec<Vec<f64>>> + Sync,
) -> Result<Vec<Vec<Index>>> {
    let d = inputs.names.len();
    let singular = || {
        Error::numerical("inputs of the sensitivity depend on each other exactly", "fix one of the parameters that do")
    };
    let correlation = &inputs.correlation;
    let factor = correlation.clone().cholesky().ok_or_else(singular)?;
    let precision = factor.inverse();
    let lower = factor.l();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut orders = ChaCha8Rng::seed_from_u64(seed);
    orders.set_stream(1);
    let mut normals = |count: usize| DVector::from_fn(count, |_, _| StandardNormal.sample(&mut random));
    let mut points: Vec<DVector<f64>> = (0..n).map(|_| &lower * normals(d)).collect();
    let evaluate = |points: &[DVector<f64>]| -> Result<Vec<Vec<f64>>> {
        let of_chunk = |points: &[DVector<f64>]| {
            quantities(&points.iter().map(|point| inputs.values(point.as_slice())).collect::<Vec<Vec<f64>>>())
        };
        let chunks: Vec<Vec<Vec<f64>>> = points.par_chunks(N_LANES).map(of_chunk).collect::<Result<_>>()?;
        Ok(chunks.into_iter().flatten().collect())
    };
    let has_values = |values: &Vec<f64>| values.iter().all(|value| value.is_finite());
    // Values of points, of which those without values are drawn again.
    let valued = |points: &mut [DVector<f64>], again: &mut dyn FnMut(usize) -> DVector<f64>| -> Result<Vec<Vec<f64>>> {
        let mut values = evaluate(points)?;
        for _ in 0..MOST_REDRAWS {
            let missing: Vec<usize> = (0..points.len()).filter(|k| !has_values(&values[*k])).collect();
            if missing.is_empty() {
                break;
            }
            missing.iter().for_each(|k| points[*k] = again(*k));
            let drawn: Vec<DVector<f64>> = missing.iter().map(|k| points[*k].clone()).collect();
            missing.into_iter().zip(evaluate(&drawn)?).for_each(|(k, found)| values[k] = found);
        }
        Ok(values)
    };
    let base = valued(&mut points, &mut |_| &lower * normals(d))?;
    if !base.iter().all(has_values) {
        return Err(Error::numerical(
            "a quantity has no value for nearly all draws, so that its variance has no sources",
            "leave out the quantity, or give a longer duration",
        ));
    }
    // Values of further points; `of_place` tells the base point of each.
    let partners = |values: Vec<Vec<f64>>, of_place: &dyn Fn(usize) -> usize| -> Vec<Vec<f64>> {
        let with_values = |(k, values)| if has_values(&values) { values } else { base[of_place(k)].clone() };
        values.into_iter().enumerate().map(with_values).collect()
    };
    let n_quantities = base.first().map_or(0, Vec::len);
    let mut found = vec![Vec::with_capacity(d); n_quantities];
    // In a random order of the inputs, the first k keep their values and the others are drawn given them, for every k below d.
    let mut order_of: Vec<Vec<usize>> = Vec::with_capacity(n);
    let mut factors: Vec<(DMatrix<f64>, DVector<f64>)> = Vec::with_capacity(n);
    let mut with_first_kept: Vec<DVector<f64>> = Vec::with_capacity(n * d);
    for point in &points {
        let mut order: Vec<usize> = (0..d).collect();
        order.shuffle(&mut orders);
        let ordered = DMatrix::from_fn(d, d, |a, b| correlation[(order[a], order[b])]);
        let lower = ordered.cholesky().ok_or_else(singular)?.l();
        let known = DVector::from_iterator(d, order.iter().map(|i| point[*i]));
        let known = lower.solve_lower_triangular(&known).ok_or_else(singular)?;
        let other = normals(d);
        with_first_kept.extend((0..d).map(|k| keeping_first(k, &order, (&lower, &known), &other)));
        factors.push((lower, known));
        order_of.push(order);
    }
    let mut again = |entry: usize| {
        let (place, k) = (entry / d, entry % d);
        let (lower, known) = &factors[place];
        keeping_first(k, &order_of[place], (lower, known), &normals(d))
    };
    let with_first_kept = valued(&mut with_first_kept, &mut again)?;
    let with_first_kept = partners(with_first_kept, &|entry| entry / d);
    let shapley = |q: usize| shapley_effects(&base, &with_first_kept, &order_of, q);
    let shapley: Vec<Vec<[f64; 2]>> = (0..n_quantities).map(shapley).collect();
    for i in 0..d {
        // Keeps input i, and draws the others given it.
        let others: Vec<usize> = (0..d).filter(|j| *j != i).collect();
        let slope = DVector::from_iterator(d - 1, others.iter().map(|j| correlation[(*j, i)]));
        let rest =
            DMatrix::from_fn(d - 1, d - 1, |a, b| correlation[(others[a], others[b])]) - &slope * slope.transpose();
        let rest = if d > 1 { rest.cholesky().ok_or_else(singular)?.l() } else { rest };
        let keeping = |point: &DVector<f64>, other: &DVector<f64>| {
            let drawn = &slope * point[i] + &rest * other;
            let mut new = point.clone();
            others.iter().zip(drawn.iter()).for_each(|(j, value)| new[*j] = *value);
            new
        };
        let mut with_kept: Vec<DVector<f64>> = points.iter().map(|point| keeping(point, &normals(d - 1))).collect();
        // Keeps the others, and draws input i given them.
        let drawing = |point: &DVector<f64>, score: f64| {
            let mean = -others.iter().map(|j| precision[(i, *j)] * point[*j]).sum::<f64>() / precision[(i, i)];
            let mut new = point.clone();
            new[i] = mean + score / precision[(i, i)].sqrt();
            new
        };
        let mut with_drawn: Vec<DVector<f64>> = points.iter().map(|point| drawing(point, normals(1)[0])).collect();
        let kept = valued(&mut with_kept, &mut |place| keeping(&points[place], &normals(d - 1)))?;
        let drawn = valued(&mut with_drawn, &mut |place| drawing(&points[place], normals(1)[0]))?;
        let [kept, drawn] = [kept, drawn].map(|values| partners(values, &|place| place));
        for (q, list) in found.iter_mut().enumerate() {
            let pairs =
                |other: &[Vec<f64>]| -> Vec<[f64; 2]> { base.iter().zip(other).map(|(a, b)| [a[q], b[q]]).collect() };
            let first_order = ratio(&pairs(&kept), |a, b| a * b);
            let total = ratio(&pairs(&drawn), |a, b| 0.5 * (a - b) * (a - b));
            list.push(Index { first_order, total, shapley: shapley[q][i] });
        }
    }
    Ok(found)
}

/// Point whose first `k` inputs of an order keep their values, with the others drawn given them. `lower` is the Cholesky factor of the ordered correlations, `known` the
/// independent scores of the point, and `other` new ones.
fn keeping_first(
    k: usize,
    order: &[usize],
    (lower, known): (&DMatrix<f64>, &DVector<f64>),
    other: &DVector<f64>,
) -> DVector<f64> {
    let d = order.len();
    let drawn = lower * DVector::from_fn(d, |row, _| if row < k { known[row] } else { other[row] });
    let mut new = DVector::zeros(d);
    order.iter().zip(drawn.iter()).for_each(|(i, value)| new[*i] = *value);
    new
}

/// Share of the variance of a quantity that two evaluations with common inputs have in common, with its standard error: the first-order index of the common inputs. Entry k of `one`
/// and of `other` have the same common inputs, and independent others.
pub fn covariance_share(one: &[f64], other: &[f64]) -> [f64; 2] {
    let pairs: Vec<[f64; 2]> = one.iter().zip(other).map(|(a, b)| [*a, *b]).collect();
    ratio(&pairs, |a, b| a * b)
}

/// Shapley effects of quantity `q` to every input, with standard errors. `base` holds the quantities of every point; `with_first_kept` those of d further points for each,
/// in which the first 0, 1, … d − 1 inputs of its order keep their values.
fn shapley_effects(
    base: &[Vec<f64>],
    with_first_kept: &[Vec<f64>],
    order_of: &[Vec<usize>],
    q: usize,
) -> Vec<[f64; 2]> {
    let d = order_of.first().map_or(0, Vec::len);
    let n = base.len() as f64;
    // Half the mean square of the difference is the variance that remains when the kept inputs are known.
    let left = |place: usize, k: usize| {
        if k == d { 0.0 } else { 0.5 * (base[place][q] - with_first_kept[place * d + k][q]).powi(2) }
    };
    let total = (0..base.len()).map(|place| left(place, 0)).sum::<f64>() / n;
    if total <= 0.0 {
        return vec![[0.0, 0.0]; d];
    }
    let mut vanished = vec![vec![0.0; base.len()]; d];
    for (place, order) in order_of.iter().enumerate() {
        for (k, input) in order.iter().enumerate() {
            vanished[*input][place] = left(place, k) - left(place, k + 1);
        }
    }
    let effect = |parts: &Vec<f64>| {
        let share = parts.iter().sum::<f64>() / (n * total);
        let deviation = |(place, part): (usize, &f64)| ((part - share * left(place, 0)) / total).powi(2);
        [share, parts.iter().enumerate().map(deviation).sum::<f64>().sqrt() / n]
    };
    vanished.iter().map(effect).collect()
}

/// Ratio of the mean of `numerator`, taken of the deviations from the mean, to the variance of all values; with its standard error from the variance of the
/// ratio's linearisation.
fn ratio(pairs: &[[f64; 2]], numerator: impl Fn(f64, f64) -> f64) -> [f64; 2] {
    let n = pairs.len() as f64;
    let mean = pairs.iter().flatten().sum::<f64>() / (2.0 * n);
    let variance = pairs.iter().flatten().map(|y| (y - mean) * (y - mean)).sum::<f64>() / (2.0 * n);
    if variance <= 0.0 {
        return [0.0, 0.0];
    }
    let terms: Vec<[f64; 2]> = pairs
        .iter()
        .map(|[a, b]| {
            let (a, b) = (a - mean, b - mean);
            [numerator(a, b), 0.5 * (a * a + b * b)]
        })
        .collect();
    let index = terms.iter().map(|term| term[0]).sum::<f64>() / (n * variance);
    let error = terms.iter().map(|term| ((term[0] - index * term[1]) / variance).powi(2)).sum::<f64>();
    [index, error.sqrt() / n]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Largest distance in standard errors. Twenty-six indices are compared; each fails falsely with probability 3·10⁻⁴, all together below 1 %; the seed is
    /// fixed.
    const MOST_ERRORS: f64 = 3.6;
    const N: usize = 20_000;

    /// Evaluates a function at each of several points.
    fn each(function: impl Fn(&[f64]) -> Vec<f64> + Sync) -> impl Fn(&[Vec<f64>]) -> Result<Vec<Vec<f64>>> + Sync {
        move |points| Ok(points.iter().map(|point| function(point)).collect())
    }

    fn independent(n: usize, range: [f64; 2]) -> Inputs {
        let mut inputs = Inputs { names: Vec::new(), marginals: Vec::new(), correlation: DMatrix::zeros(0, 0) };
        (0..n).for_each(|k| inputs.push_independent(&format!("x{k}"), Marginal::Uniform(range)));
        inputs
    }

    fn assert_near(found: [f64; 2], expected: f64, what: &str) {
        let [value, error] = found;
        assert!(
            error < 0.03 && (value - expected).abs() <= MOST_ERRORS * error.max(1e-9),
            "{what}: {value} ± {error}, exact {expected}"
        );
    }

    #[test]
    fn ishigami_has_its_exact_indices() {
        let (a, b) = (7.0, 0.1);
        let ishigami = |x: &[f64]| vec![x[0].sin() + a * x[1].sin().powi(2) + b * x[2].powi(4) * x[0].sin()];
        let found = &indices(&independent(3, [-PI, PI]), N, 1, each(ishigami)).expect("indices")[0];
        let variance = a * a / 8.0 + b * PI.powi(4) / 5.0 + b * b * PI.powi(8) / 18.0 + 0.5;
        let [v1, v2] = [0.5 * (1.0 + b * PI.powi(4) / 5.0).powi(2), a * a / 8.0].map(|v| v / variance);
        let v13 = b * b * PI.powi(8) * (1.0 / 18.0 - 1.0 / 50.0) / variance;
        for (k, (first, total)) in [(v1, v1 + v13), (v2, v2), (0.0, v13)].into_iter().enumerate() {
            assert_near(found[k].first_order, first, &format!("first order {k}"));
            assert_near(found[k].total, total, &format!("total {k}"));
            // The interaction of the first and the third input is shared equally.
            assert_near(found[k].shapley, 0.5 * (first + total), &format!("Shapley {k}"));
        }
    }

    #[test]
    fn sobol_g_of_eight_inputs_has_its_exact_indices() {
        let a = [0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0];
        let g = |x: &[f64]| vec![x.iter().zip(a).map(|(x, a)| ((4.0 * x - 2.0).abs() + a) / (1.0 + a)).product()];
        let found = &indices(&independent(8, [0.0, 1.0]), N, 2, each(g)).expect("indices")[0];
        let part = a.map(|a: f64| 1.0 / (3.0 * (1.0 + a) * (1.0 + a)));
        let variance = part.iter().map(|v| 1.0 + v).product::<f64>() - 1.0;
        for k in 0..4 {
            assert_near(found[k].first_order, part[k] / variance, &format!("first order {k}"));
            let others: f64 = (0..8).filter(|j| *j != k).map(|j| 1.0 + part[j]).product();
            assert_near(found[k].total, part[k] * others / variance, &format!("total {k}"));
        }
    }

    /// Without a value outside the triangle x₀ + x₁ < 1, the inputs depend on each other. The first has the density 2(1 − x₀), the variance 1/18 and the mean (1 − x₁)/2 given the
    /// second, with the variance (1 − x₁)²/12.
    #[test]
    fn indices_hold_among_the_points_with_a_value() {
        let in_triangle = |x: &[f64]| vec![if x[0] + x[1] < 1.0 { x[0] } else { f64::INFINITY }];
        let found = &indices(&independent(2, [0.0, 1.0]), N, 4, each(in_triangle)).expect("indices")[0];
        for (k, [first, total, shapley]) in [[1.0, 0.75, 0.875], [0.25, 0.0, 0.125]].into_iter().enumerate() {
            assert_near(found[k].first_order, first, &format!("first order {k}"));
            assert_near(found[k].total, total, &format!("total {k}"));
            assert_near(found[k].shapley, shapley, &format!("Shapley {k}"));
        }
        // A condition on one input leaves the inputs independent: shares of 1/4 and 1 in the variance.
        let halved = |x: &[f64]| vec![if x[0] < 0.5 { x[0] + x[1] } else { f64::INFINITY }];
        let found = &indices(&independent(2, [0.0, 1.0]), N, 4, each(halved)).expect("indices")[0];
        assert_near(found[0].shapley, 0.2, "Shapley of the input with the condition");
        assert_near(found[1].first_order, 0.8, "first order of the other");
        let nowhere = indices(&independent(2, [0.0, 1.0]), 16, 4, each(|_| vec![f64::INFINITY]));
        assert!(nowhere.is_err_and(|error| error.to_string().contains("no value")));
    }

    #[test]
    fn correlated_normal_inputs_of_a_linear_model_have_their_closed_forms() {
        let n = 20_000;
        let normal = Normal::standard();
        let draws =
            |sd: f64| Marginal::Draws((0..n).map(|k| sd * normal.inverse_cdf((k as f64 + 0.5) / n as f64)).collect());
        let sd = [1.0, 2.0, 1.0];
        let correlation = DMatrix::from_row_slice(3, 3, &[1.0, 0.6, 0.0, 0.6, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let names = ["a", "b", "c"].map(String::from).to_vec();
        let inputs = Inputs { names, marginals: sd.map(draws).to_vec(), correlation: correlation.clone() };
        let found = &indices(&inputs, N, 3, each(|x| vec![x.iter().sum()])).expect("indices")[0];
        let covariance = DMatrix::from_fn(3, 3, |i, j| correlation[(i, j)] * sd[i] * sd[j]);
        let variance = covariance.sum();
        let precision = covariance.clone().try_inverse().expect("an inverse");
        for k in 0..3 {
            let with_sum: f64 = covariance.row(k).sum();
            assert_near(found[k].first_order, with_sum * with_sum / (covariance[(k, k)] * variance), "first order");
            assert_near(found[k].total, 1.0 / (precision[(k, k)] * variance), "total");
            assert_near(found[k].shapley, shapley_of_sum(&covariance, k), "Shapley");
        }
        let sum: f64 = found.iter().map(|index| index.shapley[0]).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
    }

    /// Shapley effect of input `k` of a sum of normal inputs, by its definition: the mean over all orders of the variance that vanishes.
    fn shapley_of_sum(covariance: &DMatrix<f64>, k: usize) -> f64 {
        let d = covariance.nrows();
        // Variance of the sum that remains when a set of inputs is known.
        let left = |known: &[usize]| {
            let others: Vec<usize> = (0..d).filter(|j| !known.contains(j)).collect();
            let block = |rows: &[usize], columns: &[usize]| {
                DMatrix::from_fn(rows.len(), columns.len(), |a, b| covariance[(rows[a], columns[b])])
            };
            let explained = match known.len() {
                0 => DMatrix::zeros(others.len(), others.len()),
                _ => {
                    let across = block(&others, known);
                    &across * block(known, known).try_inverse().expect("an inverse") * across.transpose()
                }
            };
            (block(&others, &others) - explained).sum()
        };
        let factorial = |n: usize| (1..=n).product::<usize>() as f64;
        let sets = (0..1_usize << d).filter(|set| set & (1 << k) == 0);
        let part = |set: usize| {
            let known: Vec<usize> = (0..d).filter(|j| set & (1 << j) != 0).collect();
            let with_input = [&known[..], &[k]].concat();
            let weight = factorial(known.len()) * factorial(d - known.len() - 1) / factorial(d);
            weight * (left(&known) - left(&with_input))
        };
        sets.map(part).sum::<f64>() / left(&[])
    }

    /// Two specimens of one group have the group in common: with standard deviations 1 and 2 the group's share of the variance is 1/5.
    #[test]
    fn the_share_of_common_inputs_is_that_of_their_variance() {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let pairs: Vec<[f64; 2]> = (0..N)
            .map(|_| {
                let group = normal();
                [group + 2.0 * normal(), group + 2.0 * normal()]
            })
            .collect();
        let [one, other] = [0, 1].map(|k| pairs.iter().map(|pair| pair[k]).collect::<Vec<f64>>());
        assert_near(covariance_share(&one, &other), 0.2, "share");
    }

    #[test]
    fn draws_give_back_their_correlation_and_constants_are_left_out() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let draw = |_| {
            let [a, b]: [f64; 2] = [StandardNormal.sample(&mut random), StandardNormal.sample(&mut random)];
            vec![a.exp(), 7.0, 0.8 * a + 0.6 * b]
        };
        let values: Vec<Vec<f64>> = (0..5_000).map(draw).collect();
        let (inputs, kept) = Inputs::of_draws(&["a", "b", "c"].map(String::from), &values);
        assert_eq!((kept, inputs.names()), (vec![0, 2], &["a", "c"].map(String::from)[..]));
        assert!((inputs.correlation[(0, 1)] - 0.8).abs() < 0.02);
    }
}
