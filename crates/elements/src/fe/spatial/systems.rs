//! The two matrices of an effect on one set of unknowns: the gel's matrix and the effect's.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::surroundings::GelAndRobot;
use super::{DegreesOfFreedom, SymmetricFactor, SymmetricMatrix, SymmetricSolver};
use crate::fe::assembly::unit_moduli;
use crate::fe::element::TabulatedElement;
use crate::fe::ordering::nested_dissection;
use crate::fe::transient::{ChainPart, StageSolve, StageWeights, TransientSystem};
use crate::mesh::Mesh;
use base::error::Result;
use laws::rheology::{AdditionalTerm, Element};

/// The two matrices of one effect at one Poisson ratio.
#[derive(Debug)]
pub struct SpatialSystem {
    /// Displacements of the nodes as combinations of the unknowns.
    pub freedoms: DegreesOfFreedom,
    /// Matrix of the gel, which its law multiplies: the stiffness for unit Young's modulus, in m.
    pub gel: SymmetricMatrix,
    /// Matrix of the effect: a stiffness for unit modulus (m), a mass for unit density scale (kg),
    /// or a friction matrix for unit coefficient (m²).
    pub second: SymmetricMatrix,
    solver: SymmetricSolver,
    /// Elimination order of the unknowns.
    pub(super) order: Vec<usize>,
}

/// Parameters for splitting a system's response into terms.
#[derive(Debug, Clone, PartialEq)]
pub struct MatrixSplitting {
    /// Weight of the effect's matrix in the energy norm, relative to the gel's matrix: 0 or 1. At 0
    /// the terms of the response are w/(G + μ B), with the gel's modulus G, the effect's operator B
    /// and numbers w, μ. At 1 they are w/((1 − θ) G + θ B), with numbers w, θ.
    pub reference: f64,
    /// Weights of the effect's matrix, minus `reference`, at which the full-order model is solved
    /// for snapshots.
    pub snapshots: Vec<f64>,
    /// True if the effect's matrix is infinitely stiff at the effect's null. Fields that the matrix
    /// resists are then impossible.
    pub is_rigid_at_null: bool,
}

/// Returns values from `lowest` to `highest`, equally spaced in the logarithm, with `per_decade`
/// values per decade.
pub fn log_spaced(lowest: f64, highest: f64, per_decade: f64) -> Vec<f64> {
    let n = ((highest / lowest).log10() * per_decade).ceil() as usize;
    (0..=n).map(|k| lowest * (highest / lowest).powf(k as f64 / n as f64)).collect()
}

impl SpatialSystem {
    /// Prepares the factorisation of two matrices assembled on a mesh.
    ///
    /// # Errors
    /// Those of [`SymmetricSolver::new`].
    pub fn new(mesh: &Mesh, freedoms: DegreesOfFreedom, gel: SymmetricMatrix, second: SymmetricMatrix) -> Result<Self> {
        let n_nodes_per_element = mesh.element_kind.n_nodes();
        let node_order =
            nested_dissection(mesh.n_nodes(), &mesh.connectivity, n_nodes_per_element, &mesh.node_coordinates_m);
        Self::in_order(freedoms, gel, second, &node_order)
    }

    /// Prepares the factorisation, for a given elimination order of the nodes.
    ///
    /// # Errors
    /// Those of [`SymmetricSolver::new`].
    pub(in crate::fe) fn in_order(
        freedoms: DegreesOfFreedom,
        gel: SymmetricMatrix,
        second: SymmetricMatrix,
        node_order: &[usize],
    ) -> Result<Self> {
        let order = freedoms.elimination_order(node_order);
        Self::of_unknowns(freedoms, gel, second, order)
    }

    /// Prepares the factorisation, for a given elimination order of the unknowns.
    pub(super) fn of_unknowns(
        freedoms: DegreesOfFreedom,
        gel: SymmetricMatrix,
        second: SymmetricMatrix,
        order: Vec<usize>,
    ) -> Result<Self> {
        let solver = SymmetricSolver::new(&[&gel, &second], &order)?;
        Ok(Self { freedoms, gel, second, solver, order })
    }

    /// Number of unknowns.
    pub fn n_unknowns(&self) -> usize {
        self.freedoms.count()
    }

    /// Cholesky factor of the weighted sum of the gel's and the effect's matrix. The first weight
    /// is the gel's, the second the effect's.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] if the sum is not positive definite.
    pub fn factor(&self, weights: [f64; 2]) -> Result<SymmetricFactor<'_>> {
        self.solver.factor(&[&self.gel, &self.second], &weights)
    }

    /// Weighted sum of the gel's and the effect's matrix. The first weight is the gel's, the second
    /// the effect's.
    ///
    /// # Errors
    /// Those of [`SymmetricMatrix::from_triplets`].
    pub fn sum(&self, weights: [f64; 2]) -> Result<SymmetricMatrix> {
        SymmetricMatrix::sum(self.n_unknowns(), &[&self.gel, &self.second], &weights)
    }
}

/// Computes the matrices of selected elements in parallel, and returns them in the order of the
/// elements. `is_wanted` receives an element's nodes, `matrix` their coordinates (m).
///
/// # Errors
/// Those of `matrix`.
pub fn element_matrices<'a>(
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

/// Stiffness (m) of selected elements for unit Young's modulus. `is_wanted` receives an element's
/// nodes.
///
/// # Errors
/// [`base::Error::Numerical`] for inverted elements.
pub fn stiffness(
    surroundings: &GelAndRobot<'_>,
    mesh: &Mesh,
    freedoms: &DegreesOfFreedom,
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

/// Physical meaning of the second matrix, with the size of the effect.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Second {
    /// Stiffness, which a second law multiplies.
    Stiffness,
    /// Damping: resistance to velocities, in Pa·s/m.
    Damping(f64),
    /// Mass: resistance to accelerations, with its scale.
    Mass(f64),
}

/// A gel with an additional effect, as a system for time stepping.
pub struct SteppedSystem<'a> {
    system: &'a SpatialSystem,
    second: Second,
}

impl<'a> SteppedSystem<'a> {
    /// Builds the system, and its laws in the order of [`ChainPart::Stiffness`].
    pub fn new(system: &'a SpatialSystem, law: &[Element], beside: &AdditionalTerm) -> (Self, Vec<Vec<Element>>) {
        let (second, elements) = match beside {
            AdditionalTerm::Friction { compliance } => (Second::Damping(compliance.value.recip()), None),
            AdditionalTerm::Mass { scale } => (Second::Mass(scale.value), None),
            AdditionalTerm::Spring { compliance_per_pa } => {
                (Second::Stiffness, Some(vec![Element::Compliance { compliance_per_pa: *compliance_per_pa }]))
            }
            AdditionalTerm::Law(entry) => (Second::Stiffness, Some(entry.clone())),
        };
        (Self { system, second }, elements.into_iter().chain([law.to_vec()]).collect())
    }
}

impl TransientSystem for SteppedSystem<'_> {
    fn n_unknowns(&self) -> usize {
        self.system.freedoms.count()
    }
    fn n_laws(&self) -> usize {
        1 + usize::from(self.second == Second::Stiffness)
    }
    fn has_mass(&self) -> bool {
        matches!(self.second, Second::Mass(_))
    }
    fn factor(&self, weights: &StageWeights) -> Result<StageSolve<'_>> {
        let second = match self.second {
            Second::Stiffness => weights.stiffness[0],
            Second::Damping(scale) => scale * weights.damping_per_pa_s,
            Second::Mass(scale) => scale * weights.mass_per_pa_s2,
        };
        let factor = self.system.factor([weights.stiffness[self.n_laws() - 1], second])?;
        Ok(Box::new(move |right_hand_side: &mut [f64]| {
            factor.solve_in_place(right_hand_side);
            Ok(())
        }))
    }
    fn add_product(&self, part: ChainPart, x: &[f64], result: &mut [f64]) {
        let (gel, second) = (&self.system.gel, &self.system.second);
        let (matrix, scale) = match (part, self.second) {
            (ChainPart::Stiffness(0), Second::Stiffness) => (second, 1.0),
            (ChainPart::Stiffness(_), _) => (gel, 1.0),
            (ChainPart::Damping, Second::Damping(scale)) | (ChainPart::Mass, Second::Mass(scale)) => (second, scale),
            _ => return,
        };
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
