//! Priors, noise and likelihood of an experiment, the prepared model, and its posterior.
//!
//! [`problem::Problem`] joins a record with a law, effects, priors, noise and mechanics. [`prepared::PreparedModel`] adds the reduced model with its verified error; it
//! gives the posterior ([`prepared::PreparedModel::posterior`]) and the forward model. [`fit`] finds the point estimate and [`sample`] the posterior. [`full_check`] and
//! [`heldout`] check the posterior by full finite elements on held-out cycles. [`study`] is the directory that keeps all results.
//!
//! # Long records
//!
//! No cost grows faster than linearly in the rows:
//!
//! - The sum of squares of a base law under white noise depends on one number, the rate E/c₁. `models::model::ResidualSumOfSquares` tabulates its inner products, so a point costs
//!   the same with 200 rows and with 200,000.
//! - Predictions whose draws differ by less than the noise are normal distributions with small corrections ([`gaussian_predictive`]).
//! - The joint probability of more than 10,000 independent errors has a closed form; other noise is simulated.
//! - [`fit`] searches among 20,000 positions and refines the best minima with all positions.
//!
//! # Model of an external program
//!
//! [`outside`] evaluates a model of an external program by UM-Bridge instead of the base law. [`learnt_outside`] locates the region of the data and learns trajectories
//! there. The stages treat such a law as a `FieldStepper` without finite elements, so load and observation effects work as with any law.

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
pub mod monitor;
pub mod noise;
pub mod outside;
pub mod prepared;
pub mod prior;
pub mod problem;
pub mod recordings;
pub mod replica;
pub mod sample;
pub mod study;
pub mod systematic;
pub mod trust;
pub mod whiteness;
