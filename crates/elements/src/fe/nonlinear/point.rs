//! The law at one integration point over one stage of a step. It maps the strain and the histories
//! to the stress.
//!
//! Tensors are six numbers: five coordinates of the deviator in an orthonormal basis, and the
//! trace. A stage is an implicit Euler step of length g. The strain of a linear body at its end is
//! ε = d H + j s. H is the body's strain at the stage's start, s the stress, and d, j are scalars.
//! Let h = Σ d H and j_l = Σ j over the linear bodies. Let H_N be the strain of the nonlinear body
//! at the start. With the total strain ε, the stress is
//!
//!  dev s = σ₁(|a|) dev a − κ dev H_N,   a = ε − h + ω H_N.
//!
//! σ₁ is a secant modulus. A stiffening spring has ω = j_l c₁/g and κ = c₁/g, with the viscosity c₁
//! of the dashpot beside it. A thinning or yielding dashpot has ω = −1 and κ = 0. Let m be the
//! equivalent strain of the spring, or the equivalent stress of the dashpot. It solves the scalar
//! equation α m + ψ(m) = √⅔ |dev a|, with a constant α and a function ψ. Because ψ is convex,
//! Newton's method from above the root always converges.

use super::law::Bodies;
use base::number::{Dual, PointScalar};
use laws::stages::Nonlinearity;

/// Five coordinates of the deviator in an orthonormal basis, and the trace.
pub(crate) type Tensor<N> = [N; 6];

/// Scalar type with a logarithm, for evaluations of the law.
pub trait Number: PointScalar {
    /// True if the type carries a derivative. Iterations that use only the value lose it.
    const HAS_DERIVATIVE: bool;
    /// Natural logarithm.
    fn ln(self) -> Self;
}

impl Number for f64 {
    const HAS_DERIVATIVE: bool = false;
    #[inline(always)]
    fn ln(self) -> Self {
        f64::ln(self)
    }
}

impl Number for Dual {
    const HAS_DERIVATIVE: bool = true;
    #[inline(always)]
    fn ln(self) -> Self {
        Dual::ln(self)
    }
}

/// √⅔: ratio of the equivalent strain or stress of physics §5 to the norm of the deviator.
pub const EQUIVALENT: f64 = 0.816_496_580_927_726;

/// A linear body over a stage: its strain at the end is `decay` × its strain at the start +
/// `compliance` × stress.
#[derive(Debug, Clone, Copy)]
pub struct LinearBody<N> {
    pub decay: N,
    pub compliance: N,
}

/// Coefficients of the law over a stage of given length.
#[derive(Debug, Clone)]
pub struct StageLaw<N> {
    /// Linear bodies that have a strain history.
    pub linear: Vec<LinearBody<N>>,
    /// Sum of the compliances of the linear bodies over the stage, in 1/Pa.
    pub linear_compliance: N,
    pub omega: N,
    pub kappa: N,
    pub radial: Radial<N>,
}

/// Coefficients of the scalar equation for the nonlinear body's equivalent strain or stress.
#[derive(Debug, Clone, Copy)]
pub enum Radial<N> {
    /// Stiffening spring: viscosity beside it / stage length, Young's modulus, and the modulus
    /// times the stiffening coefficient.
    Stiffening { rate: N, modulus: N, cubic: N },
    /// Thinning dashpot: stage length / viscosity, 1/n − 1 for the thinning index n, and the
    /// reference stress.
    Thinning { fluidity: N, exponent: N, reference: N },
    /// Yielding dashpot: stage length / viscosity, yield stress, and smoothing.
    Yield { fluidity: N, stress: N, smoothing: f64 },
}

/// Moduli of the stress s for the tensor a of the module's text: dev s + κ dev H_N = `secant` dev
/// a, and tr s + κ tr H_N = `volumetric` tr a. H_N is the nonlinear body's strain at the stage's
/// start, κ a constant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moduli<N> {
    pub secant: N,
    /// Tangent modulus: derivative of the norm of dev s with respect to the norm of dev a. Across
    /// the direction of dev a, `secant` applies.
    pub normal: N,
    pub volumetric: N,
    /// Derivative of `volumetric` with respect to the norm of dev a.
    pub coupling: N,
}

impl<N: Number> StageLaw<N> {
    /// Builds the law over an implicit Euler step of length `step_s` (s).
    pub fn new(bodies: &Bodies<N>, step_s: N) -> Self {
        let one = N::constant(1.0);
        let rate = bodies.viscosity_1_pa_s / step_s;
        let fluidity = step_s / bodies.viscosity_2_pa_s;
        let body =
            LinearBody { decay: rate / (rate + bodies.modulus_pa), compliance: one / (rate + bodies.modulus_pa) };
        let dashpot = LinearBody { decay: one, compliance: fluidity };
        let retarded = bodies.retarded.iter().map(|body| {
            let decay = body.time_s / (body.time_s + step_s);
            LinearBody { decay, compliance: body.compliance_per_pa * (one - decay) }
        });
        let first = if matches!(bodies.nonlinearity, Nonlinearity::StrainStiffening { .. }) { dashpot } else { body };
        let linear: Vec<LinearBody<N>> = std::iter::once(first).chain(retarded).collect();
        let mut linear_compliance = bodies.instantaneous_per_pa;
        linear.iter().for_each(|body| linear_compliance += body.compliance);
        let (omega, kappa, radial) = match bodies.nonlinearity {
            Nonlinearity::StrainStiffening { coefficient } => {
                let cubic = bodies.modulus_pa * coefficient;
                (linear_compliance * rate, rate, Radial::Stiffening { rate, modulus: bodies.modulus_pa, cubic })
            }
            Nonlinearity::ShearThinning { index, reference_stress_pa } => {
                let radial = Radial::Thinning { fluidity, exponent: one / index - one, reference: reference_stress_pa };
                (-one, N::constant(0.0), radial)
            }
            Nonlinearity::YieldStress { stress_pa, smoothing } => {
                (-one, N::constant(0.0), Radial::Yield { fluidity, stress: stress_pa, smoothing })
            }
        };
        Self { linear, linear_compliance, omega, kappa, radial }
    }

    /// True if the law does not stiffen, thin or yield. Derivatives carried by the parameters are
    /// ignored.
    #[inline(always)]
    pub fn is_linear(&self) -> bool {
        matches!(self.radial, Radial::Stiffening { cubic, .. } if cubic.value() == 0.0)
    }

    /// Returns the tensor that, added to the strain, gives the tensor a of the module's text.
    /// `histories` holds the strain of the nonlinear body, then that of each linear body.
    #[inline(always)]
    pub(crate) fn offset(&self, histories: &[Tensor<N>]) -> Tensor<N> {
        let mut offset = histories[0].map(|h| self.omega * h);
        for (body, history) in self.linear.iter().zip(&histories[1..]) {
            for (o, h) in offset.iter_mut().zip(history) {
                *o = *o - body.decay * *h;
            }
        }
        offset
    }

    /// Replaces the history of every body by its strain at the stage's end.
    #[inline(always)]
    pub(crate) fn advance(&self, strain: &Tensor<N>, stress: &Tensor<N>, histories: &mut [Tensor<N>]) {
        let mut rest: Tensor<N> = std::array::from_fn(|i| strain[i] - self.linear_compliance * stress[i]);
        let (nonlinear, linear) = histories.split_at_mut(1);
        for (body, history) in self.linear.iter().zip(linear) {
            for ((h, r), s) in history.iter_mut().zip(&mut rest).zip(stress) {
                let left = body.decay * *h;
                *r = *r - left;
                *h = left + body.compliance * *s;
            }
        }
        nonlinear[0] = rest;
    }

    /// Moduli at a tensor a (see the module's text) whose deviator has the norm `norm`.
    #[inline(always)]
    pub(crate) fn moduli(&self, norm: N) -> Moduli<N> {
        match self.radial {
            Radial::Stiffening { rate, modulus, cubic } => self.stiffening(norm, rate + modulus, cubic),
            Radial::Thinning { fluidity, exponent, reference } => self.thinning(norm, fluidity, exponent, reference),
            Radial::Yield { fluidity, stress, smoothing } => self.yielding(norm, fluidity, stress, smoothing),
        }
    }

    fn stiffening(&self, norm: N, linear: N, cubic: N) -> Moduli<N> {
        let (one, j) = (N::constant(1.0), self.linear_compliance);
        let volumetric = linear / (j * linear + one);
        let (alpha, beta, driving) = (j * linear + one, j * cubic, norm * EQUIVALENT);
        let (a, b, e) = (alpha.value(), beta.value(), driving.value());
        let t = b * e * e / (a * a * a);
        let [above, below] = STIFFENING_START.map(|[first, second]| 1.0 + t * (first + t * second));
        let mut m = e / a * above / below;
        for _ in 0..MOST_ITERATIONS {
            let change = (m * (a + b * m * m) - e) / (a + 3.0 * b * m * m);
            m -= change;
            if change.abs() <= ROUNDING * m {
                break;
            }
        }
        let m = polished(m, |m: N| m * (alpha + beta * m * m) - driving, a + 3.0 * b * m * m);
        let squared = cubic * m * m;
        let (secant, normal) = (linear + squared, linear + squared * 3.0);
        Moduli {
            secant: secant / (j * secant + one),
            normal: normal / (j * normal + one),
            volumetric,
            coupling: N::constant(0.0),
        }
    }

    fn thinning(&self, norm: N, fluidity: N, exponent: N, reference: N) -> Moduli<N> {
        let (j, driving) = (self.linear_compliance, norm * EQUIVALENT);
        let (jv, g, p, s0, e) = (j.value(), fluidity.value(), exponent.value(), reference.value(), driving.value());
        // In logarithms both limits of the equation are straight lines: y = ln(m/s₀), ln
        // ρ = ln(g/j) + p y, y + ln(1 + ρ) = ln(e/(j s₀)). Halley's steps of third order start from the
        // lower line.
        let (target, offset) = ((e / (jv * s0)).ln(), (g / jv).ln());
        let mut y = target.min((target - offset) / (1.0 + p));
        if e > 0.0 {
            for _ in 0..MOST_ITERATIONS {
                let ratio = (offset + p * y).exp();
                let steep = p * ratio / (1.0 + ratio);
                let (excess, slope) = (y + ratio.ln_1p() - target, 1.0 + steep);
                let bend = steep * p / (1.0 + ratio);
                let change = excess * slope / (slope * slope - 0.5 * excess * bend);
                y -= change;
                // The next change would be of the order of the cube of this one.
                if change.abs() <= CUBIC_ROUNDING {
                    break;
                }
            }
        }
        let m = s0 * y.exp();
        if m <= 0.0 || !m.is_finite() {
            // A thinning fluid at rest does not flow. A linear one does.
            let resting = N::constant(1.0) / if p == 0.0 { j + fluidity } else { j };
            return Moduli { secant: resting, normal: resting, volumetric: resting, coupling: N::constant(0.0) };
        }
        let share = (p * y).exp();
        let flow = |m: N| fluidity * if N::HAS_DERIVATIVE { (m / reference).pow(exponent) } else { N::constant(share) };
        let m = polished(m, |m: N| m * (j + flow(m)) - driving, jv + g * share * (1.0 + p));
        let flow = flow(m);
        in_series(j, flow, flow * (exponent + N::constant(1.0)), m)
    }

    fn yielding(&self, norm: N, fluidity: N, stress: N, smoothing: f64) -> Moduli<N> {
        let (j, driving) = (self.linear_compliance, norm * EQUIVALENT);
        let (jv, g, sy, e) = (j.value(), fluidity.value(), stress.value(), driving.value());
        let mut m = (e / jv).min((e + g * sy) / (jv + g));
        for _ in 0..MOST_ITERATIONS {
            let [share, slope] = smoothed_yield(m, sy, smoothing);
            let change = (m * (jv + g * share) - e) / (jv + g * slope);
            m -= change;
            if change.abs() <= ROUNDING * m {
                break;
            }
        }
        let [_, slope] = smoothed_yield(m, sy, smoothing);
        let m =
            polished(m, |m: N| m * (j + fluidity * smoothed_yield(m, stress, smoothing)[0]) - driving, jv + g * slope);
        let [share, slope] = smoothed_yield(m, stress, smoothing);
        in_series(j, fluidity * share, fluidity * slope, m)
    }
}

/// Coefficients of a first guess for the root m of (a + b m²) m = e. The guess is e/a times a
/// quotient of polynomials 1 + p₁ t + p₂ t² in t = b e²/a³. Its error is 4 % for t below 1000.
pub const STIFFENING_START: [[f64; 2]; 2] = [[0.33035, 0.0010286], [0.91573, 0.012622]];
/// Largest number of Newton steps for the scalar equation of the nonlinear body. Steps from above
/// always approach the root, and five suffice.
const MOST_ITERATIONS: usize = 60;
/// Relative change at which the iteration for the nonlinear body's scalar equation ends.
const ROUNDING: f64 = 1e-10;
/// Change at which an iteration of third order ends.
const CUBIC_ROUNDING: f64 = 1e-4;

/// Gives a root of `rest` the derivative of the number type `N`, by one more Newton step.
#[inline(always)]
fn polished<N: Number>(root: f64, rest: impl Fn(N) -> N, slope: f64) -> N {
    let root = N::constant(root);
    if N::HAS_DERIVATIVE { root - rest(root) * (1.0 / slope) } else { root }
}

/// Moduli of a compliance `j` in series with a flow. At the equivalent stress `m` their strain is m
/// (j + `flow`), whose derivative with respect to m is j + `slope`.
#[inline(always)]
fn in_series<N: Number>(j: N, flow: N, slope: N, m: N) -> Moduli<N> {
    let one = N::constant(1.0);
    let (secant, normal) = (one / (j + flow), one / (j + slope));
    // The derivatives are d(1/(j + flow))/dm = −(slope − flow)/m secant² and dm/d|a| = √⅔ normal.
    let coupling =
        if m.value() > 0.0 { -(slope - flow) * secant * secant * normal * EQUIVALENT / m } else { N::constant(0.0) };
    Moduli { secant, normal, volumetric: secant, coupling }
}

/// Returns r(m)/m and r'(m) of the smoothed yield function r(m) = ½[m − s_y + √((m − s_y)² + 4δ²
/// s_y m)]. m is the equivalent stress, s_y the yield stress and δ the smoothing. r smooths ⟨m −
/// s_y⟩, the positive part of m − s_y.
///
/// r is convex and rising, with r(0) = 0. It equals m at s_y = 0, and exceeds ⟨m − s_y⟩ by at most
/// δ s_y (at m = s_y). Far below the yield stress the dashpot creeps with δ² times its fluidity.
/// Far above it, r exceeds ⟨m − s_y⟩ by δ² s_y.
pub(crate) fn smoothed_yield<N: Number>(m: N, stress: N, smoothing: f64) -> [N; 2] {
    if stress.value() == 0.0 && m.value() == 0.0 {
        return [N::constant(1.0); 2];
    }
    let quarter = stress * (2.0 * smoothing * smoothing);
    let beyond = m - stress;
    let root = (beyond * beyond + quarter * m * 2.0).sqrt();
    let share = if beyond.value() > 0.0 { (beyond + root) * 0.5 / m } else { quarter / (root - beyond) };
    [share, ((beyond + quarter) / root + N::constant(1.0)) * 0.5]
}

/// Norm √(Σ tᵢ²) of a tensor's deviator. At zero its undefined derivative is set to zero.
#[inline(always)]
pub(crate) fn deviator_norm<N: Number>(tensor: &Tensor<N>) -> N {
    let mut squared = tensor[0] * tensor[0];
    tensor[1..5].iter().for_each(|t| squared += *t * *t);
    if squared.value() > 0.0 { squared.sqrt() } else { N::constant(0.0) }
}

#[cfg(test)]
#[path = "point_tests.rs"]
mod tests;
