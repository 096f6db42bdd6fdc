//! Built-in graded mesh of the gel between a prolate spheroid and the outer sphere.
//!
//! The mesh consists of cube-sphere patches on confocal spheroids. A direction n of the cube-sphere
//! becomes the point (A n₁, B n₂, B n₃) on the spheroid of semi-axes A, B. The field around a rigid
//! spheroid is smooth in these coordinates for any aspect ratio. The elements may therefore be as
//! slender as the body.

use std::ops::RangeInclusive;

use super::Mesh;
use super::box_surface::{BoxSurface, equiangular_direction, layers_per_level, long_axis};
use base::error::{Error, Result, Setting};
use record::Orientation;

/// Largest increase of the radius's natural logarithm per layer, at refinement level 1.
const LAYER_STEP: f64 = 1.1;

/// Prolate spheroid in a sphere of gel: sizes, orientation and refinement of the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spheroid {
    /// Length of the long axis in m.
    pub length_m: f64,
    /// Length of the short axes in m.
    pub diameter_m: f64,
    /// Direction of the long axis relative to the force.
    pub orientation: Orientation,
    /// Radius of the fixed outer surface in m.
    pub outer_radius_m: f64,
    /// Refinement level 1, 2, 3, …: the number of elements along 45° of arc of the cube-sphere.
    /// Each level has four layers, or more for a distant outer surface.
    pub level: usize,
}

impl Spheroid {
    /// Permitted range of length divided by diameter. At the upper limit the smallest scaled
    /// Jacobian of the mesh is 0.07.
    pub const ASPECTS: RangeInclusive<f64> = 1.0..=30.0;

    /// Builds the mesh. Returns [`Error::Numerical`] if no mesh fits the sizes.
    pub fn mesh(&self) -> Result<Mesh> {
        self.check()?;
        let surface = BoxSurface::new([self.level; 3]);
        let n_layers = self.level * layers_per_level(self.outer_radius_m / (0.5 * self.diameter_m), LAYER_STEP);
        let semi_axes_m = self.semi_axes_m(n_layers);
        let long = long_axis(self.orientation);
        Ok(surface.layered(n_layers, |point, sheet| {
            let direction = equiangular_direction(point, surface.half_width[0]);
            let [along_m, across_m] = semi_axes_m[sheet];
            std::array::from_fn(|axis| direction[axis] * if axis == long { along_m } else { across_m })
        }))
    }

    fn check(&self) -> Result<()> {
        check_aspect("spheroids", self.length_m, self.diameter_m, &Self::ASPECTS)?;
        let is_inside = 0.5 * self.length_m < self.outer_radius_m && self.outer_radius_m.is_finite();
        if !is_inside || self.level == 0 {
            return Err(Error::numerical(
                format!(
                    "no mesh of level {} fits between a spheroid {} m long and the radius {} m",
                    self.level, self.length_m, self.outer_radius_m
                ),
                "give a robot that lies inside the vitreous",
            ));
        }
        Ok(())
    }

    /// Semi-axes (A, B) in m of the 2·layers + 1 spheroidal sheets of nodes: A along the long axis,
    /// B across it. B is in geometric progression, because displacements decay with 1/B. A² − B²,
    /// the square of the focal distance, falls linearly in B² and is 0 at the outer sphere. If the
    /// outer sphere is distant, the sheets are confocal near the body. If it is near, the sheets
    /// approach its shape evenly.
    fn semi_axes_m(&self, n_layers: usize) -> Vec<[f64; 2]> {
        let (a, b, outer) = (0.5 * self.length_m, 0.5 * self.diameter_m, self.outer_radius_m);
        let last = 2 * n_layers;
        let sheet = |i: usize| {
            if i == last {
                return [outer; 2];
            }
            let across = b * (outer / b).powf(i as f64 / last as f64);
            let left = (outer * outer - across * across) / (outer * outer - b * b);
            [(across * across + (a * a - b * b) * left).sqrt(), across]
        };
        (0..=last).map(sheet).collect()
    }
}
/// Refuses a body that is too short or too long for its width. `bodies` names its shape.
pub(super) fn check_aspect(bodies: &str, length_m: f64, diameter_m: f64, allowed: &RangeInclusive<f64>) -> Result<()> {
    let aspect = length_m / diameter_m;
    if diameter_m > 0.0 && allowed.contains(&aspect) {
        return Ok(());
    }
    Err(Error::numerical(
        format!(
            "built-in meshes exist for {bodies} from {} to {} times as long as wide; this one is {aspect:.3} times as long",
            allowed.start(),
            allowed.end()
        ),
        format!("check the robot's length and diameter, or use a Gmsh mesh with `{} FILE.msh`", Setting::Mesh),
    ))
}
