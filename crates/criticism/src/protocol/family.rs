//! Protocols of a given duration that a search for the best one begins with: steps, staircases, holds with recovery, sines, chirps, triangles and random telegraphs.

use figures::number::format_significant;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use record::{ForceRule, Record};
use std::f64::consts::PI;

/// Limits of the apparatus for a designed protocol.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DesignLimits {
    /// Largest absolute force, in N.
    pub largest_force_n: f64,
    /// Duration of the protocol, in s.
    pub duration_s: f64,
    /// Time between samples, in s.
    pub interval_s: f64,
    /// Shortest time for which a force is held, in s. It also limits the frequency of sines.
    pub shortest_hold_s: f64,
    /// Largest distance of the expected position from its start, in m.
    pub largest_position_m: f64,
}

/// Shape of a force over time. Levels are fractions of the largest force.
#[derive(Debug, Clone, PartialEq)]
pub enum DriveShape {
    /// Holds: a fraction of the duration and a level each.
    Holds(Vec<[f64; 2]>),
    /// Values at fractions of the duration, with straight lines between.
    Lines(Vec<[f64; 2]>),
    /// Sum of sines of equal amplitude: numbers of periods in the duration.
    Sines(Vec<f64>),
    /// Sine whose number of periods per duration grows linearly from the first to the second number.
    Chirp([f64; 2]),
}

/// Protocol that a search considers.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignedDrive {
    /// Kind of the protocol in words.
    pub words: String,
    /// Shape of the force.
    pub shape: DriveShape,
    /// Factor on the levels; below 1 if the whole force moves the robot too far.
    pub amplitude: f64,
}

/// Number of random telegraph signals of each number of holds.
const N_RANDOM: usize = 24;
/// Largest number of holds that a description lists.
const MOST_SHOWN: usize = 4;
/// Smallest number of samples in a period of a sine.
const SAMPLES_A_PERIOD: f64 = 12.0;

impl DesignedDrive {
    fn new(words: impl Into<String>, shape: DriveShape) -> Self {
        Self { words: words.into(), shape, amplitude: 1.0 }
    }

    fn holds(words: impl Into<String>, levels: impl IntoIterator<Item = f64>) -> Self {
        let levels: Vec<f64> = levels.into_iter().collect();
        let part = 1.0 / levels.len() as f64;
        Self::new(words, DriveShape::Holds(levels.into_iter().map(|level| [part, level]).collect()))
    }

    /// Record of this protocol, sampled every `interval_s`, in one cycle and without positions.
    pub fn record(&self, limits: &DesignLimits, interval_s: f64) -> Record {
        let n_rows = (limits.duration_s / interval_s).round().max(2.0) as usize;
        let time_s: Vec<f64> = (0..=n_rows).map(|row| limits.duration_s * row as f64 / n_rows as f64).collect();
        let level = |part: f64| match &self.shape {
            DriveShape::Holds(holds) => {
                let mut end = 0.0;
                let at = holds.iter().find(|hold| {
                    end += hold[0];
                    part < end - 1e-9
                });
                at.or(holds.last()).map_or(0.0, |hold| hold[1])
            }
            DriveShape::Lines(points) => {
                let next = points.partition_point(|[at, _]| *at <= part).clamp(1, points.len() - 1);
                let ([from, a], [to, b]) = (points[next - 1], points[next]);
                a + (b - a) * ((part - from) / (to - from)).clamp(0.0, 1.0)
            }
            DriveShape::Sines(periods) => {
                periods.iter().map(|n| (2.0 * PI * n * part).sin()).sum::<f64>() / periods.len() as f64
            }
            DriveShape::Chirp([first, last]) => (2.0 * PI * (first * part + 0.5 * (last - first) * part * part)).sin(),
        };
        let force_n = (0..=n_rows)
            .map(|row| limits.largest_force_n * self.amplitude * level(row as f64 / n_rows as f64))
            .collect();
        let rule = if let DriveShape::Holds(_) = self.shape { ForceRule::Hold } else { ForceRule::Linear };
        Record {
            position_m: vec![Some(0.0); time_s.len()],
            cycle: vec![1; time_s.len()],
            time_s,
            force_n,
            force_rule: rule,
            force_rows: Vec::new(),
        }
    }

    /// The same force followed by a rest, as a part of `share` of a longer protocol; `None` unless it consists of holds.
    pub fn followed_by_rest(&self, share: f64) -> Option<Self> {
        let DriveShape::Holds(holds) = &self.shape else { return None };
        let kept = holds.iter().map(|[part, level]| [share * part, *level]);
        let holds = kept.chain([[1.0 - share, 0.0]]).collect();
        Some(Self { shape: DriveShape::Holds(holds), ..self.clone() })
    }

    /// Holds as the rows of the record show them: the duration of each in s and its level. Neighbours of one level are one hold. `None` for other protocols.
    fn sampled_holds(&self, limits: &DesignLimits) -> Option<Vec<[f64; 2]>> {
        let DriveShape::Holds(holds) = &self.shape else { return None };
        let n_rows = (limits.duration_s / limits.interval_s).round().max(2.0);
        let mut sampled: Vec<[f64; 2]> = Vec::new();
        let (mut end, mut before_s) = (0.0, 0.0);
        for [part, level] in holds {
            end += part;
            let end_s = limits.duration_s * (n_rows * end - 1e-6).ceil() / n_rows;
            match sampled.last_mut() {
                Some(last) if last[1] == *level => last[0] += end_s - before_s,
                _ => sampled.push([end_s - before_s, *level]),
            }
            before_s = end_s;
        }
        Some(sampled)
    }

    /// The protocol in words, with forces and times.
    pub fn described(&self, limits: &DesignLimits) -> String {
        let un = |level: f64| format_significant(1e6 * level * self.amplitude * limits.largest_force_n, 3);
        let Some(holds) = self.sampled_holds(limits) else {
            let article = if self.words.starts_with(|first: char| first.is_ascii_digit()) { "" } else { "a " };
            return format!("{article}{} at up to {} µN", self.words, un(1.0));
        };
        let seconds = |time_s: f64| format_significant(time_s, 3);
        let shown = |[time_s, level]: &[f64; 2]| format!("{} µN for {} s", un(*level), seconds(*time_s));
        if holds.len() <= MOST_SHOWN {
            return holds.iter().map(shown).collect::<Vec<String>>().join(", ");
        }
        let parts = || holds.iter().map(|hold| hold[0]);
        let [shortest, longest] = [parts().fold(f64::INFINITY, f64::min), parts().fold(0.0, f64::max)];
        let durations = match (seconds(shortest), seconds(longest)) {
            (shortest, longest) if shortest == longest => shortest,
            (shortest, longest) => format!("{shortest} to {longest}"),
        };
        format!("{} holds of {durations} s at up to {} µN", holds.len(), un(1.0))
    }

    /// True if every hold and every half period is long enough.
    fn is_possible(&self, limits: &DesignLimits) -> bool {
        let shortest = limits.shortest_hold_s / limits.duration_s;
        let fastest = (limits.duration_s / limits.interval_s / SAMPLES_A_PERIOD).min(0.5 / shortest);
        match &self.shape {
            DriveShape::Holds(holds) => holds.iter().all(|hold| hold[0] >= shortest * (1.0 - 1e-9)),
            DriveShape::Lines(points) => {
                points.windows(2).all(|pair| pair[1][0] - pair[0][0] >= shortest * (1.0 - 1e-9))
            }
            DriveShape::Sines(periods) => periods.iter().all(|n| *n <= fastest),
            DriveShape::Chirp([first, last]) => first.max(*last) <= fastest,
        }
    }

    /// Neighbours of a protocol of holds for an exchange of one coordinate: another level, or another boundary. Empty for other protocols.
    pub fn neighbours(&self, limits: &DesignLimits) -> Vec<Self> {
        let DriveShape::Holds(holds) = &self.shape else { return Vec::new() };
        let mut list = Vec::new();
        let mut add = |holds: Vec<[f64; 2]>| {
            let drive = Self::new("steps of the force", DriveShape::Holds(holds));
            if drive.is_possible(limits) {
                list.push(drive);
            }
        };
        for k in 0..holds.len() {
            for level in [-1.0, -0.5, 0.0, 0.5, 1.0] {
                if level != holds[k][1] {
                    let mut changed = holds.clone();
                    changed[k][1] = level;
                    add(changed);
                }
            }
            if k + 1 < holds.len() {
                for moved in [-0.5, -0.2, 0.2, 0.5] {
                    let mut changed = holds.clone();
                    let by = moved * if moved < 0.0 { holds[k][0] } else { holds[k + 1][0] };
                    changed[k][0] += by;
                    changed[k + 1][0] -= by;
                    add(changed);
                }
            }
        }
        list
    }
}

/// Protocols that the apparatus can run, in a fixed order.
pub fn family(limits: &DesignLimits, seed: u64) -> Vec<DesignedDrive> {
    let mut list = Vec::new();
    for n in [1_usize, 2, 3, 4, 6, 8, 12, 16, 24, 32] {
        let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        list.push(DesignedDrive::holds(format!("{n} holds of alternating sign"), (0..n).map(sign)));
        list.push(DesignedDrive::holds(
            format!("{n} holds, each with a rest of equal length"),
            (0..2 * n).map(|k| if k.is_multiple_of(2) { 1.0 } else { 0.0 }),
        ));
        let halved = |k: usize| sign(k) * if k % 4 < 2 { 1.0 } else { 0.5 };
        list.push(DesignedDrive::holds(
            format!("{n} holds of alternating sign at full and half force"),
            (0..n).map(halved),
        ));
        if n > 1 {
            let up = move |k: usize| (k + 1) as f64 / n as f64;
            list.push(DesignedDrive::holds(format!("staircase of {n} levels"), (0..n).map(up)));
            let down = (0..2 * n).map(move |k| if k < n { up(k) } else { up(2 * n - 1 - k) });
            list.push(DesignedDrive::holds(format!("staircase of {n} levels up and down"), down));
            let point = |k: usize| [k as f64 / (2 * n) as f64, if k.is_multiple_of(2) { 0.0 } else { sign(k / 2) }];
            let lines = DriveShape::Lines((0..=2 * n).map(point).collect());
            list.push(DesignedDrive::new(format!("{n} triangles of alternating sign"), lines));
        }
        list.push(DesignedDrive::new(format!("sine with {n} periods"), DriveShape::Sines(vec![n as f64])));
        for faster in [4.0, 16.0] {
            let last = faster * n as f64;
            let chirp = DriveShape::Chirp([n as f64, last]);
            list.push(DesignedDrive::new(format!("chirp from {n} to {last} periods per record"), chirp));
            let sines = vec![n as f64, faster * n as f64];
            list.push(DesignedDrive::new(format!("two sines with {n} and {last} periods"), DriveShape::Sines(sines)));
        }
        for ratio in [1.5_f64, 2.0, 3.0] {
            let parts: Vec<f64> = (0..n.min(12)).map(|k| ratio.powi(k as i32)).collect();
            let sum: f64 = parts.iter().sum();
            let holds = parts.iter().enumerate().map(|(k, part)| [part / sum, sign(k)]).collect();
            let words = format!("{} holds of alternating sign, each {ratio} times as long as the last", parts.len());
            list.push(DesignedDrive::new(words, DriveShape::Holds(holds)));
        }
    }
    for part in [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9] {
        let holds = vec![[part, 1.0], [1.0 - part, 0.0]];
        let words = format!("hold for {:.0} % of the time, then recovery", 100.0 * part);
        list.push(DesignedDrive::new(words, DriveShape::Holds(holds)));
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for n in [3_usize, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32] {
        for _ in 0..N_RANDOM {
            let cuts = random_parts(&mut random, n);
            let levels = [-1.0, -0.5, 0.0, 0.5, 1.0];
            let holds =
                cuts.into_iter().map(|part| [part, levels[(5.0 * random.random::<f64>()) as usize % 5]]).collect();
            list.push(DesignedDrive::new(format!("random telegraph of {n} holds"), DriveShape::Holds(holds)));
        }
    }
    list.retain(|drive| drive.is_possible(limits));
    list
}

/// Random parts that add to 1. Each is at least a quarter of the mean.
fn random_parts(random: &mut ChaCha8Rng, n: usize) -> Vec<f64> {
    let parts: Vec<f64> = (0..n).map(|_| 0.25 - 0.75 * (1.0 - random.random::<f64>()).ln()).collect();
    let sum: f64 = parts.iter().sum();
    parts.into_iter().map(|part| part / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: DesignLimits = DesignLimits {
        largest_force_n: 4e-6,
        duration_s: 40.0,
        interval_s: 0.05,
        shortest_hold_s: 0.5,
        largest_position_m: 1e-3,
    };

    #[test]
    fn every_protocol_stays_within_its_limits() {
        let list = family(&LIMITS, 1);
        assert!(list.len() > 300, "{}", list.len());
        for drive in &list {
            let record = drive.record(&LIMITS, LIMITS.interval_s);
            assert_eq!(record.n_rows(), 801);
            let largest = record.force_n.iter().fold(0.0_f64, |most, force| most.max(force.abs()));
            assert!(largest > 0.0 || drive.words.contains("random"), "{}", drive.words);
            assert!(largest <= LIMITS.largest_force_n * (1.0 + 1e-12), "{}: {largest} N", drive.words);
            if record.force_rule == ForceRule::Hold {
                let changes: Vec<f64> = (1..record.n_rows())
                    .filter(|row| record.force_n[*row] != record.force_n[row - 1])
                    .map(|row| record.time_s[row])
                    .collect();
                let shortest = changes.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
                assert!(shortest >= LIMITS.shortest_hold_s - 0.051, "{}: a hold of {shortest} s", drive.words);
            }
        }
        assert_eq!(list, family(&LIMITS, 1));
    }

    #[test]
    fn words_are_those_of_the_sampled_holds() {
        let holds = vec![[0.113, 1.0], [0.25, 1.0], [0.637, -0.5]];
        let drive = DesignedDrive::new("", DriveShape::Holds(holds));
        let record = drive.record(&LIMITS, LIMITS.interval_s);
        let switch_s = record.time_s[record.force().step_rows()[1]];
        let un = 1e6 * LIMITS.largest_force_n;
        let rest_s = LIMITS.duration_s - switch_s;
        let expected = [(un, switch_s), (-0.5 * un, rest_s)]
            .map(|(un, time_s)| format!("{} µN for {} s", format_significant(un, 3), format_significant(time_s, 3)));
        assert_eq!(drive.described(&LIMITS), expected.join(", "));
    }

    #[test]
    fn neighbours_change_one_hold_and_keep_the_duration() {
        let drive = DesignedDrive::holds("holds", [1.0, -1.0, 0.0]);
        let list = drive.neighbours(&LIMITS);
        assert!(list.len() >= 12, "{}", list.len());
        for other in list {
            let DriveShape::Holds(holds) = other.shape else { panic!("no holds") };
            assert!((holds.iter().map(|hold| hold[0]).sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
