//! Adds an effect that changes the displacement field: `cargo run --release --example custom_field_effect`.
//!
//! `stiff-rim`: Young's modulus is 1 + a times as large in the outer third of the gel. The null is a = 0. The effect assembles two stiffness matrices. Full
//! time stepping and the reduced model follow from them and are compared here.

use nalgebra::Vector3;
use vitreo_uq::Result;
use vitreo_uq::base::distribution::Distribution;
use vitreo_uq::base::number::Dual;
use vitreo_uq::base::parameter::{ParameterSpec, Support};
use vitreo_uq::elements::fe::spatial::{
    DegreesOfFreedom, GelAndRobot, MatrixSplitting, PhysicalProperties, SpatialSystem, log_spaced, stiffness,
};
use vitreo_uq::laws::rheology::{AdditionalTerm, Element};
use vitreo_uq::models::effects::{
    Effect, EffectDescription, EffectParameter, FieldEffect, FieldSystem, Library, LinearField, MatrixPair, Spatial,
    Stage, Stages,
};
use vitreo_uq::models::model::Forward;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::prepared::PreparedModel;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica;
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::CharacteristicSizes;

struct StiffRim;

const PARAMETERS: &[EffectParameter] = &[EffectParameter {
    spec: ParameterSpec::new("stiff-rim.excess", "a", "1", Support::POSITIVE),
    null: &|_| Some(0.0),
    prior: &|_| Distribution::HalfNormal { sd: 2.0 },
    prior_source: "chosen: up to some times as stiff",
}];

/// Returns the element with the modulus of every spring multiplied by `factor`. Other elements stay unchanged.
fn stiffened(element: &Element, factor: Dual) -> Element {
    match element {
        Element::Spring { modulus_pa } => Element::Spring { modulus_pa: *modulus_pa * factor },
        Element::Parallel(parts) => Element::Parallel(parts.iter().map(|part| stiffened(part, factor)).collect()),
        other => other.clone(),
    }
}

impl Effect for StiffRim {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "stiff-rim",
            stage: Stage::Mechanics,
            summary: "the gel is stiffer near its outer surface",
            equation: "E → (1 + a) E in the outer third of the radius",
            parameters: PARAMETERS,
        }
    }
    fn field(&self) -> Option<FieldEffect> {
        Some(FieldEffect::Pair(&StiffRim))
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        if !parameters[0].is_constant(0.0) {
            let factor = Dual::ONE + parameters[0];
            let rim = stages.law.iter().map(|element| stiffened(element, factor)).collect();
            let (effect, beside) = (self.slug(), AdditionalTerm::Law(rim));
            stages.spatial = Some(Spatial::Linear(LinearField { effect, shape: None, beside }));
        }
        Ok(())
    }
}

impl MatrixPair for StiffRim {
    fn words(&self) -> &'static str {
        "a stiff rim"
    }
    /// Values of the second matrix's coefficient x at which snapshots are taken. The rim is 1 + x times as stiff as the gel.
    fn splitting(&self, _sizes: &PhysicalProperties) -> MatrixSplitting {
        let snapshots = log_spaced(1.0, 1e3, 2.0).iter().map(|factor| factor - 1.0).collect();
        MatrixSplitting { reference: 1.0, snapshots, is_rigid_at_null: false }
    }
    fn system(&self, surroundings: &GelAndRobot<'_>, _shape: Option<f64>) -> Result<FieldSystem> {
        let (mesh, inner_radius_m) = (surroundings.mesh, surroundings.sizes.outer_radius_m * 2.0 / 3.0);
        let freedoms = DegreesOfFreedom::tied(mesh)?;
        let is_rim = |nodes: &[u32]| {
            let sum: Vector3<f64> = nodes.iter().map(|&n| Vector3::from(mesh.node_coordinates_m[n as usize])).sum();
            sum.norm() > inner_radius_m * nodes.len() as f64
        };
        let second = stiffness(surroundings, mesh, &freedoms, is_rim)?;
        let gel = stiffness(surroundings, mesh, &freedoms, |nodes| !is_rim(nodes))?;
        Ok(FieldSystem { mesh: None, system: SpatialSystem::new(mesh, freedoms, gel, second)? })
    }
}

fn main() -> Result<()> {
    let library = Library::default().with(&StiffRim);
    let (experiment, _) = replica::embedded()?;
    let specification = ModelSpecification { effects: vec!["stiff-rim".into()], ..ModelSpecification::default() };
    let problem = Problem::with_library(experiment, specification, &library, None, &SilentMonitor)?;
    let prepared = PreparedModel::unverified(&problem, None, &SilentMonitor)?;
    let full = problem.full_forward()?.expect("the replica has finite elements");
    let largest = |from: &[f64], to: &[f64]| from.iter().zip(to).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    let trajectory = |excess: f64| prepared.forward().trajectory_m(&[3.527, 1.402, 47.370, excess]);
    let soft = trajectory(0.0)?;
    for excess in [0.5, 4.0] {
        let stiff = trajectory(excess)?;
        let error_m = largest(&stiff, &full.trajectory_m(&[3.527, 1.402, 47.370, excess])?);
        println!(
            "a rim {:.1} times as stiff moves the robot by {:.2} µm; reduced and full model differ by {:.4} µm",
            1.0 + excess,
            1e6 * largest(&stiff, &soft),
            1e6 * error_m
        );
    }
    Ok(())
}
