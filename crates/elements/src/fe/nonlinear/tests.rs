//! Tests of nonlinear runs: against the linear model, against homogeneous bodies solved by other
//! means, and against each other.

use super::*;
use crate::fe::stepping::tests::distance;
use crate::fe::time::FullOrderModel;
use crate::mesh::QuarterBall;
use laws::rheology::BaseLaw;
use laws::stages::{Nonlinearity, Stages, YIELD_SMOOTHING};

/// Fraction of the body in the quarter model.
const QUARTER: f64 = 0.25;
const P: [f64; 5] = [3.527, 1.402, 47.370, 20.0, 2.5];
const FORCE_N: f64 = 4.6e-6;
/// Stress s₀ of physics §5 for the reference force and radius, in Pa.
const REFERENCE_STRESS_PA: f64 = 4.84;

fn lethersich() -> Vec<Element> {
    BaseLaw::Lethersich.elements(&[P[0], P[1], P[2]].map(Dual::constant))
}

fn ball() -> Mesh {
    let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 1, n_layers: 3 };
    ball.mesh().expect("the sizes are good")
}

/// Load with all its effects at once.
fn full_load() -> Load {
    let mut load = Stages::of_law(Vec::new()).load;
    load.delay_s = 0.013.into();
    load.positive_factor = 1.05.into();
    load.negative_factor = 0.9.into();
    load.offset_n = (0.03 * FORCE_N).into();
    load.lag_time_s = 0.05.into();
    load.gradient_per_m = 200.0.into();
    load
}

/// Irregular times (s) and forces (N), with two switches.
fn record() -> (Vec<f64>, Vec<f64>) {
    let time_s = [3.0, 3.1, 3.5, 4.5, 6.0, 6.25, 7.5, 9.0].to_vec();
    let force_n = [1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0].map(|f| f * FORCE_N).to_vec();
    (time_s, force_n)
}

/// Compares the nonlinear laws at their nulls with fifth-order steps of the linear model. The
/// linear model shares only the load's switches and the ladder of step lengths with the tested
/// code.
#[test]
fn nulls_are_the_linear_model() {
    let mesh = ball();
    let stiffness = Stiffness::new(&mesh).unwrap();
    let model = NonlinearModel::new(&mesh, &stiffness, 0.48).unwrap();
    let linear = FullOrderModel::new(&stiffness, 0.48).unwrap();
    let (time_s, force_n) = record();
    for (law, nonlinearity) in [
        (BaseLaw::Lethersich, Nonlinearity::StrainStiffening { coefficient: 0.0 }),
        (BaseLaw::Burgers, Nonlinearity::ShearThinning { index: 1.0, reference_stress_pa: REFERENCE_STRESS_PA }),
        (BaseLaw::TwoElement, Nonlinearity::YieldStress { stress_pa: 0.0, smoothing: YIELD_SMOOTHING }),
    ] {
        for load in [Stages::of_law(Vec::new()).load, full_load()] {
            let parameters = &P[..law.parameters().len()];
            let mut stages = Stages::of_law(law.elements(&parameters.iter().map(|p| (*p).into()).collect::<Vec<_>>()));
            stages.load = load;
            let exact = linear.step(&stages, &time_s, &force_n, Resolution::default()).unwrap();
            let load = &stages.load;
            let (law, nonlinearity) = (&stages.law, nonlinearity.constant());
            let what = NonlinearInput { law, nonlinearity, load, time_s: &time_s, force: (&force_n).into() };
            let found = model.run(&what, &[3, 7, 99], NonlinearOptions::default()).unwrap();
            let error = distance(&found.displacement_m, &exact.displacement_m);
            assert!(error < 1e-5, "{law:?}: {error:e}");
            for (field, exact) in found.fields.iter().zip(linear.fields_of(&exact, &[3, 7])) {
                assert!(distance(field, &exact) < 1e-5, "{law:?}");
            }
            assert_eq!(found.fields.len(), 2);
        }
    }
}

/// A cube of 2 × 2 × 2 elements with curved inner faces. Only u_x is free. One face is fixed, and
/// the opposite one moves as a whole.
fn cube(axis: usize) -> Mesh {
    let mut mesh = Mesh {
        node_coordinates_m: Vec::new(),
        element_kind: crate::mesh::ElementKind::Hexahedron27,
        connectivity: Vec::new(),
        robot_nodes: Vec::new(),
        outer_nodes: Vec::new(),
        symmetry_y_nodes: (0..125).collect(),
        symmetry_z_nodes: (0..125).collect(),
    };
    for node in 0..125_u32 {
        let grid = [node % 5, node / 5 % 5, node / 25];
        let place = |d: usize| {
            let inside = grid.iter().all(|&g| g > 0 && g < 4);
            let shift = if inside { 0.12 * (f64::from(node) + d as f64).sin() } else { 0.0 };
            0.25 * (f64::from(grid[d]) + shift)
        };
        mesh.node_coordinates_m.push([0, 1, 2].map(place));
        if grid[axis] == 4 {
            mesh.robot_nodes.push(node);
        }
        if grid[axis] == 0 {
            mesh.outer_nodes.push(node);
        }
    }
    for element in 0..8_usize {
        let corner = [element % 2, element / 2 % 2, element / 4].map(|e| 2 * e);
        mesh.connectivity.extend(crate::mesh::HEXAHEDRON27_REFERENCE_NODES.iter().map(|reference| {
            let [i, j, k] = std::array::from_fn(|d| corner[d] + (reference[d] + 1.0) as usize);
            (i + 5 * (j + 5 * k)) as u32
        }));
    }
    mesh
}

/// The Lethersich law in a homogeneous motion, solved by the classical Runge–Kutta method. The
/// strain has one coordinate of the deviator, and a trace.
struct Homogeneous {
    nonlinearity: Nonlinearity,
    poisson_ratio: f64,
    /// True if the motion is a simple shear. Otherwise it is a stretch along x at fixed width.
    shears: bool,
}

impl Homogeneous {
    fn fluidity(&self, equivalent_pa: f64) -> f64 {
        let share = match self.nonlinearity {
            Nonlinearity::StrainStiffening { .. } => 1.0,
            Nonlinearity::ShearThinning { index, reference_stress_pa } => {
                (equivalent_pa / reference_stress_pa).powf(1.0 / index - 1.0)
            }
            // The yield law is the sharp one, without smoothing.
            Nonlinearity::YieldStress { stress_pa, .. } => (1.0 - stress_pa / equivalent_pa).max(0.0),
        };
        share / P[2]
    }

    fn modulus_pa(&self, equivalent: f64) -> f64 {
        match self.nonlinearity {
            Nonlinearity::StrainStiffening { coefficient } => P[0] * (1.0 + coefficient * equivalent * equivalent),
            _ => P[0],
        }
    }

    /// Rates of the spring's strain ε_k and the dashpot's strain ε_d, each in the deviator (ε_xy or
    /// ε_xx) and the trace. The stress is σ_xy or σ_xx.
    fn rates(&self, stress_pa: f64, k: [f64; 2]) -> [f64; 4] {
        let [two_mu, kappa] = crate::fe::assembly::unit_moduli(self.poisson_ratio);
        // Equivalent strain per coordinate. It is √⅔ times the deviator's norm, which is √2 |ε_xy|
        // or √1.5 |dev ε_xx|.
        let per = if self.shears { (4.0_f64 / 3.0).sqrt() } else { 1.0 };
        let rates = |s: [f64; 2]| {
            let fluidity = self.fluidity(per * s[0].abs());
            let body = [self.modulus_pa(per * k[0].abs()), P[0]];
            let retarded = [0, 1].map(|i| (s[i] - body[i] * k[i]) / P[1]);
            [retarded[0], retarded[1], fluidity * s[0], fluidity * s[1]]
        };
        if self.shears {
            return rates([stress_pa / two_mu, 0.0]);
        }
        // The strain is uniaxial. The deviator's rate is therefore ⅔ of the trace's; this
        // determines the corresponding stress.
        let both = |deviator: f64| [deviator, (stress_pa - two_mu * deviator) / kappa];
        let excess = |deviator: f64| {
            let r = rates(both(deviator));
            r[0] + r[2] - 2.0 / 3.0 * (r[1] + r[3])
        };
        let (mut lower, mut upper) = (-100.0, 100.0);
        for _ in 0..70 {
            let middle = 0.5 * (lower + upper);
            *(if excess(middle) > 0.0 { &mut upper } else { &mut lower }) = middle;
        }
        rates(both(0.5 * (lower + upper)))
    }

    /// Position at every row under the force `at(input, t since the switch, x)`.
    fn run(&self, time_s: &[f64], force_n: &[f64], at: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        let (mut y, mut found) = ([0.0; 4], vec![0.0]);
        let position = |y: &[f64; 4]| if self.shears { 2.0 * (y[0] + y[2]) } else { y[1] + y[3] };
        for (pair, input_n) in time_s.windows(2).zip(force_n) {
            let n = 1500;
            let h = (pair[1] - pair[0]) / f64::from(n);
            for _ in 0..n {
                let rate = |y: &[f64; 4]| self.rates(QUARTER * at(*input_n, position(y)), [y[0], y[1]]);
                let moved = |k: &[f64; 4], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
                let k1 = rate(&y);
                let k2 = rate(&moved(&k1, 0.5 * h));
                let k3 = rate(&moved(&k2, 0.5 * h));
                let k4 = rate(&moved(&k3, h));
                y = std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
            }
            found.push(position(&y));
        }
        found
    }
}

/// Runs a cube of volume 1 m³ with the finite elements.
fn run_cube(
    homogeneous: &Homogeneous,
    load: &Load,
    time_s: &[f64],
    force_n: &[f64],
    options: NonlinearOptions,
) -> Vec<f64> {
    let mesh = cube(usize::from(homogeneous.shears));
    let stiffness = Stiffness::new(&mesh).unwrap();
    let model = NonlinearModel::new(&mesh, &stiffness, homogeneous.poisson_ratio).unwrap();
    let nonlinearity = homogeneous.nonlinearity.constant();
    let what = NonlinearInput { law: &lethersich(), nonlinearity, load, time_s, force: force_n.into() };
    model.run(&what, &[], options).unwrap().displacement_m
}

const CUBE_TIME_S: [f64; 6] = [0.0, 0.2, 1.0, 3.0, 3.4, 6.0];
const CUBE_FORCE_N: [f64; 6] = [8.0, 8.0, 8.0, -6.0, -6.0, -6.0];

/// Compares every law with the scalar equations, in shear and in a stretch with volume change. The
/// force depends on the position.
#[test]
fn homogeneous_motions_are_the_scalar_equations() {
    let mut load = Stages::of_law(Vec::new()).load;
    load.gradient_per_m = 0.1.into();
    for nonlinearity in [
        Nonlinearity::StrainStiffening { coefficient: 0.9 },
        Nonlinearity::ShearThinning { index: 0.5, reference_stress_pa: 0.7 },
        Nonlinearity::YieldStress { stress_pa: 0.3, smoothing: 1e-5 },
    ] {
        for shears in [true, false] {
            let homogeneous = Homogeneous { nonlinearity, poisson_ratio: 0.3, shears };
            let found = run_cube(&homogeneous, &load, &CUBE_TIME_S, &CUBE_FORCE_N, NonlinearOptions::default());
            let exact = homogeneous.run(&CUBE_TIME_S, &CUBE_FORCE_N, |f, x| f * (0.1 * x).exp());
            let error = distance(&found, &exact);
            assert!(error < 2e-5, "{nonlinearity:?} {shears}: {error:e}");
        }
    }
}

/// Checks that the smoothed yield law converges to the sharp one. Away from the yield stress the
/// error is about proportional to δ².
#[test]
fn the_sharp_yield_stress_is_the_limit_of_the_smoothed_one() {
    let load = Stages::of_law(Vec::new()).load;
    let error = |smoothing: f64| {
        let nonlinearity = Nonlinearity::YieldStress { stress_pa: 1.0, smoothing };
        let homogeneous = Homogeneous { nonlinearity, poisson_ratio: 0.3, shears: true };
        let found = run_cube(&homogeneous, &load, &CUBE_TIME_S, &CUBE_FORCE_N, NonlinearOptions::default());
        distance(&found, &homogeneous.run(&CUBE_TIME_S, &CUBE_FORCE_N, |f, _| f))
    };
    let errors = [0.3, 0.1, 0.03].map(error);
    assert!(errors[0] > 5.0 * errors[1] && errors[1] > 5.0 * errors[2], "{errors:?}");
    assert!(error(YIELD_SMOOTHING) < 1e-4);
}

/// Checks the order of the steps against the scalar equations. There is one hold per switch, so
/// that the step rule and not the rows sets the steps.
#[test]
fn the_error_falls_with_the_fourth_power_of_the_step() {
    let load = Stages::of_law(Vec::new()).load;
    let (time_s, force_n) = ([0.0, 4.0, 7.0], [8.0, -6.0, -6.0]);
    for nonlinearity in [
        Nonlinearity::StrainStiffening { coefficient: 0.9 },
        Nonlinearity::ShearThinning { index: 0.7, reference_stress_pa: 0.7 },
    ] {
        let homogeneous = Homogeneous { nonlinearity, poisson_ratio: 0.3, shears: false };
        let run = |steps_per_doubling: u32, scheme: Scheme| {
            let options = NonlinearOptions { scheme, resolution: Resolution { steps_per_doubling }, tolerance: 1e-11 };
            run_cube(&homogeneous, &load, &time_s, &force_n, options)
        };
        let exact = homogeneous.run(&time_s, &force_n, |f, _| f);
        let growth = |k: f64| k.recip().exp2() - 1.0;
        let order = |scheme: Scheme| {
            let (coarse, fine) = (distance(&run(4, scheme), &exact), distance(&run(16, scheme), &exact));
            println!("{nonlinearity:?} {scheme:?}: {coarse:.1e} {fine:.1e}");
            (coarse / fine).ln() / (growth(4.0) / growth(16.0)).ln()
        };
        let (fourth, first) = (order(Scheme::Fourth), order(Scheme::Euler));
        assert!(fourth > 3.5 && fourth < 4.5, "{nonlinearity:?}: {fourth}");
        assert!(first > 0.8 && first < 1.5, "{nonlinearity:?}: {first}");
    }
}

#[test]
fn a_run_has_the_same_bytes_for_any_number_of_threads() {
    let mesh = ball();
    let (time_s, force_n) = record();
    let (load, stiffness) = (full_load(), Stiffness::new(&mesh).unwrap());
    let model = NonlinearModel::new(&mesh, &stiffness, 0.48).unwrap();
    let nonlinearity = Nonlinearity::ShearThinning { index: 0.5, reference_stress_pa: REFERENCE_STRESS_PA };
    let (law, nonlinearity) = (&lethersich(), nonlinearity.constant());
    let what = NonlinearInput { law, nonlinearity, load: &load, time_s: &time_s, force: (&force_n).into() };
    let options = NonlinearOptions { resolution: Resolution { steps_per_doubling: 1 }, ..NonlinearOptions::default() };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| model.run(&what, &[7], options)).unwrap()
    };
    let (one, two) = (run(1), run(2));
    let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
    assert_eq!(bits(&one.displacement_m), bits(&two.displacement_m));
    assert_eq!(bits(&one.fields[0]), bits(&two.fields[0]));
}

/// Checks that a tolerance below rounding gives an error. The error must state the time, the
/// distance reached and a remedy.
#[test]
fn a_balance_that_is_not_found_is_an_error() {
    let mesh = ball();
    let stiffness = Stiffness::new(&mesh).unwrap();
    let model = NonlinearModel::new(&mesh, &stiffness, 0.48).unwrap();
    let (time_s, force_n) = record();
    let load = full_load();
    let nonlinearity = Nonlinearity::StrainStiffening { coefficient: 1.0 };
    let (law, nonlinearity) = (&lethersich(), nonlinearity.constant());
    let what = NonlinearInput { law, nonlinearity, load: &load, time_s: &time_s, force: (&force_n).into() };
    let failed = model.run(&what, &[], NonlinearOptions { tolerance: 1e-30, ..NonlinearOptions::default() });
    let message = failed.unwrap_err().to_string();
    assert!(message.contains("at 3 s with a step of") && message.contains("residual stays at"), "{message}");
    assert!(message.contains("what to do"), "{message}");
    let mut strong = full_load();
    strong.gradient_per_m = 1e4.into();
    let refused = model.run(&NonlinearInput { load: &strong, ..what }, &[], NonlinearOptions::default());
    assert!(refused.unwrap_err().to_string().contains("under a force gradient of 10000 per m"));
}

#[test]
fn a_stiffness_of_another_mesh_is_refused() {
    let (ball, cube) = (ball(), cube(0));
    let stiffness = Stiffness::new(&ball).unwrap();
    let error = NonlinearModel::new(&cube, &stiffness, 0.48).err().expect("refused").to_string();
    let words = format!("the stiffness has {} nodes and the mesh {}", ball.n_nodes(), cube.n_nodes());
    assert!(error.contains(&words) && ball.n_nodes() != cube.n_nodes(), "`{words}` in {error}");
}

/// Compares runs whose steps do not end at rows with runs whose steps do, for every law and every
/// effect of the load. The fields at chosen rows must agree, too.
#[test]
#[ignore = "thorough"]
fn rows_between_steps_are_interpolated_to_the_steps_own_error() {
    let mesh = ball();
    let stiffness = Stiffness::new(&mesh).unwrap();
    let model = NonlinearModel::new(&mesh, &stiffness, 0.48).unwrap();
    let time_s: Vec<f64> = (0..48).map(|i| 3.0 + 0.1 * f64::from(i)).collect();
    let force_n: Vec<f64> = (0..48).map(|i| [1.0, -0.8, 0.5][i / 16] * FORCE_N).collect();
    for (law, nonlinearity) in [
        (BaseLaw::Lethersich, Nonlinearity::StrainStiffening { coefficient: 0.5 }),
        (BaseLaw::Burgers, Nonlinearity::ShearThinning { index: 0.5, reference_stress_pa: REFERENCE_STRESS_PA }),
        (BaseLaw::TwoElement, Nonlinearity::YieldStress { stress_pa: 1.0, smoothing: YIELD_SMOOTHING }),
    ] {
        let parameters: Vec<Dual> = P[..law.parameters().len()].iter().map(|p| (*p).into()).collect();
        let mut stages = Stages::of_law(law.elements(&parameters));
        let mut load = full_load();
        if law == BaseLaw::Burgers {
            load.gradient_per_m = 0.0.into();
        }
        stages.load = load;
        let what = NonlinearInput {
            law: &stages.law,
            nonlinearity: nonlinearity.constant(),
            load: &stages.load,
            time_s: &time_s,
            force: (&force_n).into(),
        };
        let exact = model.run(&what, &[20, 47], NonlinearOptions::default()).unwrap();
        let mut stages = stages.clone();
        stages.spatial = Some(laws::stages::Spatial::Nonlinear(nonlinearity.constant()));
        let found = model.run_stages(&stages, &time_s, &force_n, &[47, 20, 999], NonlinearOptions::default()).unwrap();
        let error = distance(&found.displacement_m, &exact.displacement_m);
        println!("{law:?}: {error:.1e} in {} steps instead of {}", found.cost.n_steps, exact.cost.n_steps);
        assert!(error < 1e-4, "{law:?}: {error:e}");
        assert!(found.cost.n_steps < exact.cost.n_steps);
        assert!(
            distance(&found.fields[0], &exact.fields[1]) < 1e-4 && distance(&found.fields[1], &exact.fields[0]) < 1e-4
        );
        assert_eq!(found.fields.len(), 2);
    }
}
