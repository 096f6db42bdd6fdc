//! Nonlinear laws around a sphere (physics §5), in the half meridian. The displacement is
//! axisymmetric about the force, so that a thousandth of the unknowns of a three-dimensional mesh
//! gives a smaller error.
//!
//! This discretisation shares law, balance and time steps with [`NonlinearModel`], but not mesh,
//! elements, quadrature and unknowns.
//!
//! [`NonlinearModel`]: crate::fe::nonlinear::NonlinearModel

use faer::Mat;
use faer::sparse::linalg::cholesky::SymbolicCholesky;
use faer::sparse::{SparseColMatRef, Triplet};
use nalgebra::DMatrix;
use std::f64::consts::{FRAC_PI_2, PI};

use super::basis::lagrange;
use super::element::ShapeTable;
use super::mesh::Cell;
use super::pair::HalfMeridian;
use crate::fe::assembly::unit_moduli;
use crate::fe::factorisation::{analysed, factorised, solve_in_place};
use crate::fe::nonlinear::Discretisation;
use crate::fe::nonlinear::point::Tensor;
use crate::fe::nonlinear::points::strain_tensor;
use crate::fe::spatial::{DegreesOfFreedom, SymmetricMatrix};
use base::error::{Error, Result};

/// Polynomial order of the displacements.
const ORDER: usize = 6;
/// Order and largest ratio of radii for the training of surrogates: the shapes of fields suffice.
const COARSE: (usize, f64) = (4, 1.5);
/// Largest ratio of the radii of neighbouring layers. A gel that yields or thins strains most near
/// the robot.
const LAYER_RATIO: f64 = 1.6;
/// Places of the strains that an axisymmetric displacement has, in a [`Tensor`].
const STRAINS: [usize; 4] = [0, 1, 3, 5];

/// The gel between a robot that is a sphere, and a larger fixed sphere around it.
pub struct NonlinearBall {
    half: HalfMeridian,
    freedoms: DegreesOfFreedom,
    cells: Vec<CellMaps>,
    /// Twice the shear modulus, and the bulk modulus, for unit Young's modulus.
    moduli: [f64; 2],
    gel: SymmetricMatrix,
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
}

/// Linear maps of one cell.
struct CellMaps {
    /// Unknown of every function of each component, across the axis first; `None` for fixed ones.
    unknowns: Vec<Option<usize>>,
    /// Strains at the points: four rows per point in the order of [`STRAINS`], one column per
    /// function of each component. The trace is projected on the pressures.
    strains: Mat<f64>,
    /// Volume (m³) that each point represents in the half gel.
    volume_m3: Vec<f64>,
}

impl NonlinearBall {
    /// Prepares the gel between spheres of two radii (m), at a Poisson ratio in (−1, ½).
    ///
    /// # Errors
    /// [`Error::Numerical`] if the radii do not ascend or the Poisson ratio is out of range.
    pub fn new(radius_m: f64, outer_radius_m: f64, poisson_ratio: f64) -> Result<Self> {
        Self::refined(radius_m, outer_radius_m, poisson_ratio, ORDER, LAYER_RATIO)
    }

    /// Prepares the gel with fewer elements of lower order, which take a fraction of the time.
    ///
    /// # Errors
    /// Those of [`NonlinearBall::new`].
    pub fn coarse(radius_m: f64, outer_radius_m: f64, poisson_ratio: f64) -> Result<Self> {
        let (order, layer_ratio) = COARSE;
        Self::refined(radius_m, outer_radius_m, poisson_ratio, order, layer_ratio)
    }

    fn refined(radius_m: f64, outer_radius_m: f64, poisson_ratio: f64, order: usize, layer_ratio: f64) -> Result<Self> {
        let half = HalfMeridian::new(&[radius_m, outer_radius_m], order, layer_ratio);
        let freedoms = half.freedoms(None);
        let pairs = half.mesh.cells.iter().zip(&half.nodes);
        let cells: Vec<CellMaps> =
            pairs.map(|(cell, nodes)| CellMaps::new(&half.table, &freedoms, cell, nodes)).collect::<Result<_>>()?;
        let moduli = unit_moduli(poisson_ratio);
        let entries: Vec<_> = cells.iter().flat_map(|cell| cell.stiffness(moduli)).collect();
        let gel = SymmetricMatrix::from_triplets(freedoms.count(), &entries)?;
        let symbolic = analysed(gel.upper().symbolic(), &freedoms.elimination_order(&half.order()))?;
        let factor = factorised(&symbolic, gel.upper()).ok_or_else(|| {
            Error::numerical(
                format!("the stiffness at Poisson ratio {poisson_ratio} is not positive definite"),
                "give a Poisson ratio in (−1, 0.5)",
            )
        })?;
        Ok(Self { moduli, half, freedoms, cells, gel, symbolic, factor })
    }

    /// Displacement vectors (m) at points of the whole gel, for a field of unknowns. The points are
    /// in m, from the sphere's centre; the force is along the first coordinate.
    pub fn displacements_at(&self, field: &[f64], points_m: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let nodal = self.freedoms.nodal_displacement(field);
        let nodes = &self.half.table.nodes;
        let radius_m = |vertex: usize| self.half.mesh.points[vertex].iter().fold(0.0_f64, |r, x| r.hypot(*x));
        let layers: Vec<[f64; 2]> =
            self.half.mesh.cells.iter().map(|cell| [radius_m(cell.vertices[0]), radius_m(cell.vertices[2])]).collect();
        let at = |[along, y, z]: [f64; 3]| {
            let across = y.hypot(z);
            let distance = along.hypot(across);
            let layer = layers.iter().position(|[_, outer]| distance <= *outer).unwrap_or(layers.len() - 1);
            let [inner, outer] = layers[layer];
            let eta = (2.0 * (distance - inner) / (outer - inner) - 1.0).clamp(-1.0, 1.0);
            let xi = 1.0 - 4.0 / PI * along.abs().atan2(across).min(FRAC_PI_2);
            let [by_xi, by_eta] = [xi, eta].map(|x| lagrange(nodes, x));
            let mut found = [0.0; 2];
            for (k, node) in self.half.nodes[layer].iter().enumerate() {
                let shape = by_xi[k % nodes.len()].0 * by_eta[k / nodes.len()].0;
                found.iter_mut().zip(nodal[*node as usize]).for_each(|(sum, u)| *sum += shape * u);
            }
            // The motion across the axis is odd about the plane of symmetry.
            let outwards = if across > 0.0 { found[1] * along.signum() / across } else { 0.0 };
            [found[0], outwards * y, outwards * z]
        };
        points_m.iter().map(|point| at(*point)).collect()
    }
}

impl CellMaps {
    fn new(table: &ShapeTable, freedoms: &DegreesOfFreedom, cell: &Cell, nodes: &[u32]) -> Result<Self> {
        let (n, n_points) = (table.n_functions(), table.points.len());
        let (operators, roots) = table.operators(&cell.map)?;
        let volume_m3: Vec<f64> = roots.iter().map(|root| 2.0 * PI * root * root).collect();
        // Unknown of a function: component 0 of the degrees of freedom is along the axis.
        let unknown =
            |component: usize, node: u32| freedoms.of(node, component).first().map(|(unknown, _)| *unknown as usize);
        let unknowns = [1, 0].into_iter().flat_map(|component| nodes.iter().map(move |node| unknown(component, *node)));
        let mut strains = Mat::<f64>::zeros(4 * n_points, 2 * n);
        for function in 0..n {
            for (q, root) in roots.iter().enumerate() {
                let [by_r, by_z, over_r] = [0, 1, 2].map(|operator| operators[(q, operator * n + function)] / root);
                // Derivatives with respect to r, θ and z: across the axis, and along it.
                let across = [[by_r, 0.0, by_z], [0.0, over_r, 0.0], [0.0; 3]];
                let along = [[0.0; 3], [0.0; 3], [by_r, 0.0, by_z]];
                for (column, gradient) in [(function, across), (n + function, along)] {
                    let tensor = strain_tensor(|i, j| gradient[i][j]);
                    for (k, place) in STRAINS.iter().enumerate() {
                        strains[(4 * q + k, column)] = tensor[*place];
                    }
                }
            }
        }
        // The trace is replaced by its projection P (PᵀVP)⁻¹ PᵀV, with the pressures P and the volumes V.
        let pressure = DMatrix::from_fn(n_points, table.pressure.ncols(), |q, k| table.pressure[(q, k)]);
        let weighted = DMatrix::from_fn(n_points, pressure.ncols(), |q, k| volume_m3[q] * pressure[(q, k)]);
        let traces = DMatrix::from_fn(n_points, 2 * n, |q, column| strains[(4 * q + 3, column)]);
        let mass = pressure.tr_mul(&weighted).cholesky().ok_or_else(|| {
            Error::numerical("a cell has a singular pressure mass matrix", "give a sphere well inside the vitreous")
        })?;
        let projected = &pressure * mass.solve(&weighted.tr_mul(&traces));
        for column in 0..2 * n {
            for q in 0..n_points {
                strains[(4 * q + 3, column)] = projected[(q, column)];
            }
        }
        Ok(Self { unknowns: unknowns.collect(), strains, volume_m3 })
    }

    /// Stresses times volumes (N m, for stresses in Pa relative to unit moduli) that do work on the
    /// cell's strains.
    fn weights(&self, [two_mu, kappa]: [f64; 2]) -> impl Iterator<Item = f64> + '_ {
        self.volume_m3.iter().flat_map(move |volume| [two_mu, two_mu, two_mu, kappa].map(|modulus| modulus * volume))
    }

    /// Upper triangle of the stiffness (m) for unit Young's modulus, by unknowns.
    fn stiffness(&self, moduli: [f64; 2]) -> Vec<Triplet<u32, u32, f64>> {
        let mut weighted = self.strains.clone();
        for column in 0..weighted.ncols() {
            weighted.col_as_slice_mut(column).iter_mut().zip(self.weights(moduli)).for_each(|(b, weight)| *b *= weight);
        }
        let product = self.strains.transpose() * &weighted;
        let free =
            || self.unknowns.iter().enumerate().filter_map(|(column, unknown)| Some((column, (*unknown)? as u32)));
        // Functions on the robot share one unknown: both orders of a pair add to its entry.
        free()
            .flat_map(|(i, row)| {
                free().filter(move |(_, column)| row <= *column).map(move |(j, column)| (i, row, j, column))
            })
            .map(|(i, row, j, column)| Triplet::new(row, column, product[(i, j)]))
            .collect()
    }
}

impl Discretisation for NonlinearBall {
    fn n_points(&self) -> usize {
        self.cells.iter().map(|cell| cell.volume_m3.len()).sum()
    }

    fn n_unknowns(&self) -> usize {
        self.freedoms.count()
    }

    fn robot(&self) -> usize {
        self.freedoms.robot()
    }

    fn share(&self) -> f64 {
        self.freedoms.share()
    }

    fn strains(&self, displacement: &[f64]) -> Vec<Tensor<f64>> {
        let mut tensors = Vec::with_capacity(self.n_points());
        for cell in &self.cells {
            let mut strains = vec![0.0; cell.strains.nrows()];
            for (column, unknown) in cell.unknowns.iter().enumerate() {
                let Some(unknown) = unknown else { continue };
                let by = displacement[*unknown];
                strains.iter_mut().zip(cell.strains.col_as_slice(column)).for_each(|(sum, b)| *sum += by * b);
            }
            tensors.extend(strains.chunks_exact(STRAINS.len()).map(|of_point| {
                let mut tensor = [0.0; 6];
                STRAINS.iter().zip(of_point).for_each(|(place, strain)| tensor[*place] = *strain);
                tensor
            }));
        }
        tensors
    }

    fn forces(&self, stresses: &[Tensor<f64>]) -> Vec<f64> {
        let mut forces = vec![0.0; self.n_unknowns()];
        let mut stresses = stresses.iter();
        for cell in &self.cells {
            let of_cell =
                stresses.by_ref().take(cell.volume_m3.len()).flat_map(|stress| STRAINS.map(|place| stress[place]));
            let conjugate: Vec<f64> =
                of_cell.zip(cell.weights(self.moduli)).map(|(stress, weight)| stress * weight).collect();
            for (column, unknown) in cell.unknowns.iter().enumerate() {
                let Some(unknown) = unknown else { continue };
                let products = cell.strains.col_as_slice(column).iter().zip(&conjugate).map(|(b, s)| b * s);
                forces[*unknown] += products.sum::<f64>();
            }
        }
        forces
    }

    fn solve_unit_stiffness(&self, forces: &mut [f64]) {
        solve_in_place(&self.symbolic, &self.factor, forces);
    }

    fn unit_stiffness(&self) -> SparseColMatRef<'_, u32, f64> {
        self.gel.upper()
    }

    fn volumes_m3(&self) -> Vec<f64> {
        self.cells.iter().flat_map(|cell| cell.volume_m3.iter().copied()).collect()
    }

    fn unit_moduli(&self) -> Tensor<f64> {
        let [two_mu, kappa] = self.moduli;
        [two_mu, two_mu, two_mu, two_mu, two_mu, kappa]
    }
}

#[cfg(test)]
#[path = "nonlinear_tests.rs"]
mod tests;
