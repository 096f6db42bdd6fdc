//! `model.toml`: which model a revision is (contracts §2).

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::document::{Document, text_of};
use crate::error::{Error, Place, Result};
use crate::files::write_atomically;
use crate::inference::prior::{BASE_PARAMETERS, PriorSet};
use crate::rheology::BaseLaw;
use crate::units::nearest_name;

/// Effects that this version has.
pub const AVAILABLE_EFFECTS: &[&str] = &[];
/// Noise models that this version has.
pub const AVAILABLE_NOISE: &[&str] = &["white"];

/// A model: base law, effects, noise, priors, and parameters that are not inferred.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelSpecification {
    /// Name of the base law.
    pub base: String,
    /// Slugs of the effects, in order.
    pub effects: Vec<String>,
    /// Noise models.
    pub noise: Vec<String>,
    /// Name or file of the priors.
    pub prior: String,
    /// Parameters held at a value, in their own units.
    #[serde(default)]
    pub fixed: BTreeMap<String, f64>,
}

impl Default for ModelSpecification {
    fn default() -> Self {
        Self {
            base: BaseLaw::default().name().into(),
            effects: Vec::new(),
            noise: vec!["white".into()],
            prior: PriorSet::embedded_names().next().unwrap_or("porcine").into(),
            fixed: BTreeMap::new(),
        }
    }
}

/// Where each part of a specification stands, for messages.
struct Places<'p> {
    of: &'p dyn Fn(&str) -> Place,
}

impl ModelSpecification {
    /// Reads and checks a `model.toml`; only `base` must be there.
    ///
    /// # Errors
    /// [`Error::File`] if it cannot be read, [`Error::Input`] with file, line, key and remedy if it is not acceptable.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path)
            .map_err(|source| Error::at_path("read", path, source, "give a revision that is complete"))?;
        Self::from_text(path, &bytes)
    }

    /// The same from TOML in memory; `file` is only named in errors.
    ///
    /// # Errors
    /// As [`ModelSpecification::read`].
    pub fn from_text(file: &Path, bytes: &[u8]) -> Result<Self> {
        let document = Document::parse(file, text_of(file, bytes)?)?;
        let root = document.root();
        root.only(&["base", "effects", "fixed", "noise", "prior"])?;
        let default = Self::default();
        let fixed_table = root.table("fixed")?;
        let mut fixed = BTreeMap::new();
        if let Some(table) = fixed_table {
            for name in table.keys() {
                fixed.insert(name.to_string(), table.required_number(name, &format!("{name} = 1.0"))?);
            }
        }
        let base = match root.table("base") {
            Ok(Some(_)) => {
                return Err(root.refuse(
                    "base",
                    "networks are not available in this version",
                    available(&BaseLaw::NAMED.map(BaseLaw::name)),
                ));
            }
            _ => root.required_text("base", "base = \"lethersich\"")?,
        };
        let specification = Self {
            base,
            effects: root.texts("effects")?.unwrap_or_default(),
            noise: root.texts("noise")?.unwrap_or(default.noise),
            prior: root.text("prior")?.unwrap_or(default.prior),
            fixed,
        };
        let place = |key: &str| match key.strip_prefix("fixed.") {
            Some(name) => fixed_table.map_or(root.place("fixed"), |table| table.place(name)),
            None => root.place(key),
        };
        specification.check(&Places { of: &place })?;
        Ok(specification)
    }

    /// From the options `--base`, `--with`, `--noise`, `--prior` and `--set NAME=VALUE`; what is absent keeps its default.
    ///
    /// # Errors
    /// [`Error::Input`] that names the option.
    pub fn from_options(
        base: Option<&str>,
        effects: &[String],
        noise: &[String],
        prior: Option<&str>,
        set: &[String],
    ) -> Result<Self> {
        let mut specification = Self { effects: effects.to_vec(), ..Self::default() };
        if let Some(base) = base {
            specification.base = base.into();
        }
        if !noise.is_empty() {
            specification.noise = noise.to_vec();
        }
        if let Some(prior) = prior {
            specification.prior = prior.into();
        }
        for assignment in set {
            let (name, value) = assignment_from(assignment)?;
            if specification.fixed.insert(name.clone(), value).is_some() {
                return Err(Error::input(
                    Place::option("--set"),
                    format!("{name} is set twice"),
                    "set each parameter once",
                ));
            }
        }
        let place = |key: &str| {
            Place::option(match key {
                "base" => "--base",
                "effects" => "--with",
                "noise" => "--noise",
                "prior" => "--prior",
                _ => "--set",
            })
        };
        specification.check(&Places { of: &place })?;
        Ok(specification)
    }

    /// Writes `model.toml`, whole or not at all.
    ///
    /// # Errors
    /// [`Error::File`] if the operating system refuses.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = toml::to_string(self).map_err(|error| {
            Error::numerical(
                format!("the model cannot be written as TOML: {error}"),
                "report this with the command that was run",
            )
        })?;
        write_atomically(path, text.as_bytes())
    }

    fn check(&self, places: &Places<'_>) -> Result<()> {
        check_known(places, "base", std::slice::from_ref(&self.base), &BaseLaw::NAMED.map(BaseLaw::name))?;
        check_known(places, "effects", &self.effects, AVAILABLE_EFFECTS)?;
        check_known(places, "noise", &self.noise, AVAILABLE_NOISE)?;
        if self.noise.is_empty() {
            return Err(Error::input((places.of)("noise"), "no noise model is named", "write `noise = [\"white\"]`"));
        }
        for (name, value) in &self.fixed {
            let place = (places.of)(&format!("fixed.{name}"));
            let Some(spec) = BASE_PARAMETERS.iter().find(|spec| spec.name == name) else {
                let names: Vec<&str> = BASE_PARAMETERS.iter().map(|spec| spec.name).collect();
                let near = nearest_name(name, names.iter().copied());
                let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
                let remedy = format!("{hint}this model has {}", names.join(", "));
                return Err(Error::input(place, format!("unknown parameter `{name}`"), remedy));
            };
            // Every base parameter is a scale that divides somewhere, so an end of the support is out, too.
            if !(value.is_finite() && spec.support.contains(*value) && *value > spec.support.lower) {
                return Err(Error::input(
                    place,
                    format!("{name} = {value} is outside its support"),
                    format!("give a finite value above {} in {}", spec.support.lower, spec.unit),
                ));
            }
        }
        Ok(())
    }
}

fn available(names: &[&str]) -> String {
    if names.is_empty() {
        "leave it out: this version has none".to_string()
    } else {
        format!("this version has: {}", names.join(", "))
    }
}

fn check_known(places: &Places<'_>, key: &str, names: &[String], known: &[&str]) -> Result<()> {
    for (index, name) in names.iter().enumerate() {
        if !known.contains(&name.as_str()) {
            let near = nearest_name(name, known.iter().copied());
            let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
            let remedy = format!("{hint}{}", available(known));
            return Err(Error::input((places.of)(key), format!("`{name}` is not available"), remedy));
        }
        if names[..index].contains(name) {
            return Err(Error::input((places.of)(key), format!("`{name}` is named twice"), "name it once"));
        }
    }
    Ok(())
}

fn assignment_from(text: &str) -> Result<(String, f64)> {
    let refuse = |found: String| {
        Error::input(Place::option("--set"), found, "write NAME=VALUE, as in `--set young_modulus_pa=3.5`")
    };
    let (name, value) = text.split_once('=').ok_or_else(|| refuse(format!("`{text}` has no `=`")))?;
    let number = value.trim().parse::<f64>().map_err(|_| refuse(format!("`{value}` is not a number")))?;
    Ok((name.trim().to_string(), number))
}

#[cfg(test)]
#[path = "model_specification_tests.rs"]
mod tests;
