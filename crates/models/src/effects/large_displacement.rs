//! `large-displacement`: the robot moves so far that strains are not small.
//!
//! The gel is the Oldroyd-B fluid whose linear limit is the law (physics §7.6). The position is x(gF)/g, with F the force, x(F) the
//! response of this fluid and g the amplitude. At g = 1 the geometry is the actual one. A fitted g therefore shows whether large
//! displacements explain the misfit. Null: g = 0, small strains. The deviation grows with g². Valid for a central sphere that stays within
//! a few radii. Other gels with equal responses at small strains deviate differently. With a mobility α > 0 the gel is a Giesekus fluid.

use super::field_conflicts::memory;
use super::{Effect, EffectDescription, EffectParameter, FieldEffect, Spatial, Stage, Stages};
use base::distribution::Distribution;
use base::error::{Error, Result};
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use laws::rheology::BaseLaw;
use record::CharacteristicSizes;

/// Name of the parameter g, the amplitude: 0 for small strains, 1 for the actual geometry.
pub const AMPLITUDE: &str = "large-displacement.amplitude";
/// Name of the parameter α, the mobility: 0 for an Oldroyd-B fluid, above 0 for a Giesekus fluid.
pub const MOBILITY: &str = "large-displacement.mobility";

/// Returns the error for surroundings and laws that the full-order model of large displacements does not cover.
pub fn sphere_required_error() -> Error {
    Error::numerical(
        "large displacements need a sphere at the centre and a gel without springpots",
        "leave `large-displacement` out",
    )
}

const PARAMETERS: &[EffectParameter] = &[
    EffectParameter {
        spec: ParameterSpec::new(AMPLITUDE, "g", "1", Support::POSITIVE).squared(),
        null: &|_| Some(0.0),
        prior: &|_| Distribution::HalfNormal { sd: 1.0 },
        prior_source: "chosen: the actual geometry, 1, is one standard deviation",
    },
    EffectParameter {
        spec: ParameterSpec::new(MOBILITY, "α", "1", Support { lower: 0.0, upper: 0.5 }).optional(),
        null: &|_| Some(0.0),
        prior: &|_| Distribution::Beta { alpha: 1.0, beta: 9.0, lower: 0.0, upper: 0.5 },
        prior_source: "chosen: most likely 0, with mean 0.05",
    },
];

/// Effect `large-displacement`: the robot moves so far that strains are large.
pub struct LargeDisplacement;

impl Effect for LargeDisplacement {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "large-displacement",
            stage: Stage::Mechanics,
            summary: "the robot moves so far that strains are large",
            equation: "x(gF)/g of the Oldroyd-B fluid whose linear limit is the law",
            parameters: PARAMETERS,
        }
    }
    fn field(&self) -> Option<FieldEffect> {
        Some(FieldEffect::Large)
    }
    fn signature_size(&self, _scales: &CharacteristicSizes) -> Option<f64> {
        Some(1.0)
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        memory(base)
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let (amplitude, mobility) = (parameters[0], parameters[1]);
        if !amplitude.is_constant(0.0) {
            stages.spatial = Some(Spatial::Large { amplitude, mobility });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_null_leaves_the_base_and_any_other_amplitude_is_written() {
        let written = |amplitude: Dual| {
            let mut stages = Stages::of_law(Vec::new());
            LargeDisplacement.apply(&[amplitude, 0.01.into()], &SCALES, &mut stages).unwrap();
            stages.spatial
        };
        assert_eq!(written(0.0.into()), None);
        assert_eq!(written(0.7.into()), Some(Spatial::Large { amplitude: 0.7.into(), mobility: 0.01.into() }));
        assert!(written(Dual::variable(0.0)).is_some());
    }
}
