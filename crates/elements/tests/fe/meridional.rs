//! Tests of bodies of revolution in the half meridian: against closed forms (physics §4.1–§4.3,
//! §4.8), bounds, asymptotics and other resolutions.

use std::f64::consts::PI;

use crate::spheroids::{AxialAndTransverse, spheroid_in_container};

use elements::fe::exact::SphereInContainer;
use elements::fe::meridional::{BodyOfRevolution, Direction, Formulation, MeridionalSolution, Resolution, solve};

const RADIUS_M: f64 = 0.275e-3;
const OUTER_RADIUS_M: f64 = 10e-3;
const ASPECT: f64 = 68.0 / 7.0;
const DIRECTIONS: [Direction; 2] = [Direction::Axial, Direction::Transverse];

fn spheroid(aspect: f64) -> BodyOfRevolution {
    BodyOfRevolution::Spheroid { semi_axis_along_m: aspect, semi_axis_across_m: 1.0 }
}

fn cylinder(aspect: f64) -> BodyOfRevolution {
    BodyOfRevolution::Cylinder { length_m: aspect, diameter_m: 1.0 }
}

/// Scales a body to the volume of the paper's sphere.
fn of_equal_volume(body: BodyOfRevolution) -> BodyOfRevolution {
    body.scaled((BodyOfRevolution::sphere(RADIUS_M).volume_m3() / body.volume_m3()).cbrt())
}

/// Scales a body to the surface area of the paper's sphere.
fn of_equal_area(body: BodyOfRevolution) -> BodyOfRevolution {
    body.scaled((BodyOfRevolution::sphere(RADIUS_M).surface_area_m2() / body.surface_area_m2()).sqrt())
}

fn at_order(order: usize, rim_layers: usize) -> Resolution {
    Resolution { order, rim_layers, ..Resolution::default() }
}

/// Returns the stiffness (m) of a body, and checks the properties that every solution must have.
fn stiffness(
    body: BodyOfRevolution,
    outer_radius_m: f64,
    poisson_ratio: f64,
    direction: Direction,
    resolution: Resolution,
) -> MeridionalSolution {
    let solution = solve(body, outer_radius_m, poisson_ratio, direction, resolution).expect("a sound problem");
    let imbalance = solution.reaction_stiffness_m / solution.stiffness_m - 1.0;
    assert!(imbalance.abs() < 1e-8, "{body:?}, {direction:?}: energy and reaction differ by {imbalance:e}");
    solution
}

fn of(direction: Direction, exact: AxialAndTransverse) -> f64 {
    match direction {
        Direction::Axial => exact.axial_n_per_m,
        Direction::Transverse => exact.transverse_n_per_m,
    }
}

/// Checks a sphere in both directions. Modes 0 and 1 have different equations, but for a sphere
/// both must give physics §4.2.
#[test]
fn sphere_in_a_container_is_exact_in_both_directions() {
    let body = BodyOfRevolution::sphere(RADIUS_M);
    for poisson_ratio in [-0.5, 0.0, 0.3, 0.48, 0.499, 0.4999] {
        for outer_radius_m in [1.05 * RADIUS_M, 1.5 * RADIUS_M, OUTER_RADIUS_M, 1000.0 * RADIUS_M] {
            let exact = SphereInContainer::new(poisson_ratio, RADIUS_M, outer_radius_m).stiffness_n_per_m(1.0);
            for direction in DIRECTIONS {
                let solution = stiffness(body, outer_radius_m, poisson_ratio, direction, Resolution::default());
                let error = solution.stiffness_m / exact - 1.0;
                assert!(error.abs() < 3e-9, "ν = {poisson_ratio}, {outer_radius_m} m, {direction:?}: {error:e}");
                // Near the incompressible limit rounding adds to the error. The estimate does not
                // include it.
                assert!(error.abs() < solution.relative_error + 1e-9, "{error:e} above {:e}", solution.relative_error);
            }
        }
    }
}

/// Checks that the error falls by a constant factor per order. The errors are equal for all ratios
/// up to ν = ½, so that the elements do not lock. Displacements alone approach the result from
/// above.
#[test]
fn error_falls_exponentially_without_locking() {
    let body = BodyOfRevolution::sphere(RADIUS_M);
    for direction in DIRECTIONS {
        let errors = |poisson_ratio: f64, formulation: Formulation| {
            let exact = SphereInContainer::new(poisson_ratio, RADIUS_M, OUTER_RADIUS_M).stiffness_n_per_m(1.0);
            [3, 5, 7, 9].map(|order| {
                let resolution = Resolution { order, formulation, ..Resolution::default() };
                stiffness(body, OUTER_RADIUS_M, poisson_ratio, direction, resolution).stiffness_m / exact - 1.0
            })
        };
        for poisson_ratio in [0.3, 0.48, 0.499, 0.4999] {
            let found = errors(poisson_ratio, Formulation::Mixed);
            println!("{direction:?}, ν = {poisson_ratio}, mixed: {found:?}");
            for (pair, ceiling) in found.windows(2).zip([1e-2, 2e-5, 3e-8]) {
                assert!(pair[0].abs() < ceiling, "ν = {poisson_ratio}: {found:?}");
                assert!(pair[0] / pair[1].abs() > 200.0, "ν = {poisson_ratio}: slope of {found:?}");
            }
            let alone = errors(poisson_ratio, Formulation::Displacement);
            println!("{direction:?}, ν = {poisson_ratio}, displacement: {alone:?}");
            for pair in alone.windows(2) {
                assert!(pair[1] > 0.0 && pair[0] / pair[1] > 40.0, "ν = {poisson_ratio}: {alone:?}");
            }
            assert!(alone[3] < 2e-8, "ν = {poisson_ratio}: {alone:?}");
        }
        let [nearly, compressible] = [0.4999, 0.3].map(|nu| errors(nu, Formulation::Mixed)[0]);
        assert!(nearly < 2.5 * compressible, "{nearly:e} against {compressible:e}");
    }
}

/// Compares with physics §4.8, whose error varies with the fifth power of the ratio of the body's
/// size to the container's. The elements show this power. For negligible size ratios they agree
/// with §4.3 to ten digits.
#[test]
#[ignore = "thorough"]
fn spheroid_is_the_closed_form_up_to_its_own_error() {
    let body = of_equal_volume(spheroid(ASPECT));
    let BodyOfRevolution::Spheroid { semi_axis_along_m: a, semi_axis_across_m: b } = body else {
        panic!("a spheroid stays one");
    };
    for poisson_ratio in [0.3, 0.48, 0.499] {
        for direction in DIRECTIONS {
            let errors = [1.0, 2.0, 100.0].map(|times| {
                let outer_radius_m = times * OUTER_RADIUS_M;
                let exact = of(direction, spheroid_in_container(1.0, poisson_ratio, a, b, outer_radius_m));
                let solution = stiffness(body, outer_radius_m, poisson_ratio, direction, at_order(12, 1));
                solution.stiffness_m / exact - 1.0
            });
            println!("ν = {poisson_ratio}, {direction:?}: {errors:?}");
            assert!(errors[0].abs() < 1e-5 && errors[2].abs() < 2e-10, "{direction:?}: {errors:?}");
            let power = (errors[0] / errors[1]).log2();
            assert!((power - 5.0).abs() < 0.1, "{direction:?}: power {power}");
        }
    }
}

/// Checks both ends of the range of aspect ratios, prolate and oblate, in a distant container.
#[test]
#[ignore = "thorough"]
fn slender_and_flat_spheroids_are_the_closed_form() {
    for aspect in [0.1, 0.5, 0.99, 1.01, 3.0, 20.0_f64] {
        for poisson_ratio in [0.3, 0.499] {
            for direction in DIRECTIONS {
                let outer_radius_m = 500.0 * aspect.max(1.0);
                let exact = of(direction, spheroid_in_container(1.0, poisson_ratio, aspect, 1.0, outer_radius_m));
                let solution =
                    stiffness(spheroid(aspect), outer_radius_m, poisson_ratio, direction, Resolution::default());
                let error = solution.stiffness_m / exact - 1.0;
                assert!(error.abs() < 5e-9, "{aspect}, ν = {poisson_ratio}, {direction:?}: {error:e}");
                assert!(error.abs() < solution.relative_error + 1e-9, "{aspect}: {error:e}");
            }
        }
    }
}

/// Checks that orders, layers and both formulations agree, and that displacements alone give the
/// stiffness from above. Estimates must exceed the errors.
#[test]
#[ignore = "thorough"]
fn cylinder_converges_to_one_value() {
    assert_cylinders_converge(&[(0.1, Direction::Transverse), (ASPECT, Direction::Axial)]);
}

#[test]
#[ignore = "campaigns/long-tests"]
fn cylinders_of_all_aspects_converge_to_one_value() {
    let aspects = [0.1, 1.0, ASPECT, 20.0];
    assert_cylinders_converge(&aspects.map(|aspect| DIRECTIONS.map(|direction| (aspect, direction))).concat());
}

fn assert_cylinders_converge(cases: &[(f64, Direction)]) {
    for &(aspect, direction) in cases {
        let body = of_equal_volume(cylinder(aspect));
        let solve = |resolution| stiffness(body, OUTER_RADIUS_M, 0.499, direction, resolution);
        let fine = solve(at_order(12, 12)).stiffness_m;
        for (resolution, ceiling) in [(at_order(6, 5), 3e-6), (at_order(8, 7), 3e-8), (Resolution::default(), 2e-9)] {
            let solution = solve(resolution);
            let error = (solution.stiffness_m / fine - 1.0).abs();
            assert!(error < ceiling, "{aspect}, {direction:?}, {resolution:?}: {error:e}");
            assert!(error < solution.relative_error + 1e-9, "{error:e} above {:e}", solution.relative_error);
        }
        let displacement = Resolution { formulation: Formulation::Displacement, ..at_order(12, 9) };
        let excess = solve(displacement).stiffness_m / fine - 1.0;
        assert!((-1e-9..2e-9).contains(&excess), "{aspect}, {direction:?}: {excess:e}");
    }
}

/// Checks that a container close to the body reduces the accuracy, and that the error estimate
/// shows this.
#[test]
#[ignore = "thorough"]
fn estimates_hold_in_close_containers() {
    for (aspect, ratio, ceiling) in
        [(20.0, 1.5, 1e-8), (0.1, 1.5, 1e-8), (1.0, 1.1, 1e-8), (0.1, 1.1, 1e-4), (20.0, 1.1, 1e-4)]
    {
        let body = cylinder(aspect);
        let outer_radius_m = 0.5 * ratio * aspect.hypot(1.0);
        let solution = stiffness(body, outer_radius_m, 0.48, Direction::Transverse, Resolution::default());
        let fine = stiffness(body, outer_radius_m, 0.48, Direction::Transverse, at_order(14, 9)).stiffness_m;
        let error = (solution.stiffness_m / fine - 1.0).abs();
        println!("{aspect} × {ratio}: {error:e}, estimated {:e}", solution.relative_error);
        assert!(
            error < ceiling && error < solution.relative_error,
            "{error:e}, estimated {:e}",
            solution.relative_error
        );
    }
}

/// Checks the error per rim layer. Between clamped faces with an outer angle of 270° the field
/// varies like ρ^α, (3 − 4ν) sin(3πα/2) = α (M. L. Williams, J. Appl. Mech. 19, 526, 1952). Each
/// layer of cells therefore reduces the error of the energy by the factor 0.15^2α. Across the axis
/// the hoop displacement adds a part like ρ^⅔. The elements use neither exponent.
#[test]
#[ignore = "thorough"]
fn layers_around_the_rim_act_as_the_singularity_says() {
    let body = of_equal_volume(cylinder(1.0));
    for poisson_ratio in [0.3, 0.48, 0.4999] {
        let kappa = 3.0 - 4.0 * poisson_ratio;
        let (mut low, mut high) = (0.5_f64, 0.66_f64);
        for _ in 0..60 {
            let alpha = 0.5 * (low + high);
            if kappa * (1.5 * PI * alpha).sin() > alpha { low = alpha } else { high = alpha }
        }
        let expected = 0.15_f64.powf(2.0 * low);
        for direction in DIRECTIONS {
            let solve =
                |layers| stiffness(body, OUTER_RADIUS_M, poisson_ratio, direction, at_order(9, layers)).stiffness_m;
            let limit = solve(10);
            let errors = [2, 3, 4, 5].map(|layers| solve(layers) / limit - 1.0);
            let hoop = if direction == Direction::Transverse { 0.15_f64.powf(4.0 / 3.0) } else { 0.0 };
            let plane = [0, 1, 2].map(|k| errors[k + 1] - hoop * errors[k]);
            println!("ν = {poisson_ratio}, {direction:?}: α = {low}, {errors:?}");
            for pair in plane.windows(2) {
                let factor = pair[1] / pair[0];
                assert!((factor / expected - 1.0).abs() < 0.03, "{direction:?}: {factor} for {expected}");
            }
        }
    }
}

/// Checks that the stiffness increases with the body: of two nested bodies, the inner one is
/// softer.
#[test]
fn cylinder_lies_between_spheroids_inside_and_around_it() {
    for aspect in [0.1, 1.0, ASPECT] {
        for direction in DIRECTIONS {
            let solve = |body| stiffness(body, 30.0 * aspect.max(1.0), 0.48, direction, at_order(8, 7)).stiffness_m;
            let inside = solve(spheroid(aspect).scaled(0.5));
            let around = solve(spheroid(aspect).scaled(0.5 * 2.0_f64.sqrt()));
            let between = solve(cylinder(aspect));
            assert!(inside < between && between < around, "{aspect}, {direction:?}: {inside} {between} {around}");
        }
    }
}

/// Compares with slender-body theory of a finite cylinder in Stokes flow, with ε = 1/ln(2L/D). Let
/// the force be divided by 2πμL (along the axis) or 4πμL (across it). The result is (ε + 0.307
/// ε²)/(1 ∓ ½ε) + (0.426 or 0.119) ε³ + O(ε⁴) (G. K. Batchelor, J. Fluid Mech. 44, 419, 1970,
/// doi:10.1017/S002211207000191X).
#[test]
fn slender_cylinder_is_batchelors() {
    // The theory holds for ν = ½ and an infinite medium. Two ratios are extrapolated to ν → ½, and
    // the container's contribution (b₀ of physics §4.8) is subtracted.
    let friction = |aspect: f64, direction: Direction| {
        let outer_radius_m = 1000.0 * aspect;
        let mobility = |nu: f64| {
            let shear_modulus = 0.5 / (1.0 + nu);
            let kappa = 1.0 / (16.0 * PI * (1.0 - nu));
            let uniform = -kappa / outer_radius_m * ((3.0 - 4.0 * nu) + (3.0 - 2.0 * nu) / (2.0 * (2.0 - 3.0 * nu)));
            let solution = stiffness(cylinder(aspect).scaled(2.0), outer_radius_m, nu, direction, at_order(8, 6));
            shear_modulus / solution.stiffness_m - uniform
        };
        1.0 / (2.0 * mobility(0.4999) - mobility(0.4998))
    };
    for direction in DIRECTIONS {
        let excess = [20.0, 160.0].map(|aspect: f64| {
            let epsilon = 1.0 / (2.0 * aspect).ln();
            let slender = |sign: f64| (epsilon + 0.307 * epsilon * epsilon) / (1.0 + sign * 0.5 * epsilon);
            let theory = match direction {
                Direction::Axial => 2.0 * PI * 2.0 * aspect * (slender(-1.0) + 0.426 * epsilon.powi(3)),
                Direction::Transverse => 4.0 * PI * 2.0 * aspect * (slender(1.0) + 0.119 * epsilon.powi(3)),
            };
            (friction(aspect, direction) / theory - 1.0) / epsilon.powi(3)
        });
        println!("{direction:?}: relative excess over ε³ at L/D = 20 and 160: {excess:?}");
        // The next term of the series has a coefficient of order one.
        assert!(excess.iter().all(|e| e.abs() < 3.0), "{direction:?}: {excess:?}");
    }
}

/// Reference values of one body: shape, direction, and stiffness in mm at ν = 0.48 and 0.499.
type Row = (&'static str, Direction, [f64; 2]);

/// The paper's five bodies (L/D = a/b = 68/7, 20 mm ball), with the volume of the sphere of 0.55 mm
/// diameter.
const EQUAL_VOLUME: [Row; 5] = [
    ("sphere", Direction::Axial, [1.8209023960, 1.8405271521]),
    ("ellipsoid", Direction::Axial, [2.2761247483, 2.2766441963]),
    ("ellipsoid", Direction::Transverse, [3.3033425324, 3.3826993677]),
    ("cylinder", Direction::Axial, [2.3552414217, 2.3615537650]),
    ("cylinder", Direction::Transverse, [3.2768858475, 3.3536345976]),
];

/// The paper's five bodies, with the surface area of the sphere of 0.55 mm diameter.
const EQUAL_AREA: [Row; 5] = [
    ("sphere", Direction::Axial, [1.8209023960, 1.8405271521]),
    ("ellipsoid", Direction::Axial, [1.7246111984, 1.7225879400]),
    ("ellipsoid", Direction::Transverse, [2.4846608074, 2.5376819703]),
    ("cylinder", Direction::Axial, [1.7679667377, 1.7699905126]),
    ("cylinder", Direction::Transverse, [2.4432431276, 2.4938219791]),
];

/// Checks the reference values of the paper's bodies. They are correct to the last digit but one.
#[test]
#[ignore = "thorough"]
fn the_papers_bodies_have_their_reference_values() {
    for (size, rows) in [(of_equal_volume as fn(_) -> _, EQUAL_VOLUME), (of_equal_area, EQUAL_AREA)] {
        for (shape, direction, expected_mm) in rows {
            let body = size(match shape {
                "sphere" => BodyOfRevolution::sphere(1.0),
                "ellipsoid" => spheroid(ASPECT),
                _ => cylinder(ASPECT),
            });
            for (poisson_ratio, expected_mm) in [0.48, 0.499].into_iter().zip(expected_mm) {
                let solution = stiffness(body, OUTER_RADIUS_M, poisson_ratio, direction, Resolution::default());
                let found_mm = 1e3 * solution.stiffness_m;
                println!(
                    "{shape}, {direction:?}, ν = {poisson_ratio}: {found_mm:.10} mm ± {:.1e}, {} unknowns, {body:?}",
                    solution.relative_error, solution.n_unknowns
                );
                assert!((found_mm / expected_mm - 1.0).abs() < 5e-10, "{shape}, {direction:?}: {found_mm:.10} mm");
                assert!(solution.relative_error < 1e-9, "{shape}, {direction:?}: {:e}", solution.relative_error);
            }
        }
    }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let solve = || stiffness(cylinder(2.0), 10.0, 0.48, Direction::Transverse, at_order(5, 3));
    let on = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("a pool");
        pool.install(solve)
    };
    assert_eq!(on(1).stiffness_m.to_bits(), on(3).stiffness_m.to_bits());
}

#[test]
fn impossible_problems_are_refused() {
    let refused = |body, outer_radius_m, poisson_ratio, resolution| {
        let result = solve(body, outer_radius_m, poisson_ratio, Direction::Axial, resolution);
        result.expect_err("no sound problem").to_string()
    };
    let (sphere, usual) = (BodyOfRevolution::sphere(1.0), Resolution::default());
    for (body, outer_radius_m) in [
        (sphere, 1.0),
        (sphere, f64::INFINITY),
        (sphere, f64::NAN),
        (BodyOfRevolution::sphere(f64::NAN), 2.0),
        (BodyOfRevolution::sphere(0.0), 2.0),
        (BodyOfRevolution::Spheroid { semi_axis_along_m: 1.0, semi_axis_across_m: 1e-300 }, 2.0),
        // The rim lies outside the sphere, although length and diameter are smaller than the
        // sphere's.
        (BodyOfRevolution::Cylinder { length_m: 1.6, diameter_m: 1.6 }, 1.1),
    ] {
        let message = refused(body, outer_radius_m, 0.48, usual);
        assert!(message.contains("lies inside the vitreous"), "{message}");
    }
    for poisson_ratio in [0.5, -1.0, f64::NAN] {
        assert!(refused(sphere, 10.0, poisson_ratio, usual).contains("Poisson ratio"));
    }
    for resolution in [at_order(2, 9), at_order(15, 9), at_order(10, 0), at_order(10, 13)] {
        assert!(refused(sphere, 10.0, 0.48, resolution).contains("order"));
    }
}
