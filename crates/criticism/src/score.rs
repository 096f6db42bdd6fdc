//! What a ranking says of one effect.

use nalgebra::DVector;

/// An effect's score.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// z in the direction of the support, averaged over draws; of the grid point with the largest.
    pub z: f64,
    /// z over ‖Pg‖: the first parameter's expected distance from its null, in its unit, plus the null.
    pub expected_parameter: f64,
    /// ‖Pg‖²/‖g‖², the largest over the grid.
    pub visible_fraction: f64,
    /// ‖Pg‖ a unit of the first parameter, at the grid point with the largest z.
    pub signature_per_unit: f64,
    /// Unit vector along Pg there; `None` where nothing is visible.
    pub direction: Option<DVector<f64>>,
    /// Whether the effect has one sign; then z counts upwards only.
    pub is_one_sided: bool,
}
