//! Modes of the response to the force and to the pseudo-stress of a state-dependent quantity, and the coefficients of their time steps.

use super::super::collocation::{ModeStep, N_NODES, NODES, lagrange, of_mode};
use super::super::linear::{oscillating_row, row};
use super::super::moments::{entire_functions, entire_functions_of_decay};
use super::super::numbers::Real;
use super::super::system::{Mode, System, modes_of};
use base::number::Complex;
use laws::rheology::RetardationSpectrum;

/// Modes of the response to the force. The modes of the state-dependent body come first, and only they respond to the pseudo-stress.
pub struct Modes<T> {
    pub real: Vec<Mode<T>>,
    pub oscillating: Vec<Mode<Complex<T>>>,
    /// Number of real modes of the state-dependent body.
    pub n_real: usize,
    /// Number of oscillating modes of the state-dependent body.
    pub n_oscillating: usize,
    /// Instantaneous displacement of the robot per force, in m/N, of the whole law and of the state-dependent body.
    pub instantaneous: [T; 2],
}

/// Coefficients of all modes for a time step of one length.
pub struct Step<T> {
    pub real: Vec<ModeStep<T>>,
    pub oscillating: Vec<ModeStep<Complex<T>>>,
    /// Sums of the modes' contributions to the position at the nodes: over all modes, then over the state-dependent body's modes. Each sum
    /// has one row for a unit of the force level, of its slope and of the deficit behind a lag.
    pub by_force: [[[T; N_NODES]; 3]; 2],
    /// Sum over the body's modes at node i (row), for a unit of the pseudo-stress at node j (column).
    pub by_feedback: [[T; N_NODES]; N_NODES],
    pub length_s: T,
    pub lag_decay: [T; N_NODES],
    pub growth: [T; N_NODES],
}

impl<T: Real> Modes<T> {
    /// Returns the modes for the retardation spectra of the state-dependent body and of all other elements.
    pub fn new(
        [retardation_spectrum, others]: [&RetardationSpectrum<T>; 2],
        compliance_per_m: T,
        softening: T,
    ) -> Self {
        let (real, oscillating) = modes_of(retardation_spectrum, compliance_per_m, softening);
        let (mut real, mut oscillating): (Vec<_>, Vec<_>) = (real.collect(), oscillating.collect());
        let (n_real, n_oscillating) = (real.len(), oscillating.len());
        let (real_others, oscillating_others) = modes_of(others, compliance_per_m, softening);
        real.extend(real_others);
        oscillating.extend(oscillating_others);
        let of_body = compliance_per_m * retardation_spectrum.instantaneous_per_pa;
        let instantaneous = [of_body + compliance_per_m * others.instantaneous_per_pa, of_body];
        Self { real, oscillating, n_real, n_oscillating, instantaneous }
    }
}

impl<T: Real> Step<T> {
    /// Returns the coefficients of a step of this length, for a force that changes linearly (`rises`) or is constant.
    pub fn new(modes: &Modes<T>, system: &System<T>, length_s: T, rises: bool) -> Self {
        let zero = T::constant(0.0);
        let polynomials = std::array::from_fn(lagrange);
        let lag_rate = system.shape.lagging.then_some(system.lag_rate);
        let mut step = Self {
            real: Vec::with_capacity(modes.real.len()),
            oscillating: Vec::with_capacity(modes.oscillating.len()),
            by_force: [[[zero; N_NODES]; 3]; 2],
            by_feedback: [[zero; N_NODES]; N_NODES],
            length_s,
            lag_decay: NODES.map(|part| lag_rate.map_or(zero, |rate| (rate * length_s * -part).exp())),
            growth: NODES.map(|part| (system.softening_rate * length_s * part).exp()),
        };
        for (place, mode) in modes.real.iter().enumerate() {
            let rows = NODES.map(|part| row(*mode, length_s * part, lag_rate, rises));
            let functions = NODES.map(|part| entire_functions_of_decay(mode.rate * length_s * part));
            let of_mode = of_mode(mode.gain * length_s, rows, functions, &polynomials);
            let by_force = [of_mode.by_level, of_mode.by_slope, of_mode.by_deficit];
            step.add(place < modes.n_real, by_force, of_mode.by_feedback);
            step.real.push(of_mode.step);
        }
        for (place, mode) in modes.oscillating.iter().enumerate() {
            let rows = NODES.map(|part| oscillating_row(*mode, length_s * part, lag_rate, rises));
            let functions = NODES.map(|part| entire_functions(mode.rate.times(length_s) * -part));
            let of_mode = of_mode(mode.gain.times(length_s), rows, functions, &polynomials);
            let by_force = [of_mode.by_level, of_mode.by_slope, of_mode.by_deficit].map(|by| by.map(|z| z.re));
            let by_feedback = of_mode.by_feedback.map(|by| by.map(|z| z.re));
            step.add(place < modes.n_oscillating, by_force, by_feedback);
            step.oscillating.push(of_mode.step);
        }
        step
    }

    fn add(&mut self, is_own: bool, by_force: [[T; N_NODES]; 3], by_feedback: [[T; N_NODES]; N_NODES]) {
        let n_sums = if is_own { 2 } else { 1 };
        for sums in &mut self.by_force[..n_sums] {
            for (sum, by) in sums.iter_mut().zip(&by_force) {
                (0..N_NODES).for_each(|i| sum[i] += by[i]);
            }
        }
        if is_own {
            for (sum, by) in self.by_feedback.iter_mut().zip(&by_feedback) {
                (0..N_NODES).for_each(|j| sum[j] += by[j]);
            }
        }
    }
}

/// Returns the weights of the values at a step's start and nodes (columns) that extrapolate their polynomial to each node (row)
/// of the next step. The next step is `ratio` times as long.
pub fn next(ratio: f64) -> [[f64; N_NODES + 1]; N_NODES] {
    let places = places();
    let weight = |x: f64, j: usize| -> f64 {
        (0..=N_NODES).filter(|m| *m != j).map(|m| (x - places[m]) / (places[j] - places[m])).product()
    };
    NODES.map(|part| std::array::from_fn(|j| weight(1.0 + ratio * part, j)))
}

/// Returns the start and the nodes of a step of length 1.
fn places() -> [f64; N_NODES + 1] {
    let mut places = [0.0; N_NODES + 1];
    places[1..].copy_from_slice(&NODES);
    places
}

/// Returns the matrix that differentiates, at each node (row), the polynomial through values at the start and nodes (columns) of
/// a step of length 1.
pub fn slopes() -> [[f64; N_NODES + 1]; N_NODES] {
    let places = places();
    // The slope of the Lagrange polynomial of point j is Σ_k 1/(xⱼ − x_k) Π_{m≠j,k} (x − x_m)/(xⱼ − x_m).
    let slope = |j: usize, x: f64| -> f64 {
        let others = |k: usize| (0..=N_NODES).filter(move |m| *m != j && *m != k);
        let product = |k: usize| others(k).map(|m| (x - places[m]) / (places[j] - places[m])).product::<f64>();
        (0..=N_NODES).filter(|k| *k != j).map(|k| product(k) / (places[j] - places[k])).sum()
    };
    std::array::from_fn(|i| std::array::from_fn(|j| slope(j, NODES[i])))
}
