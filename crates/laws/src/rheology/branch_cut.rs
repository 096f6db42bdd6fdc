//! Retardation spectrum of any network with springpots, from the density of rates on the branch cut of its complex compliance.
//!
//! The complex compliance J*(s) of the Laplace variable s is singular only on the negative axis. The creep compliance is
//! therefore J(t) = J₀ + φt + ∫ L(u) (1 − e^{−eᵘt}) du, with J₀ the instantaneous compliance, φ the fluidity and u the logarithm
//! of a rate. The density of rates is L(u) = −(1/π) Im J*(e^{u + iπ}). A springpot in parallel with other elements moves their
//! poles away from the axis, to the next sheet beyond the cut. The closer the orders are to 1, the closer these poles are to the
//! axis. Each pole is a zero of the complex modulus G*(eᵛ) at v = u₀ + iπ with 0 < Im u₀ < π/2. It causes an error of the
//! midpoint rule of step h. An oscillating mode of rate e^{u₀} and compliance −2/(dG*/dv · (1 + e^{−2πiu₀/h})) corrects this
//! error. If the search misses a zero, the result changes when the step is refined.
//!
//! A springpot of order 1 is a dashpot and has no density, but the creep compliance has a derivative by the order. This
//! derivative is computed from networks with orders slightly below 1.

use std::f64::consts::{FRAC_PI_2, PI};

use super::lumped::{Density, FINE, Node, Rule};
use super::spectrum::check_order;
use super::{Element, OscillatingMode, RetardationSpectrum, SpectralMode, TimeWindow, stieltjes};
use base::error::{Error, Result};
use base::number::Complex;
use base::number::Dual;

/// Number of times at which two steps of the midpoint rule are compared.
const N_TIMES: u32 = 13;
/// Largest difference of the creep compliance between two steps of the midpoint rule, relative to the creep compliance at the
/// window's end.
const TOLERANCE: f64 = 4e-9;
/// Largest number of refinements of the midpoint rule's step.
const MAX_REFINEMENTS: i32 = 9;
/// Ratio of a refined step of the midpoint rule to the previous step.
const REFINEMENT: f64 = 0.75;
/// Largest number of Newton steps in the search for one zero of the complex modulus.
const MAX_NEWTON_STEPS: u32 = 20;
/// Distance between the starting points of Newton's method, in the logarithm of the rate. Zeros far from all of these points are
/// found from starting points near poles.
const START_SPACING: f64 = 2.0;
/// Distance h of the springpot's orders 1 − h and 1 − 2h, which give the derivative at order 1. The derivative's error is a few
/// times h², plus the error of the creep compliance divided by h.
const BELOW_ONE: f64 = 3e-3;
/// Largest distance of zeros and weights from the window's rates, in the logarithm of the rate. A retardation that is e²⁰ times
/// faster than the window equals a spring to 2e-9, and a retardation that is e²⁰ times slower equals flow.
const REACH: f64 = 20.0;

/// Returns the retardation spectrum of a network over a window of times.
///
/// # Errors
/// [`Error::Numerical`] if an order is outside (0, 1], if several orders are 1 and have a derivative, or if the density of rates
/// has peaks that the finest step does not resolve.
pub fn spectrum_of(network: &Element, window: TimeWindow) -> Result<RetardationSpectrum> {
    let mut leaving_one = Vec::new();
    for_each_order_derivative_at_one(&mut network.clone(), &mut |springpot| leaving_one.push(springpot.clone()));
    if let [Element::Springpot { modulus_pa, time_s, order }] = leaving_one[..] {
        return derivative_at_one(network, [modulus_pa, time_s, order], window);
    }
    check_orders(network)?;
    let zeros = zeros_beyond_the_cut(network, window);
    let mut coarse = spectrum_at(network, FINE.step, &zeros, window);
    let mut difference = f64::NAN;
    for refinement in 1..=MAX_REFINEMENTS {
        let fine = spectrum_at(network, FINE.step * REFINEMENT.powi(refinement), &zeros, window);
        difference = largest_difference(&coarse, &fine, window);
        if difference <= TOLERANCE {
            return Ok(coarse);
        }
        coarse = fine;
    }
    Err(Error::numerical(
        format!(
            "the creep of this network of springpots cannot be computed: its relative error is still {difference:.1e}"
        ),
        "keep orders away from 1 or write a dashpot for order 1, and merge springs and dashpots of nearly equal times",
    ))
}

/// Returns the spectrum of a network with one springpot whose order is 1 and has a derivative. A parabola in the order
/// interpolates the creep compliance at the orders 1, 1 − h and 1 − 2h, with h = [`BELOW_ONE`]. The result has the parabola's
/// value and derivative at 1.
fn derivative_at_one(
    network: &Element,
    [modulus_pa, time_s, order]: [Dual; 3],
    window: TimeWindow,
) -> Result<RetardationSpectrum> {
    let with = |other: Element| {
        let mut changed = network.clone();
        for_each_order_derivative_at_one(&mut changed, &mut |springpot| *springpot = other.clone());
        match stieltjes::spectrum_of(&changed) {
            Some(exact) => Ok(exact),
            None => spectrum_of(&changed, window),
        }
    };
    let below = |n: f64| with(Element::Springpot { modulus_pa, time_s, order: (1.0 - n * BELOW_ONE).into() });
    let from_one = (Dual::ONE - order) * BELOW_ONE.recip();
    let mut spectrum = RetardationSpectrum::empty();
    spectrum.add_scaled(&with(Element::Dashpot { viscosity_pa_s: modulus_pa * time_s })?, from_one * -1.5 + 1.0)?;
    spectrum.add_scaled(&below(1.0)?, from_one * 2.0)?;
    spectrum.add_scaled(&below(2.0)?, from_one * -0.5)?;
    Ok(spectrum)
}

/// Calls `each` with every springpot of a network whose order is 1 and has a derivative.
fn for_each_order_derivative_at_one(element: &mut Element, each: &mut dyn FnMut(&mut Element)) {
    match element {
        Element::Springpot { order, .. } if order.value == 1.0 && order.derivative != 0.0 => each(element),
        Element::Series(elements) | Element::Parallel(elements) => {
            elements.iter_mut().for_each(|part| for_each_order_derivative_at_one(part, each));
        }
        _ => {}
    }
}

fn check_orders(element: &Element) -> Result<()> {
    match element {
        Element::Spring { .. } | Element::Dashpot { .. } | Element::Compliance { .. } | Element::Retarded { .. } => {
            Ok(())
        }
        Element::Springpot { order, .. } if order.value == 1.0 && order.derivative != 0.0 => Err(Error::numerical(
            "the derivative by an order of 1 inside a network cannot be computed",
            "keep the orders of springpots in parallel with other elements below 1, or write a dashpot for order 1",
        )),
        Element::Springpot { order, .. } => check_order(*order),
        Element::Series(elements) | Element::Parallel(elements) => elements.iter().try_for_each(check_orders),
    }
}

fn spectrum_at(network: &Element, step: f64, zeros: &[Zero], window: TimeWindow) -> RetardationSpectrum {
    let node = |node: Node<Dual>| {
        let compliance = modulus_at(network, Complex::<Dual>::constant(node.u, PI)).value.reciprocal();
        SpectralMode { compliance_per_pa: compliance.im * (-step / PI), rate_per_s: Dual::constant(node.exp_u) }
    };
    let transform = |s: f64| modulus_at(network, Complex::<Dual>::constant(s.ln(), 0.0)).value.reciprocal().re;
    let poles: Vec<OscillatingMode> = zeros.iter().map(|zero| zero.mode(step)).collect();
    let mut spectrum = RetardationSpectrum::empty();
    Density {
        node,
        compliance: transform,
        factor: Dual::ONE,
        rule: Rule { step, ..FINE },
        slowest: FINE.slowest_of_rising,
        ln_scale: 0.0,
        order: Dual::ZERO,
        least_tail: REACH,
        poles: &poles,
    }
    .add_to(&mut spectrum, window);
    spectrum
}

fn largest_difference(a: &RetardationSpectrum, b: &RetardationSpectrum, window: TimeWindow) -> f64 {
    let ratio = window.longest_s / window.shortest_s;
    let size = b.creep_compliance_per_pa(window.longest_s).abs();
    let at = |k: u32| window.shortest_s * ratio.powf(f64::from(k) / f64::from(N_TIMES - 1));
    let differences =
        (0..N_TIMES).map(|k| (a.creep_compliance_per_pa(at(k)) - b.creep_compliance_per_pa(at(k))).abs() / size);
    // The maximum keeps NaN, so that NaN does not pass as a small difference.
    differences.fold(0.0, |largest, each| if each > largest || each.is_nan() { each } else { largest })
}

/// Zero of the complex modulus G*(eᵛ) at v = u₀ + iπ, with `u` the complex number u₀.
struct Zero {
    u: Complex<Dual>,
    /// Derivative of the complex modulus G*(eᵛ) with respect to v, at the zero.
    slope: Complex<Dual>,
}

impl Zero {
    fn mode(&self, step: f64) -> OscillatingMode {
        // `exponent` is −2πi u₀/h.
        let exponent = Complex { re: self.u.im * (2.0 * PI / step), im: self.u.re * (-2.0 * PI / step) };
        let share = (self.slope * (exponent.exp() + Complex::<Dual>::constant(1.0, 0.0))).reciprocal();
        let rate = self.u.exp();
        OscillatingMode { compliance_per_pa: [share.re * -2.0, share.im * -2.0], rate_per_s: [rate.re, rate.im] }
    }
}

/// Returns the zeros of the complex modulus beyond the branch cut: its logarithmic rates u₀ have 0 < Im u₀ < π/2 and are within
/// [`REACH`] of the window. A last Newton step in dual numbers makes their derivatives exact.
fn zeros_beyond_the_cut(network: &Element, window: TimeWindow) -> Vec<Zero> {
    let reach = [-window.longest_s.ln() - REACH, -window.shortest_s.ln() + REACH];
    let exact = |u: nalgebra::Complex<f64>| {
        let v = Complex::<Dual>::constant(u.re, u.im + PI);
        let at = modulus_at(network, v);
        let v = v - at.value * at.slope.reciprocal();
        Zero { u: Complex { re: v.re, im: v.im - PI }, slope: modulus_at(network, v).slope }
    };
    let inside = |u: &nalgebra::Complex<f64>| u.im > 0.0 && u.im < FRAC_PI_2 && u.re > reach[0] && u.re < reach[1];
    zeros_of_modulus(network, reach).into_iter().filter(inside).map(exact).collect()
}

/// Returns the zeros of an element's complex modulus, as complex logarithms of rates. Bodies in series have the zeros of every
/// body.
fn zeros_of_modulus(element: &Element, reach: [f64; 2]) -> Vec<nalgebra::Complex<f64>> {
    match element {
        Element::Series(elements) => elements.iter().flat_map(|part| zeros_of_modulus(part, reach)).collect(),
        Element::Parallel(_) => match stieltjes::spectrum_of(element) {
            Some(exact) => {
                exact.modes.iter().map(|mode| nalgebra::Complex::new(mode.rate_per_s.value.ln(), 0.0)).collect()
            }
            None => zeros(element, 1.0, &poles_of_modulus(element, reach), reach),
        },
        _ => Vec::new(),
    }
}

/// Returns the poles of an element's complex modulus, as complex logarithms of rates. Bodies in parallel have the poles of every
/// body.
fn poles_of_modulus(element: &Element, reach: [f64; 2]) -> Vec<nalgebra::Complex<f64>> {
    match element {
        Element::Parallel(elements) => elements.iter().flat_map(|part| poles_of_modulus(part, reach)).collect(),
        Element::Series(_) => match stieltjes::relaxation_of(element) {
            Some(exact) => {
                let rates = exact.modes.iter().map(|[_, rate]| *rate).filter(|rate| *rate > 0.0);
                rates.map(|rate| nalgebra::Complex::new(rate.ln(), 0.0)).collect()
            }
            None => zeros(element, -1.0, &zeros_of_modulus(element, reach), reach),
        },
        _ => Vec::new(),
    }
}

/// Returns the zeros of an element's complex modulus (`power` 1) or complex compliance (`power` −1). Newton's method starts from
/// points spread over `reach` and from points near the function's poles.
fn zeros(
    element: &Element,
    power: f64,
    poles: &[nalgebra::Complex<f64>],
    reach: [f64; 2],
) -> Vec<nalgebra::Complex<f64>> {
    let n_starts = ((reach[1] - reach[0]) / START_SPACING).ceil().max(0.0) as u32;
    let regular = (0..=n_starts).map(|start| nalgebra::Complex::new(reach[0] + START_SPACING * f64::from(start), 0.3));
    let beside = poles.iter().map(|pole| pole + nalgebra::Complex::new(0.0, 0.1));
    let mut zeros: Vec<nalgebra::Complex<f64>> = Vec::new();
    for start in regular.chain(beside) {
        if let Some(zero) = newton(element, power, poles, start, reach)
            && zeros.iter().all(|known| (known - zero).norm() > 1e-8)
        {
            zeros.push(zero);
        }
    }
    zeros
}

/// Returns a zero of an element's complex modulus G* to the power `power`, by Newton's method from `u`; `None` if it does not
/// converge. The method is applied to G*^power Π(u − u_pole), in which the product removes the poles. With the poles, hardly any
/// starting point leads to a zero close to a pole.
fn newton(
    element: &Element,
    power: f64,
    poles: &[nalgebra::Complex<f64>],
    mut u: nalgebra::Complex<f64>,
    reach: [f64; 2],
) -> Option<nalgebra::Complex<f64>> {
    for _ in 0..MAX_NEWTON_STEPS {
        let at = modulus_at(element, Complex::<Dual>::constant(u.re, u.im + PI));
        let logarithmic = at.slope * at.value.reciprocal();
        let of_poles: nalgebra::Complex<f64> = poles.iter().map(|pole| (u - pole).inv()).sum();
        let step = (nalgebra::Complex::new(logarithmic.re.value, logarithmic.im.value) * power + of_poles).inv();
        let size = step.norm();
        // Newton steps are shortened to 1, because the modulus is a sum of exponentials of v and long steps overshoot.
        u -= step * size.recip().min(1.0);
        if size < 1e-12 {
            return Some(u);
        }
        if !(size.is_finite() && u.im.abs() < PI && u.re > reach[0] - 2.0 && u.re < reach[1] + 2.0) {
            return None;
        }
    }
    None
}

/// Complex modulus of an element at the Laplace variable s = eᵛ, and its derivative with respect to v.
#[derive(Clone, Copy)]
struct Modulus {
    value: Complex<Dual>,
    slope: Complex<Dual>,
}

fn modulus_at(element: &Element, v: Complex<Dual>) -> Modulus {
    let zero = Complex::<Dual>::constant(0.0, 0.0);
    match element {
        Element::Spring { modulus_pa } => Modulus { value: Complex { re: *modulus_pa, im: Dual::ZERO }, slope: zero },
        Element::Dashpot { viscosity_pa_s } => {
            let value = v.exp() * *viscosity_pa_s;
            Modulus { value, slope: value }
        }
        Element::Compliance { compliance_per_pa } => {
            Modulus { value: Complex { re: Dual::ONE / *compliance_per_pa, im: Dual::ZERO }, slope: zero }
        }
        Element::Retarded { compliance_per_pa, time_s } => {
            let slope = v.exp() * (*time_s / *compliance_per_pa);
            let spring = Complex { re: Dual::ONE / *compliance_per_pa, im: Dual::ZERO };
            Modulus { value: spring + slope, slope }
        }
        Element::Springpot { modulus_pa, time_s, order } => {
            let exponent = Complex { re: *order * (v.re + time_s.ln()), im: *order * v.im };
            let value = exponent.exp() * *modulus_pa;
            Modulus { value, slope: value * *order }
        }
        Element::Series(elements) => {
            let (mut compliance, mut slope) = (zero, zero);
            for part in elements {
                let part = modulus_at(part, v);
                let inverse = part.value.reciprocal();
                compliance = compliance + inverse;
                slope = slope + inverse * inverse * part.slope;
            }
            let value = compliance.reciprocal();
            Modulus { value, slope: value * value * slope }
        }
        Element::Parallel(elements) => elements.iter().fold(Modulus { value: zero, slope: zero }, |sum, part| {
            let part = modulus_at(part, v);
            Modulus { value: sum.value + part.value, slope: sum.slope + part.slope }
        }),
    }
}
