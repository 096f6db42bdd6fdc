//! Complex modulus E* = E′ + iE″ of a law under an oscillation, with E′ the storage and E″ the loss modulus (physics §2).

use super::Element;
use base::number::Complex;

/// Returns the complex modulus E*(ω) in Pa of elements in series at an angular frequency ω in 1/s, without derivative.
///
/// A rigid element has compliance 0. If all elements are rigid, the modulus is infinite.
pub fn complex_modulus_pa(law: &[Element], angular_frequency_per_s: f64) -> Complex<f64> {
    reciprocal(series_per_pa(law, angular_frequency_per_s))
}

fn series_per_pa(elements: &[Element], omega_per_s: f64) -> Complex<f64> {
    elements.iter().fold(Complex { re: 0.0, im: 0.0 }, |sum, element| sum + compliance_per_pa(element, omega_per_s))
}

fn compliance_per_pa(element: &Element, omega_per_s: f64) -> Complex<f64> {
    match element {
        Element::Compliance { compliance_per_pa } => Complex { re: compliance_per_pa.value, im: 0.0 },
        Element::Retarded { compliance_per_pa, time_s } => {
            Complex { re: 1.0, im: omega_per_s * time_s.value }.reciprocal().times(compliance_per_pa.value)
        }
        Element::Series(elements) => series_per_pa(elements, omega_per_s),
        Element::Spring { .. } | Element::Dashpot { .. } | Element::Springpot { .. } | Element::Parallel(_) => {
            reciprocal(modulus_pa(element, omega_per_s))
        }
    }
}

fn modulus_pa(element: &Element, omega_per_s: f64) -> Complex<f64> {
    match element {
        Element::Spring { modulus_pa } => Complex { re: modulus_pa.value, im: 0.0 },
        Element::Dashpot { viscosity_pa_s } => Complex { re: 0.0, im: viscosity_pa_s.value * omega_per_s },
        Element::Springpot { modulus_pa, time_s, order } => {
            let size_pa = modulus_pa.value * (omega_per_s * time_s.value).powf(order.value);
            let (sin, cos) = (std::f64::consts::FRAC_PI_2 * order.value).sin_cos();
            Complex { re: size_pa * cos, im: size_pa * sin }
        }
        Element::Parallel(elements) => elements
            .iter()
            .fold(Complex { re: 0.0, im: 0.0 }, |sum, element| sum + self::modulus_pa(element, omega_per_s)),
        Element::Compliance { .. } | Element::Retarded { .. } | Element::Series(_) => {
            reciprocal(compliance_per_pa(element, omega_per_s))
        }
    }
}

/// Returns 1/z, which is infinite for z = 0, and 0 for infinite z.
fn reciprocal(z: Complex<f64>) -> Complex<f64> {
    if z.re == 0.0 && z.im == 0.0 {
        Complex { re: f64::INFINITY, im: 0.0 }
    } else if z.re.is_infinite() || z.im.is_infinite() {
        Complex { re: 0.0, im: 0.0 }
    } else {
        z.reciprocal()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rheology::{BaseLaw, RetardationSpectrum, TimeWindow};
    use base::number::Dual;

    fn duals(values: &[f64]) -> Vec<Dual> {
        values.iter().map(|value| Dual::constant(*value)).collect()
    }

    /// Compares the modulus of the Lethersich law with 1/E* = 1/(E + iωc₁) + 1/(iωc₂), computed by hand.
    #[test]
    fn lethersich_is_its_formula() {
        let [e, c1, c2] = [3.5, 1.4, 47.0];
        let law = BaseLaw::Lethersich.elements(&duals(&[e, c1, c2]));
        for omega in [1e-3, 0.1, 1.0, 30.0] {
            let modulus = complex_modulus_pa(&law, omega);
            // The expected modulus is (E + iωc₁) iωc₂ / (E + iω(c₁ + c₂)), expanded into real and imaginary parts.
            let (a, b) = (e, omega * (c1 + c2));
            let (re, im) = (-omega * c1 * omega * c2, e * omega * c2);
            let norm = a * a + b * b;
            let expected = [(re * a + im * b) / norm, (im * a - re * b) / norm];
            assert!((modulus.re / expected[0] - 1.0).abs() < 1e-12, "{omega}: {modulus:?}");
            assert!((modulus.im / expected[1] - 1.0).abs() < 1e-12, "{omega}: {modulus:?}");
        }
    }

    /// Checks that the complex compliance J*(ω) is iω ∫ J(t) e^{−iωt} dt for every named law and a network with a springpot. The
    /// creep compliance J(t) comes from the retardation spectrum, which is computed independently. The integral ends at 3,000 s,
    /// which omits 4·10⁻⁵ of the network's slow creep.
    #[test]
    fn creep_and_oscillation_are_one_law() {
        let text = "series = [{ parallel = [{ spring = \"gel\" }, { springpot = \"mesh\" }] }, { dashpot = \"flow\" }]";
        let network = crate::rheology::Network::from_text("network.toml".as_ref(), text).unwrap();
        let laws = BaseLaw::NAMED.into_iter().map(|law| (law, vec![3.5, 1.4, 47.0, 8.0, 30.0]));
        let network = (BaseLaw::Network(network), vec![3.5, 1.4, 0.4, 47.0]);
        for (law, values) in laws.chain([network]) {
            let values = &values[..law.parameters().len()];
            let elements = law.elements(&duals(values));
            let window = TimeWindow { shortest_s: 1e-4, longest_s: 1e4 };
            let spectrum = RetardationSpectrum::of_law(&elements, window).unwrap();
            for omega in [0.1, 1.0, 10.0] {
                let j = transformed(&spectrum, omega);
                let direct = reciprocal(complex_modulus_pa(&elements, omega));
                let distance = (j - direct).re.hypot((j - direct).im) / direct.re.hypot(direct.im);
                assert!(distance < 1e-4, "{law:?} at {omega}: {distance}");
            }
        }
    }

    /// Returns the complex compliance iω ∫₀^∞ J(t) e^{−iωt} dt = J(0) + ∫ J̇ e^{−iωt} dt of a creep compliance J(t). J̇ tends to
    /// the fluidity φ. The flow φt is subtracted before the integral, and its transform φ/(iω) is added.
    fn transformed(spectrum: &RetardationSpectrum, omega: f64) -> Complex<f64> {
        let j = |t: f64| spectrum.creep_compliance_per_pa(t);
        let (late, later) = (3e3, 3.1e3);
        let fluidity = (j(later) - j(late)) / (later - late);
        let rest = |t: f64| j(t) - fluidity * t;
        // The sum is the integral of e^{−iωt} over `rest`, which is linear between the nodes of a logarithmic grid.
        let nodes: Vec<f64> = (0..=60_000).map(|k| 1e-6 * 10f64.powf(9.0 * k as f64 / 60_000.0)).collect();
        let mut sum = Complex { re: rest(1e-6), im: -fluidity / omega };
        for pair in nodes.windows(2).take_while(|pair| pair[1] < late) {
            let (from, to) = (pair[0], pair[1]);
            let slope = (rest(to) - rest(from)) / (to - from);
            // The next two lines are the real and imaginary part of ∫ e^{−iωt} dt between two nodes.
            let re = ((omega * to).sin() - (omega * from).sin()) / omega;
            let im = ((omega * to).cos() - (omega * from).cos()) / omega;
            sum = sum + Complex { re: slope * re, im: slope * im };
        }
        sum
    }

    #[test]
    fn rigid_and_absent_elements_are_harmless() {
        let spring = Element::Spring { modulus_pa: Dual::constant(2.0) };
        let rigid = Element::Compliance { compliance_per_pa: Dual::constant(0.0) };
        let modulus = complex_modulus_pa(&[spring.clone(), rigid.clone()], 3.0);
        assert_eq!((modulus.re, modulus.im), (2.0, 0.0));
        let both = complex_modulus_pa(&[Element::Parallel(vec![spring, rigid])], 3.0);
        assert!(both.re.is_infinite());
    }
}
