//! Disturbances by physics that is not in the effect library.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::Protocol;
use record::Record;
use sampling::ensemble::RandomStream;

base::named_enum! {
    /// Kind of physics outside the library.
    #[derive(Serialize, Deserialize)]
    #[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
    #[serde(rename_all = "kebab-case")]
    pub enum DisturbanceKind {
        /// The camera vibrates at its own frequency.
        Vibration = "vibration",
        /// The camera vibrates at a multiple of the cycle's frequency.
        CycleVibration = "cycle-vibration",
        /// The tracked point jumps once and stays there.
        Slip = "slip",
        /// The tracker's scale changes once.
        GainJump = "gain-jump",
        /// The robot is displaced for about a second and returns.
        Bump = "bump",
        /// The recorded position drifts to and fro smoothly, over tens of seconds.
        Wander = "wander",
        /// The tracker's scale depends on the position x: the tracker records x (1 + s (x/x_max)²), where s is the size and x_max the largest position.
        CubicScale = "cubic-scale",
        /// The tracker shifts positions towards its pixels. The error is a saw-tooth function of the position. Over one pixel pitch it varies between minus and
        /// plus the size.
        PixelLocking = "pixel-locking",
        /// The tracker follows with a dead band (play operator). Under a square-wave force this equals a delay, so the protocol must contain rests.
        Backlash = "backlash",
        /// The force is not proportional to the commanded force F: it is F (1 + s (|F|/F_max − 1)), where s is the size and F_max the largest commanded force. With
        /// a single force level the disturbance equals a change of scale, so the protocol needs several levels.
        ForceLevel = "force-level",
        /// The robot moves by several radii in a gel whose large-strain law is not in the library (Giesekus's fluid). Its size is given in robot radii.
        LargeDisplacement = "large-displacement",
    }
    /// Name of the kind in options and JSON.
    pub fn name
}

impl DisturbanceKind {
    /// Kinds that are drawn at random. Large displacements are used only on request, because their data take a minute to compute.
    pub fn drawn() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|kind| *kind != Self::LargeDisplacement)
    }

    /// True if no effect of the library can explain this kind of disturbance with the given protocol.
    pub fn suits(self, protocol: Protocol) -> bool {
        protocol == Protocol::Levels || !matches!(self, Self::Backlash | Self::ForceLevel)
    }

    /// Returns the size of a newly drawn disturbance, in the unit of [`Disturbance::size`]. A disturbance of this size is certainly detectable.
    fn first_size(self) -> f64 {
        match self {
            Self::GainJump | Self::CubicScale | Self::ForceLevel => 0.05,
            Self::LargeDisplacement => 1.0,
            _ => 20e-6,
        }
    }

    /// True if the size of the disturbance may have either sign.
    fn has_two_signs(self) -> bool {
        !matches!(self, Self::Vibration | Self::CycleVibration | Self::Backlash | Self::LargeDisplacement)
    }
}

/// A disturbance by physics outside the library, with its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Disturbance {
    /// Kind of the disturbance.
    pub kind: DisturbanceKind,
    /// Size of the disturbance: in m if it adds to the position, otherwise a fraction. Large displacements: largest distance from the start in a linear gel, in
    /// robot radii.
    pub size: f64,
    /// Random numbers from 0 to 1 for times, frequencies and phases. Each kind converts them to its own scale.
    pub shape: Vec<f64>,
}

impl Disturbance {
    /// Draws a disturbance with random times, frequencies, phases and sign. Its size is certainly detectable.
    pub fn draw(kind: DisturbanceKind, stream: &mut RandomStream) -> Self {
        let sign = if stream.unit() < 0.5 && kind.has_two_signs() { -1.0 } else { 1.0 };
        Self { kind, size: sign * kind.first_size(), shape: (0..4).map(|_| stream.unit()).collect() }
    }

    /// Returns the disturbance with another size.
    pub fn sized(&self, size: f64) -> Self {
        Self { size, ..self.clone() }
    }

    fn shape(&self, index: usize) -> f64 {
        self.shape.get(index).copied().unwrap_or(0.5)
    }

    /// Time (s) of a sudden disturbance. It lies between the two fractions `shares` of the record's duration.
    fn moment_s(&self, record: &Record, shares: [f64; 2]) -> f64 {
        let last_s = record.time_s.last().copied().unwrap_or(0.0);
        last_s * (shares[0] + (shares[1] - shares[0]) * self.shape(0))
    }

    /// Force that acts with this disturbance at each row, in N.
    pub fn force_n(&self, record: &Record) -> Vec<f64> {
        if self.kind != DisturbanceKind::ForceLevel {
            return record.force_n.clone();
        }
        let largest_n = record.force_n.iter().fold(f64::MIN_POSITIVE, |a, force| a.max(force.abs()));
        record.force_n.iter().map(|force| force * (1.0 + self.size * (force.abs() / largest_n - 1.0))).collect()
    }

    /// Converts true positions (m) to those that the tracker records (m). Sudden disturbances lie in the first three quarters of the record, which are fitted.
    pub fn recorded_m(&self, record: &Record, position_m: &[f64]) -> Vec<f64> {
        let size = self.size;
        let each = |of: &dyn Fn(f64, f64) -> f64| {
            record.time_s.iter().zip(position_m).map(|(time_s, position)| of(*time_s, *position)).collect()
        };
        match self.kind {
            DisturbanceKind::Vibration => {
                let frequency_hz = 0.6 * (4.0_f64 / 0.6).powf(self.shape(0));
                each(&|t, x| x + size * (TAU * (frequency_hz * t + self.shape(1))).sin())
            }
            DisturbanceKind::CycleVibration => {
                let cycle_s = cycle_s(record);
                let order = (6.0 + 20.0 * self.shape(0)).floor();
                each(&|t, x| x + size * (TAU * (order * t / cycle_s + self.shape(1))).sin())
            }
            DisturbanceKind::Slip => {
                let moment_s = self.moment_s(record, [0.1, 0.62]);
                each(&|t, x| if t >= moment_s { x + size } else { x })
            }
            DisturbanceKind::GainJump => {
                let moment_s = self.moment_s(record, [0.2, 0.55]);
                each(&|t, x| if t >= moment_s { x * (1.0 + size) } else { x })
            }
            DisturbanceKind::Bump => {
                let (moment_s, width_s) = (self.moment_s(record, [0.1, 0.65]), 0.3 + 0.7 * self.shape(1));
                each(&|t, x| x + size * (-0.5 * ((t - moment_s) / width_s).powi(2)).exp())
            }
            DisturbanceKind::Wander => {
                let last_s = record.time_s.last().copied().unwrap_or(1.0);
                let wave = |turns: f64, phase: f64, t: f64| (TAU * (turns * t / last_s + phase)).sin();
                each(&|t, x| {
                    let waves =
                        [1.3, 2.2, 3.1, 4.3].iter().enumerate().map(|(k, turns)| wave(*turns, self.shape(k), t));
                    x + 0.5 * size * waves.sum::<f64>()
                })
            }
            DisturbanceKind::CubicScale => {
                let largest_m = position_m.iter().fold(f64::MIN_POSITIVE, |a, x| a.max(x.abs()));
                each(&|_, x| x * (1.0 + size * (x / largest_m).powi(2)))
            }
            DisturbanceKind::PixelLocking => {
                let pitch_m = 60e-6 + 140e-6 * self.shape(0);
                each(&|_, x| x - 2.0 * size * (x / pitch_m - (x / pitch_m).round()))
            }
            DisturbanceKind::Backlash => {
                let mut followed_m = 0.0_f64;
                let follow = |x: &f64| {
                    followed_m = followed_m.clamp(x - size, x + size);
                    followed_m
                };
                position_m.iter().map(follow).collect()
            }
            // For these kinds the true position already includes the changed physics.
            DisturbanceKind::ForceLevel | DisturbanceKind::LargeDisplacement => position_m.to_vec(),
        }
    }
}

fn cycle_s(record: &Record) -> f64 {
    let second = record.cycle.iter().position(|cycle| *cycle == 2).unwrap_or(record.n_rows());
    record.time_s.get(second).copied().unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> (Record, Vec<f64>) {
        let record = Protocol::Levels.record();
        let position_m = record.time_s.iter().map(|t| 1e-4 * (0.3 * t).sin()).collect();
        (record, position_m)
    }

    #[test]
    fn nothing_of_it_is_nothing() {
        let (record, position_m) = ramp();
        for kind in DisturbanceKind::drawn() {
            let none = Disturbance::draw(kind, &mut RandomStream::new(1, 0)).sized(0.0);
            assert_eq!(none.recorded_m(&record, &position_m), position_m, "{kind:?}");
            assert_eq!(none.force_n(&record), record.force_n, "{kind:?}");
        }
    }

    #[test]
    fn every_kind_changes_the_fitted_cycles() {
        let (record, position_m) = ramp();
        for kind in DisturbanceKind::drawn() {
            for stream in 0..20 {
                let made = Disturbance::draw(kind, &mut RandomStream::new(1, stream));
                let moved =
                    made.recorded_m(&record, &position_m) != position_m || made.force_n(&record) != record.force_n;
                assert!(moved, "{kind:?}");
            }
        }
    }

    /// Checks that a play operator follows its input at a distance of half its width after the first reversal.
    #[test]
    fn backlash_follows_half_a_width_behind() {
        let record = Protocol::Levels.record();
        let position_m: Vec<f64> = record.time_s.iter().map(|t| 1e-5 * t).collect();
        let made = Disturbance { kind: DisturbanceKind::Backlash, size: 2e-5, shape: Vec::new() };
        let recorded_m = made.recorded_m(&record, &position_m);
        assert_eq!(recorded_m[20], 0.0);
        assert!((position_m[400] - recorded_m[400] - 2e-5).abs() < 1e-18);
    }

    #[test]
    fn the_largest_force_is_its_command() {
        let (record, _) = ramp();
        let made = Disturbance { kind: DisturbanceKind::ForceLevel, size: 0.1, shape: Vec::new() };
        let force_n = made.force_n(&record);
        assert_eq!(force_n[0], record.force_n[0]);
        let row = record.force_n.iter().position(|force| *force < 0.0).unwrap();
        assert!((force_n[row] / record.force_n[row] - 0.96).abs() < 1e-12);
    }
}
