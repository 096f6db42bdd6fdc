//! First-order score of one effect in a ranking.

use nalgebra::DVector;

/// First-order score of an effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// Residual along the effect's signature, in standard deviations and with the sign of the effect's support. It is averaged over draws, and the largest over the grid.
    pub z: f64,
    /// Expected value of the effect's first parameter, in its unit, from the score z to first order.
    pub expected_parameter: f64,
    /// Fraction of the effect's whitened signature, in squared norm, that the base cannot absorb; the largest over the grid.
    pub visible_fraction: f64,
    /// Norm, per unit of the first parameter, of the whitened signature without the part that the base absorbs. It is taken at the grid point with the largest score z.
    pub signature_per_unit: f64,
    /// Unit vector along the unabsorbed signature at the grid point with the largest score; `None` if the effect is invisible.
    pub direction: Option<DVector<f64>>,
    /// True if the effect has one sign; if so, only positive z counts.
    pub is_one_sided: bool,
}
