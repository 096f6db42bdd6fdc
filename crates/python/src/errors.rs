//! Converts the program's errors to Python exceptions. The classes are in `python/vitreo_uq/errors.py`.

use pyo3::{PyErr, import_exception};
use vitreo_uq::base::error::Error;

import_exception!(vitreo_uq.errors, InputError);

/// Python exception class `Error`. It has a separate module, because the program's error type has this name too.
mod base {
    pyo3::import_exception!(vitreo_uq.errors, Error);
}

/// Converts an error of the program to a Python exception with the whole message. The message names fields, and the Python arguments have equal names.
pub fn raised(error: Error) -> PyErr {
    match &error {
        Error::Input { .. } | Error::File { .. } => InputError::new_err(error.to_string()),
        _ => base::Error::new_err(error.to_string()),
    }
}

/// Python exception that refuses an argument. It states the argument, what was found, and the remedy.
pub fn refused(argument: &str, found: impl std::fmt::Display, remedy: impl std::fmt::Display) -> PyErr {
    InputError::new_err(format!("`{argument}`: {found}\n  what to do: {remedy}"))
}

/// Python exception for one point of an array argument. If the model fails at a point, the argument is at fault.
pub fn at_point(argument: &str, point: usize, error: &Error) -> PyErr {
    InputError::new_err(format!("`{argument}`, point {point}: {error}"))
}
