//! Characteristic sizes of an experiment, which scale the default priors of effects (physics §5).

use super::{Apparatus, Control, Experiment};

/// Characteristic forces, times and lengths of an experiment.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CharacteristicSizes {
    /// Largest absolute value of the commanded force, in N.
    pub largest_force_n: f64,
    /// Largest minus smallest measured position, in m; 0 if no position was measured.
    pub position_range_m: f64,
    /// Median time between force steps, in s; the record's duration if there are no steps.
    pub hold_s: f64,
    /// Median time between rows, in s.
    pub sample_interval_s: f64,
    /// Mean duration of a cycle, in s.
    pub cycle_s: f64,
    /// Duration of the record, in s.
    pub duration_s: f64,
    /// Poisson ratio of the vitreous; `None` for an instrument.
    pub poisson_ratio: Option<f64>,
    /// Radius of the robot, or of the sphere of equal volume, in m; `None` for an instrument.
    pub robot_radius_m: Option<f64>,
    /// Radius of the robot whose record taught the law, in m, to which the law's own stresses refer; `None` for an instrument.
    pub taught_radius_m: Option<f64>,
    /// Radius of the vitreous, in m; `None` for an instrument.
    pub outer_radius_m: Option<f64>,
    /// Exponent p of an indenter, whose depth to the power p responds linearly to the force. `None` for other apparatus, whose position itself
    /// responds linearly.
    pub depth_exponent: Option<f64>,
    /// True if the recorded position has an unknown offset, which models fit.
    pub fits_position_offset: bool,
    /// True if the position is commanded and the force is measured.
    pub is_position_controlled: bool,
}

impl Experiment {
    /// Computes the characteristic forces, times and lengths of the experiment.
    pub fn scales(&self) -> CharacteristicSizes {
        let record = &self.record;
        let positions = || record.position_m.iter().flatten().copied();
        let (lowest, highest) =
            (positions().fold(f64::INFINITY, f64::min), positions().fold(f64::NEG_INFINITY, f64::max));
        let duration_s = match (record.time_s.first(), record.time_s.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        };
        let steps_s: Vec<f64> = record.force_step_rows().iter().map(|&row| record.time_s[row]).collect();
        let between_s = steps_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let body = match &self.apparatus {
            Apparatus::Robot { robot, vitreous } => Some((robot, vitreous)),
            Apparatus::Instrument { .. } | Apparatus::Indenter(_) => None,
        };
        CharacteristicSizes {
            largest_force_n: record.force_n.iter().fold(0.0_f64, |largest, force| largest.max(force.abs())),
            position_range_m: if highest > lowest { highest - lowest } else { 0.0 },
            hold_s: super::robust::median(between_s).unwrap_or(duration_s),
            sample_interval_s: record.median_interval_s().unwrap_or(duration_s),
            cycle_s: duration_s / f64::from(record.n_cycles().max(1)),
            duration_s,
            poisson_ratio: body.map(|(_, vitreous)| vitreous.poisson_ratio),
            robot_radius_m: body.map(|(robot, _)| robot.shape.equivalent_radius_m()),
            taught_radius_m: body.map(|(robot, _)| robot.shape.equivalent_radius_m()),
            outer_radius_m: body.map(|(_, vitreous)| 0.5 * vitreous.diameter_m),
            depth_exponent: match &self.apparatus {
                Apparatus::Indenter(indenter) => Some(indenter.exponent()),
                Apparatus::Robot { .. } | Apparatus::Instrument { .. } => None,
            },
            fits_position_offset: self.fits_position_offset,
            is_position_controlled: self.control == Control::Position,
        }
    }
}
