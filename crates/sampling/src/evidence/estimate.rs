//! The evidence by the first of two methods that is reliable.

use super::importance::{self, ImportanceOptions};
use super::tempering::{self, TemperingOptions};
use super::{Estimate, PriorCoordinates};
use crate::optimum::Modes;
use base::error::{Error, Result};

/// Estimates the evidence by importance sampling, or by sequential Monte Carlo if the importance weights are unreliable.
///
/// # Errors
/// [`Error::Numerical`] if both methods fail.
pub fn estimate(density: &PriorCoordinates, modes: &Modes, seed: u64) -> Result<Estimate> {
    let weighted = importance::evidence(density, modes, &ImportanceOptions { seed, ..ImportanceOptions::default() });
    match weighted {
        Ok(estimate) if importance::is_reliable(&estimate) => Ok(estimate),
        Ok(_) | Err(Error::Numerical { .. }) => {
            let options = TemperingOptions { seed, ..TemperingOptions::default() };
            let mut tempered = tempering::evidence(density, modes, &options)?;
            // Independent runs may all miss a region of the posterior, without any sign of it. Importance weights that reach the region reveal it.
            if let Ok(weighted) = weighted {
                let apart = (tempered.ln_evidence - weighted.ln_evidence).abs();
                tempered.standard_error = tempered.standard_error.max(apart);
            }
            Ok(tempered)
        }
        Err(other) => Err(other),
    }
}
