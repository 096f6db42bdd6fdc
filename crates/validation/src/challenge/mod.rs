//! Challenges with hidden effects, which test the diagnosis: a single sealed challenge, or many challenges that are made and diagnosed in one run (*plays*).
//!
//! A [`Truth`] is drawn on a [`Bench`], which sets its size so that the signal has a given number of standard deviations. The function
//! [`full_order::trajectories_m`] computes the noise-free trajectory with the full-order model, without a surrogate. Its mesh and time steps are finer than
//! those of the fitted model. The module [`seal`] hides the answer of a single challenge. The module [`plays`] adds new noise to many truths and diagnoses
//! each, and [`tally`] counts the results. The module [`coverage`] counts how often intervals contain values drawn from the priors.

mod bench;
pub mod coverage;
pub mod files;
pub mod full_order;
mod large;
mod motion;
mod noise;
mod outside;
pub mod play;
pub mod plays;
mod protocol;
pub mod seal;
mod strength;
pub mod tally;
mod truth;

pub use bench::{Bench, TruthRequest, draw_pair, hideable_effects};
pub use noise::{Noise, NoiseKind};
pub use outside::{Disturbance, DisturbanceKind};
pub use protocol::Protocol;
pub use strength::Strength;
pub use truth::{ApparatusError, HiddenEffect, HiddenPhysics, NamedValue, Truth};
