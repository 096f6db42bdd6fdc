//! Spectra against the Mittag-Leffler function, numerical inverse Laplace transforms and differences.

use nalgebra::Complex;
use rand::{RngExt, SeedableRng};
use std::f64::consts::PI;

use super::{Element, RetardationSpectrum, TimeWindow, mittag_leffler};
use crate::number::{Dual, Scalar};

const WINDOW: TimeWindow = TimeWindow { shortest_s: 0.05, longest_s: 40.0 };

fn times(window: TimeWindow) -> Vec<f64> {
    (0..=60).map(|k| window.shortest_s * (window.longest_s / window.shortest_s).powf(f64::from(k) / 60.0)).collect()
}

/// J(t) in dual numbers.
fn dual_compliance(spectrum: &RetardationSpectrum, t: f64) -> Dual {
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

/// The whole range t E/c₁ from 1e-6 to 1e6 in windows of about 800 to 1, whose places relative to the grid differ.
#[test]
fn fractional_kelvin_voigt_is_right_over_twelve_decades() {
    let mut largest = 0.0_f64;
    for order in ORDERS {
        for place in 0..=26 {
            let shortest_s = 1e-6 * 10_f64.powf(f64::from(place) * 0.35);
            let window =
                TimeWindow { shortest_s, longest_s: (800.0 * shortest_s).max(if place == 26 { 1e6 } else { 0.0 }) };
            // A derivative of the order keeps α = 1 from being taken for a dashpot.
            let law = fractional_kelvin_voigt(Dual::ONE, Dual::ONE, Dual::variable(order));
            let spectrum = RetardationSpectrum::of(&law, window).unwrap();
            assert!(place == 26 || (27..=31).contains(&spectrum.modes.len()), "{} modes", spectrum.modes.len());
            for t in times(window) {
                let expected = 1.0 - mittag_leffler(order, t.powf(order));
                largest = largest.max((spectrum.creep_compliance_per_pa(t) - expected).abs());
            }
        }
    }
    assert!(largest < 5e-9, "{largest:e}");
}

/// ∂E_α(−zᵅ)/∂α at fixed z, computed with mpmath 1.4.1 at 40 digits; at α = 1 the defining series continued beyond 1.
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
            let spectrum = RetardationSpectrum::of(&law, window).unwrap();
            let found = -dual_compliance(&spectrum, t).derivative * e;
            assert!((found - expected).abs() < 1e-7, "{order} {z}: {found} {expected}");
        }
    }
}

/// By order, modulus and viscosity, against central differences of the spectrum's own value; those are good to 1e-8/step.
#[test]
fn derivatives_of_the_fractional_body_equal_differences_of_the_mittag_leffler_function() {
    let at = |p: [f64; 3], t: f64| (1.0 - mittag_leffler(p[2], (t * p[0] / p[1]).powf(p[2]))) / p[0];
    let centre = [3.5, 1.4, 0.72];
    for index in 0..3 {
        let duals: [Dual; 3] =
            std::array::from_fn(|i| if i == index { Dual::variable(centre[i]) } else { centre[i].into() });
        let spectrum = RetardationSpectrum::of(&fractional_kelvin_voigt(duals[0], duals[1], duals[2]), WINDOW).unwrap();
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
    assert_eq!(RetardationSpectrum::of(&law, WINDOW).unwrap(), RetardationSpectrum::of(&plain, WINDOW).unwrap());
}

/// J(t) = tᵅ/(G Γ(1 + α)), and its derivative by α; at α = 1 that is a dashpot, and the derivative the one-sided one.
#[test]
fn a_springpot_creeps_as_a_power() {
    for order in [0.05, 0.3, 0.5, 0.9, 0.999_999, 1.0] {
        let law = [Element::Springpot { modulus_pa: 2.0.into(), time_s: 3.0.into(), order: Dual::variable(order) }];
        let spectrum = RetardationSpectrum::of(&law, WINDOW).unwrap();
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

/// Piecewise-constant force with switches off the sampling: the recursion over samples against the superposition Σ ΔF J(t − tₖ) with the
/// Mittag-Leffler function. Every switch adds the spectrum's error, so the bound is that of J times Σ|ΔF|.
#[test]
fn the_recursion_equals_the_superposition_of_exact_responses() {
    let (e, c, order) = (3.527, 1.402, 0.63);
    let switches = [(0.0, 4.6), (5.013, -9.2), (11.37, 4.0), (18.52, 7.2), (24.9, -6.6)];
    let law = fractional_kelvin_voigt(e.into(), c.into(), order.into());
    let spectrum = RetardationSpectrum::of(&law, TimeWindow { shortest_s: 0.01, longest_s: 40.0 }).unwrap();
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

/// The inverse Laplace transform of J*(s)/s by the fixed Talbot method (Abate and Valkó 2004, doi:10.1002/nme.995), with J* written down
/// here in complex numbers; its own error is about 1e-11 of J.
fn talbot(modulus: &dyn Fn(Complex<f64>) -> Complex<f64>, t: f64) -> f64 {
    let n = 24;
    let r = 2.0 * f64::from(n) / (5.0 * t);
    let transform = |s: Complex<f64>| (modulus(s) * s).inv();
    let mut sum = 0.5 * (r * t).exp() * transform(Complex::new(r, 0.0)).re;
    for k in 1..n {
        let angle = f64::from(k) * PI / f64::from(n);
        let cotangent = angle.tan().recip();
        let s = Complex::new(r * angle * cotangent, r * angle);
        let slope = Complex::new(1.0, angle + (angle * cotangent - 1.0) * cotangent);
        sum += ((s * t).exp() * transform(s) * slope).re;
    }
    sum * r / f64::from(n)
}

type Law = (&'static str, fn(&[Dual]) -> Element, fn(&[f64], Complex<f64>) -> Complex<f64>, &'static [f64]);

fn spring(e: Dual) -> Element {
    Element::Spring { modulus_pa: e }
}
fn dashpot(c: Dual) -> Element {
    Element::Dashpot { viscosity_pa_s: c }
}
fn springpot(g: Dual, order: Dual) -> Element {
    Element::Springpot { modulus_pa: g, time_s: Dual::ONE, order }
}
use Element::{Parallel, Series};

/// Name, network, its complex modulus, parameters.
const ZOO: &[Law] = &[
    (
        "Burgers",
        |p| Series(vec![spring(p[0]), dashpot(p[1]), Element::kelvin_voigt(p[2], p[3])]),
        |p, s| (s.inv() / p[1] + 1.0 / p[0] + (s * p[3] + p[2]).inv()).inv(),
        &[5.0, 40.0, 2.0, 3.0],
    ),
    (
        "two-element retardation",
        |p| Series(vec![Element::kelvin_voigt(p[0], p[1]), Element::kelvin_voigt(p[2], p[3]), dashpot(p[4])]),
        |p, s| ((s * p[1] + p[0]).inv() + (s * p[3] + p[2]).inv() + s.inv() / p[4]).inv(),
        &[3.5, 1.4, 7.0, 30.0, 47.0],
    ),
    (
        "Zener: spring beside a Maxwell body",
        |p| Parallel(vec![spring(p[0]), Series(vec![spring(p[1]), dashpot(p[2])])]),
        |p, s| (s.inv() / p[2] + 1.0 / p[1]).inv() + p[0],
        &[1.0, 4.0, 7.0],
    ),
    (
        "generalised Maxwell, two of its times alike",
        |p| {
            let body = |e, c| Series(vec![spring(e), dashpot(c)]);
            Parallel(vec![spring(p[0]), body(p[1], p[2]), body(p[3], p[4]), body(p[5], p[6]), dashpot(p[7])])
        },
        |p, s| {
            let body = |e: f64, c: f64| (s.inv() / c + 1.0 / e).inv();
            body(p[1], p[2]) + body(p[3], p[4]) + body(p[5], p[6]) + s * p[7] + p[0]
        },
        &[0.4, 3.0, 6.0, 2.0, 4.0, 1.0, 50.0, 0.2],
    ),
    (
        "Maxwell bodies in parallel, flowing",
        |p| Parallel(vec![Series(vec![spring(p[0]), dashpot(p[1])]), Series(vec![spring(p[2]), dashpot(p[3])])]),
        |p, s| (s.inv() / p[1] + 1.0 / p[0]).inv() + (s.inv() / p[3] + 1.0 / p[2]).inv(),
        &[3.0, 2.0, 0.5, 30.0],
    ),
    (
        "nested: a Burgers body beside a dashpot",
        |p| {
            let burgers = Series(vec![spring(p[0]), dashpot(p[1]), Element::kelvin_voigt(p[2], p[3])]);
            Series(vec![Parallel(vec![burgers, dashpot(p[4])]), spring(p[5])])
        },
        |p, s| {
            let burgers = (s.inv() / p[1] + 1.0 / p[0] + (s * p[3] + p[2]).inv()).inv();
            ((burgers + s * p[4]).inv() + 1.0 / p[5]).inv()
        },
        &[5.0, 40.0, 2.0, 3.0, 1.0, 8.0],
    ),
    (
        "fractional Maxwell",
        |p| Series(vec![spring(p[0]), springpot(p[1], p[2])]),
        |p, s| (s.powf(p[2]).inv() / p[1] + 1.0 / p[0]).inv(),
        &[4.0, 3.0, 0.6],
    ),
    (
        "fractional Zener",
        |p| Parallel(vec![spring(p[0]), Series(vec![spring(p[1]), springpot(p[2], p[3])])]),
        |p, s| (s.powf(p[3]).inv() / p[2] + 1.0 / p[1]).inv() + p[0],
        &[1.0, 4.0, 3.0, 0.7],
    ),
    (
        "two springpots beside each other",
        |p| Parallel(vec![springpot(p[0], p[1]), springpot(p[2], p[3])]),
        |p, s| s.powf(p[1]) * p[0] + s.powf(p[3]) * p[2],
        &[2.0, 0.2, 3.0, 0.8],
    ),
    (
        "spring, dashpot and springpot beside each other",
        |p| Parallel(vec![spring(p[0]), dashpot(p[1]), springpot(p[2], p[3])]),
        |p, s| s * p[1] + s.powf(p[3]) * p[2] + p[0],
        &[1.0, 0.8, 2.0, 0.5],
    ),
    (
        "a Burgers body beside a springpot, in series with a dashpot",
        |p| {
            let burgers = Series(vec![spring(p[0]), dashpot(p[1]), Element::kelvin_voigt(p[2], p[3])]);
            Series(vec![Parallel(vec![burgers, springpot(p[4], p[5])]), dashpot(p[6])])
        },
        |p, s| {
            let burgers = (s.inv() / p[1] + 1.0 / p[0] + (s * p[3] + p[2]).inv()).inv();
            ((burgers + s.powf(p[5]) * p[4]).inv() + s.inv() / p[6]).inv()
        },
        &[5.0, 40.0, 2.0, 3.0, 1.0, 0.4, 30.0],
    ),
    (
        "order 0.95 beside a spring and a dashpot",
        |p| Parallel(vec![spring(p[0]), dashpot(p[1]), springpot(p[2], p[3])]),
        |p, s| s * p[1] + s.powf(p[3]) * p[2] + p[0],
        &[3.0, 0.1, 2.0, 0.95],
    ),
    (
        "order 0.9998 beside a spring and a dashpot",
        |p| Parallel(vec![spring(p[0]), dashpot(p[1]), springpot(p[2], p[3])]),
        |p, s| s * p[1] + s.powf(p[3]) * p[2] + p[0],
        &[3.0, 0.1, 2.0, 0.9998],
    ),
];

#[test]
fn networks_creep_as_the_inverse_laplace_transform_says() {
    for (name, network, modulus, parameters) in ZOO {
        let duals: Vec<Dual> = parameters.iter().map(|p| Dual::constant(*p)).collect();
        let spectrum = RetardationSpectrum::of(&[network(&duals)], WINDOW).unwrap();
        let at = |t: f64| talbot(&|s| modulus(parameters, s), t);
        let size = at(WINDOW.longest_s);
        let mut largest = 0.0_f64;
        for t in times(WINDOW) {
            largest = largest.max((spectrum.creep_compliance_per_pa(t) - at(t)).abs() / size);
        }
        println!("{name}: {largest:.1e}, {} modes", spectrum.modes.len());
        assert!(largest < 1e-8, "{name}: {largest:e}");
    }
}

/// Against central differences of the Talbot transform, whose error is 1e-11/1e-4; a derivative by an order near 1 magnifies the error of the rule hundredfold.
#[test]
fn derivatives_of_networks_equal_central_differences() {
    for (name, network, modulus, parameters) in ZOO {
        for index in 0..parameters.len() {
            let mut duals: Vec<Dual> = parameters.iter().map(|p| Dual::constant(*p)).collect();
            duals[index].derivative = 1.0;
            let spectrum = RetardationSpectrum::of(&[network(&duals)], WINDOW).unwrap();
            let step = 1e-4 * parameters[index];
            let at = |sign: f64, t: f64| {
                let mut shifted = parameters.to_vec();
                shifted[index] += sign * step;
                talbot(&|s| modulus(&shifted, s), t)
            };
            let size = at(0.0, WINDOW.longest_s);
            let mut largest = 0.0_f64;
            for t in times(WINDOW).into_iter().step_by(6) {
                let difference = (at(1.0, t) - at(-1.0, t)) / (2.0 * step);
                let found = dual_compliance(&spectrum, t).derivative;
                largest = largest.max((found - difference).abs() * parameters[index] / size);
            }
            println!("{name} {index}: {largest:.1e}");
            assert!(largest < 1e-6, "{name} {index}: {largest:e}");
        }
    }
}

/// Outside (0, 1] there is no springpot. In parallel with other elements, the derivative by an order of exactly 1 is not there: refused with a remedy, not computed wrongly.
#[test]
fn orders_without_a_spectrum_are_refused() {
    let network = Parallel(vec![spring(3.0.into()), dashpot(1.0.into()), springpot(2.0.into(), Dual::variable(1.0))]);
    let error = RetardationSpectrum::of(&[network], WINDOW).unwrap_err().to_string();
    assert!(error.contains("below 1"), "{error}");
    for order in [0.0, 1.1, -0.5, f64::NAN] {
        let alone = springpot(2.0.into(), order.into());
        let body = Parallel(vec![spring(1.0.into()), alone.clone()]);
        let network = Parallel(vec![spring(1.0.into()), dashpot(1.0.into()), alone.clone()]);
        for element in [alone, body, network] {
            assert!(RetardationSpectrum::of(&[element], WINDOW).is_err(), "{order}");
        }
    }
}

/// Parameters over five decades, orders up to 1 − 1e-4: 300 draws of a body whose zeros lie anywhere. Fixed seeds; nothing here is a
/// statistical statement.
#[test]
fn networks_are_right_at_random_parameters() {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(31);
    let mut largest = 0.0_f64;
    let mut failures = 0;
    for _ in 0..60 {
        for (name, network, modulus, parameters) in &ZOO[6..] {
            let drawn: Vec<f64> = parameters
                .iter()
                .map(|p| {
                    let is_order = *p < 1.0 && [0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.95, 0.9998].contains(p);
                    let coordinate: f64 = rng.random();
                    if is_order { 0.1 + 0.8999 * coordinate } else { 10_f64.powf(5.0 * coordinate - 2.0) }
                })
                .collect();
            let duals: Vec<Dual> = drawn.iter().map(|p| Dual::constant(*p)).collect();
            let spectrum = RetardationSpectrum::of(&[network(&duals)], WINDOW);
            let Ok(spectrum) = spectrum else {
                println!("FAILED {name} {drawn:?}");
                failures += 1;
                continue;
            };
            let at = |t: f64| talbot(&|s| modulus(&drawn, s), t);
            let size = at(WINDOW.longest_s);
            for t in times(WINDOW).into_iter().step_by(4) {
                let error = (spectrum.creep_compliance_per_pa(t) - at(t)).abs() / size;
                if error > largest {
                    println!("{name} {drawn:?} {t} {error:e} {}", spectrum.modes.len());
                }
                largest = largest.max(error);
            }
        }
    }
    assert!(largest < 1e-8, "{largest:e}");
}

#[test]
fn degenerate_networks_behave() {
    let empty = RetardationSpectrum::of(&[Parallel(Vec::new())], WINDOW);
    assert!(empty.is_err());
    // Springs beside each other are a spring, dashpots a dashpot, and so inside other bodies.
    let springs = Parallel(vec![spring(1.0.into()), spring(3.0.into())]);
    let dashpots = Parallel(vec![dashpot(2.0.into()), dashpot(5.0.into())]);
    let body = Parallel(vec![springs.clone(), dashpots.clone()]);
    let of = |law: &[Element]| RetardationSpectrum::of(law, WINDOW).unwrap();
    assert_eq!(of(&[springs]).creep_compliance_per_pa(1.0), 0.25);
    assert!((of(&[dashpots]).creep_compliance_per_pa(2.0) - 2.0 / 7.0).abs() < 1e-15);
    let expected = -0.25 * (-4.0 / 7.0_f64).exp_m1();
    assert!((of(&[body]).creep_compliance_per_pa(1.0) - expected).abs() < 1e-15);
}
