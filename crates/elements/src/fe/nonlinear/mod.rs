//! Nonlinear laws in full finite elements (physics §3.2, §3.4, §5).
//!
//! The bodies of the law are in series: one Kelvin–Voigt body whose spring may stiffen, one dashpot that may thin or yield, and further linear bodies. The
//! stress is not one field times one function of time, so that every body has its own strain at every integration point. The
//! balance is solved at every stage of every step by Newton's method on the displacements. Conjugate gradients solve its linear systems with the
//! linear stiffness, factorised once for all steps, as preconditioner. Strains are ε̄ = dev ε + ⅓Π(div u)I.
//!
//! Time is stepped by a method of order 4 (Hairer & Wanner's SDIRK), L-stable and stiffly accurate. Steps end at every row and switch and grow
//! geometrically after a switch. Steps without a balance are halved.

mod between_steps;
mod law;
pub mod point;
pub mod points;
mod run;
mod stage;
#[cfg(test)]
mod tests;

pub use super::clock::Scheme;
pub use law::Bodies;
pub use run::RowState;

use crate::fe::stepping::Resolution;
use crate::fe::{Factor, Stiffness};
use crate::mesh::Mesh;
use base::error::{Error, Result};
use base::number::Dual;
use laws::rheology::Element;
use laws::stages::{Load, Nonlinearity};
use points::IntegrationPoints;
use record::Force;

/// Refinement and accuracy of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NonlinearOptions {
    /// Time-stepping method.
    pub scheme: Scheme,
    /// Refinement of the steps. The error falls with the power of the method's order.
    pub resolution: Resolution,
    /// Largest accepted residual of the balance, relative to the largest force, both in the norm √(rᵀK̂⁻¹r).
    pub tolerance: f64,
}

impl Default for NonlinearOptions {
    /// The error of the robot's position is below 2·10⁻⁵ of the largest position.
    fn default() -> Self {
        Self { scheme: Scheme::Fourth, resolution: Resolution { steps_per_doubling: 4 }, tolerance: 1e-7 }
    }
}

/// Input of a run: a law, a load and a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NonlinearInput<'a> {
    /// Kelvin–Voigt bodies, springs and one dashpot in series. Derivatives are ignored.
    pub law: &'a [Element],
    /// Nonlinearity of the law.
    pub nonlinearity: Nonlinearity<Dual>,
    /// Stages from the commanded to the acting force.
    pub load: &'a Load,
    /// Times of the rows in s, ascending.
    pub time_s: &'a [f64],
    /// Commanded force. Nothing acts before the first row.
    pub force: Force<'a>,
}

/// Cost of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cost {
    /// Number of time steps.
    pub n_steps: usize,
    /// Number of balances solved.
    pub n_stages: usize,
    /// Number of residuals computed.
    pub n_evaluations: usize,
    /// Number of conjugate gradients.
    pub n_gradients: usize,
    /// Number of halved steps.
    pub n_retries: usize,
}

/// Result of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct NonlinearResult {
    /// Displacement of the robot (m) at every row, as the limit from the left.
    pub displacement_m: Vec<f64>,
    /// All unknowns (m) at the chosen rows, one vector after the other.
    pub fields: Vec<Vec<f64>>,
    /// Cost of the run.
    pub cost: Cost,
}

/// A mesh for nonlinear laws at one Poisson ratio. It is factorised once and run for any law and load.
pub struct NonlinearModel<'a> {
    factor: Factor<'a>,
    points: IntegrationPoints,
    robot: usize,
    share: f64,
}

impl<'a> NonlinearModel<'a> {
    /// Prepares a mesh with its assembled stiffness at a Poisson ratio in (−1, 0.5).
    ///
    /// # Errors
    /// [`Error::Numerical`] for a stiffness of another mesh, an inverted element or a Poisson ratio out of range.
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

    /// Number of integration points.
    pub fn n_points(&self) -> usize {
        self.points.count()
    }

    /// Number of unknowns.
    pub fn n_unknowns(&self) -> usize {
        self.factor.n_unknowns()
    }

    /// Runs a law through a record and keeps the fields at `rows`. Rows that the record lacks are omitted.
    ///
    /// # Errors
    /// [`Error::Numerical`] for a law that is not a series of Kelvin–Voigt bodies, springs and a dashpot, and for parameters outside their support. The run also
    /// fails if a force gradient is refused, or no balance is found in ever smaller steps.
    pub fn run(&self, what: &NonlinearInput, rows: &[usize], options: NonlinearOptions) -> Result<NonlinearResult> {
        let mut result = NonlinearResult {
            displacement_m: Vec::with_capacity(what.time_s.len()),
            fields: Vec::new(),
            cost: Cost::default(),
        };
        let cost = self.run_with_row_states(what, options, |at| {
            result.displacement_m.push(at.displacement[self.robot]);
            if rows.contains(&at.row) {
                result.fields.push(at.displacement.to_vec());
            }
        })?;
        result.cost = cost;
        Ok(result)
    }

    /// [`Self::run`] that passes every row's state to `at_row`.
    pub fn run_with_row_states(
        &self,
        what: &NonlinearInput,
        options: NonlinearOptions,
        at_row: impl FnMut(RowState),
    ) -> Result<Cost> {
        let bodies = Bodies::new(what.law, what.nonlinearity)?;
        let balance = self.balance();
        let record = run::RunRecorder { time_s: what.time_s, force: what.force, stops_s: what.time_s };
        run::run(balance, &bodies, what.load, record, options, at_row, |_, _| {})
    }

    fn balance(&self) -> stage::Balance<'_> {
        let Self { points, factor, robot, share } = self;
        stage::Balance { points, factor, robot: *robot, share: *share }
    }

    pub fn points(&self) -> &IntegrationPoints {
        &self.points
    }

    pub fn factor(&self) -> &Factor<'a> {
        &self.factor
    }

    pub fn robot(&self) -> usize {
        self.robot
    }
}
