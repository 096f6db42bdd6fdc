//! Reduced model of a linear effect on the displacement field (physics §3.3, §5).
//!
//! The full-order model is f = (A + x B) z for the force f and the field z, with symmetric A > 0 and B ≥ 0. The scalar x depends
//! on the law and the effect's parameters. A is the stiffness, and B the friction or the mass. If part of the gel has a second
//! law, A is the stiffness of the whole gel, B that of this part, and x is above −1. Snapshots are solutions at values of x over
//! many decades. Their proper orthogonal decomposition in the energy norm of A gives modes. The common eigenvectors of the
//! projected matrices give the robot's compliance as C Σ w/(1 + x μ) for every real or complex x. The cost of this sum does not
//! depend on the mesh.

use faer::{Mat, Side};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::pod::{EnergyProduct, Pod, dot};
use base::error::{Error, Result};
use elements::fe::spatial::{MatrixSplitting, SpatialSystem};

/// Terms whose weights are below this fraction of the total are omitted.
const LEAST_WEIGHT: f64 = 1e-10;
/// Tolerance of special eigenvalues. An eigenvalue below this fraction of the largest one counts as 0 if the second matrix is rigid at the
/// effect's null. A fraction θ of the second matrix counts as 1 if it differs from 1 by less than this.
const EIGENVALUE_TOLERANCE: f64 = 1e-7;

/// Terms to which a pair of matrices is reduced. The robot's compliance is a sum over terms of w/(1 + x μ), with x the factor of the second
/// matrix.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FieldModes {
    /// Compliance of the full-order model without the second matrix's addition (x = 0), in 1/m.
    pub compliance_per_m: f64,
    /// Weights w of the terms. They add up to 1 minus the error of the modes.
    pub weights: Vec<f64>,
    /// Eigenvalues μ ≥ 0 of the terms, in the order of the weights. If the energy norm contains the second matrix, they are the fractions θ
    /// of a term's stiffness that this matrix contributes.
    pub numbers: Vec<f64>,
    /// Singular values of the normalised snapshots, relative to the largest.
    pub singular_values: Vec<f64>,
    /// Number of full-order solutions that gave the modes.
    pub snapshots: usize,
    /// Number of unknowns of the full-order model.
    pub unknowns: usize,
}

impl FieldModes {
    /// Solves the full-order model at the snapshots' factors x of the second matrix, and reduces it to terms. Modes whose singular values
    /// are below `tolerance` times the largest one are dropped.
    ///
    /// # Errors
    /// Errors of the matrix factorisation and of the decomposition.
    pub fn new(system: &SpatialSystem, splitting: &MatrixSplitting, tolerance: f64) -> Result<Self> {
        let values = &splitting.snapshots;
        let n = system.n_unknowns();
        let mut force = vec![0.0; n];
        force[system.freedoms.robot()] = 1.0;
        let solve = |x: f64| {
            let mut field = force.clone();
            system.factor([1.0, splitting.reference + x]).map(|factor| {
                factor.solve_in_place(&mut field);
                field
            })
        };
        let snapshots: Vec<Vec<f64>> = values.par_iter().map(|x| solve(*x)).collect::<Result<_>>()?;
        let at_rest = match values.iter().position(|x| *x == 0.0) {
            Some(k) => snapshots[k].clone(),
            None => solve(0.0)?,
        };
        let whole = system.sum([1.0, splitting.reference])?;
        let energy = EnergyProduct(whole.upper());
        let pod = Pod::new(&snapshots, energy, tolerance)?;
        let applied: Vec<Vec<f64>> = pod.modes.iter().map(|mode| system.second.product(mode)).collect();
        let r = pod.modes.len();
        let projected =
            Mat::from_fn(r, r, |i, j| 0.5 * (dot(&pod.modes[i], &applied[j]) + dot(&pod.modes[j], &applied[i])));
        let eigen = projected.self_adjoint_eigen(Side::Lower).map_err(|e| {
            Error::numerical(format!("the reduced matrices have no eigenvectors: {e:?}"), "use a finer mesh")
        })?;
        let vectors: Vec<Vec<f64>> = (0..r)
            .map(|k| {
                let mut vector = vec![0.0; n];
                for (i, mode) in pod.modes.iter().enumerate() {
                    vector.iter_mut().zip(mode).for_each(|(sum, value)| *sum += eigen.U()[(i, k)] * value);
                }
                vector
            })
            .collect();
        let compliance = at_rest[system.freedoms.robot()];
        let robot = system.freedoms.robot();
        let largest = eigen.S().column_vector().iter().copied().fold(0.0, f64::max);
        let mut terms: Vec<(f64, f64)> = (0..r)
            .map(|k| {
                let number = eigen.S().column_vector()[k].max(0.0);
                let number =
                    if splitting.reference == 1.0 && number > 1.0 - EIGENVALUE_TOLERANCE { 1.0 } else { number };
                let number =
                    if number < EIGENVALUE_TOLERANCE * largest && splitting.is_rigid_at_null { 0.0 } else { number };
                (vectors[k][robot] * vectors[k][robot] / compliance, number)
            })
            .filter(|(weight, _)| *weight > LEAST_WEIGHT)
            .collect();
        terms.sort_by(|a, b| a.1.total_cmp(&b.1));
        let largest_singular = pod.singular_values[0];
        Ok(Self {
            compliance_per_m: system.freedoms.share() * compliance,
            weights: terms.iter().map(|(weight, _)| *weight).collect(),
            numbers: terms.iter().map(|(_, number)| *number).collect(),
            singular_values: pod.singular_values.iter().map(|s| s / largest_singular).collect(),
            snapshots: values.len(),
            unknowns: n,
        })
    }

    /// Returns the compliance at a real factor x of the second matrix, divided by the compliance at x = 0.
    pub fn relative_compliance(&self, x: f64) -> f64 {
        self.weights.iter().zip(&self.numbers).map(|(weight, number)| weight / (1.0 + x * number)).sum()
    }
}
