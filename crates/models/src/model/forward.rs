//! Full-order and reduced model with their common trait.

use super::{Compliance, Model, N_LANES, Response};
use crate::effects::sphere_required_error;
use base::error::{Error, Result};
use base::number::Dual;
use elements::fe::meridional::NonlinearBall;
use elements::fe::nonlinear::{self, NonlinearModel};
use elements::fe::oldroyd::{self, FiniteGel, FiniteInput, FiniteLaw};
use elements::fe::spatial::{GelAndRobot, SpatialInput, SpatialResult};
use elements::fe::stepping::Resolution;
use elements::fe::time::{FullOrderModel, TimeScheme};
use elements::fe::{Stiffness, transient};
use elements::mesh::Mesh;
use laws::stages::{Spatial, Stages};
use record::Force;
use std::sync::OnceLock;

/// Model that computes the trajectory of a record from parameters.
pub trait Forward: Sync {
    /// Returns the recorded position (m) at every row of the record, as the limit from the left. `parameters` are in SI units and
    /// in the order of [`Model::parameters`].
    fn trajectory_m(&self, parameters: &[f64]) -> Result<Vec<f64>>;
}

/// Full-order model, which steps finite elements through the record.
///
/// A base law without effects is stepped by exponentials, which are exact between rows. A law with effects is stepped by the differential
/// equations of its elements. Both methods are independent of the reduced model's closed forms.
pub struct FullOrderForward<'a> {
    model: &'a Model,
    stiffness: &'a Stiffness,
    /// Finite-element model at the experiment's Poisson ratio.
    at_experiment_ratio: FullOrderModel,
    time_s: &'a [f64],
    force: Force<'a>,
    resolution: Resolution,
    surroundings: Option<GelAndRobot<'a>>,
    /// Nonlinear finite-element model, which the first run of a nonlinear law prepares.
    nonlinear: OnceLock<NonlinearModel<'a>>,
}

/// Result of a run of the full-order model.
pub struct FullRun {
    /// Recorded position (m) at every row.
    pub position_m: Vec<f64>,
    /// Displacement vector (m) of every node, by requested row and then by node.
    pub fields: Vec<Vec<[f64; 3]>>,
    /// Mesh of the fields; `None` if it is the mesh that the model was given.
    pub mesh: Option<Mesh>,
    /// Displacement of the robot per force at unit creep compliance, in 1/m, at the run's Poisson ratio.
    pub compliance_per_m: f64,
}

impl<'a> FullOrderForward<'a> {
    /// Returns the full-order model of a record. `at_experiment_ratio` is the finite-element model at the experiment's Poisson ratio.
    pub fn new(
        model: &'a Model,
        stiffness: &'a Stiffness,
        at_experiment_ratio: FullOrderModel,
        time_s: &'a [f64],
        force: impl Into<Force<'a>>,
    ) -> Self {
        let (resolution, nonlinear) = (Resolution::default(), OnceLock::new());
        Self {
            model,
            stiffness,
            at_experiment_ratio,
            time_s,
            force: force.into(),
            resolution,
            surroundings: None,
            nonlinear,
        }
    }

    /// Adds gel and robot. Effects on the displacement field need them.
    pub fn in_surroundings(self, surroundings: GelAndRobot<'a>) -> Self {
        Self { surroundings: Some(surroundings), nonlinear: OnceLock::new(), ..self }
    }

    /// Replaces the default resolution of the time steps.
    pub fn with_resolution(self, resolution: Resolution) -> Self {
        Self { resolution, ..self }
    }

    /// Displacement (1/m) of the robot per unit force at unit creep compliance, at the experiment's Poisson ratio.
    pub fn compliance_per_m(&self) -> f64 {
        self.at_experiment_ratio.compliance_per_m()
    }

    /// Computes the trajectory at every row, and the displacement fields at `field_rows`.
    pub fn run(&self, parameters: &[f64], field_rows: &[usize]) -> Result<FullRun> {
        let is_position_controlled = self.model.scales().is_position_controlled;
        let (base, is_exponential) = (self.model.base(), self.model.is_law_alone() && !is_position_controlled);
        if let Some(law) = base.creep_compliance(parameters).filter(|_| is_exponential) {
            let load = self.at_experiment_ratio.solve_load(self.time_s, self.force);
            let position_m = self.at_experiment_ratio.trajectory(&load, &law, TimeScheme::Exponential);
            let fields = self.nodal(self.at_experiment_ratio.fields(&load, &law, field_rows));
            return Ok(FullRun { position_m, fields, mesh: None, compliance_per_m: self.compliance_per_m() });
        }
        let constants: Vec<Dual> = parameters.iter().map(|value| Dual::constant(*value)).collect();
        let stages = self.model.stages(&constants)?;
        if let Some(spatial) = &stages.spatial {
            let surroundings = self.surroundings.as_ref().ok_or_else(|| {
                Error::numerical("the full-order model has no mesh for this effect", "give the model its gel and robot")
            })?;
            let (linear, field) = match (spatial, self.model.field()) {
                (Spatial::Linear(linear), Some((_, field))) => (linear, field),
                (Spatial::Large { amplitude, mobility }, _) => {
                    return self.run_large(surroundings, &stages, [amplitude.value, mobility.value], field_rows);
                }
                _ => return self.run_nonlinear(surroundings, &stages, field_rows),
            };
            let (time_s, force, resolution) = (self.time_s, self.force, spatial_resolution(self.resolution));
            let job = SpatialInput { stages: &stages, time_s, force, rows: field_rows, resolution };
            let SpatialResult { position_m, fields, mesh } = field.run(surroundings, linear, &job)?;
            return Ok(FullRun { position_m, fields, mesh, compliance_per_m: self.compliance_per_m() });
        }
        let full = match stages.poisson_ratio {
            Some(ratio) => &FullOrderModel::new(self.stiffness, ratio.value)?,
            None => &self.at_experiment_ratio,
        };
        let stepped = full.step(&stages, self.time_s, self.force, self.resolution)?;
        let fields = self.nodal(full.fields_of(&stepped, field_rows));
        Ok(FullRun { position_m: stepped.position_m, fields, mesh: None, compliance_per_m: full.compliance_per_m() })
    }

    /// Runs a model of large displacements. Let x(F) be the response to a force F, and g the effect's amplitude. The function adds the
    /// deviation of x(gF)/g from the linear response to the linear model's position. The returned fields are those of the linear model.
    fn run_large(
        &self,
        surroundings: &GelAndRobot<'a>,
        stages: &Stages,
        [amplitude, mobility]: [f64; 2],
        rows: &[usize],
    ) -> Result<FullRun> {
        let linear = Stages { spatial: None, ..stages.clone() };
        let mut stepped = self.at_experiment_ratio.step(&linear, self.time_s, self.force, self.resolution)?;
        let fields = self.nodal(self.at_experiment_ratio.fields_of(&stepped, rows));
        let discretisation = oldroyd::Discretisation::default();
        let steps_per_doubling = scaled(discretisation.steps_per_doubling, self.resolution);
        let fineness = oldroyd::Discretisation { steps_per_doubling, ..discretisation };
        let (Some(ball), Some(law)) = (surroundings.sizes.ball, FiniteLaw::new(&stages.law, mobility)) else {
            return Err(sphere_required_error());
        };
        let gel = FiniteGel::around_sphere(ball.robot_radius_m, ball.outer_radius_m, fineness)?;
        let larger_n: Vec<f64> = self.force.at_rows_n.iter().map(|force_n| amplitude * force_n).collect();
        let force = Force { at_rows_n: &larger_n, ..self.force };
        let load = stages.load.for_scaled_commands(amplitude);
        let run = gel.run(&FiniteInput { law: &law, load: &load, time_s: self.time_s, force })?;
        let scale = stages.observation.scale.value / amplitude;
        stepped.position_m.iter_mut().zip(&run.deviation_m).for_each(|(x, deviation)| *x += scale * deviation);
        let (position_m, compliance_per_m) = (stepped.position_m, self.compliance_per_m());
        Ok(FullRun { position_m, fields, mesh: None, compliance_per_m })
    }

    /// Runs a nonlinear law: around a sphere at the gel's centre in the half meridian, around other robots on the mesh. The motion beyond the
    /// linear law is added to that of the linear law on the mesh.
    fn run_nonlinear(&self, surroundings: &GelAndRobot<'a>, stages: &Stages, rows: &[usize]) -> Result<FullRun> {
        let GelAndRobot { mesh, stiffness, poisson_ratio, sizes } = *surroundings;
        let default = nonlinear::NonlinearOptions::default();
        let steps_per_doubling = scaled(default.resolution.steps_per_doubling, self.resolution);
        let options = nonlinear::NonlinearOptions { resolution: Resolution { steps_per_doubling }, ..default };
        let (record, compliance_per_m) = ((self.time_s, self.force), self.compliance_per_m());
        let (position_m, fields) = if let Some(ball) = sizes.ball {
            let gel = NonlinearBall::new(ball.robot_radius_m, ball.outer_radius_m, poisson_ratio)?;
            let run = nonlinear::run_stages(&gel, stages, record, rows, options, compliance_per_m)?;
            let nodal = |field: &Vec<f64>| gel.displacements_at(field, &mesh.node_coordinates_m);
            (run.displacement_m, run.fields.iter().map(nodal).collect())
        } else {
            let model = match self.nonlinear.get() {
                Some(model) => model,
                None => {
                    let model = NonlinearModel::new(mesh, stiffness, poisson_ratio)?;
                    self.nonlinear.get_or_init(|| model)
                }
            };
            let run = nonlinear::run_stages(model, stages, record, rows, options, compliance_per_m)?;
            (run.displacement_m, self.nodal(run.fields))
        };
        Ok(FullRun { position_m, fields, mesh: None, compliance_per_m })
    }

    fn nodal(&self, fields: Vec<Vec<f64>>) -> Vec<Vec<[f64; 3]>> {
        let unknowns = &self.stiffness.assembly.unknowns;
        fields.iter().map(|field| unknowns.nodal_displacement(field)).collect()
    }
}

/// Returns the time steps of the linear field models. The default of [`transient::Resolution`] is multiplied by the ratio of `resolution`
/// to its own default.
fn spatial_resolution(resolution: Resolution) -> transient::Resolution {
    let entry = transient::Resolution::default();
    transient::Resolution { steps_per_doubling: scaled(entry.steps_per_doubling, resolution), ..entry }
}

/// Returns `steps_per_doubling` times the ratio of the `wanted` resolution to the default resolution, rounded up. Steps are counted per
/// doubling of the time since a switch.
fn scaled(steps_per_doubling: u32, wanted: Resolution) -> u32 {
    (steps_per_doubling * wanted.steps_per_doubling).div_ceil(Resolution::default().steps_per_doubling)
}

impl Forward for FullOrderForward<'_> {
    fn trajectory_m(&self, parameters: &[f64]) -> Result<Vec<f64>> {
        Ok(self.run(parameters, &[])?.position_m)
    }
}

/// Range of one parameter over which a surrogate was trained and verified.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TrainedRange {
    /// Name of the parameter, with its unit.
    pub name: String,
    /// Lower end of the range, in the unit of the name.
    pub lower: f64,
    /// Upper end of the range, in the unit of the name.
    pub upper: f64,
}

impl TrainedRange {
    /// Returns `true` if the value is inside the range.
    pub fn contains(&self, value: f64) -> bool {
        (self.lower..=self.upper).contains(&value)
    }
}

/// Reduced model, which computes trajectories from a compliance and the stages in closed form.
pub struct SurrogateForward<'a> {
    /// Base law with its effects.
    pub model: &'a Model,
    /// Displacement per force at unit creep compliance, in 1/m.
    pub compliance: Compliance,
    /// Record prepared for the evaluation of the model.
    pub response: Response,
    /// Trained ranges of the law's parameters; empty if the compliance is exact, as for an instrument.
    pub trained: &'a [TrainedRange],
}

impl SurrogateForward<'_> {
    fn in_trained_range(&self, parameters: &[f64]) -> Result<()> {
        for (range, &value) in self.trained.iter().zip(parameters) {
            if !range.contains(value) {
                return Err(Error::OutsideTrainedRange {
                    parameter: range.name.clone(),
                    value,
                    lower: range.lower,
                    upper: range.upper,
                });
            }
        }
        Ok(())
    }

    /// Recorded positions (m) of several parameter points at every row. Up to eight points are computed at once; their bits are those of [`Forward::trajectory_m`].
    ///
    /// # Errors
    /// Errors of [`Forward::trajectory_m`] for any point.
    pub fn trajectories_m(&self, points: &[Vec<f64>]) -> Result<Vec<Vec<f64>>> {
        let mut trajectories_m = Vec::with_capacity(points.len());
        let (mut stages, mut compliances_per_m, mut lanes) = (Vec::new(), Vec::new(), Vec::new());
        for chunk in points.chunks(N_LANES) {
            stages.clear();
            compliances_per_m.clear();
            for parameters in chunk {
                let (of_point, compliance_per_m) = self.stages(parameters)?;
                stages.push(of_point);
                compliances_per_m.push(compliance_per_m);
            }
            let is_sound = self.response.trajectories_m(&stages, &compliances_per_m, &mut lanes);
            for (lane, parameters) in chunk.iter().enumerate() {
                trajectories_m.push(match is_sound[lane] {
                    true => lanes.iter().map(|row| row.0[lane]).collect(),
                    false => self.trajectory_m(parameters)?,
                });
            }
        }
        Ok(trajectories_m)
    }

    /// Stages of the model at a parameter point, and the displacement per force at unit creep compliance (1/m).
    fn stages(&self, parameters: &[f64]) -> Result<(Stages, f64)> {
        self.in_trained_range(parameters)?;
        let constants: Vec<Dual> = parameters.iter().map(|value| Dual::constant(*value)).collect();
        let mut stages = self.model.stages(&constants)?;
        let compliance_per_m = self.compliance.resolve(&mut stages)?;
        Ok((stages, compliance_per_m.value))
    }

    /// Derivative of the trajectory with respect to the parameter at `index`, at every row, in m per unit of the parameter. The derivative
    /// is exact, and one-sided if the parameter is at an end of its support.
    ///
    /// # Errors
    /// Errors of [`Self::derivative_along_m`].
    pub fn derivative_m(&self, parameters: &[f64], index: usize) -> Result<Vec<f64>> {
        let direction: Vec<f64> = (0..parameters.len()).map(|i| f64::from(u8::from(i == index))).collect();
        self.derivative_along_m(parameters, &direction)
    }

    /// Derivative (m) of the trajectory at every row along `direction`, which has one component for each parameter, in its unit. The
    /// derivative is exact, and one-sided if a parameter is at an end of its support.
    ///
    /// # Errors
    /// Errors of [`Forward::trajectory_m`]. [`Error::Numerical`] if the derivative does not exist, such as with respect to a lag
    /// of zero.
    pub fn derivative_along_m(&self, parameters: &[f64], direction: &[f64]) -> Result<Vec<f64>> {
        self.in_trained_range(parameters)?;
        let carried = |(value, derivative): (&f64, &f64)| Dual { value: *value, derivative: *derivative };
        let parameters: Vec<Dual> = parameters.iter().zip(direction).map(carried).collect();
        let mut stages = self.model.stages(&parameters)?;
        let compliance_per_m = self.compliance.resolve(&mut stages)?;
        let positions = self.response.derivative_m(&stages, compliance_per_m)?;
        let derivative: Vec<f64> = positions.iter().map(|x| x.derivative).collect();
        if derivative.iter().all(|slope| slope.is_finite()) {
            return Ok(derivative);
        }
        let moved = self.model.parameters().iter().zip(direction).filter(|(_, part)| **part != 0.0);
        let names: Vec<&str> = moved.map(|(spec, _)| spec.name).collect();
        Err(Error::numerical(
            format!("the trajectory has no derivative with respect to {} here", names.join(", ")),
            "take a finite difference with the effect's documented step",
        ))
    }
}

impl Forward for SurrogateForward<'_> {
    fn trajectory_m(&self, parameters: &[f64]) -> Result<Vec<f64>> {
        let (stages, compliance_per_m) = self.stages(parameters)?;
        self.response.trajectory_m(&stages, compliance_per_m)
    }
}
