//! Full-order runs of linear effects that change the displacement field. They step the effects'
//! defining equations in time.

use super::condensed::Condensed;
use super::{GelAndRobot, SpatialSystem, SteppedSystem};
use crate::fe::clock::CLOCK_ROUNDING;
use crate::fe::poroelastic::{CondensedPores, PoreModel};
use crate::fe::transient::{self, ChainLaw, FieldTerm, Load, Resolution, TransientSystem};
use crate::mesh::Mesh;
use base::error::{Error, Result};
use laws::rheology::{AdditionalTerm, Element, TimeWindow};
use laws::stages::{Stages, Switch};
use record::Force;

/// Positions and displacement fields that a full-order run computes.
pub struct SpatialResult {
    /// Recorded position (m) at every row.
    pub position_m: Vec<f64>,
    /// Displacement (m) of every node at the requested rows, one list per row.
    pub fields: Vec<Vec<[f64; 3]>>,
    /// Mesh of the fields, if it differs from the mesh of the surroundings.
    pub mesh: Option<Mesh>,
}

/// A record to step through, with the model and the requested output.
#[derive(Debug, Clone, Copy)]
pub struct SpatialInput<'a> {
    /// Load, law and observation of the model.
    pub stages: &'a Stages,
    /// Times of the rows, in s.
    pub time_s: &'a [f64],
    /// Commanded force at the rows.
    pub force: Force<'a>,
    /// Indices of the rows at which fields are requested.
    pub rows: &'a [usize],
    /// Refinement of the time steps.
    pub resolution: Resolution,
}

/// Positions (m) at all rows, and unknowns at the requested rows, by superposition. If the force
/// does not depend on the position, it acts on a linear system. Responses to one step and one ramp
/// over the record's length then give the response to any force.
fn superposed(
    job: &SpatialInput<'_>,
    system: &dyn TransientSystem,
    chains: &[ChainLaw],
    load: &Load,
) -> Result<(Vec<f64>, Vec<Vec<f64>>)> {
    let time_s = job.time_s;
    let mut position_m = vec![0.0; time_s.len()];
    let mut fields = vec![vec![0.0; system.n_unknowns()]; job.rows.len()];
    let (Some(first_s), Some(last_s)) = (time_s.first(), time_s.last()) else { return Ok((position_m, fields)) };
    let rounding_s = CLOCK_ROUNDING * (last_s - first_s);
    let (mut steps, mut kinks) = (Vec::new(), Vec::new());
    let mut before = Switch::to(*first_s, 0.0);
    for switch in &load.switches {
        if switch.jumps {
            steps.push((switch.time_s, switch.force_n - before.input_n(switch.time_s)));
        }
        kinks.push((switch.time_s, switch.slope_n_per_s - before.slope_n_per_s));
        before = *switch;
    }
    let step = Switch::to(0.0, 1.0);
    let ramp = Switch { force_n: 0.0, slope_n_per_s: 1.0, jumps: false, ..step };
    for (unit, mut changes) in [(step, steps), (ramp, kinks)] {
        changes.retain(|(switched_s, change)| *change != 0.0 && last_s - switched_s > rounding_s);
        let Some(first_change_s) = changes.iter().map(|(switched_s, _)| *switched_s).reduce(f64::min) else { continue };
        let rows_after = |switched_s: f64| time_s.partition_point(|t| t - switched_s <= rounding_s);
        let first_age_s = changes.iter().map(|(switched_s, _)| time_s[rows_after(*switched_s)] - switched_s);
        let ages_s = [first_age_s.fold(f64::INFINITY, f64::min), last_s - first_change_s];
        let term = |(sum, row): (usize, &usize), (switched_s, factor): &(f64, f64)| {
            let age_s = time_s.get(*row)? - switched_s;
            (age_s > rounding_s).then_some(FieldTerm { age_s, sum, factor: *factor })
        };
        let rows = job.rows.iter().enumerate();
        let mut terms: Vec<FieldTerm> =
            rows.flat_map(|row| changes.iter().filter_map(move |change| term(row, change))).collect();
        terms.sort_by(|a, b| a.age_s.total_cmp(&b.age_s));
        let unit = Load { switches: vec![unit], equations: load.equations.clone() };
        let response = transient::unit_response(system, chains, &unit, ages_s, &terms, job.resolution)?;
        for (switched_s, change) in changes {
            let first = rows_after(switched_s);
            for (x, t) in position_m[first..].iter_mut().zip(&time_s[first..]) {
                *x += change * response.position_m(t - switched_s);
            }
        }
        for (sum, field) in fields.iter_mut().zip(&response.fields) {
            sum.iter_mut().zip(field).for_each(|(sum, value)| *sum += value);
        }
    }
    Ok((position_m, fields))
}

impl SpatialInput<'_> {
    /// Computes the robot's motion in a gel with an effect in addition to its law.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the gel also softens over time, or if the run fails.
    pub fn run(&self, system: &SpatialSystem, beside: &AdditionalTerm) -> Result<SpatialResult> {
        let condensed = Condensed::of(system)?;
        let (stepped, laws) = SteppedSystem::new(
            condensed.as_ref().map_or(system, |condensed| &condensed.system),
            &self.stages.law,
            beside,
        );
        self.step(&stepped, &laws, |fields| {
            let fields = match &condensed {
                Some(condensed) => condensed.expanded(fields)?,
                None => fields,
            };
            Ok(fields.iter().map(|z| system.freedoms.nodal_displacement(z)).collect())
        })
    }

    /// Computes the robot's motion in a gel with pore flow. `mobility` is in m²/(Pa·s);
    /// `drained_ratio` is the Poisson ratio of the skeleton.
    ///
    /// # Errors
    /// Those of [`Self::run`].
    pub fn run_pores(
        &self,
        surroundings: &GelAndRobot<'_>,
        mobility: f64,
        drained_ratio: f64,
    ) -> Result<SpatialResult> {
        let model = PoreModel::new(surroundings.mesh, surroundings.stiffness, surroundings.poisson_ratio)?;
        let body = model.drained(drained_ratio)?;
        let pores = CondensedPores::new(&body, mobility);
        let unknowns = &surroundings.stiffness.assembly.unknowns;
        let laws = [self.stages.law.clone()];
        self.step(&pores, &laws, |fields| {
            Ok(fields.iter().map(|z| unknowns.nodal_displacement(&pores.displacements(z))).collect())
        })
    }

    fn step(
        &self,
        system: &dyn TransientSystem,
        laws: &[Vec<Element>],
        nodal: impl Fn(Vec<Vec<f64>>) -> Result<Vec<Vec<[f64; 3]>>>,
    ) -> Result<SpatialResult> {
        if !self.stages.softening_rate_per_s.is_constant(0.0) {
            return Err(Error::numerical(
                "softening over time cannot be combined with an effect that changes the displacement field",
                "leave out the softening or the effect",
            ));
        }
        let load = Load::of(&self.stages.load, self.time_s, self.force);
        let window = self.window();
        let chains: Vec<ChainLaw> = laws.iter().map(|law| transient::to_chain(law, window)).collect::<Result<_>>()?;
        let start_s = self.time_s.first().copied().unwrap_or(0.0);
        let observation = self.stages.observation.of::<f64>();
        let observe = |(x, t): (&f64, &f64)| observation.recorded_m(*x, t - start_s);
        let (position_m, fields) = if load.equations.depends_on_position() {
            let stepped = transient::run(system, &chains, &load, self.time_s, self.rows, self.resolution)?;
            (stepped.position_m, stepped.fields)
        } else {
            superposed(self, system, &chains, &load)?
        };
        Ok(SpatialResult {
            position_m: position_m.iter().zip(self.time_s).map(observe).collect(),
            fields: nodal(fields)?,
            mesh: None,
        })
    }

    /// Window of times for which the law must be accurate, from a hundredth of the shortest row
    /// interval to the record's length.
    fn window(&self) -> TimeWindow {
        let shortest_s = self.time_s.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
        let length_s = self.time_s.last().zip(self.time_s.first()).map_or(1.0, |(last, first)| last - first);
        if !shortest_s.is_finite() || length_s <= 0.0 {
            return TimeWindow { shortest_s: 1.0, longest_s: 1.0 };
        }
        TimeWindow { shortest_s: 0.01 * shortest_s, longest_s: length_s }
    }
}
