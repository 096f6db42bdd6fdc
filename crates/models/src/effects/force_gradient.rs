//! `force-gradient`: the force depends on the robot's position.
//!
//! F = F_in e^{gx}, with F the force on the robot, F_in the force at x = 0, x the robot's position and g the gradient (1/m). Null: g = 0.
//! Over equal distances the force changes by equal factors, which is true of any force field to first order. A dipole at the distance d
//! pulls with a force ∝ d⁻⁴, so that g = ±4/d. The exponential differs from this force by (gx)²/8. A force that decreases along the robot's
//! path may have any g. A force that grows may diverge with the position, and then no position is computed. Source for calibrations of
//! force over distance: Gosse & Croquette 2002, Biophys. J. 82:3314.

use super::{Effect, EffectDescription, EffectParameter, FieldEffect, Stage, Stages, position_range_m};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use record::CharacteristicSizes;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("force-gradient.gradient_per_m", "g", "1/m", Support::REAL),
    null: &|_| Some(0.0),
    prior: &|scales| Distribution::Normal { mean: 0.0, sd: 0.1 / position_range_m(scales) },
    prior_source: "chosen: symmetric, a change of the force by a tenth over the range of positions",
}];

/// Effect `force-gradient`: the force depends on the robot's position.
pub struct ForceGradient;

impl Effect for ForceGradient {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "force-gradient",
            stage: Stage::Load,
            summary: "the force depends on the robot's position",
            equation: "F = F_in e^{g x}",
            parameters: PARAMETERS,
        }
    }
    fn depends_on_position(&self) -> bool {
        true
    }
    fn conflict_with_field(&self, field: FieldEffect) -> Option<&'static str> {
        field.feedback_conflict()
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        stages.load.gradient_per_m += parameters[0];
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;
    use base::number::Scalar;
    use laws::stages::MAX_GRADIENT_EXPONENT;

    /// Compares the effect with a dipole at the distance d from the robot, whose force is ∝ d⁻⁴ and whose gradient is g = −4/d. The robot
    /// moves away by x. The expansions are 1 + 4 (−x/d) + 10 (x/d)² and 1 + gx + (gx)²/2.
    #[test]
    fn a_dipole_is_met_up_to_the_second_order() {
        let (distance_m, x): (f64, f64) = (0.05, 0.5e-3);
        let mut stages = Stages::of_law(Vec::new());
        ForceGradient.apply(&[Dual::variable(-4.0 / distance_m)], &SCALES, &mut stages).unwrap();
        let factor = (stages.load.gradient_per_m * x).exp();
        let dipole = (1.0 + x / distance_m).powi(-4);
        let (g_x, difference) = (stages.load.gradient_per_m.value * x, dipole - factor.value);
        assert!((difference / (g_x * g_x / 8.0) - 1.0).abs() < 0.06, "{difference}");
        assert!((factor.derivative / (x * factor.value) - 1.0).abs() < 1e-15);
    }

    /// Checks that the largest allowed exponent, gradient times position, is far outside the prior. Over the whole range of positions it
    /// corresponds to 200 standard deviations of the gradient.
    #[test]
    fn the_prior_keeps_clear_of_the_limit() {
        let limit = MAX_GRADIENT_EXPONENT / SCALES.position_range_m;
        let Distribution::Normal { sd, .. } = (PARAMETERS[0].prior)(&SCALES) else { panic!("a normal prior") };
        assert!(limit > 199.0 * sd);
    }
}
