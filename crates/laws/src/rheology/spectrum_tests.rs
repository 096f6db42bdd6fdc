//! Tests that compare the spectra of fractional bodies with the Mittag-Leffler function.

use super::mittag_leffler_for_tests::mittag_leffler;
use super::{Accuracy, Element, RetardationSpectrum, TimeWindow};
use base::number::{Dual, Scalar};

pub(super) const WINDOW: TimeWindow = TimeWindow { shortest_s: 0.05, longest_s: 40.0 };

pub(super) fn times(window: TimeWindow) -> Vec<f64> {
    (0..=60).map(|k| window.shortest_s * (window.longest_s / window.shortest_s).powf(f64::from(k) / 60.0)).collect()
}

/// Returns the creep compliance J(t) of a spectrum at a time, with its derivative.
pub(super) fn dual_compliance(spectrum: &RetardationSpectrum, t: f64) -> Dual {
    let mut sum = spectrum.instantaneous_per_pa + spectrum.fluidity_per_pa_s * t;
    for mode in &spectrum.modes {
        sum = sum - mode.compliance_per_pa * (-(mode.rate_per_s * t)).exp_m1();
    }
    for mode in &spectrum.oscillating {
        let ([a_re, a_im], [l_re, l_im]) = (mode.compliance_per_pa, mode.rate_per_s);
        let (decay, angle) = ((-(l_re * t)).exp(), l_im * t);
        sum += a_re - decay * (a_re * angle.cos() + a_im * angle.sin());
    }
    sum
}

fn fractional_kelvin_voigt(e: Dual, c: Dual, order: Dual) -> Vec<Element> {
    vec![Element::Parallel(vec![
        Element::Spring { modulus_pa: e },
        Element::Springpot { modulus_pa: e, time_s: c / e, order },
    ])]
}

const ORDERS: [f64; 14] = [0.1, 0.3, 0.31, 0.4, 0.5, 0.6, 0.66, 0.67, 0.75, 0.85, 0.93, 0.99, 0.9999, 1.0];

/// Compares creep compliances with the Mittag-Leffler function at dimensionless times from 1e-6 to 1e6. The windows span a factor
/// of about 800 and have different offsets from the nodes of the midpoint rule.
#[test]
fn fractional_kelvin_voigt_is_right_over_twelve_decades() {
    let mut largest = 0.0_f64;
    for order in ORDERS {
        for place in 0..=26 {
            let shortest_s = 1e-6 * 10_f64.powf(f64::from(place) * 0.35);
            let window =
                TimeWindow { shortest_s, longest_s: (800.0 * shortest_s).max(if place == 26 { 1e6 } else { 0.0 }) };
            // The order carries a derivative, so that α = 1 is not treated as a dashpot.
            let law = fractional_kelvin_voigt(Dual::ONE, Dual::ONE, Dual::variable(order));
            let spectrum = RetardationSpectrum::of_law(&law, window).unwrap();
            assert!(place == 26 || (27..=31).contains(&spectrum.modes.len()), "{} modes", spectrum.modes.len());
            for t in times(window) {
                let expected = 1.0 - mittag_leffler(order, t.powf(order));
                largest = largest.max((spectrum.creep_compliance_per_pa(t) - expected).abs());
            }
        }
    }
    assert!(largest < 5e-9, "{largest:e}");
}

const N_FAST_MODES: usize = 20;

/// Checks that the spectrum with fewer modes has an error of at most 1e-6. Results with and without derivatives must have equal
/// bits.
#[test]
fn the_fast_spectrum_is_within_a_millionth() {
    let mut largest = 0.0_f64;
    for step in 0..=70 {
        let order = 0.3 + 0.01 * f64::from(step);
        for place in 0..=26 {
            let shortest_s = 1e-6 * 10_f64.powf(f64::from(place) * 0.35);
            let window = TimeWindow { shortest_s, longest_s: 800.0 * shortest_s };
            let law = fractional_kelvin_voigt(Dual::ONE, Dual::ONE, Dual::variable(order));
            let spectrum = RetardationSpectrum::<Dual>::of_law_with_accuracy(&law, window, Accuracy::Fast).unwrap();
            assert_eq!(spectrum.modes.len(), N_FAST_MODES);
            for t in times(window) {
                let expected = 1.0 - mittag_leffler(order, t.powf(order));
                let error = (spectrum.creep_compliance_per_pa(t) - expected).abs();
                largest = largest.max(error);
            }
            let plain = RetardationSpectrum::<f64>::of_law_with_accuracy(&law, window, Accuracy::Fast).unwrap();
            assert_eq!(plain.instantaneous_per_pa, spectrum.instantaneous_per_pa.value);
            assert_eq!(plain.fluidity_per_pa_s, spectrum.fluidity_per_pa_s.value);
            for (plain, mode) in plain.modes.iter().zip(&spectrum.modes) {
                assert_eq!(plain.compliance_per_pa, mode.compliance_per_pa.value);
                assert_eq!(plain.rate_per_s, mode.rate_per_s.value);
            }
            for (plain, mode) in plain.oscillating.iter().zip(&spectrum.oscillating) {
                assert_eq!(plain.compliance_per_pa, mode.compliance_per_pa.map(|a| a.value));
                assert_eq!(plain.rate_per_s, mode.rate_per_s.map(|r| r.value));
            }
        }
    }
    println!("{largest:e}");
    assert!(largest < 1e-6, "{largest:e}");
}

/// Orders α, each with pairs of a dimensionless time z and the derivative of the Mittag-Leffler function E_α(−zᵅ) by α at fixed
/// z. The values were computed with mpmath 1.4.1 at 40 digits. At α = 1 the defining series is continued to α above 1.
const ORDER_DERIVATIVES: [(f64, [(f64, f64); 5]); 5] = [
    (
        0.35,
        [
            (0.01, 0.679395364220513),
            (0.1, 0.457987241990097),
            (1.0, -0.145340389944097),
            (5.0, -0.530185217522151),
            (20.0, -0.68342330584112),
        ],
    ),
    (
        0.6,
        [
            (0.01, 0.299215110506271),
            (0.1, 0.430412211336379),
            (1.0, -0.140533982793533),
            (5.0, -0.494196252161097),
            (20.0, -0.388624984698578),
        ],
    ),
    (
        0.8,
        [
            (0.01, 0.127246165734118),
            (0.1, 0.345418553355454),
            (1.0, -0.119122125443464),
            (5.0, -0.44344231345045),
            (20.0, -0.182281517888908),
        ],
    ),
    (
        0.95,
        [
            (0.01, 0.063231984131364),
            (0.1, 0.267290780610882),
            (1.0, -0.0822894568823043),
            (5.0, -0.385344766829313),
            (20.0, -0.0794947637896389),
        ],
    ),
    (
        1.0,
        [
            (0.01, 0.0497296702434475),
            (0.1, 0.242000757618803),
            (1.0, -0.0650543244065084),
            (5.0, -0.360569224454371),
            (20.0, -0.0559559076541163),
        ],
    ),
];

#[test]
fn the_derivative_by_the_order_is_exact_also_at_one() {
    let (e, c) = (2.5, 4.0);
    for (order, row) in ORDER_DERIVATIVES {
        for (z, expected) in row {
            let law = fractional_kelvin_voigt(e.into(), c.into(), Dual::variable(order));
            let t = z * c / e;
            let window = TimeWindow { shortest_s: 0.3 * t, longest_s: 7.0 * t };
            let spectrum = RetardationSpectrum::of_law(&law, window).unwrap();
            let found = -dual_compliance(&spectrum, t).derivative * e;
            assert!((found - expected).abs() < 1e-7, "{order} {z}: {found} {expected}");
        }
    }
}

/// Compares derivatives by order, modulus and viscosity with central differences of the Mittag-Leffler function. The differences
/// have an error of 1e-8 divided by the step.
#[test]
fn derivatives_of_the_fractional_body_equal_differences_of_the_mittag_leffler_function() {
    let at = |p: [f64; 3], t: f64| (1.0 - mittag_leffler(p[2], (t * p[0] / p[1]).powf(p[2]))) / p[0];
    let centre = [3.5, 1.4, 0.72];
    for index in 0..3 {
        let duals: [Dual; 3] =
            std::array::from_fn(|i| if i == index { Dual::variable(centre[i]) } else { centre[i].into() });
        let spectrum =
            RetardationSpectrum::of_law(&fractional_kelvin_voigt(duals[0], duals[1], duals[2]), WINDOW).unwrap();
        for t in times(WINDOW) {
            let step = 1e-4 * centre[index];
            let shifted = |sign: f64| {
                let mut p = centre;
                p[index] += sign * step;
                at(p, t)
            };
            let expected = (shifted(1.0) - shifted(-1.0)) / (2.0 * step);
            let found = dual_compliance(&spectrum, t).derivative;
            assert!((found - expected).abs() < 1e-7, "{index} {t}: {found} {expected}");
        }
    }
}

#[test]
fn order_one_by_value_is_the_kelvin_voigt_body() {
    let law = fractional_kelvin_voigt(3.5.into(), 1.4.into(), Dual::ONE);
    let plain = [Element::kelvin_voigt(3.5.into(), 1.4.into())];
    assert_eq!(
        RetardationSpectrum::of_law(&law, WINDOW).unwrap(),
        RetardationSpectrum::of_law(&plain, WINDOW).unwrap()
    );
}

/// Checks the creep compliance J(t) = tᵅ/(G Γ(1 + α)) of a springpot with order α and modulus G, and its derivative by α. At α =
/// 1 the springpot is a dashpot and the derivative is one-sided.
#[test]
fn a_springpot_creeps_as_a_power() {
    for order in [0.05, 0.3, 0.5, 0.9, 0.999_999, 1.0] {
        let law = [Element::Springpot { modulus_pa: 2.0.into(), time_s: 3.0.into(), order: Dual::variable(order) }];
        let spectrum = RetardationSpectrum::of_law(&law, WINDOW).unwrap();
        let exact = |order: f64, t: f64| {
            t.powf(order) / (2.0 * 3_f64.powf(order) * statrs::function::gamma::gamma(1.0 + order))
        };
        let size = exact(order, WINDOW.longest_s);
        for t in times(WINDOW) {
            let found = dual_compliance(&spectrum, t);
            assert!((found.value - exact(order, t)).abs() < 5e-9 * size, "{order} {t}");
            let difference = (exact(order + 1e-5, t) - exact(order - 1e-5, t)) / 2e-5;
            assert!(
                (found.derivative - difference).abs() < 1e-7 * size,
                "{order} {t}: {} {difference}",
                found.derivative
            );
        }
    }
}

/// Compares the recursion over the rows with the superposition Σ ΔFₖ J(t − tₖ) over the changes ΔFₖ of the force at the times tₖ.
/// The creep compliance J comes from the Mittag-Leffler function. The force is piecewise constant, with switches between rows.
/// Every switch adds the spectrum's error, so the bound is the error of J times Σ|ΔFₖ|.
#[test]
fn the_recursion_equals_the_superposition_of_exact_responses() {
    let (e, c, order) = (3.527, 1.402, 0.63);
    let switches = [(0.0, 4.6), (5.013, -9.2), (11.37, 4.0), (18.52, 7.2), (24.9, -6.6)];
    let law = fractional_kelvin_voigt(e.into(), c.into(), order.into());
    let spectrum = RetardationSpectrum::of_law(&law, TimeWindow { shortest_s: 0.01, longest_s: 40.0 }).unwrap();
    let all: f64 = switches.iter().map(|(_, jump): &(f64, f64)| jump.abs()).sum();
    let mut events: Vec<f64> = (1..800).map(|i| 0.05 * f64::from(i)).collect();
    events.extend(switches.iter().map(|(t, _)| *t));
    events.sort_by(f64::total_cmp);
    let (mut force, mut now, mut flow) = (0.0, 0.0, 0.0);
    let mut states = vec![0.0; spectrum.modes.len()];
    for t in events {
        let dt = t - now;
        for (state, mode) in states.iter_mut().zip(&spectrum.modes) {
            *state += (force * mode.compliance_per_pa.value - *state) * -(-mode.rate_per_s.value * dt).exp_m1();
        }
        flow += force * spectrum.fluidity_per_pa_s.value * dt;
        now = t;
        let found = states.iter().sum::<f64>() + flow + spectrum.instantaneous_per_pa.value * force;
        let exact: f64 = switches
            .iter()
            .filter(|(at, _)| *at < t)
            .map(|(at, jump)| jump * (1.0 - mittag_leffler(order, ((t - at) * e / c).powf(order))) / e)
            .sum();
        let since = switches.iter().map(|(at, _)| t - at).filter(|since| *since >= 0.0).fold(f64::MAX, f64::min);
        if since >= 0.01 {
            assert!((found - exact).abs() < 5e-9 * all / e, "{t}: {found} {exact}");
        }
        force += switches.iter().filter(|(at, _)| *at == t).map(|(_, jump)| jump).sum::<f64>();
    }
}
