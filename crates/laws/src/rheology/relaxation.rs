//! Relaxation modulus of a law, for records with a prescribed strain.

use super::spectrum::check_orders;
use super::{Accuracy, Element, RetardationSpectrum, SpectralMode, TimeWindow, stieltjes};
use base::error::{Error, Result};
use base::number::Dual;

/// Slowest rate of the modes that stand for a viscosity, times the shortest time of the window.
const FAST: f64 = 200.0;
/// Modes that stand for a viscosity: each rate, divided by the slowest one, and its part of the viscosity. Their response to a strain rate that changes in a time τ is
/// late only by the third power of 1/(rate τ), because their first two moments vanish.
const OF_VISCOSITY: [[f64; 2]; 3] = [[1.0, 0.5], [2.0, -4.0], [3.0, 4.5]];

/// Smallest rate of a mode, times the shortest time of the window, above which the mode counts as a viscosity. Its large modulus would cost digits.
const VISCOUS: f64 = 1e6;

/// Start of the window for a creep compliance, divided by the start of the window for the relaxation modulus that is computed from it. The stress at a time depends on
/// the creep compliance at all earlier times. The factor limits the error of a springpot's modulus to 3·10⁻⁸ for orders from 0.1 to 0.8.
const EARLIER: f64 = 1e-4;

impl RetardationSpectrum {
    /// Returns the relaxation modulus G(t) of elements in series, in the form of a creep compliance: ∫ G dε with the strain ε is the stress. Its "compliances" are
    /// moduli in Pa, and those of its modes are negative.
    ///
    /// A law whose stress jumps without limit with the strain has a viscosity η, with the stress η ε̇. Modes that are faster than the window take its place.
    /// The stress is then exact to rounding at times of the window after each change of the strain or of its rate.
    ///
    /// # Errors
    /// [`Error::Numerical`] if a modulus is not finite, or if the order of a springpot is outside (0, 1].
    pub fn relaxation_of_law(law: &[Element], window: TimeWindow, accuracy: Accuracy) -> Result<Self> {
        law.iter().try_for_each(check_orders)?;
        let earlier = TimeWindow { shortest_s: EARLIER * window.shortest_s, ..window };
        let (mut viscosity, mut modes) = stieltjes::relaxation_of_law(law, earlier, accuracy);
        modes.retain(|(modulus, rate)| {
            let is_viscous = rate.value * window.shortest_s > VISCOUS;
            if is_viscous {
                viscosity += *modulus / *rate;
            }
            !is_viscous
        });
        let mut relaxation = Self::empty();
        let mut add = |modulus: Dual, rate: Dual| {
            relaxation.instantaneous_per_pa += modulus;
            if rate.value > 0.0 {
                relaxation.modes.push(SpectralMode { compliance_per_pa: -modulus, rate_per_s: rate });
            }
        };
        modes.into_iter().for_each(|(modulus, rate)| add(modulus, rate));
        if viscosity.value > 0.0 {
            for [rate, part] in OF_VISCOSITY {
                let rate = Dual::constant(rate * FAST / window.shortest_s);
                add(viscosity * rate * part, rate);
            }
        }
        if relaxation.instantaneous_per_pa.value.is_finite() {
            return Ok(relaxation);
        }
        Err(Error::numerical("the relaxation modulus is not finite", "give physically possible moduli and viscosities"))
    }
}
