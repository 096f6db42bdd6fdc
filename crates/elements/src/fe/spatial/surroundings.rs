//! The gel and the robot with their sizes and masses, from which effects build their matrices.

use crate::fe::Stiffness;
use crate::mesh::{Mesh, QuarterBall};

/// Sizes and masses of gel and robot, as effects use them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhysicalProperties {
    /// Density of the gel, in kg/m³.
    pub gel_density_kg_m3: f64,
    /// Mass of the whole robot, in kg.
    pub robot_mass_kg: f64,
    /// Radius of the robot or, for other shapes, of the sphere of equal volume, in m.
    pub robot_radius_m: f64,
    /// Radius of the outer surface, in m.
    pub outer_radius_m: f64,
    /// Parameters of the built-in mesh around a sphere, from which effects build further meshes of
    /// this gel; `None` for other meshes.
    pub ball: Option<QuarterBall>,
}

/// The meshed gel with the robot in it.
#[derive(Debug, Clone, Copy)]
pub struct GelAndRobot<'a> {
    /// Mesh of the gel.
    pub mesh: &'a Mesh,
    /// Stiffness of the gel on this mesh.
    pub stiffness: &'a Stiffness,
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Sizes and masses of the gel and the robot.
    pub sizes: PhysicalProperties,
}
