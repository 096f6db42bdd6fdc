//! `strain-stiffening`: the gel's fibres stiffen with strain.
//!
//! The first Kelvin–Voigt body obeys dev s = E (1 + β ε_eq²) dev ε_k + c₁ dev ε̇_k at each point. Here s is the stress, ε_k the body's
//! strain, E its modulus, c₁ its viscosity and ε_eq² = ⅔ dev ε_k : dev ε_k. The change of volume and the other bodies stay linear. Null:
//! β = 0. ε_eq² is the lowest-order term by which an isotropic gel's stiffness can depend on its strain. Networks of semiflexible filaments
//! stiffen by much higher powers once β ε_eq² exceeds about ten (Storm et al. 2005, Nature 435:191, doi:10.1038/nature03521). The model
//! assumes small strains. In a stretched body at rest, the equivalent stress and strain obey s = E (ε + β ε³). The body is soft at first,
//! and at large stress ε → (s/(Eβ))^⅓.

use super::field_conflicts::nonlinear_conflict;
use super::{Effect, EffectDescription, EffectParameter, FieldEffect, Stage, position_range_m, robot_radius_m};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use laws::rheology::BaseLaw;
use laws::stages::{NonlinearFamily, Nonlinearity, Spatial, Stages};
use record::CharacteristicSizes;

/// Typical strain near the robot: half the range of positions divided by the robot's radius.
fn typical_strain(scales: &CharacteristicSizes) -> f64 {
    0.5 * position_range_m(scales) / robot_radius_m(scales)
}

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("strain-stiffening.coefficient", "β", "1", Support::POSITIVE),
    null: &|_| Some(0.0),
    prior: &|scales| Distribution::HalfNormal { sd: typical_strain(scales).powi(-2) },
    prior_source: "chosen: twice as stiff at a strain of half the range of positions over the robot's radius",
}];

/// Effect `strain-stiffening`: the gel stiffens with strain.
pub struct StrainStiffening;

impl Effect for StrainStiffening {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "strain-stiffening",
            stage: Stage::Mechanics,
            summary: "the gel stiffens with strain",
            equation: "dev s = E (1 + β ε_eq²) dev ε_k + c₁ dev ε̇_k",
            parameters: PARAMETERS,
        }
    }
    fn field(&self) -> Option<FieldEffect> {
        Some(FieldEffect::Nonlinear(NonlinearFamily::StrainStiffening))
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        nonlinear_conflict(base)
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let coefficient = parameters[0];
        if !coefficient.is_constant(0.0) {
            stages.spatial = Some(Spatial::Nonlinear(Nonlinearity::StrainStiffening { coefficient }));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_null_leaves_the_base_and_any_other_coefficient_is_written() {
        let written = |parameter: Dual| {
            let mut stages = Stages::of_law(Vec::new());
            StrainStiffening.apply(&[parameter], &SCALES, &mut stages).unwrap();
            stages.spatial
        };
        assert_eq!(written(0.0.into()), None);
        let law = Nonlinearity::StrainStiffening { coefficient: 0.4.into() };
        assert_eq!(written(0.4.into()), Some(Spatial::Nonlinear(law)));
        assert!(written(Dual::variable(0.0)).is_some());
    }

    /// Checks the numbers in the prior's source. A range of 0.98 mm around a robot of radius 0.275 mm gives a strain of 1.8.
    #[test]
    fn the_prior_doubles_the_stiffness_at_the_experiments_strain() {
        let sd = (PARAMETERS[0].prior)(&SCALES).quantile(0.682_689_492);
        let strain = typical_strain(&SCALES);
        assert!((strain - 1.78).abs() < 0.005 && (1.0 + sd * strain * strain - 2.0).abs() < 1e-6, "{sd} {strain}");
    }
}
