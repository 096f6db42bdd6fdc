//! Structure that no effect of the library makes: vibrations, slips, drifts, jumps of the gain, passing disturbances, backlash, memory of
//! the largest excursion, and free curves.
//!
//! Findings describe and do not explain: they have no parameter of the gel. Each shape is added to the mean as columns of free amplitude and refitted
//! with the noise estimated anew. Its gain is the difference of the fits' objectives.
//!
//! # Search
//! Thousands of shapes are scored linearly, by ½‖Qᵀr‖². Q is an orthonormal basis of the part of their whitened columns that the model cannot absorb. They are scored once with the
//! fit's noise and once with white noise of the yardstick's size, since a noise estimated from residuals with the structure hides it.
//! The leading shapes of each family are refitted; their times, frequencies and widths are refined, and the shapes refitted again.
//!
//! # Free curves
//! Curves of the phase, of the time since the step, of absolute time and of the position represent a Gaussian process of that argument. They use a smooth basis in three
//! resolutions, each penalised by the gain of such a basis by chance. [`Discrepancy`] is the process itself, with its band.
//!
//! # Gain by chance
//! Among a thousand times, one always gains. Residuals of pure noise are therefore simulated and searched alike. The median of a family's best gain in them,
//! or 1.5 nats per amplitude if that is more, is subtracted from its gain (`penalised_gain_nats`). This makes families of any size and degree comparable.
//! The family-wise p is the share of simulations in which any family gains as much.
//!
//! Single outlying rows are outliers and excluded here: no shape is narrower than a few rows.

mod discrepancy;
mod look;
mod screen;
mod sentence;
mod setting;
mod shape;

pub use discrepancy::{Axis, Discrepancy, discrepancies};
pub use look::{OutsideNull, events_over_all_cycles, largest_outside_gain, search};

use super::verdict::Structure;
use super::{Candidate, Fitted};

/// Kinds of structure outside the library.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum OutsideKind {
    /// A sinusoid of any frequency.
    Vibration,
    /// A step in position at one time.
    Slip,
    /// A drift that begins or ends at one time.
    Ramp,
    /// A change of gain at one time.
    GainChange,
    /// A bell of free time and width.
    Disturbance,
    /// Play between position and reading, as in a worn drive.
    Backlash,
    /// A curve of the phase within the cycle, equal in every cycle.
    CycleLocked,
    /// A curve of the time since the force step, signed by the step.
    SinceStep,
    /// A curve of absolute time.
    SlowChange,
    /// A power, a wave or a free curve of the position.
    Nonlinearity,
    /// A shift for each level of the force, or a force that is not proportional to its command.
    ForceLevel,
    /// Memory of the largest excursion so far.
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

    /// Returns whether the structure comes from outside the gel and belongs to no law.
    pub fn is_apart_from_law(self) -> bool {
        matches!(self, Self::Vibration | Self::Slip | Self::Ramp | Self::GainChange | Self::Disturbance)
    }

    /// Argument of a free curve, which represents a process of it; `None` for fixed shapes.
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

/// Settings of the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutsideRequest {
    /// Number of simulated residuals by which gains are judged; p is at least 1/(1 + n).
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
pub struct OutsideStructure {
    /// Kind of structure.
    pub kind: OutsideKind,
    /// Sentence: kind, time, size.
    pub sentence: String,
    /// Gain of the refit over the searched model, in nats, over equal rows without outliers.
    pub gain_nats: f64,
    /// Gain less the family's penalty: the median of its best gain in pure noise, at least 1.5 nats per amplitude.
    pub penalised_gain_nats: f64,
    /// Number of free amplitudes.
    pub degrees: usize,
    /// Share of simulated residuals in which any family gains as much.
    pub p_familywise: f64,
    /// Root mean square (µm), over the fitted rows, of the part that the model's parameters cannot absorb.
    pub size_um: f64,
    /// Number of simulated data sets if the budget ended their search early; none of them showed as much. `None` if it did not.
    pub cut_short_after: Option<usize>,
    /// Time (s) of an event.
    pub event_time_s: Option<f64>,
    /// Period (s) of a repeating structure.
    pub period_s: Option<f64>,
    /// Effects of the library with nearly the same shape here, with the cosine between them; the most similar first.
    pub twins: Vec<(String, f64)>,
    /// The model with the columns.
    pub candidate: Candidate,
    /// Its fit, without outliers.
    pub fitted: Fitted,
    /// Part that the model's parameters cannot absorb (m), one value per row of the record.
    pub discrepancy_m: Vec<f64>,
}

impl OutsideStructure {
    /// Evidence for the verdict.
    pub(crate) fn evidence(&self) -> Structure {
        Structure {
            gain_nats: self.penalised_gain_nats,
            p_familywise: self.p_familywise,
            is_of_law: !self.kind.is_apart_from_law(),
            twins: self.twins.clone(),
        }
    }
}
