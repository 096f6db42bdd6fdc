//! Relaxation modulus of a law, for records with a prescribed strain.

use super::{RetardationSpectrum, SpectralMode, TimeWindow, stieltjes};
use base::error::{Error, Result};
use base::number::Dual;

/// Rate of the mode that stands for a viscosity, times the shortest time of the window. At that time the mode has decayed to rounding, e⁻⁴⁰.
const FAST: f64 = 40.0;

impl RetardationSpectrum {
    /// Returns the relaxation modulus G(t) in the form of a creep compliance: ∫ G dε with the strain ε is the stress. Its "compliances" are moduli in Pa, and
    /// those of its modes are negative. The spectrum itself must come from a law without mass.
    ///
    /// A law whose stress jumps without limit with the strain has a viscosity η, with the stress η ε̇. A mode that is faster than the window takes its place.
    /// The stress is then exact to rounding at times of the window after each change of the strain or of its rate.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the law oscillates, or if a modulus is not finite.
    pub fn relaxation(&self, window: TimeWindow) -> Result<Self> {
        if !self.oscillating.is_empty() {
            return Err(Error::numerical(
                "a law with a mass has no relaxation modulus",
                "leave `inertia` out for a record with a prescribed position",
            ));
        }
        let (viscosity, modes) = stieltjes::relaxation_of_spectrum(self);
        let mut relaxation = Self::empty();
        let mut add = |modulus: Dual, rate: Dual| {
            relaxation.instantaneous_per_pa += modulus;
            if rate.value > 0.0 {
                relaxation.modes.push(SpectralMode { compliance_per_pa: -modulus, rate_per_s: rate });
            }
        };
        modes.into_iter().for_each(|(modulus, rate)| add(modulus, rate));
        if viscosity.value > 0.0 {
            let rate = Dual::constant(FAST / window.shortest_s);
            add(viscosity * rate, rate);
        }
        if relaxation.instantaneous_per_pa.value.is_finite() {
            return Ok(relaxation);
        }
        Err(Error::numerical("the relaxation modulus is not finite", "give physically possible moduli and viscosities"))
    }
}
