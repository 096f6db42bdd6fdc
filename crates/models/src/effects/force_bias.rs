//! `force-bias`: a constant force acts in addition to the commanded one.
//!
//! F = F_in + b · max |F_cmd| from the record's start, with F the force with the bias, F_in the force without it, F_cmd the command and b
//! the fraction. Null: b = 0. Valid for any b of either sign. Causes are remanence of the coils, the earth's field or a tilted stage. The
//! bead's weight is as large as the driving force, so a tilt of 3° adds a twentieth of that force. The bias starts with the record, and the
//! gel creeps under it from then on. If only the forces +F and −F alternate, the effect equals `force-asymmetry` (physics §5).

use super::{Effect, EffectDescription, EffectParameter, Stage, Stages};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use record::CharacteristicSizes;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("force-bias.fraction", "b", "1", Support::REAL),
    null: &|_| Some(0.0),
    prior: &|_| Distribution::Normal { mean: 0.0, sd: 0.1 },
    prior_source: "chosen: symmetric, a tenth of the largest commanded force",
}];

/// Effect `force-bias`: a constant force acts in addition to the commanded one.
pub struct ForceBias;

impl Effect for ForceBias {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "force-bias",
            stage: Stage::Load,
            summary: "a constant force acts in addition to the commanded one",
            equation: "F = F_in + b max|F_cmd|",
            parameters: PARAMETERS,
        }
    }
    fn refers_to_largest_force(&self) -> bool {
        true
    }
    fn apply(&self, parameters: &[Dual], scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        stages.load.offset_n += parameters[0] * scales.largest_force_n;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_offset_is_the_fraction_of_the_largest_command() {
        let mut stages = Stages::of_law(Vec::new());
        ForceBias.apply(&[Dual::variable(-0.5)], &SCALES, &mut stages).unwrap();
        // The largest force in `SCALES` is 4.6 µN.
        assert_eq!(stages.load.offset_n, Dual { value: -2.3e-6, derivative: 4.6e-6 });
    }
}
