//! One cell: gradients of displacements, forces, tangent, and its interior condensed.

use std::f64::consts::PI;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};

use super::lu::DenseLu;
use super::point::{self, Gradient, Held, IDENTITY};
use crate::error::Result;
use crate::fe::meridional::basis::{gauss_legendre, gauss_lobatto, lagrange, legendre};
use crate::fe::meridional::geometry::Ruled;

/// Quadrature points a direction beyond the order.
const EXTRA_POINTS: usize = 2;

/// Functions of one order at the quadrature points of the reference square, which is a product of lines: ξ runs fastest.
pub(super) struct Reference {
    pub(super) order: usize,
    line: Vec<(f64, f64)>,
    /// Value and slope of every function of a line (fastest) at every point.
    value: Vec<f64>,
    slope: Vec<f64>,
    /// Pressures (columns) at the points of the square, of total degree order − 1; the first is constant.
    pressure: Mat<f64>,
}

impl Reference {
    pub(super) fn new(order: usize) -> Self {
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

    /// Functions of one component.
    pub(super) fn n_functions(&self) -> usize {
        (self.order + 1) * (self.order + 1)
    }

    pub(super) fn n_pressures(&self) -> usize {
        self.pressure.ncols()
    }

    /// Pressure at every point.
    fn pressures_at(&self, amplitudes: &[f64]) -> Vec<f64> {
        let mut at = vec![0.0; self.pressure.nrows()];
        for (k, amplitude) in amplitudes.iter().enumerate() {
            at.iter_mut().zip(self.pressure.col_as_slice(k)).for_each(|(sum, value)| *sum += amplitude * value);
        }
        at
    }
}

/// out[j, k] = Σᵢ table[j, i] in[k, i]: a line's table applied to the fast index, which becomes the slow one.
fn along(table: &[f64], n_in: usize, input: &[f64], out: &mut [f64]) {
    let n_rest = input.len() / n_in;
    for (row, out) in table.chunks_exact(n_in).zip(out.chunks_exact_mut(n_rest)) {
        for (values, out) in input.chunks_exact(n_in).zip(out) {
            *out = row.iter().zip(values).map(|(t, v)| t * v).sum();
        }
    }
}

/// The transpose: out[k, i] += Σⱼ table[j, i] in[j, k].
fn along_transposed(table: &[f64], n_out: usize, input: &[f64], out: &mut [f64]) {
    let n_rest = out.len() / n_out;
    for (row, input) in table.chunks_exact(n_out).zip(input.chunks_exact(n_rest)) {
        for (value, out) in input.iter().zip(out.chunks_exact_mut(n_out)) {
            out.iter_mut().zip(row).for_each(|(out, t)| *out += t * value);
        }
    }
}

/// A cell of the unmoved mesh.
pub(super) struct CellShape {
    /// 2π r times the area that each point stands for.
    pub(super) weights: Vec<f64>,
    /// By r and by z of ξ and of η at each point: [ξ by r, η by r, ξ by z, η by z].
    factors: Vec<[f64; 4]>,
    over_r: Vec<f64>,
    /// Derivatives by r, by z and values over r of every function (columns), one under the other.
    operators: Mat<f64>,
}

impl CellShape {
    pub(super) fn new(reference: &Reference, map: &Ruled) -> Result<Self> {
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
        Ok(Self { weights, factors, over_r, operators })
    }

    /// F at every point; displacements component by component, ξ running fastest.
    pub(super) fn gradients(&self, reference: &Reference, displacement: &[f64]) -> Vec<Gradient> {
        let (n_side, n_line, n) = (reference.order + 1, reference.line.len(), reference.n_functions());
        let mut found = vec![IDENTITY; self.weights.len()];
        let mut half = vec![0.0; n_line * n_side];
        let mut at = vec![0.0; n_line * n_line];
        let (value, slope) = (&reference.value, &reference.slope);
        for (component, u) in displacement.chunks_exact(n).take(2).enumerate() {
            // After both passes the slow index is η's point again.
            for (first, second, place) in [(slope, value, 0), (value, slope, 1), (value, value, 2)] {
                if place == 2 && component == 1 {
                    continue;
                }
                along(first, n_side, u, &mut half);
                along(second, n_side, &half, &mut at);
                for (q, value) in at.iter().enumerate() {
                    let (f, factors) = (&mut found[q], &self.factors[q]);
                    if place == 2 {
                        f[4] += value * self.over_r[q];
                    } else {
                        f[2 * component] += factors[place] * value;
                        f[2 * component + 1] += factors[2 + place] * value;
                    }
                }
            }
        }
        found
    }

    /// Forces on the displacements, component by component, and −∫ ψ (det F − 1) for every pressure ψ, behind each other.
    pub(super) fn forces(&self, reference: &Reference, held: &[Held], f: &[Gradient], pressures: &[f64]) -> Vec<f64> {
        let (n_side, n_line, n) = (reference.order + 1, reference.line.len(), reference.n_functions());
        let pressure_at = reference.pressures_at(pressures);
        let n_points = f.len();
        let (mut nominal, mut volume) = (Vec::with_capacity(n_points), Vec::with_capacity(n_points));
        for q in 0..n_points {
            let (stress, cofactor) = (point::stress(&held[q], &f[q]), point::cofactor(&f[q]));
            let whole: Gradient = std::array::from_fn(|c| self.weights[q] * (stress[c] - pressure_at[q] * cofactor[c]));
            nominal.push(whole);
            volume.push(-self.weights[q] * (point::determinant(&f[q]) - 1.0));
        }
        let mut out = vec![0.0; 2 * n];
        let mut at = vec![0.0; n_line * n_line];
        let mut half = vec![0.0; n_line * n_side];
        let (value, slope) = (&reference.value, &reference.slope);
        for (component, out) in out.chunks_exact_mut(n).enumerate() {
            for (first, second, place) in [(slope, value, 0), (value, slope, 1), (value, value, 2)] {
                if place == 2 && component == 1 {
                    continue;
                }
                for (q, at) in at.iter_mut().enumerate() {
                    let (p, factors) = (&nominal[q], &self.factors[q]);
                    *at = if place == 2 {
                        self.over_r[q] * p[4]
                    } else {
                        factors[place] * p[2 * component] + factors[2 + place] * p[2 * component + 1]
                    };
                }
                half.fill(0.0);
                along_transposed(second, n_side, &at, &mut half);
                along_transposed(first, n_side, &half, out);
            }
        }
        let constraint = |k: usize| reference.pressure.col_as_slice(k).iter().zip(&volume).map(|(p, v)| p * v).sum();
        out.extend((0..pressures.len()).map(constraint).collect::<Vec<f64>>());
        out
    }

    /// Derivatives of [`Self::forces`] by displacements and pressures.
    pub(super) fn matrix(&self, reference: &Reference, held: &[Held], f: &[Gradient], pressures: &[f64]) -> Mat<f64> {
        let (n, n_points) = (reference.n_functions(), f.len());
        let pressure_at = reference.pressures_at(pressures);
        let tangents: Vec<_> = (0..n_points).map(|q| point::tangent(&held[q], &f[q], pressure_at[q])).collect();
        let cofactors: Vec<Gradient> = f.iter().map(point::cofactor).collect();
        let mut matrix = Mat::zeros(2 * n + pressures.len(), 2 * n + pressures.len());
        // Components of F in the order of their operators, for displacements along r and along z.
        const OF: [&[usize]; 2] = [&[0, 1, 4], &[2, 3]];
        for (column_component, columns) in OF.iter().enumerate() {
            for (row_component, rows) in OF.iter().enumerate() {
                let mut weighted = Mat::<f64>::zeros(rows.len() * n_points, n);
                for a in 0..n {
                    let (operators, out) = (self.operators.col_as_slice(a), weighted.col_as_slice_mut(a));
                    for (i, row) in rows.iter().enumerate() {
                        for q in 0..n_points {
                            let terms = columns.iter().enumerate();
                            let sum: f64 =
                                terms.map(|(j, column)| tangents[q][*row][*column] * operators[j * n_points + q]).sum();
                            out[i * n_points + q] = self.weights[q] * sum;
                        }
                    }
                }
                let left = self.operators.as_ref().submatrix(0, 0, rows.len() * n_points, n);
                let block = matrix.as_mut().submatrix_mut(row_component * n, column_component * n, n, n);
                matmul(block, Accum::Replace, left.transpose(), weighted.as_ref(), 1.0, Par::Seq);
            }
            let mut volume = Mat::<f64>::zeros(n_points, n);
            for a in 0..n {
                let (operators, out) = (self.operators.col_as_slice(a), volume.col_as_slice_mut(a));
                for q in 0..n_points {
                    let terms = columns.iter().enumerate();
                    let sum: f64 = terms.map(|(j, column)| cofactors[q][*column] * operators[j * n_points + q]).sum();
                    out[q] = self.weights[q] * sum;
                }
            }
            let block = matrix.as_mut().submatrix_mut(2 * n, column_component * n, pressures.len(), n);
            matmul(block, Accum::Replace, reference.pressure.transpose(), volume.as_ref(), -1.0, Par::Seq);
        }
        for k in 2 * n..matrix.ncols() {
            for a in 0..2 * n {
                matrix[(a, k)] = matrix[(k, a)];
            }
        }
        matrix
    }
}

/// A cell's matrix with its interior eliminated.
pub(super) struct Condensed {
    interior: DenseLu,
    interior_by_edge: Mat<f64>,
    edge_by_interior: Mat<f64>,
    /// Between what lies on the edges.
    pub(super) matrix: Mat<f64>,
}

impl Condensed {
    pub(super) fn new(matrix: &Mat<f64>, interior: &[usize], edge: &[usize]) -> Self {
        let part = |rows: &[usize], columns: &[usize]| {
            Mat::from_fn(rows.len(), columns.len(), |a, b| matrix[(rows[a], columns[b])])
        };
        let (interior_by_edge, edge_by_interior) = (part(interior, edge), part(edge, interior));
        let factor = DenseLu::new(part(interior, interior));
        let mut condensed = part(edge, edge);
        let mut solved = interior_by_edge.clone();
        factor.solve(solved.as_mut());
        matmul(condensed.as_mut(), Accum::Add, edge_by_interior.as_ref(), solved.as_ref(), -1.0, Par::Seq);
        Self { interior: factor, interior_by_edge, edge_by_interior, matrix: condensed }
    }

    /// What the interior's forces leave on the edges: those less K_EI K_II⁻¹ of the interior's.
    pub(super) fn reduce(&self, interior: &[f64], edge: &mut [f64]) {
        let mut solved = Mat::from_fn(interior.len(), 1, |a, _| interior[a]);
        self.interior.solve(solved.as_mut());
        for (a, value) in solved.col_as_slice(0).iter().enumerate() {
            edge.iter_mut().zip(self.edge_by_interior.col_as_slice(a)).for_each(|(r, k)| *r -= k * value);
        }
    }

    /// Changes of the interior where the edges change: K_II⁻¹ (−forces − K_IE changes).
    pub(super) fn interior(&self, forces: &[f64], changes: &[f64]) -> Vec<f64> {
        let mut right = Mat::from_fn(forces.len(), 1, |a, _| -forces[a]);
        for (b, change) in changes.iter().enumerate() {
            let entries = right.col_as_slice_mut(0).iter_mut();
            entries.zip(self.interior_by_edge.col_as_slice(b)).for_each(|(r, k)| *r -= k * change);
        }
        self.interior.solve(right.as_mut());
        right.col_as_slice(0).to_vec()
    }
}
