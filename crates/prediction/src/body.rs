//! Bodies of revolution in the meridian plane: the accurate compliance of a robot in the middle of the gel.

use elements::fe::meridional::{BodyOfRevolution, Direction, Resolution, solve};
use record::{Orientation, Robot, RobotShape, Vitreous};

/// Largest relative error of a compliance in the meridian plane that is used.
const TRUSTED: f64 = 1e-5;

/// Displacement per force at unit creep compliance (1/m) of a robot in the middle of the gel, with its relative error; `None` if the robot has an offset or the
/// error is too large.
pub fn compliance_per_m(robot: &Robot, vitreous: &Vitreous) -> Option<(f64, f64)> {
    let Robot { shape, offset: None, .. } = *robot else { return None };
    let (body, orientation) = match shape {
        RobotShape::Sphere { diameter_m } => (BodyOfRevolution::sphere(0.5 * diameter_m), Orientation::Horizontal),
        RobotShape::Ellipsoid { length_m, diameter_m, orientation } => {
            let body =
                BodyOfRevolution::Spheroid { semi_axis_along_m: 0.5 * length_m, semi_axis_across_m: 0.5 * diameter_m };
            (body, orientation)
        }
        RobotShape::Cylinder { length_m, diameter_m, orientation } => {
            (BodyOfRevolution::Cylinder { length_m, diameter_m }, orientation)
        }
    };
    let direction = if orientation == Orientation::Horizontal { Direction::Axial } else { Direction::Transverse };
    let solved =
        solve(body, 0.5 * vitreous.diameter_m, vitreous.poisson_ratio, direction, Resolution::default()).ok()?;
    (solved.relative_error < TRUSTED).then_some((1.0 / solved.stiffness_m, solved.relative_error))
}
