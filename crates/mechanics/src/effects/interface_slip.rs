//! `interface-slip`: the gel slips along the robot's surface.
//!
//! The gel follows the robot along the normal; along the surface it slips at ġ = t/β, t the tangential stress. Null: 1/β = 0, no slip. The
//! reduced model is a sum over common eigenvectors of stiffness and surface, each the law with a dashpot beside it. Valid for a thin lubricated
//! layer; a body with edges slips along what its faces have in common. In an unbounded incompressible medium the drag falls by (1 + 2b/R)/(1 + 3b/R), b = G/(βs)
//! (physics §4.7; Basset 1888, A Treatise on Hydrodynamics, vol. 2). Close to `second-retardation`, and to first order it is a change of c₂.

use super::beside_fields::law_conflict;
use super::{Effect, EffectParameter, FieldModel, Spatial, Stage, Stages, apparent_viscosity_pa_s, robot_radius_m};
use crate::distribution::Distribution;
use crate::error::Result;
use crate::experiment::Scales;
use crate::number::Dual;
use crate::parameter::{ParameterSpec, Support};
use crate::rheology::BaseLaw;

/// 1/β at which the slip length is the robot's radius.
fn scale_m_per_pa_s(scales: &Scales) -> f64 {
    robot_radius_m(scales) / apparent_viscosity_pa_s(scales)
}

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("interface-slip.slip_compliance_m_per_pa_s", "m/(Pa s)", Support::POSITIVE),
    symbol: "1/β",
    null: |_| Some(0.0),
    prior: |scales| Distribution::HalfNormal { sd: 2.0 * scale_m_per_pa_s(scales) },
    prior_source: "chosen: slip lengths up to a few radii, at the viscosity that the largest force and the way in a hold suggest",
    finite_step: None,
}];

/// The effect.
pub struct InterfaceSlip;

impl Effect for InterfaceSlip {
    fn slug(&self) -> &'static str {
        "interface-slip"
    }
    fn stage(&self) -> Stage {
        Stage::Mechanics
    }
    fn summary(&self) -> &'static str {
        "the gel slips along the robot's surface"
    }
    fn equation(&self) -> &'static str {
        "ġ = t/β, g the slip along the surface, t the stress along it"
    }
    fn parameters(&self) -> &'static [EffectParameter] {
        PARAMETERS
    }
    fn changes_field(&self) -> bool {
        true
    }
    fn field_model(&self) -> Option<FieldModel> {
        Some(FieldModel::Slip)
    }
    fn shows_at(&self, scales: &Scales) -> Option<f64> {
        Some(0.03 * scale_m_per_pa_s(scales))
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        law_conflict(base, FieldModel::Slip)
    }
    fn apply(&self, parameters: &[Dual], _scales: &Scales, stages: &mut Stages) -> Result<()> {
        let compliance_m_per_pa_s = parameters[0];
        if !compliance_m_per_pa_s.is_constant(0.0) {
            stages.spatial = Some(Spatial::Slip { compliance_m_per_pa_s });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_null_leaves_the_base_and_any_other_slip_is_written() {
        let written = |parameter: Dual| {
            let mut stages = Stages::of_law(Vec::new());
            InterfaceSlip.apply(&[parameter], &SCALES, &mut stages).unwrap();
            stages.spatial
        };
        assert_eq!(written(0.0.into()), None);
        assert_eq!(written(2.0.into()), Some(Spatial::Slip { compliance_m_per_pa_s: 2.0.into() }));
    }
}
