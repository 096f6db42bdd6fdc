//! `inertia`: the gel and the robot have mass.
//!
//! ρü in the gel and mü of the robot, times `density_scale`: at 1 the densities are the experiment's, at the null 0 the base's balance without mass returns. The reduced
//! model is a sum over common eigenvectors of stiffness and mass, each the law with a mass beside it. Valid for the linear gel in its container;
//! momentum diffuses over the robot's radius in about ρR²/η. In an unbounded incompressible medium it is Basset's and Boussinesq's force
//! (physics §4.6; Zwanzig & Bixon 1970, Phys. Rev. A 2:2005, doi:10.1103/PhysRevA.2.2005).

use super::beside_fields::law_conflict;
use super::{Effect, EffectParameter, FieldModel, Spatial, Stage, Stages};
use crate::distribution::Distribution;
use crate::error::Result;
use crate::experiment::Scales;
use crate::number::Dual;
use crate::parameter::{ParameterSpec, Support};
use crate::rheology::BaseLaw;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("inertia.density_scale", "1", Support::POSITIVE),
    symbol: "d",
    null: |_| Some(0.0),
    prior: |_| Distribution::HalfNormal { sd: 1.0 },
    prior_source: "chosen: the densities of the experiment stand at 1",
    finite_step: None,
}];

/// The effect.
pub struct Inertia;

impl Effect for Inertia {
    fn slug(&self) -> &'static str {
        "inertia"
    }
    fn stage(&self) -> Stage {
        Stage::Mechanics
    }
    fn summary(&self) -> &'static str {
        "gel and robot have mass"
    }
    fn equation(&self) -> &'static str {
        "div σ = d ρ ü in the gel, F − (force of the gel) = d m ẍ of the robot"
    }
    fn parameters(&self) -> &'static [EffectParameter] {
        PARAMETERS
    }
    fn changes_field(&self) -> bool {
        true
    }
    fn field_model(&self) -> Option<FieldModel> {
        Some(FieldModel::Inertia)
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        law_conflict(base, FieldModel::Inertia)
    }
    fn apply(&self, parameters: &[Dual], _scales: &Scales, stages: &mut Stages) -> Result<()> {
        let density_scale = parameters[0];
        if !density_scale.is_constant(0.0) {
            stages.spatial = Some(Spatial::Inertia { density_scale });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_null_leaves_the_base_and_any_other_density_is_written() {
        let written = |parameter: Dual| {
            let mut stages = Stages::of_law(Vec::new());
            Inertia.apply(&[parameter], &SCALES, &mut stages).unwrap();
            stages.spatial
        };
        assert_eq!(written(0.0.into()), None);
        assert_eq!(written(1.0.into()), Some(Spatial::Inertia { density_scale: 1.0.into() }));
        assert!(written(Dual::variable(0.0)).is_some());
    }
}
