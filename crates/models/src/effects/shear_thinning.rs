//! `shear-thinning`: the gel flows more easily under higher stress.
//!
//! The flow dashpot obeys ε̇_d = (s_eq/s₀)^{1/n−1} s/c₂ at each point, with ε̇_d its strain rate, s the stress and s_eq² = ⅔ dev s : dev s.
//! It is the power-law fluid of Ostwald and de Waele (Bird, Armstrong & Hassager 1987, Dynamics of Polymeric Liquids, vol. 1, ch. 4). Its
//! viscosity is c₂ at the stress s₀ = F_max/(4πR²), so that c₂ remains a viscosity. F_max is the largest force and R the robot's radius.
//! Null: n = 1. Valid for an index n in (0.3, 1] and stresses within a decade or two of s₀. Near zero stress this fluid becomes solid,
//! while real fluids keep a finite viscosity. Under a single force the response is nearly that of another c₂. Two forces in the ratio f : 1
//! give flow rates in the ratio f^{1/n} : 1 (physics §5).
//! (physics §5).

use super::field_conflicts::nonlinear_conflict;
use super::{Effect, EffectDescription, EffectParameter, FieldEffect, Stage, reference_stress_pa};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use laws::rheology::BaseLaw;
use laws::stages::{NonlinearFamily, Nonlinearity, Spatial, Stages};
use record::CharacteristicSizes;

const SMALLEST_INDEX: f64 = 0.3;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("shear-thinning.index", "n", "1", Support { lower: SMALLEST_INDEX, upper: 1.0 }),
    null: &|_| Some(1.0),
    prior: &|_| Distribution::Uniform { lower: SMALLEST_INDEX, upper: 1.0 },
    prior_source: "chosen: from the linear fluid to one that flows more than twice as fast at 1.3 times the force",
}];

/// Effect `shear-thinning`: the gel flows more easily under higher stress.
pub struct ShearThinning;

impl Effect for ShearThinning {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "shear-thinning",
            stage: Stage::Mechanics,
            summary: "the gel flows more easily under higher stress",
            equation: "ε̇_d = (s_eq/s₀)^{1/n−1} s/c₂, s₀ = F_max/(4πR²)",
            parameters: PARAMETERS,
        }
    }
    fn field(&self) -> Option<FieldEffect> {
        Some(FieldEffect::Nonlinear(NonlinearFamily::ShearThinning))
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        nonlinear_conflict(base)
    }
    fn refers_to_largest_force(&self) -> bool {
        true
    }
    fn apply(&self, parameters: &[Dual], scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let index = parameters[0];
        if !index.is_constant(1.0) {
            let reference_stress_pa = reference_stress_pa(scales).into();
            let law = Nonlinearity::ShearThinning { index, reference_stress_pa };
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
    fn the_null_leaves_the_base_and_any_other_index_is_written_with_the_experiments_stress() {
        let written = |parameter: Dual| {
            let mut stages = Stages::of_law(Vec::new());
            ShearThinning.apply(&[parameter], &SCALES, &mut stages).unwrap();
            stages.spatial
        };
        assert_eq!(written(1.0.into()), None);
        assert!(written(Dual::variable(1.0)).is_some());
        let Some(Spatial::Nonlinear(Nonlinearity::ShearThinning { index, reference_stress_pa })) = written(0.5.into())
        else {
            panic!("nothing is written");
        };
        // The force of 4.6 µN is divided by the surface of a sphere of diameter 0.55 mm.
        assert!((reference_stress_pa.value - 4.84).abs() < 0.005, "{reference_stress_pa:?}");
        // A prediction for another robot keeps the stress of the record that taught the law.
        let larger = CharacteristicSizes { robot_radius_m: Some(1e-3), ..SCALES };
        assert_eq!(super::reference_stress_pa(&larger), reference_stress_pa.value);
        assert_eq!(index, 0.5.into());
    }

    /// Checks that flow rates more than double at forces 1.3 times as large, as the text of the prior's source says.
    #[test]
    fn the_smallest_index_more_than_doubles_the_flow_at_forces_1_3_times_as_large() {
        let faster = 1.3_f64.powf(1.0 / SMALLEST_INDEX);
        assert!(faster > 2.0 && faster < 2.5, "{faster}");
    }
}
