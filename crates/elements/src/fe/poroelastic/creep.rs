//! The creep of a porous body as a network: the law in series with one body for each term of the
//! pore spectrum.

use super::PoreSpectrum;
use base::error::{Error, Result};
use base::number::Dual;
use laws::rheology::Element;

impl PoreSpectrum {
    /// Returns elements in series whose creep compliance is the robot's compliance, divided by the
    /// undrained compliance at unit modulus. `law` holds the undrained body's elements in series.
    /// The mobility is k ≥ 0 (m²/(Pa·s)). Each term with the weight w and the area τ adds w/(G +
    /// (τ/k) s), with the law's modulus G at the Laplace variable s. This is the law in parallel
    /// with a dashpot of viscosity τ/k, both divided by w.
    ///
    /// At k = 0 the result is the elements of `law`, without a derivative with respect to k.
    ///
    /// # Errors
    /// [`Error::OutsideTrainedRange`] if the Poisson ratio lies outside the spectrum's range,
    /// [`Error::Numerical`] for a negative or infinite mobility.
    pub fn elements(
        &self,
        law: &[Element],
        mobility_m2_per_pa_s: Dual,
        drained_poisson_ratio: Dual,
    ) -> Result<Vec<Element>> {
        let mut elements = law.to_vec();
        if !(mobility_m2_per_pa_s.value >= 0.0 && mobility_m2_per_pa_s.value.is_finite()) {
            return Err(Error::numerical(
                format!("the mobility of the pore fluid is {} m²/(Pa·s)", mobility_m2_per_pa_s.value),
                "give a positive, finite mobility, or 0 for no pore flow",
            ));
        }
        let terms = self.terms(drained_poisson_ratio)?;
        if mobility_m2_per_pa_s.value > 0.0 {
            elements.extend(terms.into_iter().map(|term| {
                let inverse = Dual::ONE / term.weight;
                let viscosity_pa_s = inverse * term.area_m2 / mobility_m2_per_pa_s;
                let law = law.iter().map(|element| element.scaled(inverse)).collect();
                Element::Parallel(vec![Element::Series(law), Element::Dashpot { viscosity_pa_s }])
            }));
        }
        Ok(elements)
    }
}
