//! `design`: the protocol of the next record.

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, Content, to_json, write_together};
use base::toml_input::quoted;
use criticism::criteria::Criteria;
use criticism::detectable::{Detectability, find_smallest_detectable};
use criticism::protocol::design::{DesignedProtocol, Designer, N_REPEATS, separates};
use criticism::protocol::{DesignLimits, DesignedDrive, Sought, SoughtEffect};
use criticism::{Candidate, Fitted, Search, Subject};
use documents::design::{
    Design, DesignedDetection, DesignedParameter, DesignedQuantity, FrontProtocol, HelplessPair, RecommendedProtocol,
};
use documents::diagnosis::{Diagnosis, VerdictKind};
use documents::prediction::{PositionQuantiles, ScenarioPrediction};
use figures::labels::parameter_label;
use figures::number::format_significant;
use figures::svg::figure_files;
use models::effects::Library;
use models::model::Forward;
use nalgebra::DVector;
use posterior::monitor::Monitor;
use posterior::problem::Problem;
use posterior::study::{DIAGNOSIS_NAME, ModelSpecification, POSTERIOR_NAME, Study, WithProvenance};
use prediction::ensemble::Ensemble;
use prediction::quantity::Quantity;
use prediction::scenario::Scenario;
use record::{Control, Experiment, ForceRule, Record};
use sampling::SamplerOptions;
use std::path::PathBuf;

use crate::artefacts;
use crate::first_revision::kept_surrogate;
use crate::last_cycle::read_document;
use crate::outcome::Outcome;
use crate::prediction::GelPlace;
use crate::simulation_files::description_toml;
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

/// Purpose of a design.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DesignGoal {
    /// Smallest uncertainty of the model's parameters.
    Parameters,
    /// Largest distance between the equivalent effects of the last diagnosis.
    Effects,
    /// Smallest detectable sizes of the effects that the model lacks.
    Detection,
    /// Smallest uncertainty of the first quantity of the first scenario.
    Decision,
}

impl DesignGoal {
    /// Name in documents.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parameters => "parameters",
            Self::Effects => "effects",
            Self::Detection => "detection",
            Self::Decision => "decision",
        }
    }
}

/// Step of the free coordinates for derivatives of a quantity of interest.
const DERIVATIVE_STEP: f64 = 1e-4;
/// Directory of the description of the new record.
const RECORD_DIR: &str = "next-record";

/// Settings of a design. A limit of `None` is that of the present record.
pub struct DesignRequest {
    /// Purpose; `None` for a decision if a scenario is given, for the effects if a diagnosis could not distinguish some, and otherwise for the parameters.
    pub goal: Option<DesignGoal>,
    /// File whose first scenario has the quantity of a decision.
    pub scenario: Option<PathBuf>,
    /// Duration of the new record, in s.
    pub budget_s: Option<f64>,
    /// Largest force, in N.
    pub largest_force_n: Option<f64>,
    /// Time between samples, in s.
    pub interval_s: Option<f64>,
    /// Shortest time for which a force is held, in s.
    pub shortest_hold_s: Option<f64>,
    /// Largest distance from the start, in m.
    pub largest_position_m: Option<f64>,
    /// Sampler settings for a first revision; the seed also serves the search.
    pub sampler: SamplerOptions,
}

/// Class of effects that a diagnosis could not distinguish.
struct Class {
    problem: Problem,
    revision: String,
    claimed: Vec<String>,
    equivalent: Vec<String>,
}

/// Designs the next record of a creep record's specimen, and writes the result into the study.
///
/// # Errors
/// [`Error::Input`] for any target except a creep record under force control; errors of fits and files.
pub fn run(target: &Target, request: &DesignRequest, monitor: &dyn Monitor) -> Result<Outcome<Design>> {
    let revision = target.creep()?.revision(request.sampler.clone(), monitor)?;
    refuse_other_records(&revision)?;
    let seed = request.sampler.seed;
    let class = class(&revision)?;
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
    let class = class.filter(|_| goal == DesignGoal::Effects);
    if goal == DesignGoal::Effects && class.is_none() {
        return Err(Error::input(
            InputPlace::file(revision.study.dir()),
            "no diagnosis of this study names effects that the record cannot distinguish",
            "run `vitreo-uq diagnose` on the study first, or design for the parameters",
        ));
    }
    let problem = class.as_ref().map_or(&revision.problem, |class| &class.problem);
    let kept = kept_surrogate(&revision.study, monitor);
    let subject = match &class {
        Some(_) => Subject::new(problem, &Library::default(), kept, monitor)?,
        None if goal == DesignGoal::Detection => {
            Subject::new(problem, &Library::default(), kept, monitor)?.with_specified_noise()
        }
        // The expected posterior has the noise of the revision, not that of a diagnosis.
        None => revision.subject(monitor)?.with_specified_noise(),
    };
    // Expected uncertainties continue those of `sample`, which fits the calibration cycles; a distance of effects uses all rows.
    let holds_out = matches!(goal, DesignGoal::Effects | DesignGoal::Detection);
    let mut cycles = subject.experiment().calibration_cycles.clone();
    cycles.extend(subject.experiment().heldout_cycles.iter().filter(|_| holds_out));
    let subject = subject.with_cycles(&cycles, &[])?;
    monitor.stage("fitting the models");
    let models = models(&subject, class.as_ref())?;
    let members: Vec<(&Candidate, &Fitted)> = models.iter().map(|(candidate, fitted)| (candidate, fitted)).collect();
    let asked = match goal {
        DesignGoal::Decision => Some(AskedQuantity::new(target.creep()?, request, monitor)?),
        _ => None,
    };
    let now_detectable = match goal {
        DesignGoal::Detection => {
            monitor.stage("computing the smallest detectable size of every effect");
            find_smallest_detectable(&subject, members[0], threshold_sigma())?
        }
        _ => Vec::new(),
    };
    let sought = match (goal, &asked) {
        (DesignGoal::Decision, Some(asked)) => Sought::Quantity(asked.derivatives(members[0])?),
        (DesignGoal::Effects, _) => Sought::Effects,
        (DesignGoal::Detection, _) => Sought::Sizes {
            effects: SoughtEffect::all(&subject, members[0], &now_detectable),
            threshold_sigma: threshold_sigma(),
        },
        _ => Sought::Parameters,
    };
    let designer = Designer::new(&subject, &members, sought)?;
    let farthest_m = models[0].1.position_m.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let limits = limits(subject.experiment(), farthest_m, request)?;
    let mut front: Vec<(DesignLimits, DesignedProtocol)> = Vec::new();
    for factor in FRONT {
        monitor.stage(&format!("comparing protocols of {} s", format_significant(factor * limits.duration_s, 3)));
        let within = DesignLimits { duration_s: factor * limits.duration_s, ..limits };
        let shorter = front
            .last()
            .and_then(|(shorter, protocol)| protocol.drive.followed_by_rest(shorter.duration_s / within.duration_s));
        match designer.search(&within, shorter.as_slice(), seed, monitor) {
            // A short duration in which no protocol fits is left out.
            Err(Error::Numerical { .. }) if factor < 1.0 => {}
            found => front.push((within, found?)),
        }
    }
    let place = front.iter().position(|(within, _)| within.duration_s == limits.duration_s).unwrap_or(0);
    let best = front.remove(place).1;
    monitor.stage("simulating records of the best protocol");
    let effects: Vec<String> = models.iter().map(|(candidate, _)| candidate.effects.join(" + ")).collect();
    let name = class.as_ref().map_or(&revision.name, |class| &class.revision).clone();
    let now = designer.distance_now()?;
    let right = best.closest.map(|_| designer.n_right(&best, seed)).transpose()?;
    let [information_nats, standard_error] = designer.mean_information(&best, seed)?;
    let helpless = helpless(&designer, &best, &limits, &effects);
    let quantity = asked.map(|asked| asked.designed(members[0], designer.quantity_sd(&best)?)).transpose()?;
    let detectable = match goal {
        DesignGoal::Detection => detections(&now_detectable, &designer.detectable(&best, threshold_sigma())?),
        _ => Vec::new(),
    };
    let study_dir = revision.study.dir().to_path_buf();
    let file = |stem: &str| study_dir.join(format!("{stem}.csv"));
    let parameters = parameters(&models[0], &designer.sd_now()?, &best.sd);
    let recommended = RecommendedProtocol {
        protocol_file: file("design-protocol").display().to_string(),
        record_dir: study_dir.join(RECORD_DIR).display().to_string(),
        protocol: best.drive.described(&limits),
        duration_s: limits.duration_s,
        expected_information_nats: information_nats,
        standard_error,
        separation_sigma: best.closest.map(|(distance, _)| distance),
        verdict_right_probability: right.map(|right| right as f64 / N_REPEATS as f64),
        simulated_records: if right.is_some() { N_REPEATS } else { 0 },
        sentence: match (&quantity, goal) {
            (Some(quantity), _) => with_quantity(&best, &limits, quantity),
            (None, DesignGoal::Detection) => with_detection(&best, &limits, &detectable),
            (None, _) => sentence(&best, &limits, now, right, &effects, &parameters),
        },
        parameters,
    };
    let entry = |limits: &DesignLimits, protocol: &DesignedProtocol, file: PathBuf| FrontProtocol {
        duration_s: limits.duration_s,
        expected_information_nats: protocol.information_nats,
        separation_sigma: protocol.closest.map(|(distance, _)| distance),
        protocol: protocol.drive.described(limits),
        protocol_file: file.display().to_string(),
    };
    let of_front = |index: usize| file(&format!("design-front-{}", index + 1));
    let mut entries: Vec<FrontProtocol> =
        front.iter().enumerate().map(|(k, (limits, protocol))| entry(limits, protocol, of_front(k))).collect();
    entries.push(entry(&limits, &best, file("design-protocol")));
    entries.sort_by(|a, b| a.duration_s.total_cmp(&b.duration_s));
    let found = Design {
        experiment: subject.experiment().specimen_id.clone(),
        revision: name,
        goal: goal.name().into(),
        effects: if class.is_some() { effects } else { Vec::new() },
        separation_now_sigma: now,
        largest_force_un: 1e6 * limits.largest_force_n,
        largest_displacement_um: 1e6 * limits.largest_position_m,
        interval_s: limits.interval_s,
        protocols_tried: best.n_tried,
        recommended,
        quantity,
        detectable,
        front: entries,
        helpless,
        warnings: Vec::new(),
    };
    monitor.stage("writing results and figures");
    let figure = figure(&designer.expected_m(&best)?, subject.reference_noise_m(), &best.record, &found)?;
    let posterior = revision.study.revision_dir(&revision.name)?.join(POSTERIOR_NAME);
    let posterior = files::read(&posterior, Content::Document, "run `vitreo-uq sample` again")?;
    let provenance = artefacts::with_inputs(revision.study.provenance("design", 1, seed), &revision.problem)
        .with_input(format!("{}/{POSTERIOR_NAME}", revision.name), &posterior);
    let document = WithProvenance { provenance, body: found };
    let json = study_dir.join("design.json");
    let json = (json.clone(), to_json(&json, &document)?);
    let mut tables = vec![(file("design-protocol"), protocol_csv(&best.record))];
    tables.extend(front.iter().enumerate().map(|(k, (_, protocol))| (of_front(k), protocol_csv(&protocol.record))));
    let record_dir = study_dir.join(RECORD_DIR);
    files::create_folders(&record_dir, "check the permissions of the study's directory")?;
    let (description, table) = next_record(subject.experiment(), &best.record, holds_out);
    tables.push((record_dir.join("experiment.toml"), description));
    tables.push((record_dir.join("trajectory.csv"), table));
    let [svg, png, pdf] = figure_files(&study_dir, "design", &figure)?;
    let written = [&svg, &png, &pdf, &json].into_iter().chain(&tables);
    let written: Vec<_> = written.map(|(path, bytes)| (path.as_path(), bytes.as_slice())).collect();
    write_together(&written)?;
    Ok(Outcome { is_sound: document.body.is_sound(), document, written: svg.0, study: Some(revision.study) })
}

/// Distance (σ) from which an effect is detected: a lead of twice the least gain of a diagnosis, and one standard deviation more, so that most records show it.
fn threshold_sigma() -> f64 {
    (2.0 * Criteria::RECORD.least_gain_nats).sqrt() + 1.0
}

/// Quantity of interest of a scenario, as a function of the model's parameters.
struct AskedQuantity {
    scenario: Scenario,
    quantity: Quantity,
    ensemble: Ensemble,
}

impl AskedQuantity {
    fn new(target: &CreepTarget, request: &DesignRequest, monitor: &dyn Monitor) -> Result<Self> {
        let place = GelPlace::Study(target);
        let scenario = place.scenarios(request.scenario.as_deref())?.remove(0);
        let Some(quantity) = scenario.quantities.first().copied() else {
            return Err(Error::input(
                scenario.place("quantity"),
                "a decision needs a quantity of interest, and the first scenario has none",
                "add [[scenario.quantity]] to it",
            ));
        };
        let source = place.open(&scenario, &request.sampler, monitor)?;
        let (force, duration_s) = scenario.force_and_duration()?;
        let record = force.record(duration_s, &quantity.times_s())?;
        let ensemble = Ensemble::new(&source.gel(), &scenario, record, source.kept.clone(), monitor)?;
        Ok(Self { scenario, quantity, ensemble })
    }

    /// Value for coordinates of the model.
    fn value(&self, candidate: &Candidate, theta: &[f64]) -> Result<f64> {
        let position_m = self.ensemble.forward().trajectory_m(&candidate.parameters(theta))?;
        let value = self.quantity.value(self.ensemble.record(), &position_m, self.ensemble.strain_per_m);
        if value.is_finite() {
            return Ok(value);
        }
        Err(Error::input(
            self.scenario.place("quantity"),
            format!("the quantity `{}` has no value at the fit", self.quantity.label()),
            "give a longer duration, a larger force or a smaller distance",
        ))
    }

    /// Derivatives by the model's free coordinates, by central differences.
    fn derivatives(&self, (candidate, fitted): (&Candidate, &Fitted)) -> Result<DVector<f64>> {
        let derivative = |k: usize| {
            let at = |step: f64| {
                let mut theta = fitted.theta.clone();
                theta[k] = candidate.free[k].clamped(theta[k] + step);
                Ok::<_, Error>((theta[k], self.value(candidate, &theta)?))
            };
            let ((lower, less), (upper, more)) = (at(-DERIVATIVE_STEP)?, at(DERIVATIVE_STEP)?);
            Ok((more - less) / (upper - lower))
        };
        let all: Vec<f64> = (0..candidate.free.len()).map(derivative).collect::<Result<_>>()?;
        Ok(DVector::from_vec(all))
    }

    fn designed(&self, (candidate, fitted): (&Candidate, &Fitted), sd: Option<[f64; 2]>) -> Result<DesignedQuantity> {
        let [sd_now, sd_expected] = sd.unwrap_or([f64::NAN; 2]);
        Ok(DesignedQuantity {
            scenario: self.scenario.name.clone(),
            quantity: self.quantity.label(),
            unit: self.quantity.unit().into(),
            value: self.value(candidate, &fitted.theta)?,
            sd_now,
            sd_expected,
        })
    }
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

/// Refuses records whose designed protocol this search cannot make.
fn refuse_other_records(revision: &Revision) -> Result<()> {
    let experiment = &revision.problem.experiment;
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

/// Class of equivalent effects in the last diagnosis that has one, from the revision back to the first; `None` without such a diagnosis.
fn class(revision: &Revision) -> Result<Option<Class>> {
    let study: &Study = &revision.study;
    let names = study.revisions()?;
    let end = names.iter().position(|name| *name == revision.name).map_or(names.len(), |place| place + 1);
    for name in names[..end].iter().rev() {
        let dir = study.revision_dir(name)?;
        let Some(diagnosis) = read_document::<Diagnosis>(&dir.join(DIAGNOSIS_NAME)) else { continue };
        let verdict = diagnosis.body.verdict;
        if verdict.kind != VerdictKind::Missing || verdict.equivalent.is_empty() {
            continue;
        }
        let specification = ModelSpecification::of_revision(&dir, &Library::default())?;
        let problem = revision.problem.with_model(specification, &Library::default())?;
        return Ok(Some(Class {
            problem,
            revision: name.clone(),
            claimed: verdict.effects,
            equivalent: verdict.equivalent,
        }));
    }
    Ok(None)
}

/// Fits of the models: the claimed effects, then each equivalent in place of the claimed effect that it replaces best. Without a class, the base model.
fn models(subject: &Subject, class: Option<&Class>) -> Result<Vec<(Candidate, Fitted)>> {
    let fit = |effects: &[&str]| -> Result<(Candidate, Fitted)> {
        let candidate = subject.extended(effects)?;
        let fitted = subject.fit(&candidate, &[], Search::Wide)?;
        Ok((candidate, fitted))
    };
    let Some(class) = class else {
        let base = subject.base();
        let fitted = subject.fit(&base, &[], Search::Wide)?;
        return Ok(vec![(base, fitted)]);
    };
    let claimed: Vec<&str> = class.claimed.iter().map(String::as_str).collect();
    let mut list = vec![fit(&claimed)?];
    for effect in &class.equivalent {
        let mut best: Option<(Candidate, Fitted)> = None;
        for place in 0..claimed.len() {
            let mut effects = claimed.clone();
            effects[place] = effect;
            // A combination of effects that is not possible is no rival.
            let Ok(found) = fit(&effects) else { continue };
            if best.as_ref().is_none_or(|best| found.1.objective > best.1.objective) {
                best = Some(found);
            }
        }
        list.extend(best);
    }
    Ok(list)
}

/// Limits of the new record: those of the present one where the request gives none.
fn limits(experiment: &Experiment, farthest_m: f64, request: &DesignRequest) -> Result<DesignLimits> {
    let interval_s = request.interval_s.or(experiment.record.median_interval_s()).unwrap_or(0.0);
    let scales = experiment.scales();
    let duration_s = request.budget_s.unwrap_or(scales.duration_s + interval_s);
    let largest_force_n = request.largest_force_n.unwrap_or(scales.largest_force_n);
    let shortest_hold_s = request.shortest_hold_s.unwrap_or(4.0 * interval_s);
    if !(interval_s > 0.0 && duration_s >= 20.0 * interval_s && largest_force_n > 0.0) {
        return Err(Error::input(
            InputPlace::default().at_key("limits"),
            format!("a record of {duration_s} s with a sample every {interval_s} s and at most {largest_force_n} N"),
            "give a force above 0, and a duration of at least 20 samples",
        ));
    }
    if duration_s / interval_s > MOST_ROWS {
        return Err(Error::input(
            InputPlace::default().at_key("limits"),
            format!("the new record would have {:.0} rows", duration_s / interval_s),
            format!("give a longer interval or a shorter duration: the limit is {MOST_ROWS} rows"),
        ));
    }
    let largest_position_m = request.largest_position_m.unwrap_or(BEYOND * farthest_m);
    Ok(DesignLimits { largest_force_n, duration_s, interval_s, shortest_hold_s, largest_position_m })
}

/// Largest distance of a designed record from its start, relative to that of the present record, unless it is given.
const BEYOND: f64 = 1.05;
/// Largest number of rows of a designed record of the recommended duration.
const MOST_ROWS: f64 = 10_000.0;

/// Parameters of the first model with their standard deviations now and later, in the parameters' units.
fn parameters((candidate, fitted): &(Candidate, Fitted), now: &[f64], then: &[f64]) -> Vec<DesignedParameter> {
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

/// The protocol as an instruction.
fn instruction(best: &DesignedProtocol, limits: &DesignLimits) -> String {
    format!("Apply {} ({} s in all).", best.drive.described(limits), format_significant(limits.duration_s, 3))
}

fn with_quantity(best: &DesignedProtocol, limits: &DesignLimits, quantity: &DesignedQuantity) -> String {
    let unit = quantity.unit.replace("um", "µm");
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    let [value, now, then] =
        [quantity.value, quantity.sd_now, quantity.sd_expected].map(|value| format_significant(value, 3));
    format!(
        "{} The {} of {} ({value}{unit}) becomes known to ± {then}{unit} (now ± {now}{unit}).",
        instruction(best, limits),
        quantity.quantity,
        quantity.scenario
    )
}

fn with_detection(best: &DesignedProtocol, limits: &DesignLimits, detectable: &[DesignedDetection]) -> String {
    let opened: Vec<&str> = detectable
        .iter()
        .filter(|found| found.smallest_now.is_none() && found.smallest_expected.is_some())
        .map(|found| found.effect.as_str())
        .collect();
    let blind = detectable.iter().filter(|found| found.smallest_expected.is_none()).count();
    let visible = detectable.len() - blind;
    let mut text = format!(
        "{} The new record shows {visible} of {} effects at some size of their priors.",
        instruction(best, limits),
        detectable.len()
    );
    if !opened.is_empty() {
        text += &format!(" Visible for the first time: {}.", opened.join(", "));
    }
    text
}

fn sentence(
    best: &DesignedProtocol,
    limits: &DesignLimits,
    now: Option<f64>,
    right: Option<usize>,
    effects: &[String],
    parameters: &[DesignedParameter],
) -> String {
    let short = |value: f64| format_significant(value, 3);
    let mut text = instruction(best, limits);
    if let (Some((distance, other)), Some(now), Some(right)) = (best.closest, now, right) {
        let verb = if separates(distance) { "This separates" } else { "This does not separate" };
        text += &format!(
            " {verb} {} from {}: their distance becomes {} σ instead of {} σ, and the true effect is recognised in {right} of {N_REPEATS} simulated records.",
            effects[0],
            effects[other],
            short(distance),
            short(now)
        );
    }
    let improved = parameters.iter().min_by(|a, b| (a.sd_expected / a.sd_now).total_cmp(&(b.sd_expected / b.sd_now)));
    if let Some(parameter) = improved {
        let percent = |sd: f64| short(100.0 * sd / parameter.value.abs());
        text += &format!(
            " {} becomes known to ± {} % (now ± {} %).",
            parameter_label(&parameter.name).symbol,
            percent(parameter.sd_expected),
            percent(parameter.sd_now)
        );
    }
    text
}

/// Table for the controller. Each force holds until the next row; a force that changes at every row has a row for each sample.
fn protocol_csv(record: &Record) -> Vec<u8> {
    let mut text = String::from("time_s,force_un\n");
    let last = record.n_rows() - 1;
    for row in 0..=last {
        let is_change = row == 0 || row == last || record.force_n[row] != record.force_n[row - 1];
        if is_change || record.force_rule == ForceRule::Linear {
            text += &format!("{:.6},{:.6}\n", record.time_s[row], 1e6 * record.force_n[row]);
        }
    }
    text.into_bytes()
}

/// Description and table for the new record, with the same apparatus. The positions are missing. The last third is a cycle of its own if it is held out.
fn next_record(experiment: &Experiment, record: &Record, holds_out: bool) -> (Vec<u8>, Vec<u8>) {
    let mut measurement = vec![
        "calibration_cycles = [1]".to_string(),
        format!("heldout_cycles = [{}]", if holds_out { "2" } else { "" }),
        format!("force = \"{}\"", record.force_rule.name()),
        format!("source = {}", quoted("to be recorded: protocol of vitreo-uq design")),
    ];
    measurement.extend(experiment.noise_sd_m.map(|sd_m| format!("noise_um = {}", 1e6 * sd_m)));
    let head =
        "# Protocol of `vitreo-uq design`. Replace trajectory.csv by the record, or fill in its column position_um.";
    let toml = description_toml(head, &format!("{}-next", experiment.specimen_id), experiment, &measurement);
    let mut table = String::from("time_s,force_uN,position_um,cycle\n");
    let last = record.n_rows() - 1;
    for row in 0..=last {
        let cycle = if holds_out && 3 * row >= 2 * last { 2 } else { 1 };
        table += &format!("{:.6},{:.6},,{cycle}\n", record.time_s[row], 1e6 * record.force_n[row]);
    }
    (toml.into_bytes(), table.into_bytes())
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
        warnings: Vec::new(),
    };
    figures::prediction::prediction("Protocol of the next record", &found.recommended.sentence, &[expected], None)
}
