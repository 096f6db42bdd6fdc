//! Law that an external program computes, given by the program's address, the model's name and its parameters (docs/serve.md).
//!
//! ```toml
//! [base.forward]
//! url = "http://127.0.0.1:4242"
//! model = "forward"
//! parameters = [{ name = "spring_pa", unit = "Pa" }, { name = "order", unit = "1" }]
//! ```

use std::sync::{Mutex, PoisonError};

use base::error::Result;
use base::parameter::{ParameterSpec, Support};
use base::toml_input::TomlTable;

/// All distinct external laws that the program has created so far.
static LAWS: Mutex<Vec<&'static ExternalLaw>> = Mutex::new(Vec::new());
const KEYS: [&str; 3] = ["url", "model", "parameters"];
const PARAMETERS: &str = "parameters = [{ name = \"spring_pa\", unit = \"Pa\" }]";
/// Largest number of parameters of an external law. A surrogate with more parameters would need too many calls.
pub const MOST_PARAMETERS: usize = 8;

/// Law that an external program computes as a server, with the server's address, the model's name and its parameters.
#[derive(Debug, PartialEq)]
pub struct ExternalLaw {
    url: String,
    model: Option<String>,
    parameters: Vec<ParameterSpec>,
}

impl ExternalLaw {
    /// Returns the law that the server at the address `url` computes. `model` names one of the server's models; `None` stands for
    /// the model `forward`, or else for the only one that it offers. `parameters` are pairs of name and unit, in the server's
    /// order. Equal laws share one reference.
    pub fn new(url: &str, model: Option<&str>, parameters: &[(String, String)]) -> &'static Self {
        let is_same = |law: &&&Self| {
            let map = law.parameters.iter().map(|spec| (spec.name, spec.unit));
            let other = parameters.iter().map(|(name, unit)| (name.as_str(), unit.as_str()));
            law.url == url && law.model.as_deref() == model && map.eq(other)
        };
        // A law lives as long as the program, because laws are copied into every forward model and thread.
        let mut laws = LAWS.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = laws.iter().find(is_same) {
            return known;
        }
        let kept = |text: &str| -> &'static str { Box::leak(text.to_string().into_boxed_str()) };
        let spec = |(name, unit): &(String, String)| match base::parameter::named(name) {
            Some(known) if known.unit == unit => *known,
            _ => ParameterSpec::new(kept(name), "", kept(unit), Support::POSITIVE),
        };
        let parameters = parameters.iter().map(spec).collect();
        let law: &'static Self =
            Box::leak(Box::new(Self { url: url.to_string(), model: model.map(String::from), parameters }));
        laws.push(law);
        law
    }

    /// Reads the table `[base.forward]`.
    ///
    /// # Errors
    /// [`base::Error::Input`] with file, line, key and remedy.
    pub fn from_toml(table: &TomlTable<'_>) -> Result<&'static Self> {
        table.only(&KEYS)?;
        let url = table.required_text("url", "url = \"http://127.0.0.1:4242\"")?;
        let model = table.text("model")?;
        let mut parameters: Vec<(String, String)> = Vec::new();
        for entry in table.tables("parameters", PARAMETERS)? {
            entry.only(&["name", "unit"])?;
            let name = entry.required_text("name", "name = \"spring_pa\"")?;
            let unit = entry.required_text("unit", "unit = \"Pa\"")?;
            if let Some((found, remedy)) = Self::check_name(&name, parameters.iter().map(|(name, _)| name.as_str())) {
                return Err(entry.refuse("name", found, remedy));
            }
            parameters.push((name, unit));
        }
        if parameters.is_empty() || parameters.len() > MOST_PARAMETERS {
            let found = format!("{} parameters", parameters.len());
            let remedy =
                format!("give one to {MOST_PARAMETERS}, as in `{PARAMETERS}`, in the order of the model's input");
            return Err(table.refuse("parameters", found, remedy));
        }
        Ok(Self::new(&url, model.as_deref(), &parameters))
    }

    /// Checks the name of a parameter. Returns a description of the fault and its remedy; `None` if the name is valid. `before`
    /// are the names of the earlier parameters.
    pub fn check_name<'a>(name: &str, mut before: impl Iterator<Item = &'a str>) -> Option<(String, String)> {
        if !super::network::is_identifier(name) {
            let found = format!("`{name}` cannot be the name of a parameter");
            return Some((found, "use lower-case letters, digits and underscores, a letter first".into()));
        }
        before.any(|other| other == name).then(|| (format!("`{name}` occurs twice"), "name each parameter once".into()))
    }

    /// Returns the law as the TOML table that [`Self::from_toml`] reads.
    pub fn to_toml_value(&self) -> toml::Value {
        let text = |text: &str| toml::Value::String(text.into());
        let entry = |spec: &ParameterSpec| {
            let pairs = [("name", spec.name), ("unit", spec.unit)];
            toml::Value::Table(pairs.map(|(key, value)| (key.to_string(), text(value))).into_iter().collect())
        };
        let mut table = toml::Table::from_iter([
            ("url".to_string(), text(&self.url)),
            ("parameters".to_string(), toml::Value::Array(self.parameters.iter().map(entry).collect())),
        ]);
        if let Some(model) = &self.model {
            table.insert("model".into(), text(model));
        }
        toml::Value::Table(table)
    }

    /// Returns the named parameter from any external law that the program has created; `None` if there is none.
    pub fn parameter_named(name: &str) -> Option<ParameterSpec> {
        let laws = LAWS.lock().unwrap_or_else(PoisonError::into_inner);
        laws.iter().flat_map(|law| &law.parameters).find(|spec| spec.name == name).copied()
    }

    /// Address of the server.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Name of the server's model; `None` stands for the model `forward`, or else for the only one that the server offers.
    pub fn model(&self) -> Option<&str> {
        self.model.as_deref()
    }

    /// Parameters of the law, in the order of the model's input. All are positive.
    pub fn parameters(&self) -> &[ParameterSpec] {
        &self.parameters
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::toml_input::TomlInput;

    fn read(text: &str) -> Result<&'static ExternalLaw> {
        let document = TomlInput::parse("law.toml".as_ref(), text)?;
        ExternalLaw::from_toml(&document.root())
    }

    #[test]
    fn a_law_survives_being_written_and_is_kept_once() {
        let text = "url = \"http://h:1\"\nmodel = \"m\"\nparameters = [{ name = \"a_pa\", unit = \"Pa\" }, { name = \"n\", unit = \"1\" }]";
        let law = read(text).unwrap();
        let again = read(&toml::to_string(&law.to_toml_value()).unwrap()).unwrap();
        assert!(std::ptr::eq(law, again));
        assert!(!std::ptr::eq(law, read(&text.replace("h:1", "h:2")).unwrap()));
        let names: Vec<&str> = law.parameters().iter().map(|spec| spec.name).collect();
        assert_eq!((names, law.model()), (vec!["a_pa", "n"], Some("m")));
    }

    #[test]
    fn mistakes_are_named_with_their_line_and_remedy() {
        let cases = [
            ("parameters = []", "url", "http://127.0.0.1:4242"),
            ("url = \"http://h\"\nparameters = []", "line 2", "in the order of the model's input"),
            ("url = \"http://h\"\nparameters = [{ name = \"A b\", unit = \"Pa\" }]", "line 2", "lower-case"),
            (
                "url = \"http://h\"\nparameters = [{ name = \"a\", unit = \"Pa\" }, { name = \"a\", unit = \"Pa\" }]",
                "twice",
                "once",
            ),
            ("url = \"http://h\"\nparameters = [{ name = \"a\" }]", "unit", "unit = \"Pa\""),
        ];
        for (text, found, remedy) in cases {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(found) && message.contains(remedy), "{text}\n{message}");
        }
    }
}
