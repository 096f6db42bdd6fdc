//! Tests of relaxation moduli against closed forms, and against the creep compliance by ∫ J G = t.

use super::mittag_leffler_for_tests::mittag_leffler;
use super::spectrum_tests::{WINDOW, times};
use super::{Accuracy, Element, RetardationSpectrum, TimeWindow};
use base::number::Dual;

fn spring(modulus_pa: f64) -> Element {
    Element::Spring { modulus_pa: Dual::constant(modulus_pa) }
}

fn dashpot(viscosity_pa_s: f64) -> Element {
    Element::Dashpot { viscosity_pa_s: Dual::constant(viscosity_pa_s) }
}

fn springpot(modulus_pa: f64, time_s: f64, order: f64) -> Element {
    let [modulus_pa, time_s, order] = [modulus_pa, time_s, order].map(Dual::constant);
    Element::Springpot { modulus_pa, time_s, order }
}

fn relaxation(law: &[Element]) -> RetardationSpectrum {
    RetardationSpectrum::relaxation_of_law(law, WINDOW, Accuracy::Fine).unwrap()
}

/// Largest relative distance from a closed form over the window.
fn largest_error(law: &[Element], expected: impl Fn(f64) -> f64) -> f64 {
    let relaxation = relaxation(law);
    let error = |t: f64| (relaxation.creep_compliance_per_pa(t) / expected(t) - 1.0).abs();
    times(WINDOW).into_iter().map(error).fold(0.0, f64::max)
}

#[test]
fn springs_and_dashpots_relax_as_their_closed_forms_do() {
    let maxwell = largest_error(&[spring(3.0), dashpot(12.0)], |t| 3.0 * (-t / 4.0).exp());
    // Standard linear solid: a spring in parallel with a Maxwell body.
    let solid = Element::Parallel(vec![spring(2.0), Element::Series(vec![spring(5.0), dashpot(10.0)])]);
    let solid = largest_error(&[solid], |t| 2.0 + 5.0 * (-t / 2.0).exp());
    // A Kelvin–Voigt body has its viscosity at the jump only.
    let kelvin = largest_error(&[Element::kelvin_voigt(Dual::constant(3.0), Dual::constant(0.7))], |_| 3.0);
    // Lethersich law: G(t) = g e^{−ρt} behind the jump, with ρ = E/(c₁ + c₂) and g = E c₂²/(c₁ + c₂)².
    let [e, c1, c2] = [3.5, 1.4, 47.0];
    let lethersich = [Element::kelvin_voigt(Dual::constant(e), Dual::constant(c1)), dashpot(c2)];
    let lethersich = largest_error(&lethersich, |t| e * (c2 / (c1 + c2)).powi(2) * (-t * e / (c1 + c2)).exp());
    for error in [maxwell, solid, kelvin, lethersich] {
        assert!(error < 1e-10, "{maxwell:e} {solid:e} {kelvin:e} {lethersich:e}");
    }
}

/// A springpot relaxes as G (t/τ)^−α/Γ(1 − α), and behind a spring as G E_α(−(t/τ)^α).
#[test]
fn springpots_relax_as_their_closed_forms_do() {
    for order in [0.1, 0.2, 0.5, 0.8] {
        let alone = largest_error(&[springpot(3.0, 2.0, order)], |t| {
            3.0 * (t / 2.0).powf(-order) / statrs::function::gamma::gamma(1.0 - order)
        });
        let maxwell = largest_error(&[spring(3.0), springpot(3.0, 2.0, order)], |t| {
            3.0 * mittag_leffler(order, (t / 2.0).powf(order))
        });
        println!("order {order}: {alone:e} {maxwell:e}");
        assert!(alone < 3e-8 && maxwell < 1e-8, "order {order}: {alone:e} {maxwell:e}");
    }
}

/// ∫₀ᵗ J(t − s) G(s) ds = t, for laws whose stress does not jump without limit.
#[test]
fn creep_and_relaxation_are_consistent() {
    let network = Element::Parallel(vec![spring(2.0), Element::Series(vec![spring(1.0), springpot(4.0, 3.0, 0.4)])]);
    for law in [vec![spring(3.0), dashpot(12.0)], vec![spring(3.0), springpot(5.0, 1.0, 0.6)], vec![network]] {
        let earlier = TimeWindow { shortest_s: 1e-4 * WINDOW.shortest_s, ..WINDOW };
        let (creep, relaxation) = (RetardationSpectrum::of_law(&law, earlier).unwrap(), relaxation(&law));
        // Both are sums of exponentials, so that the integral has a closed form.
        let terms = |spectrum: &RetardationSpectrum| {
            let total =
                spectrum.creep_compliance_per_pa(1e300 * f64::from(u8::from(spectrum.fluidity_per_pa_s.value == 0.0)));
            let constant = if spectrum.fluidity_per_pa_s.value == 0.0 {
                total
            } else {
                spectrum.instantaneous_per_pa.value
                    + spectrum.modes.iter().map(|m| m.compliance_per_pa.value).sum::<f64>()
            };
            let modes: Vec<[f64; 2]> =
                spectrum.modes.iter().map(|m| [-m.compliance_per_pa.value, m.rate_per_s.value]).collect();
            (constant, spectrum.fluidity_per_pa_s.value, modes)
        };
        let ((j0, flow, js), (g0, _, gs)) = (terms(&creep), terms(&relaxation));
        for t in times(WINDOW) {
            let decay = |rate: f64| -(-rate * t).exp_m1() / rate;
            let both = |p: f64, q: f64| {
                if (p - q).abs() < 1e-9 * p { t * (-p * t).exp() } else { ((-p * t).exp() - (-q * t).exp()) / (q - p) }
            };
            let mut sum = j0 * g0 * t + 0.5 * flow * g0 * t * t;
            sum += gs.iter().map(|[g, p]| j0 * g * decay(*p) + flow * g * (t - decay(*p)) / p).sum::<f64>();
            sum += js.iter().map(|[j, q]| g0 * j * decay(*q)).sum::<f64>();
            sum += js.iter().flat_map(|[j, q]| gs.iter().map(move |[g, p]| j * g * both(*p, *q))).sum::<f64>();
            assert!((sum / t - 1.0).abs() < 1e-6, "{law:?} at {t}: {}", sum / t - 1.0);
        }
    }
}

/// The derivative by a modulus agrees with a central difference.
#[test]
fn derivatives_are_those_of_the_moduli() {
    let law = |modulus: Dual| {
        let springpot =
            Element::Springpot { modulus_pa: modulus, time_s: Dual::constant(1.0), order: Dual::constant(0.4) };
        [spring(3.0), springpot]
    };
    let at = |modulus: f64, t: f64| relaxation(&law(Dual::constant(modulus))).creep_compliance_per_pa(t);
    let dual = relaxation(&law(Dual::variable(5.0)));
    for t in [0.1, 1.0, 20.0] {
        let expected = (at(5.001, t) - at(4.999, t)) / 0.002;
        let found = super::spectrum_tests::dual_compliance(&dual, t).derivative;
        assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
    }
}
