//! What cannot stand beside an effect that changes the displacement field, and why: one place for the laws' and the effects' refusals.

use super::field::SPRINGPOTS;
use super::first_body::{body, elements_of, in_series};
use laws::rheology::{BaseLaw, Element, RetardationSpectrum, TimeWindow};

/// Coefficients that change with time.
pub(super) const AGEING: &str = "the field is solved for a gel that stays what it is";
/// Springpots that stand for a dashpot.
pub(super) const MEMORY: &str =
    "a springpot is not looked for beside a field that changes shape; write it into the law (--base)";
/// Springs in series.
pub(super) const WAVES: &str = "with mass, a spring in series lets waves through, which are not resolved";

/// Why mass or large strains cannot be added to a base law with springpots, if they cannot.
pub(super) fn memory(base: &BaseLaw) -> Option<&'static str> {
    elements_of(base).iter().any(has_springpot).then_some(SPRINGPOTS)
}

/// Why mass cannot be added to a base law beside that, if it cannot.
pub(super) fn waves(base: &BaseLaw) -> Option<&'static str> {
    gives_way_at_once(&elements_of(base)).then_some(WAVES)
}

fn has_springpot(element: &Element) -> bool {
    match element {
        Element::Springpot { .. } => true,
        Element::Series(parts) | Element::Parallel(parts) => parts.iter().any(has_springpot),
        _ => false,
    }
}

fn gives_way_at_once(law: &[Element]) -> bool {
    // Unit parameters, so that any times around one second serve.
    let window = TimeWindow { shortest_s: 1e-3, longest_s: 1e3 };
    RetardationSpectrum::<base::number::Dual>::of(law, window).is_ok_and(|s| s.instantaneous_per_pa.value > 0.0)
}

/// Why a base law cannot have a body that is not linear, if it cannot: it must be Kelvin–Voigt bodies, springs and one dashpot in series.
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
            assert_eq!(waves(&base), lets_waves_through.then_some(WAVES), "{base:?}");
        }
    }
}
