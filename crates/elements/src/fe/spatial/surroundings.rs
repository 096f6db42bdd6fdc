//! The gel and the robot with their sizes and masses, for the field of an effect.

use crate::fe::Stiffness;
use crate::mesh::{Mesh, QuarterBall};

/// Sizes and masses of gel and robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhysicalProperties {
    /// Density of the gel, in kg/m³.
    pub gel_density_kg_m3: f64,
    /// Mass of the whole robot, in kg.
    pub robot_mass_kg: f64,
    /// Radius of the robot, or of the sphere with its volume, in m.
    pub robot_radius_m: f64,
    /// Radius of the outer surface, in m.
    pub outer_radius_m: f64,
    /// Parameters of the built-in mesh around a sphere, if it is used, so that other meshes can be built for this gel.
    pub ball: Option<QuarterBall>,
}

/// The gel and the robot in it.
#[derive(Debug, Clone, Copy)]
pub struct GelAndRobot<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Stiffness of the mesh.
    pub stiffness: &'a Stiffness,
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Sizes and masses.
    pub sizes: PhysicalProperties,
}

/// Ratio of the number of layers for a thinning law to that of the model. At n = 0.3 a robot moves 4 µm of 0.78 mm too far with 8 layers, 1.5 µm with 12 and 0.1 µm with 24. Two elements per quarter arc
/// add 0.2 µm, one adds 0.4 µm.
const THINNING_LAYERS: usize = 2;

impl GelAndRobot<'_> {
    /// Mesh parameters around a sphere for a thinning law: more layers and fewer elements along them. Strain rates decrease so steeply from the robot that twice the layers reduce
    /// the error more than elements along them. `None` for other robots.
    pub fn thinning_ball(&self) -> Option<QuarterBall> {
        let layered = |ball: QuarterBall| QuarterBall {
            n_per_edge: (ball.n_per_edge - 1).max(1),
            n_layers: THINNING_LAYERS * ball.n_layers,
            ..ball
        };
        self.sizes.ball.map(layered)
    }
}
