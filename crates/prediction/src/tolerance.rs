//! Uncertain inputs of the apparatus. Each scales the displacements of a linear model.

use base::error::{Error, Result};
use posterior::mechanics::Mechanics;
use record::{Apparatus, Offset, OffsetDirection, Robot};

use crate::body;
use crate::scenario::{self, Scenario, resized};

/// Relative change of the diameter from which the sensitivity of the compliance is taken.
const DIAMETER_STEP: f64 = 0.02;
/// Largest difference of the compliance's logarithm from its curve in the middle of an offset's tolerance.
const CURVE_ERROR: f64 = 1e-3;

/// Uniform input of the apparatus.
#[derive(Debug, Clone, PartialEq)]
pub struct Tolerance {
    /// Name in documents.
    pub name: &'static str,
    scaling: Scaling,
}

/// Factor of the displacements by an input.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scaling {
    /// 1 + `half_width`·u.
    Proportional { half_width: f64 },
    /// (1 + `half_width`·u)^`exponent`.
    Power { half_width: f64, exponent: f64 },
    /// exp(`slope`·u + `curvature`·u²).
    Curve { slope: f64, curvature: f64 },
}

impl Tolerance {
    /// Input that changes the displacements by at most the fraction `half_width`.
    pub fn proportional(name: &'static str, half_width: f64) -> Self {
        Self { name, scaling: Scaling::Proportional { half_width } }
    }

    /// Tolerances of a scenario.
    ///
    /// # Errors
    /// Errors of the meshes of a robot with another diameter or offset.
    pub fn of_scenario(scenario: &Scenario) -> Result<Vec<Self>> {
        let scenario::Tolerances { diameter_m, offset_m, force } = scenario.tolerances;
        let mut found = Vec::new();
        if diameter_m > 0.0 {
            let half_width = diameter_m / scenario::diameter_m(&scenario.robot);
            let scaling = Scaling::Power { half_width, exponent: by_diameter(scenario)? };
            found.push(Self { name: "diameter", scaling });
        }
        if offset_m > 0.0 {
            found.push(Self { name: "offset", scaling: by_offset(scenario, offset_m)? });
        }
        if force > 0.0 {
            found.push(Self::proportional("force calibration", force));
        }
        Ok(found)
    }

    /// Factor of the displacements where the input is at `u`, from −1 to 1 over the tolerance.
    pub fn factor(&self, u: f64) -> f64 {
        match self.scaling {
            Scaling::Proportional { half_width } => 1.0 + half_width * u,
            Scaling::Power { half_width, exponent } => (1.0 + half_width * u).powf(exponent),
            Scaling::Curve { slope, curvature } => (slope * u + curvature * u * u).exp(),
        }
    }
}

/// Change of the compliance's logarithm by the logarithm of the diameter, in the meridian plane or from two meshes.
fn by_diameter(scenario: &Scenario) -> Result<f64> {
    let compliance = |factor: f64| {
        let robot = resized(&scenario.robot, 1.0, factor);
        match body::compliance_per_m(&robot, &scenario.vitreous) {
            Some((accurate_per_m, _)) => Ok(accurate_per_m),
            None => mesh_compliance_per_m(scenario, robot, "diameter_um"),
        }
    };
    let [less, more] = [1.0 - DIAMETER_STEP, 1.0 + DIAMETER_STEP];
    Ok((compliance(more)? / compliance(less)?).ln() / (more / less).ln())
}

/// Compliance by the offset, from meshes at the ends of the tolerance. An offset from the centre acts alike on both sides.
fn by_offset(scenario: &Scenario, half_width_m: f64) -> Result<Scaling> {
    let own = scenario.robot.offset.unwrap_or(Offset { distance_m: 0.0, direction: OffsetDirection::Along });
    let compliance = |distance_m: f64| {
        let offset = (distance_m > 0.0).then_some(Offset { distance_m, ..own });
        mesh_compliance_per_m(scenario, Robot { offset, ..scenario.robot }, "offset_um")
    };
    let middle_per_m = compliance(own.distance_m)?;
    let more = (compliance(own.distance_m + half_width_m)? / middle_per_m).ln();
    let less = match own.distance_m {
        0.0 => more,
        distance_m => (compliance((distance_m - half_width_m).abs())? / middle_per_m).ln(),
    };
    let (slope, curvature) = (0.5 * (more - less), 0.5 * (more + less));
    let half = (compliance(own.distance_m + 0.5 * half_width_m)? / middle_per_m).ln();
    if (half - 0.5 * slope - 0.25 * curvature).abs() > CURVE_ERROR {
        return Err(Error::input(
            scenario.place("tolerance.offset_um"),
            "the robot may come so near to the gel's outer surface that its compliance falls steeply",
            "give a smaller tolerance, or compare scenarios with several offsets",
        ));
    }
    Ok(Scaling::Curve { slope, curvature })
}

/// Displacement per force at unit creep compliance (1/m) from a mesh. `key` is the tolerance that asks for this robot.
fn mesh_compliance_per_m(scenario: &Scenario, robot: Robot, key: &str) -> Result<f64> {
    let refused = |error: Error| match error {
        Error::Input { found, .. } => {
            Error::input(scenario.place(&format!("tolerance.{key}")), found, "give a smaller tolerance")
        }
        other => other,
    };
    match Mechanics::new(&Apparatus::Robot { robot, vitreous: scenario.vitreous }, None).map_err(refused)? {
        Mechanics::FiniteElements(fe) => fe.compliance_per_m(),
        _ => Ok(f64::NAN),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::{RobotShape, Vitreous};

    /// Largest difference of a factor from that of a mesh with the offset itself: the next terms of the expansion.
    const EXPANSION: f64 = 1e-4;

    /// Between the ends of its tolerance, an offset acts as a mesh with that offset does. From the centre the gel is stiffer on both sides.
    #[test]
    fn an_offset_acts_as_its_mesh() {
        let shape = RobotShape::Sphere { diameter_m: 0.55e-3 };
        let vitreous = Vitreous { diameter_m: 0.02, poisson_ratio: 0.48, density_kg_m3: None };
        for (own_m, half_width_m) in [(0.0, 2e-3), (3e-3, 1e-3), (0.5e-3, 1e-3)] {
            let at = |distance_m: f64| {
                let offset = (distance_m > 0.0).then_some(Offset { distance_m, direction: OffsetDirection::Along });
                Robot { shape, density_kg_m3: None, offset }
            };
            let scenario = Scenario::of_robot("sphere", at(own_m), vitreous);
            let scaling = by_offset(&scenario, half_width_m).expect("compliances");
            let tolerance = Tolerance { name: "offset", scaling };
            let compliance = |distance_m: f64| mesh_compliance_per_m(&scenario, at(distance_m), "").expect("a mesh");
            for u in [-1.0, -0.5, 0.5, 1.0] {
                let expected = compliance((own_m + u * half_width_m).abs()) / compliance(own_m);
                let found = tolerance.factor(u);
                assert!((found - expected).abs() < EXPANSION, "{own_m} {u}: {found} for {expected}");
            }
            let near_wall = Scenario::of_robot("sphere", at(0.0), vitreous);
            assert!(by_offset(&near_wall, 9e-3).is_err_and(|error| error.to_string().contains("outer surface")));
            if own_m == 0.0 {
                let end = tolerance.factor(1.0);
                assert!(end == tolerance.factor(-1.0) && (0.99..1.0).contains(&end), "{end}");
            }
        }
    }
}
