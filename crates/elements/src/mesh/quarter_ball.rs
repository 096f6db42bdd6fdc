//! Built-in graded mesh of the gel between a spherical robot and the outer sphere.
//!
//! The mesh consists of equiangular cube-sphere patches and radial layers in geometric progression.
//! Its elements are curved 27-node hexahedra.

use super::Mesh;
use super::box_surface::{BoxSurface, equiangular_direction};
use base::error::{Error, Result};

/// Sizes and refinement of a mesh of the gel around a spherical robot, inside a fixed outer sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuarterBall {
    /// Radius of the robot in m.
    pub robot_radius_m: f64,
    /// Radius of the fixed outer surface in m.
    pub outer_radius_m: f64,
    /// Number of elements along 45° of arc on the robot's surface.
    pub n_per_edge: usize,
    /// Number of element layers between robot and outer surface.
    pub n_layers: usize,
}

impl QuarterBall {
    /// Builds the mesh. Returns [`Error::Numerical`] if no mesh fits the sizes.
    pub fn mesh(&self) -> Result<Mesh> {
        let sizes_ok = self.robot_radius_m > 0.0
            && self.outer_radius_m > self.robot_radius_m
            && self.outer_radius_m.is_finite()
            && self.n_per_edge > 0
            && self.n_layers > 0;
        if !sizes_ok {
            return Err(Error::numerical(
                format!("no mesh fits between radii {} m and {} m", self.robot_radius_m, self.outer_radius_m),
                "give a robot that lies inside the vitreous",
            ));
        }
        Ok(self.of_sheets(&self.node_radii_m()))
    }

    /// Builds a mesh in which faces of elements form a sphere of radius `radius_m` (m) between the
    /// robot and the outer surface. `n_inside` layers lie inside this sphere, the others outside.
    ///
    /// # Errors
    /// [`Error::Numerical`] if no mesh fits the sizes.
    pub fn mesh_with_interface(&self, radius_m: f64, n_inside: usize) -> Result<Mesh> {
        let parts = [
            Self { outer_radius_m: radius_m, n_layers: n_inside, ..*self },
            Self { robot_radius_m: radius_m, n_layers: self.n_layers.saturating_sub(n_inside), ..*self },
        ];
        let is_between = radius_m > self.robot_radius_m && radius_m < self.outer_radius_m;
        if !(is_between && parts.iter().all(|part| part.n_layers > 0 && part.n_per_edge > 0)) {
            return Err(Error::numerical(
                format!("no mesh has {n_inside} of its {} layers inside a radius of {radius_m} m", self.n_layers),
                "give a radius between those of the robot and the outer surface, and at least one layer on either side of it",
            ));
        }
        let mut radii_m = parts[0].node_radii_m();
        radii_m.extend(&parts[1].node_radii_m()[1..]);
        Ok(self.of_sheets(&radii_m))
    }

    fn of_sheets(&self, radii_m: &[f64]) -> Mesh {
        let surface = BoxSurface::new([self.n_per_edge; 3]);
        surface.layered(self.n_layers, |point, sheet| {
            equiangular_direction(point, surface.half_width[0]).map(|c| c * radii_m[sheet])
        })
    }

    /// Radii (m) of the 2·layers + 1 spherical sheets of nodes, in geometric progression.
    ///
    /// The progression includes the middle nodes of the elements. The position in an element then
    /// varies with the logarithm of the radius, which suits displacements that decay with 1/radius.
    /// Middle nodes midway between the faces would make the stiffness error 30 times larger.
    fn node_radii_m(&self) -> Vec<f64> {
        let last = 2 * self.n_layers;
        let ratio = self.outer_radius_m / self.robot_radius_m;
        let radius = |i: usize| match i {
            i if i == last => self.outer_radius_m,
            i => self.robot_radius_m * ratio.powf(i as f64 / last as f64),
        };
        (0..=last).map(radius).collect()
    }
}
