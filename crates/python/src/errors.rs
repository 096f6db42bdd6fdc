//! The program's errors as exceptions of Python; the classes stand in `python/vitreo_uq/errors.py`.

use pyo3::{PyErr, import_exception};
use vitreo_uq::base::error::{Error, Place};

import_exception!(vitreo_uq.errors, InputError);

/// Beside the program's own error, which has the same name.
mod base {
    pyo3::import_exception!(vitreo_uq.errors, Error);
}

/// Options of the program, and what the module calls them.
const ARGUMENTS: [(&str, &str); 6] = [
    ("--base", "base"),
    ("--with", "effects"),
    ("--noise", "noise"),
    ("--prior", "prior"),
    ("--set", "fixed"),
    ("--from", "revision"),
];

/// An error with its whole message; the program's options are named as the module's arguments.
pub fn raised(error: Error) -> PyErr {
    let argument = |place: &Place| {
        let key = place.file.is_none().then_some(place.key.as_deref()).flatten()?;
        ARGUMENTS.iter().find(|(option, _)| *option == key).map(|(_, argument)| *argument)
    };
    match &error {
        Error::Input { place, found, remedy } => InputError::new_err(match argument(place) {
            Some(argument) => format!("`{argument}`: {found}\n  what to do: {remedy}"),
            None => error.to_string(),
        }),
        Error::File { .. } => InputError::new_err(error.to_string()),
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
