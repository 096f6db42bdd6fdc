//! Protocols of a given duration that a search for the best one begins with: steps, staircases, holds with recovery, sines, chirps, triangles and random telegraphs.
//! Each is a list of holds, because a controller holds one force until the next. Sines, chirps and triangles have holds of the shortest duration.

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
    /// Shortest time for which a force is held, in s.
    pub shortest_hold_s: f64,
    /// Largest distance of the expected position from its start, in m.
    pub largest_position_m: f64,
    /// Directions of the force that the apparatus can apply.
    pub directions: ForceDirections,
}

/// Directions of the force that an apparatus can apply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForceDirections {
    /// Forces of both signs.
    Both,
    /// Positive forces only, as of a magnet that pulls.
    Positive,
    /// Negative forces only.
    Negative,
}

impl ForceDirections {
    /// Level that the apparatus applies for a level of both directions: 0 in place of the wrong direction.
    fn level(self, level: f64) -> f64 {
        match self {
            Self::Both => level,
            Self::Positive => level.max(0.0),
            Self::Negative => level.min(0.0),
        }
    }
}

impl DesignLimits {
    /// These limits for a record of another duration, rounded down to whole intervals.
    pub fn lasting(self, duration_s: f64) -> Self {
        Self { duration_s: self.interval_s * (duration_s / self.interval_s + 1e-6).floor(), ..self }
    }

    /// Number of intervals between the samples of the whole record.
    fn n_intervals(&self, interval_s: f64) -> usize {
        // A duration that is a multiple of the interval may be slightly shorter because of rounding.
        (self.duration_s / interval_s + 1e-6).max(2.0) as usize
    }
}

/// Protocol that a search considers.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignedDrive {
    /// Kind of the protocol in words.
    pub words: String,
    /// Holds: a fraction of the duration and a level each. Levels are fractions of the largest force.
    pub holds: Vec<[f64; 2]>,
    /// Factor on the levels; below 1 if the whole force moves the robot too far.
    pub amplitude: f64,
}

/// Number of random telegraph signals of each number of holds.
const N_RANDOM: usize = 24;
/// Largest number of holds that a description lists.
const MOST_SHOWN: usize = 4;
/// Largest number of holds whose levels and boundaries are exchanged, and that are described by their number.
const MOST_EXCHANGED: usize = 64;
/// Smallest number of holds in a period of a sine.
const HOLDS_A_PERIOD: f64 = 8.0;

impl DesignedDrive {
    fn new(words: impl Into<String>, holds: Vec<[f64; 2]>) -> Self {
        Self { words: words.into(), holds, amplitude: 1.0 }
    }

    fn equal_holds(words: impl Into<String>, levels: impl IntoIterator<Item = f64>) -> Self {
        let levels: Vec<f64> = levels.into_iter().collect();
        let part = 1.0 / levels.len() as f64;
        Self::new(words, levels.into_iter().map(|level| [part, level]).collect())
    }

    /// Holds of the shortest duration with the levels of a wave in their middles. The wave is a function of the fraction of the duration.
    fn wave(words: impl Into<String>, limits: &DesignLimits, level: impl Fn(f64) -> f64) -> Self {
        let n_intervals = limits.n_intervals(limits.interval_s);
        let of_hold = ((limits.shortest_hold_s / limits.interval_s - 1e-6).ceil() as usize).max(1);
        let begins: Vec<usize> = (0..n_intervals / of_hold).map(|hold| hold * of_hold).collect();
        let ends = begins.iter().skip(1).copied().chain([n_intervals]);
        let part = |rows: usize| rows as f64 / n_intervals as f64;
        let hold = |(begin, end): (&usize, usize)| [part(end - begin), level(0.5 * (part(*begin) + part(end)))];
        Self::new(words, begins.iter().zip(ends).map(hold).collect())
    }

    /// The protocol with forces of the possible directions.
    pub(super) fn in_directions(mut self, directions: ForceDirections) -> Self {
        self.holds.iter_mut().for_each(|hold| hold[1] = directions.level(hold[1]));
        self
    }

    /// Record of this protocol, sampled every `interval_s`, in one cycle and without positions.
    pub fn record(&self, limits: &DesignLimits, interval_s: f64) -> Record {
        let n_intervals = limits.n_intervals(interval_s);
        let level = |row: usize| {
            let (part, mut end) = (row as f64 / n_intervals as f64, 0.0);
            let at = self.holds.iter().find(|hold| {
                end += hold[0];
                part < end - 1e-9
            });
            at.or(self.holds.last()).map_or(0.0, |hold| hold[1])
        };
        let rows = 0..=n_intervals;
        Record {
            position_m: vec![Some(0.0); rows.clone().count()],
            cycle: vec![1; rows.clone().count()],
            time_s: rows.clone().map(|row| interval_s * row as f64).collect(),
            force_n: rows.map(|row| limits.largest_force_n * self.amplitude * level(row)).collect(),
            force_rule: ForceRule::Hold,
            force_rows: Vec::new(),
        }
    }

    /// Longer protocols that begin with this one, which takes `share` of their duration: followed by a rest, by itself, and by itself with the opposite force.
    pub fn continued(&self, share: f64) -> Vec<Self> {
        let with = |after: Vec<[f64; 2]>| {
            let holds = self.holds.iter().chain(&after).map(|[part, level]| [share * part, *level]).collect();
            Self { holds, ..self.clone() }
        };
        let times = |sign: f64| {
            let repeats = (1.0 / share + 1e-9) as usize - 1;
            let one = |repeat: usize| {
                let sign = if repeat.is_multiple_of(2) { sign } else { 1.0 };
                self.holds.iter().map(move |[part, level]| [*part, sign * level])
            };
            let mut all = with((0..repeats).flat_map(one).collect());
            all.words += " and again";
            // The last level goes on in the time that whole repeats leave.
            let left = 1.0 - all.holds.iter().map(|hold| hold[0]).sum::<f64>();
            if let Some(last) = all.holds.last_mut() {
                last[0] += left;
            }
            all
        };
        vec![with(vec![[1.0 / share - 1.0, 0.0]]), times(1.0), times(-1.0)]
    }

    /// Holds as the rows of the record show them: the duration of each in s and its level. Neighbours of one level are one hold.
    fn sampled_holds(&self, limits: &DesignLimits) -> Vec<[f64; 2]> {
        let n_intervals = limits.n_intervals(limits.interval_s) as f64;
        let mut sampled: Vec<[f64; 2]> = Vec::new();
        let (mut end, mut before_s) = (0.0, 0.0);
        for [part, level] in &self.holds {
            end += part;
            let end_s = limits.interval_s * (n_intervals * end - 1e-6).ceil();
            match sampled.last_mut() {
                Some(last) if last[1] == *level => last[0] += end_s - before_s,
                _ => sampled.push([end_s - before_s, *level]),
            }
            before_s = end_s;
        }
        sampled
    }

    /// The protocol in words, with forces and times.
    pub fn described(&self, limits: &DesignLimits) -> String {
        let un = |level: f64| format_significant(1e6 * level * self.amplitude * limits.largest_force_n, 3);
        let holds = self.sampled_holds(limits);
        let levels = || self.holds.iter().map(|hold| hold[1]);
        let [lowest, highest] = [levels().fold(0.0, f64::min), levels().fold(0.0, f64::max)];
        let largest = if highest > 0.0 { highest.max(-lowest) } else { lowest };
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
        let kind = if holds.len() > MOST_EXCHANGED { format!(" ({})", self.words) } else { String::new() };
        format!("{} holds of {durations} s at up to {} µN{kind}", holds.len(), un(largest))
    }

    /// True if a force acts at some time.
    fn acts(&self) -> bool {
        self.holds.iter().any(|hold| hold[1] != 0.0)
    }

    /// True if every hold is long enough.
    fn is_possible(&self, limits: &DesignLimits) -> bool {
        let shortest = limits.shortest_hold_s / limits.duration_s;
        self.holds.iter().all(|hold| hold[0] >= shortest * (1.0 - 1e-9))
    }

    /// Neighbours of a protocol for an exchange of one coordinate: another level, or another boundary. Empty for protocols of very many holds.
    pub fn neighbours(&self, limits: &DesignLimits) -> Vec<Self> {
        let holds = &self.holds;
        if holds.len() > MOST_EXCHANGED {
            return Vec::new();
        }
        let mut list = Vec::new();
        let mut add = |holds: Vec<[f64; 2]>| {
            let drive = Self::new("steps of the force", holds).in_directions(limits.directions);
            if drive.is_possible(limits) && drive.acts() && drive.holds != self.holds {
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
        list.push(DesignedDrive::equal_holds(format!("{n} holds of alternating sign"), (0..n).map(sign)));
        list.push(DesignedDrive::equal_holds(
            format!("{n} holds, each with a rest of equal length"),
            (0..2 * n).map(|k| if k.is_multiple_of(2) { 1.0 } else { 0.0 }),
        ));
        let halved = |k: usize| sign(k) * if k % 4 < 2 { 1.0 } else { 0.5 };
        list.push(DesignedDrive::equal_holds(
            format!("{n} holds of alternating sign at full and half force"),
            (0..n).map(halved),
        ));
        if n > 1 {
            let up = move |k: usize| (k + 1) as f64 / n as f64;
            list.push(DesignedDrive::equal_holds(format!("staircase of {n} levels"), (0..n).map(up)));
            let down = (0..2 * n).map(move |k| if k < n { up(k) } else { up(2 * n - 1 - k) });
            list.push(DesignedDrive::equal_holds(format!("staircase of {n} levels up and down"), down));
        }
        // The fastest wave has few holds in a period.
        let fastest = limits.duration_s / limits.shortest_hold_s.max(limits.interval_s) / HOLDS_A_PERIOD;
        let turns = n as f64;
        if n > 1 && turns <= fastest {
            let triangle =
                |part: f64| sign((turns * part) as usize) * (1.0 - (2.0 * (turns * part).fract() - 1.0).abs());
            list.push(DesignedDrive::wave(format!("{n} triangles of alternating sign"), limits, triangle));
        }
        let sine = |periods: f64| (2.0 * PI * periods).sin();
        if turns <= fastest {
            list.push(DesignedDrive::wave(format!("sine with {n} periods"), limits, |part| sine(turns * part)));
        }
        for last in [4.0 * turns, 16.0 * turns] {
            if last > fastest {
                continue;
            }
            let chirp = |part: f64| sine(turns * part + 0.5 * (last - turns) * part * part);
            list.push(DesignedDrive::wave(format!("chirp from {n} to {last} periods per record"), limits, chirp));
            let both = |part: f64| 0.5 * (sine(turns * part) + sine(last * part));
            list.push(DesignedDrive::wave(format!("two sines with {n} and {last} periods"), limits, both));
        }
        for ratio in [1.5_f64, 2.0, 3.0] {
            let parts: Vec<f64> = (0..n.min(12)).map(|k| ratio.powi(k as i32)).collect();
            let sum: f64 = parts.iter().sum();
            let holds = parts.iter().enumerate().map(|(k, part)| [part / sum, sign(k)]).collect();
            let words = format!("{} holds of alternating sign, each {ratio} times as long as the last", parts.len());
            list.push(DesignedDrive::new(words, holds));
        }
    }
    for part in [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9] {
        let holds = vec![[part, 1.0], [1.0 - part, 0.0]];
        let words = format!("hold for {:.0} % of the time, then recovery", 100.0 * part);
        list.push(DesignedDrive::new(words, holds));
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for n in [3_usize, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32] {
        for _ in 0..N_RANDOM {
            let cuts = random_parts(&mut random, n);
            let levels = [-1.0, -0.5, 0.0, 0.5, 1.0];
            let holds =
                cuts.into_iter().map(|part| [part, levels[(5.0 * random.random::<f64>()) as usize % 5]]).collect();
            list.push(DesignedDrive::new(format!("random telegraph of {n} holds"), holds));
        }
    }
    list.retain(|drive| drive.is_possible(limits));
    if limits.directions == ForceDirections::Negative {
        // Most protocols begin in the positive direction.
        list.iter_mut().flat_map(|drive| &mut drive.holds).for_each(|hold| hold[1] = -hold[1]);
    }
    let possible = list.into_iter().map(|drive| drive.in_directions(limits.directions));
    possible.filter(DesignedDrive::acts).collect()
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
        directions: ForceDirections::Both,
    };

    fn shortest_hold_s(record: &Record) -> f64 {
        let changes = (1..record.n_rows()).filter(|row| record.force_n[*row] != record.force_n[row - 1]);
        let changes: Vec<f64> = changes.map(|row| record.time_s[row]).collect();
        changes.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn every_protocol_stays_within_its_limits() {
        let list = family(&LIMITS, 1);
        assert!(list.len() > 300, "{}", list.len());
        assert!(list.iter().any(|drive| drive.words.starts_with("chirp")));
        for drive in &list {
            let record = drive.record(&LIMITS, LIMITS.interval_s);
            assert_eq!(record.n_rows(), 801);
            let largest = record.force_n.iter().fold(0.0_f64, |most, force| most.max(force.abs()));
            assert!(largest > 0.0, "{}", drive.words);
            assert!(largest <= LIMITS.largest_force_n * (1.0 + 1e-12), "{}: {largest} N", drive.words);
            let shortest_s = shortest_hold_s(&record);
            assert!(shortest_s >= LIMITS.shortest_hold_s - 0.051, "{}: a hold of {shortest_s} s", drive.words);
        }
        assert_eq!(list, family(&LIMITS, 1));
    }

    #[test]
    fn an_apparatus_of_one_direction_gets_no_other_force() {
        let limits = DesignLimits { directions: ForceDirections::Negative, ..LIMITS };
        let list = family(&limits, 1);
        let forces = |drive: &DesignedDrive| drive.record(&limits, limits.interval_s).force_n;
        let improved = list.iter().flat_map(|drive| drive.neighbours(&limits)).collect::<Vec<_>>();
        assert!(improved.len() > list.len());
        assert!(list.iter().chain(&improved).flat_map(forces).all(|force_n| force_n <= 0.0));
        for drives in [&list, &improved] {
            let pulls = drives.iter().filter(|drive| forces(drive).contains(&-LIMITS.largest_force_n)).count();
            assert!(2 * pulls > drives.len(), "{pulls} of {}", drives.len());
        }
    }

    #[test]
    fn a_sine_in_holds_follows_the_sine() {
        let record = DesignedDrive::wave("sine", &LIMITS, |part| (4.0 * PI * part).sin()).record(&LIMITS, 0.05);
        assert!((shortest_hold_s(&record) - LIMITS.shortest_hold_s).abs() < 1e-9);
        for (time_s, force_n) in record.time_s.iter().zip(&record.force_n).take(800) {
            // The slope times the largest distance from the middle of a hold, which is half a hold.
            let sine = (4.0 * PI * time_s / LIMITS.duration_s).sin();
            assert!((force_n / LIMITS.largest_force_n - sine).abs() <= 4.0 * PI / 160.0 + 1e-9, "{time_s} s");
        }
    }

    #[test]
    fn intervals_are_those_of_the_apparatus() {
        let limits = DesignLimits { interval_s: 0.3, ..LIMITS };
        let record = family(&limits, 1)[0].record(&limits, limits.interval_s);
        assert!((record.time_s[1] - 0.3).abs() < 1e-12 && *record.time_s.last().expect("rows") <= 40.0);
    }

    #[test]
    fn a_protocol_is_continued_by_a_rest_by_itself_and_by_its_opposite() {
        let drive = DesignedDrive::equal_holds("holds", [1.0, 0.5]);
        let levels = |drive: &DesignedDrive| drive.holds.iter().map(|hold| hold[1]).collect::<Vec<f64>>();
        let [rest, again, opposite] = drive.continued(0.5).try_into().expect("three");
        assert_eq!(rest.holds, [[0.25, 1.0], [0.25, 0.5], [0.5, 0.0]]);
        assert_eq!(levels(&again), [1.0, 0.5, 1.0, 0.5]);
        assert_eq!(levels(&opposite), [1.0, 0.5, -1.0, -0.5]);
        let thrice = drive.continued(0.3).remove(1);
        assert_eq!(levels(&thrice), [1.0, 0.5, 1.0, 0.5, 1.0, 0.5]);
        for drive in [again, opposite, thrice] {
            assert!((drive.holds.iter().map(|hold| hold[0]).sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn words_are_those_of_the_sampled_holds() {
        let drive = DesignedDrive::new("", vec![[0.113, 1.0], [0.25, 1.0], [0.637, -0.5]]);
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
        let drive = DesignedDrive::equal_holds("holds", [1.0, -1.0, 0.0]);
        let list = drive.neighbours(&LIMITS);
        assert!(list.len() >= 12, "{}", list.len());
        for other in list {
            assert!((other.holds.iter().map(|hold| hold[0]).sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
