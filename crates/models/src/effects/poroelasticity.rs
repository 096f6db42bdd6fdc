//! `poroelasticity`: pressure drives water out of the gel's network.
//!
//! The equations are Biot's quasi-static equations with Biot's coefficient 1. The gel's network has the drained Poisson ratio ν_d and the
//! gel's shear modulus. The pore pressure is p = M (ζ − div u), with u the displacement, ζ the change of water content and M Biot's
//! modulus. 1/M = 1/(κ_u − κ_d) under the gel's time operator, with the undrained and drained bulk moduli κ_u and κ_d. Water flows at −k∇p,
//! with k its mobility. Robot and outer wall are impermeable. Null: k = 0, the undrained gel of the base model, for which ν_d is
//! unidentified. Valid for small strains. The reduced model is a sum of terms, one for each common eigenvector of storage and flow. Each
//! term is the law in parallel with a dashpot. The closed form for an unbounded medium with the undrained ratio ½ is in physics §4.9
//! (Detournay & Cheng 1993, Comprehensive Rock Engineering 2:113). The paper names solid–fluid models as its future work.

use super::{
    Effect, EffectDescription, EffectParameter, FieldEffect, LinearField, Spatial, Stage, Stages,
    apparent_viscosity_pa_s, robot_radius_m,
};
use base::distribution::Distribution;
use base::error::{Error, Result};
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use laws::rheology::AdditionalTerm;
use record::CharacteristicSizes;

const HIGHEST_DRAINED: f64 = 0.45;

/// Range of modelled drained Poisson ratios for a gel with this undrained ratio. All drained ratios are below the undrained ratio; for 0.48
/// the range is 0 to 0.45.
fn drained_range(poisson_ratio: f64) -> [f64; 2] {
    let below = 0.1 * (1.0 + poisson_ratio);
    if poisson_ratio - below.min(0.03) >= HIGHEST_DRAINED - 1e-9 {
        return [0.0, HIGHEST_DRAINED];
    }
    let upper = poisson_ratio - below.min(0.03);
    [f64::max(upper - HIGHEST_DRAINED, 0.5 * (upper - 1.0)), upper]
}

/// Returns the water's mobility, in m²/(Pa s), at which pressure diffuses over the robot's radius in about the time of a hold.
fn scale_m2_per_pa_s(scales: &CharacteristicSizes) -> f64 {
    robot_radius_m(scales).powi(2) / apparent_viscosity_pa_s(scales)
}

const PARAMETERS: &[EffectParameter] = &[
    EffectParameter {
        spec: ParameterSpec::new("poroelasticity.mobility_m2_per_pa_s", "k", "m²/(Pa s)", Support::POSITIVE),
        null: &|_| Some(0.0),
        prior: &|scales| Distribution::HalfNormal { sd: 2.0 * scale_m2_per_pa_s(scales) },
        prior_source: "chosen: pressure spreads over up to a few radii in a hold",
    },
    EffectParameter {
        spec: ParameterSpec::new(
            "poroelasticity.drained_poisson_ratio",
            "ν_d",
            "1",
            Support { lower: -1.0, upper: 0.5 },
        ),
        null: &|_| None,
        prior: &|scales| {
            let [lower, upper] = drained_range(scales.poisson_ratio.unwrap_or(0.48));
            Distribution::Uniform { lower, upper }
        },
        prior_source: "chosen: from a network without lateral expansion to one hardly more compressible than the gel",
    },
];

/// Effect `poroelasticity`: pressure drives water out of the gel's network.
pub struct Poroelasticity;

impl Effect for Poroelasticity {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "poroelasticity",
            stage: Stage::Mechanics,
            summary: "pressure drives water out of the gel's network",
            equation: "div σ' = ∇p, div u̇ + ṗ/M = div(k ∇p), σ' with the drained Poisson ratio",
            parameters: PARAMETERS,
        }
    }
    fn field(&self) -> Option<FieldEffect> {
        Some(FieldEffect::Pores(drained_range))
    }
    fn signature_size(&self, scales: &CharacteristicSizes) -> Option<f64> {
        Some(0.03 * scale_m2_per_pa_s(scales))
    }
    fn apply(&self, parameters: &[Dual], scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let (mobility_m2_per_pa_s, drained_poisson_ratio) = (parameters[0], parameters[1]);
        let [lower, upper] = drained_range(scales.poisson_ratio.unwrap_or(0.48));
        if !(lower..=upper).contains(&drained_poisson_ratio.value) {
            return Err(Error::numerical(
                format!("{} = {} is outside [{lower}, {upper}]", PARAMETERS[1].spec.name, drained_poisson_ratio.value),
                "give a drained Poisson ratio below the gel's",
            ));
        }
        if !mobility_m2_per_pa_s.is_constant(0.0) {
            stages.spatial = Some(Spatial::Linear(LinearField {
                effect: self.slug(),
                shape: Some(drained_poisson_ratio),
                beside: AdditionalTerm::Friction { compliance: mobility_m2_per_pa_s },
            }));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn drained_ratios_are_below_the_undrained_one() {
        assert_eq!(drained_range(0.48), [0.0, 0.45]);
        for ratio in [-0.999, -0.5, 0.0, 0.3, 0.499_999] {
            let [lower, upper] = drained_range(ratio);
            assert!(-1.0 < lower && lower < upper && upper < ratio, "{ratio}: {lower} {upper}");
        }
    }

    #[test]
    fn the_null_leaves_the_base_and_ratios_outside_are_refused() {
        let mut stages = Stages::of_law(Vec::new());
        let mut apply = |k: f64, ratio: f64| Poroelasticity.apply(&[k.into(), ratio.into()], &SCALES, &mut stages);
        assert!(apply(0.0, 0.3).is_ok());
        assert!(apply(1e-9, 0.47).unwrap_err().to_string().contains("drained_poisson_ratio"));
        assert!(stages.spatial.is_none());
    }
}
