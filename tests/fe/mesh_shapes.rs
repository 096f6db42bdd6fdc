//! Built-in meshes of spheroids and cylinders: valid elements over the whole range, correct node positions, refusals beyond the range.

use vitreo_uq::elements::fe::quality::MeshQuality;
use vitreo_uq::elements::mesh::{Cylinder, Mesh, Spheroid};
use vitreo_uq::posterior::mechanics::robot_mesh;
use vitreo_uq::record::{Orientation, Robot, RobotShape, Vitreous};

const ORIENTATIONS: [Orientation; 2] = [Orientation::Horizontal, Orientation::Vertical];

fn cylinder(aspect: f64, reach: f64, orientation: Orientation, level: usize) -> Mesh {
    let diameter_m = 2.0 * reach / aspect.hypot(1.0);
    let length_m = aspect * diameter_m;
    Cylinder { length_m, diameter_m, orientation, outer_radius_m: 1.0, level }.mesh().expect("in range")
}

fn spheroid(aspect: f64, reach: f64, orientation: Orientation, level: usize) -> Mesh {
    let (length_m, diameter_m) = (2.0 * reach, 2.0 * reach / aspect);
    Spheroid { length_m, diameter_m, orientation, outer_radius_m: 1.0, level }.mesh().expect("in range")
}

/// From discs to needles, from tiny bodies to nearly touching ones, at every level of the program.
#[test]
fn every_element_is_sound() {
    for reach in [1e-3, 0.03, 0.125, 0.4, 0.79] {
        for level in 1..=4 {
            for aspect in [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 68.0 / 7.0, 20.0, 30.0] {
                let found = MeshQuality::of(&cylinder(aspect, reach, Orientation::Vertical, level));
                let what = format!("cylinder of aspect {aspect}, reach {reach}, level {level}: {found:?}");
                assert!(found.n_inverted == 0 && found.smallest_scaled_jacobian > 0.19, "{what}");
                // Layers at the surface are thin because of the rim.
                assert!(found.largest_aspect < 150.0 * (level as f64).powi(3), "{what}");
            }
            for aspect in [1.0, 2.0, 5.0, 68.0 / 7.0, 20.0, 30.0] {
                let found = MeshQuality::of(&spheroid(aspect, reach, Orientation::Vertical, level));
                let what = format!("spheroid of aspect {aspect}, reach {reach}, level {level}: {found:?}");
                // Diamond-shaped elements where three patches meet, as slender as the body.
                assert!(found.n_inverted == 0 && found.smallest_scaled_jacobian > (2.0 / aspect).min(0.7), "{what}");
                assert!(found.largest_aspect < 40.0, "{what}");
            }
        }
    }
}

#[test]
fn nodes_stand_where_they_belong() {
    for orientation in ORIENTATIONS {
        let (aspect, reach) = (3.0, 0.3);
        // Coordinates along the axis and away from it.
        let meridian = |[x, y, z]: [f64; 3]| match orientation {
            Orientation::Horizontal => [x.abs(), y.hypot(z)],
            Orientation::Vertical => [y.abs(), x.hypot(z)],
        };
        let radius = reach / f64::hypot(aspect, 1.0);
        let on_cylinder = |[axial, radial]: [f64; 2]| (axial / (aspect * radius)).max(radial / radius);
        let on_spheroid = |[axial, radial]: [f64; 2]| (axial / reach).hypot(radial * aspect / reach);
        for is_cylinder in [true, false] {
            let of_kind = if is_cylinder { cylinder } else { spheroid };
            let mesh: Mesh = of_kind(aspect, reach, orientation, 2);
            let on_body = |at: [f64; 2]| if is_cylinder { on_cylinder(at) } else { on_spheroid(at) };
            let at = |node: &u32| mesh.node_coordinates_m[*node as usize];
            assert!(mesh.robot_nodes.iter().all(|n| (on_body(meridian(at(n))) - 1.0).abs() < 1e-12));
            assert!(mesh.outer_nodes.iter().all(|n| (at(n).iter().map(|c| c * c).sum::<f64>() - 1.0).abs() < 1e-12));
            let n_nodes = mesh.n_nodes() as u32;
            let others = (0..n_nodes).filter(|n| mesh.robot_nodes.binary_search(n).is_err());
            assert!(others.clone().all(|n| on_body(meridian(at(&n))) > 1.0));
            for (axis, nodes) in [(1, &mesh.symmetry_y_nodes), (2, &mesh.symmetry_z_nodes)] {
                let on_plane: Vec<u32> = (0..n_nodes).filter(|n| at(n)[axis] == 0.0).collect();
                assert_eq!(&on_plane, nodes);
                assert!((0..n_nodes).all(|n| at(&n)[axis] >= 0.0));
            }
        }
    }
}

#[test]
fn bodies_that_are_not_meshed_are_refused_with_a_reason() {
    let vitreous = Vitreous { diameter_m: 20e-3, poisson_ratio: 0.48, density_kg_m3: None };
    let refused = |shape: RobotShape, words: &[&str]| {
        let robot = Robot { shape, density_kg_m3: None, offset: None };
        let error = robot_mesh(&robot, &vitreous, 1).unwrap_err();
        let text = error.to_string();
        assert!(error.exit_code() == 2 && words.iter().all(|word| text.contains(word)), "{text}");
    };
    let orientation = Orientation::Vertical;
    let cylinder = |length_m, diameter_m| RobotShape::Cylinder { length_m, diameter_m, orientation };
    let ellipsoid = |length_m, diameter_m| RobotShape::Ellipsoid { length_m, diameter_m, orientation };
    refused(cylinder(4e-3, 0.1e-3), &["`robot`", "from 0.1 to 30 times", "40.000", "mesh FILE.msh"]);
    refused(cylinder(0.1e-3, 4e-3), &["0.025 times"]);
    refused(cylinder(15e-3, 9e-3), &["rim is 0.875", "0.8 is the limit", "mesh FILE.msh"]);
    refused(ellipsoid(4e-3, 0.1e-3), &["`robot`", "from 1 to 30 times", "40.000", "mesh FILE.msh"]);
    refused(ellipsoid(1e-3, 2e-3), &["0.500 times"]);
    refused(ellipsoid(21e-3, 9e-3), &["lies inside the vitreous"]);
    refused(ellipsoid(f64::NAN, 9e-3), &["NaN"]);
}
