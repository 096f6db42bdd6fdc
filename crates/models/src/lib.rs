//! Library of physical effects, with the full-order and the reduced model of an experiment.
//!
//! At given parameters, a base law and its effects write their equations into [`laws::stages::Stages`]
//! ([`model::Model::stages`]). Two models compute the trajectory from the stages. [`model::Response`] uses closed forms, and the
//! full-order model steps finite elements in time.
//!
//! # Effects that change the displacement field
//!
//! [`effects::Effect::field`] returns the equations of such an effect. They are a linear combination of two symmetric matrices
//! ([`effects::MatrixPair`]: mass, slip, pocket, wall), Biot's equations, or a nonlinear law. The full-order model factorises the
//! matrices and steps the equations (`elements::fe::{spatial, transient, poroelastic, nonlinear}`). For the reduced model,
//! [`surrogate`] projects the matrices on modes of a proper orthogonal decomposition (POD). Their common eigenvectors then split the
//! response into four to twelve terms. Each term is the law in parallel with a dashpot, a mass or another law
//! (`laws::rheology::AdditionalTerm`). [`model::Compliance::resolve`] writes the terms into the stages. The kernels in [`model::Response`]
//! then compute the response as for any other law.
//!
//! Reduced models of nonlinear laws ([`surrogate::hyper`]) have a few modes and integration points and are stepped in time.
//! [`model::Response`] adds the excess of such a model over a linear law to the closed form of this law, so that only the excess has a
//! reduction error. The models are trained in dimensionless numbers, so they depend on geometry and Poisson ratio alone. If one record
//! needs trajectories at many parameter points, [`surrogate::trajectory`] interpolates them over boxes of the parameters. It
//! checks each box at points that were not used for training. The result in a box does not depend on the order of the queries or
//! on the number of threads.

pub mod effects;
pub mod model;
pub mod non_negative;
pub mod surrogate;

/// Hash of the source code of all mechanics. A cached reduced model is used only if its hash is equal.
pub const SOURCE_HASH: &str = env!("VITREO_UQ_MECHANICS");
