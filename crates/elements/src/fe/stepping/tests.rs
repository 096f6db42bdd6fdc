//! Tests of the time steps against closed forms, quadrature and small explicit steps, which share
//! no code with them.

use super::Resolution;
use super::run::strains;
use base::number::Dual;
use laws::rheology::{BaseLaw, Element};
use laws::stages::{DriftApproach, Observation, Stages, balanced_exponent};
use statrs::function::erf::erfc;
use statrs::function::gamma::gamma;

/// The paper's Young's modulus (Pa), retardation and flow viscosity (Pa·s), and two more parameters
/// for laws with more elements.
const PARAMETERS: [f64; 5] = [3.527, 1.402, 47.370, 20.0, 2.5];

fn dual(value: f64) -> Dual {
    Dual::constant(value)
}

fn law(base: BaseLaw) -> Vec<Element> {
    base.elements(&PARAMETERS.map(dual)[..base.parameters().len()])
}

fn spring(modulus_pa: f64) -> Element {
    Element::Spring { modulus_pa: dual(modulus_pa) }
}

fn dashpot(viscosity_pa_s: f64) -> Element {
    Element::Dashpot { viscosity_pa_s: dual(viscosity_pa_s) }
}

fn springpot(modulus_pa: f64, time_s: f64, order: f64) -> Element {
    Element::Springpot { modulus_pa: dual(modulus_pa), time_s: dual(time_s), order: dual(order) }
}

/// Irregular times (s) from 3 s on, with a gap and rows 1 ms apart, and forces. The forces are
/// holds of both signs, a rest, and a force that changes at every row. The gap is after the row
/// `gap`, and the changes end at the row `held`.
pub(crate) fn record_of(n_rows: u32, gap: u32, held: u32) -> (Vec<f64>, Vec<f64>) {
    let (mut time_s, mut force_n, mut t) = (Vec::new(), Vec::new(), 3.0);
    for row in 0..n_rows {
        time_s.push(t);
        t += match row {
            _ if row == gap => 2.5,
            _ if row % 13 == 5 => 0.001,
            _ => 0.02 + 0.015 * f64::from(row % 4),
        };
        force_n.push(match row {
            0..25 => 1.0,
            25..40 => 0.0,
            40..75 => -1.0,
            75.. if row < held => 0.1 * f64::from(row - 75),
            _ => 0.7,
        });
    }
    (time_s, force_n)
}

fn record() -> (Vec<f64>, Vec<f64>) {
    record_of(120, 70, 90)
}

/// Superposition Σ ΔFₖ J(t − tₖ − δ) of force steps ΔFₖ at the times tₖ, with the creep compliance
/// J and the delay δ = `delay_s`. Positions are those before any force step at the row.
fn superposition(time_s: &[f64], force_n: &[f64], delay_s: f64, creep: impl Fn(f64) -> f64) -> Vec<f64> {
    let before = |k: usize| if k == 0 { 0.0 } else { force_n[k - 1] };
    let at = |t: f64| {
        let steps = (0..time_s.len()).filter(|&k| t > time_s[k] + delay_s && force_n[k] != before(k));
        steps.map(|k| (force_n[k] - before(k)) * creep(t - time_s[k] - delay_s)).sum()
    };
    time_s.iter().map(|&t| at(t)).collect()
}

/// Largest difference of two lists, divided by the largest value of `exact`.
pub(crate) fn distance(found: &[f64], exact: &[f64]) -> f64 {
    assert_eq!(found.len(), exact.len());
    let amplitude = exact.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    found.iter().zip(exact).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / amplitude
}

fn stepped(stages: &Stages, time_s: &[f64], force_n: &[f64]) -> Vec<f64> {
    strains(1.0, stages, time_s, force_n.into(), Resolution::default()).expect("a sound model")
}

/// Largest error of a law's response to the record, relative to the largest value from the creep
/// compliance `creep`.
fn law_error(law: Vec<Element>, creep: impl Fn(f64) -> f64) -> f64 {
    let (time_s, force_n) = record();
    distance(&stepped(&Stages::of_law(law), &time_s, &force_n), &superposition(&time_s, &force_n, 0.0, creep))
}

/// Mittag-Leffler function E_α(−x) by its power series, for x small enough that the terms do not
/// cancel too much.
fn mittag_leffler(order: f64, x: f64) -> f64 {
    assert!(x.powf(order.recip()) < 9.0, "the series loses too many digits at {x}");
    (0..400).map(|k| (-x).powi(k) / gamma(1.0 + order * f64::from(k))).take_while(|term| term.abs() > 1e-18).sum()
}

#[test]
fn base_laws_are_the_superposition_with_and_without_a_delay() {
    let (time_s, force_n) = record();
    for base in BaseLaw::NAMED {
        let creep = base.creep_compliance(&PARAMETERS[..base.parameters().len()]).unwrap();
        for delay_s in [0.0, 1e-6, 0.0137, 0.02, 0.3] {
            let mut stages = Stages::of_law(law(base));
            stages.load.delay_s = dual(delay_s);
            let exact = superposition(&time_s, &force_n, delay_s, |t| creep.at(t));
            let error = distance(&stepped(&stages, &time_s, &force_n), &exact);
            assert!(error < 2e-8, "{base:?} {delay_s}: {error:e}");
        }
    }
}

#[test]
fn factors_and_offset_act_on_the_command() {
    let (time_s, force_n) = record();
    let mut stages = Stages::of_law(law(BaseLaw::Lethersich));
    stages.load.positive_factor = dual(1.1);
    stages.load.negative_factor = dual(0.8);
    stages.load.offset_n = dual(0.05);
    let acting: Vec<f64> = force_n.iter().map(|&f| 0.05 + if f < 0.0 { 0.8 * f } else { 1.1 * f }).collect();
    let creep = BaseLaw::Lethersich.creep_compliance(&PARAMETERS[..3]).unwrap();
    let exact = superposition(&time_s, &acting, 0.0, |t| creep.at(t));
    assert!(distance(&stepped(&stages, &time_s, &force_n), &exact) < 2e-8);
}

/// Checks that a force offset acts from the record's start, before a delayed command.
#[test]
fn an_offset_does_not_wait_for_the_command() {
    let (time_s, force_n) = record();
    let mut stages = Stages::of_law(vec![dashpot(2.0)]);
    stages.load.offset_n = dual(0.5);
    stages.load.delay_s = dual(0.1);
    let commanded = superposition(&time_s, &force_n, 0.1, |t| t / 2.0);
    let exact: Vec<f64> = time_s.iter().zip(commanded).map(|(t, x)| x + 0.25 * (t - 3.0)).collect();
    assert!(distance(&stepped(&stages, &time_s, &force_n), &exact) < 1e-10);
}

#[test]
fn lag_is_the_closed_form() {
    let (time_s, force_n) = record();
    let [e, c1, c2, ..] = PARAMETERS;
    let body_s = c1 / e;
    for lag_s in [1e-9, 1e-4, 0.03, 0.39, 2.0, 100.0] {
        let mut stages = Stages::of_law(law(BaseLaw::Lethersich));
        stages.load.lag_time_s = dual(lag_s);
        let lagged = |t: f64| {
            let body = (lag_s * (-t / lag_s).exp() - body_s * (-t / body_s).exp()) / (lag_s - body_s);
            (1.0 - body) / e + (t + lag_s * (-t / lag_s).exp_m1()) / c2
        };
        let exact = superposition(&time_s, &force_n, 0.0, lagged);
        let error = distance(&stepped(&stages, &time_s, &force_n), &exact);
        assert!(error < 2e-8, "{lag_s}: {error:e}");
    }
}

/// Compares with ∫J(t − s) d(F e^{rs}), computed as jumps plus Simpson's rule within holds.
#[test]
fn softening_is_the_integral_over_the_amplified_force() {
    let (time_s, force_n) = record();
    let creep = BaseLaw::Burgers.creep_compliance(&PARAMETERS[..4]).unwrap();
    for rate in [1e-3, 0.2, 1.5, -1e-3, -0.2, -1.5] {
        let mut stages = Stages::of_law(law(BaseLaw::Burgers));
        stages.softening_rate_per_s = dual(rate);
        let amplified = |s: f64| (rate * (s - time_s[0])).exp();
        let between = |row: usize, k: usize| {
            let (a, h) = (time_s[k], (time_s[k + 1] - time_s[k]) / 200.0);
            let weight = |i: u32| if i == 0 || i == 200 { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
            let value = |s: f64| rate * amplified(s) * creep.at(time_s[row] - s);
            let sum: f64 = (0..=200).map(|i| weight(i) * value(a + h * f64::from(i))).sum();
            sum * h / 3.0 * force_n[k]
        };
        let jump = |row: usize, k: usize| {
            let before = if k == 0 { 0.0 } else { force_n[k - 1] };
            (force_n[k] - before) * amplified(time_s[k]) * creep.at(time_s[row] - time_s[k])
        };
        let exact: Vec<f64> =
            (0..time_s.len()).map(|row| (0..row).map(|k| jump(row, k) + between(row, k)).sum()).collect();
        let error = distance(&stepped(&stages, &time_s, &force_n), &exact);
        assert!(error < 2e-8, "{rate}: {error:e}");
    }
}

#[test]
fn a_springpot_alone_creeps_by_a_power_of_time() {
    for order in [0.02, 0.3, 0.5, 0.8, 0.99, 1.0 - 1e-9] {
        let (modulus, time) = (3.0, 0.4_f64);
        let scale = modulus * time.powf(order) * gamma(1.0 + order);
        let error = law_error(vec![springpot(modulus, time, order)], |t| t.powf(order) / scale);
        assert!(error < 1e-8, "{order}: {error:e}");
    }
}

#[test]
fn a_fractional_kelvin_voigt_body_is_the_mittag_leffler_function() {
    for order in [0.3, 0.6, 0.9, 0.999] {
        let (modulus, time) = (3.0, 1.1);
        let law = vec![Element::Parallel(vec![spring(modulus), springpot(modulus, time, order)])];
        let creep = |t: f64| (1.0 - mittag_leffler(order, (t / time).powf(order))) / modulus;
        let error = law_error(law, creep);
        assert!(error < 1e-8, "{order}: {error:e}");
    }
}

/// Compares with E_{1/2}(−x) = exp(x²) erfc(x), far beyond the range of the power series.
#[test]
fn a_fast_fractional_body_is_the_scaled_error_function() {
    let time = 0.02;
    let law = vec![Element::Parallel(vec![springpot(3.0, time, 0.5), spring(3.0)]), dashpot(50.0)];
    let creep = |t: f64| (1.0 - (t / time).exp() * erfc((t / time).sqrt())) / 3.0 + t / 50.0;
    let error = law_error(law, creep);
    assert!(error < 1e-8, "{error:e}");
}

/// Checks a law with two levels of nesting: a springpot in a Maxwell arm beside a spring.
#[test]
fn a_fractional_zener_body_is_its_closed_form() {
    let (e1, e2, time, order) = (3.0, 5.0, 0.5_f64, 0.7);
    let arm = Element::Series(vec![spring(e2), Element::Series(vec![springpot(e2, time, order)])]);
    let slow = time * ((e1 + e2) / e1).powf(order.recip());
    let creep = |t: f64| {
        let both = 1.0 / (e1 + e2);
        both + (1.0 / e1 - both) * (1.0 - mittag_leffler(order, (t / slow).powf(order)))
    };
    let error = law_error(vec![Element::Parallel(vec![spring(e1), arm])], creep);
    assert!(error < 1e-8, "{error:e}");
}

/// Checks that two Maxwell arms in parallel, one of them in a nested parallel group, equal a
/// Burgers body.
#[test]
fn maxwell_arms_are_a_burgers_body() {
    let (e1, c1, e2, c2) = (3.0, 0.9, 8.0, 30.0);
    let arm = |e: f64, c: f64| Element::Series(vec![spring(e), dashpot(c)]);
    let (t1, t2, c) = (c1 / e1, c2 / e2, c1 + c2);
    let time = (c1 * t2 + c2 * t1) / c;
    let retarded = -time * (1.0 - t1 / time) * (1.0 - t2 / time) / c;
    let creep = |t: f64| 1.0 / (e1 + e2) - retarded * (-t / time).exp_m1() + t / c;
    let error = law_error(vec![Element::Parallel(vec![arm(e1, c1), Element::Parallel(vec![arm(e2, c2)])])], creep);
    assert!(error < 2e-8, "{error:e}");
}

#[test]
fn rigid_elements_and_elements_without_resistance_act_as_their_limits() {
    let (time_s, force_n) = record();
    let run = |law| stepped(&Stages::of_law(law), &time_s, &force_n);
    let rigid = Element::Parallel(vec![spring(f64::INFINITY), dashpot(1.0)]);
    let idle = Element::Series(vec![dashpot(0.0), spring(1.0)]);
    let plain = run(vec![spring(2.0), dashpot(3.0)]);
    let more = run(vec![spring(2.0), rigid, Element::Parallel(vec![dashpot(3.0), idle.clone()])]);
    assert!(distance(&more, &plain) < 1e-12);
    let refused =
        strains(1.0, &Stages::of_law(vec![spring(2.0), idle]), &time_s, (&force_n).into(), Resolution::default());
    assert!(matches!(refused, Err(base::Error::Numerical { .. })));
}

/// All effects at once with a spring in series, solved by the classical Runge–Kutta method.
struct AllAtOnce<'a> {
    stages: &'a Stages,
    start_s: f64,
}

impl AllAtOnce<'_> {
    /// Force on the robot, and strain, for the state `y` = (lagged force, ε_k, ε_d).
    fn acting(&self, t: f64, input_n: f64, y: [f64; 3]) -> (f64, f64) {
        let lagged_n = if self.stages.load.lag_time_s.value > 0.0 { y[0] } else { input_n };
        let g = self.stages.load.gradient_per_m.value;
        let spring = (self.stages.softening_rate_per_s.value * (t - self.start_s)).exp() / PARAMETERS[3];
        let force_n = lagged_n * balanced_exponent(g * (y[1] + y[2]), g * lagged_n * spring).exp();
        (force_n, y[1] + y[2] + force_n * spring)
    }

    fn rates(&self, t: f64, input_n: f64, y: [f64; 3]) -> [f64; 3] {
        let [e, c1, c2, ..] = PARAMETERS;
        let stress = self.acting(t, input_n, y).0 * (self.stages.softening_rate_per_s.value * (t - self.start_s)).exp();
        let lag_s = self.stages.load.lag_time_s.value;
        let lag = if lag_s > 0.0 { (input_n - y[0]) / lag_s } else { 0.0 };
        [lag, (stress - e * y[1]) / c1, stress / c2]
    }

    fn advance(&self, from: f64, to: f64, input_n: f64, y: &mut [f64; 3]) {
        let n = ((to - from) / 1e-3).ceil() as u32;
        let h = (to - from) / f64::from(n.max(1));
        let moved = |y: [f64; 3], k: [f64; 3], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
        for i in 0..n {
            let t = from + h * f64::from(i);
            let k1 = self.rates(t, input_n, *y);
            let k2 = self.rates(t + 0.5 * h, input_n, moved(*y, k1, 0.5 * h));
            let k3 = self.rates(t + 0.5 * h, input_n, moved(*y, k2, 0.5 * h));
            let k4 = self.rates(t + h, input_n, moved(*y, k3, h));
            *y = std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        }
    }

    /// Strain q (N/Pa) at every row.
    fn run(&self, time_s: &[f64], force_n: &[f64]) -> Vec<f64> {
        let load = &self.stages.load;
        let command = |t: f64| {
            let row = time_s.partition_point(|&row_s| row_s + load.delay_s.value <= t);
            let f = if row == 0 { 0.0 } else { force_n[row - 1] };
            load.offset_n.value + f * if f < 0.0 { load.negative_factor.value } else { load.positive_factor.value }
        };
        let mut stops: Vec<f64> = time_s.iter().flat_map(|&t| [t, t + load.delay_s.value]).collect();
        stops.retain(|&t| t <= time_s[time_s.len() - 1]);
        stops.sort_by(f64::total_cmp);
        stops.dedup();
        let (mut y, mut rows) = ([0.0; 3], vec![0.0]);
        for pair in stops.windows(2) {
            let input_n = command(pair[0]);
            self.advance(pair[0], pair[1], input_n, &mut y);
            if time_s.contains(&pair[1]) {
                rows.push(self.acting(pair[1], input_n, y).1);
            }
        }
        rows
    }
}

#[test]
fn gradient_alone_and_everything_at_once_are_small_explicit_steps() {
    let (time_s, force_n) = record();
    for (gradient, delay_s, lag_s, rate) in [
        (0.8, 0.0, 0.0, 0.0),
        (-0.8, 0.0, 0.0, 0.0),
        (0.5, 0.0, 0.0, 0.1),
        (0.6, 0.0137, 0.05, 0.05),
        (-0.5, 0.3, 0.7, 0.0),
    ] {
        let mut stages = Stages::of_law(law(BaseLaw::Burgers));
        stages.load.gradient_per_m = dual(gradient);
        stages.load.delay_s = dual(delay_s);
        stages.load.lag_time_s = dual(lag_s);
        stages.load.offset_n = dual(0.03);
        stages.load.positive_factor = dual(1.05);
        stages.load.negative_factor = dual(0.9);
        stages.softening_rate_per_s = dual(rate);
        let exact = AllAtOnce { stages: &stages, start_s: time_s[0] }.run(&time_s, &force_n);
        let error = distance(&stepped(&stages, &time_s, &force_n), &exact);
        assert!(error < 2e-8, "{gradient} {delay_s} {lag_s} {rate}: {error:e}");
    }
}

/// Checks F = 1 e^{gx} on a spring with the position x = F/2. A balance exists up to the gradient g
/// = 2/e and for every negative gradient, and not beyond.
#[test]
fn a_gradient_is_refused_where_no_balance_is_left_and_only_there() {
    let (time_s, force_n) = ([0.0, 1.0, 2.0], [1.0; 3]);
    let mut stages = Stages::of_law(vec![spring(2.0)]);
    let largest = 2.0 / std::f64::consts::E;
    for (gradient, accepted) in
        [(0.999 * largest, true), (1.001 * largest, false), (2.0, false), (-5.0, true), (-80.0, true)]
    {
        stages.load.gradient_per_m = dual(gradient);
        let run = strains(1.0, &stages, &time_s, (&force_n).into(), Resolution::default());
        assert_eq!(run.is_ok(), accepted, "{gradient}");
        match run {
            Ok(found) => {
                let x = found[2];
                assert!((x - 0.5 * (gradient * x).exp()).abs() < 1e-13, "{gradient}: {x}");
                assert!(gradient * x < 1.0, "the balance that a small gradient leads to, not the one beyond");
            }
            Err(error) => assert!(error.to_string().contains("pulls the robot away"), "{error}"),
        }
    }
}

/// Compares with the closed form for a dashpot, e^{−gx} = 1 − g F t/c, at g x far from small.
#[test]
fn a_dashpot_under_a_strong_gradient_is_a_closed_form() {
    let time_s: Vec<f64> = (0..40).map(|i| 0.2 * f64::from(i)).collect();
    let mut stages = Stages::of_law(vec![dashpot(2.0)]);
    for gradient in [-60.0, -2.0, 0.2, 0.254] {
        stages.load.gradient_per_m = dual(gradient);
        let found = strains(1.0, &stages, &time_s, (&[1.0; 40]).into(), Resolution::default()).unwrap();
        let exact: Vec<f64> = time_s.iter().map(|t| -(-gradient * t / 2.0).ln_1p() / gradient).collect();
        let error = distance(&found, &exact);
        assert!(error < 1e-7, "{gradient}: {error:e}");
    }
    stages.load.gradient_per_m = dual(0.26);
    let refused = strains(1.0, &stages, &time_s, (&[1.0; 40]).into(), Resolution::default()).unwrap_err().to_string();
    // 1 − g F t/c vanishes at t = 2/0.26 = 7.69 s, within a step.
    let said = refused.split("pulls the robot away at ").nth(1).and_then(|rest| rest.split(' ').next());
    let at_s: f64 = said.and_then(|word| word.parse().ok()).unwrap_or(f64::NAN);
    assert!((5.0..8.0).contains(&at_s), "{refused}");
}

/// Checks that the error is small and has fifth order. There are few rows, so that the step rule
/// and not the rows sets the steps.
#[test]
fn the_error_falls_with_the_fifth_power_of_the_step() {
    let (time_s, force_n) = ([0.0, 6.0, 9.0, 14.0], [1.0, -1.0, 0.0, 0.0]);
    let [e, c1, c2, ..] = PARAMETERS;
    let lag_s = 0.13;
    let mut stages = Stages::of_law(law(BaseLaw::Lethersich));
    stages.load.lag_time_s = dual(lag_s);
    let body_s = c1 / e;
    let creep = |t: f64| {
        let body = (lag_s * (-t / lag_s).exp() - body_s * (-t / body_s).exp()) / (lag_s - body_s);
        (1.0 - body) / e + (t + lag_s * (-t / lag_s).exp_m1()) / c2
    };
    let exact = superposition(&time_s, &force_n, 0.0, creep);
    let error = |steps_per_doubling: u32| {
        let resolution = Resolution { steps_per_doubling };
        distance(&strains(1.0, &stages, &time_s, (&force_n).into(), resolution).expect("a sound model"), &exact)
    };
    let (coarse, fine) = (error(16), error(40));
    let growth = |k: f64| k.recip().exp2() - 1.0;
    let order = (coarse / fine).ln() / (growth(16.0) / growth(40.0)).ln();
    assert!(order > 4.5, "{order}");
    assert!(error(Resolution::default().steps_per_doubling) < 1e-8);
}

#[test]
fn the_recorded_position_is_scaled_and_drifts() {
    let approaches = vec![DriftApproach { amplitude_m: dual(2.0), time_s: dual(0.5) }];
    let observation =
        Observation { scale: dual(1.5), velocity_m_per_s: dual(0.1), approaches, ..Observation::IDENTITY };
    let exact = 1.5 * 4.0 + 0.1 * 3.0 + 2.0 * (1.0 - (-6.0_f64).exp());
    assert!((observation.of::<f64>().recorded_m(4.0, 3.0) - exact).abs() < 1e-14);
}
