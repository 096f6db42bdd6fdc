//! The matrices of each effect.

use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;

use super::run::Surroundings;
use super::{Freedoms, SymmetricMatrix, SymmetricSolver};
use crate::error::Result;
use crate::fe::assembly::unit_moduli;
use crate::fe::element::TabulatedElement;
use crate::fe::ordering::nested_dissection;
use crate::fe::surface::for_each_robot_point;
use crate::fe::transient::{Part, StageSolve, StageWeights, TransientSystem};
use crate::mesh::Mesh;

/// Which effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SpatialKind {
    /// Mass of gel and robot.
    Inertia,
    /// Slip along the robot's surface.
    Slip,
    /// A second law inside a radius (m) around the origin; elements lie inside or outside as their middles do.
    Pocket {
        /// Radius in m.
        radius_m: f64,
    },
}

/// The matrices of one effect at one Poisson ratio, for unit Young's modulus (m), unit density scale (kg) and unit friction (m²).
#[derive(Debug)]
pub struct SpatialSystem {
    /// The unknowns.
    pub freedoms: Freedoms,
    /// One for each law: the whole gel's, or the pocket's and the rest's.
    pub stiffness: Vec<SymmetricMatrix>,
    /// Of slip.
    pub damping: Option<SymmetricMatrix>,
    /// Of gel and robot.
    pub mass: Option<SymmetricMatrix>,
    solver: SymmetricSolver,
}

impl SpatialSystem {
    /// Assembles the matrices on the surroundings' mesh, or on another of the same gel.
    ///
    /// # Errors
    /// [`crate::Error::Numerical`] for inverted elements and for meshes without a robot.
    pub fn new(surroundings: &Surroundings<'_>, mesh: &Mesh, kind: SpatialKind) -> Result<Self> {
        let freedoms = match kind {
            SpatialKind::Slip => Freedoms::slipping(mesh)?,
            SpatialKind::Inertia | SpatialKind::Pocket { .. } => Freedoms::tied(mesh)?,
        };
        let stiffness = match kind {
            SpatialKind::Pocket { radius_m } => {
                let inside = |nodes: &[u32]| middle_distance_m(mesh, nodes) < radius_m;
                vec![
                    stiffness(surroundings, mesh, &freedoms, |nodes| inside(nodes))?,
                    stiffness(surroundings, mesh, &freedoms, |nodes| !inside(nodes))?,
                ]
            }
            SpatialKind::Inertia | SpatialKind::Slip => vec![stiffness(surroundings, mesh, &freedoms, |_| true)?],
        };
        let damping = if kind == SpatialKind::Slip { Some(friction(mesh, &freedoms)?) } else { None };
        let mass = if kind == SpatialKind::Inertia { Some(mass(surroundings, mesh, &freedoms)?) } else { None };
        let n_nodes_per_element = mesh.element_kind.n_nodes();
        let node_order =
            nested_dissection(mesh.n_nodes(), &mesh.connectivity, n_nodes_per_element, &mesh.node_coordinates_m);
        let matrices: Vec<&SymmetricMatrix> = stiffness.iter().chain(&damping).chain(&mass).collect();
        let solver = SymmetricSolver::new(&matrices, &freedoms.elimination_order(&node_order))?;
        Ok(Self { freedoms, stiffness, damping, mass, solver })
    }

    /// Number of unknowns.
    pub fn n_unknowns(&self) -> usize {
        self.freedoms.count()
    }

    /// All matrices: stiffness of each law, friction, mass.
    pub fn matrices(&self) -> Vec<&SymmetricMatrix> {
        self.stiffness.iter().chain(&self.damping).chain(&self.mass).collect()
    }

    /// Factor of Σ weight × matrix, in the order of [`Self::matrices`].
    ///
    /// # Errors
    /// [`crate::Error::Numerical`] where the sum is not positive definite.
    pub fn factor(&self, weights: &[f64]) -> Result<super::SymmetricFactor<'_>> {
        self.solver.factor(&self.matrices(), weights)
    }

    /// Σ weight × matrix, in the order of [`Self::matrices`].
    ///
    /// # Errors
    /// As [`SymmetricMatrix::from_triplets`].
    pub fn sum(&self, weights: &[f64]) -> Result<SymmetricMatrix> {
        SymmetricMatrix::sum(self.n_unknowns(), &self.matrices(), weights)
    }
}

fn middle_distance_m(mesh: &Mesh, nodes: &[u32]) -> f64 {
    let sum: Vector3<f64> = nodes.iter().map(|&n| Vector3::from(mesh.node_coordinates_m[n as usize])).sum();
    sum.norm() / nodes.len() as f64
}

/// Element matrices, computed in parallel, in the order of the elements.
fn element_matrices<'a>(
    mesh: &'a Mesh,
    is_wanted: impl Fn(&[u32]) -> bool,
    matrix: impl Fn(&[[f64; 3]]) -> Result<DMatrix<f64>> + Sync,
) -> Result<Vec<(&'a [u32], DMatrix<f64>)>> {
    let wanted: Vec<&[u32]> = mesh.elements().filter(|nodes| is_wanted(nodes)).collect();
    let of_element = |nodes: &&'a [u32]| {
        let coordinates_m: Vec<_> = nodes.iter().map(|&n| mesh.node_coordinates_m[n as usize]).collect();
        Ok((*nodes, matrix(&coordinates_m)?))
    };
    wanted.par_iter().map(of_element).collect()
}

fn stiffness(
    surroundings: &Surroundings<'_>,
    mesh: &Mesh,
    freedoms: &Freedoms,
    is_wanted: impl Fn(&[u32]) -> bool,
) -> Result<SymmetricMatrix> {
    let table = TabulatedElement::of(mesh.element_kind);
    let [two_mu, kappa] = unit_moduli(surroundings.poisson_ratio);
    let elements = element_matrices(mesh, is_wanted, |coordinates_m| {
        let parts = table.stiffness(coordinates_m)?;
        Ok(parts.deviatoric * two_mu + parts.volumetric * kappa)
    })?;
    SymmetricMatrix::assemble(freedoms, elements.into_iter())
}

/// ∫ ρ u·v over the gel, and the robot's mass.
fn mass(surroundings: &Surroundings<'_>, mesh: &Mesh, freedoms: &Freedoms) -> Result<SymmetricMatrix> {
    let table = TabulatedElement::of(mesh.element_kind);
    let n = table.n_nodes;
    let mut elements = element_matrices(
        mesh,
        |_| true,
        |coordinates_m| {
            let mut matrix = DMatrix::zeros(3 * n, 3 * n);
            table.for_each_point(coordinates_m, |point| {
                let weight = surroundings.sizes.gel_density_kg_m3 * point.volume_m3;
                for (a, shape_a) in point.shape.iter().enumerate() {
                    for (b, shape_b) in point.shape.iter().enumerate() {
                        let value = weight * shape_a * shape_b;
                        (0..3).for_each(|i| matrix[(3 * a + i, 3 * b + i)] += value);
                    }
                }
            })?;
            Ok(matrix)
        },
    )?;
    // On any one node of the robot's surface, whose translation all share.
    let mut of_robot = DMatrix::zeros(3, 3);
    of_robot[(0, 0)] = freedoms.share() * surroundings.sizes.robot_mass_kg;
    let robot_node = &mesh.robot_nodes[..1];
    elements.push((robot_node, of_robot));
    SymmetricMatrix::assemble(freedoms, elements.into_iter())
}

/// ∫ g·g over the robot's surface, g the tangential slip.
fn friction(mesh: &Mesh, freedoms: &Freedoms) -> Result<SymmetricMatrix> {
    let mut triplets = Vec::new();
    for_each_robot_point(mesh, |point| {
        let normal = Vector3::from(point.normal);
        // The slip that each unknown makes here, along the surface.
        let mut slips: Vec<(u32, Vector3<f64>)> = Vec::new();
        for (&node, &shape) in point.nodes.iter().zip(point.shape) {
            for i in 0..3 {
                for &(unknown, share) in freedoms.of(node, i).iter().filter(|(unknown, _)| freedoms.is_slip(*unknown)) {
                    let mut direction = Vector3::zeros();
                    direction[i] = share * shape;
                    match slips.iter_mut().find(|(other, _)| *other == unknown) {
                        Some((_, sum)) => *sum += direction,
                        None => slips.push((unknown, direction)),
                    }
                }
            }
        }
        for (_, slip) in &mut slips {
            *slip -= normal * normal.dot(slip);
        }
        for (i, a) in &slips {
            for (j, b) in slips.iter().filter(|(j, _)| i <= j) {
                triplets.push(faer::sparse::Triplet::new(*i, *j, point.area_m2 * a.dot(b)));
            }
        }
    });
    SymmetricMatrix::from_triplets(freedoms.count(), &triplets)
}

/// A system at one friction (Pa·s/m) and one density scale, ready to be stepped.
pub struct Scaled<'a> {
    /// The matrices.
    pub system: &'a SpatialSystem,
    /// β in Pa·s/m.
    pub friction_scale: f64,
    /// Density over the given one.
    pub density_scale: f64,
}

impl TransientSystem for Scaled<'_> {
    fn n_unknowns(&self) -> usize {
        self.system.freedoms.count()
    }
    fn n_laws(&self) -> usize {
        self.system.stiffness.len()
    }
    fn has_mass(&self) -> bool {
        self.system.mass.is_some()
    }
    fn factor(&self, weights: &StageWeights) -> Result<StageSolve<'_>> {
        let mut all = weights.stiffness.clone();
        all.extend(self.system.damping.iter().map(|_| self.friction_scale * weights.damping_per_pa_s));
        all.extend(self.system.mass.iter().map(|_| self.density_scale * weights.mass_per_pa_s2));
        let factor = self.system.factor(&all)?;
        Ok(Box::new(move |right_hand_side: &mut [f64]| {
            factor.solve_in_place(right_hand_side);
            Ok(())
        }))
    }
    fn add_product(&self, part: Part, x: &[f64], result: &mut [f64]) {
        let (matrix, scale) = match part {
            Part::Stiffness(law) => (self.system.stiffness.get(law), 1.0),
            Part::Damping => (self.system.damping.as_ref(), self.friction_scale),
            Part::Mass => (self.system.mass.as_ref(), self.density_scale),
        };
        let Some(matrix) = matrix else { return };
        let product = matrix.product(x);
        for (sum, value) in result.iter_mut().zip(product) {
            *sum += scale * value;
        }
    }
    fn add_load(&self, force_n: f64, right_hand_side: &mut [f64]) {
        right_hand_side[self.system.freedoms.robot()] += self.system.freedoms.share() * force_n;
    }
    fn position_m(&self, unknowns: &[f64]) -> f64 {
        unknowns[self.system.freedoms.robot()]
    }
}
