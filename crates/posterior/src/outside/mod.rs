//! Model of an external program, which replaces the base law and is evaluated by UM-Bridge (docs/serve.md). The module `client` implements HTTP, `full` the forward
//! model, and this file the protocol.

pub mod client;
mod endpoint;
mod full;

pub use endpoint::Endpoint;

pub use full::ExternalForward;

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::cache::{self, ModelInputs};
use super::monitor::SilentMonitor;
use base::error::{Error, Result, Setting};
use client::Client;
use laws::rheology::ExternalLaw;
use models::model::TrainedRange;
use models::surrogate::trajectory::Clock;
use record::{Force, Record};

/// Name of the server's model that is tried first if the user names no model.
const USUAL_NAME: &str = "forward";
/// Factor by which the force is increased in the test that the program uses the force.
const OTHER_FORCE: f64 = 1.25;
/// Largest relative change of the positions that counts as a rounding error.
const LEAST_CHANGE: f64 = 1e-9;

/// Content of a response in the cache: position (µm) at each requested time.
#[derive(Serialize, Deserialize)]
struct KeptResponse {
    position_um: Vec<f64>,
}

/// Model of an external program, which a server evaluates, with its properties.
#[derive(Debug)]
pub struct ExternalModel {
    client: Client,
    /// Name of the model on the server.
    name: String,
    law: &'static ExternalLaw,
    takes_force: bool,
    /// Positions (µm) at the prior's medians. They identify the model, so that cached responses of another model are not used.
    at_medians_um: Vec<f64>,
    /// Reason why the model predicts only under the record's own force; `None` if it accepts other forces.
    other_force_refusal: Option<String>,
    /// Parameter ranges of the surrogate. All models of the experiment share these ranges, so that the models are comparable.
    trained_box: OnceLock<TrainedBox>,
}

/// Parameter ranges in which the surrogate of an external program was trained, and the surrogate's allowed error divided by the noise.
#[derive(Debug)]
pub struct TrainedBox {
    pub trained: Vec<TrainedRange>,
    pub allowed: f64,
}

impl ExternalModel {
    /// Connects to the server. It requests the model, the lengths of its vectors and its prediction at `medians`. It then tests if the model accepts times and forces
    /// that differ from the record's.
    ///
    /// # Errors
    /// [`Error::Input`] for an invalid address; [`Error::Numerical`] for a server that cannot be reached, or whose model does not follow docs/serve.md.
    pub fn connect(law: &'static ExternalLaw, record: &Record, medians: &[f64]) -> Result<Self> {
        let client = Client::new(law.url())?;
        let name = name_of(&client, law.model())?;
        let info = client.send(Endpoint::ModelInfo, &json!({ "name": name }))?;
        if info.pointer("/support/Evaluate") != Some(&Value::Bool(true)) {
            return Err(Error::numerical(
                format!("the model `{name}` at {} does not support Evaluate", client.url()),
                format!("name another model with {}", Setting::ForwardModel),
            ));
        }
        let mut external_model = Self {
            client,
            name,
            law,
            takes_force: false,
            at_medians_um: Vec::new(),
            other_force_refusal: None,
            trained_box: OnceLock::new(),
        };
        let (time_s, force) = (&record.time_s[..], record.force());
        external_model.takes_force = external_model.check_sizes(time_s, force)?;
        external_model.at_medians_um = external_model.fresh_um(medians, time_s, force)?;
        external_model.other_force_refusal = external_model.other_force_refusal(record, medians).err().map(|error| {
            let text = error.to_string();
            text.lines().next().unwrap_or_default().to_string()
        });
        Ok(external_model)
    }

    /// Name of the model with the server's address.
    pub fn title(&self) -> String {
        format!("`{}` at {}", self.name, self.client.url())
    }

    /// Reason why the external model predicts only under the record's own force; `None` if it accepts other forces. If there is a reason, effects of load cannot be
    /// used.
    pub fn force_refusal(&self) -> Option<&str> {
        self.other_force_refusal.as_deref()
    }

    /// Parameter ranges in which the surrogate was trained; `None` before the training.
    pub fn trained_box(&self) -> Option<&TrainedBox> {
        self.trained_box.get()
    }

    /// Stores the parameter ranges in which the surrogate was trained, unless ranges are already stored.
    pub(super) fn store_trained_box(&self, ground: TrainedBox) {
        self.trained_box.get_or_init(|| ground);
    }

    /// Position (m) at the times `time_s` under a force that holds or is linear between them. `parameters` are the values of the law's parameters, in their units. The
    /// response is cached, so that each request is sent only once.
    ///
    /// # Errors
    /// [`Error::Numerical`] with the server's message, or if the response is invalid.
    pub fn position_m(&self, parameters: &[f64], time_s: &[f64], force: Force<'_>) -> Result<Vec<f64>> {
        let built_from = self.built_from(parameters, time_s, force);
        // If a cached response cannot be used, it is requested again without a warning, because this takes little time.
        let kept = cache::read::<KeptResponse>(&built_from, &SilentMonitor)
            .filter(|kept| kept.position_um.len() == time_s.len());
        let answer = match kept {
            Some(kept) => kept,
            None => {
                let fresh = KeptResponse { position_um: self.fresh_um(parameters, time_s, force)? };
                cache::write(&built_from, &fresh);
                fresh
            }
        };
        Ok(answer.position_um.iter().map(|x| 1e-6 * x).collect())
    }

    /// All inputs on which a response depends; their hash names the cached response.
    fn built_from(&self, parameters: &[f64], time_s: &[f64], force: Force<'_>) -> ModelInputs {
        let names: Vec<&str> = self.law.parameters().iter().map(|spec| spec.name).collect();
        ModelInputs::new("answer of another program")
            .with("url", self.client.url())
            .with("name", &self.name)
            .with("parameters", (names, parameters))
            .with_record(time_s, force)
            .with_numbers("answer at the prior's medians, um", &self.at_medians_um)
    }

    fn config(&self, time_s: &[f64], force: Force<'_>) -> Value {
        let names: Vec<&str> = self.law.parameters().iter().map(|spec| spec.name).collect();
        json!({ "time_s": time_s, "force_n": force.at_rows_n, "force_between": force.rule.name(), "parameters": names })
    }

    /// Checks the lengths of the model's input and output vectors. Returns true if the model takes the force as a second input vector.
    fn check_sizes(&self, time_s: &[f64], force: Force<'_>) -> Result<bool> {
        let request = json!({ "name": self.name, "config": self.config(time_s, force) });
        let (n, n_times) = (self.law.parameters().len(), time_s.len());
        let inputs = self.client.send(Endpoint::InputSizes, &request)?;
        let outputs = self.client.send(Endpoint::OutputSizes, &request)?;
        let sizes = |answer: &Value, key: &str| -> Option<Vec<u64>> {
            answer.get(key)?.as_array()?.iter().map(Value::as_u64).collect()
        };
        let refuse = |what: &str, found: &Value, wanted: String, remedy: &str| {
            let found = format!("{} has {what} of sizes {found}, but {wanted}", self.title());
            Err(Error::numerical(found, remedy))
        };
        let names: Vec<&str> = self.law.parameters().iter().map(|spec| spec.name).collect();
        let takes_force = match sizes(&inputs, "inputSizes").as_deref() {
            Some([n_numbers]) if *n_numbers == n as u64 => false,
            Some([number, of_force]) if *number == n as u64 && *of_force == n_times as u64 => true,
            _ => {
                let wanted =
                    format!("the prior names {n} parameters ({}) and the config has {n_times} times", names.join(", "));
                let remedy = "let the inputs be [parameters], or [parameters, forces at config's time_s]; name the parameters in the prior file, in the model's order";
                return refuse("inputs", inputs.get("inputSizes").unwrap_or(&inputs), wanted, remedy);
            }
        };
        if sizes(&outputs, "outputSizes").as_deref() != Some(&[n_times as u64]) {
            let wanted = format!("config's time_s has {n_times} times");
            let remedy = "let the output be one vector: the position in micrometres at each of config's time_s";
            return refuse("outputs", outputs.get("outputSizes").unwrap_or(&outputs), wanted, remedy);
        }
        Ok(takes_force)
    }

    fn fresh_um(&self, parameters: &[f64], time_s: &[f64], force: Force<'_>) -> Result<Vec<f64>> {
        let input = if self.takes_force { json!([parameters, force.at_rows_n]) } else { json!([parameters]) };
        let request = json!({ "name": self.name, "input": input, "config": self.config(time_s, force) });
        let named: Vec<String> =
            self.law.parameters().iter().zip(parameters).map(|(spec, x)| format!("{} = {x}", spec.name)).collect();
        let at = |error: Error| match error {
            Error::Numerical { what, remedy } => Error::numerical(format!("{what} (at {})", named.join(", ")), remedy),
            other => other,
        };
        let answer = self.client.send(Endpoint::Evaluate, &request).map_err(at)?;
        let output = answer.get("output").and_then(Value::as_array);
        let [Value::Array(position_um)] = output.map_or(&[][..], Vec::as_slice) else {
            return Err(Error::numerical(
                format!("the response of {} to Evaluate does not have exactly one vector under `output`", self.title()),
                "let it respond with {\"output\": [[…]]}: the position in micrometres at each of config's time_s",
            ));
        };
        if position_um.len() != time_s.len() {
            return Err(Error::numerical(
                format!(
                    "{} responds with {} positions, but the request has {} times",
                    self.title(),
                    position_um.len(),
                    time_s.len()
                ),
                "let the output be the position in micrometres at each of config's time_s",
            ));
        }
        let number = |value: &Value| value.as_f64().filter(|x| x.is_finite());
        position_um
            .iter()
            .map(|value| number(value).ok_or_else(|| at(self.client.not_finite(&value.to_string()))))
            .collect()
    }

    /// Tests if the model accepts times between the rows and a force that differs from the record's. The error states that the model ignores the force, or gives
    /// another cause.
    fn other_force_refusal(&self, record: &Record, medians: &[f64]) -> Result<()> {
        let (time_s, force) = (&record.time_s, record.force());
        let clock = Clock::finer(time_s, force);
        let stronger_n: Vec<f64> = clock.commanded_n(time_s, force).iter().map(|f| OTHER_FORCE * f).collect();
        let stronger = Force { at_rows_n: &stronger_n, ..force };
        let takes_force = self.check_sizes(&clock.time_s, stronger)?;
        let moved_m = self.position_m(medians, &clock.time_s, stronger)?;
        let most_um = self.at_medians_um.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let change_um =
            clock.rows.iter().zip(&self.at_medians_um).map(|(row, median_um)| (1e6 * moved_m[*row] - median_um).abs());
        if takes_force != self.takes_force || change_um.fold(0.0, f64::max) <= LEAST_CHANGE * most_um {
            let found = format!("{} ignores the forces that it is given", self.title());
            return Err(Error::numerical(
                found,
                "let it take the forces from its second input, or from config's force_n",
            ));
        }
        Ok(())
    }
}

/// Name of the model to use: the name that the user wants, else [`USUAL_NAME`], else the server's only model.
fn name_of(client: &Client, wanted: Option<&str>) -> Result<String> {
    let info = client.send(Endpoint::Info, &Value::Null)?;
    let models: Vec<&str> = info
        .get("models")
        .and_then(Value::as_array)
        .map_or(Vec::new(), |models| models.iter().filter_map(Value::as_str).collect());
    let is_there = |name: &str| models.contains(&name);
    match (wanted, &models[..]) {
        (Some(wanted), _) if is_there(wanted) => Ok(wanted.into()),
        (None, _) if is_there(USUAL_NAME) => Ok(USUAL_NAME.into()),
        (None, [only]) => Ok((*only).into()),
        _ => {
            let found = match wanted {
                Some(wanted) => format!("{} has no model `{wanted}`", client.url()),
                None => format!("{} has several models or none, and no model is called `{USUAL_NAME}`", client.url()),
            };
            let names = if models.is_empty() { "none".into() } else { models.join(", ") };
            Err(Error::numerical(
                found,
                format!("name one of its models with {}; it has {names}", Setting::ForwardModel),
            ))
        }
    }
}
