//! `clock-offset`: the force acts later than the log says.
//!
//! F(t) = F_cmd(t − δ), δ ≥ 0. Null: δ = 0. Valid for any δ; switch times between samples are exact. Camera and coil driver with clocks of their
//! own, or a command logged before it is sent, make it. To first order in δ it is what `actuator-lag` is (physics §5).

use super::{Effect, EffectParameter, Stage, Stages};
use crate::distribution::Distribution;
use crate::error::Result;
use crate::experiment::Scales;
use crate::number::Dual;
use crate::parameter::{ParameterSpec, Support};

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("clock-offset.delay_s", "s", Support::POSITIVE),
    symbol: "δ",
    null: |_| Some(0.0),
    prior: |scales| Distribution::HalfNormal { sd: (2.0 * scales.sample_interval_s).max(0.05 * scales.hold_s) },
    prior_source: "chosen: two sample intervals, or a twentieth of a hold if that is more",
    finite_step: None,
}];

/// The effect.
pub struct ClockOffset;

impl Effect for ClockOffset {
    fn slug(&self) -> &'static str {
        "clock-offset"
    }
    fn stage(&self) -> Stage {
        Stage::Load
    }
    fn summary(&self) -> &'static str {
        "the force acts later than the log says"
    }
    fn equation(&self) -> &'static str {
        "F(t) = F_cmd(t − δ)"
    }
    fn parameters(&self) -> &'static [EffectParameter] {
        PARAMETERS
    }
    fn apply(&self, parameters: &[Dual], _scales: &Scales, stages: &mut Stages) -> Result<()> {
        stages.load.delay_s += parameters[0];
        Ok(())
    }
}
