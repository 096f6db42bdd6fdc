//! Tests of laws with an additional element in parallel. They compare the terms' spectra with the terms' definition at real
//! Laplace variables, and closed forms with the general algorithm. Derivatives are compared with finite differences.

use super::spectrum::Accuracy;
use super::*;

const WINDOW: TimeWindow = TimeWindow { shortest_s: 0.05, longest_s: 40.0 };
const LETHERSICH: [f64; 3] = [3.527, 1.402, 47.370];

fn law(base: BaseLaw, parameters: &[f64]) -> Vec<Element> {
    base.elements(&parameters.iter().map(|value| Dual::constant(*value)).collect::<Vec<_>>())
}

fn term(weight: f64, number: f64) -> SpreadTerm {
    SpreadTerm { weight: weight.into(), number: number.into() }
}

fn spread(law: &[Element], beside: &AdditionalTerm, terms: &[SpreadTerm]) -> RetardationSpectrum {
    RetardationSpectrum::spread(law, beside, terms, WINDOW, Accuracy::Fine).unwrap()
}

/// Returns the complex compliance J*(s) of a spectrum at a real s.
fn transform(spectrum: &RetardationSpectrum, s: f64) -> f64 {
    let modes =
        spectrum.modes.iter().map(|m| m.compliance_per_pa.value * m.rate_per_s.value / (s + m.rate_per_s.value));
    let oscillating = spectrum.oscillating.iter().map(|mode| {
        let [a, l] =
            [mode.compliance_per_pa, mode.rate_per_s].map(|[re, im]| nalgebra::Complex::new(re.value, im.value));
        (a * l / (l + s)).re
    });
    spectrum.instantaneous_per_pa.value
        + spectrum.fluidity_per_pa_s.value / s
        + modes.sum::<f64>()
        + oscillating.sum::<f64>()
}

/// Returns the modulus 1/J*(s) of a named law at a real s, from its springs and dashpots.
fn modulus(parameters: &[f64], s: f64) -> f64 {
    let kelvin_voigt = |e: f64, c: f64| 1.0 / (e + c * s);
    let [e, c1, c2] = [parameters[0], parameters[1], parameters[2]];
    let beyond = match parameters.len() {
        3 => 0.0,
        4 => 1.0 / parameters[3],
        _ => kelvin_voigt(parameters[3], parameters[4]),
    };
    1.0 / (kelvin_voigt(e, c1) + 1.0 / (c2 * s) + beyond)
}

const LAWS: [(BaseLaw, &[f64]); 3] = [
    (BaseLaw::Lethersich, &LETHERSICH),
    (BaseLaw::Burgers, &[3.527, 1.402, 47.370, 20.0]),
    (BaseLaw::TwoElement, &[3.527, 1.402, 47.370, 8.0, 30.0]),
];

fn assert_is(spectrum: &RetardationSpectrum, exact: impl Fn(f64) -> f64, what: &str) {
    for s in [1e-3, 0.02, 0.3, 2.0, 17.0, 400.0] {
        let error = transform(spectrum, s) / exact(s) - 1.0;
        assert!(error.abs() < 1e-9, "{what} at s = {s}: {error:e}");
    }
}

#[test]
fn terms_are_what_they_are_defined_as() {
    for (base, parameters) in LAWS {
        let law_of = law(base, parameters);
        let soft = law(base, &[&[0.3 * parameters[0]], &parameters[1..]].concat());
        let soft_modulus = |s: f64| modulus(&[&[0.3 * parameters[0]], &parameters[1..]].concat(), s);
        for (weight, number) in [(0.7, 0.6), (0.2, 0.02), (1.3, 0.99)] {
            let terms = [term(weight, number)];
            let friction = AdditionalTerm::Friction { compliance: 0.4.into() };
            let exact = |s: f64| weight / (modulus(parameters, s) + number * s / 0.4);
            assert_is(&spread(&law_of, &friction, &terms), exact, "friction");
            let exact = |s: f64| weight / (number * soft_modulus(s) + (1.0 - number) * modulus(parameters, s));
            assert_is(&spread(&law_of, &AdditionalTerm::Law(soft.clone()), &terms), exact, "two laws");
            let spring = AdditionalTerm::Spring { compliance_per_pa: 0.4.into() };
            let exact = |s: f64| weight / (number / 0.4 + (1.0 - number) * modulus(parameters, s));
            assert_is(&spread(&law_of, &spring, &terms), exact, "spring");
            // The mass scales give overdamped and oscillating responses.
            for scale in [1e-3, 1.0, 50.0] {
                let exact = |s: f64| weight / (modulus(parameters, s) + number * scale * s * s);
                assert_is(&spread(&law_of, &AdditionalTerm::Mass { scale: scale.into() }, &terms), exact, "mass");
            }
        }
    }
}

/// Compares the closed forms of the Lethersich law with the general algorithm, by creep compliances over time.
#[test]
fn closed_forms_agree_with_the_general_way() {
    let direct = law(BaseLaw::Lethersich, &LETHERSICH);
    // This law has its elements in another order, so the general algorithm computes it.
    let turned = vec![direct[1].clone(), direct[0].clone()];
    let soft = |law: &[Element]| {
        law.iter()
            .map(|element| match element {
                Element::Parallel(_) => Element::kelvin_voigt(0.5.into(), LETHERSICH[1].into()),
                other => other.clone(),
            })
            .collect::<Vec<_>>()
    };
    for number in [0.01, 0.5, 0.9] {
        let terms = [term(0.4, number), term(0.6, 0.3 * number)];
        let pairs = [
            (AdditionalTerm::Friction { compliance: 2.0.into() }, AdditionalTerm::Friction { compliance: 2.0.into() }),
            (
                AdditionalTerm::Spring { compliance_per_pa: 0.2.into() },
                AdditionalTerm::Spring { compliance_per_pa: 0.2.into() },
            ),
            (AdditionalTerm::Mass { scale: 0.1.into() }, AdditionalTerm::Mass { scale: 0.1.into() }),
            (AdditionalTerm::Mass { scale: 30.0.into() }, AdditionalTerm::Mass { scale: 30.0.into() }),
            (AdditionalTerm::Law(soft(&direct)), AdditionalTerm::Law(soft(&turned))),
        ];
        for (one, other) in pairs {
            let (fast, general) = (spread(&direct, &one, &terms), spread(&turned, &other, &terms));
            for t in [0.05, 0.7, 5.0, 40.0] {
                let error = fast.creep_compliance_per_pa(t) / general.creep_compliance_per_pa(t) - 1.0;
                assert!(error.abs() < 1e-9, "{one:?}, {number}, {t}: {error:e}");
            }
        }
    }
}

/// Returns the creep compliance J(t) of a spectrum at a time, with its derivative.
fn creep(spectrum: &RetardationSpectrum, t: f64) -> Dual {
    let modes = spectrum.modes.iter().map(|m| m.compliance_per_pa * -(m.rate_per_s * -t).exp_m1());
    let oscillating = spectrum.oscillating.iter().map(|mode| {
        let ([a_re, a_im], [l_re, l_im]) = (mode.compliance_per_pa, mode.rate_per_s);
        let (decay, angle) = ((l_re * -t).exp(), l_im * t);
        a_re - decay * (a_re * angle.cos() + a_im * angle.sin())
    });
    let start = spectrum.instantaneous_per_pa + spectrum.fluidity_per_pa_s * t;
    modes.chain(oscillating).fold(start, |sum, part| sum + part)
}

use base::number::Scalar;

#[test]
fn derivatives_agree_with_finite_differences() {
    for (base, parameters) in LAWS {
        let elements = |moved: Option<usize>, step: f64, seed: bool| {
            let number = |(i, value): (usize, &f64)| match moved {
                Some(k) if k == i => Dual { value: value + step, derivative: f64::from(u8::from(seed)) },
                _ => Dual::constant(*value),
            };
            base.elements(&parameters.iter().enumerate().map(number).collect::<Vec<_>>())
        };
        let kinds: [fn(Dual, Vec<Element>) -> AdditionalTerm; 4] = [
            |b, _| AdditionalTerm::Friction { compliance: b },
            |b, _| AdditionalTerm::Spring { compliance_per_pa: b },
            |d, _| AdditionalTerm::Mass { scale: d },
            |e, law| {
                let soft = law.into_iter().map(|element| match element {
                    Element::Parallel(_) => Element::kelvin_voigt(e, 1.402.into()),
                    other => other,
                });
                AdditionalTerm::Law(soft.collect())
            },
        ];
        for kind in kinds {
            // The derivatives are by the effect's parameter, by each of the law's parameters, and by a term's factor.
            for what in 0..parameters.len() + 2 {
                let at = |step: f64, seed: bool, t: f64| {
                    let moved = Dual { value: 0.9 + step, derivative: f64::from(u8::from(seed)) };
                    let dual = if what == 0 { moved } else { 0.9.into() };
                    let law_of = elements(what.checked_sub(1), step, seed);
                    let mut terms = [term(0.7, 0.3), term(0.3, 0.05)];
                    if what == parameters.len() + 1 {
                        terms[0].number = Dual { value: 0.3 + step, derivative: f64::from(u8::from(seed)) };
                    }
                    // The first dashpot of the second law is constant. All other parameters of the second law have a derivative.
                    let soft = law_of.clone();
                    creep(&spread(&law_of, &kind(dual, soft), &terms), t)
                };
                if what == 2 {
                    continue;
                }
                for t in [0.3, 4.0] {
                    let h = 1e-5;
                    let difference = (at(h, false, t).value - at(-h, false, t).value) / (2.0 * h);
                    let found = at(0.0, true, t).derivative;
                    assert!(
                        (found - difference).abs() < 2e-7 * (1.0 + difference.abs()),
                        "{base:?} {what}: {found} {difference}"
                    );
                }
            }
        }
    }
}

/// Checks that a spring of zero compliance gives the base law. The derivative by the compliance is the sum of w/θ over the terms
/// with a weight w and a fraction θ > 0, as for an instantaneous spring.
#[test]
fn springs_move_off_their_null() {
    let base = law(BaseLaw::Lethersich, &LETHERSICH);
    let terms = [term(1.0, 0.0), term(0.2, 0.5), term(0.1, 1.0)];
    let plain = RetardationSpectrum::of_law(&base, WINDOW).unwrap();
    assert_eq!(spread(&base, &AdditionalTerm::Spring { compliance_per_pa: Dual::ZERO }, &terms), plain);
    for t in [0.1, 3.0] {
        let moving =
            creep(&spread(&base, &AdditionalTerm::Spring { compliance_per_pa: Dual::variable(0.0) }, &terms), t);
        assert!((moving.derivative - (0.2 / 0.5 + 0.1)).abs() < 1e-13, "{moving:?}");
    }
    // A small compliance is computed by the general formula, not by the first-order limit.
    let small = creep(&spread(&base, &AdditionalTerm::Spring { compliance_per_pa: 1e-6.into() }, &terms), 3.0);
    let null = creep(&plain, 3.0);
    assert!(((small.value - null.value) / 1e-6 - (0.2 / 0.5 + 0.1)).abs() < 1e-4, "{small:?}");
}

/// Checks that zero slip gives the base law. The derivative by the compliance is the sum of w t/μ over the terms with a weight w
/// and a factor μ > 0, as for a dashpot at the time t.
#[test]
fn friction_moves_off_its_null() {
    let base = law(BaseLaw::Lethersich, &LETHERSICH);
    let terms = [term(1.0, 0.0), term(0.2, 0.5), term(0.1, 4.0)];
    let plain = RetardationSpectrum::of_law(&base, WINDOW).unwrap();
    assert_eq!(spread(&base, &AdditionalTerm::Friction { compliance: Dual::ZERO }, &terms), plain);
    let moving = creep(&spread(&base, &AdditionalTerm::Friction { compliance: Dual::variable(0.0) }, &terms), 3.0);
    assert!((moving.derivative - 3.0 * (0.2 / 0.5 + 0.1 / 4.0)).abs() < 1e-13, "{moving:?}");
}
