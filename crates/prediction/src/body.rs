//! Bodies of revolution in the meridian plane: the accurate compliance of a robot in the middle of the gel, and robots of equal volume or surface.

use documents::shapes::{BodyShape, SizeRule};
use elements::fe::meridional::{BodyOfRevolution, Direction, Resolution, solve};
use record::{Orientation, Robot, RobotShape, Vitreous};

/// Largest relative error of a compliance in the meridian plane that is used.
const TRUSTED: f64 = 1e-5;

/// Displacement per force at unit creep compliance (1/m) of a robot in the middle of the gel, with its relative error; `None` if the robot has an offset or the
/// error is too large.
pub fn compliance_per_m(robot: &Robot, vitreous: &Vitreous) -> Option<(f64, f64)> {
    let Robot { shape, offset: None, .. } = *robot else { return None };
    let (body, direction) = body_and_direction(&shape);
    let solved =
        solve(body, 0.5 * vitreous.diameter_m, vitreous.poisson_ratio, direction, Resolution::default()).ok()?;
    (solved.relative_error < TRUSTED).then_some((1.0 / solved.stiffness_m, solved.relative_error))
}

/// The body of revolution of a robot, and the direction of the force relative to its axis.
pub fn body_and_direction(shape: &RobotShape) -> (BodyOfRevolution, Direction) {
    let (body, orientation) = match *shape {
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
    (body, if orientation == Orientation::Horizontal { Direction::Axial } else { Direction::Transverse })
}

/// The shape with this ratio of length to diameter whose volume or surface is that of another robot.
pub fn of_equal_size(
    (shape, orientation): (BodyShape, Orientation),
    aspect: f64,
    rule: SizeRule,
    other: &RobotShape,
) -> RobotShape {
    let of_diameter = |diameter_m: f64| {
        let length_m = aspect * diameter_m;
        match shape {
            BodyShape::Sphere => RobotShape::Sphere { diameter_m },
            BodyShape::Ellipsoid => RobotShape::Ellipsoid { length_m, diameter_m, orientation },
            BodyShape::Cylinder => RobotShape::Cylinder { length_m, diameter_m, orientation },
        }
    };
    let unit = of_diameter(1.0);
    let area_m2 = |shape: &RobotShape| body_and_direction(shape).0.surface_area_m2();
    of_diameter(match rule {
        SizeRule::EqualVolume => (other.volume_m3() / unit.volume_m3()).cbrt(),
        SizeRule::EqualSurface => (area_m2(other) / area_m2(&unit)).sqrt(),
    })
}
