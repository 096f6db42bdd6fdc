//! The program's errors as Python exceptions. The classes are in `python/vitreo_uq/errors.py`.

use pyo3::{PyErr, import_exception};
use vitreo_uq::base::error::Error;

import_exception!(vitreo_uq.errors, InputError);

/// A module of its own, because the program's error has the same name.
mod base {
    pyo3::import_exception!(vitreo_uq.errors, Error);
}

/// Converts an error with its whole message. The library's field names equal the module's argument names.
pub fn raised(error: Error) -> PyErr {
    match &error {
        Error::Input { .. } | Error::File { .. } => InputError::new_err(error.to_string()),
        _ => base::Error::new_err(error.to_string()),
    }
}

/// Error about an argument of the module.
pub fn refused(argument: &str, found: impl std::fmt::Display, remedy: impl std::fmt::Display) -> PyErr {
    InputError::new_err(format!("`{argument}`: {found}\n  what to do: {remedy}"))
}

/// Error about one point. A point without a model is a fault of the argument.
pub fn at_point(argument: &str, point: usize, error: &Error) -> PyErr {
    InputError::new_err(format!("`{argument}`, point {point}: {error}"))
}
