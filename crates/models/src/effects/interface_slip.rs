//! `interface-slip`: the gel slips along the robot's surface.
//!
//! The gel follows the robot in the normal direction. In tangential directions it slips at the velocity ġ = t/β, with t the tangential
//! stress and β the surface's friction coefficient (Pa s/m). Null: 1/β = 0, no slip. The reduced model is a sum of terms, one for each
//! common eigenvector of the stiffness and the surface's friction. Each term is the law in parallel with a dashpot. Valid for a thin
//! lubricated layer. A body with edges slips only in directions that are tangential to all adjacent faces. In an unbounded incompressible
//! medium the drag on a sphere of radius R is multiplied by (1 + 2b/R)/(1 + 3b/R) (physics §4.7; Basset 1888, A Treatise on Hydrodynamics,
//! vol. 2). Here b = G/(βs) is the slip length, with G the shear modulus at the Laplace variable s. The effect is close to
//! `second-retardation`, and to first order it equals a change of the flow viscosity c₂.

use faer::sparse::Triplet;
use nalgebra::Vector3;

use super::{
    Effect, EffectDescription, EffectParameter, FieldEffect, FieldSystem, LinearField, MatrixPair, Spatial, Stage,
    Stages, apparent_viscosity_pa_s, robot_radius_m,
};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use elements::fe::meridional::EffectMatrix;
use elements::fe::spatial::{
    DegreesOfFreedom, GelAndRobot, MatrixSplitting, PhysicalProperties, SpatialSystem, SymmetricMatrix, log_spaced,
    stiffness,
};
use elements::fe::surface::for_each_surface_point;
use elements::mesh::Mesh;
use laws::rheology::AdditionalTerm;
use record::CharacteristicSizes;

/// Product of friction and the robot's radius, relative to the stiffness, above which the surface counts as sticking.
const STICKING_FRICTION: f64 = 1e9;

/// Returns the slip compliance 1/β, in m/(Pa s), at which the slip length equals the robot's radius.
fn scale_m_per_pa_s(scales: &CharacteristicSizes) -> f64 {
    robot_radius_m(scales) / apparent_viscosity_pa_s(scales)
}

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("interface-slip.slip_compliance_m_per_pa_s", "1/β", "m/(Pa s)", Support::POSITIVE),
    null: &|_| Some(0.0),
    prior: &|scales| Distribution::HalfNormal { sd: 2.0 * scale_m_per_pa_s(scales) },
    prior_source: "chosen: slip lengths up to a few radii, at the viscosity estimated from the largest force and the displacement in a hold",
}];

/// Effect `interface-slip`: the gel slips along the robot's surface.
pub struct InterfaceSlip;

impl Effect for InterfaceSlip {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "interface-slip",
            stage: Stage::Mechanics,
            summary: "the gel slips along the robot's surface",
            equation: "ġ = t/β, g the slip along the surface, t the stress along it",
            parameters: PARAMETERS,
        }
    }
    fn field(&self) -> Option<FieldEffect> {
        Some(FieldEffect::Pair(&InterfaceSlip))
    }
    fn signature_size(&self, scales: &CharacteristicSizes) -> Option<f64> {
        Some(0.03 * scale_m_per_pa_s(scales))
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let compliance_m_per_pa_s = parameters[0];
        if !compliance_m_per_pa_s.is_constant(0.0) {
            let beside = AdditionalTerm::Friction { compliance: compliance_m_per_pa_s };
            stages.spatial = Some(Spatial::Linear(LinearField { effect: self.slug(), shape: None, beside }));
        }
        Ok(())
    }
}

impl MatrixPair for InterfaceSlip {
    fn words(&self) -> &'static str {
        "slip on the robot"
    }
    /// Returns factors x of the friction matrix: 0, values from 0.001/R to 1000/R with R the robot's radius, and a value at which the
    /// surface sticks. Friction and stiffness are comparable at x = 1/R.
    fn splitting(&self, sizes: &PhysicalProperties) -> MatrixSplitting {
        let radius_m = sizes.robot_radius_m;
        let mut snapshots: Vec<f64> = log_spaced(1e-3, 1e3, 2.0).iter().map(|x| x / radius_m).collect();
        snapshots.insert(0, 0.0);
        snapshots.push(STICKING_FRICTION / radius_m);
        MatrixSplitting { reference: 0.0, snapshots, is_rigid_at_null: true }
    }
    fn system(&self, surroundings: &GelAndRobot<'_>, _shape: Option<f64>) -> Result<FieldSystem> {
        let mesh = surroundings.mesh;
        let freedoms = DegreesOfFreedom::slipping(mesh)?;
        let gel = stiffness(surroundings, mesh, &freedoms, |_| true)?;
        let second = friction(mesh, &freedoms)?;
        Ok(FieldSystem { mesh: None, system: SpatialSystem::new(mesh, freedoms, gel, second)? })
    }
    fn around_sphere(&self, _sizes: &PhysicalProperties, _shape: Option<f64>) -> Option<EffectMatrix> {
        Some(EffectMatrix::Slip)
    }
}

/// Friction matrix: the integral of g·g over the robot's surface, with g the gel's tangential slip.
fn friction(mesh: &Mesh, freedoms: &DegreesOfFreedom) -> Result<SymmetricMatrix> {
    let mut triplets = Vec::new();
    for_each_surface_point(mesh, &mesh.robot_nodes, |point| {
        let normal = Vector3::from(point.normal);
        // `slips` holds the tangential slip at this point for a unit of each unknown.
        let mut slips: Vec<(u32, Vector3<f64>)> = Vec::new();
        for (&node, &shape) in point.nodes.iter().zip(point.shape) {
            for i in 0..3 {
                for &(unknown, share) in freedoms.of(node, i).iter().filter(|(unknown, _)| freedoms.is_slip(*unknown)) {
                    let mut direction = Vector3::zeros();
                    direction[i] = share * shape;
                    match slips.iter_mut().find(|(other, _)| *other == unknown) {
                        Some((_, sum)) => *sum += direction,
                        None => slips.push((unknown, direction)),
                    }
                }
            }
        }
        for (_, slip) in &mut slips {
            *slip -= normal * normal.dot(slip);
        }
        for (i, a) in &slips {
            for (j, b) in slips.iter().filter(|(j, _)| i <= j) {
                triplets.push(Triplet::new(*i, *j, point.area_m2 * a.dot(b)));
            }
        }
    });
    SymmetricMatrix::from_triplets(freedoms.count(), &triplets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_null_leaves_the_base_and_any_other_slip_is_written() {
        let written = |parameter: Dual| {
            let mut stages = Stages::of_law(Vec::new());
            InterfaceSlip.apply(&[parameter], &SCALES, &mut stages).unwrap();
            stages.spatial
        };
        assert_eq!(written(0.0.into()), None);
        let beside = AdditionalTerm::Friction { compliance: 2.0.into() };
        let slip = LinearField { effect: "interface-slip", shape: None, beside };
        assert_eq!(written(2.0.into()), Some(Spatial::Linear(slip)));
    }
}
