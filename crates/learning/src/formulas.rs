//! Formulas that may replace a learnt function.

use laws::stages::State;

/// A formula with its parameters, as in its file.
pub struct FormulaText {
    /// Formula as a text in the state and the parameters.
    pub text: String,
    /// Parameters of the formula.
    pub parameters: Vec<Parameter>,
}

/// A parameter of a formula.
pub struct Parameter {
    /// Name in the formula.
    pub name: &'static str,
    /// Unit of the parameter.
    pub unit: String,
    /// Prior, as a table in TOML.
    pub prior: String,
    /// True if the parameter has the null 0.
    pub has_null: bool,
    /// True if the parameter must be positive.
    pub is_positive: bool,
}

/// Returns all formulas for a state between `low` ≤ 0 and `high` ≥ 0: linear, exponential, saturating, threshold, step, bump, quadratic and power. Signed states also have a
/// sigmoid.
pub fn formulas(state: State, [low, high]: [f64; 2]) -> Vec<FormulaText> {
    let (s, size) = (state.name(), high.max(-low));
    let of_size = if state.has_sign() { format!("abs({s})") } else { s.to_string() };
    // If only positive states occur, a function of the state's absolute value is identical.
    let states = if low < 0.0 { vec![s.to_string(), of_size.clone()] } else { vec![s.to_string()] };
    let unit = state.unit();
    let (per, square) = (inverse(unit), inverse(&square(unit)));
    let normal = |sd: f64| format!("{{ distribution = \"normal\", mean = 0.0, sd = {} }}", number(sd));
    let free = |name: &'static str, unit: &str, sd: f64| Parameter {
        name,
        unit: unit.into(),
        prior: normal(sd),
        has_null: true,
        is_positive: false,
    };
    let length = |name: &'static str, median: f64, log_sd: f64| Parameter {
        name,
        unit: unit.into(),
        prior: format!("{{ distribution = \"log_normal\", median = {}, log_sd = {log_sd} }}", number(median)),
        has_null: false,
        is_positive: true,
    };
    let between = |name: &'static str| Parameter {
        name,
        unit: unit.into(),
        prior: format!("{{ distribution = \"uniform\", lower = 0.0, upper = {} }}", number(size)),
        has_null: false,
        is_positive: true,
    };
    let rate = || free("rate", &per, 1.0 / size);
    let gain = || free("gain", "1", 1.0);
    let mut list = Vec::new();
    let mut add = |text: String, parameters: Vec<Parameter>| list.push(FormulaText { text, parameters });
    for x in &states {
        add(format!("1 + rate*{x}"), vec![rate()]);
        add(format!("exp(rate*{x})"), vec![rate()]);
        add(
            format!("exp(gain*(1 - exp(-abs({s})/scale)))").replace(&format!("abs({s})"), x),
            vec![gain(), length("scale", 0.3 * size, 1.0)],
        );
        add(format!("exp(rate*max(0, {x} - limit))"), vec![rate(), between("limit")]);
        let step = format!("(0.5 + 0.5*tanh(({x} - limit)/width))");
        add(format!("exp(gain*{step})"), vec![gain(), between("limit"), length("width", 0.1 * size, 1.0)]);
        let bump = format!("exp(-(({x} - limit)/width)^2)");
        add(format!("exp(gain*{bump})"), vec![gain(), between("limit"), length("width", 0.2 * size, 1.0)]);
    }
    for text in [format!("1 + curvature*{s}^2"), format!("exp(curvature*{s}^2)")] {
        add(text, vec![free("curvature", &square, 1.0 / (size * size))]);
    }
    add(format!("exp(rate*{s} + bend*{s}^2)"), vec![rate(), free("bend", &square, 1.0 / (size * size))]);
    add(format!("(1 + {of_size}/scale)^power"), vec![free("power", "1", 1.0), length("scale", 0.1 * size, 1.5)]);
    if state.has_sign() {
        add(format!("exp(gain*tanh({s}/scale))"), vec![gain(), length("scale", 0.3 * size, 1.0)]);
    }
    list
}

fn number(value: f64) -> String {
    format!("{value:.2e}")
}

fn inverse(unit: &str) -> String {
    match unit.split_once('/') {
        Some((over, under)) => format!("{under}/{over}"),
        None => format!("1/{unit}"),
    }
}

fn square(unit: &str) -> String {
    match unit.split_once('/') {
        Some((over, under)) => format!("{over}^2/{under}^2"),
        None => format!("{unit}^2"),
    }
}

impl FormulaText {
    /// Returns the text of the file that defines an effect with this formula.
    pub fn file(&self, name: &str, quantity: &str, state: &str, summary: &str) -> String {
        let mut text = format!(
            "# Learnt from data by `vitreo-uq learn`; SI units.\nname = {name:?}\nsummary = {summary:?}\nquantity = {quantity:?}\nstate = {state:?}\nfactor = {:?}\n",
            self.text
        );
        for parameter in &self.parameters {
            text += &format!("\n[parameters.{}]\nunit = {:?}\n", parameter.name, parameter.unit);
            if parameter.has_null {
                text += "null = 0.0\n";
            }
            if parameter.is_positive {
                text += "lower = 0.0\n";
            }
            text += &format!("prior = {}\n", parameter.prior);
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use posterior::study::effect_file;

    /// Every formula of every state gives a file that passes the checks of a user's file.
    #[test]
    fn every_formula_is_an_effect() {
        for state in State::ALL {
            let name = state.name();
            let all = formulas(state, [if state.has_sign() { -2e-3 } else { 0.0 }, 2e-3]);
            assert!(all.len() >= 9);
            for (number, written) in all.iter().enumerate() {
                let slug = format!("formula-{}-{number}", name.replace('_', "-"));
                let text = written.file(&slug, "young_modulus_pa", name, "a test");
                assert_eq!(effect_file::parsed("f.toml".as_ref(), &text).expect(&text).slug, slug);
            }
        }
    }
}
