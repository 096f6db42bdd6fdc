//! Size of a robot for a target: the largest or the longest robot of a shape that a force moves far enough, and the smallest magnet that is strong enough.

use base::error::{Error, Result, Setting};
use posterior::monitor::Monitor;
use posterior::prepared::KeptSurrogate;
use rayon::prelude::*;
use record::Robot;

use crate::body;
use crate::ensemble::{Ensemble, Gel};
use crate::free_path::free_path_m;
use crate::plan::{Target, best_factor, halves};
use crate::scenario::{Scenario, aspect, diameter_m, resized, slenderer};
use crate::scenario_file::form;

/// Smallest size that is tried, as a factor of the robot's length and diameter.
const SMALLEST: f64 = 0.02;
/// Smallest and largest ratio of length to diameter that is tried.
const ASPECTS: [f64; 2] = [1.0, 20.0];
/// Largest distance of the robot's surface from its centre that is tried, as a fraction of the gel's radius.
const MOST_OF_GEL: f64 = 0.8;
/// Number of sizes that are tried first, with equal ratios between them.
const N_SIZES: usize = 40;
/// Number of sizes whose compliance is computed for the first search, and for the second.
const N_NODES: usize = 12;
const N_NODES_NEAR: usize = 6;
/// Largest factor between the sizes that the two searches find.
const NEAR: f64 = 1.1;
/// Number of halvings between the last size that fails and the first that succeeds.
const HALVINGS: usize = 24;
/// Largest number of searches that confirm a size under a limit of the strain.
const MOST_CONFIRMATIONS: usize = 4;
/// Largest relative difference of sizes that are equal up to rounding.
const SAME_SIZE: f64 = 1e-9;
/// Relative distance from the limit, so that rounding does not lose the draw at the limit.
const MARGIN: f64 = 1e-6;

/// Size that is asked for. Length and diameter keep their ratio, except for the longest robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RobotSize {
    /// The largest robot that the largest force moves to the target.
    Largest,
    /// The longest robot of the given robot's volume that the largest force moves to the target.
    Longest,
    /// The smallest robot that reaches the target if the force grows with its volume, as for a magnet in a field gradient.
    SmallestMagnet {
        /// Force per volume of the robot, in N/m³: magnetisation times field gradient.
        force_per_volume_n_m3: f64,
    },
}

impl RobotSize {
    /// Largest force (N) on a robot.
    pub fn largest_force_n(&self, robot: &Robot, target: &Target) -> f64 {
        match self {
            Self::Largest | Self::Longest => target.largest_force_n,
            Self::SmallestMagnet { force_per_volume_n_m3 } => force_per_volume_n_m3 * robot.shape.volume_m3(),
        }
    }

    /// The robot with another size: a factor of its length and diameter, or of their ratio.
    fn applied(&self, robot: &Robot, factor: f64) -> Robot {
        match self {
            Self::Largest | Self::SmallestMagnet { .. } => resized(robot, factor, factor),
            Self::Longest => slenderer(robot, factor),
        }
    }

    /// True if the search varies two robots over the same sizes, so that it finds one robot for both.
    pub fn is_same_search(&self, one: &Robot, other: &Robot) -> bool {
        let factor = match (self, aspect(one), aspect(other)) {
            (Self::Longest, Some(one), Some(other)) => other / one,
            _ => diameter_m(other) / diameter_m(one),
        };
        let varied = self.applied(one, factor);
        let sizes = |robot: &Robot| [aspect(robot).unwrap_or(1.0), diameter_m(robot)];
        let is_near = |(a, b): (f64, f64)| (a / b - 1.0).abs() < SAME_SIZE;
        form(&varied.shape) == form(&other.shape)
            && (varied.density_kg_m3, varied.offset) == (other.density_kg_m3, other.offset)
            && sizes(&varied).into_iter().zip(sizes(other)).all(is_near)
    }

    /// Smallest and largest factor that is tried.
    fn range(&self, scenario: &Scenario) -> Result<[f64; 2]> {
        let most_m = MOST_OF_GEL * 0.5 * scenario.vitreous.diameter_m;
        match self {
            Self::Largest | Self::SmallestMagnet { .. } => {
                Ok([SMALLEST, most_m / scenario.robot.shape.outer_radius_m()])
            }
            Self::Longest => {
                let aspect = aspect(&scenario.robot).ok_or_else(|| {
                    let remedy = "give an ellipsoid or a cylinder, or ask for the largest robot";
                    Error::input(scenario.place("robot"), "a sphere has no other aspect ratio", remedy)
                })?;
                let fits = (most_m / scenario.robot.shape.outer_radius_m()).powf(1.5);
                Ok([(ASPECTS[0] / aspect).min(1.0), (ASPECTS[1] / aspect).max(1.0).min(fits)])
            }
        }
    }
}

/// Robot of the size that is asked for.
pub struct SizedRobot {
    /// The robot.
    pub robot: Robot,
    /// True if the size is the end of the range that is tried, so that a size beyond it may succeed, too.
    pub is_last_tried: bool,
}

/// Finds the robot of the size that is asked for; `None` if no size reaches the target with the requested probability.
///
/// # Errors
/// [`Error::Input`] for a model with effects, a robot with an offset, a rest or a limited slew rate; errors of the models.
pub fn sized(
    gel: &Gel<'_>,
    scenario: &Scenario,
    target: &Target,
    size: RobotSize,
    kept: Option<KeptSurrogate>,
    monitor: &dyn Monitor,
) -> Result<Option<SizedRobot>> {
    let mut found = sized_from(gel, scenario, target, size, kept.clone(), monitor)?;
    // The strain at a robot is that of its own elements, so that the size is searched again from the one that was found until that one is confirmed.
    for _ in 0..if target.largest_strain.is_some() { MOST_CONFIRMATIONS } else { 0 } {
        let Some(sized) = found else { break };
        let mut from = scenario.clone();
        from.robot = sized.robot;
        let again = sized_from(gel, &from, target, size, kept.clone(), monitor)?;
        let is_confirmed = again.as_ref().is_some_and(|again| match size {
            RobotSize::SmallestMagnet { .. } => diameter_m(&again.robot) <= diameter_m(&sized.robot),
            _ => diameter_m(&again.robot) >= diameter_m(&sized.robot),
        });
        found = if is_confirmed { Some(sized) } else { again };
        if is_confirmed {
            break;
        }
    }
    Ok(found)
}

/// Robot of the size that is asked for, by the elements of the scenario's robot.
fn sized_from(
    gel: &Gel<'_>,
    scenario: &Scenario,
    target: &Target,
    size: RobotSize,
    kept: Option<KeptSurrogate>,
    monitor: &dyn Monitor,
) -> Result<Option<SizedRobot>> {
    let refuse = |found: &str, remedy: String| Err(Error::input(scenario.place("robot"), found, remedy));
    if !(gel.problem.model.is_law_alone() && scenario.effects.is_empty()) {
        return refuse(
            "the size is searched for models without effects, and this one has some",
            format!("give a revision without effects (`{} m0`), or plan for robots of given sizes", Setting::Revision),
        );
    }
    if target.rest.is_some() || target.slew_n_per_s.is_some() {
        let remedy = "leave out the rest and the slew rate, then plan again with them for the robot that is found";
        return refuse("the size is searched for a constant force", remedy.into());
    }
    if size == RobotSize::Longest && target.largest_strain.is_some() {
        let remedy = "leave out the limit of the strain, then plan again with it for the robot that is found";
        return refuse("the longest robot is searched without a limit of the strain", remedy.into());
    }
    let [smallest, largest] = size.range(scenario)?;
    let reference = body::compliance_per_m(&scenario.robot, &scenario.vitreous);
    let Some((reference_per_m, _)) = reference else {
        return refuse("the size is searched for robots in the middle of the gel", "remove the offset".into());
    };
    let [planned, _] = halves(&gel.draws);
    let planned = Gel { draws: planned, ..*gel };
    let force_n = size.largest_force_n(&scenario.robot, target);
    let record = Target { largest_force_n: force_n, ..*target }.at_largest_force()?;
    let ensemble = Ensemble::new(&planned, scenario, record, kept, monitor)?;
    let trajectories_m = ensemble.trajectories_m(0..ensemble.parameters.len())?;
    monitor.stage("searching for the size of the robot");
    // The law is linear: all trajectories of a size are those of the given robot times one factor.
    let range = |x: &Vec<f64>| target.succeeding_factors(ensemble.record(), x, ensemble.strain_per_m);
    let ranges: Vec<[f64; 2]> = trajectories_m.iter().map(range).collect();
    let is_met = |factor: f64, compliance_per_m: Option<f64>, limits_strain: bool| {
        let robot = size.applied(&scenario.robot, factor);
        if target.reach_m.abs() >= free_path_m(&robot, &scenario.vitreous) {
            return false;
        }
        let Some(compliance_per_m) = compliance_per_m else { return false };
        let times = compliance_per_m / reference_per_m * size.largest_force_n(&robot, target) / force_n;
        // Strain per displacement falls with the size of the body.
        let of_size: Vec<[f64; 2]> = ranges
            .iter()
            .map(|[reached, strained]| [*reached, if limits_strain { strained * factor } else { f64::INFINITY }])
            .collect();
        best_factor(&of_size, target.probability, times).1 >= target.probability - 1e-12
    };
    if largest <= smallest {
        return Ok(None);
    }
    let computed = |factor: f64| {
        body::compliance_per_m(&size.applied(&scenario.robot, factor), &scenario.vitreous).map(|(per_m, _)| per_m)
    };
    let search = Search { size, limits_strain: target.largest_strain.is_some(), is_met: &is_met };
    let all = [smallest, largest];
    // Few sizes are computed: the search by a polynomial through them is repeated near the size that it finds. If the two disagree, every size is computed.
    let near = || {
        // Sizes between the limits of force and strain may lie in several ranges.
        if search.limits_strain {
            return None;
        }
        let found = search.run(all, &Interpolated::through(all, N_NODES, &computed)?.compliance())?;
        if found.is_last_tried {
            return search.is_met_at(found.succeeds, computed(found.succeeds)).then_some(found);
        }
        let near = [smallest.max(found.succeeds / NEAR), largest.min(found.succeeds * NEAR)];
        let again = search.run(near, &Interpolated::through(near, N_NODES_NEAR, &computed)?.compliance())?;
        (!again.is_last_tried).then_some(again)
    };
    let Some(Found { succeeds, fails, is_last_tried }) = near().or_else(|| search.run(all, &computed)) else {
        return Ok(None);
    };
    if is_last_tried {
        return Ok(Some(SizedRobot { robot: size.applied(&scenario.robot, succeeds), is_last_tried }));
    }
    let towards = (succeeds - fails).signum();
    let factor = match size {
        RobotSize::Largest | RobotSize::SmallestMagnet { .. } => {
            let diameter_m = diameter_m(&scenario.robot);
            rounded(diameter_m * succeeds * (1.0 + MARGIN * towards), towards) / diameter_m
        }
        RobotSize::Longest => succeeds * (1.0 + MARGIN * towards),
    };
    Ok(Some(SizedRobot { robot: size.applied(&scenario.robot, factor), is_last_tried: false }))
}

/// Search for a size, as a factor.
struct Search<'a> {
    size: RobotSize,
    limits_strain: bool,
    /// Whether a factor with this compliance (1/m) succeeds, with or without the limit of the strain.
    is_met: &'a (dyn Fn(f64, Option<f64>, bool) -> bool + Sync),
}

/// Factor that succeeds, and one beside it that fails; the two are equal if it is the last that was tried.
struct Found {
    succeeds: f64,
    fails: f64,
    is_last_tried: bool,
}

impl Search<'_> {
    fn is_met_at(&self, factor: f64, compliance_per_m: Option<f64>) -> bool {
        (self.is_met)(factor, compliance_per_m, true)
    }

    /// The factor that is asked for in a range, with the compliance (1/m) of each factor; `None` if none succeeds.
    fn run(
        &self,
        [smallest, largest]: [f64; 2],
        compliance_per_m: &(dyn Fn(f64) -> Option<f64> + Sync),
    ) -> Option<Found> {
        let sizes = |[from, to]: [f64; 2]| -> Vec<f64> {
            (0..N_SIZES).map(|k| from * (to / from).powf(k as f64 / (N_SIZES - 1) as f64)).collect()
        };
        // Index of the size that is asked for among `sizes` by whether each succeeds, and that of the next one beyond it.
        let chosen = |succeeds: &[bool]| match self.size {
            RobotSize::Largest | RobotSize::Longest => {
                succeeds.iter().rposition(|met| *met).map(|k| (k, (k + 1).min(N_SIZES - 1)))
            }
            RobotSize::SmallestMagnet { .. } => succeeds.iter().position(|met| *met).map(|k| (k, k.saturating_sub(1))),
        };
        let tried = |sizes: &[f64], limits_strain: bool| -> Vec<bool> {
            sizes.par_iter().map(|factor| (self.is_met)(*factor, compliance_per_m(*factor), limits_strain)).collect()
        };
        let mut all = sizes([smallest, largest]);
        let mut found = chosen(&tried(&all, true));
        if found.is_none()
            && self.limits_strain
            && let Some((reached, beyond)) = chosen(&tried(&all, false))
        {
            // The sizes that reach the target without too large a strain may all lie between two of those that were tried.
            let [first, last] =
                [reached.min(beyond).saturating_sub(1), reached.max(beyond).saturating_add(1).min(N_SIZES - 1)];
            all = sizes([all[first], all[last]]);
            found = chosen(&tried(&all, true));
        }
        let (success, failure) = found?;
        let [mut succeeds, mut fails] = [all[success], all[failure]];
        for _ in 0..if success == failure { 0 } else { HALVINGS } {
            let middle = (succeeds * fails).sqrt();
            *(if self.is_met_at(middle, compliance_per_m(middle)) { &mut succeeds } else { &mut fails }) = middle;
        }
        Some(Found { succeeds, fails, is_last_tried: success == failure })
    }
}

/// Logarithm of the compliance (1/m) at the Chebyshev points of the logarithm of a factor.
struct Interpolated {
    middle: f64,
    half: f64,
    ln_per_m: Vec<f64>,
}

impl Interpolated {
    /// Computes the compliances (1/m) of `n_nodes` factors; `None` if one of them cannot be computed.
    fn through([from, to]: [f64; 2], n_nodes: usize, computed: &(dyn Fn(f64) -> Option<f64> + Sync)) -> Option<Self> {
        let [middle, half] = [0.5 * (from.ln() + to.ln()), 0.5 * (to.ln() - from.ln())];
        let at_node = |k: usize| Some(computed((middle + half * Self::angle(k, n_nodes).cos()).exp())?.ln());
        let ln_per_m = (0..n_nodes).into_par_iter().map(at_node).collect::<Option<Vec<f64>>>()?;
        Some(Self { middle, half, ln_per_m })
    }

    fn angle(k: usize, n_nodes: usize) -> f64 {
        std::f64::consts::PI * (k as f64 + 0.5) / n_nodes as f64
    }

    /// The compliance (1/m) by the second barycentric formula (Berrut and Trefethen 2004).
    fn compliance(&self) -> impl Fn(f64) -> Option<f64> + Sync {
        |factor: f64| {
            let x = (factor.ln() - self.middle) / self.half;
            let (mut above, mut below) = (0.0, 0.0);
            for (k, ln_per_m) in self.ln_per_m.iter().enumerate() {
                let angle = Self::angle(k, self.ln_per_m.len());
                let distance = x - angle.cos();
                if distance == 0.0 {
                    return Some(ln_per_m.exp());
                }
                let weight = if k % 2 == 0 { angle.sin() } else { -angle.sin() } / distance;
                above += weight * ln_per_m;
                below += weight;
            }
            Some((above / below).exp())
        }
    }
}

/// A length with four significant digits, rounded up or down.
fn rounded(length_m: f64, towards: f64) -> f64 {
    let unit = 10f64.powi(length_m.log10().floor() as i32 - 3);
    let digits = length_m / unit;
    unit * if towards > 0.0 { digits.ceil() } else { digits.floor() }
}

#[cfg(test)]
mod tests {
    use super::{Interpolated, RobotSize, rounded, slenderer};
    use record::{Orientation, Robot, RobotShape};

    /// The longest robot depends on the volume, the largest one on the ratio of length to diameter.
    #[test]
    fn robots_of_one_search_differ_in_the_searched_size_only() {
        let cylinder = |length_m: f64, diameter_m: f64, orientation| {
            let shape = RobotShape::Cylinder { length_m, diameter_m, orientation };
            Robot { shape, density_kg_m3: None, offset: None }
        };
        let one = cylinder(2e-3, 0.2e-3, Orientation::Horizontal);
        let (slender, large) = (slenderer(&one, 2.0), cylinder(4e-3, 0.4e-3, Orientation::Horizontal));
        assert!(
            RobotSize::Longest.is_same_search(&one, &slender) && !RobotSize::Largest.is_same_search(&one, &slender)
        );
        assert!(RobotSize::Largest.is_same_search(&one, &large) && !RobotSize::Longest.is_same_search(&one, &large));
        let vertical = cylinder(2e-3, 0.2e-3, Orientation::Vertical);
        assert!(!RobotSize::Longest.is_same_search(&one, &vertical));
    }

    /// Compares interpolated compliances with a sphere's in closed form, in a gel of finite size (Happel and Brenner 1983).
    #[test]
    fn compliances_between_computed_sizes_are_interpolated() {
        let exact = |factor: f64| {
            let ratio: f64 = 0.01 * factor;
            let wall = (1.0 - 2.25 * ratio + 2.5 * ratio.powi(3) - 2.25 * ratio.powi(5) + ratio.powi(6))
                / (1.0 - ratio.powi(5));
            Some(wall / factor)
        };
        for (range, n_nodes, tolerance) in
            [([0.02, 60.0], super::N_NODES, 0.03), ([9.0, 11.0], super::N_NODES_NEAR, 1e-8)]
        {
            let interpolated = Interpolated::through(range, n_nodes, &exact).expect("compliances");
            for k in 0..=50 {
                let factor = range[0] * (range[1] / range[0]).powf(f64::from(k) / 50.0);
                let ratio =
                    interpolated.compliance()(factor).expect("a compliance") / exact(factor).expect("a compliance");
                assert!((ratio - 1.0).abs() < tolerance, "{factor}: {ratio}");
            }
        }
        assert!(Interpolated::through([1.0, 2.0], 3, &|factor| (factor < 1.5).then_some(1.0)).is_none());
    }

    #[test]
    fn lengths_are_rounded_towards_success() {
        assert!((rounded(1.809_165e-3, -1.0) - 1.809e-3).abs() < 1e-12);
        assert!((rounded(0.298_066e-3, 1.0) - 0.2981e-3).abs() < 1e-12);
    }
}
