//! `instantaneous-elasticity`: the gel has an instantaneous elastic response before it creeps.
//!
//! A spring of modulus E₀ in series with the law adds 1/E₀ to the creep compliance J(t). The parameter is the ratio E/E₀, with E the
//! modulus of the law's first Kelvin–Voigt spring. For a law without such a spring, E is the law's modulus at the length of a hold
//! ([`super::first_body`]). Null: 0, a rigid spring. Valid for any ratio ≥ 0 if the bead moves more slowly than shear waves. The creep of
//! tracked beads shows this response as the first of three phases (Bausch et al. 1998, doi:10.1016/S0006-3495(98)77646-5). To first order
//! the effect equals `actuator-lag` and `clock-offset` with the opposite sign, and `second-retardation` with a short time (physics §5). It
//! applies to any law without a spring in series. It does not apply to Burgers' law, which has one.

use super::field_conflicts::WAVES;
use super::first_body::{elements_of, in_series, reference_modulus_pa};
use super::{Effect, EffectDescription, EffectParameter, FieldEffect, Stage, Stages};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use laws::rheology::{BaseLaw, Element};
use record::CharacteristicSizes;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("instantaneous-elasticity.compliance_ratio", "E/E₀", "1", Support::POSITIVE),
    null: &|_| Some(0.0),
    prior: &|_| Distribution::HalfNormal { sd: 0.2 },
    prior_source: "chosen: the jump is up to some tenths of the delayed elastic displacement",
}];

/// Effect `instantaneous-elasticity`: the gel has an instantaneous elastic response before it creeps.
pub struct InstantaneousElasticity;

impl Effect for InstantaneousElasticity {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "instantaneous-elasticity",
            stage: Stage::Mechanics,
            summary: "the gel has an instantaneous elastic response before it creeps",
            equation: "J(t) += (E/E₀)/E",
            parameters: PARAMETERS,
        }
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        let law = elements_of(base);
        let has_spring = in_series(&law).iter().any(|element| matches!(element, Element::Spring { .. }));
        has_spring
            .then_some("it already contains this effect as a spring in series, and a second one would be redundant")
    }
    fn conflict_with_field(&self, field: FieldEffect) -> Option<&'static str> {
        field.has_mass().then_some(WAVES)
    }
    fn apply(&self, parameters: &[Dual], scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let ratio = parameters[0];
        if !ratio.is_constant(0.0) {
            let compliance_per_pa = ratio / reference_modulus_pa(&stages.law, scales);
            stages.law.push(Element::Compliance { compliance_per_pa });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::{SCALES, compliance_per_pa};

    fn stages(ratio: Dual, young_modulus_pa: Dual) -> Stages {
        let law = BaseLaw::Lethersich.elements(&[young_modulus_pa, 1.4.into(), 47.0.into()]);
        let mut stages = Stages::of_law(law);
        InstantaneousElasticity.apply(&[ratio], &SCALES, &mut stages).unwrap();
        stages
    }

    /// Compares the Lethersich law with this effect to Burgers' law in closed form. The spring in series of Burgers' law has Young's
    /// modulus divided by the ratio.
    #[test]
    fn it_is_burgers_law() {
        let (young_modulus_pa, ratio) = (3.5, 0.3);
        let burgers =
            BaseLaw::Burgers.creep_compliance(&[young_modulus_pa, 1.4, 47.0, young_modulus_pa / ratio]).unwrap();
        let law = stages(ratio.into(), young_modulus_pa.into()).law;
        for t in [0.0, 0.1, 1.0, 20.0] {
            assert!((compliance_per_pa(&law, t).value - burgers.at(t)).abs() < 1e-15);
        }
    }

    #[test]
    fn derivatives_are_right_at_the_null_and_away_from_it() {
        let at_null = stages(Dual::variable(0.0), 3.5.into()).law;
        let found = compliance_per_pa(&at_null, 2.0).derivative;
        assert!((found - 1.0 / 3.5).abs() < 1e-15, "∂J/∂(E/E₀) = 1/E, not {found}");
        let jump = |modulus_pa: Dual| compliance_per_pa(&stages(0.3.into(), modulus_pa).law, 0.0);
        assert!((jump(Dual::variable(3.5)).derivative + 0.3 / (3.5 * 3.5)).abs() < 1e-15);
    }
}
