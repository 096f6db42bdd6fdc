//! Springs, dashpots and their creep compliance (physics §2). Scalar: space enters only through [`crate::fe`].

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

impl CreepCompliance {
    /// J(t) in 1/Pa, for t ≥ 0; at t = 0 the limit from the right.
    pub fn at(&self, time_s: f64) -> f64 {
        let retarded: f64 = self.retarded.iter().map(|m| -m.compliance_per_pa * (-time_s / m.time_s).exp_m1()).sum();
        self.instantaneous_per_pa + retarded + self.fluidity_per_pa_s * time_s
    }
}

/// A constitutive law that a model starts from, before effects are added.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BaseLaw {
    /// Kelvin–Voigt body in series with a dashpot: `young_modulus_pa`, `viscosity_1_pa_s`, `viscosity_2_pa_s`.
    #[default]
    Lethersich,
}

/// Parameters of [`BaseLaw::Lethersich`].
pub const LETHERSICH: [ParameterSpec; 3] = [
    ParameterSpec { name: "young_modulus_pa", unit: "Pa", support: Support::POSITIVE },
    ParameterSpec { name: "viscosity_1_pa_s", unit: "Pa s", support: Support::POSITIVE },
    ParameterSpec { name: "viscosity_2_pa_s", unit: "Pa s", support: Support::POSITIVE },
];

impl BaseLaw {
    /// All laws.
    pub const ALL: [Self; 1] = [Self::Lethersich];

    /// The law of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|law| law.name() == name)
    }

    /// Name for people.
    pub fn title(self) -> &'static str {
        match self {
            Self::Lethersich => "Lethersich",
        }
    }

    /// Name in `model.toml` and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lethersich => "lethersich",
        }
    }

    /// The law's parameters, in the order in which [`Self::creep_compliance`] takes them.
    pub fn parameters(self) -> &'static [ParameterSpec] {
        match self {
            Self::Lethersich => &LETHERSICH,
        }
    }

    /// Creep compliance at `parameters` (SI, the order of [`Self::parameters`]; all positive).
    pub fn creep_compliance(self, parameters: &[f64]) -> CreepCompliance {
        match self {
            Self::Lethersich => {
                let (young_modulus_pa, viscosity_1_pa_s, viscosity_2_pa_s) =
                    (parameters[0], parameters[1], parameters[2]);
                CreepCompliance {
                    instantaneous_per_pa: 0.0,
                    retarded: vec![RetardedMode {
                        compliance_per_pa: 1.0 / young_modulus_pa,
                        time_s: viscosity_1_pa_s / young_modulus_pa,
                    }],
                    fluidity_per_pa_s: 1.0 / viscosity_2_pa_s,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lethersich_limits() {
        let j = BaseLaw::Lethersich.creep_compliance(&[3.527, 1.402, 47.370]);
        assert_eq!(j.at(0.0), 0.0);
        // Short times: two dashpots in series; long times: spring plus free flow.
        let t = 1e-7;
        assert!((j.at(t) / (t / 1.402 + t / 47.370) - 1.0).abs() < 1e-6);
        let t = 1e3;
        assert!((j.at(t) - (1.0 / 3.527 + t / 47.370)).abs() < 1e-12);
    }
}
