//! Patch tests in the half meridian. Fields that the elements represent exactly must cause no force
//! on nodes inside the patch. Their energy must have its closed form.

use super::basis::gauss_legendre;
use super::element::{Mode, ShapeTable};
use super::geometry::{Curve, Point, Ruled};
use super::{Direction, Formulation};

const ORDER: usize = 4;
const POISSON_RATIO: f64 = 0.48;

/// Displacement components (U, W) or (U, V, W) of a mode at (r, z).
type Field = fn(Point) -> Vec<f64>;

/// Patch of 2 × 2 distorted cells with straight edges. The first starts at r = `start`.
fn patch(start: f64) -> Vec<Ruled> {
    let nodes = [
        [[0.0, 0.0], [0.0, 0.7], [0.0, 1.2]],
        [[0.6, -0.1], [0.5, 0.6], [0.7, 1.1]],
        [[1.1, 0.1], [1.0, 0.5], [1.2, 1.3]],
    ]
    .map(|column| column.map(|[r, z]| [start + r, z]));
    let mut cells = Vec::new();
    for i in 0..2 {
        for j in 0..2 {
            // ξ runs along r and η along z, so that the cell is right-handed.
            let side = |j: usize| Curve::Segment { from: nodes[i][j], to: nodes[i + 1][j] };
            cells.push(Ruled { inner: side(j), outer: side(j + 1), across: [0.0, 1.0] });
        }
    }
    cells
}

/// Returns the position of every node of the patch with the force on it. Also returns twice the
/// strain energy.
fn forces(start: f64, direction: Direction, formulation: Formulation, field: Field) -> (Vec<(Point, Vec<f64>)>, f64) {
    let (table, mode) = (ShapeTable::new(ORDER), Mode::of(direction));
    let (mut nodes, mut energy): (Vec<(Point, Vec<f64>)>, f64) = (Vec::new(), 0.0);
    for map in patch(start) {
        let stiffness = table.stiffness(&map, &mode, POISSON_RATIO, formulation).expect("a sound cell");
        let n = table.n_functions();
        let places: Vec<Point> = table
            .nodes
            .iter()
            .flat_map(|&eta| table.nodes.iter().map(move |&xi| (xi, eta)))
            .map(|(xi, eta)| map.at(xi, eta).0)
            .collect();
        let values: Vec<Vec<f64>> = places.iter().map(|&p| field(p)).collect();
        for (a, &place) in places.iter().enumerate() {
            let force = (0..mode.n_components).map(|c| {
                let row = c * n + a;
                let entry = |column: usize| stiffness[(row.max(column), row.min(column))];
                (0..mode.n_components * n).map(|column| entry(column) * values[column % n][column / n]).sum::<f64>()
            });
            let force: Vec<f64> = force.collect();
            energy += force.iter().zip(&values[a]).map(|(f, u)| f * u).sum::<f64>();
            match nodes.iter_mut().find(|(p, _)| (p[0] - place[0]).hypot(p[1] - place[1]) < 1e-9) {
                Some((_, sum)) => sum.iter_mut().zip(force).for_each(|(s, f)| *s += f),
                None => nodes.push((place, force)),
            }
        }
    }
    (nodes, energy)
}

/// True if a node is not on the patch's outline. It is then inside, or on the axis away from the
/// ends.
fn is_inside(start: f64, [r, z]: Point) -> bool {
    let inside = |r: f64, z: f64| {
        patch(start).iter().any(|map| {
            let corner = |xi: f64, eta: f64| map.at(xi, eta).0;
            let around = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            (0..4).all(|k| {
                let ([r0, z0], [r1, z1]) = (around[k], around[(k + 1) % 4]);
                (r1 - r0) * (z - z0) - (z1 - z0) * (r - r0) >= -1e-12
            })
        })
    };
    let h = 1e-3;
    let left = if r < 1e-12 { 0.0 } else { -h };
    [[left, 0.0], [h, 0.0], [0.0, h], [0.0, -h]].iter().all(|[dr, dz]| inside(r + dr, z + dz))
}

/// Equilibrium fields that fourth-order elements represent: rotation, shear, stretch, and the
/// fourth mode of physics §4.2. The divergence of the fourth mode is linear, so that its stress
/// tests the pressures.
const MODE_0: [Field; 4] = [
    |_| vec![0.0, 1.0],
    |[r, z]| vec![-0.5 * r, z],
    |[r, _]| vec![r, 0.0],
    |[r, z]| {
        vec![
            -2.0 * (2.0 - 3.0 * POISSON_RATIO) * r * z,
            (3.0 - 2.0 * POISSON_RATIO) * (r * r + z * z) - 2.0 * (2.0 - 3.0 * POISSON_RATIO) * z * z,
        ]
    },
];
const MODE_1: [Field; 4] = [
    |[r, z]| vec![1.0 + z, -1.0 - z, -r],
    |[_, z]| vec![z, -z, 0.0],
    |[r, _]| vec![0.0, 0.0, r],
    |[r, z]| {
        let across = (3.0 - 2.0 * POISSON_RATIO) * (r * r + z * z);
        let along = -2.0 * (2.0 - 3.0 * POISSON_RATIO) * r;
        vec![across + along * r, -across, along * z]
    },
];

#[test]
fn fields_in_balance_leave_no_force_inside() {
    for (direction, fields) in [(Direction::Axial, MODE_0), (Direction::Transverse, MODE_1)] {
        for (start, formulation) in
            [0.0, 0.4].into_iter().flat_map(|s| [(s, Formulation::Mixed), (s, Formulation::Displacement)])
        {
            for (k, field) in fields.into_iter().enumerate() {
                let (nodes, _) = forces(start, direction, formulation, field);
                let (mut n_inside, mut largest, mut residual) = (0, 0.0_f64, 0.0_f64);
                for (place, force) in &nodes {
                    let norm = force.iter().map(|f| f.abs()).fold(0.0, f64::max);
                    largest = largest.max(norm);
                    if is_inside(start, *place) {
                        n_inside += 1;
                        // On the axis, only forces that do work on a smooth field are checked: W
                        // for n = 0, and U = −V for n = 1.
                        let allowed = match (place[0] < 1e-12, direction) {
                            (false, _) => norm,
                            (true, Direction::Axial) => force[1].abs(),
                            (true, Direction::Transverse) => (force[0] - force[1]).abs(),
                        };
                        residual = residual.max(allowed);
                    }
                }
                assert!(n_inside >= 49, "{n_inside} nodes inside");
                // Rigid motions cause no force anywhere. The bound allows for rounding of
                // stiffnesses of order λ/E = 8.
                assert!(residual < 1e-11, "{direction:?}, {formulation:?}, field {k}, r ≥ {start}: {residual:e}");
                assert_eq!(k == 0, largest < 1e-10, "{direction:?}, field {k}: {largest:e}");
            }
        }
    }
}

/// Checks twice the energy of uniform strains. It is (2μ ε:ε + λ tr²) ∫ r dr dz, with the squares
/// of the mode's strains without their cosine.
#[test]
fn uniform_strains_have_their_energy() {
    let two_mu = 1.0 / (1.0 + POISSON_RATIO);
    let lambda = two_mu * POISSON_RATIO / (1.0 - 2.0 * POISSON_RATIO);
    let line = gauss_legendre(4);
    for start in [0.0, 0.4] {
        let (mut first, mut third) = (0.0, 0.0);
        for map in patch(start) {
            for &(xi, w_xi) in &line {
                for &(eta, w_eta) in &line {
                    let (at, along, across) = map.at(xi, eta);
                    let area = w_xi * w_eta * (along[0] * across[1] - along[1] * across[0]);
                    first += area * at[0];
                    third += area * at[0].powi(3);
                }
            }
        }
        let cases: [(Direction, Field, f64); 4] = [
            // The field (x, y, z) → (−x/2, −y/2, z).
            (Direction::Axial, MODE_0[1], two_mu * 1.5 * first),
            // The field (x, y, 0) has two strains of 1.
            (Direction::Axial, MODE_0[2], (2.0 * two_mu + 4.0 * lambda) * first),
            // The field u_x = z has γ_xz = 1, that is γ_rz = cos θ and γ_θz = −sin θ.
            (Direction::Transverse, MODE_1[1], two_mu * first),
            // A field quadratic in r, like u_x = x z, u_y = 0 …, in mode 1: W = r² cos θ has
            // γ_rz = 2r cos θ and γ_θz = −r sin θ.
            (Direction::Transverse, |[r, _]| vec![0.0, 0.0, r * r], two_mu * 2.5 * third),
        ];
        for (k, (direction, field, expected)) in cases.into_iter().enumerate() {
            for formulation in [Formulation::Mixed, Formulation::Displacement] {
                let (_, energy) = forces(start, direction, formulation, field);
                assert!(
                    (energy / expected - 1.0).abs() < 1e-12,
                    "case {k}, {formulation:?}: {energy} against {expected}"
                );
            }
        }
    }
}
