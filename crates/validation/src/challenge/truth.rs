//! What a challenge hides.

use serde::{Deserialize, Serialize};

use super::{Disturbance, NoiseKind, OutsideKind, Protocol};
use record::{Offset, OffsetDirection, Robot};

/// A thing to hide.
#[derive(Debug, Clone, PartialEq)]
pub enum Hidden {
    /// Nothing.
    Nothing,
    /// One effect of the library, or two, by slug.
    Effects(Vec<String>),
    /// Something outside the library.
    Outside(OutsideKind),
    /// A constant of the apparatus that is not what the experiment says. In a creep test of one body that is absorbed by the law, so that the right
    /// answer is `none`.
    Apparatus(ApparatusError),
}

/// A constant of the apparatus that is not what the experiment says.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum ApparatusError {
    /// The gel's Poisson ratio.
    PoissonRatio(f64),
    /// The robot's place: so far off the centre.
    OffCentre {
        /// Distance of the centres in m.
        distance_m: f64,
        /// Across the force, or along it.
        across: bool,
    },
}

impl ApparatusError {
    /// The robot where it is in truth.
    pub fn robot(self, stated: &Robot) -> Robot {
        let Self::OffCentre { distance_m, across } = self else { return *stated };
        let direction = if across { OffsetDirection::Across } else { OffsetDirection::Along };
        Robot { offset: Some(Offset { distance_m, direction }), ..*stated }
    }

    /// Those that are played: two Poisson ratios where 0.48 is stated, and a robot off the centre in both directions, which makes the gel 4 and 5 % stiffer.
    pub const ALL: [Self; 4] = [
        Self::PoissonRatio(0.45),
        Self::PoissonRatio(0.495),
        Self::OffCentre { distance_m: 6e-3, across: false },
        Self::OffCentre { distance_m: 8e-3, across: true },
    ];
}

/// A parameter and its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct NamedValue {
    /// Name, with unit.
    pub name: String,
    /// Value, in that unit.
    pub value: f64,
}

/// An effect of the library with its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct HiddenEffect {
    /// Slug.
    pub slug: String,
    /// Parameters in the effect's order; the first is its size.
    pub parameters: Vec<NamedValue>,
    /// Signal in standard deviations: the distance that the best fit without it leaves of noise-free data.
    pub signal_sigma: f64,
}

/// Everything that the data of a challenge were made from, but for the noise's random numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Truth {
    /// Protocol.
    pub protocol: Protocol,
    /// Noise.
    pub noise: NoiseKind,
    /// Whether the experiment states the noise; where it does not, the diagnosis has to estimate it.
    #[serde(default = "is_given")]
    pub is_noise_given: bool,
    /// E (Pa), c₁ (Pa·s), c₂ (Pa·s).
    pub law: [f64; 3],
    /// Effects of the library, none to two.
    pub effects: Vec<HiddenEffect>,
    /// Something outside the library.
    pub outside: Option<Disturbance>,
    /// A wrong constant of the apparatus.
    pub apparatus: Option<ApparatusError>,
    /// Signal of what is outside, as that of an effect.
    pub outside_sigma: Option<f64>,
    /// Effects that this experiment cannot tell from the hidden ones: the best fit with one to noise-free data stays below 4 standard deviations. The
    /// hidden ones are among them.
    pub ideal_class: Vec<String>,
    /// Effects that are not compared yet: their reduced models take long to build and were not needed to make the data. Opening the answer compares them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_compared: Vec<String>,
}

/// Answers that were sealed before there was a choice.
fn is_given() -> bool {
    true
}

impl Truth {
    /// Of data in which nothing is hidden.
    pub fn of_nothing(protocol: Protocol, noise: NoiseKind, law: [f64; 3]) -> Self {
        Self {
            protocol,
            noise,
            is_noise_given: is_given(),
            law,
            effects: Vec::new(),
            outside: None,
            apparatus: None,
            outside_sigma: None,
            ideal_class: Vec::new(),
            not_compared: Vec::new(),
        }
    }

    /// What a right diagnosis names: slugs joined by `+`, `none` or `outside`.
    pub fn label(&self) -> String {
        match (&self.outside, self.effects.as_slice()) {
            (Some(_), _) => "outside".into(),
            (None, []) => "none".into(),
            (None, effects) => joined(effects.iter().map(|effect| effect.slug.as_str())),
        }
    }

    /// More of it: the kind of what is outside, the wrong constant.
    pub fn detail(&self) -> String {
        match (&self.outside, self.apparatus) {
            (Some(outside), _) => outside.kind.name().into(),
            (None, Some(ApparatusError::PoissonRatio(ratio))) => format!("Poisson ratio {ratio}"),
            (None, Some(ApparatusError::OffCentre { distance_m, across })) => {
                let direction = if across { "across" } else { "along" };
                format!("robot {} mm off the centre, {direction} the force", 1e3 * distance_m)
            }
            (None, None) => self.label(),
        }
    }

    /// The smallest signal in standard deviations; `None` where nothing is hidden.
    pub fn signal_sigma(&self) -> Option<f64> {
        let of_effects = self.effects.iter().map(|effect| effect.signal_sigma);
        of_effects.chain(self.outside_sigma).min_by(f64::total_cmp)
    }
}

/// Slugs in alphabetical order, joined.
pub(super) fn joined<'a>(slugs: impl Iterator<Item = &'a str>) -> String {
    let mut slugs: Vec<&str> = slugs.collect();
    slugs.sort_unstable();
    slugs.join("+")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers that were sealed before effects could be left for later have no such list, and none is written where there is nothing to list.
    #[test]
    fn a_truth_with_nothing_left_to_compare_is_written_as_ever() {
        let truth = Truth::of_nothing(Protocol::Paper, NoiseKind::White, [1.0, 2.0, 3.0]);
        let text = serde_json::to_string(&truth).expect("JSON");
        assert!(text.ends_with("\"outside_sigma\":null,\"ideal_class\":[]}"), "{text}");
        assert_eq!(serde_json::from_str::<Truth>(&text).expect("a truth"), truth);
        let late = Truth { not_compared: vec!["inertia".into()], ..truth };
        let text = serde_json::to_string(&late).expect("JSON");
        assert_eq!(serde_json::from_str::<Truth>(&text).expect("a truth"), late);
    }
}
