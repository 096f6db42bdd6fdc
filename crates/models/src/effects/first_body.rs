//! Definition of the modulus E and the viscosity c₁ (physics §5) for any law.
//!
//! If the law has Kelvin–Voigt bodies in series, E and c₁ are the spring and the dashpot of the first body. For other laws, E is the
//! modulus at the length T of a hold: the ratio of stress to strain if the strain grows with time t as e^{t/T}. Every network of springs,
//! dashpots and springpots has such a modulus. c₁ is then the first dashpot, in the order in which the law is written.

use super::hold_s;
use base::number::Dual;
use laws::rheology::{BaseLaw, Element};
use record::CharacteristicSizes;

/// Returns the reference modulus of a law in Pa. It is the spring of the first Kelvin–Voigt body in series, or else the law's modulus at
/// the length of a hold. Elements that effects add in series do not count, so that effects may be applied in any order.
pub(super) fn reference_modulus_pa(law: &[Element], scales: &CharacteristicSizes) -> Dual {
    let filter = in_series(law)
        .into_iter()
        .filter(|element| !matches!(element, Element::Compliance { .. } | Element::Retarded { .. }));
    let elements: Vec<&Element> = filter.collect();
    let of_body = elements.iter().find_map(|element| body(element)).map(|(modulus_pa, _)| modulus_pa);
    of_body.unwrap_or_else(|| {
        let hold_s = hold_s(scales);
        let compliance_per_pa =
            elements.iter().fold(Dual::ZERO, |sum, part| sum + Dual::ONE / part.operator_pa(hold_s));
        Dual::ONE / compliance_per_pa
    })
}

/// First Kelvin–Voigt body in series whose damper (dashpot or springpot) satisfies `is_suited`.
pub(super) fn first_body_mut(law: &mut [Element], is_suited: fn(&Element) -> bool) -> Option<&mut Element> {
    law.iter_mut().find_map(|element| match element {
        Element::Series(elements) => first_body_mut(elements, is_suited),
        other => body(other).is_some_and(|(_, damper)| is_suited(damper)).then_some(other),
    })
}

/// First spring, dashpot or springpot, in the order in which the law is written, that satisfies `is_suited`.
pub(super) fn first_element_mut(law: &mut [Element], is_suited: fn(&Element) -> bool) -> Option<&mut Element> {
    law.iter_mut().find_map(|element| match element {
        Element::Series(elements) | Element::Parallel(elements) => first_element_mut(elements, is_suited),
        other => is_suited(other).then_some(other),
    })
}

/// Returns `true` if an element is a dashpot.
pub(super) fn is_dashpot(element: &Element) -> bool {
    matches!(element, Element::Dashpot { .. })
}

/// Returns the spring's modulus (Pa) and the damper of a Kelvin–Voigt body; `None` for other elements. A springpot counts as a damper, so
/// that the modulus is unchanged if a springpot replaces the dashpot.
pub(super) fn body(element: &Element) -> Option<(Dual, &Element)> {
    let Element::Parallel(parts) = element else { return None };
    match parts.as_slice() {
        [Element::Spring { modulus_pa }, damper @ (Element::Dashpot { .. } | Element::Springpot { .. })]
        | [damper @ (Element::Dashpot { .. } | Element::Springpot { .. }), Element::Spring { modulus_pa }] => {
            Some((*modulus_pa, damper))
        }
        _ => None,
    }
}

/// Elements in series, each of which carries the whole stress. A nested series is replaced by its elements.
pub(super) fn in_series(law: &[Element]) -> Vec<&Element> {
    law.iter()
        .flat_map(|element| match element {
            Element::Series(elements) => in_series(elements),
            other => vec![other],
        })
        .collect()
}

/// Elements of a base law with all parameters equal to 1, which show its structure.
pub(super) fn elements_of(base: &BaseLaw) -> Vec<Element> {
    base.elements(&vec![Dual::ONE; base.parameters().len()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    fn spring(modulus_pa: f64) -> Element {
        Element::Spring { modulus_pa: modulus_pa.into() }
    }

    fn dashpot(viscosity_pa_s: f64) -> Element {
        Element::Dashpot { viscosity_pa_s: viscosity_pa_s.into() }
    }

    #[test]
    fn the_first_body_is_found_in_either_order_and_inside_a_series() {
        let inner = Element::Series(vec![spring(7.0), Element::Parallel(vec![dashpot(2.0), spring(3.0)])]);
        let mut law = vec![dashpot(1.0), inner, Element::kelvin_voigt(5.0.into(), 6.0.into())];
        assert_eq!(reference_modulus_pa(&law, &SCALES).value, 3.0);
        let found = first_body_mut(&mut law, is_dashpot).unwrap();
        assert_eq!(body(found), Some((3.0.into(), &dashpot(2.0))));
    }

    /// Checks the reference modulus E of a law without a Kelvin–Voigt body. For a hold of 5 s, 1/E = 1/1 + 5/2 + 1/(1 + 2) + 1/(1 + 2/5 +
    /// 3/5). Elements that effects add do not change E.
    #[test]
    fn a_law_without_a_body_has_its_modulus_at_the_time_of_a_hold() {
        let three = Element::Parallel(vec![spring(1.0), dashpot(2.0), dashpot(3.0)]);
        let mut law = vec![spring(1.0), dashpot(2.0), Element::Parallel(vec![spring(1.0), spring(2.0)]), three];
        let expected = 1.0 / (1.0 + 2.5 + 1.0 / 3.0 + 0.5);
        assert!((reference_modulus_pa(&law, &SCALES).value / expected - 1.0).abs() < 1e-15);
        assert!(first_body_mut(&mut law, is_dashpot).is_none());
        assert_eq!(first_element_mut(&mut law, is_dashpot), Some(&mut dashpot(2.0)));
        law.push(Element::Retarded { compliance_per_pa: 0.4.into(), time_s: Dual::ONE });
        law.push(Element::Compliance { compliance_per_pa: 0.4.into() });
        assert!((reference_modulus_pa(&law, &SCALES).value / expected - 1.0).abs() < 1e-15);
    }

    /// Checks a springpot of modulus G at 1 s and order α. Its modulus at the time T is G (1 s/T)^α. Derivatives by G and by α
    /// are checked, too.
    #[test]
    fn a_springpots_modulus_moves_with_its_parameters() {
        let law = |modulus_pa: Dual, order: Dual| [Element::Springpot { modulus_pa, time_s: Dual::ONE, order }];
        let expected = 3.0 * 0.2_f64.powf(0.4);
        let by_modulus = reference_modulus_pa(&law(Dual::variable(3.0), 0.4.into()), &SCALES);
        assert!((by_modulus.value - expected).abs() < 1e-15 && (by_modulus.derivative - expected / 3.0).abs() < 1e-15);
        let by_order = reference_modulus_pa(&law(3.0.into(), Dual::variable(0.4)), &SCALES);
        assert!((by_order.derivative - expected * 0.2_f64.ln()).abs() < 1e-14);
    }
}
