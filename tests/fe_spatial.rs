//! Inertia, slip and pocket: full finite elements against closed forms, reduced terms against full finite elements, and creep against time stepping.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};
use vitreo_uq::effects::{Spatial, Stages};
use vitreo_uq::fe::Stiffness;
use vitreo_uq::fe::spatial::{self, Scaled, Sizes, SpatialKind, SpatialSystem, Surroundings};
use vitreo_uq::fe::transient::{self, Load, Resolution};
use vitreo_uq::mesh::{Mesh, QuarterBall};
use vitreo_uq::number::Dual;
use vitreo_uq::rheology::{
    Accuracy, BaseLaw, Beside, CreepCompliance, Element, RetardationSpectrum, SpreadTerm, TimeWindow,
};
use vitreo_uq::surrogate::spread::{SpreadModes, snapshot_values};

const RADIUS_M: f64 = 0.275e-3;
const OUTER_RADIUS_M: f64 = 10e-3;
const QUARTER: f64 = 0.25;
const GEL_DENSITY: f64 = 1000.0;
const ROBOT_DENSITY: f64 = 7500.0;

fn ball(level: usize) -> QuarterBall {
    QuarterBall { robot_radius_m: RADIUS_M, outer_radius_m: OUTER_RADIUS_M, n_per_edge: level, n_layers: 4 * level }
}

fn surroundings<'a>(mesh: &'a Mesh, stiffness: &'a Stiffness, poisson_ratio: f64) -> Surroundings<'a> {
    let robot_mass_kg = 4.0 / 3.0 * PI * RADIUS_M.powi(3) * ROBOT_DENSITY;
    let sizes = Sizes {
        gel_density_kg_m3: GEL_DENSITY,
        robot_mass_kg,
        robot_radius_m: RADIUS_M,
        outer_radius_m: OUTER_RADIUS_M,
        ball: None,
    };
    Surroundings { mesh, stiffness, poisson_ratio, sizes }
}

fn system(mesh: &Mesh, poisson_ratio: f64, kind: SpatialKind) -> SpatialSystem {
    let stiffness = Stiffness::new(mesh).expect("a sound mesh");
    SpatialSystem::new(&surroundings(mesh, &stiffness, poisson_ratio), mesh, kind).expect("a sound mesh")
}

/// Force per displacement of the whole body (N/m) with these weights of the system's matrices.
fn stiffness(system: &SpatialSystem, weights: &[f64]) -> f64 {
    let mut field = vec![0.0; system.n_unknowns()];
    let robot = system.freedoms.robot();
    field[robot] = 1.0;
    system.factor(weights).expect("positive definite").solve_in_place(&mut field);
    1.0 / (QUARTER * field[robot])
}

/// Displacement A(r) e_x + B(r) (e_x·n) n by the four modes of a layer of Poisson ratio ν (physics §4.2): A, B, A', B' of each.
fn modes(nu: f64, r: f64) -> [[f64; 4]; 4] {
    [
        [1.0, 0.0, 0.0, 0.0],
        [(3.0 - 4.0 * nu) / r, 1.0 / r, -(3.0 - 4.0 * nu) / (r * r), -1.0 / (r * r)],
        [r.powi(-3), -3.0 * r.powi(-3), -3.0 * r.powi(-4), 9.0 * r.powi(-4)],
        [
            (3.0 - 2.0 * nu) * r * r,
            -2.0 * (2.0 - 3.0 * nu) * r * r,
            2.0 * (3.0 - 2.0 * nu) * r,
            -4.0 * (2.0 - 3.0 * nu) * r,
        ],
    ]
}

/// Shear and normal traction on a sphere r, over −sin θ and cos θ, for shear modulus μ.
fn tractions(nu: f64, mu: f64, r: f64, [_, b, da, db]: [f64; 4]) -> [f64; 2] {
    let lambda = 2.0 * mu * nu / (1.0 - 2.0 * nu);
    [mu * (da + b / r), lambda * (da + db + 2.0 * b / r) + 2.0 * mu * (da + db)]
}

/// Force per displacement (N/m) of a sphere on whose surface the gel (E = 1 Pa) slips against κ (Pa/m), in a rigid container.
///
/// Written down here from the modes: normal displacement tied, shear stress κ times the slip.
fn slipping_sphere(nu: f64, kappa: f64, outer_radius_m: f64) -> f64 {
    let mu = 1.0 / (2.0 * (1.0 + nu));
    // Lengths in radii, so that the modes are of one size.
    let (inner, outer) = (modes(nu, 1.0), modes(nu, outer_radius_m / RADIUS_M));
    let mut matrix = DMatrix::zeros(4, 4);
    for k in 0..4 {
        let [a, b, ..] = inner[k];
        matrix[(0, k)] = a + b;
        matrix[(1, k)] = tractions(nu, mu, 1.0, inner[k])[0] - kappa * RADIUS_M * a;
        (matrix[(2, k)], matrix[(3, k)]) = (outer[k][0], outer[k][1]);
    }
    let amplitudes = matrix.lu().solve(&DVector::from_vec(vec![1.0, -kappa * RADIUS_M, 0.0, 0.0])).expect("regular");
    16.0 * PI * mu * (1.0 - nu) * amplitudes[1] * RADIUS_M
}

/// The same of a tied sphere in two concentric layers with Young's moduli `soft` inside a radius of ρ robots and 1 Pa outside.
fn sphere_in_pocket(nu: f64, soft: f64, ratio: f64) -> f64 {
    let mu = 1.0 / (2.0 * (1.0 + nu));
    let (inner, outer) = (modes(nu, 1.0), modes(nu, OUTER_RADIUS_M / RADIUS_M));
    let at = modes(nu, ratio);
    let mut matrix = DMatrix::zeros(8, 8);
    for k in 0..4 {
        let (inside, outside) = (tractions(nu, soft * mu, ratio, at[k]), tractions(nu, mu, ratio, at[k]));
        for i in 0..2 {
            matrix[(i, k)] = inner[k][i];
            matrix[(2 + i, k)] = at[k][i];
            matrix[(2 + i, 4 + k)] = -at[k][i];
            matrix[(4 + i, k)] = inside[i];
            matrix[(4 + i, 4 + k)] = -outside[i];
            matrix[(6 + i, 4 + k)] = outer[k][i];
        }
    }
    let mut right = DVector::zeros(8);
    right[0] = 1.0;
    let amplitudes = matrix.lu().solve(&right).expect("regular");
    16.0 * PI * soft * mu * (1.0 - nu) * amplitudes[1] * RADIUS_M
}

/// The closed form itself: no slip is physics §4.2, free slip and what is between tend to §4.7 far from the wall in an incompressible gel.
#[test]
fn the_closed_form_of_slip_has_the_known_limits() {
    let nu = 0.499_999_9;
    let mu = 1.0 / (2.0 * (1.0 + nu));
    for ratio in [0.0, 0.1, 1.0, 30.0, 1e6] {
        // b = μ/κ.
        let kappa = if ratio == 0.0 { 1e12 } else { mu / (ratio * RADIUS_M) };
        let found = slipping_sphere(nu, kappa, 1e4 * RADIUS_M) / (6.0 * PI * mu * RADIUS_M);
        let known = (1.0 + 2.0 * ratio) / (1.0 + 3.0 * ratio);
        // The wall's share is 9/4 R/R_o = 2.2e-4.
        assert!((found / known - 1.0).abs() < 3e-4, "{ratio}: {found} {known}");
    }
    assert!((slipping_sphere(0.48, 1e12, OUTER_RADIUS_M) / 1.820_902_396e-3 - 1.0).abs() < 1e-6);
    assert!((sphere_in_pocket(0.48, 1.0, 3.0) / 1.820_902_396e-3 - 1.0).abs() < 1e-9);
}

#[test]
fn slip_meets_the_closed_form_and_converges() {
    for nu in [0.3, 0.48, 0.499] {
        let mut errors: Vec<Vec<f64>> = Vec::new();
        for level in [2, 3] {
            let mesh = ball(level).mesh().unwrap();
            let system = system(&mesh, nu, SpatialKind::Slip);
            let error = |scaled: &f64| {
                let kappa = scaled / RADIUS_M;
                stiffness(&system, &[1.0, kappa]) / slipping_sphere(nu, kappa, OUTER_RADIUS_M) - 1.0
            };
            errors.push([0.0, 0.1, 1.0, 10.0].iter().map(error).collect());
        }
        println!("slip, ν = {nu}: {errors:?}");
        for (coarse, fine) in errors[0].iter().zip(&errors[1]) {
            assert!(fine.abs() < 3e-4 && fine.abs() < 0.6 * coarse.abs(), "ν = {nu}: {coarse:e}, {fine:e}");
        }
    }
}

#[test]
fn the_pocket_meets_the_two_layer_solution() {
    for (nu, ratio) in [(0.3, 1.5), (0.48, 2.0), (0.48, 5.0), (0.499, 3.0)] {
        let radius_m = ratio * RADIUS_M;
        let mesh = QuarterBall { n_layers: 13, ..ball(3) }.mesh_with_interface(radius_m, 4).unwrap();
        let system = system(&mesh, nu, SpatialKind::Pocket { radius_m });
        for soft in [1.0, 0.3, 0.03] {
            let error = stiffness(&system, &[soft, 1.0]) / sphere_in_pocket(nu, soft, ratio) - 1.0;
            println!("pocket, ν = {nu}, {ratio} radii, {soft}: {error:e}");
            assert!(error.abs() < 3e-4, "ν = {nu}, {ratio}, {soft}: {error:e}");
        }
    }
}

/// Physics §4.6 at real s, for y at which momentum does not reach the wall: e^{−√y R_o/R} of the wall's share is below 1e-6.
#[test]
fn inertia_meets_basset_boussinesq() {
    let nu = 0.499_99;
    let mesh = ball(3).mesh().unwrap();
    let system = system(&mesh, nu, SpatialKind::Inertia);
    let mass_kg = 4.0 / 3.0 * PI * RADIUS_M.powi(3) * ROBOT_DENSITY;
    let mu = 1.0 / (2.0 * (1.0 + nu));
    for y in [0.2, 1.0, 5.0] {
        // y = ρ s² R²/G with the shear modulus G; here G = μ for unit Young's modulus, so s² = y μ/(ρR²).
        let s_squared = y * mu / (GEL_DENSITY * RADIUS_M * RADIUS_M);
        let known = 6.0 * PI * mu * RADIUS_M * (1.0 + f64::sqrt(y) + y / 9.0) + mass_kg * s_squared;
        let error = stiffness(&system, &[1.0, s_squared]) / known - 1.0;
        println!("inertia, y = {y}: {error:e}");
        assert!(error.abs() < 1.5e-3, "y = {y}: {error:e}");
    }
}

fn kinds(radius_ratio: f64) -> [(SpatialKind, Mesh); 3] {
    let radius_m = radius_ratio * RADIUS_M;
    let pocket = QuarterBall { n_layers: 9, ..ball(2) }.mesh_with_interface(radius_m, 3).unwrap();
    [
        (SpatialKind::Slip, ball(2).mesh().unwrap()),
        (SpatialKind::Inertia, ball(2).mesh().unwrap()),
        (SpatialKind::Pocket { radius_m }, pocket),
    ]
}

/// Between the snapshots: the error is below 1e-6 of the compliance at rest. With few modes it is seen, and the indicator is above it: by Galerkin's
/// orthogonality it is the error in the energy norm of x = 0, which every other is a part of.
#[test]
fn reduced_terms_agree_with_the_full_model_between_snapshots() {
    for (kind, mesh) in kinds(2.0) {
        let system = system(&mesh, 0.48, kind);
        let values = snapshot_values(kind, RADIUS_M, OUTER_RADIUS_M, GEL_DENSITY);
        let pocket = matches!(kind, SpatialKind::Pocket { .. });
        let between: Vec<(f64, f64)> = values
            .windows(2)
            .filter(|pair| pair[0] != 0.0)
            .map(|pair| {
                let mean = |a: f64, b: f64| (a * b).sqrt();
                let x = if pocket { mean(1.0 + pair[0], 1.0 + pair[1]) - 1.0 } else { mean(pair[0], pair[1]) };
                let weights = if pocket { [1.0 + x, 1.0] } else { [1.0, x] };
                (x, 1.0 / stiffness(&system, &weights))
            })
            .collect();
        for (tolerance, largest) in [(1e-6, 1e-6), (0.1, f64::INFINITY)] {
            let modes = SpreadModes::new(&system, &values, tolerance).unwrap();
            let mut effectivities: Vec<f64> = Vec::new();
            for (x, full_per_m) in &between {
                let error = (full_per_m / modes.compliance_per_m - modes.relative_compliance(*x)).abs();
                let indicator = modes.error_indicator(*x);
                assert!(error < largest, "{kind:?}, {x:e}: {error:e}");
                assert!(indicator > 0.99 * error - 1e-10, "{kind:?}, {x:e}: {indicator:e} {error:e}");
                if error > 1e-8 {
                    effectivities.push(indicator / error);
                }
            }
            println!(
                "{kind:?}, {tolerance:e}: {} terms of {} snapshots, singular values [{}], effectivities {effectivities:.1?}",
                modes.weights.len(),
                modes.snapshots,
                modes.singular_values[..8].iter().map(|s| format!("{s:.1e}")).collect::<Vec<_>>().join(", ")
            );
            assert!(tolerance < 0.1 || !effectivities.is_empty(), "{kind:?}: the indicator was never put to the test");
        }
    }
}

fn law() -> Vec<Element> {
    BaseLaw::Lethersich.elements(&[3.527, 1.402, 47.370].map(Dual::constant))
}

fn terms(modes: &SpreadModes) -> Vec<SpreadTerm> {
    let term = |(weight, number): (&f64, &f64)| SpreadTerm { weight: (*weight).into(), number: (*number).into() };
    modes.weights.iter().zip(&modes.numbers).map(term).collect()
}

/// Creep after one step by the terms' spectrum against time stepping of the full model, which shares no more than the matrices.
#[test]
fn creep_by_terms_agrees_with_time_stepping() {
    let window = TimeWindow { shortest_s: 0.02, longest_s: 5.0 };
    for (kind, mesh) in kinds(3.0) {
        let system = system(&mesh, 0.48, kind);
        let modes =
            SpreadModes::new(&system, &snapshot_values(kind, RADIUS_M, OUTER_RADIUS_M, GEL_DENSITY), 1e-6).unwrap();
        let soft: Vec<Element> = BaseLaw::Lethersich.elements(&[0.4 * 3.527, 1.402, 47.370].map(Dual::constant));
        let (beside, scaled) = match kind {
            SpatialKind::Slip => {
                let compliance = 3e-4;
                let scaled = Scaled { system: &system, friction_scale: 1.0 / compliance, density_scale: 0.0 };
                (Beside::Friction { compliance: compliance.into() }, scaled)
            }
            SpatialKind::Inertia => (
                Beside::Mass { scale: 1.0.into() },
                Scaled { system: &system, friction_scale: 0.0, density_scale: 1.0 },
            ),
            SpatialKind::Pocket { .. } => {
                (Beside::Law(soft.clone()), Scaled { system: &system, friction_scale: 0.0, density_scale: 0.0 })
            }
        };
        let spectrum = RetardationSpectrum::spread(&law(), &beside, &terms(&modes), window, Accuracy::Fine).unwrap();
        let time_s: Vec<f64> = (0..=250).map(|i| 0.02 * f64::from(i)).collect();
        let force_n = vec![4.6e-6; time_s.len()];
        let chain = |law: &[Element]| -> CreepCompliance { transient::chain_of(law, window).unwrap() };
        let laws = match kind {
            SpatialKind::Pocket { .. } => vec![chain(&soft), chain(&law())],
            _ => vec![chain(&law())],
        };
        let run = transient::run(&scaled, &laws, &Load::held(&time_s, &force_n), &time_s, &[], Resolution::default())
            .unwrap();
        let amplitude = run.position_m.iter().copied().fold(0.0, f64::max);
        let base = CreepCompliance::lethersich(&[3.527, 1.402, 47.370]);
        let (mut worst, mut moved) = (0.0_f64, 0.0_f64);
        for (t, stepped) in time_s.iter().zip(&run.position_m).skip(1) {
            let scale = modes.compliance_per_m * 4.6e-6;
            worst = worst.max((scale * spectrum.creep_compliance_per_pa(*t) - stepped).abs() / amplitude);
            moved = moved.max((scale * base.at(*t) - stepped).abs() / amplitude);
        }
        println!("{kind:?}: {worst:e} of the amplitude, the effect moves it by {moved:e}; {} steps", run.n_steps);
        assert!(worst < 1e-5, "{kind:?}: {worst:e}");
        assert!(moved > 1e-3, "{kind:?}: {moved:e}");
    }
}

/// Positions by superposition of one step's answer against steps through every change of the force, which is what a run with fields takes: delay, lag, factors,
/// an offset from the start, changes that fall between rows, and rows at which the force changes.
#[test]
fn superposed_positions_are_those_of_steps_through_every_switch() {
    let mesh = ball(1).mesh().unwrap();
    let stiffness = Stiffness::new(&mesh).unwrap();
    let surroundings = surroundings(&mesh, &stiffness, 0.48);
    let time_s: Vec<f64> = (0..60).map(|row| 3.0 + 0.1 * f64::from(row)).collect();
    let force_n: Vec<f64> = (0..60).map(|row| [4e-6, -4e-6, 0.0, 2e-6][row / 15]).collect();
    for spatial in
        [Spatial::Slip { compliance_m_per_pa_s: 3e-4.into() }, Spatial::Inertia { density_scale: 50.0.into() }]
    {
        for (delay_s, lag_s) in [(0.0, 0.0), (0.033, 0.12)] {
            let mut stages = Stages::of_law(law());
            stages.spatial = Some(spatial.clone());
            stages.load.delay_s = delay_s.into();
            stages.load.lag_time_s = lag_s.into();
            stages.load.negative_factor = 0.9.into();
            stages.load.offset_n = 2e-7.into();
            stages.observation.velocity_m_per_s = 1e-6.into();
            let run = |rows: &[usize]| {
                spatial::run(&surroundings, &stages, &time_s, &force_n, rows, Resolution::default()).unwrap().position_m
            };
            let (stepped, superposed) = (run(&[59]), run(&[]));
            let amplitude = stepped.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            let error =
                stepped.iter().zip(&superposed).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs())) / amplitude;
            println!("{spatial:?}, delay {delay_s} s, lag {lag_s} s: {error:.1e}");
            assert!(error < 2e-6 && amplitude > 1e-5, "{error:e} of {amplitude:e} m");
        }
    }
}
