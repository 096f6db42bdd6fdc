//! The document of a study of shapes, `vitreo-uq/shapes/1`.

use serde::{Deserialize, Serialize};

use super::bodies::{Shape, SizeRule};
use super::claims::Claim;
use super::design::LongestRobot;
use super::job::{ElasticRecord, OwnMesh, ShapesRequest, ShapesResult, Solved, Studied};
use super::predictors::PredictorRecord;
use crate::experiment::Orientation;
use crate::fe::exact::SphereInContainer;
use crate::fe::quality::MeshQuality;
use crate::workflow::summary::Warning;

/// Body of `vitreo-uq/shapes/1`.
#[derive(Debug, Clone, PartialEq, schemars::JsonSchema, Serialize, Deserialize)]
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
    /// Every aspect ratio with every Poisson ratio and force, where several were asked for.
    pub sweep: Vec<SweepSummary>,
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
    /// What is doubtful about the user's mesh.
    pub warnings: Vec<Warning>,
}

/// One body.
#[derive(Debug, Clone, PartialEq, schemars::JsonSchema, Serialize, Deserialize)]
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
    /// Their mesh.
    pub mesh_3d: MeshSummary,
    /// Stiffness over the sphere's of the same rule.
    pub ratio_to_sphere: f64,
    /// Surface over that sphere's.
    pub surface_ratio: f64,
    /// Volume over that sphere's.
    pub volume_ratio: f64,
    /// Displacement at the end of the first hold, in µm.
    pub displacement_5s_um: Displacement,
}

/// A three-dimensional mesh.
#[derive(Debug, Clone, Copy, PartialEq, schemars::JsonSchema, Serialize, Deserialize)]
pub struct MeshSummary {
    /// Unknowns of the quarter model.
    pub unknowns: usize,
    /// Smallest scaled Jacobian of its elements: 1 for bricks, 0 for flat ones.
    pub smallest_scaled_jacobian: f64,
    /// Longest to shortest side of its slenderest element.
    pub largest_aspect: f64,
}

impl MeshSummary {
    fn new(unknowns: usize, quality: &MeshQuality) -> Self {
        let MeshQuality { smallest_scaled_jacobian, largest_aspect, .. } = *quality;
        Self { unknowns, smallest_scaled_jacobian, largest_aspect }
    }
}

/// The bodies of one aspect ratio in one gel under one force.
#[derive(Debug, Clone, PartialEq, schemars::JsonSchema, Serialize, Deserialize)]
pub struct SweepSummary {
    /// Length to diameter.
    pub aspect: f64,
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Amplitude of the force, in µN.
    #[serde(rename = "force_uN")]
    pub force_un: f64,
    /// Ten bodies.
    pub bodies: Vec<BodySummary>,
    /// The body of the user's own mesh.
    pub own_body: Option<OwnBody>,
    /// The paper's claims.
    pub claims: Vec<Claim>,
}

/// The body of the user's own mesh.
#[derive(Debug, Clone, Copy, PartialEq, schemars::JsonSchema, Serialize, Deserialize)]
pub struct OwnBody {
    /// Surface of the body that the mesh goes around, in mm².
    pub surface_area_mm2: f64,
    /// Its volume, in mm³.
    pub volume_mm3: f64,
    /// The mesh.
    pub mesh: MeshSummary,
    /// Force per displacement per Pa of Young's modulus, whole body, in m, by finite elements on that mesh.
    pub stiffness_m: f64,
    /// Stiffness over that of the sphere of its volume.
    pub ratio_to_sphere_of_equal_volume: f64,
    /// Stiffness over that of the sphere of its surface.
    pub ratio_to_sphere_of_equal_surface: f64,
    /// Displacement at the end of the first hold, in µm.
    pub displacement_5s_um: Displacement,
}

/// Posterior of a displacement, in µm.
#[derive(Debug, Clone, Copy, PartialEq, schemars::JsonSchema, Serialize, Deserialize)]
pub struct Displacement {
    /// Median.
    pub median: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

/// Puts what was found into numbers; `forces_n` are the sweep's, the first of which is the study's.
pub fn summarise(request: &ShapesRequest, found: &ShapesResult, forces_n: &[f64]) -> ShapesSummary {
    let outer_radius_m = 0.5 * request.vitreous.diameter_m;
    let of = |studied: &Studied, force_n: f64| {
        // The gel is linear: displacements go with the force.
        let after_hold = found.after_hold.map(|x| x * force_n / request.force_n);
        let own_body = found.own_mesh.as_ref().zip(studied.own_stiffness_m);
        SweepSummary {
            aspect: studied.aspect,
            poisson_ratio: studied.poisson_ratio,
            force_un: 1e6 * force_n,
            bodies: studied.solved.iter().map(|own| body(own, sphere_of(studied, own), after_hold)).collect(),
            own_body: own_body
                .map(|(mesh, stiffness_m)| own(mesh, stiffness_m, studied.poisson_ratio, outer_radius_m, after_hold)),
            claims: studied.claims.clone(),
        }
    };
    let all: Vec<SweepSummary> =
        found.studied.iter().flat_map(|studied| forces_n.iter().map(move |force| of(studied, *force))).collect();
    let first = all[0].clone();
    ShapesSummary {
        poisson_ratio: first.poisson_ratio,
        vitreous_diameter_mm: 1e3 * request.vitreous.diameter_m,
        aspect: first.aspect,
        force_un: first.force_un,
        hold_s: request.hold_s,
        bodies: first.bodies,
        own_body: first.own_body,
        sweep: if all.len() > 1 { all } else { Vec::new() },
        claims: first.claims,
        elastic_robot: found.elastic.clone(),
        predictors: found.predictors.clone(),
        wanted_displacement_mm: 1e3 * request.distance_m,
        longest: found.longest.clone(),
        warnings: Vec::new(),
    }
}

/// The sphere as large as a body, by the body's rule.
fn sphere_of<'a>(studied: &'a Studied, own: &Solved) -> &'a Solved {
    let is_sphere = |other: &&Solved| other.body.rule == own.body.rule && other.body.shape == Shape::Sphere;
    studied.solved.iter().find(is_sphere).unwrap_or(&studied.solved[0])
}

fn displacement(force_per_pa: [f64; 3], stiffness_m: f64) -> Displacement {
    let [q05, median, q95] = force_per_pa.map(|x| 1e6 * x / stiffness_m);
    Displacement { median, q05, q95 }
}

fn body(own: &Solved, sphere: &Solved, force_per_pa: [f64; 3]) -> BodySummary {
    let [length_m, diameter_m] = own.body.sizes_m();
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
        mesh_3d: MeshSummary::new(own.unknowns, &own.quality),
        ratio_to_sphere: own.stiffness_m / sphere.stiffness_m,
        surface_ratio: surface.surface_area_m2() / unit.surface_area_m2(),
        volume_ratio: surface.volume_m3() / unit.volume_m3(),
        displacement_5s_um: displacement(force_per_pa, own.stiffness_m),
    }
}

fn own(mesh: &OwnMesh, stiffness_m: f64, poisson_ratio: f64, outer_radius_m: f64, force_per_pa: [f64; 3]) -> OwnBody {
    let [of_volume, of_surface] = mesh.size.equivalent_diameters_m().map(|diameter_m| {
        stiffness_m / SphereInContainer::new(poisson_ratio, 0.5 * diameter_m, outer_radius_m).stiffness_n_per_m(1.0)
    });
    OwnBody {
        surface_area_mm2: 1e6 * mesh.size.surface_area_m2,
        volume_mm3: 1e9 * mesh.size.volume_m3,
        mesh: MeshSummary::new(mesh.unknowns, &mesh.quality),
        stiffness_m,
        ratio_to_sphere_of_equal_volume: of_volume,
        ratio_to_sphere_of_equal_surface: of_surface,
        displacement_5s_um: displacement(force_per_pa, stiffness_m),
    }
}
