//! Any law as a sum of exponentials: what the fast convolution needs.

use super::Element;
use crate::error::{Error, Result};
use crate::number::Dual;

/// J(t) = J₀ + Σ aₘ (1 − e^{−rₘt}) + Re Σ Aₙ (1 − e^{−Λₙt}) + φ t.
#[derive(Debug, Clone, PartialEq)]
pub struct RetardationSpectrum {
    /// J₀ in 1/Pa.
    pub instantaneous_per_pa: Dual,
    /// aₘ and rₘ.
    pub modes: Vec<SpectralMode>,
    /// Aₙ and Λₙ.
    pub oscillating: Vec<OscillatingMode>,
    /// φ in 1/(Pa·s).
    pub fluidity_per_pa_s: Dual,
}

/// a (1 − e^{−rt}).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectralMode {
    /// a in 1/Pa.
    pub compliance_per_pa: Dual,
    /// r > 0 in 1/s.
    pub rate_per_s: Dual,
}

/// Re A (1 − e^{−Λt}) with complex A and Λ, Re Λ > 0; real part first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OscillatingMode {
    /// A in 1/Pa.
    pub compliance_per_pa: [Dual; 2],
    /// Λ in 1/s.
    pub rate_per_s: [Dual; 2],
}

/// Times between which a spectrum must be right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeWindow {
    /// Shortest time after a change of the force at which the response is asked for, in s.
    pub shortest_s: f64,
    /// Longest such time, in s.
    pub longest_s: f64,
}

impl RetardationSpectrum {
    /// The spectrum of elements in series.
    ///
    /// # Errors
    /// [`Error::Numerical`] where a network has no spectrum that can be computed.
    pub fn of(law: &[Element], _window: TimeWindow) -> Result<Self> {
        let mut spectrum = Self {
            instantaneous_per_pa: Dual::ZERO,
            modes: Vec::new(),
            oscillating: Vec::new(),
            fluidity_per_pa_s: Dual::ZERO,
        };
        for element in law {
            spectrum.add(element)?;
        }
        Ok(spectrum)
    }

    fn add(&mut self, element: &Element) -> Result<()> {
        match element {
            Element::Spring { modulus_pa } => self.instantaneous_per_pa += Dual::ONE / *modulus_pa,
            Element::Dashpot { viscosity_pa_s } => self.fluidity_per_pa_s += Dual::ONE / *viscosity_pa_s,
            Element::Compliance { compliance_per_pa } => self.instantaneous_per_pa += *compliance_per_pa,
            Element::Retarded { compliance_per_pa, time_s } => {
                self.modes.push(SpectralMode { compliance_per_pa: *compliance_per_pa, rate_per_s: Dual::ONE / *time_s })
            }
            Element::Series(elements) => elements.iter().try_for_each(|element| self.add(element))?,
            Element::Parallel(elements) => match elements.as_slice() {
                [Element::Spring { modulus_pa }, Element::Dashpot { viscosity_pa_s }] => {
                    self.modes.push(SpectralMode {
                        compliance_per_pa: Dual::ONE / *modulus_pa,
                        rate_per_s: *modulus_pa / *viscosity_pa_s,
                    });
                }
                _ => return Err(no_spectrum()),
            },
            Element::Springpot { .. } => return Err(no_spectrum()),
        }
        Ok(())
    }
}

fn no_spectrum() -> Error {
    Error::numerical("this network has no spectrum", "use springs, dashpots and Kelvin–Voigt bodies in series")
}
