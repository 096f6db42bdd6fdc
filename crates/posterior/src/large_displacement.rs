//! What large displacements would do to a posterior of small strains: one run of the gel as the fluid that its law linearises (physics §7.6).
//!
//! The law's small strains do not say what it does at large ones. So this is an estimate of what is at stake, not a correction: it is said beside the posterior and changes nothing in it.

use nalgebra::{DMatrix, DVector};

use base::error::Result;
use base::number::Dual;
use documents::posterior::{
    LargeDisplacement, ParameterShift, ParameterSummary, PosteriorSummary, Warning, WarningKind,
};
use elements::fe::oldroyd::{Fineness, FiniteGel, FiniteLaw, FiniteRun};
use figures::labels::of_parameter;
use figures::number::significant;
use laws::stages::Stages;
use models::effects::{AMPLITUDE, MOBILITY};
use models::surrogate::trajectory::MOST_MOBILITY;
use record::{Apparatus, Robot, RobotShape, Vitreous};
use sampling::diagnostics::DrawColumn;

use super::full_check::{FullCheck, mean_trajectory, rmse_m};
use super::learnt_displacement::{MOST_SWITCHES, n_switches};
use super::problem::Problem;

/// Radii below which nothing is run: what is left out goes with the third power, and is a ten-thousandth of the displacement there.
pub const LEAST_RADII: f64 = 0.2;
/// Root mean square of the deviation over the noise from which it is warned of.
const WORTH_SAYING: f64 = 0.1;
/// Share of a parameter's mean that its standard deviation may be for a shift of first order to mean something.
const WELL_KNOWN: f64 = 0.1;
/// A mobility whose 95 % quantile is beyond this share of the largest that is learnt lies at its end.
const NEARLY: f64 = 0.9;

/// What a gel of large strains with the posterior's mean law would do in this record; `None` where the model is more than a law around a sphere at the centre, the law is no sum of exponentials, the robot hardly
/// moves, or its force changes too often for a run in passing.
///
/// # Errors
/// Where no mesh fits. A run that fails is none: the deviation is `None` then.
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
    let gel = FiniteGel::around_sphere(radius_m, outer_radius_m, Fineness::ESTIMATE)?;
    let load = Stages::of_law(Vec::new()).load;
    let what =
        FiniteRun { law: &law, load: &load, time_s: &record.time_s[..n_rows], force: record.force().first(n_rows) };
    let Ok(run) = gel.run(&what) else { return Ok(Some(found)) };
    let nothing: Vec<Option<f64>> = fitted[..n_rows].iter().map(|position| position.map(|_| 0.0)).collect();
    found.deviation_rms_um = Some(1e6 * rmse_m(&run.deviation_m, &nothing));
    found.deviation_most_um = Some(1e6 * run.deviation_m.iter().fold(0.0_f64, |most, x| most.max(x.abs())));
    if problem.specification.noise == ["white"] {
        found.shifts = shifts(problem, columns, check, &run.deviation_m, &nothing);
    }
    Ok(Some(found))
}

/// By how much the deviation d moves the law's parameters, to first order: C Aᵀd/σ², with the posterior's covariance C, the linear model's derivatives A, and white noise σ. Aᵀd is the slope of x·d by the
/// parameters, found by least squares over the draws that were run in full. Parameters that the data leave open are left out.
fn shifts(
    problem: &Problem,
    columns: &[DrawColumn],
    check: &FullCheck,
    deviation_m: &[f64],
    fitted: &[Option<f64>],
) -> Vec<ParameterShift> {
    let names: Vec<&str> = problem.model.base().parameters().iter().map(|spec| spec.name).collect();
    // Places among the law's parameters, and among those that are free.
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
    // In standard deviations from the mean, beside a constant.
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

/// What is said of them beside a posterior: what they would do to it, what a fitted amplitude says, and a mobility at the end of what is learnt.
pub fn warnings(summary: &PosteriorSummary) -> Vec<Warning> {
    let large = summary.large_displacement.as_ref();
    let large = large.and_then(|large| warning(large, summary.heldout.noise_um));
    let amplitude = summary.parameters.iter().find(|parameter| parameter.name == AMPLITUDE);
    let mobility = summary.parameters.iter().find(|parameter| parameter.name == MOBILITY);
    let is_of_geometry = |found: &ParameterSummary| (found.q05..=found.q95).contains(&1.0);
    let interpreted = amplitude.map(|found| Warning {
        kind: if is_of_geometry(found) { WarningKind::LargeDisplacementFitted } else { WarningKind::LargeDisplacement },
        text: interpretation([found.mean, found.q05, found.q95], mobility.is_some()),
        advice: "read E, c₁ and c₂ as the gel's own where the amplitude is 1, and as effective values elsewhere".into(),
    });
    let at_end = mobility.is_some_and(|mobility| mobility.q95 > NEARLY * MOST_MOBILITY);
    let at_end = at_end.then(|| Warning {
        kind: WarningKind::EdgeOfRange,
        text: format!("the mobility of large displacements lies at the end of what is learnt, {MOST_MOBILITY}: its interval and those of the others are cut off"),
        advice: format!("hold it at larger values (--set {MOBILITY}=0.05), and compare the errors"),
    });
    large.into_iter().chain(interpreted).chain(at_end).collect()
}

/// What is said of it beside a noise (µm), if it is worth saying.
fn warning(found: &LargeDisplacement, noise_um: Option<f64>) -> Option<Warning> {
    let digits = |x: f64| significant(x, 2);
    let kind = WarningKind::LargeDisplacement;
    let advice = "read the law's parameters as effective values at this amplitude, or repeat with a smaller force; other gels with the same small strains (Giesekus's, or one whose volume gives) deviate otherwise, so this is what is at stake and no correction".into();
    let radii = digits(found.farthest_radii);
    let (Some(rms_um), Some(most_um)) = (found.deviation_rms_um, found.deviation_most_um) else {
        let text = format!(
            "the robot moves by {radii} of its radii; what large displacements make of it could not be computed"
        );
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
    let worth = found.shifts.iter().filter(|shift| shift.standard_deviations.abs() >= 1.0);
    let shifts: Vec<String> = worth.map(shift).collect();
    if !shifts.is_empty() {
        text += &format!("; a fit that leaves this out finds {} the gel's own", shifts.join(", "));
    }
    Some(Warning { kind, text, advice })
}

/// What a fitted amplitude says: with 1 the geometry as it is, in an Oldroyd-B fluid or in one whose mobility was fitted, too.
pub fn interpretation([mean, q05, q95]: [f64; 3], has_mobility: bool) -> String {
    let digits = |x: f64| significant(x, 3);
    let found = format!(
        "the amplitude of large displacements is {} ({} to {} at 90 %)",
        digits(mean),
        digits(q05),
        digits(q95)
    );
    if has_mobility {
        let verdict =
            if (q05..=q95).contains(&1.0) { "" } else { "; this is not, so yet another gel or effect is at work" };
        return format!("{found}, and 1 is the geometry as it is in a Giesekus fluid of the fitted mobility{verdict}");
    }
    if (q05..=q95).contains(&1.0) {
        return format!(
            "{found}: 1 is the geometry as it is, in a gel whose strains may be large as an Oldroyd-B fluid's; other gels with the same small strains (Giesekus's) deviate otherwise"
        );
    }
    format!(
        "{found}, and 1 is the geometry as it is in an Oldroyd-B fluid: the geometry of that fluid alone does not explain it, so another gel of the same small strains or another effect is at work; `extend --with large-displacement --set {MOBILITY}=free` tries Giesekus's"
    )
}
