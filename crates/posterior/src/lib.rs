//! Bayesian inference for one experiment: priors, noise, likelihood, the prepared model and its posterior.
//!
//! [`problem::Problem`] joins a record with a law, effects, priors, noise and mechanics. [`prepared::PreparedModel`] adds the reduced model with its verified error. It
//! creates the posterior ([`prepared::PreparedModel::posterior`]) and the forward model. [`fit`] finds the point estimate, and [`sample`] samples the posterior.
//! [`full_check`] runs posterior draws in full finite elements. [`heldout`] compares these predictions with the held-out cycles. [`study`] is the directory that keeps
//! all results.
//!
//! # Long records
//!
//! Every computation's cost grows at most in proportion to the number of rows:
//!
//! - Under white noise, the residual sum of squares of the Lethersich law consists of inner products that depend only on the retardation rate E/c₁ (Young's modulus
//!   divided by retardation viscosity). `models::model::ResidualSumOfSquares` tabulates them over this rate. One evaluation thus takes as long with 200 rows as with
//!   200,000.
//! - The prediction of a position is nearly normal if the draws differ by less than the noise. It is then computed as a normal distribution with small corrections
//!   ([`gaussian_predictive`]).
//! - The joint probability of more than 10,000 held-out positions has a closed form if their errors are independent and normal. For all other records it is simulated.
//! - [`fit`] searches with at most 20,000 positions and refines the best minima with all positions.
//!
//! # Model of an external program
//!
//! [`outside`] requests trajectories from an external program by the UM-Bridge protocol. These trajectories replace the base law. [`learnt_outside`] finds the
//! parameters that fit the data and learns a surrogate of the trajectories around them. The model's stages treat the surrogate as a `FieldStepper` without finite
//! elements. Effects of load and observation therefore work as with any law.

pub mod advice;
pub mod cache;
pub mod check;
pub mod fit;
mod fitted_rows;
pub mod full_check;
pub mod gaussian_predictive;
pub mod gradient;
pub mod heldout;
mod joint;
pub mod judgement;
pub mod large_displacement;
pub mod learnt_displacement;
pub mod learnt_outside;
pub mod likelihood;
pub mod log_score;
pub mod mechanics;
mod mesh_check;
pub mod misfit;
mod mixture;
pub mod model_priors;
pub mod modes;
pub mod monitor;
pub mod noise;
pub mod outside;
pub mod patterns;
pub mod prepared;
pub mod prior;
pub mod problem;
pub mod recordings;
pub mod replica;
pub mod sample;
mod starts;
pub mod study;
pub mod systematic;
pub mod trust;
pub mod whiteness;
