//! Properties of every effect in the kernels. At its null the base returns. The reduced model agrees with full finite elements, which
//! use another stepping method. Sensitivities agree with finite differences. Every pair gives finite positions.

use std::sync::{Arc, OnceLock};

use crate::conformance::PORCINE;
use vitreo_uq::base::error::{Error, InputPlace, Setting};
use vitreo_uq::base::number::Dual;
use vitreo_uq::elements::fe::Stiffness;
use vitreo_uq::elements::fe::spatial::{GelAndRobot, PhysicalProperties};
use vitreo_uq::elements::fe::time::FullOrderModel;
use vitreo_uq::elements::mesh::{Mesh, QuarterBall};
use vitreo_uq::laws::rheology::{BaseLaw, CreepCompliance, Element, Network, complex_modulus_pa};
use vitreo_uq::laws::stages::SharedStepper;
use vitreo_uq::models::effects::{EFFECTS, Effect, EffectParameter, FieldEffect, Stage};
use vitreo_uq::models::model::{
    Compliance, Forward, FullOrderForward, Model, Response, SurrogateForward, TrainedRange, convolve_m,
};
use vitreo_uq::models::surrogate::trajectory::{LargeScope, LargeStepper, LargeSurface, MobilityRange};
use vitreo_uq::models::surrogate::{FieldModels, Surrogate, Training};
use vitreo_uq::record::{CharacteristicSizes, Force, ForceRule};

const POISSON_RATIO: f64 = 0.48;
/// E, c₁, c₂, then the additional parameters of Burgers and of the two-element law.
const LETHERSICH: [f64; 3] = [3.527, 1.402, 47.370];

/// Irregular rows, several force levels, holds of two to three seconds.
struct Protocol {
    time_s: Vec<f64>,
    force_n: Vec<f64>,
    rule: ForceRule,
    scales: CharacteristicSizes,
}

impl Protocol {
    fn force(&self) -> Force<'_> {
        Force { at_rows_n: &self.force_n, rule: self.rule }
    }
}

fn protocol() -> Protocol {
    let time_s: Vec<f64> = (0..160).map(|i| 0.08 * f64::from(i) + if i % 3 == 1 { 0.03 } else { 0.0 }).collect();
    let force_n: Vec<f64> = (0..160).map(|i| [4.6e-6, -4.6e-6, 2e-6, 0.0, -3e-6][(i / 33) % 5]).collect();
    let scales = CharacteristicSizes {
        position_range_m: 1e-3,
        hold_s: 2.64,
        sample_interval_s: 0.08,
        cycle_s: 6.4,
        duration_s: 12.8,
        ..PORCINE
    };
    Protocol { time_s, force_n, rule: ForceRule::Hold, scales }
}

/// A piecewise linear force. It jumps at the first row, swings, bends sharply, holds, and has a row at each zero crossing.
fn lines() -> Protocol {
    let mut made = Protocol { time_s: Vec::new(), force_n: Vec::new(), rule: ForceRule::Linear, ..protocol() };
    for i in 0..64 {
        let t = 0.2 * f64::from(i) + if i % 3 == 1 { 0.07 } else { 0.0 };
        let force_n = 4.6e-6
            * match i {
                0..32 => (0.4 + 1.9 * t).cos(),
                32..48 => 0.5 - 0.1 * f64::from((i - 40_i32).abs()),
                _ => -0.7,
            };
        if let (Some(&before_s), Some(&before_n)) = (made.time_s.last(), made.force_n.last())
            && before_n * force_n < 0.0
        {
            made.time_s.push(before_s + (t - before_s) * before_n / (before_n - force_n));
            made.force_n.push(0.0);
        }
        made.time_s.push(t);
        made.force_n.push(force_n);
    }
    made
}

/// A coarse mesh suffices, because the comparison concerns time, not space.
const BALL: QuarterBall = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 1, n_layers: 6 };

/// A still coarser mesh for nonlinear laws, whose full-order runs solve thousands of balances.
const COARSER_BALL: QuarterBall = QuarterBall { n_per_edge: 1, n_layers: 4, ..BALL };

fn stiffness() -> &'static Stiffness {
    surroundings(false).stiffness
}

/// The gel on the mesh for linear or nonlinear effects.
fn surroundings(is_nonlinear: bool) -> GelAndRobot<'static> {
    static MESHES: [OnceLock<(Mesh, Stiffness)>; 2] = [const { OnceLock::new() }; 2];
    let ball = if is_nonlinear { COARSER_BALL } else { BALL };
    let (mesh, stiffness) = MESHES[usize::from(is_nonlinear)].get_or_init(|| {
        let mesh = ball.mesh().expect("sizes are good");
        let stiffness = Stiffness::new(&mesh).expect("the mesh is good");
        (mesh, stiffness)
    });
    let robot_mass_kg = 7500.0 * 4.0 / 3.0 * std::f64::consts::PI * ball.robot_radius_m.powi(3);
    GelAndRobot {
        mesh,
        stiffness,
        poisson_ratio: POISSON_RATIO,
        sizes: PhysicalProperties {
            gel_density_kg_m3: 1000.0,
            robot_mass_kg,
            robot_radius_m: ball.robot_radius_m,
            outer_radius_m: ball.outer_radius_m,
            // Around a sphere a thinning law would bring its own mesh, with another compliance.
            ball: (!is_nonlinear).then_some(ball),
        },
    }
}

fn fields(is_nonlinear: bool) -> &'static FieldModels {
    static FIELDS: [OnceLock<FieldModels>; 2] = [const { OnceLock::new() }; 2];
    let alike = EFFECTS.iter().copied().filter(|effect| effect.is_nonlinear() == is_nonlinear);
    let build_one = |effect| FieldModels::build(effect, &surroundings(is_nonlinear), &|| ()).expect("the mesh is good");
    let build = || alike.fold(FieldModels::default(), |fields, effect| fields.merged_with(build_one(effect)));
    FIELDS[usize::from(is_nonlinear)].get_or_init(build)
}

fn is_large(model: &Model) -> bool {
    matches!(model.field(), Some((_, FieldEffect::Large)))
}

/// Large displacements learned in the protocol of holds; only holds are supported.
fn large_stepper() -> SharedStepper {
    static LEARNT: OnceLock<SharedStepper> = OnceLock::new();
    let learn = || {
        let protocol = protocol();
        let law = BaseLaw::Lethersich.elements(&LETHERSICH.map(Dual::constant));
        let radii_m = [BALL.robot_radius_m, BALL.outer_radius_m];
        let learnt = LargeSurface::learn(
            radii_m,
            (&law, LargeScope { mobilities: MobilityRange::OLDROYD_B, with_load: true }),
            &protocol.time_s,
            protocol.force(),
            &|| (),
        )
        .expect("learns");
        SharedStepper(Arc::new(LargeStepper::new(learnt, &protocol.time_s, protocol.force()).expect("a basis")))
    };
    LEARNT.get_or_init(learn).clone()
}

/// Returns `true` if full runs are so slow that a coarser mesh is needed.
fn is_slow(model: &Model) -> bool {
    is_nonlinear(model) && !is_large(model)
}

fn is_nonlinear(model: &Model) -> bool {
    model.effects().iter().any(|effect| effect.is_nonlinear())
}

/// Compliance: the reduced family over the priors' Poisson ratios; for nonlinear laws at the experiment's ratio.
fn compliance(model: &Model, protocol: &Protocol) -> Compliance {
    if is_slow(model) {
        let coarser = FullOrderModel::new(surroundings(true).stiffness, POISSON_RATIO).expect("positive definite");
        return Compliance::fixed(coarser.compliance_per_m()).with_spread(|stages| fields(true).spread(stages));
    }
    static SURROGATE: OnceLock<Surrogate> = OnceLock::new();
    let surrogate = SURROGATE.get_or_init(|| {
        let range = |p: &vitreo_uq::base::parameter::ParameterSpec| TrainedRange {
            name: p.name.into(),
            lower: 1.0,
            upper: 9.0,
        };
        let parameters: Vec<TrainedRange> = BaseLaw::Lethersich.parameters().iter().map(range).collect();
        let training = Training {
            law: BaseLaw::Lethersich,
            parameters: &parameters,
            poisson_ratio: [0.3, 0.499],
            time_s: &protocol.time_s,
            force: protocol.force(),
            tolerance: 1e-8,
        };
        Surrogate::train(stiffness(), &training).expect("training succeeds")
    });
    let compliance = surrogate.compliance(POISSON_RATIO).expect("inside the range");
    compliance.with_spread(|stages| fields(false).spread(stages)).with_trained(|| Some(large_stepper()))
}

fn model(effects: &[&'static dyn Effect], scales: CharacteristicSizes) -> Result<Model, Error> {
    Model::new(BaseLaw::Lethersich, effects.to_vec(), scales, &InputPlace::setting(Setting::Effects))
}

fn reduced<'a>(model: &'a Model, protocol: &Protocol) -> SurrogateForward<'a> {
    let response = Response::new(&protocol.time_s, protocol.force(), protocol.time_s.len());
    SurrogateForward { model, compliance: compliance(model, protocol), response, trained: &[] }
}

fn full<'a>(model: &'a Model, protocol: &'a Protocol) -> FullOrderForward<'a> {
    let surroundings = surroundings(is_slow(model));
    let at_ratio = FullOrderModel::new(surroundings.stiffness, POISSON_RATIO).expect("positive definite");
    FullOrderForward::new(model, surroundings.stiffness, at_ratio, &protocol.time_s, protocol.force())
        .in_surroundings(surroundings)
}

/// The law's parameters, then each effect's at a quantile of its prior. Optional parameters are at their null.
fn parameters_at(model: &Model, probability: impl Fn(usize) -> f64) -> Vec<f64> {
    let of_effects = model.effects().iter().flat_map(|effect| effect.parameters());
    let held = |p: &EffectParameter| (p.null)(model.scales()).filter(|_| p.spec.is_optional);
    let values = of_effects
        .enumerate()
        .map(|(i, p)| held(p).unwrap_or_else(|| (p.prior)(model.scales()).quantile(probability(i))));
    LETHERSICH.into_iter().chain(values).collect()
}

/// The law's parameters with the effects at their nulls. Unidentified parameters are at their prior's median.
fn null_of(model: &Model) -> Vec<f64> {
    let of_effects = model.effects().iter().flat_map(|effect| effect.parameters());
    let scales = model.scales();
    let values = of_effects.map(|p| (p.null)(scales).unwrap_or_else(|| (p.prior)(scales).quantile(0.5)));
    LETHERSICH.into_iter().chain(values).collect()
}

fn amplitude(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |a: f64, x| a.max(x.abs()))
}

/// Largest difference relative to the amplitude of the second.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |d: f64, (a, b)| d.max((a - b).abs())) / amplitude(b)
}

/// Every effect alone and every allowed pair.
fn models(scales: CharacteristicSizes) -> Vec<Model> {
    let mut list: Vec<Model> = EFFECTS.iter().copied().filter_map(|effect| model(&[effect], scales).ok()).collect();
    for (i, first) in EFFECTS.iter().enumerate() {
        list.extend(EFFECTS[i + 1..].iter().filter_map(|second| model(&[*first, *second], scales).ok()));
    }
    list
}

#[test]
fn at_the_null_the_base_returns() {
    let protocol = protocol();
    let law = CreepCompliance::lethersich(&LETHERSICH);
    let models = models(protocol.scales);
    // All are allowed alone. These pairs are refused: two effects that change the field; solved fields beside `softening` and
    // `fractional-damping`; mass beside `instantaneous-elasticity`; nonlinear laws beside that and `second-retardation`; large displacements beside the force's gradient.
    let n_fields = EFFECTS.iter().copied().filter(|effect| effect.changes_field()).count();
    let n_solved = EFFECTS.iter().copied().filter(|effect| effect.field().is_some()).count();
    let n_nonlinear = EFFECTS.iter().copied().filter(|effect| effect.is_nonlinear()).count();
    let n_refused = n_fields * (n_fields - 1) / 2 + 2 * n_solved + 1 + 2 * n_nonlinear + 1;
    assert_eq!(models.len(), EFFECTS.len() * (EFFECTS.len() + 1) / 2 - n_refused);
    for model in &models {
        let compliance_per_m = compliance(model, &protocol).experiment_per_m();
        let base = convolve_m(compliance_per_m, &law, &protocol.time_s, protocol.force());
        let found = reduced(model, &protocol).trajectory_m(&null_of(model)).expect("the base is a model");
        assert!(distance(&found, &base) < 1e-12, "{model:?}: {:e}", distance(&found, &base));
    }
}

/// The full-order model steps effects by Radau's method on the network of elements, and the reduced one has closed forms: both follow from the stages
/// alone. Errors of the step: 1e-7, with springpots 1e-6; of the modes over Poisson ratios: 1e-7.
/// Nonlinear laws take seconds per run and are tested at one point. Large displacements have their own comparisons with full runs and are in the long test.
#[test]
fn the_reduced_model_agrees_with_full_finite_elements() {
    assert_agreement(&protocol(), &[0.15, 0.4, 0.8], |model| !is_nonlinear(model));
    assert_agreement(&protocol(), &[0.4], is_slow);
}

/// Comparison under a piecewise linear force, a sine sampled too coarsely to be held. One point of the prior suffices, because only the force is new.
#[test]
#[ignore = "thorough"]
fn the_reduced_model_agrees_with_full_finite_elements_under_lines() {
    assert_agreement(&lines(), &[0.4], |model| !is_nonlinear(model));
}

/// Large displacements are learned for holds only.
#[test]
#[ignore = "campaigns/long-tests"]
fn laws_that_are_not_linear_agree_with_full_finite_elements() {
    assert_agreement(&protocol(), &[0.15, 0.4, 0.8], is_nonlinear);
    assert_agreement(&lines(), &[0.4], is_slow);
}

fn assert_agreement(protocol: &Protocol, probabilities: &[f64], is_asked: fn(&Model) -> bool) {
    for &effect in EFFECTS {
        let model = model(&[effect], protocol.scales).expect("an effect alone is a model");
        if !is_asked(&model) {
            continue;
        }
        let (reduced, full) = (reduced(&model, protocol), full(&model, protocol));
        let mut largest = 0.0_f64;
        for &probability in probabilities {
            let parameters = parameters_at(&model, |i| if i % 2 == 0 { probability } else { 1.0 - probability });
            let full_m = full.trajectory_m(&parameters).expect("a model");
            largest = largest.max(distance(&reduced.trajectory_m(&parameters).expect("a model"), &full_m));
            // The effect is not zero.
            let null_m = reduced.trajectory_m(&null_of(&model)).expect("a model");
            assert!(distance(&full_m, &null_m) > 1e-4, "{}: {:e}", effect.slug(), distance(&full_m, &null_m));
        }
        println!("{:<26} reduced against full: {largest:.1e} of the amplitude", effect.slug());
        assert!(largest < tolerance(&model, 1e-6), "{}: {largest:e}", effect.slug());
    }
}

/// Tolerance of the reduced model relative to the amplitude. Fields are reduced to 1e-4. Pockets have another mesh than the base, and pore flow has its own
/// undrained limit; on this coarse mesh they cause 4e-4 and 8e-4. Nonlinear laws are reduced to 1e-3. The action of a load on large displacements is
/// first order in the load.
fn tolerance(model: &Model, of_time: f64) -> f64 {
    if is_large(model) && model.effects().iter().any(|effect| effect.stage() == Stage::Load) {
        return 3e-3;
    }
    if is_nonlinear(model) {
        return 1e-3;
    }
    match model.field() {
        Some((_, FieldEffect::Pair(pair))) if pair.shape().is_some() => 1e-3,
        Some((_, FieldEffect::Pores(_))) => 1e-3,
        Some(_) => 1e-4,
        None => of_time,
    }
}

/// Asserts that pairs, with each effect inside its prior, are finite in both models and agree within 2e-6.
fn assert_same_in_both_models(is_asked: fn(usize, &Model) -> bool) {
    let protocol = protocol();
    let distance_of = |(number, model): (usize, &Model)| {
        let golden = |i: usize| 0.2 + 0.6 * (0.618_034 * (number + 3 * i) as f64).fract();
        let parameters = parameters_at(model, golden);
        let reduced_m = reduced(model, &protocol).trajectory_m(&parameters)?;
        Ok(distance(&reduced_m, &full(model, &protocol).trajectory_m(&parameters)?))
    };
    let models = models(protocol.scales);
    for (number, model) in models.iter().enumerate().filter(|(number, model)| is_asked(*number, model)) {
        let found = distance_of((number, model)).unwrap_or_else(|error: Error| panic!("{model:?}: {error}"));
        assert!(found < tolerance(model, 2e-6), "{model:?}: {found:e}");
    }
}

/// Every twentieth pair with linear laws. Single effects are tested above, and all pairs apply the stages in the same order (conformance.rs).
#[test]
#[ignore = "thorough"]
fn pairs_are_finite_and_the_same_in_both_models() {
    assert_same_in_both_models(|number, model| number.is_multiple_of(20) && !is_nonlinear(model));
}

#[test]
#[ignore = "campaigns/long-tests"]
fn every_pair_is_finite_and_the_same_in_both_models() {
    assert_same_in_both_models(|_, _| true);
}

/// Derivatives with respect to every parameter against central differences inside the prior. At the null they are compared with one-sided ones, with Richardson's
/// extrapolation. Differences with a step of 1e-4 of the prior's spread have errors of about 1e-7 of the column.
#[test]
fn sensitivities_agree_with_finite_differences() {
    let protocol = protocol();
    for &effect in EFFECTS {
        let model = model(&[effect], protocol.scales).expect("an effect alone is a model");
        let forward = reduced(&model, &protocol);
        let n_law = LETHERSICH.len();
        for index in 0..model.parameters().len() {
            let effect_parameter = index.checked_sub(n_law).map(|i| &effect.parameters()[i]);
            if effect_parameter.is_some_and(|effect_parameter| effect_parameter.spec.is_optional) {
                continue;
            }
            let spread = effect_parameter.map_or(0.1 * LETHERSICH[index.min(2)], |p| {
                let prior = (p.prior)(&protocol.scales);
                prior.quantile(0.75) - prior.quantile(0.25)
            });
            let shifted = |centre: &[f64], shift: f64| {
                let mut parameters = centre.to_vec();
                parameters[index] += shift;
                forward.trajectory_m(&parameters).expect("a model")
            };
            let inside = parameters_at(&model, |i| if i == 0 { 0.4 } else { 0.55 });
            let h = 1e-4 * spread;
            let (above, below) = (shifted(&inside, h), shifted(&inside, -h));
            let central: Vec<f64> = above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * h)).collect();
            let exact = forward.derivative_m(&inside, index).expect("differentiable inside");
            let name = model.parameters()[index].name;
            assert!(distance(&exact, &central) < 2e-5, "{name}: {:e}", distance(&exact, &central));
            let Some(parameter) = effect_parameter else { continue };
            let null = null_of(&model);
            if parameter.spec.enters_as_square {
                let at_null = forward.derivative_m(&null, index).expect("differentiable at the null");
                assert!(at_null.iter().all(|slope| *slope == 0.0), "{name}");
                continue;
            }
            if effect.finite_step(&protocol.scales).is_some() {
                let error = forward.derivative_m(&null, index).expect_err("a derivative would do").to_string();
                assert!(error.contains("finite difference"), "{name}: {error}");
                continue;
            }
            if (parameter.null)(&protocol.scales).is_none() {
                continue;
            }
            // The step points into the support.
            let h = if parameter.spec.support.contains(null[index] + h) { h } else { -h };
            let (here, near, far) = (shifted(&null, 0.0), shifted(&null, h), shifted(&null, 2.0 * h));
            let one_sided: Vec<f64> =
                (0..here.len()).map(|i| (4.0 * near[i] - far[i] - 3.0 * here[i]) / (2.0 * h)).collect();
            let exact = forward.derivative_m(&null, index).expect("differentiable at the null");
            // With pore flow the response grows as k + O(k^{3/2}), so differences approach the derivative slowly.
            let largest = if effect.field().is_some() { 1e-3 } else { 2e-5 };
            assert!(distance(&exact, &one_sided) < largest, "{name} at null: {:e}", distance(&exact, &one_sided));
        }
    }
}

/// The documented step from a null without derivative gives a signature near the limit of small steps.
#[test]
#[ignore = "thorough"]
fn finite_steps_are_near_their_limit() {
    let protocol = protocol();
    for &effect in EFFECTS {
        let Some(step) = effect.finite_step(&protocol.scales) else { continue };
        let model = model(&[effect], protocol.scales).expect("an effect alone is a model");
        let forward = reduced(&model, &protocol);
        let null = null_of(&model);
        let here = forward.trajectory_m(&null).expect("a model");
        let quotient = |step: f64| -> Vec<f64> {
            let mut parameters = null.clone();
            parameters[LETHERSICH.len()] += step;
            let there = forward.trajectory_m(&parameters).expect("a model");
            here.iter().zip(&there).map(|(a, b)| (b - a) / step).collect()
        };
        let (taken, limit) = (quotient(step), quotient(1e-3 * step));
        assert!(distance(&taken, &limit) < 0.05, "{}: {:e}", effect.slug(), distance(&taken, &limit));
    }
}

/// A retarded body, given by compliance and time, oscillates like its spring and dashpot in parallel, although another branch of the code computes it.
#[test]
fn a_retarded_body_oscillates_as_its_spring_and_dashpot() {
    let retarded = Element::Retarded { compliance_per_pa: 0.125.into(), time_s: 3.75.into() };
    let body = Element::kelvin_voigt(8.0.into(), 30.0.into());
    for omega in [0.01, 0.3, 2.0, 50.0] {
        let [a, b] = [&retarded, &body].map(|element| complex_modulus_pa(std::slice::from_ref(element), omega));
        // E + iωc, written out.
        for (found, expected) in [(a.re, 8.0), (a.im, 30.0 * omega), (b.re, 8.0), (b.im, 30.0 * omega)] {
            assert!((found / expected - 1.0).abs() < 1e-12, "{omega}: {a:?} {b:?}");
        }
    }
}

/// Burgers and two-element laws equal the Lethersich law with the corresponding effect.
#[test]
fn larger_laws_are_smaller_laws_with_an_effect() {
    let protocol = protocol();
    let named = |slug: &str| EFFECTS.iter().copied().find(|effect| effect.slug() == slug).expect("in the library");
    let [young_modulus_pa, ..] = LETHERSICH;
    // J₀ = 0.2/E; a second body of 0.3/E and 2 s.
    let cases = [
        (BaseLaw::Burgers, vec![young_modulus_pa / 0.2], "instantaneous-elasticity", vec![0.2]),
        (
            BaseLaw::TwoElement,
            vec![young_modulus_pa / 0.3, 2.0 * young_modulus_pa / 0.3],
            "second-retardation",
            vec![0.3, 2.0],
        ),
    ];
    for (law, added, slug, of_effect) in cases {
        let larger = Model::new(law, vec![], protocol.scales, &InputPlace::default()).expect("a law alone");
        let smaller = model(&[named(slug)], protocol.scales).expect("an effect alone");
        let of = |added: &[f64]| LETHERSICH.iter().chain(added).copied().collect::<Vec<f64>>();
        let a = reduced(&larger, &protocol).trajectory_m(&of(&added)).expect("a model");
        let b = reduced(&smaller, &protocol).trajectory_m(&of(&of_effect)).expect("a model");
        assert!(distance(&a, &b) < 1e-12, "{slug}: {:e}", distance(&a, &b));
        let full_m = full(&larger, &protocol).trajectory_m(&of(&added)).expect("a model");
        assert!(distance(&a, &full_m) < 1e-9, "{slug} in full: {:e}", distance(&a, &full_m));
    }
}

/// Laws of all kinds with their parameters: a springpot, one beside a spring, Maxwell's fluid, and a network of springs, dashpots and a springpot.
fn networks() -> [(BaseLaw, Vec<f64>); 4] {
    let network = |text: &str| BaseLaw::Network(Network::from_text("network.toml".as_ref(), text).expect("a network"));
    let generalised = r#"series = [
        { parallel = [{ spring = "gel" }, { series = [{ spring = "arm" }, { dashpot = "slow" }] }, { dashpot = "fast" }] },
        { springpot = "flow" },
    ]"#;
    [
        (network(r#"springpot = "mesh""#), vec![3.0, 0.35]),
        (network(r#"parallel = [{ spring = "gel" }, { springpot = "mesh" }]"#), vec![3.5, 2.0, 0.5]),
        (network(r#"series = [{ spring = "gel" }, { dashpot = "flow" }]"#), vec![3.5, 20.0]),
        (network(generalised), vec![2.0, 3.0, 6.0, 1.0, 20.0, 0.8]),
    ]
}

fn of_effects(model: &Model, probability: f64) -> Vec<f64> {
    let enumerate = model.effects().iter().flat_map(|effect| effect.parameters()).enumerate();
    enumerate
        .map(|(i, p)| (p.prior)(model.scales()).quantile(if i % 2 == 0 { probability } else { 1.0 - probability }))
        .collect()
}

/// Every effect that a network accepts, alone. The reduced model uses the network's retardation spectrum. The full one steps its elements and, if the field
/// changes, the bodies of the law's spectrum. At the null the network returns. A gel that changes while a springpot remembers is stepped to 4e-6.
#[test]
fn effects_of_networks_agree_with_full_finite_elements() {
    assert_networks_agree(|has_field, _| !has_field);
}

/// The network with a springpot beside a spring. Its spectrum has a hundred bodies, each a field, which take some seconds to step.
#[test]
#[ignore = "campaigns/long-tests"]
fn field_effects_of_a_network_agree_with_full_finite_elements() {
    assert_networks_agree(|has_field, n_parameters| has_field && n_parameters == 3);
}

fn assert_networks_agree(is_asked: fn(bool, usize) -> bool) {
    let protocol = protocol();
    let mut n_found = [0; 4];
    for ((law, of_law), n_found) in networks().into_iter().zip(&mut n_found) {
        let alone = Model::new(law, vec![], protocol.scales, &InputPlace::default()).expect("a law alone");
        let base_m = reduced(&alone, &protocol).trajectory_m(&of_law).expect("a model");
        for &effect in EFFECTS {
            let Ok(model) = Model::new(law, vec![effect], protocol.scales, &InputPlace::default()) else { continue };
            *n_found += 1;
            let has_field = model.field().is_some();
            if !is_asked(has_field, of_law.len()) {
                continue;
            }
            let at = |values: Vec<f64>| [of_law.clone(), values].concat();
            let null = effect
                .parameters()
                .iter()
                .map(|p| (p.null)(&protocol.scales).unwrap_or_else(|| (p.prior)(&protocol.scales).quantile(0.5)));
            let (reduced, full) = (reduced(&model, &protocol), full(&model, &protocol));
            let null_m = reduced.trajectory_m(&at(null.collect())).expect("the law is a model");
            assert!(distance(&null_m, &base_m) < 1e-9, "{}: {:e}", effect.slug(), distance(&null_m, &base_m));
            let mut largest = 0.0_f64;
            for probability in if has_field { &[0.6][..] } else { &[0.2, 0.7] } {
                let parameters = at(of_effects(&model, *probability));
                let full_m = full.trajectory_m(&parameters).expect("a model");
                let reduced_m = reduced.trajectory_m(&parameters).expect("a model");
                largest = largest.max(distance(&reduced_m, &full_m));
                assert!(distance(&full_m, &base_m) > 1e-5, "{}: {:e}", effect.slug(), distance(&full_m, &base_m));
            }
            println!("{:<26} on {of_law:?}: {largest:.1e} of the amplitude", effect.slug());
            let of_time = if effect.slug() == "softening" { 5e-6 } else { 2e-6 };
            assert!(largest < tolerance(&model, of_time), "{} on {of_law:?}: {largest:e}", effect.slug());
        }
    }
    // Six of load and observation, two of softening and compressibility, four of fields. Effects of the law: two for a springpot, with or without a spring; two for Maxwell's fluid,
    // plus large displacements; three for the last network.
    assert_eq!(n_found, [14, 14, 15, 15]);
}

/// An effect on a network equals the network with that element added.
#[test]
fn effects_of_networks_are_larger_networks() {
    let protocol = protocol();
    let hold_s = protocol.scales.hold_s;
    let network = |text: &str| BaseLaw::Network(Network::from_text("network.toml".as_ref(), text).expect("a network"));
    let mesh_pa = 3.0 * (1.0 / hold_s).powf(0.35);
    let beside = r#"{ parallel = [{ spring = "gel" }, { springpot = "mesh" }] }"#;
    let [(springpot, of_springpot), (solid, of_solid), (maxwell, of_maxwell), _] = networks();
    let cases = [
        (
            (springpot, of_springpot.clone(), "instantaneous-elasticity", vec![0.2]),
            (r#"series = [{ springpot = "mesh" }, { spring = "glass" }]"#.to_string(), vec![3.0, 0.35, mesh_pa / 0.2]),
        ),
        (
            (springpot, of_springpot, "second-retardation", vec![0.3, 2.0]),
            (
                r#"series = [{ springpot = "mesh" }, { parallel = [{ spring = "second" }, { dashpot = "late" }] }]"#
                    .into(),
                vec![3.0, 0.35, mesh_pa / 0.3, 2.0 * mesh_pa / 0.3],
            ),
        ),
        (
            (solid, of_solid.clone(), "instantaneous-elasticity", vec![0.2]),
            (format!(r#"series = [{beside}, {{ spring = "glass" }}]"#), [of_solid, vec![3.5 / 0.2]].concat()),
        ),
        (
            (maxwell, of_maxwell, "fractional-damping", vec![0.6]),
            (
                r#"series = [{ spring = "gel" }, { springpot = "flow" }]"#.into(),
                vec![3.5, 20.0 / hold_s * hold_s.powf(0.6), 0.6],
            ),
        ),
    ];
    for ((law, of_law, slug, values), (text, of_larger)) in cases {
        let named = EFFECTS.iter().copied().find(|effect| effect.slug() == slug).expect("in the library");
        let smaller = Model::new(law, vec![named], protocol.scales, &InputPlace::default()).expect("a model");
        let larger = Model::new(network(&text), vec![], protocol.scales, &InputPlace::default()).expect("a law alone");
        let a = reduced(&smaller, &protocol).trajectory_m(&[of_law, values].concat()).expect("a model");
        let b = full(&larger, &protocol).trajectory_m(&of_larger).expect("a model");
        assert!(distance(&a, &b) < 1e-6, "{slug} on {law:?}: {:e}", distance(&a, &b));
        let b = reduced(&larger, &protocol).trajectory_m(&of_larger).expect("a model");
        assert!(distance(&a, &b) < 1e-8, "{slug} on {law:?}: {:e}", distance(&a, &b));
    }
}

/// Derivatives by the parameters of networks and of the effects on the law itself, against central differences.
#[test]
fn sensitivities_of_networks_agree_with_finite_differences() {
    let protocol = protocol();
    for (law, of_law) in networks() {
        for slug in
            ["instantaneous-elasticity", "second-retardation", "fractional-damping", "softening", "force-gradient"]
        {
            let effect = EFFECTS.iter().copied().find(|effect| effect.slug() == slug).expect("in the library");
            let Ok(model) = Model::new(law, vec![effect], protocol.scales, &InputPlace::default()) else { continue };
            let forward = reduced(&model, &protocol);
            let inside = [of_law.clone(), of_effects(&model, 0.4)].concat();
            for index in 0..inside.len() {
                let h = 1e-4 * if inside[index] == 0.0 { 1.0 } else { inside[index].abs() };
                let shifted = |by: f64| {
                    let mut parameters = inside.clone();
                    parameters[index] += by;
                    forward.trajectory_m(&parameters).expect("a model")
                };
                let (above, below) = (shifted(h), shifted(-h));
                let central: Vec<f64> = above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * h)).collect();
                let exact = forward.derivative_m(&inside, index).expect("differentiable inside");
                let name = model.parameters()[index].name;
                assert!(distance(&exact, &central) < 2e-5, "{slug}, {name}: {:e}", distance(&exact, &central));
            }
        }
    }
}

/// Derivative at an order of 1, where the springpot still equals a dashpot: against one-sided differences of the full model, with Richardson's extrapolation.
#[test]
fn a_springpot_for_a_dashpot_has_a_derivative_where_it_is_one() {
    let protocol = protocol();
    let named = EFFECTS.iter().copied().find(|effect| effect.slug() == "fractional-damping").expect("in the library");
    for (law, of_law) in networks().into_iter().skip(2) {
        let model = Model::new(law, vec![named], protocol.scales, &InputPlace::default()).expect("a dashpot is there");
        let (reduced, full) = (reduced(&model, &protocol), full(&model, &protocol));
        let at = |order: f64| full.trajectory_m(&[of_law.clone(), vec![order]].concat()).expect("a model");
        let (here, near, far) = (at(1.0), at(1.0 - 2e-3), at(1.0 - 4e-3));
        let one_sided: Vec<f64> = (0..here.len()).map(|i| (4.0 * near[i] - far[i] - 3.0 * here[i]) / -4e-3).collect();
        let found = reduced.derivative_m(&[of_law, vec![1.0]].concat(), model.parameters().len() - 1);
        let found = found.expect("differentiable at the null");
        assert!(distance(&found, &one_sided) < 3e-3, "{law:?}: {:e}", distance(&found, &one_sided));
    }
}
