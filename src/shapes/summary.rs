//! The document of a study of shapes, `vitreo-uq/shapes/1`.

use serde::{Deserialize, Serialize};

use super::bodies::{Shape, SizeRule};
use super::claims::Claim;
use super::design::LongestRobot;
use super::job::{ElasticRecord, ShapesRequest, ShapesResult};
use super::predictors::PredictorRecord;
use crate::experiment::Orientation;

/// Body of `vitreo-uq/shapes/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShapesSummary {
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Diameter of the gel, in mm.
    pub vitreous_diameter_mm: f64,
    /// Length to diameter.
    pub aspect: f64,
    /// Amplitude of the force, in µN.
    #[serde(rename = "force_uN")]
    pub force_un: f64,
    /// Length of a hold, in s.
    pub hold_s: f64,
    /// Ten bodies: five under each rule.
    pub bodies: Vec<BodySummary>,
    /// The body of the user's own mesh, where one was given.
    pub own_body: Option<OwnBody>,
    /// The paper's claims.
    pub claims: Vec<Claim>,
    /// How far elastic robots are from the rigid ones above.
    pub elastic_robot: Vec<ElasticRecord>,
    /// What predicts the stiffness beyond volume and surface, best first.
    pub predictors: Vec<PredictorRecord>,
    /// How far the longest robot must move within a hold, in mm.
    pub wanted_displacement_mm: f64,
    /// The longest robots that do with 95 %, at the sphere's volume.
    pub longest: Vec<LongestRobot>,
}

/// One body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BodySummary {
    /// What it is.
    pub shape: Shape,
    /// `horizontal` or `vertical` to the force; `None` for a sphere.
    pub orientation: Option<String>,
    /// How large it is.
    pub size_rule: SizeRule,
    /// Length along its axis, in mm.
    pub length_mm: f64,
    /// Diameter across it, in mm.
    pub diameter_mm: f64,
    /// Force per displacement per Pa of Young's modulus, whole body, in m.
    pub stiffness_m: f64,
    /// Its estimated relative error.
    pub relative_error: f64,
    /// Relative difference of the three-dimensional finite elements from it.
    pub relative_difference_3d: f64,
    /// Stiffness over the sphere's of the same rule.
    pub ratio_to_sphere: f64,
    /// Surface over that sphere's.
    pub surface_ratio: f64,
    /// Volume over that sphere's.
    pub volume_ratio: f64,
    /// Displacement at the end of the first hold, in µm.
    pub displacement_5s_um: Displacement,
}

/// The body of the user's own mesh.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OwnBody {
    /// Force per displacement per Pa of Young's modulus, whole body, in m, by finite elements on that mesh.
    pub stiffness_m: f64,
    /// Stiffness over the sphere's.
    pub ratio_to_sphere: f64,
    /// Displacement at the end of the first hold, in µm.
    pub displacement_5s_um: Displacement,
}

/// Posterior of a displacement, in µm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Displacement {
    /// Median.
    pub median: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

/// Puts what was found into numbers.
pub fn summarise(request: &ShapesRequest, found: &ShapesResult) -> ShapesSummary {
    let sphere_of = |rule: SizeRule| {
        found
            .solved
            .iter()
            .find(|own| own.body.rule == rule && own.body.shape == Shape::Sphere)
            .unwrap_or(&found.solved[0])
    };
    let displacement = |stiffness_m: f64| {
        let [q05, median, q95] = found.after_hold.map(|x| 1e6 * x / stiffness_m);
        Displacement { median, q05, q95 }
    };
    let body = |own: &super::job::Solved| {
        let (sphere, [length_m, diameter_m]) = (sphere_of(own.body.rule), own.body.sizes_m());
        let (surface, unit) = (own.body.revolution, sphere.body.revolution);
        BodySummary {
            shape: own.body.shape,
            orientation: match (own.body.shape, own.body.orientation) {
                (Shape::Sphere, _) => None,
                (_, Orientation::Horizontal) => Some("horizontal".into()),
                (_, Orientation::Vertical) => Some("vertical".into()),
            },
            size_rule: own.body.rule,
            length_mm: 1e3 * length_m,
            diameter_mm: 1e3 * diameter_m,
            stiffness_m: own.stiffness_m,
            relative_error: own.relative_error,
            relative_difference_3d: own.stiffness_3d_m / own.stiffness_m - 1.0,
            ratio_to_sphere: own.stiffness_m / sphere.stiffness_m,
            surface_ratio: surface.surface_area_m2() / unit.surface_area_m2(),
            volume_ratio: surface.volume_m3() / unit.volume_m3(),
            displacement_5s_um: displacement(own.stiffness_m),
        }
    };
    let own_body = request.own_stiffness_m.map(|stiffness_m| OwnBody {
        stiffness_m,
        ratio_to_sphere: stiffness_m / sphere_of(SizeRule::EqualVolume).stiffness_m,
        displacement_5s_um: displacement(stiffness_m),
    });
    ShapesSummary {
        poisson_ratio: request.vitreous.poisson_ratio,
        vitreous_diameter_mm: 1e3 * request.vitreous.diameter_m,
        aspect: request.aspect,
        force_un: 1e6 * request.force_n,
        hold_s: request.hold_s,
        bodies: found.solved.iter().map(body).collect(),
        own_body,
        claims: found.claims.clone(),
        elastic_robot: found.elastic.clone(),
        predictors: found.predictors.clone(),
        wanted_displacement_mm: 1e3 * request.distance_m,
        longest: found.longest.clone(),
    }
}
