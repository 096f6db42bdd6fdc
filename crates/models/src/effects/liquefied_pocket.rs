//! `liquefied-pocket`: the gel around the robot has lost elasticity.
//!
//! Within ρ_p robot radii of the robot's initial centre, the modulus E is reduced to (1 − φ) E, with φ the elastic loss. The viscosities
//! are unchanged. E is the law's first Kelvin–Voigt spring, else its first spring, else the modulus of its first springpot. Null: φ = 0,
//! where ρ_p is unidentified. Valid for a concentric pocket around a sphere that moves much less than the pocket's width. For any ρ_p
//! between 1.5 and 5, the mesh has element faces at the pocket's edge. The reduced model is a sum of terms, one for each common eigenvector
//! of the stiffness inside and outside the pocket. A term is the laws inside and outside in parallel. The closed form has two concentric
//! layers, each with the four modes of physics §4.2. Liquefied lacunae are common in aged vitreous (Sebag 1987, Graefe's Arch. Clin. Exp.
//! Ophthalmol. 225:89, doi:10.1007/BF02160337).

use nalgebra::Vector3;

use super::first_body::{body, elements_of, first_body_mut, first_element_mut, in_series};
use super::{
    Effect, EffectDescription, EffectParameter, FieldEffect, FieldSystem, LinearField, MatrixPair, ShapeParameter,
    Spatial, Stage, Stages,
};
use base::distribution::Distribution;
use base::error::{Error, Result};
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use elements::fe::meridional::EffectMatrix;
use elements::fe::spatial::{
    DegreesOfFreedom, GelAndRobot, MatrixSplitting, PhysicalProperties, SpatialSystem, log_spaced, stiffness,
};
use elements::mesh::{Mesh, QuarterBall};
use laws::rheology::{AdditionalTerm, BaseLaw, Element};
use record::CharacteristicSizes;

/// Range of the pocket's radius, in robot radii, for which meshes are built.
const RADIUS_RATIOS: [f64; 2] = [1.5, 5.0];
/// Number of element layers inside a pocket for every twelve layers of the model.
const LAYERS_INSIDE: usize = 4;
/// Number of element layers by which a mesh with a pocket exceeds the model's mesh.
const MORE_LAYERS: usize = 1;
/// Smallest remaining fraction of the modulus inside a pocket. Without elasticity the pocket would flow forever. With this fraction it
/// flows for 10⁹ retardation times.
const LEAST_SHARE: f64 = 1e-9;

const NO_ELASTICITY: &str = "it has neither a spring nor a springpot whose elasticity a pocket could reduce";

const PARAMETERS: &[EffectParameter] = &[
    EffectParameter {
        spec: ParameterSpec::new("liquefied-pocket.elastic_loss", "φ", "1", Support { lower: 0.0, upper: 1.0 }),
        null: &|_| Some(0.0),
        prior: &|_| Distribution::Uniform { lower: 0.0, upper: 1.0 },
        prior_source: "chosen: any loss is equally likely",
    },
    EffectParameter {
        spec: ParameterSpec::new(
            "liquefied-pocket.radius_ratio",
            "ρ_p",
            "1",
            Support { lower: RADIUS_RATIOS[0], upper: RADIUS_RATIOS[1] },
        ),
        null: &|_| None,
        prior: &|_| Distribution::LogUniform { lower: RADIUS_RATIOS[0], upper: RADIUS_RATIOS[1] },
        prior_source: "chosen: any radius that can be meshed is equally likely",
    },
];

/// Effect `liquefied-pocket`: the gel around the robot has lost elasticity.
pub struct LiquefiedPocket;

impl Effect for LiquefiedPocket {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "liquefied-pocket",
            stage: Stage::Mechanics,
            summary: "the gel around the robot has lost elasticity",
            equation: "E → (1 − φ) E within ρ_p radii of the initial centre",
            parameters: PARAMETERS,
        }
    }
    fn field(&self) -> Option<FieldEffect> {
        Some(FieldEffect::Pair(&LiquefiedPocket))
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        let has_elasticity = elastic_mut(&mut elements_of(base)).is_some();
        (!has_elasticity).then_some(NO_ELASTICITY)
    }
    fn signature_size(&self, _scales: &CharacteristicSizes) -> Option<f64> {
        Some(0.5)
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let (loss, radius_ratio) = (parameters[0], parameters[1]);
        if !(0.0..=1.0).contains(&loss.value) {
            return Err(Error::numerical(
                format!("{} = {} is outside [0, 1]", PARAMETERS[0].spec.name, loss.value),
                "give a loss from 0 to 1",
            ));
        }
        if loss.is_constant(0.0) {
            return Ok(());
        }
        stages.spatial = Some(Spatial::Linear(LinearField {
            effect: self.slug(),
            shape: Some(radius_ratio),
            beside: AdditionalTerm::Law(pocket_law(&stages.law, loss)?),
        }));
        Ok(())
    }
}

/// Returns the law inside the pocket, from the law outside and from the fraction of the elasticity that is lost.
///
/// # Errors
/// [`Error::Numerical`] for a law of dashpots alone.
fn pocket_law(law: &[Element], elastic_loss: Dual) -> Result<Vec<Element>> {
    let mut inside = law.to_vec();
    let share = Dual::ONE - elastic_loss;
    let share = if share.value < LEAST_SHARE { Dual { value: LEAST_SHARE, ..share } } else { share };
    match elastic_mut(&mut inside) {
        Some(elastic) => *elastic = elastic.scaled(share),
        None => {
            return Err(Error::numerical(
                format!("no pocket is possible in this law: {NO_ELASTICITY}"),
                "leave `liquefied-pocket` out",
            ));
        }
    }
    Ok(inside)
}

/// Element of a law that loses elasticity in the pocket. It is the spring of the first Kelvin–Voigt body in series, else the first spring,
/// else the first springpot, in the order of the law.
fn elastic_mut(law: &mut [Element]) -> Option<&mut Element> {
    let is_spring = |element: &Element| matches!(element, Element::Spring { .. });
    let is_springpot = |element: &Element| matches!(element, Element::Springpot { .. });
    if in_series(law).into_iter().any(|element| body(element).is_some()) {
        let first = first_body_mut(law, |_| true)?;
        return first_element_mut(std::slice::from_mut(first), is_spring);
    }
    let has_spring = first_element_mut(law, is_spring).is_some();
    first_element_mut(law, if has_spring { is_spring } else { is_springpot })
}

impl MatrixPair for LiquefiedPocket {
    fn words(&self) -> &'static str {
        "a softer pocket"
    }
    fn lacks(&self, surroundings: &GelAndRobot<'_>) -> Option<&'static str> {
        surroundings.sizes.ball.is_none().then_some("a pocket needs the built-in mesh around a sphere")
    }
    /// Returns the pocket's radius in robot radii as shape parameter. Around a sphere, the robot's displacement and two amplitudes at the
    /// pocket's edge determine the gel's field (physics §4.2). Let θ be the fraction of an eigenvector's stiffness that the pocket
    /// contributes (physics §7.2). θ has exactly three values: 0 if the pocket moves as a whole, 1 if the gel outside does not move, and
    /// one value between.
    fn shape(&self) -> Option<ShapeParameter> {
        Some(ShapeParameter { name: PARAMETERS[1].spec.name, range: RADIUS_RATIOS })
    }
    /// Returns factors x for which the pocket's law is 1 + x times the law outside, with −1 < x ≤ 0.
    fn splitting(&self, _sizes: &PhysicalProperties) -> MatrixSplitting {
        let snapshots = log_spaced(1e-4, 1.0, 2.0).iter().map(|share| share - 1.0).collect();
        MatrixSplitting { reference: 1.0, snapshots, is_rigid_at_null: false }
    }
    /// Assembles the stiffness inside and outside the pocket. An element belongs to the pocket if its centre is inside.
    fn system(&self, surroundings: &GelAndRobot<'_>, shape: Option<f64>) -> Result<FieldSystem> {
        let radius_m = shape.unwrap_or(f64::NAN) * surroundings.sizes.robot_radius_m;
        let mesh = pocket_mesh(&surroundings.sizes, radius_m)?;
        let freedoms = DegreesOfFreedom::tied(&mesh)?;
        let is_inside = |nodes: &[u32]| middle_distance_m(&mesh, nodes) < radius_m;
        let second = stiffness(surroundings, &mesh, &freedoms, is_inside)?;
        let gel = stiffness(surroundings, &mesh, &freedoms, |nodes| !is_inside(nodes))?;
        let system = SpatialSystem::new(&mesh, freedoms, gel, second)?;
        Ok(FieldSystem { mesh: Some(mesh), system })
    }
    fn around_sphere(&self, sizes: &PhysicalProperties, shape: Option<f64>) -> Option<EffectMatrix> {
        Some(EffectMatrix::GelWithin { radius_m: shape.unwrap_or(f64::NAN) * sizes.robot_radius_m })
    }
}

/// Mesh with element faces at the radius (m) of a pocket, as fine as the model's mesh.
///
/// # Errors
/// [`Error::Numerical`] if the robot is not a sphere in the middle of a built-in mesh, or if the pocket does not fit.
fn pocket_mesh(sizes: &PhysicalProperties, radius_m: f64) -> Result<Mesh> {
    let ball = sizes.ball.ok_or_else(|| {
        Error::numerical(
            "a liquefied pocket needs the built-in mesh around a sphere in the middle of the vitreous",
            "leave `liquefied-pocket` out for other robots, for robots off the centre (`offset_mm`) and for meshes from files",
        )
    })?;
    let n_inside = (ball.n_layers * LAYERS_INSIDE).div_ceil(12);
    QuarterBall { n_layers: ball.n_layers + MORE_LAYERS, ..ball }.mesh_with_interface(radius_m, n_inside)
}

fn middle_distance_m(mesh: &Mesh, nodes: &[u32]) -> f64 {
    let sum: Vector3<f64> = nodes.iter().map(|&n| Vector3::from(mesh.node_coordinates_m[n as usize])).sum();
    sum.norm() / nodes.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::test_scales::SCALES;

    #[test]
    fn the_pocket_has_the_law_with_less_of_its_spring() {
        let law = |modulus_pa: f64| BaseLaw::Lethersich.elements(&[modulus_pa.into(), 1.4.into(), 47.0.into()]);
        let written = |loss: Dual| {
            let mut stages = Stages::of_law(law(4.0));
            LiquefiedPocket.apply(&[loss, 2.0.into()], &SCALES, &mut stages).unwrap();
            stages.spatial
        };
        assert_eq!(written(0.0.into()), None);
        assert!(written(0.75.into()).is_some() && written(Dual::variable(0.0)).is_some());
        assert_eq!(pocket_law(&law(4.0), 0.75.into()).unwrap(), law(1.0));
        assert_eq!(pocket_law(&law(4.0), Dual::ONE).unwrap(), law(4.0 * LEAST_SHARE));
        assert!(pocket_law(&law(4.0)[1..], Dual::ONE).is_err_and(|error| error.to_string().contains(NO_ELASTICITY)));
    }
}
