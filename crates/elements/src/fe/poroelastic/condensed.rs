//! Porous body for time stepping, with exactly eliminated displacements. Only the law's operator
//! acts on the skeleton's stiffness K_d. The displacements are therefore u = K_d⁻¹(f θ + Bᵀp'). θ
//! is the law's strain response to the force, f the load of a unit force and p' the pressure
//! divided by the law's modulus ([`super`] defines the matrices).
//!
//! The remaining unknowns are θ and one p' per pressure. They obey A ṗ' + b θ̇ + k H w = 0 and w_θ
//! = F. A = M/M̂ + B K_d⁻¹ Bᵀ is the storage matrix, b = B K_d⁻¹ f, k the mobility and F the force.
//! w and w_θ are the law's stresses for the strains p' and θ.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::solve::solve_in_place_with_conj;
use faer::{Conj, Mat, MatMut, Par};

use super::drained::{DrainedModel, dot};
use super::terms::dense_cholesky;
use crate::fe::factorisation::add_symmetric_product;
use crate::fe::transient::{ChainPart, StageSolve, StageWeights, TransientSystem};
use base::error::Result;

/// Number of columns of the storage matrix that are computed at once.
const BLOCK: usize = 64;

/// A porous body with a mobility, for [`crate::fe::transient::run`]. It has one law, that of the
/// undrained body. The unknowns are every pressure divided by the law's modulus, then the law's
/// strain response to the force (N/Pa).
pub struct CondensedPores<'a> {
    body: &'a DrainedModel<'a>,
    mobility_m2_per_pa_s: f64,
    /// All entries of the storage matrix, column by column.
    stored: Vec<f64>,
}

impl<'a> CondensedPores<'a> {
    /// Eliminates the displacements, with one solution per pressure. `mobility_m2_per_pa_s` must
    /// be ≥ 0.
    pub fn new(body: &'a DrainedModel<'a>, mobility_m2_per_pa_s: f64) -> Self {
        let n = body.load.len();
        let mut stored = Vec::with_capacity(n * n);
        for first in (0..n).step_by(BLOCK) {
            let unit = |k: usize| (0..n).map(|i| f64::from(u8::from(i == k))).collect::<Vec<f64>>();
            let columns: Vec<Vec<f64>> = (first..n.min(first + BLOCK)).map(unit).collect();
            let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
            body.apply_storage(&columns).iter().for_each(|column| stored.extend_from_slice(column));
        }
        Self { body, mobility_m2_per_pa_s, stored }
    }

    /// Returns the body with a new mobility.
    pub fn with_mobility(self, mobility_m2_per_pa_s: f64) -> Self {
        Self { mobility_m2_per_pa_s, ..self }
    }

    /// Displacement (m) of every unknown of the mesh, for given unknowns of this system.
    pub fn displacements(&self, unknowns: &[f64]) -> Vec<f64> {
        let (pressures, strain) = unknowns.split_at(unknowns.len() - 1);
        self.body.displacements(strain[0], pressures)
    }

    fn n_pressures(&self) -> usize {
        self.body.load.len()
    }
}

impl TransientSystem for CondensedPores<'_> {
    fn n_unknowns(&self) -> usize {
        self.n_pressures() + 1
    }

    fn n_laws(&self) -> usize {
        1
    }

    fn has_mass(&self) -> bool {
        false
    }

    fn factor(&self, weights: &StageWeights) -> Result<StageSolve<'_>> {
        // The stage's equation (k H + c A) w_p + c b w_θ = r is divided by c.
        let (n, rate) = (self.n_pressures(), weights.damping_per_pa_s);
        let area_m2 = self.mobility_m2_per_pa_s / rate;
        let mut matrix = Mat::from_fn(n, n, |i, j| 0.5 * (self.stored[i + n * j] + self.stored[j + n * i]));
        let diffusion = self.body.model.pressures.diffusion();
        for column in 0..n {
            for at in diffusion.col_ptr()[column]..diffusion.col_ptr()[column + 1] {
                // The factorisation reads the lower triangle. Entries of the upper triangle are
                // therefore stored transposed.
                matrix[(column, diffusion.row_idx()[at as usize] as usize)] += area_m2 * diffusion.val()[at as usize];
            }
        }
        dense_cholesky(&mut matrix)?;
        Ok(Box::new(move |right_hand_side| {
            let (pressures, strain) = right_hand_side.split_at_mut(n);
            for (p, b) in pressures.iter_mut().zip(&self.body.load) {
                *p = *p / rate - b * strain[0];
            }
            solve_in_place_with_conj(
                matrix.as_ref(),
                Conj::No,
                MatMut::from_column_major_slice_mut(pressures, n, 1),
                Par::Seq,
                MemStack::new(&mut MemBuffer::new(faer::dyn_stack::StackReq::EMPTY)),
            );
            Ok(())
        }))
    }

    fn add_product(&self, part: ChainPart, x: &[f64], result: &mut [f64]) {
        let n = self.n_pressures();
        match part {
            ChainPart::Stiffness(_) => {
                let scaled: Vec<f64> = x[..n].iter().map(|p| self.mobility_m2_per_pa_s * p).collect();
                add_symmetric_product(self.body.model.pressures.diffusion(), &scaled, &mut result[..n]);
                result[n] += x[n];
            }
            ChainPart::Damping => {
                for (column, p) in self.stored.chunks_exact(n).zip(x) {
                    result[..n].iter_mut().zip(column).for_each(|(r, a)| *r += a * p);
                }
                result.iter_mut().zip(&self.body.load).for_each(|(r, b)| *r += b * x[n]);
            }
            ChainPart::Mass => {}
        }
    }

    fn add_load(&self, force_n: f64, right_hand_side: &mut [f64]) {
        right_hand_side[self.n_pressures()] += self.body.share() * force_n;
    }

    fn position_m(&self, unknowns: &[f64]) -> f64 {
        let n = self.n_pressures();
        self.body.drained() * unknowns[n] + dot(&self.body.load, &unknowns[..n])
    }
}
