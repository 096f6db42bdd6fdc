//! Bodies that move along the force in a gel with large strains (physics §7.6). The study tests whether the paper's orderings persist when bodies move by their
//! own lengths.
//!
//! Only bodies that move along their axis of revolution are meshed for large strains. The gel is bonded to them, so strains at a slender tip or sharp rim are
//! far larger than around a sphere. The mesh can follow such bodies only for a limited time, and they are compared up to that time. Small strains do not
//! determine the large-strain fluid, so the computation in the Oldroyd-B fluid is repeated in a Giesekus fluid.

use rayon::prelude::*;

use super::bodies::StudyBody;
use super::claims::{easier, verdict_of};
use base::error::Result;
use documents::shapes::{BodyShape, Claim, ClaimVerdict, LargeShape, LargeStrains, SizeRule};
use elements::fe::meridional::{Resolution, solve};
use elements::fe::oldroyd::{Discretisation, FiniteGel, FiniteInput, FiniteLaw, VolumeRule};
use laws::stages::Stages;
use posterior::monitor::{Counter, Monitor};
use record::{Force, Orientation};

/// Aspect ratios of additional ellipsoids. The mesh can follow them over large distances.
const ASPECTS: [f64; 2] = [1.5, 2.0];
/// Mobility of the Giesekus fluid with which the computation is repeated.
pub const OTHER_MOBILITY: f64 = 0.1;

/// Input of the computation at large strains: gel, size of the bodies, and force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LargeShapeSetting {
    /// Diameter of the sphere whose volume or surface area the other bodies have, in m.
    pub sphere_diameter_m: f64,
    /// Radius of the gel, in m.
    pub outer_radius_m: f64,
    /// Poisson ratio of the gel at small strains.
    pub poisson_ratio: f64,
    /// Length divided by diameter of the study's bodies.
    pub aspect: f64,
    /// Force on the bodies, in N.
    pub force_n: f64,
}

/// Motion of a body during one hold, as far as the mesh can follow it.
struct BodyMotion {
    body: StudyBody,
    aspect: f64,
    /// Displacement by the small-strain model (m), at every row of the hold.
    small_m: Vec<f64>,
    /// Displacement in the Oldroyd-B fluid minus `small_m` (m), at the rows up to which the mesh can follow.
    deviation_m: Vec<f64>,
    /// Numerical error of `deviation_m` at each of its rows, in m.
    error_m: Vec<f64>,
    /// Displacement in the Giesekus fluid minus `small_m` (m); `None` if the Oldroyd-B run ended early.
    other_deviation_m: Option<Vec<f64>>,
}

impl BodyMotion {
    /// Number of rows that the meshes of both resolutions can follow.
    fn n_rows(&self) -> usize {
        self.error_m.len()
    }

    fn is_whole(&self) -> bool {
        self.n_rows() == self.small_m.len()
    }

    /// Displacement (m) at a row in the Oldroyd-B fluid.
    fn at_m(&self, row: usize) -> f64 {
        self.small_m[row] + self.deviation_m[row]
    }

    /// Displacement (m) at a row in the Giesekus fluid; `None` if the mesh could not follow up to this row.
    fn other_m(&self, row: usize) -> Option<f64> {
        Some(self.small_m[row] + self.other_deviation_m.as_ref()?.get(row)?)
    }

    fn summary(&self, time_s: &[f64]) -> Option<LargeShape> {
        let last = self.n_rows().checked_sub(1)?;
        let [length_m, diameter_m] = self.body.sizes_m();
        let um = |x: f64| 1e6 * x;
        Some(LargeShape {
            shape: self.body.shape,
            size_rule: self.body.rule,
            aspect: self.aspect,
            followed_s: time_s[last],
            is_whole: self.is_whole(),
            small_strains_um: um(self.small_m[last]),
            deviation_um: um(self.deviation_m[last]),
            error_um: um(self.error_m[last]),
            deviation_with_mobility_um: self.other_m(last).map(|x| um(x - self.small_m[last])),
            radii_moved: self.at_m(last) / (0.5 * diameter_m),
            lengths_moved: self.at_m(last) / length_m,
        })
    }
}

/// Resolutions of a body's mesh: first a fine resolution, whose results are reported, then a coarser one, which shows the error.
fn fine_and_coarse_resolution(shape: BodyShape) -> [Discretisation; 2] {
    let of_order = |order| Discretisation { order, ..Discretisation::ESTIMATE };
    match shape {
        BodyShape::Cylinder => [of_order(4), of_order(3)],
        _ => [of_order(6), of_order(5)],
    }
}

fn follow(
    setting: &LargeShapeSetting,
    laws: &[FiniteLaw; 2],
    rows: (&[f64], &[f64]),
    (body, aspect): (StudyBody, f64),
    force_per_pa: &[f64],
) -> Result<BodyMotion> {
    let LargeShapeSetting { outer_radius_m, poisson_ratio, .. } = *setting;
    let (time_s, force_n) = rows;
    let load = Stages::of_law(Vec::new()).load;
    let deviation_m = |fineness: Discretisation, law: &FiniteLaw| -> Result<Vec<f64>> {
        let gel = FiniteGel::new(body.revolution(), outer_radius_m, VolumeRule::Incompressible, fineness)?;
        let (run, _) = gel.run_until_failure(&FiniteInput { law, load: &load, time_s, force: Force::from(force_n) })?;
        Ok(run.deviation_m)
    };
    let [fine, coarse] = fine_and_coarse_resolution(body.shape);
    let (values, coarser) = (deviation_m(fine, &laws[0])?, deviation_m(coarse, &laws[0])?);
    let is_whole = values.len().min(coarser.len()) == time_s.len();
    let resolution = Resolution::default();
    let stiffness_m =
        solve(body.revolution(), outer_radius_m, poisson_ratio, body.direction(), resolution)?.stiffness_m;
    Ok(BodyMotion {
        body,
        aspect,
        small_m: force_per_pa.iter().map(|x| x / stiffness_m).collect(),
        error_m: values.iter().zip(&coarser).map(|(a, b)| (a - b).abs()).collect(),
        deviation_m: values,
        other_deviation_m: if is_whole { Some(deviation_m(coarse, &laws[1])?) } else { None },
    })
}

/// Computes the motion of the bodies during one hold. `time_s` holds the times of the hold. `force_per_pa` holds the small-strain position times stiffness
/// (N/Pa) at each of them.
///
/// # Errors
/// Errors of meshes. A mesh that cannot follow a body further causes no error.
pub fn run(
    setting: &LargeShapeSetting,
    law: &FiniteLaw,
    time_s: &[f64],
    force_per_pa: &[f64],
    monitor: &dyn Monitor,
) -> Result<LargeStrains> {
    let mut laws = [law.clone(), law.clone()];
    laws[1].mobility = OTHER_MOBILITY;
    let LargeShapeSetting { sphere_diameter_m, aspect: value, force_n, .. } = *setting;
    let force_n = vec![force_n; time_s.len()];
    let mut aspects: Vec<f64> = ASPECTS.into_iter().filter(|aspect| *aspect != value).chain([value]).collect();
    aspects.sort_by(f64::total_cmp);
    let body = |shape: BodyShape, rule: SizeRule, aspect: f64| {
        (StudyBody::new((shape, Orientation::Horizontal), aspect, rule, sphere_diameter_m), aspect)
    };
    // A sphere has one size under both rules.
    let mut all = vec![body(BodyShape::Sphere, SizeRule::EqualVolume, 1.0)];
    for rule in SizeRule::ALL {
        all.extend(aspects.iter().map(|aspect| body(BodyShape::Ellipsoid, rule, *aspect)));
        all.push(body(BodyShape::Cylinder, rule, value));
    }
    let counter = Counter::new(monitor, all.len());
    let one = |pair: &(StudyBody, f64)| {
        let followed = follow(setting, &laws, (time_s, &force_n), *pair, force_per_pa)?;
        counter.add_one();
        Ok(followed)
    };
    let followed: Vec<BodyMotion> = all.par_iter().map(one).collect::<Result<_>>()?;
    let mut claims = Vec::new();
    for rule in SizeRule::ALL {
        let is_of_rule = |followed_body: &&BodyMotion| {
            followed_body.body.rule == rule || followed_body.body.shape == BodyShape::Sphere
        };
        let of_rule: Vec<&BodyMotion> = followed.iter().filter(is_of_rule).collect();
        claims.extend(sphere_is_easiest(rule, &of_rule));
        claims.extend(ellipsoid_before_cylinder(rule, &of_rule, value, time_s));
    }
    Ok(LargeStrains {
        other_mobility: OTHER_MOBILITY,
        bodies: followed.iter().filter_map(|followed_body| followed_body.summary(time_s)).collect(),
        claims,
    })
}

/// Tests whether the body `first` moves farther than each body in `others` at one time of the hold (index `row`). A claim that holds in only one of the two
/// fluids is undecided.
fn judge(claim: String, first: &BodyMotion, others: &[&BodyMotion], row: usize, numbers: String) -> Claim {
    let sd = |other: &BodyMotion| first.error_m[row].hypot(other.error_m[row]);
    let probability: f64 = others.iter().map(|other| easier(first.at_m(row), other.at_m(row), sd(other))).product();
    let in_other = others.iter().map(|other| Some(easier(first.other_m(row)?, other.other_m(row)?, sd(other))));
    let verdict = verdict_of(probability);
    match in_other.product::<Option<f64>>() {
        Some(other) if verdict_of(other) != verdict => {
            let numbers = format!("{numbers}; the two fluids give different verdicts");
            Claim { claim, verdict: ClaimVerdict::TooClose, probability, numbers }
        }
        _ => Claim { claim, verdict, probability, numbers },
    }
}

/// Claim that the sphere moves most easily. It is compared with the ellipsoids that the mesh could follow to the end of the hold.
fn sphere_is_easiest(rule: SizeRule, all: &[&BodyMotion]) -> Option<Claim> {
    let sphere =
        all.iter().find(|followed_body| followed_body.body.shape == BodyShape::Sphere && followed_body.is_whole())?;
    let others: Vec<&BodyMotion> = all
        .iter()
        .filter(|followed_body| followed_body.body.shape == BodyShape::Ellipsoid && followed_body.is_whole())
        .copied()
        .collect();
    let row = sphere.small_m.len() - 1;
    if others.is_empty() {
        return None;
    }
    let ratios = |followed_body: &&BodyMotion| {
        let small = followed_body.small_m[row] / sphere.small_m[row];
        let large = followed_body.at_m(row) / sphere.at_m(row);
        let other = followed_body.other_m(row).zip(sphere.other_m(row)).map(|(value, sphere)| value / sphere);
        let other = other.map_or(String::new(), |other| format!(", with mobility {other:.4}"));
        format!("{:.2}: {large:.4} (small strains {small:.4}{other})", followed_body.aspect)
    };
    let numbers: Vec<String> = others.iter().map(ratios).collect();
    let numbers = format!("displacement over the sphere's, by aspect ratio: {}", numbers.join("; "));
    let claim = format!("at {}, the sphere moves easiest of the ellipsoids along the force", rule.title());
    Some(judge(claim, sphere, &others, row, numbers))
}

/// Claim that the ellipsoid moves more easily than the cylinder. It is tested at the last time up to which the mesh could follow both.
fn ellipsoid_before_cylinder(rule: SizeRule, all: &[&BodyMotion], aspect: f64, time_s: &[f64]) -> Option<Claim> {
    let find = |shape: BodyShape| {
        all.iter().find(|followed_body| followed_body.body.shape == shape && followed_body.aspect == aspect).copied()
    };
    let (ellipsoid, cylinder) = (find(BodyShape::Ellipsoid)?, find(BodyShape::Cylinder)?);
    let row = ellipsoid.n_rows().min(cylinder.n_rows()).checked_sub(1).filter(|row| *row > 0)?;
    let way = |followed_body: &BodyMotion| {
        format!("{:.1} µm (small strains {:.1})", 1e6 * followed_body.at_m(row), 1e6 * followed_body.small_m[row])
    };
    let claim = format!(
        "at {}, the horizontal ellipsoid moves easier than the horizontal cylinder, up to {:.2} s",
        rule.title(),
        time_s[row]
    );
    let numbers = format!("{} against {}", way(ellipsoid), way(cylinder));
    Some(judge(claim, ellipsoid, &[cylinder], row, numbers))
}
