//! Strains at all integration points from displacements, and nodal forces from stresses. The two
//! linear maps are transposes of each other.
//!
//! Tensors consist of the deviator's coordinates in an orthonormal basis and the trace. The trace
//! is projected on the element's pressure functions (physics §3.4). Stresses s are relative to unit
//! moduli: the stress tensor is 2μ̂ dev s + κ̂ tr s I. μ̂ and κ̂ are the shear and bulk modulus for
//! unit Young's modulus.

use super::point::Tensor;
use crate::fe::assembly::{Unknowns, unit_moduli};
use crate::fe::element::TabulatedElement;
use crate::mesh::Mesh;
use base::error::{Error, Result};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use nalgebra::{DMatrix, Matrix3};
use rayon::prelude::*;

/// Number of elements whose displacement gradients are stored at once.
const CHUNK: usize = 24;

/// Value that marks a fixed displacement component.
const FIXED: u32 = u32::MAX;

/// The integration points of a mesh at one Poisson ratio.
pub struct IntegrationPoints {
    /// Number of nodes per element.
    n_nodes: usize,
    /// Number of integration points per element.
    n_points: usize,
    /// Number of pressure functions per element.
    n_pressures: usize,
    /// Reference gradients of the shape functions. Row 3q + d belongs to point q and direction d;
    /// columns are nodes.
    gradient: Mat<f64>,
    /// Values of the pressure functions, point by point.
    pressure: Vec<f64>,
    /// Inverse Jacobian (1/m) at every point: derivatives of reference coordinates with respect to
    /// position.
    inverse_jacobian: Vec<[f64; 9]>,
    /// Quadrature weight times Jacobian determinant of every point, in m³.
    volume_m3: Vec<f64>,
    /// Inverse of each element's pressure mass matrix, stored row by row.
    inverse_pressure_mass: Vec<f64>,
    /// Index of the unknown of every component of every node of every element, or [`FIXED`].
    unknowns: Vec<u32>,
    n_unknowns: usize,
    /// Twice the shear modulus, and the bulk modulus, for unit Young's modulus.
    moduli: [f64; 2],
}

impl IntegrationPoints {
    /// Prepares the integration points of a mesh whose displacement unknowns are numbered by
    /// `unknowns`.
    pub fn new(mesh: &Mesh, unknowns: &Unknowns, poisson_ratio: f64) -> Result<Self> {
        let table = TabulatedElement::of(mesh.element_kind);
        let n_nodes = table.n_nodes;
        let points: Vec<_> = table.reference_points().collect();
        let (n_points, n_pressures) = (points.len(), points[0].1.len());
        let gradient = Mat::from_fn(3 * n_points, n_nodes, |row, node| points[row / 3].0[node][row % 3]);
        let pressure: Vec<f64> = points.iter().flat_map(|(_, pressure)| pressure.iter().copied()).collect();
        let mut inverse_jacobian = Vec::with_capacity(mesh.n_elements() * n_points);
        let mut volume_m3 = Vec::with_capacity(mesh.n_elements() * n_points);
        let mut inverse_pressure_mass = Vec::with_capacity(mesh.n_elements() * n_pressures * n_pressures);
        for nodes in mesh.elements() {
            let coordinates: Vec<_> = nodes.iter().map(|&n| mesh.node_coordinates_m[n as usize]).collect();
            let mut mass = DMatrix::<f64>::zeros(n_pressures, n_pressures);
            table.for_each_point(&coordinates, |point| {
                volume_m3.push(point.volume_m3);
                for (p, psi_p) in point.pressure.iter().enumerate() {
                    for (q, psi_q) in point.pressure.iter().enumerate() {
                        mass[(p, q)] += psi_p * psi_q * point.volume_m3;
                    }
                }
            })?;
            for jacobian in table.jacobians(&coordinates) {
                // The inverse exists: for an inverted element the visit above would have failed.
                let inverse = jacobian.try_inverse().unwrap_or_else(Matrix3::zeros);
                inverse_jacobian.push(std::array::from_fn(|k| inverse[(k / 3, k % 3)]));
            }
            let inverse = mass.try_inverse().ok_or_else(|| {
                Error::numerical(
                    "an element has a singular pressure mass matrix",
                    "untangle the mesh near that element",
                )
            })?;
            inverse_pressure_mass.extend(inverse.transpose().iter());
        }
        Ok(Self {
            n_nodes,
            n_points,
            n_pressures,
            gradient,
            pressure,
            inverse_jacobian,
            volume_m3,
            inverse_pressure_mass,
            unknowns: mesh.connectivity.iter().flat_map(|&node| unknowns.of_node(node)).collect(),
            n_unknowns: unknowns.count(),
            moduli: unit_moduli(poisson_ratio),
        })
    }

    /// Number of integration points in the mesh.
    pub(crate) fn count(&self) -> usize {
        self.volume_m3.len()
    }

    /// Volume that each integration point represents, in m³.
    pub fn volumes_m3(&self) -> &[f64] {
        &self.volume_m3
    }

    /// Factors from a stress relative to unit moduli to the stress: twice the shear modulus for the
    /// deviator's coordinates and the bulk modulus for the trace, at unit Young's modulus.
    pub fn unit_moduli(&self) -> Tensor<f64> {
        let [two_mu, kappa] = self.moduli;
        [two_mu, two_mu, two_mu, two_mu, two_mu, kappa]
    }

    /// Strains at every integration point for a displacement field (one value per unknown, m).
    pub fn strains(&self, displacement: &[f64]) -> Vec<Tensor<f64>> {
        let mut strains = vec![[0.0; 6]; self.count()];
        strains.par_chunks_mut(CHUNK * self.n_points).enumerate().for_each(|(chunk, strains)| {
            let n_elements = strains.len() / self.n_points;
            let first = chunk * CHUNK;
            let reference = self.reference_gradients(displacement, first, n_elements);
            for (e, strains) in strains.chunks_exact_mut(self.n_points).enumerate() {
                let derivative = self.derivatives(&reference, first, e);
                for (q, strain) in strains.iter_mut().enumerate() {
                    *strain = strain_tensor(|i, j| derivative(q, i, j));
                }
                self.project(first + e, strains);
            }
        });
        strains
    }

    /// Forces on the unknowns due to stresses (relative to unit moduli) at every integration point.
    /// They are in N if the stresses are in Pa.
    pub(crate) fn forces(&self, stresses: &[Tensor<f64>]) -> Vec<f64> {
        let chunks: Vec<Mat<f64>> = stresses
            .par_chunks(CHUNK * self.n_points)
            .enumerate()
            .map(|(chunk, stresses)| {
                let first = chunk * CHUNK;
                let [two_mu, kappa] = self.moduli;
                let mut projected = vec![[0.0; 6]; self.n_points];
                self.element_forces(first, stresses.len() / self.n_points, |e, conjugate| {
                    projected.copy_from_slice(&stresses[e * self.n_points..][..self.n_points]);
                    self.project(first + e, &mut projected);
                    let volumes = &self.volume_m3[(first + e) * self.n_points..];
                    for ((stress, volume), conjugate) in projected.iter().zip(volumes).zip(conjugate) {
                        *conjugate = stress_matrix(stress, two_mu * volume, kappa * volume);
                    }
                })
            })
            .collect();
        self.summed(&chunks)
    }

    fn summed(&self, chunks: &[Mat<f64>]) -> Vec<f64> {
        let mut force = vec![0.0; self.n_unknowns];
        let mut unknowns = self.unknowns.chunks_exact(3 * self.n_nodes);
        for chunk in chunks {
            for (e, unknowns) in (0..chunk.ncols() / 3).zip(&mut unknowns) {
                for i in 0..3 {
                    for (f, node) in chunk.col_as_slice(3 * e + i).iter().zip(unknowns.chunks_exact(3)) {
                        if node[i] != FIXED {
                            force[node[i] as usize] += f;
                        }
                    }
                }
            }
        }
        force
    }

    /// Returns the derivatives of the displacement with respect to reference coordinates, at the
    /// points of `n_elements` elements from element `first` on. Row 3q + d belongs to point q and
    /// coordinate d, column 3e + i to element `first` + e and component i.
    fn reference_gradients(&self, displacement: &[f64], first: usize, n_elements: usize) -> Mat<f64> {
        let nodal = self.gathered(displacement, first, n_elements);
        let mut reference = Mat::<f64>::zeros(3 * self.n_points, 3 * n_elements);
        matmul(reference.as_mut(), Accum::Replace, self.gradient.as_ref(), nodal.as_ref(), 1.0, Par::Seq);
        reference
    }

    /// Returns a function of (q, i, j) for element `first` + e: the derivative of displacement
    /// component i with respect to coordinate j at point q.
    fn derivatives<'a>(
        &'a self,
        reference: &'a Mat<f64>,
        first: usize,
        e: usize,
    ) -> impl Fn(usize, usize, usize) -> f64 + 'a {
        let columns = [0, 1, 2].map(|i| reference.col_as_slice(3 * e + i));
        let inverses = &self.inverse_jacobian[(first + e) * self.n_points..];
        move |q, i, j| {
            let (g, inverse) = (&columns[i][3 * q..3 * q + 3], &inverses[q]);
            g[0] * inverse[j] + g[1] * inverse[3 + j] + g[2] * inverse[6 + j]
        }
    }

    fn gathered(&self, displacement: &[f64], first: usize, n_elements: usize) -> Mat<f64> {
        let mut nodal = Mat::<f64>::zeros(self.n_nodes, 3 * n_elements);
        for e in 0..n_elements {
            let unknowns = &self.unknowns[(first + e) * 3 * self.n_nodes..][..3 * self.n_nodes];
            for i in 0..3 {
                for (value, node) in nodal.col_as_slice_mut(3 * e + i).iter_mut().zip(unknowns.chunks_exact(3)) {
                    *value = if node[i] == FIXED { 0.0 } else { displacement[node[i] as usize] };
                }
            }
        }
        nodal
    }

    /// Computes the nodal forces of `n_elements` elements, starting at element `first`. `fill`
    /// writes an element's stresses times volumes.
    fn element_forces(
        &self,
        first: usize,
        n_elements: usize,
        mut fill: impl FnMut(usize, &mut [[[f64; 3]; 3]]),
    ) -> Mat<f64> {
        let mut conjugate = Mat::<f64>::zeros(3 * self.n_points, 3 * n_elements);
        let mut stresses = vec![[[0.0; 3]; 3]; self.n_points];
        for e in 0..n_elements {
            fill(e, &mut stresses);
            let inverses = &self.inverse_jacobian[(first + e) * self.n_points..];
            for (q, sigma) in stresses.iter().enumerate() {
                for (i, sigma) in sigma.iter().enumerate() {
                    let column = &mut conjugate.col_as_slice_mut(3 * e + i)[3 * q..3 * q + 3];
                    for (d, value) in column.iter_mut().enumerate() {
                        let inverse = &inverses[q][3 * d..3 * d + 3];
                        *value = sigma[0] * inverse[0] + sigma[1] * inverse[1] + sigma[2] * inverse[2];
                    }
                }
            }
        }
        let mut force = Mat::<f64>::zeros(self.n_nodes, 3 * n_elements);
        matmul(force.as_mut(), Accum::Replace, self.gradient.transpose(), conjugate.as_ref(), 1.0, Par::Seq);
        force
    }

    /// Projects the traces at the points of an element on the element's pressures. Elements without
    /// pressures keep their traces.
    fn project(&self, element: usize, tensors: &mut [Tensor<f64>]) {
        let n = self.n_pressures;
        if n == 0 {
            return;
        }
        let volumes = &self.volume_m3[element * self.n_points..];
        let mut moments = [0.0; MOST_PRESSURES];
        for ((tensor, volume), pressure) in tensors.iter().zip(volumes).zip(self.pressure.chunks_exact(n)) {
            for (moment, psi) in moments.iter_mut().zip(pressure) {
                *moment += psi * volume * tensor[5];
            }
        }
        let inverse = &self.inverse_pressure_mass[element * n * n..][..n * n];
        let mut coefficients = [0.0; MOST_PRESSURES];
        for (coefficient, row) in coefficients.iter_mut().zip(inverse.chunks_exact(n)) {
            *coefficient = row.iter().zip(&moments).map(|(a, b)| a * b).sum();
        }
        for (tensor, pressure) in tensors.iter_mut().zip(self.pressure.chunks_exact(n)) {
            tensor[5] = pressure.iter().zip(&coefficients).map(|(psi, c)| psi * c).sum();
        }
    }
}

/// Largest number of pressures in an element. Today's elements have four or none.
const MOST_PRESSURES: usize = 4;

const R2: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// The constant 1/√6.
const R6: f64 = 0.408_248_290_463_863;

/// Strain tensor of a displacement gradient. `derivative`(i, j) is ∂uᵢ/∂xⱼ.
pub(crate) fn strain_tensor(derivative: impl Fn(usize, usize) -> f64) -> Tensor<f64> {
    let [xx, yy, zz] = [0, 1, 2].map(|i| derivative(i, i));
    let shear = |i, j| R2 * (derivative(i, j) + derivative(j, i));
    [R6 * (2.0 * xx - yy - zz), R2 * (yy - zz), shear(0, 1), shear(0, 2), shear(1, 2), xx + yy + zz]
}

/// Matrix Σ whose work on a displacement gradient, Σ : ∇u, is `deviatoric` dev s : dev ε +
/// `volumetric` tr s tr ε, with ε the strain.
pub(crate) fn stress_matrix(s: &Tensor<f64>, deviatoric: f64, volumetric: f64) -> [[f64; 3]; 3] {
    let pressure = volumetric * s[5];
    let (a, b) = (deviatoric * R6 * s[0], deviatoric * R2 * s[1]);
    let [xy, xz, yz] = [s[2], s[3], s[4]].map(|t| deviatoric * R2 * t);
    [[2.0 * a + pressure, xy, xz], [xy, b - a + pressure, yz], [xz, yz, -a - b + pressure]]
}
