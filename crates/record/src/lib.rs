//! What was measured: apparatus, force command, positions, cycles (formats §1).
//!
//! [`Experiment::read`] is the border: behind it everything is SI, checked and complete.

mod actuation;
mod apparatus;
mod contact;
mod cycles;
mod force;
mod frame;
mod indenter;
mod inputs;
mod line;
mod lost;
pub mod noise;
mod notes;
mod read;
mod record;
pub mod robust;
mod scales;
mod sweep;
pub mod table;
mod times;
mod trajectory;

pub use apparatus::{Apparatus, Offset, OffsetDirection, Orientation, Robot, RobotShape, Vitreous, density_toml};
pub use force::{Force, ForceRule, KeptForce, has_noisy_levels};
pub use frame::{Direction, Frame, Projection, Settled, Zero, is_against};
pub use indenter::{Indenter, Tip};
pub use inputs::{ExperimentFiles, OSCILLATION, Understood};
pub use line::Line;
pub use lost::repeated_outliers;
pub use noise::{NoiseOrigin, NoiseYardstick};
pub use notes::Note;
pub use record::Record;
pub use scales::Scales;
pub use sweep::{Sweep, SweepColumn, SweepForm, SweepRow, sweep_columns};
pub use times::TimeRules;

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
    /// Whether the recorded position is off by an amount that no one knows: every model of the experiment then has it as a nuisance parameter. Of an indenter it
    /// is the contact point.
    pub fits_position_offset: bool,
    /// Where the data come from; synthetic or measured.
    pub source: String,
}

impl Experiment {
    /// The same experiment with every cycle fitted but the last held-out one, which alone is scored: how revisions are compared (formats §4). With no
    /// cycle held out all are fitted and none is scored.
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
