//! Model of large displacements, learnt for the record of one experiment and cached. The effect `large-displacement` uses it instead of a reduced model of the gel.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::cache::{self, ModelInputs};
use super::problem::Problem;
use crate::monitor::{Counter, Monitor};
use crate::study::ModelSpecification;
use base::error::{Error, Result};
use base::number::Dual;
use elements::fe::oldroyd::{Discretisation, FiniteGel, FiniteInput, FiniteLaw};
use laws::rheology::Element;
use laws::stages::{SharedStepper, Stages};
use models::effects::{Library, MOBILITY};
use models::model::{Compliance, Forward, Response, SurrogateForward};
use models::surrogate::trajectory::{LargeScope, LargeStepper, LargeSurface, MobilityRange};
use record::Record;
use sampling::least_squares::{LeastSquaresProblem, Tolerances, fit};

/// Largest number of force changes in a full run for large displacements. Each change costs a fraction of a second. A force that is linear between rows changes at
/// every row.
pub(crate) const MOST_SWITCHES: usize = 64;
/// Number of starts at quantiles of the prior, besides the start at its medians.
const N_STARTS: u32 = 7;
/// Seed of the scrambled Sobol sequence of starts. It is fixed, because the starts are part of the method.
const START_SEED: u32 = 7;
/// Probability of the smallest prior quantile among the starts. The largest quantile has one minus this probability.
const START_TAIL: f64 = 0.1;

/// Number of rows at which a force (N, one value per row) differs from the previous row.
pub(crate) fn n_switches(force_n: &[f64]) -> usize {
    force_n.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

fn refuse_many_switches(record: &Record) -> Result<()> {
    let n = n_switches(&record.force_n);
    if n <= MOST_SWITCHES {
        return Ok(());
    }
    Err(Error::numerical(
        format!("the force changes {n} times, but large displacements can be run for at most {MOST_SWITCHES} changes"),
        "leave `large-displacement` out, or hold the force for longer",
    ))
}

/// Trains a surrogate of large displacements for the problem's record, around the law's parameters `law` (SI, in the order of the base law). Returns a stepper, which
/// evaluates the surrogate, and its largest error relative to the displacement. Set `with_load` if effects can change the commanded force.
///
/// # Errors
/// [`Error::Numerical`] if there is no sphere at the centre, and errors of [`LargeSurface::learn`].
pub fn learn_displacements(
    problem: &Problem,
    law: &[f64],
    with_load: bool,
    monitor: &dyn Monitor,
) -> Result<(SharedStepper, f64)> {
    let (_, surface) = surface(problem, law, with_load, monitor)?;
    let (record, error) = (&problem.experiment.record, surface.certified());
    let stepper = LargeStepper::new(surface, &record.time_s, record.force())?;
    Ok((SharedStepper(Arc::new(stepper)), error))
}

/// Reads the surrogate of large displacements from the cache, or trains it. Returns it with its inputs, which identify it in the cache. [`learn_displacements`] creates
/// its stepper from it.
///
/// # Errors
/// Errors of [`learn_displacements`].
pub fn surface(
    problem: &Problem,
    law: &[f64],
    with_load: bool,
    monitor: &dyn Monitor,
) -> Result<(ModelInputs, LargeSurface)> {
    let Some(ball) = problem.finite_elements().and_then(|fe| fe.sizes.ball) else { return Err(no_sphere()) };
    let elements = problem.model.base().elements(&law.iter().copied().map(Dual::constant).collect::<Vec<Dual>>());
    let record = &problem.experiment.record;
    refuse_many_switches(record)?;
    let radii_m = [ball.robot_radius_m, ball.outer_radius_m];
    // If the mobility is neither fixed nor free, it has its null value, which belongs to an Oldroyd-B fluid.
    let is_free = problem.specification.freed.iter().any(|name| name == MOBILITY);
    let mobilities = match problem.specification.fixed.get(MOBILITY) {
        Some(mobility) => MobilityRange::Held(*mobility),
        None if is_free => MobilityRange::Free,
        None => MobilityRange::OLDROYD_B,
    };
    // A surrogate that was trained for changed loads also serves models whose load is the commanded force.
    let scopes = [true, false].map(|with_load| LargeScope { mobilities, with_load });
    let suited = scopes.into_iter().filter(|scope| scope.with_load || !with_load);
    let input_of = |scope| built_from(radii_m, (&elements, scope), record);
    for scope in suited {
        let input = input_of(scope)?;
        if let Some(kept) = cache::read::<LargeSurface>(&input, monitor) {
            return Ok((input, kept));
        }
    }
    monitor.stage("learning large displacements from full runs of this record");
    let scope = LargeScope { mobilities, with_load };
    let counter = Counter::new(monitor, LargeSurface::n_runs(&elements, scope));
    let done = || counter.add_one();
    let learnt = LargeSurface::learn(radii_m, (&elements, scope), &record.time_s, record.force(), &done)?;
    let input = input_of(scope)?;
    cache::write(&input, &learnt);
    Ok((input, learnt))
}

/// Additional displacement of the robot (m, at every row) due to large strains, for a gel with the law's parameters `law`. The computation is one full run and takes a
/// few seconds.
///
/// # Errors
/// [`Error::Numerical`] if there is no sphere at the centre, the law has a springpot, or the robot moves too far for the run.
pub fn deviation_m(problem: &Problem, law: &[f64]) -> Result<Vec<f64>> {
    let Some(ball) = problem.finite_elements().and_then(|fe| fe.sizes.ball) else { return Err(no_sphere()) };
    let elements = problem.model.base().elements(&law.iter().copied().map(Dual::constant).collect::<Vec<Dual>>());
    refuse_many_switches(&problem.experiment.record)?;
    let mobility = 0.0;
    let law = FiniteLaw::new(&elements, mobility).ok_or_else(|| {
        Error::numerical("large displacements cannot be run for springpots", "leave `large-displacement` out")
    })?;
    let gel = FiniteGel::around_sphere(ball.robot_radius_m, ball.outer_radius_m, Discretisation::ESTIMATE)?;
    let (record, load) = (&problem.experiment.record, Stages::of_law(Vec::new()).load);
    let what = FiniteInput { law: &law, load: &load, time_s: &record.time_s, force: record.force() };
    Ok(gel.run(&what)?.deviation_m)
}

fn no_sphere() -> Error {
    Error::numerical("large displacements need a sphere at the centre of the gel", "leave `large-displacement` out")
}

fn built_from(radii_m: [f64; 2], (law, scope): (&[Element], LargeScope), record: &Record) -> Result<ModelInputs> {
    Ok(ModelInputs::new("large displacements")
        .with("radii_m", radii_m)
        .with("law", LargeSurface::place(law, scope)?)
        .with("scope", scope)
        .with_record(&record.time_s, record.force()))
}

/// Best-fit parameters of the base law for the fitted cycles, with small strains and without effects. Fixed parameters keep their values.
///
/// # Errors
/// [`Error::Input`] if the base law alone does not suit the experiment; [`Error::Numerical`] if it cannot be computed at any start.
pub fn fit_base_law(problem: &Problem, compliance: &Compliance) -> Result<Vec<f64>> {
    let specification = ModelSpecification { effects: Vec::new(), ..problem.specification.clone() };
    let base = problem.with_model(specification, &Library::default())?;
    let record = &base.experiment.record;
    let observed = base.positions_of(&base.experiment.calibration_cycles);
    let observed: Vec<(usize, f64)> = observed.iter().enumerate().filter_map(|(row, y)| Some((row, (*y)?))).collect();
    let n_law = base.model.base().parameters().len();
    let names: Vec<&str> = base.model.parameters().iter().map(|p| p.name).collect();
    let fixed = &base.specification.fixed;
    let template: Vec<f64> = names.iter().map(|name| fixed.get(*name).copied().unwrap_or(f64::NAN)).collect();
    let free: Vec<usize> = (0..names.len()).filter(|k| template[*k].is_nan()).collect();
    if free.iter().all(|k| *k >= n_law) {
        return Ok(template[..n_law].to_vec());
    }
    let response = Response::new(&record.time_s, record.force(), record.n_rows());
    let forward = SurrogateForward { model: &base.model, compliance: compliance.clone(), response, trained: &[] };
    let scale_m = base.experiment.scales().position_range_m;
    let residuals = BaseResiduals { forward, template, free: &free, n_law, scale_m, observed };
    let start = |quantile: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let of = |(place, k): (usize, &usize)| match base.priors.get(names[*k]) {
            Some(prior) if *k < n_law => prior.distribution.quantile(quantile(place)).ln(),
            _ => 0.0,
        };
        free.iter().enumerate().map(of).collect()
    };
    let sobol = |index: u32| {
        let coordinate = |place: usize| f64::from(sobol_burley::sample(index, place as u32, START_SEED));
        start(&|place| START_TAIL + (1.0 - 2.0 * START_TAIL) * coordinate(place))
    };
    let starts: Vec<Vec<f64>> = std::iter::once(start(&|_| 0.5)).chain((0..N_STARTS).map(sobol)).collect();
    let tolerances = Tolerances::default();
    let fits: Vec<Result<_>> = starts.par_iter().map(|start| fit(&residuals, start, &tolerances)).collect();
    let (mut best, mut refusal) = (None, None);
    for found in fits {
        match found {
            Ok(fit) if best.as_ref().is_none_or(|(objective, _)| fit.objective < *objective) => {
                best = Some((fit.objective, fit.theta));
            }
            Ok(_) => {}
            Err(error) => refusal = refusal.or(Some(error)),
        }
    }
    match (best, refusal) {
        (Some((_, theta)), _) => Ok(residuals.parameters(&theta)[..n_law].to_vec()),
        (None, Some(error)) => Err(error),
        (None, None) => Err(Error::numerical("the fit of the base law has no start", "give fitted positions")),
    }
}

/// Residuals (m) of the base law as a function of the search coordinates. These are logarithms of the law's parameters, and an offset in units of the positions' range.
struct BaseResiduals<'a> {
    forward: SurrogateForward<'a>,
    template: Vec<f64>,
    free: &'a [usize],
    n_law: usize,
    scale_m: f64,
    observed: Vec<(usize, f64)>,
}

impl BaseResiduals<'_> {
    fn parameters(&self, theta: &[f64]) -> Vec<f64> {
        let mut parameters = self.template.clone();
        for (k, theta) in self.free.iter().zip(theta) {
            parameters[*k] = if *k < self.n_law { theta.exp() } else { self.scale_m * theta };
        }
        parameters
    }
}

impl LeastSquaresProblem for BaseResiduals<'_> {
    fn residuals(&self, theta: &[f64]) -> Option<DVector<f64>> {
        let position_m = self.forward.trajectory_m(&self.parameters(theta)).ok()?;
        Some(DVector::from_iterator(self.observed.len(), self.observed.iter().map(|(row, y)| position_m[*row] - y)))
    }

    fn jacobian(&self, theta: &[f64]) -> Option<DMatrix<f64>> {
        let parameters = self.parameters(theta);
        let column = |k: &usize| {
            let slope = if *k < self.n_law { parameters[*k] } else { self.scale_m };
            let column = self.forward.derivative_m(&parameters, *k).ok()?;
            Some(column.into_iter().map(|x| slope * x).collect::<Vec<f64>>())
        };
        let columns: Vec<Vec<f64>> = self.free.iter().map(column).collect::<Option<_>>()?;
        Some(DMatrix::from_fn(self.observed.len(), columns.len(), |i, k| columns[k][self.observed[i].0]))
    }
}
