//! A robot off the vitreous's centre: the half-meridian reference against known results, the three-dimensional elements against the reference.

use std::f64::consts::PI;

use vitreo_uq::elements::fe::Stiffness;
use vitreo_uq::elements::fe::exact::SphereInContainer;
use vitreo_uq::elements::fe::meridional::{Direction, EccentricSphere, EccentricStiffness, Formulation, Resolution};
use vitreo_uq::elements::fe::quality::MeshQuality;
use vitreo_uq::elements::fe::spatial::GelAndRobot;
use vitreo_uq::elements::fe::surface::RobotSize;
use vitreo_uq::elements::fe::time::FullOrderModel;
use vitreo_uq::elements::mesh::Mesh;
use vitreo_uq::models::effects::{EFFECTS, FieldEffect};
use vitreo_uq::posterior::mechanics::{robot_mesh, sizes_of};
use vitreo_uq::record::{Offset, OffsetDirection, Orientation, Robot, RobotShape, Vitreous};

const RADIUS_M: f64 = 0.275e-3;
const OUTER_M: f64 = 10e-3;
const DIRECTIONS: [(OffsetDirection, Direction); 2] =
    [(OffsetDirection::Along, Direction::Axial), (OffsetDirection::Across, Direction::Transverse)];

fn at_order(order: usize) -> Resolution {
    Resolution { order, ..Resolution::default() }
}

fn eccentric(offset_m: f64, nu: f64, direction: Direction, resolution: Resolution) -> EccentricStiffness {
    let sphere = EccentricSphere { radius_m: RADIUS_M, outer_radius_m: OUTER_M, offset_m };
    let found = sphere.solve(nu, direction, resolution).expect("a sound problem");
    assert!((found.by_reaction_m / found.translation_m - 1.0).abs() < 1e-9, "energy and reaction: {found:?}");
    found
}

/// At the centre translation agrees with physics §4.2 and rotation with 8πμR³/(1 − λ³) at any Poisson ratio, and the two are uncoupled.
#[test]
fn the_reference_in_the_middle_is_the_closed_form() {
    for nu in [0.0, 0.3, 0.48, 0.499] {
        let exact = SphereInContainer::new(nu, RADIUS_M, OUTER_M).stiffness_n_per_m(1.0);
        for (_, direction) in DIRECTIONS {
            let found = eccentric(0.0, nu, direction, at_order(10));
            assert!((found.translation_m / exact - 1.0).abs() < 1e-9, "{nu} {direction:?}: {found:?} {exact}");
        }
        let found = eccentric(0.0, nu, Direction::Transverse, at_order(10));
        let mu = 0.5 / (1.0 + nu);
        let torque = 8.0 * PI * mu * RADIUS_M.powi(3) / (1.0 - (RADIUS_M / OUTER_M).powi(3));
        assert!((found.rotation_m3.expect("mode 1") / torque - 1.0).abs() < 1e-8, "{nu}: {found:?} {torque:e}");
        assert!(found.coupling_m2.expect("mode 1").abs() < 1e-9 * found.translation_m * RADIUS_M);
    }
}

/// Exact series of a sphere that moves towards a plane wall in Stokes flow, its centre `height` radii above, over 6πμR (H. Brenner, Chem. Eng. Sci. 16, 242, 1961,
/// doi:10.1016/0009-2509(61)80035-3).
fn towards_a_wall(height: f64) -> f64 {
    let alpha = height.acosh();
    let term = |n: f64| {
        let (top, bottom) = (
            2.0 * ((2.0 * n + 1.0) * alpha).sinh() + (2.0 * n + 1.0) * (2.0 * alpha).sinh(),
            4.0 * ((n + 0.5) * alpha).sinh().powi(2) - ((2.0 * n + 1.0) * alpha.sinh()).powi(2),
        );
        n * (n + 1.0) / ((2.0 * n - 1.0) * (2.0 * n + 3.0)) * (top / bottom - 1.0)
    };
    4.0 / 3.0 * alpha.sinh() * (1..60).map(|n| term(f64::from(n))).sum::<f64>()
}

/// Faxén's series, to the fifth power, of a sphere that moves along the wall without rotation.
fn along_a_wall(height: f64) -> f64 {
    let x = 1.0 / height;
    1.0 / (1.0 - 9.0 / 16.0 * x + x.powi(3) / 8.0 - 45.0 / 256.0 * x.powi(4) - x.powi(5) / 16.0)
}

/// As ν → ½ and the outer sphere becomes a plane, the reference becomes Stokes flow by a wall: exactly towards it, and along it up to the series' next power.
#[test]
#[ignore = "thorough"]
fn the_reference_by_a_wall_is_brenners_and_faxens() {
    let drag = |height: f64, direction: Direction| {
        let at = |outer_radius_m: f64, nu: f64| {
            let sphere = EccentricSphere { radius_m: 1.0, outer_radius_m, offset_m: outer_radius_m - height };
            let found = sphere.solve(nu, direction, at_order(9)).expect("a sound problem");
            found.translation_m * 2.0 * (1.0 + nu) / (6.0 * PI)
        };
        let incompressible = |outer_radius_m| 2.0 * at(outer_radius_m, 0.4999) - at(outer_radius_m, 0.4998);
        // The wall's curvature acts to first order.
        2.0 * incompressible(4e3) - incompressible(2e3)
    };
    for height in [2.0, 4.0, 10.0] {
        let towards = drag(height, Direction::Axial) / towards_a_wall(height) - 1.0;
        let along = drag(height, Direction::Transverse) / along_a_wall(height) - 1.0;
        println!("{height} radii: towards {towards:e}, along {along:e}");
        assert!(towards.abs() < 2e-6, "{height}: {towards:e}");
        assert!(along.abs() < 0.3 * f64::powi(height, -6) + 5e-6, "{height}: {along:e}");
    }
}

/// Errors fall exponentially with the order. The displacement-only form converges to the same value from above, and the estimate covers the error of the next lower order.
#[test]
#[ignore = "thorough"]
fn the_reference_converges_and_knows_its_error() {
    for (offset_m, ceilings) in [(2e-3, [1e-6, 1e-10]), (8e-3, [2e-6, 1e-9])] {
        for (_, direction) in DIRECTIONS {
            let best = eccentric(offset_m, 0.48, direction, at_order(13)).translation_m;
            for (order, ceiling) in [6, 9].into_iter().zip(ceilings) {
                let found = eccentric(offset_m, 0.48, direction, at_order(order));
                let error = (found.translation_m / best - 1.0).abs();
                println!("{offset_m} {direction:?}, order {order}: {error:e}, {} unknowns", found.n_unknowns);
                assert!(error < ceiling && error < found.relative_error, "{order}: {error:e} {found:?}");
            }
            let alone = Resolution { formulation: Formulation::Displacement, ..at_order(12) };
            let excess = eccentric(offset_m, 0.48, direction, alone).translation_m / best - 1.0;
            assert!((-1e-8..1e-6).contains(&excess), "{direction:?}: {excess:e}");
        }
    }
}

/// A freely rotating sphere has a lower stiffness across the line of centres, by 3·10⁻⁸, 2.2·10⁻⁷ and 1.1·10⁻⁶ at 2, 5 and 8 mm. Restricting the
/// robot to translation is therefore harmless.
#[test]
fn rotation_does_not_matter() {
    for (offset_mm, share) in [(2.0, 2.8e-8), (5.0, 2.2e-7), (8.0, 1.05e-6)] {
        let found = eccentric(1e-3 * offset_mm, 0.48, Direction::Transverse, at_order(10));
        let less = 1.0 - found.free_translation_m / found.translation_m;
        assert!((less / share - 1.0).abs() < 0.02, "{offset_mm} mm: {less:e}");
    }
}

fn apparatus(shape: RobotShape, offset_mm: f64, direction: OffsetDirection) -> (Robot, Vitreous) {
    let offset = Some(Offset { distance_m: 1e-3 * offset_mm, direction });
    let vitreous = Vitreous { diameter_m: 2.0 * OUTER_M, poisson_ratio: 0.48, density_kg_m3: None };
    (Robot { shape, density_kg_m3: None, offset }, vitreous)
}

fn mesh_of(shape: RobotShape, offset_mm: f64, direction: OffsetDirection, level: usize) -> Mesh {
    let (robot, vitreous) = apparatus(shape, offset_mm, direction);
    robot_mesh(&robot, &vitreous, level).expect("a mesh")
}

const SPHERE: RobotShape = RobotShape::Sphere { diameter_m: 2.0 * RADIUS_M };

/// Errors are below 2·10⁻⁴ at the model's level (15,480 unknowns along, 30,430 across), and decrease.
#[test]
#[ignore = "thorough"]
fn elements_off_the_centre_converge_to_the_reference() {
    for offset_mm in [2.0, 5.0, 8.0] {
        for (direction, mode) in DIRECTIONS {
            let exact_m = eccentric(1e-3 * offset_mm, 0.48, mode, at_order(10)).translation_m;
            let errors = [1, 2, 3].map(|level| {
                let stiffness = Stiffness::new(&mesh_of(SPHERE, offset_mm, direction, level)).expect("a sound mesh");
                let model = FullOrderModel::new(&stiffness, 0.48).expect("positive definite");
                let error = 1.0 / (model.compliance_per_m() * exact_m) - 1.0;
                println!("{offset_mm} mm {direction:?}, level {level}: {} unknowns, {error:e}", stiffness.n_unknowns());
                error.abs()
            });
            assert!(errors[2] < 2e-4 && errors[1] < 1e-3 && errors[2] < 0.7 * errors[1], "{errors:?}");
            assert!(errors[1] < 0.5 * errors[0], "{errors:?}");
        }
    }
}

/// The robot keeps its shape exactly, the outer surface is centred on the vitreous, and elements stay well shaped. The half model contains half of the robot.
#[test]
fn meshes_have_their_surfaces_where_they_belong() {
    let cylinder = RobotShape::Cylinder { length_m: 1.8e-3, diameter_m: 0.28e-3, orientation: Orientation::Vertical };
    let ellipsoid =
        RobotShape::Ellipsoid { length_m: 1.8e-3, diameter_m: 0.3e-3, orientation: Orientation::Horizontal };
    for shape in [SPHERE, cylinder, ellipsoid] {
        for (direction, share) in [(OffsetDirection::Along, 0.25), (OffsetDirection::Across, 0.5)] {
            let (robot, vitreous) = apparatus(shape, 0.0, direction);
            let centred = robot_mesh(&Robot { offset: None, ..robot }, &vitreous, 2).expect("a mesh");
            let quality = MeshQuality::of(&centred);
            for offset_mm in [2.0, 5.0, 8.0] {
                let mesh = mesh_of(shape, offset_mm, direction, 2);
                assert_eq!(mesh.share(), share);
                let at = |node: &u32| mesh.node_coordinates_m[*node as usize];
                let robot: Vec<[f64; 3]> =
                    centred.robot_nodes.iter().map(|n| centred.node_coordinates_m[*n as usize]).collect();
                assert!(robot.iter().zip(&mesh.robot_nodes).all(|(x, node)| *x == at(node)));
                for node in &mesh.outer_nodes {
                    let mut place = at(node);
                    place[direction.axis()] += 1e-3 * offset_mm;
                    let distance = place.iter().map(|c| c * c).sum::<f64>().sqrt();
                    assert!((distance / OUTER_M - 1.0).abs() < 1e-12, "{place:?}");
                }
                let size = RobotSize::of(&mesh);
                assert!((size.volume_m3 / shape.volume_m3() - 1.0).abs() < 1e-3, "{shape:?} {direction:?}: {size:?}");
                let found = MeshQuality::of(&mesh);
                println!("{shape:?} {offset_mm} {direction:?}: {found:?}, centred {quality:?}");
                assert_eq!(found.n_inverted, 0);
                assert!(found.smallest_scaled_jacobian > 0.5 * quality.smallest_scaled_jacobian);
                for node in 0..mesh.n_nodes() as u32 {
                    assert_eq!(at(&node)[2] == 0.0, mesh.symmetry_z_nodes.binary_search(&node).is_ok());
                    if direction == OffsetDirection::Along {
                        assert_eq!(at(&node)[1] == 0.0, mesh.symmetry_y_nodes.binary_search(&node).is_ok());
                    }
                }
            }
        }
    }
}

/// At zero offset the half model equals two quarter models: its matrices of inertia and slip give the same responses.
#[test]
fn the_half_model_is_the_quarter_model_where_both_hold() {
    let shift = 1e-9;
    let (centred, vitreous) = apparatus(SPHERE, 1.0, OffsetDirection::Across);
    let centred = Robot { offset: None, ..centred };
    let across = Robot { offset: Some(Offset { distance_m: shift, direction: OffsetDirection::Across }), ..centred };
    // Stiffness and mass or friction have comparable weight.
    for (slug, weight) in [("inertia", 1e4), ("interface-slip", 1e3)] {
        let effect = EFFECTS.iter().find(|effect| effect.slug() == slug).expect("an effect");
        let Some(FieldEffect::Pair(pair)) = effect.field() else { panic!("{slug} has no matrices") };
        let [quarter, half] = [centred, across].map(|robot| {
            let mesh = robot_mesh(&robot, &vitreous, 2).expect("a mesh");
            let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
            let sizes = sizes_of(&robot, &vitreous, Some(2));
            let surroundings = GelAndRobot { mesh: &mesh, stiffness: &stiffness, poisson_ratio: 0.48, sizes };
            let system = pair.system(&surroundings, None).expect("sound matrices").system;
            let factor = system.factor([1.0, weight]).expect("definite");
            let mut field = vec![0.0; system.n_unknowns()];
            let robot = system.freedoms.robot();
            field[robot] = system.freedoms.share();
            factor.solve_in_place(&mut field);
            field[robot]
        });
        assert!((half / quarter - 1.0).abs() < 1e-6, "{slug}: {half} {quarter}");
    }
}
