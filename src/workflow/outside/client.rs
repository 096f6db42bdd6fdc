//! Somebody else's model as UM-Bridge 1.0 asks it: one vector of parameters → positions in µm.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use serde_json::{Value, json};

use super::http::{Address, Answer, Failure, request};
use crate::error::{Error, Result};
use crate::experiment::ForceRule;
use crate::rheology::OutsideLaw;
use crate::surrogate::trajectory::Drive;

/// Longest time that one answer may take.
const PATIENCE: Duration = Duration::from_secs(600);
const UM_PER_M: f64 = 1e6;
/// Most characters of a server's own words that an error repeats.
const MOST_WORDS: usize = 400;

/// A model that answers at a URL.
#[derive(Clone)]
pub(super) struct Client<'a> {
    law: &'a OutsideLaw,
    address: Address,
    patience: Duration,
    stop: Option<&'a AtomicBool>,
}

impl<'a> Client<'a> {
    /// Of a law; `stop` ends every call.
    pub fn new(law: &'a OutsideLaw, stop: Option<&'a AtomicBool>) -> Self {
        Self { law, address: Address::of(law.url()), patience: PATIENCE, stop }
    }

    /// What goes along with every request: times, the force at them, what it does between them, and the parameters' names.
    fn config(&self, drive: &Drive) -> Value {
        let names: Vec<&str> = self.law.parameters().iter().map(|spec| spec.name).collect();
        json!({
            "time_s": drive.time_s,
            "force_n": drive.force.at_rows_n,
            "force_between_rows": ForceRule::name(drive.force.rule),
            "parameters": names,
        })
    }

    /// Refuses a server that has no such model, or one of other sizes.
    ///
    /// # Errors
    /// [`Error::Numerical`] with what is there instead; those of asking.
    pub fn greet(&self, drive: &Drive) -> Result<()> {
        let info = self.ask("/Info", None)?;
        let models: Vec<&str> = info["models"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        if !models.contains(&self.law.model()) {
            return Err(Error::numerical(
                format!(
                    "the server at {} has no model `{}`; it has {}",
                    self.law.url(),
                    self.law.model(),
                    models.join(", ")
                ),
                "name one of its models, as `model` in [base.forward]",
            ));
        }
        let body = json!({ "name": self.law.model(), "config": self.config(drive) });
        let sizes = |answer: &Value, key: &str| -> Vec<u64> {
            answer[key].as_array().into_iter().flatten().filter_map(Value::as_u64).collect()
        };
        let inputs = sizes(&self.ask("/InputSizes", Some(&body))?, "inputSizes");
        let n_parameters = self.law.parameters().len();
        if inputs != [n_parameters as u64] {
            return Err(Error::numerical(
                format!(
                    "the model `{}` takes vectors of {inputs:?} numbers, and {n_parameters} parameters are declared",
                    self.law.model()
                ),
                "declare in [base.forward.parameters] what the model takes: one vector, in its order",
            ));
        }
        let outputs = sizes(&self.ask("/OutputSizes", Some(&body))?, "outputSizes");
        if outputs != [drive.time_s.len() as u64] {
            return Err(Error::numerical(
                format!(
                    "the model `{}` answers vectors of {outputs:?} numbers, and the record has {} rows",
                    self.law.model(),
                    drive.time_s.len()
                ),
                "let it answer one vector: the position in µm at every time in `config[\"time_s\"]`",
            ));
        }
        Ok(())
    }

    /// Positions (m) at the record's rows under a force.
    ///
    /// # Errors
    /// [`Error::Numerical`] where the model cannot be asked, refuses, or answers what is no trajectory; [`Error::Interrupted`] when stopped.
    pub fn evaluate(&self, parameters: &[f64], drive: &Drive) -> Result<Vec<f64>> {
        let body = json!({ "name": self.law.model(), "input": [parameters], "config": self.config(drive) });
        let answer = self.ask("/Evaluate", Some(&body))?;
        let output = answer["output"].as_array().and_then(|vectors| vectors.first()?.as_array());
        let output = output.ok_or_else(|| {
            self.refuse("answers without a vector in `output`".into(), "let it answer `{\"output\": [[…]]}`")
        })?;
        if output.len() != drive.time_s.len() {
            return Err(self.refuse(
                format!("answers {} numbers for {} times", output.len(), drive.time_s.len()),
                "let it answer the position in µm at every time in `config[\"time_s\"]`, whose number differs from call to call",
            ));
        }
        let numbers: Vec<f64> = output.iter().map(|x| x.as_f64().unwrap_or(f64::NAN)).collect();
        if let Some(row) = numbers.iter().position(|x| !x.is_finite()) {
            return Err(self.refuse(
                format!("answers {} at {} s for {}", output[row], drive.time_s[row], self.point(parameters)),
                "let it answer finite numbers over the whole box of the priors, or narrow these",
            ));
        }
        Ok(drive.rows.iter().map(|row| numbers[*row] / UM_PER_M).collect())
    }

    fn point(&self, parameters: &[f64]) -> String {
        let named =
            self.law.parameters().iter().zip(parameters).map(|(spec, value)| format!("{} = {value:.6e}", spec.name));
        named.collect::<Vec<_>>().join(", ")
    }

    fn refuse(&self, what: String, remedy: &str) -> Error {
        Error::numerical(format!("somebody else's model at {} {what}", self.law.url()), remedy)
    }

    fn ask(&self, path: &str, body: Option<&Value>) -> Result<Value> {
        let text = body.map(Value::to_string);
        let Answer { status, body } = request(&self.address, path, text.as_deref(), self.patience, self.stop)
            .map_err(|failure| self.failed(&failure))?;
        let answer: Option<Value> = serde_json::from_str(&body).ok();
        let said = answer.as_ref().and_then(|answer| answer["error"]["message"].as_str()).map(String::from);
        if status != 200 || said.is_some() {
            let words: String = said.unwrap_or(body).chars().take(MOST_WORDS).collect();
            return Err(self.refuse(
                format!("refuses {path} with HTTP status {status}: {}", words.trim()),
                "see what the model's own program says, and ask it by a client of UM-Bridge first",
            ));
        }
        answer.ok_or_else(|| {
            let words: String = body.chars().take(MOST_WORDS).collect();
            self.refuse(format!("answers {path} with what is no JSON: {}", words.trim()), "let it speak UM-Bridge 1.0")
        })
    }

    fn failed(&self, failure: &Failure) -> Error {
        match failure {
            Failure::Unreachable(why) => self
                .refuse(format!("cannot be reached: {why}"), "start it, and give its address by `--forward http://…`"),
            Failure::TimeOut => self.refuse(
                format!("has not answered for {} s", self.patience.as_secs_f64()),
                "use a faster model, or fewer rows",
            ),
            Failure::NotHttp(why) => {
                self.refuse(format!("does not speak HTTP: {why}"), "give the address of a server of UM-Bridge 1.0")
            }
            Failure::Stopped => Error::Interrupted { kept: "nothing was learnt of somebody else's model".into() },
        }
    }
}

#[cfg(test)]
#[path = "client_tests.rs"]
mod tests;
