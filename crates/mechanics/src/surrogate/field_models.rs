//! The reduced models of the effects that change the displacement field, as many as a problem asks for.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::hyper::{self, HyperModel, HyperSettings};
use super::spread::{SpreadModes, snapshot_values};
use crate::effects::{
    FieldModel, NonlinearFamily, POCKET_RADIUS_RATIOS, Spatial, Spread, Stages, Stepped, drained_range, pocket_law,
};
use crate::error::{Error, Result};
use crate::fe::poroelastic::{PoreModel, PoreSpectrum, SpectrumSettings};
use crate::fe::spatial::{Sizes, SpatialKind, SpatialSystem, Surroundings};
use crate::model::Model;
use crate::number::{Dual, Scalar};
use crate::rheology::{Beside, SpreadTerm};

/// Singular values below this fraction of the largest carry no mode.
const TOLERANCE: f64 = 1e-6;
/// Radii at which the pocket's terms are computed.
const N_RADII: usize = 8;
/// Shares nearer to 0 or 1 are that.
const NEAR: f64 = 0.05;

/// Reduced models; those that nobody asked for are missing.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FieldModels {
    /// Mass.
    pub inertia: Option<SpreadModes>,
    /// Slip.
    pub slip: Option<SpreadModes>,
    /// Pocket.
    pub pocket: Option<PocketModel>,
    /// Pore flow.
    pub pores: Option<PoreSpectrum>,
    /// Laws that are not linear.
    #[serde(default)]
    pub nonlinear: BTreeMap<NonlinearFamily, HyperModel>,
}

/// The pocket's terms at any radius.
///
/// Around a sphere the gel's field is known by the robot's displacement and two amplitudes at the pocket's edge (physics §4.2), so that exactly three shares occur: 0, where the pocket
/// moves as a whole, 1, where the rest stands still, and one between. Finite elements split the last by their error; its mean stands for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PocketModel {
    /// ln of the three weights and the logit of the share between, radius by radius, at Chebyshev points of ln ρ_p.
    at_radii: Vec<[f64; 4]>,
}

impl FieldModels {
    /// Pieces of work that building one takes.
    pub fn n_pieces(model: FieldModel) -> usize {
        match model {
            FieldModel::Inertia | FieldModel::Slip | FieldModel::PoreFlow => 1,
            FieldModel::Pocket => N_RADII,
            FieldModel::Nonlinear(family) => HyperSettings::of(family).n_runs(),
        }
    }

    /// Builds one; `piece_done` is called, from any thread, after every piece.
    ///
    /// # Errors
    /// Those of the full models.
    pub fn build(model: FieldModel, surroundings: &Surroundings<'_>, piece_done: &(dyn Fn() + Sync)) -> Result<Self> {
        let modes = |kind: SpatialKind| {
            let system = SpatialSystem::new(surroundings, surroundings.mesh, kind)?;
            let modes = modes_of(surroundings, &system, kind)?;
            piece_done();
            Ok(modes)
        };
        let mut fields = Self::default();
        match model {
            FieldModel::Inertia => fields.inertia = Some(modes(SpatialKind::Inertia)?),
            FieldModel::Slip => fields.slip = Some(modes(SpatialKind::Slip)?),
            FieldModel::Pocket => fields.pocket = Some(PocketModel::new(surroundings, piece_done)?),
            FieldModel::PoreFlow => {
                let model = PoreModel::new(surroundings.mesh, surroundings.stiffness, surroundings.poisson_ratio)?;
                let drained_poisson_ratio = drained_range(surroundings.poisson_ratio);
                let settings = SpectrumSettings { drained_poisson_ratio, ..SpectrumSettings::default() };
                fields.pores = Some(PoreSpectrum::build(&model, &settings)?);
                piece_done();
            }
            FieldModel::Nonlinear(family) => {
                let settings = HyperSettings::of(family);
                fields.nonlinear.insert(family, hyper::build(surroundings, family, &settings, piece_done)?);
            }
        }
        Ok(fields)
    }

    /// These, and of the others those that are missing here.
    pub fn or(self, other: Self) -> Self {
        let mut nonlinear = other.nonlinear;
        nonlinear.extend(self.nonlinear);
        Self {
            nonlinear,
            inertia: self.inertia.or(other.inertia),
            slip: self.slip.or(other.slip),
            pocket: self.pocket.or(other.pocket),
            pores: self.pores.or(other.pores),
        }
    }

    /// Whether one is there.
    pub fn has(&self, model: FieldModel) -> bool {
        match model {
            FieldModel::Inertia => self.inertia.is_some(),
            FieldModel::Slip => self.slip.is_some(),
            FieldModel::Pocket => self.pocket.is_some(),
            FieldModel::PoreFlow => self.pores.is_some(),
            FieldModel::Nonlinear(family) => self.nonlinear.contains_key(&family),
        }
    }

    /// What building the model of a law that is not linear found as its largest distance from full runs, relative to their amplitude; `None` for models
    /// without such a law.
    pub fn verified(&self, model: &Model) -> Option<f64> {
        model.effects().iter().find_map(|effect| match effect.field_model() {
            Some(FieldModel::Nonlinear(family)) => self.nonlinear.get(&family).map(|m| m.reduced().max_relative_error),
            _ => None,
        })
    }

    /// What becomes of the stages' effect; `None` where they have none.
    ///
    /// # Errors
    /// [`Error::Numerical`] for a model that was not built; [`Error::OutsideTrainedRange`].
    pub fn spread(&self, stages: &Stages) -> Result<Option<Spread>> {
        let missing = || {
            Error::numerical("the reduced model was not built for this effect", "build it with the effect in the model")
        };
        Ok(match &stages.spatial {
            None => None,
            Some(Spatial::Inertia { density_scale }) => {
                let beside = Beside::Mass { scale: *density_scale };
                Some(Spread::Terms { beside, terms: terms_of(self.inertia.as_ref().ok_or_else(missing)?) })
            }
            Some(Spatial::Slip { compliance_m_per_pa_s }) => {
                let beside = Beside::Friction { compliance: *compliance_m_per_pa_s };
                Some(Spread::Terms { beside, terms: terms_of(self.slip.as_ref().ok_or_else(missing)?) })
            }
            Some(Spatial::Pocket { radius_ratio, elastic_loss }) => {
                let terms = self.pocket.as_ref().ok_or_else(missing)?.terms(*radius_ratio)?;
                Some(Spread::Terms { beside: Beside::Law(pocket_law(&stages.law, *elastic_loss)?), terms })
            }
            Some(Spatial::PoreFlow { mobility_m2_per_pa_s, drained_poisson_ratio }) => {
                let pores = self.pores.as_ref().ok_or_else(missing)?;
                let undrained = SpreadTerm { weight: Dual::ONE, number: Dual::ZERO };
                let flowing = pores.terms(*drained_poisson_ratio)?;
                let flowing = flowing.iter().map(|term| SpreadTerm { weight: term.weight, number: term.area_m2 });
                let beside = Beside::Friction { compliance: *mobility_m2_per_pa_s };
                Some(Spread::Terms { beside, terms: [undrained].into_iter().chain(flowing).collect() })
            }
            Some(Spatial::Nonlinear(law)) => {
                let model = self.nonlinear.get(&law.family()).ok_or_else(missing)?;
                Some(Spread::Stepped(Stepped(Arc::new(model.clone()))))
            }
        })
    }
}

fn modes_of(surroundings: &Surroundings<'_>, system: &SpatialSystem, kind: SpatialKind) -> Result<SpreadModes> {
    let Sizes { robot_radius_m, outer_radius_m, gel_density_kg_m3, .. } = surroundings.sizes;
    SpreadModes::new(system, &snapshot_values(kind, robot_radius_m, outer_radius_m, gel_density_kg_m3), TOLERANCE)
}

/// Weights relative to the base, which returns exactly where nothing is beside the law.
fn terms_of(modes: &SpreadModes) -> Vec<SpreadTerm> {
    let pairs = || modes.weights.iter().zip(&modes.numbers);
    // Without slip only terms with μ = 0 are left, without mass all are.
    let stuck: f64 = pairs().filter(|(_, number)| **number == 0.0).map(|(weight, _)| weight).sum();
    let base = if stuck > 0.0 { stuck } else { modes.weights.iter().sum() };
    let term = |(weight, number): (&f64, &f64)| SpreadTerm { weight: (weight / base).into(), number: (*number).into() };
    pairs().map(term).collect()
}

impl PocketModel {
    fn new(surroundings: &Surroundings<'_>, radius_done: &(dyn Fn() + Sync)) -> Result<Self> {
        let [lower, upper] = POCKET_RADIUS_RATIOS.map(f64::ln);
        let radius = |i: usize| {
            let x = -(PI * (i as f64 + 0.5) / N_RADII as f64).cos();
            (0.5 * (lower + upper) + 0.5 * (upper - lower) * x).exp() * surroundings.sizes.robot_radius_m
        };
        let at = |i: usize| {
            let radius_m = radius(i);
            let (kind, mesh) = (SpatialKind::Pocket { radius_m }, surroundings.pocket_mesh(radius_m)?);
            let modes = modes_of(surroundings, &SpatialSystem::new(surroundings, &mesh, kind)?, kind)?;
            radius_done();
            Ok(modes)
        };
        let modes: Vec<SpreadModes> = (0..N_RADII).into_par_iter().map(at).collect::<Result<_>>()?;
        let at_radii: Vec<[f64; 4]> = modes.iter().map(three_terms).collect();
        if at_radii.iter().flatten().any(|x| !x.is_finite()) {
            return Err(Error::numerical(
                "the pocket's reduced model lacks one of its three terms",
                "use a finer mesh around the robot",
            ));
        }
        Ok(Self { at_radii })
    }

    /// The terms at a radius over the robot's.
    ///
    /// # Errors
    /// [`Error::OutsideTrainedRange`].
    pub fn terms(&self, radius_ratio: Dual) -> Result<Vec<SpreadTerm>> {
        let [lower, upper] = POCKET_RADIUS_RATIOS;
        if !(lower..=upper).contains(&radius_ratio.value) {
            let parameter = "liquefied-pocket.radius_ratio".into();
            return Err(Error::OutsideTrainedRange { parameter, value: radius_ratio.value, lower, upper });
        }
        let (a, b) = (lower.ln(), upper.ln());
        let x = (radius_ratio.ln() * 2.0 - Dual::constant(a + b)) * (b - a).recip();
        let shares = lagrange(x);
        let value =
            |k: usize| self.at_radii.iter().zip(&shares).fold(Dual::ZERO, |sum, (own, share)| sum + *share * own[k]);
        let weights = [0, 1, 2].map(|k| value(k).exp());
        let whole = weights.iter().fold(Dual::ZERO, |sum, weight| sum + *weight);
        let grown = value(3).exp();
        let numbers = [Dual::ZERO, grown / (Dual::ONE + grown), Dual::ONE];
        Ok(weights.iter().zip(numbers).map(|(weight, number)| SpreadTerm { weight: *weight / whole, number }).collect())
    }
}

/// ln of the weights of shares 0, between and 1, and the logit of the mean share between.
fn three_terms(modes: &SpreadModes) -> [f64; 4] {
    let (mut weights, mut moment) = ([0.0; 3], 0.0);
    for (weight, share) in modes.weights.iter().zip(&modes.numbers) {
        match *share {
            share if share < NEAR => weights[0] += weight,
            share if share > 1.0 - NEAR => weights[2] += weight,
            share => {
                weights[1] += weight;
                moment += weight * share;
            }
        }
    }
    let between = moment / weights[1];
    [weights[0].ln(), weights[1].ln(), weights[2].ln(), (between / (1.0 - between)).ln()]
}

/// Lagrange's polynomials through the Chebyshev points.
fn lagrange(x: Dual) -> [Dual; N_RADII] {
    let point = |i: usize| -(PI * (i as f64 + 0.5) / N_RADII as f64).cos();
    std::array::from_fn(|i| {
        (0..N_RADII)
            .filter(|j| *j != i)
            .fold(Dual::ONE, |product, j| product * (x - Dual::constant(point(j))) * (point(i) - point(j)).recip())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fe::Stiffness;
    use crate::mesh::QuarterBall;

    /// At radii between those that were solved, and those at the ends, against modes of a mesh for each.
    #[test]
    fn three_terms_serve_pockets_of_any_radius() {
        let (robot_radius_m, outer_radius_m) = (0.275e-3, 10e-3);
        let ball = QuarterBall { robot_radius_m, outer_radius_m, n_per_edge: 2, n_layers: 8 };
        let mesh = ball.mesh().unwrap();
        let stiffness = Stiffness::new(&mesh).unwrap();
        let surroundings = Surroundings {
            mesh: &mesh,
            stiffness: &stiffness,
            poisson_ratio: 0.48,
            sizes: Sizes {
                gel_density_kg_m3: 1000.0,
                robot_mass_kg: 1e-6,
                robot_radius_m,
                outer_radius_m,
                ball: Some(ball),
            },
        };
        let pocket = PocketModel::new(&surroundings, &|| ()).unwrap();
        for ratio in [1.5, 1.7, 2.0, 2.5, 3.0, 4.0, 5.0] {
            let radius_m = ratio * robot_radius_m;
            let kind = SpatialKind::Pocket { radius_m };
            let mesh = surroundings.pocket_mesh(radius_m).unwrap();
            let system = SpatialSystem::new(&surroundings, &mesh, kind).unwrap();
            let modes = modes_of(&surroundings, &system, kind).unwrap();
            let terms = pocket.terms(ratio.into()).unwrap();
            for x in [-0.3, -0.9, -0.999] {
                let found: f64 = terms.iter().map(|t| t.weight.value / (1.0 + x * t.number.value)).sum();
                let error = found / modes.relative_compliance(x) - 1.0;
                println!("{ratio} radii, softer by {}: {error:e}", 1.0 + x);
                assert!(error.abs() < 1e-4, "{ratio} radii, softer by {}: {error:e}", 1.0 + x);
            }
        }
        assert!(pocket.terms(5.1.into()).is_err());
    }
}
