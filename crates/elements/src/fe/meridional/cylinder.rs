//! Mesh of the gel around a right circular cylinder, graded towards the sharp rim.

use std::f64::consts::{FRAC_PI_4, PI};

use super::geometry::Point;
use super::mesh::{Boundary, Chain, Mesh};

const ON_BODY: Boundary = Boundary { body: true, ..Boundary::INSIDE };
/// Ratio of the radii of successive mesh circles around the rim, from the outside inwards.
const RIM_FACTOR: f64 = 0.15;
/// Radius of the largest mesh circle around the rim, relative to half the side of the square box
/// that surrounds the circles.
const LARGEST_CIRCLE: f64 = 0.5;
/// Ratio of the distances of successive boxes of mesh lines from the cylinder.
const BOX_RATIO: f64 = 2.5;
/// Largest ratio of the distances of successive layers from the cylinder, between the last box of
/// mesh lines and the outer sphere.
const LAST_RATIO: f64 = 3.0;
/// Ratio of the distances of successive nodes from the rim, along the end face and along the side.
const SIDE_RATIO: f64 = 3.0;
/// Seven points of the square box around the rim to which rays from the rim lead. They run from the
/// end face (0) around the outside to the side (6). The unit is half the side of the box.
const RAYS: [Point; 7] = [[-1.0, 0.0], [-1.0, 1.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [1.0, -1.0], [0.0, -1.0]];

/// Meshes the gel around a cylinder of `radius_m` and `half_length_m` (m), inside a sphere of
/// `outer_radius_m` (m).
///
/// Circles surround the rim, the innermost collapsed onto it, and a box surrounds the circles.
/// Along the remaining end face and side there is one layer as thick as that box. Larger boxes
/// around the cylinder follow at growing distances. Layers fill the space between the last box and
/// the sphere.
pub(super) fn mesh(radius_m: f64, half_length_m: f64, outer_radius_m: f64, n_rim_layers: usize) -> Mesh {
    let mut mesh = Mesh::default();
    let rim = [radius_m, half_length_m];
    let box_size = radius_m.min(half_length_m).min(0.35 * (outer_radius_m - radius_m.hypot(half_length_m)));
    // The box extends to the axis or the equator if it would otherwise leave only a thin cell.
    let half_side = rim.map(|length| if length < 1.4 * box_size { length } else { box_size });
    let rays = around_rim(&mut mesh, rim, half_side, n_rim_layers);
    let mut inner = first_box(&mut mesh, rim, half_side, rays);

    let first: Vec<Point> = inner.vertices.iter().map(|&v| mesh.points[v]).collect();
    let mut distance = half_side[0].min(half_side[1]);
    for growth in box_growths(rim, half_side, outer_radius_m) {
        distance = growth * half_side[0].min(half_side[1]);
        let scale = [0, 1].map(|d| (rim[d] + growth * half_side[d]) / (rim[d] + half_side[d]));
        let scaled = |p: &Point| mesh.vertex([p[0] * scale[0], p[1] * scale[1]], Boundary::INSIDE);
        let ring: Vec<usize> = first.iter().map(scaled).collect();
        let outer = mesh.polyline(&ring);
        mesh.rule(&inner, &outer);
        inner = outer;
    }

    let angles: Vec<f64> = inner.vertices.iter().map(|&v| mesh.points[v][1].atan2(mesh.points[v][0])).collect();
    let sphere = mesh.arcs([0.0; 2], [outer_radius_m; 2], &angles, Boundary { outer: true, ..Boundary::INSIDE });
    let way = |(&a, &b): (&usize, &usize)| {
        (mesh.points[b][0] - mesh.points[a][0]).hypot(mesh.points[b][1] - mesh.points[a][1])
    };
    let ratio = 1.0 + inner.vertices.iter().zip(&sphere.vertices).map(way).fold(0.0, f64::max) / distance;
    let n = (ratio.ln() / LAST_RATIO.ln()).ceil().max(1.0);
    let fraction = |k: usize| if k == n as usize { 1.0 } else { (ratio.powf(k as f64 / n) - 1.0) / (ratio - 1.0) };
    let fractions: Vec<f64> = (0..=n as usize).map(fraction).collect();
    mesh.rule_layers(&inner, &sphere, &fractions);
    mesh
}

/// Adds the cells between the rim and the box around it. Returns the vertices of the box, one per
/// ray.
fn around_rim(mesh: &mut Mesh, rim: Point, half_side: Point, n_layers: usize) -> [usize; 7] {
    let rim_vertex = mesh.vertex(rim, ON_BODY);
    let mut inner = mesh.polyline(&[rim_vertex; 7]);
    let angles: Vec<f64> = (0..7).map(|k| PI - f64::from(k) * FRAC_PI_4).collect();
    for layer in (0..n_layers).rev() {
        let scale = LARGEST_CIRCLE * RIM_FACTOR.powi(layer as i32);
        let circle = mesh.arcs(rim, half_side.map(|s| scale * s), &angles, Boundary::INSIDE);
        for ray in [0, 6] {
            mesh.boundaries[circle.vertices[ray]].body = true;
        }
        mesh.rule(&inner, &circle);
        inner = circle;
    }
    let rays = std::array::from_fn(|k| {
        let point = [0, 1].map(|d| rim[d] + RAYS[k][d] * half_side[d]);
        mesh.vertex(point, if k == 0 || k == 6 { ON_BODY } else { Boundary::INSIDE })
    });
    let rim_box = mesh.polyline(&rays);
    mesh.rule(&inner, &rim_box);
    rays
}

/// Adds the cells along the remaining end face and side. Returns the box around the whole cylinder,
/// from the axis to the equator.
fn first_box(mesh: &mut Mesh, rim: Point, half_side: Point, rays: [usize; 7]) -> Chain {
    // Node positions between the rim's box and the axis or the equator. The last is on the axis or
    // the equator.
    let remainder = |d: usize| -> Vec<f64> {
        let ratio = rim[d] / half_side[d];
        let n = (ratio.ln() / SIDE_RATIO.ln()).ceil();
        let place = |k| if k == n as usize { 0.0 } else { rim[d] - half_side[d] * ratio.powf(k as f64 / n) };
        (1..=n as usize).map(place).collect()
    };
    let mut end = |z: f64, ray: usize, surface: Boundary| -> Vec<usize> {
        remainder(0).iter().rev().map(|&r| mesh.vertex([r, z], surface)).chain([ray]).collect()
    };
    let (end_body, end_box) = (end(rim[1], rays[0], ON_BODY), end(rim[1] + half_side[1], rays[1], Boundary::INSIDE));
    let mut side = |r: f64, ray: usize, surface: Boundary| -> Vec<usize> {
        let places = remainder(1);
        [ray].into_iter().chain(places.iter().map(|&z| mesh.vertex([r, z], surface))).collect()
    };
    let (side_body, side_box) =
        (side(rim[0], rays[6], ON_BODY), side(rim[0] + half_side[0], rays[5], Boundary::INSIDE));
    mesh.rule(&mesh.polyline(&end_body), &mesh.polyline(&end_box));
    mesh.rule(&mesh.polyline(&side_body), &mesh.polyline(&side_box));
    let ring: Vec<usize> = end_box.iter().chain(&rays[2..5]).chain(&side_box).copied().collect();
    mesh.polyline(&ring)
}

/// Distances of the larger boxes from the cylinder, relative to the first box's distance. They grow
/// geometrically. The corner of the last box is at 0.6 outer radii or midway between the rim and
/// the sphere.
fn box_growths(rim: Point, half_side: Point, outer_radius_m: f64) -> Vec<f64> {
    let corner = |growth: f64| (rim[0] + growth * half_side[0]).hypot(rim[1] + growth * half_side[1]);
    let last_corner = (0.6 * outer_radius_m).max(0.5 * (outer_radius_m + corner(0.0)));
    let (mut low, mut high) = (1.0, outer_radius_m / half_side[0].min(half_side[1]));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if corner(middle) < last_corner { low = middle } else { high = middle }
    }
    let n = (low.ln() / BOX_RATIO.ln()).round();
    (1..=n as usize).map(|k| low.powf(k as f64 / n)).collect()
}
