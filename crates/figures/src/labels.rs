//! Symbols and units of parameters for figures. They come from the law or effect with this parameter, otherwise from the parameter's name (formats §5).

use base::parameter::named;
use documents::extension::EquivalentEffects;
use documents::posterior::ModelSummary;
use laws::rheology::{BaseLaw, ExternalLaw};
use models::effects::{Library, parameter_named};

use super::number::format_significant;

/// Symbol and unit of a parameter, as figures show them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ParameterLabel {
    /// Short symbol such as `E`, or the parameter's name if it has no symbol.
    pub symbol: String,
    /// Unit such as `Pa`, or `–` if there is none.
    pub unit: String,
}

impl ParameterLabel {
    /// Label of an axis, such as `E (Pa)`.
    pub fn axis(&self) -> String {
        axis_label(&self.symbol, &self.unit)
    }
}

/// Title of a model: its law and its effects.
pub fn model_title(model: &ModelSummary) -> String {
    let law = BaseLaw::named(&model.base).map_or(model.base.as_str(), |law| law.title());
    let effects: String = model.effects.iter().map(|slug| format!(" + {slug}")).collect();
    format!("{law}{effects}")
}

/// Title of a model. Effects that have equivalents in a diagnosis are followed by "(or: …)".
pub fn model_title_with(model: &ModelSummary, equivalents: &[EquivalentEffects]) -> String {
    let law = model_title(&ModelSummary { effects: Vec::new(), ..model.clone() });
    format!("{law}{}", effects_with(&model.effects, equivalents))
}

/// Text " + effect" for every effect. The last effect of each list in `equivalents` is followed by "(or: …)" with its equivalents.
pub fn effects_with(effects: &[String], equivalents: &[EquivalentEffects]) -> String {
    let words = |slug: &String| {
        let is_last = |equivalent_effects: &&EquivalentEffects| equivalent_effects.effects.last() == Some(slug);
        let or = equivalents.iter().find(is_last).and_then(EquivalentEffects::alternative);
        format!(" + {slug}{}", or.map_or(String::new(), |or| format!(" ({or})")))
    };
    effects.iter().map(words).collect()
}

/// Text `symbol (unit)`. For a quantity without unit, `–` replaces the unit.
pub fn axis_label(symbol: &str, unit: &str) -> String {
    format!("{symbol} ({})", if unit.is_empty() { "–" } else { unit })
}

/// Units by suffix of a parameter's name. Longer suffixes come first, because `_pa_s` also ends in `_s`.
const UNITS: [(&str, &str); 14] = [
    ("_m2_per_pa_s", "m²/(Pa·s)"),
    ("_m_per_pa_s", "m/(Pa·s)"),
    ("_m_per_pa", "m/Pa"),
    ("_m_per_s", "m/s"),
    ("_per_pa", "1/Pa"),
    ("_per_s", "1/s"),
    ("_per_m", "1/m"),
    ("_pa_s", "Pa·s"),
    ("_pa", "Pa"),
    ("_um", "µm"),
    ("_mm", "mm"),
    ("_ms", "ms"),
    ("_s", "s"),
    ("_m", "m"),
];

/// Symbol and unit of the parameter `name`. If no model has this parameter, the symbol is the name.
pub fn parameter_label(name: &str) -> ParameterLabel {
    if let Some(spec) = named(name) {
        return ParameterLabel { symbol: spec.symbol.into(), unit: shown_unit(spec.unit) };
    }
    if let Some(spec) = ExternalLaw::parameter_named(name) {
        return external_parameter_label(name, spec.unit);
    }
    // Symbols of two effects may be equal, so they are made distinct.
    parameter_named(name).map_or_else(
        || label_from_name(name),
        |(effect, parameter)| ParameterLabel {
            symbol: format!("{} {}", effect.slug(), parameter.spec.symbol),
            unit: shown_unit(parameter.spec.unit),
        },
    )
}

/// Size of an effect, which is the value of its first parameter, with that parameter's unit in brackets.
pub fn effect_size(slug: &str, value: f64) -> String {
    let value = format_significant(value, 2);
    let unit = Library::default().get(slug).and_then(|effect| effect.parameters().first()).map(|first| first.spec.unit);
    match unit.filter(|unit| *unit != "1") {
        Some(unit) => format!("{value} ({})", shown_unit(unit)),
        None => value,
    }
}

fn shown_unit(unit: &str) -> String {
    if unit == "1" { "–".into() } else { unit.replace("Pa s", "Pa·s").replace("um", "µm") }
}

/// Symbol and unit of a parameter from another program. Its name may end in its unit.
fn external_parameter_label(name: &str, unit: &str) -> ParameterLabel {
    let ending = format!("_{}", unit.to_lowercase().replace('/', "_per_").replace(' ', "_"));
    let stem = name.strip_suffix(&ending).unwrap_or(name);
    ParameterLabel { symbol: stem.replace('_', " "), unit: shown_unit(unit).replace("m2", "m²").replace("m3", "m³") }
}

fn label_from_name(name: &str) -> ParameterLabel {
    let (stem, unit) = UNITS
        .iter()
        .find_map(|(suffix, unit)| name.strip_suffix(suffix).map(|stem| (stem, *unit)))
        .unwrap_or((name, "–"));
    ParameterLabel { symbol: stem.replace('_', " ").replace('.', ": "), unit: unit.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use models::effects::EFFECTS;

    #[test]
    fn names_of_the_contracts_have_symbols_and_units() {
        assert_eq!(parameter_label("young_modulus_pa").axis(), "E (Pa)");
        assert_eq!(parameter_label("viscosity_2_pa_s").axis(), "c₂ (Pa·s)");
        assert_eq!(parameter_label("noise_sd_um").axis(), "σ (µm)");
    }

    #[test]
    fn effects_give_their_own_symbols_and_units() {
        assert_eq!(parameter_label("actuator-lag.time_s").axis(), "actuator-lag τ (s)");
        assert_eq!(parameter_label("fractional-damping.order").axis(), "fractional-damping α (–)");
        assert_eq!(parameter_label("tracking-drift.velocity_m_per_s").axis(), "tracking-drift v (m/s)");
        assert_eq!(parameter_label("force-gradient.gradient_per_m").axis(), "force-gradient g (1/m)");
    }

    #[test]
    fn parameters_of_another_program_have_the_units_that_are_declared() {
        ExternalLaw::new(
            "http://labels",
            None,
            &[("cubic_pa_per_mm2".into(), "Pa/mm2".into()), ("rate".into(), "1/s".into())],
        );
        assert_eq!(parameter_label("cubic_pa_per_mm2").axis(), "cubic (Pa/mm²)");
        assert_eq!(parameter_label("rate").axis(), "rate (1/s)");
    }

    #[test]
    fn sizes_of_effects_have_units() {
        assert_eq!(effect_size("tracking-drift", 1.24e-9), "1.2×10⁻⁹ (m/s)");
        assert_eq!(effect_size("force-asymmetry", 0.0312), "0.031");
    }

    #[test]
    fn parameters_that_nobody_knows_are_labelled_by_their_names() {
        assert_eq!(parameter_label("thermal-drift.amplitude_m").axis(), "thermal-drift: amplitude (m)");
        assert_eq!(parameter_label("membrane.mobility_m2_per_pa_s").axis(), "membrane: mobility (m²/(Pa·s))");
        assert_eq!(parameter_label("membrane.order").axis(), "membrane: order (–)");
    }

    /// All labels are different, because one corner plot may contain any of them. The unit in an effect's table agrees with the suffix of its name.
    #[test]
    fn labels_of_effects_are_unique_and_agree_with_their_names() {
        let names = || EFFECTS.iter().flat_map(|effect| effect.parameters()).map(|parameter| parameter.spec.name);
        let labels: std::collections::BTreeSet<String> = names().map(|name| parameter_label(name).axis()).collect();
        assert_eq!(labels.len(), names().count());
        for name in names() {
            assert_eq!(parameter_label(name).unit, label_from_name(name).unit, "{name}");
        }
    }
}
