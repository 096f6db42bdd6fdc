//! The balance at one stage, solved by Newton's method on the displacements. Conjugate gradients
//! solve the linear systems (physics §3.2).
//!
//! The tangent is the derivative of the stage's stress, so that Newton's method converges
//! quadratically. It is not factorised, because the factor of the unit stiffness is such a good
//! preconditioner that a few iterations suffice. The accuracy of these iterations affects only the
//! speed of Newton's method, not its result.
//!
//! Conjugate gradients need a symmetric matrix. The asymmetric part of the tangent is therefore
//! omitted, and the last Newton steps converge linearly. This part is the dependence of the trace's
//! modulus on the deviator in a flowing dashpot.

use super::Discretisation;
use super::point::{Moduli, StageLaw, Tensor, deviator_norm};
use base::error::{Error, Result};
use laws::stages::Load;
use rayon::prelude::*;

/// Largest number of Newton steps. If they do not suffice, the time step is halved.
const MOST_STEPS: usize = 30;
/// Largest number of times that a Newton step is halved because it increases the residual.
const MOST_HALVINGS: usize = 8;
/// Largest number of conjugate-gradient iterations per linear system.
const MOST_GRADIENTS: usize = 200;
/// Largest ratio of final to initial residual in the solution of a linear system. Near convergence
/// of Newton's method, the systems are solved more accurately.
const FORCING: f64 = 0.05;

/// Number of integration points that one parallel task processes.
const CHUNK: usize = 512;

/// Force (N) on the robot at zero displacement, and the load that makes it depend on the robot's
/// displacement.
#[derive(Debug, Clone, Copy)]
pub(super) struct RobotForce<'a> {
    pub force_n: f64,
    pub load: &'a Load<f64>,
}

/// Derivative of the stress s with respect to the strain ε at one integration point. The deviator
/// obeys ds = `secant` dε + `along` n (n·dε). The trace obeys ds = `volumetric` dε + `coupling`
/// n·(deviator of dε). n is the unit tensor `direction`.
#[derive(Debug, Clone, Copy)]
struct Tangent {
    secant: f64,
    along: f64,
    volumetric: f64,
    coupling: f64,
    direction: [f64; 5],
}

/// Solver for the force balance on a mesh.
#[derive(Clone, Copy)]
pub(super) struct Balance<'a>(pub &'a dyn Discretisation);

/// One stage: the law, the force, and the histories. `histories` holds `n_histories` tensors per
/// integration point, one point after the other.
pub(super) struct NonlinearStage<'a> {
    pub law: &'a StageLaw<f64>,
    pub histories: &'a [Tensor<f64>],
    pub n_histories: usize,
    pub push: RobotForce<'a>,
}

/// Residual of the force balance at given displacements, with intermediate results.
struct Evaluated {
    strains: Vec<Tensor<f64>>,
    stresses: Vec<Tensor<f64>>,
    tangents: Vec<Tangent>,
    residual: Vec<f64>,
    /// Derivative of the force with respect to the robot's displacement, in N/m.
    slope_n_per_m: f64,
    /// Inverse of the unit stiffness times the residual.
    preconditioned: Vec<f64>,
    /// Norm √(rᵀK̂⁻¹r) of the residual r, with the stiffness K̂ at unit Young's modulus.
    norm: f64,
}

/// Strains and stresses that solve a stage, with the numbers of evaluations and iterations.
pub(super) struct StageSolution {
    pub strains: Vec<Tensor<f64>>,
    pub stresses: Vec<Tensor<f64>>,
    /// Number of evaluations of the residual.
    pub n_evaluations: usize,
    pub n_gradients: usize,
    /// Norm of the residual before every Newton step and at the end.
    #[cfg_attr(not(test), allow(dead_code))]
    pub norms: Vec<f64>,
}

impl Balance<'_> {
    /// Finds the displacements (m) that balance the stage. `displacement` holds a guess and
    /// receives the result. The residual r is at most `tolerance` in the norm √(rᵀK̂⁻¹r), with the
    /// stiffness K̂ at unit Young's modulus.
    ///
    /// # Errors
    /// [`Error::Numerical`] if Newton's method does not converge.
    pub(super) fn solve(
        &self,
        stage: &NonlinearStage,
        displacement: &mut [f64],
        tolerance: f64,
    ) -> Result<StageSolution> {
        let mut now = self.evaluate(stage, displacement);
        let (mut n_evaluations, mut n_gradients, mut norms) = (1, 0, vec![now.norm]);
        for _ in 0..MOST_STEPS {
            if now.norm <= tolerance {
                let Evaluated { strains, stresses, .. } = now;
                return Ok(StageSolution { strains, stresses, n_evaluations, n_gradients, norms });
            }
            let goal = (FORCING * now.norm).min((now.norm * now.norm / norms[0]).max(0.3 * tolerance));
            let (step, n) = self.conjugate_gradients(&now, goal.max(0.1 * tolerance));
            n_gradients += n;
            let before = displacement.to_vec();
            let mut share = 1.0;
            let mut next = None;
            for _ in 0..=MOST_HALVINGS {
                for ((u, from), d) in displacement.iter_mut().zip(&before).zip(&step) {
                    *u = from + share * d;
                }
                let tried = self.evaluate(stage, displacement);
                n_evaluations += 1;
                if tried.norm < now.norm {
                    next = Some(tried);
                    break;
                }
                share *= 0.5;
            }
            let Some(next) = next else { break };
            now = next;
            norms.push(now.norm);
        }
        Err(Error::numerical(
            format!("the norm of the residual stays at {:.3e}; at most {tolerance:.3e} is accepted", now.norm),
            "give parameters of moderate size, or a larger tolerance",
        ))
    }

    fn evaluate(&self, stage: &NonlinearStage, displacement: &[f64]) -> Evaluated {
        let strains = self.0.strains(displacement);
        let mut stresses = vec![[0.0; 6]; strains.len()];
        let still = Tangent { secant: 0.0, along: 0.0, volumetric: 0.0, coupling: 0.0, direction: [0.0; 5] };
        let mut tangents = vec![still; strains.len()];
        let n = stage.n_histories;
        let places = stresses.par_chunks_mut(CHUNK).zip(tangents.par_chunks_mut(CHUNK));
        let given = strains.par_chunks(CHUNK).zip(stage.histories.par_chunks(CHUNK * n));
        places.zip(given).for_each(|((stresses, tangents), (strains, histories))| {
            let places = stresses.iter_mut().zip(tangents);
            for (((stress, tangent), strain), histories) in places.zip(strains).zip(histories.chunks_exact(n)) {
                (*stress, *tangent) = respond(stage.law, strain, histories);
            }
        });
        let mut residual = self.0.forces(&stresses);
        residual.iter_mut().for_each(|f| *f = -*f);
        let push_n = stage.push.load.acting_n(stage.push.force_n, displacement[self.0.robot()]);
        residual[self.0.robot()] += push_n;
        let mut preconditioned = residual.clone();
        self.0.solve_unit_stiffness(&mut preconditioned);
        let norm = dot(&residual, &preconditioned).max(0.0).sqrt();
        let slope_n_per_m = stage.push.load.acting_slope(push_n);
        Evaluated { strains, stresses, tangents, residual, slope_n_per_m, preconditioned, norm }
    }

    /// Product of the tangent and a displacement. With `symmetric`, the asymmetric part of the
    /// tangent is omitted.
    fn apply(&self, at: &Evaluated, displacement: &[f64], symmetric: bool) -> Vec<f64> {
        let tangents = &at.tangents;
        let mut tensors = self.0.strains(displacement);
        tensors.par_chunks_mut(CHUNK).zip(tangents.par_chunks(CHUNK)).for_each(|(tensors, tangents)| {
            for (tensor, tangent) in tensors.iter_mut().zip(tangents) {
                let along: f64 = tensor.iter().zip(&tangent.direction).map(|(e, n)| e * n).sum();
                for (e, n) in tensor.iter_mut().zip(&tangent.direction) {
                    *e = tangent.secant * *e + tangent.along * along * n;
                }
                let coupling = if symmetric { 0.0 } else { tangent.coupling };
                tensor[5] = tangent.volumetric * tensor[5] + coupling * along;
            }
        });
        let mut product = self.0.forces(&tensors);
        product[self.0.robot()] -= at.slope_n_per_m * displacement[self.0.robot()];
        product
    }

    /// Solves tangent × step = residual until the norm of the remaining residual is below `goal`.
    /// Returns the step and the number of iterations.
    fn conjugate_gradients(&self, now: &Evaluated, goal: f64) -> (Vec<f64>, usize) {
        let mut step = vec![0.0; now.residual.len()];
        let (mut rest, mut preconditioned) = (now.residual.clone(), now.preconditioned.clone());
        let mut direction = preconditioned.clone();
        let mut squared = now.norm * now.norm;
        for n in 0..MOST_GRADIENTS {
            if squared.max(0.0).sqrt() <= goal {
                return (step, n);
            }
            let image = self.apply(now, &direction, true);
            let curvature = dot(&direction, &image);
            if curvature <= 0.0 {
                // The tangent is not positive definite, because the force gradient exceeds the
                // gel's stiffness. No better step exists.
                return (if n == 0 { direction } else { step }, n + 1);
            }
            let length = squared / curvature;
            for (((u, r), d), i) in step.iter_mut().zip(&mut rest).zip(&direction).zip(&image) {
                *u += length * d;
                *r -= length * i;
            }
            preconditioned.copy_from_slice(&rest);
            self.0.solve_unit_stiffness(&mut preconditioned);
            let next = dot(&rest, &preconditioned);
            let keep = next / squared;
            for (d, z) in direction.iter_mut().zip(&preconditioned) {
                *d = z + keep * *d;
            }
            squared = next;
        }
        (step, MOST_GRADIENTS)
    }
}

/// Stress at one integration point, and its derivative with respect to the strain.
fn respond(law: &StageLaw<f64>, strain: &Tensor<f64>, histories: &[Tensor<f64>]) -> (Tensor<f64>, Tangent) {
    let mut a = law.offset(histories);
    a.iter_mut().zip(strain).for_each(|(a, e)| *a += e);
    let norm = deviator_norm(&a);
    let Moduli { secant, normal, volumetric, coupling } = law.moduli(norm);
    let mut stress: Tensor<f64> = std::array::from_fn(|i| secant * a[i] - law.kappa * histories[0][i]);
    stress[5] = volumetric * a[5] - law.kappa * histories[0][5];
    let per_norm = if norm > 0.0 { 1.0 / norm } else { 0.0 };
    let direction = std::array::from_fn(|i| a[i] * per_norm);
    (stress, Tangent { secant, along: normal - secant, volumetric, coupling: coupling * a[5], direction })
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
#[path = "stage_tests.rs"]
mod tests;
