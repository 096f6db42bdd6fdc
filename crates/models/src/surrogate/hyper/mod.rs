//! Hyper-reduced surrogate of nonlinear laws, with a few modes and a few integration points (physics §3.3).
//!
//! Full-order runs over a box of parameters give displacement fields and stresses. Proper orthogonal decomposition keeps a few modes of the
//! fields. Empirical cubature uses the stresses to select a few integration points with weights. The surrogate's state consists of the
//! factors of the modes and the strains of the law's bodies at these points. The surrogate is stepped by the full-order model's method, but
//! with steps that do not end at rows.
//!
//! Only the excess over a linear law is used. The same method steps a linear law of equal compliance, whose position is
//! subtracted. The closed-form response of the linear law is then added to the excess (see [`crate::model::Response`]). At the
//! null the response is therefore exactly that of the base, and errors of time steps and mesh affect only the excess.

mod kernel;
mod lanes;
mod stepper;
#[cfg(test)]
mod tests;
mod train;

pub use train::{HyperSettings, build};

use base::error::{Error, Result};
use base::number::{Dual, PointScalar};
use elements::fe::nonlinear::Bodies;
use kernel::CubaturePoints;
use lanes::{DualLanes, LaneBlock, Plain};
use laws::stages::{FieldStepper, Load, NonlinearFamily, Nonlinearity, Spatial, Stages};
use nalgebra::{DMatrix, DVector};
use pulp::{Arch, Simd, WithSimd};
use record::Force;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use stepper::{Fineness, Reduced, StepperMember};

/// Number of modes of a surrogate.
pub const N_MODES: usize = 6;

/// Data of a surrogate that are stored on disk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HyperReducedData {
    /// Kind of the nonlinear law.
    pub family: NonlinearFamily,
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Translation of the robot in each mode.
    pub robot: [f64; N_MODES],
    /// Fraction of the whole robot's force that the meshed symmetric section carries.
    pub force_share: f64,
    /// Weight of every cubature point, in m³.
    pub weights_m3: Vec<f64>,
    /// Strains of the modes at the cubature points, in 1/m for a unit factor of the mode. They are ordered by point, then by the
    /// six tensor coordinates, then by mode.
    pub strains: Vec<f64>,
    /// Twice the shear modulus and the bulk modulus, for unit Young's modulus.
    pub unit_moduli: [f64; 2],
    /// Singular values of the normalised snapshots, relative to the largest.
    pub singular_values: Vec<f64>,
    /// Residual of the cubature for the forces of the training states, relative to these forces.
    pub cubature_residual: f64,
    /// Number of full-order runs that trained the surrogate.
    pub training_runs: usize,
    /// Number of full-order runs that verified the surrogate, at other parameters.
    pub verification_runs: usize,
    /// Largest difference of a reduced from a full-order trajectory in the verification runs, relative to the full-order amplitude; 0
    /// without verification runs.
    pub max_relative_error: f64,
    /// Number of unknowns of the full-order model that trained the surrogate.
    pub fe_unknowns: usize,
}

/// Hyper-reduced surrogate of a nonlinear law that is ready to run. Clones share its data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(into = "HyperReducedData", try_from = "HyperReducedData")]
pub struct HyperModel(Arc<Ready>);

#[derive(Debug, PartialEq)]
struct Ready {
    reduced: HyperReducedData,
    points: CubaturePoints<N_MODES>,
    /// Linear model with one cubature point and one mode, and with the compliance of the surrogate.
    linear: CubaturePoints<1>,
    /// Displacement of the robot per force at unit creep compliance, in 1/m, for a linear law.
    compliance_per_m: f64,
    /// Largest equivalent strain at the points per force, times the modulus (Pa/N), for an elastic law.
    strain_per_force: f64,
}

/// Run of the stepper, compiled for the processor's vector registers.
struct Job<'a, B: LaneBlock> {
    law: StepperMember<'a, B::Scalar, N_MODES>,
    linear: StepperMember<'a, B::Scalar, 1>,
    fineness: Fineness,
    load: &'a Load,
    time_s: &'a [f64],
    force: Force<'a>,
}

impl<B: LaneBlock> WithSimd for Job<'_, B> {
    type Output = Result<Vec<B::Scalar>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        stepper::run::<B, S, N_MODES>(simd, self.law, self.linear, self.fineness, self.load, self.time_s, self.force)
    }
}

/// Returns the number of time steps in which the time since a switch of the force doubles, without stiffening.
fn steps_per_doubling(family: NonlinearFamily) -> f64 {
    match family {
        NonlinearFamily::StrainStiffening => 2.0,
        NonlinearFamily::ShearThinning | NonlinearFamily::YieldStress => 1.0,
    }
}

/// Returns the bodies with a linear law in place of the nonlinear law, and with the same linear parameters.
fn linear_bodies<N: PointScalar>(bodies: &Bodies<N>) -> Bodies<N> {
    let nonlinearity = Nonlinearity::StrainStiffening { coefficient: N::constant(0.0) };
    Bodies { nonlinearity, ..bodies.clone() }
}

impl From<HyperModel> for HyperReducedData {
    fn from(model: HyperModel) -> Self {
        model.0.reduced.clone()
    }
}

impl TryFrom<HyperReducedData> for HyperModel {
    type Error = Error;

    /// Checks the data of a surrogate and prepares it to run.
    fn try_from(reduced: HyperReducedData) -> Result<Self> {
        let n = reduced.weights_m3.len();
        let damaged = || {
            Error::numerical(
                format!("a surrogate of {n} points is incomplete"),
                "delete the cached surrogate and build it again",
            )
        };
        let fits = n > 0
            && reduced.strains.len() == 6 * N_MODES * n
            && reduced.unit_moduli.iter().all(|modulus| *modulus > 0.0);
        if !fits {
            return Err(damaged());
        }
        let points = CubaturePoints::new(&reduced.strains, &reduced.weights_m3, reduced.unit_moduli);
        let field = linear_field(&reduced).ok_or_else(damaged)?;
        let compliance_per_m: f64 = reduced.robot.iter().zip(&field).map(|(robot, z)| robot * z).sum();
        if compliance_per_m.is_nan() || compliance_per_m <= 0.0 {
            return Err(damaged());
        }
        let strain_per_force = points.largest_strain(&field);
        let weight_m3 = reduced.force_share / (compliance_per_m * reduced.unit_moduli[0]);
        let linear = CubaturePoints::new(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], &[weight_m3], reduced.unit_moduli);
        Ok(Self(Arc::new(Ready { reduced, points, linear, compliance_per_m, strain_per_force })))
    }
}

/// Returns the factors of the modes per force (m/N at unit modulus) for a linear law, from the stiffness at the points; `None` if
/// this stiffness is singular.
fn linear_field(reduced: &HyperReducedData) -> Option<[f64; N_MODES]> {
    let m = N_MODES;
    let mut stiffness = DMatrix::<f64>::zeros(m, m);
    for (weight, strains) in reduced.weights_m3.iter().zip(reduced.strains.chunks_exact(6 * m)) {
        for (c, row) in strains.chunks_exact(m).enumerate() {
            let row = DVector::from_column_slice(row);
            let modulus = reduced.unit_moduli[usize::from(c == 5)];
            stiffness += &row * row.transpose() * (weight * modulus);
        }
    }
    let robot = DVector::from_column_slice(&reduced.robot);
    let field = stiffness.cholesky()?.solve(&robot) * reduced.force_share;
    Some(std::array::from_fn(|i| field[i]))
}

impl HyperModel {
    /// Data of the surrogate that are stored on disk.
    pub fn reduced(&self) -> &HyperReducedData {
        &self.0.reduced
    }

    /// Number of cubature points.
    pub fn n_points(&self) -> usize {
        self.0.reduced.weights_m3.len()
    }

    /// Returns the excess (m) of the nonlinear law's position over that of the linear law at every row. The surrogate's own compliance
    /// differs from `compliance_per_m` by the errors of its mesh and its points. Positions are scaled by the ratio of the two compliances.
    fn excess<B: LaneBlock>(
        &self,
        stages: &Stages,
        compliance_per_m: f64,
        time_s: &[f64],
        force: Force<'_>,
    ) -> Result<Vec<B::Scalar>> {
        let nonlinearity = self.nonlinearity(stages)?;
        let bodies = Bodies::<B::Scalar>::new(&stages.law, nonlinearity)?;
        let plain_bodies = Bodies::<f64>::new(&stages.law, nonlinearity)?;
        let (linear_bodies, plain_linear_bodies) = (linear_bodies(&bodies), linear_bodies(&plain_bodies));
        let Ready { reduced, points, linear, compliance_per_m: own_per_m, strain_per_force } = &*self.0;
        let scale = compliance_per_m / own_per_m;
        let load = stages.load.in_position_unit(scale);
        let share = reduced.force_share;
        let law = Reduced { points, robot: reduced.robot, share };
        let alone = Reduced { points: linear, robot: [1.0], share };
        let steps_per_doubling = steps_per_doubling(reduced.family);
        let mut excess_m = Arch::new().dispatch(Job::<B> {
            law: StepperMember { reduced: law, bodies: &bodies, plain_bodies: &plain_bodies },
            linear: StepperMember { reduced: alone, bodies: &linear_bodies, plain_bodies: &plain_linear_bodies },
            fineness: Fineness { steps_per_doubling, strain_per_force: *strain_per_force },
            load: &load,
            time_s,
            force,
        })?;
        excess_m.iter_mut().for_each(|x| *x = *x * scale);
        Ok(excess_m)
    }

    fn nonlinearity(&self, stages: &Stages) -> Result<Nonlinearity<Dual>> {
        match stages.spatial {
            Some(Spatial::Nonlinear(law)) if law.family() == self.0.reduced.family => Ok(law),
            _ => Err(Error::numerical(
                format!("the surrogate is for {:?}, but the model has another law", self.0.reduced.family),
                "build the surrogate for that law",
            )),
        }
    }
}

impl FieldStepper for HyperModel {
    fn excess_m(&self, stages: &Stages, compliance_per_m: f64, time_s: &[f64], force: Force<'_>) -> Result<Vec<f64>> {
        self.excess::<Plain>(stages, compliance_per_m, time_s, force)
    }

    fn excess_dual_m(
        &self,
        stages: &Stages,
        compliance_per_m: f64,
        time_s: &[f64],
        force: Force<'_>,
    ) -> Result<Vec<Dual>> {
        if let Nonlinearity::YieldStress { stress_pa, .. } = self.nonlinearity(stages)?
            && stress_pa.value == 0.0
            && stress_pa.derivative != 0.0
        {
            // Points at rest yield first, and the direction of their motion is undetermined.
            return Err(Error::numerical(
                "the derivative with respect to the yield stress cannot be computed at 0",
                "compute it as a finite difference from 0",
            ));
        }
        self.excess::<DualLanes>(stages, compliance_per_m, time_s, force)
    }
}
