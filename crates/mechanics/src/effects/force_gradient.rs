//! `force-gradient`: the force depends on where the robot is.
//!
//! F = F_in (1 + g x), x the robot's position. Null: g = 0. Valid to first order in g x: the field of a dipole at the distance d pulls as d⁻⁴,
//! so that g = ±4/d and the next term is (5/8)(g x)². Refused where |g x| reaches one half. Force calibrations over distance: Gosse &
//! Croquette 2002, Biophys. J. 82:3314.

use super::{Effect, EffectParameter, Field, Stage, Stages, position_range_m};
use crate::distribution::Distribution;
use crate::error::Result;
use crate::experiment::Scales;
use crate::number::Dual;
use crate::parameter::{ParameterSpec, Support};

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("force-gradient.gradient_per_m", "g", "1/m", Support::REAL),
    null: |_| Some(0.0),
    prior: |scales| Distribution::Normal { mean: 0.0, sd: 0.1 / position_range_m(scales) },
    prior_source: "chosen: either way alike, a change of the force by a tenth over the range of positions",
    finite_step: None,
}];

/// The effect.
pub struct ForceGradient;

impl Effect for ForceGradient {
    fn slug(&self) -> &'static str {
        "force-gradient"
    }
    fn stage(&self) -> Stage {
        Stage::Load
    }
    fn summary(&self) -> &'static str {
        "the force depends on where the robot is"
    }
    fn equation(&self) -> &'static str {
        "F = F_in (1 + g x)"
    }
    fn parameters(&self) -> &'static [EffectParameter] {
        PARAMETERS
    }
    fn acts_on_position(&self) -> bool {
        true
    }
    fn barred_beside(&self, field: Field) -> Option<&'static str> {
        matches!(field, Field::Large)
            .then_some("a force that depends on the position is not run with large displacements")
    }
    fn apply(&self, parameters: &[Dual], _scales: &Scales, stages: &mut Stages) -> Result<()> {
        stages.load.gradient_per_m += parameters[0];
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;
    use crate::stages::LARGEST_FEEDBACK;

    /// The law that the effect is the first order of: F ∝ d⁻⁴ with g = −4/d, moved away by x; the next term is 10 (x/d)².
    #[test]
    fn a_dipole_is_met_up_to_the_second_order() {
        let (distance_m, x): (f64, f64) = (0.05, 0.5e-3);
        let mut stages = Stages::of_law(Vec::new());
        ForceGradient.apply(&[Dual::variable(-4.0 / distance_m)], &SCALES, &mut stages).unwrap();
        let factor = stages.load.gradient_per_m * x + 1.0;
        let dipole = (1.0 + x / distance_m).powi(-4);
        let (g_x, difference) = (stages.load.gradient_per_m.value * x, dipole - factor.value);
        assert!((difference / (0.625 * g_x * g_x) - 1.0).abs() < 0.03, "{difference}");
        assert_eq!(factor.derivative, x);
    }

    /// A draw from the prior is refused about once in two million: over the whole range the limit is five standard deviations away.
    #[test]
    fn the_prior_keeps_clear_of_the_refusal() {
        let limit = LARGEST_FEEDBACK / SCALES.position_range_m;
        assert!(1.0 - (PARAMETERS[0].prior)(&SCALES).cdf(limit) < 3e-7);
    }
}
