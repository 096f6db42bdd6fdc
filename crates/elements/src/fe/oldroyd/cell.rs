//! One cell: deformation gradients, forces, tangent, and condensation of the cell's interior.

use std::f64::consts::PI;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};

use super::lu::DenseLu;
use super::point::{self, Gradient, IDENTITY, PointConstants};
use crate::fe::meridional::basis::{gauss_legendre, gauss_lobatto, lagrange, legendre};
use crate::fe::meridional::geometry::Ruled;
use base::error::Result;

/// Number of quadrature points per direction minus the polynomial order.
const EXTRA_POINTS: usize = 2;

/// Shape functions of one order at the quadrature points of the reference square, as products of
/// functions of one coordinate. The first coordinate ξ runs fastest.
pub(super) struct Reference {
    pub(super) order: usize,
    line: Vec<(f64, f64)>,
    /// Value of every function of one coordinate (running fastest) at every point of that
    /// coordinate.
    value: Vec<f64>,
    /// Slope of every function of one coordinate, in the order of `value`.
    slope: Vec<f64>,
    /// Values of the pressure functions (columns) at the points of the square (rows). Their total
    /// degree is at most order − 1. The first is constant.
    pressure: Mat<f64>,
}

impl Reference {
    pub fn new(order: usize) -> Self {
        let nodes = gauss_lobatto(order);
        let line = gauss_legendre(order + EXTRA_POINTS);
        let (value, slope) = line.iter().flat_map(|&(x, _)| lagrange(&nodes, x)).unzip();
        let degrees: Vec<_> = (0..order).flat_map(|i| (0..order - i).map(move |j| (i, j))).collect();
        let n = line.len();
        let pressure = Mat::from_fn(n * n, degrees.len(), |q, k| {
            legendre(degrees[k].0, line[q % n].0).0 * legendre(degrees[k].1, line[q / n].0).0
        });
        Self { order, line, value, slope, pressure }
    }

    /// Number of shape functions of one displacement component.
    pub(super) fn n_functions(&self) -> usize {
        (self.order + 1) * (self.order + 1)
    }

    pub(super) fn n_pressures(&self) -> usize {
        self.pressure.ncols()
    }

    /// Pressure at every quadrature point, for given amplitudes of the pressure functions.
    fn pressures_at(&self, amplitudes: &[f64]) -> Vec<f64> {
        let mut at = vec![0.0; self.pressure.nrows()];
        for (k, amplitude) in amplitudes.iter().enumerate() {
            at.iter_mut().zip(self.pressure.col_as_slice(k)).for_each(|(sum, value)| *sum += amplitude * value);
        }
        at
    }
}

/// Returns the product of two matrices.
fn product(left: MatRef<'_, f64>, right: MatRef<'_, f64>) -> Mat<f64> {
    let mut found = Mat::zeros(left.nrows(), right.ncols());
    matmul(found.as_mut(), Accum::Replace, left, right, 1.0, Par::Seq);
    found
}

fn column(values: &[f64]) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(values, values.len(), 1)
}

/// Components of the deformation gradient that displacements along r (first list) and along z
/// (second list) change. Each list follows the order of the operators ∂/∂r, ∂/∂z and 1/r.
const OF: [&[usize]; 2] = [&[0, 1, 4], &[2, 3]];

/// Geometry of one cell of the undeformed mesh.
pub(super) struct CellShape {
    /// Volume of each quadrature point's ring: 2π r times the point's area.
    pub(super) weights: Vec<f64>,
    /// Derivatives ∂N/∂r, ∂N/∂z and values N/r of every shape function N. Columns are functions;
    /// rows are points, one operator below the other.
    operators: Mat<f64>,
}

impl CellShape {
    pub fn new(reference: &Reference, map: &Ruled) -> Result<Self> {
        let (line, n_line, n_side) = (&reference.line, reference.line.len(), reference.order + 1);
        let (mut weights, mut factors, mut over_r) = (Vec::new(), Vec::new(), Vec::new());
        for &(eta, weight_eta) in line {
            for &(xi, weight_xi) in line {
                let (at, along, across, jacobian) = map.upright_at(xi, eta)?;
                weights.push(2.0 * PI * weight_xi * weight_eta * jacobian * at[0]);
                factors.push([across[1], -along[1], -across[0], along[0]].map(|x| x / jacobian));
                over_r.push(1.0 / at[0]);
            }
        }
        let n_points = n_line * n_line;
        let operators = Mat::from_fn(3 * n_points, n_side * n_side, |row, a| {
            let (operator, q) = (row / n_points, row % n_points);
            let (x, y) = ((q % n_line) * n_side + a % n_side, (q / n_line) * n_side + a / n_side);
            let (by_xi, by_eta) = (reference.slope[x] * reference.value[y], reference.value[x] * reference.slope[y]);
            match operator {
                0 => factors[q][0] * by_xi + factors[q][1] * by_eta,
                1 => factors[q][2] * by_xi + factors[q][3] * by_eta,
                _ => over_r[q] * reference.value[x] * reference.value[y],
            }
        });
        Ok(Self { weights, operators })
    }

    /// Deformation gradient at every quadrature point. `displacement` is ordered component by
    /// component, with ξ running fastest.
    pub(super) fn gradients(&self, displacement: &[f64]) -> Vec<Gradient> {
        let (n_points, n) = (self.weights.len(), self.operators.ncols());
        let mut found = vec![IDENTITY; n_points];
        let at = product(self.operators.as_ref(), MatRef::from_column_major_slice(displacement, n, OF.len()));
        for (component, components) in OF.iter().enumerate() {
            for (values, c) in at.col_as_slice(component).chunks_exact(n_points).zip(*components) {
                found.iter_mut().zip(values).for_each(|(f, value)| f[*c] += value);
            }
        }
        found
    }

    /// Forces on the displacements, component by component, followed by −∫ ψ (det F − 1) for every
    /// pressure function ψ, with the deformation gradient F. In a compressible gel the volume
    /// change due to the pressure is subtracted from det F − 1.
    pub(super) fn forces(
        &self,
        reference: &Reference,
        held: &[PointConstants],
        f: &[Gradient],
        pressures: &[f64],
    ) -> Vec<f64> {
        let pressure_at = reference.pressures_at(pressures);
        let n_points = f.len();
        let mut nominal = Mat::<f64>::zeros(self.operators.nrows(), OF.len());
        let mut volume = vec![0.0; n_points];
        for q in 0..n_points {
            let (stress, cofactor, weight) = (point::stress(&held[q], &f[q]), point::cofactor(&f[q]), self.weights[q]);
            for (component, components) in OF.iter().enumerate() {
                for (k, c) in components.iter().enumerate() {
                    nominal[(k * n_points + q, component)] = weight * (stress[*c] - pressure_at[q] * cofactor[*c]);
                }
            }
            let given = held[q].rest - held[q].law.volume_compliance_per_pa * pressure_at[q];
            volume[q] = -weight * (point::determinant(&f[q]) - 1.0 - given);
        }
        let forces = product(self.operators.transpose(), nominal.as_ref());
        let constraints = product(reference.pressure.transpose().subrows(0, pressures.len()), column(&volume));
        let mut out = Vec::with_capacity(2 * forces.nrows() + pressures.len());
        (0..OF.len()).for_each(|component| out.extend_from_slice(forces.col_as_slice(component)));
        out.extend_from_slice(constraints.col_as_slice(0));
        out
    }

    /// Derivatives of [`Self::forces`] with respect to displacements and pressures.
    pub(super) fn matrix(
        &self,
        reference: &Reference,
        held: &[PointConstants],
        f: &[Gradient],
        pressures: &[f64],
    ) -> Mat<f64> {
        let (n, n_points) = (reference.n_functions(), f.len());
        let pressure_at = reference.pressures_at(pressures);
        let tangents: Vec<_> = (0..n_points).map(|q| point::tangent(&held[q], &f[q], pressure_at[q])).collect();
        let cofactors: Vec<Gradient> = f.iter().map(point::cofactor).collect();
        let weighed = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
            self.weights.iter().enumerate().map(|(q, weight)| weight * of(q)).collect()
        };
        // The closure computes out[q] += factor[q] operator[q] for every point q.
        let add = |out: &mut [f64], factors: &[f64], operator: &[f64]| {
            out.iter_mut().zip(factors).zip(operator).for_each(|((out, factor), value)| *out += factor * value);
        };
        let mut matrix = Mat::zeros(2 * n + pressures.len(), 2 * n + pressures.len());
        for (column_component, columns) in OF.iter().enumerate() {
            for (row_component, rows) in OF.iter().enumerate() {
                let factors: Vec<Vec<Vec<f64>>> = rows
                    .iter()
                    .map(|row| columns.iter().map(|column| weighed(&|q| tangents[q][*row][*column])).collect())
                    .collect();
                let mut weighted = Mat::<f64>::zeros(rows.len() * n_points, n);
                for a in 0..n {
                    let (operators, out) = (self.operators.col_as_slice(a), weighted.col_as_slice_mut(a));
                    for (out, factors) in out.chunks_exact_mut(n_points).zip(&factors) {
                        factors.iter().zip(operators.chunks_exact(n_points)).for_each(|(f, o)| add(out, f, o));
                    }
                }
                let left = self.operators.as_ref().submatrix(0, 0, rows.len() * n_points, n);
                let block = matrix.as_mut().submatrix_mut(row_component * n, column_component * n, n, n);
                matmul(block, Accum::Replace, left.transpose(), weighted.as_ref(), 1.0, Par::Seq);
            }
            let factors: Vec<Vec<f64>> = columns.iter().map(|column| weighed(&|q| cofactors[q][*column])).collect();
            let mut volume = Mat::<f64>::zeros(n_points, n);
            for a in 0..n {
                let (operators, out) = (self.operators.col_as_slice(a), volume.col_as_slice_mut(a));
                factors.iter().zip(operators.chunks_exact(n_points)).for_each(|(f, o)| add(out, f, o));
            }
            let block = matrix.as_mut().submatrix_mut(2 * n, column_component * n, pressures.len(), n);
            matmul(block, Accum::Replace, reference.pressure.transpose(), volume.as_ref(), -1.0, Par::Seq);
        }
        for k in 2 * n..matrix.ncols() {
            for a in 0..2 * n {
                matrix[(a, k)] = matrix[(k, a)];
            }
        }
        let volume_compliance_per_pa = held.first().map_or(0.0, |held| held.law.volume_compliance_per_pa);
        if volume_compliance_per_pa > 0.0 {
            let values = &reference.pressure;
            let weighted = Mat::from_fn(n_points, pressures.len(), |q, k| self.weights[q] * values[(q, k)]);
            let block = matrix.as_mut().submatrix_mut(2 * n, 2 * n, pressures.len(), pressures.len());
            matmul(block, Accum::Replace, values.transpose(), weighted.as_ref(), -volume_compliance_per_pa, Par::Seq);
        }
        matrix
    }
}

/// A cell's matrix after elimination of the values in its interior.
pub(super) struct Condensed {
    /// LU factors of the matrix between the values in the interior.
    interior: DenseLu,
    edge_by_interior: Mat<f64>,
    interior_by_edge: Mat<f64>,
    /// Matrix between the values on the edges after elimination.
    pub(super) matrix: Mat<f64>,
}

impl Condensed {
    pub fn new(matrix: &Mat<f64>, interior: &[usize], edge: &[usize]) -> Self {
        let part = |rows: &[usize], columns: &[usize]| {
            let mut found = Mat::zeros(rows.len(), columns.len());
            for (b, column) in columns.iter().enumerate() {
                let (from, to) = (matrix.col_as_slice(*column), found.col_as_slice_mut(b));
                to.iter_mut().zip(rows).for_each(|(to, row)| *to = from[*row]);
            }
            found
        };
        let mut interior_by_edge = part(interior, edge);
        let (edge_by_interior, mut condensed) = (part(edge, interior), part(edge, edge));
        let interior = DenseLu::new(part(interior, interior));
        interior.solve(interior_by_edge.as_mut());
        let (left, right) = (edge_by_interior.as_ref(), interior_by_edge.as_ref());
        matmul(condensed.as_mut(), Accum::Add, left, right, -1.0, Par::Seq);
        Self { interior, edge_by_interior, interior_by_edge, matrix: condensed }
    }

    /// Eliminates the interior's forces. Multiplies `interior` by the inverse of the interior's
    /// matrix, and subtracts the resulting forces on the edges from `edge`.
    pub(super) fn reduce(&self, interior: &mut [f64], edge: &mut [f64]) {
        self.interior.solve_one(interior);
        subtract_product(&self.edge_by_interior, interior, edge);
    }

    /// Changes of the interior's values for given changes on the edges. `reduced` holds the
    /// interior's forces after [`Self::reduce`].
    pub(super) fn interior(&self, mut reduced: Vec<f64>, changes: &[f64]) -> Vec<f64> {
        reduced.iter_mut().for_each(|x| *x = -*x);
        subtract_product(&self.interior_by_edge, changes, &mut reduced);
        reduced
    }
}

/// Subtracts `matrix` · x from `to`.
fn subtract_product(matrix: &Mat<f64>, x: &[f64], to: &mut [f64]) {
    for (k, x) in x.iter().enumerate() {
        to.iter_mut().zip(matrix.col_as_slice(k)).for_each(|(to, value)| *to -= value * x);
    }
}
