//! The gel, the robot in it and what both weigh: what the field of an effect is computed from.

use crate::fe::Stiffness;
use crate::mesh::{Mesh, QuarterBall};

/// What gel and robot measure and weigh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sizes {
    /// Density of the gel, in kg/m³.
    pub gel_density_kg_m3: f64,
    /// Mass of the whole robot, in kg.
    pub robot_mass_kg: f64,
    /// Radius of the robot, or of the sphere of its volume, in m.
    pub robot_radius_m: f64,
    /// Radius of the outer surface, in m.
    pub outer_radius_m: f64,
    /// How the mesh was made, where it is the built-in one around a sphere, so that others can be made for the same gel.
    pub ball: Option<QuarterBall>,
}

/// The gel and the robot in it.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Its stiffness.
    pub stiffness: &'a Stiffness,
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Sizes and weights.
    pub sizes: Sizes,
}

/// Layers for a law that thins, over the model's. At n = 0.3 a robot moves 4 µm of 0.78 mm too far among 8 layers, 1.5 among 12, 0.1 among 24; a quarter of its arc in two elements
/// adds 0.2 µm, in one 0.4.
const THINNING_LAYERS: usize = 2;

impl Surroundings<'_> {
    /// Around a sphere in a built-in mesh, one of other layers for a law that thins: rates of strain fall off so steeply from the robot that twice the layers take
    /// more from the error than elements along them, of which there are fewer. `None` around other robots.
    pub fn thinning_ball(&self) -> Option<QuarterBall> {
        let layered = |ball: QuarterBall| QuarterBall {
            n_per_edge: (ball.n_per_edge - 1).max(1),
            n_layers: THINNING_LAYERS * ball.n_layers,
            ..ball
        };
        self.sizes.ball.map(layered)
    }
}
