//! The gel's law in shear: a solvent and relaxation modes.

use laws::rheology::{Element, stieltjes};

/// A Maxwell mode with the modulus G and the relaxation time λ. It adds G λs/(1 + λs) to the shear
/// modulus at the Laplace variable s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelaxationMode {
    /// Modulus G in Pa.
    pub shear_modulus_pa: f64,
    /// Relaxation time λ in s; infinite for a mode that does not relax.
    pub time_s: f64,
}

/// Law of an incompressible gel in shear: a viscous solvent and relaxation modes, extended to large
/// strains.
#[derive(Debug, Clone, PartialEq)]
pub struct FiniteLaw {
    /// Viscosity of the solvent, in Pa·s.
    pub solvent_pa_s: f64,
    /// Relaxation modes of the polymer, whose stresses add up.
    pub modes: Vec<RelaxationMode>,
    /// Mobility of Giesekus's fluid, in [0, ½]; 0 is Oldroyd-B.
    pub mobility: f64,
    /// Shortest retardation time in s.
    pub fastest_s: f64,
}

impl FiniteLaw {
    /// Builds the law of an incompressible gel from elements in series. The elements give the creep
    /// compliance in tension, which is a third of that in shear. Returns `None` if an element is a
    /// springpot.
    pub fn new(elements: &[Element], mobility: f64) -> Option<Self> {
        let whole = Element::Series(elements.to_vec());
        let (relaxation, retardation) = (stieltjes::relaxation_of(&whole)?, stieltjes::spectrum_of(&whole)?);
        let mode = |[modulus_pa, rate_per_s]: &[f64; 2]| RelaxationMode {
            shear_modulus_pa: modulus_pa / 3.0,
            time_s: 1.0 / rate_per_s,
        };
        let retarded = retardation.modes.iter().map(|mode| mode.rate_per_s.value).reduce(f64::max);
        // A gel without retardation times responds linearly in time. The relaxation rates then give
        // the time scale.
        let relaxed = relaxation.modes.iter().map(|[_, rate_per_s]| *rate_per_s).fold(0.0, f64::max);
        Some(Self {
            solvent_pa_s: relaxation.viscosity_pa_s / 3.0,
            modes: relaxation.modes.iter().map(mode).collect(),
            mobility,
            fastest_s: 1.0 / retarded.unwrap_or(relaxed),
        })
    }
}

impl FiniteLaw {
    /// Converts the law to another Poisson ratio, with an unchanged creep compliance in tension.
    pub(super) fn of_poisson_ratio(&self, poisson_ratio: f64) -> Self {
        let by = 1.5 / (1.0 + poisson_ratio);
        let mode = |mode: &RelaxationMode| RelaxationMode { shear_modulus_pa: by * mode.shear_modulus_pa, ..*mode };
        Self { solvent_pa_s: by * self.solvent_pa_s, modes: self.modes.iter().map(mode).collect(), ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::number::Dual;
    use laws::rheology::BaseLaw;

    fn elements(law: BaseLaw, parameters: &[f64]) -> Vec<Element> {
        law.elements(&parameters.iter().copied().map(Dual::constant).collect::<Vec<Dual>>())
    }

    /// Checks that solvent and modes add up to 1/(3 s J(s)), with J(s) from its definition. The
    /// laws are three base laws, one that does not flow, and one with two equal bodies.
    #[test]
    fn solvent_and_modes_add_up_to_the_law() {
        let spring = |modulus_pa: f64| Element::Spring { modulus_pa: Dual::constant(modulus_pa) };
        let body = |modulus_pa: f64| Element::kelvin_voigt(Dual::constant(modulus_pa), Dual::constant(1.2));
        let dashpot = Element::Dashpot { viscosity_pa_s: Dual::constant(50.0) };
        let laws = [
            elements(BaseLaw::Lethersich, &[3.527, 1.402, 47.37]),
            elements(BaseLaw::Burgers, &[3.527, 1.402, 47.37, 20.0]),
            elements(BaseLaw::TwoElement, &[3.527, 1.402, 47.37, 5.0, 60.0]),
            vec![spring(10.0), body(3.0)],
            vec![body(3.0), body(3.0), dashpot],
        ];
        let compliance = |element: &Element, s: f64| match element {
            Element::Spring { modulus_pa } => 1.0 / modulus_pa.value,
            Element::Dashpot { viscosity_pa_s } => 1.0 / (viscosity_pa_s.value * s),
            Element::Parallel(both) => {
                let [Element::Spring { modulus_pa }, Element::Dashpot { viscosity_pa_s }] = &both[..] else {
                    panic!("{both:?}")
                };
                1.0 / (modulus_pa.value + viscosity_pa_s.value * s)
            }
            other => panic!("{other:?}"),
        };
        for elements in laws {
            let law = FiniteLaw::new(&elements, 0.0).expect("no springpot");
            for s in [1e-4, 0.03, 1.0, 20.0, 1e4] {
                let of_mode = |mode: &RelaxationMode| mode.shear_modulus_pa * s / (s + 1.0 / mode.time_s);
                let found = law.solvent_pa_s * s + law.modes.iter().map(of_mode).sum::<f64>();
                let exact = 1.0 / (3.0 * elements.iter().map(|element| compliance(element, s)).sum::<f64>());
                assert!((found / exact - 1.0).abs() < 1e-9, "{law:?} at {s}: {found} {exact}");
            }
        }
    }

    /// The expected values are those of Table I (physics §2).
    #[test]
    fn the_papers_law_is_its_oldroyd_b() {
        let law = FiniteLaw::new(&elements(BaseLaw::Lethersich, &[3.527, 1.402, 47.370]), 0.0).expect("no springpot");
        let [mode] = law.modes[..] else { panic!("{law:?}") };
        assert!((law.solvent_pa_s - 0.4539).abs() < 1e-4, "{law:?}");
        assert!((mode.time_s - 13.83).abs() < 0.01 && (mode.shear_modulus_pa - 1.1090).abs() < 1e-4, "{mode:?}");
    }
}
