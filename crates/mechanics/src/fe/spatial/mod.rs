//! Effects that change the displacement field itself and stay linear (physics §5): the matrices beside the gel's stiffness, on one set of unknowns.
//!
//! - Inertia: K w + M z̈ = f, M the mass of the gel and of the robot.
//! - Slip: K w + D ż = f, where z holds a tangential slip g on the robot's surface beside the displacements and gᵀ D g = ∫ |g|² dA for unit β.
//! - Pocket: K₁ w₁ + K₂ w₂ = f, the stiffness of the elements inside a radius and outside of it.
//!
//! With G(s) the law's modulus all of them are f = (A a(s) + B b(s)) z with two symmetric matrices and scalars a, b: what the surrogate rests on.
//! The time stepping of [`crate::fe::transient`] needs the matrices alone.

mod freedoms;
mod matrices;
mod run;
mod systems;

pub use freedoms::Freedoms;
pub use matrices::{SymmetricFactor, SymmetricMatrix, SymmetricSolver};
pub use run::{Sizes, SpatialRun, Surroundings, run};
pub use systems::{Scaled, SpatialKind, SpatialSystem};
