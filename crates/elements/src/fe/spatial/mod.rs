//! Linear effects that change the displacement field itself (physics §5). Each has two matrices on one set of unknowns: the gel's, multiplied by its law, and one of
//! the effect. Effects assemble the matrices; this module factorises and steps them.
//!
//! - Mass: K w + M z̈ = f, M the mass of the gel and of the robot.
//! - Friction: K w + D ż = f. Besides the displacements, z has a tangential slip g on the robot's surface, and gᵀ D g = ∫ |g|² dA for unit β.
//! - A second law: K₁ w₁ + K₂ w₂ = f, the stiffness of some elements, or of springs, and of the rest.
//!
//! All of them are f = (A a(s) + B b(s)) z for the law's modulus G(s), with two symmetric matrices and scalars a, b. The surrogate uses this form.
//! The time stepping of [`crate::fe::transient`] needs only the matrices, between the unknowns that both contain.

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
