//! Built-in graded curved mesh of the gel between a spherical robot and the outer sphere.
//!
//! Cube-sphere patches (equiangular) × radial layers in geometric progression, 27-node hexahedra.

use std::collections::HashMap;

use super::{ElementKind, HEXAHEDRON27_REFERENCE_NODES, Mesh};
use crate::error::{Error, Result};

/// Sizes and fineness of the quarter-ball mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuarterBall {
    /// Radius of the robot in m.
    pub robot_radius_m: f64,
    /// Radius of the fixed outer surface in m.
    pub outer_radius_m: f64,
    /// Elements along the edge of an octant's patch (45° of arc).
    pub n_per_edge: usize,
    /// Layers of elements between robot and outer surface.
    pub n_layers: usize,
}

impl QuarterBall {
    /// The mesh, or [`Error::Numerical`] where the sizes make none.
    pub fn mesh(&self) -> Result<Mesh> {
        let sizes_ok = self.robot_radius_m > 0.0
            && self.outer_radius_m > self.robot_radius_m
            && self.outer_radius_m.is_finite()
            && self.n_per_edge > 0
            && self.n_layers > 0;
        if !sizes_ok {
            return Err(Error::numerical(
                format!("no mesh fits between radii {} m and {} m", self.robot_radius_m, self.outer_radius_m),
                "give a robot that lies inside the vitreous",
            ));
        }
        let surface = Surface::new(self.n_per_edge);
        let radii = self.node_radii_m();
        let n_surface = surface.directions.len();
        let mut node_coordinates_m = Vec::with_capacity(n_surface * radii.len());
        for r in &radii {
            node_coordinates_m.extend(surface.directions.iter().map(|d| d.map(|c| c * r)));
        }
        let mut connectivity = Vec::with_capacity(27 * surface.quads.len() * self.n_layers);
        for layer in 0..self.n_layers {
            for quad in &surface.quads {
                for reference in &HEXAHEDRON27_REFERENCE_NODES {
                    let [u, v, w] = reference.map(|c| (c + 1.0) as usize);
                    connectivity.push(((2 * layer + w) * n_surface) as u32 + quad[3 * v + u]);
                }
            }
        }
        let n_nodes = node_coordinates_m.len() as u32;
        let plane = |axis: usize| {
            (0..n_nodes).filter(|&i| surface.on_plane[axis][i as usize % n_surface]).collect::<Vec<u32>>()
        };
        Ok(Mesh {
            element_kind: ElementKind::Hexahedron27,
            connectivity,
            robot_nodes: (0..n_surface as u32).collect(),
            outer_nodes: (n_nodes - n_surface as u32..n_nodes).collect(),
            symmetry_y_nodes: plane(0),
            symmetry_z_nodes: plane(1),
            node_coordinates_m,
        })
    }

    /// Radii of the 2·layers + 1 spherical sheets of nodes, in geometric progression.
    ///
    /// Sheets inside an element follow the progression too: with the middle nodes at √(r₁r₂) the quadratic map stretches like
    /// ln r and takes up the field's 1/r decay; midway between the faces the stiffness error is 30 times larger.
    fn node_radii_m(&self) -> Vec<f64> {
        let last = 2 * self.n_layers;
        let ratio = self.outer_radius_m / self.robot_radius_m;
        let radius = |i: usize| match i {
            i if i == last => self.outer_radius_m,
            i => self.robot_radius_m * ratio.powf(i as f64 / last as f64),
        };
        (0..=last).map(radius).collect()
    }
}

/// Nine-node quadrilaterals on the quarter of the unit sphere with y ≥ 0 and z ≥ 0.
struct Surface {
    directions: Vec<[f64; 3]>,
    /// Whether a node lies on y = 0 (first) or z = 0 (second).
    on_plane: [Vec<bool>; 2],
    /// 3 × 3 nodes of each quadrilateral, first index fastest; first × second direction points outwards.
    quads: Vec<[u32; 9]>,
}

impl Surface {
    /// Nodes are integer points of the surface of a cube of half-width 2n, so that patches share them exactly.
    fn new(n_per_edge: usize) -> Self {
        let half_width = 2 * n_per_edge as i32;
        let mut surface = Self { directions: Vec::new(), on_plane: [Vec::new(), Vec::new()], quads: Vec::new() };
        let mut node_of = HashMap::new();
        // Faces +x, −x, +y, +z: (first axis, second axis, normal axis, side); first × second = outward normal.
        for (first, second, normal, side) in [(1, 2, 0, 1), (2, 1, 0, -1), (2, 0, 1, 1), (0, 1, 2, 1)] {
            let start = |axis: usize| if axis == 0 { -half_width } else { 0 };
            for j in (start(second)..half_width).step_by(2) {
                for i in (start(first)..half_width).step_by(2) {
                    surface.quads.push(std::array::from_fn(|k| {
                        let mut point = [0; 3];
                        point[normal] = side * half_width;
                        point[first] = i + (k % 3) as i32;
                        point[second] = j + (k / 3) as i32;
                        *node_of.entry(point).or_insert_with(|| {
                            surface_node(&mut surface.directions, &mut surface.on_plane, point, half_width)
                        })
                    }));
                }
            }
        }
        surface
    }
}

/// Adds the node at an integer point of the cube and returns its index.
fn surface_node(
    directions: &mut Vec<[f64; 3]>,
    on_plane: &mut [Vec<bool>; 2],
    point: [i32; 3],
    half_width: i32,
) -> u32 {
    let gnomonic = point.map(|c| (f64::from(c) / f64::from(half_width) * std::f64::consts::FRAC_PI_4).tan());
    let norm = gnomonic.iter().map(|c| c * c).sum::<f64>().sqrt();
    directions.push(gnomonic.map(|c| c / norm));
    on_plane[0].push(point[1] == 0);
    on_plane[1].push(point[2] == 0);
    directions.len() as u32 - 1
}
