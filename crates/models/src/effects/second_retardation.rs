//! `second-retardation`: the gel's elastic response has a second retardation time.
//!
//! A Kelvin–Voigt body in series adds (a/E)(1 − exp(−t/τ₂)) to the creep compliance J(t), with a its compliance ratio and τ₂ its
//! retardation time. E is the first Kelvin–Voigt spring of the law. For a law without such a spring, E is the modulus at the length of a
//! hold ([`super::first_body`]). Null: a = 0, where τ₂ is unidentified. Valid for a ≥ 0 and τ₂ of at least two sample intervals. A shorter
//! τ₂ is not visible as creep, and `instantaneous-elasticity` describes it with one parameter less. Collagen and hyaluronan are the two
//! networks of the vitreous. Retardation spectra with one time for each network have been fitted to the vitreous (Sharif-Kashani et al.
//! 2011, J. Biomech. 44:419). The effect applies to any law except the two-element law, which already is the Lethersich law with this
//! effect.

use super::first_body::reference_modulus_pa;
use super::{Effect, EffectDescription, EffectParameter, Stage, Stages};
use base::distribution::Distribution;
use base::error::{Error, Result};
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use laws::rheology::{BaseLaw, Element};
use record::CharacteristicSizes;

/// Returns the shortest second retardation time, in s, that the experiment can distinguish from a spring.
fn shortest_time_s(scales: &CharacteristicSizes) -> f64 {
    2.0 * scales.sample_interval_s
}

const PARAMETERS: &[EffectParameter] = &[
    EffectParameter {
        spec: ParameterSpec::new("second-retardation.compliance_ratio", "a", "1", Support::POSITIVE),
        null: &|_| Some(0.0),
        prior: &|_| Distribution::HalfNormal { sd: 0.5 },
        prior_source: "chosen: the second part's compliance is at most about that of the first part",
    },
    EffectParameter {
        spec: ParameterSpec::new("second-retardation.time_s", "τ₂", "s", Support::POSITIVE),
        null: &|_| None,
        prior: &|scales| {
            let lower = shortest_time_s(scales);
            Distribution::LogUniform { lower, upper: scales.duration_s.max(2.0 * lower) }
        },
        prior_source: "chosen: any time from two sample intervals to the duration of the record",
    },
];

/// Effect `second-retardation`: a second part of the gel responds with its own retardation time.
pub struct SecondRetardation;

impl Effect for SecondRetardation {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "second-retardation",
            stage: Stage::Mechanics,
            summary: "a second part of the gel responds with its own retardation time",
            equation: "J(t) += (a/E) (1 − exp(−t/τ₂))",
            parameters: PARAMETERS,
        }
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        (*base == BaseLaw::TwoElement).then_some(
            "it already contains this effect, and a second one would be redundant; use a network with two bodies to add a third",
        )
    }
    fn apply(&self, parameters: &[Dual], scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let (ratio, time_s) = (parameters[0], parameters[1]);
        let shortest_s = shortest_time_s(scales);
        if time_s.value < shortest_s {
            return Err(Error::numerical(
                format!("{} = {:.4e} s is below two sample intervals", PARAMETERS[1].spec.name, time_s.value),
                format!("give at least {shortest_s:.4e} s; use `instantaneous-elasticity` for shorter times"),
            ));
        }
        if !ratio.is_constant(0.0) {
            let compliance_per_pa = ratio / reference_modulus_pa(&stages.law, scales);
            stages.law.push(Element::Retarded { compliance_per_pa, time_s });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::{SCALES, compliance_per_pa};

    fn law(ratio: Dual, time_s: Dual) -> Vec<Element> {
        let mut stages = Stages::of_law(BaseLaw::Lethersich.elements(&[3.5.into(), 1.4.into(), 47.0.into()]));
        SecondRetardation.apply(&[ratio, time_s], &SCALES, &mut stages).unwrap();
        stages.law
    }

    /// Compares the Lethersich law with this effect to the two-element law in closed form. The modulus of the second Kelvin–Voigt element
    /// is Young's modulus divided by the compliance ratio. Its viscosity is this modulus times the second retardation time.
    #[test]
    fn it_is_the_two_element_law() {
        let (ratio, time_s) = (0.4, 6.0);
        let second_modulus_pa = 3.5 / ratio;
        let named = BaseLaw::TwoElement
            .creep_compliance(&[3.5, 1.4, 47.0, second_modulus_pa, time_s * second_modulus_pa])
            .unwrap();
        for t in [0.0, 0.1, 1.0, 20.0] {
            let found = compliance_per_pa(&law(ratio.into(), time_s.into()), t).value;
            assert!((found - named.at(t)).abs() < 1e-15, "{t}: {found}");
        }
    }

    #[test]
    fn derivatives_are_right_at_the_null_and_away_from_it() {
        let (t, time_s): (f64, f64) = (2.0, 6.0);
        let by_ratio = compliance_per_pa(&law(Dual::variable(0.0), time_s.into()), t).derivative;
        assert!((by_ratio - (1.0 - (-t / time_s).exp()) / 3.5).abs() < 1e-15);
        let by_time = compliance_per_pa(&law(0.4.into(), Dual::variable(time_s)), t).derivative;
        assert!((by_time + 0.4 / 3.5 * t / (time_s * time_s) * (-t / time_s).exp()).abs() < 1e-15);
    }

    #[test]
    fn times_that_the_record_does_not_resolve_are_refused() {
        let mut stages = Stages::of_law(BaseLaw::Lethersich.elements(&[Dual::ONE; 3]));
        let mut apply = |time_s: f64| SecondRetardation.apply(&[Dual::ONE, time_s.into()], &SCALES, &mut stages);
        let text = apply(1.99 * SCALES.sample_interval_s).unwrap_err().to_string();
        assert!(text.contains("second-retardation.time_s") && text.contains("two sample intervals"), "{text}");
        assert!(apply(2.0 * SCALES.sample_interval_s).is_ok());
    }
}
