//! `[base.forward]`: a law that another program computes, with the parameters that it takes (formats §2).
//!
//! ```toml
//! [base.forward]
//! url = "http://127.0.0.1:4242"
//! model = "forward"
//! [base.forward.parameters.stiffness_n_per_m]
//! unit = "N/m"
//! prior = { distribution = "log_normal", median = 1.0, log_sd = 0.5 }
//! ```
//!
//! Parameters are handed over in the order in which they stand, in their own units. Where `support` is not given, it is what the prior leaves open.

use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::distribution::Distribution;
use crate::error::Result;
use crate::inference::prior::distribution_of;
use crate::parameter::{Support, named};
use crate::rheology::{Declared, OutsideLaw};
use crate::toml_input::Table;

/// Name of the model, where none is given.
const DEFAULT_MODEL: &str = "forward";
/// Most parameters: learning from few thousand calls ends there.
const MOST_PARAMETERS: usize = 8;
/// What to write for `--forward`.
pub const EXAMPLE: &str = "declare them in a file for `--base`: `[base.forward.parameters.stiffness_n_per_m]` with `unit = \"N/m\"` and `prior = { distribution = \"log_normal\", median = 1.0, log_sd = 0.5 }`, one table a parameter, in the order in which the model takes them";
/// What a URL looks like.
pub const URL_EXAMPLE: &str = "write it as `http://127.0.0.1:4242`";

/// Why a text is no URL that can be asked, if it is none.
///
/// # Errors
/// The reason.
pub fn check_url(url: &str) -> std::result::Result<(), String> {
    if url.starts_with("https:") {
        return Err(format!(
            "`{url}` is encrypted, and this program speaks plain HTTP only, to a model on this machine or through a tunnel"
        ));
    }
    let rest = url.strip_prefix("http://").ok_or_else(|| format!("`{url}` does not begin with `http://`"))?;
    let host = rest.split('/').next().unwrap_or_default();
    if host.is_empty() || url.chars().any(|c| c.is_whitespace() || c.is_control()) || host.contains('@') {
        return Err(format!("`{url}` names no host"));
    }
    Ok(())
}

/// Reads the table `[base.forward]`.
///
/// # Errors
/// [`crate::Error::Input`] with file, line, key and remedy.
pub fn from_toml(table: &Table<'_>) -> Result<&'static OutsideLaw> {
    table.only(&["model", "parameters", "url"])?;
    let url = table.text("url")?.unwrap_or_default();
    if !url.is_empty() {
        check_url(&url).map_err(|found| table.refuse("url", found, URL_EXAMPLE))?;
    }
    let model = table.text("model")?.unwrap_or_else(|| DEFAULT_MODEL.into());
    let parameters = table.required_table("parameters")?;
    let names = parameters.keys_as_they_stand();
    if names.is_empty() || names.len() > MOST_PARAMETERS {
        return Err(table.refuse(
            "parameters",
            format!("{} parameters are declared", names.len()),
            format!("declare one to {MOST_PARAMETERS}"),
        ));
    }
    let declared = names.iter().map(|name| declared(&parameters, name)).collect::<Result<Vec<_>>>()?;
    Ok(OutsideLaw::new(&url, &model, &declared))
}

fn declared(parameters: &Table<'_>, name: &str) -> Result<Declared> {
    let is_identifier = name.starts_with(|first: char| first.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    if !is_identifier {
        return Err(parameters.refuse(
            name,
            format!("`{name}` cannot be the name of a parameter"),
            "use lower-case letters, digits and underscores, a letter first, as in `stiffness_n_per_m`",
        ));
    }
    let of_noise = named(name).is_some_and(|spec| !crate::rheology::BaseLaw::TwoElement.parameters().contains(spec));
    if of_noise && name != "instantaneous_modulus_pa" {
        return Err(parameters.refuse(name, format!("`{name}` is a parameter of the noise"), "give it another name"));
    }
    let own = parameters.required_table(name)?;
    own.only(&["prior", "support", "unit"])?;
    let unit = own.required_text("unit", "unit = \"N/m\"")?;
    let prior = distribution_of(own.required_table("prior")?)?;
    let (lower, upper) = prior.support();
    let support = match own.numbers("support")?.as_deref() {
        None => Support { lower, upper },
        Some(&[from, to]) if from < to => Support { lower: from, upper: to },
        Some(_) => {
            return Err(own.refuse(
                "support",
                "these are no two ends, the lower first",
                "write `support = [0.0, 10.0]`",
            ));
        }
    };
    if lower < support.lower || upper > support.upper {
        return Err(own.refuse(
            "support",
            format!("the prior reaches [{lower}, {upper}], but {name} lies in {support}"),
            "use a prior that stays inside, such as `uniform` or `beta` with `lower` and `upper`",
        ));
    }
    Ok(Declared { name: name.into(), unit, support, prior })
}

/// A law as it is written: parameters keep their order.
pub struct Written<'a>(pub &'a OutsideLaw);

impl Serialize for Written<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        if !self.0.url().is_empty() {
            map.serialize_entry("url", self.0.url())?;
        }
        map.serialize_entry("model", self.0.model())?;
        map.serialize_entry("parameters", &Parameters(self.0))?;
        map.end()
    }
}

struct Parameters<'a>(&'a OutsideLaw);

impl Serialize for Parameters<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for own in self.0.declared() {
            map.serialize_entry(&own.name, &table_of(own))?;
        }
        map.end()
    }
}

fn table_of(own: &Declared) -> toml::Table {
    let mut table = toml::Table::new();
    table.insert("unit".into(), own.unit.clone().into());
    let (lower, upper) = (own.support.lower, own.support.upper);
    if (lower, upper) != own.prior.support() {
        table.insert("support".into(), vec![lower, upper].into());
    }
    let numbers = match own.prior {
        Distribution::LogNormal { median, log_sd } => ("log_normal", vec![("median", median), ("log_sd", log_sd)]),
        Distribution::Normal { mean, sd } => ("normal", vec![("mean", mean), ("sd", sd)]),
        Distribution::HalfNormal { sd } => ("half_normal", vec![("sd", sd)]),
        Distribution::Uniform { lower, upper } => ("uniform", vec![("lower", lower), ("upper", upper)]),
        Distribution::LogUniform { lower, upper } => ("log_uniform", vec![("lower", lower), ("upper", upper)]),
        Distribution::Beta { alpha, beta, lower, upper } => {
            ("beta", vec![("alpha", alpha), ("beta", beta), ("lower", lower), ("upper", upper)])
        }
    };
    let mut prior = toml::Table::new();
    prior.insert("distribution".into(), numbers.0.into());
    prior.extend(numbers.1.into_iter().map(|(key, value)| (key.to_string(), value.into())));
    table.insert("prior".into(), prior.into());
    table
}
