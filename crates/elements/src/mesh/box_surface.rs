//! Connectivity of the built-in meshes: elements on the surface of a box, repeated in layers from
//! the robot to the outer surface.

use std::collections::HashMap;

use super::{ElementKind, HEXAHEDRON27_REFERENCE_NODES, Mesh};
use record::Orientation;

/// Nine-node quadrilaterals on the surface of a box around the origin, of which only the quarter
/// y ≥ 0, z ≥ 0 is used.
///
/// Nodes are integer points of the box, two steps per element, so that its faces share the nodes on
/// their edges exactly. The built-in meshes differ only in the positions that they give these
/// points. A mesh whose positions treat x, y and z alike is symmetric to the last bit.
pub(super) struct BoxSurface {
    /// Half the box's width along each axis, in steps of the integer grid.
    pub half_width: [i32; 3],
    points: Vec<[i32; 3]>,
    /// 3 × 3 nodes of each quadrilateral, first index fastest. The cross product of the first and
    /// the second direction points outwards.
    quads: Vec<[u32; 9]>,
}

impl BoxSurface {
    /// Builds the surface. `n_elements` is the number of elements along half the box's width on
    /// each axis.
    pub fn new(n_elements: [usize; 3]) -> Self {
        let half_width = n_elements.map(|n| 2 * n as i32);
        let mut surface = Self { half_width, points: Vec::new(), quads: Vec::new() };
        let mut node_of = HashMap::new();
        // Faces +x, −x, +y, +z as (first axis, second axis, normal axis, side). First × second is
        // the outward normal.
        for (first, second, normal, side) in [(1, 2, 0, 1), (2, 1, 0, -1), (2, 0, 1, 1), (0, 1, 2, 1)] {
            let start = |axis: usize| if axis == 0 { -half_width[0] } else { 0 };
            for j in (start(second)..half_width[second]).step_by(2) {
                for i in (start(first)..half_width[first]).step_by(2) {
                    surface.quads.push(std::array::from_fn(|k| {
                        let mut point = [0; 3];
                        point[normal] = side * half_width[normal];
                        point[first] = i + (k % 3) as i32;
                        point[second] = j + (k / 3) as i32;
                        *node_of.entry(point).or_insert_with(|| {
                            surface.points.push(point);
                            surface.points.len() as u32 - 1
                        })
                    }));
                }
            }
        }
        surface
    }

    /// Builds `n_layers` layers of elements between 2 · `n_layers` + 1 sheets of nodes. The first
    /// sheet is on the robot, the last on the outer surface.
    ///
    /// `place_m` returns the coordinates (m) of a point of the box on a sheet. It must be odd in
    /// every coordinate, so that points with y = 0 or z = 0 lie on the symmetry planes.
    pub fn layered(&self, n_layers: usize, place_m: impl Fn([i32; 3], usize) -> [f64; 3]) -> Mesh {
        let n_surface = self.points.len();
        let n_sheets = 2 * n_layers + 1;
        let mut node_coordinates_m = Vec::with_capacity(n_surface * n_sheets);
        for sheet in 0..n_sheets {
            node_coordinates_m.extend(self.points.iter().map(|&point| place_m(point, sheet)));
        }
        let mut connectivity = Vec::with_capacity(27 * self.quads.len() * n_layers);
        for layer in 0..n_layers {
            for quad in &self.quads {
                for reference in &HEXAHEDRON27_REFERENCE_NODES {
                    let [u, v, w] = reference.map(|c| (c + 1.0) as usize);
                    connectivity.push(((2 * layer + w) * n_surface) as u32 + quad[3 * v + u]);
                }
            }
        }
        let n_nodes = node_coordinates_m.len() as u32;
        let plane = |axis: usize| {
            (0..n_nodes).filter(|&i| self.points[i as usize % n_surface][axis] == 0).collect::<Vec<u32>>()
        };
        Mesh {
            element_kind: ElementKind::Hexahedron27,
            connectivity,
            robot_nodes: (0..n_surface as u32).collect(),
            outer_nodes: (n_nodes - n_surface as u32..n_nodes).collect(),
            symmetry_y_nodes: plane(1),
            symmetry_z_nodes: plane(2),
            node_coordinates_m,
        }
    }
}

/// Direction from the origin to a point on a cube's surface, in the equiangular "cube-sphere":
/// steps along an edge of the cube become equal angles.
pub(super) fn equiangular_direction(point: [i32; 3], half_width: i32) -> [f64; 3] {
    let gnomonic = point.map(|c| (f64::from(c) / f64::from(half_width) * std::f64::consts::FRAC_PI_4).tan());
    let norm = gnomonic.iter().map(|c| c * c).sum::<f64>().sqrt();
    gnomonic.map(|c| c / norm)
}

/// Index of the coordinate along a body's long axis. The force is along x.
pub(super) fn long_axis(orientation: Orientation) -> usize {
    match orientation {
        Orientation::Horizontal => 0,
        Orientation::Vertical => 1,
    }
}

/// Number of layers per refinement level for layers in geometric progression, at least four.
/// `ratio` is the outer radius divided by the body's size. At level 1, the natural logarithm of the
/// radius grows by at most `largest_step` per layer.
pub(super) fn layers_per_level(ratio: f64, largest_step: f64) -> usize {
    (ratio.ln() / largest_step).ceil().max(4.0) as usize
}
