//! Tests of large displacements against independent results: a formulation that moves with the
//! sphere, the known drag in a tube, compressible gels, and other bodies.

use std::f64::consts::PI;

use super::eulerian::{Cut, Eulerian, Fluid};
use super::tests::{FORCE_N, HOLD_S, LAW, OUTER_M, RADIUS_M, ROWS_A_HOLD, coarse, farthest_apart_um, holds, record};
use super::*;
use crate::fe::exact::SphereInContainer;
use crate::fe::meridional::mesh::Boundary;
use crate::fe::meridional::{Direction, Resolution, solve};
use base::number::Dual;
use laws::rheology::BaseLaw;
use laws::stages::Stages;
use laws::stages::{Load, Switch};

/// Runs the paper's law under `n_holds` holds in alternating directions.
fn pulled(gel: &FiniteGel, n_holds: usize) -> FiniteResult {
    let law = FiniteLaw::new(&BaseLaw::Lethersich.elements(&LAW.map(Dual::constant)), 0.0).expect("no springpot");
    let (time_s, force_n) = record(1.0, n_holds);
    let load = Stages::of_law(Vec::new()).load;
    let what = FiniteInput { law: &law, load: &load, time_s: &time_s, force: Force::from(&force_n) };
    gel.run(&what).expect("the mesh carries it")
}

/// Compares the first pull, 3.8 radii in a container of 100, with a formulation that moves with the
/// sphere. There the flow convects the conformations. The two codes share no discretisation of
/// space or time. They agree to 0.1 µm of the 27 µm deviation. In one of them the wall moves with
/// the sphere, but it is so far away that this does not matter.
#[test]
#[ignore = "thorough"]
fn a_mesh_that_moves_with_the_sphere_finds_the_same_pull() {
    const OUTER_RADII: f64 = 100.0;
    let law = FiniteLaw::new(&BaseLaw::Lethersich.elements(&LAW.map(Dual::constant)), 0.0).expect("no springpot");
    let [mode] = law.modes[..] else { panic!("{law:?}") };
    let gel = FiniteGel::around_sphere(RADIUS_M, OUTER_RADII * RADIUS_M, Discretisation::default()).expect("a mesh");
    let run = pulled(&gel, 1);
    let fluid = Fluid {
        solvent_pa_s: law.solvent_pa_s,
        shear_modulus_pa: mode.shear_modulus_pa,
        time_s: mode.time_s,
        force_pa: FORCE_N / (RADIUS_M * RADIUS_M),
    };
    let cut = Cut { n_radial: 32, n_angular: 16, step_s: 0.01 };
    let n_steps = (HOLD_S / cut.step_s).round() as usize;
    let places = Eulerian::new(fluid, OUTER_RADII, cut).places(n_steps, n_steps / ROWS_A_HOLD);
    let apart_um = |row: usize| 1e6 * (places[row] * RADIUS_M - run.displacement_m[row]).abs();
    let most_um = (0..=ROWS_A_HOLD).map(apart_um).fold(0.0, f64::max);
    let (deviation_um, end_um) = (1e6 * run.deviation_m[ROWS_A_HOLD], 1e6 * run.displacement_m[ROWS_A_HOLD]);
    println!("{most_um:.3} µm apart, {deviation_um:.2} of {end_um:.1} µm");
    assert!(deviation_um > 25.0 && most_um < 0.1, "{most_um} of {deviation_um}");
}

/// Mesh of a tube that is closed at its ends. Its radius is 2 and its half length `half_length`,
/// both in sphere radii.
fn tube(half_length: f64, n_each: usize) -> Mesh {
    const RADIUS: f64 = 2.0;
    let mut mesh = Mesh { is_whole: true, ..Mesh::default() };
    let n_angles = 4 * n_each;
    let angle = |k: usize| FRAC_PI_2 * (n_angles as f64 - 2.0 * k as f64) / n_angles as f64;
    let angles_rad: Vec<f64> = (0..=n_angles).map(angle).collect();
    let body = Boundary { body: true, ..Boundary::INSIDE };
    let wall = Boundary { outer: true, ..Boundary::INSIDE };
    let sphere = mesh.arcs([0.0; 2], [1.0; 2], &angles_rad, body);
    // Points on the tube's outline, from the axis above the sphere to the axis below it.
    let at = |k: usize| match k as f64 / n_each as f64 {
        t if t <= 1.0 => [RADIUS * t, RADIUS],
        t if t <= 3.0 => [RADIUS, RADIUS * (2.0 - t)],
        t => [RADIUS * (4.0 - t), -RADIUS],
    };
    let surface = |r: f64| if r == RADIUS { wall } else { Boundary::INSIDE };
    let vertices: Vec<usize> = (0..=n_angles).map(at).map(|point| mesh.vertex(point, surface(point[0]))).collect();
    let square = mesh.polyline(&vertices);
    mesh.rule_layers(&sphere, &square, &[0.0, 0.08, 0.25, 0.55, 1.0]);
    let n_ends = ((half_length - RADIUS) / 1.5).ceil() as usize;
    for (sign, places) in [(1.0, &vertices[..=n_each]), (-1.0, &vertices[3 * n_each..])] {
        let mut inner = mesh.polyline(places);
        for k in 1..=n_ends {
            let z = sign * (RADIUS + (half_length - RADIUS) * k as f64 / n_ends as f64);
            let radii: Vec<f64> = places.iter().map(|vertex| mesh.points[*vertex][0]).collect();
            let of = |r: &f64| if k == n_ends { wall } else { surface(*r) };
            let row: Vec<usize> = radii.iter().map(|r| mesh.vertex([*r, z], of(r))).collect();
            let outer = mesh.polyline(&row);
            mesh.rule(&inner, &outer);
            inner = outer;
        }
    }
    mesh
}

/// Checks the drag of a Newtonian fluid on a sphere on the axis of a tube of twice its radius.
/// Relative to Stokes drag it is 5.947 (W. L. Haberman, R. M. Sayre, David Taylor Model Basin
/// Report 1143, 1958). The tube is practically infinite.
#[test]
fn drag_in_a_tube_is_known() {
    let factor = |half_length: f64, n_each: usize, order: usize| {
        let mesh = FieldMesh::new(&tube(half_length, n_each), order, None).expect("a mesh");
        stiffness(&mesh).expect("a solution") / (6.0 * PI)
    };
    let found = factor(8.0, 2, 5);
    println!("{found:.5}");
    assert!((found - 5.947).abs() < 1e-3, "{found}");
    assert!((found - factor(12.0, 2, 6)).abs() < 1e-4);
}

/// Checks the drag in the tube for an Oldroyd-B fluid, after four to five relaxation times. Half of
/// the viscosity is the solvent's. The drag divided by 6π (η_s + η_p) R U falls with De = λ U/R.
/// Neither more time nor a coarser mesh changes it by more than 0.1 %. No published table was
/// readable, so that no external value is compared.
#[test]
#[ignore = "campaigns/long-tests"]
fn drag_in_a_tube_falls_with_elasticity() {
    let law = FiniteLaw {
        solvent_pa_s: 0.5,
        modes: vec![RelaxationMode { shear_modulus_pa: 0.5, time_s: 1.0 }],
        mobility: 0.0,
        fastest_s: 0.5,
    };
    let drag = |force: f64, n_each: usize, end_s: f64| {
        let mesh = FieldMesh::new(&tube(8.0, n_each), 5, None).expect("a mesh");
        let newtonian = stiffness(&mesh).expect("a solution");
        let switches = [Switch::to(0.0, force)];
        let pull = AppliedForce { switches: &switches, load: &Load::COMMANDED.of(), newtons_per_pa: 1.0, end_s };
        let walked = run_pull(&mesh, &law, newtonian, &pull, 6);
        assert!(walked.stopped.is_none(), "the mesh carries it");
        let leg = &walked.legs[0];
        let near = &leg[leg.len() - N_NEAREST..];
        let times_s: Vec<f64> = near.iter().map(|moment| moment.time_s).collect();
        let slopes = lagrange(&times_s, end_s);
        let velocity: f64 = slopes.iter().zip(near).map(|((_, slope), moment)| slope * moment.place).sum();
        (velocity, force / (6.0 * PI * velocity))
    };
    let mut before = 5.947;
    for wanted in [0.1, 0.2, 0.3] {
        let force = 6.0 * PI * 5.8 * wanted;
        let ((deborah, found), (_, earlier)) = (drag(force, 2, 5.5), drag(force, 2, 4.5));
        println!("De {deborah:.4}: {found:.4}, at 4.5 λ {earlier:.4}");
        assert!((deborah / wanted - 1.0).abs() < 0.03 && found < before - 0.03, "{deborah} {found}");
        assert!((earlier / found - 1.0).abs() < 1e-3, "{earlier} {found}");
        if wanted < 0.3 {
            let (_, coarser) = drag(force, 1, 4.5);
            println!("coarser {coarser:.4}");
            assert!((coarser / earlier - 1.0).abs() < 1e-3, "{coarser} {earlier}");
        }
        before = found;
    }
}

/// Checks gels with Poisson ratios 0.48 and 0.49 under two volume rules. Their small strains have
/// the closed form. Their deviations differ from those at constant volume by up to 5 and 11 µm
/// after the first pull and by 16 µm to either side after the second. At constant volume the
/// deviations are 27 and −2 µm, which is thus one of three possible results. The three converge as
/// the ratio tends to ½.
#[test]
#[ignore = "thorough"]
fn volumes_that_give_deviate_otherwise() {
    let kept = holds(coarse(), 0.0, 1.0, 2);
    let ends = [ROWS_A_HOLD, 2 * ROWS_A_HOLD];
    let by_um = |found: &FiniteResult| ends.map(|row| 1e6 * (found.deviation_m[row] - kept.deviation_m[row]));
    let of = |volume: VolumeRule, fineness: Discretisation| {
        let gel = FiniteGel::new(BodyOfRevolution::sphere(RADIUS_M), OUTER_M, volume, fineness).expect("a mesh");
        let nu = volume.poisson_ratio();
        let exact_m = SphereInContainer::new(nu, RADIUS_M, OUTER_M).stiffness_n_per_m(2.0 * (1.0 + nu));
        assert!((gel.stiffness_m() / exact_m - 1.0).abs() < 1e-4, "{volume:?}");
        pulled(&gel, 2)
    };
    let rules: [fn(f64) -> VolumeRule; 2] = [
        |poisson_ratio| VolumeRule::Network { poisson_ratio },
        |poisson_ratio| VolumeRule::Decoupled { poisson_ratio },
    ];
    let mut both = Vec::new();
    for rule in rules {
        let [far, near] = [0.48, 0.49].map(|nu| by_um(&of(rule(nu), coarse())));
        println!("{:?}: {far:?}, at 0.49 {near:?} µm", rule(0.48));
        for (far, near) in far.iter().zip(near) {
            let share = near / far;
            assert!((0.4..0.7).contains(&share), "{far} {near}");
        }
        both.push(far);
    }
    assert!(both[0][0] < -3.0 && both[0][1] > 10.0 && both[1][0] > 8.0 && both[1][1] < -10.0, "{both:?}");
    assert!(both.iter().flatten().all(|by| by.abs() < 20.0), "{both:?}");
    // The documentation states values of the default mesh, not of the coarse mesh.
    let finer = of(VolumeRule::Network { poisson_ratio: 0.48 }, Discretisation::default());
    let kept_finer = holds(Discretisation::default(), 0.0, 1.0, 2);
    let apart = ends.map(|row| 1e6 * (finer.deviation_m[row] - kept_finer.deviation_m[row]));
    println!("finer {apart:?}");
    assert!(apart.iter().zip(both[0]).all(|(fine, coarse)| (fine - coarse).abs() < 0.5), "{apart:?}");
    let refused =
        FiniteGel::new(BodyOfRevolution::sphere(1.0), 9.0, VolumeRule::Decoupled { poisson_ratio: 0.5 }, coarse());
    let refused = refused.err().expect("refused").to_string();
    assert!(refused.contains("the Poisson ratio of a compressible gel is 0.5\n"), "{refused}");
}

/// Checks spheroids that are pulled along their axis. A nearly spherical one must deviate like the
/// sphere, on another mesh. One with a length of twice its diameter must deviate far less. Small
/// strains must equal those of the meridional solver.
#[test]
#[ignore = "thorough"]
fn spheroids_are_meshed_too() {
    let spheroid = |aspect: f64| {
        let unit = BodyOfRevolution::Spheroid { semi_axis_along_m: aspect, semi_axis_across_m: 1.0 };
        unit.scaled(RADIUS_M / aspect.cbrt())
    };
    let fine = Discretisation { order: 7, ..Discretisation::default() };
    let nearly = FiniteGel::new(spheroid(1.0001), OUTER_M, VolumeRule::Incompressible, fine).expect("a mesh");
    let apart_um = farthest_apart_um(&pulled(&nearly, 1), &holds(Discretisation::default(), 0.0, 1.0, 1));
    println!("{apart_um:.3} µm");
    assert!(apart_um < 0.3, "{apart_um}");
    let long = |order: usize| {
        let gel = FiniteGel::new(spheroid(2.0), OUTER_M, VolumeRule::Incompressible, Discretisation { order, ..fine })
            .expect("a mesh");
        1e6 * pulled(&gel, 1).deviation_m[ROWS_A_HOLD]
    };
    let [coarser_um, finer_um] = [5, 6].map(long);
    println!("twice as long as wide: {coarser_um:.2} µm, {finer_um:.2} µm");
    assert!((coarser_um - finer_um).abs() < 0.3 && finer_um > 2.0 && finer_um < 4.0, "{coarser_um} {finer_um}");
    for aspect in [2.0, 68.0 / 7.0] {
        let poisson_ratio = 0.48;
        let gel =
            FiniteGel::new(spheroid(aspect), OUTER_M, VolumeRule::Network { poisson_ratio }, fine).expect("a mesh");
        let exact = solve(spheroid(aspect), OUTER_M, poisson_ratio, Direction::Axial, Resolution::default());
        let exact_m = 2.0 * (1.0 + poisson_ratio) * exact.expect("a solution").stiffness_m;
        println!("{aspect}: {:.1e}", gel.stiffness_m() / exact_m - 1.0);
        assert!((gel.stiffness_m() / exact_m - 1.0).abs() < 1e-4, "{aspect}");
    }
}
