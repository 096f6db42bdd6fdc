//! Nonlinear laws (physics §5): in one body of the base law the stress is not proportional to the strain or the strain rate.

use base::error::{Error, Result};
use base::number::{Dual, PointScalar};
use serde::{Deserialize, Serialize};

/// Kind of a nonlinear law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum NonlinearFamily {
    /// The spring of the first Kelvin–Voigt body stiffens.
    StrainStiffening,
    /// The dashpot thins.
    ShearThinning,
    /// The dashpot yields.
    YieldStress,
}

/// Nonlinearity of the law's first Kelvin–Voigt body or of its dashpot (physics §5).
///
/// The symbols are s = D̂⁻¹σ and the equivalents ε_eq² = ⅔ dev ε : dev ε, s_eq² = ⅔ dev s : dev s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Nonlinearity<N = f64> {
    /// dev s = E (1 + β ε_eq²) dev ε_k + c₁ dev ε̇_k in the first Kelvin–Voigt body; its volumetric part stays linear.
    StrainStiffening {
        /// β ≥ 0; 0 is the linear law.
        coefficient: N,
    },
    /// ε̇_d = (s_eq/s₀)^{1/n−1} s/c₂ in the dashpot.
    ShearThinning {
        /// n in (0, 1]; 1 is the linear law.
        index: N,
        /// s₀ > 0 in Pa: the stress at which the fluidity is 1/c₂.
        reference_stress_pa: N,
    },
    /// ε̇_d = ⟨1 − s_y/s_eq⟩ s/c₂ in the dashpot, with s_eq ⟨1 − s_y/s_eq⟩ smoothed to
    /// ½[s_eq − s_y + √((s_eq − s_y)² + 4δ² s_y s_eq)]: exact at s_y = 0, too large by at most δ s_y, and the sharp law as δ → 0.
    YieldStress {
        /// s_y ≥ 0 in Pa; 0 is the linear law.
        stress_pa: N,
        /// δ in (0, 1): smoothness of the bracket; [`YIELD_SMOOTHING`] is a good value.
        smoothing: f64,
    },
}

/// δ with which a gel below its yield stress creeps 10⁻⁴ times as fast as the fluid.
pub const YIELD_SMOOTHING: f64 = 0.01;

impl Nonlinearity {
    /// Converts the numbers to dual numbers with zero derivatives.
    pub fn constant(self) -> Nonlinearity<Dual> {
        match self {
            Self::StrainStiffening { coefficient } => {
                Nonlinearity::StrainStiffening { coefficient: coefficient.into() }
            }
            Self::ShearThinning { index, reference_stress_pa } => {
                Nonlinearity::ShearThinning { index: index.into(), reference_stress_pa: reference_stress_pa.into() }
            }
            Self::YieldStress { stress_pa, smoothing } => {
                Nonlinearity::YieldStress { stress_pa: stress_pa.into(), smoothing }
            }
        }
    }
}

impl Nonlinearity<Dual> {
    /// Converts the nonlinearity to another number type.
    pub fn of<N: PointScalar>(self) -> Nonlinearity<N> {
        match self {
            Self::StrainStiffening { coefficient } => {
                Nonlinearity::StrainStiffening { coefficient: N::from_dual(coefficient) }
            }
            Self::ShearThinning { index, reference_stress_pa } => Nonlinearity::ShearThinning {
                index: N::from_dual(index),
                reference_stress_pa: N::from_dual(reference_stress_pa),
            },
            Self::YieldStress { stress_pa, smoothing } => {
                Nonlinearity::YieldStress { stress_pa: N::from_dual(stress_pa), smoothing }
            }
        }
    }

    /// Checks that the numbers are within the law's support.
    ///
    /// # Errors
    /// [`Error::Numerical`] names the number.
    pub fn check(&self) -> Result<()> {
        let (good, what, support) = match *self {
            Self::StrainStiffening { coefficient } => {
                let beta = coefficient.value;
                (beta >= 0.0 && beta.is_finite(), format!("a stiffening coefficient of {beta}"), "0 or more")
            }
            Self::ShearThinning { index, reference_stress_pa } => {
                let (n, stress_pa) = (index.value, reference_stress_pa.value);
                let good = n > 0.0 && n <= 1.0 && stress_pa > 0.0 && stress_pa.is_finite();
                let what = format!("a thinning index of {n} at the reference stress {stress_pa} Pa");
                (good, what, "an index in (0, 1] and a positive stress")
            }
            Self::YieldStress { stress_pa, smoothing } => {
                let stress_pa = stress_pa.value;
                let good = stress_pa >= 0.0 && stress_pa.is_finite() && smoothing > 0.0 && smoothing < 1.0;
                let what = format!("a yield stress of {stress_pa} Pa with the smoothing {smoothing}");
                (good, what, "a stress of 0 or more and a smoothing in (0, 1)")
            }
        };
        if good {
            return Ok(());
        }
        Err(Error::numerical(format!("the law has {what}"), format!("give {support}")))
    }
}

impl<N> Nonlinearity<N> {
    /// Kind of the law.
    pub fn family(&self) -> NonlinearFamily {
        match self {
            Self::StrainStiffening { .. } => NonlinearFamily::StrainStiffening,
            Self::ShearThinning { .. } => NonlinearFamily::ShearThinning,
            Self::YieldStress { .. } => NonlinearFamily::YieldStress,
        }
    }
}
