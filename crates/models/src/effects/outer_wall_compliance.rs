//! `outer-wall-compliance`: the gel's outer surface is compliant.
//!
//! The outer surface is on springs of stiffness k (Pa/m). The stress on the surface is σ·n = −k u, with n its normal and u its
//! displacement, instead of u = 0. The parameter is 1/k. Null: 1/k = 0, the fixed surface. The reduced model is a sum of terms, one for
//! each common eigenvector of the stiffness of the gel and of the springs. Each term is the law in parallel with a spring. In one term the
//! gel moves as a rigid body by F/(4πR_o²k), with F the force and R_o the outer radius. Valid for walls that respond instantly and equally
//! in all directions. The closed form has the four modes of physics §4.2 with σ·n = −k u on the container. To first order the position
//! jumps with the force, as for `instantaneous-elasticity`. Only strong effects distinguish the two.

use faer::sparse::Triplet;

use super::{
    Effect, EffectDescription, EffectParameter, FieldEffect, FieldSystem, LinearField, MatrixPair, Spatial, Stage,
    Stages, largest_force_n, position_range_m, robot_radius_m,
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

/// Stiffness of the wall's springs above which the surface counts as fixed, in units of Young's modulus divided by the outer radius.
const FIXED: f64 = 1e9;

/// Returns the wall compliance 1/k, in m/Pa, at which the largest force moves the gel as a rigid body through the range of positions.
fn scale_m_per_pa(scales: &CharacteristicSizes) -> f64 {
    let radius_m = scales.outer_radius_m.unwrap_or_else(|| robot_radius_m(scales));
    4.0 * std::f64::consts::PI * radius_m.powi(2) * position_range_m(scales) / largest_force_n(scales)
}

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("outer-wall-compliance.compliance_m_per_pa", "1/k", "m/Pa", Support::POSITIVE),
    null: &|_| Some(0.0),
    prior: &|scales| Distribution::HalfNormal { sd: 0.1 * scale_m_per_pa(scales) },
    prior_source: "chosen: the largest force moves the whole gel by up to two tenths of the robot's displacement",
}];

/// Effect `outer-wall-compliance`: the gel's outer surface is compliant.
pub struct OuterWallCompliance;

impl Effect for OuterWallCompliance {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "outer-wall-compliance",
            stage: Stage::Mechanics,
            summary: "the gel's outer surface is compliant",
            equation: "σ·n = −k u on the outer surface, in place of u = 0",
            parameters: PARAMETERS,
        }
    }
    fn field(&self) -> Option<FieldEffect> {
        Some(FieldEffect::Pair(&OuterWallCompliance))
    }
    fn apply(&self, parameters: &[Dual], scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let compliance_m_per_pa = parameters[0];
        if !compliance_m_per_pa.is_constant(0.0) {
            let radius_m = scales.outer_radius_m.unwrap_or_else(|| robot_radius_m(scales));
            let beside = AdditionalTerm::Spring { compliance_per_pa: compliance_m_per_pa * radius_m.recip() };
            stages.spatial = Some(Spatial::Linear(LinearField { effect: self.slug(), shape: None, beside }));
        }
        Ok(())
    }
}

impl MatrixPair for OuterWallCompliance {
    fn words(&self) -> &'static str {
        "a compliant wall"
    }
    fn splitting(&self, _sizes: &PhysicalProperties) -> MatrixSplitting {
        let factors = log_spaced(1e-6, 1e6, 2.0).into_iter().chain([FIXED]);
        MatrixSplitting {
            reference: 1.0,
            snapshots: factors.map(|factor| factor - 1.0).collect(),
            is_rigid_at_null: true,
        }
    }
    fn system(&self, surroundings: &GelAndRobot<'_>, _shape: Option<f64>) -> Result<FieldSystem> {
        let mesh = surroundings.mesh;
        let freedoms = DegreesOfFreedom::with_free_outer_surface(mesh)?;
        let gel = stiffness(surroundings, mesh, &freedoms, |_| true)?;
        let second = springs(mesh, &freedoms, surroundings.sizes.outer_radius_m)?;
        Ok(FieldSystem { mesh: None, system: SpatialSystem::new(mesh, freedoms, gel, second)? })
    }
    fn around_sphere(&self, _sizes: &PhysicalProperties, _shape: Option<f64>) -> Option<EffectMatrix> {
        Some(EffectMatrix::OuterSprings)
    }
}

/// Matrix of ∫ u·v over the outer surface for displacements u and v, divided by the outer radius R_o. Its product with k R_o (Pa) is the
/// stiffness of wall springs of the stiffness k (Pa/m).
fn springs(mesh: &Mesh, freedoms: &DegreesOfFreedom, outer_radius_m: f64) -> Result<SymmetricMatrix> {
    let mut triplets = Vec::new();
    for_each_surface_point(mesh, &mesh.outer_nodes, |point| {
        for (&node, &shape) in point.nodes.iter().zip(point.shape).filter(|(_, shape)| **shape != 0.0) {
            for (&other, &other_shape) in point.nodes.iter().zip(point.shape).filter(|(_, shape)| **shape != 0.0) {
                let value = point.area_m2 / outer_radius_m * shape * other_shape;
                for component in 0..3 {
                    for &(i, share) in freedoms.of(node, component) {
                        for &(j, other_share) in freedoms.of(other, component).iter().filter(|(j, _)| i <= *j) {
                            triplets.push(Triplet::new(i, j, value * share * other_share));
                        }
                    }
                }
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
    fn the_null_leaves_the_base_and_any_other_wall_is_a_spring() {
        let written = |parameter: Dual| {
            let mut stages = Stages::of_law(Vec::new());
            OuterWallCompliance.apply(&[parameter], &SCALES, &mut stages).unwrap();
            stages.spatial
        };
        assert_eq!(written(0.0.into()), None);
        let beside = AdditionalTerm::Spring { compliance_per_pa: Dual::constant(0.02) * 10e-3_f64.recip() };
        let wall = LinearField { effect: "outer-wall-compliance", shape: None, beside };
        assert_eq!(written(0.02.into()), Some(Spatial::Linear(wall)));
    }
}
