//! Tests the paper's claims about shapes of robots.

use documents::shapes::{Claim, ClaimVerdict};
use statrs::distribution::{ContinuousCDF, Normal};

use super::bodies::StudyBody;
use documents::shapes::{BodyShape, SizeRule};
use record::Orientation;

/// A claim holds if its probability is above this value, and does not hold if it is below 1 minus this value. Otherwise it is undecided.
const SURE: f64 = 0.95;
/// Largest relative deviation at which the force counts as proportional to the surface area.
const PROPORTIONAL: f64 = 0.05;

/// Stiffness of a body with its numerical error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StiffnessEstimate {
    /// The body.
    pub body: StudyBody,
    /// Stiffness divided by Young's modulus: force per displacement per Pa, in m.
    pub stiffness_m: f64,
    /// Relative error of the stiffness.
    pub relative_error: f64,
}

impl StiffnessEstimate {
    /// Probability that this body moves more easily than `other`. The relative errors are taken as standard deviations.
    fn probability_easier_than(&self, other: &Self) -> f64 {
        easier(-self.stiffness_m.ln(), -other.stiffness_m.ln(), self.relative_error.hypot(other.relative_error))
    }
}

/// Tests the paper's claims about the bodies' stiffness. Returns them with their verdicts, in the paper's order.
pub fn claims(all: &[StiffnessEstimate]) -> Vec<Claim> {
    let mut list = Vec::new();
    let find = |rule: SizeRule, shape: BodyShape, orientation: Orientation| {
        all.iter().find(|stiffness_estimate| {
            let is_so = stiffness_estimate.body.orientation == orientation || shape == BodyShape::Sphere;
            stiffness_estimate.body.rule == rule && stiffness_estimate.body.shape == shape && is_so
        })
    };
    use Orientation::{Horizontal, Vertical};
    for rule in SizeRule::ALL {
        let of_rule: Vec<&StiffnessEstimate> =
            all.iter().filter(|stiffness_estimate| stiffness_estimate.body.rule == rule).collect();
        let Some(sphere) = find(rule, BodyShape::Sphere, Horizontal) else { continue };
        let ratio = |stiffness_estimate: &StiffnessEstimate| stiffness_estimate.stiffness_m / sphere.stiffness_m;
        let others: Vec<&&StiffnessEstimate> =
            of_rule.iter().filter(|stiffness_estimate| stiffness_estimate.body.shape != BodyShape::Sphere).collect();
        let easiest = others.iter().map(|other| sphere.probability_easier_than(other)).product();
        let lowest = others.iter().min_by(|a, b| a.stiffness_m.total_cmp(&b.stiffness_m));
        let numbers = lowest.map_or_else(String::new, |stiffness_estimate| {
            format!(
                "closest to the sphere: {} at {:.4} × the sphere's resistance",
                stiffness_estimate.body.label(),
                ratio(stiffness_estimate)
            )
        });
        list.push(claim(format!("at {}, the sphere moves easiest", rule.title()), easiest, numbers));
        for orientation in [Horizontal, Vertical] {
            let (Some(ellipsoid), Some(cylinder)) =
                (find(rule, BodyShape::Ellipsoid, orientation), find(rule, BodyShape::Cylinder, orientation))
            else {
                continue;
            };
            let way = if orientation == Horizontal { "horizontal" } else { "vertical" };
            list.push(claim(
                format!("at {}, the {way} ellipsoid moves easier than the {way} cylinder", rule.title()),
                ellipsoid.probability_easier_than(cylinder),
                format!("{:.4} against {:.4} × the sphere's resistance", ratio(ellipsoid), ratio(cylinder)),
            ));
        }
        for shape in [BodyShape::Ellipsoid, BodyShape::Cylinder] {
            let (Some(along), Some(across)) = (find(rule, shape, Horizontal), find(rule, shape, Vertical)) else {
                continue;
            };
            list.push(claim(
                format!("at {}, the {} moves easier horizontal than vertical", rule.title(), shape.name()),
                along.probability_easier_than(across),
                format!("{:.4} against {:.4} × the sphere's resistance", ratio(along), ratio(across)),
            ));
        }
        if rule == SizeRule::EqualVolume {
            list.push(proportional_to_surface(sphere, &others));
        }
    }
    list
}

fn claim(claim: String, probability: f64, numbers: String) -> Claim {
    Claim { claim, verdict: verdict_of(probability), probability, numbers }
}

/// Probability that `first` is larger than `second`, if the difference is normally distributed with standard deviation `sd`.
pub(super) fn easier(first: f64, second: f64, sd: f64) -> f64 {
    Normal::standard().cdf((first - second) / sd.max(f64::EPSILON))
}

/// Verdict on a claim that holds with this probability.
pub(super) fn verdict_of(probability: f64) -> ClaimVerdict {
    match probability {
        p if p >= SURE => ClaimVerdict::Holds,
        p if p <= 1.0 - SURE => ClaimVerdict::DoesNotHold,
        _ => ClaimVerdict::TooClose,
    }
}

/// Tests "The viscoelastic force is approximately proportional to the surface area of the robot."
fn proportional_to_surface(sphere: &StiffnessEstimate, others: &[&&StiffnessEstimate]) -> Claim {
    let area = |stiffness_estimate: &StiffnessEstimate| stiffness_estimate.body.revolution().surface_area_m2();
    let parts: Vec<(f64, f64)> =
        others.iter().map(|other| (other.stiffness_m / sphere.stiffness_m, area(other) / area(sphere))).collect();
    let is_so = parts.iter().all(|(resistance, surface)| (resistance / surface - 1.0).abs() < PROPORTIONAL);
    let numbers: Vec<String> = others
        .iter()
        .zip(&parts)
        .map(|(stiffness_estimate, (resistance, surface))| {
            format!("{}: {resistance:.3} for a surface of {surface:.3}", stiffness_estimate.body.label())
        })
        .collect();
    claim(
        "at equal volume, resistance is proportional to the surface (within 5 %)".into(),
        f64::from(u8::from(is_so)),
        numbers.join("; "),
    )
}

#[cfg(test)]
mod tests {
    use super::super::bodies::{PAPER_ASPECT, bodies};
    use super::*;

    fn measured(stiffness_of: impl Fn(&StudyBody) -> f64, relative_error: f64) -> Vec<StiffnessEstimate> {
        bodies(PAPER_ASPECT, 0.55e-3)
            .into_iter()
            .map(|body| StiffnessEstimate { body, stiffness_m: stiffness_of(&body), relative_error })
            .collect()
    }

    /// If two bodies differ by one standard deviation, their ordering has probability Φ(1). If they differ by much more, the ordering is certain and the
    /// opposite claim is false.
    #[test]
    fn errors_decide_what_is_too_close() {
        let easier = |distance: f64, relative_error: f64| {
            let horizontal =
                |body: &StudyBody| body.orientation == Orientation::Horizontal && body.shape == BodyShape::Ellipsoid;
            let all = measured(|body| if horizontal(body) { (-distance).exp() } else { 1.0 }, relative_error);
            let list = claims(&all);
            let wanted = "at equal volume, the horizontal ellipsoid moves easier than the horizontal cylinder";
            list.into_iter().find(|claim| claim.claim == wanted).unwrap()
        };
        let sd = 2.0_f64.sqrt() * 1e-3;
        let close = easier(sd, 1e-3);
        assert_eq!(close.verdict, ClaimVerdict::TooClose);
        assert!((close.probability - 0.841_344_746).abs() < 1e-8, "{close:?}");
        assert_eq!(easier(5.0 * sd, 1e-3).verdict, ClaimVerdict::Holds);
        assert_eq!(easier(-5.0 * sd, 1e-3).verdict, ClaimVerdict::DoesNotHold);
    }

    /// If stiffness is proportional to surface area, that claim holds, and the sphere moves most easily at equal volume.
    #[test]
    fn resistance_that_is_proportional_to_the_surface_is_called_so() {
        let list = claims(&measured(|body| body.revolution().surface_area_m2(), 1e-6));
        let verdict = |words: &str| list.iter().find(|claim| claim.claim.contains(words)).unwrap().verdict;
        assert_eq!(verdict("proportional to the surface"), ClaimVerdict::Holds);
        assert_eq!(verdict("at equal volume, the sphere moves easiest"), ClaimVerdict::Holds);
        // At equal surface area all bodies then have equal stiffness.
        assert_eq!(verdict("at equal surface, the horizontal ellipsoid moves easier than"), ClaimVerdict::TooClose);
        let list = claims(&measured(|body| body.revolution().volume_m3(), 1e-6));
        assert_eq!(list[5].verdict, ClaimVerdict::DoesNotHold, "{:?}", list[5]);
    }
}
