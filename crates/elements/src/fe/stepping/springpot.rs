//! A springpot as parallel Maxwell arms (physics §3.2), which time steps can advance.
//!
//! For an order 0 < α < 1 the Caputo derivative of the strain ε from t = 0 is
//!
//!  Dᵅε = (sin απ / π) ∫₀^∞ r^{α−1} φ_r dr,  φ̇_r = ε̇ − r φ_r,  φ_r(0) = 0.
//!
//! The integral is the stress of Maxwell arms of all rates r. A trapezoidal sum in ln r
//! approximates it. The error of the sum falls as exp(−π²/h) with the grid's step h. At each end of
//! the grid, one arm replaces all arms beyond that end. It has their total weight and their first
//! moment, which are sums of geometric series. The springpot becomes a dashpot as α → 1 and a
//! spring as α → 0.

use super::radau::Radau;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Step h of the grid in the logarithm of the rates. At this value the error exp(−π²/h) of the sum
/// is 3e-9.
const GRID_STEP: f64 = 0.5;
/// Slowest rate of the grid times the run's duration. The error due to slower arms is about this
/// value to the power 2 + α, with α the springpot's order.
const SLOWEST: f64 = 1e-4;
/// Fastest rate of the grid times the shortest resolved time. The error due to faster arms is about
/// this value to the power −(3 − α), with α the springpot's order.
const FASTEST: f64 = 3e3;

/// Range of rates that springpots resolve, in 1/s.
#[derive(Debug, Clone, Copy)]
pub(super) struct RateRange {
    lowest_per_s: f64,
    highest_per_s: f64,
}

impl RateRange {
    /// Range of rates for a run that lasts `longest_s`, and whose response must be resolved from
    /// `shortest_s` after a switch.
    pub(super) fn between(shortest_s: f64, longest_s: f64) -> Self {
        Self { lowest_per_s: SLOWEST / longest_s, highest_per_s: FASTEST / shortest_s }
    }

    /// Fastest rate (1/s) that steps must resolve.
    pub(super) fn highest_per_s(self) -> f64 {
        self.highest_per_s
    }
}

/// A springpot as Maxwell arms in parallel. Under the strain ε, the dashpot of each arm has a
/// strain ψ with ψ̇ = r (ε − ψ). The total stress is Σ w (ε − ψ), with the weight w and the rate r
/// of each arm.
#[derive(Debug, Clone)]
pub(super) struct Springpot {
    weights_pa: Vec<f64>,
    rates_per_s: Vec<f64>,
    /// Strain of each arm's dashpot.
    flowed: Vec<f64>,
}

/// Coefficients of all arms for steps of one length.
#[derive(Debug, Clone)]
pub(super) struct ArmsStep {
    /// Seven coefficients per arm. The first three give the stress at the three stages per strain
    /// of the arm's dashpot at the start, including its sign. The other four give the dashpot's
    /// strain at the end: three per strain of the springpot at the stages, one per dashpot strain
    /// at the start.
    arms: Vec<[f64; 7]>,
    /// Matrix from the strains to the stresses at the stages.
    pub stiffness: Matrix3<f64>,
}

impl Springpot {
    /// Builds a springpot: its stress is `coefficient` (Pa·sᵅ) times the strain's derivative of the
    /// order α = `order`, with 0 < α < 1.
    pub fn new(coefficient: f64, order: f64, range: RateRange) -> Self {
        let (h, left) = (GRID_STEP, 1.0 - order);
        let (first, last) = ((range.lowest_per_s.ln() / h).floor(), (range.highest_per_s.ln() / h).ceil());
        let density = coefficient * (PI * order.min(left)).sin() / PI * h;
        let n_arms = (last - first) as usize + 1;
        let grid = (0..n_arms).map(|i| ((first + i as f64) * h).exp());
        let mut arms: Vec<(f64, f64)> = grid.map(|rate| (density * rate.powf(order), rate)).collect();
        let (lowest, highest) = ((first * h).exp(), (last * h).exp());
        // Sums over the arms slower than the grid: Σ w, and Σ w r divided by Σ w.
        let slower = lowest.powf(order) / (order * h).exp_m1();
        arms.push((density * slower, lowest * (order * h).exp_m1() / ((1.0 + order) * h).exp_m1()));
        // Sums over the arms faster than the grid: Σ w/r (a viscosity), and Σ w/r² divided by Σ w/r
        // (a time).
        let faster = highest.powf(-left) / (left * h).exp_m1();
        let rate = highest * ((1.0 + left) * h).exp_m1() / (left * h).exp_m1();
        arms.push((density * faster * rate, rate));
        let (weights_pa, rates_per_s): (Vec<f64>, Vec<f64>) = arms.into_iter().unzip();
        Self { flowed: vec![0.0; weights_pa.len()], weights_pa, rates_per_s }
    }

    /// Coefficients of the Maxwell arms for a step of length `step_s`.
    pub(super) fn prepare(&self, radau: &Radau, step_s: f64) -> ArmsStep {
        let mut stiffness = Matrix3::zeros();
        let mut arms = Vec::with_capacity(self.weights_pa.len());
        for (&weight, &rate) in self.weights_pa.iter().zip(&self.rates_per_s) {
            let z = rate * step_s;
            let resolvent = radau.resolvent(z);
            stiffness += resolvent * weight;
            let kept = resolvent * Vector3::repeat(1.0);
            let flow = (resolvent * radau.matrix).row(2) * z;
            arms.push([-weight * kept[0], -weight * kept[1], -weight * kept[2], flow[0], flow[1], flow[2], kept[2]]);
        }
        ArmsStep { arms, stiffness }
    }

    /// Stresses (Pa) at the stages for zero strain.
    pub(super) fn history_pa(&self, step: &ArmsStep) -> Vector3<f64> {
        let mut stress = [0.0; 3];
        for (arm, psi) in step.arms.iter().zip(&self.flowed) {
            for (sum, coefficient) in stress.iter_mut().zip(arm) {
                *sum += coefficient * psi;
            }
        }
        Vector3::from(stress)
    }

    /// Advances the dashpots of the Maxwell arms to the step's end, for given strains at the
    /// stages.
    pub(super) fn advance(&mut self, step: &ArmsStep, strain: &Vector3<f64>) {
        for (arm, psi) in step.arms.iter().zip(&mut self.flowed) {
            *psi = arm[3] * strain[0] + arm[4] * strain[1] + arm[5] * strain[2] + arm[6] * *psi;
        }
    }
}
