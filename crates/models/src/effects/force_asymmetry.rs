//! `force-asymmetry`: the actuator pulls more strongly in one direction than in the other.
//!
//! The force F on the robot is the commanded force F_in if F_in ≥ 0, and (1 + a) F_in if F_in < 0. Null: a = 0. Valid for a > −1; at a = −1
//! no negative force acts. Causes are a sphere away from the middle of the coils, unequal coils, or remanence of the robot. If only the
//! forces +F and −F alternate, the effect equals `force-bias` up to a factor that Young's modulus and the viscosities absorb (physics §5).
//! Source for the coils of the reference experiment and their calibration: Kummer et al. 2010, IEEE Trans. Robotics 26:1006.

use super::{Effect, EffectDescription, EffectParameter, Stage, Stages};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use record::CharacteristicSizes;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("force-asymmetry.fraction", "a", "1", Support { lower: -1.0, upper: f64::INFINITY }),
    null: &|_| Some(0.0),
    // The standard deviation of a beta distribution on [−1, 1] with two equal shape parameters α is 1/√(2α + 1).
    prior: &|_| Distribution::Beta { alpha: 12.0, beta: 12.0, lower: -1.0, upper: 1.0 },
    prior_source: "chosen: symmetric, standard deviation one fifth; coils calibrated against each other agree within some per cent",
}];

/// Effect `force-asymmetry`: negative forces are larger than the log says.
pub struct ForceAsymmetry;

impl Effect for ForceAsymmetry {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "force-asymmetry",
            stage: Stage::Load,
            summary: "negative forces are larger than the log says",
            equation: "F = (1 + a) F_in where F_in < 0",
            parameters: PARAMETERS,
        }
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        stages.load.negative_factor = stages.load.negative_factor * (parameters[0] + 1.0);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn only_negative_forces_grow_and_by_the_fraction() {
        let mut stages = Stages::of_law(Vec::new());
        ForceAsymmetry.apply(&[Dual::variable(0.25)], &SCALES, &mut stages).unwrap();
        let pulled = stages.load.negative_factor * -4.0;
        assert_eq!((pulled.value, pulled.derivative), (-5.0, -4.0));
        assert_eq!(stages.load.positive_factor, Dual::ONE);
    }

    #[test]
    fn the_prior_has_the_standard_deviation_that_its_source_names() {
        let prior = (PARAMETERS[0].prior)(&SCALES);
        // The prior is a beta distribution on [−1, 1] with shape parameters of 12. It is nearly normal, and 84.1 % of a normal distribution
        // are below one standard deviation.
        assert!((prior.cdf(0.2) - 0.841).abs() < 0.005, "{}", prior.cdf(0.2));
        assert!((prior.cdf(0.0) - 0.5).abs() < 1e-12);
    }
}
