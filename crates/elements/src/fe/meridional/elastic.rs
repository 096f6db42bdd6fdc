//! An elastic robot. Its inside is meshed as well. The force is distributed over its volume, like a
//! magnetic force.
//!
//! The paper uses this model and ties every point of the robot's surface to the gel's. In the limit
//! of an infinite stiffness the robot is a rigid body.

use faer::sparse::Triplet;
use rayon::prelude::*;

use super::element::{Mode, ShapeTable};
use super::geometry::{Curve, Ruled};
use super::mesh::{Boundary, Cell, Mesh};
use super::solver::{Condensed, Freedom, Skeleton, condense, edges_of, freedoms, solve_sparse, translation};
use super::{BodyOfRevolution, Direction, Resolution};
use base::error::Result;

/// Elastic material of the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElasticRobot {
    /// Young's modulus of the robot divided by that of the gel.
    pub modulus_ratio: f64,
    /// Poisson ratio of the robot.
    pub poisson_ratio: f64,
}

/// Computes the stiffness of the gel for an elastic robot, in m. It is force / (mean displacement
/// of the robot × Young's modulus of the gel). The force is distributed evenly over the robot's
/// volume.
///
/// # Errors
/// Those of [`super::solve`].
pub fn solve_elastic(
    body: BodyOfRevolution,
    robot: ElasticRobot,
    outer_radius_m: f64,
    poisson_ratio: f64,
    direction: Direction,
    resolution: Resolution,
) -> Result<f64> {
    let Resolution { order, rim_layers, formulation } = resolution;
    let mut mesh = body.mesh(outer_radius_m, rim_layers);
    let n_gel = mesh.cells.len();
    add_inside(&mut mesh);
    let (table, mode) = (ShapeTable::new(order), Mode::of(direction));
    let skeleton = Skeleton::new(&mesh, order);
    let (freedoms, n_skeleton) = freedoms(&skeleton.boundaries, direction, false);
    let condensed = |(index, cell): (usize, &Cell)| {
        let is_robot = index >= n_gel;
        let (modulus, ratio) = if is_robot { (robot.modulus_ratio, robot.poisson_ratio) } else { (1.0, poisson_ratio) };
        let mut stiffness = table.stiffness(&cell.map, &mode, ratio, formulation)?;
        (0..stiffness.ncols())
            .for_each(|b| stiffness.col_as_slice_mut(b).iter_mut().for_each(|entry| *entry *= modulus));
        let mut load = vec![0.0; stiffness.nrows()];
        if is_robot {
            let integrals = table.integrals(&cell.map)?;
            for (part, t) in load.chunks_exact_mut(integrals.len()).zip(translation(direction)) {
                part.iter_mut().zip(&integrals).for_each(|(entry, integral)| *entry = t * integral);
            }
        }
        condense(&stiffness, &load, &skeleton.nodes(cell), mode.n_components)
    };
    let cells: Vec<Condensed> = mesh.cells.par_iter().enumerate().map(condensed).collect::<Result<_>>()?;
    let local = |cell: &Condensed| -> Vec<Freedom> {
        let by_component = |c: usize| cell.nodes.iter().map(move |&node| (node, c));
        (0..mode.n_components).flat_map(by_component).map(|(node, c)| freedoms[node][c]).collect()
    };
    let mut load = vec![0.0; n_skeleton];
    let mut triplets = Vec::new();
    let mut work = 0.0;
    for cell in &cells {
        let local = local(cell);
        work += cell.work;
        for (b, column) in local.iter().enumerate() {
            let Some(j) = column.unknown else { continue };
            load[j] += column.factor * cell.load[b];
            for (row, entry) in local.iter().zip(cell.stiffness.col_as_slice(b)) {
                if let Some(i) = row.unknown.filter(|i| *i >= j) {
                    triplets.push(Triplet::new(i as u32, j as u32, row.factor * column.factor * entry));
                }
            }
        }
    }
    let displacement = solve_sparse(n_skeleton, &triplets, load.clone())?;
    work += displacement.iter().zip(&load).map(|(u, f)| u * f).sum::<f64>();
    // Let the force per volume be 1. The total force then equals the volume. With both halves,
    // force × mean displacement is 2 × `mode.circle` × `work`.
    Ok(body.volume_m3().powi(2) / (2.0 * mode.circle * work))
}

/// Adds the cells inside the robot to a mesh of the gel. Each cell reaches from the robot's centre
/// to one edge on its surface.
fn add_inside(mesh: &mut Mesh) {
    let mut surface: Vec<([usize; 2], Curve)> = Vec::new();
    for cell in &mesh.cells {
        for (index, [a, b]) in edges_of(cell).into_iter().enumerate() {
            if a == b || !mesh.boundaries[a].body || !mesh.boundaries[b].body {
                continue;
            }
            let curve =
                if index == 0 { cell.map.inner } else { Curve::Segment { from: mesh.points[a], to: mesh.points[b] } };
            surface.push(([a, b], curve));
        }
    }
    let centre = mesh.vertex([0.0; 2], Boundary::INSIDE);
    for ([a, b], curve) in surface {
        // The curve must run from the axis towards the equator, as seen from the centre.
        let (middle, along) = curve.at(0.5);
        let (ends, outer) =
            if along[0] * middle[1] - along[1] * middle[0] > 0.0 { ([a, b], curve) } else { ([b, a], reversed(curve)) };
        mesh.cells.push(Cell {
            vertices: [centre, centre, ends[0], ends[1]],
            map: Ruled { inner: Curve::Segment { from: [0.0; 2], to: [0.0; 2] }, outer, across: [0.0, 1.0] },
        });
    }
}

fn reversed(curve: Curve) -> Curve {
    match curve {
        Curve::Segment { from, to } => Curve::Segment { from: to, to: from },
        Curve::Arc { centre, semi_axes, from_rad, to_rad } => {
            Curve::Arc { centre, semi_axes, from_rad: to_rad, to_rad: from_rad }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::super::solve;
    use super::*;

    const OUTER_M: f64 = 10e-3;

    fn bodies() -> [BodyOfRevolution; 3] {
        let volume = 4.0 / 3.0 * PI * 0.275e-3_f64.powi(3);
        let sized = |unit: BodyOfRevolution| unit.scaled((volume / unit.volume_m3()).cbrt());
        [
            BodyOfRevolution::sphere(0.275e-3),
            sized(BodyOfRevolution::Spheroid { semi_axis_along_m: 68.0 / 7.0, semi_axis_across_m: 1.0 }),
            sized(BodyOfRevolution::Cylinder { length_m: 68.0 / 7.0, diameter_m: 1.0 }),
        ]
    }

    /// Checks that the gel resists an elastic robot less than a rigid one, by a fraction that falls
    /// with the robot's modulus, finally in inverse proportion. At 10³ times the gel's modulus the
    /// fraction is below 0.1, for a slender robot that bends across the force. At 10⁴ times the
    /// modulus it is below 0.02. For a magnet with 10¹⁰ times the modulus it is below 2·10⁻⁸.
    #[test]
    fn a_stiff_robot_is_a_rigid_one() {
        let resolution = Resolution { order: 6, rim_layers: 3, ..Resolution::default() };
        for body in bodies() {
            for direction in [Direction::Axial, Direction::Transverse] {
                let rigid = solve(body, OUTER_M, 0.48, direction, resolution).unwrap().stiffness_m;
                let share = |modulus_ratio: f64| {
                    let robot = ElasticRobot { modulus_ratio, poisson_ratio: 0.3 };
                    1.0 - solve_elastic(body, robot, OUTER_M, 0.48, direction, resolution).unwrap() / rigid
                };
                let (soft, stiff) = (share(1e3), share(1e4));
                assert!(0.0 < stiff && 3.0 * stiff < soft, "{body:?} {direction:?}: {soft} {stiff}");
                assert!(soft < 0.1 && stiff < 0.02, "{body:?} {direction:?}: {soft} {stiff}");
            }
        }
    }

    /// Checks the stiffness for a spherical robot with the elastic moduli of the gel. Robot and gel
    /// are then one homogeneous medium with a force on the volume of a ball. In an unbounded medium
    /// the mean displacement of the ball is Kelvin's solution, averaged over all pairs of points in
    /// the ball. The stiffness is then 5/6 of the stiffness for a rigid sphere.
    #[test]
    fn a_robot_of_gel_moves_as_kelvin_says() {
        let (poisson_ratio, radius_m) = (0.3, 0.275e-3);
        let mu = 1.0 / (2.0 * (1.0 + poisson_ratio));
        let rigid = 24.0 * PI * mu * radius_m * (1.0 - poisson_ratio) / (5.0 - 6.0 * poisson_ratio);
        let robot = ElasticRobot { modulus_ratio: 1.0, poisson_ratio };
        let resolution = Resolution { order: 8, ..Resolution::default() };
        for direction in [Direction::Axial, Direction::Transverse] {
            let body = BodyOfRevolution::sphere(radius_m);
            let found = solve_elastic(body, robot, 1e4 * radius_m, poisson_ratio, direction, resolution).unwrap();
            assert!((found / (rigid * 5.0 / 6.0) - 1.0).abs() < 3e-4, "{direction:?}: {found} {rigid}");
        }
    }
}
