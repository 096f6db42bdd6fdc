//! The study: stiffness of every body by two solvers, the posterior carried through, claims, predictors and the design question.

use rayon::prelude::*;

use super::bodies::{Body, Shape, bodies};
use super::claims::{Claim, Measured, claims};
use super::design::{LongestRobot, StiffnessSurrogate, longest};
use super::predictors::{PredictorRecord, compare_predictors};
use crate::error::Result;
use crate::experiment::{Orientation, Vitreous};
use crate::fe::meridional::{ElasticRobot, Formulation, Resolution, solve, solve_elastic};
use crate::fe::{Stiffness, time::FullOrderModel};
use crate::model::convolve_m;
use crate::report::density::{quantile_of_sorted, sorted};
use crate::rheology::CreepCompliance;
use crate::workflow::mechanics::{MODEL_LEVEL, robot_mesh};
use crate::workflow::{Counter, Monitor};

/// Times a hold of the cycle in trajectories.
const ROWS_A_HOLD: usize = 100;

/// What a caller decides.
pub struct ShapesRequest {
    /// The sphere whose volume or surface the others have, in m.
    pub sphere_diameter_m: f64,
    /// The gel around them.
    pub vitreous: Vitreous,
    /// Length to diameter, and long to short semi-axis.
    pub aspect: f64,
    /// Amplitude of the force, in N: + for one hold, − for the next.
    pub force_n: f64,
    /// Length of a hold, in s.
    pub hold_s: f64,
    /// How far the longest robot must move within one hold, in m.
    pub distance_m: f64,
    /// Posterior draws of the gel.
    pub laws: Vec<CreepCompliance>,
    /// Stiffness of the body of the user's own mesh, in m, to be set beside the others.
    pub own_stiffness_m: Option<f64>,
}

/// A body's stiffness, found twice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solved {
    /// The body.
    pub body: Body,
    /// Force per displacement per Pa of Young's modulus, whole body, in m: by high-order elements in the meridian.
    pub stiffness_m: f64,
    /// Their own error estimate.
    pub relative_error: f64,
    /// The same by the program's three-dimensional elements, in m.
    pub stiffness_3d_m: f64,
}

/// What the study led to.
pub struct ShapesResult {
    /// Ten bodies.
    pub solved: Vec<Solved>,
    /// Times of one cycle, in s.
    pub time_s: Vec<f64>,
    /// Position times stiffness (N/Pa) at each of them: 5 %, 50 %, 95 %. A body's position is this over its stiffness.
    pub force_per_pa: Vec<[f64; 3]>,
    /// The same at the end of the first hold.
    pub after_hold: [f64; 3],
    /// The paper's claims.
    pub claims: Vec<Claim>,
    /// How far elastic robots are from rigid ones.
    pub elastic: Vec<ElasticRecord>,
    /// What predicts the stiffness.
    pub predictors: Vec<PredictorRecord>,
    /// The longest robots.
    pub longest: Vec<LongestRobot>,
}

/// Elastic robots of one modulus.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ElasticRecord {
    /// The robot's Young's modulus over the gel's.
    pub modulus_ratio: f64,
    /// Largest share by which a body is less stiff than a rigid one.
    pub largest_relative_difference: f64,
}

/// Moduli that are tried; a metal's is about 10¹⁰ times the gel's, where rounding hides the difference.
const MODULUS_RATIOS: [f64; 3] = [1e2, 1e3, 1e4];
/// Fineness of elastic robots and of the rigid ones that they are compared with.
const ELASTIC: Resolution = Resolution { order: 6, rim_layers: 3, formulation: Formulation::Mixed };

fn elastic(bodies: &[Body], outer_radius_m: f64, poisson_ratio: f64) -> Result<Vec<ElasticRecord>> {
    let of_ratio = |modulus_ratio: f64| {
        let share = |body: &Body| {
            let (revolution, direction) = (body.revolution, body.direction());
            let robot = ElasticRobot { modulus_ratio, poisson_ratio: 0.3 };
            let rigid = solve(revolution, outer_radius_m, poisson_ratio, direction, ELASTIC)?.stiffness_m;
            let soft = solve_elastic(revolution, robot, outer_radius_m, poisson_ratio, direction, ELASTIC)?;
            Ok(1.0 - soft / rigid)
        };
        let shares: Vec<f64> = bodies.par_iter().map(share).collect::<Result<_>>()?;
        let largest_relative_difference = shares.into_iter().fold(0.0, f64::max);
        Ok(ElasticRecord { modulus_ratio, largest_relative_difference })
    };
    MODULUS_RATIOS.into_iter().map(of_ratio).collect()
}

/// Runs the study.
///
/// # Errors
/// Those of meshes and solvers, for bodies that do not fit.
pub fn run(request: &ShapesRequest, monitor: &dyn Monitor) -> Result<ShapesResult> {
    let ShapesRequest { sphere_diameter_m, vitreous, aspect, force_n, hold_s, distance_m, laws, .. } = request;
    let (outer_radius_m, poisson_ratio) = (0.5 * vitreous.diameter_m, vitreous.poisson_ratio);
    let bodies = bodies(*aspect, *sphere_diameter_m);
    monitor.stage("solving for every body, in the meridian and in three dimensions");
    let counter = Counter::new(monitor, bodies.len());
    let solve_one = |body: &Body| {
        let meridional =
            solve(body.revolution, outer_radius_m, poisson_ratio, body.direction(), Resolution::default())?;
        let mesh = robot_mesh(&body.robot(0.0), vitreous, MODEL_LEVEL)?;
        let compliance_per_m = FullOrderModel::new(&Stiffness::new(&mesh)?, poisson_ratio)?.compliance_per_m();
        counter.add_one();
        Ok(Solved {
            body: *body,
            stiffness_m: meridional.stiffness_m,
            relative_error: meridional.relative_error,
            stiffness_3d_m: 1.0 / compliance_per_m,
        })
    };
    let solved: Vec<Solved> = bodies.par_iter().map(solve_one).collect::<Result<_>>()?;

    let time_s: Vec<f64> = (0..=2 * ROWS_A_HOLD).map(|i| hold_s * i as f64 / ROWS_A_HOLD as f64).collect();
    let force_n: Vec<f64> =
        (0..time_s.len()).map(|i| if (i / ROWS_A_HOLD).is_multiple_of(2) { *force_n } else { -force_n }).collect();
    let trajectories: Vec<Vec<f64>> = laws.par_iter().map(|law| convolve_m(1.0, law, &time_s, &force_n)).collect();
    let at_row = |row: usize| {
        let ascending = sorted(&trajectories.iter().map(|own| own[row]).collect::<Vec<f64>>());
        [0.05, 0.5, 0.95].map(|probability| quantile_of_sorted(&ascending, probability))
    };
    let force_per_pa: Vec<[f64; 3]> = (0..time_s.len()).into_par_iter().map(at_row).collect();
    let after_hold = force_per_pa[ROWS_A_HOLD];

    monitor.stage("comparing elastic robots with rigid ones");
    let elastic = elastic(&bodies[..5], outer_radius_m, poisson_ratio)?;
    monitor.stage("comparing what may predict the stiffness");
    let predictors = compare_predictors(*sphere_diameter_m, outer_radius_m, poisson_ratio)?;
    monitor.stage("looking for the longest robot that moves far enough");
    let ends: Vec<f64> = trajectories.iter().map(|own| own[ROWS_A_HOLD]).collect();
    let mut found = Vec::new();
    for shape in [Shape::Ellipsoid, Shape::Cylinder] {
        for orientation in [Orientation::Horizontal, Orientation::Vertical] {
            let surrogate =
                StiffnessSurrogate::new(shape, orientation, *sphere_diameter_m, outer_radius_m, poisson_ratio)?;
            found.push(longest(&surrogate, *sphere_diameter_m, poisson_ratio, &ends, *distance_m));
        }
    }
    let measured: Vec<Measured> = solved
        .iter()
        .map(|own| Measured { body: own.body, stiffness_m: own.stiffness_m, relative_error: own.relative_error })
        .collect();
    Ok(ShapesResult {
        claims: claims(&measured),
        solved,
        time_s,
        force_per_pa,
        after_hold,
        elastic,
        predictors,
        longest: found,
    })
}
