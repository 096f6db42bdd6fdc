//! Protocols of challenges.

use serde::{Deserialize, Serialize};

use record::{Apparatus, Experiment, Record};

base::named_enum! {
    /// A protocol: commanded force over time. Every protocol has four cycles of 10 s, sampled at 20 Hz.
    #[derive(Serialize, Deserialize)]
    #[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
    #[serde(rename_all = "lowercase")]
    pub enum Protocol {
        /// The paper's protocol: the force alternates between F and −F every 5 s.
        Paper = "paper",
        /// Three force levels of both signs, separated by rests.
        Levels = "levels",
    }
    /// Name of the protocol in options and JSON.
    pub fn name
}

const N_CYCLES: u32 = 4;
/// Sampling rate: rows per second.
const RATE_HZ: f64 = 20.0;
/// Force of the paper's protocol, in N.
const FORCE_N: f64 = 4.6e-6;
/// Standard deviation of the tracker's white noise, in m.
pub(super) const WHITE_M: f64 = 4e-6;

impl Protocol {
    /// Holds of one cycle: force divided by the largest force, and duration in s.
    fn holds(self) -> &'static [(f64, f64)] {
        match self {
            Self::Paper => &[(1.0, 5.0), (-1.0, 5.0)],
            Self::Levels => &[
                (1.0, 1.5),
                (0.0, 0.75),
                (-0.6, 1.5),
                (0.0, 0.75),
                (0.3, 1.0),
                (-1.0, 1.5),
                (0.0, 0.75),
                (0.6, 1.5),
                (0.0, 0.75),
            ],
        }
    }

    /// Record with this protocol's times, forces and cycles. All positions are 0.
    pub fn record(self) -> Record {
        let one_cycle: Vec<f64> = self
            .holds()
            .iter()
            .flat_map(|(level, hold_s)| std::iter::repeat_n(level * FORCE_N, (hold_s * RATE_HZ).round() as usize))
            .collect();
        let n_rows = one_cycle.len() * N_CYCLES as usize;
        Record {
            time_s: (0..n_rows).map(|row| row as f64 / RATE_HZ).collect(),
            force_n: one_cycle.repeat(N_CYCLES as usize),
            position_m: vec![Some(0.0); n_rows],
            cycle: (1..=N_CYCLES).flat_map(|cycle| std::iter::repeat_n(cycle, one_cycle.len())).collect(),
            ..Record::default()
        }
    }

    /// Returns an experiment with this protocol and these positions (m, one for each row). `noise_sd_m` is the stated noise standard deviation (m); `None` if
    /// it must be estimated. The first cycle is fitted, and the other cycles are held out.
    pub fn experiment(
        self,
        specimen_id: &str,
        apparatus: Apparatus,
        position_m: &[Option<f64>],
        noise_sd_m: Option<f64>,
    ) -> Experiment {
        let mut record = self.record();
        record.position_m = position_m.to_vec();
        Experiment {
            specimen_id: specimen_id.into(),
            species: Some("porcine".into()),
            region: None,
            apparatus,
            record,
            calibration_cycles: vec![1],
            heldout_cycles: (2..=N_CYCLES).collect(),
            noise_sd_m,
            fits_position_offset: false,
            source: "synthetic: full finite elements, with a sealed answer".into(),
            control: record::Control::Force,
            largest_strain: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn protocols_have_four_cycles_of_ten_seconds() {
        for protocol in Protocol::ALL {
            let record = protocol.record();
            assert_eq!((record.n_rows(), record.n_cycles()), (800, 4));
            assert_eq!(record.time_s[799], 39.95);
            assert!((0..800).all(|row| record.cycle[row] == 1 + (record.time_s[row] / 10.0) as u32));
        }
    }

    #[test]
    fn levels_has_three_of_them_and_rests() {
        let mut levels: Vec<i64> =
            Protocol::Levels.record().force_n.iter().map(|force| (force.abs() * 1e9).round() as i64).collect();
        levels.sort_unstable();
        levels.dedup();
        assert_eq!(levels, [0, 1380, 2760, 4600]);
    }
}
