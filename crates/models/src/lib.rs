//! Physical effects, and the full-order and the reduced model of an experiment.
//!
//! A base law and its effects write themselves into [`laws::stages::Stages`] at a parameter point
//! ([`model::Model::stages`]). Two models read the stages: [`model::Response`] in closed form, and full finite elements by
//! time stepping.
//!
//! # Effects that change the displacement field
//!
//! [`effects::Effect::field`] gives their mathematics: two symmetric matrices with scalar factors
//! ([`effects::MatrixPair`]: mass, slip, pocket, wall), Biot's equations, or a nonlinear law. Full finite elements factorise
//! and step them (`elements::fe::{spatial, transient, poroelastic, nonlinear}`). For the reduced model, [`surrogate`]
//! projects the matrices on POD modes and splits them by their common eigenvectors into four to twelve terms. Each term is
//! the law in parallel with a dashpot, a mass or another law (`laws::rheology::Beside`).
//! [`model::Compliance::resolve`] writes the terms into the stages. The kernels of other laws then compute the response.
//!
//! Reduced models of nonlinear laws ([`surrogate::hyper`]) have a few modes and integration points and are stepped in time.
//! [`model::Response`] adds their excess over a linear law to that law's closed form, so only the excess has errors. They
//! are trained in dimensionless numbers and depend on geometry and Poisson ratio alone. Where one record needs many
//! points, [`surrogate::trajectory`] learns trajectories over boxes of the parameters. It checks them at points that
//! were not used for training. A box's content depends on the box alone, not on the order or the threads of the queries.

pub mod effects;
pub mod model;
pub mod surrogate;

/// Hash of the code of all mechanics. Reduced models made by other code are not used.
pub const SOURCE_HASH: &str = env!("VITREO_UQ_MECHANICS");
