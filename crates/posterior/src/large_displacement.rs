//! Estimate of the influence of large displacements on a posterior for small strains. One run simulates the gel as a fluid with large strains whose linearisation is
//! the fitted law (physics §7.6).
//!
//! A law of small strains does not determine the behaviour at large strains. The result is therefore no correction, but an estimate of the possible influence. It does
//! not change the posterior.

use nalgebra::{DMatrix, DVector};

use base::error::Result;
use base::number::Dual;
use documents::posterior::{
    LargeDisplacement, ParameterShift, ParameterSummary, PosteriorSummary, Warning, WarningKind,
};
use elements::fe::oldroyd::{Discretisation, FiniteGel, FiniteInput, FiniteLaw};
use figures::labels::parameter_label;
use figures::number::format_significant;
use laws::stages::Stages;
use models::effects::{AMPLITUDE, MOBILITY};
use models::surrogate::trajectory::MAX_MOBILITY;
use record::{Apparatus, Robot, RobotShape, Vitreous};
use sampling::diagnostics::DrawColumn;

use super::full_check::{FullCheck, mean_trajectory, rmse_m};
use super::learnt_displacement::{MOST_SWITCHES, n_switches};
use super::problem::Problem;

/// Smallest displacement, in bead radii, for which the estimate runs. For smaller displacements, the deviation from small strains is below a ten-thousandth of the
/// displacement.
pub const LEAST_RADII: f64 = 0.2;
/// Smallest root mean square deviation, as a fraction of the noise, that causes a warning.
const LEAST_RELEVANT: f64 = 0.1;
/// Largest relative standard deviation of a parameter for which a first-order shift is meaningful.
const WELL_KNOWN: f64 = 0.1;
/// A mobility lies at the end of its learnt range if its 95 % quantile exceeds this fraction of the largest learnt mobility.
const NEARLY: f64 = 0.9;

/// Estimates the deviation from small strains in this record, for a gel with large strains and the posterior mean of the law. Returns `None` if the robot is no sphere
/// at the centre, the model has effects, or the law is no sum of exponentials. It also returns `None` if the robot hardly moves or the force changes too often.
///
/// # Errors
/// Errors of the mesh. If the run fails, the result is no error: its deviations are `None`.
pub fn estimate(problem: &Problem, columns: &[DrawColumn], check: &FullCheck) -> Result<Option<LargeDisplacement>> {
    let Some((radius_m, outer_radius_m)) = sphere(&problem.experiment.apparatus) else { return Ok(None) };
    let model = &problem.model;
    if !model.is_law_alone() || problem.outside().is_some() {
        return Ok(None);
    }
    let n_law = model.base().parameters().len();
    let n_draws = check.draws.len().max(1) as f64;
    let mean = |k: usize| check.draws.iter().map(|draw| draw[k]).sum::<f64>() / n_draws;
    let mean: Vec<f64> = (0..model.parameters().len()).map(mean).collect();
    let elements = model.base().elements(&mean[..n_law].iter().copied().map(Dual::constant).collect::<Vec<Dual>>());
    let Some(law) = FiniteLaw::new(&elements, 0.0) else { return Ok(None) };
    let record = &problem.experiment.record;
    let fitted = problem.positions_of(&problem.experiment.calibration_cycles);
    let n_rows = fitted.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
    let mean_m = mean_trajectory(&check.trajectories_m, None);
    let farthest_m = mean_m[..n_rows].iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    if farthest_m < LEAST_RADII * radius_m || n_switches(&record.force_n[..n_rows]) > MOST_SWITCHES {
        return Ok(None);
    }
    let mut found = LargeDisplacement {
        farthest_radii: farthest_m / radius_m,
        deviation_rms_um: None,
        deviation_most_um: None,
        shifts: Vec::new(),
    };
    let gel = FiniteGel::around_sphere(radius_m, outer_radius_m, Discretisation::ESTIMATE)?;
    let load = Stages::of_law(Vec::new()).load;
    let what =
        FiniteInput { law: &law, load: &load, time_s: &record.time_s[..n_rows], force: record.force().first(n_rows) };
    let Ok(run) = gel.run(&what) else { return Ok(Some(found)) };
    let nothing: Vec<Option<f64>> = fitted[..n_rows].iter().map(|position| position.map(|_| 0.0)).collect();
    found.deviation_rms_um = Some(1e6 * rmse_m(&run.deviation_m, &nothing));
    found.deviation_most_um = Some(1e6 * run.deviation_m.iter().fold(0.0_f64, |most, x| most.max(x.abs())));
    if problem.specification.noise == ["white"] {
        found.shifts = shifts(problem, columns, check, &run.deviation_m, &nothing);
    }
    Ok(Some(found))
}

/// First-order shifts C Aᵀd/σ² of the law's parameters due to the deviation d (m at every row). C is the posterior covariance, A the derivative of the positions x by
/// the parameters, and σ the white noise. Aᵀd is the derivative of x·d by the parameters, from least squares over the draws that were run in full. Poorly determined
/// parameters are left out.
fn shifts(
    problem: &Problem,
    columns: &[DrawColumn],
    check: &FullCheck,
    deviation_m: &[f64],
    fitted: &[Option<f64>],
) -> Vec<ParameterShift> {
    let names: Vec<&str> = problem.model.base().parameters().iter().map(|spec| spec.name).collect();
    // Each pair belongs to a free law parameter: its index among the law's parameters, and its index among the priors.
    let place = |(k, name): (usize, &&str)| Some((k, problem.priors.names().position(|other| other == *name)?));
    let free: Vec<(usize, usize)> = names.iter().enumerate().filter_map(place).collect();
    let n_draws = columns[0].values.len() as f64;
    let mean_of = |column: &DrawColumn| column.values.iter().sum::<f64>() / n_draws;
    let means: Vec<f64> = free.iter().map(|(_, column)| mean_of(&columns[*column])).collect();
    let covariance = DMatrix::from_fn(free.len(), free.len(), |a, b| {
        let (of_a, of_b) = (&columns[free[a].1].values, &columns[free[b].1].values);
        of_a.iter().zip(of_b).map(|(x, y)| (x - means[a]) * (y - means[b])).sum::<f64>() / n_draws
    });
    let sd = |a: usize| covariance[(a, a)].sqrt();
    let rows: Vec<usize> = (0..fitted.len()).filter(|row| fitted[*row].is_some()).collect();
    let variance_m2 = |sd_m: &Vec<f64>| rows.iter().map(|row| sd_m[*row].powi(2)).sum::<f64>() / rows.len() as f64;
    let n_checked = check.draws.len();
    let variance_m2 = check.noise.sd_m.iter().map(variance_m2).sum::<f64>() / n_checked as f64;
    let overlap = |x: &Vec<f64>| rows.iter().map(|row| x[*row] * deviation_m[*row]).sum::<f64>() / variance_m2;
    let overlaps = DVector::from_iterator(n_checked, check.trajectories_m.iter().map(overlap));
    // The first column of the design matrix is constant. Each other column is a parameter's distance from its mean, in standard deviations.
    let design = DMatrix::from_fn(n_checked, free.len() + 1, |draw, a| match a.checked_sub(1) {
        None => 1.0,
        Some(a) => (check.draws[draw][free[a].0] - means[a]) / sd(a),
    });
    let Ok(slopes) = design.svd(true, true).solve(&overlaps, 1e-9) else { return Vec::new() };
    let slopes = DVector::from_fn(free.len(), |a, _| slopes[a + 1] / sd(a));
    let moved = covariance.clone() * slopes;
    let shift = |a: usize| ParameterShift {
        name: names[free[a].0].into(),
        relative: moved[a] / means[a],
        standard_deviations: moved[a] / sd(a),
    };
    (0..free.len()).filter(|a| sd(*a) < WELL_KNOWN * means[*a]).map(shift).collect()
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

/// Warnings about large displacements in a posterior: their influence, the interpretation of a fitted amplitude, and a mobility at the end of its learnt range.
pub fn warnings(summary: &PosteriorSummary) -> Vec<Warning> {
    let large = summary.large_displacement.as_ref();
    let large = large.and_then(|large| warning(large, summary.heldout.noise_um));
    let amplitude = summary.parameters.iter().find(|parameter| parameter.name == AMPLITUDE);
    let mobility = summary.parameters.iter().find(|parameter| parameter.name == MOBILITY);
    let is_of_geometry = |found: &ParameterSummary| (found.q05..=found.q95).contains(&1.0);
    let interpreted = amplitude.map(|found| Warning {
        kind: if is_of_geometry(found) { WarningKind::LargeDisplacementFitted } else { WarningKind::LargeDisplacement },
        text: interpretation([found.mean, found.q05, found.q95], mobility.is_some()),
        advice: "read E, c₁ and c₂ as the gel's properties if the amplitude is 1, otherwise as effective values".into(),
    });
    let at_end = mobility.is_some_and(|mobility| mobility.q95 > NEARLY * MAX_MOBILITY);
    let at_end = at_end.then(|| Warning {
        kind: WarningKind::EdgeOfRange,
        text: format!("the mobility of large displacements lies at the end of the learnt range, {MAX_MOBILITY}: this cuts off its interval and those of the other parameters"),
        advice: format!("fix the mobility at larger values (--set {MOBILITY}=0.05), and compare the errors"),
    });
    large.into_iter().chain(interpreted).chain(at_end).collect()
}

/// Warning about the estimated deviation; `None` if it is small relative to the noise (µm).
fn warning(found: &LargeDisplacement, noise_um: Option<f64>) -> Option<Warning> {
    let digits = |x: f64| format_significant(x, 2);
    let kind = WarningKind::LargeDisplacement;
    let advice = "read the law's parameters as effective values at this amplitude, or repeat with a smaller force. This is an estimate and no correction: other gels \
        with the same small strains (Giesekus's, or a compressible one) deviate differently".into();
    let radii = digits(found.farthest_radii);
    let (Some(rms_um), Some(most_um)) = (found.deviation_rms_um, found.deviation_most_um) else {
        let text =
            format!("the robot moves by {radii} of its radii; the effect of large displacements could not be computed");
        return Some(Warning { kind, text, advice });
    };
    if noise_um.is_some_and(|noise_um| rms_um < LEAST_RELEVANT * noise_um) {
        return None;
    }
    let over = noise_um.map_or(String::new(), |noise_um| format!(", {} × the noise", digits(rms_um / noise_um)));
    let mut text = format!(
        "the robot moves by {radii} of its radii: in a gel of this law with large strains (Oldroyd-B) it deviates from the linear model by at most {} µm, and \
         by {} µm in the root mean square{over}",
        digits(most_um),
        digits(rms_um)
    );
    let shift = |shift: &ParameterShift| {
        let label = parameter_label(&shift.name);
        let side = if shift.relative > 0.0 { "above" } else { "below" };
        format!("{} {} % {side}", label.symbol, digits(100.0 * shift.relative.abs()))
    };
    let worth = found.shifts.iter().filter(|shift| shift.standard_deviations.abs() >= 1.0);
    let shifts: Vec<String> = worth.map(shift).collect();
    if !shifts.is_empty() {
        text += &format!("; a fit without this effect finds {} the gel's true value", shifts.join(", "));
    }
    Some(Warning { kind, text, advice })
}

/// Interpretation of a fitted amplitude of large displacements. The arguments are its mean and its 5 % and 95 % quantiles. The value 1 means the exact geometry of an
/// Oldroyd-B fluid, or of a Giesekus fluid with the fitted mobility.
pub fn interpretation([mean, q05, q95]: [f64; 3], has_mobility: bool) -> String {
    let digits = |x: f64| format_significant(x, 3);
    let found = format!(
        "the amplitude of large displacements is {} ({} to {} at 90 %)",
        digits(mean),
        digits(q05),
        digits(q95)
    );
    if has_mobility {
        let verdict = if (q05..=q95).contains(&1.0) {
            ""
        } else {
            "; the fitted value is not 1, so another gel or effect is at work"
        };
        return format!(
            "{found}; the value 1 means the exact geometry in a Giesekus fluid of the fitted mobility{verdict}"
        );
    }
    if (q05..=q95).contains(&1.0) {
        return format!(
            "{found}; the value 1 means the exact geometry in a gel with large strains (an Oldroyd-B fluid); other gels with the same small strains (Giesekus's) deviate differently"
        );
    }
    format!(
        "{found}; the value 1 means the exact geometry in an Oldroyd-B fluid: that geometry alone does not explain the value, so another gel with the same small \
         strains or another effect is at work. `extend --with large-displacement --set {MOBILITY}=free` tries Giesekus's"
    )
}
