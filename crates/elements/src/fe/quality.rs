//! Shape quality of a mesh's elements, measured at the integration points.

use nalgebra::Matrix3;

use super::element::TabulatedElement;
use crate::mesh::Mesh;

/// Shape quality of the worst elements of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshQuality {
    /// Number of elements whose Jacobian determinant is not positive at some integration point.
    /// Such elements are unusable.
    pub n_inverted: usize,
    /// Smallest scaled Jacobian: the Jacobian's determinant divided by the product of the lengths
    /// of its columns. It is 1 for bricks, 0.71 for regular tetrahedra and 0 for a flat element.
    pub smallest_scaled_jacobian: f64,
    /// Largest ratio of an element's longest side to its shortest. A side is the root mean square,
    /// over the integration points, of the length of a column of the Jacobian.
    pub largest_aspect: f64,
}

impl MeshQuality {
    /// Measures the shape quality of every element of a mesh.
    pub fn of(mesh: &Mesh) -> Self {
        let table = TabulatedElement::of(mesh.element_kind);
        let mut quality = Self { n_inverted: 0, smallest_scaled_jacobian: 1.0, largest_aspect: 1.0 };
        for nodes in mesh.elements() {
            let coordinates: Vec<_> = nodes.iter().map(|&n| mesh.node_coordinates_m[n as usize]).collect();
            let jacobians: Vec<Matrix3<f64>> = table.jacobians(&coordinates).collect();
            let scaled = |j: &Matrix3<f64>| j.determinant() / j.column_iter().map(|c| c.norm()).product::<f64>();
            let smallest = jacobians.iter().map(scaled).fold(1.0, f64::min);
            let sides = [0, 1, 2].map(|k| jacobians.iter().map(|j| j.column(k).norm_squared()).sum::<f64>().sqrt());
            let aspect =
                sides.iter().fold(0.0, |a: f64, &b| a.max(b)) / sides.iter().fold(f64::INFINITY, |a: f64, &b| a.min(b));
            quality.n_inverted += usize::from(smallest <= 0.0);
            quality.smallest_scaled_jacobian = quality.smallest_scaled_jacobian.min(smallest);
            quality.largest_aspect = quality.largest_aspect.max(aspect);
        }
        quality
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{ElementKind, HEXAHEDRON27_REFERENCE_NODES};

    fn one(element_kind: ElementKind, node_coordinates_m: Vec<[f64; 3]>) -> Mesh {
        Mesh {
            connectivity: (0..node_coordinates_m.len() as u32).collect(),
            node_coordinates_m,
            element_kind,
            robot_nodes: vec![],
            outer_nodes: vec![],
            symmetry_y_nodes: vec![],
            symmetry_z_nodes: vec![],
        }
    }

    /// Checks the scaled Jacobian of parallelepipeds, which is the sine of their angle at any
    /// aspect ratio. An inverted element must be counted.
    #[test]
    fn shapes_with_known_quality() {
        let brick = |map: &dyn Fn([f64; 3]) -> [f64; 3]| {
            MeshQuality::of(&one(ElementKind::Hexahedron27, HEXAHEDRON27_REFERENCE_NODES.map(map).to_vec()))
        };
        let found = brick(&|[x, y, z]| [6.0 * x + 1.0, 2.0 * y, 3.0 * z]);
        assert!((found.smallest_scaled_jacobian - 1.0).abs() < 1e-14 && (found.largest_aspect - 3.0).abs() < 1e-13);
        let angle = 0.3_f64;
        let found = brick(&|[x, y, z]| [6.0 * x + y * angle.cos(), y * angle.sin(), z]);
        assert!((found.smallest_scaled_jacobian - angle.sin()).abs() < 1e-14 && found.n_inverted == 0, "{found:?}");
        let found = brick(&|[x, y, z]| [-x, y, z]);
        assert!(found.n_inverted == 1 && (found.smallest_scaled_jacobian + 1.0).abs() < 1e-14, "{found:?}");
        let regular = vec![[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
        let found = MeshQuality::of(&one(ElementKind::Tetrahedron4, regular));
        assert!((found.smallest_scaled_jacobian - 0.5_f64.sqrt()).abs() < 1e-14, "{found:?}");
    }
}
