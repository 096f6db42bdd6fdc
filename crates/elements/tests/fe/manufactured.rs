//! Test with a manufactured solution: a polynomial field with its body force on the quarter ball.
//! The result must converge at the element's order, without locking.

use std::collections::BTreeMap;
use std::ops::{Add, Mul};

use elements::fe::Stiffness;
use elements::fe::assembly::unit_moduli;
use elements::fe::element::TabulatedElement;
use elements::mesh::{Mesh, QuarterBall};
use nalgebra::{Matrix3, Vector3};

const ROBOT_RADIUS_M: f64 = 1.0;
const OUTER_RADIUS_M: f64 = 2.0;

/// A polynomial in x, y, z, stored as the coefficient of each triple of powers. Its derivatives are
/// exact.
#[derive(Clone)]
struct Polynomial(BTreeMap<[u8; 3], f64>);

fn monomial(coefficient: f64, powers: [u8; 3]) -> Polynomial {
    Polynomial(BTreeMap::from([(powers, coefficient)]))
}

impl Polynomial {
    fn derivative(&self, axis: usize) -> Self {
        let lower = |(powers, c): (&[u8; 3], &f64)| {
            let mut lowered = *powers;
            lowered[axis] = lowered[axis].checked_sub(1)?;
            Some((lowered, c * f64::from(powers[axis])))
        };
        Self(self.0.iter().filter_map(lower).collect())
    }

    fn at(&self, x: Vector3<f64>) -> f64 {
        let power = |(p, c): (&[u8; 3], &f64)| c * (0..3).map(|d| x[d].powi(i32::from(p[d]))).product::<f64>();
        self.0.iter().map(power).sum()
    }

    fn scaled(&self, factor: f64) -> Self {
        Self(self.0.iter().map(|(p, c)| (*p, factor * c)).collect())
    }
}

impl Add for &Polynomial {
    type Output = Polynomial;
    fn add(self, other: &Polynomial) -> Polynomial {
        let mut sum = self.0.clone();
        for (powers, c) in &other.0 {
            *sum.entry(*powers).or_insert(0.0) += c;
        }
        Polynomial(sum)
    }
}

impl Mul for &Polynomial {
    type Output = Polynomial;
    fn mul(self, other: &Polynomial) -> Polynomial {
        let mut product = BTreeMap::new();
        for (p, a) in &self.0 {
            for (q, b) in &other.0 {
                *product.entry(std::array::from_fn(|d| p[d] + q[d])).or_insert(0.0) += a * b;
            }
        }
        Polynomial(product)
    }
}

/// The exact displacement field, its gradient, and the body force −div σ (N/m³ at unit Young's
/// modulus).
struct Manufactured {
    displacement: [Polynomial; 3],
    gradient: [[Polynomial; 3]; 3],
    body_force: [Polynomial; 3],
}

impl Manufactured {
    /// Builds the field curl(s² A) + (1 − 2ν) s w, with s = (r² − R²)(R_o² − r²). It vanishes on
    /// both spheres and is symmetric about y = 0 and z = 0. The curl has no divergence. The
    /// divergence of the second term falls as the bulk modulus grows. The pressure therefore stays
    /// bounded as ν → ½, as in the gel.
    fn new(poisson_ratio: f64) -> Self {
        let r2 = [[2, 0, 0], [0, 2, 0], [0, 0, 2]]
            .map(|p| monomial(1.0, p))
            .into_iter()
            .reduce(|a, b| &a + &b)
            .expect("three terms");
        let inner = &r2 + &monomial(-ROBOT_RADIUS_M.powi(2), [0; 3]);
        let outer = &r2.scaled(-1.0) + &monomial(OUTER_RADIUS_M.powi(2), [0; 3]);
        let s = &inner * &outer;
        let potential = [
            monomial(0.4, [0, 1, 1]),
            &monomial(0.5, [0, 0, 1]) + &monomial(0.3, [1, 0, 1]),
            &monomial(-0.6, [0, 1, 0]) + &monomial(0.2, [2, 1, 0]),
        ]
        .map(|a| &(&s * &s) * &a);
        let shear =
            [&monomial(1.0, [0; 3]) + &monomial(0.5, [1, 0, 0]), monomial(-0.7, [0, 1, 0]), monomial(0.3, [1, 0, 1])];
        let displacement = std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let curl = &potential[k].derivative(j) + &potential[j].derivative(k).scaled(-1.0);
            &curl + &(&s * &shear[i]).scaled(1.0 - 2.0 * poisson_ratio)
        });
        let [two_mu, kappa] = unit_moduli(poisson_ratio);
        let (mu, lambda) = (0.5 * two_mu, kappa - two_mu / 3.0);
        let divergence = (0..3).map(|i| displacement[i].derivative(i)).reduce(|a, b| &a + &b).expect("three terms");
        let body_force = std::array::from_fn(|i| {
            let laplacian = (0..3)
                .map(|d| displacement[i].derivative(d).derivative(d))
                .reduce(|a, b| &a + &b)
                .expect("three terms");
            &laplacian.scaled(-mu) + &divergence.derivative(i).scaled(-(lambda + mu))
        });
        let gradient = std::array::from_fn(|i: usize| std::array::from_fn(|d| displacement[i].derivative(d)));
        Self { displacement, gradient, body_force }
    }

    fn displacement_at(&self, x: Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.displacement[i].at(x))
    }
}

/// Norms of the error, each divided by the norm of the field.
#[derive(Debug)]
struct Errors {
    displacement: f64,
    energy: f64,
    strain: f64,
}

/// Calls `visit` at every integration point with position (m), volume (m³), shape functions, their
/// gradients, and nodes.
fn for_each_point(mesh: &Mesh, mut visit: impl FnMut(Vector3<f64>, f64, &[f64], &[[f64; 3]], &[u32])) {
    let table = TabulatedElement::of(mesh.element_kind);
    for nodes in mesh.elements() {
        let coordinates: Vec<_> = nodes.iter().map(|&n| mesh.node_coordinates_m[n as usize]).collect();
        table
            .for_each_point(&coordinates, |point| {
                let x = point.shape.iter().zip(&coordinates).map(|(n, x)| Vector3::from(*x) * *n).sum();
                visit(x, point.volume_m3, point.shape, point.gradient, nodes);
            })
            .expect("no element is inverted");
    }
}

/// Finite-element displacement of every node (m) under the body force, with a fixed robot.
fn solve(mesh: &Mesh, exact: &Manufactured, poisson_ratio: f64) -> Vec<[f64; 3]> {
    let stiffness = Stiffness::new(mesh).expect("a sound mesh");
    let unknowns = &stiffness.assembly.unknowns;
    let factor = stiffness.factor(poisson_ratio).expect("positive definite");
    let mut field = vec![0.0; unknowns.count()];
    for_each_point(mesh, |x, volume, shape, _, nodes| {
        let force = Vector3::from_fn(|i, _| exact.body_force[i].at(x)) * volume;
        for (&node, n) in nodes.iter().zip(shape) {
            unknowns.add_nodal_force(node as usize, (force * *n).into(), &mut field);
        }
    });
    factor.solve_in_place(&mut field);
    // A force on the robot is added that makes its translation zero.
    let response = factor.unit_response();
    let robot = unknowns.robot();
    let holding = -field[robot] / response[robot];
    field.iter_mut().zip(&response).for_each(|(u, r)| *u += holding * r);
    unknowns.nodal_displacement(&field)
}

fn errors(n_per_edge: usize, n_layers: usize, poisson_ratio: f64) -> Errors {
    let ball = QuarterBall { robot_radius_m: ROBOT_RADIUS_M, outer_radius_m: OUTER_RADIUS_M, n_per_edge, n_layers };
    let mesh = ball.mesh().expect("the radii are in order");
    let exact = Manufactured::new(poisson_ratio);
    let nodal = solve(&mesh, &exact, poisson_ratio);
    let [two_mu, kappa] = unit_moduli(poisson_ratio);
    // Each entry is [error, field], for displacement, energy and strain.
    let mut squares = [[0.0; 2]; 3];
    for_each_point(&mesh, |x, volume, shape, gradients, nodes| {
        let (mut u, mut gradient) = (Vector3::zeros(), Matrix3::zeros());
        for ((&node, n), g) in nodes.iter().zip(shape).zip(gradients) {
            let value = Vector3::from(nodal[node as usize]);
            u += value * *n;
            gradient += value * Vector3::from(*g).transpose();
        }
        let exact_gradient = Matrix3::from_fn(|i, d| exact.gradient[i][d].at(x));
        for (k, (u, gradient)) in
            [(u - exact.displacement_at(x), gradient - exact_gradient), (exact.displacement_at(x), exact_gradient)]
                .into_iter()
                .enumerate()
        {
            let strain = (gradient + gradient.transpose()) * 0.5;
            let deviator = strain - Matrix3::identity() * (strain.trace() / 3.0);
            squares[0][k] += volume * u.norm_squared();
            squares[1][k] += volume * (two_mu * deviator.norm_squared() + kappa * strain.trace().powi(2));
            squares[2][k] += volume * strain.norm_squared();
        }
    });
    let [displacement, energy, strain] = squares.map(|[error, field]: [f64; 2]| (error / field).sqrt());
    Errors { displacement, energy, strain }
}

/// Errors on three meshes. Also returns the convergence orders between the last two meshes, in
/// displacement and energy.
fn converge(poisson_ratio: f64) -> ([Errors; 3], [f64; 2]) {
    // There are five layers per element around the robot, because the field changes faster along
    // the radius.
    let levels = [1, 2, 3].map(|n| errors(n, 5 * n, poisson_ratio));
    let slope = |norm: fn(&Errors) -> f64| (norm(&levels[1]) / norm(&levels[2])).ln() / 1.5_f64.ln();
    let slopes = [slope(|e| e.displacement), slope(|e| e.energy)];
    println!("ν = {poisson_ratio}: {levels:?}, slopes {slopes:?}");
    (levels, slopes)
}

/// Checks that quadratic displacements converge with order 3 in displacement and 2 in energy, also
/// for a nearly incompressible medium.
#[test]
fn converges_at_full_order_without_locking() {
    let (compressible, slopes) = converge(0.3);
    assert!(slopes[0] >= 2.7 && slopes[1] >= 1.8, "ν = 0.3: slopes {slopes:?}");
    let (incompressible, slopes) = converge(0.499);
    assert!(slopes[0] >= 2.7 && slopes[1] >= 1.8, "ν = 0.499: slopes {slopes:?}");
    for (a, b) in compressible.iter().zip(&incompressible) {
        assert!(b.displacement < 1.05 * a.displacement && b.strain < 1.05 * a.strain, "{a:?} against {b:?}");
    }
    let [_, _, finest] = compressible;
    assert!(finest.displacement < 5e-3 && finest.energy < 4e-2, "{finest:?}");
}
