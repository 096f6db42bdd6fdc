//! Runs whose steps do not end at rows. The positions at rows are interpolated.
//!
//! The excess is the robot's displacement minus that of a linear law. Between two switches it is a
//! smooth function of ξ = ln(1 + t/θ). t is the time since the switch, and θ is proportional to the
//! first step. A polynomial of degree 5 interpolates the excess between the ends of steps. The
//! linear model computes the linear law's displacement separately, at the ends of steps and at
//! rows.

use super::run::{self, RunRecorder};
use super::stage::Balance;
use super::{Bodies, Discretisation, NonlinearOptions, NonlinearResult};
use crate::fe::clock::CLOCK_ROUNDING;
use crate::fe::stepping::Resolution;
use crate::fe::stepping::run::strains;
use base::error::{Error, Result};
use laws::stages::{Spatial, Stages};
use record::Force;
use std::collections::BTreeMap;

/// Number of step ends through which one polynomial passes.
const N_NODES: usize = 6;

/// Runs a nonlinear law through a record, with steps that do not end at rows. Returns the
/// recorded position (m) at every row, and all unknowns (m) at the rows with the indices
/// `rows`.
///
/// The positions are those of the linear law on a mesh of the given compliance (m per N of force on
/// the robot, at unit Young's modulus), plus the difference between the two laws on this mesh.
///
/// # Errors
/// Those of [`super::NonlinearModel::run`], and [`Error::Numerical`] for stages without a nonlinear law or with
/// softening.
pub fn run_stages(
    on: &dyn Discretisation,
    stages: &Stages,
    (time_s, force): (&[f64], Force<'_>),
    rows: &[usize],
    options: NonlinearOptions,
    compliance_per_m: f64,
) -> Result<NonlinearResult> {
    let Some(Spatial::Nonlinear(nonlinearity)) = stages.spatial else {
        return Err(Error::numerical("the law is linear", "use the linear model"));
    };
    if !stages.softening_rate_per_s.is_constant(0.0) {
        return Err(Error::numerical(
            "softening over time cannot be combined with a nonlinear law",
            "leave out the softening or the nonlinear effect",
        ));
    }
    let bodies = Bodies::<f64>::new(&stages.law, nonlinearity)?;
    let load = stages.load.of::<f64>();
    // A spring in series jumps with the force. If the force also depends on the position, the
    // excess jumps. Such a run stops at every row.
    let jumps = bodies.instantaneous_per_pa > 0.0 && load.depends_on_position();
    let wanted = rows.iter().copied().filter(|&row| row < time_s.len());
    let mut stop_rows: Vec<usize> = if jumps { (0..time_s.len()).collect() } else { wanted.collect() };
    stop_rows.extend(time_s.len().checked_sub(1));
    stop_rows.sort_unstable();
    stop_rows.dedup();
    let stops_s: Vec<f64> = stop_rows.iter().map(|&row| time_s[row]).collect();
    let record = RunRecorder { time_s, force, stops_s: &stops_s };
    let (mut fields, mut steps) = (BTreeMap::new(), Vec::new());
    let at_stop = |at: run::RowState| {
        let row = stop_rows[at.row];
        if rows.contains(&row) {
            fields.insert(row, at.displacement.to_vec());
        }
    };
    let at_step = |time_s: f64, x: f64| steps.push((time_s, x));
    let outcome = run::run(Balance(on), &bodies, &stages.load, record, options, at_stop, at_step);
    let cost = outcome.map_err(|error| with_place(error, &steps))?;
    let mut displacement_m = displacements_m(on, stages, (time_s, force), &steps, compliance_per_m)?;
    let start_s = time_s.first().copied().unwrap_or(0.0);
    let observation = stages.observation.of::<f64>();
    for (x, t) in displacement_m.iter_mut().zip(time_s) {
        *x = observation.recorded_m(*x, t - start_s);
    }
    let fields = rows.iter().filter_map(|row| fields.get(row).cloned()).collect();
    Ok(NonlinearResult { displacement_m, fields, cost })
}

/// Appends the largest distance that the robot had moved to an error's text.
fn with_place(error: Error, steps: &[(f64, f64)]) -> Error {
    let farthest_m = steps.iter().fold(0.0_f64, |most, step| most.max(step.1.abs()));
    match error {
        Error::Numerical { what, remedy } => Error::Numerical {
            what: format!("{what}; the robot had moved by at most {farthest_m:.3e} m until then"),
            remedy,
        },
        other => other,
    }
}

/// Interpolates the displacement (m) at the rows from `steps`: time (s) and displacement (m) at the
/// ends of steps.
fn displacements_m(
    on: &dyn Discretisation,
    stages: &Stages,
    (time_s, force): (&[f64], Force<'_>),
    steps: &[(f64, f64)],
    compliance_per_m: f64,
) -> Result<Vec<f64>> {
    let own_per_m = on.share() * on.unit_compliance_per_m();
    let mut union_s: Vec<f64> = time_s.iter().copied().chain(steps.iter().map(|step| step.0)).collect();
    union_s.sort_by(f64::total_cmp);
    union_s.dedup();
    let commands_n: Vec<f64> = union_s.iter().map(|&t| force.at_n(time_s, t)).collect();
    let commands = Force { at_rows_n: &commands_n, rule: force.rule };
    let linear = Stages { spatial: None, spread: None, ..stages.clone() };
    let linear_m = |compliance_per_m: f64| -> Result<Vec<f64>> {
        let strains = strains(compliance_per_m, &linear, &union_s, commands, Resolution::default())?;
        Ok(strains.into_iter().map(|q| compliance_per_m * q).collect())
    };
    let own_m = linear_m(own_per_m)?;
    let of_mesh_m = linear_m(compliance_per_m)?;
    let at = |positions_m: &[f64], t: f64| positions_m.get(union_s.partition_point(|&u| u < t)).copied().unwrap_or(0.0);
    let length_s = time_s.last().zip(time_s.first()).map_or(0.0, |(last, first)| last - first);
    let rounding_s = CLOCK_ROUNDING * length_s;
    // The excess does not jump with the force. At a switch it keeps the value at the end of the
    // step before.
    let excesses: Vec<(f64, f64)> = steps.iter().map(|&(t, x)| (t, x - at(&own_m, t))).collect();
    let begins_s: Vec<f64> =
        stages.load.of::<f64>().switches(time_s, force).iter().map(|switch| switch.time_s).collect();
    let mut found = Vec::with_capacity(time_s.len());
    for &row_s in time_s {
        let holds = begins_s.partition_point(|&begin_s| begin_s < row_s - rounding_s);
        let Some(&begin_s) = holds.checked_sub(1).and_then(|hold| begins_s.get(hold)) else {
            found.push(0.0);
            continue;
        };
        let end_s = begins_s[holds..].iter().copied().find(|&t| t > begin_s + rounding_s).unwrap_or(f64::INFINITY);
        let from = excesses.partition_point(|step| step.0 <= begin_s + rounding_s);
        let to = excesses.partition_point(|step| step.0 <= end_s + rounding_s);
        let before = from.checked_sub(1).map_or(0.0, |last| excesses[last].1);
        let nodes: Vec<(f64, f64)> =
            std::iter::once((begin_s, before)).chain(excesses[from..to].iter().copied()).collect();
        found.push(at(&of_mesh_m, row_s) + interpolated(&nodes, row_s));
    }
    Ok(found)
}

/// Interpolates the excess (m) at `time_s` between `nodes`, pairs of time (s) and excess (m). The
/// interpolant is a polynomial in ln(1 + t/θ) through the nearest nodes, with t the time since the
/// switch and θ a time scale. The first node is at the switch.
fn interpolated(nodes: &[(f64, f64)], time_s: f64) -> f64 {
    let Some(&(begin_s, first)) = nodes.first() else { return 0.0 };
    let Some(&(second_s, _)) = nodes.get(1) else { return first };
    // Steps grow geometrically. The first is about a fifth of the time scale.
    let scale_s = STEPS_IN_SCALE * (second_s - begin_s);
    let place = |t: f64| ((t - begin_s) / scale_s).max(0.0).ln_1p();
    let n = nodes.len().min(N_NODES);
    let next = nodes.partition_point(|node| node.0 < time_s);
    let from = next.saturating_sub(n / 2).min(nodes.len() - n);
    let chosen = &nodes[from..from + n];
    let at = place(time_s);
    let weight = |i: usize| -> f64 {
        let value = place(chosen[i].0);
        let others = chosen.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, node)| place(node.0));
        others.map(|other| (at - other) / (value - other)).product()
    };
    chosen.iter().enumerate().map(|(i, node)| weight(i) * node.1).sum()
}

/// Time scale θ of the interpolation, divided by the length of the first step after a switch.
const STEPS_IN_SCALE: f64 = 5.0;
