//! `position-offset`: the zero of the position is unknown.
//!
//! The recorded position is the robot's position plus the offset b. Null: b = 0. The offset is a nuisance of experiments with `zero =
//! "fit"`, and of every indenter. An indenter's b is the height at which the tip meets the gel. If this height is read from a force curve
//! by eye, its error can be the whole indentation depth in a soft gel (Dimitriadis et al. 2002, doi:10.1016/S0006-3495(02)75620-8). The
//! offset says nothing about the gel, so it is never a candidate effect. Every model of such an experiment has it.

use super::{Effect, EffectDescription, EffectParameter, Stage, Stages, position_range_m};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use record::CharacteristicSizes;

/// Name of the offset.
pub const POSITION_OFFSET: &str = "position-offset.offset_m";

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new(POSITION_OFFSET, "b", "m", Support::REAL),
    null: &|_| Some(0.0),
    prior: &|scales| Distribution::Normal { mean: 0.0, sd: position_range_m(scales) },
    prior_source: "chosen: symmetric, as large as the range of positions",
}];

/// Nuisance `position-offset`: the zero of the position is unknown.
pub struct PositionOffset;

impl Effect for PositionOffset {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "position-offset",
            stage: Stage::Observation,
            summary: "the zero of the position is unknown",
            equation: "x_obs = x + b",
            parameters: PARAMETERS,
        }
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        stages.observation.offset_m += parameters[0];
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;
    use crate::effects::{EFFECTS, NUISANCES, nuisances};
    use crate::model::Model;
    use base::parameter::ParameterSpec;
    use laws::rheology::BaseLaw;

    /// Checks that every model of an experiment with a fitted zero has the offset before the effects, and that other models do
    /// not have it.
    #[test]
    fn models_have_it_where_the_experiment_says_so() {
        let drift = EFFECTS.iter().copied().find(|effect| effect.slug() == "tracking-drift").unwrap();
        let names = |scales: CharacteristicSizes| {
            let model =
                Model::new(BaseLaw::Lethersich, vec![drift], scales, &base::error::InputPlace::default()).unwrap();
            let names: Vec<&str> = model.parameters().iter().map(|spec: &ParameterSpec| spec.name).collect();
            (names[3..].to_vec(), model.n_before_effects(), model.is_law_alone())
        };
        let fitted = CharacteristicSizes { fits_position_offset: true, ..SCALES };
        assert_eq!(nuisances(&fitted).len(), NUISANCES.len());
        let (offset, velocity) = ("position-offset.offset_m", "tracking-drift.velocity_m_per_s");
        assert_eq!(names(fitted), (vec![offset, velocity], 4, false));
        assert_eq!(names(SCALES), (vec![velocity], 3, false));
        let alone =
            |scales| Model::new(BaseLaw::Lethersich, Vec::new(), scales, &base::error::InputPlace::default()).unwrap();
        assert!(alone(SCALES).is_law_alone() && !alone(fitted).is_law_alone());
        assert!(!alone(CharacteristicSizes { depth_exponent: Some(1.5), ..SCALES }).is_law_alone());
    }

    #[test]
    fn the_offset_adds_to_the_position_and_to_nothing_else() {
        let mut stages = Stages::of_law(Vec::new());
        PositionOffset.apply(&[Dual::variable(-2e-6)], &SCALES, &mut stages).unwrap();
        assert_eq!(stages.observation.offset_m, Dual::variable(-2e-6));
        stages.observation.offset_m = Dual::ZERO;
        assert_eq!(stages, Stages::of_law(Vec::new()));
    }
}
