//! Changed protocols derived from the user's own protocol, with equal length, an equal number of cycles, and no larger force.

use crate::{ForceRule, Record};

/// A changed protocol, with the instruction for the change.
#[derive(Debug, Clone)]
pub struct Change {
    /// Instruction for the change, as a sentence without its full stop.
    pub instruction: String,
    /// Times, forces and cycles of the changed protocol; the positions are placeholders.
    pub record: Record,
}

/// Largest number of rows of a changed protocol.
const MOST_ROWS: usize = 20_000;
/// Difference of times, as a fraction of the sample interval, below which they count as equal.
const SAME_TIME: f64 = 1e-6;
/// Fraction of the largest force below which a force counts as none.
const NO_FORCE: f64 = 0.01;

/// A time in the record, with its cycle.
struct CycleTime {
    time_s: f64,
    /// Index of the time's cycle in the record, from 0.
    cycle: usize,
    /// Start of the cycle, in s.
    start_s: f64,
    length_s: f64,
}

impl CycleTime {
    /// Returns the time (s) at which the force is read. The cycle runs `factor` times as fast and repeats until the end of the original cycle.
    fn faster(&self, factor: f64) -> f64 {
        self.start_s + (factor * (self.time_s - self.start_s)).rem_euclid(self.length_s)
    }

    /// Elapsed fraction of the cycle.
    fn phase(&self) -> f64 {
        (self.time_s - self.start_s) / self.length_s
    }

    fn is_second(&self) -> bool {
        self.cycle % 2 == 1
    }
}

/// The user's protocol.
struct Protocol<'a> {
    record: &'a Record,
    interval_s: f64,
    /// First row of each cycle.
    starts: Vec<usize>,
}

impl Protocol<'_> {
    fn end_s(&self) -> f64 {
        self.record.time_s.last().copied().unwrap_or(0.0) + self.interval_s
    }

    /// Returns the row whose commanded force holds at a time.
    fn row_at(&self, time_s: f64) -> usize {
        let tolerance_s = SAME_TIME * self.interval_s;
        self.record.time_s.partition_point(|t| *t <= time_s + tolerance_s).saturating_sub(1)
    }

    /// Returns a record with evenly sampled rows. For each row, `force` returns the factor of the force and the time at which the force is read from the current protocol.
    fn altered(&self, interval_s: f64, force: impl Fn(&CycleTime) -> (f64, f64)) -> Record {
        let begin_s = self.record.time_s.first().copied().unwrap_or(0.0);
        let n_rows = ((self.end_s() - begin_s) / interval_s).round() as usize;
        let rule = self.record.force_rule;
        let mut made = Record { position_m: vec![Some(0.0); n_rows], force_rule: rule, ..Record::default() };
        for i in 0..n_rows {
            let time_s = begin_s + i as f64 * interval_s;
            let row = self.row_at(time_s);
            let cycle = self.starts.partition_point(|start| *start <= row).saturating_sub(1);
            let start_s = self.record.time_s[self.starts[cycle]];
            let end_s = self.starts.get(cycle + 1).map_or(self.end_s(), |next| self.record.time_s[*next]);
            let (factor, at_s) = force(&CycleTime { time_s, cycle, start_s, length_s: end_s - start_s });
            made.time_s.push(time_s);
            let force_n = match rule {
                ForceRule::Hold => self.record.force_n[self.row_at(at_s)],
                ForceRule::Linear => self.record.force().at_n(&self.record.time_s, at_s),
            };
            made.force_n.push(factor * force_n);
            made.cycle.push(self.record.cycle[row]);
        }
        made
    }
}

/// Returns protocols with other signs, levels, holds, rests and sampling, except those equal to the current one.
pub fn changes(record: &Record, hold_s: f64) -> Vec<Change> {
    let Some(interval_s) = record.median_interval_s().filter(|interval_s| *interval_s > 0.0) else { return Vec::new() };
    let starts: Vec<usize> =
        (0..record.n_rows()).filter(|row| *row == 0 || record.cycle[*row] != record.cycle[row - 1]).collect();
    let n_cycles = starts.len();
    let protocol = Protocol { record, interval_s, starts };
    let n_rows = (protocol.end_s() - record.time_s[0]) / interval_s;
    if n_rows > MOST_ROWS as f64 {
        return Vec::new();
    }
    let mut list = Vec::new();
    of_levels(&protocol, n_cycles, &mut list);
    of_signs(&protocol, n_cycles, &mut list);
    of_times(&protocol, hold_s, &mut list);
    for times in [2.0, 4.0] {
        if times * n_rows <= MOST_ROWS as f64 {
            let every_s = interval_s / times;
            let record = protocol.altered(every_s, |moment| (1.0, moment.time_s));
            list.push(Change {
                instruction: format!("Sample {times} times as fast, every {}", seconds(every_s)),
                record,
            });
        }
    }
    let evenly = protocol.altered(interval_s, |moment| (1.0, moment.time_s));
    list.retain(|change| change.record != evenly);
    list
}

fn of_levels(protocol: &Protocol, n_cycles: usize, list: &mut Vec<Change>) {
    let largest_n = protocol.record.force_n.iter().fold(0.0_f64, |largest, force| largest.max(force.abs()));
    let level = |part: f64| format!("{} µN", short(1e6 * part * largest_n));
    let mut add = |instruction: String, force: &dyn Fn(&CycleTime) -> (f64, f64)| {
        list.push(Change { instruction, record: protocol.altered(protocol.interval_s, force) });
    };
    if n_cycles > 1 {
        add(format!("Use half the force ({}) in every second cycle", level(0.5)), &|moment| {
            (if moment.is_second() { 0.5 } else { 1.0 }, moment.time_s)
        });
    }
    if n_cycles > 2 {
        add(
            format!(
                "Use the full, half and three quarters of the force ({}, {}, {}) in turn, one cycle each",
                level(1.0),
                level(0.5),
                level(0.75)
            ),
            &|moment| ([1.0, 0.5, 0.75][moment.cycle % 3], moment.time_s),
        );
    }
    add(format!("Run each cycle twice as fast, then again with half the force ({})", level(0.5)), &|moment| {
        (if moment.phase() >= 0.5 - SAME_TIME { 0.5 } else { 1.0 }, moment.faster(2.0))
    });
}

fn of_signs(protocol: &Protocol, n_cycles: usize, list: &mut Vec<Change>) {
    let force_n = &protocol.record.force_n;
    let (lowest, highest) = force_n.iter().fold((0.0_f64, 0.0_f64), |(low, high), f| (low.min(*f), high.max(*f)));
    let none_n = NO_FORCE * highest.max(-lowest);
    let has_both = lowest < -none_n && highest > none_n;
    if has_both {
        let instruction = "Pull in one direction only, with a rest in place of the opposite force".to_string();
        let sign = |time_s: f64| if force_n[protocol.row_at(time_s)] < 0.0 { 0.0 } else { 1.0 };
        let record = protocol.altered(protocol.interval_s, |moment| (sign(moment.time_s), moment.time_s));
        list.push(Change { instruction, record });
    } else if n_cycles > 1 {
        let instruction = "Reverse the force in every second cycle".to_string();
        let record = protocol
            .altered(protocol.interval_s, |moment| (if moment.is_second() { -1.0 } else { 1.0 }, moment.time_s));
        list.push(Change { instruction, record });
    }
}

fn of_times(protocol: &Protocol, hold_s: f64, list: &mut Vec<Change>) {
    let begin_s = protocol.record.time_s[0];
    let mut add = |instruction: String, force: &dyn Fn(&CycleTime) -> (f64, f64)| {
        list.push(Change { instruction, record: protocol.altered(protocol.interval_s, force) });
    };
    add(format!("Hold half as long ({}), twice as often", seconds(0.5 * hold_s)), &|moment| (1.0, moment.faster(2.0)));
    add(
        format!("Hold a quarter as long ({}), four times as often, in every second cycle", seconds(0.25 * hold_s)),
        &|moment| (1.0, if moment.is_second() { moment.faster(4.0) } else { moment.time_s }),
    );
    add(format!("Hold twice as long ({}), half as often", seconds(2.0 * hold_s)), &|moment| {
        (1.0, begin_s + 0.5 * (moment.time_s - begin_s))
    });
    add(
        "Rest without force in the last third of every cycle, and run the commanded cycle in the other two thirds"
            .into(),
        &|moment| {
            let is_rest = moment.phase() >= 2.0 / 3.0 - SAME_TIME;
            (
                if is_rest { 0.0 } else { 1.0 },
                moment.start_s + 1.5 * (moment.time_s - moment.start_s).min(0.66 * moment.length_s),
            )
        },
    );
}

fn seconds(time_s: f64) -> String {
    format!("{} s", short(time_s))
}

/// Writes a value with three significant digits, without trailing zeros.
fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = (2 - value.abs().log10().floor() as i32).max(0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_short() {
        assert_eq!([0.025, 2.3, 3.45, 10.0, 120.0, 0.0].map(short), ["0.025", "2.3", "3.45", "10", "120", "0"]);
    }
}
