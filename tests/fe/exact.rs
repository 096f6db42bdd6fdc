//! Finite elements against the exact sphere in a container (physics §4.1, §4.2): stiffness, field, strain, energy.

use nalgebra::{Matrix3, Vector3};
use vitreo_uq::elements::fe::Stiffness;
use vitreo_uq::elements::fe::element::TabulatedElement;
use vitreo_uq::elements::fe::exact::{SphereInContainer, sphere_in_infinite_medium_n_per_m};
use vitreo_uq::elements::fe::factorisation::add_symmetric_product;
use vitreo_uq::elements::fe::strain::largest_principal_strain;
use vitreo_uq::elements::fe::time::FullOrderModel;
use vitreo_uq::elements::mesh::{Mesh, QuarterBall};
use vitreo_uq::laws::rheology::BaseLaw;
use vitreo_uq::models::model::TrainedRange;
use vitreo_uq::models::surrogate::{Surrogate, Training};

const ROBOT_RADIUS_M: f64 = 0.275e-3;
const OUTER_RADIUS_M: f64 = 10e-3;
const POISSON_RATIOS: [f64; 3] = [0.3, 0.48, 0.499];

fn ball(outer_radius_m: f64, n_per_edge: usize, n_layers: usize) -> Mesh {
    let ball = QuarterBall { robot_radius_m: ROBOT_RADIUS_M, outer_radius_m, n_per_edge, n_layers };
    ball.mesh().expect("the radii are in order")
}

/// Relative error of the robot's stiffness.
fn stiffness_error(stiffness: &Stiffness, outer_radius_m: f64, poisson_ratio: f64) -> f64 {
    let model = FullOrderModel::new(stiffness, poisson_ratio).expect("positive definite");
    let exact = SphereInContainer::new(poisson_ratio, ROBOT_RADIUS_M, outer_radius_m).stiffness_n_per_m(1.0);
    1.0 / (model.compliance_per_m() * exact) - 1.0
}

/// Finite-element field for unit displacement of the robot, one vector per node.
fn unit_displacement(stiffness: &Stiffness, poisson_ratio: f64) -> Vec<[f64; 3]> {
    let unknowns = &stiffness.assembly.unknowns;
    let mut field = stiffness.factor(poisson_ratio).expect("positive definite").unit_response();
    let robot = field[unknowns.robot()];
    field.iter_mut().for_each(|u| *u /= robot);
    unknowns.nodal_displacement(&field)
}

/// Errors of the field for unit displacement, relative to the exact norms: L2, and H1 seminorm by differences of the exact field.
fn field_errors(mesh: &Mesh, nodal: &[[f64; 3]], exact: &SphereInContainer) -> [f64; 2] {
    let table = TabulatedElement::of(mesh.element_kind);
    let mut squares = [[0.0; 2]; 2];
    for nodes in mesh.elements() {
        let coordinates: Vec<_> = nodes.iter().map(|&n| mesh.node_coordinates_m[n as usize]).collect();
        let visited = table.for_each_point(&coordinates, |point| {
            let (mut x, mut u, mut gradient) = (Vector3::zeros(), Vector3::zeros(), Matrix3::zeros());
            for (((&node, n), g), c) in nodes.iter().zip(point.shape).zip(point.gradient).zip(&coordinates) {
                let value = Vector3::from(nodal[node as usize]);
                x += Vector3::from(*c) * *n;
                u += value * *n;
                gradient += value * Vector3::from(*g).transpose();
            }
            let (exact_u, exact_gradient) = (Vector3::from(exact.displacement(x.into())), exact_gradient(exact, x));
            for (k, (u, gradient)) in
                [(u - exact_u, gradient - exact_gradient), (exact_u, exact_gradient)].into_iter().enumerate()
            {
                squares[0][k] += point.volume_m3 * u.norm_squared();
                squares[1][k] += point.volume_m3 * gradient.norm_squared();
            }
        });
        visited.expect("no element is inverted");
    }
    squares.map(|[error, field]: [f64; 2]| (error / field).sqrt())
}

/// Gradient of the exact field, ∂ⱼuᵢ, by central differences of fourth order.
fn exact_gradient(exact: &SphereInContainer, x: Vector3<f64>) -> Matrix3<f64> {
    let h = 1e-3 * x.norm();
    let columns = [0, 1, 2].map(|axis| {
        let at = |steps: f64| Vector3::from(exact.displacement((x + Vector3::ith(axis, steps * h)).into()));
        ((at(1.0) - at(-1.0)) * 8.0 - (at(2.0) - at(-2.0))) / (12.0 * h)
    });
    Matrix3::from_columns(&columns)
}

/// Error bounds of the project: 2·10⁻⁴ with 12,000 unknowns, 3·10⁻⁵ with 60,000.
#[test]
fn stiffness_meets_the_bars() {
    for (n_per_edge, n_layers, most_unknowns, largest_error) in [(3, 8, 12_000, 2e-4), (4, 16, 60_000, 3e-5)] {
        let stiffness = Stiffness::new(&ball(OUTER_RADIUS_M, n_per_edge, n_layers)).expect("a sound mesh");
        assert!(stiffness.n_unknowns() <= most_unknowns, "{} unknowns", stiffness.n_unknowns());
        for poisson_ratio in POISSON_RATIOS {
            let error = stiffness_error(&stiffness, OUTER_RADIUS_M, poisson_ratio);
            println!("{} unknowns, ν = {poisson_ratio}: {error:.2e}", stiffness.n_unknowns());
            assert!(error.abs() <= largest_error, "ν = {poisson_ratio}: {error:e}");
        }
    }
}

#[test]
fn the_error_falls_at_the_order_of_the_element() {
    let levels = [(1, 4), (2, 8), (3, 12)];
    let errors = levels.map(|(n_per_edge, n_layers)| {
        let mesh = ball(OUTER_RADIUS_M, n_per_edge, n_layers);
        let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
        POISSON_RATIOS.map(|poisson_ratio| {
            let exact = SphereInContainer::new(poisson_ratio, ROBOT_RADIUS_M, OUTER_RADIUS_M);
            let [l2, h1] = field_errors(&mesh, &unit_displacement(&stiffness, poisson_ratio), &exact);
            [stiffness_error(&stiffness, OUTER_RADIUS_M, poisson_ratio).abs(), l2, h1]
        })
    });
    for (nu, poisson_ratio) in POISSON_RATIOS.into_iter().enumerate() {
        let slope = |norm: usize| (errors[1][nu][norm] / errors[2][nu][norm]).ln() / 1.5_f64.ln();
        let slopes = [0, 1, 2].map(slope);
        println!("ν = {poisson_ratio}: slopes {slopes:?}, errors {:?}", errors.map(|level| level[nu]));
        // A functional of the energy converges twice as fast as the energy norm. Towards ν = ½ the error changes sign on finer meshes, and
        // its slope is uninformative there; the field's slope is informative.
        assert!(slopes[0] >= 3.8, "ν = {poisson_ratio}: stiffness {}", slopes[0]);
        assert!(slopes[1] >= 2.7 && slopes[2] >= 1.85, "ν = {poisson_ratio}: field {slopes:?}");
        let [stiffness, l2, h1] = errors[2][nu];
        assert!(stiffness < 4e-5 && l2 < 1.2e-3 && h1 < 1.3e-2, "ν = {poisson_ratio}: {:?}", errors[2][nu]);
    }
}

#[test]
fn other_radius_ratios_and_the_infinite_medium() {
    for (ratio, n_layers) in [(1.5, 2), (4.0, 4), (100.0, 14), (1000.0, 20)] {
        let outer_radius_m = ratio * ROBOT_RADIUS_M;
        let stiffness = Stiffness::new(&ball(outer_radius_m, 2, n_layers)).expect("a sound mesh");
        for poisson_ratio in [0.3, 0.48] {
            let error = stiffness_error(&stiffness, outer_radius_m, poisson_ratio);
            assert!(error.abs() < 5e-4, "R_out/R = {ratio}, ν = {poisson_ratio}: {error:e}");
        }
    }
}

/// In λ = R/R_out the compliance is that of the infinite medium minus a part linear in λ, up to λ³ (physics §4.2's Stokes limit). Extrapolating from two
/// containers, the finite elements yield §4.1 without use of §4.2.
#[test]
fn the_infinite_medium_is_the_limit() {
    let compliance_per_m = |ratio: f64, poisson_ratio| {
        let stiffness = Stiffness::new(&ball(ratio * ROBOT_RADIUS_M, 2, 16)).expect("a sound mesh");
        FullOrderModel::new(&stiffness, poisson_ratio).expect("positive definite").compliance_per_m()
    };
    for poisson_ratio in POISSON_RATIOS {
        let limit = 2.0 * compliance_per_m(200.0, poisson_ratio) - compliance_per_m(100.0, poisson_ratio);
        let exact = sphere_in_infinite_medium_n_per_m(1.0, poisson_ratio, ROBOT_RADIUS_M);
        assert!((1.0 / (limit * exact) - 1.0).abs() < 2e-4, "ν = {poisson_ratio}: {:e}", 1.0 / (limit * exact) - 1.0);
    }
}

#[test]
fn compliance_is_twice_the_strain_energy() {
    let stiffness = Stiffness::new(&ball(OUTER_RADIUS_M, 2, 6)).expect("a sound mesh");
    for poisson_ratio in POISSON_RATIOS {
        let factor = stiffness.factor(poisson_ratio).expect("positive definite");
        let field = factor.unit_response();
        let mut force = vec![0.0; field.len()];
        add_symmetric_product(factor.matrix(), &field, &mut force);
        let twice_the_energy: f64 = field.iter().zip(&force).map(|(u, f)| u * f).sum();
        let moved = field[stiffness.assembly.unknowns.robot()];
        assert!(
            (twice_the_energy / moved - 1.0).abs() < 1e-10,
            "ν = {poisson_ratio}: {twice_the_energy} against {moved}"
        );
        let compliance = FullOrderModel::new(&stiffness, poisson_ratio).expect("positive definite").compliance_per_m();
        assert_eq!(compliance.to_bits(), (0.25 * moved).to_bits());
    }
}

/// Largest absolute principal value of the exact strain at a point, for unit displacement.
fn exact_principal_strain(exact: &SphereInContainer, x: Vector3<f64>) -> f64 {
    let gradient = exact_gradient(exact, x);
    ((gradient + gradient.transpose()) * 0.5).symmetric_eigenvalues().amax()
}

/// The largest strain equals the exact field's at the integration points. It is below the strain at the surface, because the points are a
/// fraction of the first layer away.
#[test]
fn largest_strain_is_the_exact_fields() {
    let mesh = ball(OUTER_RADIUS_M, 3, 12);
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    let table = TabulatedElement::of(mesh.element_kind);
    for poisson_ratio in POISSON_RATIOS {
        let exact = SphereInContainer::new(poisson_ratio, ROBOT_RADIUS_M, OUTER_RADIUS_M);
        let found =
            largest_principal_strain(&mesh, &unit_displacement(&stiffness, poisson_ratio)).expect("a sound mesh");
        let mut at_points = 0.0_f64;
        for nodes in mesh.elements() {
            let coordinates: Vec<_> = nodes.iter().map(|&n| mesh.node_coordinates_m[n as usize]).collect();
            let visited = table.for_each_point(&coordinates, |point| {
                let x = point.shape.iter().zip(&coordinates).map(|(n, x)| Vector3::from(*x) * *n).sum();
                at_points = at_points.max(exact_principal_strain(&exact, x));
            });
            visited.expect("no element is inverted");
        }
        assert!((found / at_points - 1.0).abs() < 0.015, "ν = {poisson_ratio}: {found} against {at_points}");
        let direction = |degrees: i32| {
            Vector3::new(f64::from(degrees).to_radians().cos(), f64::from(degrees).to_radians().sin(), 0.0)
        };
        let on_surface =
            (0..=180).map(|k| exact_principal_strain(&exact, direction(k) * ROBOT_RADIUS_M)).fold(0.0, f64::max);
        let shortfall = 1.0 - found / on_surface;
        assert!((0.0..0.1).contains(&shortfall), "ν = {poisson_ratio}: {shortfall} below the surface's");
    }
}

/// The reduced model, trained once for a range of Poisson ratios, against full finite elements across the range.
#[test]
fn reduced_model_follows_the_finite_elements_over_poisson_ratios() {
    let stiffness = Stiffness::new(&ball(OUTER_RADIUS_M, 2, 8)).expect("a sound mesh");
    let range = |name: &str, lower, upper| TrainedRange { name: name.into(), lower, upper };
    let parameters = [
        range("young_modulus_pa", 1.0, 10.0),
        range("viscosity_1_pa_s", 0.5, 5.0),
        range("viscosity_2_pa_s", 20.0, 100.0),
    ];
    let time_s: Vec<f64> = (0..21).map(|row| 0.5 * f64::from(row)).collect();
    let force_n: Vec<f64> = (0..21).map(|row| if row < 10 { 4.6e-6 } else { -4.6e-6 }).collect();
    let training = Training {
        law: BaseLaw::Lethersich,
        parameters: &parameters,
        poisson_ratio: [0.3, 0.499],
        time_s: &time_s,
        force: (&force_n).into(),
        tolerance: 1e-4,
    };
    let surrogate = Surrogate::train(&stiffness, &training).expect("training succeeds");
    assert_eq!(surrogate.n_modes(), 3);
    for k in 0..=16 {
        let poisson_ratio = 0.3 + 0.199 * f64::from(k) / 16.0;
        let full = FullOrderModel::new(&stiffness, poisson_ratio).expect("positive definite").compliance_per_m();
        let reduced = surrogate.compliance_per_m(poisson_ratio).expect("inside the trained range");
        // Square of the modes' truncation error, 10⁻⁴ in the energy of the middle ratio. At the incompressible end energies are up to 100 times that.
        assert!((reduced / full - 1.0).abs() < 1e-6, "ν = {poisson_ratio}: {:e}", reduced / full - 1.0);
        // The error of a Galerkin model can only make it too stiff.
        assert!(reduced <= full * (1.0 + 1e-12), "ν = {poisson_ratio}: {reduced} above {full}");
    }
}
