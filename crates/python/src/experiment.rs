//! Python class `Experiment`: a measurement as arrays.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use vitreo_uq::posterior::replica;
use vitreo_uq::record::{self, ExperimentFiles, Interpretation};

use crate::errors::raised;

/// Measured force and position over time, with the cycles that are fitted. Arrays have one entry per row, in SI units; each access makes a new array.
#[pyclass(frozen, module = "vitreo_uq")]
pub struct Experiment {
    pub experiment: record::Experiment,
    pub understood: Interpretation,
    /// Remarks from reading the files, for example on how cycles were found.
    notes: Vec<String>,
    /// Path that the experiment was read from; `None` for the embedded replica.
    path: Option<PathBuf>,
}

impl Experiment {
    fn new(experiment: record::Experiment, files: ExperimentFiles, path: Option<PathBuf>) -> Self {
        let notes = files.notes.iter().map(ToString::to_string).collect();
        Self { experiment, understood: files.interpretation, notes, path }
    }
}

#[pymethods]
impl Experiment {
    /// Reads an experiment: a directory with `experiment.toml`, the path of the TOML, or a study. Raises `InputError` with file, line and remedy.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let (experiment, files) = py.detach(|| record::Experiment::read(&path)).map_err(raised)?;
        Ok(Self::new(experiment, files, Some(path)))
    }

    /// The synthetic experiment that is embedded in the program.
    #[staticmethod]
    fn replica() -> PyResult<Self> {
        let (experiment, files) = replica::embedded().map_err(raised)?;
        Ok(Self::new(experiment, files, None))
    }

    /// Path of the experiment; None for the replica.
    #[getter]
    fn path(&self) -> Option<PathBuf> {
        self.path.clone()
    }

    /// The specimen's identifier.
    #[getter]
    fn label(&self) -> &str {
        &self.experiment.specimen_id
    }

    /// Species, if it is given.
    #[getter]
    fn species(&self) -> Option<&str> {
        self.experiment.species.as_deref()
    }

    /// Region of the eye, if it is given.
    #[getter]
    fn region(&self) -> Option<&str> {
        self.experiment.region.as_deref()
    }

    /// Origin of the data, as the experiment states it.
    #[getter]
    fn source(&self) -> &str {
        &self.experiment.source
    }

    /// Times in s, shape (rows,).
    #[getter]
    fn time_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.experiment.record.time_s.clone().into_pyarray(py)
    }

    /// Commanded force in N, shape (rows,).
    #[getter]
    fn force_n<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.experiment.record.force_n.clone().into_pyarray(py)
    }

    /// Position in m, shape (rows,); NaN if it is missing.
    #[getter]
    fn position_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let positions = self.experiment.record.position_m.iter().map(|position| position.unwrap_or(f64::NAN));
        positions.collect::<Vec<f64>>().into_pyarray(py)
    }

    /// Cycle of each row, from 1, shape (rows,).
    #[getter]
    fn cycle<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.experiment.record.cycle.clone().into_pyarray(py)
    }

    /// Cycles that the base model is fitted to.
    #[getter]
    fn calibration_cycles(&self) -> Vec<u32> {
        self.experiment.calibration_cycles.clone()
    }

    /// Held-out cycles, which no fit of the base model uses.
    #[getter]
    fn heldout_cycles(&self) -> Vec<u32> {
        self.experiment.heldout_cycles.clone()
    }

    /// Known noise standard deviation of the tracker in µm, if it is stated.
    #[getter]
    fn noise_um(&self) -> Option<f64> {
        self.experiment.noise_sd_m.map(|sd_m| 1e6 * sd_m)
    }

    /// Remarks from reading the files, for example on how cycles were found or which positions are missing.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn __len__(&self) -> usize {
        self.experiment.record.n_rows()
    }

    fn __repr__(&self) -> String {
        let record = &self.experiment.record;
        format!("Experiment({:?}, {} rows, {} cycles)", self.experiment.specimen_id, record.n_rows(), record.n_cycles())
    }
}
