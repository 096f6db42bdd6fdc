//! Strain of a displacement field, to check the range of the linear theory (physics §6).

use nalgebra::{Matrix3, Vector3};

use super::element::TabulatedElement;
use crate::mesh::Mesh;
use base::error::Result;

/// Largest absolute principal strain over all integration points.
///
/// `displacement_m` holds one vector per node, in m.
pub fn largest_principal_strain(mesh: &Mesh, displacement_m: &[[f64; 3]]) -> Result<f64> {
    let table = TabulatedElement::of(mesh.element_kind);
    let mut largest = 0.0_f64;
    for nodes in mesh.elements() {
        let coordinates: Vec<_> = nodes.iter().map(|&n| mesh.node_coordinates_m[n as usize]).collect();
        table.for_each_point(&coordinates, |point| {
            let mut gradient = Matrix3::zeros();
            for (&node, g) in nodes.iter().zip(point.gradient) {
                gradient += Vector3::from(displacement_m[node as usize]) * Vector3::from(*g).transpose();
            }
            let strain = (gradient + gradient.transpose()) * 0.5;
            largest = largest.max(strain.symmetric_eigenvalues().amax());
        })?;
    }
    Ok(largest)
}
