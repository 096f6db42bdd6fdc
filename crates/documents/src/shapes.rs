//! Document of `shapes` (formats §5, `vitreo-uq/shapes/1`).

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
    /// Ratio of length to diameter.
    pub aspect: f64,
    /// Amplitude of the force, in µN.
    #[serde(rename = "force_uN")]
    pub force_un: f64,
    /// Length of a hold, in s.
    pub hold_s: f64,
    /// Ten bodies, five under each size rule.
    pub bodies: Vec<BodySummary>,
    /// Body of the user's own mesh; `None` if no mesh was given.
    pub own_body: Option<UserBody>,
    /// Results for every combination of aspect ratio, Poisson ratio and force; empty unless several were requested.
    pub sweep: Vec<SweepSummary>,
    /// Tests of the paper's claims.
    pub claims: Vec<Claim>,
    /// Differences of elastic robots from the rigid ones above.
    pub elastic_robot: Vec<ElasticRobotResult>,
    /// Predictors of the stiffness beyond volume and surface, best first.
    pub predictors: Vec<PredictorAccuracy>,
    /// Required displacement of the longest robot within a hold, in mm.
    pub wanted_displacement_mm: f64,
    /// Longest robots that reach this displacement with probability 95 %, at the sphere's volume.
    pub longest: Vec<LongestRobot>,
    /// Bodies along the force in a gel with large strains; absent if the law has no large-strain form.
    pub large_strains: Option<LargeStrains>,
    /// Warnings on the user's mesh.
    pub warnings: Vec<Warning>,
}

/// One body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct BodySummary {
    /// Shape of the body.
    pub shape: BodyShape,
    /// Axis of the body relative to the force, `horizontal` or `vertical`; `None` for a sphere.
    pub orientation: Option<String>,
    /// Rule that sets the body's size.
    pub size_rule: SizeRule,
    /// Length along its axis, in mm.
    pub length_mm: f64,
    /// Diameter across it, in mm.
    pub diameter_mm: f64,
    /// Force per displacement per Pa of Young's modulus, whole body, in m.
    pub stiffness_m: f64,
    /// Estimated relative error of the stiffness.
    pub relative_error: f64,
    /// Relative difference of the three-dimensional finite-element stiffness from `stiffness_m`.
    pub relative_difference_3d: f64,
    /// Mesh of the three-dimensional finite elements.
    pub mesh_3d: MeshSummary,
    /// Stiffness divided by that of the sphere of this size rule.
    pub ratio_to_sphere: f64,
    /// Surface divided by that of the sphere of this size rule.
    pub surface_ratio: f64,
    /// Volume divided by that of the sphere of this size rule.
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
    /// Smallest scaled Jacobian of the elements: 1 for bricks, 0 for flat elements.
    pub smallest_scaled_jacobian: f64,
    /// Largest ratio of longest to shortest side among the elements.
    pub largest_aspect: f64,
}

/// The bodies of one aspect ratio in one gel under one force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SweepSummary {
    /// Ratio of length to diameter.
    pub aspect: f64,
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Amplitude of the force, in µN.
    #[serde(rename = "force_uN")]
    pub force_un: f64,
    /// Ten bodies, five under each size rule.
    pub bodies: Vec<BodySummary>,
    /// Body of the user's own mesh.
    pub own_body: Option<UserBody>,
    /// Tests of the paper's claims.
    pub claims: Vec<Claim>,
}

/// Body of the user's own mesh.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct UserBody {
    /// Surface of the body inside the mesh, in mm².
    pub surface_area_mm2: f64,
    /// Volume of the body, in mm³.
    pub volume_mm3: f64,
    /// The mesh.
    pub mesh: MeshSummary,
    /// Force per displacement per Pa of Young's modulus, for the whole body, in m, from finite elements on that mesh.
    pub stiffness_m: f64,
    /// Stiffness divided by that of the sphere of equal volume.
    pub ratio_to_sphere_of_equal_volume: f64,
    /// Stiffness divided by that of the sphere of equal surface.
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

/// Quantity that a body shares with the sphere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum SizeRule {
    /// Equal volume (Fig. 7).
    EqualVolume,
    /// Equal surface area (Fig. 8).
    EqualSurface,
}

impl SizeRule {
    /// Both rules, in the paper's order.
    pub const ALL: [Self; 2] = [Self::EqualVolume, Self::EqualSurface];

    /// Name of the rule in words.
    pub fn title(self) -> &'static str {
        match self {
            Self::EqualVolume => "equal volume",
            Self::EqualSurface => "equal surface",
        }
    }
}

/// Shapes of bodies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum BodyShape {
    /// Sphere, the reference.
    Sphere,
    /// Prolate spheroid.
    Ellipsoid,
    /// Right circular cylinder with sharp rims.
    Cylinder,
}

impl BodyShape {
    /// Name of the shape in files and figures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Ellipsoid => "ellipsoid",
            Self::Cylinder => "cylinder",
        }
    }
}

/// A claim of the paper, or the converse of one of its comparisons.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Claim {
    /// Statement of the claim.
    pub claim: String,
    /// Verdict on the claim.
    pub verdict: ClaimVerdict,
    /// Probability of the claim, given the errors of the stiffnesses. The gel's parameters affect all bodies alike and cancel.
    pub probability: f64,
    /// Numbers behind the verdict.
    pub numbers: String,
}

/// Verdict on a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub enum ClaimVerdict {
    /// The claim holds.
    #[serde(rename = "holds")]
    Holds,
    /// The claim does not hold.
    #[serde(rename = "does not hold")]
    DoesNotHold,
    /// The claim is undecided within the errors of the stiffnesses.
    #[serde(rename = "too close")]
    TooClose,
}

/// Longest robot of a shape, at the volume of the sphere and under the sphere's force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LongestRobot {
    /// Shape of the robot.
    pub shape: BodyShape,
    /// Orientation in words.
    pub orientation: String,
    /// Ratio of length to diameter; `None` if even the shortest robot moves too little.
    pub aspect: Option<f64>,
    /// Length in m.
    pub length_m: Option<f64>,
    /// True if longer robots would also move far enough. The surrogate's range ends here.
    pub is_limit_of_range: bool,
    /// Largest relative error of the surrogate at points between its training points.
    pub surrogate_relative_error: f64,
}

/// Bodies along the force over one hold in two large-strain fluids: Oldroyd-B, and Giesekus with one mobility.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LargeStrains {
    /// Mobility of the Giesekus fluid.
    pub other_mobility: f64,
    /// The sphere, then ellipsoid and cylinder under each size rule.
    pub bodies: Vec<LargeShape>,
    /// Tests of the small-strain orderings at large strains.
    pub claims: Vec<Claim>,
}

/// A body along the force, up to the time that the mesh can follow.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LargeShape {
    /// Shape of the body.
    pub shape: BodyShape,
    /// Rule that sets the body's size.
    pub size_rule: SizeRule,
    /// Ratio of length to diameter.
    pub aspect: f64,
    /// Last time that the mesh can follow, in s.
    pub followed_s: f64,
    /// True if `followed_s` is the end of the hold.
    pub is_whole: bool,
    /// Small-strain displacement at `followed_s`, in µm, for the posterior's median.
    pub small_strains_um: f64,
    /// Excess of the displacement in the Oldroyd-B fluid over the small-strain displacement at `followed_s`, in µm.
    pub deviation_um: f64,
    /// Difference of the excess displacement from that of a coarser mesh, in µm.
    pub error_um: f64,
    /// Excess of the displacement in the Giesekus fluid at `followed_s`, in µm; absent if the body was not followed to the end.
    pub deviation_with_mobility_um: Option<f64>,
    /// Displacement in the Oldroyd-B fluid divided by the body's radius across the force.
    pub radii_moved: f64,
    /// Displacement in the Oldroyd-B fluid divided by the body's length.
    pub lengths_moved: f64,
}

/// Results of elastic robots of one modulus.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ElasticRobotResult {
    /// Ratio of the robot's Young's modulus to the gel's.
    pub modulus_ratio: f64,
    /// Largest relative deficit of a body's stiffness against a rigid one.
    pub largest_relative_difference: f64,
}

/// Accuracy of one predictor over the sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PredictorAccuracy {
    /// Name of the predictor in words.
    pub predictor: String,
    /// Root mean square of the relative error of the predicted ratio to the sphere.
    pub rms_relative_error: f64,
    /// Largest relative error, with its sign.
    pub largest_relative_error: f64,
    /// Body with the largest error.
    pub worst: String,
}
