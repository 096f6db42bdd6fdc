//! Retardation spectrum of a law with a continuous density of retardation rates, as a sum of exponentials.
//!
//! Such a law has the creep compliance J(t) = J₀ + ∫ L(u) (1 − e^{−eᵘt}) du + φ t. J₀ is the instantaneous compliance, φ the
//! fluidity, u the logarithm of a retardation rate and L(u) the density of rates. The midpoint rule in u converges faster than
//! any power of its step, but its nodes extend to infinity on both sides. Nodes inside the time window are kept as modes. Nodes
//! that are too fast for the window are added to the instantaneous compliance. Nodes that are too slow become flow and one more
//! mode. The sums over the nodes outside the window converge slowly. They are therefore computed from the law's complex
//! compliance J*(s) at two real values of the Laplace variable s.
//!
//! The errors of [`FINE`] in the window are as follows, with h the step, h L the weight of a node, r its rate and t the time. The
//! slowest of the fast nodes has an error of h L e^{−rt}, at most e^{−19.5} = 3.4e-9 of h L. Faster nodes have errors of e^{−31},
//! e^{−50}, … of h L. A Gauss–Radau rule replaces the slow nodes and keeps their moments 1, 2 and 3. Each slow node has an error
//! of h L (rt)⁴/24, at most 3.4e-8 of h L at rt = 0.03. The error of each slower node is e^{−4h} = 0.15 times that of the node
//! before. With weights below 0.05/E, E being the spring's modulus, the total is 2e-9/E. The midpoint rule adds an error of 1e-9.

use super::{OscillatingMode, RetardationSpectrum, SpectralMode, TimeWindow};
use base::number::PointScalar;

/// Midpoint rule in the logarithm u of the retardation rate, and the limits of the nodes that are kept as modes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rule {
    /// Step h of the midpoint rule in u, the natural logarithm of the retardation rate. The rule's error is e^{−π²/h} times the
    /// integral of the density of rates along the line Im u = π/2.
    pub step: f64,
    /// Slowest retardation rate that is kept as a mode, times the window's longest time. It applies to densities that do not
    /// increase towards slow rates.
    pub slowest: f64,
    /// Slowest retardation rate that is kept as a mode, times the window's longest time. It applies to densities that increase
    /// towards slow rates r as r^{−α}, such as that of a springpot of order α.
    pub slowest_of_rising: f64,
    /// Fastest retardation rate that is kept as a mode, times the window's shortest time.
    pub fastest: f64,
    /// Relative size of the terms at which a sum over nodes outside the time window ends. The sums enter the result with a factor
    /// of 1e-3.
    pub tail: f64,
}

/// Midpoint rule for [`super::Accuracy::Fine`] with a total error of 1e-8, to which the rule itself contributes 8e-10.
pub(super) const FINE: Rule = Rule { step: 0.47, slowest: 0.03, slowest_of_rising: 0.01, fastest: 19.5, tail: 1e-6 };

/// Midpoint rule for [`super::Accuracy::Fast`] with a total error of 1e-6, to which the rule itself contributes 2e-7. Fast nodes
/// have errors of e^{−13} = 2e-6 of their weights, slow nodes of 0.08⁴/24 = 2e-6.
pub(super) const FAST: Rule = Rule { step: 0.64, slowest: 0.08, slowest_of_rising: 0.03, fastest: 13.0, tail: 1e-4 };

/// Smallest ratio of the time window's longest to its shortest time. Narrower windows are widened, so that the two equations for
/// the nodes outside the window stay independent.
const LEAST_SPAN: f64 = 16.0;
/// Largest number of nodes on one side of the time window that are summed. Sums end earlier, because terms decrease by at least
/// the factor e^{h} from node to node, with h the rule's step.
const MAX_TAIL: usize = 4000;

/// Density of retardation rates at the nodes of a midpoint rule.
pub(super) struct Density<'a, T, N, C> {
    /// Function that returns the retardation rate of a node and its weight h L. h is the rule's step and L the density of rates,
    /// without the common factor `factor`.
    pub node: N,
    /// Function that returns the law's complex compliance J*(s) in 1/Pa at a real s in 1/s.
    pub compliance: C,
    /// Common factor of the weights. It may be 0, but the weights before the multiplication must not be 0.
    pub factor: T,
    /// Midpoint rule with the nodes u = (k + ½) h, for integers k and the step h.
    pub rule: Rule,
    /// Slowest retardation rate that is kept as a mode, times the time window's longest time.
    pub slowest: f64,
    /// Natural logarithm of the retardation rate (1/s) at u = 0.
    pub ln_scale: f64,
    /// Order α of the springpot, which [`Node::power`] uses.
    pub order: T,
    /// Smallest distance in u over which nodes outside the time window are summed. Weights may increase again within this
    /// distance.
    pub least_tail: f64,
    /// Oscillating modes that are added to the modes of the nodes.
    pub poles: &'a [OscillatingMode<T>],
}

/// Node of the midpoint rule. Exponentials are costly, so a node's powers are products of the previous node's powers.
#[derive(Clone, Copy)]
pub(super) struct Node<T> {
    /// Natural logarithm u of the node's retardation rate, relative to the rate at u = 0.
    pub u: f64,
    /// Retardation rate eᵘ of the node, relative to the rate at u = 0.
    pub exp_u: f64,
    /// Power e^{αu}, with α the order of the springpot and u the logarithm of the node's rate.
    pub power: T,
}

impl<T: PointScalar, N: Fn(Node<T>) -> SpectralMode<T>, C: Fn(f64) -> T> Density<'_, T, N, C> {
    /// Adds the modes, compliance and fluidity of the density to a spectrum, accurate over a time window.
    ///
    /// The number of kept nodes depends only on the rule and the window, so that all parameter points of a batch have the same
    /// number of modes.
    pub(super) fn add_to(&self, spectrum: &mut RetardationSpectrum<T>, window: TimeWindow) {
        let Rule { step, fastest, tail, .. } = self.rule;
        let longest_s = window.longest_s.max(LEAST_SPAN * window.shortest_s);
        let slowest_per_s = self.slowest / longest_s;
        let first = ((slowest_per_s.ln() - self.ln_scale) / step - 0.5).ceil();
        let n_kept = ((fastest / (window.shortest_s * slowest_per_s)).ln() / step).ceil() as usize;
        let u = (first + 0.5) * step;
        let start = Node { u, exp_u: u.exp(), power: (self.order * u).exp() };
        // Both Laplace variables s are far above the slowest and far below the fastest kept rate.
        let mut lumps = TailSums::new([1.0 / longest_s, 1.0 / (longest_s * window.shortest_s).sqrt()], tail, self);
        spectrum.modes.reserve(n_kept + 1);
        let mut rising = self.walk(start, 1.0);
        for node in rising.by_ref().take(n_kept) {
            let mode = (self.node)(node);
            let mode = SpectralMode { compliance_per_pa: mode.compliance_per_pa * self.factor, ..mode };
            lumps.keep(mode);
            spectrum.modes.push(mode);
        }
        let least = (self.least_tail / step) as usize;
        rising.take(MAX_TAIL).enumerate().find(|(i, node)| lumps.add_fast((self.node)(*node)) && *i >= least);
        let falling = self.walk(start, -1.0).skip(1).take(MAX_TAIL);
        falling.enumerate().find(|(i, node)| lumps.add_slow((self.node)(*node)) && *i >= least);
        let (instantaneous, fluidity, slow) = lumps.solve(self.factor);
        spectrum.instantaneous_per_pa += instantaneous;
        spectrum.fluidity_per_pa_s += fluidity;
        spectrum.modes.push(slow);
        spectrum.oscillating.extend_from_slice(self.poles);
    }

    fn walk(&self, start: Node<T>, sign: f64) -> impl Iterator<Item = Node<T>> {
        let step = sign * self.rule.step;
        let (growth, power_growth) = (step.exp(), (self.order * step).exp());
        let next = move |node: &Node<T>| {
            Some(Node { u: node.u + step, exp_u: node.exp_u * growth, power: node.power * power_growth })
        };
        std::iter::successors(Some(start), next)
    }
}

/// Sums over the nodes outside the time window. They become instantaneous compliance, fluidity and one slow mode.
///
/// Each node has a compliance a and a rate r. The unknown T is the instantaneous compliance plus Σ a over the fast nodes. The
/// unknown M is the fluidity plus Σ a r over the slow nodes. Both sums converge slowly. The equation T + M/s = J*(s) − Σ_kept a
/// r/(s + r) + Σ_slow a r²/(s(s + r)) + Σ_fast a s/(s + r) has sums that converge quickly. Here J*(s) is the complex compliance.
/// The equation at two values of s determines T and M.
struct TailSums<T> {
    s_per_s: [f64; 2],
    right_side: [T; 2],
    tails: [T; 2],
    /// Sums Σ a r² and Σ a r³ over the slow nodes, with the compliance a and rate r of a node.
    moments: [T; 2],
    /// Sum Σ a s/(s + r) over the fast nodes of compliance a and rate r, at the larger of the two s, without derivative.
    fast: f64,
    /// Relative size of the terms at which the sums end ([`Rule::tail`]).
    tail: f64,
}

impl<T: PointScalar> TailSums<T> {
    fn new<N, C: Fn(f64) -> T>(s_per_s: [f64; 2], tail: f64, density: &Density<'_, T, N, C>) -> Self {
        let right_side = s_per_s
            .map(|s| density.poles.iter().fold((density.compliance)(s), |rest, pole| rest - transform_of(pole, s)));
        let zero = T::constant(0.0);
        Self { s_per_s, right_side, tails: [zero; 2], moments: [zero; 2], fast: 0.0, tail }
    }

    fn keep(&mut self, mode: SpectralMode<T>) {
        let (a, r) = (mode.compliance_per_pa, mode.rate_per_s);
        let [s0, s1] = self.s_per_s;
        let [r0, r1] = [s0, s1].map(|s| r + T::constant(s));
        let both = a * r / (r0 * r1);
        self.right_side[0] = self.right_side[0] - both * r1;
        self.right_side[1] = self.right_side[1] - both * r0;
    }

    /// Adds a node that is too slow for the window to the sums. Returns `true` if its term is small enough to end them.
    fn add_slow(&mut self, mode: SpectralMode<T>) -> bool {
        let (a, r) = (mode.compliance_per_pa, mode.rate_per_s);
        let [s0, s1] = self.s_per_s;
        let [r0, r1] = [s0, s1].map(|s| r + T::constant(s));
        let second = a * r * r;
        self.moments[0] += second;
        self.moments[1] += second * r;
        let both = second / (r0 * r1);
        self.tails[0] += both * r1 * s0.recip();
        self.tails[1] += both * r0 * s1.recip();
        second.value() <= self.tail * self.moments[0].value()
    }

    /// Adds a node that is too fast for the window to the sums. Returns `true` if its term is small enough to end them.
    fn add_fast(&mut self, mode: SpectralMode<T>) -> bool {
        let (a, r) = (mode.compliance_per_pa, mode.rate_per_s);
        let [s0, s1] = self.s_per_s;
        let [r0, r1] = [s0, s1].map(|s| r + T::constant(s));
        let both = a / (r0 * r1);
        let (slow, fast) = (both * r1 * s0, both * r0 * s1);
        self.tails[0] += slow;
        self.tails[1] += fast;
        self.fast += fast.value();
        fast.value() <= self.tail * self.fast
    }

    /// Returns the instantaneous compliance, the fluidity and the slow mode. Together they represent the nodes outside the
    /// window.
    fn solve(&self, factor: T) -> (T, T, SpectralMode<T>) {
        let [t0, t1] = self.s_per_s.map(f64::recip);
        let [right0, right1] = [0, 1].map(|i| self.right_side[i] + self.tails[i] * factor);
        let first = (right0 - right1) * (t0 - t1).recip();
        let instantaneous = right0 - first * t0;
        // The Gauss–Radau rule replaces the slow nodes by flow and one mode. It keeps the sums Σ a r, Σ a r² and Σ a r³ over
        // their compliances a and rates r.
        let [second, third] = self.moments;
        let rate_per_s = third / second;
        let fluidity = first - factor * second / rate_per_s;
        let slow = SpectralMode { compliance_per_pa: factor * second / (rate_per_s * rate_per_s), rate_per_s };
        (instantaneous, fluidity, slow)
    }
}

/// Returns the complex compliance Re AΛ/(s + Λ) of an oscillating mode at a real s, with the mode's compliance A and rate Λ.
fn transform_of<T: PointScalar>(mode: &OscillatingMode<T>, s_per_s: f64) -> T {
    let ([a_re, a_im], [l_re, l_im]) = (mode.compliance_per_pa, mode.rate_per_s);
    let (top_re, top_im) = (a_re * l_re - a_im * l_im, a_re * l_im + a_im * l_re);
    let bottom_re = l_re + T::constant(s_per_s);
    (top_re * bottom_re + top_im * l_im) / (bottom_re * bottom_re + l_im * l_im)
}
