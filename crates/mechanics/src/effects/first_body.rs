//! The first Kelvin–Voigt body of a law, whose spring and dashpot are E and c₁ in the equations of physics §5.

use crate::error::{Error, Result};
use crate::number::Dual;
use crate::rheology::{BaseLaw, Element};

/// Why an effect that refers to E cannot be added to a law without one.
pub(super) const NO_BODY: &str = "it has no Kelvin–Voigt body in series, whose modulus the effect refers to";

/// E in Pa of the first Kelvin–Voigt body in series.
///
/// # Errors
/// [`Error::Numerical`] where there is none; [`super::Effect::conflict`] refuses such a law before.
pub(super) fn young_modulus_pa(law: &[Element]) -> Result<Dual> {
    in_series(law).into_iter().find_map(body).map(|(modulus_pa, _)| modulus_pa).ok_or_else(no_body)
}

/// The first Kelvin–Voigt body in series itself.
///
/// # Errors
/// As [`young_modulus_pa`].
pub(super) fn first_body_mut(law: &mut [Element]) -> Result<&mut Element> {
    find_mut(law).ok_or_else(no_body)
}

fn find_mut(law: &mut [Element]) -> Option<&mut Element> {
    law.iter_mut().find_map(|element| match element {
        Element::Series(elements) => find_mut(elements),
        other => body(other).is_some().then_some(other),
    })
}

fn no_body() -> Error {
    Error::numerical("the law has no Kelvin–Voigt body in series", "leave the effect out, or use another base law")
}

/// Spring and damper of a Kelvin–Voigt body. A springpot is a damper, too, so that E stays what it was where one stands for c₁.
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

/// The elements that carry the whole stress: a series within the series is part of it.
pub(super) fn in_series(law: &[Element]) -> Vec<&Element> {
    law.iter()
        .flat_map(|element| match element {
            Element::Series(elements) => in_series(elements),
            other => vec![other],
        })
        .collect()
}

/// The elements of a base law at unit parameters, to look at which there are.
pub(super) fn elements_of(base: &BaseLaw) -> Vec<Element> {
    base.elements(&vec![Dual::ONE; base.parameters().len()])
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(young_modulus_pa(&law).unwrap().value, 3.0);
        let found = first_body_mut(&mut law).unwrap();
        assert_eq!(body(found), Some((3.0.into(), &dashpot(2.0))));
    }

    #[test]
    fn a_law_without_a_body_is_an_error() {
        let three = Element::Parallel(vec![spring(1.0), dashpot(2.0), dashpot(3.0)]);
        let mut law = vec![spring(1.0), dashpot(2.0), Element::Parallel(vec![spring(1.0), spring(2.0)]), three];
        assert!(young_modulus_pa(&law).unwrap_err().to_string().contains("no Kelvin–Voigt body"));
        assert!(first_body_mut(&mut law).is_err());
    }
}
