//! The porous gel around a robot at one drained Poisson ratio. It holds the factor of the drained
//! skeleton; conjugate gradients compute the pressures.

use super::{PoreModel, pressure::PressureFactor};
use crate::fe::factorisation::Factor;
use base::error::{Error, Result};

/// Relative residual at which the iteration for the pressures ends, in the preconditioner's norm.
/// The error of the results is proportional to the square of this value.
const TOLERANCE: f64 = 1e-10;
/// Largest number of iterations. The preconditioner is spectrally equivalent to the matrix, so that
/// the number does not grow with the mesh. More iterations indicate a defect.
const MOST_ITERATIONS: usize = 400;

/// Pore pressures that solve the equations of the porous gel, with their product with the storage
/// matrix.
#[derive(Debug, Clone)]
pub(super) struct Pressure {
    pub values: Vec<f64>,
    /// Storage matrix times the pressures.
    pub stored: Vec<f64>,
}

/// Moduli of the porous gel, in units of Young's modulus of the undrained gel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moduli {
    /// Stiffness of the base model at the drained Poisson ratio, for unit Young's modulus, divided
    /// by the stiffness of the drained skeleton.
    pub softness: f64,
    /// Inverse storage modulus: 1/(undrained − drained bulk modulus).
    pub inverse_storage_modulus: f64,
    /// Storage for irrotational fields: `inverse_storage_modulus` + 1/(κ̂ + 4μ̂/3), with the
    /// drained bulk modulus κ̂ and the shear modulus μ̂. It is an upper bound for any field.
    pub storage: f64,
}

impl Moduli {
    pub fn new(undrained_poisson_ratio: f64, drained_poisson_ratio: f64) -> Self {
        let two_mu = 1.0 / (1.0 + undrained_poisson_ratio);
        let kappa = |nu: f64| two_mu * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu));
        let (undrained, drained) = (kappa(undrained_poisson_ratio), kappa(drained_poisson_ratio));
        let inverse_storage_modulus = 1.0 / (undrained - drained);
        Self {
            softness: (1.0 + undrained_poisson_ratio) / (1.0 + drained_poisson_ratio),
            inverse_storage_modulus,
            storage: inverse_storage_modulus + 1.0 / (drained + 2.0 * two_mu / 3.0),
        }
    }
}

/// The porous gel at one drained Poisson ratio. Young's modulus of the undrained gel and the force
/// on the meshed part of the robot are 1.
pub struct DrainedModel<'a> {
    pub(super) model: &'a PoreModel<'a>,
    pub(super) moduli: Moduli,
    factor: Factor<'a>,
    /// Displacements of the drained skeleton for a unit force on the meshed part of the robot.
    unit_response: Vec<f64>,
    /// Load on the pressures: the divergence of `unit_response`.
    pub(super) load: Vec<f64>,
}

impl<'a> DrainedModel<'a> {
    pub fn new(model: &'a PoreModel<'a>, drained_poisson_ratio: f64) -> Result<Self> {
        let moduli = Moduli::new(model.poisson_ratio, drained_poisson_ratio);
        let factor = model.stiffness.factor(drained_poisson_ratio)?;
        let unit_response: Vec<f64> = factor.unit_response().iter().map(|u| moduli.softness * u).collect();
        let load = model.pressures.divergence(&unit_response);
        Ok(Self { model, moduli, factor, unit_response, load })
    }

    /// Drained compliance in 1/m: displacement of the robot times Young's modulus of the undrained
    /// gel, divided by the force on the robot. All pore pressures have vanished. The force acts on
    /// the whole robot, also if symmetry allows to mesh only a part of it.
    pub fn drained_compliance_per_m(&self) -> f64 {
        self.share() * self.drained()
    }

    /// Compliance in 1/m at every drainage area τ ≥ 0 (mobility × modulus / Laplace variable, m²).
    /// The compliance is the displacement of the robot times Young's modulus of the undrained gel,
    /// divided by the force on the whole robot.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the iteration for the pressures does not converge.
    pub fn compliances_per_m(&self, areas_m2: &[f64]) -> Result<Vec<f64>> {
        let solved = self.pressures(areas_m2)?;
        Ok(solved.iter().map(|p| self.share() * (self.drained() - dot(&self.load, &p.values))).collect())
    }

    /// Fraction of the force on the whole robot that acts on its meshed part.
    pub(super) fn share(&self) -> f64 {
        self.model.stiffness.assembly.unknowns.share()
    }

    /// Displacement of the robot in the drained gel, for a unit force on the meshed part of the
    /// robot.
    pub(super) fn drained(&self) -> f64 {
        self.unit_response[self.unit_response.len() - 1]
    }

    /// Displacements of all unknowns for a force (N) on the meshed part of the robot and given pore
    /// pressures.
    pub(super) fn displacements(&self, force_n: f64, pressures: &[f64]) -> Vec<f64> {
        let mut field = vec![0.0; self.unit_response.len()];
        self.model.pressures.add_transposed_divergence(pressures, &mut field);
        self.solve_skeleton(&mut field);
        field.iter_mut().zip(&self.unit_response).for_each(|(u, w)| *u += force_n * w);
        field
    }

    /// Replaces each column of forces by the displacements of the drained skeleton. The columns are
    /// stored one after the other.
    pub(super) fn solve_skeleton(&self, columns: &mut [f64]) {
        columns.iter_mut().for_each(|f| *f *= self.moduli.softness);
        self.factor.solve_in_place(columns);
    }

    /// Products of the storage matrix A = M/M̂ + B K_d⁻¹ Bᵀ with every column ([`super`] defines
    /// the matrices).
    pub(super) fn apply_storage(&self, columns: &[&[f64]]) -> Vec<Vec<f64>> {
        let (pressures, n) = (&self.model.pressures, self.model.pressures.n_displacements());
        let mut block = vec![0.0; n * columns.len()];
        for (column, field) in columns.iter().zip(block.chunks_exact_mut(n)) {
            pressures.add_transposed_divergence(column, field);
        }
        self.solve_skeleton(&mut block);
        let product = |(column, field): (&&[f64], &[f64])| {
            let mut result = pressures.divergence(field);
            pressures.add_product(self.moduli.inverse_storage_modulus, 0.0, column, &mut result);
            result
        };
        columns.iter().zip(block.chunks_exact(n)).map(product).collect()
    }

    /// Returns the pressures (A + τH)⁻¹ b for every drainage area τ (m²). A is the storage matrix,
    /// H the diffusion matrix and b the load. All τ are treated together, so that the skeleton is
    /// solved in blocks. The preconditioner is S M + τH, with the storage S for irrotational fields
    /// and the mass matrix M. It is an upper bound of A + τH and equals it on irrotational fields.
    pub(super) fn pressures(&self, areas_m2: &[f64]) -> Result<Vec<Pressure>> {
        let mut systems: Vec<Conjugate> =
            areas_m2.iter().map(|&area| Conjugate::new(self, area)).collect::<Result<_>>()?;
        for _ in 0..MOST_ITERATIONS {
            let mut active: Vec<&mut Conjugate> = systems.iter_mut().filter(|system| !system.is_done()).collect();
            if active.is_empty() {
                return Ok(systems.into_iter().map(|s| Pressure { values: s.pressure, stored: s.stored }).collect());
            }
            let directions: Vec<&[f64]> = active.iter().map(|system| system.direction.as_slice()).collect();
            let stored = self.apply_storage(&directions);
            active.iter_mut().zip(stored).for_each(|(system, stored)| system.advance(self, &stored));
        }
        Err(Error::numerical(
            format!("the pore pressures do not converge in {MOST_ITERATIONS} iterations at the areas {areas_m2:?} m²"),
            "check the mesh for flat elements",
        ))
    }
}

/// State of the conjugate-gradient iteration at one drainage area.
struct Conjugate<'a> {
    area_m2: f64,
    preconditioner: PressureFactor<'a>,
    pressure: Vec<f64>,
    stored: Vec<f64>,
    residual: Vec<f64>,
    direction: Vec<f64>,
    /// Squared norm of the residual r: r · P⁻¹r, with the preconditioner P.
    square: f64,
    /// Squared norm of the residual at the start.
    first_square: f64,
}

impl<'a> Conjugate<'a> {
    fn new(body: &DrainedModel<'a>, area_m2: f64) -> Result<Self> {
        let preconditioner = body.model.pressures.factor(body.moduli.storage, area_m2)?;
        let mut direction = body.load.clone();
        preconditioner.solve_in_place(&mut direction);
        let square = dot(&body.load, &direction);
        let zeros = vec![0.0; direction.len()];
        Ok(Self {
            area_m2,
            preconditioner,
            pressure: zeros.clone(),
            stored: zeros,
            residual: body.load.clone(),
            direction,
            square,
            first_square: square,
        })
    }

    fn is_done(&self) -> bool {
        self.square <= TOLERANCE * TOLERANCE * self.first_square
    }

    /// Performs one iteration. `stored` is the storage matrix times the search direction.
    fn advance(&mut self, body: &DrainedModel, stored: &[f64]) {
        let mut product = stored.to_vec();
        body.model.pressures.add_product(0.0, self.area_m2, &self.direction, &mut product);
        let step = self.square / dot(&self.direction, &product);
        add_scaled(step, &self.direction, &mut self.pressure);
        add_scaled(step, stored, &mut self.stored);
        add_scaled(-step, &product, &mut self.residual);
        let mut next = self.residual.clone();
        self.preconditioner.solve_in_place(&mut next);
        let square = dot(&self.residual, &next);
        add_scaled(square / self.square, &self.direction, &mut next);
        (self.direction, self.square) = (next, square);
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn add_scaled(factor: f64, x: &[f64], result: &mut [f64]) {
    result.iter_mut().zip(x).for_each(|(r, x)| *r += factor * x);
}
