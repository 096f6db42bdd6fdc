//! Sum of exponentials for a density of retardation rates on a grid.
//!
//! A law without discrete rates has J(t) = J₀ + ∫ L(u) (1 − e^{−eᵘt}) du + φ t. The midpoint rule in u converges faster than any power of its
//! step, but its nodes extend without end to both sides. Nodes inside the window are kept. Nodes too fast for the window become instantaneous compliance. Nodes too slow
//! become flow and one more mode. The sums over the nodes outside the window converge slowly. They are computed from the law's complex compliance J*(s) at
//! two real s.
//!
//! Error of the fine rule over the window, with h L the weight of a node: a fast node causes an error h L e^{−rt}, at most e^{−19.5} = 3.4e-9 of h L. The
//! next faster nodes cause e^{−31}, e^{−50}, … of h L. The Gauss–Radau rule keeps moments 1, 2 and 3 of the slow nodes. Each slow node causes an error
//! h L (rt)⁴/24, at most 3.4e-8 of h L at rt = 0.03. The next slower node causes e^{−4h} = 0.15 of that. With weights below 0.05/E this is 2e-9/E in all. The rule itself adds an error of 1e-9.

use super::{OscillatingMode, RetardationSpectrum, SpectralMode, TimeWindow};
use base::number::PointScalar;

/// Midpoint rule in u, and its limits.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rule {
    /// Step h; the rule's error is e^{−π²/h} times the integral of the density along Im u = π/2.
    pub step: f64,
    /// Slowest kept rate times the window's longest time, where weights do not rise towards slow rates.
    pub slowest: f64,
    /// Slowest kept rate times the window's longest time where weights may rise as r^{−α}, as a springpot's do.
    pub slowest_of_rising: f64,
    /// Fastest kept rate times the window's shortest time.
    pub fastest: f64,
    /// Share of a tail's sum below which terms are neglected. The sums enter with a factor of 1e-3.
    pub tail: f64,
}

/// Rule with a total error of 1e-8; the midpoint rule errs by 8e-10.
pub(super) const FINE: Rule = Rule { step: 0.47, slowest: 0.03, slowest_of_rising: 0.01, fastest: 19.5, tail: 1e-6 };

/// Rule with a total error of 1e-6. The midpoint rule errs by 2e-7, fast nodes by e^{−13} = 2e-6 and slow ones by 0.08⁴/24 = 2e-6 of their weights.
pub(super) const FAST: Rule = Rule { step: 0.64, slowest: 0.08, slowest_of_rising: 0.03, fastest: 13.0, tail: 1e-4 };

/// Least ratio of a window's longest to its shortest time. It keeps the two equations for the lumped nodes independent.
const LEAST_SPAN: f64 = 16.0;
/// Bound on the number of a tail's nodes. It is not reached, because terms fall by e^{h} at least.
const MAX_TAIL: usize = 4000;

/// Density of retardation rates at the nodes of a midpoint rule.
pub(super) struct Density<'a, T, N, C> {
    /// Function of a node that returns its rate and its weight h L without `factor`.
    pub node: N,
    /// J*(s) in 1/Pa at s in 1/s.
    pub compliance: C,
    /// Common factor of the weights. The factor may be 0, the weights must not be.
    pub factor: T,
    /// Rule with the nodes u = (k + ½) h.
    pub rule: Rule,
    /// Slowest kept rate times the window's longest time.
    pub slowest: f64,
    /// ln of the rate at u = 0.
    pub ln_scale: f64,
    /// α of [`Node::power`].
    pub order: T,
    /// Least length of the tails in u, because weights may rise again there.
    pub least_tail: f64,
    /// Oscillating modes in addition to the nodes.
    pub poles: &'a [OscillatingMode<T>],
}

/// Node of the midpoint rule. Powers are updated from node to node, since exponentials would dominate the cost.
#[derive(Clone, Copy)]
pub(super) struct Node<T> {
    /// u.
    pub u: f64,
    /// eᵘ.
    pub exp_u: f64,
    /// e^{αu}.
    pub power: T,
}

impl<T: PointScalar, N: Fn(Node<T>) -> SpectralMode<T>, C: Fn(f64) -> T> Density<'_, T, N, C> {
    /// Adds the density's spectrum over a window.
    ///
    /// The number of kept nodes depends on the rule and the window alone, so that all points of a batch have equally many.
    pub(super) fn add_to(&self, spectrum: &mut RetardationSpectrum<T>, window: TimeWindow) {
        let Rule { step, fastest, tail, .. } = self.rule;
        let longest_s = window.longest_s.max(LEAST_SPAN * window.shortest_s);
        let slowest_per_s = self.slowest / longest_s;
        let first = ((slowest_per_s.ln() - self.ln_scale) / step - 0.5).ceil();
        let n_kept = ((fastest / (window.shortest_s * slowest_per_s)).ln() / step).ceil() as usize;
        let u = (first + 0.5) * step;
        let start = Node { u, exp_u: u.exp(), power: (self.order * u).exp() };
        // Both s are between the slowest and the fastest rates, far from both.
        let mut lumps = Lumps::new([1.0 / longest_s, 1.0 / (longest_s * window.shortest_s).sqrt()], tail, self);
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

/// Sums over nodes that end up as instantaneous compliance, fluidity and one slow mode.
///
/// T is the slowly converging sum Σ a of the fast nodes plus J₀, and M the sum Σ a r of the slow ones plus φ. At both s the quickly converging sums give
/// T + M/s = J*(s) − Σ_kept a r/(s + r) + Σ_slow a r²/(s(s + r)) + Σ_fast a s/(s + r).
struct Lumps<T> {
    s_per_s: [f64; 2],
    right_side: [T; 2],
    tails: [T; 2],
    /// Σ a r² and Σ a r³ of the slow nodes.
    moments: [T; 2],
    /// Σ a s/(s + r) of the fast nodes at the larger s, by value.
    fast: f64,
    /// [`Rule::tail`].
    tail: f64,
}

impl<T: PointScalar> Lumps<T> {
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

    /// Adds a slow node. Returns true if it is small enough to be the last.
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

    /// Adds a fast node. Returns true if it is small enough to be the last.
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

    /// Returns J₀ and φ with the lumped nodes, and the slow mode.
    fn solve(&self, factor: T) -> (T, T, SpectralMode<T>) {
        let [t0, t1] = self.s_per_s.map(f64::recip);
        let [right0, right1] = [0, 1].map(|i| self.right_side[i] + self.tails[i] * factor);
        let first = (right0 - right1) * (t0 - t1).recip();
        let instantaneous = right0 - first * t0;
        // Gauss–Radau: a node at rate 0 and one at q with the weight b carry Σ a r, Σ a r² and Σ a r³.
        let [second, third] = self.moments;
        let rate_per_s = third / second;
        let fluidity = first - factor * second / rate_per_s;
        let slow = SpectralMode { compliance_per_pa: factor * second / (rate_per_s * rate_per_s), rate_per_s };
        (instantaneous, fluidity, slow)
    }
}

/// Transform Re AΛ/(s + Λ) of an oscillating mode.
fn transform_of<T: PointScalar>(mode: &OscillatingMode<T>, s_per_s: f64) -> T {
    let ([a_re, a_im], [l_re, l_im]) = (mode.compliance_per_pa, mode.rate_per_s);
    let (top_re, top_im) = (a_re * l_re - a_im * l_im, a_re * l_im + a_im * l_re);
    let bottom_re = l_re + T::constant(s_per_s);
    (top_re * bottom_re + top_im * l_im) / (bottom_re * bottom_re + l_im * l_im)
}
