//! Curves in the half meridian, and the cells ruled between two curves.

use base::error::{Error, Result};

/// A point (r, z) of the half meridian in m, or a vector in its plane.
pub(in crate::fe) type Point = [f64; 2];

/// A smooth curve with the parameter t in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fe) enum Curve {
    /// Straight line from `from` to `to`. It is a point if both agree.
    Segment { from: Point, to: Point },
    /// Arc of an ellipse: centre + (semi_axes[0] cos φ, semi_axes[1] sin φ), with φ from `from_rad`
    /// to `to_rad`.
    Arc { centre: Point, semi_axes: Point, from_rad: f64, to_rad: f64 },
}

impl Curve {
    /// Returns the point at the curve's parameter t and its derivative with respect to t.
    pub(in crate::fe) fn at(&self, t: f64) -> (Point, Point) {
        match *self {
            Self::Segment { from, to } => {
                let along = [to[0] - from[0], to[1] - from[1]];
                ([from[0] + t * along[0], from[1] + t * along[1]], along)
            }
            Self::Arc { centre, semi_axes, from_rad, to_rad } => {
                let sweep = to_rad - from_rad;
                let (sin, cos) = (from_rad + t * sweep).sin_cos();
                (
                    [centre[0] + semi_axes[0] * cos, centre[1] + semi_axes[1] * sin],
                    [-semi_axes[0] * sin * sweep, semi_axes[1] * cos * sweep],
                )
            }
        }
    }
}

impl Curve {
    /// Returns the curve's mirror image across z = 0, with reversed direction.
    fn mirrored(&self) -> Self {
        let image = |[r, z]: Point| [r, -z];
        match *self {
            Self::Segment { from, to } => Self::Segment { from: image(to), to: image(from) },
            Self::Arc { centre, semi_axes, from_rad, to_rad } => {
                Self::Arc { centre: image(centre), semi_axes, from_rad: -to_rad, to_rad: -from_rad }
            }
        }
    }
}

/// Map of the reference square [−1, 1]² to a cell between two curves: (1 − s) inner(t) + s
/// outer(t). Along the curves t = (1 + ξ)/2. Across them s runs from `across[0]` at η = −1 to
/// `across[1]` at η = 1.
///
/// The map is exact on curved bodies, because it does not interpolate the geometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fe) struct Ruled {
    pub(in crate::fe) inner: Curve,
    pub(in crate::fe) outer: Curve,
    pub(in crate::fe) across: [f64; 2],
}

impl Ruled {
    /// Returns the cell's mirror image across z = 0, with both curves reversed.
    pub(in crate::fe) fn mirrored(&self) -> Self {
        Self { inner: self.inner.mirrored(), outer: self.outer.mirrored(), ..*self }
    }

    /// Returns the point (r, z) at the reference coordinates (ξ, η), with its derivatives with
    /// respect to ξ and η.
    pub(in crate::fe) fn at(&self, xi: f64, eta: f64) -> (Point, Point, Point) {
        let half = 0.5 * (self.across[1] - self.across[0]);
        let (t, s) = (0.5 * (1.0 + xi), self.across[0] + (1.0 + eta) * half);
        let ((inner, d_inner), (outer, d_outer)) = (self.inner.at(t), self.outer.at(t));
        let blend = |a: Point, b: Point| [(1.0 - s) * a[0] + s * b[0], (1.0 - s) * a[1] + s * b[1]];
        let along = blend(d_inner, d_outer).map(|d| 0.5 * d);
        (blend(inner, outer), along, [half * (outer[0] - inner[0]), half * (outer[1] - inner[1])])
    }

    /// Returns the values of [`Self::at`], with the Jacobian determinant as fourth value.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the cell is inverted or leaves the half meridian.
    pub(in crate::fe) fn upright_at(&self, xi: f64, eta: f64) -> Result<(Point, Point, Point, f64)> {
        let (at, along, across) = self.at(xi, eta);
        let jacobian = along[0] * across[1] - along[1] * across[0];
        if jacobian > 0.0 && at[0] > 0.0 {
            return Ok((at, along, across, jacobian));
        }
        Err(Error::numerical(
            format!("a cell near r = {:.3e}, z = {:.3e} is inverted (Jacobian {jacobian:.3e})", at[0], at[1]),
            "give a body that lies well inside the outer sphere",
        ))
    }
}
