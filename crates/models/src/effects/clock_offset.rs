//! `clock-offset`: the force acts later than the log says.
//!
//! F(t) = F_cmd(t − δ), with F the force on the robot, F_cmd the logged command and δ ≥ 0 the delay in s. Null: δ = 0. Valid for any δ,
//! also if the delayed switches are between samples. Causes are separate clocks of camera and coil driver, or a command that is logged
//! before it is sent. To first order in δ the effect equals `actuator-lag` (physics §5).

use super::{Effect, EffectDescription, EffectParameter, Stage, Stages};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use record::CharacteristicSizes;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("clock-offset.delay_s", "δ", "s", Support::POSITIVE),
    null: &|_| Some(0.0),
    prior: &|scales| Distribution::HalfNormal { sd: (2.0 * scales.sample_interval_s).max(0.05 * scales.hold_s) },
    prior_source: "chosen: two sample intervals, or a twentieth of a hold if that is more",
}];

/// Effect `clock-offset`: the force acts later than the log says.
pub struct ClockOffset;

impl Effect for ClockOffset {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "clock-offset",
            stage: Stage::Load,
            summary: "the force acts later than the log says",
            equation: "F(t) = F_cmd(t − δ)",
            parameters: PARAMETERS,
        }
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        stages.load.delay_s += parameters[0];
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    /// Checks a dashpot of viscosity c under a constant force F. With the delay δ it moves by F (t − δ)/c at times t ≥ δ. The delay shifts
    /// the time and changes nothing else.
    #[test]
    fn a_step_arrives_later_by_the_delay() {
        let mut stages = Stages::of_law(Vec::new());
        ClockOffset.apply(&[Dual::variable(0.03)], &SCALES, &mut stages).unwrap();
        let (force_n, viscosity_pa_s) = (4.6e-6, 47.0);
        let flow = (Dual::constant(2.0) - stages.load.delay_s) * (force_n / viscosity_pa_s);
        assert!((flow.value - force_n * 1.97 / viscosity_pa_s).abs() < 1e-20);
        assert_eq!(flow.derivative, -force_n / viscosity_pa_s);
    }

    #[test]
    fn the_prior_is_scaled_by_the_slower_of_camera_and_hold() {
        let median = |scales: &CharacteristicSizes| (PARAMETERS[0].prior)(scales).quantile(0.5);
        // The median of a half-normal distribution is Φ⁻¹(¾) times its scale parameter.
        let expected = |sd: f64| 0.674_489_750_196_081_7 * sd;
        assert!((median(&SCALES) - expected(0.05 * 5.0)).abs() < 1e-9);
        let slow_camera = CharacteristicSizes { sample_interval_s: 1.0, ..SCALES };
        assert!((median(&slow_camera) - expected(2.0)).abs() < 1e-9);
    }
}
