//! Runs the shape study. It computes the stiffness of every body with two solvers, displacements with posterior uncertainty, the paper's claims, and predictors of
//! the stiffness.

use documents::shapes::{Claim, ElasticRobotResult, LargeStrains, PredictorAccuracy};
use rayon::prelude::*;

use super::bodies::{StudyBody, bodies};
use super::claims::{StiffnessEstimate, claims};
use super::large;
use super::predictors::compare_predictors;
use crate::ensemble::{Ensemble, Gel, quantiles_um};
use crate::scenario::Scenario;
use base::error::Result;
use elements::fe::Stiffness;
use elements::fe::meridional::{ElasticRobot, Formulation, Resolution, solve, solve_elastic};
use elements::fe::oldroyd::FiniteLaw;
use elements::fe::quality::MeshQuality;
use elements::fe::surface::RobotSize;
use elements::fe::time::FullOrderModel;
use elements::mesh::Mesh;
use posterior::mechanics::{MODEL_LEVEL, robot_mesh};
use posterior::monitor::{Counter, Monitor};
use record::{Record, Vitreous};

/// Number of times at which the trajectory is computed in each hold.
const ROWS_A_HOLD: usize = 100;

/// Settings of a shape study.
pub struct ShapesRequest<'a> {
    /// Diameter of the sphere whose volume or surface area the other bodies have, in m.
    pub sphere_diameter_m: f64,
    /// The gel around the bodies.
    pub vitreous: Vitreous,
    /// Aspect ratios (at least one): length divided by diameter, or long divided by short semi-axis. The study uses the first, and a sweep compares the others.
    pub aspects: Vec<f64>,
    /// Poisson ratios of the gel. The study uses the first, and a sweep compares the others.
    pub poisson_ratios: Vec<f64>,
    /// Amplitude of the force, in N. The force is positive in one hold and negative in the next.
    pub force_n: f64,
    /// Duration of a hold, in s.
    pub hold_s: f64,
    /// Model and draws of the gel.
    pub gel: Gel<'a>,
    /// Law of the gel for large strains, at the posterior mean; `None` if the law has no such form.
    pub finite_law: Option<FiniteLaw>,
    /// Mesh of the user's own body, which is also solved; `None` if the user gives none.
    pub own_mesh: Option<Mesh>,
}

/// Stiffness of a body from two solvers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyStiffness {
    /// The body.
    pub body: StudyBody,
    /// Stiffness divided by Young's modulus: force per displacement per Pa, in m. It comes from high-order elements in the meridian plane.
    pub stiffness_m: f64,
    /// Estimated relative error of `stiffness_m`.
    pub relative_error: f64,
    /// Stiffness divided by Young's modulus from the three-dimensional finite elements, in m.
    pub stiffness_3d_m: f64,
    /// Number of unknowns of the three-dimensional elements.
    pub unknowns: usize,
    /// Shape quality of the three-dimensional elements.
    pub quality: MeshQuality,
}

/// A body's mesh with the displacement of the gel at its nodes.
pub struct BodyField {
    /// The body.
    pub body: StudyBody,
    /// Mesh of the gel around the body.
    pub mesh: Mesh,
    /// Displacement vector of every node, divided by the robot's displacement.
    pub displacement: Vec<[f64; 3]>,
}

/// Results for the bodies of one aspect ratio in a gel of one Poisson ratio.
pub struct StudyPoint {
    /// Ratio of length to diameter.
    pub aspect: f64,
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Stiffness of ten bodies, five under each size rule.
    pub solved: Vec<BodyStiffness>,
    /// Verdicts on the paper's claims.
    pub claims: Vec<Claim>,
    /// Stiffness of the user's own body divided by Young's modulus, in m; `None` without such a body.
    pub own_stiffness_m: Option<f64>,
}

/// Properties of the mesh of the user's own body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnMesh {
    /// Size of the body in the mesh.
    pub size: RobotSize,
    /// Number of unknowns of the finite elements on this mesh.
    pub unknowns: usize,
    /// Shape quality of the elements.
    pub quality: MeshQuality,
}

/// Results of a shape study.
pub struct ShapesResult {
    /// Results for every combination of aspect ratio and Poisson ratio. The first combination is the study itself, and the others form a sweep.
    pub studied: Vec<StudyPoint>,
    /// Meshes and displacement fields of the equal-volume bodies at the study's own aspect ratio and Poisson ratio.
    pub fields: Vec<BodyField>,
    /// The user's own mesh; `None` if the user gives none.
    pub own_mesh: Option<OwnMesh>,
    /// Times of one cycle (two holds) at which positions are computed, in s.
    pub time_s: Vec<f64>,
    /// 5 %, 50 % and 95 % quantiles, at each time, of the position times the stiffness (N/Pa). Division by a body's stiffness gives its position in m.
    pub force_per_pa: Vec<[f64; 3]>,
    /// 5 %, 50 % and 95 % quantiles, at the end of the first hold, of the position times the stiffness (N/Pa).
    pub after_hold: [f64; 3],
    /// Differences in stiffness between elastic and rigid robots.
    pub elastic: Vec<ElasticRobotResult>,
    /// Accuracy of each predictor of the stiffness.
    pub predictors: Vec<PredictorAccuracy>,
    /// Motion along the force at large strains; `None` if it was not computed.
    pub large_strains: Option<LargeStrains>,
}

/// Ratios of the robot's Young's modulus to the gel's. For a metal the ratio is about 10¹⁰, at which rounding hides the difference from a rigid robot.
const MODULUS_RATIOS: [f64; 3] = [1e2, 1e3, 1e4];
/// Resolution of the elements for elastic robots and for the rigid robots that they are compared with.
const ELASTIC: Resolution = Resolution { order: 6, rim_layers: 3, formulation: Formulation::Mixed };

fn elastic(bodies: &[StudyBody], outer_radius_m: f64, poisson_ratio: f64) -> Result<Vec<ElasticRobotResult>> {
    let of_ratio = |modulus_ratio: f64| {
        let share = |body: &StudyBody| {
            let (revolution, direction) = (body.revolution(), body.direction());
            let robot = ElasticRobot { modulus_ratio, poisson_ratio: 0.3 };
            let rigid = solve(revolution, outer_radius_m, poisson_ratio, direction, ELASTIC)?.stiffness_m;
            let soft = solve_elastic(revolution, robot, outer_radius_m, poisson_ratio, direction, ELASTIC)?;
            Ok(1.0 - soft / rigid)
        };
        let shares: Vec<f64> = bodies.par_iter().map(share).collect::<Result<_>>()?;
        let largest_relative_difference = shares.into_iter().fold(0.0, f64::max);
        Ok(ElasticRobotResult { modulus_ratio, largest_relative_difference })
    };
    MODULUS_RATIOS.into_iter().map(of_ratio).collect()
}

/// Returns a body's stiffness at every Poisson ratio, from one mesh, and its displacement field at the first Poisson ratio.
fn solve_body(
    body: &StudyBody,
    vitreous: &Vitreous,
    poisson_ratios: &[f64],
) -> Result<(Vec<BodyStiffness>, BodyField)> {
    let mesh = robot_mesh(&body.robot, vitreous, MODEL_LEVEL)?;
    let stiffness = Stiffness::new(&mesh)?;
    let (quality, unknowns) = (MeshQuality::of(&mesh), &stiffness.assembly.unknowns);
    let (mut solved, mut displacement) = (Vec::new(), Vec::new());
    for &poisson_ratio in poisson_ratios {
        let outer_radius_m = 0.5 * vitreous.diameter_m;
        let meridional =
            solve(body.revolution(), outer_radius_m, poisson_ratio, body.direction(), Resolution::default())?;
        let response = stiffness.factor(poisson_ratio)?.unit_response();
        let moved = response[unknowns.robot()];
        if displacement.is_empty() {
            displacement = unknowns.nodal_displacement(&response.iter().map(|u| u / moved).collect::<Vec<f64>>());
        }
        solved.push(BodyStiffness {
            body: *body,
            stiffness_m: meridional.stiffness_m,
            relative_error: meridional.relative_error,
            stiffness_3d_m: 1.0 / (unknowns.share() * moved),
            unknowns: unknowns.count(),
            quality,
        });
    }
    Ok((solved, BodyField { body: *body, mesh, displacement }))
}

/// Computes the results at every combination of aspect ratio and Poisson ratio; the Poisson ratio varies fastest.
///
/// Also returns the displacement fields of the equal-volume bodies at the first aspect ratio. Fields of equal-surface bodies differ from these fields only by a
/// scale.
fn study(
    request: &ShapesRequest<'_>,
    own_stiffnesses_m: &[f64],
    monitor: &dyn Monitor,
) -> Result<(Vec<StudyPoint>, Vec<BodyField>)> {
    let ShapesRequest { sphere_diameter_m, vitreous, aspects, poisson_ratios, .. } = request;
    let all: Vec<StudyBody> = aspects.iter().flat_map(|aspect| bodies(*aspect, *sphere_diameter_m)).collect();
    let counter = Counter::new(monitor, all.len());
    let n_bodies = all.len() / aspects.len();
    let solve_one = |(index, body)| {
        let (solved, field) = solve_body(body, vitreous, poisson_ratios)?;
        counter.add_one();
        Ok((solved, (index < n_bodies / 2).then_some(field)))
    };
    let found: Vec<(Vec<BodyStiffness>, Option<BodyField>)> =
        all.par_iter().enumerate().map(solve_one).collect::<Result<_>>()?;
    let (solved, fields): (Vec<Vec<BodyStiffness>>, Vec<Option<BodyField>>) = found.into_iter().unzip();
    let mut studied = Vec::new();
    for (aspect, of_aspect) in aspects.iter().zip(solved.chunks(n_bodies)) {
        for (index, poisson_ratio) in poisson_ratios.iter().enumerate() {
            let solved: Vec<BodyStiffness> = of_aspect.iter().map(|body| body[index]).collect();
            let measured = |body_stiffness: &BodyStiffness| StiffnessEstimate {
                body: body_stiffness.body,
                stiffness_m: body_stiffness.stiffness_m,
                relative_error: body_stiffness.relative_error,
            };
            studied.push(StudyPoint {
                aspect: *aspect,
                poisson_ratio: *poisson_ratio,
                claims: claims(&solved.iter().map(measured).collect::<Vec<_>>()),
                solved,
                own_stiffness_m: own_stiffnesses_m.get(index).copied(),
            });
        }
    }
    Ok((studied, fields.into_iter().flatten().collect()))
}

/// Returns the user's mesh, and the stiffness of its body divided by Young's modulus (m) at every Poisson ratio.
fn own_body(request: &ShapesRequest<'_>) -> Result<(Option<OwnMesh>, Vec<f64>)> {
    let Some(mesh) = &request.own_mesh else { return Ok((None, Vec::new())) };
    let stiffness = Stiffness::new(mesh)?;
    let stiffness_m = |ratio: &f64| Ok(1.0 / FullOrderModel::new(&stiffness, *ratio)?.compliance_per_m());
    let stiffnesses_m = request.poisson_ratios.iter().map(stiffness_m).collect::<Result<_>>()?;
    let own_mesh =
        OwnMesh { size: RobotSize::of(mesh), unknowns: stiffness.n_unknowns(), quality: MeshQuality::of(mesh) };
    Ok((Some(own_mesh), stiffnesses_m))
}

/// Runs the shape study.
///
/// # Errors
/// Errors of meshes and solvers, for bodies that do not fit into the gel.
pub fn run(request: &ShapesRequest<'_>, monitor: &dyn Monitor) -> Result<ShapesResult> {
    let ShapesRequest { sphere_diameter_m, vitreous, force_n, hold_s, gel, .. } = request;
    let outer_radius_m = 0.5 * vitreous.diameter_m;
    monitor.stage("computing the stiffness of every body, in the meridian plane and in three dimensions");
    let (own_mesh, own_stiffnesses_m) = own_body(request)?;
    let (studied, fields) = study(request, &own_stiffnesses_m, monitor)?;
    let (aspect, poisson_ratio) = (studied[0].aspect, studied[0].poisson_ratio);

    let time_s: Vec<f64> = (0..=2 * ROWS_A_HOLD).map(|i| hold_s * i as f64 / ROWS_A_HOLD as f64).collect();
    let force_n: Vec<f64> =
        (0..time_s.len()).map(|i| if (i / ROWS_A_HOLD).is_multiple_of(2) { *force_n } else { -force_n }).collect();
    let sphere = studied[0].solved[0];
    let scenario = Scenario::of_robot("sphere", sphere.body.robot, Vitreous { poisson_ratio, ..*vitreous });
    let rows = time_s.len();
    let record = Record {
        time_s: time_s.clone(),
        force_n,
        position_m: vec![None; rows],
        cycle: vec![1; rows],
        ..Record::default()
    };
    let ensemble = Ensemble::new(gel, &scenario, record, None, monitor)?;
    let position_um = quantiles_um(&ensemble.trajectories_m(0..ensemble.parameters.len())?);
    let [q05, median, q95] = [&position_um.q05, &position_um.median, &position_um.q95];
    let at_row = |row: usize| [q05[row], median[row], q95[row]].map(|um| 1e-6 * um * sphere.stiffness_m);
    let force_per_pa: Vec<[f64; 3]> = (0..rows).map(at_row).collect();
    let after_hold = force_per_pa[ROWS_A_HOLD];

    monitor.stage("comparing elastic robots with rigid ones");
    let elastic = elastic(&bodies(aspect, *sphere_diameter_m)[..5], outer_radius_m, poisson_ratio)?;
    monitor.stage("comparing predictors of the stiffness");
    let predictors = compare_predictors(*sphere_diameter_m, outer_radius_m, poisson_ratio)?;
    let large_strains = match &request.finite_law {
        Some(law) => {
            monitor.stage("following bodies along the force through large strains");
            let median: Vec<f64> = force_per_pa[..=ROWS_A_HOLD].iter().map(|row| row[1]).collect();
            let setting = large::LargeShapeSetting {
                sphere_diameter_m: *sphere_diameter_m,
                outer_radius_m,
                poisson_ratio,
                aspect,
                force_n: request.force_n,
            };
            Some(large::run(&setting, law, &time_s[..=ROWS_A_HOLD], &median, monitor)?)
        }
        None => None,
    };
    Ok(ShapesResult { studied, fields, own_mesh, time_s, force_per_pa, after_hold, elastic, predictors, large_strains })
}
