//! Tests of the time steps against closed forms, and against modes of small meshes. Matrix
//! exponentials step the modes, which are eigenvectors. The tests share no code with the steps.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::*;
use crate::fe::element::TabulatedElement;
use crate::fe::stepping::tests::{distance, record_of};
use crate::fe::time::{FullOrderModel, TimeScheme};
use crate::fe::{Assembly, Stiffness, stepping};
use crate::mesh::{Mesh, QuarterBall};
use base::number::Dual;
use laws::rheology::BaseLaw;
use laws::stages::Stages;

/// Young's modulus (Pa), retardation and flow viscosity (Pa·s) of the paper, and the modulus (Pa)
/// of a spring in series.
const PARAMETERS: [f64; 4] = [3.527, 1.402, 47.370, 20.0];
const WINDOW: TimeWindow = TimeWindow { shortest_s: 1e-3, longest_s: 100.0 };

fn elements(law: BaseLaw) -> Vec<Element> {
    law.elements(&PARAMETERS.map(Dual::constant)[..law.parameters().len()])
}

fn chain(law: BaseLaw) -> CreepCompliance {
    to_chain(&elements(law), WINDOW).expect("springs and dashpots").bodies
}

fn record() -> (Vec<f64>, Vec<f64>) {
    record_of(100, 60, 80)
}

/// A system of dense matrices. The last unknown is the robot's displacement.
struct Dense {
    stiffness: Vec<DMatrix<f64>>,
    damping: Option<DMatrix<f64>>,
    mass: Option<DMatrix<f64>>,
    load: DVector<f64>,
}

impl TransientSystem for Dense {
    fn n_unknowns(&self) -> usize {
        self.load.len()
    }
    fn n_laws(&self) -> usize {
        self.stiffness.len()
    }
    fn has_mass(&self) -> bool {
        self.mass.is_some()
    }
    fn factor(&self, weights: &StageWeights) -> Result<StageSolve<'_>> {
        let mut matrix = DMatrix::zeros(self.load.len(), self.load.len());
        self.stiffness.iter().zip(&weights.stiffness).for_each(|(k, weight)| matrix += k * *weight);
        self.damping.iter().for_each(|d| matrix += d * weights.damping_per_pa_s);
        self.mass.iter().for_each(|m| matrix += m * weights.mass_per_pa_s2);
        let factor = matrix.cholesky().expect("positive definite");
        Ok(Box::new(move |right_hand_side| {
            let solved = factor.solve(&DVector::from_column_slice(right_hand_side));
            right_hand_side.copy_from_slice(solved.as_slice());
            Ok(())
        }))
    }
    fn add_product(&self, part: ChainPart, x: &[f64], result: &mut [f64]) {
        let matrix = match part {
            ChainPart::Stiffness(law) => Some(&self.stiffness[law]),
            ChainPart::Damping => self.damping.as_ref(),
            ChainPart::Mass => self.mass.as_ref(),
        };
        if let Some(matrix) = matrix {
            let product = matrix * DVector::from_column_slice(x);
            result.iter_mut().zip(product.iter()).for_each(|(r, p)| *r += p);
        }
    }
    fn add_load(&self, force_n: f64, right_hand_side: &mut [f64]) {
        right_hand_side.iter_mut().zip(self.load.iter()).for_each(|(r, f)| *r += force_n * f);
    }
    fn position_m(&self, unknowns: &[f64]) -> f64 {
        unknowns[unknowns.len() - 1]
    }
}

fn ball() -> Mesh {
    let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 3e-3, n_per_edge: 1, n_layers: 2 };
    ball.mesh().expect("the radii are in order")
}

/// The base model with the stiffness of a mesh as a dense matrix. `robot_load` is a unit force on
/// the whole body.
fn base() -> Dense {
    let assembly = Assembly::new(&ball()).expect("a sound mesh");
    let upper = assembly.unit_stiffness(0.48);
    let n = upper.nrows();
    let mut matrix = DMatrix::zeros(n, n);
    for column in 0..n {
        for at in upper.col_ptr()[column]..upper.col_ptr()[column + 1] {
            let (row, value) = (upper.row_idx()[at as usize] as usize, upper.val()[at as usize]);
            (matrix[(row, column)], matrix[(column, row)]) = (value, value);
        }
    }
    let mut load = DVector::zeros(n);
    load[n - 1] = assembly.unknowns.share();
    Dense { stiffness: vec![matrix], damping: None, mass: None, load }
}

/// Mass of each unknown for a density, as a diagonal matrix. It is ∫ ρ φ² dV with the unknown's
/// shape function φ, which is positive and of a realistic size for the mesh.
fn lumped_mass(density_kg_per_m3: f64) -> DMatrix<f64> {
    let (mesh, assembly) = (ball(), Assembly::new(&ball()).expect("a sound mesh"));
    let table = TabulatedElement::of(mesh.element_kind);
    let mut mass = vec![0.0; assembly.unknowns.count()];
    for nodes in mesh.elements() {
        let coordinates: Vec<_> = nodes.iter().map(|&n| mesh.node_coordinates_m[n as usize]).collect();
        table
            .for_each_point(&coordinates, |point| {
                for (&node, n) in nodes.iter().zip(point.shape) {
                    let share = density_kg_per_m3 * n * n * point.volume_m3;
                    assembly.unknowns.add_nodal_force(node as usize, [share; 3], &mut mass);
                }
            })
            .expect("no element is inverted");
    }
    DMatrix::from_diagonal(&DVector::from_vec(mass))
}

/// Eigenvalues μ and matrix V of eigenvectors v of A v = μ B v, with Vᵀ B V = 1.
fn eigen(a: &DMatrix<f64>, b: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let lower = b.clone().cholesky().expect("positive definite").l();
    let left = lower.solve_lower_triangular(a).expect("not singular");
    let both = lower.solve_lower_triangular(&left.transpose()).expect("not singular");
    let eigen = ((&both + both.transpose()) * 0.5).symmetric_eigen();
    let vectors = lower.transpose().solve_upper_triangular(&eigen.eigenvectors).expect("not singular");
    (eigen.eigenvalues, vectors)
}

/// Positions by superposition of modes: v_robot (vᵀf) times the scalar response of each mode.
/// `response` maps an eigenvalue to the response at every row.
fn by_modes(
    system: &Dense,
    (values, vectors): (DVector<f64>, DMatrix<f64>),
    response: impl Fn(f64) -> Vec<f64>,
) -> Vec<f64> {
    let mut position = vec![0.0; record().0.len()];
    for (mode, vector) in vectors.column_iter().enumerate() {
        let amplitude = vector[vector.len() - 1] * vector.dot(&system.load);
        let scaled = response(values[mode]);
        position.iter_mut().zip(scaled).for_each(|(x, q)| *x += amplitude * q);
    }
    position
}

/// Solves ẏ = A y + b F from rest and returns `output`ᵀ y at every row. The matrix exponential of
/// every interval is computed separately.
fn by_exponentials<const N: usize>(a: SMatrix<f64, N, N>, b: SVector<f64, N>, output: SVector<f64, N>) -> Vec<f64> {
    let (time_s, force_n) = record();
    let mut y = DVector::<f64>::zeros(N + 1);
    let mut rows = vec![0.0];
    for row in 1..time_s.len() {
        let mut matrix = DMatrix::zeros(N + 1, N + 1);
        matrix.view_mut((0, 0), (N, N)).copy_from(&a);
        matrix.view_mut((0, N), (N, 1)).copy_from(&b);
        y[N] = force_n[row - 1];
        y = (matrix * (time_s[row] - time_s[row - 1])).exp() * y;
        rows.push(output.iter().zip(y.iter()).map(|(o, y)| o * y).sum());
    }
    rows
}

fn stepped(system: &Dense, laws: &[CreepCompliance], resolution: Resolution) -> Vec<f64> {
    let (time_s, force_n) = record();
    let load = Load::commanded(&time_s, &force_n);
    run(system, laws, &load, &time_s, &[], resolution).expect("a sound model").position_m
}

#[test]
fn the_base_model_is_its_exact_solution() {
    let (stiffness, (time_s, force_n)) = (Stiffness::new(&ball()).expect("a sound mesh"), record());
    let exact = FullOrderModel::new(&stiffness, 0.48).expect("positive definite");
    let solved = exact.solve_load(&time_s, &force_n);
    let (system, rows) = (base(), [0, 7, 61, 99]);
    for law in BaseLaw::NAMED.into_iter().filter(|law| law.parameters().len() <= PARAMETERS.len()) {
        let law = chain(law);
        let load = Load::commanded(&time_s, &force_n);
        let found = run(&system, std::slice::from_ref(&law), &load, &time_s, &rows, Resolution::default())
            .expect("a sound model");
        let error = distance(&found.position_m, &exact.trajectory(&solved, &law, TimeScheme::Exponential));
        println!("{error:e} in {} steps with {} factors", found.n_steps, found.n_factors);
        assert!(error < 1e-6, "{error:e}");
        for (found, exact) in found.fields.iter().zip(exact.fields(&solved, &law, &rows)).skip(1) {
            assert!(distance(found, &exact) < 1e-6);
        }
    }
}

/// Compares with the sum of the modes, which obey λ w + z̈ = F with the eigenvalue λ. Matrix
/// exponentials step the state (ε_k, ε_d, ż) of each mode.
#[test]
fn inertia_is_the_sum_of_its_modes() {
    let mut system = base();
    let mass = lumped_mass(2e5);
    let modes = eigen(&system.stiffness[0], &mass);
    let [e, c1, c2, _] = PARAMETERS;
    let exact = by_modes(&system, modes, |lambda| {
        // ż = a w − (E/c₁) ε_k gives w = (ż + (E/c₁) ε_k)/a.
        let (a, b) = (1.0 / c1 + 1.0 / c2, e / c1);
        let (k, d) = ([b / a / c1 - b, 0.0, 1.0 / (a * c1)], [b / a / c2, 0.0, 1.0 / (a * c2)]);
        let v = [-lambda * b / a, 0.0, -lambda / a];
        let rows = SMatrix::<f64, 3, 3>::from_fn(|row, column| [k, d, v][row][column]);
        by_exponentials(rows, SVector::from([0.0, 0.0, 1.0]), SVector::from([1.0, 1.0, 0.0]))
    });
    let without = stepped(&system, &[chain(BaseLaw::Lethersich)], Resolution::default());
    system.mass = Some(mass);
    let found = stepped(&system, &[chain(BaseLaw::Lethersich)], Resolution::default());
    println!("inertia: error {:e}, effect {:e}", distance(&found, &exact), distance(&without, &exact));
    assert!(distance(&without, &exact) > 1e-2, "inertia matters here");
    assert!(distance(&found, &exact) < 1e-6, "{:e}", distance(&found, &exact));
}

/// Compares with the sum of the modes, which obey w + μ ż = F with the eigenvalue μ, for a damping
/// that acts on few unknowns. The spring in series makes the other unknowns jump.
#[test]
fn damping_is_the_sum_of_its_modes() {
    let mut system = base();
    let n = system.load.len();
    let scale = 3.0 * system.stiffness[0][(n - 1, n - 1)];
    let damping = DMatrix::from_fn(n, n, |i, j| {
        let shape = |i: usize| if i.is_multiple_of(3) { (1.3 * i as f64).sin() } else { 0.0 };
        scale * (if i == j && i.is_multiple_of(5) { 1.0 } else { 0.0 } + shape(i) * shape(j))
    });
    let modes = eigen(&damping, &system.stiffness[0]);
    let [e, c1, c2, e0] = PARAMETERS;
    let exact = by_modes(&system, modes, |mu| {
        let (a, b) = (1.0 / c1 + 1.0 / c2, e / c1);
        if mu < 1e-9 {
            let rows = SMatrix::<f64, 2, 2>::new(-b, 0.0, 0.0, 0.0);
            let slow = by_exponentials(rows, SVector::from([1.0 / c1, 1.0 / c2]), SVector::from([1.0, 1.0]));
            let force_n = record().1;
            let before = |row: usize| if row == 0 { 0.0 } else { force_n[row - 1] };
            return slow.iter().enumerate().map(|(row, q)| q + before(row) / e0).collect();
        }
        // The state equation is ż = (F − w)/μ = ẇ/E₀ + a w − (E/c₁) ε_k.
        let w = [e0 * b, 0.0, -e0 * (1.0 / mu + a)];
        let rows =
            SMatrix::<f64, 3, 3>::from_fn(|row, column| [[-b, 0.0, 1.0 / c1], [0.0, 0.0, 1.0 / c2], w][row][column]);
        by_exponentials(rows, SVector::from([0.0, 0.0, e0 / mu]), SVector::from([1.0, 1.0, 1.0 / e0]))
    });
    let without = stepped(&system, &[chain(BaseLaw::Burgers)], Resolution::default());
    system.damping = Some(damping);
    let found = stepped(&system, &[chain(BaseLaw::Burgers)], Resolution::default());
    println!("damping: error {:e}, effect {:e}", distance(&found, &exact), distance(&without, &exact));
    assert!(distance(&without, &exact) > 1e-2, "damping matters here");
    assert!(distance(&found, &exact) < 1e-6, "{:e}", distance(&found, &exact));
}

/// Compares with the sum of the modes, which obey κ w₁ + (1 − κ) w₂ = F with the eigenvalue κ: two
/// laws in parallel whose creep is known exactly.
#[test]
fn two_laws_are_the_sum_of_their_modes() {
    let whole = base();
    let n = whole.load.len();
    // K₁ is a part of the stiffness: K₁ = K^{1/2} P K^{1/2}, a congruence with a diagonal matrix P
    // whose entries lie between 0 and 1.
    let lower = whole.stiffness[0].clone().cholesky().expect("positive definite").l();
    let share = DVector::from_fn(n, |i, _| if i.is_multiple_of(4) { 0.0 } else { (0.7 * i as f64).sin().powi(2) });
    let first = &lower * DMatrix::from_diagonal(&share) * lower.transpose();
    let second = &whole.stiffness[0] - &first;
    let other = vec![
        Element::kelvin_voigt(Dual::constant(1.0), Dual::constant(3.0)),
        Element::Dashpot { viscosity_pa_s: Dual::constant(20.0) },
    ];
    let scaled = |law: &[Element], factor: f64| -> Element {
        let of = |element: &Element| match element {
            Element::Spring { modulus_pa } => Element::Spring { modulus_pa: *modulus_pa * factor },
            Element::Dashpot { viscosity_pa_s } => Element::Dashpot { viscosity_pa_s: *viscosity_pa_s * factor },
            _ => unreachable!("a body's parts"),
        };
        let body = |element: &Element| match element {
            Element::Parallel(parts) => Element::Parallel(parts.iter().map(of).collect()),
            single => of(single),
        };
        Element::Series(law.iter().map(body).collect())
    };
    let (time_s, force_n) = record();
    let exact = by_modes(&whole, eigen(&first, &whole.stiffness[0]), |kappa| {
        let kappa = kappa.clamp(0.0, 1.0);
        let law = if kappa < 1e-9 {
            other.clone()
        } else {
            vec![Element::Parallel(vec![scaled(&elements(BaseLaw::Lethersich), kappa), scaled(&other, 1.0 - kappa)])]
        };
        let spectrum = RetardationSpectrum::of_law(&law, WINDOW).expect("springs and dashpots");
        let at = |row: usize| {
            let jumps = (0..row).map(|k| (time_s[k], force_n[k] - if k == 0 { 0.0 } else { force_n[k - 1] }));
            jumps.filter(|j| j.1 != 0.0).map(|(t, f)| f * spectrum.creep_compliance_per_pa(time_s[row] - t)).sum()
        };
        (0..time_s.len()).map(at).collect()
    });
    let system = Dense { stiffness: vec![first, second], ..base() };
    let laws = [chain(BaseLaw::Lethersich), to_chain(&other, WINDOW).expect("springs and dashpots").bodies];
    let found = stepped(&system, &laws, Resolution::default());
    let without = stepped(&whole, &laws[..1], Resolution::default());
    println!("two laws: error {:e}, effect {:e}", distance(&found, &exact), distance(&without, &exact));
    assert!(distance(&without, &exact) > 1e-2, "the second law matters here");
    assert!(distance(&found, &exact) < 1e-6, "{:e}", distance(&found, &exact));
}

/// Checks the order of the error for one unknown with K w + M z̈ = F under a Kelvin–Voigt body. It
/// is an oscillator, whose steps have a largest length.
#[test]
fn the_error_falls_with_the_fourth_power_of_the_step() {
    let (modulus, viscosity, mass) = (3.0, 0.4, 0.1_f64);
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    let system =
        Dense { stiffness: vec![one(1.0)], damping: None, mass: Some(one(mass)), load: DVector::from_element(1, 1.0) };
    let law = [CreepCompliance {
        instantaneous_per_pa: 0.0,
        retarded: vec![RetardedMode { compliance_per_pa: 1.0 / modulus, time_s: viscosity / modulus }],
        fluidity_per_pa_s: 0.0,
    }];
    let (decay, frequency) = (0.5 * viscosity / mass, (modulus / mass - (0.5 * viscosity / mass).powi(2)).sqrt());
    let step = |t: f64| {
        let swing = (frequency * t).cos() + decay / frequency * (frequency * t).sin();
        (1.0 - (-decay * t).exp() * swing) / modulus
    };
    let (time_s, force_n) = ([0.0, 0.31, 0.6, 1.0, 1.7, 2.3], [1.0, 1.0, 1.0, -1.0, -1.0, -1.0]);
    let exact: Vec<f64> = time_s.iter().map(|&t| step(t) - if t > 1.0 { 2.0 * step(t - 1.0) } else { 0.0 }).collect();
    let error = |steps_per_doubling: u32| {
        let resolution = Resolution { steps_per_doubling, longest_step_s: 0.32 / f64::from(steps_per_doubling) };
        let load = Load::commanded(&time_s, &force_n);
        distance(&run(&system, &law, &load, &time_s, &[], resolution).expect("sound").position_m, &exact)
    };
    let errors = [8, 16, 32].map(error);
    println!("{errors:?}");
    for pair in errors.windows(2) {
        assert!((3.5..6.0).contains(&(pair[0] / pair[1]).log2()), "{errors:?}");
    }
    assert!(errors[2] < 1e-6, "{errors:?}");
}

/// Compares lag, force gradient and switches between rows with the Radau steps of [`stepping`].
#[test]
fn lag_and_gradient_are_those_of_the_other_stepper() {
    let stiffness = Stiffness::new(&ball()).expect("a sound mesh");
    let model = FullOrderModel::new(&stiffness, 0.48).expect("positive definite");
    let (time_s, force_n) = record();
    let scale = 1e-3 / model.compliance_per_m();
    let force_n: Vec<f64> = force_n.iter().map(|f| f * scale).collect();
    let system = base();
    let mut stages = Stages::of_law(elements(BaseLaw::Burgers));
    stages.load.delay_s = Dual::constant(0.0137);
    stages.load.lag_time_s = Dual::constant(0.2);
    for gradient_per_m in [0.0, 200.0, -200.0, -600.0] {
        stages.load.gradient_per_m = Dual::constant(gradient_per_m);
        let exact = model.step(&stages, &time_s, &force_n, stepping::Resolution::default()).expect("a sound model");
        let mut load = Load::commanded(&time_s, &force_n);
        (load.equations.lag_time_s, load.equations.gradient_per_m) = (0.2, gradient_per_m);
        load.switches.iter_mut().for_each(|switch| switch.time_s += 0.0137);
        let law = [chain(BaseLaw::Burgers)];
        let found = run(&system, &law, &load, &time_s, &[], Resolution::default()).expect("a sound model");
        let error = distance(&found.position_m, &exact.displacement_m);
        println!("gradient {gradient_per_m}: {error:e}");
        assert!(error < if gradient_per_m < -200.0 { 5e-6 } else { 2e-6 }, "{gradient_per_m}: {error:e}");
    }
    let mut load = Load::commanded(&time_s, &force_n);
    load.equations.gradient_per_m = 4000.0;
    let refused = run(&system, &[chain(BaseLaw::Burgers)], &load, &time_s, &[], Resolution::default());
    assert!(refused.is_err_and(|e| e.to_string().contains("pulls the robot away")));
}

/// Checks that the chain of a springpot is accurate for times within the window.
#[test]
fn springpots_are_those_of_the_other_stepper() {
    let stiffness = Stiffness::new(&ball()).expect("a sound mesh");
    let model = FullOrderModel::new(&stiffness, 0.48).expect("positive definite");
    let (time_s, force_n) = record();
    let [e, c1, c2, _] = PARAMETERS.map(Dual::constant);
    let order = Dual::constant(0.7);
    let springpot = Element::Springpot { modulus_pa: e, time_s: c1 / e, order };
    let beside = Element::Parallel(vec![Element::Spring { modulus_pa: e }, springpot.clone()]);
    let flow = Element::Dashpot { viscosity_pa_s: c2 };
    // A springpot beside a spring has complex rates. One in series has none.
    for (law, n_turning) in [
        (vec![Element::kelvin_voigt(e, c1), springpot, flow.clone()], 0),
        (vec![beside.clone(), flow], 1),
        (vec![beside], 1),
    ] {
        let chain = to_chain(&law, WINDOW).expect("a law");
        assert_eq!(chain.oscillating.len(), n_turning);
        let stages = Stages::of_law(law);
        let exact = model.step(&stages, &time_s, &force_n, stepping::Resolution::default()).expect("a sound model");
        let load = Load::commanded(&time_s, &force_n);
        let found = run(&base(), &[chain], &load, &time_s, &[], Resolution::default()).expect("a sound model");
        let error = distance(&found.position_m, &exact.displacement_m);
        println!("springpot, {n_turning} complex: {error:e}");
        assert!(error < 1e-6, "{n_turning}: {error:e}");
    }
}

#[test]
fn laws_that_do_not_fit_are_refused() {
    let (system, (time_s, force_n)) = (base(), record());
    let load = Load::commanded(&time_s, &force_n);
    let rigid = CreepCompliance { instantaneous_per_pa: 0.0, retarded: Vec::new(), fluidity_per_pa_s: 0.0 };
    for (laws, words) in [
        (vec![], "the system has 1 laws and 0 are given"),
        (vec![rigid], "the response of a law to a step of"),
        (vec![chain(BaseLaw::Burgers); 2], "the system has 1 laws and 2 are given"),
    ] {
        let error = run(&system, &laws, &load, &time_s, &[], Resolution::default()).unwrap_err().to_string();
        assert!(error.contains(words), "`{words}` in {error}");
    }
    let nothing =
        run(&system, &[chain(BaseLaw::Burgers)], &Load::commanded(&[], &[]), &[1.0, 2.0], &[], Resolution::default());
    assert_eq!(nothing.expect("no force").position_m, [0.0, 0.0]);
}
