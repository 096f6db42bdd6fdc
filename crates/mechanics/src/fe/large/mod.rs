//! Large displacements: the base laws in full finite elements with strains of any size, on the unmoved mesh (total Lagrangian; J. Bonet, R. D. Wood, Nonlinear Continuum
//! Mechanics for Finite Element Analysis, 2008, doi:10.1017/CBO9780511755446).
//!
//! **Law.** Stress and strain of physics §2 become the second Piola–Kirchhoff stress S and Green–Lagrange's strain E = ½(FᵀF − I): s = D̂⁻¹S carries the same
//! rheology as a function of E as it did of ε, and the bodies' internal strains add up to E. For the trace stands ln det F, to first order the same: a
//! St. Venant–Kirchhoff gel holds the trace of E, not its volume, and softens when it is pressed together until it gives way, while ln det F has no end. The
//! work of a strain is 2μ̂ dev s : dev δE + κ̂ tr s δ ln det F, so the stress on the unmoved surface is P = F dev S + κ̂ tr s F⁻ᵀ. Other additive or
//! multiplicative rules agree with this one to first order in the strain and differ from second order on: it is *a* gel with large displacements, objective and of the right
//! limit, not the vitreous's own law.
//!
//! **Elements** are those of the linear model; the logarithm is projected on the elements' pressures as the divergence is there (physics §3.4), so nearly incompressible
//! gels do not lock. Steps in time, Newton's method and conjugate gradients are those of [`crate::fe::nonlinear`], with the consistent tangent. Surfaces stay tied: the gel
//! neither tears nor slides, the robot does not rotate.
//!
//! **Limits.** In front of the robot elements are pressed flat, behind it drawn long, and a strain of order one is beyond what any gel is linear at; how far a mesh carries is measured in `tests/fe/large.rs`.

mod deformation;
#[cfg(test)]
mod tests;

pub(crate) use deformation::Deformation;

use crate::error::{Error, Result};
use crate::experiment::Force;
use crate::fe::Stiffness;
use crate::fe::nonlinear::{Bodies, Cost, NonlinearModel, NonlinearResult, Options};
use crate::mesh::Mesh;
use crate::number::Dual;
use crate::rheology::BaseLaw;
use crate::stages::{Load, Nonlinearity, Spatial, Stages};

/// What is run: a law, a load and a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LargeRun<'a> {
    /// Base law: lethersich, burgers or two-element.
    pub law: BaseLaw,
    /// The law's parameters, SI, in the order of [`BaseLaw::parameters`].
    pub parameters: &'a [f64],
    /// From the commanded to the acting force.
    pub load: &'a Load,
    /// Times of the rows in s, ascending.
    pub time_s: &'a [f64],
    /// Commanded force. Before the first row nothing acts.
    pub force: Force<'a>,
}

/// What came of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct LargeResult {
    /// The robot's displacement (m) at every row, the limit from the left.
    pub displacement_m: Vec<f64>,
    /// What it cost.
    pub cost: Cost,
}

/// A mesh on which the base laws are run with displacements of any size, at one Poisson ratio.
pub struct LargeModel<'a> {
    model: NonlinearModel<'a>,
}

impl<'a> LargeModel<'a> {
    /// Prepares a mesh, whose stiffness was assembled before, at a Poisson ratio in (−1, 0.5).
    ///
    /// # Errors
    /// As [`NonlinearModel::new`].
    pub fn new(mesh: &Mesh, stiffness: &'a Stiffness, poisson_ratio: f64) -> Result<Self> {
        Ok(Self { model: NonlinearModel::new(mesh, stiffness, poisson_ratio)?.with_finite_strains() })
    }

    /// Runs a law through a record.
    ///
    /// # Errors
    /// [`Error::Numerical`] for a law that is no series of Kelvin–Voigt bodies, springs and a dashpot, for parameters outside their support, and where the balance is not found
    /// in ever smaller steps; that says how far the robot came.
    pub fn run(&self, what: &LargeRun, options: Options) -> Result<LargeResult> {
        let LargeRun { law, parameters, load, time_s, force } = *what;
        let parameters: Vec<Dual> = parameters.iter().map(|p| Dual::constant(*p)).collect();
        // Without stiffening the first spring is linear.
        let nonlinearity = Nonlinearity::StrainStiffening { coefficient: Dual::ZERO };
        let law = law.elements(&parameters);
        Bodies::<f64>::new(&law, nonlinearity)?;
        let spatial = Some(Spatial::Nonlinear(nonlinearity));
        let stages = Stages { load: load.clone(), spatial, ..Stages::of_law(law) };
        match self.model.run_stages(&stages, time_s, force, &[], options) {
            Ok(NonlinearResult { displacement_m, cost, .. }) => Ok(LargeResult { displacement_m, cost }),
            Err(Error::Numerical { what, .. }) => Err(Error::numerical(
                format!("the mesh carries the robot no farther: {what}"),
                "use a smaller force, a stiffer gel or a finer mesh",
            )),
            Err(other) => Err(other),
        }
    }
}
