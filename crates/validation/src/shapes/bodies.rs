//! The five bodies of the study (shapes in their orientations). Each has the sphere's volume or its surface area.

use documents::shapes::{BodyShape, SizeRule};
use elements::fe::meridional::{BodyOfRevolution, Direction};
use record::{Orientation, Robot, RobotShape};

/// The paper's ratio of length to diameter, or of long to short semi-axis.
pub const PAPER_ASPECT: f64 = 68.0 / 7.0;

/// Returns the body of revolution with this shape and aspect ratio (length divided by diameter). The rule sets its size from a sphere of this diameter.
pub fn sized(shape: BodyShape, aspect: f64, rule: SizeRule, sphere_diameter_m: f64) -> BodyOfRevolution {
    let sphere = BodyOfRevolution::sphere(0.5 * sphere_diameter_m);
    let unit = match shape {
        BodyShape::Sphere => return sphere,
        BodyShape::Ellipsoid => BodyOfRevolution::Spheroid { semi_axis_along_m: 0.5 * aspect, semi_axis_across_m: 0.5 },
        BodyShape::Cylinder => BodyOfRevolution::Cylinder { length_m: aspect, diameter_m: 1.0 },
    };
    unit.scaled(match rule {
        SizeRule::EqualVolume => (sphere.volume_m3() / unit.volume_m3()).cbrt(),
        SizeRule::EqualSurface => (sphere.surface_area_m2() / unit.surface_area_m2()).sqrt(),
    })
}

/// A body of the study: shape, orientation and size rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StudyBody {
    /// Shape of the body.
    pub shape: BodyShape,
    /// Orientation relative to the force; it has no effect for a sphere.
    pub orientation: Orientation,
    /// Size rule: the sphere's volume or the sphere's surface area.
    pub rule: SizeRule,
    /// Geometry of the body.
    pub revolution: BodyOfRevolution,
}

impl StudyBody {
    /// Direction of the force relative to the body's axis.
    pub fn direction(&self) -> Direction {
        match self.orientation {
            Orientation::Horizontal => Direction::Axial,
            Orientation::Vertical => Direction::Transverse,
        }
    }

    /// Length along the axis of revolution and diameter across it, in m.
    pub fn sizes_m(&self) -> [f64; 2] {
        match self.revolution {
            BodyOfRevolution::Spheroid { semi_axis_along_m, semi_axis_across_m } => {
                [2.0 * semi_axis_along_m, 2.0 * semi_axis_across_m]
            }
            BodyOfRevolution::Cylinder { length_m, diameter_m } => [length_m, diameter_m],
        }
    }

    /// Returns the body as a robot of an experiment.
    pub fn robot(&self) -> Robot {
        let ([length_m, diameter_m], orientation) = (self.sizes_m(), self.orientation);
        let shape = match self.shape {
            BodyShape::Sphere => RobotShape::Sphere { diameter_m },
            BodyShape::Ellipsoid => RobotShape::Ellipsoid { length_m, diameter_m, orientation },
            BodyShape::Cylinder => RobotShape::Cylinder { length_m, diameter_m, orientation },
        };
        Robot { shape, density_kg_m3: None, offset: None }
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
    let sized = |rule: SizeRule, (shape, orientation): (BodyShape, Orientation)| StudyBody {
        shape,
        orientation,
        rule,
        revolution: sized(shape, aspect, rule, sphere_diameter_m),
    };
    SizeRule::ALL.into_iter().flat_map(|rule| five.map(|pair| sized(rule, pair))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At equal volume the surface areas of sphere, ellipsoid and cylinder are in the ratio 1 : 1.684 : 1.712 (the paper, physics §4.4).
    #[test]
    fn surfaces_are_the_papers() {
        let area = |shape: BodyShape| sized(shape, PAPER_ASPECT, SizeRule::EqualVolume, 0.55e-3).surface_area_m2();
        assert!((area(BodyShape::Ellipsoid) / area(BodyShape::Sphere) - 1.684).abs() < 1e-3);
        assert!((area(BodyShape::Cylinder) / area(BodyShape::Sphere) - 1.712).abs() < 1e-3);
        let surface = |shape: BodyShape| sized(shape, PAPER_ASPECT, SizeRule::EqualSurface, 0.55e-3).surface_area_m2();
        assert!((surface(BodyShape::Cylinder) / surface(BodyShape::Sphere) - 1.0).abs() < 1e-14);
        assert_eq!(bodies(PAPER_ASPECT, 0.55e-3).len(), 10);
    }
}
