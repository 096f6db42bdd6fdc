//! The five bodies of the study (shapes in their orientations). Each has the sphere's volume or its surface area.

use crate::body::{body_and_direction, of_equal_size};
use documents::shapes::{BodyShape, SizeRule};
use elements::fe::meridional::{BodyOfRevolution, Direction};
use record::{Orientation, Robot, RobotShape};

/// The paper's ratio of length to diameter, or of long to short semi-axis.
pub const PAPER_ASPECT: f64 = 68.0 / 7.0;

/// A body of the study: shape, orientation and size rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StudyBody {
    /// Shape of the body.
    pub shape: BodyShape,
    /// Orientation relative to the force; it has no effect for a sphere.
    pub orientation: Orientation,
    /// Size rule: the sphere's volume or the sphere's surface area.
    pub rule: SizeRule,
    /// The body as a robot of an experiment.
    pub robot: Robot,
}

impl StudyBody {
    /// The body with this aspect ratio (length divided by diameter). The rule sets its size from a sphere of this diameter.
    pub fn new(
        (shape, orientation): (BodyShape, Orientation),
        aspect: f64,
        rule: SizeRule,
        sphere_diameter_m: f64,
    ) -> Self {
        let sphere = RobotShape::Sphere { diameter_m: sphere_diameter_m };
        let of_size = of_equal_size((shape, orientation), aspect, rule, &sphere);
        Self { shape, orientation, rule, robot: Robot { shape: of_size, density_kg_m3: None, offset: None } }
    }

    /// Geometry of the body.
    pub fn revolution(&self) -> BodyOfRevolution {
        body_and_direction(&self.robot.shape).0
    }

    /// Direction of the force relative to the body's axis.
    pub fn direction(&self) -> Direction {
        body_and_direction(&self.robot.shape).1
    }

    /// Length along the axis of revolution and diameter across it, in m.
    pub fn sizes_m(&self) -> [f64; 2] {
        match self.robot.shape {
            RobotShape::Sphere { diameter_m } => [diameter_m; 2],
            RobotShape::Ellipsoid { length_m, diameter_m, .. } | RobotShape::Cylinder { length_m, diameter_m, .. } => {
                [length_m, diameter_m]
            }
        }
    }

    /// Label of the body in figures and sentences.
    pub fn label(&self) -> String {
        match (self.shape, self.orientation) {
            (BodyShape::Sphere, _) => "sphere".into(),
            (shape, Orientation::Horizontal) => format!("{}, horizontal", shape.name()),
            (shape, Orientation::Vertical) => format!("{}, vertical", shape.name()),
        }
    }
}

/// Returns ten bodies: the sphere, and the ellipsoid and the cylinder in both orientations, each under both size rules.
pub fn bodies(aspect: f64, sphere_diameter_m: f64) -> Vec<StudyBody> {
    use Orientation::{Horizontal, Vertical};
    let five = [
        (BodyShape::Sphere, Horizontal),
        (BodyShape::Ellipsoid, Horizontal),
        (BodyShape::Ellipsoid, Vertical),
        (BodyShape::Cylinder, Horizontal),
        (BodyShape::Cylinder, Vertical),
    ];
    let sized = |rule: SizeRule, form: (BodyShape, Orientation)| StudyBody::new(form, aspect, rule, sphere_diameter_m);
    SizeRule::ALL.into_iter().flat_map(|rule| five.map(|form| sized(rule, form))).collect()
}
