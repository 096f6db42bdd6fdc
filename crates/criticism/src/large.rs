//! Decides whether large displacements are worth learning for a record, by one full-order run at the base's fit.

use base::error::Result;
use figures::number::format_significant;
use laws::stages::SharedStepper;
use models::surrogate::trajectory::MAX_RADII;
use posterior::large_displacement::LEAST_RADII;
use posterior::learnt_displacement::{deviation_m, learn_displacements};
use posterior::monitor::Monitor;

use super::rank::Score;
use super::refit::Refitted;
use super::subject::NotLearnt;
use super::{Subject, Tangent};

/// Least expected gain (nats) at which large displacements are learnt. An effect with less cannot be claimed, and learning takes a minute.
const LEAST_NATS: f64 = 4.0;
/// Factor by which a refit's gain may exceed its first-order value, with `NATS` added, as in `screen`.
const FACTOR: f64 = 1.5;
const NATS: f64 = 1.0;

/// Decides whether large displacements are worth learning for a record at a fit of the base, and learns them if so.
pub(super) fn prepare(subject: &Subject, base: &Refitted, monitor: &dyn Monitor) {
    let wanted = subject.library().effects().iter().any(|effect| effect.is_learnt_for_record());
    if wanted && subject.problem().model.field().is_none() && subject.large().get().is_none() {
        // Learning runs outside the cell's initialisation: threads that wait there would take up other work of this search.
        let found = learn(subject, base, monitor);
        let _ = subject.large().set(found);
    }
}

/// First-order score of the effect with this slug. `None` unless the effect is large displacements and one full-order run showed that they are not worth learning.
pub(super) fn score_where_not_learnt(subject: &Subject, slug: &str) -> Option<Score> {
    let effect = subject.library().get(slug)?;
    match subject.large().get() {
        Some(Err(not_learnt)) if effect.is_learnt_for_record() => not_learnt.score.clone(),
        _ => None,
    }
}

/// Response to large displacements in this record, learnt around the base's fit, or the reason why it was not learnt.
fn learn(subject: &Subject, base: &Refitted, monitor: &dyn Monitor) -> std::result::Result<SharedStepper, NotLearnt> {
    let said = |error: base::Error| NotLearnt::of(error.to_string().lines().next().unwrap_or_default());
    let problem = subject.problem();
    let ball = problem.finite_elements().and_then(|fe| fe.sizes.ball);
    let ball = ball.ok_or(NotLearnt::of("large displacements need a sphere at the centre of the gel"))?;
    let position_m = &base.fitted.position_m;
    let radii = position_m.iter().fold(0.0_f64, |most, x| most.max(x.abs())) / ball.robot_radius_m;
    if radii < LEAST_RADII {
        return Err(NotLearnt::of(format!(
            "the robot moves by {} of its radii: large displacements are negligible there",
            format_significant(radii, 2)
        )));
    }
    if radii >= MAX_RADII {
        return Err(NotLearnt::of(format!(
            "the robot moves by {} of its radii, but large displacements are computed up to {MAX_RADII} only",
            format_significant(radii, 2)
        )));
    }
    let parameters = base.candidate.parameters(&base.fitted.theta);
    let n_law = base.candidate.model.base().parameters().len();
    let law = &parameters[..n_law];
    let promised = promised(subject, base, law).map_err(said)?;
    if promised.nats < LEAST_NATS {
        let (most_um, nats) = (format_significant(promised.most_um, 2), format_significant(promised.nats, 2));
        let gained = if promised.score.z > 0.0 {
            format!("gain {nats} nats at most after the law has absorbed its part")
        } else {
            "the law's residual contains no such change".into()
        };
        return Err(NotLearnt {
            reason: format!("large displacements would change positions by up to {most_um} µm, and {gained}"),
            score: Some(promised.score),
        });
    }
    learn_displacements(problem, law, true, monitor).map(|(stepper, _)| stepper).map_err(said)
}

struct FirstOrderGain {
    nats: f64,
    most_um: f64,
    score: Score,
}

/// First-order gain of the deviation that large displacements cause under the base's law. The law first absorbs the part that its parameters can describe.
fn promised(subject: &Subject, base: &Refitted, law: &[f64]) -> Result<FirstOrderGain> {
    let deviation_m = deviation_m(subject.problem(), law)?;
    let tangent = Tangent::new(subject, &base.candidate, &base.fitted)?;
    let whole = tangent.whiten(std::slice::from_ref(&deviation_m)).swap_remove(0);
    let left = tangent.project(whole.clone());
    let norm = left.norm().max(f64::MIN_POSITIVE);
    let z = left.dot(&tangent.projected_residual()) / norm;
    let most_m = deviation_m.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let score = Score {
        z,
        // For small amplitudes the deviation grows with the square of the amplitude.
        expected_parameter: (z / norm).max(0.0).sqrt(),
        visible_fraction: left.norm_squared() / whole.norm_squared().max(f64::MIN_POSITIVE),
        signature_per_unit: norm,
        direction: None,
        is_one_sided: true,
    };
    Ok(FirstOrderGain { nats: FACTOR * 0.5 * z.max(0.0).powi(2) + NATS, most_um: 1e6 * most_m, score })
}
