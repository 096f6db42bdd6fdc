//! The program's errors as exceptions of Python; the classes stand in `python/vitreo_uq/errors.py`.

use pyo3::{PyErr, import_exception};
use vitreo_uq::base::error::Error;

import_exception!(vitreo_uq.errors, InputError);

/// Beside the program's own error, which has the same name.
mod base {
    pyo3::import_exception!(vitreo_uq.errors, Error);
}

/// An error with its whole message: the library's names of fields are the module's names of arguments.
pub fn raised(error: Error) -> PyErr {
    match &error {
        Error::Input { .. } | Error::File { .. } => InputError::new_err(error.to_string()),
        _ => base::Error::new_err(error.to_string()),
    }
}

/// An error of an argument of the module.
pub fn refused(argument: &str, found: impl std::fmt::Display, remedy: impl std::fmt::Display) -> PyErr {
    InputError::new_err(format!("`{argument}`: {found}\n  what to do: {remedy}"))
}

/// Where a point has no model, the point is at fault.
pub fn at_point(argument: &str, point: usize, error: &Error) -> PyErr {
    InputError::new_err(format!("`{argument}`, point {point}: {error}"))
}
