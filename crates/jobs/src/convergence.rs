//! Mesh convergence of the bead's stiffness in the gel: a table over refinement levels of the built-in meshes.

use documents::simulation::MeshLevel;
use std::time::Instant;

use base::error::Result;
use elements::fe::Stiffness;
use elements::fe::time::FullOrderModel;
use posterior::mechanics::{exact_stiffness_m, robot_mesh};
use posterior::monitor::Monitor;
use record::{Apparatus, OffsetDirection, Robot, RobotShape};

/// Finest mesh refinement level that a convergence table may have. A finer level would take minutes and several gigabytes to factorise.
pub fn max_refinement_level(apparatus: &Apparatus) -> usize {
    match apparatus {
        Apparatus::Robot { robot: Robot { shape: RobotShape::Sphere { .. }, offset, .. }, .. }
            if offset.is_none_or(|offset| offset.direction == OffsetDirection::Along) =>
        {
            8
        }
        // These meshes have more layers, smaller elements towards a rim, or twice as many elements in a half model.
        _ => 6,
    }
}

/// Computes the convergence table, with one row for each refinement level from 1 to `levels`. The table is empty for an instrument. Adds the wall-clock
/// seconds of each level to `timing_s`.
///
/// # Errors
/// The errors of meshing and factorisation.
pub fn table(
    apparatus: &Apparatus,
    levels: usize,
    monitor: &dyn Monitor,
    timing_s: &mut Vec<(String, f64)>,
) -> Result<Vec<MeshLevel>> {
    let Apparatus::Robot { robot, vitreous } = apparatus else { return Ok(Vec::new()) };
    let exact_m = exact_stiffness_m(robot, vitreous);
    let mut table: Vec<MeshLevel> = Vec::new();
    for level in 1..=levels {
        monitor.stage(&format!("convergence table: mesh level {level} of {levels}"));
        let clock = Instant::now();
        let stiffness = Stiffness::new(&robot_mesh(robot, vitreous, level)?)?;
        let stiffness_m = 1.0 / FullOrderModel::new(&stiffness, vitreous.poisson_ratio)?.compliance_per_m();
        timing_s.push((format!("mesh level {level}"), clock.elapsed().as_secs_f64()));
        let before = table.last();
        let mut line = MeshLevel {
            level,
            unknowns: stiffness.n_unknowns(),
            stiffness_m,
            relative_error: exact_m.map(|exact_m| stiffness_m / exact_m - 1.0),
            relative_difference: before.map(|b| stiffness_m / b.stiffness_m - 1.0),
            order: None,
        };
        line.order = match table.as_slice() {
            [.., b] if exact_m.is_some() => order_of_errors(b, &line),
            [.., a, b] => order_of_differences([a, b, &line]),
            _ => None,
        };
        table.push(line);
    }
    Ok(table)
}

fn order_of_errors(before: &MeshLevel, last: &MeshLevel) -> Option<f64> {
    let ratio = before.relative_error? / last.relative_error?;
    Some(ratio.abs().ln() / (last.level as f64 / before.level as f64).ln())
}

/// Estimates the order p of convergence for errors proportional to level⁻ᵖ. Returns `None` unless the differences between successive levels decrease and
/// have equal signs.
fn order_of_differences(levels: [&MeshLevel; 3]) -> Option<f64> {
    const HIGHEST: f64 = 20.0;
    let ratio = |value: &dyn Fn(&MeshLevel) -> f64| {
        let [a, b, c] = levels.map(value);
        (a - b) / (b - c)
    };
    let found = ratio(&|level| level.stiffness_m);
    // The ratio `at(order)` increases with the order.
    let at = |order: f64| ratio(&|level| (level.level as f64).powf(-order));
    let (mut lower, mut upper) = (1e-3, HIGHEST);
    if !(at(lower)..at(upper)).contains(&found) {
        return None;
    }
    while upper - lower > 1e-6 {
        let middle = 0.5 * (lower + upper);
        *(if at(middle) < found { &mut lower } else { &mut upper }) = middle;
    }
    Some(upper)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values that converge with a known order yield this order. Values that oscillate or diverge have no order.
    #[test]
    fn order_of_three_levels() {
        let level = |level: usize, stiffness_m: f64| MeshLevel {
            level,
            unknowns: 0,
            stiffness_m,
            relative_error: None,
            relative_difference: None,
            order: None,
        };
        let of = |values: [f64; 3]| {
            let levels = [level(2, values[0]), level(3, values[1]), level(4, values[2])];
            order_of_differences([&levels[0], &levels[1], &levels[2]])
        };
        for order in [0.5, 2.0, 4.0] {
            let found = of([2.0, 3.0, 4.0].map(|level: f64| 1.7 - 0.3 * level.powf(-order))).expect("an order");
            assert!((found - order).abs() < 1e-5, "{found} for {order}");
        }
        assert_eq!(of([1.0, 1.2, 1.1]), None);
        assert_eq!(of([1.0, 1.1, 1.5]), None);
        assert_eq!(of([1.0, 1.0, 1.0]), None);
    }
}
