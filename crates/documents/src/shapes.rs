//! Document of `shapes` (formats §5, `vitreo-uq/shapes/1`).

use serde::{Deserialize, Serialize};

use super::posterior::Warning;

/// Result of `shapes`, which compares bodies of several shapes: body of the JSON document `vitreo-uq/shapes/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ShapesSummary {
    /// Poisson's ratio of the gel.
    pub poisson_ratio: f64,
    /// Diameter of the gel, in mm.
    pub vitreous_diameter_mm: f64,
    /// Ratio of length to diameter of the ellipsoids and cylinders.
    pub aspect: f64,
    /// Amplitude of the force, in µN.
    #[serde(rename = "force_uN")]
    pub force_un: f64,
    /// Length of a hold, in s.
    pub hold_s: f64,
    /// Ten bodies: five that have the sphere's volume, and five that have its surface.
    pub bodies: Vec<BodySummary>,
    /// Body of the user's own mesh; `None` if no mesh was given.
    pub own_body: Option<UserBody>,
    /// Results for every combination of aspect ratio, Poisson ratio and force; empty unless several were requested.
    pub sweep: Vec<SweepSummary>,
    /// Tests of the paper's claims about shapes.
    pub claims: Vec<Claim>,
    /// Differences between elastic robots and the rigid robots of `bodies`.
    pub elastic_robot: Vec<ElasticRobotResult>,
    /// Accuracy of simple predictors of the stiffness, best first.
    pub predictors: Vec<PredictorAccuracy>,
    /// Bodies that are pulled along their axis in a gel with large strains; absent if the law has no form for large strains.
    pub large_strains: Option<LargeStrains>,
    /// Warnings on the user's mesh.
    pub warnings: Vec<Warning>,
}

/// Stiffness and displacement of one body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct BodySummary {
    /// Shape of the body.
    pub shape: BodyShape,
    /// Orientation of the body's axis: `horizontal` (along the force) or `vertical` (across it); `None` for a sphere.
    pub orientation: Option<String>,
    /// Quantity that the body shares with the sphere: volume or surface.
    pub size_rule: SizeRule,
    /// Length of the body along its axis, in mm.
    pub length_mm: f64,
    /// Diameter of the body across its axis, in mm.
    pub diameter_mm: f64,
    /// Stiffness of the whole body: force per displacement, divided by Young's modulus, in m.
    pub stiffness_m: f64,
    /// Estimated relative error of the stiffness.
    pub relative_error: f64,
    /// Relative difference of the three-dimensional finite-element stiffness from `stiffness_m`.
    pub relative_difference_3d: f64,
    /// Mesh of the three-dimensional finite-element model.
    pub mesh_3d: MeshSummary,
    /// Stiffness divided by the stiffness of the sphere with equal volume or surface, according to `size_rule`.
    pub ratio_to_sphere: f64,
    /// Surface of the body divided by the surface of the sphere.
    pub surface_ratio: f64,
    /// Volume of the body divided by the volume of the sphere.
    pub volume_ratio: f64,
    /// Displacement at the end of the first hold, in µm.
    pub displacement_5s_um: Displacement,
}

/// Size and quality of a three-dimensional mesh.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct MeshSummary {
    /// Number of unknowns of the finite-element model, which covers a quarter of the gel.
    pub unknowns: usize,
    /// Smallest scaled Jacobian of the elements: 1 for bricks, 0 for flat elements.
    pub smallest_scaled_jacobian: f64,
    /// Largest ratio of an element's longest to its shortest side.
    pub largest_aspect: f64,
}

/// The bodies of one aspect ratio in one gel under one force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SweepSummary {
    /// Ratio of length to diameter of the ellipsoids and cylinders.
    pub aspect: f64,
    /// Poisson's ratio of the gel.
    pub poisson_ratio: f64,
    /// Amplitude of the force, in µN.
    #[serde(rename = "force_uN")]
    pub force_un: f64,
    /// Ten bodies: five that have the sphere's volume, and five that have its surface.
    pub bodies: Vec<BodySummary>,
    /// Body of the user's own mesh; `None` if no mesh was given.
    pub own_body: Option<UserBody>,
    /// Tests of the paper's claims about shapes.
    pub claims: Vec<Claim>,
}

/// Stiffness and displacement of the body in the user's own mesh.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct UserBody {
    /// Surface of the body, in mm².
    pub surface_area_mm2: f64,
    /// Volume of the body, in mm³.
    pub volume_mm3: f64,
    /// Size and quality of the user's mesh.
    pub mesh: MeshSummary,
    /// Stiffness of the whole body: force per displacement, divided by Young's modulus, in m, from finite elements on the user's mesh.
    pub stiffness_m: f64,
    /// Stiffness divided by that of the sphere of equal volume.
    pub ratio_to_sphere_of_equal_volume: f64,
    /// Stiffness divided by that of the sphere of equal surface.
    pub ratio_to_sphere_of_equal_surface: f64,
    /// Displacement at the end of the first hold, in µm.
    pub displacement_5s_um: Displacement,
}

/// Posterior of a body's displacement, in µm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Displacement {
    /// Posterior median.
    pub median: f64,
    /// 5 % quantile of the posterior.
    pub q05: f64,
    /// 95 % quantile of the posterior.
    pub q95: f64,
}

base::named_enum! {
    /// Quantity that a body shares with the sphere.
    #[derive(Serialize, Deserialize)]
    #[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
    #[serde(rename_all = "snake_case")]
    pub enum SizeRule {
        /// Volume equal to the sphere's (Fig. 7 of the paper).
        EqualVolume = "equal volume",
        /// Surface area equal to the sphere's (Fig. 8 of the paper).
        EqualSurface = "equal surface",
    }
    /// Name of the rule in words.
    pub fn title
}

base::named_enum! {
    /// Shapes of bodies.
    #[derive(Serialize, Deserialize)]
    #[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
    #[serde(rename_all = "snake_case")]
    pub enum BodyShape {
        /// Sphere, which is the reference for the other shapes.
        Sphere = "sphere",
        /// Prolate ellipsoid of revolution.
        Ellipsoid = "ellipsoid",
        /// Right circular cylinder with sharp rims.
        Cylinder = "cylinder",
    }
    /// Name of the shape in files and figures.
    pub fn name
}

/// A claim of the paper, or the converse of one of its comparisons.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Claim {
    /// Statement of the claim.
    pub claim: String,
    /// Verdict on the claim.
    pub verdict: ClaimVerdict,
    /// Probability that the claim is true, given the numerical errors of the stiffnesses. The gel's parameters affect all bodies alike and cancel.
    pub probability: f64,
    /// Stiffness ratios or displacements behind the verdict, in words.
    pub numbers: String,
}

/// Verdict on a claim about shapes.
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

/// Motion over one hold of bodies that are pulled along their axis in two large-strain fluids: Oldroyd-B, and Giesekus with one mobility.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LargeStrains {
    /// Mobility of the Giesekus fluid.
    pub other_mobility: f64,
    /// The sphere, then the ellipsoids and cylinders.
    pub bodies: Vec<LargeShape>,
    /// Tests whether the order of the shapes at small strains also holds at large strains.
    pub claims: Vec<Claim>,
}

/// Motion of a body that is pulled along its axis, up to the last time at which its mesh is not too distorted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LargeShape {
    /// Shape of the body.
    pub shape: BodyShape,
    /// Quantity that the body shares with the sphere: volume or surface.
    pub size_rule: SizeRule,
    /// Ratio of the body's length to its diameter.
    pub aspect: f64,
    /// Last time that the computation reaches before the mesh is too distorted, in s.
    pub followed_s: f64,
    /// True if `followed_s` is the end of the hold.
    pub is_whole: bool,
    /// Displacement at `followed_s` according to the small-strain model, in µm, for the posterior's median.
    pub small_strains_um: f64,
    /// Displacement in the Oldroyd-B fluid minus the small-strain displacement at `followed_s`, in µm.
    pub deviation_um: f64,
    /// Error of `deviation_um` due to the mesh: its difference from a coarser mesh, in µm.
    pub error_um: f64,
    /// Displacement in the Giesekus fluid minus the small-strain displacement at `followed_s`, in µm; absent if the mesh could not follow the body to the end
    /// of the hold.
    pub deviation_with_mobility_um: Option<f64>,
    /// Displacement in the Oldroyd-B fluid at `followed_s`, divided by the body's radius across the force.
    pub radii_moved: f64,
    /// Displacement in the Oldroyd-B fluid at `followed_s`, divided by the body's length.
    pub lengths_moved: f64,
}

/// Influence of the robot's elasticity on its stiffness in the gel, for one Young's modulus of the robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ElasticRobotResult {
    /// Ratio of the robot's Young's modulus to the gel's.
    pub modulus_ratio: f64,
    /// Largest decrease of the stiffness among the bodies, relative to a rigid robot.
    pub largest_relative_difference: f64,
}

/// Accuracy of one predictor of the stiffness, tested over many aspect ratios.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PredictorAccuracy {
    /// Name of the predictor in words.
    pub predictor: String,
    /// Root mean square relative error of the predicted stiffness over all bodies.
    pub rms_relative_error: f64,
    /// Relative error of the predicted stiffness that is largest in size, with its sign.
    pub largest_relative_error: f64,
    /// Body whose predicted stiffness has the largest error, in words.
    pub worst: String,
}
