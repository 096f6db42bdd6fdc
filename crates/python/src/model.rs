//! Python class `ReducedModel`: evaluates the trajectory and posterior that the command `serve` offers, for arrays of points.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use numpy::{IntoPyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use self_cell::self_cell;
use vitreo_uq::base::error::{Error, Result};
use vitreo_uq::jobs::bridge::{BridgeInput, BridgeModels};
use vitreo_uq::jobs::first_revision::{kept_surrogate, with_fitted_cycles_of};
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::check;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::prepared::PreparedModel;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::study::{ModelSpecification, Study};
use vitreo_uq::record::{self, Interpretation};

use crate::errors::{at_point, raised, refused};
use crate::experiment::Experiment;

/// Number of points between two checks for Ctrl-C.
const BLOCK: usize = 256;
/// Number of points that a thread evaluates in one call: a multiple of the eight numbers in a vector register.
const PIECE: usize = 16;
/// Time between two checks for Ctrl-C while a model is built.
const LOOK: Duration = Duration::from_millis(50);

// `BridgeModels` borrows from `PreparedModel`, so one struct owns both.
self_cell!(
    struct OwnedModels {
        owner: PreparedModel,
        #[not_covariant]
        dependent: BridgeModels,
    }
);

/// Monitor that collects warnings for Python, and stops the computation when Python is interrupted.
#[derive(Default)]
struct PythonMonitor {
    warnings: Mutex<Vec<String>>,
    stop: AtomicBool,
}

impl Monitor for PythonMonitor {
    fn warn(&self, text: &str) {
        if let Ok(mut warnings) = self.warnings.lock() {
            warnings.push(text.to_string());
        }
    }
    fn stop(&self) -> Option<&AtomicBool> {
        Some(&self.stop)
    }
}

/// Argument `target` of `ReducedModel`: an `Experiment`, or the path of an experiment or study.
#[derive(FromPyObject)]
enum Target<'py> {
    Experiment(Bound<'py, Experiment>),
    Path(PathBuf),
}

/// Experiment that the argument `target` gives, with its study if there is one.
struct TargetInput {
    experiment: record::Experiment,
    understood: Interpretation,
    study: Option<Study>,
}

impl TargetInput {
    fn of(target: &Target<'_>) -> Result<Self> {
        Ok(match target {
            Target::Experiment(bound) => {
                let Experiment { experiment, understood, .. } = bound.get();
                Self { experiment: experiment.clone(), understood: understood.clone(), study: None }
            }
            Target::Path(path) => {
                let study = if Study::is_study(path) { Some(Study::open(path)?) } else { None };
                let read = |study: &Study| study.read_experiment();
                let (experiment, files) = study.as_ref().map_or_else(|| record::Experiment::read(path), read)?;
                Self { experiment, understood: files.interpretation, study }
            }
        })
    }

    /// Returns the revision `named`. Without a name, returns the last revision of the study, if there is a study.
    fn revision(&self, named: Option<String>) -> Result<Option<String>> {
        match (named, &self.study) {
            (None, Some(study)) => Ok(study.revisions()?.pop()),
            (named, _) => Ok(named),
        }
    }

    /// Returns the model of the given revision; the default model if there is no study or no revision.
    fn specification(&self, revision: Option<&str>) -> Result<ModelSpecification> {
        match (&self.study, revision) {
            (Some(study), Some(name)) => {
                ModelSpecification::of_revision(&study.revision_dir(name)?, &Library::default())
            }
            _ => Ok(ModelSpecification::default()),
        }
    }
}

/// Arguments of `ReducedModel`, in the form of the program's options.
struct Asked {
    base: Option<String>,
    effects: Vec<String>,
    noise: Vec<String>,
    prior: Option<String>,
    set: Vec<String>,
    revision: Option<String>,
}

fn built(subject: TargetInput, asked: Asked, watcher: &PythonMonitor) -> Result<OwnedModels> {
    check::refuse_contradictions(&subject.experiment, &subject.understood, watcher)?;
    let Asked { base, effects, noise, prior, set, revision } = asked;
    let revision = subject.revision(revision)?;
    let start = subject.specification(revision.as_deref())?;
    let specification = start.with_options(base.as_deref(), &effects, &noise, prior.as_deref(), &set)?;
    let kept = subject.study.as_ref().and_then(|study| kept_surrogate(study, watcher));
    let experiment = with_fitted_cycles_of(subject.experiment, revision.as_deref());
    let problem = Problem::new(experiment, specification, None, watcher)?;
    OwnedModels::try_new(PreparedModel::new(&problem, kept, watcher)?, |model| BridgeModels::new(model))
}

/// Reduced model of an experiment or of a study's revision: trajectories, log-densities and their gradients at arrays of points, on all cores.
///
/// Parameters have the order and units of the JSON documents: first the parameters of the model, then those of the noise. Fixed parameters are omitted.
#[pyclass(frozen, module = "vitreo_uq")]
pub struct ReducedModel {
    owned: OwnedModels,
    max_relative_error: Option<f64>,
}

#[pymethods]
impl ReducedModel {
    #[new]
    #[pyo3(signature = (target, *, base=None, effects=Vec::new(), noise=Vec::new(), prior=None, fixed=BTreeMap::new(), revision=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn new(
        py: Python<'_>,
        target: Target<'_>,
        base: Option<String>,
        effects: Vec<String>,
        noise: Vec<String>,
        prior: Option<PathBuf>,
        fixed: BTreeMap<String, Option<f64>>,
        revision: Option<String>,
    ) -> PyResult<Self> {
        let assigned = |(name, value): (String, Option<f64>)| match value {
            // This format writes enough digits to restore the exact number.
            Some(value) => format!("{name}={value:?}"),
            None => format!("{name}=free"),
        };
        let set = fixed.into_iter().map(assigned).collect();
        let prior = prior.map(|path| path.display().to_string());
        let asked = Asked { base, effects, noise, prior, set, revision };
        let subject = TargetInput::of(&target).map_err(raised)?;
        if subject.study.is_none() && asked.revision.is_some() {
            return Err(refused("revision", "an experiment has no revisions", "leave it out, or give a study"));
        }
        let watcher = PythonMonitor::default();
        let owned = std::thread::scope(|scope| {
            let work = scope.spawn(|| built(subject, asked, &watcher));
            while !work.is_finished() {
                py.detach(|| std::thread::sleep(LOOK));
                if let Err(interrupt) = py.check_signals() {
                    watcher.stop.store(true, Ordering::Relaxed);
                    let _ = py.detach(|| work.join());
                    return Err(interrupt);
                }
            }
            work.join().map_err(|_| raised(broken()))?.map_err(raised)
        })?;
        for warning in watcher.warnings.into_inner().unwrap_or_default() {
            let text = std::ffi::CString::new(warning).unwrap_or_default();
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
        }
        let max_relative_error = owned.borrow_owner().max_relative_error;
        Ok(Self { owned, max_relative_error })
    }

    /// The sampled parameters, in order: dictionaries with `name`, `unit`, `prior` (in words), `lower` and `upper`. The density is 0 outside `lower` to `upper`.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let inputs = self.with_models(|models| models.inputs());
        let shown = |BridgeInput { prior, ends }: &BridgeInput| {
            let dictionary = PyDict::new(py);
            dictionary.set_item("name", &prior.name)?;
            dictionary.set_item("unit", &prior.unit)?;
            dictionary.set_item("prior", prior.distribution.to_string())?;
            dictionary.set_item("lower", ends.0)?;
            dictionary.set_item("upper", ends.1)?;
            Ok(dictionary)
        };
        inputs.iter().map(shown).collect()
    }

    /// Names of the sampled parameters, in order.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.with_models(|models| models.inputs()).into_iter().map(|input| input.prior.name).collect()
    }

    /// Medians of the priors, shape (parameters,). They lie inside the parameters' ranges, so they can serve as a start point.
    #[getter]
    fn prior_median<'py>(&self, py: Python<'py>) -> Bound<'py, numpy::PyArray1<f64>> {
        let inputs = self.with_models(|models| models.inputs());
        inputs.iter().map(|input| input.prior.distribution.quantile(0.5)).collect::<Vec<f64>>().into_pyarray(py)
    }

    /// Number of parameters that `trajectory` takes: the first names in `names`, without the parameters of the noise.
    #[getter]
    fn n_trajectory_parameters(&self) -> usize {
        self.with_models(|models| models.n_trajectory_inputs())
    }

    /// Largest distance from full finite elements, relative to the amplitude, on runs that did not train the model; None for an instrument.
    #[getter]
    fn max_relative_error(&self) -> Option<f64> {
        self.max_relative_error
    }

    /// Positions in µm at the rows of the record. Points of shape (n, d) give (n, rows), one point of shape (d,) gives (rows,). `d` is the number of model
    /// parameters, without those of the noise. Raises `InputError` if a point lies outside a parameter's range.
    fn trajectory<'py>(&self, py: Python<'py>, points: PointArray<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let n_rows = self.with_models(|models| models.n_rows());
        let points = points.of_length(self.n_trajectory_parameters())?;
        let values = self.of_each(py, &points, |models, pieces| {
            pieces.chunks_exact(points.length).map(|point| models.trajectory().reduced_um(point)).collect()
        })?;
        points.shaped(py, values.concat(), Some(n_rows))
    }

    /// ln(prior × likelihood) of the fitted cycles, over the untransformed parameters. Points of shape (n, d) give (n,), one point of shape (d,) gives a number
    /// of shape (). It is −inf outside a parameter's range and if an effect has no model. A point with NaN is refused.
    fn log_density<'py>(&self, py: Python<'py>, points: PointArray<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = points.of_length(self.with_models(|models| models.inputs()).len())?;
        let values = self.of_each(py, &points, |models, pieces| match models.posterior().log_densities(pieces) {
            Ok(densities) => densities.into_iter().map(Ok).collect(),
            Err(error) => vec![Err(error)],
        })?;
        points.shaped(py, values, None)
    }

    /// Gradient of `log_density` with respect to each parameter, in its unit. Points of shape (n, d) give (n, d), one point of shape (d,) gives (d,). It is 0
    /// if the density is 0. Raises `InputError` if a parameter has no derivative.
    fn log_density_gradient<'py>(
        &self,
        py: Python<'py>,
        points: PointArray<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = points.of_length(self.with_models(|models| models.inputs()).len())?;
        let values = self.of_each(py, &points, |models, pieces| {
            pieces.chunks_exact(points.length).map(|point| models.posterior().gradient_at(point)).collect()
        })?;
        points.shaped(py, values.concat(), Some(points.length))
    }

    fn __repr__(&self) -> String {
        let problem = &self.owned.borrow_owner().problem;
        let effects = &problem.specification.effects;
        format!(
            "ReducedModel({:?}, base={:?}, effects={effects:?}, parameters={:?})",
            problem.experiment.specimen_id,
            problem.specification.base.name(),
            self.names()
        )
    }
}

/// Error for a panic of a thread, which is a fault of this program.
fn broken() -> Error {
    Error::numerical("the model failed unexpectedly", "report this with the arguments that you gave")
}

impl ReducedModel {
    fn with_models<T>(&self, ask: impl FnOnce(&BridgeModels<'_>) -> T) -> T {
        self.owned.with_dependent(|_, models| ask(models))
    }

    /// Returns one result per point. All cores compute without Python's lock, and Ctrl-C is checked between blocks of points.
    fn of_each<T: Send>(
        &self,
        py: Python<'_>,
        points: &FlatPoints,
        ask: impl Fn(&BridgeModels<'_>, &[f64]) -> Vec<Result<T>> + Sync,
    ) -> PyResult<Vec<T>> {
        let mut values = Vec::with_capacity(points.n_points());
        for block in points.values.chunks(BLOCK * points.length) {
            py.check_signals()?;
            let of_block: Vec<Vec<Result<T>>> = py.detach(|| {
                self.with_models(|models| {
                    block.par_chunks(PIECE * points.length).map(|piece| ask(models, piece)).collect()
                })
            });
            for result in of_block.into_iter().flatten() {
                let point = values.len();
                values.push(result.map_err(|error| at_point("points", point, &error))?);
            }
        }
        Ok(values)
    }
}

/// Array argument of points: anything that NumPy can convert to an array of numbers.
struct PointArray<'py>(PyReadonlyArrayDyn<'py, f64>);

impl<'py> FromPyObject<'_, 'py> for PointArray<'py> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let py = object.py();
        let numpy = py.import("numpy")?;
        let refused = |error: PyErr| {
            refused(
                "points",
                format!("not an array of numbers ({})", error.value(py)),
                "give floats of shape (n, d) or (d,)",
            )
        };
        let array = numpy.call_method1("asarray", (object,)).map_err(refused)?;
        let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
        if !"fiu".contains(&kind) {
            let found = format!("an array of {}", array.getattr("dtype")?);
            return Err(crate::errors::refused("points", found, "give floats of shape (n, d) or (d,)"));
        }
        let array = numpy
            .call_method1("ascontiguousarray", (array.clone(), "float64"))?
            .call_method1("reshape", (array.getattr("shape")?,))?;
        Ok(Self(array.cast_into::<PyArrayDyn<f64>>().map_err(PyErr::from)?.try_readonly()?))
    }
}

impl PointArray<'_> {
    /// Checks that points have `length` numbers, and copies them one after another.
    fn of_length(&self, length: usize) -> PyResult<FlatPoints> {
        let shape = self.0.shape();
        let is_one = match *shape {
            [d] if d == length => true,
            [_, d] if d == length => false,
            _ => {
                let remedy = format!("give (n, {length}) or ({length},): the parameters in the order of `names`");
                return Err(refused("points", format!("an array of shape {shape:?}"), remedy));
            }
        };
        let values = self.0.as_slice().map_err(|error| refused("points", error, "give a contiguous array"))?.to_vec();
        if let Some(at) = values.iter().position(|value| value.is_nan()) {
            let found = format!("number {} of point {} is NaN", at % length, at / length);
            return Err(refused("points", found, "give numbers"));
        }
        Ok(FlatPoints { values, length, is_one })
    }
}

struct FlatPoints {
    values: Vec<f64>,
    length: usize,
    is_one: bool,
}

impl FlatPoints {
    fn n_points(&self) -> usize {
        self.values.len() / self.length
    }

    /// Returns the values of all points as an array of shape (points, width), or (points,) without `width`. The first axis is omitted for a single point.
    fn shaped<'py>(
        &self,
        py: Python<'py>,
        values: Vec<f64>,
        width: Option<usize>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let shape: Vec<usize> = (!self.is_one).then_some(self.n_points()).into_iter().chain(width).collect();
        values.into_pyarray(py).reshape(shape)
    }
}
