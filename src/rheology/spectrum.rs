//! Any law as a sum of exponentials: what the fast convolution needs.

use super::fractional::{FractionalBody, Springpot};
use super::{Element, branch_cut, stieltjes};
use crate::error::{Error, Result};
use crate::number::{Dual, PointScalar};

/// J(t) = J₀ + Σ aₘ (1 − e^{−rₘt}) + Re Σ Aₙ (1 − e^{−Λₙt}) + φ t.
#[derive(Debug, Clone, PartialEq)]
pub struct RetardationSpectrum<T = Dual> {
    /// J₀ in 1/Pa.
    pub instantaneous_per_pa: T,
    /// aₘ and rₘ.
    pub modes: Vec<SpectralMode<T>>,
    /// Aₙ and Λₙ.
    pub oscillating: Vec<OscillatingMode<T>>,
    /// φ in 1/(Pa·s).
    pub fluidity_per_pa_s: T,
}

/// a (1 − e^{−rt}).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectralMode<T = Dual> {
    /// a in 1/Pa.
    pub compliance_per_pa: T,
    /// r > 0 in 1/s.
    pub rate_per_s: T,
}

/// Re A (1 − e^{−Λt}) with complex A and Λ, Re Λ > 0; real part first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OscillatingMode<T = Dual> {
    /// A in 1/Pa.
    pub compliance_per_pa: [T; 2],
    /// Λ in 1/s.
    pub rate_per_s: [T; 2],
}

/// Times between which a spectrum must be right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeWindow {
    /// Shortest time after a change of the force at which the response is asked for, in s.
    pub shortest_s: f64,
    /// Longest such time, in s.
    pub longest_s: f64,
}

/// How near to its law a spectrum is. Errors are those of J at the end of the window, of 1/E for the fractional Kelvin–Voigt body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accuracy {
    /// Within 1e-8.
    Fine,
    /// Springpots within 1e-6, with two thirds of the modes: small beside any noise. Networks of springpots are [`Accuracy::Fine`] all the same.
    Fast,
}

impl RetardationSpectrum {
    /// The spectrum of elements in series, [`Accuracy::Fine`].
    ///
    /// # Errors
    /// Those of [`Self::with_accuracy`].
    pub fn of(law: &[Element], window: TimeWindow) -> Result<Self> {
        Self::with_accuracy(law, window, Accuracy::Fine)
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
}

impl<T: PointScalar> RetardationSpectrum<T> {
    pub(super) fn empty() -> Self {
        let zero = T::constant(0.0);
        Self { instantaneous_per_pa: zero, modes: Vec::new(), oscillating: Vec::new(), fluidity_per_pa_s: zero }
    }

    /// The spectrum of elements in series, by value or with the derivative that they carry; values are the same to the bit.
    ///
    /// Springs, dashpots and networks of them are exact. Springpots are right within the accuracy for times inside the window and after any
    /// superposition of them; before `shortest_s` the modes that are faster than the window stand as instantaneous compliance.
    ///
    /// # Errors
    /// [`Error::Numerical`] where a network has no spectrum that can be computed, and where the window is not one of positive, finite times.
    pub fn with_accuracy(law: &[Element], window: TimeWindow, accuracy: Accuracy) -> Result<Self> {
        let TimeWindow { shortest_s, longest_s } = window;
        if !(shortest_s > 0.0 && longest_s >= shortest_s && longest_s.is_finite()) {
            return Err(Error::numerical(
                format!("a spectrum cannot hold from {shortest_s} s to {longest_s} s"),
                "give positive, finite times, the shortest first",
            ));
        }
        let mut builder = Builder { spectrum: Self::empty(), window, accuracy };
        law.iter().try_for_each(|element| builder.add(element))?;
        let spectrum = builder.spectrum;
        if !(spectrum.instantaneous_per_pa.value().is_finite() && spectrum.fluidity_per_pa_s.value().is_finite()) {
            return Err(Error::numerical(
                format!("the creep compliance of {law:?} is not finite"),
                "give moduli, viscosities and times of a size that can be",
            ));
        }
        Ok(spectrum)
    }

    /// Adds the spectrum of a body in series: compliances add.
    pub(super) fn extend(&mut self, other: &RetardationSpectrum) {
        let pair = |[re, im]: [Dual; 2]| [T::of(re), T::of(im)];
        self.instantaneous_per_pa += T::of(other.instantaneous_per_pa);
        self.modes.extend(other.modes.iter().map(|mode| SpectralMode {
            compliance_per_pa: T::of(mode.compliance_per_pa),
            rate_per_s: T::of(mode.rate_per_s),
        }));
        self.oscillating.extend(other.oscillating.iter().map(|mode| OscillatingMode {
            compliance_per_pa: pair(mode.compliance_per_pa),
            rate_per_s: pair(mode.rate_per_s),
        }));
        self.fluidity_per_pa_s += T::of(other.fluidity_per_pa_s);
    }

    fn add_kelvin_voigt(&mut self, modulus_pa: Dual, viscosity_pa_s: Dual) {
        let (modulus_pa, viscosity_pa_s) = (T::of(modulus_pa), T::of(viscosity_pa_s));
        let compliance_per_pa = T::constant(1.0) / modulus_pa;
        self.modes.push(SpectralMode { compliance_per_pa, rate_per_s: modulus_pa / viscosity_pa_s });
    }
}

/// A spectrum to which elements are added.
struct Builder<T> {
    spectrum: RetardationSpectrum<T>,
    window: TimeWindow,
    accuracy: Accuracy,
}

impl<T: PointScalar> Builder<T> {
    fn add(&mut self, element: &Element) -> Result<()> {
        let inverse = |number: Dual| T::constant(1.0) / T::of(number);
        let spectrum = &mut self.spectrum;
        match element {
            Element::Spring { modulus_pa } => spectrum.instantaneous_per_pa += inverse(*modulus_pa),
            Element::Dashpot { viscosity_pa_s } => spectrum.fluidity_per_pa_s += inverse(*viscosity_pa_s),
            Element::Compliance { compliance_per_pa } => spectrum.instantaneous_per_pa += T::of(*compliance_per_pa),
            Element::Retarded { compliance_per_pa, time_s } => spectrum
                .modes
                .push(SpectralMode { compliance_per_pa: T::of(*compliance_per_pa), rate_per_s: inverse(*time_s) }),
            Element::Springpot { modulus_pa, time_s, order } => {
                check_order(*order)?;
                let (modulus_pa, time_s) = (T::of(*modulus_pa), T::of(*time_s));
                if order.is_constant(1.0) {
                    spectrum.fluidity_per_pa_s += T::constant(1.0) / (modulus_pa * time_s);
                } else {
                    let order = T::of(*order);
                    let springpot = Springpot { coefficient: modulus_pa * time_s.pow(order), order };
                    springpot.add_to(spectrum, self.window, self.accuracy);
                }
            }
            Element::Series(elements) => elements.iter().try_for_each(|element| self.add(element))?,
            Element::Parallel(elements) => self.add_parallel(element, elements)?,
        }
        Ok(())
    }

    fn add_parallel(&mut self, whole: &Element, elements: &[Element]) -> Result<()> {
        match elements {
            [] => {
                return Err(Error::numerical("a network has no element in parallel", "write at least one element"));
            }
            [only] => self.add(only)?,
            [Element::Spring { modulus_pa }, Element::Dashpot { viscosity_pa_s }]
            | [Element::Dashpot { viscosity_pa_s }, Element::Spring { modulus_pa }] => {
                self.spectrum.add_kelvin_voigt(*modulus_pa, *viscosity_pa_s);
            }
            [Element::Spring { modulus_pa: spring_pa }, Element::Springpot { modulus_pa, time_s, order }]
            | [Element::Springpot { modulus_pa, time_s, order }, Element::Spring { modulus_pa: spring_pa }] => {
                check_order(*order)?;
                if order.is_constant(1.0) {
                    self.spectrum.add_kelvin_voigt(*spring_pa, *modulus_pa * *time_s);
                } else {
                    // E τᵅ = G tᵅ for the spring's E and the springpot's G and t.
                    let (spring_pa, order) = (T::of(*spring_pa), T::of(*order));
                    let ratio = (T::of(*modulus_pa) / spring_pa).pow(T::constant(1.0) / order);
                    let body = FractionalBody { modulus_pa: spring_pa, time_s: T::of(*time_s) * ratio, order };
                    body.add_to(&mut self.spectrum, self.window, self.accuracy);
                }
            }
            _ => match stieltjes::spectrum_of(whole) {
                Some(exact) => self.spectrum.extend(&exact),
                None => self.spectrum.extend(&branch_cut::spectrum_of(whole, self.window)?),
            },
        }
        Ok(())
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
