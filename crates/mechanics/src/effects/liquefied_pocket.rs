//! `liquefied-pocket`: around the robot the gel has lost elasticity.
//!
//! E → (1 − φ) E within ρ_p robot radii of the initial centre, the viscosities stay. Null: φ = 0, where ρ_p means nothing. Valid for a concentric pocket around a sphere
//! that moves much less than the pocket is wide; any ρ_p between 1.5 and 5 is meshed with element faces at the pocket's edge. The reduced model is a sum over common
//! eigenvectors of the pocket's and the rest's stiffness, each the two laws beside each other. Closed form: two concentric layers, each with the four modes of physics §4.2.
//! Liquefied lacunae are common in aged vitreous (Sebag 1987, Graefe's Arch. Clin. Exp. Ophthalmol. 225:89, doi:10.1007/BF02160337).

use super::beside_fields::law_conflict;
use super::first_body::{NO_BODY, body, elements_of, first_body_mut, in_series};
use super::{Effect, EffectParameter, FieldModel, Spatial, Stage, Stages};
use crate::distribution::Distribution;
use crate::error::{Error, Result};
use crate::experiment::Scales;
use crate::number::Dual;
use crate::parameter::{ParameterSpec, Support};
use crate::rheology::{BaseLaw, Element};

/// ρ_p that are meshed.
pub const RADIUS_RATIOS: [f64; 2] = [1.5, 5.0];
/// Share of E that stays at the least: at none the pocket would flow forever as a whole, which this does within 10⁹ retardation times.
const LEAST_SHARE: f64 = 1e-9;

const PARAMETERS: &[EffectParameter] = &[
    EffectParameter {
        spec: ParameterSpec::new("liquefied-pocket.elastic_loss", "1", Support { lower: 0.0, upper: 1.0 }),
        symbol: "φ",
        null: |_| Some(0.0),
        prior: |_| Distribution::Uniform { lower: 0.0, upper: 1.0 },
        prior_source: "chosen: any loss",
        finite_step: None,
    },
    EffectParameter {
        spec: ParameterSpec::new(
            "liquefied-pocket.radius_ratio",
            "1",
            Support { lower: RADIUS_RATIOS[0], upper: RADIUS_RATIOS[1] },
        ),
        symbol: "ρ_p",
        null: |_| None,
        prior: |_| Distribution::LogUniform { lower: RADIUS_RATIOS[0], upper: RADIUS_RATIOS[1] },
        prior_source: "chosen: any radius that is meshed",
        finite_step: None,
    },
];

/// The effect.
pub struct LiquefiedPocket;

impl Effect for LiquefiedPocket {
    fn slug(&self) -> &'static str {
        "liquefied-pocket"
    }
    fn stage(&self) -> Stage {
        Stage::Mechanics
    }
    fn summary(&self) -> &'static str {
        "around the robot the gel has lost elasticity"
    }
    fn equation(&self) -> &'static str {
        "E → (1 − φ) E within ρ_p radii of the initial centre"
    }
    fn parameters(&self) -> &'static [EffectParameter] {
        PARAMETERS
    }
    fn changes_field(&self) -> bool {
        true
    }
    fn field_model(&self) -> Option<FieldModel> {
        Some(FieldModel::Pocket)
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        let law = elements_of(base);
        let is_without_body = in_series(&law).into_iter().find_map(body).is_none();
        is_without_body.then_some(NO_BODY).or_else(|| law_conflict(base, FieldModel::Pocket))
    }
    fn shows_at(&self, _scales: &Scales) -> Option<f64> {
        Some(0.5)
    }
    fn apply(&self, parameters: &[Dual], _scales: &Scales, stages: &mut Stages) -> Result<()> {
        let (loss, radius_ratio) = (parameters[0], parameters[1]);
        if !(0.0..=1.0).contains(&loss.value) {
            return Err(Error::numerical(
                format!("{} = {} is outside [0, 1]", PARAMETERS[0].spec.name, loss.value),
                "give a share",
            ));
        }
        if loss.is_constant(0.0) {
            return Ok(());
        }
        stages.spatial = Some(Spatial::Pocket { radius_ratio, elastic_loss: loss });
        Ok(())
    }
}

/// The law inside the pocket, for the law outside.
///
/// # Errors
/// [`Error::Numerical`] for a law without a Kelvin–Voigt body in series.
pub fn pocket_law(law: &[Element], elastic_loss: Dual) -> Result<Vec<Element>> {
    let mut inside = law.to_vec();
    if let Element::Parallel(parts) = first_body_mut(&mut inside)? {
        let share = Dual::ONE - elastic_loss;
        let share = if share.value < LEAST_SHARE { Dual { value: LEAST_SHARE, ..share } } else { share };
        for part in parts {
            if let Element::Spring { modulus_pa } = part {
                *modulus_pa = *modulus_pa * share;
            }
        }
    }
    Ok(inside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_pocket_has_the_law_with_less_of_its_spring() {
        let law = |modulus_pa: f64| BaseLaw::Lethersich.elements(&[modulus_pa.into(), 1.4.into(), 47.0.into()]);
        let written = |loss: Dual| {
            let mut stages = Stages::of_law(law(4.0));
            LiquefiedPocket.apply(&[loss, 2.0.into()], &SCALES, &mut stages).unwrap();
            stages.spatial
        };
        assert_eq!(written(0.0.into()), None);
        assert!(written(0.75.into()).is_some() && written(Dual::variable(0.0)).is_some());
        assert_eq!(pocket_law(&law(4.0), 0.75.into()).unwrap(), law(1.0));
        assert_eq!(pocket_law(&law(4.0), Dual::ONE).unwrap(), law(4.0 * LEAST_SHARE));
        assert!(pocket_law(&law(4.0)[1..], Dual::ONE).is_err());
    }
}
