//! Nonlinear laws in full finite elements (physics §3.2, §3.4, §5).
//!
//! The bodies of the law are in series: one Kelvin–Voigt body whose spring may stiffen, one dashpot that may thin or yield, and more linear bodies. The
//! stress is no longer one field times one function of time, so every body keeps its strain at every integration point, and the
//! balance is solved at every stage of every step: Newton's method on the displacements, its linear systems by conjugate gradients with the
//! linear stiffness, factorised once for all steps, as preconditioner. Strains are ε̄ = dev ε + ⅓Π(div u)I.
//!
//! Time is stepped by a method of order 4 (Hairer & Wanner's SDIRK), L-stable and stiffly accurate, in steps that end at every row and switch and grow
//! geometrically after a switch. A step whose balance is not found is halved.

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
pub use run::AtRow;

use crate::fe::stepping::Resolution;
use crate::fe::{Factor, Stiffness};
use crate::mesh::Mesh;
use base::error::{Error, Result};
use base::number::Dual;
use laws::rheology::Element;
use laws::stages::{Load, Nonlinearity};
use points::IntegrationPoints;
use record::Force;

/// How fine a run is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Method of the steps.
    pub scheme: Scheme,
    /// How fine the steps are; the error falls with the power of the method's order.
    pub resolution: Resolution,
    /// Largest residual of the balance that is accepted, relative to the largest force, both in the norm √(rᵀK̂⁻¹r).
    pub tolerance: f64,
}

impl Default for Options {
    /// The robot's position errs by less than 2·10⁻⁵ of its largest.
    fn default() -> Self {
        Self { scheme: Scheme::Fourth, resolution: Resolution { steps_per_doubling: 4 }, tolerance: 1e-7 }
    }
}

/// What is run: a law, a load and a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NonlinearRun<'a> {
    /// Kelvin–Voigt bodies, springs and one dashpot in series; derivatives are ignored.
    pub law: &'a [Element],
    /// What is not linear about them.
    pub nonlinearity: Nonlinearity<Dual>,
    /// From the commanded to the acting force.
    pub load: &'a Load,
    /// Times of the rows in s, ascending.
    pub time_s: &'a [f64],
    /// Commanded force. Before the first row nothing acts.
    pub force: Force<'a>,
}

/// What a run cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cost {
    /// Steps in time.
    pub n_steps: usize,
    /// Balances solved.
    pub n_stages: usize,
    /// Residuals computed.
    pub n_evaluations: usize,
    /// Conjugate gradients.
    pub n_gradients: usize,
    /// Steps that were halved.
    pub n_retries: usize,
}

/// What came of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct NonlinearResult {
    /// The robot's displacement (m) at every row, the limit from the left.
    pub displacement_m: Vec<f64>,
    /// All unknowns (m) at the chosen rows, one vector after the other.
    pub fields: Vec<Vec<f64>>,
    /// What it cost.
    pub cost: Cost,
}

/// A mesh on which nonlinear laws are run, at one Poisson ratio: factorised once, run for any law and load.
pub struct NonlinearModel<'a> {
    factor: Factor<'a>,
    points: IntegrationPoints,
    robot: usize,
    share: f64,
}

impl<'a> NonlinearModel<'a> {
    /// Prepares a mesh, whose stiffness was assembled before, at a Poisson ratio in (−1, 0.5).
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

    /// Runs a law through a record; fields are kept at `rows`, those that the record does not have left out.
    ///
    /// # Errors
    /// [`Error::Numerical`] for a law that is no series of Kelvin–Voigt bodies, springs and a dashpot, for parameters outside their support, where a force
    /// gradient is refused, and where the balance is not found in ever smaller steps.
    pub fn run(&self, what: &NonlinearRun, rows: &[usize], options: Options) -> Result<NonlinearResult> {
        let mut result = NonlinearResult {
            displacement_m: Vec::with_capacity(what.time_s.len()),
            fields: Vec::new(),
            cost: Cost::default(),
        };
        let cost = self.watch(what, options, |at| {
            result.displacement_m.push(at.displacement[self.robot]);
            if rows.contains(&at.row) {
                result.fields.push(at.displacement.to_vec());
            }
        })?;
        result.cost = cost;
        Ok(result)
    }

    /// [`Self::run`] with every row's state shown to `at_row`.
    pub fn watch(&self, what: &NonlinearRun, options: Options, at_row: impl FnMut(AtRow)) -> Result<Cost> {
        let bodies = Bodies::new(what.law, what.nonlinearity)?;
        let balance = self.balance();
        let record = run::Record { time_s: what.time_s, force: what.force, stops_s: what.time_s };
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
