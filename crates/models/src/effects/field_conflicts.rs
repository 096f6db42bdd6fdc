//! Messages that explain why an effect or a law cannot be combined with an effect on the displacement field.

use super::field::SPRINGPOTS;
use super::first_body::{body, elements_of, in_series};
use laws::rheology::{BaseLaw, Element, RetardationSpectrum, TimeWindow};

/// Reason why an effect that changes the gel's properties over time cannot be combined with a computed displacement field.
pub(super) const AGEING: &str = "the field is computed for a gel whose properties are constant";
/// Reason why an effect that replaces a dashpot by a springpot cannot be combined with a computed displacement field.
pub(super) const MEMORY: &str = "a springpot cannot be added beside an effect on the displacement field; write the springpot into the base law (--base)";
/// Reason why a law with a spring in series cannot be combined with an effect that has mass.
pub(super) const WAVES: &str = "with mass, a spring in series transmits waves, which the model does not resolve";

/// Reason why mass or large strains cannot be added to a base law with springpots; `None` if they can.
pub(super) fn memory(base: &BaseLaw) -> Option<&'static str> {
    elements_of(base).iter().any(has_springpot).then_some(SPRINGPOTS)
}

/// Reason why mass cannot be added to a base law with an instantaneous response; `None` if it can.
pub(super) fn wave_conflict(base: &BaseLaw) -> Option<&'static str> {
    has_instantaneous_response(&elements_of(base)).then_some(WAVES)
}

fn has_springpot(element: &Element) -> bool {
    match element {
        Element::Springpot { .. } => true,
        Element::Series(parts) | Element::Parallel(parts) => parts.iter().any(has_springpot),
        _ => false,
    }
}

fn has_instantaneous_response(law: &[Element]) -> bool {
    // All parameters of the law are 1, so any window around one second is suitable.
    let window = TimeWindow { shortest_s: 1e-3, longest_s: 1e3 };
    RetardationSpectrum::<base::number::Dual>::of_law(law, window).is_ok_and(|s| s.instantaneous_per_pa.value > 0.0)
}

/// Reason why an element of the base law cannot be nonlinear; `None` if it can. The law must consist of Kelvin–Voigt bodies,
/// springs and one dashpot in series.
pub(super) fn nonlinear_conflict(base: &BaseLaw) -> Option<&'static str> {
    let law = elements_of(base);
    let (mut bodies, mut dashpots, mut others) = (0, 0, 0);
    for element in in_series(&law) {
        match (element, body(element)) {
            (_, Some((_, Element::Dashpot { .. }))) => bodies += 1,
            (Element::Dashpot { .. }, _) => dashpots += 1,
            (Element::Spring { .. }, _) => {}
            _ => others += 1,
        }
    }
    let is_suited = bodies > 0 && dashpots == 1 && others == 0 && law.len() == in_series(&law).len();
    (!is_suited).then_some("its elements must be Kelvin–Voigt bodies, springs and one dashpot in series")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn springs_in_series_stand_beside_all_fields_but_mass() {
        for (base, lets_waves_through) in
            [(BaseLaw::Lethersich, false), (BaseLaw::TwoElement, false), (BaseLaw::Burgers, true)]
        {
            assert_eq!(memory(&base), None);
            assert_eq!(wave_conflict(&base), lets_waves_through.then_some(WAVES), "{base:?}");
        }
    }
}
