//! Point estimate by the method of the paper: nonlinear least squares on the fitted cycles. One full finite-element run checks the result.
//!
//! The search coordinates are logarithms of the law's parameters, and the effects' parameters themselves. The reduced model provides analytic derivatives. Several
//! starts avoid local minima. Priors provide the starts and the range of the search, which contains all but 2·10⁻⁹ of their probability.

use documents::fit::{FitSummary, FittedParameter};
use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::fitted_rows::{FittedRows, MOST_SEARCHED, SAME_MINIMUM, is_same_minimum, refine_minima};
use crate::advice::{
    impossible_positions_warning, mesh_warning, nothing_held_out_warning, recorded_strain_warning, strain_warning,
    surrogate_warning,
};
use crate::full_check::{largest_strain, rmse_m};
use crate::judgement::{Judgement, Prediction};
use crate::monitor::Monitor;
use crate::noise::NoiseModel;
use crate::prepared::{KeptSurrogate, PreparedModel};
use crate::problem::{Problem, TAIL_MASS};
use crate::trust::trust;
use base::error::{Error, InputPlace, Result, Setting};
use base::parameter::ParameterSpec;
use documents::posterior::{Warning, WarningKind};
use documents::trust::Trust;
use figures::number::format_significant;
use models::effects::{EffectParameter, POSITION_OFFSET};
use models::model::{Forward, SurrogateForward, TrainedRange};
use sampling::least_squares::{Fit, LeastSquaresProblem, Tolerances, fit};

/// Number of starts of the search at quantiles of the prior, besides the start at the medians.
const N_QUANTILE_STARTS: u32 = 15;
/// Probability of the smallest prior quantile among the starts. The largest quantile has one minus this probability.
const START_TAIL: f64 = 0.02;
/// Seed of the scrambled Sobol sequence of starts. It is fixed, because the starts are part of the method.
const START_SEED: u32 = 2;
/// Largest distance between the logarithm of an estimate and an end of its range at which the estimate counts as lying at that end.
const AT_END: f64 = 0.01;
/// Probability beyond either end of the quantile range that is used as a prior's width.
const SPREAD_TAIL: f64 = 0.25;
/// Step in a search coordinate for finite differences, which replace derivatives without a closed form.
const FINITE_STEP: f64 = 1e-4;
/// Equivalent of [`AT_END`] for parameters with a linear coordinate, in units of the prior's width.
const AT_LINEAR_END: f64 = 1e-6;
/// Largest number of rows for which all derivatives are kept in memory. They take a gigabyte.
const MOST_ROWS_OF_COLUMNS: usize = 10_000_000;
/// Largest number of effects for which every combination of free effects and effects fixed at the null is tried. Further effects stay free.
const MOST_HELD: usize = 4;

/// Multiples of an effect's parameter at which the search starts again.
const ASIDE: [f64; 6] = [0.03, 0.1, 0.3, 3.0, 10.0, 30.0];
/// Largest difference in χ² at which another minimum cannot be excluded.
const AS_GOOD: f64 = 9.0;
/// Least distance between two minima, in standard errors of a parameter, at which they are different.
const APART: f64 = 5.0;

/// Result of a fit, with the prepared model for further computations.
pub struct FitResult {
    /// Summary of the fit, as written to `fit.json`.
    pub summary: FitSummary,
    /// Model that was fitted, with its surrogate.
    pub model: PreparedModel,
    /// All model parameters at the estimate, including fixed ones, in SI units.
    pub model_parameters: Vec<f64>,
    /// Covariance matrix of the estimated parameters, row by row, in the search coordinates (logarithms for the law's parameters). NaN if the data do not determine the
    /// parameters.
    pub covariance: Vec<f64>,
}

/// Fits a model to the calibration cycles.
///
/// # Errors
/// [`Error::Input`] if every parameter of the model is fixed; errors of surrogate, search and full-order run.
pub fn run(problem: &Problem, kept_surrogate: Option<KeptSurrogate>, monitor: &dyn Monitor) -> Result<FitResult> {
    let names: Vec<&str> = problem.model.parameters().iter().map(|p| p.name).collect();
    let free: Vec<usize> = (0..names.len()).filter(|&j| !problem.specification.fixed.contains_key(names[j])).collect();
    if free.is_empty() {
        return Err(Error::input(
            InputPlace::setting(Setting::Fixed),
            "every parameter of the model is fixed, so no parameter is left to fit",
            format!("leave one of {} free, or use `simulate`", names.join(", ")),
        ));
    }
    let model = PreparedModel::new(problem, kept_surrogate, monitor)?;
    monitor.stage("fitting the calibration cycles");
    let data = best_support(&model, &free, &FittedRows::new(problem))?;
    let (searches, best) = (&data.searches, best_of(&data.searches));
    let data = &data.residuals;
    let model_parameters = data.model_parameters(&best.theta);
    if let Some(outside) = problem.outside() {
        monitor.stage(&format!("checking by {}", outside.title()));
    } else if problem.finite_elements().is_some() {
        monitor.stage("checking by full finite elements");
    }
    let reduced_m = model.forward().trajectory_m(&model_parameters)?;
    let full = full_run(problem, &reduced_m, &model_parameters)?;
    let summary = summarise(&model, data, &free, searches, best, (full, &reduced_m));
    let covariance = best.covariance.clone();
    Ok(FitResult { summary, model_parameters, covariance, model })
}

/// Tolerances of a search that only compares minima with each other.
const COARSE: Tolerances = Tolerances { objective: 1e-4, parameters: 1e-2, max_iterations: 12 };

/// Finds the best values of the sampled model parameters beside those in `held`, which are fixed at the given values. `start` has all model parameters. Returns them at the
/// minimum with the sum of squares (m²), to about a percent of a parameter's scale; `None` if the model cannot be evaluated at the start.
pub(crate) fn best_beside(
    prepared: &PreparedModel,
    held: &BTreeMap<usize, f64>,
    start: &[f64],
    rows: &FittedRows,
) -> Option<(Vec<f64>, f64)> {
    let fixed = &prepared.problem.specification.fixed;
    let is_free = |(j, spec): &(usize, &ParameterSpec)| !held.contains_key(j) && !fixed.contains_key(spec.name);
    let free: Vec<usize> =
        prepared.problem.model.parameters().iter().enumerate().filter(is_free).map(|(j, _)| j).collect();
    let residuals = CreepResiduals::new(prepared, &free, held, rows);
    let theta: Vec<f64> = residuals.free.iter().map(|(j, coordinate)| coordinate.theta(start[*j])).collect();
    let found = fit(&residuals, &theta, &COARSE).ok()?;
    Some((residuals.model_parameters(&found.theta), found.objective))
}

/// Residual function of one set of free parameters, with the result of the search from each start.
struct Searched<'a> {
    residuals: CreepResiduals<'a>,
    searches: Vec<Fit>,
}

/// Finds the best fit over the `free` parameters. Effects whose null (the value without the effect) is an end of the support are tried both free and fixed at the null,
/// in every combination. Without this, a search that reaches a bound stops before the other parameters are at their best values. A model could then fit worse than its
/// special case without the effect.
fn best_support<'a>(prepared: &'a PreparedModel, free: &[usize], rows: &FittedRows) -> Result<Searched<'a>> {
    let problem = &prepared.problem;
    let search = |held: &BTreeMap<usize, f64>| -> Result<Searched<'a>> {
        let left: Vec<usize> = free.iter().copied().filter(|j| !held.contains_key(j)).collect();
        let residuals = CreepResiduals::new(prepared, &left, held, rows);
        let from_everywhere = |rows: &FittedRows| -> Result<(Vec<Fit>, usize)> {
            let residuals = CreepResiduals::new(prepared, &left, held, rows);
            let mut searches = residuals.search(&residuals.starts(problem))?;
            searches.extend(
                residuals.search(&aside(prepared, (&left, held), rows, best_of(&searches))?).unwrap_or_default(),
            );
            Ok((searches, residuals.observed.len()))
        };
        let searches = if rows.observed.len() <= MOST_SEARCHED {
            from_everywhere(rows)?.0
        } else {
            let (few, n_few) = from_everywhere(&rows.thinned(MOST_SEARCHED))?;
            refine_minima(&residuals, &few, rows.observed.len() as f64 / n_few as f64)?
        };
        let in_order = |found: Fit| match residuals.reordered(problem, &found.theta) {
            Some(theta) => {
                let again = fit(&residuals, &theta, &Tolerances::default())?;
                Ok(Fit { iterations: found.iterations + again.iterations, ..again })
            }
            None => Ok(found),
        };
        let searches = searches.into_iter().map(in_order).collect::<Result<_>>()?;
        Ok(Searched { residuals, searches })
    };
    let effects = effects_with_null_at_end(problem, free);
    let mut best = search(&BTreeMap::new())?;
    for subset in 1..1_u32 << effects.len().min(MOST_HELD) {
        let is_held = |(bit, _): &(usize, &BTreeMap<usize, f64>)| subset >> bit & 1 == 1;
        let held: BTreeMap<usize, f64> =
            effects.iter().enumerate().filter(is_held).flat_map(|(_, e)| e.clone()).collect();
        if held.len() == free.len() {
            continue;
        }
        let found = search(&held)?;
        if best_of(&found.searches).objective <= (1.0 + SAME_MINIMUM) * best_of(&best.searches).objective {
            best = found;
        }
    }
    Ok(best)
}

/// Further starts of the search beside a minimum: one parameter of an effect is held at a multiple of its value there, while the others move to their best values. An effect
/// and a part of the law can exchange their roles, such as a lag and the gel's retardation; starts from the priors then may all lead to one of two minima.
fn aside(
    prepared: &PreparedModel,
    (free, held): (&[usize], &BTreeMap<usize, f64>),
    rows: &FittedRows,
    best: &Fit,
) -> Result<Vec<Vec<f64>>> {
    let problem = &prepared.problem;
    let all = CreepResiduals::new(prepared, free, held, rows);
    let parameters = all.model_parameters(&best.theta);
    let mut starts = Vec::new();
    for (place, &j) in free.iter().enumerate().filter(|(_, j)| **j >= problem.model.n_before_effects()) {
        let left: Vec<usize> = free.iter().copied().filter(|other| *other != j).collect();
        if left.is_empty() {
            continue;
        }
        for multiple in ASIDE {
            let value = (multiple * parameters[j]).clamp(all.ranges[j].lower, all.ranges[j].upper);
            if value == parameters[j] {
                continue;
            }
            let held = held.iter().map(|(j, value)| (*j, *value)).chain([(j, value)]).collect();
            let others = CreepResiduals::new(prepared, &left, &held, rows);
            let start: Vec<f64> =
                best.theta.iter().enumerate().filter(|(k, _)| *k != place).map(|(_, theta)| *theta).collect();
            let Ok(moved) = fit(&others, &start, &Tolerances::default()) else { continue };
            let mut theta = moved.theta;
            theta.insert(place, all.free[place].1.theta(value));
            starts.push(theta);
        }
    }
    Ok(starts)
}

/// Effects whose parameters are all free and whose null (the value without the effect) is an end of the support. Each entry maps the indices of an effect's parameters
/// to their null values. A parameter without a null has the median of its prior.
fn effects_with_null_at_end(problem: &Problem, free: &[usize]) -> Vec<BTreeMap<usize, f64>> {
    let (scales, mut first) = (problem.model.scales(), problem.model.n_before_effects());
    let mut list = Vec::new();
    for effect in problem.model.effects() {
        let effect_parameters = effect.parameters();
        let is_at_end = effect_parameters.first().is_some_and(|p| {
            (p.null)(scales).is_some_and(|null| null == p.spec.support.lower || null == p.spec.support.upper)
        });
        let off = |(i, p): (usize, &EffectParameter)| {
            (first + i, (p.null)(scales).unwrap_or_else(|| problem.range_of(p.spec.name, 0.5).lower))
        };
        let values: BTreeMap<usize, f64> = effect_parameters.iter().enumerate().map(off).collect();
        if is_at_end && values.keys().all(|j| free.contains(j)) {
            list.push(values);
        }
        first += effect_parameters.len();
    }
    list
}

/// Coordinate in which the search varies a parameter.
#[derive(Debug, Clone, Copy)]
enum Coordinate {
    /// Logarithm of the parameter, for positive parameters of the law.
    Logarithm,
    /// The parameter itself, in units of its prior's width `scale`.
    Linear { scale: f64 },
}

impl Coordinate {
    fn value(self, theta: f64) -> f64 {
        match self {
            Self::Logarithm => theta.exp(),
            Self::Linear { scale } => scale * theta,
        }
    }

    fn theta(self, value: f64) -> f64 {
        match self {
            Self::Logarithm => value.ln(),
            Self::Linear { scale } => value / scale,
        }
    }

    /// Derivative of the parameter's value by the coordinate.
    fn slope(self, value: f64) -> f64 {
        match self {
            Self::Logarithm => value,
            Self::Linear { scale } => scale,
        }
    }
}

/// Residuals of the fitted cycles, in m, as a function of the free coordinates.
struct CreepResiduals<'a> {
    forward: SurrogateForward<'a>,
    /// Values of all model parameters. Those of free parameters are replaced in each evaluation.
    template: Vec<f64>,
    /// Indices of the free parameters, and the search coordinate of each.
    free: Vec<(usize, Coordinate)>,
    /// Range of each model parameter in the search. Without a range, a long step could end where the data contain no information.
    ranges: Vec<TrainedRange>,
    /// Row index and measured value (m) of each fitted position.
    observed: Vec<(usize, f64)>,
}

impl<'a> CreepResiduals<'a> {
    fn new(prepared: &'a PreparedModel, free: &[usize], held: &BTreeMap<usize, f64>, rows: &FittedRows) -> Self {
        let problem = &prepared.problem;
        let (fixed, specs) = (&problem.specification.fixed, problem.model.parameters());
        let value = |(j, name): (usize, &str)| held.get(&j).or_else(|| fixed.get(name)).copied().unwrap_or(f64::NAN);
        let template = specs.iter().map(|p| p.name).enumerate().map(value).collect();
        let n_law = problem.model.base().parameters().len();
        let coordinate = |j: usize| {
            let is_scale = j < n_law && specs[j].support.upper.is_infinite();
            let spread = problem.range_of(specs[j].name, SPREAD_TAIL);
            (
                j,
                if is_scale {
                    Coordinate::Logarithm
                } else {
                    Coordinate::Linear { scale: spread.upper - spread.lower }
                },
            )
        };
        Self {
            forward: prepared.forward_over(rows.response()),
            template,
            free: free.iter().copied().map(coordinate).collect(),
            ranges: specs.iter().map(|p| range_of(prepared, p.name)).collect(),
            observed: rows.observed.clone(),
        }
    }

    /// Names of the parameters whose estimate lies at an end of its range, which is a bound and not a minimum.
    fn at_end_of_range(&self, theta: &[f64]) -> Vec<&str> {
        let is_at_end = |&(&(j, coordinate), theta): &(&(usize, Coordinate), &f64)| {
            let range = &self.ranges[j];
            let near = match coordinate {
                Coordinate::Logarithm => AT_END,
                Coordinate::Linear { .. } => AT_LINEAR_END,
            };
            [range.lower, range.upper].iter().any(|end| (theta - coordinate.theta(*end)).abs() < near)
        };
        self.free.iter().zip(theta).filter(is_at_end).map(|(&(j, _), _)| self.ranges[j].name.as_str()).collect()
    }

    fn model_parameters(&self, theta: &[f64]) -> Vec<f64> {
        let mut parameters = self.template.clone();
        for (&(j, coordinate), theta) in self.free.iter().zip(theta) {
            // The exponential of a bound's logarithm can lie slightly beyond the bound, because of rounding.
            parameters[j] = coordinate.value(*theta).max(self.ranges[j].lower).min(self.ranges[j].upper);
        }
        parameters
    }

    /// Search coordinates after interchangeable elements of the law are sorted into the order of the posterior's draws; `None` if they are already in order.
    fn reordered(&self, problem: &Problem, theta: &[f64]) -> Option<Vec<f64>> {
        let mut parameters = self.model_parameters(theta);
        let specs = problem.model.parameters();
        let place = |name: &str| specs.iter().position(|spec| spec.name == name);
        // The fit does not estimate noise parameters. They are not interchangeable, so 0 serves as their value.
        let natural: Vec<f64> = problem.priors.names().map(|name| place(name).map_or(0.0, |j| parameters[j])).collect();
        let ordered = problem.priors.ordered(natural.clone());
        if ordered == natural {
            return None;
        }
        for (name, value) in problem.priors.names().zip(ordered) {
            if let Some(j) = place(name) {
                parameters[j] = value;
            }
        }
        Some(self.free.iter().map(|&(j, coordinate)| coordinate.theta(parameters[j])).collect())
    }

    /// Starts of the search, in search coordinates: the priors' medians, then Sobol points of the priors' quantiles.
    fn starts(&self, problem: &Problem) -> Vec<Vec<f64>> {
        let quantile = |(j, coordinate): (usize, Coordinate), probability: f64| {
            let name = problem.model.parameters()[j].name;
            let value = problem.starts_of(name).map_or(1.0, |distribution| distribution.quantile(probability));
            coordinate.theta(value)
        };
        let medians = self.free.iter().map(|&free| quantile(free, 0.5)).collect();
        let sobol = |index: u32| {
            let coordinate = |d: u32| f64::from(sobol_burley::sample(index, d, START_SEED));
            let inside = |d: u32| START_TAIL + (1.0 - 2.0 * START_TAIL) * coordinate(d);
            self.free.iter().zip(0_u32..).map(|(&free, d)| quantile(free, inside(d))).collect()
        };
        std::iter::once(medians).chain((0..N_QUANTILE_STARTS).map(sobol)).collect()
    }

    /// Derivative (m) of the trajectory by a search coordinate, by a finite difference if there is no closed form.
    fn column_m(&self, parameters: &[f64], (j, coordinate): (usize, Coordinate)) -> Option<Vec<f64>> {
        let slope = coordinate.slope(parameters[j]);
        if let Ok(column) = self.forward.derivative_m(parameters, j) {
            return Some(column.iter().map(|x| slope * x).collect());
        }
        let is_at_upper_end = !self.ranges[j].contains(parameters[j] + FINITE_STEP * slope);
        let step = if is_at_upper_end { -FINITE_STEP } else { FINITE_STEP };
        let mut stepped = parameters.to_vec();
        stepped[j] += step * slope;
        let (here, there) = (self.forward.trajectory_m(parameters).ok()?, self.forward.trajectory_m(&stepped).ok()?);
        Some(here.iter().zip(&there).map(|(a, b)| (b - a) / step).collect())
    }

    /// Derivatives (m) of the position at every row by the free parameters' search coordinates, one column per coordinate. Coordinates without a derivative have no
    /// column. The result is empty for records that are too long for the memory.
    fn columns_m(&self, prepared: &PreparedModel, theta: &[f64]) -> Vec<Vec<f64>> {
        if prepared.problem.experiment.record.n_rows() > MOST_ROWS_OF_COLUMNS {
            return Vec::new();
        }
        let whole = CreepResiduals {
            forward: prepared.forward(),
            template: self.template.clone(),
            free: self.free.clone(),
            ranges: self.ranges.clone(),
            observed: Vec::new(),
        };
        let parameters = self.model_parameters(theta);
        self.free.iter().filter_map(|&free| whole.column_m(&parameters, free)).collect()
    }

    /// Searches from every start and returns the results. Starts at which the model cannot be evaluated are skipped. If every start is skipped, the first error is
    /// returned.
    fn search(&self, starts: &[Vec<f64>]) -> Result<Vec<Fit>> {
        let tolerances = Tolerances::default();
        let found: Vec<Result<Fit>> = starts.par_iter().map(|start| fit(self, start, &tolerances)).collect();
        let (mut fits, mut refusal) = (Vec::new(), None);
        for search in found {
            match search {
                Ok(fit) => fits.push(fit),
                Err(error) => refusal = refusal.or(Some(error)),
            }
        }
        match refusal {
            Some(error) if fits.is_empty() => Err(error),
            _ => Ok(fits),
        }
    }
}

impl LeastSquaresProblem for CreepResiduals<'_> {
    fn residuals(&self, theta: &[f64]) -> Option<DVector<f64>> {
        let parameters = self.model_parameters(theta);
        let position_m = self.forward.trajectory_m(&parameters).ok()?;
        Some(DVector::from_iterator(self.observed.len(), self.observed.iter().map(|&(row, y)| position_m[row] - y)))
    }

    fn jacobian(&self, theta: &[f64]) -> Option<DMatrix<f64>> {
        let parameters = self.model_parameters(theta);
        let columns: Option<Vec<Vec<f64>>> = self.free.iter().map(|&free| self.column_m(&parameters, free)).collect();
        let columns = columns?;
        Some(DMatrix::from_fn(self.observed.len(), self.free.len(), |i, k| columns[k][self.observed[i].0]))
    }

    fn bounds(&self, coordinate: usize) -> (f64, f64) {
        let (j, coordinate) = self.free[coordinate];
        (coordinate.theta(self.ranges[j].lower), coordinate.theta(self.ranges[j].upper))
    }
}

/// Search with the lowest objective. If several searches have found this minimum, a converged search is preferred.
fn best_of(searches: &[Fit]) -> &Fit {
    let lower = |a: &Fit, b: &Fit| {
        if is_same_minimum(a, b) && a.converged != b.converged { a.converged } else { a.objective < b.objective }
    };
    searches.iter().fold(&searches[0], |best, next| if lower(next, best) { next } else { best })
}

/// Search range of a parameter: the range of its prior, or the range in which the surrogate of an external program was trained.
fn range_of(prepared: &PreparedModel, name: &str) -> TrainedRange {
    let problem = &prepared.problem;
    let learnt = prepared.trained.iter().find(|range| range.name == name && problem.outside().is_some());
    learnt.cloned().unwrap_or_else(|| problem.range_of(name, TAIL_MASS))
}

/// Results of one full-order run of the whole record with the estimated parameters.
struct FullRun {
    /// Largest distance between the reduced and the full-order trajectory, in m.
    distance_m: f64,
    /// Largest displacement error due to the mesh, in m; `None` if unknown.
    discretisation_m: Option<f64>,
    /// Largest absolute principal strain at the largest displacement; `None` if the model itself has large strains.
    largest_strain: Option<f64>,
}

/// Runs the full-order model once; `None` without finite elements.
fn full_run(problem: &Problem, reduced_m: &[f64], model_parameters: &[f64]) -> Result<Option<FullRun>> {
    let distance_m = |full_m: &[f64]| full_m.iter().zip(reduced_m).fold(0.0, |d: f64, (x, y)| d.max((x - y).abs()));
    if let Some(outside) = problem.outside_forward() {
        let distance_m = distance_m(&outside.trajectory_m(model_parameters)?);
        return Ok(Some(FullRun { distance_m, discretisation_m: None, largest_strain: None }));
    }
    let Some(full) = problem.full_forward()? else { return Ok(None) };
    let extreme = reduced_m.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).map_or(0, |(row, _)| row);
    let run = full.run(model_parameters, &[extreme])?;
    let largest_strain = largest_strain(problem, &run)?;
    let full_m = run.position_m;
    let distance_m = distance_m(&full_m);
    let amplitude_m = full_m.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    let comparison = problem.finite_elements().and_then(|fe| fe.comparison);
    let relative = comparison.map(|other| other.relative_error(full.compliance_per_m()).abs());
    let discretisation_m = relative.map(|error| error * amplitude_m);
    Ok(Some(FullRun { distance_m, discretisation_m, largest_strain }))
}

fn summarise(
    prepared: &PreparedModel,
    data: &CreepResiduals,
    free: &[usize],
    searches: &[Fit],
    best: &Fit,
    (full, reduced_m): (Option<FullRun>, &[f64]),
) -> FitSummary {
    let (problem, n) = (&prepared.problem, data.observed.len());
    let heldout_m = problem.positions_of(&problem.experiment.heldout_cycles);
    let estimate = |&j: &usize| {
        let name = problem.model.parameters()[j].name.to_string();
        let Some((k, &(_, coordinate))) = data.free.iter().enumerate().find(|(_, (index, _))| *index == j) else {
            return FittedParameter { name, value: data.template[j], standard_error: None };
        };
        let value = coordinate.value(best.theta[k]);
        // The delta method converts the standard error from the search coordinate to the parameter.
        let error = coordinate.slope(value) * best.standard_errors[k];
        let standard_error = Some(error).filter(|error| error.is_finite());
        FittedParameter { name, value, standard_error }
    };
    let at_null: Vec<&str> = free
        .iter()
        .filter(|j| data.free.iter().all(|(index, _)| index != *j))
        .map(|&j| problem.model.parameters()[j].name)
        .collect();
    let yardstick = problem.experiment.reference_noise();
    let specification = &problem.specification;
    let mut summary = FitSummary {
        experiment: problem.experiment.specimen_id.clone(),
        model: specification.summary(),
        fixed: specification.fixed.clone(),
        parameters: free.iter().map(estimate).collect(),
        objective_m2: best.objective,
        rmse_um: 1e6 * (best.objective / n as f64).sqrt(),
        rmse_heldout_um: heldout_m.iter().any(Option::is_some).then(|| 1e6 * rmse_m(reduced_m, &heldout_m)),
        fitted_positions: n,
        noise_um: yardstick.map(|y| 1e6 * y.sd_m),
        iterations: best.iterations,
        converged: best.converged,
        starts: searches.len(),
        starts_agreeing: searches
            .iter()
            .filter(|search| is_same_minimum(search, best) && !is_apart(search, best))
            .count(),
        surrogate_vs_fe_max_um: full.as_ref().map(|full| 1e6 * full.distance_m),
        fe_discretisation_um: full.as_ref().and_then(|full| full.discretisation_m).map(|x| 1e6 * x),
        trust: Trust::default(),
        warnings: Vec::new(),
    };
    let columns_m = data.columns_m(prepared, &best.theta);
    let noise_um = [summary.rmse_um];
    let prediction = Prediction {
        position_m: reduced_m,
        columns_m: &columns_m,
        noise: (NoiseModel::default(), &noise_um),
        learnt_noise_m: None,
        joint_p: None,
    };
    let judgement = Judgement::of(problem, &prediction, yardstick);
    let at_end = data.at_end_of_range(&best.theta);
    summary.converged &= at_end.is_empty();
    let offset = summary.parameters.iter().find(|parameter| parameter.name == POSITION_OFFSET);
    let impossible = impossible_positions_warning(&problem.experiment, offset.map(|offset| offset.value));
    let other = other_minimum(problem, data, searches, best);
    summary.warnings = warnings(&summary, &judgement, (&at_end, &at_null), [impossible, other]);
    summary.warnings.extend(problem.experiment.largest_strain.and_then(recorded_strain_warning));
    summary.warnings.extend(full.and_then(|full| full.largest_strain).and_then(strain_warning));
    summary.warnings.extend(problem.finite_elements().into_iter().flat_map(|fe| fe.mesh_warnings.clone()));
    summary.trust = trust(&summary.warnings);
    summary
}

/// Effects whose first parameter lies within three standard errors of its null.
fn absent_effects(problem: &Problem, data: &CreepResiduals, fit: &Fit) -> Vec<&'static str> {
    let (scales, mut first, mut list) = (problem.model.scales(), problem.model.n_before_effects(), Vec::new());
    for effect in problem.model.effects() {
        if let Some(k) = data.free.iter().position(|(j, _)| *j == first)
            && let Some(null) = effect.parameters().first().and_then(|parameter| (parameter.null)(scales))
        {
            let distance = (fit.theta[k] - data.free[k].1.theta(null)).abs();
            // The data do not determine an effect at its null, which then has no standard error.
            let is_present = distance > 3.0 * fit.standard_errors[k];
            if !is_present {
                list.push(effect.slug());
            }
        }
        first += effect.parameters().len();
    }
    list
}

/// True if a coordinate of two minima differs by far more than its standard error.
fn is_apart(other: &Fit, best: &Fit) -> bool {
    let coordinates = best.theta.iter().zip(&other.theta).zip(&best.standard_errors);
    coordinates.map(|((a, b), error)| (a - b).abs() / error).any(|distance| distance > APART && distance.is_finite())
}

/// Warning about a minimum elsewhere that the fitted positions cannot exclude; `None` if there is none.
fn other_minimum(problem: &Problem, data: &CreepResiduals, searches: &[Fit], best: &Fit) -> Option<Warning> {
    // Searches of longer records end on a selection of the positions.
    if data.observed.len() > MOST_SEARCHED {
        return None;
    }
    let variance_m2 = best.objective / data.observed.len() as f64;
    let is_as_good = |other: &&Fit| other.converged && other.objective - best.objective < AS_GOOD * variance_m2;
    // Without its effect, a parameter has no meaning.
    let is_absent = |fit: &Fit| absent_effects(problem, data, fit);
    let differs =
        |other: &&Fit| is_apart(other, best) && (is_absent(other).is_empty() || is_absent(other) != is_absent(best));
    let candidates = searches.iter().filter(is_as_good).filter(differs);
    let other = candidates.min_by(|a, b| a.objective.total_cmp(&b.objective))?;
    let parameters = data.model_parameters(&other.theta);
    let specs = problem.model.parameters();
    let listed: Vec<String> = data
        .free
        .iter()
        .map(|(j, _)| format!("{} = {}", specs[*j].name, format_significant(parameters[*j], 3)))
        .collect();
    Some(Warning {
        kind: WarningKind::Undetermined,
        text: format!("other parameters fit as well, within noise: {}", listed.join(", ")),
        advice:
            "fix a parameter that you know (--set), or sample the posterior, which weighs both (`vitreo-uq sample`)"
                .into(),
    })
}

fn warnings(
    summary: &FitSummary,
    judgement: &Judgement,
    (at_end, at_null): (&[&str], &[&str]),
    [impossible_positions, other_minimum]: [Option<Warning>; 2],
) -> Vec<Warning> {
    let units_first = !at_end.is_empty() || impossible_positions.is_some();
    let mut list: Vec<Warning> = impossible_positions.into_iter().collect();
    if !at_null.is_empty() {
        list.push(Warning {
            kind: WarningKind::AtNull,
            text: format!(
                "the best fit has {} at the null: the fitted cycles do not support the effect",
                at_null.join(", ")
            ),
            advice: "leave the effect out, or sample its posterior (`sample --with`, `extend --with`)".into(),
        });
    }
    if !at_end.is_empty() {
        list.push(Warning {
            kind: WarningKind::NotConverged,
            text: format!("the search stopped at an end of the range that the prior allows for {}", at_end.join(", ")),
            advice:
                "check the units of force and position first; the data may not determine the parameter: fix it (--set), or give a wider prior (--prior)"
                    .into(),
        });
    } else if !summary.converged {
        list.push(Warning {
            kind: WarningKind::NotConverged,
            text: format!("the search did not converge in {} steps", summary.iterations),
            advice: "the data may not determine every parameter: check the standard errors, or fix a parameter (--set)"
                .into(),
        });
    }
    let undetermined: Vec<&str> = summary
        .parameters
        .iter()
        .filter(|p| p.standard_error.is_none())
        .map(|p| p.name.as_str())
        .filter(|name| !at_null.contains(name))
        .collect();
    list.extend(other_minimum);
    if !undetermined.is_empty() {
        list.push(Warning {
            kind: WarningKind::Undetermined,
            text: format!("the fitted cycles do not determine all of {}", undetermined.join(", ")),
            advice: "fix one of them (--set), or fit cycles in which the force is switched and held longer".into(),
        });
    }
    list.extend(judgement.warnings());
    if summary.rmse_heldout_um.is_none() {
        list.push(nothing_held_out_warning());
    }
    if let Some(noise_um) = summary.noise_um {
        let distance_um = summary.surrogate_vs_fe_max_um.unwrap_or(0.0);
        list.extend(surrogate_warning(distance_um, None, noise_um, &summary.model));
        if summary.surrogate_vs_fe_max_um.is_some() && !summary.model.is_external() {
            list.extend(mesh_warning(summary.fe_discretisation_um, noise_um, units_first));
        }
    }
    list
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
