//! Requests, answers and errors of the UM-Bridge protocol.
//!
//! A request is a JSON object: `name` is the model, `input` lists the input vectors, and `config` holds settings. An error is `{"error": {"type",
//! "message"}}`. Its HTTP status is 400, or 500 for a fault of the model.

use serde_json::{Map, Value, json};

use base::error::Error;
use posterior::outside::Endpoint;

/// Number that replaces a log-density of −∞, which JSON cannot express. The lowest finite number makes samplers refuse such a point, even after they add
/// other terms.
pub const NEGATIVE_INFINITY_SUBSTITUTE: f64 = f64::MIN;

/// Version of UM-Bridge.
const VERSION: f64 = 1.0;

/// HTTP answer to a request.
#[derive(Debug, Clone, PartialEq)]
pub struct BridgeResponse {
    /// HTTP status code.
    pub status: u16,
    /// JSON object with the result or the error.
    pub body: Value,
}

/// Reason for refusing a request.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Refusal {
    ModelNotFound(String),
    UnsupportedFeature(String),
    InvalidInput(String),
    /// Fault of the model, with a message.
    InvalidOutput(String),
}

impl Refusal {
    pub fn input(message: impl Into<String>) -> Self {
        Self::InvalidInput(message.into())
    }

    fn answer(self) -> BridgeResponse {
        let (status, kind, message) = match self {
            Self::ModelNotFound(message) => (400, "ModelNotFound", message),
            Self::UnsupportedFeature(message) => (400, "UnsupportedFeature", message),
            Self::InvalidInput(message) => (400, "InvalidInput", message),
            Self::InvalidOutput(message) => (500, "InvalidOutput", message),
        };
        BridgeResponse { status, body: json!({ "error": { "type": kind, "message": message } }) }
    }
}

/// Converts an error of the model into a fault of the request, which asked for a point without a prediction.
impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::InvalidInput(error.to_string())
    }
}

pub(super) type BridgeOutcome<T> = std::result::Result<T, Refusal>;

/// Lengths of the input vector and of the output vector of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct InterfaceSizes {
    pub inputs: usize,
    pub outputs: usize,
}

/// Model with one input vector and one output vector, whose lengths `sizes` returns. `config` holds the settings in the request, or is [`Value::Null`] if
/// the request has none.
pub(super) trait ServedModel: Sync {
    fn name(&self) -> &'static str;
    fn sizes(&self, config: &Value) -> BridgeOutcome<InterfaceSizes>;
    fn evaluate(&self, config: &Value, point: &[f64]) -> BridgeOutcome<Vec<f64>>;
    /// Gradient of the sum of all outputs, each weighted by its entry in `sensitivity`. The result has one number per input.
    fn gradient(&self, config: &Value, point: &[f64], sensitivity: &[f64]) -> BridgeOutcome<Vec<f64>>;
    /// Derivative of each output when the inputs move along `direction`.
    fn apply_jacobian(&self, config: &Value, point: &[f64], direction: &[f64]) -> BridgeOutcome<Vec<f64>>;
}

/// Reads a model's settings from `config`. `T` must refuse unknown settings.
pub(super) fn config_of<T: Default + serde::de::DeserializeOwned>(config: &Value) -> BridgeOutcome<T> {
    if config.is_null() {
        return Ok(T::default());
    }
    T::deserialize(config).map_err(|error| Refusal::input(format!("`config` {config}: {error}")))
}

/// Answers a request to one of `models`. `body` is the JSON text of the request.
pub(super) fn answer(models: &[&dyn ServedModel], endpoint: Endpoint, body: &[u8]) -> BridgeResponse {
    match respond(models, endpoint, body) {
        Ok(body) => BridgeResponse { status: 200, body },
        Err(refusal) => refusal.answer(),
    }
}

fn respond(models: &[&dyn ServedModel], endpoint: Endpoint, body: &[u8]) -> BridgeOutcome<Value> {
    let names: Vec<&str> = models.iter().map(|model| model.name()).collect();
    if endpoint == Endpoint::Info {
        return Ok(json!({ "protocolVersion": VERSION, "models": names }));
    }
    let request: Map<String, Value> = serde_json::from_slice(body)
        .map_err(|error| Refusal::input(format!("the request is not a JSON object: {error}")))?;
    let name = request.get("name").and_then(Value::as_str);
    let name = name.ok_or_else(|| Refusal::input("the request does not give the model's `name`"))?;
    let Some(model) = models.iter().find(|model| model.name() == name) else {
        let known = names.join(", ");
        return Err(Refusal::ModelNotFound(format!("there is no model {name:?}: use one of {known}")));
    };
    let config = request.get("config").unwrap_or(&Value::Null);
    match endpoint {
        Endpoint::Info | Endpoint::ModelInfo => Ok(json!({ "support": {
            "Evaluate": true, "Gradient": true, "ApplyJacobian": true, "ApplyHessian": false,
        } })),
        Endpoint::InputSizes => Ok(json!({ "inputSizes": [model.sizes(config)?.inputs] })),
        Endpoint::OutputSizes => Ok(json!({ "outputSizes": [model.sizes(config)?.outputs] })),
        Endpoint::ApplyHessian => Err(Refusal::UnsupportedFeature(
            "second derivatives are not available: use Gradient or ApplyJacobian".into(),
        )),
        Endpoint::Evaluate => {
            let point = point(&request, model.sizes(config)?)?;
            Ok(json!({ "output": [finite(model.evaluate(config, &point)?)?] }))
        }
        Endpoint::Gradient => {
            let sizes = model.sizes(config)?;
            let point = point(&request, sizes)?;
            let sensitivity = vector(&request, "sens", sizes.outputs)?;
            Ok(json!({ "output": finite(model.gradient(config, &point, &sensitivity)?)? }))
        }
        Endpoint::ApplyJacobian => {
            let sizes = model.sizes(config)?;
            let point = point(&request, sizes)?;
            let direction = vector(&request, "vec", sizes.inputs)?;
            Ok(json!({ "output": finite(model.apply_jacobian(config, &point, &direction)?)? }))
        }
    }
}

/// Reads the input vector from a request. The indices `inWrt` and `outWrt` of input and output vector are optional. They must be 0, because a model has
/// only one vector of each kind.
fn point(request: &Map<String, Value>, sizes: InterfaceSizes) -> BridgeOutcome<Vec<f64>> {
    for key in ["outWrt", "inWrt"] {
        match request.get(key) {
            None => {}
            Some(index) if index.as_u64() == Some(0) => {}
            Some(index) => {
                return Err(Refusal::input(format!("`{key}` is {index}, but there is only one vector, number 0")));
            }
        }
    }
    match request.get("input") {
        Some(Value::Array(vectors)) => match &vectors[..] {
            [vector] => numbers(vector, "input[0]", sizes.inputs),
            _ => Err(Refusal::input(format!("`input` has {} vectors, but the model takes 1", vectors.len()))),
        },
        _ => Err(Refusal::input("`input` is not a list of lists of numbers")),
    }
}

fn vector(request: &Map<String, Value>, key: &str, length: usize) -> BridgeOutcome<Vec<f64>> {
    numbers(request.get(key).unwrap_or(&Value::Null), key, length)
}

fn numbers(value: &Value, key: &str, length: usize) -> BridgeOutcome<Vec<f64>> {
    let Some(values) = value.as_array() else {
        return Err(Refusal::input(format!("`{key}` is not a list of numbers")));
    };
    if values.len() != length {
        return Err(Refusal::input(format!("`{key}` has {} numbers, but the model takes {length}", values.len())));
    }
    let number = |(index, value): (usize, &Value)| {
        value.as_f64().ok_or_else(|| Refusal::input(format!("`{key}[{index}]` is {value}, which is not a number")))
    };
    values.iter().enumerate().map(number).collect()
}

/// Returns the values if all are finite. Otherwise refuses them, because JSON cannot express infinite values or NaN.
fn finite(values: Vec<f64>) -> BridgeOutcome<Vec<f64>> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(values),
        Some(index) => Err(Refusal::InvalidOutput(format!(
            "number {index} of the answer is {}, which JSON cannot express: move the point away from the ends of the supports",
            values[index]
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Test model with the outputs (x₀ x₁, x₀ + x₁, 3).
    struct Simple;

    impl ServedModel for Simple {
        fn name(&self) -> &'static str {
            "simple"
        }
        fn sizes(&self, config: &Value) -> BridgeOutcome<InterfaceSizes> {
            #[derive(Default, serde::Deserialize)]
            #[serde(deny_unknown_fields)]
            struct Nothing {}
            config_of::<Nothing>(config)?;
            Ok(InterfaceSizes { inputs: 2, outputs: 3 })
        }
        fn evaluate(&self, _: &Value, x: &[f64]) -> BridgeOutcome<Vec<f64>> {
            Ok(vec![x[0] * x[1], x[0] + x[1], 3.0])
        }
        fn gradient(&self, _: &Value, x: &[f64], s: &[f64]) -> BridgeOutcome<Vec<f64>> {
            Ok(vec![s[0] * x[1] + s[1], s[0] * x[0] + s[1]])
        }
        fn apply_jacobian(&self, _: &Value, x: &[f64], v: &[f64]) -> BridgeOutcome<Vec<f64>> {
            Ok(vec![v[0] * x[1] + v[1] * x[0], v[0] + v[1], 0.0])
        }
    }

    fn ask(endpoint: Endpoint, body: &str) -> BridgeResponse {
        answer(&[&Simple], endpoint, body.as_bytes())
    }

    fn refused(endpoint: Endpoint, body: &str) -> (String, String) {
        let answer = ask(endpoint, body);
        let error = &answer.body["error"];
        assert_eq!(answer.body.as_object().map(Map::len), Some(1));
        let of = |key: &str| error[key].as_str().unwrap_or_default().to_string();
        assert_eq!(answer.status, if of("type") == "InvalidOutput" { 500 } else { 400 });
        (of("type"), of("message"))
    }

    #[test]
    fn requests_are_answered_in_the_protocols_words() {
        use Endpoint::*;
        assert_eq!(ask(Info, "").body, json!({ "protocolVersion": 1.0, "models": ["simple"] }));
        let label = r#"{"name": "simple""#;
        assert_eq!(ask(InputSizes, &format!("{label}}}")).body, json!({ "inputSizes": [2] }));
        assert_eq!(ask(OutputSizes, &format!("{label}, \"config\": {{}}}}")).body, json!({ "outputSizes": [3] }));
        let at = format!("{label}, \"config\": null, \"input\": [[2, 5.5]]");
        assert_eq!(ask(Evaluate, &format!("{at}}}")).body, json!({ "output": [[11.0, 7.5, 3.0]] }));
        let wrt = format!("{at}, \"outWrt\": 0, \"inWrt\": 0");
        assert_eq!(ask(Gradient, &format!("{wrt}, \"sens\": [1, 10, 100]}}")).body, json!({ "output": [15.5, 12.0] }));
        assert_eq!(ask(ApplyJacobian, &format!("{wrt}, \"vec\": [1, 0]}}")).body, json!({ "output": [5.5, 1.0, 0.0] }));
        assert_eq!(ask(ModelInfo, &format!("{label}}}")).body["support"]["ApplyHessian"], json!(false));
    }

    #[test]
    fn what_is_wrong_is_refused_in_the_protocols_words() {
        use Endpoint::*;
        let label = r#"{"name": "simple""#;
        assert_eq!(refused(Evaluate, r#"{"name": "other"}"#).0, "ModelNotFound");
        // The request for a Hessian, which no model has, is refused before its other contents are checked.
        assert_eq!(refused(ApplyHessian, &format!("{label}}}")).0, "UnsupportedFeature");
        for (endpoint, rest, words) in [
            (Evaluate, "", "`input` is not a list"),
            (Evaluate, ", \"input\": [[1, 2], [3]]", "2 vectors"),
            (Evaluate, ", \"input\": [[1, 2, 3]]", "`input[0]` has 3 numbers, but the model takes 2"),
            (Evaluate, ", \"input\": [[1, \"x\"]]", "`input[0][1]` is \"x\""),
            (Evaluate, ", \"input\": [1, 2]", "2 vectors"),
            (Evaluate, ", \"input\": [[1, 2]], \"config\": {\"modle\": 1}", "modle"),
            (Evaluate, ", \"input\": [[1, 2]], \"config\": 3", "`config` 3"),
            (Gradient, ", \"input\": [[1, 2]], \"outWrt\": 1, \"inWrt\": 0, \"sens\": [1, 2, 3]", "`outWrt` is 1"),
            (Gradient, ", \"input\": [[1, 2]], \"outWrt\": 0, \"inWrt\": -1, \"sens\": [1, 2, 3]", "`inWrt` is -1"),
            (Gradient, ", \"input\": [[1, 2]], \"outWrt\": 0, \"inWrt\": 0, \"sens\": [1, 2]", "`sens` has 2"),
            (ApplyJacobian, ", \"input\": [[1, 2]], \"vec\": 5", "`vec` is not a list"),
        ] {
            let (kind, message) = refused(endpoint, &format!("{label}{rest}}}"));
            assert!(kind == "InvalidInput" && message.contains(words), "{rest}: {kind}, {message}");
        }
        for body in ["", "[]", "{", "{\"name\": 3}", "\u{0}"] {
            assert_eq!(refused(Evaluate, body).0, "InvalidInput", "{body}");
        }
        let (kind, message) = refused(Evaluate, &format!("{label}, \"input\": [[1e200, 1e200]]}}"));
        assert!(kind == "InvalidOutput" && message.contains("number 0 of the answer is inf"), "{kind}, {message}");
    }
}
