//! Search for the modes of a posterior before sampling: maxima from several starts, with their Laplace approximations.

mod laplace;
mod newton;
mod stencil;

pub use laplace::{Mode, Modes};
pub use newton::{Optimum, fit_local_gaussian, maximise};

use crate::LogDensity;
use base::Result;
use rayon::prelude::*;
use std::cmp::Ordering;

/// Climbs from every start and returns the distinct modes, largest mass first. Starts outside the support are skipped.
///
/// # Errors
/// [`base::Error::Numerical`] when a log density is +∞.
pub fn find_modes(density: &dyn LogDensity, starts: &[Vec<f64>]) -> Result<Modes> {
    let optima: Vec<Option<Optimum>> =
        starts.par_iter().map(|start| maximise(density, start)).collect::<Result<Vec<_>>>()?;
    let mut modes = Modes::default();
    let mut optima: Vec<Optimum> = optima.into_iter().flatten().collect();
    // Only climbs that converged define modes. If no climb converged, the highest end point is the only mode.
    optima.sort_by(|a, b| {
        (b.converged, b.log_density).partial_cmp(&(a.converged, a.log_density)).unwrap_or(Ordering::Equal)
    });
    optima
        .iter()
        .enumerate()
        .filter(|(k, optimum)| optimum.converged || *k == 0)
        .for_each(|(_, optimum)| modes.add(optimum));
    Ok(modes)
}
