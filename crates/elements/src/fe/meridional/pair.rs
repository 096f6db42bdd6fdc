//! The two matrices of a linear effect around a sphere, for the time stepping of
//! [`crate::fe::spatial`]. They form a second full-order model, in the half meridian.
//!
//! This model shares the equations, the time stepping and the Cholesky kernels with the
//! three-dimensional model, but not mesh, elements, quadrature and unknowns. The displacement is
//! axisymmetric about the force. A node's first component is along the axis, the second across it.

use std::f64::consts::{FRAC_PI_2, PI};

use faer::Mat;
use faer::sparse::Triplet;
use nalgebra::DMatrix;

use super::basis::{gauss_legendre, lagrange};
use super::element::{Mode, ShapeTable};
use super::mesh::{Boundary, Cell, Mesh};
use super::solver::Skeleton;
use super::{Direction, Formulation};
use crate::fe::spatial::{DegreesOfFreedom, SpatialSystem, SymmetricMatrix};
use base::error::{Error, Result};

/// Polynomial order of the displacements. It gives relative errors of the stiffness below 10⁻⁸.
const ORDER: usize = 10;
/// Largest ratio of the radii of neighbouring layers.
const LAYER_RATIO: f64 = 2.0;
/// Number of quadrature points along an edge minus the polynomial order.
const EXTRA_POINTS: usize = 3;
/// Fraction of the body, and of the force on it, in the upper half.
const SHARE: f64 = 0.5;

/// Second matrix of an effect around a sphere. The first is the gel's stiffness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EffectMatrix {
    /// Stiffness (m), for unit Young's modulus, of the gel closer to the centre than this radius.
    /// The first matrix is then the stiffness of the gel outside this radius.
    GelWithin {
        /// Radius (m) that separates the second matrix's gel, inside, from the first matrix's gel.
        radius_m: f64,
    },
    /// Mass matrix of gel and body, in kg.
    Mass {
        /// Density of the gel, in kg/m³.
        gel_density_kg_m3: f64,
        /// Mass of the whole body, in kg.
        body_kg: f64,
    },
    /// Friction matrix ∫ g·g dA over the body's surface, in m². g is the gel's slip along that
    /// surface.
    Slip,
    /// Stiffness of springs on the outer surface, in m: ∫ u·u dA divided by the surface's radius,
    /// with the displacement u. The outer surface is free instead of fixed.
    OuterSprings,
}

/// Builds the gel's and the effect's matrices for a sphere at the centre of a larger sphere. Radii
/// are in m.
///
/// # Errors
/// [`Error::Numerical`] if the radii are not in ascending order, or if the Poisson ratio lies
/// outside (−1, ½).
pub fn build_effect_system(
    radius_m: f64,
    outer_radius_m: f64,
    poisson_ratio: f64,
    second: EffectMatrix,
) -> Result<SpatialSystem> {
    let between_m = match second {
        EffectMatrix::GelWithin { radius_m } => Some(radius_m),
        _ => None,
    };
    let corners_m: Vec<f64> = [Some(radius_m), between_m, Some(outer_radius_m)].into_iter().flatten().collect();
    if !(radius_m > 0.0 && corners_m.windows(2).all(|pair| pair[0] < pair[1]) && outer_radius_m.is_finite()) {
        return Err(Error::numerical(
            format!("no mesh fits between spheres of the radii {corners_m:?} m"),
            "give a sphere, and a pocket, that lie inside the vitreous",
        ));
    }
    let half = HalfMeridian::new(&corners_m, ORDER, LAYER_RATIO);
    let freedoms = half.freedoms(Some(second));
    let (mode, table) = (Mode::of(Direction::Axial), &half.table);
    let is_second = |cell: &Cell| between_m.is_some_and(|between_m| half.outer_radius_m(cell) < 1.001 * between_m);
    let stiffness = |cell: &Cell| {
        let stiffness = table.stiffness(&cell.map, &mode, poisson_ratio, Formulation::Mixed)?;
        let n = table.n_functions();
        // Component 0 of the table is the displacement across the axis.
        let entry = |row: usize, column: usize| stiffness[(row.max(column), row.min(column))];
        let place = |k: usize| [Some(n + k / 3), Some(k / 3), None][k % 3];
        let value = |i: usize, j: usize| place(i).zip(place(j)).map_or(0.0, |(i, j)| mode.circle * entry(i, j));
        Ok(DMatrix::from_fn(3 * n, 3 * n, value))
    };
    let gel = half.assembled(&freedoms, |cell| !is_second(cell), stiffness)?;
    let second = match second {
        EffectMatrix::GelWithin { .. } => half.assembled(&freedoms, is_second, stiffness)?,
        EffectMatrix::Mass { gel_density_kg_m3, body_kg } => {
            let mass = |cell: &Cell| {
                let products = table.products(&cell.map)?;
                Ok(isotropic(&products, mode.circle * gel_density_kg_m3))
            };
            let gel = half.assembled(&freedoms, |_| true, mass)?;
            let robot = freedoms.robot() as u32;
            let body = SymmetricMatrix::from_triplets(
                freedoms.count(),
                &[Triplet::new(robot, robot, freedoms.share() * body_kg)],
            )?;
            SymmetricMatrix::sum(freedoms.count(), &[&gel, &body], &[1.0, 1.0])?
        }
        EffectMatrix::Slip => half.on_surface(&freedoms, |boundary| boundary.body, true, 1.0)?,
        EffectMatrix::OuterSprings => {
            half.on_surface(&freedoms, |boundary| boundary.outer, false, 1.0 / outer_radius_m)?
        }
    };
    SpatialSystem::in_order(freedoms, gel, second, &half.order())
}

/// Matrix `factor` × `products` for each of the two components, without coupling between them.
fn isotropic(products: &Mat<f64>, factor: f64) -> DMatrix<f64> {
    let n = products.nrows();
    let value = |i: usize, j: usize| if i % 3 == j % 3 && i % 3 < 2 { factor * products[(i / 3, j / 3)] } else { 0.0 };
    DMatrix::from_fn(3 * n, 3 * n, value)
}

/// Cells between concentric spheres, from the axis to the equator, and their nodes.
pub(super) struct HalfMeridian {
    pub(super) mesh: Mesh,
    pub(super) table: ShapeTable,
    boundaries: Vec<Boundary>,
    /// Node of every shape function of each cell.
    pub(super) nodes: Vec<Vec<u32>>,
    /// Coordinates (r, z) of every node, in m.
    places_m: Vec<[f64; 2]>,
}

impl HalfMeridian {
    /// Builds layers of cells with displacements of a polynomial order. A layer ends at each of the
    /// radii (m). The outer radius of a layer is at most `layer_ratio` times its inner one.
    pub(super) fn new(radii_m: &[f64], order: usize, layer_ratio: f64) -> Self {
        let (mut mesh, table) = (Mesh::default(), ShapeTable::new(order));
        let mut layers_m = vec![radii_m[0]];
        for pair in radii_m.windows(2) {
            let n = ((pair[1] / pair[0]).ln() / layer_ratio.ln()).ceil().max(1.0) as usize;
            let radius =
                |k: usize| if k == n { pair[1] } else { pair[0] * (pair[1] / pair[0]).powf(k as f64 / n as f64) };
            layers_m.extend((1..=n).map(radius));
        }
        let mut inner = None;
        for (layer, radius_m) in layers_m.iter().enumerate() {
            let surface = Boundary { body: layer == 0, outer: layer + 1 == layers_m.len(), ..Boundary::INSIDE };
            let chain = mesh.arcs([0.0; 2], [*radius_m; 2], &[FRAC_PI_2, 0.0], surface);
            if let Some(inner) = inner.replace(chain.clone()) {
                mesh.rule(&inner, &chain);
            }
        }
        let skeleton = Skeleton::new(&mesh, order);
        let mut boundaries = skeleton.boundaries.clone();
        let mut nodes = Vec::with_capacity(mesh.cells.len());
        for cell in &mesh.cells {
            let mut node = |on_edge: Option<usize>| {
                on_edge.unwrap_or_else(|| {
                    boundaries.push(Boundary::INSIDE);
                    boundaries.len() - 1
                }) as u32
            };
            nodes.push(skeleton.nodes(cell).into_iter().map(&mut node).collect::<Vec<u32>>());
        }
        let mut places_m = vec![[0.0; 2]; boundaries.len()];
        for (cell, cell_nodes) in mesh.cells.iter().zip(&nodes) {
            for (k, node) in cell_nodes.iter().enumerate() {
                let n_line = table.nodes.len();
                places_m[*node as usize] = cell.map.at(table.nodes[k % n_line], table.nodes[k / n_line]).0;
            }
        }
        Self { mesh, table, boundaries, nodes, places_m }
    }

    fn outer_radius_m(&self, cell: &Cell) -> f64 {
        let [r, z] = self.mesh.points[cell.vertices[2]];
        r.hypot(z)
    }

    /// Numbers the unknowns of the half meridian. On the axis and on the equator, displacements
    /// across the axis are 0.
    pub(super) fn freedoms(&self, second: Option<EffectMatrix>) -> DegreesOfFreedom {
        let mut combinations: Vec<[Vec<(u32, f64)>; 3]> = vec![Default::default(); self.boundaries.len()];
        let mut count = 0;
        for (of_node, boundary) in combinations.iter_mut().zip(&self.boundaries) {
            if boundary.body || (boundary.outer && second != Some(EffectMatrix::OuterSprings)) {
                continue;
            }
            let is_free = [true, !(boundary.axis || boundary.equator)];
            for (component, _) in of_node.iter_mut().zip(is_free).filter(|(_, is_free)| *is_free) {
                component.push((count, 1.0));
                count += 1;
            }
        }
        let first_slip = count as usize;
        let on_body = || self.boundaries.iter().enumerate().filter(|(_, boundary)| boundary.body);
        if second == Some(EffectMatrix::Slip) {
            for (node, _) in on_body().filter(|(_, boundary)| !boundary.axis) {
                let [r, z] = self.places_m[node];
                let radius_m = r.hypot(z);
                // The slip is along the meridian, which is parallel to the axis at the equator.
                combinations[node][0].push((count, -r / radius_m));
                if z != 0.0 {
                    combinations[node][1].push((count, z / radius_m));
                }
                count += 1;
            }
        }
        let robot_nodes: Vec<usize> = on_body().map(|(node, _)| node).collect();
        DegreesOfFreedom::of_combinations(combinations, robot_nodes.into_iter(), [first_slip, count as usize], SHARE)
    }

    fn assembled(
        &self,
        freedoms: &DegreesOfFreedom,
        is_wanted: impl Fn(&Cell) -> bool,
        matrix: impl Fn(&Cell) -> Result<DMatrix<f64>>,
    ) -> Result<SymmetricMatrix> {
        let wanted = self.mesh.cells.iter().zip(&self.nodes).filter(|(cell, _)| is_wanted(cell));
        let of_cell = |(cell, nodes): (&Cell, &'_ Vec<u32>)| Ok((nodes.clone(), matrix(cell)?));
        let elements: Vec<(Vec<u32>, DMatrix<f64>)> = wanted.map(of_cell).collect::<Result<_>>()?;
        SymmetricMatrix::assemble(freedoms, elements.iter().map(|(nodes, matrix)| (nodes.as_slice(), matrix.clone())))
    }

    /// Returns the matrix of `factor` ∫ u·u dA over a surface, with the displacement u. With
    /// `of_slips`, u contains only the slips along the surface.
    fn on_surface(
        &self,
        freedoms: &DegreesOfFreedom,
        is_on: impl Fn(&Boundary) -> bool,
        of_slips: bool,
        factor: f64,
    ) -> Result<SymmetricMatrix> {
        let (n_line, mut triplets) = (self.table.nodes.len(), Vec::new());
        let points = gauss_legendre(ORDER + EXTRA_POINTS);
        for (cell, nodes) in self.mesh.cells.iter().zip(&self.nodes) {
            for (eta, edge) in [(-1.0, &nodes[..n_line]), (1.0, &nodes[nodes.len() - n_line..])] {
                if !edge.iter().all(|node| is_on(&self.boundaries[*node as usize])) {
                    continue;
                }
                for (xi, weight) in &points {
                    let ([r, _], along, _) = cell.map.at(*xi, eta);
                    let length = along[0].hypot(along[1]);
                    let area_m2 = 2.0 * PI * r * length * weight;
                    let [across, axial] = along.map(|d| d / length);
                    // Displacement at this point per unit of each unknown: along the axis, and
                    // across it.
                    let mut moves: Vec<(u32, [f64; 2])> = Vec::new();
                    for (node, (shape, _)) in edge.iter().zip(lagrange(&self.table.nodes, *xi)) {
                        for component in [0, 1] {
                            for (unknown, share) in freedoms.of(*node, component) {
                                if of_slips && !freedoms.is_slip(*unknown) {
                                    continue;
                                }
                                let mut by = [0.0; 2];
                                by[component] = share * shape;
                                if of_slips {
                                    let tangential = by[0] * axial + by[1] * across;
                                    by = [tangential * axial, tangential * across];
                                }
                                moves.push((*unknown, by));
                            }
                        }
                    }
                    for (i, a) in &moves {
                        for (j, b) in moves.iter().filter(|(j, _)| i <= j) {
                            triplets.push(Triplet::new(*i, *j, factor * area_m2 * (a[0] * b[0] + a[1] * b[1])));
                        }
                    }
                }
            }
        }
        SymmetricMatrix::from_triplets(freedoms.count(), &triplets)
    }

    /// Returns the nodes in the order of elimination: from the outer surface inwards.
    pub(super) fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.places_m.len()).collect();
        let distance_m = |node: &usize| self.places_m[*node][0].hypot(self.places_m[*node][1]);
        order.sort_by(|a, b| distance_m(b).total_cmp(&distance_m(a)));
        order
    }
}
