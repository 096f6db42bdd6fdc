//! Tests that compare trained trajectories with the stepper, at points that were not used for training.

use super::*;
use crate::surrogate::hyper::{self, HyperModel, HyperSettings};
use elements::fe::Stiffness;
use elements::fe::spatial::{GelAndRobot, PhysicalProperties as BodySizes};
use elements::mesh::QuarterBall;
use laws::rheology::BaseLaw;
use laws::stages::{Nonlinearity, ReducedField, YIELD_SMOOTHING};
use rayon::prelude::*;

const FAMILIES: [NonlinearFamily; 3] =
    [NonlinearFamily::StrainStiffening, NonlinearFamily::ShearThinning, NonlinearFamily::YieldStress];
const PORCINE: [f64; 3] = [3.527, 1.402, 47.370];
const COMPLIANCE_PER_M: f64 = 549.0;
const FORCE_N: f64 = 4.6e-6;
/// Values of each nonlinear family's parameter around which test points are drawn.
const ABOUT: [[f64; 2]; 3] = [[0.05, 0.3], [0.93, 0.75], [0.3, 1.2]];

/// Returns the stepper of a family. It is trained on few full-order runs, since the tests do not compare it with the full-order
/// model.
fn stepper(which: usize) -> &'static HyperModel {
    static MODELS: [OnceLock<HyperModel>; 3] = [const { OnceLock::new() }; 3];
    MODELS[which].get_or_init(|| {
        let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 1, n_layers: 4 };
        let mesh = ball.mesh().expect("the sizes are good");
        let stiffness = Stiffness::new(&mesh).expect("the mesh is good");
        let sizes = BodySizes {
            gel_density_kg_m3: 1000.0,
            robot_mass_kg: 0.65e-6,
            robot_radius_m: ball.robot_radius_m,
            outer_radius_m: ball.outer_radius_m,
            ball: Some(ball),
        };
        let surroundings = GelAndRobot { mesh: &mesh, stiffness: &stiffness, poisson_ratio: 0.48, sizes };
        let family = FAMILIES[which];
        let settings = HyperSettings { training_runs: 8, verification_runs: 0, ..HyperSettings::of(family) };
        hyper::build(&surroundings, family, &settings, &|| ()).expect("training succeeds")
    })
}

fn record() -> (Vec<f64>, Vec<f64>) {
    let force = |i: usize| if (i / 50_usize).is_multiple_of(2) { FORCE_N } else { -FORCE_N };
    ((0..201).map(|i| 0.1 * i as f64).collect(), (0..201).map(force).collect())
}

fn local(which: usize) -> CachedStepper {
    let (time_s, force_n) = record();
    CachedStepper::new(SharedStepper(Arc::new(stepper(which).clone())), &time_s, (&force_n).into())
}

fn stages(which: usize, law: [Dual; 3], value: Dual) -> Stages {
    let mut stages = Stages::of_law(BaseLaw::Lethersich.elements(&law));
    stages.spatial = Some(Spatial::Nonlinear(match FAMILIES[which] {
        NonlinearFamily::StrainStiffening => Nonlinearity::StrainStiffening { coefficient: value },
        NonlinearFamily::ShearThinning => {
            Nonlinearity::ShearThinning { index: value, reference_stress_pa: 4.84.into() }
        }
        NonlinearFamily::YieldStress => Nonlinearity::YieldStress { stress_pa: value, smoothing: YIELD_SMOOTHING },
    }));
    stages
}

/// Returns test points near a value of the nonlinear parameter. The law's parameters vary by 4 %, the nonlinear parameter by 3 %.
fn points(which: usize, about: f64) -> Vec<Stages> {
    let near = |index: u32, dimension: u32, width: f64| {
        1.0 + width * (2.0 * f64::from(sobol_burley::sample(index, dimension, 91)) - 1.0)
    };
    let point = |index: u32| {
        let law = std::array::from_fn(|k| Dual::constant(PORCINE[k] * near(index, k as u32, 0.04)));
        stages(which, law, (about * near(index, 3, 0.03)).into())
    };
    (0..24).map(point).collect()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// Checks the similarity on which this module is based. If one factor multiplies Young's modulus and both viscosities, and the nonlinear
/// parameter is adapted, displacements only change by a factor.
#[test]
fn steppers_only_scale_with_the_modulus() {
    let (time_s, force_n) = record();
    for which in 0..3 {
        let excess_m = |factor: f64| {
            let value = ABOUT[which][1] * if which == 0 { factor * factor } else { 1.0 };
            let law = PORCINE.map(|x| Dual::constant(factor * x));
            let at = stages(which, law, value.into());
            stepper(which).excess_m(&at, COMPLIANCE_PER_M, &time_s, (&force_n).into()).expect("it moves")
        };
        let (one, other) = (excess_m(1.0), excess_m(1.7));
        let worst = one.iter().zip(&other).fold(0.0_f64, |m, (a, b)| m.max((a - 1.7 * b).abs()));
        println!("{:?}: {:e}", FAMILIES[which], worst / largest(&one));
        assert!(worst < 1e-7 * largest(&one), "{:?}: {worst:e} of {:e}", FAMILIES[which], largest(&one));
    }
}

/// A stepper offers one without training until the box of a law is built, and for no law without a box.
#[test]
fn laws_in_boxes_that_are_built_need_no_training() {
    let (time_s, force_n) = record();
    let local = local(1);
    let [near, beside, linear] = [0.75, 0.35, 1.2].map(|index| stages(1, PORCINE.map(Dual::constant), index.into()));
    let is_offered = |stages: &Stages| local.untrained(stages, COMPLIANCE_PER_M).is_some();
    assert!(is_offered(&near) && is_offered(&beside) && !is_offered(&linear));
    let trained = local.excess_m(&near, COMPLIANCE_PER_M, &time_s, (&force_n).into()).expect("it moves");
    assert!(!is_offered(&near) && is_offered(&beside));
    let mut direct = beside;
    direct.spread = Some(ReducedField::Stepped(SharedStepper(Arc::new(local))));
    assert!(direct.avoid_training(COMPLIANCE_PER_M) && !direct.avoid_training(COMPLIANCE_PER_M));
    assert!(largest(&trained) > 0.0);
}

/// Compares trained trajectories with the stepper at points that were not used for training, to the tolerance of the boxes. The
/// first half of the record alone must give the same positions.
#[test]
fn what_is_remembered_is_what_the_stepper_says() {
    let (time_s, force_n) = record();
    let sizes = |local: &CachedStepper| CoordinateSizes {
        force_n: local.force_and_impulse[0],
        impulse_n_s: local.force_and_impulse[1],
        compliance_per_m: COMPLIANCE_PER_M,
    };
    for which in 0..3 {
        let local = local(which);
        for about in ABOUT[which] {
            let (mut n_learnt, mut worst) = (0, 0.0_f64);
            let points = points(which, about);
            for at in &points {
                let exact =
                    stepper(which).excess_m(at, COMPLIANCE_PER_M, &time_s, (&force_n).into()).expect("it moves");
                let found = local.learnt(at, COMPLIANCE_PER_M, &time_s, (&force_n).into(), |x| x.value);
                let Some(found) = found else { continue };
                n_learnt += 1;
                let first =
                    local.excess_m(at, COMPLIANCE_PER_M, &time_s[..101], (&force_n[..101]).into()).expect("it moves");
                assert_eq!(first, found[..101]);
                let error = found.iter().zip(&exact).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
                worst = worst.max(error / amplitude_m(at, sizes(&local)));
            }
            println!("{:?} about {about}: {n_learnt} of {} remembered, {worst:e}", FAMILIES[which], points.len());
            assert!(worst < TOLERANCE, "{:?} about {about}: {worst:e}", FAMILIES[which]);
            assert!(n_learnt == points.len(), "{:?} about {about}: {n_learnt}", FAMILIES[which]);
        }
    }
}

/// Checks that results equal the stepper's to the last bit if no box covers them. Cases are another record, another load, and a law outside
/// all boxes.
#[test]
fn what_is_not_covered_is_left_to_the_stepper() {
    let (time_s, force_n) = record();
    let (local, which) = (local(1), 1);
    let usual = stages(which, PORCINE.map(Dual::constant), 0.93.into());
    let learnt = |at: &Stages, time_s: &[f64]| {
        let force_n = &force_n[..time_s.len()];
        let found = local.learnt(at, COMPLIANCE_PER_M, time_s, force_n.into(), |x| x.value);
        let exact = stepper(which).excess_m(at, COMPLIANCE_PER_M, time_s, force_n.into()).expect("it moves");
        let is_the_stepper = local.excess_m(at, COMPLIANCE_PER_M, time_s, force_n.into()).expect("it moves") == exact;
        assert_eq!(found.is_some(), !is_the_stepper);
        found.is_some()
    };
    assert!(learnt(&usual, &time_s));
    let other_s: Vec<f64> = time_s.iter().map(|t| 1.01 * t).collect();
    assert!(!learnt(&usual, &other_s));
    let mut late = usual.clone();
    late.load.delay_s = 0.02.into();
    assert!(!learnt(&late, &time_s));
    let thin = stages(which, PORCINE.map(Dual::constant), 0.15.into());
    assert!(!learnt(&thin, &time_s));
}

/// Checks that the result at a point does not depend on earlier calls or on other points, to the last bit.
#[test]
fn answers_depend_on_nothing_but_the_point() {
    let (time_s, force_n) = record();
    let which = 1;
    let points: Vec<Stages> = [0.96, 0.93, 0.88].iter().flat_map(|about| points(which, *about)).collect();
    let bits = |local: &CachedStepper, at: &Stages| -> Vec<u64> {
        let excess_m = local.excess_m(at, COMPLIANCE_PER_M, &time_s, (&force_n).into()).expect("it moves");
        excess_m.into_iter().map(f64::to_bits).collect()
    };
    let (forth, back, beside) = (local(which), local(which), local(which));
    let in_order: Vec<_> = points.iter().map(|at| bits(&forth, at)).collect();
    let mut reversed: Vec<_> = points.iter().rev().map(|at| bits(&back, at)).collect();
    reversed.reverse();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().expect("threads");
    let at_once: Vec<_> = pool.install(|| points.par_iter().map(|at| bits(&beside, at)).collect());
    assert!(in_order == reversed && in_order == at_once);
}

/// Checks that the relative error of the trained excess over the linear law stays small near this law, where the excess vanishes. Fits that
/// start there need this.
#[test]
fn little_excess_is_as_right_as_much() {
    let (time_s, force_n) = record();
    for (which, null, step) in [(0, 0.0, 1e-5), (1, 1.0, -1e-4), (2, 0.0, 1e-5)] {
        let at = stages(which, PORCINE.map(Dual::constant), (null + step).into());
        let found =
            local(which).learnt(&at, COMPLIANCE_PER_M, &time_s, (&force_n).into(), |x| x.value).expect("covered");
        let exact = stepper(which).excess_m(&at, COMPLIANCE_PER_M, &time_s, (&force_n).into()).expect("it moves");
        let error = found.iter().zip(&exact).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / largest(&exact);
        println!("{:?}: {error:e} of {:e} m", FAMILIES[which], largest(&exact));
        assert!(error < 0.02, "{:?}: {error:e}", FAMILIES[which]);
    }
}

/// Checks that derivatives equal central differences of the trained trajectory up to the error of the difference. They must equal
/// the derivatives of the stepper up to the error of the polynomials.
#[test]
fn derivatives_are_those_of_the_trajectory() {
    let (time_s, force_n) = record();
    for which in 0..3 {
        let local = local(which);
        let point = [PORCINE[0], PORCINE[1], PORCINE[2], ABOUT[which][1]];
        for direction in 0..4 {
            let at = |shift: f64, slope: f64| {
                let number = |k: usize| {
                    let is_it = f64::from(u8::from(k == direction));
                    Dual { value: point[k] * (1.0 + shift * is_it), derivative: point[k] * slope * is_it }
                };
                stages(which, [number(0), number(1), number(2)], number(3))
            };
            let dual = |stepper: &dyn FieldStepper| -> Vec<f64> {
                let found = stepper.excess_dual_m(&at(0.0, 1.0), COMPLIANCE_PER_M, &time_s, (&force_n).into());
                found.expect("it moves").iter().map(|x| x.derivative).collect()
            };
            let value = |shift: f64| local.excess_m(&at(shift, 0.0), COMPLIANCE_PER_M, &time_s, (&force_n).into());
            let (ahead, behind) = (value(1e-5).expect("it moves"), value(-1e-5).expect("it moves"));
            let values = dual(&local);
            let distance = |other: &dyn Fn(usize) -> f64| {
                values.iter().enumerate().fold(0.0_f64, |m, (i, x)| m.max((x - other(i)).abs())) / largest(&values)
            };
            let of_difference = distance(&|i| (ahead[i] - behind[i]) / 2e-5);
            let of_stepper = dual(stepper(which));
            // Errors are 10⁻⁴ of the displacement, which is a millimetre here, over boxes of width about a tenth. Errors of
            // derivatives are therefore about 10⁻³ of the displacement.
            let of_stepper = distance(&|i| of_stepper[i]) * largest(&values) / 1e-3;
            println!("{:?} {direction}: {of_difference:e} {of_stepper:e}", FAMILIES[which]);
            assert!(of_difference < 1e-6, "{:?} {direction}: {of_difference:e}", FAMILIES[which]);
            assert!(of_stepper < 1e-3, "{:?} {direction}: {of_stepper:e}", FAMILIES[which]);
        }
    }
}
