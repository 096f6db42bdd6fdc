//! Settings of a design, and the limits that follow from them.

use std::path::PathBuf;

use base::error::{Error, InputPlace, Result};
use criticism::protocol::{DesignLimits, ForceDirections};
use figures::number::format_significant;
use prediction::free_path::free_path_m;
use record::{Apparatus, Experiment};
use sampling::SamplerOptions;

base::named_enum! {
    /// Purpose of a design.
    pub enum DesignGoal {
        /// Smallest uncertainty of the model's parameters.
        Parameters = "parameters",
        /// Largest distance between the equivalent effects of the last diagnosis.
        Effects = "effects",
        /// Smallest detectable sizes of the effects that the model lacks.
        Detection = "detection",
        /// Smallest uncertainty of the first quantity of the first scenario.
        Decision = "decision",
    }
    /// Name in documents.
    pub fn name
}

/// Settings of a design. A limit of `None` is that of the present record.
pub struct DesignRequest {
    /// Purpose; `None` for a decision if a scenario is given, for the effects if a diagnosis could not distinguish some, and otherwise for the parameters.
    pub goal: Option<DesignGoal>,
    /// File whose first scenario has the quantity of a decision.
    pub scenario: Option<PathBuf>,
    /// Duration of the new record, in s.
    pub budget_s: Option<f64>,
    /// Largest force, in N.
    pub largest_force_n: Option<f64>,
    /// Time between samples, in s.
    pub interval_s: Option<f64>,
    /// Shortest time for which a force is held, in s.
    pub shortest_hold_s: Option<f64>,
    /// Largest distance from the start, in m. The robot's distance from the outer surface of the gel bounds it.
    pub largest_position_m: Option<f64>,
    /// True to allow both directions of the force even if the present record has one.
    pub both_directions: bool,
    /// Directories of later records of the specimen, on the same apparatus.
    pub after: Vec<PathBuf>,
    /// Sampler settings for a first revision; the seed also serves the search.
    pub sampler: SamplerOptions,
}

/// Distance in m after which the robot touches the outer surface of the gel; `None` for an instrument.
pub fn free_distance_m(experiment: &Experiment) -> Option<f64> {
    match &experiment.apparatus {
        Apparatus::Robot { robot, vitreous } => Some(free_path_m(robot, vitreous)),
        _ => None,
    }
}

/// Limits of the new record: those of the present one where the request gives none. No displacement limit is beyond the outer surface of the gel.
pub fn limits(experiment: &Experiment, farthest_m: f64, request: &DesignRequest) -> Result<DesignLimits> {
    let interval_s = request.interval_s.or(experiment.record.median_interval_s()).unwrap_or(0.0);
    let scales = experiment.scales();
    let duration_s = request.budget_s.unwrap_or(scales.duration_s + interval_s);
    let largest_force_n = request.largest_force_n.unwrap_or(scales.largest_force_n);
    let shortest_hold_s = request.shortest_hold_s.unwrap_or(4.0 * interval_s);
    if !(interval_s > 0.0 && duration_s >= 20.0 * interval_s && largest_force_n > 0.0) {
        return Err(Error::input(
            InputPlace::default().at_key("limits"),
            format!(
                "no protocol has room in a record of {} s with a sample every {} s and at most {} µN",
                format_significant(duration_s, 4),
                format_significant(interval_s, 4),
                format_significant(1e6 * largest_force_n, 4)
            ),
            "give a force above 0, and a duration of at least 20 samples; the time between samples is that of the table unless it is given",
        ));
    }
    if duration_s / interval_s > MOST_ROWS {
        return Err(Error::input(
            InputPlace::default().at_key("limits"),
            format!("the new record would have {:.0} rows", duration_s / interval_s),
            format!("give a longer interval or a shorter duration: the limit is {MOST_ROWS} rows"),
        ));
    }
    let largest_position_m = request.largest_position_m.unwrap_or(BEYOND * farthest_m);
    let largest_position_m = free_distance_m(experiment).map_or(largest_position_m, |m| m.min(largest_position_m));
    let has = |is_direction: fn(&f64) -> bool| experiment.record.force_n.iter().any(is_direction);
    let directions = match (has(|force_n| *force_n > 0.0), has(|force_n| *force_n < 0.0)) {
        (true, false) if !request.both_directions => ForceDirections::Positive,
        (false, true) if !request.both_directions => ForceDirections::Negative,
        _ => ForceDirections::Both,
    };
    let limits =
        DesignLimits { largest_force_n, duration_s, interval_s, shortest_hold_s, largest_position_m, directions };
    Ok(limits.lasting(duration_s))
}

/// Largest distance of a designed record from its start, relative to that of the present record, unless it is given.
const BEYOND: f64 = 1.05;
/// Largest number of rows of a designed record of the recommended duration.
const MOST_ROWS: f64 = 10_000.0;

#[cfg(test)]
mod tests {
    use super::*;
    use posterior::replica;

    /// The replica's bead of 0.55 mm touches the outer surface of its gel of 20 mm after 9.725 mm.
    #[test]
    fn no_displacement_limit_is_beyond_the_outer_surface() {
        let (experiment, _) = replica::embedded().expect("the replica");
        let largest_m = |largest_position_m: Option<f64>, farthest_m: f64| {
            let request = DesignRequest {
                goal: None,
                scenario: None,
                budget_s: None,
                largest_force_n: None,
                interval_s: None,
                shortest_hold_s: None,
                largest_position_m,
                both_directions: false,
                after: Vec::new(),
                sampler: SamplerOptions::default(),
            };
            limits(&experiment, farthest_m, &request).expect("limits").largest_position_m
        };
        assert!((largest_m(Some(0.1), 1e-3) - 9.725e-3).abs() < 1e-12);
        assert!((largest_m(None, 12e-3) - 9.725e-3).abs() < 1e-12);
        assert_eq!([largest_m(Some(2e-3), 1e-3), largest_m(None, 1e-3)], [2e-3, BEYOND * 1e-3]);
    }
}
