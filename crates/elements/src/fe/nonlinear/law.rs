//! Bodies of a nonlinear gel. They are in series, and one of them is nonlinear (physics §2, §5).

use base::error::{Error, Result};
use base::number::{Dual, PointScalar};
use laws::rheology::Element;
use laws::stages::Nonlinearity;

/// A Kelvin–Voigt body: its strain ε under a stress s obeys τ ε̇ + ε = C s, with the compliance C
/// and the retardation time τ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Retarded<N> {
    pub compliance_per_pa: N,
    pub time_s: N,
}

/// Bodies of a law in series. Each bears the full stress.
#[derive(Debug, Clone, PartialEq)]
pub struct Bodies<N> {
    /// Young's modulus of the first Kelvin–Voigt body.
    pub modulus_pa: N,
    /// Viscosity of the first Kelvin–Voigt body.
    pub viscosity_1_pa_s: N,
    /// Viscosity of the dashpot in series.
    pub viscosity_2_pa_s: N,
    /// Total compliance of the springs in series.
    pub instantaneous_per_pa: N,
    /// Further Kelvin–Voigt bodies, which are linear.
    pub retarded: Vec<Retarded<N>>,
    pub nonlinearity: Nonlinearity<N>,
}

impl<N: PointScalar> Bodies<N> {
    /// Extracts the bodies of a nonlinear law from its elements in series.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the elements are not Kelvin–Voigt bodies, springs and one dashpot in
    /// series, or if a value lies outside its support.
    pub fn new(law: &[Element], nonlinearity: Nonlinearity<Dual>) -> Result<Self> {
        nonlinearity.check()?;
        let bodies = Self::of_elements(law, nonlinearity)?;
        let sizes = [bodies.modulus_pa, bodies.viscosity_1_pa_s, bodies.viscosity_2_pa_s];
        let positive = |n: &N| n.value() > 0.0 && n.value().is_finite();
        let not_negative = |n: N| n.value() >= 0.0 && n.value().is_finite();
        let good = sizes.iter().all(positive)
            && not_negative(bodies.instantaneous_per_pa)
            && bodies.retarded.iter().all(|body| not_negative(body.compliance_per_pa) && positive(&body.time_s));
        if !good {
            let values = [sizes[0], sizes[1], sizes[2]].map(PointScalar::value);
            return Err(Error::numerical(
                format!(
                    "the modulus and viscosities of the law are {values:?}; one of its bodies is without resistance, or rigid"
                ),
                "give positive, finite parameters",
            ));
        }
        Ok(bodies)
    }

    fn of_elements(law: &[Element], nonlinearity: Nonlinearity<Dual>) -> Result<Self> {
        let (mut first, mut dashpot, mut retarded) = (None, None, Vec::new());
        let mut instantaneous_per_pa = N::constant(0.0);
        for element in law {
            match element {
                Element::Spring { modulus_pa } => instantaneous_per_pa += N::constant(1.0) / N::from_dual(*modulus_pa),
                Element::Compliance { compliance_per_pa } => instantaneous_per_pa += N::from_dual(*compliance_per_pa),
                Element::Dashpot { viscosity_pa_s } if dashpot.is_none() => {
                    dashpot = Some(N::from_dual(*viscosity_pa_s))
                }
                Element::Retarded { compliance_per_pa, time_s } => {
                    let (compliance_per_pa, time_s) = (N::from_dual(*compliance_per_pa), N::from_dual(*time_s));
                    retarded.push(Retarded { compliance_per_pa, time_s });
                }
                Element::Parallel(parts) => match parts.as_slice() {
                    [Element::Spring { modulus_pa }, Element::Dashpot { viscosity_pa_s }]
                    | [Element::Dashpot { viscosity_pa_s }, Element::Spring { modulus_pa }] => {
                        let (modulus, viscosity) = (N::from_dual(*modulus_pa), N::from_dual(*viscosity_pa_s));
                        if first.is_none() {
                            first = Some((modulus, viscosity));
                        } else {
                            let compliance_per_pa = N::constant(1.0) / modulus;
                            retarded.push(Retarded { compliance_per_pa, time_s: viscosity / modulus });
                        }
                    }
                    _ => return Err(unsuited("a group that is not a Kelvin–Voigt body")),
                },
                Element::Dashpot { .. } => return Err(unsuited("two dashpots in series")),
                Element::Springpot { .. } => return Err(unsuited("a springpot")),
                Element::Series(_) => return Err(unsuited("a series within the series")),
            }
        }
        let (modulus_pa, viscosity_1_pa_s) = first.ok_or_else(|| unsuited("no Kelvin–Voigt body"))?;
        Ok(Self {
            modulus_pa,
            viscosity_1_pa_s,
            viscosity_2_pa_s: dashpot.ok_or_else(|| unsuited("no dashpot"))?,
            instantaneous_per_pa,
            retarded,
            nonlinearity: nonlinearity.of(),
        })
    }

    /// Number of bodies that have a strain history: the first Kelvin–Voigt body, the dashpot, and
    /// the further Kelvin–Voigt bodies.
    pub fn n_histories(&self) -> usize {
        2 + self.retarded.len()
    }

    /// Shortest retardation time (s) if the nonlinear body has the equivalent strain `equivalent`.
    /// A stiffened spring relaxes faster, according to its tangent modulus.
    pub fn fastest_s(&self, equivalent: f64) -> f64 {
        let times = self.retarded.iter().filter(|body| body.compliance_per_pa.value() > 0.0);
        let stiffened = match self.nonlinearity {
            Nonlinearity::StrainStiffening { coefficient } => 1.0 + 3.0 * coefficient.value() * equivalent * equivalent,
            _ => 1.0,
        };
        let first_s = self.viscosity_1_pa_s.value() / (self.modulus_pa.value() * stiffened);
        times.map(|body| body.time_s.value()).fold(first_s, f64::min)
    }
}

fn unsuited(what: &str) -> Error {
    Error::numerical(
        format!("the law has {what}; a nonlinear law must be Kelvin–Voigt bodies, springs and one dashpot in series"),
        "use the base law lethersich, burgers or two-element, or remove the nonlinear effect",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use laws::rheology::BaseLaw;
    use laws::stages::YIELD_SMOOTHING;

    const P: [f64; 5] = [3.5, 1.4, 47.0, 8.0, 30.0];

    fn bodies(base: BaseLaw, nonlinearity: Nonlinearity) -> Result<Bodies<f64>> {
        let parameters = P.map(Dual::constant);
        Bodies::new(&base.elements(&parameters[..base.parameters().len()]), nonlinearity.constant())
    }

    #[test]
    fn named_laws_are_taken_apart() {
        let stiffening = Nonlinearity::StrainStiffening { coefficient: 0.3 };
        let burgers = bodies(BaseLaw::Burgers, stiffening).unwrap();
        assert_eq!((burgers.modulus_pa, burgers.viscosity_1_pa_s, burgers.viscosity_2_pa_s), (3.5, 1.4, 47.0));
        assert_eq!((burgers.instantaneous_per_pa, burgers.n_histories()), (0.125, 2));
        assert!((burgers.fastest_s(0.0) - 0.4).abs() < 1e-15);
        assert!((burgers.fastest_s(2.0) - 0.4 / 4.6).abs() < 1e-15);
        let two = bodies(BaseLaw::TwoElement, stiffening).unwrap();
        assert_eq!(two.retarded, [Retarded { compliance_per_pa: 0.125, time_s: 3.75 }]);
        assert_eq!(two.n_histories(), 3);
    }

    #[test]
    fn laws_that_are_no_series_of_kelvin_voigt_bodies_are_refused() {
        let springpot = Element::Springpot { modulus_pa: 1.0.into(), time_s: 1.0.into(), order: 0.5.into() };
        let body = Element::kelvin_voigt(1.0.into(), 2.0.into());
        let dashpot = Element::Dashpot { viscosity_pa_s: 3.0.into() };
        let fractional = Element::Parallel(vec![Element::Spring { modulus_pa: 1.0.into() }, springpot.clone()]);
        let yields = Nonlinearity::YieldStress { stress_pa: 1.0, smoothing: YIELD_SMOOTHING }.constant();
        for (law, word) in [
            (vec![body.clone(), dashpot.clone(), springpot], "springpot"),
            (vec![fractional, dashpot.clone()], "group"),
            (vec![body.clone(), dashpot.clone(), dashpot.clone()], "two dashpots"),
            (vec![dashpot.clone()], "no Kelvin–Voigt body"),
            (vec![body.clone()], "no dashpot"),
            (vec![Element::Series(vec![body, dashpot])], "series within"),
        ] {
            let message = Bodies::<f64>::of_elements(&law, yields).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains("what to do"), "{message}");
        }
    }

    #[test]
    fn numbers_outside_their_support_are_refused() {
        for nonlinearity in [
            Nonlinearity::StrainStiffening { coefficient: -0.1 },
            Nonlinearity::StrainStiffening { coefficient: f64::NAN },
            Nonlinearity::ShearThinning { index: 1.1, reference_stress_pa: 1.0 },
            Nonlinearity::ShearThinning { index: 0.0, reference_stress_pa: 1.0 },
            Nonlinearity::ShearThinning { index: 0.5, reference_stress_pa: 0.0 },
            Nonlinearity::YieldStress { stress_pa: -1.0, smoothing: 0.1 },
            Nonlinearity::YieldStress { stress_pa: 1.0, smoothing: 0.0 },
        ] {
            let refused = bodies(BaseLaw::Lethersich, nonlinearity);
            assert!(matches!(refused, Err(Error::Numerical { .. })), "{nonlinearity:?}");
        }
        let zero = [3.0, 0.0, 40.0].map(Dual::constant);
        let linear = Nonlinearity::StrainStiffening { coefficient: 0.0 }.constant();
        let refused = Bodies::<f64>::new(&BaseLaw::Lethersich.elements(&zero), linear);
        assert!(refused.unwrap_err().to_string().contains("without resistance"));
    }
}
