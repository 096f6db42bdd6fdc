//! Tests that compare the kernel with closed forms and with Runge–Kutta steps of the equations in physics §5.

use super::numbers::Number;
use super::system::PointNumbers;
use super::{Lanes, N_LANES, Response};
use crate::model::convolve_m;
use base::number::{Dual, PointScalar};
use laws::rheology::{
    BaseLaw, CreepCompliance, Element, OscillatingMode, RetardationSpectrum, SpectralMode, TimeWindow,
};
use laws::stages::{DriftApproach, Stages};
use record::{Force, ForceRule};

const COMPLIANCE_PER_M: f64 = 549.0;
const LETHERSICH: [f64; 3] = [3.527, 1.402, 47.37];

/// Returns times (s) and commands (N) at irregular rows. The command changes at every row at first, then rarely.
pub(super) fn record() -> (Vec<f64>, Vec<f64>) {
    let mut time_s = vec![2.0];
    let mut force_n = Vec::new();
    for i in 0..70 {
        let step_s = if i < 40 { 0.05 } else { [0.03, 0.11, 0.05, 0.2][i % 4] };
        time_s.push(time_s[i] + step_s);
        force_n.push(if i < 12 {
            1e-6 * (3.0 * (1.7 * i as f64).sin())
        } else {
            [4.6e-6, -4.6e-6, 0.0, 2e-6][(i / 13) % 4]
        });
    }
    force_n.push(0.0);
    (time_s, force_n)
}

pub(super) fn lethersich() -> Stages {
    Stages::of_law(BaseLaw::Lethersich.elements(&LETHERSICH.map(Dual::constant)))
}

fn number(value: f64) -> Dual {
    Dual::constant(value)
}

/// Returns the Lethersich law with a second Kelvin–Voigt body and a spring in series.
pub(super) fn rich_law() -> Stages {
    let mut stages = lethersich();
    stages.law.push(Element::kelvin_voigt(number(9.0), number(19.0)));
    stages.law.push(Element::Spring { modulus_pa: number(70.0) });
    stages
}

pub(super) fn respond(stages: &Stages) -> Vec<f64> {
    let (time_s, force_n) = record();
    Response::new(&time_s, &force_n, time_s.len()).trajectory_m(stages, COMPLIANCE_PER_M).expect("a sound model")
}

pub(super) fn largest(position_m: &[f64]) -> f64 {
    position_m.iter().fold(0.0, |largest, x| x.abs().max(largest))
}

pub(super) fn assert_close(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let amplitude = largest(expected);
    for (row, (found, expected)) in found.iter().zip(expected).enumerate() {
        let error = (found - expected).abs() / amplitude;
        assert!(error < tolerance, "{what}, row {row}: {found} against {expected}, {error:e} of the amplitude");
    }
}

/// Integrates the equations of the stages by Runge and Kutta's fourth-order scheme, in steps between all switches and rows. The scheme's
/// error is below 1e-10 for rates below 10/s.
struct RungeKutta<'a> {
    stages: &'a Stages,
    spectrum: &'a RetardationSpectrum,
}

impl RungeKutta<'_> {
    /// Number of states, which are the lagged force, the dashpot, the real modes, and real and imaginary parts of the oscillating
    /// modes.
    fn n_states(&self) -> usize {
        2 + self.spectrum.modes.len() + 2 * self.spectrum.oscillating.len()
    }

    /// Returns the acting force (N) times e^{rt}, and the position (m).
    fn drive(&self, time_s: f64, input_n: f64, state: &[f64]) -> (f64, f64) {
        let n = self.spectrum.modes.len();
        let mut strain = self.spectrum.fluidity_per_pa_s.value * state[1];
        for (mode, s) in self.spectrum.modes.iter().zip(&state[2..]) {
            strain += mode.compliance_per_pa.value * s;
        }
        for (mode, s) in self.spectrum.oscillating.iter().zip(state[2 + n..].chunks(2)) {
            strain += mode.compliance_per_pa[0].value * s[0] - mode.compliance_per_pa[1].value * s[1];
        }
        let before_n = if self.stages.load.lag_time_s.value > 0.0 { state[0] } else { input_n };
        let softened_n = before_n * (self.stages.softening_rate_per_s.value * time_s).exp();
        let instantaneous = self.spectrum.instantaneous_per_pa.value * softened_n;
        let gradient = self.stages.load.gradient_per_m.value;
        // Newton's method solves x = C (instantaneous e^{gx} + strain) for the position x, with g the gradient and C the displacement per
        // strain.
        let mut x = COMPLIANCE_PER_M * strain;
        for _ in 0..if gradient == 0.0 { 1 } else { 8 } {
            let jump_m = COMPLIANCE_PER_M * instantaneous * (gradient * x).exp();
            x -= (x - jump_m - COMPLIANCE_PER_M * strain) / (1.0 - gradient * jump_m);
        }
        (softened_n * (gradient * x).exp(), x)
    }

    fn rate(&self, time_s: f64, input_n: f64, state: &[f64]) -> Vec<f64> {
        let (force_n, _) = self.drive(time_s, input_n, state);
        let lag_time_s = self.stages.load.lag_time_s.value;
        let mut rates = vec![if lag_time_s > 0.0 { (input_n - state[0]) / lag_time_s } else { 0.0 }, force_n];
        let n = self.spectrum.modes.len();
        for (mode, s) in self.spectrum.modes.iter().zip(&state[2..]) {
            rates.push(mode.rate_per_s.value * (force_n - s));
        }
        for (mode, s) in self.spectrum.oscillating.iter().zip(state[2 + n..].chunks(2)) {
            let ([a, b], [re, im]) = (mode.rate_per_s.map(|r| r.value), [force_n - s[0], -s[1]]);
            rates.extend([a * re - b * im, a * im + b * re]);
        }
        rates
    }

    fn trajectory_m(&self) -> Vec<f64> {
        let (time_s, force_n) = record();
        let (load, start_s) = (&self.stages.load, time_s[0]);
        let delay_s = load.delay_s.value;
        let input_n = |time_s_after: f64| {
            let command_n = (0..force_n.len())
                .rfind(|&row| time_s[row] - start_s + delay_s <= time_s_after)
                .map_or(0.0, |row| force_n[row]);
            let factor = if command_n > 0.0 { load.positive_factor } else { load.negative_factor };
            factor.value * command_n + load.offset_n.value
        };
        let mut cuts_s: Vec<f64> = time_s.iter().flat_map(|t| [t - start_s, t - start_s + delay_s]).collect();
        cuts_s.sort_by(f64::total_cmp);
        let (mut state, mut found) = (vec![0.0; self.n_states()], vec![0.0]);
        for pair in cuts_s.windows(2) {
            let (begin_s, length_s) = (pair[0], pair[1] - pair[0]);
            let input = input_n(begin_s + 0.5 * length_s);
            let n_steps = (length_s / 2e-4).ceil();
            let h = length_s / n_steps;
            for step in 0..n_steps as usize {
                let t = begin_s + h * step as f64;
                let moved =
                    |rate: &[f64], by: f64| -> Vec<f64> { state.iter().zip(rate).map(|(s, r)| s + by * r).collect() };
                let k1 = self.rate(t, input, &state);
                let k2 = self.rate(t + 0.5 * h, input, &moved(&k1, 0.5 * h));
                let k3 = self.rate(t + 0.5 * h, input, &moved(&k2, 0.5 * h));
                let k4 = self.rate(t + h, input, &moved(&k3, h));
                for i in 0..state.len() {
                    state[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
                }
            }
            if time_s.get(found.len()).is_some_and(|t| pair[1] >= t - start_s) {
                found.push(self.drive(pair[1], input, &state).1);
            }
        }
        let observation = &self.stages.observation;
        for (x, t) in found.iter_mut().zip(&time_s) {
            let t = t - start_s;
            *x = observation.scale.value * *x + observation.velocity_m_per_s.value * t;
            for approach in &observation.approaches {
                *x += approach.amplitude_m.value * (1.0 - (-t / approach.time_s.value).exp());
            }
        }
        found
    }
}

fn runge_kutta(stages: &Stages, spectrum: &RetardationSpectrum) -> Vec<f64> {
    RungeKutta { stages, spectrum }.trajectory_m()
}

/// Returns the retardation spectrum of the law, with an added oscillating mode if `oscillating`.
pub(super) fn spectrum(stages: &Stages, oscillating: bool) -> RetardationSpectrum {
    let window = TimeWindow { shortest_s: 1e-4, longest_s: 10.0 };
    let mut spectrum = RetardationSpectrum::of_law(&stages.law, window).expect("a spectrum");
    if oscillating {
        let complex = |re, im| [number(re), number(im)];
        let mode = OscillatingMode { compliance_per_pa: complex(0.08, -0.05), rate_per_s: complex(1.3, 6.0) };
        spectrum.oscillating.push(mode);
    }
    spectrum
}

/// Converts a spectrum to the number type of a kernel.
fn carried<T: PointScalar>(spectrum: &RetardationSpectrum) -> RetardationSpectrum<T> {
    let real = |mode: &SpectralMode| SpectralMode {
        compliance_per_pa: T::from_dual(mode.compliance_per_pa),
        rate_per_s: T::from_dual(mode.rate_per_s),
    };
    let complex = |mode: &OscillatingMode| OscillatingMode {
        compliance_per_pa: mode.compliance_per_pa.map(T::from_dual),
        rate_per_s: mode.rate_per_s.map(T::from_dual),
    };
    RetardationSpectrum {
        instantaneous_per_pa: T::from_dual(spectrum.instantaneous_per_pa),
        modes: spectrum.modes.iter().map(real).collect(),
        oscillating: spectrum.oscillating.iter().map(complex).collect(),
        fluidity_per_pa_s: T::from_dual(spectrum.fluidity_per_pa_s),
    }
}

/// Returns the kernel's positions (m) for a given spectrum.
pub(super) fn respond_with<S: Number>(
    stages: &Stages,
    spectrum: &RetardationSpectrum,
    compliance: Dual,
    rule: ForceRule,
) -> Vec<S> {
    let (time_s, force_n) = record();
    let force = Force { at_rows_n: &force_n, rule };
    let mut position_m = Vec::new();
    let response = Response::new(&time_s, force, time_s.len());
    let point = PointNumbers::with_spectrum(stages, &carried(spectrum), PointScalar::from_dual(compliance), 4.6e-6);
    let sound = response.run::<S>(&[&point], &mut position_m);
    assert!(sound[0]);
    position_m
}

#[test]
fn without_effects_is_the_convolution() {
    let (time_s, force_n) = record();
    let law = BaseLaw::Lethersich.creep_compliance(&LETHERSICH).unwrap();
    assert_close(&respond(&lethersich()), &convolve_m(COMPLIANCE_PER_M, &law, &time_s, &force_n), 1e-12, "base");
}

/// Compares positions with the superposition of delayed force steps, for delays shorter than a row, longer than several rows and equal to
/// one row.
#[test]
fn delays_are_superpositions_of_late_steps() {
    let (time_s, force_n) = record();
    let mut law: CreepCompliance = BaseLaw::Lethersich.creep_compliance(&LETHERSICH).unwrap();
    law.instantaneous_per_pa = 1.0 / 70.0;
    for delay_s in [1e-9, 0.013, 0.05, 0.183, 1.0, 50.0] {
        let mut stages = lethersich();
        stages.law.push(Element::Spring { modulus_pa: number(70.0) });
        stages.load.delay_s = number(delay_s);
        let expected: Vec<f64> = time_s
            .iter()
            .map(|t| {
                let switches = (0..time_s.len()).filter(|&k| t - time_s[k] - delay_s > 1e-12);
                let change = |k: usize| force_n[k] - if k > 0 { force_n[k - 1] } else { 0.0 };
                switches.map(|k| COMPLIANCE_PER_M * change(k) * law.at(t - time_s[k] - delay_s)).sum()
            })
            .collect();
        let found = respond(&stages);
        if delay_s > 20.0 {
            assert_eq!(largest(&found), 0.0);
        } else {
            assert_close(&found, &expected, 1e-11, &format!("delay {delay_s}"));
        }
    }
}

/// Compares a Kelvin–Voigt body behind a lag with its closed form, also if lag and retardation time are equal or nearly equal.
#[test]
fn lag_of_a_single_body_has_its_closed_form() {
    let time_s: Vec<f64> = (0..60).map(|i| 0.1 * f64::from(i)).collect();
    let record = Response::new(&time_s, &[1.0; 60], 60);
    for ratio in [0.0625, 0.5, 1.0, 1.0 + 1e-7, 1.0 - 1e-7, 3.0, 40.0] {
        let body_s = 0.4;
        let lag_s = body_s * ratio;
        let mut stages = Stages::of_law(vec![Element::kelvin_voigt(number(1.0), number(body_s))]);
        stages.load.lag_time_s = number(lag_s);
        let expected: Vec<f64> = time_s
            .iter()
            .map(|&t| {
                if (ratio - 1.0).abs() < 1e-3 {
                    // The response for nearly equal times is 1 − (1 + u) e⁻ᵘ plus its first-order change with the ratio of the
                    // times. The next term is below 1e-14.
                    let u = t / body_s;
                    1.0 - (1.0 + u) * (-u).exp() - 0.5 * (ratio - 1.0) * u * u * (-u).exp()
                } else {
                    1.0 - (body_s * (-t / body_s).exp() - lag_s * (-t / lag_s).exp()) / (body_s - lag_s)
                }
            })
            .collect();
        let found = record.trajectory_m(&stages, 1.0).expect("sound");
        assert_close(&found, &expected, 2e-13, &format!("ratio {ratio}"));
    }
}

/// Checks every combination of delay, lag, softening and gradient, with and without an oscillating mode. Every combination has
/// bias, asymmetry and drift. The tolerance for the exact recursions is the error of the Runge–Kutta steps. Combinations with a
/// gradient use collocation, with a tolerance of 2e-8.
#[test]
fn all_combinations_equal_runge_kutta() {
    for choice in 0..32 {
        let on = |bit: u32, value: f64| number(if choice & (1 << bit) != 0 { value } else { 0.0 });
        let mut stages = rich_law();
        stages.load.delay_s = on(0, 0.237);
        stages.load.lag_time_s = on(1, 0.09);
        stages.softening_rate_per_s = on(2, 0.12);
        stages.load.gradient_per_m = on(3, -350.0);
        (stages.load.positive_factor, stages.load.negative_factor) = (number(1.1), number(0.8));
        stages.load.offset_n = number(3e-7);
        stages.observation.scale = number(0.93);
        stages.observation.velocity_m_per_s = number(-2e-5);
        stages.observation.approaches.push(DriftApproach { amplitude_m: number(1e-4), time_s: number(0.8) });
        let spectrum = spectrum(&stages, choice & 16 != 0);
        let found: Vec<f64> = respond_with(&stages, &spectrum, number(COMPLIANCE_PER_M), ForceRule::Hold);
        let tolerance = if choice & 8 == 0 { 1e-10 } else { 2e-8 };
        assert_close(&found, &runge_kutta(&stages, &spectrum), tolerance, &format!("combination {choice:05b}"));
    }
}

/// Checks a gel that sets so fast that the rates of its slowest modes become negative, with and without other effects.
#[test]
fn a_gel_that_sets_equals_runge_kutta() {
    for (rate, lag_time_s, gradient_per_m) in
        [(-0.02, 0.0, 0.0), (-0.9, 0.0, 0.0), (-0.9, 0.09, 0.0), (-0.9, 0.09, -350.0)]
    {
        let mut stages = rich_law();
        stages.softening_rate_per_s = number(rate);
        stages.load.lag_time_s = number(lag_time_s);
        stages.load.gradient_per_m = number(gradient_per_m);
        for oscillates in [false, true] {
            let spectrum = spectrum(&stages, oscillates);
            let found: Vec<f64> = respond_with(&stages, &spectrum, number(COMPLIANCE_PER_M), ForceRule::Hold);
            let tolerance = if gradient_per_m == 0.0 { 1e-10 } else { 2e-8 };
            assert_close(
                &found,
                &runge_kutta(&stages, &spectrum),
                tolerance,
                &format!("{rate} {lag_time_s} {oscillates}"),
            );
        }
    }
}

/// Checks force gradients g that decrease or increase the force several times over. For a dashpot of fluidity φ, the position x obeys
/// e^{−gx} = 1 − g C φ F t until the force F diverges. C is the displacement per force at unit creep compliance.
#[test]
fn a_dashpot_under_a_strong_gradient_is_a_closed_form() {
    let time_s: Vec<f64> = (0..80).map(|i| 0.1 * f64::from(i)).collect();
    let response = Response::new(&time_s, &[4e-6; 80], time_s.len());
    let mut stages = Stages::of_law(vec![Element::Dashpot { viscosity_pa_s: number(10.0) }]);
    let speed_m_per_s = COMPLIANCE_PER_M * 4e-6 / 10.0;
    let whole_m = speed_m_per_s * time_s[79];
    let mut strongest = 0.0_f64;
    for share in [-300.0, -20.0, -3.0, -0.3, 0.3, 0.9, 0.99] {
        let gradient = share / whole_m;
        stages.load.gradient_per_m = number(gradient);
        let found = response.trajectory_m(&stages, COMPLIANCE_PER_M).expect("sound");
        let exact: Vec<f64> = time_s.iter().map(|t| -(-gradient * speed_m_per_s * t).ln_1p() / gradient).collect();
        let error = found.iter().zip(&exact).fold(0.0_f64, |e, (a, b)| e.max((a - b).abs())) / largest(&exact);
        println!("{share}: {error:.1e}, g x up to {:.2}", gradient.abs() * largest(&exact));
        strongest = strongest.max(gradient.abs() * largest(&exact));
        assert!(error < 1e-7, "{share}: {error:e}");
    }
    assert!(strongest > 5.0, "{strongest}");
    for share in [1.01, 2.0, 50.0] {
        stages.load.gradient_per_m = number(share / whole_m);
        let error = response.trajectory_m(&stages, COMPLIANCE_PER_M).expect_err("runs away").to_string();
        assert!(error.contains("pulls the robot away"), "{error}");
    }
}

/// Checks a lag much shorter than a row, with a force gradient. To first order, such a lag delays the force.
#[test]
fn short_lags_under_a_gradient_equal_runge_kutta() {
    for lag_time_s in [2e-3, 1.3e-2] {
        let mut stages = lethersich();
        stages.load.gradient_per_m = number(400.0);
        stages.load.lag_time_s = number(lag_time_s);
        let spectrum = spectrum(&stages, false);
        assert_close(&respond(&stages), &runge_kutta(&stages, &spectrum), 1e-8, &format!("lag {lag_time_s}"));
    }
}

#[test]
fn strong_feedback_is_refused() {
    let (time_s, force_n) = record();
    let response = Response::new(&time_s, &force_n, time_s.len());
    let mut stages = lethersich();
    stages.load.gradient_per_m = number(5e3);
    let error = response.trajectory_m(&stages, COMPLIANCE_PER_M).expect_err("refused").to_string();
    assert!(error.contains("gradient"), "{error}");
    let mut positions = Vec::new();
    let sound = response.trajectories_m(&[lethersich(), stages], &[COMPLIANCE_PER_M; 2], &mut positions);
    assert_eq!(sound, [true, false, false, false, false, false, false, false]);
}

/// Checks that points of several shapes in one batch have the bits of single points, under forces with many and with few levels.
#[test]
fn lanes_have_the_bits_of_single_points() {
    let (time_s, many_n) = record();
    let few_n: Vec<f64> = many_n.iter().map(|force_n| 2e-6 * (force_n / 1.7e-6).round().clamp(-2.0, 2.0)).collect();
    for force_n in [&many_n, &few_n] {
        lanes_have_the_bits_of_single_points_under(&time_s, force_n.into());
    }
    lanes_have_the_bits_of_single_points_under(&time_s, Force { at_rows_n: &many_n, rule: ForceRule::Linear });
}

fn lanes_have_the_bits_of_single_points_under(time_s: &[f64], force: Force<'_>) {
    let response = Response::new(time_s, force, time_s.len());
    let variant = |kind: usize| {
        let mut stages = if kind % 3 == 2 { rich_law() } else { lethersich() };
        let size = 0.1 * kind as f64;
        if kind & 1 != 0 {
            stages.load.delay_s = number(size);
        }
        if kind & 2 != 0 {
            stages.load.lag_time_s = number(0.3 * size);
        }
        if kind & 4 != 0 {
            stages.softening_rate_per_s = number(0.1 * size);
        }
        if kind & 8 != 0 {
            stages.load.gradient_per_m = number(100.0 * size);
            stages.observation.velocity_m_per_s = number(1e-5 * size);
        }
        stages
    };
    for step in 0..9 {
        let points: Vec<Stages> = (0..N_LANES).map(|lane| variant((lane * step + lane / 2 + step) % 32)).collect();
        for count in [1, 3, N_LANES] {
            let compliance: Vec<f64> = (0..count).map(|lane| COMPLIANCE_PER_M + lane as f64).collect();
            let mut positions: Vec<Lanes> = Vec::new();
            let sound = response.trajectories_m(&points[..count], &compliance, &mut positions);
            for lane in 0..count {
                assert!(sound[lane]);
                let alone = response.trajectory_m(&points[lane], compliance[lane]).expect("sound");
                for (row, x) in alone.iter().enumerate() {
                    assert_eq!(positions[row].0[lane].to_bits(), x.to_bits(), "step {step}, lane {lane}, row {row}");
                }
            }
        }
    }
}

/// Checks records without rows, with one row, and with fewer prepared rows than times.
#[test]
fn short_records_are_served() {
    let (time_s, force_n) = record();
    for n_rows in [0, 1, 30] {
        let response = Response::new(&time_s, &force_n, n_rows);
        let mut stages = lethersich();
        assert_eq!(response.trajectory_m(&stages, COMPLIANCE_PER_M).expect("sound"), respond(&stages)[..n_rows]);
        stages.load.gradient_per_m = number(-350.0);
        stages.load.delay_s = number(0.07);
        assert_eq!(response.trajectory_m(&stages, COMPLIANCE_PER_M).expect("sound"), respond(&stages)[..n_rows]);
    }
}

/// Checks that a delay of whole rows, up to rounding, shifts the trajectory by rows. No row is lost if a switch coincides with a
/// row.
#[test]
fn delays_of_whole_rows_shift_the_trajectory() {
    let time_s: Vec<f64> = (0..60).map(|i| 0.05 * f64::from(i)).collect();
    let force_n: Vec<f64> = (0..60).map(|i| 4.6e-6 * f64::from([1, 1, -1, 0][(i / 7) % 4])).collect();
    let response = Response::new(&time_s, &force_n, time_s.len());
    for lag_time_s in [0.0, 0.03] {
        let mut stages = rich_law();
        stages.load.gradient_per_m = number(-350.0);
        stages.load.lag_time_s = number(lag_time_s);
        let plain = response.trajectory_m(&stages, COMPLIANCE_PER_M).expect("sound");
        for n_rows in [1, 4] {
            for rounding in [-1e-15, -1e-17, 0.0, 1e-17, 1e-15] {
                stages.load.delay_s = number(time_s[n_rows] + rounding);
                let found = response.trajectory_m(&stages, COMPLIANCE_PER_M).expect("sound");
                // An instantaneous response may jump just before or just after a row that coincides with a switch, so only the
                // other rows are compared.
                for row in n_rows..time_s.len() {
                    let at_switch = row == n_rows || force_n[row - n_rows] != force_n[row - n_rows - 1];
                    let error = (found[row] - plain[row - n_rows]).abs() / largest(&plain);
                    assert!(at_switch || error < 1e-8, "{lag_time_s} {n_rows} {rounding:e} {row}: {error:e}");
                }
            }
        }
    }
}
