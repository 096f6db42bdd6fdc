//! Linear effects that change the displacement field itself (physics §5). Each has two matrices on
//! one set of unknowns: the gel's matrix, multiplied by its law, and a matrix of the effect.
//! Effects assemble the matrices; this module factorises and steps them.
//!
//! - Mass: K w + M z̈ = f, with M the mass of the gel and of the robot.
//! - Friction: K w + D ż = f. Besides the displacements, z contains a tangential slip g on the
//!   robot's surface. gᵀ D g = ∫ |g|² dA for unit β.
//! - Second law: K₁ w₁ + K₂ w₂ = f. K₁ is the stiffness of the gel with the first law. K₂ is that
//!   of the other elements, or of springs.
//!
//! All of them have the form f = (A a(s) + B b(s)) z, with two symmetric matrices A, B and two
//! scalars a, b that depend on the law's modulus G(s). The surrogate uses this form. The time
//! stepping of [`crate::fe::transient`] needs only the matrices between the unknowns that occur in
//! both.

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
