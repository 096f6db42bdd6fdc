//! Retardation spectra of springs, dashpots, springpots and networks of them.

use super::fractional::{FractionalBody, Springpot};
use super::spectrum::check_order;
use super::{Accuracy, Element, RetardationSpectrum, SpectralMode, TimeWindow, branch_cut, stieltjes};
use base::error::{Error, Result};
use base::number::{Dual, PointScalar};

impl RetardationSpectrum {
    /// Returns the retardation spectrum of elements in series, with [`Accuracy::Fine`].
    ///
    /// # Errors
    /// Errors of [`Self::of_law_with_accuracy`].
    pub fn of_law(law: &[Element], window: TimeWindow) -> Result<Self> {
        Self::of_law_with_accuracy(law, window, Accuracy::Fine)
    }
}

impl<T: PointScalar> RetardationSpectrum<T> {
    /// Returns the retardation spectrum of elements in series. If the number type `T` has derivatives, the spectrum carries the
    /// derivatives of the elements' parameters. Values have equal bits with and without derivatives.
    ///
    /// The spectrum is exact for springs, dashpots and networks of them. For springpots it has the given accuracy at times inside
    /// the window, also if responses are superposed. At times before the window, modes that are faster than the window act as
    /// instantaneous compliance.
    ///
    /// # Errors
    /// [`Error::Numerical`] if a network's spectrum cannot be computed, or the window's times are not positive and finite.
    pub fn of_law_with_accuracy(law: &[Element], window: TimeWindow, accuracy: Accuracy) -> Result<Self> {
        let TimeWindow { shortest_s, longest_s } = window;
        if !(shortest_s > 0.0 && longest_s >= shortest_s && longest_s.is_finite()) {
            return Err(Error::numerical(
                format!("a spectrum cannot cover times from {shortest_s} s to {longest_s} s"),
                "give positive, finite times, the shortest first",
            ));
        }
        let mut builder = Builder { spectrum: Self::empty(), window, accuracy };
        law.iter().try_for_each(|element| builder.add(element))?;
        let spectrum = builder.spectrum;
        if !(spectrum.instantaneous_per_pa.value().is_finite() && spectrum.fluidity_per_pa_s.value().is_finite()) {
            return Err(Error::numerical(
                format!("the creep compliance of {law:?} is not finite"),
                "give physically possible moduli, viscosities and times",
            ));
        }
        Ok(spectrum)
    }
}

/// Retardation spectrum under construction, to which elements in series are added.
struct Builder<T> {
    spectrum: RetardationSpectrum<T>,
    window: TimeWindow,
    accuracy: Accuracy,
}

impl<T: PointScalar> Builder<T> {
    fn add(&mut self, element: &Element) -> Result<()> {
        let inverse = |number: Dual| T::constant(1.0) / T::from_dual(number);
        let spectrum = &mut self.spectrum;
        match element {
            Element::Spring { modulus_pa } => spectrum.instantaneous_per_pa += inverse(*modulus_pa),
            Element::Dashpot { viscosity_pa_s } => spectrum.fluidity_per_pa_s += inverse(*viscosity_pa_s),
            Element::Compliance { compliance_per_pa } => {
                spectrum.instantaneous_per_pa += T::from_dual(*compliance_per_pa)
            }
            Element::Retarded { compliance_per_pa, time_s } => spectrum.modes.push(SpectralMode {
                compliance_per_pa: T::from_dual(*compliance_per_pa),
                rate_per_s: inverse(*time_s),
            }),
            Element::Springpot { modulus_pa, time_s, order } => {
                check_order(*order)?;
                let (modulus_pa, time_s) = (T::from_dual(*modulus_pa), T::from_dual(*time_s));
                if order.is_constant(1.0) {
                    spectrum.fluidity_per_pa_s += T::constant(1.0) / (modulus_pa * time_s);
                } else {
                    let order = T::from_dual(*order);
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
                return Err(Error::numerical("a list of parallel elements is empty", "write at least one element"));
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
                    // The time τ of this fractional Kelvin–Voigt body follows from E τᵅ = G tᵅ. E is the spring's modulus. G, t
                    // and α are the springpot's modulus, time and order.
                    let (spring_pa, order) = (T::from_dual(*spring_pa), T::from_dual(*order));
                    let ratio = (T::from_dual(*modulus_pa) / spring_pa).pow(T::constant(1.0) / order);
                    let body = FractionalBody { modulus_pa: spring_pa, time_s: T::from_dual(*time_s) * ratio, order };
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
