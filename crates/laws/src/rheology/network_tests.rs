//! Tests that compare the spectra of networks with numerical inverse Laplace transforms.

use std::f64::consts::PI;

use nalgebra::Complex;
use rand::{RngExt, SeedableRng};

use super::spectrum_tests::{WINDOW, dual_compliance, times};
use super::{Element, RetardationSpectrum, stieltjes};
use base::number::Dual;

/// Returns the creep compliance J(t), as the inverse Laplace transform of J*(s)/s by the fixed Talbot method (Abate and Valkó
/// 2004, doi:10.1002/nme.995). `modulus` returns the complex modulus 1/J*(s). The method's relative error is about 1e-11.
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

/// Test network with its complex modulus, its parameters, and the indices of the parameters that are orders.
struct Law {
    name: &'static str,
    network: fn(&[Dual]) -> Element,
    modulus: fn(&[f64], Complex<f64>) -> Complex<f64>,
    parameters: &'static [f64],
    orders: &'static [usize],
}

fn constants(values: &[f64]) -> Vec<Dual> {
    values.iter().map(|value| Dual::constant(*value)).collect()
}

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

const ZOO: &[Law] = &[
    Law {
        name: "Burgers",
        network: |p| Series(vec![spring(p[0]), dashpot(p[1]), Element::kelvin_voigt(p[2], p[3])]),
        modulus: |p, s| (s.inv() / p[1] + 1.0 / p[0] + (s * p[3] + p[2]).inv()).inv(),
        parameters: &[5.0, 40.0, 2.0, 3.0],
        orders: &[],
    },
    Law {
        name: "two-element retardation",
        network: |p| Series(vec![Element::kelvin_voigt(p[0], p[1]), Element::kelvin_voigt(p[2], p[3]), dashpot(p[4])]),
        modulus: |p, s| ((s * p[1] + p[0]).inv() + (s * p[3] + p[2]).inv() + s.inv() / p[4]).inv(),
        parameters: &[3.5, 1.4, 7.0, 30.0, 47.0],
        orders: &[],
    },
    Law {
        name: "Zener: spring beside a Maxwell body",
        network: |p| Parallel(vec![spring(p[0]), Series(vec![spring(p[1]), dashpot(p[2])])]),
        modulus: |p, s| (s.inv() / p[2] + 1.0 / p[1]).inv() + p[0],
        parameters: &[1.0, 4.0, 7.0],
        orders: &[],
    },
    Law {
        name: "generalised Maxwell, two of its times alike",
        network: |p| {
            let body = |e, c| Series(vec![spring(e), dashpot(c)]);
            Parallel(vec![spring(p[0]), body(p[1], p[2]), body(p[3], p[4]), body(p[5], p[6]), dashpot(p[7])])
        },
        modulus: |p, s| {
            let body = |e: f64, c: f64| (s.inv() / c + 1.0 / e).inv();
            body(p[1], p[2]) + body(p[3], p[4]) + body(p[5], p[6]) + s * p[7] + p[0]
        },
        parameters: &[0.4, 3.0, 6.0, 2.0, 4.0, 1.0, 50.0, 0.2],
        orders: &[],
    },
    Law {
        name: "Maxwell bodies in parallel, flowing",
        network: |p| {
            Parallel(vec![Series(vec![spring(p[0]), dashpot(p[1])]), Series(vec![spring(p[2]), dashpot(p[3])])])
        },
        modulus: |p, s| (s.inv() / p[1] + 1.0 / p[0]).inv() + (s.inv() / p[3] + 1.0 / p[2]).inv(),
        parameters: &[3.0, 2.0, 0.5, 30.0],
        orders: &[],
    },
    Law {
        name: "nested: a Burgers body beside a dashpot",
        network: |p| {
            let burgers = Series(vec![spring(p[0]), dashpot(p[1]), Element::kelvin_voigt(p[2], p[3])]);
            Series(vec![Parallel(vec![burgers, dashpot(p[4])]), spring(p[5])])
        },
        modulus: |p, s| {
            let burgers = (s.inv() / p[1] + 1.0 / p[0] + (s * p[3] + p[2]).inv()).inv();
            ((burgers + s * p[4]).inv() + 1.0 / p[5]).inv()
        },
        parameters: &[5.0, 40.0, 2.0, 3.0, 1.0, 8.0],
        orders: &[],
    },
    Law {
        name: "fractional Maxwell",
        network: |p| Series(vec![spring(p[0]), springpot(p[1], p[2])]),
        modulus: |p, s| (s.powf(p[2]).inv() / p[1] + 1.0 / p[0]).inv(),
        parameters: &[4.0, 3.0, 0.6],
        orders: &[2],
    },
    Law {
        name: "fractional Zener",
        network: |p| Parallel(vec![spring(p[0]), Series(vec![spring(p[1]), springpot(p[2], p[3])])]),
        modulus: |p, s| (s.powf(p[3]).inv() / p[2] + 1.0 / p[1]).inv() + p[0],
        parameters: &[1.0, 4.0, 3.0, 0.7],
        orders: &[3],
    },
    Law {
        name: "two springpots beside each other",
        network: |p| Parallel(vec![springpot(p[0], p[1]), springpot(p[2], p[3])]),
        modulus: |p, s| s.powf(p[1]) * p[0] + s.powf(p[3]) * p[2],
        parameters: &[2.0, 0.2, 3.0, 0.8],
        orders: &[1, 3],
    },
    Law {
        name: "spring, dashpot and springpot beside each other",
        network: |p| Parallel(vec![spring(p[0]), dashpot(p[1]), springpot(p[2], p[3])]),
        modulus: |p, s| s * p[1] + s.powf(p[3]) * p[2] + p[0],
        parameters: &[1.0, 0.8, 2.0, 0.5],
        orders: &[3],
    },
    Law {
        name: "a Burgers body beside a springpot, in series with a dashpot",
        network: |p| {
            let burgers = Series(vec![spring(p[0]), dashpot(p[1]), Element::kelvin_voigt(p[2], p[3])]);
            Series(vec![Parallel(vec![burgers, springpot(p[4], p[5])]), dashpot(p[6])])
        },
        modulus: |p, s| {
            let burgers = (s.inv() / p[1] + 1.0 / p[0] + (s * p[3] + p[2]).inv()).inv();
            ((burgers + s.powf(p[5]) * p[4]).inv() + s.inv() / p[6]).inv()
        },
        parameters: &[5.0, 40.0, 2.0, 3.0, 1.0, 0.4, 30.0],
        orders: &[5],
    },
    Law {
        name: "order 0.95 beside a spring and a dashpot",
        network: |p| Parallel(vec![spring(p[0]), dashpot(p[1]), springpot(p[2], p[3])]),
        modulus: |p, s| s * p[1] + s.powf(p[3]) * p[2] + p[0],
        parameters: &[3.0, 0.1, 2.0, 0.95],
        orders: &[3],
    },
    Law {
        name: "order 0.9998 beside a spring and a dashpot",
        network: |p| Parallel(vec![spring(p[0]), dashpot(p[1]), springpot(p[2], p[3])]),
        modulus: |p, s| s * p[1] + s.powf(p[3]) * p[2] + p[0],
        parameters: &[3.0, 0.1, 2.0, 0.9998],
        orders: &[3],
    },
];

#[test]
fn networks_creep_as_the_inverse_laplace_transform_says() {
    for Law { name, network, modulus, parameters, .. } in ZOO {
        let duals = constants(parameters);
        let spectrum = RetardationSpectrum::of_law(&[network(&duals)], WINDOW).unwrap();
        let at = |t: f64| talbot(&|s| modulus(parameters, s), t);
        let size = at(WINDOW.longest_s);
        let mut largest = 0.0_f64;
        for t in times(WINDOW) {
            largest = largest.max((spectrum.creep_compliance_per_pa(t) - at(t)).abs() / size);
        }
        assert!(largest < 1e-8, "{name}: {largest:e}");
    }
}

/// Compares derivatives with central differences of the Talbot transform, which are accurate to 1e-7. The error of the
/// differences is 1e-11 divided by the step of 1e-4, plus ten times the step squared.
#[test]
fn derivatives_of_networks_equal_central_differences() {
    for Law { name, network, modulus, parameters, .. } in ZOO {
        for index in 0..parameters.len() {
            let mut duals = constants(parameters);
            duals[index].derivative = 1.0;
            let spectrum = RetardationSpectrum::of_law(&[network(&duals)], WINDOW).unwrap();
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
            assert!(largest < 2e-7, "{name} {index}: {largest:e}");
        }
    }
}

/// Compares the derivative by an order of exactly 1, at which the springpot is a dashpot, with one-sided differences of the
/// Talbot transform. The value must equal that of the network with a dashpot.
#[test]
fn the_derivative_by_an_order_of_one_is_the_limit_from_below() {
    let arms = |of_flow: Element, of_arm: Element| {
        Element::Series(vec![
            Parallel(vec![spring(2.0.into()), Element::Series(vec![spring(3.0.into()), of_arm]), dashpot(0.5.into())]),
            of_flow,
        ])
    };
    let law = |order: Dual| arms(dashpot(20.0.into()), springpot(6.0.into(), order));
    let modulus = |order: f64, s: nalgebra::Complex<f64>| {
        let arm = (s.powf(order) * 6.0).inv() + 1.0 / 3.0;
        ((arm.inv() + s * 0.5 + 2.0).inv() + (s * 20.0).inv()).inv()
    };
    let spectrum = RetardationSpectrum::of_law(&[law(Dual::variable(1.0))], WINDOW).unwrap();
    let with_dashpot = RetardationSpectrum::of_law(&[arms(dashpot(20.0.into()), dashpot(6.0.into()))], WINDOW).unwrap();
    let at = |order: f64, t: f64| talbot(&|s| modulus(order, s), t);
    let (size, h) = (at(1.0, WINDOW.longest_s), 1e-3);
    for t in times(WINDOW).into_iter().step_by(6) {
        let difference = (3.0 * at(1.0, t) - 4.0 * at(1.0 - h, t) + at(1.0 - 2.0 * h, t)) / (2.0 * h);
        let found = dual_compliance(&spectrum, t);
        assert!((found.derivative - difference).abs() < 1e-5 * size, "{t}: {} {difference}", found.derivative);
        assert!(t > 1.0 || found.derivative.abs() > 1e-9 * size);
        assert!((found.value - with_dashpot.creep_compliance_per_pa(t)).abs() < 1e-14 * size, "{t}");
    }
}

/// Checks the errors for orders outside (0, 1]. Also checks the error for the derivative by two orders of exactly 1 in parallel
/// with other elements, which cannot be computed. That error must say what to do.
#[test]
fn orders_without_a_spectrum_are_refused() {
    let two = [2.0, 3.0].map(|modulus_pa| springpot(modulus_pa.into(), Dual::variable(1.0))).to_vec();
    let network = Parallel([vec![spring(3.0.into()), dashpot(1.0.into())], two].concat());
    let error = RetardationSpectrum::of_law(&[network], WINDOW).unwrap_err().to_string();
    assert!(error.contains("below 1"), "{error}");
    for order in [0.0, 1.1, -0.5, f64::NAN] {
        let alone = springpot(2.0.into(), order.into());
        let body = Parallel(vec![spring(1.0.into()), alone.clone()]);
        let network = Parallel(vec![spring(1.0.into()), dashpot(1.0.into()), alone.clone()]);
        for element in [alone, body, network] {
            let error = RetardationSpectrum::of_law(&[element], WINDOW).unwrap_err().to_string();
            assert!(error.contains(&format!("a springpot has the order {order}\n")), "{order}: {error}");
        }
    }
}

/// Checks the error bound at 300 random parameter points of each network with springpots. Parameters cover five decades, and
/// orders 0.1 to 0.9999, so that zeros of the complex modulus occur anywhere. The seed is fixed. The test fails if any spectrum
/// cannot be computed.
#[test]
fn networks_are_right_at_random_parameters() {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(31);
    for _ in 0..300 {
        for Law { name, network, modulus, parameters, orders } in ZOO.iter().filter(|law| !law.orders.is_empty()) {
            let draw = |index: usize| {
                let coordinate: f64 = rng.random();
                if orders.contains(&index) { 0.1 + 0.8999 * coordinate } else { 10_f64.powf(5.0 * coordinate - 2.0) }
            };
            let drawn: Vec<f64> = (0..parameters.len()).map(draw).collect();
            let spectrum = RetardationSpectrum::of_law(&[network(&constants(&drawn))], WINDOW).unwrap();
            let at = |t: f64| talbot(&|s| modulus(&drawn, s), t);
            let size = at(WINDOW.longest_s);
            for t in times(WINDOW).into_iter().step_by(4) {
                let error = (spectrum.creep_compliance_per_pa(t) - at(t)).abs() / size;
                assert!(error < 1e-8, "{name} {drawn:?} at {t}: {error:e}");
            }
        }
    }
}

#[test]
fn degenerate_networks_behave() {
    let empty = RetardationSpectrum::of_law(&[Parallel(Vec::new())], WINDOW);
    assert!(empty.is_err_and(|error| error.to_string().contains("a list of parallel elements is empty")));
    // Parallel springs act as one spring, and parallel dashpots as one dashpot, also inside other bodies.
    let springs = Parallel(vec![spring(1.0.into()), spring(3.0.into())]);
    let dashpots = Parallel(vec![dashpot(2.0.into()), dashpot(5.0.into())]);
    let body = Parallel(vec![springs.clone(), dashpots.clone()]);
    let of = |law: &[Element]| RetardationSpectrum::of_law(law, WINDOW).unwrap();
    assert_eq!(of(&[springs]).creep_compliance_per_pa(1.0), 0.25);
    assert!((of(&[dashpots]).creep_compliance_per_pa(2.0) - 2.0 / 7.0).abs() < 1e-15);
    let expected = -0.25 * (-4.0 / 7.0_f64).exp_m1();
    assert!((of(&[body]).creep_compliance_per_pa(1.0) - expected).abs() < 1e-15);
    // The errors below are for a springpot whose time overflows, and for invalid windows.
    let overflow = Parallel(vec![spring(1e-30.into()), springpot(1e30.into(), 0.05.into())]);
    let overflow = RetardationSpectrum::of_law(&[overflow], WINDOW).unwrap_err().to_string();
    assert!(overflow.contains("the creep compliance of") && overflow.contains("is not finite"), "{overflow}");
    for (shortest_s, longest_s) in [(0.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
        let window = super::TimeWindow { shortest_s, longest_s };
        let error = RetardationSpectrum::of_law(&[spring(1.0.into())], window).unwrap_err().to_string();
        assert!(
            error.contains(&format!("a spectrum cannot cover times from {shortest_s} s to {longest_s} s")),
            "{error}"
        );
    }
}

#[test]
fn parameters_beyond_any_material_give_no_numbers_instead_of_a_panic() {
    let spring = |modulus_pa: f64| Element::Spring { modulus_pa: Dual::constant(modulus_pa) };
    let dashpot = |viscosity_pa_s: f64| Element::Dashpot { viscosity_pa_s: Dual::constant(viscosity_pa_s) };
    for (modulus_pa, viscosity_pa_s) in [(1e-320, 1.0), (1.0, 1e-320), (1e300, 1e-300), (f64::INFINITY, 1e300)] {
        let maxwell = |modulus_pa| Element::Series(vec![spring(modulus_pa), dashpot(viscosity_pa_s)]);
        let network = Element::Parallel(vec![maxwell(modulus_pa), maxwell(1.0)]);
        let spectrum = stieltjes::spectrum_of(&network).expect("a network without springpots");
        assert!(spectrum.modes.len() <= 4, "{modulus_pa} {viscosity_pa_s}");
    }
}
