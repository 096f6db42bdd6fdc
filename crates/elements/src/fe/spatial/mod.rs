//! Linear effects that change the shape of the displacement field (physics §5). Each effect has two
//! matrices on one set of unknowns z: the gel's stiffness K, which the gel's law multiplies, and a
//! matrix of the effect. Effects assemble the matrices; this module factorises them and steps them
//! in time. In the following equations f is the force and w the stress field.
//!
//! - Mass: K w + M z̈ = f, with M the mass of the gel and of the robot.
//! - Friction: K w + D ż = f. Besides the displacements, z contains a tangential slip on the
//!   robot's surface. D is the matrix of the integral of the squared slip over this surface.
//! - Second law: K₁ w₁ + K₂ w₂ = f. K₁ is the stiffness of the gel with the first law. K₂ is the
//!   stiffness of the elements, or springs, with the second law.
//!
//! All effects have the form f = (A a(s) + B b(s)) z, with two symmetric matrices A, B and two
//! scalars a, b that depend on the law's modulus at the Laplace variable s. The surrogate uses this
//! form. The time stepping of [`crate::fe::transient`] needs only the matrices between the unknowns
//! that occur in both matrices.

mod condensed;
mod freedoms;
mod matrices;
mod run;
mod surroundings;
mod systems;

pub use freedoms::DegreesOfFreedom;
pub use matrices::{SymmetricFactor, SymmetricMatrix, SymmetricSolver};
pub use run::{SpatialInput, SpatialResult};
pub use surroundings::{GelAndRobot, PhysicalProperties};
pub use systems::{MatrixSplitting, SpatialSystem, SteppedSystem, element_matrices, log_spaced, stiffness};
