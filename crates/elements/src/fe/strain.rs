//! Largest strain of a displacement field, to check whether the linear theory applies (physics §6).

use nalgebra::{Matrix3, Vector3};

use super::element::TabulatedElement;
use crate::mesh::Mesh;
use base::error::Result;

/// Returns the largest absolute value of a principal strain at any integration point.
///
/// `displacement_m` holds the displacement (m) of every node.
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
