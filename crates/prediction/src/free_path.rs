//! Distance that a robot can move before it touches the outer surface of the gel.

use documents::posterior::{Warning, WarningKind};
use figures::number::format_significant;
use record::{Offset, OffsetDirection, Orientation, Robot, RobotShape, Vitreous};
use std::f64::consts::FRAC_PI_2;

/// Number of points of a quarter of an ellipse. The error of the distance is below 10⁻⁶ of the robot's size.
const N_POINTS: usize = 1_000;

/// Distance in m that a robot can move along its force until its surface touches the outer surface of the gel. An offset along the force has no sign and counts as towards
/// the surface.
pub fn free_path_m(robot: &Robot, vitreous: &Vitreous) -> f64 {
    let radius_m = 0.5 * vitreous.diameter_m;
    let [along_m, across_m] = match robot.offset {
        None => [0.0, 0.0],
        Some(Offset { distance_m, direction: OffsetDirection::Along }) => [distance_m, 0.0],
        Some(Offset { distance_m, direction: OffsetDirection::Across }) => [0.0, distance_m],
    };
    // Way of one point of the robot's surface: its distance from the centre across the force stays.
    let way_m = |[x_m, y_m]: [f64; 2]| {
        let across_m = across_m + y_m;
        (radius_m * radius_m - across_m * across_m).max(0.0).sqrt() - along_m - x_m
    };
    quarter_outline_m(&robot.shape).into_iter().map(way_m).fold(f64::INFINITY, f64::min).max(0.0)
}

/// Warning about a robot that would leave the gel, as impossible if this happens in more than `most_share` of the draws. `each_m` holds the largest displacement (m) of every draw, in
/// ascending order.
pub(crate) fn beyond_the_gel(
    (robot, vitreous): (&Robot, &Vitreous),
    each_m: &[f64],
    most_share: f64,
) -> Option<Warning> {
    let free_m = free_path_m(robot, vitreous);
    let n_beyond = each_m.len() - each_m.partition_point(|x| *x <= free_m);
    let share = n_beyond as f64 / each_m.len() as f64;
    (n_beyond > 0).then(|| Warning {
        kind: if share > most_share { WarningKind::ImpossiblePositions } else { WarningKind::Extrapolation },
        text: format!(
            "in {} % of the draws the robot moves beyond the gel's outer surface, which it touches after {} µm",
            format_significant(100.0 * share, 2),
            format_significant(1e6 * free_m, 4)
        ),
        advice: "give a smaller force or a shorter time".into(),
    })
}

/// Points in m of a quarter of the robot's outline that contain the first one to touch a sphere: along the force and across it.
fn quarter_outline_m(shape: &RobotShape) -> Vec<[f64; 2]> {
    let half_sizes_m = |length_m: f64, diameter_m: f64, orientation| match orientation {
        Orientation::Horizontal => [0.5 * length_m, 0.5 * diameter_m],
        Orientation::Vertical => [0.5 * diameter_m, 0.5 * length_m],
    };
    let ellipse = |[x_m, y_m]: [f64; 2]| {
        let angle = |k: usize| FRAC_PI_2 * k as f64 / N_POINTS as f64;
        (0..=N_POINTS).map(|k| [x_m * angle(k).cos(), y_m * angle(k).sin()]).collect()
    };
    match *shape {
        RobotShape::Sphere { diameter_m } => ellipse([0.5 * diameter_m; 2]),
        RobotShape::Ellipsoid { length_m, diameter_m, orientation } => {
            ellipse(half_sizes_m(length_m, diameter_m, orientation))
        }
        // The rim is the farthest part of a cylinder from any point of the gel.
        RobotShape::Cylinder { length_m, diameter_m, orientation } => {
            vec![half_sizes_m(length_m, diameter_m, orientation)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VITREOUS: Vitreous = Vitreous { diameter_m: 0.02, poisson_ratio: 0.48, density_kg_m3: None };

    fn free_mm(shape: RobotShape, offset: Option<(f64, OffsetDirection)>) -> f64 {
        let offset = offset.map(|(distance_m, direction)| Offset { distance_m, direction });
        1e3 * free_path_m(&Robot { shape, density_kg_m3: None, offset }, &VITREOUS)
    }

    /// Closed forms: a sphere of radius r touches a sphere of radius R where the distance of their centres is R − r, and a cylinder touches it with its rim.
    #[test]
    fn spheres_and_cylinders_touch_the_outer_surface_where_geometry_says() {
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-6, "{found} mm, not {expected}");
        let sphere = RobotShape::Sphere { diameter_m: 0.55e-3 };
        near(free_mm(sphere, None), 9.725);
        near(free_mm(sphere, Some((2e-3, OffsetDirection::Along))), 7.725);
        near(free_mm(sphere, Some((2e-3, OffsetDirection::Across))), (9.725_f64.powi(2) - 4.0).sqrt());
        let cylinder = |orientation| RobotShape::Cylinder { length_m: 4e-3, diameter_m: 1e-3, orientation };
        near(free_mm(cylinder(Orientation::Horizontal), None), (100.0_f64 - 0.25).sqrt() - 2.0);
        near(free_mm(cylinder(Orientation::Vertical), None), (100.0_f64 - 4.0).sqrt() - 0.5);
    }

    /// One of twenty draws passes the outer surface, which is an extrapolation; two of twenty are impossible.
    #[test]
    fn draws_beyond_the_outer_surface_are_named_with_the_free_way() {
        let shape = RobotShape::Sphere { diameter_m: 0.55e-3 };
        let robot = Robot { shape, density_kg_m3: None, offset: None };
        let warning = |n_beyond: usize| {
            let each_m: Vec<f64> = (0..20).map(|k| if k < 20 - n_beyond { 9.724e-3 } else { 9.726e-3 }).collect();
            beyond_the_gel((&robot, &VITREOUS), &each_m, 0.06)
        };
        assert_eq!(warning(0), None);
        let [few, many] = [1, 2].map(|n_beyond| warning(n_beyond).expect("a warning"));
        assert!(few.text.ends_with("outer surface, which it touches after 9725 µm"), "{}", few.text);
        assert_eq!([few.kind, many.kind], [WarningKind::Extrapolation, WarningKind::ImpossiblePositions]);
    }

    /// After its way, an ellipsoid has a point on the outer surface and none beyond it. The point lies beside its tip if it is long across the force.
    #[test]
    fn ellipsoids_touch_the_outer_surface_with_one_point() {
        for (orientation, [x, y]) in [(Orientation::Horizontal, [3.0, 0.5]), (Orientation::Vertical, [0.5, 3.0])] {
            let shape = RobotShape::Ellipsoid { length_m: 6e-3, diameter_m: 1e-3, orientation };
            let free_mm = free_mm(shape, None);
            let distance = |k: usize| {
                let angle = FRAC_PI_2 * k as f64 / 1e5;
                (free_mm + x * angle.cos()).hypot(y * angle.sin())
            };
            let farthest = (0..=100_000).map(distance).fold(0.0, f64::max);
            assert!((farthest - 10.0).abs() < 1e-6, "{farthest} mm");
        }
    }
}
