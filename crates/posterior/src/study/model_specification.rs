//! Specification of a revision's model, as written in `model.toml` (formats §2).

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use super::effect_file;
use crate::noise::NoiseModel;
use crate::prior::PriorSet;
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, Content, write_atomically};
use base::parameter::{ParameterSpec, RELATIVE_NOISE};
use base::toml_input::{TomlInput, TomlTable, text_of};
use base::units::nearest_name;
use documents::posterior::ModelSummary;
use laws::rheology::{BaseLaw, ExternalLaw, MOST_PARAMETERS, Network};
use models::effects::{Effect, Library, NUISANCES};
use record::CharacteristicSizes;

/// File name of a revision's copy of a prior that is not built in.
pub const PRIOR_COPY: &str = "prior.toml";

/// Specification of a model by names: base law, effects, noise terms, priors, and fixed parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelSpecification {
    /// Base law of the model.
    pub base: BaseLaw,
    /// Slugs (command-line names) of the model's effects.
    pub effects: Vec<String>,
    /// Names of the model's noise terms, such as `white`.
    pub noise: Vec<String>,
    /// Name of the built-in priors, or path of a prior file.
    pub prior: String,
    /// Values of the fixed parameters by name, in the parameters' units.
    pub fixed: BTreeMap<String, f64>,
    /// Names of the optional parameters that are free. All other optional parameters are fixed at their null.
    pub freed: Vec<String>,
}

/// Values at which parameters are fixed, by name; `None` frees the parameter.
pub type Assignments = BTreeMap<String, Option<f64>>;

impl ModelSpecification {
    /// Returns the names of base law, effects and noise terms, for JSON documents.
    pub fn summary(&self) -> ModelSummary {
        ModelSummary { base: self.base.name().into(), effects: self.effects.clone(), noise: self.noise.clone() }
    }
}

impl Default for ModelSpecification {
    fn default() -> Self {
        Self {
            base: BaseLaw::default(),
            effects: Vec::new(),
            noise: vec!["white".into()],
            prior: PriorSet::builtin_names().next().unwrap_or("porcine").into(),
            fixed: BTreeMap::new(),
            freed: Vec::new(),
        }
    }
}

/// Content of `model.toml`. Tables come last, because in TOML all keys after a table's header belong to that table.
#[derive(Serialize)]
struct ModelFile<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    base: Option<&'a str>,
    effects: &'a [String],
    noise: &'a [String],
    prior: &'a str,
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    free: &'a [String],
    #[serde(rename = "base", skip_serializing_if = "Option::is_none")]
    network: Option<BTreeMap<&'a str, toml::Value>>,
    fixed: &'a BTreeMap<String, f64>,
    /// Definitions of the effects that are not built in.
    #[serde(skip_serializing_if = "<[toml::Table]>::is_empty")]
    effect: &'a [toml::Table],
}

/// Function that gives the place of each key of a specification (such as `noise`), for error messages.
struct Places<'p> {
    of: &'p dyn Fn(&str) -> InputPlace,
}

impl ModelSpecification {
    /// Reads the model of a revision. If the revision contains a copy of its prior, `prior` is the path of this copy.
    ///
    /// # Errors
    /// Errors of [`ModelSpecification::read`].
    pub fn of_revision(revision_dir: &Path, library: &Library) -> Result<Self> {
        let mut specification = Self::read_kept(revision_dir, library)?;
        if specification.prior == PRIOR_COPY {
            specification.prior = revision_dir.join(PRIOR_COPY).display().to_string();
        }
        Ok(specification)
    }

    /// Reads the model of a revision exactly as written. The prior must be built in or be the copy in the revision, so that a study from elsewhere cannot name another
    /// file.
    ///
    /// # Errors
    /// Errors of [`ModelSpecification::read`].
    pub fn read_kept(revision_dir: &Path, library: &Library) -> Result<Self> {
        let path = revision_dir.join("model.toml");
        let specification = Self::read(&path, library)?;
        let prior = &specification.prior;
        if prior == PRIOR_COPY || PriorSet::builtin_names().any(|name| name == prior) {
            return Ok(specification);
        }
        Err(Error::input(
            InputPlace::file(path).at_key("prior"),
            format!("`{prior}` is neither a built-in prior nor the revision's own copy, `{PRIOR_COPY}`"),
            format!("copy the prior into the revision as `{PRIOR_COPY}`, if you trust it, and write that name"),
        ))
    }

    /// Reads and checks a `model.toml` with effects of the library. Only the key `base` is required.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be read; [`Error::Input`] with file, line, key and remedy if its content is invalid.
    pub fn read(path: &Path, library: &Library) -> Result<Self> {
        let bytes = files::read(path, Content::Settings, "give a file that exists and can be read")?;
        Self::from_text(path, &bytes, library)
    }

    /// Reads and checks the text of a `model.toml`. Only error messages use the name `file`.
    ///
    /// # Errors
    /// Errors of [`ModelSpecification::read`].
    pub fn from_text(file: &Path, bytes: &[u8], library: &Library) -> Result<Self> {
        let text = text_of(file, bytes)?;
        let document = TomlInput::parse(file, text)?;
        let root = document.root();
        root.only(&["base", "effect", "effects", "fixed", "free", "noise", "prior"])?;
        if root.has("effect") {
            define_effects(&root, text)?;
        }
        let default = Self::default();
        let fixed_table = root.table("fixed")?;
        let mut fixed = BTreeMap::new();
        if let Some(table) = fixed_table {
            for name in table.keys() {
                if matches!(table.table(name), Ok(Some(_))) {
                    let remedy = format!("quote the whole name, as in `\"{name}.…\" = 1.0`");
                    return Err(table.refuse(name, "a name with a dot needs quotes", remedy));
                }
                fixed.insert(name.to_string(), table.required_number(name, &format!("{name} = 1.0"))?);
            }
        }
        let base = match root.table("base") {
            Ok(Some(table)) => {
                table.only(&["network", "forward"])?;
                match table.table("forward")? {
                    Some(forward) => BaseLaw::Outside(ExternalLaw::from_toml(&forward)?),
                    None => BaseLaw::Network(Network::from_toml(&table.required_table("network")?)?),
                }
            }
            _ => {
                let name = root.required_text("base", "base = \"lethersich\"")?;
                base_named(&name, root.place("base"))?
            }
        };
        let specification = Self {
            base,
            effects: root.texts("effects")?.unwrap_or_default(),
            noise: root.texts("noise")?.unwrap_or(default.noise),
            prior: root.text("prior")?.unwrap_or(default.prior),
            fixed,
            freed: root.texts("free")?.unwrap_or_default(),
        };
        let place = |key: &str| match key.strip_prefix("fixed.") {
            Some(name) => fixed_table.map_or(root.place("fixed"), |table| table.place(name)),
            None => root.place(key),
        };
        specification.check(&Places { of: &place }, library)?;
        Ok(specification)
    }

    /// Applies the options `--base`, `--with`, `--noise`, `--prior` and `--set NAME=VALUE` to this specification. Effects and values are added; base, noise and prior are
    /// replaced if given. `base` may be the path of a TOML file with a base law, such as a network. It may also be a server's address, optionally followed by `#` and the
    /// model's name. The law then has the parameters of the prior.
    ///
    /// # Errors
    /// [`Error::Input`] that names the invalid option.
    pub fn with_options(
        self,
        base: Option<&str>,
        effects: &[String],
        noise: &[String],
        prior: Option<&str>,
        set: &[String],
    ) -> Result<Self> {
        let mut specification = self;
        let (effects, noise) = (trimmed(effects), trimmed(noise));
        if let Some(twice) = effects.iter().enumerate().find(|(i, slug)| effects[..*i].contains(slug)) {
            return Err(Error::input(
                InputPlace::setting(Setting::Effects),
                format!("`{}` is named twice", twice.1),
                "name it once",
            ));
        }
        for slug in named_effects(&effects)? {
            if !specification.effects.contains(&slug) {
                specification.effects.push(slug);
            }
        }
        if let Some(base) = base {
            let is_file = Path::new(base).extension().is_some_and(|extension| extension == "toml");
            specification.base = if is_file {
                base_of_file(Path::new(base))?
            } else if base.contains("://") {
                base_at(base, prior.unwrap_or(&specification.prior))?
            } else {
                base_named(base, InputPlace::setting(Setting::Base))?
            };
        }
        if !noise.is_empty() {
            specification.noise = noise;
        }
        if let Some(prior) = prior {
            specification.prior = prior.into();
        }
        specification.set(&assignments(set)?);
        let place = |key: &str| {
            InputPlace::setting(match key {
                "base" => Setting::Base,
                "effects" => Setting::Effects,
                "noise" => Setting::Noise,
                "prior" => Setting::Prior,
                _ => Setting::Fixed,
            })
        };
        specification.check(&Places { of: &place }, &Library::default())?;
        Ok(specification)
    }

    /// Values of this model's parameters from options `--set NAME=VALUE`, by name; `None` for parameters set to `free`.
    ///
    /// # Errors
    /// [`Error::Input`] for a name that is no parameter of the model, or a value outside the parameter's support.
    pub fn values_from_options(&self, set: &[String], library: &Library) -> Result<Assignments> {
        let assignments = assignments(set)?;
        let mut model = Self { fixed: BTreeMap::new(), ..self.clone() };
        model.set(&assignments);
        model.check(&Places { of: &|_| InputPlace::setting(Setting::Fixed) }, library)?;
        Ok(assignments)
    }

    /// Fixes parameters at the assigned values, and frees the parameters that are assigned `None`.
    pub fn set(&mut self, assignments: &Assignments) {
        for (name, value) in assignments {
            self.freed.retain(|freed| freed != name);
            self.fixed.remove(name);
            match value {
                Some(value) => drop(self.fixed.insert(name.clone(), *value)),
                None => self.freed.push(name.clone()),
            }
        }
    }

    /// Fixes every optional parameter of the model's effects at its null, unless the parameter is already fixed or freed. Removes the fixed optional parameters of
    /// effects that the model lacks.
    pub fn with_nulls(mut self, scales: &CharacteristicSizes, library: &Library) -> Self {
        for effect in library.effects() {
            let is_there = self.effects.iter().any(|slug| slug == effect.slug());
            for parameter in effect.parameters().iter().filter(|parameter| parameter.spec.is_optional) {
                let name = parameter.spec.name;
                if !is_there {
                    self.fixed.remove(name);
                } else if let Some(null) = (parameter.null)(scales)
                    && !self.freed.iter().any(|freed| freed == name)
                {
                    self.fixed.entry(name.into()).or_insert(null);
                }
            }
        }
        self
    }

    /// Writes `model.toml`, completely or not at all.
    ///
    /// # Errors
    /// [`Error::File`] if the operating system refuses.
    pub fn write(&self, path: &Path) -> Result<()> {
        let Self { base, effects, noise, prior, fixed, freed } = self;
        let (name, network) = match base {
            BaseLaw::Network(network) => (None, Some(BTreeMap::from([("network", network.to_toml_value())]))),
            BaseLaw::Outside(law) => (None, Some(BTreeMap::from([("forward", law.to_toml_value())]))),
            named => (Some(named.name()), None),
        };
        let definitions: Vec<toml::Table> = effects.iter().filter_map(|slug| effect_file::definition(slug)).collect();
        let written =
            ModelFile { base: name, effects, noise, prior, free: freed, network, fixed, effect: &definitions };
        let text = toml::to_string(&written).map_err(|error| {
            Error::numerical(
                format!("the model cannot be written as TOML: {error}"),
                "report this with the command that was run",
            )
        })?;
        write_atomically(path, text.as_bytes())
    }

    /// Effects in the order in which the model applies them: the order of the library, then effects from files.
    pub fn effects(&self, library: &Library) -> Vec<&'static dyn Effect> {
        let is_named = |effect: &&&dyn Effect| self.effects.iter().any(|slug| slug == effect.slug());
        let of_library = library.effects();
        let is_defined = |slug: &&String| of_library.iter().all(|effect| effect.slug() != **slug);
        let defined = self.effects.iter().filter(is_defined).filter_map(|slug| library.get(slug));
        of_library.iter().filter(is_named).copied().chain(defined).collect()
    }

    /// Creates the noise model from the names of its terms.
    ///
    /// # Errors
    /// [`Error::Input`] at `place` for an unknown name, or if the term `white` is missing.
    pub fn noise_model(&self, place: &InputPlace) -> Result<NoiseModel> {
        NoiseModel::named(&self.noise, place)
    }

    fn check(&self, places: &Places<'_>, library: &Library) -> Result<()> {
        let of_library = library.effects().iter().map(|effect| effect.slug());
        let defined = self.effects.iter().map(String::as_str).filter(|slug| library.get(slug).is_some());
        let slugs: Vec<&str> = of_library.chain(defined).collect();
        check_known(places, "effects", &self.effects, &slugs)?;
        let noise = self.noise_model(&(places.of)("noise"))?;
        let effects = self.effects(library);
        // The list includes the parameters of all nuisance effects. The problem checks later which nuisance effects the experiment has.
        let of_effects =
            effects.iter().chain(NUISANCES).flat_map(|effect| effect.parameters()).map(|parameter| parameter.spec);
        // Equations divide by the parameters of law and noise. The lower end of their support (often 0) is therefore excluded.
        let scales: Vec<ParameterSpec> = self.base.parameters().iter().copied().chain(noise.parameters()).collect();
        let all: Vec<ParameterSpec> = scales.iter().copied().chain(of_effects).collect();
        for name in &self.freed {
            if !all.iter().any(|spec| spec.name == name && spec.is_optional) {
                let optional: Vec<&str> = all.iter().filter(|spec| spec.is_optional).map(|spec| spec.name).collect();
                let remedy = match optional[..] {
                    [] => "leave it out: all parameters of this model are free unless they are set".to_string(),
                    _ => format!(
                        "give only {} here; all other parameters are free unless they are set",
                        optional.join(", ")
                    ),
                };
                return Err(Error::input((places.of)("free"), format!("`{name}` is free already"), remedy));
            }
        }
        for (name, value) in &self.fixed {
            let place = (places.of)(&format!("fixed.{name}"));
            let Some(spec) = all.iter().find(|spec| spec.name == name) else {
                let names: Vec<&str> = all.iter().map(|spec| spec.name).collect();
                let near = nearest_name(name, names.iter().copied());
                let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
                let remedy = format!("{hint}this model has the parameters {}", names.join(", "));
                return Err(Error::input(place, format!("unknown parameter `{name}`"), remedy));
            };
            let is_scale = scales.contains(spec);
            let is_inside = spec.support.contains(*value) && (!is_scale || *value > spec.support.lower);
            if !(value.is_finite() && is_inside) {
                let unit = if spec.unit == "1" { String::new() } else { format!(" in {}", spec.unit) };
                let remedy = if is_scale && spec.support.upper.is_infinite() {
                    format!("give a finite value above {}{unit}", spec.support.lower)
                } else if is_scale {
                    format!("give a value above {} and at most {}{unit}", spec.support.lower, spec.support.upper)
                } else {
                    format!("give a finite value inside {}{unit}", spec.support)
                };
                return Err(Error::input(place, format!("{name} = {value} is outside its support"), remedy));
            }
        }
        Ok(())
    }
}

/// Slugs of effects that are named on the command line. A name may be the path of a file that defines an effect.
///
/// # Errors
/// Errors of [`effect_file::read`].
pub fn named_effects(names: &[String]) -> Result<Vec<String>> {
    let slug = |name: &String| match effect_file::is_file(name) {
        true => effect_file::read(Path::new(name)).map(String::from),
        false => Ok(name.clone()),
    };
    names.iter().map(slug).collect()
}

/// Registers the effects that a `model.toml` defines.
fn define_effects(root: &TomlTable<'_>, text: &str) -> Result<()> {
    let whole: toml::Table = text
        .parse()
        .map_err(|error| root.refuse("effect", format!("not valid TOML: {error}"), "correct the syntax"))?;
    let definitions = whole.get("effect").and_then(toml::Value::as_array).cloned().unwrap_or_default();
    for (table, definition) in root.tables("effect", "[[effect]]")?.iter().zip(definitions) {
        effect_file::from_table(table, definition.as_table().cloned().unwrap_or_default())?;
    }
    Ok(())
}

/// Returns the names without surrounding blanks, and leaves out empty names.
fn trimmed(names: &[String]) -> Vec<String> {
    names.iter().map(|name| name.trim().to_string()).filter(|name| !name.is_empty()).collect()
}

/// Reads the base law from a `model.toml` that must contain no other key.
fn base_of_file(file: &Path) -> Result<BaseLaw> {
    let specification = ModelSpecification::read(file, &Library::default())?;
    let base = specification.base;
    if specification != (ModelSpecification { base, ..ModelSpecification::default() }) {
        return Err(Error::input(
            InputPlace::file(file),
            "this file contains more than a base law",
            format!(
                "keep only its base, and give effects, noise, prior and values by {}, {}, {} and {}",
                Setting::Effects,
                Setting::Noise,
                Setting::Prior,
                Setting::Fixed
            ),
        ));
    }
    Ok(base)
}

/// Law that a server evaluates. `address` is its URL, optionally followed by `#` and the model's name. The law has the parameters of the prior file, without the
/// parameters of effects and noise.
fn base_at(address: &str, prior: &str) -> Result<BaseLaw> {
    let (url, name) = address.split_once('#').map_or((address, None), |(url, name)| (url, Some(name)));
    let of_noise: Vec<&str> = NoiseModel::known_parameters().map(|spec| spec.name).collect();
    let is_own = |name: &str| !name.contains('.') && !of_noise.contains(&name) && name != RELATIVE_NOISE.name;
    let parameters: Vec<_> = PriorSet::listed(prior)?.into_iter().filter(|(name, _)| is_own(name)).collect();
    let refuse = |found: String, remedy: String| Err(Error::input(InputPlace::setting(Setting::Prior), found, remedy));
    for (k, (name, _)) in parameters.iter().enumerate() {
        if let Some((found, remedy)) =
            ExternalLaw::check_name(name, parameters[..k].iter().map(|(name, _)| name.as_str()))
        {
            return refuse(found, remedy);
        }
    }
    if parameters.is_empty() || parameters.len() > MOST_PARAMETERS {
        let found = format!("`{prior}` names {} parameters for the model at {url}", parameters.len());
        let remedy = format!(
            "give a prior file with one to {MOST_PARAMETERS} parameters, in the order of the model's input, and the noise"
        );
        return refuse(found, remedy);
    }
    Ok(BaseLaw::Outside(ExternalLaw::new(url, name, &parameters)))
}

/// Returns the built-in base law with this name. An unknown name is an error at `place`.
fn base_named(name: &str, place: InputPlace) -> Result<BaseLaw> {
    BaseLaw::named(name).ok_or_else(|| {
        let known: Vec<&str> = BaseLaw::names().collect();
        let near = nearest_name(name, known.iter().copied());
        let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
        Error::input(
            place,
            format!("`{name}` is not available"),
            format!("{hint}{}; or a .toml file with a [base.network]", available(&known)),
        )
    })
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

/// Parses options `NAME=VALUE` into values by parameter name; `None` for the value `free`.
fn assignments(set: &[String]) -> Result<Assignments> {
    let mut values = BTreeMap::new();
    for assignment in set {
        let (name, value) = assignment_from(assignment)?;
        if values.insert(name.clone(), value).is_some() {
            let found = format!("{name} is set twice");
            return Err(Error::input(InputPlace::setting(Setting::Fixed), found, "set each parameter once"));
        }
    }
    Ok(values)
}

fn assignment_from(text: &str) -> Result<(String, Option<f64>)> {
    let refuse = |found: String| {
        Error::input(
            InputPlace::setting(Setting::Fixed),
            found,
            format!("write NAME=VALUE, as in `{} young_modulus_pa=3.5`", Setting::Fixed),
        )
    };
    let (name, value) = text.split_once('=').ok_or_else(|| refuse(format!("`{text}` has no `=`")))?;
    if value.trim() == "free" {
        return Ok((name.trim().to_string(), None));
    }
    let number = value.trim().parse::<f64>().map_err(|_| refuse(format!("`{value}` is not a number")))?;
    Ok((name.trim().to_string(), Some(number)))
}

#[cfg(test)]
#[path = "model_specification_tests.rs"]
mod tests;
