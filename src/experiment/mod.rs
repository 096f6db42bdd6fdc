//! What was measured: apparatus, force command, positions, cycles (contracts §1).
//!
//! [`Experiment::read`] is the border: behind it everything is SI, checked and complete.

mod apparatus;
mod cycles;
mod noise;
mod read;
mod record;
mod scales;
mod trajectory;

pub use apparatus::{Apparatus, Orientation, Robot, RobotShape, Vitreous};
pub use noise::{NoiseOrigin, NoiseYardstick};
pub use read::{ExperimentFiles, Note};
pub use record::Record;
pub use scales::Scales;

/// One experiment, validated, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Specimen identifier, `[specimen] id`.
    pub specimen_id: String,
    /// Free text; groups are formed by it.
    pub species: Option<String>,
    /// Region of the eye, free text.
    pub region: Option<String>,
    /// What turns force into position.
    pub apparatus: Apparatus,
    /// Force and position against time.
    pub record: Record,
    /// Cycles that the base model is fitted to.
    pub calibration_cycles: Vec<u32>,
    /// Cycles that no fit of the base model sees.
    pub heldout_cycles: Vec<u32>,
    /// The tracker's known noise, in m, if stated.
    pub noise_sd_m: Option<f64>,
    /// Where the data come from; synthetic or measured.
    pub source: String,
}
