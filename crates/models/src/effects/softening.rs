//! `softening`: the gel grows softer, or sets, during the measurement.
//!
//! The stress of every element is multiplied by e^{−rt}, with r the softening rate and t the time from the record's start. For quasi-static
//! linear laws this equals the response to the force F e^{rt}, with F the actual force. Null: r = 0. A gel with r < 0 grows stiffer. Valid
//! while the whole gel changes uniformly. Excised vitreous lost four fifths of its modulus in its first hour (Nickerson et al. 2008, J.
//! Biomech. 41:1840), which is r of about 4·10⁻⁴ 1/s. The robot itself may break the network faster. A gel that is poured before the
//! measurement sets instead.

use super::field_conflicts::AGEING;
use super::{Effect, EffectDescription, EffectParameter, FieldEffect, Stage, Stages};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use record::CharacteristicSizes;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("softening.rate_per_s", "r", "1/s", Support::REAL),
    null: &|_| Some(0.0),
    prior: &|scales| Distribution::Normal { mean: 0.0, sd: 0.5 / scales.duration_s },
    prior_source: "chosen: symmetric; two standard deviations mean that the stiffness falls to about a third over the record, or triples",
}];

/// Effect `softening`: the gel grows softer, or sets, during the measurement.
pub struct Softening;

impl Effect for Softening {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "softening",
            stage: Stage::Mechanics,
            summary: "the gel grows softer, or sets, during the measurement",
            equation: "s = e^{−rt} · (law of the strains)",
            parameters: PARAMETERS,
        }
    }
    fn conflict_with_field(&self, _field: FieldEffect) -> Option<&'static str> {
        Some(AGEING)
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        stages.softening_rate_per_s += parameters[0];
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    /// Checks the rate that the module's documentation names: with it, the modulus falls fivefold in an hour.
    #[test]
    fn a_fivefold_loss_in_an_hour_is_the_rate_that_the_text_names() {
        let mut stages = Stages::of_law(Vec::new());
        Softening.apply(&[Dual::variable(5_f64.ln() / 3600.0)], &SCALES, &mut stages).unwrap();
        let rate_per_s = stages.softening_rate_per_s;
        assert!((rate_per_s.value - 4e-4).abs() < 0.5e-4);
        assert!(((-rate_per_s.value * 3600.0).exp() - 0.2).abs() < 1e-12);
        assert_eq!(rate_per_s.derivative, 1.0);
    }

    #[test]
    fn the_prior_allows_the_loss_and_the_gain_that_its_source_names() {
        let [lower, upper] = [0.025, 0.975].map(|p| (PARAMETERS[0].prior)(&SCALES).quantile(p));
        assert!((lower + upper).abs() < 1e-12 * upper);
        let loss = 1.0 - (-upper * SCALES.duration_s).exp();
        assert!((loss - 2.0 / 3.0).abs() < 0.05, "{loss}");
        assert!(((upper * SCALES.duration_s).exp() - 3.0).abs() < 0.4);
    }
}
