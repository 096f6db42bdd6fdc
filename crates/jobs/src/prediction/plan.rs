//! `plan`: the force that brings a robot to a target with a given probability.

use std::path::PathBuf;

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{to_json, write_together};
use documents::posterior::{Warning, WarningKind};
use documents::prediction::{EquivalentPlan, ForceStep, Plan};
use figures::number::format_significant;
use figures::svg::figure_files;
use posterior::monitor::Monitor;
use posterior::study::WithProvenance;
use prediction::ensemble::{Ensemble, Gel};
use prediction::plan::{PlannedForce, Target, plan};
use prediction::quantity::{Quantity, percent, plain};
use prediction::scenario::Scenario;
use sampling::SamplerOptions;

use super::gel_source::{GelPlace, GelSource};
use super::predict::{digits, predicted, table};
use super::rivals::Rival;
use crate::outcome::Outcome;

/// Name of the file for the controller.
const PROTOCOL_NAME: &str = "plan-protocol.csv";

/// Settings of a plan.
pub struct PlanRequest {
    /// File whose first scenario names robot and gel; `None` for the study's own.
    pub scenario: Option<PathBuf>,
    /// Target and limits. A largest force of 0 stands for that of the study's record.
    pub target: Target,
    /// Magnetic moment of the robot in A·m²; `None` for no field gradient in the protocol.
    pub moment_a_m2: Option<f64>,
    /// Sampler settings for a first revision.
    pub sampler: SamplerOptions,
}

/// Plans a force, and writes the plan and the controller's file beside the source of the gel.
///
/// # Errors
/// [`Error::Input`] for a target without limits; errors of models and files.
pub fn run(place: &GelPlace<'_>, request: &PlanRequest, monitor: &dyn Monitor) -> Result<Outcome<Plan>> {
    let mut target = request.target;
    let mut scenario = place.scenarios(request.scenario.as_deref())?.remove(0);
    if target.largest_force_n == 0.0 {
        let GelPlace::Study(study) = place else {
            return Err(Error::input(
                InputPlace::setting(Setting::LargestForce),
                "a comparison of groups has no largest force of its own",
                format!("give the actuator's largest force in µN with `{}`", Setting::LargestForce),
            ));
        };
        target.largest_force_n = study.experiment.scales().largest_force_n;
    }
    scenario.quantities = match target.rest {
        None => vec![Quantity::TimeToReach { distance_m: target.reach_m, within_s: Some(target.within_s) }],
        Some(_) => {
            [target.within_s, target.duration_s()].map(|at_s| Quantity::PositionAt { at_s, at_least_m: None }).to_vec()
        }
    };
    let source = place.open(&scenario, &request.sampler, monitor)?;
    let gel = source.gel();
    let planned = plan(&gel, &scenario, &target, source.kept.clone(), monitor)?;
    let tube = predicted(&gel, &planned.ensemble, &scenario, monitor)?;
    let equivalent = equivalent(&source, &scenario, &target, &planned, monitor)?;
    let mut warnings = source.warnings.clone();
    warnings.extend(equivalent.iter().filter(|other| other.probability < target.probability).map(|other| Warning {
        kind: WarningKind::ModelIncomplete,
        text: format!(
            "with {}, which the record cannot distinguish from the model's own effect, this force succeeds with {} % probability",
            other.effect,
            percent(other.probability)
        ),
        advice: "record the experiment that tells the effects apart (`vitreo-uq design`), or plan for a higher probability".into(),
    }));
    let checked = planned.checked;
    let found = Plan {
        gel: gel.draws.source.clone(),
        apparatus: scenario.apparatus(),
        reach_mm: 1e3 * target.reach_m,
        within_s: target.within_s,
        probability: target.probability,
        feasible: planned.is_feasible,
        probability_promised: planned.promised,
        probability_checked: checked,
        probability_checked_se: (checked * (1.0 - checked) / planned.full_runs.max(1) as f64).sqrt(),
        full_runs: planned.full_runs,
        limit: planned.limit.into(),
        sentence: sentence(&planned, &target),
        force: planned.steps,
        tube,
        protocol_file: source.dir.join(PROTOCOL_NAME).display().to_string(),
        equivalent,
        warnings,
    };
    monitor.stage("writing results and figures");
    let figure = figures::prediction::prediction(
        "Planned force and expected position",
        &found.sentence,
        std::slice::from_ref(&found.tube),
        Some(1e6 * target.reach_m),
    )?;
    let seed = request.sampler.seed;
    let document = WithProvenance { provenance: source.provenance("plan", seed), body: found };
    let json = source.dir.join("plan.json");
    let json = (json.clone(), to_json(&json, &document)?);
    let protocol = protocol(&document.body.force, target.duration_s(), request.moment_a_m2);
    let protocol = (source.dir.join(PROTOCOL_NAME), protocol.into_bytes());
    let tube = (source.dir.join("plan-tube.csv"), table(std::slice::from_ref(&document.body.tube)));
    let [svg, png, pdf] = figure_files(&source.dir, "plan", &figure)?;
    write_together(
        &[&svg, &png, &pdf, &protocol, &tube, &json].map(|(path, bytes)| (path.as_path(), bytes.as_slice())),
    )?;
    Ok(Outcome { is_sound: document.body.is_sound(), document, written: svg.0, study: source.study.clone() })
}

/// Probability of success of the planned force with each equivalent effect.
fn equivalent(
    source: &GelSource,
    scenario: &Scenario,
    target: &Target,
    planned: &PlannedForce,
    monitor: &dyn Monitor,
) -> Result<Vec<EquivalentPlan>> {
    let of_rival = |rival: &Rival| {
        let gel = Gel { problem: &rival.problem, draws: rival.draws.clone(), is_taught: true, seed: source.seed };
        let record = planned.ensemble.record().clone();
        let ensemble = Ensemble::new(&gel, scenario, record, source.kept.clone(), monitor)?;
        Ok(EquivalentPlan { effect: rival.effect.clone(), probability: target.probability_under(&ensemble)? })
    };
    source.rivals.iter().map(of_rival).collect()
}

fn sentence(planned: &PlannedForce, target: &Target) -> String {
    let largest_un = planned
        .steps
        .iter()
        .map(|step| step.force_un)
        .fold(0.0_f64, |most, force| if force.abs() > most.abs() { force } else { most });
    let goal = format!("{} mm within {} s", plain(1e3 * target.reach_m), plain(target.within_s));
    let rest = target.rest.map_or(String::new(), |rest| {
        format!(" and rests there within ± {} µm for {} s", plain(1e6 * rest.within_m), plain(rest.for_s))
    });
    let checked =
        format!("{} % of {} unused draws by full finite elements", percent(planned.checked), planned.full_runs);
    let force = format!("{} µN", format_significant(largest_un, 4));
    if planned.is_feasible {
        let kind = match (target.rest, target.slew_n_per_s) {
            (Some(_), _) => "A stepwise force of at most",
            (None, Some(_)) => "A force that rises to",
            (None, None) => "A constant force of",
        };
        return format!(
            "{kind} {force} reaches {goal}{rest} with {} % probability ({checked}).",
            percent(planned.promised)
        );
    }
    format!(
        "No force within the limits reaches {goal}{rest} with {} % probability: the highest found is {} % at {force} ({checked}). The limit that binds is the {}.",
        percent(target.probability),
        percent(planned.promised),
        planned.limit
    )
}

/// Table for the controller: each force holds until the next row; the last row ends the protocol.
fn protocol(steps: &[ForceStep], end_s: f64, moment_a_m2: Option<f64>) -> String {
    let last = steps.last().map(|step| ForceStep { time_s: end_s, force_un: step.force_un });
    let column = if moment_a_m2.is_some() { ",gradient_t_per_m" } else { "" };
    let mut text = format!("time_s,force_un{column}\n");
    for ForceStep { time_s, force_un } in steps.iter().copied().chain(last) {
        let gradient = moment_a_m2.map_or(String::new(), |moment| format!(",{}", digits(1e-6 * force_un / moment)));
        text += &format!("{},{}{gradient}\n", digits(time_s), digits(force_un));
    }
    text
}
