//! The document of `shapes` (formats §5, `vitreo-uq/shapes/1`).

use serde::{Deserialize, Serialize};

use super::posterior::Warning;

/// Body of `vitreo-uq/shapes/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
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
    /// Bodies along the force in a gel whose strains may be large; absent where the law has no such form.
    pub large_strains: Option<LargeStrains>,
    /// What is doubtful about the user's mesh.
    pub warnings: Vec<Warning>,
}

/// One body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct MeshSummary {
    /// Unknowns of the quarter model.
    pub unknowns: usize,
    /// Smallest scaled Jacobian of its elements: 1 for bricks, 0 for flat ones.
    pub smallest_scaled_jacobian: f64,
    /// Longest to shortest side of its slenderest element.
    pub largest_aspect: f64,
}

/// The bodies of one aspect ratio in one gel under one force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Displacement {
    /// Median.
    pub median: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

/// What a body has in common with the sphere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum SizeRule {
    /// Its volume (Fig. 7).
    EqualVolume,
    /// The area of its surface (Fig. 8).
    EqualSurface,
}

impl SizeRule {
    /// Both, in the paper's order.
    pub const ALL: [Self; 2] = [Self::EqualVolume, Self::EqualSurface];

    /// In words.
    pub fn title(self) -> &'static str {
        match self {
            Self::EqualVolume => "equal volume",
            Self::EqualSurface => "equal surface",
        }
    }
}

/// A kind of body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// The reference.
    Sphere,
    /// Prolate spheroid.
    Ellipsoid,
    /// Right circular cylinder with sharp rims.
    Cylinder,
}

impl Shape {
    /// Its name in files and figures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Ellipsoid => "ellipsoid",
            Self::Cylinder => "cylinder",
        }
    }
}

/// A claim of the paper, or the converse of a comparison that it makes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Claim {
    /// What is claimed.
    pub claim: String,
    /// Whether it is so.
    pub verdict: ClaimVerdict,
    /// Probability that it is, given the errors of the stiffnesses. The gel's parameters act on all bodies alike and cancel.
    pub probability: f64,
    /// The numbers.
    pub numbers: String,
}

/// What is to be said of a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub enum ClaimVerdict {
    /// It is so.
    #[serde(rename = "holds")]
    Holds,
    /// It is not.
    #[serde(rename = "does not hold")]
    DoesNotHold,
    /// The errors of the stiffnesses leave it open.
    #[serde(rename = "too close")]
    TooClose,
}

/// The longest robot of a shape, at the volume of the sphere and under the same force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LongestRobot {
    /// Which shape.
    pub shape: Shape,
    /// Which way, in words.
    pub orientation: String,
    /// Length to diameter; `None` where not even the shortest moves far enough.
    pub aspect: Option<f64>,
    /// Length in m.
    pub length_m: Option<f64>,
    /// Whether longer ones would, too: the surrogate ends here.
    pub is_limit_of_range: bool,
    /// Largest relative error of the surrogate at points between those that made it.
    pub surrogate_relative_error: f64,
}

/// Bodies along the force over one hold, in fluids of the law whose strains may be large: Oldroyd-B, and Giesekus's of a mobility.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LargeStrains {
    /// Mobility of the other fluid.
    pub other_mobility: f64,
    /// The sphere, then ellipsoids and cylinder under each rule.
    pub bodies: Vec<LargeShape>,
    /// Orderings that small strains give, asked again.
    pub claims: Vec<Claim>,
}

/// A body along the force, as far as the mesh follows it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LargeShape {
    /// What it is.
    pub shape: Shape,
    /// How large it is.
    pub size_rule: SizeRule,
    /// Length to diameter.
    pub aspect: f64,
    /// Time to which the mesh follows it, in s.
    pub followed_s: f64,
    /// Whether that is the end of the hold.
    pub is_whole: bool,
    /// Displacement of small strains then, in µm, by the median of the posterior.
    pub small_strains_um: f64,
    /// By how much it is farther in Oldroyd-B's fluid then, in µm.
    pub deviation_um: f64,
    /// Difference of that from a coarser mesh's, in µm.
    pub error_um: f64,
    /// By how much it is farther in the fluid of the other mobility then, in µm; absent where a body was not followed to the end of the hold.
    pub deviation_with_mobility_um: Option<f64>,
    /// Displacement in Oldroyd-B's fluid over the radius across the force.
    pub radii_moved: f64,
    /// The same over the body's length.
    pub lengths_moved: f64,
}

/// Elastic robots of one modulus.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ElasticRecord {
    /// The robot's Young's modulus over the gel's.
    pub modulus_ratio: f64,
    /// Largest share by which a body is less stiff than a rigid one.
    pub largest_relative_difference: f64,
}

/// A candidate's record over the sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PredictorRecord {
    /// In words.
    pub predictor: String,
    /// Root mean square of the relative error of the predicted ratio to the sphere.
    pub rms_relative_error: f64,
    /// The largest, with its sign.
    pub largest_relative_error: f64,
    /// The body that has it.
    pub worst: String,
}
