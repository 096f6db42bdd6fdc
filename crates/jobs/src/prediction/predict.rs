//! `predict`: positions and quantities of interest of scenarios, with their uncertainty and its sources.

use std::path::PathBuf;

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{to_json, write_together};
use cohorts::spread::variance;
use documents::posterior::{Warning, WarningKind};
use documents::prediction::{
    EquivalentPrediction, GroupShare, PositionQuantiles, PredictedQuantity, Prediction, ScenarioPrediction, Sensitivity,
};
use figures::number::format_significant;
use figures::svg::figure_files;
use posterior::monitor::Monitor;
use posterior::study::WithProvenance;
use prediction::ensemble::{self, Draws, Ensemble, Gel};
use prediction::force_history::ForceHistory;
use prediction::quantity::{Quantity, percent, ten_digits, time_to_reach_s};
use prediction::scenario::Scenario;
use prediction::sensitivity::{Inputs, Marginal, covariance_share, indices};
use prediction::tolerance::Tolerance;
use record::{Control, Record};
use sampling::SamplerOptions;

use super::gel_source::{GelPlace, GelSource};
use crate::outcome::Outcome;

/// Largest number of positions of one scenario, over all draws and rows, and the smallest number of draws. They bound the memory.
const MOST_VALUES: usize = 20_000_000;
const FEWEST_DRAWS: usize = 1_000;
/// Number of rows that are added around the arrivals at a distance.
const N_ARRIVAL_ROWS: usize = 100;
/// Smallest share of draws with a value of a quantity from which the sources of its variance are given. Below it the median draw has no value, and a variance among the
/// others describes a minority.
const LEAST_SHARE: f64 = 0.5;
/// Smallest difference of the reduced model from full finite elements that is named, in µm: rounding is below it.
const NAMED_ERROR_UM: f64 = 1e-6;
/// Number of points from which each sensitivity index is computed.
const N_SENSITIVITY: usize = 2_048;
/// Distance between the rows of a linear model from which quantities other than positions are computed.
const SENSITIVITY_ROWS: usize = 8;
/// The same number if the position is not proportional to the force, where a trajectory takes milliseconds.
const N_SENSITIVITY_SLOW: usize = 128;

/// Largest relative numerical error that is no input of the sensitivity.
const SHOWN_NUMERICAL_ERROR: f64 = 1e-4;
/// Largest relative numerical error that is an input of the sensitivity; the prediction's warnings name larger ones.
const MOST_NUMERICAL_ERROR: f64 = 0.5;

/// Settings of a prediction.
pub struct PredictRequest {
    /// File of scenarios; `None` for the study's own robot.
    pub scenarios: Option<PathBuf>,
    /// Table of the force, for scenarios without a force of their own.
    pub force: Option<PathBuf>,
    /// Sampler settings for revisions and equivalent models that must be sampled.
    pub sampler: SamplerOptions,
}

/// Predicts scenarios, and writes the result beside the source of the gel.
///
/// # Errors
/// [`Error::Input`] for scenarios that cannot be predicted; errors of models and files.
pub fn run(place: &GelPlace<'_>, request: &PredictRequest, monitor: &dyn Monitor) -> Result<Outcome<Prediction>> {
    let scenarios = scenarios(place, request)?;
    let source = place.open(&scenarios[0].0, &request.sampler, monitor)?;
    let (gel, seed) = (source.gel(), request.sampler.seed);
    let mut found = Prediction {
        gel: gel.draws.source.clone(),
        draws: gel.draws.values.len(),
        scenarios: Vec::new(),
        equivalent: Vec::new(),
        sensitivity: Vec::new(),
        group_shares: Vec::new(),
        without_sensitivity: Vec::new(),
        warnings: source.warnings.clone(),
    };
    for (scenario, record) in &scenarios {
        let gel = Gel { draws: gel.draws.thinned((MOST_VALUES / record.n_rows()).max(FEWEST_DRAWS)), ..gel };
        let ensemble = Ensemble::new(&gel, scenario, record.clone(), source.kept.clone(), monitor)?;
        let ensemble = with_arrivals(ensemble, scenario)?;
        let record = ensemble.record();
        monitor.stage(&format!("predicting {}", scenario.name));
        let prediction = predicted(&gel, &ensemble, scenario, monitor)?;
        let error_um =
            prediction.full_model_error_um + prediction.mesh_error_um.unwrap_or(0.0) + prediction.force_error_um;
        let relative_error = error_um / largest_um(&prediction.position_um);
        let shares = shares_of_draws(&ensemble, scenario)?;
        if !ensemble.is_slow() {
            found.without_sensitivity.extend(without_sensitivity(scenario, &shares));
        }
        found.sensitivity.extend(sensitivity(&gel, &ensemble, (scenario, &shares), relative_error, monitor)?);
        found.group_shares.extend(group_shares(&gel, &ensemble, (scenario, &shares))?);
        for rival in &source.rivals {
            let gel = Gel { problem: &rival.problem, draws: rival.draws.clone(), is_taught: true, seed };
            let ensemble = match Ensemble::new(&gel, scenario, record.clone(), source.kept.clone(), monitor) {
                Err(Error::Input { found: reason, .. }) => {
                    found.warnings.push(missing_rival(&scenario.name, &rival.effect, &reason));
                    continue;
                }
                ensemble => ensemble?,
            };
            let trajectories_m = ensemble.trajectories_m(0..ensemble.parameters.len())?;
            let quantities = quantities(&ensemble, scenario, &trajectories_m);
            let disagreement = disagreement(&prediction.quantities, &quantities);
            found.equivalent.push(EquivalentPrediction {
                scenario: scenario.name.clone(),
                effect: rival.effect.clone(),
                disagrees: disagreement > 1.0,
                disagreement,
                quantities,
            });
        }
        found.scenarios.push(prediction);
    }
    found.warnings.extend(disagreement_warnings(&found));
    write(&source, found, seed, monitor)
}

/// Scenarios with their rows.
fn scenarios(place: &GelPlace<'_>, request: &PredictRequest) -> Result<Vec<(Scenario, Record)>> {
    let force = request.force.as_deref().map(ForceHistory::from_file).transpose()?;
    let mut scenarios = place.scenarios(request.scenarios.as_deref())?;
    let with_record = |scenario: &mut Scenario| -> Result<(Scenario, Record)> {
        if let Some(force) = &force {
            if scenario.force.is_some() {
                return Err(Error::input(
                    InputPlace::setting(Setting::ForceTable),
                    format!("the scenario `{}` has a force of its own", scenario.name),
                    "remove `force` from the scenario, or leave out the table",
                ));
            }
            if force.last_change_s() == 0.0 && scenario.duration_s.is_none() && scenario.quantities.is_empty() {
                return Err(Error::input(
                    InputPlace::setting(Setting::ForceTable),
                    "the table ends at 0 s",
                    "add a row with the time at which the prediction ends",
                ));
            }
            scenario.force = Some(force.clone());
        }
        let record_of_study = match place {
            GelPlace::Study(target) if target.experiment.control == Control::Force => Some(&target.experiment.record),
            GelPlace::Study(_) | GelPlace::Groups { .. } | GelPlace::Prior { .. } => None,
        };
        if let (None, None, Some(of_study)) = (&scenario.force, &request.scenarios, record_of_study) {
            let n = of_study.n_rows();
            let record = Record { position_m: vec![None; n], cycle: vec![1; n], ..of_study.clone() };
            let at_s = record.time_s[record.n_rows() - 1];
            scenario.quantities = vec![Quantity::PositionAt { at_s, at_least_m: None }];
            return Ok((scenario.clone(), record));
        }
        let (force, duration_s) = scenario.force_and_duration()?;
        let also_s: Vec<f64> = scenario.quantities.iter().flat_map(Quantity::times_s).collect();
        let record = force.record(duration_s, &also_s)?;
        if scenario.quantities.is_empty() {
            scenario.quantities = vec![Quantity::PositionAt { at_s: duration_s, at_least_m: None }];
        }
        if scenario.quantities.contains(&Quantity::Return) && prediction::quantity::last_release(&record).is_none() {
            return Err(Error::input(
                scenario.place("quantity"),
                "a return is asked, but the force is not zero over some time at the end",
                "end the force with a step to 0 µN before the end, which `duration_s` sets",
            ));
        }
        Ok((scenario.clone(), record))
    };
    scenarios.iter_mut().map(with_record).collect()
}

/// Adds rows between the first and the last arrival of a draw at each distance that the scenario asks for, so that times of arrival are exact to the row.
fn with_arrivals(ensemble: Ensemble, scenario: &Scenario) -> Result<Ensemble> {
    let distances_m = scenario.quantities.iter().filter_map(|quantity| match quantity {
        Quantity::TimeToReach { distance_m, .. } => Some(*distance_m),
        _ => None,
    });
    let distances_m: Vec<f64> = distances_m.collect();
    if distances_m.is_empty() {
        return Ok(ensemble);
    }
    let trajectories_m = ensemble.trajectories_m(0..ensemble.parameters.len())?;
    let record = ensemble.record().clone();
    let mut also_s = Vec::new();
    for distance_m in distances_m {
        let times_s = trajectories_m.iter().map(|x| time_to_reach_s(&record, x, distance_m)).filter(|s| s.is_finite());
        let ends = times_s.fold([f64::INFINITY, 0.0_f64], |[first, last], s| [first.min(s), last.max(s)]);
        // The row before the first arrival and the row after the last one enclose all of them.
        let before = record.time_s.partition_point(|s| *s < ends[0]).saturating_sub(1);
        let after = record.time_s.partition_point(|s| *s <= ends[1]).min(record.n_rows() - 1);
        if before < after {
            let (from_s, to_s) = (record.time_s[before], record.time_s[after]);
            also_s.extend((1..N_ARRIVAL_ROWS).map(|k| from_s + (to_s - from_s) * k as f64 / N_ARRIVAL_ROWS as f64));
        }
    }
    Ok(ensemble.with_record(record.with_times(&also_s)))
}

/// Predicts one scenario.
pub(super) fn predicted(
    gel: &Gel<'_>,
    ensemble: &Ensemble,
    scenario: &Scenario,
    monitor: &dyn Monitor,
) -> Result<ScenarioPrediction> {
    let trajectories_m = ensemble.trajectories_m(0..ensemble.parameters.len())?;
    let position_um = ensemble::quantiles_um(&trajectories_m);
    monitor.stage("checking draws by full finite elements");
    let check = ensemble.check(&trajectories_m)?;
    let largest_um = largest_um(&position_um);
    let mut warnings = ensemble::warnings(gel, ensemble, &trajectories_m);
    let bends = ensemble.problem().model.effects().iter().find(|effect| effect.changes_field());
    if let Some(effect) = bends.filter(|_| scenario.quantities.contains(&Quantity::PeakStrain)) {
        warnings.push(Warning {
            kind: WarningKind::Extrapolation,
            text: format!("the peak strain is that of the displacement field without {}", effect.slug()),
            advice: "read it as an estimate: the effect changes the field beside the robot".into(),
        });
    }
    let record = ensemble.record();
    let half_um =
        position_um.q95.iter().zip(&position_um.q05).fold(0.0_f64, |most, (q95, q05)| most.max(0.5 * (q95 - q05)));
    let error_um = 1e6 * check.error_m;
    if error_um > 0.1 * half_um && error_um > 1e-3 * largest_um && error_um > NAMED_ERROR_UM {
        warnings.push(Warning {
            kind: WarningKind::SurrogateInaccurate,
            text: format!(
                "the reduced model differs from full finite elements by up to {} µm",
                format_significant(error_um, 3)
            ),
            advice: "compare with `vitreo-uq simulate` before a decision".into(),
        });
    }
    Ok(ScenarioPrediction {
        name: scenario.name.clone(),
        apparatus: scenario.apparatus(),
        time_s: record.time_s.clone(),
        force_un: record.force_n.iter().map(|force| 1e6 * force).collect(),
        quantities: quantities(ensemble, scenario, &trajectories_m),
        position_um,
        full_model_error_um: error_um,
        full_runs: check.runs,
        mesh_error_um: ensemble.mesh_error().map(|error| error * largest_um),
        force_error_um: scenario.force.as_ref().map_or(0.0, |force| force.line_error(record)) * largest_um,
        warnings,
    })
}

/// Largest distance of the median from the start, in µm.
fn largest_um(position_um: &PositionQuantiles) -> f64 {
    position_um.median.iter().fold(0.0_f64, |most, x| most.max(x.abs()))
}

fn quantities(ensemble: &Ensemble, scenario: &Scenario, trajectories_m: &[Vec<f64>]) -> Vec<PredictedQuantity> {
    let end_s = ensemble.record().time_s.last().copied().unwrap_or(0.0);
    let summary = |quantity: &Quantity| {
        let value = |x: &Vec<f64>| quantity.value(ensemble.record(), x, ensemble.strain_per_m);
        quantity.summary(&trajectories_m.iter().map(value).collect::<Vec<f64>>(), end_s)
    };
    scenario.quantities.iter().map(summary).collect()
}

/// Largest distance between medians, in half-widths of the wider 90 % interval. A quantity that only one of both has counts as the largest number.
fn disagreement(quantities: &[PredictedQuantity], other: &[PredictedQuantity]) -> f64 {
    let half = |q: &PredictedQuantity| q.q95.zip(q.q05).map_or(0.0, |(q95, q05)| 0.5 * (q95 - q05));
    let distance = |(a, b): (&PredictedQuantity, &PredictedQuantity)| match (a.median, b.median) {
        (Some(x), Some(y)) => (x - y).abs() / half(a).max(half(b)).max(f64::MIN_POSITIVE),
        (None, None) => 0.0,
        _ => f64::MAX,
    };
    quantities.iter().zip(other).map(distance).fold(0.0, f64::max)
}

/// Warning that an equivalent effect cannot be predicted for a scenario.
fn missing_rival(scenario: &str, effect: &str, reason: &str) -> Warning {
    Warning {
        kind: WarningKind::ModelIncomplete,
        text: format!("{scenario}: {effect}, which the record cannot distinguish, is not predicted: {reason}"),
        advice: "complete the scenario's robot and gel, or record the experiment that tells the effects apart (`vitreo-uq design` computes one)".into(),
    }
}

fn disagreement_warnings(found: &Prediction) -> Vec<Warning> {
    let disagreeing = found.equivalent.iter().filter(|other| other.disagrees);
    let warning = |other: &EquivalentPrediction| {
        let with_own = found.scenarios.iter().find(|scenario| scenario.name == other.scenario);
        let sentences =
            |list: &[PredictedQuantity]| list.iter().map(|q| q.sentence.clone()).collect::<Vec<String>>().join("; ");
        Warning {
            kind: WarningKind::ModelIncomplete,
            text: format!(
                "{}: the answer depends on the effect. With the model's own: {}. With {}, which the record cannot distinguish: {}",
                other.scenario,
                with_own.map_or(String::new(), |scenario| sentences(&scenario.quantities)),
                other.effect,
                sentences(&other.quantities)
            ),
            advice: "record the experiment that tells the effects apart (`vitreo-uq design` computes one)".into(),
        }
    };
    disagreeing.map(warning).collect()
}

/// Share of the draws in which each quantity has a value. A time of arrival has none in draws that do not arrive, and a return none where nothing moved.
fn shares_of_draws(ensemble: &Ensemble, scenario: &Scenario) -> Result<Vec<f64>> {
    let has_gaps = |quantity: &Quantity| matches!(quantity, Quantity::TimeToReach { .. } | Quantity::Return);
    if !scenario.quantities.iter().any(has_gaps) {
        return Ok(vec![1.0; scenario.quantities.len()]);
    }
    let trajectories_m = ensemble.trajectories_m(0..ensemble.parameters.len())?;
    let has_value =
        |quantity: &Quantity, x: &[f64]| quantity.value(ensemble.record(), x, ensemble.strain_per_m).is_finite();
    let share = |quantity: &Quantity| {
        let n = trajectories_m.iter().filter(|x| has_value(quantity, x)).count();
        n as f64 / trajectories_m.len() as f64
    };
    Ok(scenario.quantities.iter().map(share).collect())
}

/// Quantities whose variance has no sources in the result, with the reason. `shares` are the shares of draws in which the quantities have values.
fn without_sensitivity(scenario: &Scenario, shares: &[f64]) -> Vec<String> {
    let few = scenario.quantities.iter().zip(shares).filter(|(_, share)| **share < LEAST_SHARE);
    let reason = |(quantity, share): (&Quantity, &f64)| {
        let is_arrival = matches!(quantity, Quantity::TimeToReach { .. });
        format!(
            "{}, {}: {} % of the draws {}. The variance is attributed to its sources if at least half of them do{}",
            scenario.name,
            quantity.label(),
            percent(*share),
            if is_arrival { "arrive by the end" } else { "have a value" },
            if is_arrival { ": give a longer duration" } else { "" }
        )
    };
    few.map(reason).collect()
}

/// Sensitivity of every quantity to the parameters, the tolerances and the numerical error, among the draws in which it has a value. `shares` are the shares of these draws.
fn sensitivity(
    gel: &Gel<'_>,
    ensemble: &Ensemble,
    (scenario, shares): (&Scenario, &[f64]),
    numerical_error: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<Sensitivity>> {
    if ensemble.is_slow() || gel.draws.values.is_empty() {
        return Ok(Vec::new());
    }
    monitor.stage("attributing the variance to its sources");
    let (mut inputs, kept) = Inputs::of_draws(&gel.draws.names, &gel.draws.values);
    let numerical = Tolerance::proportional("numerical error", numerical_error.min(MOST_NUMERICAL_ERROR));
    let is_numerical_named = numerical_error > SHOWN_NUMERICAL_ERROR;
    let tolerances: Vec<&Tolerance> =
        ensemble.tolerances.iter().chain(is_numerical_named.then_some(&numerical)).collect();
    for tolerance in &tolerances {
        inputs.push_independent(tolerance.name, Marginal::Uniform([-1.0, 1.0]));
    }
    if inputs.names().is_empty() {
        return Ok(Vec::new());
    }
    let is_linear = ensemble.is_linear()?;
    let are_positions = scenario.quantities.iter().all(|quantity| matches!(quantity, Quantity::PositionAt { .. }));
    let every = if are_positions { usize::MAX } else { SENSITIVITY_ROWS };
    let times_s: Vec<f64> = scenario.quantities.iter().flat_map(Quantity::times_s).collect();
    let record = ensemble.record();
    // Of a linear model, positions at given times need these rows and those at which the force changes. The last row is the end of the scenario. Other quantities need
    // rows between them.
    let is_needed = |row: usize| {
        let after_change = row > 0 && record.force().changes_at(row - 1);
        (record.force().changes_at(row) || after_change)
            || times_s.contains(&record.time_s[row])
            || row.is_multiple_of(every)
            || row + 1 == record.n_rows()
    };
    let needed: Vec<bool> = (0..record.n_rows()).map(is_needed).collect();
    let of_few_rows = is_linear.then(|| ensemble.with_record(record.of_rows(&needed)));
    let ensemble = of_few_rows.as_ref().unwrap_or(ensemble);
    let (forward, record) = (ensemble.forward(), ensemble.record());
    let draw_and_factor = |inputs: &Vec<f64>| {
        let mut draw = gel.draws.values[0].clone();
        kept.iter().zip(inputs).for_each(|(k, value)| draw[*k] = *value);
        let at = &inputs[kept.len()..];
        let factor = tolerances.iter().zip(at).map(|(tolerance, u)| tolerance.factor(*u)).product::<f64>();
        (gel.draws.parameters(ensemble.problem(), &draw), factor)
    };
    let values = |quantities: &[usize], points: &[Vec<f64>]| -> Result<Vec<Vec<f64>>> {
        let (parameters, factors): (Vec<Vec<f64>>, Vec<f64>) = points.iter().map(draw_and_factor).unzip();
        let of_trajectory = |(mut position_m, factor): (Vec<f64>, f64)| {
            position_m.iter_mut().for_each(|x| *x *= factor);
            let value = |k: &usize| scenario.quantities[*k].value(record, &position_m, ensemble.strain_per_m);
            quantities.iter().map(value).collect()
        };
        Ok(forward.trajectories_m(&parameters)?.into_iter().zip(factors).map(of_trajectory).collect())
    };
    let n = if is_linear { N_SENSITIVITY } else { N_SENSITIVITY_SLOW };
    // A quantity without a value in some draws has points of its own, which all have one.
    let all = || 0..scenario.quantities.len();
    let complete: Vec<usize> = all().filter(|k| shares[*k] == 1.0).collect();
    let others = all().filter(|k| (LEAST_SHARE..1.0).contains(&shares[*k])).map(|k| vec![k]);
    let mut found = Vec::new();
    for quantities in std::iter::once(complete).chain(others).filter(|quantities| !quantities.is_empty()) {
        let of_quantities = indices(&inputs, n, gel.seed, |points| values(&quantities, points))?;
        found.extend(quantities.into_iter().zip(of_quantities));
    }
    found.sort_by_key(|(k, _)| *k);
    let entries = found.into_iter().flat_map(|(k, of_inputs)| {
        let (quantity, share_of_draws) = (&scenario.quantities[k], shares[k]);
        let entry = move |(input, index): (&String, prediction::sensitivity::Index)| Sensitivity {
            scenario: scenario.name.clone(),
            quantity: quantity.label(),
            input: input.clone(),
            first_order: index.first_order[0],
            first_order_se: index.first_order[1],
            total: index.total[0],
            total_se: index.total[1],
            shapley: index.shapley[0],
            shapley_se: index.shapley[1],
            share_of_draws,
        };
        inputs.names().iter().zip(of_inputs).map(entry).collect::<Vec<Sensitivity>>()
    });
    Ok(entries.collect())
}

/// Share of the variance of every quantity that is due to the uncertain group, for a new specimen of a group. It is the covariance of two specimens of one draw of the
/// population, divided by the variance of one specimen, among the draws in which the quantity has a value for both specimens. `shares` are the shares of draws with a value.
fn group_shares(
    gel: &Gel<'_>,
    ensemble: &Ensemble,
    (scenario, shares): (&Scenario, &[f64]),
) -> Result<Vec<GroupShare>> {
    if gel.draws.other_specimens.is_empty() || ensemble.is_slow() {
        return Ok(Vec::new());
    }
    let values = |ensemble: &Ensemble| -> Result<Vec<Vec<f64>>> {
        let trajectories_m = ensemble.trajectories_m(0..ensemble.parameters.len())?;
        let of_quantity = |quantity: &Quantity| {
            let value = |x: &Vec<f64>| quantity.value(ensemble.record(), x, ensemble.strain_per_m);
            trajectories_m.iter().map(value).collect()
        };
        Ok(scenario.quantities.iter().map(of_quantity).collect())
    };
    let other = Draws { values: gel.draws.other_specimens.clone(), other_specimens: Vec::new(), ..gel.draws.clone() };
    // The tolerances of two specimens are independent, so that they count in the variance only.
    let plain = ensemble.without_tolerances();
    let (one, other, with_tolerances) = (values(&plain)?, values(&plain.with_draws(&other, 0))?, values(ensemble)?);
    let share = |(k, quantity): (usize, &Quantity)| {
        let [share, share_se] = group_share([&one[k], &other[k], &with_tolerances[k]]);
        let quantity = quantity.label();
        GroupShare { scenario: scenario.name.clone(), quantity, share, share_se, share_of_draws: shares[k] }
    };
    let quantities = scenario.quantities.iter().enumerate().filter(|(k, _)| shares[*k] >= LEAST_SHARE);
    Ok(quantities.map(share).collect())
}

/// Share of the variance of a quantity that two specimens of one draw of the population have in common, with its standard error. The lists hold the values of one specimen, of the other,
/// and of the first with its tolerances; draws without one of the three values are left out.
fn group_share(values: [&[f64]; 3]) -> [f64; 2] {
    let has_values = |draw: &usize| values.iter().all(|list| list[*draw].is_finite());
    let draws: Vec<usize> = (0..values[0].len()).filter(has_values).collect();
    let [one, other, with_tolerances] = values.map(|list| draws.iter().map(|draw| list[*draw]).collect::<Vec<f64>>());
    let of_variance = variance(&one) / variance(&with_tolerances).max(f64::MIN_POSITIVE);
    covariance_share(&one, &other).map(|share| share * of_variance)
}

fn write(source: &GelSource, found: Prediction, seed: u64, monitor: &dyn Monitor) -> Result<Outcome<Prediction>> {
    monitor.stage("writing results and figures");
    let sentence = format!("{}, {} draws; without measurement noise", found.gel, found.draws);
    let figure =
        figures::prediction::prediction("Prediction of the robot's position", &sentence, &found.scenarios, None)?;
    let document = WithProvenance { provenance: source.provenance("prediction", seed), body: found };
    let json = source.dir.join("prediction.json");
    let json = (json.clone(), to_json(&json, &document)?);
    let csv = (source.dir.join("prediction.csv"), table(&document.body.scenarios));
    let [svg, png, pdf] = figure_files(&source.dir, "prediction", &figure)?;
    write_together(&[&svg, &png, &pdf, &csv, &json].map(|(path, bytes)| (path.as_path(), bytes.as_slice())))?;
    Ok(Outcome { is_sound: document.body.is_sound(), document, written: svg.0, study: source.study.clone() })
}

/// A number with ten significant digits, without trailing zeros.
pub(crate) fn digits(number: f64) -> String {
    ten_digits(number).to_string()
}

/// Table of the positions of all scenarios. Names with commas or quotation marks are quoted.
pub(super) fn table(scenarios: &[ScenarioPrediction]) -> Vec<u8> {
    let mut text = String::from("scenario,time_s,force_un,q05_um,q25_um,median_um,q75_um,q95_um\n");
    for scenario in scenarios {
        let name = format!("\"{}\"", scenario.name.replace('"', "\"\""));
        let x = &scenario.position_um;
        for row in 0..scenario.time_s.len() {
            let numbers = [
                scenario.time_s[row],
                scenario.force_un[row],
                x.q05[row],
                x.q25[row],
                x.median[row],
                x.q75[row],
                x.q95[row],
            ];
            let cells = numbers.map(digits);
            text += &format!("{name},{}\n", cells.join(","));
        }
    }
    text.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::{Robot, RobotShape, Vitreous};

    fn scenario(quantities: Vec<Quantity>) -> Scenario {
        let shape = RobotShape::Sphere { diameter_m: 0.55e-3 };
        let vitreous = Vitreous { diameter_m: 0.02, poisson_ratio: 0.48, density_kg_m3: None };
        let robot = Robot { shape, density_kg_m3: None, offset: None };
        let mut scenario = Scenario::of_robot("bead", robot, vitreous);
        scenario.quantities = quantities;
        scenario
    }

    /// Draws that do not arrive have no part in the share, whatever the duration: the specimens of the others are equal.
    #[test]
    fn draws_without_a_value_have_no_part_in_the_share_of_the_group() {
        let late = f64::INFINITY;
        let one = [1.0, 2.0, 3.0, 4.0, late, 9.0];
        let other = [1.0, 2.0, 3.0, 4.0, 7.0, late];
        let [share, _] = group_share([&one, &other, &one]);
        assert!((share - 1.0).abs() < 1e-12, "{share}");
        // Tolerances that double the deviations of the draws that arrive leave a quarter.
        let [share, _] = group_share([&one, &other, &[1.0, 3.0, 5.0, 7.0, late, late]]);
        assert!((share - 0.25).abs() < 1e-12, "{share}");
    }

    #[test]
    fn a_minority_of_arrivals_gives_no_sensitivities_but_the_reason() {
        let arrival = Quantity::TimeToReach { distance_m: 0.5e-3, within_s: None };
        let scenario = scenario(vec![Quantity::PositionAt { at_s: 3.0, at_least_m: None }, arrival]);
        assert!(without_sensitivity(&scenario, &[1.0, 0.5]).is_empty());
        let found = without_sensitivity(&scenario, &[1.0, 0.314]);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("bead, time to reach 500 µm: 31.4 % of the draws arrive"), "{}", found[0]);
    }
}
