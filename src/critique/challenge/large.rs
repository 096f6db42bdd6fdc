//! A gel in which the robot moves by about its own size: data by full finite elements with strains of any size ([`crate::fe::large`]).
//!
//! At the paper's 3.6 radii no mesh follows, so the drawn law is made stiffer, all three numbers by one factor: its times stay, its displacements shrink.

use crate::effects::Stages;
use crate::error::{Error, Result};
use crate::experiment::{Apparatus, Record, Robot, RobotShape, Vitreous};
use crate::fe::Stiffness;
use crate::fe::large::{LargeModel, LargeRun};
use crate::fe::nonlinear::Options;
use crate::mesh::Mesh;
use crate::rheology::BaseLaw;
use crate::workflow::mechanics::robot_mesh;

/// Farthest that the robot would come from its start, in its radii, if the gel were linear. The gel gives 13 % less there, and its mesh carries a little more.
pub(super) const FARTHEST_RADII: f64 = 1.6;
/// Mesh levels on which signals are sized and data made.
pub(super) const SIZING_LEVEL: usize = 1;
pub(super) const DATA_LEVEL: usize = 2;

/// The reference apparatus meshed for large displacements.
pub(super) struct LargeGel {
    mesh: Mesh,
    stiffness: Stiffness,
    poisson_ratio: f64,
}

impl LargeGel {
    pub(super) fn new(apparatus: &Apparatus, level: usize) -> Result<Self> {
        let (robot, vitreous) = robot_of(apparatus)?;
        let mesh = robot_mesh(robot, vitreous, level)?;
        let stiffness = Stiffness::new(&mesh)?;
        Ok(Self { mesh, stiffness, poisson_ratio: vitreous.poisson_ratio })
    }

    /// Position (m) at every row for E (Pa), c₁ and c₂ (Pa·s).
    pub(super) fn position_m(&self, law: [f64; 3], record: &Record) -> Result<Vec<f64>> {
        let model = LargeModel::new(&self.mesh, &self.stiffness, self.poisson_ratio)?;
        let load = Stages::of_law(Vec::new()).load;
        let (time_s, force) = (&record.time_s, record.force());
        let run = LargeRun { law: BaseLaw::Lethersich, parameters: &law, load: &load, time_s, force };
        Ok(model.run(&run, Options::default())?.displacement_m)
    }
}

/// The robot's radius in m.
///
/// # Errors
/// [`Error::Numerical`] for an apparatus without a sphere.
pub(super) fn radius_m(apparatus: &Apparatus) -> Result<f64> {
    match robot_of(apparatus)?.0.shape {
        RobotShape::Sphere { diameter_m } => Ok(0.5 * diameter_m),
        _ => Err(Error::numerical("the reference apparatus has no sphere", "reinstall the program")),
    }
}

/// The reference apparatus's robot and gel.
pub(super) fn robot_of(apparatus: &Apparatus) -> Result<(&Robot, &Vitreous)> {
    match apparatus {
        Apparatus::Robot { robot, vitreous } => Ok((robot, vitreous)),
        Apparatus::Instrument { .. } | Apparatus::Indenter(_) => {
            Err(Error::numerical("the reference apparatus has no robot", "reinstall the program"))
        }
    }
}
