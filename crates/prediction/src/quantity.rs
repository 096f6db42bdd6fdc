//! Quantities of interest of a trajectory.

use base::error::Result;
use base::toml_input::TomlTable;
use documents::prediction::PredictedQuantity;
use figures::density::quantile_of_sorted;
use figures::number::format_significant;
use record::Record;

const UM_PER_M: f64 = 1e6;
/// Part of the time before the end of a window over which a speed is taken.
const SPEED_WINDOW: f64 = 0.1;
/// Largest time from a change of the force to the row after it, as a part of the prediction's duration. The rows closer together resolve no time.
const JUMP: f64 = 2e-6;

/// Quantity of interest, with the event whose probability is asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Quantity {
    /// Position at a time. Event: it is at least `at_least_m`, or at most if that is negative.
    PositionAt {
        /// Time in s.
        at_s: f64,
        /// Position of the event in m; `None` for no event.
        at_least_m: Option<f64>,
    },
    /// Time at which the position first reaches a distance. Event: it is reached by `within_s`, or at all.
    TimeToReach {
        /// Distance in m; negative against the positive force.
        distance_m: f64,
        /// Time of the event in s; `None` for the whole scenario.
        within_s: Option<f64>,
    },
    /// Mean speed over the last tenth of the time before `at_s`.
    Speed {
        /// Time in s.
        at_s: f64,
    },
    /// Largest principal strain of the gel beside the robot, for linear displacement fields.
    PeakStrain,
    /// Share of the displacement at the last release of the force that has returned at the end.
    Return,
}

impl Quantity {
    /// Reads a table `[[scenario.quantity]]`.
    ///
    /// # Errors
    /// [`base::Error::Input`] with the key if the kind is unknown, or if a number is missing or does not suit the kind.
    pub fn read(table: TomlTable<'_>) -> Result<Self> {
        table.only(&["kind", "at_s", "distance_um"])?;
        let time = |example| table.positive("at_s", example);
        let kind = table.required_text("kind", "kind = \"position_at\"")?;
        let refuse_unused = |keys: &[&str]| match keys.iter().find(|key| table.has(key)) {
            Some(key) => Err(table.refuse(key, format!("`{kind}` has no `{key}`"), "remove this line")),
            None => Ok(()),
        };
        match kind.as_str() {
            "position_at" => Ok(Self::PositionAt {
                at_s: table.required_positive("at_s", "at_s = 3.0")?,
                at_least_m: table.number("distance_um")?.map(|um| um / UM_PER_M),
            }),
            "time_to_reach" => {
                let distance_um = table.required_number("distance_um", "distance_um = 1000")?;
                if distance_um == 0.0 {
                    return Err(table.refuse("distance_um", "the robot begins at 0 µm", "give another distance"));
                }
                Ok(Self::TimeToReach { distance_m: distance_um / UM_PER_M, within_s: time("at_s = 3.0")? })
            }
            "speed" => {
                refuse_unused(&["distance_um"])?;
                Ok(Self::Speed { at_s: table.required_positive("at_s", "at_s = 3.0")? })
            }
            "peak_strain" => refuse_unused(&["at_s", "distance_um"]).map(|()| Self::PeakStrain),
            "return" => refuse_unused(&["at_s", "distance_um"]).map(|()| Self::Return),
            _ => Err(table.refuse(
                "kind",
                format!("unknown quantity `{kind}`"),
                "use \"position_at\", \"time_to_reach\", \"speed\", \"peak_strain\" or \"return\"",
            )),
        }
    }

    /// Times (s) at which the quantity needs rows of the prediction, in ascending order.
    pub fn times_s(&self) -> Vec<f64> {
        match *self {
            Self::PositionAt { at_s, .. } => vec![at_s],
            Self::Speed { at_s } => vec![(1.0 - SPEED_WINDOW) * at_s, at_s],
            Self::TimeToReach { within_s, .. } => within_s.into_iter().collect(),
            Self::PeakStrain | Self::Return => Vec::new(),
        }
    }

    /// Name in documents.
    pub fn name(&self) -> &'static str {
        match self {
            Self::PositionAt { .. } => "position_at_s",
            Self::TimeToReach { .. } => "time_to_reach_um",
            Self::Speed { .. } => "speed_at_s",
            Self::PeakStrain => "peak_strain",
            Self::Return => "return",
        }
    }

    /// Name with the time or distance, for people.
    pub fn label(&self) -> String {
        match self {
            Self::PositionAt { at_s, .. } => format!("position at {} s", plain(*at_s)),
            Self::TimeToReach { distance_m, .. } => {
                format!("time to reach {} µm", plain(UM_PER_M * distance_m))
            }
            Self::Speed { at_s } => format!("speed at {} s", plain(*at_s)),
            Self::PeakStrain => "peak strain".into(),
            Self::Return => "return after release".into(),
        }
    }

    /// Unit of the values.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::PositionAt { .. } => "um",
            Self::TimeToReach { .. } => "s",
            Self::Speed { .. } => "um/s",
            Self::PeakStrain | Self::Return => "1",
        }
    }

    /// Value of the quantity for a trajectory (m at every row of `record`); infinite for a distance that is never reached. `strain_per_m` is the
    /// largest strain divided by the displacement.
    pub fn value(&self, record: &Record, position_m: &[f64], strain_per_m: f64) -> f64 {
        match *self {
            Self::PositionAt { at_s, .. } => UM_PER_M * position_at_m(record, position_m, at_s),
            Self::TimeToReach { distance_m, .. } => time_to_reach_s(record, position_m, distance_m),
            Self::Speed { at_s } => {
                let from_s = (1.0 - SPEED_WINDOW) * at_s;
                let moved_m = position_at_m(record, position_m, at_s) - position_at_m(record, position_m, from_s);
                UM_PER_M * moved_m / (at_s - from_s)
            }
            Self::PeakStrain => strain_per_m * position_m.iter().fold(0.0_f64, |most, x| most.max(x.abs())),
            Self::Return => {
                let released_m = last_release(record).map_or(f64::NAN, |row| position_m[row]);
                1.0 - position_m[position_m.len() - 1] / released_m
            }
        }
    }

    /// True if the event of this quantity occurs, given its value; `None` without an event.
    pub fn occurs(&self, value: f64) -> Option<bool> {
        match *self {
            Self::PositionAt { at_least_m: Some(least_m), .. } => {
                Some(if least_m < 0.0 { value <= UM_PER_M * least_m } else { value >= UM_PER_M * least_m })
            }
            Self::TimeToReach { within_s, .. } => Some(value <= within_s.unwrap_or(f64::MAX)),
            _ => None,
        }
    }

    /// Summarises the values of all draws. `end_s` is the end of the prediction: robots that have not arrived by then arrive later.
    pub fn summary(&self, values: &[f64], end_s: f64) -> PredictedQuantity {
        let mut ascending = values.to_vec();
        ascending.sort_by(f64::total_cmp);
        let quantile =
            |probability| Some(quantile_of_sorted(&ascending, probability)).filter(|value| value.is_finite());
        let [q05, median, q95] = [0.05, 0.5, 0.95].map(quantile);
        let events: Vec<bool> = values.iter().filter_map(|value| self.occurs(*value)).collect();
        let share = |events: &[bool]| events.iter().filter(|event| **event).count() as f64 / events.len() as f64;
        let probability = (!events.is_empty()).then(|| share(&events));
        let at = match *self {
            Self::PositionAt { at_s, .. } | Self::Speed { at_s } => Some(at_s),
            Self::TimeToReach { distance_m, .. } => Some(UM_PER_M * distance_m),
            Self::PeakStrain | Self::Return => None,
        };
        PredictedQuantity {
            name: self.name().into(),
            at,
            unit: self.unit().into(),
            median,
            q05,
            q95,
            probability,
            probability_se: probability.map(|p| (p * (1.0 - p) / events.len() as f64).sqrt()),
            sentence: self.sentence([q05, median, q95], probability, end_s),
        }
    }

    fn sentence(&self, quantiles: [Option<f64>; 3], probability: Option<f64>, end_s: f64) -> String {
        let later = match self {
            Self::TimeToReach { .. } => format!("later than {} s or never", plain(end_s)),
            _ => "no value".into(),
        };
        let shown = |value: Option<f64>| value.map_or_else(|| later.clone(), |value| format_significant(value, 4));
        let unit = match self.unit() {
            "1" => String::new(),
            unit => format!(" {}", unit.replace("um", "µm")),
        };
        let [q05, median, q95] = quantiles.map(shown);
        let value = match quantiles[1] {
            None if quantiles[0].is_none() => format!("{}: {later}", self.label()),
            None => format!("{}: {later} in the median draw (5 % quantile {q05}{unit})", self.label()),
            Some(_) => format!("{}: {median}{unit} (90 %: {q05} to {q95})", self.label()),
        };
        let event = match (self, probability) {
            (Self::PositionAt { at_least_m: Some(m), .. }, Some(p)) => {
                let bound = if *m < 0.0 { "at most" } else { "at least" };
                format!("; {bound} {} µm in {} % of draws", plain(UM_PER_M * m), percent(p))
            }
            (Self::TimeToReach { within_s, .. }, Some(p)) => {
                format!("; within {} s in {} % of draws", plain(within_s.unwrap_or(end_s)), percent(p))
            }
            _ => String::new(),
        };
        format!("{value}{event}")
    }
}

/// Probability in percent, for people.
pub fn percent(probability: f64) -> String {
    format!("{:.1}", 100.0 * probability)
}

/// A number that the user has given, without trailing zeros.
pub fn plain(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// A number with ten significant digits, as files for a controller have them.
pub fn ten_digits(number: f64) -> f64 {
    format!("{number:.9e}").parse().unwrap_or(number)
}

/// Position (m) at a time, by a straight line between rows.
fn position_at_m(record: &Record, position_m: &[f64], at_s: f64) -> f64 {
    let time_s = &record.time_s;
    let next = time_s.partition_point(|time| *time < at_s).min(time_s.len() - 1);
    if next == 0 {
        return position_m[0];
    }
    let share = (at_s - time_s[next - 1]) / (time_s[next] - time_s[next - 1]);
    position_m[next - 1] + share * (position_m[next] - position_m[next - 1])
}

/// First time (s) at which a trajectory reaches a distance, by a straight line between rows; infinite if it does not.
pub fn time_to_reach_s(record: &Record, position_m: &[f64], distance_m: f64) -> f64 {
    let along = |x: f64| x / distance_m;
    match position_m.iter().position(|x| along(*x) >= 1.0) {
        None => f64::INFINITY,
        Some(0) => record.time_s[0],
        Some(row) => {
            let (before, after) = (along(position_m[row - 1]), along(position_m[row]));
            let share = (1.0 - before) / (after - before);
            // The first row after a change of the force follows at once: a motion that reaches the distance there is a jump.
            let interval_s = record.time_s[row] - record.time_s[row - 1];
            let is_jump = interval_s < JUMP * record.time_s[record.time_s.len() - 1];
            record.time_s[row - 1] + if is_jump { 0.0 } else { share * interval_s }
        }
    }
}

/// Row from which the force is zero until the end of the record; `None` if the force is not zero at the end, or only in the last row.
pub fn last_release(record: &Record) -> Option<usize> {
    let force_n = &record.force_n;
    let row = force_n.iter().rposition(|force| *force != 0.0)? + 1;
    (row + 1 < force_n.len()).then_some(row)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force_history::ForceHistory;

    /// A gel that jumps by 1 µm and then creeps reaches 0.5 µm at once, and 2 µm later.
    #[test]
    fn a_jump_reaches_its_distance_at_once() {
        let record = ForceHistory::Steps(vec![[0.0, 0.0], [1.0, 1e-6]]).record(5.0, &[]).expect("a record");
        let position_m: Vec<f64> =
            record.time_s.iter().map(|t| if *t <= 1.0 { 0.0 } else { 1e-6 * (1.0 + (t - 1.0)) }).collect();
        assert_eq!(time_to_reach_s(&record, &position_m, 0.5e-6), 1.0);
        assert!((time_to_reach_s(&record, &position_m, 2e-6) - 2.0).abs() < 1e-3);
    }

    #[test]
    fn quantities_of_a_known_motion_have_their_closed_forms() {
        // 2 µm/s for 5 s, then back at 1 µm/s for 2 s.
        let record = ForceHistory::Steps(vec![[0.0, 1e-6], [5.0, 0.0]]).record(7.0, &[]).expect("a record");
        let position_m: Vec<f64> =
            record.time_s.iter().map(|t| if *t < 5.0 { 2e-6 * t } else { 10e-6 - 1e-6 * (t - 5.0) }).collect();
        let value = |quantity: Quantity| quantity.value(&record, &position_m, 3e3);
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found} is not {expected}");
        near(value(Quantity::PositionAt { at_s: 3.21, at_least_m: None }), 6.42);
        near(value(Quantity::TimeToReach { distance_m: 7.3e-6, within_s: None }), 3.65);
        assert_eq!(value(Quantity::TimeToReach { distance_m: 11e-6, within_s: None }), f64::INFINITY);
        near(value(Quantity::Speed { at_s: 4.0 }), 2.0);
        near(value(Quantity::PeakStrain), 0.03);
        near(value(Quantity::Return), 0.2);
    }

    #[test]
    fn draws_that_never_arrive_are_counted_and_have_no_quantile() {
        let quantity = Quantity::TimeToReach { distance_m: 1e-3, within_s: Some(3.0) };
        let summary = quantity.summary(&[1.0, 2.0, 4.0, f64::INFINITY], 5.0);
        assert_eq!((summary.probability, summary.q95), (Some(0.5), None));
        assert!(
            summary.median.is_some() && summary.sentence.contains("within 3 s in 50.0 % of draws"),
            "{}",
            summary.sentence
        );
        assert!(summary.sentence.contains("(90 %: 1.150 to later than 5 s or never)"), "{}", summary.sentence);
    }

    /// A draw that has not arrived at the end of the prediction arrives later, as far as the prediction knows.
    #[test]
    fn arrivals_after_the_end_are_later_than_it() {
        let quantity = Quantity::TimeToReach { distance_m: 1e-3, within_s: None };
        let sentence = |values: &[f64]| quantity.summary(values, 3.0).sentence;
        assert_eq!(
            sentence(&[f64::INFINITY; 2]),
            "time to reach 1000 µm: later than 3 s or never; within 3 s in 0.0 % of draws"
        );
        let most = sentence(&[2.9, 2.95, f64::INFINITY, f64::INFINITY, f64::INFINITY]);
        assert!(most.contains("later than 3 s or never in the median draw"), "{most}");
    }
}
