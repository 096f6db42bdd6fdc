//! Structure that no effect of the library causes: vibrations, offsets, slips, drifts, jumps of the gain, passing disturbances, backlash, memory of the largest excursion, and
//! free curves.
//!
//! Findings describe a residual and do not explain it: they have no parameter of the gel. Each shape is added to the mean as columns of free amplitude, and the model is
//! refitted with the noise estimated anew. The gain is the difference of the two fits' objectives.
//!
//! # Search
//! Thousands of shapes are scored linearly, by ½‖Qᵀr‖² with the whitened residuals r. Q is an orthonormal basis of the part of a shape's whitened columns that the model
//! cannot absorb. Shapes are scored once with the fit's noise and once with white noise of the known or estimated size. The second score is needed because noise estimated
//! from residuals with the structure hides the structure. The leading shapes of each family are refitted. Then their times, frequencies and widths are refined, and the shapes
//! are refitted again.
//!
//! # Free curves
//! Free curves depend on the phase, the time since the step, absolute time or the position, and approximate a Gaussian process of that quantity. They use a smooth basis
//! in three resolutions. Each resolution is penalised by the gain of such a basis by chance. [`Discrepancy`] is the process itself, with its band.
//!
//! # Gain by chance
//! Among a thousand trial times, one always gains. Residuals of pure noise are therefore simulated and searched in the same way. The penalty of a family is the median of
//! its best gain in them, or 1.5 nats per amplitude if that is more. It is subtracted from the family's gain (`penalised_gain_nats`). This makes families of any size and
//! number of amplitudes comparable. The family-wise p is the fraction of simulations in which any family gains as much.
//!
//! Single rows that are far off are outliers. They are excluded before the search: no shape is narrower than a few rows.

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

base::named_enum! {
    /// Kinds of structure outside the library.
    #[derive(Hash)]
    pub enum OutsideKind {
        /// A sinusoid of time, of any frequency.
        Vibration = "vibration",
        /// A shift of all positions.
        Offset = "offset",
        /// A step of the position at one time.
        Slip = "slip",
        /// A drift that begins or ends at one time.
        Ramp = "ramp",
        /// A change of gain at one time.
        GainChange = "gain-change",
        /// A bell curve in time, of any time and width.
        Disturbance = "disturbance",
        /// Play between the true and the measured position, as in a worn drive.
        Backlash = "backlash",
        /// A curve of the phase within the cycle, equal in every cycle.
        CycleLocked = "cycle-locked",
        /// A curve of the time since the force step, signed by the step.
        SinceStep = "since-step",
        /// A curve of absolute time.
        SlowChange = "slow-change",
        /// A power, a wave or a free curve of the position.
        Nonlinearity = "nonlinearity",
        /// A shift for each level of the force, or a force that is not proportional to its command.
        ForceLevel = "force-level",
        /// A curve that depends on the largest excursion so far.
        Ratchet = "ratchet",
    }
    /// Name of the kind in the document of `diagnose`.
    pub fn name
}

impl OutsideKind {
    /// Returns whether the structure comes from outside the gel and belongs to no law.
    pub fn is_apart_from_law(self) -> bool {
        matches!(self, Self::Vibration | Self::Offset | Self::Slip | Self::Ramp | Self::GainChange | Self::Disturbance)
    }

    /// Axis of a free curve, which approximates a Gaussian process along it; `None` for fixed shapes.
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

/// Settings of the search for structure outside the library.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutsideRequest {
    /// Number of simulated residuals n that gains are compared with; p is at least 1/(1 + n).
    pub n_simulations: usize,
    /// Seed of the simulated residuals.
    pub seed: u64,
}

impl Default for OutsideRequest {
    fn default() -> Self {
        Self { n_simulations: 200, seed: 1 }
    }
}

/// A structure outside the library that a search has found.
#[derive(Clone)]
pub struct OutsideStructure {
    /// Kind of structure.
    pub kind: OutsideKind,
    /// Sentence that names the kind, the time and the size.
    pub sentence: String,
    /// Gain (nats) of the refit over the searched model. Both are fitted to equal rows, without outliers.
    pub gain_nats: f64,
    /// Gain less the family's penalty, in nats. The penalty is the median of the family's best gain in pure noise, at least 1.5 nats per amplitude.
    pub penalised_gain_nats: f64,
    /// Fraction of simulated residuals in which any family gains as much.
    pub p_familywise: f64,
    /// Root mean square (µm), over the fitted rows, of the part of the structure that the model's parameters cannot absorb.
    pub size_um: f64,
    /// Time (s) of an event; `None` for other structure.
    pub event_time_s: Option<f64>,
    /// Period (s) of a repeating structure; `None` for other structure.
    pub period_s: Option<f64>,
    /// Slugs of library effects with nearly the same shape in this record, with the cosines; the most similar one first.
    pub twins: Vec<(String, f64)>,
    /// The model with the structure's columns.
    pub candidate: Candidate,
    /// Fit of `candidate`, without outliers.
    pub fitted: Fitted,
    /// Part of the structure (m) that the model's parameters cannot absorb, one value per row of the record.
    pub discrepancy_m: Vec<f64>,
}

impl OutsideStructure {
    /// Returns the data of the structure from which the verdict is decided.
    pub(crate) fn evidence(&self) -> Structure {
        Structure {
            gain_nats: self.penalised_gain_nats,
            p_familywise: self.p_familywise,
            is_of_law: !self.kind.is_apart_from_law(),
            twins: self.twins.clone(),
        }
    }
}
