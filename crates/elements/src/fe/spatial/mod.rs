//! Linear effects that change the displacement field itself (physics §5): two matrices on one set of unknowns, what the gel's law multiplies and what stands
//! beside it. Effects assemble them; here they are factorised and stepped.
//!
//! - Mass: K w + M z̈ = f, M the mass of the gel and of the robot.
//! - Friction: K w + D ż = f, where z holds a tangential slip g on the robot's surface beside the displacements and gᵀ D g = ∫ |g|² dA for unit β.
//! - A second law: K₁ w₁ + K₂ w₂ = f, the stiffness of some elements, or of springs, and of the rest.
//!
//! With G(s) the law's modulus all of them are f = (A a(s) + B b(s)) z with two symmetric matrices and scalars a, b: what the surrogate rests on.
//! The time stepping of [`crate::fe::transient`] needs the matrices alone, between the unknowns that both know.

mod condensed;
mod freedoms;
mod matrices;
mod run;
mod surroundings;
mod systems;

pub use freedoms::Freedoms;
pub use matrices::{SymmetricFactor, SymmetricMatrix, SymmetricSolver};
pub use run::{SpatialJob, SpatialRun};
pub use surroundings::{Sizes, Surroundings};
pub use systems::{SpatialSystem, Splitting, SteppedSystem, decades, element_matrices, stiffness};
