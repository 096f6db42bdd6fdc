//! Challenges with hidden effects that test the diagnosis: one sealed case, or many cases that are played.
//!
//! A [`Truth`] is drawn on a [`Bench`], which sets its size by the signal in standard deviations. [`full_order::trajectories_m`] computes its noise-free
//! trajectory with the full-order model. Mesh and time steps are finer than in the fitted model, and no surrogate is used. [`seal`] hides the answer of a
//! single case. [`plays`] gives many cases fresh noise and diagnoses each, and [`tally`] counts the results. [`coverage`] measures the coverage of intervals
//! for truths drawn from the priors.

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
pub use truth::{ApparatusError, HiddenEffect, HiddenThing, NamedValue, Truth};
