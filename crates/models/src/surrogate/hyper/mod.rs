//! Hyper-reduced surrogate of nonlinear laws with few modes and few integration points (physics §3.3).
//!
//! Full-order runs over a box of parameters give displacement fields and stresses. Proper orthogonal decomposition keeps a few modes of the fields, and
//! empirical cubature selects a few points with weights from the stresses. The reduced gel is a handful of coordinates and the strains of its bodies at those points.
//! It is stepped by the full-order model's method, but with steps that do not end at rows.
//!
//! Only the excess over a linear law is used. The linear law is stepped in parallel by this method, with an equal compliance, and subtracted. The closed-form
//! response of the linear law is added to the excess (see [`crate::model::Response`]). At the null the response is therefore exactly the base's, and errors of steps and
//! of the mesh affect the excess alone.

mod cubature;
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

/// Content of a surrogate, as stored on disk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HyperReducedData {
    /// Kind of the nonlinear law.
    pub family: NonlinearFamily,
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Translation of the robot in each of the m modes.
    pub robot: [f64; N_MODES],
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
    /// Relative residual of the cubature for the training states' forces.
    pub cubature_residual: f64,
    /// Number of full-order runs that trained it.
    pub training_runs: usize,
    /// Number of full-order runs at other parameters that verified it.
    pub verification_runs: usize,
    /// Largest difference of a reduced trajectory from a full-order one in these, relative to the latter's amplitude; 0 without such runs.
    pub max_relative_error: f64,
    /// Number of unknowns of the full-order model.
    pub fe_unknowns: usize,
}

/// Surrogate that is ready to run. Copies share its numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(into = "HyperReducedData", try_from = "HyperReducedData")]
pub struct HyperModel(Arc<Ready>);

#[derive(Debug, PartialEq)]
struct Ready {
    reduced: HyperReducedData,
    points: CubaturePoints<N_MODES>,
    /// One point and one mode of equal compliance.
    linear: CubaturePoints<1>,
    /// Displacement (1/m) of the robot per force at unit creep compliance, for a linear law.
    compliance_per_m: f64,
    /// Largest equivalent strain at the points per force (Pa/N), for an elastic law.
    strain_per_force: f64,
}

/// Run, compiled for the processor's vector registers.
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

/// Number of steps in which the time since a switch doubles, without stiffening.
fn steps_per_doubling(family: NonlinearFamily) -> f64 {
    match family {
        NonlinearFamily::StrainStiffening => 2.0,
        NonlinearFamily::ShearThinning | NonlinearFamily::YieldStress => 1.0,
    }
}

/// Linear bodies with equal parameters.
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

    /// Prepares a surrogate.
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

/// Coordinates per force (m/N at unit modulus) for a linear law, from the modes and the points; `None` if the points' stiffness is singular.
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
    /// Content that is stored on disk.
    pub fn reduced(&self) -> &HyperReducedData {
        &self.0.reduced
    }

    /// Number of points.
    pub fn n_points(&self) -> usize {
        self.0.reduced.weights_m3.len()
    }

    /// Excess in one number type. The surrogate's compliance differs from the whole model's by the error of its mesh and its points. Positions are
    /// scaled by the ratio.
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
            // Points at rest yield first, and the direction in which they would move is undetermined.
            return Err(Error::numerical(
                "the derivative with respect to the yield stress cannot be computed at 0",
                "compute it as a finite difference from 0",
            ));
        }
        self.excess::<DualLanes>(stages, compliance_per_m, time_s, force)
    }
}
