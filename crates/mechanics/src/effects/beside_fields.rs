//! What cannot stand beside an effect that changes the displacement field, and why: one place for the laws' and the effects' refusals.

use super::FieldModel;
use super::first_body::elements_of;
use crate::rheology::{BaseLaw, Element, RetardationSpectrum, TimeWindow};

/// Coefficients that change with time.
pub(super) const AGEING: &str = "the field is solved for a gel that stays what it is";
/// Springpots.
pub(super) const MEMORY: &str = "the memory of a springpot is not solved for beside a field that changes shape";
/// Springs in series.
pub(super) const WAVES: &str = "with mass, a spring in series lets waves through, which are not resolved";

/// Why an effect with a model of its field cannot be added to a base law, if it cannot.
pub(super) fn law_conflict(base: &BaseLaw, field: FieldModel) -> Option<&'static str> {
    let law = elements_of(base);
    if law.iter().any(has_springpot) {
        return Some(MEMORY);
    }
    (field == FieldModel::Inertia && gives_way_at_once(&law)).then_some(WAVES)
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
    RetardationSpectrum::<crate::number::Dual>::of(law, window).is_ok_and(|s| s.instantaneous_per_pa.value > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn springs_in_series_stand_beside_all_fields_but_mass() {
        for field in [FieldModel::Inertia, FieldModel::Slip, FieldModel::Pocket, FieldModel::PoreFlow] {
            assert_eq!(law_conflict(&BaseLaw::Lethersich, field), None);
            assert_eq!(law_conflict(&BaseLaw::TwoElement, field), None);
            let of_burgers = law_conflict(&BaseLaw::Burgers, field);
            assert_eq!(of_burgers, (field == FieldModel::Inertia).then_some(WAVES), "{field:?}");
        }
    }
}
