//! Exact retardation and relaxation spectra of networks of springs and dashpots.
//!
//! The complex compliance of such a network is J*(s) = b∞ + b₀/s + Σ bₘ/(s + pₘ), with s the Laplace variable, weights b ≥ 0 and
//! rates pₘ > 0. The modulus divided by s also has this form. Compliances add in series, and moduli add in parallel. The
//! operation S ↦ 1/(s S) converts between the compliance and the modulus divided by s. The poles of the result are the zeros of
//! S, and exactly one lies between neighbouring poles of S. Every zero is therefore bracketed, and no polynomial is formed.

use super::fractional::Springpot;
use super::mass::mass_on_maxwell_bodies;
use super::{Accuracy, Element, RetardationSpectrum, SpectralMode, TimeWindow};
use base::number::Dual;

/// Largest relative distance of poles that are merged. Their weights add, and the merged rate is the weighted mean. The error is
/// of second order in the distance.
const SAME_POLE: f64 = 1e-9;
/// Smallest distance of a zero from a pole, divided by half the distance between neighbouring poles.
const NEAREST: f64 = 1e-22;
/// Largest number of Newton steps for a zero. Steps that leave the bracket bisect its logarithm, whose width is 50.
const MOST_STEPS: u32 = 80;
/// Relative change of a zero's distance from its pole at which the search ends.
const ROUNDING: f64 = 4e-16;

/// Function S(s) = b∞ + Σ b/(s + p) of the Laplace variable s. b∞ is the constant, and each pole has a weight b and a rate p ≥ 0.
#[derive(Debug, Clone, Default)]
struct Stieltjes {
    constant: Dual,
    poles: Vec<Pole>,
}

#[derive(Debug, Clone, Copy)]
struct Pole {
    weight: Dual,
    at: Dual,
}

/// Returns the exact retardation spectrum of a network; `None` if the network has a springpot of order below 1.
pub fn spectrum_of(element: &Element) -> Option<RetardationSpectrum> {
    let compliance = compliance_of(element)?;
    let (flow, modes): (Vec<Pole>, Vec<Pole>) = compliance.poles.iter().partition(|pole| pole.at.value == 0.0);
    Some(RetardationSpectrum {
        instantaneous_per_pa: compliance.constant,
        modes: modes
            .iter()
            .map(|pole| SpectralMode { compliance_per_pa: pole.weight / pole.at, rate_per_s: pole.at })
            .collect(),
        oscillating: Vec::new(),
        fluidity_per_pa_s: flow.iter().fold(Dual::ZERO, |sum, pole| sum + pole.weight),
    })
}

/// Relaxation spectrum of a network, which gives its complex modulus G*(s) = η s + Σ G s/(s + p), with s the Laplace variable.
#[derive(Debug, Clone)]
pub struct RelaxationSpectrum {
    /// Viscosity η in Pa·s.
    pub viscosity_pa_s: f64,
    /// Modulus G (Pa) and rate p (1/s) of every mode, slowest first. A mode with p = 0 does not relax.
    pub modes: Vec<[f64; 2]>,
}

/// Returns the exact relaxation spectrum of a network; `None` if the network has a springpot of order below 1.
pub fn relaxation_of(element: &Element) -> Option<RelaxationSpectrum> {
    let modulus = compliance_of(element)?.reciprocal();
    let modes = modulus.poles.iter().map(|pole| [pole.weight.value, pole.at.value]).collect();
    Some(RelaxationSpectrum { viscosity_pa_s: modulus.constant.value, modes })
}

/// Relaxation spectrum of elements in series: viscosity η in Pa·s, and modulus (Pa) and rate (1/s) of every mode. Springpots are sums of modes over the window, with
/// this accuracy. Modes without modulus only have derivatives, as those of an effect at its null.
pub(super) fn relaxation_of_law(law: &[Element], window: TimeWindow, accuracy: Accuracy) -> (Dual, Vec<(Dual, Dual)>) {
    let modulus = match law {
        [only] => approximate_modulus(only, window, accuracy),
        _ => sum_all(law.iter().map(|element| approximate_compliance(element, window, accuracy))).inverse(),
    };
    (modulus.constant, modulus.poles.iter().map(|pole| (pole.weight, pole.at)).collect())
}

/// Returns the complex compliance J* of an element, with a springpot as a sum of modes.
fn approximate_compliance(element: &Element, window: TimeWindow, accuracy: Accuracy) -> Stieltjes {
    match element {
        Element::Springpot { modulus_pa, time_s, order } if !order.is_constant(1.0) => {
            let mut spectrum = RetardationSpectrum::empty();
            let springpot = Springpot { coefficient: *modulus_pa * time_s.pow(*order), order: *order };
            springpot.add_to(&mut spectrum, window, accuracy);
            let of_mode =
                |mode: &SpectralMode| Pole { weight: mode.compliance_per_pa * mode.rate_per_s, at: mode.rate_per_s };
            let mut poles: Vec<Pole> = spectrum.modes.iter().map(of_mode).collect();
            if spectrum.fluidity_per_pa_s.value > 0.0 {
                poles.push(Pole { weight: spectrum.fluidity_per_pa_s, at: Dual::ZERO });
            }
            Stieltjes { constant: spectrum.instantaneous_per_pa, poles }
        }
        Element::Series(elements) => {
            sum_all(elements.iter().map(|element| approximate_compliance(element, window, accuracy)))
        }
        Element::Parallel(_) => approximate_modulus(element, window, accuracy).inverse(),
        _ => compliance_of(element).unwrap_or_default(),
    }
}

/// Returns the modulus of an element, divided by s, with a springpot as a sum of modes.
fn approximate_modulus(element: &Element, window: TimeWindow, accuracy: Accuracy) -> Stieltjes {
    match element {
        Element::Parallel(elements) => {
            sum_all(elements.iter().map(|element| approximate_modulus(element, window, accuracy)))
        }
        _ => approximate_compliance(element, window, accuracy).inverse(),
    }
}

fn sum_all(parts: impl Iterator<Item = Stieltjes>) -> Stieltjes {
    parts.fold(Stieltjes::default(), |mut total, part| {
        total.constant += part.constant;
        total.poles.extend(part.poles);
        total
    })
}

/// Returns the retardation spectrum of a network with a mass in parallel. The result is `None` if the network has a springpot of
/// order below 1, or if the mass is 0.
pub(super) fn with_mass(element: &Element, mass: Dual) -> Option<RetardationSpectrum> {
    let modulus = compliance_of(element)?.reciprocal();
    let bodies: Vec<(Dual, Dual)> = modulus.poles.iter().map(|pole| (pole.weight, pole.at)).collect();
    (mass.value > 0.0).then(|| mass_on_maxwell_bodies(modulus.constant, &bodies, mass))
}

/// Returns the complex compliance of an element; `None` if the element has a springpot of order below 1.
fn compliance_of(element: &Element) -> Option<Stieltjes> {
    match element {
        Element::Spring { modulus_pa } => Some(Stieltjes { constant: Dual::ONE / *modulus_pa, poles: Vec::new() }),
        Element::Compliance { compliance_per_pa } => {
            Some(Stieltjes { constant: *compliance_per_pa, poles: Vec::new() })
        }
        Element::Retarded { compliance_per_pa, time_s } => {
            let pole = Pole { weight: *compliance_per_pa / *time_s, at: Dual::ONE / *time_s };
            Some(Stieltjes { constant: Dual::ZERO, poles: vec![pole] })
        }
        Element::Dashpot { viscosity_pa_s } => Some(Stieltjes::flow(Dual::ONE / *viscosity_pa_s)),
        Element::Springpot { modulus_pa, time_s, order } => {
            order.is_constant(1.0).then(|| Stieltjes::flow(Dual::ONE / (*modulus_pa * *time_s)))
        }
        Element::Series(elements) => sum(elements.iter().map(compliance_of)),
        Element::Parallel(elements) => {
            let modulus = sum(elements.iter().map(|element| compliance_of(element).map(|c| c.reciprocal())))?;
            Some(modulus.reciprocal())
        }
    }
}

fn sum(parts: impl Iterator<Item = Option<Stieltjes>>) -> Option<Stieltjes> {
    Some(sum_all(parts.collect::<Option<Vec<Stieltjes>>>()?.into_iter()))
}

impl Stieltjes {
    fn flow(weight: Dual) -> Self {
        Self { constant: Dual::ZERO, poles: vec![Pole { weight, at: Dual::ZERO }] }
    }

    /// Returns the function T with 1/S(s) = s T(s), for the function S of `self` and the Laplace variable s. It converts a
    /// compliance into a modulus divided by s, and back.
    fn reciprocal(&self) -> Self {
        let poles = merged(&self.poles);
        let at_zero = poles.first().is_some_and(|pole| pole.at.value == 0.0);
        let constant = if self.constant.value > 0.0 {
            Dual::ZERO
        } else {
            Dual::ONE / poles.iter().fold(Dual::ZERO, |sum, pole| sum + pole.weight)
        };
        let mut result = Self { constant, poles: Vec::new() };
        if !at_zero {
            let whole = poles.iter().fold(self.constant, |sum, pole| sum + pole.weight / pole.at);
            result.poles.push(Pole { weight: Dual::ONE / whole, at: Dual::ZERO });
        }
        let n_zeros = (poles.len() + usize::from(self.constant.value > 0.0)).saturating_sub(1);
        result.poles.extend((0..n_zeros).map(|left| self.zero_above(&poles, left)));
        result
    }

    /// Returns the zero of S(−x) = b∞ + Σ b/(p − x) between the pole with index `left` and the next pole. The zero is returned as
    /// a pole of 1/(s S), with its weight.
    fn zero_above(&self, poles: &[Pole], left: usize) -> Pole {
        let value_at = |origin: usize, offset: f64| {
            let from = poles[origin].at.value;
            poles
                .iter()
                .fold(self.constant.value, |sum, pole| sum + pole.weight.value / (pole.at.value - from - offset))
        };
        // Above the last pole, S(−x) is positive at distances x − p of more than Σb/b∞, which therefore bounds the bracket.
        let reach = match poles.get(left + 1) {
            Some(right) => 0.5 * (right.at.value - poles[left].at.value),
            None => poles.iter().fold(0.0, |sum, pole| sum + pole.weight.value) / self.constant.value * (1.0 + 1e-9),
        };
        // The zero's distance is measured from the nearer pole, so that it keeps its digits.
        let is_last = left + 1 == poles.len();
        let (origin, sign) = if is_last || value_at(left, reach) > 0.0 { (left, 1.0) } else { (left + 1, -1.0) };
        // With the offset x from the pole, x S is smooth near the pole: h = x (b∞ + Σ_others b/(d − x)) − b. Newton's method finds its zero between the ends of a bracket.
        let from = poles[origin].at.value;
        let others = |offset: f64| {
            let all = poles.iter().enumerate().filter(|(place, _)| *place != origin);
            all.fold((self.constant.value, 0.0), |(value, slope), (_, pole)| {
                let distance = pole.at.value - from - offset;
                let share = pole.weight.value / distance;
                (value + share, slope + share / distance)
            })
        };
        let weight = poles[origin].weight.value;
        let (mut near, mut far) = (reach * NEAREST, reach);
        // Parameters beyond any material overflow to rates that are no numbers. Then the zero is none either, and `clamp` would panic.
        let mut size = (sign * weight / others(0.0).0).max(near).min(far);
        for _ in 0..MOST_STEPS {
            let (rest, slope) = others(sign * size);
            let value = size * rest - sign * weight;
            // S(−x) increases with x from −∞ just above a pole to +∞ just below the next.
            if value * sign < 0.0 {
                near = size
            } else {
                far = size
            }
            let newton = size - value / (rest + sign * size * slope);
            let next = if newton > near && newton < far { newton } else { (near * far).sqrt() };
            let is_found = (next - size).abs() <= ROUNDING * size;
            size = next;
            if is_found {
                break;
            }
        }
        self.polished(poles, origin, sign * size)
    }

    /// Refines a zero by one Newton step in dual numbers, which makes its value accurate to rounding and its derivative exact.
    fn polished(&self, poles: &[Pole], origin: usize, offset: f64) -> Pole {
        let from = poles[origin].at;
        let sums = |offset: Dual| {
            poles.iter().fold((self.constant, Dual::ZERO), |(value, slope), pole| {
                let share = pole.weight / (pole.at - from - offset);
                (value + share, slope + share / (pole.at - from - offset))
            })
        };
        let (value, slope) = sums(Dual::constant(offset));
        let offset = Dual::constant(offset) - value / slope;
        let (_, slope) = sums(offset);
        let at = from + offset;
        Pole { weight: Dual::ONE / (at * slope), at }
    }
}

impl Stieltjes {
    /// Returns [`Self::reciprocal`] with the derivatives by a constant and by weights that are 0.
    fn inverse(&self) -> Self {
        let (poles, vanishing): (Vec<Pole>, Vec<Pole>) = self.poles.iter().partition(|pole| pole.weight.value != 0.0);
        let mut inverse = Self { constant: self.constant, poles }.reciprocal();
        if inverse.constant.value > 0.0 {
            inverse.vary_constant(self.constant.derivative);
        }
        inverse.vary_poles(&vanishing);
        inverse
    }

    /// Adds the derivative of T = 1/(s S) by a constant of S that is 0, to the constant η of T. The derivative −s T² has the constant −2 η Σ g. Its part η² s acts only
    /// at jumps. The derivatives of the poles are already there.
    fn vary_constant(&mut self, derivative: f64) {
        let moduli: f64 = self.poles.iter().map(|pole| pole.weight.value).sum();
        self.constant.derivative -= 2.0 * self.constant.value * moduli * derivative;
    }

    /// Adds the derivatives of T = 1/(s S) by poles d/(s + r) of S whose weights are 0. The derivative of T is −s T² d/(s + r). Its partial fractions are those of η,
    /// of each pole g/(s + p), and of a new pole at r.
    fn vary_poles(&mut self, vanishing: &[Pole]) {
        let eta = self.constant.value;
        let known: Vec<[f64; 2]> = self.poles.iter().map(|pole| [pole.weight.value, pole.at.value]).collect();
        // Values of T and of its regular part at a pole.
        let others = |at: f64, without: Option<usize>| {
            let rest = known.iter().enumerate().filter(|(place, _)| Some(*place) != without);
            eta + rest.map(|(_, [g, p])| g / (p - at)).sum::<f64>()
        };
        for pole in vanishing.iter().filter(|pole| pole.weight.derivative != 0.0) {
            let (d, r) = (pole.weight.derivative, pole.at.value);
            self.constant.derivative -= eta * eta * d;
            for (place, (pole, [g, p])) in self.poles.iter_mut().zip(&known).enumerate() {
                let (distance, regular) = (r - p, others(*p, Some(place)));
                pole.at.derivative -= d * g * p / distance;
                pole.weight.derivative -= d * (g * g * r / (distance * distance) - 2.0 * g * regular * p / distance);
            }
            let weight = Dual { value: 0.0, derivative: d * r * others(r, None).powi(2) };
            self.poles.push(Pole { weight, at: Dual::constant(r) });
        }
    }
}

/// Returns the poles in ascending order, with coincident poles merged.
fn merged(poles: &[Pole]) -> Vec<Pole> {
    let mut sorted = poles.to_vec();
    sorted.sort_by(|a, b| a.at.value.total_cmp(&b.at.value));
    let mut joined: Vec<Pole> = Vec::with_capacity(sorted.len());
    for pole in sorted {
        match joined.last_mut() {
            Some(last) if pole.at.value - last.at.value <= SAME_POLE * pole.at.value => {
                let weight = last.weight + pole.weight;
                last.at = (last.weight * last.at + pole.weight * pole.at) / weight;
                last.weight = weight;
            }
            _ => joined.push(pole),
        }
    }
    joined
}
