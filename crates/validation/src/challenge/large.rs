//! A gel in which the robot moves by several radii. The gel is a fluid ([`elements::fe::oldroyd`]) that follows the law at small strains. It is an Oldroyd-B
//! fluid if the effect of large displacements is hidden. The disturbance outside the library is a Giesekus fluid, which behaves equally at small strains.
//!
//! The robot's motion is the sum of two parts: the motion in the linear full-order model, and the fluid's deviation from it. One factor scales all three
//! parameters of the drawn law, so its time scales stay unchanged.

use super::{Disturbance, DisturbanceKind, Truth};
use base::error::{Error, Result};
use base::number::Dual;
use elements::fe::Stiffness;
use elements::fe::oldroyd::{Discretisation, FiniteGel, FiniteInput, FiniteLaw};
use elements::fe::stepping::Resolution;
use elements::fe::time::FullOrderModel;
use laws::rheology::BaseLaw;
use models::effects::{Effect, Stages};
use posterior::mechanics::robot_mesh;
use record::{Apparatus, Record, Robot, RobotShape, Vitreous};

/// Largest distances of the robot from its start in a linear gel that are tried, in robot radii.
pub(super) const RADII: [f64; 7] = [1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0];
/// Smallest and largest mobility of Giesekus's fluid.
const MOBILITIES: [f64; 2] = [0.005, 0.05];

/// Resolution in space and time of a gel that moves far.
pub(super) struct Cut {
    /// Level of the linear model's mesh.
    level: usize,
    fineness: Discretisation,
}

/// Resolution for computing the signal of a given distance.
pub(super) const SIGNAL_RESOLUTION: Cut = Cut { level: 1, fineness: Discretisation::ESTIMATE };
/// Resolution for the simulated data, finer than the resolution of the surrogate's training.
pub(super) const DATA: Cut =
    Cut { level: 2, fineness: Discretisation { order: 6, n_angles: 6, layer_ratio: 2.0, steps_per_doubling: 6 } };

/// True if the effect is that of large displacements.
pub(super) fn is_large(effect: &dyn Effect) -> bool {
    effect.is_learnt_for_record()
}

/// Giesekus mobility of the gel of a truth with large displacements, 0 for an Oldroyd-B fluid; `None` without large displacements.
pub(super) fn mobility_of(truth: &Truth, is_large: impl Fn(&str) -> bool) -> Option<f64> {
    match &truth.outside {
        Some(Disturbance { kind: DisturbanceKind::LargeDisplacement, shape, .. }) => shape.first().copied(),
        _ => truth.effects.iter().any(|effect| is_large(&effect.slug)).then_some(0.0),
    }
}

/// Converts a number from 0 to 1 to a mobility, by logarithmic interpolation between the two `MOBILITIES`.
pub(super) fn mobility(uniform: f64) -> f64 {
    MOBILITIES[0] * (MOBILITIES[1] / MOBILITIES[0]).powf(uniform)
}

/// The reference apparatus, meshed for large displacements.
pub(super) struct LargeGel {
    stiffness: Stiffness,
    poisson_ratio: f64,
    gel: FiniteGel,
}

impl LargeGel {
    pub fn new(apparatus: &Apparatus, cut: &Cut) -> Result<Self> {
        let (robot, vitreous) = robot_of(apparatus)?;
        let stiffness = Stiffness::new(&robot_mesh(robot, vitreous, cut.level)?)?;
        let gel = FiniteGel::around_sphere(radius_m(apparatus)?, 0.5 * vitreous.diameter_m, cut.fineness)?;
        Ok(Self { stiffness, poisson_ratio: vitreous.poisson_ratio, gel })
    }

    /// Position (m) of the robot at every row of `record`. `law` holds E (Pa), c₁ and c₂ (Pa·s).
    pub(super) fn position_m(&self, law: [f64; 3], mobility: f64, record: &Record) -> Result<Vec<f64>> {
        let (time_s, force) = (&record.time_s, record.force());
        let stages = Stages::of_law(BaseLaw::Lethersich.elements(&law.map(Dual::constant)));
        let linear = FullOrderModel::new(&self.stiffness, self.poisson_ratio)?;
        let linear_m = linear.step(&stages, time_s, force, Resolution::default())?.position_m;
        let law = FiniteLaw::new(&stages.law, mobility)
            .ok_or_else(|| Error::numerical("the base law has a springpot", "reinstall the program"))?;
        let found = self.gel.run(&FiniteInput { law: &law, load: &stages.load, time_s, force })?;
        Ok(linear_m.iter().zip(&found.deviation_m).map(|(x, deviation)| x + deviation).collect())
    }
}

/// Radius of the robot, in m.
///
/// # Errors
/// [`Error::Numerical`] for an apparatus without a sphere.
pub(super) fn radius_m(apparatus: &Apparatus) -> Result<f64> {
    match robot_of(apparatus)?.0.shape {
        RobotShape::Sphere { diameter_m } => Ok(0.5 * diameter_m),
        _ => Err(Error::numerical("the robot of the reference apparatus is not a sphere", "reinstall the program")),
    }
}

/// Robot and vitreous of the reference apparatus.
pub(super) fn robot_of(apparatus: &Apparatus) -> Result<(&Robot, &Vitreous)> {
    match apparatus {
        Apparatus::Robot { robot, vitreous } => Ok((robot, vitreous)),
        Apparatus::Instrument { .. } | Apparatus::Indenter(_) => {
            Err(Error::numerical("the reference apparatus has no robot", "reinstall the program"))
        }
    }
}
