//! Stiffness of one cell for one Fourier mode in θ, at unit Young's modulus.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{self, LltRegularization};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, Mat, MatMut, MatRef, Par};

use super::basis::{gauss_legendre, gauss_lobatto, lagrange, legendre};
use super::geometry::Ruled;
use super::{Direction, Formulation};
use base::error::{Error, Result};

/// Operator that turns a displacement component into a strain: ∂/∂r, ∂/∂z or division by r.
#[derive(Debug, Clone, Copy)]
enum Operator {
    ByR,
    ByZ,
    OverR,
}
use Operator::{ByR, ByZ, OverR};

/// A term of a strain: index of the displacement component, operator, coefficient.
type Term = (usize, Operator, f64);

/// Kinematics of Fourier mode n: u_r = U cos nθ, u_θ = V sin nθ, u_z = W cos nθ.
///
/// The strains are ε_rr = U,r; ε_θθ = (U + nV)/r; ε_zz = W,z; γ_rz = U,z + W,r;
/// γ_rθ = V,r − (V + nU)/r; γ_θz = V,z − nW/r. Each is multiplied by cos nθ or sin nθ.
#[derive(Debug)]
pub(super) struct Mode {
    /// Number of displacement components: (U, W) for n = 0, (U, V, W) for n = 1.
    pub(super) n_components: usize,
    /// Integral of cos² nθ over the full circle, with the number n of the Fourier mode. For n = 1
    /// the integral of sin² nθ is equal.
    pub(super) circle: f64,
    /// Weight and terms of each strain, so that ε : ε = Σ weight × strain².
    strains: Vec<(f64, Vec<Term>)>,
    divergence: Vec<Term>,
}

impl Mode {
    pub fn of(direction: Direction) -> Self {
        let pi = std::f64::consts::PI;
        match direction {
            Direction::Axial => {
                let (u, w) = (0, 1);
                Self {
                    n_components: 2,
                    circle: 2.0 * pi,
                    strains: vec![
                        (1.0, vec![(u, ByR, 1.0)]),
                        (1.0, vec![(u, OverR, 1.0)]),
                        (1.0, vec![(w, ByZ, 1.0)]),
                        (0.5, vec![(u, ByZ, 1.0), (w, ByR, 1.0)]),
                    ],
                    divergence: vec![(u, ByR, 1.0), (u, OverR, 1.0), (w, ByZ, 1.0)],
                }
            }
            Direction::Transverse => {
                let (u, v, w) = (0, 1, 2);
                Self {
                    n_components: 3,
                    circle: pi,
                    strains: vec![
                        (1.0, vec![(u, ByR, 1.0)]),
                        (1.0, vec![(u, OverR, 1.0), (v, OverR, 1.0)]),
                        (1.0, vec![(w, ByZ, 1.0)]),
                        (0.5, vec![(u, ByZ, 1.0), (w, ByR, 1.0)]),
                        (0.5, vec![(v, ByR, 1.0), (v, OverR, -1.0), (u, OverR, -1.0)]),
                        (0.5, vec![(v, ByZ, 1.0), (w, OverR, -1.0)]),
                    ],
                    divergence: vec![(u, ByR, 1.0), (u, OverR, 1.0), (v, OverR, 1.0), (w, ByZ, 1.0)],
                }
            }
        }
    }
}

/// Number of quadrature points per direction minus the polynomial order. The integrands are not
/// polynomials, but the quadrature error is far below the discretisation error.
const EXTRA_POINTS: usize = 3;

/// Shape functions of one order, tabulated at the quadrature points of the reference square. Rows
/// are points, columns are functions.
pub(super) struct ShapeTable {
    /// Polynomial order of the displacements.
    pub(super) order: usize,
    /// The order + 1 Gauss–Lobatto nodes of one direction.
    pub(super) nodes: Vec<f64>,
    pub(super) points: Vec<([f64; 2], f64)>,
    by_xi: Mat<f64>,
    by_eta: Mat<f64>,
    value: Mat<f64>,
    pub(super) pressure: Mat<f64>,
}

impl ShapeTable {
    /// Tabulates the Lagrange functions of this order at the Gauss–Lobatto nodes. Functions are
    /// numbered with ξ running fastest.
    pub fn new(order: usize) -> Self {
        let nodes = gauss_lobatto(order);
        let line = gauss_legendre(order + EXTRA_POINTS);
        let along: Vec<_> = line.iter().map(|&(x, _)| lagrange(&nodes, x)).collect();
        let n_line = line.len();
        let tabulate = |f: &dyn Fn((f64, f64), (f64, f64)) -> f64| {
            Mat::from_fn(n_line * n_line, nodes.len() * nodes.len(), |q, a| {
                f(along[q % n_line][a % nodes.len()], along[q / n_line][a / nodes.len()])
            })
        };
        let points = (0..n_line * n_line)
            .map(|q| {
                let ((xi, w_xi), (eta, w_eta)) = (line[q % n_line], line[q / n_line]);
                ([xi, eta], w_xi * w_eta)
            })
            .collect::<Vec<_>>();
        let degrees: Vec<_> = (0..order).flat_map(|i| (0..order - i).map(move |j| (i, j))).collect();
        let pressure = Mat::from_fn(points.len(), degrees.len(), |q, k| {
            let ([xi, eta], _) = points[q];
            legendre(degrees[k].0, xi).0 * legendre(degrees[k].1, eta).0
        });
        Self {
            order,
            by_xi: tabulate(&|x, y| x.1 * y.0),
            by_eta: tabulate(&|x, y| x.0 * y.1),
            value: tabulate(&|x, y| x.0 * y.0),
            nodes,
            points,
            pressure,
        }
    }

    /// Number of functions of one displacement component.
    pub(super) fn n_functions(&self) -> usize {
        self.nodes.len() * self.nodes.len()
    }

    /// Returns the lower triangle of the cell's stiffness ∫ (2μ ε : ε + λ (Π div u)²) r dr dz for
    /// unit Young's modulus. ε is the strain of the displacement u, μ and λ are Lamé's moduli, and
    /// Π projects on the pressures. Rows and columns are ordered component by component.
    pub(super) fn stiffness(
        &self,
        map: &Ruled,
        mode: &Mode,
        poisson_ratio: f64,
        formulation: Formulation,
    ) -> Result<Mat<f64>> {
        let n = self.n_functions();
        let two_mu = 1.0 / (1.0 + poisson_ratio);
        let lambda = two_mu * poisson_ratio / (1.0 - 2.0 * poisson_ratio);
        let (operators, roots) = self.operators(map)?;
        let products = product_of_transpose(&operators, &operators);
        let mut stiffness = Mat::<f64>::zeros(mode.n_components * n, mode.n_components * n);
        for (weight, strain) in &mode.strains {
            add_square(&mut stiffness, n, &products, two_mu * weight, strain);
        }
        match formulation {
            Formulation::Displacement => add_square(&mut stiffness, n, &products, lambda, &mode.divergence),
            Formulation::Mixed => {
                let mut pressure = self.pressure.clone();
                for k in 0..pressure.ncols() {
                    pressure.col_as_slice_mut(k).iter_mut().zip(&roots).for_each(|(p, root)| *p *= root);
                }
                let mut divergence = Mat::<f64>::zeros(self.points.len(), mode.n_components * n);
                for &(component, operator, coefficient) in &mode.divergence {
                    for a in 0..n {
                        let values = operators.col_as_slice(operator as usize * n + a);
                        let sum = divergence.col_as_slice_mut(component * n + a);
                        sum.iter_mut().zip(values).for_each(|(s, v)| *s += coefficient * v);
                    }
                }
                // Let M = LLᵀ be the pressures' mass matrix. The volumetric part is then Bᵀ M⁻¹
                // B = (L⁻¹B)ᵀ (L⁻¹B).
                let mut mass = product_of_transpose(&pressure, &pressure);
                let mut projected = product_of_transpose(&pressure, &divergence);
                cholesky(mass.as_mut())?;
                solve_lower_triangular_in_place(mass.as_ref(), projected.as_mut(), Par::Seq);
                add_lower_gram(stiffness.as_mut(), projected.as_ref(), lambda);
            }
        }
        Ok(stiffness)
    }

    /// Returns the integral ∫ N r dr dz of every shape function N of one component.
    pub(super) fn integrals(&self, map: &Ruled) -> Result<Vec<f64>> {
        let (_, roots) = self.operators(map)?;
        let integral = |a: usize| roots.iter().zip(self.value.col_as_slice(a)).map(|(root, v)| root * root * v).sum();
        Ok((0..self.n_functions()).map(integral).collect())
    }

    /// Returns the integral ∫ N M r dr dz for every pair of shape functions N and M of one
    /// component.
    pub(super) fn products(&self, map: &Ruled) -> Result<Mat<f64>> {
        let (_, roots) = self.operators(map)?;
        let mut values = self.value.clone();
        for a in 0..values.ncols() {
            values.col_as_slice_mut(a).iter_mut().zip(&roots).for_each(|(v, root)| *v *= root);
        }
        Ok(product_of_transpose(&values, &values))
    }

    /// Returns ∂N/∂r, ∂N/∂z and N/r of every shape function N, multiplied by the square root of the
    /// point's weight. Rows are points. Columns are functions, one operator after the other. Also
    /// returns the square roots.
    pub(super) fn operators(&self, map: &Ruled) -> Result<(Mat<f64>, Vec<f64>)> {
        let n = self.n_functions();
        let (mut factors, mut roots) = (Vec::with_capacity(self.points.len()), Vec::with_capacity(self.points.len()));
        for &([xi, eta], weight) in &self.points {
            let (at, along, across, jacobian) = map.upright_at(xi, eta)?;
            let root = (weight * jacobian * at[0]).sqrt();
            roots.push(root);
            let by = root / jacobian;
            factors.push(([across[1] * by, -along[1] * by], [-across[0] * by, along[0] * by], root / at[0]));
        }
        let mut operators = Mat::<f64>::zeros(self.points.len(), 3 * n);
        for a in 0..n {
            let (by_xi, by_eta, value) =
                (self.by_xi.col_as_slice(a), self.by_eta.col_as_slice(a), self.value.col_as_slice(a));
            let derivative = |column: &mut [f64], factor: &dyn Fn(usize) -> [f64; 2]| {
                for (q, entry) in column.iter_mut().enumerate() {
                    let [to_xi, to_eta] = factor(q);
                    *entry = to_xi * by_xi[q] + to_eta * by_eta[q];
                }
            };
            derivative(operators.col_as_slice_mut(ByR as usize * n + a), &|q| factors[q].0);
            derivative(operators.col_as_slice_mut(ByZ as usize * n + a), &|q| factors[q].1);
            let over_r = operators.col_as_slice_mut(OverR as usize * n + a).iter_mut();
            over_r.zip(value).zip(&factors).for_each(|((entry, v), factor)| *entry = v * factor.2);
        }
        Ok((operators, roots))
    }
}

/// Adds the square of a strain, weight × (Σ terms)², to the lower triangle of the stiffness.
/// `products` holds the integrals of all pairs of operators.
fn add_square(stiffness: &mut Mat<f64>, n: usize, products: &Mat<f64>, weight: f64, terms: &[Term]) {
    for &(component_a, operator_a, coefficient_a) in terms {
        for &(component_b, operator_b, coefficient_b) in terms {
            if component_a < component_b {
                continue;
            }
            let coefficient = weight * coefficient_a * coefficient_b;
            for b in 0..n {
                let first = if component_a == component_b { b } else { 0 };
                let product = products.col_as_slice(operator_b as usize * n + b);
                let column = stiffness.col_as_slice_mut(component_b * n + b);
                let entries = &mut column[component_a * n + first..(component_a + 1) * n];
                let product = &product[operator_a as usize * n + first..];
                entries.iter_mut().zip(product).for_each(|(entry, p)| *entry += coefficient * p);
            }
        }
    }
}

/// Returns the product of the transposed matrix `a` and the matrix `b`.
fn product_of_transpose(a: &Mat<f64>, b: &Mat<f64>) -> Mat<f64> {
    let mut product = Mat::zeros(a.ncols(), b.ncols());
    faer::linalg::matmul::matmul(&mut product, Accum::Replace, a.transpose(), b, 1.0, Par::Seq);
    product
}

/// Adds `factor` times the product of the transposed matrix `a` and `a` to the lower triangle of
/// `to`.
pub(super) fn add_lower_gram(to: MatMut<f64>, a: MatRef<f64>, factor: f64) {
    triangular::matmul(
        to,
        BlockStructure::TriangularLower,
        Accum::Add,
        a.transpose(),
        BlockStructure::Rectangular,
        a,
        BlockStructure::Rectangular,
        factor,
        Par::Seq,
    );
}

/// Replaces the lower triangle of a matrix by its Cholesky factor.
pub(super) fn cholesky(matrix: MatMut<f64>) -> Result<()> {
    let mut memory =
        MemBuffer::new(factor::cholesky_in_place_scratch::<f64>(matrix.nrows(), Par::Seq, Default::default()));
    factor::cholesky_in_place(
        matrix,
        LltRegularization::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    )
    .map(|_| ())
    .map_err(|e| {
        Error::numerical(
            format!("a cell's matrix is not positive definite ({e:?})"),
            "use a Poisson ratio in (−1, 0.5) and a lower order",
        )
    })
}
