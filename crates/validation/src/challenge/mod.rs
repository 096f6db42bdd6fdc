//! Data with a hidden effect, made to test the diagnosis: one sealed case, or many that are played.
//!
//! A [`Truth`] is drawn on a [`Bench`], which sizes what is hidden by its signal in standard deviations; its noise-free trajectory comes from
//! [`full_order::trajectories_m`]: full finite elements on a finer mesh and finer time steps than the fitted model's, never the surrogate. [`seal`] hides
//! the answer of a single case; [`plays`] gives many cases fresh noise, has each diagnosed, and [`tally`] counts what was said. [`coverage`] counts how often
//! intervals hold truths that were drawn from the priors.

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

pub use bench::{Bench, Order, draw_pair, hideable};
pub use noise::{Noise, NoiseKind};
pub use outside::{Disturbance, OutsideKind};
pub use protocol::Protocol;
pub use strength::Strength;
pub use truth::{ApparatusError, Hidden, HiddenEffect, NamedValue, Truth};
