//! Strains of displacements of any size at all integration points, forces of stresses on the unmoved mesh, and how both change.

use nalgebra::Matrix3;
use rayon::prelude::*;

use crate::fe::nonlinear::point::Tensor;
use crate::fe::nonlinear::points::{IntegrationPoints, strain_tensor, stress_matrix};

/// F = I + ∇u and its inverse at every point.
pub(crate) struct Deformation {
    gradient: Vec<Matrix3<f64>>,
    inverse: Vec<Matrix3<f64>>,
}

impl Deformation {
    /// With the strains: the deviator of Green–Lagrange's E = ½(FᵀF − I), and Π ln det F in the place of the trace. `None` where a point is turned inside
    /// out.
    pub(crate) fn new(points: &IntegrationPoints, displacement: &[f64]) -> Option<(Self, Vec<Tensor<f64>>)> {
        let gradient: Vec<Matrix3<f64>> =
            points.gradients(displacement).into_par_iter().map(|h| h + Matrix3::identity()).collect();
        let at = |f: &Matrix3<f64>| {
            let volume = f.determinant();
            let inverse = f.try_inverse().filter(|_| volume > 0.0 && volume.is_finite())?;
            let h = f - Matrix3::identity();
            let strain = (h + h.transpose() + h.transpose() * h) * 0.5;
            let mut tensor = strain_tensor(|i, j| strain[(i, j)]);
            tensor[5] = volume.ln();
            Some((inverse, tensor))
        };
        let (inverse, mut strains): (Vec<_>, Vec<_>) =
            gradient.par_iter().map(at).collect::<Option<Vec<_>>>()?.into_iter().unzip();
        points.project_all(&mut strains);
        Some((Self { gradient, inverse }, strains))
    }

    /// Nodal forces (N) of stresses s = D̂⁻¹S: those of P = F dev S + p F⁻ᵀ, p on the pressures.
    pub(crate) fn forces(&self, points: &IntegrationPoints, stresses: &[Tensor<f64>]) -> Vec<f64> {
        let mut projected = stresses.to_vec();
        points.project_all(&mut projected);
        let nominal: Vec<Matrix3<f64>> = (projected.par_iter().zip(&self.gradient).zip(&self.inverse))
            .map(|((stress, f), inverse)| {
                let (deviator, pressure) = parts(points, stress);
                f * deviator + inverse.transpose() * pressure
            })
            .collect();
        points.gradient_forces(&nominal)
    }

    /// Changes of the strains with the displacement, and its gradients.
    pub(crate) fn increments(
        &self,
        points: &IntegrationPoints,
        displacement: &[f64],
    ) -> (Vec<Tensor<f64>>, Vec<Matrix3<f64>>) {
        let gradients = points.gradients(displacement);
        let mut tensors: Vec<Tensor<f64>> = (gradients.par_iter().zip(&self.gradient).zip(&self.inverse))
            .map(|((h, f), inverse)| {
                let product = f.transpose() * h;
                let mut tensor = strain_tensor(|i, j| 0.5 * (product[(i, j)] + product[(j, i)]));
                tensor[5] = (inverse * h).trace();
                tensor
            })
            .collect();
        points.project_all(&mut tensors);
        (tensors, gradients)
    }

    /// Change of [`Self::forces`] where the displacement's gradients change by `gradients` and the stresses by `changes`.
    pub(crate) fn changed_forces(
        &self,
        points: &IntegrationPoints,
        stresses: &[Tensor<f64>],
        gradients: &[Matrix3<f64>],
        changes: &[Tensor<f64>],
    ) -> Vec<f64> {
        let (mut stresses, mut changes) = (stresses.to_vec(), changes.to_vec());
        points.project_all(&mut stresses);
        points.project_all(&mut changes);
        let given = stresses.par_iter().zip(&changes).zip(gradients);
        let nominal: Vec<Matrix3<f64>> = (given.zip(&self.gradient).zip(&self.inverse))
            .map(|((((stress, change), h), f), inverse)| {
                let ((deviator, pressure), (d_deviator, d_pressure)) = (parts(points, stress), parts(points, change));
                let inverse = inverse.transpose();
                f * d_deviator + h * deviator + inverse * d_pressure - inverse * h.transpose() * inverse * pressure
            })
            .collect();
        points.gradient_forces(&nominal)
    }
}

/// dev S and the pressure κ̂ tr s.
fn parts(points: &IntegrationPoints, stress: &Tensor<f64>) -> (Matrix3<f64>, f64) {
    let moduli = points.unit_moduli();
    let matrix = stress_matrix(stress, moduli[0], 0.0);
    (Matrix3::from_fn(|i, j| matrix[i][j]), moduli[5] * stress[5])
}
