//! Any network with springpots: its density of retardation rates from the branch cut of its complex compliance.
//!
//! J*(s) has no singularity off the negative axis, so J(t) = J₀ + φt + ∫ L(u) (1 − e^{−eᵘt}) du with L(u) = −(1/π) Im J*(e^{u + iπ}). A springpot
//! in parallel with anything keeps the poles of the rest off the axis.

use std::f64::consts::PI;
use std::ops::Add;

use super::fractional::STEP;
use super::lumped::{Density, Node, SLOWEST_OF_RISING};
use super::{Element, RetardationSpectrum, SpectralMode, TimeWindow};
use crate::error::{Error, Result};
use crate::number::{Dual, Scalar};

/// Times at which two steps of the midpoint rule are compared.
const N_TIMES: u32 = 13;
/// Largest difference between them, relative to J at the window's end.
const TOLERANCE: f64 = 4e-9;
/// How often the step may be refined.
const MAX_REFINEMENTS: i32 = 9;
/// Ratio of a step to the one before.
const REFINEMENT: f64 = 0.75;

/// Adds the spectrum of a network over a window.
///
/// # Errors
/// [`Error::Numerical`] where the density is too sharp for the finest step.
pub(super) fn add_network(spectrum: &mut RetardationSpectrum, network: &Element, window: TimeWindow) -> Result<()> {
    let mut coarse = spectrum_at(network, STEP, window);
    let mut difference = f64::NAN;
    for refinement in 1..=MAX_REFINEMENTS {
        let fine = spectrum_at(network, STEP * REFINEMENT.powi(refinement), window);
        difference = largest_difference(&coarse, &fine, window);
        if difference <= TOLERANCE {
            spectrum.extend(coarse);
            return Ok(());
        }
        coarse = fine;
    }
    Err(Error::numerical(
        format!("the creep of this network of springpots cannot be computed: its error is still {difference:.1e}"),
        "keep the orders of springpots in parallel with other elements below about 0.95, or write a dashpot for order 1",
    ))
}

fn spectrum_at(network: &Element, step: f64, window: TimeWindow) -> RetardationSpectrum {
    let node = |node: Node| {
        let compliance = modulus_at(network, Frequency { ln_size_per_s: node.u, is_negative: true }).reciprocal();
        SpectralMode { compliance_per_pa: compliance.im * (-step / PI), rate_per_s: Dual::constant(node.exp_u) }
    };
    let transform =
        |s: f64| modulus_at(network, Frequency { ln_size_per_s: s.ln(), is_negative: false }).reciprocal().re;
    let mut spectrum = RetardationSpectrum::empty();
    Density {
        node,
        factor: Dual::ONE,
        step,
        ln_scale: 0.0,
        order: Dual::ZERO,
        slowest: SLOWEST_OF_RISING,
        poles: Vec::new(),
        compliance: transform,
    }
    .add_to(&mut spectrum, window);
    spectrum
}

fn largest_difference(a: &RetardationSpectrum, b: &RetardationSpectrum, window: TimeWindow) -> f64 {
    let ratio = window.longest_s / window.shortest_s;
    let size = b.creep_compliance_per_pa(window.longest_s).abs();
    let at = |k: u32| window.shortest_s * ratio.powf(f64::from(k) / f64::from(N_TIMES - 1));
    (0..N_TIMES)
        .map(|k| (a.creep_compliance_per_pa(at(k)) - b.creep_compliance_per_pa(at(k))).abs() / size)
        .fold(0.0, |largest, difference| if difference > largest || difference.is_nan() { difference } else { largest })
}

/// s = e^{ln_size} or, on the upper side of the cut, e^{ln_size + iπ}.
#[derive(Clone, Copy)]
struct Frequency {
    ln_size_per_s: f64,
    is_negative: bool,
}

impl Frequency {
    /// s, which is real on either side.
    fn real(self) -> f64 {
        let size = self.ln_size_per_s.exp();
        if self.is_negative { -size } else { size }
    }
}

/// G*(s).
fn modulus_at(element: &Element, s: Frequency) -> ComplexDual {
    match element {
        Element::Spring { modulus_pa } => ComplexDual { re: *modulus_pa, im: Dual::ZERO },
        Element::Dashpot { viscosity_pa_s } => ComplexDual { re: *viscosity_pa_s * s.real(), im: Dual::ZERO },
        Element::Compliance { compliance_per_pa } => ComplexDual { re: Dual::ONE / *compliance_per_pa, im: Dual::ZERO },
        Element::Retarded { compliance_per_pa, time_s } => {
            ComplexDual { re: (*time_s * s.real() + 1.0) / *compliance_per_pa, im: Dual::ZERO }
        }
        Element::Springpot { modulus_pa, time_s, order } => {
            let size = *modulus_pa * (*order * (time_s.ln() + s.ln_size_per_s)).exp();
            if s.is_negative {
                // cos απ and sin απ from 1 − α, so that they keep their digits near α = 1.
                let from_one = (Dual::ONE - *order) * PI;
                ComplexDual { re: -size * from_one.cos(), im: size * from_one.sin() }
            } else {
                ComplexDual { re: size, im: Dual::ZERO }
            }
        }
        Element::Series(elements) => {
            elements.iter().fold(ComplexDual::ZERO, |sum, part| sum + modulus_at(part, s).reciprocal()).reciprocal()
        }
        Element::Parallel(elements) => elements.iter().fold(ComplexDual::ZERO, |sum, part| sum + modulus_at(part, s)),
    }
}

#[derive(Debug, Clone, Copy)]
struct ComplexDual {
    re: Dual,
    im: Dual,
}

impl ComplexDual {
    const ZERO: Self = Self { re: Dual::ZERO, im: Dual::ZERO };

    fn reciprocal(self) -> Self {
        let square = self.re * self.re + self.im * self.im;
        Self { re: self.re / square, im: -self.im / square }
    }
}

impl Add for ComplexDual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}
