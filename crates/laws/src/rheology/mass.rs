//! Retardation spectrum of a network of springs and dashpots with a mass in parallel.

use nalgebra::DMatrix;

use super::{OscillatingMode, RetardationSpectrum, SpectralMode};
use base::number::Complex;
use base::number::Dual;

/// Returns the retardation spectrum of a network with the mass m in parallel. With s the Laplace variable, the network's modulus
/// G is given by G/s = g∞ + Σ g/(s + q). g∞ is the `constant`, and each pair in `bodies` is a weight g and a rate q. The complex
/// compliance is 1/(s F), with F = G/s + m s. The rates of the spectrum follow from the zeros of F. These are the eigenvalues of
/// the mass m on parallel Maxwell bodies, one for each q.
pub(super) fn mass_on_maxwell_bodies(constant: Dual, bodies: &[(Dual, Dual)], mass: Dual) -> RetardationSpectrum {
    let n = bodies.len() + 1;
    let mut matrix = DMatrix::<f64>::zeros(n, n);
    matrix[(0, 0)] = -constant.value / mass.value;
    for (k, (weight, rate)) in bodies.iter().enumerate() {
        // This scaling makes the two couplings of mass and body equally large.
        let coupling = (weight.value / mass.value).sqrt();
        matrix[(0, k + 1)] = -coupling;
        matrix[(k + 1, 0)] = coupling;
        matrix[(k + 1, k + 1)] = -rate.value;
    }
    let mut spectrum = RetardationSpectrum::empty();
    if bodies.iter().all(|(_, rate)| rate.value > 0.0) {
        let whole = bodies.iter().fold(constant, |sum, (weight, rate)| sum + *weight / *rate);
        spectrum.fluidity_per_pa_s = Dual::ONE / whole;
    }
    let value_and_slope = |s: Complex<Dual>| {
        let one = |x: Dual| Complex { re: x, im: Dual::ZERO };
        let start = (one(constant) + s * mass, one(mass));
        bodies.iter().fold(start, |(value, slope), (weight, rate)| {
            let share = (s + one(*rate)).reciprocal();
            (value + share * *weight, slope - share * share * *weight)
        })
    };
    for eigenvalue in matrix.complex_eigenvalues().iter() {
        if eigenvalue.im < 0.0 {
            continue;
        }
        let mut s = Complex::<Dual>::constant(eigenvalue.re, eigenvalue.im);
        // Two Newton steps in dual numbers make the value accurate to rounding and the derivative exact.
        for _ in 0..2 {
            let (value, slope) = value_and_slope(s);
            s = s - value * slope.reciprocal();
        }
        let (_, slope) = value_and_slope(s);
        // The mode's compliance is −1/(s² F'), which is the residue of 1/(s F) divided by the rate −s.
        let compliance = (s * s * slope).reciprocal() * Dual::constant(-1.0);
        if eigenvalue.im == 0.0 {
            spectrum.modes.push(SpectralMode { compliance_per_pa: compliance.re, rate_per_s: -s.re });
        } else {
            let both = compliance * Dual::constant(2.0);
            // The eigenvalue s with positive imaginary part gives e^{st}, so the mode's rate is −s.
            spectrum
                .oscillating
                .push(OscillatingMode { compliance_per_pa: [both.re, both.im], rate_per_s: [-s.re, -s.im] });
        }
    }
    spectrum
}
