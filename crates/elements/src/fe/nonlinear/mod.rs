//! Nonlinear laws in full finite elements (physics §3.2, §3.4, §5).
//!
//! The law is a series of bodies: one Kelvin–Voigt body whose spring may stiffen, one dashpot that
//! may thin or yield, and further linear bodies. The stress field is not separable into a field
//! times a function of time. Every body therefore has its own strain at every integration point.
//!
//! The balance is solved at every stage of every step by Newton's method on the displacements.
//! Conjugate gradients solve the linear systems. Their preconditioner is the linear stiffness,
//! factorised once for all steps. The volume strain is projected on the element's pressure
//! functions.
//!
//! The time stepper has order 4 and is L-stable and stiffly accurate (Hairer & Wanner's SDIRK
//! method). Steps end at every row and switch. They grow geometrically after a switch. If Newton's
//! method finds no balance, the step is halved.

mod between_steps;
mod law;
pub mod point;
pub mod points;
mod run;
mod stage;
#[cfg(test)]
mod tests;

pub use super::clock::Scheme;
pub use between_steps::run_stages;
pub use law::Bodies;
pub use run::RowState;

use crate::fe::stepping::Resolution;
use crate::fe::{Factor, Stiffness};
use crate::mesh::Mesh;
use base::error::{Error, Result};
use base::number::Dual;
use faer::sparse::SparseColMatRef;
use laws::rheology::Element;
use laws::stages::{Load, Nonlinearity, Stages};
use point::Tensor;
use points::IntegrationPoints;
use record::Force;
use stage::Balance;

/// Time steps and accuracy of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NonlinearOptions {
    /// Time-stepping method.
    pub scheme: Scheme,
    /// Refinement of the time steps. The error varies with the step length to the power of the
    /// method's order.
    pub resolution: Resolution,
    /// Largest accepted residual of the force balance, relative to the largest force. Both are
    /// measured in the norm √(rᵀK̂⁻¹r) of a force vector r, with the stiffness K̂ at unit Young's
    /// modulus.
    pub tolerance: f64,
}

impl Default for NonlinearOptions {
    /// Settings for which the error of the robot's position is below 2·10⁻⁵ of the largest
    /// position.
    fn default() -> Self {
        Self { scheme: Scheme::Fourth, resolution: Resolution { steps_per_doubling: 4 }, tolerance: 1e-7 }
    }
}

/// Input of a run: law, load and record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NonlinearInput<'a> {
    /// Kelvin–Voigt bodies, springs and one dashpot in series. Derivatives carried by their
    /// parameters are ignored.
    pub law: &'a [Element],
    /// Nonlinearity of the law: stiffening, thinning or yielding.
    pub nonlinearity: Nonlinearity<Dual>,
    /// Model stages between the commanded force and the force on the robot.
    pub load: &'a Load,
    /// Times of the rows in s, ascending.
    pub time_s: &'a [f64],
    /// Commanded force. No force acts before the first row.
    pub force: Force<'a>,
}

/// Computing effort of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cost {
    /// Number of time steps.
    pub n_steps: usize,
    /// Number of stages whose balance was solved.
    pub n_stages: usize,
    /// Number of evaluations of the balance's residual.
    pub n_evaluations: usize,
    /// Number of iterations of conjugate gradients.
    pub n_gradients: usize,
    /// Number of steps that were halved.
    pub n_retries: usize,
}

/// Displacements that a run returns, and its computing effort.
#[derive(Debug, Clone, PartialEq)]
pub struct NonlinearResult {
    /// Displacement of the robot (m) at every row, just before any force step at the row.
    pub displacement_m: Vec<f64>,
    /// All unknowns (m) at the requested rows, one vector per row.
    pub fields: Vec<Vec<f64>>,
    /// Number of steps, stages and iterations of the run.
    pub cost: Cost,
}

/// A mesh at one Poisson ratio, with the linear maps between displacements, strains and forces.
pub trait Discretisation: Sync {
    /// Number of integration points.
    fn n_points(&self) -> usize;

    /// Number of displacement unknowns.
    fn n_unknowns(&self) -> usize;

    /// Index of the unknown that is the robot's translation.
    fn robot(&self) -> usize;

    /// Fraction of the robot, and of the force on it, that the mesh contains.
    fn share(&self) -> f64;

    /// Strains at every integration point for a displacement field (one value per unknown, m).
    fn strains(&self, displacement: &[f64]) -> Vec<Tensor<f64>>;

    /// Forces (N) on the unknowns due to stresses (Pa, relative to unit moduli) at every
    /// integration point.
    fn forces(&self, stresses: &[Tensor<f64>]) -> Vec<f64>;

    /// Replaces forces (N) on the unknowns by displacements (m) at unit Young's modulus.
    fn solve_unit_stiffness(&self, forces: &mut [f64]);

    /// Upper triangle of the stiffness matrix (m) at unit Young's modulus.
    fn unit_stiffness(&self) -> SparseColMatRef<'_, u32, f64>;

    /// Volume (m³) that each integration point represents.
    fn volumes_m3(&self) -> Vec<f64>;

    /// Factors from a stress relative to unit moduli to the stress: twice the shear modulus for the
    /// deviator's coordinates and the bulk modulus for the trace, at unit Young's modulus.
    fn unit_moduli(&self) -> Tensor<f64>;

    /// Displacements (m) at unit Young's modulus, for a unit force on the part of the robot in the
    /// mesh.
    fn unit_response(&self) -> Vec<f64> {
        let mut field = vec![0.0; self.n_unknowns()];
        field[self.robot()] = 1.0;
        self.solve_unit_stiffness(&mut field);
        field
    }

    /// Displacement of the robot (m) at unit Young's modulus, for a unit force on the part of the
    /// robot in the mesh.
    fn unit_compliance_per_m(&self) -> f64 {
        self.unit_response()[self.robot()]
    }
}

impl Discretisation for NonlinearModel<'_> {
    fn n_points(&self) -> usize {
        self.points.count()
    }

    fn n_unknowns(&self) -> usize {
        self.factor.n_unknowns()
    }

    fn robot(&self) -> usize {
        self.robot
    }

    fn share(&self) -> f64 {
        self.share
    }

    fn strains(&self, displacement: &[f64]) -> Vec<Tensor<f64>> {
        self.points.strains(displacement)
    }

    fn forces(&self, stresses: &[Tensor<f64>]) -> Vec<f64> {
        self.points.forces(stresses)
    }

    fn solve_unit_stiffness(&self, forces: &mut [f64]) {
        self.factor.solve_in_place(forces);
    }

    fn unit_stiffness(&self) -> SparseColMatRef<'_, u32, f64> {
        self.factor.matrix()
    }

    fn volumes_m3(&self) -> Vec<f64> {
        self.points.volumes_m3().to_vec()
    }

    fn unit_moduli(&self) -> Tensor<f64> {
        self.points.unit_moduli()
    }
}

/// Runs a law through a record, and passes the state at every row to `at_row`.
///
/// # Errors
/// Those of [`NonlinearModel::run`].
pub fn run_with_row_states(
    on: &dyn Discretisation,
    what: &NonlinearInput,
    options: NonlinearOptions,
    at_row: impl FnMut(RowState),
) -> Result<Cost> {
    let bodies = Bodies::new(what.law, what.nonlinearity)?;
    let record = run::RunRecorder { time_s: what.time_s, force: what.force, stops_s: what.time_s };
    run::run(Balance(on), &bodies, what.load, record, options, at_row, |_, _| {})
}

/// A mesh at one Poisson ratio, prepared for nonlinear laws. Its stiffness is factorised once, for
/// all laws and loads.
pub struct NonlinearModel<'a> {
    factor: Factor<'a>,
    points: IntegrationPoints,
    robot: usize,
    share: f64,
}

impl<'a> NonlinearModel<'a> {
    /// Prepares a mesh with its assembled stiffness, at a Poisson ratio in (−1, 0.5).
    ///
    /// # Errors
    /// [`Error::Numerical`] if the stiffness belongs to another mesh, an element is inverted, or
    /// the Poisson ratio is out of range.
    pub fn new(mesh: &Mesh, stiffness: &'a Stiffness, poisson_ratio: f64) -> Result<Self> {
        let unknowns = &stiffness.assembly.unknowns;
        if unknowns.n_nodes() != mesh.n_nodes() {
            return Err(Error::numerical(
                format!("the stiffness has {} nodes and the mesh {}", unknowns.n_nodes(), mesh.n_nodes()),
                "assemble the stiffness of this mesh",
            ));
        }
        let factor = stiffness.factor(poisson_ratio)?;
        let points = IntegrationPoints::new(mesh, unknowns, poisson_ratio)?;
        Ok(Self { factor, points, robot: unknowns.robot(), share: unknowns.share() })
    }

    /// Runs a law through a record and keeps the fields at the rows with the indices `rows`.
    /// Indices beyond the record are omitted.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the law is not a series of Kelvin–Voigt bodies, springs and one
    /// dashpot, or if a parameter lies outside its support. The run also fails if the force
    /// gradient is too large, or if no balance is found in ever smaller steps.
    pub fn run(&self, what: &NonlinearInput, rows: &[usize], options: NonlinearOptions) -> Result<NonlinearResult> {
        let mut result = NonlinearResult {
            displacement_m: Vec::with_capacity(what.time_s.len()),
            fields: Vec::new(),
            cost: Cost::default(),
        };
        let cost = run_with_row_states(self, what, options, |at| {
            result.displacement_m.push(at.displacement[self.robot]);
            if rows.contains(&at.row) {
                result.fields.push(at.displacement.to_vec());
            }
        })?;
        result.cost = cost;
        Ok(result)
    }

    /// Runs stages with a nonlinear law through a record, by [`run_stages`].
    ///
    /// # Errors
    /// Those of [`run_stages`].
    pub fn run_stages<'f>(
        &self,
        stages: &Stages,
        time_s: &[f64],
        force: impl Into<Force<'f>>,
        rows: &[usize],
        options: NonlinearOptions,
    ) -> Result<NonlinearResult> {
        let compliance_per_m = self.share * self.unit_compliance_per_m();
        run_stages(self, stages, (time_s, force.into()), rows, options, compliance_per_m)
    }

    pub fn factor(&self) -> &Factor<'a> {
        &self.factor
    }
}
