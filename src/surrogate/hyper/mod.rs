//! A hyper-reduced surrogate of nonlinear laws: few modes, few integration points, the same answers (physics §3.3).
//!
//! Full runs over a box of parameters give displacement fields, of which the proper orthogonal decomposition keeps a few modes, and stresses, from which
//! the empirical cubature chooses a few points with weights. What then is left of the gel is a handful of coordinates and the strains of its bodies at those points;
//! it is stepped by the method of the full model, but with steps that do not end at rows.

mod cubature;
mod kernel;
mod lanes;
mod stepper;
#[cfg(test)]
mod tests;
mod train;

pub use train::{HyperTraining, NonlinearFamily, train};

use crate::effects::Load;
use crate::error::{Error, Result};
use crate::fe::nonlinear::{Bodies, Nonlinearity};
use crate::model::TrainedRange;
use crate::number::Dual;
use crate::rheology::BaseLaw;
use kernel::{CubaturePoints, MOST_MODES};
use lanes::{Block, Carrying, Plain};
use pulp::{Arch, Simd, WithSimd};
use serde::{Deserialize, Serialize};
use stepper::Reduced;

/// What a surrogate is, as it is kept on disk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HyperReduced {
    /// Name of the base law.
    pub law: String,
    /// What is not linear.
    pub family: NonlinearFamily,
    /// Ranges of the law's parameters and, last, of the nonlinear one inside which it may be asked.
    pub ranges: Vec<TrainedRange>,
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Number of modes m.
    pub n_modes: usize,
    /// The robot's translation in each mode.
    pub robot: Vec<f64>,
    /// Share of the whole body's force that the meshed part carries.
    pub force_share: f64,
    /// Weight of every point, in m³.
    pub weights_m3: Vec<f64>,
    /// Strains of the modes at the points (1/m of a coordinate): point by point, six tensor coordinates, m modes.
    pub strains: Vec<f64>,
    /// 2μ̂ and κ̂ for unit Young's modulus.
    pub unit_moduli: [f64; 2],
    /// Singular values of the normalised snapshots, relative to the largest.
    pub singular_values: Vec<f64>,
    /// What the points leave of the training states' forces, relative to them.
    pub cubature_residual: f64,
    /// Full runs that trained it.
    pub training_runs: usize,
    /// Full runs at other parameters that it was compared with.
    pub verification_runs: usize,
    /// Largest distance of a reduced trajectory from a full one in these, relative to the latter's amplitude; 0 without any.
    pub max_relative_error: f64,
    /// Unknowns of the full model.
    pub fe_unknowns: usize,
}

/// A surrogate made ready to run.
#[derive(Debug, Clone)]
pub struct HyperModel {
    reduced: HyperReduced,
    law: BaseLaw,
    points: CubaturePoints,
}

/// What is run: a law's parameters, a load and a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HyperRun<'a> {
    /// The law's parameters, SI, in the order of [`BaseLaw::parameters`].
    pub parameters: &'a [Dual],
    /// What is not linear about it.
    pub nonlinearity: Nonlinearity<Dual>,
    /// From the commanded to the acting force.
    pub load: &'a Load,
    /// Times of the rows in s, ascending.
    pub time_s: &'a [f64],
    /// Commanded force in N; row i's holds on [tᵢ, tᵢ₊₁). Before the first row nothing acts.
    pub force_n: &'a [f64],
}

/// A run, to be compiled for the vector registers that the processor has.
struct Job<'a, B: Block> {
    reduced: &'a Reduced<'a>,
    bodies: &'a Bodies<B::Scalar>,
    plain_bodies: &'a Bodies<f64>,
    load: &'a Load,
    time_s: &'a [f64],
    force_n: &'a [f64],
}

impl<B: Block> WithSimd for Job<'_, B> {
    type Output = Result<Vec<B::Scalar>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        stepper::run::<B>(self.reduced, self.bodies, self.plain_bodies, self.load, self.time_s, self.force_n)
    }
}

impl NonlinearFamily {
    /// Steps in which the time since a switch doubles. A spring that has stiffened lets go and stiffens again the other way within one doubling.
    fn steps_per_doubling(self) -> f64 {
        match self {
            Self::StrainStiffening => 4.0,
            Self::ShearThinning { .. } | Self::YieldStress { .. } => 2.0,
        }
    }
}

impl HyperModel {
    /// Makes a surrogate ready.
    ///
    /// # Errors
    /// [`Error::Numerical`] where its parts do not fit together, as in a damaged file.
    pub fn new(reduced: HyperReduced) -> Result<Self> {
        let (m, n) = (reduced.n_modes, reduced.weights_m3.len());
        let law = BaseLaw::named(&reduced.law);
        let fits = (1..=MOST_MODES).contains(&m)
            && n > 0
            && reduced.robot.len() == m
            && reduced.strains.len() == 6 * m * n
            && law.is_some_and(|law| reduced.ranges.len() == law.parameters().len() + 1);
        let Some(law) = law.filter(|_| fits) else {
            return Err(Error::numerical(
                format!("a surrogate of {m} modes and {n} points for the law {:?} is incomplete", reduced.law),
                "delete the cached surrogate and build it again",
            ));
        };
        let points = CubaturePoints::new(m, &reduced.strains, &reduced.weights_m3, reduced.unit_moduli);
        Ok(Self { reduced, law, points })
    }

    /// What is kept on disk.
    pub fn reduced(&self) -> &HyperReduced {
        &self.reduced
    }

    /// Number of points.
    pub fn n_points(&self) -> usize {
        self.reduced.weights_m3.len()
    }

    /// The robot's displacement (m) at every row, the limit from the left; derivatives are ignored.
    ///
    /// # Errors
    /// [`Error::OutsideTrainedRange`]; [`Error::Numerical`] for another nonlinearity than the trained one, where a force gradient is refused, and where
    /// the reduced balance is not found.
    pub fn run(&self, what: &HyperRun) -> Result<Vec<f64>> {
        self.check(what)?;
        let bodies = Bodies::<f64>::new(self.law, what.parameters, what.nonlinearity)?;
        let reduced = self.stepped();
        let (load, time_s, force_n) = (what.load, what.time_s, what.force_n);
        let (bodies, plain_bodies) = (&bodies, &bodies);
        Arch::new().dispatch(Job::<Plain> { reduced: &reduced, bodies, plain_bodies, load, time_s, force_n })
    }

    /// The same with the derivative in the direction that the parameters, the nonlinearity and the load carry.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn run_dual(&self, what: &HyperRun) -> Result<Vec<Dual>> {
        self.check(what)?;
        let plain = Bodies::<f64>::new(self.law, what.parameters, what.nonlinearity)?;
        let bodies = Bodies::<Dual>::new(self.law, what.parameters, what.nonlinearity)?;
        let reduced = self.stepped();
        let (load, time_s, force_n) = (what.load, what.time_s, what.force_n);
        let (bodies, plain_bodies) = (&bodies, &plain);
        Arch::new().dispatch(Job::<Carrying> { reduced: &reduced, bodies, plain_bodies, load, time_s, force_n })
    }

    fn stepped(&self) -> Reduced<'_> {
        Reduced {
            points: &self.points,
            robot: &self.reduced.robot,
            share: self.reduced.force_share,
            steps_per_doubling: self.reduced.family.steps_per_doubling(),
        }
    }

    fn check(&self, what: &HyperRun) -> Result<()> {
        let Some(last) = self.reduced.family.parameter(what.nonlinearity) else {
            return Err(Error::numerical(
                format!("the surrogate is of {:?}, and {:?} is asked for", self.reduced.family, what.nonlinearity),
                "train a surrogate for that nonlinearity",
            ));
        };
        let values = what.parameters.iter().map(|p| p.value).chain([last.value]);
        for (range, value) in self.reduced.ranges.iter().zip(values) {
            if !range.contains(value) {
                let (parameter, lower, upper) = (range.name.clone(), range.lower, range.upper);
                return Err(Error::OutsideTrainedRange { parameter, value, lower, upper });
            }
        }
        Ok(())
    }
}
