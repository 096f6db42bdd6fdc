//! Tests of pore flow: against closed forms (physics §4.2, §4.9, Terzaghi's column), dense
//! saddle-point systems and alternative methods.

use std::f64::consts::PI;
use std::path::Path;

use crate::time::distance;
use base::number::{Dual, Scalar};
use base::{Error, Result};
use elements::fe::Stiffness;
use elements::fe::exact::SphereInContainer;
use elements::fe::poroelastic::{CondensedPores, PoreModel, PoreSpectrum, PressureSpace, SpectrumSettings};
use elements::fe::time::FullOrderModel;
use elements::fe::transient::{self, ChainPart, Load, Resolution, StageSolve, StageWeights, TransientSystem};
use elements::mesh::gmsh::read_gmsh;
use elements::mesh::{Cylinder, ElementKind, HEXAHEDRON27_REFERENCE_NODES, Mesh, QuarterBall, Spheroid};
use laws::rheology::{BaseLaw, CreepCompliance, RetardationSpectrum, TimeWindow};
use nalgebra::{DMatrix, DVector};
use record::Orientation;

/// Fraction of the body in the quarter model.
const QUARTER: f64 = 0.25;
const ROBOT_RADIUS_M: f64 = 0.275e-3;
const OUTER_RADIUS_M: f64 = 10e-3;
const DRAINED: [f64; 3] = [0.0, 0.3, 0.45];

fn ball(outer_radius_m: f64, n_per_edge: usize, n_layers: usize) -> Mesh {
    let ball = QuarterBall { robot_radius_m: ROBOT_RADIUS_M, outer_radius_m, n_per_edge, n_layers };
    ball.mesh().expect("the radii are in order")
}

/// Twice the shear modulus, and the bulk modulus, at the drained Poisson ratio, for unit Young's
/// modulus at the undrained ratio.
fn moduli(undrained: f64, drained: f64) -> [f64; 2] {
    let two_mu = 1.0 / (1.0 + undrained);
    [two_mu, two_mu * (1.0 + drained) / (3.0 * (1.0 - 2.0 * drained))]
}

fn symmetric(upper: faer::sparse::SparseColMatRef<'_, u32, f64>) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(upper.nrows(), upper.ncols());
    for column in 0..upper.ncols() {
        for at in upper.col_ptr()[column]..upper.col_ptr()[column + 1] {
            let (row, value) = (upper.row_idx()[at as usize] as usize, upper.val()[at as usize]);
            (matrix[(row, column)], matrix[(column, row)]) = (value, value);
        }
    }
    matrix
}

/// Dense system of displacements and pressures: K w_u − Bᵀw_p = f and B u̇ + M/M̂ ṗ + k H w_p = 0.
struct Saddle {
    stiffness: DMatrix<f64>,
    damping: DMatrix<f64>,
    robot: usize,
}

impl Saddle {
    fn new(stiffness: &Stiffness, pressures: &PressureSpace, [undrained, drained]: [f64; 2], mobility: f64) -> Self {
        let softness = (1.0 + undrained) / (1.0 + drained);
        let k_d = symmetric(stiffness.assembly.unit_stiffness(drained).as_ref()) / softness;
        let (n, m) = (k_d.nrows(), pressures.n_pressures());
        let unit = |j: usize| (0..n).map(|i| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
        let columns: Vec<DVector<f64>> = (0..n).map(|j| DVector::from_vec(pressures.divergence(&unit(j)))).collect();
        let divergence = DMatrix::from_columns(&columns);
        let storage = 1.0 / (moduli(undrained, undrained)[1] - moduli(undrained, drained)[1]);
        let (mut whole, mut damping) = (DMatrix::zeros(n + m, n + m), DMatrix::zeros(n + m, n + m));
        whole.view_mut((0, 0), (n, n)).copy_from(&k_d);
        whole.view_mut((0, n), (n, m)).copy_from(&-divergence.transpose());
        whole.view_mut((n, n), (m, m)).copy_from(&(symmetric(pressures.diffusion()) * mobility));
        damping.view_mut((n, 0), (m, n)).copy_from(&divergence);
        damping.view_mut((n, n), (m, m)).copy_from(&(symmetric(pressures.mass()) * storage));
        Self { stiffness: whole, damping, robot: stiffness.assembly.unknowns.robot() }
    }

    fn compliance_per_m(&self) -> f64 {
        let mut load = DVector::zeros(self.stiffness.nrows());
        load[self.robot] = 1.0;
        let solved = (&self.stiffness + &self.damping).lu().solve(&load).expect("not singular");
        QUARTER * solved[self.robot]
    }
}

impl TransientSystem for Saddle {
    fn n_unknowns(&self) -> usize {
        self.stiffness.nrows()
    }
    fn n_laws(&self) -> usize {
        1
    }
    fn has_mass(&self) -> bool {
        false
    }
    fn factor(&self, weights: &StageWeights) -> Result<StageSolve<'_>> {
        let factor = (&self.stiffness + &self.damping * weights.damping_per_pa_s).lu();
        Ok(Box::new(move |right_hand_side| {
            let solved = factor.solve(&DVector::from_column_slice(right_hand_side)).expect("not singular");
            right_hand_side.copy_from_slice(solved.as_slice());
            Ok(())
        }))
    }
    fn add_product(&self, part: ChainPart, x: &[f64], result: &mut [f64]) {
        let matrix = match part {
            ChainPart::Stiffness(_) => &self.stiffness,
            ChainPart::Damping => &self.damping,
            ChainPart::Mass => return,
        };
        let product = matrix * DVector::from_column_slice(x);
        result.iter_mut().zip(product.iter()).for_each(|(r, p)| *r += p);
    }
    fn add_load(&self, force_n: f64, right_hand_side: &mut [f64]) {
        right_hand_side[self.robot] += QUARTER * force_n;
    }
    fn position_m(&self, unknowns: &[f64]) -> f64 {
        unknowns[self.robot]
    }
}

/// Irregular times (s) and forces: two cycles of pushes in both directions, with a rest.
fn record() -> (Vec<f64>, Vec<f64>) {
    let time_s: Vec<f64> = (0..120).map(|row| 0.25 * f64::from(row) + 0.02 * f64::from(row % 3)).collect();
    let force_n = (0..120).map(|row| [4.6e-6, -4.6e-6, 0.0][(row / 20) % 3]).collect();
    (time_s, force_n)
}

fn lethersich() -> (Vec<laws::rheology::Element>, TimeWindow) {
    let elements = BaseLaw::Lethersich.elements(&[3.527, 1.402, 47.370].map(Dual::constant));
    (elements, TimeWindow { shortest_s: 0.01, longest_s: 40.0 })
}

#[test]
fn conjugate_gradients_and_condensed_stepping_are_the_dense_saddle_system() {
    let mesh = ball(3e-3, 1, 3);
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    let model = PoreModel::new(&mesh, &stiffness, 0.48).expect("hexahedra");
    for drained in DRAINED {
        let body = model.drained(drained).expect("below the undrained ratio");
        let areas = [0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-4];
        let found = body.compliances_per_m(&areas).expect("solved");
        for (area, found) in areas.into_iter().zip(found) {
            let exact = Saddle::new(&stiffness, model.pressures(), [0.48, drained], area).compliance_per_m();
            assert!((found / exact - 1.0).abs() < 1e-11, "ν_d = {drained}, τ = {area}: {:e}", found / exact - 1.0);
        }
    }
    let body = model.drained(0.3).expect("below the undrained ratio");
    let (mobility, (time_s, force_n), (law, window)) = (2e-8, record(), lethersich());
    let law = [transient::to_chain(&law, window).expect("springs and dashpots")];
    let load = Load::commanded(&time_s, &force_n);
    let coarse = Resolution { steps_per_doubling: 4, ..Resolution::default() };
    let rows = [30, 77];
    let run = |system: &dyn TransientSystem| {
        transient::run(system, &law, &load, &time_s, &rows, coarse).expect("a sound model")
    };
    let condensed = CondensedPores::new(&body, mobility);
    let (found, exact) = (run(&condensed), run(&Saddle::new(&stiffness, model.pressures(), [0.48, 0.3], mobility)));
    assert!(distance(&found.position_m, &exact.position_m) < 1e-10);
    for (found, exact) in found.fields.iter().zip(&exact.fields) {
        let n = stiffness.n_unknowns();
        assert!(distance(&condensed.displacements(found), &exact[..n]) < 1e-9);
        assert!(distance(&found[..found.len() - 1], &exact[n..]) < 1e-8);
    }
}

const COLUMN_LENGTH_M: f64 = 2e-3;
const COLUMN_WIDTH_M: f64 = 0.5e-3;

/// A column along x, confined at its sides and fixed at its ends, with a permeable plate in the
/// middle. The pressure is odd and vanishes at the plate. The column therefore equals two of
/// Terzaghi's columns.
fn column(n_half: usize) -> Mesh {
    let (n_x, n_y) = (4 * n_half + 1, 3);
    let mut mesh = Mesh {
        node_coordinates_m: Vec::new(),
        element_kind: ElementKind::Hexahedron27,
        connectivity: Vec::new(),
        robot_nodes: Vec::new(),
        outer_nodes: Vec::new(),
        symmetry_y_nodes: (0..(n_x * n_y * n_y) as u32).collect(),
        symmetry_z_nodes: (0..(n_x * n_y * n_y) as u32).collect(),
    };
    for node in 0..n_x * n_y * n_y {
        let [i, j, k] = [node % n_x, node / n_x % n_y, node / n_x / n_y];
        let x = (i as f64 / (2 * n_half) as f64 - 1.0) * COLUMN_LENGTH_M;
        mesh.node_coordinates_m.push([x, 0.5 * j as f64 * COLUMN_WIDTH_M, 0.5 * k as f64 * COLUMN_WIDTH_M]);
        match i {
            i if i == 2 * n_half => mesh.robot_nodes.push(node as u32),
            i if i == 0 || i + 1 == n_x => mesh.outer_nodes.push(node as u32),
            _ => {}
        }
    }
    for element in 0..2 * n_half {
        mesh.connectivity.extend(HEXAHEDRON27_REFERENCE_NODES.iter().map(|reference| {
            let [i, j, k] = reference.map(|c| (c + 1.0) as usize);
            (2 * element + i + n_x * (j + n_y * k)) as u32
        }));
    }
    mesh
}

/// Compliance of the plate in the Laplace domain, per unit modulus: the drained value L/(2a E_oed)
/// minus the part that the pressures carry (K. Terzaghi 1925, with storage).
fn terzaghi_compliance(undrained: f64, drained: f64, area_m2: f64) -> f64 {
    let [two_mu, kappa] = moduli(undrained, drained);
    let oedometer = kappa + 2.0 * two_mu / 3.0;
    let storage = 1.0 / (moduli(undrained, undrained)[1] - kappa) + 1.0 / oedometer;
    let q = (storage / area_m2).sqrt() * COLUMN_LENGTH_M;
    let free = COLUMN_LENGTH_M / (2.0 * COLUMN_WIDTH_M.powi(2) * oedometer);
    free * (1.0 - (1.0 - q.tanh() / q) / (oedometer * storage))
}

#[test]
fn matrices_of_the_pressures_have_their_closed_form_values() {
    let mesh = column(3);
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    let pressures = PressureSpace::new(&mesh, &stiffness.assembly.unknowns).expect("hexahedra");
    let [mass, diffusion] = [symmetric(pressures.mass()), symmetric(pressures.diffusion())];
    let ones = DVector::from_element(pressures.n_pressures(), 1.0);
    let x =
        DVector::from_iterator(ones.len(), pressures.nodes().iter().map(|&n| mesh.node_coordinates_m[n as usize][0]));
    let volume = 2.0 * COLUMN_LENGTH_M * COLUMN_WIDTH_M.powi(2);
    assert!((ones.dot(&(&mass * &ones)) / volume - 1.0).abs() < 1e-12);
    // M and H give ∫ x² and ∫ |∇x|² for the pressure x. Constant pressures cause no flow.
    assert!((x.dot(&(&mass * &x)) / (volume * COLUMN_LENGTH_M.powi(2) / 3.0) - 1.0).abs() < 1e-12);
    assert!((x.dot(&(&diffusion * &x)) / volume - 1.0).abs() < 1e-12);
    assert!((&diffusion * &ones).amax() < 1e-12 * diffusion.amax());
    // The field is the plate's unit displacement, linear on either side. ∫ x div u is then −∫ u_x
    // over the volume, which is half of the volume.
    let nodal = |node: usize| 1.0 - mesh.node_coordinates_m[node][0].abs() / COLUMN_LENGTH_M;
    let mut displacement = vec![0.0; stiffness.n_unknowns()];
    let mut counts = displacement.clone();
    for node in 0..mesh.n_nodes() {
        stiffness.assembly.unknowns.add_nodal_force(node, [nodal(node), 0.0, 0.0], &mut displacement);
        stiffness.assembly.unknowns.add_nodal_force(node, [1.0, 0.0, 0.0], &mut counts);
    }
    displacement.iter_mut().zip(&counts).filter(|(_, n)| **n > 0.0).for_each(|(u, n)| *u /= n);
    let found = x.dot(&DVector::from_vec(pressures.divergence(&displacement)));
    assert!((found / (-0.5 * volume) - 1.0).abs() < 1e-12, "{found}");
    let mut transposed = vec![0.0; displacement.len()];
    pressures.add_transposed_divergence(x.as_slice(), &mut transposed);
    let again: f64 = transposed.iter().zip(&displacement).map(|(b, u)| b * u).sum();
    assert!((again / found - 1.0).abs() < 1e-12);
}

#[test]
fn terzaghis_column_consolidates_as_its_closed_form() {
    let areas = [1e-7, 1e-6, 1e-5];
    let errors = |n_half: usize| -> f64 {
        let mesh = column(n_half);
        let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
        let model = PoreModel::new(&mesh, &stiffness, 0.48).expect("hexahedra");
        let mut largest = 0.0_f64;
        for drained in DRAINED {
            let body = model.drained(drained).expect("below the undrained ratio");
            for (area, found) in areas.into_iter().zip(body.compliances_per_m(&areas).expect("solved")) {
                let exact = QUARTER * terzaghi_compliance(0.48, drained, area);
                largest = largest.max((found / exact - 1.0).abs());
            }
        }
        largest
    };
    let errors = [8, 16, 32].map(errors);
    println!("Terzaghi: {errors:?}");
    // The order is two, twice the order of the linear pressures in the energy norm.
    assert!(errors[2] < 2e-3, "{errors:?}");
    assert!(errors.windows(2).all(|pair| pair[0] / pair[1] > 3.8), "{errors:?}");

    // The law is a spring. The response over time is then Terzaghi's series for the degree of
    // consolidation.
    let mesh = column(64);
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    let model = PoreModel::new(&mesh, &stiffness, 0.48).expect("hexahedra");
    let (drained, modulus, mobility) = (0.3, 2.0, 1e-7);
    let body = model.drained(drained).expect("below the undrained ratio");
    let law = CreepCompliance { instantaneous_per_pa: 1.0 / modulus, retarded: Vec::new(), fluidity_per_pa_s: 0.0 };
    let time_s: Vec<f64> = (0..60).map(|row| 0.5 * f64::from(row)).collect();
    let load = Load::commanded(&time_s, &vec![1e-6; time_s.len()]);
    let pores = CondensedPores::new(&body, mobility);
    let found = transient::run(&pores, &[law], &load, &time_s, &[], Resolution::default()).expect("a sound model");
    let [two_mu, kappa] = moduli(0.48, drained);
    let oedometer = kappa + 2.0 * two_mu / 3.0;
    let storage = 1.0 / (moduli(0.48, 0.48)[1] - kappa) + 1.0 / oedometer;
    let rate = mobility * modulus / storage * (0.5 * PI / COLUMN_LENGTH_M).powi(2);
    let exact: Vec<f64> = time_s
        .iter()
        .map(|&t| {
            if t == 0.0 {
                return 0.0;
            }
            let odd = (0..400).map(|m| f64::from(2 * m + 1));
            let left: f64 = odd.map(|m| 8.0 / (PI * m).powi(2) * (-m * m * rate * t).exp()).sum();
            let free = COLUMN_LENGTH_M / (2.0 * COLUMN_WIDTH_M.powi(2) * oedometer);
            1e-6 * QUARTER / modulus * free * (1.0 - left / (oedometer * storage))
        })
        .collect();
    let error = distance(&found.position_m, &exact);
    println!("Terzaghi in time: {error:e}");
    assert!(error < 2e-4, "{error:e}");
}

#[test]
fn the_limits_are_the_base_model_and_the_drained_sphere() {
    // The undrained limit differs from the base model's, because the discretisation is another. The
    // difference falls with the mesh size. The drained limit must equal that of the base model's
    // elements at ν_d.
    for ((n_per_edge, n_layers), undrained_limit, drained_limit) in [((2, 8), 1e-4, 2e-4), ((3, 12), 1e-5, 4e-5)] {
        let mesh = ball(OUTER_RADIUS_M, n_per_edge, n_layers);
        let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
        let model = PoreModel::new(&mesh, &stiffness, 0.48).expect("hexahedra");
        let base = FullOrderModel::new(&stiffness, 0.48).expect("positive definite").compliance_per_m();
        let exact_base = SphereInContainer::new(0.48, ROBOT_RADIUS_M, OUTER_RADIUS_M).stiffness_n_per_m(1.0);
        for drained in DRAINED {
            let body = model.drained(drained).expect("below the undrained ratio");
            let undrained = body.compliances_per_m(&[0.0]).expect("solved")[0];
            let modulus = (1.0 + drained) / 1.48;
            let exact = SphereInContainer::new(drained, ROBOT_RADIUS_M, OUTER_RADIUS_M).stiffness_n_per_m(modulus);
            let found =
                [undrained / base - 1.0, undrained * exact_base - 1.0, body.drained_compliance_per_m() * exact - 1.0];
            println!(
                "n = {n_per_edge}, ν_d = {drained}: undrained − base, − exact, drained − exact {found:.2?}: {found:?}"
            );
            assert!(found[0].abs() < undrained_limit && found[1].abs() < undrained_limit, "{found:?}");
            assert!(found[2].abs() < drained_limit, "{found:?}");
        }
    }
}

/// Relative increase of the compliance by drainage in an unbounded medium: c/(q² + 2q + 2), physics
/// §4.9.
fn unbounded(drained: f64, q: f64) -> f64 {
    (1.0 - 2.0 * drained) / (2.0 * (1.0 - drained)) / (q * q + 2.0 * q + 2.0)
}

/// Largest error of (Φ(τ) − Φ(0)) 6πμR over q. The difference cancels the undrained effect of the
/// wall. An effect of λ = 10⁻³ remains.
fn unbounded_error(ratio: f64, n_per_edge: usize, n_layers: usize) -> f64 {
    const UNDRAINED: f64 = 0.49999;
    let mesh = ball(ratio * ROBOT_RADIUS_M, n_per_edge, n_layers);
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    let model = PoreModel::new(&mesh, &stiffness, UNDRAINED).expect("hexahedra");
    let mut largest = 0.0_f64;
    for drained in DRAINED {
        let [two_mu, kappa] = moduli(UNDRAINED, drained);
        let ratios = [10.0, 3.0, 1.0, 0.3, 0.1];
        let area = |q: f64| (ROBOT_RADIUS_M / q).powi(2) / (kappa + 2.0 * two_mu / 3.0);
        let areas: Vec<f64> = [0.0].into_iter().chain(ratios.map(area)).collect();
        let found = model.drained(drained).expect("drained").compliances_per_m(&areas).expect("solved");
        let errors: Vec<f64> = ratios
            .iter()
            .zip(&found[1..])
            .map(|(&q, phi)| (phi - found[0]) * 3.0 * PI * two_mu * ROBOT_RADIUS_M - unbounded(drained, q))
            .collect();
        println!("n = {n_per_edge}, ν_d = {drained}: {errors:?}");
        largest = errors.iter().fold(largest, |m, e| m.max(e.abs()));
    }
    largest
}

#[test]
#[ignore = "thorough"]
fn a_far_container_gives_the_unbounded_sphere() {
    // The last mesh has the angles of the model mesh, and its ratio of successive layers' radii.
    let errors =
        [(1, 10), (2, 20), (3, 23)].map(|(n_per_edge, n_layers)| unbounded_error(1000.0, n_per_edge, n_layers));
    println!("unbounded: {errors:?}");
    assert!(errors[1] < 7e-4 && errors[2] < 4e-4, "{errors:?}");
    assert!(errors[0] / errors[1] > 3.5, "{errors:?}");
    // The effect of the wall is small: a container at a third of the distance changes little.
    let nearer = unbounded_error(300.0, 2, 17);
    println!("wall at 300: {nearer:e}");
    assert!((nearer / errors[1] - 1.0).abs() < 0.1, "{nearer:e} {errors:?}");
}

fn build(model: &PoreModel, settings: &SpectrumSettings) -> PoreSpectrum {
    PoreSpectrum::build(model, settings).expect("a sound model")
}

#[test]
#[ignore = "thorough"]
fn the_spectrum_is_right_between_the_ratios_it_was_computed_at() {
    let mesh = ball(OUTER_RADIUS_M, 2, 8);
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    let model = PoreModel::new(&mesh, &stiffness, 0.48).expect("hexahedra");
    let spectrum = build(&model, &SpectrumSettings::default());
    assert!(spectrum.n_terms() <= 10, "{}", spectrum.n_terms());
    for drained in [0.0, 0.021, 0.11, 0.2, 0.34, 0.41, 0.45] {
        let error = spectrum.largest_error(&model, drained).expect("inside the range");
        println!("ν_d = {drained}: {error:e}");
        assert!(error < 5e-6, "{drained}: {error:e}");
        let indicated = spectrum.error_indicator + spectrum.interpolation_error;
        assert!(error < 5.0 * indicated, "{drained}: {error:e} against {indicated:e}");
        let terms = spectrum.terms(Dual::constant(drained)).expect("inside the range");
        assert!(terms.iter().all(|term| term.weight.value > 0.0 && term.area_m2.value > 0.0));
        assert!(terms.windows(2).all(|pair| pair[1].area_m2.value < pair[0].area_m2.value));
    }
    // Derivatives with respect to ν_d are compared with differences of full solutions, and of the
    // terms.
    let (ratio, step) = (0.27, 1e-3);
    let terms = spectrum.terms(Dual::variable(ratio)).expect("inside the range");
    let areas = [0.0, 1e-8, 1e-7, 1e-6];
    let at = |ratio: f64| model.drained(ratio).expect("drained").compliances_per_m(&areas).expect("solved");
    let (up, down) = (at(ratio + step), at(ratio - step));
    for (k, &area) in areas.iter().enumerate().skip(1) {
        let share = |w: Dual, a: Dual| w * area / (a + area);
        let found: f64 = terms.iter().map(|term| share(term.weight, term.area_m2).derivative).sum();
        let difference = (up[k] / up[0] - down[k] / down[0]) / (2.0 * step);
        assert!((found / difference - 1.0).abs() < 1e-3, "τ = {area}: {found} against {difference}");
    }
    for outside in [-0.01, 0.46] {
        match spectrum.terms(Dual::constant(outside)) {
            Err(Error::OutsideTrainedRange { parameter, value, lower, upper }) => {
                assert_eq!((parameter.as_str(), value, lower, upper), ("drained_poisson_ratio", outside, 0.0, 0.45));
            }
            other => panic!("{outside}: {other:?}"),
        }
    }
    let text = serde_json::to_string(&spectrum).expect("numbers");
    assert_eq!(serde_json::from_str::<PoreSpectrum>(&text).expect("the same"), spectrum);
    // Results on one thread and on three threads must be equal to the bit.
    let few = SpectrumSettings { n_ratios: 3, most_terms: 3, ..SpectrumSettings::default() };
    let by = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had");
        pool.install(|| serde_json::to_string(&build(&model, &few)).expect("numbers"))
    };
    assert_eq!(by(1), by(3));
}

/// Checks that the indicator shows the error if the terms are too few. It is a close lower bound of
/// the error.
#[test]
#[ignore = "thorough"]
fn the_indicator_tells_the_error() {
    let mesh = ball(OUTER_RADIUS_M, 2, 6);
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    for undrained in [0.48, 0.4999] {
        let model = PoreModel::new(&mesh, &stiffness, undrained).expect("hexahedra");
        for most_terms in [2, 4, 6] {
            // The errors are measured at the two Chebyshev points of the range, where nothing is
            // interpolated.
            let settings = SpectrumSettings { most_terms, n_ratios: 2, tolerance: 0.0, ..SpectrumSettings::default() };
            let spectrum = build(&model, &settings);
            assert_eq!(spectrum.n_terms(), most_terms);
            let half = 0.225 * 0.5_f64.sqrt();
            let errors =
                [0.225 - half, 0.225 + half].map(|ratio| spectrum.largest_error(&model, ratio).expect("solved"));
            let error = errors[0].max(errors[1]);
            let effectivity = spectrum.error_indicator / error;
            println!("ν = {undrained}, {most_terms} terms: error {error:e}, effectivity {effectivity}");
            assert!((0.5..1.01).contains(&effectivity), "{effectivity}");
        }
    }
}

#[test]
#[ignore = "thorough"]
fn the_reduced_creep_is_the_stepped_one() {
    let mesh = ball(OUTER_RADIUS_M, 2, 8);
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    let model = PoreModel::new(&mesh, &stiffness, 0.48).expect("hexahedra");
    let spectrum = build(&model, &SpectrumSettings::default());
    let ((time_s, force_n), (law, window)) = (record(), lethersich());
    let chain = [transient::to_chain(&law, window).expect("springs and dashpots")];
    let load = Load::commanded(&time_s, &force_n);
    let exact_at = |row: usize, creep: &dyn Fn(f64) -> f64| -> f64 {
        let before = |k: usize| if k == 0 { 0.0 } else { force_n[k - 1] };
        let steps = (0..row).filter(|&k| force_n[k] != before(k));
        steps.map(|k| (force_n[k] - before(k)) * creep(time_s[row] - time_s[k])).sum()
    };
    for (drained, mobilities) in [(0.07, [1e-10, 1e-8, 1e-6]), (0.39, [3e-10, 1e-8, 1e-7])] {
        let body = model.drained(drained).expect("below the undrained ratio");
        let undrained = body.compliances_per_m(&[0.0]).expect("solved")[0];
        let mut pores = CondensedPores::new(&body, 0.0);
        for mobility in mobilities {
            pores = pores.with_mobility(mobility);
            let stepped = transient::run(&pores, &chain, &load, &time_s, &[], Resolution::default()).expect("sound");
            let elements =
                spectrum.elements(&law, Dual::constant(mobility), Dual::constant(drained)).expect("inside the range");
            let creep = RetardationSpectrum::of_law(&elements, window).expect("springs and dashpots");
            let reduced: Vec<f64> =
                (0..time_s.len()).map(|row| undrained * exact_at(row, &|t| creep.creep_compliance_per_pa(t))).collect();
            let base: Vec<f64> =
                (0..time_s.len()).map(|row| undrained * exact_at(row, &|t| chain[0].bodies.at(t))).collect();
            let (error, effect) = (distance(&reduced, &stepped.position_m), distance(&base, &stepped.position_m));
            println!(
                "ν_d = {drained}, k = {mobility:e}: {error:e}, the effect {effect:e}, {} steps, {} factors",
                stepped.n_steps, stepped.n_factors
            );
            assert!(error < 3e-6, "{error:e}");
            assert!(effect > 1e-4, "{effect:e}");
        }
    }
    // Derivatives of the creep with respect to mobility and ν_d are compared with differences.
    let creep = |mobility: Dual, drained: Dual, time_s: f64| {
        let elements = spectrum.elements(&law, mobility, drained).expect("inside the range");
        let spectrum = RetardationSpectrum::of_law(&elements, window).expect("springs and dashpots");
        let modes = spectrum.modes.iter().map(|mode| -mode.compliance_per_pa * (-mode.rate_per_s * time_s).exp_m1());
        modes.fold(spectrum.fluidity_per_pa_s * time_s, |sum, mode| sum + mode)
    };
    let (k, nu) = (3e-8, 0.21);
    for time_s in [0.3, 3.0] {
        let value = |k: f64, nu: f64| creep(Dual::constant(k), Dual::constant(nu), time_s).value;
        let by_mobility = (value(k * 1.001, nu) - value(k * 0.999, nu)) / (0.002 * k);
        let by_ratio = (value(k, nu + 1e-4) - value(k, nu - 1e-4)) / 2e-4;
        let found = [
            creep(Dual::variable(k), Dual::constant(nu), time_s).derivative,
            creep(Dual::constant(k), Dual::variable(nu), time_s).derivative,
        ];
        assert!((found[0] / by_mobility - 1.0).abs() < 1e-5, "{found:?} {by_mobility}");
        assert!((found[1] / by_ratio - 1.0).abs() < 1e-5, "{found:?} {by_ratio}");
    }
    // The steps' error is negligible. The remaining error is that of the spectrum over time.
    let body = model.drained(0.07).expect("below the undrained ratio");
    let pores = CondensedPores::new(&body, 1e-8);
    let [coarse, fine] = [10, 20].map(|steps_per_doubling| {
        let resolution = Resolution { steps_per_doubling, ..Resolution::default() };
        transient::run(&pores, &chain, &load, &time_s, &[], resolution).expect("sound").position_m
    });
    println!("finer steps: {:e}", distance(&coarse, &fine));
    assert!(distance(&coarse, &fine) < 1e-6);
    let none = spectrum.elements(&law, Dual::ZERO, Dual::constant(0.2)).expect("no mobility");
    assert_eq!(none, law);
}

#[test]
fn other_shapes_and_tetrahedra() {
    let orientation = Orientation::Vertical;
    let spheroid =
        Spheroid { length_m: 1e-3, diameter_m: 0.25e-3, orientation, outer_radius_m: OUTER_RADIUS_M, level: 1 };
    let cylinder =
        Cylinder { length_m: 1e-3, diameter_m: 0.25e-3, orientation, outer_radius_m: OUTER_RADIUS_M, level: 1 };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/gmsh");
    let meshes = [
        ("spheroid", spheroid.mesh().expect("a mesh"), 1e-2),
        ("cylinder", cylinder.mesh().expect("a mesh"), 1e-2),
        ("tetrahedra", read_gmsh(path.join("quarter_sphere_tet10.msh"), 1e-3).expect("a mesh").mesh, 3e-2),
    ];
    for (name, mesh, limit) in meshes {
        let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
        let model = PoreModel::new(&mesh, &stiffness, 0.48).expect("quadratic elements");
        let spectrum = build(&model, &SpectrumSettings::default());
        let error = spectrum.largest_error(&model, 0.17).expect("inside the range");
        let base = FullOrderModel::new(&stiffness, 0.48).expect("positive definite").compliance_per_m();
        let undrained = spectrum.undrained_compliance_per_m / base - 1.0;
        println!(
            "{name}: {} terms, error {error:e}, indicated {:e} + {:e}",
            spectrum.n_terms(),
            spectrum.error_indicator,
            spectrum.interpolation_error
        );
        println!("{name}: undrained against the base {undrained:e}");
        assert!(error < 5e-5 && undrained.abs() < limit, "{name}: {error:e} {undrained:e}");
    }
    let linear = read_gmsh(path.join("quarter_sphere_tet4.msh"), 1e-3).expect("a mesh").mesh;
    let stiffness = Stiffness::new(&linear).expect("a sound mesh");
    assert!(PoreModel::new(&linear, &stiffness, 0.48).is_err_and(|e| e.to_string().contains("4-node")));
}

#[test]
fn ratios_out_of_order_are_refused() {
    let mesh = ball(3e-3, 1, 2);
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    let undrained = PoreModel::new(&mesh, &stiffness, 0.5).err().expect("refused").to_string();
    assert!(undrained.contains("the undrained Poisson ratio is 0.5\n"), "{undrained}");
    let model = PoreModel::new(&mesh, &stiffness, 0.4).expect("hexahedra");
    for (ratio, words) in [(0.4, "is 0.4 and the undrained one 0.4"), (f64::NAN, "is NaN and the undrained one 0.4")] {
        let drained = model.drained(ratio).err().expect("refused").to_string();
        assert!(drained.contains("the drained Poisson ratio") && drained.contains(words), "{drained}");
    }
    // The default settings cover ratios up to 0.45, which is above this undrained ratio.
    let spectrum = PoreSpectrum::build(&model, &SpectrumSettings::default()).expect_err("refused").to_string();
    assert!(
        spectrum.contains("undrained Poisson ratio 0.4\n") && spectrum.contains("ratios below the undrained one"),
        "{spectrum}"
    );
}
