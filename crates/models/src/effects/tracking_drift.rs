//! `tracking-drift`: the camera or the stage drifts relative to the gel.
//!
//! The recorded position is the robot's position plus v t, with v the drift's velocity and t the time from the record's start. Null: v = 0.
//! Valid for any steady v of either sign. Causes are loosening mounts and warming stages. The drift of tracked videos is commonly
//! subtracted first (Crocker & Grier 1996, doi:10.1006/jcis.1996.0217). The flow dashpot creeps in proportion to the force, and the drift
//! does not depend on the force. Only a changing force distinguishes the two.

use super::{Effect, EffectDescription, EffectParameter, Stage, Stages, position_range_m};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use record::CharacteristicSizes;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("tracking-drift.velocity_m_per_s", "v", "m/s", Support::REAL),
    null: &|_| Some(0.0),
    prior: &|scales| Distribution::Normal { mean: 0.0, sd: 0.1 * position_range_m(scales) / scales.duration_s },
    prior_source: "chosen: symmetric, a tenth of the range of positions over the record",
}];

/// Effect `tracking-drift`: the camera or the stage drifts relative to the gel.
pub struct TrackingDrift;

impl Effect for TrackingDrift {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "tracking-drift",
            stage: Stage::Observation,
            summary: "the camera or the stage drifts relative to the gel",
            equation: "x_obs = x + v t",
            parameters: PARAMETERS,
        }
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        stages.observation.velocity_m_per_s += parameters[0];
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_drift_adds_up_over_the_record_and_leaves_the_scale() {
        let mut stages = Stages::of_law(Vec::new());
        TrackingDrift.apply(&[Dual::variable(-2e-6)], &SCALES, &mut stages).unwrap();
        let at_end = stages.observation.velocity_m_per_s * SCALES.duration_s;
        assert_eq!(at_end, Dual { value: -2e-6 * SCALES.duration_s, derivative: SCALES.duration_s });
        assert_eq!((stages.observation.scale, stages.observation.approaches.len()), (Dual::ONE, 0));
    }

    #[test]
    fn the_prior_is_a_tenth_of_the_range_over_the_record() {
        let one_sd = (PARAMETERS[0].prior)(&SCALES).quantile(0.841_344_746_068_542_9);
        assert!((one_sd * SCALES.duration_s / SCALES.position_range_m - 0.1).abs() < 1e-9);
    }
}
