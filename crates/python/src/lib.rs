//! Compiled part of the Python module: experiments and reduced models. The program, which the wheel also contains, does the work that takes minutes
//! (`python/vitreo_uq/program.py`).

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
