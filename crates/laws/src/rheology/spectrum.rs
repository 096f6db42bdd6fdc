//! Retardation spectrum of a law: its creep compliance as a sum of exponentials, which allows a fast convolution with the force.

use super::Element;
use base::error::{Error, Result};
use base::number::{Dual, PointScalar};

/// Retardation spectrum of a law. It gives the creep compliance J(t) = J₀ + Σ aₘ (1 − e^{−rₘt}) + Re Σ Aₙ (1 − e^{−Λₙt}) + φ t at
/// the time t.
#[derive(Debug, Clone, PartialEq)]
pub struct RetardationSpectrum<T = Dual> {
    /// Instantaneous compliance J₀ in 1/Pa.
    pub instantaneous_per_pa: T,
    /// Real modes, each with a compliance aₘ and a rate rₘ.
    pub modes: Vec<SpectralMode<T>>,
    /// Oscillating modes, each with a complex compliance Aₙ and a complex rate Λₙ.
    pub oscillating: Vec<OscillatingMode<T>>,
    /// Fluidity φ in 1/(Pa·s).
    pub fluidity_per_pa_s: T,
}

/// Real mode a (1 − e^{−rt}) of the creep compliance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectralMode<T = Dual> {
    /// Compliance a of the mode in 1/Pa: the part of the creep compliance that the mode adds after a long time.
    pub compliance_per_pa: T,
    /// Retardation rate r > 0 of the mode in 1/s.
    pub rate_per_s: T,
}

/// Oscillating mode Re A (1 − e^{−Λt}) of the creep compliance, with complex A and Λ and Re Λ > 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OscillatingMode<T = Dual> {
    /// Complex compliance A of the mode in 1/Pa, as real and imaginary part.
    pub compliance_per_pa: [T; 2],
    /// Complex rate Λ of the mode in 1/s, as real and imaginary part.
    pub rate_per_s: [T; 2],
}

/// Range of times in which a spectrum must be accurate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeWindow {
    /// Shortest time after a change of the force for which the response is needed, in s.
    pub shortest_s: f64,
    /// Longest time after a change of the force for which the response is needed, in s.
    pub longest_s: f64,
}

/// Accuracy of a spectrum. Errors are relative to the creep compliance at the window's end, or to the spring's compliance for a
/// fractional Kelvin–Voigt body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accuracy {
    /// Relative error of 1e-8.
    Fine,
    /// Relative error of 1e-6 for springpots, with two thirds of the modes of [`Accuracy::Fine`]. The error is small compared to
    /// any noise. Networks with springpots still use [`Accuracy::Fine`].
    Fast,
}

impl RetardationSpectrum {
    /// Returns the creep compliance in 1/Pa at a time > 0 in s, without its derivative.
    pub fn creep_compliance_per_pa(&self, time_s: f64) -> f64 {
        let modes = self.modes.iter().map(|m| -m.compliance_per_pa.value * (-m.rate_per_s.value * time_s).exp_m1());
        let oscillating = self.oscillating.iter().map(|mode| {
            let ([a_re, a_im], [l_re, l_im]) = (mode.compliance_per_pa, mode.rate_per_s);
            let (decay, angle) = ((-l_re.value * time_s).exp(), l_im.value * time_s);
            a_re.value - decay * (a_re.value * angle.cos() + a_im.value * angle.sin())
        });
        let flow = self.fluidity_per_pa_s.value * time_s;
        self.instantaneous_per_pa.value + modes.sum::<f64>() + oscillating.sum::<f64>() + flow
    }
}

impl<T: PointScalar> RetardationSpectrum<T> {
    /// Converts a spectrum with derivatives to another number type.
    pub fn of_dual(spectrum: &RetardationSpectrum) -> Self {
        let mut converted = Self::empty();
        converted.extend(spectrum);
        converted
    }

    pub(super) fn empty() -> Self {
        let zero = T::constant(0.0);
        Self { instantaneous_per_pa: zero, modes: Vec::new(), oscillating: Vec::new(), fluidity_per_pa_s: zero }
    }

    /// Adds the spectrum of another part of the law, in series, to `self`: compliances in series add.
    pub(super) fn extend(&mut self, other: &RetardationSpectrum) {
        let pair = |[re, im]: [Dual; 2]| [T::from_dual(re), T::from_dual(im)];
        self.instantaneous_per_pa += T::from_dual(other.instantaneous_per_pa);
        self.modes.extend(other.modes.iter().map(|mode| SpectralMode {
            compliance_per_pa: T::from_dual(mode.compliance_per_pa),
            rate_per_s: T::from_dual(mode.rate_per_s),
        }));
        self.oscillating.extend(other.oscillating.iter().map(|mode| OscillatingMode {
            compliance_per_pa: pair(mode.compliance_per_pa),
            rate_per_s: pair(mode.rate_per_s),
        }));
        self.fluidity_per_pa_s += T::from_dual(other.fluidity_per_pa_s);
    }

    pub(super) fn add_kelvin_voigt(&mut self, modulus_pa: Dual, viscosity_pa_s: Dual) {
        let (modulus_pa, viscosity_pa_s) = (T::from_dual(modulus_pa), T::from_dual(viscosity_pa_s));
        let compliance_per_pa = T::constant(1.0) / modulus_pa;
        self.modes.push(SpectralMode { compliance_per_pa, rate_per_s: modulus_pa / viscosity_pa_s });
    }
}

/// Checks the orders of all springpots of an element.
pub(super) fn check_orders(element: &Element) -> Result<()> {
    match element {
        Element::Springpot { order, .. } => check_order(*order),
        Element::Series(elements) | Element::Parallel(elements) => elements.iter().try_for_each(check_orders),
        _ => Ok(()),
    }
}

/// Checks that the order of a springpot is in (0, 1]. A springpot of order 0 is a spring.
pub(super) fn check_order(order: Dual) -> Result<()> {
    if order.value > 0.0 && order.value <= 1.0 {
        return Ok(());
    }
    Err(Error::numerical(
        format!("a springpot has the order {}", order.value),
        "give an order above 0 and up to 1; a spring is order 0",
    ))
}
