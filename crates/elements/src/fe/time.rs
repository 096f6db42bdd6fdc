//! Time stepping of the full-order model for linear laws, with internal fields (physics §3.2).
//!
//! The law consists of branches: Kelvin–Voigt bodies, and dashpots. Every branch has a nodal
//! displacement field, and all branches bear the same stress. This stress follows from the elastic
//! displacement w = K̂⁻¹ f, for the force f and the stiffness matrix K̂ at unit Young's modulus.
//! After a time step a branch's displacement is h + j w. The history h decays with time, and j is
//! the compliance gained. If the force is constant or linear in time, so is w. A step of the
//! exponential scheme is then exact.

use super::factorisation::Stiffness;
use base::error::Result;
use laws::rheology::CreepCompliance;
use record::Force;

/// Scheme that advances a branch over a step in which the stress is constant or linear in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TimeScheme {
    /// Exact solution from row to row, with exponential functions of the step length.
    #[default]
    Exponential,
    /// Implicit midpoint rule, of second order. It is an independent check of the exponential
    /// scheme.
    Midpoint,
}

impl TimeScheme {
    /// Factor by which a branch with the retardation time `time_s` decays over a step.
    fn decay(self, step_s: f64, time_s: f64) -> f64 {
        let z = step_s / time_s;
        match self {
            Self::Exponential => (-z).exp(),
            Self::Midpoint => (1.0 - 0.5 * z) / (1.0 + 0.5 * z),
        }
    }
}

/// The full-order model at one Poisson ratio. All laws and loads share one displacement field,
/// because all forces act on the robot along x.
#[derive(Debug, Clone)]
pub struct FullOrderModel {
    robot: usize,
    /// Displacement of every unknown for 1 N on the whole robot, at unit Young's modulus (in 1/m,
    /// as displacement × modulus / force).
    field_per_n: Vec<f64>,
}

/// A commanded force, with the displacement field for 1 N.
pub struct SolvedLoad<'a> {
    time_s: &'a [f64],
    force: Force<'a>,
    /// Displacement of every unknown for 1 N on the whole robot, at unit Young's modulus, in 1/m.
    field_per_n: &'a [f64],
}

impl FullOrderModel {
    /// Factorises the unit stiffness at `poisson_ratio`, which must lie in (−1, 0.5), and solves for the field.
    pub fn new(stiffness: &Stiffness, poisson_ratio: f64) -> Result<Self> {
        let factor = stiffness.factor(poisson_ratio)?;
        let share = stiffness.assembly.unknowns.share();
        let field_per_n = factor.unit_response().iter().map(|u| share * u).collect();
        Ok(Self { robot: stiffness.assembly.unknowns.robot(), field_per_n })
    }

    /// Prepares a commanded force for a run with rows at `time_s` (s).
    pub fn solve_load<'l>(&'l self, time_s: &'l [f64], force: impl Into<Force<'l>>) -> SolvedLoad<'l> {
        SolvedLoad { time_s, force: force.into(), field_per_n: &self.field_per_n }
    }

    /// Displacement of every unknown for 1 N on the whole robot, at unit Young's modulus, in 1/m.
    pub fn field_per_n(&self) -> &[f64] {
        &self.field_per_n
    }

    /// Displacement of the robot for 1 N at unit Young's modulus, in 1/m. The robot's position is
    /// this value times the superposition of creep responses to all changes of the force.
    pub fn compliance_per_m(&self) -> f64 {
        self.field_per_n[self.robot]
    }

    /// Returns the robot's position (m) at every row, just before any force step at the row.
    ///
    /// In a homogeneous gel each unknown evolves independently. This function therefore computes
    /// only the robot's unknown.
    pub fn trajectory(&self, load: &SolvedLoad, law: &CreepCompliance, scheme: TimeScheme) -> Vec<f64> {
        let mut position_m = Vec::with_capacity(load.time_s.len());
        let robot = &load.field_per_n[self.robot..=self.robot];
        run(load, robot, law, scheme, |run| position_m.push(run.displacement_at(0)));
        position_m
    }

    /// Returns the values (m) of all unknowns at the rows with the indices `rows`, one vector per
    /// row.
    pub fn fields(&self, load: &SolvedLoad, law: &CreepCompliance, rows: &[usize]) -> Vec<Vec<f64>> {
        self.fields_with_scheme(load, law, rows, TimeScheme::Exponential)
    }

    /// Returns the values (m) of all unknowns at the rows with the indices `rows`, for a choice of
    /// the time integrator.
    pub fn fields_with_scheme(
        &self,
        load: &SolvedLoad,
        law: &CreepCompliance,
        rows: &[usize],
        scheme: TimeScheme,
    ) -> Vec<Vec<f64>> {
        if rows.is_empty() {
            return Vec::new();
        }
        let (mut fields, mut row) = (Vec::with_capacity(rows.len()), 0);
        run(load, load.field_per_n, law, scheme, |run| {
            if rows.contains(&row) {
                fields.push((0..self.field_per_n.len()).map(|i| run.displacement_at(i)).collect());
            }
            row += 1;
        });
        fields
    }
}

/// Advances unknowns through all rows of a load, and passes the state at every row to `at_row`.
/// `field_per_n` is the response of these unknowns to 1 N.
fn run(
    load: &SolvedLoad,
    field_per_n: &[f64],
    law: &CreepCompliance,
    scheme: TimeScheme,
    mut at_row: impl FnMut(&TimeRun),
) {
    let mut run = TimeRun::new(law, field_per_n);
    at_row(&run);
    for row in 1..load.time_s.len() {
        let (force_n, slope_n_per_s) = (load.force.at_rows_n[row - 1], load.force.slope_n_per_s(load.time_s, row - 1));
        if row == 1 || load.force.is_linear() || force_n != load.force.at_rows_n[row - 2] {
            run.begin_hold(force_n, slope_n_per_s);
        }
        run.advance(load.time_s[row] - load.time_s[row - 1], scheme);
        at_row(&run);
    }
}

/// State of the time integration of a set of unknowns. In a hold (constant or linear force), a
/// branch's displacement field is its field at the start times a scalar decay, plus scalar gains
/// times `field_per_n`. The fields are therefore updated only at switches.
struct TimeRun<'a> {
    law: &'a CreepCompliance,
    branches: Vec<Branch>,
    /// Field of each branch at the start of the hold, in m.
    fields: Vec<Vec<f64>>,
    /// Displacement of every unknown for 1 N, at unit Young's modulus, in 1/m.
    field_per_n: &'a [f64],
    /// Force at the start of the hold, in N.
    force_n: f64,
    /// Slope of the force in the hold, in N/s.
    slope_n_per_s: f64,
    /// Time since the start of the hold, in s.
    since_s: f64,
}

/// Decay factor and gains of one branch of the law since the start of the hold.
#[derive(Clone, Copy)]
struct Branch {
    decay: f64,
    gain_per_pa: f64,
    /// Gain for the slope of a force that changes linearly, in s/Pa.
    ramp_s_per_pa: f64,
}

const UNMOVED: Branch = Branch { decay: 1.0, gain_per_pa: 0.0, ramp_s_per_pa: 0.0 };

impl Branch {
    /// Contribution of a force and its slope to the branch's displacement since the start of the
    /// hold.
    fn moved(self, force: f64, slope_per_s: f64) -> f64 {
        self.gain_per_pa * force + self.ramp_s_per_pa * slope_per_s
    }
}

impl<'a> TimeRun<'a> {
    fn new(law: &'a CreepCompliance, field_per_n: &'a [f64]) -> Self {
        // Each Kelvin–Voigt body is a branch. The last branch holds the dashpots.
        let n_branches = law.retarded.len() + 1;
        Self {
            law,
            branches: vec![UNMOVED; n_branches],
            fields: vec![vec![0.0; field_per_n.len()]; n_branches],
            field_per_n,
            force_n: 0.0,
            slope_n_per_s: 0.0,
            since_s: 0.0,
        }
    }

    fn begin_hold(&mut self, force_n: f64, slope_n_per_s: f64) {
        for (field, branch) in self.fields.iter_mut().zip(&mut self.branches) {
            let gain = branch.moved(self.force_n, self.slope_n_per_s);
            for (value, w) in field.iter_mut().zip(self.field_per_n) {
                *value = branch.decay * *value + gain * w;
            }
            *branch = UNMOVED;
        }
        (self.force_n, self.slope_n_per_s, self.since_s) = (force_n, slope_n_per_s, 0.0);
    }

    fn advance(&mut self, step_s: f64, scheme: TimeScheme) {
        let (dashpots, bodies) = match self.branches.split_last_mut() {
            Some(split) => split,
            None => return,
        };
        for (branch, mode) in bodies.iter_mut().zip(&self.law.retarded) {
            let decay = scheme.decay(step_s, mode.time_s);
            let kept = mode.compliance_per_pa * (1.0 - decay);
            branch.decay *= decay;
            branch.gain_per_pa = decay * branch.gain_per_pa + kept;
            // The response to a linear force lags behind it by the retardation time.
            let late_s = mode.compliance_per_pa * step_s - kept * mode.time_s;
            branch.ramp_s_per_pa = decay * branch.ramp_s_per_pa + kept * self.since_s + late_s;
        }
        let flow_per_pa = self.law.fluidity_per_pa_s * step_s;
        dashpots.gain_per_pa += flow_per_pa;
        dashpots.ramp_s_per_pa += flow_per_pa * (self.since_s + 0.5 * step_s);
        self.since_s += step_s;
    }

    fn displacement_at(&self, unknown: usize) -> f64 {
        let per_n = self.field_per_n[unknown];
        let (w, rise) = (self.force_n * per_n, self.slope_n_per_s * per_n);
        let branches = self.fields.iter().zip(&self.branches);
        let creep: f64 = branches.map(|(field, b)| b.decay * field[unknown] + b.moved(w, rise)).sum();
        creep + self.law.instantaneous_per_pa * (w + rise * self.since_s)
    }
}
