//! A law as a sum of exponentials: what the fast convolution needs.

use base::error::{Error, Result};
use base::number::{Dual, PointScalar};

/// J(t) = J₀ + Σ aₘ (1 − e^{−rₘt}) + Re Σ Aₙ (1 − e^{−Λₙt}) + φ t.
#[derive(Debug, Clone, PartialEq)]
pub struct RetardationSpectrum<T = Dual> {
    /// J₀ in 1/Pa.
    pub instantaneous_per_pa: T,
    /// aₘ and rₘ.
    pub modes: Vec<SpectralMode<T>>,
    /// Aₙ and Λₙ.
    pub oscillating: Vec<OscillatingMode<T>>,
    /// φ in 1/(Pa·s).
    pub fluidity_per_pa_s: T,
}

/// a (1 − e^{−rt}).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectralMode<T = Dual> {
    /// a in 1/Pa.
    pub compliance_per_pa: T,
    /// r > 0 in 1/s.
    pub rate_per_s: T,
}

/// Re A (1 − e^{−Λt}) with complex A and Λ, Re Λ > 0; real part first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OscillatingMode<T = Dual> {
    /// A in 1/Pa.
    pub compliance_per_pa: [T; 2],
    /// Λ in 1/s.
    pub rate_per_s: [T; 2],
}

/// Times between which a spectrum must be right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeWindow {
    /// Shortest time after a change of the force at which the response is asked for, in s.
    pub shortest_s: f64,
    /// Longest such time, in s.
    pub longest_s: f64,
}

/// How near to its law a spectrum is. Errors are those of J at the end of the window, of 1/E for the fractional Kelvin–Voigt body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accuracy {
    /// Within 1e-8.
    Fine,
    /// Springpots within 1e-6, with two thirds of the modes: small beside any noise. Networks of springpots are [`Accuracy::Fine`] all the same.
    Fast,
}

impl RetardationSpectrum {
    /// J(t) in 1/Pa by value, t > 0 in s.
    pub fn creep_compliance_per_pa(&self, time_s: f64) -> f64 {
        let modes = self.modes.iter().map(|m| -m.compliance_per_pa.value * (-m.rate_per_s.value * time_s).exp_m1());
        let oscillating = self.oscillating.iter().map(|mode| {
            let ([a_re, a_im], [l_re, l_im]) = (mode.compliance_per_pa, mode.rate_per_s);
            let (decay, angle) = ((-l_re.value * time_s).exp(), l_im.value * time_s);
            a_re.value - decay * (a_re.value * angle.cos() + a_im.value * angle.sin())
        });
        let flow = self.fluidity_per_pa_s.value * time_s;
        self.instantaneous_per_pa.value + modes.sum::<f64>() + oscillating.sum::<f64>() + flow
    }
}

impl<T: PointScalar> RetardationSpectrum<T> {
    pub(super) fn empty() -> Self {
        let zero = T::constant(0.0);
        Self { instantaneous_per_pa: zero, modes: Vec::new(), oscillating: Vec::new(), fluidity_per_pa_s: zero }
    }

    /// Adds the spectrum of a body in series: compliances add.
    pub(super) fn extend(&mut self, other: &RetardationSpectrum) {
        let pair = |[re, im]: [Dual; 2]| [T::of(re), T::of(im)];
        self.instantaneous_per_pa += T::of(other.instantaneous_per_pa);
        self.modes.extend(other.modes.iter().map(|mode| SpectralMode {
            compliance_per_pa: T::of(mode.compliance_per_pa),
            rate_per_s: T::of(mode.rate_per_s),
        }));
        self.oscillating.extend(other.oscillating.iter().map(|mode| OscillatingMode {
            compliance_per_pa: pair(mode.compliance_per_pa),
            rate_per_s: pair(mode.rate_per_s),
        }));
        self.fluidity_per_pa_s += T::of(other.fluidity_per_pa_s);
    }

    pub(super) fn add_kelvin_voigt(&mut self, modulus_pa: Dual, viscosity_pa_s: Dual) {
        let (modulus_pa, viscosity_pa_s) = (T::of(modulus_pa), T::of(viscosity_pa_s));
        let compliance_per_pa = T::constant(1.0) / modulus_pa;
        self.modes.push(SpectralMode { compliance_per_pa, rate_per_s: modulus_pa / viscosity_pa_s });
    }
}

/// Refuses an order outside (0, 1]; at 0 a springpot is a spring.
pub(super) fn check_order(order: Dual) -> Result<()> {
    if order.value > 0.0 && order.value <= 1.0 {
        return Ok(());
    }
    Err(Error::numerical(
        format!("a springpot has the order {}", order.value),
        "give an order above 0 and up to 1; a spring is order 0",
    ))
}
