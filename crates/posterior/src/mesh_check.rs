//! Check of the user's mesh against the apparatus in the experiment's description.

use documents::posterior::{Warning, WarningKind};
use elements::mesh::{ElementKind, Mesh};
use record::{Offset, Robot, RobotShape, Vitreous};

/// Largest relative difference between a size in the mesh and in the description that causes no warning.
const SIZE_TOLERANCE: f64 = 0.01;
/// Poisson ratio above which displacement-only tetrahedra are unreliable (physics §3.5).
const TETRAHEDRA_LIMIT: f64 = 0.49;

/// Creates a warning about the user's mesh.
pub fn warning(text: impl Into<String>, advice: &str) -> Warning {
    Warning { kind: WarningKind::Mesh, text: text.into(), advice: advice.into() }
}

/// Warnings about doubtful properties of the user's mesh. Without a robot, the body's shape and size are not checked.
pub fn mesh_warnings(mesh: &Mesh, robot: Option<&Robot>, vitreous: &Vitreous) -> Vec<Warning> {
    let mut list = Vec::new();
    // The robot's centre is at the origin. The centre of the vitreous may be offset from it, to either side.
    let reach_m = |nodes: &[u32], offset: Option<Offset>| {
        let from = |shift_m: [f64; 3]| {
            let squared = |&node: &u32| {
                mesh.node_coordinates_m[node as usize].iter().zip(shift_m).map(|(x, s)| (x + s).powi(2)).sum::<f64>()
            };
            nodes.iter().map(squared).fold(0.0, f64::max).sqrt()
        };
        let mut shift_m = [0.0; 3];
        let Some(offset) = offset else { return from(shift_m) };
        shift_m[offset.direction.axis()] = offset.distance_m;
        from(shift_m).min(from(shift_m.map(|s| -s)))
    };
    let of_robot = |robot: &Robot| {
        let is_sphere = matches!(robot.shape, RobotShape::Sphere { .. });
        let what = if is_sphere { "the robot's radius" } else { "the robot's reach from its centre" };
        (what, reach_m(&mesh.robot_nodes, None), robot.shape.outer_radius_m(), "[robot]")
    };
    let of_gel = (
        "the radius of the outer surface",
        reach_m(&mesh.outer_nodes, robot.and_then(|robot| robot.offset)),
        0.5 * vitreous.diameter_m,
        "[vitreous]",
    );
    let sizes = robot.map(of_robot).into_iter().chain([of_gel]);
    for (name, mesh_m, experiment_m, table) in sizes {
        if (mesh_m / experiment_m - 1.0).abs() > SIZE_TOLERANCE {
            let text = format!(
                "{name} is {:.4} mm in the mesh and {:.4} mm in {table} of experiment.toml; the mesh is used",
                1e3 * mesh_m,
                1e3 * experiment_m
            );
            list.push(warning(text, "check the mesh, its unit (--mesh-unit) and the experiment"));
        }
    }
    let is_tetrahedral = mesh.element_kind != ElementKind::Hexahedron27;
    if is_tetrahedral && vitreous.poisson_ratio > TETRAHEDRA_LIMIT {
        let text = format!(
            "tetrahedra are too stiff in nearly incompressible gels, and the Poisson ratio {} is above {TETRAHEDRA_LIMIT}",
            vitreous.poisson_ratio
        );
        list.push(warning(text, "compare with a finer mesh, or use the built-in mesh"));
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use elements::mesh::QuarterBall;
    use record::OffsetDirection;

    fn mesh() -> Mesh {
        QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 1, n_layers: 4 }.mesh().unwrap()
    }

    fn apparatus(robot_mm: f64, vitreous_mm: f64, poisson_ratio: f64) -> (Robot, Vitreous) {
        let shape = RobotShape::Sphere { diameter_m: 1e-3 * robot_mm };
        (
            Robot { shape, density_kg_m3: None, offset: None },
            Vitreous { diameter_m: 1e-3 * vitreous_mm, poisson_ratio, density_kg_m3: None },
        )
    }

    #[test]
    fn a_mesh_of_the_same_apparatus_raises_no_doubt() {
        let (robot, vitreous) = apparatus(0.552, 19.9, 0.499);
        assert_eq!(mesh_warnings(&mesh(), Some(&robot), &vitreous), Vec::<Warning>::new());
    }

    #[test]
    fn sizes_that_differ_by_more_than_one_per_cent_are_named() {
        let (robot, vitreous) = apparatus(0.56, 20.0, 0.48);
        let found = mesh_warnings(&mesh(), Some(&robot), &vitreous);
        assert!(
            found.len() == 1 && found[0].text.contains("0.2750 mm in the mesh and 0.2800 mm in [robot]"),
            "{found:?}"
        );
        let (robot, vitreous) = apparatus(0.55, 20.5, 0.48);
        let found = mesh_warnings(&mesh(), Some(&robot), &vitreous);
        assert!(found.len() == 1 && found[0].text.contains("[vitreous]"), "{found:?}");
    }

    /// A mesh with an offset between robot and vitreous agrees only with an experiment with this offset, to either side.
    #[test]
    fn the_outer_surface_is_looked_for_around_the_vitreous() {
        let (centred, vitreous) = apparatus(0.55, 20.0, 0.48);
        let offset = Some(Offset { distance_m: 2e-3, direction: OffsetDirection::Along });
        let robot = Robot { offset, ..centred };
        let mut moved = crate::mechanics::robot_mesh(&robot, &vitreous, 1).unwrap();
        assert_eq!(mesh_warnings(&moved, Some(&robot), &vitreous), Vec::<Warning>::new());
        let found = mesh_warnings(&moved, Some(&centred), &vitreous);
        assert!(found.len() == 1 && found[0].text.contains("12.0000 mm in the mesh and 10.0000 mm"), "{found:?}");
        moved.node_coordinates_m.iter_mut().for_each(|place| place[0] = -place[0]);
        assert_eq!(mesh_warnings(&moved, Some(&robot), &vitreous), Vec::<Warning>::new());
    }

    #[test]
    fn tetrahedra_are_doubted_above_their_poisson_ratio_only() {
        // The check uses only the kind of the elements.
        let tetrahedral = Mesh { element_kind: ElementKind::Tetrahedron10, connectivity: Vec::new(), ..mesh() };
        let (robot, vitreous) = apparatus(0.55, 20.0, 0.495);
        let found = mesh_warnings(&tetrahedral, Some(&robot), &vitreous);
        assert!(found.len() == 1 && found[0].text.contains("0.495"), "{found:?}");
        let (robot, vitreous) = apparatus(0.55, 20.0, 0.48);
        assert!(mesh_warnings(&tetrahedral, Some(&robot), &vitreous).is_empty());
    }
}
