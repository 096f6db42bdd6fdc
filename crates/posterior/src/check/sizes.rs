//! Checks of the robot's and the gel's sizes against the motion.

use super::{CheckContext, found, um};
use documents::check::Contradiction;
use figures::number::format_significant;
use record::Apparatus;

/// Smallest and largest possible Young's modulus of the gel, in Pa.
const MODULI_PA: [f64; 2] = [1e-3, 1e7];
/// Largest possible Young's modulus of a specimen in an instrument, in Pa: a testing machine also holds tendon, polymers and wood.
const STIFFEST_PA: f64 = 1e12;

/// Finds a displacement that no gel allows for a robot of this size.
pub(super) fn no_gel(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let largest_n = looked.record.force_n.iter().fold(0.0_f64, |largest, force| largest.max(force.abs()));
    if looked.range_m <= 0.0 || largest_n == 0.0 {
        return None;
    }
    let per_pa_m = match &looked.experiment.apparatus {
        Apparatus::Instrument { compliance_per_m, .. } => compliance_per_m * largest_n,
        Apparatus::Indenter(_) => return None,
        Apparatus::Robot { robot, vitreous } => {
            // A rigid sphere of radius a in an unbounded elastic body is displaced by x under the force F = 24 π μ a (1 − ν)/(5 − 6ν) x. Here μ is the shear modulus
            // and ν Poisson's ratio. An accuracy of 10 % is enough.
            let (nu, radius_m) = (vitreous.poisson_ratio, robot.shape.equivalent_radius_m());
            let shear_per_young = 0.5 / (1.0 + nu);
            let stiffness_m = 24.0 * std::f64::consts::PI * shear_per_young * radius_m * (1.0 - nu) / (5.0 - 6.0 * nu);
            largest_n / stiffness_m
        }
    };
    let modulus_pa = per_pa_m / looked.range_m;
    let (largest_pa, body) = match looked.experiment.apparatus {
        Apparatus::Instrument { .. } => (STIFFEST_PA, "solid"),
        _ => (MODULI_PA[1], "gel"),
    };
    if (MODULI_PA[0]..=largest_pa).contains(&modulus_pa) {
        return None;
    }
    let text = format!(
        "a force of {} µN moves the body by {} µm: this needs a Young's modulus of about {} Pa, which no {body} has",
        um(largest_n),
        um(looked.range_m),
        format_significant(modulus_pa, 2)
    );
    let advice = "check the units of force and position (mm for µm?) and the sizes in [robot] or [instrument]";
    Some(found("size_of_the_answer", true, text, advice))
}

/// Finds a robot that would leave its container.
pub(super) fn leaves_its_container(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let Apparatus::Robot { robot, vitreous } = &looked.experiment.apparatus else { return None };
    let room_m = 0.5 * vitreous.diameter_m - robot.farthest_point_m();
    if looked.range_m <= 2.0 * room_m {
        return None;
    }
    let text = format!(
        "positions range over {} mm, but the robot has only {} mm of room in the vitreous",
        format_significant(1e3 * looked.range_m, 3),
        format_significant(2e3 * room_m, 3)
    );
    let advice = "check the position's unit (mm for µm?), and the diameters in [robot] and [vitreous]";
    Some(found("leaves_its_container", true, text, advice))
}
