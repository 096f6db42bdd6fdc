//! Integration over surfaces of a mesh, mainly the robot's. The points lie on the faces of adjacent
//! elements.

use std::f64::consts::PI;
use std::sync::OnceLock;

use nalgebra::{Matrix3, Vector3};

use super::element::element_of;
use super::quadrature::line;
use crate::mesh::{ElementKind, HEXAHEDRON27_REFERENCE_NODES, Mesh};

/// One integration point on a surface of the mesh.
pub struct SurfacePoint<'a> {
    /// Area (m²) that the point represents: its weight × the area element of the face.
    pub area_m2: f64,
    /// Unit normal at the point, directed into the gel.
    pub normal: [f64; 3],
    /// Position of the point in m.
    pub position_m: [f64; 3],
    /// Nodes of the element that the face belongs to.
    pub nodes: &'a [u32],
    /// Value of every node's shape function at the point.
    pub shape: &'a [f64],
}

/// One face of the reference cell, with its integration points.
struct Face {
    /// Indices, within the element, of the nodes on the face.
    nodes: Vec<usize>,
    points: Vec<FacePoint>,
    /// Shape functions and their gradients at the nodes of the face.
    at_nodes: Vec<FacePoint>,
}

struct FacePoint {
    weight: f64,
    /// Two directions along the face, in reference coordinates.
    tangents: [Vector3<f64>; 2],
    /// Direction from the face into the cell, in reference coordinates.
    inward: Vector3<f64>,
    shape: Vec<f64>,
    gradient: Vec<[f64; 3]>,
}

fn face(
    kind: ElementKind,
    origin: [f64; 3],
    tangents: [[f64; 3]; 2],
    places: &[([f64; 2], f64)],
    on_face: impl Fn([f64; 3]) -> bool,
) -> Face {
    let element = element_of(kind);
    let n = kind.n_nodes();
    let tangents = tangents.map(Vector3::from);
    let middle = reference_nodes(kind).into_iter().map(Vector3::from).sum::<Vector3<f64>>() / n as f64;
    let tabulate = |point: [f64; 3], weight: f64| {
        let (mut shape, mut gradient) = (vec![0.0; n], vec![[0.0; 3]; n]);
        element.shape(point, &mut shape);
        element.shape_gradient(point, &mut gradient);
        FacePoint { weight, tangents, inward: middle - Vector3::from(point), shape, gradient }
    };
    let at = |&([u, v], weight): &([f64; 2], f64)| {
        tabulate((Vector3::from(origin) + tangents[0] * u + tangents[1] * v).into(), weight)
    };
    let places_of_nodes = reference_nodes(kind);
    let nodes: Vec<usize> = (0..n).filter(|&k| on_face(places_of_nodes[k])).collect();
    let at_nodes = nodes.iter().map(|&k| tabulate(places_of_nodes[k], 0.0)).collect();
    Face { nodes, points: places.iter().map(at).collect(), at_nodes }
}

fn reference_nodes(kind: ElementKind) -> Vec<[f64; 3]> {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let edges = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];
    match kind {
        ElementKind::Hexahedron27 => HEXAHEDRON27_REFERENCE_NODES.to_vec(),
        ElementKind::Tetrahedron4 => corners.to_vec(),
        ElementKind::Tetrahedron10 => {
            let middle = |[a, b]: [usize; 2]| std::array::from_fn(|d| 0.5 * (corners[a][d] + corners[b][d]));
            corners.into_iter().chain(edges.map(middle)).collect()
        }
    }
}

fn faces(kind: ElementKind) -> &'static [Face] {
    static TABLES: [OnceLock<Vec<Face>>; 3] = [OnceLock::new(), OnceLock::new(), OnceLock::new()];
    TABLES[kind as usize].get_or_init(|| match kind {
        ElementKind::Hexahedron27 => hexahedron_faces(),
        _ => tetrahedron_faces(kind),
    })
}

fn hexahedron_faces() -> Vec<Face> {
    let places: Vec<([f64; 2], f64)> =
        line().into_iter().flat_map(|(v, wv)| line().map(|(u, wu)| ([u, v], wu * wv))).collect();
    let unit = |d: usize| std::array::from_fn(|i| f64::from(u8::from(i == d)));
    let of_side = |(d, side): (usize, f64)| {
        let origin = std::array::from_fn(|i| if i == d { side } else { 0.0 });
        let tangents = [unit((d + 1) % 3), unit((d + 2) % 3)];
        face(ElementKind::Hexahedron27, origin, tangents, &places, move |x| x[d] == side)
    };
    (0..3).flat_map(|d| [(d, -1.0), (d, 1.0)]).map(of_side).collect()
}

fn tetrahedron_faces(kind: ElementKind) -> Vec<Face> {
    // Duffy's map of the square to the triangle: (u, v (1 − u)).
    let places: Vec<([f64; 2], f64)> = line()
        .into_iter()
        .flat_map(|(b, wb)| line().map(|(a, wa)| (0.5 * (1.0 + a), 0.5 * (1.0 + b), 0.25 * wa * wb)))
        .map(|(u, v, w)| ([u, v * (1.0 - u)], w * (1.0 - u)))
        .collect();
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let oblique =
        face(kind, x, [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]], &places, |p| (p.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    let flat = |d: usize, tangents| face(kind, [0.0; 3], tangents, &places, move |p| p[d] == 0.0);
    vec![flat(0, [y, z]), flat(1, [z, x]), flat(2, [x, y]), oblique]
}

/// Calls `visit` at every integration point of a surface, element by element. The surface consists
/// of the element faces whose nodes are all in `surface_nodes` (ascending).
pub fn for_each_surface_point(mesh: &Mesh, surface_nodes: &[u32], mut visit: impl FnMut(SurfacePoint<'_>)) {
    for_each_face(mesh, surface_nodes, |nodes, face| {
        for point in &face.points {
            let FacePointGeometry { area, normal, position_m } = place(mesh, nodes, point);
            let area_m2 = point.weight * area;
            visit(SurfacePoint { area_m2, normal: normal.into(), position_m, nodes, shape: &point.shape });
        }
    });
}

/// Returns the unit normals of the robot's surface, directed into the gel, at every node of the
/// mesh: one per adjacent face. Nodes off the robot have none.
pub fn robot_normals(mesh: &Mesh) -> Vec<Vec<Vector3<f64>>> {
    let mut normals = vec![Vec::new(); mesh.n_nodes()];
    for_each_face(mesh, &mesh.robot_nodes, |nodes, face| {
        for (&k, point) in face.nodes.iter().zip(&face.at_nodes) {
            normals[nodes[k] as usize].push(place(mesh, nodes, point).normal);
        }
    });
    normals
}

fn for_each_face<'a>(mesh: &'a Mesh, surface_nodes: &[u32], mut visit: impl FnMut(&'a [u32], &'static Face)) {
    let faces = faces(mesh.element_kind);
    for nodes in mesh.elements() {
        let is_on_surface = |&k: &usize| surface_nodes.binary_search(&nodes[k]).is_ok();
        for face in faces.iter().filter(|face| face.nodes.iter().all(is_on_surface)) {
            visit(nodes, face);
        }
    }
}

/// Position, unit normal and area element of a point on an element's face.
struct FacePointGeometry {
    area: f64,
    normal: Vector3<f64>,
    position_m: [f64; 3],
}

fn place(mesh: &Mesh, nodes: &[u32], point: &FacePoint) -> FacePointGeometry {
    let (mut position, mut jacobian) = (Vector3::zeros(), Matrix3::zeros());
    for ((&node, n), g) in nodes.iter().zip(&point.shape).zip(&point.gradient) {
        let x = Vector3::from(mesh.node_coordinates_m[node as usize]);
        position += x * *n;
        jacobian += x * Vector3::from(*g).transpose();
    }
    let across = (jacobian * point.tangents[0]).cross(&(jacobian * point.tangents[1]));
    let area = across.norm();
    // The normal points towards the inside of the element, which lies outside the robot. The
    // Jacobian decides, because the middle of a thin curved element may lie behind the tangent
    // plane.
    let outward = if across.dot(&(jacobian * point.inward)) > 0.0 { across } else { -across };
    FacePointGeometry { area, normal: outward / area, position_m: position.into() }
}

/// Surface area and volume of a mesh's robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotSize {
    /// Surface area of the whole robot, in m².
    pub surface_area_m2: f64,
    /// Volume of the whole robot, in m³.
    pub volume_m3: f64,
}

impl RobotSize {
    /// Computes the surface area and the volume of a mesh's whole robot. The volume is ⅓ ∮ x·n dA
    /// by the divergence theorem, with x the position and n the normal. Symmetry planes contribute
    /// nothing to the integral.
    pub fn of(mesh: &Mesh) -> Self {
        let mut part = Self { surface_area_m2: 0.0, volume_m3: 0.0 };
        for_each_surface_point(mesh, &mesh.robot_nodes, |point| {
            part.surface_area_m2 += point.area_m2;
            let height_m: f64 = point.normal.iter().zip(point.position_m).map(|(n, x)| n * x).sum();
            part.volume_m3 += point.area_m2 * height_m / 3.0;
        });
        let share = mesh.share();
        Self { surface_area_m2: part.surface_area_m2 / share, volume_m3: part.volume_m3 / share }
    }

    /// Diameters (m) of two spheres: the first has the robot's volume, the second has the robot's
    /// surface area.
    pub fn equivalent_diameters_m(&self) -> [f64; 2] {
        [(6.0 * self.volume_m3 / PI).cbrt(), (self.surface_area_m2 / PI).sqrt()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Cylinder, QuarterBall, Spheroid};
    use record::Orientation;

    fn assert_size(mesh: &Mesh, area_m2: f64, volume_m3: f64, tolerance: f64) {
        let found = RobotSize::of(mesh);
        let errors = [found.surface_area_m2 / area_m2 - 1.0, found.volume_m3 / volume_m3 - 1.0];
        assert!(errors.iter().all(|e| e.abs() < tolerance), "{errors:?}");
    }

    /// Checks area and volume of a sphere, a cylinder and a spheroid with quadratic faces. A
    /// cylinder's flat ends and straight sides are exact except for the circle.
    #[test]
    fn areas_and_volumes_are_those_of_the_bodies() {
        let ball = QuarterBall { robot_radius_m: 0.4e-3, outer_radius_m: 4e-3, n_per_edge: 3, n_layers: 4 };
        assert_size(&ball.mesh().unwrap(), 4.0 * PI * 0.16e-6, 4.0 / 3.0 * PI * 0.064e-9, 3e-5);
        for orientation in [Orientation::Horizontal, Orientation::Vertical] {
            let sizes = (1.2e-3, 0.5e-3, 10e-3);
            let (length_m, diameter_m, outer_radius_m) = sizes;
            let cylinder = Cylinder { length_m, diameter_m, orientation, outer_radius_m, level: 3 }.mesh().unwrap();
            let round = PI * diameter_m;
            assert_size(&cylinder, round * (length_m + 0.5 * diameter_m), 0.25 * round * diameter_m * length_m, 1e-4);
            let spheroid = Spheroid { length_m, diameter_m, orientation, outer_radius_m, level: 3 }.mesh().unwrap();
            let (a, b) = (0.5 * length_m, 0.5 * diameter_m);
            let e = (1.0 - (b / a).powi(2)).sqrt();
            let area = 2.0 * PI * b * (b + a * e.asin() / e);
            assert_size(&spheroid, area, 4.0 / 3.0 * PI * a * b * b, 1e-4);
        }
    }

    /// The mesh is a single tetrahedron whose oblique face is the robot.
    #[test]
    fn faces_of_tetrahedra_are_found() {
        for kind in [ElementKind::Tetrahedron4, ElementKind::Tetrahedron10] {
            let nodes = reference_nodes(kind);
            let on_robot = |x: &[f64; 3]| (x.iter().sum::<f64>() - 1.0).abs() < 1e-12;
            let mesh = Mesh {
                connectivity: (0..nodes.len() as u32).collect(),
                robot_nodes: (0..).zip(&nodes).filter(|(_, x)| on_robot(x)).map(|(n, _)| n).collect(),
                node_coordinates_m: nodes,
                element_kind: kind,
                outer_nodes: vec![],
                symmetry_y_nodes: vec![],
                symmetry_z_nodes: vec![],
            };
            let found = RobotSize::of(&mesh);
            assert!((found.surface_area_m2 - 0.75_f64.sqrt()).abs() < 1e-14, "{kind:?}: {found:?}");
            // The expected volume is ⅓ x·n A, with n on the side of the element, towards the
            // origin.
            assert!((found.volume_m3 + 1.0 / 6.0).abs() < 1e-14, "{kind:?}: {found:?}");
        }
    }
}
