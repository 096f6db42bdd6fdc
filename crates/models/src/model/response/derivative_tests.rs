//! Tests that compare the kernel's derivatives with difference quotients of its values.

use super::Response;
use super::numbers::Number;
use super::tests::{largest, record, respond_with, rich_law, spectrum};
use base::number::Dual;
use laws::rheology::RetardationSpectrum;
use laws::stages::{DriftApproach, Stages};
use record::ForceRule;

/// All inputs that a model may change, which are the numbers of the stages, the spectrum and the compliance.
#[derive(Clone)]
struct Point {
    stages: Stages,
    spectrum: RetardationSpectrum,
    compliance_per_m: Dual,
    rule: ForceRule,
}

type Field = (&'static str, fn(&mut Point) -> &mut Dual);

const FIELDS: &[Field] = &[
    ("delay", |p| &mut p.stages.load.delay_s),
    ("positive factor", |p| &mut p.stages.load.positive_factor),
    ("negative factor", |p| &mut p.stages.load.negative_factor),
    ("offset", |p| &mut p.stages.load.offset_n),
    ("lag", |p| &mut p.stages.load.lag_time_s),
    ("gradient", |p| &mut p.stages.load.gradient_per_m),
    ("softening", |p| &mut p.stages.softening_rate_per_s),
    ("scale", |p| &mut p.stages.observation.scale),
    ("position offset", |p| &mut p.stages.observation.offset_m),
    ("velocity", |p| &mut p.stages.observation.velocity_m_per_s),
    ("approach's amplitude", |p| &mut p.stages.observation.approaches[0].amplitude_m),
    ("approach's time", |p| &mut p.stages.observation.approaches[0].time_s),
    ("instantaneous compliance", |p| &mut p.spectrum.instantaneous_per_pa),
    ("fluidity", |p| &mut p.spectrum.fluidity_per_pa_s),
    ("first mode's compliance", |p| &mut p.spectrum.modes[0].compliance_per_pa),
    ("first mode's rate", |p| &mut p.spectrum.modes[0].rate_per_s),
    ("second mode's compliance", |p| &mut p.spectrum.modes[1].compliance_per_pa),
    ("second mode's rate", |p| &mut p.spectrum.modes[1].rate_per_s),
    ("compliance", |p| &mut p.compliance_per_m),
];
const OF_OSCILLATING_MODE: &[Field] = &[
    ("oscillating compliance", |p| &mut p.spectrum.oscillating[0].compliance_per_pa[0]),
    ("oscillating compliance, imaginary", |p| &mut p.spectrum.oscillating[0].compliance_per_pa[1]),
    ("oscillating rate", |p| &mut p.spectrum.oscillating[0].rate_per_s[0]),
    ("oscillating rate, imaginary", |p| &mut p.spectrum.oscillating[0].rate_per_s[1]),
];

impl Point {
    fn respond<S: Number>(&self) -> Vec<S> {
        respond_with(&self.stages, &self.spectrum, self.compliance_per_m, self.rule)
    }
}

/// Returns a point with effects of fixed sizes. Each bit of `choice` selects an effect.
fn point(choice: usize) -> Point {
    let on = |bit: usize, value: f64| Dual::constant(if choice & (1 << bit) != 0 { value } else { 0.0 });
    let mut stages = rich_law();
    stages.load.delay_s = on(0, 0.2371);
    stages.load.lag_time_s = on(1, 0.09);
    stages.softening_rate_per_s = on(2, 0.12);
    stages.load.gradient_per_m = on(3, -350.0);
    stages.load.offset_n = on(4, 3e-7);
    let amplitude_m = on(4, 1e-4);
    stages.observation.approaches.push(DriftApproach { amplitude_m, time_s: Dual::constant(0.8) });
    let spectrum = spectrum(&stages, choice & 32 != 0);
    Point { stages, spectrum, compliance_per_m: Dual::constant(549.0), rule: ForceRule::Hold }
}

/// Derivative by forward differences with steps h, h/2, h/4, extrapolated twice. It is one-sided, so it also exists at a null on
/// the boundary of a support.
fn difference(at: impl Fn(f64) -> Vec<f64>, h: f64) -> Vec<f64> {
    let base = at(0.0);
    let slope = |h: f64| -> Vec<f64> { at(h).iter().zip(&base).map(|(x, x0)| (x - x0) / h).collect() };
    let combine = |fine: &[f64], coarse: &[f64], order: f64| -> Vec<f64> {
        fine.iter().zip(coarse).map(|(f, c)| (order * f - c) / (order - 1.0)).collect()
    };
    let [first, second, third] = [h, h / 2.0, h / 4.0].map(slope);
    combine(&combine(&third, &second, 2.0), &combine(&second, &first, 2.0), 4.0)
}

/// Typical size of the named quantity. It scales the difference step if the quantity is at its null.
fn natural_size(name: &str) -> f64 {
    match name {
        "offset" => 1e-6,
        "gradient" => 100.0,
        "softening" => 0.1,
        "velocity" | "approach's amplitude" | "position offset" => 1e-4,
        _ => 0.1,
    }
}

/// Checks the derivative by every quantity: without effects, with each effect, with all effects, and with an oscillating mode. Truncation
/// and rounding of the differences stay below 1e-6 of the largest derivative. Another test covers a lag at its null.
#[test]
fn equal_one_sided_differences_in_every_direction() {
    let held = [0, 1, 2, 4, 8, 16, 9, 12, 32, 63].map(|choice| (choice, ForceRule::Hold));
    let linear = [0, 1, 2, 4, 8, 16, 9, 32, 63].map(|choice| (choice, ForceRule::Linear));
    for (choice, rule) in held.into_iter().chain(linear) {
        let base = Point { rule, ..point(choice) };
        let oscillating: &[Field] = if choice & 32 != 0 { OF_OSCILLATING_MODE } else { &[] };
        for (name, field) in FIELDS.iter().chain(oscillating) {
            let value = field(&mut base.clone()).value;
            if *name == "lag" && value == 0.0 {
                continue;
            }
            let mut moving = base.clone();
            field(&mut moving).derivative = 1.0;
            let found: Vec<Dual> = moving.respond();
            let size = if value == 0.0 { natural_size(name) } else { value.abs() };
            let at = |shift: f64| {
                let mut shifted = base.clone();
                *field(&mut shifted) = Dual::constant(value + shift);
                shifted.respond::<f64>()
            };
            let expected = difference(at, 2e-4 * size);
            let amplitude = largest(&expected);
            for (row, (found, expected)) in found.iter().zip(&expected).enumerate() {
                let error = (found.derivative - expected).abs();
                assert!(
                    error <= 1e-6 * amplitude,
                    "{choice:06b}, {name}, row {row}: {} against {expected}, amplitude {amplitude:e}",
                    found.derivative
                );
            }
            let values: Vec<f64> = base.respond();
            for (dual, plain) in found.iter().zip(&values) {
                assert!((dual.value - plain).abs() <= 1e-8 * largest(&values), "{choice:06b}, {name}");
            }
        }
    }
}

/// Checks an indenter's depth x^{1/p}, with x the linear response and p the depth exponent. Also checks its derivative by the chain rule,
/// and that every lane has equal bits. The depth is 0 while no force presses the tip.
#[test]
fn depths_are_roots_of_what_answers_linearly() {
    let (time_s, _) = record();
    let pressing_n: Vec<f64> = time_s.iter().map(|t| 1e-6 * (1.0 + t)).collect();
    let response = Response::new(&time_s, &pressing_n, time_s.len());
    let law = [3.5, 1.4, 47.0].map(Dual::constant);
    let linear = Stages::of_law(laws::rheology::BaseLaw::Lethersich.elements(&law));
    let moving = response.derivative_m(&linear, Dual::variable(549.0)).expect("sound");
    for exponent in [1.5, 2.0] {
        let mut stages = linear.clone();
        (stages.observation.depth_exponent, stages.observation.offset_m) =
            (Dual::constant(exponent), Dual::constant(2e-6));
        let found = response.derivative_m(&stages, Dual::variable(549.0)).expect("sound");
        for (row, (found, x)) in found.iter().zip(&moving).enumerate().skip(1) {
            let (depth_m, slope) = (x.value.powf(1.0 / exponent), x.value.powf(1.0 / exponent - 1.0) / exponent);
            assert!((found.value - 2e-6 - depth_m).abs() < 1e-14 * depth_m.max(1e-6), "{exponent}, row {row}");
            assert!((found.derivative / (slope * x.derivative) - 1.0).abs() < 1e-12, "{exponent}, row {row}");
        }
        let plain = response.trajectory_m(&stages, 549.0).expect("sound");
        let (three, mut lanes) = ([stages.clone(), linear.clone(), stages.clone()], Vec::new());
        assert_eq!(response.trajectories_m(&three, &[549.0; 3], &mut lanes)[..3], [true; 3]);
        assert!(lanes.iter().zip(&plain).all(|(lanes, x)| [lanes.0[0], lanes.0[2]] == [*x; 2]));
        let pulling_n: Vec<f64> = pressing_n.iter().map(|force| -force).collect();
        let pulled = Response::new(&time_s, &pulling_n, time_s.len()).trajectory_m(&stages, 549.0).expect("sound");
        assert!(pulled.iter().all(|x| *x == 2e-6));
    }
}

#[test]
fn the_derivative_by_a_lag_that_is_not_there_is_refused() {
    let (time_s, force_n) = record();
    let mut stages = rich_law();
    stages.load.lag_time_s = Dual::variable(0.0);
    let response = Response::new(&time_s, &force_n, time_s.len());
    let error = response.derivative_m(&stages, Dual::constant(549.0)).expect_err("refused").to_string();
    assert!(error.contains("lag"), "{error}");
    stages.load.lag_time_s = Dual::variable(0.1);
    let dual = response.derivative_m(&stages, Dual::constant(549.0)).expect("sound");
    let plain = response.trajectory_m(&stages, 549.0).expect("sound");
    assert!(dual.iter().zip(&plain).all(|(dual, plain)| dual.value == *plain));
    assert!(dual.iter().any(|dual| dual.derivative != 0.0));
}
