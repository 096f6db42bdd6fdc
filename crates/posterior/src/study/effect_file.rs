//! Effects that a TOML file defines. A formula or a table makes a quantity of the model depend on a state, such as the path (formats §2, physics §5.3).
//!
//! ```toml
//! name = "hardening"
//! quantity = "young_modulus_pa"      # force, position, or a modulus or viscosity of the law
//! state = "path"                     # position, path, time, time_since_step, velocity, force, largest_excursion, strain
//! factor = "exp(rate * path)"        # or `addend`, in the quantity's unit; SI throughout
//!
//! [parameters.rate]
//! unit = "1/m"
//! null = 0.0
//! prior = { distribution = "normal", mean = 0.0, sd = 1e3 }
//! ```

use std::path::Path;

use crate::prior::distribution_of;
use base::error::{Error, InputPlace, Result};
use base::files::{self, Content};
use base::number::{Dual, Scalar as _};
use base::parameter::{ParameterSpec, Support};
use base::toml_input::{TomlInput, TomlTable, text_of};
use base::units::nearest_name;
use laws::rheology::BaseLaw;
use laws::stages::{Operation, State, StateFunction};
use models::effects::{Effect, EffectParameter, Formula, QuantityName, ScaleFunction, StateEffect, define, defined};

const KEYS: [&str; 8] = ["addend", "factor", "name", "parameters", "quantity", "state", "summary", "table"];
const EXAMPLE: &str = "factor = \"exp(rate * path)\"";
/// Largest number of parameters of an effect.
const MOST_PARAMETERS: usize = 12;
/// Largest number of points of a table of factors.
const MOST_POINTS: usize = 1000;

/// Returns true if a name on the command line is the path of an effect file, which ends in `.toml`.
pub fn is_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension == "toml")
}

/// Reads an effect from its file and registers its name.
///
/// # Errors
/// [`Error::File`] if the file cannot be read; [`Error::Input`] with file, line, key and remedy if its content is invalid.
pub fn read(path: &Path) -> Result<&'static str> {
    let bytes = files::read(path, Content::Settings, "give an effect's file that exists and can be read")?;
    from_text(path, text_of(path, &bytes)?)
}

/// Reads an effect from the text of an effect file and registers its name. Only error messages use the path `file`.
///
/// # Errors
/// Errors of [`read`].
pub fn from_text(file: &Path, text: &str) -> Result<&'static str> {
    let document = TomlInput::parse(file, text)?;
    let definition: toml::Table = text.parse().map_err(|error| {
        Error::input(InputPlace::file(file), format!("not valid TOML: {error}"), "correct the syntax")
    })?;
    from_table(&document.root(), definition)
}

/// Parses the text of an effect file without registering the effect's name, for a caller that generates the text.
///
/// # Errors
/// Errors of [`read`].
pub fn parsed(file: &Path, text: &str) -> Result<StateEffect> {
    effect(&TomlInput::parse(file, text)?.root())
}

/// Reads an effect from a TOML table, which comes from a `model.toml` or an effect file. Registers the effect's name with its `definition`.
///
/// # Errors
/// Errors of [`read`].
pub fn from_table(table: &TomlTable<'_>, definition: toml::Table) -> Result<&'static str> {
    let effect = effect(table)?;
    let slug = effect.slug;
    match define(definition, effect) {
        Ok(effect) => Ok(effect.slug()),
        Err(_) => Err(table.refuse(
            "name",
            format!("`{slug}` is already the name of another effect"),
            "give each effect a different name: a study keeps the definitions of its effects",
        )),
    }
}

fn effect(table: &TomlTable<'_>) -> Result<StateEffect> {
    table.only(&KEYS)?;
    let slug = table.required_text("name", "name = \"hardening\"")?;
    let is_slug = slug.starts_with(|c: char| c.is_ascii_lowercase())
        && slug.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-');
    if !is_slug {
        let remedy = "use lower-case letters, digits and hyphens, beginning with a letter, as in `hardening`";
        return Err(table.refuse("name", format!("`{slug}` cannot name an effect"), remedy));
    }
    if models::effects::EFFECTS.iter().any(|effect| effect.slug() == slug) {
        return Err(table.refuse("name", format!("`{slug}` is a built-in effect"), "give it another name"));
    }
    let state = state(table)?;
    let quantity = quantity(table)?;
    if state == State::Strain && !matches!(quantity, QuantityName::Element(_)) {
        let remedy = "let an element's modulus or viscosity depend on it, or choose another state";
        return Err(table.refuse("state", "only an element's modulus or viscosity can depend on strain", remedy));
    }
    let parameters = parameters(table, &slug)?;
    let (operation, function, equation) = function(table, state, quantity, &parameters)?;
    check_vanishes_at_nulls(table, state, operation, function, &parameters)?;
    let summary = table
        .text("summary")?
        .unwrap_or_else(|| format!("{} depends on {}", quantity.name(), state.name().replace('_', " ")));
    Ok(StateEffect {
        slug: leak(slug),
        summary: leak(summary),
        equation: leak(equation),
        quantity,
        state,
        operation,
        function,
        parameters: Box::leak(
            parameters.into_iter().map(|(_, parameter)| parameter).collect::<Vec<_>>().into_boxed_slice(),
        ),
    })
}

/// Definition of a registered effect, as `model.toml` contains it; `None` for an unknown slug.
pub fn definition(slug: &str) -> Option<toml::Table> {
    defined(slug).map(|(_, definition)| definition)
}

/// Converts a text to a static one by leaking its memory. All effects have static names and texts, and a program reads few effect files.
pub fn leak(text: String) -> &'static str {
    Box::leak(text.into_boxed_str())
}

fn state(table: &TomlTable<'_>) -> Result<State> {
    let name = table.required_text("state", "state = \"path\"")?;
    State::named(&name).ok_or_else(|| {
        let names = State::ALL.map(State::name);
        let hint = nearest_name(&name, names).map_or(String::new(), |near| format!("did you mean `{near}`? "));
        table.refuse("state", format!("`{name}` is not a state"), format!("{hint}name one of {}", names.join(", ")))
    })
}

fn quantity(table: &TomlTable<'_>) -> Result<QuantityName> {
    let name = table.required_text("quantity", "quantity = \"young_modulus_pa\"")?;
    let is_identifier = name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    match &name[..] {
        "force" => Ok(QuantityName::Force),
        "position" => Ok(QuantityName::Position),
        _ if is_identifier && (name.ends_with("_pa") || name.ends_with("_pa_s")) => {
            let known = BaseLaw::NAMED.iter().flat_map(|law| law.parameters()).find(|spec| spec.name == name);
            Ok(QuantityName::Element(known.map_or_else(|| leak(name.clone()), |spec| spec.name)))
        }
        _ => Err(table.refuse(
            "quantity",
            format!("`{name}` cannot depend on a state"),
            "name `force`, `position`, or a modulus or viscosity of the law, such as `young_modulus_pa` or `gel_modulus_pa`",
        )),
    }
}

/// Reads the effect's parameters in alphabetical order. Each entry has the parameter's name in the formula.
fn parameters(table: &TomlTable<'_>, slug: &str) -> Result<Vec<(String, EffectParameter)>> {
    let Some(all) = table.table("parameters")? else { return Ok(Vec::new()) };
    let names: Vec<&str> = all.keys().collect();
    if names.len() > MOST_PARAMETERS {
        let found = format!("there are {} parameters", names.len());
        return Err(table.refuse("parameters", found, format!("give at most {MOST_PARAMETERS}")));
    }
    names.into_iter().map(|name| Ok((name.to_string(), parameter(&all, name, slug)?))).collect()
}

fn parameter(all: &TomlTable<'_>, name: &str, slug: &str) -> Result<EffectParameter> {
    let is_identifier = name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if !is_identifier || State::named(name).is_some() {
        return Err(all.refuse(
            name,
            "a parameter cannot have this name",
            "use letters, digits and underscores, but not a state's name",
        ));
    }
    let toml_table = all.required_table(name)?;
    toml_table.only(&["lower", "null", "prior", "symbol", "unit", "upper"])?;
    let unit = toml_table.required_text("unit", "unit = \"1/m\"")?;
    let support = Support {
        lower: toml_table.number("lower")?.unwrap_or(f64::NEG_INFINITY),
        upper: toml_table.number("upper")?.unwrap_or(f64::INFINITY),
    };
    let null = toml_table.number("null")?;
    if let Some(null) = null.filter(|null| !support.contains(*null)) {
        return Err(toml_table.refuse(
            "null",
            format!("{null} is outside {support}"),
            "give a null inside the parameter's ends",
        ));
    }
    let prior = toml_table.required_table("prior")?;
    let distribution = distribution_of(prior)?;
    let (lower, upper) = distribution.support();
    if lower < support.lower || upper > support.upper {
        return Err(toml_table.refuse(
            "prior",
            format!("the prior reaches [{lower}, {upper}], but the parameter must lie in {support}"),
            "narrow the prior, or widen `lower` and `upper`",
        ));
    }
    let source = prior.text("source")?.unwrap_or_else(|| "the effect's file".into());
    let symbol = toml_table.text("symbol")?.unwrap_or_else(|| name.to_string());
    let spec = ParameterSpec::new(leak(format!("{slug}.{name}")), leak(symbol), leak(unit), support);
    Ok(EffectParameter {
        spec,
        null: leaked_of_scales(null),
        prior: leaked_of_scales(distribution),
        prior_source: leak(source),
    })
}

fn leaked_of_scales<T: Copy + Send + Sync + 'static>(value: T) -> &'static ScaleFunction<T> {
    Box::leak(Box::new(move |_: &record::CharacteristicSizes| value))
}

fn function(
    table: &TomlTable<'_>,
    state: State,
    quantity: QuantityName,
    parameters: &[(String, EffectParameter)],
) -> Result<(Operation, &'static dyn StateFunction, String)> {
    let given: Vec<&str> = ["factor", "addend", "table"].into_iter().filter(|key| table.has(key)).collect();
    let [key] = given[..] else {
        let found = if given.is_empty() {
            "no function is given".to_string()
        } else {
            format!("{} are given", given.join(" and "))
        };
        return Err(
            table.refuse_whole(found, format!("write one of `factor`, `addend` and `table`, as in `{EXAMPLE}`"))
        );
    };
    let names: Vec<&str> = parameters.iter().map(|(name, _)| name.as_str()).collect();
    if key == "table" {
        let points = points(table)?;
        let [name] = names[..] else {
            return Err(table.refuse_whole(
                format!("a table has one parameter, but {} are given", names.len()),
                "give one parameter, the power of the table's factors, as in `[parameters.strength]` with `null = 0.0`; 1 gives the table's own factors",
            ));
        };
        let equation = format!("{} × table({})^{name}", quantity.name(), state.name());
        return Ok((Operation::Multiply, Box::leak(Box::new(CurvePoints(points))), equation));
    }
    let text = table.required_text(key, EXAMPLE)?;
    let formula = Formula::parse(&text, state.name(), &names).map_err(|mistake| {
        table.refuse(key, format!("column {} of the formula: {}", mistake.column, mistake.found), mistake.remedy)
    })?;
    if !formula.has_state() {
        let remedy = format!("write it with `{}`, or use another effect", state.name());
        return Err(table.refuse(key, format!("the formula does not depend on {}", state.name()), remedy));
    }
    if let Some(idle) = (0..names.len()).find(|place| !formula.has_parameter(*place)) {
        return Err(table.refuse(
            key,
            format!("`{}` does not occur in the formula", names[idle]),
            "use the parameter in the formula, or leave it out",
        ));
    }
    let (operation, sign) = if key == "factor" { (Operation::Multiply, '×') } else { (Operation::Add, '+') };
    Ok((operation, Box::leak(Box::new(WrittenFormula(formula))), format!("{} {sign} ({text})", quantity.name())))
}

/// Checks that the effect vanishes if every parameter with a null is at its null, for any values of the other parameters. The function must then be 0 as an addend and
/// 1 as a factor. The model with the effect thus contains the model without it.
fn check_vanishes_at_nulls(
    table: &TomlTable<'_>,
    state: State,
    operation: Operation,
    function: &dyn StateFunction,
    parameters: &[(String, EffectParameter)],
) -> Result<()> {
    let scales = record::CharacteristicSizes::default();
    let (neutral, word) = if operation == Operation::Add { (0.0, "0") } else { (1.0, "1") };
    if parameters.iter().all(|(_, parameter)| (parameter.null)(&scales).is_none()) {
        let remedy = "give `null` to the parameter that switches the effect off, as in `null = 0.0`";
        return Err(table.refuse_whole("no parameter has a null", remedy));
    }
    for probability in [0.2, 0.7] {
        let at = |(_, parameter): &(String, EffectParameter)| {
            Dual::constant(
                (parameter.null)(&scales).unwrap_or_else(|| (parameter.prior)(&scales).quantile(probability)),
            )
        };
        let values: Vec<Dual> = parameters.iter().map(at).collect();
        for size in [-1e-3, -1e-6, 0.0, 1e-7, 1e-4, 3.0].into_iter().filter(|size| state.has_sign() || *size >= 0.0) {
            let found = function.value(Dual::constant(size), &values).value;
            if found.is_nan() || (found - neutral).abs() > 1e-12 {
                return Err(table.refuse_whole(
                    format!("at the nulls the function is {found} for {} = {size} {}", state.name(), state.unit()),
                    format!("write the function so that it is {word} at the nulls, as in the model without the effect"),
                ));
            }
        }
    }
    Ok(())
}

/// State function that is given by a formula.
#[derive(Debug)]
struct WrittenFormula(Formula);

impl StateFunction for WrittenFormula {
    fn value(&self, state: Dual, parameters: &[Dual]) -> Dual {
        self.0.value(state, parameters)
    }
}

/// State function that is given by a table of factors. Each entry holds a state, the logarithm of its factor, and the slope there. Monotone cubics interpolate the
/// logarithms between the states. Beyond the first and the last state, the curve is constant. The interpolated logarithm is multiplied by the effect's parameter.
#[derive(Debug)]
struct CurvePoints(Vec<[f64; 3]>);

impl StateFunction for CurvePoints {
    fn value(&self, state: Dual, parameters: &[Dual]) -> Dual {
        (parameters[0] * interpolated(&self.0, state)).exp()
    }
}

/// Cubic interpolation at `state` through points (x, y, slope); constant beyond the first and the last point.
fn interpolated(points: &[[f64; 3]], state: Dual) -> Dual {
    let [first, .., last] = points else { return Dual::ZERO };
    if state.value <= first[0] || state.value >= last[0] {
        return Dual::constant(if state.value <= first[0] { first[1] } else { last[1] });
    }
    let place = points.partition_point(|point| point[0] <= state.value);
    let ([x0, y0, s0], [x1, y1, s1]) = (points[place - 1], points[place]);
    let width = x1 - x0;
    let t = (state - x0) * width.recip();
    let (rise, bend0, bend1) = (y1 - y0, s0 * width - (y1 - y0), (y1 - y0) - s1 * width);
    // The cubic is y0 + rise t + t (1 − t) ((1 − t) bend0 + t bend1).
    let rest = Dual::ONE - t;
    Dual::constant(y0) + t * rise + t * rest * (rest * bend0 + t * bend1)
}

/// Reads the points of a table: state, logarithm of the factor, and slope. The slopes keep the curve monotone between monotone points (F. N. Fritsch, J. Butland 1984,
/// doi:10.1137/0905021).
fn points(table: &TomlTable<'_>) -> Result<Vec<[f64; 3]>> {
    let example = "table = { state = [0.0, 1e-4, 1e-3], factor = [1.0, 1.2, 1.5] }";
    let toml_table = table.required_table("table")?;
    toml_table.only(&["factor", "state"])?;
    let [states, factors] = ["state", "factor"].map(|key| toml_table.numbers(key));
    let missing = |key: &str| toml_table.missing(key, example);
    let (states, factors) = (states?.ok_or_else(|| missing("state"))?, factors?.ok_or_else(|| missing("factor"))?);
    if states.len() != factors.len() || !(2..=MOST_POINTS).contains(&states.len()) {
        let found = format!("there are {} states and {} factors", states.len(), factors.len());
        return Err(toml_table.refuse(
            "factor",
            found,
            format!("give equally many states and factors, 2 to {MOST_POINTS}: `{example}`"),
        ));
    }
    if states.windows(2).any(|pair| pair[0] >= pair[1]) || states.iter().any(|x| !x.is_finite()) {
        return Err(toml_table.refuse("state", "the states do not increase", "sort them, and give each state once"));
    }
    if factors.iter().any(|factor| !(*factor > 0.0 && factor.is_finite())) {
        return Err(toml_table.refuse(
            "factor",
            "a factor is not above 0",
            "give positive factors of the quantity; 1 leaves it unchanged",
        ));
    }
    let y: Vec<f64> = factors.iter().map(|factor| factor.ln()).collect();
    let chord = |k: usize| (y[k + 1] - y[k]) / (states[k + 1] - states[k]);
    let slope = |k: usize| {
        if k == 0 || k + 1 == y.len() {
            return if k == 0 { chord(0) } else { chord(k - 1) };
        }
        let (before, after) = (chord(k - 1), chord(k));
        if before * after <= 0.0 {
            return 0.0;
        }
        let (w0, w1) = (states[k] - states[k - 1], states[k + 1] - states[k]);
        let share = (w0 + 2.0 * w1) / (3.0 * (w0 + w1));
        before * after / (share * after + (1.0 - share) * before)
    };
    Ok((0..y.len()).map(|k| [states[k], y[k], slope(k)]).collect())
}

#[cfg(test)]
#[path = "effect_file_tests.rs"]
mod tests;
