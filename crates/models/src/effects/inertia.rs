//! `inertia`: the gel and the robot have mass.
//!
//! The balance of forces contains the inertial forces of the gel (density times acceleration) and of the robot (mass times acceleration).
//! Both are multiplied by `density_scale`. At 1 the densities are those of the experiment. Null: 0, at which the balance has no mass, as in
//! the base model. The reduced model is a sum of terms, one for each common eigenvector of stiffness and mass. Each term is the law in
//! parallel with a mass. Valid for the linear gel in its container. Momentum diffuses over the robot's radius R in a time of about ρR²/η,
//! with ρ the gel's density and η its viscosity. In an unbounded incompressible medium the effect is the force of Basset and Boussinesq
//! (physics §4.6; Zwanzig & Bixon 1970, Phys. Rev. A 2:2005, doi:10.1103/PhysRevA.2.2005).

use nalgebra::DMatrix;

use super::field_conflicts::{memory, wave_conflict};
use super::{
    Effect, EffectDescription, EffectParameter, FieldEffect, FieldSystem, LinearField, MatrixPair, Spatial, Stage,
    Stages,
};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use elements::fe::element::TabulatedElement;
use elements::fe::meridional::EffectMatrix;
use elements::fe::spatial::{
    DegreesOfFreedom, GelAndRobot, MatrixSplitting, PhysicalProperties, SpatialSystem, SymmetricMatrix,
    element_matrices, log_spaced, stiffness,
};
use elements::mesh::Mesh;
use laws::rheology::{AdditionalTerm, BaseLaw};
use record::CharacteristicSizes;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("inertia.density_scale", "d", "1", Support::POSITIVE),
    null: &|_| Some(0.0),
    prior: &|_| Distribution::HalfNormal { sd: 1.0 },
    prior_source: "chosen: 1 is the density of the experiment",
}];

/// Effect `inertia`: the gel and the robot have mass.
pub struct Inertia;

impl Effect for Inertia {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "inertia",
            stage: Stage::Mechanics,
            summary: "gel and robot have mass",
            equation: "div σ = d ρ ü in the gel, F − (force of the gel) = d m ẍ of the robot",
            parameters: PARAMETERS,
        }
    }
    fn field(&self) -> Option<FieldEffect> {
        Some(FieldEffect::Pair(&Inertia))
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        memory(base).or_else(|| wave_conflict(base))
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let density_scale = parameters[0];
        if !density_scale.is_constant(0.0) {
            let beside = AdditionalTerm::Mass { scale: density_scale };
            stages.spatial = Some(Spatial::Linear(LinearField { effect: self.slug(), shape: None, beside }));
        }
        Ok(())
    }
}

impl MatrixPair for Inertia {
    fn words(&self) -> &'static str {
        "mass"
    }
    fn has_mass(&self) -> bool {
        true
    }
    /// Returns factors x of the mass matrix: 0, and values from 0.01/(ρ R_o²) to 100/(ρ R²). ρ is the gel's density, R_o its outer radius
    /// and R the robot's radius. Momentum diffuses over R_o at x = 1/(ρ R_o²), and over R at x = 1/(ρ R²).
    fn splitting(&self, sizes: &PhysicalProperties) -> MatrixSplitting {
        let PhysicalProperties { robot_radius_m, outer_radius_m, gel_density_kg_m3, .. } = *sizes;
        let lowest = 1e-2 / (gel_density_kg_m3 * outer_radius_m * outer_radius_m);
        let highest = 1e2 / (gel_density_kg_m3 * robot_radius_m * robot_radius_m);
        let mut snapshots = log_spaced(lowest, highest, 2.0);
        snapshots.insert(0, 0.0);
        MatrixSplitting { reference: 0.0, snapshots, is_rigid_at_null: false }
    }
    fn system(&self, surroundings: &GelAndRobot<'_>, _shape: Option<f64>) -> Result<FieldSystem> {
        let mesh = surroundings.mesh;
        let freedoms = DegreesOfFreedom::tied(mesh)?;
        let gel = stiffness(surroundings, mesh, &freedoms, |_| true)?;
        let second = mass(surroundings, mesh, &freedoms)?;
        Ok(FieldSystem { mesh: None, system: SpatialSystem::new(mesh, freedoms, gel, second)? })
    }
    fn around_sphere(&self, sizes: &PhysicalProperties, _shape: Option<f64>) -> Option<EffectMatrix> {
        Some(EffectMatrix::Mass { gel_density_kg_m3: sizes.gel_density_kg_m3, body_kg: sizes.robot_mass_kg })
    }
}

/// Mass matrix: the integral of ρ u·v over the gel, for displacements u and v and the gel's density ρ, plus the robot's mass.
fn mass(surroundings: &GelAndRobot<'_>, mesh: &Mesh, freedoms: &DegreesOfFreedom) -> Result<SymmetricMatrix> {
    let table = TabulatedElement::of(mesh.element_kind);
    let n = table.n_nodes;
    let mut elements = element_matrices(
        mesh,
        |_| true,
        |coordinates_m| {
            let mut matrix = DMatrix::zeros(3 * n, 3 * n);
            table.for_each_point(coordinates_m, |point| {
                let weight = surroundings.sizes.gel_density_kg_m3 * point.volume_m3;
                for (a, shape_a) in point.shape.iter().enumerate() {
                    for (b, shape_b) in point.shape.iter().enumerate() {
                        let value = weight * shape_a * shape_b;
                        (0..3).for_each(|i| matrix[(3 * a + i, 3 * b + i)] += value);
                    }
                }
            })?;
            Ok(matrix)
        },
    )?;
    // The robot's mass is added at one node of its surface, as all these nodes share one translation.
    let mut of_robot = DMatrix::zeros(3, 3);
    of_robot[(0, 0)] = freedoms.share() * surroundings.sizes.robot_mass_kg;
    let robot_node = &mesh.robot_nodes[..1];
    elements.push((robot_node, of_robot));
    SymmetricMatrix::assemble(freedoms, elements.into_iter())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_null_leaves_the_base_and_any_other_density_is_written() {
        let written = |parameter: Dual| {
            let mut stages = Stages::of_law(Vec::new());
            Inertia.apply(&[parameter], &SCALES, &mut stages).unwrap();
            stages.spatial
        };
        assert_eq!(written(0.0.into()), None);
        let beside = AdditionalTerm::Mass { scale: 1.0.into() };
        assert_eq!(written(1.0.into()), Some(Spatial::Linear(LinearField { effect: "inertia", shape: None, beside })));
        assert!(written(Dual::variable(0.0)).is_some());
    }
}
