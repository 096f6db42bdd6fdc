//! `design`: the protocol of the next record.

mod before;
mod decision;
pub(crate) mod files;
mod request;
mod sequence;
mod words;

use std::path::PathBuf;

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{Content, read};
use criticism::criteria::Criteria;
use criticism::detectable::{Detectability, find_smallest_detectable};
use criticism::protocol::design::{DesignedProtocol, Designer, N_REPEATS, separates};
use criticism::protocol::{DesignLimits, DesignedDrive, Sought, SoughtEffect};
use criticism::{Candidate, Fitted, Subject};
use documents::design::{
    Design, DesignedDetection, DesignedParameter, HelplessPair, LaterRecord, ModelStanding, RecommendedProtocol,
};
use documents::posterior::{Warning, WarningKind};
use documents::prediction::{PositionQuantiles, ScenarioPrediction};
use figures::number::format_significant;
use models::effects::Library;
use posterior::monitor::Monitor;
use posterior::problem::Problem;
use posterior::study::{POSTERIOR_NAME, Provenance, Study, WithProvenance};
use record::{Control, Experiment, Record};

pub use self::before::{Unmeasured, run_before_measurement};
use self::decision::AskedQuantity;
use self::files::DesignFiles;
pub use self::request::{DesignGoal, DesignRequest};
use self::request::{free_distance_m, limits};
use self::sequence::{Class, FittedModel, Later, class, judge_later, keep_possible, models, read_later, standings};
use self::words::{BindingLimit, at_the_outer_surface, sentence, stop_sentence, with_detection, with_quantity};
use crate::artefacts;
use crate::first_revision::kept_surrogate;
use crate::outcome::Outcome;
use crate::prediction::study_warnings;
use crate::target::{CreepTarget, Revision, Target};

/// Durations of the front in ascending order, relative to that of the recommended protocol.
const FRONT: [f64; 4] = [0.25, 0.5, 1.0, 2.0];
/// Changes of the limits that are tried if no protocol separates two effects: the limit in words, factor of the force, of the duration, and of the sampling rate.
const CHANGES: [(&str, [f64; 3]); 5] = [
    ("duration", [1.0, 3.0, 1.0]),
    ("sampling rate", [1.0, 1.0, 4.0]),
    ("largest force", [2.0, 1.0, 1.0]),
    ("largest force", [4.0, 1.0, 1.0]),
    ("duration", [1.0, 10.0, 1.0]),
];

/// Share of the displacement limit from which an expected motion reaches it.
const NEAR_LIMIT: f64 = 0.95;
/// Distance over its limit from which a gel counts as leaving it.
const CLEARLY_BEYOND: f64 = 1.1;

/// What is known before the new record.
struct Known {
    /// Directory of the results.
    dir: PathBuf,
    /// Study of the present record; `None` before any record.
    study: Option<Study>,
    /// Name of the revision, or of what takes its place.
    revision: String,
    goal: DesignGoal,
    /// Present records, each prepared for fits.
    subjects: Vec<Subject>,
    /// Models with their fits to all records.
    models: Vec<FittedModel>,
    /// True if the last third of the new record is held out.
    holds_out: bool,
    standings: Vec<ModelStanding>,
    after: Vec<LaterRecord>,
    warnings: Vec<Warning>,
    /// Reason to stop if the records tell the effects apart.
    decided: Option<String>,
    /// Quantity of interest of a decision.
    asked: Option<AskedQuantity>,
    provenance: Provenance,
}

/// Designs the next record of a creep record's specimen, and writes the result into the study.
///
/// # Errors
/// [`Error::Input`] for any target except a creep record under force control; errors of fits and files.
pub fn run(target: &Target, request: &DesignRequest, monitor: &dyn Monitor) -> Result<Outcome<Design>> {
    designed(known(target.creep()?, request, monitor)?, request, monitor)
}

/// What a study's record and later records of the specimen say.
fn known(target: &CreepTarget, request: &DesignRequest, monitor: &dyn Monitor) -> Result<Known> {
    let revision = target.revision(request.sampler.clone(), monitor)?;
    refuse_other_records(&revision.problem.experiment)?;
    let later = read_later(&request.after, &revision.problem.experiment, monitor)?;
    let (mut goal, class) = goal(request, class(&revision)?, &revision, !later.is_empty())?;
    let problem = class.as_ref().map_or(&revision.problem, |class| &class.problem);
    // Expected uncertainties continue those of `sample`, which fits the calibration cycles; a distance of effects uses all rows.
    let holds_out = matches!(goal, DesignGoal::Effects | DesignGoal::Detection);
    let first = first_subject(&revision, class.as_ref(), goal, monitor)?;
    let mut subjects = vec![first.with_cycles(&fitted_cycles(&problem.experiment, holds_out), &[])?];
    for record in &later {
        subjects.push(later_subject(record, &subjects[0], (problem, class.is_some()), holds_out)?);
    }
    monitor.stage("fitting the models");
    let mut models = models(&subjects, class.as_ref())?;
    let standings = if models.len() > 1 { standings(&models) } else { Vec::new() };
    let (after, mut warnings) = judge_later(&subjects, &models[0]);
    // A record that no effect of the class explains decides nothing.
    let is_explained = warnings.is_empty();
    // A class replaces the model of the revision, but not draws that have not converged.
    let of_study = study_warnings(&revision.study.revision_dir(&revision.name)?, &revision.name, false)?;
    let counts = |warning: &Warning| class.is_none() || warning.kind == WarningKind::NotConverged;
    warnings.extend(of_study.into_iter().filter(counts));
    let decided = if class.is_some() && !later.is_empty() && is_explained { keep_possible(&mut models) } else { None };
    if decided.is_some() {
        goal = DesignGoal::Parameters;
    }
    let asked = match goal {
        DesignGoal::Decision => {
            Some(AskedQuantity::new(target, request.scenario.as_deref(), &request.sampler, monitor)?)
        }
        _ => None,
    };
    let posterior = revision.study.revision_dir(&revision.name)?.join(POSTERIOR_NAME);
    let posterior = read(&posterior, Content::Document, "run `vitreo-uq sample` again")?;
    let provenance = revision.study.provenance("design", 1, request.sampler.seed);
    let provenance = artefacts::with_inputs(provenance, &revision.problem)
        .with_input(format!("{}/{POSTERIOR_NAME}", revision.name), &posterior)
        .with_hashes(later.iter().enumerate().flat_map(|(k, later)| later.named_hashes(k + 1)));
    Ok(Known {
        dir: revision.study.dir().into(),
        revision: class.as_ref().map_or(&revision.name, |class| &class.revision).clone(),
        study: Some(revision.study),
        goal,
        subjects,
        models,
        holds_out,
        standings,
        after,
        warnings,
        decided,
        asked,
        provenance,
    })
}

/// Searches the protocol, and writes the result.
fn designed(known: Known, request: &DesignRequest, monitor: &dyn Monitor) -> Result<Outcome<Design>> {
    let Known { dir, study, revision, goal, subjects, models, holds_out, asked, provenance, .. } = known;
    let seed = request.sampler.seed;
    let (subject, first) = (&subjects[0], models[0].first());
    let now_detectable = match goal {
        DesignGoal::Detection => {
            monitor.stage("computing the smallest detectable size of every effect");
            find_smallest_detectable(subject, first, threshold_sigma())?
        }
        _ => Vec::new(),
    };
    let sought = match (goal, &asked) {
        (DesignGoal::Decision, Some(asked)) => Sought::Quantity(asked.derivatives(first)?),
        (DesignGoal::Effects, _) => Sought::Effects,
        (DesignGoal::Detection, _) => Sought::Sizes {
            effects: SoughtEffect::all(subject, first, &now_detectable),
            threshold_sigma: threshold_sigma(),
        },
        _ => Sought::Parameters,
    };
    let members: Vec<(&Candidate, &Fitted)> = models.iter().map(FittedModel::first).collect();
    let designer = Designer::new(subject, &members, sought, &models[0].fit.information)?;
    let farthest_m = first.1.position_m.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let limits = limits(subject.experiment(), farthest_m, request)?;
    let (best, front) = search(&designer, &limits, seed, monitor)?;
    monitor.stage("simulating records of the best protocol");
    let effects: Vec<String> = models.iter().map(FittedModel::name).collect();
    let detectable = match goal {
        DesignGoal::Detection => detections(&now_detectable, &designer.detectable(&best, threshold_sigma())?),
        _ => Vec::new(),
    };
    let quantity = asked.as_ref().map(|asked| asked.designed(first, designer.quantity_sd(&best)?)).transpose()?;
    // The distance of models that share several records is not the one of the first.
    let now = if subjects.len() == 1 { designer.distance_now()? } else { None };
    let files = DesignFiles::new(&dir);
    let recommended = recommended(&designer, &best, &limits, (&effects, now), seed, &files)?;
    let recommended = match &quantity {
        Some(quantity) => {
            let has_tolerances = asked.as_ref().is_some_and(AskedQuantity::has_tolerances);
            RecommendedProtocol { sentence: with_quantity(&best, &limits, quantity, has_tolerances), ..recommended }
        }
        None if goal == DesignGoal::Detection => {
            RecommendedProtocol { sentence: with_detection(&best, &limits, &detectable), ..recommended }
        }
        None => recommended,
    };
    let uncertainties = recommended.parameters.iter().map(|parameter| [parameter.sd_now, parameter.sd_expected]);
    let free_m = free_distance_m(subject.experiment());
    let expected_m = designer.expected_m(&best)?;
    let is_reached = expected_m.iter().any(|x| x.abs() >= NEAR_LIMIT * limits.largest_position_m);
    let binding = match free_m.is_some_and(|free_m| limits.largest_position_m >= free_m) {
        _ if subject.declares_gains() => BindingLimit::Gain,
        true if is_reached => BindingLimit::OuterSurface,
        false if is_reached => BindingLimit::Displacement,
        _ => BindingLimit::Other,
    };
    let stop = known.decided.or_else(|| match (goal, &quantity) {
        (DesignGoal::Parameters, _) => stop_sentence(&limits, uncertainties, binding),
        (_, Some(quantity)) => {
            stop_sentence(&limits, std::iter::once([quantity.sd_now, quantity.sd_expected]), binding)
        }
        _ => None,
    });
    let mut warnings = known.warnings;
    warnings.extend(at_the_outer_surface(request.largest_position_m, free_m, &limits, is_reached));
    warnings.extend(moves_too_far(&designer.farthest_m(&best, seed)?, &limits, free_m));
    let found = Design {
        experiment: subject.experiment().specimen_id.clone(),
        revision,
        goal: goal.name().into(),
        separation_now_sigma: now,
        largest_force_un: 1e6 * limits.largest_force_n,
        largest_displacement_um: 1e6 * limits.largest_position_m,
        interval_s: limits.interval_s,
        protocols_tried: best.n_tried,
        helpless: helpless(&designer, &best, &limits, &effects),
        effects: if effects.len() > 1 { effects } else { Vec::new() },
        front: files.front((&limits, &best), &front),
        recommended,
        quantity,
        detectable,
        after: known.after,
        models: known.standings,
        stop,
        warnings,
    };
    monitor.stage("writing results and figures");
    let figure = figure(&expected_m, subject.reference_noise_m(), &best.record, &found)?;
    let document = WithProvenance { provenance, body: found };
    let written = files.write(&document, &figure, &best, &front, (subject.experiment(), holds_out))?;
    Ok(Outcome { is_sound: document.body.is_sound(), document, written, study })
}

/// Goal of a design, and the class of equivalent effects if the goal is to distinguish them.
fn goal(
    request: &DesignRequest,
    class: Option<Class>,
    revision: &Revision,
    has_later: bool,
) -> Result<(DesignGoal, Option<Class>)> {
    let goal = match (request.goal, &request.scenario, &class) {
        (Some(goal), _, _) => goal,
        (None, Some(_), _) => DesignGoal::Decision,
        (None, None, Some(_)) => DesignGoal::Effects,
        (None, None, None) => DesignGoal::Parameters,
    };
    if (goal == DesignGoal::Decision) != request.scenario.is_some() {
        return Err(Error::input(
            InputPlace::setting(Setting::Scenario),
            "a decision needs a scenario, and other goals have none",
            format!("give `{} FILE.toml` with a quantity for the goal `decision` only", Setting::Scenario),
        ));
    }
    if goal == DesignGoal::Detection && has_later {
        return Err(Error::input(
            InputPlace::setting(Setting::After),
            "the smallest detectable sizes are those of one record",
            format!("leave out `{}`, or choose another goal", Setting::After),
        ));
    }
    if goal == DesignGoal::Effects && class.is_none() {
        return Err(Error::input(
            InputPlace::file(revision.study.dir()),
            "no diagnosis of this study names effects that the record cannot distinguish",
            "run `vitreo-uq diagnose` on the study first, or design for the parameters",
        ));
    }
    Ok((goal, class.filter(|_| goal == DesignGoal::Effects)))
}

/// Subject of the study's own record. A diagnosis learns its noise; an expected posterior has the noise of the revision.
fn first_subject(
    revision: &Revision,
    class: Option<&Class>,
    goal: DesignGoal,
    monitor: &dyn Monitor,
) -> Result<Subject> {
    let kept = kept_surrogate(&revision.study, monitor);
    match class {
        Some(class) => Subject::new(&class.problem, &Library::default(), kept, monitor),
        None if goal == DesignGoal::Detection => {
            Ok(Subject::new(&revision.problem, &Library::default(), kept, monitor)?.with_specified_noise())
        }
        None => Ok(revision.subject(monitor)?.with_specified_noise()),
    }
}

/// Best protocol of the recommended duration, and the best of others in ascending order, each with its limits.
fn search(
    designer: &Designer<'_>,
    limits: &DesignLimits,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<(DesignedProtocol, Vec<(DesignLimits, DesignedProtocol)>)> {
    let mut front: Vec<(DesignLimits, DesignedProtocol)> = Vec::new();
    for factor in FRONT {
        let within = limits.lasting(factor * limits.duration_s);
        monitor.stage(&format!("comparing protocols of {} s", format_significant(within.duration_s, 3)));
        let shorter = front
            .last()
            .map_or(Vec::new(), |(shorter, protocol)| protocol.drive.continued(shorter.duration_s / within.duration_s));
        match designer.search(&within, &shorter, seed, monitor) {
            // A short duration in which no protocol fits is left out.
            Err(Error::Numerical { .. }) if factor < 1.0 => {}
            found => front.push((within, found?)),
        }
    }
    let place = front.iter().position(|(within, _)| within.duration_s == limits.duration_s).unwrap_or(0);
    let (_, best) = front.remove(place);
    Ok((best, front))
}

/// The best protocol for parameters or effects, with its expected information and verdicts. `effects` are the names of the models, with their present distance (σ).
fn recommended(
    designer: &Designer<'_>,
    best: &DesignedProtocol,
    limits: &DesignLimits,
    (effects, now): (&[String], Option<f64>),
    seed: u64,
    files: &DesignFiles,
) -> Result<RecommendedProtocol> {
    let right = best.closest.map(|_| designer.n_right(best, seed)).transpose()?;
    let [information_nats, standard_error] = designer.mean_information(best, seed)?;
    let parameters = parameters(designer.first(), &designer.sd_now()?, &best.sd);
    Ok(RecommendedProtocol {
        protocol_file: files.protocol.display().to_string(),
        record_dir: files.record_dir.display().to_string(),
        protocol: best.drive.described(limits),
        duration_s: limits.duration_s,
        expected_information_nats: information_nats,
        standard_error,
        separation_sigma: best.closest.map(|(distance, _)| distance),
        verdict_right_probability: right.map(|right| right as f64 / N_REPEATS as f64),
        simulated_records: if right.is_some() { N_REPEATS } else { 0 },
        sentence: sentence(best, limits, now, right, effects, &parameters),
        parameters,
    })
}

/// Warning if the robot leaves the limit for many gels that the present knowledge allows. `farthest_m` are the largest distances for draws of the parameters, in ascending order.
/// `free_m` is the distance after which the robot touches the outer surface of the gel.
fn moves_too_far(farthest_m: &[f64], limits: &DesignLimits, free_m: Option<f64>) -> Option<Warning> {
    let beyond =
        farthest_m.iter().filter(|distance_m| **distance_m > CLEARLY_BEYOND * limits.largest_position_m).count();
    let n = farthest_m.len();
    if beyond * 20 <= n {
        return None;
    }
    let um = |metres: f64| format_significant(1e6 * metres, 3);
    let exceeded_m = farthest_m[n - 1 - n / 20];
    let beyond_surface = match free_m.filter(|free_m| exceeded_m > *free_m) {
        Some(free_m) => {
            format!(
                ", beyond the gel's outer surface, which the robot touches after {} µm",
                format_significant(1e6 * free_m, 4)
            )
        }
        None => String::new(),
    };
    Some(Warning {
        kind: WarningKind::Extrapolation,
        text: format!(
            "the limit of {} µm is kept in the middle of what is known. Of {n} gels drawn from what is known, {beyond} exceed it by more than 10 %. One in twenty exceeds {} µm{beyond_surface}",
            um(limits.largest_position_m),
            um(exceeded_m)
        ),
        advice: "lower the limit, or record a short protocol first and design the next one from its posterior".into(),
    })
}

/// Refuses records whose designed protocol this search cannot make.
fn refuse_other_records(experiment: &Experiment) -> Result<()> {
    let refuse = |found: &str, remedy: &str| {
        Err(Error::input(InputPlace::file(&experiment.specimen_id).at_key("kind"), found, remedy))
    };
    if experiment.control == Control::Position {
        return refuse(
            "protocols are designed for a commanded force, and this record commands a position",
            "give a record under a commanded force",
        );
    }
    if experiment.scales().depth_exponent.is_some() {
        return refuse(
            "a tip in contact cannot be pulled, as designed protocols do",
            "give a record of a bead or of an instrument",
        );
    }
    Ok(())
}

/// Subject of a later record, with the rows and the noise terms of the first.
fn later_subject(
    record: &Later,
    first: &Subject,
    (problem, has_learnt_noise): (&Problem, bool),
    holds_out: bool,
) -> Result<Subject> {
    let subject = record.subject(problem, first)?;
    let subject = if has_learnt_noise { subject } else { subject.with_specified_noise() };
    subject.with_cycles(&fitted_cycles(&record.experiment, holds_out), &[])
}

/// Cycles of a record that are fitted: those of `sample`, or all.
fn fitted_cycles(experiment: &Experiment, are_all: bool) -> Vec<u32> {
    let held_out = experiment.heldout_cycles.iter().filter(|_| are_all);
    experiment.calibration_cycles.iter().chain(held_out).copied().collect()
}

/// Distance (σ) from which an effect is detected: a lead of twice the least gain of a diagnosis, and one standard deviation more, so that most records show it.
fn threshold_sigma() -> f64 {
    (2.0 * Criteria::RECORD.least_gain_nats).sqrt() + 1.0
}

/// Effects with their smallest detectable sizes in the present and in the designed record.
fn detections(now: &[Detectability], expected: &[Detectability]) -> Vec<DesignedDetection> {
    let of_effect = |now: &Detectability| {
        let then = expected.iter().find(|then| then.effect == now.effect)?;
        let effect = Library::default().get(&now.effect)?;
        Some(DesignedDetection {
            effect: now.effect.clone(),
            parameter: effect.parameters().first()?.spec.name.into(),
            smallest_now: now.smallest,
            smallest_expected: then.smallest,
        })
    };
    now.iter().filter_map(of_effect).collect()
}

/// Parameters of the first model with their standard deviations now and later, in the parameters' units.
fn parameters((candidate, fitted): (&Candidate, &Fitted), now: &[f64], then: &[f64]) -> Vec<DesignedParameter> {
    let entry = |(k, free): (usize, &criticism::Free)| {
        let unit = free.coordinate.unit(fitted.theta[k]).abs();
        let value = free.coordinate.value(fitted.theta[k]);
        DesignedParameter { name: free.name.into(), value, sd_now: unit * now[k], sd_expected: unit * then[k] }
    };
    candidate.free.iter().enumerate().map(entry).collect()
}

/// Pairs that stay together, each with the change of a limit that would separate them.
fn helpless(
    designer: &Designer<'_>,
    best: &DesignedProtocol,
    limits: &DesignLimits,
    effects: &[String],
) -> Vec<HelplessPair> {
    let Some((distance, other)) = best.closest.filter(|(distance, _)| !separates(*distance)) else { return Vec::new() };
    let with = |[force, duration, rate]: [f64; 3]| DesignLimits {
        largest_force_n: force * limits.largest_force_n,
        duration_s: duration * limits.duration_s,
        interval_s: limits.interval_s / rate,
        ..*limits
    };
    let helps = |drive: &DesignedDrive, factors| designer.distance_within(drive, &with(factors)).is_ok_and(separates);
    let limit = CHANGES.into_iter().find(|(_, factors)| helps(&best.drive, *factors)).map_or_else(
        || format!("none of the tried changes separates them (distance {} σ)", format_significant(distance, 2)),
        |(limit, factors)| {
            let factor = factors.into_iter().fold(1.0, f64::max);
            format!("{limit} × {factor}")
        },
    );
    vec![HelplessPair { pair: [effects[0].clone(), effects[other].clone()], limit }]
}

/// Figure of the recommended force and of the expected position (m at every row), with bands of the noise (m).
fn figure(position_m: &[f64], noise_m: f64, record: &Record, found: &Design) -> Result<figures::svg::Svg> {
    let noise_um = 1e6 * noise_m;
    let shifted = |sd: f64| position_m.iter().map(|x| 1e6 * x + sd * noise_um).collect::<Vec<f64>>();
    let expected = ScenarioPrediction {
        name: found.recommended.protocol.clone(),
        apparatus: "expected positions, with the bands of the noise".into(),
        time_s: record.time_s.clone(),
        force_un: record.force_n.iter().map(|force| 1e6 * force).collect(),
        position_um: PositionQuantiles {
            q05: shifted(-1.645),
            q25: shifted(-0.674),
            median: shifted(0.0),
            q75: shifted(0.674),
            q95: shifted(1.645),
        },
        quantities: Vec::new(),
        full_model_error_um: 0.0,
        full_runs: 0,
        mesh_error_um: None,
        force_error_um: 0.0,
        warnings: Vec::new(),
    };
    figures::prediction::prediction("Protocol of the next record", &found.recommended.sentence, &[expected], None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use criticism::protocol::ForceDirections;

    /// Two of twenty gels exceed the limit, and one in twenty reaches 23.1 mm, which is beyond the outer surface at 9.725 mm.
    #[test]
    fn gels_that_leave_the_limit_are_told_with_the_outer_surface() {
        let limits = DesignLimits {
            largest_force_n: 4.6e-6,
            duration_s: 40.0,
            interval_s: 0.05,
            shortest_hold_s: 0.2,
            largest_position_m: 1e-3,
            directions: ForceDirections::Both,
        };
        let mut farthest_m = vec![0.9e-3; 18];
        farthest_m.extend([23.1e-3, 30e-3]);
        let text = |free_m| moves_too_far(&farthest_m, &limits, free_m).expect("a warning").text;
        let beyond = text(Some(9.725e-3));
        let expected = "One in twenty exceeds 23100 µm, beyond the gel's outer surface, which the robot touches after";
        assert!(beyond.contains(expected), "{beyond}");
        assert!([text(None), text(Some(40e-3))].iter().all(|text| text.ends_with("One in twenty exceeds 23100 µm")));
        assert_eq!(moves_too_far(&[0.9e-3; 20], &limits, Some(9.725e-3)), None);
    }
}
