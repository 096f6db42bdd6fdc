//! Rheological elements of a law: springs, dashpots and springpots, in series and in parallel.

use base::number::Dual;

/// Place of an element in a law, which is a list of bodies in series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ElementPlace {
    /// Index of the body among the bodies in series.
    pub body: usize,
    /// Index of the element among the body's elements in parallel; `None` if the element itself is the body.
    pub part: Option<usize>,
}

/// Element or network of elements, which relates the scalar stress s (Pa) to the scalar strain ε (physics §2).
#[derive(Debug, Clone, PartialEq)]
pub enum Element {
    /// Spring: s = E ε.
    Spring {
        /// Modulus E in Pa.
        modulus_pa: Dual,
    },
    /// Dashpot: s = c ε̇.
    Dashpot {
        /// Viscosity c in Pa·s.
        viscosity_pa_s: Dual,
    },
    /// Springpot: s = E τᵅ Dᵅε, with Dᵅ Caputo's derivative of order α from time 0. A springpot is a spring at α = 0 and a
    /// dashpot at α = 1.
    Springpot {
        /// Modulus E in Pa.
        modulus_pa: Dual,
        /// Time τ in s, which with E and α determines the coefficient E τᵅ.
        time_s: Dual,
        /// Order α in (0, 1].
        order: Dual,
    },
    /// Spring that is given by its compliance C: ε = C s. C may be 0 and still have a derivative.
    Compliance {
        /// Compliance C in 1/Pa.
        compliance_per_pa: Dual,
    },
    /// Kelvin–Voigt body that is given by its compliance C and retardation time τ: τ ε̇ + ε = C s. C may be 0 and still have a
    /// derivative.
    Retarded {
        /// Compliance C in 1/Pa.
        compliance_per_pa: Dual,
        /// Retardation time τ in s.
        time_s: Dual,
    },
    /// Elements in series. All carry the same stress, and their strains add.
    Series(Vec<Element>),
    /// Elements in parallel. All have the same strain, and their stresses add.
    Parallel(Vec<Element>),
}

impl Element {
    /// Returns a Kelvin–Voigt body, which is a spring and a dashpot in parallel.
    pub fn kelvin_voigt(modulus_pa: Dual, viscosity_pa_s: Dual) -> Self {
        Self::Parallel(vec![Self::Spring { modulus_pa }, Self::Dashpot { viscosity_pa_s }])
    }

    /// Returns the ratio of stress to strain in Pa for a strain that grows as e^{t/T}, with T = `time_scale_s` > 0. This ratio is
    /// the element's modulus in the Laplace domain at 1/T.
    pub fn operator_pa(&self, time_scale_s: f64) -> Dual {
        let time_scale_s = Dual::constant(time_scale_s);
        match self {
            Self::Spring { modulus_pa } => *modulus_pa,
            Self::Dashpot { viscosity_pa_s } => *viscosity_pa_s / time_scale_s,
            Self::Springpot { modulus_pa, time_s, order } => *modulus_pa * (*time_s / time_scale_s).pow(*order),
            Self::Compliance { compliance_per_pa } => Dual::ONE / *compliance_per_pa,
            Self::Retarded { compliance_per_pa, time_s } => (*time_s / time_scale_s + 1.0) / *compliance_per_pa,
            Self::Series(elements) => {
                let compliance = |sum: Dual, part: &Self| sum + Dual::ONE / part.operator_pa(time_scale_s.value);
                Dual::ONE / elements.iter().fold(Dual::ZERO, compliance)
            }
            Self::Parallel(elements) => {
                elements.iter().fold(Dual::ZERO, |sum, part| sum + part.operator_pa(time_scale_s.value))
            }
        }
    }

    /// Returns an element whose stress is `factor` times as large at every strain.
    pub fn scaled(&self, factor: Dual) -> Self {
        let all = |elements: &[Self]| elements.iter().map(|element| element.scaled(factor)).collect();
        match self {
            Self::Spring { modulus_pa } => Self::Spring { modulus_pa: *modulus_pa * factor },
            Self::Dashpot { viscosity_pa_s } => Self::Dashpot { viscosity_pa_s: *viscosity_pa_s * factor },
            Self::Springpot { modulus_pa, time_s, order } => {
                Self::Springpot { modulus_pa: *modulus_pa * factor, time_s: *time_s, order: *order }
            }
            Self::Compliance { compliance_per_pa } => {
                Self::Compliance { compliance_per_pa: *compliance_per_pa / factor }
            }
            Self::Retarded { compliance_per_pa, time_s } => {
                Self::Retarded { compliance_per_pa: *compliance_per_pa / factor, time_s: *time_s }
            }
            Self::Series(elements) => Self::Series(all(elements)),
            Self::Parallel(elements) => Self::Parallel(all(elements)),
        }
    }
}
