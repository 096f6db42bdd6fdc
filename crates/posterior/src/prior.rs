//! Prior distributions of parameters. A file `priors/<name>.toml` has one table per parameter (formats §2).

use std::path::{Path, PathBuf};

use rand::Rng;

pub use base::distribution::{Distribution, UnconstrainedDensity};
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, Content};
use base::parameter::{NOISE_SD, ParameterSpec};
use base::toml_input::{TomlInput, TomlTable, text_of};
use laws::rheology::{InterchangeableParts, LETHERSICH};

/// Young's modulus, retardation viscosity and flow viscosity of the Lethersich law (physics §2), then the standard deviation of the white noise. All modules use this
/// order.
pub const BASE_PARAMETERS: &[ParameterSpec] = &[LETHERSICH[0], LETHERSICH[1], LETHERSICH[2], NOISE_SD];

/// Name and TOML text of each built-in prior.
const EMBEDDED: &[(&str, &str)] = &[
    ("porcine", include_str!("../../../priors/porcine.toml")),
    ("sharif-kashani-2011", include_str!("../../../priors/sharif-kashani-2011.toml")),
    ("lee-1994", include_str!("../../../priors/lee-1994.toml")),
    ("wang-2013", include_str!("../../../priors/wang-2013.toml")),
    ("nickerson-2008-porcine", include_str!("../../../priors/nickerson-2008-porcine.toml")),
    ("nickerson-2008-bovine", include_str!("../../../priors/nickerson-2008-bovine.toml")),
    ("aboulatta-2021", include_str!("../../../priors/aboulatta-2021.toml")),
    ("generic", include_str!("../../../priors/generic.toml")),
];

/// Prior of one parameter, with its unit and source.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// Name of the parameter, as in the prior file.
    pub name: String,
    /// Distribution of the parameter's value in `unit`.
    pub distribution: Distribution,
    /// Unit of the parameter, in which the prior's numbers are given.
    pub unit: String,
    /// Publication from which the distribution comes, or the reason for its choice.
    pub source: String,
}

/// Function that gives the default prior of a parameter without a table in the prior file. The second argument holds the priors of all earlier parameters. `None` means
/// that the file must have a table for the parameter.
pub type DefaultPrior<'a> = dyn Fn(&ParameterSpec, &[Prior]) -> Option<Prior> + 'a;

fn no_default(_: &ParameterSpec, _: &[Prior]) -> Option<Prior> {
    None
}

/// Priors of a model's sampled parameters, in the model's order.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorSet {
    name: String,
    text: String,
    priors: Vec<Prior>,
    /// Density of each prior, computed once because the sampler uses it millions of times.
    densities: Vec<UnconstrainedDensity>,
    /// Groups of interchangeable elements of the law, such as two springpots in parallel. Each element has the indices of its parameters among the priors. The elements
    /// stay in a fixed order, so that a parameter name always denotes the same element.
    ordered: Vec<(InterchangeableParts, Vec<Vec<usize>>)>,
}

impl PriorSet {
    /// Names of the built-in priors; the first is the default.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        EMBEDDED.iter().map(|(name, _)| *name)
    }

    /// Built-in priors of the Lethersich law and the white noise, by name.
    ///
    /// # Errors
    /// [`Error::Input`] if no built-in prior has this name.
    pub fn named(name: &str) -> Result<Self> {
        if Self::builtin_names().any(|known| known == name) { Self::read(name) } else { Err(unknown_name(name)) }
    }

    /// Reads the priors of [`BASE_PARAMETERS`]. `name_or_file` names a built-in prior or a prior file.
    ///
    /// # Errors
    /// [`Error::Input`] for an unknown name or a file with invalid content; [`Error::File`] for a file that cannot be read.
    pub fn read(name_or_file: &str) -> Result<Self> {
        Self::read_for(name_or_file, BASE_PARAMETERS, &[], &no_default)
    }

    /// Reads the priors of the `wanted` parameters. `name_or_file` names a built-in prior or a prior file. The file may also hold priors of the parameters `others`.
    /// `default` gives the priors of wanted parameters that the file lacks.
    ///
    /// # Errors
    /// Errors of [`PriorSet::read`].
    pub fn read_for(
        name_or_file: &str,
        wanted: &[ParameterSpec],
        others: &[&str],
        default: &DefaultPrior<'_>,
    ) -> Result<Self> {
        let (file, text) = Self::text_named(name_or_file)?;
        let mut set = Self::from_text(&file, text.as_bytes(), wanted, others, default)?;
        set.name = name_or_file.to_string();
        Ok(set)
    }

    /// Name and unit of each parameter in a built-in prior or prior file, in the order of the file.
    ///
    /// # Errors
    /// Errors of [`PriorSet::read`].
    pub fn listed(name_or_file: &str) -> Result<Vec<(String, String)>> {
        let (path, text) = Self::text_named(name_or_file)?;
        let document = TomlInput::parse(&path, &text)?;
        let root = document.root();
        let entry = |name: &str| {
            let unit = root.required_table(name)?.required_text("unit", "unit = \"Pa\"")?;
            Ok((name.to_string(), unit))
        };
        root.keys_in_order().into_iter().map(entry).collect()
    }

    /// Path and TOML text of a built-in prior or prior file.
    ///
    /// # Errors
    /// Errors of [`PriorSet::read`].
    pub fn text_named(name_or_file: &str) -> Result<(PathBuf, String)> {
        if let Some((name, text)) = EMBEDDED.iter().find(|(name, _)| *name == name_or_file) {
            return Ok((PathBuf::from(format!("priors/{name}.toml")), (*text).to_string()));
        }
        let path = Path::new(name_or_file);
        if !path.exists() {
            return Err(unknown_name(name_or_file));
        }
        let bytes = files::read(path, Content::Settings, "give a readable prior file, or a prior's name")?;
        Ok((path.to_path_buf(), text_of(path, &bytes)?.to_string()))
    }

    /// Reads priors from the text of a prior file. Only error messages use the name `file`.
    ///
    /// # Errors
    /// [`Error::Input`] with file, line, key and remedy. The causes are an unknown or missing parameter or key, a wrong unit, impossible values, or a distribution
    /// outside the parameter's support.
    pub fn from_text(
        file: &Path,
        bytes: &[u8],
        wanted: &[ParameterSpec],
        others: &[&str],
        default: &DefaultPrior<'_>,
    ) -> Result<Self> {
        let text = text_of(file, bytes)?;
        let document = TomlInput::parse(file, text)?;
        let root = document.root();
        let names: Vec<&str> = wanted.iter().map(|spec| spec.name).chain(others.iter().copied()).collect();
        root.only(&names)?;
        let mut priors = Vec::with_capacity(wanted.len());
        for spec in wanted {
            priors.push(match (root.table(spec.name)?, default(spec, &priors)) {
                (Some(table), _) => prior_from(table, spec)?,
                (None, Some(default)) => default,
                (None, None) => {
                    let example = format!(
                        "[{}]` with `distribution`, its numbers, `unit = \"{}\"` and `source",
                        spec.name, spec.unit
                    );
                    return Err(root.missing(spec.name, &example));
                }
            });
        }
        let densities = priors.iter().map(|prior| prior.distribution.unconstrained()).collect();
        Ok(Self { name: file.display().to_string(), text: text.to_string(), priors, densities, ordered: Vec::new() })
    }

    /// Name of the built-in prior or path of the file, as the user gave it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// TOML text from which the priors were read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Distribution of each parameter, in the order of the priors.
    pub fn distributions(&self) -> impl Iterator<Item = Distribution> + '_ {
        self.priors.iter().map(|prior| prior.distribution)
    }

    /// All priors, in the model's order.
    pub fn priors(&self) -> &[Prior] {
        &self.priors
    }

    /// Names of the parameters, in the order of the priors.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.priors.iter().map(|prior| prior.name.as_str())
    }

    /// Prior of the parameter with this name; `None` if the set has none.
    pub fn get(&self, name: &str) -> Option<&Prior> {
        self.priors.iter().find(|prior| prior.name == name)
    }

    /// Copy of the set without the priors of the parameters in `fixed`.
    pub fn without(&self, fixed: &[&str]) -> Self {
        let mut left = self.clone();
        left.priors.retain(|prior| !fixed.contains(&prior.name.as_str()));
        left.densities = left.priors.iter().map(|prior| prior.distribution.unconstrained()).collect();
        left.with_order(self.ordered.iter().map(|(parts, _)| parts.clone()).collect())
    }

    /// Copy of the set with further priors at its end.
    pub fn with(&self, others: &[Prior]) -> Self {
        let mut all = self.clone();
        all.priors.extend(others.iter().cloned());
        all.densities = all.priors.iter().map(|prior| prior.distribution.unconstrained()).collect();
        all
    }

    /// Restricts interchangeable elements of the law to one order, if their priors are equal. Without an order, draws would exchange the elements, and each parameter's
    /// distribution would be a mixture of both elements' values.
    pub fn with_order(mut self, groups: Vec<InterchangeableParts>) -> Self {
        let place = |spec: &ParameterSpec| self.priors.iter().position(|prior| prior.name == spec.name);
        let placed = |parts: InterchangeableParts| {
            let places = |part: &Vec<ParameterSpec>| part.iter().map(place).collect::<Option<Vec<usize>>>();
            let places = parts.0.iter().map(places).collect::<Option<Vec<_>>>()?;
            let distributions =
                |part: &Vec<usize>| part.iter().map(|place| self.priors[*place].distribution).collect::<Vec<_>>();
            let is_same = |part: &Vec<usize>| distributions(part) == distributions(&places[0]);
            places.iter().all(is_same).then_some((parts, places))
        };
        self.ordered = groups.into_iter().filter_map(placed).collect();
        self
    }

    /// Sorts the values of interchangeable elements by [`InterchangeableParts::slowness`], smallest first. `natural` holds all parameters' values in their units, in
    /// the order of the priors.
    pub fn ordered(&self, mut natural: Vec<f64>) -> Vec<f64> {
        for (group, places) in &self.ordered {
            let values = |part: &Vec<usize>| part.iter().map(|place| natural[*place]).collect::<Vec<f64>>();
            let mut parts: Vec<Vec<f64>> = places.iter().map(values).collect();
            let slowness = |part: &[f64]| InterchangeableParts::slowness(&group.0[0], part);
            parts.sort_by(|a, b| slowness(a).total_cmp(&slowness(b)));
            for (place, value) in places.iter().flatten().zip(parts.iter().flatten()) {
                natural[*place] = *value;
            }
        }
        natural
    }

    /// Multiplies each point's density by the number of possible orders if its interchangeable elements are in order, and by 0 otherwise. `natural` returns the value
    /// of a parameter, given the parameter's index and the point's index.
    fn add_ln_order(&self, natural: impl Fn(usize, usize) -> f64, log_density: &mut [f64]) {
        for (group, places) in &self.ordered {
            let ln_orders: f64 = (1..=places.len()).map(|n| (n as f64).ln()).sum();
            for (point, out) in log_density.iter_mut().enumerate() {
                let slowness = places.iter().zip(&group.0).map(|(part, specs)| {
                    let values: Vec<f64> = part.iter().map(|place| natural(*place, point)).collect();
                    InterchangeableParts::slowness(specs, &values)
                });
                *out += if slowness.is_sorted() { ln_orders } else { f64::NEG_INFINITY };
            }
        }
    }

    /// Adds the log density over natural values to each point of a batch. `points` holds natural values in the layout of [`Self::add_ln_pdf_unconstrained`].
    pub fn add_ln_pdf(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        for (prior, values) in self.priors.iter().zip(points.chunks_exact(n.max(1))) {
            log_density.iter_mut().zip(values).for_each(|(out, x)| *out += prior.distribution.ln_pdf(*x));
        }
        self.add_ln_order(|place, point| points[place * n + point], log_density);
    }

    /// Interval of each parameter, in its unit, with the prior probability `tail` beyond either end.
    pub fn box_quantiles(&self, tail: f64) -> Vec<(f64, f64)> {
        let ends = |prior: &Prior| (prior.distribution.quantile(tail), prior.distribution.quantile(1.0 - tail));
        self.priors.iter().map(ends).collect()
    }

    /// Draws one value of every parameter, in the parameter's unit, in the order of the priors.
    pub fn draw(&self, rng: &mut (impl Rng + ?Sized)) -> Vec<f64> {
        self.ordered(self.priors.iter().map(|prior| prior.distribution.draw(rng)).collect())
    }

    /// Converts natural values (in the parameters' units) to the sampler's unconstrained coordinates. Both are in the order of the priors.
    pub fn to_unconstrained(&self, natural: &[f64]) -> Vec<f64> {
        self.priors.iter().zip(natural).map(|(prior, x)| prior.distribution.to_unconstrained(*x)).collect()
    }

    /// Converts the sampler's unconstrained coordinates `z` to natural values (in the parameters' units). Both are in the order of the priors.
    pub fn from_unconstrained(&self, z: &[f64]) -> Vec<f64> {
        self.priors.iter().zip(z).map(|(prior, z)| prior.distribution.from_unconstrained(*z)).collect()
    }

    /// Adds the log density over the sampler's coordinates to `log_density`, for a batch of n = `log_density.len()` points. Coordinate d of point i is `points[d * n +
    /// i]`.
    pub fn add_ln_pdf_unconstrained(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        if n == 0 {
            return;
        }
        for (density, z) in self.densities.iter().zip(points.chunks_exact(n)) {
            density.add_ln_pdf(z, log_density);
        }
        let natural =
            |place: usize, point: usize| self.priors[place].distribution.from_unconstrained(points[place * n + point]);
        self.add_ln_order(natural, log_density);
    }
}

fn unknown_name(name: &str) -> Error {
    let names: Vec<&str> = PriorSet::builtin_names().collect();
    let near = base::units::nearest_name(name, names.iter().copied());
    let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
    Error::input(
        InputPlace::setting(Setting::Prior),
        format!("`{name}` is neither a file nor the name of a prior"),
        format!("{hint}give the path of a TOML file or one of {}", names.join(", ")),
    )
}

const DISTRIBUTIONS: [&str; 6] = ["log_normal", "normal", "half_normal", "uniform", "log_uniform", "beta"];

fn prior_from(table: TomlTable<'_>, spec: &ParameterSpec) -> Result<Prior> {
    let distribution = distribution_of(table)?;
    let unit = table.required_text("unit", &format!("unit = \"{}\"", spec.unit))?;
    if unit != spec.unit {
        return Err(table.refuse(
            "unit",
            format!("the unit is `{unit}`, but {} is given in `{}`", spec.name, spec.unit),
            format!("convert the numbers and write `unit = \"{}\"`", spec.unit),
        ));
    }
    let (lower, upper) = distribution.support();
    if lower < spec.support.lower || upper > spec.support.upper {
        return Err(table.refuse(
            "distribution",
            format!("the prior reaches [{lower}, {upper}], but {} must lie in {}", spec.name, spec.support),
            if spec.support.upper.is_infinite() {
                "use `log_normal`, `half_normal` or `log_uniform`, which stay positive, or narrow the ends"
            } else {
                "use `uniform` or `beta` with `lower` and `upper` inside that interval"
            },
        ));
    }
    let source = table.required_text("source", "source = \"where the numbers come from\"")?;
    Ok(Prior { name: spec.name.to_string(), distribution, unit, source })
}

/// Reads a distribution from a TOML table. The key `distribution` names its kind, and further keys give its parameters. The table may also have the keys `unit` and
/// `source`.
///
/// # Errors
/// [`Error::Input`] with file, line, key and remedy.
pub fn distribution_of(table: TomlTable<'_>) -> Result<Distribution> {
    let kind = table.required_text("distribution", "distribution = \"log_normal\"")?;
    let distribution = distribution_from(table, &kind)?;
    refuse_absurd(table)?;
    Ok(distribution)
}

fn distribution_from(table: TomlTable<'_>, kind: &str) -> Result<Distribution> {
    let only = |numbers: &[&str]| table.only(&[&["distribution", "unit", "source"], numbers].concat());
    let positive = |key: &str| table.required_positive(key, &format!("{key} = 1.0"));
    let number = |key: &str| table.required_number(key, &format!("{key} = 1.0"));
    Ok(match kind {
        "log_normal" => {
            only(&["median", "log_sd", "mean", "sd"])?;
            log_normal_from(table)?
        }
        "normal" => {
            only(&["mean", "sd"])?;
            Distribution::Normal { mean: number("mean")?, sd: positive("sd")? }
        }
        "half_normal" => {
            only(&["sd"])?;
            Distribution::HalfNormal { sd: positive("sd")? }
        }
        "uniform" => {
            only(&["lower", "upper"])?;
            let (lower, upper) = ordered(table, number("lower")?, number("upper")?)?;
            Distribution::Uniform { lower, upper }
        }
        "log_uniform" => {
            only(&["lower", "upper"])?;
            let (lower, upper) = ordered(table, positive("lower")?, positive("upper")?)?;
            Distribution::LogUniform { lower, upper }
        }
        "beta" => {
            only(&["alpha", "beta", "lower", "upper"])?;
            let (alpha, beta) = (positive("alpha")?, positive("beta")?);
            let ends = (table.number("lower")?.unwrap_or(0.0), table.number("upper")?.unwrap_or(1.0));
            let (lower, upper) = ordered(table, ends.0, ends.1)?;
            Distribution::Beta { alpha, beta, lower, upper }
        }
        other => {
            let near = base::units::nearest_name(other, DISTRIBUTIONS);
            let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
            return Err(table.refuse(
                "distribution",
                format!("unknown distribution `{other}`"),
                format!("{hint}use one of {}", DISTRIBUTIONS.join(", ")),
            ));
        }
    })
}

/// Smallest and largest allowed magnitude of a number in a prior, in any unit. A number outside this range is a mistake, and its powers or ratios could overflow.
const SIZES: [f64; 2] = [1e-30, 1e15];
/// Allowed range of each dimensionless parameter of a distribution, by its key.
const SHAPES: [(&str, [f64; 2]); 3] = [("log_sd", [1e-6, 20.0]), ("alpha", [1e-3, 1e6]), ("beta", [1e-3, 1e6])];

fn refuse_absurd(table: TomlTable<'_>) -> Result<()> {
    for key in table.keys() {
        let shape = SHAPES.iter().find(|(name, _)| *name == key).map(|(_, sizes)| *sizes);
        let is_number = ["median", "mean", "sd", "lower", "upper"].contains(&key);
        let Some([smallest, largest]) = shape.or(is_number.then_some(SIZES)) else { continue };
        let value = table.number(key)?.unwrap_or(0.0);
        if value != 0.0 && !(smallest..=largest).contains(&value.abs()) {
            return Err(table.refuse(
                key,
                format!("{value:e} is outside the possible sizes of this number"),
                format!("give a number between {smallest:e} and {largest:e}; check the unit"),
            ));
        }
    }
    Ok(())
}

/// Reads a log-normal distribution. The table gives either `median` and `log_sd`, or `mean` and `sd` of the parameter itself, as papers often do.
fn log_normal_from(table: TomlTable<'_>) -> Result<Distribution> {
    let has_moments = table.has("mean") || table.has("sd");
    let has_median = table.has("median") || table.has("log_sd");
    if has_moments && has_median {
        let key = if table.has("mean") { "mean" } else { "sd" };
        return Err(table.refuse(
            key,
            "the log-normal is given twice, by `median`/`log_sd` and by `mean`/`sd`",
            "keep `median` with `log_sd`, or `mean` with `sd` (then the moments are matched)",
        ));
    }
    if has_moments {
        let mean = table.required_positive("mean", "mean = 1.66")?;
        return Ok(Distribution::log_normal_from_moments(mean, table.required_positive("sd", "sd = 0.96")?));
    }
    let median = table.required_positive("median", "median = 1.8")?;
    Ok(Distribution::LogNormal { median, log_sd: table.required_positive("log_sd", "log_sd = 1.25")? })
}

fn ordered(table: TomlTable<'_>, lower: f64, upper: f64) -> Result<(f64, f64)> {
    if lower < upper && (upper - lower).is_finite() {
        return Ok((lower, upper));
    }
    let key = if table.has("upper") { "upper" } else { "lower" };
    Err(table.refuse(key, format!("`upper` = {upper} is not above `lower` = {lower}"), "give `lower` below `upper`"))
}

#[cfg(test)]
#[path = "prior_tests.rs"]
mod tests;
