//! Structure that no effect of the library makes: vibrations, slips, drifts, jumps of the gain, passing disturbances, backlash, memory of
//! the largest excursion, and free curves.
//!
//! What is found is described, not explained: it has no parameter of the gel. Each shape is added to the mean as columns of free amplitude and refitted
//! with the noise estimated anew; its gain is the difference of the fits' objectives.
//!
//! # Search
//! Thousands of shapes are scored linearly, by ½‖Qᵀr‖² with Q an orthonormal basis of what the model leaves of their whitened columns: once with the
//! fit's noise, and once with white noise of the yardstick's size, since a noise that was estimated with the structure still in the residuals hides it.
//! The leading ones of each family are refitted, their moments, frequencies and widths refined, and refitted again.
//!
//! # Free curves
//! Curves of the phase, of the time since the step, of absolute time and of the position stand for a Gaussian process of that argument: a smooth basis in three
//! resolutions, each penalised by what a basis of its size gains by chance. [`Discrepancy`] is the process itself, with its band.
//!
//! # How much chance gains
//! Among a thousand moments one always gains. Residuals of pure noise are simulated and searched alike: the median of the best gain that a family then has,
//! or 1.5 nats an amplitude where that is more, is taken off its gain (`penalised_gain_nats`), which makes families of any size and degree comparable,
//! and the family-wise p is the share of simulations in which any family does as well.
//!
//! A row that stands out alone is an outlier and left out here: no shape is narrower than a few rows.

mod discrepancy;
mod look;
mod screen;
mod sentence;
mod setting;
mod shape;

pub use discrepancy::{Axis, Discrepancy, discrepancies};
pub use look::{OutsideNull, events_over_all_cycles, outside_gain, search};

use super::verdict::Structure;
use super::{Candidate, Fitted};

/// Kinds of structure outside the library.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum OutsideKind {
    /// A sinusoid of any frequency.
    Vibration,
    /// A step in position at one moment.
    Slip,
    /// A drift that begins or ends at one moment.
    Ramp,
    /// A change of gain at one moment.
    GainChange,
    /// A bell of free time and width.
    Disturbance,
    /// Play between position and reading.
    Backlash,
    /// A curve of the phase within the cycle, the same in every cycle.
    CycleLocked,
    /// A curve of the time since the force step, signed by the step.
    SinceStep,
    /// A curve of absolute time.
    SlowChange,
    /// A power, a wave or a free curve of the position.
    Nonlinearity,
    /// A shift for each level of the force, or a force that is not proportional to its command.
    ForceLevel,
    /// The largest excursion so far.
    Ratchet,
}

impl OutsideKind {
    /// Name in the document of `diagnose`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vibration => "vibration",
            Self::Slip => "slip",
            Self::Ramp => "ramp",
            Self::GainChange => "gain-change",
            Self::Disturbance => "disturbance",
            Self::Backlash => "backlash",
            Self::CycleLocked => "cycle-locked",
            Self::SinceStep => "since-step",
            Self::SlowChange => "slow-change",
            Self::Nonlinearity => "nonlinearity",
            Self::ForceLevel => "force-level",
            Self::Ratchet => "ratchet",
        }
    }

    /// Whether it comes from outside the gel and has no part in its law, whatever that is.
    pub fn is_apart_from_law(self) -> bool {
        matches!(self, Self::Vibration | Self::Slip | Self::Ramp | Self::GainChange | Self::Disturbance)
    }

    /// The argument of a free curve, which stands for a process of it; `None` for what has a shape of its own.
    pub fn axis_of_curve(self) -> Option<Axis> {
        match self {
            Self::CycleLocked => Some(Axis::Phase),
            Self::SinceStep => Some(Axis::TimeSinceStep),
            Self::SlowChange => Some(Axis::AbsoluteTime),
            Self::ForceLevel => Some(Axis::Force),
            _ => None,
        }
    }
}

/// How to search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutsideRequest {
    /// Simulated residuals by which gains are judged; p cannot fall below 1/(1 + n).
    pub n_simulations: usize,
    /// Seed of the simulated residuals.
    pub seed: u64,
}

impl Default for OutsideRequest {
    fn default() -> Self {
        Self { n_simulations: 200, seed: 1 }
    }
}

/// Structure outside the library.
#[derive(Clone)]
pub struct Outside {
    /// Of which kind it is.
    pub kind: OutsideKind,
    /// In plain words: what, when, how large.
    pub sentence: String,
    /// Gain of the refit over the model that it was looked for in, in nats; over the same rows, outliers left out.
    pub gain_nats: f64,
    /// The same less what the family costs: the median of the best gain that pure noise gives it, at least 1.5 nats an amplitude.
    pub penalised_gain_nats: f64,
    /// Free amplitudes.
    pub degrees: usize,
    /// Share of simulated residuals in which any family does as well.
    pub p_familywise: f64,
    /// Root mean square (µm) over the fitted rows of what the model's parameters cannot absorb of it.
    pub size_um: f64,
    /// Simulated data sets that did not show as much, where the budget of such a search ended them; `None` where it did not.
    pub cut_short_after: Option<usize>,
    /// Moment (s) of an event.
    pub event_time_s: Option<f64>,
    /// Period (s) of what repeats.
    pub period_s: Option<f64>,
    /// Effects of the library that look nearly the same here, with the cosine between them; the most alike first.
    pub twins: Vec<(String, f64)>,
    /// The model with the columns.
    pub candidate: Candidate,
    /// Its fit, outliers left out.
    pub fitted: Fitted,
    /// What the model's parameters cannot absorb of it (m), one value a row of the record.
    pub discrepancy_m: Vec<f64>,
}

impl Outside {
    /// What a verdict takes into account of it.
    pub(crate) fn evidence(&self) -> Structure {
        Structure {
            gain_nats: self.penalised_gain_nats,
            p_familywise: self.p_familywise,
            is_of_law: !self.kind.is_apart_from_law(),
            twins: self.twins.clone(),
        }
    }
}
