//! Effects under a prescribed position: the reduced model against the full-order model, and derivatives against finite differences.

use crate::conformance::PORCINE;
use vitreo_uq::base::number::Dual;
use vitreo_uq::elements::fe::stepping::Resolution;
use vitreo_uq::elements::fe::stepping::run::strains_and_positions;
use vitreo_uq::laws::rheology::BaseLaw;
use vitreo_uq::models::effects::{Effect, Library};
use vitreo_uq::models::model::{Compliance, Forward, Model, Response, SurrogateForward};
use vitreo_uq::record::{CharacteristicSizes, Force, ForceRule};

/// Displacement per force at unit creep compliance, in 1/m.
const COMPLIANCE_PER_M: f64 = 549.178;

const SCALES: CharacteristicSizes = CharacteristicSizes {
    largest_force_n: 3e-4,
    position_range_m: 5e-6,
    sample_interval_s: 0.1,
    duration_s: 30.0,
    is_position_controlled: true,
    ..PORCINE
};

/// Times (s) and a commanded position (m) that rises and falls in ramps, with holds between them.
fn command() -> (Vec<f64>, Vec<f64>) {
    let time_s: Vec<f64> = (0..=300).map(|row| 0.1 * f64::from(row)).collect();
    let at = |t: f64| {
        let t = t % 10.0;
        3e-4 * if t < 1.0 {
            t
        } else if t < 5.0 {
            1.0
        } else if t < 6.0 {
            6.0 - t
        } else {
            0.0
        }
    };
    let position_m = time_s.iter().map(|t| at(*t)).collect();
    (time_s, position_m)
}

/// Parameters of the law, and of an effect at the median of its prior.
fn parameters(model: &Model) -> Vec<f64> {
    let mut all = vec![3.0, 1.5, 40.0];
    for effect in model.effects() {
        all.extend(effect.parameters().iter().map(|parameter| (parameter.prior)(&SCALES).quantile(0.7)));
    }
    all
}

fn models() -> Vec<Model> {
    let with = |effects: Vec<&'static dyn Effect>| {
        Model::new(BaseLaw::Lethersich, effects, SCALES, &vitreo_uq::base::error::InputPlace::default())
    };
    let library = Library::default();
    let alone: Vec<Model> = library.effects().iter().filter_map(|effect| with(vec![*effect]).ok()).collect();
    std::iter::once(with(Vec::new()).unwrap()).chain(alone).collect()
}

#[test]
fn reduced_and_full_order_models_agree() {
    let (time_s, position_m) = command();
    let force = Force { at_rows_n: &position_m, rule: ForceRule::Linear };
    let mut names = Vec::new();
    for model in models() {
        names.extend(model.effects().iter().map(|effect| effect.slug()));
        let parameters = parameters(&model);
        let stages = model.stages(&parameters.iter().map(|x| Dual::constant(*x)).collect::<Vec<_>>()).unwrap();
        let response = Response::new(&time_s, force, time_s.len());
        let compliance = if stages.poisson_ratio.is_some() { continue } else { COMPLIANCE_PER_M };
        let reduced = response.trajectory_m(&stages, compliance).unwrap();
        let full = strains_and_positions(compliance, &stages, &time_s, force, Resolution::default()).unwrap();
        let largest = reduced.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        // The observation acts after the mechanics, and is the same code in both.
        let observation = stages.observation.of::<f64>();
        let full: Vec<f64> = full.iter().zip(&time_s).map(|([_, x], t)| observation.recorded_m(*x, *t)).collect();
        let error = reduced.iter().zip(&full).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs())) / largest;
        assert!(error < 1e-6, "{names:?}: {error:e}");
    }
    let expected = [
        "clock-offset",
        "force-asymmetry",
        "force-bias",
        "actuator-lag",
        "instantaneous-elasticity",
        "second-retardation",
        "fractional-damping",
        "softening",
        "tracking-drift",
    ];
    assert_eq!(names, expected, "these effects have a model for a prescribed position");
}

#[test]
fn derivatives_are_those_of_the_trajectory() {
    let (time_s, position_m) = command();
    let force = Force { at_rows_n: &position_m, rule: ForceRule::Linear };
    for model in models() {
        let at = parameters(&model);
        let response = Response::new(&time_s, force, time_s.len());
        let compliance = Compliance::fixed(COMPLIANCE_PER_M);
        let forward = SurrogateForward { model: &model, compliance, response, trained: &[] };
        for index in 0..at.len() {
            let spec = model.parameters()[index];
            if spec.name.contains("poisson") || spec.name.contains("compressibility") {
                continue;
            }
            let exact = forward.derivative_m(&at, index).unwrap();
            let step = 1e-3 * at[index].abs().max(1e-9);
            let moved = |sign: f64| {
                let mut point = at.clone();
                point[index] += sign * step;
                forward.trajectory_m(&point).unwrap()
            };
            let (above, below) = (moved(1.0), moved(-1.0));
            let scale = exact.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            let errors =
                exact.iter().zip(above.iter().zip(&below)).map(|(d, (a, b))| (d - (a - b) / (2.0 * step)).abs());
            let error = errors.fold(0.0, f64::max) / scale;
            // The command is never negative.
            assert!(error < 1e-3 || spec.name.starts_with("force-asymmetry"), "{}: {error:e}", spec.name);
        }
    }
}

/// At the end of the supports, where every effect vanishes, the one-sided derivative agrees with a difference quotient.
#[test]
fn derivatives_at_the_nulls_are_one_sided() {
    let (time_s, position_m) = command();
    let force = Force { at_rows_n: &position_m, rule: ForceRule::Linear };
    let mut n_compared = 0;
    for model in models() {
        let mut at = parameters(&model);
        let Some(effect) = model.effects().first() else { continue };
        let Some(null) = (effect.parameters()[0].null)(&SCALES) else { continue };
        at[3] = null;
        let response = Response::new(&time_s, force, time_s.len());
        let forward =
            SurrogateForward { model: &model, compliance: Compliance::fixed(COMPLIANCE_PER_M), response, trained: &[] };
        let spec = model.parameters()[3];
        let Ok(exact) = forward.derivative_m(&at, 3) else {
            assert_eq!(spec.name, "actuator-lag.time_s", "only a lag has no derivative at its null");
            continue;
        };
        let step = 1e-4 * ((effect.parameters()[0].prior)(&SCALES).quantile(0.7) - null);
        let base = forward.trajectory_m(&at).unwrap();
        at[3] = null + step;
        let moved = forward.trajectory_m(&at).unwrap();
        let scale = exact.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let error = exact
            .iter()
            .zip(base.iter().zip(&moved))
            .fold(0.0_f64, |most, (d, (a, b))| most.max((d - (b - a) / step).abs()));
        // The command is never negative, so that `force-asymmetry` has no effect.
        assert!(error < 1e-3 * scale || scale == 0.0, "{}: {error:e} of {scale:e}", spec.name);
        n_compared += usize::from(scale > 0.0);
    }
    assert_eq!(n_compared, 7);
}
