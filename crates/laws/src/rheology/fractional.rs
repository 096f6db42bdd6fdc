//! Retardation spectra of bodies with one springpot, as sums of exponentials. The bodies are the fractional Kelvin–Voigt body and
//! the single springpot.

use std::f64::consts::{FRAC_PI_2, PI};

use super::lumped::{Density, FAST, FINE, Node, Rule};
use super::spectrum::Accuracy;
use super::{OscillatingMode, RetardationSpectrum, SpectralMode, TimeWindow};
use base::number::PointScalar;

/// Fractional Kelvin–Voigt body: a spring of modulus E and a springpot E τᵅ Dᵅ in parallel, with the time τ and order α. Its
/// creep compliance is J(t) = (1/E) (1 − E_α(−(t/τ)ᵅ)), with E_α the Mittag-Leffler function.
///
/// Let z = t/τ. Then E_α(−zᵅ) = ∫ w(u) e^{−eᵘz} du, with the density w(u) = (sin απ/π)/(e^{αu} + 2 cos απ + e^{−αu}) of the
/// logarithmic rate u. The midpoint rule of step h computes the integral. The poles of w at ±iβ, with β = π(1 − α)/α, approach
/// the real axis as α → 1. Their residue 1/(2πiα) gives the rule's error: rule = integral − (2/α) Re e^{−e^{iβ}z}/(e^{2πβ/h} +
/// 1). One oscillating mode is added to correct this error. At α = 1 the mode is e^{−z}, all weights vanish, and the derivative
/// by α is exact from below. For β ≥ π/2 the mode would grow in time. It is then below the rule's error and is omitted.
pub(super) struct FractionalBody<T> {
    pub modulus_pa: T,
    pub time_s: T,
    pub order: T,
}

/// Springpot of order α, whose stress is G times the derivative of order α of the strain. `coefficient` is G in Pa·sᵅ. The creep
/// compliance is J(t) = tᵅ/(G Γ(1 + α)) = (sin απ/πG) ∫ e^{−αu} (1 − e^{−eᵘt}) du, with u the logarithm of the rate.
pub(super) struct Springpot<T> {
    pub coefficient: T,
    pub order: T,
}

fn rule_of(accuracy: Accuracy) -> Rule {
    match accuracy {
        Accuracy::Fine => FINE,
        Accuracy::Fast => FAST,
    }
}

impl<T: PointScalar> FractionalBody<T> {
    pub fn add_to(&self, spectrum: &mut RetardationSpectrum<T>, window: TimeWindow, accuracy: Accuracy) {
        let Self { modulus_pa, time_s, order } = *self;
        let rule = rule_of(accuracy);
        let one = T::constant(1.0);
        let from_one = (one - order) * PI;
        let compliance_per_pa = one / modulus_pa;
        let rate_per_s = one / time_s;
        // The density's denominator is e^{αu} + e^{−αu} + 2 cos απ. The identity 2 cos απ = 4 sin²((1 − α)π/2) − 2 avoids
        // cancellation near α = 1.
        let half_sine = (from_one * 0.5).sin();
        let middle = half_sine * half_sine * 4.0 - T::constant(2.0);
        let scaled = compliance_per_pa * rule.step;
        let node = |node: Node<T>| SpectralMode {
            compliance_per_pa: scaled * node.power / (node.power * (node.power + middle) + one),
            rate_per_s: rate_per_s * node.exp_u,
        };
        let pole = from_one / order;
        let pole = (pole.value() < FRAC_PI_2).then(|| {
            let share = T::constant(2.0) / (order * ((pole * (2.0 * PI / rule.step)).exp() + one));
            OscillatingMode {
                compliance_per_pa: [compliance_per_pa * share, T::constant(0.0)],
                rate_per_s: [pole.cos() * rate_per_s, pole.sin() * rate_per_s],
            }
        });
        Density {
            node,
            factor: from_one.sin() * PI.recip(),
            rule,
            slowest: rule.slowest,
            ln_scale: -time_s.value().ln(),
            order,
            least_tail: 0.0,
            poles: pole.as_slice(),
            compliance: |s: f64| compliance_per_pa / ((time_s * s).pow(order) + one),
        }
        .add_to(spectrum, window);
    }
}

impl<T: PointScalar> Springpot<T> {
    pub fn add_to(&self, spectrum: &mut RetardationSpectrum<T>, window: TimeWindow, accuracy: Accuracy) {
        let Self { coefficient, order } = *self;
        let rule = rule_of(accuracy);
        let compliance = T::constant(1.0) / coefficient;
        let node = |node: Node<T>| SpectralMode {
            compliance_per_pa: compliance * rule.step / node.power,
            rate_per_s: T::constant(node.exp_u),
        };
        Density {
            node,
            factor: ((T::constant(1.0) - order) * PI).sin() * PI.recip(),
            rule,
            slowest: rule.slowest_of_rising,
            ln_scale: 0.0,
            order,
            least_tail: 0.0,
            poles: &[],
            compliance: |s: f64| compliance * (-(order * s.ln())).exp(),
        }
        .add_to(spectrum, window);
    }
}
