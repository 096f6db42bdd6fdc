//! The Python module's compiled part: experiments, and the reduced model of one. What runs for minutes is the program's, which the wheel holds
//! beside this (`python/vitreo_uq/program.py`).

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
