//! What large displacements would do to a posterior of small strains: one run of the gel as the fluid that its law linearises (physics §7.6).
//!
//! The law's small strains do not say what it does at large ones. So this is an estimate of what is at stake, not a correction: it is said beside the posterior and changes nothing in it.

use nalgebra::{DMatrix, DVector};

use crate::documents::posterior::{LargeDisplacement, ParameterShift, Warning, WarningKind};
use crate::error::Result;
use crate::experiment::{Apparatus, Robot, RobotShape, Vitreous};
use crate::fe::oldroyd::{Fineness, FiniteGel, FiniteLaw, FiniteRun};
use crate::model::Forward;
use crate::report::labels::of_parameter;
use crate::report::number::significant;
use crate::stages::Stages;

use super::full_check::{FullCheck, mean_trajectory};
use super::problem::Problem;
use super::reduced::Reduced;

/// Radii below which nothing is run: what is left out goes with the third power, and is a ten-thousandth of the displacement there.
const LEAST_RADII: f64 = 0.2;
/// Changes of the force up to the last fitted row beyond which nothing is run: each takes a fraction of a second.
const MOST_SWITCHES: usize = 16;
/// Root mean square of the deviation over the noise from which it is warned of.
const WORTH_SAYING: f64 = 0.1;

/// Share of a parameter by which it is moved for derivatives.
const SMALL_SHARE: f64 = 1e-4;
/// Share of a parameter below which a shift is left out of the sentence.
const LEAST_SHIFT: f64 = 1e-3;

/// What a gel of large strains with the posterior's mean law would do in this record; `None` where the model is more than a law around a sphere at the centre, the law is no sum of exponentials, the robot hardly
/// moves, or its force changes too often for a run in passing.
///
/// # Errors
/// Never where the run fails: the deviation is `None` then, and how far the robot comes says why.
pub fn estimate(problem: &Problem, reduced: &Reduced, check: &FullCheck) -> Result<Option<LargeDisplacement>> {
    let Some((radius_m, outer_radius_m)) = sphere(&problem.experiment.apparatus) else { return Ok(None) };
    let model = &problem.model;
    if !model.is_law_alone() {
        return Ok(None);
    }
    let n_law = model.base().parameters().len();
    let n_draws = check.draws.len().max(1) as f64;
    let mean = |k: usize| check.draws.iter().map(|draw| draw[k]).sum::<f64>() / n_draws;
    let mean: Vec<f64> = (0..model.parameters().len()).map(mean).collect();
    let Some(compliance) = model.base().creep_compliance(&mean[..n_law]) else { return Ok(None) };
    let record = &problem.experiment.record;
    let fitted = problem.positions_of(&problem.experiment.calibration_cycles);
    let n_rows = fitted.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
    let mean_m = mean_trajectory(&check.trajectories_m, None);
    let farthest_m = mean_m[..n_rows].iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let n_switches = record.force_n[..n_rows].windows(2).filter(|pair| pair[0] != pair[1]).count();
    if farthest_m < LEAST_RADII * radius_m || n_switches >= MOST_SWITCHES {
        return Ok(None);
    }
    let mut found = LargeDisplacement {
        farthest_radii: farthest_m / radius_m,
        deviation_rms_um: None,
        deviation_most_um: None,
        shifts: Vec::new(),
    };
    let gel = FiniteGel::around_sphere(radius_m, outer_radius_m, Fineness::ESTIMATE)?;
    let (law, load) = (FiniteLaw::new(&compliance, 0.0), Stages::of_law(Vec::new()).load);
    let what =
        FiniteRun { law: &law, load: &load, time_s: &record.time_s[..n_rows], force: record.force().first(n_rows) };
    let Ok(run) = gel.run(&what) else { return Ok(Some(found)) };
    let is_fitted: Vec<usize> = (0..n_rows).filter(|row| fitted[*row].is_some()).collect();
    let squares: f64 = is_fitted.iter().map(|row| run.deviation_m[*row].powi(2)).sum();
    found.deviation_rms_um = Some(1e6 * (squares / is_fitted.len().max(1) as f64).sqrt());
    found.deviation_most_um = Some(1e6 * run.deviation_m.iter().fold(0.0_f64, |most, x| most.max(x.abs())));
    if problem.specification.noise == ["white"] {
        found.shifts = shifts(problem, reduced, &mean, n_law, &run.deviation_m, &is_fitted)?;
    }
    Ok(Some(found))
}

/// By how much the deviation moves the law's parameters, to first order: least squares of the deviation by the linear model's derivatives, (AᵀA)⁻¹Aᵀd. White noise of one size weighs all rows alike, and
/// where displacements are large the prior has next to no weight.
fn shifts(
    problem: &Problem,
    reduced: &Reduced,
    mean: &[f64],
    n_law: usize,
    deviation_m: &[f64],
    rows: &[usize],
) -> Result<Vec<ParameterShift>> {
    let forward = problem.reduced_forward(reduced);
    let moved = |k: usize, share: f64| {
        let mut moved = mean.to_vec();
        moved[k] *= 1.0 + share;
        forward.trajectory_m(&moved)
    };
    let names: Vec<&str> = problem.model.base().parameters().iter().map(|spec| spec.name).collect();
    let is_free = |k: &usize| problem.priors.names().any(|name| name == names[*k]);
    let free: Vec<usize> = (0..n_law).filter(is_free).collect();
    // Derivatives by the logarithms.
    let mut columns = Vec::with_capacity(free.len());
    for &k in &free {
        let (up, down) = (moved(k, SMALL_SHARE)?, moved(k, -SMALL_SHARE)?);
        columns.push(rows.iter().map(|row| (up[*row] - down[*row]) / (2.0 * SMALL_SHARE)).collect::<Vec<f64>>());
    }
    let a = DMatrix::from_fn(rows.len(), free.len(), |row, k| columns[k][row]);
    let d = DVector::from_iterator(rows.len(), rows.iter().map(|row| deviation_m[*row]));
    let Ok(found) = a.svd(true, true).solve(&d, 1e-12) else { return Ok(Vec::new()) };
    let shift = |(k, relative): (&usize, &f64)| ParameterShift { name: names[*k].into(), relative: *relative };
    Ok(free.iter().zip(found.iter()).map(shift).collect())
}

fn sphere(apparatus: &Apparatus) -> Option<(f64, f64)> {
    let Apparatus::Robot { robot: Robot { shape, offset: None, .. }, vitreous: Vitreous { diameter_m: outer_m, .. } } =
        apparatus
    else {
        return None;
    };
    match shape {
        RobotShape::Sphere { diameter_m } => Some((0.5 * diameter_m, 0.5 * outer_m)),
        _ => None,
    }
}

/// What is said of it beside a noise (µm), if it is worth saying.
pub fn warning(found: &LargeDisplacement, noise_um: Option<f64>) -> Option<Warning> {
    let digits = |x: f64| significant(x, 2);
    let kind = WarningKind::LargeDisplacement;
    let advice = "read the law's parameters as effective values at this amplitude, or repeat with a smaller force; other gels with the same small strains (Giesekus's) deviate otherwise, so this is what is at stake and no correction".into();
    let radii = digits(found.farthest_radii);
    let (Some(rms_um), Some(most_um)) = (found.deviation_rms_um, found.deviation_most_um) else {
        let text = format!("the robot moves by {radii} of its radii, farther than large displacements can be computed");
        return Some(Warning { kind, text, advice });
    };
    if noise_um.is_some_and(|noise_um| rms_um < WORTH_SAYING * noise_um) {
        return None;
    }
    let over = noise_um.map_or(String::new(), |noise_um| format!(", {} × the noise", digits(rms_um / noise_um)));
    let mut text = format!(
        "the robot moves by {radii} of its radii: in a gel of this law whose strains may be large (Oldroyd-B) it deviates from the linear model by {} µm at most and {} µm in the root mean square{over}",
        digits(most_um),
        digits(rms_um)
    );
    let shift = |shift: &ParameterShift| {
        let label = of_parameter(&shift.name);
        let side = if shift.relative > 0.0 { "above" } else { "below" };
        format!("{} {} % {side}", label.symbol, digits(100.0 * shift.relative.abs()))
    };
    let worth = found.shifts.iter().filter(|shift| shift.relative.abs() >= LEAST_SHIFT);
    let shifts: Vec<String> = worth.map(shift).collect();
    if !shifts.is_empty() {
        text += &format!("; a fit that leaves this out finds {} the gel's own", shifts.join(", "));
    }
    Some(Warning { kind, text, advice })
}
