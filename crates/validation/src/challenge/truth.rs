//! The truth that a challenge's data are simulated from.

use serde::{Deserialize, Serialize};

use super::{Disturbance, DisturbanceKind, NoiseKind, Protocol};
use record::{Offset, OffsetDirection, Robot};

/// Effects or errors that a challenge hides from the diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub enum HiddenPhysics {
    /// Nothing is hidden.
    Nothing,
    /// Slugs of one or two effects of the library.
    Effects(Vec<String>),
    /// A disturbance by physics outside the library.
    Outside(DisturbanceKind),
    /// A wrong constant of the apparatus. In a creep test of one body the law absorbs it, so `none` is the right verdict.
    Apparatus(ApparatusError),
}

/// A constant of the apparatus whose true value differs from the value that the experiment states.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum ApparatusError {
    /// True Poisson ratio of the gel.
    PoissonRatio(f64),
    /// The robot's centre is not at the vitreous's centre.
    OffCentre {
        /// Distance between the centres, in m.
        distance_m: f64,
        /// True if the offset is across the force, false if it is along it.
        across: bool,
    },
}

impl ApparatusError {
    /// Returns the robot at its true place, given the robot as the experiment states it.
    pub fn robot(self, stated: &Robot) -> Robot {
        let Self::OffCentre { distance_m, across } = self else { return *stated };
        let direction = if across { OffsetDirection::Across } else { OffsetDirection::Along };
        Robot { offset: Some(Offset { distance_m, direction }), ..*stated }
    }

    /// Errors that challenges use: two Poisson ratios instead of the stated 0.48, and offsets of the robot in both directions. The offsets make the gel 4 and 5
    /// % stiffer.
    pub const ALL: [Self; 4] = [
        Self::PoissonRatio(0.45),
        Self::PoissonRatio(0.495),
        Self::OffCentre { distance_m: 6e-3, across: false },
        Self::OffCentre { distance_m: 8e-3, across: true },
    ];
}

/// A parameter's name and value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct NamedValue {
    /// Name of the parameter, with its unit.
    pub name: String,
    /// Value, in the unit of the name.
    pub value: f64,
}

/// A hidden effect of the library with its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct HiddenEffect {
    /// Slug of the effect.
    pub slug: String,
    /// Parameters in the effect's order. The first one is its size.
    pub parameters: Vec<NamedValue>,
    /// Distance between the noise-free data and the best fit without the effect, in noise standard deviations.
    pub signal_sigma: f64,
}

/// Everything that determines a challenge's data, except the random numbers of the noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Truth {
    /// Protocol of the experiment.
    pub protocol: Protocol,
    /// Kind of noise in the experiment's data.
    pub noise: NoiseKind,
    /// True if the experiment states the noise. Otherwise the diagnosis estimates it.
    #[serde(default = "is_given")]
    pub is_noise_given: bool,
    /// Parameters of the law: E (Pa), c₁ (Pa·s), c₂ (Pa·s).
    pub law: [f64; 3],
    /// Hidden effects of the library, at most two.
    pub effects: Vec<HiddenEffect>,
    /// Hidden disturbance by physics outside the library.
    pub outside: Option<Disturbance>,
    /// Hidden error of a constant of the apparatus.
    pub apparatus: Option<ApparatusError>,
    /// Signal of the disturbance, in noise standard deviations.
    pub outside_sigma: Option<f64>,
    /// Effects that this experiment cannot distinguish from the hidden effects, which are included. The best fit of such an effect to noise-free data is less
    /// than 4 noise standard deviations away.
    pub ideal_class: Vec<String>,
    /// Effects that have not been compared with the hidden effects yet, because their surrogates take long to build. `challenge reveal` compares them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_compared: Vec<String>,
}

/// Value of `is_noise_given` for sealed answers without this field.
fn is_given() -> bool {
    true
}

impl Truth {
    /// Returns a truth with this law in which nothing is hidden.
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

    /// Name of the truth in tables: slugs joined by `+`, `none` or `outside`.
    pub fn label(&self) -> String {
        match (&self.outside, self.effects.as_slice()) {
            (Some(_), _) => "outside".into(),
            (None, []) => "none".into(),
            (None, effects) => joined(effects.iter().map(|effect| effect.slug.as_str())),
        }
    }

    /// Text that details the truth: the kind of disturbance, or the wrong constant.
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

    /// Smallest signal of the hidden effects or disturbance, in noise standard deviations; `None` if nothing is hidden.
    pub fn signal_sigma(&self) -> Option<f64> {
        let of_effects = self.effects.iter().map(|effect| effect.signal_sigma);
        of_effects.chain(self.outside_sigma).min_by(f64::total_cmp)
    }
}

/// Joins slugs by `+`, in alphabetical order.
pub(super) fn joined<'a>(slugs: impl Iterator<Item = &'a str>) -> String {
    let mut slugs: Vec<&str> = slugs.collect();
    slugs.sort_unstable();
    slugs.join("+")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sealed answers without the list `not_compared` can be read. An empty list is not written.
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
