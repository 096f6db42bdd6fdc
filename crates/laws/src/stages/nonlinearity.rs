//! Nonlinear laws (physics §5). In one element of the base law, stress is not proportional to strain or strain rate.

use base::error::{Error, Result};
use base::number::{Dual, PointScalar};
use serde::{Deserialize, Serialize};

/// Kind of a nonlinear law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum NonlinearFamily {
    /// The spring of the first Kelvin–Voigt body stiffens.
    StrainStiffening,
    /// The fluidity of the dashpot grows with the stress.
    ShearThinning,
    /// The dashpot flows only above a yield stress.
    YieldStress,
}

/// Nonlinearity of the law's first Kelvin–Voigt body or of its dashpot (physics §5).
///
/// s = D̂⁻¹σ is the stress, divided by the elasticity tensor for unit Young's modulus. Equivalent strain and stress are ε_eq² = ⅔
/// dev ε : dev ε and s_eq² = ⅔ dev s : dev s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Nonlinearity<N = f64> {
    /// Stiffening of the first Kelvin–Voigt body: dev s = E (1 + β ε_eq²) dev ε_k + c₁ dev ε̇_k. Its volumetric response stays
    /// linear.
    StrainStiffening {
        /// Coefficient β ≥ 0; the law is linear for 0.
        coefficient: N,
    },
    /// Shear thinning of the dashpot: ε̇_d = (s_eq/s₀)^{1/n−1} s/c₂.
    ShearThinning {
        /// Exponent n in (0, 1]; the law is linear for 1.
        index: N,
        /// Stress s₀ > 0 in Pa at which the fluidity is 1/c₂.
        reference_stress_pa: N,
    },
    /// Yield stress of the dashpot: ε̇_d = ⟨1 − s_y/s_eq⟩ s/c₂. The term s_eq ⟨1 − s_y/s_eq⟩ is smoothed to ½[s_eq − s_y +
    /// √((s_eq − s_y)² + 4δ² s_y s_eq)]. The smoothed term is exact at s_y = 0 and too large by at most δ s_y. It tends to the
    /// sharp law as δ → 0.
    YieldStress {
        /// Yield stress s_y ≥ 0 in Pa; the law is linear for 0.
        stress_pa: N,
        /// Smoothing δ in (0, 1), usually [`YIELD_SMOOTHING`].
        smoothing: f64,
    },
}

/// Smoothing δ of a yield stress. With this value a gel far below its yield stress creeps at 10⁻⁴ times the rate of the fluid c₂.
pub const YIELD_SMOOTHING: f64 = 0.01;

impl Nonlinearity {
    /// Converts the parameters to dual numbers with zero derivatives.
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

    /// Checks that the parameters are within the law's support.
    ///
    /// # Errors
    /// [`Error::Numerical`] names the parameter that is outside.
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
    /// Kind of this nonlinear law.
    pub fn family(&self) -> NonlinearFamily {
        match self {
            Self::StrainStiffening { .. } => NonlinearFamily::StrainStiffening,
            Self::ShearThinning { .. } => NonlinearFamily::ShearThinning,
            Self::YieldStress { .. } => NonlinearFamily::YieldStress,
        }
    }
}
