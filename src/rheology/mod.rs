//! Springs, dashpots and their creep compliance (physics §2). Scalar: space enters only through [`crate::fe`].

mod branch_cut;
mod element;
mod fractional;
mod lumped;
mod mittag_leffler;
mod spectrum;
mod stieltjes;

pub use element::Element;
pub use mittag_leffler::mittag_leffler;
pub use spectrum::{OscillatingMode, RetardationSpectrum, SpectralMode, TimeWindow};

use crate::number::Dual;
use crate::parameter::{ParameterSpec, Support};

/// Creep compliance of a linear law as a sum of branches in series that all carry the stress s:
/// J(t) = J₀ + Σ aₘ (1 − exp(−t/τₘ)) + φ t.
#[derive(Debug, Clone, PartialEq)]
pub struct CreepCompliance {
    /// J₀ in 1/Pa: the springs in series.
    pub instantaneous_per_pa: f64,
    /// Kelvin–Voigt bodies in series.
    pub retarded: Vec<RetardedMode>,
    /// φ in 1/(Pa·s): the dashpots in series.
    pub fluidity_per_pa_s: f64,
}

/// One Kelvin–Voigt body: aₘ (1 − exp(−t/τₘ)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RetardedMode {
    /// aₘ in 1/Pa.
    pub compliance_per_pa: f64,
    /// τₘ in s.
    pub time_s: f64,
}

impl RetardedMode {
    fn kelvin_voigt(modulus_pa: f64, viscosity_pa_s: f64) -> Self {
        Self { compliance_per_pa: 1.0 / modulus_pa, time_s: viscosity_pa_s / modulus_pa }
    }
}

impl CreepCompliance {
    /// Of the Lethersich law at E (Pa), c₁ and c₂ (Pa·s).
    pub fn lethersich(parameters: &[f64]) -> Self {
        Self {
            instantaneous_per_pa: 0.0,
            retarded: vec![RetardedMode::kelvin_voigt(parameters[0], parameters[1])],
            fluidity_per_pa_s: 1.0 / parameters[2],
        }
    }

    /// J(t) in 1/Pa, for t ≥ 0; at t = 0 the limit from the right.
    pub fn at(&self, time_s: f64) -> f64 {
        let retarded: f64 = self.retarded.iter().map(|m| -m.compliance_per_pa * (-time_s / m.time_s).exp_m1()).sum();
        self.instantaneous_per_pa + retarded + self.fluidity_per_pa_s * time_s
    }
}

/// A constitutive law that a model starts from, before effects are added.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum BaseLaw {
    /// Kelvin–Voigt body in series with a dashpot: `young_modulus_pa`, `viscosity_1_pa_s`, `viscosity_2_pa_s`.
    #[default]
    Lethersich,
    /// Lethersich with a spring in series: adds `instantaneous_modulus_pa`.
    Burgers,
    /// Lethersich with a second Kelvin–Voigt body in series: adds `second_modulus_pa`, `second_viscosity_pa_s`.
    TwoElement,
}

const YOUNG_MODULUS: ParameterSpec = ParameterSpec::new("young_modulus_pa", "Pa", Support::POSITIVE);
const VISCOSITY_1: ParameterSpec = ParameterSpec::new("viscosity_1_pa_s", "Pa s", Support::POSITIVE);
const VISCOSITY_2: ParameterSpec = ParameterSpec::new("viscosity_2_pa_s", "Pa s", Support::POSITIVE);

/// Parameters of [`BaseLaw::Lethersich`].
pub const LETHERSICH: &[ParameterSpec] = &[YOUNG_MODULUS, VISCOSITY_1, VISCOSITY_2];
const BURGERS: &[ParameterSpec] =
    &[YOUNG_MODULUS, VISCOSITY_1, VISCOSITY_2, ParameterSpec::new("instantaneous_modulus_pa", "Pa", Support::POSITIVE)];
const TWO_ELEMENT: &[ParameterSpec] = &[
    YOUNG_MODULUS,
    VISCOSITY_1,
    VISCOSITY_2,
    ParameterSpec::new("second_modulus_pa", "Pa", Support::POSITIVE),
    ParameterSpec::new("second_viscosity_pa_s", "Pa s", Support::POSITIVE),
];

impl BaseLaw {
    /// The laws that have a name.
    pub const NAMED: [Self; 3] = [Self::Lethersich, Self::Burgers, Self::TwoElement];

    /// The law of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::NAMED.into_iter().find(|law| law.name() == name)
    }

    /// Name for people.
    pub fn title(self) -> &'static str {
        match self {
            Self::Lethersich => "Lethersich",
            Self::Burgers => "Burgers",
            Self::TwoElement => "two-element",
        }
    }

    /// Name in `model.toml` and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lethersich => "lethersich",
            Self::Burgers => "burgers",
            Self::TwoElement => "two-element",
        }
    }

    /// The law's parameters, in the order in which [`Self::elements`] takes them.
    pub fn parameters(self) -> &'static [ParameterSpec] {
        match self {
            Self::Lethersich => LETHERSICH,
            Self::Burgers => BURGERS,
            Self::TwoElement => TWO_ELEMENT,
        }
    }

    /// The law's elements in series at `parameters` (SI, the order of [`Self::parameters`]; all positive).
    pub fn elements(self, parameters: &[Dual]) -> Vec<Element> {
        let p = parameters;
        let mut elements = vec![Element::kelvin_voigt(p[0], p[1]), Element::Dashpot { viscosity_pa_s: p[2] }];
        match self {
            Self::Lethersich => {}
            Self::Burgers => elements.push(Element::Spring { modulus_pa: p[3] }),
            Self::TwoElement => elements.push(Element::kelvin_voigt(p[3], p[4])),
        }
        elements
    }

    /// Creep compliance at `parameters` (SI, the order of [`Self::parameters`]; all positive).
    ///
    /// `None` for laws that are no finite sum of exponentials.
    pub fn creep_compliance(self, parameters: &[f64]) -> Option<CreepCompliance> {
        let p = parameters;
        let mut law = CreepCompliance::lethersich(p);
        match self {
            Self::Lethersich => {}
            Self::Burgers => law.instantaneous_per_pa = 1.0 / p[3],
            Self::TwoElement => law.retarded.push(RetardedMode::kelvin_voigt(p[3], p[4])),
        }
        Some(law)
    }

    /// Default prior of a parameter that prior files leave out (placeholder until merged).
    pub fn default_prior(
        self,
        _name: &str,
        _median_of: &dyn Fn(&str) -> f64,
    ) -> Option<(crate::distribution::Distribution, &'static str)> {
        None
    }

    /// Whether the law has a [`Self::creep_compliance`].
    pub fn is_exponential(self) -> bool {
        match self {
            Self::Lethersich | Self::Burgers | Self::TwoElement => true,
        }
    }
}

#[cfg(test)]
mod spectrum_tests;
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lethersich_limits() {
        let j = CreepCompliance::lethersich(&[3.527, 1.402, 47.370]);
        assert_eq!(j.at(0.0), 0.0);
        // Short times: two dashpots in series; long times: spring plus free flow.
        let t = 1e-7;
        assert!((j.at(t) / (t / 1.402 + t / 47.370) - 1.0).abs() < 1e-6);
        let t = 1e3;
        assert!((j.at(t) - (1.0 / 3.527 + t / 47.370)).abs() < 1e-12);
    }
}
