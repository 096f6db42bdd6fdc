//! First-order score of one effect in a ranking.

use nalgebra::DVector;

/// An effect's score.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// z in the direction of the support, averaged over draws, at the grid point where it is largest.
    pub z: f64,
    /// z over ‖Pg‖ plus the null: the expected value of the first parameter, in its unit.
    pub expected_parameter: f64,
    /// ‖Pg‖²/‖g‖², the largest over the grid: share of the signature that the base cannot absorb.
    pub visible_fraction: f64,
    /// ‖Pg‖ per unit of the first parameter, at the grid point with the largest z.
    pub signature_per_unit: f64,
    /// Unit vector along Pg at that grid point; `None` if the effect is invisible.
    pub direction: Option<DVector<f64>>,
    /// True if the effect has one sign; if so, only positive z counts.
    pub is_one_sided: bool,
}
