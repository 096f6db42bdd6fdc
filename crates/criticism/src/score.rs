//! First-order score of one effect in a ranking.

use nalgebra::DVector;

/// First-order score of an effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// Score z in the direction of the effect's support, averaged over draws, at the grid point where it is largest.
    pub z: f64,
    /// Expected value of the effect's first parameter, in its unit: z divided by ‖Pg‖, plus the null.
    pub expected_parameter: f64,
    /// Fraction ‖Pg‖²/‖g‖² of the signature that the base cannot absorb, the largest over the grid.
    pub visible_fraction: f64,
    /// ‖Pg‖ per unit of the first parameter, at the grid point with the largest z.
    pub signature_per_unit: f64,
    /// Unit vector along Pg at that grid point; `None` if the effect is invisible.
    pub direction: Option<DVector<f64>>,
    /// True if the effect has one sign; if so, only positive z counts.
    pub is_one_sided: bool,
}
