//! Where the posterior's mass is, before any sampling: optima found from several starts and their Laplace approximations.

mod laplace;
mod newton;
mod stencil;

pub use laplace::{Mode, Modes};
pub use newton::{Optimum, maximise};

use crate::Result;
use crate::inference::LogDensity;
use rayon::prelude::*;

/// Climbs from every start and keeps the distinct modes, the heaviest first. Starts outside the support are passed over.
///
/// # Errors
/// [`crate::Error::Numerical`] when a log density is NaN or +∞.
pub fn find_modes(density: &dyn LogDensity, starts: &[Vec<f64>]) -> Result<Modes> {
    let optima: Vec<Option<Optimum>> =
        starts.par_iter().map(|start| maximise(density, start)).collect::<Result<Vec<_>>>()?;
    let mut modes = Modes::default();
    optima.iter().flatten().for_each(|optimum| modes.add(optimum));
    Ok(modes)
}
