//! Tests of quantities that depend on a state. They compare the excess position with closed forms and with the full-order model's stepping.
//! The stepping is an independent method, since it does not use a pseudo-stress.

use super::Response;
use base::number::{Dual, Scalar};
use elements::fe::stepping::Resolution;
use elements::fe::stepping::run::strains_and_positions;
use laws::rheology::{BaseLaw, Network};
use laws::stages::{Function, Operation, Quantity, Stages, State, StateFunction, StateLaw};
use record::{Force, ForceRule};

const COMPLIANCE_PER_M: f64 = 550.0;

/// Function 1 + a tanh(s/s₀) of the state s, with parameters a and s₀. It is smooth, and bounded if the state diverges.
#[derive(Debug)]
struct Bounded;

impl StateFunction for Bounded {
    fn value(&self, state: Dual, parameters: &[Dual]) -> Dual {
        let x = state / parameters[1];
        let tanh = x.value.tanh();
        Dual::ONE + parameters[0] * Dual { value: tanh, derivative: (1.0 - tanh * tanh) * x.derivative }
    }
}

/// Function e^{a s} of the state s, with the parameter a.
#[derive(Debug)]
struct Exponential;

impl StateFunction for Exponential {
    fn value(&self, state: Dual, parameters: &[Dual]) -> Dual {
        (parameters[0] * state).exp()
    }
}

/// Returns times (s) and forces (N) at irregular rows, with holds of both signs and a rest.
fn record() -> (Vec<f64>, Vec<f64>) {
    let (mut time_s, mut force_n, mut t) = (Vec::new(), Vec::new(), 0.0);
    for row in 0..160_u32 {
        time_s.push(t);
        t += 0.03 + 0.02 * f64::from(row % 3);
        force_n.push(match row {
            0..50 => 4.6e-6,
            50..100 => -4.6e-6,
            100..120 => 0.0,
            _ => 2.3e-6,
        });
    }
    (time_s, force_n)
}

fn bounded(base: BaseLaw, parameters: &[f64], quantity: &str, state: State, size: f64) -> Stages {
    let values: Vec<Dual> = parameters.iter().map(|value| Dual::constant(*value)).collect();
    let scale = match state.unit() {
        "m" => 5e-4,
        "s" => 2.0,
        // This scale keeps forces that grow with the velocity from diverging.
        "m/s" => 2.5e-3,
        _ => 4e-6,
    };
    let quantity = match quantity {
        "force" => Quantity::Force,
        "position" => Quantity::Position,
        name => Quantity::Element(base.leaf(name).expect("an element")),
    };
    let law = StateLaw {
        quantity,
        state,
        operation: Operation::Multiply,
        function: Function(&Bounded),
        parameters: vec![Dual::constant(size), Dual::constant(scale)],
    };
    Stages { base: Some(base), state_law: Some(law), ..Stages::of_law(base.elements(&values)) }
}

fn full_m(stages: &Stages, time_s: &[f64], force: Force<'_>, steps_per_doubling: u32) -> Vec<f64> {
    let resolution = Resolution { steps_per_doubling };
    let found = strains_and_positions(COMPLIANCE_PER_M, stages, time_s, force, resolution).expect("a sound model");
    found
        .iter()
        .zip(time_s)
        .map(|(answer, t)| stages.observation.of::<f64>().recorded_m(answer[1], t - time_s[0]))
        .collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    let size = b.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    a.iter().zip(b).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs())) / size
}

const LETHERSICH: [f64; 3] = [3.527, 1.402, 47.37];

fn springpot_law() -> BaseLaw {
    let text = "series = [{ parallel = [{ spring = \"gel\" }, { springpot = \"mesh\" }] }, { dashpot = \"flow\" }]";
    BaseLaw::Network(Network::from_text("law.toml".as_ref(), text).expect("a law"))
}

/// Compares reduced and full-order positions for every quantity of the base law with every allowed state. The forces are constant
/// or linear between rows.
#[test]
fn reduced_and_full_agree() {
    let (time_s, force_n) = record();
    let (mut worst, mut n_cases) = ([0.0_f64; 2], 0);
    for rule in [ForceRule::Hold, ForceRule::Linear] {
        let force = Force { at_rows_n: &force_n, rule };
        let response = Response::new(&time_s, force, time_s.len());
        for quantity in ["force", "position", "young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s"] {
            for state in State::ALL {
                let name = state.name();
                if state == State::Strain && !quantity.ends_with("pa") && !quantity.ends_with("pa_s") {
                    continue;
                }
                let stages = bounded(BaseLaw::Lethersich, &LETHERSICH, quantity, state, 0.4);
                let found = response.trajectory_m(&stages, COMPLIANCE_PER_M).expect("a sound model");
                let error = distance(&found, &full_m(&stages, &time_s, force, 24));
                println!("{rule:?} {quantity} of {name}: {error:.1e}");
                let value = &mut worst[usize::from(force.is_linear())];
                *value = value.max(error);
                n_cases += 1;
            }
        }
    }
    // Under linear forces the robot reverses its direction between rows. The path, the excursion and the sign of the force have
    // kinks there.
    assert!(worst[0] < 1e-8 && worst[1] < 5e-5 && n_cases == 76, "{worst:?} {n_cases}");
}

/// Compares both models for laws with springpots, with a body of several elements and with an instantaneous response.
#[test]
fn reduced_and_full_agree_for_springpots() {
    let (time_s, force_n) = record();
    let force = Force::from(&force_n);
    let response = Response::new(&time_s, force, time_s.len());
    let lone = BaseLaw::Network(Network::from_text("law.toml".as_ref(), "springpot = \"mesh\"").expect("a law"));
    let cases: [(BaseLaw, &[f64], &str); 5] = [
        (springpot_law(), &[3.5, 1.4, 0.6, 47.0], "gel_modulus_pa"),
        (springpot_law(), &[3.5, 1.4, 0.6, 47.0], "mesh_modulus_pa"),
        (springpot_law(), &[3.5, 1.4, 0.6, 47.0], "flow_viscosity_pa_s"),
        (lone, &[3.5, 0.5], "mesh_modulus_pa"),
        (BaseLaw::Burgers, &[3.527, 1.402, 47.37, 20.0], "instantaneous_modulus_pa"),
    ];
    let mut worst = 0.0_f64;
    for (law, parameters, quantity) in cases {
        for state in [State::Position, State::Path, State::Time, State::LargestExcursion, State::Strain] {
            let stages = bounded(law, parameters, quantity, state, 0.4);
            let found = response.trajectory_m(&stages, COMPLIANCE_PER_M).expect("a sound model");
            let error = distance(&found, &full_m(&stages, &time_s, force, 16));
            println!("{} {quantity} of {}: {error:.1e}", law.title(), state.name());
            worst = worst.max(error);
        }
    }
    assert!(worst < 5e-6, "{worst}");
}

/// Compares exact derivatives by the parameters of the law and of the function with central differences.
#[test]
fn sensitivities_equal_differences() {
    let (time_s, force_n) = record();
    let response = Response::new(&time_s, &force_n, time_s.len());
    for (quantity, state) in
        [("young_modulus_pa", State::Path), ("viscosity_2_pa_s", State::Velocity), ("force", State::Position)]
    {
        let at = |moved: usize, h: f64, seed: bool| {
            let mut law = LETHERSICH.map(Dual::constant);
            let mut stages = bounded(BaseLaw::Lethersich, &LETHERSICH, quantity, state, 0.4);
            let state_law = stages.state_law.as_mut().expect("a state law");
            let target = if moved < 3 { &mut law[moved] } else { &mut state_law.parameters[moved - 3] };
            *target = Dual { value: target.value * (1.0 + h), derivative: if seed { target.value } else { 0.0 } };
            Stages { law: BaseLaw::Lethersich.elements(&law), ..stages }
        };
        for moved in 0..5 {
            let found = response.derivative_m(&at(moved, 0.0, true), Dual::constant(COMPLIANCE_PER_M)).expect("sound");
            let value = |h: f64| response.trajectory_m(&at(moved, h, false), COMPLIANCE_PER_M).expect("sound");
            let h = 1e-4;
            let difference: Vec<f64> = value(h).iter().zip(value(-h)).map(|(a, b)| (a - b) / (2.0 * h)).collect();
            let derivative: Vec<f64> = found.iter().map(|x| x.derivative).collect();
            let error = distance(&derivative, &difference);
            assert!(error < 1e-5, "{quantity} of {} by {moved}: {error}", state.name());
        }
    }
}

/// Checks that `by_function_m` and dual numbers give equal derivatives by the function's parameters, for every quantity and state.
#[test]
fn followed_slopes_are_those_that_numbers_carry() {
    let (time_s, force_n) = record();
    let mut n_cases = 0;
    for rule in [ForceRule::Hold, ForceRule::Linear] {
        let response = Response::new(&time_s, Force { at_rows_n: &force_n, rule }, time_s.len());
        for (base, parameters, quantity) in [
            (BaseLaw::Lethersich, &LETHERSICH[..], "force"),
            (BaseLaw::Lethersich, &LETHERSICH, "position"),
            (BaseLaw::Lethersich, &LETHERSICH, "young_modulus_pa"),
            (BaseLaw::Lethersich, &LETHERSICH, "viscosity_2_pa_s"),
            (springpot_law(), &[3.5, 1.4, 0.6, 47.0], "mesh_modulus_pa"),
            (BaseLaw::Burgers, &[3.527, 1.402, 47.37, 20.0], "instantaneous_modulus_pa"),
        ] {
            for state in State::ALL {
                let name = state.name();
                if state == State::Strain && !quantity.contains("pa") {
                    continue;
                }
                let stages = bounded(base, parameters, quantity, state, 0.4);
                // If the position diverges, neither derivative exists.
                let Ok(found) = response.by_function_m(&stages, COMPLIANCE_PER_M) else { continue };
                n_cases += found.len();
                for (place, found) in found.iter().enumerate() {
                    let mut moving = stages.clone();
                    moving.state_law.as_mut().expect("a state law").parameters[place].derivative = 1.0;
                    let expected = response.derivative_m(&moving, Dual::constant(COMPLIANCE_PER_M)).expect("sound");
                    let expected: Vec<f64> = expected.iter().map(|x| x.derivative).collect();
                    let error = distance(found, &expected);
                    assert!(error < 1e-9, "{rule:?} {quantity} of {name} by {place}: {error}");
                }
            }
        }
    }
    assert!(n_cases > 170, "{n_cases}");
}

/// Checks a dashpot whose viscosity c e^{b x} grows with the position x under a constant force F. Its closed form is e^{bx} = 1 + b C F
/// t/c, with C the displacement per force at unit creep compliance. A dashpot whose force decreases with the path has an equivalent closed
/// form.
#[test]
fn a_dashpot_that_hardens_has_a_closed_form() {
    let base = BaseLaw::Network(Network::from_text("law.toml".as_ref(), "dashpot = \"flow\"").expect("a law"));
    let time_s: Vec<f64> = (0..100).map(|row| 0.1 * f64::from(row)).collect();
    let force_n = vec![4e-6; 100];
    let response = Response::new(&time_s, &force_n, 100);
    let (viscosity, growth_per_m) = (40.0, 8e3);
    for (quantity, state, sign) in [
        (Quantity::Element(base.leaf("flow_viscosity_pa_s").expect("it")), State::Position, 1.0),
        (Quantity::Force, State::Path, -1.0),
    ] {
        let parameters = vec![Dual::constant(sign * growth_per_m)];
        let law =
            StateLaw { quantity, state, operation: Operation::Multiply, function: Function(&Exponential), parameters };
        let elements = base.elements(&[Dual::constant(viscosity)]);
        let stages = Stages { base: Some(base), state_law: Some(law), ..Stages::of_law(elements) };
        let found = response.trajectory_m(&stages, COMPLIANCE_PER_M).expect("a sound model");
        let exact: Vec<f64> = time_s
            .iter()
            .map(|t| (growth_per_m * COMPLIANCE_PER_M * 4e-6 * t / viscosity).ln_1p() / growth_per_m)
            .collect();
        assert!(distance(&found, &exact) < 1e-9, "{}", distance(&found, &exact));
    }
}

/// Checks that a function equal to 1 as a factor, or to 0 as a summand, changes no bit of the position.
#[test]
fn at_the_null_the_base_returns() {
    let (time_s, force_n) = record();
    let response = Response::new(&time_s, &force_n, time_s.len());
    let base = Stages::of_law(BaseLaw::Lethersich.elements(&LETHERSICH.map(Dual::constant)));
    let expected = response.trajectory_m(&base, COMPLIANCE_PER_M).expect("a sound model");
    for quantity in ["force", "position", "young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s"] {
        let stages = bounded(BaseLaw::Lethersich, &LETHERSICH, quantity, State::Path, 0.0);
        assert_eq!(response.trajectory_m(&stages, COMPLIANCE_PER_M).expect("a sound model"), expected, "{quantity}");
    }
}
