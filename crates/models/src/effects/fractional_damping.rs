//! `fractional-damping`: the gel's damping has a spectrum of retardation times instead of one time.
//!
//! A springpot of order α replaces the dashpot c₁ of the law's first Kelvin–Voigt body, whose spring has the modulus E. The body's stress
//! is s = E ε + E (c₁/E)^α D^α ε, with ε its strain and D^α Caputo's derivative from t = 0. Its creep compliance is therefore J_k(t) =
//! (1/E)(1 − E_α(−(t E/c₁)^α)) with the Mittag-Leffler function E_α. Null: α = 1, the dashpot. Valid for α in (0.3, 1]. For smaller α,
//! damper and spring are almost indistinguishable. Source for the fractional Kelvin–Voigt body: Mainardi & Spada 2011,
//! doi:10.1140/epjst/e2011-01387-1.
//!
//! If no Kelvin–Voigt body in series has a dashpot, the springpot replaces the law's first dashpot, in the order in which the law is
//! written. Its stress is s = (c/T)(T D)^α ε, with c the dashpot's viscosity and T the length of a hold. For any α, c is thus the viscosity
//! at the time T. The effect does not apply to a law without a dashpot.

use super::field_conflicts::MEMORY;
use super::first_body::{body, elements_of, first_body_mut, first_element_mut, is_dashpot};
use super::hold_s;
use super::{Effect, EffectDescription, EffectParameter, FieldEffect, Stage, Stages};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use laws::rheology::{BaseLaw, Element};
use record::CharacteristicSizes;

const SMALLEST_ORDER: f64 = 0.3;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("fractional-damping.order", "α", "1", Support { lower: SMALLEST_ORDER, upper: 1.0 }),
    null: &|_| Some(1.0),
    prior: &|_| Distribution::Beta { alpha: 2.0, beta: 1.0, lower: SMALLEST_ORDER, upper: 1.0 },
    prior_source: "chosen: density rising in proportion from the smallest order to the dashpot",
}];

/// Effect `fractional-damping`: the gel's damping has a spectrum of retardation times.
pub struct FractionalDamping;

impl Effect for FractionalDamping {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "fractional-damping",
            stage: Stage::Mechanics,
            summary: "the gel's damping has a spectrum of times instead of one time",
            equation: "J_k(t) = (1/E) (1 − E_α(−(t E/c₁)^α))",
            parameters: PARAMETERS,
        }
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        let has_dashpot = first_element_mut(&mut elements_of(base), is_dashpot).is_some();
        (!has_dashpot).then_some("it has no dashpot that a springpot could replace")
    }
    fn conflict_with_field(&self, _field: FieldEffect) -> Option<&'static str> {
        Some(MEMORY)
    }
    fn apply(&self, parameters: &[Dual], scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let order = parameters[0];
        if order.is_constant(1.0) {
            return Ok(());
        }
        if let Some(first) = first_body_mut(&mut stages.law, is_dashpot) {
            if let Some((modulus_pa, Element::Dashpot { viscosity_pa_s })) = body(first) {
                let springpot = Element::Springpot { modulus_pa, time_s: *viscosity_pa_s / modulus_pa, order };
                *first = Element::Parallel(vec![Element::Spring { modulus_pa }, springpot]);
            }
            return Ok(());
        }
        if let Some(first) = first_element_mut(&mut stages.law, is_dashpot)
            && let Element::Dashpot { viscosity_pa_s } = first
        {
            let time_s = Dual::constant(hold_s(scales));
            *first = Element::Springpot { modulus_pa: *viscosity_pa_s / time_s, time_s, order };
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;
    use statrs::function::erf::erfc;

    fn law(order: Dual) -> Vec<Element> {
        let mut stages = Stages::of_law(BaseLaw::TwoElement.elements(&[3.5, 1.4, 47.0, 9.0, 70.0].map(Dual::constant)));
        FractionalDamping.apply(&[order], &SCALES, &mut stages).unwrap();
        stages.law
    }

    /// Checks the order α = ½, for which the Mittag-Leffler function is E_½(−x) = e^{x²} erfc x. The numerical Laplace transform of the
    /// creep compliance is compared with 1 divided by the element's operator.
    #[test]
    fn half_order_is_the_closed_form() {
        let (modulus_pa, time_s) = (3.5, 1.4 / 3.5);
        let creep = |t: f64| (1.0 - (t / time_s).exp() * erfc((t / time_s).sqrt())) / modulus_pa;
        for p in [3.0, 10.0] {
            // The transform ∫ p e^{−pt} J(t) dt is computed by Simpson's rule up to p t = 30. The substitution t = y² makes the
            // integrand smooth at 0.
            let (n, end) = (4000, f64::sqrt(30.0 / p));
            let h = end / n as f64;
            let integral: f64 = (1..=n)
                .map(|i| {
                    let y = i as f64 * h;
                    let weight = if i == n { 1.0 } else { f64::from(2 + 2 * (i as u32 % 2)) };
                    weight * 2.0 * y * p * (-p * y * y).exp() * creep(y * y)
                })
                .sum::<f64>()
                * h
                / 3.0;
            let found = 1.0 / law(0.5.into())[0].operator_pa(1.0 / p).value;
            assert!((integral / found - 1.0).abs() < 1e-9, "p = {p}: {integral} {found}");
        }
    }

    #[test]
    fn only_the_first_body_changes_and_a_moving_null_is_written() {
        let base = BaseLaw::TwoElement.elements(&[3.5, 1.4, 47.0, 9.0, 70.0].map(Dual::constant));
        assert_eq!(law(Dual::ONE), base);
        let moving = law(Dual::variable(1.0));
        assert_eq!(moving[1..], base[1..]);
        let Some((_, Element::Springpot { order, .. })) = body(&moving[0]) else { panic!("{moving:?}") };
        assert_eq!(order.derivative, 1.0);
    }
}
