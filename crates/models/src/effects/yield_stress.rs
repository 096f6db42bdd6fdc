//! `yield-stress`: the gel flows only above a yield stress.
//!
//! The flow dashpot obeys ε̇_d = ⟨1 − s_y/s_eq⟩ s/c₂ at each point, with ε̇_d its strain rate, s the stress, s_y the yield stress and c₂
//! the flow viscosity. Here s_eq² = ⅔ dev s : dev s and ⟨x⟩ = max(x, 0). It is Bingham's fluid in series with the gel's elasticity (Bingham
//! 1922, Fluidity and Plasticity; Oldroyd 1947, Proc. Camb. Phil. Soc. 43:100). Null: s_y = 0. Valid while the gel near the robot flows.
//! Far from the robot the stress is below s_y, and the gel responds only elastically. Under one force the effect is indistinguishable from
//! a change of c₂ (physics §5). The bracket ⟨…⟩ is smoothed within a hundredth of s_y ([`YIELD_SMOOTHING`]). Below the yield stress the
//! dashpot then creeps at 10⁻⁴ of its fluidity or less. Far above the yield stress nothing changes.

use super::field_conflicts::nonlinear_conflict;
use super::{Effect, EffectDescription, EffectParameter, FieldEffect, Stage, reference_stress_pa};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use laws::rheology::BaseLaw;
use laws::stages::{NonlinearFamily, Nonlinearity, Spatial, Stages, YIELD_SMOOTHING};
use record::CharacteristicSizes;

/// Yield stress at which the effect's signature (the change of the trajectory that it causes) is computed, divided by the reference stress
/// (largest force over the robot's surface). At this stress the gel still flows everywhere except at points at rest. At a hundredth of the
/// reference stress the distant gel would already be rigid.
const FINITE_STEP: f64 = 1e-4;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("yield-stress.stress_pa", "s_y", "Pa", Support::POSITIVE),
    null: &|_| Some(0.0),
    prior: &|scales| Distribution::HalfNormal { sd: 0.5 * reference_stress_pa(scales) },
    prior_source: "chosen: half of the largest force over the robot's surface",
}];

/// Effect `yield-stress`: the gel flows only above a yield stress.
pub struct YieldStress;

impl Effect for YieldStress {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "yield-stress",
            stage: Stage::Mechanics,
            summary: "the gel flows only above a yield stress",
            equation: "ε̇_d = ⟨1 − s_y/s_eq⟩ s/c₂",
            parameters: PARAMETERS,
        }
    }
    fn field(&self) -> Option<FieldEffect> {
        Some(FieldEffect::Nonlinear(NonlinearFamily::YieldStress))
    }
    fn finite_step(&self, scales: &CharacteristicSizes) -> Option<f64> {
        Some(FINITE_STEP * reference_stress_pa(scales))
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        nonlinear_conflict(base)
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let stress_pa = parameters[0];
        if !stress_pa.is_constant(0.0) {
            let law = Nonlinearity::YieldStress { stress_pa, smoothing: YIELD_SMOOTHING };
            stages.spatial = Some(Spatial::Nonlinear(law));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_null_leaves_the_base_and_any_other_stress_is_written() {
        let written = |parameter: Dual| {
            let mut stages = Stages::of_law(Vec::new());
            YieldStress.apply(&[parameter], &SCALES, &mut stages).unwrap();
            stages.spatial
        };
        assert_eq!(written(0.0.into()), None);
        let law = Nonlinearity::YieldStress { stress_pa: 1.5.into(), smoothing: YIELD_SMOOTHING };
        assert_eq!(written(1.5.into()), Some(Spatial::Nonlinear(law)));
        assert!(written(Dual::variable(0.0)).is_some());
    }

    #[test]
    fn the_prior_is_half_the_largest_force_over_the_robots_surface() {
        let sd = (PARAMETERS[0].prior)(&SCALES).quantile(0.682_689_492);
        let mean_pa = 4.6e-6 / (4.0 * std::f64::consts::PI * 0.275e-3_f64.powi(2));
        assert!((sd / mean_pa - 0.5).abs() < 1e-6, "{sd}");
    }
}
