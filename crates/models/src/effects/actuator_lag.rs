//! `actuator-lag`: the force approaches its commanded value exponentially instead of at once.
//!
//! τ Ḟ = F_in − F, with F_in the commanded force, F the force on the robot (0 at the record's start) and τ the lag time in s. Null: τ = 0.
//! Valid for any τ ≥ 0. Causes are the inductance of the coils, eddy currents and the driver's amplifier. To first order in τ the effect
//! equals `clock-offset` (physics §5), since both change the position x by −τ ẋ. Only the rounded corners of the response, of the size τ²
//! ẍ, distinguish the two effects.

use super::{Effect, EffectDescription, EffectParameter, Stage, Stages};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use record::CharacteristicSizes;

/// Lag time τ at which the effect's signature (the change of the trajectory that it causes) is computed, in sample intervals.
///
/// The kernel divides by τ, so forward-mode differentiation fails at τ = 0. With τ of a tenth of an interval, the lag's transient has
/// decayed to e⁻¹⁰ = 5·10⁻⁵ at the first row after a switch. The difference quotient of the position x is therefore the one-sided
/// derivative −ẋ up to τ ẍ/2, and it is far above rounding.
const STEP: f64 = 0.1;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("actuator-lag.time_s", "τ", "s", Support::POSITIVE),
    null: &|_| Some(0.0),
    prior: &|scales| Distribution::HalfNormal { sd: (2.0 * scales.sample_interval_s).max(0.05 * scales.hold_s) },
    prior_source: "chosen: two sample intervals, or a twentieth of a hold if that is more",
}];

/// Effect `actuator-lag`: the force approaches its commanded value exponentially.
pub struct ActuatorLag;

impl Effect for ActuatorLag {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "actuator-lag",
            stage: Stage::Load,
            summary: "the force approaches its commanded value exponentially",
            equation: "τ dF/dt = F_in − F",
            parameters: PARAMETERS,
        }
    }
    fn finite_step(&self, scales: &CharacteristicSizes) -> Option<f64> {
        Some(STEP * scales.sample_interval_s)
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        stages.load.lag_time_s += parameters[0];
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_lag_is_written_with_its_derivative() {
        let mut stages = Stages::of_law(Vec::new());
        ActuatorLag.apply(&[Dual::variable(0.02)], &SCALES, &mut stages).unwrap();
        assert_eq!(stages.load.lag_time_s, Dual::variable(0.02));
    }

    /// Checks the difference quotient against a closed form. Under a force F from the time t = 0, a dashpot of viscosity c moves by F t/c
    /// without a lag. With a lag time τ it moves by (F/c)(t − τ(1 − e^{−t/τ})). The derivative by τ at τ = 0 is −F/c at every t > 0.
    #[test]
    fn the_finite_step_gives_the_one_sided_derivative_at_the_first_row_after_a_switch() {
        let step_s = ActuatorLag.finite_step(&SCALES).unwrap();
        let flow = |lag_s: f64, t: f64| t + lag_s * (-t / lag_s).exp_m1();
        let first_row_s = SCALES.sample_interval_s;
        let quotient = (flow(step_s, first_row_s) - first_row_s) / step_s;
        assert!((quotient + 1.0).abs() < 5e-5, "{quotient}");
    }
}
