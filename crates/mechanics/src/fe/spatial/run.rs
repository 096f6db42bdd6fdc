//! Full-order runs of effects that change the displacement field, by time stepping of their definition.

use super::{Scaled, SpatialKind, SpatialSystem};
use crate::effects::{Spatial, Stages, pocket_law};
use crate::error::{Error, Result};
use crate::fe::Stiffness;
use crate::fe::poroelastic::{CondensedPores, PoreModel};
use crate::fe::stepping::run::CLOCK_ROUNDING;
use crate::fe::stepping::{observed, switches};
use crate::fe::transient::{self, Load, Resolution, Switch, TransientSystem};
use crate::mesh::{Mesh, QuarterBall};
use crate::rheology::{CreepCompliance, Element, TimeWindow};

/// What gel and robot measure and weigh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sizes {
    /// Density of the gel, in kg/m³.
    pub gel_density_kg_m3: f64,
    /// Mass of the whole robot, in kg.
    pub robot_mass_kg: f64,
    /// Radius of the robot, or of the sphere of its volume, in m.
    pub robot_radius_m: f64,
    /// Radius of the outer surface, in m.
    pub outer_radius_m: f64,
    /// How the mesh was made, where it is the built-in one around a sphere: a pocket needs one with element faces at its radius.
    pub ball: Option<QuarterBall>,
}

/// The gel and the robot in it.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Its stiffness.
    pub stiffness: &'a Stiffness,
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Sizes and weights.
    pub sizes: Sizes,
}

/// Layers of elements inside a pocket, and how many more than the model's mesh there are in all.
const LAYERS_INSIDE: usize = 4;
const MORE_LAYERS: usize = 1;
/// Layers for a law that thins, over the model's. At n = 0.3 a robot moves 4 µm of 0.78 mm too far among 8 layers, 1.5 among 12, 0.1 among 24; a quarter of its arc in two elements
/// adds 0.2 µm, in one 0.4.
const THINNING_LAYERS: usize = 2;

impl Surroundings<'_> {
    /// A mesh with element faces at the radius (m) of a pocket, by the model's fineness.
    ///
    /// # Errors
    /// [`Error::Numerical`] where the robot is no sphere in the middle of a built-in mesh, or the pocket does not fit.
    pub fn pocket_mesh(&self, radius_m: f64) -> Result<Mesh> {
        let ball = self.sizes.ball.ok_or_else(|| {
            Error::numerical(
                "a liquefied pocket needs the built-in mesh around a sphere in the middle of the vitreous",
                "leave `liquefied-pocket` out for other robots, for robots off the centre (`offset_mm`) and for meshes from files",
            )
        })?;
        let n_inside = (ball.n_layers * LAYERS_INSIDE).div_ceil(12);
        QuarterBall { n_layers: ball.n_layers + MORE_LAYERS, ..ball }.mesh_with_interface(radius_m, n_inside)
    }

    /// Around a sphere in a built-in mesh, one of other layers for a law that thins: rates of strain fall off so steeply from the robot that twice the layers take
    /// more from the error than elements along them, of which there are fewer. `None` around other robots.
    pub fn thinning_ball(&self) -> Option<QuarterBall> {
        let layered = |ball: QuarterBall| QuarterBall {
            n_per_edge: (ball.n_per_edge - 1).max(1),
            n_layers: THINNING_LAYERS * ball.n_layers,
            ..ball
        };
        self.sizes.ball.map(layered)
    }
}

/// What a run gives.
pub struct SpatialRun {
    /// Recorded position (m) at every row.
    pub position_m: Vec<f64>,
    /// Displacement of every node (m) at the rows that were asked for.
    pub fields: Vec<Vec<[f64; 3]>>,
    /// Their mesh, where it is not the surroundings' own.
    pub mesh: Option<Mesh>,
}

/// Steps the stages' field effect through a record; row i's commanded force (N) holds on [tᵢ, tᵢ₊₁).
///
/// # Errors
/// [`Error::Numerical`] where the stages have no such effect, the gel softens beside it, or the run fails.
pub fn run(
    surroundings: &Surroundings<'_>,
    stages: &Stages,
    time_s: &[f64],
    force_n: &[f64],
    rows: &[usize],
    resolution: Resolution,
) -> Result<SpatialRun> {
    if !stages.softening_rate_per_s.is_constant(0.0) {
        return Err(Error::numerical(
            "a gel that softens while it is measured is not stepped beside an effect that changes the field",
            "leave one of them out",
        ));
    }
    let job = Job { stages, time_s, force_n, rows, resolution };
    match &stages.spatial {
        None => Err(Error::numerical("there is no effect that changes the field", "step the law alone")),
        Some(Spatial::Inertia { density_scale }) => {
            let system = SpatialSystem::new(surroundings, surroundings.mesh, SpatialKind::Inertia)?;
            let scaled = Scaled { system: &system, friction_scale: 0.0, density_scale: density_scale.value };
            job.step(&scaled, &[&stages.law], |z| system.freedoms.nodal_displacement(z))
        }
        Some(Spatial::Slip { compliance_m_per_pa_s }) => {
            let system = SpatialSystem::new(surroundings, surroundings.mesh, SpatialKind::Slip)?;
            let friction_scale = compliance_m_per_pa_s.value.recip();
            let scaled = Scaled { system: &system, friction_scale, density_scale: 0.0 };
            job.step(&scaled, &[&stages.law], |z| system.freedoms.nodal_displacement(z))
        }
        Some(Spatial::Pocket { radius_ratio, elastic_loss }) => {
            let radius_m = radius_ratio.value * surroundings.sizes.robot_radius_m;
            let mesh = surroundings.pocket_mesh(radius_m)?;
            let system = SpatialSystem::new(surroundings, &mesh, SpatialKind::Pocket { radius_m })?;
            let scaled = Scaled { system: &system, friction_scale: 0.0, density_scale: 0.0 };
            let inside = pocket_law(&stages.law, *elastic_loss)?;
            let run = job.step(&scaled, &[&inside, &stages.law], |z| system.freedoms.nodal_displacement(z))?;
            Ok(SpatialRun { mesh: Some(mesh), ..run })
        }
        Some(Spatial::Nonlinear(_)) => Err(Error::numerical(
            "a law that is not linear has no matrices of its own",
            "run it by the balance of `fe::nonlinear`",
        )),
        Some(Spatial::PoreFlow { mobility_m2_per_pa_s, drained_poisson_ratio }) => {
            let model = PoreModel::new(surroundings.mesh, surroundings.stiffness, surroundings.poisson_ratio)?;
            let body = model.drained(drained_poisson_ratio.value)?;
            let pores = CondensedPores::new(&body, mobility_m2_per_pa_s.value);
            let unknowns = &surroundings.stiffness.assembly.unknowns;
            job.step(&pores, &[&stages.law], |z| unknowns.nodal_displacement(&pores.displacements(z)))
        }
    }
}

/// Positions (m) at rows by superposition: a force that does not depend on the position acts on a linear system, so that one step of it, stepped once through
/// the record's length, gives the answer to any.
fn superposed(
    system: &dyn TransientSystem,
    chains: &[CreepCompliance],
    load: &Load,
    time_s: &[f64],
    resolution: Resolution,
) -> Result<Vec<f64>> {
    let (Some(first_s), Some(last_s)) = (time_s.first(), time_s.last()) else { return Ok(Vec::new()) };
    let rounding_s = CLOCK_ROUNDING * (last_s - first_s);
    // Time since a change, the row, and the change in N.
    let mut terms: Vec<(f64, usize, f64)> = Vec::new();
    let mut force_n = 0.0;
    for switch in &load.switches {
        let change_n = switch.force_n - force_n;
        force_n = switch.force_n;
        let ages = time_s.iter().map(|t| t - switch.time_s).enumerate().filter(|(_, age_s)| *age_s > rounding_s);
        terms.extend(ages.filter(|_| change_n != 0.0).map(|(row, age_s)| (age_s, row, change_n)));
    }
    terms.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ages_s: Vec<f64> = std::iter::once(0.0).chain(terms.iter().map(|term| term.0)).collect();
    let unit =
        Load { switches: vec![Switch { time_s: 0.0, force_n: 1.0 }], lag_time_s: load.lag_time_s, gradient_per_m: 0.0 };
    let answer = transient::run(system, chains, &unit, &ages_s, &[], resolution)?;
    let mut position_m = vec![0.0; time_s.len()];
    for ((_, row, change_n), per_n) in terms.iter().zip(&answer.position_m[1..]) {
        position_m[*row] += change_n * per_n;
    }
    Ok(position_m)
}

/// What all runs share.
struct Job<'a> {
    stages: &'a Stages,
    time_s: &'a [f64],
    force_n: &'a [f64],
    rows: &'a [usize],
    resolution: Resolution,
}

impl Job<'_> {
    fn step(
        &self,
        system: &dyn TransientSystem,
        laws: &[&Vec<Element>],
        nodal: impl Fn(&[f64]) -> Vec<[f64; 3]>,
    ) -> Result<SpatialRun> {
        let load = &self.stages.load;
        let steps = switches(load, self.time_s, self.force_n);
        let load = Load {
            switches: steps.into_iter().map(|s| Switch { time_s: s.time_s, force_n: s.force_n }).collect(),
            lag_time_s: load.lag_time_s.value,
            gradient_per_m: load.gradient_per_m.value,
        };
        let window = self.window();
        let chains: Vec<CreepCompliance> =
            laws.iter().map(|law| transient::chain_of(law, window)).collect::<Result<_>>()?;
        let start_s = self.time_s.first().copied().unwrap_or(0.0);
        let observe = |(x, t): (&f64, &f64)| observed(&self.stages.observation, *x, t - start_s);
        if self.rows.is_empty() && load.gradient_per_m == 0.0 {
            let position_m = superposed(system, &chains, &load, self.time_s, self.resolution)?;
            let position_m = position_m.iter().zip(self.time_s).map(observe).collect();
            return Ok(SpatialRun { position_m, fields: Vec::new(), mesh: None });
        }
        let stepped = transient::run(system, &chains, &load, self.time_s, self.rows, self.resolution)?;
        Ok(SpatialRun {
            position_m: stepped.position_m.iter().zip(self.time_s).map(observe).collect(),
            fields: stepped.fields.iter().map(|z| nodal(z)).collect(),
            mesh: None,
        })
    }

    /// Times between a hundredth of the shortest interval and the record's length.
    fn window(&self) -> TimeWindow {
        let shortest_s = self.time_s.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
        let length_s = self.time_s.last().zip(self.time_s.first()).map_or(1.0, |(last, first)| last - first);
        if !shortest_s.is_finite() || length_s <= 0.0 {
            return TimeWindow { shortest_s: 1.0, longest_s: 1.0 };
        }
        TimeWindow { shortest_s: 0.01 * shortest_s, longest_s: length_s }
    }
}
