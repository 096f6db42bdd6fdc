//! Any law as a sum of exponentials: what the fast convolution needs.

use super::fractional::{add_kelvin_voigt as add_fractional_kelvin_voigt, add_springpot};
use super::{Element, branch_cut, stieltjes};
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
    pub(super) fn empty() -> Self {
        Self {
            instantaneous_per_pa: Dual::ZERO,
            modes: Vec::new(),
            oscillating: Vec::new(),
            fluidity_per_pa_s: Dual::ZERO,
        }
    }

    /// The spectrum of elements in series.
    ///
    /// Springs, dashpots and networks of them are exact. Springpots are right within 1e-8 of J at the end of the window (of 1/E for the fractional
    /// Kelvin–Voigt body) for times inside the window and after any superposition of them; before `shortest_s` the modes that are faster than
    /// the window stand as instantaneous compliance.
    ///
    /// # Errors
    /// [`Error::Numerical`] where a network has no spectrum that can be computed, and where the window is not one of positive, finite times.
    pub fn of(law: &[Element], window: TimeWindow) -> Result<Self> {
        let TimeWindow { shortest_s, longest_s } = window;
        if !(shortest_s > 0.0 && longest_s >= shortest_s && longest_s.is_finite()) {
            return Err(Error::numerical(
                format!("a spectrum cannot hold from {shortest_s} s to {longest_s} s"),
                "give positive, finite times, the shortest first",
            ));
        }
        let mut spectrum = Self::empty();
        law.iter().try_for_each(|element| spectrum.add(element, window))?;
        if !(spectrum.instantaneous_per_pa.value.is_finite() && spectrum.fluidity_per_pa_s.value.is_finite()) {
            return Err(Error::numerical(
                format!("the creep compliance of {law:?} is not finite"),
                "give moduli, viscosities and times of a size that can be",
            ));
        }
        Ok(spectrum)
    }

    /// J(t) in 1/Pa by value, t > 0 in s.
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

    pub(super) fn extend(&mut self, other: Self) {
        self.instantaneous_per_pa += other.instantaneous_per_pa;
        self.modes.extend(other.modes);
        self.oscillating.extend(other.oscillating);
        self.fluidity_per_pa_s += other.fluidity_per_pa_s;
    }

    fn add(&mut self, element: &Element, window: TimeWindow) -> Result<()> {
        match element {
            Element::Spring { modulus_pa } => self.instantaneous_per_pa += Dual::ONE / *modulus_pa,
            Element::Dashpot { viscosity_pa_s } => self.fluidity_per_pa_s += Dual::ONE / *viscosity_pa_s,
            Element::Compliance { compliance_per_pa } => self.instantaneous_per_pa += *compliance_per_pa,
            Element::Retarded { compliance_per_pa, time_s } => {
                self.modes.push(SpectralMode { compliance_per_pa: *compliance_per_pa, rate_per_s: Dual::ONE / *time_s })
            }
            Element::Springpot { modulus_pa, time_s, order } => {
                check_order(*order)?;
                if order.is_constant(1.0) {
                    self.fluidity_per_pa_s += Dual::ONE / (*modulus_pa * *time_s);
                } else {
                    add_springpot(self, *modulus_pa * time_s.pow(*order), *order, window);
                }
            }
            Element::Series(elements) => elements.iter().try_for_each(|element| self.add(element, window))?,
            Element::Parallel(elements) => self.add_parallel(element, elements, window)?,
        }
        Ok(())
    }

    fn add_parallel(&mut self, whole: &Element, elements: &[Element], window: TimeWindow) -> Result<()> {
        match elements {
            [] => {
                return Err(Error::numerical("a network has no element in parallel", "write at least one element"));
            }
            [only] => self.add(only, window)?,
            [Element::Spring { modulus_pa }, Element::Dashpot { viscosity_pa_s }]
            | [Element::Dashpot { viscosity_pa_s }, Element::Spring { modulus_pa }] => {
                self.add_kelvin_voigt(*modulus_pa, *viscosity_pa_s);
            }
            [Element::Spring { modulus_pa: spring_pa }, Element::Springpot { modulus_pa, time_s, order }]
            | [Element::Springpot { modulus_pa, time_s, order }, Element::Spring { modulus_pa: spring_pa }] => {
                check_order(*order)?;
                if order.is_constant(1.0) {
                    self.add_kelvin_voigt(*spring_pa, *modulus_pa * *time_s);
                } else {
                    // E τᵅ = G tᵅ for the spring's E and the springpot's G and t.
                    let time_s = *time_s * (*modulus_pa / *spring_pa).pow(Dual::ONE / *order);
                    add_fractional_kelvin_voigt(self, *spring_pa, time_s, *order, window);
                }
            }
            _ => match stieltjes::spectrum_of(whole) {
                Some(exact) => self.extend(exact),
                None => branch_cut::add_network(self, whole, window)?,
            },
        }
        Ok(())
    }

    fn add_kelvin_voigt(&mut self, modulus_pa: Dual, viscosity_pa_s: Dual) {
        self.modes
            .push(SpectralMode { compliance_per_pa: Dual::ONE / modulus_pa, rate_per_s: modulus_pa / viscosity_pa_s });
    }
}

/// Refuses an order outside (0, 1]; at 0 a springpot is a spring.
pub(super) fn check_order(order: Dual) -> Result<()> {
    if order.value > 0.0 && order.value <= 1.0 {
        return Ok(());
    }
    Err(Error::numerical(
        format!("a springpot has the order {}", order.value),
        "give an order above 0 and up to 1; a spring is order 0",
    ))
}
