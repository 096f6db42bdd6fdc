//! Compiled part of the Python module: experiments and reduced models. Work that takes minutes is done by the program,
//! which the wheel also contains (`python/vitreo_uq/program.py`).

mod errors;
mod experiment;
mod model;

use pyo3::prelude::*;

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<experiment::Experiment>()?;
    module.add_class::<model::ReducedModel>()
}
