//! A gel in which the robot moves by several of its radii: the law's own fluid with strains of any size ([`crate::fe::oldroyd`]), which the fitted models do not know.
//!
//! What the robot does is the linear model's answer in full finite elements, and the fluid's deviation from it. The drawn law is made stiffer or softer, all three numbers by one factor, until the deviation shows as
//! strongly as is asked: its times stay.

use crate::effects::Stages;
use crate::error::{Error, Result};
use crate::experiment::{Apparatus, Record, Robot, RobotShape, Vitreous};
use crate::fe::Stiffness;
use crate::fe::oldroyd::{Fineness, FiniteGel, FiniteLaw, FiniteRun};
use crate::fe::stepping::Resolution;
use crate::fe::time::FullOrderModel;
use crate::number::Dual;
use crate::rheology::{BaseLaw, CreepCompliance};
use crate::workflow::mechanics::robot_mesh;

/// Farthest that the robot comes from its start, in its radii, were the gel linear: as far as in the paper.
pub(super) const FARTHEST_RADII: f64 = 3.6;

/// How finely a gel is cut.
pub(super) struct Cut {
    /// Level of the linear model's mesh.
    level: usize,
    fineness: Fineness,
}

/// For sizing signals.
pub(super) const SIZING: Cut = Cut { level: 1, fineness: Fineness::ESTIMATE };
/// For data.
pub(super) const DATA: Cut =
    Cut { level: 2, fineness: Fineness { order: 6, n_angles: 6, layer_ratio: 2.0, steps_per_doubling: 6 } };

/// The reference apparatus meshed for large displacements.
pub(super) struct LargeGel {
    stiffness: Stiffness,
    poisson_ratio: f64,
    gel: FiniteGel,
}

impl LargeGel {
    pub(super) fn new(apparatus: &Apparatus, cut: &Cut) -> Result<Self> {
        let (robot, vitreous) = robot_of(apparatus)?;
        let stiffness = Stiffness::new(&robot_mesh(robot, vitreous, cut.level)?)?;
        let gel = FiniteGel::around_sphere(radius_m(apparatus)?, 0.5 * vitreous.diameter_m, cut.fineness)?;
        Ok(Self { stiffness, poisson_ratio: vitreous.poisson_ratio, gel })
    }

    /// Position (m) at every row for E (Pa), c₁ and c₂ (Pa·s).
    pub(super) fn position_m(&self, law: [f64; 3], record: &Record) -> Result<Vec<f64>> {
        let (time_s, force) = (&record.time_s, record.force());
        let stages = Stages::of_law(BaseLaw::Lethersich.elements(&law.map(Dual::constant)));
        let linear = FullOrderModel::new(&self.stiffness, self.poisson_ratio)?;
        let mut position_m = linear.step(&stages, time_s, force, Resolution::default())?.position_m;
        let law = FiniteLaw::new(&CreepCompliance::lethersich(&law), 0.0);
        let found = self.gel.run(&FiniteRun { law: &law, load: &stages.load, time_s, force })?;
        position_m.iter_mut().zip(&found.deviation_m).for_each(|(x, deviation)| *x += deviation);
        Ok(position_m)
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
