//! Measured data of an experiment: apparatus, commanded force, positions and cycles (formats §1).
//!
//! [`Experiment::read`] reads and checks an experiment, whose data are then complete and in SI units.

mod actuation;
mod apparatus;
mod contact;
mod control;
mod cycles;
mod force;
pub mod frame;
mod indenter;
mod inputs;
mod line;
mod lost;
pub mod noise;
mod notes;
pub mod protocol_change;
mod read;
mod record;
pub mod robust;
mod scales;
mod sweep;
pub mod table;
mod times;
mod trajectory;

pub use apparatus::{
    Apparatus, Offset, OffsetDirection, Orientation, Robot, RobotShape, STRESS_STRAIN, Vitreous, density_toml,
};
pub use control::Control;
pub use force::{Force, ForceRule, OwnedForce, has_noisy_levels, ramps_between_holds, sampled_ramps};
pub use frame::{AppliedFrame, Direction, Frame, Projection, Zero, is_work_negative};
pub use indenter::{Indenter, Tip};
pub use inputs::{ExperimentFiles, Interpretation, OSCILLATION, RELAXATION};
pub use line::MotionLine;
pub use lost::repeated_outliers;
pub use noise::{NoiseOrigin, ReferenceNoise};
pub use notes::Note;
pub use record::Record;
pub use scales::CharacteristicSizes;
pub use sweep::{
    OscillationRecord, SweepColumn, SweepForm, SweepRow, columns_of, moduli_columns, rows_by_frequency, sweep_columns,
};
pub use times::TimeRules;

use base::quantities::Quantities;

/// One checked experiment, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Specimen identifier, `[specimen] id`.
    pub specimen_id: String,
    /// Species of the specimen, as free text. It can define the groups of a cohort.
    pub species: Option<String>,
    /// Region of the eye, as free text. It can define the groups of a cohort.
    pub region: Option<String>,
    /// Apparatus on which the force acts and whose position is measured.
    pub apparatus: Apparatus,
    /// Record of the commanded force and the measured position over time.
    pub record: Record,
    /// Cycles from which the parameters of the base model are estimated.
    pub calibration_cycles: Vec<u32>,
    /// Held-out cycles, which no fit of the base model uses.
    pub heldout_cycles: Vec<u32>,
    /// Known noise standard deviation of the measured position, in m; `None` if it is not given.
    pub noise_sd_m: Option<f64>,
    /// True if the recorded position has an unknown offset, which every model of the experiment then has as a nuisance parameter. For an indenter the
    /// offset is the contact point.
    pub fits_position_offset: bool,
    /// Source of the data: synthetic or measured.
    pub source: String,
    /// Quantity that is commanded.
    pub control: Control,
    /// Largest strain of a record of stress and strain; `None` for other records, and for a published compliance or modulus.
    pub largest_strain: Option<f64>,
}

impl Experiment {
    /// Words and units of the record's quantities; `None` for a commanded force in µN and a measured position in µm.
    pub fn quantities(&self) -> Option<Quantities> {
        let is_stress_strain = matches!(self.apparatus, Apparatus::Instrument { is_stress_strain: true, .. });
        Quantities::of(self.control == Control::Position, is_stress_strain)
    }

    /// Returns the experiment with the cycles for the comparison of revisions (formats §4). Only the last held-out cycle is scored, and all other
    /// cycles are fitted. If no cycle is held out, all cycles are fitted and none is scored.
    pub fn for_comparison(&self) -> Self {
        let scored = self.heldout_cycles.iter().copied().max();
        let all = self.calibration_cycles.iter().chain(&self.heldout_cycles).copied();
        let mut fitted: Vec<u32> = all.filter(|cycle| Some(*cycle) != scored).collect();
        fitted.sort_unstable();
        Self { calibration_cycles: fitted, heldout_cycles: scored.into_iter().collect(), ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn revisions_are_fitted_on_all_cycles_but_the_last_held_out_one() {
        let replica = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/porcine-replica");
        let (mut experiment, _) = Experiment::read(replica.as_ref()).expect("the replica");
        let split = |experiment: &Experiment| {
            let compared = experiment.for_comparison();
            (compared.calibration_cycles, compared.heldout_cycles)
        };
        assert_eq!(split(&experiment), (vec![1, 2, 3], vec![4]));
        (experiment.calibration_cycles, experiment.heldout_cycles) = (vec![4, 1], vec![2]);
        assert_eq!(split(&experiment), (vec![1, 4], vec![2]));
        experiment.heldout_cycles.clear();
        assert_eq!(split(&experiment), (vec![1, 4], vec![]));
    }
}
