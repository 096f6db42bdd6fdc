//! A second formulation of an Oldroyd-B fluid around a sphere, in the sphere's moving frame. It is
//! for tests only. The flow convects the conformation through a fixed mesh.
//!
//! This formulation shares no code with the elements. Velocities are divergence-free poloidal
//! fields, so that there is no pressure. They use Legendre functions in the angle and polynomials
//! in ln r, with the radius r. Conformations are values at collocation points. The explicit
//! Runge–Kutta method of order four steps the time.
//!
//! Let u = ∇×∇×(r g_n P_n), with a radial function g_n and the Legendre polynomial P_n of cos θ,
//! and N = n(n + 1). A dot is d/d ln r and a prime is d/dθ. The velocity is u_r = N g P/r and u_θ =
//! (g + ġ) P′/r. The components of r² ∂u/∂x, whose trace is 0, are
//!
//! - rr: N (ġ − g) P
//! - rθ: (N g − g − ġ) P′
//! - θr: (g̈ − g) P′
//! - θθ: (g + ġ) P″ + N g P
//!
//! The container is a sphere that moves with the inner one, instead of one at rest. The flow
//! through the mesh fades out towards the container and vanishes there. In a sufficiently large
//! container, neither difference has an effect.

use std::f64::consts::PI;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::fe::meridional::basis::{gauss_legendre, gauss_lobatto, lagrange, legendre};

/// Numbers of radial and angular functions, and the time step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cut {
    /// Number of polynomials in the radius's logarithm. There are [`MORE_NODES`] more radial nodes
    /// than polynomials.
    pub(super) n_radial: usize,
    /// Number of Legendre functions. There are 1.5 times as many angular points.
    pub(super) n_angular: usize,
    pub(super) step_s: f64,
}

/// Number of radial nodes minus number of radial polynomials.
const MORE_NODES: usize = 12;
/// Fraction of the container's ln r beyond which the flow through the mesh fades out, with the
/// radius r in sphere radii.
const FADING: f64 = 0.5;

/// An Oldroyd-B fluid around a sphere. The unit of length is the sphere's radius.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fluid {
    pub(super) solvent_pa_s: f64,
    pub(super) shear_modulus_pa: f64,
    pub(super) time_s: f64,
    /// Force divided by the square of the sphere's radius.
    pub(super) force_pa: f64,
}

type Field = DMatrix<f64>;

/// Radial functions (columns) at the radial nodes (rows): values, first and second derivatives with
/// respect to the radius's logarithm.
struct Radial([Field; 3]);

pub(super) struct Eulerian {
    fluid: Fluid,
    step_s: f64,
    radii: Vec<f64>,
    /// Fraction of the sphere's velocity with which the gel flows through the mesh, at every radial
    /// node.
    shares: Vec<f64>,
    /// Integration weight of every radial node: 2π r times the quadrature weight in ln r, with the
    /// radius r.
    weights: Vec<f64>,
    cosines: Vec<(f64, f64)>,
    /// Legendre polynomials P of cos θ, with P′, P″ and P′ cot θ; a prime is d/dθ. Rows are
    /// degrees, columns are angles θ.
    angular: [Field; 4],
    radial: Radial,
    /// Radial function of the sphere's own motion, with its first and second derivatives with
    /// respect to the radius's logarithm.
    rigid: [DVector<f64>; 3],
    factors: Vec<Cholesky<f64, Dyn>>,
    by_radius: Field,
    /// Matrix of the derivative with respect to cos θ. It is transposed, because fields are stored
    /// with angles along rows.
    by_cosine: Field,
}

/// Components rr, rθ, θθ and φφ of a conformation in spherical coordinates.
#[derive(Clone)]
struct Conformation([Field; 4]);

/// Values, first and second derivatives at x of the Legendre polynomials of degrees 0 to n.
fn legendres(n: usize, x: f64) -> Vec<[f64; 3]> {
    let mut all: Vec<[f64; 3]> = Vec::with_capacity(n + 1);
    for k in 0..=n {
        let (p, dp) = legendre(k, x);
        // The second derivatives follow from P″ₖ = P″ₖ₋₂ + (2k − 1) P′ₖ₋₁.
        let ddp = if k < 2 { 0.0 } else { all[k - 2][2] + (2.0 * k as f64 - 1.0) * all[k - 1][1] };
        all.push([p, dp, ddp]);
    }
    all
}

/// Radial functions whose values and slopes vanish at both ends (J. Shen, SIAM J. Sci. Comput.
/// 15:1489, 1994, doi:10.1137/0915089). Returns values, first and second derivatives at x.
fn clamped(n: usize, x: f64) -> Vec<[f64; 3]> {
    let p = legendres(n + 3, x);
    let function = |k: usize| {
        let by = 2.0 * k as f64;
        let (middle, last) = (2.0 * (by + 5.0) / (by + 7.0), (by + 3.0) / (by + 7.0));
        // The scale makes the second derivatives of all functions similar in size.
        let scale = 1.0 / ((by + 3.0) * (by + 5.0));
        std::array::from_fn(|d| scale * (p[k][d] - middle * p[k + 2][d] + last * p[k + 4][d]))
    };
    (0..n).map(function).collect()
}

impl Eulerian {
    pub fn new(fluid: Fluid, outer_radius: f64, cut: Cut) -> Self {
        let (span, order) = (outer_radius.ln(), cut.n_radial + MORE_NODES);
        let nodes = gauss_lobatto(order);
        let by_ln = 2.0 / span;
        let radii: Vec<f64> = nodes.iter().map(|xi| (0.5 * span * (1.0 + xi)).exp()).collect();
        let weight = |xi: f64| 2.0 / ((order * (order + 1)) as f64 * legendre(order, xi).0.powi(2)) / by_ln;
        let weights = nodes.iter().zip(&radii).map(|(xi, r)| 2.0 * PI * r * weight(*xi)).collect();
        let fading = |xi: &f64| {
            let t = ((0.5 * (1.0 + xi) - FADING) / (1.0 - FADING)).clamp(0.0, 1.0);
            1.0 - t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
        };
        let functions: Vec<_> = nodes.iter().map(|xi| clamped(cut.n_radial, *xi)).collect();
        let tabulated =
            |d: usize| Field::from_fn(nodes.len(), cut.n_radial, |i, k| by_ln.powi(d as i32) * functions[i][k][d]);
        // Cubic with value ½ and slope ½ at the sphere, and value 0 and slope 0 at the container.
        let rigid = |d: usize| {
            let (a, b) = (0.125, span / 16.0);
            let at = |x: f64| match d {
                0 => (1.0 - x).powi(2) * (a * (2.0 + x) + b * (1.0 + x)),
                1 => by_ln * (1.0 - x) * (a * (-3.0 - 3.0 * x) + b * (-1.0 - 3.0 * x)),
                _ => by_ln * by_ln * (a * 6.0 * x + b * (-2.0 + 6.0 * x)),
            };
            DVector::from_iterator(nodes.len(), nodes.iter().map(|x| at(*x)))
        };
        let cosines = gauss_legendre(cut.n_angular + cut.n_angular / 2);
        let polynomials: Vec<_> = cosines.iter().map(|(x, _)| legendres(cut.n_angular, *x)).collect();
        let at_angles = |of: &dyn Fn([f64; 3], f64) -> f64| {
            Field::from_fn(cut.n_angular, cosines.len(), |n, j| of(polynomials[j][n + 1], cosines[j].0))
        };
        let angular = [
            at_angles(&|[p, ..], _| p),
            at_angles(&|[_, dp, _], x| -(1.0 - x * x).sqrt() * dp),
            at_angles(&|[_, dp, ddp], x| (1.0 - x * x) * ddp - x * dp),
            at_angles(&|[_, dp, _], x| -x * dp),
        ];
        let slopes: Vec<_> = nodes.iter().map(|xi| lagrange(&nodes, *xi)).collect();
        let by_radius = Field::from_fn(nodes.len(), nodes.len(), |i, k| by_ln * slopes[i][k].1 / radii[i]);
        let places: Vec<f64> = cosines.iter().map(|(x, _)| *x).collect();
        let slopes: Vec<_> = places.iter().map(|x| lagrange(&places, *x)).collect();
        let by_cosine = Field::from_fn(places.len(), places.len(), |k, j| slopes[j][k].1);
        let mut found = Self {
            fluid,
            step_s: cut.step_s,
            shares: nodes.iter().map(fading).collect(),
            radii,
            weights,
            cosines,
            angular,
            radial: Radial([0, 1, 2].map(tabulated)),
            rigid: [0, 1, 2].map(rigid),
            factors: Vec::new(),
            by_radius,
            by_cosine,
        };
        found.factors = (0..cut.n_angular).map(|n| found.factor(n)).collect();
        found
    }

    /// Radial functions for Legendre degree n + 1, with first and second derivatives. For n = 0 the
    /// sphere's own motion comes first.
    fn functions(&self, n: usize) -> [Field; 3] {
        let first = usize::from(n == 0);
        let of = |d: usize, i: usize, k: usize| match k.checked_sub(first) {
            Some(k) => self.radial.0[d][(i, k)],
            None => self.rigid[d][i],
        };
        let [n_nodes, n_functions] = [self.radii.len(), self.radial.0[0].ncols() + first];
        [0, 1, 2].map(|d| Field::from_fn(n_nodes, n_functions, |i, k| of(d, i, k)))
    }

    /// Cholesky factor of the matrix of the solvent's dissipated power, for the radial functions of
    /// degree n + 1.
    fn factor(&self, n: usize) -> Cholesky<f64, Dyn> {
        let [g, g1, g2] = self.functions(n);
        let all = ((n + 1) * (n + 2)) as f64;
        let mean = |a: usize, b: usize| -> f64 {
            let product = |(j, (_, w)): (usize, &(f64, f64))| w * self.angular[a][(n, j)] * self.angular[b][(n, j)];
            self.cosines.iter().enumerate().map(product).sum()
        };
        let weights = DVector::from_fn(self.radii.len(), |i, _| self.weights[i] / self.radii[i].powi(2));
        let gram = |a: &Field, b: &Field| a.transpose() * Field::from_diagonal(&weights) * b;
        let (stretch, beta, gamma) = ((&g1 - &g) * all, &g + &g1, &g * all);
        let shear = &g * (all - 2.0) - &g1 + &g2;
        let mixed = gram(&beta, &gamma);
        let hoops = gram(&beta, &beta) * (mean(2, 2) + mean(3, 3))
            + (&mixed + mixed.transpose()) * (mean(2, 0) + mean(3, 0))
            + gram(&gamma, &gamma) * (2.0 * mean(0, 0));
        let matrix = gram(&stretch, &stretch) * mean(0, 0) + hoops + gram(&shear, &shear) * (0.5 * mean(1, 1));
        (matrix * (2.0 * self.fluid.solvent_pa_s)).cholesky().expect("the power of a motion is positive")
    }

    /// Computes the flow that balances the force and the polymer's stress. Returns the radial
    /// functions and their derivatives by node and degree, and the sphere's velocity in radii per
    /// second.
    fn flow(&self, polymer: &Conformation) -> ([Field; 3], f64) {
        let Conformation([rr, rt, tt, pp]) = polymer;
        let [p, p1, p2, cot] = &self.angular;
        let weights = DVector::from_iterator(self.cosines.len(), self.cosines.iter().map(|(_, w)| *w));
        let onto = |stress: &Field, functions: &Field| stress * Field::from_diagonal(&weights) * functions.transpose();
        let (of_rr, of_shear) = (onto(rr, p), onto(rt, p1));
        let (of_hoops, of_beta) = (onto(tt, p) + onto(pp, p), onto(tt, p2) + onto(pp, cot));
        let (n_nodes, n_degrees) = (self.radii.len(), p.nrows());
        let mut found = [0, 1, 2].map(|_| Field::zeros(n_nodes, n_degrees));
        let mut velocity = 0.0;
        for n in 0..n_degrees {
            let all = ((n + 1) * (n + 2)) as f64;
            let (radial, shear) = (of_rr.column(n) * all, of_shear.column(n));
            let by_g = of_beta.column(n) + of_hoops.column(n) * all - &radial + shear * (all - 2.0);
            let by_g1 = radial + of_beta.column(n) - shear;
            let weighed = |power: DVector<f64>| DVector::from_fn(n_nodes, |i, _| self.weights[i] * power[i]);
            let functions = self.functions(n);
            let powers = [by_g, by_g1, shear.into_owned()];
            let mut forces = DVector::zeros(functions[0].ncols());
            for (function, power) in functions.iter().zip(powers) {
                forces -= function.transpose() * weighed(power) * self.fluid.shear_modulus_pa;
            }
            if n == 0 {
                forces[0] += self.fluid.force_pa;
            }
            let amplitudes = self.factors[n].solve(&forces);
            if n == 0 {
                velocity = amplitudes[0];
            }
            for (found, function) in found.iter_mut().zip(&functions) {
                found.set_column(n, &(function * &amplitudes));
            }
        }
        (found, velocity)
    }

    /// Computes the rates (1/s) of `beyond`, the conformation's difference from rest, and the
    /// sphere's velocity in radii per second.
    fn rates(&self, beyond: &Conformation) -> (Conformation, f64) {
        let ([g, g1, g2], velocity) = self.flow(beyond);
        let [p, p1, _, cot] = &self.angular;
        let degrees = DVector::from_fn(p.nrows(), |n, _| ((n + 1) * (n + 2)) as f64);
        let all = Field::from_diagonal(&degrees);
        let (gamma, beta) = (&g * &all, &g + &g1);
        let (u, v) = (&gamma * p, &beta * p1);
        let stretch = (&g1 - &g) * &all * p;
        let hoop = &beta * cot + &gamma * p;
        let (shear_rt, shear_tr) = ((&gamma - &beta) * p1, (&g2 - &g) * p1);
        let [rr, rt, tt, pp] = &beyond.0;
        // rθ is sin θ times a polynomial of cos θ. Derivatives are therefore taken with respect to
        // cos θ.
        let sines: Vec<f64> = self.cosines.iter().map(|(x, _)| (1.0 - x * x).sqrt()).collect();
        let mut over_sine = rt.clone();
        over_sine.column_iter_mut().zip(&sines).for_each(|(mut column, sine)| column /= *sine);
        let by_cosine = [rr * &self.by_cosine, over_sine * &self.by_cosine, tt * &self.by_cosine, pp * &self.by_cosine];
        let by_radius = [rr, rt, tt, pp].map(|field| &self.by_radius * field);
        let mut rates = [0, 1, 2, 3].map(|_| Field::zeros(rr.nrows(), rr.ncols()));
        for (j, (x, _)) in self.cosines.iter().enumerate() {
            let sine = sines[j];
            for (i, r) in self.radii.iter().enumerate() {
                let at = (i, j);
                let through = self.shares[i] * velocity;
                let (along, around) = (u[at] / r - through * x, (v[at] / r + through * sine) / r);
                let over = 1.0 / (r * r);
                let (l_rr, l_pp, l_rt, l_tr) =
                    (stretch[at] * over, hoop[at] * over, shear_rt[at] * over, shear_tr[at] * over);
                let l_tt = -l_rr - l_pp;
                let (e_rr, e_rt, e_tt, e_pp) = (rr[at], rt[at], tt[at], pp[at]);
                let by_angle = [0, 2, 3].map(|k: usize| -sine * by_cosine[k][at]);
                let by_angle_rt = x * (e_rt / sine) - sine * sine * by_cosine[1][at];
                let carried = [
                    along * by_radius[0][at] + around * (by_angle[0] - 2.0 * e_rt),
                    along * by_radius[1][at] + around * (by_angle_rt + e_rr - e_tt),
                    along * by_radius[2][at] + around * (by_angle[1] + 2.0 * e_rt),
                    along * by_radius[3][at] + around * by_angle[2],
                ];
                let stretched = [
                    2.0 * (l_rr * (1.0 + e_rr) + l_rt * e_rt),
                    l_rr * e_rt + l_rt * (1.0 + e_tt) + (1.0 + e_rr) * l_tr + e_rt * l_tt,
                    2.0 * (l_tr * e_rt + l_tt * (1.0 + e_tt)),
                    2.0 * l_pp * (1.0 + e_pp),
                ];
                for (k, value) in [e_rr, e_rt, e_tt, e_pp].into_iter().enumerate() {
                    rates[k][at] = stretched[k] - carried[k] - value / self.fluid.time_s;
                }
            }
        }
        (Conformation(rates), velocity)
    }

    /// Position of the sphere in radii, after every `every` steps.
    pub(super) fn places(&self, n_steps: usize, every: usize) -> Vec<f64> {
        let nothing = || Field::zeros(self.radii.len(), self.cosines.len());
        let (mut beyond, mut place) = (Conformation([0, 1, 2, 3].map(|_| nothing())), 0.0);
        let moved = |from: &Conformation, by: f64, rates: &Conformation| {
            Conformation([0, 1, 2, 3].map(|k| &from.0[k] + &rates.0[k] * by))
        };
        let (h, mut places) = (self.step_s, vec![0.0]);
        for step in 1..=n_steps {
            let (a, at_a) = self.rates(&beyond);
            let (b, at_b) = self.rates(&moved(&beyond, 0.5 * h, &a));
            let (c, at_c) = self.rates(&moved(&beyond, 0.5 * h, &b));
            let (d, at_d) = self.rates(&moved(&beyond, h, &c));
            for (weight, rates) in [(1.0, &a), (2.0, &b), (2.0, &c), (1.0, &d)] {
                beyond = moved(&beyond, h * weight / 6.0, rates);
            }
            place += h / 6.0 * (at_a + 2.0 * at_b + 2.0 * at_c + at_d);
            if step % every == 0 {
                places.push(place);
            }
        }
        places
    }
}
