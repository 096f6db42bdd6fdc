//! Bodies with one springpot, as exponentials: the fractional Kelvin–Voigt body and the springpot alone.

use std::f64::consts::{FRAC_PI_2, PI};

use super::lumped::{Density, Node, SLOWEST, SLOWEST_OF_RISING};
use super::{OscillatingMode, RetardationSpectrum, SpectralMode, TimeWindow};
use crate::number::{Dual, Scalar};

/// Step h of the midpoint rule in ln r: its error e^{−π²/h} is 8e-10, times the integral of the density along Im u = π/2.
pub(super) const STEP: f64 = 0.47;

/// Adds the spring E and the springpot E τᵅ Dᵅ in parallel: J(t) = (1/E) (1 − E_α(−(t/τ)ᵅ)).
///
/// E_α(−zᵅ) = ∫ w(u) e^{−eᵘz} du, w(u) = (sin απ/π)/(e^{αu} + 2 cos απ + e^{−αu}), by the midpoint rule with nodes relative to 1/τ. The poles of w at
/// ±iβ, β = π(1 − α)/α, run into the real axis as α → 1. Their part of the rule's error is known: with the residue 1/(2πiα),
/// rule = integral − (2/α) Re e^{−e^{iβ}z}/(e^{2πβ/h} + 1), so it is added as one oscillating mode. At α = 1 that mode is e^{−z}, all weights
/// vanish, and the derivative by α is exact from below. From β = π/2 on the mode would grow in time, and is below the rule's error.
pub(super) fn add_kelvin_voigt(
    spectrum: &mut RetardationSpectrum,
    modulus_pa: Dual,
    time_s: Dual,
    order: Dual,
    window: TimeWindow,
) {
    let from_one = (Dual::ONE - order) * PI;
    let compliance_per_pa = Dual::ONE / modulus_pa;
    let rate_per_s = Dual::ONE / time_s;
    // e^{αu} + e^{−αu} + 2 cos απ, with 2 cos απ = 4 sin²((1 − α)π/2) − 2.
    let half_sine = (from_one * 0.5).sin();
    let middle = half_sine * half_sine * 4.0 - 2.0;
    let scaled = compliance_per_pa * STEP;
    let node = |node: Node| SpectralMode {
        compliance_per_pa: scaled * node.power / (node.power * (node.power + middle) + 1.0),
        rate_per_s: rate_per_s * node.exp_u,
    };
    let transform = |s: f64| compliance_per_pa / ((time_s * s).pow(order) + 1.0);
    let pole = from_one / order;
    let poles = if pole.value < FRAC_PI_2 {
        let share = Dual::constant(2.0) / (order * ((pole * (2.0 * PI / STEP)).exp() + 1.0));
        vec![OscillatingMode {
            compliance_per_pa: [compliance_per_pa * share, Dual::ZERO],
            rate_per_s: [pole.cos() * rate_per_s, pole.sin() * rate_per_s],
        }]
    } else {
        Vec::new()
    };
    Density {
        node,
        factor: from_one.sin() * PI.recip(),
        step: STEP,
        ln_scale: -time_s.value.ln(),
        order,
        slowest: SLOWEST,
        least_tail: 0.0,
        poles,
        compliance: transform,
    }
    .add_to(spectrum, window);
}

/// Adds the springpot G Dᵅ: J(t) = tᵅ/(G Γ(1 + α)) = (sin απ/πG) ∫ e^{−αu} (1 − e^{−eᵘt}) du; `coefficient` is G in Pa·sᵅ.
pub(super) fn add_springpot(spectrum: &mut RetardationSpectrum, coefficient: Dual, order: Dual, window: TimeWindow) {
    let compliance = Dual::ONE / coefficient;
    let node = |node: Node| SpectralMode {
        compliance_per_pa: compliance * STEP / node.power,
        rate_per_s: Dual::constant(node.exp_u),
    };
    let transform = |s: f64| compliance * (-(order * s.ln())).exp();
    let factor = ((Dual::ONE - order) * PI).sin() * PI.recip();
    Density {
        node,
        factor,
        step: STEP,
        ln_scale: 0.0,
        order,
        slowest: SLOWEST_OF_RISING,
        least_tail: 0.0,
        poles: Vec::new(),
        compliance: transform,
    }
    .add_to(spectrum, window);
}
